"""Skins from taxel files in the scene: plan import and export, frame, and the file on the disk."""

import json
import os
import sys

import numpy as np
import pytest

from tests.blender.conftest import BAND, look, oval
from tests.blender.test_refusals import scene_state
from tests.examples import slow

TURN, SHIFT = [[0, -1, 0], [0.6, 0, -0.8], [0.8, 0, 0.6]], [0.25, -0.125, 0.5]
FRAME = {"rotation": TURN, "translation": SHIFT}
SKIN = {"name": "worn", "kind": "imported", "file": "taxels.csv"}


def write_taxels(path, frame=None):
    """Write a table of 40 taxels at vertices of the small link, in the frame whose inverse is ``frame``."""
    angle, height = np.meshgrid(2 * np.pi * np.arange(1, 16, 2) / 24, np.arange(2, 7) / 8)
    places = oval(angle.ravel(), height.ravel())
    if frame:
        places = (places - frame["translation"]) @ np.array(frame["rotation"])
    rows = [f"taxel_{k},{k},{x:.9f},{y:.9f},{z:.9f}" for k, (x, y, z) in enumerate(places)]
    path.write_text("\n".join(["id,channel,x,y,z", *rows]) + "\n")


@pytest.fixture
def worn(bpy, plan_file, tmp_path):
    """Return the small link with a skin of a file in its correct position."""
    write_taxels(tmp_path / "taxels.csv")
    bpy.ops.skin_calib.import_plan(filepath=str(plan_file(skins=[SKIN])))
    return bpy.context.object


KINDS = {
    "as it is": ({}, None),
    "every option": ({"frame": FRAME, "format": "gentact", "only": "taxel_[1-3]*", "first_channel": 7}, FRAME),
    "snapped": ({"snap": True}, None),
}


@pytest.mark.parametrize("unit_scale", [1.0, slow(0.001)])
@pytest.mark.parametrize("kind", [slow("as it is"), "every option", slow("snapped")])
def test_plan_in_and_out_gives_the_same_bytes(
    bpy, plan_file, fit_plainly, fit_scene, tmp_path, capfd, kind, unit_scale
):
    """A plan that is exported to another folder, also through a link, has the right relative path of the file."""
    options, frame = KINDS[kind]
    (tmp_path / "data").mkdir()
    write_taxels(tmp_path / "data" / "taxels.csv", frame)
    source = plan_file(skins=[SKIN | options | {"file": "data/taxels.csv"}, BAND])
    bpy.context.scene.unit_settings.scale_length = unit_scale
    bpy.ops.skin_calib.import_plan(filepath=str(source))
    assert "seven digits" not in capfd.readouterr().out
    assert fit_scene() == fit_plainly(source)
    (tmp_path / "deep" / "down").mkdir(parents=True)
    (tmp_path / "short").symlink_to(tmp_path / "deep" / "down")
    exported = tmp_path / "short" / "mine.plan.json"
    assert bpy.ops.skin_calib.export_plan(filepath=str(exported)) == {"FINISHED"}
    assert fit_plainly(exported) == fit_scene()
    document = json.loads(exported.read_text())["skins"][0]
    assert document == SKIN | {"first_channel": 0} | options | {"file": "../../data/taxels.csv"}


def test_taxels_are_added_by_their_file(bpy, addon, link, tmp_path, capfd, document):
    """The skin has the name of the file and is the last one; an invalid file adds nothing; undo removes the skin."""
    write_taxels(tmp_path / "thigh.csv")
    (tmp_path / "none.csv").write_text("nothing")
    before = scene_state(bpy, addon)
    for path, options in (("none.csv", {}), ("lost.csv", {}), ("thigh.csv", {"format": "tum"})):
        with pytest.raises(RuntimeError, match=f"Error: .*{path}"):
            bpy.ops.skin_calib.skin_import(filepath=str(tmp_path / path), **options)
    with pytest.raises(RuntimeError, match="Error: .*leg_"):
        bpy.ops.skin_calib.skin_import(filepath=str(tmp_path / "thigh.csv"), only="leg_*")
    assert scene_state(bpy, addon) == before
    bpy.ops.ed.undo_push(message="start")
    for options in ({}, {"format": "csv", "only": "taxel_1*"}):
        arguments = {"filepath": str(tmp_path / "thigh.csv")} | options
        assert bpy.ops.skin_calib.skin_import("EXEC_DEFAULT", True, **arguments) == {"FINISHED"}
    output = capfd.readouterr().out
    assert "thigh.csv: 40 taxels" in output and "thigh.csv: 11 taxels" in output
    bpy.ops.skin_calib.fit()
    link = bpy.context.object
    skins = document(link)["skins"]
    assert [skin["name"] for skin in skins] == ["band", "thigh", "thigh_2"]
    assert skins[2].keys() - skins[1].keys() == {"format", "only"} and link.skin_calib.result.taxels == 6 + 40 + 11
    for left in (["band", "thigh"], ["band"]):
        bpy.ops.ed.undo()
        assert [skin.name for skin in bpy.context.object.skin_calib.skins] == left


