"""Read the links, meshes and joints of a URDF, and compare plans with them."""

import math
from collections.abc import Container, Iterator
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from pathlib import Path, PurePosixPath
from urllib.parse import unquote

from ..calibration.exchange.xml_nodes import Node, XmlError, children_of_root
from ..common.errors import CalibrationFormatError, UnknownLink, listed
from ..common.findings import did_you_mean, show
from ..common.text import NumberError, read_text, real
from ..common.warnings import Warning
from ..geometry.mesh.triangle_mesh import METRES_PER_UNIT
from ..plan import Plan

MAX_NODES_PER_LINK = 100_000  # XML elements. Larger: more memory for a malicious file.
# [m, 1] largest number of an origin or a scale. Larger: lengths lose digits, and meet fewer of the limits of programs
MAX_NUMBER = 1e6
ONE_AXIS = ("revolute", "continuous", "prismatic")  # Format: types of joints that move by one number
# Format: shapes that are not meshes, their attributes, and how many numbers each has.
SHAPES = {
    "box": {"size": 3},
    "cylinder": {"radius": 1, "length": 1},
    "sphere": {"radius": 1},
    "capsule": {"radius": 1, "length": 1},  # of the cylinder between its half spheres
}
# Format: attributes of the elements that place and shape a part, by the elements that have them.
PLACES = {"origin": ("xyz", "rpy"), "axis": ("xyz",)}
GEOMETRY = {"mesh": ("filename", "scale", "name")} | {kind: (*sizes, "name") for kind, sizes in SHAPES.items()}
OWNERS = ("visual", "collision", "inertial", "joint")  # Format: elements with an origin
PROPERTIES = ("drake:declare_convex",)  # elements in shapes that do not change them
JOINT_TYPES = (*ONE_AXIS, "fixed", "floating", "planar")  # Format

Triple = tuple[float, float, float]


@dataclass(frozen=True)
class LinkMesh:
    """A mesh of a link in the URDF."""

    file: str  # name without folders
    scale: tuple[float, ...]
    moved: bool  # whether its frame differs from the link frame
    use: str  # "visual" or "collision"
    address: str  # path or URL in the URDF
    position: tuple[float, ...]  # of its frame in the link frame [m]
    angles: tuple[float, ...]  # roll, pitch, yaw about the axes of the link [rad]


@dataclass(frozen=True)
class LinkShape:
    """A visual box, cylinder, sphere or capsule of a link: it carries no skin, but covers that of others."""

    kind: str  # one of SHAPES
    size: tuple[float, ...]  # the numbers of its attributes [m]
    position: Triple  # of its frame in the link frame [m]
    angles: Triple  # roll, pitch, yaw about the axes of the link [rad]


@dataclass(frozen=True)
class Joint:
    """The joint between a link and the link that carries it."""

    name: str
    type: str  # one of JOINT_TYPES
    parent: str  # link that carries the other
    child: str
    position: Triple = (0.0, 0.0, 0.0)  # of the frame of the joint in the frame of the parent [m]
    angles: Triple = (0.0, 0.0, 0.0)  # roll, pitch, yaw about the axes of the parent [rad]
    axis: Triple = (1.0, 0.0, 0.0)  # unit vector in the frame of the joint
    limits: tuple[float, float] | None = None  # lower, upper [rad] or [m]; None: the URDF states no limits
    mimic: str | None = None  # joint that this joint follows: its position times multiplier, plus offset
    multiplier: float = 1.0
    offset: float = 0.0  # [rad] or [m]


