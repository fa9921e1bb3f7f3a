"""What a fit reports about itself: its warnings, the places it does not trust, and the fits that are refused."""

import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from skin_calib_addon.common.errors import PoorFit
from skin_calib_addon.geometry import (
    AcrossGrid,
    Planes,
    PlanesGrid,
    SectorGrid,
    TubeGrid,
    fit_surface,
    fit_to_tolerance,
)
from skin_calib_addon.geometry.fit import diagnosis
from skin_calib_addon.geometry.fit import fitting as fit_module
from skin_calib_addon.geometry.mesh.distance import closest
from tests.shapes import (
    LENGTH,
    RADIUS,
    TURN,
    Z_AXIS,
    box,
    cone,
    cylinder,
    dome,
    hinged_planes,
    keep,
    round_tube,
    sheet,
    together,
    u_planes,
    weld,
    with_hole,
    wrist,
)

GRID = TubeGrid(8, 16, Z_AXIS, 0.004, "uniform")
HOLE, WIDE = np.array((RADIUS, 0.0, 0.05)), 0.012


@pytest.fixture(scope="module")
def holed():
    """A fit of a tube with a round hole."""
    return fit_surface(with_hole(cylinder(), HOLE, WIDE), TubeGrid(14, 30, Z_AXIS, 0.004, "uniform"))


def with_fin(height, at=1.0):
    """A tube whose own wall protrudes at an angle, over a fifth of its length."""
    return round_tube(lambda a, h: RADIUS + height * ((np.abs(a - at) < 0.1) & (h > 0.4) & (h < 0.6)), 192, 52)


@cache
def with_step(at):
    """A tube that is wider by 30 mm from a fraction of its length on."""
    return round_tube(lambda a, h: RADIUS + 0.03 * (h > at), 192, 52)


def tilted_planes(degrees):
    """A closed grid with one v-plane that is some degrees from parallel to the u-planes."""
    low = np.deg2rad(degrees)
    normals = np.array(((1.0, 0, 0), (0, 1.0, 0), (0, np.sin(low), np.cos(low))))
    return PlanesGrid(u_planes(np.linspace(0.02, 0.08, 6)), Planes(np.zeros((3, 3)) + (0, 0, 0.05), normals), True)


def named(message, lines):
    """The place, the u-plane and the v-line that a message names."""
    x, y, z, i, name = re.search(
        r"\((\S+), (\S+), (\S+)\) mm, near u-plane (\d+) and (half-plane at [\d.]+ degrees|v-plane \d+)\.", message
    ).groups()
    return np.array((x, y, z), float) * 1e-3, int(i), lines.v_names.index(name)


def assert_names_go_together(message, lines):
    """The place is next to the u-plane that is named and within 12 degrees of the line, half a step of 16 lines."""
    place, i, j = named(message, lines)
    station = (lines.planes_u.points - place) @ lines.planes_u.normals[0]
    assert np.abs(station[i]) <= np.abs(np.diff(station)).max()
    arm = place - lines.origins[i, j]
    arm -= arm @ lines.planes_u.normals[i] * lines.planes_u.normals[i]
    assert arm @ lines.directions[i, j] > np.cos(np.deg2rad(12)) * np.linalg.norm(arm)


def assert_one_line_with_advice(message):
    """One line that says what to do."""
    assert "\n" not in message and len(message) < 300
    assert re.search(r"\. (Close the hole|Cut away|Move|Rotate|Lower)\b", message)


@pytest.mark.parametrize(
    ("mesh", "grid"),
    [
        (wrist(), TubeGrid(10, 20, margin=0.002)),
        (wrist(), SectorGrid(8, 12, -1.0, 1.5, Z_AXIS, 0.004)),
        (dome(), AcrossGrid(8, 8, (0, 0, 1.0))),
        (cylinder(), GRID),
    ],
)
def test_good_fit_has_no_warnings(mesh, grid):
    """A tube, a part of one, a face: nothing to look at, every place is trusted, nothing is left aside."""
    fit = fit_surface(mesh, grid)
    assert fit.warnings == () and fit.converged and fit.missing == 0
    assert fit.is_trusted(np.random.default_rng(0).uniform(0, 1, (200, 2))).all()
    assert_array_equal(fit.dropped_loops, np.zeros(len(fit.residuals), int))


