r"""Footpoints: nearest points of a surface, by descents from all cells of the surface that can contain them.

Two triangles approximate each cell. With the sides :math:`h_u` and :math:`h_v` of the cell in the parameters, the
distance between the surface and its triangles is at most

.. math::

    \delta = \tfrac{1}{8} \left( h_u^2 \max |\mathbf{S}_{uu}| + 2 h_u h_v \max |\mathbf{S}_{uv}|
    + h_v^2 \max |\mathbf{S}_{vv}| \right) \quad [\text{m}] .

A cell can contain a nearer point only if the distance to its triangles, less this, is below the distance found so far.
"""

from dataclasses import dataclass
from functools import cache, lru_cache
from math import comb

import numpy as np
from scipy.spatial import cKDTree

from ...common.arrays import Array, BoolArray, IntArray, cross, norms, ranges, unit
from ..mesh.distance import closest, closest_on_triangles, dots
from ..mesh.triangle_mesh import TriangleMesh
from .bspline import BSplineSurface

# [1] cells into which a surface is divided. Larger: tighter bounds and so fewer descents, more time for the table. The
# footpoints stay the same.
CELLS = 6000
# [1] largest deviation of a cell from its triangles, as a fraction of its side. Smaller: more cells where it bends.
MAX_CELL_DEVIATION = 0.05
# [1] most cells along a span, so that a surface with one sharp bend does not fill the memory.
MAX_CELLS_PER_SPAN = 200
# [1] distance in cells up to which a cell, if it bends little, belongs to the minimum of a footpoint. Larger: fewer
# descents; a second minimum so close can be missed, which costs at most twice the ``delta`` of its cell.
SAME_MINIMUM = 1.5
# [1] most iterations of a descent. Larger: no effect, because descents end before.
MAX_ITERATIONS = 30
# [1] difference of two parameters below which they are equal: a descent ends, a point is on an edge, a constraint is
# met. Larger: less accurate footpoints.
PARAMETER_TOLERANCE = 1e-10
# [1] pivots of the exact Hessian, as a fraction of those of Gauss-Newton, below which the latter are used. Larger:
# slower convergence far from the surface.
MIN_CURVATURE = 0.05
# [1] damping after the first rejected step; each further one divides by it. It affects the time only.
FIRST_DAMPING = 0.1
# [1] points that are searched at a time. Larger: more memory.
BLOCK_POINTS = 2048
TINY = np.finfo(float).tiny  # in denominators


def footpoints(surface: BSplineSurface, points: Array) -> tuple[Array, Array]:
    r"""Return the nearest surface point of each point.

    Each descent is Newton's method on the squared distance to a point :math:`\mathbf{p}`, with
    :math:`\mathbf{g} = \mathbf{p} - \mathbf{S}`:

    .. math::

        \begin{pmatrix} \mathbf{S}_u \cdot \mathbf{S}_u - \mathbf{g} \cdot \mathbf{S}_{uu} &
        \mathbf{S}_u \cdot \mathbf{S}_v - \mathbf{g} \cdot \mathbf{S}_{uv} \\
        \mathbf{S}_u \cdot \mathbf{S}_v - \mathbf{g} \cdot \mathbf{S}_{uv} &
        \mathbf{S}_v \cdot \mathbf{S}_v - \mathbf{g} \cdot \mathbf{S}_{vv} \end{pmatrix}
        \begin{pmatrix} \delta u \\ \delta v \end{pmatrix} =
        \begin{pmatrix} \mathbf{S}_u \cdot \mathbf{g} \\ \mathbf{S}_v \cdot \mathbf{g} \end{pmatrix}
    """
    points = np.asarray(points, float).reshape(-1, 3)
    search = _search_of(surface)
    uv, distance = np.empty((len(points), 2)), np.empty(len(points))
    for i in range(0, len(points), BLOCK_POINTS):
        block = slice(i, i + BLOCK_POINTS)
        uv[block], distance[block] = search.nearest(points[block])
    return _with_edges(surface, uv), distance


