"""Compare the C++ runtime with the Python runtime in random frames of random skins.

    python -m cpp.tests.differential [--frames 10000] [--seed 0] [--module build/python]

Sets, numbers of contacts, flags and forces must agree to the bit, sums to 1e-12 of what they add up, polygons to a
nanometre of the grid on which hulls are computed. It prints the largest differences, and stops at the first wrong one.
"""

import argparse
import json
import sys
import time
from collections import Counter
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from skin_calib_addon.calibration import LinkCalibration, Response, ResponseTable
from skin_calib_addon.calibration.file import to_document
from skin_calib_addon.runtime import Body, Frame, Polygon, Skin
from skin_calib_addon.runtime.lost import MAX_LOST_FRACTION
from tests.samples import plane, small_calibration
from tests.soles import cell_patch, sole_patch
from tests.vectors.make import record, record_body, rest_counts, skin_of

FRAMES = 100  # of one skin
CALM_FRAMES = 300  # of a skin whose contacts and faults last: blocks of the drift end
SUM = 1e-12  # [1] difference of sums, relative to the sum of the sizes of what they add
LENGTH = 1e-8  # [m] distance of polygons: some steps of the grid on which hulls are exact
EXACT = ("flags", "trusted", "touched", "known", "stuck", "stands", "active", "sure", "possible", "is_standing")
EXACT += ("forces", "force_sigmas")
FAULTS = {"drift", "noisy", "stuck", "frozen", "below_rest", "byte_order"}


class Difference(Exception):
    """The runtimes do not agree."""


