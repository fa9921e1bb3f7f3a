"""Boards that grow on from others, one ring after another: where a surface bends, more of them than in a lattice."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from ...common.arrays import BoolArray, tangential, unit
from ..lattice import HexLattice
from .flat_map import steps_along
from .wrapped_boards import WrappedBoards

# [1] Distances from the place next to a board, in sides of a board, at which another one is tried. More: boards a
# little closer, slower; a larger last one: more boards, wider gaps.
SLIDES = np.linspace(0.0, 0.75, 7)
# [1] Newton steps to the place next to a board. Fewer: it is less exact; the slides make up for it.
STEPS = 4
# [1] Distance of two boards, in pitches, below which they overlap. Derived: their normals are at most 90 degrees apart.
CLOSE = 0.7


def grown(boards: WrappedBoards, fits: Callable[[WrappedBoards], BoolArray]) -> WrappedBoards:
    """Return boards with those that fit around them, and around these, without overlaps.

    Each board is rolled over the sides of those before it, and moved outward until it overlaps none: a small distance
    comes before the order of boards and sides, so that rounding decides nothing.
    """
    ring = boards
    while len(ring.cells):
        count = len(boards.cells)
        for slide in SLIDES * boards.lattice.side:
            boards = boards.joined(_usable(boards, _rolled(ring, float(slide)), fits))
        ring = boards[count:]
    return boards


def _rolled(boards: WrappedBoards, slide: float) -> WrappedBoards:
    """Return a board next to each side of each board, at a distance [m] from the place next to it."""
    lattice, surface = boards.lattice, boards.surface
    outward = unit(lattice.corners + np.roll(lattice.corners, -1, axis=0)) @ boards.axes
    places = boards.points[:, None] + (lattice.pitch + slide) * outward
    new = boards[np.repeat(np.arange(len(boards.cells)), places.shape[1])]
    uv = new.uv
    for _ in range(STEPS):
        uv = uv + steps_along(surface, uv, places.reshape(-1, 3) - surface.points(uv))
        uv = np.where(surface.closed, uv, np.clip(uv, 0.0, 1.0))
    shifted = np.ones(len(uv), bool)
    return replace(new, uv=uv, tangents=tangential(new.tangents, surface.normals(uv)), shifted=shifted)


def _usable(boards: WrappedBoards, new: WrappedBoards, fits: Callable[[WrappedBoards], BoolArray]) -> WrappedBoards:
    """Return the new boards that fit, and overlap neither others nor new ones before them."""
    lattice = boards.lattice
    distance, nearest = map(np.asarray, cKDTree(boards.positions).query(new.positions))
    face_alike = (boards.normals[nearest] * new.normals).sum(axis=1) > 0
    new = new[(distance > CLOSE * lattice.pitch) | ~face_alike]
    new = new[fits(new)]
    if not len(new.cells):
        return new
    distances = np.asarray(cKDTree(new.positions).query(boards.positions)[0])
    near = boards[distances < 2 * (lattice.pitch + abs(boards.offset))]
    # With half of the gap around them.
    whole = HexLattice(max(lattice.side, lattice.pitch / np.sqrt(3)), min(lattice.spacing, 0.0))
    kept = np.ones(len(new.cells), bool)
    for i, j in (replace(near.joined(new), lattice=whole).overlaps()[0] - len(near.cells)).tolist():
        if j >= 0 and (i < 0 or kept[i]):
            kept[j] = False
    return new[kept]
