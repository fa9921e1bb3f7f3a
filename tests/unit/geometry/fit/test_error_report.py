"""The errors of a fit against known distances and brute force."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from skin_calib_addon.common.arrays import unit
from skin_calib_addon.geometry import CoverSpec, TubeGrid, cut_cover, fit_surface, load_mesh, weld
from skin_calib_addon.geometry.fit.error_report import Expansion, mesh_to_surface, surface_to_mesh
from skin_calib_addon.geometry.fit.fitting import fit_lines
from skin_calib_addon.geometry.mesh.closest import MeshDistance, split_faces
from skin_calib_addon.geometry.surface.distance import is_sampled, surface_samples
from skin_calib_addon.geometry.surface.footpoints import footpoints
from tests.examples import examples
from tests.shapes import (
    LENGTH,
    RADIUS,
    TURN,
    Z_AXIS,
    box,
    cylinder,
    grid_of_faces,
    keep,
    plane_surface,
    sheet,
    together,
    wrist,
)

DATA = Path(__file__).parents[5] / "shared" / "data" / "meshes"
LINKS = ("icub27_l_upper_leg", "jvrc1_r_elbow_p", "hrp4c_r_wrist_y_cover_only", "icub27_l_forearm")
LINKS += ("talos_arm_5_forearm", "hrp4c_r_elbow_p", "talos_arm_5_forearm_collision", "talos_tibia_light")


def errors_of(mesh, surface, known):
    """Return the errors from mesh to surface and from surface to mesh, without bounds from rays."""
    uv, areas = surface_samples(surface)
    sampled = is_sampled(surface, uv, known)
    unknown = np.full(sampled.sum(), np.inf)
    to_mesh, _ = surface_to_mesh(mesh, surface.points(uv[sampled]), unknown, areas[sampled], np.empty(0, np.int64))
    return mesh_to_surface(mesh, surface, known, 0), to_mesh


@examples(15)
@given(height=st.floats(-0.01, 0.01), turned=st.booleans())
def test_errors_of_a_parallel_plane_are_its_height(height, turned):
    """In both directions, mean, rms and max; a wrong winding does not change the distances."""
    mesh = sheet(lambda x, y: 0 * x + height)
    mesh = weld(mesh.vertices, mesh.faces[:, ::-1]) if turned else mesh
    errors = errors_of(mesh, plane_surface(), np.ones((10, 10), bool))
    found = [getattr(e, n) for e in errors for n in ("mean", "rms", "max")]
    assert_allclose(found, abs(height), rtol=1e-9, atol=1e-12)


def test_errors_look_where_mesh_and_surface_lie_over_each_other():
    """A mesh that is longer than the surface, or has walls at its sides, is not further from it."""
    mesh = sheet(lambda x, y: 0 * x + 0.001, size=(0.2, 0.08), cells=(40, 16))
    walls = keep(box((0, 0, -0.02), (0.2, 0.08, 0.001)), lambda c: c[:, 2] > -0.02)
    for m in (mesh, walls):
        errors = errors_of(m, plane_surface(), np.ones((10, 10), bool))
        assert_allclose([e.max for e in errors], 0.001, rtol=1e-9)


def test_errors_count_parallel_faces_at_any_distance():
    """A second floor 20 mm below counts, as a fold that the surface misses does. A ceiling does not."""
    mesh, floor = sheet(lambda x, y: 0 * x + 0.001), sheet(lambda x, y: 0 * x - 0.02)
    ceiling = weld(floor.vertices, floor.faces[:, ::-1])
    for other, expected in ((floor, 0.02), (ceiling, 0.001)):
        found = mesh_to_surface(together(mesh, other), plane_surface(), np.ones((10, 10), bool), 1)
        assert_allclose((found.max, found.mean), (expected, (expected + 0.001) / 2), rtol=0.02)


def test_errors_leave_out_what_no_sample_met():
    """Where the sites met no mesh the surface is a guess: half a mesh is no error of the other half."""
    half = keep(sheet(lambda x, y: 0 * x + 0.001), lambda c: c[:, 0] < 0.05)
    known = np.zeros((11, 9), bool)
    known[:6] = True  # the sites at x = 0 to 0.05
    errors = errors_of(half, plane_surface(), known)
    assert_allclose([e.max for e in errors], 0.001, rtol=1e-9)
    assert errors_of(half, plane_surface(), np.ones((11, 9), bool))[1].max > 0.04


def test_errors_of_a_closed_surface_hold_over_the_seam():
    """A cylinder: no sample at the seam is left out or measured to the wrong side."""
    fit = fit_surface(cylinder(), TubeGrid(6, 30, Z_AXIS, 0.004))
    sagitta = RADIUS * (1 - np.cos(np.pi / 96))
    assert fit.errors.hausdorff < sagitta
    points = split_faces(cylinder(), 0.002)[0]
    near = (points[:, 2] > 0.01) & (points[:, 2] < LENGTH - 0.01)
    assert footpoints(fit.surface, points[near])[1].max() < sagitta


def brute_force(fit, number):
    """Return the distances to the mesh, those from random points of it, and the maximum of these and all corners."""
    to_mesh = MeshDistance(fit.mesh)(fit.bounds()[0])[0]
    rng = np.random.default_rng(11)
    face = rng.choice(len(fit.mesh.faces), number, p=fit.mesh.face_areas / fit.mesh.face_areas.sum())
    inner = np.einsum("kc,kcd->kd", rng.dirichlet(np.ones(3), number), fit.mesh.triangles[face])
    corners = fit.mesh.triangles.reshape(-1, 3)  # as of the face that they belong to
    found = []
    for at, of in ((inner, face), (corners, np.repeat(np.arange(len(fit.mesh.faces)), 3))):
        uv, distance = footpoints(fit.surface, at)
        counts = fit.is_trusted(uv) & (uv[:, 0] > 0) & (uv[:, 0] < 1)
        counts &= (fit.surface.normals(uv) * fit.mesh.face_normals[of]).sum(axis=1) > 0.5
        found.append(distance[counts])
    return to_mesh, found[0], float(max(part.max() for part in found))


def test_errors_of_the_wrist_are_those_of_brute_force():
    """Maxima to a per cent, the mean within three times its stated uncertainty."""
    fit = fit_surface(wrist(), TubeGrid(10, 20, Z_AXIS, 0.004, "uniform"))
    to_mesh, back, largest_back = brute_force(fit, 30_000)
    errors = fit.errors
    assert_allclose(errors.surface_to_mesh.max, to_mesh.max(), rtol=1e-12)
    assert_allclose(errors.mesh_to_surface.max, largest_back, rtol=0.01)
    assert abs(errors.mesh_to_surface.mean - back.mean()) < 1.5 * errors.mesh_to_surface.uncertainty
    assert 0 < errors.mesh_to_surface.uncertainty < 0.05 * back.mean()
    assert errors.hausdorff == max(errors.surface_to_mesh.max, errors.mesh_to_surface.max)


def test_one_moved_vertex_of_many_is_found():
    """A dent of 1 mm at one of 30 000 vertices is the maximum from the mesh; samples by area would miss it."""
    mesh = cylinder(around=300, along=101)
    vertices = mesh.vertices.copy()
    at = int(np.argmin(np.linalg.norm(vertices - (0, RADIUS, LENGTH / 2), axis=1)))
    vertices[at] *= (1, (RADIUS - 0.001) / RADIUS, 1)
    moved = weld(vertices, mesh.faces)
    assert len(moved.faces) > 30_000  # the branch for many faces
    fit = fit_surface(moved, TubeGrid(6, 12, Z_AXIS, 0.004, "uniform"))
    assert_allclose(fit.errors.mesh_to_surface.max, 0.001, rtol=0.03)


def test_distances_to_many_faces_are_those_to_all_faces():
    """The faces near the points suffice."""
    mesh = cylinder(around=300, along=101)
    fit = fit_surface(mesh, TubeGrid(6, 12, Z_AXIS, 0.004, "uniform"))
    points, _, _ = fit.bounds()
    exact = MeshDistance(mesh)(points)[0]
    assert_allclose(fit.errors.surface_to_mesh.max, exact.max(), rtol=1e-12)
    uv, point, distance = fit.worst
    assert_allclose(distance, exact.max(), rtol=1e-12)
    assert_allclose(fit.surface.points(uv[None])[0], point, rtol=0, atol=1e-15)
    assert_allclose(MeshDistance(mesh)(point[None])[0][0], distance, rtol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("name", LINKS)
def test_errors_of_real_links_are_those_of_brute_force(name):
    """Also where the surface is far from the mesh, as the plain nets of these links are."""
    path = DATA / f"{name}.stl"
    if not path.exists():
        pytest.skip(f"no {path.name} here")
    mesh = cut_cover(load_mesh(path), CoverSpec())
    fit = fit_lines(mesh, TubeGrid(10, 40, spacing="uniform").line_grid(mesh, (3, 3)), (3, 3))
    to_mesh, back, largest_back = brute_force(fit, 10_000)
    errors = fit.errors
    forth = errors.surface_to_mesh
    assert_allclose(forth.max, to_mesh.max(), rtol=1e-9)
    assert abs(forth.mean - np.average(to_mesh, weights=fit.bounds()[2])) < 1.5 * forth.uncertainty + 1e-6
    assert_allclose(errors.mesh_to_surface.max, largest_back, rtol=0.05)
    of_sample = 1.96 * back.std() / np.sqrt(len(back))
    allowed = 1.5 * np.hypot(errors.mesh_to_surface.uncertainty, of_sample)
    assert abs(errors.mesh_to_surface.mean - back.mean()) < allowed + 1e-6


def test_points_far_from_a_surface_are_over_it_or_beyond_its_edge():
    """Over the zone of a sphere up to 40 degrees of latitude, far inside and outside of it."""
    turn, latitude = np.meshgrid(np.linspace(0, TURN, 121), np.deg2rad(np.linspace(-60, 60, 81)), indexing="ij")
    ball = np.stack((np.cos(latitude) * np.cos(turn), np.cos(latitude) * np.sin(turn), np.sin(latitude)), axis=-1)
    mesh = weld(0.04 * ball.reshape(-1, 3), grid_of_faces(121, 81))
    margin = 0.04 * (np.sin(np.deg2rad(60)) - np.sin(np.deg2rad(40)))
    surface = fit_surface(mesh, TubeGrid(8, 16, axis=Z_AXIS, margin=margin)).surface
    rng = np.random.default_rng(0)
    directions = unit(rng.normal(size=(3000, 3)))
    points = directions * rng.uniform(0.02, 0.07, (3000, 1))
    table = Expansion.of(surface)
    _, bounds, inside = table(surface, points, table.nearest(points))
    angle = np.abs(np.rad2deg(np.arcsin(directions[:, 2])))
    clear = np.abs(angle - 40) > 1
    assert_array_equal(inside[clear], angle[clear] < 40)
    assert (bounds >= footpoints(surface, points)[1] - 1e-9).all()


def test_inner_wall_of_a_shell_is_no_error():
    """The faces of a wall 3 mm below the surface face the other side."""
    inner = cylinder(RADIUS - 0.003)
    outer = cylinder()
    faces = np.concatenate((outer.faces, inner.faces[:, ::-1] + len(outer.vertices)))
    shell = weld(np.concatenate((outer.vertices, inner.vertices)), faces)
    fit = fit_surface(shell, TubeGrid(6, 12, Z_AXIS, 0.004, "uniform"))
    assert fit.errors.mesh_to_surface.max < 1e-4
