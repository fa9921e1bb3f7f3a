"""Further modalities of a calibration: kept in the file, checked, and converted by their own responses."""

import copy
import re

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from skin_calib_addon.calibration import (
    Modality,
    Response,
    ResponseTable,
    encode,
    to_document,
    validate,
)
from skin_calib_addon.common.encoding import checksum
from tests.samples import small_calibration

NEARNESS = ResponseTable((0.0, 1000.0, 4000.0), (0.2, 0.05, 0.0))
PROXIMITY = Modality("proximity", "m", NEARNESS)
TEMPERATURE = Modality("temperature", "degC", Response((-40.0, 0.05), (0.0, 4095.0)), {"h0": 1, "h1": 0})
MODALITIES = (PROXIMITY, TEMPERATURE)


def document(**changes):
    """Return a document with two modalities; the changes are those of the second one, ``...`` removes."""
    result = copy.deepcopy(to_document(small_calibration(modalities=MODALITIES)))
    for name, value in changes.items():
        if value is ...:
            del result["modalities"][1][name]
        else:
            result["modalities"][1][name] = value
    return result | {"checksum": checksum({k: v for k, v in result.items() if k != "checksum"})}


def test_equal_modalities_have_equal_bytes():
    """The order in which the channels were listed does not count."""
    listed = Modality("temperature", "degC", TEMPERATURE.response, {"h1": 0, "h0": 1})
    assert listed == TEMPERATURE
    one, other = (to_document(small_calibration(modalities=(m,))) for m in (listed, TEMPERATURE))
    assert encode(one) == encode(other)


@pytest.mark.parametrize(
    ("changes", "pointer", "message"),
    [
        ({"response": ...}, "/modalities/1", "lacks the member \"response\""),
        ({"unit": "mm"}, "/modalities/1/unit", "must be one of .*, not \"mm\""),
        ({"name": "force"}, "/modalities/1/name", "is \"force\", which `response` converts"),
        ({"response": {"kind": "table", "readings": [0, 1, 2], "forces": [0, 2, 1]}},
         "/modalities/1/response/forces/2", "reverses the direction"),
        ({"channels": {"h0": 0, "s0.1x": 1}}, "/modalities/1/channels/s0.1x", "did you mean \"s0.1\""),
        ({"channels": {"h0": 3, "h1": 3}}, "/modalities/1/channels/h1", "repeats 3 of /modalities/1/channels/h0"),
        ({"channels": {"h0": -1}}, "/modalities/1/channels/h0", "must be at least 0"),
    ],
)  # fmt: skip
def test_errors_name_their_place(changes, pointer, message):
    """Each mistake gives exactly one error with its JSON pointer, and the file is refused."""
    (finding,) = validate(document(**changes))
    assert finding.severity == "error" and finding.pointer == pointer
    assert re.search(message, finding.message), finding.message


@pytest.mark.parametrize("response", [NEARNESS, TEMPERATURE.response, Response((0.5,)), Response((0.0, -2.0))])
def test_values_are_those_of_the_response_without_the_limit_at_zero(response):
    """Below zero the values continue; where forces are positive they are equal to them, to the bit."""
    readings = np.linspace(-500.0, 5000.0, 200)
    values, forces = response.values(readings), response.newtons(readings)
    assert_array_equal(np.maximum(values, 0.0), forces)
    if isinstance(response, ResponseTable):
        expected = np.interp(readings, response.readings, response.forces)
    else:
        low, high = response.range or (-np.inf, np.inf)
        expected = sum(c * np.clip(readings, low, high) ** k for k, c in enumerate(response.coefficients))
    np.testing.assert_allclose(values, expected, rtol=1e-14, atol=1e-12)


def test_infinite_readings_are_the_ends_of_the_response():
    """REP 117: infinity says that nothing is in range, minus infinity that something is too near. NaN says nothing."""
    readings = np.array([-np.inf, np.inf, np.nan])
    assert_array_equal(Response().values(readings), readings)
    assert_array_equal(Response((0.0, -1.0)).values(readings), -readings)
    assert_array_equal(Response((0.0, 1.0), (0.1, 2.0)).values(readings), [0.1, 2.0, np.nan])
    assert_array_equal(NEARNESS.values(readings), [0.2, 0.0, np.nan])
    assert_array_equal(Response((3.0,)).values(readings), [3.0, 3.0, np.nan])
    assert_array_equal(Response((0.0, 0.0, 1e300)).values(np.array([1e10])), [np.nan])  # overflow
