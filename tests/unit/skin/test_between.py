"""Overlaps of the cells of different skins on a link."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from skin_calib_addon.skin.between import overlaps
from tests.samples import small_calibration


@pytest.mark.parametrize("degrees, found", [(0, True), (55, True), (65, False), (82, False)])
def test_cells_overlap_if_their_normals_are_less_than_60_degrees_apart(degrees, found):
    """The first cells of two equal skins, one of which is rotated about an axis through the centre of this cell."""
    one = small_calibration().patches[0]
    taxels = one.taxels
    a = np.deg2rad(degrees)
    turn = Rotation.from_rotvec(a * taxels.tangents_link[0]).as_matrix()
    middle = taxels.positions_link[0]
    other = replace(
        one,
        taxels=replace(
            taxels,
            positions_link=(taxels.positions_link - middle) @ turn.T + middle,
            corners_link=(taxels.corners_link - middle) @ turn.T + middle,
            normals_link=taxels.normals_link @ turn.T,
        ),
    )
    pairs = {pair[:2] for pair in overlaps(one, other)}
    assert ((taxels.ids[0], taxels.ids[0]) in pairs) == found
