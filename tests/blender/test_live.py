"""Live updates: surface and skin follow the plan; files, undo steps and other links are not affected."""

import importlib
from threading import Event

import pytest

from tests.blender.conftest import BAND, look, modules
from tests.blender.test_registration import draw


@pytest.fixture
def following(bpy, link, addon):
    """Return a fitted link with Live on."""
    bpy.ops.skin_calib.fit()
    bpy.context.object.skin_calib.live = True
    return bpy.context.object


def rest(updates, monkeypatch):
    """Run the timer until the complete fit has ended."""
    while updates.tick() is not None:
        monkeypatch.setattr(updates, "FIT_DELAY", 0.0)


def test_surface_and_skin_follow_a_change(bpy, addon, updates, following, monkeypatch, state_of):
    """A preview with its mean error is drawn at once; after a delay the result is that of the button."""
    plan = following.skin_calib
    before = plan.result.key
    plan.grid.n += 2
    assert plan.result.outdated and bpy.app.timers.is_registered(updates.tick)
    look(updates)
    assert state_of(following).layers and plan.result.key == before
    assert 0 < state_of(following).report.mean < 1e-3
    rest(updates, monkeypatch)
    assert not state_of(following).layers and not state_of(following).report and not plan.result.outdated
    followed = plan.result.key, plan.result.mean
    bpy.ops.skin_calib.fit()
    assert (plan.result.key, plan.result.mean) == followed and followed[0] != before


@pytest.mark.parametrize("live", [True, False])
def test_enabled_again_the_extension_follows_the_open_file(
    bpy, extension, addon, updates, following, monkeypatch, live
):
    """Live goes on; without it a mesh that was changed in the meantime makes the result outdated."""
    import addon_utils

    following.skin_calib.live = live
    addon_utils.disable(extension)
    following.data.vertices[0].co.z += 1e-4
    bpy.context.view_layer.update()
    addon_utils.enable(extension)
    ours = modules(extension, "registration", "live.diagnoses")
    ours.registration.resume()
    monkeypatch.setattr(ours.diagnoses, "CHECK_DELAY", 0.0)
    while ours.diagnoses.verify() is not None:
        pass
    rest(updates, monkeypatch)
    result = bpy.context.object.skin_calib.result
    assert bool(addon.results.find(result.key)) == live and result.outdated == (not live)


def test_change_of_a_skin_needs_no_other_surface(bpy, addon, updates, preview, following, monkeypatch, state_of):
    """Changes of the skin use the last surface; planes and mesh need a new one."""
    fits = []
    monkeypatch.setattr(preview, "fit_grid", lambda *words, real=preview.fit_grid: fits.append(1) or real(*words))
    plan = following.skin_calib
    plan.grid.n += 1
    look(updates)
    for rows in (1, 3):
        plan.skins[0].rows = rows
        look(updates)
        cells = next(a for a in state_of(following).layers if a.what == "CELLS")
        assert len(cells.points) == rows * plan.skins[0].columns * 8
    assert len(fits) == 1
    following.data.vertices[0].co.z += 1e-4
    plan.skins[0].rows = 2
    look(updates)
    plan.grid.n += 1
    look(updates)
    assert len(fits) == 3
    rest(updates, monkeypatch)
    assert not plan.result.outdated


def test_plan_that_cannot_be_fitted_says_why_and_recovers(updates, following, monkeypatch, state_of):
    """The last result stays; the next valid plan is drawn again."""
    plan = following.skin_calib
    key = plan.result.key
    plan.skins[0].rows = 900
    rest(updates, monkeypatch)
    assert "beyond the edge" in state_of(following).report.problem
    assert plan.result.key == key and plan.result.outdated
    plan.skins[0].rows = 2
    rest(updates, monkeypatch)
    assert not state_of(following).report and not plan.result.outdated


