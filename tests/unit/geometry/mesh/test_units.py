"""Units from the size of a link, without false alarms."""

import numpy as np
import pytest

from skin_calib_addon.geometry.mesh.units import likely_mistake, likely_unit


@pytest.mark.parametrize("side", [0.006, 0.02, 0.079, 0.4, 1.2, 2.9])
def test_link_in_its_unit_is_not_doubted(side):
    """From a fingertip to a torso: metres are metres, millimetres are millimetres."""
    assert likely_mistake(side) is None and likely_unit(side) == "m" and likely_unit(side * 1e3) == "mm"


@pytest.mark.parametrize(
    "side, unit, factor", [(79.0, "mm", 1e-3), (421.0, "mm", 1e-3), (4.5, "cm", 1e-2), (7.9e-5, "m", 1e3)]
)
def test_mistaken_unit_is_named_with_the_factor(side, unit, factor):
    """79 m are millimetres, 4.5 m is no link in millimetres, 0.079 mm are metres."""
    assert likely_mistake(side) == (unit, pytest.approx(factor))


@pytest.mark.parametrize("side", [1e6, 1e-9, 0.0, np.inf])
def test_size_that_no_unit_explains(side):
    """Nothing is proposed that would be as wrong."""
    assert likely_mistake(side) == ("", 1.0)
