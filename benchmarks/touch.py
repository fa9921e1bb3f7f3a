"""Registration by touch: simulated sets with a known truth, one figure for each claim about ``skin-calib touches``.

    python benchmarks/touch.py [--only raster,offset] [--sets 200] [--seed 5000]

A sheet of 6 x 20 cells of 10 mm is on a cylinder. It is moved on it, then pressed at known places. A press loads the
cells by Hertz's pressure in a round spot; readings have 8 bits, gains differ by 15 %, the probe's position has an error
of 0.5 mm, and one press in ten is recorded at another place. The constants of the estimator were chosen with seeds
below 1000.
"""

import argparse
import sys
import tempfile
import time
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache
from itertools import product
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import trimesh
from scipy.spatial.transform import Rotation

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from skin_calib_addon.calibration import LinkCalibration, MeshSource, Patch, TaxelArray  # noqa: E402
from skin_calib_addon.geometry.mesh.triangle_mesh import TriangleMesh  # noqa: E402
from skin_calib_addon.inspection.touch_file import read_touch_file  # noqa: E402
from skin_calib_addon.pipeline import calibrate  # noqa: E402
from skin_calib_addon.plan import load_plan  # noqa: E402
from skin_calib_addon.robot.link_mesh import load_plan_mesh  # noqa: E402
from skin_calib_addon.validation import (  # noqa: E402
    Placement,
    Touches,
    directions_of,
    next_touch,
    placements,
    read_touches,
)
from skin_calib_addon.validation.flat import flat_places  # noqa: E402
from skin_calib_addon.validation.gains import fit_gains  # noqa: E402
from skin_calib_addon.validation.gravity import read_orientations  # noqa: E402
from skin_calib_addon.validation.placement import MAX_UNEXPLAINED  # noqa: E402
from skin_calib_addon.validation.tool import OF_LINK, OF_TOOL  # noqa: E402

ROWS, COLUMNS, PITCH, RADIUS = 6, 20, 0.01, 0.033  # [m]; the sheet nearly closes round the limb
SHIFT, TURN = 3e-3, np.deg2rad(2.0)  # standard deviations of a moved skin [m, rad]
PROBE_NOISE = 0.5e-3  # [m] per axis
GAIN_SPREAD, BITS, FULL_SCALE = 0.15, 8, 10.0  # [1, 1, N]
OUTLIERS = 0.1  # fraction of the presses
FORCE = 8.0  # of a press [N]
DIRECTION_NOISE = 1.6  # of each component of the force of a press, by the probe [N]: 11 degrees
FORCE_NOISE, MOMENT_NOISE = 0.2, 5e-3  # of the sensor, per component [N, N m]
Array = np.ndarray


