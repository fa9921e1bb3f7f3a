"""The covered part of a link: planes across it, and faces that are removed without a change of the mesh."""

import json

import numpy as np
import pytest
from numpy.testing import assert_allclose

from tests.blender.test_refusals import scene_state

AWAY = slice(0, 96, 3)  # faces to cut away: a part of the wall


@pytest.fixture
def choose(bpy):
    """Select faces of the active object as an author does, in Edit Mode."""

    def choose(faces=AWAY):
        link = bpy.context.object
        bpy.context.tool_settings.mesh_select_mode = (False, False, True)
        bpy.ops.object.mode_set(mode="EDIT")
        bpy.ops.mesh.select_all(action="DESELECT")
        bpy.ops.object.mode_set(mode="OBJECT")
        chosen = np.zeros(len(link.data.polygons), bool)
        chosen[faces] = True
        link.data.polygons.foreach_set("select", chosen)
        bpy.ops.object.mode_set(mode="EDIT")
        return int(chosen.sum())

    return choose


@pytest.fixture
def left(bpy, addon):
    """Return a function that counts the remaining faces of an object."""

    def left(name="arm"):
        link = bpy.data.objects[name]
        bpy.context.view_layer.update()
        return len(addon.link_meshes.read_mesh(link, bpy.context).faces)

    return left


def geometry(link):
    """Return the data of the mesh itself."""
    return [v.co[:] for v in link.data.vertices], [tuple(p.vertices) for p in link.data.polygons]


ALL = 384


def test_selected_faces_are_left_out_and_come_back(bpy, link, choose, left):
    """The fit ignores them in both modes and the mesh keeps them; restoring them leaves no data of the extension."""
    before = geometry(link)
    removed_count = choose()
    assert bpy.ops.skin_calib.cut_away() == {"FINISHED"} and link.mode == "OBJECT"
    assert left() == ALL - removed_count and geometry(link) == before and link.skin_calib.result.outdated
    bpy.ops.object.mode_set(mode="EDIT")
    assert left() == ALL - removed_count
    assert bpy.ops.skin_calib.bring_back() == {"FINISHED"}
    assert left() == ALL and geometry(link) == before and link.mode == "OBJECT"
    assert not link.modifiers and not bpy.data.node_groups and not [a for a in link.data.attributes if "skin" in a.name]


def test_undo_restores_everything(bpy, link, choose, left):
    """One undo step restores faces, modifier and nodes; redo removes them again."""
    removed_count = choose()
    bpy.ops.ed.undo_push(message="chosen")
    assert bpy.ops.skin_calib.cut_away("EXEC_DEFAULT", True) == {"FINISHED"}
    bpy.ops.ed.undo()
    assert bpy.context.mode == "EDIT_MESH" and left() == ALL
    assert not bpy.context.object.modifiers and not bpy.data.node_groups
    bpy.ops.ed.redo()
    assert bpy.context.mode == "OBJECT" and left() == ALL - removed_count
    assert bpy.ops.skin_calib.bring_back("EXEC_DEFAULT", True) == {"FINISHED"} and left() == ALL
    bpy.ops.ed.undo()
    assert left() == ALL - removed_count


def test_file_keeps_it_with_and_without_the_extension(bpy, addon, extension, link, choose, left, tmp_path):
    """A saved file has the same faces removed, also with the extension disabled."""
    import addon_utils

    removed_count = choose()
    bpy.ops.skin_calib.cut_away()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "arm.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "arm.blend"))
    assert left() == ALL - removed_count
    addon_utils.disable(extension)
    try:
        bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "arm.blend"))
        link = bpy.context.object
        evaluated = link.evaluated_get(bpy.context.evaluated_depsgraph_get())
        assert len(evaluated.data.polygons) == ALL - removed_count and len(link.data.polygons) == ALL
        bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "arm.blend"))
    finally:
        addon_utils.enable(extension)
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "arm.blend"))
    assert left() == ALL - removed_count
    bpy.ops.skin_calib.bring_back()
    assert left() == ALL


