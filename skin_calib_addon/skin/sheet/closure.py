"""Gaps and overlaps of a sheet where it closes around the link, between the outlines of its cells."""

from dataclasses import dataclass

import numpy as np

from ...common.arrays import Array, BoolArray, IntArray, cross, unit
from ...geometry.surface.bspline import BSplineSurface
from ..lattice import CORNERS
from .folds import Meetings, meetings
from .relax import pair_lengths
from .wrap import WrappedSheet

# Smallest part of a full turn that a sheet covers if it closes around the link. Larger: no gaps for shorter sheets.
MIN_TURN = 0.5
# Segments of a shortest path on the surface. Larger: more exact around tight bends, and slower.
PATH_SEGMENTS = 8
# Gauss-Newton iterations of a shortest path. Larger: more exact on doubly curved surfaces, and slower.
PATH_ITERATIONS = 6
# Derived: weights of the first four points of a path in the derivative of the cubic through them at its start.
START_RATE = np.array((-11 / 6, 3, -3 / 2, 1 / 3))


@dataclass(frozen=True, eq=False)
class Closure:
    """Gaps of a sheet that closes around the link."""

    of: str  # "rows" or "columns": which of them end at the sheet itself, one turn later
    lines: IntArray  # (k,) numbers of these rows or columns
    gaps: Array  # (k,) shortest distance on the surface from the end of each to the sheet one turn later; minus the
    # length by which it is on the sheet where they overlap [m]
    steps: Array  # (k,) offset of the beginning from the end, towards the next row or column [m]
    place: Array  # (3,) a point of the largest overlap, or the end with the smallest gap [m], link frame

    @property
    def overlap(self) -> float:
        """Largest overlap [m]; zero without one."""
        return max(-float(self.gaps.min()), 0.0)

    @property
    def worst_line(self) -> str:
        """Name of the row or column with the largest overlap, or the smallest gap."""
        return f"{self.of[:-1]} {self.lines[self.gaps.argmin()]}"


def closure(sheet: WrappedSheet) -> Closure | None:
    r"""Return the gaps of a sheet around the link; None if it covers less than half of a turn.

    The sheet one turn later is the same sheet: where it ends at itself is measured between outlines of cells, on the
    surface. A gap is a shortest distance. An overlap is the length by which a row (or column) must be shortened: with
    the flat position x of a node on its row from a to b, and its position x' on the row from a' to b' that it meets,

    .. math:: (b - x) + (x' - a') \quad [m]

    Rows or columns are selected: the ones that lose the smaller fraction of their length in an overlap, else the ones
    whose ends are nearer to the sheet on average.
    """
    lattice, layer = sheet.lattice, sheet.layer
    inside = sheet.inside.reshape(lattice.rows, lattice.columns)
    around = lattice.at_cells(sheet.uv[..., 1], CORNERS)[sheet.inside]
    if not layer.closed[1] or np.ptp(around) < MIN_TURN:
        return None
    met = meetings(sheet.uv, layer, inside, (-1, 1))
    both = [_of_lines(sheet, inside, met, axis) for axis in (1, 0)]
    lengths = [lattice.columns * lattice.pitch[1], lattice.rows * lattice.pitch[0]]
    overlaps = [found.overlap for found in both]
    if min(overlaps) > 0:
        return both[int(np.argmin(np.divide(overlaps, lengths)))]
    return both[int(np.argmin([found.gaps.mean() for found in both]))]


