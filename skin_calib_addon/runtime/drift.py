"""Follow the drift of the readings without contact; report drift and noise that the thresholds do not allow for.

Time is divided into short blocks. A drift moves all taxels, a contact hardly ever does: the readings of the lowest
quarter of the taxels show it, also while others are pressed. They are free taxels, or the skin has a light even load.
Nothing distinguishes this load from a drift while it lasts.

In blocks without a load the baseline of free taxels moves to their mean with a large time constant.
"""

import math

import numpy as np

from ..common.arrays import Array, BoolArray, IntArray
from .noise import MAX_COMMON, MAX_DRIFT, MAX_READING_PERIOD, POSSIBLE, TRACKING_TIME, Noise, lowest_quarter
from .rest import REST_PERIOD
from .touched import Touched

# [s] Shortest length of a block. Larger: a foot that is lifted for a shorter time is not followed; smaller: the noise
# of a mean is larger, and free taxels count as loaded.
BLOCK_TIME = 0.2
# [frames] Smallest length of a block. Larger: slow skins report a drift later; smaller: the variance is less certain.
BLOCK_FRAMES = 6
# [standard deviations] Difference of means up to which taxels are like the lowest quarter. Larger: uneven light loads
# are reported as drift; smaller: a drift that differs from taxel to taxel is not found.
NEAR = 1.0
# [1] The same without a contact, relative to the deviation of the lowest quarter. As NEAR.
RELATIVE_NEAR = 0.5
# [standard deviations of the mean] Added to MAX_DRIFT. Larger: a drift is reported later; smaller: common noise of the
# taxels is reported.
DRIFT_MARGIN = 3.0
# [blocks] Number of blocks with a drift before it is reported. Larger: it is reported later; smaller: a foot that is
# loaded slowly is reported as drift.
REPORT_BLOCKS = 3
# [1] Variance of a free taxel, relative to that at rest, from which on its noise has grown. Larger: more false
# contacts; smaller: chance is reported.
MAX_VARIANCE = 3.0
# [1] The same, below which it is silent. Larger: chance counts as a defect; smaller: a defect is reported later.
MIN_VARIANCE = 0.05
# [1] Variance of one block, to which a larger one is limited. Larger: contacts that begin or end count as noise.
MAX_BLOCK_VARIANCE = 8.0
# [blocks] Time constant of the variance. Larger: noise is reported later; smaller: chance is reported as noise.
VARIANCE_BLOCKS = 10
# [readings] Number of equal ones until then, at 50 per second. Derived: from VARIANCE_BLOCKS and BLOCK_TIME.
SILENT_READINGS = -math.log(MIN_VARIANCE) * VARIANCE_BLOCKS * BLOCK_TIME / MAX_READING_PERIOD
# [1] Load at which a contact ends, relative to that of the largest drift, with which it begins. Larger: it flickers.
CONTACT_END = 0.5
# [1] Variance of a block in which nothing changes. Derived: from double precision.
NO_VARIANCE = 1e-6
NO_FLAGS: frozenset[str] = frozenset()