@dataclass(frozen=True)
class Robot:
    """The meshes of all links, and the joints between them."""

    file: str
    links: dict[str, tuple[LinkMesh, ...]]
    name: str = ""
    joints: dict[str, Joint] = field(default_factory=dict)  # by name
    shapes: dict[str, tuple[LinkShape, ...]] = field(default_factory=dict)  # of the links that have some

    @cached_property
    def parents(self) -> dict[str, str]:
        """Return the link that carries a link, by the name of the latter."""
        return {joint.child: joint.parent for joint in self.joints.values()}

    @property
    def root(self) -> str:
        """Return the link that no joint carries."""
        roots = [link for link in self.links if link not in self.parents]
        if len(roots) > 1:
            raise CalibrationFormatError(
                f"{self.file} has {len(roots)} links that no joint carries: {listed(roots)}. Connect them by joints."
            )
        return roots[0]


def read_robot(path: Path) -> Robot:
    """Read a URDF."""
    return _parsed(read_text(path), path)


@lru_cache(maxsize=1)  # each link of a robot asks for it
def _parsed(text: str, path: Path) -> Robot:
    name = ""
    xacro = f"It is a xacro file. Convert it first: xacro {path.name} > robot.urdf" if "<xacro:" in text else ""
    links: dict[str, tuple[LinkMesh, ...]] = {}
    shapes: dict[str, tuple[LinkShape, ...]] = {}
    joints: dict[str, Joint] = {}
    lines: dict[str, int] = {}  # of the joints
    try:
        for node in children_of_root(text, "robot", MAX_NODES_PER_LINK):
            name = node.parent.attributes.get("name", "") if node.parent else ""
            parts = [node]
            for part in parts:  # grows
                if part.tag.startswith("xacro:"):
                    raise XmlError("xacro", part.line, f"has the element {show(part.tag)}, which is not of a URDF")
                parts += part.children
                if node.tag in ("link", "joint"):
                    _refuse_unknown(part)
            if node.tag in ("link", "joint"):
                own = node.attribute("name")
                if own in (links if node.tag == "link" else joints):
                    raise XmlError(
                        "duplicate", node.line, f"repeats the {node.tag} {show(own)}; each needs its own name"
                    )
            if node.tag == "link":
                links[own], shapes[own] = tuple(_meshes(node)), tuple(_shapes(node))
            elif node.tag == "joint":
                joints[own], lines[own] = _joint(node), node.line
        _check_tree(links, joints, lines)
    except XmlError as problem:
        message = f"'{path}' has {problem.finding}" + (f". {xacro}" if xacro else "")
        raise CalibrationFormatError(message, (problem.finding,)) from problem
    if not links:
        raise CalibrationFormatError(f"'{path}' has no link. Check that it is the correct file.")
    return Robot(path.name, links, name, joints, {link: found for link, found in shapes.items() if found})


def compare(robot: Robot, plan: Plan) -> tuple[Warning, ...]:
    """Compare the mesh of a plan with the robot, and return warnings for differences."""
    if plan.link not in robot.links:
        near = did_you_mean(plan.link, robot.links)
        raise UnknownLink(f"{robot.file} has no link {show(plan.link)}, which is the link of the plan{near}")
    if plan.mesh.name == robot.file:
        return ()  # the plan takes meshes, origins and scales from the robot
    meshes = robot.links[plan.link]
    same = [mesh for mesh in meshes if PurePosixPath(mesh.file).stem == plan.mesh.stem]
    if meshes and not same:
        names = ", ".join(dict.fromkeys(mesh.file for mesh in meshes))
        message = f"{robot.file} gives {plan.link} the mesh {names}, but the plan has {plan.mesh.name}."
        return (Warning("mesh-name", "warning", message, advice="Check that this mesh is in the frame of the link."),)
    warnings = []
    if same and all(mesh.moved for mesh in same):
        message = f"{robot.file} gives {plan.mesh.name} an origin of its own in {plan.link}."
        advice = "A plan needs the mesh in the frame of the link: move it there."
        warnings.append(Warning("mesh-origin", "warning", message, advice=advice))
    scales = {mesh.scale for mesh in same if mesh.file == plan.mesh.name}
    if scales and (METRES_PER_UNIT[plan.unit],) * 3 not in scales:
        scale = " ".join(f"{s:g}" for s in min(scales))
        message = f'{robot.file} scales {plan.mesh.name} by {scale}, but the plan has "unit": "{plan.unit}".'
        warnings.append(Warning("mesh-scale", "warning", message, advice="Set the unit of the mesh in the plan."))
    return tuple(warnings)


