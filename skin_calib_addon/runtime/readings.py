"""Turn readings of the electronics into forces on the taxels, without creep, drift and baseline."""

from collections.abc import Mapping
from copy import copy
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..common.arrays import Array, BoolArray, IntArray, unmasked
from ..common.errors import InvalidReading
from .creep import Creep
from .drift import Drift
from .geometry import SkinGeometry
from .noise import Noise, learned
from .rest import MAX_READING
from .tare import LearnedRest

if TYPE_CHECKING:
    from ..calibration.model import LinkCalibration
    from ..calibration.taxel_responses import TaxelResponses

# [Pa] A larger pressure is impossible: silicone rubber tears at 10 MPa. Larger: broken readings enter the wrench.
MAX_PRESSURE = 1e7
# [N] A force up to it is possible on a taxel of any size: a sharp edge on small cells. Larger: as above.
MIN_IMPOSSIBLE = 100.0


def taxel_readings(
    given: Any, dimensions: tuple[int, ...], channels: IntArray, length: int, name: str, link: str
) -> tuple[Array, np.dtype]:
    """Return the readings (..., n) of the taxels, NaN where they are masked, and the data type that was given."""
    must = f"a {name} must be {'rows' if dimensions == (2,) else 'one row'} of real numbers"
    readings = numbers_of(given, dimensions, "uif", must)
    if readings.shape[-1] < length:
        raise InvalidReading(
            f"the {name} has {readings.shape[-1]} channels, the skin of {link} needs {length}",
            flag="wrong_length",
            length=readings.shape[-1],
        )
    dtype = readings.dtype
    if isinstance(given, np.ma.MaskedArray):
        readings = unmasked(given)
    return readings.take(channels, axis=-1), dtype


def is_whole(dtype: np.dtype) -> bool:
    """Return whether numbers of a data type are whole."""
    return dtype.kind in "ui"


def numbers_of(given: Any, dimensions: tuple[int, ...], kinds: str, must: str) -> Any:
    """Return numbers as an array of one of some dimensions and kinds of data; masked numbers stay in it."""
    try:
        numbers = np.asarray(given)
    except ValueError as error:
        raise InvalidReading(f"{must}; this one has rows of different lengths", flag="wrong_type") from error
    except Exception as error:  # arrays of other libraries raise errors of any type if they cannot be converted
        raise InvalidReading(f"{must}; this one is {type(given).__name__}: {error}", flag="wrong_type") from error
    if numbers.ndim not in dimensions or numbers.dtype.kind not in kinds:
        if numbers.shape == (0,) and 1 in dimensions:  # an empty list has real numbers
            return np.empty(0, np.int64)
        what = f"{numbers.dtype} of shape {numbers.shape}"
        if isinstance(given, Mapping):
            what = "a mapping. Pass the readings of force alone"
        raise InvalidReading(f"{must}; this one is {what}", flag="wrong_type")
    return numbers


class Signals(NamedTuple):
    """What the readings (n,) of one frame say."""

    shifted: Array  # readings that the responses take: without creep and drift, with the baseline
    signed: Array | None  # readings without creep and drift that rise with the force; None without noise
    forces: Array  # [N]; 0 where they are not known
    known: BoolArray
    is_complete: bool  # whether all forces are known


