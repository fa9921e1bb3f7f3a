"""Responses of sensors: functions that convert readings to forces. NumPy only."""

from dataclasses import dataclass
from functools import reduce
from typing import Any

import numpy as np

from ..common.arrays import Array


@dataclass(frozen=True)
class Response:
    r"""Force of a reading as a polynomial.

    .. math:: F(I) = \max\Bigl(0, \sum_k c_k I^k\Bigr)

    F is the force [N], I the reading, and c the ``coefficients`` [N per unit of the reading to the power k]. With a
    ``range`` (low, high) the polynomial is monotone in the range, and readings outside are clamped to it.
    """

    coefficients: tuple[float, ...] = (0.0, 1.0)
    range: tuple[float, float] | None = None

    def newtons(self, readings: Any) -> Array:
        """Return forces [N] of readings of any shape; NaN for a reading that is not finite, or an overflow."""
        with np.errstate(all="ignore"):
            return nonnegative(self.values(_finite(readings)))

    def values(self, readings: Any) -> Array:
        """Return the values of readings of any shape without the limit at 0, for other quantities than forces.

        Infinite readings are at the ends of the range. NaN for a reading that is NaN, or an overflow.
        """
        readings = np.asarray(readings, float)
        with np.errstate(all="ignore"):
            low, high = self.ends
            clamped = np.minimum(np.maximum(readings, low), high)
            values = np.where(np.isnan(readings), np.nan, self.coefficients[-1])
            for coefficient in self.coefficients[-2::-1]:
                values = coefficient + values * clamped
            return np.where(np.isfinite(values) | np.isinf(readings), values, np.nan)

    @property
    def ends(self) -> tuple[float, float]:
        """Return the readings at which the range begins and ends; infinite without a range."""
        return (-np.inf, np.inf) if self.range is None else self.range

    @property
    def rest(self) -> float:
        """Return the reading of the smallest force in the range; 0 without a range."""
        return 0.0 if self.range is None else self.range[self._falls()]

    @property
    def full(self) -> float | None:
        """Return the saturation reading, which has the largest force of the range; None without a range."""
        return None if self.range is None else self.range[not self._falls()]

    def _falls(self) -> bool:
        low, high = (reduce(lambda sum, c: sum * x + c, self.coefficients[::-1], 0.0) for x in self.range or (0, 0))
        return bool(high < low)


@dataclass(frozen=True)
class ResponseTable:
    """Force of a reading by linear interpolation in a table.

    Readings outside the table have the force of its first or last row. ``readings`` increase strictly; ``forces`` [N]
    are monotone.
    """

    readings: tuple[float, ...]
    forces: tuple[float, ...]

    def newtons(self, readings: Any) -> Array:
        """Return forces [N] of readings of any shape; NaN for a reading that is not finite."""
        return nonnegative(self.values(_finite(readings)))

    def values(self, readings: Any) -> Array:
        """Return the values of readings of any shape, as :meth:`.Response.values`."""
        return np.asarray(np.interp(readings, self.readings, self.forces))

    @property
    def ends(self) -> tuple[float, float]:
        """Return the first and the last reading of the table."""
        return self.readings[0], self.readings[-1]

    @property
    def rest(self) -> float:
        """Return the reading of the smallest force in the table."""
        return self.readings[-1 if self._falls() else 0]

    @property
    def full(self) -> float:
        """Return the saturation reading, which has the largest force of the table."""
        return self.readings[0 if self._falls() else -1]

    def _falls(self) -> bool:
        return self.forces[-1] < self.forces[0]


AnyResponse = Response | ResponseTable


def response_document(response: AnyResponse) -> dict[str, Any]:
    """Convert a response to a member of a calibration or plan file."""
    if isinstance(response, ResponseTable):
        return {"kind": "table", "readings": _floats(response.readings), "forces": _floats(response.forces)}
    document = {"kind": "polynomial", "coefficients": _floats(response.coefficients)}
    return document if response.range is None else document | {"range": _floats(response.range)}


def response_from(document: dict[str, Any]) -> AnyResponse:
    """Convert a valid member to a response."""
    if document["kind"] == "table":
        return ResponseTable(tuple(_floats(document["readings"])), tuple(_floats(document["forces"])))
    low, high = _floats(document.get("range", (0, 0)))
    return Response(tuple(_floats(document["coefficients"])), (low, high) if "range" in document else None)


def nonnegative(forces: Array) -> Array:
    """Replace negative forces by 0, and forces that are not finite (minus infinity too) by NaN."""
    return np.maximum(forces, 0.0) + (forces - forces)


def _finite(readings: Any) -> Array:
    """Return readings as floats, with NaN for those that are not finite."""
    readings = np.asarray(readings, float)
    return np.where(np.isfinite(readings), readings, np.nan)


def _floats(values: Any) -> list[float]:
    """Convert to floats: 1 becomes 1.0, so that equal calibrations have equal files."""
    return list(map(float, values))
