"""The errors of a fit against known distances and brute force."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from skin_calib_addon.geometry import CoverSpec, SectorGrid, TubeGrid, cut_cover, fit_grid, fit_surface, load_mesh, weld
from skin_calib_addon.geometry.fit.error_report import VertexFeet, is_inside, mesh_to_surface, surface_to_mesh
from skin_calib_addon.geometry.fit.fitting import fit_lines
from skin_calib_addon.geometry.grid.grids import Grid, Size, Tube
from skin_calib_addon.geometry.mesh.distance import closest
from skin_calib_addon.geometry.mesh.face_points import sample_faces
from skin_calib_addon.geometry.surface.distance import is_sampled
from skin_calib_addon.geometry.surface.footpoints import footpoints
from tests.examples import examples
from tests.shapes import (
    LENGTH,
    RADIUS,
    TURN,
    Z_AXIS,
    box,
    cylinder,
    keep,
    plane_surface,
    sheet,
    together,
    wrist,
    wrist_surface,
)

DATA = Path(__file__).parents[5] / "shared" / "data" / "meshes"
LINKS = ("icub27_l_upper_leg", "jvrc1_r_elbow_p", "hrp4c_r_wrist_y_cover_only", "icub27_l_forearm")
LINKS += ("talos_arm_5_forearm", "hrp4c_r_elbow_p", "talos_arm_5_forearm_collision", "talos_tibia_light")


def errors_of(mesh, surface, known, side=0):
    """Return the errors from mesh to surface and from surface to mesh."""
    feet = VertexFeet.of(mesh, surface)
    to_mesh, _ = surface_to_mesh(mesh, surface, lambda uv: is_sampled(surface, uv, known), feet)
    return mesh_to_surface(mesh, surface, known, side, feet), to_mesh


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
        found, _ = errors_of(together(mesh, other), plane_surface(), np.ones((10, 10), bool), 1)
        assert_allclose((found.max, found.mean), (expected, (expected + 0.001) / 2), rtol=0.02)


def test_errors_leave_out_what_no_sample_met():
    """Where the sites met no mesh the surface is a guess: half a mesh is no error of the other half."""
    half = keep(sheet(lambda x, y: 0 * x + 0.001), lambda c: c[:, 0] < 0.05)
    known = np.zeros((11, 9), bool)
    known[:6] = True  # the sites at x = 0 to 0.05
    errors = errors_of(half, plane_surface(), known)
    assert_allclose([e.max for e in errors], 0.001, rtol=1e-9)
    assert errors_of(half, plane_surface(), np.ones((11, 9), bool))[1].max > 0.04


def test_errors_are_largest_at_the_border_of_what_counts():
    """The mesh rises towards the last site that met it: the maximum is there, between the samples of large facets."""
    start = 0.097  # x + y from which it rises
    places = np.array([(0, 0), (start, 0), (start - 0.08, 0.08), (0, 0.08), (0.1, 0), (0.1, 0.08)])
    heights = np.maximum(places.sum(axis=1) - start, 0)
    mesh = weld(np.column_stack((places, heights)), [(0, 1, 2), (0, 2, 3), (1, 4, 5), (1, 5, 2)])
    known = np.zeros((11, 9), bool)
    known[:6, :6] = True  # the sites up to x = y = 0.05
    found, _ = errors_of(mesh, plane_surface(), known, 1)
    assert_allclose(found.max, 0.1 - start, rtol=2e-3)


def test_errors_of_a_closed_surface_hold_over_the_seam():
    """A cylinder: no sample at the seam is left out or measured to the wrong side."""
    fit = fit_surface(cylinder(), TubeGrid(6, 30, Z_AXIS, 0.004))
    sagitta = RADIUS * (1 - np.cos(np.pi / 96))
    assert fit.errors.hausdorff < sagitta
    points = sample_faces(cylinder(), 0.002)[0]
    near = (points[:, 2] > 0.01) & (points[:, 2] < LENGTH - 0.01)
    assert footpoints(fit.surface, points[near])[1].max() < sagitta


def brute_force(fit, number):
    """Return mean and maximum from random points of the surface to the mesh, and from those of the mesh back.

    Corners of the mesh and edges of the surface are among the points of the maxima.
    """
    rng = np.random.default_rng(11)
    uv = rng.random((4 * number, 2))
    on_edge = np.column_stack((rng.integers(0, 2, number), rng.random(number)))
    if not fit.surface.closed[1]:
        on_edge = np.concatenate((on_edge, on_edge[:, ::-1]))
    found = []
    for at in (uv, on_edge):
        at = at[fit.is_measured(at)]
        r = fit.surface.derivatives(at)
        found.append((closest(fit.mesh, r[0, 0])[0], np.linalg.norm(np.cross(r[1, 0], r[0, 1]), axis=1)))
    there = np.average(found[0][0], weights=found[0][1]), max(part.max(initial=0) for part, _ in found)
    mesh, is_cover = fit._mesh_inside
    number //= 3  # footpoints take long
    face = rng.choice(len(mesh.faces), number, p=mesh.face_areas / mesh.face_areas.sum())
    inner = np.einsum("kc,kcd->kd", rng.dirichlet(np.ones(3), number), mesh.triangles[face])
    corners = mesh.triangles.reshape(-1, 3)  # as of the face that they belong to
    back = []
    for at, of in ((inner, face), (corners, np.repeat(np.arange(len(mesh.faces)), 3))):
        uv, distance = footpoints(fit.surface, at)
        counts = is_inside(fit.surface, uv, ~np.isnan(fit.residuals))
        counts &= (fit.surface.normals(uv) * mesh.face_normals[of]).sum(axis=1) > 0.5
        counts &= True if is_cover is None else is_cover(at)
        back.append(distance[counts])
    return there, (back[0].mean(), max(part.max() for part in back))


def bounded():
    """Return the fit of a part of the wrist whose boundary, an ellipse, cuts the cells of the surface."""
    turn = np.linspace(0, TURN, 30, endpoint=False)
    loop = wrist_surface().points(np.column_stack((0.5 + 0.3 * np.cos(turn), 0.3 + 0.2 * np.sin(turn))))
    grid = Grid(Tube(Z_AXIS, boundary=(tuple(map(tuple, loop.tolist())),)), Size(7, 9), "uniform")
    return fit_grid(wrist(), grid, (3, 3))


@pytest.mark.parametrize(
    "fit",
    [
        lambda: fit_surface(wrist(), TubeGrid(10, 20, Z_AXIS, 0.004, "uniform")),
        lambda: fit_surface(wrist(), SectorGrid(6, 9, -1.0, 1.5, Z_AXIS, 0.003)),
        bounded,
    ],
)
def test_errors_are_those_of_brute_force(fit):
    """Means within 1 %, maxima no less than 120 000 random points find."""
    fit = fit()
    there, back = brute_force(fit, 30_000)
    errors = fit.errors
    assert_allclose(errors.surface_to_mesh.mean, there[0], rtol=0.01)
    assert there[1] <= errors.surface_to_mesh.max * 1.0001
    assert_allclose(errors.mesh_to_surface.mean, back[0], rtol=0.015)
    assert back[1] <= errors.mesh_to_surface.max * 1.01
    assert 0 < errors.mesh_to_surface.uncertainty < 0.05 * back[0]
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


def test_maximum_of_the_report_is_at_its_place():
    """The point, its parameters and its distance belong together."""
    fit = fit_surface(wrist(), TubeGrid(6, 12, Z_AXIS, 0.004, "uniform"))
    uv, point, distance = fit.worst
    assert distance == fit.errors.surface_to_mesh.max >= np.nanmax(fit.deviations)
    assert_allclose(fit.surface.points(uv[None])[0], point, rtol=0, atol=1e-15)
    assert_allclose(closest(fit.mesh, point[None])[0][0], distance, rtol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("name", LINKS)
def test_errors_of_real_links_are_those_of_brute_force(name):
    """Also where the surface is far from the mesh, as the plain nets of these links are.

    The maxima are found by a search. Random points of the mesh miss narrow peaks: their largest is up to 6 % less.
    """
    path = DATA / f"{name}.stl"
    if not path.exists():
        pytest.skip(f"no {path.name} here")
    mesh = cut_cover(load_mesh(path), CoverSpec())
    fit = fit_lines(mesh, TubeGrid(10, 40, spacing="uniform").line_grid(mesh, (3, 3)), (3, 3))
    there, back = brute_force(fit, 10_000)
    errors = fit.errors
    assert_allclose(errors.surface_to_mesh.mean, there[0], rtol=0.03)
    assert there[1] <= errors.surface_to_mesh.max * 1.0001
    assert_allclose(errors.mesh_to_surface.mean, back[0], rtol=0.1)
    assert back[1] <= errors.mesh_to_surface.max * 1.0001 <= back[1] * 1.1


def test_inner_wall_of_a_shell_is_no_error():
    """The faces of a wall 3 mm below the surface face the other side."""
    inner = cylinder(RADIUS - 0.003)
    outer = cylinder()
    faces = np.concatenate((outer.faces, inner.faces[:, ::-1] + len(outer.vertices)))
    shell = weld(np.concatenate((outer.vertices, inner.vertices)), faces)
    fit = fit_surface(shell, TubeGrid(6, 12, Z_AXIS, 0.004, "uniform"))
    assert fit.errors.mesh_to_surface.max < 1e-4