def test_boards_that_are_searched_for_follow_with_the_fit(bpy, addon, updates, following, monkeypatch, state_of):
    """A preview leaves them out, with the skin whose channels follow theirs; listed boards are drawn."""
    plan = following.skin_calib
    bpy.ops.skin_calib.skin_add(kind="hexagons")
    bpy.ops.skin_calib.skin_add(kind="sheet")
    sheet, boards, other = plan.skins
    sheet.rows, sheet.columns, boards.side, other.rows, other.columns = 1, 2, 0.01, 1, 3
    look(updates)
    report, skins = state_of(following).report, state_of(following).layers.taxels
    assert report.refusal is None and report.left_out and len(skins.ids) == 2
    assert "Boards, errors and warnings follow when the changes end" in " ".join(draw(bpy, "status"))
    rest(updates, monkeypatch)
    count = plan.result.taxels - 5
    assert count > 3 and not state_of(following).report
    boards.choice, boards.cells = "listed", "0,0 1,0"
    look(updates)
    assert not state_of(following).report.left_out
    assert len(state_of(following).layers.taxels.ids) == 7


@pytest.mark.slow
def test_fine_sheet_is_interpolated_in_the_preview_and_exact_in_the_file(
    bpy, addon, updates, plan_file, fit_plainly, tmp_path, monkeypatch, state_of
):
    """The final state of Live has the bytes of the command line; the status of the preview says that it is not."""
    fine = BAND | {"rows": 12, "columns": 45, "pitch": [0.002, 0.003]}
    source = plan_file(skins=[fine | {"columns": 44}])
    bpy.ops.skin_calib.import_plan(filepath=str(source))
    bpy.ops.skin_calib.fit()
    link = bpy.context.object
    link.skin_calib.live = True
    for columns in (43, 44, 45):
        link.skin_calib.skins[0].columns = columns
        look(updates)
        assert state_of(link).report.interpolated and draw(bpy, "status")[0].startswith("Preview: mean 0.")
        assert "Cells are interpolated. " in " ".join(draw(bpy, "status"))
        assert len(state_of(link).layers.taxels.ids) == 12 * columns
    rest(updates, monkeypatch)
    assert not state_of(link).report and not link.skin_calib.result.outdated
    out = tmp_path / "live.json"
    assert bpy.ops.skin_calib.export_calibration(filepath=str(out)) == {"FINISHED"}
    assert out.read_bytes() == fit_plainly(plan_file(skins=[fine]))


def cut_at(plan, height):
    """Add a cut that keeps what is above a height [m]."""
    cut = plan.cover.cuts.add()
    cut.point, cut.normal = (0.0, 0.0, height), (0.0, 0.0, 1.0)
    return cut


def test_cut_that_moves_takes_the_lines_of_the_last_fit_along(bpy, updates, preview, following, monkeypatch, state_of):
    """Neither axis nor spacing is sought while it moves; the surface is near the exact one, which follows."""
    plan, fits = following.skin_calib, []
    plan.grid.spacing = "auto"
    cut = cut_at(plan, 0.004)
    rest(updates, monkeypatch)
    monkeypatch.setattr(updates, "FIT_DELAY", 60.0)
    real = preview.fit_grid
    monkeypatch.setattr(preview, "fit_grid", lambda *given: fits.append(1) or real(*given))
    for height in (0.005, 0.006):
        cut.point[2] = height
        look(updates)
        report = state_of(following).report
        assert report.refusal is None and report.coarse and not fits
    moving = report.mean
    plan.skins[0].columns += 1
    look(updates)
    report = state_of(following).report
    assert fits == [1] and not report.coarse and abs(moving - report.mean) < 0.5 * report.mean
    rest(updates, monkeypatch)
    followed = plan.result.mean
    bpy.ops.skin_calib.fit()
    assert plan.result.mean == followed


def test_cut_that_moves_removes_faces_of_a_coarse_mesh_until_the_fit(
    updates, preview, following, monkeypatch, state_of
):
    """The removed part has few faces while the cut moves; with the complete fit it is that of the mesh."""
    clustering = importlib.import_module(preview.__name__.replace("blender.live.preview", "geometry.mesh.clustering"))
    monkeypatch.setattr(clustering, "COARSE_FACES", 60)
    cut = cut_at(following.skin_calib, 0.03)
    rest(updates, monkeypatch)

    def removed():
        (layer,) = [layer for layer in state_of(following).sketch.layers if layer.colours is not None]
        return len(layer.points) // 3

    exact = removed()
    monkeypatch.setattr(updates, "FIT_DELAY", 60.0)
    cut.point[2] = 0.0301
    look(updates)
    assert state_of(following).report.coarse and 0 < removed() < exact / 2
    rest(updates, monkeypatch)
    assert removed() == exact


