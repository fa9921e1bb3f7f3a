"""The plan lives in the .blend: it goes in and out whole, and survives what Blender does to files and steps."""

import json

import pytest

from tests.blender.conftest import PLAN

TUBE = PLAN["grid"]
CUT = {"point": [0.0, 0.0, 0.0331], "normal": [0.0, 0.125, 1.0]}
AXIS = {"point": [0.001, 0.0125, 0.0], "direction": [0.01, 0.0, 1.0]}
ACROSS = [{"point": [0, 0, z], "normal": [0, 0, 1]} for z in (0.03, 0.05, 0.07, 0.09)]
ALONG = [{"point": [0, 0.01, 0], "normal": n} for n in ([1, 0, 0], [1, 1, 0], [0, 1, 0], [-1, 1, 0])]
SLANTED = [PLAN["skins"][0] | {"direction": [0.5, 0.25, 0.125]}]
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
    "cut": {"cover": {"shell": "all", "cuts": [CUT]}, "chords": True, "degree": [2, 4]},
    "response": {"response": {"kind": "polynomial", "coefficients": [0.0, 0.02, 5e-05]}, "x_by": {"who": "前腕"}},
    "origin": {"skins": [PLAN["skins"][0] | {"origin": [0.03, 0.02, 0.05], "first_channel": 7}]},
}


@pytest.mark.parametrize("unit_scale", [1.0, 0.001])
@pytest.mark.parametrize("numbers_in", ["m", "mm"])
@pytest.mark.parametrize("change", CHANGES)
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
    """Beside its own mesh file, a plan refers to that one and writes none."""
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


def test_typed_number_is_the_decimal_typed(bpy, addon, link):
    """4.9 in a scene of millimetres is 0.0049 in the plan: neither single precision nor the product shows."""
    bpy.context.scene.unit_settings.scale_length = 0.001
    link.skin_calib.grid.margin = 4.9
    link.skin_calib.skins[0].pitch = (8.1, 12.3)
    document = addon.scene.plan_document(link, bpy.context.scene)
    assert document["grid"]["margin"] == 0.0049 and document["skins"][0]["pitch"] == [0.0081, 0.0123]


def test_rounded_number_is_told(bpy, plan_file, capfd):
    """Blender keeps seven digits; a plan with more is imported with a warning."""
    bpy.ops.skin_calib.import_plan(filepath=str(plan_file()))
    assert "seven digits" not in capfd.readouterr().out
    bpy.ops.skin_calib.import_plan(filepath=str(plan_file(grid=TUBE | {"margin": 0.0040000001234})))
    assert "seven digits" in capfd.readouterr().out


def test_plan_survives_save_and_reload(bpy, addon, plan_file, fit_scene, tmp_path):
    """The .blend is the plan: what was opened again gives what was saved."""
    bpy.ops.skin_calib.import_plan(filepath=str(plan_file(**CHANGES["cut"] | CHANGES["response"])))
    before = addon.scene.plan_document(bpy.context.object, bpy.context.scene), fit_scene()
    bpy.ops.skin_calib.fit()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "saved.blend"))
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "saved.blend"))
    assert (addon.scene.plan_document(bpy.context.object, bpy.context.scene), fit_scene()) == before
    assert bpy.context.object.skin_calib.result.taxels == 6


def test_reloaded_result_is_never_another_links(bpy, addon, link, tmp_path):
    """A fit kept from before a file was opened belongs to its own plan and mesh alone."""
    bpy.ops.skin_calib.fit()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "saved.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "saved.blend"))
    link = bpy.context.object
    kept = addon.results.find(link.skin_calib.result.key)
    addon.results.clear()
    assert addon.results.find(link.skin_calib.result.key) is None
    bpy.ops.skin_calib.fit()
    fresh = addon.results.find(link.skin_calib.result.key)
    assert fresh is not kept and (fresh.fit.surface.control_net == kept.fit.surface.control_net).all()


def test_steps_are_undone_and_redone_one_by_one(bpy, addon, link):
    """Each operator is one step; undo and redo carry plan, result and overlay along."""

    def state():
        plan = bpy.context.scene.objects["arm"].skin_calib
        drawn = bool(addon.overlay._prepared.get(plan.result.key))
        return len(plan.skins), len(plan.cover.cuts), plan.result.taxels, plan.result.outdated, drawn

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
    assert states == [
        (1, 0, 0, True, False),
        (1, 0, 6, False, True),
        (2, 0, 6, True, True),
        (2, 1, 6, True, True),
        (1, 1, 6, True, True),
        (1, 0, 6, True, True),
    ]
    for expected in states[-2::-1]:
        bpy.ops.ed.undo()
        assert state() == expected
    for expected in states[1:]:
        bpy.ops.ed.redo()
        assert state() == expected


def test_export_is_of_the_plan_as_it_is_now(bpy, link, fit_scene, tmp_path):
    """A plan changed after the fit is told to be outdated, and the file is that of the changed one."""
    bpy.ops.skin_calib.fit()
    assert not link.skin_calib.result.outdated
    link.skin_calib.grid.n = 6
    assert link.skin_calib.result.outdated
    bpy.ops.skin_calib.export_calibration(filepath=str(tmp_path / "out.json"))
    assert (tmp_path / "out.json").read_bytes() == fit_scene()
    assert len(json.loads((tmp_path / "out.json").read_text())["surfaces"][0]["control_net"]) == 6


def test_added_sheet_follows_the_others(bpy, link):
    """Its name is new, its channels come after theirs, its cells are 10 mm wide in any unit."""
    bpy.context.scene.unit_settings.scale_length = 0.001
    bpy.ops.skin_calib.skin_add()
    bpy.ops.skin_calib.skin_add()
    skins = link.skin_calib.skins
    assert [s.name for s in skins] == ["band", "skin", "skin_2"]
    assert [s.first_channel for s in skins] == [0, 6, 138]
    assert list(skins[1].pitch) == [10.0, 10.0]
