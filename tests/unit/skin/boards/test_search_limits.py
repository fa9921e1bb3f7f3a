"""Constants of the search for boards: with fewer steps, nodes or samples, a board is missed or protrudes."""

import numpy as np
import pytest

from skin_calib_addon.geometry import AcrossGrid, fit_surface
from skin_calib_addon.skin import HexLattice, Zone
from skin_calib_addon.skin.boards.layout import Layout
from skin_calib_addon.skin.boards.region import Region
from skin_calib_addon.skin.boards.search import Poses
from tests.shapes import plane_surface, sheet

SIDE = 0.01
LATTICE = HexLattice(SIDE, 0.0)
FLOOR = plane_surface(0.1, 0.08)
MIDDLE = np.array((0.05, 0.04))


def layout(zones=(), lattice=LATTICE):
    """Boards on a plate, with the root in its middle."""
    fit = fit_surface(sheet(lambda x, y: 0 * x), AcrossGrid(6, 6, (0, 0, 1), (1, 0, 0)))
    return Layout.of(fit.surface, lattice, (*MIDDLE, 0), (1, 0, 0), 0.0, fit, zones)


def zone(depth, along, radius):
    """A disc that protrudes into the board in the middle by a depth, from outside of a point of its outline."""
    outward = np.asarray(along) / np.linalg.norm(along)
    return Zone((*(MIDDLE + along + (radius - depth) * outward), 0.0), radius)


@pytest.mark.parametrize(("depth", "is_covered"), [(0.055, True), (0.065, False)])
def test_border_may_protrude_into_a_board_by_6_percent_of_a_side(depth, is_covered):
    """At a corner."""
    where = layout([zone(depth * SIDE, LATTICE.corners[0], 0.004)])
    pose = Poses.at(0.0, 1.0)
    boards, _ = where.placed(pose, np.zeros((1, 2), int))
    assert where.outline_is_covered(boards).tolist() == [is_covered]


def test_depth_is_exact_to_a_twentieth_of_a_millimetre():
    """In a loop of 24 uneven pieces, compared with the distances from all pieces."""
    angles = np.sort(np.random.default_rng(0).uniform(0, 2 * np.pi, 24))
    radii = 0.04 * (1 + 0.15 * np.cos(3 * angles))
    starts = np.column_stack((radii * np.cos(angles), radii * np.sin(angles)))
    along = np.roll(starts, -1, axis=0) - starts
    inward = np.column_stack((-along[:, 1], along[:, 0])) / np.linalg.norm(along, axis=1)[:, None]
    pieces, one = np.stack((starts, starts + along), axis=1), np.ones(1, bool)
    points = np.random.default_rng(0).uniform(-0.06, 0.06, (4000, 2))
    arms = points[:, None] - starts
    parts = np.clip((arms * along).sum(axis=2) / (along**2).sum(axis=1), 0, 1)
    exact = np.linalg.norm(arms - parts[..., None] * along, axis=2).min(axis=1)
    depths = Region(np.zeros((1, 2)), one, one, 2.5e-3, pieces, inward).depths(points)
    assert np.abs(np.abs(depths) - exact).max() < 5e-5
    assert (
        depths[np.linalg.norm(points, axis=1) < 0.025].min() > 0 > depths[np.linalg.norm(points, axis=1) > 0.05].max()
    )