def test_cut_that_moves_leaves_other_surfaces_as_they_are(bpy, updates, preview, following, monkeypatch, state_of):
    """Of two surfaces, only the one with the cut is fitted again; planes placed one by one are fitted exactly."""
    plan, fits = following.skin_calib, []
    cut_at(plan, 0.004)
    bpy.ops.skin_calib.surface_add()
    rest(updates, monkeypatch)
    monkeypatch.setattr(updates, "FIT_DELAY", 60.0)
    for name in ("fit_grid", "fit_surface"):
        real = getattr(preview, name)
        monkeypatch.setattr(preview, name, lambda *given, name=name, real=real: fits.append(name) or real(*given))
    look(updates)
    fits.clear()
    plan.cover.cuts[0].point[2] = 0.005
    look(updates)
    assert fits == ["fit_surface"] and state_of(following).report.coarse
    bpy.ops.skin_calib.planes_place()
    look(updates)
    fits.clear()
    plan.cover.cuts[0].point[2] = 0.0055
    look(updates)
    report = state_of(following).report
    assert fits == ["fit_grid"] and report.refusal is None and not report.coarse


def test_large_mesh_has_a_coarse_preview_and_an_exact_fit(bpy, updates, preview, following, monkeypatch, state_of):
    """The status says so; where only the exact surface can be fitted, the preview has this one."""
    fits, plan = [], following.skin_calib
    monkeypatch.setattr(preview, "MAX_EXACT_FACES", 100)

    def refusing(*words, real=preview.fit_grid):
        fits.append(words[-1])
        if words[-1] and len(fits) > 1:
            raise preview.SkinCalibError("no sample")
        return real(*words)

    monkeypatch.setattr(preview, "fit_grid", refusing)
    for coarse, expected in ((True, [True]), (False, [True, True, False])):
        plan.grid.n += 1
        look(updates)
        report = state_of(following).report
        assert report.coarse == coarse and report.refusal is None and fits == expected
        assert ("The surface is coarse. " in " ".join(draw(bpy, "status"))) == coarse
    rest(updates, monkeypatch)
    followed = plan.result.mean
    bpy.ops.skin_calib.fit()
    assert plan.result.mean == followed and len(fits) == 3


OTHER = {
    "mesh": lambda link: setattr(link.data.vertices[0], "co", link.data.vertices[0].co * 1.001),
    "modifier": lambda link: setattr(link.modifiers.new("thicker", "DISPLACE"), "strength", 1e-4),
    "scale": lambda link: setattr(link, "scale", (1, 1, 1.01)),
}


def test_undo_removes_the_preview(bpy, addon, updates, following, monkeypatch, state_of):
    """The link is then updated to the restored plan."""
    bpy.ops.ed.undo_push(message="before")
    following.skin_calib.grid.n = 14
    bpy.ops.ed.undo_push(message="after")
    look(updates)
    assert state_of(following).layers
    bpy.ops.ed.undo()
    link = bpy.context.object
    assert not state_of(link).layers and link.skin_calib.grid.n != 14
    rest(updates, monkeypatch)
    assert not link.skin_calib.result.outdated


@pytest.mark.parametrize(("name", "follow"), [("mesh", False), ("modifier", True), ("scale", False), ("scale", True)])
def test_other_mesh_modifier_or_scale_outdates_the_result(bpy, updates, link, name, follow, monkeypatch):
    """This is for links with and without Live; edits without an effect do not count."""
    bpy.ops.skin_calib.fit()
    link = bpy.context.object
    link.skin_calib.live = follow
    for act in (lambda link: None, OTHER[name]):
        rest(updates, monkeypatch)
        assert not link.skin_calib.result.outdated
        key = link.skin_calib.result.key
        act(link)
        link.data.update()
        bpy.context.view_layer.update()
        updates.tick()
    assert link.skin_calib.result.outdated
    rest(updates, monkeypatch)
    assert link.skin_calib.result.outdated != follow
    assert (link.skin_calib.result.key != key) == follow


