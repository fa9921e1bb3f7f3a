"""Where other links come too near: against signed distances of boxes and cylinders at many joint positions."""

from itertools import product

import numpy as np
import pytest
import trimesh

from skin_calib_addon.common.errors import CalibrationFormatError, UnknownLink
from skin_calib_addon.geometry.mesh.face_points import sample_faces
from skin_calib_addon.robot.keep_out import CLEARANCE, HIDDEN, KeepOut, paths_from
from skin_calib_addon.robot.kinematics import link_poses
from skin_calib_addon.robot.urdf import Joint, Robot, read_robot
from tests.oracles import box_distance
from tests.shapes import box, together, welded

UP = np.array((0, 0, 1.0))
# [m] gaps between ball and body at which the answer may be either: the side of a cell
EITHER = 2.5e-3


def robot(*joints):
    """A robot without mesh files."""
    links = dict.fromkeys(name for joint in joints for name in (joint.parent, joint.child))
    return Robot("robot.urdf", dict.fromkeys(links, ()), "robot", {joint.name: joint for joint in joints})


def floor(low, high, count, height=0.0):
    """Points on a horizontal face, and its normals upwards."""
    x, y = np.meshgrid(np.linspace(low, high, count), np.linspace(low, high, count))
    points = np.column_stack((x.ravel(), y.ravel(), np.full(x.size, height)))
    return points, np.tile(UP, (len(points), 1))


def agrees(found, gaps):
    """Compare with exact gaps between balls and bodies, except for near ones."""
    certain = np.abs(gaps) > EITHER
    assert certain.mean() > 0.5
    wrong = gaps[certain & (found != (gaps < 0))]
    assert len(wrong) == 0, wrong
    assert 0.02 < found.mean() < 0.98  # both answers occur


BASE = box((-0.15, -0.15, -0.02), (0.15, 0.15, 0.0))


@pytest.mark.parametrize("joint", ["fixed", "prismatic"])  # without limits, the latter stays at zero
def test_a_fixed_plate_above_covers_what_is_under_it(joint):
    """At a height of 8 mm: with a clearance of 10 mm; with 6 mm only what it hides. The lower face stays free."""
    low, high = np.array((-0.03, -0.02, 0.0)), np.array((0.03, 0.02, 0.005))
    fixed = robot(Joint("j", joint, "base", "plate", (0.02, 0.01, 0.008)))
    meshes = {"base": BASE, "plate": box(low, high)}
    points, normals = floor(-0.08, 0.08, 41)
    gaps = box_distance(points + 0.005 * UP - (0.02, 0.01, 0.008), low, high) - 0.005
    agrees(KeepOut(fixed, meshes)("base", points, normals), gaps)
    hidden = KeepOut(fixed, meshes, clearance=0.006)("base", points, normals)
    inside = gaps + 0.005 < 0.0031  # under the plate
    assert hidden[inside].any() and not hidden[~inside].any() and not hidden[inside].all()
    assert not KeepOut(fixed, meshes)("base", points - 0.02 * UP, -normals).any()


def test_only_what_is_in_front_of_a_face_counts():
    """A wall at right angles ends 1 mm from an edge of the face, and the face looks past it."""
    stands = robot(Joint("j", "fixed", "base", "wall"))
    wall = box((-0.15, 0.001, -0.1), (0.15, 0.02, -0.001))  # behind and below
    points = np.array([(0.0, 0.0, 0.0), (0.05, 0.0, 0.0)])
    assert not KeepOut(stands, {"wall": wall})("base", points, np.tile(UP, (2, 1))).any()
    assert KeepOut(stands, {"wall": wall})("base", points - (0, 0, 0.01), np.tile((0, 1.0, 0), (2, 1))).all()


@pytest.mark.parametrize(
    "kind, limits",
    [("revolute", (-0.5, 1.0)), ("continuous", None), ("revolute", (-1e6, 1e6)), ("prismatic", (-0.02, 0.05))],
)
def test_a_cylinder_on_a_hinge_covers_its_sector(kind, limits):
    """It lies along x from 30 to 80 mm, its axis 10 mm above the face: a ball meets it within 8.7 mm of its axis."""
    axis = (0.0, 1.0, 0.0) if kind == "prismatic" else (0.0, 0.0, 1.0)
    moves = robot(Joint("j", kind, "base", "arm", axis=axis, limits=limits))
    cylinder = trimesh.creation.cylinder(0.005, segment=[(0.03, 0, 0.01), (0.08, 0, 0.01)], sections=64)
    points, normals = floor(-0.12, 0.12, 61)
    low, high = limits or (-np.pi, np.pi)
    angle, radius = np.arctan2(points[:, 1], points[:, 0]), np.linalg.norm(points[:, :2], axis=1)
    if kind == "prismatic":
        along, across = points[:, 0], points[:, 1] - np.clip(points[:, 1], low, high)
    else:
        off = angle - np.clip(angle, low, high)  # to the nearest position; none is beyond half a turn here
        along, across = radius * np.cos(off), radius * np.sin(off)
    ball = np.column_stack((along, across, np.full(len(points), 0.005)))
    # Exact for the solid cylinder with flat ends.
    radial = np.maximum(np.hypot(ball[:, 1], ball[:, 2] - 0.01) - 0.005, 0)
    axial = np.maximum(np.maximum(0.03 - ball[:, 0], ball[:, 0] - 0.08), 0)
    agrees(KeepOut(moves, {"arm": welded(cylinder)})("base", points, normals), np.hypot(radial, axial) - 0.005)


