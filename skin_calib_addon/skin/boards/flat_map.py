"""A flat map of a surface: the development of a tube or a patch in the plane, as isometric as possible."""

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_array
from scipy.sparse.linalg import splu
from scipy.spatial import cKDTree

from ...common.arrays import Array, IntArray, pairs_of, unit
from ...geometry.fit.surface_fit import SurfaceFit
from ...geometry.surface.bspline import MIN_LENGTH, BSplineSurface, basis_functions, greville
from ..lattice import ROUNDING
from ..sheet.constraints import row_axis

# [1] Most parts of the domain of the map along each parameter. More: more exact for small boards, slower. It acts on
# surfaces of more than 20 pitches; boards of 16 mm on two of six links of the G1 move with half.
MAX_NODES = 40
# [1] Iterations of the development. The last step is 0.03 mm on the largest surface of six links of the G1, and less
# than 2 micrometres on most. Fewer: boards are missed (163 instead of 176 with half); more: slower.
ITERATIONS = 200
# [1] Weight of the parts of the surface without a mesh; they extrapolate. Larger: they distort the rest (boards move by
# 0.1 mm with half or double).
UNTRUSTED_WEIGHT = 1e-3
# [1] Newton steps from the nearest node to a flat position. Fewer: a micrometre off; more: no effect but time.
INVERSE_ITERATIONS = 4


@dataclass(frozen=True, eq=False)
class FlatMap:
    """A map from parameters of a surface to the plane.

    The start is at zero. The x axis is the direction of the rows there. A closed surface is cut open opposite of the
    start, and continues on both sides of the cut.
    """

    surface: BSplineSurface
    start: Array  # (2,) parameters of the zero of the plane
    flat: BSplineSurface  # flat position of each parameter [m]; its third coordinate is zero

    @cached_property
    def domain(self) -> Array:
        """Least and largest parameters of the map, shape (2, 2)."""
        return np.array([(s.starts[0], s.starts[-1] + s.lengths[-1]) for s in self.flat.spans]).T

    @cached_property
    def _nodes(self) -> tuple[Array, cKDTree]:
        uv = pairs_of(*(greville(k, d) for k, d in zip((self.flat.knots_u, self.flat.knots_v), self.flat.degree)))
        return uv, cKDTree(self(uv))

    def __call__(self, uv: Array) -> Array:
        """Return the flat positions, shape (k, 2) [m], of parameters (k, 2)."""
        return self.flat.points(uv)[:, :2]

    def slopes(self, uv: Array) -> Array:
        """Return the derivatives of x and y (rows) by u and v (columns), shape (k, 2, 2) [m]."""
        r = self.flat.derivatives(uv)
        return np.stack((r[1, 0, :, :2], r[0, 1, :, :2]), axis=-1)

    def inverse(self, flat: Array) -> tuple[Array, Array]:
        """Return the parameters (k, 2) of flat positions (k, 2) [m], and how far positions are off the map (k,) [m]."""
        nodes, tree = self._nodes
        uv = nodes[tree.query(flat)[1]]
        for _ in range(INVERSE_ITERATIONS):
            uv = np.clip(uv + _solved(self.slopes(uv), flat - self(uv)), *self.domain)
        return uv, np.linalg.norm(flat - self(uv), axis=1)

    def directions(self, uv: Array, angles: ArrayLike) -> Array:
        """Return unit tangents (k, 3) of the surface at parameters (k, 2), along directions of the flat map [rad]."""
        steps = _solved(self.slopes(uv), np.stack((np.cos(angles), np.sin(angles)), axis=-1))
        r = self.surface.derivatives(uv)
        return unit(steps[:, :1] * r[1, 0] + steps[:, 1:] * r[0, 1])

    def angles(self, uv: Array, tangents: Array) -> Array:
        """Return the directions in the flat map of tangents (k, 3) at parameters (k, 2), shape (k,) [rad]."""
        x, y = (self.slopes(uv) @ steps_along(self.surface, uv, tangents)[..., None])[..., 0].T
        return np.arctan2(y, x)


