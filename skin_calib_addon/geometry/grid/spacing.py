"""Where planes and lines go when the author leaves it open: where they lower the error most."""

from collections.abc import Callable

import numpy as np

from ...common.arrays import Array, product
from ..sampling.basis import check_counts, spline_sites
from ..sampling.lines import LineGrid
from ..surface.bspline import greville
from .charts import chart_lines
from .error_model import Map, Survey

SPACINGS = ("auto", "uniform", "arc", "curvature")
# Spans get shorter as this power of their mean square error: that of a cubic falls as the ninth power of its length.
ERROR_POWER = 0.11
EVENED = 3  # rounds of making the errors of all spans alike
QUIETEST = 1e-4  # share of the mean below which the error of a span counts no more
GAIN = 0.98  # an error is lower where it is below this share of that of the first, plainest choice
NOTHING = 1e-7  # share of the heights below which an error is none
MOST_MOVED = 80  # of more planes or lines each makes little difference, and all take long
MOST_MOVES = 8
NEAREST = 0.1  # share of the mean interval below which none is made shorter: lines that meet say the same
FIRST_DAMPING, EASED, RAISED = 0.01, 4.0, 6.0  # of Gauss-Newton steps, and by what it changes as they succeed or fail
SLIGHT = 0.98  # share of the squares that a step must leave to be the last
HALF = 0.5  # share of a line's interval by which closed lines may be turned


def spaced_lines(survey: Survey, n: int, lines: int, spacing: str, degree: tuple[int, int]) -> LineGrid:
    """The lines of ``n`` planes and ``lines`` lines in each.

    Raises
    ------
    UnderdeterminedFit
        If they are too few for the degree.
    """
    check_counts(n, degree[0], "u-planes")
    check_counts(lines, degree[1], "v-lines")
    s, t = plane_places(survey, n, spacing, degree[0]), line_places(survey, lines, spacing, degree[1])
    return chart_lines(survey.chart, s, t)


def plane_places(survey: Survey, count: int, spacing: str, degree: int, moves: int = MOST_MOVES) -> Array:
    """Places of ``count`` planes along the chart; those that leave the least error where the spacing is ``auto``.

    ``moves`` steps at most lead there from a guess: a few find most of what there is to gain.
    """
    if spacing != "auto":
        return np.linspace(*survey.chart.span, count)
    return moved_planes(survey, guessed_planes(survey, count, degree), degree, moves)


def line_places(survey: Survey, count: int, spacing: str, degree: int, moves: int = MOST_MOVES) -> Array:
    """Places of ``count`` lines across the chart, ascending; as for planes."""
    if spacing == "auto" and survey.fills:
        return moved_lines(survey, guessed_lines(survey, count, degree), degree, moves)
    maps = survey.maps
    return place(maps.get(spacing, maps["uniform"]), even_shares(count, survey.chart.closed))


def line_shares(count: int, degree: int, closed: bool) -> Array:
    """Shares of the way across at which the control points of even knots lie."""
    return even_shares(count, True) if closed else greville(spline_sites(count, degree, False).knots, degree)


def even_shares(count: int, closed: bool) -> Array:
    """Shares of even steps: from the first place on all round, or from edge to edge."""
    return np.arange(count) / count if closed else np.linspace(0, 1, count)


def guessed_planes(survey: Survey, count: int, degree: int) -> Array:
    """Even planes, or such as leave alike errors in all spans."""
    even = np.linspace(*survey.chart.span, count)
    if not survey.fills:
        return even
    looked, judged = survey.halves
    shares = line_shares(count, degree, False)
    linear = np.array((0.0, 1.0)), np.array(survey.chart.span)
    maps, errors = evened(looked.error_along, linear, shares, degree, False)
    candidates = [even, *(place(m, shares) for m in maps)]
    errors = [looked.error_along(even, degree)[0], *errors]
    return best([even, candidates[int(np.argmin(errors))]], judged.errors_along, degree, survey)


def moved_planes(survey: Survey, places: Array, degree: int, moves: int) -> Array:
    """Planes from some places moved one by one to where they leave the least error, if they do leave less."""
    if (
        not survey.fills or survey.chart.bends or len(places) > MOST_MOVED
    ):  # the survey does not see the axis' own error
        return places
    looked, judged = survey.halves
    moved = moved_places(looked.slopes_along, places, degree, survey.chart.span, False, moves)
    return best([places, moved], judged.errors_along, degree, survey)


def plain_lines(survey: Survey, count: int, degree: int) -> Array:
    """Choices of lines that need no search: at even places, lengths and a power of the curvature; shape (c, count)."""
    if not survey.fills:
        return line_places(survey, count, "uniform", degree)[None]
    shares = line_shares(count, degree, survey.chart.closed)
    return np.stack([place(m, shares) for m in survey.halves[0].maps.values()])


