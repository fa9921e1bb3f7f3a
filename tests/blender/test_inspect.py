"""What is drawn of a fitted link: layers as arrays, colours and legends, labels without overlap."""

from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from tests.blender.conftest import BAND, BOARDS, PLAN, modules
from tests.blender.test_registration import draw

LINES = {"SECTIONS", "LINES", "NET", "SURFACE", "CELLS", "NORMALS"}


@pytest.fixture
def ours(extension, bpy):
    """Return modules of the running extension."""
    names = ("overlay.layers", "overlay.scales", "overlay.labels", "overlay.drawing")
    return modules(extension, *names, "scene.link_meshes", "scene.plans", "scene.results", "scene.units")


@pytest.fixture
def fitted(bpy, link):
    """Return a fitted link."""
    bpy.ops.skin_calib.fit()
    return bpy.context.object


@pytest.fixture
def result(ours, fitted):
    """Return the result of the fit."""
    return ours.results.find(fitted.skin_calib.result.key)


def by_name(layers):
    """Return layers by name."""
    return {layer.what: layer for layer in layers}


def test_sections_are_where_planes_cut_the_cover(ours, result):
    """Each end is in a plane; for v-lines it is also on the side of their direction."""
    layers = by_name(ours.layers.layers_of(result))
    lines = result.fit.lines
    ends = layers["SECTIONS"].points.astype(float)
    heights = (ends[:, None] - lines.planes_u.points) * lines.planes_u.normals
    assert_allclose(np.abs(heights.sum(axis=2)).min(axis=1), 0, atol=1e-8)
    ends = ours.layers.line_sections(result.fit).reshape(-1, 3)
    start, outward = lines.origins[0], lines.directions[0]
    axis = lines.planes_u.normals[0]
    out = ends[:, None] - start
    off = np.abs((out * np.cross(axis, outward)).sum(axis=2))
    off[(out * outward).sum(axis=2) < -1e-9] = 1
    assert_allclose(off.min(axis=1), 0, atol=1e-7)
    assert len(np.unique(off.argmin(axis=1))) == len(outward)


def test_heat_map_colours_cells_alike_whatever_their_shape(bpy, ours, link, plan_file):
    """A sheet and boards have one scale of strain and one of tilt; unknown values are grey."""
    sheet = BAND | {"origin": [-0.03, 0.02, 0.05]}
    bpy.ops.skin_calib.import_plan(filepath=str(plan_file("two", skins=[sheet, BOARDS | {"cells": [[0, 0], [1, 0]]}])))
    bpy.ops.skin_calib.fit()
    result = ours.results.find(bpy.context.object.skin_calib.result.key)
    layers = by_name(ours.layers.layers_of(result))
    for what in ("STRAIN", "TILT", "UNCERTAINTY"):
        layer = layers[what]
        assert layer.points.shape == (8 * 7, 3) and layer.colours.shape == (8 * 7, 4)
        assert layer.indices.shape == (8 * 6, 3) and (layer.colours.reshape(8, 7, 4) == layer.colours[::7, None]).all()
    grey = (layers["STRAIN"].colours[::7] == np.float32((0.2, 0.2, 0.2, 1))).all(axis=1)
    assert grey.tolist() == [False] * 6 + [True] * 2
    strain = result.calibration.patches[0].taxels.quality["strain"][:, :2]
    assert_allclose(layers["STRAIN"].legend.maximum, np.abs(strain).max())
    tilt = max(t.quality["tilt"].max() for t in [result.calibration.patches[1].taxels])
    assert tilt > layers["TILT"].legend.maximum == np.deg2rad(45) and layers["TILT"].legend.exceeded


@pytest.mark.parametrize("sector", [{}, {"kind": "patch", "from": -1.0, "to": 1.0}])
def test_heat_map_of_the_error_has_the_measure_of_the_panel(bpy, ours, plan_file, sector):
    """The legend ends at the maximum of the panel, and the brightest point is that of Show Maximum Deviation."""
    bpy.ops.skin_calib.import_plan(filepath=str(plan_file("part", grid=PLAN["grid"] | sector, skins=[])))
    bpy.ops.skin_calib.fit()
    link = bpy.context.object
    fit = ours.results.find(link.skin_calib.result.key).fit
    layer = by_name(ours.layers.layers_of(ours.results.find(link.skin_calib.result.key)))["ERROR"]
    assert_allclose(layer.legend.maximum, fit.errors.surface_to_mesh.max, rtol=1e-12)
    assert_allclose(
        layer.legend.maximum, link.skin_calib.result.max * ours.units.metres_per_unit(bpy.context.scene), rtol=1e-6
    )
    brightest = (layer.colours[:, :3] == np.float32(layer.legend.scale[-1])).all(axis=1)
    bpy.ops.skin_calib.show_worst()
    shown = np.array(bpy.context.scene.cursor.location) * ours.units.metres_per_unit(bpy.context.scene)
    assert np.linalg.norm(layer.points[brightest] - shown, axis=1).min() < 1e-6


