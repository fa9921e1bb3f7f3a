"""Time of writing and reading a calibration file, with checks, checksum and disk, and the memory needed.

    python benchmarks/run.py --only files

The numbers have all their digits, as those of a wrapped skin. With "a table each" every taxel has its own response, a
table of twelve rows: the slowest case of a file. Each row is measured in its own process; the memory is the maximum of
the process.
"""

import json
import resource
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from statistics import median
from time import perf_counter

import numpy as np
from cycle import Scene

from skin_calib_addon.calibration import (
    LinkCalibration,
    Response,
    ResponseTable,
    SurfaceModel,
    load_calibration,
    save_calibration,
)
from skin_calib_addon.common.surface_errors import DistanceStatistics, SurfaceErrors

SIZES = {10_000: (100, 100), 100_000: (250, 400)}
LONG = 5.0  # [s] what takes longer is not repeated
PLAIN, POLYNOMIALS, TABLES = "one response", "a polynomial each", "a table each"
EXACT = DistanceStatistics(0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Row:
    """One file."""

    taxels: int
    responses: str
    megabytes: float
    write: float  # [s]
    read: float
    memory: float  # [MB]


def skin(taxels: int, responses: str) -> LinkCalibration:
    """Return a flat skin, rotated so that all digits of the coordinates differ from zero."""
    rows, columns = SIZES[taxels]
    scene = Scene("", rows, columns, np.empty((0, taxels)))
    plain, turn = scene.calibration, np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    turn *= np.linalg.det(turn)
    (patch,) = plain.patches
    vectors = ("positions_link", "normals_link", "tangents_link", "corners_link")
    turned = {name: getattr(patch.taxels, name) @ turn.T for name in vectors}
    own: tuple = ()
    if responses != PLAIN:
        kinds = {POLYNOMIALS: polynomial, TABLES: table_of}
        own = tuple(map(kinds[responses], 1 + 0.1 * np.random.default_rng(1).random(taxels)))
        turned["responses"] = np.arange(taxels)
    net = np.array([[[x, y, 0.0] for y in (0, rows * scene.pitch)] for x in (0, columns * scene.pitch)]) @ turn.T
    flat = SurfaceModel(
        patch.surface, (1, 1), [0, 0, 1, 1], [0, 0, 1, 1], net, (False, False), SurfaceErrors(EXACT, EXACT, 0.0)
    )
    patch = replace(patch, taxels=replace(patch.taxels, **turned))
    return replace(plain, surfaces=(flat,), patches=(patch,), responses=own)


def polynomial(scale: float) -> Response:
    return Response((0.0, 0.01 * scale, 1e-5 * scale, 1e-8 * scale), (0.0, 4095.0))


def table_of(scale: float) -> ResponseTable:
    readings = np.linspace(0, 4095, 12)
    return ResponseTable(tuple(readings.tolist()), tuple((scale * 1e-4 * readings**1.5).tolist()))


def measure(repeats: int) -> Iterator[Row]:
    """Yield every size with every kind of responses."""
    for taxels in SIZES:
        for responses in (PLAIN, POLYNOMIALS, TABLES):
            words = [sys.executable, __file__, str(taxels), responses, str(repeats)]
            yield Row(**json.loads(subprocess.run(words, check=True, capture_output=True).stdout))


def measured(taxels: int, responses: str, repeats: int) -> Row:
    """Return the median of some runs, in this process."""
    calibration, writes, reads = skin(taxels, responses), [], []
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "c.json")
        while len(writes) < repeats and sum(writes) < LONG:
            start = perf_counter()
            save_calibration(calibration, path)
            written = perf_counter()
            load_calibration(path)
            writes.append(written - start)
            reads.append(perf_counter() - written)
        size = path.stat().st_size
    return Row(taxels, responses, size / 1e6, median(writes), median(reads), held())


def held() -> float:
    """Return the maximum memory of this process so far [MB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def table(rows: list[Row]) -> str:
    """Return seconds and megabytes as text."""
    lines = [f"{'a calibration file':36} {'size':>8} {'memory':>8} [MB] {'write':>8} {'read':>8} [s]"]
    for r in rows:
        name = f"{r.taxels} taxels, {r.responses}"
        lines.append(f"{name:36} {r.megabytes:8.1f} {r.memory:8.0f}      {r.write:8.2f} {r.read:8.2f}")
    return "\n".join(lines)


if __name__ == "__main__":
    print(json.dumps(asdict(measured(int(sys.argv[1]), sys.argv[2], int(sys.argv[3])))))
