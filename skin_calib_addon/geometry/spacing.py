"""Where planes and lines go when the author leaves it open: where they lower the error most."""

from collections.abc import Callable

import numpy as np

from ..arrays import Array
from .basis import check_counts, spline_sites
from .bspline import greville
from .charts import chart_lines
from .lines import LineGrid
from .survey import Survey

SPACINGS = ("auto", "uniform", "arc", "curvature")
# Spans get shorter as this power of their mean square error: that of a cubic falls as the ninth power of its length.
ERROR_POWER = 0.11
EVENED = 3  # rounds of making the errors of all spans alike
QUIETEST = 1e-4  # share of the mean below which the error of a span counts no more
GAIN = 0.98  # an error is lower where it is below this share of that of the first, plainest choice
NOTHING = 1e-7  # share of the heights below which an error is none
PHASES = (0.0, 0.5)  # shares of a line's interval by which closed lines may be turned

# A spacing is a piecewise linear map from the share of the intervals behind a place, 0 to 1, to the place.
Map = tuple[Array, Array]


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


def plane_places(survey: Survey, count: int, spacing: str, degree: int) -> Array:
    """Places of ``count`` planes along the chart; those that leave the least error where the spacing is ``auto``."""
    even = np.linspace(*survey.chart.span, count)
    if spacing != "auto" or not survey.fills:
        return even
    shares = greville(spline_sites(count, degree, False).knots, degree)
    linear = np.array((0.0, 1.0)), np.array(survey.chart.span)
    maps, errors = evened(survey.error_along, linear, shares, degree, False)
    candidates = [even, *(place(m, shares) for m in maps)]
    return best(candidates, [survey.error_along(even, degree)[0], *errors], survey)


def line_places(survey: Survey, count: int, spacing: str, degree: int) -> Array:
    """Places of ``count`` lines across the chart, ascending; those that leave the least error for ``auto``."""
    closed = survey.chart.closed
    even = np.arange(count) / count if closed else np.linspace(0, 1, count)
    if spacing == "auto" and not survey.fills:
        spacing = "uniform"
    if spacing != "auto":
        named = density_maps(survey)
        return place(named.get(spacing, named["uniform"]), even)
    shares = even if closed else greville(spline_sites(count, degree, False).knots, degree)
    maps = list(density_maps(survey).values())
    if closed:
        maps = [turned(m, phase / count) for m in maps for phase in PHASES]
    errors = [survey.error_across(place(m, shares), degree)[0] for m in maps]
    more, lower = evened(survey.error_across, maps[int(np.argmin(errors))], shares, degree, closed)
    candidates, errors = [place(m, shares) for m in maps + more], errors + lower
    if not closed:
        candidates = [place(maps[0], even), *candidates]
        errors = [survey.error_across(candidates[0], degree)[0], *errors]
    return best(candidates, errors, survey)


def turned(m: Map, share: float) -> Map:
    """A closed map that starts where the given share of it lies behind."""
    shares, places = m
    turn = places[-1] - places[0]
    after = np.concatenate((shares[shares > share], 1 + shares[(shares > 0) & (shares < share)]))
    knots = np.concatenate(([share], after, [1 + share]))
    period = np.concatenate((shares, 1 + shares[1:])), np.concatenate((places, turn + places[1:]))
    return knots - share, place(period, knots)


def best(candidates: list[Array], errors: list[float], survey: Survey) -> Array:
    """The candidate of the least error; the first where that gains hardly anything, for symmetric shapes."""
    least = int(np.argmin(errors))
    plain = errors[least] > GAIN * errors[0] - NOTHING * float(np.abs(survey.profiles).mean())
    return candidates[0 if plain else least]


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


def density_maps(survey: Survey) -> dict[str, Map]:
    """Maps that give each place the share of a density behind it: of nothing, arc length, a power of curvature."""
    t, edges, closed = survey.outline_t, survey.chart.breadth, survey.chart.closed
    maps = {"uniform": (np.array((0.0, 1.0)), np.array(edges))}
    for spacing, density in survey.densities.items():
        following = np.roll(density, -1) if closed else density[1:]
        share = np.append(0.0, np.cumsum((density[: len(following)] + following) / 2))
        if share[-1] > 0:  # a plane has no curvature
            maps[spacing] = share / share[-1], np.append(t, edges[1]) if closed else t
    return maps
