"""The smallest grid that meets a tolerance, in a sector of a tube and over a face."""

import numpy as np
import pytest

from sample_scenes.shapes import tube_mesh
from skin_calib_addon.common.arrays import pairs_of
from skin_calib_addon.geometry import (
    AutoGrid,
    fit_grid,
    fit_surface,
    fit_to_tolerance,
)
from skin_calib_addon.geometry.fit.auto import Predictor, net_size
from skin_calib_addon.geometry.grid.grids import Grid, Size, Tolerance, region_of
from skin_calib_addon.geometry.mesh.distance import closest
from skin_calib_addon.geometry.surface.distance import surface_samples
from skin_calib_addon.plan import plan_from
from tests.examples import slow
from tests.shapes import Z_AXIS, cone, cylinder, dome, sheet, welded, wrist

UP = (0.0, 0.0, 1.0)
SECTOR = {"sector": (-1.0, 1.5), "axis": Z_AXIS, "margin": 0.004}
FACE = {"normal": UP, "margin": 0.002}


def coarse_wrist():
    """A bent, tapered tube of few facets."""

    def point(angle, fraction):
        radius = 0.037 * (1 + 0.03 * np.cos(3 * angle + fraction) + 0.1 * np.cos(2 * angle)) * (1 - 0.1 * fraction)
        return np.column_stack(
            (radius * np.cos(angle) + 0.004 * np.sin(3 * fraction), radius * np.sin(angle), 0.1 * fraction)
        )

    return welded(tube_mesh(point, 36, 16))


def ridge(height=0.004, width=0.01):
    """A wavy sheet with a ridge across: no part of it is like another."""

    def z(x, y):
        return 0.02 + 0.002 * np.sin(60 * x) * np.cos(50 * y) + height * np.exp(-(((x - 0.07) / width) ** 2))

    return sheet(z, cells=(80, 64))


def roof(angle=0.5):
    """Two planes that meet in a sharp edge along y."""
    return sheet(lambda x, y: 0.02 - angle * np.abs(x - 0.05), cells=(40, 16))


def wedge():
    """A sector of a tube with a sharp edge along it."""
    mesh = cone(0.035, 0.035, around=180)
    angle = np.arctan2(mesh.vertices[:, 1], mesh.vertices[:, 0])
    radius = 0.035 / np.maximum(np.cos(np.abs(angle - 0.2) - 0.6), 0.5)  # two flats, and an edge at 0.2
    scale = np.where(np.abs(angle - 0.2) < 1.2, radius / 0.035, 1.0)
    return type(mesh)(mesh.vertices * np.column_stack((scale, scale, 1 + 0 * scale)), mesh.faces)


CASES = [
    pytest.param(wrist(), SECTOR, id="sector"),
    pytest.param(coarse_wrist(), SECTOR, id="coarse sector"),
    pytest.param(ridge(), FACE, id="face"),
    pytest.param(dome(), FACE, id="dome"),
]
SHARP = [pytest.param(roof(), FACE, id="roof"), pytest.param(wedge(), SECTOR, id="wedge")]


def distances(fit):
    """Mean and largest distance from a surface to its mesh, by every triangle, at ten places in each span [m]."""
    n, m = (10 * (len(np.unique(k[3:-3])) - 1) for k in (fit.surface.knots_u, fit.surface.knots_v))
    r = fit.surface.derivatives(pairs_of((np.arange(n) + 0.5) / n, (np.arange(m) + 0.5) / m))
    areas = np.linalg.norm(np.cross(r[1, 0], r[0, 1]), axis=1)
    distance = closest(fit.mesh, r[0, 0])[0]
    return float(areas @ distance / areas.sum()), float(distance.max())


@pytest.mark.parametrize(("mesh", "where"), CASES + SHARP)
@pytest.mark.parametrize("tolerance", [slow(3e-4), slow(1e-4), 6e-5])
def test_mean_keeps_within_the_tolerance(mesh, where, tolerance):
    """By exact distances at places that were not looked at; a hundredth for the places."""
    fit = fit_to_tolerance(mesh, tolerance, **where)
    assert fit.missing == 0 and fit.surface.closed == (False, False)
    assert fit.errors.surface_to_mesh.mean <= 1.01 * tolerance
    assert distances(fit)[0] <= 1.01 * tolerance


@pytest.mark.parametrize(("mesh", "where"), CASES + SHARP)
@pytest.mark.parametrize("tolerance", [slow(6e-4), 3e-4])
def test_largest_keeps_within_the_tolerance(mesh, where, tolerance):
    """By exact distances; points between the samples may be a tenth further from the mesh."""
    fit = fit_to_tolerance(mesh, tolerance, "max", **where)
    assert fit.missing == 0
    assert distances(fit)[1] <= 1.1 * tolerance


@pytest.mark.parametrize(("mesh", "where"), CASES)
def test_net_is_not_much_larger_than_it_must_be(mesh, where):
    """Grids of two thirds of its control points miss the tolerance, however they are split."""
    tolerance = 1e-4
    size = net_size(fit_to_tolerance(mesh, tolerance, **where))
    for n in range(4, 12):
        lines = int(2 * size / 3) // n
        if lines < 4:
            continue
        grid = Grid(region_of(**where), Size(n, lines))
        assert fit_surface(mesh, grid).errors.surface_to_mesh.mean > tolerance, (n, lines)