class Comparison:
    """Compare frames, and keep the largest differences."""

    def __init__(self, module) -> None:
        self.measure, self.rng = module.measure, np.random.default_rng(0)
        self.largest: Counter = Counter()
        self.counts: Counter = Counter()

    def frames(self, python: dict, cpp: dict, upward: float, cancels: float) -> None:
        """Compare the records of one frame with a force ``upward`` of all taxels [N].

        The size of what its sums add is larger than that of the parts of the sums by a factor ``cancels``.
        """
        cpp["flags"] = sorted(cpp["flags"])
        for name in EXACT:
            self.exact(name, python[name], cpp[name])
        size = python["size"]
        self.contacts(python["contacts"], cpp["contacts"])
        for name in ("wrench", "load"):
            self.close(name, python[name], cpp[name], size)
        for name, load in (("cop", python["load"]), ("zmp", upward)):
            self.close(name, python[name], cpp[name], size / load if load else np.inf)
        self.sigmas(python, cpp, upward, cancels)
        self.polygons(python, cpp)
        self.counts["contacts"] += len(python["contacts"])
        self.counts["with CoP"] += python["cop"] is not None
        self.counts["guaranteed"] += python["guaranteed"] is not None and len(python["guaranteed"]) > 2
        self.counts["unknown taxels"] += not python["known"].all()
        self.counts.update(flag for flag in python["flags"] if flag in FAULTS)

    def bodies(self, python: dict, cpp: dict, size: float, upward: float) -> None:
        """Compare the records of one frame of a body; ``size`` is the sum of the sizes of the forces [N]."""
        self.exact("trusted", python["trusted"], cpp["trusted"])
        for name in ("flags", "lost", "standing"):
            self.exact(name, sorted(python[name]), sorted(cpp[name]))
        self.close("wrench", python["wrench"], cpp["wrench"], 3 * size)
        for name in ("cop", "zmp"):
            far = 1.0 if python[name] is None else 1.0 + float(np.abs(python[name]).max())
            self.close(f"body {name}", python[name], cpp[name], 3 * size / max(upward, 1e-9) * far)
        for name in ("cop_sigma", "zmp_sigma"):
            self.close(f"body {name}", python[name], cpp[name], 1.0, 1e-9)
        self.polygons(python, cpp)
        self.counts["bodies with ZMP"] += python["zmp"] is not None

    def sigmas(self, python: dict, cpp: dict, upward: float, cancels: float) -> None:
        """Compare standard deviations by their squares, of which large terms cancel."""
        variance = (python["load_sigma"] or 0.0) ** 2
        finite = python["force_sigmas"]
        total = 0.0 if finite is None else float((finite[np.isfinite(finite)] ** 2).sum()) + python["size"] ** 2
        divisors = {"wrench_sigma": 1.0, "load_sigma": 1.0, "cop_sigma": python["load"], "zmp_sigma": upward}
        for name, divisor in divisors.items():
            a, b = python[name], cpp[name]
            if a is None or b is None:
                self.exact(name, a, b)
                continue
            a, b = np.square(a), np.square(b)
            self.close(name, a, b, cancels * (a + (total + variance) / divisor**2))

    def contacts(self, python: list, cpp: list) -> None:
        """Compare contacts."""
        self.exact("contact count", len(python), len(cpp))
        for a, b in zip(python, cpp):
            for name in ("number", "taxels"):
                self.exact(name, a[name], b[name])
            for name in ("force", "wrench"):
                self.close(f"contact {name}", a[name], b[name], a["force"])
            for name in ("position", "normal"):
                self.close(f"contact {name}", a[name], b[name], 1.0)
            for name in ("area", "peak_pressure"):
                self.close(f"contact {name}", a[name], b[name], a[name])

    def exact(self, name: str, a, b) -> None:
        """Compare what must be equal."""
        is_equal = b is None if a is None else b is not None and np.array_equal(a, b)
        if not is_equal:
            raise Difference(f"{name}: {a} in Python, {b} in C++")

    def close(self, name: str, a, b, scale, limit: float = SUM) -> None:
        """Compare numbers; the difference is relative to a scale."""
        if a is None or b is None:
            self.exact(name, a, b)
            return
        a, b = np.asarray(a), np.asarray(b)
        if (a == b).all():
            return
        with np.errstate(all="ignore"):
            difference = np.where((a == b) | (np.isnan(a) & np.isnan(b)), 0.0, np.abs(a - b) / scale)
        worst = float(np.max(difference, initial=0.0))
        if not worst <= limit:
            raise Difference(f"{name}: {a} in Python, {b} in C++: {worst:.2g} of {scale}")
        self.largest[name] = max(self.largest[name], worst)

    def polygons(self, python: dict, cpp: dict) -> None:
        """Compare polygons by area and distance, and probabilities."""
        for name in ("outer_probability", "guaranteed_probability"):
            self.close(name, python[name], cpp[name], 1.0)
        for name in ("outer", "nominal", "guaranteed"):
            a, b = python[name], cpp[name]
            if a is None or b is None:
                self.exact(name, a, b)
                continue
            self.counts[f"other corners of {name}"] += not np.array_equal(a, b)
            if (len(a) == 0) != (len(b) == 0):
                thin = a if len(a) else b  # a polygon thinner than rounding may vanish
                if area(thin) > LENGTH * np.ptp(thin, axis=0).max(initial=0.0):
                    raise Difference(f"{name}: {a.tolist()} in Python, {b.tolist()} in C++")
                continue
            if not len(a):
                continue
            if self.rng.random() < 0.1:
                self.measures(a)
            if np.array_equal(a, b):
                continue
            distance = max(distances(a, b), distances(b, a))
            perimeter = float(np.linalg.norm(a - np.roll(a, -1, axis=0), axis=1).sum())
            self.largest[f"{name} [m]"] = max(self.largest[f"{name} [m]"], distance)
            if not (distance <= LENGTH and abs(area(a) - area(b)) <= LENGTH * max(perimeter, LENGTH)):
                raise Difference(f"{name}: {distance} m apart: {a.tolist()} in Python, {b.tolist()} in C++")

    def measures(self, corners: np.ndarray) -> None:
        """Compare area, margin and nearest point of a polygon, for a point near it, or on its border."""
        rng, polygon = self.rng, Polygon(np.array(corners))
        near = corners[rng.integers(len(corners))], corners[rng.integers(len(corners))]
        point = near[0] + rng.choice((0.0, 0.5, rng.random())) * (near[1] - near[0])
        point = point + rng.choice((0.0, 1e-9, 0.01, 1.0)) * rng.normal(size=2)
        size, is_inside, margin, closest = self.measure(corners, point)
        self.exact("contains", polygon.contains(point), is_inside)
        for name, a, b in (("area", polygon.area, size), ("margin", polygon.margin(point), margin)):
            self.close(f"polygon {name}", a, b, 1.0)
        self.close("polygon closest", polygon.closest(point), closest, 1.0, 1e-9)


