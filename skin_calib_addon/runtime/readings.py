"""Turn readings of the electronics into forces on the taxels, and find readings that cannot be trusted."""

import math
from collections.abc import Mapping
from copy import copy
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ..common.arrays import Array, BoolArray, IntArray, lock, unmasked
from ..common.errors import InvalidReading
from .byte_order import ByteOrder
from .creep import Creep
from .drift import Drift
from .geometry import SkinGeometry
from .noise import Noise, learned

if TYPE_CHECKING:
    from ..calibration.model import LinkCalibration

# [Pa] A larger pressure is impossible: silicone rubber tears at 10 MPa. Larger: broken readings enter the wrench.
MAX_PRESSURE = 1e7
# [N] A force up to it is possible on a taxel of any size: a sharp edge on small cells. Larger: as above.
MIN_IMPOSSIBLE = 100.0
# [N] Depth of a reading below rest, as the force of a reading as far above it, from which on it is a fault while the
# noise is not known. Larger: a fault is found only if it is deeper; smaller: a baseline is reported as fault.
MAX_NEGATIVE = 5.0
# [s] Time for which a fault stays reported, because it may show in some frames only. Larger: it is reported for longer
# after its end; smaller: the flag of a rare fault flickers.
FAULT_TIME = 1.0
# [reading] A larger reading is left out of the baseline: the sum of several would overflow. Derived: from the range
# of double-precision numbers.
MAX_READING = 1e100
# [standard deviations] Mean of a taxel from which on a skin is not at rest before the first tare. Larger: sensors
# with an offset learn their noise by themselves, and a weak contact at the start may count as rest.
MAX_QUIET_MEAN = 3.0
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
# [s] An active taxel whose reading has not changed in the last bit for longer is stuck, whatever its noise.
# Larger: a broken taxel is reported later; smaller: a constant load on a taxel without noise is reported.
STUCK_TIME = 30.0
# [s] Longest time between two readings of the electronics; faster controllers see a reading several times.
# Larger: a frozen bus is reported later; smaller: slow electronics are reported as frozen.
MAX_READING_PERIOD = 0.02
# [s] Shortest time after which equal frames are a frozen bus. Larger: it is reported later; smaller: a short
# interruption, which is a matter of the clock, is reported.
FROZEN_TIME = 0.1
# [taxels] Number of events, as a fraction of all taxels, up to which only their readings are converted to forces.
# Larger: slower with many events, because single taxels take longer; smaller: slower with some events.
MAX_EVENTS = 0.1


def taxel_readings(
    given: Any, dimensions: tuple[int, ...], channels: IntArray, length: int, name: str, link: str
) -> tuple[Array, bool]:
    """Return the readings of the taxels, NaN where they are masked, and whether they are whole numbers."""
    must = f"a {name} must be {'rows' if dimensions == (2,) else 'one row'} of real numbers; this one"
    try:
        readings = np.asarray(given)
    except ValueError as error:
        raise InvalidReading(f"{must} has rows of different lengths", flag="wrong_type") from error
    except Exception as error:  # arrays of other libraries raise errors of any type if they cannot be converted
        raise InvalidReading(f"{must} is {type(given).__name__}: {error}", flag="wrong_type") from error
    if readings.ndim not in dimensions or readings.dtype.kind not in "uif":
        what = f"{must} is {readings.dtype} of shape {readings.shape}"
        if isinstance(given, Mapping):
            what = f"{must} is a mapping. Pass the readings of force alone"
        raise InvalidReading(what, flag="wrong_type")
    if readings.shape[-1] < length:
        raise InvalidReading(
            f"the {name} has {readings.shape[-1]} channels, the skin of {link} needs {length}",
            flag="wrong_length",
            length=readings.shape[-1],
        )
    is_whole = readings.dtype.kind in "ui"
    if isinstance(given, np.ma.MaskedArray):
        readings = unmasked(given)
    return readings.take(channels, axis=-1), is_whole


