"""The facets of a mesh, and their corners: parts of the shape that do not depend on its division into triangles."""

import numpy as np

from ...common.arrays import Array, BoolArray, IntArray, cross, distinct, norms
from ..components import components
from .triangle_mesh import TriangleMesh

# [rad] angle between faces below which they are in one plane. It is above the rounding of files in single precision,
# and below the noise of scans. Larger: fewer corners.
FLAT_ANGLE = 1e-3
# [1] error of an area, or of the side of a line, in relation to the facet. It is above the rounding of files in single
# precision. Larger: facets that are nearly triangles or quadrilaterals pass as such.
SHAPE_TOLERANCE = 1e-3


def facet_corners(mesh: TriangleMesh, faces: IntArray) -> BoolArray:
    """Return which vertices are corners of the facets that contain some faces, shape (v,).

    A facet is the largest connected part of a plane. A subdivision of the mesh changes neither facets nor corners.
    """
    facet = _facets(mesh)
    chosen = np.zeros(len(mesh.faces), bool)
    chosen[facet[faces]] = True
    of_facets = np.zeros(len(mesh.vertices), bool)
    of_facets[mesh.faces[chosen[facet]]] = True
    return are_corners(mesh, of_facets)


def _facets(mesh: TriangleMesh) -> IntArray:
    """Return the number of the facet of each face, shape (f,)."""
    a, b = mesh.adjacency
    flat = norms(cross(mesh.face_normals[a], mesh.face_normals[b])) < FLAT_ANGLE
    return components(len(mesh.faces), a[flat], b[flat])


def undivided(mesh: TriangleMesh, fixed: BoolArray) -> tuple[IntArray, IntArray]:
    """Return faces (g, 3) in which divided facets are whole, and the one (f,) that contains each face of the mesh.

    A quadrilateral without vertices inside stays: the sides of a tube keep its rings. Faces of all other facets stay,
    also where they have vertices on the side of a whole facet.
    """
    facet = _facets(mesh)
    examined = np.zeros(len(mesh.vertices), bool)
    examined[mesh.faces[np.bincount(facet)[facet] > 1]] = True  # all others are corners
    corner = are_corners(mesh, examined) | ~examined
    if corner.all():
        return mesh.faces, np.arange(len(mesh.faces))
    divided = np.zeros(len(mesh.faces), bool)
    divided[facet[(~corner)[mesh.faces].any(axis=1)]] = True
    faces = np.flatnonzero(divided[facet])
    other_facet, other = _vertices_of(mesh, facet, faces, ~corner)
    with_inside = other_facet[np.bincount(other)[other] == 1]
    corner_facet, corners = _vertices_of(mesh, facet, faces, corner)
    three, triangles = _convex(mesh, facet, *_polygons(corner_facet, corners, 3))
    four, quads = _convex(mesh, facet, *_polygons(corner_facet, corners, 4))
    free = ~fixed[quads].any(axis=1) & np.isin(four, with_inside)
    four, quads = four[free], quads[free]
    quads, half, in_four = _halves(mesh, facet, four, quads)
    stays = ~np.isin(facet, np.concatenate((three, four)))
    faces = np.concatenate((mesh.faces[stays], triangles, quads[:, [0, 1, 2]], quads[:, [2, 3, 0]]))
    in_three = np.isin(facet, three)
    parent = np.empty(len(mesh.faces), np.int64)
    parent[stays] = np.arange(stays.sum())
    parent[in_three] = stays.sum() + np.searchsorted(three, facet[in_three])
    parent[in_four] = stays.sum() + len(three) + half
    return faces, parent


def _vertices_of(mesh: TriangleMesh, facet: IntArray, faces: IntArray, chosen: BoolArray) -> tuple[IntArray, IntArray]:
    """Return pairs of a facet and a chosen vertex of some of its faces, each once, ascending; shapes (p,)."""
    row, place = np.nonzero(chosen[mesh.faces[faces]])
    face, count = faces[row], len(mesh.vertices)
    return np.divmod(distinct(facet[face] * count + mesh.faces[face, place]), count)


