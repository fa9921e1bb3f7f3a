"""Touches by the poses of a tool and the meshes of tool and link."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from skin_calib_addon.calibration import save_calibration
from skin_calib_addon.cli import main
from skin_calib_addon.common.errors import CalibrationFormatError, InvalidMesh
from skin_calib_addon.geometry.mesh.triangle_mesh import TriangleMesh, save_mesh, weld
from skin_calib_addon.inspection.touch_file import read_touch_file
from skin_calib_addon.validation.tool import OF_LINK, OF_TOOL
from tests.samples import RADIUS, sheet, small_calibration

SHEET = sheet(4, 6, 0.01)
CALIBRATION = small_calibration(patches=(SHEET,))
TUBE = trimesh.creation.cylinder(RADIUS, 0.2, 180)
LINK = weld(TUBE.vertices, TUBE.faces)
LEVER, TIP = 0.12, 0.004  # [m] of the tool
DEPTHS = np.array((-2e-4, 0.0, 3e-4, 6e-4, 1e-3))
ROWS = (7, 8, 9, 14, 15)  # of the touched taxels


def tool():
    """Return a rod with a round tip, in millimetres."""
    rod = trimesh.creation.cylinder(1.5, 1e3 * LEVER, 16).apply_translation((0, 0, 5e2 * LEVER))
    return trimesh.util.concatenate(
        [trimesh.creation.icosphere(3, 1e3 * TIP).apply_translation((0, 0, 1e3 * LEVER)), rod]
    )


def session(folder, change=lambda tool, link: (tool, link), away=0.0, mesh=None, with_link=True, unit="mm"):
    """Write a press of each depth on some taxels; return the file, and the deepest points (n, 3)."""
    (mesh or tool()).export(folder / "tool.stl")
    rng, deepest = np.random.default_rng(0), []
    lines = [f"# tool: tool.stl {unit}", ",".join(("taxel", *OF_TOOL, *OF_LINK * with_link))]
    for row, depth in zip(ROWS, DEPTHS):
        normal = SHEET.taxels.normals_link[row]
        deepest.append(SHEET.taxels.positions_link[row] - (depth - away) * normal)
        down = Rotation.align_vectors([-normal], [(0, 0, 1.0)])[0]
        turn = Rotation.from_rotvec(rng.normal(0, 0.2, 3)) * down
        origin = deepest[-1] + TIP * normal - turn.apply((0, 0, LEVER))
        link, at = Rotation.random(random_state=rng), rng.uniform(-1, 1, 3)
        poses = change(
            np.array((*(link.apply(origin) + at), *(link * turn).as_quat())), np.array((*at, *link.as_quat()))
        )
        lines.append(f"{SHEET.taxels.ids[row]}," + ",".join(f"{x:.9f}" for x in np.concatenate(poses[: 1 + with_link])))
    (folder / "t.csv").write_text("\n".join(lines) + "\n")
    return folder / "t.csv", np.array(deepest)


def test_deepest_points_are_the_touches(tmp_path):
    """In the frame of the link; the centroid of the intersection exists for the deep ones, and is near."""
    path, deepest = session(tmp_path)
    touches = read_touch_file(path, CALIBRATION, lambda: LINK)
    found = touches.tool
    assert_allclose(touches.points, deepest, atol=3e-4)
    assert_allclose(found.distances, -DEPTHS, atol=5e-5)
    assert found.intersecting.tolist()[-3:] == [2, 3, 4]
    apart = found.centroids - touches.points[found.intersecting]
    assert np.linalg.norm(apart, axis=1).max() < 8e-4 and (found.centroid_distances < 0).all()
    assert not touches.directions.any() and [*found.warnings()] == []
    said = [line for _, line in found.summary()]
    assert said[1].split() == ["nearest", "approach", "5", "-0.33,", "0.42", "mm"]
    assert said[2].startswith("centroid of the intersection") and said[2].endswith(" mm")
    assert said[3] == "lever 124 mm; too few rows of each press for their scatter"


def test_inner_sides_of_a_wall_do_not_count(tmp_path):
    """A tip that is deeper than half of a wall of one millimetre is as deep as on a solid link."""
    path, _ = session(tmp_path)
    wall = trimesh.creation.annulus(RADIUS - 1e-3, RADIUS, 0.2, 180)
    found = read_touch_file(path, CALIBRATION, lambda: TriangleMesh(np.array(wall.vertices), np.array(wall.faces)))
    assert_allclose(found.tool.distances, -DEPTHS, atol=5e-5)


def w_first(pose):
    """Return a pose with another order of its quaternion."""
    return np.append(pose[:3], np.roll(pose[3:], 1))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"away": 0.05},
            "The tool of tool.stl is 50 mm .median. from the surface of the link. Check the frames of the tool and of",
        ),
        (
            {"change": lambda tool, link: (w_first(tool), w_first(link))},
            "and [01] mm if the columns have quaternions with w first. Correct it",
        ),
        (
            {"change": lambda tool, link: (tool * (1, 1, 1, -1, -1, -1, 1), link * (1, 1, 1, -1, -1, -1, 1))},
            "if the columns have inverse quaternions",
        ),
        (
            {"change": lambda tool, link: (tool * (*(1e-3,) * 3, 1, 1, 1, 1), link * (*(1e-3,) * 3, 1, 1, 1, 1))},
            "if the columns have positions in a unit that is 1000 times larger",
        ),
        ({"with_link": False}, "Check the frames of the tool and of the link, whose pose is missing, and the unit of"),
        ({"unit": "m"}, 'tool.stl has a diameter of .* m when read in "m". Set "unit" to that of its numbers: "cm"'),
    ],
)
def test_poses_in_a_wrong_frame_are_one_line(changes, message, tmp_path):
    """It names what the columns have instead, if that brings the tool to the link."""
    path, _ = session(tmp_path, **changes)
    with pytest.raises((CalibrationFormatError, InvalidMesh), match=message):
        read_touch_file(path, CALIBRATION, lambda: LINK)


def test_tool_with_holes_is_named(tmp_path):
    """The far end of the rod is missing."""
    mesh = tool()
    mesh.update_faces(mesh.triangles_center[:, 2] > 1)
    found = read_touch_file(session(tmp_path, mesh=mesh)[0], CALIBRATION, lambda: LINK)
    assert [warning.code for warning in found.tool.warnings()] == ["tool-open"]
    assert_allclose(found.tool.distances, -DEPTHS, atol=5e-5)


def test_command_finds_the_mesh_of_the_calibration(tmp_path, capsys):
    """Next to it, if its geometry is unchanged, in any unit; else it asks for the plan."""
    path, _ = session(tmp_path)
    source = replace(CALIBRATION.mesh, file="limb.stl", sha256=LINK.sha256)
    save_calibration(replace(CALIBRATION, mesh=source), tmp_path / "c.json")
    words = ["touches", str(tmp_path / "c.json"), str(path)]
    assert main(words) == 1
    assert "limb.stl, the mesh of " in (said := capsys.readouterr().err) and "Name the plan instead" in said
    save_mesh(LINK, tmp_path / "limb.ply")
    save_calibration(replace(CALIBRATION, mesh=replace(source, file="limb.ply")), tmp_path / "c.json")
    assert main(words) == 0
    said = capsys.readouterr().out
    assert "tool             point of touch" in said and "pose of the link lever 40 mm" in said
