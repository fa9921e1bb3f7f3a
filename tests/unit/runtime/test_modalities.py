"""Further modalities at run time: readings by name in, values in SI units out."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from skin_calib_addon.calibration import Modality, Response, ResponseTable
from skin_calib_addon.common.errors import InvalidReading
from skin_calib_addon.runtime import Body, Skin
from tests.samples import plane, small_calibration
from tests.soles import skin_of, sole_patch
from tests.unit.runtime.test_events import same

N = 42
NEAR = ResponseTable((0.0, 1000.0, 4000.0), (0.2, 0.05, 0.0))
CELSIUS = Response((-40.0, 0.05), (0.0, 4095.0))
MODALITIES = (
    Modality("proximity", "m", NEAR),
    Modality("temperature", "degC", CELSIUS, {"sole.5": 1, "sole.2": 0}),
    Modality("acceleration_x", "m/s^2", Response((0.0, 1.0))),
)
FORCE = np.full(N, 2.0)


def calibration():
    """Return a sole of 42 hexagons with three modalities; its readings of force are newtons."""
    return small_calibration(
        link="left_sole",
        patches=(sole_patch(),),
        surfaces=(plane(),),
        response=Response((0.0, 1.0)),
        modalities=MODALITIES,
    )


def sole():
    """Return the skin of this sole with thresholds."""
    return Skin(calibration(), switch_on=0.2, switch_off=0.1)


def test_values_are_those_of_the_responses():
    """Interpolated and evaluated one by one in Python; the array of the force is where it was."""
    skin, raw = sole(), np.arange(N) * 100
    frame = skin.update({"force": FORCE, "proximity": raw, "temperature": [1000, 1200]}, 0.0)
    near = frame.modalities["proximity"]
    expected = [0.2 - 0.15 * r / 1000 if r <= 1000 else 0.05 * (4000 - r) / 3000 if r < 4000 else 0.0 for r in raw]
    assert_allclose(near.values, expected, rtol=0, atol=1e-15)
    assert near.unit == "m" and near.known.all() and near.problem is None
    assert_array_equal(near.saturated, (raw == 0) | (raw >= 4000))
    warm = frame.modalities["temperature"]
    assert warm.values[2] == -40 + 0.05 * 1000 and warm.values[5] == -40 + 0.05 * 1200
    assert_array_equal(np.flatnonzero(warm.known), [2, 5])
    assert np.isnan(np.delete(warm.values, [2, 5])).all() and not warm.saturated.any()
    same(frame, sole().update(FORCE, 0.0))
    assert skin.modalities == {"proximity": "m", "temperature": "degC", "acceleration_x": "m/s^2"}


def test_modalities_that_are_not_given_are_unknown():
    """They are there in every frame, so that a controller needs no check for the name."""
    skin = sole()
    for readings in (FORCE, {"force": FORCE}, np.zeros(1), "text"):
        frame = skin.update(readings, 0.0)
        assert list(frame.modalities) == ["proximity", "temperature", "acceleration_x"]
        for value in frame.modalities.values():
            assert not value.known.any() and np.isnan(value.values).all() and "no reading" in value.problem
    assert skin_of(sole_patch()).update(FORCE, 0.0).modalities == {}


def test_unknown_values_are_nan():
    """NaN and masked numbers are unknown; infinity is an end of the response; masked taxels have no modality."""
    skin = sole()
    raw = np.full(N, 1000.0)
    raw[:3] = np.nan, np.inf, -np.inf
    given = np.ma.masked_array(raw, np.arange(N) == 5)
    skin.mask(["sole.7"])
    near = skin.update({"force": FORCE, "proximity": given}, 0.0).modalities["proximity"]
    assert_array_equal(np.flatnonzero(~near.known), [0, 5, 7])
    assert_array_equal(np.isnan(near.values), ~near.known)
    assert_allclose(near.values[[1, 2]], [0.0, 0.2], atol=0)
    assert_array_equal(np.flatnonzero(near.saturated), [1, 2])


@pytest.mark.parametrize(
    ("broken", "message"),
    [
        (np.zeros(N - 1), "the reading of proximity has 41 channels, the skin of left_sole needs 42"),
        (np.zeros((2, N)), "a reading of proximity must be one row of real numbers; this one is float64 of shape"),
    ],
)
def test_wrong_reading_of_a_modality_leaves_the_force(broken, message):
    """The modality is unknown and says why, the frame has a flag, and everything else is as without it."""
    frame = sole().update({"force": FORCE, "proximity": broken, "acceleration_x": FORCE}, 0.0)
    value = frame.modalities["proximity"]
    assert message in value.problem and not value.known.any() and np.isnan(value.values).all()
    assert frame.flags == {"modality"} and frame.problem is None and frame.touched
    assert frame.modalities["acceleration_x"].known.all()


def test_unknown_name_is_a_problem_of_the_frame():
    """A misspelt modality must not go unseen: nothing is known, the nearest name is named, the state stays."""
    skin = sole()
    frame = skin.update({"force": FORCE, "proximty": FORCE}, 0.0)
    assert frame.flags == {"wrong_type"} and frame.touched is None
    assert frame.problem == (
        "the skin of left_sole has no modality 'proximty'; it has force, proximity, temperature, acceleration_x"
    )
    plain = skin_of(sole_patch()).update({"force": FORCE, 3: FORCE}, 0.0)
    assert plain.problem == "the skin of left_sole has no modality 3; it has force"
    same(skin.update(FORCE, 0.1), sole().update(FORCE, 0.1))


def test_lost_force_keeps_the_other_modalities():
    """Without force, or with a broken one, contact is unknown and proximity is not."""
    for force, flag in ((None, "wrong_type"), (np.zeros(3), "wrong_length"), (np.full(N, np.nan), "blind")):
        readings = {"proximity": FORCE} if force is None else {"force": force, "proximity": FORCE}
        frame = sole().update(readings, 0.0)
        assert flag in frame.flags and frame.touched is None and frame.problem
        assert frame.modalities["proximity"].known.all()
    assert sole().update({"proximity": FORCE}, 0.0).problem == "the mapping has no reading of force; it has proximity"


def test_events_take_modalities_too():
    """The frame is that of `update` with the complete readings; wrong ones have the same effect."""
    full, events = sole(), sole()
    now, raw = FORCE.copy(), np.arange(N) * 90
    same(full.update(now, 0.0), events.update(now, 0.0))
    now[3] = 5.0
    for others in ({"proximity": raw}, {"proximity": raw[:3]}, {"proximty": raw}, {}):
        one = full.update({"force": now} | others, 0.1)
        other = events.update_events([3], [5.0], 0.1, others)
        same(one, other)
        for name, value in one.modalities.items():
            assert_array_equal(value.values, other.modalities[name].values)
            assert value.problem == other.modalities[name].problem
    refused = ({"nothing": raw}, "no modality"), (raw, "this is ndarray"), ({"force": now}, "a mapping with force")
    for others, problem in refused:
        frame = events.update_events([3], [1.0], 0.2, others)
        assert problem in frame.problem and frame.flags == {"wrong_type"} and frame.touched is None
    assert full.update(None, 0.2).touched is None
    same(full.update(now, 0.3), events.update_events([], [], 0.3))


def test_arrays_of_a_modality_are_read_only():
    """As those of the frame; the constants for missing modalities are used by later frames."""
    frame = sole().update({"force": FORCE, "proximity": FORCE}, 0.0)
    for value in frame.modalities.values():
        for array in (value.values, value.known, value.saturated):
            with pytest.raises(ValueError, match="read-only"):
                array[0] = 1


def test_batch_converts_modalities():
    """Row by row the same as in a loop."""
    rng = np.random.default_rng(2)
    force, raw = rng.uniform(0, 3, (20, N)), rng.uniform(-500, 5000, (20, N))
    raw[3, 4] = np.nan
    skin, times = sole(), np.arange(20) / 100
    skin.mask(["sole.9"])
    batch = skin.batch({"force": force, "proximity": raw}, times)
    assert list(batch.modalities) == ["proximity"]
    frames = [skin.update({"force": f, "proximity": r}, t) for f, r, t in zip(force, raw, times)]
    for name in ("values", "known", "saturated"):
        rows = [getattr(frame.modalities["proximity"], name) for frame in frames]
        assert_array_equal(getattr(batch.modalities["proximity"], name), rows)
    assert_allclose(batch.wrench, [frame.wrench for frame in frames], atol=1e-12)
    assert skin.batch(force).modalities == {}


@pytest.mark.parametrize(
    ("readings", "message"),
    [
        ({"force": np.ones((3, N)), "proximity": np.ones((2, N))}, "2 readings of proximity for 3 of force"),
        ({"force": np.ones((3, N)), "proximity": np.ones(N)}, "a reading of proximity must be rows of real numbers"),
        ({"force": np.ones((3, N)), "proximity": np.ones((3, 5))}, "the reading of proximity has 5 channels"),
        ({"force": np.ones((3, N)), "heat": np.ones((3, N))}, "no modality 'heat'"),
        ({"proximity": np.ones((3, N))}, "no reading of force"),
    ],
)
def test_batch_refuses_wrong_modalities(readings, message):
    """A batch raises an error, as for wrong forces."""
    with pytest.raises(InvalidReading, match=message):
        sole().batch(readings)


def test_tare_and_forces_take_the_force_alone():
    """A mapping there is refused with a sentence that says what to pass."""
    for call in (sole().tare, sole().forces):
        with pytest.raises(InvalidReading, match="this one is a mapping. Pass the readings of force alone"):
            call({"force": FORCE})


def test_body_passes_mappings_on():
    """Each link has its own modalities."""
    body = Body({"left": sole(), "right": skin_of(sole_patch())})
    frame = body.update({"left": {"force": FORCE, "proximity": FORCE}, "right": FORCE}, 0.0, {})
    assert frame.flags == {"left:no_pose", "right:no_pose"}
    poses = {"left": np.eye(4), "right": np.eye(4)}
    frame = body.update({"left": {"force": FORCE, "proximity": FORCE}, "right": FORCE}, 0.1, poses)
    assert frame.links["left"].modalities["proximity"].known.all() and frame.links["right"].modalities == {}
