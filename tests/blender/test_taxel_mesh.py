"""The taxels as an object of Blender: faces, attributes, and forces that follow the timeline."""

import numpy as np
import pytest
import trimesh
from numpy.testing import assert_allclose

from tests.blender.conftest import BOARDS, PLAN, modules
from tests.blender.test_registration import draw
from tests.blender.test_replay import ours, record  # noqa: F401 (fixtures)
from tests.examples import slow

STALE = "Of another fit: make it again"
ATTRIBUTES = {"channel", "error", "strain", "sigma", "tilt", "force"}


def values(thing, name):
    """Return the values of an attribute of faces."""
    attribute = thing.data.attributes[name]
    assert attribute.domain == "FACE"
    found = np.empty(len(attribute.data), np.int32 if attribute.data_type == "INT" else np.float32)
    attribute.data.foreach_get("value", found)
    return found


def made(bpy, **words):
    """Return the object with the taxels of the active link."""
    assert bpy.ops.skin_calib.taxel_mesh(**words) == {"FINISHED"}
    return next(o for o in bpy.data.objects if o.name.endswith("_taxels"))


@pytest.mark.parametrize("metre", [slow(1.0), 0.001])
def test_each_taxel_is_a_face_with_its_numbers(bpy, addon, plan_file, metre):
    """Corners and numbers are those of the calibration; the error is measured with another library."""
    bpy.context.scene.unit_settings.scale_length = metre
    bpy.ops.skin_calib.import_plan(filepath=str(plan_file(skins=[*PLAN["skins"], BOARDS])))
    link = bpy.context.object
    bpy.ops.skin_calib.fit()
    thing, result = made(bpy), addon.results.find(link.skin_calib.result.key)
    bpy.context.view_layer.update()
    sheet, boards = (patch.taxels for patch in result.calibration.patches)
    assert {a.name for a in thing.data.attributes if a.domain == "FACE"} >= ATTRIBUTES
    assert len(thing.data.polygons) == len(sheet.ids) + len(boards.ids)
    assert {len(face.vertices) for face in thing.data.polygons} == {4, 6}
    corners = [[thing.matrix_world @ thing.data.vertices[v].co for v in f.vertices] for f in thing.data.polygons]
    assert_allclose(metre * np.array(corners[: len(sheet.ids)]), sheet.corners_link, atol=1e-7)
    assert_allclose(metre * np.array(corners[len(sheet.ids) :]), boards.corners_link, atol=1e-7)
    outward = np.array([face.normal for face in thing.data.polygons])
    assert (np.einsum("ij,ij->i", outward, np.concatenate((sheet.normals_link, boards.normals_link))) > 0.9).all()
    assert values(thing, "channel").tolist() == [*sheet.channels, *boards.channels]
    assert_allclose(
        values(thing, "sigma"), 1e3 * np.concatenate((sheet.known_sigma, boards.known_sigma))[:, 0], rtol=1e-5
    )
    strain = values(thing, "strain")
    assert np.isfinite(strain[: len(sheet.ids)]).all() and np.isnan(strain[len(sheet.ids) :]).all()
    assert (values(thing, "force") == 0).all()
    cover = result.cover
    feet = np.concatenate([result.fit.surface.points(part.uv) for part in (sheet, boards)])
    _, distances, _ = trimesh.proximity.closest_point_naive(trimesh.Trimesh(cover.vertices, cover.faces), feet)
    assert_allclose(values(thing, "error"), 1e3 * distances, atol=1e-5)


def test_second_call_replaces_the_faces(bpy, link):
    """After another fit the panel asks for it. The object keeps materials and modifiers, and the link stays active."""
    bpy.ops.skin_calib.fit()
    thing = made(bpy)
    thing.data.materials[0] = bpy.data.materials.new("skin")
    assert STALE not in draw(bpy, "inspect")
    link.skin_calib.skins[0].rows = 3
    bpy.ops.skin_calib.fit()
    assert STALE in draw(bpy, "inspect")
    again = made(bpy)
    assert STALE not in draw(bpy, "inspect")
    assert again == thing and len(thing.data.polygons) == 9 and [m.name for m in thing.data.materials] == ["skin"]
    assert len(thing.modifiers) == 1
    assert bpy.context.object == link and not thing.skin_calib.link


def colours_of(bpy, thing):
    """Return the colours that nodes give the faces, which the material reads by their name, shape (n, 3)."""
    evaluated = thing.evaluated_get(bpy.context.evaluated_depsgraph_get())
    (material,) = thing.data.materials
    name = next(node.attribute_name for node in material.node_tree.nodes if node.type == "ATTRIBUTE")
    found = np.empty(4 * len(evaluated.data.polygons), np.float32)
    evaluated.data.attributes[name].data.foreach_get("color", found)
    linear = found.reshape(-1, 4)[:, :3]
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)


