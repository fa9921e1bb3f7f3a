"""Convert the readings of further modalities, such as proximity and temperature, to values in their units."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ..common.arrays import Array, BoolArray, lock, unmasked
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


class Modalities:
    """The modalities of one skin.

    Parameters
    ----------
    modalities : iterable of Modality
        Of the calibration.
    link : str
        Its name, for messages.
    ids : tuple of str
        Of the taxels.
    channels : array, shape (n,)
        Of their forces.
    """

    def __init__(self, modalities: "Iterable[Modality]", link: str, ids: tuple[str, ...], channels: Any):
        self._link, self._count = link, len(ids)
        self._all = {modality.name: modality for modality in modalities}
        row = {id: i for i, id in enumerate(ids)}
        self._rows, self._channels = {}, {}
        for name, modality in self._all.items():
            own = modality.channels
            self._rows[name] = np.arange(len(ids)) if own is None else np.array([row[id] for id in own], np.int64)
            self._channels[name] = channels if own is None else np.array(list(own.values()), np.int64)
        self.nothing: Mapping[str, ModalityValues] = {
            name: self._unknown(name, f"there is no reading of {name} in this frame") for name in self._all
        }

    @property
    def units(self) -> dict[str, str]:
        """Unit of each modality, by its name."""
        return {name: modality.unit for name, modality in self._all.items()}

    def frame(
        self, readings: Mapping[Any, Any], alive: BoolArray
    ) -> tuple[Mapping[str, ModalityValues], frozenset[str]]:
        """Return the values of all modalities in one reading, and the flags of the frame.

        A wrong array leaves its modality unknown, with the flag ``modality``.

        Parameters
        ----------
        readings : mapping of str to array, shape (channels,)
            By modality.
        alive : array of bool, shape (n,)
            Which taxels are not masked.

        Raises
        ------
        InvalidReading
            If a modality is unknown.
        """
        self._check_names(readings)
        values, flags = dict(self.nothing), frozenset[str]()
        for name, given in readings.items():
            if name != FORCE:
                try:
                    values[name] = self._values(name, given, alive, 1)
                except InvalidReading as error:
                    values[name], flags = self._unknown(name, str(error)), frozenset({"modality"})
        return values, flags

    def batch(self, readings: Mapping[Any, Any], alive: BoolArray, count: int) -> dict[str, ModalityValues]:
        """Return the values of the modalities in rows of readings.

        Parameters
        ----------
        readings : mapping of str to array, shape (T, channels)
            By modality.
        alive : array of bool, shape (n,)
            Which taxels are not masked.
        count : int
            Number T of the readings of force.

        Raises
        ------
        InvalidReading
            If a modality is unknown, has no rows of numbers, or not as many rows as the force.
        """
        self._check_names(readings)
        values = {name: self._values(name, given, alive, 2) for name, given in readings.items() if name != FORCE}
        for name, value in values.items():
            if len(value.values) != count:
                what = f"there are {len(value.values)} readings of {name} for {count} of {FORCE}"
                raise InvalidReading(what, flag="wrong_length")
        return values

    def _values(self, name: str, given: Any, alive: BoolArray, dimensions: int) -> ModalityValues:
        """Return the values of one modality.

        Parameters
        ----------
        name : str
            Of the modality.
        given : array, shape (channels,) or (T, channels)
            Its readings.
        alive : array of bool, shape (n,)
            Which taxels are not masked.
        dimensions : int
            1 for one reading, 2 for rows of readings.

        Raises
        ------
        InvalidReading
            If these are not rows of numbers, or are too short for the highest channel.
        """
        modality = self._all[name]
        channels = self._channels[name]
        length = int(channels.max(initial=-1)) + 1
        readings = taxel_readings(given, (dimensions,), channels, length, f"reading of {name}", self._link)[0]
        readings = readings.astype(float)
        values = np.full((*readings.shape[:-1], self._count), np.nan)
        saturated = np.zeros(values.shape, bool)
        rows = self._rows[name]
        low, high = modality.response.ends
        values[..., rows] = modality.response.values(readings)
        saturated[..., rows] = (readings <= low) | (readings >= high)
        values[..., ~alive] = np.nan
        known = ~np.isnan(values)
        return ModalityValues(modality.unit, values, known, saturated & known, self._largest(name))

    def _check_names(self, readings: Mapping[Any, Any]) -> None:
        """Refuse a mapping with an unknown modality.

        Raises
        ------
        InvalidReading
            Names the unknown modality, and those of the skin.
        """
        for name in readings:
            if name != FORCE and name not in self._all:
                known = ", ".join((FORCE, *self._all))
                what = f"the skin of {self._link} has no modality {name!r}; it has {known}"
                raise InvalidReading(what, flag="wrong_type")

    def _largest(self, name: str) -> float:
        response = self._all[name].response
        return float(response.values(np.array(response.ends)).max())

    def _unknown(self, name: str, problem: str) -> ModalityValues:
        """Return the values of a modality without a valid reading."""
        nothing = np.zeros(self._count, bool)
        return ModalityValues(
            self._all[name].unit, np.full(self._count, np.nan), nothing, nothing, self._largest(name), problem
        )


def force_of(readings: Mapping[Any, Any]) -> Any:
    """Return the readings of force in a mapping.

    Raises
    ------
    InvalidReading
        If there are none.
    """
    if FORCE not in readings:
        listed = ", ".join(map(str, readings)) or "nothing"
        raise InvalidReading(f"the mapping has no reading of {FORCE}; it has {listed}", flag="wrong_type")
    return readings[FORCE]


def without_force(modalities: Any) -> Mapping[Any, Any]:
    """Return a mapping of other modalities than force.

    Raises
    ------
    InvalidReading
        If it is no mapping, or has a force, which comes as events.
    """
    if not isinstance(modalities, Mapping) or FORCE in modalities:
        what = f"a mapping with {FORCE}" if isinstance(modalities, Mapping) else type(modalities).__name__
        must = "modalities must be a mapping of the other readings, because the forces are events"
        raise InvalidReading(f"{must}; this is {what}", flag="wrong_type")
    return modalities


def values_in(given: Any, *units: str) -> Array:
    """Return the numbers of an array, or of a modality; NaN where they are unknown.

    Parameters
    ----------
    given : array, shape (n,), or ModalityValues
        If it is an array, its unit is that of the caller.
    *units : str
        Valid units of a modality.

    Raises
    ------
    ValueError
        If the modality has another unit.
    """
    if not isinstance(given, ModalityValues):
        return unmasked(given)
    if given.unit not in units:
        raise ValueError(f"this needs a modality in {' or '.join(units)}, not in {given.unit}")
    return given.values


def distances_in(given: Any) -> Array:
    """Return distances [m]; infinity where a modality is at the far end of its response: nothing is in range.

    Parameters
    ----------
    given : array, shape (n,), or ModalityValues
        Distances [m].

    Raises
    ------
    ValueError
        If the modality has another unit.
    """
    distances = values_in(given, "m")
    return np.where(distances >= given.largest, np.inf, distances) if isinstance(given, ModalityValues) else distances
