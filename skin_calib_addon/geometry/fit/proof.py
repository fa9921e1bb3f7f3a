"""Confirm that a surface is within a tolerance: bounds of its distances, made exact only where necessary."""

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from ...common.arrays import Array, IntArray, pairs_of
from ..mesh.closest import MeshDistance
from ..surface.bspline import BSplineSurface
from ..surface.distance import SAMPLES_PER_SPAN, sample_lines, surface_samples
from .error_report import largest_of

if TYPE_CHECKING:
    from .surface_fit import SurfaceFit

MIN_DISTANCE = 1e-300  # [m] lower bound of a distance in a denominator or a logarithm
# [1] exact distances that the first round computes. Larger: a better estimate of the other distances, more time.
FIRST_BATCH = 256
# [1] cells with the largest distances in which the maximum is searched. Larger: a safer maximum, more time.
PEAK_CELLS = 400
# [fraction of the largest distance] that is added to it: a peak over an edge of a facet may be between the points.
# Larger: safer, larger nets.
PEAK_MARGIN = 0.02
PEAK_ROUNDS = 3  # [1] rounds of this search, in smaller and smaller cells. Larger: a more exact maximum
PEAK_POINTS = 5  # [1] points of a cell, per direction, from edge to edge. Larger: a safer maximum, more time


def confirmed_error(
    bounds: Array, areas: Array, exact: Callable[[IntArray], Array], measure: str, tolerance: float
) -> float:
    """Return the mean or largest distance: an upper bound if it is within the tolerance, else an estimate [m].

    The bounds of the distances are replaced by exact distances, first for a sample of all sizes, then from the largest
    bound on. This stops when the tolerance is confirmed. It also stops when the other distances would have to be
    smaller, relative to their bounds, than those of the sample.
    """
    if len(bounds) == 0:
        return np.inf
    weights = areas / areas.sum()

    def statistic(distances: Array) -> float:
        return float((weights * distances).sum() if measure == "mean" else distances.max())

    bounds, order = bounds.copy(), np.argsort(-bounds, kind="stable")
    first = np.isinf(bounds[order])
    first[:: max(len(bounds) // FIRST_BATCH, 1)] = True  # of all sizes, to estimate the ratio of distances to bounds
    order, batch, done = np.concatenate((order[first], order[~first])), int(first.sum()), 0
    error, shrunk = statistic(bounds), 1.0
    while error > tolerance and done < len(order):
        chosen = order[done : done + batch]
        before = bounds[chosen]
        bounds[chosen] = exact(chosen)
        if done == 0:
            finite = np.isfinite(before)
            shrunk = bounds[chosen][finite].sum() / max(before[finite].sum(), MIN_DISTANCE)
        done, batch, error = done + len(chosen), 2 * batch, statistic(bounds)
        likely = bounds.copy()
        likely[order[done:]] *= shrunk
        if statistic(likely) > tolerance:
            return statistic(likely)
    return error


def largest_distance(fit: "SurfaceFit", distance: MeshDistance) -> float:
    """Return the largest distance of a surface from the mesh [m], edges included and holes left out.

    The distance is computed at the samples of the error report and on the edges. Those cells around the
    largest distances that can have a larger one are then searched on finer grids, and 2 % are added.
    """
    surface = fit.surface
    u, v = sample_lines(surface, SAMPLES_PER_SPAN)
    width = np.array((0.5 / len(u), 0.5 / len(v)))
    edges = [np.column_stack((np.full(len(v), edge), v)) for edge in (0.0, 1.0)]
    if not surface.closed[1]:
        edges += [np.column_stack((u, np.full(len(u), edge))) for edge in (0.0, 1.0)]
    inner, _ = surface_samples(surface)
    inner = inner[fit.is_trusted(inner)]
    points, bounds, _ = fit.bounds()
    found = np.full(len(points), np.nan)

    def exact(chosen: IntArray) -> Array:
        found[chosen] = distance(points[chosen])[0]
        return found[chosen]

    largest = largest_of(bounds, exact, FIRST_BATCH)[0]
    known = np.flatnonzero(~np.isnan(found))
    uv, distances = [inner[known]], [found[known]]
    centres = np.concatenate(edges)
    for _ in range(PEAK_ROUNDS + 1):
        centres = centres[fit.is_trusted(centres)]
        uv, distances = [*uv, centres], [*distances, distance(surface.points(centres))[0]]
        around, found = np.concatenate(uv), np.concatenate(distances)
        if len(around) == 0:
            return np.inf
        peaks = np.argsort(-found, kind="stable")[:PEAK_CELLS]
        largest = max(largest, float(found.max()))
        uv, distances = [around[peaks]], [found[peaks]]
        # Two points differ by no more in their distances from the mesh than the distance between them.
        r = surface.derivatives(around[peaks])
        sides = np.linalg.norm((r[1, 0], r[0, 1]), axis=2)
        peaks = peaks[found[peaks] + width @ sides > largest]
        centres = cells_around(surface, around[peaks], width)
        width = width / (PEAK_POINTS - 1)  # up to the middle between two points
    return (1 + PEAK_MARGIN) * largest


def cells_around(surface: BSplineSurface, peaks: Array, width: Array) -> Array:
    """Return a grid of parameters in a cell around each of some parameters, within the domain."""
    step = np.linspace(-1, 1, PEAK_POINTS)
    offsets = pairs_of(step, step) * width
    uv = (peaks[:, None] + offsets).reshape(-1, 2)
    for axis in (0, 1):
        uv[:, axis] = uv[:, axis] % 1.0 if surface.closed[axis] else np.clip(uv[:, axis], 0, 1)
    return uv
