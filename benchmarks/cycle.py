"""The runtime's full cycle compared with a direct implementation: from readings to contacts, wrench, CoP and polygons.

Contacts move at 0.3 m/s over the skin, one frame per millisecond. "another set each cycle" is the worst case: the
active taxels change every time. Every cycle computes position, normal, force and wrench of each contact, the skin's
wrench, CoP and ZMP, and the three supporting polygons. "NumPy, SciPy, Shapely" is the direct implementation:
``polyval``, ``connected_components`` on a sparse matrix, a loop over contacts, ``convex_hull`` and ``buffer``. "OpenCV"
treats the sheet as an image.
"""

import gc
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from skin_calib_addon.calibration import LinkCalibration, MeshSource, Patch, Response, TaxelArray
from skin_calib_addon.runtime import Skin

RESPONSE = Response((0.0, 0.01, 1e-6, 1e-9))
SPEED, PERIOD = 0.3, 1e-3  # [m/s], [s]
ON, OFF = 0.2, 0.1  # [N]
CYCLES = 3000
PITCH = 0.01
Array = np.ndarray


@dataclass(frozen=True)
class Row:
    """One method on one scene."""

    scene: str
    method: str
    active: int  # taxels, the median
    median: float  # [us]
    p99: float


@dataclass(frozen=True)
class Scene:
    """A flat skin of square cells, and its readings frame by frame."""

    name: str
    rows: int
    columns: int
    readings: Array  # (frames, rows * columns) 12-bit counts
    pitch: float = PITCH

    @property
    def calibration(self) -> LinkCalibration:
        """Return the calibration of the skin."""
        rows, columns, n = self.rows, self.columns, self.rows * self.columns
        row, column = (a.ravel() for a in np.indices((rows, columns)))
        positions = self.pitch * np.column_stack((column + 0.5, row + 0.5, 0 * row))
        ring = self.pitch / 2 * np.array([[-1, -1, 0], [-1, 1, 0], [1, 1, 0], [1, -1, 0.0]])
        name = {(i, j): f"sole.{i}.{j}" for i, j in zip(row.tolist(), column.tolist())}
        near = [((i - 1, j), (i + 1, j), (i, j - 1), (i, j + 1)) for i, j in name]
        taxels = TaxelArray(
            tuple(name.values()),
            np.arange(n),
            np.column_stack((row, column)),
            np.zeros((n, 2)),
            positions,
            np.tile((0.0, 0.0, -1.0), (n, 1)),
            np.tile((1.0, 0.0, 0.0), (n, 1)),
            positions[:, None] + ring,
            np.full(n, self.pitch**2),
            tuple(tuple(name[place] for place in places if place in name) for places in near),
        )
        patch = Patch("sole", "sheet", "sole", (rows, columns), (self.pitch, self.pitch), taxels)
        return LinkCalibration("sole", MeshSource("sole.stl", "0" * 64, 0, 0), (), (patch,), RESPONSE)


def pressed(rows: int, columns: int, centres: Array, radius: float) -> Array:
    """Return counts (frames, rows * columns) of circular contacts with centres (frames, c, 2) in cells."""
    rng = np.random.default_rng(0)
    row, column = np.indices((rows, columns))
    frames = []
    for places in centres:
        counts = np.zeros((rows, columns))
        for i, j in places:
            counts = np.maximum(counts, 900 * (1 - ((row - i) ** 2 + (column - j) ** 2) / radius**2))
        frames.append(np.where(counts > 0, counts + rng.integers(0, 3, counts.shape), 0).ravel().astype(np.uint16))
    return np.array(frames)


def moving(rows: int, columns: int, contacts: int, radius: float, step: float, frames: int = 2000) -> Array:
    """Return contacts that move forwards and backwards over a sheet by ``step`` cells per frame."""
    k, c = np.arange(frames)[:, None], np.arange(contacts)
    across = (c + 0.5) * columns / contacts + 2 * np.sin(0.001 * k + c)
    length = rows - 1
    along = np.abs((step * k + c * length / contacts + 0.3) % (2 * length) - length)
    return pressed(rows, columns, np.stack(np.broadcast_arrays(along, across), axis=2), radius)


