"""The cases in which ``constants.py`` looks for effects of constants: fits, skins, imports, touches, recordings.

Each case runs commands of ``skin-calib``, or public functions, in a folder with prepared inputs. It returns a
dictionary: whole numbers (counts), arrays (errors, positions, outputs) and texts (warnings, without their numbers).
Cases on real links need ``../shared/data`` next to the project and are left out where that is absent.
"""

import contextlib
import io
import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

ROOT = Path(__file__).resolve().parent.parent
SHARED = ROOT.parent / "shared" / "data"
SAMPLES = ROOT / "sample_scenes"
Array = np.ndarray
Result = dict[str, Any]
CASES: dict[str, Callable[[Path], Result]] = {}
NEEDS_DATA: set[str] = set()
MEANT_FOR: dict[str, tuple[str, ...]] = {}


def case(name: str, real: bool = False, only: tuple[str, ...] = ("",)) -> Callable:
    """Add a function to the cases.

    Parameters
    ----------
    name : str
        As the table prints it.
    real : bool
        Whether it reads ``../shared/data``.
    only : tuple of str
        Beginnings of the files whose constants it is run for, where it takes long and others cover the rest.
    """

    def added(function: Callable[[Path], Result]) -> Callable[[Path], Result]:
        CASES[name], MEANT_FOR[name] = function, only
        if real:
            NEEDS_DATA.add(name)
        return function

    return added


def is_present(name: str) -> bool:
    """Whether the data of a case is there."""
    return name not in NEEDS_DATA or SHARED.is_dir()


def is_meant_for(name: str, file: str) -> bool:
    """Whether a case is run for the constants of a file, a path within the package."""
    return file.startswith(MEANT_FOR[name])


def load_package() -> None:
    """Load what the cases use, so that no case is timed with it."""
    import skin_calib_addon.cli
    import skin_calib_addon.runtime  # noqa: F401


# Commands, and what they print and write


def command(*words: str | Path) -> tuple[int, str]:
    """Run ``skin-calib`` in this process and return its exit code and its messages."""
    from skin_calib_addon.cli import main

    messages = io.StringIO()
    with contextlib.redirect_stdout(messages), contextlib.redirect_stderr(messages):
        code = main([str(word) for word in words])
    return code, messages.getvalue()


def without_numbers(text: str) -> list[str]:
    """Return the warnings and errors of a text, sorted, with # for numbers."""
    lines = [line for line in text.splitlines() if line.startswith(("skin-calib", "warning"))]
    return sorted(re.sub(r"-?\d+(\.\d+)?(e-?\d+)?", "#", line) for line in lines)


def numbers(text: str) -> Array:
    """Return the numbers of a text."""
    return np.array([float(word) for word in re.findall(r"-?\d+(?:\.\d+)?(?:e-?\d+)?", text)])


def calibrated(folder: Path, name: str, plan: dict[str, Any] | Path) -> Result:
    """Fit a plan and return errors, control points, taxels, positions and warnings of its calibration."""
    if isinstance(plan, dict):
        path = folder / f"{name}.plan.json"
        path.write_text(json.dumps({"format": "skin-plan", "version": 1, "link": name, "unit": "m", **plan}))
    else:
        path = plan
    output = folder / f"{name}.calibration.json"
    output.unlink(missing_ok=True)
    code, messages = command("fit", path, "-o", output)
    result: Result = {"exit code": code, "warnings": without_numbers(messages)}
    if output.exists():
        result |= contents(output)
    elif code == 1:
        result["numbers of the error"] = numbers(messages.replace(str(folder), ""))
    return result


