"""The smooth surface through the corners of facets, which are chords of it."""

import numpy as np

from ...common.arrays import Array, BoolArray, IntArray, cross, unit
from ..mesh.triangle_mesh import TriangleMesh
from ..sampling.basis import TensorBasis
from ..sampling.lines import LineGrid
from ..sampling.samples import RaySamples

# [rad] angle between adjacent facets above which their edge is meant to be sharp, so that no smooth surface covers
# it. The facets of a 12-gon have 30 degrees. Larger: coarser models are smoothed, and edges are rounded.
MAX_CHORD_ANGLE = np.deg2rad(40.0)
# [1] iterations from the facets to the surface through their corners; each leaves up to a third of the error. Larger:
# more accurate, more time.
CHORD_ITERATIONS = 5
# [1] Newton steps to the footpoints of the corners. Larger: more accurate over coarse meshes, more time.
FOOT_ITERATIONS = 2


def lift_to_corners(
    mesh: TriangleMesh,
    lines: LineGrid,
    basis: TensorBasis,
    offsets: Array,
    samples: RaySamples,
) -> tuple[Array, Array]:
    r"""Move a surface from the facets to the smooth surface through their corners.

    If the corners of a facet have the heights :math:`h_i` over the surface, the surface through the corners is further
    out than the surface by

    .. math::

        e + g = \sum_i b_i h_i \quad [\text{m}]

    over the point of the facet with the barycentric coordinates :math:`b_i`. Here :math:`e` is the residual of the ray,
    and :math:`g` the gap from the facet to the surface through its corners. Each iteration solves the least squares for
    these distances. The surface moves by the height of an arc only: rays and footpoints of the corners stay, and the
    heights change with the offsets.
    """
    k, l = samples.residuals.shape
    hit = np.flatnonzero(~np.isnan(samples.residuals))
    face, (rays, points) = samples.faces.ravel()[hit], (x.reshape(-1, 3)[hit] for x in (samples.rays, samples.points))
    corners = mesh.faces[face]
    weights = barycentric(mesh.vertices[corners], points)
    site = np.full(len(mesh.vertices), -1)  # one near each corner whose ray hit one of its faces
    site[corners] = hit[:, None]
    nearest = weights > 0.5
    site[corners[nearest]] = hit[np.nonzero(nearest)[0]]
    used = np.flatnonzero(site >= 0)
    number = np.empty(len(mesh.vertices), np.int64)
    number[used] = np.arange(len(used))
    vertices, site = mesh.vertices[used], site[used]
    start = samples.origins + samples.arms
    tangents = np.moveaxis(site_tangents(start, basis.is_closed), 2, 0).reshape(2, -1, 3)
    away, (by_row, by_column) = vertices - start.reshape(-1, 3)[site], tangents[:, site]
    at, net = np.column_stack(np.divmod(site, l)).astype(float), lines.origins + offsets[..., None] * lines.directions
    for _ in range(FOOT_ITERATIONS):
        at += np.stack(in_basis(by_row, by_column, away), axis=1)
        index, parts = basis.at(at)
        here = net.reshape(-1, 3)[index]
        foot, by_row, by_column = (np.matmul(part[:, None], here)[:, 0] for part in parts)
        away = vertices - foot
    normals = unit(cross(by_row, by_column))
    heights = np.einsum("kc,kc->k", away, normals)
    moves = parts[0] * np.matmul(lines.directions.reshape(-1, 3)[index], normals[:, :, None])[..., 0]
    weights /= np.einsum("kc,kc->k", rays, unit(cross(tangents[0, hit], tangents[1, hit])))[:, None]
    corners, limits = number[corners], largest_sagittas(mesh)[face]
    residuals, gaps = samples.residuals, np.zeros(k * l)
    for _ in range(CHORD_ITERATIONS):
        gap = np.einsum("kc,kc->k", weights, heights[corners]) - residuals.ravel()[hit]
        gaps[hit] = np.where(np.isfinite(gap), np.clip(gap, -limits, limits), 0.0)
        step = basis.solve(residuals + gaps.reshape(k, l), offsets)
        offsets, residuals = offsets + step, residuals - basis.N @ step @ basis.B.T
        heights = heights - (moves * step.ravel()[index]).sum(axis=1)
    return offsets, gaps.reshape(k, l)


