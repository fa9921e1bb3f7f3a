"""Cases of ``constants.py``: recordings, two feet, shapes of polygons."""

import json
from pathlib import Path

import numpy as np
from constant_cases import PREPARATIONS, ROOT, SHARED, Array, Result, case, command, warnings_in


@PREPARATIONS.append
def recordings(folder: Path) -> None:
    """Write the calibrations and recordings of simulated skins."""
    from skin_calib_addon.calibration import load_calibration

    surfaces = load_calibration(folder / "wrist.calibration.json").surfaces
    if SHARED.is_dir():
        for name in ("foot_flat", "foot_beam12", "forearm_single"):
            recording(folder, name, surfaces)


def recording(folder: Path, name: str, surfaces: tuple) -> None:
    """Write the calibration of a simulated skin, and a recording of it; the runtime does not read its surface."""
    from skin_calib_addon.calibration import LinkCalibration, MeshSource, Patch, Response, TaxelArray, save_calibration

    data = np.load(SHARED / "truth" / f"{name}.npz")
    arm = name.startswith("forearm")
    layout = json.loads((SHARED / "truth" / f"layout_{'forearm' if arm else 'left_sole'}.json").read_text())["taxels"]
    positions, normals, corners = (np.array([t[key] for t in layout]) for key in ("position", "normal", "corners"))
    corners = corners[:, ::-1]  # counter-clockwise seen from outside
    normals = normals if arm else -normals  # the sole's normals point into the robot
    apart = np.linalg.norm(positions[:, None] - positions, axis=2)
    ids = tuple(f"t{i}" for i in range(len(positions)))
    near = [np.flatnonzero((row > 0) & (row < (0.0115 if arm else 0.0285))) for row in apart]
    across = np.cross(normals, np.where(np.abs(normals[:, 1:2]) > 0.9, (1.0, 0, 0), (0, 1.0, 0)))
    turns = np.cross(corners[:, 1:-1] - corners[:, :1], corners[:, 2:] - corners[:, :1]).sum(axis=1)
    taxels = TaxelArray(
        ids,
        np.arange(len(ids)),
        np.column_stack((np.zeros(len(ids), int), np.arange(len(ids)))),
        np.zeros((len(ids), 2)),
        positions,
        normals,
        across / np.linalg.norm(across, axis=1)[:, None],
        corners,
        np.linalg.norm(turns, axis=1) / 2,
        tuple(tuple(ids[j] for j in row) for row in near),
    )
    patch = Patch(name, "imported", surfaces[0].name, (1, len(ids)), (0.01, 0.01), taxels)
    response = Response((0.0, 0.05)) if arm else Response((0.0, float(data["lsb12"])))
    mesh = MeshSource(f"{name}.stl", "0" * 64, 0, 0)
    save_calibration(LinkCalibration(name, mesh, surfaces, (patch,), response), folder / f"{name}.calibration.json")
    readings = data["raw_u8" if arm else "raw_u12"][::4]
    np.savez(folder / f"{name}.npz", time=0.01 * np.arange(len(readings)), readings=readings)


def replayed(folder: Path, calibration: Path, readings: Path, *words: str) -> Result:
    """Replay a recording and return its contacts, CoP and polygons."""
    output = folder / "replayed.jsonl"
    output.unlink(missing_ok=True)
    code, messages = command("replay", calibration, readings, "-o", output, *words)
    frames = [json.loads(line) for line in output.read_text().splitlines()] if output.exists() else []
    contacts = [contact for frame in frames for contact in frame["contacts"]]
    polygons = [np.array(corners) for frame in frames for corners in frame["polygon"].values()]
    return {
        "exit code": code,
        **warnings_in(messages, folder),
        "flags": [flag for frame in frames for flag in frame["flags"]],
        "reasons": [str(frame["reason"]) for frame in frames],
        "contacts": len(contacts),
        "forces": np.array([contact["force"] for contact in contacts]),
        "peak pressures": np.array([contact["peak_pressure"] for contact in contacts]),
        "contact positions": np.array([contact["position"] for contact in contacts]),
        "wrenches": np.array([frame["wrench"] or [np.nan] * 6 for frame in frames]),
        "CoP": np.array([frame["cop"] or [np.nan] * 2 for frame in frames]),
        "ZMP": np.array([frame["zmp"] or [np.nan] * 2 for frame in frames]),
        "areas": np.array([area(corners) for corners in polygons]),
    }


def area(corners: Array) -> float:
    """Area of a polygon [m^2]."""
    if len(corners) < 3:
        return 0.0
    x, y = (corners - corners[0]).T
    return float(x[1:-1] @ y[2:] - x[2:] @ y[1:-1]) / 2


@case("recording of the wrist sample")
def wrist_recording(folder: Path) -> Result:
    """The recording of the examples, with its first frames as rest."""
    recorded = ROOT / "examples" / "wrist_recording.csv"
    return replayed(folder, folder / "wrist.calibration.json", recorded, "--tare", "2")


