"""Placement of a sheet on a surface with the least strain: the sheet bends, it does not stretch."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import chain

import numpy as np
from numpy.typing import ArrayLike

from ...common.arrays import Array, BoolArray
from ...common.errors import InvalidPlan, OutsideSurface
from ...common.warnings import Place, point_of
from ...geometry.surface.bspline import BSplineSurface
from ...geometry.surface.centre import surface_centre
from ...geometry.surface.footpoints import PARAMETER_TOLERANCE
from ..lattice import SheetLattice
from .constraints import Constraints, pin_constraints, row_axis
from .folds import check_folds, turned_over
from .geodesic import unroll
from .landmarks import Landmark, LandmarkTargets, located
from .net import Net, grid_net
from .offset import offset_surface
from .relax import relax

# Weight of the strain beyond the edges of the surface, for a sheet that is trimmed. Larger: the extrapolated surface
# has more influence on the cells inside.
OUTSIDE_WEIGHT = 1e-3
# Steps of the geodesics of a first guess, in nodes, tried in this order until no cell is turned over. One through every
# node has no folds; longer ones follow a wavy surface less. More steps: more sheets are placed, more time.
GUESS_STEPS = (1, 2, 4)


@dataclass(frozen=True, eq=False)
class WrappedSheet:
    """A sheet placed on a surface."""

    surface: BSplineSurface
    offset: float  # height of the neutral layer of the sheet above the surface [m]
    layer: BSplineSurface  # surface of the neutral layer, with the same parameters
    lattice: SheetLattice
    uv: Array  # (a, b, 2) parameters of the nodes, continuous over a seam
    inside: BoolArray  # (cells,) which centres are on the surface; all, unless the sheet is trimmed


def wrap_sheet(
    surface: BSplineSurface,
    lattice: SheetLattice,
    origin: ArrayLike | None,
    direction: ArrayLike,
    *,
    offset: float = 0.0,
    landmarks: Sequence[Landmark] = (),
    trim: bool = False,
    near: WrappedSheet | None = None,
) -> WrappedSheet:
    """Place a sheet on a surface as isometrically as the surface allows.

    On a developable surface the result is the exact unrolling. On a doubly curved surface it minimizes the sum of the
    squared strains of all edges and diagonals between the nodes; see :func:`.relax.relax`.

    Parameters
    ----------
    surface : BSplineSurface
        The surface, in the link frame.
    lattice : SheetLattice
        The flat sheet.
    origin : array, shape (3,), or None
        Position of the centre of cell (0, 0) [m]; its nearest surface point counts. None centres the sheet: its middle
        is the centre of the surface, see `surface_centre`. This depends on the mesh, not on planes and lines.
    direction : array, shape (3,)
        Direction of the row at the origin, in the link frame; its tangential part counts.
    offset : float
        Height of the neutral layer, which keeps its lengths, above the surface [m].
    landmarks : sequence of Landmark
        They replace the origin. The first fixes its cell, the second the rotation. Three or more stretch the sheet to
        meet all of them.
    trim : bool
        Whether cells may be outside the surface; they are left out.
    near : WrappedSheet, optional
        The same sheet on a similar surface, as the first start: it saves time.

    Returns
    -------
    WrappedSheet

    Raises
    ------
    InvalidPlan
        If a cell is larger than the surface, the direction is perpendicular to the surface, the offset folds the
        surface, two landmarks are equal, or the placement does not converge.
        If the sheet is folded: a cell is turned over, or two cells are in one place; names the first cell.
    OutsideSurface
        If the centre of a cell is outside the surface; names the first cell.
    """
    check_size(surface, lattice.pitch)
    layer = offset_surface(surface, offset)
    if landmarks:
        origin, pin = landmarks[0].point, (2 * landmarks[0].cell[0] + 1, 2 * landmarks[0].cell[1] + 1)
    else:
        pin = (1, 1) if origin is not None else (lattice.rows, lattice.columns)
    start = root_of(surface, origin)
    along, step = row_axis(layer, start, direction), min(lattice.pitch) / 2

    def pin_by_direction(net: Net, uv: Array) -> Constraints:
        return pin_constraints(layer, net, uv, row_axis(layer, uv[net.pin], direction))

    constrain = pin_by_direction
    if len(landmarks) > 1:
        targets = LandmarkTargets.of(surface, layer, lattice, landmarks)
        along, constrain = targets.heading(along, step), targets.constraints
    net = grid_net(lattice.node_shape, lattice.step, pin)
    starts: Iterable[Array] = (
        unroll(layer, net.flat, start, along, n * step).reshape(*lattice.node_shape, 2) for n in GUESS_STEPS
    )
    if near is not None:
        starts = chain([near.uv + (start - near.uv[pin])], starts)
    uv = _relax_sheet(layer, lattice, net, starts, constrain, trim)
    inside = on_surface(layer, uv[1::2, 1::2]).ravel()
    if not trim or not inside.any():
        _check_inside(layer, lattice, uv)
    check_folds(layer, lattice, uv, inside)
    return WrappedSheet(surface, offset, layer, lattice, uv, inside)


def _relax_sheet(
    layer: BSplineSurface,
    lattice: SheetLattice,
    net: Net,
    starts: Iterable[Array],
    constrain: Callable[[Net, Array], Constraints],
    trim: bool,
) -> Array:
    """Return the nodes of least strain, shape (a, b, 2), from the first start that leaves no cell turned over.

    A fold has no strain and stays.

    Parameters
    ----------
    layer : BSplineSurface
        Surface of the neutral layer.
    lattice : SheetLattice
        The flat sheet.
    net : Net
        Its net.
    starts : iterable of array, shape (a, b, 2)
        First guesses of all nodes.
    constrain : function
        Returns the constraints of a net at given parameters.
    trim : bool
        As for :func:`wrap_sheet`.
    """
    for start in starts:
        uv = start.reshape(-1, 2)
        weights = None
        if trim:
            weights = np.where(on_surface(layer, uv)[net.pairs].any(axis=1), 1.0, OUTSIDE_WEIGHT)
        nodes = relax(layer, net, uv, constrain(net, uv), weights).reshape(start.shape)
        inside = on_surface(layer, nodes[1::2, 1::2]).ravel()
        if not (turned_over(layer, lattice, nodes) & inside).any():
            break
    return nodes


def root_of(surface: BSplineSurface, origin: ArrayLike | None) -> Array:
    """Return the parameters, shape (2,), of the surface point nearest to an origin.

    Parameters
    ----------
    surface : BSplineSurface
        The surface.
    origin : array, shape (3,), or None
        Position [m]; None gives the middle of the surface.

    Raises
    ------
    InvalidPlan
        If the origin is far from the surface.
    """
    if origin is None:
        return np.array(surface_centre(surface))
    return located(surface, np.asarray(origin, float)[None], ["The origin"])[0]


def size_of(surface: BSplineSurface) -> float:
    """Return the diagonal of the bounding box of the control points [m]."""
    return float(np.linalg.norm(np.ptp(surface.control_net.reshape(-1, 3), axis=0)))


def on_surface(surface: BSplineSurface, uv: Array) -> BoolArray:
    """Return whether parameters (..., 2) are within the edges of the surface.

    Parameters
    ----------
    surface : BSplineSurface
        The surface.
    uv : array, shape (..., 2)
        Parameters.
    """
    return (surface.closed | (np.abs(uv - 0.5) <= 0.5 + PARAMETER_TOLERANCE)).all(axis=-1)


def check_size(surface: BSplineSurface, pitch: tuple[float, float]) -> None:
    """Check that a cell is not larger than the surface.

    Parameters
    ----------
    surface : BSplineSurface
        The surface.
    pitch : pair of float
        Sides of a cell [m].

    Raises
    ------
    InvalidPlan
        If it is.
    """
    if max(pitch) > size_of(surface):
        raise InvalidPlan(
            f"a cell of {pitch[0] * 1e3:g} x {pitch[1] * 1e3:g} mm is larger than the whole surface, "
            f"{size_of(surface) * 1e3:.1f} mm; lengths are in metres"
        )


def _check_inside(surface: BSplineSurface, lattice: SheetLattice, uv: Array) -> None:
    """Raise OutsideSurface for the first cell whose centre is beyond an open edge."""
    centres = uv[1::2, 1::2].reshape(-1, 2)
    beyond = np.where(surface.closed, 0.0, np.abs(centres - 0.5) - 0.5).max(axis=1)
    if beyond.max() <= PARAMETER_TOLERANCE:
        return
    outside = np.flatnonzero(beyond > PARAMETER_TOLERANCE)
    row, column = lattice.index[outside[0]].tolist()
    gap, edge = beyond_edge(surface, centres[outside[0]])
    raise OutsideSurface(
        f"cell ({row}, {column}) lies {gap * 1e3:.1f} mm beyond the edge {edge} of the surface, the first of "
        f"{len(outside)}; move the origin, rotate the direction, or extend the grid",
        row=row,
        column=column,
        distance=gap,
        place=Place(point_of(surface.points(surface.wrap(centres[outside[:1]]).clip(0, 1))[0])),
    )


def beyond_edge(surface: BSplineSurface, uv: Array) -> tuple[float, str]:
    """Return the distance of parameters (2,) beyond the farthest edge [m], and the name of the edge.

    Parameters
    ----------
    surface : BSplineSurface
        The surface.
    uv : array, shape (2,)
        Parameters outside the surface.

    Returns
    -------
    gap : float
        Distance [m].
    edge : str
        For example ``"u = 1"``.
    """
    axis = int(np.argmax(np.where(surface.closed, 0.0, np.abs(uv - 0.5))))
    inner = uv.copy()
    inner[axis] = np.clip(uv[axis], 0, 1)
    gap = float(np.linalg.norm(np.diff(surface.points(np.stack((uv, inner))), axis=0)))
    return gap, f"{'uv'[axis]} = {inner[axis]:g}"
