"""Where a new cut lies: across the link, with the larger part on the side that is kept."""

import numpy as np

from ...common.arrays import Array, along, unit
from ...common.errors import SkinCalibError
from ..mesh.triangle_mesh import TriangleMesh
from .axis import find_axis

# A direction this near to an axis of the link frame is meant to be that axis.
SNAP_COSINE = np.cos(np.radians(5.0))


def cut_normal(mesh: TriangleMesh, point: Array, direction: Array | None = None) -> Array:
    """Normal of the plane through a point across a direction, towards the larger part of the mesh, shape (3,) unit.

    Parameters
    ----------
    mesh : TriangleMesh
    point : array, shape (3,)
        [m], link frame.
    direction : array, shape (3,), optional
        Along the link, any length; the mesh's own if not given. One that is nearly an axis of the frame becomes it.
    """
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
    """Along the axis of a tube; of what is none, along its largest spread, shape (3,) unit."""
    try:
        return find_axis(mesh).e3
    except SkinCalibError:
        centres, areas = mesh.triangles.mean(axis=1), mesh.face_areas
        arms = centres - areas @ centres / areas.sum()
        return np.linalg.eigh(np.einsum("f,fi,fj->ij", areas, arms, arms))[1][:, 2]