@case("simulated foot on flat ground", real=True)
def foot_flat(folder: Path) -> Result:
    """A sole with 42 boards."""
    return replayed(folder, folder / "foot_flat.calibration.json", folder / "foot_flat.npz")


@case("simulated foot on a beam", real=True)
def foot_beam(folder: Path) -> Result:
    """A sole in partial contact."""
    return replayed(folder, folder / "foot_beam12.calibration.json", folder / "foot_beam12.npz", "--on", "1.5")


@case("simulated forearm", real=True)
def forearm(folder: Path) -> Result:
    """Contacts on a curved skin, with offsets taken off by the first frames."""
    return replayed(folder, folder / "forearm_single.calibration.json", folder / "forearm_single.npz", "--tare", "5")


@case("small loads, and all taxels pressed", real=True)
def loads(folder: Path) -> Result:
    """A sole under 0.3 to 300 N, a forearm that is pressed from all sides, and readings beyond all sensors."""
    from skin_calib_addon.runtime import load

    sole, arm = load(folder / "foot_flat.calibration.json"), load(folder / "forearm_single.calibration.json")
    recorded = np.load(folder / "foot_flat.npz")["readings"][10].astype(float)
    frames = [sole.update(recorded * factor, 0.01 * k) for k, factor in enumerate(np.geomspace(1e-3, 1, 40))]
    pressed = np.full(132, 40.0)
    frames += [arm.update(pressed, 0.01), arm.update(pressed * (np.arange(132) % 22 < 11), 0.02)]
    for k, reading in enumerate(np.geomspace(1e5, 1e10, 30)):
        high = pressed.copy()
        high[7] = reading
        frames.append(arm.update(high, 0.03 + 0.01 * k))
    return {
        "flags": [str(sorted(frame.flags)) for frame in frames],
        "reasons": [str(frame.reason) for frame in frames],
        "contacts": [len(frame.contacts) for frame in frames],
        "CoP": np.array([(np.nan, np.nan) if frame.cop is None else frame.cop for frame in frames]),
        "normals": np.array([contact.normal for frame in frames for contact in frame.contacts]),
        "peak pressures": np.array([contact.peak_pressure for frame in frames for contact in frame.contacts]),
        "areas": np.array([frame.polygon.nominal.area for frame in frames]),
    }


@case("two feet", real=True)
def two_feet(folder: Path) -> Result:
    """Two soles on flat ground, one a little higher and inclined, with readings that stop, jump and get stuck."""
    from skin_calib_addon.runtime import Body, load

    recorded = np.load(folder / "foot_flat.npz")["readings"]
    body = Body({side: load(folder / "foot_flat.calibration.json") for side in ("left", "right")})
    frames = []
    for k in range(60):
        pose, other = np.eye(4), np.eye(4)
        pose[:3, 3], other[:3, 3] = (0.0, 0.1, 0.0), (0.05, -0.1, 2e-4 * k)
        tilt = 0.0015 * k
        other[:3, :3] = [[np.cos(tilt), 0, np.sin(tilt)], [0, 1, 0], [-np.sin(tilt), 0, np.cos(tilt)]]
        readings = {"left": recorded[k], "right": recorded[-1 - (k if k < 30 else 30)].copy()}
        if k in (10, 11):
            readings["right"] = readings["right"][:-1]
        time = 0.02 * k + (k > 20) * 0.03 + (k > 40) * 1.2 + (k > 50) * 40
        frames.append(body.update(readings, time, {"left": pose, "right": other}))
    return {
        "flags": [str(sorted(frame.flags)) for frame in frames],
        "reasons": [str(frame.reason) for frame in frames],
        "standing": [len(frame.standing) for frame in frames],
        "CoP": np.array([(np.nan, np.nan) if frame.cop is None else frame.cop for frame in frames]),
        "ZMP": np.array([(np.nan, np.nan) if frame.zmp is None else frame.zmp for frame in frames]),
        "areas": np.array([frame.polygon.nominal.area for frame in frames]),
        "observable": body.observable.tolist(),
    }


@case("polygons")
def polygons(folder: Path) -> Result:
    """Round and thin polygons, and the polygon inside one of them."""
    from skin_calib_addon.runtime import convex_hull

    rng, areas, margins = np.random.default_rng(3), [], []
    for count in (3, 4, 6, 12, 40):
        for stretch in (1.0, 1e-3, 1e-8):
            polygon = convex_hull(rng.normal(size=(count, 2)) * (0.1, 0.1 * stretch))
            areas += [polygon.area, polygon.inset(0.002).area]
            margins.append(polygon.margin((0.01, 0.0)))
    return {"areas": np.array(areas), "margins": np.array(margins)}
