"""Points of a surface at which its distance from a mesh is measured."""

import numpy as np

from ...common.arrays import Array, BoolArray, cross, norms, pairs_of
from .bspline import MIN_SITES, BSplineSurface, sites_per_span

# [1] least number of samples of a surface. Larger: more accurate means, more time.
MIN_SAMPLES = 10_000
# [1] least number of samples in each span, per direction. Larger: more accurate maxima of large nets, more time.
MIN_SAMPLES_PER_SPAN = 3


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
    u, v = dense_lines(surface)
    normals = cross(*surface.grid_tangents(u, v)).reshape(-1, 3)
    return pairs_of(u, v), norms(normals) / len(normals)


def dense_lines(surface: BSplineSurface) -> tuple[Array, Array]:
    """Return the parameters u and v of this grid."""
    least = np.sqrt(MIN_SAMPLES / (len(surface.spans[0].starts) * len(surface.spans[1].starts)))
    return sample_lines(surface, max(MIN_SAMPLES_PER_SPAN, int(np.ceil(least))))


def sample_lines(surface: BSplineSurface, per_span: int) -> tuple[Array, Array]:
    """Return even parameters u and v at the centres of equal parts of the domain."""
    counts = (
        len(s.starts) * sites_per_span(per_span, len(s.starts), MIN_SITES[closed])
        for s, closed in zip(surface.spans, surface.closed)
    )
    u, v = ((np.arange(n) + 0.5) / n for n in counts)
    return u, v
