"""Chains of boards: connected by ports, of at least so many boards, with short cables between them."""

from types import SimpleNamespace

import numpy as np
import pytest

from skin_calib_addon.plan.skins import BoardSkin
from skin_calib_addon.proposal.boards import with_cells
from skin_calib_addon.proposal.chains import cable_length, chains_of, without_short_chains
from skin_calib_addon.skin.lattice import PORTS, HexLattice

SKIN = BoardSkin("s", HexLattice(0.008), "fill")
LONG, PAIR, ONE = [(0, 0), (1, 0), (1, 1), (2, 1)], [(6, 0), (7, 0)], [(9, 5)]


def boards(cells):
    """What chains use of boards with these lattice coordinates."""
    ids = {cell: f"s.{cell[0]}.{cell[1]}" for cell in cells}
    ports = [tuple(ids.get((q + a, r + b)) for a, b in PORTS) for q, r in cells]
    return SimpleNamespace(ids=tuple(ids.values()), index=np.array(cells), ports=tuple(ports))


def test_chains_are_numbered_by_their_size_and_listed_one_after_the_other():
    taxels = boards([ONE[0], LONG[0], PAIR[0], LONG[3], LONG[1], PAIR[1], LONG[2]])
    kept = np.ones(7, bool)
    assert chains_of(taxels, kept).tolist() == [2, 0, 1, 0, 0, 1, 0]
    listed = with_cells(SKIN, taxels, kept).choice
    assert listed == (LONG[0], LONG[3], LONG[1], LONG[2], PAIR[0], PAIR[1], ONE[0])
    kept[4] = kept[6] = False  # the ends of the long chain are alone then
    assert chains_of(taxels, kept).tolist() == [1, 2, 0, 3, 0]


@pytest.mark.parametrize(("least", "count"), [(1, 7), (2, 6), (3, 4), (5, 7)])
def test_short_chains_are_left_out_unless_there_is_no_longer_one(least, count):
    """Of two skins of a link, one has a long chain."""
    taxels = [boards(LONG), boards(PAIR + ONE)]
    found = without_short_chains(taxels, [np.ones(4, bool), np.ones(3, bool)], least)
    assert sum(mask.sum() for mask in found) == count


def test_cables_are_the_shortest_tree():
    """Three chains in a row: two cables between their nearest boards."""
    chains = [np.array([(x, 0, 0), (x + 0.02, 0, 0)]) for x in (0.0, 0.05, 0.2)]
    assert cable_length(chains) == pytest.approx(0.03 + 0.13) and cable_length(chains[:1]) == 0
