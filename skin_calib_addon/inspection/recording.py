"""Recorded readings of a controller, cycle by cycle, from a CSV, NPZ or MCAP file."""

import math
import zipfile
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import takewhile
from pathlib import Path
from typing import Any

import numpy as np

from ..common.arrays import Array
from ..common.errors import CalibrationFormatError, counted, listed
from ..common.strict_json import size_of
from ..common.tables import TableError, naming_file, read_rows
from ..common.text import NumberError, read_text, real
from ..messages.mcap_file import RecordedReadings
from ..runtime.footprint import SupportingPolygon
from ..runtime.frame import Frame
from ..runtime.modalities import FORCE
from ..runtime.polygon import Polygon
from ..runtime.skin import Skin
from .columns import Columns, ColumnsError, match_columns

# Limit of the numbers of an array of a recording or a replay: half a gigabyte. It protects the memory, because an NPZ
# file can be a thousand times smaller than its arrays. Larger: accepts longer recordings.
MAX_NUMBERS = 2**26
CONTACT = ("number", "ids", "force", "area", "peak_pressure", "position", "normal", "wrench")  # Contract: of a frame
SIGMAS = ("force_sigmas", "wrench_sigma", "cop_sigma", "zmp_sigma")  # Contract: of a frame


@dataclass(frozen=True, eq=False)
class Recording:
    """Time [s] and reading of each frame of a file, in the order of the channels of a skin."""

    frames: Iterator[tuple[float, Array]]
    columns: str  # which columns of the file are which channels
    notes: tuple[str, ...] = ()  # what a person should know of the recording
    cycles: Sequence[int] | None = None  # number of each frame; None: in their order
    modalities: Callable[[], dict[str, Array]] = dict  # reads the readings (t, channels) of those that the file has

    def by_quantity(self) -> list[tuple[float, dict[str, Array]]]:
        """Read time [s] and readings of all frames: those of the force and of the modalities, by their names."""
        others = self.modalities()
        return [
            (time, {FORCE: row} | {name: rows[k] for name, rows in others.items()})
            for k, (time, row) in enumerate(self.frames)
        ]


def read_recording(path: str | Path, skin: Skin) -> Recording:
    """Open a recording for a skin; its frames are read one by one."""
    path = Path(path)
    if not skin.ids:
        raise CalibrationFormatError(f"{skin.link} has no taxels, so '{path}' cannot be replayed. Add a skin")
    if path.suffix.lower() == ".mcap":
        return _messages(path, skin)
    return _packed(path, skin) if path.suffix.lower() == ".npz" else _table(path, skin)


def faults_of(found: RecordedReadings, checksum: str) -> list[str]:
    """Return what is missing in the readings of an MCAP file, and calibrations in it with another checksum."""
    notes = []
    if found.is_cut:
        notes.append(
            f"the file ends early, after {len(found.times)} readings: its recorder was interrupted, or it is damaged"
        )
    if found.missing:
        notes.append(f"{counted(found.missing, 'reading')} missing in the file, by the cycle numbers")
    if found.restarts:
        notes.append(f"the cycle numbers begin again {counted(found.restarts, 'time')}: the sender restarted")
    if others := found.calibrations - {checksum}:
        named = listed(sorted(f"{other[:12]}..." for other in others))
        notes.append(
            f"recorded with another calibration ({named}). Check that its channels are the same: skin-calib diff"
        )
    return notes


def _messages(path: Path, skin: Skin) -> Recording:
    """Open an MCAP file."""
    found = RecordedReadings(path, skin.link, MAX_NUMBERS)
    notes = faults_of(found, skin.checksum)
    text = f"messages of the link {skin.link}; numbers of a message are channels from 0 on"

    def modalities() -> dict[str, Array]:
        return {name: rows for name in skin.modalities if (rows := found.of(name)) is not None}

    frames = iter(zip(found.times, found.readings))
    return Recording(frames, text, notes=tuple(notes), cycles=found.cycles, modalities=modalities)


def _packed(path: Path, skin: Skin) -> Recording:
    length = skin.reading_length
    time, readings = _arrays(path, lambda _: ["time", "readings"]).values()
    if time.ndim != 1 or time.dtype.kind not in "uif" or readings.shape[:1] != time.shape or readings.ndim != 2:
        shapes = f"time {time.dtype} {time.shape} and readings {readings.dtype} {readings.shape}"
        raise CalibrationFormatError(f"'{path}' has {shapes}. Give numbers of shapes (t,) and (t, channels)")
    width = readings.shape[1]
    text = f"readings[:, 0] to readings[:, {length - 1}] are channels 0 to {length - 1}"
    if width > length:
        text += f"; not used: readings[:, {length}]" + (f" to readings[:, {width - 1}]" if width > length + 1 else "")
    frames = iter(zip(time.astype(float).tolist(), readings))
    return Recording(frames, text, modalities=lambda: _other_arrays(path, skin.modalities, len(time)))


def _other_arrays(path: Path, names: Collection[str], count: int) -> dict[str, Array]:
    """Return the readings of the modalities in an NPZ file with a number of frames."""
    stored = _arrays(path, lambda there: [name for name in names if name in there])
    for name, rows in stored.items():
        if rows.shape[:1] != (count,) or rows.ndim != 2:
            what = f"{name} {rows.dtype} {rows.shape} for {count} frames"
            raise CalibrationFormatError(f"'{path}' has {what}. Give numbers of shape (t, channels)")
    return stored


