"""A result is that of its mesh: after undo, renaming and reopening, a changed mesh still outdates it."""

import json

import pytest

from tests.blender.conftest import look
from tests.blender.test_link_frame import codes


@pytest.fixture
def fitted(bpy, addon, link, monkeypatch):
    """Fit a link in a step of undo, and compare meshes without a delay."""
    monkeypatch.setattr(addon.diagnoses, "CHECK_DELAY", 0)
    bpy.ops.ed.undo_push(message="start")
    assert bpy.ops.skin_calib.fit("EXEC_DEFAULT", True) == {"FINISHED"}


def outdated(bpy, addon):
    """Return whether the result is outdated, after all changes were compared."""
    bpy.context.view_layer.update()
    addon.diagnoses.verify()
    return bpy.context.object.skin_calib.result.outdated


def test_mesh_that_cannot_be_compared_keeps_its_result(bpy, addon, fitted):
    """Modifiers of a disabled object are not evaluated; it is compared once it is shown."""
    bpy.context.object.modifiers.new("none", "DISPLACE").strength = 0
    bpy.ops.skin_calib.fit("EXEC_DEFAULT", True)
    bpy.context.object.hide_viewport = True
    bpy.ops.ed.undo_push(message="hidden")
    bpy.ops.ed.undo_push(message="again")
    bpy.ops.ed.undo()
    assert not outdated(bpy, addon)
    bpy.context.object.hide_viewport = False
    assert not outdated(bpy, addon)


def test_robot_is_not_exported_with_the_fit_of_another_mesh(bpy, fitted, tmp_path, capfd):
    """The export is refused, as after a change of the plan; Fit All then fits the link again."""
    bpy.context.object.name = "renamed"
    bpy.context.object.scale *= 1.3
    folder = tmp_path / "robot"
    with pytest.raises(RuntimeError, match="renamed: not fitted since the last change. Press Fit All first"):
        bpy.ops.skin_calib.export_robot(directory=str(folder))
    assert not folder.exists()
    assert bpy.ops.skin_calib.fit_all() == {"FINISHED"}
    assert "Info: Fitted 1 link" in capfd.readouterr().out
    assert bpy.ops.skin_calib.export_robot(directory=str(folder)) == {"FINISHED"}
    alone = tmp_path / "alone.json"
    assert bpy.ops.skin_calib.export_calibration(filepath=str(alone)) == {"FINISHED"}
    files = (alone, folder / "arm.calibration.json")
    one, other = (json.loads(path.read_text())["patches"] for path in files)
    assert one == other
    assert [codes(path.read_bytes()) for path in files] == [["scaled-object"]] * 2
    assert '"scaled-object"' in (folder / "arm.sources.json").read_text()


@pytest.mark.slow
def test_export_of_a_robot_warns_of_what_it_did_not_write(bpy, fitted, plan_file, tmp_path, capfd):
    """A refused link is named, and each calibration of an earlier export: of this link, and of one that was deleted."""
    for name in ("leg", "toe"):
        bpy.ops.skin_calib.import_plan(filepath=str(plan_file(name)))
        bpy.ops.skin_calib.fit()
    folder = tmp_path / "robot"
    bpy.ops.skin_calib.export_robot(directory=str(folder))
    assert "Warning" not in capfd.readouterr().out
    bpy.data.objects["leg"].skin_calib.skins[0].columns = 500
    bpy.data.objects.remove(bpy.data.objects["toe"])
    with pytest.raises(RuntimeError, match="beyond the edge"):
        bpy.ops.skin_calib.fit_all()
    assert bpy.ops.skin_calib.export_robot(directory=str(folder)) == {"FINISHED"}
    warnings = [line for line in capfd.readouterr().out.splitlines() if line.startswith("Warning")]
    assert [line.split(" ", 3)[1] for line in warnings] == ["leg", "leg.calibration.json", "toe.calibration.json"]
    assert "is not written, because its fit is refused" in warnings[0]
    assert "is from an earlier export, and stays in robot.json. Remove it" in warnings[1]
    bpy.ops.skin_calib.export_robot(directory=str(tmp_path / "new"))
    assert len([line for line in capfd.readouterr().out.splitlines() if line.startswith("Warning")]) == 1


def test_other_unit_of_the_scene_outdates_the_result(bpy, addon, fitted):
    """Mesh and plan have another size then."""
    assert not outdated(bpy, addon)
    bpy.context.scene.unit_settings.scale_length = 0.5
    assert outdated(bpy, addon)
    assert bpy.ops.skin_calib.fit() == {"FINISHED"} and not outdated(bpy, addon)


def animate(link):
    """Scale an object from frame 1 to 10."""
    for frame in (1, 10):
        link.scale.z = 1 + 0.02 * frame
        link.keyframe_insert("scale", frame=frame)


def test_animated_link_outdates_its_result(bpy, addon, fitted):
    """Another frame of a link that is scaled is another mesh."""
    animate(bpy.context.object)
    bpy.context.scene.frame_set(1)
    assert bpy.ops.skin_calib.fit() == {"FINISHED"} and not outdated(bpy, addon)
    bpy.context.scene.frame_set(5)
    assert outdated(bpy, addon)


def test_live_follows_an_animation(bpy, addon, updates, fitted, monkeypatch):
    """Each frame is drawn at once; without Live no mesh is read while frames are played."""
    monkeypatch.setattr(updates, "FIT_DELAY", 0.0)
    reads, real = [], updates.link_meshes.read_facets
    monkeypatch.setattr(updates.link_meshes, "read_facets", lambda *given: reads.append(1) or real(*given))
    link = bpy.context.object
    animate(link)
    bpy.context.scene.frame_set(1)
    for follow in (True, False):
        link.skin_calib.live = follow
        bpy.ops.skin_calib.fit()
        while updates.tick() is not None:
            pass
        key = link.skin_calib.result.key
        reads.clear()
        bpy.context.scene.frame_set(bpy.context.scene.frame_current + 4)
        while updates.tick() is not None:
            pass
        assert bool(reads) == follow and (link.skin_calib.result.key != key) == follow


def test_link_of_another_scene_is_read_there(bpy, addon, updates, plan_file, monkeypatch, state_of):
    """A timer has the scene of any window. In another one, the link has no modifiers and another unit."""
    other = bpy.data.scenes.new("other")
    other.unit_settings.scale_length = 0.001
    there = {"scene": other, "view_layer": other.view_layers[0]}
    with bpy.context.temp_override(**there):
        bpy.ops.skin_calib.import_plan(filepath=str(plan_file()))
        link = other.objects["arm"]
        link.modifiers.new("finer", "SUBSURF").subdivision_type = "SIMPLE"
        other.view_layers[0].update()
    with bpy.context.temp_override(**there, object=link):
        bpy.ops.skin_calib.fit()
    monkeypatch.setattr(addon.diagnoses, "CHECK_DELAY", 0.0)
    addon.diagnoses.touched(link)
    updates.touched(link)
    while updates.tick() is not None or addon.diagnoses.verify() is not None:
        pass
    assert link not in bpy.context.scene.objects[:] and not link.skin_calib.result.outdated
    link.skin_calib.live = True
    link.skin_calib.grid.n += 1
    look(updates)
    assert state_of(link).report.mean > 0
    while updates.tick() is not None:
        monkeypatch.setattr(updates, "FIT_DELAY", 0.0)
    assert not link.skin_calib.result.outdated and link.skin_calib.result.mean > 1e-3  # scene units, not metres
