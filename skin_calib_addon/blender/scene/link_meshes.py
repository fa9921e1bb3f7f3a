# SPDX-License-Identifier: GPL-3.0-or-later
"""The mesh of a link: from its object to arrays in metres in the link frame.

The mesh of an imported link is in its frame as in the file, with the scale of the object. An empty above it is the
frame. Wherever the object is moved from there, its taxels are drawn with it, and do not change. For any other object,
the link frame is the pose of its parent, or the world where it has none. The object's own location, rotation and scale
place its mesh in that frame.
"""

from dataclasses import replace
from math import asin, degrees

import bpy
import numpy as np
from mathutils import Matrix, Vector

from ...common.arrays import Array, IntArray
from ...common.errors import InvalidMesh
from ...common.warnings import Warning
from ...geometry.mesh.triangle_mesh import METRES_PER_UNIT, TriangleMesh
from .facets import Facets
from .units import metres_per_unit, vector

# Deviation of a parent's matrix from a rotation with one scale, relative to the scale, above which it is refused.
MAX_FRAME_DEVIATION = 1e-4
# [m] and [rad] Difference of an object from its link frame above which there is a warning. Smaller: Blender's rounding
# makes warnings.
MAX_OFFSET, MAX_TURN = 1e-5, 1e-4
MAX_SCALE_DEVIATION = 1e-5  # [1] of a scale from that of a unit, likewise
# [fraction of the longest side] Change of the box of a mesh since its import above which it counts. Smaller: modifiers
# that hardly change the mesh count.
MAX_CHANGE = 1e-3


def read_mesh(link: bpy.types.Object, context: bpy.types.Context) -> TriangleMesh:
    """Return the object's mesh with its modifiers, in metres in the link frame."""
    return read_facets(link, context).mesh()


def read_facets(link: bpy.types.Object, context: bpy.types.Context, before: Facets | None = None) -> Facets:
    """Return the object's triangles with its modifiers, and their transformation into the link frame."""
    evaluated = link.evaluated_get(context.evaluated_depsgraph_get())
    if not evaluated.is_evaluated and link.modifiers:
        raise InvalidMesh(f"{link.name} is disabled in the viewport, so its modifiers are not evaluated. Enable it.")
    placed = read_placement(link, metres_per_unit(context.scene))
    data = evaluated.to_mesh()
    try:
        vertices = np.empty((len(data.vertices), 3), np.float32)
        corners = np.empty(len(data.loops), np.int32)
        if len(corners):  # attributes are read thirty times faster than vertices and loops
            data.attributes["position"].data.foreach_get("vector", vertices.ravel())
            data.attributes[".corner_vert"].data.foreach_get("value", corners)
        data.calc_loop_triangles()
        polygons = np.empty(len(data.loop_triangles), np.int32)  # read thirty times faster than where polygons start
        data.loop_triangle_polygons.foreach_get("value", polygons)
        found = Facets(link.name, vertices, np.empty((0, 3), np.int32), placed, corners, polygons)
        if before is not None and found.is_same(before):
            return before if before.name == link.name else replace(before, name=link.name)
        faces = np.empty((len(data.loop_triangles), 3), np.int32)
        data.loop_triangles.foreach_get("vertices", faces.ravel())
    finally:
        evaluated.to_mesh_clear()
    return replace(found, faces=faces)


def read_placement(link: bpy.types.Object, metre: float) -> Array:
    """Return the transformation of the object's own axes and units into the link frame, shape (3, 4) [m]."""
    unit = metre * _scale(link)
    placed = _own_scale(link) if is_frame(link) else _pose(link)  # in units of the frame
    return np.array([vector(row, unit) for row in placed[:3]])


def read_edges(link: bpy.types.Object, context: bpy.types.Context) -> tuple[Array, IntArray]:
    """Return vertices and edges of the object without its modifiers.

    A vertex that no modifier moves has exactly the coordinates of :func:`read_facets`.
    """
    vertices = np.empty(len(link.data.vertices) * 3, np.float32)
    link.data.vertices.foreach_get("co", vertices)
    edges = np.empty(len(link.data.edges) * 2, np.int32)
    link.data.edges.foreach_get("vertices", edges)
    placed = replace(read_facets(link, context), vertices=vertices.reshape(-1, 3))
    return placed.triangles()[0], edges.reshape(-1, 2)


def is_frame(link: bpy.types.Object) -> bool:
    """Return whether the pose of the object is the link frame, because it was imported."""
    return any(link.skin_calib.imported_box) or bool(link.skin_calib.urdf)  # older files have only the robot


def link_frame(link: bpy.types.Object) -> Matrix:
    """Return the link frame in the world: a rotation, and a translation in scene units."""
    thing, scale = (link, _own_scale(link)) if is_frame(link) else (link.parent, Matrix.Identity(4))
    if thing is None:
        return scale
    location, rotation, _ = (thing.matrix_world @ scale.inverted_safe()).decompose()
    return Matrix.LocRotScale(location, rotation, None)


def _own_scale(link: bpy.types.Object) -> Matrix:
    return Matrix.Diagonal((*(s * d for s, d in zip(link.scale, link.delta_scale)), 1))


def _pose(thing: bpy.types.Object) -> Matrix:
    """Return the matrix from an object to its parent, in units of the parent, without rounding by the parent's pose."""
    if thing.constraints or (thing.parent and thing.parent_type != "OBJECT"):
        return thing.matrix_local
    return thing.matrix_parent_inverse @ thing.matrix_basis if thing.parent else thing.matrix_basis


