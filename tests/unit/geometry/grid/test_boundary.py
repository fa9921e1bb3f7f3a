"""Boundaries of regions: what is inside, and fits that follow nothing outside."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.spatial import cKDTree

from skin_calib_addon.common.errors import EmptySection
from skin_calib_addon.geometry import fit_grid, fit_surface
from skin_calib_addon.geometry.fit.fitting import fit_lines
from skin_calib_addon.geometry.grid.axis import Axis
from skin_calib_addon.geometry.grid.boundary import Boundary
from skin_calib_addon.geometry.grid.grids import Across, Grid, Sector, Size, Tolerance, Tube
from skin_calib_addon.geometry.mesh.distance import closest
from skin_calib_addon.geometry.sampling.off_cover import off_cover
from skin_calib_addon.geometry.surface.distance import surface_samples
from tests.shapes import cylinder, keep, quads, sheet, together, with_hole

RADIUS, HEIGHT = 0.05, 0.2
TURN = np.linspace(0, 2 * np.pi, 24, endpoint=False)
AXIS = Axis((0.0, 0.0, 0.0), (0.0, 0.0, 1.0))
TUBE = cylinder(RADIUS, HEIGHT, 96, 30)
UV = np.random.default_rng(0).random((20_000, 2))


def on_tube(arc, height):
    """Points of the tube at some arc lengths from the x axis, as a loop."""
    return tuple(zip(RADIUS * np.cos(arc / RADIUS), RADIUS * np.sin(arc / RADIUS), height + 0 * arc))


DISC = on_tube(0.03 * np.cos(TURN), 0.1 + 0.03 * np.sin(TURN))


@given(st.integers(0, 10_000))
def test_inside_is_that_of_a_polygon(seed):
    """Random polygons with a hole, compared with another library; also across the seam of a tube."""
    shapely = pytest.importorskip("shapely")
    rng = np.random.default_rng(seed)
    angles, hole = np.sort(rng.random(7)) * 2 * np.pi, np.sort(rng.random(4)) * 2 * np.pi
    outer, inner = (r * np.column_stack((np.cos(a), np.sin(a))) for r, a in ((1, angles), (0.2, hole)))
    points = rng.uniform(-1.2, 1.2, (60, 2))
    polygons = shapely.Polygon(outer), shapely.Polygon(inner)
    expected = [polygons[0].contains(p) != polygons[1].contains(p) for p in map(shapely.Point, points)]
    assert Boundary.of([outer, inner], np.inf).contains(points).tolist() == expected
    shift = np.array((0.0, rng.uniform(-9, 9)))  # along t, which comes back after 2 pi
    wrapped = [np.column_stack((q[:, 0], (q + shift)[:, 1] % (2 * np.pi))) for q in (outer, inner, points)]
    assert Boundary.of(wrapped[:2], 2 * np.pi).contains(wrapped[2]).tolist() == expected


def test_mean_of_a_search_is_that_of_the_report():
    """Also where the boundary cuts cells: their parts have smaller weights."""
    fit = fit_grid(TUBE, Grid(Sector(AXIS, None, (DISC,), start=-1.0, stop=1.0), Size(6, 9), "uniform"), (3, 3))
    assert fit.mean_to_mesh == pytest.approx(fit.to_mesh.mean, rel=1e-12)


def test_errors_are_those_of_all_that_is_inside():
    """Also in a tip of the boundary, where the surface is extrapolated and no ray is near; but not over a hole."""
    mesh = sheet(lambda x, y: 0.004 * np.sin(60 * x), cells=(80, 40))
    tip = tuple((x, y, 0.0) for x, y in ((0.01, 0.01), (0.07, 0.01), (0.098, 0.012), (0.07, 0.05), (0.01, 0.05)))
    grid = Grid(Across(normal=(0, 0, 1), boundary=(tip,)), Size(6, 6), "uniform")
    fit = fit_grid(mesh, grid, (3, 3))
    inside = UV[fit.lines.region(fit.surface.points(UV))]
    r = fit.surface.derivatives(inside)
    distances, areas = closest(mesh, r[0, 0])[0], np.linalg.norm(np.cross(r[1, 0], r[0, 1]), axis=1)
    away = cKDTree(fit.points[~np.isnan(fit.residuals)]).query(r[0, 0])[0]
    assert away[np.argmax(distances)] > 0.004  # the samples are 2 mm apart
    assert_allclose(fit.to_mesh.mean, np.average(distances, weights=areas), rtol=0.02)
    assert distances.max() <= fit.to_mesh.max < 1.05 * distances.max()
    assert (np.isnan(fit.deviations) == ~fit.is_measured(surface_samples(fit.surface)[0])).all()
    holed = fit_grid(with_hole(mesh, (0.04, 0.03, 0), 0.008), grid, (3, 3))
    over_hole = np.hypot(*(holed.surface.points(UV)[:, :2] - (0.04, 0.03)).T) < 0.006
    assert holed.to_mesh.max < 0.001 and not holed.is_measured(UV)[over_hole].any()


def test_points_level_with_a_corner_are_decided():
    """Corners at the very t of the points: each corner counts for none or both of its edges."""
    for angle in np.linspace(0, 3, 50):
        turn = np.array(((np.cos(angle), -np.sin(angle)), (np.sin(angle), np.cos(angle))))
        loop = np.array(((0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2.0))) @ turn
        far = loop + np.stack((np.linspace(-9, -4, 6), np.zeros(6)), axis=1)
        assert not Boundary.of([loop], np.inf).contains(far).any()


def test_points_that_are_not_numbers_are_outside():
    """Rays without a hit; and no points at all."""
    square = Boundary.of([np.array(((0, 0), (1, 0), (1, 1), (0, 1.0)))], np.inf)
    assert square.contains(np.array(((0.5, 0.5), (np.nan, 0.5), (0.5, np.nan)))).tolist() == [True, False, False]
    assert square.contains(np.zeros((0, 2))).shape == (0,)


def test_surface_is_trusted_inside_its_boundary_only():
    """A disc on a tube: the planes span the disc, and exactly its points are trusted."""
    fit = fit_surface(TUBE, Grid(Sector(AXIS, None, (DISC,), start=-1, stop=1), Size(6, 8), "uniform"))
    assert_allclose(fit.lines.planes_u.points[[0, -1], 2], (0.07 - 6e-5, 0.13 + 6e-5), atol=1e-12)
    assert fit.missing == 0 and fit.warnings == () and fit.errors.hausdorff < 1e-4
    points = fit.surface.points(UV)
    from_centre = np.hypot(np.arctan2(points[:, 1], points[:, 0]) * RADIUS, points[:, 2] - 0.1)
    trusted = fit.is_trusted(UV)
    assert from_centre[trusted].max() < 0.03 < from_centre[~trusted].min() + 0.0004  # the polygon has 24 corners


def test_loops_may_go_round_the_tube():
    """Between two wavy rings; the seam is no edge."""
    low, high = (on_tube(RADIUS * TURN, z + 0.01 * np.sin(3 * TURN)) for z in (0.05, 0.15))
    fit = fit_surface(TUBE, Grid(Tube(AXIS, None, (low, high)), Size(6, 16)))
    points = fit.surface.points(UV)
    wave = 0.01 * np.sin(3 * np.arctan2(points[:, 1], points[:, 0]))
    height = points[:, 2] - wave
    near = np.minimum(abs(height - 0.05), abs(height - 0.15)) < 0.001  # the rings are polygons
    assert (fit.is_trusted(UV) == ((height > 0.05) & (height < 0.15)))[~near].all()


def with_box():
    """A flat plate with a box on it that hides a quarter of it."""
    return sheet(lambda x, y: np.where((x > 0.06) & (y > 0.03), 0.02, 0.0), (0.1, 0.06), (20, 12))


CORNERS = ((0.01, 0.005), (0.09, 0.005), (0.09, 0.02), (0.05, 0.02), (0.05, 0.055), (0.01, 0.055))
SQUARE = tuple((x, y, 0.0) for x, y in CORNERS)


@pytest.mark.parametrize("size", [Size(8, 8), Tolerance(1e-5)], ids=["fixed", "auto"])
def test_what_is_outside_does_not_pull_the_surface(size):
    """With the boundary the plate is flat; without it, the box is in the surface."""
    mesh = with_box()
    fit = fit_grid(mesh, Grid(Across(normal=(0, 0, 1), boundary=(SQUARE,)), size), (3, 3))
    uv = UV[fit.is_trusted(UV)]
    assert len(uv) > 5000 and np.abs(fit.surface.points(uv)[:, 2]).max() < 1e-9
    assert fit.errors.surface_to_mesh.max < 1e-9
    broken = fit_surface(mesh, Grid(Across(normal=(0, 0, 1), margin=0.005), Size(8, 8)), max_deviation=0.1)
    assert broken.errors.surface_to_mesh.max > 5e-4


def test_holes_inside_the_boundary_are_holes():
    """Rays that miss the mesh inside count as missing, those outside do not."""
    mesh = keep(TUBE, lambda c: (np.hypot(c[:, 1], c[:, 2] - 0.1) > 0.01) | (c[:, 0] < 0))
    fit = fit_surface(mesh, Grid(Sector(AXIS, None, (DISC,), start=-1, stop=1), Size(6, 8), "uniform"))
    assert 0.05 < fit.missing < 0.2 and "missing-samples" in [w.code for w in fit.warnings]
    points = fit.surface.points(UV)
    in_hole = np.hypot(points[:, 1], points[:, 2] - 0.1) < 0.009
    assert not fit.is_trusted(UV)[in_hole].any()


def test_boundary_off_the_mesh_is_refused():
    """No ray is inside."""
    far = tuple((x + 1.0, y, z + 1.0) for x, y, z in DISC)
    with pytest.raises(EmptySection, match="inside the boundary"):
        fit_surface(TUBE, Grid(Sector(AXIS, None, (far,), start=-1, stop=1), Size(6, 8), "uniform"))


def over_floor(radius=0.004):
    """A plate with a hole, 20 mm above a floor."""
    size = (0.1, 0.06)
    plate = with_hole(sheet(lambda x, y: 0 * x, size, (50, 30)), (0.05, 0.03, 0.0), radius)
    return together(plate, sheet(lambda x, y: 0 * x - 0.02, size, (1, 1)))


LOOP = ((0.01, 0.01, 0.0), (0.09, 0.01, 0.0), (0.09, 0.05, 0.0), (0.01, 0.05, 0.0))


def test_what_rays_hit_below_a_hole_is_not_the_cover():
    """A few rays hit the floor: they count as missed, the surface is flat, and taxels there are over a hole."""
    fit = fit_grid(over_floor(), Grid(Across(normal=(0, 0, 1), boundary=(LOOP,)), Size(8, 8), "uniform"), (3, 3))
    points = fit.surface.points(UV)
    assert np.abs(points[fit.is_trusted(UV), 2]).max() < 1e-9 and np.abs(points[:, 2]).max() < 1e-3
    assert fit.converged and fit.errors.surface_to_mesh.max < 1e-9 and 0 < fit.missing < 0.05
    assert not fit.is_trusted(UV)[np.linalg.norm(points - (0.05, 0.03, 0), axis=1) < 0.002].any()


def test_single_rays_through_a_small_hole_are_no_warning_about_the_surface():
    """It is held all around; taxels over the hole have their own warning. A larger hole is one."""
    grid = Grid(Across(normal=(0, 0, 1), boundary=(LOOP,)), Size(8, 8), "uniform")
    small, large = (fit_grid(over_floor(radius), grid, (3, 3)) for radius in (0.0015, 0.004))
    assert 0 < small.missing < large.missing and small.warnings == ()
    assert not small.is_trusted(UV)[np.linalg.norm(small.surface.points(UV) - (0.05, 0.03, 0), axis=1) < 0.001].any()
    assert [w.code for w in large.warnings] == ["missing-samples"]


@pytest.mark.parametrize(
    ("height", "breadth", "counts"),
    [
        (-0.02, 0.004, False),
        (-0.004, 0.004, False),
        (-0.02, 0.04, True),
        (-0.0008, 0.02, True),
        (0.005, 0.02, True),
    ],
    ids=["hole", "pocket", "half", "shallow", "rib"],
)
def test_parts_below_are_not_the_cover(height, breadth, counts):
    """A strip at another height, with vertical sides; only small and deep ones count as missed."""
    x = np.linspace(0, 0.1, 101)
    z = np.where(np.abs(x - 0.05) < breadth / 2, height, 0.0)
    step = np.flatnonzero(np.diff(z))
    x[step[0] + 1] = x[step[0]]  # vertical
    x[step[1]] = x[step[1] + 1]
    mesh = quads(np.stack([np.column_stack((x, np.full(101, y), z)) for y in (0, 0.06)], axis=1))
    fit = fit_grid(
        mesh, Grid(Across(normal=(0, 0, 1), boundary=(LOOP,)), Size(8, 12), "uniform"), (3, 3), max_deviation=0.1
    )
    assert (fit.missing == 0) == counts


@pytest.mark.parametrize(
    ("depth", "missed"),
    [(0.015, True), (0.02, False)],
    ids=["row", "rows"],
)
def test_what_is_in_front_of_a_rim_is_not_the_cover(depth, missed):
    """A plate that hides the sites at one side of the boundary from the rays, in a row or several."""
    mesh = together(over_floor(0.0), sheet(lambda x, y: 0 * x + 0.03, (0.1, depth), (1, 1)))
    grid = Grid(Across(normal=(0, 0, 1), boundary=(LOOP,)), Size(8, 8), "uniform")
    fit = fit_lines(mesh, grid.line_grid(mesh), (3, 3))
    off = np.abs(fit.surface.points(UV)[fit.is_trusted(UV), 2]).max()
    assert (fit.missing > 0) == (off < 1e-9) == missed


def test_between_sites_outside_the_boundary_nothing_is_trusted():
    """A spike of the boundary between two columns of sites: no ray there says where the mesh is."""
    spike = (*LOOP[:3], (0.0515, 0.05, 0.0), (0.0515, 0.0585, 0.0), (0.0513, 0.0585, 0.0), (0.0513, 0.05, 0.0), LOOP[3])
    fit = fit_grid(over_floor(0.0), Grid(Across(normal=(0, 0, 1), boundary=(spike,)), Size(8, 8), "uniform"), (3, 3))
    uv = np.column_stack((np.full(400, 0.525), np.linspace(0, 1, 400)))
    far = fit.surface.points(uv)[:, 1] > 0.0535  # beyond the square by more than a site
    inside = fit.lines.region(fit.surface.points(uv))
    assert (inside & far).sum() > 20 and not (fit.is_trusted(uv) & far).any()
    assert fit.is_trusted(uv)[inside & (fit.surface.points(uv)[:, 1] < 0.05)].all()


@pytest.mark.parametrize(
    ("front", "outside", "dropped"),
    [
        (np.s_[:2, :2], 0, True),
        (np.s_[:1, :], 0, True),
        (np.s_[:2, :], 0, False),
        (np.s_[:, 3:4], 0, False),
        (np.s_[2:4, 2:4], 0, False),
        (np.s_[:8, 2:3], np.s_[:4, :2], True),
        (np.s_[:8, 2:4], np.s_[:4, :2], False),
    ],
    ids=["corner", "row", "rows", "rib", "bump", "fin", "thick fin"],
)
def test_only_small_parts_at_a_rim_are_in_front_of_it(front, outside, dropped):
    """A bump or a rib is part of the cover. So is more than a row at the rim; a fin leaves the rim."""
    x, y = np.mgrid[:12, :9] * 0.003
    hits = np.stack((x, y, 0 * x), axis=2)
    hits[(*front, 2)] = 0.01
    if outside:
        hits[outside] = np.nan
    up = np.broadcast_to((0.0, 0.0, 1.0), hits.shape)
    off = off_cover(hits, up, up, False)
    assert off[front].all() == off.any() == dropped


def test_rays_that_had_no_hit_get_none():
    """Of rays that were outside the boundary, missed the cover or hit it, those that hit it keep their new hit."""
    grid = Grid(Across(normal=(0, 0, 1), boundary=(LOOP,)), Size(8, 8), "uniform")
    fit = fit_grid(over_floor(), grid, (3, 3))
    before, every = fit.samples, np.zeros(fit.residuals.shape, bool)
    now = replace(before, residuals=np.full(every.shape, 1e-3), outside=every)
    kept = now.without_new(before)
    assert before.missed.any() and (np.isnan(kept.residuals) == np.isnan(before.residuals)).all()
    assert (kept.outside == before.outside).all() and (kept.missed == before.missed).all()
    assert np.nanmin(kept.residuals) == np.nanmax(kept.residuals) == 1e-3


def test_a_single_hit_is_no_cover():
    """It is farther from the others than a site; where there are only such hits, they stay."""
    hits = np.full((6, 9, 3), np.nan)
    x, y = np.mgrid[:6, :9] * 0.003
    hits[:, :6] = np.stack((x, y, 0 * x), axis=2)[:, :6]
    hits[3, 8] = 0.009, 0.024, -0.05
    up = np.broadcast_to((0.0, 0.0, 1.0), hits.shape)
    assert np.argwhere(off_cover(hits, up, up, False)).tolist() == [[3, 8]]
    hits[:, :6] = np.nan
    assert not off_cover(hits, up, up, False).any()


def test_shelves_below_a_bounded_surface_are_no_undercut():
    """The boundary states what the surface follows. Without it, the shelf is left out, and there is a warning."""
    outline = np.array(
        ((0, 0), (0.1, 0), (0.1, -0.005), (0.02, -0.005), (0.02, -0.03), (0.1, -0.03), (0.1, -0.04), (0, -0.04))
    )
    y = np.linspace(0, 0.06, 13)
    points = np.stack([np.column_stack((outline[:, 0], np.full(8, k), outline[:, 1])) for k in y])
    mesh = quads(np.swapaxes(points, 0, 1), closed=(True, False))
    bounded, whole = (
        fit_grid(mesh, Grid(Across(normal=(0, 0, 1), margin=0.005, boundary=loops), Size(8, 8)), (3, 3))
        for loops in ((LOOP,), ())
    )
    assert bounded.warnings == () and bounded.errors.hausdorff < 1e-9
    assert [w.code for w in whole.warnings] == ["dropped-curves"]