def area(corners: np.ndarray) -> float:
    """Return the area of a polygon [m^2]."""
    x, y = (corners - corners[:1]).T
    return float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2 if len(corners) > 2 else 0.0


def distances(points: np.ndarray, corners: np.ndarray) -> float:
    """Return the largest distance of points (k, 2) outside of a convex polygon from it [m]."""
    a, b = corners, np.roll(corners, -1, axis=0)
    edge = b - a
    t = ((points[:, None] - a) * edge).sum(axis=2) / np.maximum((edge**2).sum(axis=1), 1e-300)
    feet = a + np.clip(t, 0, 1)[..., None] * edge
    nearest = np.linalg.norm(points[:, None] - feet, axis=2).min(axis=1)
    if len(corners) > 2:
        arm = points[:, None] - a
        inside = (edge[:, 0] * arm[..., 1] - edge[:, 1] * arm[..., 0] >= 0).all(axis=1)
        nearest = np.where(inside, 0.0, nearest)
    return float(nearest.max())


def random_response(rng: np.random.Generator):
    """Return a monotone response with any kind, sign and range."""
    kind = rng.integers(4)
    slope = rng.uniform(0.002, 0.05)
    if kind == 0:
        return Response((0.0, slope))
    if kind == 1:
        coefficients = (0.0, slope, slope * rng.uniform(0, 1e-4), slope * rng.uniform(0, 1e-8))
        return Response(coefficients[: rng.integers(2, 5)], (0.0, float(rng.choice((255, 4095, 65535)))))
    if kind == 2:
        top = float(rng.integers(500, 5000))
        return Response((slope * top, -slope), (float(rng.integers(0, 100)), top))
    readings = np.sort(rng.choice(4096, rng.integers(2, 9), replace=False)).astype(float)
    forces = np.sort(rng.uniform(0, 60, len(readings)))
    forces[0] = 0.0
    return ResponseTable(tuple(readings.tolist()), tuple((forces[::-1] if rng.random() < 0.4 else forces).tolist()))


def random_calibration(rng: np.random.Generator, link: str) -> LinkCalibration:
    """Return a flat sole, a turned one, a sheet around a cylinder, or scattered cells with any neighbours."""
    responses = tuple(random_response(rng) for _ in range(rng.integers(1, 5)))
    kind = rng.integers(4)
    if kind == 2:
        calibration = small_calibration(int(rng.integers(2, 9)), int(rng.integers(2, 15)))
        patches, surfaces = calibration.patches, calibration.surfaces
    else:
        rows = tuple(int(k) for k in rng.integers(1, 9, rng.integers(1, 7)))
        patch, surfaces = sole_patch(rows, height=float(rng.uniform(-0.1, 0.1))), (plane(),)
        if kind == 1:
            q, _ = np.linalg.qr(rng.normal(size=(3, 3)))
            q *= np.sign(np.linalg.det(q))
            t = patch.taxels
            patch = cell_patch(t.positions_link @ q.T, t.normals_link @ q.T, t.corners_link @ q.T)
        if kind == 3:
            t, spread = patch.taxels, rng.uniform(0, 0.6)
            normals = t.normals_link + spread * rng.normal(size=t.normals_link.shape)
            normals /= np.linalg.norm(normals, axis=1)[:, None]
            moved = rng.normal(0, 0.01, t.positions_link.shape)
            patch = cell_patch(
                t.positions_link + moved, normals, t.corners_link + moved[:, None], radius=float(rng.uniform(0, 0.05))
            )
        patches = (patch,)
    chosen = []
    for patch in patches:
        n, taxels = len(patch.taxels.ids), patch.taxels
        if rng.random() < 0.7:
            taxels = replace(taxels, responses=rng.integers(0, len(responses), n))
        chosen.append(replace(patch, taxels=taxels))
    channels, start = rng.permutation(400), 0
    for k, patch in enumerate(chosen):
        n = len(patch.taxels.ids)
        chosen[k] = replace(patch, taxels=replace(patch.taxels, channels=channels[start : start + n]))
        start += n
    return small_calibration(
        link=link, patches=tuple(chosen), surfaces=surfaces, response=random_response(rng), responses=responses
    )


