"""Apply the responses of all taxels of a link to their readings at once. NumPy only."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..common.arrays import Array, BoolArray, IntArray
from .model import LinkCalibration
from .response import AnyResponse, Response, ResponseTable, nonnegative


class TaxelResponses:
    """Responses of many taxels, applied to all readings at once.

    Attributes
    ----------
    rest : array, shape (n,)
        Reading of each taxel with the smallest force.
    full : array, shape (n,)
        Saturation reading of each taxel; infinite if it has none.
    sign : array, shape (n,)
        1 where the force increases with the reading; -1 where it decreases.
    """

    def __init__(self, responses: Sequence[AnyResponse], index: IntArray):
        """Store ``responses[index[i]]`` as the response of taxel i."""
        index = np.asarray(index, np.int64)
        used, index = np.unique(index, return_inverse=True)
        kinds = [responses[i] for i in used]
        self.rest = np.array([r.rest for r in kinds])[index] if kinds else np.empty(0)
        self.full = np.array([np.inf if r.full is None else r.full for r in kinds])[index] if kinds else np.empty(0)
        self.sign = np.where(self.full < self.rest, -1.0, 1.0)
        for values in (self.rest, self.full, self.sign):
            values.setflags(write=False)
        self._signed_full = self.sign * self.full
        is_table = np.array([isinstance(r, ResponseTable) for r in kinds], bool)
        self._polynomials = _Polynomials([r if isinstance(r, Response) else Response() for r in kinds], index)
        self._rows = np.flatnonzero(is_table[index]) if kinds else np.empty(0, np.int64)
        self._tables = None
        if len(self._rows):
            number = np.cumsum(is_table) - 1
            self._tables = _Tables([r for r in kinds if isinstance(r, ResponseTable)], number[index[self._rows]])
        self._only_tables = len(self._rows) == len(index) > 0

    @classmethod
    def of(cls, calibration: LinkCalibration) -> "TaxelResponses":
        """Return the responses of all taxels of a calibration, in the order of its patches."""
        return cls(*responses_of(calibration))

    def forces(self, intensity: Any) -> Array:
        """Return forces (..., n) [N] of readings (..., n), never negative.

        A force is NaN if its reading is not finite, or if the force overflows.
        """
        readings = np.asarray(intensity, float)
        with np.errstate(all="ignore"):
            if self._tables is None:
                forces = self._polynomials.forces(readings)
            elif self._only_tables:
                forces = self._tables.forces(readings)
            else:
                forces = self._polynomials.forces(readings)
                forces[..., self._rows] = self._tables.forces(readings[..., self._rows])
            return nonnegative(forces)

    def saturated(self, intensity: Any) -> BoolArray:
        """Return whether readings (n,) are at or beyond ``full``, where the true force may be larger."""
        signed = np.asarray(intensity, float) * self.sign
        return (signed >= self._signed_full) & (signed < np.inf)


def responses_of(calibration: LinkCalibration) -> tuple[tuple[AnyResponse, ...], IntArray]:
    """Return the responses of a calibration, and the index (n,) of that of each taxel, in the order of its patches."""
    own = [np.zeros(0, np.int64)]
    for patch in calibration.patches:
        taxels = patch.taxels
        own.append(taxels.responses + 1 if len(taxels.responses) else np.zeros(len(taxels.ids), np.int64))
    return (calibration.response, *calibration.responses), np.concatenate(own)


class _Polynomials:
    """One polynomial for each taxel."""

    def __init__(self, responses: Sequence[Response], index: IntArray):
        degree = max((len(r.coefficients) - 1 for r in responses), default=1)
        coefficients = np.zeros((max(degree, 1) + 1, len(responses)))  # highest power first
        ranges = np.tile((-np.inf, np.inf), (len(responses), 1))
        for k, r in enumerate(responses):
            coefficients[len(coefficients) - len(r.coefficients) :, k] = r.coefficients[::-1]
            if r.range is not None:
                ranges[k] = r.range
        self._coefficients = list(np.take(coefficients, index, axis=1))  # degree + 1 of (n,)
        self._low, self._high = np.take(ranges.T, index, axis=1)
        self._clamps = bool(np.isfinite(ranges).any())

    def forces(self, readings: Array) -> Array:
        first, second, *others = self._coefficients
        if self._clamps:
            invalid = readings - readings  # NaN for a reading that is not finite, which the clamping would hide
            readings = np.maximum(readings, self._low)
            np.minimum(readings, self._high, out=readings)
            readings += invalid
        forces = readings * first
        forces += second
        for coefficient in others:
            forces *= readings
            forces += coefficient
        return forces


class _Tables:
    """One table for each taxel; table k occupies [2 k, 2 k + 1] of one axis, so that one search is enough."""

    def __init__(self, tables: Sequence[ResponseTable], index: IntArray):
        self._low = np.array([t.readings[0] for t in tables])[index]
        self._width = np.array([t.readings[-1] - t.readings[0] for t in tables])[index]
        self._shift = 2.0 * index
        self._knots = np.concatenate(
            [
                (np.array(t.readings) - t.readings[0]) / (t.readings[-1] - t.readings[0]) + 2 * k
                for k, t in enumerate(tables)
            ]
        )
        self._forces = np.concatenate([t.forces for t in tables])

    def forces(self, readings: Array) -> Array:
        invalid = readings * 0.0
        fraction = readings - self._low
        fraction /= self._width
        np.maximum(fraction, 0.0, out=fraction)
        np.minimum(fraction, 1.0, out=fraction)
        fraction += self._shift
        fraction += invalid
        return np.interp(fraction, self._knots, self._forces)
