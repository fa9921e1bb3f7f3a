"""Rigid hexagonal boards on the tangent planes of a surface, their pitch kept through space."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from ...common.arrays import Array, IntArray, unit
from ...common.errors import OutsideSurface
from ...geometry.surface.bspline import BSplineSurface
from ..lattice import HexLattice
from ..sheet.constraints import flat_axes, pin_constraints, row_axis
from ..sheet.geodesic import unroll
from ..sheet.net import board_net
from ..sheet.offset import offset_surface
from ..sheet.relax import relax
from ..sheet.wrap import beyond_edge, check_size, guess_step, on_surface, root_of


@dataclass(frozen=True, eq=False)
class WrappedBoards:
    """Boards on their surface; row i of every array is the board of ``cells[i]``."""

    surface: BSplineSurface
    offset: float  # height of the boards' middle planes above the surface [m]
    lattice: HexLattice
    cells: IntArray  # (n, 2) axial coordinates
    uv: Array  # (n, 2), not wrapped round
    tangents: Array  # (n, 3) unit, along the rows of the lattice


def wrap_boards(
    surface: BSplineSurface,
    lattice: HexLattice,
    cells: Sequence[Sequence[int]] | IntArray,
    origin: ArrayLike | None,
    direction: ArrayLike,
    *,
    offset: float = 0.0,
) -> WrappedBoards:
    """Lay boards on the tangent planes of a surface so that neighbours keep their pitch.

    On a plane and on a cylinder all of them do; elsewhere their pitches are off with the least sum of squares.

    Parameters
    ----------
    cells : sequence of pair of int
        Axial coordinates of the boards.
    origin : array, shape (3,), or None
        Where the centre of the root cell (0, 0) lies, whether it has a board or not [m]; the nearest surface point is
        taken. None takes the middle of the surface: half way along, and half way across or round.
    direction : array, shape (3,)
        Where the row of the root runs to, in the link frame; its part in the surface counts.
    offset : float
        Height of the boards' middle planes above the surface [m].

    Raises
    ------
    InvalidPlan
        If the direction stands upright on the surface, or the offset folds it.
    OutsideSurface
        Names the first board whose centre lies off the surface.
    """
    check_size(surface, (lattice.pitch, lattice.pitch))
    layer, indices = offset_surface(surface, offset), np.array(cells, np.int64).reshape(-1, 2)
    guess = unroll_boards(layer, lattice, indices, root_of(surface, origin), direction)
    uv, tangents = relax_boards(layer, lattice, indices, *guess)
    for cell, point in zip(indices.tolist(), uv):
        if not on_surface(layer, point):
            gap, edge = beyond_edge(layer, point)
            raise OutsideSurface(
                f"board {cell} lies {gap * 1e3:.1f} mm beyond the edge {edge} of the surface; leave it out, or move "
                "the origin",
                cell=cell,
                distance=gap,
            )
    return WrappedBoards(surface, offset, lattice, indices, uv, tangents)


def relax_boards(
    layer: BSplineSurface, lattice: HexLattice, cells: IntArray, uv: Array, tangents: Array
) -> tuple[Array, Array]:
    """Boards from a first guess of their parameters (n, 2) and row directions (n, 3) to rest: the same.

    Boards that hang together find their places together; the one nearest to the root stays, and keeps its direction.
    """
    flat, uv, tangents = lattice.centres(cells), uv.copy(), tangents.copy()
    net = board_net(lattice, cells)
    links = coo_array((np.ones(len(net.pairs)), net.pairs.T), shape=(len(cells), len(cells)))
    for group in range((groups := connected_components(links, directed=False))[0]):
        members = np.flatnonzero(groups[1] == group)
        members = members[np.argsort((flat[members] ** 2).sum(axis=1), kind="stable")]
        if len(members) > 1:
            part = board_net(lattice, cells[members])
            constraints = pin_constraints(layer, part, uv[members], tangents[members[0]])
            uv[members] = relax(layer, part, uv[members], constraints)
            tangents[members] = flat_axes(layer, part, uv[members])[0]
    return uv, tangents


def unroll_boards(
    layer: BSplineSurface, lattice: HexLattice, cells: IntArray, start: Array, direction: ArrayLike
) -> tuple[Array, Array]:
    """Where geodesics lead to cells, and how the rows run there: parameters (n, 2), unit vectors (n, 3)."""
    flat, along = lattice.centres(cells), row_axis(layer, start, direction)
    half = np.array((lattice.pitch / 2, 0.0))
    uv = unroll(layer, np.concatenate((flat, flat - half, flat + half)), start, along, guess_step(layer, lattice.pitch))
    uv, before, after = np.split(uv, 3)
    # Over a pitch: what lies between two geodesics is placed well, but leads aside where the surface wavers.
    vectors, normals = layer.points(after) - layer.points(before), layer.normals(uv)
    tangents = unit(vectors - (vectors * normals).sum(axis=1, keepdims=True) * normals)
    tangents[~flat.any(axis=1)] = along
    return uv, tangents
