"""Laws of boards: the same under rigid motion and noise of a nanometre."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from skin_calib_addon.geometry import AcrossGrid, Axis, TubeGrid, fit_surface, weld
from skin_calib_addon.skin import HexLattice, lay_boards
from tests.examples import slow
from tests.shapes import Motion, cylinder, keep, sheet, wrist

PLATE = keep(sheet(lambda x, y: 0 * x, (0.2, 0.15), (40, 30)), lambda c: (c[:, 0] < 0.09) | (c[:, 1] < 0.08))
DISC = keep(sheet(lambda x, y: 0 * x, (0.2, 0.15), (40, 30)), lambda c: np.hypot(c[:, 0] - 0.1, c[:, 1] - 0.075) < 0.07)
Z = ((0.0, 0.0, 0.0), (0.0, 0.0, 1.0))
CASES = {  # mesh, side of the boards, origin, direction, whether it is a tube
    "plate": (PLATE, 0.0163, (0.05, 0.07, 0), (1, 0.2, 0), False),
    "disc": (DISC, 0.0163, (0.1, 0.075, 0), (1, 0, 0), False),
    "tube": (cylinder(0.04, 0.1, 96, 12), 0.0163, (0.04, 0, 0.05), (0, 1, 0), True),
    "wrist": (wrist(), 0.011, (0.036, -0.004, 0.05), (0, 1, 0.1), True),
}


def places(case, choice, motion, mesh):
    """Return the positions of boards after a motion."""
    _, side, origin, direction, tube = CASES[case]
    if tube:
        grid = TubeGrid(8, 24, motion.axis(Axis(*Z)), margin=0.002)
    else:
        grid = AcrossGrid(8, 8, tuple(motion.directions((0, 0, 1))), tuple(motion.directions((1, 0, 0))))
    fit = fit_surface(mesh, grid)
    surface = fit.error_field.surface
    boards, _ = lay_boards(
        surface, HexLattice(side, 0.0), choice, motion.points(origin), motion.directions(direction), fit=fit
    )
    return surface.points(boards.uv), boards.cells.tolist()


@pytest.mark.parametrize(
    ("case", "choice"),
    [("plate", "fill"), slow("tube", "fill"), ("wrist", "all"), slow("disc", "fill"), slow("wrist", "fill")],
)
def test_boards_do_not_depend_on_the_last_bits(case, choice):
    """Within a micrometre, the same boards have the same positions and cells."""
    mesh, still = CASES[case][0], Motion.none()
    expected, cells = places(case, choice, still, mesh)
    assert len(expected) > 10
    motion, rng = Motion(3), np.random.default_rng(0)
    noisy = weld(mesh.vertices + rng.normal(0, 1e-9, mesh.vertices.shape), mesh.faces)
    for moved, by in ((motion.mesh(mesh), motion), (noisy, still)):
        found, names = places(case, choice, by, moved)
        assert names == cells
        assert_allclose(found, by.points(expected), rtol=0, atol=1e-6)
