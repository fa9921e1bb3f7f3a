"""The plan lives in the .blend: it goes in and out whole, and survives what Blender does to files and steps."""

import json

import numpy as np
import pytest
from numpy.testing import assert_allclose

from tests.blender.conftest import BOARDS, CLEAR, LEFT, LISTED, PINNED, PLAN
from tests.blender.test_link_frame import frame_for
from tests.examples import slow

TUBE = PLAN["grid"]
CUT = {"point": [0.0, 0.0, 0.0331], "normal": [0.0, 0.125, 1.0]}
AXIS = {"point": [0.001, 0.0125, 0.0], "direction": [0.01, 0.0, 1.0]}
ACROSS = [{"point": [0, 0, z], "normal": [0, 0, 1]} for z in (0.03, 0.05, 0.07, 0.09)]
ALONG = [{"point": [0, 0.01, 0], "normal": n} for n in ([1, 0, 0], [1, 1, 0], [0, 1, 0], [-1, 1, 0])]
BAND = PLAN["skins"][0]
SLANTED = [BAND | {"direction": [0.5, 0.25, 0.125]}]
MODALITIES = [
    {
        "name": "proximity",
        "unit": "m",
        "response": {"kind": "table", "readings": [0, 4000.5], "forces": [0.2000000001, 0]},
        "channels": {"band.0.1": 4},
    },
    {"name": "temperature", "unit": "degC", "response": {"kind": "polynomial", "coefficients": [-40.0, 0.05]}},
]
SCAN = {"standard_deviation": 0.0003, "correlation_length": 0.008}
CHANGES = {
    "as it is": {},
    "paper's m": {"grid": {"kind": "tube", "n": 5, "m": 6, "axis": AXIS}},
    "spacing": {"grid": TUBE | {"spacing": "auto", "lines": 16}},
    "auto": {"grid": {"kind": "auto", "tolerance": 0.0005, "measure": "max", "margin": 0.004}},
    "auto across": {"grid": {"kind": "auto", "tolerance": 0.001, "normal": [0, -1, 0], "margin": 0.02}, "skins": []},
    "sector": {
        "grid": {"kind": "patch", "n": 5, "lines": 9, "axis": AXIS, "from": 0.25, "to": 2.875},
        "skins": SLANTED,
    },
    "across": {"grid": {"kind": "patch", "n": 6, "lines": 5, "normal": [0, -1, 0], "margin": 0.02}, "skins": []},
    "planes": {"grid": {"kind": "planes", "u": ACROSS, "v": ALONG, "closed": True}, "skins": SLANTED},
    "cut": {"cover": {"shell": "all", "cuts": [CUT]}, "chords": True, "degree": [2, 4], "mesh_uncertainty": SCAN},
    "response": {"response": {"kind": "polynomial", "coefficients": [0.0, 0.02, 5e-05]}, "x_by": {"who": "前腕"}},
    "table": {"response": {"kind": "table", "readings": [0, 100.5, 250], "forces": [0, 1.0000000001, 16]}},
    "range": {"response": {"kind": "polynomial", "coefficients": [0.0, 0.0200000001], "range": [0, 250]}},
    "modalities": {"modalities": MODALITIES},
    "origin": {"skins": [BAND | {"origin": [0.035, 0.0233, 0.05], "first_channel": 7}]},
    "left hand, offset, trim": {"skins": [LEFT]},
    "landmarks": {"skins": [PINNED]},
    "all boards": {"skins": [BAND | {"first_channel": 90}, BOARDS | {"cells": "all", "excluded": CLEAR}]},
    "listed boards": {"skins": [BOARDS | LISTED | {"first_channel": 5}, LEFT]},
    "standard boards": {"skins": [BAND, {"name": "boards", "kind": "hexagons", "cells": [[0, 0], [-1, 1]]}]},
}


UNITS = [("m", 1.0), ("mm", 1.0), ("m", 0.001), ("mm", 0.001)]  # of the plan, and of the scene [m]
QUICK = {"planes", "cut"}  # in the quick tests


