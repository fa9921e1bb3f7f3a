"""The constrained fit on shapes whose answer is known."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from skin_calib_addon.common.arrays import pairs_of
from skin_calib_addon.common.errors import EmptySection, UnderdeterminedFit
from skin_calib_addon.geometry import AcrossGrid, Axis, PlanesGrid, SectorGrid, TubeGrid, fit_grid, fit_surface
from skin_calib_addon.geometry.fit import fitting as fit_module
from skin_calib_addon.geometry.fit.surface_fit import surface_at
from skin_calib_addon.geometry.mesh.distance import closest
from skin_calib_addon.geometry.sampling.basis import TensorBasis
from skin_calib_addon.geometry.sampling.samples import SampleRows
from skin_calib_addon.geometry.surface.footpoints import footpoints
from tests.oracles import best_step, cast_on_mesh
from tests.shapes import (
    LENGTH,
    RADIUS,
    Z_AXIS,
    cone,
    cylinder,
    keep,
    round_tube,
    sheet,
    subdivided,
    u_planes,
    v_planes,
    weld,
    with_hole,
    wrist,
)

AROUND = 96
MAX_DRAFT_DISTANCE = 2e-5  # [m] of the surface of a preview from that of the fit, on a smooth link
# How far the facets of a tube of radius 1 with AROUND sides lie inside of it.
SAGITTA = 1 - np.cos(np.pi / AROUND)
UV = np.random.default_rng(0).uniform(0, 1, (400, 2))


def planes_grid(stations, tilts=0.0, lines=10):
    """u-planes across z, tilted about y, and full v-planes through z."""
    return PlanesGrid(u_planes(stations, tilts), v_planes(lines), True)


def assert_lies_on_tube(fit, bottom, top, spline):
    """A surface is between a cone and its facets, but for a fraction ``spline`` of the radius, and looks as it does."""
    points, normals = fit.surface.points(UV), fit.surface.normals(UV)
    radius = bottom + (top - bottom) * points[:, 2] / LENGTH
    fraction = np.linalg.norm(points[:, :2], axis=1) / radius
    assert 1 - SAGITTA - spline < fraction.min() and fraction.max() < 1 + spline
    outward = np.column_stack((points[:, :2], np.full(len(points), (bottom - top) / LENGTH) * radius * fraction))
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    assert np.degrees(np.arccos(np.clip((normals * outward).sum(axis=1), -1, 1))).max() < 1.0


@pytest.mark.parametrize("degree", [2, 4, (2, 5), (5, 2)])
def test_cylinder_is_exact_to_its_facets(degree):
    """All degrees: the surface lies between the facets and the cylinder they come from, to a hundredth of a percent."""
    fit = fit_surface(cylinder(), TubeGrid(8, 20), degree)
    assert_lies_on_tube(fit, RADIUS, RADIUS, 1e-4)
    assert fit.missing == 0
    assert fit.errors.surface_to_mesh.max < 1.1 * SAGITTA * RADIUS
    assert fit.errors.surface_to_mesh.mean < 0.5 * SAGITTA * RADIUS


@pytest.mark.parametrize("grid", [TubeGrid(8, 20), TubeGrid(5, 20, Z_AXIS, 0.003)])
@pytest.mark.parametrize("ends", [(0.045, 0.030), (0.030, 0.045)])
def test_cone_is_exact_to_its_facets(grid, ends):
    """An axis found or given, running to the thinner end or not; planes even or not."""
    assert_lies_on_tube(fit_surface(cone(*ends), grid), *ends, 1e-4)


def test_small_nets_are_still_least_squares():
    """The fewest planes and lines that each degree allows: no sample less than unknowns, and a tube comes out."""
    for degree in (2, 3, 4, 5):
        fit = fit_surface(cylinder(), TubeGrid(degree + 1, 12, Z_AXIS), degree)
        assert fit.residuals.shape[0] > degree + 1
        assert_lies_on_tube(fit, RADIUS, RADIUS, 2e-3)


def test_dome_under_planes_across_is_exact_to_its_facets():
    """A paraboloid to the size of its facets' sagitta, and it faces the given direction."""

    def height(x, y):
        return 0.02 - 2 * ((x - 0.05) ** 2 + (y - 0.04) ** 2)

    for down in (False, True):
        mesh = sheet(height)
        mesh = weld(mesh.vertices, mesh.faces[:, ::-1]) if down else mesh
        fit = fit_surface(mesh, AcrossGrid(10, 10, (0, 0, -1.0 if down else 1.0), margin=0.005))
        points = fit.surface.points(UV)
        gap = height(points[:, 0], points[:, 1]) - points[:, 2]
        facet = 2 * (0.005**2 + 0.005**2) / 4  # the largest sagitta of a facet's long side
        assert -0.5 * facet < gap.min() and gap.max() < 1.5 * facet
        assert (fit.surface.normals(UV)[:, 2] * (-1 if down else 1) > 0.9).all()
        assert fit.surface.closed == (False, False)


