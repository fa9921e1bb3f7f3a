"""URDF: taxels as frames fixed to a link, or in the ``<sensor><tactile>`` of tactile_toolbox; metres and radians."""

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from ...common.arrays import Array
from ...common.findings import error, show
from ...common.text import MAX_TAXELS, NumberError, real
from ..model import LinkCalibration
from .link_taxels import LinkTaxels, refuse_labels, refuse_repeats, taxels_of
from .taxel_set import Draft
from .xml_nodes import Node, XmlError, children_of_root
from .xml_text import HEAD, numbers, quoted, rotations, rpy

ROOT = "robot"
MAX_NODES_PER_SENSOR = 5 * MAX_TAXELS  # in one sensor: a taxel with a mesh has three
BODY_ELEMENTS = ("visual", "collision", "inertial")  # a link with one of these is more than a frame
CELL_THICKNESS = 0.001  # thickness of a cell that is drawn [m]
UPDATE_RATE = 100  # of a sensor [Hz]: its element needs one

Pose = tuple[Array, Array]  # translation (3,) [m] and rotation (3, 3)
NOWHERE: Pose = (np.zeros(3), np.eye(3))


@dataclass(frozen=True, eq=False)
class Joint:
    """What holds a link."""

    line: int
    parent: str
    fixed: bool
    pose: Pose  # of the link in its parent


@dataclass
class Robot:
    """What is of interest in a URDF."""

    links: dict[str, bool] = field(default_factory=dict)  # whether each has a body
    joints: dict[str, Joint] = field(default_factory=dict)  # by the link that is held
    sensors: list[Node] = field(default_factory=list)  # with a tactile element


def read_urdf(text: str) -> Draft:
    """The taxels of all tactile sensors; without one, every frame that is fixed to a link and bears nothing.

    Taxels of sensors are called ``sensor.idx``, and idx is the channel. Frames keep their names, and their order tells
    the channels. Each is placed in the nearest link that has a body or a joint that moves, past frames between.
    """
    draft, robot = Draft(normals=[], tangents=[]), Robot()
    try:
        for node in children_of_root(text, ROOT, MAX_NODES_PER_SENSOR):
            _take(robot, node)
        for taxel in (_of_sensors if robot.sensors else _of_frames)(robot):
            _put(draft, *taxel)
    except XmlError as problem:
        draft.findings.append(problem.finding)
    if not draft.labels and not draft.broken:
        message = "has no tactile sensor and no frame fixed to a link; check that it is the right file"
        draft.findings.append(error("no-taxels", "", message))
    return draft


def _take(robot: Robot, node: Node) -> None:
    """Put a child of the root into the robot."""
    if node.tag == "link":
        name = node.attribute("name")
        if name in robot.links:
            raise XmlError("duplicate-label", node.line, f"repeats the link {show(name)}; each needs its own name")
        robot.links[name] = any(part.tag in BODY_ELEMENTS for part in node.children)
    elif node.tag == "joint":
        child = node.child("child").attribute("link")
        if child in robot.joints:
            raise XmlError("syntax", node.line, f"holds the link {show(child)} a second time; a link has one joint")
        fixed = node.attribute("type") == "fixed"
        origin = next((part for part in node.children if part.tag == "origin"), None)
        pose = NOWHERE if origin is None or not fixed else _pose(origin)
        robot.joints[child] = Joint(node.line, node.child("parent").attribute("link"), fixed, pose)
    elif node.tag == "sensor" and any(part.tag == "tactile" for part in node.children):
        robot.sensors.append(node)


Taxel = tuple[int, str, int | None, str, Pose]  # line, label, channel if it has one, link, pose in that link


def _of_sensors(robot: Robot) -> Iterator[Taxel]:
    for sensor in robot.sensors:
        name, parent = sensor.attribute("name"), sensor.child("parent").attribute("link")
        base = next((_pose(part) for part in sensor.children if part.tag == "origin"), NOWHERE)
        for node in sensor.child("tactile").children:
            if node.tag == "array":
                message = "opens an array, whose taxels are not read; list them one by one as taxel elements"
                raise XmlError("array", node.line, message)
            if node.tag == "taxel":
                channel = node.whole("idx")
                yield node.line, f"{name}.{channel}", channel, parent, _compose(base, _pose(node))


def _of_frames(robot: Robot) -> Iterator[Taxel]:
    bearing = {joint.parent for joint in robot.joints.values()}
    for name, joint in robot.joints.items():
        if name not in robot.links or joint.parent not in robot.links:
            unknown = name if name not in robot.links else joint.parent
            raise XmlError("missing", joint.line, f"names the link {show(unknown)}, which the file does not have")
        if joint.fixed and name not in bearing and not robot.links[name]:
            yield joint.line, name, None, *_base(robot, name)


