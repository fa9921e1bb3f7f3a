"""Placement of a sheet on a surface with the least strain: the sheet bends, it does not stretch."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import count
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.ndimage import map_coordinates

from ...common.arrays import Array, BoolArray, unit
from ...common.errors import InvalidPlan, OutsideSurface
from ...common.warnings import Place, point_of
from ...geometry.surface.bspline import BSplineSurface
from ...geometry.surface.centre import surface_centre
from ...geometry.surface.footpoints import PARAMETER_TOLERANCE, descend
from ..lattice import SheetLattice
from .between import between, spline_matrix
from .constraints import Constraints, pin_constraints, row_axis
from .folds import check_folds, turned_meshes, turned_over
from .geodesic import unroll
from .landmarks import Landmark, LandmarkTargets, located
from .net import GridLines, Lines, Net, grid_net
from .offset import offset_surface
from .relax import DRAFT_STEP_TOLERANCE, STEP_TOLERANCE, relax

# Weight of the strain beyond the edges of the surface, for a sheet that is trimmed. Larger: the extrapolated surface
# has more influence on the cells inside.
OUTSIDE_WEIGHT = 1e-3
# Movement of a taxel when the distance of the nodes is halved, up to which it is not halved again [m]. Larger: faster,
# and less exact on doubly curved surfaces.
MAX_HALVING_MOVE = 5e-5
# Nodes up to which the distance is halved. Larger: more exact on surfaces with narrow features, and slower there.
MAX_NODES = 10_000
# Most parts of the distance of two nodes along the longer side of a cell: meshes are nearly square. Larger: more exact
# for long and narrow cells, and slower.
MAX_PARTS = 8
# Steps of the geodesics of a first guess, in nodes, tried in this order until no cell is turned over. One through every
# node has no folds; longer ones follow a wavy surface less. More steps: more sheets are placed, more time.
GUESS_STEPS = (1, 2, 4)
# Nodes up to which a preview places all of them. Larger: more previews are exact, and take longer.
MAX_EXACT_NODES = 1000
# Rows and columns of nodes that a preview of more nodes places, in addition to those of the pinned node and of the
# landmarks. Larger: the preview is nearer to the exact placement, and takes longer.
PREVIEW_LINES = 11, 33
# Largest distance of the origin of a preview from the surface, as a fraction of the pitch, at which no nearer part of
# the surface is searched for. Larger: faster over a rough mesh; a thin link may get the skin on its other side.
MAX_ROOT_DISTANCE = 0.1
# Largest angle between the direction of a sheet and that of a placement from which it starts [rad]. Larger: faster
# where a sheet is rotated by a large angle, and it may converge to a fold.
MAX_START_TURN = 0.3


@dataclass(frozen=True, eq=False)
class WrappedSheet:
    """A sheet placed on a surface."""

    surface: BSplineSurface
    offset: float  # height of the neutral layer of the sheet above the surface [m]
    layer: BSplineSurface  # surface of the neutral layer, with the same parameters
    lattice: SheetLattice
    uv: Array  # (a, b, 2) parameters of the nodes, continuous over a seam
    inside: BoolArray  # (cells,) which centres are on the surface; all, unless the sheet is trimmed
    lines: tuple[Lines, Lines]  # rows and columns of nodes that have been placed; the others are between them

    @property
    def interpolated(self) -> bool:
        """Return whether only some nodes have been placed."""
        return self.lines != self.lattice.node_lines


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
    preview: bool = False,
) -> WrappedSheet:
    """Place a sheet on a surface as isometrically as the surface allows.

    On a developable surface the result is the exact unrolling. On a doubly curved surface it has the least strain
    energy of an elastic sheet with Poisson's ratio 1/3, see :func:`.net.grid_net` and :func:`.relax.relax`. The
    distance of the nodes is halved until no taxel moves by more than ``MAX_HALVING_MOVE``.

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
        A sheet of nearly the same size, on a similar surface, as the first start: it saves time.
    preview : bool
        Place a fine sheet fast and not exactly: some rows and columns of nodes are placed, the others interpolated.
        Neither folds nor overlaps are refused.

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
    _check_size(surface, lattice.pitch)
    layer = offset_surface(surface, offset)
    name = "The origin"
    if landmarks:
        name = "Landmark 0"
        origin, pin = landmarks[0].point, (2 * landmarks[0].cell[0] + 1, 2 * landmarks[0].cell[1] + 1)
    else:
        pin = (1, 1) if origin is not None else (lattice.rows, lattice.columns)
    start = None if near is None else root_near(surface, origin, near)
    start = root_of(surface, origin, name) if start is None else start
    fixed = [pin, *((2 * i + 1, 2 * j + 1) for i, j in (landmark.cell for landmark in landmarks))]
    lines = _preview_lines(lattice, fixed) if preview else _coarse_lines(lattice, pin)
    step = min(lattice.pitch) / 2 * max(len(every) // len(kept) for every, kept in zip(lattice.node_lines, lines))
    along = row_axis(layer, start, direction)

    def pin_by_direction(net: Net, uv: Array) -> Constraints:
        return pin_constraints(layer, net, uv, row_axis(layer, uv[net.pin], direction))

    constrain = pin_by_direction
    if len(landmarks) > 1:
        targets = LandmarkTargets.of(surface, layer, lattice, landmarks)
        along, constrain = targets.heading(along, step), targets.constraints

    def guesses() -> Iterator[tuple[GridLines, Array]]:
        """Yield parameters of nodes from which to start, and the lines of these nodes."""
        if near is not None:
            before, pinned = _at_lines(near.uv, lines), tuple(k.index(p) for k, p in zip(lines, pin))
            if _is_along(layer, before, pinned, along):
                yield lines, before + (start - before[pinned])
        for level in (lines,) if preview else (lines, _even_lines(lattice)):
            flat = grid_net(level, lattice.step, pin).flat
            for n in GUESS_STEPS:
                yield level, unroll(layer, flat, start, along, n * step).reshape(*map(len, level), 2)

    def relaxed(level: GridLines, guess: Array) -> Array:
        """Return the parameters of nodes after a relaxation."""
        net, nodes = grid_net(level, lattice.step, pin), guess.reshape(-1, 2)
        weights: Array = net.stiffness.sum(axis=1)
        if trim:
            within = on_surface(layer, nodes)[net.meshes].any(axis=1)
            weights = net.stiffness @ np.maximum(within, OUTSIDE_WEIGHT)
        tolerance = DRAFT_STEP_TOLERANCE if preview else STEP_TOLERANCE
        return relax(layer, net, nodes, constrain(net, nodes), weights, tolerance).reshape(guess.shape)

    uv = _placed(layer, lattice, guesses(), relaxed, preview)
    if lines != lattice.node_lines and preview:
        uv = between(uv, *(spline_matrix(kept, every) for kept, every in zip(lines, lattice.node_lines)))
    inside = on_surface(layer, uv[1::2, 1::2]).ravel()
    if not trim or not inside.any():
        _check_inside(layer, lattice, uv)
    if not preview:
        check_folds(layer, lattice, uv, inside)
    return WrappedSheet(surface, offset, layer, lattice, uv, inside, lines if preview else lattice.node_lines)


def _preview_lines(lattice: SheetLattice, fixed: Sequence[tuple[int, int]]) -> GridLines:
    """Return the lines that a preview places: of a large sheet, some even ones and those of fixed nodes."""
    if np.prod(lattice.node_shape) <= MAX_EXACT_NODES:
        return lattice.node_lines
    rows, columns = (
        _some_lines(every, part, most) for every, part, most in zip(lattice.node_lines, zip(*fixed), PREVIEW_LINES)
    )
    return rows, columns


def _some_lines(every: Lines, fixed: Sequence[int], most: int) -> Lines:
    """Return the first, the last and the fixed lines of nodes, and even ones between them."""
    corners = sorted({0, *fixed, len(every) - 1})
    kept = {0}
    for start, stop in zip(corners, corners[1:]):
        steps = min(stop - start, int(np.ceil((stop - start) * (most - 1) / (len(every) - 1))))
        kept.update(np.rint(np.linspace(start, stop, steps + 1)).astype(int).tolist())
    return tuple(sorted(kept))


def _even_lines(lattice: SheetLattice, halvings: int = 0) -> GridLines:
    """Return lines at all nodes of a sheet, and more between them, so that meshes are nearly square."""
    rows, columns = (
        tuple((np.arange((n - 1) * k + 1) / k).tolist()) for n, k in zip(lattice.node_shape, _parts(lattice, halvings))
    )
    return rows, columns


def _parts(lattice: SheetLattice, halvings: int) -> tuple[int, int]:
    """Return into how many parts `_even_lines` divides the distance of two nodes, across the rows and along them."""
    steps = np.abs(lattice.step)
    rows, columns = (2**halvings * np.clip(np.rint(steps / steps.min()), 1, MAX_PARTS).astype(int)).tolist()
    return rows, columns


def _coarse_lines(lattice: SheetLattice, pin: tuple[int, int]) -> GridLines:
    """Return about every second of the lines of `_even_lines`: those of the centres of cells, the pin, and the ends."""
    rows, columns = (
        tuple(every[k] for k in sorted({0, part * at, len(every) - 1, *range(part % 2, len(every), 2)}))
        for every, part, at in zip(_even_lines(lattice), _parts(lattice, 0), pin)
    )
    return rows, columns


def _at_lines(uv: Array, lines: GridLines) -> Array:
    """Return the parameters of a placed sheet at lines of nodes; a sheet of another size is stretched to the same."""
    scaled = [np.array(kept) * ((n - 1) / kept[-1]) for n, kept in zip(uv.shape, lines)]
    sites = np.meshgrid(*scaled, indexing="ij")
    return np.stack([map_coordinates(uv[..., k], sites, order=1) for k in (0, 1)], axis=2)


def _is_along(layer: BSplineSurface, uv: Array, pin: tuple[Any, ...], along: Array) -> bool:
    """Return whether the row of a placed sheet at the pinned node has nearly the direction of a unit tangent."""
    i, j = pin
    before, after = layer.points(uv[i, [j - 1, j + 1]])
    return bool(unit((after - before)[None])[0] @ along > np.cos(MAX_START_TURN))


def _placed(
    layer: BSplineSurface,
    lattice: SheetLattice,
    guesses: Iterable[tuple[GridLines, Array]],
    relaxed: Callable[[GridLines, Array], Array],
    preview: bool,
) -> Array:
    """Return the nodes of least strain, shape (a, b, 2), from the first guess that leaves no cell turned over.

    A fold has no strain and stays. A preview keeps the nodes of its guess.
    """
    uv, problem = None, None
    for lines, guess in guesses:
        try:
            uv = relaxed(lines, guess)
            if preview:
                beyond = ~on_surface(layer, uv)
                turned = turned_meshes(lattice, uv) & ~beyond[1:, 1:] & ~beyond[:-1, :-1]
            else:
                uv = _converged(layer, lattice, lines, uv, relaxed)
                turned = _turned_cells(layer, lattice, uv)
        except InvalidPlan as error:
            problem = error
            continue
        if not turned.any():
            break
    if uv is None:
        assert problem is not None  # there is a guess
        raise problem
    return uv


def _converged(
    layer: BSplineSurface,
    lattice: SheetLattice,
    lines: GridLines,
    uv: Array,
    relaxed: Callable[[GridLines, Array], Array],
) -> Array:
    """Return the nodes of the cells after the relaxation of finer and finer nets, from the nodes at some lines."""
    found, moved = None, np.inf
    for halvings in count():
        finer, (a, b) = _even_lines(lattice, halvings), _parts(lattice, halvings)
        if found is not None and (moved <= MAX_HALVING_MOVE or len(finer[0]) * len(finer[1]) > MAX_NODES):
            return found
        guess = between(uv, *(spline_matrix(kept, every) for kept, every in zip(lines, finer)))
        try:
            uv, lines = relaxed(finer, guess), finer
        except InvalidPlan:
            if found is None:
                raise
            return found
        cells = uv[::a, ::b]
        if found is not None and _turned_cells(layer, lattice, cells).any():
            return found
        found = cells
        centres = [part[a :: 2 * a, b :: 2 * b].reshape(-1, 2) for part in (guess, uv)]
        ends = [layer.points(part[on_surface(layer, centres[1])]) for part in centres]
        moved = float(np.linalg.norm(ends[1] - ends[0], axis=1).max(initial=0.0))
    raise AssertionError  # the loop is endless


def _turned_cells(layer: BSplineSurface, lattice: SheetLattice, uv: Array) -> BoolArray:
    """Return which cells on the surface are turned over, shape (cells,)."""
    return turned_over(layer, lattice, uv) & on_surface(layer, uv[1::2, 1::2]).ravel()


def root_of(surface: BSplineSurface, origin: ArrayLike | None, name: str = "The origin") -> Array:
    """Return the parameters, shape (2,), of the surface point nearest to an origin."""
    if origin is None:
        return np.array(surface_centre(surface))
    return located(surface, np.asarray(origin, float)[None], [name])[0]


def root_near(surface: BSplineSurface, origin: ArrayLike | None, near: WrappedSheet) -> Array | None:
    """Return the same (2,), by a descent from a sheet on a similar surface; None where it ends away from the point."""
    point = surface.centre if origin is None else np.asarray(origin, float)
    if point is None:
        return None
    pin = near.lattice.node_shape
    pinned = near.uv[(pin[0] // 2, pin[1] // 2) if origin is None else (1, 1)]
    uv, distance = descend(surface, surface.wrap(pinned[None]), point[None])
    return surface.wrap(uv)[0] if distance[0] <= MAX_ROOT_DISTANCE * min(near.lattice.pitch) else None


def on_surface(surface: BSplineSurface, uv: Array) -> BoolArray:
    """Return whether parameters (..., 2) are within the edges of the surface."""
    return (surface.closed | (np.abs(uv - 0.5) <= 0.5 + PARAMETER_TOLERANCE)).all(axis=-1)


def _check_size(surface: BSplineSurface, pitch: tuple[float, float]) -> None:
    """Check that a cell is not larger than the bounding box of the control points."""
    size = float(np.linalg.norm(np.ptp(surface.control_net.reshape(-1, 3), axis=0)))
    if max(pitch) > size:
        raise InvalidPlan(
            f"a cell of {pitch[0] * 1e3:g} x {pitch[1] * 1e3:g} mm is larger than the whole surface, "
            f"{size * 1e3:.1f} mm. Use smaller cells, or check the unit of the mesh"
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
    """Return the distance of parameters (2,) beyond the farthest edge [m], and the name of the edge."""
    axis = int(np.argmax(np.where(surface.closed, 0.0, np.abs(uv - 0.5))))
    inner = uv.copy()
    inner[axis] = np.clip(uv[axis], 0, 1)
    gap = float(np.linalg.norm(np.diff(surface.points(np.stack((uv, inner))), axis=0)))
    return gap, f"{'uv'[axis]} = {inner[axis]:g}"
