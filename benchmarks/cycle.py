"""The runtime's full cycle compared with a direct implementation: from readings to contacts, wrench, CoP and polygons.

Contacts move at 0.3 m/s or 10 m/s over sheets of squares or hexagons, one frame per millisecond. Every cycle computes
position, normal, force and wrench of each contact, the skin's wrench, CoP and ZMP, and the three supporting polygons.

- "thresholds": a force above 0.2 N is a contact.
- "noise": the default. The readings have noise of 2 counts. Every cycle also decides what is surely and possibly
  touched, weighs the sums, checks for stuck, frozen, drifting and impossible readings, and computes the standard
  deviations of forces, CoP and ZMP.

"NumPy, SciPy, Shapely" is the direct implementation: ``polyval``, ``connected_components`` on a sparse matrix, a loop
over contacts, ``convex_hull`` and ``buffer``. It gives contacts no numbers that stay, and does not check the readings
in detail. "OpenCV" treats a sheet of squares as an image; it has no normals, moments or guaranteed polygon. Times are
those of the thread on the processor, and the methods take turns, so that other programs hardly count.
"""

import gc
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from skin_calib_addon.calibration import LinkCalibration, MeshSource, Patch, Response, TaxelArray
from skin_calib_addon.runtime import Skin

RESPONSE = Response((0.0, 0.01, 1e-6, 1e-9))
PERIOD = 1e-3  # [s]
ON, OFF = 0.2, 0.1  # [N]
NOISE = 2.0  # [counts]
PITCH = 0.01
CYCLES = {"ours": 150, "NumPy, SciPy, Shapely": 40, "OpenCV": 40}  # of one turn
TURNS = 6
Array = np.ndarray


@dataclass(frozen=True)
class Row:
    """One method on one scene."""

    mode: str
    scene: str
    method: str
    active: int  # taxels, the median
    median: float  # [us]
    p99: float


@dataclass(frozen=True)
class Scene:
    """A flat skin of square or hexagonal cells, and its readings frame by frame."""

    name: str
    rows: int
    columns: int
    readings: Array  # (frames, rows * columns) 12-bit counts
    pitch: float = PITCH
    hexagons: bool = False
    mode: str = "thresholds"

    @cached_property
    def calibration(self) -> LinkCalibration:
        """Return the calibration of the skin."""
        from scipy.spatial import cKDTree

        n = self.rows * self.columns
        row, column = (a.ravel() for a in np.indices((self.rows, self.columns)))
        flat = self.pitch * centres(self.rows, self.columns, self.hexagons)
        positions = np.column_stack((flat, np.zeros(n)))
        angles = np.deg2rad(30 - 60 * np.arange(6) if self.hexagons else 45 - 90 * np.arange(4))
        radius = self.pitch / np.sqrt(3 if self.hexagons else 2)
        ring = radius * np.column_stack((np.cos(angles), np.sin(angles), 0 * angles))
        near: list[list[int]] = [[] for _ in range(n)]
        for i, j in cKDTree(flat).query_pairs(1.1 * self.pitch, output_type="ndarray").tolist():
            near[i].append(j)
            near[j].append(i)
        name = [f"sole.{i}.{j}" for i, j in zip(row.tolist(), column.tolist())]
        taxels = TaxelArray(
            tuple(name),
            np.arange(n),
            np.column_stack((row, column)),
            np.zeros((n, 2)),
            positions,
            np.tile((0.0, 0.0, -1.0), (n, 1)),
            np.tile((1.0, 0.0, 0.0), (n, 1)),
            positions[:, None] + ring,
            np.full(n, self.pitch**2 * (np.sqrt(0.75) if self.hexagons else 1.0)),
            tuple(tuple(name[j] for j in sorted(others)) for others in near),
        )
        patch = Patch("sole", "sheet", "sole", (self.rows, self.columns), (self.pitch, self.pitch), taxels)
        return LinkCalibration("sole", MeshSource("sole.stl", "0" * 64, 0, 0), (), (patch,), RESPONSE)

    @property
    def skin(self) -> Skin:
        """Return the skin; with noise it has learned the noise."""
        if self.mode == "thresholds":
            return Skin(self.calibration, ON, OFF)
        skin = Skin(self.calibration)
        skin.tare(with_noise(np.zeros((250, self.rows * self.columns))))
        return skin

    @property
    def frames(self) -> Array:
        """Return the readings; with noise in this mode."""
        return self.readings if self.mode == "thresholds" else with_noise(self.readings)


