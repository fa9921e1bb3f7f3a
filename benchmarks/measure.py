"""How far surfaces of all makes are from the mesh and from the truth, and how long a fit takes."""

from collections.abc import Callable
from dataclasses import dataclass
from statistics import median
from time import perf_counter

import numpy as np
from links import Array, Fan, Link
from samples import holes
from scipy.interpolate import BSpline

from skin_calib_addon.geometry.surface.distance import MeshDistance

# Cells in which every surface is measured; primes, so as to be out of step with its knots and with the facets.
ROWS, COLUMNS = 37, 151
FAR = 10.0  # a surface that goes this many times the mesh's size away from it is no surface of it
LONG = 0.5  # [s] a run that takes longer is not repeated
BUDGET = 0.15  # [s] after which a median is taken of the runs made so far


@dataclass(frozen=True, eq=False)
class Surface:
    """A surface of any make over (u, v) in [0, 1] x [0, 1]."""

    points: Callable[[Array, Array], Array]  # u (k,), v (l,) to (k, l, 3) [m]
    control_points: int  # different ones: a repeated column counts once
    note: str = ""


@dataclass(frozen=True)
class Deviation:
    """Area-weighted mean and largest distance [mm]; of the truth NaN where it is not known."""

    mean: float
    max: float
    truth_mean: float = np.nan
    truth_max: float = np.nan


def tensor(net: Array, knots_u: Array, knots_v: Array, degree: tuple[int, int], scale: float = 1.0) -> Callable:
    """Points of a tensor-product B-spline over the unit square, whatever its knots run over."""

    def points(u: Array, v: Array) -> Array:
        rows = BSpline(knots_u, net, degree[0])(on_domain(u, knots_u, degree[0]))
        columns = BSpline(knots_v, rows.swapaxes(0, 1), degree[1])(on_domain(v, knots_v, degree[1]))
        return scale * columns.swapaxes(0, 1)

    return points


def on_domain(u: Array, knots: Array, degree: int) -> Array:
    """Parameters in [0, 1] as parameters between the knots."""
    first, last = knots[degree], knots[len(knots) - degree - 1]
    return first + u * (last - first)


class Judge:
    """Measures surfaces of one link over one region."""

    def __init__(self, link: Link, fan: Fan | None = None):
        self.link, self.fan = link, fan or link.fan
        self.distance = MeshDistance(link.mesh)
        self.holes = holes(link, self.fan)

    def __call__(self, surface: Surface) -> Deviation:
        """Deviation of a surface; ValueError if it is none."""
        points, areas = cells(surface, self.link)
        covered = ~self.over_hole(points)
        mesh = statistics(self.distance(points[covered])[0], areas[covered])
        truth = statistics(self.link.truth(points), areas) if self.link.truth else (np.nan, np.nan)
        return Deviation(*mesh, *truth)

    def over_hole(self, points: Array) -> Array:
        """Which points lie where the mesh has a hole, seen from the axis: they are not measured against its rim."""
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
    """Middles (k, 3) [m] and areas (k,) of even cells of a surface's parameters.

    Raises
    ------
    ValueError
        If it is no surface of this link.
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
    """Mean and largest distance to the true surface [mm], in holes too."""
    points, areas = cells(surface, link)
    return statistics(link.truth(points), areas)


def statistics(distances: Array, areas: Array) -> tuple[float, float]:
    """Area-weighted mean and maximum, metres to millimetres."""
    return float(1e3 * (areas @ distances) / areas.sum()), float(1e3 * distances.max())


def timed(function: Callable, repeats: int):
    """Result of a function and the median of its times [ms].

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
