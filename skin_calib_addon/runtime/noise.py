"""Learn the noise of a skin from readings without contact, and derive from it what a reading can prove.

Thresholds follow from stated probabilities of an error. :mod:`.at_rest` has the distribution of the readings.
"""

import math
from dataclasses import dataclass, replace
from functools import cached_property
from statistics import NormalDist
from typing import TYPE_CHECKING

import numpy as np

from ..common.arrays import Array, BoolArray, IntArray, lock, locked, some
from .at_rest import BELOW, GRID, AtRest

if TYPE_CHECKING:
    from ..calibration.taxel_responses import TaxelResponses

# [1] Probability that noise makes a free taxel count as surely touched, for all taxels of a frame together: one half by
# one frame, one half by three. Larger: guaranteed polygons are larger, and wrong more often.
MAX_FALSE_SURE = 3e-4
# [1] Probability that noise alone makes the sum of a frame count as a load. Larger: lighter feet stand, and feet in the
# air stand more often.
MAX_FALSE_LOAD = 2e-4
# [1] Probability that noise makes two free neighbours a contact, for all pairs of a frame together.
# Larger: weaker contacts are found, and contacts of noise.
MAX_FALSE_PAIR = 1e-4
# [standard deviations] Reading from which on a taxel is possibly touched. Larger: fewer free taxels are in the outer
# polygon, and the detection limit is higher.
POSSIBLE = 2.4
# [standard deviations] Margin of the detection limit over this threshold. Larger: a weak contact is missed less often,
# and the limit is higher. 3.2: once in 1500.
LIMIT_MARGIN = 3.2
# [1] Probability that the outer polygon contains a taxel at its detection limit, and that no free taxel counts as
# surely touched. Derived: from the thresholds above.
OUTER_PROBABILITY = NormalDist().cdf(LIMIT_MARGIN)
GUARANTEED_PROBABILITY = 1 - MAX_FALSE_SURE
# [standard deviations] Limit of the sum of all taxels, as a multiple of its noise. Larger: a lighter load is not
# promised.
LOAD_LIMIT = 7.0
# [standard deviations] Reading down to which a taxel stays in its contact. Larger: contacts flicker more.
RELEASE = 1.5
# [standard deviations] Reading up to which the weight of a taxel in the sums is 0. Larger: weak contacts are missing in
# the sums; smaller: the noise of free taxels is in them.
WEIGHT_START = 1.0
# [standard deviations] Reading from which on this weight is 1. Larger: weak contacts count less in the sums.
WEIGHT_FULL = 3.0
# [1] Load of the taxels with little weight, relative to that of the others, from which on they count, and count fully.
# Larger: light feet seem lighter; smaller: noise of free taxels is in the CoP of heavy ones.
HIDDEN_LOAD = (0.1, 0.3)
# [s] Time constant of the baseline of free taxels. Larger: the baseline is behind a fast drift; smaller: loads that
# grow faster count as drift.
TRACKING_TIME = 10.0
# [standard deviations] Mean of the free taxels that is a drift. Larger: more false contacts before it is reported;
# smaller: light contacts are reported as drift.
MAX_DRIFT = 0.3
# [standard deviations] Largest deviation that a drift gives all taxels. Larger: feet with a larger even load do not
# differ from a drift; smaller: a larger drift makes guaranteed polygons wrong.
MAX_COMMON = 5.0
# [standard deviations] Lowest quarter of independent readings at rest. Derived: from the normal distribution.
QUARTER = NormalDist().inv_cdf(0.25)
# [1] Probability of a largest reading at rest, below which the noise is not normal. Larger: more skins count as such.
MIN_TAIL_PROBABILITY = 0.01
# [largest reading at rest] Thresholds of such skins. Smaller: rare spikes count as contacts.
TAIL_FACTOR = 2.0
# [1] Probability that noise repeats one number, or one frame, below which it is a fault. Larger: a fault is reported
# earlier, and chance as a fault.
MAX_REPEAT_PROBABILITY = 1e-8
# [s] Longest time between two readings of the electronics; faster controllers see a reading several times.
# Larger: a frozen bus is reported later; smaller: slow electronics are reported as frozen.
MAX_READING_PERIOD = 0.02
# [distances from rest to surely touched] Depth of a reading below rest from which on it is a fault. Larger: a fault is
# found only if it is deeper; smaller: tails of the noise are reported.
BELOW_REST = 2.0


