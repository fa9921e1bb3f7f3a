"""Moving wrenches, observed components, and virtual wrenches."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.testing import assert_allclose

from skin_calib_addon.runtime import proximity, wrench
from tests.samples import sheet
from tests.soles import cell_patch, skin_of, sole_patch

UP = np.array([0, 0, 1.0])
vectors = st.lists(st.floats(-10, 10), min_size=3, max_size=3).map(np.array)


def pose_of(axis, shift):
    """Return a pose with a rotation vector and a translation."""
    angle = np.linalg.norm(axis)
    x, y, z = axis / angle if angle else UP
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    pose = np.eye(4)
    pose[:3, :3] += np.sin(angle) * K + (1 - np.cos(angle)) * K @ K
    pose[:3, 3] = shift
    return pose


@given(force=vectors, point=vectors, axis=vectors, shift=vectors)
def test_moved_wrench_is_that_of_the_moved_force(force, point, axis, shift):
    """A moved, turned or carried wrench equals that of the moved force."""
    pose = pose_of(axis, shift)
    here = np.concatenate((force, np.cross(point, force)))
    moved, pushed = pose[:3, :3] @ point + shift, pose[:3, :3] @ force
    assert_allclose(wrench.carried(here, pose), np.concatenate((pushed, np.cross(moved, pushed))), atol=1e-9)
    assert_allclose(wrench.about(here, shift)[3:], np.cross(point - shift, force), atol=1e-9)
    assert_allclose(wrench.turned(here, pose[:3, :3])[3:], pose[:3, :3] @ here[3:], atol=1e-9)


@given(force=vectors, moment=vectors)
def test_line_of_action_gives_the_wrench_back(force, moment):
    """The nearest point and the free moment give the wrench back.

    A wrench without force has no line (paper eq. 6 to 9).
    """
    line = wrench.line_of_action(np.concatenate((force, moment)))
    if line is None:
        assert np.linalg.norm(force) == 0
        return
    if np.linalg.norm(force) < 1e-3:
        return
    point, free = line
    assert abs(point @ force) < 1e-6 * (1 + np.abs(point).max() * np.abs(force).max())
    again = np.cross(point, force) + free * force / np.linalg.norm(force)
    assert_allclose(again, moment, atol=1e-8)


def test_flat_sole_feels_three_of_six_components():
    """Lateral forces and the moment about the normal are not observed; eq. 4.23 of the thesis claims all six."""
    sole = skin_of(sole_patch())
    assert sole.observable.tolist() == [False, False, True, True, True, False] and sole.rank == 3
    forces = np.random.default_rng(0).uniform(0, 50, 42)
    assert (sole.update(forces, 0.0).wrench[[0, 1, 5]] == 0).all()
    tube = skin_of(sheet(4, 22, 0.01))
    assert tube.observable.tolist() == [True, True, False, True, True, False] and tube.rank == 4
    both = skin_of(sole_patch(), sheet(4, 22, 0.01))
    assert both.rank == 5 and both.observable.tolist() == [True, True, True, True, True, False]


@pytest.mark.parametrize("tilt, is_observed", [(0.004, False), (0.007, True)])
def test_lateral_force_is_observed_from_half_a_percent_on(tilt, is_observed):
    """One normal is tilted: its force along x is 0.4 or 0.7 % of the vertical one."""
    patch = sole_patch()
    normals = patch.taxels.normals_link.copy()
    normals[0] = (tilt, 0.0, -np.sqrt(1 - tilt**2))
    skin = skin_of(cell_patch(patch.taxels.positions_link, normals, patch.taxels.corners_link))
    assert skin.observable[0] == is_observed


def test_pressure_driven_wrench_is_strong_where_the_area_is_small():
    """The factor is the gain over the area (thesis eq. 3.27), with a minimum area."""
    felt = np.array([0, 0, 10.0, 1, 0, 0])
    assert_allclose(wrench.pressure_driven(felt, 0.002, 0.001), felt / 2)
    assert np.isfinite(wrench.pressure_driven(felt, 0.0, 0.001)).all()
    assert_allclose(wrench.pressure_driven(felt, 0.0, 0.001), felt * 0.001 / wrench.MIN_CONTACT_AREA)


def test_proximity_pushes_away_from_what_is_near():
    """A foot over the ground is lifted against its normals, with negative virtual power when it moves down."""
    sole = skin_of(sole_patch())
    distances = np.full(42, 0.015)
    lifted = wrench.proximity_wrench(sole.geometry, distances, 0.02, 1e5)
    assert_allclose(lifted[2], 1e5 * sole.areas.sum() * 0.005)
    assert lifted @ np.array([0, 0, -0.3, 0, 0, 0]) < 0
    distances[:] = (0.03, np.inf, np.nan) * 14
    assert (wrench.proximity_wrench(sole.geometry, distances, 0.02, 1e5) == 0).all()
    distances[:] = -1.0  # nearer than touching is touching
    assert_allclose(wrench.proximity_wrench(sole.geometry, distances, 0.02, 1e5)[2], 1e5 * sole.areas.sum() * 0.02)


def test_too_near_to_measure_pushes_fully():
    """Minus infinity is what ROS sends for an object that is too near (REP 117); masked numbers are nothing."""
    sole = skin_of(sole_patch())
    near = np.full(42, -np.inf)
    assert_allclose(wrench.proximity_wrench(sole.geometry, near, 0.02, 1e5)[2], 1e5 * sole.areas.sum() * 0.02)
    assert proximity.preemptive_polygon(sole.ground, near, 0.01).area > 0
    masked = np.ma.array(np.zeros(42), mask=True)
    assert (wrench.proximity_wrench(sole.geometry, masked, 0.02, 1e5) == 0).all()
    assert proximity.preemptive_polygon(sole.ground, masked, 0.01).kind == "empty"
    assert np.isnan(wrench.distances_of(masked + 9.0, 0.02, 255.0)).all()
    assert (wrench.temperature_wrench(sole.geometry, masked + 90.0, 31.0, 10.0) == 0).all()


def test_proximity_does_not_depend_on_how_fine_the_skin_is():
    """Stiffness is per area: four times as many taxels on the same area give the same wrench."""
    coarse, fine = skin_of(sheet(4, 4, 0.01)), skin_of(sheet(8, 8, 0.005))
    near = [wrench.proximity_wrench(s.geometry, np.full(len(s.ids), 0.01), 0.02, 1e5) for s in (coarse, fine)]
    assert_allclose(near[0][:3], near[1][:3], rtol=0.15)  # the sheets' edges differ by half a cell
    assert_allclose(np.linalg.norm(near[0][:3]), np.linalg.norm(near[1][:3]), rtol=0.02)


def test_inverse_readings_of_nothing_are_no_touch():
    """The reading 0 means that nothing is in range; it is not distance zero."""
    distances = wrench.distances_of(np.array([0, 255, 51, 300], np.uint16), 0.02, 255.0)
    assert_allclose(distances, [np.inf, 0.0, 0.016, 0.0], atol=1e-15)
    assert np.isnan(wrench.distances_of([np.nan], 0.02, 255.0)[0])


def test_heat_pushes_the_link_away():
    """The force is along the inward normal, per area, and only above the limit."""
    sole = skin_of(sole_patch())
    warm = np.full(42, 20.0)
    assert (wrench.temperature_wrench(sole.geometry, warm, 31.0, 10.0) == 0).all()
    warm[:4] = (41.0, np.nan, np.inf, 31.0)
    hot = wrench.temperature_wrench(sole.geometry, warm, 31.0, 10.0)
    assert_allclose(hot[:3], [0, 0, 10 * 10.0 * sole.areas[0]])


def test_sole_wrench_switches_on_contact():
    """It is virtual in the air, real on the ground, and virtual while the contact is unknown."""
    real, virtual = np.ones(6), np.full(6, 2.0)
    assert wrench.sole_wrench(True, real, virtual) is real
    assert wrench.sole_wrench(False, np.zeros(6), virtual) is virtual
    assert wrench.sole_wrench(None, np.full(6, np.nan), virtual) is virtual
    assert wrench.lands_early(np.array([3.0, 0, 4, 9, 9, 9]), 4.9) and not wrench.lands_early(virtual, 3.5)


def test_preemptive_polygon_is_that_of_the_cells_near_the_ground():
    """Cells below the height count.

    The contours grow with the height; cells without a distance do not count (thesis 4.2.7).
    """
    sole = skin_of(sole_patch())
    distances = 0.01 + sole.positions[:, 0] / 20  # a slope that rises to the toes
    contours = proximity.height_contours(sole.ground, distances, np.array([0.003, 0.0075, 0.01, 0.03]))
    areas = [c.area for c in contours]
    assert areas == sorted(areas) and areas[0] == 0 and contours[0].kind == "empty"
    assert contours[2].bounds[1][0] < 0.03 and contours[3].bounds[1][0] > 0.12
    distances[:] = np.nan
    assert proximity.preemptive_polygon(sole.ground, distances, 1.0).kind == "empty"


@pytest.mark.parametrize("name", ["about", "carried"])
def test_unknown_wrench_stays_unknown(name):
    """A moved NaN wrench is NaN, not zero."""
    unknown = np.full(6, np.nan)
    assert np.isnan(getattr(wrench, name)(unknown, np.eye(4) if name == "carried" else np.ones(3))).all()


SOLE = skin_of(sole_patch())


@pytest.mark.parametrize(
    ("call", "problem"),
    [
        (lambda: wrench.pressure_driven(np.ones(6), 1e-4, -1.0), "gain must be positive and finite, not -1.0"),
        (lambda: wrench.pressure_driven(np.ones(6), 0.0, 1e-4, 0.0), "min_area must be positive and finite, not 0.0"),
        (lambda: wrench.distances_of([9.0], 0.02, -255.0), "full_scale must be positive and finite, not -255.0"),
        (lambda: wrench.distances_of([9.0], np.nan, 255.0), "detection_range must be positive and finite, not nan"),
        (lambda: wrench.proximity_wrench(SOLE.geometry, 0.01, 0.02, 1e5), r"shape \(\) are not one for each of 42"),
        (lambda: wrench.proximity_wrench(SOLE.geometry, [0.01], 0.02, 1e5), r"shape \(1,\) are not one for each"),
        (lambda: wrench.proximity_wrench(SOLE.geometry, np.ones(42), -0.02, 1e5), "detection_range must be positive"),
        (lambda: wrench.proximity_wrench(SOLE.geometry, np.ones(42), 0.02, -1e5), "stiffness must be zero or more"),
        (lambda: wrench.temperature_wrench(SOLE.geometry, [90.0], 31.0, 10.0), r"shape \(1,\) are not one for each"),
        (lambda: wrench.temperature_wrench(SOLE.geometry, np.ones(42), np.nan, 10.0), "limit nan of the temperature"),
        (lambda: wrench.temperature_wrench(SOLE.geometry, np.ones(42), 31.0, -10.0), "gain must be zero or more"),
        (lambda: wrench.lands_early(np.ones(6), np.nan), "threshold must be zero or more and finite, not nan"),
        (lambda: proximity.preemptive_polygon(SOLE.ground, [0.0], 0.01), r"shape \(1,\) are not one for each of 42"),
    ],
)
def test_wrong_values_of_virtual_wrenches_are_refused(call, problem):
    """They attracted, gave NaN, left heat without a force, or took one distance for all taxels."""
    with pytest.raises(ValueError, match=problem):
        call()


@given(
    distances=arrays(float, 42, elements=st.sampled_from([-np.inf, -0.1, 0.0, 0.01, 0.02, 0.5, np.inf, np.nan])),
    hidden=arrays(bool, 42),
)
def test_virtual_springs_lift_a_sole_by_no_more_than_all_of_them(distances, hidden):
    """Whatever the sensors deliver: no attraction, no NaN, and masked ones have no effect."""
    lifted = wrench.proximity_wrench(SOLE.geometry, np.ma.array(distances, mask=hidden), 0.02, 1e5)
    assert 0 <= lifted[2] <= 1e5 * 0.02 * SOLE.areas.sum() * (1 + 1e-9) and np.isfinite(lifted).all()
    distances[hidden] = np.nan
    np.testing.assert_array_equal(lifted, wrench.proximity_wrench(SOLE.geometry, distances, 0.02, 1e5))
