"""Distances between a surface and a mesh, in both directions."""

import numpy as np
from scipy.spatial import cKDTree

from ...common.arrays import Array, BoolArray, IntArray, cross
from ...common.errors import EmptySection
from ...common.surface_errors import DistanceStatistics, SurfaceErrors
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
# [1] most parts of one side of a face. Larger: denser samples on long faces, more memory.
MAX_PARTS = 64
# [1] least number of points for which a search tree is built. It affects the time only.
MIN_TREE_POINTS = 8
# [1] height to length of a triangle below which only its sides are used, because its normal is only rounding.
FLAT_TRIANGLE_RATIO = 1e-8


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


def split_faces(mesh: TriangleMesh, size: float) -> tuple[Array, IntArray, IntArray]:
    """Split long faces into congruent triangles with sides of at most ``size``, and return their centres.

    Parameters
    ----------
    mesh : TriangleMesh
        The mesh, [m] in the link frame.
    size : float
        [m]

    Returns
    -------
    centres : array, shape (p, 3)
        [m]
    face : array of int, shape (p,)
        Face of each centre.
    parts : array of int, shape (f,)
        Number of parts of each side of each face. A face has the square of this number of triangles.
    """
    corners = mesh.triangles
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    parts = np.clip(np.ceil(longest / size).astype(int), 1, MAX_PARTS)
    centres, face = [], []
    for k in np.unique(parts):
        chosen = np.flatnonzero(parts == k)
        i, j = (x.ravel() for x in np.meshgrid(np.arange(k), np.arange(k), indexing="ij"))
        up, down = i + j < k, i + j < k - 1  # triangles oriented like the face, and rotated by half a turn
        a = np.r_[i[up] + 1 / 3, i[down] + 2 / 3] / k
        b = np.r_[j[up] + 1 / 3, j[down] + 2 / 3] / k
        centres.append(np.einsum("sb,fbc->fsc", np.column_stack((1 - a - b, a, b)), corners[chosen]).reshape(-1, 3))
        face.append(np.repeat(chosen, len(a)))
    return np.concatenate(centres), np.concatenate(face), parts


class MeshDistance:
    """The exact distance from points to a mesh.

    A search tree of small triangles gives the candidates. The distances to their faces decide.
    """

    def __init__(self, mesh: TriangleMesh):
        self.triangles = mesh.triangles
        sides = np.linalg.norm(self.triangles - np.roll(self.triangles, 1, axis=1), axis=2).max(axis=1)
        centres, self.face, parts = split_faces(mesh, max(float(np.median(sides)), 0.01 * mesh.size))
        self.radius = 2 / 3 * float((sides / parts).max())  # largest distance of a point of a triangle from its centre
        self.tree = cKDTree(centres)

    def __call__(self, points: Array) -> tuple[Array, IntArray, Array]:
        """Return the distance [m], the nearest face and the nearest point of each point; shapes (k,), (k,), (k, 3)."""
        distance = np.full(len(points), np.inf)
        face = np.zeros(len(points), np.int64)
        nearest = np.zeros((len(points), 3))

        def try_pairs(which: IntArray, faces: IntArray) -> None:
            foot = closest_on_triangles(points[which], self.triangles[faces])
            d = np.linalg.norm(foot - points[which], axis=1)
            order = np.lexsort((d, which))  # the nearest candidate of each point comes first
            first = order[np.append(True, which[order][1:] != which[order][:-1])] if len(order) else order
            first = first[d[first] < distance[which[first]]]
            distance[which[first]], face[which[first]], nearest[which[first]] = d[first], faces[first], foot[first]

        open_, seen, k = np.arange(len(points)), 0, 8
        while len(open_):
            k = min(k, self.tree.n)
            far, index = map(np.asarray, self.tree.query(points[open_], k=np.arange(seen + 1, k + 1)))
            if seen == 0:
                try_pairs(open_, self.face[index[:, 0]])
            # The distance to a triangle is at least the distance to its centre minus the radius.
            row, column = np.nonzero(far - self.radius < distance[open_, None])
            try_pairs(open_[row], self.face[index[row, column]])
            open_ = open_[(far[:, -1] - self.radius < distance[open_]) & (k < self.tree.n)]
            seen, k = k, 2 * k
        return distance, face, nearest


def closest_on_triangles(points: Array, triangles: Array) -> Array:
    """Return the nearest point of each triangle to each point (Ericson, Real-Time Collision Detection, 5.1.5).

    Parameters
    ----------
    points : array, shape (k, 3)
        The points [m].
    triangles : array, shape (k, 3, 3)
        Corners of the triangles [m].

    Returns
    -------
    array, shape (k, 3)
    """
    a, b, c = triangles[:, 0], triangles[:, 1], triangles[:, 2]
    ab, ac, ap = b - a, c - a, points - a
    normal = np.cross(ab, ac)
    square = (normal**2).sum(axis=1)
    flat = square <= (FLAT_TRIANGLE_RATIO * np.maximum((ab**2).sum(axis=1), (ac**2).sum(axis=1))) ** 2
    square = np.where(flat, 1.0, square)
    v = (np.cross(ap, ac) * normal).sum(axis=1) / square
    w = (np.cross(ab, ap) * normal).sum(axis=1) / square
    best = a + v[:, None] * ab + w[:, None] * ac
    outside = (v < 0) | (w < 0) | (v + w > 1) | flat
    if outside.any():
        p = points[outside]
        best_edge = np.full(len(p), np.inf)
        for start, stop in ((a, b), (b, c), (c, a)):
            s, e = start[outside], stop[outside] - start[outside]
            t = np.clip(((p - s) * e).sum(axis=1) / np.maximum((e**2).sum(axis=1), 1e-300), 0, 1)
            q = s + t[:, None] * e
            d = ((p - q) ** 2).sum(axis=1)
            better = d < best_edge
            best_edge = np.where(better, d, best_edge)
            if start is a:
                edge = q
            else:
                edge[better] = q[better]
        best[outside] = edge
    return best


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
