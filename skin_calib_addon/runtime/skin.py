"""The skin of one link as a controller sees it."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..arrays import Array, BoolArray
from ..errors import InvalidReading
from .contacts import Frame, components, contact_of

if TYPE_CHECKING:
    from ..calibration.model import LinkCalibration

# A taxel becomes active above the first force and stays so down to the second [N].
SWITCH_ON, SWITCH_OFF = 0.2, 0.1


def load(path: str | Path, switch_on: float = SWITCH_ON, switch_off: float = SWITCH_OFF) -> "Skin":
    """Read a calibration file into a skin.

    Parameters
    ----------
    path : path
    switch_on, switch_off : float
        Forces at which a taxel becomes and stays active [N].

    Raises
    ------
    CalibrationFormatError
        With every finding, if the file is not valid.
    """
    from ..calibration.file import load_calibration  # the reader's imports are paid by who reads

    return Skin(load_calibration(path), switch_on, switch_off)


class Skin:
    """Taxels of all patches of one link; row i of every array is the same taxel."""

    def __init__(self, calibration: "LinkCalibration", switch_on: float = SWITCH_ON, switch_off: float = SWITCH_OFF):
        if not 0 < switch_off <= switch_on:
            raise ValueError(f"switch_off {switch_off} must be positive and at most switch_on {switch_on}")
        taxels = [patch.taxels for patch in calibration.patches]
        self.link = calibration.link
        self.ids: tuple[str, ...] = sum((t.ids for t in taxels), ())
        self.channels = np.concatenate([np.empty(0, np.int64), *(t.channels for t in taxels)])
        self.positions = np.concatenate([np.empty((0, 3)), *(t.positions_link for t in taxels)])
        self.normals = np.concatenate([np.empty((0, 3)), *(t.normals_link for t in taxels)])
        self.areas = np.concatenate([np.empty(0), *(t.areas for t in taxels)])
        row = {name: i for i, name in enumerate(self.ids)}
        beside = sum((t.neighbours for t in taxels), ())
        pairs = {(i, row[other]) for i, others in enumerate(beside) for other in others if i < row[other]}
        self.pairs = np.array(sorted(pairs), np.int64).reshape(-1, 2)
        self.switch_on, self.switch_off = switch_on, switch_off
        self._coefficients = np.array(calibration.response.coefficients)
        self._active: BoolArray = np.zeros(len(self.ids), bool)

    @property
    def reading_length(self) -> int:
        """How many numbers a reading must have at least: the highest channel plus one."""
        return int(self.channels.max(initial=-1)) + 1

    def forces(self, readings: Any) -> Array:
        """Forces of a reading, shape (n,) [N], never negative; NaN where the reading is not a finite number.

        Parameters
        ----------
        readings : array, shape (channels,)
            One frame as the electronics send it, of any real dtype.

        Raises
        ------
        InvalidReading
            If it is not one row of numbers, or shorter than the highest channel.
        """
        try:
            readings = np.asarray(readings)
        except ValueError as error:  # rows of different lengths
            raise InvalidReading("a reading is one row of real numbers, not rows of different lengths") from error
        if readings.ndim != 1 or readings.dtype.kind not in "buif":
            raise InvalidReading(
                f"a reading is one row of real numbers, not {readings.dtype} of shape {readings.shape}"
            )
        if len(readings) < self.reading_length:
            raise InvalidReading(
                f"the reading has {len(readings)} channels, the skin of {self.link} needs {self.reading_length}",
                length=len(readings),
            )
        intensity = readings[self.channels].astype(float)  # before any sum: 8-bit arithmetic would wrap round
        intensity[~np.isfinite(intensity)] = np.nan
        return np.maximum(np.polynomial.polynomial.polyval(intensity, self._coefficients), 0.0)

    def update(self, readings: Any, time: float) -> Frame:
        """Contacts in one frame of readings.

        Parameters
        ----------
        readings : array, shape (channels,)
        time : float
            [s], kept on the frame.

        Raises
        ------
        InvalidReading
            As :meth:`forces`; the skin is then as it was before.
        """
        time, forces = float(time), self.forces(readings)  # what can fail comes before the state changes
        known = np.isfinite(forces)
        forces = np.where(known, forces, 0.0)
        self._active = forces >= np.where(self._active, self.switch_off, self.switch_on)
        geometry = (self.positions, self.normals, self.areas)
        contacts = tuple(contact_of(rows, self.ids, forces, geometry) for rows in components(self._active, self.pairs))
        wrench = sum((c.wrench for c in contacts), np.zeros(6))
        flags = frozenset() if known.all() else frozenset({"not_finite"})
        return Frame(time, forces, contacts, wrench, flags)