@pytest.mark.parametrize("degree", [2, 3, 5, (2, 4)])
@pytest.mark.parametrize("measure", ["mean", "max"])
def test_plane_takes_the_smallest_net(degree, measure):
    """A slope is in every space: as few planes and lines as the degree allows, exact to the rounding."""
    slope = sheet(lambda x, y: 0.02 + 0.3 * x - 0.2 * y)
    fit = fit_to_tolerance(slope, 1e-9, measure, degree, normal=UP)
    p, q = (degree, degree) if isinstance(degree, int) else degree
    assert fit.lines.origins.shape[:2] == (p + 1, q + 1)
    x, y, z = fit.surface.points(surface_samples(fit.surface)[0]).T
    assert np.abs(z - 0.02 - 0.3 * x + 0.2 * y).max() < 1e-13


def test_sector_of_a_cone_takes_the_fewest_planes():
    """Straight along the axis: four planes, and only lines are added as the tolerance shrinks."""
    shapes = [
        fit_to_tolerance(cone(around=384), t, sector=(-1.0, 1.5), axis=Z_AXIS, margin=0.004).lines.origins.shape
        for t in (1e-4, 1e-5)
    ]
    assert [s[0] for s in shapes] == [4, 4] and shapes[0][1] < shapes[1][1]


@pytest.mark.parametrize(
    ("members", "kind"),
    [
        ({"from": -1.0, "to": 1.5, "axis": {"point": [0, 0, 0], "direction": [0, 0, 1]}, "margin": 0.004}, "sector"),
        ({"normal": [0, 0, 2.0], "margin": 0.002}, "face"),
        ({"normal": [0, 0, 1.0], "axis": {"point": [0, 0, 0], "direction": [0, 1, 0]}}, "face"),
        ({"axis": {"point": [0, 0, 0], "direction": [0, 0, 1]}, "margin": 0.004}, "tube"),
    ],
)
def test_plan_is_carried_out(members, kind):
    """An automatic grid as a plan writes it: the mesh's part that was meant, within the tolerance that was asked."""
    grid = {"kind": "auto", "tolerance": 1e-4, "measure": "mean", **members}
    plan = plan_from({"version": 1, "link": "arm", "mesh": "arm.stl", "unit": "m", "grid": grid, "skins": []})
    assert isinstance(plan.surface.grid.size, Tolerance)
    mesh = ridge() if kind == "face" else wrist()
    fit = fit_grid(mesh, plan.surface.grid, plan.surface.degree)
    assert fit.errors.surface_to_mesh.mean <= 1e-4
    assert fit.surface.closed == (False, kind == "tube")
    if kind == "sector":
        edges = fit.surface.points(((0.5, 0.0), (0.5, 1.0)))
        np.testing.assert_allclose(np.arctan2(edges[:, 1], edges[:, 0]), (1.5, -1.0), rtol=1e-9)
    if kind == "face" and "axis" in members:
        across = fit.lines.planes_u.normals @ (0, 1.0, 0)
        np.testing.assert_allclose(across, 1, rtol=1e-12)


def test_chords_go_on_from_the_smallest_grid():
    """With chords the surface lies over the facets of the very lines that were found without."""
    mesh, grid = cylinder(around=24), AutoGrid(9e-5, axis=Z_AXIS, margin=0.004, sector=(-1.0, 1.5))
    plain, bulged = (fit_grid(mesh, grid, (3, 3), chords) for chords in (False, True))
    assert plain.lines.origins.tobytes() == bulged.lines.origins.tobytes()
    uv = surface_samples(plain.surface)[0]
    inside, truth = (np.linalg.norm(f.surface.points(uv)[:, :2], axis=1) for f in (plain, bulged))
    assert np.abs(truth - 0.035).mean() < 2e-5 < 1e-4 < np.abs(inside - 0.035).mean()


def test_smallest_grid_of_the_model_keeps_its_error():
    """What is predicted of the grid it names keeps within; of grids of two thirds of its control points none does."""
    mesh = coarse_wrist()
    predictor = Predictor(mesh, region_of(**SECTOR).parametrization(mesh), (3, 3))
    everywhere, alike = np.ones(predictor.nets.shape, bool), np.ones(2)
    for error in np.geomspace(2e-3, 2e-5, 12):
        n, lines = predictor.smallest(error, everywhere, alike)
        assert predictor.error((n, lines)) <= 1.15 * error  # between the numbers whose errors are predicted
        fewer = [(i, 2 * n * lines // 3 // i) for i in range(4, 20)]
        assert all(predictor.error(size) > error for size in fewer if size[1] >= 4)
    assert predictor.smallest(1e-12, everywhere, alike) is None
    assert predictor.smallest(1e-3, predictor.nets < 16, alike) is None


TUBE = {"axis": Z_AXIS, "margin": 0.004}


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("mesh", "where", "off"),
    [
        slow(wrist(), TUBE, 0.1, id="wrist"),
        pytest.param(cylinder(around=48), TUBE, 0.1, id="cylinder"),
        pytest.param(cone(0.045, 0.03), TUBE, 0.15, id="cone"),
        pytest.param(*CASES[0].values, 0.2, id="sector"),
        pytest.param(*CASES[2].values, 0.2, id="face"),
    ],
)
def test_prediction_is_what_a_fit_keeps(mesh, where, off):
    """Within a tenth or a seventh all round, a fifth of patches, by exact distances, down to what the facets leave."""
    predictor = Predictor(mesh, region_of(**where).parametrization(mesh), (3, 3))
    for size in ((4, 5), (4, 8), (6, 5), (5, 11), (8, 12), (8, 17), (10, 20)):
        fit = predictor.fit(size)
        np.testing.assert_allclose(predictor.error(size), fit.errors.surface_to_mesh.mean, rtol=off, err_msg=str(size))
