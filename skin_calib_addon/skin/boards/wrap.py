"""Placement of rigid hexagonal boards on the tangent planes of a surface; their pitch is kept through space."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from ...common.arrays import Array, BoolArray, IntArray, unit
from ...common.errors import InvalidPlan, OutsideSurface, millimetres
from ...geometry.surface.bspline import BSplineSurface
from ..lattice import PORTS, HexLattice
from ..sheet.constraints import flat_axes, pin_constraints, row_axis
from ..sheet.geodesic import unroll
from ..sheet.net import board_net
from ..sheet.offset import offset_surface
from ..sheet.relax import relax
from ..sheet.wrap import beyond_edge, check_size, on_surface, root_of


@dataclass(frozen=True, eq=False)
class WrappedBoards:
    """Boards placed on a surface; row i of every array is the board of ``cells[i]``."""

    surface: BSplineSurface
    offset: float  # height of the boards' middle planes above the surface [m]
    lattice: HexLattice
    cells: IntArray  # (n, 2) axial coordinates
    uv: Array  # (n, 2) parameters of the centres, continuous over a seam
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
    r"""Place boards on the tangent planes of a surface so that neighbours keep their pitch.

    .. math:: \min \sum_{(a, b)} \left(\frac{|c_a - c_b|}{P} - 1\right)^2

    with the centres c [m] and the pitch P [m]. The minimum is zero on a plane and on a cylinder.

    Parameters
    ----------
    surface : BSplineSurface
        The surface, in the link frame.
    lattice : HexLattice
        The flat lattice.
    cells : sequence of (q, r)
        Axial coordinates of the boards.
    origin : array, shape (3,), or None
        Position of the centre of the root cell (0, 0), with or without a board [m]; its nearest surface point counts.
        None takes the middle of the surface.
    direction : array, shape (3,)
        Direction of the row at the root, in the link frame; its tangential part counts.
    offset : float
        Height of the middle planes of the boards above the surface [m].

    Returns
    -------
    WrappedBoards

    Raises
    ------
    InvalidPlan
        If the direction is perpendicular to the surface, the offset folds the surface, the placement does not
        converge, or the boards fold over each other.
    OutsideSurface
        If the centre of a board is outside the surface; names the first board.
    """
    check_size(surface, (lattice.pitch, lattice.pitch))
    layer, indices = offset_surface(surface, offset), np.array(cells, np.int64).reshape(-1, 2)
    complete = with_surrounded(indices)
    guess = unroll_boards(layer, lattice, complete, root_of(surface, origin), direction)
    uv, tangents = (values[: len(indices)] for values in relax_boards(layer, lattice, complete, *guess))
    for cell, point in zip(indices.tolist(), uv):
        if not on_surface(layer, point):
            gap, edge = beyond_edge(layer, point)
            raise OutsideSurface(
                f"board {cell} lies {gap * 1e3:.1f} mm beyond the edge {edge} of the surface; leave it out, or move "
                "the origin",
                cell=cell,
                distance=gap,
            )
    check_board_folds(layer, indices, uv)
    return WrappedBoards(surface, offset, lattice, indices, uv, tangents)


def with_surrounded(cells: IntArray) -> IntArray:
    """Return cells, followed by the missing ones whose six neighbours are all among them, shape (m, 2).

    A placement takes them along. Where boards form a narrow strip, a missing board leaves two parallel links, and the
    two parts of the strip could move against each other with no pitch error.

    Parameters
    ----------
    cells : array of int, shape (n, 2)
        Axial coordinates.
    """
    near, counts = np.unique((cells[:, None] + np.array(PORTS)).reshape(-1, 2), axis=0, return_counts=True)
    placed = set(map(tuple, cells.tolist()))
    missing = [cell for cell in near[counts == len(PORTS)].tolist() if tuple(cell) not in placed]
    return np.concatenate((cells, np.array(missing, np.int64).reshape(-1, 2)))


def turned_over_boards(cells: IntArray, uv: Array) -> BoolArray:
    """Return which boards are in a triangle of neighbours that is turned over on the surface, shape (n,).

    Parameters
    ----------
    cells : array of int, shape (n, 2)
        Axial coordinates.
    uv : array, shape (n, 2)
        Parameters of the centres, continuous over a seam.
    """
    row = {cell: i for i, cell in enumerate(map(tuple, cells.tolist()))}
    turned = np.zeros(len(cells), bool)
    for (q, r), i in row.items():
        for (a, b), (c, d) in zip(PORTS[:2], PORTS[1:3]):  # two of the six triangles around a board; others have these
            j, k = row.get((q + a, r + b)), row.get((q + c, r + d))
            if j is not None and k is not None:
                first, second = uv[j] - uv[i], uv[k] - uv[i]
                if first[0] * second[1] <= first[1] * second[0]:
                    turned[[i, j, k]] = True
    return turned


def check_board_folds(layer: BSplineSurface, cells: IntArray, uv: Array) -> None:
    """Check that no triangle of neighbouring boards is turned over.

    Parameters
    ----------
    layer : BSplineSurface
        Surface of the middle planes.
    cells : array of int, shape (n, 2)
        Axial coordinates.
    uv : array, shape (n, 2)
        Parameters of the centres.

    Raises
    ------
    InvalidPlan
        If one is; names the first board.
    """
    turned = np.flatnonzero(turned_over_boards(cells, uv))
    if len(turned):
        place = layer.points(uv[turned[:1]])[0]
        raise InvalidPlan(
            f"board {cells[turned[0]].tolist()} at {millimetres(place)} and its neighbours fold over each other, the "
            f"first of {len(turned)} boards; leave it out, or move the origin"
        )


def relax_boards(
    layer: BSplineSurface, lattice: HexLattice, cells: IntArray, uv: Array, tangents: Array
) -> tuple[Array, Array]:
    """Minimize the pitch errors of boards.

    Boards that are connected by neighbours move together. The board nearest to the root is fixed, with its direction.

    Parameters
    ----------
    layer : BSplineSurface
        Surface of the middle planes.
    lattice : HexLattice
        The flat lattice.
    cells : array of int, shape (n, 2)
        Axial coordinates.
    uv : array, shape (n, 2)
        First guess of the parameters of the centres.
    tangents : array, shape (n, 3)
        First guess of the directions of the rows, unit.

    Returns
    -------
    uv : array, shape (n, 2)
        Parameters of the centres.
    tangents : array, shape (n, 3)
        Directions of the rows, unit.
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
    """Place cells along geodesics.

    Parameters
    ----------
    layer : BSplineSurface
        The surface.
    lattice : HexLattice
        The flat lattice.
    cells : array of int, shape (n, 2)
        Axial coordinates.
    start : array, shape (2,)
        Parameters of the root.
    direction : array, shape (3,)
        Direction of the row at the root.

    Returns
    -------
    uv : array, shape (n, 2)
        Parameters of the centres.
    tangents : array, shape (n, 3)
        Directions of the rows, unit.
    """
    flat, along = lattice.centres(cells), row_axis(layer, start, direction)
    half = np.array((lattice.pitch / 2, 0.0))
    uv = unroll(layer, np.concatenate((flat, flat - half, flat + half)), start, along, lattice.pitch / 2)
    uv, before, after = np.split(uv, 3)
    # Differences over a pitch: points between two geodesics are accurate, their derivatives are not on a wavy surface.
    vectors, normals = layer.points(after) - layer.points(before), layer.normals(uv)
    tangents = unit(vectors - (vectors * normals).sum(axis=1, keepdims=True) * normals)
    tangents[~flat.any(axis=1)] = along
    return uv, tangents
