"""Taxels of all patches: search by name and by ray, tilt, sides and outlines."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from skin_calib_addon.common.errors import UnknownTaxel
from skin_calib_addon.inspection.all_taxels import AllTaxels
from tests.samples import RADIUS, boards, seven_boards, small_calibration


@pytest.fixture
def taxels():
    """Return a sheet of 3 x 5 around a cylinder, and two boards on a plane."""
    return AllTaxels.of(small_calibration(rows=3, columns=5).patches)


def test_patches_are_in_common_arrays(taxels):
    """Every row is one taxel of any patch; missing values are NaN."""
    assert taxels.ids[14:] == ("s2.4", "h0", "h1") and taxels.corners.shape == (17, 6, 3)
    assert (taxels.corners[0, 3:] == taxels.corners[0, 3]).all()
    assert np.isnan(taxels.strain[15:]).all() and not np.isnan(taxels.strain[:15]).any()
    assert taxels.tilt[16] == 0  # boards on a plane


def test_stretch_is_the_larger_strain_with_its_sign(taxels):
    """Shear does not count; a board has no strain."""
    for row in range(15):
        along, across, _ = taxels.strain[row]
        assert taxels.stretch[row] == (along if abs(along) >= abs(across) else across)
    assert (taxels.stretch[:3] < 0).all() and np.isnan(taxels.stretch[15:]).all()


def test_tilt_of_a_sheet_is_its_angle_to_the_next(taxels):
    """Around a cylinder it is the pitch divided by the radius, to every digit."""
    assert_allclose(taxels.tilt[:15], 0.01 / RADIUS, rtol=1e-12)


def test_taxel_is_found_by_id_and_by_channel(taxels):
    """Channels count over all patches."""
    assert taxels.row_of("s1.2") == 7 and taxels.row_of(" h1 ") == 16
    assert taxels.row_of("16") == 16 and taxels.row_of("0") == 0


@pytest.mark.parametrize("word", ["s1.9", "17", "", "²"])
def test_unknown_taxel_is_refused(taxels, word):
    """The message says which taxels exist."""
    with pytest.raises(UnknownTaxel, match="channels go from 0 to 16, ids from s0.0"):
        taxels.row_of(word)
    with pytest.raises(UnknownTaxel, match="add a skin"):
        AllTaxels.of(()).row_of(word)


def test_ray_from_outside_hits_its_cell(taxels):
    """A ray from any side hits it, also near its corner; a ray from inside, or one that ends before, hits nothing."""
    for row in range(17):
        inner = 0.9 * taxels.corners[row] + 0.1 * taxels.positions[row]
        for point in (taxels.positions[row], *inner):
            eye = point + 0.01 * taxels.normals[row] + 0.003 * np.ones(3)
            assert taxels.under(eye, point - eye) == row
            assert taxels.under(eye, point - eye, 0.9) is None
            assert taxels.under(point - 0.01 * taxels.normals[row], 0.02 * taxels.normals[row]) is None


def test_ray_hits_the_nearest_cell_first():
    """The near side of a tube hides the far side."""
    columns = 21
    taxels = AllTaxels.of(small_calibration(rows=1, columns=columns, pitch=2 * np.pi * RADIUS / 21).patches[:1])
    for row in range(columns):
        assert taxels.under(taxels.positions[row] * (2, 2, 1), -taxels.positions[row] * (1, 1, 0)) == row


def test_cell_above_another_hides_it():
    """The order of the patches does not matter."""
    low = AllTaxels.of((boards(),))
    high = replace(low, positions=low.positions + [0, 0, 0.01], corners=low.corners + [0, 0, 0.01])
    names = ("positions", "normals", "corners", "channels", "index", "areas", "strain")
    for order, top in (((low, high), 2), ((high, low), 0)):
        both = replace(
            low,
            ids=("a", "b", "c", "d"),
            neighbours=((),) * 4,
            **{name: np.concatenate([getattr(part, name) for part in order]) for name in names},
        )
        assert both.under(low.positions[0] + [0, 0, 0.1], np.array((0, 0, -1.0))) == top


def test_outline_of_cells_is_their_border(taxels):
    """All cells of a sheet give its edge, one cell its sides, boards the sides without a neighbour."""
    assert len(taxels.outline(np.arange(15))) == 2 * (3 + 5)
    one = taxels.outline(np.array([7]))
    assert_allclose(one[:, 0], taxels.corners[7, [0, 1, 2, 5]])
    flower = AllTaxels.of((seven_boards(),))
    assert len(flower.outline(np.arange(7))) == 18 and len(flower.outline(np.arange(2))) == 10
    assert (flower.adjacent[0] >= 0).all() and sorted(flower.adjacent[0]) == list(range(1, 7))
