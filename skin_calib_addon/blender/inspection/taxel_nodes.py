# SPDX-License-Identifier: GPL-3.0-or-later
"""Geometry nodes and a material that show an attribute of taxels, by its name, in the colours of the heat maps."""

from typing import Any

import bpy
import numpy as np

from ..overlay.scales import UNKNOWN, Legend

NAME = "Skin Taxels"  # of nodes, modifier and material
OURS = "skin_calib_colours"  # custom property of the nodes: the attribute that they write
COLOUR = "skin_colour"  # attribute with the colours, which the material reads
# Inputs of the nodes, each with its kind and description.
INPUTS = {
    "Attribute": ("String", "Name of an attribute of faces"),
    "Minimum": ("Float", "Start of the scale"),
    "Maximum": ("Float", "End of the scale"),
    "Height": ("Float", "Height of the faces over the link, in metres"),
    "Size": ("Float", "Size of the faces relative to their cells"),
}
STEPS = 17  # colours of a scale in the nodes, which mix them linearly; Blender has up to 32. Smaller: other mixtures


def prepare(thing: bpy.types.Object, height: float, size: float) -> None:
    """Give an object the modifier and a material, if it lacks them; its faces are ``height`` [m] over the link."""
    if not thing.data.materials:
        thing.data.materials.append(_material())
    if modifier_of(thing) is None:
        modifier = thing.modifiers.new(NAME, "NODES")
        modifier.node_group = _nodes()
        _set(modifier, {"Height": height, "Size": size})


def show(thing: bpy.types.Object, attribute: str, minimum: float, maximum: float) -> None:
    """Let an object show an attribute of its faces, with the ends of the scale."""
    _set(modifier_of(thing), {"Attribute": attribute, "Minimum": minimum, "Maximum": maximum})
    thing.update_tag()


def shown(thing: bpy.types.Object) -> str:
    """Return the attribute that an object shows; empty without one."""
    modifier = modifier_of(thing)
    if modifier is None:
        return ""
    name = _input(modifier, "Attribute")
    return str(getattr(modifier.properties.inputs, name).value if hasattr(modifier, "properties") else modifier[name])


def _set(modifier: Any, values: dict[str, Any]) -> None:
    """Set inputs of a modifier; from Blender 5 on they are properties of it."""
    for name, value in values.items():
        identifier = _input(modifier, name)
        if hasattr(modifier, "properties"):
            getattr(modifier.properties.inputs, identifier).value = value
        else:
            modifier[identifier] = value


def modifier_of(thing: bpy.types.Object) -> Any:
    """Return the modifier of an object that shows an attribute; None without one."""
    ours = (m for m in thing.modifiers if m.type == "NODES" and m.node_group and m.node_group.get(OURS))
    return next(ours, None)


def _input(modifier: Any, name: str) -> str:
    """Return the identifier of an input of a modifier."""
    items = modifier.node_group.interface.items_tree
    return next(str(item.identifier) for item in items if item.name == name and item.in_out == "INPUT")


