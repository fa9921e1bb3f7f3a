# SPDX-License-Identifier: GPL-3.0-or-later
"""The mesh of a link: from its object to arrays in metres in the link frame.

The link frame is the pose of the object's parent, or the world where it has none. The object's own location, rotation
and scale place the mesh in that frame; they are independent of the pose of the parent. A link of a URDF is different:
the URDF places its mesh in the link frame, so that the object is the frame and can be moved.
"""

from dataclasses import replace

import bpy
import numpy as np
from mathutils import Matrix

from ...common.arrays import Array, IntArray
from ...common.errors import InvalidMesh
from ...geometry.mesh.triangle_mesh import TriangleMesh
from .facets import Facets
from .units import metres_per_unit, vector

# Deviation of a parent's matrix from a rotation with one scale, relative to the scale, above which it is refused.
MAX_FRAME_DEVIATION = 1e-4


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
    return np.array([vector(row, unit) for row in _local(link)[:3]])


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


def _local(link: bpy.types.Object) -> Matrix:
    """Return the matrix from the object to its parent, in scene units, without rounding by the parent's pose."""
    if link.skin_calib.urdf:
        return Matrix.Diagonal((*link.scale, 1))
    if link.constraints or (link.parent and link.parent_type != "OBJECT"):
        return link.matrix_local
    return link.matrix_parent_inverse @ link.matrix_basis if link.parent else link.matrix_basis


def _scale(link: bpy.types.Object) -> float:
    """Return the scale of the parent."""
    if link.parent is None:
        return 1.0
    axes = np.array(_parent(link).to_3x3())
    scale = np.cbrt(np.linalg.det(axes))
    if scale <= 0 or np.abs(axes.T @ axes - scale**2 * np.eye(3)).max() > MAX_FRAME_DEVIATION * scale**2:
        raise InvalidMesh(
            f"{link.parent.name}, the parent of {link.name} and so its link frame, is mirrored or has a scale that is "
            "not uniform. Apply its scale."
        )
    return float(f"{scale:.6g}")  # without the single-precision noise of a rotated frame


def _parent(link: bpy.types.Object) -> Matrix:
    return link.matrix_world @ _local(link).inverted_safe()


def link_frame(link: bpy.types.Object) -> Matrix:
    """Return the link frame in the world: a rotation, and a translation in scene units."""
    if link.parent is None and not link.skin_calib.urdf:
        return Matrix.Identity(4)
    location, rotation, _ = _parent(link).decompose()
    return Matrix.LocRotScale(location, rotation, None)
