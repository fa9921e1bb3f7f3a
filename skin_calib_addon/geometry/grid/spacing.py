"""Where planes and lines go: at the positions of which splines through sampled heights have the least error."""

from functools import lru_cache

import numpy as np

from ...common.arrays import Array, locked
from ..mesh.triangle_mesh import TriangleMesh
from ..sampling.basis import check_counts
from ..sampling.rays import TURN
from ..surface.bspline import clamped_knots, greville
from .heights import Heights, sampled_heights
from .parametrizations import Parametrization, ParametrizedLines, parametrized_lines, region_centre

# [1] The density of lines is this power of the curvature. Larger: more lines at corners, fewer in flat parts.
CURVATURE_EXPONENT = 0.35
# [rad] rotation of an outline in one step below which it is straight, because noise of a nanometre rotates it, too.
# Larger: lines do not follow slight curvature.
FLAT_TURN = 1e-5
# [fraction of the mean] lower bound of the curvature; below, it is rounding. Larger: more lines in flat parts.
MIN_CURVATURE_FRACTION = 1e-3
# [steps of an outline] width of the average of the curvature, because the edges of facets have curvature too. Larger:
# corners get fewer lines.
SMOOTHING_WIDTH = 2.3
# [1] The length of a span is divided by this power of its mean square error. The mean square error of a cubic is
# proportional to the ninth power of the length. Larger: stronger changes of the spans.
ERROR_EXPONENT = 0.11
EQUALIZING_ROUNDS = 3  # [1] iterations that equalize the errors of all spans. Larger: little effect, more time
MAX_MOVES = 8  # [1] most steps of the positions. Larger: slightly less error, more time
# [1] ratio of errors, or of their squares, above which there is no gain: even positions are kept, and the steps have
# converged. Larger: noise moves lines, more steps.
MAX_ERROR_RATIO = 0.95
# [fraction of the mean interval] below which no interval is shortened, because lines at equal positions are redundant.
# Larger: more even lines.
MIN_INTERVAL = 0.1
INITIAL_DAMPING = 0.01  # [1] damping of the first Gauss-Newton step. Larger: shorter first steps
DAMPING_DECREASE = 4.0  # [1] divisor of the damping after a step with less error. Larger: longer steps, more failures
DAMPING_INCREASE = 6.0  # [1] factor of the damping after a step with more error. Larger: shorter steps, fewer failures

# A spacing is a piecewise linear map from the fraction of the intervals before a position, 0 to 1, to the position.
SpacingMap = tuple[Array, Array]


def spaced_lines(
    mesh: TriangleMesh,
    parametrization: Parametrization,
    size: tuple[int, int],
    degree: tuple[int, int],
    spacing: str = "auto",
    moves: int = MAX_MOVES,
) -> ParametrizedLines:
    """Return the lines of a number of planes with a number of lines each."""
    check_counts(size[0], degree[0], "u-planes")
    check_counts(size[1], degree[1], "v-lines")
    s = even_positions(parametrization.span, size[0], False)
    t = even_positions(parametrization.breadth, size[1], parametrization.closed)
    if spacing != "uniform":
        along, across = sampled_heights(mesh, parametrization)
        if spacing == "auto":
            s = best_positions(along, size[0], degree[0], moves)
            t = best_positions(across, size[1], degree[1], moves)
        else:
            t = np.interp(even_positions((0.0, 1.0), size[1], across.closed), *density_map(across, spacing))
    return parametrized_lines(parametrization, s, t, region_centre(mesh, parametrization))


def even_positions(edges: tuple[float, float], count: int, closed: bool) -> Array:
    """Return positions at even steps, of a full turn from the first edge on, or from edge to edge."""
    first, last = edges
    return first + (last - first) * (np.arange(count) / count) if closed else np.linspace(first, last, count)


def even_map(heights: Heights) -> SpacingMap:
    """Return the map to even positions."""
    return np.array((0.0, 1.0)), np.array(heights.edges)


@lru_cache(maxsize=64)
def density_map(heights: Heights, spacing: str) -> SpacingMap:
    r"""Return the spacing whose density is the arc length, or a power of the curvature, of the mean curve.

    With the length :math:`\ell` [m] of a step and the curvature :math:`\kappa` [1/m], the curvature density is
    :math:`\kappa^{0.35}\, \ell`.
    """
    closed = heights.closed
    at, values = (heights.at[:-1], heights.values[:, :-1]) if closed else (heights.at, heights.values)
    points = values * np.exp(1j * at) if heights.polar else at + 1j * values
    step = np.roll(points, -1, axis=1) - points
    length = np.abs(step)
    heading = step / np.maximum(length, 1e-300)
    turn = np.abs(heading - np.roll(heading, 1, axis=1))
    turn[turn < FLAT_TURN] = 0.0
    length = (length + np.roll(length, 1, axis=1)) / 2
    if not closed:  # the ends have a neighbour on one side only
        turn[:, [0, -1]], length[:, [0, -1]] = turn[:, [1, -2]], length[:, [1, -2]]
    density = length
    if spacing == "curvature":
        # Average by a periodic convolution.
        window = np.exp(-0.5 * (TURN * np.fft.rfftfreq(len(at)) * SMOOTHING_WIDTH) ** 2)
        turn, length = (np.fft.irfft(np.fft.rfft(x) * window, len(at)) for x in (turn, length))
        curvature = np.abs(turn) / length
        density = np.maximum(curvature, MIN_CURVATURE_FRACTION * curvature.mean()) ** CURVATURE_EXPONENT * length
    mean = density.mean(axis=0)
    mean = np.append(mean, mean[0]) if closed else mean
    fraction = np.append(0.0, np.cumsum((mean[1:] + mean[:-1]) / 2))
    return (fraction / fraction[-1], heights.at) if fraction[-1] > 0 else even_map(heights)  # a plane has no curvature