def contents(path: Path) -> Result:
    """Return what a calibration file contains."""
    document = json.loads(path.read_text())
    surface = document["surfaces"][0]
    errors = surface["errors"]
    result: Result = {
        "error mean": np.array([errors["surface_to_mesh"]["mean"]]),
        "error max": np.array([errors["hausdorff"]]),
        "control points": int(np.prod(np.shape(surface["control_net"])[:2])),
    }
    for patch in document["patches"]:
        taxels, name = patch["taxels"], patch["name"]
        result[f"taxels of {name}"] = len(taxels["id"])
        for key in ("position", "corners"):
            result[f"positions [mm] of {name}, {key}"] = 1e3 * np.array(taxels[key])
        result[f"normals of {name}"] = np.array(taxels["normal"])
        result[f"neighbours of {name}"] = [len(ids) for ids in taxels["neighbours"]]
        for key in ("strain", "gap", "tilt", "collision", "overhang", "pitch_error"):
            if key in taxels:
                result[f"{key} of {name}"] = np.array(taxels[key], float)
    return result


# Meshes from formulas


def tube(
    point: Callable[[Array, Array], Array], around: int, along: int, keep: Callable[[Array], Array] | None = None
) -> trimesh.Trimesh:
    """Return a tube: ``point(angle, height)`` for angles all round and heights from 0 to 1."""
    height, angle = (x.ravel() for x in np.meshgrid(np.linspace(0, 1, along), np.arange(around), indexing="ij"))
    a = np.arange((along - 1) * around)
    b = a // around * around + (a + 1) % around
    faces = np.concatenate((np.column_stack((a, b, b + around)), np.column_stack((a, b + around, a + around))))
    mesh = trimesh.Trimesh(point(2 * np.pi * angle / around, height), faces, process=False)
    if keep is not None:
        mesh.update_faces(keep(mesh.triangles_center))
        mesh.remove_unreferenced_vertices()
    return mesh


def round_tube(angle: Array, height: Array) -> Array:
    """A tapered tube about z, 0.12 m long."""
    radius = 0.042 - 0.012 * height
    return np.column_stack((radius * np.cos(angle), radius * np.sin(angle), 0.12 * height))


def bent_tube(angle: Array, height: Array) -> Array:
    """A tube of 25 mm radius along an arc of 100 degrees."""
    turn, radius = 1.75 * height, 0.12 + 0.025 * np.cos(angle)
    return np.column_stack((radius * np.cos(turn), radius * np.sin(turn), 0.025 * np.sin(angle)))


def square_tube(angle: Array, height: Array) -> Array:
    """A tube about z with a rounded square as section."""
    radius = 0.03 / (np.cos(angle) ** 8 + np.sin(angle) ** 8) ** 0.125
    return np.column_stack((radius * np.cos(angle), radius * np.sin(angle), 0.1 * height))


def dome(angle: Array, height: Array) -> Array:
    """A dome over the plane z = 0, 0.1 m wide, with faces down to its rim."""
    radius = 0.055 * (1 - 0.99 * height)
    return np.column_stack((radius * np.cos(angle), 0.8 * radius * np.sin(angle), 0.03 - 10 * radius**2))