def test_objects_on_one_mesh_are_cut_each_for_itself(bpy, link, choose, left):
    """Objects with the same mesh do not affect each other: without a modifier, copied with it, and cut later."""
    data = link.data

    def twin(name):
        copy = link.copy()
        copy.name = name
        bpy.context.scene.collection.objects.link(copy)
        return copy

    def activate(o):
        bpy.ops.object.select_all(action="DESELECT")
        bpy.context.view_layer.objects.active = o
        o.select_set(True)

    whole = twin("whole")
    first = choose(slice(0, 10))
    bpy.ops.skin_calib.cut_away()
    copied = twin("copied")
    assert (left("arm"), left("whole"), left("copied")) == (ALL - first, ALL, ALL - first)
    activate(copied)
    choose(slice(100, 120))
    bpy.ops.skin_calib.cut_away()
    activate(whole)
    choose(slice(200, 205))
    bpy.ops.skin_calib.cut_away()
    assert (left("arm"), left("whole"), left("copied")) == (ALL - 10, ALL - 5, ALL - 30)
    bpy.ops.skin_calib.bring_back()
    assert (left("arm"), left("whole"), left("copied")) == (ALL - 10, ALL, ALL - 30)
    activate(copied)
    bpy.ops.skin_calib.bring_back()
    assert (left("arm"), left("copied")) == (ALL - 10, ALL) and data.users == 3
    activate(bpy.data.objects["arm"])
    bpy.ops.skin_calib.bring_back()
    assert left("arm") == ALL and not bpy.data.node_groups and not [a for a in data.attributes if "skin" in a.name]


def test_modifiers_of_the_author_come_after(bpy, link, choose, left):
    """Faces are removed before other modifiers, for example a subdivision."""
    link.modifiers.new("finer", "SUBSURF").levels = 1
    removed_count = choose()
    bpy.ops.skin_calib.cut_away()
    assert link.modifiers[0].type == "NODES" and left() == 6 * (ALL - removed_count)


def test_attribute_of_that_name_is_left_alone(bpy, link, choose, left):
    """An attribute of the author with the same name does not change."""
    own = link.data.attributes.new("skin_cut_away", "FLOAT", "POINT")
    own.data[3].value = 7
    removed_count = choose()
    bpy.ops.skin_calib.cut_away()
    assert left() == ALL - removed_count and link.data.attributes["skin_cut_away"].data[3].value == 7


def test_exported_plan_gives_the_bytes_of_the_scene(bpy, link, choose, fit_scene, fit_plainly, tmp_path):
    """The mesh file of the plan is without the removed faces; the command line gives the same skin."""
    link.location, link.scale = (0.01, 0.02, 0.03), (-1, 1, 1)
    bpy.context.view_layer.update()
    whole = fit_scene()
    choose(slice(0, 12))
    bpy.ops.skin_calib.cut_away()
    bpy.ops.skin_calib.export_plan(filepath=str(tmp_path / "cut.plan.json"))
    skins = [json.loads(data)["patches"] for data in (whole, fit_scene(), fit_plainly(tmp_path / "cut.plan.json"))]
    assert skins[1] == skins[2] != skins[0]


@pytest.mark.parametrize(
    "faces, words",
    [(slice(0, 0), "No remaining face of arm is selected"), (slice(0, ALL), "No face of arm would be left")],
)
def test_selection_of_no_or_all_faces_is_refused(bpy, addon, link, choose, left, faces, words):
    """Selections of no face or of all faces are refused; mode and selection stay."""
    chosen = choose(faces)
    before = scene_state(bpy, addon)
    with pytest.raises(RuntimeError, match=f"Error: .*{words}"):
        bpy.ops.skin_calib.cut_away()
    assert scene_state(bpy, addon) == before and link.mode == "EDIT" and not link.modifiers
    assert link.data.total_face_sel == chosen


def cuts(link):
    return [(tuple(np.round(c.point, 6)), tuple(np.round(c.normal, 6))) for c in link.skin_calib.cover.cuts]