def test_what_is_inside_of_a_closed_link_is_covered():
    """A stub in a hollow closed box, 30 mm from all walls."""
    hollow = together(box((-0.05,) * 3, (0.05,) * 3), box((-0.045,) * 3, (0.045,) * 3))
    fixed = robot(Joint("j", "fixed", "base", "hollow"))
    points = np.array([(0, 0, 0.0), (0.0, 0.0, 0.0449), (0, 0, 0.2)])
    found = KeepOut(fixed, {"hollow": hollow})("base", points, np.tile(UP, (3, 1)))
    np.testing.assert_array_equal(found, (True, True, False))


@pytest.mark.parametrize("kind", ["fixed", "revolute"])
def test_a_shell_hides_what_is_below_it_at_any_distance(kind):
    """A bowl over the face, 20 mm above it, also on a joint that hardly moves; what is on the other side stays free."""
    rng = np.random.default_rng(0)
    low, high, turn = np.array((-0.08, -0.08, -0.01)), np.array((0.08, 0.08, 0.0)), tuple(rng.uniform(-1, 1, 3))
    stands = robot(Joint("j", kind, "cover", "base", (0.1, 0.2, -0.3), turn, limits=(0, 0.001)))
    to_cover = link_poses(stands)["base"]
    bowl = trimesh.creation.icosphere(3, 0.08)
    bowl = bowl.submesh([bowl.triangles_center[:, 2] > -0.06], append=True).apply_translation((0, 0, 0.08))
    meshes = {"base": box(low, high), "cover": welded(bowl.apply_transform(to_cover))}
    points, normals = floor(-0.015, 0.015, 5)
    assert (KeepOut(stands, meshes).coverers("base", points, normals) == HIDDEN).all()
    assert not KeepOut(stands, meshes)("base", points - 0.01 * UP, -normals).any()


def helmet(opening):
    """A sphere of 100 mm around the origin, without the part of it in front of x = ``opening``."""
    ball = trimesh.creation.icosphere(4, 0.1)
    return welded(ball.submesh([ball.triangles_center[:, 0] < opening], append=True))


@pytest.mark.parametrize(("opening", "limits", "count"), [(1, (-2, 2), 0), (0.08, (-2, 2), 9), (0.08, (2.5, 3), 0)])
def test_what_another_link_encloses_in_every_pose_is_hidden(opening, limits, count):
    """A head in a helmet with a window; it turns its face to the window, to both sides of it, or never."""
    worn = robot(Joint("j", "revolute", "helmet", "head", axis=(0, 0, 1.0), limits=limits))
    y, z = np.meshgrid(*[np.linspace(-0.005, 0.005, 3)] * 2)
    face = np.column_stack((np.full(9, 0.05), y.ravel(), z.ravel()))
    head = box((-0.05, -0.03, -0.03), (0.05, 0.03, 0.03))
    found = KeepOut(worn, {"helmet": helmet(opening), "head": head})("head", face, np.tile((1.0, 0, 0), (9, 1)))
    assert (~found).sum() == count


def test_what_covers_a_point_is_named():
    """A plate that hangs over one end of a floor, one behind a joint over the other, and a bowl over the middle."""
    bowl = trimesh.creation.icosphere(4, 0.05)
    bowl = bowl.submesh([bowl.triangles_center[:, 2] > -0.04], append=True).apply_translation((0, 0, 0.05))
    plate = box((-0.02, -0.02, 0.004), (0.02, 0.02, 0.008))
    parts = robot(
        Joint("j", "fixed", "base", "left", (-0.1, 0, 0)),
        Joint("k", "revolute", "base", "right", (0.1, 0, 0), limits=(0, 0.1)),
        Joint("l", "fixed", "base", "bowl"),
    )
    meshes = {"base": BASE, "left": plate, "right": plate, "bowl": welded(bowl)}
    points = np.array([(-0.1, 0, 0), (0.1, 0, 0), (0, 0, 0), (0, 0.13, 0)])
    found = KeepOut(parts, meshes).coverers("base", points, np.tile(UP, (4, 1)))
    assert found.tolist() == ["left", "right", HIDDEN, ""]


