"""CoP, ZMP and supporting polygons of a link on the ground."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.testing import assert_allclose

from skin_calib_addon.runtime import Plane, convex_hull
from skin_calib_addon.runtime.frame import MIN_LOAD, zero_moment_point
from tests.samples import sheet
from tests.soles import SIDE, cell_patch, skin_of, sole_patch

N = 42
loads = hnp.arrays(float, N, elements=st.one_of(st.just(0.0), st.floats(0.5, 100)))


def turned(patch, rotation, shift):
    """Return a patch after a rigid motion."""
    taxels = patch.taxels
    return cell_patch(
        taxels.positions_link @ rotation.T + shift,
        taxels.normals_link @ rotation.T,
        taxels.corners_link @ rotation.T + shift,
    )


def rotation(seed):
    """Return a random rotation."""
    q, r = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    q = q * np.sign(np.diag(r))
    return q * np.linalg.det(q)


def test_sole_stands_on_the_plane_through_its_taxels():
    """The plane has the coordinates of the link.

    X forward, y left, z up. A skin around a limb has no ground by default.
    """
    skin = skin_of(sole_patch(height=-0.05))
    assert_allclose(skin.ground.plane.axes, np.eye(3), atol=1e-15)
    assert_allclose(skin.ground.plane.origin, (0, 0, -0.05), atol=1e-15)
    assert_allclose(skin.ground.centres, skin.positions[:, :2], atol=1e-15)
    limb = skin_of(sheet(4, 12, 0.01))
    frame = limb.update(np.ones(48), 0.0)
    assert limb.ground is None and frame.cop is None and frame.zmp is None
    assert (
        frame.reason == "the skin is not flat and has no ground; pass one to load()"
        and frame.polygon.outer.kind == "empty"
    )
    given_ground = skin_of(sheet(4, 12, 0.01), ground=Plane.through((-0.035, 0, 0), (1, 0, 0), (0, 0, 1)))
    assert 0 < given_ground.ground.standing_count < 48
    assert given_ground.update(np.ones(48), 0.0).cop is not None


def test_plane_coordinates_give_the_points_back():
    """Coordinates in the plane and the height give the point back.

    The origin is the projection of the frame's origin.
    """
    plane = Plane.through((1, 2, 3), (0, 0, 2), (0, 5, 1))
    points = np.random.default_rng(0).normal(size=(5, 3))
    back = plane.spatial(plane.flat(points)) + plane.heights(points)[:, None] * plane.axes[2]
    assert_allclose(back, points, atol=1e-14)
    assert_allclose(plane.origin, (0, 0, 3))
    assert_allclose(np.linalg.det(plane.axes), 1)
    for up, forward in (((0, 0, 0), (1, 0, 0)), ((1, 0, 0), (2, 0, 0)), ((0, 0, np.nan), (1, 0, 0))):
        with pytest.raises(ValueError, match="must not be zero and not be parallel"):
            Plane.through((0, 0, 0), up, forward)


@pytest.mark.parametrize("seed", range(3))
def test_wrench_in_a_plane_is_that_of_the_force_at_its_point(seed):
    """A force at a point, both in coordinates of the plane, has the wrench of the plane."""
    rng = np.random.default_rng(seed)
    force, point, origin = rng.normal(size=(3, 3))
    axes = rotation(seed)
    moved, pushed = axes @ (point - origin), axes @ force
    found = Plane(origin, axes).wrench(np.concatenate((force, np.cross(point, force))))
    assert_allclose(found, np.concatenate((pushed, np.cross(moved, pushed))), rtol=0, atol=1e-14)


@given(forces=loads, seed=st.integers(0, 99))
def test_cop_and_zmp_of_a_flat_sole_are_one_point(forces, seed):
    """For coplanar normal forces both definitions agree (Sardain & Bessonnet 2004), at any pose of the sole."""
    forces[0] = 0.0  # never full contact, at which the CoP knows more
    patch = turned(sole_patch(), rotation(seed), np.array([0.3, -1.0, 2.0]))
    frame = skin_of(patch).update(forces, 0.0)
    if forces.sum() < MIN_LOAD:
        assert frame.cop is None and frame.zmp is None and "N; a CoP needs 5 N" in frame.reason
        return
    assert frame.reason is None
    assert_allclose(frame.cop, frame.zmp, atol=1e-12)
    point = frame.ground.plane.spatial(frame.cop)
    assert_allclose(point, forces @ patch.taxels.positions_link / forces.sum(), atol=1e-12)


@given(slope=hnp.arrays(float, 2, elements=st.floats(-6, 6)), seed=st.integers(0, 99))
def test_cop_at_full_contact_is_exact_for_linear_pressure(slope, seed):
    """The correction gives the true centre of a linear pressure over hexagons."""
    patch = sole_patch()
    angle = np.random.default_rng(seed).uniform(0, 7)
    spin = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1.0]])
    taxels = turned(patch, spin, np.array([0.1, 0.05, 0.0])).taxels
    x = taxels.positions_link[:, :2] - taxels.positions_link[:, :2].mean(axis=0)
    pressure = 1.0 + x @ slope
    if pressure.min() < 0.1:
        return
    frame = skin_of(turned(patch, spin, np.array([0.1, 0.05, 0.0]))).update(2e4 * pressure * taxels.areas, 0.0)
    inside = 5 * SIDE**2 / 24  # second moment of a hexagon per area
    spread = (x.T @ x) / N
    expected = taxels.positions_link[:, :2].mean(axis=0) + (spread + inside * np.eye(2)) @ slope
    assert_allclose(frame.cop, expected, atol=1e-12)


def test_in_cell_correction_of_the_thesis_sole():
    """The factors for 42 hexagons are 1.0119 along and 1.0474 across.

    A fit to simulated contacts gives 1.0116 and 1.0464.
    """
    middle, correction = skin_of(sole_patch()).ground.full_contact_correction
    assert_allclose(np.diag(correction), (1.0119, 1.0474), atol=2e-4)
    assert_allclose(correction[[0, 1], [1, 0]], 0, atol=1e-15)


def test_zmp_counts_height_and_shear():
    """The ZMP includes heights and lateral forces, which the printed formula leaves out."""
    rng = np.random.default_rng(5)
    for _ in range(50):
        points, forces = rng.normal(size=(4, 3)), rng.normal(size=(4, 3))
        forces[:, 2] = rng.uniform(1, 5, 4)
        height = rng.normal()
        wrench = np.concatenate((forces.sum(axis=0), np.cross(points, forces).sum(axis=0)))
        x, y = zero_moment_point(wrench, height)
        moment = np.cross(points - (x, y, height), forces).sum(axis=0)
        assert_allclose(moment[:2], 0, atol=1e-12)
        by_points = (points[:, :2] * forces[:, 2:] - (points[:, 2:] - height) * forces[:, :2]).sum(axis=0)
        assert_allclose((x, y), by_points / forces[:, 2].sum(), atol=1e-12)
    assert zero_moment_point(np.zeros(6)) is None and zero_moment_point(np.array([0, 0, -1.0, 0, 0, 0])) is None
    assert zero_moment_point(np.array([0, 0, 1e-320, 1.0, 1.0, 0])) is None  # a force too small for a point


@given(forces=loads)
def test_polygons_contain_each_other(forces):
    """Guaranteed is in nominal, nominal is in outer; the CoP of partial contact is in the nominal polygon."""
    frame = skin_of(sole_patch()).update(forces, 0.0)
    polygon, active = frame.polygon, forces >= 0.2
    assert polygon.nominal.area <= polygon.outer.area and polygon.guaranteed.area <= polygon.nominal.area
    assert all(polygon.outer.margin(corner) > -1e-9 for corner in polygon.nominal.corners)
    assert all(polygon.nominal.margin(corner) > -1e-9 for corner in polygon.guaranteed.corners)
    skin = skin_of(sole_patch())
    assert all(polygon.outer.margin(c) > -1e-9 for c in skin.ground.corners[active].reshape(-1, 2))
    if frame.zmp is not None:
        assert polygon.nominal.margin(frame.zmp) > -1e-9


@given(active=hnp.arrays(bool, N), seed=st.integers(0, 2**32 - 1))
def test_guaranteed_polygon_lies_in_the_hull_of_any_contact(active, seed):
    """This is true for any point of contact in each active cell, even a corner."""
    patch, rng = sole_patch(), np.random.default_rng(seed)
    frame = skin_of(patch).update(np.where(active, 5.0, 0.0), 0.0)
    touching = patch.taxels.corners_link[np.arange(N), rng.integers(0, 6, N)][active, :2]
    true = convex_hull(touching)
    assert all(true.margin(corner) > -1e-9 for corner in frame.polygon.guaranteed.corners)


def test_guaranteed_polygon_is_the_largest_safe_one():
    """Each edge of a square of centres moves in by the extent of an asymmetric cell against its normal."""
    square = convex_hull([(0, 0), (1, 0), (1, 1), (0, 1)])
    cell = np.array([(-0.1, -0.2), (0.3, -0.2), (0.3, 0.4), (-0.1, 0.4)])
    low, high = square.eroded(cell).bounds
    assert_allclose(low, (0.3, 0.4), atol=1e-9)
    assert_allclose(high, (0.9, 0.8), atol=1e-9)
    assert convex_hull([(0, 0), (1, 0)]).eroded(cell).kind == "empty"


def test_taxels_on_the_side_of_a_foot_do_not_stand():
    """Pressure on the side of a foot changes the wrench, not the CoP and the polygon."""
    sole = sole_patch()
    side = cell_patch(
        np.array([[0.0, 0.07, 0.02]]),
        np.array([[0.0, 1.0, 0.0]]),
        np.array([[[-0.005, 0.07, 0.015], [-0.005, 0.07, 0.025], [0.005, 0.07, 0.025], [0.005, 0.07, 0.015]]]),
        name="side",
        first_channel=N,
    )
    skin = skin_of(sole, side)
    reading = np.concatenate((np.where(np.arange(N) < 20, 3.0, 0.0), [0.0]))
    free = skin.update(reading, 0.0)
    reading[N] = 30.0
    pushed = skin.update(reading, 0.01)
    assert_allclose(pushed.cop, free.cop, atol=1e-15)
    assert (pushed.polygon.outer.corners == free.polygon.outer.corners).all()
    assert_allclose(pushed.wrench[1], -30.0) and free.wrench[1] == 0.0
    assert_allclose(pushed.zmp - free.zmp, (0.0, 0.02 * 30 / 60), atol=1e-12)
