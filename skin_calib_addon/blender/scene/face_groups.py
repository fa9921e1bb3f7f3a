# SPDX-License-Identifier: GPL-3.0-or-later
"""Faces of a link without skin: those of a vertex group, and the excluded zones that cover them."""

from functools import lru_cache

import bpy
import numpy as np

from ...common.arrays import Array, BoolArray
from ...common.errors import InvalidPlan
from ...skin.boards.ground import Zone
from ...skin.zones import discs_over
from .link_meshes import read_placement

MIN_WEIGHT = 0.5  # [1] of each vertex of a face that belongs to the group. Larger: fewer faces
MAX_ZONE_RADIUS = 0.01  # [m] of one zone over a vertex group. Larger: fewer zones, which protrude more over the faces


def faces_of(link: bpy.types.Object, group: str) -> BoolArray:
    """Return which faces have all their vertices in a vertex group, shape (f,).

    Parameters
    ----------
    link : Object
        Mesh object of the link.
    group : str
        Name of the vertex group.

    Returns
    -------
    array of bool, shape (f,)

    Raises
    ------
    InvalidPlan
        If the link has no such group.
    """
    if group not in link.vertex_groups:
        raise InvalidPlan(f"{link.name} has no vertex group {group!r}. Choose another one, or empty the field.")
    if link.mode == "EDIT":
        link.update_from_editmode()
    index, data = link.vertex_groups[group].index, link.data
    inside = np.zeros(len(data.vertices), bool)
    inside[[v.index for v in data.vertices for g in v.groups if g.group == index and g.weight >= MIN_WEIGHT]] = True
    if not inside.any():
        return np.zeros(len(data.polygons), bool)
    corners, starts = np.empty(len(data.loops), np.int32), np.empty(len(data.polygons), np.int32)
    data.loops.foreach_get("vertex_index", corners)  # in Edit Mode there is no attribute that has them
    data.polygons.foreach_get("loop_start", starts)
    return np.asarray(np.logical_and.reduceat(inside[corners], starts))


def triangles_of(link: bpy.types.Object, metre: float, chosen: BoolArray) -> Array:
    """Return the triangles of some faces of the mesh without modifiers, shape (t, 3, 3) [m], link frame.

    Parameters
    ----------
    link : Object
        Mesh object of the link.
    metre : float
        Length of a scene unit [m].
    chosen : array of bool, shape (f,)
        The faces.

    Returns
    -------
    array, shape (t, 3, 3)
    """
    data = link.data
    data.calc_loop_triangles()
    corners, owners = np.empty(3 * len(data.loop_triangles), np.int32), np.empty(len(data.loop_triangles), np.int32)
    data.loop_triangles.foreach_get("vertices", corners)
    data.loop_triangle_polygons.foreach_get("value", owners)
    vertices = np.empty(3 * len(data.vertices), np.float32)
    data.vertices.foreach_get("co", vertices)
    placed = read_placement(link, metre)
    points = vertices.reshape(-1, 3) @ placed[:, :3].T + placed[:, 3]
    return np.asarray(points[corners.reshape(-1, 3)[chosen[owners]]])


def zones_of(link: bpy.types.Object, metre: float, group: str) -> tuple[Zone, ...]:
    """Return the excluded zones that cover the faces of a vertex group; none if it has no complete face.

    Parameters
    ----------
    link : Object
        Mesh object of the link.
    metre : float
        Length of a scene unit [m].
    group : str
        Name of the vertex group.

    Returns
    -------
    tuple of Zone
        In metres in the link frame.

    Raises
    ------
    InvalidPlan
        As :func:`faces_of`.
    """
    triangles = triangles_of(link, metre, faces_of(link, group))
    return _zones_over(triangles.tobytes()) if len(triangles) else ()


@lru_cache(maxsize=8)  # Live and panels read a plan many times between two changes of a group
def _zones_over(triangles: bytes) -> tuple[Zone, ...]:
    discs = discs_over(np.frombuffer(triangles).reshape(-1, 3, 3), MAX_ZONE_RADIUS)
    return tuple(Zone(tuple(point.tolist()), radius) for point, radius in discs)


def groups_of(link: bpy.types.Object, metre: float) -> tuple[tuple[Zone, ...], ...]:
    """Return the zones of the vertex groups of all boards of a link, to see whether one has changed.

    Parameters
    ----------
    link : Object
        Mesh object of the link.
    metre : float
        Length of a scene unit [m].

    Returns
    -------
    tuple of tuple of Zone
        In metres in the link frame.

    Raises
    ------
    InvalidPlan
        As :func:`faces_of`.
    """
    skins = (skin for skin in link.skin_calib.skins if skin.kind == "hexagons" and skin.zone_group)
    return tuple(zones_of(link, metre, skin.zone_group) for skin in skins)
