"""Wrap a flat lattice on a surface with the least strain: a sheet bends, it does not stretch."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_array
from scipy.sparse.linalg import splu

from ..arrays import Array, IntArray, unit
from ..errors import InvalidPlan, OutsideSurface
from ..geometry.bspline import BSplineSurface
from ..geometry.distance import footpoints
from .lattice import SheetLattice

MOST_STEPS = 30
# A step that moves no node by more than this share of the pitch is the last.
SETTLED = 1e-7
# Weight of the sheet's direction beside the strains: it must hold, and the normal equations must stay solvable.
FIRM = 100.0


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
    if origin is None:
        pinned = (lattice.rows, lattice.columns)
        uv = centred(surface, lattice, pinned, direction)
    else:
        pinned = (1, 1)
        start = footpoints(surface, np.asarray(origin, float)[None])[0][0]
        uv = unroll(surface, lattice, start, pinned, direction)
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
    """Unroll from the middle of the surface, and move the start until the open edges are left equally free."""
    start = np.array((0.5, 0.5))
    for _ in range(3):
        uv = unroll(surface, lattice, start, pinned, direction)
        centres = uv[1::2, 1::2].reshape(-1, 2)
        excess = (centres.min(axis=0) + centres.max(axis=0)) / 2 - 0.5
        start = np.clip(start - np.where(surface.closed, 0.0, excess), 0.05, 0.95)
    return uv


def unroll(
    surface: BSplineSurface, lattice: SheetLattice, uv: Array, pinned: tuple[int, int], direction: ArrayLike
) -> Array:
    """First guess: a geodesic along the pinned row, and geodesics that leave it at right angles, shape (a, b, 2).

    On a developable surface these are the images of the lattice's lines, so the guess is the answer there.
    """
    (a, b), (step_a, step_b) = lattice.node_shape, lattice.step
    along, _ = row_frame(surface, uv, direction)
    nodes = np.empty((a, b, 2))
    row = nodes[pinned[0]]
    sides = np.empty((b, 3))
    for sign, reach in ((1, b - 1 - pinned[1]), (-1, pinned[1])):
        path, tangents = trace(surface, uv[None], sign * along[None], step_b, reach)
        where = pinned[1] + sign * np.arange(reach + 1)
        row[where] = path[:, 0]
        sides[where] = np.cross(surface.normals(path[:, 0]), sign * tangents[:, 0])
    for sign, reach in ((1, a - 1 - pinned[0]), (-1, pinned[0])):
        path, _ = trace(surface, row, sign * sides, step_a, reach)
        nodes[pinned[0] + sign * np.arange(reach + 1)] = path
    return nodes


def trace(surface: BSplineSurface, uv: Array, tangents: Array, step: float, count: int) -> tuple[Array, Array]:
    """Follow geodesics: ``count`` steps of ``step`` metres from each ``uv`` along its unit tangent (Runge-Kutta 4).

    Returns
    -------
    path : array, shape (count + 1, k, 2)
    tangents : array, shape (count + 1, k, 3)
    """
    r = surface.derivatives(uv)
    state = np.stack((uv, in_basis(r[1, 0], r[0, 1], tangents)), axis=1)
    states = [state]
    for _ in range(count):
        k1 = _geodesic_slope(surface, state)
        k2 = _geodesic_slope(surface, state + step / 2 * k1)
        k3 = _geodesic_slope(surface, state + step / 2 * k2)
        k4 = _geodesic_slope(surface, state + step * k3)
        state = state + step / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        states.append(state)
    path = np.stack(states)
    r = surface.derivatives(path[:, :, 0].reshape(-1, 2))
    speed = path[:, :, 1].reshape(-1, 2)
    tangents = unit(r[1, 0] * speed[:, :1] + r[0, 1] * speed[:, 1:])
    return path[:, :, 0], tangents.reshape(*path.shape[:2], 3)


def _geodesic_slope(surface: BSplineSurface, state: Array) -> Array:
    """Rate of parameters and of their speed on a geodesic: its acceleration has no part in the surface."""
    r = surface.derivatives(state[:, 0], order=2)
    du, dv = state[:, 1, :1], state[:, 1, 1:]
    bend = r[2, 0] * du**2 + 2 * r[1, 1] * du * dv + r[0, 2] * dv**2
    return np.stack((state[:, 1], -in_basis(r[1, 0], r[0, 1], bend)), axis=1)


def in_basis(a: Array, b: Array, vectors: Array) -> Array:
    """Components of the tangential part of vectors in the basis (a, b), shape (k, 2)."""
    aa, ab, bb = (a * a).sum(1), (a * b).sum(1), (b * b).sum(1)
    va, vb = (vectors * a).sum(1), (vectors * b).sum(1)
    return np.column_stack((bb * va - ab * vb, aa * vb - ab * va)) / (aa * bb - ab * ab)[:, None]


def relax(surface: BSplineSurface, lattice: SheetLattice, uv: Array, pinned: tuple[int, int], across: Array) -> Array:
    """Gauss-Newton on the parameters of the nodes until the strains have the least sum of squares.

    The pinned node stays, and the row through it keeps its direction there.
    """
    pairs, lengths = lattice_edges(lattice)
    b = lattice.node_shape[1]
    pin = pinned[0] * b + pinned[1]
    free = np.delete(np.arange(2 * uv[..., 0].size), (2 * pin, 2 * pin + 1))
    x = uv.reshape(-1, 2)
    for _ in range(MOST_STEPS):
        r = surface.derivatives(x)
        points, basis = r[0, 0], np.stack((r[1, 0], r[0, 1]), axis=1)
        on_surface, pull = edge_lengths(points, unit(np.cross(r[1, 0], r[0, 1])), pairs)
        rows = [(on_surface - lengths) / lengths]
        slopes = [np.einsum("ekc,ekdc->ekd", pull, basis[pairs]) / lengths[:, None, None]]
        turn = np.array(((pin - 1, pin + 1),))
        scale = FIRM / lattice.step[1]
        rows.append(scale * (points[turn[:, 1]] - points[turn[:, 0]]) @ across)
        slopes.append(scale * np.stack((-basis[turn[:, 0]] @ across, basis[turn[:, 1]] @ across), axis=1))
        step = _least_squares(np.concatenate(rows), np.concatenate(slopes), np.concatenate((pairs, turn)), len(x), free)
        x = x + step
        moved = np.einsum("kd,kdc->kc", step, basis)
        if np.linalg.norm(moved, axis=1).max() < SETTLED * min(lattice.pitch):
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


def _least_squares(residuals: Array, slopes: Array, pairs: IntArray, count: int, free: IntArray) -> Array:
    """Gauss-Newton step for residuals that each depend on two nodes; shape (count, 2)."""
    columns = (2 * pairs[:, :, None] + np.arange(2)).reshape(-1)
    starts = np.arange(0, len(columns) + 1, 4)
    jacobian = csr_array((slopes.reshape(-1), columns, starts), shape=(len(residuals), 2 * count))[:, free]
    step = np.zeros(2 * count)
    step[free] = splu((jacobian.T @ jacobian).tocsc()).solve(-(jacobian.T @ residuals))
    return step.reshape(-1, 2)


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


def check_inside(surface: BSplineSurface, lattice: SheetLattice, uv: Array) -> None:
    """Raise OutsideSurface for the first cell whose centre is beyond an open edge of the surface."""
    centres = uv[1::2, 1::2]
    for axis, what in ((0, "u"), (1, "v")):
        if surface.closed[axis]:
            continue
        off = np.argwhere((centres[..., axis] < -1e-9) | (centres[..., axis] > 1 + 1e-9))
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