def test_heat_map_of_the_error_covers_the_complete_surface(ours, result):
    """Its points go from edge to edge and once around; each distance is that of its point from the mesh."""
    layer, surface = by_name(ours.layers.layers_of(result))["ERROR"], result.fit.surface
    ends = surface.grid_points(np.array((0.0, 1.0)), np.linspace(0, 1, 50)).reshape(-1, 3)
    gap = np.linalg.norm(layer.points - ends[:, None], axis=2).min(axis=1)
    assert gap.max() < 0.003  # points of an edge are up to 5 mm apart
    corners = layer.points[layer.indices].astype(float)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum() / 2
    u, v = np.linspace(0, 1, 200), np.linspace(0, 1, 200, endpoint=False) + 1 / 400
    true = np.linalg.norm(np.cross(*surface.grid_tangents((u[1:] + u[:-1]) / 2, v)), axis=2).mean()
    assert_allclose(area, true, rtol=0.003)


@pytest.mark.parametrize("signed, ends", [(False, (0.0, 2.0)), (True, (-2.0, 2.0))])
def test_colours_run_over_the_scale(ours, signed, ends):
    """The colours are those of the scale from start to end; unknown values, and skins without values, are grey."""
    legend = ours.scales.Legend("Strain", "FRACTION", 2.0, signed)
    colours = legend.colours(np.array((*ends, np.mean(ends), np.nan)))
    assert_allclose(colours[:3, :3], legend.scale[[0, -1, 2]], atol=1e-7)
    assert_allclose(colours[3], (0.2, 0.2, 0.2, 1.0))
    assert np.isfinite(ours.scales.Legend("Tilt", "ANGLE", 0.0).colours(np.zeros(3))).all()


def test_layers_are_switched_by_the_link(ours, fitted, state_of):
    """There is one heat map at a time; layers of other modules need no switch."""
    looks = fitted.skin_calib.inspect
    fitted.skin_calib.layers = {"CELLS", "NET"}
    assert [a.what for a in ours.drawing.shown_layers(fitted)] == ["NET", "CELLS"]
    looks.heat, looks.labels = "TILT", "ID"
    assert [a.what for a in ours.drawing.shown_layers(fitted)] == ["TILT", "NET", "CELLS", "LABELS"]
    own = ours.layers.Layer("OTHER", np.zeros((2, 3), np.float32))
    state_of(fitted).sketch = SimpleNamespace(layers=[own])
    assert list(ours.drawing.shown_layers(fitted))[-1] is own
    state_of(fitted).layers = ours.layers.Layers((), None, {})
    assert list(ours.drawing.shown_layers(fitted)) == [own]


def test_drawing_of_an_outdated_fit_says_so(bpy, ours, fitted, state_of):
    """In the panel and the legend, after a change; not after the next fit, and not with a preview of the change."""
    looks, note = fitted.skin_calib.inspect, "Shown: the last fit, before the change"
    looks.heat = "TILT"
    assert note not in " ".join(draw(bpy, "inspect"))
    fitted.skin_calib.skins[0].offset += 0.001
    assert note in " ".join(draw(bpy, "inspect"))
    state_of(fitted).layers = ours.layers.Layers((), None, {})
    assert note not in " ".join(draw(bpy, "inspect"))
    state_of(fitted).layers = None
    bpy.ops.skin_calib.fit()
    assert note not in " ".join(draw(bpy, "inspect"))


def test_labels_that_overlap_are_left_out(ours):
    """No two labels overlap; the first ones stay; all stay if there is enough space."""
    rng = np.random.default_rng(3)
    pixels, size = rng.uniform(0, 900, (3000, 2)), np.array((60.0, 14.0))
    order = rng.permutation(3000)
    kept = ours.labels.without_overlap(pixels, order, size)
    gap = np.abs(pixels[kept][:, None] - pixels[kept][None]) / size
    assert ((gap >= 1).any(axis=2) | np.eye(len(kept), dtype=bool)).all()
    assert kept[0] == order[0] and len(kept) > 300
    assert sorted(ours.labels.without_overlap(pixels[:200] * 30, range(200), size)) == list(range(200))
    assert ours.labels.without_overlap(pixels, [], size) == []


