"""Convert the readings of further modalities, such as proximity and temperature, to values in their units."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ..common.arrays import Array, BoolArray, IntArray, lock
from ..common.errors import InvalidReading
from .readings import taxel_readings

if TYPE_CHECKING:
    from ..calibration.modality import Modality

FORCE = "force"  # Contract: name of the readings of force in a mapping of readings


@dataclass(frozen=True, eq=False)
class ModalityValues:
    """Values of one modality in a frame. In a batch the arrays have a row (T, n) for each reading."""

    unit: str
    values: Array  # (n,) in the unit; NaN where unknown
    known: BoolArray  # (n,) whether the taxel has a value
    saturated: BoolArray  # (n,) whether the reading is at an end of the response, and the true value may be beyond
    largest: float  # value at the end of the response; infinite without one
    problem: str | None = None  # why nothing is known

    def __post_init__(self) -> None:
        lock(self.values, self.known, self.saturated)


class Converter:
    """Convert the readings of one modality."""

    def __init__(self, modality: "Modality", link: str, ids: tuple[str, ...], channels: IntArray):
        self.unit, self._response = modality.unit, modality.response
        self._name, self._link, self._count = modality.name, link, len(ids)
        self._channels, self._rows = channels, None  # rows of the taxels that have it; None: all
        if modality.channels is not None:
            row = {id: i for i, id in enumerate(ids)}
            self._rows = np.array([row[id] for id in modality.channels], np.int64)
            self._channels = np.array(list(modality.channels.values()), np.int64)
        self._length = int(self._channels.max(initial=-1)) + 1
        self._ends = modality.response.ends
        self._largest = float(modality.response.values(np.array(self._ends)).max())

    def values(self, given: Any, alive: BoolArray, dimensions: int) -> ModalityValues:
        """Return the values of all taxels; those of a taxel (n,) that is not alive are unknown."""
        what = f"reading of {self._name}"
        readings = taxel_readings(given, (dimensions,), self._channels, self._length, what, self._link)[0].astype(float)
        if self._rows is not None:
            own, readings = readings, np.full((*readings.shape[:-1], self._count), np.nan)
            readings[..., self._rows] = own
        if np.count_nonzero(alive) < len(alive):
            readings[..., ~alive] = np.nan
        values = self._response.values(readings)
        low, high = self._ends
        saturated = (readings <= low) | (readings >= high)  # neither if it is NaN
        return ModalityValues(self.unit, values, ~np.isnan(values), saturated, self._largest)

    def unknown(self, problem: str) -> ModalityValues:
        """Return the values without a valid reading."""
        nothing = np.zeros(self._count, bool)
        return ModalityValues(self.unit, np.full(self._count, np.nan), nothing, nothing, self._largest, problem)


class Modalities:
    """The modalities of one skin."""

    def __init__(self, modalities: "Iterable[Modality]", link: str, ids: tuple[str, ...], channels: IntArray):
        self._link = link
        self._converters = {modality.name: Converter(modality, link, ids, channels) for modality in modalities}
        self.nothing: Mapping[str, ModalityValues] = {
            name: converter.unknown(f"there is no reading of {name} in this frame")
            for name, converter in self._converters.items()
        }

    @property
    def units(self) -> dict[str, str]:
        """Unit of each modality, by its name."""
        return {name: converter.unit for name, converter in self._converters.items()}

    def frame(
        self, readings: Mapping[Any, Any], alive: BoolArray
    ) -> tuple[Mapping[str, ModalityValues], frozenset[str]]:
        """Return the values of all modalities in one reading, and the flags of the frame.

        A wrong array leaves its modality unknown, with the flag ``modality``.
        """
        values, flags = dict(self.nothing), frozenset[str]()
        for name, converter in self._used(readings):
            try:
                values[name] = converter.values(readings[name], alive, 1)
            except InvalidReading as error:
                values[name], flags = converter.unknown(str(error)), frozenset({"modality"})
        return values, flags

    def batch(self, readings: Mapping[Any, Any], alive: BoolArray, count: int) -> dict[str, ModalityValues]:
        """Return the values of the modalities in rows of readings."""
        values = {name: converter.values(readings[name], alive, 2) for name, converter in self._used(readings)}
        for name, value in values.items():
            if len(value.values) != count:
                what = f"there are {len(value.values)} readings of {name} for {count} of {FORCE}"
                raise InvalidReading(what, flag="wrong_length")
        return values

    def _used(self, readings: Mapping[Any, Any]) -> list[tuple[str, Converter]]:
        """Return the modalities in a mapping."""
        for name in readings:
            if name != FORCE and name not in self._converters:
                known = ", ".join((FORCE, *self._converters))
                what = f"the skin of {self._link} has no modality {name!r}; it has {known}"
                raise InvalidReading(what, flag="wrong_type")
        return [(name, self._converters[name]) for name in readings if name != FORCE]


def force_of(readings: Mapping[Any, Any]) -> Any:
    """Return the readings of force in a mapping."""
    if FORCE not in readings:
        listed = ", ".join(map(str, readings)) or "nothing"
        raise InvalidReading(f"the mapping has no reading of {FORCE}; it has {listed}", flag="wrong_type")
    return readings[FORCE]


def without_force(modalities: Any) -> Mapping[Any, Any]:
    """Return a mapping of other modalities than force."""
    if not isinstance(modalities, Mapping) or FORCE in modalities:
        what = f"a mapping with {FORCE}" if isinstance(modalities, Mapping) else type(modalities).__name__
        must = "modalities must be a mapping of the other readings, because the forces are events"
        raise InvalidReading(f"{must}; this is {what}", flag="wrong_type")
    return modalities
