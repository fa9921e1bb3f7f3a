"""Several surfaces of one link: one is in the panels, all are in the plan."""

import json
import re

import pytest
from numpy.testing import assert_allclose

from tests.blender.conftest import PLAN, modules
from tests.blender.test_registration import draw

TUBE = {key: PLAN[key] for key in ("cover", "grid") if key in PLAN}
SECTOR = {key: value for key, value in PLAN["grid"].items() if key in ("axis", "margin")} | {
    "kind": "patch",
    "n": 5,
    "lines": 7,
    "from": -1.0,
    "to": 1.25,
}


@pytest.fixture
def two(bpy, plan_file):
    """Return the file of a plan with two surfaces and a skin on each, which is imported."""
    path = plan_file()
    document = json.loads(path.read_text())
    for key in ("cover", "grid", "degree", "chords", "max_deviation"):
        document.pop(key, None)
    surfaces = [{"name": "all"} | TUBE, {"name": "front", "grid": SECTOR, "degree": [3, 2], "max_deviation": 0.004}]
    patch = PLAN["skins"][0] | {"name": "patch", "surface": "front", "rows": 1, "columns": 2, "origin": "center"}
    patch.pop("first_channel", None)
    path.write_text(json.dumps(document | {"version": 2, "surfaces": surfaces, "skins": [PLAN["skins"][0], patch]}))
    bpy.ops.skin_calib.import_plan(filepath=str(path))
    return path


@pytest.mark.slow
def test_same_bytes_leave_all_doors(bpy, two, fit_plainly, fit_scene, document):
    """The scene gives what the file gives, whichever surface the panels show, also after save and reload."""
    expected, written = fit_plainly(two), document(bpy.context.object)
    for index in (0, 1, 0):
        assert bpy.ops.skin_calib.surface_show(index=index) == {"FINISHED"}
        shown = bpy.context.object.skin_calib
        assert (shown.surface_name, shown.grid.kind) == (("all", "tube"), ("front", "sector"))[index]
        assert document(bpy.context.object) == written and fit_scene() == expected
    assert [s["name"] for s in written["surfaces"]] == ["all", "front"] and written["surfaces"][1]["degree"] == [3, 2]
    assert written["surfaces"][1]["max_deviation"] == 0.004


def test_surfaces_are_added_changed_and_removed(bpy, link, document):
    """A new surface is a copy of the shown one; a surface with a skin on it stays; each step is undone."""
    assert document(link)["version"] == 1
    with pytest.raises(RuntimeError, match="Move it to another surface first"):
        bpy.ops.skin_calib.surface_remove()
    link.skin_calib.skins.clear()
    with pytest.raises(RuntimeError, match="only one"):
        bpy.ops.skin_calib.surface_remove()
    bpy.ops.skin_calib.skin_add(kind="sheet")
    bpy.ops.skin_calib.surface_add()
    link.skin_calib.surface_name = "upper"
    link.skin_calib.grid.n = 7
    bpy.ops.skin_calib.skin_surface(skin=0, name="upper")
    found = document(link)
    assert (found["version"], [s["name"] for s in found["surfaces"]]) == (2, ["cover", "upper"])
    assert [s["grid"]["n"] for s in found["surfaces"]] == [PLAN["grid"]["n"], 7]
    assert found["skins"][0]["surface"] == "upper"
    with pytest.raises(RuntimeError, match="Move it to another surface first"):
        bpy.ops.skin_calib.surface_remove()
    bpy.ops.skin_calib.skin_surface(skin=0, name="cover")
    bpy.ops.skin_calib.surface_remove()
    assert "surfaces" not in document(link) and document(link)["skins"][0]["surface"] == "cover"
    assert link.skin_calib.grid.n == PLAN["grid"]["n"]


def test_both_surfaces_are_fitted_and_drawn(bpy, addon, two):
    """Fit shows the figures of both; the overlay has lines of both, and one heat map."""
    bpy.ops.skin_calib.fit()
    link = bpy.context.object
    result = addon.results.find(link.skin_calib.result.key)
    assert (
        list(result.fits) == ["all", "front"]
        and link.skin_calib.result.taxels == len(result.calibration.patches) * 2 + 4
    )
    points = [fit.offsets.size for fit in result.fits.values()]
    assert link.skin_calib.result.control_points == sum(points)
    layers = {layer.what: layer for layer in addon.drawing.layers_now(link).shown({"ERROR", "NET"})}
    assert layers["ERROR"].indices.max() == len(layers["ERROR"].points) - 1
    assert len(layers["ERROR"].points) == len(layers["ERROR"].colours)


def test_mean_of_several_surfaces_is_that_of_the_least_exact_one(bpy, two, capfd):
    """State, step Fit and report say so; with one surface there is nothing to say."""
    bpy.ops.skin_calib.fit()
    assert re.match(r"Mean 0\.\d{4} mm \(least exact surface\), ", " ".join(draw(bpy, "status")))
    assert "Mean: of the least exact surface" in " ".join(draw(bpy, "fit"))
    assert re.search(r"mean error 0\.\d{4} mm \(least exact surface\)\n", capfd.readouterr().out)
    bpy.ops.skin_calib.skin_remove(index=1)
    bpy.ops.skin_calib.surface_show(index=1)
    bpy.ops.skin_calib.surface_remove()
    bpy.ops.skin_calib.fit()
    shown = " ".join((*draw(bpy, "status"), *draw(bpy, "fit"), capfd.readouterr().out))
    assert "least exact" not in shown


