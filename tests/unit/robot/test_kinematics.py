"""Joints of a URDF, and the poses of its links; MuJoCo is the independent truth."""

import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from skin_calib_addon.common.errors import CalibrationFormatError
from skin_calib_addon.robot.kinematics import carried, link_poses
from skin_calib_addon.robot.urdf import read_robot

ROBOTS = Path(__file__).parents[4] / "shared" / "data" / "robots"
FILES = ("g1_description/g1_29dof_rev_1_0.urdf", "jvrc_description/urdf/jvrc1.urdf")
PARTS = {
    "links": '<link name="base"/><link name="arm"/><link name="hand"/>',
    "a": '<joint name="a" type="revolute"><parent link="base"/><child link="arm"/>{}</joint>',
    "b": '<joint name="b" type="prismatic"><parent link="arm"/><child link="hand"/>{}</joint>',
}


def written(folder, *lines):
    path = folder / "bot.urdf"
    path.write_text("\n".join(('<robot name="bot">', *lines, "</robot>")))
    return path


def bot(folder, a="", b="", *more):
    """Return the robot of three links in a row, with content of its joints."""
    return read_robot(written(folder, PARTS["links"], PARTS["a"].format(a), PARTS["b"].format(b), *more))


def test_joint_has_what_the_file_states(tmp_path):
    """Names, origin, unit axis, limits; the defaults of URDF where the file states nothing."""
    origin = '<origin xyz="1 2 3" rpy="0.1 0.2 0.3"/>'
    robot = bot(tmp_path, f'{origin}<axis xyz="0 3 4"/><limit lower="-1" upper="2.5" effort="1" velocity="1"/>')
    a, b = robot.joints.values()
    assert (a.name, a.type, a.parent, a.child) == ("a", "revolute", "base", "arm")
    assert (a.position, a.angles, a.axis, a.limits) == ((1, 2, 3), (0.1, 0.2, 0.3), (0, 0.6, 0.8), (-1, 2.5))
    assert (b.position, b.angles, b.axis, b.limits, b.mimic) == ((0, 0, 0), (0, 0, 0), (1, 0, 0), None, None)
    assert robot.root == "base" and robot.parents == {"arm": "base", "hand": "arm"}


def test_poses_of_a_small_robot(tmp_path):
    """A rotation about the turned axis of the origin, then a translation along the turned axis."""
    a = '<origin xyz="0.1 0.2 0.3" rpy="0.4 -0.5 2"/><axis xyz="0 3 4"/>'
    robot = bot(tmp_path, a, '<origin xyz="0 0 1"/><axis xyz="0 0 -2"/>')
    poses = link_poses(robot, {"a": 0.7, "b": 0.25})
    turn = (Rotation.from_euler("xyz", (0.4, -0.5, 2)) * Rotation.from_rotvec((0, 0.42, 0.56))).as_matrix()
    np.testing.assert_array_equal(poses["base"], np.eye(4))
    np.testing.assert_allclose(poses["arm"][:3, :3], turn, atol=1e-15)
    np.testing.assert_allclose(poses["arm"][:3, 3], (0.1, 0.2, 0.3), atol=1e-15)
    np.testing.assert_allclose(poses["hand"][:3, 3], (0.1, 0.2, 0.3) + turn @ (0, 0, 0.75), atol=1e-15)


def test_joints_without_a_position_are_exact(tmp_path):
    """The zero pose has no rounding: links without rotation keep the axes of the root."""
    poses = link_poses(bot(tmp_path, '<origin xyz="0.1 0 0"/>', '<origin xyz="0.2 0 0"/>'))
    np.testing.assert_array_equal(poses["hand"][:3, :3], np.eye(3))


def test_mimic_joint_follows(tmp_path):
    """Also through another mimic joint."""
    c = '<link name="tip"/><joint name="c" type="prismatic"><parent link="hand"/><child link="tip"/>{}</joint>'
    follows = '<mimic joint="b" multiplier="2" offset="0.1"/>'
    robot = bot(tmp_path, '<mimic joint="c" multiplier="-3"/>', "", c.format(follows))
    poses = link_poses(robot, {"b": 0.25})
    np.testing.assert_allclose(
        poses["arm"][:3, :3], Rotation.from_rotvec((-3 * (2 * 0.25 + 0.1), 0, 0)).as_matrix(), atol=1e-15
    )
    np.testing.assert_allclose(np.linalg.inv(poses["hand"]) @ poses["tip"] @ (0, 0, 0, 1), (0.6, 0, 0, 1), atol=1e-15)


