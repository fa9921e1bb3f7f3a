"""Inner parts that stick out of a surface."""

import pytest

from skin_calib_addon.geometry import CoverSpec, TubeGrid, cut_cover, fit_surface
from skin_calib_addon.geometry.fit.inner_parts import inner_part_warnings
from skin_calib_addon.geometry.mesh.cover import inner_parts
from tests.shapes import RADIUS, Z_AXIS, box, cylinder, together

LIMIT = 0.002


def warnings(part, shell="outer"):
    """Return the warnings about a part of a tube that its cover leaves out."""
    mesh = together(cylinder(), part)
    spec = CoverSpec(shell)
    inner = inner_parts(mesh, spec)
    fit = fit_surface(cut_cover(mesh, spec), TubeGrid(8, 16, Z_AXIS, 0.004))
    return [] if inner is None else list(inner_part_warnings(inner, fit.surface, fit.is_trusted, LIMIT))


def beam(height, half=0.005):
    """Return a beam in the tube that sticks out of it on one side; most of its area is inside."""
    return box((-0.03, -half, 0.05 - half), (RADIUS + height, half, 0.05 + half))


def test_inner_part_that_sticks_out_is_named():
    (warning,) = warnings(beam(0.022))
    assert warning.value == pytest.approx(0.022, abs=5e-4)
    assert warning.where.point[0] == pytest.approx(RADIUS + 0.022) and "up to 22." in warning.message
    assert "9.1 cm^2 of it" in warning.message, "four sides of 20 mm and the end: 9.0 over a flat wall"


@pytest.mark.parametrize("part", [beam(-0.002), beam(0.0015), box((-0.02, -0.01, -0.03), (0.02, 0.01, 0.05))])
def test_inner_part_that_does_not_stick_out_of_the_surface_is_not_named(part):
    """It is inside, less than the limit above, or sticks out of an end."""
    assert not warnings(part)
