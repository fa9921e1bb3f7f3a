"""Skins on real robot links; the links are not part of the project, so the tests run where the data is."""

import numpy as np
import pytest

from skin_calib_addon.common.errors import InvalidPlan
from skin_calib_addon.geometry import (
    AcrossGrid,
    AutoGrid,
    CoverSpec,
    TubeGrid,
    cut_cover,
    fit_grid,
    load_mesh,
)
from skin_calib_addon.skin import HexLattice, lay_boards
from tests.real.test_real_links import DATA, MESHES, fit_of

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not MESHES, reason=f"no real links here: {DATA} has no STL file"),
]


@pytest.mark.parametrize("stem", ["g1_left_ankle_roll_foot", "hrp4c_r_ankle_r_foot"])
def test_foot_soles_are_filled(stem):
    """There are more boards than in the given pose, within half a millimetre of the edges and holes of the mesh."""
    path = DATA / f"{stem}.stl"
    if not path.exists():
        pytest.skip(f"no {path.name} here")
    fit, lattice = fit_of(path)[1], HexLattice(0.0163, 0.0)
    filled, overhang = lay_boards(fit.surface, lattice, "fill", None, (1, 0, 0), fit=fit)
    plain, _ = lay_boards(fit.surface, lattice, "all", None, (1, 0, 0), fit=fit)
    assert len(filled.cells) > len(plain.cells) and overhang.max() <= 5e-4


@pytest.mark.parametrize("grid", [TubeGrid(8, 20), AutoGrid(1e-4)])
def test_thin_sheet_asks_for_its_side(grid):
    """The force sensor of a palm is 2 mm thick: the author must choose the side of the skin."""
    path = DATA / "g1_left_palm_force_sensor.stl"
    if not path.exists():
        pytest.skip(f"no {path.name} here")
    cover = cut_cover(load_mesh(path), CoverSpec())
    with pytest.raises(InvalidPlan, match="thin sheet, 2.0 mm thick .* with two sides. Choose the side .* normal"):
        fit_grid(cover, grid, (3, 3))
    fit = fit_grid(cover, AcrossGrid(8, 8, (0, 0, 1)), (3, 3))
    assert (fit.surface.normals(np.random.default_rng(0).random((200, 2)))[:, 2] > 0.5).all()