def guessed_lines(survey: Survey, count: int, degree: int) -> Array:
    """Lines at even places, even lengths or a power of the curvature, or such as leave alike errors in all spans."""
    closed, even = survey.chart.closed, even_shares(count, survey.chart.closed)
    if not survey.fills:
        return place(survey.maps["uniform"], even)
    looked, judged = survey.halves
    shares = line_shares(count, degree, closed)
    maps = list(looked.maps.values())
    plain = place(maps[0], even)
    if closed:
        maps = [m for map_ in maps for m in (map_, turned(map_, HALF / count))]
    left = looked.errors_across(np.stack([place(m, shares) for m in maps]), degree)
    more, errors = evened(looked.error_across, maps[int(np.argmin(left))], shares, degree, closed)
    return best([plain, place(more[int(np.argmin(errors))], shares)], judged.errors_across, degree, survey)


def moved_lines(survey: Survey, places: Array, degree: int, moves: int) -> Array:
    """Lines from some places moved one by one to where they leave the least error, if they do leave less."""
    if not survey.fills or len(places) > MOST_MOVED:
        return places
    looked, judged = survey.halves
    moved = moved_places(looked.slopes_across, places, degree, survey.chart.breadth, survey.chart.closed, moves)
    return best([places, moved], judged.errors_across, degree, survey)


def moved_places(
    slopes: Callable[[Array, int], tuple[Array, Array]],
    places: Array,
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
    residuals, change = slopes(places, degree)
    damping = FIRST_DAMPING
    for _ in range(moves if residuals.any() else 0):
        gram = product(change[:, free].T, change[:, free])
        gram[np.diag_indices_from(gram)] += damping * np.trace(gram) / len(gram)
        step = np.zeros(len(places))
        downhill = product(residuals[None], change[:, free])[0]
        step[free] = -np.linalg.lstsq(gram, downhill, rcond=None)[0]
        after = kept_apart(places, places + step, edges, closed)
        left, changed = slopes(after, degree)
        before, now = residuals @ residuals, left @ left
        if now < before:
            places, residuals, change, damping = after, left, changed, damping / EASED
        else:
            damping *= RAISED
        if SLIGHT * before < now < before:
            break
    return places


def kept_apart(places: Array, moved: Array, edges: tuple[float, float], closed: bool) -> Array:
    """Places that were moved, but for intervals that lose more than half or get shorter than ``NEAREST``."""
    breadth = edges[1] - edges[0]
    before, after = (np.append(np.diff(x), x[0] + breadth - x[-1]) if closed else np.diff(x) for x in (places, moved))
    least = np.minimum(np.maximum(before / 2, NEAREST * before.mean()), before)
    after = np.maximum(after, least)
    ways = np.append(0.0, np.cumsum(after * breadth / after.sum()))
    return moved[0] + ways[:-1] if closed else np.append(edges[0] + ways[:-1], edges[1])


def turned(m: Map, share: float) -> Map:
    """A closed map that starts where the given share of it lies behind."""
    shares, places = m
    turn = places[-1] - places[0]
    after = np.concatenate((shares[shares > share], 1 + shares[(shares > 0) & (shares < share)]))
    knots = np.concatenate(([share], after, [1 + share]))
    period = np.concatenate((shares, 1 + shares[1:])), np.concatenate((places, turn + places[1:]))
    return knots - share, place(period, knots)


def best(candidates: list[Array], errors: Callable[[Array, int], Array], degree: int, survey: Survey) -> Array:
    """The candidate of the least error, or the first that leaves hardly more: for symmetric shapes, and noise."""
    left = errors(np.stack(candidates), degree)
    nothing = NOTHING * float(np.abs(survey.profiles).mean())
    return candidates[int(np.argmax(GAIN * left - nothing <= left.min()))]


def place(m: Map, shares: Array) -> Array:
    """Places at some shares of a map."""
    return np.interp(shares, *m)


def evened(
    error: Callable[[Array, int], tuple[float, Array]], start: Map, shares: Array, degree: int, closed: bool
) -> tuple[list[Map], list[float]]:
    """Maps from a first one on, each with shorter spans where the one before left more error; and their errors.

    Parameters
    ----------
    error : function
        Of places and degree: the error of a fit, and the mean squares of its spans.
    shares : array, shape (m,)
        At which the control points lie.
    """
    maps, errors = [start], []
    for _ in range(EVENED):
        m = maps[-1]
        left, energy = error(place(m, shares), degree)
        errors.append(left)
        if not energy.any():
            return maps, errors
        energy = np.maximum(energy / energy.mean(), QUIETEST)
        beside = np.concatenate((energy[-1:], energy, energy[:1])) if closed else np.pad(energy, 1, mode="edge")
        # Rounded, so that the last bits of the heights do not come through: a mesh that is moved takes its lines along.
        weight = np.round((beside[:-2] + 2 * energy + beside[2:]) ** ERROR_POWER, 4)
        shared = np.append(0.0, np.cumsum(weight))
        maps.append((shared / shared[-1], place(m, np.linspace(0, 1, len(energy) + 1))))
    return maps, [*errors, error(place(maps[-1], shares), degree)[0]]
