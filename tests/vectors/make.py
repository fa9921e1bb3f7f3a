"""Write the golden vectors: files that the runtimes in Python and in C++ read, with the frames that both must give.

    python -m tests.vectors.make

`tests/unit/runtime/test_vectors.py` compares the runtime in Python with the files, `cpp/tests/vectors.cpp` that in C++.
Write them again only for an intended change of results.
"""

import json
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from skin_calib_addon.calibration import LinkCalibration, Response, ResponseTable
from skin_calib_addon.calibration.file import load_calibration, save_calibration
from skin_calib_addon.common.errors import InvalidReading
from skin_calib_addon.runtime import Body, BodyFrame, Frame, Plane, Skin
from skin_calib_addon.runtime.noise_file import FIELDS
from skin_calib_addon.runtime.trusted import STATEMENTS, Trusted
from tests.samples import plane, small_calibration
from tests.soles import cell_patch, sole_patch

FOLDER = Path(__file__).parent
SMALL = (3, 4, 3, 4, 3)  # boards in the rows of a small sole
RING = ((-1, -1), (1, -1), (1, 1), (-1, 1))  # corners of a square
TABLE = ResponseTable((0.0, 100.0, 1000.0, 4095.0), (0.0, 1.0, 8.0, 40.0))
FALLING = ResponseTable((200.0, 900.0, 2000.0, 3000.0), (30.0, 9.0, 2.0, 0.0))
QUADRATIC = Response((0.0, 0.005, 1e-6), (0.0, 4095.0))
REST_OFFSET = 100.0  # [counts] of the readings at rest of skins of which a fault lasts
INVERTED = Response((30.0, -0.01), (0.0, 3000.0))


def mixed_sole() -> LinkCalibration:
    """Return a sole with a response of each kind; readings of some taxels fall with the force."""
    patch = sole_patch(SMALL)
    kinds = (TABLE, FALLING, QUADRATIC, INVERTED)
    taxels = replace(patch.taxels, responses=np.arange(len(patch.taxels.ids)) % len(kinds))
    return small_calibration(
        link="mixed", patches=(replace(patch, taxels=taxels),), surfaces=(plane(),), response=TABLE, responses=kinds
    )


def curved_sole() -> LinkCalibration:
    """Return a sole whose rows rise at both ends as a rocker; its last rows cannot stand."""
    rows, columns, pitch, radius = 7, 4, 0.012, 0.035
    row, column = (a.ravel() for a in np.indices((rows, columns)))
    angle = (row - (rows - 1) / 2) * pitch / radius
    normals = np.column_stack((np.sin(angle), 0 * angle, -np.cos(angle)))
    along = np.column_stack((np.cos(angle), 0 * angle, np.sin(angle)))
    positions = radius * normals + np.column_stack((0 * angle, column * pitch, 0 * angle + 0.01))
    across = np.cross(normals, along)
    corners = positions[:, None] + pitch / 2 * np.stack([i * along + j * across for i, j in RING], axis=1)
    patch = cell_patch(positions, normals, corners, radius=0.0145)
    return small_calibration(link="rocker", patches=(patch,), surfaces=(plane(),), response=Response((0.0, 0.01, 1e-6)))


def sole(rows: tuple[int, ...], link: str, max_load: float | None = None) -> LinkCalibration:
    """Return a flat sole of hexagons with a linear response, and the largest plausible load [N] or None."""
    patch = replace(sole_patch(rows), max_load=max_load)
    return small_calibration(link=link, patches=(patch,), surfaces=(plane(),), response=Response((0.0, 0.02)))


def forearm() -> LinkCalibration:
    """Return a sheet around a cylinder and two boards; their readings have a parabola as response."""
    return small_calibration(5, 6, response=Response((0.0, 0.01, 1e-6), (0.0, 4095.0)))


CALIBRATIONS = {
    "sole": partial(sole, (8, 9, 8, 9, 8), "sole"),
    "small": partial(sole, SMALL, "left"),
    "right": partial(sole, (5, 4, 3, 2), "right", 120.0),
    "mixed": mixed_sole,
    "rocker": curved_sole,
    "forearm": forearm,
}


