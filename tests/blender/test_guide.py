"""What an import shows: the link alone, framed; files that are dropped; proposals for any mesh."""

import numpy as np
import pytest

from tests.blender.conftest import ROOT

WRIST = ROOT / "sample_scenes" / "wrist.ply"


@pytest.fixture
def cube(bpy):
    """Add the cube of Blender's start, in a scene in metres."""
    bpy.ops.mesh.primitive_cube_add(size=2)
    return bpy.context.object


def views(bpy):
    """Return the 3D views of the window, each with its main region."""
    areas = [area for area in bpy.context.window.screen.areas if area.type == "VIEW_3D"]
    return [(area, next(r for r in area.regions if r.type == "WINDOW")) for area in areas]


def is_seen(thing, space):
    return thing.visible_get(viewport=space)


def test_link_within_another_object_is_shown_alone(bpy, cube, capfd):
    """The cube of Blender's start contains the link: local view hides it, and the report names it."""
    assert bpy.ops.skin_calib.import_mesh(filepath=str(WRIST)) == {"FINISHED"}
    link = bpy.context.object
    assert link.name == "wrist" and bpy.context.selected_objects == [link]
    for area, _ in views(bpy):
        assert is_seen(link, area.spaces.active) and not is_seen(cube, area.spaces.active)
    assert "Local view hides Cube" in capfd.readouterr().out


@pytest.mark.parametrize("kind", ["PERSP", "ORTHO"])
def test_imported_link_is_in_the_free_part_of_the_view(bpy, cube, kind):
    """The view is centred on the link, and turned by nothing; its distance is that of a robot link, not of the cube."""
    for area, _ in views(bpy):
        area.spaces.active.region_3d.view_perspective = kind
    turned = [area.spaces.active.region_3d.view_rotation.copy() for area, _ in views(bpy)]
    bpy.ops.skin_calib.import_mesh(filepath=str(WRIST))
    link = bpy.context.object
    corners = np.array([link.matrix_world @ type(link.location)(corner) for corner in link.bound_box])
    for (area, _), rotation in zip(views(bpy), turned):
        view = area.spaces.active.region_3d
        assert np.linalg.norm(np.array(view.view_location) - corners.mean(axis=0)) < 0.2
        assert 0.05 < view.view_distance < 1.0 and view.view_rotation == rotation


@pytest.mark.parametrize("name, path", [("mesh", WRIST), ("plan", WRIST.with_name("wrist.plan.json"))])
def test_dropped_file_is_read_without_a_question(bpy, name, path):
    """Blender invokes the operator of the handler with the path; the file browser stays closed."""
    module, operator = getattr(bpy.types, f"SKIN_FH_{name}").bl_import_operator.split(".")
    assert getattr(getattr(bpy.ops, module), operator)("INVOKE_DEFAULT", filepath=str(path)) == {"FINISHED"}
    assert bpy.context.object.name in ("wrist", "sample_wrist")


@pytest.mark.slow
def test_any_link_gets_a_proposal_that_fits(bpy):
    """The mesh of the object is used, whatever its file is named; the state has the next step, and the fit succeeds."""
    bpy.ops.skin_calib.import_mesh(filepath=str(WRIST))
    link = bpy.context.object
    link.skin_calib.mesh_file = "robot.urdf"  # as after the import of a link of several meshes
    assert bpy.ops.skin_calib.propose() == {"FINISHED"}
    plan = link.skin_calib
    cells, free = (int(word) for word in plan.proposed_area.split() if word.isdigit())
    assert 0 < cells < free < 400
    assert plan.mesh_file == "robot.urdf" and plan.skins and plan.proposed > 0
    assert plan.result.mean < 5e-4 and plan.result.taxels == plan.proposed and not plan.result.outdated
    key = plan.result.key
    assert bpy.ops.skin_calib.fit() == {"FINISHED"} and plan.result.key == key