@pytest.mark.parametrize("degree", [3, (2, 5)])
@pytest.mark.parametrize("grid", [TubeGrid(6, 9, Z_AXIS, 0.01), SectorGrid(6, 7, -1.0, 1.5, Z_AXIS, 0.01)])
def test_condition_is_that_of_the_dense_matrix(grid, degree):
    """The least squares written out, a row per sample and a column per control point."""
    fit = fit_surface(wrist(), grid, degree)
    assert_allclose(fit.condition, np.linalg.cond(np.kron(fit.basis.N, fit.basis.B)), rtol=1e-9)


def test_dropped_loops_are_counted_row_by_row():
    """An inner tube and a bolt outside, each over a part of the length: no, one or two curves in each section."""
    inner = keep(cylinder(0.02), lambda c: c[:, 2] < 0.051)
    bolt = box((RADIUS + 0.002, -0.003, 0.043), (RADIUS + 0.007, 0.003, 0.083))
    fit = fit_surface(together(cylinder(), inner, bolt), GRID)
    z = fit.samples.origins[:, 0, 2]
    assert_array_equal(fit.dropped_loops, 1 * (z < inner.vertices[:, 2].max()) + ((z > 0.043) & (z < 0.083)))
    assert {*fit.dropped_loops.tolist()} == {0, 1, 2}
    (warning,) = fit.warnings
    assert warning.code == "dropped-curves" and "up to 2 curves that" in warning.message


def test_parts_that_are_all_followed_are_not_dropped():
    """A tube with a window on either side: two curves in the sections through them, and the surface follows both."""
    windows = keep(cylinder(), lambda c: (np.abs(c[:, 1]) > 0.012) | (np.abs(c[:, 2] - 0.05) > 0.015))
    fit = fit_surface(windows, GRID)
    assert fit.missing > 0.05
    assert_array_equal(fit.dropped_loops, np.zeros(len(fit.residuals), int))


def test_hole_is_a_warning_with_its_fraction_and_place(holed):
    """One line: the fraction of the samples, and a point over the hole with the adjacent planes."""
    (warning,) = holed.warnings
    assert (warning.code, warning.severity, warning.value) == ("missing-samples", "warning", holed.missing)
    text = str(warning)
    assert (
        text.startswith(f"{holed.missing:.1%} of the sample rays do not hit the mesh") and 0.01 < holed.missing < 0.05
    )
    assert np.linalg.norm(warning.where.point - HOLE) < WIDE
    assert np.linalg.norm(named(text, holed.lines)[0] - HOLE) < WIDE
    assert_names_go_together(text, holed.lines)
    assert_one_line_with_advice(text)


def test_hole_is_not_trusted_and_all_else_is(holed):
    """Footpoints over the hole are not trusted; those further from it than a sample's distance are."""
    uv = np.random.default_rng(2).uniform(0, 1, (2000, 2))
    away = np.linalg.norm(holed.surface.points(uv) - HOLE, axis=1)
    step = max(0.092 / (len(holed.residuals) - 1), TURN * RADIUS / holed.residuals.shape[1])
    trusted = holed.is_trusted(uv)
    assert not trusted[away < WIDE - step].any() and (away < WIDE - step).sum() > 10
    assert trusted[away > WIDE + 2 * step].all()
    assert trusted.tolist() == [bool(holed.is_trusted(one)) for one in uv.tolist()]


def test_nothing_next_to_a_missing_sample_is_trusted(holed):
    """The middles of all four cells about a ray that met nothing."""
    missed = np.isnan(holed.residuals)
    k, l = missed.shape
    row, column = np.nonzero(missed)
    for i, j in ((-0.5, -0.5), (-0.5, 0.5), (0.5, -0.5), (0.5, 0.5)):
        assert not holed.is_trusted(np.column_stack(((row + i) / (k - 1), ((column + j) / l) % 1))).any()
    known = [(i, j) for i in range(k - 1) for j in range(l - 1) if not missed[i : i + 2, j : j + 2].any()]
    assert holed.is_trusted((np.array(known) + 0.5) / (k - 1, l)).all()


def test_two_holes_are_one_line_with_the_larger_one_named():
    """The place is in the larger of two holes, not between them."""
    small = np.array((-RADIUS, 0.0, 0.03))
    mesh = with_hole(with_hole(cylinder(), HOLE, WIDE), small, 0.006)
    fit = fit_surface(mesh, TubeGrid(14, 30, Z_AXIS, 0.004, "uniform"))
    (warning,) = (w for w in fit.warnings if w.severity == "warning")
    assert np.linalg.norm(named(str(warning), fit.lines)[0] - HOLE) < WIDE


