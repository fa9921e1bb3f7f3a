"""Boards stay off the faces of a vertex group, as it is at each fit."""

import json

import numpy as np
import pytest

from tests.blender.conftest import BOARDS, look
from tests.blender.test_live import rest


@pytest.fixture
def excluding(bpy, plan_file):
    """Return a link with boards, and the vertex group "screws" without a vertex, which they stay off."""
    bpy.ops.skin_calib.import_plan(filepath=str(plan_file(skins=[BOARDS])))
    link = bpy.context.object
    link.vertex_groups.new(name="screws")
    link.skin_calib.skins[0].zone_group = "screws"
    return link


def vertices_of(link, axis, least):
    """Return the vertices of the faces with a centre beyond a coordinate."""
    return sorted({v for face in link.data.polygons if face.center[axis] > least for v in face.vertices})


def assign(bpy, link, axis, least):
    """Assign vertices to the active group as in the window: selected in Edit Mode, with the operator of Blender."""
    chosen = np.zeros(len(link.data.vertices), bool)
    chosen[vertices_of(link, axis, least)] = True
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="DESELECT")
    bpy.ops.object.mode_set(mode="OBJECT")
    link.data.vertices.foreach_set("select", chosen)
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.object.vertex_group_assign()
    bpy.ops.object.mode_set(mode="OBJECT")
    bpy.context.view_layer.update()


def zones(addon, bpy, link):
    """Return the excluded zones of the plan."""
    return addon.plans.read_plan(link, bpy.context.scene).skins[0].excluded


def test_boards_follow_an_edited_group(bpy, addon, updates, excluding, monkeypatch):
    """Live fits again after Assign and after Remove; in between, no board is over a face of the group."""
    plan = excluding.skin_calib
    bpy.ops.skin_calib.fit()
    before = plan.result.taxels
    assert zones(addon, bpy, excluding) == ()
    plan.live = True
    rest(updates, monkeypatch)
    assign(bpy, excluding, 2, 0.085)
    look(updates)
    assert plan.result.outdated
    rest(updates, monkeypatch)
    assert 0 < plan.result.taxels < before and not plan.result.outdated
    (patch,) = addon.drawing.patches_of(excluding)
    corners = np.array([excluding.data.vertices[v].co for v in vertices_of(excluding, 2, 0.085)])
    at_corners = np.linalg.norm(corners[:, None] - patch.taxels.positions_link, axis=2)
    assert at_corners.min() > BOARDS["side"] * np.sqrt(3) / 2
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.object.vertex_group_remove_from()
    bpy.ops.object.mode_set(mode="OBJECT")
    bpy.context.view_layer.update()
    look(updates)
    rest(updates, monkeypatch)
    assert plan.result.taxels == before


def test_result_is_outdated_by_an_edited_group_without_live(bpy, updates, excluding):
    """Export would otherwise write boards over faces of the group."""
    bpy.ops.skin_calib.fit()
    assert not excluding.skin_calib.result.outdated
    assign(bpy, excluding, 2, 0.085)
    look(updates)
    assert excluding.skin_calib.result.outdated


def test_another_group_is_another_zone(bpy, addon, excluding):
    """The field takes the name of any group; a missing one is an error that names it, also in the list of the link."""
    excluding.vertex_groups.new(name="cable").add(vertices_of(excluding, 1, 0.012), 1.0, "REPLACE")
    bpy.ops.skin_calib.fit()
    excluding.skin_calib.skins[0].zone_group = "cable"
    assert excluding.skin_calib.result.outdated and len(zones(addon, bpy, excluding)) > 3
    excluding.skin_calib.skins[0].zone_group = "other"
    with pytest.raises(RuntimeError, match="arm has no vertex group 'other'. Choose another one, or empty the field"):
        bpy.ops.skin_calib.fit()
    excluding.skin_calib.skins[0].zone_group = ""
    assert zones(addon, bpy, excluding) == ()


def test_vertices_with_little_weight_do_not_count(bpy, addon, excluding):
    """A face belongs to the group if all its vertices have half of the weight."""
    group = excluding.vertex_groups["screws"]
    group.add(vertices_of(excluding, 2, 0.085), 0.49, "REPLACE")
    assert zones(addon, bpy, excluding) == ()
    group.add(vertices_of(excluding, 2, 0.085), 0.51, "REPLACE")
    assert zones(addon, bpy, excluding)