def _of_lines(sheet: WrappedSheet, inside: BoolArray, met: Meetings, axis: int) -> Closure:
    """Return the gaps of the rows (axis 1) or columns (axis 0)."""
    lattice, layer = sheet.lattice, sheet.layer
    uv, present = (sheet.uv, inside) if axis else (sheet.uv.transpose(1, 0, 2), inside.T)
    lines = np.flatnonzero(present.any(axis=1))
    first = present.argmax(axis=1)
    last = present.shape[1] - 1 - present[:, ::-1].argmax(axis=1)
    half = lattice.pitch[axis] / 2
    overlap = np.zeros(len(present))
    if len(met.node):
        node, other = (part if axis else part[:, ::-1] for part in (met.node, met.other))
        rows = [np.clip(part[:, 0].astype(np.int64) // 2, 0, len(present) - 1) for part in (node, other)]
        starts, ends = 2.0 * first, 2.0 * last + 2
        ahead = (ends[rows[0]] - node[:, 1]) + (other[:, 1] - starts[rows[1]])
        behind = (ends[rows[1]] - other[:, 1]) + (node[:, 1] - starts[rows[0]])
        depth = half * np.clip(np.minimum(ahead, behind), 0, None)
        for row in rows:
            np.maximum.at(overlap, row, depth)
        deepest = node[depth.argmax()].astype(np.int64)
    gaps = -overlap[lines]
    free = lines[gaps == 0]
    if len(free):
        gaps[gaps == 0] = _distances(layer, uv, present, free, last)
    turn = np.copysign(1.0, (uv[2 * lines + 1, 2 * last[lines] + 2] - uv[2 * lines + 1, 2 * first[lines]])[:, 1].sum())
    start, end = uv[2 * lines + 1, 2 * last[lines] + 2], uv[2 * lines + 1, 2 * first[lines]] + (0.0, turn)
    worst = uv[tuple(deepest)] if overlap.any() else start[gaps.argmin()]
    length, heading, up = shortest_paths(layer, start, end)
    ahead = -shortest_paths(layer, start, uv[2 * lines + 1, 2 * last[lines] + 1])[1]
    hand = np.sign(lattice.step[0]) * (1 if axis else -1)
    steps = hand * length * (heading * cross(up, ahead)).sum(axis=1)
    return Closure("rows" if axis else "columns", lines, gaps, steps, layer.points(worst[None])[0])


def _distances(layer: BSplineSurface, uv: Array, present: BoolArray, lines: IntArray, last: IntArray) -> Array:
    """Return the shortest distance from the last side of each line to the outline of the sheet one turn later [m]."""
    outline, before, after = _outline(present)
    places = uv[tuple(outline.T)]
    ends = np.stack([uv[2 * lines + part, 2 * last[lines] + 2] for part in (0, 1, 2)], axis=1)  # (k, 3, 2)
    there = np.concatenate([places + (0.0, turn) for turn in (-1.0, 1.0)])
    before, after = (np.concatenate((part, part + len(places))) for part in (before, after))
    nearest = np.array([_estimates(layer, side[1], there).argmin() for side in ends], np.int64)
    trio = there[np.stack((before[nearest], nearest, after[nearest]), axis=1)]
    start, stop = (part.reshape(-1, 2) for part in np.broadcast_arrays(ends[:, :, None], trio[:, None]))
    apart = shortest_paths(layer, start, stop)[0].reshape(len(lines), 3, 3)
    return np.minimum(
        _to_segments(apart, _steps(layer, trio)).min(axis=(1, 2)),
        _to_segments(apart.transpose(0, 2, 1), _steps(layer, ends)).min(axis=(1, 2)),
    )


def _outline(present: BoolArray) -> tuple[IntArray, IntArray, IntArray]:
    """Return the nodes on the outline of cells, shape (n, 2), and the numbers of the nodes before and after each."""
    quarters = np.pad(np.repeat(np.repeat(present, 2, axis=0), 2, axis=1), 1)
    edges = []
    # The sides of each quarter, with the quarter on their left: their ends, and the adjacent quarter beyond them.
    for start, stop, beyond in (
        ((0, 0), (0, 1), (-1, 0)),
        ((0, 1), (1, 1), (0, 1)),
        ((1, 1), (1, 0), (1, 0)),
        ((1, 0), (0, 0), (0, -1)),
    ):
        corner = np.argwhere(quarters & ~np.roll(quarters, (-beyond[0], -beyond[1]), axis=(0, 1))) - 1
        edges.append(np.stack((corner + start, corner + stop), axis=1))
    joined = np.concatenate(edges)
    nodes, number = np.unique(joined.reshape(-1, 2), axis=0, return_inverse=True)
    number = number.reshape(-1, 2)
    before, after = np.zeros(len(nodes), np.int64), np.zeros(len(nodes), np.int64)
    after[number[:, 0]], before[number[:, 1]] = number[:, 1], number[:, 0]
    return nodes, before, after


def _estimates(layer: BSplineSurface, start: Array, ends: Array) -> Array:
    """Return the lengths of the straight paths in the parameters from a start (2,) to ends (n, 2) [m]."""
    fractions = np.linspace(0, 1, PATH_SEGMENTS + 1)[:, None, None]
    path = layer.points((start + fractions * (ends - start)).reshape(-1, 2)).reshape(len(fractions), -1, 3)
    return np.linalg.norm(np.diff(path, axis=0), axis=2).sum(axis=0)


def _steps(layer: BSplineSurface, uv: Array) -> Array:
    """Return the lengths of the two segments between three nodes (k, 3, 2), shape (k, 2) [m]."""
    r = layer.derivatives(uv.reshape(-1, 2))
    row = 3 * np.arange(len(uv))[:, None] + (0, 1)
    pairs = np.stack((row, row + 1), axis=2).reshape(-1, 2)
    return pair_lengths(r[0, 0], unit(cross(r[1, 0], r[0, 1])), pairs)[0].reshape(-1, 2)


def _to_segments(apart: Array, lengths: Array) -> Array:
    r"""Return the distances from points to segments, from those to the ends of the segments (law of cosines).

    .. math:: d^2(t) = d_0^2 + t\,(d_1^2 - d_0^2 - l^2) + t^2 l^2, \quad 0 \le t \le 1 \quad [m^2]
    """
    near, far, squared = apart[..., :-1] ** 2, apart[..., 1:] ** 2, lengths[:, None] ** 2
    slope = far - near - squared
    t = np.clip(-slope / (2 * squared), 0, 1)
    return np.sqrt(np.maximum(near + t * slope + t**2 * squared, 0))


def shortest_paths(layer: BSplineSurface, start: Array, end: Array) -> tuple[Array, Array, Array]:
    r"""Return the shortest paths on a surface near the straight ones in the parameters (Gauss-Newton).

    .. math:: \min \sum_i |p_{i+1} - p_i|^2 \quad [m^2]

    over the points p of the path between its ends; the minimum has equal segments on a geodesic.
    """
    count, inner = len(start), PATH_SEGMENTS - 1
    fractions = np.linspace(0, 1, PATH_SEGMENTS + 1)[:, None]
    uv = start[:, None] + fractions * (end - start)[:, None]
    for _ in range(PATH_ITERATIONS):
        r = layer.derivatives(uv.reshape(-1, 2)).reshape(2, 2, count, PATH_SEGMENTS + 1, 3)
        basis = np.stack((r[1, 0], r[0, 1]), axis=2)[:, 1:-1]  # (k, inner, 2, 3)
        bend = np.diff(r[0, 0], n=2, axis=1)
        matrix = np.zeros((count, inner, 2, inner, 2))
        diagonal = np.arange(inner)
        matrix[:, diagonal, :, diagonal] = 2 * np.einsum("kiac,kibc->ikab", basis, basis)
        adjacent = -np.einsum("kiac,kibc->ikab", basis[:, :-1], basis[:, 1:])
        matrix[:, diagonal[:-1], :, diagonal[1:]] = adjacent
        matrix[:, diagonal[1:], :, diagonal[:-1]] = adjacent.transpose(0, 1, 3, 2)
        right = np.einsum("kiac,kic->kia", basis, bend).reshape(count, -1, 1)
        step = np.linalg.solve(matrix.reshape(count, 2 * inner, 2 * inner), right)
        uv[:, 1:-1] += step.reshape(count, inner, 2)
    r = layer.derivatives(uv.reshape(-1, 2))
    points, normals = r[0, 0], unit(cross(r[1, 0], r[0, 1]))
    row = np.arange(len(points)).reshape(count, -1)
    pairs = np.stack((row[:, :-1], row[:, 1:]), axis=2).reshape(-1, 2)
    different = np.linalg.norm(points[pairs[:, 1]] - points[pairs[:, 0]], axis=1) > 0
    lengths = np.zeros(len(pairs))
    lengths[different] = pair_lengths(points, normals, pairs[different])[0]
    rate = np.tensordot(START_RATE, uv[:, : len(START_RATE)], axes=(0, 1))
    heading = unit(r[1, 0, row[:, 0]] * rate[:, :1] + r[0, 1, row[:, 0]] * rate[:, 1:])
    return lengths.reshape(count, -1).sum(axis=1), heading, normals[row[:, 0]]