@lru_cache(maxsize=64)  # lines do not depend on the number of planes
def best_positions(heights: Heights, count: int, degree: int, moves: int = MAX_MOVES) -> Array:
    """Return positions of planes or lines with little error, or even ones if these are nearly as good.

    The search starts at even spans and at spans that follow the curvature, of closed curves also half a span further,
    and at spans with equal errors. From each start, or from the best one if not all moves are wanted, it moves the
    positions one by one.
    """
    if not heights.predicts:
        return locked(even_positions(heights.edges, count, heights.closed))
    spans = np.arange(count) / count if heights.closed else greville(clamped_knots(count, degree), degree)
    maps = [even_map(heights), density_map(heights, "curvature")]
    shifts = (0.0, 0.5 / count) if heights.closed else (0.0,)
    starts = [np.interp(spans + shift, *spacing) for shift in shifts for spacing in maps]
    errors = [heights.error(start, degree) for start in starts]
    even, before = starts[0], errors[0]
    spacing = maps[int(np.argmin(errors[:2]))]
    for _ in range(EQUALIZING_ROUNDS):
        spacing = equalized(spacing, heights.span_errors(np.interp(spans, *spacing), degree), heights.closed)
    starts.append(np.interp(spans, *spacing))
    errors.append(heights.error(starts[-1], degree))
    if moves and not heights.bends:
        if moves < MAX_MOVES:
            starts = [starts[int(np.argmin(errors))]]
        starts = [refined(heights, start, degree, moves) for start in starts]
        errors = [heights.error(start, degree) for start in starts]
    least = int(np.argmin(errors))
    rounding = float(np.finfo(np.float32).eps * np.abs(heights.values).mean())  # of vertices in mesh files
    return locked(starts[least] if errors[least] < MAX_ERROR_RATIO * before - rounding else even)


def equalized(spacing: SpacingMap, energy: Array, closed: bool) -> SpacingMap:
    """Return a map with shorter spans where one has more error: ``energy`` is the mean square error of each."""
    if not energy.any():
        return spacing
    energy = energy / energy.mean()
    padded = np.concatenate((energy[-1:], energy, energy[:1])) if closed else np.pad(energy, 1, mode="edge")
    weight = np.maximum((padded[:-2] + 2 * energy + padded[2:]) ** ERROR_EXPONENT, MIN_INTERVAL)
    cumulative = np.append(0.0, np.cumsum(weight))
    return cumulative / cumulative[-1], np.interp(np.linspace(0, 1, len(energy) + 1), *spacing)


def refined(heights: Heights, positions: Array, degree: int, moves: int) -> Array:
    r"""Move positions one by one to less error, by Gauss-Newton steps with Marquardt's damping.

    .. math::

        \delta x = -(J^{T} J + \mu\, \overline{d}\, I)^{-1} J^{T} e, \qquad
        \overline{d} = \operatorname{tr}(J^{T} J) / m
    """
    free = slice(None) if heights.closed else slice(1, -1)
    residuals, change = heights.residual_slopes(positions, degree)
    damping = INITIAL_DAMPING
    for _ in range(moves):
        gram = change[:, free].T @ change[:, free]
        if not np.trace(gram) > 0:  # as on a plane
            break
        gram[np.diag_indices_from(gram)] += damping * np.trace(gram) / len(gram)
        step = np.zeros(len(positions))
        step[free] = -np.linalg.solve(gram, residuals @ change[:, free])
        after = limited_move(positions, positions + step, heights.edges, heights.closed)
        left, changed = heights.residual_slopes(after, degree)
        before, now = residuals @ residuals, left @ left
        if now < before:
            positions, residuals, change, damping = after, left, changed, damping / DAMPING_DECREASE
        else:
            damping *= DAMPING_INCREASE
        if MAX_ERROR_RATIO * before < now < before:
            break
    return positions


def limited_move(positions: Array, moved: Array, edges: tuple[float, float], closed: bool) -> Array:
    """Return moved positions without intervals that became shorter than half, or than ``MIN_INTERVAL``."""
    breadth = edges[1] - edges[0]
    before, after = (
        np.append(np.diff(x), x[0] + breadth - x[-1]) if closed else np.diff(x) for x in (positions, moved)
    )
    least = np.minimum(np.maximum(before / 2, MIN_INTERVAL * before.mean()), before)
    after = np.maximum(after, least)
    lengths = np.append(0.0, np.cumsum(after * breadth / after.sum()))
    return moved[0] + lengths[:-1] if closed else np.append(edges[0] + lengths[:-1], edges[1])
