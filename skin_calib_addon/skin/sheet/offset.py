"""Parallel surfaces: the neutral layer of a skin with a thickness."""

import numpy as np

from ...common.arrays import pairs_of, unit
from ...common.errors import InvalidPlan, millimetres
from ...common.warnings import Place, point_of
from ...geometry.sampling.basis import spline_sites
from ...geometry.surface.bspline import BSplineSurface
from ...geometry.surface.distance import sample_lines

# Samples along each span of a parallel surface, and of the surface that is checked for folds. Larger: more exact, and
# slower.
PER_SPAN = 2


def offset_surface(surface: BSplineSurface, distance: float) -> BSplineSurface:
    r"""Return the parallel surface at a distance outward, with the same parameters.

    .. math:: S_h(u, v) = S(u, v) + h\,n(u, v) \quad [m]

    The parallel surface of a spline is not a spline. The result approximates it with twice the spans.
    """
    if distance == 0:
        return surface
    _check_folds(surface, distance)
    u, v = (
        spline_sites(2 * spans if closed else 2 * spans + degree, degree, closed, PER_SPAN)
        for spans, degree, closed in zip(_spans(surface), surface.degree, surface.closed)
    )
    sites = [np.linspace(0, 1, len(s.values), endpoint=not s.repeats) for s in (u, v)]
    uv = pairs_of(*sites)
    points = (surface.points(uv) + distance * surface.normals(uv)).reshape(len(sites[0]), len(sites[1]), 3)
    for axis, s in enumerate((u, v)):
        rows = np.moveaxis(points, axis, 0)
        net = (s.inverse @ rows.reshape(len(rows), -1)).reshape(-1, *rows.shape[1:])
        net = np.roll(net, s.shift, axis=0)
        points = np.moveaxis(np.concatenate((net, net[: s.repeats])), 0, axis)
    return BSplineSurface(points, u.knots, v.knots, surface.degree, surface.closed)


def _spans(surface: BSplineSurface) -> tuple[int, int]:
    n, m = (len(np.unique(k[d : len(k) - d])) - 1 for k, d in zip((surface.knots_u, surface.knots_v), surface.degree))
    return n, m


def _check_folds(surface: BSplineSurface, distance: float) -> None:
    u, v = sample_lines(surface, PER_SPAN)
    r = surface.derivatives(pairs_of(u, v), order=2)
    normals = unit(np.cross(r[1, 0], r[0, 1]))
    E, F, G = ((a * b).sum(axis=1) for a, b in ((r[1, 0], r[1, 0]), (r[1, 0], r[0, 1]), (r[0, 1], r[0, 1])))
    L, M, N = ((second * normals).sum(axis=1) for second in (r[2, 0], r[1, 1], r[0, 2]))
    # The eigenvalues of I - distance * (first fundamental form)^-1 (second) are the stretch of the parallel surface in
    # the principal directions. Both must be positive: test trace and determinant.
    trace = 2 - distance * (E * N - 2 * F * M + G * L) / (E * G - F**2)
    both = ((E - distance * L) * (G - distance * N) - (F - distance * M) ** 2) / (E * G - F**2)
    folded = np.flatnonzero((both <= 0) | (trace <= 0))
    if len(folded):
        place = r[0, 0, folded[0]]
        raise InvalidPlan(
            f"a skin {distance * 1e3:g} mm above the surface folds near {millimetres(place)}: the radius of curvature "
            "there is smaller than the offset. Reduce the offset, or fit a smoother surface",
            place=Place(point_of(place)),
        )
