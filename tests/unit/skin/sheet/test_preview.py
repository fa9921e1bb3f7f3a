"""Previews of sheets: fast placements that are near the exact ones."""

import sys
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from skin_calib_addon.skin import SheetLattice, sheet_taxels, wrap_sheet
from skin_calib_addon.skin.sheet.taxels import preview_taxels
from tests.shapes import RADIUS, cone_surface, wrist_surface

FINE = SheetLattice(20, 66, (0.003, 0.003))
COARSE = SheetLattice(6, 20, (0.009, 0.009))
# Stated in docs/explanation/results.md.
MAX_DISTANCE = 2e-4  # [m] of a cell from its exact position
MAX_STRAIN = 0.01  # [1] difference of a strain from the exact one
MAX_RIM_STRAIN = 0.04  # [1] the same at the rim of a sheet that is trimmed
MAX_NODE_DISTANCE = 5e-5  # [m] of a node that is placed from its exact position


@pytest.fixture
def calls(monkeypatch):
    """Return a list of the first guesses ("unroll") and the searches for an origin ("root_of") that are made."""
    made, module = [], sys.modules[wrap_sheet.__module__]
    for name in ("unroll", "root_of"):
        real = getattr(module, name)
        monkeypatch.setattr(module, name, lambda *a, name=name, real=real: made.append(name) or real(*a))
    return made


@pytest.mark.parametrize("hand, offset, trim", [("left", 0.001, False), ("right", 0.0, True)])
def test_preview_of_a_fine_sheet_is_near_the_exact_placement(hand, offset, trim):
    """Every field of each taxel is there, in the same order."""
    surface, lattice = wrist_surface(), replace(FINE, hand=hand, rows=30 if trim else 20)
    placed = {
        preview: wrap_sheet(surface, lattice, None, (0, 1, 0.02), offset=offset, trim=trim, preview=preview)
        for preview in (False, True)
    }
    assert placed[True].interpolated and not placed[False].interpolated
    exact, quick = sheet_taxels(placed[False], "s", 7), preview_taxels(placed[True], "s", 7)
    assert trim == (len(exact.ids) < lattice.rows * lattice.columns)
    both, here, there = np.intersect1d(exact.ids, quick.ids, return_indices=True)
    assert len(both) > 0.99 * len(exact.ids) and len(quick.ids) < 1.01 * len(exact.ids)
    for name in ("channels", "index"):
        assert (getattr(exact, name)[here] == getattr(quick, name)[there]).all()
    for name in ("positions_link", "corners_link"):
        apart = np.linalg.norm(getattr(exact, name)[here] - getattr(quick, name)[there], axis=-1)
        assert 0 < apart.max() < MAX_DISTANCE
    for name in ("normals_link", "tangents_link"):
        assert ((getattr(exact, name)[here] * getattr(quick, name)[there]).sum(axis=1) > np.cos(0.02)).all()
    most = MAX_RIM_STRAIN if trim else MAX_STRAIN
    assert_allclose(quick.quality["strain"][there], exact.quality["strain"][here], atol=most)
    assert_allclose(quick.areas[there], exact.areas[here], rtol=2 * most)


def test_preview_of_a_coarse_sheet_places_all_nodes():
    """They are at most half a tenth of a millimetre from their exact positions; so are the taxels."""
    exact, quick = (wrap_sheet(wrist_surface(), COARSE, None, (0, 1, 0), preview=p) for p in (False, True))
    assert not quick.interpolated
    nodes = [sheet.surface.points(sheet.uv.reshape(-1, 2)) for sheet in (exact, quick)]
    assert 0 < np.linalg.norm(nodes[0] - nodes[1], axis=1).max() < MAX_NODE_DISTANCE
    taxels = [of(sheet, "s") for of, sheet in ((sheet_taxels, exact), (preview_taxels, quick))]
    for name in ("positions_link", "corners_link"):
        apart = np.linalg.norm(getattr(taxels[0], name) - getattr(taxels[1], name), axis=-1)
        assert apart.max() < MAX_NODE_DISTANCE


@pytest.mark.parametrize("lattice", [FINE, COARSE])
def test_preview_starts_from_the_placement_before_a_small_change(lattice, calls):
    """One column less and a rotation by a degree need no first guess; a rotation by 90 degrees needs one."""
    surface, turned = wrist_surface(), (0, 1, 0.02)
    before = wrap_sheet(surface, lattice, None, (0, 1, 0), preview=True)
    expected = wrap_sheet(surface, lattice, None, turned, preview=True)
    calls.clear()
    after = wrap_sheet(surface, lattice, None, turned, preview=True, near=before)
    assert "unroll" not in calls
    points = [surface.points(sheet.uv.reshape(-1, 2)) for sheet in (after, expected)]
    assert np.linalg.norm(points[0] - points[1], axis=1).max() < MAX_NODE_DISTANCE
    more = replace(lattice, columns=lattice.columns - 1)
    of_other = [wrap_sheet(surface, more, None, turned, preview=True, near=near) for near in (before, None)]
    assert calls.count("unroll") == 1
    points = [surface.points(sheet.uv.reshape(-1, 2)) for sheet in of_other]
    assert np.linalg.norm(points[0] - points[1], axis=1).max() < MAX_NODE_DISTANCE
    calls.clear()
    wrap_sheet(surface, replace(lattice, pitch=(0.001, 0.001)), None, (0, 0, 1), preview=True, near=before)
    assert "unroll" in calls


def test_preview_does_not_start_from_a_fold(calls):
    """A placement whose cells are turned over is left, because a fold has no strain and would stay."""
    surface = cone_surface(RADIUS, RADIUS)
    fine = wrap_sheet(surface, COARSE, None, (0, 1, 0), preview=True)
    calls.clear()
    folded = replace(fine, uv=fine.uv[::-1])  # the rows have the same direction
    after = wrap_sheet(surface, COARSE, None, (0, 1, 0), preview=True, near=folded)
    assert "unroll" in calls
    assert_allclose(after.uv, fine.uv, atol=1e-9)


@pytest.mark.parametrize("origin", [None, (RADIUS, 0.0, 0.05)])
def test_preview_finds_the_origin_from_the_placement_before(origin, calls):
    """On a surface that has moved a little, the origin needs no search."""
    before, after = (
        replace(cone_surface(RADIUS, top), centre=np.array((RADIUS, 0.0, 0.05))) for top in (RADIUS, RADIUS + 1e-5)
    )
    near = wrap_sheet(before, COARSE, origin, (0, 1, 0), preview=True)
    expected = wrap_sheet(after, COARSE, origin, (0, 1, 0), preview=True)
    calls.clear()
    found = wrap_sheet(after, COARSE, origin, (0, 1, 0), preview=True, near=near)
    assert "root_of" not in calls
    points = [after.points(sheet.uv.reshape(-1, 2)) for sheet in (found, expected)]
    assert np.linalg.norm(points[0] - points[1], axis=1).max() < MAX_NODE_DISTANCE


def test_origin_that_has_moved_away_is_searched_for(calls):
    """A descent from the other side of the link ends away from the origin."""
    surface, lattice = cone_surface(RADIUS, RADIUS), SheetLattice(2, 3, (0.005, 0.005))
    here, there = (RADIUS, 0.0, 0.05), (-RADIUS, 0.0, 0.05)
    near = wrap_sheet(surface, lattice, here, (0, 1, 0), preview=True)
    calls.clear()
    found = wrap_sheet(surface, lattice, there, (0, 1, 0), preview=True, near=near)
    assert "root_of" in calls
    assert_allclose(surface.points(found.uv[1, 1][None])[0], there, atol=1e-4)