@pytest.mark.parametrize("unit_scale, guesses", [(1.0, (False,)), slow(0.001, (False, True))])
def test_wrong_frame_is_refused_and_found_by_one_click(bpy, addon, plan_file, tmp_path, unit_scale, guesses):
    """This works from no frame and from a wrong one.

    The taxels then have their positions, and undo restores the frame.
    """
    bpy.context.scene.unit_settings.scale_length = unit_scale
    write_taxels(tmp_path / "taxels.csv")
    bpy.ops.skin_calib.import_plan(filepath=str(plan_file(skins=[SKIN])))
    bpy.ops.skin_calib.fit()
    right = taxels(addon)
    write_taxels(tmp_path / "taxels.csv", FRAME)
    for guess in guesses:
        skin = bpy.context.object.skin_calib.skins[0]
        skin.framed, skin.translation = guess, (0.1 / unit_scale, 0, 0)
        before = list(skin.rotation), list(skin.translation), guess
        bpy.ops.ed.undo_push(message="guess")
        with pytest.raises(
            RuntimeError, match="Error: skin 'worn', taxels.csv: is .* off the mesh .*; if that is right, press Find"
        ):
            bpy.ops.skin_calib.fit()
        assert bpy.ops.skin_calib.frame_find("EXEC_DEFAULT", True, skin=0) == {"FINISHED"}
        bpy.ops.skin_calib.fit()
        assert np.linalg.norm(taxels(addon) - right, axis=1).max() < 1e-5
        bpy.ops.ed.undo()
        skin = bpy.context.object.skin_calib.skins[0]
        assert (list(skin.rotation), list(skin.translation), skin.framed) == before
        bpy.ops.ed.redo()
        assert bpy.context.object.skin_calib.skins[0].framed
    state = scene_state(bpy, addon)
    with pytest.raises(RuntimeError, match="Error: worn is on the mesh already; its frame needs no change"):
        bpy.ops.skin_calib.frame_find(skin=0)
    assert scene_state(bpy, addon) == state


def taxels(addon):
    """Return the positions of the taxels of the fitted link [m]."""
    (patch,) = addon.drawing.patches_of(sys.modules["bpy"].context.object)
    return patch.taxels.positions_link


def test_changed_file_is_read_again(bpy, addon, worn, updates, tmp_path, state_of):
    """Fit and preview use the taxels of the new file."""
    bpy.ops.skin_calib.fit()
    assert len(taxels(addon)) == 40
    path = tmp_path / "taxels.csv"
    path.write_text("\n".join(path.read_text().splitlines()[:31]) + "\n")
    bpy.ops.skin_calib.fit()
    assert len(taxels(addon)) == 30
    worn.skin_calib.live = True
    for rows, n in ((26, 6), (21, 6)):
        path.write_text("\n".join(path.read_text().splitlines()[:rows]) + "\n")
        worn.skin_calib.grid.n = n
        worn.skin_calib.result.outdated = True
        look(updates)
        (cells,) = [layer for layer in state_of(worn).layers.shown({"CELLS"}) if layer.what == "CELLS"]
        assert len(cells.points) == (rows - 1) * 16 * 2


def test_findings_of_the_file_are_reported_and_stored(bpy, addon, worn, tmp_path, capfd):
    """They are stored with those of the placement, as warnings of the fit."""
    path = tmp_path / "taxels.csv"
    path.write_text(path.read_text() + "stray,40,0.02,0.01,0.15\n")
    capfd.readouterr()
    bpy.ops.skin_calib.fit()
    messages = " ".join(warning.message for warning in worn.skin_calib.result.warnings)
    assert "is the only taxel" in messages and "worn.stray" in messages and "worn.stray" in capfd.readouterr().out


def test_linked_library_finds_its_file(bpy, worn, fit_scene, tmp_path):
    """A relative path starts at the .blend file of the object, not at the one that uses it."""
    own = fit_scene()
    (tmp_path / "library").mkdir()
    os.rename(tmp_path / "taxels.csv", tmp_path / "library" / "taxels.csv")
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "library" / "library.blend"))
    worn.skin_calib.skins[0].file = "//taxels.csv"
    bpy.ops.wm.save_mainfile()
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    with bpy.data.libraries.load(str(tmp_path / "library" / "library.blend"), link=True) as (_, wanted):
        wanted.objects = ["arm"]
    bpy.context.scene.collection.objects.link(wanted.objects[0])
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "user.blend"))
    assert fit_scene() == own


@pytest.mark.parametrize("name", ["export_calibration", slow("export_taxels")])
def test_export_of_a_changed_taxel_file_warns_and_outdates_the_fit(bpy, worn, tmp_path, capfd, name):
    """The file has the taxels of now, and the status must not keep the tick and the number of the fit."""
    bpy.ops.skin_calib.fit()
    export, out = getattr(bpy.ops.skin_calib, name), tmp_path / "out.csv"
    assert export(filepath=str(out)) == {"FINISHED"}
    warning = "Warning: The link or a taxel file has changed since the fit."
    assert warning not in capfd.readouterr().out and not worn.skin_calib.result.outdated
    taxels = tmp_path / "taxels.csv"
    taxels.write_text("".join(taxels.read_text().splitlines(keepends=True)[:20]))
    assert export(filepath=str(out)) == {"FINISHED"}
    assert warning in capfd.readouterr().out and worn.skin_calib.result.outdated
    bpy.ops.skin_calib.fit()
    taxels.unlink()
    with pytest.raises(RuntimeError):
        export(filepath=str(out))
    assert worn.skin_calib.result.outdated