class Readings:
    """Convert readings to forces. Keep the baseline, the noise, creep and drift, and the masked taxels."""

    def __init__(
        self,
        calibration: "LinkCalibration",
        geometry: SkinGeometry,
        follows_drift: bool,
        creep: tuple[float, float] | None,
    ):
        from ..calibration.taxel_responses import TaxelResponses  # imported late: only a skin needs these modules

        self.link, self.channels = calibration.link, geometry.channels
        self.length = int(geometry.channels.max(initial=-1)) + 1
        self.alive: BoolArray = np.ones(len(geometry.ids), bool)
        self.responses = TaxelResponses.of(calibration)
        self._shift: Array | None = None  # added to each reading, so that the reading at rest gives no force
        self.noise: Noise | None = None
        self._new_drift = partial(Drift, geometry.neighbours, follows_drift)
        self.drift = self._new_drift()
        self._creep = None if creep is None else Creep(len(geometry.ids), *creep)
        self.dtype: np.dtype = np.dtype(float)  # of the last readings
        self._pairs = geometry.pairs
        self._latest = np.full(len(geometry.ids), np.nan)  # all that was sent, also in frames that are not accepted
        self._row_of = {channel: row for row, channel in enumerate(self.channels.tolist())}
        full, rest = self.responses.full, self.responses.rest
        measured = np.where(np.isfinite(full), self.responses.forces(np.where(np.isfinite(full), full, rest)), 0.0)
        self._most = np.maximum(np.maximum(MAX_PRESSURE * geometry.areas, MIN_IMPOSSIBLE), measured)
        self._limits = self._most  # force up to which each taxel is valid [N]; negative if it is masked or dead

    def mask(self, masked: BoolArray) -> None:
        """Leave out some taxels (n,) from now on."""
        self.alive = ~masked
        self._limit()

    def _limit(self) -> None:
        self._limits = np.where(self.live, self._most, -1.0)

    @property
    def live(self) -> BoolArray:
        """Which taxels (n,) are neither masked nor dead."""
        return self.alive if self.noise is None else self.alive & ~self.noise.dead

    def intensities(self, readings: Any) -> Array:
        """Return the reading of each taxel, shape (n,), in double precision: sums of 8-bit numbers overflow."""
        rows, self.dtype = self._rows(readings, (1,))
        return rows.astype(float)

    def after(self, indices: Any, values: Any) -> Array:
        """Return the reading of each taxel (n,) after some events (k,). No event of wrong ones counts."""
        channels = numbers_of(indices, (1,), "iu", "indices of events must be one row of whole numbers")
        numbers = numbers_of(values, (1,), "uif", "values of events must be one row of real numbers")
        if len(channels) != len(numbers):
            raise InvalidReading(f"there are {len(channels)} indices for {len(numbers)} values", flag="wrong_length")
        if channels.min(initial=0) < 0:
            what = f"the index {channels.min()} of an event is negative; channels are counted from 0"
            raise InvalidReading(what, flag="wrong_type")
        raw = self._latest.copy()
        for channel, value in zip(channels.tolist(), unmasked(values).tolist()):
            if channel in self._row_of:
                raw[self._row_of[channel]] = value
        if len(numbers):
            self.dtype = numbers.dtype
        return raw

    def rows(self, readings: Any) -> Array:
        """Return the readings of the taxels in many readings, shape (T, n), in their data type."""
        if np.ndim(readings) != 2:
            what = f"a batch must be rows of real numbers; this one has the shape {np.shape(readings)}"
            raise InvalidReading(what, flag="wrong_type")
        return self._rows(readings, (2,))[0]

    def _rows(self, readings: Any, dimensions: tuple[int, ...]) -> tuple[Array, np.dtype]:
        """Return the readings of the taxels, NaN where they are masked, and the data type that was given."""
        return taxel_readings(readings, dimensions, self.channels, self.length, "reading", self.link)

    def forces(self, intensities: Array) -> tuple[Array, BoolArray]:
        r"""Return the forces (..., n) of readings without creep and drift [N], 0 if not valid, and which are valid.

        With the response :math:`R_i`, the reading :math:`I_i` and the baseline :math:`b_i` of each taxel:

        .. math::
            f_i = \max\bigl(0,\; R_i(I_i + b_i)\bigr) .

        A force is valid up to :data:`MAX_PRESSURE` on the cell, or up to the largest one of its response, if it has a
        range that states more. Forces of masked and dead taxels are not valid.
        """
        return self._valid(self.responses.forces(self._shifted(intensities)))

    def _valid(self, forces: Array) -> tuple[Array, BoolArray]:
        """Return forces (..., n), 0 where they are not valid, and which of them are valid."""
        known = forces <= self._limits
        return forces if np.count_nonzero(known) == known.size else np.where(known, forces, 0.0), known

    def _shifted(self, intensities: Array) -> Array:
        """Return what the responses take: readings (..., n) with the baseline, so that those at rest give no force."""
        return intensities if self._shift is None else intensities + self._shift

    def signed(self, intensities: Array) -> Array | None:
        """Return signed readings (..., n), which rise with the force; None while the noise is not known."""
        return None if self.noise is None else self.noise.signed(intensities)

    def next(self, raw: Array) -> Signals:
        """Return what the readings (n,) of the next frame say."""
        intensities = self.corrected(raw)
        shifted, self._latest = self._shifted(intensities), raw
        forces, known = self._valid(self.responses.forces(shifted))
        return Signals(shifted, self.signed(intensities), forces, known, np.count_nonzero(known) == len(known))

    def at_rest(self, readings: Any) -> tuple[Array, np.dtype]:
        """Return one or more readings for a tare, (frames, n), and the data type that was given."""
        rows, dtype = self._rows(readings, (1, 2))
        return np.atleast_2d(rows.astype(float)), dtype

    def examined(self, rows: Array, dtype: np.dtype) -> LearnedRest:
        """Return what readings (frames, n) at rest say; NaN where a taxel has none. Nothing changes."""
        finite = np.abs(rows) < MAX_READING
        noise = learned(np.where(finite, rows, np.nan), self.responses, self._pairs, is_whole(dtype))
        counts = finite.sum(axis=0)
        mean = np.where(finite, rows, 0.0).sum(axis=0) / np.maximum(counts, 1)
        sigma = np.sqrt((np.where(finite, rows - mean, 0.0) ** 2).sum(axis=0) / np.maximum(counts - 1, 1))
        if noise is not None:
            mean, sigma = np.where(noise.dead, mean, noise.mean * noise.sign), noise.sigma
        return LearnedRest(len(rows), np.where(counts > 0, mean, np.nan), sigma, noise)

    def learn(self, rest: LearnedRest) -> None:
        """Set the baseline, and the noise; of too few frames for the noise, it moves to their mean."""
        noise, baseline = rest.noise, self.baseline
        if noise is None and self.noise is not None:
            change = np.where(np.isfinite(rest.mean), rest.mean - self.noise.signed(self.noise.mean), 0.0)
            noise = self.noise.moved(self.noise.signed(change))
        self.restore(np.where(np.isfinite(rest.mean), self.responses.rest - rest.mean, baseline), noise)

    @property
    def baseline(self) -> Array:
        """What is added to each reading (n,), so that the one at rest gives no force."""
        return np.zeros(len(self.alive)) if self._shift is None else self._shift

    def restore(self, baseline: Array, noise: Noise | None) -> None:
        """Set the baseline (n,) and the noise."""
        self._shift, self.noise, self.drift = baseline, noise, self._new_drift()
        if self._creep is not None:
            self._creep.restart()
        self._limit()

    def follow(self, raw: Array, is_complete: bool, time: float) -> None:
        """Follow the creep of the taxels with readings (n,), and the drift of the free ones."""
        if self.noise is not None:
            signed = self.noise.signed(raw)
            if self._creep is not None:
                signed = signed - self._creep.part
            if not is_complete:
                signed = self.valid(signed)
            if self._creep is not None:
                self._creep.add(signed - self.noise.free, time)
            self.drift.add(self.noise, signed, time)

    def corrected(self, raw: Array) -> Array:
        """Return readings (..., n) without creep and drift."""
        if self._creep is not None and self.noise is not None:
            raw = raw - self.noise.signed(self._creep.part)
        return self.drift.corrected(raw)

    def followed(self, rows: Array, times: Array, valid: BoolArray, fresh: BoolArray) -> Array:
        """Return the readings (T, n) of a log without creep and drift, as in frames one after another.

        Rows without a ``valid`` reading (T, n) stay; before ``fresh`` ones (T,) time jumped. These readings stay.
        """
        then, found = copy(self), rows.astype(float)
        then.drift, then._creep = copy(self.drift), copy(self._creep)
        then.drift.drop_block()
        complete, seconds = valid.all(axis=1), times.tolist()
        for k in valid.any(axis=1).nonzero()[0].tolist():
            if fresh[k]:
                then.drift.drop_block()
            raw = found[k].copy()
            found[k] = then.corrected(raw)
            then.follow(raw, bool(complete[k]), seconds[k])
        return found

    def valid(self, signed: Array) -> Array:
        """Return signed readings (..., n), NaN for defective taxels and invalid readings: what the drift uses."""
        return np.where((np.abs(signed) < MAX_READING) & self.live, signed, np.nan)

    def flags(self, raw: Array, known: BoolArray) -> frozenset[str]:
        """Return ``not_finite`` and ``too_large`` if live taxels that are not masked have such readings (n,)."""
        invalid = ~known & self.live
        if not np.count_nonzero(invalid):
            return frozenset()
        finite = np.isfinite(raw[invalid])
        return frozenset([*(["too_large"] if finite.any() else []), *([] if finite.all() else ["not_finite"])])


def force_sigmas(responses: "TaxelResponses", shifted: Array, noise: Noise) -> Array:
    """Return the standard deviations of valid forces (n,) [N]: the noise, times the slope of the response here.

    ``shifted`` has the readings that the responses take.
    """
    low, high = responses.forces(shifted + noise.sides)
    deviations = np.abs(high - low)
    deviations /= 1.0 + ((low > 0) & (high > 0))
    return deviations
