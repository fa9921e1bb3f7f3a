# SPDX-License-Identifier: GPL-3.0-or-later
"""Faces that an author leaves out of the cover by hand: a mark on each, and a modifier that hides what is marked.

Both are Blender's own: a file keeps them without the extension, the mesh is whole, and whatever reads the mesh with its
modifiers, a fit or an exported plan, goes without these faces. Objects may share a mesh; each has a mark of its own.
"""

import bpy
import numpy as np

from ...common.arrays import BoolArray
from ...common.errors import InvalidMesh

MARK = "skin_cut_away"  # name of the attribute of faces
NAME = "Skin Cut Away"  # of the modifier and its nodes
OURS = "skin_calib_mark"  # custom property of these nodes: the attribute they look at, whatever they are renamed to


def modifier_of(link: bpy.types.Object) -> bpy.types.Modifier | None:
    """The modifier that hides what was cut away from an object; None if nothing was."""
    return next((m for m in link.modifiers if m.type == "NODES" and m.node_group and OURS in m.node_group), None)


def selected(link: bpy.types.Object) -> BoolArray:
    """The faces that are selected and not cut away yet, shape (f,), of an object in Object Mode.

    Raises
    ------
    InvalidMesh
        If there is none, or no face would be left.
    """
    chosen = np.zeros(len(link.data.polygons), bool)
    link.data.polygons.foreach_get("select", chosen)
    gone = _marked(link)
    if not (chosen & ~gone).any():
        raise InvalidMesh(f"no face of {link.name} is selected that is still there; select those to cut away")
    if (chosen | gone).all():
        raise InvalidMesh(f"that would leave no face of {link.name}; select fewer")
    return chosen & ~gone


def cut(link: bpy.types.Object, chosen: BoolArray) -> None:
    """Cut faces (f,) away from an object in Object Mode, besides those that are gone already."""
    data, gone, modifier = link.data, _marked(link), modifier_of(link)
    mark = modifier.node_group[OURS] if modifier else MARK
    if mark in _marks_of_others(link) or not _can_mark(data.attributes.get(mark)):
        mark = _free(data)
    attribute = data.attributes.get(mark) or data.attributes.new(mark, "BOOLEAN", "FACE")
    attribute.data.foreach_set("value", gone | chosen)
    data.update()
    if modifier is None:
        modifier = link.modifiers.new(NAME, "NODES")
        link.modifiers.move(len(link.modifiers) - 1, 0)  # before others, which may lose the marks
        modifier = link.modifiers[0]
    if modifier.node_group is None or modifier.node_group[OURS] != mark:
        modifier.node_group = _nodes(mark)


def bring_back(link: bpy.types.Object) -> None:
    """Take the modifier away, and mark and nodes where nothing else uses them."""
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
    """Faces that are cut away from an object, shape (f,)."""
    gone, modifier = np.zeros(len(link.data.polygons), bool), modifier_of(link)
    attribute = link.data.attributes.get(modifier.node_group[OURS]) if modifier else None
    if attribute is not None and _can_mark(attribute):
        attribute.data.foreach_get("value", gone)
    return gone


def _can_mark(attribute: bpy.types.Attribute | None) -> bool:
    """Whether an attribute holds marks of faces, or is still to be made; an author may have another of its name."""
    return attribute is None or (attribute.domain, attribute.data_type) == ("FACE", "BOOLEAN")


def _marks_of_others(link: bpy.types.Object) -> set[str]:
    """Marks that other objects with the same mesh look at."""
    modifiers = (modifier_of(o) for o in bpy.data.objects if o != link and o.data == link.data)
    return {modifier.node_group[OURS] for modifier in modifiers if modifier}


def _free(data: bpy.types.Mesh) -> str:
    """A name for a mark that the mesh does not have."""
    return next(name for name in (f"{MARK}.{k:03d}" for k in range(1, 1000)) if name not in data.attributes)


def _nodes(mark: str) -> bpy.types.NodeTree:
    """Nodes that delete the faces with a mark."""
    made = next((g for g in bpy.data.node_groups if g.get(OURS) == mark and not g.library), None)
    if made:
        return made
    group = bpy.data.node_groups.new(NAME, "GeometryNodeTree")
    group[OURS], group.is_modifier = mark, True
    for way in ("INPUT", "OUTPUT"):
        group.interface.new_socket("Geometry", in_out=way, socket_type="NodeSocketGeometry")
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
