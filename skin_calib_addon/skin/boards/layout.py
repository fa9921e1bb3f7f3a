"""Choice of the boards on a surface: as many as fit, all that fit at a given position, or a list of the author."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from ...common.arrays import Array
from ...common.errors import InvalidPlan, OutsideSurface
from ...geometry.fit.surface_fit import SurfaceFit
from ...geometry.surface.bspline import BSplineSurface
from ...geometry.surface.footpoints import footpoints
from ..lattice import HexLattice
from ..sheet.net import board_net
from ..sheet.offset import offset_surface
from ..sheet.wrap import on_surface, root_of, size_of
from .fill import EQUAL_TOLERANCE, LatticePlacement, fill
from .outline import FlatMap, Zone, disc, flat_loops, outline
from .region import Region
from .wrap import WrappedBoards, check_board_folds, relax_boards, turned_over_boards, unroll_boards, with_surrounded

Choice = Literal["fill", "all"] | Sequence[tuple[int, int]]
# Largest number of nodes of the flat map along the size of the surface. Larger: more exact for small boards, slower.
MAX_MAP_NODES = 30
# Relative pitch error of two nodes of the map from which on their geodesics are wrong. Larger: keeps wrong nodes.
MAX_MAP_PITCH_ERROR = 0.3
# Overhang up to which a board that "fill" or "all" chose is kept: on a doubly curved surface the lattice strains [m].
# Larger: keeps boards that protrude.
FILL_OVERHANG_LIMIT = 5e-4


def lay_boards(
    surface: BSplineSurface,
    lattice: HexLattice,
    choice: Choice,
    origin: ArrayLike | None,
    direction: ArrayLike | None,
    *,
    offset: float = 0.0,
    fit: SurfaceFit | None = None,
    excluded: Sequence[Zone] = (),
) -> tuple[WrappedBoards, Array]:
    """Choose boards and place them on a surface.

    Parameters
    ----------
    surface : BSplineSurface
        The surface, in the link frame.
    lattice : HexLattice
        The flat lattice.
    choice : "fill", "all" or sequence of (q, r)
        "fill" chooses offset and rotation of the lattice for the largest number of boards. "all" puts the root at the
        origin and its row along the direction, and takes all boards that fit. A sequence gives axial coordinates.
    origin : array, shape (3,), or None
        Position of the root cell (0, 0), or near it for "fill" [m]. None takes the middle of the surface.
    direction : array, shape (3,), or None
        Direction of the row at the root, or nearly so for "fill". None takes the direction of v.
    offset : float
        Height of the middle planes of the boards above the surface [m].
    fit : SurfaceFit, optional
        Fit of the surface: boards stay where its mesh has faces.
    excluded : sequence of Zone
        Zones without boards.

    Returns
    -------
    boards : WrappedBoards
        The placed boards.
    overhang : array, shape (n,)
        Protrusion of each board over an edge of the surface or the mesh, or into an excluded zone [m].

    Raises
    ------
    InvalidPlan
        If no board fits, or boards of the given sequence fold over each other.
    OutsideSurface
        If a board of the given sequence is outside the surface.
    """
    layer, start = offset_surface(surface, offset), root_of(surface, origin)
    if direction is None:
        direction = layer.derivatives(start[None])[0, 1, 0]
    to_flat = _flat_map(layer, lattice, fit, start, direction)
    loops = flat_loops(to_flat, outline(surface, fit, float(start[1])))
    centres = np.array([zone.point for zone in excluded]).reshape(-1, 3)
    flat_points = to_flat(centres, footpoints(surface, centres)[0])
    region = Region(
        tuple(loops), tuple(disc(flat_point, zone.radius) for flat_point, zone in zip(flat_points, excluded))
    )
    if choice == "fill":
        placement = _with_root_at_origin(fill(region, lattice))
    elif choice == "all":
        placement = fill(region, lattice, np.zeros(2), 0.0)
    else:
        placement = LatticePlacement(lattice, np.zeros(2), 0.0, np.array(choice))
    complete = with_surrounded(placement.cells)
    guess = to_flat.at(replace(placement, cells=complete).centres, placement.angle)
    uv, tangents = (values[: len(placement.cells)] for values in relax_boards(layer, lattice, complete, *guess))
    boards = WrappedBoards(surface, offset, lattice, placement.cells, uv, tangents)
    overhang = _overhangs(region, placement, to_flat(layer.points(boards.uv), boards.uv))
    inside = on_surface(layer, boards.uv)
    if not isinstance(choice, str):
        if not inside.all():
            raise OutsideSurface(
                f"board {placement.cells[~inside][0].tolist()} lies beyond the edge of the surface, the first of "
                f"{np.count_nonzero(~inside)}; leave it out, or move the origin"
            )
        check_board_folds(layer, placement.cells, boards.uv)
        return boards, overhang
    # On a doubly curved surface boards keep their pitch and leave their flat positions. Remove those that protrude or
    # fold over each other.
    inside &= (overhang <= FILL_OVERHANG_LIMIT) & ~turned_over_boards(boards.cells, boards.uv)
    if not inside.any():
        raise InvalidPlan("no board fits on this surface: the curvature is too high for this size. Use smaller boards")
    kept = replace(boards, cells=boards.cells[inside], uv=boards.uv[inside], tangents=boards.tangents[inside])
    return kept, overhang[inside]


def _with_root_at_origin(placement: LatticePlacement) -> LatticePlacement:
    """Return the same boards; the root is the cell nearest to the flat origin."""
    distances = np.linalg.norm(placement.centres, axis=1)
    root = placement.cells[np.flatnonzero(distances < distances.min() + EQUAL_TOLERANCE)[0]]
    centre = placement.centres[(placement.cells == root).all(axis=1)][0]
    return replace(placement, offset=centre, cells=placement.cells - root)


def _overhangs(region: Region, placement: LatticePlacement, centres: Array) -> Array:
    """Return the protrusion of each board out of the region, with its flat centre, shape (n,) [m]."""
    turn = np.array(
        ((np.cos(placement.angle), np.sin(placement.angle)), (-np.sin(placement.angle), np.cos(placement.angle)))
    )
    overhang = -region.clearances(centres, placement.lattice.corners @ turn)
    return np.where(overhang > EQUAL_TOLERANCE, overhang, 0.0)


def _flat_map(
    layer: BSplineSurface, lattice: HexLattice, fit: SurfaceFit | None, start: Array, direction: ArrayLike
) -> FlatMap:
    """Return a flat map of the part of a surface that the mesh covers.

    Its nodes are boards of the lattice, or larger ones if there would be too many.
    """
    size = size_of(layer)
    if lattice.pitch < size / MAX_MAP_NODES:
        lattice = HexLattice(size / MAX_MAP_NODES / np.sqrt(3), 0.0)
    grid = layer.grid_points(np.linspace(0, 1, 33), np.linspace(0, 1, 33))
    length, breadth = (float(np.linalg.norm(np.diff(grid, axis=k), axis=2).sum(axis=k).max()) for k in (0, 1))
    radius = float(np.hypot(length, breadth / 2 if layer.closed[1] else breadth))
    if fit is not None:  # without a mesh the surface may be far off
        radius = min(radius, (2.0 if layer.closed[1] else 1.0) * fit.mesh.size)
    count = int(np.ceil(radius / lattice.row_step)) + 1
    r, q = np.indices((2 * count + 1, 2 * count + 1)).reshape(2, -1) - count
    cells = np.column_stack((q, r))
    cells = cells[(lattice.centres(cells) ** 2).sum(axis=1) <= radius**2]
    uv, _ = unroll_boards(layer, lattice, cells, start, direction)
    kept = on_surface(layer, uv) & (~np.array(layer.closed) | (np.abs(uv - start) <= 0.5)).all(axis=1)
    if fit is not None:
        kept &= fit.is_trusted(layer.wrap(np.where(kept[:, None], uv, start)))
    kept |= (cells == 0).all(axis=1)
    cells, points = cells[kept], layer.points(uv[kept])
    # Keep the cells connected to the root: a geodesic that has left the mesh may return at a wrong position.
    pairs = board_net(lattice, cells).pairs
    pairs = pairs[
        np.abs(np.linalg.norm(np.diff(points[pairs], axis=1)[:, 0], axis=1) / lattice.pitch - 1) < MAX_MAP_PITCH_ERROR
    ]
    links = coo_array((np.ones(len(pairs)), pairs.T), shape=(len(cells), len(cells)))
    group = connected_components(links, directed=False)[1]
    cells = cells[group == group[(cells == 0).all(axis=1)]]
    guess = unroll_boards(layer, lattice, cells, start, direction)
    return FlatMap(layer, lattice.centres(cells), *relax_boards(layer, lattice, cells, *guess))
