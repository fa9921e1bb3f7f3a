"""Is time what it should be?"""

import math

# Beyond this many usual periods between two frames, frames in between were lost.
LOST = 1.75
# Beyond this long [s], or this many usual periods, what was felt before says nothing about now.
GAP, GAP_PERIODS = 1.0, 50.0


class Clock:
    """The times of the frames so far: the last one, and the usual period."""

    def __init__(self) -> None:
        self._last: float | None = None
        self._period: float | None = None

    def doubts(self, time: float) -> frozenset[str]:
        """What is wrong with the time of a frame [s]; nothing is remembered yet.

        ``time_not_finite``; ``time_still`` where it stands, ``time_back`` where it runs backwards, ``time_jump`` where
        the last frame is too long ago to say anything about this one, ``dropped`` where frames were lost in between.
        """
        if not math.isfinite(time):
            return frozenset({"time_not_finite"})
        if self._last is None:
            return frozenset()
        gap = time - self._last
        if gap <= 0:
            return frozenset({"time_still" if gap == 0 else "time_back"})
        if self._jumps(gap):
            return frozenset({"time_jump"})
        return frozenset({"dropped"}) if self._period and gap > LOST * self._period else frozenset()

    def accept(self, time: float) -> None:
        """Remember the time of a frame; a tenth of what a gap differs from the usual period becomes usual."""
        if not math.isfinite(time):
            return
        gap = time - self._last if self._last is not None else 0.0
        if self._jumps(gap):
            self._period = None
        elif gap > 0:
            usual = gap if self._period is None else self._period
            self._period = usual + 0.1 * (min(gap, 2 * usual) - usual)
        self._last = time

    def _jumps(self, gap: float) -> bool:
        return self._period is not None and gap > GAP and gap > GAP_PERIODS * self._period