@pytest.mark.parametrize(
    ("change", "numbers_in", "unit_scale"),
    [
        (change, *units) if i % len(UNITS) == k and change in QUICK else slow(change, *units)
        for i, change in enumerate(CHANGES)
        for k, units in enumerate(UNITS)
    ],
)
def test_plan_in_and_out_gives_the_same_bytes(
    bpy, plan_file, fit_plainly, fit_scene, tmp_path, change, numbers_in, unit_scale
):
    """Plan file, scene with it, and plan exported from there: one calibration, whatever units Blender works in."""
    source = plan_file(numbers_in=numbers_in, **CHANGES[change])
    bpy.context.scene.unit_settings.scale_length = unit_scale
    bpy.ops.skin_calib.import_plan(filepath=str(source))
    assert fit_scene() == fit_plainly(source)
    folder = tmp_path / "elsewhere"
    folder.mkdir()
    exported = folder / "mine.plan.json"
    assert bpy.ops.skin_calib.export_plan(filepath=str(exported)) == {"FINISHED"}
    assert fit_scene() == fit_plainly(exported)
    assert sorted(p.name for p in folder.iterdir()) == ["mine.plan.json", "mine.ply"]


def test_export_names_the_mesh_that_lies_there(bpy, link, fit_scene, fit_plainly, tmp_path):
    """Next to its own mesh file, a plan refers to that file and does not write another."""
    before = sorted(tmp_path.iterdir())
    bpy.ops.skin_calib.export_plan(filepath=str(tmp_path / "new.plan.json"))
    assert sorted(set(tmp_path.iterdir()) - set(before)) == [tmp_path / "new.plan.json"]
    assert json.loads((tmp_path / "new.plan.json").read_text())["mesh"] == "arm.stl"
    assert fit_scene() == fit_plainly(tmp_path / "new.plan.json")


def test_export_overwrites_no_other_mesh(bpy, link, fit_scene, fit_plainly, tmp_path):
    """A mesh edited in Blender goes into a file of its own; those that other plans name stay as they are."""
    (tmp_path / "new.ply").write_bytes(b"another one's")
    source = (tmp_path / "arm.stl").read_bytes()
    link.data.vertices[40].co.x += 0.0005
    bpy.ops.skin_calib.export_plan(filepath=str(tmp_path / "new.plan.json"))
    assert (tmp_path / "arm.stl").read_bytes() == source and (tmp_path / "new.ply").read_bytes() == b"another one's"
    assert link.skin_calib.mesh_file == "new_2.ply"
    assert fit_scene() == fit_plainly(tmp_path / "new.plan.json")


def test_rounded_number_is_reported(bpy, plan_file, capfd):
    """Blender keeps seven digits; a plan with more is imported with a warning."""
    bpy.ops.skin_calib.import_plan(filepath=str(plan_file()))
    assert "seven digits" not in capfd.readouterr().out
    bpy.ops.skin_calib.import_plan(filepath=str(plan_file(grid=TUBE | {"margin": 0.0040000001234})))
    assert "seven digits" in capfd.readouterr().out


def test_plan_survives_save_and_reload(bpy, plan_file, fit_scene, tmp_path, document):
    """The .blend is the plan: what was opened again gives what was saved."""
    bpy.ops.skin_calib.import_plan(filepath=str(plan_file(**CHANGES["cut"] | CHANGES["response"])))
    before = document(bpy.context.object), fit_scene()
    bpy.ops.skin_calib.fit()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "saved.blend"))
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "saved.blend"))
    assert (document(bpy.context.object), fit_scene()) == before
    assert bpy.context.object.skin_calib.result.taxels == 6


def test_steps_are_undone_and_redone_one_by_one(bpy, addon, link):
    """Each operator is one step; undo and redo carry plan, result and overlay along."""

    def state():
        plan = bpy.context.scene.objects["arm"].skin_calib
        drawn = addon.drawing.layers_now(bpy.context.scene.objects["arm"]) is not None
        points = [len(entries) for s in plan.skins for entries in (s.landmarks, s.excluded)]
        return len(plan.skins), len(plan.cover.cuts), sum(points), plan.result.taxels, plan.result.outdated, drawn

    def step(operator, **arguments):
        assert operator("EXEC_DEFAULT", True, **arguments) == {"FINISHED"}
        states.append(state())

    bpy.ops.ed.undo_push(message="start")
    states = [state()]
    step(bpy.ops.skin_calib.fit)
    step(bpy.ops.skin_calib.skin_add)
    step(bpy.ops.skin_calib.cut_add)
    step(bpy.ops.skin_calib.skin_remove, index=0)
    step(bpy.ops.skin_calib.cut_remove, index=0)
    step(bpy.ops.skin_calib.landmark_add, skin=0)
    step(bpy.ops.skin_calib.landmark_remove, skin=0, index=0)
    step(bpy.ops.skin_calib.skin_add, kind="hexagons")
    step(bpy.ops.skin_calib.zone_add, skin=1)
    step(bpy.ops.skin_calib.zone_remove, skin=1, index=0)
    assert all(before != after for before, after in zip(states, states[1:]))
    for expected in states[-2::-1]:
        bpy.ops.ed.undo()
        assert state() == expected
    for expected in states[1:]:
        bpy.ops.ed.redo()
        assert state() == expected