def test_sector_is_exact_to_its_facets():
    """A sector, within a whole tube and within a half one."""
    half = keep(cylinder(), lambda c: c[:, 0] > 0)
    for mesh, grid in (
        (cylinder(), SectorGrid(6, 14, -2.0, 2.5, Z_AXIS)),
        (half, SectorGrid(6, 14, -1.3, 1.3, Z_AXIS)),
    ):
        fit = fit_surface(mesh, grid)
        assert fit.missing == 0 and fit.surface.closed == (False, False)
        assert_lies_on_tube(fit, RADIUS, RADIUS, 2e-4)
        angle = np.arctan2(*fit.surface.points(UV)[:, 1::-1].T)
        assert grid.region.start < angle.min() and angle.max() < grid.region.stop


@pytest.mark.parametrize("degree", [2, 5])
def test_fanned_planes_are_as_exact_as_parallel_ones(degree):
    """u-planes fanned by 20 degrees to both sides: a cylinder to its facets, a wrist as with parallel planes."""
    tilts = np.deg2rad(np.linspace(-20, 20, 10))
    fit = fit_surface(cylinder(), planes_grid(np.linspace(0.02, 0.08, 10), tilts), degree)
    assert_lies_on_tube(fit, RADIUS, RADIUS, 1e-4)
    stations = np.linspace(0.02, 0.08, 10)
    fanned, straight = (fit_surface(wrist(), planes_grid(stations, t), degree).errors for t in (tilts, 0.0))
    assert fanned.surface_to_mesh.mean < 1.5 * straight.surface_to_mesh.mean
    assert fanned.mesh_to_surface.max < 2 * straight.mesh_to_surface.max


def test_control_points_stay_on_their_lines():
    """The constraint of the paper: each control point lies in its u-plane and in its v-plane."""
    grid = planes_grid(np.linspace(0.02, 0.08, 8), np.linspace(-0.2, 0.2, 8), lines=6)
    surface = fit_surface(wrist(), grid).surface
    for i, row in enumerate(surface.control_net):
        assert np.abs((row - grid.u.points[i]) @ grid.u.normals[i]).max() < 1e-13
        assert np.abs(row @ grid.v.normals.T).min(axis=1).max() < 1e-13
    assert (surface.control_net[:, :3] == surface.control_net[:, -3:]).all()  # the seam, to the bit


@pytest.mark.slow
@pytest.mark.parametrize("grid", [TubeGrid(5, 8, Z_AXIS, 0.01), SectorGrid(5, 6, -1.0, 1.5, Z_AXIS, 0.01)])
def test_fit_solves_the_dense_least_squares(grid):
    """Against an oracle that casts every ray on every face: no offsets leave a thousandth less misfit."""
    mesh = weld(*decimated())
    step, before, after = best_step(fit_surface(mesh, grid))
    assert after > 0.999 * before
    assert np.abs(step).max() < fit_module.FIT_TOLERANCE * mesh.size


def decimated():
    """A coarse tube with the proportions of the wrist."""
    coarse = cone(0.037, 0.034, around=14, along=5)
    bent = coarse.vertices + 0.004 * np.sin(40 * coarse.vertices[:, [2]]) * (1, 0, 0)
    return bent * (1, 0.8, 1), coarse.faces


