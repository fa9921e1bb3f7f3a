"""Sheets of different surfaces of a link: no two overlap."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from skin_calib_addon.plan.skins import SheetSkin
from skin_calib_addon.proposal.proposal import _without_conflicts
from skin_calib_addon.skin.between import overlaps
from skin_calib_addon.skin.lattice import SheetLattice
from skin_calib_addon.skin.single_taxels import SingleTaxel, chosen_taxels
from tests.samples import small_calibration


@pytest.mark.parametrize("off", [(), ("0.2", "1.2", "2.2")])
def test_sheets_of_a_proposal_do_not_overlap(off):
    """The other one is moved by two and a half of three columns: of each of three pairs one cell is left out.

    If the author disabled the cells of the first that overlap, the second has all of its cells.
    """
    one = small_calibration(rows=3).patches[0]
    ids = [tuple(f"{name}.{i}.{j}" for i, j in one.taxels.index) for name in "ab"]
    turn = 2.5 * 0.01 / 0.035
    c, s = np.cos(turn), np.sin(turn)
    turned = np.array(((c, s, 0), (-s, c, 0), (0, 0, 1)))  # of rows on a cylinder about z
    taxels = [replace(one.taxels, ids=own, neighbours=((),) * len(own)) for own in ids]
    vectors = ("positions_link", "normals_link", "tangents_link", "corners_link")
    taxels[1] = replace(taxels[1], **{name: getattr(taxels[1], name) @ turned for name in vectors})
    skins = [SheetSkin(name, SheetLattice(3, 3, (0.01, 0.01)), None, (0, 1, 0)) for name in "ab"]
    skins[0] = replace(skins[0], taxels=tuple(SingleTaxel(name, enabled=False) for name in off))
    placed = [(SimpleNamespace(), skin, own) for skin, own in zip(skins, taxels)]
    found = list(_without_conflicts(None, None, placed))
    patches = [replace(one, taxels=chosen_taxels(own, kept)) for own, (_, _, kept, _) in zip(taxels, found)]
    assert overlaps(*patches) == []
    assert sum(kept.sum() for _, _, kept, _ in found) == 15
    assert not off or found[1][2].all()
    for _, skin, kept, _ in found:
        assert sum(not single.enabled for single in skin.taxels) == (~kept).sum()
