"""Give a controller the skin of one link: readings in, a frame with contacts, wrench and CoP out."""

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..common.arrays import Array, BoolArray, IntArray
from ..common.errors import InvalidReading, UnknownTaxel
from .batch import Batch, batch_of
from .clock import NO_PAST, Clock
from .contacts import contacts_of
from .faults import Faults
from .footprint import Footprint
from .frame import Frame
from .geometry import GroundGeometry, SkinGeometry, Terms, observable, wrench_rank
from .identity import Identities
from .lost import Lost
from .modalities import Modalities, ModalityValues, force_of, without_force
from .noise import Noise
from .plane import Plane, ground_of
from .readings import Readings, Signals, force_sigmas, is_whole
from .rest import Assumed, Rest, contacts_during, is_rest
from .tare import LearnedRest, Tare, judged
from .touched import (
    Evidence,
    Streak,
    Touched,
    by_noise,
    by_thresholds,
    over_drift,
    switched,
    touched_by_load,
    touched_by_noise,
)

if TYPE_CHECKING:
    from ..calibration.model import LinkCalibration
    from ..common.warnings import Warning

# [N] Forces from which on a taxel becomes active, and down to which it stays active, while the noise is not known.
# Larger: weak contacts are not found; smaller: noise makes contacts. SWITCH_OFF nearer to SWITCH_ON: contacts appear
# and disappear with the noise.
SWITCH_ON, SWITCH_OFF = 0.2, 0.1

# Flags of frames that are not part of a rest.
NOT_AT_REST = NO_PAST | {"byte_order"}
# Flags of frames whose readings are not those of the rest that was learned.
NOT_THAT_REST = NOT_AT_REST | {"drift", "below_rest", "frozen"}


def load(
    path: str | Path,
    switch_on: float | None = None,
    switch_off: float | None = None,
    ground: Plane | None = None,
    in_cell: bool = False,
    follow_drift: bool = True,
    creep: tuple[float, float] | None = None,
    noise: str | Path | None = None,
) -> "Skin":
    """Read a calibration file and return its skin.

    Parameters
    ----------
    path : path
        Of a ``*.calibration.json`` file.
    switch_on, switch_off, ground, in_cell, follow_drift, creep
        As for :class:`Skin`.
    noise : path, optional
        Of a file of :meth:`Skin.save_noise`, or of ``skin-calib tare``, with what the readings at rest taught.

    Raises
    ------
    CalibrationFormatError
        If a file is not valid, or the noise is of another calibration; ``findings`` has every problem.
    """
    from ..calibration.file import load_calibration  # imported late: only a caller with a file needs these modules

    skin = Skin(load_calibration(path), switch_on, switch_off, ground, in_cell, follow_drift, creep)
    if noise is not None:
        skin.load_noise(noise)
    return skin


