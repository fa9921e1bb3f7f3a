"""The error model of a mesh, and the positions of planes and lines with the least error."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from sample_scenes.shapes import tube_mesh
from skin_calib_addon.common.errors import EmptySection
from skin_calib_addon.geometry import AcrossGrid, Planes, PlanesGrid, SectorGrid, TubeGrid, fit_surface, weld
from skin_calib_addon.geometry.grid import spacing
from skin_calib_addon.geometry.grid.error_model import PROFILES, ErrorModel
from skin_calib_addon.geometry.grid.misfits import filled, interpolated, moving_part, periodic_lengths, span_errors
from skin_calib_addon.geometry.grid.parametrizations import FaceParametrization, TubeParametrization, parametrized_lines
from skin_calib_addon.geometry.grid.spacing import (
    equalized_maps,
    limited_move,
    line_positions,
    plane_positions,
    positions_at,
    rotated_map,
)
from skin_calib_addon.geometry.mesh.distance import closest
from skin_calib_addon.geometry.sampling.basis import spline_sites
from skin_calib_addon.geometry.sampling.frames import frame_of
from skin_calib_addon.geometry.surface.distance import surface_samples
from tests.examples import examples
from tests.shapes import (
    LENGTH,
    RADIUS,
    TURN,
    Z_AXIS,
    Motion,
    cone,
    cylinder,
    dome,
    keep,
    sheet,
    welded,
    with_hole,
    wrist,
)

seeds = st.integers(0, 2**32 - 1)


def tube(radius, around=96, along=26):
    """A tube about z of this radius by angle and fraction of its length."""

    def point(angle, fraction):
        r = radius(angle, fraction)
        return np.column_stack((r * np.cos(angle), r * np.sin(angle), LENGTH * fraction))

    return welded(tube_mesh(point, around, along))


def square(power=8):
    """A tube whose section is a square with corners that are the less rounded the higher the power."""
    return tube(lambda a, h: RADIUS / (np.abs(np.cos(a)) ** power + np.abs(np.sin(a)) ** power) ** (1 / power), 240)


def bumped(at=0.9):
    """A round tube with a ring around it near one end."""
    return tube(lambda a, h: RADIUS + 0.008 * np.exp(-(((h - at) / 0.06) ** 2)), 72, 101)


def ridged():
    """A flat sheet with a narrow ridge along x near its far side."""
    return sheet(lambda x, y: 0.02 + 0.006 * np.exp(-(((y - 0.068) / 0.005) ** 2)), cells=(20, 160))


def error_model_of(mesh, grid):
    """As the grid itself looks at a mesh."""
    return ErrorModel.of(mesh, grid.region.parametrization(mesh), grid.size.n)


def even_places(grid, error_model):
    """Even s and t."""
    parametrization = error_model.parametrization
    n, lines = grid.size.n, grid.size.lines
    last = lines if parametrization.closed else lines - 1
    return np.linspace(*parametrization.span, n), parametrization.breadth[0] + np.ptp(
        parametrization.breadth
    ) * np.arange(lines) / last


def true_error(mesh, parametrization, s, t):
    """Root mean square distance from the surface on lines at s and t to the mesh, by triangles [m]."""
    surface = fit_surface(mesh, parametrized_lines(parametrization, s, t)).surface
    uv, weights = surface_samples(surface)
    distance = closest(mesh, surface.points(uv))[0]
    return float(np.sqrt(weights @ distance**2 / weights.sum()))


def flat_heights(profiles, outlines):
    """An error model of a face of 100 x 80 mm with these heights, rows over s and t from 0 to the ends."""
    parametrization = FaceParametrization(np.zeros(3), *np.eye(3), (0.0, 0.1), (0.0, 0.08))
    t, s = np.linspace(0, 0.08, outlines.shape[1]), np.linspace(0, 0.1, profiles.shape[1])
    return ErrorModel(parametrization, t, outlines, np.ones_like(outlines), s, profiles, np.ones_like(profiles))


@examples(15)
@given(slope=st.tuples(*3 * [st.floats(-0.5, 0.5)]), degree=st.integers(2, 5), seed=seeds)
def test_error_model_error_of_a_slope_is_none(slope, degree, seed):
    """Any places of planes across a slope leave nothing but rounding, along and across."""
    a, b, c = slope
    s, t = np.linspace(0, 0.1, 30), np.linspace(0, 0.08, 50)
    heights = a + b * s[None, :] + c * np.linspace(0, 0.08, PROFILES)[:, None]
    error_model = flat_heights(heights, a + b * np.linspace(0, 0.1, 3)[:, None] + c * t)
    rng = np.random.default_rng(seed)
    for error, end in ((error_model.error_along, 0.1), (error_model.error_across, 0.08)):
        places = np.r_[0.0, np.sort(rng.uniform(0.1, 0.9, 7)), 1.0] * end
        left, energy = error(places, degree)
        assert left < 1e-14 and len(energy) == 9 - degree and energy.max() < 1e-28


@pytest.mark.parametrize("degree", [2, 3, 5])
def test_error_model_error_of_a_closed_spline_is_none(degree):
    """An outline that is a spline on its own lines: what is left is that of the straight steps between heights."""
    count, rng = 12, np.random.default_rng(1)
    t = TURN * np.sort(np.arange(count) / count + rng.uniform(-0.02, 0.02, count) * (np.arange(count) > 0))
    parametrization = TubeParametrization(frame_of(np.zeros(3), np.array((0, 0, 1.0))), (0.0, 0.1))
    dense = spline_sites(count, degree, True, 600)
    at, radius = (x[0] for x in parametrization.blend(dense.values, t, RADIUS + 0.003 * rng.uniform(-1, 1, (1, count))))
    order, outline_t = np.argsort(at), TURN * np.arange(720) / 720
    outlines = np.tile(np.interp(outline_t, at[order], radius[order], period=TURN), (2, 1))
    rows = np.full((3, 30), RADIUS)
    error_model = ErrorModel(
        parametrization, outline_t, outlines, 0 * outlines + 1, np.linspace(0, 0.1, 30), rows, 0 * rows + 1
    )
    error = error_model.error_across(t, degree)[0]
    assert error < 5e-6 < 0.05 * error_model.error_across(TURN * np.arange(count) / count, degree)[0]


@pytest.mark.parametrize(
    ("mesh", "grid"),
    [
        pytest.param(square(20), TubeGrid(6, 20, Z_AXIS, 0.004), id="square"),
        pytest.param(bumped(), TubeGrid(10, 16, Z_AXIS, 0.004), id="bump"),
        pytest.param(ridged(), AcrossGrid(6, 12, (0, 0, 1.0), (1.0, 0, 0)), id="ridge"),
    ],
)
def test_places_leave_less_than_even_ones(mesh, grid):
    """By the error model and by the true distance of fits; both have the same order."""
    error_model = error_model_of(mesh, grid)
    parametrization, (s, t) = error_model.parametrization, even_places(grid, error_model)
    chosen = (
        plane_positions(error_model, grid.size.n, "auto", 3),
        line_positions(error_model, grid.size.lines, "auto", 3),
    )
    pairs = ((s, t), chosen)
    stated = [np.hypot(error_model.error_along(a, 3)[0], error_model.error_across(b, 3)[0]) for a, b in pairs]
    true = [true_error(mesh, parametrization, a, b) for a, b in ((s, t), chosen)]
    assert stated[1] < 0.2 * stated[0] and true[1] < 0.2 * true[0]


@pytest.mark.parametrize(
    ("mesh", "lines"),
    [
        pytest.param(square(), 12, id="square 12"),
        pytest.param(square(), 20, id="square 20"),
        pytest.param(square(4), 16, id="rounder square 16"),
        pytest.param(tube(lambda a, h: RADIUS * (1 + 0.2 * np.cos(3 * a)), 240), 12, id="clover 12"),
    ],
)
def test_auto_lines_are_no_worse_than_even_ones_by_fits(mesh, lines):
    """On sections that are far from round, by the true distance: the fit confirms the prediction."""
    grid = TubeGrid(5, lines, Z_AXIS, 0.004)
    error_model = error_model_of(mesh, grid)
    s, even = even_places(grid, error_model)
    auto, uniform = (
        true_error(mesh, error_model.parametrization, s, t)
        for t in (line_positions(error_model, lines, "auto", 3), even)
    )
    assert auto <= 1.05 * uniform


def test_places_are_where_the_shape_is():
    """Most lines at the four corners, most planes about the ring, most v-planes about the ridge."""
    t = line_positions(error_model_of(square(), TubeGrid(6, 20, Z_AXIS, 0.004)), 20, "auto", 3)
    corner = np.abs((t + np.pi / 4) % (np.pi / 2) - np.pi / 4)  # angle zero is at a corner
    assert (corner < np.deg2rad(20)).sum() >= 12  # of 20; even ones would be 9
    s = plane_positions(error_model_of(bumped(), TubeGrid(10, 16, Z_AXIS, 0.004)), 10, "auto", 3)
    assert (s > 0.07).sum() >= 5  # of 10; even ones would be 3
    t = line_positions(error_model_of(ridged(), AcrossGrid(6, 12, (0, 0, 1.0), (1.0, 0, 0))), 12, "auto", 3)
    assert (np.abs(t - 0.068) < 0.009).sum() >= 7  # of 12; even ones would be 2


@pytest.mark.parametrize("at", [0.1, 0.9])
def test_mirrored_mesh_takes_mirrored_places(at):
    """The ring at one end or at the other: no end is preferred."""
    places = [
        plane_positions(error_model_of(bumped(x), TubeGrid(10, 16, Z_AXIS, 0.004)), 10, "auto", 3) for x in (at, 1 - at)
    ]
    assert_allclose(places[0], LENGTH - places[1][::-1], atol=1e-6)


@pytest.mark.parametrize("mesh", [cylinder(), cone(), cone(0.03, 0.045)])
@pytest.mark.parametrize("lines", [8, 13, 16])
def test_symmetric_shapes_keep_even_angles(mesh, lines):
    """Nothing is gained on a round tube: even planes, and even angles from angle zero on, to the bit."""
    error_model = error_model_of(mesh, TubeGrid(6, lines, Z_AXIS))
    assert_array_equal(line_positions(error_model, lines, "auto", 3), TURN * (np.arange(lines) / lines))
    assert_array_equal(plane_positions(error_model, 6, "auto", 3), np.linspace(*error_model.parametrization.span, 6))


def test_flat_sheet_keeps_even_planes():
    """Nothing is gained on a plane either: even u-planes, v-lines the same from both sides."""
    error_model = error_model_of(sheet(lambda x, y: 0.1 + 0.2 * x - 0.1 * y), AcrossGrid(6, 5, (0, 0, 1.0)))
    assert_array_equal(plane_positions(error_model, 6, "auto", 3), np.linspace(*error_model.parametrization.span, 6))
    t = line_positions(error_model, 5, "auto", 3)
    assert_allclose(t[[0, -1]], error_model.parametrization.breadth, rtol=1e-14)
    assert_allclose(t - t[0], t[-1] - t[::-1], atol=1e-14)


@pytest.mark.parametrize("hole", [0.01, 0.02])
def test_gaps_do_not_attract_planes(hole):
    """A hole in a round tube leaves even places even; planes for a ring and a hole away from it are as
    good for the ring alone as its own."""
    holed = with_hole(cylinder(), (RADIUS, 0, 0.04), hole)
    error_model = error_model_of(holed, TubeGrid(8, 16, Z_AXIS, 0.004))
    assert (error_model.outlines_known == 0).any() and (error_model.profiles_known == 0).any()
    assert_array_equal(plane_positions(error_model, 8, "auto", 3), np.linspace(*error_model.parametrization.span, 8))
    assert_allclose(np.diff(line_positions(error_model, 16, "auto", 3)), TURN / 16, rtol=1e-4)
    grid = TubeGrid(10, 16, Z_AXIS, 0.004)
    whole, holed = (error_model_of(m, grid) for m in (bumped(), with_hole(bumped(), (RADIUS, 0, 0.03), hole)))
    places = [plane_positions(error_model, 10, "auto", 3) for error_model in (whole, holed)]
    left = [whole.error_along(s, 3)[0] for s in (*places, np.linspace(0.004, 0.096, 10))]
    assert left[1] < 1.3 * left[0] < 0.1 * left[2]


def test_gaps_in_a_face_do_not_attract_planes():
    """A hole in a flat sheet: even planes stay."""
    flat = sheet(lambda x, y: 0.02 + 0 * x)
    grid = AcrossGrid(8, 8, (0, 0, 1.0), (1.0, 0, 0))
    whole, holed = (error_model_of(m, grid) for m in (flat, with_hole(flat, (0.03, 0.03, 0.02), 0.015)))
    assert (holed.outlines_known == 0).any()
    assert_array_equal(plane_positions(holed, 8, "auto", 3), np.linspace(*holed.parametrization.span, 8))
    assert_allclose(line_positions(holed, 8, "auto", 3), line_positions(whole, 8, "auto", 3), rtol=1e-14)


def test_error_model_of_nothing_is_refused():
    """No ray hits the mesh: the message has one line and states what to do."""
    with pytest.raises(EmptySection, match="No ray of the grid hits the mesh. Move the axis into the mesh") as caught:
        filled(np.full((3, 4), np.nan), True)
    assert "\n" not in str(caught.value)


def test_lengths_about_uneven_angles_add_up_to_a_turn():
    """Half of the distance between the two neighbours, across the seam as well; the sense does not matter."""
    angles = np.array((0.0, 1.0, 2.5, 3.5, 5.0))
    expected = np.array((TURN - 4.0, 2.5, 2.5, 2.5, TURN - 3.5)) / 2
    assert_allclose(periodic_lengths(angles), expected)
    assert_allclose(periodic_lengths(-angles), expected)
    assert_allclose(periodic_lengths(angles).sum(), TURN)


def test_gaps_are_bridged_by_straight_lines():
    """Along the row, over the seam where it is closed; an empty row is taken from the next that is not."""
    nan = np.nan
    heights = np.array(((nan, 2.0, nan, 4.0), (nan, nan, nan, nan), (1.0, 1.0, 1.0, 1.0)))
    assert_allclose(filled(heights, False), ((2, 2, 3, 4), (2, 2, 3, 4), (1, 1, 1, 1)))
    assert_allclose(filled(heights, True)[0], (3, 2, 3, 4))
    assert np.isnan(heights[0, 0])  # the caller's own stay as they are


@given(seed=seeds, closed=st.booleans())
def test_heights_between_places_are_interpolated(seed, closed):
    """As numpy does one row at a time, round the seam where it is closed."""
    rng = np.random.default_rng(seed)
    known = 0.3 + np.arange(9) * 0.7
    heights, wanted = rng.normal(size=(2, 9)), rng.uniform(0.3, 0.3 + (9 if closed else 8) * 0.7, (2, 20))
    expected = [np.interp(w, known, row, period=9 * 0.7 if closed else None) for w, row in zip(wanted, heights)]
    assert_allclose(interpolated(heights, known, wanted, closed), expected, atol=1e-12)


def test_error_is_shared_over_what_is_not_fitted():
    """Twelve sites of which four went into unknowns; sites next to a gap do not count, nor does their span."""
    residuals, met = np.full((1, 12), 2.0), np.ones((1, 12), bool)
    error, spans = span_errors(residuals, met, 4, 3, True)
    assert_allclose(error, 2 / np.sqrt(1 - 4 / 12))
    assert_allclose(spans, (4, 4, 4))
    met[0, 4:9], residuals[0, 4:9] = False, 100.0
    error, spans = span_errors(residuals, met, 4, 3, True)
    assert_allclose(error, 2 / np.sqrt(1 - 4 / 12))
    assert_allclose(spans, (4, 0, 4))
    assert span_errors(residuals, met & False, 4, 3, True)[0] == 0.0


@pytest.mark.parametrize(
    ("mesh", "grid"),
    [
        pytest.param(wrist(), TubeGrid(9, 14, Z_AXIS, 0.004), id="tube"),
        pytest.param(with_hole(wrist(), (0.04, 0, 0.04), 0.01), TubeGrid(9, 14, Z_AXIS, 0.004), id="holed tube"),
        pytest.param(dome(), AcrossGrid(7, 8, (0, 0, 1.0)), id="face"),
    ],
)
def test_choices_of_places_are_judged_together_as_one_by_one(mesh, grid):
    """The errors of even places and of some that lie elsewhere, at once and each by itself."""
    error_model, rng = error_model_of(mesh, grid), np.random.default_rng(1)
    pairs = (error_model.errors_along, error_model.error_along), (error_model.errors_across, error_model.error_across)
    for (together, alone), places in zip(pairs, even_places(grid, error_model)):
        step = places[1] - places[0]
        choices = places + np.r_[0.0, np.ones(len(places) - 2), 0.0] * rng.uniform(-step, step, (5, len(places))) / 3
        assert_allclose(together(choices, 3), [alone(choice, 3)[0] for choice in choices], rtol=1e-9)


@given(seed=seeds, spans=st.integers(2, 9), closed=st.booleans())
def test_errors_of_a_mirrored_row_are_mirrored(seed, spans, closed):
    """A site on a knot belongs to both spans: no end is preferred."""
    residuals = np.random.default_rng(seed).normal(size=(2, 3 * spans + (not closed)))
    mirrored = np.roll(residuals[:, ::-1], 1, axis=1) if closed else residuals[:, ::-1]
    (error, energy), (again, other) = (
        span_errors(r, np.ones(r.shape, bool), 4, spans, closed) for r in (residuals, mirrored)
    )
    assert_allclose(again, error, rtol=1e-12)
    assert_allclose(other, energy[::-1], rtol=1e-12)
    assert energy.shape == (spans,)


@given(seed=seeds, closed=st.booleans(), spans=st.integers(2, 12))
def test_evened_maps_are_maps(seed, closed, spans):
    """Whatever the errors: they rise from 0 to 1, from the first place to the last, and there is an error for each."""
    rng = np.random.default_rng(seed)
    start = (np.array((0.0, 1.0)), np.array((0.2, 0.9)))

    def error(places, degree):
        return float(places.sum()), rng.exponential(size=spans) ** 8

    fractions = np.linspace(0, 1, spans + 3)
    maps, errors = equalized_maps(error, start, fractions, 3, closed)
    assert maps[0] is start and len(maps) == len(errors) > 1
    for (fraction, places), left in zip(maps, errors):
        assert (np.diff(fraction) > 0).all() and (np.diff(places) > 0).all()
        assert_allclose(fraction[[0, -1]], (0, 1), atol=1e-15)
        assert_allclose(places[[0, -1]], (0.2, 0.9), rtol=1e-14)
        assert left == positions_at((fraction, places), fractions).sum()


@pytest.mark.parametrize("closed", [False, True])
def test_spans_get_shorter_where_the_error_is(closed):
    """A span of a hundred times the error of all others is the shortest after a round, and symmetry stays."""
    start = (np.array((0.0, 1.0)), np.array((0.0, 1.0)))
    energy = np.array((1.0, 1, 1, 100, 1, 1, 1))
    maps, _ = equalized_maps(lambda places, degree: (1.0, energy), start, np.linspace(0, 1, 10), 3, closed)
    lengths = np.diff(positions_at(maps[1], np.linspace(0, 1, 8)))
    assert np.argmin(lengths) == 3 and lengths[3] < 0.8 * lengths[0]
    assert_allclose(lengths, lengths[::-1], rtol=1e-9)
    same, errors = equalized_maps(lambda places, degree: (0.0, 0 * energy), start, np.linspace(0, 1, 10), 3, closed)
    assert same == [start] and errors == [0.0]


@pytest.mark.parametrize("closed", [False, True])
@given(seed=seeds)
def test_moved_places_stay_in_order_and_apart(closed, seed):
    """However far a step goes: ends stay, no interval loses more than about half or falls below a tenth of the mean."""
    rng = np.random.default_rng(seed)
    places = 0.2 + np.cumsum(rng.uniform(0.3, 1, 9)) / 10
    edges = (places[0], places[0] + 1.2) if closed else (places[0], places[-1])
    step = rng.normal(size=9) * 10 ** rng.uniform(-3, 0) * (1 if closed else np.r_[0, np.ones(7), 0])
    after = limited_move(places, places + step, edges, closed)
    intervals = [np.append(np.diff(x), x[0] + 1.2 - x[-1]) if closed else np.diff(x) for x in (places, after)]
    assert_allclose(intervals[1].sum(), intervals[0].sum(), rtol=1e-12)
    assert (intervals[1] > 0).all() and (closed or (after[[0, -1]] == edges).all())
    slight = limited_move(places, places + 1e-3 * step / np.abs(step).max(), edges, closed)
    assert_allclose(slight, places + 1e-3 * step / np.abs(step).max(), rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("mesh", "grid"),
    [
        pytest.param(wrist(), TubeGrid(9, 14, Z_AXIS, 0.004), id="tube"),
        pytest.param(dome(), AcrossGrid(7, 8, (0, 0, 1.0)), id="face"),
    ],
)
def test_slopes_are_differences(mesh, grid):
    """The derivatives by the positions of planes and lines agree with differences of the residuals."""
    error_model = error_model_of(mesh, grid)
    for slopes, places in zip((error_model.slopes_along, error_model.slopes_across), even_places(grid, error_model)):
        residuals, change = slopes(places, 3)
        direction = 1e-4 * np.ptp(places) * np.eye(len(places))[1:-1]
        both = [(slopes(places + w, 3)[0], slopes(places - w, 3)[0]) for w in direction]
        differences = np.array([(a - b) / (2 * w.max()) for (a, b), w in zip(both, direction)]).T
        downhill, expected = change[:, 1:-1].T @ residuals, differences.T @ residuals
        assert downhill @ expected > 0.98 * np.linalg.norm(downhill) * np.linalg.norm(expected)


@pytest.mark.parametrize("lines", [12, 20, 40])
def test_noise_does_not_attract_lines(lines):
    """A noisy round tube keeps even lines and planes: half of the model does not confirm the other half."""
    tube = cylinder()
    noise = 3e-4 * np.random.default_rng(0).standard_normal(len(tube.vertices))
    noisy = weld(tube.vertices + noise[:, None] * tube.vertices * (1, 1, 0) / RADIUS, tube.faces)
    error_model = error_model_of(noisy, TubeGrid(8, lines, Z_AXIS, 0.004))
    assert_array_equal(line_positions(error_model, lines, "auto", 3), TURN * (np.arange(lines) / lines))
    assert_array_equal(plane_positions(error_model, 8, "auto", 3), np.linspace(*error_model.parametrization.span, 8))


@given(seed=seeds, fraction=st.floats(0, 0.999))
def test_turned_map_is_the_map_started_elsewhere(seed, fraction):
    """Fractions count from the rotated start, across the seam."""
    rng = np.random.default_rng(seed)
    fractions = np.r_[0.0, np.sort(rng.uniform(0.05, 0.95, 6)), 1.0]
    places = 1.3 + TURN * np.r_[0.0, np.sort(rng.uniform(0.05, 0.95, 6)), 1.0]
    after = rotated_map((fractions, places), fraction)
    assert_allclose(after[0][[0, -1]], (0, 1), atol=1e-12)
    wanted = np.linspace(0, 1, 41)
    period = np.r_[fractions, 1 + fractions[1:]], np.r_[places, TURN + places[1:]]
    assert_allclose(positions_at(after, wanted), np.interp(fraction + wanted, *period), atol=1e-9)


def test_uniform_lines_are_even():
    """Planes and lines, of a tube, a sector and a face."""
    for mesh, grid in (
        (wrist(), TubeGrid(7, 9, Z_AXIS, 0.004, "uniform")),
        (wrist(), SectorGrid(7, 9, -1.0, 1.5, Z_AXIS, 0.004, "uniform")),
        (dome(), AcrossGrid(7, 9, (0, 0, 1.0), spacing="uniform")),
    ):
        error_model = error_model_of(mesh, grid)
        expected = parametrized_lines(error_model.parametrization, *even_places(grid, error_model))
        lines = grid.line_grid(mesh)
        assert_allclose(lines.origins, expected.origins, atol=1e-15)
        assert_allclose(lines.directions, expected.directions, atol=1e-14)
        spaced = plane_positions(error_model, 7, "uniform", 3), line_positions(error_model, 9, "uniform", 3)
        assert_allclose(spaced[0], even_places(grid, error_model)[0], rtol=1e-14)
        assert_allclose(spaced[1], even_places(grid, error_model)[1], rtol=1e-14)


def test_arc_lines_are_even_along_the_outline():
    """A flat ellipse: angles are uneven, lengths of the outline between the lines are even to a hundredth."""
    ellipse = tube(lambda a, h: 0.015 * 0.045 / np.hypot(0.015 * np.cos(a), 0.045 * np.sin(a)), 360, 6)
    grid = TubeGrid(5, 24, Z_AXIS, 0.004, "arc")
    error_model = error_model_of(ellipse, grid)
    t = np.r_[line_positions(error_model, 24, "arc", 3), TURN]
    dense = t[:-1, None] + np.diff(t)[:, None] * np.linspace(0, 1, 200)
    radius = 0.015 * 0.045 / np.hypot(0.015 * np.cos(dense), 0.045 * np.sin(dense))  # angle zero at a tip
    points = np.stack((radius * np.cos(dense), radius * np.sin(dense)), axis=-1)
    length = np.linalg.norm(np.diff(points, axis=1), axis=2).sum(axis=1)
    assert_allclose(length, length.mean(), rtol=0.01)
    assert np.diff(t).max() > 3 * np.diff(t).min()
    station = grid.line_grid(ellipse).planes_u.points[:, 2]
    assert_allclose(station, np.linspace(0.004, 0.096, 5), rtol=1e-12)  # the u-planes stay even


def test_curvature_lines_are_dense_at_corners():
    """On the rounded square each corner has more of them than each side, and all four alike."""
    error_model = error_model_of(square(), TubeGrid(6, 40, Z_AXIS, 0.004))
    t = line_positions(error_model, 40, "curvature", 3)
    step = np.interp(np.arange(8) * np.pi / 4, t, np.gradient(t), period=TURN)
    assert (step[::2] < 0.6 * step[1::2]).all()
    assert_allclose(step[::2], step[0], rtol=0.15)
    assert {*error_model.maps} == {"uniform", "arc", "curvature"}


def test_flat_face_has_no_curvature_map():
    """A plane asked for curvature gets even lines."""
    error_model = error_model_of(sheet(lambda x, y: 0.02 + 0 * x), AcrossGrid(6, 7, (0, 0, 1.0)))
    flat = replace(error_model, outlines=np.full_like(error_model.outlines, 0.1))
    assert "curvature" not in flat.maps
    assert_allclose(
        line_positions(flat, 7, "curvature", 3), np.linspace(*error_model.parametrization.breadth, 7), rtol=1e-12
    )


@pytest.mark.parametrize("tilt", [0.0, 0.3])
def test_author_planes_are_kept_to_the_bit(tilt):
    """Uneven u-planes and v-planes come out of the fit as they went in, and no line leaves its v-plane."""
    stations, angle = np.array((0.02, 0.023, 0.031, 0.05, 0.052, 0.08)), np.array((0.1, 0.5, 0.6, 1.7, 2.2))
    tilts = np.linspace(-tilt, tilt, 6)
    u = Planes(stations[:, None] * (0, 0, 1.0), np.column_stack((np.sin(tilts), 0 * tilts, np.cos(tilts))))
    v = Planes(np.zeros((5, 3)), np.column_stack((-np.sin(angle), np.cos(angle), 0 * angle)))
    lines = fit_surface(wrist(), PlanesGrid(u, v, True)).lines
    assert lines.planes_u.points.tobytes() == u.points.tobytes()
    assert lines.planes_u.normals.tobytes() == u.normals.tobytes()
    for j, name in enumerate(lines.v_names):
        assert np.abs(lines.directions[:, j] @ v.normals[int(name.removeprefix("v-plane "))]).max() < 1e-15
    assert (lines.origins == lines.origins[:, :1]).all()  # one point of each u-plane, to the bit
    assert np.abs(lines.origins[..., :2]).max() < 1e-14


def test_lines_that_were_placed_are_kept_to_the_bit():
    """Lines of an automatic grid, given again: the very lines, and the very surface."""
    grid = TubeGrid(8, 16, Z_AXIS, 0.004)
    lines = grid.line_grid(wrist())
    fit, again = fit_surface(wrist(), grid), fit_surface(wrist(), lines)
    assert again.lines is lines
    assert fit.surface.control_net.tobytes() == again.surface.control_net.tobytes()


@examples(5)
@given(seed=seeds)
def test_places_move_with_the_mesh(seed):
    """The same places on a mesh that is turned, shifted and scaled."""
    motion = Motion(seed, 1.7)
    here, there = (
        error_model_of(mesh, TubeGrid(8, 14, axis, margin))
        for mesh, axis, margin in (
            (wrist(), Z_AXIS, 0.004),
            (motion.mesh(wrist()), motion.axis(Z_AXIS), 0.004 * motion.scale),
        )
    )
    shift = np.array(plane_positions(there, 8, "auto", 3)) / motion.scale - plane_positions(here, 8, "auto", 3)
    assert_allclose(shift, 0, atol=1e-9)
    assert_allclose(line_positions(there, 14, "auto", 3), line_positions(here, 14, "auto", 3), atol=1e-9)


def test_half_tube_is_spaced_as_a_sector():
    """An open region on half of the rounded square: ends stay at the ends, and fits have less error than even ones."""
    half = keep(square(), lambda c: c[:, 0] > -0.01)
    grid = SectorGrid(5, 14, -1.4, 1.3, Z_AXIS, 0.004)
    error_model = error_model_of(half, grid)
    s, even = even_places(grid, error_model)
    t = line_positions(error_model, 14, "auto", 3)
    assert_allclose(t[[0, -1]], (0, 2.7), atol=1e-12)
    assert (np.diff(t) > 0).all()
    assert true_error(half, error_model.parametrization, s, t) < 0.5 * true_error(
        half, error_model.parametrization, s, even
    )


@pytest.mark.parametrize(
    ("mesh", "size"), [(wrist, (20, 60)), (cylinder, (10, 20)), (cylinder, (20, 60)), (cone, (10, 24))]
)
def test_even_positions_are_kept_where_only_facets_are_left(mesh, size, monkeypatch):
    """No search of positions is made, and a fit along the positions that it would find has no less error.

    Spans are even, not planes: those next to the ends would be three times as long.
    """
    grid = TubeGrid(*size, Z_AXIS, 0.002)
    parametrization = grid.region.parametrization(mesh())
    n, lines = size
    s = np.interp(spacing.control_fractions(n, 3, False), (0, 1), parametrization.span)
    even = fit_surface(mesh(), parametrized_lines(parametrization, s, TURN * np.arange(lines) / lines))
    monkeypatch.setattr(spacing, "MIN_MOVABLE_FRACTION", 0.0)
    searched = fit_surface(mesh(), grid)
    assert searched.to_mesh.mean > 0.99 * even.to_mesh.mean
    monkeypatch.undo()
    monkeypatch.setattr(spacing, "refined_positions", None)
    kept = fit_surface(mesh(), grid)
    assert_allclose(kept.offsets, even.offsets, rtol=0, atol=1e-9)


def test_even_positions_are_kept_over_a_noisy_scan():
    """Noise is no error of the positions, as facets are none."""
    tube = cylinder(around=96, along=52)
    noisy = tube.vertices + np.random.default_rng(3).normal(scale=2e-4, size=tube.vertices.shape)
    model = ErrorModel.of(weld(noisy, tube.faces), TubeGrid(6, 12, Z_AXIS, 0.004).region.parametrization(tube), 6)
    assert max(model.movable_fractions(6, 12, (3, 3))) < 0.2
    exact = ErrorModel.of(tube, TubeGrid(6, 12, Z_AXIS, 0.004).region.parametrization(tube), 6)
    assert model.movable_fractions(6, 12, (3, 3))[0] < 0.5 * exact.movable_fractions(6, 12, (3, 3))[0]


def test_moving_part_is_that_of_the_splines():
    """A common residual and independent errors of the splines: the fraction of the latter is found."""
    rng = np.random.default_rng(5)
    common, first, second = rng.normal(size=(3, 20, 2000))
    whole, moving = moving_part(common + 0.3 * first, common + 0.3 * second)
    assert abs(moving / whole - 0.09 / 1.09) < 0.005


@pytest.mark.parametrize("mesh", [wrist, square], ids=["wrist", "square"])
def test_lines_do_not_depend_on_the_fits_before(mesh):
    """What fits of one mesh have in common is kept for the next one: other numbers of planes change no bit."""
    mesh = mesh()
    for n, lines in ((8, 20), (12, 20), (9, 20), (8, 24), (8, 20)):
        repeated, alone = (
            TubeGrid(n, lines, Z_AXIS, 0.004).line_grid(m) for m in (mesh, weld(mesh.vertices, mesh.faces))
        )
        for name in ("origins", "directions"):
            assert getattr(repeated, name).tobytes() == getattr(alone, name).tobytes()


def test_search_of_lines_is_not_repeated_for_other_numbers_of_planes(monkeypatch):
    """The outlines give the lines, and planes do not move them."""
    mesh, looks, real = wrist(), [], ErrorModel.slopes_across
    monkeypatch.setattr(ErrorModel, "slopes_across", lambda *a: looks.append(1) or real(*a))
    TubeGrid(8, 20, Z_AXIS, 0.004).line_grid(mesh)
    assert looks
    looks.clear()
    TubeGrid(12, 20, Z_AXIS, 0.004).line_grid(mesh)
    assert not looks
