"""Find readings that cannot be trusted, by one frame and by the frames before it."""

import math
from typing import TYPE_CHECKING

import numpy as np

from ..common.arrays import Array, BoolArray, lock
from .byte_order import ByteOrder
from .noise import MAX_READING_PERIOD, Noise

if TYPE_CHECKING:
    from ..calibration.taxel_responses import TaxelResponses
    from .readings import Signals

# [N] Depth of a reading below rest, as the force of a reading as far above it, from which on it is a fault while the
# noise is not known. Larger: a fault is found only if it is deeper; smaller: a baseline is reported as fault.
MAX_NEGATIVE = 5.0
# [s] Time for which a fault stays reported, because it may show in some frames only. Larger: it is reported for longer
# after its end; smaller: the flag of a rare fault flickers.
FAULT_TIME = 1.0
# [s] An active taxel whose reading has not changed in the last bit for longer is stuck, whatever its noise.
# Larger: a broken taxel is reported later; smaller: a constant load on a taxel without noise is reported.
STUCK_TIME = 30.0
# [s] Shortest time after which equal frames are a frozen bus. Larger: it is reported later; smaller: a short
# interruption, which is a matter of the clock, is reported.
FROZEN_TIME = 0.1


class Faults:
    """Keep when each reading last changed, and the faults of the last second."""

    def __init__(self, responses: "TaxelResponses"):
        self._responses = responses
        full, rest = responses.full, responses.rest
        self._can_saturate = bool(np.isfinite(full).any())
        self.byte_order = ByteOrder(float(np.abs(full - rest).max(initial=0.0)))
        self._none = np.zeros(len(rest), bool)
        lock(self._none)
        self._below_rest = -math.inf  # time of the last frame with a reading below rest
        self._last = np.full(len(rest), np.nan)  # readings of the last frame
        self._since = np.full(len(rest), np.inf)  # when each of them last changed
        self._oldest = math.inf  # all of them are at least this
        self._time = math.inf  # of the last frame

    def unchanged(self, raw: Array) -> BoolArray:
        """Return which readings (n,) equal those of the last frame in every bit."""
        return raw == self._last

    def accept(self, raw: Array, unchanged: BoolArray, time: float) -> None:
        """Store readings (n,) and when each of them last changed; after a step back in time, from this time on [s]."""
        if not math.isfinite(time):
            return
        if time < self._time:
            np.minimum(self._since, time, out=self._since)
        np.copyto(self._since, time, where=~unchanged)
        self._oldest = min(self._oldest, time)
        self._last, self._time = raw, time

    def of(
        self,
        raw: Array,
        unchanged: BoolArray,
        signals: "Signals",
        active: BoolArray,
        noise: Noise | None,
        time: float,
        period: float,
    ) -> tuple[BoolArray, BoolArray, frozenset[str]]:
        """Return which taxels (n,) are stuck, and which saturated, and the flags of a frame; see :class:`.Frame`."""
        stuck = self._stuck(unchanged, active, noise, time, period)
        saturated = self._saturated(signals)
        flags = []
        if np.count_nonzero(stuck):
            flags.append("stuck")
        if np.count_nonzero(saturated):
            flags.append("saturated")
        if self._is_below_rest(signals, noise, time):
            flags.append("below_rest")
        if self.byte_order.is_wrong(raw, time):
            flags.append("byte_order")
        if noise is not None and noise.has_dead:
            flags.append("dead")
        if noise is not None and np.count_nonzero(unchanged) == len(unchanged) > 0:
            limit = max(FROZEN_TIME, noise.frame_repeats * max(period, MAX_READING_PERIOD))
            if self._since.max() < time - limit:
                flags.append("frozen")
        return stuck, saturated, frozenset(flags)

    def _saturated(self, signals: "Signals") -> BoolArray:
        """Return which known readings (n,) are at the end of the range of their response: the force may be larger."""
        if not self._can_saturate:
            return self._none
        saturated = self._responses.saturated(signals.shifted)
        return saturated & signals.known if np.count_nonzero(saturated) else saturated

    def _stuck(
        self, unchanged: BoolArray, active: BoolArray, noise: Noise | None, time: float, period: float
    ) -> BoolArray:
        """Return which active taxels (n,) have not changed for longer than the noise, or the limit, allows."""
        if not math.isfinite(time):
            return self._none
        period = max(period, MAX_READING_PERIOD)
        shortest = STUCK_TIME if noise is None else min(noise.min_repeats * period, STUCK_TIME)
        if self._oldest >= time - shortest:
            return self._none
        self._oldest = float(self._since.min(initial=math.inf))
        limit = STUCK_TIME if noise is None else np.minimum(noise.repeats * period, STUCK_TIME)
        stuck: BoolArray = unchanged & active & (self._since < time - limit)
        return stuck

    def _is_below_rest(self, signals: "Signals", noise: Noise | None, time: float) -> bool:
        """Return whether a known taxel reads less than its noise without contact can give, now or a second before."""
        if noise is not None and signals.signed is not None:
            is_below = signals.signed < noise.lowest
        else:
            rest, sign = self._responses.rest, self._responses.sign
            is_below = signals.shifted * sign < rest * sign
            if np.count_nonzero(is_below):
                is_below &= self._responses.forces(2 * rest - signals.shifted) > MAX_NEGATIVE
        is_now = bool(np.count_nonzero(is_below)) and bool(np.count_nonzero(is_below & signals.known))
        if is_now and math.isfinite(time):
            self._below_rest = time
        return is_now or 0 <= time - self._below_rest < FAULT_TIME