def _halves(
    mesh: TriangleMesh, facet: IntArray, chosen: IntArray, corners: IntArray
) -> tuple[IntArray, IntArray, IntArray]:
    """Divide quadrilaterals at the diagonal that fewer faces cross: corners (q, 4), and the half of each face."""
    inside = np.flatnonzero(np.isin(facet, chosen))
    quad = np.searchsorted(chosen, facet[inside])
    sides, crossed, lengths = [], [], []
    for start in (0, 1):
        ends = mesh.vertices[corners[:, [start, start + 2]]]
        along = ends[:, 1] - ends[:, 0]
        square = np.einsum("qc,qc->q", along, along)
        left = cross(mesh.face_normals[inside], along[quad]) / square[quad, None]
        side = np.einsum("fkc,fc->fk", mesh.triangles[inside] - ends[quad, :1], left)
        across = (side.min(axis=1) < -SHAPE_TOLERANCE) & (side.max(axis=1) > SHAPE_TOLERANCE)
        sides.append(side.mean(axis=1) > 0)
        crossed.append(np.bincount(quad, across, len(chosen)))
        lengths.append(square)
    other = np.where(crossed[0] == crossed[1], lengths[1] < lengths[0], crossed[1] < crossed[0])
    is_left = np.where(other[quad], sides[1], sides[0])
    return np.where(other[:, None], np.roll(corners, -1, axis=1), corners), quad + is_left * len(chosen), inside


def _polygons(of_facet: IntArray, vertex: IntArray, sides: int) -> tuple[IntArray, IntArray]:
    """Return the facets with so many corners, shape (k,), ascending, and their corners, shape (k, sides)."""
    facet, index, count = np.unique(of_facet, return_inverse=True, return_counts=True)
    return facet[count == sides], vertex[count[index] == sides].reshape(-1, sides)


def _convex(mesh: TriangleMesh, facet: IntArray, chosen: IntArray, corners: IntArray) -> tuple[IntArray, IntArray]:
    """Return the facets that their corners alone describe, shape (k,), and the corners in order, shape (k, sides)."""
    a_face = np.zeros(facet.max() + 1, np.int64)
    a_face[facet] = np.arange(len(facet))
    normals, areas = mesh.face_normals[a_face[chosen]], np.bincount(facet, mesh.face_areas)[chosen]
    points = mesh.vertices[corners]
    arms = points - points.mean(axis=1, keepdims=True)
    ahead = arms[:, :1]
    left = cross(normals[:, None], ahead)
    angles = np.arctan2((arms * left).sum(axis=2), (arms * ahead).sum(axis=2))
    order = np.argsort(angles, axis=1)
    corners, arms = np.take_along_axis(corners, order, 1), np.take_along_axis(arms, order[..., None], 1)
    steps = np.roll(arms, -1, axis=1) - arms
    turns = np.einsum("ksc,kc->ks", cross(steps, np.roll(steps, -1, axis=1)), normals)
    whole = np.einsum("ksc,kc->k", cross(arms, np.roll(arms, -1, axis=1)), normals) / 2
    good = (turns > 0).all(axis=1) & (np.abs(whole - areas) < SHAPE_TOLERANCE * areas)
    return chosen[good], corners[good]


def are_corners(mesh: TriangleMesh, chosen: BoolArray) -> BoolArray:
    r"""Return which of the chosen vertices are corners, shape (v,).

    A vertex is inside a plane, or on a straight line of the mesh, if one direction is in all faces around it. With
    their areas :math:`a_f` [m^2] and normals :math:`\mathbf{n}_f`, it is a corner if the least eigenvalue of

    .. math::

        \frac{\sum_f a_f\, \mathbf{n}_f \mathbf{n}_f^T}{\sum_f a_f}

    is above the square of ``FLAT_ANGLE``. (The matrix is the quadric of Garland and Heckbert, 1997.)
    """
    faces = np.flatnonzero(chosen[mesh.faces].any(axis=1))
    corner, normals, areas = mesh.faces[faces].ravel(), mesh.face_normals[faces], mesh.face_areas[faces]
    products = areas[:, None, None] * normals[:, :, None] * normals[:, None]

    def total(values: Array) -> Array:
        return np.asarray(np.bincount(corner, np.repeat(values, 3), len(mesh.vertices))[chosen], float)

    quadrics = np.stack([[total(products[:, i, j]) for j in range(3)] for i in range(3)])
    least = np.linalg.eigvalsh(np.moveaxis(quadrics, -1, 0))[:, 0]
    found = np.zeros(len(mesh.vertices), bool)
    found[chosen] = least > FLAT_ANGLE**2 * total(areas)
    return found
