"""Read the links and meshes of a URDF, and compare plans with them."""

from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath

from ..calibration.exchange.xml_nodes import Node, XmlError, children_of_root
from ..common.errors import CalibrationFormatError, UnknownLink
from ..common.findings import did_you_mean, show
from ..common.text import NumberError, read_text, real
from ..common.warnings import Warning
from ..geometry.mesh.triangle_mesh import METRES_PER_UNIT
from ..plan import Plan

MAX_NODES_PER_LINK = 100_000  # XML elements. Larger: more memory for a malicious file.


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
class Robot:
    """The meshes of all links, and what carries them."""

    file: str
    links: dict[str, tuple[LinkMesh, ...]]
    name: str = ""
    parents: dict[str, str] = field(default_factory=dict)  # link that carries a link, by the name of the latter


def read_robot(path: Path) -> Robot:
    """Read a URDF.

    Raises
    ------
    CalibrationFormatError
        If the file cannot be read, or is not a URDF.
    """
    text, links, parents, name = read_text(path), {}, {}, ""
    try:
        for node in children_of_root(text, "robot", MAX_NODES_PER_LINK):
            name = node.parent.attributes.get("name", "") if node.parent else ""
            if node.tag == "link":
                links[node.attribute("name")] = tuple(_meshes(node))
            elif node.tag == "joint":
                parents[node.child("child").attribute("link")] = node.child("parent").attribute("link")
    except XmlError as problem:
        raise CalibrationFormatError(f"'{path}' has {problem.finding}", (problem.finding,)) from problem
    if not links:
        raise CalibrationFormatError(f"'{path}' has no link. Check that it is the correct file.")
    return Robot(path.name, links, name, parents)


def compare(robot: Robot, plan: Plan) -> tuple[Warning, ...]:
    """Compare the mesh of a plan with the robot, and return warnings for differences.

    Parameters
    ----------
    robot : Robot
        Content of the URDF.
    plan : Plan
        Plan of one of its links.

    Returns
    -------
    tuple of Warning

    Raises
    ------
    UnknownLink
        If the robot has no such link.
    """
    if plan.link not in robot.links:
        near = did_you_mean(plan.link, robot.links)
        raise UnknownLink(f"{robot.file} has no link {show(plan.link)}, which is the link of the plan{near}")
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


def _meshes(link: Node) -> list[LinkMesh]:
    """Return the visual and collision meshes of a link; other shapes are left out."""
    found = []
    for part in link.children:
        shapes = [s for g in part.children if g.tag == "geometry" for s in g.children if s.tag == "mesh"]
        if part.tag not in ("visual", "collision") or not shapes:
            continue
        origins = [node for node in part.children if node.tag == "origin"]
        origin = origins[0] if origins else Node("origin", {}, part.line)
        position, angles = (_numbers(origin, name, "0 0 0") for name in ("xyz", "rpy"))
        for shape in shapes:
            address = shape.attribute("filename").replace("\\", "/")
            scale, moved = _numbers(shape, "scale", "1 1 1"), any(position + angles)
            found.append(LinkMesh(address.rpartition("/")[2], scale, moved, part.tag, address, position, angles))
    return found


def _numbers(node: Node, name: str, default: str) -> tuple[float, ...]:
    try:
        return tuple(map(real, node.attributes.get(name, default).split()))
    except NumberError as problem:
        raise XmlError(problem.code, node.line, f"{problem} ({node.tag} {name})") from problem
