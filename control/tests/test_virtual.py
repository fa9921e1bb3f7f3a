"""Virtual wrenches, and polygons before a foot lands: from arrays, and from modalities of a frame."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.testing import assert_allclose, assert_array_equal

from skin_calib_addon.calibration import Modality, Response, ResponseTable
from skin_calib_addon.runtime import Skin
from skin_control import proximity, virtual
from tests.samples import plane, sheet, small_calibration
from tests.soles import skin_of, sole_patch

N = 42
NEAR = ResponseTable((0.0, 1000.0, 4000.0), (0.2, 0.05, 0.0))
CELSIUS = Response((-40.0, 0.05), (0.0, 4095.0))
FORCE = np.full(N, 2.0)
SOLE = skin_of(sole_patch())


def sole():
    """Return the skin of a sole of 42 hexagons with two modalities; its readings of force are newtons."""
    calibration = small_calibration(
        link="left_sole",
        patches=(sole_patch(),),
        surfaces=(plane(),),
        response=Response((0.0, 1.0)),
        modalities=(
            Modality("proximity", "m", NEAR),
            Modality("temperature", "degC", CELSIUS, {"sole.5": 1, "sole.2": 0}),
        ),
    )
    return Skin(calibration, switch_on=0.2, switch_off=0.1)


def test_pressure_driven_wrench_is_strong_where_the_area_is_small():
    """The factor is the gain over the area (thesis eq. 3.27), with a minimum area."""
    felt = np.array([0, 0, 10.0, 1, 0, 0])
    assert_allclose(virtual.pressure_driven(felt, 0.002, 0.001), felt / 2)
    assert np.isfinite(virtual.pressure_driven(felt, 0.0, 0.001)).all()
    assert_allclose(virtual.pressure_driven(felt, 0.0, 0.001), felt * 0.001 / virtual.MIN_CONTACT_AREA)


def test_proximity_pushes_away_from_what_is_near():
    """A foot over the ground is lifted against its normals, with negative virtual power when it moves down."""
    sole = skin_of(sole_patch())
    distances = np.full(42, 0.015)
    lifted = virtual.proximity_wrench(sole.geometry, distances, 0.02, 1e5)
    assert_allclose(lifted[2], 1e5 * sole.areas.sum() * 0.005)
    assert lifted @ np.array([0, 0, -0.3, 0, 0, 0]) < 0
    distances[:] = (0.03, np.inf, np.nan) * 14
    assert (virtual.proximity_wrench(sole.geometry, distances, 0.02, 1e5) == 0).all()
    distances[:] = -1.0  # nearer than touching is touching
    assert_allclose(virtual.proximity_wrench(sole.geometry, distances, 0.02, 1e5)[2], 1e5 * sole.areas.sum() * 0.02)


def test_too_near_to_measure_pushes_fully():
    """Minus infinity is what ROS sends for an object that is too near (REP 117); masked numbers are nothing."""
    sole = skin_of(sole_patch())
    near = np.full(42, -np.inf)
    assert_allclose(virtual.proximity_wrench(sole.geometry, near, 0.02, 1e5)[2], 1e5 * sole.areas.sum() * 0.02)
    assert proximity.preemptive_polygon(sole.ground, near, 0.01).area > 0
    masked = np.ma.array(np.zeros(42), mask=True)
    assert (virtual.proximity_wrench(sole.geometry, masked, 0.02, 1e5) == 0).all()
    assert proximity.preemptive_polygon(sole.ground, masked, 0.01).kind == "empty"
    assert np.isnan(virtual.distances_of(masked + 9.0, 0.02, 255.0)).all()
    assert (virtual.temperature_wrench(sole.geometry, masked + 90.0, 31.0, 10.0) == 0).all()


def test_proximity_does_not_depend_on_how_fine_the_skin_is():
    """Stiffness is per area: four times as many taxels on the same area give the same wrench."""
    coarse, fine = skin_of(sheet(4, 4, 0.01)), skin_of(sheet(8, 8, 0.005))
    near = [virtual.proximity_wrench(s.geometry, np.full(len(s.ids), 0.01), 0.02, 1e5) for s in (coarse, fine)]
    assert_allclose(near[0][:3], near[1][:3], rtol=0.15)  # the sheets' edges differ by half a cell
    assert_allclose(np.linalg.norm(near[0][:3]), np.linalg.norm(near[1][:3]), rtol=0.02)


def test_inverse_readings_of_nothing_are_no_touch():
    """The reading 0 means that nothing is in range; it is not distance zero."""
    distances = virtual.distances_of(np.array([0, 255, 51, 300], np.uint16), 0.02, 255.0)
    assert_allclose(distances, [np.inf, 0.0, 0.016, 0.0], atol=1e-15)
    assert np.isnan(virtual.distances_of([np.nan], 0.02, 255.0)[0])


def test_heat_pushes_the_link_away():
    """The force is along the inward normal, per area, and only above the limit."""
    sole = skin_of(sole_patch())
    warm = np.full(42, 20.0)
    assert (virtual.temperature_wrench(sole.geometry, warm, 31.0, 10.0) == 0).all()
    warm[:4] = (41.0, np.nan, np.inf, 31.0)
    hot = virtual.temperature_wrench(sole.geometry, warm, 31.0, 10.0)
    assert_allclose(hot[:3], [0, 0, 10 * 10.0 * sole.areas[0]])


def test_sole_wrench_switches_on_contact():
    """It is virtual in the air, real on the ground, and virtual while the contact is unknown."""
    real, springs = np.ones(6), np.full(6, 2.0)
    assert virtual.sole_wrench(True, real, springs) is real
    assert virtual.sole_wrench(False, np.zeros(6), springs) is springs
    assert virtual.sole_wrench(None, np.full(6, np.nan), springs) is springs
    assert virtual.lands_early(np.array([3.0, 0, 4, 9, 9, 9]), 4.9) and not virtual.lands_early(springs, 3.5)


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


@pytest.mark.parametrize(
    ("call", "problem"),
    [
        (lambda: virtual.pressure_driven(np.ones(6), 1e-4, -1.0), "gain must be positive and finite, not -1.0"),
        (lambda: virtual.pressure_driven(np.ones(6), 0.0, 1e-4, 0.0), "min_area must be positive and finite, not 0.0"),
        (lambda: virtual.distances_of([9.0], 0.02, -255.0), "full_scale must be positive and finite, not -255.0"),
        (lambda: virtual.distances_of([9.0], np.nan, 255.0), "detection_range must be positive and finite, not nan"),
        (lambda: virtual.proximity_wrench(SOLE.geometry, 0.01, 0.02, 1e5), r"shape \(\) are not one for each of 42"),
        (lambda: virtual.proximity_wrench(SOLE.geometry, [0.01], 0.02, 1e5), r"shape \(1,\) are not one for each"),
        (lambda: virtual.proximity_wrench(SOLE.geometry, np.ones(42), -0.02, 1e5), "detection_range must be positive"),
        (lambda: virtual.proximity_wrench(SOLE.geometry, np.ones(42), 0.02, -1e5), "stiffness must be zero or more"),
        (lambda: virtual.temperature_wrench(SOLE.geometry, [90.0], 31.0, 10.0), r"shape \(1,\) are not one for each"),
        (lambda: virtual.temperature_wrench(SOLE.geometry, np.ones(42), np.nan, 10.0), "limit nan of the temperature"),
        (lambda: virtual.temperature_wrench(SOLE.geometry, np.ones(42), 31.0, -10.0), "gain must be zero or more"),
        (lambda: virtual.lands_early(np.ones(6), np.nan), "threshold must be zero or more and finite, not nan"),
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
    lifted = virtual.proximity_wrench(SOLE.geometry, np.ma.array(distances, mask=hidden), 0.02, 1e5)
    assert 0 <= lifted[2] <= 1e5 * 0.02 * SOLE.areas.sum() * (1 + 1e-9) and np.isfinite(lifted).all()
    distances[hidden] = np.nan
    np.testing.assert_array_equal(lifted, virtual.proximity_wrench(SOLE.geometry, distances, 0.02, 1e5))


def test_pressure_driven_wrench_counts_an_area_of_25_square_millimetres():
    """Smaller contacts count as this."""
    wrench = np.array((0, 0, 1.0, 0, 0, 0))
    assert virtual.pressure_driven(wrench, 1e-6, 1e-3)[2] == pytest.approx(1e-3 / 25e-6)


def test_proximity_wrench_takes_the_modality():
    """It equals the sum over the taxels, from raw readings on; far and unknown taxels do not push."""
    skin = sole()
    raw = np.random.default_rng(1).integers(0, 4000, N).astype(float)
    raw[:4] = 0, np.nan, np.inf, -np.inf
    near = skin.update({"force": FORCE, "proximity": raw}, 0.0).modalities["proximity"]
    expected = np.zeros(6)
    for r, p, n, area in zip(raw, skin.positions, skin.normals, skin.areas):
        if np.isnan(r) or r <= 0:  # at the far end of the table: nothing in range
            continue
        distance = np.interp(r, NEAR.readings, NEAR.forces)
        push = -500.0 * area * max(0.25 - distance, 0.0) * n
        expected += np.concatenate((push, np.cross(p, push)))
    assert_allclose(virtual.proximity_wrench(skin.geometry, near, 0.25, 500.0), expected, rtol=1e-12, atol=1e-15)


def test_nothing_in_range_gives_no_virtual_wrench():
    """All sensors at their far end: no push, even if the range of the springs is longer than that of the sensors."""
    near = sole().update({"force": FORCE, "proximity": np.zeros(N)}, 0.0).modalities["proximity"]
    skin = sole()
    assert_array_equal(virtual.proximity_wrench(skin.geometry, near, 1.0, 500.0), np.zeros(6))
    assert proximity.preemptive_polygon(skin.ground, near, 1.0).kind == "empty"


def test_other_functions_take_modalities_too():
    """Polygon before landing and temperature wrench equal those of plain arrays."""
    skin, raw = sole(), np.linspace(100.0, 3900.0, N)
    frame = skin.update({"force": FORCE, "proximity": raw, "temperature": [1800, 2400]}, 0.0)
    near, warm = frame.modalities["proximity"], frame.modalities["temperature"]
    plain = np.interp(raw, NEAR.readings, NEAR.forces)
    one, other = (proximity.preemptive_polygon(skin.ground, d, 0.02) for d in (near, plain))
    assert_array_equal(one.corners, other.corners)
    hot = np.zeros(6)
    for i, celsius in ((2, 50.0), (5, 80.0)):
        push = -3.0 * skin.areas[i] * (celsius - 45.0) * skin.normals[i]
        hot += np.concatenate((push, np.cross(skin.positions[i], push)))
    assert_allclose(virtual.temperature_wrench(skin.geometry, warm, 45.0, 3.0), hot, rtol=1e-12)


def test_modality_in_another_unit_is_refused():
    """A temperature is no distance: an error of the program, named before it moves a robot."""
    skin = sole()
    frame = skin.update({"force": FORCE, "temperature": [1, 2]}, 0.0)
    with pytest.raises(ValueError, match="needs a modality in m, not in degC"):
        virtual.proximity_wrench(skin.geometry, frame.modalities["temperature"], 0.1, 1.0)
    with pytest.raises(ValueError, match="needs a modality in m, not in degC"):
        proximity.preemptive_polygon(skin.ground, frame.modalities["temperature"], 0.1)
    with pytest.raises(ValueError, match="needs a modality in K or degC, not in m"):
        virtual.temperature_wrench(skin.geometry, frame.modalities["proximity"], 0.1, 1.0)
