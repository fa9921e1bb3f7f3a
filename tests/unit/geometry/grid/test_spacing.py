"""The positions of planes and lines with the least predicted error."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from skin_calib_addon.common.errors import EmptySection
from skin_calib_addon.geometry import AcrossGrid, SectorGrid, TubeGrid, fit_surface, weld
from skin_calib_addon.geometry.grid.heights import Heights, filled, sampled_heights, widths
from skin_calib_addon.geometry.grid.parametrizations import parametrized_lines
from skin_calib_addon.geometry.grid.spacing import (
    best_positions,
    equalized,
    limited_move,
)
from skin_calib_addon.geometry.mesh.distance import closest
from skin_calib_addon.geometry.mesh.triangle_mesh import TriangleMesh
from skin_calib_addon.geometry.sampling.basis import spline_sites
from skin_calib_addon.geometry.surface.distance import surface_samples
from skin_calib_addon.geometry.surface.footpoints import footpoints
from tests.examples import examples
from tests.shapes import (
    LENGTH,
    RADIUS,
    TURN,
    Z_AXIS,
    cone,
    cylinder,
    dome,
    even_spans,
    round_tube,
    sheet,
    with_hole,
    wrist,
)

seeds = st.integers(0, 2**32 - 1)


def square(power=8):
    """A tube whose section is a square with corners that are the less rounded the higher the power."""
    return round_tube(
        lambda a, h: RADIUS / (np.abs(np.cos(a)) ** power + np.abs(np.sin(a)) ** power) ** (1 / power), 240
    )


@pytest.mark.parametrize("mesh", [cylinder(around=24), cone(), wrist()], ids=["cylinder", "cone", "wrist"])
def test_noise_of_a_nanometre_moves_no_surface(mesh):
    """Lines follow what exceeds the rounding of a mesh file; before, the surface moved by 5 um."""
    noise = 1e-9 * np.random.default_rng(0).standard_normal(mesh.vertices.shape)
    grid = TubeGrid(6, 12, Z_AXIS, 0.004)
    plain, noisy = (fit_surface(m, grid).surface for m in (mesh, TriangleMesh(mesh.vertices + noise, mesh.faces)))
    assert footpoints(plain, noisy.points(surface_samples(noisy)[0][::5]))[1].max() < 5e-7


def bumped(at=0.9):
    """A round tube with a ring around it near one end."""
    return round_tube(lambda a, h: RADIUS + 0.008 * np.exp(-(((h - at) / 0.06) ** 2)), 72, 101)


def ridged():
    """A flat sheet with a narrow ridge along x near its far side."""
    return sheet(lambda x, y: 0.02 + 0.006 * np.exp(-(((y - 0.068) / 0.005) ** 2)), cells=(20, 160))


def heights_of(mesh, grid):
    """Heights along and across, as the grid itself samples a mesh, and the parametrization."""
    parametrization = grid.region.parametrization(mesh)
    return *sampled_heights(mesh, parametrization), parametrization


def best(heights, count):
    """The positions that a cubic fit has."""
    return best_positions(heights, count, 3)


def even(heights, count):
    """Even positions."""
    first, last = heights.edges
    return first + (last - first) * np.arange(count) / (count if heights.closed else count - 1)


def stated(heights, positions):
    """The predicted error [m]."""
    return heights.error(positions, 3)


def true_error(mesh, parametrization, s, t):
    """Root mean square distance from the surface on lines at s and t to the mesh, by triangles [m]."""
    surface = fit_surface(mesh, parametrized_lines(parametrization, s, t)).surface
    uv, weights = surface_samples(surface)
    distance = closest(mesh, surface.points(uv))[0]
    return float(np.sqrt(weights @ distance**2 / weights.sum()))


@examples(15)
@given(slope=st.tuples(*3 * [st.floats(-0.5, 0.5)]), degree=st.integers(2, 5), seed=seeds)
def test_predicted_error_of_a_slope_is_none(slope, degree, seed):
    """Any places of planes across a slope leave nothing but rounding."""
    a, b, c = slope
    at = np.linspace(0, 0.1, 30)
    rows = a + b * at + c * np.linspace(0, 0.08, 5)[:, None]
    heights = Heights(at, rows, np.ones_like(rows), False, False, True)
    places = np.r_[0.0, np.sort(np.random.default_rng(seed).uniform(0.1, 0.9, 7)), 1.0] * 0.1
    assert heights.error(places, degree) < 1e-14
    assert np.abs(heights.residual_slopes(places, degree)[0]).max() < 1e-14


@pytest.mark.parametrize("degree", [2, 3, 5])
def test_predicted_error_of_a_closed_spline_is_none(degree):
    """An outline that is a spline on its own lines: what is left is that of the straight steps between heights."""
    count, rng = 12, np.random.default_rng(1)
    t = TURN * np.sort(np.arange(count) / count + rng.uniform(-0.02, 0.02, count) * (np.arange(count) > 0))
    dense = spline_sites(count, degree, True, 600)
    points = dense.values @ ((RADIUS + 0.003 * rng.uniform(-1, 1, count)) * np.exp(1j * t))
    angles, at = np.angle(points) % TURN, np.linspace(0, TURN, 721)
    outline = np.interp(at, np.sort(angles), np.abs(points)[np.argsort(angles)], period=TURN)
    heights = Heights(at, np.tile(outline, (2, 1)), np.ones((2, 721)), True, True, True)
    assert heights.error(t, degree) < 5e-6 < 0.05 * heights.error(TURN * np.arange(count) / count, degree)


@pytest.mark.parametrize(
    ("mesh", "grid"),
    [
        pytest.param(square(20), TubeGrid(6, 20, Z_AXIS, 0.004), id="square"),
        pytest.param(bumped(), TubeGrid(10, 16, Z_AXIS, 0.004), id="bump"),
        pytest.param(ridged(), AcrossGrid(6, 12, (0, 0, 1.0), (1.0, 0, 0)), id="ridge"),
    ],
)
def test_places_leave_less_than_even_ones(mesh, grid):
    """By the prediction and by the true distance of fits; both have the same order."""
    along, across, parametrization = heights_of(mesh, grid)
    size = grid.size.n, grid.size.lines
    pairs = [(places(along, size[0]), places(across, size[1])) for places in (even, best)]
    predicted = [np.hypot(stated(along, s), stated(across, t)) for s, t in pairs]
    true = [true_error(mesh, parametrization, s, t) for s, t in pairs]
    assert predicted[1] < 0.2 * predicted[0] and true[1] < 0.2 * true[0]


CLOVER = round_tube(lambda a, _: RADIUS * (1 + 0.2 * np.cos(3 * a)), 240)


@pytest.mark.parametrize(("mesh", "lines"), [(square(), 12), (square(4), 16), (CLOVER, 12)])
def test_auto_lines_are_no_worse_than_even_ones_by_fits(mesh, lines):
    """On sections that are far from round, by the true distance: the fit confirms the prediction."""
    along, across, parametrization = heights_of(mesh, TubeGrid(5, lines, Z_AXIS, 0.004))
    auto, uniform = (
        true_error(mesh, parametrization, even(along, 5), places(across, lines)) for places in (best, even)
    )
    assert auto <= 1.05 * uniform


@pytest.mark.parametrize("at", [0.1, 0.9])
def test_mirrored_mesh_takes_mirrored_places(at):
    """The ring at one end or at the other: no end is preferred."""
    places = [best(heights_of(bumped(x), TubeGrid(10, 16, Z_AXIS, 0.004))[0], 10) for x in (at, 1 - at)]
    assert_allclose(places[0], LENGTH - places[1][::-1], atol=1e-6)


@pytest.mark.parametrize("mesh", [cylinder(), cone(0.03, 0.045)])
@pytest.mark.parametrize("lines", [8, 13])
def test_symmetric_shapes_keep_even_angles(mesh, lines):
    """Nothing is gained on a round tube: even spans, and even angles from angle zero on, to the bit."""
    along, across, parametrization = heights_of(mesh, TubeGrid(6, lines, Z_AXIS))
    assert_array_equal(best(across, lines), TURN * (np.arange(lines) / lines))
    assert_array_equal(best(along, 6), even_spans(*along.edges, 6))


def test_spans_with_more_error_become_shorter():
    """Five spans of one length; where errors are equal, they stay equal."""
    even = np.array((0.0, 1.0)), np.array((2.0, 3.0))
    fractions, positions = equalized(even, np.array((1.0, 1.0, 50.0, 1.0, 1.0)), False)
    spans = np.diff(np.interp(np.linspace(0, 1, 6), fractions, positions))
    assert spans.sum() == pytest.approx(1) and spans.argmin() == 2 and spans[2] < 0.75 * spans[0]
    assert_allclose(np.interp((0.2, 0.6), *equalized(even, np.ones(5), False)), (2.2, 2.6))


@pytest.mark.parametrize("hole", [0.01, 0.02])
def test_gaps_do_not_attract_planes(hole):
    """A hole in a round tube leaves even places even; a hole away from a ring hardly changes its planes."""
    holed = with_hole(cylinder(), (RADIUS, 0, 0.04), hole)
    along, across, parametrization = heights_of(holed, TubeGrid(8, 16, Z_AXIS, 0.004))
    assert (across.known == 0).any() and (along.known == 0).any()
    assert_array_equal(best(along, 8), even_spans(*along.edges, 8))
    assert_allclose(np.diff(best(across, 16)), TURN / 16, rtol=1e-4)
    grid = TubeGrid(10, 16, Z_AXIS, 0.004)
    whole, holed = (heights_of(m, grid)[0] for m in (bumped(), with_hole(bumped(), (RADIUS, 0, 0.03), hole)))
    left = [stated(whole, s) for s in (best(whole, 10), best(holed, 10), even(whole, 10))]
    assert left[1] < 1.3 * left[0] < 0.1 * left[2]


def test_heights_of_nothing_are_refused():
    """No ray hits the mesh: the message has one line and states what to do."""
    with pytest.raises(EmptySection, match="No ray of the grid hits the mesh. Move the axis into the mesh") as caught:
        filled(np.full((3, 4), np.nan), True)
    assert "\n" not in str(caught.value)


def test_lengths_about_uneven_angles_add_up_to_a_turn():
    """Half of the distance between the two neighbours, across the seam as well; the sense does not matter."""
    angles = np.array((0.0, 1.0, 2.5, 3.5, 5.0))
    expected = np.array((TURN - 4.0, 2.5, 2.5, 2.5, TURN - 3.5)) / 2
    assert_allclose(widths(angles, True), expected)
    assert_allclose(widths(-angles, True), expected)
    assert_allclose(widths(angles, True).sum(), TURN)


def test_gaps_are_bridged_by_straight_lines():
    """Along the row, over the seam where it is closed; an empty row is taken from the next that is not."""
    nan = np.nan
    heights = np.array(((nan, 2.0, nan, 4.0), (nan, nan, nan, nan), (1.0, 1.0, 1.0, 1.0)))
    assert_allclose(filled(heights, False), ((2, 2, 3, 4), (2, 2, 3, 4), (1, 1, 1, 1)))
    assert_allclose(filled(heights, True)[0], (3, 2, 3, 4))
    assert np.isnan(heights[0, 0])  # the caller's own stay as they are


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
        pytest.param(wrist(), SectorGrid(9, 14, -2.0, 1.0, Z_AXIS, 0.004), id="sector"),
        pytest.param(dome(), AcrossGrid(7, 8, (0, 0, 1.0)), id="face"),
    ],
)
def test_slopes_are_differences(mesh, grid):
    """The derivatives by the positions of planes and lines agree with differences of the residuals."""
    for heights, count in zip(heights_of(mesh, grid), (grid.size.n, grid.size.lines)):
        places = even(heights, count)
        residuals, change = heights.residual_slopes(places, 3)
        direction = 1e-4 * np.ptp(places) * np.eye(len(places))[1:-1]
        both = [[heights.residual_slopes(places + sign * w, 3)[0] for sign in (1, -1)] for w in direction]
        differences = np.array([(a - b) / (2 * w.max()) for (a, b), w in zip(both, direction)]).T
        downhill, expected = change[:, 1:-1].T @ residuals, differences.T @ residuals
        assert downhill @ expected > 0.98 * np.linalg.norm(downhill) * np.linalg.norm(expected)


@pytest.mark.parametrize("lines", [12, 40])
def test_noise_does_not_attract_lines(lines):
    """A noisy round tube keeps even lines and planes: sites elsewhere do not confirm a gain."""
    tube = cylinder()
    noise = 3e-4 * np.random.default_rng(0).standard_normal(len(tube.vertices))
    noisy = weld(tube.vertices + noise[:, None] * tube.vertices * (1, 1, 0) / RADIUS, tube.faces)
    along, across, parametrization = heights_of(noisy, TubeGrid(8, lines, Z_AXIS, 0.004))
    assert_array_equal(best(across, lines), TURN * (np.arange(lines) / lines))
    assert_array_equal(best(along, 8), even_spans(*along.edges, 8))


def test_uniform_lines_are_even():
    """Planes and lines, of a tube, a sector and a face."""
    for mesh, grid in (
        (wrist(), TubeGrid(7, 9, Z_AXIS, 0.004, "uniform")),
        (wrist(), SectorGrid(7, 9, -1.0, 1.5, Z_AXIS, 0.004, "uniform")),
        (dome(), AcrossGrid(7, 9, (0, 0, 1.0), spacing="uniform")),
    ):
        along, across, parametrization = heights_of(mesh, grid)
        expected = parametrized_lines(parametrization, even(along, 7), even(across, 9))
        lines = grid.line_grid(mesh)
        assert_allclose(lines.origins, expected.origins, atol=1e-15)
        assert_allclose(lines.directions, expected.directions, atol=1e-14)


def test_arc_lines_are_even_along_the_outline():
    """A flat ellipse: angles are uneven, lengths of the outline between the lines are even to a hundredth."""
    ellipse = round_tube(lambda a, h: 0.015 * 0.045 / np.hypot(0.015 * np.cos(a), 0.045 * np.sin(a)), 360, 6)
    grid = TubeGrid(5, 24, Z_AXIS, 0.004, "arc")
    t = np.r_[grid.line_grid(ellipse).t, TURN]
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
    t = TubeGrid(6, 40, Z_AXIS, 0.004, "curvature").line_grid(square()).t
    step = np.interp(np.arange(8) * np.pi / 4, t, np.gradient(t), period=TURN)
    assert (step[::2] < 0.6 * step[1::2]).all()
    assert_allclose(step[::2], step[0], rtol=0.15)


def test_lines_do_not_depend_on_the_fits_before():
    """What fits of one mesh have in common is kept for the next one: other numbers of planes change no bit."""
    mesh = wrist()
    for n, lines in ((8, 20), (12, 20), (8, 24), (8, 20)):
        repeated, alone = (
            TubeGrid(n, lines, Z_AXIS, 0.004).line_grid(m) for m in (mesh, weld(mesh.vertices, mesh.faces))
        )
        for name in ("origins", "directions"):
            assert getattr(repeated, name).tobytes() == getattr(alone, name).tobytes()


def test_folded_splines_have_no_negative_widths():
    """Where a spline goes back, as behind the edges of a sector of nearly a full turn, its sites do not count."""
    found = widths(np.array([[0.0, 2.0, 1.0, 3.0]]), False)
    assert_allclose(found, [[1.0, 1.0, 1.0, 1.0]])