def with_noise(counts: Array) -> Array:
    """Return counts with the noise of a converter of twelve bits."""
    return np.clip(np.rint(counts + np.random.default_rng(0).normal(0, NOISE, counts.shape)), 0, 4095).astype(np.uint16)


def centres(rows: int, columns: int, hexagons: bool) -> Array:
    """Return the centres (n, 2) of the cells, in pitches."""
    row, column = (a.ravel() for a in np.indices((rows, columns)))
    return np.column_stack((column + row % 2 / 2, row * np.sqrt(0.75)) if hexagons else (column, row)) + 0.5


def moving(
    rows: int, columns: int, contacts: int, radius: float, step: float, frames: int = 2000, hexagons: bool = False
) -> Array:
    """Return counts (frames, n) of round contacts that move up and down the rows, by ``step`` pitches per frame."""
    cells = centres(rows, columns, hexagons)
    rng = np.random.default_rng(0)
    length = float(cells[-1, 1] - 0.5)
    c, result = np.arange(contacts), np.empty((frames, len(cells)), np.uint16)
    for k in range(frames):
        across = (c + 0.5) * columns / contacts + 2 * np.sin(0.001 * k + c) + 0.5
        along = np.abs((step * k + c * length / contacts + 0.3) % (2 * length) - length) + 0.5
        squares = (cells[:, :1] - across) ** 2 + (cells[:, 1:] - along) ** 2
        counts = 900 * (1 - squares.min(axis=1) / radius**2)
        result[k] = np.where(counts > 0, counts + rng.integers(0, 3, len(cells)), 0)
    return result


def scenes() -> Iterator[Scene]:
    """Yield the scenes, from 42 to 10 000 taxels."""
    rng = np.random.default_rng(1)
    sheets = ((6, 7, 0.028, 1, 2.6), (6, 22, PITCH, 2, 2.6), (21, 60, PITCH, 3, 4.0), (100, 100, PITCH, 10, 5.0))
    for rows, columns, pitch, contacts, radius in sheets:
        n = rows * columns
        for hexagons in (False, True):
            for speed in (0.3, 10.0):
                name = f"{n} {'hexagons' if hexagons else 'squares'}, {speed:g} m/s"
                frames = 2000 if n < 10_000 else 400
                readings = moving(rows, columns, contacts, radius, speed * PERIOD / pitch, frames, hexagons)
                yield Scene(name, rows, columns, readings, pitch, hexagons)
        if n in (42, 1260):
            full = rng.integers(400, 500, (500, n)).astype(np.uint16)
            yield Scene(f"{n} squares, all active", rows, columns, full, pitch)


def ours(scene: Scene) -> Callable[[Array, float], tuple]:
    """Return the cycle of the runtime."""
    skin, has_noise = scene.skin, scene.mode == "noise"

    def cycle(readings: Array, now: float) -> tuple:
        frame = skin.update(readings, now)
        asked = [(c.position, c.normal, c.force, c.wrench) for c in frame.contacts]
        polygon, cop, sigma = frame.polygon, frame.cop, None
        asked += [frame.zmp, polygon.guaranteed, frame.flags]
        if has_noise:
            asked += [frame.force_sigmas, frame.zmp_sigma]
            sigma = frame.cop_sigma
        return len(frame.contacts), frame.wrench[2], cop, sigma, polygon.outer, polygon.nominal

    return cycle


