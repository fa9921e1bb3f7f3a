"""Points of a surface at which its distance from a mesh is measured."""

import numpy as np

from ...common.arrays import Array, BoolArray, cross, pairs_of
from .bspline import MIN_SITES, BSplineSurface, sites_per_span

# [1] samples in each span, per direction, that measure distances. Not a multiple of 2, because facets often come in
# even numbers and samples with the period of the facets see only a part of them. Larger: more accurate maxima, more
# time.
SAMPLES_PER_SPAN = 5


def is_sampled(surface: BSplineSurface, uv: Array, known: BoolArray, outside: BoolArray | None = None) -> BoolArray:
    """Return whether the sample sites around each ``uv`` hit the mesh; the sites are even in u and v.

    With a boundary, those outside it need no hit; but at least one of the four sites must have one.
    """
    k, l = known.shape
    row, column = uv[:, 0] * (k - 1), uv[:, 1] * (l if surface.closed[1] else l - 1)
    rows = (np.clip(f(row).astype(int), 0, k - 1) for f in (np.floor, np.ceil))
    columns = [f(column).astype(int) % l for f in (np.floor, np.ceil)]
    around = [(i, j) for i in rows for j in columns]
    hit = [known[at] for at in around]
    if outside is None:
        return np.logical_and.reduce(hit)
    return np.logical_and.reduce([h | outside[at] for h, at in zip(hit, around)]) & np.logical_or.reduce(hit)


def surface_samples(surface: BSplineSurface) -> tuple[Array, Array]:
    """Return the parameters of a dense grid of cell centres, shape (k, 2), and the area of each cell [m^2]."""
    u, v = sample_lines(surface, SAMPLES_PER_SPAN)
    normals = cross(*surface.grid_tangents(u, v)).reshape(-1, 3)
    return pairs_of(u, v), np.linalg.norm(normals, axis=1) / len(normals)


def sample_lines(surface: BSplineSurface, per_span: int) -> tuple[Array, Array]:
    """Return even parameters u and v at the centres of equal parts of the domain."""
    spans = (len(np.unique(k[d : len(k) - d])) - 1 for k, d in zip((surface.knots_u, surface.knots_v), surface.degree))
    counts = (n * sites_per_span(per_span, n, MIN_SITES[closed]) for n, closed in zip(spans, surface.closed))
    u, v = ((np.arange(n) + 0.5) / n for n in counts)
    return u, v
