"""``Skin.batch`` for many readings, and ``update_events`` for few events, compared with ``Skin.update``.

    python benchmarks/updates.py

A batch has 1000 readings of two contacts, of all taxels active, and of random ones. The packets of events are of random
taxels below a foot that moves; the last column is the time of one event more. "table" has a table of 24 rows for each
taxel, "cubic" one polynomial for all. Calls take turns, so that other programs slow all of them.
"""

import gc
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial

import numpy as np
from cycle import PERIOD, PITCH, Scene, moving, with_noise

from skin_calib_addon.calibration import LinkCalibration, Response, ResponseTable
from skin_calib_addon.runtime import Skin

ROWS = 1000  # readings of a batch
REPEATS = 5  # the fastest counts: other programs only add time
COUNTS = (0, 1, 10, 100, 1000)  # of events
FRAMES = 400


def scenes(rows: int, columns: int) -> Iterator[tuple[str, Skin, np.ndarray]]:
    """Yield scenes with their name, skin and readings."""
    rng, n = np.random.default_rng(0), rows * columns
    readings = {
        "two contacts, 0.3 m/s": moving(rows, columns, 2, 2.6, 0.3 * PERIOD / PITCH, ROWS),
        "two contacts, 10 m/s": moving(rows, columns, 2, 2.6, 10 * PERIOD / PITCH, ROWS),
        "all active": rng.integers(400, 500, (ROWS, n)),
        "each taxel at random": np.where(rng.random((ROWS, n)) < 0.5, 500, 0),
    }
    for name, counts in readings.items():
        for mode in ("thresholds", "noise"):
            scene = Scene(name, rows, columns, counts, mode=mode)
            yield f"{n} taxels, {name}, {mode}", scene.skin, scene.frames


def fastest(works: list[Callable[[], object]]) -> list[float]:
    """Return the shortest time of each call [s]."""
    times = np.full((REPEATS, len(works)), np.inf)
    for k in range(REPEATS):
        for i, work in enumerate(works):
            start = time.perf_counter()
            work()
            times[k, i] = time.perf_counter() - start
    return times.min(axis=0).tolist()


def loop(skin: Skin, readings: np.ndarray, times: np.ndarray) -> None:
    """Compute with single updates what a batch has."""
    for reading, now in zip(readings, times.tolist()):
        frame = skin.update(reading, now)
        _ = frame.forces, frame.wrench, frame.load, frame.cop, frame.zmp, len(frame.contacts), frame.stands


def with_response(calibration: LinkCalibration, kind: str) -> LinkCalibration:
    """Return a calibration whose taxels have one cubic response, or a table each."""
    if kind == "cubic":
        return replace(calibration, response=Response((0.0, 0.01, 1e-6, 1e-9), (0.0, 4095.0)))
    (patch,) = calibration.patches
    n = len(patch.taxels.ids)
    knots, forces = np.linspace(0, 4095, 24), tuple((np.linspace(0, 20, 24) ** 1.5).tolist())
    tables = tuple(ResponseTable(tuple((knots + k / n).tolist()), forces) for k in range(n))
    taxels = replace(patch.taxels, responses=np.arange(n))
    return replace(calibration, patches=(replace(patch, taxels=taxels),), responses=tables)


def of_events(rows: int, columns: int, kind: str) -> list[float]:
    """Return the first decile of the time of a frame [us]: of ``update``, then of each number of events."""
    rng, n = np.random.default_rng(1), rows * columns
    skin = Skin(with_response(Scene("events", rows, columns, np.zeros((1, n))).calibration, kind))
    skin.tare(with_noise(np.full((250, n), 20)))
    readings = with_noise(20 + moving(rows, columns, 1, 3.0, 0.3 * PERIOD / PITCH, FRAMES))
    now, times = 0.0, np.empty((FRAMES, 1 + len(COUNTS)))
    for k, reading in enumerate(readings):
        for column, count in enumerate((None, *COUNTS)):
            now += PERIOD
            indices = rng.integers(0, n, count or 0)
            values = reading[indices]
            start = time.perf_counter()
            frame = skin.update(reading, now) if count is None else skin.update_events(indices, values, now)
            times[k, column] = time.perf_counter() - start
            assert frame.known.all()
    return (1e6 * np.quantile(times, 0.1, axis=0)).tolist()


def main() -> None:
    """Print both tables."""
    times = PERIOD * np.arange(ROWS)
    for rows, columns in ((6, 22), (21, 60)):
        for name, skin, readings in scenes(rows, columns):
            calls = (partial(loop, skin, readings, times), partial(skin.batch, readings, times))
            one, log, alone = fastest([*calls, partial(skin.batch, readings)])
            print(f"{name:60} loop {1e3 * one:6.1f} ms, log {one / log:4.1f} x, environments {one / alone:4.1f} x")
    gc.disable()
    counts = "".join(f"{c:>8}" for c in COUNTS)
    print(f"{'taxels':>7} {'response':9} {'update':>8}{counts}  events [us]; per event")
    for rows, columns in ((30, 42), (100, 100)):
        for kind in ("cubic", "table"):
            full, *events = of_events(rows, columns, kind)
            slope = (events[-1] - events[0]) / COUNTS[-1]
            print(f"{rows * columns:7} {kind:9} {full:8.1f}" + "".join(f"{e:8.1f}" for e in events) + f"  {slope:.3f}")


if __name__ == "__main__":
    main()
