"""Poses of a tool in a table: columns, units, frames, and their scatter."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from skin_calib_addon.common.errors import CalibrationFormatError
from skin_calib_addon.geometry.mesh.triangle_mesh import METRES_PER_UNIT
from skin_calib_addon.validation import placements, read_touches
from skin_calib_addon.validation.tool import MESH_UNITS, OF_LINK, OF_TOOL, ToolContacts, matrices
from tests.samples import small_calibration

CALIBRATION = small_calibration()
IDS = CALIBRATION.patches[0].taxels.ids
COMMENT = "# tool: my tool.stl mm"


def contacts(poses, **changes):
    """The origin of the tool is the point of touch."""
    n = len(poses.lines)
    values = {
        "poses": poses,
        "points": poses.positions,
        "distances": np.full(n, 2e-4),
        "spreads": np.zeros(n),
        "at_rim": np.zeros(n, bool),
        "intersecting": np.arange(0),
        "centroids": np.empty((0, 3)),
        "centroid_distances": np.empty(0),
        "is_closed": True,
    }
    return ToolContacts(**values | changes)


def pose(position, rotation):
    """Return a pose as in a table."""
    return [*position, *rotation.as_quat()]


def read(folder, rows, header=None, comment=COMMENT, **changes):
    """Read rows: a press and its poses."""
    header = header or ",".join(("taxel", "press", *OF_TOOL, *OF_LINK)[: 1 + len(rows[0])])
    lines = [comment, header, *(f"{IDS[0]}," + ",".join(f"{x:.9f}" for x in row) for row in rows)]
    (folder / "t.csv").write_text("\n".join(lines) + "\n")
    return read_touches(folder / "t.csv", CALIBRATION, lambda poses: contacts(poses, **changes))


def test_poses_in_the_world_become_those_in_the_frame_of_the_link(tmp_path):
    """Whatever the pose of the link; without it, they are in its frame already. The sign of a quaternion is free."""
    rng = np.random.default_rng(0)
    tools = [(rng.normal(size=3) / 9, Rotation.random(random_state=rng)) for _ in range(4)]
    rows, plain = [], []
    for k, (position, rotation) in enumerate(tools):
        link, at = Rotation.random(random_state=rng), rng.normal(size=3)
        sign = (-1) ** k
        tool = pose(link.apply(position) + at, link * rotation)
        rows.append([k, *tool[:3], *(sign * np.array(tool[3:])), *pose(at, link)])
        plain.append([k, *pose(position, rotation)])
    for found in (read(tmp_path, rows).tool.poses, read(tmp_path, plain).tool.poses):
        assert_allclose(found.positions, [position for position, _ in tools], atol=1e-7)
        assert_allclose(found.rotations, [rotation.as_matrix() for _, rotation in tools], atol=1e-7)
    assert (found.file, found.unit) == (tmp_path / "my tool.stl", "mm") and found.noise is None


def test_scatter_of_poses_in_presses_is_stated(tmp_path):
    """Per axis, of the tool and of the link, also where the sign of the quaternions changes from row to row."""
    rng, rows = np.random.default_rng(0), []
    for press in range(20):
        poses = [(rng.normal(size=3), Rotation.random(random_state=rng)) for _ in range(2)]
        for k in range(20):
            row = [press]
            for (position, rotation), noise in zip(poses, (1, 2)):
                turn = Rotation.from_rotvec(rng.normal(0, noise * 3e-3, 3))
                numbers = np.array(pose(position + rng.normal(0, noise * 2e-4, 3), turn * rotation))
                numbers[3:] *= (-1) ** k
                row += numbers.tolist()
            rows.append(row)
    touches = read(tmp_path, rows)
    for noise, factor in ((touches.tool.poses.noise, 1), (touches.tool.poses.noise_of_link, 2)):
        assert noise.position == pytest.approx(factor * 2e-4, rel=0.07)
        assert noise.rotation == pytest.approx(factor * 3e-3, rel=0.07)
        assert noise.at(0.1) == pytest.approx(np.hypot(noise.position, 0.1 * noise.rotation))
    said = dict(touches.tool.summary())
    assert said["pose of the tool"].startswith("scatter 0.18 degrees x lever ")
    assert "per axis" in said["pose of the link"] and len(touches.taxels) == 20
    medians = np.sqrt(np.pi / 2 / 20)  # of 20 rows; the origin of the tool is its point of touch
    lever = np.linalg.norm(touches.points, axis=1)
    assert_allclose(touches.tool.sigma, medians * np.hypot(2e-4, np.hypot(4e-4, 6e-3 * lever)), rtol=0.07)


def test_scatter_of_poses_is_in_the_standard_errors(tmp_path):
    """With noise the displacement is less certain, also by presses of one row; the scatter of few rows is not known."""
    rng, taxels = np.random.default_rng(0), CALIBRATION.patches[0].taxels
    errors = {}
    for noise in (1e-4, 4e-3):
        rows = [[0, *pose(taxels.positions_link[0] + rng.normal(0, noise, 3), Rotation.identity())] for _ in range(6)]
        rows += [[1 + k, *pose(p, Rotation.identity())] for k, p in enumerate(taxels.positions_link)]
        touches = read(tmp_path, rows)
        touches = replace(touches, taxels=(IDS[0], *IDS))
        (found,) = placements(CALIBRATION, touches)
        assert_allclose(found.noise[1:], touches.tool.poses.noise.position)
        errors[noise] = found.motion.shift_error
    assert (errors[4e-3] > 1.1 * errors[1e-4]).all()
    assert not read(tmp_path, rows[4:]).tool.sigma.any()


def test_units_are_in_brackets(tmp_path):
    """Positions in millimetres; a comment can have any unit that a mesh has."""
    header = ",".join(("taxel", "press", *(f"{name} [mm]" for name in OF_TOOL[:3]), *OF_TOOL[3:]))
    found = read(tmp_path, [[0, 20.0, 30.0, 40.0, 0, 0, 0, 1]], header).tool.poses
    assert_allclose(found.positions, [(0.02, 0.03, 0.04)])
    assert {*MESH_UNITS} == {*METRES_PER_UNIT}


ROW = [0, 0.02, 0.03, 0.04, 0.0, 0.0, 0.0, 1.0]
HEADER = ",".join(("taxel", "press", *OF_TOOL))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"rows": [[*ROW[:7], 0.9]]}, "line 3: the quaternion of the tool has the length 0.9 instead of 1. Check its"),
        ({"rows": [[*ROW, *ROW[1:7], 0.0]]}, "line 3: the quaternion of the link has the length 0 instead of 1"),
        ({"rows": [[0, 20.0, *ROW[2:]]]}, 'coordinate 20 m is more than 10 m .* name the column "tool_x \\[mm\\]"'),
        ({"rows": [ROW], "comment": ""}, 'names no mesh of the tool. Add a comment "# tool: tool.stl mm", with file'),
        ({"rows": [ROW], "comment": "# tool: tool.stl"}, "line 1: the comment ends in .* instead of a unit: m, cm, mm"),
        ({"rows": [ROW], "comment": "# tool: mm"}, "line 1: the comment ends in "),
        ({"rows": [ROW], "comment": f"{COMMENT}\n# tool: b.stl m"}, "line 2: the file names several meshes of tools"),
        ({"rows": [ROW], "header": HEADER.replace("tool_qz", "qz")}, 'the header names no column "tool_qz"'),
        ({"rows": [[*ROW, 1.0]], "header": HEADER + ",link_x"}, 'the header names no column "link_y"'),
        ({"rows": [[*ROW, 1.0, 1.0, 1.0]], "header": HEADER + ",x,y,z"}, "a point and the pose of a tool. Remove one"),
    ],
)
def test_bad_poses_are_one_line(changes, message, tmp_path):
    """With line and column, and what to do."""
    with pytest.raises(CalibrationFormatError, match=message) as found:
        read(tmp_path, **changes)
    assert "\n" not in str(found.value)


def test_poses_without_a_mesh_of_the_link_are_an_error(tmp_path):
    """The points of touch are unknown then."""
    read(tmp_path, [ROW])
    with pytest.raises(CalibrationFormatError, match="poses of a tool, whose points .* Name the plan instead"):
        read_touches(tmp_path / "t.csv", CALIBRATION)


def test_warnings_name_the_touches(tmp_path):
    """Deep and wide ones, and those at a hole; a tool with holes; nothing without a reason."""
    rows = [[k, *ROW[1:]] for k in range(3)]
    assert [*read(tmp_path, rows).tool.warnings()] == []
    changes = {
        "distances": np.array((1e-4, -4e-3, 0.0)),
        "spreads": np.array((0, 0, 2e-3)),
        "at_rim": np.array((True, False, False)),
        "is_closed": False,
    }
    found = {w.code: w.message for w in read(tmp_path, rows, **changes).tool.warnings()}
    assert list(found) == ["tool-depth", "wide-contact", "tool-at-hole", "tool-open"]
    assert "more than 3 mm inside the link: line 4." in found["tool-depth"]
    assert "2.0 mm (rms)" in found["wide-contact"] and found["wide-contact"].endswith("line 5.")
    assert found["tool-at-hole"].endswith("line 3.")


def test_matrices_are_those_of_the_quaternions():
    """As SciPy has them."""
    turns = Rotation.random(9, random_state=0)
    assert_allclose(matrices(turns.as_quat()), turns.as_matrix(), atol=1e-12)
