r"""Fit the distribution of readings without contact: normal, rounded to the steps of a converter, and often clipped.

The reading of a taxel at rest is a normal variable with the mean :math:`m` and the standard deviation :math:`\sigma`,
rounded to steps :math:`q`. Most converters send 0 for all that is below 0. The mean and the standard deviation of
clipped readings hide 40 % of the noise. The fit therefore treats each level as an interval, and the lowest one as open.
"""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..common.arrays import Array, BoolArray, IntArray

# [frames] Fewer frames say nothing about the noise. Larger: a longer rest is needed; smaller: the estimate is so
# uncertain that hardly a taxel counts as touched.
MIN_FRAMES = 20
# [frames] Weight of the histogram of all taxels in that of each. Larger: a taxel that differs from the others is
# learned more slowly; smaller: estimates scatter more.
POOLED_FRAMES = 50.0
# Number of levels of a histogram. Larger: slower; smaller: wide noise is overestimated, by 1/12 of a level squared.
LEVELS = 32
# Iterations of the fit of all taxels together. Larger: slower, for the last percent of the estimates.
POOLED_ITERATIONS = 200
# Iterations of the fits of each taxel. Larger: slower, for the last percent of the estimates.
TAXEL_ITERATIONS = 60
# [1] Smallest step of real numbers, relative to the range of the readings. Derived: from rounding.
MIN_STEP_FRACTION = 1e-9
# [steps] Smallest standard deviation: readings that never changed in a second prove no less. Larger: coarse converters
# have higher limits.
MIN_SIGMA = 0.25
# [1] Fraction of readings at the lowest level, from which on readings are clipped. Larger: the hidden noise of some
# clipped taxels is missed; smaller: the noise of others is overestimated.
MIN_CLIPPED = 0.05
# [1] Ratio of this fraction to that of the next level, from which on readings are clipped. As MIN_CLIPPED.
MIN_PILE = 0.5
# [1] Probability that a taxel of a skin with noise sends one number in all frames, below which it is dead.
# Larger: a live taxel may count as dead.
MAX_DEAD_PROBABILITY = 1e-6

# Standard normal distribution for interpolation; the error of the interpolation is below 1e-6.
GRID = np.linspace(-8.0, 8.0, 3201)
BELOW = np.array([0.5 * math.erfc(-x / math.sqrt(2)) for x in GRID.tolist()])


@dataclass(frozen=True, eq=False)
class AtRest:
    """Signed readings of the taxels without contact, and their distribution before rounding and clipping."""

    rows: Array  # (frames, n); 0 for a taxel without readings
    step: float  # of the converter
    mean: Array  # (n,)
    spread: Array  # (n,) standard deviation
    clipped: Array  # (n,) fraction of the readings that are clipped at the lowest level
    dead: BoolArray  # (n,) whether the taxel sends one number, although others change, or none

    @classmethod
    def of(cls, rows: Array, sign: Array, is_whole: bool) -> "AtRest | None":
        """Return what readings (frames, n) show; None if they are too few, or none of them changes.

        A reading is NaN where a taxel has none. ``is_whole`` is whether the converter sends whole numbers.
        """
        finite = np.isfinite(rows)
        present = finite.any(axis=0)
        rows = rows[finite[:, present].all(axis=1)] * sign
        step = step_of(rows[:, present], is_whole)
        if len(rows) < MIN_FRAMES or step is None or not present.any():
            return None
        rows = np.where(present, rows, 0.0)
        mean, spread, clipped, is_constant = _normal(rows, step)
        dead = is_constant | ~present
        return None if dead.all() else cls(rows, step, mean, spread, clipped, dead)

    @cached_property
    def sigma(self) -> Array:
        """Standard deviation (n,) with the rounding, whose error is uniform over a step: its variance is q^2 / 12."""
        return np.sqrt(self.spread**2 + self.step**2 / 12)

    @cached_property
    def unit(self) -> Array:
        """Readings (frames, n) with the mean 0 and the standard deviation 1."""
        rows = self.rows
        return (rows - rows.mean(axis=0)) / np.maximum(rows.std(axis=0), MIN_SIGMA * self.step)

    @cached_property
    def later_correlation(self) -> float:
        """Correlation of successive readings, the mean of the live taxels; at least 0."""
        return max(float((self.unit[1:] * self.unit[:-1])[:, ~self.dead].mean()), 0.0)

    @cached_property
    def independent_frames(self) -> float:
        """Number of independent frames that give as good a standard deviation."""
        square = self.later_correlation**2
        return len(self.rows) * (1 - square) / (1 + square)

    @cached_property
    def freedom(self) -> Array:
        """Degrees of freedom (n,) of the standard deviations; the fit of clipped taxels also uses the other ones."""
        own = np.maximum(self.independent_frames * (1 - self.clipped), 1.0)
        return own + np.where(self.clipped > 0, POOLED_FRAMES / 2, 0.0)

    @cached_property
    def repeat_probabilities(self) -> tuple[Array, Array]:
        """Largest probability (n,) of one number: of those above the lowest level, and of all.

        An active taxel is not at the lowest level, however often it is there at rest.
        """
        centred = 1 - 2 * np.interp(-self.step / 2 / self.spread, GRID, BELOW)  # of a number at the mean
        most = np.maximum(centred, _most(self.rows))
        return np.where(self.clipped > 0, centred, most), most


