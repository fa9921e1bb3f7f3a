"""``run``: process readings while they arrive, and publish the frames."""

import argparse
import runpy
import select
import signal
import sys
import time
from collections.abc import Callable, Mapping
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..calibration.file import load_calibration
from ..calibration.model import LinkCalibration
from ..common.errors import CalibrationFormatError
from ..common.interruptions import handled
from ..live.inputs import FileInput, Input, SerialInput, UdpInput
from ..live.loop import Status, undisturbed
from ..live.loop import run as run_loop
from ..live.outputs import McapOutput, Output, UdpOutput
from ..messages.packet import Decoder, Reading
from ..runtime import Skin, load
from ..runtime.modalities import FORCE
from .common import DONE, check_target, complain, named_path, say
from .tare import add_rest, rested

# [s] after the first signal in which others change nothing: "timeout" sends two at once. Larger: a longer wait for a
# program that does not answer.
PATIENCE = 1.0
BAUD = 115_200  # Contract: of a serial line without a number
LOCAL = "127.0.0.1"


class Place(NamedTuple):
    """An input or output: its kind, and what follows, with a number at its end."""

    kind: str
    name: str
    number: int = 0


def add(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("file", type=named_path, metavar="CALIBRATION", help="calibration file")
    parser.add_argument(
        "--input",
        type=place_of("udp:PORT", "serial:DEVICE", "mcap:FILE"),
        required=True,
        metavar="INPUT",
        help="udp:PORT or udp:ADDRESS:PORT (of this computer; default: 127.0.0.1), serial:DEVICE or serial:DEVICE:BAUD "
        f"(default: {BAUD}), or mcap:FILE, which is played at its own speed",
    )
    parser.add_argument(
        "--output",
        type=place_of("dds", "mcap:FILE", "udp:HOST:PORT"),
        action="append",
        required=True,
        metavar="OUTPUT",
        help="dds (topics of ROS 2, on this computer only unless CYCLONEDDS_URI is set), mcap:FILE (a new file), "
        "udp:PORT or udp:HOST:PORT (a SkinFrame in each datagram); can be given several times",
    )
    add_rest(parser)
    parser.add_argument(
        "--decoder",
        type=named_path,
        metavar="PYTHON",
        help="file of yours that is run, with a class Decoder for other electronics (default: packets of Skin Calib)",
    )
    parser.add_argument(
        "--arrival-time",
        action="store_true",
        help="the time of a reading is that of its arrival on the clock of this computer (default: that in the packet)",
    )


def place_of(*forms: str) -> Callable[[str], Place]:
    """Return a parser of an input or output that has one of these forms, such as ``mcap:FILE``."""
    has_name = {form.partition(":")[0]: ":" in form for form in forms}

    def parsed(text: str) -> Place:
        kind, _, name = text.partition(":")
        if has_name.get(kind) is not bool(name):
            raise argparse.ArgumentTypeError(f"{text!r} is not {', '.join(forms[:-1])} or {forms[-1]}")
        before, _, last = name.rpartition(":")
        if kind == "serial" and before and last.isdecimal():
            if not 0 < int(last) < 2**31:
                raise argparse.ArgumentTypeError(f"{text!r} does not end with a baud rate, 1 to {2**31 - 1}")
            return Place(kind, before, int(last))
        if kind == "serial":
            return Place(kind, name, BAUD)
        if kind == "udp":
            if not last.isdecimal() or not 0 < int(last) < 2**16:
                raise argparse.ArgumentTypeError(f"{text!r} does not end with a port, 1 to 65535")
            return Place(kind, before or LOCAL, int(last))
        return Place(kind, name)

    return parsed


def run(options: argparse.Namespace) -> int:
    for place in options.output:
        if place.kind == "mcap":
            check_target(Path(place.name), options.file, options.noise)
    if options.tare and options.noise:
        options.refuse("--tare and --noise both say what the sensors read at rest; give one of them")
    if options.decoder and options.input.kind == "mcap":
        options.refuse("--decoder is for packets of udp and serial, not for mcap")
    if len({options.input, *options.output}) <= len(options.output):
        options.refuse("--input and --output must all differ; one of them is given twice")
    calibration, skin = load_calibration(options.file), load(options.file, noise=options.noise)
    if not skin.ids:
        raise CalibrationFormatError(f"'{options.file}': {skin.link} has no taxels. Add a skin")
    decoder = Decoder() if options.decoder is None else _decoder(options.decoder)
    stops: list[float] = []  # when signals came [s]

    def stop(*_: Any) -> None:
        stops.append(time.monotonic())
        if stops[-1] - stops[0] > PATIENCE:  # the first one had no effect, for example because a disk does not answer
            raise KeyboardInterrupt

    # The priority before the outputs: threads of DDS inherit it.
    with handled(stop, signal.SIGINT, signal.SIGTERM), undisturbed() as priority, ExitStack() as stack:
        given = _input(options.input, skin, decoder)
        stack.callback(given.close)
        outputs: list[Output] = []
        for place in options.output:
            outputs.append(_output(place, calibration, skin))
            stack.callback(outputs[-1].close)
        for note in given.notes:
            _report(f"warning: {note}")
        _report(f"{given.text} to {', '.join(output.text for output in outputs)}; {priority}")
        status = Status(decoder, outputs)
        run_loop(
            calibration,
            skin,
            given,
            outputs,
            status,
            _report,
            lambda: bool(stops),
            options.tare,
            lambda rows: f"rest: {rested(skin, rows, options.input.name, options.accept)}",
            options.arrival_time,
        )
        say(status.total())
    return DONE


def _report(message: str) -> None:
    """Print a message if its reader takes it: a terminal over a network may not, and must not stop the loop."""
    with suppress(OSError, ValueError):  # for what is no pipe and no terminal
        if not select.select((), (sys.stderr,), (), 0)[1]:
            return
    complain(message)


def _decoder(path: Path) -> Any:
    """Return the decoder of a Python file, whose readings are checked."""
    try:
        decoder = runpy.run_path(str(path))["Decoder"]()
    except (Exception, SystemExit) as problem:  # whatever the file of the user raises
        what = f"{type(problem).__name__}: {problem}"
        raise CalibrationFormatError(f"cannot use a class Decoder of '{path}': {what}. Correct the file") from problem
    if not callable(getattr(decoder, "feed", None)):
        raise CalibrationFormatError(f"the class Decoder of '{path}' has no method feed(data, is_datagram). Add it")
    return _Checked(decoder, path)


class _Checked:
    """A decoder of the user, whose errors and readings are named."""

    def __init__(self, decoder: Any, path: Path):
        self._decoder, self._path = decoder, path

    def __getattr__(self, name: str) -> Any:
        return getattr(self._decoder, name)

    def feed(self, data: bytes, is_datagram: bool) -> list[Reading]:
        """Return the readings that the decoder returns."""
        try:
            found = list(self._decoder.feed(data, is_datagram))
            for reading in found:
                _check(reading)
        except (Exception, SystemExit) as problem:
            what = f"the class Decoder of '{self._path}' failed: {type(problem).__name__}: {problem}"
            raise CalibrationFormatError(f"{what}. Correct the file") from problem
        return found


def _check(reading: Any) -> None:
    """Check what a decoder of the user has returned."""
    if not isinstance(reading, Reading):
        raise TypeError(f"{reading!r:.40} is not a Reading")
    if not isinstance(reading.cycle, int | np.integer) or not 0 <= reading.cycle < 2**63:
        raise ValueError(f"the cycle {reading.cycle!r:.40} is not a number from 0 on")
    if not isinstance(reading.time, int | float | np.number) or not np.isfinite(reading.time):
        raise ValueError(f"the time {reading.time!r:.40} is not a number of seconds")
    values = reading.values if isinstance(reading.values, Mapping) else {FORCE: reading.values}
    if FORCE not in values:
        raise ValueError(f"values have no {FORCE}")
    for row in map(np.asarray, values.values()):
        if row.dtype.kind not in "buif" or row.ndim != 1:
            raise TypeError("values are not a list of numbers")


def _input(place: Place, skin: Skin, decoder: Any) -> Input:
    if place.kind == "udp":
        return UdpInput(place.name, place.number, decoder)
    if place.kind == "serial":
        return SerialInput(place.name, place.number, decoder)
    return FileInput(Path(place.name), skin)


def _output(place: Place, calibration: LinkCalibration, skin: Skin) -> Output:
    if place.kind == "udp":
        return UdpOutput(place.name, place.number, skin)
    if place.kind == "mcap":
        return McapOutput(Path(place.name), calibration, skin)
    from ..live.dds import DdsOutput  # cyclonedds is optional

    return DdsOutput(skin.link)