def scenes() -> Iterator[Scene]:
    """Yield the scenes, from 42 to 10 000 taxels."""
    step = SPEED * PERIOD / PITCH
    rng = np.random.default_rng(1)
    yield Scene("42 taxels, moving", 6, 7, moving(6, 7, 1, 2.6, step * PITCH / 0.028), 0.028)
    yield Scene("42 taxels, all active", 6, 7, rng.integers(400, 500, (500, 42)).astype(np.uint16), 0.028)
    yield Scene("42 taxels, another set each cycle", 6, 7, moving(6, 7, 1, 2.6, 1.7), 0.028)
    yield Scene("1260 taxels, three contacts", 21, 60, moving(21, 60, 3, 4, step))
    yield Scene("1260 taxels, another set each cycle", 21, 60, moving(21, 60, 3, 4, 1.7))
    full = rng.integers(400, 500, (500, 1260)).astype(np.uint16)
    yield Scene("1260 taxels, all active", 21, 60, full)
    yield Scene("10 000 taxels, ten contacts", 100, 100, moving(100, 100, 10, 5, step, 600))


def ours(scene: Scene) -> Callable[[Array, float], tuple]:
    """Return the cycle of the runtime."""
    skin = Skin(scene.calibration, ON, OFF)

    def cycle(readings: Array, now: float) -> tuple:
        frame = skin.update(readings, now)
        asked = [(c.position, c.normal, c.force, c.wrench) for c in frame.contacts]
        polygon = frame.polygon
        asked += [frame.zmp, polygon.guaranteed]
        cop = (np.nan, np.nan) if frame.cop is None else frame.cop
        return len(frame.contacts), frame.wrench[2], cop[0], cop[1], polygon.outer, polygon.nominal

    return cycle


def straightforward(scene: Scene) -> Callable[[Array, float], tuple]:
    """Return the cycle with NumPy, SciPy and Shapely, written directly."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from shapely import MultiPoint

    skin = Skin(scene.calibration)
    n = len(skin.ids)
    graph = coo_array((np.ones(len(skin.pairs)), skin.pairs.T), (n, n)).tocsr()
    corners, centres = skin.ground.corners, skin.ground.centres
    state = np.zeros(n, bool)

    def cycle(readings: Array, now: float) -> tuple:
        forces = np.maximum(np.polyval(RESPONSE.coefficients[::-1], readings.astype(float)), 0)
        state[:] = forces >= np.where(state, OFF, ON)
        active = np.flatnonzero(state)
        count, labels = connected_components(graph[active][:, active], directed=False)
        wrench = np.zeros(6)
        for k in range(count):
            rows = active[labels == k]
            f = forces[rows]
            np.average(skin.positions[rows], axis=0, weights=f)
            normal = f @ skin.normals[rows]
            normal / np.linalg.norm(normal)
            push = -f[:, None] * skin.normals[rows]
            wrench += np.concatenate((push.sum(axis=0), np.cross(skin.positions[rows], push).sum(axis=0)))
        f = forces[active]
        cop = f @ centres[active] / f.sum() if f.sum() > 5 else (np.nan, np.nan)
        outer = MultiPoint(corners[active].reshape(-1, 2)).convex_hull
        nominal = MultiPoint(centres[active]).convex_hull
        nominal.buffer(-scene.pitch / 2, join_style="mitre")
        return count, wrench[2], cop[0], cop[1], outer, nominal

    return cycle


def opencv(scene: Scene) -> Callable[[Array, float], tuple]:
    """Return the cycle with the sheet as an image, the paper's method, with corrected thresholds and sums."""
    import cv2

    shape = scene.rows, scene.columns
    row, column = (a.astype(np.float32) for a in np.indices(shape))
    state = np.zeros(shape, bool)
    side = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32)

    def cycle(readings: Array, now: float) -> tuple:
        forces = np.maximum(np.polyval(RESPONSE.coefficients[::-1], readings.astype(float)), 0).reshape(shape)
        state[:] = forces >= np.where(state, OFF, ON)
        count, labels = cv2.connectedComponents(state.astype(np.uint8), connectivity=4)
        total = np.zeros(3)
        for k in range(1, count):
            mine = labels == k
            f = forces[mine]
            sums = f.sum(), f @ (column[mine] + 0.5), f @ (row[mine] + 0.5)
            total += sums
        cop = scene.pitch * total[1:] / total[0] if total[0] > 5 else (np.nan, np.nan)
        cells = np.column_stack((column[state], row[state]))
        corners = (cells[:, None] + side).reshape(-1, 2)
        outer, nominal = cv2.convexHull(corners), cv2.convexHull(cells)
        return count - 1, total[0], cop[0], cop[1], outer, nominal

    return cycle