@pytest.mark.parametrize("side", ["first row", "last row", "first column", "last column", "all"])
def test_distances_are_weighted_with_the_area_of_each_site(side):
    """A surface over a flat mesh, with one side of it raised: mean and rms are those of its area."""
    fit = fit_surface(sheet(lambda x, y: 0 * x), AcrossGrid(6, 5, (0, 0, 1), margin=0.004))
    raised = {"first row": np.s_[0], "last row": np.s_[-1], "first column": np.s_[:, 0], "last column": np.s_[:, -1]}
    offsets = fit.offsets.copy()
    offsets[raised.get(side, np.s_[:])] += 0.001
    fit = replace(fit, offsets=offsets, surface=surface_at(fit.lines, fit.basis, offsets))
    uv = pairs_of(*2 * [(np.arange(300) + 0.5) / 300])
    r = fit.surface.derivatives(uv)
    areas, heights = np.linalg.norm(np.cross(r[1, 0], r[0, 1]), axis=1), np.abs(r[0, 0, :, 2])
    stated = fit.to_mesh
    assert_allclose(stated.mean, np.average(heights, weights=areas), rtol=0.01)
    assert_allclose(stated.rms, np.sqrt(np.average(heights**2, weights=areas)), rtol=0.01)
    assert_allclose(stated.max, 0.001, rtol=1e-6)  # on the edge


@pytest.mark.parametrize("side", [np.s_[1:3, 0], np.s_[3:5, -1], np.s_[0, 1:3], np.s_[-1, 2:4]])
def test_largest_distance_at_an_edge_is_found(side):
    """An edge that is raised in its middle, over one large face: no vertex is near the maximum."""
    fit = fit_surface(sheet(lambda x, y: 0 * x, cells=(1, 1)), AcrossGrid(6, 5, (0, 0, 1), margin=0.004))
    offsets = fit.offsets.copy()
    offsets[side] += 0.001
    fit = replace(fit, offsets=offsets, surface=surface_at(fit.lines, fit.basis, offsets))
    t = np.linspace(0, 1, 20_001)
    edges = [np.column_stack(pair) for x in (0 * t, 0 * t + 1) for pair in ((x, t), (t, x))]
    highest = np.abs(fit.surface.points(np.concatenate(edges))[:, 2]).max()
    assert_allclose(fit.to_mesh.max, highest, rtol=1e-5)
    assert min(np.abs(fit.worst[0] - edge).min() for edge in (0, 1)) == 0


def test_residuals_are_distances_along_the_sample_rays():
    """Rays from the origins through sites of the surface, cast on every face; measured before the last small step."""
    mesh = weld(*decimated())
    fit = fit_surface(mesh, TubeGrid(5, 8, Z_AXIS, 0.01))
    k, l = fit.residuals.shape
    for i, j in ((0, 0), (1, 7), (k - 1, l - 1), (3, 11)):
        point = fit.surface.points([[i / (k - 1), j / l]])[0]
        centre = point * (0, 0, 1)
        length = np.linalg.norm(point - centre)
        met = cast_on_mesh(centre, (point - centre) / length, mesh.triangles)
        assert abs(fit.residuals[i, j] - (met - length)) < 1e-4 * mesh.size


def test_holes_are_spanned_and_counted():
    """The fraction of missing samples is that of the hole, and the surface continues over it as if it were not."""
    mesh = with_hole(cylinder(), (RADIUS, 0, 0.05), 0.015)
    fit = fit_surface(mesh, TubeGrid(20, 44, Z_AXIS, 0.004, "uniform"))
    area = (1 - mesh.face_areas.sum() / cylinder().face_areas.sum()) * LENGTH / (LENGTH - 0.008)
    assert_allclose(fit.missing, area, rtol=0.25)
    assert_lies_on_tube(fit, RADIUS, RADIUS, 5e-3)
    assert fit.errors.hausdorff < 6e-4  # what spans the hole is no error, but for teeth of its rim between sites


