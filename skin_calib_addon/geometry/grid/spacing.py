"""Where planes and lines go when the author leaves it open: where they lower the error most."""

from collections.abc import Callable

import numpy as np

from ...common.arrays import Array, product
from ..sampling.basis import check_counts, spline_sites
from ..sampling.lines import LineGrid
from ..surface.bspline import greville
from .error_model import ErrorModel, SpacingMap
from .parametrizations import parametrized_lines

SPACINGS = ("auto", "uniform", "arc", "curvature")
# Spans get shorter as this power of their mean square error: that of a cubic falls as the ninth power of its length.
ERROR_EXPONENT = 0.11
EQUALIZING_ROUNDS = 3  # rounds of making the errors of all spans alike
MIN_SPAN_ERROR = 1e-4  # share of the mean below which the error of a span counts no more
MAX_ERROR_RATIO = 0.98  # an error is lower where it is below this share of that of the first, plainest choice
NEGLIGIBLE_ERROR = 1e-7  # share of the heights below which an error is none
MAX_MOVED = 80  # of more planes or lines each makes little difference, and all take long
MAX_MOVES = 8
MIN_INTERVAL = 0.1  # share of the mean interval below which none is made shorter: lines that meet say the same
INITIAL_DAMPING, DAMPING_DECREASE, DAMPING_INCREASE = (
    0.01,
    4.0,
    6.0,
)  # of Gauss-Newton steps, and by what it changes as they succeed or fail
CONVERGED_RATIO = 0.98  # share of the squares that a step must leave to be the last
ROTATED_INTERVALS = 0.5  # share of a line's interval by which closed lines may be turned


def spaced_lines(error_model: ErrorModel, n: int, lines: int, spacing: str, degree: tuple[int, int]) -> LineGrid:
    """The lines of ``n`` planes and ``lines`` lines in each.

    Raises
    ------
    UnderdeterminedFit
        If they are too few for the degree.
    """
    check_counts(n, degree[0], "u-planes")
    check_counts(lines, degree[1], "v-lines")
    s, t = plane_positions(error_model, n, spacing, degree[0]), line_positions(error_model, lines, spacing, degree[1])
    return parametrized_lines(error_model.parametrization, s, t)


def plane_positions(error_model: ErrorModel, count: int, spacing: str, degree: int, moves: int = MAX_MOVES) -> Array:
    """Places of ``count`` planes along the chart; those that leave the least error where the spacing is ``auto``.

    ``moves`` steps at most lead there from a guess: a few find most of what there is to gain.
    """
    if spacing != "auto":
        return np.linspace(*error_model.parametrization.span, count)
    return refined_planes(error_model, initial_planes(error_model, count, degree), degree, moves)


def line_positions(error_model: ErrorModel, count: int, spacing: str, degree: int, moves: int = MAX_MOVES) -> Array:
    """Places of ``count`` lines across the chart, ascending; as for planes."""
    if spacing == "auto" and error_model.is_filled:
        return refined_lines(error_model, initial_lines(error_model, count, degree), degree, moves)
    maps = error_model.maps
    return positions_at(maps.get(spacing, maps["uniform"]), even_fractions(count, error_model.parametrization.closed))


def control_fractions(count: int, degree: int, closed: bool) -> Array:
    """Shares of the way across at which the control points of even knots lie."""
    return even_fractions(count, True) if closed else greville(spline_sites(count, degree, False).knots, degree)


def even_fractions(count: int, closed: bool) -> Array:
    """Shares of even steps: from the first place on all round, or from edge to edge."""
    return np.arange(count) / count if closed else np.linspace(0, 1, count)


def initial_planes(error_model: ErrorModel, count: int, degree: int) -> Array:
    """Even planes, or such as leave alike errors in all spans."""
    even = np.linspace(*error_model.parametrization.span, count)
    if not error_model.is_filled:
        return even
    selection, validation = error_model.halves
    fractions = control_fractions(count, degree, False)
    linear = np.array((0.0, 1.0)), np.array(error_model.parametrization.span)
    maps, errors = equalized_maps(selection.error_along, linear, fractions, degree, False)
    candidates = [even, *(positions_at(m, fractions) for m in maps)]
    errors = [selection.error_along(even, degree)[0], *errors]
    return least_error([even, candidates[int(np.argmin(errors))]], validation.errors_along, degree, error_model)


def refined_planes(error_model: ErrorModel, positions: Array, degree: int, moves: int) -> Array:
    """Planes from some places moved one by one to where they leave the least error, if they do leave less."""
    if (
        not error_model.is_filled or error_model.parametrization.bends or len(positions) > MAX_MOVED
    ):  # the survey does not see the axis' own error
        return positions
    selection, validation = error_model.halves
    moved = refined_positions(selection.slopes_along, positions, degree, error_model.parametrization.span, False, moves)
    return least_error([positions, moved], validation.errors_along, degree, error_model)


def density_lines(error_model: ErrorModel, count: int, degree: int) -> Array:
    """Choices of lines that need no search: at even places, lengths and a power of the curvature; shape (c, count)."""
    if not error_model.is_filled:
        return line_positions(error_model, count, "uniform", degree)[None]
    fractions = control_fractions(count, degree, error_model.parametrization.closed)
    return np.stack([positions_at(m, fractions) for m in error_model.halves[0].maps.values()])