def test_what_is_removed_outdates_the_result(bpy, link):
    """No property changes where an entry goes, yet the plan is no longer the one that was fitted."""
    plan = link.skin_calib
    bpy.ops.skin_calib.skin_add(kind="hexagons")
    bpy.ops.skin_calib.landmark_add(skin=0)
    bpy.ops.skin_calib.zone_add(skin=1)
    bpy.ops.skin_calib.cut_add()
    for operator, entry in (
        ("landmark_remove", {"skin": 0}),
        ("zone_remove", {"skin": 1}),
        ("cut_remove", {}),
        ("skin_remove", {"index": 1}),
    ):
        plan.result.outdated = False
        getattr(bpy.ops.skin_calib, operator)(**entry)
        assert plan.result.outdated, operator


def test_export_is_of_the_plan_as_it_is_now(bpy, link, fit_scene, tmp_path):
    """A change of the plan outdates the fit, and the file is that of the changed plan."""
    bpy.ops.skin_calib.fit()
    assert not link.skin_calib.result.outdated
    link.skin_calib.grid.n = 6
    assert link.skin_calib.result.outdated
    bpy.ops.skin_calib.export_calibration(filepath=str(tmp_path / "out.json"))
    assert (tmp_path / "out.json").read_bytes() == fit_scene()
    assert len(json.loads((tmp_path / "out.json").read_text())["surfaces"][0]["control_net"]) == 6


def test_lengths_of_skins_are_the_decimals_typed(bpy, link, document):
    """In a scene of millimetres, 0.5 is 0.0005 in the plan, whatever the option."""
    bpy.context.scene.unit_settings.scale_length = 0.001
    sheet = link.skin_calib.skins[0]
    bpy.ops.skin_calib.skin_add(kind="hexagons")
    boards = link.skin_calib.skins[1]
    bpy.context.scene.cursor.location = (40.1, 9.9, 60.3)
    bpy.ops.skin_calib.landmark_add(skin=0)
    bpy.ops.skin_calib.zone_add(skin=1)
    sheet.pitch = (8.5, 10)
    sheet.offset, boards.offset, boards.side, boards.auto_gap, boards.gap = 0.5, 0.7, 16.3, False, -0.48
    first, second = document(link)["skins"]
    point = [0.0401, 0.0099, 0.0603]
    assert first["offset"] == 0.0005 and first["landmarks"] == [{"cell": [0, 0], "point": point}]
    assert (second["offset"], second["side"], second["gap"]) == (0.0007, 0.0163, -0.00048)
    assert second["excluded"] == [{"point": point, "radius": 0.005}]


@pytest.mark.parametrize("text", ["0,0 1,0 -2,13", " 0, 0  1 ,0\t-2,13 "])
def test_cells_are_read_as_people_write_them(bpy, link, text, document):
    """Spaces do not matter; the panel knows at once whether a list can be read."""
    skin = link.skin_calib.skins[0]
    skin.kind, skin.choice = "hexagons", "listed"
    assert skin.cells_wrong
    skin.cells = text
    assert not skin.cells_wrong
    assert document(link)["skins"][0]["cells"] == [[0, 0], [1, 0], [-2, 13]]
    skin.cells = text + ";"
    assert skin.cells_wrong


