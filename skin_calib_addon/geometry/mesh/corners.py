"""The facets of a mesh, and their corners: parts of the shape that do not depend on its division into triangles."""

import numpy as np

from ...common.arrays import Array, BoolArray, IntArray
from ..components import components
from .triangle_mesh import TriangleMesh

# [rad] angle between faces below which they are in one plane. It is above the rounding of files in single precision,
# and below the noise of scans. Larger: fewer corners.
FLAT_ANGLE = 1e-3


def facet_corners(mesh: TriangleMesh, faces: IntArray) -> BoolArray:
    """Return which vertices are corners of the facets that contain some faces, shape (v,).

    A facet is the largest connected part of a plane. A subdivision of the mesh changes neither facets nor corners.

    Parameters
    ----------
    mesh : TriangleMesh
        The mesh.
    faces : array of int, shape (n,)
        Indices of the faces.

    Returns
    -------
    array of bool, shape (v,)
    """
    a, b = mesh.adjacency
    flat = np.linalg.norm(np.cross(mesh.face_normals[a], mesh.face_normals[b]), axis=1) < FLAT_ANGLE
    facet = components(len(mesh.faces), a[flat], b[flat])
    chosen = np.zeros(len(mesh.faces), bool)
    chosen[facet[faces]] = True
    of_facets = np.zeros(len(mesh.vertices), bool)
    of_facets[mesh.faces[chosen[facet]]] = True
    return are_corners(mesh, of_facets)


def are_corners(mesh: TriangleMesh, chosen: BoolArray) -> BoolArray:
    r"""Return which of the chosen vertices are corners, shape (v,).

    A vertex is inside a plane, or on a straight line of the mesh, if one direction is in all faces around it. With
    their areas :math:`a_f` [m^2] and normals :math:`\mathbf{n}_f`, it is a corner if the least eigenvalue of

    .. math::

        \frac{\sum_f a_f\, \mathbf{n}_f \mathbf{n}_f^T}{\sum_f a_f}

    is above the square of ``FLAT_ANGLE``. (The matrix is the quadric of Garland and Heckbert, 1997.)

    Parameters
    ----------
    mesh : TriangleMesh
        The mesh.
    chosen : array of bool, shape (v,)
        The vertices to examine.

    Returns
    -------
    array of bool, shape (v,)
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
