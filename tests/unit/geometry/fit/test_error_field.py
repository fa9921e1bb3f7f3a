"""The error of a fit from the mesh alone: gaps under facets, the variance of the rest, noise."""

import numpy as np
import pytest
import trimesh
from numpy.testing import assert_allclose

from skin_calib_addon.common.errors import EmptySection
from skin_calib_addon.geometry import AcrossGrid, TubeGrid, fit_surface
from skin_calib_addon.geometry.fit.error_field import facet_gaps, vertex_normals
from skin_calib_addon.geometry.mesh.defects import coherent
from skin_calib_addon.geometry.mesh.triangle_mesh import TriangleMesh, at_rims
from tests.shapes import (
    LENGTH,
    RADIUS,
    Z_AXIS,
    cone,
    cylinder,
    dome,
    revolved,
    round_tube,
    sheet,
    subdivided,
    swept,
    welded,
    with_hole,
)

GRID = TubeGrid(8, 16, Z_AXIS, 0.004, "uniform")
UV = np.random.default_rng(0).uniform(0.02, 0.98, (4000, 2))


def rms(values):
    """Root mean square."""
    return float(np.sqrt(np.mean(values**2)))


def off(surface):
    """Distances of points of a surface from the cylinder about z."""
    return np.linalg.norm(surface.points(UV)[:, :2], axis=1) - RADIUS


def test_vertex_normals_are_exact_on_a_sphere():
    """Any triangulation gives the radial directions at inner vertices; those at the rim are known as such."""
    rng = np.random.default_rng(1)
    cap = sheet(lambda x, y: np.sqrt(0.2**2 - (x - 0.05) ** 2 - (y - 0.04) ** 2))
    rim = at_rims(cap.faces, len(cap.vertices))
    assert rim.sum() == 2 * (20 + 16)
    radial = (cap.vertices - (0.05, 0.04, 0.0)) / 0.2
    assert_allclose(vertex_normals(cap.vertices, cap.faces)[~rim], radial[~rim], atol=1e-12)
    face = rng.integers(0, len(cap.faces), 500)
    weights = rng.dirichlet((1, 1, 1), 500)
    points = (weights[..., None] * cap.triangles[face]).sum(axis=1)
    to_sphere = 0.2 - np.linalg.norm(points - (0.05, 0.04, 0.0), axis=1)
    inner = ~rim[cap.faces[face]].any(axis=1)
    assert_allclose(facet_gaps(cap, face, points)[0][inner], to_sphere[inner], rtol=0.01)


@pytest.mark.parametrize("steps", [4, 12], ids=lambda n: f"{n} facets")
def test_flat_sides_between_fillets_do_not_bulge(steps):
    """A square tube with rounded corners, as CAD programs write it: two triangles for each side."""
    half, radius = 0.032, 0.008
    bend = np.linspace(0, np.pi / 2, steps + 1)
    corner = half - radius + radius * np.column_stack((np.cos(bend), np.sin(bend)))
    section = np.concatenate(
        [corner @ ((np.cos(a), np.sin(a)), (-np.sin(a), np.cos(a))) for a in np.arange(4) * np.pi / 2]
    )
    mesh = swept(section)
    gaps, _ = facet_gaps(mesh, np.arange(len(mesh.faces)), mesh.triangles.mean(axis=1))
    wide = np.ptp(mesh.triangles[..., :2], axis=1).max(axis=1) > 0.04
    assert wide.sum() == 8
    assert_allclose(gaps[wide], 0, atol=1e-12)
    fit = fit_surface(mesh, TubeGrid(8, 40, Z_AXIS, 0.004))
    out = np.abs(fit.error_field.surface.points(UV)[:, :2]) - (half - radius)
    beyond = np.maximum(out, 0)
    off = np.where((out > 0).any(axis=1), np.hypot(*beyond.T), out.max(axis=1)) - radius
    assert rms(off) < 0.1e-3


@pytest.mark.parametrize(
    "shape",
    [trimesh.creation.icosphere(2, 0.05), trimesh.creation.capsule(0.06, 0.04, count=(16, 16))],
    ids=["triangles", "quadrilaterals"],
)
def test_divided_facets_have_the_gaps_of_whole_ones(shape):
    """Vertices inside facets are not on the true surface; with them it followed the facets."""
    mesh, grid = welded(shape), TubeGrid(8, 16, Z_AXIS, 0.02)
    whole, divided = (fit_surface(m, grid) for m in (mesh, subdivided(mesh)))
    before, after = (fit.error_field.surface.points(UV) for fit in (whole, divided))
    lift = np.linalg.norm(before - whole.surface.points(UV), axis=1).max()
    assert lift > 0.2e-3
    assert np.linalg.norm(after - before, axis=1).max() < 0.1 * lift


