"""The positions of planes and lines with the least predicted error."""

from collections.abc import Callable

import numpy as np

from ...common.arrays import Array
from ..sampling.basis import check_counts, spline_sites
from ..surface.bspline import greville
from .error_model import ErrorModel, SpacingMap
from .parametrizations import ParametrizedLines, parametrized_lines

# [1] The length of a span is divided by this power of its mean square error. The mean square error of a cubic is
# proportional to the ninth power of the length. Larger: stronger changes of the spans.
ERROR_EXPONENT = 0.11
# [fraction of the squared residuals] that other positions can change, in each direction, below which all spans have the
# same length: the rest is the mesh's own facets. Larger: more grids are even, less time, up to half of this more error.
MIN_MOVABLE_FRACTION = 0.06
EQUALIZING_ROUNDS = 3  # [1] iterations that equalize the errors of all spans. Larger: little effect, more time
# [1] ratio of errors, or of their squares, above which there is no gain: the first, simplest choice is kept, and the
# steps of a movement have converged. Smaller: simple spacings are kept more often, fewer steps.
MAX_ERROR_RATIO = 0.98
MAX_MOVES = 8  # [1] most steps of their movement. Larger: slightly less error, more time
# [fraction of the mean interval] below which no interval is shortened, because lines at equal positions are redundant,
# and least weight of a span. Larger: more even lines.
MIN_INTERVAL = 0.1
INITIAL_DAMPING = 0.01  # [1] damping of the first Gauss-Newton step. Larger: shorter first steps
DAMPING_DECREASE = 4.0  # [1] divisor of the damping after a step with less error. Larger: longer steps, more failures
DAMPING_INCREASE = 6.0  # [1] factor of the damping after a step with more error. Larger: shorter steps, fewer failures
# [intervals] rotation of closed lines that is tried too. Other values are less different from zero.
ROTATED_INTERVALS = 0.5


def spaced_lines(
    error_model: ErrorModel, n: int, lines: int, spacing: str, degree: tuple[int, int], moves: int = MAX_MOVES
) -> ParametrizedLines:
    """Return the lines of ``n`` planes with ``lines`` lines each."""
    check_counts(n, degree[0], "u-planes")
    check_counts(lines, degree[1], "v-lines")
    parametrization = error_model.parametrization
    if (
        spacing == "auto"
        and error_model.is_filled
        and max(error_model.movable_fractions(n, lines, degree)) < MIN_MOVABLE_FRACTION
    ):
        along, across = (
            control_fractions(n, degree[0], False),
            control_fractions(lines, degree[1], parametrization.closed),
        )
        s = positions_at((np.array((0.0, 1.0)), np.array(parametrization.span)), along)
        t = positions_at(error_model.maps["uniform"], across)
        return parametrized_lines(parametrization, s, t, error_model.centre)
    s = plane_positions(error_model, n, spacing, degree[0], moves)
    t = line_positions(error_model, lines, spacing, degree[1], moves)
    return parametrized_lines(parametrization, s, t, error_model.centre)


def plane_positions(error_model: ErrorModel, count: int, spacing: str, degree: int, moves: int = MAX_MOVES) -> Array:
    """Return the positions of planes along the region, with the least predicted error for "auto"."""
    if spacing != "auto":
        return np.linspace(*error_model.parametrization.span, count)
    return refined_planes(error_model, initial_planes(error_model, count, degree), degree, moves)


def line_positions(error_model: ErrorModel, count: int, spacing: str, degree: int, moves: int = MAX_MOVES) -> Array:
    """Return the positions of lines across the region, with the least predicted error for "auto"."""
    if spacing == "auto" and error_model.is_filled:
        return refined_lines(error_model, initial_lines(error_model, count, degree), degree, moves)
    maps = error_model.maps
    return positions_at(maps.get(spacing, maps["uniform"]), even_fractions(count, error_model.parametrization.closed))


def control_fractions(count: int, degree: int, closed: bool) -> Array:
    """Return the fractions of the region at which the control points of even knots are."""
    return even_fractions(count, True) if closed else greville(spline_sites(count, degree, False).knots, degree)


