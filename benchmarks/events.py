"""The cost of a frame against the number of events, next to `update` with the complete reading.

The skin is flat, with square cells. A foot moves on it at 0.3 m/s. "table" has an own table of 24 rows for each taxel,
"cubic" one polynomial for all. Each packet has the events of random taxels with new noise, and the frame is computed
once for each packet. The last column is the time of one event more, from the largest packet.

``python benchmarks/events.py`` prints the table.
"""

import gc
import time
from dataclasses import replace

import numpy as np

from benchmarks.cycle import Scene
from skin_calib_addon.calibration import LinkCalibration, Response, ResponseTable
from skin_calib_addon.runtime import Skin

SIZES = ((30, 42), (100, 100))
COUNTS = (0, 1, 10, 100, 1000)
FRAMES = 400
PERIOD = 1e-3  # [s]
SEED = 1


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


def readings(rows: int, columns: int, rng: np.random.Generator) -> np.ndarray:
    """Return readings (FRAMES, rows * columns) with noise of two counts and a moving contact."""
    counts = rng.normal(20, 2, (FRAMES, rows, columns))
    for k in range(FRAMES):
        column = int(k * 0.03) % (columns - 6)
        counts[k, 2:8, column : column + 6] += 600
    return np.rint(np.clip(counts, 0, 4095)).astype(np.uint16).reshape(FRAMES, -1)


def measure(rows: int, columns: int, kind: str) -> list[float]:
    """Return the time of a frame, of `update`, then of each number of events [us].

    It is the first decile: other programs on the machine make the others longer.
    """
    rng = np.random.default_rng(SEED)
    n = rows * columns
    scene = Scene("events", rows, columns, np.zeros((1, n)))
    skin = Skin(with_response(scene.calibration, kind))
    skin.tare(np.rint(rng.normal(20, 2, (250, n))).astype(np.uint16))
    now, times = 0.0, np.empty((FRAMES, 1 + len(COUNTS)))
    for k, reading in enumerate(readings(rows, columns, rng)):
        for column, count in enumerate((None, *COUNTS)):  # in turn, so that all have the same load of the machine
            now += PERIOD
            indices = rng.integers(0, n, count or 0)
            values = reading[indices]
            start = time.perf_counter()
            frame = skin.update(reading, now) if count is None else skin.update_events(indices, values, now)
            times[k, column] = time.perf_counter() - start
            assert frame.known.all()
    return (1e6 * np.quantile(times, 0.1, axis=0)).tolist()


def main() -> None:
    """Print the table."""
    gc.disable()
    print(
        f"{'taxels':>7} {'response':9} {'update':>8}" + "".join(f"{c:>8}" for c in COUNTS) + "  events [us]; per event"
    )
    for rows, columns in SIZES:
        for kind in ("cubic", "table"):
            full, *events = measure(rows, columns, kind)
            slope = (events[-1] - events[0]) / COUNTS[-1]
            print(f"{rows * columns:7} {kind:9} {full:8.1f}" + "".join(f"{e:8.1f}" for e in events) + f"  {slope:.3f}")


if __name__ == "__main__":
    main()
