"""Read and write URDF: taxels as fixed frames, or as ``<sensor><tactile>`` of tactile_toolbox; metres, radians."""

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from ...common.arrays import Array
from ...common.findings import FoundError, show
from ...common.text import MAX_TAXELS, NumberError, real
from ..model import LinkCalibration
from .link_taxels import LinkTaxels, refuse_labels, refuse_repeats, taxels_of
from .taxel_set import Draft
from .xml_nodes import Node, XmlError, children_of_root
from .xml_text import HEAD, numbers, quoted, rotations, rpy

ROOT = "robot"
MAX_NODES_PER_SENSOR = (
    5 * MAX_TAXELS
)  # XML elements; a taxel with a mesh has three. Larger: more memory for a malicious file.
BODY_ELEMENTS = ("visual", "collision", "inertial")  # a link with one of these is not only a frame
SHAPE_THICKNESS = 0.001  # of the drawn cells [m]. Larger: thicker drawings.
UPDATE_RATE = 100  # of a sensor [Hz], which its element requires. Larger: the driver publishes more often.

Pose = tuple[Array, Array]  # translation (3,) [m] and rotation (3, 3)
NOWHERE: Pose = (np.zeros(3), np.eye(3))


@dataclass(frozen=True, eq=False)
class Joint:
    """The joint between a link and its parent."""

    line: int
    parent: str
    fixed: bool
    pose: Pose  # of the link in its parent


@dataclass
class Robot:
    """The relevant content of a URDF."""

    links: dict[str, bool] = field(default_factory=dict)  # True for links with a body
    joints: dict[str, Joint] = field(default_factory=dict)  # by child link
    sensors: list[Node] = field(default_factory=list)  # with a tactile element


def read_urdf(text: str) -> Draft:
    """Read the taxels of all tactile sensors; without sensors, all frames that are fixed to a link and have no child.

    The label of a taxel of a sensor is ``sensor.idx``, and its channel is idx. Frames keep their names, and their order
    gives the channels. Poses refer to the nearest parent link that has a body or a movable joint.
    """
    draft, robot = Draft(normals=[], tangents=[]), Robot()
    for node in children_of_root(text, ROOT, MAX_NODES_PER_SENSOR):
        _read_node(robot, node)
    for number, label, channel, link, (position, rotation) in (_of_sensors if robot.sensors else _of_frames)(robot):
        if len(draft.labels) == MAX_TAXELS:
            raise XmlError("size", number, f"exceeds the limit of {MAX_TAXELS} taxels")
        x, _, z = rotation.T.tolist()
        draft.add(number, label, channel, position.tolist(), z, x)
        draft.links.append(link)
    if not draft.labels:
        message = "has no tactile sensor and no frame fixed to a link; check that it is the correct file"
        raise FoundError("no-taxels", "", message)
    return draft


def _read_node(robot: Robot, node: Node) -> None:
    """Copy a child of the root element into the robot."""
    if node.tag == "link":
        name = node.attribute("name")
        if name in robot.links:
            raise XmlError("duplicate-label", node.line, f"repeats the link {show(name)}; each needs its own name")
        robot.links[name] = any(part.tag in BODY_ELEMENTS for part in node.children)
    elif node.tag == "joint":
        child = node.child("child").attribute("link")
        if child in robot.joints:
            raise XmlError(
                "syntax", node.line, f"is a second joint of the link {show(child)}; a link has one parent joint"
            )
        fixed = node.attribute("type") == "fixed"
        origin = next((part for part in node.children if part.tag == "origin"), None)
        pose = NOWHERE if origin is None or not fixed else _pose(origin)
        robot.joints[child] = Joint(node.line, node.child("parent").attribute("link"), fixed, pose)
    elif node.tag == "sensor" and any(part.tag == "tactile" for part in node.children):
        robot.sensors.append(node)


Taxel = tuple[int, str, int | None, str, Pose]  # line, label, channel or None, link, pose in the link


def _of_sensors(robot: Robot) -> Iterator[Taxel]:
    for sensor in robot.sensors:
        name, parent = sensor.attribute("name"), sensor.child("parent").attribute("link")
        base = next((_pose(part) for part in sensor.children if part.tag == "origin"), NOWHERE)
        for node in sensor.child("tactile").children:
            if node.tag == "array":
                message = "starts an array, which is not supported; list its taxels one by one as taxel elements"
                raise XmlError("array", node.line, message)
            if node.tag == "taxel":
                channel = node.whole("idx")
                yield node.line, f"{name}.{channel}", channel, parent, _compose(base, _pose(node))


def _of_frames(robot: Robot) -> Iterator[Taxel]:
    parents = {joint.parent for joint in robot.joints.values()}
    for name, joint in robot.joints.items():
        if name not in robot.links or joint.parent not in robot.links:
            unknown = name if name not in robot.links else joint.parent
            raise XmlError("missing", joint.line, f"names the link {show(unknown)}, which the file does not have")
        if joint.fixed and name not in parents and not robot.links[name]:
            yield joint.line, name, None, *_base_link(robot, name)


def _base_link(robot: Robot, name: str) -> tuple[str, Pose]:
    """Return the nearest parent link that is not only a frame, and the pose in it."""
    joint = robot.joints[name]
    pose, visited = joint.pose, {name}
    while not robot.links[joint.parent]:
        above = robot.joints.get(joint.parent)
        if above is None or not above.fixed:
            break
        if joint.parent in visited:
            raise XmlError(
                "syntax", above.line, f"is part of a loop of joints at the link {show(joint.parent)}; remove the loop"
            )
        visited.add(joint.parent)
        if above.parent not in robot.links:
            message = f"names the link {show(above.parent)}, which the file does not have"
            raise XmlError("missing", above.line, message)
        joint, pose = above, _compose(above.pose, pose)
    return joint.parent, pose


