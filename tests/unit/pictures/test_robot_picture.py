"""The picture of a robot: what is nearest, what is covered, and the command that draws it."""

import json

import numpy as np
import pytest
from matplotlib.image import imread

from skin_calib_addon.cli import main
from skin_calib_addon.pictures import robot as robot_picture
from skin_calib_addon.pictures.robot import COVERED, MIN_WIDTH, _nearest, draw_robot
from tests.samples import boards, small_calibration
from tests.shapes import box, cylinder
from tests.unit.commands.test_robot_set import fitted as fitted_fixture
from tests.unit.commands.test_robot_set import robot as robot_fixture
from tests.unit.pictures.test_picture import read_png

fitted, robot = fitted_fixture, robot_fixture
PICTURE_HEIGHT = 440


@pytest.fixture(autouse=True)
def small(monkeypatch):
    """Pictures of 440 pixels, which take a sixth of the time."""
    monkeypatch.setattr(robot_picture, "PICTURE_HEIGHT", PICTURE_HEIGHT)


def test_nearest_triangle_is_that_of_brute_force():
    """Of 30 random triangles, at each pixel, with depths by barycentric coordinates."""
    rng = np.random.default_rng(1)
    triangles = rng.uniform(0, (16, 12, 1), (30, 3, 3))
    visible = rng.random(30) < 0.8
    found = _nearest(triangles, visible, np.array((16, 12))).reshape(12, 16)
    for row in range(12):
        for column in range(16):
            best, depth = -1, -np.inf
            for k in np.flatnonzero(visible):
                sides = (triangles[k, 1:, :2] - triangles[k, 0, :2]).T
                u, v = np.linalg.solve(sides, (column, row) - triangles[k, 0, :2])
                here = triangles[k, 0, 2] + (u, v) @ (triangles[k, 1:, 2] - triangles[k, 0, 2])
                if min(u, v, 1 - u - v) >= 0 and here > depth:
                    best, depth = k, here
            assert found[row, column] == best


def is_covered(pixels):
    """Return which pixels have the colour of skin, whatever the light."""
    hue = pixels / np.maximum(pixels.max(axis=2, keepdims=True), 1e-6)
    return np.abs(hue - COVERED / COVERED.max()).max(axis=2) < 0.05


@pytest.mark.parametrize("front", [True, False])
def test_skin_is_seen_from_its_side_only(tmp_path, front):
    """A skin on the front of a plate is in the left half of the picture; one on the back is in the right half."""
    side = 1.0 if front else -1.0
    skin = small_calibration(patches=(boards(),))
    turn = np.eye(4)
    turn[:3, :3] = np.array(((0, 0, side), (0, 1, 0), (-side, 0, 0)))  # z of the link is side * x of the robot
    plate = box((0.0, 0.0, -0.12), (0.1, 0.1, -0.101))
    draw_robot({"link": plate}, {"link": turn}, {"link": skin}, "plate", tmp_path / "p.png")
    covered = is_covered(read_png(tmp_path / "p.png"))
    assert 30 < covered[:-PICTURE_HEIGHT].sum() < 300  # the legend
    left, right = np.array_split(covered[-PICTURE_HEIGHT:], 2, axis=1)
    assert (left if front else right).sum() > 80 and (right if front else left).sum() == 0


def test_title_of_a_slim_robot_fits(tmp_path):
    """A pole of 1 m is wider in the picture than it is, and in the middle of each view."""
    pole = box((-0.01, -0.01, 0.0), (0.01, 0.01, 1.0))
    draw_robot(
        {"link": pole}, {"link": np.eye(4)}, {}, "a long title of a robot: skin on 0 of 1 links", tmp_path / "p.png"
    )
    picture = read_png(tmp_path / "p.png")[-PICTURE_HEIGHT:-100]
    drawn = np.flatnonzero((picture < 0.9).any(axis=(0, 2)))
    assert picture.shape[1] == 2 * MIN_WIDTH
    for half in (drawn[drawn < MIN_WIDTH], drawn[drawn >= MIN_WIDTH] - MIN_WIDTH):
        assert len(half) and abs(half.mean() - MIN_WIDTH / 2) < 3


def show(robot, capsys, *words):
    capsys.readouterr()
    code = main(["show", str(robot / "out"), *map(str, words)])
    out, err = capsys.readouterr()
    return code, out, [line for line in err.splitlines() if "[duplicate-" not in line]


def test_command_draws_the_robot(robot, capsys):
    """Both links are in the picture, and the table has their covered areas."""
    code, out, err = show(robot, capsys, "--picture", robot / "robot.png")
    assert (code, err) == (0, []) and "bot: 2 links, 16 taxels, 16 cm²" in out
    assert "8.0 cm²" in out.splitlines()[1]
    tube = cylinder(around=24, along=8).face_areas.sum() * 1e4
    assert [" ".join(line.split()) for line in out.splitlines()[-3:]] == [
        f"cells cover 8.0 of {tube:.1f} cm² seen, 4 % arm",
        f"cells cover 8.0 of {tube:.1f} cm² seen, 4 % hand",
        f"cells cover 16.0 of {2 * tube:.1f} cm² seen, 4 % all links",
    ]
    assert is_covered(imread(robot / "robot.png")[..., :3]).sum() > 160


def test_missing_mesh_is_one_line(robot, capsys):
    """The other links are drawn; code 1."""
    (robot / "hand.ply").unlink()
    code, out, err = show(robot, capsys, "--picture", robot / "robot.png")
    assert code == 1 and (robot / "robot.png").exists() and "bot: 2 links" in out
    assert len(err) == 1 and "hand is not in the picture: the mesh file hand.ply of bot.urdf was not found" in err[0]


@pytest.mark.parametrize("urdf", [None, {"file": "../none.urdf", "sha256": "0" * 64}])
def test_without_urdf_there_is_the_table_only(robot, capsys, urdf):
    """A plain message states what is missing."""
    path = robot / "out" / "robot.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | {"urdf": urdf}))
    code, out, err = show(robot, capsys, "--picture", robot / "robot.png")
    assert code == 1 and "bot: 2 links" in out and not (robot / "robot.png").exists()
    words = "none.urdf" if urdf else "robot.json names no URDF, which the picture needs"
    assert len(err) == 1 and words in err[0]
    assert show(robot, capsys)[0] == 0
