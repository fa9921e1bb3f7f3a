"""Rays inside a boundary that pass a rim or a hole of the cover, and hit a part of the mesh below it."""

import numpy as np

from ...common.arrays import Array, BoolArray, unit
from ..components import components

# [m] step from one hit to the next, beyond what the slopes of both faces explain, above which they are on different
# parts. Larger: deeper holes pull the surface; smaller: edges of the cover are steps.
MIN_STEP = 1e-3
# [cosine] least one between a face and a ray for its slope. Larger: steeper faces count as steps.
MIN_COSINE = 0.2
# [fraction] of the hits of a part, up to which a part below it is not the cover. Larger: of a cover with a step, the
# smaller side counts as missed, instead of a surface that blends both and a warning.
MAX_FRACTION = 0.25


def below_rims(hits: Array, rays: Array, normals: Array, closed: bool) -> BoolArray:
    """Return which hits are on a small part of the mesh, one step below a larger one, shape (k, l).

    Hits at adjacent sites are on one part if the step between them is what the slopes of both faces explain.

    Parameters
    ----------
    hits : array, shape (k, l, 3)
        Points where rays hit the mesh [m]; NaN without a hit, or outside the boundary.
    rays : array, shape (k, l, 3)
        Unit directions of the rays, outward.
    normals : array, shape (k, l, 3)
        Unit normals of the faces that they hit, of either sign.
    closed : bool
        Whether the last column is next to the first.

    Returns
    -------
    array of bool, shape (k, l)
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
    below = np.zeros(number.size, bool)
    if not linked.all():
        part = components(number.size, a[linked], b[linked])
        sizes = np.bincount(part, known)
        up_to_b = steps[~linked] > 0
        a, b = part[a[~linked]], part[b[~linked]]
        lower, upper = np.where(up_to_b, a, b), np.where(up_to_b, b, a)
        dropped = np.zeros(len(sizes), bool)
        for i in sorted(np.unique(lower), key=lambda i: -sizes[i]):  # a part below one that is dropped may stay
            over = upper[lower == i]
            dropped[i] = (~dropped[over] & (sizes[i] <= MAX_FRACTION * sizes[over])).any()
        below = dropped[part] & known
    return below.reshape(number.shape)


def _slope(normals: Array, up: Array, aside: Array) -> Array:
    """Return how far planes with normals (p, 3) rise along ``up`` over steps ``aside`` across it, shape (p,) [m]."""
    cosines = np.einsum("pc,pc->p", normals, up)
    cosines = np.where(cosines < 0, -1.0, 1.0) * np.maximum(np.abs(cosines), MIN_COSINE)
    rise: Array = -np.einsum("pc,pc->p", normals, aside) / cosines
    return rise