def even_fractions(count: int, closed: bool) -> Array:
    """Return the fractions of even steps, of a full turn from the first position on, or from edge to edge."""
    return np.arange(count) / count if closed else np.linspace(0, 1, count)


def initial_planes(error_model: ErrorModel, count: int, degree: int) -> Array:
    """Return even planes, or planes with equal errors in all spans, if these have less error."""
    even = np.linspace(*error_model.parametrization.span, count)
    if not error_model.is_filled:
        return even
    selection, validation = error_model.halves
    fractions = control_fractions(count, degree, False)
    linear = np.array((0.0, 1.0)), np.array(error_model.parametrization.span)
    maps, errors = equalized_maps(selection.error_along, linear, fractions, degree, False)
    candidates = [even, *(positions_at(m, fractions) for m in maps)]
    errors = [selection.error_along(even, degree)[0], *errors]
    best = [even, candidates[int(np.argmin(errors))]]
    return least_error(best, validation.errors_along(np.stack(best), degree), error_model)


def refined_planes(error_model: ErrorModel, positions: Array, degree: int, moves: int) -> Array:
    """Return planes moved one by one to less error, if the other half of the model confirms this."""
    if moves == 0 or not error_model.is_filled or error_model.parametrization.bends:
        return positions  # the model does not contain the error of a curved axis
    selection, validation = error_model.halves
    moved = refined_positions(selection.slopes_along, positions, degree, error_model.parametrization.span, False, moves)
    candidates = [positions, moved]
    return least_error(candidates, validation.errors_along(np.stack(candidates), degree), error_model)


def density_lines(error_model: ErrorModel, count: int, degree: int) -> Array:
    """Return choices of lines without a search: at even positions, even lengths and a power of the curvature."""
    if not error_model.is_filled:
        return line_positions(error_model, count, "uniform", degree)[None]
    fractions = control_fractions(count, degree, error_model.parametrization.closed)
    return np.stack([positions_at(m, fractions) for m in error_model.halves[0].maps.values()])


def initial_lines(error_model: ErrorModel, count: int, degree: int) -> Array:
    """Return the best of even positions, even lengths, a power of the curvature, and equal errors in all spans."""
    if not error_model.is_filled:
        even = even_fractions(count, error_model.parametrization.closed)
        return positions_at(error_model.maps["uniform"], even)
    found = error_model.remembered(("initial", count, degree), lambda: _initial_lines(error_model, count, degree))
    return least_error(*found, error_model)


def _initial_lines(error_model: ErrorModel, count: int, degree: int) -> tuple[list[Array], Array]:
    """Return even lines and those with equal errors, and the errors of both."""
    closed = error_model.parametrization.closed
    selection, validation = error_model.halves
    fractions = control_fractions(count, degree, closed)
    maps = list(selection.maps.values())
    even_lines = positions_at(maps[0], even_fractions(count, closed))
    if closed:
        maps = [m for map_ in maps for m in (map_, rotated_map(map_, ROTATED_INTERVALS / count))]
    left = selection.errors_across(np.stack([positions_at(m, fractions) for m in maps]), degree)
    equalized, errors = equalized_maps(selection.error_across, maps[int(np.argmin(left))], fractions, degree, closed)
    candidates = [even_lines, positions_at(equalized[int(np.argmin(errors))], fractions)]
    for positions in candidates:
        positions.setflags(write=False)  # they are remembered
    return candidates, validation.errors_across(np.stack(candidates), degree)


def refined_lines(error_model: ErrorModel, positions: Array, degree: int, moves: int) -> Array:
    """Return lines moved one by one to less error, if the other half of the model confirms this."""
    if moves == 0 or not error_model.is_filled:
        return positions
    found = error_model.remembered(
        ("refined", positions.tobytes(), degree, moves), lambda: _refined_lines(error_model, positions, degree, moves)
    )
    return least_error(*found, error_model)


