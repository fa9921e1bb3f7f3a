"""Rays inside a boundary that pass a rim or a hole of the cover, and hit a part of the mesh below it."""

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from ...common.arrays import Array, BoolArray, unit

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
        links = coo_array((np.ones(linked.sum(), bool), (a[linked], b[linked])), (number.size, number.size))
        part = connected_components(links, directed=False)[1]
        sizes = np.bincount(part, known)
        first, second = part[np.where(steps > 0, a, b)[~linked]], part[np.where(steps > 0, b, a)[~linked]]
        dropped = np.zeros(len(sizes), bool)
        for lower in np.unique(first)[np.argsort(-sizes[np.unique(first)], kind="stable")]:  # the largest first
            upper = second[first == lower]
            dropped[lower] = (~dropped[upper] & (sizes[lower] <= MAX_FRACTION * sizes[upper])).any()
        below = dropped[part] & known
    return below.reshape(number.shape)


def _slope(normals: Array, up: Array, aside: Array) -> Array:
    """Return how far planes with normals (p, 3) rise along ``up`` over steps ``aside`` across it, shape (p,) [m]."""
    cosines = np.einsum("pc,pc->p", normals, up)
    cosines = np.where(cosines < 0, -1.0, 1.0) * np.maximum(np.abs(cosines), MIN_COSINE)
    rise: Array = -np.einsum("pc,pc->p", normals, aside) / cosines
    return rise