class Skin:
    """Taxels of all patches of one link; row i of every array is the same taxel.

    One thread at a time may update a skin. A second one gets a frame without values, with the flag ``concurrent``.

    Parameters
    ----------
    calibration : LinkCalibration
        Taxels and responses.
    switch_on, switch_off : float, optional
        Forces from which on a taxel becomes active, and down to which it stays active [N]. With them you state that a
        force above them is a contact. Default: the noise at rest decides, see :meth:`tare`. One alone: the other is
        twice as large, or half.
    ground : Plane, optional
        The plane on which the link stands, in its frame. Default for a flat skin: the plane through its taxels, below
        the robot. A skin around a limb has no ground, and therefore no CoP, ZMP and polygons.
    in_cell : bool
        Whether CoP, ZMP and wrench count the pressure gradient within the cells at partial contact, too. This is exact
        for a layer of springs, and better than nothing for soft skins on edges; on pebbles it is worse.
    follow_drift : bool
        Whether the baseline of a free taxel follows its mean. A load that grows more slowly than
        ``noise.rate_limits`` [N/s] then counts as drift. Without it, drift is only reported.
    creep : tuple of two float, optional
        How much a reading rises under a constant load, relative to its first value, and the time constant of the rise
        [s]. A larger fraction than the true one makes guaranteed polygons smaller. Default: no creep.

    Raises
    ------
    ValueError
        If the forces are not ``0 < switch_off <= switch_on``, or the creep is negative.
    """

    def __init__(
        self,
        calibration: "LinkCalibration",
        switch_on: float | None = None,
        switch_off: float | None = None,
        ground: Plane | None = None,
        in_cell: bool = False,
        follow_drift: bool = True,
        creep: tuple[float, float] | None = None,
    ):
        self._has_thresholds = switch_on is not None or switch_off is not None
        if switch_on is None:
            switch_on = SWITCH_ON if switch_off is None else switch_off * SWITCH_ON / SWITCH_OFF
        if switch_off is None:
            switch_off = switch_on * (SWITCH_OFF / SWITCH_ON)
        if not 0 < switch_off <= switch_on:
            raise ValueError(f"switch_off {switch_off} must be positive and at most switch_on {switch_on}")
        self.link = calibration.link
        self._calibration = calibration
        self.geometry = SkinGeometry(calibration)
        plane = ground or ground_of(self.positions, self.normals, self.areas)
        self.ground = None if plane is None else GroundGeometry(self.geometry, plane)
        self.switch_on, self.switch_off = switch_on, switch_off
        self._terms = Terms(np.zeros((len(self.ids), 6)), self.geometry.terms)  # of the sums at partial contact
        if self.ground is not None:
            self._terms = self.ground.in_cell if in_cell else self.ground.plain
        self._readings = Readings(calibration, self.geometry, follow_drift, creep)
        self._faults = Faults(self._readings.responses)
        self._modalities = Modalities(calibration.modalities, self.link, self.ids, self.channels)
        self._rest: Rest | None = None if self._has_thresholds else Rest()
        self._assumed = Assumed()
        self._turn = [None]  # empty while a thread is in ``update``
        self._clock = Clock()
        self._identities = Identities(len(self.ids))
        self._active: BoolArray = np.zeros(len(self.ids), bool)
        self._streak = Streak(len(self.ids))
        self._lost = Lost(self.geometry)
        self._footprint = Footprint(self.geometry, self.ground, np.zeros(len(self.ids), bool))

    @property
    def warnings(self) -> "tuple[Warning, ...]":
        """Warnings of the fit and of the placement: code, severity, message with position and value, advice."""
        return self._calibration.warnings

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

    @cached_property
    def checksum(self) -> str:
        """Checksum of the calibration, as in its file."""
        from ..calibration.file import to_document

        return str(to_document(self._calibration)["checksum"])

    @property
    def modalities(self) -> dict[str, str]:
        """Unit of each further modality that :meth:`update` takes, by its name."""
        return self._modalities.units

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
    def noise(self) -> Noise | None:
        """Noise of the readings at rest, with ``detection_limits`` (n,) and ``load_limit`` [N]; None if unknown."""
        return self._readings.noise

    @property
    def thresholds(self) -> Array:
        """Force (n,) from which on each taxel counts as possibly touched [N]."""
        if self._has_thresholds or self.noise is None:
            return np.full(len(self.ids), self.switch_on)
        return self.noise.detection_limits

    @property
    def drift(self) -> Array:
        """Change of the readings (n,) without contact since the noise was learned. It is subtracted from readings."""
        offset = self._readings.drift.offset
        return np.zeros(len(self.ids)) if offset is None else offset.copy()

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
        raw = self._readings.intensities(readings)
        forces, known = self._readings.forces(self._readings.corrected(raw))
        return np.where(known, forces, np.nan)

    def tare(self, readings: Any, accept: bool = False) -> Tare:
        """Set the baseline: these readings give no force from now on. Of several frames the mean counts.

        Frames of about one second, 20 at least, also give the noise of each taxel. The sets of touched taxels, the
        polygons with their probabilities and all standard deviations follow from it. Where readings are clipped at one
        end, the mean is that of the normal distribution before the clipping. Without a call, the first quiet frames of
        :meth:`update` do the same, if there is no warning; until then frames have the flag ``noise_unknown``.

        Parameters
        ----------
        readings : array, shape (channels,) or (frames, channels)
            Without contact. A taxel without a finite number keeps its baseline.
        accept : bool
            Whether they count although they are those of a load by the response: the sensors have offsets. Or although
            they may be in another unit than the response.

        Returns
        -------
        Tare
            What was learned, with the warnings that were accepted.

        Raises
        ------
        InvalidReading
            As for :meth:`forces`; if some of 8 or more frames have a contact that the others do not have; and if the
            readings have a warning. The baseline does not change.
        """
        rows, dtype = self._readings.at_rest(readings)
        responses, alive = self._readings.responses, self._readings.alive
        forces = contacts_during(np.where(alive, rows, np.nan), responses, is_whole(dtype))
        if len(forces) and (most := float(forces.max())) >= self.switch_on:
            raise InvalidReading(
                f"the {len(rows)} readings for a tare are not at rest: the force changes by {most:.2g} N on "
                f"{self.ids[forces.argmax()]}. Use a second or more without contact, or mask the taxel if it is "
                "defective",
                flag="not_at_rest",
                force=most,
            )
        rest = self._readings.examined(rows, dtype)
        forces, warnings = judged(rest, np.where(alive, rows, np.nan), dtype, responses, alive, self.geometry)
        if warnings and not accept:
            raise InvalidReading(
                f"the readings for a tare are refused: {'; '.join(warnings)}. Lift the skin, or check the response. If "
                "nothing presses, and the sensors read this at rest, use tare(readings, accept=True)",
                flag="not_at_rest",
                force=float(forces.max(initial=0.0)),
            )
        self._faults.byte_order.learn(rows)
        self._readings.learn(rest)
        self._assumed.end()
        self._rest = None if self._has_thresholds or self.noise is not None else Rest()
        return Tare(len(rows), forces, rest.noise, warnings)

    def save_noise(self, path: str | Path) -> None:
        """Write what the skin learned at rest, baseline and noise, to a file, by convention ``NAME.noise.json``.

        Raises
        ------
        OutputError
            If the file cannot be written.
        """
        from .noise_file import save_noise

        save_noise(path, self.checksum, self.link, self._readings.baseline, self.noise)

    def load_noise(self, path: str | Path) -> None:
        """Read what this skin learned at rest, as after a :meth:`tare`.

        Raises
        ------
        CalibrationFormatError
            If the file is invalid, or of another calibration. The skin does not change.
        """
        from .noise_file import load_noise

        baseline, noise = load_noise(path, self.checksum, self._readings.responses.sign)
        self._readings.restore(baseline, noise)
        self._assumed.end()
        self._rest = None if self._has_thresholds or noise is not None else Rest()

    def mask(self, ids: Iterable[str]) -> None:
        """Leave out these defective taxels from now on; an empty list masks none.

        Raises
        ------
        UnknownTaxel
            If a taxel does not exist. It is a KeyError, too. The masked taxels do not change.
        """
        row = {name: i for i, name in enumerate(self.ids)}
        masked = np.zeros(len(self.ids), bool)
        for name in ids:
            if name not in row:
                raise UnknownTaxel(f"no taxel {name!r} on the skin of {self.link}; use the names in 'ids'")
            masked[row[name]] = True
        self._readings.mask(masked)

    def update(self, readings: Any, time: float) -> Frame:
        """Return the frame of one reading. A wrong reading raises no error.

        Parameters
        ----------
        readings : array, shape (channels,), or mapping of str to array
            One frame of the electronics, of any real data type. If it cannot be read, the frame states why in its
            ``flags`` and ``problem``, nothing in it is known, and the state of the skin does not change. A mapping has
            the readings of force as ``"force"``, and those of other modalities by their names.
        time : float
            Of the reading [s].
        """
        if isinstance(readings, Mapping):
            return self._read(lambda: self._readings.intensities(force_of(readings)), readings, time)
        return self._read(lambda: self._readings.intensities(readings), None, time)

    def update_events(
        self, indices: Any, values: Any, time: float, modalities: Mapping[str, Any] | None = None
    ) -> Frame:
        """Return the frame after some readings changed; all others are those of the last frame.

        The frame is that of :meth:`update` with the complete reading, to the bit, and wrong events raise no error.
        Before the first complete reading, taxels without an event are unknown. A taxel that sends nothing has an
        unchanged reading: the flags ``stuck`` and ``frozen`` mean the same as for complete readings.

        Parameters
        ----------
        indices : array of int, shape (k,)
            Channels of the events. Those that the skin does not have do not count. Of equal ones the last counts.
        values : array, shape (k,)
            Their new readings of force, of the data type of the complete readings.
        time : float
            Of the frame [s].
        modalities : mapping of str to array, shape (channels,), optional
            Complete readings of other modalities, as for :meth:`update`.
        """
        return self._read(lambda: self._readings.after(indices, values), modalities, time, are_events=True)

    def _read(self, force: Callable[[], Array], others: Any, time: float, are_events: bool = False) -> Frame:
        """Return the frame of the readings (n,) that ``force`` returns, and of those of other modalities (or None)."""
        time = float(time)
        try:
            turn = self._turn.pop()  # atomic
        except IndexError:
            why = "another thread updates this skin at the same time"
            return self._unknown(time, frozenset({"concurrent"}), why, self._modalities.nothing)
        try:
            return self._read_alone(force, others, time, are_events)
        finally:
            self._turn.append(turn)

    def _read_alone(self, force: Callable[[], Array], others: Any, time: float, are_events: bool) -> Frame:
        """Return what :meth:`_read` returns, while no other thread does."""
        flags, modalities = self._clock.flags(time), self._modalities.nothing
        try:
            if others is not None:
                others = without_force(others) if are_events else others
                modalities, problems = self._modalities.frame(others, self._readings.alive)
                flags |= problems
            raw = force()
        except InvalidReading as error:
            self._clock.accept(time, is_valid=False)
            return self._unknown(time, flags | {error.flag}, str(error), modalities)
        return self._frame(raw, time, flags, modalities)

    def _frame(self, raw: Array, time: float, flags: frozenset[str], modalities: Mapping[str, ModalityValues]) -> Frame:
        """Return the frame of a reading (n,), and change the state of the skin."""
        signals, noise = self._readings.next(raw), self.noise
        if not signals.is_complete:
            flags |= self._readings.flags(raw, signals.known)
            if not np.count_nonzero(signals.known):
                self._clock.accept(time, is_valid=False)
                return self._unknown(time, flags | {"blind"}, "no taxel has a valid reading", modalities)
        if not self._clock.has_past(time):
            self._forget()
        unchanged = self._faults.unchanged(raw)
        is_new = bool(np.count_nonzero(unchanged) < len(unchanged))
        sets = self._touched(signals, is_new)
        footprint = self._footprint = self._footprint.of(sets.active)
        stuck, saturated, faults = self._faults.of(
            raw, unchanged, signals, sets.active, noise, time, self._clock.period
        )
        flags |= faults
        if sets.pushes.sum() > self.geometry.max_load:
            flags |= {"overload"}
        if noise is None and not self._has_thresholds:
            flags |= {"noise_unknown"}
        if noise is not None:
            stuck, faults = self._readings.drift.faults(noise, sets, stuck)
            flags |= faults
        sets = sets.without(stuck) if "stuck" in flags else sets
        if self._assumed.is_assumed:
            self._assumed.add(bool(sets.stands), flags.isdisjoint(NOT_THAT_REST), time)
            flags |= {"rest_assumed"} if self._assumed.is_assumed else set()
        terms = self._terms if self.ground is None or not footprint.is_full else self.ground.full_contact
        sums, problem, lost = terms.sums.dot(sets.pushes), None, None
        if not signals.is_complete:
            lost, problem = self._lost.of(sets.pushes, signals.known, self._readings.live)
            if problem is not None:
                sums, flags = np.full(12, np.nan), flags | {"lost"}
        self._lost.accept(sets.pushes, None if signals.is_complete else signals.known)
        contacts = contacts_of(footprint, signals.forces, self._identities.follow(footprint), terms)
        sigmas = None if noise is None else partial(force_sigmas, self._readings.responses, signals.shifted, noise)
        frame = Frame(
            time, signals.forces, signals.known, saturated, stuck, contacts, sums[:6], flags, problem, footprint, sets,
            noise, terms, sets.pushes, sums, sigmas, modalities, lost,
        )  # fmt: skip
        self._clock.accept(time)
        self._faults.accept(raw, unchanged, time)
        self._readings.follow(raw, signals.is_complete, time)
        if self._rest is not None and signals.is_complete:
            self._learn(self._rest, raw, frame)
        return frame

    def _forget(self) -> None:
        """Forget the frames before: they say nothing about the next one."""
        self._streak, self._active = Streak(len(self.ids)), np.zeros(len(self.ids), bool)
        self._identities.forget()
        self._lost.forget()
        self._readings.drift.drop_block()
        if self._rest is not None:
            self._rest.clear()

    def _evidence(self, signed: Array | None, forces: Array, known: BoolArray) -> Evidence:
        """Return what readings (..., n) show by themselves: compared with the noise, or with thresholds."""
        noise = self.noise
        if noise is None or signed is None or self._has_thresholds:
            return by_thresholds(forces, known, self.switch_on, self.switch_off)
        return by_noise(noise, self.geometry.neighbours, signed, forces, known)

    def _touched(self, signals: Signals, is_new: bool) -> Touched:
        """Return what is touched in the next frame; ``is_new`` is whether a reading has changed."""
        evidence = self._evidence(signals.signed, signals.forces, signals.known)
        self._active = switched(evidence.on, evidence.stays, self._active)
        known = None if signals.is_complete else signals.known
        active = self._active if known is None else self._active & known
        if self.noise is None or signals.signed is None or evidence.lasting is None:
            return touched_by_load(active, signals.forces, known, self._has_thresholds)
        common = self.noise.common_deviation(signals.signed, known) if evidence.has_load else 0.0
        sure, lasting = over_drift(evidence, self.noise, signals.signed, common)
        lasts = self._streak.add(lasting, is_new)
        return touched_by_noise(evidence, active, sure | lasts, lasts, common)

    def batch(self, readings: Any, times: Any = None) -> Batch:
        """Return the results of many readings at once, without a change of the skin.

        They equal those of :meth:`update` in a loop that starts without contacts, with the baseline, noise and masked
        taxels of now. With times the baseline follows a drift as in the loop, otherwise it stays. A batch learns no
        noise: call :meth:`tare` before. It has no polygons, no standard deviations, no single contacts with their
        numbers, and no flags.

        Parameters
        ----------
        readings : array, shape (T, channels), or mapping of str to array
            Frames of the electronics, of any real data type. A row without a finite number is unknown. A mapping as
            for :meth:`update`.
        times : array, shape (T,), optional
            Of the readings of a log [s]: an active taxel stays active in the next row as in :meth:`update`. Without
            them no row depends on another one, as for the environments of a simulator.

        Raises
        ------
        InvalidReading
            If these are not rows of numbers, are too short for the highest channel, or have an unknown modality.
        ValueError
            If there is not one time for each row.
        """
        rows = self._readings.rows(force_of(readings) if isinstance(readings, Mapping) else readings)
        modalities = {}
        if isinstance(readings, Mapping):
            modalities = self._modalities.batch(readings, self._readings.alive, len(rows))
        times = None if times is None else np.asarray(times, float)
        if times is not None and times.shape != rows.shape[:1]:
            raise ValueError(f"times of shape {times.shape} for {len(rows)} readings; pass one time for each")
        batch = batch_of(rows, times, self._readings, self.geometry, self._evidence, self._sums)
        return replace(batch, modalities=modalities)

    def _sums(self, pushes: Array, active: BoolArray) -> Array:
        """Return the sums (T, 12) of :attr:`.Terms.sums` over parts of them (T, n) [N]; active taxels (T, n)."""
        sums = pushes @ self._terms.sums.T
        if self.ground is not None:
            full = self.ground.is_full(active)
            if full.any():
                sums[full] = pushes[full] @ self.ground.full_contact.sums.T
        return sums

    def _learn(self, rest: Rest, raw: Array, frame: Frame) -> None:
        """Learn baseline and noise from the first quiet frames, of which this is one."""
        if not (frame.flags.isdisjoint(NOT_AT_REST) and math.isfinite(frame.time)):
            rest.clear()
            return
        rows = rest.add(raw, frame.time)
        if rows is None:
            return
        if (found := self._found_rest(rows)) is not None:
            self._faults.byte_order.learn(rows)
            self._readings.learn(found)
            self._assumed.begin()
            self._rest = None if rest.is_complete else rest
        elif self.noise is None:
            rest.clear()
        else:  # a contact ends the rest; the noise of its first frames stays
            self._rest = None

    def _found_rest(self, rows: Array) -> LearnedRest | None:
        """Return what the first readings (frames, n) say; None if they may not be those without contact."""
        readings = self._readings
        if not is_rest(rows, is_whole(readings.dtype)):
            return None
        found = readings.examined(rows, readings.dtype)
        warnings = judged(found, rows, readings.dtype, readings.responses, readings.alive, self.geometry)[1]
        return None if found.noise is None or warnings else found

    def _unknown(
        self, time: float, flags: frozenset[str], problem: str, modalities: Mapping[str, ModalityValues]
    ) -> Frame:
        """Return the frame of a reading of force that cannot be used."""
        n = len(self.ids)
        nothing = np.zeros(n, bool)
        unknown = np.full(6, np.nan)
        return Frame(
            time, np.zeros(n), nothing, nothing, nothing, (), unknown, flags, problem, None, modalities=modalities
        )
