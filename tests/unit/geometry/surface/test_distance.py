"""Distances between points, meshes and surfaces against brute force."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from skin_calib_addon.common.surface_errors import DistanceStatistics
from skin_calib_addon.geometry import TubeGrid, fit_surface
from skin_calib_addon.geometry.mesh.triangle_mesh import weld
from skin_calib_addon.geometry.surface.distance import footpoints, mesh_samples, surface_errors, surface_samples
from tests.examples import examples
from tests.oracles import nearest_on_triangle
from tests.shapes import LENGTH, RADIUS, Z_AXIS, box, cylinder, keep, plane_surface, sheet, wrist_surface

seeds = st.integers(0, 2**32 - 1)
whole = st.integers(-3, 3)
points_on_a_grid = st.tuples(whole, whole, whole).map(lambda p: np.array(p, float))


@given(seed=seeds)
def test_footpoints_on_a_plane_are_projections(seed):
    """Over the plane: straight down, u and v are fractions of the sides; next to it: on the edge, at its distance."""
    points = np.random.default_rng(seed).uniform((-0.02, -0.02, -0.01), (0.12, 0.10, 0.01), (30, 3))
    uv, distance = footpoints(plane_surface(), points)
    assert_allclose(uv, np.clip(points[:, :2] / (0.1, 0.08), 0, 1), rtol=0, atol=1e-9)
    near = points - np.clip(points, 0, (0.1, 0.08, 0))
    assert_allclose(distance, np.linalg.norm(near, axis=1), rtol=1e-9)


def test_footpoints_on_a_tube_are_nearest():
    """Points about the wrist, over the seam too: no dense grid has a nearer point, and the gap is along the normal."""
    surface = wrist_surface()
    rng = np.random.default_rng(3)
    places = np.column_stack(
        (rng.uniform(0.1, 0.9, 60), np.append(rng.uniform(0, 1, 50), rng.uniform(-0.01, 0.01, 10)))
    )
    points = surface.points(places) + rng.uniform(-0.004, 0.004, (60, 1)) * surface.normals(places)
    uv, distance = footpoints(surface, points)
    u, v = np.linspace(0, 1, 200), np.linspace(0, 1, 400)
    dense = surface.grid_points(u, v).reshape(-1, 3)
    assert (distance <= np.linalg.norm(points[:, None] - dense, axis=2).min(axis=1) + 1e-12).all()
    gap = points - surface.points(uv)
    assert_allclose(np.abs((gap * surface.normals(uv)).sum(axis=1)), distance, rtol=1e-9, atol=1e-12)
    assert ((uv[:, 1] >= 0) & (uv[:, 1] < 1)).all()


def test_samples_stand_for_all_of_the_area():
    """The weights of a surface's samples add up to its area, those of a mesh's points to that of each face."""
    uv, weights = surface_samples(plane_surface())
    assert_allclose(weights.sum(), 0.1 * 0.08, rtol=1e-12)
    assert ((uv > 0) & (uv < 1)).all()
    mesh = box((0, 0, 0), (0.1, 0.05, 0.001))
    points, areas, face = mesh_samples(mesh)
    assert_allclose(np.bincount(face, areas), mesh.face_areas, rtol=1e-12)
    for p, f in zip(points[::7], face[::7]):
        assert np.linalg.norm(nearest_on_triangle(p, mesh.triangles[f]) - p) < 1e-15


def test_mesh_samples_leave_no_large_gap():
    """No point of a long face is further from a sample than a fiftieth of the mesh."""
    mesh = box((0, 0, 0), (0.2, 0.01, 0.01))
    points, _, _ = mesh_samples(mesh)
    rng = np.random.default_rng(4)
    spots = np.einsum("fsk,fkc->fsc", rng.dirichlet(np.ones(3), (12, 40)), mesh.triangles).reshape(-1, 3)
    assert np.linalg.norm(spots[:, None] - points, axis=2).min(axis=1).max() < 0.02 * mesh.size


@examples(15)
@given(height=st.floats(-0.01, 0.01), turned=st.booleans())
def test_errors_of_a_parallel_plane_are_its_height(height, turned):
    """In both directions, mean, rms, max and Hausdorff; a wrong winding does not change the distances."""
    mesh = sheet(lambda x, y: 0 * x + height)
    mesh = weld(mesh.vertices, mesh.faces[:, ::-1]) if turned else mesh
    errors = surface_errors(mesh, plane_surface(), np.ones((10, 10), bool))
    found = [errors.hausdorff]
    found += [getattr(e, n) for e in (errors.mesh_to_surface, errors.surface_to_mesh) for n in ("mean", "rms", "max")]
    assert_allclose(found, abs(height), rtol=1e-9, atol=1e-12)


def test_errors_look_where_mesh_and_surface_lie_over_each_other():
    """A mesh that is longer than the surface, or has walls at its sides, is not further from it."""
    mesh = sheet(lambda x, y: 0 * x + 0.001, size=(0.2, 0.08), cells=(40, 16))
    walls = keep(box((0, 0, -0.02), (0.2, 0.08, 0.001)), lambda c: c[:, 2] > -0.02)
    for m in (mesh, walls):
        errors = surface_errors(m, plane_surface(), np.ones((10, 10), bool))
        assert_allclose((errors.surface_to_mesh.max, errors.mesh_to_surface.max), 0.001, rtol=1e-9)


def test_errors_leave_out_what_no_sample_met():
    """Where the sites met no mesh the surface is a guess: half a mesh is no error of the other half."""
    half = keep(sheet(lambda x, y: 0 * x + 0.001), lambda c: c[:, 0] < 0.05)
    known = np.zeros((11, 9), bool)
    known[:6] = True  # the sites at x = 0 to 0.05
    errors = surface_errors(half, plane_surface(), known)
    assert_allclose((errors.surface_to_mesh.max, errors.mesh_to_surface.max), 0.001, rtol=1e-9)
    assert surface_errors(half, plane_surface(), np.ones((11, 9), bool)).surface_to_mesh.max > 0.04


def test_errors_of_a_closed_surface_hold_over_the_seam():
    """A cylinder: no sample at the seam is left out or measured to the wrong side."""
    fit = fit_surface(cylinder(), TubeGrid(6, 30, Z_AXIS, 0.004))
    sagitta = RADIUS * (1 - np.cos(np.pi / 96))
    assert fit.errors.hausdorff < sagitta
    points, _, _ = mesh_samples(cylinder())
    near = (points[:, 2] > 0.01) & (points[:, 2] < LENGTH - 0.01)
    assert footpoints(fit.surface, points[near])[1].max() < sagitta


@given(values=st.lists(st.tuples(st.floats(0, 1), st.floats(1e-3, 1)), min_size=1, max_size=9))
def test_statistics_are_weighted(values):
    """Mean and root mean square by area, the maximum whatever its area."""
    d, w = np.array(values).T
    found = DistanceStatistics.of(d, w)
    assert_allclose(found.mean, sum(a * b for a, b in values) / sum(w), rtol=1e-12, atol=1e-300)
    assert_allclose(found.rms, np.sqrt(sum(a * a * b for a, b in values) / sum(w)), rtol=1e-12, atol=1e-150)
    assert found.max == max(d)
