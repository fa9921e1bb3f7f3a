"""The menu Skin in the header: every operator; samples; faces without skin."""

import importlib

import numpy as np
import pytest

from tests.blender.conftest import BOARDS
from tests.blender.test_registration import Layout
from tests.examples import slow

INTERNAL = {"import_wait", "choose_link", "take_advice"}  # a part of other operators


def listed(bpy):
    """Return the operators of the menu and its menus."""
    layout = Layout(bpy, [])
    layout.menu("SKIN_MT_skin")
    return [name.removeprefix("skin_calib.") for name in layout.called]


def test_menu_has_every_operator(bpy, plan_file, extension):
    """With a sheet, boards, taxels of a file, a landmark, a zone, touches and two surfaces, each has an entry."""
    bpy.ops.skin_calib.import_plan(filepath=str(plan_file()))
    plan = bpy.context.object.skin_calib
    bpy.ops.skin_calib.skin_add(kind="hexagons")
    bpy.ops.skin_calib.skin_add(kind="sheet")
    plan.skins[2].kind = "imported"
    bpy.ops.skin_calib.landmark_add(skin=0)
    bpy.ops.skin_calib.zone_add(skin=1)
    plan.skins[0].taxels.add().taxel = "0.0"
    plan.skins[0].touches = "{}"
    bpy.ops.skin_calib.surface_add()
    assert set(dir(bpy.ops.skin_calib)) - set(listed(bpy)) == INTERNAL
    menus = importlib.import_module(f"{extension}.panels.menus")
    assert menus.draw_menu in bpy.types.VIEW3D_MT_editor_menus._dyn_ui_initialize()


def test_menu_without_a_link_opens_one(bpy):
    """What needs a link is not available; nothing fails."""
    found = listed(bpy)
    assert {"import_mesh", "import_robot", "import_plan", "open_sample"} < set(found) and "skin_add" not in found


def test_entries_work_on_the_rows_of_the_panels(bpy, link, extension):
    """Cut, plane and warning are those that the panels show."""
    menus = importlib.import_module(f"{extension}.panels.menus")
    for _ in range(3):
        bpy.ops.skin_calib.cut_add()
    plan = link.skin_calib
    plan.cover.cut_index, plan.held, plan.grid.v_index = 1, "V", 2
    found = {name: argument(plan) for name, argument in menus.ARGUMENTS.items()}
    assert found["cut_flip"] == found["cut_remove"] == {"index": 1}
    assert found["plane_remove"] == {"family": "v", "index": 2} and found["plane_add"] == {"family": "v"}


@pytest.mark.parametrize("name", ["edge", slow("wrist"), slow("sole")])
def test_sample_is_opened_from_the_extension(bpy, name):
    """It has a plan that fits."""
    assert bpy.ops.skin_calib.open_sample(name=name) == {"FINISHED"}
    link = bpy.context.object
    assert link.skin_calib.link == f"sample_{name}" and link.skin_calib.skins
    assert bpy.ops.skin_calib.fit() == {"FINISHED"} and link.skin_calib.result.mean < 1e-4


def facing(link, axis, least):
    """Return which faces have a centre beyond a coordinate."""
    return np.array([face.center[axis] > least for face in link.data.polygons])


