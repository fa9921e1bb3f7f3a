"""What holds for any fit: it goes where the mesh goes, and finds what the space contains."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from skin_calib_addon.geometry import (
    AcrossGrid,
    Axis,
    BSplineSurface,
    Planes,
    PlanesGrid,
    SectorGrid,
    TubeGrid,
    fit_surface,
    weld,
)
from skin_calib_addon.geometry.fit import fitting as fit_module
from skin_calib_addon.geometry.mesh.distance import closest
from skin_calib_addon.geometry.surface.bspline import clamped_knots, periodic_knots
from tests.examples import examples
from tests.shapes import LENGTH, TURN, Motion, dome, keep, quads, sheet, shuffled, u_planes, v_planes, with_hole, wrist

seeds = st.integers(0, 2**32 - 1)
UV = np.random.default_rng(0).uniform(0, 1, (300, 2))
NEAR_Z = Axis((0.001, -0.001, 0.02), (0.02, 0.01, 1.0))
# An irregular tube, and the same with a hole: what the axis and the lines hang on is unique.
WRIST, HOLED = wrist(), with_hole(wrist(), (0.035, 0.0, 0.05), 0.01)


def author_planes(motion):
    """Fanned planes one by one, moved with the mesh."""
    tilts = np.linspace(-0.2, 0.2, 7)
    u, v = u_planes(np.linspace(0.02, 0.08, 7), tilts), v_planes(8)
    families = (u.points, u.normals), (v.points + (0.002, 0.001, 0), v.normals)
    return PlanesGrid(*(Planes(motion.points(p), motion.directions(n)) for p, n in families), closed=True)


def tube(axis=None, margin=0.002):
    """A grid maker: from a motion to the tube grid that goes with it."""
    return lambda motion: TubeGrid(8, 16, motion.axis(axis), None if margin is None else margin * motion.scale)


GRIDS = {
    "auto axis and margin": (WRIST, tube(margin=None)),
    "given axis, a hole": (HOLED, tube(NEAR_Z)),
    "fanned planes": (WRIST, author_planes),
}


def assert_moves_along(mesh, make, motion):
    """The surface fitted to the moved mesh is the moved surface, to a billionth of its size."""
    here = fit_surface(mesh, make(Motion.none())).surface
    there = fit_surface(motion.mesh(mesh), make(motion)).surface
    size = mesh.size * motion.scale
    assert_allclose(there.control_net, motion.points(here.control_net), rtol=0, atol=1e-9 * size)
    assert_allclose(there.points(UV), motion.points(here.points(UV)), rtol=0, atol=1e-9 * size)
    assert_allclose(there.normals(UV), motion.directions(here.normals(UV)), rtol=0, atol=1e-7)


@pytest.mark.parametrize("case", GRIDS)
@examples(6)
@given(seed=seeds)
def test_moving_the_mesh_moves_the_surface(case, seed):
    """Turned and shifted by up to a metre: control points, points and normals."""
    assert_moves_along(*GRIDS[case], Motion(seed))


@pytest.mark.parametrize("case", GRIDS)
@examples(6)
@given(scale=st.floats(0.05, 20))
def test_scaling_the_mesh_scales_the_surface(case, scale):
    """From a finger to a torso."""
    assert_moves_along(*GRIDS[case], Motion.none(scale))


@examples(5)
@given(seed=seeds, scale=st.floats(0.3, 3))
def test_moving_a_face_moves_its_surface(seed, scale):
    """Planes across a dome, with the author's normal and direction moved along."""

    def make(motion):
        up, along = motion.directions((0, 0, 1.0)), motion.directions((1.0, 0.2, 0))
        return AcrossGrid(6, 6, tuple(up), tuple(along), 0.015 * motion.scale)

    assert_moves_along(dome(), make, Motion(seed, scale))


@examples(5)
@given(shift=st.tuples(*3 * [st.floats(-2, 2)]), scale=st.floats(0.3, 3))
def test_shifting_a_sector_shifts_its_surface(shift, scale):
    """Its angles start at the link's x axis, which does not rotate with the mesh; all else moves along."""
    motion = Motion.none(scale)
    motion.shift = np.array(shift)
    assert_moves_along(WRIST, lambda m: SectorGrid(6, 8, -1.0, 1.2, m.axis(NEAR_Z), 0.01 * m.scale), motion)


