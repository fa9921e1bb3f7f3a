"""Directions of forces: offset of the sensor, presses that lean, signs."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from skin_calib_addon.validation import Touches, directions_of, placements
from skin_calib_addon.validation.flat import flat_places
from skin_calib_addon.validation.touches import lines_of_action
from tests.samples import RADIUS, sheet, small_calibration

ROWS, COLUMNS, PITCH = 6, 20, 0.01
SHEET = sheet(ROWS, COLUMNS, PITCH)
CALIBRATION = small_calibration(patches=(SHEET,))
MIDDLE = flat_places(SHEET, SHEET.taxels.index).mean(axis=0)[None]


def presses(seed, count=40, offset=(0, 0, 0), of_contact=(0, 0, 0), lean=0.0):
    """Return touches of 8 N with directions that scatter by 11 degrees, and their true places are in random cells."""
    rng, taxels = np.random.default_rng(seed), SHEET.taxels
    rows = rng.integers(0, ROWS * COLUMNS, count)
    inside = rng.uniform(-0.5, 0.5, (count, 2)) * PITCH
    places = taxels.positions_link[rows] + np.einsum("mk,mkc->mc", inside, taxels.axes_link[rows])
    forces = 8 * (-np.cos(lean) * taxels.normals_link[rows] + np.sin(lean) * taxels.tangents_link[rows])
    forces += rng.normal(0, 1.6, (count, 3)) + of_contact
    moments = np.cross(places, forces) + rng.normal(0, 5e-3, (count, 3))
    wrenches = np.column_stack((forces + offset + rng.normal(0, 0.2, (count, 3)), moments))
    ids = tuple(taxels.ids[row] for row in rows)
    return Touches(ids, np.arange(count) + 2, *lines_of_action(wrenches), wrenches=wrenches)


def codes(touches):
    return {warning.code for warning in directions_of(CALIBRATION, touches)[0].warnings()}


def test_an_offset_of_the_sensor_is_named_and_removed():
    """1.5 N at presses of 8 N; the displacement is then within 3 of its standard errors, which include the offset."""
    for seed in range(6):
        offset = 1.5 * np.eye(3)[seed % 3]
        touches = presses(seed, offset=offset)
        found, corrected = directions_of(CALIBRATION, touches)
        assert "force-offset" in codes(touches) and found.is_of_sensor
        assert (np.abs(found.offset - offset) < 4 * np.sqrt(np.diag(found.offset_covariance))).all()
        assert_allclose(corrected.wrenches[:, :3], touches.wrenches[:, :3] - found.offset, rtol=0, atol=1e-12)
        (placement,) = placements(CALIBRATION, touches)
        shift, error = placement.motion.at(MIDDLE)[0], placement.motion.sigma_at(MIDDLE)[0]
        assert (np.abs(shift) < np.minimum(3 * error, 0.0025)).all()


def test_a_tiny_offset_is_removed_without_a_warning():
    """It is that of the tare: 0.02 N at presses of 8 N."""
    rng, taxels, rows = np.random.default_rng(0), SHEET.taxels, np.arange(0, ROWS * COLUMNS, 3)
    forces = -8 * taxels.normals_link[rows] + rng.normal(0, 0.002, (len(rows), 3))
    moments = np.cross(taxels.positions_link[rows], forces)
    wrenches = np.column_stack((forces + (0.02, 0, 0), moments))
    ids = tuple(taxels.ids[row] for row in rows)
    touches = Touches(ids, np.arange(len(rows)), *lines_of_action(wrenches), wrenches=wrenches)
    found, _ = directions_of(CALIBRATION, touches)
    assert_allclose(found.offset, (0.02, 0, 0), rtol=0, atol=2e-3)
    assert found.is_of_sensor and codes(touches) == set()


def test_a_force_of_the_contact_stays_in_the_lines_of_action():
    """Its moment agrees with it: the lines go through the touches."""
    found, touches = directions_of(CALIBRATION, given := presses(0, of_contact=(0, 0, 3.0)))
    assert touches is given and not found.is_of_sensor
    assert_allclose(found.offset, (0, 0, 3), atol=1.0)
    warning = next(found.warnings())
    assert (
        warning.code == "force-offset"
        and "It stays in the lines of action: the moments agree with it" in warning.message
    )


def test_forces_along_the_normals_give_no_warning():
    """In 40 sets with scatter."""
    assert not set().union(*(codes(presses(seed)) for seed in range(100, 140)))


@pytest.mark.parametrize("angle", [25, 70])
def test_presses_that_lean_are_named(angle):
    """The mean angle along the rows has a standard error."""
    touches = presses(1, lean=np.deg2rad(angle))
    found, _ = directions_of(CALIBRATION, touches)
    assert "oblique-touches" in codes(touches)
    assert_allclose(np.rad2deg(found.mean_tilt), (angle, 0), atol=12)
    assert f"angle to the normal: mean {np.rad2deg(found.angles.mean()):.1f}, along the rows " in found.summary()


def test_a_skin_that_moved_round_a_limb_is_no_lean():
    """Presses along the normals: the normals are those where the touches are, and the displacement is along an arc."""
    rng, flat = np.random.default_rng(0), flat_places(SHEET, SHEET.taxels.index)
    rows = rng.permutation(ROWS * COLUMNS)[:60]
    x, y = (flat[rows] + (0.008, 0) + rng.uniform(-0.5, 0.5, (60, 2)) * PITCH).T
    normals = np.column_stack((np.cos(x / RADIUS), np.sin(x / RADIUS), 0 * x))
    places = RADIUS * normals + np.outer(y + PITCH / 2, (0, 0, 1))
    forces = -8 * normals + rng.normal(0, 0.2, (60, 3))
    wrenches = np.column_stack((forces, np.cross(places, forces)))
    ids = tuple(SHEET.taxels.ids[row] for row in rows)
    touches = Touches(ids, np.arange(60), *lines_of_action(wrenches), wrenches=wrenches)
    found, _ = directions_of(CALIBRATION, touches)
    assert codes(touches) == set() and np.rad2deg(found.angles).max() < 6
    assert_allclose(np.rad2deg(found.mean_tilt), 0, atol=1)
    (placement,) = placements(CALIBRATION, touches)
    offsets = np.column_stack((x, y)) - flat[rows]
    assert_allclose(placement.offsets[:, :2], offsets, rtol=0, atol=4e-4)
    assert_allclose(placement.places, places, rtol=0, atol=4e-4)
    (placement,) = placements(CALIBRATION, Touches(ids, np.arange(60), places + 0.001 * normals, np.zeros((60, 3))))
    assert_allclose(placement.offsets, np.column_stack((offsets, np.full(60, 0.001))), rtol=0, atol=2e-4)


def test_signs_of_forces_are_checked():
    """A pull between presses is named by its line; pulls alone are a note."""
    touches = presses(2)
    wrenches = touches.wrenches.copy()
    wrenches[5] *= -1
    mixed = Touches(touches.taxels, touches.lines, *lines_of_action(wrenches), wrenches=wrenches)
    (warning,) = directions_of(CALIBRATION, mixed)[0].warnings()
    assert warning.code == "force-sign" and "1 of 40 forces have the opposite sign: line 7." in warning.message
    pulls = Touches(touches.taxels, touches.lines, *lines_of_action(-touches.wrenches), wrenches=-touches.wrenches)
    (note,) = directions_of(CALIBRATION, pulls)[0].warnings()
    assert (note.code, note.severity) == ("force-sign", "note")
    (note,) = directions_of(CALIBRATION, pulls)[0].warnings(in_order=False)  # the sign can look like another order
    assert note.code == "force-sign"


def test_few_forces_say_nothing():
    """And no force at all."""
    assert directions_of(CALIBRATION, presses(0, count=7))[0] is None
    points = Touches(("s0.0",) * 9, np.arange(9), np.zeros((9, 3)), np.zeros((9, 3)))
    assert directions_of(CALIBRATION, points) == (None, points)


def test_forces_along_the_skin_are_ninety_degrees_off():
    """None has a point on the skin: no order of the channels is judged, and nothing moves."""
    ids, places = SHEET.taxels.ids[:12], SHEET.taxels.positions_link[:12]
    forces = np.tile((0.0, 0.0, -5.0), (12, 1))
    wrenches = np.column_stack((forces, np.cross(places, forces)))
    touches = Touches(ids, np.arange(12) + 2, *lines_of_action(wrenches), wrenches=wrenches)
    found, _ = directions_of(CALIBRATION, touches)
    assert_allclose(found.angles, np.pi / 2)
    assert "oblique-touches" in codes(touches)
    (placement,) = placements(CALIBRATION, touches)
    assert not placement.wiring.order.words and placement.motion is None
    assert {one.code for one in placement.warnings()} == {"grazing-touch"}