@dataclass(frozen=True, eq=False)
class Noise:
    """The noise of each taxel, and the thresholds that follow from it.

    Levels are signed readings: they rise with the force. A taxel is above a level if its signed reading is larger.
    """

    mean: Array  # (n,) signed reading at rest
    sigma: Array  # (n,) standard deviation of a signed reading, with the rounding to steps
    dead: BoolArray  # (n,) whether the taxel did not change at rest, as others did, or had no finite reading
    sign: Array  # (n,) 1 where readings rise with the force, -1 where they fall
    sure: Array  # (n,) level above which a taxel is surely touched
    lasting: Array  # (n,) level above which it is surely touched if it is so in three new frames in a row
    pair: Array  # (n,) level above which a taxel is in a contact if a neighbour is
    possible: Array  # (n,) level above which a taxel is possibly touched
    release: Array  # (n,) level down to which it stays in its contact
    lowest: Array  # (n,) level below which noise does not go
    repeats: Array  # (n,) number of equal readings in a row that are no chance; infinite if noise proves none
    frame_repeats: float  # number of equal frames in a row that are no chance
    slopes: Array  # (n,) force per reading near rest [N]
    free: Array  # (n,) mean signed reading at rest, after clipping
    free_sum: float  # its sum, weighted by the slopes [N]
    load_level: float  # sum above it by which there is a load [N]
    common: float  # standard deviation of the sum, as a multiple of that of independent taxels; at least 1
    rectified: Array  # (n,) force that the noise of a free taxel would add to the sums, over the mean of 1 - weight [N]
    clip: Array  # (n,) signed reading to which lower ones are clipped; minus infinity if none are
    below_clip: Array  # (n,) mean force near rest of the readings that it hides, negative [N]
    detection_limits: Array  # (n,) force from which on the outer polygon contains a taxel [N]
    load_limit: float  # force from which on the sum of all taxels is a load [N]

    @property
    def load_sigma(self) -> float:
        """Standard deviation of the sum of all taxels at rest [N]."""
        return self.load_limit / LOAD_LIMIT

    @property
    def rate_limits(self) -> Array:
        """Rates (n,) of the force of one taxel up to which a load counts as drift [N/s]."""
        return locked(POSSIBLE * self.sigma * self.slopes / TRACKING_TIME)

    @property
    def load_rate_limit(self) -> float:
        """Rate of the sum of all taxels up to which a load counts as drift [N/s]."""
        return self.load_level / TRACKING_TIME

    def __post_init__(self) -> None:
        lock(*vars(self).values())

    def moved(self, change: Array) -> "Noise":
        """Return the noise after the signed readings at rest changed by (n,)."""
        of_readings = ("mean", "sure", "lasting", "pair", "possible", "release", "lowest", "free", "clip")
        moved = {name: getattr(self, name) + change for name in of_readings}
        return replace(self, **moved, free_sum=self.free_sum + float(change.dot(self.slopes)))

    def signed(self, intensities: Array) -> Array:
        """Return signed readings (n,), which rise with the force; the same array if all readings do."""
        return intensities if self._rises else intensities * self.sign

    def excess(self, signed: Array) -> Array:
        """Return the sums (...) of the forces near rest of signed readings (..., n), without their mean [N].

        A sum may be negative.
        """
        return signed.dot(self.slopes) - self.free_sum

    def pushes(self, signed: Array, forces: Array, excess: Array) -> tuple[Array, Array]:
        r"""Return the weight (..., n) of each taxel in sums, and its part of them (..., n) [N].

        The weight is 0 near rest and 1 for clear contacts, with a smooth step. A light foot on flat ground has all of
        its load below the noise of single taxels. The more of the load is there, the more all taxels count.

        Forces and weights are never negative, so that the noise of free taxels would add up in the sums. A taxel with
        the weight w and the force f therefore counts with

        .. math:: w f - (1 - w)\, r , \qquad r = \frac{E[w f]}{E[1 - w]} \text{ at rest,}

        which is zero on average without contact, and f for clear contacts. Where all taxels count, forces near rest may
        be negative.

        Parameters
        ----------
        signed, forces : array, shape (..., n)
            Signed readings, and the forces that follow from them [N].
        excess : array, shape (...)
            Result of :meth:`excess` [N].
        """
        weights = self.steps(signed)
        clear = self.clear(weights, signed)
        start, full = HIDDEN_LOAD
        few = excess > (1 + start) * clear
        if some(few):
            with np.errstate(divide="ignore", invalid="ignore"):
                hidden = np.minimum((excess[few] / clear[few] - 1 - start) / (full - start), 1.0)
            hidden = np.where(clear[few] > 0, hidden, 1.0)
            weights[few] += hidden[:, None] * (1 - weights[few])
            forces = forces.copy()
            forces[few] += self.negative(signed[few])
        pushes = forces + self.rectified
        pushes *= weights
        pushes -= self.rectified
        return weights, pushes

    def clear(self, weights: Array, signed: Array) -> Array:
        """Return the load of the taxels that are clear of the noise [N], zero on average without contact.

        Parameters
        ----------
        weights, signed : array, shape (..., n)
            Results of :meth:`steps`, and signed readings.
        """
        offsets, total = self._clear_terms
        return (weights * signed).dot(self.slopes) + weights.dot(offsets) - total

    def negative(self, signed: Array) -> Array:
        """Return how far the forces near rest of signed readings (..., n) are below zero [N]; 0 above.

        A clipped reading counts with the mean of what the clipping hides, so that the mean of a free taxel is zero.
        """
        below = np.where(signed <= self.clip, self.below_clip, (signed - self.mean) * self.slopes)
        return np.minimum(below, 0.0, out=below)

    def common_deviation(self, signed: Array, known: BoolArray | None) -> float:
        """Return how far a drift may have raised all readings (n,), at most :data:`MAX_COMMON` [standard deviations].

        A contact raises some of them further: the lowest quarter is a limit.

        Parameters
        ----------
        signed : array, shape (n,)
            Signed readings.
        known : array of bool, shape (n,)
            Which of them count; None: all.
        """
        low, high, scale, offset = self._common_levels
        if known is not None:
            signed, low, high, scale, offset = (values[known] for values in (signed, low, high, scale, offset))
        count = quarter(len(signed))
        if np.count_nonzero(signed <= low) >= count:
            return 0.0
        if np.count_nonzero(signed <= high) < count:
            return MAX_COMMON
        return min(max(lowest_quarter(signed * scale + offset), 0.0), MAX_COMMON)

    @cached_property
    def largest_drift(self) -> float:
        """Load that a drift of all taxels by :data:`MAX_COMMON` shows [N]."""
        return MAX_COMMON * float(self.sigma @ self.slopes)

    @cached_property
    def _common_levels(self) -> tuple[Array, Array, Array, Array]:
        """Signed readings (n,) up to which nothing is raised, and from which on all are by the maximum.

        Factor and summand (n,) that map readings to the deviation.
        """
        rest = QUARTER + MAX_DRIFT
        low = self.mean + rest * self.sigma
        high = low + MAX_COMMON * self.sigma
        return np.maximum(low, self.clip), high, 1 / self.sigma, -self.mean / self.sigma - rest

    @cached_property
    def levels(self) -> Array:
        """The levels ``sure``, ``pair``, ``release``, ``lasting`` and ``possible``, (5, n)."""
        return locked(np.stack((self.sure, self.pair, self.release, self.lasting, self.possible)))

    @cached_property
    def sides(self) -> Array:
        """Readings (2, n) a standard deviation below and above zero."""
        return locked(np.stack((-self.sigma, self.sigma)))

    @cached_property
    def _rises(self) -> bool:
        """Whether the readings of all taxels rise with the force."""
        return bool((self.sign > 0).all())

    @cached_property
    def min_repeats(self) -> float:
        """Smallest of ``repeats``."""
        return float(self.repeats.min(initial=math.inf))

    @cached_property
    def has_dead(self) -> bool:
        """Whether a taxel is dead."""
        return bool(self.dead.any())

    @cached_property
    def _clear_terms(self) -> tuple[Array, float]:
        """Offsets (n,) that the weights multiply in :meth:`clear`, and the sum that is subtracted [N]."""
        return self.rectified - self.free * self.slopes, float(self.rectified.sum())

    @cached_property
    def _step_line(self) -> tuple[Array, Array]:
        """Factor and summand (n,) that map signed readings to 0 at the start of the step and 1 at its end."""
        scale = 1 / (self.sigma * (WEIGHT_FULL - WEIGHT_START))
        return scale, -self.mean * scale - WEIGHT_START / (WEIGHT_FULL - WEIGHT_START)

    def steps(self, signed: Array) -> Array:
        """Return the smooth step (..., n) of signed readings (..., n) from 0 near rest to 1 for clear contacts."""
        scale, offset = self._step_line
        step = signed * scale
        step += offset
        return _smooth(step)