SHAPES = {"a": ((-0.03, -0.02, -0.05), (0.03, 0.02, 0.0)), "b": ((-0.01,) * 3, (0.02, 0.015, 0.01))}
SHAPES["c"] = ((-0.015, -0.03, -0.03), (0.015, 0.03, 0.05))


@pytest.mark.parametrize(
    "link, other, second",
    [("a", "b", "revolute"), *((*pair, kind) for pair in ("bc", "ca", "ac") for kind in ("revolute", "prismatic"))],
)
def test_two_oblique_joints_agree_with_many_positions(link, other, second):
    """From parent to child, back, and over both: the least signed distance over a grid of positions."""
    limits = (-0.8, 0.6) if second == "revolute" else (-0.03, 0.03)
    arm = robot(
        Joint("1", "revolute", "a", "b", (0.01, 0.0, 0.016), (0.3, -0.4, 0.2), (0.6, 0.0, 0.8), (-1.0, 0.7)),
        Joint("2", second, "b", "c", (0.0, 0.02, 0.015), (-0.2, 0.5, 1.0), (0.0, 0.8, 0.6), limits),
    )
    points, face, _ = sample_faces(mesh := box(*SHAPES[link]), 6e-3)
    normals = mesh.face_normals[face]
    balls, least = points + CLEARANCE / 2 * normals, np.full(len(points), np.inf)
    for q in product(np.linspace(-1.0, 0.7, 40), np.linspace(*limits, 40)):
        poses = link_poses(arm, {"1": q[0], "2": q[1]})
        move = np.linalg.inv(poses[other]) @ poses[link]
        least = np.minimum(least, box_distance(balls @ move[:3, :3].T + move[:3, 3], *SHAPES[other]))
    agrees(KeepOut(arm, {other: box(*SHAPES[other])})(link, points, normals), least - CLEARANCE / 2)


def test_links_behind_three_moving_joints_do_not_count():
    """Fixed joints do not count as moving; a link behind a floating joint is never a neighbour."""
    kinds = ("revolute", "fixed", "continuous", "prismatic", "revolute")
    chain = robot(*(Joint(f"{i}", kind, f"{i}", f"{i + 1}") for i, kind in enumerate(kinds)))
    assert {other for other, _ in paths_from(chain, "0")} == {"1", "2", "3"}
    assert {other for other, _ in paths_from(chain, "3")} == {"0", "1", "2", "4", "5"}
    assert [len(path) for other, path in paths_from(chain, "3") if other == "0"] == [3]
    assert not list(paths_from(robot(Joint("f", "floating", "a", "b")), "a"))


def test_unknown_link_is_an_error():
    """It names the nearest one."""
    with pytest.raises(UnknownLink, match="robot.urdf has no link.*bsae.*base"):
        KeepOut(robot(Joint("j", "fixed", "base", "arm")), {})("bsae", np.zeros((0, 3)), np.zeros((0, 3)))


@pytest.mark.parametrize("limit", [0.5, 1e6, 1e300])
def test_travel_without_sense_is_no_longer_than_the_robot_needs(limit):
    """A plate slides along x and turns: it covers a strip, as wide as it is at its largest angle."""
    low, high, angle = np.array((-0.03, -0.02, 0.0)), np.array((0.03, 0.02, 0.005)), 0.5
    slides = robot(
        Joint("s", "prismatic", "base", "slide", (0, 0, 0.008), limits=(-limit, limit)),
        Joint("t", "revolute", "slide", "plate", axis=(0, 0, 1), limits=(-angle, angle)),
    )
    points, normals = floor(-0.08, 0.08, 41)
    half = 0.03 * np.sin(angle) + 0.02 * np.cos(angle)
    gaps = np.hypot(0.003, np.maximum(np.abs(points[:, 1]) - half, 0)) - 0.005
    agrees(KeepOut(slides, {"plate": box(low, high)})("base", points, normals), gaps)