@dataclass(frozen=True)
class Case:
    """One skin, its options and its readings."""

    calibration: str
    options: dict
    sigma: float | None = None  # [counts] of the noise that the skin has learned; None: it knows no noise
    frames: int = 16
    trouble: bool = False  # whether readings and times are wrong now and then
    lost: bool = False  # whether some taxels lose their readings, and time jumps
    story: bool = False  # whether a fault lasts: see `story_of`; frames have 40 ms, and readings at rest are 100


CASES = {
    "thresholds": Case("sole", {"switch_on": 0.2, "switch_off": 0.1}, frames=8),
    "noise": Case("sole", {}, 2.0, frames=12),
    "clipped": Case("small", {}, 0.6),
    "in_cell": Case("small", {"in_cell": True}, 2.0),
    "creep": Case("small", {"creep": [0.1, 0.05]}, 2.0),
    "responses": Case("mixed", {"switch_on": 0.5}),
    "responses_noise": Case("mixed", {}, 2.0, trouble=True),
    "curved": Case("forearm", {"switch_off": 0.3}),
    "curved_noise": Case("forearm", {}, 1.5, trouble=True),
    "rocker": Case("rocker", {"ground": {"point": [0, 0, -0.025], "up": [0.1, 0, 1]}}, 2.0),
    "trouble": Case("small", {"switch_on": 0.2}, trouble=True, frames=24),
    "trouble_noise": Case("small", {}, 2.0, trouble=True, frames=24),
    "lost": Case("small", {}, 2.0, lost=True, frames=24),
    "lost_thresholds": Case("small", {"switch_on": 0.5}, lost=True),
    "overload": Case("right", {}, 2.0),
    "stated_and_noise": Case("small", {"switch_on": 1.0}, 2.0),
    "noise_unknown": Case("small", {}, frames=8),
    "drift": Case("small", {}, 2.0, frames=75, story=True),
    "drift_stays": Case("small", {"follow_drift": False}, 2.0, frames=75, story=True),
    "below_rest": Case("small", {"switch_on": 1.0}, 2.0, frames=30, story=True),
    "noisy": Case("small", {}, 2.0, frames=200, story=True),
    "stuck": Case("small", {}, 2.0, frames=85, story=True),
    "first_frames": Case("small", {}, frames=120, story=True),
}


def skin_of(calibration: LinkCalibration, options: dict) -> Skin:
    """Return a skin with the options of a file."""
    options = dict(options)
    if "ground" in options:
        options["ground"] = Plane.through(options["ground"]["point"], options["ground"]["up"])
    return Skin(calibration, **options)


def rest_counts(skin: Skin) -> np.ndarray:
    """Return readings without force (channels,)."""
    counts = np.zeros(skin.reading_length)
    counts[skin.channels] = skin._readings.responses.rest
    return counts


def loaded_counts(skin: Skin, pressed: np.ndarray) -> np.ndarray:
    """Return readings of pressed taxels (n,), for pressures from 0 to 1 of their range."""
    counts = rest_counts(skin)
    full = skin._readings.responses.full
    span = np.where(np.isfinite(full), full, 2000.0) - skin._readings.responses.rest
    counts[skin.channels] += span * pressed
    return counts


def readings_of(skin: Skin, case: Case, rng: np.random.Generator) -> Iterator[tuple[float, np.ndarray]]:
    """Yield times and readings: a contact that moves over the skin, then nothing, then a weak even load."""
    n, time = len(skin.ids), 0.0
    for k in range(case.frames):
        centre = skin.positions[(3 * k) % n]
        near = np.exp(-(((skin.positions - centre) ** 2).sum(axis=1)) / 0.02**2)
        pressed = {5: np.zeros(n), 6: np.full(n, 0.004), 7: np.full(n, 0.3)}.get(k % 8, 0.3 * near)
        counts = loaded_counts(skin, pressed) + rng.normal(0, case.sigma or 0.0, skin.reading_length)
        counts = np.clip(np.rint(counts), 0, 4095)
        time += 0.004
        if case.lost and k % 8 >= 3:
            counts[[2, 3, 7, 8] if k < 16 else slice(k - 12)] = np.nan
            time += 2.0 * (k == 5)
        if case.trouble:
            wrong = rng.integers(12)
            if wrong < 3:
                counts[rng.integers(len(counts))] = (np.nan, np.inf, 1e6)[wrong]
            time += {3: -1.0, 4: 2.0, 5: -0.004, 6: 0.1}.get(wrong, 0.0)
            if wrong == 7:
                counts = counts[:-1]
            if wrong == 8:
                counts[:] = np.nan
        yield (float("nan") if case.trouble and k == 13 else time), counts