@pytest.mark.parametrize("tilt", [3.1, 8.0, 9.9])
def test_planes_that_hardly_cross_are_a_warning(tilt):
    """The two planes and their angle; from ten degrees on, none."""
    lines = tilted_planes(tilt).line_grid(cylinder())
    (warning,) = lines.warnings
    pattern = (
        rf"The angle between u-plane \d+ and v-plane 2 is only {tilt} degrees\. .* Rotate one of them\. \[planes-n"
    )
    assert re.match(pattern, str(warning))
    assert warning.code == "planes-nearly-parallel" and abs(np.rad2deg(warning.value) - tilt) < 0.01
    assert_one_line_with_advice(str(warning))
    assert tilted_planes(10.1).line_grid(cylinder()).warnings == ()


@pytest.mark.parametrize("open_from", [0.045, 0.09])
@pytest.mark.parametrize("margin", [None, 0.002])
@pytest.mark.parametrize("kind", ["tube", "sector", "auto"])
def test_automatic_margin_that_leaves_most_of_a_tube_is_a_warning(kind, margin, open_from):
    """Length, position of the end and advice; none where little is left out, and none with a margin of the author."""
    mesh = keep(cylinder(along=40), lambda c: (c[:, 2] < open_from) | (c[:, 0] < 0) | (np.abs(c[:, 1]) > 0.008))
    if kind == "auto":
        warnings = fit_to_tolerance(mesh, 0.01, axis=Z_AXIS, margin=margin).warnings
    else:
        grid = TubeGrid(6, 16) if kind == "tube" else SectorGrid(6, 6, -0.5, 0.5)
        grid = replace(grid, region=replace(grid.region, axis=Z_AXIS, margin=margin))
        warnings = grid.line_grid(mesh).warnings
    found = [warning for warning in warnings if warning.code == "short-surface"]
    assert len(found) == (margin is None and open_from < LENGTH / 2)
    for warning in found:
        text = r"The surface covers 4\d\.\d mm of the 100\.0 mm of the mesh along the axis\. Beyond the end at"
        assert re.match(text, str(warning))
        assert_allclose((warning.value, warning.where.point[2]), (0.45, 0.045), rtol=0.05)
        assert warning.where.names == "the last u-plane" and re.search(
            r"sections are open at \d+ degrees", str(warning)
        )
        assert_one_line_with_advice(str(warning))


@pytest.mark.parametrize(("size", "at"), [((8, 16), 1.0), ((14, 40), 4.0)])
def test_fin_of_the_wall_is_refused_with_its_place(size, at):
    """The wall protrudes by 60 mm: no surface follows, and the message names the point and the adjacent planes."""
    mesh, grid = with_fin(0.06, at), TubeGrid(*size, Z_AXIS, 0.004, "uniform")
    with pytest.raises(
        PoorFit, match=r"^The surface is \d+\.\d mm \(limit 10 mm\) off the mesh at .*\. Cut away"
    ) as caught:
        fit_surface(mesh, grid)
    message, lines = str(caught.value), grid.line_grid(mesh)
    place = named(message, lines)[0]
    foot = np.array((RADIUS * np.cos(at), RADIUS * np.sin(at), np.clip(place[2], 0.04, 0.06)))
    # The fin is radial: the distance next to it is independent of the radius.
    outward = foot * (1, 1, 0) / RADIUS
    assert np.linalg.norm(place - foot - max((place - foot) @ outward, 0) * outward) < 0.015
    assert_names_go_together(message, lines)
    assert_one_line_with_advice(message)
    stated = float(re.search(r"is (\S+) mm", message)[1])
    assert_allclose(caught.value.numbers["distance"] * 1e3, stated, atol=0.051)
    assert caught.value.numbers["distance"] > diagnosis.MAX_DEVIATION


@pytest.mark.parametrize(("at", "n"), [(0.3, 7), (0.7, 12)])
def test_warning_has_the_maximum_of_the_report(at, n):
    """Where a tube becomes wider, the fit succeeds; one measure and one place in warning, report and heat map."""
    fit = fit_surface(with_step(at), TubeGrid(n, 16, Z_AXIS, 0.004, "uniform"))
    (warning,) = fit.warnings
    text = str(warning)
    assert warning.value == fit.errors.surface_to_mesh.max >= np.nanmax(fit.deviations)
    assert_allclose(warning.where.point, fit.worst[1], rtol=0, atol=1e-12)
    assert warning.code == "off-mesh" and abs(warning.where.point[2] - LENGTH * at) < 0.016
    assert f"is {warning.value * 1e3:.1f} mm (limit 2 mm) off the mesh at" in text and "Cut away what" in text
    assert_names_go_together(text, fit.lines)
    assert_one_line_with_advice(text)


