r"""Distances between a surface and its mesh, in both directions: exact maxima, and means of samples.

Estimates and upper bounds of all distances are cheap. Exact distances :math:`d_i` of a random sample correct the mean
of the estimates :math:`\hat{d}_j` with the fractions :math:`w_j` of the area. Half of the sample is drawn by area, half
by area times estimate, so that few large errors of estimates are not missed. With the slope :math:`b` of a regression:

.. math::

    \bar{d} = b \sum_j w_j \hat{d}_j + \sum_{i=1}^{n} q_i \left( d_i - b \hat{d}_i \right) \quad [\text{m}], \qquad
    q_i = \frac{2}{n} \left( 1 + \hat{d}_i \Big/ \sum_j w_j \hat{d}_j \right)^{-1}

The sample grows until the interval of confidence is narrow.

For the maximum, exact distances are computed from the largest bound on, until no other point can be further away.

The estimates from mesh to surface are expansions about nodes :math:`\mathbf{q}` of the surface. With the normal
:math:`\mathbf{n}`, the tangents :math:`J`, the first and the second fundamental form :math:`I` and :math:`II`, and
:math:`\mathbf{w} = \mathbf{p} - \mathbf{q}`:

.. math::

    \hat{d} = \left| \mathbf{n} \cdot \mathbf{w} - \tfrac{1}{2} \mathbf{w}^T J I^{-1} II\, I^{-1} J^T \mathbf{w}
    \right| \quad [\text{m}]
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from ...common.arrays import Array, BoolArray, IntArray, cross, pairs_of, unit
from ...common.errors import EmptySection
from ...common.surface_errors import DistanceStatistics
from ..mesh.closest import NearMesh
from ..mesh.triangle_mesh import TriangleMesh
from ..sampling.samples import RaySamples
from ..surface.bspline import BSplineSurface
from ..surface.distance import is_sampled, sample_lines
from ..surface.footpoints import descend, footpoints

# [1] points of the mesh, evenly by area, that give its means. Larger: narrower confidence intervals, more time.
MESH_POINTS = 10_000
# [1] most of them, where the surface covers only a small part of the mesh. Larger: narrower intervals there, more time.
MAX_MESH_POINTS = 16 * MESH_POINTS
# [1] exact distances that correct the means of estimates, at first. Larger: narrower confidence intervals, more time.
EXACT_POINTS = 100
# [1] factor by which these numbers grow while there are too few. It affects the time only.
EXACT_GROWTH = 4
# [fraction of the mean] half width of the confidence interval that is aimed at. Larger: less accurate means, less time.
MEAN_PRECISION = 0.03
# [1] mean sign of the cosines between the rays and the faces that they hit from which on the winding counts: inner
# walls, which face the other side, are no cover. Larger: inner walls count on meshes with some wrong faces.
MIN_MEAN_FACING = 0.5
# [1] points of the first round of the search for the maximum; each round has twice as many. It affects the time only.
FIRST_ROUND = 32
# [1] nodes in each span and direction. Larger: better estimates, more time.
NODES_PER_SPAN = 3
# [rad] rotation of the normal, over the distance of a point from its node, up to which the expansion is used. Beyond,
# the distance to the node is the estimate. Larger: faster, and the maximum is less safe where the surface is wavy.
EXPANSION_ANGLE = 0.5
# [1] ratio of the assumed error of an estimate to the largest error in the sample. Larger: safer maximum, more time.
SAFETY_FACTOR = 2.0
# [cosine] between the normals of a face and of the surface above which the face belongs to the cover, not to a wall.
# Larger: fewer faces count.
MIN_COVER_COSINE = 0.5
# [cosine] the same with the normal at the nearest node, before the footpoint is known. It affects the time only, unless
# the surface swings. Larger: faster, and the mean is less safe.
FIRST_COSINE = 0.0
# [standard deviations] half width of a 95 % confidence interval. Contract: as the documentation states it.
CONFIDENCE_FACTOR = 1.96

Exact = Callable[[IntArray], Array]
IsCover = Callable[[Array], BoolArray]  # from points (k, 3) [m] of a mesh to those that count


def statistics_of(
    estimates: Array, fractions: Array, exact: Exact, largest: float, is_sample: bool
) -> DistanceStatistics:
    """Return the statistics of distances from estimates and the exact distances of a random sample.

    The sample grows until the mean is known to `MEAN_PRECISION`, or as well as the points allow.
    """
    count, mean, rms, spread, own = EXACT_POINTS, 0.0, 0.0, np.inf, 0.0
    average = max(float((fractions * estimates).sum()), float(np.finfo(float).tiny))
    average_square = float((fractions * estimates**2).sum())
    density = fractions * (1 + estimates / average) / 2
    while spread > max(MEAN_PRECISION * mean, own) and count < EXACT_GROWTH * len(estimates):
        sample = stratified(density, min(count, len(estimates)))
        distances = exact(sample)
        weights = fractions[sample] / density[sample] / len(sample)
        mean, spread = corrected_mean(average, weights, estimates[sample], distances)
        mean = min(max(mean, 0.0), largest)
        squares = np.where(distances < 0, -1.0, distances**2)
        square = corrected_mean(average_square, weights, estimates[sample] ** 2, squares)[0]
        rms = min(max(square, mean**2) ** 0.5, largest)
        own = CONFIDENCE_FACTOR * float(np.sqrt((rms**2 - mean**2) / len(estimates))) if is_sample else 0.0
        count *= EXACT_GROWTH
    return DistanceStatistics(mean, rms, largest, float(np.hypot(spread, own)))


def corrected_mean(average: float, weights: Array, estimates: Array, exact: Array) -> tuple[float, float]:
    """Return a mean by regression on estimates, and half the width of its 95 % confidence interval."""
    counts = exact >= 0
    if not counts.any():
        return 0.0, np.inf
    values, part = np.where(counts, exact, 0.0), (weights * counts).sum() / weights.sum()
    slope = (weights * estimates * values).sum() / max((weights * estimates**2).sum(), np.finfo(float).tiny)
    residuals = values - slope * estimates
    mean = (slope * average + (weights * residuals).sum()) / part
    spread = np.std(weights * (residuals - mean * (counts - part))) * np.sqrt(len(weights)) / part
    return float(mean), float(CONFIDENCE_FACTOR * spread)


def stratified(fractions: Array, count: int) -> IntArray:
    """Return indices of a random sample in proportion to ``fractions`` (k,), one from each of ``count`` equal parts."""
    at = (np.arange(count) + np.random.default_rng(0).random(count)) / count
    return np.minimum(np.searchsorted(np.cumsum(fractions), at), len(fractions) - 1)


def largest_of(bounds: Array, exact: Exact, first_round: int = FIRST_ROUND) -> tuple[float, int]:
    """Return the largest distance and its index: exact distances from the largest bound on."""
    best, at, count, left = -1.0, -1, first_round, np.arange(len(bounds))
    while len(left):
        if count < len(left):
            split = np.argpartition(-bounds[left], count)
            chosen, left = left[split[:count]], left[split[count:]]
        else:
            chosen, left = left, left[:0]
        found = exact(chosen)
        i = int(np.argmax(found))
        if found[i] > best:
            best, at = float(found[i]), int(chosen[i])
        left, count = left[bounds[left] > best], 2 * count
    return best, at


@dataclass(frozen=True, eq=False)
class Expansion:
    """The signed distance from a surface, to second order about some of its points, the nodes."""

    uv: Array  # (k, 2)
    points: Array  # (k, 3) [m]
    normals: Array  # (k, 3)
    tangents: Array  # (k, 2, 3) along u and v [m]
    first: Array  # (k, 2, 2) first fundamental form [m^2]
    second: Array  # (k, 2, 2) second fundamental form [m]
    bend: Array  # (k, 3, 3) second derivatives of the distance by the point [1/m]
    curvature: Array  # (k,) [1/m] upper bound
    tree: cKDTree

    @classmethod
    def of(cls, surface: BSplineSurface) -> "Expansion":
        """Expand the distance about even parameters."""
        lines = sample_lines(surface, NODES_PER_SPAN)
        uv = pairs_of(*lines)
        r = surface.derivatives(uv, 2)
        a, b, points = r[1, 0], r[0, 1], r[0, 0]
        normals = unit(cross(a, b))
        tangents = np.stack((a, b), axis=1)
        first = tangents @ tangents.transpose(0, 2, 1)
        L, M, N = ((normals * x).sum(axis=1) for x in (r[2, 0], r[1, 1], r[0, 2]))
        second = np.stack((L, M, M, N), axis=1).reshape(-1, 2, 2)
        steps = solved(first, tangents)  # change of the parameters for a displacement of the point [1/m]
        bend = -steps.transpose(0, 2, 1) @ second @ steps
        curvature = np.sqrt(np.einsum("kij,kij->k", bend, bend))
        return cls(uv, points, normals, tangents, first, second, bend, curvature, cKDTree(points))

    def nearest(self, points: Array) -> IntArray:
        """Return the node nearest to each point."""
        return np.asarray(self.tree.query(points)[1])

    def __call__(self, surface: BSplineSurface, points: Array, node: IntArray) -> tuple[Array, Array, BoolArray]:
        r"""Return estimates and upper bounds of the distances, and whether footpoints are inside the surface.

        Near a node, the parameters of the footpoint follow from a step of Newton's method, with the height :math:`h`:

        .. math::

            (I - h\, II)\, \mathbf{d} = J^T \mathbf{w}

        Where the point is too far for the expansion, they follow from a descent from the node.
        """
        w, start, is_open = points - self.points[node], self.uv[node], np.logical_not(surface.closed)
        bounds, height = np.sqrt(np.einsum("kc,kc->k", w, w)), np.einsum("kc,kc->k", self.normals[node], w)
        matrix = self.first[node] - height[:, None, None] * self.second[node]
        uv = start + solved(matrix, np.einsum("kic,kc->ki", self.tangents[node], w)[:, :, None])[:, :, 0]
        is_far = bounds * self.curvature[node] >= EXPANSION_ANGLE
        slack = 2 * self.uv.min(axis=0)  # the distance of nodes
        may_be_inside = ((uv > -slack) & (uv < 1 + slack))[:, is_open].all(axis=1) | ~is_positive_definite(matrix)
        far = np.flatnonzero(is_far & may_be_inside)
        uv[far], bounds[far] = descend(surface, start[far], points[far])
        estimates, near = bounds.copy(), np.flatnonzero(~is_far)
        bent = (self.bend[node[near]] @ w[near, :, None])[:, :, 0]
        estimates[near] = np.abs(height[near] + np.einsum("kc,kc->k", bent, w[near]) / 2)
        return estimates, bounds, ((uv > 0) & (uv < 1))[:, is_open].all(axis=1)


def is_positive_definite(matrices: Array) -> BoolArray:
    """Return which symmetric matrices (k, 2, 2) are positive definite."""
    return (matrices[:, 0, 0] > 0) & (matrices[:, 0, 0] * matrices[:, 1, 1] > matrices[:, 0, 1] ** 2)


def solved(matrices: Array, right: Array) -> Array:
    """Return the solutions (n, 2) of two equations each; no meaning where a matrix is not positive definite."""
    a, b, c = (matrices[:, i, j, None] for i, j in ((0, 0), (0, 1), (1, 1)))
    determinant = np.maximum(a * c - b**2, np.finfo(float).tiny)
    x, y = right[:, 0], right[:, 1]
    return np.stack(((c * x - b * y) / determinant, (a * y - b * x) / determinant), axis=1)


def mesh_to_surface(
    mesh: TriangleMesh, surface: BSplineSurface, known: BoolArray, side: int, is_cover: IsCover | None = None
) -> DistanceStatistics:
    """Return the distances from the mesh to the surface: the maximum of all vertices, and means of samples by area.

    Only those parts of the mesh count that have their footpoint inside the surface, over sites that hit the mesh, with
    a normal nearly parallel to that of the surface. Where the winding of the faces is mixed, it may be antiparallel.
    They count at any distance: a fold that the surface misses is an error, and a part below it is not distinguished.
    """
    table = Expansion.of(surface)
    count, counts = MESH_POINTS, np.empty(0, np.int64)
    while len(counts) < MESH_POINTS / 2 and count <= MAX_MESH_POINTS:
        points, normals = points_by_area(mesh, count)
        if is_cover is not None:  # first: most of a large face can be off the cover
            kept = is_cover(points)
            points, normals = points[kept], normals[kept]
        node = table.nearest(points)
        estimates, _, inside = table(surface, points, node)
        over = inside & is_sampled(surface, table.uv[node], known)
        counts = np.flatnonzero(over & is_parallel(normals, table.normals[node], side, FIRST_COSINE))
        count *= EXACT_GROWTH
    rows = np.flatnonzero(np.ones(len(mesh.vertices), bool) if is_cover is None else is_cover(mesh.vertices))
    vertices = mesh.vertices[rows]

    def exact_distances(points: Array, is_on_cover: Callable[[IntArray, Array], BoolArray]) -> Exact:
        def exact(chosen: IntArray) -> Array:
            foot, found = footpoints(surface, points[chosen])
            counts = is_inside(surface, foot, known) & is_on_cover(chosen, surface.normals(foot))
            return np.where(counts, found, -1.0)

        return exact

    of_points = exact_distances(points, lambda chosen, of_surface: is_parallel(normals[chosen], of_surface, side))
    of_vertices = exact_distances(
        vertices, lambda chosen, of_surface: has_parallel_face(mesh, rows[chosen], of_surface, side)
    )
    if not len(counts):
        raise EmptySection("No mesh face is near the surface with a matching normal. Move the planes.")
    estimates = estimates[counts]
    even = np.full(len(counts), 1 / len(counts))
    sample = stratified(even, min(EXACT_POINTS, len(counts)))
    errors = np.abs(footpoints(surface, points[counts[sample]])[1] - estimates[sample])
    margin = SAFETY_FACTOR * float(errors.max())
    largest = max(
        largest_over(
            surface, table, margin, points, of_points, lambda of: is_parallel(normals, of, side, FIRST_COSINE)
        ),
        largest_over(
            surface,
            table,
            margin,
            vertices,
            of_vertices,
            lambda of: has_parallel_face(mesh, rows, of, side, FIRST_COSINE),
        ),
    )
    if largest < 0:
        raise EmptySection("No mesh face is near the surface with a matching normal. Move the planes.")
    return statistics_of(estimates, even, lambda chosen: of_points(counts[chosen]), largest, is_sample=True)


def winding(mesh: TriangleMesh, samples: RaySamples) -> int:
    """Return 1 if the faces that the rays hit face outward, -1 if they face inward, and 0 if they are mixed."""
    hit = ~np.isnan(samples.residuals)
    facing = np.sign((samples.rays[hit] * mesh.face_normals[samples.faces[hit]]).sum(axis=1)).mean()
    return int(np.sign(facing)) if abs(facing) > MIN_MEAN_FACING else 0


def points_by_area(mesh: TriangleMesh, count: int) -> tuple[Array, Array]:
    """Return random points of a mesh, evenly by area (Turk, Generating Random Points in Triangles, 1990)."""
    face = stratified(mesh.face_areas / mesh.face_areas.sum(), count)
    corners = mesh.vertices[mesh.faces[face]]
    a, b = np.random.default_rng(1).random((2, count, 1))
    a = np.sqrt(a)
    points = (1 - a) * corners[:, 0] + a * (1 - b) * corners[:, 1] + a * b * corners[:, 2]
    return points, unit(cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))


def largest_over(
    surface: BSplineSurface,
    table: Expansion,
    margin: float,
    points: Array,
    exact: Exact,
    may_count: Callable[[Array], BoolArray],
) -> float:
    """Return the largest distance from the surface of those points that count [m]; -1 if there is none."""
    node = table.nearest(points)
    estimates, bounds, inside = table(surface, points, node)
    over = np.flatnonzero(inside & may_count(table.normals[node]))
    return largest_of(np.minimum(estimates + margin, bounds)[over], lambda chosen: exact(over[chosen]))[0]


def is_parallel(normals: Array, of_surface: Array, side: int, least: float = MIN_COVER_COSINE) -> BoolArray:
    """Return which normals of faces are nearly parallel to those of the surface."""
    cosine = (normals * of_surface).sum(axis=1)
    return (side * cosine if side else np.abs(cosine)) > least


def is_inside(surface: BSplineSurface, foot: Array, known: BoolArray) -> BoolArray:
    """Return which footpoints (k, 2) are inside the surface, over sites that hit the mesh (``known``)."""
    inside = is_sampled(surface, foot, known)
    for axis in (0, 1):
        if not surface.closed[axis]:
            inside &= (foot[:, axis] > 0) & (foot[:, axis] < 1)
    return inside


def has_parallel_face(
    mesh: TriangleMesh, vertices: IntArray, normals: Array, side: int, least: float = MIN_COVER_COSINE
) -> BoolArray:
    """Return which vertices have a face that is nearly parallel to the surface."""
    row = np.full(len(mesh.vertices), -1, np.int64)
    row[vertices] = np.arange(len(vertices))
    a, b, c = mesh.corners
    used = np.flatnonzero((row[a] >= 0) | (row[b] >= 0) | (row[c] >= 0))
    corners = mesh.vertices[mesh.faces[used]]
    of_faces = unit(cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
    found = np.zeros(len(vertices), bool)
    for rows in row[mesh.faces[used]].T:
        parallel = (rows >= 0) & is_parallel(of_faces, normals[rows], side, least)
        found[rows[parallel]] = True
    return found


def surface_to_mesh(
    mesh: TriangleMesh, points: Array, bounds: Array, areas: Array, hit: IntArray
) -> tuple[DistanceStatistics, int]:
    """Return the distances from points of a surface to the mesh, and which of the points is furthest away."""
    bounds = bounds.copy()
    distance = NearMesh(mesh, hit)

    def exact(chosen: IntArray) -> Array:
        bounds[chosen] = np.minimum(bounds[chosen], distance(points[chosen], bounds[chosen]))
        return bounds[chosen]

    unknown = np.flatnonzero(np.isinf(bounds))
    if len(unknown):
        exact(unknown)
    estimates, fractions = bounds.copy(), areas / areas.sum()
    largest, index = largest_of(bounds, exact)
    return statistics_of(estimates, fractions, exact, largest, is_sample=False), index