@pytest.mark.parametrize("case", GRIDS)
@examples(3)
@given(seed=seeds)
def test_order_of_vertices_and_faces_does_not_matter(case, seed):
    """The same triangles listed otherwise: the same control points to the bit."""
    mesh, make = GRIDS[case]
    nets = [fit_surface(m, make(Motion.none())).surface.control_net for m in (mesh, weld(*shuffled(mesh, seed)))]
    assert nets[0].tobytes() == nets[1].tobytes()


@examples(10)
@given(slope=st.tuples(*3 * [st.floats(-0.3, 0.3)]), degree=st.integers(2, 5), n=st.integers(6, 9), m=st.integers(6, 9))
def test_slopes_are_found_exactly(slope, degree, n, m):
    """Planes of any slope are in the space of every grid across them, of every degree: error zero to the rounding."""
    mesh = sheet(lambda x, y: 0.1 * slope[0] + slope[1] * x + slope[2] * y)
    fit = fit_surface(mesh, AcrossGrid(n, m, (0, 0, 1.0)), degree)
    points = fit.surface.points(UV)
    assert_allclose(
        points[:, 2], 0.1 * slope[0] + slope[1] * points[:, 0] + slope[2] * points[:, 1], rtol=0, atol=1e-12
    )
    assert fit.errors.hausdorff < 1e-12


def spline_tube(seed, n=6, m=10):
    """A tube that is a spline on even planes and half-planes about z itself: random radii of its control points."""
    rng = np.random.default_rng(seed)
    knots_u, knots_v = clamped_knots(n, 3), periodic_knots(m, 3)
    radii = 0.04 + 0.002 * rng.uniform(-1, 1, (n, m))
    angle = -TURN * np.arange(m) / m
    net = np.stack(
        (radii * np.cos(angle), radii * np.sin(angle), np.tile(np.linspace(0, LENGTH, n)[:, None], (1, m))), axis=-1
    )
    return BSplineSurface(np.concatenate((net, net[:, :3]), axis=1), knots_u, knots_v, (3, 3), (False, True))


def even_planes(surface, m=10):
    """The planes that the spline tube was made on."""
    return PlanesGrid(u_planes(surface.control_net[:, 0, 2]), v_planes(m // 2), True)


@examples(4)
@given(seed=seeds)
def test_what_the_space_contains_is_found(seed):
    """A surface of the very space: the fit differs by what the facets do, about a quarter for facets half the size."""
    truth = spline_tube(seed)
    errors = []
    for size in (1, 2, 4):
        points = truth.grid_points(np.linspace(0, 1, 20 * size + 1), np.arange(60 * size) / (60 * size))
        mesh = quads(points[:, ::-1], closed=(False, True))
        # The mesh ends in the first and last plane; the fit needs a hair's breadth beyond.
        longer = weld(mesh.vertices + (mesh.vertices[:, [2]] > LENGTH - 1e-9) * (0, 0, 1e-9), mesh.faces)
        fit = fit_surface(longer, even_planes(truth))
        rolls = [np.roll(fit.surface.control_net[:, :10], k, axis=1) for k in range(10)]
        errors.append(min(np.linalg.norm(net - truth.control_net[:, :10], axis=2).max() for net in rolls))
    assert errors[2] < 1e-5
    assert errors[1] < errors[0] / 2.5 and errors[2] < errors[0] / 10


@pytest.mark.parametrize("case", GRIDS)
def test_fit_is_never_worse_than_its_own_start(case, monkeypatch):
    """With more iterations the residuals do not grow: the last one leaves no more than the first."""
    mesh, make = GRIDS[case]
    misfit = []
    for iterations in (1, 2, 3, 10):
        monkeypatch.setattr(fit_module, "MAX_FIT_ITERATIONS", iterations)
        residuals = fit_surface(mesh, make(Motion.none())).residuals
        misfit.append(np.sqrt(np.nanmean(residuals**2)))
    assert (np.diff(misfit) <= 0).all() and misfit[-1] < misfit[0]


@examples(8)
@given(seed=seeds)
def test_ragged_meshes_are_fitted_nearly_as_well(seed):
    """Tubes without a random tenth of their faces: gaps are counted, and the surface fits the missing faces too."""
    rng = np.random.default_rng(seed)
    mesh, grid = keep(WRIST, lambda c: rng.random(len(c)) > 0.1), TubeGrid(8, 16, NEAR_Z, 0.004, "uniform")
    fit = fit_surface(mesh, grid)
    assert 0.05 < fit.missing < 0.15
    ragged, whole = (closest(WRIST, f.surface.points(UV))[0] for f in (fit, fit_surface(WRIST, grid)))
    assert ragged.mean() < 1.5 * whole.mean() and ragged.max() < 2 * whole.max()
