"""Units from the size of a link, without false alarms."""

import numpy as np
import pytest

from skin_calib_addon.geometry.mesh.triangle_mesh import load_mesh
from skin_calib_addon.geometry.mesh.units import UNIT_NAMES, UNITS, likely_mistake, likely_unit
from tests.real.test_real_links import MESHES


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


def test_units_have_their_lengths():
    """The inch of 1959 is 25.4 mm; a name for each."""
    assert UNITS == {"m": 1.0, "mm": 0.001, "cm": 0.01, "in": 0.0254} and UNIT_NAMES.keys() == UNITS.keys()


@pytest.mark.skipif(not MESHES, reason="no real links here: ../shared/data/meshes has no STL file")
@pytest.mark.parametrize("path", MESHES, ids=lambda path: path.stem)
def test_real_link_is_in_metres_and_found_in_others(path):
    """No false alarm in its own unit; in millimetres it is noticed, and vice versa."""
    side = float(np.ptp(load_mesh(path).vertices, axis=0).max())
    assert likely_mistake(side) is None and likely_unit(side) == "m"
    assert likely_unit(side / UNITS["mm"]) == "mm"
    assert likely_mistake(side / UNITS["mm"])[0] == "mm" and likely_mistake(side * UNITS["mm"])[0] == "m"