def test_showing_a_surface_keeps_result_and_check(bpy, two):
    """The plan is the same: the link stays fitted and checked."""
    plan = bpy.context.object.skin_calib
    bpy.ops.skin_calib.diagnose()
    bpy.ops.skin_calib.fit()
    bpy.ops.skin_calib.surface_show(index=1)
    assert not plan.result.outdated and not plan.diagnosis.outdated
    plan.grid.n = 6
    bpy.ops.skin_calib.surface_show(index=0)
    assert plan.result.outdated and plan.diagnosis.outdated


def test_advice_is_followed_on_the_surface_of_the_warning(bpy, two, extension):
    """Cut Here cuts the surface that the warning names, and shows it; the other one stays as it was."""
    advice = modules(extension, "live.advice").advice
    written = modules(extension, "scene.warnings").warnings
    plan = bpy.context.object.skin_calib
    place = written.Place(point=(0.04, 0.01, 0.06), surface="front")
    for code, text in (("off-mesh", "Cut Here"), ("folded", "Cut Here"), ("EmptySection", "Widen the Margin")):
        bpy.ops.skin_calib.surface_show(index=0)  # a tube; the other one is a sector already
        written.write_warnings(plan.result.warnings, [written.Warning(code, "warning", "front", place)])
        plan.result.key = "key"
        shown = draw(bpy, "status")
        assert shown[-1] == "Do What It Advises", shown
        (action, _), *_ = advice.offered(advice.warning_at(plan.id_data, 0), plan, 1.0)
        assert action.text == text
        assert bpy.ops.skin_calib.take_advice(index=0) == {"FINISHED"}
        assert plan.surface_name == "front"
    assert len(plan.cover.cuts) == 2 and not plan.grid.auto_margin
    assert_allclose(plan.cover.cuts[0].point, (0.04, 0.01, 0.06), atol=1e-6)
    bpy.ops.skin_calib.surface_show(index=0)
    assert not plan.cover.cuts and plan.grid.auto_margin == ("margin" not in TUBE["grid"])
    plan.result.warnings[0].surface = "renamed"
    assert not list(advice.offered(advice.warning_at(plan.id_data, 0), plan, 1.0))
    assert bpy.ops.skin_calib.take_advice(index=0) == {"CANCELLED"}


def test_warnings_and_refusals_name_their_surface(bpy, two, extension):
    """Those of a fit, and of a refused one, as the status needs them for its button; the panels show the other one."""
    advice, plan = modules(extension, "live.advice").advice, bpy.context.object.skin_calib
    bpy.ops.skin_calib.surface_show(index=1)
    plan.grid.n, plan.grid.lines, plan.grid.start = 4, 4, -2.9
    bpy.ops.skin_calib.surface_show(index=0)
    bpy.ops.skin_calib.fit()
    found = {w.surface for w in plan.result.warnings if w.code == "off-mesh"}
    assert found == {"front"}
    bpy.ops.skin_calib.surface_show(index=1)
    plan.grid.start, plan.grid.stop = -3.1, 3.1
    bpy.ops.skin_calib.surface_show(index=0)
    with pytest.raises(RuntimeError, match="Surface 'front'"):
        bpy.ops.skin_calib.fit()
    assert advice.warning_at(plan.id_data, advice.REFUSAL).where.surface == "front"
    assert draw(bpy, "status")[0] == "The fit is refused"


def test_boundary_is_kept_in_the_scene(bpy, plan_file, fit_plainly, fit_scene, document):
    """Its numbers are exact; planes by hand would lose it, and are refused until it is removed."""
    loop = [[0.04, -0.011111111111, 0.04], [0.04, 0.02, 0.04], [0.04, 0.02, 0.08], [0.04, -0.01, 0.08]]
    grid = SECTOR | {"boundary": [loop]}
    grid.pop("margin")
    path = plan_file(grid=grid, skins=[])
    bpy.ops.skin_calib.import_plan(filepath=str(path))
    assert document(bpy.context.object)["grid"]["boundary"] == [loop] and fit_scene() == fit_plainly(path)
    assert "Remove Boundary" in draw(bpy, "grid")
    with pytest.raises(RuntimeError, match="cannot have a boundary"):
        bpy.ops.skin_calib.planes_place()
    bpy.ops.skin_calib.boundary_remove()
    assert "boundary" not in document(bpy.context.object)["grid"] and "Remove Boundary" not in draw(bpy, "grid")


def test_drawn_lines_end_at_the_boundary(bpy, addon, plan_file):
    """Sections, lines, curves and heat map of a surface stay inside its loops, and come close to them."""
    loop = [[0.045, 0.01, 0.05], [0.02, 0.04, 0.05], [0.02, 0.04, 0.1], [0.045, 0.01, 0.1]]
    bpy.ops.skin_calib.import_plan(filepath=str(plan_file(grid=SECTOR | {"boundary": [loop]}, skins=[])))
    bpy.ops.skin_calib.fit()
    link = bpy.context.object
    result = addon.results.find(link.skin_calib.result.key)
    fit, layers = result.fit, {layer.what: layer for layer in addon.drawing.layers_of(result)}
    for name in ("SECTIONS", "LINES", "SURFACE"):
        points = layers[name].points.astype(float)
        middles, ends = points.reshape(-1, 2, 3).mean(axis=1), points[:, 2]
        assert len(points) > 20 and fit.lines.region(middles).all(), name
        assert ends.min() > 0.05 - 1e-3 and ends.max() < 0.1 + 1e-3, name
    assert layers["SURFACE"].points[:, 2].min() < 0.05 + 1e-3
    heat = layers["ERROR"]
    assert fit.lines.region(heat.points[heat.indices].astype(float)).any(axis=1).all() and len(heat.indices) > 20