def story_of(skin: Skin, name: str, case: Case, rng: np.random.Generator) -> Iterator[tuple[float, np.ndarray]]:
    """Yield times and readings of a skin of which a fault begins after some time, and lasts."""
    n, counts = len(skin.ids), np.zeros(0)
    stands = 0.2 * (skin.positions[:, 0] > skin.positions[:, 0].mean())
    for k in range(case.frames):
        time = 0.04 * k
        pressed, shift, noise = np.zeros(n), np.full(n, REST_OFFSET), rng.normal(0, 2.0, n)
        if name == "drift":  # a foot stands for a while, and again on a drift
            pressed = stands * (1 < time < 1.5 or time > 2.2)
            shift += 4 * (time > 0.3)
        if name == "drift_stays":  # a foot in the air drifts down, and comes back
            shift -= 3 * (0.5 < time < 2)
        if name == "below_rest":
            shift[3] -= 90 * (k == 3)
        if name == "noisy":  # three taxels get noisy, and one sends one number
            noise[:3] *= 1 + 1.5 * (time > 0.8)
            noise[7] *= time < 0.2
            pressed = stands * (time > 7.8)
        if name == "first_frames":  # a foot in the air, on the ground, and in the air again
            pressed, shift = stands * (1.8 < time < 2.2), np.zeros(n)
        if name == "stuck":  # one taxel under a foot, then a frozen bus, then the bytes are swapped
            pressed = stands * (time > 0.2)
            noise[-1] *= time < 0.4
        before, counts = counts, loaded_counts(skin, pressed)
        counts[skin.channels] += shift + noise
        counts = np.clip(np.rint(counts), 0, 4095)
        if name == "stuck" and 1.4 < time < 2:
            counts = before
        yield time, counts.astype(np.uint16).byteswap().astype(float) if name == "stuck" and time > 2.4 else counts


def record(frame: Frame) -> dict:
    """Return what both runtimes compute of a frame."""
    sets = frame.sets
    return {
        "flags": sorted(frame.flags),
        "trusted": statements(frame.trusted),
        "touched": frame.touched,
        "known": frame.known,
        "stuck": frame.stuck,
        "forces": frame.forces,
        "stands": None if sets is None else sets.stands,
        "active": frame.active,
        "sure": np.zeros(len(frame.forces), bool) if sets is None or sets.sure is None else sets.sure,
        "possible": np.zeros(len(frame.forces), bool) if sets is None else sets.possible,
        "contacts": [
            {
                "number": c.number,
                "taxels": c.taxels,
                "force": c.force,
                "wrench": c.wrench,
                "position": c.position,
                "normal": c.normal,
                "area": c.area,
                "peak_pressure": c.peak_pressure,
            }
            for c in frame.contacts
        ],
        "size": 0.0 if frame.pushes is None else float(np.abs(frame.pushes).sum()),  # [N] that rounding scales with
        "wrench": frame.wrench if frame.problem is None else None,
        "load": frame.load if frame.problem is None else None,
        "is_standing": frame.stands,
        "cop": frame.cop,
        "zmp": frame.zmp,
        "wrench_sigma": frame.wrench_sigma,
        "force_sigmas": frame.force_sigmas,
        "load_sigma": frame.load_sigma,
        "cop_sigma": frame.cop_sigma,
        "zmp_sigma": frame.zmp_sigma,
        **record_polygon(frame.polygon),
    }


def statements(trusted: Trusted) -> np.ndarray:
    """Return which statements hold."""
    return np.array([getattr(trusted, name) for name in STATEMENTS])


