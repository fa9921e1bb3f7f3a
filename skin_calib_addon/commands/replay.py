"""``replay``: process recorded readings with the runtime."""

import argparse
import io
import json
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..calibration.file import load_calibration
from ..calibration.source_record import find_mesh
from ..common.arrays import Array
from ..common.atomic_file import write_bytes_safely
from ..common.errors import CalibrationFormatError
from ..inspection.recording import frame_document, read_recording
from ..inspection.replaying import since_start
from ..messages.markers import McapView
from ..runtime import Frame, Skin, load
from ..runtime.modalities import FORCE
from .common import DONE, check_outputs, complain, file_name, named_path, newtons, say, warn
from .tare import add_rest, rested

LONG_STEP = 1.0  # between frames, above which the time may be in other units, such as nanoseconds [s]


def add(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("file", type=named_path, metavar="CALIBRATION", help="calibration file")
    parser.add_argument("readings", type=named_path, metavar="READINGS", help="CSV, NPZ or MCAP file with readings")
    parser.add_argument(
        "-o",
        "--output",
        type=file_name,
        metavar="OUT",
        help="contacts, CoP, ZMP and polygons of each frame",
    )
    parser.add_argument(
        "--to",
        choices=("jsonl", "mcap", "rerun"),
        default="jsonl",
        help="format of OUT: JSON, one line per frame; an MCAP file with messages of ROS 2, the readings, and the "
        "calibration; or a file for the viewer of Rerun (default: jsonl)",
    )
    parser.add_argument("--picture", type=file_name, metavar="PNG", help="picture of contacts and polygons on the skin")
    add_rest(parser)
    parser.add_argument(
        "--on",
        type=newtons,
        default=None,
        metavar="NEWTONS",
        help="a contact of a taxel begins at this force (default: the noise at rest decides)",
    )
    parser.add_argument(
        "--off",
        type=newtons,
        default=None,
        metavar="NEWTONS",
        help="a contact of a taxel ends below this force (default: half of --on)",
    )


def run(options: argparse.Namespace) -> int:
    check_outputs(options, options.file, options.readings, options.noise)
    if options.to != "jsonl" and not options.output:
        options.refuse(f"--to {options.to} needs -o OUT, the file to write")
    if options.off is not None and options.on is None:
        options.refuse("--off needs --on: a contact that ends by a threshold begins by one")
    if options.off is not None and options.off > options.on:
        options.refuse(
            f"--off {options.off:g} is larger than --on {options.on:g}: "
            "a contact must end at a lower force than it begins"
        )
    skin = load(options.file, options.on, options.off, noise=options.noise)
    recording = read_recording(options.readings, skin)
    recorded = recording.by_quantity()
    if options.tare > len(recorded):
        raise CalibrationFormatError(
            f"'{options.readings}' has {len(recorded)} frames, fewer than the {options.tare} of --tare. Use fewer."
        )
    rest = ""
    if options.tare:
        rest = rested(skin, [values[FORCE] for _, values in recorded[: options.tare]], options.readings, options.accept)
    frames = [skin.update(values, time) for time, values in recorded]
    if not frames:
        raise CalibrationFormatError(f"'{options.readings}' contains no frame. Check that it is the correct file.")
    if all(frame.problem for frame in frames):
        raise CalibrationFormatError(f"'{options.readings}' does not fit the skin: {frames[0].problem}")
    data = b""
    if options.output and options.to == "mcap":
        readings = [values for _, values in recorded]
        data = _as_mcap(options.file, skin, readings, frames, recording.cycles or range(len(frames)))
    elif options.output:
        data = _as_rerun(options.file, skin, frames) if options.to == "rerun" else _as_lines(skin, frames)
    if options.picture:
        from ..pictures.replay import draw_replay  # matplotlib is optional

        draw_replay(skin, frames, options.picture)
    if options.output:
        write_bytes_safely(options.output, data)
    warn(recording.notes)
    if any(len(values[FORCE]) > skin.reading_length for _, values in recorded):
        complain(
            f"warning: the recording has more numbers than the skin needs ({recording.columns}). "
            "Check that no counter, time or total is among the channels."
        )
    for name in skin.modalities:
        if name not in recorded[0][1]:
            complain(f"warning: the recording has no readings of {name}, which the calibration has")
    steps = np.diff(_finite_times(frames))
    if len(steps) and (step := float(np.median(steps))) > LONG_STEP:
        complain(f"warning: frames are {step:g} s apart (median): time must be in seconds")
    for flag, times in sorted(Counter(flag for frame in frames for flag in frame.flags).items()):
        pressed = ": something may have pressed during those of --tare" if rest and flag == "below_rest" else ""
        complain(f"warning: {flag} in {times} of {len(frames)} frames{pressed}")
    say(_summary(skin, frames, recording.columns, rest))
    return DONE


def _as_lines(skin: Skin, frames: Sequence[Frame]) -> bytes:
    """Return a line of JSON for each frame."""
    documents = (frame_document(frame, skin.checksum) for frame in frames)
    return "".join(json.dumps(d, separators=(",", ":"), allow_nan=False) + "\n" for d in documents).encode()


def _as_mcap(
    file: Path, skin: Skin, readings: Sequence[dict[str, Array]], frames: Sequence[Frame], cycles: Sequence[int]
) -> bytes:
    """Return readings and frames as the bytes of an MCAP file, with the calibration and markers."""
    stream = io.BytesIO()
    with McapView(stream, load_calibration(file), skin, frames) as target:
        for reading, frame, cycle in zip(readings, frames, cycles):
            target.add(reading, frame, cycle)
    return stream.getvalue()


def _as_rerun(file: Path, skin: Skin, frames: Sequence[Frame]) -> bytes:
    """Return frames as the bytes of a file of Rerun, with the mesh of the link if it is found and unchanged."""
    from ..messages.rerun_file import rerun_bytes

    calibration = load_calibration(file)
    mesh = None
    if found := find_mesh(file, calibration.mesh.file):
        from ..pipeline.sources import matching_mesh  # of the authoring

        mesh = matching_mesh(found, calibration.mesh.sha256, calibration.link)
    if mesh is None:
        why = f"{found} has changed" if found else f"{calibration.mesh.file} is not found"
        complain(f"warning: the view is without the mesh of the link: {why}")
    seconds = since_start(np.array([frame.time for frame in frames]))
    return rerun_bytes(calibration, skin, frames, seconds, None if mesh is None else (mesh.vertices, mesh.faces))


def _finite_times(frames: Sequence[Frame]) -> Array:
    """Return the times [s] that are finite."""
    seconds = np.array([frame.time for frame in frames])
    return seconds[np.isfinite(seconds)]


def _summary(skin: Skin, frames: list[Frame], columns: str, rest: str) -> str:
    numbers = {c.number for frame in frames for c in frame.contacts}
    touched = [frame for frame in frames if frame.touched]
    forces = [sum(c.force for c in frame.contacts) for frame in touched]
    cops = np.array([frame.cop for frame in frames if frame.cop is not None])
    most = max(len(frame.contacts) for frame in frames)
    seconds = _finite_times(frames)
    lines = [
        f"link             {skin.link}, {len(skin.ids)} taxels",
        f"columns          {columns}",
        *([f"rest             {rest}"] if rest else []),
        f"frames           {len(frames)}" + (f", {np.ptp(seconds):.3f} s" if len(seconds) else ""),
        f"contacts         {len(numbers)}, at most {most} at a time, in {len(touched)} frames",
    ]
    if forces:
        lines.append(
            f"force            mean {np.mean(forces):.2f} N, largest {max(forces):.2f} N, in frames with contact"
        )
    if len(cops):
        low, high = 1e3 * cops.min(axis=0), 1e3 * cops.max(axis=0)
        lines.append(
            f"CoP              x {low[0]:.1f} to {high[0]:.1f} mm, y {low[1]:.1f} to {high[1]:.1f} mm on the ground"
        )
    return "\n".join(lines)