def steps_along(surface: BSplineSurface, uv: Array, arms: Array) -> Array:
    """Return the steps of parameters (n, 2) that move their points most nearly by arms (n, 3) [m], shape (n, 2)."""
    r = surface.derivatives(uv)
    slopes = np.stack((r[1, 0], r[0, 1]), axis=1)
    return _solved(slopes @ slopes.swapaxes(1, 2), (slopes @ arms[..., None])[..., 0])


def _solved(slopes: Array, right: Array) -> Array:
    """Return the solutions (k, 2) of linear systems (k, 2, 2); zero where the map has no area."""
    (a, b), (c, d) = np.moveaxis(slopes, 0, 2)
    x, y = right[..., 0], right[..., 1]
    area = a * d - b * c
    area = np.where(np.abs(area) > MIN_LENGTH**2, area, np.inf)
    return np.column_stack(((d * x - b * y) / area, (a * y - c * x) / area))


def flat_map(
    surface: BSplineSurface,
    start: Array,
    direction: ArrayLike | None,
    fit: SurfaceFit | None,
    spacing: float,
    over: float,
) -> FlatMap:
    r"""Develop a surface in the plane (Liu et al., A local/global approach to mesh parameterization, 2008).

    .. math:: \min_{f, R} \sum_t A_t \lVert \nabla f_t - R_t \rVert^2 \quad [m^2]

    The triangles t, two for each diagonal, with the area A [m^2], have the lengths of arcs on the surface, and R are
    rotations. The minimum is zero on a plane, a cylinder and a cone. On a cylinder an arc is exact:

    .. math:: a^2 = c^2 + h^2\,(q^2 - \sin^2 q) / \sin^4 q \quad [m^2]

    with the chord c, its height h along the normals [m], and the angle 2 q between the normals.
    """
    along = row_axis(surface, start, surface.derivatives(start[None])[0, 1, 0] if direction is None else direction)
    ends = 0.0, 1.0
    if surface.closed[1]:
        pad = min(over / lengths_of(surface)[1], 0.5)
        ends = start[1] - 0.5 - pad, start[1] + 0.5 + pad
    net, *knots = _developed_net(surface, fit, spacing, *ends)
    free = FlatMap(surface, start, BSplineSurface(net, knots[0], knots[1], surface.degree))
    r = surface.derivatives(start[None])
    # The rotation that maps the direction at the start to the x axis.
    step = np.linalg.lstsq(np.column_stack((r[1, 0, 0], r[0, 1, 0])), along, rcond=None)[0]
    x, y = free.slopes(start[None])[0] @ step
    turn = np.array(((x, -y, 0), (y, x, 0), (0, 0, 0))) / np.hypot(x, y)
    net = (net - free.flat.points(start[None])[0]) @ turn
    return FlatMap(surface, start, BSplineSurface(net, knots[0], knots[1], surface.degree))


@lru_cache(maxsize=1)  # on an open surface a list of boards has the map of the search before, rotated and shifted
def _developed_net(
    surface: BSplineSurface, fit: SurfaceFit | None, spacing: float, low: float, high: float
) -> tuple[Array, Array, Array]:
    """Return the control points (n, m, 3) [m] and both knot vectors of the map between two parameters v."""
    lengths = lengths_of(surface)
    knots = [
        _knots(surface.spans[k].starts, ends, surface.degree[k], spacing / lengths[k])
        for k, ends in enumerate(((0.0, 1.0), (low, high)))
    ]
    u, v = (greville(knot, degree) for knot, degree in zip(knots, surface.degree))
    uv = pairs_of(u, v)
    triangles = _triangles(len(u), len(v))
    weights = np.ones(len(triangles))
    if fit is not None:
        weights[~fit.is_trusted(surface.wrap(uv[triangles].mean(axis=1)))] = UNTRUSTED_WEIGHT
    flat = _developed(surface.points(uv), surface.normals(uv), triangles, weights, uv * lengths)
    # A spline with the knots of the surface: exact on a plane.
    net = np.append(flat, np.zeros((len(flat), 1)), axis=1).reshape(len(u), len(v), 3)
    for axis, sites in enumerate((u, v)):
        basis = basis_functions(sites, knots[axis], surface.degree[axis])
        rows = np.moveaxis(net, axis, 0)
        net = np.moveaxis(np.linalg.solve(basis, rows.reshape(len(sites), -1)).reshape(rows.shape), 0, axis)
    return net, knots[0], knots[1]