def initial_lines(error_model: ErrorModel, count: int, degree: int) -> Array:
    """Lines at even places, even lengths or a power of the curvature, or such as leave alike errors in all spans."""
    closed, even = error_model.parametrization.closed, even_fractions(count, error_model.parametrization.closed)
    if not error_model.is_filled:
        return positions_at(error_model.maps["uniform"], even)
    selection, validation = error_model.halves
    fractions = control_fractions(count, degree, closed)
    maps = list(selection.maps.values())
    even_lines = positions_at(maps[0], even)
    if closed:
        maps = [m for map_ in maps for m in (map_, rotated_map(map_, ROTATED_INTERVALS / count))]
    left = selection.errors_across(np.stack([positions_at(m, fractions) for m in maps]), degree)
    equalized, errors = equalized_maps(selection.error_across, maps[int(np.argmin(left))], fractions, degree, closed)
    return least_error(
        [even_lines, positions_at(equalized[int(np.argmin(errors))], fractions)],
        validation.errors_across,
        degree,
        error_model,
    )


def refined_lines(error_model: ErrorModel, positions: Array, degree: int, moves: int) -> Array:
    """Lines from some places moved one by one to where they leave the least error, if they do leave less."""
    if not error_model.is_filled or len(positions) > MAX_MOVED:
        return positions
    selection, validation = error_model.halves
    moved = refined_positions(
        selection.slopes_across,
        positions,
        degree,
        error_model.parametrization.breadth,
        error_model.parametrization.closed,
        moves,
    )
    return least_error([positions, moved], validation.errors_across, degree, error_model)


def refined_positions(
    slopes: Callable[[Array, int], tuple[Array, Array]],
    positions: Array,
    degree: int,
    edges: tuple[float, float],
    closed: bool,
    moves: int,
) -> Array:
    """Places moved one by one to where they leave the least error: Gauss-Newton with Marquardt's damping.

    Parameters
    ----------
    slopes : function
        Of places and degree: what they leave, and how that changes as each moves.
    """
    free = slice(None) if closed else slice(1, -1)
    residuals, change = slopes(positions, degree)
    damping = INITIAL_DAMPING
    for _ in range(moves if residuals.any() else 0):
        gram = product(change[:, free].T, change[:, free])
        gram[np.diag_indices_from(gram)] += damping * np.trace(gram) / len(gram)
        step = np.zeros(len(positions))
        downhill = product(residuals[None], change[:, free])[0]
        step[free] = -np.linalg.lstsq(gram, downhill, rcond=None)[0]
        after = limited_move(positions, positions + step, edges, closed)
        left, changed = slopes(after, degree)
        before, now = residuals @ residuals, left @ left
        if now < before:
            positions, residuals, change, damping = after, left, changed, damping / DAMPING_DECREASE
        else:
            damping *= DAMPING_INCREASE
        if CONVERGED_RATIO * before < now < before:
            break
    return positions


def limited_move(positions: Array, moved: Array, edges: tuple[float, float], closed: bool) -> Array:
    """Places that were moved, but for intervals that lose more than half or get shorter than ``NEAREST``."""
    breadth = edges[1] - edges[0]
    before, after = (
        np.append(np.diff(x), x[0] + breadth - x[-1]) if closed else np.diff(x) for x in (positions, moved)
    )
    least = np.minimum(np.maximum(before / 2, MIN_INTERVAL * before.mean()), before)
    after = np.maximum(after, least)
    lengths = np.append(0.0, np.cumsum(after * breadth / after.sum()))
    return moved[0] + lengths[:-1] if closed else np.append(edges[0] + lengths[:-1], edges[1])


def rotated_map(m: SpacingMap, fraction: float) -> SpacingMap:
    """A closed map that starts where the given share of it lies behind."""
    fractions, positions = m
    turn = positions[-1] - positions[0]
    after = np.concatenate((fractions[fractions > fraction], 1 + fractions[(fractions > 0) & (fractions < fraction)]))
    knots = np.concatenate(([fraction], after, [1 + fraction]))
    period = np.concatenate((fractions, 1 + fractions[1:])), np.concatenate((positions, turn + positions[1:]))
    return knots - fraction, positions_at(period, knots)


def least_error(
    candidates: list[Array], errors: Callable[[Array, int], Array], degree: int, error_model: ErrorModel
) -> Array:
    """The candidate of the least error, or the first that leaves hardly more: for symmetric shapes, and noise."""
    left = errors(np.stack(candidates), degree)
    nothing = NEGLIGIBLE_ERROR * float(np.abs(error_model.profiles).mean())
    return candidates[int(np.argmax(MAX_ERROR_RATIO * left - nothing <= left.min()))]


def positions_at(m: SpacingMap, fractions: Array) -> Array:
    """Places at some shares of a map."""
    return np.interp(fractions, *m)


def equalized_maps(
    error: Callable[[Array, int], tuple[float, Array]], start: SpacingMap, fractions: Array, degree: int, closed: bool
) -> tuple[list[SpacingMap], list[float]]:
    """Maps from a first one on, each with shorter spans where the one before left more error; and their errors.

    Parameters
    ----------
    error : function
        Of places and degree: the error of a fit, and the mean squares of its spans.
    shares : array, shape (m,)
        At which the control points lie.
    """
    maps, errors = [start], []
    for _ in range(EQUALIZING_ROUNDS):
        m = maps[-1]
        left, energy = error(positions_at(m, fractions), degree)
        errors.append(left)
        if not energy.any():
            return maps, errors
        energy = np.maximum(energy / energy.mean(), MIN_SPAN_ERROR)
        padded = np.concatenate((energy[-1:], energy, energy[:1])) if closed else np.pad(energy, 1, mode="edge")
        # Rounded, so that the last bits of the heights do not come through: a mesh that is moved takes its lines along.
        weight = np.round((padded[:-2] + 2 * energy + padded[2:]) ** ERROR_EXPONENT, 4)
        cumulative = np.append(0.0, np.cumsum(weight))
        maps.append((cumulative / cumulative[-1], positions_at(m, np.linspace(0, 1, len(energy) + 1))))
    return maps, [*errors, error(positions_at(maps[-1], fractions), degree)[0]]