@pytest.mark.parametrize("file", FILES)
def test_poses_are_those_of_mujoco(file, tmp_path):
    """All links of real robots, at random positions within the limits of the joints."""
    mujoco = pytest.importorskip("mujoco")
    if not (ROBOTS / file).exists():
        pytest.skip("the robots are not here")
    robot = read_robot(ROBOTS / file)
    root = ET.parse(ROBOTS / file).getroot()
    for link in root.iter("link"):
        for part in [*link.iter("visual"), *link.iter("collision")]:
            link.remove(part)
    for extension in root.findall("mujoco"):
        root.remove(extension)
    ET.SubElement(ET.SubElement(root, "mujoco"), "compiler", fusestatic="false")
    for joint in root.iter("joint"):
        for mimic in joint.findall("mimic"):
            joint.remove(mimic)  # their positions are set below
    model = mujoco.MjModel.from_xml_string(ET.tostring(root, encoding="unicode"))
    data = mujoco.MjData(model)
    rng = np.random.default_rng(5)
    free = [j for j in robot.joints.values() if j.limits and not j.mimic]
    positions = {joint.name: rng.uniform(*joint.limits) for joint in free}
    for joint in robot.joints.values():
        if joint.type != "fixed":
            value = positions.get(joint.mimic or joint.name)
            data.joint(joint.name).qpos[0] = joint.multiplier * value + joint.offset
    mujoco.mj_kinematics(model, data)
    poses = link_poses(robot, positions)
    assert len(positions) > 25 and set(poses) == set(robot.links)
    for name in set(poses) - {robot.root}:
        np.testing.assert_allclose(poses[name][:3, 3], data.body(name).xpos, atol=1e-9)
        np.testing.assert_allclose(poses[name][:3, :3], data.body(name).xmat.reshape(3, 3), atol=1e-9)


ANOTHER = PARTS["a"].replace('"a"', '"c"')
BAD = {
    "repeated link": ('<link name="arm"/>', 'line 5 repeats the link "arm"; each needs its own name'),
    "repeated joint": (PARTS["a"], 'line 5 repeats the joint "a"'),
    "unknown parent": (ANOTHER.replace("base", "leg"), 'line 5 names the link "leg", which'),
    "unknown child": (ANOTHER.replace("arm", "leg"), 'line 5 names the link "leg", which'),
    "two parents": (ANOTHER, 'line 5 is a second joint above the link "arm"'),
    "cycle": (
        ANOTHER.replace("arm", "tip").replace("base", "hand").replace("tip", "base"),
        "is in a cycle of joints that carry each other: a, c, b",
    ),
    "type": (ANOTHER.replace("revolute", "hinge"), 'line 5 has the type "hinge"; use one of revolute, '),
    "no type": (ANOTHER.replace('type="revolute"', ""), "line 5 starts an element joint without the attribute type"),
    "no child": ('<joint name="c" type="fixed"><parent link="arm"/></joint>', "line 5 starts an element joint without"),
}


@pytest.mark.parametrize("case", BAD)
def test_robot_that_is_no_tree_is_refused(case, tmp_path):
    """One line that states what is wrong, and where."""
    part, message = BAD[case]
    with pytest.raises(CalibrationFormatError, match=message):
        bot(tmp_path, "", "", part.format(""))


BAD_JOINTS = {
    "axis": ('\n<axis xyz="0 0 0"/>', "line 4 has an axis of length 0; write the direction"),
    "two numbers": ('<axis xyz="0 1"/>', r"line 3 has 2 numbers instead of 3 \(axis xyz\)"),
    "origin": ('<origin xyz="0 0 nan"/>', r'line 3 has "nan" instead of a finite number \(origin xyz\)'),
    "limit": ('<limit lower="-pi" upper="1"/>', r'line 3 has "-pi" instead of a number \(limit lower\)'),
    "limits": ('<limit upper="1 2"/>', r"line 3 has 2 numbers instead of 1 \(limit upper\)"),
    "mimic": ('<mimic joint="z"/>', 'line 3 follows the joint "z", which the file does not have'),
    "mimics": ('<mimic joint="a"/>', "line 3 is in a cycle of joints that follow each other: a"),
}


