"""The plane of a new cut: across the link, with the larger part on the side that is kept."""

import numpy as np

from ...common.arrays import Array, along, unit
from ...common.errors import SkinCalibError
from ..mesh.triangle_mesh import TriangleMesh
from .axis import find_axis

# [cosine] of the angle to an axis of the link frame, 5 degrees, below which a direction becomes this axis. Larger
# angle: more directions become an axis.
SNAP_COSINE = np.cos(np.radians(5.0))


def cut_normal(mesh: TriangleMesh, point: Array, direction: Array | None = None) -> Array:
    """Return the unit normal of a plane across a direction, towards the larger part of the mesh."""
    if direction is None:
        direction = long_direction(mesh)
    direction = unit(direction)
    axis = int(np.argmax(np.abs(direction)))
    if abs(direction[axis]) > SNAP_COSINE:
        direction = np.eye(3)[axis]
    heights = along(mesh.triangles.mean(axis=1) - point, direction)
    towards = (mesh.face_areas * np.sign(heights)).sum()
    return -direction if towards < 0 else direction


def long_direction(mesh: TriangleMesh) -> Array:
    """Return the unit direction of the axis of a tube, or of the largest extent of another mesh, shape (3,)."""
    try:
        return find_axis(mesh).e3
    except SkinCalibError:
        centres, areas = mesh.triangles.mean(axis=1), mesh.face_areas
        arms = centres - areas @ centres / areas.sum()
        return np.linalg.eigh(np.einsum("f,fi,fj->ij", areas, arms, arms))[1][:, 2]
