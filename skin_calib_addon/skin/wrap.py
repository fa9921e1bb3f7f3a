"""Wrap a flat lattice on a surface with the least strain: a sheet bends, it does not stretch."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, IntArray, unit
from ..errors import InvalidPlan, OutsideSurface
from ..geometry.bspline import BSplineSurface
from ..geometry.distance import footpoints
from .equations import FIRM, LatticeEquations
from .geodesic import trace_both
from .lattice import SheetLattice

MOST_STEPS = 30
# A step that raises the sum of squares by more than this is taken back. Less is no sign of harm: the pulls are those of
# geodesics, the lengths those of cubics, and the rest of the one is not quite the least of the other.
RISE = 1.01
# A step that moves no node by more than this share of the pitch is the last.
SETTLED = 1e-4
# A first guess that lies beyond an edge by this share of the surface will not come back.
FAR = 0.5


@dataclass(frozen=True, eq=False)
class WrappedSheet:
    """A sheet on its surface: the parameters of its nodes, and the lengths between them on the surface."""

    surface: BSplineSurface
    lattice: SheetLattice
    uv: Array  # (a, b, 2) of the nodes; not wrapped round, so that they are continuous over a seam
    strain: Array  # (cells, 3) along the row, across the rows, shear


def wrap_sheet(
    surface: BSplineSurface, lattice: SheetLattice, origin: ArrayLike | None, direction: ArrayLike
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
        surface: as much is left free at one open edge as at the other.
    direction : array, shape (3,)
        Where the row of the origin runs to, in the link frame; its part in the surface counts.

    Raises
    ------
    InvalidPlan
        If the direction stands upright on the surface.
    OutsideSurface
        Names the first cell whose centre lies off the surface.
    """
    size = float(np.linalg.norm(np.ptp(surface.control_net.reshape(-1, 3), axis=0)))
    if max(lattice.pitch) > size:
        raise InvalidPlan(
            f"a cell of {lattice.pitch[0] * 1e3:g} x {lattice.pitch[1] * 1e3:g} mm is larger than the whole surface, "
            f"{size * 1e3:.1f} mm; the pitch is in metres"
        )
    if origin is None:
        pinned = (lattice.rows, lattice.columns)
        uv = centred(surface, lattice, pinned, direction)
    else:
        pinned = (1, 1)
        start = footpoints(surface, np.asarray(origin, float)[None])[0][0]
        uv = unroll(surface, lattice.node_shape, lattice.step, start, pinned, direction)
    check_inside(surface, lattice, uv, FAR)
    uv = relax(surface, lattice, uv, pinned, row_frame(surface, uv[pinned], direction)[1])
    check_inside(surface, lattice, uv)
    return WrappedSheet(surface, lattice, uv, cell_strain(surface, lattice, uv))


def row_frame(surface: BSplineSurface, uv: Array, direction: ArrayLike) -> tuple[Array, Array]:
    """Unit tangents at ``uv``: along the row, and towards the next row (normal x row)."""
    normal = surface.normals(uv[None])[0]
    wanted = np.asarray(direction, float)
    tangent = wanted - (wanted @ normal) * normal
    if np.linalg.norm(tangent) < 0.05 * np.linalg.norm(wanted) or not wanted.any():
        raise InvalidPlan(
            f'"direction" {wanted.tolist()} stands upright on the surface at the origin; give one along the rows'
        )
    return unit(tangent), np.cross(normal, unit(tangent))