def _refuse_unknown(part: Node) -> None:
    """Raise XmlError if an element in a link or a joint places or shapes it in a form that is not known."""
    owner = part.parent or part
    if part.tag in PLACES and owner.tag in OWNERS:
        part.only(PLACES[part.tag])
        if any(other.tag == part.tag for other in owner.children if other is not part):
            raise XmlError("duplicate", part.line, f"has two elements {part.tag} in one {owner.tag}; keep one")
    in_geometry = owner.tag == "geometry" and owner.parent is not None and owner.parent.tag in ("visual", "collision")
    if in_geometry and part.tag in GEOMETRY:
        part.only(GEOMETRY[part.tag])
    elif in_geometry or part.tag == "mesh":
        message = f"has {show(part.tag)} in {owner.tag}, which is not supported"
        raise XmlError(
            "unknown-element", part.line, f"{message}; write {listed(tuple(GEOMETRY))} in geometry, or remove it"
        )
    if (owner.tag in PLACES or owner.tag in GEOMETRY) and part.tag not in PROPERTIES:
        raise XmlError("unknown-element", part.line, f"has {show(part.tag)} in {owner.tag}, which is not supported")


def _meshes(link: Node) -> list[LinkMesh]:
    """Return the visual and collision meshes of a link."""
    found = []
    for part, shape in _geometries(link, ("visual", "collision"), ("mesh",)):
        position, angles = (_numbers(_origin(part), name, "0 0 0") for name in ("xyz", "rpy"))
        address = shape.attribute("filename").replace("\\", "/")
        file = unquote(address).rpartition("/")[2]
        scale, moved = _numbers(shape, "scale", "1 1 1"), any(position + angles)
        found.append(LinkMesh(file, scale, moved, part.tag, address, position, angles))
    return found


def _shapes(link: Node) -> list[LinkShape]:
    """Return the visual shapes of a link that are not meshes."""
    found = []
    for part, shape in _geometries(link, ("visual",), SHAPES):
        sizes = {name: _numbers(shape, name, "") for name in SHAPES[shape.tag]}
        size = sum(sizes.values(), ())
        if {name: len(numbers) for name, numbers in sizes.items()} != SHAPES[shape.tag] or min(size) < 0:
            raise XmlError("number", shape.line, f"has a {shape.tag} without the sizes that it needs")
        position, angles = (_triple(_origin(part), name, "0 0 0") for name in ("xyz", "rpy"))
        if min(size) > 0:  # some files have shapes without size
            found.append(LinkShape(shape.tag, size, position, angles))
    return found


def _geometries(link: Node, uses: Container[str], kinds: Container[str]) -> Iterator[tuple[Node, Node]]:
    """Yield the shapes of some kinds that a link has for some uses, each after the part that has its origin."""
    for part in link.children:
        if part.tag in uses:
            yield from ((part, s) for g in part.children if g.tag == "geometry" for s in g.children if s.tag in kinds)


def _origin(part: Node) -> Node:
    return next((node for node in part.children if node.tag == "origin"), Node("origin", {}, part.line))


