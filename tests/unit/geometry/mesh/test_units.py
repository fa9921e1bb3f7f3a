"""Units from the size of a link, without false alarms."""

import numpy as np
import pytest

from skin_calib_addon.geometry.mesh.units import is_plausible, likely_unit, possible_units


@pytest.mark.parametrize("side", [0.006, 0.02, 0.079, 0.4, 1.2, 2.9])
def test_link_in_its_unit_is_not_doubted(side):
    """From a fingertip to a torso: metres are metres, millimetres are millimetres."""
    assert is_plausible(side) and likely_unit(side) == "m" and likely_unit(side * 1e3) == "mm"


@pytest.mark.parametrize(
    "side, units",
    [
        (79.0, {"cm": 1e-2, "mm": 1e-3, "in": 0.0254}),
        (421.0, {"mm": 1e-3}),
        (4.5, {"cm": 1e-2, "in": 0.0254}),
        (7.9e-5, {"m": 1e3}),
    ],
)
def test_each_possible_unit_is_named_with_its_factor(side, units):
    """79 m can be centimetres, too; 4.5 m is no link in millimetres; 0.079 mm are metres."""
    assert not is_plausible(side) and possible_units(side) == units


@pytest.mark.parametrize("side", [1e6, 1e-9, 0.0, np.inf])
def test_size_that_no_unit_explains(side):
    """Nothing is proposed that would be as wrong."""
    assert not is_plausible(side) and possible_units(side) == {}
