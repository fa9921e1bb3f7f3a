"""The button, the command, a batch and plain Python give the same calibration."""

import json
import os
import subprocess
import sys

import pytest
from scipy.spatial.transform import Rotation

from skin_calib_addon import cli
from skin_calib_addon.calibration.exchange import WRITABLE
from tests.blender.conftest import BOARDS, CLEAR, LEFT, PINNED, ROOT
from tests.examples import slow

SAMPLES = ROOT / "sample_scenes"


@pytest.fixture
def run(tmp_path):
    """Return a function that runs this Python without the wheels of the extension: another SciPy rounds differently."""
    environment = os.environ | {"BLENDER_USER_RESOURCES": str(tmp_path / "resources")}

    def run(*words):
        command = [sys.executable, *map(str, words)]
        done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True)
        assert done.returncode == 0, done.stdout + done.stderr

    return run


@pytest.mark.parametrize("name", [slow("wrist"), slow("sole"), slow("edge")])
def test_sample_gives_the_same_bytes_with_every_interface(bpy, addon, run, tmp_path, name):
    """Operator, command in Blender, batch process and command line agree on each sample."""
    button, command, batch, plain = (tmp_path / f"{door}.json" for door in ("button", "command", "batch", "plain"))
    bpy.ops.wm.open_mainfile(filepath=str(SAMPLES / f"{name}.blend"))
    assert bpy.ops.skin_calib.fit() == {"FINISHED"}
    assert bpy.ops.skin_calib.export_calibration(filepath=str(button)) == {"FINISHED"}
    assert addon.command.main(["fit", "-o", str(command)]) == 0
    run("examples/batch_fit.py", SAMPLES / f"{name}.blend", "--", "-o", batch)
    run("-m", "skin_calib_addon", "fit", SAMPLES / f"{name}.plan.json", "-o", plain)
    assert button.read_bytes() == command.read_bytes() == batch.read_bytes() == plain.read_bytes()


@pytest.mark.slow
def test_all_kinds_of_skins_give_the_same_bytes_with_every_interface(bpy, addon, run, plan_file, fit_plainly, tmp_path):
    """This includes boards, excluded zones, left-handed sheets, offsets, trimming and landmarks."""
    button, command, batch = (tmp_path / f"{door}.json" for door in ("button", "command", "batch"))
    source = plan_file(skins=[BOARDS | {"cells": "all", "excluded": CLEAR}, LEFT, PINNED | {"name": "pinned"}])
    bpy.ops.skin_calib.import_plan(filepath=str(source))
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "arm.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "arm.blend"))
    assert bpy.ops.skin_calib.export_calibration(filepath=str(button)) == {"FINISHED"}
    assert addon.command.main(["fit", "-o", str(command)]) == 0
    run("examples/batch_fit.py", tmp_path / "arm.blend", "--", "-o", batch)
    assert button.read_bytes() == command.read_bytes() == batch.read_bytes() == fit_plainly(source)


def test_command_fits_every_link_of_the_scene(bpy, addon, plan_file, fit_plainly, tmp_path):
    """Two links of one scene give two files in a folder, equal to those of their plans."""
    plans = [plan_file("left"), plan_file("right", numbers_in="mm", degree=[2, 4])]
    for path in plans:
        bpy.ops.skin_calib.import_plan(filepath=str(path))
    out = tmp_path / "out"
    out.mkdir()
    assert addon.command.main(["fit", "-o", str(out)]) == 0
    assert sorted(p.name for p in out.iterdir()) == ["left.calibration.json", "right.calibration.json"]
    for path in plans:
        name = path.name.removesuffix(".plan.json")
        assert (out / f"{name}.calibration.json").read_bytes() == fit_plainly(path)


def test_plan_with_a_urdf_gives_the_same_bytes(bpy, addon, plan_file, fit_plainly, tmp_path):
    """The mesh is mirrored, rotated and moved in the URDF; an exported plan names the URDF again."""
    mesh = '<mesh filename="arm.stl" scale="1.1 -1 0.9"/>'
    visual = f'<visual><origin xyz="0.1 0.2 -0.3" rpy="0.3 -0.4 0.5"/><geometry>{mesh}</geometry></visual>'
    (tmp_path / "bot.urdf").write_text(f'<robot name="bot"><link name="arm">{visual}</link></robot>')
    turn = Rotation.from_euler("xyz", (0.3, -0.4, 0.5)).as_matrix()
    axis = {"point": (0.1, 0.2, -0.3), "direction": turn[:, 2].round(5).tolist()}
    path = plan_file(mesh="bot.urdf", grid={"kind": "tube", "n": 6, "lines": 12, "axis": axis}, skins=[])
    bpy.ops.skin_calib.import_plan(filepath=str(path))
    out, again = tmp_path / "out.json", tmp_path / "again.plan.json"
    assert bpy.ops.skin_calib.export_calibration(filepath=str(out)) == {"FINISHED"}
    assert out.read_bytes() == fit_plainly(path)
    assert bpy.ops.skin_calib.export_plan(filepath=str(again)) == {"FINISHED"}
    assert '"mesh": "bot.urdf"' in again.read_text() and not list(tmp_path.glob("*.ply"))


