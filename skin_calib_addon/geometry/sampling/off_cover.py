"""Rays inside a boundary that miss the cover, and hit another part of the mesh."""

import numpy as np

from ...common.arrays import Array, BoolArray, unit
from ..components import components

# [m] step from one hit to the next, beyond what the slopes of both faces explain, above which they are on different
# parts. Larger: deeper holes pull the surface; smaller: edges of the cover are steps.
MIN_STEP = 1e-3
# [cosine] least one between a face and a ray for its slope. Larger: steeper faces count as steps.
MIN_COSINE = 0.2
# [fraction] of the hits of a part, up to which a part one step from it is not the cover. Larger: of a cover with a
# step, the smaller side counts as missed, instead of a surface that blends both and a warning.
MAX_FRACTION = 0.25


def off_cover(hits: Array, rays: Array, normals: Array, closed: bool) -> BoolArray:
    """Return which hits are not on the cover, shape (k, l).

    Hits at adjacent sites are on one part if the step between them is what the slopes of both faces explain. A small
    part is not the cover if it is one step below a larger one: rays pass a rim or a hole. It is not, either, if it is
    one step above a larger one and narrow along a rim, with no more sites than sides there: it hides a rim which is
    known to the distance of sites only. Of a single row of sites, half at the rim are enough: a fin leaves the rim. A
    single hit says nothing about a surface.
    """
    number = np.arange(hits[..., 0].size).reshape(hits.shape[:2])
    pairs = [(number[:-1], number[1:]), (number[:, :-1], number[:, 1:])]
    if closed:
        pairs.append((number[:, -1:], number[:, :1]))
    a, b = (np.concatenate([pair[i].ravel() for pair in pairs]) for i in (0, 1))
    hits, rays, normals = (x.reshape(-1, 3) for x in (hits, rays, normals))
    known = ~np.isnan(hits[:, 0])
    both = known[a] & known[b]
    a, b = a[both], b[both]
    apart, up = hits[b] - hits[a], unit(rays[a] + rays[b])
    steps = np.einsum("pc,pc->p", apart, up)
    aside = apart - steps[:, None] * up
    slopes = np.stack([_slope(normals[i], up, aside) for i in (a, b)])
    linked = (steps > slopes.min(axis=0) - MIN_STEP) & (steps < slopes.max(axis=0) + MIN_STEP)
    part = components(number.size, a[linked], b[linked])
    sizes = np.bincount(part, known)
    dropped = (sizes == 1) & (sizes.max(initial=0) > 1)
    if not linked.all():
        up_to_b = steps[~linked] > 0
        at_rim, free = (  # sides of each part without a hit next to them, and those without one on the same part
            np.bincount(part[known], 4.0 - np.bincount(next_to, minlength=number.size)[known], len(sizes))
            for next_to in (np.append(a, b), np.append(a[linked], b[linked]))
        )
        is_narrow = (sizes <= at_rim) | ((sizes <= 2 * at_rim) & (2 * sizes <= free))
        a, b = part[a[~linked]], part[b[~linked]]
        lower, upper = np.where(up_to_b, a, b), np.where(up_to_b, b, a)
        # The largest first: a part next to one that is dropped may stay.
        for i in sorted(np.unique(np.append(a, b)), key=lambda i: -sizes[i]):
            others = np.append(upper[lower == i], lower[(upper == i) & is_narrow[i]])
            dropped[i] |= (~dropped[others] & (sizes[i] <= MAX_FRACTION * sizes[others])).any()
    return (dropped[part] & known).reshape(number.shape)


def _slope(normals: Array, up: Array, aside: Array) -> Array:
    """Return how far planes with normals (p, 3) rise along ``up`` over steps ``aside`` across it, shape (p,) [m]."""
    cosines = np.einsum("pc,pc->p", normals, up)
    cosines = np.where(cosines < 0, -1.0, 1.0) * np.maximum(np.abs(cosines), MIN_COSINE)
    rise: Array = -np.einsum("pc,pc->p", normals, aside) / cosines
    return rise