def test_boxes_and_cylinders_cover_as_meshes_do(tmp_path):
    """A box on the link itself, and a cylinder below it that is fixed; the faces under both are not free."""
    visual = '<visual><origin xyz="{0}" rpy="{1}"/><geometry>{2}</geometry></visual>'
    mesh = '<mesh filename="base.ply"/>'
    on_top = visual.format("0.05 0 0.01", "0 0 0.3", '<box size="0.06 0.04 0.02"/>')
    below = visual.format("0 0 0", "0 1.5707963 0", '<cylinder radius="0.02" length="0.1"/>')
    (tmp_path / "bot.urdf").write_text(
        f'<robot name="bot"><link name="base">{visual.format("0 0 0", "0 0 0", mesh)}{on_top}</link><link name="lid">'
        f'{below}</link><joint name="j" type="fixed"><origin xyz="0 0 -0.041"/><parent link="base"/><child link="lid"/>'
        "</joint></robot>"
    )
    covers = KeepOut(read_robot(tmp_path / "bot.urdf"), {"base": BASE})
    top, up = floor(-0.12, 0.12, 49)
    turn = np.array(((np.cos(0.3), np.sin(0.3)), (-np.sin(0.3), np.cos(0.3))))
    in_box = (np.abs((top[:, :2] - (0.05, 0)) @ turn.T) < (0.028, 0.018)).all(axis=1)
    found = covers("base", top, up)
    assert in_box.sum() > 30 and found[in_box].all() and not found[np.linalg.norm(top[:, :2], axis=1) > 0.1].any()
    bottom = top - 0.02 * UP
    found = covers("base", bottom, -up)
    near = (np.abs(bottom[:, 0]) < 0.045) & (np.abs(bottom[:, 1]) < 0.003)
    assert near.sum() > 10 and found[near].all() and not found[np.abs(bottom[:, 1]) > 0.08].any()


def test_capsule_covers_what_is_below_its_cylinder_and_its_ends(tmp_path):
    """Of a URDF: it stands 2 mm over a face, and is 60 mm long without the half spheres at its ends."""
    at = '<origin xyz="0 0 0.022" rpy="0 1.5707963 0"/>'
    (tmp_path / "bot.urdf").write_text(
        f'<robot name="bot"><link name="base"><visual>{at}<geometry><capsule radius="0.02" length="0.06"/></geometry>'
        "</visual></link></robot>"
    )
    points = np.array(((0.0, 0, 0), (0.03, 0, 0), (0.044, 0, 0), (0.056, 0, 0), (0, 0.04, 0)))
    found = KeepOut(read_robot(tmp_path / "bot.urdf"), {"base": BASE})("base", points, np.tile(UP, (5, 1)))
    assert found.tolist() == [True, True, True, False, False]


@pytest.mark.parametrize("shape", ['<box size="1 1"/>', '<sphere radius="-1"/>', '<cylinder radius="1"/>'])
def test_shape_without_its_sizes_is_refused(tmp_path, shape):
    """With the line of the file."""
    text = f'<robot name="bot"><link name="a">\n<visual><geometry>{shape}</geometry></visual></link></robot>'
    (tmp_path / "bot.urdf").write_text(text)
    with pytest.raises(CalibrationFormatError, match="line 2 has a (box|sphere|cylinder) without the sizes"):
        read_robot(tmp_path / "bot.urdf")


def test_what_is_many_joints_away_covers_in_the_zero_pose():
    """Two plates face each other, 8 mm apart, at the ends of six joints."""
    joints = [Joint(f"{k}", "revolute", f"{k}", f"{k + 1}", limits=(-1, 1)) for k in range(5)]
    arms = robot(*joints, Joint("5", "revolute", "5", "6", (0, 0, 0.008), limits=(-1, 1)))
    meshes = {"0": BASE, "6": box((-0.03, -0.02, 0), (0.03, 0.02, 0.005))}
    points, normals = floor(-0.08, 0.08, 9)
    found = KeepOut(arms, meshes).coverers("0", points, normals)
    inside = (np.abs(points) < (0.03, 0.02, 1)).all(axis=1)
    assert (found[inside] == "6").all() and (found[np.abs(points[:, 1]) > 0.03] == "").all()


def test_far_travel_takes_no_memory():
    """Some files write 1e16 m for "no limit"."""
    slides = robot(Joint("j", "prismatic", "base", "cart", limits=(-1e16, 1e16)))
    keep_out = KeepOut(slides, {"base": BASE, "cart": box((-0.03, -0.02, 0), (0.03, 0.02, 0.005))})
    assert max(view.buffers.width for view in keep_out.views) < 500


@pytest.mark.parametrize(("kind", "found"), [("fixed", "helmet"), ("floating", "")])
def test_a_link_with_an_unknown_pose_hides_nothing(kind, found):
    """A helmet around a head, fixed to it, or somewhere."""
    worn = robot(Joint("j", kind, "helmet", "head"))
    head = box((-0.05, -0.03, -0.03), (0.05, 0.03, 0.03))
    covers = KeepOut(worn, {"helmet": helmet(1), "head": head})
    assert covers.coverers("head", np.array([(0.05, 0.0, 0.0)]), np.array([(1.0, 0, 0)])).tolist() == [found]
