"""Distances between a surface and a mesh, in both directions."""

import numpy as np
from scipy.spatial import cKDTree

from ...common.arrays import Array, BoolArray, IntArray, cross
from ...common.errors import EmptySection
from ...common.surface_errors import DistanceStatistics, SurfaceErrors
from ..mesh.closest import MeshDistance, split_faces
from ..mesh.triangle_mesh import TriangleMesh
from .bspline import MIN_SITES, BSplineSurface, sites_per_span

# [1] samples in each span, per direction, that measure distances. Not a multiple of 2, because facets often come in
# even numbers and samples with the period of the facets see only a part of them. Larger: more accurate maxima, more
# time.
SAMPLES_PER_SPAN = 5
# [1] grid points in each span, per direction, from which a footpoint search starts. Larger: safer start, more time.
STARTS_PER_SPAN = 3
# [1] most iterations of a footpoint search. Larger: no effect, because the search converges before.
MAX_FOOTPOINT_ITERATIONS = 8
# [1] step of the parameters below which a footpoint search has converged. Larger: less accurate footpoints.
FOOTPOINT_TOLERANCE = 1e-9
# [1] least number of points for which a search tree is built. It affects the time only.
MIN_TREE_POINTS = 8


def surface_errors(mesh: TriangleMesh, surface: BSplineSurface, known: BoolArray) -> SurfaceErrors:
    r"""Measure the distances between a surface and the mesh, where both exist.

    The mean, the root mean square and the maximum of each direction are weighted by area. The Hausdorff distance is

    .. math::

        d_H = \max\left( \max_{\mathbf{p} \in S} \min_{\mathbf{q} \in M} \lVert \mathbf{p} - \mathbf{q} \rVert,\;
        \max_{\mathbf{q} \in M} \min_{\mathbf{p} \in S} \lVert \mathbf{p} - \mathbf{q} \rVert \right) \quad [\text{m}]

    Parameters
    ----------
    mesh : TriangleMesh
        The mesh, [m] in the link frame.
    surface : BSplineSurface
        The surface, [m] in the link frame.
    known : array of bool, shape (k, l)
        Which sample sites of the fit hit the mesh. Parts of the surface next to other sites are left out.

    Returns
    -------
    SurfaceErrors
        [m]

    Raises
    ------
    EmptySection
        If no part of the surface is over the mesh.
    """
    uv, weights = surface_samples(surface)
    sampled = is_sampled(surface, uv, known)
    if not sampled.any():
        raise EmptySection("No sample ray hit the mesh next to another one, so the error is unknown. Move the planes.")
    to_mesh = DistanceStatistics.of(MeshDistance(mesh)(surface.points(uv[sampled]))[0], weights[sampled])
    points, areas, face = mesh_samples(mesh)
    foot, distance = footpoints(surface, points)
    # The mesh next to the surface: its footpoint is inside the surface, and its normal is parallel to the surface's (or
    # antiparallel, where the winding is wrong).
    adjacent = is_sampled(surface, foot, known)
    adjacent &= np.abs((surface.normals(foot) * mesh.face_normals[face]).sum(axis=1)) > 0.5
    for axis in (0, 1):
        if not surface.closed[axis]:
            adjacent &= (foot[:, axis] > 0) & (foot[:, axis] < 1)
    if not adjacent.any():
        raise EmptySection("No mesh face is near the surface with a matching normal. Move the planes.")
    to_surface = DistanceStatistics.of(distance[adjacent], areas[adjacent])
    return SurfaceErrors(to_surface, to_mesh, max(to_surface.max, to_mesh.max))


def is_sampled(surface: BSplineSurface, uv: Array, known: BoolArray) -> BoolArray:
    """Return whether all sample sites around each ``uv`` hit the mesh; the sites are even in u and v.

    Parameters
    ----------
    surface : BSplineSurface
        The surface, [m] in the link frame.
    uv : array, shape (m, 2)
        Parameters.
    known : array of bool, shape (k, l)
        Which sample sites hit the mesh.

    Returns
    -------
    array of bool, shape (m,)
    """
    k, l = known.shape
    row, column = uv[:, 0] * (k - 1), uv[:, 1] * (l if surface.closed[1] else l - 1)
    rows = (np.clip(f(row).astype(int), 0, k - 1) for f in (np.floor, np.ceil))
    columns = [f(column).astype(int) % l for f in (np.floor, np.ceil)]
    return np.logical_and.reduce([known[i, j] for i in rows for j in columns])