def record_polygon(polygon) -> dict:
    """Return the corners of three polygons, and their probabilities."""
    kinds = ("outer", "nominal", "guaranteed")
    return {
        **{kind: None if polygon is None else getattr(polygon, kind).corners for kind in kinds},
        "outer_probability": None if polygon is None else polygon.outer_probability,
        "guaranteed_probability": None if polygon is None else polygon.guaranteed_probability,
    }


def record_body(frame: BodyFrame) -> dict:
    """Return what both runtimes compute of the frame of a body."""
    return {
        "flags": sorted(frame.flags),
        "trusted": statements(frame.trusted),
        "lost": sorted(frame.lost),
        "standing": sorted(frame.standing),
        "wrench": frame.wrench,
        "cop": frame.cop,
        "zmp": frame.zmp,
        "cop_sigma": frame.cop_sigma,
        "zmp_sigma": frame.zmp_sigma,
        **record_polygon(frame.polygon),
    }


def compact(value):
    """Return a value for JSON: sets as text, lists of numbers, null for NaN, "inf" for infinite numbers."""
    if isinstance(value, dict):
        return {name: compact(x) for name, x in value.items()}
    if isinstance(value, np.ndarray) and value.dtype == bool:
        return "".join("01"[int(x)] for x in value)
    if isinstance(value, (list, tuple, np.ndarray)):
        return [compact(x) for x in value]
    if isinstance(value, np.generic):
        return compact(value.item())
    if isinstance(value, float) and not np.isfinite(value):
        return None if np.isnan(value) else str(value)
    return int(value) if isinstance(value, float) and value.is_integer() and abs(value) < 2**53 else value


def expanded(value) -> np.ndarray:
    """Return readings of a file as numbers."""
    return np.array([np.nan if x is None else float(x) for x in value])


def write_noise(skin: Skin, sigma: float, rng: np.random.Generator, path: Path, offset: float = 0.0) -> None:
    """Write what a skin learns from 250 frames without contact, with an offset of the readings."""
    rows = offset + rest_counts(skin) + rng.normal(0, sigma, (250, skin.reading_length))
    skin.tare(np.clip(np.rint(rows), 0, 4095).astype(np.uint16), accept=True)
    skin.save_noise(path)


def write_case(name: str, case: Case) -> None:
    """Write the noise, the readings and the frames of a case."""
    rng = np.random.default_rng(len(name))
    calibration = load_calibration(FOLDER / f"{case.calibration}.calibration.json")
    skin, noise = skin_of(calibration, case.options), None
    if case.sigma is not None:
        noise = f"{name}.noise.json"
        write_noise(skin, case.sigma, rng, FOLDER / noise, REST_OFFSET * case.story)
        skin.load_noise(FOLDER / noise)  # as the runtimes that read it
    frames = []
    lines = story_of(skin, name, case, rng) if case.story else readings_of(skin, case, rng)
    for k, (time, readings) in enumerate(lines):
        frame = {"time": time, "readings": readings}
        if case.trouble and k in (10, 18):
            frame["mask"] = [skin.ids[2], skin.ids[5]] if k == 10 else []
            skin.mask(frame["mask"])
        frames.append(compact({**frame, "frame": record(skin.update(readings, time))}))
    learns = noise is None and skin.noise is not None
    head = {"learns": True} if learns else {}
    head |= {"calibration": f"{case.calibration}.calibration.json", "noise": noise, "options": case.options}
    write(name, head, frames)


def write(name: str, head: dict, frames: list, of: str = "frames") -> None:
    """Write a case: one line for its head, and one for each frame."""
    lines = ",\n".join(json.dumps(frame, separators=(",", ":")) for frame in frames)
    (FOLDER / (f"{name}.case.json" if of == "frames" else f"{name}.json")).write_text(
        json.dumps(head)[:-1] + f', "{of}": [\n' + lines + "\n]}\n"
    )