def random_options(rng: np.random.Generator) -> dict:
    """Return options for both runtimes."""
    options: dict = {}
    kind = rng.integers(6)
    if kind in (0, 1):
        options["switch_on"] = float(rng.uniform(0.05, 3))
    if kind in (1, 2):
        options["switch_off"] = float(rng.uniform(0.01, 0.05))
    if rng.random() < 0.3:
        options["in_cell"] = True
    if rng.random() < 0.2:
        options["follow_drift"] = False
    if rng.random() < 0.2:
        options["creep"] = [float(rng.uniform(0, 0.3)), float(rng.uniform(0.01, 1))]
    if rng.random() < 0.25:
        options["ground"] = {"point": rng.uniform(-0.1, 0.1, 3).tolist(), "up": [*rng.normal(0, 0.2, 2).tolist(), 1.0]}
    return options


class Pair:
    """One skin in both runtimes, with readings of any kind."""

    def __init__(self, rng: np.random.Generator, link: str = "link"):
        self.rng, self.options = rng, random_options(rng)
        calibration = random_calibration(rng, link)
        self.python = self._skin(calibration)
        self.noise, self.calibration = None, json.dumps(to_document(calibration)).encode()
        self.sigma = float(rng.choice((0.0, 0.4, 2.0, 8.0)))
        responses = self.python._readings.responses
        self.span = np.where(np.isfinite(responses.full), responses.full, 3000.0) - responses.rest
        if rng.random() < 0.8:
            self._tare(calibration)
        n = len(self.python.ids)
        self.is_calm, self.pace = rng.random() < 0.6, float(rng.choice((0.001, 0.004, 0.04, 0.1)))
        self.pressed, self.shift, self.growth = np.zeros(n), np.zeros(n), np.ones(n)
        self.held, self.is_swapped, self.last = np.zeros(n, bool), False, rest_counts(self.python)

    def _skin(self, calibration: LinkCalibration) -> Skin:
        """Return a skin that learns no noise by itself."""
        skin = skin_of(calibration, self.options)
        skin._rest = None
        return skin

    def _tare(self, calibration: LinkCalibration) -> None:
        rng = self.rng
        frames = int(rng.choice((5, 25, 250)))
        rows = rest_counts(self.python) + rng.normal(rng.normal(0, 3), self.sigma, (frames, self.python.reading_length))
        rows = np.rint(rows) if rng.random() < 0.7 else rows
        if rng.random() < 0.5:
            rows = np.maximum(rows, 0)
        if rng.random() < 0.3:
            rows[:, rng.integers(rows.shape[1])] = 7.0
        self.python.tare(rows, accept=True)
        noise, taught = self.python.noise, self.python
        self.python = self._skin(calibration)
        if noise is not None and noise.load_level < 1e-9 * np.abs(noise.free * noise.slopes).sum():
            return  # readings without noise: rounding decides what a load is
        with TemporaryDirectory() as folder:
            taught.save_noise(Path(folder) / "noise.json")
            self.noise = (Path(folder) / "noise.json").read_bytes()
            self.python.load_noise(Path(folder) / "noise.json")
        self.python._rest = None

    def cpp(self, module):
        """Return the skin in C++."""
        return module.Skin(self.calibration, self.noise, self.options)

    def readings(self, centre: np.ndarray) -> np.ndarray:
        """Return a reading with contacts, noise and faults."""
        rng, skin = self.rng, self.python
        if not self.is_calm or rng.random() < 0.02:
            self.pressed = self._pressed(centre)
        if self.is_calm and rng.random() < 0.02:
            self._begin_fault()
        counts, rest = rest_counts(skin), skin.channels
        noise = rng.normal(0, self.sigma, len(counts))
        noise[rest] *= self.growth
        counts[rest] += self.span * self.pressed + self.shift
        counts = counts + noise
        counts = np.rint(counts) if self.is_calm or rng.random() < 0.8 else counts
        if self.is_swapped:
            counts = np.clip(counts, 0, 65535).astype(np.uint16).byteswap().astype(float)
        counts[rest[self.held]] = self.last[rest[self.held]]
        self.last = counts.copy()
        for value in (np.nan, np.inf, -np.inf, 1e300, -1e300):
            if rng.random() < (0.002 if self.is_calm else 0.02):
                counts[rng.random(len(counts)) < rng.choice((0.02, 0.5))] = value
        return counts[: rng.integers(len(counts) + 1)] if rng.random() < 0.01 else counts

    def _begin_fault(self) -> None:
        """Begin or end a drift, noise that grew, taxels or a bus that send one number, or swapped bytes."""
        rng, n = self.rng, len(self.python.ids)
        some = rng.random(n) < rng.choice((0.05, 0.3, 1.1))
        kind = rng.integers(7)
        if kind in (0, 6):
            self.shift = self.shift + rng.normal(0, max(self.sigma, 0.5)) * rng.choice((0.5, 2.0)) * some
        if kind in (1, 2):
            self.growth = np.where(some, rng.choice((0.1, 4.0)), self.growth)
        if kind == 3:
            self.held = some
        if kind == 4:
            self.held, self.shift, self.growth = np.zeros(n, bool), np.zeros(n), np.ones(n)
        self.is_swapped = kind == 5 and rng.random() < 0.3

    def _pressed(self, centre: np.ndarray) -> np.ndarray:
        """Return pressures (n,) relative to the range: one or two contacts, all taxels, or none."""
        rng, skin = self.rng, self.python
        near = np.exp(-(((skin.positions - centre) ** 2).sum(axis=1)) / rng.uniform(0.005, 0.06) ** 2)
        kind = rng.integers(8)
        pressed = near * rng.choice((0.001, 0.01, 0.1, 1.2))
        if kind == 0:
            pressed = np.zeros(len(near))
        if kind == 1:
            pressed = np.full(len(near), rng.choice((0.0005, 0.002, 0.01, 0.2)))
        if kind == 2:
            pressed += (rng.random(len(near)) < 0.2) * rng.uniform(0, 0.3)
        return pressed

    def step(self) -> float:
        """Return the time to the next frame [s]."""
        if self.is_calm and self.rng.random() < 0.98:
            return self.pace
        steps = {0.001: 0.8, 0.004: 0.1, 0.1: 0.04, 0.0: 0.02, -0.01: 0.02, 2.0: 0.01, 70.0: 0.01}
        return float(self.rng.choice(list(steps), p=list(steps.values())))