@pytest.mark.parametrize("scale", [0.2, 3.0])
def test_limits_are_lengths_and_not_fractions_of_the_mesh(scale):
    """The same shape, smaller and larger: no warning below 2 mm, refused above 10 mm."""
    mesh = with_step(0.3)
    mesh, grid = weld(scale * mesh.vertices, mesh.faces), TubeGrid(8, 16, Z_AXIS, scale * 0.004, "uniform")
    fit = fit_surface(mesh, grid, max_deviation=1.0)
    at_sites = closest(mesh, (fit.samples.origins + fit.samples.arms).reshape(-1, 3))[0].max()
    distance = fit.errors.surface_to_mesh.max
    assert fit.warnings == () and 4.5e-3 < at_sites / scale <= distance / scale < 5.3e-3
    if at_sites > 0.01:  # the report, which looks between the sites, comes after a refusal
        with pytest.raises(PoorFit, match=rf"is {at_sites * 1e3:.1f} mm \(limit 10 mm\) off the mesh at"):
            fit_surface(mesh, grid)
        return
    assert fit_surface(mesh, grid).warnings == ()


def test_limits_follow_the_value_of_the_user():
    """The surface is 4.54 mm off: refused below this value, warned of above a fifth of the value."""
    mesh, grid = with_step(0.3), TubeGrid(8, 16, Z_AXIS, 0.004, "uniform")
    with pytest.raises(PoorFit, match=r"is 4\.5 mm \(limit 4\.4 mm\) off the mesh"):
        fit_surface(mesh, grid, max_deviation=0.0044)
    for allowed, codes in ((0.0046, ["off-mesh"]), (0.028, [])):
        assert [w.code for w in fit_surface(mesh, grid, max_deviation=allowed).warnings] == codes


def test_limits_follow_a_tolerance():
    """A tolerance of the maximum is the limit; ten times one of the mean can lower it. A tolerance is not refused."""
    limits = diagnosis.DeviationLimits
    assert limits.of(0.01) == limits(0.002, 0.01) == limits()
    assert limits.of(0.01, 0.0005, "max") == limits(0.0005, 0.01)
    assert limits.of(0.01, 0.0001, "mean") == limits(0.001, 0.01)
    assert limits.of(0.01, 0.0005, "mean") == limits(0.002, 0.01)
    assert limits.of(0.01, 0.0050, "mean") == limits(0.005, 0.01)
    assert limits.of(0.01, 0.02, "max") == limits(0.02, 0.02)
    assert limits.of(0.03, 0.001, "mean") == limits(0.006, 0.03)
    mesh = with_step(0.3)
    fit = fit_to_tolerance(mesh, 0.00015, axis=Z_AXIS, margin=0.004)
    assert_allclose((fit.limits.warned, fit.limits.refused), (0.0015, 0.01))
    distance = closest(mesh, (fit.samples.origins + fit.samples.arms).reshape(-1, 3))[0].max()
    assert [w.code for w in fit.warnings if w.code == "off-mesh"] == (["off-mesh"] if distance > 0.0015 else [])


def test_number_in_a_message_is_above_its_limit():
    """A distance just above the limit has as many digits as show it."""
    assert diagnosis.off(0.00213, 0.002) == "2.1 mm (limit 2 mm) off"
    assert diagnosis.off(0.002004, 0.002) == "2.004 mm (limit 2 mm) off"
    assert diagnosis.off(0.000502, 0.0005) == "0.502 mm (limit 0.5 mm) off"


@pytest.mark.parametrize("inward", [False, True])
def test_maximum_deviation_is_a_distance_and_not_along_the_ray(inward):
    """On a flat cone, whose facets the rays hit at 27 degrees, for both windings: the distance to its triangles."""
    mesh = cone(0.045, 0.005, length=0.02)
    fit = fit_surface(mesh, TubeGrid(5, 5, Z_AXIS, 0.003, "uniform"), 4)
    mesh = weld(mesh.vertices, mesh.faces[:, ::-1]) if inward else mesh
    fit = fit_surface(mesh, fit.lines, 4)
    distance, place = diagnosis.maximum_deviation(mesh, fit.lines, fit.basis, fit.samples, 0.02 * mesh.size)
    exact = closest(mesh, (fit.samples.origins + fit.samples.arms).reshape(-1, 3))[0].max()
    assert_allclose(distance, exact, rtol=0.1)
    assert distance < 0.6 * np.abs(fit.residuals).max() and place.words.startswith("at (")


