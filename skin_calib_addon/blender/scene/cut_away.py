# SPDX-License-Identifier: GPL-3.0-or-later
"""Faces that an author removes from the cover by hand: a mark on each, and a modifier that deletes marked faces.

Both are of Blender: a file keeps them without the extension, and the mesh stays complete. A fit or an exported plan
reads the mesh with its modifiers, so without these faces. Each of several objects with one mesh has its own mark.
"""

import bpy
import numpy as np

from ...common.arrays import BoolArray
from ...common.errors import InvalidMesh

MARK = "skin_cut_away"  # name of the attribute of faces
NAME = "Skin Cut Away"  # of the modifier and its nodes
OURS = "skin_calib_mark"  # custom property of the nodes: the attribute that they use, also after they are renamed


def modifier_of(link: bpy.types.Object) -> bpy.types.Modifier | None:
    """Return the modifier that deletes the marked faces of an object; None if there is none."""
    return next((m for m in link.modifiers if m.type == "NODES" and m.node_group and OURS in m.node_group), None)


def selection_of(link: bpy.types.Object) -> BoolArray:
    """Return which faces of the mesh of an object are selected, shape (f,)."""
    chosen = np.zeros(len(link.data.polygons), bool)
    link.data.polygons.foreach_get("select", chosen)
    return chosen


def selected(link: bpy.types.Object) -> BoolArray:
    """Return which faces are selected and not cut away yet, shape (f,), of an object in Object Mode."""
    chosen, removed = selection_of(link), _marked(link)
    if not (chosen & ~removed).any():
        raise InvalidMesh(f"No remaining face of {link.name} is selected. Select the faces to cut away.")
    if (chosen | removed).all():
        raise InvalidMesh(f"No face of {link.name} would be left. Select fewer.")
    return chosen & ~removed


def cut(link: bpy.types.Object, chosen: BoolArray) -> None:
    """Cut faces away from an object in Object Mode, in addition to those before."""
    data, removed, modifier = link.data, _marked(link), modifier_of(link)
    mark = modifier.node_group[OURS] if modifier else MARK
    if mark in _marks_of_others(link) or not _can_mark(data.attributes.get(mark)):
        mark = _free(data)
    attribute = data.attributes.get(mark) or data.attributes.new(mark, "BOOLEAN", "FACE")
    attribute.data.foreach_set("value", removed | chosen)
    data.update()
    if modifier is None:
        modifier = link.modifiers.new(NAME, "NODES")
        link.modifiers.move(len(link.modifiers) - 1, 0)  # before other modifiers, which may remove the marks
        modifier = link.modifiers[0]
    if modifier.node_group is None or modifier.node_group[OURS] != mark:
        modifier.node_group = _nodes(mark)


def bring_back(link: bpy.types.Object) -> None:
    """Remove the modifier, and mark and nodes where nothing else uses them."""
    modifier = modifier_of(link)
    nodes = modifier.node_group
    mark = nodes[OURS]
    link.modifiers.remove(modifier)
    if mark in link.data.attributes and mark not in _marks_of_others(link):
        link.data.attributes.remove(link.data.attributes[mark])
    if not nodes.users:
        bpy.data.node_groups.remove(nodes)
    link.data.update()


def _marked(link: bpy.types.Object) -> BoolArray:
    """Return which faces are cut away from an object, shape (f,)."""
    removed, modifier = np.zeros(len(link.data.polygons), bool), modifier_of(link)
    attribute = link.data.attributes.get(modifier.node_group[OURS]) if modifier else None
    if attribute is not None and _can_mark(attribute):
        attribute.data.foreach_get("value", removed)
    return removed


def _can_mark(attribute: bpy.types.Attribute | None) -> bool:
    """Return whether an attribute is one of marks, or missing; the author may have another one of that name."""
    return attribute is None or (attribute.domain, attribute.data_type) == ("FACE", "BOOLEAN")


def _marks_of_others(link: bpy.types.Object) -> set[str]:
    """Return the marks that other objects with the same mesh use."""
    modifiers = (modifier_of(o) for o in bpy.data.objects if o != link and o.data == link.data)
    return {modifier.node_group[OURS] for modifier in modifiers if modifier}


def _free(data: bpy.types.Mesh) -> str:
    """Return a name for a mark that the mesh does not have."""
    return next(name for name in (f"{MARK}.{k:03d}" for k in range(1, 1000)) if name not in data.attributes)


def _nodes(mark: str) -> bpy.types.NodeTree:
    """Return nodes that delete the faces with a mark."""
    made = next((g for g in bpy.data.node_groups if g.get(OURS) == mark and not g.library), None)
    if made:
        return made
    group = bpy.data.node_groups.new(NAME, "GeometryNodeTree")
    group[OURS], group.is_modifier = mark, True
    for direction in ("INPUT", "OUTPUT"):
        group.interface.new_socket("Geometry", in_out=direction, socket_type="NodeSocketGeometry")
    start, end = group.nodes.new("NodeGroupInput"), group.nodes.new("NodeGroupOutput")
    marked, delete = group.nodes.new("GeometryNodeInputNamedAttribute"), group.nodes.new("GeometryNodeDeleteGeometry")
    marked.data_type, marked.inputs["Name"].default_value = "BOOLEAN", mark
    delete.domain, delete.mode = "FACE", "ALL"
    value = next(s for s in marked.outputs if s.enabled and s.name == "Attribute")
    group.links.new(start.outputs[0], delete.inputs["Geometry"])
    group.links.new(value, delete.inputs["Selection"])
    group.links.new(delete.outputs[0], end.inputs[0])
    for x, node in enumerate((start, marked, delete, end)):
        node.location = (200 * x, -150 * (node == marked))
    return group
