"""Whether a foothold carries the robot, and how far to step aside."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from skin_calib_addon.runtime import Polygon, convex_hull
from skin_control.foothold import foothold_fractions, must_replan, sidestep, width_along
from tests import oracles
from tests.polygons import polygons, size_of

EMPTY = convex_hull([])
SOLE = Polygon(np.array([(-0.1, -0.05), (0.15, -0.05), (0.15, 0.05), (-0.1, 0.05)]))  # 250 mm x 100 mm
BEAM = Polygon(np.array([(0.0, -0.05), (0.06, -0.05), (0.06, 0.05), (0.0, 0.05)]))  # 60 mm across the sole
angles = st.floats(0, 7)


def test_fractions_are_of_the_sole():
    """Three areas are divided by that of the sole; a foot in the air covers nothing."""
    fractions = foothold_fractions(BEAM, 0.005, BEAM.inset(0.01), SOLE.area)
    assert fractions.hull == pytest.approx(0.24) and fractions.cells == pytest.approx(0.2)
    assert fractions.guaranteed == pytest.approx(0.04 * 0.08 / 0.025)
    air = foothold_fractions(EMPTY, 0.0, EMPTY, SOLE.area)
    assert (air.hull, air.cells, air.guaranteed) == (0, 0, 0)


@pytest.mark.parametrize("sole", [0.0, -0.1, np.nan, np.inf])
def test_the_sole_has_an_area(sole):
    """A sole without an area raises an error."""
    with pytest.raises(ValueError, match="sole area .* must be a positive number"):
        foothold_fractions(BEAM, 0.005, BEAM, sole)


@pytest.mark.parametrize("fraction", [0.85, 0.16, 0.33, 0.23])
def test_obstacles_of_the_thesis_are_classified(fraction):
    """With the threshold 0.8 of the thesis (table 2), the foot steps on the first obstacle only."""
    assert must_replan(fraction, 0.8) == (fraction != 0.85)


def test_unknown_fraction_means_a_new_plan():
    """A fraction equal to the threshold, or not a number, means a new plan."""
    assert must_replan(0.8, 0.8) and must_replan(np.nan, 0.8) and must_replan(0.9, np.nan)


def test_width_and_sidestep_of_a_beam():
    """The beam ends 160 mm from the heel and starts 150 mm from the toe; it is as wide as the foot."""
    assert width_along(BEAM, (1, 0)) == 0.06 and width_along(BEAM, (0, -3)) == pytest.approx(0.1)
    assert sidestep(BEAM, SOLE, (1, 0)) == pytest.approx(0.16)
    assert sidestep(BEAM, SOLE, (-2, 0), 0.02) == pytest.approx(0.15 + 0.02)
    assert sidestep(BEAM, SOLE, (0, 1)) == pytest.approx(0.1)
    assert sidestep(EMPTY, SOLE, (1, 0), 0.02) == 0 and width_along(EMPTY, (1, 0)) == 0
    assert width_along(convex_hull([(0.1, 0.2)]), (1, 1)) == 0


@given(polygons(), angles)
def test_width_is_the_largest_gap_of_corners(polygon, angle):
    """The width is the largest distance of two corners along the direction, and against it."""
    direction = np.array((np.cos(angle), np.sin(angle)))
    widest = max((a - b) @ direction for a in polygon.corners for b in polygon.corners)
    assert width_along(polygon, 5 * direction) == pytest.approx(widest, rel=1e-12, abs=1e-14 * size_of(polygon))
    assert width_along(polygon, -direction) == pytest.approx(widest, rel=1e-12, abs=1e-14 * size_of(polygon))


@given(polygons(), angles, st.floats(0, 0.1))
def test_a_sidestep_leaves_the_obstacle_behind(obstacle, angle, clearance):
    """After the step no point of the sole is nearer than the clearance, and its rear side is just as near."""
    direction = np.array((np.cos(angle), np.sin(angle)))
    step = sidestep(obstacle, SOLE, direction, clearance)
    rim = ((SOLE.corners + step * direction) @ direction).min()
    far = (obstacle.corners @ direction).max()
    off = 1e-14 * (1 + size_of(obstacle))
    if step > 0:
        assert rim == pytest.approx(far + clearance, abs=off)
    else:
        assert rim >= far + clearance - off
    moved = SOLE.corners + step * direction
    for point in oracles.points_on(moved, 3):
        assert -obstacle.margin(point) >= clearance - off


@pytest.mark.parametrize("direction", [(0, 0), (np.nan, 1), (np.inf, 0)])
def test_directions_have_a_length(direction):
    """A direction without a length raises an error."""
    with pytest.raises(ValueError, match="direction .* must have a length"):
        width_along(BEAM, direction)
    with pytest.raises(ValueError, match="direction .* must have a length"):
        sidestep(BEAM, SOLE, direction)


@pytest.mark.parametrize("clearance", [-0.01, np.nan, np.inf])
def test_clearances_are_distances(clearance):
    """A negative clearance would step on the obstacle."""
    with pytest.raises(ValueError, match="clearance .* must be 0 or more"):
        sidestep(BEAM, SOLE, (1, 0), clearance)


def test_a_sole_has_corners():
    """An empty sole raises an error."""
    with pytest.raises(ValueError, match="without corners"):
        sidestep(BEAM, EMPTY, (1, 0))
