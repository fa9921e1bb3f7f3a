"""Decide which readings are those of a skin without contact, for a tare and for noise that a skin learns by itself."""

import math
from typing import TYPE_CHECKING

import numpy as np

from ..common.arrays import Array, BoolArray
from .at_rest import MIN_FRAMES, step_of

if TYPE_CHECKING:
    from ..calibration.taxel_responses import TaxelResponses

# [reading] A larger reading is left out of the baseline: the sum of several would overflow. Derived: from the range
# of double-precision numbers.
MAX_READING = 1e100
# [standard deviations of a mean] Difference of two halves of a rest from which on it is none. Larger: slow contacts at
# the start count as rest; smaller: a rest is refused by chance.
MAX_QUIET_SHIFT = 4.0
# [standard deviations] Largest deviation of a reading from the median at rest. Larger: taps at the start count as rest;
# smaller: noise with rare large values is not learned without a tare.
MAX_QUIET_PEAK = 6.0
# [1] Mean square of the differences of successive readings at rest, relative to that of independent readings; also of
# one taxel, relative to the median. Larger: correlated noise is not learned without a tare; smaller: slow contacts at
# the start count as rest.
MIN_QUIET_CHANGE = 0.25
# [reading] Standard deviation of a taxel that never changes, in the division by it. Derived: from double precision.
MIN_SPREAD = 1e-12
# [s] Shortest rest before a tare from which noise is learned. Larger: the skin is without statements for longer.
MIN_REST = 0.5
# [s] Time without drift after a contact, which shows that the first quiet frames were without load. It is above the
# time after which a drift is reported. Larger: nothing is guaranteed for longer.
LIFT_TIME = 2.0
# [s] Shortest period of the frames that are stored for it. Larger: fewer frames of a fast skin are stored.
REST_PERIOD = 0.0035
# [frames] Number of stored frames that ends the rest. Larger: better estimates, later.
MAX_FRAMES = 250
# [frames] Fewer frames do not show whether a tare is at rest. Larger: contacts during a short tare are not found.
MIN_TARE_FRAMES = 8
# [frames] Length of the running median that leaves out single large values of a tare. Larger: short taps are not found.
TAP_FRAMES = 5
# [standard deviations] Range of a taxel during a tare from which on it is a contact. Larger: weaker contacts are not
# found; smaller: noise of many taxels is refused.
MAX_TARE_RANGE = 18.0
# [1] Largest correlation of successive readings that noise is assumed to have. Larger: slow contacts on few taxels are
# not found; smaller: the noise of slow filters is refused.
MAX_CORRELATION = 0.98
# [1] Mean square of second differences over that of first ones, each over its value for white noise, below which the
# readings of most taxels are smoother than noise with any correlation, whose value is 2/3.
MIN_ROUGHNESS = 0.65
# [1] Range of the sum of such taxels over that of independent ones, from which on a load moves them together.
# Larger: loads on few taxels are not found; smaller: the noise of filters is refused.
MAX_COMMON_RANGE = 3.0


class Rest:
    """Keep the first frames of a skin, until they show that the skin is free, and how its readings scatter."""

    def __init__(self) -> None:
        self._rows: list[Array] = []
        self._times: list[float] = []
        self._next = MIN_FRAMES

    def add(self, raw: Array, time: float) -> Array | None:
        """Store the readings (n,) of a frame; return all stored ones (frames, n) when it is time to look at them."""
        if self._times and time - self._times[-1] < REST_PERIOD:
            return None
        self._rows.append(raw)
        self._times.append(time)
        if len(self._rows) < self._next or time - self._times[0] < MIN_REST:
            return None
        self._next = min(2 * len(self._rows), MAX_FRAMES) if len(self._rows) < MAX_FRAMES else MAX_FRAMES + 1
        return np.array(self._rows)

    @property
    def is_complete(self) -> bool:
        """Whether enough frames are stored."""
        return len(self._rows) >= MAX_FRAMES

    def clear(self) -> None:
        """Drop all frames: the skin was not free."""
        self._rows, self._times, self._next = [], [], MIN_FRAMES


class Assumed:
    """Whether the noise is that of first quiet frames, in which a light even load cannot be seen: until a lift."""

    def __init__(self) -> None:
        self.is_assumed = False
        self._was_touched, self._free_since = False, math.inf

    def begin(self) -> None:
        """Assume the rest of the first frames."""
        self.is_assumed, self._was_touched, self._free_since = True, False, math.inf

    def end(self) -> None:
        """Know the rest."""
        self.is_assumed = False

    def add(self, is_touched: bool, is_right: bool, time: float) -> None:
        """Add a frame: after a contact, the skin is at this rest again, and the rest is right (or not), for a time."""
        self._was_touched |= is_touched
        if not (self._was_touched and not is_touched and is_right):
            self._free_since = math.inf
        elif time - self._free_since >= LIFT_TIME:
            self.end()
        else:
            self._free_since = min(self._free_since, time)


