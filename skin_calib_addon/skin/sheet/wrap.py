"""Wrap a sheet on a surface with the least strain: it bends, it does not stretch."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import make_interp_spline

from ...common.arrays import Array, BoolArray
from ...common.errors import InvalidPlan, OutsideSurface
from ...geometry.surface.bspline import BSplineSurface
from ...geometry.surface.centre import surface_centre
from ...geometry.surface.distance import footpoints
from ..lattice import SheetLattice
from .constraints import Constraints, centring, pin_constraints, row_axis
from .geodesic import unroll
from .landmarks import Landmark, LandmarkTargets
from .net import Net, grid_net
from .offset import offset_surface
from .relax import STEP_TOLERANCE, relax

# A first guess that lies beyond an edge by this share of the surface will not come back.
MAX_GUESS_OVERSHOOT = 0.5
# Of a sheet that is trimmed, weight of the strains beyond the edges of the surface.
OUTSIDE_WEIGHT = 1e-3
# Rounds in which a sheet comes to rest, and by how much of its pitch its pinned node may still move in the last.
CENTRING_ITERATIONS, CENTRING_TOLERANCE = 4, 0.01
# Moves that end the rest of every second node: a share of the pitch.
COARSE_STEP_TOLERANCE = 0.01
# Where nodes between those at rest are this much of their distance too near or too far, the surface turns between them.
MAX_CHORD_ERROR = 0.5
# A surface is like another on which no node of the sheet is further away than so many pitches.
MAX_START_DISTANCE = 2
# Share of the surface by which a point on its edge may be beyond.
PARAMETER_ROUNDING = 1e-9
# Geodesics of a first guess have points no nearer than this share of the surface's size: they turn slowly.
GUESS_STEP = 0.1
# Where they turn by more than this from one to the next [rad], the parameters between them are not told by cubics.
MAX_GUESS_TURN = 1.0
# By this factor more, on a way that should be short enough, it turns at an edge.
EDGE_FACTOR = 1.2


@dataclass(frozen=True, eq=False)
class WrappedSheet:
    """A sheet on its surface."""

    surface: BSplineSurface
    offset: float  # height of the sheet's neutral layer above the surface [m]
    layer: BSplineSurface  # where that layer lies, with the parameters of the surface
    lattice: SheetLattice
    uv: Array  # (a, b, 2) of the nodes; not wrapped round, so that they are continuous over a seam
    inside: BoolArray  # (cells,) which centres lie on the surface: all, unless the author asked to trim


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
    """Lay a sheet on a surface as isometrically as the surface allows.

    On a developable surface this is the exact unrolling; on a doubly curved one the strains of all half-pitch edges
    and diagonals have the least sum of squares.

    Parameters
    ----------
    surface : BSplineSurface
    lattice : SheetLattice
    origin : array, shape (3,), or None
        Where the centre of cell (0, 0) lies [m]; the nearest surface point is taken. None centres the sheet on the
        surface: as much is left free, along the surface, at one open edge as at the other, and round a closed one its
        middle lies half way from angle zero. That is up to the shape alone, not to where planes and lines are.
    direction : array, shape (3,)
        Where the row of the origin runs to, in the link frame; its part in the surface counts.
    offset : float
        Height of the sheet's neutral layer, which keeps its lengths, above the surface [m].
    landmarks : sequence of Landmark
        Instead of the origin: the first holds its cell, the second turns the sheet, and from three on it is stretched
        to meet all of them.
    trim : bool
        Whether cells may lie off the surface; they are left out.
    near : WrappedSheet, optional
        This sheet on a surface much like this one: it comes to rest from there, to a hundredth of its pitch, in half
        the time.

    Raises
    ------
    InvalidPlan
        If the direction stands upright on the surface, the offset folds it, or landmarks are the same.
    OutsideSurface
        Names the first cell whose centre lies off the surface.
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
        return pin_constraints(layer, net, uv, row_axis(layer, uv[net.pin], direction), centre=origin is None)

    constrain = pin_by_direction
    if len(landmarks) > 1:
        targets = LandmarkTargets.of(surface, layer, lattice, landmarks)
        along, constrain = targets.heading(along, step), targets.constraints
    net = grid_net(lattice.node_shape, lattice.step, pin)

    def guess(step: float) -> Array:
        uv = unroll(layer, net.flat, start, along, step)
        if origin is None:
            uv = uv + centring_shift(layer, uv)
        uv = uv.reshape(*lattice.node_shape, 2)
        if not trim:
            check_inside(layer, lattice, uv, MAX_GUESS_OVERSHOOT)
        return uv

    start_nodes = None if near is None else moved_sheet(near, layer, net, start, origin is None)
    uv = relax_sheet(layer, lattice, guess, step, pin, constrain, origin is None, trim, start_nodes)
    inside = on_surface(layer, uv[1::2, 1::2]).ravel()
    if not trim or not inside.any():
        check_inside(layer, lattice, uv)
    return WrappedSheet(surface, offset, layer, lattice, uv, inside)