def _knots(starts: Array, ends: tuple[float, float], degree: int, spacing: float) -> Array:
    """Return clamped knots over a domain: those of a spline with period one, and even ones between them."""
    periods = np.arange(np.floor(ends[0]), np.ceil(ends[1]) + 1)
    inner = (periods[:, None] + starts).ravel()
    inner = inner[(inner > ends[0] + ROUNDING) & (inner < ends[1] - ROUNDING)]
    breaks = np.concatenate((ends[:1], inner, ends[1:]))
    # A whole number of steps is not where the rounding changes.
    steps = np.diff(breaks) / max(spacing, (ends[1] - ends[0]) / MAX_NODES)
    parts = np.maximum(np.ceil(steps - 0.3), 1).astype(int)
    between = [a + np.arange(n) / n * (b - a) for a, b, n in zip(breaks, breaks[1:], parts)]
    return np.concatenate((np.full(degree, ends[0]), *between, np.full(degree + 1, ends[1])))


def lengths_of(surface: BSplineSurface) -> Array:
    """Return the greatest lengths of lines along u and along v, shape (2,) [m]."""
    grid = surface.grid_points(np.linspace(0, 1, MAX_NODES), np.linspace(0, 1, MAX_NODES))
    return np.array([np.linalg.norm(np.diff(grid, axis=k), axis=2).sum(axis=k).max() for k in (0, 1)])


def _triangles(rows: int, columns: int) -> IntArray:
    """Return the triangles of the nodes of a grid, for both diagonals, counter-clockwise, shape (t, 3)."""
    node = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = (part.ravel() for part in (node[:-1, :-1], node[1:, :-1], node[1:, 1:], node[:-1, 1:]))
    return np.concatenate([np.column_stack(corners) for corners in ((a, b, c), (a, c, d), (a, b, d), (b, c, d))])


def _developed(points: Array, normals: Array, triangles: IntArray, weights: Array, guess: Array) -> Array:
    """Return the flat positions of nodes, shape (n, 2) [m]; complex numbers are the points of the plane."""
    one, two, three = triangles.T

    def arc(i: IntArray, j: IntArray) -> Array:
        """Return lengths of arcs: chord, height along the normals, and half of the angle between the normals."""
        chord = points[j] - points[i]
        height = ((chord * normals[i]).sum(axis=1) ** 2 + (chord * normals[j]).sum(axis=1) ** 2) / 2
        q = np.arcsin(np.clip(np.linalg.norm(normals[j] - normals[i], axis=1) / 2, 0, 1))
        q = np.maximum(q, np.sqrt(ROUNDING))  # below, the fraction is a third
        return np.sqrt(
            np.maximum((chord**2).sum(axis=1), MIN_LENGTH**2) + height * (q**2 - np.sin(q) ** 2) / np.sin(q) ** 4
        )

    a, b, c = arc(one, two), arc(two, three), arc(three, one)
    x = (a**2 + c**2 - b**2) / (2 * a)
    y = np.sqrt(np.maximum(c**2 - x**2, MIN_LENGTH * a))
    area = weights * a * y / 2
    row, size = np.arange(len(triangles)), (len(triangles), len(points))
    by_x = np.column_stack((-1 / a, 1 / a, 0 * a))
    by_y = np.column_stack(((x / a - 1) / y, -x / a / y, 1 / y))
    # The gradients have no part that a shift could change; the first node stays at zero.
    dx, dy = (csr_array((g.ravel(), (np.repeat(row, 3), triangles.ravel())), size)[:, 1:] for g in (by_x, by_y))
    weighted = [(d * area[:, None]).T.tocsr() for d in (dx, dy)]
    solve = splu((weighted[0] @ dx + weighted[1] @ dy).tocsc()).solve
    flat = (guess @ (1, 1j))[1:]
    for _ in range(ITERATIONS):
        rotation = dx @ flat - 1j * (dy @ flat)
        rotation /= np.maximum(np.abs(rotation), MIN_LENGTH)
        right = weighted[0] @ rotation + weighted[1] @ (1j * rotation)
        flat = solve(np.column_stack((right.real, right.imag))) @ (1, 1j)
    flat = np.append(0, flat)
    return np.column_stack((flat.real, flat.imag))