def _joint(node: Node) -> Joint:
    """Return a joint; its links may be unknown."""
    kind = node.attribute("type")
    if kind not in JOINT_TYPES:
        raise XmlError("value", node.line, f"has the type {show(kind)}; use one of {', '.join(JOINT_TYPES)}")
    parts = {part.tag: part for part in reversed(node.children)}  # the first of each tag
    none = Node("", {}, node.line)
    origin, axis, limit = (parts.get(tag, none) for tag in ("origin", "axis", "limit"))
    mimic = parts.get("mimic")
    x, y, z = _triple(axis, "xyz", "1 0 0")
    length = math.hypot(x, y, z)
    if kind in ONE_AXIS and length == 0:
        raise XmlError("axis", axis.line, "has an axis of length 0; write the direction of the axis")
    lower, upper = (_number(limit, name, 0.0) for name in ("lower", "upper"))
    if kind in ("revolute", "prismatic") and lower > upper:
        message = f"has the lower limit {lower:g} above the upper one, {upper:g}; swap them"
        raise XmlError("reversed-limits", limit.line, message)
    return Joint(
        node.attribute("name"),
        kind,
        node.child("parent").attribute("link"),
        node.child("child").attribute("link"),
        _triple(origin, "xyz", "0 0 0"),
        _triple(origin, "rpy", "0 0 0"),
        (x / length, y / length, z / length) if length else (1.0, 0.0, 0.0),
        (lower, upper) if kind in ("revolute", "prismatic") and "limit" in parts else None,
        mimic.attribute("joint") if mimic else None,
        _number(mimic, "multiplier", 1.0) if mimic else 1.0,
        _number(mimic, "offset", 0.0) if mimic else 0.0,
    )


def _check_tree(links: Container[str], joints: dict[str, Joint], lines: dict[str, int]) -> None:
    """Raise XmlError if the joints do not make trees of the links, or mimic joints follow each other in a circle."""
    above: dict[str, Joint] = {}
    for joint in joints.values():
        line = lines[joint.name]
        for link in (joint.parent, joint.child):
            if link not in links:
                raise XmlError("unknown-link", line, f"names the link {show(link)}, which the file does not have")
        if joint.child in above:
            message = f"is a second joint above the link {show(joint.child)}; a link has one parent"
            raise XmlError("two-parents", line, message)
        if joint.mimic is not None and joint.mimic not in joints:
            raise XmlError(
                "unknown-joint", line, f"follows the joint {show(joint.mimic)}, which the file does not have"
            )
        above[joint.child] = joint
    _refuse_cycle({joint.name: joint.mimic for joint in joints.values() if joint.mimic}, lines, "joints that follow")
    before = {joint.name: above[joint.parent].name for joint in joints.values() if joint.parent in above}
    _refuse_cycle(before, lines, "joints that carry")


def _refuse_cycle(before: dict[str, str], lines: dict[str, int], what: str) -> None:
    """Raise XmlError if a joint comes before itself."""
    good: set[str] = set()
    for start in before:
        path: dict[str, None] = {}  # in order
        at = start
        while at in before and at not in good:
            if at in path:
                names = list(path)[list(path).index(at) :]
                raise XmlError("cycle", lines[start], f"is in a cycle of {what} each other: {listed(names)}")
            path[at] = None
            at = before[at]
        good.update(path)


def _triple(node: Node, name: str, default: str) -> Triple:
    values = _numbers(node, name, default)
    if len(values) != 3:
        raise XmlError("number", node.line, f"has {len(values)} numbers instead of 3 ({node.tag} {name})")
    if node.tag == "origin" and max(map(abs, values)) > MAX_NUMBER:
        raise XmlError("number", node.line, f"has {max(values, key=abs):g}, which is too large ({node.tag} {name})")
    return values[0], values[1], values[2]


def _number(node: Node, name: str, default: float) -> float:
    values = _numbers(node, name, str(default))
    if len(values) != 1:
        raise XmlError("number", node.line, f"has {len(values)} numbers instead of 1 ({node.tag} {name})")
    return values[0]


def _numbers(node: Node, name: str, default: str) -> tuple[float, ...]:
    try:
        return tuple(map(real, node.attributes.get(name, default).split()))
    except NumberError as problem:
        raise XmlError(problem.code, node.line, f"{problem} ({node.tag} {name})") from problem