def test_surface_stays_tame_over_a_hole_with_a_rim():
    """The wall is flared by 3 mm about a hole of 25: control points that only the rim holds do not swing away."""
    mesh, centre = cylinder(around=120, along=61), (RADIUS, 0, 0.05)
    rim = np.linalg.norm(mesh.vertices - centre, axis=1) < 0.028
    flared = mesh.vertices * np.where(rim[:, None], ((RADIUS + 0.003) / RADIUS,) * 2 + (1,), 1)
    link = with_hole(weld(flared, mesh.faces), centre, 0.025)
    fit = fit_module.fit_lines(link, TubeGrid(12, 24, Z_AXIS, 0.004, "uniform").line_grid(link), (3, 3))
    assert fit.converged and fit.missing > 0.1
    assert fit.offsets.min() > 0.02 and fit.offsets.max() < 0.06


@pytest.mark.parametrize("lines", (11, 12, 16, 18))
def test_few_lines_do_not_keep_step_with_facets(lines):
    """On a tube of 48 sides: as near as facets allow for a circle, for any ratio of lines to facets."""
    mesh = cylinder(around=48)
    fit = fit_surface(mesh, TubeGrid(5, lines, Z_AXIS, 0.004, "uniform"))
    left = closest(mesh, fit.surface.points(np.random.default_rng(0).uniform(0, 1, (4000, 2))))[0].mean()
    circle = 4 / (9 * np.sqrt(3)) * RADIUS * (1 - np.cos(np.pi / 48))  # of mean height over the arcs: parabolas
    assert left < 1.1 * circle
    assert_allclose(fit.errors.surface_to_mesh.mean, left, rtol=0.15)  # nor do the points where errors are measured


@pytest.mark.parametrize(
    ("grid", "degree", "message"),
    [
        (
            TubeGrid(3, 12, Z_AXIS),
            3,
            "Degree 3 needs at least 4 u-planes, but the grid has 3. Add u-planes, or lower the degree",
        ),
        (TubeGrid(8, 5, Z_AXIS), 5, "Degree 5 needs at least 6 v-lines, but the grid has 5"),
        (SectorGrid(8, 3, 0.0, 1.0, Z_AXIS), 3, "Degree 3 needs at least 4 v-lines, but the grid has 3"),
        (planes_grid([0.05], lines=4), 3, "Degree 3 needs at least 4 u-planes, but the grid has 1"),
        (TubeGrid(8, 12, Z_AXIS), 1, "Degree 1 is not available. Use 2 to 5"),
        (TubeGrid(8, 12, Z_AXIS), (3, 6), "Degree 6 is not available. Use 2 to 5"),
    ],
)
def test_too_few_planes_for_the_degree_are_refused(grid, degree, message):
    """The number of planes and the number needed; no warning in addition to the error."""
    with pytest.raises(UnderdeterminedFit, match=message):
        fit_surface(cylinder(), grid, degree)


@pytest.mark.parametrize(
    ("grid", "message"),
    [
        (
            planes_grid([-0.1, 0.02, 0.04, 0.06, 0.08]),
            r"u-plane 0, through \(0\.0, 0\.0, -100\.0\) mm, does not intersect the mesh",
        ),
        (
            planes_grid([0.01, 0.03, 0.05, 0.07, 0.2]),
            r"u-plane 4, through \(0\.0, 0\.0, 200\.0\) mm, does not intersect the mesh",
        ),
        (
            planes_grid(np.linspace(0, 0.1001, 6)),
            r"u-plane 5, through \(0\.0, 0\.0, 100\.1\) mm, does not intersect the mesh",
        ),
        (
            TubeGrid(6, 12, Axis((1, 0, 0), (0, 0, 1)), margin=0.01),
            "does not intersect the mesh. Move it, increase the margin, or choose another axis|no ray",
        ),
    ],
)
def test_plane_that_misses_the_mesh_is_named(grid, message):
    """The plane that misses, not its neighbour, with a point of it."""
    with pytest.raises(EmptySection, match=message):
        fit_surface(cylinder(), grid)


def test_line_that_misses_the_mesh_is_named():
    """A half-plane over the open side of a half tube, by its angle."""
    half = keep(cylinder(), lambda c: c[:, 0] > 0)
    with pytest.raises(
        EmptySection, match=r"half-plane at [12]\d\d(\.\d)? degrees, through .* does not intersect the mesh"
    ):
        fit_surface(half, SectorGrid(6, 8, -3.0, 1.0, Z_AXIS, 0.01))