def test_mesh_that_changes_during_a_fit_is_fitted_again(bpy, updates, following, monkeypatch):
    """The result of the mesh before is not shown as that of the new one."""
    go_on, begun, sizes = Event(), Event(), []

    def slowly(plan, mesh, begin, real=updates.results.fit):
        begun.set()
        go_on.wait(20)
        sizes.append(mesh.size)
        return real(plan, mesh, begin)

    plan = following.skin_calib
    monkeypatch.setattr(updates.results, "fit", slowly)
    plan.grid.n = 8
    look(updates)
    monkeypatch.setattr(updates, "FIT_DELAY", 0.0)
    assert updates.tick() == updates.POLL_INTERVAL and begun.is_set()
    for vertex in following.data.vertices:
        vertex.co *= 1.01
    bpy.context.view_layer.update()
    updates.tick()
    go_on.set()
    rest(updates, monkeypatch)
    assert not plan.result.outdated and sizes[-1] > 1.009 * sizes[0]


def test_link_that_does_not_follow_is_never_fitted(bpy, updates, link, monkeypatch, state_of):
    """Its cuts are sketched, but only the button fits it."""
    bpy.ops.skin_calib.fit()
    key = link.skin_calib.result.key
    monkeypatch.setattr(updates, "FIT_DELAY", 0.0)
    bpy.context.scene.cursor.location = (0, 0, 0.03)
    bpy.ops.skin_calib.cut_add()
    rest(updates, monkeypatch)
    assert state_of(link).sketch and link.skin_calib.result.outdated and link.skin_calib.result.key == key


def test_mesh_that_changes_by_reading_is_compared_once(bpy, updates, link, monkeypatch, state_of):
    """Blender evaluates an object with nodes again when its property is written or its mesh is read."""
    bpy.ops.skin_calib.fit()
    looks = []

    def touching(link, context, before=None, real=updates.link_meshes.read_facets):
        looks.append(link.name)
        assert len(looks) < 9, "endless comparison"
        state_of(link).is_touched = True
        return real(link, context, before)

    monkeypatch.setattr(updates.link_meshes, "read_facets", touching)
    link.scale = (1, 1, 1.01)
    bpy.context.view_layer.update()
    updates._compare_touched(list(updates.session.links()))
    assert looks == ["arm"] and link.skin_calib.result.outdated


def test_mesh_with_other_polygons_around_the_same_corners_is_another_mesh(bpy, updates):
    """Two polygons of three and four corners are divided into other triangles than those of four and three."""
    vertices = [(0, 0, 0), (0.1, 0, 0), (0.1, 0.1, 0), (0, 0.1, 0.02), (0, 0, 0.1), (0.1, 0, 0.1), (0.1, 0.1, 0.1)]
    link = bpy.data.objects.new("two", bpy.data.meshes.new("two"))
    bpy.context.scene.collection.objects.link(link)
    read = [None]
    for polygons in ([(0, 1, 2), (3, 4, 5, 6)], [(0, 1, 2, 3), (4, 5, 6)], [(0, 1, 2, 3), (4, 5, 6)]):
        link.data.clear_geometry()
        link.data.from_pydata(vertices, [], polygons)
        bpy.context.view_layer.update()
        read.append(updates.link_meshes.read_facets(link, bpy.context, read[-1]))
    assert (read[1].corners == read[2].corners).all() and (read[1].vertices == read[2].vertices).all()
    assert read[2] is not read[1] and read[3] is read[2]
    assert [len(found.faces) for found in read[1:]] == [3, 3, 3] and (read[1].faces != read[2].faces).any()
    link.data.clear_geometry()
    bpy.context.view_layer.update()
    assert len(updates.link_meshes.read_facets(link, bpy.context, read[-1]).faces) == 0