def quarter(count: int) -> int:
    """Return a quarter of a number, at least 1."""
    return max(count // 4, 1)


def lowest_quarter(numbers: Array) -> float:
    """Return the number that a quarter of some (n,) do not exceed."""
    k = quarter(len(numbers)) - 1
    return float(np.partition(numbers, k)[k])


def _smooth(step: Array) -> Array:
    """Return the smooth step of numbers (...): 0 up to 0, 1 from 1 on. The numbers are overwritten."""
    np.maximum(step, 0.0, out=step)
    np.minimum(step, 1.0, out=step)
    square = step * step
    step *= -2
    step += 3
    square *= step
    return square


def learned(rows: Array, responses: "TaxelResponses", pairs: IntArray, is_whole: bool) -> Noise | None:
    """Return the noise of readings at rest; None if they say nothing about it.

    Parameters
    ----------
    rows : array, shape (frames, n)
        Readings of the taxels without contact; NaN where a taxel has none.
    responses : TaxelResponses
        Of the taxels.
    pairs : array, shape (e, 2)
        Rows of neighbours.
    is_whole : bool
        Whether the converter sends whole numbers.
    """
    rest = AtRest.of(rows, responses.sign, is_whole)
    if rest is None:
        return None
    mean, sigma = rest.mean, rest.sigma
    sure, lasting, pair = _levels(rest, pairs)
    repeats, frame_repeats = _repeats(rest)
    slopes = _slopes(rest, responses)
    sums = rest.rows @ slopes
    common = _common(rest, slopes, sums)
    # the reading has to pass the threshold by less than a step, half of which rounding may take
    limits = POSSIBLE * sigma + rest.step / 2 + LIMIT_MARGIN * rest.spread
    return Noise(
        mean=mean,
        sigma=sigma,
        dead=rest.dead,
        sign=responses.sign,
        sure=sure,
        lasting=lasting,
        pair=pair,
        possible=mean + POSSIBLE * sigma,
        release=mean + RELEASE * sigma,
        lowest=mean - BELOW_REST * (sure - mean),
        repeats=repeats,
        frame_repeats=frame_repeats,
        slopes=slopes,
        free=rest.rows.mean(axis=0),
        free_sum=float(sums.mean()),
        load_level=max(_load_level(rest, sums), rest.step * float(slopes.max())),  # a step is no load
        common=common,
        rectified=_rectified(rest, slopes),
        clip=np.where(rest.clipped > 0, rest.rows.min(axis=0), -np.inf),
        below_clip=_below_clip(rest, slopes),
        detection_limits=responses.forces(responses.rest + responses.sign * limits),
        load_limit=LOAD_LIMIT * common * float(np.linalg.norm(slopes * sigma)),
    )


def _levels(rest: AtRest, pairs: IntArray) -> tuple[Array, Array, Array]:
    """Return the levels ``sure``, ``lasting`` and ``pair`` (n,) of :class:`Noise` from the allowed probabilities.

    A level is a quantile of Student's distribution, half a step higher because of the rounding. Where the largest
    reading at rest is too large for normal noise, it bounds the levels.
    """
    mean, spread, step, is_live = rest.mean, rest.spread, rest.step, ~rest.dead
    false_sure = MAX_FALSE_SURE / 2 / int(np.count_nonzero(is_live))
    first, second = rest.unit.T[pairs.T]
    alike = float((first * second).mean()) if len(pairs) else 0.0  # correlation of neighbours

    def level(quantile: float) -> Array:
        return mean + step / 2 + spread * student(quantile, rest.freedom)

    sure = level(NormalDist().inv_cdf(1 - false_sure))
    three = joint_quantile(false_sure, rest.later_correlation, 3)
    pair = level(joint_quantile(MAX_FALSE_PAIR / max(len(pairs), 1), alike, 2))
    above = ((rest.rows - mean - step / 2) / spread)[:, is_live]
    largest = float(above.max())
    if largest > NormalDist().inv_cdf(1 - MIN_TAIL_PROBABILITY / above.size):
        guard = mean + step / 2 + TAIL_FACTOR * largest * spread
        sure, pair = np.maximum(sure, guard), np.maximum(pair, guard)
        three = max(three, float(np.quantile(above, NormalDist().cdf(three))))
    return sure, level(three), pair


def _repeats(rest: AtRest) -> tuple[Array, float]:
    """Return the numbers of equal readings (n,), and of equal frames, that are no chance: ``log P / log p``."""
    of_one, of_all = (np.log(np.where(rest.dead, 1.0, p)) for p in rest.repeat_probabilities)
    with np.errstate(divide="ignore"):
        repeats, of_frames = (-math.log(MAX_REPEAT_PROBABILITY) / np.abs(x) for x in (of_one, of_all.sum()))
    return repeats, float(of_frames)


def _slopes(rest: AtRest, responses: "TaxelResponses") -> Array:
    """Return the forces per reading (n,) near rest: the mean slope over four standard deviations [N]."""
    start, width = responses.rest, 4 * rest.sigma
    end = start + 4 * responses.sign * rest.sigma
    rise = np.where(rest.dead, 0.0, responses.forces(end) - responses.forces(start))
    return np.nan_to_num(rise / width)


def _load_level(rest: AtRest, sums: Array) -> float:
    """Return the level of the sum of all taxels above its mean (frames,) that is a load [N].

    A quantile of Student's distribution, with the first term of Cornish and Fisher (1938) for skewed noise.
    """
    deviations = sums - sums.mean()
    deviation = float(deviations.std(ddof=1))
    skewness = float((deviations**3).mean()) / deviation**3 if deviation else 0.0
    freedom = np.array(max(rest.independent_frames - 1, 1.0))
    k = float(student(NormalDist().inv_cdf(1 - MAX_FALSE_LOAD), freedom))
    return (k + (k * k - 1) * max(skewness, 0.0) / 6) * deviation


def _common(rest: AtRest, slopes: Array, sums: Array) -> float:
    """Return the standard deviation of the sum (frames,), relative to that of taxels without common noise."""
    if_alone = float(np.linalg.norm(slopes * rest.rows.std(axis=0, ddof=1)))
    has_sum = if_alone > 1e-9 * float(np.linalg.norm(slopes * rest.sigma))  # otherwise rounding
    return max(1.0, float((sums - sums.mean()).std(ddof=1)) / if_alone) if has_sum else 1.0


def _rectified(rest: AtRest, slopes: Array) -> Array:
    """Return the force (n,) that the weights let pass at rest, over the mean of 1 - weight [N]; see ``pushes``."""
    deviations, amplitudes = (rest.rows - rest.mean) / rest.sigma, rest.sigma * slopes
    weights = _smooth((deviations - WEIGHT_START) / (WEIGHT_FULL - WEIGHT_START))
    passes, leaves_out = (weights * deviations) @ amplitudes, (1 - weights) @ amplitudes
    return amplitudes * (passes.sum() / max(float(leaves_out.sum()), np.finfo(float).tiny))


def _below_clip(rest: AtRest, slopes: Array) -> Array:
    """Return the mean force (n,) of the readings that the clipping hides, near rest [N].

    The mean of a taxel after the clipping is higher by the fraction of clipped readings, times what each of them lost.
    """
    low, free = rest.rows.min(axis=0), rest.rows.mean(axis=0)
    hidden = low - rest.mean - (free - rest.mean) / (rest.rows == low).mean(axis=0)
    return np.minimum(hidden * slopes, 0.0)


def student(normal: float, freedom: Array) -> Array:
    """Return quantiles (n,) of Student's distribution (Abramowitz and Stegun 26.7.5).

    A deviation in units of an estimated standard deviation has this distribution: it needs a higher threshold.

    Parameters
    ----------
    normal : float
        The quantile of the normal distribution.
    freedom : array, shape (n,)
        Degrees of freedom of the estimates.
    """
    z, v = normal, freedom
    first = (z**3 + z) / 4
    second = (5 * z**5 + 16 * z**3 + 3 * z) / 96
    third = (3 * z**7 + 19 * z**5 + 17 * z**3 - 15 * z) / 384
    return z + first / v + second / v**2 + third / v**3


def joint_quantile(probability: float, correlation: float, count: int) -> float:
    r"""Return the level that all of a few normal variables exceed with a probability.

    With noise u that is common to all k, and given its value, they are independent:

    .. math::
        P = \int \varphi(u)\, Q\!\left( \frac{t - \sqrt{c}\, u}{\sqrt{1 - c}} \right)^k \mathrm{d}u .

    Parameters
    ----------
    probability : float
        Less than that at the level 0.
    correlation : float
        Correlation c of each two; below 0 it counts as 0.
    count : int
        Number k of the variables.
    """
    u, levels = GRID[::20], GRID[GRID >= 0][::20]
    width = float(u[1] - u[0])  # of a step of the sum
    own = max(math.sqrt(1 - max(correlation, 0.0)), width)
    above = np.interp((math.sqrt(max(correlation, 0.0)) * u - levels[:, None]) / own, GRID, BELOW)
    every = (above**count @ np.exp(-u * u / 2)) * width / math.sqrt(2 * math.pi)
    return float(np.interp(-math.log(probability), -np.log(every), levels))