def _base(robot: Robot, name: str) -> tuple[str, Pose]:
    """The link that bears a frame, past frames between, and the pose in it."""
    joint = robot.joints[name]
    pose, passed = joint.pose, {name}
    while not robot.links[joint.parent]:
        above = robot.joints.get(joint.parent)
        if above is None or not above.fixed:
            break
        if joint.parent in passed:
            raise XmlError(
                "syntax", above.line, f"holds the link {show(joint.parent)} by itself, round a loop of joints"
            )
        passed.add(joint.parent)
        if above.parent not in robot.links:
            message = f"names the link {show(above.parent)}, which the file does not have"
            raise XmlError("missing", above.line, message)
        joint, pose = above, _compose(above.pose, pose)
    return joint.parent, pose


def _put(draft: Draft, number: int, label: str, channel: int | None, link: str, pose: Pose) -> None:
    assert draft.normals is not None and draft.tangents is not None
    if len(draft.labels) == MAX_TAXELS:
        raise XmlError("size", number, f"opens one taxel too many; at most {MAX_TAXELS} are read")
    draft.lines.append(number)
    draft.labels.append(label)
    if channel is not None:
        draft.channels.append(channel)
    draft.links.append(link)
    draft.positions.append(tuple(pose[0].tolist()))
    draft.normals.append(tuple(pose[1][:, 2].tolist()))
    draft.tangents.append(tuple(pose[1][:, 0].tolist()))


def _compose(a: Pose, b: Pose) -> Pose:
    """The pose b, given in the frame a, in the frame that a is given in."""
    with np.errstate(all="ignore"):  # absurd numbers are found where all taxels are looked at
        return a[1] @ b[0] + a[0], a[1] @ b[1]


def _pose(node: Node) -> Pose:
    return _three(node, "xyz"), rotations(_three(node, "rpy")[None])[0]


def _three(node: Node, name: str) -> Array:
    """The three numbers of an attribute; zeros where there is none."""
    words = node.attributes.get(name, "0 0 0").split(None, 3)
    if len(words) != 3:
        raise XmlError("number", node.line, f"has {len(words)} numbers in {name}; three are needed")
    try:
        return np.array([real(word) for word in words])
    except NumberError as problem:
        raise XmlError(problem.code, node.line, f"{problem} ({name})") from problem


def write_frames(calibration: LinkCalibration) -> bytes:
    """A frame for each taxel, its z axis along the normal, fixed to the frame of its patch, which is fixed to the link.

    The frame of a patch is that of its taxel nearest to its middle. Taxels stand in the order of their channels.

    Raises
    ------
    CalibrationFormatError
        If a name would not come back as it is, or two frames would have the same.
    """
    taxels = taxels_of(calibration)
    patches = [patch.name for patch in calibration.patches]
    for names, what in ((taxels.ids, "the id"), (patches, "the patch name"), ((taxels.link,), "the link name")):
        refuse_labels(names, what)
    refuse_repeats((taxels.link, *patches, *taxels.ids), "URDF")
    lines = [f"{HEAD}<robot name={quoted(taxels.link)}>", f"<link name={quoted(taxels.link)}/>"]
    shifts, turns = np.empty_like(taxels.positions), np.empty_like(taxels.axes)
    for patch in patches:
        rows = taxels.of(patch)
        away = np.linalg.norm(taxels.positions[rows] - taxels.positions[rows].mean(axis=0), axis=1)
        at, turn = taxels.positions[rows[away.argmin()]], taxels.axes[rows[away.argmin()]]
        lines.append(_fixed(taxels.link, patch, at, rpy(turn[None])[0]))
        shifts[rows], turns[rows] = (taxels.positions[rows] - at) @ turn, turn.T @ taxels.axes[rows]
    lines += map(_fixed, taxels.patches, taxels.ids, shifts, rpy(turns))
    return ("\n".join(lines) + "\n</robot>\n").encode()


def _fixed(parent: str, name: str, position: Array, angles: Array) -> str:
    """A frame that is fixed to a link."""
    return (
        f'<link name={quoted(name)}/>\n<joint name={quoted(name + "_fixed_joint")} type="fixed">'
        f'<origin xyz="{numbers(position)}" rpy="{numbers(angles)}"/>'
        f"<parent link={quoted(parent)}/><child link={quoted(name)}/></joint>"
    )


def write_sensors(calibration: LinkCalibration) -> bytes:
    """A sensor for each patch, all on the data channel that has the link's name: ``idx`` is the place in a reading.

    A taxel is drawn as its cell, or as a disc of its area.

    Raises
    ------
    CalibrationFormatError
        If a name would not come back as it is.
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
            shape = f'<box size="{numbers(taxels.sizes[i])} {CELL_THICKNESS!r}"/>'
        else:
            shape = f'<cylinder radius="{float(np.sqrt(taxels.areas[i] / np.pi))!r}" length="{CELL_THICKNESS!r}"/>'
        place = f'xyz="{numbers(taxels.positions[i])}" rpy="{numbers(angles)}"'
        yield f'<taxel idx="{taxels.channels[i]}" {place}><geometry>{shape}</geometry></taxel>'
