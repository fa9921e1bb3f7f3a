# SPDX-License-Identifier: GPL-3.0-or-later
"""Faces of a link without skin: those of a vertex group, and the excluded zones that cover them."""

from functools import lru_cache
from typing import Any

import bpy
import numpy as np

from ...common.arrays import Array, BoolArray
from ...common.errors import InvalidPlan
from ...common.warnings import Place, Warning
from ...skin.boards.ground import Zone
from ...skin.zones import discs_over
from .link_meshes import read_facets, read_placement

MIN_WEIGHT = 0.5  # [1] of each vertex of a face that belongs to the group. Larger: fewer faces
MAX_ZONE_RADIUS = 0.01  # [m] of one zone over a vertex group. Larger: fewer zones, which protrude more over the faces


def group_triangles(link: bpy.types.Object, group: str) -> Array:
    """Return the triangles of the faces whose vertices are all in a vertex group, shape (t, 3, 3) [m], link frame.

    The mesh is that with the modifiers, as for a fit: a modifier that mirrors faces mirrors their group.
    """
    if group not in link.vertex_groups:
        raise InvalidPlan(f"{link.name} has no vertex group {group!r}. Choose another one, or empty the field.")
    facets = read_facets(link, bpy.context)
    inside = _vertices_of(link, group)
    whole = np.ones(facets.polygons.max(initial=-1) + 1, bool)  # polygons with all their triangles in the group
    whole[facets.polygons[~inside[facets.faces].all(axis=1)]] = False
    points, faces = facets.triangles()
    return np.asarray(points[faces[whole[facets.polygons]]])


def _vertices_of(link: bpy.types.Object, group: str) -> BoolArray:
    """Return which vertices of the mesh with its modifiers are in a vertex group."""
    evaluated = link.evaluated_get(bpy.context.evaluated_depsgraph_get())
    if group not in evaluated.vertex_groups:
        raise InvalidPlan(f"The modifiers of {link.name} remove its vertex group {group!r}. Apply or change them.")
    index = evaluated.vertex_groups[group].index  # modifiers that join meshes change it
    data = evaluated.to_mesh()
    try:
        inside = np.zeros(len(data.vertices), bool)
        inside[[v.index for v in data.vertices for g in v.groups if g.group == index and g.weight >= MIN_WEIGHT]] = True
    finally:
        evaluated.to_mesh_clear()
    return inside


def triangles_of(link: bpy.types.Object, metre: float, chosen: BoolArray) -> Array:
    """Return the triangles of some faces of the mesh without modifiers, shape (t, 3, 3) [m], link frame."""
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


def zones_of(link: bpy.types.Object, group: str) -> tuple[Zone, ...]:
    """Return the excluded zones that cover the faces of a vertex group; none if it has no complete face."""
    triangles = group_triangles(link, group)
    return _zones_over(triangles.tobytes()) if len(triangles) else ()


@lru_cache(maxsize=8)  # Live and panels read a plan many times between two changes of a group
def _zones_over(triangles: bytes) -> tuple[Zone, ...]:
    discs = discs_over(np.frombuffer(triangles).reshape(-1, 3, 3), MAX_ZONE_RADIUS)
    return tuple(Zone(tuple(point.tolist()), radius) for point, radius in discs)


def groups_of(link: bpy.types.Object) -> tuple[tuple[Zone, ...], ...]:
    """Return the zones of the vertex groups of all boards of a link, to see whether one has changed."""
    return tuple(zones_of(link, skin.zone_group) for skin in _with_groups(link))


def empty_groups(link: bpy.types.Object) -> tuple[Warning, ...]:
    """Return a warning for each vertex group that boards stay off, and that has no complete face."""
    return tuple(
        Warning(
            "empty-group",
            "warning",
            f"{skin.name}: the vertex group {skin.zone_group!r} has no complete face, so that it excludes nothing.",
            Place(skin=skin.name),
            advice=f"Assign all vertices of the faces to it, with a weight of {MIN_WEIGHT:g} or more.",
        )
        for skin in _with_groups(link)
        if not zones_of(link, skin.zone_group)
    )


def _with_groups(link: bpy.types.Object) -> list[Any]:
    """Return the skins of a link that have a vertex group."""
    return [skin for skin in link.skin_calib.skins if skin.kind == "hexagons" and skin.zone_group]