def write_body() -> None:
    """Write two feet that stand, walk, and lose readings and poses."""
    rng = np.random.default_rng(1)
    names = {"left": "small", "right": "right"}
    calibrations = {name: load_calibration(FOLDER / f"{file}.calibration.json") for name, file in names.items()}
    skins, links = {}, []
    for name, calibration in calibrations.items():
        skins[name] = skin_of(calibration, {})
        write_noise(skins[name], 2.0, rng, FOLDER / f"body_{name}.noise.json")
        links.append(
            {"name": name, "calibration": f"{names[name]}.calibration.json", "noise": f"body_{name}.noise.json"}
        )
    body, frames = Body(skins), []
    for k in range(24):
        readings, poses = {}, {}
        for side, (name, skin) in enumerate(skins.items()):
            load = (0.3 + 0.002 * k) * ((k // 4 + side) % 3 > 0)
            pressed = load * (1 + 4 * skin.positions[:, 0] * np.cos(k))
            counts = loaded_counts(skin, pressed) + rng.normal(0, 2.0, skin.reading_length)
            readings[name] = np.clip(np.rint(counts), 0, 4095)
            pose = np.eye(4)
            angle = 0.1 * k * (side + 1)
            pose[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
            pose[:3, 3] = 0.05 * k, 0.1 - 0.2 * side, 0.02 * (k == 17) * side
            poses[name] = pose
        if k == 5:
            del readings["left"]
        if k == 6:
            del poses["right"]
        if k == 7:
            poses["left"][0, 0] *= 1.01
        if k == 8:
            readings["right"][:] = np.nan
        if k == 18:
            tilt = 0.1
            poses["left"][:3, :3] = [[np.cos(tilt), 0, np.sin(tilt)], [0, 1, 0], [-np.sin(tilt), 0, np.cos(tilt)]]
        if k == 11:
            poses["left"][1, 3] = np.nan
        time = 0.004 * (k + 1)
        frame = record_body(body.update(readings, time, poses))
        frames.append(compact({"time": time, "readings": readings, "poses": poses, "frame": frame}))
    write("body", {"links": links}, frames)


TARES = {  # frames, offset, noise [counts], type of the numbers, and whether warnings are accepted
    "quiet": (40, 0.0, 2.0, "uint16", False),
    "few": (5, 0.0, 0.0, "uint16", False),
    "loaded": (40, 100.0, 2.0, "uint16", False),
    "loaded_accepted": (40, 100.0, 2.0, "uint16", True),
    "touched": (40, 100.0, 2.0, "uint16", True),
    "aligned": (40, 0.0, 2.0, "uint16", False),
    "real": (40, 3.0, 1.0, "float64", True),
}


def write_tares() -> None:
    """Write readings for a tare, and what a skin learns from them, or why it refuses them."""
    rng, lines = np.random.default_rng(3), []
    calibration = load_calibration(FOLDER / "mixed.calibration.json")
    for name, (frames, offset, sigma, kind, accept) in TARES.items():
        skin = skin_of(calibration, {})
        rows = rest_counts(skin) + rng.normal(offset, sigma, (frames, skin.reading_length))
        if name == "touched":
            rows[20:, 3] -= 900
        rows = np.maximum(rows, 0)
        rows = 16 * np.rint(rows / 16) if name == "aligned" else np.round(rows, 0 if kind == "uint16" else 2)
        lines.append(
            compact({"name": name, "type": kind, "accept": accept, "readings": rows, **tared(skin, rows, kind, accept)})
        )
    write("mixed.tare", {"calibration": "mixed.calibration.json"}, lines, "tares")


def tared(skin: Skin, rows: np.ndarray, kind: str, accept: bool) -> dict:
    """Return what a skin learns from readings (frames, channels) at rest, or the first words of its refusal."""
    try:
        tare = skin.tare(rows.astype(kind), accept)
    except InvalidReading as error:
        return {"refused": str(error).split(". ")[0]}
    noise = None if tare.noise is None else {name: getattr(tare.noise, name) for name in FIELDS}
    return {"forces": tare.forces, "warnings": tare.warnings, "baseline": skin._readings.baseline, "noise": noise}


def main() -> None:
    """Write all files."""
    for name, make in CALIBRATIONS.items():
        save_calibration(make(), FOLDER / f"{name}.calibration.json")
    for name, case in CASES.items():
        write_case(name, case)
    write_body()
    write_tares()


if __name__ == "__main__":
    main()