def contacts_during(rows: Array, responses: "TaxelResponses", is_whole: bool) -> Array:
    """Return the force of a contact on each taxel (n,) during readings (frames, n) for a tare, 0 without one [N].

    A contact lasts for some frames and changes a reading by far more than its noise, which the differences of
    successive readings show. Their second differences show how far the noise is correlated. A constant force counts as
    an offset.
    """
    finite = np.isfinite(rows)
    sums = np.where(finite, rows, 0.0).sum(axis=0)
    rows = np.where(finite, rows, sums / np.maximum(finite.sum(axis=0), 1))
    if len(rows) < MIN_TARE_FRAMES or not rows.size:
        return np.zeros(rows.shape[1])
    change = np.abs(np.diff(rows, axis=0)).mean(axis=0)
    bend = np.abs(np.diff(rows, 2, axis=0)).mean(axis=0)
    is_live = change > 0
    often = float(np.median(np.count_nonzero(np.diff(rows, axis=0), axis=0)))
    rarely = (len(rows) - 1) / often if often >= MIN_TARE_FRAMES else 1.0  # frames repeat, taxels send in turn
    roughness = float(np.median((bend[is_live] / change[is_live]) ** 2)) / 3 if is_live.any() else 1.0
    correlation = np.clip(3 * (1 - roughness), 0.0, MAX_CORRELATION)  # of successive readings
    sigma = np.sqrt(np.pi) / 2 * np.maximum(change, np.median(change)) * rarely / np.sqrt(1 - correlation)
    sigma = np.maximum(sigma, (step_of(rows, is_whole) or 0.0) / np.sqrt(12))
    lasting = np.median(np.lib.stride_tricks.sliding_window_view(rows, TAP_FRAMES, axis=0), axis=-1)
    spans = np.ptp(lasting, axis=0)
    is_pressed: BoolArray = spans > MAX_TARE_RANGE * sigma
    if roughness < MIN_ROUGHNESS and np.ptp(lasting.sum(axis=1)) > MAX_COMMON_RANGE * np.linalg.norm(spans):
        is_pressed |= is_live
    return np.where(is_pressed, responses.forces(responses.rest + responses.sign * spans), 0.0)


def is_rest(rows: Array, is_whole: bool) -> bool:
    """Return whether readings (frames, n) are those of a skin at rest, as far as their changes can show it.

    The mean of each taxel is the same in both halves. No reading is far from the others, as in a tap. Successive
    readings differ as noise does, not as in a slow push. Their mean is a matter of :func:`.judged`.
    """
    if not (rows.size and (np.abs(rows) < MAX_READING).all()):
        return False
    floor = 1.0 if is_whole else MIN_SPREAD
    steps, variance = np.diff(rows, axis=0), rows.var(axis=0, ddof=1)
    changes = (steps**2).mean(axis=0) / (2 * np.maximum(variance, MIN_SPREAD))
    # 1 less the correlation of successive readings; independent ones give less by chance
    change = min(float(np.median(changes)) * (1 + 2 / len(rows) ** 0.5), 1.0)
    is_noise = (variance <= floor**2) | ((changes >= MIN_QUIET_CHANGE * change) & (change >= MIN_QUIET_CHANGE))
    spread = np.maximum(np.sqrt(variance), np.abs(steps).max(axis=0) / 4)
    return bool(
        is_noise.all() and _has_no_peak(rows, floor) and _is_steady(rows, np.maximum(spread, MIN_SPREAD), change)
    )


def _has_no_peak(rows: Array, floor: float) -> bool:
    """Return whether no reading (frames, n) is far from the median of its taxel, in deviations above ``floor``."""
    # of the middle two thirds, which a short contact does not change
    low, middle, high = np.quantile(rows, (0.16, 0.5, 0.84), axis=0)
    sigma = np.maximum(np.maximum(high - middle, middle - low), floor)
    sigma = np.maximum(sigma, np.median(sigma))  # of few frames, the estimate of one taxel can be small by chance
    return bool((np.abs(rows - middle).max(axis=0) <= MAX_QUIET_PEAK * sigma).all())


def _is_steady(rows: Array, spread: Array, change: float) -> bool:
    """Return whether each taxel, and all together, have the same mean in both halves.

    ``change`` is 1 less the correlation of successive readings, of which the deviation of a mean depends.
    """
    half = len(rows) // 2
    shifts = (rows[half:].mean(axis=0) - rows[:half].mean(axis=0)) / spread
    total = shifts.sum() / max(len(shifts), 1) ** 0.5  # many taxels that change together, each by little
    of_mean = ((2 - change) / max(change, MIN_QUIET_CHANGE) / half) ** 0.5  # standard deviation, correlated
    return bool((np.abs(np.append(shifts, total)) <= MAX_QUIET_SHIFT * 2**0.5 * of_mean).all())