def prepare(folder: Path) -> None:
    """Write meshes, calibrations, measurements and recordings that the cases read."""
    from skin_calib_addon.calibration import load_calibration

    rng = np.random.default_rng(0)
    tube(bent_tube, 60, 50).export(folder / "bent.ply")
    tube(square_tube, 144, 20).export(folder / "square.ply")
    tube(dome, 80, 24).export(folder / "dome.ply")
    hole = np.array((-0.036, 0.0, 0.06))
    open_tube = tube(round_tube, 60, 30, lambda centres: np.linalg.norm(centres - hole, axis=1) > 0.012)
    open_tube.export(folder / "open.ply")
    scan = tube(round_tube, 160, 90)
    scan.vertices += rng.normal(0, 0.0004, scan.vertices.shape)
    scan.export(folder / "scan.ply")
    millimetres = tube(round_tube, 40, 10)
    millimetres.apply_scale(1e3)
    millimetres.export(folder / "millimetres.ply")
    turned = tube(round_tube, 60, 30)
    turned.faces[::20] = turned.faces[::20, ::-1]
    turned.export(folder / "turned.ply")

    wrist = folder / "wrist.calibration.json"
    command("fit", SAMPLES / "wrist.plan.json", "-o", wrist)
    perturbed(wrist, folder / "perturbed.calibration.json", rng)
    taxels = load_calibration(wrist).patches[0].taxels
    rows = np.column_stack((taxels.positions_link, taxels.normals_link))
    rows += rng.normal(0, 1e-4, rows.shape)
    write_csv(folder / "taxels.csv", ("x", "y", "z", "nx", "ny", "nz"), rows)
    turn = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1.0]])
    moved = rows[:, :3] @ turn.T + (0.02, -0.03, 0.05)
    write_csv(folder / "moved.csv", ("x", "y", "z"), moved)
    forces = rng.uniform(0, 15, 400)
    exact = 255 * (1 - (1 - np.minimum(forces, 20) / 20) ** 3)
    readings = np.clip(np.rint(exact + rng.normal(0, 1.5, 400) + 3 * (np.arange(400) % 2)), 0, 240)
    write_csv(folder / "measurements.csv", ("reading", "force"), np.column_stack((readings, forces)))
    some = np.column_stack((np.rint(np.linspace(0, 200, 24)), np.linspace(0, 6, 24) ** 1.3))
    write_csv(folder / "few.csv", ("reading", "force"), some[[0, 1, 2, 3, 5, 9, 15, 23]])
    for name in ("foot_flat", "foot_beam12", "forearm_single"):
        if SHARED.is_dir():
            recording(folder, name, load_calibration(wrist).surfaces)


def write_csv(path: Path, header: tuple[str, ...], rows: Array) -> None:
    """Write a table of numbers."""
    lines = [",".join(header), *(",".join(f"{x!r}" for x in row) for row in rows.tolist())]
    path.write_text("\n".join(lines) + "\n")


def perturbed(source: Path, target: Path, rng: np.random.Generator) -> None:
    """Write a calibration whose numbers are wrong by amounts of all sizes, from 1e-12 to 1 of them."""
    document = json.loads(source.read_text())
    taxels = document["patches"][0]["taxels"]
    for key in ("normal", "tangent", "area", "position", "corners"):
        values = np.array(taxels[key], float)
        factors = 1 + 10.0 ** rng.uniform(-12, 0.5, len(values))
        taxels[key] = (values * factors.reshape(-1, *[1] * (values.ndim - 1))).tolist()
    target.write_text(json.dumps(document))


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


# Surfaces and skins


@case("wrist sample, sheet")
def wrist_sample(folder: Path) -> Result:
    """The first sample, from its plan."""
    return calibrated(folder, "wrist_sample", SAMPLES / "wrist.plan.json")


@case("edge sample, landmarks")
def edge_sample(folder: Path) -> Result:
    """The second sample; its sheet is pinned to three points and trimmed."""
    plan = json.loads((SAMPLES / "edge.plan.json").read_text())
    sheet = {key: value for key, value in plan["skins"][0].items() if key != "origin"}
    points = [(0.0078, -0.0332, 0.025), (0.0341, 0.0, 0.027), (0.0078, -0.0332, 0.065)]
    cells = [(0, 0), (0, 5), (4, 0)]
    sheet["landmarks"] = [{"cell": cell, "point": point} for cell, point in zip(cells, points)]
    plan |= {"mesh": str(SAMPLES / "edge.ply"), "skins": [{**sheet, "trim": True}]}
    return calibrated(folder, "edge_sample", plan)


@case("sole sample, boards", only=("skin", "common", "plan", "pipeline"))
def sole_sample(folder: Path) -> Result:
    """The third sample, filled with boards around a screw."""
    plan = json.loads((SAMPLES / "sole.plan.json").read_text())
    boards = {"name": "boards", "kind": "hexagons", "side": 0.0163, "gap": 0.0}
    plan |= {"mesh": str(SAMPLES / "sole.ply")}
    plan["skins"] = [{**boards, "excluded": [{"point": [0.04, 0.0, 0.0], "radius": 0.005}]}]
    return calibrated(folder, "sole_sample", plan)