def step_of(rows: Array, is_whole: bool) -> float | None:
    """Return the step of a converter: 1, or the least difference of readings (frames, n); None if they never differ."""
    if is_whole:
        return 1.0
    values = np.unique(rows)
    gaps = np.diff(values)
    return float(gaps[gaps > MIN_STEP_FRACTION * np.ptp(values)].min()) if len(gaps) else None


def _most(rows: Array) -> Array:
    """Return the fraction (n,) of the rows (frames, n) that have the most frequent number of each taxel."""
    rows = np.sort(rows, axis=0)
    run, longest = np.ones(rows.shape[1]), np.ones(rows.shape[1])
    for below, above in zip(rows[:-1], rows[1:]):
        run = np.where(above == below, run + 1, 1.0)
        longest = np.maximum(longest, run)
    return longest / len(rows)


def _normal(rows: Array, step: float) -> tuple[Array, Array, Array, BoolArray]:
    """Return mean and standard deviation (n,) before rounding and clipping, and the fraction at the lowest level.

    Taxels that are not clipped have the mean and the standard deviation of their readings. The last result is whether
    a taxel sends one number, although others change too much for that.
    """
    frames, n = rows.shape
    low = rows.min(axis=0)
    width = np.maximum(step, (rows.max(axis=0) - low) / LEVELS)
    level: IntArray = np.rint((rows - low) / width).astype(np.int64)
    counts = np.zeros((int(level.max()) + 1, n))
    np.add.at(counts, (level, np.arange(n)), 1.0)
    pooled = counts[:, width == step].sum(axis=1, keepdims=True)
    most = 1.0
    if pooled.any():
        pooled /= pooled.sum()
        most = float(pooled.max())
    constant = (low == rows.max(axis=0)) & (frames * math.log(most) < math.log(MAX_DEAD_PROBABILITY))
    clipped = counts[0] / frames
    mean = rows.mean(axis=0)
    spread = np.sqrt(np.maximum(rows.var(axis=0, ddof=1) - step**2 / 12, 0.0))
    chosen = (clipped > MIN_CLIPPED) & (counts[0] >= MIN_PILE * np.append(counts, np.zeros((1, n)), axis=0)[1])
    if chosen.any():
        pooled = counts[:, chosen & (width == step)].sum(axis=1, keepdims=True)
        pooled /= max(pooled.sum(), 1.0)
        of_all = _censored(pooled, *_moments(pooled), POOLED_ITERATIONS) if pooled.any() else None
        mixed = counts[:, chosen]
        start = _moments(mixed)
        if of_all is not None:
            similar = width[chosen] == step
            mixed = mixed + np.where(similar, POOLED_FRAMES * pooled, 0.0)
            start = tuple(np.where(similar, one, each) for one, each in zip(of_all, start))  # type: ignore[assignment]
        middle, deviation = _censored(mixed, *start, TAXEL_ITERATIONS)
        mean[chosen] = low[chosen] + width[chosen] * middle
        spread[chosen] = width[chosen] * deviation
    return mean, np.maximum(spread, MIN_SIGMA * step), np.where(chosen, clipped, 0.0), constant


def _moments(counts: Array) -> tuple[Array, Array]:
    """Return mean and standard deviation (n,) of histograms (levels, n), in levels, where the fit starts."""
    level = np.arange(len(counts))[:, None]
    mean = (counts * level).sum(axis=0) / counts.sum(axis=0)
    return mean, np.sqrt((counts * (level - mean) ** 2).sum(axis=0) / counts.sum(axis=0) + 1 / 12)


def _censored(counts: Array, mean: Array, sigma: Array, iterations: int) -> tuple[Array, Array]:
    """Return mean and standard deviation (n,) of normal variables, of which only histograms are known, in levels.

    Level k is the interval from k - 1/2 to k + 1/2; the lowest one has no lower end. The likelihood increases with each
    iteration (expectation and maximization, Dempster et al. 1977).
    """
    edges = np.arange(1, len(counts))[:, None] - 0.5
    fractions = counts / counts.sum(axis=0)
    zero = np.zeros((1, counts.shape[1]))
    for _ in range(iterations):
        z = np.clip((edges - mean) / sigma, -8.0, 8.0)
        below = np.concatenate((zero, np.interp(z, GRID, BELOW), zero + 1))
        density = np.exp(-z * z / 2) / math.sqrt(2 * math.pi)
        inside = np.maximum(np.diff(below, axis=0), 1e-12)
        first = -np.diff(np.concatenate((zero, density, zero)), axis=0) / inside  # of z in each interval
        second = 1 - np.diff(np.concatenate((zero, z * density, zero)), axis=0) / inside
        shift = (fractions * first).sum(axis=0)
        square = (fractions * second).sum(axis=0) - shift**2
        mean, sigma = mean + sigma * shift, sigma * np.sqrt(np.maximum(square, 1e-4))
    return mean, sigma
