"""The distance of every surface from the mesh and from the truth, and the time of a fit."""

from collections.abc import Callable
from dataclasses import dataclass
from statistics import median
from time import perf_counter

import numpy as np
from links import Array, Fan, Link
from samples import holes
from scipy.interpolate import BSpline

from skin_calib_addon.geometry.mesh.distance import closest

# Cells in which every surface is measured; prime numbers do not align with its knots or with the facets.
ROWS, COLUMNS = 37, 151
FAR = 10.0  # a surface that is further from the mesh than this many times its size has failed
LONG = 1.0  # [s] a first run that takes longer is not repeated
BUDGET = 0.15  # [s] after which the median of the runs so far is taken


@dataclass(frozen=True)
class Row:
    """One method on one link at one size; distances [mm]."""

    link: str
    method: str
    variant: str
    n: int
    m: float
    control_points: int
    mean: float
    max: float
    truth_mean: float
    truth_max: float
    milliseconds: float  # median of warm calls
    cold_milliseconds: float  # first call in a fresh process
    note: str

    @property
    def failed(self) -> bool:
        """Whether there is no surface."""
        return not np.isfinite(self.mean)


@dataclass(frozen=True, eq=False)
class Surface:
    """A surface of any method over (u, v) in [0, 1] x [0, 1]."""

    points: Callable[[Array, Array], Array]  # u (k,), v (l,) to (k, l, 3) [m]
    control_points: int  # without repetitions: a repeated column counts once
    note: str = ""


@dataclass(frozen=True)
class Deviation:
    """Area-weighted mean and maximum of the distance [mm]; NaN for a truth that is not known."""

    mean: float
    max: float
    truth_mean: float = np.nan
    truth_max: float = np.nan


def tensor(net: Array, knots_u: Array, knots_v: Array, degree: tuple[int, int], scale: float = 1.0) -> Callable:
    """Return a function for points of a tensor-product B-spline over the unit square, for knots over any interval."""

    def points(u: Array, v: Array) -> Array:
        rows = BSpline(knots_u, net, degree[0])(on_domain(u, knots_u, degree[0]))
        columns = BSpline(knots_v, rows.swapaxes(0, 1), degree[1])(on_domain(v, knots_v, degree[1]))
        return scale * columns.swapaxes(0, 1)

    return points


def on_domain(u: Array, knots: Array, degree: int) -> Array:
    """Map parameters in [0, 1] to the interval of the knots."""
    first, last = knots[degree], knots[len(knots) - degree - 1]
    return first + u * (last - first)


class Judge:
    """Measures surfaces of one link over one region."""

    def __init__(self, link: Link, fan: Fan | None = None):
        self.link, self.fan = link, fan or link.fan
        self.holes = holes(link, self.fan)

    def __call__(self, surface: Surface) -> Deviation:
        """Return the deviation of a surface; raise ValueError if it is not finite or far away."""
        points, areas = cells(surface, self.link)
        covered = ~self.over_hole(points)
        mesh = statistics(closest(self.link.mesh, points[covered])[0], areas[covered])
        truth = statistics(self.link.truth(points), areas) if self.link.truth else (np.nan, np.nan)
        return Deviation(*mesh, *truth)

    def over_hole(self, points: Array) -> Array:
        """Return which points are over a hole of the mesh, seen from the axis: they are not compared with its rim."""
        if not self.holes.any() or self.fan.tilt:
            return np.zeros(len(points), bool)
        rows, columns = self.holes.shape
        arms = points - self.fan.first
        length = np.linalg.norm(self.fan.last - self.fan.first)
        row = np.clip(arms @ self.fan.e3 / length, 0, 1) * (rows - 1)
        angle = np.arctan2(arms @ self.fan.e2, arms @ self.fan.e1) % (2 * np.pi) / self.fan.turn
        column = np.clip(angle, 0, 1) * (columns if self.fan.closed else columns - 1)
        near = [
            self.holes[i(row).astype(int), j(column).astype(int) % columns]
            for i in (np.floor, np.ceil)
            for j in (np.floor, np.ceil)
        ]
        return np.logical_or.reduce(near)


def cells(surface: Surface, link: Link) -> tuple[Array, Array]:
    """Return the centres (k, 3) [m] and areas (k,) of cells of even size in a surface's parameters.

    Raises
    ------
    ValueError
        If the surface is not finite, or far from the link.
    """
    grid = surface.points(np.linspace(0, 1, 2 * ROWS + 1), np.linspace(0, 1, 2 * COLUMNS + 1))
    if not np.isfinite(grid).all():
        raise ValueError("the surface is not finite")
    corners, middles = grid[::2, ::2], grid[1::2, 1::2].reshape(-1, 3)
    away = np.linalg.norm(middles - link.mesh.vertices.mean(axis=0), axis=1).max()
    if away > FAR * link.mesh.size:
        raise ValueError(f"the surface runs {away * 1e3:.0f} mm away from the mesh")
    diagonals = corners[1:, 1:] - corners[:-1, :-1], corners[1:, :-1] - corners[:-1, 1:]
    return middles, np.linalg.norm(np.cross(*diagonals), axis=2).ravel() / 2


def from_truth(link: Link, surface: Surface) -> tuple[float, float]:
    """Return mean and maximum of the distance to the true surface [mm], also over holes."""
    points, areas = cells(surface, link)
    return statistics(link.truth(points), areas)


def statistics(distances: Array, areas: Array) -> tuple[float, float]:
    """Return area-weighted mean and maximum, converted from metres to millimetres."""
    return float(1e3 * (areas @ distances) / areas.sum()), float(1e3 * distances.max())


def timed(function: Callable, repeats: int):
    """Return the result of a function and the median of its warm times [ms].

    The first run, which fills caches, is not counted, unless it takes so long that it is the only one.
    """
    start = perf_counter()
    result = function()
    times: list[float] = []
    first = perf_counter() - start
    if first > LONG:
        return result, 1e3 * first
    while len(times) < repeats and sum(times) < BUDGET:
        start = perf_counter()
        result = function()
        times.append(perf_counter() - start)
    return result, 1e3 * median(times)