def _compose(a: Pose, b: Pose) -> Pose:
    """Return the product a b of two poses: b in the frame in which a is given."""
    with np.errstate(all="ignore"):  # huge numbers are reported later, by the checks of all taxels
        return a[1] @ b[0] + a[0], a[1] @ b[1]


def _pose(node: Node) -> Pose:
    node.only(("idx", "xyz", "rpy") if node.tag == "taxel" else ("xyz", "rpy"))
    return _three(node, "xyz"), rotations(_three(node, "rpy")[None])[0]


def _three(node: Node, name: str) -> Array:
    """Return the three numbers of an attribute; zeros without the attribute."""
    words = node.attributes.get(name, "0 0 0").split(None, 3)
    if len(words) != 3:
        raise XmlError("number", node.line, f"has {len(words)} numbers in {name}; it must have three")
    try:
        return np.array([real(word) for word in words])
    except NumberError as problem:
        raise XmlError(problem.code, node.line, f"{problem} ({name})") from problem


def write_frames(calibration: LinkCalibration) -> bytes:
    """Write a frame for each taxel, with the z axis along the normal, in the order of channels.

    The frame of a taxel is fixed to the frame of its patch, and that frame is fixed to the link. The frame of a patch
    is at its taxel closest to the mean position.
    """
    link = quoted(calibration.link)
    lines = (f"{HEAD}<robot name={link}>", f"<link name={link}/>", *frames_of(calibration), "</robot>\n")
    return "\n".join(lines).encode()


def frames_of(calibration: LinkCalibration, prefix: str = "") -> list[str]:
    """Return the frames of :func:`write_frames` for the URDF of a robot; their names begin with ``prefix``."""
    taxels = taxels_of(calibration)
    patches = [prefix + patch.name for patch in calibration.patches]
    ids, owners = ([prefix + name for name in names] for names in (taxels.ids, taxels.patches))
    for names, what in ((ids, "the id"), (patches, "the patch name"), ((taxels.link,), "the link name")):
        refuse_labels(names, what)
    refuse_repeats((taxels.link, *patches, *ids), "URDF")
    lines = []
    shifts, turns = np.empty_like(taxels.positions), np.empty_like(taxels.axes)
    for patch, name in zip(calibration.patches, patches):
        rows = taxels.of(patch.name)
        distance = np.linalg.norm(taxels.positions[rows] - taxels.positions[rows].mean(axis=0), axis=1)
        at, turn = taxels.positions[rows[distance.argmin()]], taxels.axes[rows[distance.argmin()]]
        lines.append(_fixed(taxels.link, name, at, rpy(turn[None])[0]))
        shifts[rows], turns[rows] = (taxels.positions[rows] - at) @ turn, turn.T @ taxels.axes[rows]
    return [*lines, *map(_fixed, owners, ids, shifts, rpy(turns))]


def _fixed(parent: str, name: str, position: Array, angles: Array) -> str:
    """Return a link and the joint that fixes it to its parent."""
    return (
        f'<link name={quoted(name)}/>\n<joint name={quoted(name + "_fixed_joint")} type="fixed">'
        f'<origin xyz="{numbers(position)}" rpy="{numbers(angles)}"/>'
        f"<parent link={quoted(parent)}/><child link={quoted(name)}/></joint>"
    )


def write_sensors(calibration: LinkCalibration) -> bytes:
    """Write a sensor for each patch; all use the data channel with the name of the link.

    ``idx`` is the position in a reading. The shape of a taxel is its cell, or a disc of its area.
    """
    taxels = taxels_of(calibration)
    patches = [patch.name for patch in calibration.patches]
    refuse_labels(
        (f"{patch}.{i}" for patch, i in zip(taxels.patches, taxels.channels)), "the patch name with a channel"
    )
    refuse_labels((taxels.link,), "the link name")
    link = quoted(taxels.link)
    lines = [f"{HEAD}<robot name={link}>", f"<link name={link}/>"]
    for patch in patches:
        lines += [
            f'<sensor name={quoted(patch)} update_rate="{UPDATE_RATE}"><parent link={link}/>'
            f'<origin xyz="0 0 0" rpy="0 0 0"/><tactile channel={link}>',
            *_sensing(taxels, patch),
            "</tactile></sensor>",
        ]
    return ("\n".join(lines) + "\n</robot>\n").encode()


def _sensing(taxels: LinkTaxels, patch: str) -> Iterator[str]:
    rows = taxels.of(patch)
    for i, angles in zip(rows.tolist(), rpy(taxels.axes[rows])):
        if taxels.square[i]:
            shape = f'<box size="{numbers(taxels.sizes[i])} {SHAPE_THICKNESS!r}"/>'
        else:
            shape = f'<cylinder radius="{float(np.sqrt(taxels.areas[i] / np.pi))!r}" length="{SHAPE_THICKNESS!r}"/>'
        origin = f'xyz="{numbers(taxels.positions[i])}" rpy="{numbers(angles)}"'
        yield f'<taxel idx="{taxels.channels[i]}" {origin}><geometry>{shape}</geometry></taxel>'
