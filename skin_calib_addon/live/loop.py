"""The loop: read, compute, publish; count what is wrong, and report it once a second."""

import gc
import os
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from itertools import islice
from typing import Any

from ..calibration.model import LinkCalibration
from ..common.arrays import Array
from ..common.errors import OutputError, SkinCalibError, counted
from ..messages.cdr import encode
from ..messages.content import frame_message, layout_message, reading_message
from ..messages.mcap_file import TOPICS
from ..runtime import Frame, Skin
from ..runtime.modalities import FORCE
from .inputs import Input
from .outputs import Output

PERIOD = 1.0  # [s] between two reports. Smaller: more lines
PRIORITY = 50  # of SCHED_FIFO, 1 to 99; interrupts of the kernel have 50. Larger: the loop can delay them
COUNTERS = ("old", "damaged", "skipped", "restarts")  # Contract: what a decoder may count


class Status:
    """What a run has counted."""

    def __init__(self, decoder: Any, outputs: Sequence[Output]):
        self._decoder, self._outputs = decoder, outputs
        self.start = self._since = time.monotonic()
        self.readings = self.lost = self.restarts = self.frames = 0
        self.cycle: int | None = None
        self.flags: Counter[str] = Counter()
        self._before, self._slowest, self._recent = 0, 0.0, Counter[str]()

    def count(self, cycle: int) -> None:
        """Count a reading by its cycle."""
        step = 1 if self.cycle is None else cycle - self.cycle
        self.lost += max(step - 1, 0)
        self.restarts += step < 0
        self.cycle, self.readings = cycle, self.readings + 1

    def add(self, frame: Frame, seconds: float) -> None:
        """Count a frame that took some seconds."""
        self.frames += 1
        self._slowest = max(self._slowest, seconds)
        self._recent.update(frame.flags)

    def faults(self) -> str:
        """Return all that was counted and is not zero, as words."""
        counts = {"lost": self.lost} | {name: getattr(self._decoder, name, 0) for name in COUNTERS}
        counts["restarts"] += self.restarts
        words = [f"{name} {count}" for name, count in counts.items() if count]
        words += [f"not sent {o.unsent} ({o.reason})" for o in self._outputs if o.unsent]
        words += [f"{o.text} ended" for o in self._outputs if o.failure]
        return ", ".join(words) or "no fault counted"

    def due(self) -> str | None:
        """Return the report if it is time for one."""
        now = time.monotonic()
        if (seconds := now - self._since) < PERIOD:
            return None
        rate = (self.readings - self._before) / seconds
        text = f"{now - self.start:.0f} s: {rate:.0f} readings/s, slowest frame {1e3 * self._slowest:.1f} ms; "
        text += self.faults() + _listed(self._recent)
        self.flags += self._recent
        self._since, self._before, self._slowest, self._recent = now, self.readings, 0.0, Counter()
        return text

    def total(self) -> str:
        """Return the summary of the run."""
        text = f"{counted(self.frames, 'frame')} of {counted(self.readings, 'reading')}; {self.faults()}"
        return text + _listed(self.flags + self._recent)


def _listed(flags: Counter[str]) -> str:
    return "; flags: " + ", ".join(f"{flag} {n}" for flag, n in sorted(flags.items())) if flags else ""


def run(
    calibration: LinkCalibration,
    skin: Skin,
    source: Input,
    outputs: Sequence[Output],
    status: Status,
    report: Callable[[str], None],
    is_stopped: Callable[[], bool],
    rest: int,
    tare: Callable[[list[Array]], str],
    by_arrival: bool,
) -> None:
    """Publish a frame for each reading until the source ends, or the run is stopped.

    ``report`` gets a line each second, ``is_stopped`` is asked ten times a second. With the first ``rest`` readings,
    which give no frame, ``tare`` sets the baseline; it returns what it learned, as words. ``by_arrival``: the time of a
    reading is that of its arrival on the clock of this computer. An output that raises an OutputError gets no more
    messages; the last one raises it here.
    """
    link, checksum, noise = skin.link, skin.checksum, object()
    is_recorded = any("reading" in output.topics for output in outputs)

    def publish(topic: str, message: Mapping[str, Any], at: float, cycle: int) -> None:
        data = encode(TOPICS[topic][0], message)
        for output in outputs:
            if topic in output.topics and output.failure is None:
                try:
                    output.send(topic, data, at, cycle)
                except OutputError as problem:
                    output.failure = problem
                    if all(output.failure for output in outputs):
                        raise
                    report(f"{problem}. The other outputs go on")

    readings = _readings(source, status, report, is_stopped, by_arrival)
    if rest:
        rows = [values[FORCE] for _, _, values in islice(readings, rest)]
        if len(rows) < rest and not is_stopped():
            raise SkinCalibError(f"the input ended after {len(rows)} of the {rest} readings at rest. Use fewer")
        if len(rows) == rest:
            report(tare(rows))
    for cycle, at, values in readings:
        start, lost = time.perf_counter(), status.lost
        for note in _notes(skin, values) if status.frames == 0 else ():
            report(f"warning: {note}")
        frame = skin.update(values, at)
        if skin.noise is not noise:  # the layout has its thresholds
            noise = skin.noise
            publish("layout", layout_message(calibration, skin, at), at, cycle)
        publish("frame", frame_message(link, frame, cycle, lost, checksum), at, cycle)
        for name, row in values.items() if is_recorded else ():
            publish("reading", reading_message(link, row, at, cycle, lost, checksum, name), at, cycle)
        status.add(frame, time.perf_counter() - start)


def _notes(skin: Skin, values: Mapping[str, Array]) -> Iterator[str]:
    """Yield what a person should know of the first reading."""
    for name in sorted(skin.modalities.keys() - values.keys()):
        yield f"the readings have no {name}, which the calibration has"
    if (count := len(values[FORCE])) > skin.reading_length:
        what = f"the readings have {count} numbers, the skin needs {skin.reading_length}"
        yield f"{what}. Check that no counter, time or total is among the channels"


def _readings(
    source: Input, status: Status, report: Callable[[str], None], is_stopped: Callable[[], bool], by_arrival: bool
) -> Iterator[tuple[int, float, Mapping[str, Array]]]:
    """Yield cycle, time and values of each reading, count them, and report."""
    while not is_stopped() and (found := source.read()) is not None:
        for reading in found:
            status.count(reading.cycle)
            values = reading.values if isinstance(reading.values, Mapping) else {FORCE: reading.values}
            yield reading.cycle, time.time() if by_arrival else reading.time, values
        if (line := status.due()) is not None:
            report(line)


@contextmanager
def undisturbed() -> Iterator[str]:
    """Use real-time priority if it is permitted, and shorten pauses for memory; give the priority as words."""
    gc.collect()
    gc.freeze()  # collections skip all that exists now: they take microseconds
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
        text = f"real-time priority {PRIORITY}"
    except AttributeError:
        text = "normal priority: this system has no SCHED_FIFO"
    except OSError:
        text = "normal priority: SCHED_FIFO is not permitted here (limit rtprio)"
    try:
        yield text
    finally:
        gc.unfreeze()
        if text.startswith("real"):
            os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