@pytest.mark.parametrize("case", BAD_JOINTS)
def test_joint_with_wrong_numbers_is_refused(case, tmp_path):
    """One line that states what is wrong, and where."""
    part, message = BAD_JOINTS[case]
    with pytest.raises(CalibrationFormatError, match=message):
        bot(tmp_path, part)


def test_fixed_joint_needs_no_axis(tmp_path):
    """Exporters write zeros for it."""
    joint = (
        '<link name="c"/><joint name="c" type="fixed"><parent link="arm"/><child link="c"/><axis xyz="0 0 0"/></joint>'
    )
    assert link_poses(bot(tmp_path, "", "", joint))["c"].shape == (4, 4)


def test_several_roots_have_no_common_frame(tmp_path):
    """Their meshes can be read, but not their poses."""
    robot = bot(tmp_path, "", "", '<link name="lamp"/>')
    with pytest.raises(CalibrationFormatError, match="2 links that no joint carries: base, lamp. Connect them"):
        link_poses(robot)


@pytest.mark.parametrize(
    ("positions", "message"),
    [
        ({"aa": 1.0}, 'bot.urdf has no joint "aa"; did you mean "a"'),
        ({"b": 1.0}, 'the joint "b" of bot.urdf follows "a". Give it no position'),
        ({"c": 1.0}, 'the joint "c" of bot.urdf is floating. Give it no position'),
    ],
)
def test_position_of_another_joint_is_refused(positions, message, tmp_path):
    """Names that the robot does not have, and joints that do not move by one number of their own."""
    c = '<link name="tip"/><joint name="c" type="floating"><parent link="hand"/><child link="tip"/></joint>'
    with pytest.raises(CalibrationFormatError, match=message):
        link_poses(bot(tmp_path, "", '<mimic joint="a"/>', c), positions)


def test_long_chain_is_quick(tmp_path):
    """Neither recursion nor a search for each link: 5000 links in a row."""
    links = [f'<link name="l{k}"/>' for k in range(5_001)]
    joint = '<joint name="{0}" type="prismatic"><parent link="l{0}"/><child link="l{1}"/><mimic joint="{1}"/></joint>'
    joints = [joint.format(k, k + 1) for k in range(5_000)]
    joints[-1] = joints[-1].replace('<mimic joint="5000"/>', "")
    assert len(read_robot(written(tmp_path, *links, *joints)).joints) == 5_000


def test_twists_are_derivatives(tmp_path):
    """Of the pose of a link: for joints that turn and slide, also those that others follow; several poses at once."""
    c = '<link name="tip"/><joint name="c" type="revolute"><parent link="hand"/><child link="tip"/>{}</joint>'
    follows = '<origin xyz="0.1 0 0.2"/><axis xyz="0 1 0"/><mimic joint="a" multiplier="-2" offset="0.1"/>'
    a = '<origin xyz="0.1 0.2 0.3" rpy="0.4 -0.5 2"/><axis xyz="0 3 4"/>'
    robot = bot(tmp_path, a, '<origin xyz="0 0 1"/><axis xyz="0 0 -2"/>', c.format(follows))
    positions = {"a": np.array((0.7, -0.2)), "b": np.array((0.25, 0.1))}
    poses, twists = carried(robot, "tip", positions)
    assert set(twists) == {"a", "b"}
    for k in range(2):
        now = {name: float(values[k]) for name, values in positions.items()}
        np.testing.assert_allclose(poses[k], link_poses(robot, now)["tip"], atol=1e-14)
        for name, twist in twists.items():
            ends = [link_poses(robot, now | {name: now[name] + step})["tip"] for step in (-1e-6, 1e-6)]
            slope = (ends[1] - ends[0]) / 2e-6
            cross = np.cross(np.eye(3), twist[k, :3])
            np.testing.assert_allclose(slope[:3, :3], cross @ poses[k, :3, :3], atol=1e-8)
            np.testing.assert_allclose(slope[:3, 3], cross @ poses[k, :3, 3] + twist[k, 3:], atol=1e-8)
