"""Time the cycle of the C++ runtime next to that of Python, in one run: standing and moving contacts, with noise.

    python -m cpp.tests.cycle [--program build/cpp/cycle] [--frames 100000] [--python 2000] [--straightforward]

A frame has all results: contacts, wrench, CoP, ZMP, standard deviations and the three polygons. Times are those of the
thread on the processor [us]. The scenes are those of
`benchmarks/cycle.py`.
"""

import argparse
import json
import subprocess
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from benchmarks.cycle import PERIOD, PITCH, Scene, moving, ours, straightforward, with_noise
from skin_calib_addon.calibration.file import to_document

SHEETS = ((6, 7, 0.028, 1, 2.6), (6, 22, PITCH, 2, 2.6), (21, 60, PITCH, 3, 4.0), (100, 100, PITCH, 10, 5.0))


def scenes() -> Iterator[Scene]:
    """Yield hexagons: a standing foot, whose cells all carry, and contacts that move at 0.3 m/s."""
    rng = np.random.default_rng(1)
    for rows, columns, pitch, contacts, radius in SHEETS:
        n, frames = rows * columns, 2000 if rows < 100 else 400
        standing = (rng.integers(400, 500, n) + np.zeros((frames, 1))).astype(np.uint16)
        yield Scene(f"{n} standing", rows, columns, standing, pitch, True, "noise")
        counts = moving(rows, columns, contacts, radius, 0.3 * PERIOD / pitch, frames, True)
        yield Scene(f"{n} moving", rows, columns, counts, pitch, True, "noise")


def python_times(cycle, frames: np.ndarray, count: int) -> list[float]:
    """Return the median, the 99th percentile and the maximum of the times of a cycle [us]."""
    times = []
    for k in range(count + 100):
        start = time.thread_time()
        cycle(frames[k % len(frames)], PERIOD * k)
        times.append(1e6 * (time.thread_time() - start))
    return [*np.percentile(times[100:], [50, 99]).tolist(), max(times[100:])]


def cpp_times(program: Path, scene: Scene, frames: np.ndarray, count: int) -> list[float]:
    """Return the same of the program in C++."""
    with tempfile.TemporaryDirectory() as folder:
        files = [Path(folder) / name for name in ("sole.calibration.json", "noise.json", "readings")]
        calibration = scene.calibration
        files[0].write_text(json.dumps(to_document(calibration)))
        scene.skin.save_noise(files[1])
        files[2].write_bytes(with_noise(frames).tobytes())
        out = subprocess.run([program, *files, str(count)], check=True, capture_output=True, text=True).stdout
    return [float(x) for x in out.split()[:3]]


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--program", type=Path, default=Path("build/cpp/cycle"))
    parser.add_argument("--frames", type=int, default=100_000, help="in C++; a tenth at 10 000 taxels")
    parser.add_argument("--python", type=int, default=2000, help="frames in Python")
    parser.add_argument("--straightforward", action="store_true", help="also with NumPy, SciPy and Shapely")
    given = parser.parse_args()
    print(f"{'us of a frame':20} {'method':22} {'p50':>8} {'p99':>8} {'maximum':>9}")
    for scene in scenes():
        few = 10 if scene.rows == 100 else 1
        rows = {"C++": cpp_times(given.program, scene, scene.readings, given.frames // few)}
        rows["Python"] = python_times(ours(scene), scene.frames, given.python // few)
        if given.straightforward:
            rows["NumPy, SciPy, Shapely"] = python_times(straightforward(scene), scene.frames, given.python // few)
        for method, (median, p99, most) in rows.items():
            print(f"{scene.name:20} {method:22} {median:8.1f} {p99:8.1f} {most:9.1f}", flush=True)


if __name__ == "__main__":
    main()