def test_taxels_for_other_programs_are_those_of_the_command_line(bpy, tmp_path):
    """They have the bytes of ``skin-calib export``; a format that cannot contain the skin states why."""
    bpy.ops.wm.open_mainfile(filepath=str(SAMPLES / "wrist.blend"))
    calibration = tmp_path / "wrist.json"
    bpy.ops.skin_calib.export_calibration(filepath=str(calibration))
    formats = bpy.ops.skin_calib.export_taxels.get_rna_type().properties["format"].enum_items.keys()
    assert set(formats) == set(WRITABLE)
    for name in ("mjcf", "ply"):
        button, plain = tmp_path / "button", tmp_path / "plain"
        assert bpy.ops.skin_calib.export_taxels(filepath=str(button), format=name) == {"FINISHED"}
        assert cli.main(["export", str(calibration), "--to", name, "-o", str(plain)]) == 0
        assert button.read_bytes() == plain.read_bytes(), name
    with pytest.raises(RuntimeError, match='patch "wrist" is not flat'):
        bpy.ops.skin_calib.export_taxels(filepath=str(tmp_path / "none.rsdf"), format="rsdf")
    assert not (tmp_path / "none.rsdf").exists()


def test_sources_of_the_link_are_not_replaced(bpy, link, tmp_path):
    """A point cloud of taxels can have the name of the mesh; earlier results are replaced."""
    taxels = tmp_path / "pair.csv"
    taxels.write_text("x,y,z\n0.04,0.01,0.06\n0.04,0.02,0.06\n")
    assert bpy.ops.skin_calib.skin_import(filepath=str(taxels)) == {"FINISHED"}
    bpy.ops.skin_calib.export_plan(filepath=str(tmp_path / "new.plan.json"))
    for path in (tmp_path / link.skin_calib.mesh_file, taxels):
        before = path.read_bytes()
        with pytest.raises(RuntimeError, match="is a mesh, a robot, or a file of this link. Choose another name"):
            bpy.ops.skin_calib.export_taxels(filepath=str(path), format="ply")
        assert path.read_bytes() == before
    for _ in range(2):
        assert bpy.ops.skin_calib.export_taxels(filepath=str(tmp_path / "out.ply"), format="ply") == {"FINISHED"}


def test_urdf_is_not_replaced(bpy, plan_file, tmp_path):
    """The robot of the link, also if it has become invalid, or another robot; frames of an earlier export are."""
    plan_file()
    visual = '<visual><origin xyz="0 0 0.01"/><geometry><mesh filename="arm.stl"/></geometry></visual>'
    text = f'<robot name="bot"><link name="arm">{visual}</link></robot>'
    own, other = tmp_path / "bot.urdf", tmp_path / "other.urdf"
    own.write_text(text)
    bpy.ops.skin_calib.import_urdf(filepath=str(own), link="arm")
    bpy.ops.skin_calib.skin_add(kind="sheet")
    for path, content in ((own, text), (other, text), (own, text.replace("</robot>", ""))):
        path.write_text(content)
        with pytest.raises(RuntimeError, match="is a mesh, a robot, or a file of this link. Choose another name"):
            bpy.ops.skin_calib.export_taxels(filepath=str(path), format="urdf")
        assert path.read_text() == content
    for _ in range(2):
        assert bpy.ops.skin_calib.export_taxels(filepath=str(tmp_path / "out.urdf"), format="urdf") == {"FINISHED"}


def test_link_of_the_file_browser_is_written(bpy, link, tmp_path):
    """Another link can be active when the file is chosen; the one of the browser can be renamed."""
    copy, path, files = link.copy(), tmp_path / "out.csv", []
    copy.skin_calib.link = "other"
    bpy.context.scene.collection.objects.link(copy)
    bpy.context.view_layer.objects.active = copy
    for subject in (link.name, copy.name, ""):
        assert bpy.ops.skin_calib.export_calibration(filepath=str(path), subject=subject) == {"FINISHED"}
        files.append(path.read_text())
    assert files[0] != files[1] == files[2] and bpy.context.object == copy
    with pytest.raises(RuntimeError, match="Error: missing was removed or renamed in the meantime. Start again"):
        bpy.ops.skin_calib.export_calibration(filepath=str(path), subject="missing")


def test_export_counts_the_warnings_and_says_that_there_is_no_taxel(bpy, link, tmp_path, capfd):
    """A link without skins, and one whose name another object has, are exported with a warning for each.

    Those of the fit are one line, however many: they are in the file, and in the list of the tab after a fit.
    """
    copy = link.copy()
    bpy.context.scene.collection.objects.link(copy)
    skins = link.skin_calib.skins
    assert skins[0].name == "band"
    skins.clear()
    bpy.ops.skin_calib.export_calibration(filepath=str(tmp_path / "bare.json"))
    said = capfd.readouterr().out
    assert "Warning: The file has no taxels." in said
    assert f"Warning: {copy.name} has the link name of {link.name}, too." in said
    copy.skin_calib.link = "other"
    bpy.ops.skin_calib.skin_add(kind="sheet")
    skins[0].rows, skins[0].columns, skins[0].trim, skins[0].overlap = 2, 40, True, True
    bpy.ops.skin_calib.export_calibration(filepath=str(tmp_path / "around.json"))
    said = capfd.readouterr().out
    assert "no taxels" not in said and "link name" not in said
    codes = [warning["code"] for warning in json.loads((tmp_path / "around.json").read_text())["warnings"]]
    assert codes == ["overlap"] and "Warning: 1 warning of the fit. Press Fit: the tab Skin then lists them." in said
    bpy.ops.skin_calib.fit()
    assert [warning.code for warning in link.skin_calib.result.warnings] == codes
