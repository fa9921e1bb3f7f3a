"""``Skin.batch`` for 1000 readings of two contacts, of all taxels active, and of random ones, compared with a loop.

    python benchmarks/batch.py

Calls take turns, so that other programs slow all of them.
"""

import time
from collections.abc import Callable, Iterator
from functools import partial

import numpy as np
from cycle import PERIOD, PITCH, Scene, moving

from skin_calib_addon.runtime import Skin

ROWS = 1000  # readings of a batch
REPEATS = 5  # the fastest counts: other programs only add time


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


def main() -> None:
    """Print the ratios."""
    times = PERIOD * np.arange(ROWS)
    for rows, columns in ((6, 22), (21, 60)):
        for name, skin, readings in scenes(rows, columns):
            calls = (partial(loop, skin, readings, times), partial(skin.batch, readings, times))
            one, log, alone = fastest([*calls, partial(skin.batch, readings)])
            print(f"{name:60} loop {1e3 * one:6.1f} ms, log {one / log:4.1f} x, environments {one / alone:4.1f} x")


if __name__ == "__main__":
    main()