@case("bent tube, boards")
def bent(folder: Path) -> Result:
    """A bent axis; all boards that fit from the middle."""
    skin = {"name": "boards", "kind": "hexagons", "side": 0.008, "gap": 0.0005, "cells": "all"}
    return calibrated(folder, "bent", {"mesh": "bent.ply", "grid": {"kind": "tube", "n": 9, "m": 6}, "skins": [skin]})


@case("rounded square, hand-placed planes")
def hand_placed(folder: Path) -> Result:
    """Planes that fan out, and a sheet above the surface."""
    tilts = np.linspace(-0.15, 0.15, 7)
    u = [
        {"point": [0, 0, 0.015 + 0.07 * i / 6], "normal": [0, np.sin(tilt), np.cos(tilt)]}
        for i, tilt in enumerate(tilts)
    ]
    angles = np.arange(8) * np.pi / 8
    v = [{"point": [0, 0, 0], "normal": [-np.sin(angle), np.cos(angle), 0]} for angle in angles]
    sheet = {"name": "sheet", "kind": "sheet", "rows": 4, "columns": 9, "pitch": [0.01, 0.01], "offset": 0.0005}
    sheet |= {"origin": "center", "direction": [0, 1, 0]}
    grid = {"kind": "planes", "u": u, "v": v, "closed": True}
    return calibrated(folder, "square", {"mesh": "square.ply", "grid": grid, "skins": [sheet]})


@case("noisy scan")
def noisy_scan(folder: Path) -> Result:
    """Stiffness and sites for noise."""
    return calibrated(folder, "scan", {"mesh": "scan.ply", "grid": {"kind": "tube", "n": 8, "m": 8}, "skins": []})


@case("tube with a hole, chords")
def with_hole(folder: Path) -> Result:
    """A mesh whose corners lie on the true surface, with a hole under the sheet."""
    grid = {"kind": "tube", "n": 8, "m": 6, "axis": {"point": [0, 0, 0], "direction": [0, 0, 1]}, "margin": 0.003}
    sheet = {"name": "sheet", "kind": "sheet", "rows": 5, "columns": 30, "pitch": [0.008, 0.008]}
    sheet |= {"origin": "center", "direction": [0, 1, 0], "trim": True}
    return calibrated(folder, "open", {"mesh": "open.ply", "chords": True, "grid": grid, "skins": [sheet]})


@case("dome, smallest patch")
def smallest_patch(folder: Path) -> Result:
    """The smallest open net for a largest error, across a face."""
    grid = {"kind": "auto", "tolerance": 1e-4, "measure": "max", "normal": [0, 0, 1]}
    return calibrated(folder, "dome", {"mesh": "dome.ply", "grid": grid, "skins": []})


@case("square tube, smallest net")
def smallest_tube(folder: Path) -> Result:
    """The smallest closed net for a mean error."""
    return calibrated(
        folder, "smallest", {"mesh": "square.ply", "grid": {"kind": "auto", "tolerance": 3e-5}, "skins": []}
    )


@case("meshes with errors")
def with_errors(folder: Path) -> Result:
    """Wrong unit, faces turned inwards, a sheet that does not fit."""
    result: Result = {}
    tube_grid = {"kind": "tube", "n": 6, "m": 5}
    big = {"name": "big", "kind": "sheet", "rows": 20, "columns": 40, "pitch": [0.01, 0.01]}
    big |= {"origin": "center", "direction": [0, 1, 0]}
    plans = {
        "unit": {"mesh": "millimetres.ply", "grid": tube_grid, "skins": []},
        "turned": {"mesh": "turned.ply", "grid": tube_grid, "skins": []},
        "margin": {"mesh": "square.ply", "grid": {**tube_grid, "margin": 0.049}, "skins": []},
        "sheet": {"mesh": "square.ply", "grid": tube_grid, "skins": [big]},
    }
    for name, plan in plans.items():
        result |= {f"{key}, {name}": value for key, value in calibrated(folder, f"bad_{name}", plan).items()}
    return result


@case("imported taxels")
def imported(folder: Path) -> Result:
    """A table of taxels on the wrist sample."""
    return calibrated(folder, "table", taxel_plan("taxels.csv"))