class Drift:
    """Change of the readings without contact, and of their noise, since the noise was learned.

    Parameters
    ----------
    neighbours : array, shape (k, n)
        See :func:`.neighbour_table`.
    is_followed : bool
        Whether the baseline moves with the free taxels. Otherwise the drift is only reported.
    """

    def __init__(self, neighbours: IntArray, is_followed: bool):
        self._neighbours, self._is_followed = neighbours, is_followed
        self.offset: Array | None = None  # (n,) drift of the readings; None for none
        self._is_noisy = False  # whether the noise of a taxel has grown
        self._silent: BoolArray | None = None  # (n,) whether a free taxel sends one number only; None if none does
        self._moved = math.nan  # time at which the baseline last moved [s]
        self._off = 0  # number of blocks with a drift since the last one without
        self._is_reported = self._is_positive = False
        self._is_touched = False  # whether the load of the last frame was too large for a drift
        self._variance = np.ones(neighbours.shape[1])  # filtered, relative to that at rest
        self.drop_block()

    def drop_block(self) -> None:
        """Forget the frames since the end of the last block."""
        self._start, self._count, self._is_mixed = math.inf, 0, False
        self._lowest, self._highest = math.inf, 0.0  # deviation that all taxels have in common
        self._next = -math.inf  # time of the next frame that counts [s]
        self._sum, self._squares, self._peak = np.zeros(0), np.zeros(0), np.zeros(0)

    def corrected(self, intensities: Array) -> Array:
        """Return readings (..., n) without the drift."""
        return intensities if self.offset is None else intensities - self.offset

    def faults(self, noise: Noise, sets: Touched, stuck: BoolArray) -> tuple[BoolArray, frozenset[str]]:
        """Return which taxels (n,) are stuck, with the silent ones, and the flags of a frame; see :class:`.Frame`.

        A load that is too large for a drift ends its report when it begins, and when it ends. The report is there again
        after a block with a drift. A positive drift that makes no load is harmless.

        Parameters
        ----------
        noise : Noise
            Of the skin.
        sets : Touched
            Of the frame.
        stuck : array of bool, shape (n,)
            Whether the reading of an active taxel has not changed for too long.
        """
        load = 0.0 if sets.stands is False else float(sets.pushes.sum())
        if (load > (CONTACT_END if self._is_touched else 1.0) * noise.largest_drift) != self._is_touched:
            self._is_touched, self._is_mixed = not self._is_touched, True
            self._hide()
        self._lowest, self._highest = min(self._lowest, sets.common), max(self._highest, sets.common)
        flags = NO_FLAGS
        if self._is_reported and not (self._is_positive and sets.stands is False):
            flags |= {"drift"}
        if self._is_noisy:
            flags |= {"noisy"}
        return (stuck, flags) if self._silent is None else (stuck | self._silent, flags | {"stuck"})

    def _hide(self) -> None:
        """Do not report a drift until one more block has it."""
        self._is_reported, self._off = False, min(self._off, REPORT_BLOCKS - 1)

    def add(self, noise: Noise, signed: Array, time: float) -> None:
        """Add a frame to the block; at its end, look at drift and noise.

        Parameters
        ----------
        noise : Noise
            Of the skin.
        signed : array, shape (n,)
            Signed readings, not corrected; NaN where a taxel has none.
        time : float
            Of the frame [s].
        """
        if not self._next <= time < math.inf:
            return
        self._next = time + REST_PERIOD  # as dense as those of the rest
        with np.errstate(over="ignore", invalid="ignore"):  # wrong readings may be as large as a number can be
            change = signed - noise.free
            if self._count == 0:
                self._start, self._sum, self._squares, self._peak = time, change.copy(), change * change, change
            else:
                self._sum += change
                np.maximum(self._peak, change, out=self._peak)
                change *= change
                self._squares += change
            self._count += 1
            if self._count >= BLOCK_FRAMES and time - self._start >= BLOCK_TIME:
                self._end_block(noise, time)
                self.drop_block()

    def _end_block(self, noise: Noise, time: float) -> None:
        """Look at the free taxels of the block that ends at a time [s], and move their baseline."""
        change = self._sum / self._count
        variance = (self._squares - self._sum * change) / ((self._count - 1) * noise.sigma**2)
        offset = 0.0 if self.offset is None else self.offset * noise.sign
        change -= offset
        deviation = change / noise.sigma
        valid = np.isfinite(deviation)
        if not np.count_nonzero(variance > NO_VARIANCE):  # no reading, or a frozen bus
            return
        lowest = lowest_quarter(deviation[valid])
        alike = np.abs(deviation - lowest) < (NEAR if self._is_touched else max(NEAR, RELATIVE_NEAR * lowest))
        if lowest > MAX_COMMON or 4 * np.count_nonzero(alike) < np.count_nonzero(valid):  # all taxels are loaded
            self._hide()
            return
        free = valid & ~self._near(deviation > lowest + POSSIBLE)
        if not self._is_mixed and self._highest - self._lowest < POSSIBLE:
            judged = free if free.any() else alike
            mean = float(deviation[judged].mean())
            self._judge(mean, noise.common / math.sqrt(np.count_nonzero(judged) * self._count))
            growth = (np.minimum(variance, MAX_BLOCK_VARIANCE) - self._variance) / VARIANCE_BLOCKS
            self._variance = self._variance + np.where(free | (deviation <= mean), growth, 0.0)
            self._is_noisy = bool((valid & (self._variance > MAX_VARIANCE)).any())
            changes = (noise.repeats < SILENT_READINGS) & np.isneginf(noise.clip)
            self._silent = any_of(valid & changes & (self._variance < MIN_VARIANCE))
        is_loaded = change[valid] @ noise.slopes[valid] > noise.load_level
        if self._is_followed and not is_loaded and not (self._peak > noise.sure - noise.free + offset).any():
            self._follow(np.where(free, change, 0.0) * noise.sign, time)

    def _judge(self, mean: float, sigma: float) -> None:
        """Count the blocks with a mean of free taxels that is not that at rest, as its standard deviation shows."""
        is_off = abs(mean) > MAX_DRIFT + DRIFT_MARGIN * sigma
        self._off = min(self._off + 1, REPORT_BLOCKS) if is_off else 0
        self._is_reported, self._is_positive = self._off == REPORT_BLOCKS, mean > 0

    def _follow(self, change: Array, time: float) -> None:
        """Move the baseline to the mean change (n,) of the readings, by the time since it last moved.

        A foot that walks is free for a fraction of the time.
        """
        elapsed = time - self._moved
        gain = -math.expm1(-(elapsed if elapsed > BLOCK_TIME else BLOCK_TIME) / TRACKING_TIME)
        self._moved = time
        self.offset = gain * change if self.offset is None else self.offset + gain * change

    def _near(self, which: BoolArray) -> BoolArray:
        """Return some taxels (n,) with their neighbours."""
        rows = which.nonzero()[0]
        near = np.append(which, False)
        near[self._neighbours.take(rows, axis=1)] = True
        return near[:-1]


def any_of(which: BoolArray) -> BoolArray | None:
    """Return some taxels (n,), or None if there are none."""
    return which if which.any() else None