def size_of(skin: Skin, frame: Frame, counts: np.ndarray) -> float:
    """Return the sum of the sizes of what the sums of a frame add [N].

    Weights, and the load that the noise may hide, depend on the sum of all readings without the mean at rest: the
    readings are much larger.
    """
    size, noise = float(np.abs(frame.pushes).sum()), skin.noise
    if noise is None:
        return size
    signed = noise.signed(counts[skin.channels])
    signed = np.where(np.abs(signed) < 1e100, signed, noise.free)
    of_readings = float(np.abs(signed * noise.slopes).sum())
    return size * (1.0 + of_readings / max(abs(float(noise.excess(signed))), 1e-9)) if size else of_readings


def is_tie(frame: Frame) -> bool:
    """Return whether rounding decides if too much of a frame is lost."""
    if frame.lost is None or frame.pushes is None:
        return False
    lost, limit = float(frame.lost.sum()), MAX_LOST_FRACTION * float(frame.pushes.sum())
    return lost > 0 and abs(lost - limit) < 1e-9 * lost


def compare_skin(module, comparison: Comparison, seed: int) -> int:
    """Compare some frames of one skin."""
    rng = np.random.default_rng(seed)
    pair = Pair(rng)
    try:
        cpp = pair.cpp(module)
    except ValueError as error:
        raise Difference(f"C++ refuses the skin: {error}") from error
    python, now, centre, counts = pair.python, 0.0, pair.python.positions[0], None
    frames = CALM_FRAMES if pair.is_calm else FRAMES
    for _ in range(frames):
        now += pair.step()
        centre = centre + rng.normal(0, 0.003, 3)
        if rng.random() < 0.2:
            centre = python.positions[rng.integers(len(python.ids))]
        counts = counts if counts is not None and rng.random() < 0.05 else pair.readings(centre)
        if rng.random() < 0.02:
            masked = [python.ids[k] for k in rng.integers(0, len(python.ids), rng.integers(0, 4))]
            python.mask(masked)
            cpp.mask(masked)
        at = now if rng.random() < 0.99 else float(rng.choice((np.nan, np.inf)))
        frame = python.update(counts, at)
        upward, cancels = 0.0 if frame.sums is None else float(frame.sums[9]), 1.0
        expected, found = record(frame), cpp.update(counts, at)
        if frame.sets is not None:
            size = size_of(python, frame, counts)
            cancels = size / expected["size"] if expected["size"] else 1.0
            expected["size"] = size
        if not is_tie(frame):
            comparison.frames(expected, found, upward, cancels)
    return frames