@case("taxels in another frame", only=("geometry/registration", "geometry/surface", "skin", "pipeline", "common"))
def in_another_frame(folder: Path) -> Result:
    """A table of taxels in another frame: the error proposes one."""
    return calibrated(folder, "moved", taxel_plan("moved.csv"))


def taxel_plan(file: str) -> dict[str, Any]:
    """Return the plan of the wrist sample with imported taxels."""
    plan = json.loads((SAMPLES / "wrist.plan.json").read_text()) | {"mesh": str(SAMPLES / "wrist.ply")}
    return plan | {"skins": [{"name": "table", "kind": "imported", "file": file}]}


@case("HRP-4C wrist, cuts", real=True)
def hrp4c_wrist(folder: Path) -> Result:
    """The link of the paper, from the plan of the examples."""
    return calibrated(folder, "hrp4c", ROOT / "examples" / "hrp4c_wrist.plan.json")


@case("TALOS forearm, boards", real=True, only=("skin", "geometry/mesh"))
def talos_forearm(folder: Path) -> Result:
    """A link with steps between two cuts, filled with boards between two angles."""
    cuts = [{"point": [0, 0, 0.045], "normal": [0, 0, 1]}, {"point": [0, 0, 0.165], "normal": [0, 0, -1]}]
    grid = {"kind": "patch", "n": 8, "lines": 10, "axis": {"point": [0, 0.006, 0], "direction": [0, 0, 1]}}
    grid |= {"margin": 0.008, "from": -1.5, "to": 1.5}
    mesh = str(SHARED / "meshes" / "talos_arm_5_forearm_collision.stl")
    skin = {"name": "boards", "kind": "hexagons", "side": 0.0163, "gap": 0.0}
    return calibrated(folder, "talos", {"mesh": mesh, "cover": {"cuts": cuts}, "grid": grid, "skins": [skin]})


@case("iCub thigh, its taxels", real=True)
def icub_thigh(folder: Path) -> Result:
    """A whole ugly link between two angles with the taxels that it has."""
    grid = {"kind": "patch", "n": 12, "lines": 24, "axis": {"point": [0.006, 0.001, 0], "direction": [0, 0, 1]}}
    grid |= {"margin": 0.001, "from": float(np.deg2rad(-242)), "to": float(np.deg2rad(78))}
    skin = {"name": "thigh", "kind": "imported", "file": str(SHARED / "taxels" / "raw" / "icub_left_leg_upper.txt")}
    mesh = str(SHARED / "meshes" / "icub27_l_upper_leg.stl")
    cuts = [{"point": [0, 0, -0.118], "normal": [0, 0, 1]}]
    return calibrated(folder, "thigh", {"mesh": mesh, "cover": {"cuts": cuts}, "grid": grid, "skins": [skin]})


@case("JVRC-1 forearm, smallest net", real=True)
def jvrc_forearm(folder: Path) -> Result:
    """A coarse link as a whole: axis, span and net found automatically."""
    mesh = str(SHARED / "meshes" / "jvrc1_r_elbow_p.stl")
    return calibrated(folder, "jvrc", {"mesh": mesh, "grid": {"kind": "auto", "tolerance": 5e-4}, "skins": []})


# Touches, responses, checks, other formats


@case("touches", only=("skin", "validation", "pipeline", "common"))
def touches(folder: Path) -> Result:
    """Measured touches compared with the wrist sample, and the plan refined by them."""
    output = folder / "refined.plan.json"
    output.unlink(missing_ok=True)
    files = SAMPLES / "wrist.plan.json", ROOT / "examples" / "wrist_touches.csv"
    code, messages = command("touches", *files, "--refine", "-o", output)
    return {
        "exit code": code,
        "warnings": without_numbers(messages),
        "numbers": numbers(messages.replace(str(folder), "")),
        "plan": numbers(output.read_text()) if output.exists() else np.zeros(0),
    }


