"""Boards in the soles of real feet; the data is not part of the project, so the tests run where it is."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from skin_calib_addon.skin.boards.fill import fill
from skin_calib_addon.skin.boards.region import Region
from skin_calib_addon.skin.lattice import HexLattice
from tests.oracles import all_offsets, most_boards

DATA = (Path(__file__).parents[2] / ".." / "shared" / "data" / "meshes").resolve()
SIDE = 0.0163
BOARDS = HexLattice(SIDE, 0.02775 - np.sqrt(3) * SIDE)


def sole(path):
    """Return the triangles that face down within a millimetre of the lowest point, seen from above."""
    mesh = trimesh.load(path)
    low = mesh.triangles_center[:, 2] < mesh.bounds[0, 2] + 1e-3
    return Region(tuple(mesh.triangles[(mesh.face_normals[:, 2] < -0.9) & low][:, :, :2]))


@pytest.mark.slow
@pytest.mark.parametrize(("name", "count"), [("g1_left_ankle_roll_foot", 7), ("hrp4c_r_ankle_r_foot", 26)])
def test_real_sole_is_filled(name, count):
    """Two pads under one foot, an oval under the other: brute force, in millimetres and degrees, gives no more
    boards.
    """
    path = DATA / f"{name}.stl"
    if not path.exists():
        pytest.skip(f"no real foot here: {path} is missing")
    region = sole(path)
    placement = fill(region, BOARDS)
    outline = placement.corners[0] - placement.centres[0]
    assert len(placement.cells) == count and region.clearances(placement.centres, outline).min() > 0
    most = most_boards(region.edges, BOARDS, all_offsets(BOARDS, 1e-3), np.deg2rad(np.arange(60)))
    assert count - 2 <= most <= count