@pytest.mark.parametrize("heat, signed", [("STRAIN", True), ("TILT", False)])
def test_nodes_and_material_show_an_attribute_by_its_name(bpy, extension, plan_file, heat, signed):
    """Its colours are those of the heat map, dark grey where it is unknown or misspelled; faces are over the link."""
    scales, nodes = (modules(extension, name) for name in ("overlay.scales", "inspection.taxel_nodes"))
    scales, nodes = scales.scales, nodes.taxel_nodes
    bpy.ops.skin_calib.import_plan(filepath=str(plan_file(skins=[*PLAN["skins"], BOARDS])))
    bpy.ops.skin_calib.fit()
    thing = made(bpy, heat=heat)
    shown = values(thing, heat.lower())
    legend = scales.Legend("", "FRACTION", np.nanmax(np.abs(shown)), signed)
    assert_allclose(colours_of(bpy, thing), legend.colours(shown)[:, :3], atol=0.02)
    unknown = np.broadcast_to(np.float32(scales.UNKNOWN), (len(shown), 3))
    nodes.show(thing, "strian", 0.0, 1.0)
    assert_allclose(colours_of(bpy, thing), unknown, atol=1e-6)
    evaluated = thing.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    raised = [(a.center - b.center).dot(b.normal) for a, b in zip(evaluated.polygons, thing.data.polygons)]
    assert min(raised) > 1e-4 and np.ptp(raised) < 1e-6


def test_undo_removes_the_taxels_with_nodes_and_material(bpy, link):
    """And redo brings them back; what the heat map shows is the first choice."""
    bpy.ops.skin_calib.fit()
    link.skin_calib.inspect.heat = "TILT"
    bpy.ops.ed.undo_push(message="start")
    bpy.ops.skin_calib.taxel_mesh("EXEC_DEFAULT", True)
    bpy.ops.ed.undo()
    assert not [o for o in bpy.data.objects if o.name.endswith("_taxels")]
    assert not bpy.data.materials and not bpy.data.node_groups
    bpy.ops.ed.redo()
    thing = next(o for o in bpy.data.objects if o.name.endswith("_taxels"))
    assert np.ptp(colours_of(bpy, thing), axis=0).max() > 0.1


def test_scale_of_forces_is_that_of_the_recording(bpy, extension, ours, link, record):  # noqa: F811
    """A press of half the largest force has the middle colour, although the object was made before."""
    bpy.ops.skin_calib.fit()
    thing = made(bpy, heat="FORCE")
    bpy.ops.skin_calib.replay_open(filepath=record())  # up to 6 N
    bpy.context.scene.frame_set(round(0.25 * 24))  # 3 N on the third taxel
    assert_allclose(colours_of(bpy, thing)[2], modules(extension, "overlay.scales").scales.RISING[2], atol=0.02)


def test_forces_follow_the_timeline(bpy, ours, link, record):  # noqa: F811
    """Scrubbing shows the frame of the recording at that time; so does the evaluated mesh, which is rendered."""
    scene = bpy.context.scene
    scene.render.fps, scene.frame_start = 50, 10
    bpy.ops.skin_calib.fit()
    thing = made(bpy)
    bpy.ops.skin_calib.replay_open(filepath=record())  # a press of k + 1 N on taxel k, for 0.1 s each
    for frame, pressed in ((10, 0), (14, 0), (15, 1), (27, 3), (38, 5), (500, 5), (1, 0)):
        scene.frame_set(frame)
        assert_allclose(values(thing, "force"), [k + 1.0 if k == pressed else 0 for k in range(6)])
        evaluated = thing.evaluated_get(bpy.context.evaluated_depsgraph_get())
        assert values(evaluated, "force").argmax() == pressed
        assert link.skin_calib.inspect.replay.frame == pressed
    bpy.ops.skin_calib.replay_close()
    scene.frame_set(27)  # without a recording nothing changes
    assert values(thing, "force").argmax() == 0


def test_force_is_that_of_the_taxel_or_none(bpy, ours, link, record, tmp_path):  # noqa: F811
    """Unknown forces are no zeros, faces of an earlier fit get no forces of another, nor any after the recording."""
    bpy.ops.skin_calib.fit()
    thing = made(bpy)
    path = tmp_path / "lost.csv"
    path.write_text("time,a,b,c,d,e,f\n0,1,,3,4,5,6\n0.1,1,,3,4,5,6\n")
    bpy.ops.skin_calib.replay_open(filepath=str(path))
    assert_allclose(values(thing, "force"), [1, np.nan, 3, 4, 5, 6])
    link.skin_calib.skins[0].direction = (0, -1, 0)  # each face is now where another taxel was
    bpy.ops.skin_calib.fit()
    bpy.ops.skin_calib.replay_open(filepath=str(path))
    bpy.context.scene.frame_set(2)
    assert (values(thing, "force") == 0).all()
    assert_allclose(values(made(bpy), "force"), [1, np.nan, 3, 4, 5, 6])
    bpy.ops.skin_calib.replay_close()
    assert (values(thing, "force") == 0).all()