def _nodes() -> bpy.types.NodeTree:
    """Return nodes that raise faces and write the colours of an attribute: dark grey where it is not a number."""
    made = next((g for g in bpy.data.node_groups if g.get(OURS) == COLOUR and not g.library), None)
    if made:
        return made
    group = bpy.data.node_groups.new(NAME, "GeometryNodeTree")
    group[OURS], group.is_modifier = COLOUR, True
    new = group.interface.new_socket
    for direction in ("INPUT", "OUTPUT"):
        new("Geometry", in_out=direction, socket_type="NodeSocketGeometry")
    for name, (kind, description) in INPUTS.items():
        new(name, in_out="INPUT", socket_type=f"NodeSocket{kind}", description=description)
    start, end = _add(group, "NodeGroupInput", 0), _add(group, "NodeGroupOutput", 6)
    named = _add(group, "GeometryNodeInputNamedAttribute", 1, Name=start.outputs["Attribute"])
    value = _output(named, "Attribute")
    is_number = _add(group, "FunctionNodeCompare", 2, {"operation": "EQUAL"}, A=value, B=value)
    is_known = _add(group, "FunctionNodeBooleanMath", 3, {"operation": "AND"})
    group.links.new(is_number.outputs[0], is_known.inputs[0])
    group.links.new(_output(named, "Exists"), is_known.inputs[1])
    ends = {"From Min": start.outputs["Minimum"], "From Max": start.outputs["Maximum"]}
    position = _add(group, "ShaderNodeMapRange", 2, Value=value, **ends)
    is_signed = _add(group, "FunctionNodeCompare", 3, {"operation": "LESS_THAN"}, A=start.outputs["Minimum"], B=0.0)
    scales = {}
    for signed in (False, True):
        ramp = scales[str(signed)] = _add(group, "ShaderNodeValToRGB", 3)
        group.links.new(position.outputs[0], ramp.inputs[0])
        _fill(ramp.color_ramp, signed)
    colours = {name: ramp.outputs[0] for name, ramp in scales.items()}
    colour = {"input_type": "RGBA"}
    of_scale = _add(group, "GeometryNodeSwitch", 4, colour, Switch=is_signed.outputs[0], **colours)
    unknown = (*_linear(np.array(UNKNOWN)), 1.0)
    known = {"Switch": is_known.outputs[0], "False": unknown, "True": of_scale.outputs[0]}
    chosen = _add(group, "GeometryNodeSwitch", 4, colour, **known)
    on_faces = {"data_type": "FLOAT_COLOR", "domain": "FACE"}
    upwards = {"Vector": _add(group, "GeometryNodeInputNormal", 1).outputs[0], "Scale": start.outputs["Height"]}
    offset = _add(group, "ShaderNodeVectorMath", 2, {"operation": "SCALE"}, **upwards).outputs[0]
    raised = _add(group, "GeometryNodeSetPosition", 3, Geometry=start.outputs["Geometry"], Offset=offset).outputs[0]
    smaller = {"Geometry": raised, "Scale": start.outputs["Size"]}
    scaled = _add(group, "GeometryNodeScaleElements", 4, {"domain": "FACE"}, **smaller).outputs[0]
    written = {"Geometry": scaled, "Name": COLOUR, "Value": chosen.outputs[0]}
    store = _add(group, "GeometryNodeStoreNamedAttribute", 5, on_faces, **written)
    group.links.new(store.outputs[0], end.inputs[0])
    return group


def _material() -> bpy.types.Material:
    """Return a material with the colours that the nodes write."""
    made = next((m for m in bpy.data.materials if m.get(OURS) == COLOUR and not m.library), None)
    if made:
        return made
    material = bpy.data.materials.new(NAME)
    material[OURS] = COLOUR
    if material.node_tree is None:  # before Blender 5
        material.use_nodes = True
    tree = material.node_tree
    surface = next(node for node in tree.nodes if node.type == "BSDF_PRINCIPLED")
    read = _add(tree, "ShaderNodeAttribute", -2, {"attribute_type": "GEOMETRY", "attribute_name": COLOUR})
    tree.links.new(read.outputs["Color"], surface.inputs["Base Color"])
    return material


def _add(tree: Any, kind: str, column: int, settings: dict[str, str] | None = None, **inputs: Any) -> Any:
    """Add a node to a column, below those that are there; an input is a value, or the output of another node."""
    above = sum(node.location.x == 200 * column for node in tree.nodes)
    node = tree.nodes.new(kind)
    node.location = (200 * column, -220 * above)
    for name, value in (settings or {}).items():
        setattr(node, name, value)
    for name, value in inputs.items():
        socket = next(socket for socket in node.inputs if socket.enabled and socket.name == name)
        if isinstance(value, bpy.types.NodeSocket):
            tree.links.new(value, socket)
        else:
            socket.default_value = value
    return node


def _output(node: Any, name: str) -> Any:
    return next(socket for socket in node.outputs if socket.enabled and socket.name == name)


def _fill(ramp: Any, signed: bool) -> None:
    """Give a colour ramp the colours of a scale."""
    scale = Legend("", "FRACTION", 1.0, signed)
    positions = np.linspace(0, 1, STEPS)
    colours = scale.colours(scale.minimum + positions * (1.0 - scale.minimum))
    while len(ramp.elements) < STEPS:
        ramp.elements.new(0.5)
    for element, position, colour in zip(ramp.elements, positions.tolist(), colours):
        element.position, element.color = position, (*_linear(colour[:3]), 1.0)


def _linear(colour: Any) -> list[float]:
    """Return the linear components of a colour of the screen, as nodes have them."""
    linear: list[float] = np.where(colour <= 0.04045, colour / 12.92, ((colour + 0.055) / 1.055) ** 2.4).tolist()
    return linear
