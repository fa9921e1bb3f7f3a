"""The skin of one link as a controller sees it."""

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..common.arrays import Array, BoolArray, IntArray
from ..common.errors import InvalidReading
from .clock import Clock
from .contacts import contacts_of
from .footprint import Footprint
from .frame import Frame
from .geometry import GroundGeometry, SkinGeometry, observable, wrench_rank
from .identity import Identities
from .plane import Plane, ground_of
from .readings import Readings

if TYPE_CHECKING:
    from ..calibration.model import LinkCalibration

# A taxel becomes active above the first force and stays so down to the second [N].
SWITCH_ON, SWITCH_OFF = 0.2, 0.1


def load(
    path: str | Path, switch_on: float = SWITCH_ON, switch_off: float = SWITCH_OFF, ground: Plane | None = None
) -> "Skin":
    """Read a calibration file into a skin.

    Parameters
    ----------
    path : path
    switch_on, switch_off, ground
        As for :class:`Skin`.

    Raises
    ------
    CalibrationFormatError
        With every finding, if the file is not valid.
    """
    from ..calibration.file import load_calibration  # the reader's imports are paid by who reads

    return Skin(load_calibration(path), switch_on, switch_off, ground)


class Skin:
    """Taxels of all patches of one link; row i of every array is the same taxel.

    Parameters
    ----------
    calibration : LinkCalibration
    switch_on, switch_off : float
        Forces at which a taxel becomes and stays active [N].
    ground : Plane, optional
        What the link stands on, in its frame. By default, for a skin that is about flat, the plane through its taxels
        that faces them; a skin round a limb has none, and no CoP, ZMP and polygons.
    """

    def __init__(
        self,
        calibration: "LinkCalibration",
        switch_on: float = SWITCH_ON,
        switch_off: float = SWITCH_OFF,
        ground: Plane | None = None,
    ):
        if not 0 < switch_off <= switch_on:
            raise ValueError(f"switch_off {switch_off} must be positive and at most switch_on {switch_on}")
        self.link = calibration.link
        self.geometry = SkinGeometry(calibration)
        plane = ground or ground_of(self.positions, self.normals, self.areas)
        self.ground = None if plane is None else GroundGeometry(self.geometry, plane)
        self.switch_on, self.switch_off = switch_on, switch_off
        self._readings = Readings(calibration, self.geometry)
        self._clock = Clock()
        self._identities = Identities(len(self.ids))
        self._active: BoolArray = np.zeros(len(self.ids), bool)
        self._footprint = Footprint(self.geometry, self.ground, np.empty(0, np.int64))

    @property
    def ids(self) -> tuple[str, ...]:
        """Of all taxels."""
        return self.geometry.ids

    @property
    def channels(self) -> IntArray:
        """(n,) where each taxel stands in a reading."""
        return self.geometry.channels

    @property
    def positions(self) -> Array:
        """(n, 3) [m]."""
        return self.geometry.positions

    @property
    def normals(self) -> Array:
        """(n, 3) unit, out of the robot."""
        return self.geometry.normals

    @property
    def areas(self) -> Array:
        """(n,) of the cells [m^2]."""
        return self.geometry.areas

    @property
    def pairs(self) -> IntArray:
        """(e, 2) rows of neighbours, the lower first."""
        return self.geometry.pairs

    @property
    def reading_length(self) -> int:
        """How many numbers a reading must have at least: the highest channel plus one."""
        return self._readings.length

    @property
    def wrenches(self) -> Array:
        """(n, 6) wrench about the link's origin that 1 N on each taxel applies to the robot (thesis 3.16)."""
        return self.geometry.wrenches

    @property
    def observable(self) -> BoolArray:
        """(6,) which components of the wrench the skin can feel at all: 3 of 6 for a flat sole."""
        return observable(self.geometry.wrenches)

    @property
    def rank(self) -> int:
        """How many independent wrenches the skin can feel."""
        return wrench_rank(self.geometry.wrenches)

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
        forces, known = self._readings.forces(self._readings.intensities(readings))
        return np.where(known, forces, np.nan)

    def tare(self, readings: Any) -> None:
        """Take what the sensors send now as what they send at rest: one frame, or the mean of several.

        Parameters
        ----------
        readings : array, shape (channels,) or (frames, channels)
            With nothing on the skin. A taxel that gives no number keeps its baseline.

        Raises
        ------
        InvalidReading
            As :meth:`forces`; the baseline is then as it was.
        """
        self._readings.tare(readings)

    def mask(self, ids: Iterable[str]) -> None:
        """Leave these taxels, which are dead or lie, out of everything from now on; no ids leave none out.

        Raises
        ------
        KeyError
            If there is no such taxel.
        """
        row = {name: i for i, name in enumerate(self.ids)}
        masked = np.zeros(len(self.ids), bool)
        for name in ids:
            if name not in row:
                raise KeyError(f"no taxel {name!r} on the skin of {self.link}")
            masked[row[name]] = True
        self._readings.alive = ~masked

    def update(self, readings: Any, time: float) -> Frame:
        """What the skin feels in one frame of readings; no reading raises an error.

        Parameters
        ----------
        readings : array, shape (channels,)
            One frame as the electronics send it, of any real dtype. One that cannot be read gives a frame that says so
            in its ``flags`` and ``problem``, in which nothing is known, and leaves the skin as it was.
        time : float
            Of the frame [s].
        """
        time = float(time)
        flags = self._clock.doubts(time)
        try:
            intensities = self._readings.intensities(readings)
        except InvalidReading as error:
            return self._unknown(time, flags | {error.flag}, str(error))
        forces, known = self._readings.forces(intensities)
        flags |= self._readings.doubts(intensities, known)
        heard = np.count_nonzero(known)
        if heard == 0 < len(known):
            return self._unknown(time, flags | {"blind"}, "no taxel gives a reading")
        fresh = not flags.isdisjoint({"time_back", "time_jump"})  # what was felt before says nothing about now
        active = state = forces >= self.switch_on  # NaN is not
        if not fresh:
            active = state = active | (self._active & (forces >= self.switch_off))
        if heard < len(known):
            forces = np.where(known, forces, 0.0)
            active = active & known
            state = active if fresh else np.where(known, active, self._active)
        rows = active.nonzero()[0]
        footprint = self._footprint
        if len(rows) != len(footprint.rows) or np.count_nonzero(rows != footprint.rows):
            footprint = Footprint(self.geometry, self.ground, rows)
        still = self._readings.still(intensities)
        stuck = self._readings.stuck(still, time) & active
        saturated = self._readings.saturated(intensities) & known
        flags |= {name for name, which in (("stuck", stuck), ("saturated", saturated)) if np.count_nonzero(which)}
        if fresh:
            self._identities.forget()
        contacts, wrench = contacts_of(footprint, forces, self._identities.follow(footprint))
        self._clock.accept(time)
        self._readings.accept(intensities, still, time)
        self._active, self._footprint = state, footprint
        return Frame(time, forces, known, saturated, stuck, contacts, wrench, flags, None, footprint)

    def _unknown(self, time: float, flags: frozenset[str], problem: str) -> Frame:
        """The frame of a reading that says nothing; the skin stays as it was."""
        n = len(self.ids)
        nothing = np.zeros(n, bool)
        return Frame(time, np.zeros(n), nothing, nothing, nothing, (), np.full(6, np.nan), flags, problem, None)