def test_warnings_of_a_fit_are_reported_and_kept(bpy, addon, plan_file, capfd):
    """Boards that do not sit are warned of at the button, and stay listed with the result until the next fit."""
    narrow = [{"name": "boards", "kind": "hexagons", "cells": [[0, 0], [1, 0]], "origin": [0.04, 0.01, 0.06]}]
    bpy.ops.skin_calib.import_plan(filepath=str(plan_file(skins=narrow)))
    capfd.readouterr()
    bpy.ops.skin_calib.fit()
    result = bpy.context.object.skin_calib.result
    (warning,) = addon.results.find(result.key).warnings
    assert "off the surface" in warning.message and f"Warning: {warning}" in capfd.readouterr().out
    (kept,) = result.warnings
    assert (kept.code, kept.severity, kept.message, kept.advice) == (
        warning.code,
        "warning",
        warning.message,
        warning.advice,
    )
    assert kept.skin == "boards" and kept.has_point
    np.testing.assert_allclose(kept.point, warning.where.point, atol=1e-8)
    bpy.context.object.skin_calib.skins[0].side = 0.008
    bpy.ops.skin_calib.fit()
    assert bpy.context.object.skin_calib.result.warnings[:] == []


def test_added_sheet_runs_along_the_lines_of_the_fitted_surface(bpy, addon, link):
    """A new sheet lies on any link: the usual direction is perpendicular to a link that is widest along y."""
    link.rotation_euler[2] = np.deg2rad(200)
    link.skin_calib.skins.clear()
    bpy.ops.skin_calib.fit()
    bpy.ops.skin_calib.skin_add(kind="sheet")
    (skin,) = link.skin_calib.skins
    skin.rows, skin.columns = 2, 3
    bpy.ops.skin_calib.fit()
    (patch,) = addon.drawing.patches_of(link)
    row = patch.taxels.positions_link[2] - patch.taxels.positions_link[0]
    assert link.skin_calib.result.taxels == 6 and row @ np.array(skin.direction) > 0.95 * np.linalg.norm(row)
    assert abs(row[2]) < 0.1 * np.linalg.norm(row), "the rows are not around the link"


def test_added_skins_follow_the_others(bpy, addon, link):
    """Their names are new, their channels follow, their sizes are usual in any unit, those of boards as of Propose."""
    bpy.context.scene.unit_settings.scale_length = 0.001
    link.skin_calib.skins[0].pitch = (8.5, 10)
    bpy.ops.skin_calib.skin_add()
    bpy.ops.skin_calib.skin_add(kind="sheet")
    bpy.ops.skin_calib.skin_add(kind="hexagons")
    skins = link.skin_calib.skins
    assert [s.name for s in skins] == ["band", "skin", "skin_2", "skin_3"]
    plan = addon.plans.read_plan(link, bpy.context.scene)
    assert [s.first_channel for s in plan.skins] == [None] * 4
    assert [s.first_channel for s in addon.skins.with_channels(plan.skins)] == [0, 6, 126, 246]
    assert plan.skins[2].lattice.pitch == (0.01, 0.01)
    assert (plan.skins[3].lattice.side, plan.skins[3].lattice.gap) == (0.008, 0)
    assert list(skins[1].pitch) == [10.0, 10.0]
    bpy.context.scene.skin_calib.skin = "hexagons:12mm,gap=0.5mm,thickness=3mm"
    bpy.ops.skin_calib.skin_add(kind="hexagons")
    added = addon.plans.read_plan(link, bpy.context.scene).skins[4]
    assert (added.lattice.side, added.lattice.gap, added.offset) == (0.012, 0.0005, 0.0015)


def test_maximum_deviation_is_shown_by_the_cursor(bpy, addon, link):
    """In the world, whatever the pose of the link; the distance there is the reported maximum, that of a grid."""
    with pytest.raises(RuntimeError, match="Fit the link first"):
        bpy.ops.skin_calib.show_worst()
    bpy.ops.skin_calib.fit()
    frame_for(bpy, link)
    bpy.ops.skin_calib.show_worst()
    fit = addon.results.find(link.skin_calib.result.key).fit
    on_link = addon.points_on_link.cursor_on(link, bpy.context.scene)
    assert_allclose(on_link, fit.worst[1], atol=1e-6)
    result = link.skin_calib.result
    assert_allclose(result.max, fit.worst[2], rtol=1e-4)
    assert "at the points of a grid" in result.bl_rna.properties["max_mm"].description
    (mark,) = (layer for layer in addon.drawing.shown_layers(link) if layer.what == "MAXIMUM")
    assert_allclose(mark.points[:4].mean(axis=0), fit.worst[1], atol=1e-7)
    bpy.ops.skin_calib.show_worst()
    assert "MAXIMUM" not in {layer.what for layer in addon.drawing.shown_layers(link)}