def moved_sheet(sheet: WrappedSheet, layer: BSplineSurface, net: Net, start: Array, centre: bool) -> Array | None:
    """The nodes of a sheet moved to where it starts on another layer, shape (n, 2); None where they are far away then.

    Parameters
    ----------
    start : array, shape (2,)
        Parameters of the pinned node.
    centre : bool
        Whether the sheet is centred on the surface.
    """
    before = sheet.uv.reshape(-1, 2)
    uv = before + (start - before[net.pin])
    if centre:
        uv = uv + centring_shift(layer, uv)
    far = np.linalg.norm(layer.points(uv) - sheet.layer.points(before), axis=1).max()
    return uv if far < MAX_START_DISTANCE * net.pitch else None


def relax_sheet(
    layer: BSplineSurface,
    lattice: SheetLattice,
    guess: Callable[[float], Array],
    step: float,
    pin: tuple[int, int],
    constrain: Callable[[Net, Array], Constraints],
    centre: bool,
    trim: bool,
    start_nodes: Array | None,
) -> Array:
    """Bring the nodes to rest: every second of them, the pinned one among them, and then all, shape (a, b, 2).

    Parameters
    ----------
    guess : function
        Of a step between points on geodesics [m]: all nodes as these leave them.
    step : float
        For the first guess [m].
    last : array, shape (n, 2), or None
        The nodes on a surface much like this one, where they are known.
    """

    def relaxed(
        net: Net, uv: Array, rounds: int = CENTRING_ITERATIONS, step_tolerance: float = STEP_TOLERANCE
    ) -> Array:
        weights = None
        if trim:
            weights = np.where(on_surface(layer, uv)[net.pairs].any(axis=1), 1.0, OUTSIDE_WEIGHT)
        for _ in range(rounds):
            before, uv = uv[net.pin], relax(layer, net, uv, constrain(net, uv), weights, step_tolerance)
            if not centre or rounds == 1:
                break
            # Where a centred sheet has moved, its direction is another, and so may be its outermost nodes.
            points = layer.points([before, uv[net.pin], uv[net.pin] + centring_shift(layer, uv)])
            if np.linalg.norm(np.diff(points, axis=0), axis=1).max() < CENTRING_TOLERANCE * net.pitch:
                break
        return uv

    net = grid_net(lattice.node_shape, lattice.step, pin)
    if start_nodes is not None:
        uv = relaxed(net, start_nodes, step_tolerance=COARSE_STEP_TOLERANCE)
        if not may_be_folded(layer, net, uv):
            return uv.reshape(*lattice.node_shape, 2)
    uv = guess(step)
    first = (pin[0] % 2, pin[1] % 2)
    coarse = uv[first[0] :: 2, first[1] :: 2]
    if min(coarse.shape[:2]) > 1 and layer.turning(min(lattice.pitch)) < MAX_GUESS_TURN:
        coarse_net = grid_net(coarse.shape[:2], (2 * lattice.step[0], 2 * lattice.step[1]), (pin[0] // 2, pin[1] // 2))
        uv = interpolated(
            relaxed(coarse_net, coarse.reshape(-1, 2), 1, COARSE_STEP_TOLERANCE).reshape(coarse.shape),
            first,
            lattice.node_shape,
        )
        if may_be_folded(layer, net, uv.reshape(-1, 2)):
            uv = guess(min(lattice.pitch) / 2)
    return relaxed(net, uv.reshape(-1, 2)).reshape(uv.shape)


def may_be_folded(layer: BSplineSurface, net: Net, uv: Array) -> bool:
    """Whether nodes lie so much too near or too far from those beside them that the net may be folded."""
    chords = np.linalg.norm(np.diff(layer.points(uv)[net.pairs], axis=1)[:, 0], axis=1)
    return bool(np.abs(chords / net.lengths - 1).max() > MAX_CHORD_ERROR)


def centring_shift(layer: BSplineSurface, uv: Array) -> Array:
    """By how much the parameters of all nodes are to grow for a sheet to be centred, shape (2,)."""
    return np.array([0.0 if closed else centring(layer, uv, axis)[1] for axis, closed in enumerate(layer.closed)])


def root_of(surface: BSplineSurface, origin: ArrayLike | None) -> Array:
    """Parameters of the surface point nearest to an origin, or of the surface's middle, shape (2,)."""
    if origin is None:
        return np.array(surface_centre(surface))
    return footpoints(surface, np.asarray(origin, float)[None])[0][0]


def interpolated(uv: Array, first: tuple[int, int], shape: tuple[int, int]) -> Array:
    """All nodes of a grid from every second of them, which begin at ``first``, by cubics along both sides."""
    for axis in (0, 1):
        n = uv.shape[axis]
        known = first[axis] + 2 * np.arange(n)
        spline = make_interp_spline(known, uv, k=3 if n > 3 else 1, axis=axis)
        uv = spline(np.arange(shape[axis]))
    return uv


def guess_step(surface: BSplineSurface, pitch: float) -> float:
    """How far apart points on the geodesics of a first guess may be for those between them to lie near [m]."""
    step = max(2 * pitch, GUESS_STEP * size_of(surface))
    step *= MAX_GUESS_TURN / max(surface.turning(step), MAX_GUESS_TURN)
    # Over an edge the surface turns as much on a shorter way: there nodes go without any between.
    return pitch / 2 if surface.turning(step) > EDGE_FACTOR * MAX_GUESS_TURN else max(step, pitch / 2)


def size_of(surface: BSplineSurface) -> float:
    """Diagonal of the box of the control points [m]."""
    return float(np.linalg.norm(np.ptp(surface.control_net.reshape(-1, 3), axis=0)))


def on_surface(surface: BSplineSurface, uv: Array) -> BoolArray:
    """Whether parameters (..., 2) lie within the edges of the surface."""
    return (surface.closed | (np.abs(uv - 0.5) <= 0.5 + PARAMETER_ROUNDING)).all(axis=-1)


def check_size(surface: BSplineSurface, pitch: tuple[float, float]) -> None:
    """Raise InvalidPlan for cells that are larger than the surface."""
    if max(pitch) > size_of(surface):
        raise InvalidPlan(
            f"a cell of {pitch[0] * 1e3:g} x {pitch[1] * 1e3:g} mm is larger than the whole surface, "
            f"{size_of(surface) * 1e3:.1f} mm; lengths are in metres"
        )


def check_inside(surface: BSplineSurface, lattice: SheetLattice, uv: Array, slack: float = 0.0) -> None:
    """Raise OutsideSurface for the first cell whose centre is beyond an open edge of the surface.

    Parameters
    ----------
    slack : float
        By how much a cell must be beyond, as a share of the surface, before any is named.
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
        f"{len(outside)}; move the origin, turn the direction, or widen the grid",
        row=row,
        column=column,
        distance=gap,
    )


def beyond_edge(surface: BSplineSurface, uv: Array) -> tuple[float, str]:
    """How far parameters (2,) lie beyond the edge of the surface that they are furthest beyond [m], and its name."""
    axis = int(np.argmax(np.where(surface.closed, 0.0, np.abs(uv - 0.5))))
    inner = uv.copy()
    inner[axis] = np.clip(uv[axis], 0, 1)
    gap = float(np.linalg.norm(np.diff(surface.points(np.stack((uv, inner))), axis=0)))
    return gap, f"{'uv'[axis]} = {inner[axis]:g}"