@cache
def calibration() -> LinkCalibration:
    """Return the sheet of the plan: rows round the cylinder, the next row to their left."""
    i, j = (a.ravel() for a in np.indices((ROWS, COLUMNS)))
    flat = PITCH * np.column_stack((j, i))
    normals, tangents = frames(flat)
    positions, across = on_limb(flat), np.cross(normals, tangents)
    corners = [positions + PITCH / 2 * (a * tangents + b * across) for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    ids = {(a, b): f"s.{a}.{b}" for a, b in zip(i.tolist(), j.tolist())}
    near = (((a - 1, b), (a + 1, b), (a, b - 1), (a, b + 1)) for a, b in ids)
    taxels = TaxelArray(
        ids=tuple(ids.values()),
        channels=np.arange(len(i)),
        index=np.column_stack((i, j)),
        uv=np.zeros((len(i), 2)),
        positions_link=positions,
        normals_link=normals,
        tangents_link=tangents,
        corners_link=np.stack(corners, axis=1),
        areas=np.full(len(i), PITCH**2),
        neighbours=tuple(tuple(ids[cell] for cell in cells if cell in ids) for cells in near),
    )
    patch = Patch("sheet", "sheet", "tube", (ROWS, COLUMNS), (PITCH, PITCH), taxels)
    return LinkCalibration("limb", MeshSource("limb.stl", "0" * 64, 0, 0), (), (patch,))


def on_limb(flat: Array) -> Array:
    """Return points of the cylinder at flat positions (n, 2), shape (n, 3) [m]."""
    normals, _ = frames(flat)
    return RADIUS * normals + np.array((0, 0, 1.0)) * (flat[:, 1] + 0.02)[:, None]


def frames(flat: Array) -> tuple[Array, Array]:
    """Return the normals (n, 3) at flat positions, and the directions along the rows."""
    a = flat[:, 0] / RADIUS
    return np.stack((np.cos(a), np.sin(a), 0 * a), axis=1), np.stack((-np.sin(a), np.cos(a), 0 * a), axis=1)


MIDDLE = PITCH * np.array(((COLUMNS - 1) / 2, (ROWS - 1) / 2))


@dataclass(frozen=True)
class Moved:
    """The true motion of the sheet about its middle."""

    shift: Array
    turn: float

    @classmethod
    def at_random(cls, rng: np.random.Generator) -> "Moved":
        return cls(rng.normal(0, SHIFT, 2), float(rng.normal(0, TURN)))

    def to_limb(self, flat: Array) -> Array:
        """Return where points of the sheet are on the limb."""
        c, s = np.cos(self.turn), np.sin(self.turn)
        out: Array = (flat - MIDDLE) @ np.array(((c, s), (-s, c))) + MIDDLE + self.shift
        return out

    def to_sheet(self, flat: Array) -> Array:
        """Return the points of the sheet that are at flat positions on the limb."""
        c, s = np.cos(self.turn), np.sin(self.turn)
        out: Array = (flat - MIDDLE - self.shift) @ np.array(((c, -s), (s, c))) + MIDDLE
        return out


UNMOVED = Moved(np.zeros(2), 0.0)


def loads_at(on_sheet: Array, spots: Array | float, forces: Array | float) -> Array:
    """Return the loads (m, n) of presses at points of the sheet [N]; a spot has the diameter ``spots`` [m]."""
    k = np.arange(300) + 0.5
    radius, angle = np.sqrt(k / 300), k * np.pi * (1 + 5**0.5)
    spots, forces = (np.broadcast_to(a, len(on_sheet)) for a in (spots, forces))
    arms = spots[:, None, None] / 2 * radius[:, None] * np.column_stack((np.cos(angle), np.sin(angle)))
    weights = np.sqrt(1 - radius**2)
    cells = np.rint((on_sheet[:, None] + arms) / PITCH).astype(int)
    inside = ((cells >= 0) & (cells < (COLUMNS, ROWS))).all(axis=2)
    loads = np.zeros((len(on_sheet), ROWS * COLUMNS))
    m, a = np.nonzero(inside)
    np.add.at(loads, (m, cells[m, a, 1] * COLUMNS + cells[m, a, 0]), weights[a] * forces[m] / weights.sum())
    return loads


def readings(on_sheet: Array, spot: float, rng: np.random.Generator, force: float = FORCE) -> Array:
    """Return the readings (m, n) of presses at points of the sheet."""
    gains = 1 + GAIN_SPREAD * rng.standard_normal(ROWS * COLUMNS)
    loads = loads_at(on_sheet, spot, force)
    return np.clip(np.rint(loads * gains / FULL_SCALE * (2**BITS - 1)), 0, 2**BITS - 1)


def at_random(count: int, moved: Moved, rng: np.random.Generator) -> Array:
    """Return places on the limb, inside the moved sheet."""
    return moved.to_limb(PITCH * (rng.uniform(0, 1, (count, 2)) * (COLUMNS, ROWS) - 0.5))


def raster(step: float, moved: Moved, rng: np.random.Generator, count: int = 40) -> Array:
    """Return places of a robot on rows over the limb that start anywhere."""
    size = PITCH * np.array((COLUMNS, ROWS))
    grid = np.stack(np.meshgrid(*(np.arange(0, a, step) for a in size), indexing="ij"), axis=-1).reshape(-1, 2)
    places = grid + rng.uniform(0, step, 2) - PITCH / 2
    inside = moved.to_sheet(places) + PITCH / 2
    places = places[((inside > 0) & (inside < size)).all(axis=1)]
    return rng.permutation(places)[:count]


def recorded(places: Array, rng: np.random.Generator, outliers: float = OUTLIERS) -> Array:
    """Return the points (m, 3) that are recorded for presses."""
    points = on_limb(places) + rng.normal(0, PROBE_NOISE, (len(places), 3))
    wrong = np.flatnonzero(rng.uniform(size=len(places)) < outliers)
    points[wrong] = on_limb(at_random(len(wrong), UNMOVED, rng))
    return points


def table(columns: dict[str, Array]) -> Iterator[str]:
    """Yield the lines of a table."""
    yield ",".join(columns)
    yield from (",".join(row) for row in zip(*([f"{x:.6g}" if not isinstance(x, str) else x for x in c]
                                               for c in columns.values())))  # fmt: skip


def columns_of(felt: Array, points: Array | None = None, with_readings: bool = False) -> dict[str, Array]:
    """Return the columns of a table for readings (m, n) and points (m, 3)."""
    ids = np.array(calibration().patches[0].taxels.ids)
    columns = {"taxel": ids[felt.argmax(axis=1)]} | ({} if points is None else dict(zip("xyz", points.T)))
    return columns | (dict(zip(ids.tolist(), felt.T)) if with_readings else {})


def compared(columns: dict[str, Array]) -> Placement:
    """Return what the package states about a table."""
    return placements(calibration(), read(columns))[0]


def compared_forces(columns: dict[str, Array]) -> tuple[Placement, set[str]]:
    """Return the same, and the codes of the warnings about the forces."""
    touches = read(columns)
    directions, _ = directions_of(calibration(), touches)
    codes = {warning.code for warning in directions.warnings()} if directions else set()
    return placements(calibration(), touches)[0], codes


def read(columns: dict[str, Array]) -> Touches:
    """Write and read a table."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "touches.csv"
        path.write_text("\n".join(table(columns)) + "\n")
        return read_touches(path, calibration())


@dataclass(frozen=True)
class Error:
    """Errors (n, 2) of the taxels of a set after the stated motion, and their stated standard errors [m]."""

    errors: Array
    sigma: Array
    codes: tuple[str, ...]  # of the warnings
    moves: float  # stated motion in standard errors, the largest of three

    @classmethod
    def of(cls, found: Placement, moved: Moved, codes: tuple[str, ...] | None = None) -> "Error":
        codes = tuple(warning.code for warning in found.warnings()) if codes is None else codes
        flat = flat_places(found.patch, found.patch.taxels.index)
        motion = found.motion
        errors = motion.at(flat) - (moved.to_limb(flat) - flat)
        sigma = motion.sigma_at(flat)
        moves = np.abs(np.append(motion.shift / motion.shift_error, motion.turn / motion.turn_error)).max()
        return cls(errors, sigma, codes, moves)


def line(name: str, sets: list[Error], target: str) -> str:
    """Return a line of the table: rms per axis, coverage, warnings."""
    ratios = np.array([np.abs(s.errors) / s.sigma for s in sets])
    rms = 1e3 * np.sqrt(np.mean([(s.errors**2).mean() for s in sets]))
    stated = 1e3 * np.sqrt(np.mean([(s.sigma**2).mean() for s in sets]))
    codes = Counter(code for s in sets for code in dict.fromkeys(s.codes))
    return (
        f"{name:34} {len(sets):4} sets  rms {rms:5.2f} mm (stated {stated:5.2f})  inside {(ratios < 1).mean():4.0%} / "
        f"{(ratios < 2).mean():4.0%}  moved > 2 s.e. {sum(s.moves > 2 for s in sets):3}  {dict(codes)}  [{target}]"
    )


def random_sets(sets: int, seed: int) -> Iterator[str]:
    """Yield errors for presses at random places."""
    for count in (5, 10, 20, 80):
        for name, spot in (("strongest cell", 5e-3), ("spot 4 mm", 4e-3), ("spot 6 mm", 6e-3)):
            found = []
            for k in range(sets):
                rng = np.random.default_rng(seed + k)
                moved = Moved.at_random(rng)
                places = at_random(count, moved, rng)
                felt = readings(moved.to_sheet(places), spot, rng)
                columns = columns_of(felt, recorded(places, rng), "spot" in name)
                if (one := compared(columns)).motion is not None:
                    found.append(Error.of(one, moved))
            target = "20: at most .5 mm, 68/95" if count == 20 and "spot" in name else ""
            yield line(f"random, {count} presses, {name}", found, target)


def raster_sets(sets: int, seed: int) -> Iterator[str]:
    """Yield errors for presses of a robot on a raster, on moved and on unmoved skins."""
    for still in (False, True):
        for step in (1.0, 1.37, 2.0):
            found = []
            for k in range(sets):
                rng = np.random.default_rng(seed + k)
                moved = UNMOVED if still else Moved.at_random(rng)
                places = raster(step * PITCH, moved, rng)
                felt = readings(moved.to_sheet(places), 4e-3, rng)
                found.append(Error.of(compared(columns_of(felt, recorded(places, rng, 0.0))), moved))
            yield line(f"raster {step} pitches{', unmoved' * still}", found, "80 % in two s.e., a warning")


def frame_sets(sets: int, seed: int) -> Iterator[str]:
    """Yield errors for presses that are recorded as 50 rows each: with numbers, by their position, by their force."""
    for kind in ("numbered", "strongest cell", "readings over time"):
        found, wrong = [], 0
        for k in range(sets):
            rng = np.random.default_rng(seed + k)
            moved = Moved.at_random(rng)
            places = at_random(10, moved, rng)
            felt, points = readings(moved.to_sheet(places), 4e-3, rng), recorded(places, rng, 0.0)
            if kind == "readings over time":
                columns = session(felt, points, rng)
            else:
                frames, jitter = np.repeat(felt, 50, axis=0), rng.normal(0, 3e-4, (500, 3))
                columns = columns_of(frames, np.repeat(points, 50, axis=0) + jitter, kind == "numbered")
                columns |= {"press": np.repeat(np.arange(10), 50)} if kind == "numbered" else {}
            found.append(Error.of(one := compared(columns), moved))
            wrong += len(one.rows) != 10
        yield line(f"10 x 50 frames, {kind}", found, f"68 +- 5 / 95 +- 3 %; other than 10 presses: {wrong}")


def session(felt: Array, points: Array, rng: np.random.Generator) -> dict[str, Array]:
    """Return a recording at 50 Hz: a second of rest, then presses of a second that rise and fall, with pauses."""
    shape = np.concatenate((np.zeros(25), np.linspace(0, 1, 10), np.ones(30), np.linspace(1, 0, 10)))
    loads = np.concatenate((np.zeros((50, felt.shape[1])), *(shape[:, None] * press for press in felt)))
    tips = np.concatenate((np.zeros((50, 3)), *(np.repeat(point[None], len(shape), axis=0) for point in points)))
    loads = np.rint(np.maximum(loads + rng.normal(3.0, 0.7, loads.shape), 0))
    columns = columns_of(loads, tips + rng.normal(0, 3e-4, tips.shape), True)
    del columns["taxel"]
    return {"time": np.arange(len(loads)) / 50} | columns


def wrench_columns(
    places: Array, moved: Moved, offset: Array, tilt: Array, rng: np.random.Generator, is_real: bool = False
) -> dict[str, Array]:
    """Return a table of wrenches [N, N m]: the sensor or the contact adds ``offset``; presses lean by ``tilt``."""
    felt = readings(moved.to_sheet(places), 4e-3, rng)
    normals, tangents = frames(places)
    across = np.cross(normals, tangents)
    forces = -normals + np.tan(tilt[0]) * tangents + np.tan(tilt[1]) * across
    forces *= FORCE / np.linalg.norm(forces, axis=1)[:, None]
    forces += rng.normal(0, DIRECTION_NOISE, forces.shape) + is_real * offset
    moments = np.cross(recorded(places, rng, 0.0), forces) + rng.normal(0, MOMENT_NOISE, forces.shape)
    forces += rng.normal(0, FORCE_NOISE, forces.shape)
    names = ("fx", "fy", "fz", "tx", "ty", "tz")
    return columns_of(felt) | dict(zip(names, (*(forces + (not is_real) * offset).T, *moments.T)))


def offset_sets(sets: int, seed: int) -> Iterator[str]:
    """Yield how often an offset of the force is named, and the error of the shift."""
    for is_real, count, size in product((False, True), (20, 40), (0.0, 1.5, 3.0)):
        if is_real and size == 0:
            continue
        found, shifts, named = [], [], 0
        for k in range(sets):
            rng = np.random.default_rng(seed + k)
            places = at_random(count, UNMOVED, rng)
            columns = wrench_columns(places, UNMOVED, size * np.eye(3)[k % 3], np.zeros(2), rng, is_real)
            one, codes = compared_forces(columns)
            named += "force-offset" in codes
            found.append(Error.of(one, UNMOVED, ()))
            shifts.append(one.motion.at(MIDDLE[None])[0])
        rms = 1e3 * np.sqrt(np.mean(np.square(shifts)))
        target = f"named {named}, shift {rms:.2f} mm rms; 95 %, 1 mm"
        yield line(f"{count} wrenches, {size} N of the {'contact' if is_real else 'sensor'}", found, target)


def tilt_sets(sets: int, seed: int) -> Iterator[str]:
    """Yield what is stated about presses that lean."""
    for angle in (0, 10, 25, 75):
        codes: Counter[str] = Counter()
        for k in range(sets):
            rng = np.random.default_rng(seed + k)
            places = at_random(40, UNMOVED, rng)
            tilt = np.array((np.deg2rad(angle), 0.0))
            one, of_forces = compared_forces(wrench_columns(places, UNMOVED, np.zeros(3), tilt, rng))
            codes.update({*of_forces, *(warning.code for warning in one.warnings())})
        yield f"40 presses {angle:2} degrees off the normal {sets:4} sets  {dict(codes)}"


def orders() -> dict[str, Callable[[Array, Array], Array]]:
    """Return wrong orders of the channels: the number that is reported for a cell."""
    h, w = ROWS, COLUMNS
    swap = {2: 3, 3: 2}
    swapped = np.vectorize(lambda a: swap.get(int(a), int(a)))
    return {
        "": lambda i, j: i * w + j,
        "rows counted from the other end": lambda i, j: (h - 1 - i) * w + j,
        "columns counted from the other end": lambda i, j: i * w + w - 1 - j,
        "rows and columns counted from the other end": lambda i, j: (h - 1 - i) * w + w - 1 - j,
        "every second row backwards": lambda i, j: i * w + np.where(i % 2, w - 1 - j, j),
        "column by column": lambda i, j: j * h + i,
        "rows 2 and 3 exchanged": lambda i, j: swapped(i) * w + j,
        "columns 2 and 3 exchanged": lambda i, j: i * w + swapped(j),
        "halves of the rows swapped": lambda i, j: i * w + (j + w // 2) % w,
        "columns off by one, each too high": lambda i, j: i * w + (j + 1) % w,
        "at random": lambda i, j: np.random.default_rng(0).permutation(h * w)[i * w + j],
    }


def wiring_sets(sets: int, seed: int) -> Iterator[str]:
    """Yield how often an order of the channels is named, called ambiguous, and wrongly named."""
    taxels = calibration().patches[0].taxels
    for count in (10, 20):
        for name, order in orders().items():
            verdicts: Counter[str] = Counter()
            for k in range(sets):
                rng = np.random.default_rng(seed + k)
                moved = Moved.at_random(rng)
                places = at_random(count, moved, rng)
                cells = readings(moved.to_sheet(places), 4e-3, rng).argmax(axis=1)
                numbers = order(*taxels.index[cells].T)
                felt = np.eye(ROWS * COLUMNS)[numbers]
                points = recorded(places, rng)
                is_there = np.linalg.norm(points - on_limb(places), axis=1) < PITCH / 2
                verdicts[verdict(compared(columns_of(felt, points)), cells, is_there)] += 1
            yield f"wiring, {count} touches, {name or 'as planned':44} {sets:4} sets  {dict(verdicts.most_common())}"


def verdict(found: Placement, cells: Array, is_there: Array) -> str:
    """Return whether the stated order is right, ambiguous, or wrong, and whether with odds above 5 nats.

    An order is right if it has the true cells of all touches that are recorded where they were.
    """
    wiring = found.wiring
    if 1 - wiring.explained > MAX_UNEXPLAINED:
        return "unexplained"
    if not wiring.is_certain:
        return "ambiguous"
    rows = found.lines - 2
    if (wiring.order.rows == cells[rows])[is_there[rows]].all():
        return "right"
    return "WRONG" if wiring.odds > 5 else "wrong, below 5 nats"


def force_session(
    count: int, rng: np.random.Generator, gains: Array, power: float = 1.0, hysteresis: float = 0.0
) -> tuple[dict[str, Array], Array]:
    """Return a recording at 50 Hz of presses of 2 to 12 N with readings and wrenches, and their number (t,).

    A reading of a load l is ``1 - exp(-(g l / 8 N)^power)`` of the range; while a load falls, it is larger by
    ``hysteresis``.
    """
    places = at_random(count, UNMOVED, rng)
    totals = rng.uniform(2.0, 12.0, count)
    loads = loads_at(places, 5e-3 * (totals / FORCE) ** (1 / 3), totals)
    shape = np.concatenate((np.zeros(25), np.linspace(0, 1, 10), np.ones(30), np.linspace(1, 0, 10)))
    factor = np.concatenate((np.zeros(50), np.tile(shape, count)))
    press = np.concatenate((np.zeros(50, int), np.repeat(np.arange(count), len(shape))))
    felt = gains * loads[press] * factor[:, None] * (1 + hysteresis * (np.gradient(factor) < 0))[:, None]
    felt = 3.0 + 250 * (1 - np.exp(-((felt / 8) ** power))) + rng.normal(0, 0.7, felt.shape)
    normals, _ = frames(places)
    forces = -normals[press] * (totals[press] * factor)[:, None] + rng.normal(0, FORCE_NOISE, (len(press), 3))
    moments = np.cross(on_limb(places)[press], forces)
    columns = columns_of(np.clip(np.rint(felt), 0, 255), None, True)
    del columns["taxel"]
    wrenches = dict(zip(("fx", "fy", "fz", "tx", "ty", "tz"), (*forces.T, *moments.T)))
    return {"time": np.arange(len(press)) / 50} | columns | wrenches, loads


def response_sets(sets: int, seed: int) -> Iterator[str]:
    """Yield the error of the total force of other presses, by the response that presses gave."""
    for count, power, hysteresis in ((50, 1, 0), (200, 1, 0), (200, 0.7, 0), (200, 1.6, 0), (200, 1, 0.1), (600, 1, 0)):
        errors, plain, stated, biases, named = [], [], [], [], 0
        for k in range(max(sets // 10, 1)):
            rng = np.random.default_rng(seed + k)
            gains = 1 + GAIN_SPREAD * rng.standard_normal(ROWS * COLUMNS)
            fit = fit_gains(calibration(), read(force_session(count, rng, gains, power, hysteresis)[0]))
            columns, loads = force_session(200, rng, gains, power)
            fresh = read(columns).readings
            inside = loads.sum(axis=1) > 1.9  # of presses beyond the edge a part is felt
            one = [fit.responses[name] for name in fit.ids]
            total = loads.sum(axis=1)[inside]
            with_gains = sum(r.newtons(fresh[:, i] + 3.0) for i, r in enumerate(one))[inside]
            common = sum(fit.common.newtons(fresh[:, i] + 3.0) for i in range(len(one)))[inside]
            errors.append(with_gains / total - 1)
            plain.append(common / total - 1)
            biases.append(with_gains.sum() / total.sum() - 1)
            stated.append(fit.rms)
            named += fit.hysteresis is not None
        rms, alone = (100 * np.sqrt(np.mean(np.square(np.concatenate(e)))) for e in (errors, plain))
        yield (
            f"response, {count} presses, power {power}, hysteresis {hysteresis}: {len(errors)} sets  rms {rms:.1f} % "
            f"(one curve {alone:.1f} %, stated {100 * np.mean(stated):.1f} %), sum {100 * np.mean(biases):+.2f} +- "
            f"{100 * np.std(biases):.2f} %, hysteresis named {named}  [200: 6 %, 1 %]"
        )


def gravity_sets(sets: int, seed: int) -> Iterator[str]:
    """Yield the error of the orientation of taxels by accelerometers with an offset of .3 m/s^2 per axis."""
    taxels = calibration().patches[0].taxels
    axes = np.concatenate((taxels.axes_link, taxels.normals_link[:, None]), axis=1)
    for count, noise, scale in ((10, 0.03, 0.0), (10, 0.05, 0.01), (20, 0.05, 0.01)):
        errors, stated = [], []
        for k in range(max(sets // 20, 1)):
            rng = np.random.default_rng(seed + k)
            down = rng.normal(size=(count, 3))
            down /= np.linalg.norm(down, axis=1)[:, None]
            scales = 1 + rng.normal(0, scale, (len(axes), 1, 3))
            measured = scales * (-9.80665 * down @ axes.transpose(0, 2, 1)) + rng.normal(0, 0.3, (len(axes), 1, 3))
            measured += rng.normal(0, noise, measured.shape)
            names = np.repeat(np.array(taxels.ids), count)
            of = dict(zip(("ax", "ay", "az"), measured.reshape(-1, 3).T))
            of |= dict(zip(("gx", "gy", "gz"), np.tile(down, (len(axes), 1)).T))
            with tempfile.TemporaryDirectory() as folder:
                path = Path(folder) / "rest.csv"
                path.write_text("\n".join(table({"taxel": names} | of)) + "\n")
                found = read_orientations(path, calibration())
            errors.append([(*one.tilt, one.turn) for one in found])
            stated.append([one.errors for one in found])
        ratios = np.abs(np.array(errors) / np.array(stated))
        yield (
            f"orientation, {count} postures, noise {noise} m/s^2, scales {scale:.0%}: {len(errors)} x {len(axes)} "
            f"taxels  rms {np.rad2deg(np.sqrt(np.mean(np.square(errors)))):.2f} degrees per axis, inside "
            f"{(ratios < 1).mean():.0%} / {(ratios < 2).mean():.0%}  [.4]"
        )


def planned_sets(sets: int, seed: int) -> Iterator[str]:
    """Yield errors for presses of the cells that the presses before say are worth most."""
    flat = flat_places(calibration().patches[0], calibration().patches[0].taxels.index)
    found: dict[int, list[Error]] = {10: [], 20: []}
    for k in range(sets):
        rng = np.random.default_rng(seed + k)
        moved, cell = Moved.at_random(rng), len(flat) // 2
        felt, points = np.empty((0, len(flat))), np.empty((0, 3))
        for count in range(1, max(found) + 1):
            place = moved.to_limb(flat[cell] + PITCH * rng.uniform(-0.5, 0.5, (1, 2)))
            felt = np.vstack((felt, readings(moved.to_sheet(place), 5e-3, rng)))
            points = np.vstack((points, recorded(place, rng)))
            one = compared(columns_of(felt, points))
            if count in found:
                found[count].append(Error.of(one, moved))
            following = next_touch(one)
            cell = int(rng.integers(len(flat))) if following is None else following.row
    for count, errors in found.items():
        yield line(f"planned, {count} presses, strongest cell", errors, "better than random")


LEVER, TIP_RADIUS = 0.15, 4e-3  # of the tool: from the origin of its pose to the middle of its tip [m]


@cache
def wrist() -> tuple[LinkCalibration, TriangleMesh]:
    """Return the wrist of the samples with its mesh, whose faces are divided to 100 000."""
    plan = load_plan(ROOT / "sample_scenes" / "wrist.plan.json")
    mesh = load_plan_mesh(plan)
    while len(mesh.faces) < 100_000:
        mesh = TriangleMesh(*trimesh.remesh.subdivide(mesh.vertices, mesh.faces))
    return calibrate(plan).calibration, mesh


def wand() -> trimesh.Trimesh:
    """Return a tool of 5000 triangles: a handle with a spherical tip at the end of its lever."""
    tip, handle = trimesh.creation.icosphere(4, TIP_RADIUS), trimesh.creation.cylinder(2e-3, LEVER - 2e-3)
    tip.apply_translation((0, 0, LEVER))
    handle.apply_translation((0, 0, LEVER / 2))
    return trimesh.util.concatenate([tip, handle])


def tool_session(
    folder: Path, rng: np.random.Generator, noise: float, turn: float, rows: int, with_link: bool, count: int = 40
) -> tuple[Path, Array, Array]:
    """Write poses of the wand and the wrist in the world; return the file, and true points and normals (n, 3).

    The tip is -0.3 to 0.7 mm inside the link, its handle leans by 15 degrees at random. Each row has its own noise.
    Without the pose of the link, that of the tool is in its frame.
    """
    calibration, mesh = wrist()
    middles, normals = mesh.triangles.mean(axis=1), mesh.face_normals
    taxels = calibration.patches[0].taxels
    near = np.linalg.norm(middles[:, None] - taxels.positions_link[::5], axis=2).min(axis=1) < 0.01
    faces = rng.choice(np.flatnonzero(near), count, replace=False)
    points, normals = middles[faces], normals[faces]
    leaning = Rotation.from_rotvec(np.deg2rad(15) * rng.normal(size=(count, 3))).apply(-normals)
    turns = [Rotation.align_vectors([a], [(0, 0, 1.0)])[0] for a in leaning]
    points = points - normals * rng.uniform(-0.3e-3, 0.7e-3, (count, 1))
    tips = points + normals * TIP_RADIUS
    lines = ["taxel,press," + ",".join((*OF_TOOL, *OF_LINK * with_link)), "# tool: wand.stl mm"]
    for k, (tip, rotation) in enumerate(zip(tips, turns)):
        link, at = Rotation.random(random_state=rng), rng.uniform(-1, 1, 3)
        if not with_link:
            link, at = Rotation.identity(), np.zeros(3)
        origin = tip - rotation.apply((0, 0, LEVER))
        for _ in range(rows):
            numbers = []
            for r, p in ((link * rotation, link.apply(origin) + at), (link, at))[: 1 + with_link]:
                r = Rotation.from_rotvec(rng.normal(0, turn, 3)) * r
                numbers += [*(p + rng.normal(0, noise, 3)), *r.as_quat()]
            lines.append(f"{taxels.ids[0]},{k}," + ",".join(f"{x:.6f}" for x in numbers))
    mesh = wand()
    mesh.apply_scale(1e3)
    (folder / "wand.stl").write_bytes(mesh.export(file_type="stl"))
    (folder / "session.csv").write_text("\n".join(lines) + "\n")
    return folder / "session.csv", points, normals


def tool_sets(sets: int, seed: int) -> Iterator[str]:
    """Yield the error of the point of touch by poses of motion capture, and what is stated about it."""
    for noise, turn, rows, with_link in (
        (0.0, 0.0, 1, True),
        (0.2e-3, 0.2, 1, False),
        (0.2e-3, 0.2, 1, True),
        (0.2e-3, 0.2, 20, True),
        (0.2e-3, 0.7, 1, True),
    ):
        nearest, of_centroids, along, stated, count, seconds = [], [], [], [], 0, 0.0
        for k in range(max(sets // 40, 1)):
            rng = np.random.default_rng(seed + k)
            with tempfile.TemporaryDirectory() as folder:
                path, points, normals = tool_session(Path(folder), rng, noise, np.deg2rad(turn), rows, with_link)
                start = time.perf_counter()
                found = read_touch_file(path, wrist()[0], lambda: wrist()[1]).tool
                seconds = time.perf_counter() - start
            errors = found.points - points
            nearest += np.linalg.norm(errors, axis=1).tolist()
            along += np.linalg.norm(errors - (errors * normals).sum(axis=1)[:, None] * normals, axis=1).tolist()
            of_centroids += np.linalg.norm(found.centroids - points[found.intersecting], axis=1).tolist()
            count += len(points)
            if found.poses.noise:
                levers = (
                    np.linalg.norm(found.points - found.poses.positions, axis=1),
                    np.linalg.norm(found.points, axis=1),
                )
                both = zip((found.poses.noise, found.poses.noise_of_link), levers)
                stated.append(np.sqrt(2 * sum(one.at(float(lever.mean())) ** 2 for one, lever in both)))
        near, far, flat = (1e3 * np.sqrt(np.mean(np.square(e))) for e in (nearest, of_centroids, along))
        poses = "tool and link" if with_link else "tool"
        yield (
            f"{poses}, {1e3 * noise} mm and {turn} degrees, {rows:2} rows: {count} touches  nearest approach "
            f"{near:.2f} mm rms ({flat:.2f} along the surface), centroid {far:.2f} mm "
            f"in {len(of_centroids) / count:.0%}"
            + (f"; stated for a row {1e3 * np.mean(stated):.2f} mm" if stated else "")
            + f"; {seconds:.1f} s for 40 presses  [.8]"
        )


def scatter_sets(sets: int, seed: int) -> Iterator[str]:
    """Yield errors of the displacement by such touches, with the scatter of the poses known or not (one row each)."""
    for turn, count, spot, is_known in product((0.2, 0.7), (12, 40), (None, 4e-3), (False, True)):
        found = []
        for k in range(sets):
            rng = np.random.default_rng(seed + k)
            moved = Moved.at_random(rng)
            places = at_random(count, moved, rng)
            felt, points = readings(moved.to_sheet(places), spot or 5e-3, rng), on_limb(places)
            levers = np.hypot(LEVER, np.linalg.norm(points, axis=1) + 0.05)  # of the tool and of the link
            sigma = np.hypot(np.sqrt(2) * 2e-4, np.deg2rad(turn) * levers)
            points = points + rng.normal(size=points.shape) * sigma[:, None]
            touches = read(columns_of(felt, points, spot is not None))
            touches = replace(touches, tool=SimpleNamespace(sigma=sigma)) if is_known else touches
            found.append(Error.of(placements(calibration(), touches)[0], moved, ()))
        name = (
            f"{turn} degrees, {count} presses, {'spot 4 mm' if spot else 'strongest'}, {'' if is_known else 'un'}known"
        )
        yield line(name, found, f"{sigma.mean() * 1e3:.2f} mm per axis of a touch")


STUDIES = {
    "random": random_sets,
    "planned": planned_sets,
    "raster": raster_sets,
    "frames": frame_sets,
    "offset": offset_sets,
    "tilt": tilt_sets,
    "wiring": wiring_sets,
    "response": response_sets,
    "gravity": gravity_sets,
    "tool": tool_sets,
    "scatter": scatter_sets,
}


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--only", default=",".join(STUDIES))
    parser.add_argument("--sets", type=int, default=200)
    parser.add_argument("--seed", type=int, default=5000)
    options = parser.parse_args()
    warnings.simplefilter("error", RuntimeWarning)
    for name in options.only.split(","):
        for text in STUDIES[name](options.sets, options.seed):
            print(text, flush=True)


if __name__ == "__main__":
    main()
