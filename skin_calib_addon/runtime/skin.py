"""Give a controller the skin of one link: readings in, a frame with contacts, wrench and CoP out."""

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
    from ..common.warnings import Warning

# [N] Force from which on a taxel becomes active. Larger: weak contacts are not found; smaller: noise makes contacts.
SWITCH_ON = 0.2
# [N] Force down to which it stays active. Larger (nearer to SWITCH_ON): contacts appear and disappear with the noise.
SWITCH_OFF = 0.1


def load(
    path: str | Path, switch_on: float = SWITCH_ON, switch_off: float = SWITCH_OFF, ground: Plane | None = None
) -> "Skin":
    """Read a calibration file and return its skin.

    Parameters
    ----------
    path : path
        Of a ``*.calibration.json`` file.
    switch_on, switch_off, ground
        As for :class:`Skin`.

    Raises
    ------
    CalibrationFormatError
        If the file is not valid; ``findings`` has every problem.
    """
    from ..calibration.file import load_calibration  # imported late: only a caller with a file needs these modules

    return Skin(load_calibration(path), switch_on, switch_off, ground)


class Skin:
    """Taxels of all patches of one link; row i of every array is the same taxel.

    Parameters
    ----------
    calibration : LinkCalibration
        Taxels and responses.
    switch_on, switch_off : float
        Forces from which on a taxel becomes active, and down to which it stays active [N].
    ground : Plane, optional
        The plane on which the link stands, in its frame. Default for a flat skin: the plane through its taxels, below
        the robot. A skin around a limb has no ground, and therefore no CoP, ZMP and polygons.

    Raises
    ------
    ValueError
        If the forces are not ``0 < switch_off <= switch_on``.
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
        self._warnings = calibration.warnings
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
    def warnings(self) -> "tuple[Warning, ...]":
        """Warnings of the fit and of the placement: code, severity, message with position and value, advice."""
        return self._warnings

    @property
    def ids(self) -> tuple[str, ...]:
        """Ids of all taxels."""
        return self.geometry.ids

    @property
    def channels(self) -> IntArray:
        """Index (n,) of each taxel in a reading."""
        return self.geometry.channels

    @property
    def positions(self) -> Array:
        """Positions (n, 3) in the link frame [m]."""
        return self.geometry.positions

    @property
    def normals(self) -> Array:
        """Normals (n, 3) in the link frame, unit, out of the robot."""
        return self.geometry.normals

    @property
    def areas(self) -> Array:
        """Areas (n,) of the cells [m^2]."""
        return self.geometry.areas

    @property
    def pairs(self) -> IntArray:
        """Rows (e, 2) of neighbours, the lower row first."""
        return self.geometry.pairs

    @property
    def reading_length(self) -> int:
        """Minimum length of a reading: the highest channel plus one."""
        return self._readings.length

    @property
    def wrenches(self) -> Array:
        r"""Wrench (n, 6) of 1 N on each taxel on the robot, about the origin of the link (thesis eq. 3.16 to 3.18).

        A force :math:`f_i` pushes against the outward normal. The wrench of the skin [N, N m] is

        .. math::
            \mathbf{w} = \sum_i f_i \begin{bmatrix} -\mathbf{n}_i \\ \mathbf{p}_i \times (-\mathbf{n}_i) \end{bmatrix} .
        """
        return self.geometry.wrenches

    @property
    def observable(self) -> BoolArray:
        """Which components (6,) of the wrench the skin observes: 3 of 6 for a flat sole."""
        return observable(self.geometry.wrenches)

    @property
    def rank(self) -> int:
        """Number of independent wrenches that the skin observes."""
        return wrench_rank(self.geometry.wrenches)

    def forces(self, readings: Any) -> Array:
        """Return the forces of a reading, shape (n,) [N], never negative; NaN where the reading is not finite.

        Parameters
        ----------
        readings : array, shape (channels,)
            One frame of the electronics, of any real data type.

        Raises
        ------
        InvalidReading
            If this is not one row of numbers, or is too short for the highest channel.
        """
        forces, known = self._readings.forces(self._readings.intensities(readings))
        return np.where(known, forces, np.nan)

    def tare(self, readings: Any) -> None:
        """Set the baseline: these readings give no force from now on. Of several frames the mean counts.

        Parameters
        ----------
        readings : array, shape (channels,) or (frames, channels)
            Without contact. A taxel without a finite number keeps its baseline.

        Raises
        ------
        InvalidReading
            As for :meth:`forces`; the baseline does not change.
        """
        self._readings.tare(readings)

    def mask(self, ids: Iterable[str]) -> None:
        """Leave out these defective taxels from now on; an empty list masks none.

        Raises
        ------
        KeyError
            If a taxel does not exist.
        """
        row = {name: i for i, name in enumerate(self.ids)}
        masked = np.zeros(len(self.ids), bool)
        for name in ids:
            if name not in row:
                raise KeyError(f"no taxel {name!r} on the skin of {self.link}")
            masked[row[name]] = True
        self._readings.alive = ~masked

    def update(self, readings: Any, time: float) -> Frame:
        """Compute the frame of one reading. A wrong reading raises no error.

        Parameters
        ----------
        readings : array, shape (channels,)
            One frame of the electronics, of any real data type. If it cannot be read, the frame states why in its
            ``flags`` and ``problem``, nothing in it is known, and the state of the skin does not change.
        time : float
            Of the reading [s].
        """
        time = float(time)
        flags = self._clock.flags(time)
        try:
            intensities = self._readings.intensities(readings)
        except InvalidReading as error:
            return self._unknown(time, flags | {error.flag}, str(error))
        forces, known = self._readings.forces(intensities)
        flags |= self._readings.flags(intensities, known)
        known_count = np.count_nonzero(known)
        if known_count == 0 < len(known):
            return self._unknown(time, flags | {"blind"}, "no taxel has a valid reading")
        fresh = not flags.isdisjoint({"time_back", "time_jump"})  # the last frame says nothing about this one
        active = state = forces >= self.switch_on  # NaN is not
        if not fresh:
            active = state = active | (self._active & (forces >= self.switch_off))
        if known_count < len(known):
            forces = np.where(known, forces, 0.0)
            active = active & known
            state = active if fresh else np.where(known, active, self._active)
        rows = active.nonzero()[0]
        footprint = self._footprint
        if len(rows) != len(footprint.rows) or np.count_nonzero(rows != footprint.rows):
            footprint = Footprint(self.geometry, self.ground, rows)
        unchanged = self._readings.unchanged(intensities)
        stuck = self._readings.stuck(unchanged, time) & active
        saturated = self._readings.saturated(intensities) & known
        flags |= {name for name, which in (("stuck", stuck), ("saturated", saturated)) if np.count_nonzero(which)}
        if fresh:
            self._identities.forget()
        contacts, wrench = contacts_of(footprint, forces, self._identities.follow(footprint))
        self._clock.accept(time)
        self._readings.accept(intensities, unchanged, time)
        self._active, self._footprint = state, footprint
        return Frame(time, forces, known, saturated, stuck, contacts, wrench, flags, None, footprint)

    def _unknown(self, time: float, flags: frozenset[str], problem: str) -> Frame:
        """Return the frame of a reading that cannot be used; the state of the skin does not change."""
        n = len(self.ids)
        nothing = np.zeros(n, bool)
        return Frame(time, np.zeros(n), nothing, nothing, nothing, (), np.full(6, np.nan), flags, problem, None)