def centred(surface: BSplineSurface, lattice: SheetLattice, pinned: tuple[int, int], direction: ArrayLike) -> Array:
    """Unroll from the middle of the surface, at a start moved until the open edges are left equally free."""
    start = np.array((0.5, 0.5))
    # Every second node, the pinned one among them: corners of cells where their number is even, else centres.
    shape = (lattice.rows + 1 - lattice.rows % 2, lattice.columns + 1 - lattice.columns % 2)
    middle = (shape[0] // 2, shape[1] // 2)
    for _ in range(2):
        uv = unroll(surface, shape, lattice.pitch, start, middle, direction).reshape(-1, 2)
        excess = (uv.min(axis=0) + uv.max(axis=0)) / 2 - 0.5
        start = np.clip(start - np.where(surface.closed, 0.0, excess), 0.05, 0.95)
    return unroll(surface, lattice.node_shape, lattice.step, start, pinned, direction)


def unroll(
    surface: BSplineSurface,
    shape: tuple[int, int],
    step: tuple[float, float],
    uv: Array,
    pinned: tuple[int, int],
    direction: ArrayLike,
) -> Array:
    """Geodesics for the lines of a flat lattice: along the pinned row, and leaving it at right angles.

    On a developable surface this is the isometric image of the lattice; elsewhere it is a first guess.

    Parameters
    ----------
    shape, step : pair
        Number of nodes across the rows and along them, and the distance between them [m].
    uv : array, shape (2,)
        Where the pinned node lies.
    pinned : pair of int
        Its row and column.

    Returns
    -------
    array, shape (*shape, 2)
        Parameters of the nodes.
    """
    along, _ = row_frame(surface, uv, direction)
    row, tangents = trace_both(surface, uv[None], along[None], step[1], pinned[1], shape[1])
    row, tangents = row[:, 0], tangents[:, 0]
    return trace_both(surface, row, np.cross(surface.normals(row), tangents), step[0], pinned[0], shape[0])[0]


def relax(surface: BSplineSurface, lattice: SheetLattice, uv: Array, pinned: tuple[int, int], across: Array) -> Array:
    """Newton's method on the parameters of the nodes until the strains have the least sum of squares.

    The pinned node stays, and the row through it keeps its direction there. A step that would raise the sum much is
    taken back, and the next one leaves the strains' own stiffness out (Gauss-Newton).

    Raises
    ------
    InvalidPlan
        If the surface is too sharply bent for the sheet to come to rest.
    """
    pairs, lengths = lattice_edges(lattice)
    pin = pinned[0] * lattice.node_shape[1] + pinned[1]
    system = LatticeEquations(lattice.node_shape, pairs, pin)
    x, best, least, full = uv.reshape(-1, 2), uv.reshape(-1, 2), np.inf, True
    # A geodesic turns on its way; between its points beside the pinned one it heads across itself by this much.
    ends = surface.points(x[[pin - 1, pin + 1]])
    turned = (ends[1] - ends[0]) @ across
    for _ in range(MOST_STEPS):
        r = surface.derivatives(x)
        points, basis = r[0, 0], np.stack((r[1, 0], r[0, 1]), axis=1)
        normals = unit(np.cross(r[1, 0], r[0, 1]))
        on_surface, pull = edge_lengths(points, normals, pairs)
        strain = on_surface / lengths - 1
        # The direction is held by a residual of its own: where the row through the pinned node heads across itself.
        heading = FIRM / lattice.step[1] * ((points[pin + 1] - points[pin - 1]) @ across - turned)
        energy = strain @ strain + heading**2
        if energy > RISE * least:
            x, full = (best + x) / 2, False
            continue
        best, least = x, min(energy, least)
        ends = basis[pairs]
        slopes = np.matmul(ends, pull[..., None])[..., 0] / lengths[:, None, None]
        sideways = np.matmul(ends, np.cross(normals[pairs], pull)[..., None])[..., 0] / lengths[:, None, None]
        turn_slopes = FIRM / lattice.step[1] * np.stack((-basis[pin - 1] @ across, basis[pin + 1] @ across))
        stretch = 1 - lengths / on_surface
        step = system.newton_step(slopes, sideways, stretch if full else None, strain, turn_slopes, heading)
        if step is None:  # compressed beyond what keeps it flat: without its own stiffness it has a way down
            full = False
            step = system.newton_step(slopes, sideways, None, strain, turn_slopes, heading)
        if step is None:
            raise InvalidPlan(
                "the sheet finds no rest on this surface, which is folded or too sharply bent under it; fit a smoother "
                "surface, or lay the sheet elsewhere"
            )
        x = x + step
        if np.linalg.norm(np.matmul(step[:, None], basis)[:, 0], axis=1).max() < SETTLED * min(lattice.pitch):
            break
    return x.reshape(uv.shape)


def lattice_edges(lattice: SheetLattice) -> tuple[IntArray, Array]:
    """Pairs of nodes along rows, across rows and over both diagonals, shape (e, 2), and their flat lengths [m]."""
    (a, b), (step_a, step_b) = lattice.node_shape, lattice.step
    node = np.arange(a * b).reshape(a, b)
    families = (
        (node[:, :-1], node[:, 1:], step_b),
        (node[:-1], node[1:], step_a),
        (node[:-1, :-1], node[1:, 1:], np.hypot(step_a, step_b)),
        (node[:-1, 1:], node[1:, :-1], np.hypot(step_a, step_b)),
    )
    pairs = [np.column_stack((start.ravel(), stop.ravel())) for start, stop, _ in families]
    return np.concatenate(pairs), np.repeat([f[2] for f in families], [len(p) for p in pairs])


def edge_lengths(points: Array, normals: Array, pairs: IntArray) -> tuple[Array, Array]:
    """Lengths on the surface between pairs of points, and how they change when an end moves.

    The chord is lengthened to the arc of the cubic that leaves and meets the surface at the ends' slopes: for slopes
    s and t it is longer by the share (2 s^2 - s t + 2 t^2) / 30.

    Returns
    -------
    lengths : array, shape (e,) [m]
    pull : array, shape (e, 2, 3)
        Gradient of each length with respect to its two ends.
    """
    chord = points[pairs[:, 1]] - points[pairs[:, 0]]
    length = np.linalg.norm(chord, axis=1)
    heading = chord / length[:, None]
    sines = np.einsum("ec,ekc->ek", heading, normals[pairs])
    s, t = np.arcsin(np.clip(sines, -1, 1)).T
    arcs = length * (1 + (2 * s * s - s * t + 2 * t * t) / 30)
    # The first variation of a geodesic's length: minus its tangent at the start, plus its tangent at the end.
    tangents = unit(heading[:, None] - sines[..., None] * normals[pairs])
    return arcs, tangents * np.array((-1.0, 1.0))[:, None]


def cell_strain(surface: BSplineSurface, lattice: SheetLattice, uv: Array) -> Array:
    """Strain of each cell along its row, across the rows, and in shear [rad], shape (cells, 3)."""
    r = surface.derivatives(uv.reshape(-1, 2))
    normals = unit(np.cross(r[1, 0], r[0, 1]))
    points, (_, b) = r[0, 0], lattice.node_shape
    i, j = (2 * lattice.index + 1).T
    centre = i * b + j

    def length(*offsets: int) -> Array:
        arms = [edge_lengths(points, normals, np.column_stack((centre, centre + o)))[0] for o in offsets]
        return np.sum(arms, axis=0)

    along, across = length(-1, 1), length(-b, b)
    rising, falling = length(-b - 1, b + 1), length(-b + 1, b - 1)
    shear = np.arcsin(np.clip((rising**2 - falling**2) / (4 * along * across), -1, 1))
    return np.column_stack((along / lattice.pitch[1] - 1, across / lattice.pitch[0] - 1, shear))


def check_inside(surface: BSplineSurface, lattice: SheetLattice, uv: Array, slack: float = 0.0) -> None:
    """Raise OutsideSurface for the first cell whose centre is beyond an open edge of the surface.

    Parameters
    ----------
    slack : float
        By how much a cell must be beyond, as a share of the surface, before any is named.
    """
    centres = uv[1::2, 1::2]
    for axis, what in ((0, "u"), (1, "v")):
        beyond = np.abs(centres[..., axis] - 0.5) - 0.5
        if surface.closed[axis] or beyond.max() <= slack + 1e-9:
            continue
        off = np.argwhere(beyond > 1e-9)
        if len(off):
            row, column = (int(k) for k in off[0])
            edge = float(np.clip(centres[row, column, axis], 0, 1))
            far = centres[row, column].copy()
            inner = far.copy()
            inner[axis] = edge
            gap = float(np.linalg.norm(np.diff(surface.points(np.stack((far, inner))), axis=0)))
            raise OutsideSurface(
                f"cell ({row}, {column}) lies {gap * 1e3:.1f} mm beyond the edge {what} = {edge:g} of the surface, the "
                f"first of {len(off)}; move the origin, turn the direction, or widen the grid",
                row=row,
                column=column,
                distance=gap,
            )