def test_facets_of_a_tube_keep_their_gaps_next_to_a_fillet_across_it():
    """A cylinder of 16 sides, each of two triangles, ends in a fillet of 5 mm: only bends around it count."""
    bend = np.linspace(0, np.pi / 2, 7)[:-1]
    fillet = np.column_stack((RADIUS - 0.005 * (1 - np.cos(bend)), 0.1 + 0.005 * np.sin(bend)))
    mesh = revolved(np.concatenate((((RADIUS, 0.0),), fillet)), 16)
    side = np.flatnonzero(np.ptp(mesh.triangles[..., 2], axis=1) > 0.05)
    assert len(side) == 32
    middle = mesh.triangles[side].mean(axis=1)
    true = RADIUS - np.linalg.norm(middle[:, :2], axis=1)
    gaps, _ = facet_gaps(mesh, side, middle)
    assert (gaps > 0.4 * true).all() and (gaps < 1.1 * true).all()


@pytest.mark.parametrize("flare", [-1, 1], ids=["narrower", "wider"])
@pytest.mark.parametrize("sides", [24, 240])
def test_long_facets_between_fillets_do_not_bend_along_their_length(sides, flare):
    """A cylinder whose sides are two long triangles each becomes narrower or wider in fillets at both ends."""
    bend = np.linspace(0, np.pi / 3, 7)
    fillet = np.column_stack((RADIUS + flare * 0.02 * (1 - np.cos(bend)), 0.15 + 0.02 * np.sin(bend)))
    mesh = revolved(np.concatenate((fillet[::-1] * (1, -1), fillet)), sides)
    side = np.flatnonzero(np.ptp(mesh.triangles[..., 2], axis=1) > 0.2)
    assert len(side) == 2 * sides
    middle = mesh.triangles[side].mean(axis=1)
    true = RADIUS - np.linalg.norm(middle[:, :2], axis=1)
    gaps, _ = facet_gaps(mesh, side, middle)
    assert (gaps > -1e-6).all() and (gaps < 1.1 * true).all()


@pytest.mark.parametrize("sides", [24, 96])
def test_facets_next_to_a_right_angle_have_no_gap(sides):
    """A flange: wide rings of flat faces meet short and long facets of a cylinder at right angles."""
    profile = np.array(((0.02, 0.0), (RADIUS, 0.0), (RADIUS, 0.02), (0.06, 0.02), (0.06, 0.14), (0.02, 0.14)))
    mesh = revolved(profile, sides)
    face = np.arange(len(mesh.faces))
    assert_allclose(facet_gaps(mesh, face, mesh.triangles.mean(axis=1))[0], 0, atol=1e-12)


@pytest.mark.parametrize("sides", [16, 96])
def test_the_bias_of_facets_is_removed(sides):
    """Facets cut into a cylinder; the surface through the vertices is on the cylinder."""
    fit = fit_surface(cylinder(around=sides, along=6), GRID)
    before, after = rms(off(fit.surface)), rms(off(fit.error_field.surface))
    assert after < 0.1 * before
    height, _ = fit.error_field.at(UV)
    assert 0.5 * after < np.sqrt(height.mean()) < 2.5 * after


@pytest.mark.parametrize("part", [0.3, 1.0])
def test_flipped_faces_keep_their_gaps(part):
    """Of a third of the faces, or of all, the winding is reversed: the surface through the vertices is the same."""
    mesh = cylinder(around=96, along=6)
    flipped = np.random.default_rng(0).random(len(mesh.faces)) < part
    mixed = TriangleMesh(mesh.vertices, np.where(flipped[:, None], mesh.faces[:, ::-1], mesh.faces))
    expected, found = (fit_surface(m, GRID).error_field.surface.points(UV) for m in (mesh, mixed))
    assert_allclose(found, expected, atol=1e-9)
    assert coherent(mesh) is mesh


