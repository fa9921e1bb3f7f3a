"""Boards that fill real robot links; the links are not part of the project, so the tests run where the data is."""

from pathlib import Path

import numpy as np
import pytest

from skin_calib_addon.geometry import CoverSpec, TubeGrid, cut_cover, fit_surface, load_mesh
from skin_calib_addon.skin import HexLattice, lay_boards
from tests.real.test_real_links import DATA, MESHES

pytestmark = pytest.mark.slow
GOLDEN = Path(__file__).parents[1] / "golden" / "real_boards.npz"
FILLED = (
    ("icub27_l_upper_leg", 0.008),
    ("icub27_l_upper_leg", 0.0163),
    ("hrp4c_r_wrist_y", 0.008),
    ("hrp4c_r_elbow_p", 0.008),
    ("jvrc1_r_elbow_p", 0.008),
)


def places(mesh, side):
    """The centres of the boards that fill a tube [m]."""
    fit = fit_surface(cut_cover(mesh, CoverSpec()), TubeGrid(10, 20))
    boards, _ = lay_boards(fit.surface, HexLattice(side, 0.0), "fill", None, None, fit=fit)
    return fit.surface.points(boards.uv)


@pytest.fixture(params=FILLED, ids=lambda case: f"{case[0]} {case[1]}")
def case(request):
    """A link and the side of its boards [m]."""
    if DATA / f"{request.param[0]}.stl" not in MESHES:
        pytest.skip(f"{request.param[0]}.stl is not here")
    return request.param


def test_boards_of_a_real_link_are_those_of_the_committed_file(case):
    """Another version of NumPy made it."""
    stem, side = case
    found = places(load_mesh(DATA / f"{stem}.stl"), side)
    with np.load(GOLDEN) as golden:
        expected = golden[f"{stem} {side}"]
    assert len(found) == len(expected) > 10
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-6)


if __name__ == "__main__":  # after a change that is meant to move boards
    np.savez_compressed(GOLDEN, **{f"{s} {a}": places(load_mesh(DATA / f"{s}.stl"), a) for s, a in FILLED})
