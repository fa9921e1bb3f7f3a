"""Sheets of different surfaces of a link: no two overlap."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from skin_calib_addon.plan.skins import SheetSkin
from skin_calib_addon.proposal.link_points import LinkPoints
from skin_calib_addon.proposal.proposal import _without_conflicts
from skin_calib_addon.skin.between import overlaps
from skin_calib_addon.skin.lattice import SheetLattice
from skin_calib_addon.skin.single_taxels import SingleTaxel, chosen_taxels
from tests.samples import small_calibration
from tests.shapes import box, cylinder, subdivided, together, welded


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
    tube = welded(subdivided(cylinder(0.035, 0.2)))
    found = list(_without_conflicts(tube, LinkPoints.of(tube), placed))
    patches = [replace(one, taxels=chosen_taxels(own, kept)) for own, (_, _, kept, _) in zip(taxels, found)]
    assert overlaps(*patches) == []
    assert sum(kept.sum() for _, _, kept, _ in found) == 15
    assert not off or found[1][2].all()
    for _, skin, kept, _ in found:
        assert sum(not single.enabled for single in skin.taxels) == (~kept).sum()


def test_cells_below_other_faces_or_with_much_strain_are_left_out():
    """A box around one column, another link over the next but one, and a strain of 6 % in the last row."""
    patch = small_calibration(rows=3).patches[0]
    strain = np.where(patch.taxels.index[:, :1] == 2, 0.06, 0.04) * (1, -1, 0)
    taxels = replace(patch.taxels, quality=patch.taxels.quality | {"strain": strain})
    at = taxels.positions_link[taxels.index[:, 1] == 0].mean(axis=0)
    mesh = together(cylinder(0.035, 0.2), box(at - (0.006, 0.005, 0.02), at + (0.006, 0.005, 0.02)))
    on = LinkPoints.of(mesh)
    on.free[on.points[:, 1] > 0.0145] = False
    skin = SheetSkin("a", SheetLattice(3, 3, (0.01, 0.01)), None, (0, 1, 0))
    ((_, _, kept, _),) = _without_conflicts(mesh, on, [(SimpleNamespace(), skin, taxels)])
    assert [tuple(cell) for cell in taxels.index[kept].tolist()] == [(0, 1), (1, 1)]
