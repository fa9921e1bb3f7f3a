"""Check the times of the frames: order, gaps and lost frames."""

import math

# [periods] A longer gap between two frames counts as lost frames. Larger: single lost frames are not reported.
DROPPED_PERIODS = 1.75
# [s] A gap longer than this and than JUMP_PERIODS is a jump: the skin forgets the contacts before it.
# Larger: contacts survive longer interruptions, and may be confused with new ones.
JUMP_TIME = 1.0
# [periods] As JUMP_TIME, for slow clocks.
JUMP_PERIODS = 50.0
# Flags of frames about which the frame before says nothing.
NO_PAST = frozenset({"time_back", "time_jump"})


class Clock:
    """Keep the time of the last frame, that of the last one with a valid reading, and the usual period between frames.

    A frame whose reading cannot be used still shows that no frame is missing.
    """

    def __init__(self) -> None:
        self._last: float | None = None
        self._valid: float | None = None
        self._is_lost = False  # whether time went back or jumped since then
        self._period = 0.0  # [s] 0 before the second frame; infinite after a jump: a slow clock may follow

    @property
    def period(self) -> float:
        """Usual period [s]; 0 before the second frame, infinite after a jump."""
        return self._period

    def flags(self, time: float) -> frozenset[str]:
        """Return what is wrong with the time of a frame [s]; change nothing.

        ``time_not_finite``: not a number. ``time_still``: equal to the last time. ``time_back``: before the last time.
        ``time_jump``: so long after the last frame that its contacts say nothing about this frame; after the first
        frame a second is enough. ``dropped``: frames between the last one and this one are missing.
        """
        if not math.isfinite(time):
            return frozenset({"time_not_finite"})
        if self._last is None:
            return frozenset()
        gap = time - self._last
        if gap == 0:  # after an unusable frame, the reading may be sent again
            return frozenset({"time_still"} if self._last == self._valid else ())
        if gap < 0:
            return frozenset({"time_back"})
        if self._is_jump(gap):
            return frozenset({"time_jump"})
        return frozenset({"dropped"}) if self._period > 0 and gap > DROPPED_PERIODS * self._period else frozenset()

    def has_past(self, time: float) -> bool:
        """Return whether the last valid reading says something about a valid one at this time [s]."""
        gaps = [time - then for then in (self._last, self._valid) if then is not None and math.isfinite(time)]
        return not self._is_lost and not any(gap < 0 or self._is_jump(gap) for gap in gaps)

    def accept(self, time: float, is_valid: bool = True) -> None:
        """Store the time of a frame [s], with or without a valid reading, and update the usual period.

        The period is an exponential mean of the gaps with a weight of 0.1. A gap counts as two periods at most.
        """
        if not math.isfinite(time):
            return
        gap = time - self._last if self._last is not None else 0.0
        self._is_lost = not is_valid and (self._is_lost or gap < 0 or self._is_jump(gap))
        if self._is_jump(gap):
            self._period = math.inf
        elif gap > 0:
            period = self._period if 0 < self._period < math.inf else gap
            self._period = period + 0.1 * (min(gap, 2 * period) - period)
        self._last = time
        if is_valid:
            self._valid = time

    def _is_jump(self, gap: float) -> bool:
        return gap > JUMP_TIME and gap > JUMP_PERIODS * self._period