def _arrays(path: Path, choose: Callable[[Collection[str]], Iterable[str]]) -> dict[str, np.ndarray]:
    """Return some arrays of an NPZ file by their names."""
    size_of(path)
    if not zipfile.is_zipfile(path):  # NumPy would take it for a pickle
        raise CalibrationFormatError(f"cannot read '{path}': it is not an NPZ file; save it with numpy.savez")
    try:
        with zipfile.ZipFile(path) as archive:
            stored = [member.removesuffix(".npy") for member in archive.namelist()]
            return {name: _array(archive, name) for name in choose(stored)}
    except CalibrationFormatError as problem:
        raise CalibrationFormatError(f"'{path}' {problem}") from problem
    except Exception as problem:  # the readers raise many types of exceptions for damaged files
        raise CalibrationFormatError(f"cannot read '{path}': {problem}. Save it again with numpy.savez") from problem


def _array(archive: zipfile.ZipFile, name: str) -> np.ndarray:
    """Read an array of an archive; its header states its size before memory is used."""
    stored = [member.removesuffix(".npy") for member in archive.namelist()]
    if name not in stored:
        raise CalibrationFormatError(f"has no array '{name}'; it has {sorted(stored)}")
    with archive.open(f"{name}.npy") as file:
        version = np.lib.format.read_magic(file)
        read_header = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        shape = read_header(file)[0]
    if math.prod(shape) > MAX_NUMBERS:
        raise CalibrationFormatError(
            f"has {math.prod(shape)} numbers in the array '{name}', more than {MAX_NUMBERS}. Split the file"
        )
    with archive.open(f"{name}.npy") as file:
        return np.lib.format.read_array(file, allow_pickle=False)


def _table(path: Path, skin: Skin) -> Recording:
    rows = read_rows(read_text(path))
    with naming_file(path):
        line, header = next(rows, (1, []))
    try:
        columns = match_columns(header, skin.ids, skin.channels.tolist())
    except ColumnsError as problem:
        raise CalibrationFormatError(f"'{path}', line {line}: the header {problem}") from problem
    return Recording(_rows(path, rows, len(header), columns), columns.text)


def _rows(
    path: Path, rows: Iterator[tuple[int, list[str]]], width: int, columns: Columns
) -> Iterator[tuple[float, Array]]:
    length, places = max(columns.channels) + 1, columns.channels.values()
    with naming_file(path):
        for line, row in rows:
            if len(row) > width:
                raise TableError(line, f"the row has {len(row)} columns, but the header has {width}")
            cells = [_number(cell, path, line, k + 1) for k, cell in enumerate(row)]
            time = cells[columns.time] if columns.time < len(cells) else np.nan
            given = [cells[k] for k in takewhile(len(cells).__gt__, places)]  # up to the first missing channel
            reading = np.full(length, np.nan)
            reading[list(columns.channels)[: len(given)]] = given
            yield time * columns.seconds, reading if len(given) == len(places) else reading[: len(given)]


def _number(cell: str, path: Path, line: int, column: int) -> float:
    word = cell.strip()
    try:
        return real(word) if word else np.nan
    except NumberError as problem:
        if problem.code == "not-finite":
            return float(word)
        raise CalibrationFormatError(f"'{path}', line {line}, column {column}: {problem}") from problem


def frame_document(frame: Frame, checksum: str) -> dict[str, Any]:
    """Return a frame as JSON values in SI units, with the checksum of its calibration.

    Contacts and wrench are in the link frame, polygons, CoP and ZMP in coordinates of the ground. Unknown values are
    null. Modalities are those with a reading.
    """
    given = {
        name: {"unit": m.unit, "values": _known_all(m.values)}
        for name, m in frame.modalities.items()
        if m.problem is None
    }
    return {
        "time": _known(frame.time),
        "flags": sorted(frame.flags),
        "touched": frame.touched,
        "wrench": None if frame.problem is not None else frame.wrench.tolist(),
        "contacts": [{name: _plain(getattr(contact, name)) for name in CONTACT} for contact in frame.contacts],
        "cop": None if frame.cop is None else frame.cop.tolist(),
        "zmp": None if frame.zmp is None else frame.zmp.tolist(),
        "reason": frame.reason,
        "polygon": _polygons(frame.polygon),
        **({"modalities": given} if given else {}),
        "forces": [force if known else None for force, known in zip(frame.forces.tolist(), frame.known.tolist())],
        **{name: _known_all(getattr(frame, name)) for name in SIGMAS},
        "calibration": checksum,
    }


def _plain(value: Any) -> Any:
    """Return a value of a contact as a JSON value."""
    return value.tolist() if isinstance(value, np.ndarray) else list(value) if isinstance(value, tuple) else value


def _polygons(polygon: SupportingPolygon) -> dict[str, Any]:
    parts: dict[str, Polygon] = {n: getattr(polygon, n) for n in ("outer", "nominal", "guaranteed")}
    return {name: part.corners.tolist() for name, part in parts.items()}


def _known_all(numbers: Array | None) -> list[float | None] | None:
    return None if numbers is None else [_known(number) for number in numbers.tolist()]


def _known(number: float) -> float | None:
    return number if np.isfinite(number) else None