@case("responses")
def responses(folder: Path) -> Result:
    """Responses fitted to measurements with noise, saturation and hysteresis, and to few measurements."""
    result: Result = {}
    for name in ("measurements", "few"):
        output = folder / f"{name}.response.json"
        output.unlink(missing_ok=True)
        code, messages = command("response", folder / "wrist.calibration.json", folder / f"{name}.csv", "-o", output)
        result |= {f"exit code, {name}": code, f"warnings, {name}": without_numbers(messages)}
        if output.exists():
            response = json.dumps(json.loads(output.read_text())["response"])
            result |= {f"kind, {name}": re.sub(r"[\d.e-]+", "#", response)[:40], f"response, {name}": numbers(response)}
    return result


@case("checks")
def checks(folder: Path) -> Result:
    """Findings in a calibration with errors of all sizes."""
    code, messages = command("check", folder / "perturbed.calibration.json")
    return {"exit code": code, "findings": re.sub(r"-?\d+(\.\d+)?(e-?\d+)?", "#", messages), "all": numbers(messages)}


@case("other formats")
def other_formats(folder: Path) -> Result:
    """The wrist sample in each format, and read again."""
    from skin_calib_addon.calibration.exchange.formats import FORMATS

    result: Result = {}
    for name, form in FORMATS.items():
        path, back = folder / f"exported_{name}{form.ending}", folder / "read_again.csv"
        back.unlink(missing_ok=True)
        path.unlink(missing_ok=True)
        code, _ = command("export", folder / "wrist.calibration.json", "--to", name, "-o", path)
        is_text = path.exists() and form.ending != ".npz"
        text = path.read_bytes().decode("utf-8", "replace") if is_text else ""
        result |= {f"exit code, {name}": code, f"size, {name}": len(text), f"text, {name}": text}
        if form.readable and path.exists():
            code, messages = command("import", path, "--from", name, "-o", back)
            result |= {f"exit code, from {name}": code, f"messages, from {name}": without_numbers(messages)}
            result[f"text, from {name}"] = back.read_text() if back.exists() else ""
    return result


@case("recorded taxel files", real=True)
def recorded_files(folder: Path) -> Result:
    """Files of taxels that other programs wrote."""
    result: Result = {}
    for path in (SHARED / "taxels" / "raw" / "tum_patch2.xml", SHARED / "taxels" / "raw" / "icub_left_leg_upper.txt"):
        back = folder / "raw.csv"
        back.unlink(missing_ok=True)
        code, messages = command("import", path, "-o", back)
        result |= {f"exit code, {path.stem}": code, f"messages, {path.stem}": without_numbers(messages)}
        result[f"text, {path.stem}"] = back.read_text() if back.exists() else ""
    return result


# The runtime


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
        "warnings": without_numbers(messages),
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


@case("balance")
def balance(folder: Path) -> Result:
    """Shapes in and round polygons, cones of wrenches, fractions of a foothold."""
    from skin_calib_addon.runtime import convex_hull
    from skin_calib_addon.runtime.balance import cone, foothold, inscribed, walking

    rng, areas, margins = np.random.default_rng(3), [], []
    for count in (3, 4, 6, 12, 40):
        for stretch in (1.0, 1e-3, 1e-8):
            polygon = convex_hull(rng.normal(size=(count, 2)) * (0.1, 0.1 * stretch))
            names = "smallest_rectangle smallest_parallelogram largest_triangle largest_box largest_parallelogram"
            shapes = [getattr(inscribed, name)(polygon) for name in names.split()]
            areas.append([np.nan if shape is None else shape.area for shape in shapes])
            rows = cone.wrench_cone(polygon, 0.6)
            margins.append(np.nan if rows is None else cone.margin(rows, (1, 2, 30, 0.1, 0.2, 0.05)))
            shares = foothold.foothold_fractions(polygon, 0.002, polygon.inset(0.002), 0.03)
            margins += [polygon.margin((0.01, 0.0)), *(float(x) for x in vars(shares).values())]
    frequency = np.array([walking.pendulum_frequency(0.8)])
    return {"areas": np.array(areas), "margins": np.array(margins), "pendulum frequency": frequency}