def _refined_lines(error_model: ErrorModel, positions: Array, degree: int, moves: int) -> tuple[list[Array], Array]:
    """Return lines before and after the movement, and the errors of both."""
    selection, validation = error_model.halves
    moved = refined_positions(
        selection.slopes_across,
        positions,
        degree,
        error_model.parametrization.breadth,
        error_model.parametrization.closed,
        moves,
    )
    candidates = [positions, moved]
    for lines in candidates:
        lines.setflags(write=False)  # they are remembered
    return candidates, validation.errors_across(np.stack(candidates), degree)


def refined_positions(
    slopes: Callable[[Array, int], tuple[Array, Array]],
    positions: Array,
    degree: int,
    edges: tuple[float, float],
    closed: bool,
    moves: int,
) -> Array:
    r"""Move positions one by one to less error, by Gauss-Newton steps with Marquardt's damping.

    .. math::

        \delta x = -(J^{T} J + \mu\, \overline{d}\, I)^{-1} J^{T} e, \qquad
        \overline{d} = \operatorname{tr}(J^{T} J) / m
    """
    free = slice(None) if closed else slice(1, -1)
    residuals, change = slopes(positions, degree)
    damping = INITIAL_DAMPING
    for _ in range(moves if residuals.any() else 0):
        gram = change[:, free].T @ change[:, free]
        gram[np.diag_indices_from(gram)] += damping * np.trace(gram) / len(gram)
        step = np.zeros(len(positions))
        downhill = residuals @ change[:, free]
        step[free] = -np.linalg.lstsq(gram, downhill, rcond=None)[0]
        after = limited_move(positions, positions + step, edges, closed)
        left, changed = slopes(after, degree)
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


def rotated_map(m: SpacingMap, fraction: float) -> SpacingMap:
    """Return a closed map that starts where the given fraction of it is before the start."""
    fractions, positions = m
    turn = positions[-1] - positions[0]
    after = np.concatenate((fractions[fractions > fraction], 1 + fractions[(fractions > 0) & (fractions < fraction)]))
    knots = np.concatenate(([fraction], after, [1 + fraction]))
    period = np.concatenate((fractions, 1 + fractions[1:])), np.concatenate((positions, turn + positions[1:]))
    return knots - fraction, positions_at(period, knots)


def least_error(candidates: list[Array], left: Array, error_model: ErrorModel) -> Array:
    """Return the candidate with the least error, or the first whose error is nearly as small.

    Symmetric shapes and noise have several candidates with nearly equal errors.
    """
    rounding = float(np.finfo(np.float32).eps * np.abs(error_model.profiles).mean())  # of vertices in mesh files
    return candidates[int(np.argmax(MAX_ERROR_RATIO * left - rounding <= left.min()))]


def positions_at(m: SpacingMap, fractions: Array) -> Array:
    """Return the positions at some fractions of a map."""
    return np.interp(fractions, *m)


def equalized_maps(
    error: Callable[[Array, int], tuple[float, Array]], start: SpacingMap, fractions: Array, degree: int, closed: bool
) -> tuple[list[SpacingMap], list[float]]:
    """Return maps, each with shorter spans where the one before had more error, and their errors."""
    maps, errors = [start], []
    for _ in range(EQUALIZING_ROUNDS):
        m = maps[-1]
        left, energy = error(positions_at(m, fractions), degree)
        errors.append(left)
        if not energy.any():
            return maps, errors
        energy = energy / energy.mean()
        padded = np.concatenate((energy[-1:], energy, energy[:1])) if closed else np.pad(energy, 1, mode="edge")
        weight = (padded[:-2] + 2 * energy + padded[2:]) ** ERROR_EXPONENT
        weight = np.maximum(weight, MIN_INTERVAL)  # of spans without errors
        cumulative = np.append(0.0, np.cumsum(weight))
        maps.append((cumulative / cumulative[-1], positions_at(m, np.linspace(0, 1, len(energy) + 1))))
    return maps, [*errors, error(positions_at(maps[-1], fractions), degree)[0]]
