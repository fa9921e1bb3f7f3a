"""Taxels of placed boards, and the fit of each board: tilt, gaps under it, collisions."""

from dataclasses import replace

import numpy as np

from ...calibration.model import Patch, TaxelArray
from ...common.arrays import Array, IntArray, tangential
from ..lattice import HexLattice
from ..neighbours import neighbours
from ..sheet.net import board_net
from .layout import WrappedBoards


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
    number = {taxel: i for i, taxel in enumerate(ids)}
    pairs = np.array([(i, number[other]) for i, others in enumerate(adjacent) for other in others], int).reshape(-1, 2)
    linked = board_net(lattice, boards.cells).pairs
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
            "tilt": _largest_per_board(angles(normals, pairs), pairs, len(ids)),
            "pitch_error": _largest_per_board(np.abs(_distances(positions, linked) - lattice.pitch), linked, len(ids)),
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
    row = {taxel: i for i, taxel in enumerate(taxel for patch in patches for taxel in patch.taxels.ids)}
    adjacent = (others for patch in patches for others in patch.taxels.neighbours)
    pairs = np.array([(i, row[other]) for i, others in enumerate(adjacent) for other in others], int).reshape(-1, 2)
    normals = np.concatenate([patch.taxels.normals_link for patch in patches])
    tilts = np.split(
        _largest_per_board(angles(normals, pairs), pairs, len(normals)),
        np.cumsum([len(patch.taxels.ids) for patch in patches])[:-1],
    )
    return tuple(
        replace(patch, taxels=replace(patch.taxels, quality=patch.taxels.quality | {"tilt": tilt}))
        if "tilt" in patch.taxels.quality
        else patch
        for patch, tilt in zip(patches, tilts)
    )


def _distances(positions: Array, pairs: IntArray) -> Array:
    return np.linalg.norm(np.diff(positions[pairs], axis=1)[:, 0], axis=1)


def angles(normals: Array, pairs: IntArray) -> Array:
    r"""Return the angles between the normals of pairs of boards, exact also for small angles.

    .. math:: \alpha = 2 \arcsin(|n_a - n_b| / 2) \quad [rad]
    """
    a, b = normals[pairs[:, 0]], normals[pairs[:, 1]]
    return 2 * np.arcsin(np.clip(np.linalg.norm(a - b, axis=1) / 2, 0, 1))


def _largest_per_board(values: Array, pairs: IntArray, count: int) -> Array:
    """Return the largest value of the pairs that begin at each board, zero without a pair, shape (count,)."""
    result = np.zeros(count)
    np.maximum.at(result, pairs[:, 0], values)
    return result


def _collisions(boards: WrappedBoards) -> Array:
    """Return the depth of the deepest overlap of each board with another, shape (n,) [m]."""
    depth = np.zeros(len(boards.cells))
    pairs, depths, _ = boards.overlaps()
    for column in pairs.T:
        np.maximum.at(depth, column, depths)
    return depth


def board_at(taxels: TaxelArray, lattice: HexLattice, point: Array) -> tuple[int, int]:
    """Return the axial coordinates of the board at a point of the link, whether the board exists or not.

    The lattice continues in the plane of the nearest existing board.
    """
    arms = point - taxels.positions_link
    i = int(np.argmin((arms**2).sum(axis=1)))
    q, r = lattice.cell_at(taxels.axes_link[i] @ arms[i])
    return int(taxels.index[i, 0]) + q, int(taxels.index[i, 1]) + r
