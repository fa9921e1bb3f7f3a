"""The stated uncertainty of taxels covers their errors as often as it says."""

import dataclasses

import numpy as np
import pytest
from numpy.testing import assert_allclose

from skin_calib_addon.calibration.model import Registration
from skin_calib_addon.common.arrays import unit
from skin_calib_addon.geometry import AcrossGrid, TubeGrid, fit_surface
from skin_calib_addon.skin import Landmark, SheetLattice, sheet_taxels, wrap_sheet
from skin_calib_addon.skin.uncertainty import (
    TaxelUncertainty,
    moved_rigidly,
    moved_within,
    taxel_uncertainty,
    usual_curvature,
)
from tests.shapes import RADIUS, Z_AXIS, cone, cylinder, sheet

ROWS, COLUMNS, PITCH = 6, 14, 0.008
MOUNTED = Registration(1e-3, np.deg2rad(1.0), (RADIUS, 0.0, 0.05))
DRAWS = 200


@pytest.fixture(scope="module")
def stated():
    """A sheet on a 24-gon: its taxels, their flat positions about the anchor, and their uncertainty."""
    fit = fit_surface(cylinder(around=24, along=6), TubeGrid(8, 16, Z_AXIS, 0.004, "uniform"))
    anchor = Landmark((ROWS // 2, COLUMNS // 2), MOUNTED.anchor)
    lattice = SheetLattice(ROWS, COLUMNS, (PITCH, PITCH))
    taxels = sheet_taxels(wrap_sheet(fit.error_field.surface, lattice, None, (0, 1.0, 0.2), landmarks=[anchor]), "skin")
    arms = PITCH * (taxels.index - anchor.cell)[:, ::-1]
    return taxels, arms, taxel_uncertainty(taxels, fit.error_field, moved_within(arms, MOUNTED.covariance))


def test_variances_that_rounding_makes_negative_are_zero():
    """A nearly exact fit has variances of 1e-25 m^2 with any sign; its taxels are the best known."""
    given = TaxelUncertainty(-1e-26 * np.eye(2)[None], np.array([-1.9e-25]), -1e-20 * np.eye(2)[None])
    assert given.sigma.tolist() == [[0.0, 0.0, 0.0]]
    assert dataclasses.replace(given, angle=20 * np.eye(2)[None]).sigma[0, 2] == np.pi  # files refuse larger angles
    assert np.isnan(dataclasses.replace(given, normal=np.array([np.nan])).sigma[0, 1])


def errors_over_sigma(stated, scale=1.0):
    """Errors along both axes, along the normal, and of the normal in its worst direction, over ``scale`` sigma.

    The truth is the exact cylinder, with the sheet unrolled on it after a random motion within its registration.
    """
    taxels, arms, uncertainty = stated
    rng = np.random.default_rng(7)
    sigma = scale * uncertainty.sigma
    across = np.cross(taxels.normals_link, taxels.tangents_link)
    axes = np.stack((taxels.tangents_link, across), axis=1)
    worst = np.linalg.eigh(uncertainty.angle)[1][:, :, -1]
    heading = np.arctan2(0.2, 1.0)
    turn = np.array(((np.cos(heading), np.sin(heading)), (-np.sin(heading), np.cos(heading))))
    found = []
    for _ in range(DRAWS):
        shift, angle = rng.normal(0, MOUNTED.origin, 2), rng.normal(0, MOUNTED.direction)
        c, s = np.cos(angle), np.sin(angle)
        around, up = ((arms @ ((c, s), (-s, c)) + shift) @ turn).T
        normals = np.column_stack((np.cos(around / RADIUS), np.sin(around / RADIUS), 0 * up))
        positions = RADIUS * normals + np.array((0, 0, 1.0)) * (up + MOUNTED.anchor[2])[:, None]
        along = np.einsum("nij,nj->ni", axes, positions - taxels.positions_link)
        tilt = np.einsum("nij,nj->ni", axes, normals - taxels.normals_link)
        found.append((along / sigma[:, :1], (tilt * worst).sum(axis=1) / sigma[:, 2]))
    along, angle = (np.concatenate([part[k] for part in found]) for k in (0, 1))
    height = (RADIUS - np.linalg.norm(taxels.positions_link[:, :2], axis=1)) / sigma[:, 1]
    return along.ravel(), height, angle


def covers(errors):
    """Whether 68 +- 5 % are within one sigma, and 95 +- 3 % within two."""
    return abs((np.abs(errors) < 1).mean() - 0.68) <= 0.05 and abs((np.abs(errors) < 2).mean() - 0.95) <= 0.03


def test_one_sigma_covers_two_thirds_of_the_errors(stated):
    """16 800 errors in each component: along the surface and of the normal as a normal distribution, the height too."""
    along, height, angle = errors_over_sigma(stated)
    assert covers(along) and covers(angle)
    assert (np.abs(height) < 2).mean() >= 0.93
    assert 1 / 1.7 < np.sqrt((height**2).mean()) < 1.45


@pytest.mark.parametrize("axis", [0, 1], ids=["along u", "along v"])
def test_slope_along_one_parameter_turns_the_normal_along_its_lines(axis):
    """With a slope along u only, the normal turns along the lines of u, and not across; likewise along v."""
    fit = fit_surface(cylinder(around=24, along=6), TubeGrid(8, 16, Z_AXIS, 0.004, "uniform"))
    lattice = SheetLattice(3, 4, (PITCH, PITCH))
    anchor = [Landmark((1, 2), MOUNTED.anchor)]
    taxels = sheet_taxels(wrap_sheet(fit.error_field.surface, lattice, None, (0, 0.3, 1.0), landmarks=anchor), "skin")
    slopes = np.zeros_like(fit.error_field.slopes)
    slopes[..., axis] = 1e-4
    field = dataclasses.replace(fit.error_field, slopes=slopes)
    angle = taxel_uncertainty(taxels, field, np.zeros((len(taxels.ids), 2, 2))).angle
    r = field.surface.derivatives(taxels.uv)
    ahead = unit(r[1, 0] if axis == 0 else r[0, 1])
    axes = np.stack((taxels.tangents_link, np.cross(taxels.normals_link, taxels.tangents_link)), axis=1)
    turn = np.einsum("nij,nj->ni", axes, ahead)
    assert_allclose(angle, 1e-4 * turn[:, :, None] * turn[:, None, :], atol=1e-12)


def test_registration_moves_far_taxels_more(stated):
    """At the anchor only the origin counts; a rotation moves a taxel across its arm."""
    along = moved_within(np.array(((0.0, 0.0), (0.1, 0.0), (0.0, 0.1))), MOUNTED.covariance)
    rotated = (0.1 * MOUNTED.direction) ** 2
    assert_allclose(along[0], 1e-6 * np.eye(2), rtol=1e-12)
    assert_allclose(along[1], np.diag((1e-6, 1e-6 + rotated)), rtol=1e-12)
    assert_allclose(along[2], np.diag((1e-6 + rotated, 1e-6)), rtol=1e-12)


def test_shift_and_rotation_can_be_correlated():
    """On a flat surface each motion moves a taxel by the shift, and by the rotation across its arm."""
    covariance = np.array(((4e-6, 1e-6, -2e-5), (1e-6, 1e-6, 1e-6), (-2e-5, 1e-6, 2e-4)))
    moves = np.array(((1, 0, -0.02), (0, 1, 0.05)))
    along = moved_within(np.array(((0.05, 0.02),)), covariance)
    assert_allclose(along[0], moves @ covariance @ moves.T, rtol=1e-12)


@pytest.mark.parametrize("sign", [1, -1], ids=["sphere", "hyperbolic plane"])
def test_paths_from_the_anchor_converge_or_diverge(sign):
    """Random motions of a skin whose rows are exact geodesics have the stated covariance.

    The truth has the metric ``x^2 + y^2 + sign z^2``: a sphere, or a hyperboloid of constant negative curvature.
    """
    radius, rng = 0.05, np.random.default_rng(3)
    metric = np.array((1.0, 1.0, sign))
    cos, sin = (np.cos, np.sin) if sign > 0 else (np.cosh, np.sinh)

    def move(point, velocity, carried):
        """Follow geodesics, shape (..., 3); carry vectors along them."""
        length = np.sqrt((velocity * metric * velocity).sum(axis=-1, keepdims=True)) + 1e-12
        ahead, angle = velocity / length, length / radius
        end = cos(angle) * point + radius * sin(angle) * ahead
        turned = -sign * sin(angle) * point / radius + cos(angle) * ahead
        return end, [v + (v * metric * ahead).sum(axis=-1, keepdims=True) * (turned - ahead) for v in carried]

    start, frame = np.array((0.0, 0.0, radius)), [np.array((1.0, 0, 0)), np.array((0, 1.0, 0))]
    arms = np.array(((0.0, 0.0), (0.03, 0.0), (0.0, 0.05), (-0.03, 0.04)))
    mounted = Registration(1e-4, 3e-3, (0.0, 0.0, 0.0))
    moves = np.zeros((len(arms), 4000, 2))
    shifts, turn = rng.normal(0, mounted.origin, (4000, 2)), rng.normal(0, mounted.direction, (4000, 1))
    point, (e, f) = move(start, shifts @ frame, frame)
    e, f = np.cos(turn) * e + np.sin(turn) * f, np.cos(turn) * f - np.sin(turn) * e
    for i, (a, b) in enumerate(arms):
        there, axes = move(start, a * frame[0] + b * frame[1], frame)
        off = (move(point, a * e + b * f, [])[0] - there) * metric
        moves[i] = np.stack([(off * axis).sum(axis=1) for axis in axes], axis=1)
    found = np.einsum("ndi,ndj->nij", moves, moves) / moves.shape[1]
    stated = moved_within(arms, mounted.covariance, sign / radius**2)
    scale = np.sqrt(stated[:, [0, 1], [0, 1]])
    scales = scale[:, :, None] * scale[:, None]
    assert_allclose(found / scales, stated / scales, atol=0.08)
    flat = moved_within(arms, mounted.covariance)
    assert (sign * (flat - stated)[2, 0, 0] > 0.2 * flat[2, 0, 0]).all()


@pytest.mark.parametrize(("radius", "curvature"), [(0.1, 100.0), (None, 0.0)], ids=["sphere", "cone"])
def test_usual_curvature_is_that_of_the_surface(radius, curvature):
    """On a sphere, and on a cone, which can be unrolled."""
    if radius:
        mesh = sheet(lambda x, y: np.sqrt(radius**2 - (x - 0.05) ** 2 - (y - 0.04) ** 2), cells=(60, 48))
        surface = fit_surface(mesh, AcrossGrid(12, 12, (0, 0, 1.0), (1.0, 0, 0), 0.02, "uniform")).surface
    else:
        surface = fit_surface(cone(), TubeGrid(8, 24, Z_AXIS, 0.004, "uniform")).surface
    uv = np.random.default_rng(0).uniform(0.2, 0.8, (50, 2))
    assert_allclose(usual_curvature(surface, uv), curvature, rtol=0.03, atol=3.0)


def test_taxels_of_a_file_move_rigidly(stated):
    """Random small motions of the frame have the stated variances along the surface and along the normal."""
    taxels = stated[0]
    mounted = dataclasses.replace(MOUNTED, anchor=tuple(taxels.positions_link.mean(axis=0)))
    along, height, tilt = moved_rigidly(taxels, mounted)
    rng = np.random.default_rng(2)
    shifts, turns = rng.normal(0, 1e-3, (20000, 1, 3)), rng.normal(0, mounted.direction, (20000, 1, 3))
    moves = shifts + np.cross(turns, taxels.positions_link - mounted.anchor)
    assert_allclose((moves * taxels.normals_link).sum(axis=2).var(axis=0), height, rtol=0.05)
    assert_allclose((moves * taxels.tangents_link).sum(axis=2).var(axis=0), along[:, 0, 0], rtol=0.05)
    assert tilt == mounted.direction**2
