"""From what the electronics send to newtons on the taxels, and what of it cannot be trusted."""

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from ..common.arrays import Array, BoolArray
from ..common.errors import InvalidReading
from .geometry import SkinGeometry

if TYPE_CHECKING:
    from ..calibration.model import LinkCalibration

# A megapascal on a large board is a kilonewton; a force beyond this is no force on a taxel [N].
LARGEST = 1e6
# A reading beyond this is no rest of a sensor, and would spoil the mean of those that are.
HUGE = 1e100
# A pressed taxel whose reading does not change in the last bit for this long is in doubt [s].
STUCK = 30.0


class Readings:
    """Turns rows of readings into forces; remembers the baseline, the masked taxels and when each reading changed."""

    def __init__(self, calibration: "LinkCalibration", geometry: SkinGeometry):
        from ..calibration.taxel_responses import (
            TaxelResponses,  # the reader's imports are paid by who has a calibration
        )

        self.link, self.channels = calibration.link, geometry.channels
        self.length = int(geometry.channels.max(initial=-1)) + 1
        self.alive: BoolArray = np.ones(len(geometry.ids), bool)
        self._responses = TaxelResponses.of(calibration)
        self._shift: Array | None = None  # what the baseline adds to each reading, so that rest is rest
        self._can_saturate = bool(np.isfinite(self._responses.full).any())
        self._last = np.full(len(geometry.ids), np.nan)
        self._since = np.full(len(geometry.ids), np.inf)

    def intensities(self, readings: Any) -> Array:
        """What each taxel reads, shape (n,), as floating numbers: 8-bit arithmetic would wrap round.

        Raises
        ------
        InvalidReading
            If it is not one row of numbers, or shorter than the highest channel; ``flag`` says which.
        """
        return self._rows(readings, (1,)).astype(float)

    def _rows(self, readings: Any, dimensions: tuple[int, ...]) -> Array:
        try:
            readings = np.asarray(readings)
        except ValueError as error:
            what = "a reading is one row of real numbers, not rows of different lengths"
            raise InvalidReading(what, flag="wrong_type") from error
        except Exception as error:  # whatever the arrays of other libraries raise when they cannot be read here
            what = f"a reading is one row of real numbers, not {type(readings).__name__}: {error}"
            raise InvalidReading(what, flag="wrong_type") from error
        if readings.ndim not in dimensions or readings.dtype.kind not in "buif":
            what = f"a reading is one row of real numbers, not {readings.dtype} of shape {readings.shape}"
            raise InvalidReading(what, flag="wrong_type")
        if readings.shape[-1] < self.length:
            raise InvalidReading(
                f"the reading has {readings.shape[-1]} channels, the skin of {self.link} needs {self.length}",
                flag="wrong_length",
                length=readings.shape[-1],
            )
        return readings.take(self.channels, axis=-1)

    def forces(self, intensities: Array) -> tuple[Array, BoolArray]:
        """Forces of the taxels (n,) [N], and whether each is one that can be; masked taxels have none."""
        shifted = intensities if self._shift is None else intensities + self._shift
        forces = self._responses.forces(shifted)
        return forces, (forces <= LARGEST) & self.alive

    def tare(self, readings: Any) -> None:
        """As :meth:`.Skin.tare`."""
        rows = np.atleast_2d(self._rows(readings, (1, 2)).astype(float))
        finite = np.abs(rows) < HUGE
        counts = finite.sum(axis=0)
        mean = np.where(finite, rows, 0.0).sum(axis=0) / np.maximum(counts, 1)
        before = np.zeros(rows.shape[1]) if self._shift is None else self._shift
        self._shift = np.where(counts > 0, self._responses.rest - mean, before)

    def saturated(self, intensities: Array) -> BoolArray:
        """(n,) whether the reading is at the end of the response's range, where the force may be larger."""
        if not self._can_saturate:
            return np.zeros(len(intensities), bool)
        return self._responses.saturated(intensities if self._shift is None else intensities + self._shift)

    def doubts(self, intensities: Array, known: BoolArray) -> frozenset[str]:
        """``not_finite`` and ``too_large``, as they apply to the taxels that are not masked."""
        if np.count_nonzero(known) == len(known):
            return frozenset()
        lost = ~known & self.alive
        if not np.count_nonzero(lost):
            return frozenset()
        finite = np.isfinite(intensities[lost])
        return frozenset([*(["too_large"] if finite.any() else []), *([] if finite.all() else ["not_finite"])])

    def still(self, intensities: Array) -> BoolArray:
        """(n,) whether the reading is the last one to the last bit."""
        return intensities == self._last

    def stuck(self, still: BoolArray, time: float) -> BoolArray:
        """(n,) whether a reading that is the last one has been so for half a minute."""
        return still & (self._since < time - STUCK) if math.isfinite(time) else np.zeros(len(still), bool)

    def accept(self, intensities: Array, still: BoolArray, time: float) -> None:
        """Remember when each reading changed last, unless the time is none; where time ran back, from now on."""
        if not math.isfinite(time):
            return
        np.minimum(self._since, time, out=self._since)
        np.copyto(self._since, time, where=~still)
        self._last = intensities