def test_mesh_that_is_mostly_missing_is_refused():
    """A tube of stripes with less than half of its faces: the fraction is in the message and on the error."""
    stripes = keep(
        cylinder(along=41), lambda c: (c[:, 2] % 0.02 < 0.0075) | (np.abs(np.arctan2(c[:, 1], c[:, 0])) < 0.3)
    )
    with pytest.raises(EmptySection, match=r"5\d% of the sample rays do not hit the mesh") as caught:
        fit_surface(stripes, TubeGrid(12, 12, Z_AXIS, 0.002))
    assert 0.5 < caught.value.numbers["missing"] < 0.6


def test_mesh_that_is_mostly_missing_at_the_last_is_refused():
    """Every other face at random: the first rays meet just more than half, those through the fitted surface less."""
    mesh = wrist()
    torn = weld(mesh.vertices, mesh.faces[np.random.default_rng(7).random(len(mesh.faces)) > 0.5])
    grid = TubeGrid(6, 14, Z_AXIS, 0.004, "uniform")
    lines = grid.line_grid(torn)
    basis = TensorBasis.of(lines, 3, 3)
    first = SampleRows.of(torn, lines, basis).cast(basis.blend(torn.size * lines.directions))
    assert np.isnan(first.residuals).mean() < 0.5
    with pytest.raises(EmptySection, match="51% of the sample rays do not hit the mesh"):
        fit_surface(torn, grid)


def test_oscillating_iterations_end_early(monkeypatch):
    """Over a step of 50 mm they come to no rest: fewer than ten leave no more than ten do."""
    mesh = round_tube(lambda a, h: 0.03 + 0.05 * (h > 0.5) * (np.cos(a) > -0.32), 120, 60)
    lines = TubeGrid(20, 20, Z_AXIS, 0.004, "uniform").line_grid(mesh)
    early = fit_module.fit_lines(mesh, lines, (3, 3))
    monkeypatch.setattr(fit_module, "OSCILLATION_RATIO", np.inf)
    late = fit_module.fit_lines(mesh, lines, (3, 3))
    assert early.iterations < late.iterations == fit_module.MAX_FIT_ITERATIONS
    assert not early.converged and not late.converged
    (warning,) = (w for w in early.warnings if w.code == "not-converged")
    assert warning.value == early.movement.max() > 1e-3 and f"moved by {warning.value * 1e3:.1f} mm" in warning.message
    assert abs(warning.where.point[2] - 0.05) < 0.01, "at the step"
    left = [fit_module.rms_residual(fit.residuals) for fit in (early, late)]
    assert left[0] <= left[1] * (1 + 1e-6)


def test_draft_of_a_smooth_link_is_near_the_fit():
    """It has fewer samples, and its surface is within two hundredths of a millimetre of the exact one."""
    mesh, grid = subdivided(wrist()), TubeGrid(13, 32, Z_AXIS)
    exact, draft = (fit_grid(mesh, grid, (3, 3), draft=draft) for draft in (False, True))
    assert draft.residuals.size < exact.residuals.size
    u = np.linspace(0.01, 0.99, 30)
    distance = footpoints(exact.surface, draft.surface.grid_points(u, u).reshape(-1, 3))[1]
    assert 0 < distance.max() < MAX_DRAFT_DISTANCE


def test_fit_from_a_similar_one_takes_fewer_iterations_to_the_same_surface():
    """The offsets of a fit are a start on lines that moved by a tenth of a millimetre."""
    mesh, grid = subdivided(wrist()), TubeGrid(10, 20, Z_AXIS, margin=0.004)
    near = fit_surface(mesh, TubeGrid(10, 20, Z_AXIS, margin=0.0041))
    cold = fit_surface(mesh, grid)
    warm = fit_surface(mesh, grid, start=near.offsets)
    assert warm.iterations < cold.iterations
    assert np.abs(warm.offsets - cold.offsets).max() < 1e-6