def test_new_cut_stands_across_the_link(bpy, link):
    """It is at the cursor, across the axis, keeps the larger part, and becomes the active one."""
    for z in (0.03, 0.09):
        bpy.context.scene.cursor.location = (0.3, 0.2, z)
        bpy.ops.skin_calib.cut_add()
    assert cuts(link) == [((0.3, 0.2, 0.03), (0, 0, 1)), ((0.3, 0.2, 0.09), (0, 0, -1))]
    assert link.skin_calib.cover.cut_index == 1


@pytest.mark.parametrize("adds", ["cut_add", "cut_place", "landmark_add", "zone_add"])
def test_what_is_added_at_a_point_can_be_corrected(bpy, link, adds):
    """The panel of the last operation has the point; the next call starts at the cursor again."""
    bpy.ops.skin_calib.skin_add(kind="hexagons")
    words = {"landmark_add": {"skin": 0}, "zone_add": {"skin": 1}}.get(adds, {})
    shown = [p for p in getattr(bpy.ops.skin_calib, adds).get_rna_type().properties if not p.is_hidden]
    assert {"point"} <= {p.identifier for p in shown} and all(p.is_skip_save for p in shown if p.identifier == "point")
    plan = link.skin_calib
    listed = {"landmark_add": plan.skins[0].landmarks, "zone_add": plan.skins[1].excluded}.get(adds, plan.cover.cuts)
    bpy.context.scene.cursor.location = (0.01, 0.02, 0.05)
    getattr(bpy.ops.skin_calib, adds)(point=(0.03, 0.0, 0.06), **words)
    getattr(bpy.ops.skin_calib, adds)(**words)
    assert_allclose([tuple(entry.point) for entry in listed], [(0.03, 0.0, 0.06), (0.01, 0.02, 0.05)], atol=1e-7)


def test_cut_is_placed_at_a_point_across_the_axis_of_the_author(bpy, link):
    """The same operator as a click uses the typed axis, also in a scene of millimetres."""
    link.skin_calib.grid.auto_axis, link.skin_calib.grid.direction = False, (3, 0, 4)
    bpy.ops.ed.undo_push(message="start")
    assert bpy.ops.skin_calib.cut_place("EXEC_DEFAULT", True, point=(0.03, 0.0, 0.09)) == {"FINISHED"}
    assert cuts(bpy.data.objects["arm"]) == [((0.03, 0.0, 0.09), (-0.6, 0, -0.8))]
    bpy.ops.ed.undo()
    assert cuts(bpy.data.objects["arm"]) == []
    bpy.context.scene.unit_settings.scale_length = 0.001
    bpy.data.objects["arm"].scale = (1000, 1000, 1000)
    bpy.context.view_layer.update()
    bpy.ops.skin_calib.cut_place(point=(30, 0, 90))
    assert cuts(bpy.data.objects["arm"]) == [((30, 0, 90), (-0.6, 0, -0.8))]


def test_flipped_cut_keeps_the_other_side(bpy, link):
    """Two flips give the first cut back in every bit."""
    bpy.ops.skin_calib.cut_add()
    cut = link.skin_calib.cover.cuts[0]
    cut.normal = (0.1, 0, -0.7)
    before = tuple(cut.normal)
    assert bpy.ops.skin_calib.cut_flip(index=0) == {"FINISHED"}
    assert_allclose(cut.normal, np.negative(before)) and link.skin_calib.result.outdated
    assert str(tuple(cut.normal)[1]) == "0.0"
    bpy.ops.skin_calib.cut_flip(index=0)
    assert tuple(cut.normal) == before
    with pytest.raises(RuntimeError, match="There is no cut 1; there are 1"):
        bpy.ops.skin_calib.cut_flip(index=1)


@pytest.mark.parametrize("active, removed, after", [(2, 0, 1), (0, 2, 0), (2, 2, 1), (1, 1, 1), (0, 0, 0)])
def test_active_cut_stays_when_another_is_removed(bpy, link, active, removed, after):
    """The displayed numbers are those of the same cut, or of the next one if the cut itself is removed."""
    for _ in range(3):
        bpy.ops.skin_calib.cut_add()
    link.skin_calib.cover.cut_index = active
    bpy.ops.skin_calib.cut_remove(index=removed)
    assert link.skin_calib.cover.cut_index == after