def test_names_are_written_at_taxels_that_face_the_viewer(bpy, ours, plan_file):
    """In a view along x from far away, taxels with normals along -x have labels at their projections."""
    from mathutils import Matrix

    bpy.ops.skin_calib.import_plan(filepath=str(plan_file("round", skins=[BAND | {"columns": 16}])))
    bpy.ops.skin_calib.fit()
    result = ours.results.find(bpy.context.object.skin_calib.result.key)
    layer = by_name(ours.layers.layers_of(result))["LABELS"]
    look = Matrix(((0, -1, 0, 0), (0, 0, 1, -0.06), (-1, 0, 0, -10), (0, 0, 0, 1)))
    flat = Matrix.Diagonal((5, 5, -0.01, 1))
    view = SimpleNamespace(view_matrix=look, perspective_matrix=flat @ look, window_matrix=flat)
    pixels, seen = ours.labels.on_screen(layer, Matrix.Identity(4), view, (400, 200))
    taxels = result.calibration.patches[0].taxels
    x, y = -taxels.positions_link[:, 1], taxels.positions_link[:, 2] - 0.06
    assert_allclose(pixels, np.column_stack((200 + 1000 * x, 100 + 500 * y)), atol=1e-2)
    assert (seen == (taxels.normals_link[:, 0] < -0.2)).all() and 5 < seen.sum() < 27
    assert layer.channels == tuple(map(str, range(32))) and layer.ids == taxels.ids


def test_taxel_is_read_by_id_and_by_channel(bpy, ours, fitted, result):
    """The numbers are those of the calibration in scene units; it is marked with its neighbours; undo removes all."""
    bpy.context.scene.unit_settings.scale_length = 0.001
    bpy.ops.ed.undo_push(message="start")
    assert bpy.ops.skin_calib.taxel("EXEC_DEFAULT", True, taxel="4") == {"FINISHED"}
    link, taxels = bpy.context.object, result.calibration.patches[0].taxels
    taxel = link.skin_calib.inspect.taxel
    assert (taxel.id, taxel.channel, tuple(taxel.index)) == ("band.1.1", 4, (1, 1))
    assert_allclose(taxel.position, 1000 * taxels.positions_link[4], rtol=1e-5)
    assert_allclose(taxel.normal, taxels.normals_link[4], atol=1e-6)
    strain = (taxel.strain_along / 100, taxel.strain_across / 100, taxel.shear)
    assert_allclose(strain, taxels.quality["strain"][4], rtol=1e-5)
    assert_allclose(taxel.area, 1e6 * taxels.areas[4], rtol=1e-5)
    assert taxel.neighbours == "band.0.1, band.1.0, band.1.2" and taxel.has_strain and taxel.has_tilt
    marks = [a for a in ours.drawing.shown_layers(link) if a.what == "MARKED"]
    assert [len(a.points) for a in marks] == [3 * 8, 8, 2]
    raised = marks[1].points[::2] - taxels.corners_link[4]  # along the normal, by less than a tenth of the cell
    heights = raised @ taxels.normals_link[4]
    assert_allclose(raised, np.outer(heights, taxels.normals_link[4]), atol=1e-7)
    assert heights.min() > 0 and heights.max() < 0.1 * np.sqrt(taxels.areas[4])
    bpy.ops.ed.undo()
    link = bpy.context.object
    assert not link.skin_calib.inspect.taxel.id
    assert "MARKED" not in {a.what for a in ours.drawing.shown_layers(link)}
    bpy.ops.ed.redo()
    assert len([a for a in ours.drawing.shown_layers(bpy.context.object) if a.what == "MARKED"]) == 3


def test_typed_taxel_is_read_at_once(bpy, ours, fitted):
    """An unknown taxel is reported and the last one stays; after another fit it is read again."""
    taxel = fitted.skin_calib.inspect.taxel
    taxel.wanted = "band.0.2"
    assert (taxel.id, taxel.channel, taxel.problem) == ("band.0.2", 2, "")
    taxel.wanted = "band.7.7"
    assert taxel.id == "band.0.2" and "no taxel 'band.7.7' here; channels go from 0 to 5" in taxel.problem
    with pytest.raises(RuntimeError, match="no taxel '99' here"):
        bpy.ops.skin_calib.taxel(taxel="99")
    taxel.wanted = ""
    assert not taxel.problem
    before, key = list(taxel.position), taxel.key
    fitted.skin_calib.grid.n += 1
    bpy.ops.skin_calib.fit()
    assert taxel.key == fitted.skin_calib.result.key != key and list(taxel.position) != before
    assert "MARKED" in {a.what for a in ours.drawing.shown_layers(fitted)}
    fitted.skin_calib.skins[0].columns = 2  # which has no taxel 0.2
    bpy.ops.skin_calib.fit()
    assert taxel.id == "band.0.2" and taxel.key != fitted.skin_calib.result.key
    assert "MARKED" not in {a.what for a in ours.drawing.shown_layers(fitted)}