METHODS = {"ours": ours, "NumPy, SciPy, Shapely": straightforward, "OpenCV": opencv}


def measure(repeats: int) -> Iterator[Row]:
    """Yield all rows; the methods must agree. ``repeats`` has no effect, as a cycle runs thousands of times."""
    for scene in scenes():
        found: dict[str, Any] = {}
        for method, make in METHODS.items():
            try:
                cycle = make(scene)
            except ImportError:
                continue
            found[method] = np.array([numbers(cycle(r, PERIOD * k), scene) for k, r in enumerate(scene.readings[:200])])
            times = run(cycle, scene.readings, CYCLES if method == "ours" else CYCLES // 4)
            yield Row(scene.name, method, int(np.median((scene.readings > 20).sum(axis=1))), *times)
        for method, values in found.items():
            assert np.allclose(values, found["ours"], rtol=2e-3, atol=1e-4, equal_nan=True), (scene.name, method)
    yield paced()


def numbers(result: tuple, scene: Scene) -> list[float]:
    """Return the numbers of a cycle's result, with the areas of its two hulls."""
    *plain, outer, nominal = result
    areas = []
    for hull in (outer, nominal):
        if isinstance(hull, np.ndarray):
            x, y = hull.reshape(-1, 2).T.astype(float) * scene.pitch
            areas.append(abs(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2)
        else:
            areas.append(hull.area)
    return [*plain, *areas]


def run(cycle: Callable, readings: Array, cycles: int) -> tuple[float, float]:
    """Return median and 99th percentile of a cycle [us], after a hundred that are not counted."""
    for k in range(100):
        cycle(readings[k % len(readings)], PERIOD * (1000 + k))
    gc.collect()
    times = np.empty(cycles)
    for k in range(cycles):
        start = time.perf_counter()
        cycle(readings[(100 + k) % len(readings)], PERIOD * (1100 + k))
        times[k] = time.perf_counter() - start
    return float(1e6 * np.median(times)), float(1e6 * np.percentile(times, 99))


def paced() -> Row:
    """Measure a loop that waits for every millisecond, as in a controller."""
    scene = next(s for s in scenes() if s.name == "1260 taxels, three contacts")
    cycle, times = ours(scene), []
    begin = time.perf_counter()
    for k in range(CYCLES):
        while (start := time.perf_counter()) < begin + k * PERIOD:
            time.sleep(max(0.0, begin + k * PERIOD - start - 2e-4))
        cycle(scene.readings[k % len(scene.readings)], k * PERIOD)
        times.append(time.perf_counter() - start)
    active = int(np.median((scene.readings > 20).sum(axis=1)))
    return Row("1260 taxels, a loop at 1 kHz", "ours", active, *(1e6 * np.percentile(times, [50, 99])))


def table(rows: list[Row]) -> str:
    """Return microseconds, and the ratio to ours, as text."""
    ours_of = {r.scene: r.median for r in rows if r.method == "ours"}
    lines = [f"{'the cycle of a controller':36} {'method':22} {'active':>6} {'median':>8} {'p99':>8} [us]  times ours"]
    for r in rows:
        ratio = r.median / ours_of[r.scene]
        lines.append(f"{r.scene:36} {r.method:22} {r.active:6} {r.median:8.0f} {r.p99:8.0f}       {ratio:5.1f}")
    return "\n".join(lines)