def test_box_through_the_wall_is_not_followed():
    """A thin box that protrudes and is not connected to the tube: dropped and counted, with a warning and its place."""
    fin = box((0.03, -0.002, 0.05), (0.08, 0.002, 0.06))
    fit = fit_surface(together(cylinder(), fin), GRID)
    radius = np.linalg.norm(fit.surface.points(np.random.default_rng(3).uniform(0, 1, (200, 2)))[:, :2], axis=1)
    assert np.abs(radius - RADIUS).max() < 1e-3 * RADIUS
    assert fit.dropped_loops.max() == 1
    (warning,) = fit.warnings
    assert warning.code == "dropped-curves" and "up to 1 curve that" in warning.message
    x, y, z = warning.where.point
    assert 0.03 <= x <= 0.08 and abs(y) <= 0.002 + 1e-9 and 0.05 - 1e-9 <= z <= 0.06
    assert_allclose(warning.value, 2 * (0.05 + 0.004), rtol=1e-9)
    near = int(re.search(r"u-plane (\d+)", warning.where.names)[1])
    assert near == np.abs(fit.lines.origins[:, 0, 2] - z).argmin()


@pytest.mark.parametrize("n", [5, 14])
def test_surface_that_closes_to_a_point_is_a_warning(n):
    """A cone up to its tip: the lines come together, and it says so however many planes there are."""
    fit = fit_surface(cone(RADIUS + 1e-6, 1e-6, along=40), TubeGrid(n, 16, Z_AXIS, 1e-4))
    (warning,) = fit.warnings
    assert warning.code == "nearly-folded" and warning.value == fit.smallest_area
    assert warning.where.point[2] > 0.95 * LENGTH
    assert warning.message.startswith("The surface nearly folds or closes to a point")
    assert warning.advice == "Move planes apart, or increase the margin."


@pytest.mark.parametrize("n", [6, 12])
def test_surface_folded_by_crossing_planes_is_an_error(n):
    """u-planes that cross inside of the tube turn the surface inside out on one side: an error with its place."""
    fit = fit_surface(cylinder(), hinged_planes(-0.02, np.deg2rad(np.linspace(-40, 40, n))))
    uv = np.random.default_rng(4).uniform(0, 1, (500, 2))
    inward = (fit.surface.normals(uv) * fit.surface.points(uv) * (1, 1, 0)).sum(axis=1) < 0
    assert 0.2 < inward.mean() < 0.5
    (folded,) = (w for w in fit.warnings if w.code == "folded")
    assert folded.severity == "error" and re.search(r" at \(.*\) mm, near u-plane \d+ and ", folded.message)
    x, y, _ = folded.where.point
    nearest = np.abs(fit.surface.points(uv) - folded.where.point).sum(axis=1).argsort()[:3]
    assert inward[nearest].any(), "the place is where the surface is turned over"


def test_planes_are_left_out_of_their_neighbourhood_only(monkeypatch):
    """Of 24 planes, a surface without one has at most 20, and the error differs by less than a thousandth."""
    mesh = cylinder(around=24, along=6)
    fit, counts, fit_lines = fit_surface(mesh, TubeGrid(24, 12, Z_AXIS, 0.01)), [], fit_module.fit_lines

    def counted(mesh, lines, degree):
        counts.append(len(lines.planes_u))
        return fit_lines(mesh, lines, degree)

    monkeypatch.setattr(fit_module, "fit_lines", counted)
    near = fit_module.leave_one_out(fit)
    assert len(near) == len(counts) == 22 and max(counts) == 20
    monkeypatch.setattr(fit_module, "NEAR_PLANES", 40)
    assert_allclose(near, fit_module.leave_one_out(fit), rtol=1e-3)


def test_planes_that_cannot_be_spared_are_not_left_out():
    """As many planes as the degree needs: no error without one of them; one more plane, and there are errors."""
    for planes, errors in ((4, 0), (5, 3)):
        fit = fit_surface(cylinder(around=24, along=6), TubeGrid(planes, 12, Z_AXIS, 0.01))
        assert len(fit_module.leave_one_out(fit)) == errors


def test_rays_outside_of_a_round_outline_pass_no_hole():
    """The corners of a square grid over a round sheet: an own warning, and none of a hole."""
    disc = keep(
        sheet(lambda x, y: 0 * x, (0.1, 0.1), (60, 60)), lambda c: np.linalg.norm(c[:, :2] - 0.05, axis=1) < 0.05
    )
    (warning,) = fit_surface(disc, AcrossGrid(8, 8, (0, 0, 1))).warnings
    assert warning.code == "outside-outline" and warning.value == pytest.approx(1 - np.pi / 4, abs=0.06)
    assert "pass outside of the outline of the mesh" in warning.message