def straightforward(scene: Scene) -> Callable[[Array, float], tuple]:
    """Return the cycle with NumPy, SciPy and Shapely, written directly."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from shapely import MultiPoint

    skin = scene.skin
    n = len(skin.ids)
    graph = coo_array((np.ones(len(skin.pairs)), skin.pairs.T), (n, n)).tocsr()
    # rounded to nanometres: with corners that differ in the last bit, the hull of GEOS can lose a hundredth of its area
    corners, flat = np.round(skin.ground.corners, 9), np.round(skin.ground.centres, 9)
    state = np.zeros(n, bool)
    statements = Statements(skin) if scene.mode == "noise" else None

    def cycle(readings: Array, now: float) -> tuple:
        if statements is None:
            forces = np.maximum(np.polyval(RESPONSE.coefficients[::-1], readings.astype(float)), 0)
            state[:] = forces >= np.where(state, OFF, ON)
            sure = possible = state
            pushes = np.where(state, forces, 0)
        else:
            forces, sure, possible, pushes = statements.update(readings, now, state)
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
        if statements is not None:
            wrench = pushes @ skin.wrenches
        load = pushes.sum()
        cop = sigma = None
        if load > (5 if statements is None else 0):
            cop = pushes @ flat / load
            zmp = np.array((-wrench[4], wrench[3])) / wrench[2]
            if statements is not None:
                sigma = statements.sigma(readings, forces, pushes, cop, load)
                statements.sigma(readings, forces, pushes, zmp, load)
        outer = MultiPoint(corners[possible].reshape(-1, 2)).convex_hull
        nominal = MultiPoint(flat[active]).convex_hull
        core = nominal if statements is None else MultiPoint(flat[sure]).convex_hull
        core.buffer(-scene.pitch / 2, join_style="mitre")
        return count, wrench[2], cop, sigma, outer, nominal

    return cycle


class Statements:
    """What the noise at rest says about a reading, written directly with NumPy; the levels are those of a skin."""

    def __init__(self, skin: Skin):
        from scipy.sparse import coo_array

        self.noise, n = skin.noise, len(skin.ids)
        ends = np.concatenate((skin.pairs, skin.pairs[:, ::-1])).T
        self.near = coo_array((np.ones(ends.shape[1]), ends), (n, n)).tocsr()
        self.degrees = np.maximum(self.near @ np.ones(n), 1)
        self.areas, self.flat = skin.areas, skin.ground.centres
        self.gradient = skin.ground.in_cell.ground[:, 1:3] - skin.ground.terms[:, 1:3]
        self.last, self.since, self.drift = np.zeros(n), np.zeros(n), 0.0
        self.flags: dict[str, bool] = {}

    def update(self, readings: Array, now: float, state: Array) -> tuple[Array, Array, Array, Array]:
        """Change the state of the taxels; return forces, surely and possibly touched, and weighted forces."""
        noise, signal = self.noise, readings.astype(float)
        forces = np.maximum(np.polyval(RESPONSE.coefficients[::-1], signal - noise.mean), 0)
        sure, pair, possible = signal > noise.sure, signal > noise.pair, signal > noise.possible
        pair &= self.near @ pair > 0
        excess = (signal - noise.free) @ noise.slopes
        if sure.any() or pair.any() or excess > noise.load_level:
            state[:] = sure | pair | (state & (signal > noise.release))
            step = np.clip(((signal - noise.mean) / noise.sigma - 1) / 2, 0, 1)
            self.weights = step**2 * (3 - 2 * step)
            clear = (self.weights * (signal - noise.free)) @ noise.slopes - (1 - self.weights) @ noise.rectified
            counted = forces
            if excess > 1.1 * clear:
                hidden = np.clip((excess / clear - 1.1) / 0.2, 0, 1) if clear > 0 else 1
                self.weights += hidden * (1 - self.weights)
                below = np.where(signal <= noise.clip, noise.below_clip, (signal - noise.mean) * noise.slopes)
                counted = forces + np.minimum(below, 0)
            pushes = self.weights * counted - (1 - self.weights) * noise.rectified
        else:
            state[:], possible, self.weights = False, np.zeros(len(state), bool), np.zeros(len(state))
            pushes = np.zeros(len(state))
        same = signal == self.last
        self.since[~same] = now
        self.last = signal
        free = ~(possible | (self.near @ possible > 0))
        if not sure.any() and 2 * free.sum() > len(free):
            self.drift += 1e-3 * (((signal - noise.free) / noise.sigma)[free].mean() - self.drift)
        self.flags = {
            "stuck": bool((state & (now - self.since > np.minimum(0.02 * noise.repeats, 30))).any()),
            "frozen": bool((now - self.since > max(0.02 * noise.frame_repeats, 0.1)).all()),
            "below_rest": bool((signal < noise.lowest).any()),
            "too_large": bool((forces > 1e6).any()),
            "drift": abs(self.drift) > 0.3,
        }
        return forces, sure, possible, pushes

    def sigma(self, readings: Array, forces: Array, pushes: Array, point: Array, load: float) -> Array:
        """Return the standard deviations of a point of the ground."""
        noise, (_, b, c, d) = self.noise, RESPONSE.coefficients
        signal = readings - noise.mean
        sigmas = np.abs(b + 2 * c * signal + 3 * d * signal**2) * noise.sigma
        scatter = np.hypot(self.weights * sigmas, (1 - self.weights) * forces) * noise.common
        uneven = np.clip(pushes - self.near @ pushes / self.degrees, 0, None)
        placed = (uneven**2 * self.areas).sum() / 12
        variance = ((scatter[:, None] * (self.flat - point)) ** 2).sum(axis=0) + placed
        return np.sqrt(variance + (pushes @ self.gradient) ** 2) / load


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
        cop = scene.pitch * total[1:] / total[0] if total[0] > 5 else None
        cells = np.column_stack((column[state], row[state]))
        corners = (cells[:, None] + side).reshape(-1, 2)
        outer, nominal = cv2.convexHull(corners), cv2.convexHull(cells)
        return count - 1, total[0], cop, None, outer, nominal

    return cycle


METHODS = {"ours": ours, "NumPy, SciPy, Shapely": straightforward, "OpenCV": opencv}


def measure(repeats: int, modes: tuple[str, ...] = ("thresholds", "noise")) -> Iterator[Row]:
    """Yield all rows; the methods must agree. ``repeats`` has no effect, as a cycle runs a thousand times."""
    for scene in scenes():
        for mode in modes:
            yield from compared(Scene(*(getattr(scene, f) for f in list(Scene.__dataclass_fields__)[:-1]), mode))
    yield paced()


def compared(scene: Scene) -> Iterator[Row]:
    """Yield a row for each method."""
    frames, cycles, found = scene.frames, {}, {}
    for method, make in METHODS.items():
        if method == "OpenCV" and (scene.hexagons or scene.mode == "noise"):
            continue
        try:
            cycle = make(scene)
        except ImportError:
            continue
        found[method] = np.array([numbers(cycle(r, PERIOD * k), scene) for k, r in enumerate(frames[:200])])
        cycles[method] = cycle
    for method, values in found.items():
        assert np.allclose(values, found["ours"], rtol=3e-3, atol=1e-4, equal_nan=True), (
            scene.name,
            scene.mode,
            method,
        )
    times: dict[str, list[float]] = {method: [] for method in cycles}
    done = dict.fromkeys(cycles, 200)
    for _ in range(TURNS):
        for method, cycle in cycles.items():
            gc.collect()
            for k in range(done[method], done[method] + CYCLES[method]):
                reading, now = frames[k % len(frames)], PERIOD * k
                start = time.thread_time()
                cycle(reading, now)
                times[method].append(time.thread_time() - start)
            done[method] += CYCLES[method]
    active = int(np.median((scene.readings > 20).sum(axis=1)))
    for method, seconds in times.items():
        yield Row(scene.mode, scene.name, method, active, *(1e6 * np.percentile(seconds, [50, 99])))


def numbers(result: tuple, scene: Scene) -> list[float]:
    """Return the numbers of a cycle's result, with the areas of its two hulls."""
    count, force, cop, sigma, outer, nominal = result
    areas = []
    for hull in (outer, nominal):
        if isinstance(hull, np.ndarray):
            x, y = hull.reshape(-1, 2).T.astype(float) * scene.pitch
            areas.append(abs(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2)
        else:
            areas.append(hull.area)
    points = np.full((2, 2), np.nan)
    points[0] = np.nan if cop is None else cop
    if sigma is not None:
        points[1] = sigma
    return [count, force, *(points.ravel() if scene.mode == "noise" else points[0]), *areas]


def paced() -> Row:
    """Measure a loop that waits for every millisecond, as in a controller."""
    scene = next(s for s in scenes() if s.name == "1260 squares, 0.3 m/s")
    cycle, times = ours(scene), []
    begin = time.perf_counter()
    for k in range(3000):
        while (start := time.perf_counter()) < begin + k * PERIOD:
            time.sleep(max(0.0, begin + k * PERIOD - start - 2e-4))
        cycle(scene.readings[k % len(scene.readings)], k * PERIOD)
        times.append(time.perf_counter() - start)
    active = int(np.median((scene.readings > 20).sum(axis=1)))
    return Row("thresholds", "1260 squares, at 1 kHz", "ours", active, *(1e6 * np.percentile(times, [50, 99])))


def table(rows: list[Row]) -> str:
    """Return microseconds, and the ratio to ours, as text."""
    ours_of = {(r.mode, r.scene): r.median for r in rows if r.method == "ours"}
    title = "the cycle of a controller"
    lines = [f"{title:30} {'':10} {'method':22} {'active':>6} {'median':>8} {'p99':>8} [us]  times ours"]
    for r in rows:
        ratio = r.median / ours_of[r.mode, r.scene]
        lines.append(
            f"{r.scene:30} {r.mode:10} {r.method:22} {r.active:6} {r.median:8.0f} {r.p99:8.0f}       {ratio:5.1f}"
        )
    return "\n".join(lines)
