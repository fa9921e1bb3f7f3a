"""``tare``: learn baseline and noise of a skin from recorded readings without contact."""

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..common.errors import CalibrationFormatError, InvalidReading, counted
from ..inspection.recording import read_recording
from ..runtime import Skin, load
from ..runtime.noise import Noise
from .common import DONE, check_outputs, complain, count, file_name, named_path, say, seconds, warn


def add(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("file", type=named_path, metavar="CALIBRATION", help="calibration file")
    parser.add_argument("readings", type=named_path, metavar="READINGS", help="CSV, NPZ or MCAP file with readings")
    parser.add_argument(
        "-o", "--output", type=file_name, metavar="NOISE", help="file for the runtime, NAME.noise.json by convention"
    )
    parser.add_argument(
        "--rest",
        type=seconds,
        metavar="SECONDS",
        help="only the first ones are without contact; what is touched later is listed in its order (default: all are)",
    )
    add_accept(parser)


def add_rest(parser: argparse.ArgumentParser) -> None:
    """Define the options about the readings at rest, for commands with other readings, too."""
    parser.add_argument(
        "--tare", type=count, default=0, metavar="N", help="use the first N readings as readings at rest (default: 0)"
    )
    add_accept(parser)
    parser.add_argument("--noise", type=named_path, metavar="NOISE", help="what skin-calib tare learned at rest")


def add_accept(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--accept",
        action="store_true",
        help="the sensors read this at rest: accept readings at rest that are those of a load, or of another unit",
    )


def run(options: argparse.Namespace) -> int:
    check_outputs(options, options.file, options.readings)
    skin = load(options.file)
    recording = read_recording(options.readings, skin)
    frames = list(recording.frames)
    if not frames:
        raise CalibrationFormatError(f"'{options.readings}' contains no frame. Check that it is the correct file.")
    start = frames[0][0]
    at_rest = len(frames) if options.rest is None else sum(time - start < options.rest for time, _ in frames)
    rest = rested(skin, [reading for _, reading in frames[:at_rest]], options.readings, options.accept)
    warn(recording.notes)
    lines = [f"link             {skin.link}, {len(skin.ids)} taxels", f"columns          {recording.columns}"]
    lines += [f"rest             {rest}", *_touches(skin, frames[at_rest:])]
    if skin.noise is None:
        complain("warning: these readings say nothing about the noise: record a second or more, 20 frames at least")
    if options.output:
        skin.save_noise(options.output)
        lines.append(f"written          {options.output}")
    say("\n".join(lines))
    return DONE


def rested(skin: Skin, rows: Sequence[np.ndarray], path: Path, accept: bool = False) -> str:
    """Tare a skin with readings of a recording; return what they show, for the summary."""
    try:
        tare = skin.tare(rows, accept)
    except InvalidReading as problem:
        advice = str(problem).replace("use tare(readings, accept=True)", "add --accept")
        raise CalibrationFormatError(f"'{path}', readings at rest: {advice}") from problem
    for warning in tare.warnings:
        complain(f"warning: the readings at rest are accepted, although {warning}")
    most = tare.forces.max(initial=0.0)
    text = f"{counted(tare.frames, 'frame')}; {tare.forces.sum():.2f} N in total count as offset, "
    return f"{text}at most {most:.2f} N on a taxel{'' if skin.noise is None else f'; noise {limits_of(skin.noise)}'}"


def limits_of(noise: Noise) -> str:
    """Return what noise hides, as words."""
    dead = f", {counted(int(np.count_nonzero(noise.dead)), 'taxel')} dead" if noise.has_dead else ""
    known = noise.detection_limits[np.isfinite(noise.detection_limits)]
    limit = f"{np.median(known):.2g} N on a taxel, " if len(known) else ""
    return f"hides up to {limit}{noise.load_limit:.2g} N in total{dead}"


def _touches(skin: Skin, frames: Sequence[tuple[float, np.ndarray]]) -> list[str]:
    """Return a line for each contact of these frames, in their order: its strongest taxel, with time and force."""
    found, below = dict[int, tuple[float, float, str]](), 0
    for time, reading in frames:
        frame = skin.update(reading, time)
        below += "below_rest" in frame.flags
        for contact in frame.contacts:
            k = int(np.argmax(contact.forces))
            if contact.number not in found or contact.forces[k] > found[contact.number][1]:
                found[contact.number] = time, float(contact.forces[k]), skin.ids[contact.taxels[k]]
    if below:
        complain(f"warning: below_rest in {below} of {len(frames)} later frames: something may have pressed at rest")
    touches = sorted(found.values())
    return [f"touch {k + 1:<10} {name}, {force:.2f} N at {time:.2f} s" for k, (time, force, name) in enumerate(touches)]