def near_footpoints(surface: BSplineSurface, points: Array) -> tuple[Array, Array, Array]:
    r"""Return nearly the footpoints (k, 2) of points (k, 3), distances (k,) [m] and normals (k, 3), without descents.

    Of the nearest triangle, the foot has the parameters, and the plane that touches the surface there gives the
    distance. It is within :math:`2 \delta` of the exact one, and much closer near the surface.
    """
    search = _search_of(surface)
    flat, face, feet = closest(search.mesh, points)
    uv = _with_edges(surface, search.parameters(face, feet))
    r = surface.derivatives(uv)
    normals, delta = unit(cross(r[1, 0], r[0, 1])), search.delta[face // 2]
    return uv, np.clip(np.abs(dots(points - r[0, 0], normals)), flat - delta, flat + delta), normals


def _with_edges(surface: BSplineSurface, uv: Array) -> Array:
    """Return parameters (k, 2) that are exactly 0 or 1 on an open edge, so that callers can recognize it."""
    for axis in (0, 1):
        if not surface.closed[axis]:
            x = uv[:, axis]
            uv[:, axis] = np.where(x < PARAMETER_TOLERANCE, 0.0, np.where(x > 1 - PARAMETER_TOLERANCE, 1.0, x))
    return surface.wrap(uv)


@dataclass(frozen=True, eq=False)
class _Cells:
    """Cells of a surface that compete for points; row i of every array is one of them."""

    row: IntArray  # which point
    cell: IntArray
    bound: Array  # no point of the cell is nearer [m]
    uv: Array  # (k, 2) where a descent starts

    def __getitem__(self, chosen: BoolArray | IntArray) -> "_Cells":
        return _Cells(self.row[chosen], self.cell[chosen], self.bound[chosen], self.uv[chosen])


class _Search:
    """The cells of a surface, and trees of their centres."""

    def __init__(self, surface: BSplineSurface):
        self.surface = surface
        bounds = _second_derivatives(surface)
        ends, span = _cell_ends(surface, bounds)
        corners, steps = surface.grid_points(*ends), (np.diff(ends[0])[:, None], np.diff(ends[1]))
        bends = bounds[:, span[0]][:, :, span[1]]
        delta = (steps[0] ** 2 * bends[0] + 2 * steps[0] * steps[1] * bends[1] + steps[1] ** 2 * bends[2]) / 8
        a, b, c, d = corners[:-1, :-1], corners[1:, :-1], corners[1:, 1:], corners[:-1, 1:]
        centres = (a + b + c + d) / 4
        radius = np.max([np.linalg.norm(corner - centres, axis=2) for corner in (a, b, c, d)], axis=0)
        self.delta, self.centres, self.radius = delta.ravel(), centres.reshape(-1, 3), (radius + delta).ravel()
        self.is_bent = self.delta > 2 * MAX_CELL_DEVIATION * self.radius  # of a diameter
        rows, columns = delta.shape
        a = (np.arange(rows)[:, None] * (columns + 1) + np.arange(columns)).ravel()
        b, c, d = a + columns + 1, a + columns + 2, a + 1
        self.mesh = TriangleMesh(corners.reshape(-1, 3), np.stack((a, b, c, a, c, d), axis=1).reshape(-1, 3))
        self.start = np.stack(np.broadcast_arrays(ends[0][:-1, None], ends[1][:-1]), 2).reshape(-1, 2)
        self.step = np.stack(np.broadcast_arrays(*steps), 2).reshape(-1, 2)
        self.tree = cKDTree(self.centres)

    def nearest(self, points: Array) -> tuple[Array, Array]:
        """Return the footpoints (k, 2) of points (k, 3), and their distances (k,) [m]."""
        _, face, feet = closest(self.mesh, points)
        uv, distance = descend(self.surface, self.parameters(face, feet), points)
        rivals = self._rivals(points, uv, distance)
        while len(rivals.row):
            best = np.append(True, rivals.row[1:] != rivals.row[:-1])  # one of each point, with the least bound
            chosen, rivals = rivals[best], rivals[~best]
            found, length = descend(self.surface, chosen.uv, points[chosen.row])
            better = length < distance[chosen.row]
            uv[chosen.row[better]], distance[chosen.row[better]] = found[better], length[better]
            for own in (found, chosen.uv):
                around = np.full_like(uv, np.inf)
                around[chosen.row] = own
                rivals = rivals[self._is_apart(rivals.cell, around[rivals.row])]
            rivals = rivals[rivals.bound < distance[rivals.row]]
        return uv, distance

    def _rivals(self, points: Array, uv: Array, distance: Array) -> _Cells:
        """Return the cells away from the footpoints that may contain a nearer point, sorted by point and bound."""
        near = self.tree.query_ball_point(points, distance + self.radius.max(), return_sorted=False)
        row = np.repeat(np.arange(len(points)), [len(cells) for cells in near])
        cell = np.concatenate([np.asarray(cells, np.int64) for cells in near])
        kept = self._is_apart(cell, uv[row])
        row, cell = row[kept], cell[kept]
        kept = np.linalg.norm(points[row] - self.centres[cell], axis=1) - self.radius[cell] < distance[row]
        cells = self._at_triangles(row[kept], cell[kept], points)
        cells = cells[cells.bound < distance[cells.row]]
        return cells[np.lexsort((cells.bound, cells.row))]

    def _is_apart(self, cell: IntArray, uv: Array) -> BoolArray:
        """Return whether cells are more than `SAME_MINIMUM` away from parameters (k, 2), or bend too much to decide."""
        gap = np.abs(self.start[cell] + self.step[cell] / 2 - uv)
        for axis in (0, 1):
            if self.surface.closed[axis]:
                gap[:, axis] = np.minimum(gap[:, axis], np.abs(1 - gap[:, axis]))
        return self.is_bent[cell] | (gap > SAME_MINIMUM * self.step[cell]).any(axis=1)

    def _at_triangles(self, row: IntArray, cell: IntArray, points: Array) -> _Cells:
        """Return where descents start, at the nearest points of the triangles of cells, and the bound of each cell."""
        target = np.repeat(points[row], 2, axis=0)
        feet = closest_on_triangles(target, self.mesh.triangles.reshape(-1, 2, 3, 3)[cell].reshape(-1, 3, 3))
        distance = norms(feet - target).reshape(-1, 2)
        which, all_rows = distance.argmin(axis=1), np.arange(len(cell))
        uv = self.parameters(2 * cell + which, feet.reshape(-1, 2, 3)[all_rows, which])
        return _Cells(row, cell, distance[all_rows, which] - self.delta[cell], uv)

    def parameters(self, face: IntArray, feet: Array) -> Array:
        """Return the parameters (k, 2) of points (k, 3) on triangles (k,)."""
        corners = self.mesh.triangles[face]
        one, two, arm = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0], feet - corners[:, 0]
        aa, ab, bb, pa, pb = dots(one, one), dots(one, two), dots(two, two), dots(arm, one), dots(arm, two)
        area = np.maximum(aa * bb - ab**2, TINY)
        x, y = (pa * bb - pb * ab) / area, (pb * aa - pa * ab) / area
        # corners a, b, c of the first triangle are at (0, 0), (1, 0), (1, 1) of the cell; of the second a, c, d
        is_first = face % 2 == 0
        fraction = np.stack((np.where(is_first, x + y, x), np.where(is_first, y, x + y)), axis=1)
        return self.start[face // 2] + self.step[face // 2] * np.clip(fraction, 0, 1)


@lru_cache(maxsize=8)
def _search_of(surface: BSplineSurface) -> _Search:
    return _Search(surface)


def _cell_ends(surface: BSplineSurface, bends: Array) -> tuple[tuple[Array, Array], tuple[IntArray, IntArray]]:
    """Return the ends of the cells in each direction (c + 1,), and the span of each cell (c,).

    Cells are about as long as wide, and shorter where the surface bends: ``bends`` are its second derivatives.
    """
    knots = [np.append(s.starts, s.starts[-1] + s.lengths[-1]) for s in surface.spans]
    corners = surface.grid_points(*knots)
    sides = [np.linalg.norm(np.diff(corners, axis=axis), axis=2).max(axis=1 - axis) for axis in (0, 1)]
    size = np.sqrt(sides[0].sum() * sides[1].sum() / CELLS)
    bend = [bends[2 * axis].max(axis=1 - axis) * surface.spans[axis].lengths ** 2 / 8 for axis in (0, 1)]
    ends, span = [], []
    for axis in (0, 1):
        count = np.ceil(np.maximum(sides[axis] / size, np.sqrt(bend[axis] / (MAX_CELL_DEVIATION * size)))).astype(int)
        count = np.clip(count, 1, MAX_CELLS_PER_SPAN)
        span.append(np.repeat(np.arange(len(count)), count))
        within = ranges(0, count)
        s = surface.spans[axis]
        ends.append(
            np.append(s.starts[span[axis]] + s.lengths[span[axis]] * within / count[span[axis]], knots[axis][-1])
        )
    return (ends[0], ends[1]), (span[0], span[1])


def _second_derivatives(surface: BSplineSurface) -> Array:
    """Return bounds of the lengths of S_uu, S_uv and S_vv on each pair of spans, shape (3, s_u, s_v) [m].

    A polynomial lies in the convex hull of its Bernstein coefficients.
    """
    powers = max(surface.degree) + 1
    patches = surface.patches.reshape(*surface.patches.shape[:2], powers, powers, 3)
    k = np.arange(1, powers)
    by_u = patches[:, :, 1:] * k[:, None, None]
    by_v = patches[:, :, :, 1:] * k[:, None]
    second = (by_u[:, :, 1:] * k[:-1, None, None], by_u[:, :, :, 1:] * k[:, None], by_v[:, :, :, 1:] * k[:-1, None])
    bounds = []
    for part in second:
        to_u, to_v = (_to_bernstein(s.lengths, n) for s, n in zip(surface.spans, part.shape[2:4]))
        rows = to_u[:, None] @ part.reshape(*part.shape[:3], -1)
        net = to_v[:, None] @ rows.reshape(*rows.shape[:3], *part.shape[3:])
        bounds.append(np.linalg.norm(net, axis=4).max(axis=(2, 3)))
    return np.array(bounds)


def _to_bernstein(lengths: Array, count: int) -> Array:
    """Return matrices (s, count, count) from coefficients of powers on [0, length] to Bernstein coefficients."""
    return _power_fractions(count) * lengths[:, None, None] ** np.arange(count)


@cache
def _power_fractions(count: int) -> Array:
    """Return the Bernstein coefficients (count, count) of each power on [0, 1], one power in each column."""
    return np.array([[comb(j, i) / comb(count - 1, i) for i in range(count)] for j in range(count)])


def descend(surface: BSplineSurface, uv: Array, points: Array) -> tuple[Array, Array]:
    """Apply Newton's method to the squared distance; a step that does not lower it is damped and repeated."""
    uv = uv.copy()
    r = surface.derivatives(uv, 2)
    best = ((points - r[0, 0]) ** 2).sum(axis=1)
    moving, damping = np.arange(len(points)), np.zeros(len(points))
    for _ in range(MAX_ITERATIONS):
        if len(moving) == 0:
            break
        before, target = uv[moving], points[moving]
        after = before + _newton_step(surface, before, target - r[0, 0], r, damping)
        for axis in (0, 1):
            if not surface.closed[axis]:
                after[:, axis] = np.clip(after[:, axis], 0, 1)
        there = surface.derivatives(after, 2)
        square = ((target - there[0, 0]) ** 2).sum(axis=1)
        better = square < best[moving]
        uv[moving[better]], best[moving[better]] = after[better], square[better]
        damping = np.where(better, 0.0, np.maximum(damping / FIRST_DAMPING, FIRST_DAMPING))
        open_ = np.abs(after - before).max(axis=1) > PARAMETER_TOLERANCE
        r = np.where(better[:, None], there, r)[:, :, open_]
        moving, damping = moving[open_], damping[open_]
    return uv, np.sqrt(best)


def _newton_step(surface: BSplineSurface, uv: Array, gap: Array, r: Array, damping: Array) -> Array:
    """Return steps (k, 2) of the parameters; at an open edge those that would leave it run along it."""
    a, b = r[1, 0], r[0, 1]
    slope = np.stack(((gap * a).sum(axis=1), (gap * b).sum(axis=1)))
    flat = np.stack(((a * a).sum(axis=1), (a * b).sum(axis=1), (b * b).sum(axis=1)))
    bent = flat - np.stack([(gap * second).sum(axis=1) for second in (r[2, 0], r[1, 1], r[0, 2])])
    is_convex = (bent[0] > MIN_CURVATURE * flat[0]) & (
        bent[0] * bent[2] - bent[1] ** 2 > MIN_CURVATURE**2 * flat[0] * flat[2]
    )
    uu, uw, ww = np.where(is_convex, bent, flat)
    uu, ww = uu + damping * flat[0] + TINY, ww + damping * flat[2] + TINY
    leaves = np.zeros((2, len(uv)), bool)
    for axis in (0, 1):
        if not surface.closed[axis]:
            x = uv[:, axis]
            leaves[axis] = ((x <= 0) & (slope[axis] < 0)) | ((x >= 1) & (slope[axis] > 0))
    determinant = np.maximum(uu * ww - uw**2, TINY)
    step_u = np.where(leaves[1], slope[0] / uu, (ww * slope[0] - uw * slope[1]) / determinant)
    step_v = np.where(leaves[0], slope[1] / ww, (uu * slope[1] - uw * slope[0]) / determinant)
    return np.where(leaves, 0.0, np.stack((step_u, step_v))).T
