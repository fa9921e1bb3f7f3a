"""Find readings of two bytes that arrive in the wrong order."""

import math

import numpy as np

from ..common.arrays import Array

# [s] Time between two looks at the readings: electronics send new ones in it. Larger: the flag is later.
LOOK_PERIOD = 0.02
# [1] Ratio of two changes of a reading from which on the smaller one is smooth and the other one wild. Derived: in the
# middle, on a logarithmic scale, between equal changes and a change by 1 that is one by 256 in the other order.
WILD_RATIO = 256**0.5
# [1] What is left of the count of changes at the next look. Larger: the flag is later, and goes later.
KEPT_FRACTION = 0.85
# Number of changes of a wrong order before it is a fault. Larger: a skin with few changing taxels is not flagged.
MIN_COUNT = 6.0
# [1] Fraction of the clear changes that must be of a wrong order. Larger: contacts during the fault hide it.
MIN_FRACTION = 0.9
# [1] Fraction of all changes that must be of a wrong order. Larger: fast contacts during the fault hide it; smaller:
# contacts that jump are flagged with readings of few bits in the upper byte.
MIN_DECIDED = 0.6
# [readings] Range of a response that a converter with steps of 256 would divide into 16 levels, too few for a sensor.
# Larger: readings of eight bits in the upper byte are flagged.
COARSE_RANGE = 4096.0
WORD = 2**16  # Derived: two bytes


class ByteOrder:
    """Compare the changes of the readings as they are with those after the bytes are swapped.

    Signals are smooth: a change by 1 is a change by 256 in the wrong order. Readings that are all multiples of 256 may
    be those of eight bits in the upper byte. They count only if a reading was another number before, or if the range of
    the responses is too small for them.
    """

    def __init__(self, response_range: float):
        self._has_low_bytes = response_range < COARSE_RANGE
        self._before: Array | None = None
        self._time = -math.inf
        self._right = self._wrong = self._all = 0.0

    def learn(self, rows: Array) -> None:
        """Note whether readings (frames, n) without contact have a lower byte."""
        if not self._has_low_bytes:
            self._has_low_bytes = bool((np.nan_to_num(rows) % 256 != 0).any())

    def is_wrong(self, intensities: Array, time: float) -> bool:
        """Return whether the bytes of the last readings (n,) are in the wrong order."""
        if not 0 <= time - self._time < LOOK_PERIOD:
            self._look(intensities)
            self._time = time
        wrong, decided = self._wrong, self._wrong + self._right
        return wrong >= MIN_COUNT and wrong >= MIN_FRACTION * decided and wrong >= MIN_DECIDED * self._all

    def _look(self, intensities: Array) -> None:
        """Count the changes of readings (n,) since the last look that are smooth in one order and wild in the other."""
        before, self._before = self._before, intensities
        if before is None:
            return
        pair = np.stack((before, intensities))
        pair = pair[:, (np.abs(pair) < WORD).all(axis=0) & (pair[0] != pair[1])]
        whole = pair.astype(np.int64)
        words = whole.astype(np.uint16).byteswap()
        swapped = (words.view(np.int16) if (whole < 0).any() else words).astype(np.int64)
        self._has_low_bytes |= bool((whole & 255).any())
        change, swapped_change = np.abs(whole[1] - whole[0]), np.abs(swapped[1] - swapped[0])
        is_whole = (whole == pair).all(axis=0)
        right, wrong = WILD_RATIO * change <= swapped_change, WILD_RATIO * swapped_change <= change
        self._right = KEPT_FRACTION * self._right + np.count_nonzero(right | ~is_whole)
        self._wrong = KEPT_FRACTION * self._wrong + np.count_nonzero(wrong & is_whole) * self._has_low_bytes
        self._all = KEPT_FRACTION * self._all + len(change)
