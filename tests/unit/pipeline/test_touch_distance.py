"""Touches far from their skin are an error that states the distance."""

import numpy as np
import pytest

from skin_calib_addon.common.errors import CalibrationFormatError
from skin_calib_addon.geometry import CoverSpec, TubeGrid
from skin_calib_addon.geometry.mesh.triangle_mesh import save_mesh
from skin_calib_addon.pipeline import calibrate
from skin_calib_addon.pipeline.refine import refine
from skin_calib_addon.pipeline.touch_distance import check_touches
from skin_calib_addon.plan import Plan
from skin_calib_addon.plan.document import skins_from
from skin_calib_addon.plan.plan import Surface
from skin_calib_addon.validation import Touches
from tests.shapes import RADIUS, Z_AXIS, cylinder

SKINS = [
    {
        "name": name,
        "kind": "sheet",
        "rows": 3,
        "columns": 4,
        "pitch": [0.01, 0.01],
        "direction": [0, 1, 0],
        "origin": [RADIUS * np.cos(angle), RADIUS * np.sin(angle), 0.04],
        "offset": offset,
    }
    for name, angle, offset in (("thin", 0.0, 0.0), ("thick", 2.0, 0.008))
]


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Return a plan of a cylinder with a thin and a thick skin, and its calibration."""
    path = tmp_path_factory.mktemp("cylinder") / "c.ply"
    save_mesh(cylinder(), path)
    skins = skins_from(SKINS)
    plan = Plan("c", path, "m", (Surface(CoverSpec(), TubeGrid(8, 24, Z_AXIS, 2e-3)),), skins)
    return plan, calibrate(plan)


def touches(name, angle, radius, direction=(0.0, 0.0, 0.0)):
    """Return three touches at angles of a cylinder; the second is at the radius, the others at that of the taxels."""
    thickness = {"thin": 0.0, "thick": 0.008}[name]
    radii = np.array((RADIUS + thickness, radius, RADIUS + thickness))
    points = np.column_stack((radii * np.cos(angle), radii * np.sin(angle), (0.04, 0.05, 0.05)))
    directions = np.zeros((3, 3))
    directions[1] = direction
    return Touches((f"{name}.0.0", f"{name}.1.1", f"{name}.1.2"), np.array((2, 7, 9)), points, directions)


@pytest.mark.parametrize("off", [0.0052, 0.1])
@pytest.mark.parametrize(("name", "angle", "thickness"), [("thin", 0.1, 0.0), ("thick", 2.1, 0.008)])
def test_touch_more_than_five_millimetres_away_is_an_error(made, name, angle, thickness, off):
    """Above the taxels, also those of a thick skin; the message has the line of the file and the distance."""
    calibration = made[1].calibration
    check_touches(calibration, touches(name, angle, RADIUS + thickness + 0.0048))
    stated = f"{off * 1e3:.1f}"
    with pytest.raises(CalibrationFormatError, match=rf"^Line 7: the touch at .* is {stated} mm from skin '{name}'"):
        check_touches(calibration, touches(name, angle, RADIUS + thickness + off))


def test_line_of_action_that_misses_the_link_is_an_error(made):
    """Lines along y: 4 mm outside of the cylinder they pass, 12 mm outside they do not; through it, at any point."""
    calibration = made[1].calibration
    for x in (0.0, 0.02, RADIUS + 0.004):
        check_touches(calibration, touches("thin", 0.0, x, (0, 1, 0)))
    with pytest.raises(CalibrationFormatError, match=r"Line 7: the line of action through .* is 12\.0 mm from skin"):
        check_touches(calibration, touches("thin", 0.0, RADIUS + 0.012, (0, 1, 0)))


def test_refinement_examines_the_distances(made):
    """Before any step."""
    plan, result = made
    with pytest.raises(CalibrationFormatError, match=r"Line 7: the touch at .* is 100\.0 mm"):
        refine(plan, result, touches("thin", 0.1, RADIUS + 0.1))
