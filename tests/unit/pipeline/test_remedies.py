"""Changes that mend a surface, and others that do not."""

from pathlib import Path

import pytest
import trimesh

from skin_calib_addon.common.errors import SkinCalibError
from skin_calib_addon.common.warnings import NOWHERE, Place, Warning
from skin_calib_addon.geometry import AutoGrid, CoverSpec, TubeGrid
from skin_calib_addon.pipeline import calibrate
from skin_calib_addon.pipeline.remedies import mends
from skin_calib_addon.plan.plan import Plan, Surface
from tests.shapes import box, cylinder, keep, subdivided, together, welded


def problem(mesh):
    """The plan of a tube, and its refusal."""
    plan = Plan("link", Path("link.ply"), "m", (Surface(CoverSpec("all"), TubeGrid(6, 12)),), ())
    with pytest.raises(SkinCalibError) as refused:
        calibrate(plan, mesh)
    numbers = refused.value.numbers
    code = numbers.get("code", type(refused.value).__name__)
    return plan, Warning(code, "error", str(refused.value), numbers.get("place", NOWHERE))


@pytest.mark.parametrize(("side", "helps"), [(1, True), (-1, False)])
def test_half_a_tube_is_mended_by_a_sector_on_its_side(side, helps):
    """The first sector is around the link's x axis; on the other side there is nothing."""
    mesh = keep(cylinder(), lambda centres: side * centres[:, 0] > 0)
    plan, refusal = problem(mesh)
    assert mends("sector", plan, mesh, refusal) == helps
    assert not mends("margin", plan, mesh, refusal)


def test_part_that_protrudes_is_mended_by_a_cut_below_it_only():
    """A block of 15 cm near one end of a tube: a cut below it keeps the tube, one beyond the end changes nothing."""
    mesh = together(cylinder(), box((0.01, -0.025, 0.07), (0.15, 0.025, 0.11)))
    plan, refusal = problem(mesh)
    for height, helps in ((0.065, True), (1.0, False)):
        place = Place((0.03, 0.0, height))
        assert mends("cut", plan, mesh, Warning(refusal.code, "error", "", place)) == helps, height


def test_what_can_be_seen_mends_a_tube_with_a_wall_inside():
    """Of a grid by tolerance, too: rays from the axis hit the outermost wall, and the inner one is warned of."""
    walls = [subdivided(welded(trimesh.creation.cylinder(radius, 0.12, sections=64))) for radius in (0.035, 0.02)]
    mesh = together(*walls)
    for grid in (TubeGrid(6, 12), AutoGrid(1e-4)):
        plan = Plan("link", Path("link.ply"), "m", (Surface(CoverSpec("all"), grid),), ())
        assert mends("seen", plan, mesh, Warning("dropped-curves", "warning", ""))
        assert not mends("cut", plan, mesh, Warning("dropped-curves", "warning", ""))  # it has no place