def surface_samples(surface: BSplineSurface) -> tuple[Array, Array]:
    """Return the parameters of a dense grid of cell centres, shape (k, 2), and the area of each cell [m^2]."""
    u, v = sample_lines(surface, SAMPLES_PER_SPAN)
    normals = cross(*surface.grid_tangents(u, v)).reshape(-1, 3)
    return _pairs(u, v), np.linalg.norm(normals, axis=1) / len(normals)


def sample_lines(surface: BSplineSurface, per_span: int) -> tuple[Array, Array]:
    """Return even parameters u and v at the centres of equal parts of the domain.

    Parameters
    ----------
    surface : BSplineSurface
        The surface, [m] in the link frame.
    per_span : int
        Parameters in each span; more where there are few spans.

    Returns
    -------
    u, v : array
    """
    spans = (len(np.unique(k[d : len(k) - d])) - 1 for k, d in zip((surface.knots_u, surface.knots_v), surface.degree))
    counts = (n * sites_per_span(per_span, n, MIN_SITES[closed]) for n, closed in zip(spans, surface.closed))
    u, v = ((np.arange(n) + 0.5) / n for n in counts)
    return u, v


def _pairs(u: Array, v: Array) -> Array:
    return np.column_stack((np.repeat(u, len(v)), np.tile(v, len(u))))


def mesh_samples(mesh: TriangleMesh) -> tuple[Array, Array, IntArray]:
    """Return points on the faces, at most 2 % of the mesh size apart, the area of each [m^2], and its face."""
    points, face, parts = split_faces(mesh, 0.02 * mesh.size)
    return points, mesh.face_areas[face] / parts[face] ** 2, face


def footpoints(surface: BSplineSurface, points: Array) -> tuple[Array, Array]:
    r"""Return the nearest surface point of each point.

    The nearest point of a dense grid is the start of Gauss-Newton iterations, which stay within the surface:

    .. math::

        \begin{pmatrix} \mathbf{S}_u \cdot \mathbf{S}_u & \mathbf{S}_u \cdot \mathbf{S}_v \\
        \mathbf{S}_u \cdot \mathbf{S}_v & \mathbf{S}_v \cdot \mathbf{S}_v \end{pmatrix}
        \begin{pmatrix} \delta u \\ \delta v \end{pmatrix} =
        \begin{pmatrix} \mathbf{S}_u \cdot (\mathbf{p} - \mathbf{S}) \\
        \mathbf{S}_v \cdot (\mathbf{p} - \mathbf{S}) \end{pmatrix}

    Parameters
    ----------
    surface : BSplineSurface
        The surface, [m] in the link frame.
    points : array, shape (k, 3)
        The points :math:`\mathbf{p}` [m].

    Returns
    -------
    uv : array, shape (k, 2)
    distance : array, shape (k,)
        [m]
    """
    lines = sample_lines(surface, STARTS_PER_SPAN)
    grid = surface.grid_points(*lines).reshape(-1, 3)
    if len(points) <= MIN_TREE_POINTS:
        index = np.array([int(np.argmin(((grid - p) ** 2).sum(axis=1))) for p in points], np.int64)
    else:
        index = np.asarray(cKDTree(grid).query(points)[1])
    uv = _pairs(*lines)[index]
    moving = np.arange(len(points))
    for _ in range(MAX_FOOTPOINT_ITERATIONS):
        r = surface.derivatives(uv[moving])
        gap = points[moving] - r[0, 0]
        a, b = r[1, 0], r[0, 1]
        aa, ab, bb = (a * a).sum(1), (a * b).sum(1), (b * b).sum(1)
        ga, gb = (gap * a).sum(1), (gap * b).sum(1)
        det = np.maximum(aa * bb - ab * ab, 1e-300)
        after = uv[moving] + np.column_stack(((bb * ga - ab * gb) / det, (aa * gb - ab * ga) / det))
        for axis in (0, 1):
            if not surface.closed[axis]:
                after[:, axis] = np.clip(after[:, axis], 0, 1)
        step = np.abs(after - uv[moving]).max(axis=1)
        uv[moving] = after
        moving = moving[step > FOOTPOINT_TOLERANCE]
        if len(moving) == 0:
            break
    uv = surface.wrap(uv)
    return uv, np.linalg.norm(points - surface.points(uv), axis=1)
