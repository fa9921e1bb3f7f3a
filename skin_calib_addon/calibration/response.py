"""From readings to newtons: the response of the sensors, of one kind for all taxels or each its own. NumPy only."""

from dataclasses import dataclass
from functools import reduce
from typing import Any

import numpy as np

from ..common.arrays import Array


@dataclass(frozen=True)
class Response:
    """Force of a reading, ``F = sum(coefficients[k] * reading**k)`` [N], never negative.

    With a ``range`` (low, high) it is monotone there, and readings beyond are taken for its ends.
    """

    coefficients: tuple[float, ...] = (0.0, 1.0)
    range: tuple[float, float] | None = None

    def newtons(self, readings: Any) -> Array:
        """Forces [N] of readings of any shape; NaN where one is no finite number or the force overflows."""
        readings = _finite(readings)
        with np.errstate(all="ignore"):
            clamped = readings if self.range is None else np.clip(readings, *self.range)
            return pressing(np.polynomial.polynomial.polyval(clamped, self.coefficients))

    @property
    def rest(self) -> float:
        """The reading in the range at which the force is least; 0 without a range."""
        return 0.0 if self.range is None else self.range[self._falls()]

    @property
    def full(self) -> float | None:
        """The reading from which on the force is no longer told; None without a range."""
        return None if self.range is None else self.range[not self._falls()]

    def _falls(self) -> bool:
        low, high = (reduce(lambda sum, c: sum * x + c, self.coefficients[::-1], 0.0) for x in self.range or (0, 0))
        return bool(high < low)


@dataclass(frozen=True)
class ResponseTable:
    """Force of a reading, linear between the rows of a table; beyond it the force of its first or last row.

    ``readings`` increase strictly, ``forces`` [N] never turn round.
    """

    readings: tuple[float, ...]
    forces: tuple[float, ...]

    def newtons(self, readings: Any) -> Array:
        """Forces [N] of readings of any shape; NaN where one is no finite number."""
        return pressing(np.interp(_finite(readings), self.readings, self.forces))

    @property
    def rest(self) -> float:
        """The reading in the table at which the force is least."""
        return self.readings[-1 if self._falls() else 0]

    @property
    def full(self) -> float:
        """The reading from which on the force is no longer told."""
        return self.readings[0 if self._falls() else -1]

    def _falls(self) -> bool:
        return self.forces[-1] < self.forces[0]


AnyResponse = Response | ResponseTable


def response_document(response: AnyResponse) -> dict[str, Any]:
    """A response as the member of a calibration or plan file."""
    if isinstance(response, ResponseTable):
        return {"kind": "table", "readings": _floats(response.readings), "forces": _floats(response.forces)}
    document = {"kind": "polynomial", "coefficients": _floats(response.coefficients)}
    return document if response.range is None else document | {"range": _floats(response.range)}


def response_from(document: dict[str, Any]) -> AnyResponse:
    """The response in a member in which nothing is wrong."""
    if document["kind"] == "table":
        return ResponseTable(tuple(_floats(document["readings"])), tuple(_floats(document["forces"])))
    low, high = _floats(document.get("range", (0, 0)))
    return Response(tuple(_floats(document["coefficients"])), (low, high) if "range" in document else None)


def pressing(forces: Array) -> Array:
    """Forces without the negative ones; what is not finite becomes NaN, so that minus infinity is no zero."""
    return np.maximum(forces, 0.0) + forces * 0.0


def _finite(readings: Any) -> Array:
    """Readings as floats, NaN where one is not finite."""
    readings = np.asarray(readings, float)
    return np.where(np.isfinite(readings), readings, np.nan)


def _floats(values: Any) -> list[float]:
    """1 becomes 1.0, so that one calibration has one file."""
    return list(map(float, values))