def row_of(given: Any, kinds: str, must: str) -> Any:
    """Return one row of numbers as an array; masked numbers stay in it."""
    try:
        numbers = np.asarray(given)
    except ValueError as error:
        raise InvalidReading(f"{must}; this has rows of different lengths", flag="wrong_type") from error
    except Exception as error:  # as in taxel_readings
        raise InvalidReading(f"{must}; this is {type(given).__name__}: {error}", flag="wrong_type") from error
    if numbers.ndim != 1 or numbers.dtype.kind not in kinds:
        if numbers.shape == (0,):
            return np.empty(0, np.int64)
        raise InvalidReading(f"{must}; these are {numbers.dtype} of shape {numbers.shape}", flag="wrong_type")
    return numbers


class Readings:
    """Convert readings to forces. Keep the baseline, the masked taxels, and when each reading last changed."""

    def __init__(
        self,
        calibration: "LinkCalibration",
        geometry: SkinGeometry,
        follows_drift: bool,
        creep: tuple[float, float] | None,
    ):
        from ..calibration.taxel_responses import TaxelResponses  # imported late: only a skin needs these modules

        self.link, self.channels = calibration.link, geometry.channels
        self.length = int(geometry.channels.max(initial=-1)) + 1
        self.alive: BoolArray = np.ones(len(geometry.ids), bool)
        self._responses = TaxelResponses.of(calibration)
        self._shift: Array | None = None  # added to each reading, so that the reading at rest gives no force
        self.noise: Noise | None = None
        self._new_drift = partial(Drift, geometry.neighbours, follows_drift)
        self.drift = self._new_drift()
        self._creep = None if creep is None else Creep(len(geometry.ids), *creep)
        self.is_whole = False  # whether the last readings were whole numbers
        self._pairs = geometry.pairs
        self._latest = np.full(len(geometry.ids), np.nan)  # all that was sent, also in frames that are not accepted
        self._converted: tuple[Any, Any, Array] = (None, None, self._latest)  # baseline, drift, forces of the latest
        order = np.argsort(self.channels)  # a table of all channels may not fit into the memory
        self._sorted_channels, self._sorted_rows = np.append(self.channels[order], -1), np.append(order, -1)
        full, rest = self._responses.full, self._responses.rest
        self._can_saturate = bool(np.isfinite(full).any())
        self.byte_order = ByteOrder(float(np.abs(full - rest).max(initial=0.0)))
        measured = np.where(np.isfinite(full), self._responses.forces(np.where(np.isfinite(full), full, rest)), 0.0)
        self._most = np.maximum(np.maximum(MAX_PRESSURE * geometry.areas, MIN_IMPOSSIBLE), measured)
        self._limits = self._most  # force up to which each taxel is valid [N]; negative if it is masked or dead
        self._none = np.zeros(len(geometry.ids), bool)
        lock(self._none)
        self._below_rest = -math.inf  # time of the last frame with a reading below rest
        self._last = np.full(len(geometry.ids), np.nan)
        self._since = np.full(len(geometry.ids), np.inf)
        self._oldest = math.inf  # all of them are at least this
        self._time = math.inf  # of the last frame

    def mask(self, masked: BoolArray) -> None:
        """Leave out some taxels (n,) from now on."""
        self.alive = ~masked
        self._limit()

    def _limit(self) -> None:
        valid = self.alive if self.noise is None else self.alive & ~self.noise.dead
        self._limits = np.where(valid, self._most, -1.0)

    def intensities(self, readings: Any) -> Array:
        """Return the reading of each taxel, shape (n,), in double precision: sums of 8-bit numbers overflow."""
        rows, self.is_whole = self._rows(readings, (1,))
        return rows.astype(float)

    def after(self, indices: Any, values: Any) -> tuple[Array, IntArray]:
        """Return the reading of each taxel (n,) after some events, and their rows. No event of wrong ones counts."""
        channels = row_of(indices, "iu", "indices of events must be one row of whole numbers")
        numbers = row_of(values, "iuf", "values of events must be one row of real numbers")
        if len(channels) != len(numbers):
            raise InvalidReading(f"there are {len(channels)} indices for {len(numbers)} values", flag="wrong_length")
        if channels.min(initial=0) < 0:
            what = f"the index {channels.min()} of an event is negative; channels are counted from 0"
            raise InvalidReading(what, flag="wrong_type")
        position = np.searchsorted(self._sorted_channels[:-1], channels)
        is_own = self._sorted_channels[position] == channels
        raw, rows = self._latest.copy(), self._sorted_rows[position[is_own]]
        raw[rows] = unmasked(values)[is_own]
        if len(numbers):
            self.is_whole = numbers.dtype.kind in "ui"
        return raw, rows

    def rows(self, readings: Any) -> Array:
        """Return the readings of the taxels in many readings, shape (T, n), in their data type."""
        if np.ndim(readings) != 2:
            what = f"a batch must be rows of real numbers; this one has the shape {np.shape(readings)}"
            raise InvalidReading(what, flag="wrong_type")
        return self._rows(readings, (2,))[0]

    def _rows(self, readings: Any, dimensions: tuple[int, ...]) -> tuple[Array, bool]:
        """Return the readings of the taxels, NaN where they are masked, and whether they are whole numbers."""
        return taxel_readings(readings, dimensions, self.channels, self.length, "reading", self.link)

    def forces(self, intensities: Array) -> tuple[Array, BoolArray]:
        r"""Return the forces of the taxels (n,) [N], and which of them are valid; masked taxels are not.

        With the response :math:`R_i`, the reading :math:`I_i` and the baseline :math:`b_i` of each taxel:

        .. math::
            f_i = \max\bigl(0,\; R_i(I_i + b_i)\bigr) .

        A force is valid up to :data:`MAX_PRESSURE` on the cell, or up to the largest one of its response, if it has a
        range that states more.
        """
        shifted = intensities if self._shift is None else intensities + self._shift
        forces = self._responses.forces(shifted)
        return forces, self._known(forces)

    def _known(self, forces: Array) -> BoolArray:
        """Return which forces (..., n) are valid."""
        return forces <= self._limits

    def next(self, raw: Array, changed: IntArray | None) -> tuple[Array, Array, BoolArray]:
        """Return corrected readings, forces [N], and which of them are valid, (n,) each, of the next frame.

        Forces of a few changed readings are converted alone, unless the baseline has moved.
        """
        intensities = self.corrected(raw)
        shift, offset, before = self._converted
        is_same = shift is self._shift and offset is self.drift.offset and self._creep is None
        if changed is not None and is_same and len(changed) <= MAX_EVENTS * len(raw):
            forces = before.copy()
            shifted = intensities[changed] if shift is None else intensities[changed] + shift[changed]
            forces[changed] = self._responses.forces_at(changed, shifted)
            known = self._known(forces)
        else:
            forces, known = self.forces(intensities)
        self._latest, self._converted = raw, (self._shift, self.drift.offset, forces)
        return intensities, forces, known

    def deviations(self, intensities: Array) -> Array:
        """Return the standard deviations of valid forces (n,) [N]: the noise, times the slope of the response here."""
        assert self.noise is not None
        shifted = intensities if self._shift is None else intensities + self._shift
        low, high = self._responses.forces(shifted + self.noise.sides)
        deviations = np.abs(high - low)
        deviations /= 1.0 + (low * high > 0)
        return deviations

    def tare(self, readings: Any) -> None:
        """Set the baseline and learn the noise, see :meth:`.Skin.tare`."""
        rows, is_whole = self._rows(readings, (1, 2))
        self.learn(np.atleast_2d(rows.astype(float)), is_whole)

    def learn(self, rows: Array, is_whole: bool) -> None:
        """Set the baseline and learn the noise from readings of the taxels."""
        self.byte_order.learn(rows)
        finite = np.abs(rows) < MAX_READING
        counts = finite.sum(axis=0)
        mean = np.where(finite, rows, 0.0).sum(axis=0) / np.maximum(counts, 1)
        noise = learned(np.where(finite, rows, np.nan), self._responses, self._pairs, is_whole)
        before: Array | float = 0.0 if self.drift.offset is None else self.drift.offset
        self.drift = self._new_drift()
        if self._creep is not None:
            self._creep.restart()
        if noise is None and self.noise is not None:  # too few frames for the noise: its baseline moves to them
            self.drift.offset = np.where(counts > 0, mean - self.noise.signed(self.noise.mean), before)
            return
        if noise is not None:
            mean = np.where(noise.dead, mean, noise.mean * noise.sign)
        shift = 0.0 if self._shift is None else self._shift
        self._shift = np.where(counts > 0, self._responses.rest - mean, shift)
        self.noise = noise
        self._limit()

    def follow(self, raw: Array, is_complete: bool, time: float) -> None:
        """Follow the creep of the taxels, and the drift of the free ones."""
        if self.noise is not None:
            signed = self.noise.signed(raw)
            if self._creep is not None:
                signed = signed - self._creep.part
            if not is_complete:
                signed = self.valid(signed)
            if self._creep is not None:
                self._creep.add(signed - self.noise.free, time)
            self.drift.add(self.noise, signed, time)

    def corrected(self, raw: Array) -> Array:
        """Return readings (..., n) without creep and drift."""
        if self._creep is not None and self.noise is not None:
            raw = raw - self.noise.signed(self._creep.part)
        return self.drift.corrected(raw)

    def without_creep(self, rows: Array, times: Array | None) -> Array:
        """Return many readings (T, n) without creep."""
        noise, creep = self.noise, copy(self._creep)
        if noise is None or creep is None:
            return rows
        found = rows.astype(float)
        for row, time in zip(found, (times if times is not None else np.full(len(rows), np.nan)).tolist()):
            row -= noise.signed(creep.part)
            signed = self.valid(noise.signed(row))
            if np.isfinite(signed).any():
                creep.add(signed - noise.free, time)
        return found

    def valid(self, signed: Array) -> Array:
        """Return signed readings (..., n), NaN for defective taxels and invalid readings: what the drift uses."""
        assert self.noise is not None
        return np.where((np.abs(signed) < MAX_READING) & self.alive & ~self.noise.dead, signed, np.nan)

    def are_valid(self, rows: Array) -> bool:
        """Return whether :meth:`valid` changes nothing in readings (T, n) of any real data type."""
        assert self.noise is not None
        if self.noise.has_dead or not self.alive.all() or not rows.size:
            return False
        return bool(rows.min() > -MAX_READING and rows.max() < MAX_READING)

    def rests(self, rows: Array) -> bool:
        """Return whether readings (frames, n) are those of a skin without contact, as far as they can show it.

        The mean of each taxel is near the reading at which the response gives no force, and the same in both halves.
        No reading is far from the others, as in a tap. Successive readings differ as noise does, not as in a slow push.
        """
        if not (np.abs(rows) < MAX_READING).all():
            return False
        half, steps = len(rows) // 2, np.diff(rows, axis=0)
        # of the middle two thirds, which a short contact does not change
        low, middle, high = np.quantile(rows, (0.16, 0.5, 0.84), axis=0)
        floor = 1.0 if self.is_whole else MIN_SPREAD
        sigma = np.maximum(np.maximum(high - middle, middle - low), floor)
        sigma = np.maximum(sigma, np.median(sigma))  # of few frames, the estimate of one taxel can be small by chance
        is_noise = np.abs(rows - middle).max(axis=0) <= MAX_QUIET_PEAK * sigma
        variance = rows.var(axis=0, ddof=1)
        changes = (steps**2).mean(axis=0) / (2 * np.maximum(variance, MIN_SPREAD))
        # 1 less the correlation of successive readings; independent ones give less by chance
        change = min(float(np.median(changes)) * (1 + 2 / len(rows) ** 0.5), 1.0)
        is_noise &= (variance <= floor**2) | ((changes >= MIN_QUIET_CHANGE * change) & (change >= MIN_QUIET_CHANGE))
        spread = np.maximum(rows.std(axis=0, ddof=1), np.abs(steps).max(axis=0) / 4)
        shifts = (rows[half:].mean(axis=0) - rows[:half].mean(axis=0)) / np.maximum(spread, MIN_SPREAD)
        total = shifts.sum() / max(len(shifts), 1) ** 0.5  # many taxels that change together, each by little
        of_mean = ((2 - change) / max(change, MIN_QUIET_CHANGE) / half) ** 0.5  # standard deviation, correlated
        is_steady = np.abs(np.append(shifts, total)) <= MAX_QUIET_SHIFT * 2**0.5 * of_mean
        is_near = np.abs(rows.mean(axis=0) - self._responses.rest) <= MAX_QUIET_MEAN * spread
        return bool(is_noise.all() and is_steady.all() and is_near.all())

    def saturated(self, intensities: Array) -> BoolArray:
        """Return which readings (n,) are at the end of the range of their response: the force may be larger."""
        if not self._can_saturate:
            return self._none
        return self._responses.saturated(intensities if self._shift is None else intensities + self._shift)

    def flags(self, intensities: Array, known: BoolArray) -> frozenset[str]:
        """Return ``not_finite`` and ``too_large`` if taxels that are not masked have such readings.

        For frames in which some taxels have no valid force.
        """
        invalid = ~known & self.alive
        if self.noise is not None:
            invalid &= ~self.noise.dead
        if not np.count_nonzero(invalid):
            return frozenset()
        finite = np.isfinite(intensities[invalid])
        return frozenset([*(["too_large"] if finite.any() else []), *([] if finite.all() else ["not_finite"])])

    def unchanged(self, intensities: Array) -> BoolArray:
        """Return which readings (n,) equal those of the last frame in every bit."""
        return intensities == self._last

    def stuck(self, unchanged: BoolArray, time: float, period: float) -> BoolArray:
        """Return which readings (n,) have not changed for longer than the noise, or the limit, allows."""
        if not math.isfinite(time):
            return self._none
        period = max(period, MAX_READING_PERIOD)
        shortest = STUCK_TIME if self.noise is None else min(self.noise.min_repeats * period, STUCK_TIME)
        if self._oldest >= time - shortest:
            return self._none
        self._oldest = float(self._since.min(initial=math.inf))
        limit: Array | float = STUCK_TIME
        if self.noise is not None:
            limit = np.minimum(self.noise.repeats * period, STUCK_TIME)
        return unchanged & (self._since < time - limit)

    def is_frozen(self, time: float, period: float) -> bool:
        """Return whether the frame stays the same for longer than noise allows."""
        if self.noise is None or not len(self._since):
            return False
        limit = max(FROZEN_TIME, self.noise.frame_repeats * max(period, MAX_READING_PERIOD))
        return bool(self._since.max() < time - limit)

    def below_rest(self, intensities: Array, signed: Array | None, known: BoolArray, time: float) -> bool:
        """Return whether a known taxel reads less than its noise without contact can give, now or a second before."""
        if self.noise is not None and signed is not None:
            is_below = signed < self.noise.lowest
        else:
            shifted = intensities if self._shift is None else intensities + self._shift
            rest, sign = self._responses.rest, self._responses.sign
            is_below = shifted * sign < rest * sign
            if np.count_nonzero(is_below):
                is_below &= self._responses.forces(2 * rest - shifted) > MAX_NEGATIVE
        is_now = bool(np.count_nonzero(is_below)) and bool(np.count_nonzero(is_below & known))
        if is_now and math.isfinite(time):
            self._below_rest = time
        return is_now or 0 <= time - self._below_rest < FAULT_TIME

    def accept(self, intensities: Array, unchanged: BoolArray, time: float) -> None:
        """Store the readings and when each of them last changed. After a step back in time, count from this time."""
        if not math.isfinite(time):
            return
        if time < self._time:
            np.minimum(self._since, time, out=self._since)
        np.copyto(self._since, time, where=~unchanged)
        self._oldest = min(self._oldest, time)
        self._last, self._time = intensities, time