def test_click_reads_the_taxel_that_one_sees(bpy, ours, extension, fitted, result):
    """This is in a posed and scaled scene; hidden taxels and those on the far side are not read."""
    from mathutils import Vector

    from tests.blender.test_link_frame import frame_for

    frame_for(bpy, fitted)
    pick = modules(extension, "inspection.taxels").taxels.taxel_on_ray
    taxels, to_world = result.calibration.patches[0].taxels, ours.link_meshes.link_frame(fitted)
    for name, place, normal in zip(taxels.ids, taxels.positions_link, taxels.normals_link):
        eye, target = to_world @ Vector(place + 0.1 * normal), to_world @ Vector(place)
        assert pick(fitted, bpy.context, eye, target - eye) == name
        behind = to_world @ Vector(place - 0.3 * normal)
        assert pick(fitted, bpy.context, behind, target - behind) is None
    wall = bpy.data.meshes.new("wall")
    corners = np.array(taxels.positions_link[0] + 0.05 * taxels.normals_link[0])
    side, up = np.cross(taxels.normals_link[0], (0, 0, 1)), np.array((0, 0, 1.0))
    wall.from_pydata(
        [(corners + a * side + b * up).tolist() for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))], [], [(0, 1, 2, 3)]
    )
    fitted.data = wall
    bpy.context.view_layer.update()
    eye, target = (to_world @ Vector(taxels.positions_link[0] + a * taxels.normals_link[0]) for a in (0.1, 0))
    assert pick(fitted, bpy.context, eye, target - eye) is None


def test_link_is_compared_with_a_file(bpy, ours, fitted, result, tmp_path):
    """The result is lines in the panel and in the view; undo removes them; the plan does not change."""
    path, plan = tmp_path / "moved.csv", ours.plans.read_plan(fitted, bpy.context.scene)
    bpy.ops.skin_calib.export_taxels(filepath=str(path), format="csv")
    header, *rows = path.read_text().splitlines()
    x, label = header.split(",").index("x"), header.split(",").index("id")
    moved = [row.split(",") for row in rows]
    for row in moved:
        row[x] = str(float(row[x]) + (3e-4 if row[label] == "band.1.2" else 1e-4))
    path.write_text("\n".join([header, *(",".join(row) for row in moved)]) + "\n")
    bpy.context.scene.unit_settings.scale_length = 0.001
    bpy.ops.ed.undo_push(message="start")
    assert bpy.ops.skin_calib.compare("EXEC_DEFAULT", True, filepath=str(path)) == {"FINISHED"}
    link = bpy.context.object
    found = link.skin_calib.inspect.comparison
    assert found.remarks.splitlines() == [
        "6 taxels paired by id",
        "Distance: mean 0.1333 mm, max 0.3000 mm at band.1.2",
        "Angle of the normals: mean 0.00°, max 0.00°",
    ]
    assert not found.warnings
    lines, worst = (a for a in ours.drawing.shown_layers(link) if a.what == "COMPARED")
    assert_allclose(
        lines.points[1::2] - lines.points[::2], [(3e-4 if k == 5 else 1e-4, 0, 0) for k in range(6)], atol=2e-8
    )
    assert len(worst.points) == 8
    bpy.context.scene.unit_settings.scale_length = 1.0
    assert ours.plans.read_plan(link, bpy.context.scene) == plan
    bpy.ops.ed.undo()
    link = bpy.context.object
    assert not link.skin_calib.inspect.comparison.file
    assert "COMPARED" not in {a.what for a in ours.drawing.shown_layers(link)}


def test_comparison_ends_on_request_and_with_another_fit(bpy, ours, fitted, tmp_path):
    """Its text stays until then, and belongs to its fit."""
    path = tmp_path / "same.calibration.json"
    bpy.ops.skin_calib.export_calibration(filepath=str(path))
    bpy.ops.skin_calib.compare(filepath=str(path))
    found = fitted.skin_calib.inspect.comparison
    assert "max 0.0000 mm" in found.remarks and found.file == str(path)
    fitted.skin_calib.grid.n += 1
    bpy.ops.skin_calib.fit()
    assert found.remarks and "COMPARED" not in {a.what for a in ours.drawing.shown_layers(fitted)}
    bpy.ops.skin_calib.compare(filepath=str(path))
    assert "COMPARED" in {a.what for a in ours.drawing.shown_layers(fitted)} and "max 0.0000" not in found.remarks
    assert bpy.ops.skin_calib.compare_end.poll()
    bpy.ops.skin_calib.compare_end()
    assert not fitted.skin_calib.inspect.comparison.file and not bpy.ops.skin_calib.compare_end.poll()
    assert "COMPARED" not in {a.what for a in ours.drawing.shown_layers(fitted)}
