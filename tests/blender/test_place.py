"""Points of a skin are placed on the link: typed, at the 3D cursor, or at the intersection of a ray from the eye."""

import importlib

import numpy as np
import pytest
from numpy.testing import assert_allclose

from tests.blender.conftest import BOARDS, LISTED, ROOT
from tests.blender.test_link_frame import frame_for
from tests.blender.test_registration import draw

POINT = (0.0358, 0.0208, 0.0523)
TARGETS = [(0, "origin", 0), (1, "landmark", 0), (2, "zone", 1)]  # row of `points`, what it is, of which skin


def points(link):
    """Return origin, landmark and zone of the two skins of `with_skins`."""
    sheet, boards = link.skin_calib.skins
    places = (sheet.origin, sheet.landmarks[0].point, boards.excluded[0].point)
    return np.array([tuple(place) for place in places])


@pytest.fixture
def with_skins(bpy, link):
    """Return a link with a sheet with a landmark, and boards with an excluded zone."""
    bpy.ops.skin_calib.skin_add(kind="hexagons")
    bpy.ops.skin_calib.landmark_add(skin=0)
    bpy.ops.skin_calib.zone_add(skin=1)
    return link


@pytest.mark.parametrize("row, what, skin", TARGETS)
def test_given_point_is_put_there_and_nowhere_else(bpy, with_skins, row, what, skin):
    """The operator of the click uses the given point in the link frame, in one undo step."""
    bpy.ops.ed.undo_push(message="start")
    before = points(with_skins)
    assert bpy.ops.skin_calib.place("EXEC_DEFAULT", True, what=what, skin=skin, point=POINT) == {"FINISHED"}
    link = bpy.context.scene.objects["arm"]
    expected = before.copy()
    expected[row] = POINT
    assert_allclose(points(link), expected, atol=1e-7)
    assert link.skin_calib.skins[0].centred == (what != "origin") and link.skin_calib.result.outdated
    bpy.ops.ed.undo()
    assert_allclose(points(bpy.context.scene.objects["arm"]), before)
    assert bpy.context.scene.objects["arm"].skin_calib.skins[0].centred


@pytest.mark.parametrize("row, what, skin", TARGETS)
def test_cursor_is_taken_in_the_link_frame(bpy, with_skins, row, what, skin):
    """For any pose of the parent, the position of the cursor is stored in the link frame."""
    from mathutils import Vector

    frame = frame_for(bpy, with_skins, (2, 2, 2))
    bpy.context.scene.cursor.location = frame.matrix_world @ Vector(POINT) / 2 + frame.matrix_world.translation / 2
    bpy.ops.skin_calib.place_at_cursor(what=what, skin=skin)
    assert_allclose(points(with_skins)[row], POINT, atol=1e-6)


def test_ray_meets_the_mesh_that_one_sees(bpy, addon, link):
    """It finds the near side, with modifiers, scale and parent, in the frame of the plan's points."""
    from mathutils import Vector

    link.modifiers.new("thick", "SOLIDIFY").thickness = -0.002  # outwards
    link.scale = (1.0, 1.5, 0.5)
    frame_for(bpy, link)
    depsgraph = bpy.context.evaluated_depsgraph_get()
    seen = addon.link_meshes.read_mesh(link, bpy.context)
    middle = np.array((0.0, 0.015, 0.03))
    for direction in np.array(((1, 0, 0), (-0.6, 0.8, 0.1), (0, -1, 0.2))):
        eye = middle - 0.5 * direction / np.linalg.norm(direction)
        to_world = addon.link_meshes.link_frame(link)
        start, ahead = (to_world @ Vector(p) for p in (eye, eye + direction))
        point = np.array(addon.points_on_link.point_on(link, depsgraph, start, ahead - start))
        expected = first_crossing(seen, eye, direction)
        assert_allclose(point, expected, atol=1e-6)
    assert addon.points_on_link.point_on(link, depsgraph, start, start - ahead) is None


def first_crossing(mesh, eye, direction):
    """Return the first intersection of a ray and a mesh, over all triangles (Moeller and Trumbore)."""
    a, b, c = mesh.vertices[mesh.faces].transpose(1, 0, 2)
    across = np.cross(direction, c - a)
    scale = ((b - a) * across).sum(axis=1)
    u = ((eye - a) * across).sum(axis=1) / scale
    up = np.cross(eye - a, b - a)
    v, t = (up @ direction) / scale, ((c - a) * up).sum(axis=1) / scale
    met = (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0)
    return eye + t[met].min() * direction


def test_link_that_cannot_be_clicked_on_is_refused(bpy, addon, link):
    """Rays do not find edited or hidden objects; the message states what to do."""
    addon.points_on_link.check_seen(link)
    bpy.ops.object.mode_set(mode="EDIT")
    with pytest.raises(Exception, match="arm is in Edit Mode. Leave Edit Mode"):
        addon.points_on_link.check_seen(link)
    bpy.ops.object.mode_set(mode="OBJECT")
    link.hide_set(True)
    with pytest.raises(Exception, match="arm is hidden. Show it"):
        addon.points_on_link.check_seen(link)