def _world(thing: bpy.types.Object | None) -> Matrix:
    """Return the matrix from an object to the world. Blender does not update that of a disabled object."""
    return _world(thing.parent) @ _pose(thing) if thing else Matrix.Identity(4)


def _scale(link: bpy.types.Object) -> float:
    """Return the scale of the link frame."""
    scale = _uniform_scale(_world(link) @ _own_scale(link).inverted_safe() if is_frame(link) else _world(link.parent))
    if scale is None:
        raise InvalidMesh(
            f"{_frame_name(link)}, the parent of {link.name} and so its link frame, is mirrored or has a scale that is "
            "not uniform. Apply its scale."
        )
    return float(f"{scale:.6g}")  # without the single-precision noise of a rotated frame


def _uniform_scale(matrix: Matrix | Array) -> float | None:
    """Return the scale of a matrix; None if it mirrors, stretches or shears."""
    axes = np.array(matrix)[:3, :3]
    scale = np.cbrt(np.linalg.det(axes))
    is_even = scale > 0 and np.abs(axes.T @ axes - scale**2 * np.eye(3)).max() <= MAX_FRAME_DEVIATION * scale**2
    return float(scale) if is_even else None


def _frame_name(link: bpy.types.Object) -> str:
    return link.parent.name if link.parent else "the origin of the world"


def placement_warnings(link: bpy.types.Object, metre: float) -> tuple[Warning, ...]:
    """Return what is unusual of the pose and the scale of an object in its link frame; nothing if a fit is refused."""
    try:
        placed = read_placement(link, metre)
    except InvalidMesh:
        return ()
    return tuple(filter(None, (_moved(link, metre), _scaled(link, placed, metre))))


def _moved(link: bpy.types.Object, metre: float) -> Warning | None:
    """Return a warning about an object that is away from its link frame."""
    location, rotation, _ = (_pose(link) @ _own_scale(link).inverted_safe()).decompose()
    offset = location.length * metre * _world(link.parent).median_scale
    turn = 2 * asin(min(1.0, Vector(rotation[1:]).length))  # exact for small angles, as `angle` is not
    moved = f"moved by {offset * 1e3:.4g} mm" if offset > MAX_OFFSET else ""
    turned = f"turned by {degrees(turn):.4g} degrees" if turn > MAX_TURN else ""
    if not (moved or turned):
        return None
    message = f"{link.name} is {' and '.join(filter(None, (moved, turned)))} from {_frame_name(link)}, its link frame."
    message += f" Its taxels {'do not ' if is_frame(link) else ''}move with it."
    is_kept = link.parent is not None and link.matrix_parent_inverse != Matrix.Identity(4)
    advice = "Use Object > Apply > Parent Inverse. Then clear" if is_kept else "Clear"
    advice += " its location and rotation (Alt G, Alt R), or apply them (Ctrl A) to move the mesh in the link frame."
    return Warning("moved-object", "warning", message, value=offset, advice=advice)


def _scaled(link: bpy.types.Object, placed: Array, metre: float) -> Warning | None:
    """Return a warning about an object that is not as large as at its import, or whose scale is not that of a unit."""
    scale, resized = _uniform_scale(placed), _since_import(link, placed)
    advice = "Correct the scale of the object and its parents, or apply it (Ctrl A) if it is right."
    if scale is None:
        message = f"{link.name} is mirrored, or has a scale that is not uniform. Its taxels are on the scaled mesh."
        return Warning("scaled-object", "warning", message, advice=advice)
    if resized is not None and abs(resized[0] - 1) > MAX_CHANGE:
        message = f"{link.name} is {resized[0]:.4g} times as large as it was at its import."
        advice = "Correct its scale, or the unit of the scene. If the size is right, import it again in its unit."
        return Warning("scaled-object", "warning", message, value=resized[0], advice=advice)
    if all(abs(scale / unit - 1) > MAX_SCALE_DEVIATION for unit in (metre, *METRES_PER_UNIT.values())):
        message = f"{link.name} has the scale {scale / metre:.4g}, which is no unit. Its taxels are on the scaled mesh."
        return Warning("scaled-object", "warning", message, value=scale / metre, advice=advice)
    if resized is not None and resized[1]:
        message = f"The mesh of {link.name} was moved by {resized[1] * 1e3:.4g} mm in its link frame since its import."
        return Warning("moved-mesh", "note", message, value=resized[1], advice="Its taxels are on the moved mesh.")
    return None


def _since_import(link: bpy.types.Object, placed: Array) -> tuple[float, float] | None:
    """Return by which factor and distance [m] the mesh was scaled and moved since its import; None if it was edited."""
    before = np.reshape(link.skin_calib.imported_box, (2, 3))
    corners = np.array(link.bound_box) @ placed[:, :3].T + placed[:, 3]
    now = np.stack((corners.min(axis=0), corners.max(axis=0)))
    sides, middles = np.diff((before, now), axis=1)[:, 0], np.mean((before, now), axis=1)
    limit, factor = MAX_CHANGE * sides[1].max(), sides[1].max() / (sides[0].max() or 1.0)
    if not before.any() or np.abs(sides[1] - factor * sides[0]).max() > limit:
        return None
    offset = float(np.linalg.norm(middles[1] - middles[0]))
    return float(factor), offset if offset > limit else 0.0
