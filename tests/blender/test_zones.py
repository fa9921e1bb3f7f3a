"""Zones of a robot in the window: shown at the import, added, written for all proposals."""

import json

import numpy as np
import pytest

from tests.blender.conftest import modules

FILE = [
    {"link": "lower", "name": "screw", "kind": "sphere", "center": [0.02, 0.01, 0.1], "radius": 0.0123},
    {"link": "hand", "name": "vent", "kind": "box", "low": [-0.04, -0.02, 0.05], "high": [0.01, 0.02, 0.06]},
    {"link": "hand", "name": "end", "kind": "half-space", "point": [0, 0, 0.09], "normal": [0.1, 0.2, 2]},
]


@pytest.fixture
def zones_file(urdf):
    """Return the file of the zones of the robot, which it has before the import."""
    path = urdf.with_name("bot.zones.json")
    path.write_text(json.dumps({"format": "skin-zones", "version": 1, "zones": FILE}))
    return path


@pytest.fixture(params=[1.0, 0.001])
def robot(request, bpy, urdf, zones_file):
    """Import the robot, in scenes of two units; its lower link is active."""
    bpy.context.scene.unit_settings.scale_length = request.param
    assert bpy.ops.skin_calib.import_robot(filepath=str(urdf)) == {"FINISHED"}
    bpy.context.view_layer.update()
    bpy.context.view_layer.objects.active = bpy.data.objects["lower"]
    return request.param


def zones(path):
    """Return the zones of a file by their names, without them."""
    return {zone.pop("name"): zone for zone in json.loads(path.read_text())["zones"]}


def test_zones_of_the_file_are_shown_and_written_as_they_were(bpy, extension, robot, zones_file, urdf):
    """To a micrometre; an empty is in the frame of its link."""
    before = zones(zones_file)
    screw = bpy.data.objects["screw"]
    assert screw.parent.name == "lower_frame" and screw.empty_display_type == "SPHERE"
    np.testing.assert_allclose(np.array(screw.matrix_basis.translation) * robot, (0.02, 0.01, 0.1), atol=2e-8)
    robots = modules(extension, "scene.robots").robots
    assert robots.unsaved_zones(bpy.data.objects["lower"], bpy.context.scene) is None
    assert bpy.ops.skin_calib.zones_save() == {"FINISHED"}
    after = zones(zones_file)
    assert after.keys() == before.keys() and len(after) == 3
    for name, zone in before.items():
        for member, value in zone.items():
            if isinstance(value, str):
                assert after[name][member] == value
            else:
                value = value if member != "normal" else np.array(value) / np.linalg.norm(value)
                np.testing.assert_allclose(after[name][member], value, atol=1e-6)


def test_zone_is_added_saved_undone(bpy, robot, zones_file, capfd):
    """At the 3D cursor, or around the other selected objects; Propose waits until the file has what the scene shows."""
    lower, metre = bpy.data.objects["lower"], robot
    bpy.context.scene.cursor.location = lower.matrix_world @ lower.data.vertices[0].co
    bpy.ops.ed.undo_push(message="start")
    assert bpy.ops.skin_calib.keep_free("EXEC_DEFAULT", True) == {"FINISHED"}
    with pytest.raises(RuntimeError, match="Press Save Zones first"):
        bpy.ops.skin_calib.propose()
    assert bpy.ops.skin_calib.zones_save() == {"FINISHED"}
    found = zones(zones_file)
    assert (
        len(found) == 4
        and found["screw"]["center"] == [0.02, 0.01, 0.1]
        and found["lower_zone"]["kind"] == "sphere"
        and found["lower_zone"]["radius"] == 0.015
    )
    start = np.array(bpy.data.objects["lower_frame"].matrix_world.inverted() @ bpy.context.scene.cursor.location)
    np.testing.assert_allclose(found["lower_zone"]["center"], start * metre, atol=2e-6)
    bpy.ops.ed.undo()
    assert "lower_zone" not in bpy.data.objects
    bpy.context.view_layer.objects.active = bpy.data.objects["lower"]
    assert bpy.ops.skin_calib.zones_save() == {"FINISHED"}
    assert "Removed: lower_zone of lower" in capfd.readouterr().out and len(zones(zones_file)) == 3


def test_object_becomes_a_box_in_the_link_frame(bpy, robot, zones_file):
    """The box around its box, seen from the link."""
    lower = bpy.data.objects["lower"]
    bpy.ops.mesh.primitive_cube_add(size=0.02 / robot)
    plug = bpy.context.object
    plug.name = "plug"
    plug.matrix_world = lower.parent.matrix_world.copy()
    bpy.context.view_layer.update()
    lower.select_set(True)
    bpy.context.view_layer.objects.active = lower
    assert bpy.ops.skin_calib.keep_free() == {"FINISHED"} and bpy.ops.skin_calib.zones_save() == {"FINISHED"}
    box = zones(zones_file)["plug_zone"]
    np.testing.assert_allclose([box["low"], box["high"]], [[-0.01] * 3, [0.01] * 3], atol=2e-6)


@pytest.mark.parametrize("change", ["scale", "rotation", "shape"])
def test_empty_that_is_no_zone_is_refused(bpy, robot, zones_file, change):
    """With its name; the file stays."""
    screw, vent = bpy.data.objects["screw"], bpy.data.objects["vent"]
    before, words = zones_file.read_bytes(), {"scale": "screw differ", "rotation": "vent is rotated"}
    if change == "scale":
        screw.scale.x *= 1.1
    elif change == "rotation":
        vent.rotation_euler.x = 0.1
    else:
        screw.empty_display_type = "CIRCLE"
    bpy.context.view_layer.update()
    with pytest.raises(RuntimeError, match=words.get(change, "screw is no sphere")):
        bpy.ops.skin_calib.zones_save()
    assert zones_file.read_bytes() == before
    vent.rotation_euler.x = np.pi / 2  # is another box
    screw.scale, screw.empty_display_type = (0.01 / robot,) * 3, "SPHERE"
    bpy.context.view_layer.update()
    assert bpy.ops.skin_calib.zones_save() == {"FINISHED"}
    np.testing.assert_allclose(zones(zones_file)["vent"]["high"], (0.01, 0.005, 0.075), atol=2e-6)


def test_scene_that_does_not_show_the_zones_writes_none(bpy, robot, zones_file):
    """As one of an earlier version: the robot has to be imported again."""
    bpy.data.objects["lower"].skin_calib.zones_shown = False
    with pytest.raises(RuntimeError, match="Import the robot again"):
        bpy.ops.skin_calib.zones_save()