def compare_body(module, comparison: Comparison, seed: int) -> int:
    """Compare some frames of a body of two or three links."""
    rng = np.random.default_rng(seed)
    names = [f"link{k}" for k in range(rng.integers(2, 4))]
    pairs = {name: Pair(rng, name) for name in names}
    python = Body({name: pair.python for name, pair in pairs.items()})
    cpp = module.Body([(name, pair.calibration, pair.noise, pair.options) for name, pair in pairs.items()])
    now = 0.0
    for _ in range(FRAMES):
        now += pairs[names[0]].pace
        readings, poses = {}, {}
        for name, pair in pairs.items():
            if rng.random() < 0.97:
                readings[name] = pair.readings(pair.python.positions[rng.integers(len(pair.python.ids))])
            pose = np.eye(4)
            axis = rng.normal(size=3) * rng.choice((0.0, 0.02, 1.0))
            pose[:3, :3] = rotation(axis)
            pose[:3, 3] = rng.uniform(-1, 1, 3)
            if rng.random() < 0.03:
                pose[rng.integers(4), rng.integers(4)] += rng.choice((1e-3, 1.0, np.nan))
            if rng.random() < 0.97:
                poses[name] = pose
        frame = python.update(readings, now, poses)
        size = sum(float(np.abs(link.pushes).sum()) for link in frame.links.values() if link.pushes is not None)
        upward = float(frame.ground.wrench(frame._total(frame.standing))[2])
        found = cpp.update(readings, now, poses)
        if not any(map(is_tie, frame.links.values())):
            comparison.bodies(record_body(frame), found, max(size, 1e-9), upward)
    return FRAMES


def rotation(axis: np.ndarray) -> np.ndarray:
    """Return the matrix of a rotation vector (3,)."""
    angle = float(np.linalg.norm(axis))
    if not angle:
        return np.eye(3)
    x, y, z = axis / angle
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k


def main() -> None:
    """Compare as many frames as asked."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--frames", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=0, help="of the first skin")
    parser.add_argument("--module", type=Path, default=Path("build/python"), help="folder of the built module")
    given = parser.parse_args()
    sys.path.insert(0, str(given.module))
    import skin_calib_cpp

    comparison, done, seed, start = Comparison(skin_calib_cpp), 0, given.seed, time.time()
    while done < given.frames:
        compare = compare_body if seed % 8 == 7 else compare_skin
        try:
            done += compare(skin_calib_cpp, comparison, seed)
        except Difference as difference:
            sys.exit(f"skin {seed}: {difference}")
        seed += 1
    print(f"{done} frames of {seed - given.seed} skins and bodies in {time.time() - start:.0f} s, no difference")
    print("frames with:", ", ".join(f"{name} {count}" for name, count in sorted(comparison.counts.items())))
    print("largest differences:", ", ".join(f"{n} {x:.1e}" for n, x in sorted(comparison.largest.items())))


if __name__ == "__main__":
    main()
