"""Replay of a recording on the skin of a link; frames are available in any order."""

from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from ..calibration.model import LinkCalibration
from ..common.arrays import Array
from ..common.errors import CalibrationFormatError, InvalidReading
from ..runtime import Frame, Skin
from .all_taxels import AllTaxels
from .recording import MAX_NUMBERS, read_recording

# Period of the frames if the times of a recording do not increase [s]. Larger: slower replay.
DEFAULT_PERIOD = 0.01


class Replay:
    """Readings of a recording, processed by the runtime."""

    def __init__(
        self,
        calibration: LinkCalibration,
        recorded: Iterable[tuple[float, Array]],
        name: str,
        columns: str = "",
        notes: Sequence[str] = (),
    ):
        self.taxels = AllTaxels.of(calibration.patches)
        self.columns = columns  # which columns of the recording are which channels
        self.notes = notes  # what a person should know of the recording
        self._skin = Skin(calibration)
        self._frames: list[Frame] = []
        self.strongest = 0.0  # largest force on a taxel in any frame [N]
        self._readings: list[Array] = []
        times = []
        for time, reading in recorded:
            self._take(reading, name)
            times.append(time)
        if not times:
            raise CalibrationFormatError(f"'{name}' has no frame")
        self.times = np.array(times, float)  # (frames,) as recorded [s]
        self.seconds = since_start(self.times)  # (frames,) non-decreasing

    @classmethod
    def read(cls, calibration: LinkCalibration, path: str | Path) -> "Replay":
        """Read a recording from a file, see `read_recording`."""
        recording = read_recording(path, Skin(calibration))
        return cls(calibration, recording.frames, Path(path).name, recording.columns, recording.notes)

    def _take(self, reading: Array, name: str) -> None:
        """Check a reading and store it."""
        if (len(self._readings) + 1) * len(self.taxels.ids) > MAX_NUMBERS:
            most = MAX_NUMBERS // len(self.taxels.ids)
            raise CalibrationFormatError(
                f"'{name}' has more than {most} frames, which is too long. Split it into parts"
            )
        try:
            forces = self._skin.forces(reading)
        except InvalidReading as error:
            raise CalibrationFormatError(f"'{name}', frame {len(self._readings)}: {error}") from error
        self.strongest = max(self.strongest, float(forces[np.isfinite(forces)].max(initial=0.0)))
        self._readings.append(reading)

    def __len__(self) -> int:
        return len(self._readings)

    @property
    def duration(self) -> float:
        """Time from the first frame to the end of the last one [s]."""
        return float(self.seconds[-1] + (self.seconds[-1] / (len(self) - 1) if len(self) > 1 else DEFAULT_PERIOD))

    def at(self, seconds: float) -> int:
        """Return the frame at a time after the first one [s]."""
        return int(np.clip(np.searchsorted(self.seconds, seconds, side="right") - 1, 0, len(self) - 1))

    def frame(self, k: int) -> Frame:
        """Return the result of frame k after all frames before it: contacts keep their numbers."""
        for i in range(len(self._frames), k + 1):
            self._frames.append(self._skin.update(self._readings[i], self.times[i]))
        return self._frames[k]


def since_start(times: Array) -> Array:
    """Return non-decreasing seconds since the first time; even steps if no time increases.

    A time that is not finite, or smaller than the one before, is replaced by the one before.
    """
    known = np.isfinite(times)
    since = np.where(known, times, 0.0) - times[known][:1].sum()
    seconds: Array = np.maximum.accumulate(np.where(known, since, 0.0).clip(0))
    return seconds if seconds[-1] > 0 else DEFAULT_PERIOD * np.arange(len(times), dtype=float)