def site_tangents(points: Array, closed: bool) -> Array:
    """Return the steps between adjacent sites along both directions."""
    arms = [np.gradient(points, axis=0), np.gradient(points, axis=1)]
    if closed:
        arms[1] = (np.roll(points, -1, axis=1) - np.roll(points, 1, axis=1)) / 2
    return np.stack(arms, axis=2)


def in_basis(a: Array, b: Array, displacements: Array) -> tuple[Array, Array]:
    """Return the components of displacements along two tangents."""
    aa, ab, bb, by_a, by_b = (
        (x * y).sum(axis=1) for x, y in ((a, a), (a, b), (b, b), (displacements, a), (displacements, b))
    )
    area = aa * bb - ab**2
    return (bb * by_a - ab * by_b) / area, (aa * by_b - ab * by_a) / area


def barycentric(triangles: Array, points: Array) -> Array:
    """Return the barycentric coordinates of points in the planes of triangles."""
    a, b, c = triangles[:, 0], triangles[:, 1], triangles[:, 2]
    normal = cross(b - a, c - a)
    square = np.maximum(np.einsum("kc,kc->k", normal, normal), 1e-300)
    pairs = (b, c), (c, a), (a, b)
    coordinates = [np.einsum("kc,kc->k", cross(q - p, points - p), normal) / square for p, q in pairs]
    return np.column_stack(coordinates)


def largest_sagittas(mesh: TriangleMesh) -> Array:
    r"""Return the largest distance of a smooth surface through its corners from each face, shape (f,) [m].

    An arc over a chord of length :math:`h` whose neighbors rotate by :math:`\theta` has the sagitta

    .. math::

        s = \frac{h\, \theta}{8}

    A face has three chords, and its centre has twice this distance. The distance is zero next to a sharp edge.
    """
    first, second, turn = edge_turns(mesh)
    steepest = np.zeros(len(mesh.faces))
    np.maximum.at(steepest, first, turn)
    np.maximum.at(steepest, second, turn)
    return np.where(steepest < MAX_CHORD_ANGLE, mesh.longest_sides * steepest / 4, 0.0)


def facet_sagittas(mesh: TriangleMesh) -> Array:
    r"""Return the distance of a smooth surface from each face, shape (f,) [m].

    The normal turns by :math:`\theta` over an edge of length :math:`l`. Across it, a face of area :math:`A` is
    :math:`2 A / l` wide, and its sagitta is

    .. math::

        s = \frac{2 A}{l}\, \frac{\theta}{4}

    The largest of the three edges counts. A sharp edge has none.
    """
    first, second, turn = edge_turns(mesh)
    ends = mesh.vertices[mesh.shared_edges]
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    turn = np.where(turn < MAX_CHORD_ANGLE, turn, 0.0)
    sagittas = np.zeros(len(mesh.faces))
    for side in (first, second):
        np.maximum.at(sagittas, side, mesh.face_areas[side] / np.maximum(length, np.finfo(float).tiny) * turn / 2)
    return sagittas


def sharp_vertices(mesh: TriangleMesh) -> BoolArray:
    """Return whether an edge at each vertex is meant to be sharp, shape (v,)."""
    found = np.zeros(len(mesh.vertices), bool)
    found[mesh.shared_edges[edge_turns(mesh)[2] >= MAX_CHORD_ANGLE]] = True
    return found


def edge_turns(mesh: TriangleMesh) -> tuple[IntArray, IntArray, Array]:
    """Return the two faces at each inner edge, shapes (e,), and the angle between their normals, shape (e,) [rad]."""
    first, second = mesh.adjacency
    cosine = (mesh.face_normals[first] * mesh.face_normals[second]).sum(axis=1)
    return first, second, np.arccos(np.clip(cosine, -1, 1))