@pytest.mark.slow
def test_lines_of_the_manual_work(bpy):
    """The lines in ``docs/reference/window.md`` place boards on the sample sole and keep one zone free."""
    bpy.ops.wm.open_mainfile(filepath=str(ROOT / "sample_scenes" / "sole.blend"))
    bpy.ops.skin_calib.skin_remove(index=0)
    _, example = (ROOT / "docs" / "reference" / "window.md").read_text().split("```python\n")
    exec(example.split("```")[0], {"bpy": bpy})
    plan = bpy.context.object.skin_calib
    assert [tuple(np.round(zone.point, 6)) for zone in plan.skins[0].excluded] == [(0.08, 0.015, -0.002)]
    assert plan.skins[0].kind == "hexagons" and 100 <= plan.result.taxels < 115


def test_origin_that_is_placed_holds_the_sheet(bpy, addon, link):
    """Cell (0, 0) of the calibration is at the placed origin, next to it on the surface."""
    bpy.ops.skin_calib.place(skin=0, point=POINT)
    bpy.ops.skin_calib.fit()
    result = addon.results.find(link.skin_calib.result.key)
    taxels = result.calibration.patches[0].taxels
    direction, normal = taxels.positions_link[0] - POINT, taxels.normals_link[0]
    assert np.linalg.norm(direction) < 0.001
    assert_allclose(direction - (direction @ normal) * normal, 0, atol=2e-7)


def test_what_can_be_moved_has_a_handle(addon, with_skins):
    """Landmarks replace the origin; taxels of a file have no handle."""
    handles = importlib.import_module(addon.plans.__name__.replace(".scene.plans", ".handles.skin_handles"))
    plan = with_skins.skin_calib
    sheet = [("direction", 0, 0), ("landmark", 0, 0)]
    assert handles.targets_of(plan) == [*sheet, ("origin", 1, 0), ("direction", 1, 0), ("zone", 1, 0)]
    plan.skins[1].kind = "imported"
    assert handles.targets_of(plan) == sheet
    plan.skins[0].landmarks.clear()
    assert handles.targets_of(plan) == [("origin", 0, 0), ("direction", 0, 0)]


def root_tangent(addon, link, skin):
    """Return the direction of the row at the origin of a skin, after a fit."""
    taxels = addon.results.find(link.skin_calib.result.key).calibration.patches[skin].taxels
    return taxels.tangents_link[np.abs(taxels.index).sum(axis=1).argmin()]


@pytest.mark.parametrize("metre", [1.0, 0.001])
def test_direction_is_one_angle_from_the_lines(bpy, addon, plan_file, metre):
    """Zero is Automatic Direction; a quarter turn is one of the skin, seen from outside; undo restores the vector."""
    bpy.context.scene.unit_settings.scale_length = metre
    boards = BOARDS | LISTED | {"cells": [[0, 0]], "offset": 0.0}
    bpy.ops.skin_calib.import_plan(filepath=str(plan_file(skins=[boards])))
    link = bpy.context.object
    skin = link.skin_calib.skins[0]
    assert "turn" not in draw(bpy, "skin") and "direction" in draw(bpy, "skin")
    skin.auto_direction = True
    bpy.ops.skin_calib.fit()
    lines = root_tangent(addon, link, 0)
    skin.auto_direction = False
    assert "turn" in draw(bpy, "skin") and "direction" not in draw(bpy, "skin")
    for angle in (0.0, np.pi / 2, -2.0):
        skin.turn = angle
        assert_allclose(skin.turn, angle, atol=1e-5)
        bpy.ops.skin_calib.fit()
        taxels = addon.results.find(link.skin_calib.result.key).calibration.patches[0].taxels
        left = np.cross(taxels.normals_link[0], lines)
        expected = np.cos(angle) * lines + np.sin(angle) * left
        assert_allclose(root_tangent(addon, link, 0), expected, atol=1e-3)
    bpy.ops.ed.undo_push(message="before")
    before = tuple(skin.direction)
    skin.turn = 1.0
    bpy.ops.ed.undo_push(message="turn")
    bpy.ops.ed.undo()
    assert tuple(bpy.context.object.skin_calib.skins[0].direction) == before


def test_direction_of_an_origin_off_the_surface_is_a_vector(bpy, link):
    """Without a tangent plane the panel has the three numbers, and the angle changes nothing."""
    bpy.ops.skin_calib.fit()
    skin = link.skin_calib.skins[0]
    assert "turn" in draw(bpy, "skin")
    skin.centred, skin.origin = False, (0.0, 0.0, 5.0)
    before = tuple(skin.direction)
    skin.turn = 1.0
    assert tuple(skin.direction) == before and "direction" in draw(bpy, "skin")
