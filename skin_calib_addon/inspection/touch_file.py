"""Touches from any file: a table, or an MCAP file with readings and what was measured with them."""

import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..calibration.file import to_document
from ..calibration.model import LinkCalibration
from ..common.arrays import Array
from ..common.errors import CalibrationFormatError, counted, listed
from ..common.findings import show
from ..geometry.mesh.triangle_mesh import TriangleMesh
from ..messages.mcap_file import PROBES, RecordedReadings
from ..validation import Touches, read_touches
from ..validation.presses import Recorded
from ..validation.touches import MAX_NUMBERS, touches_of
from .recording import faults_of
from .tool_contacts import tool_contacts

# [s] between a reading and the nearest wrench or point, above which the reading is left out. Larger: readings in gaps
# of the recording get a wrench that was not measured.
MAX_GAP = 0.1


def read_touch_file(
    path: str | os.PathLike[str], calibration: LinkCalibration, link_mesh: Callable[[], TriangleMesh]
) -> Touches:
    """Read touches from a table as `read_touches`, or from an MCAP file.

    ``link_mesh`` returns the mesh of the link, which poses of a tool need.

    An MCAP file has the readings of the link (``SkinReading``), and wrenches (``WrenchStamped``) or points of the probe
    (``PointStamped``) in its frame: their ``frame_id`` is the link. They are interpolated at the times of the readings.
    """
    if Path(path).suffix.lower() != ".mcap":
        return read_touches(path, calibration, lambda poses: tool_contacts(poses, link_mesh()))
    found = RecordedReadings(Path(path), calibration.link, MAX_NUMBERS, with_probes=True)
    probes = {field: np.array(rows) for field, rows in found.probes.items() if rows}
    if not probes:
        frames = f", only in that of {listed(sorted(map(show, found.frames)))}" if found.frames else ""
        raise CalibrationFormatError(
            f"'{path}' has no {' or '.join(PROBES)} in the frame of {show(calibration.link)}{frames}. Record one "
            "of them with this frame_id"
        )
    ids = tuple(name for patch in calibration.patches for name in patch.taxels.ids)
    channels = np.concatenate([patch.taxels.channels for patch in calibration.patches])
    short = next((len(reading) for reading in found.readings if len(reading) <= channels.max()), None)
    if short is not None:
        raise CalibrationFormatError(
            f"'{path}' has a reading of {short} channels, and the calibration has the channel {channels.max()}. "
            "Use the calibration of the recording"
        )
    times = np.array(found.times)
    for what, stamps in (
        ("readings", times),
        *(({"wrench": "wrenches", "point": "points"}[field], rows[:, 0]) for field, rows in probes.items()),
    ):
        if (back := np.flatnonzero(np.diff(stamps) < 0)).size:
            raise CalibrationFormatError(
                f"'{path}': the time of the {what} goes back after {stamps[back[0]] - times[0]:.3f} s. Record it again"
            )
    near = np.all([_gaps(times, rows[:, 0]) <= MAX_GAP for rows in probes.values()], axis=0)
    if not near.any():
        raise CalibrationFormatError(
            f"'{path}' has no {' and '.join(probes)} within {MAX_GAP:g} s of a reading. Check the clocks"
        )
    rows = np.flatnonzero(near)
    readings = np.array([found.readings[k][channels] for k in rows])
    at = {
        field: np.stack([np.interp(times[rows], probe[:, 0], column) for column in probe[:, 1:].T], axis=1)
        for field, probe in probes.items()
    }
    strongest = np.array(ids)[readings.argmax(axis=1)]
    recorded = Recorded(
        rows + 1, strongest, at.get("point"), at.get("wrench"), readings, times[rows] - times[rows[0]], None
    )
    notes = faults_of(found, str(to_document(calibration)["checksum"]))
    if left := len(times) - len(rows):
        of = " and ".join(probes)
        notes.append(f"{counted(left, 'reading')} of {len(times)} without a {of} within {MAX_GAP:g} s, left out")
    touches = touches_of(recorded, ids, calibration, path)
    return replace(touches, notes=(*notes, *touches.notes))


def _gaps(times: Array, stamps: Array) -> Array:
    """Return the time from each of some times to the nearest stamp [s]."""
    after = np.clip(np.searchsorted(stamps, times), 1, max(len(stamps) - 1, 1))
    after = np.minimum(after, len(stamps) - 1)
    return np.minimum(np.abs(times - stamps[after]), np.abs(times - stamps[np.maximum(after - 1, 0)]))