def test_group_follows_geometry_nodes(bpy, addon, excluding):
    """Nodes that join another mesh change the index of the group; nodes that remove it are an error."""
    excluding.vertex_groups["screws"].add(vertices_of(excluding, 2, 0.085), 1.0, "REPLACE")
    plain = zones(addon, bpy, excluding)
    bpy.ops.mesh.primitive_cube_add(size=0.01)
    other = bpy.context.object
    other.vertex_groups.new(name="cable").add(range(8), 1.0, "REPLACE")
    nodes = bpy.data.node_groups.new("joined", "GeometryNodeTree")
    for which in ("INPUT", "OUTPUT"):
        nodes.interface.new_socket("Geometry", in_out=which, socket_type="NodeSocketGeometry")
    names = ("NodeGroupInput", "GeometryNodeObjectInfo", "GeometryNodeJoinGeometry", "NodeGroupOutput")
    start, info, joined, end = (nodes.nodes.new(name) for name in names)
    info.inputs["Object"].default_value = other
    for source in (start, info):
        nodes.links.new(source.outputs["Geometry"], joined.inputs[0])
    nodes.links.new(joined.outputs[0], end.inputs[0])
    excluding.modifiers.new("joined", "NODES").node_group = nodes
    assert zones(addon, bpy, excluding) == plain
    nodes.links.new(info.outputs["Geometry"], end.inputs[0])
    with pytest.raises(Exception, match="The modifiers of arm remove its vertex group 'screws'. Apply or change them"):
        zones(addon, bpy, excluding)


def test_zones_of_a_scaled_link_in_another_unit_are_in_metres(bpy, addon, excluding):
    """Zones are where the mesh is, whatever the scale of the object and the unit of the scene."""
    excluding.vertex_groups["screws"].add(vertices_of(excluding, 2, 0.085), 1.0, "REPLACE")
    excluding.scale, bpy.context.scene.unit_settings.scale_length = (2.0,) * 3, 0.5
    corners = np.array([excluding.data.vertices[v].co for v in vertices_of(excluding, 2, 0.085)])
    found = zones(addon, bpy, excluding)
    off = [np.linalg.norm(corners - zone.point, axis=1) - zone.radius for zone in found]
    assert np.min(off, axis=0).max() < 1e-8 and max(zone.radius for zone in found) <= 0.01


@pytest.mark.slow
def test_command_line_has_the_same_boards(bpy, excluding, tmp_path, fit_scene, fit_plainly):
    """The exported plan has the faces of the group as excluded zones."""
    excluding.vertex_groups["screws"].add(vertices_of(excluding, 2, 0.085), 1.0, "REPLACE")
    path = tmp_path / "exported.plan.json"
    bpy.ops.skin_calib.export_plan(filepath=str(path))
    assert fit_scene() == fit_plainly(path)


def test_group_without_a_complete_face_is_a_warning(bpy, excluding, tmp_path):
    """It excludes nothing: Check Mesh, state, reports and file say so, until it has a face."""
    bpy.ops.skin_calib.diagnose()
    (line,) = (finding for finding in excluding.skin_calib.diagnosis.findings if finding.code == "fit")
    assert line.severity == "warning" and "'screws' has no complete face" in line.message
    bpy.ops.skin_calib.fit()
    (warning,) = excluding.skin_calib.result.warnings
    assert warning.code == "empty-group" and warning.skin == excluding.skin_calib.skins[0].name
    assert "'screws' has no complete face" in warning.message
    bpy.ops.skin_calib.export_calibration(filepath=str(tmp_path / "arm.calibration.json"))
    kept = json.loads((tmp_path / "arm.calibration.json").read_text())["warnings"]
    assert [warning["code"] for warning in kept] == ["empty-group"]
    excluding.vertex_groups["screws"].add([0, 1], 1.0, "REPLACE")  # an edge
    bpy.ops.skin_calib.fit()
    assert [warning.code for warning in excluding.skin_calib.result.warnings] == ["empty-group"]
    excluding.vertex_groups["screws"].add(vertices_of(excluding, 2, 0.085), 1.0, "REPLACE")
    bpy.ops.skin_calib.fit()
    assert not excluding.skin_calib.result.warnings
