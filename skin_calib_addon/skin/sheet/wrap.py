"""Placement of a sheet on a surface with the least strain: the sheet bends, it does not stretch."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import make_interp_spline

from ...common.arrays import Array, BoolArray
from ...common.errors import InvalidPlan, OutsideSurface
from ...geometry.surface.bspline import BSplineSurface
from ...geometry.surface.centre import surface_centre
from ..lattice import SheetLattice
from .constraints import Constraints, pin_constraints, row_axis
from .folds import check_folds, turned_over
from .geodesic import unroll
from .landmarks import Landmark, LandmarkTargets, located
from .net import Net, grid_net
from .offset import offset_surface
from .relax import STEP_TOLERANCE, relax

# A first guess farther beyond an edge than this fraction of the surface is refused at once. Larger: refuses later,
# after more time.
MAX_GUESS_OVERSHOOT = 0.5
# Weight of the strain beyond the edges of the surface, for a sheet that is trimmed. Larger: the extrapolated surface
# has more influence on the cells inside.
OUTSIDE_WEIGHT = 1e-3
# Movement up to which an intermediate solution has converged, as a fraction of the pitch. Larger: faster, and less
# exact.
COARSE_STEP_TOLERANCE = 0.01
# Relative error of a chord from which on a net may be folded. Larger: accepts folded nets.
MAX_CHORD_ERROR = 0.5
# Largest distance of the nodes between two surfaces for a start from the old nodes, in pitches. Larger: starts that are
# too far away, and slow.
MAX_START_DISTANCE = 2
# Parameters beyond an edge by this fraction of the surface are on the edge: rounding.
PARAMETER_ROUNDING = 1e-9
# Longest step of the geodesics of a first guess, as a fraction of the size of the surface. Larger: faster, less exact.
GUESS_STEP = 0.1
# Largest rotation of the normal in such a step [rad]; beyond it cubics do not interpolate the parameters.
MAX_GUESS_TURN = 1.0
# A shorter step that still exceeds this rotation by this factor crosses a sharp edge.
EDGE_FACTOR = 1.2


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
        The same sheet on a similar surface, as a start. The result is exact to a hundredth of the pitch, in half the
        time.

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
    along, step = row_axis(layer, start, direction), guess_step(layer, max(lattice.pitch))

    def pin_by_direction(net: Net, uv: Array) -> Constraints:
        return pin_constraints(layer, net, uv, row_axis(layer, uv[net.pin], direction))

    constrain = pin_by_direction
    if len(landmarks) > 1:
        targets = LandmarkTargets.of(surface, layer, lattice, landmarks)
        along, constrain = targets.heading(along, step), targets.constraints
    net = grid_net(lattice.node_shape, lattice.step, pin)

    def guess(step: float) -> Array:
        uv = unroll(layer, net.flat, start, along, step).reshape(*lattice.node_shape, 2)
        if not trim:
            _check_inside(layer, lattice, uv, MAX_GUESS_OVERSHOOT)
        return uv

    start_nodes = None if near is None else _moved_sheet(near, layer, net, start)
    uv = _relax_sheet(layer, lattice, guess, step, pin, constrain, trim, start_nodes)
    inside = on_surface(layer, uv[1::2, 1::2]).ravel()
    if not trim or not inside.any():
        _check_inside(layer, lattice, uv)
    check_folds(layer, lattice, uv, inside)
    return WrappedSheet(surface, offset, layer, lattice, uv, inside)


def _moved_sheet(sheet: WrappedSheet, layer: BSplineSurface, net: Net, start: Array) -> Array | None:
    """Return the nodes of a sheet, shifted to its start on another layer, shape (n, 2); None if they are far from it.

    Parameters
    ----------
    sheet : WrappedSheet
        The sheet on its own layer.
    layer : BSplineSurface
        The other layer.
    net : Net
        The net of the sheet.
    start : array, shape (2,)
        Parameters of the pinned node.
    """
    before = sheet.uv.reshape(-1, 2)
    uv = before + (start - before[net.pin])
    far = np.linalg.norm(layer.points(uv) - sheet.layer.points(before), axis=1).max()
    return uv if far < MAX_START_DISTANCE * net.pitch else None


def _relax_sheet(
    layer: BSplineSurface,
    lattice: SheetLattice,
    guess: Callable[[float], Array],
    step: float,
    pin: tuple[int, int],
    constrain: Callable[[Net, Array], Constraints],
    trim: bool,
    start_nodes: Array | None,
) -> Array:
    """Return the nodes of least strain, shape (a, b, 2): first every second node with the pinned one, then all.

    Parameters
    ----------
    layer : BSplineSurface
        Surface of the neutral layer.
    lattice : SheetLattice
        The flat sheet.
    guess : function
        Returns the first guess of all nodes for a step of the geodesics [m].
    step : float
        Step of the first guess [m].
    pin : pair of int
        Row and column of the pinned node.
    constrain : function
        Returns the constraints of a net at given parameters.
    trim : bool
        As for :func:`wrap_sheet`.
    start_nodes : array, shape (n, 2), or None
        Nodes on a similar surface, if known.
    """

    def relaxed(net: Net, uv: Array, step_tolerance: float = STEP_TOLERANCE) -> Array:
        weights = None
        if trim:
            weights = np.where(on_surface(layer, uv)[net.pairs].any(axis=1), 1.0, OUTSIDE_WEIGHT)
        return relax(layer, net, uv, constrain(net, uv), weights, step_tolerance)

    def is_valid(uv: Array) -> bool:
        inside = on_surface(layer, uv[1::2, 1::2]).ravel()
        return not (turned_over(layer, lattice, uv) & inside).any()

    net, shape = grid_net(lattice.node_shape, lattice.step, pin), (*lattice.node_shape, 2)
    if start_nodes is not None:
        uv = relaxed(net, start_nodes, COARSE_STEP_TOLERANCE)
        if not may_be_folded(layer, net, uv) and is_valid(uv.reshape(shape)):
            return uv.reshape(shape)
    uv = guess(step)
    first = (pin[0] % 2, pin[1] % 2)
    coarse = uv[first[0] :: 2, first[1] :: 2]
    if min(coarse.shape[:2]) > 1 and layer.turning(min(lattice.pitch)) < MAX_GUESS_TURN:
        coarse_net = grid_net(coarse.shape[:2], (2 * lattice.step[0], 2 * lattice.step[1]), (pin[0] // 2, pin[1] // 2))
        uv = _interpolated(
            relaxed(coarse_net, coarse.reshape(-1, 2), COARSE_STEP_TOLERANCE).reshape(coarse.shape),
            first,
            lattice.node_shape,
        )
        if may_be_folded(layer, net, uv.reshape(-1, 2)):
            uv = guess(min(lattice.pitch) / 2)
    uv = relaxed(net, uv.reshape(-1, 2)).reshape(shape)
    if is_valid(uv):
        return uv
    # A fold has no strain and stays. Start again with a geodesic through every node, which has none.
    return relaxed(net, guess(min(lattice.pitch) / 2).reshape(-1, 2)).reshape(shape)


def may_be_folded(layer: BSplineSurface, net: Net, uv: Array) -> bool:
    """Return whether a chord is so short or so long that the net may be folded.

    Parameters
    ----------
    layer : BSplineSurface
        Surface of the net.
    net : Net
        The net.
    uv : array, shape (n, 2)
        Parameters of its nodes.
    """
    chords = np.linalg.norm(np.diff(layer.points(uv)[net.pairs], axis=1)[:, 0], axis=1)
    return bool(np.abs(chords / net.lengths - 1).max() > MAX_CHORD_ERROR)


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


def _interpolated(uv: Array, first: tuple[int, int], shape: tuple[int, int]) -> Array:
    """Interpolate all nodes of a grid from every second node, beginning at ``first``, by cubics in both directions."""
    for axis in (0, 1):
        n = uv.shape[axis]
        known = first[axis] + 2 * np.arange(n)
        spline = make_interp_spline(known, uv, k=3 if n > 3 else 1, axis=axis)
        uv = spline(np.arange(shape[axis]))
    return uv


def guess_step(surface: BSplineSurface, pitch: float) -> float:
    """Return the step of the geodesics of a first guess: short enough for cubics between the points [m].

    Parameters
    ----------
    surface : BSplineSurface
        The surface.
    pitch : float
        Pitch of the cells [m].
    """
    step = max(2 * pitch, GUESS_STEP * size_of(surface))
    step *= MAX_GUESS_TURN / max(surface.turning(step), MAX_GUESS_TURN)
    # At a sharp edge the normal rotates as much over a shorter step: trace every node there.
    return pitch / 2 if surface.turning(step) > EDGE_FACTOR * MAX_GUESS_TURN else max(step, pitch / 2)


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
    return (surface.closed | (np.abs(uv - 0.5) <= 0.5 + PARAMETER_ROUNDING)).all(axis=-1)


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


def _check_inside(surface: BSplineSurface, lattice: SheetLattice, uv: Array, slack: float = 0.0) -> None:
    """Raise OutsideSurface for the first cell whose centre is beyond an open edge.

    Cells beyond it by up to ``slack``, as a fraction of the surface, are accepted if no cell is farther out.
    """
    centres = uv[1::2, 1::2].reshape(-1, 2)
    beyond = np.where(surface.closed, 0.0, np.abs(centres - 0.5) - 0.5).max(axis=1)
    if beyond.max() <= slack + PARAMETER_ROUNDING:
        return
    outside = np.flatnonzero(beyond > PARAMETER_ROUNDING)
    row, column = lattice.index[outside[0]].tolist()
    gap, edge = beyond_edge(surface, centres[outside[0]])
    raise OutsideSurface(
        f"cell ({row}, {column}) lies {gap * 1e3:.1f} mm beyond the edge {edge} of the surface, the first of "
        f"{len(outside)}; move the origin, rotate the direction, or extend the grid",
        row=row,
        column=column,
        distance=gap,
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