@pytest.mark.parametrize("by", ["selection", slow("group")])
def test_faces_become_zones_without_boards(bpy, addon, plan_file, by):
    """No board is over a selected face; the plan keeps them as the zones that it has always had."""
    bpy.ops.skin_calib.import_plan(filepath=str(plan_file(skins=[BOARDS])))
    link = bpy.context.object
    bpy.ops.skin_calib.fit()
    before = link.skin_calib.result.taxels
    chosen = facing(link, 2, 0.085)
    if by == "selection":
        for parts in (link.data.vertices, link.data.edges, link.data.polygons):
            parts.foreach_set("select", chosen if parts == link.data.polygons else np.zeros(len(parts), bool))
        bpy.context.tool_settings.mesh_select_mode = (False, False, True)
        bpy.ops.object.mode_set(mode="EDIT")
    else:
        group = link.vertex_groups.new(name="no skin")
        inside = {v for face, is_in in zip(link.data.polygons, chosen) if is_in for v in face.vertices}
        group.add(sorted(inside), 1.0, "REPLACE")
    assert bpy.ops.skin_calib.zones_from_faces(skin=0) == {"FINISHED"}
    if by == "selection":
        bpy.ops.object.mode_set(mode="OBJECT")
    (skin,) = addon.plans.read_plan(link, bpy.context.scene).skins
    zones = skin.excluded
    corners = np.array(
        [link.data.vertices[v].co for f in np.flatnonzero(chosen) for v in link.data.polygons[f].vertices]
    )
    off = [np.linalg.norm(corners - np.array(zone.point), axis=1) - zone.radius for zone in zones]
    assert len(zones) > 3 and np.min(off, axis=0).max() < 1e-6
    assert bpy.ops.skin_calib.fit() == {"FINISHED"}
    assert 0 < link.skin_calib.result.taxels < before


def test_zones_need_faces(bpy, plan_file):
    """Without a selection and without a vertex group the reason says what to do."""
    bpy.ops.skin_calib.import_plan(filepath=str(plan_file(skins=[BOARDS])))
    with pytest.raises(RuntimeError, match="has no vertex group. Select faces in Edit Mode"):
        bpy.ops.skin_calib.zones_from_faces(skin=0)
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="DESELECT")
    with pytest.raises(RuntimeError, match="No face of arm is selected"):
        bpy.ops.skin_calib.zones_from_faces(skin=0)
    bpy.ops.object.mode_set(mode="OBJECT")
    assert not bpy.context.object.skin_calib.skins[0].excluded


def test_toolbar_has_tools_for_planes_and_boards(bpy, extension):
    """They leave with the extension."""
    import addon_utils
    from bl_ui.space_toolsystem_common import ToolSelectPanelHelper
    from bl_ui.space_toolsystem_toolbar import VIEW3D_PT_tools_active

    def tools():
        listed = ToolSelectPanelHelper._tools_flatten(VIEW3D_PT_tools_active._tools["OBJECT"])
        return {tool.idname for tool in listed if tool is not None and tool.idname.startswith("skin_calib.")}

    assert tools() == {"skin_calib.cut_tool", "skin_calib.planes_tool", "skin_calib.boards_tool"}
    addon_utils.disable(extension)
    assert not tools()
    addon_utils.enable(extension)


def test_faces_are_without_taxels_of_a_sheet(bpy, link, addon):
    """Taxels over the faces are disabled, no other ones; before a fit nobody knows which."""
    link.skin_calib.skins[0].columns = 8
    group = link.vertex_groups.new(name="no skin")
    chosen = facing(link, 1, 0.012)
    group.add(sorted({v for f in np.flatnonzero(chosen) for v in link.data.polygons[f].vertices}), 1.0, "REPLACE")
    with pytest.raises(RuntimeError, match="Fit the link first, to see its taxels"):
        bpy.ops.skin_calib.zones_from_faces(skin=0)
    bpy.ops.skin_calib.fit()
    (before,) = addon.drawing.patches_of(link)
    assert bpy.ops.skin_calib.zones_from_faces(skin=0) == {"FINISHED"} and bpy.ops.skin_calib.fit() == {"FINISHED"}
    kept = {i for patch in addon.drawing.patches_of(link) for i in patch.taxels.ids}
    along = before.taxels.corners_link[:, :, 1]
    over, clear = along.min(axis=1) > 0.02, along.max(axis=1) < 0.006
    for name, is_over, is_clear in zip(before.taxels.ids, over, clear):
        assert name not in kept if is_over else name in kept or not is_clear, name
    assert over.any() and clear.any()