def test_refusal_of_flipped_faces_names_them():
    """A grid across a face takes its direction from outward normals; the same faces without flips are fitted."""
    mesh, grid = dome(), AcrossGrid(8, 8, (0, 0, 1.0), margin=0.0)
    flipped = np.random.default_rng(0).random(len(mesh.faces)) < 0.3
    fit_surface(mesh, grid)
    mixed = TriangleMesh(mesh.vertices, np.where(flipped[:, None], mesh.faces[:, ::-1], mesh.faces))
    with pytest.raises(EmptySection, match="Some faces have a flipped normal.*Recalculate the normals outside"):
        fit_surface(mixed, grid)


def test_facets_between_the_sites_of_a_scan_make_no_waves():
    """100 sites around 96 facets beat four times; the fit is too stiff for the beats, and so is the known part."""
    mesh = cylinder(around=96, along=30)
    for seed in range(2):
        noise = np.random.default_rng(seed).normal(0, 1e-4, mesh.vertices.shape)
        fit = fit_surface(TriangleMesh(mesh.vertices + noise, mesh.faces), TubeGrid(10, 20, Z_AXIS))
        known = off(fit.error_field.surface) - off(fit.surface)
        assert fit.stiffness > 0 and known.mean() == pytest.approx(1.26e-5, rel=0.05) and known.std() < 1e-6


def test_the_shape_that_the_net_cannot_follow_is_stated():
    """Twelve waves around a tube are too short for 16 lines; the stated height has the size of the error."""

    def waves(angle, height):
        return RADIUS + 1e-4 * np.cos(12 * angle + 5 * height) * np.exp(-(((height - 0.4) / 0.3) ** 2))

    field = fit_surface(round_tube(waves, 240, 60), GRID).error_field
    x, y, z = field.surface.points(UV).T
    height = z / LENGTH
    error = np.hypot(x, y) - waves(np.arctan2(y, x), height)
    sigma = np.sqrt(field.at(UV)[0])
    assert rms(sigma) == pytest.approx(rms(error), rel=0.15)
    assert (np.abs(error) < 2 * sigma).mean() > 0.93
    near, far = np.abs(height - 0.4) < 0.2, height > 0.85
    assert rms(sigma[near]) > 3 * rms(sigma[far])  # it is local


def test_slopes_of_the_error_are_stated_along_both_parameters():
    """As above, with planes so near to each other that sites are three times as far apart around the tube."""

    def waves(angle, height):
        return RADIUS + 1e-4 * np.cos(12 * angle + 9 * height)

    field = fit_surface(round_tube(waves, 240, 60), TubeGrid(30, 12, Z_AXIS, 0.004, "uniform")).error_field
    stated = np.sqrt(field.at(UV)[1])
    for k, step in enumerate(1e-4 * np.eye(2)):  # along the axis, and around it
        before, after = (field.surface.points(UV + sign * step) for sign in (-0.5, 0.5))
        rise = [np.hypot(x, y) - waves(np.arctan2(y, x), z / LENGTH) for x, y, z in (before.T, after.T)]
        slope = (rise[1] - rise[0]) / np.linalg.norm(after - before, axis=1)
        assert rms(stated[:, k]) == pytest.approx(rms(slope), rel=0.25)


def test_the_noise_of_a_scan_is_not_a_gap():
    """Vertices with noise: the surface averages them, and the stated height has the size of the error."""
    ratios = []
    for seed in range(4):
        noise = np.random.default_rng(seed).normal(0, 2e-4, 90 * 40)
        fit = fit_surface(round_tube(lambda *_, noise=noise: RADIUS + noise, 90, 40), GRID)
        field = fit.error_field
        ratios.append((rms(off(field.surface)), np.sqrt(field.at(UV)[0].mean())))
        assert rms(off(field.surface)) < 1.05 * rms(off(fit.surface))
    error, sigma = np.array(ratios).T
    assert rms(sigma) == pytest.approx(rms(error), rel=0.3)


def test_holes_and_other_nets_give_a_field():
    """A hole has no samples; next to it the field is known, and all numbers are finite where the fit is trusted."""
    mesh = with_hole(cone(), (0.04, 0, 0.05), 0.012)
    fit = fit_surface(mesh, GRID)
    trusted = fit.is_trusted(UV)
    height, slopes = fit.error_field.at(UV)
    assert not trusted.all() and np.isfinite(height[trusted]).all() and np.isfinite(slopes[trusted]).all()
    chords = fit_surface(cylinder(around=24, along=6), GRID, chords=True)  # the facets are chords already
    assert_allclose(chords.error_field.surface.points(UV), chords.surface.points(UV), atol=3e-5)
