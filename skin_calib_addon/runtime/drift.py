"""Follow the drift of the readings without contact, and report a drift that cannot be followed.

Time is divided into short blocks. A block in which a taxel is surely touched, or the skin has a clear load, is left
out. In the others a taxel is surely free if neither its mean reading nor that of a neighbour is a possible touch. The
baseline of free taxels moves to their mean with a large time constant.
"""

import math

import numpy as np

from ..common.arrays import Array, BoolArray, IntArray
from .noise import POSSIBLE, TRACKING_TIME, Noise

# [s] Length of a block. Larger: a foot that is lifted for a shorter time is not followed; smaller: the noise of a mean
# is larger, and free taxels count as loaded.
BLOCK_TIME = 0.2
# [standard deviations] Mean of the free taxels that is a drift. Larger: more false contacts before it is reported;
# smaller: light contacts are reported as drift.
MAX_DRIFT = 0.3
# [s] Time constant of the mean of free taxels. Larger: a drift is reported later; smaller: noise is reported as drift.
REPORT_TIME = 1.0


class Drift:
    """Change of the readings without contact since the noise was learned.

    Parameters
    ----------
    neighbours : array, shape (k, n)
        See :func:`.neighbour_table`.
    is_followed : bool
        Whether the baseline moves with the free taxels. Otherwise the drift is only reported.
    """

    def __init__(self, neighbours: IntArray, is_followed: bool):
        self._neighbours, self._is_followed = neighbours, is_followed
        self.is_reported = False  # whether the mean of the free taxels is no longer that of the baseline
        self.offset: Array | None = None  # (n,) drift of the readings; None for none
        self._moved = math.nan  # time at which the baseline last moved [s]
        self._mean = 0.0  # filtered mean of the free taxels [standard deviations]
        self.drop_block()

    def drop_block(self) -> None:
        """Forget the frames since the end of the last block."""
        self._start, self._count = math.inf, 0
        self._sum, self._peak = np.zeros(0), np.zeros(0)

    def corrected(self, intensities: Array) -> Array:
        """Return readings (..., n) without the drift."""
        return intensities if self.offset is None else intensities - self.offset

    def add(self, noise: Noise, signed: Array, time: float) -> None:
        """Add a frame to the block; at its end, look at the drift.

        Parameters
        ----------
        noise : Noise
            Of the skin.
        signed : array, shape (n,)
            Signed readings, not corrected; NaN where a taxel has none.
        time : float
            Of the frame [s].
        """
        if not math.isfinite(time):
            return
        if self._count == 0:
            self._start, self._sum, self._peak = time, signed.copy(), signed.copy()
        else:
            self._sum += signed
            np.maximum(self._peak, signed, out=self._peak)
        self._count += 1
        if time - self._start >= BLOCK_TIME:
            self.end_block(noise, self._sum / self._count, self._peak, time)
            self.drop_block()

    def end_block(self, noise: Noise, mean: Array, peak: Array, time: float) -> None:
        """Move the baseline of the free taxels, and look at their mean.

        The baseline moves by the time since it last moved: a foot that walks is free for a fraction of the time.

        Parameters
        ----------
        noise : Noise
            Of the skin.
        mean, peak : array, shape (n,)
            Mean and largest signed reading of the block; NaN where a taxel has none.
        time : float
            Of the last frame of the block [s].
        """
        offset = 0.0 if self.offset is None else self.offset * noise.sign
        if np.count_nonzero(peak > noise.sure + offset):
            return
        change = mean - noise.free - offset
        valid = np.isfinite(change)
        excess = float(np.where(valid, change, 0.0) @ noise.slopes)
        if excess > noise.load_limit or np.count_nonzero(peak - mean > 0) == 0:  # a load, or a frozen bus
            return
        free = valid & ~self._near(change > POSSIBLE * noise.sigma)
        count = int(np.count_nonzero(free))
        if 2 * count >= len(free) > 0:
            deviation = float((change[free] / noise.sigma[free]).sum()) / count
            self._mean += BLOCK_TIME / REPORT_TIME * (deviation - self._mean)
            self.is_reported = abs(self._mean) > MAX_DRIFT
        if self._is_followed and excess <= noise.load_level:
            elapsed = time - self._moved
            gain = -math.expm1(-(elapsed if elapsed > BLOCK_TIME else BLOCK_TIME) / TRACKING_TIME)
            self._moved = time
            step = np.where(free, gain * change, 0.0) * noise.sign
            self.offset = step if self.offset is None else self.offset + step

    def _near(self, which: BoolArray) -> BoolArray:
        """Return some taxels (n,) with their neighbours."""
        rows = which.nonzero()[0]
        near = np.append(which, False)
        near[self._neighbours.take(rows, axis=1)] = True
        return near[:-1]
