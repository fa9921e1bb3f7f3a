"""Taxels of placed boards, and the fit of each board: tilt, gaps under it, collisions."""

from dataclasses import replace

import numpy as np

from ...calibration.model import Patch, TaxelArray, neighbour_rows
from ...common.arrays import Array, IntArray, tangential
from ..lattice import HexLattice
from ..neighbours import angles, largest_of, neighbours
from .wrapped_boards import WrappedBoards


def board_taxels(boards: WrappedBoards, name: str, first_channel: int = 0, overhang: Array | None = None) -> TaxelArray:
    """Return one taxel in the middle of each board.

    Parameters
    ----------
    boards : WrappedBoards
        The placed boards.
    name : str
        Name of the patch; ids read ``name.q.r``.
    first_channel : int
        Channel of the first board; the others follow in the order of ``boards.cells``.
    overhang : array, shape (n,), optional
        Overhang of each board, if known [m].

    Returns
    -------
    TaxelArray
        In the link frame. ``quality`` has, for each board: the gap under its worst corner [m], the largest tilt to a
        neighbour [rad], the largest pitch error [m], the deepest collision [m], and the overhang [m].
    """
    surface, lattice = boards.surface, boards.lattice
    normals = surface.normals(boards.uv)
    positions = surface.points(boards.uv) + boards.offset * normals
    tangents = tangential(boards.tangents, normals)
    axes = np.stack((tangents, np.cross(normals, tangents)), axis=1)
    corners = positions[:, None] + lattice.corners @ axes
    sides = (corners + np.roll(corners, -1, axis=1)) / 2
    ids = tuple(f"{name}.{q}.{r}" for q, r in boards.cells.tolist())
    adjacent = neighbours(ids, positions, normals, corners)
    pairs = neighbour_rows(ids, adjacent)
    linked = lattice.linked(boards.cells)
    linked = linked[~boards.shifted[linked].any(axis=1)]
    linked = np.concatenate((linked, linked[:, ::-1]))
    return TaxelArray(
        ids=ids,
        channels=first_channel + np.arange(len(ids)),
        index=boards.cells,
        uv=surface.wrap(boards.uv),
        positions_link=positions,
        normals_link=normals,
        tangents_link=tangents,
        corners_link=corners,
        areas=np.full(len(ids), lattice.area),
        neighbours=adjacent,
        ports=_ports(ids, positions, sides, pairs),
        quality={
            "gap": boards.gaps(),
            "tilt": _largest_or_zero(angles(normals, pairs), pairs, len(ids)),
            "pitch_error": _largest_or_zero(np.abs(_distances(positions, linked) - lattice.pitch), linked, len(ids)),
            "collision": _collisions(boards),
        }
        | ({} if overhang is None else {"overhang": overhang}),
    )


def _ports(ids: tuple[str, ...], positions: Array, sides: Array, pairs: IntArray) -> tuple[tuple[str | None, ...], ...]:
    """Return the neighbour at each side of each board; None without a neighbour."""
    ports: list[list[str | None]] = [[None] * sides.shape[1] for _ in ids]
    ahead = np.einsum("pkc,pc->pk", (sides - positions[:, None])[pairs[:, 0]], np.diff(positions[pairs], axis=1)[:, 0])
    for (board, other), side in zip(pairs.tolist(), ahead.argmax(axis=1).tolist()):
        ports[board][side] = ids[other]
    return tuple(map(tuple, ports))


def with_tilts(patches: tuple[Patch, ...]) -> tuple[Patch, ...]:
    """Return the same patches; the tilts of boards are those to their neighbours, of all patches."""
    if not any("tilt" in patch.taxels.quality for patch in patches):
        return patches
    ids = [taxel for patch in patches for taxel in patch.taxels.ids]
    pairs = neighbour_rows(ids, (others for patch in patches for others in patch.taxels.neighbours))
    normals = np.concatenate([patch.taxels.normals_link for patch in patches])
    ends = np.cumsum([len(patch.taxels.ids) for patch in patches])
    tilts = np.split(_largest_or_zero(angles(normals, pairs), pairs, len(ids)), ends[:-1])
    return tuple(
        replace(patch, taxels=replace(patch.taxels, quality=patch.taxels.quality | {"tilt": tilt}))
        if "tilt" in patch.taxels.quality
        else patch
        for patch, tilt in zip(patches, tilts)
    )


def _largest_or_zero(values: Array, pairs: IntArray, count: int) -> Array:
    """Return the largest value of the pairs that begin at each board, zero without a pair, shape (count,)."""
    return np.nan_to_num(largest_of(values, pairs, count))


def _distances(positions: Array, pairs: IntArray) -> Array:
    return np.linalg.norm(np.diff(positions[pairs], axis=1)[:, 0], axis=1)


def _collisions(boards: WrappedBoards) -> Array:
    """Return the depth of the deepest overlap of each board with another, shape (n,) [m]."""
    depth = np.zeros(len(boards.cells))
    pairs, depths, _ = boards.overlaps()
    for column in pairs.T:
        np.maximum.at(depth, column, depths)
    return depth


def board_at(taxels: TaxelArray, lattice: HexLattice, point: Array) -> tuple[tuple[int, int], bool]:
    """Return the axial coordinates of the board at a point of the link, and whether there is one.

    The lattice continues in the plane of the nearest existing board.
    """
    arms = point - taxels.positions_link
    i = int(np.argmin((arms**2).sum(axis=1)))
    q, r = lattice.cell_at(taxels.axes_link[i] @ arms[i])
    return (int(taxels.index[i, 0]) + q, int(taxels.index[i, 1]) + r), (q, r) == (0, 0)
