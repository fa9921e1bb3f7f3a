"""The cases in which ``constants.py`` looks for effects of constants: their list, and those of fits and skins.

``constant_cases_files.py`` has the cases of files, ``constant_cases_runtime.py`` those of the runtime.

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
PREPARATIONS: list[Callable[[Path], None]] = []  # each writes inputs of some cases
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


def prepare(folder: Path) -> None:
    """Write meshes, calibrations, measurements and recordings that the cases read."""
    for preparation in PREPARATIONS:
        preparation(folder)


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


def warnings_in(text: str, folder: Path, name: str = "") -> Result:
    """Return the warnings and errors of a text with # for numbers, and their numbers."""
    lines = sorted(line for line in text.splitlines() if line.startswith(("skin-calib", "warning")))
    behind = f", {name}" if name else ""
    return {
        f"warnings{behind}": [re.sub(r"-?\d+(\.\d+)?(e-?\d+)?", "#", line) for line in lines],
        f"numbers of the warnings{behind}": numbers("\n".join(lines).replace(str(folder), "")),
    }


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
    result: Result = {"exit code": code} | warnings_in(messages, folder)
    return result | (contents(output) if output.exists() else {})


def several(folder: Path, plans: dict[str, dict[str, Any]]) -> Result:
    """Fit several plans and return their results under their names."""
    result: Result = {}
    for name, plan in plans.items():
        result |= {f"{key}, {name}": value for key, value in calibrated(folder, f"several_{name}", plan).items()}
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


def write_csv(path: Path, header: tuple[str, ...], rows: Array) -> None:
    """Write a table of numbers."""
    lines = [",".join(header), *(",".join(f"{x!r}" for x in row) for row in rows.tolist())]
    path.write_text("\n".join(lines) + "\n")


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


def ring(angle: Array, height: Array) -> Array:
    """A short wide tube: 80 mm wide, 25 mm long."""
    return np.column_stack((0.04 * np.cos(angle), 0.036 * np.sin(angle), 0.025 * height))


def slight_bend(angle: Array, height: Array) -> Array:
    """A tube along an arc of 30 degrees."""
    turn, radius = 0.5 * height, 0.24 + (0.02 + 0.003 * np.cos(3 * angle)) * np.cos(angle)
    return np.column_stack((radius * np.cos(turn), radius * np.sin(turn), 0.02 * np.sin(angle)))


def plate(angle: Array, height: Array) -> Array:
    """A tube with a flat section, 60 mm wide and 10 mm thick."""
    return np.column_stack((0.03 * np.cos(angle), 0.005 * np.sin(angle), 0.1 * height))


# Names, vertices around and along, noise of the vertices [m].
SCANS = (("scan", 160, 90, 0.0004), ("fine_scan", 220, 120, 0.0001), ("coarse_scan", 70, 36, 0.0008))
SIZES = (0.01, 0.03, 0.08, 20.0, 60.0)  # times the size of a forearm
# Names, taxels, height above the surface [m] and noise [m] of clouds in another frame.
CLOUDS = (
    ("moved", slice(None), 0.0, 0.0001),
    ("half", slice(0, 60), 0.002, 0.0003),
    ("rough", slice(None, None, 2), 0.006, 0.002),
)


@PREPARATIONS.append
def meshes(folder: Path) -> None:
    """Write the meshes."""
    rng = np.random.default_rng(0)
    tube(bent_tube, 60, 50).export(folder / "bent.ply")
    tube(square_tube, 144, 20).export(folder / "square.ply")
    tube(dome, 80, 24).export(folder / "dome.ply")
    hole = np.array((-0.036, 0.0, 0.06))
    open_tube = tube(round_tube, 60, 30, lambda centres: np.linalg.norm(centres - hole, axis=1) > 0.012)
    open_tube.export(folder / "open.ply")
    millimetres = tube(round_tube, 40, 10)
    millimetres.apply_scale(1e3)
    millimetres.export(folder / "millimetres.ply")
    turned = tube(round_tube, 60, 30)
    turned.faces[::20] = turned.faces[::20, ::-1]
    turned.export(folder / "turned.ply")
    steep = tube(round_tube, 60, 30)
    steep.vertices[100:160] = steep.vertices[40:100] + rng.normal(0, 10.0 ** np.linspace(-12, -5, 60)[:, None], (60, 3))
    steep.faces = np.vstack((steep.faces, steep.faces[:30]))
    steep.export(folder / "steep.ply")  # faces from flat to thin, and some twice
    for name, around, along, noise in SCANS:
        scan = tube(round_tube, around, along)
        scan.vertices += rng.normal(0, noise, scan.vertices.shape)
        scan.export(folder / f"{name}.ply")
    tube(round_tube, 12, 6).export(folder / "twelve_sides.ply")
    tube(ring, 72, 9).export(folder / "ring.ply")
    tube(slight_bend, 48, 40).export(folder / "slight_bend.ply")
    tube(plate, 48, 12).export(folder / "plate.ply")
    for factor in SIZES:
        scaled = tube(round_tube, 40, 10)
        scaled.apply_scale(factor)
        scaled.export(folder / f"size_{factor:g}.ply")
    wrist = folder / "wrist.calibration.json"
    command("fit", SAMPLES / "wrist.plan.json", "-o", wrist)
    taxels = json.loads(wrist.read_text())["patches"][0]["taxels"]
    positions, normals = np.array(taxels["position"]), np.array(taxels["normal"])
    write_csv(folder / "taxels.csv", ("x", "y", "z", "nx", "ny", "nz"), np.hstack((positions, normals)).round(4))
    turn = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1.0]])
    for name, chosen, height, noise in CLOUDS:
        cloud = (positions + height * normals)[chosen]
        cloud = (cloud + rng.normal(0, noise, cloud.shape)) @ turn.T + (0.02, -0.03, 0.05)
        write_csv(folder / f"{name}.csv", ("x", "y", "z"), cloud)


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


@case("noisy scan", only=("geometry/fit", "geometry/sampling", "common"))
def noisy_scan(folder: Path) -> Result:
    """Stiffness and sites for noise."""
    return calibrated(folder, "scan", {"mesh": "scan.ply", "grid": {"kind": "tube", "n": 8, "m": 8}, "skins": []})


@case("other scans", only=("geometry/fit", "geometry/sampling"))
def other_scans(folder: Path) -> Result:
    """A fine scan with little noise, and a coarse one with much."""
    grid = {"kind": "tube", "n": 8, "m": 6}
    plans = {name: {"mesh": f"{name}.ply", "grid": grid, "skins": []} for name in ("fine_scan", "coarse_scan")}
    return several(folder, plans)


@case("chords of coarse meshes", only=("geometry/fit", "geometry/mesh"))
def coarse_chords(folder: Path) -> Result:
    """Corners on the true surface: a tube with twelve sides, and a shape with steps, where chords would do harm."""
    grid = {"kind": "tube", "n": 6, "m": 6, "margin": 0.004}
    plans = {
        name: {"mesh": f"{name}.ply", "grid": grid, "chords": True, "skins": []} for name in ("twelve_sides", "square")
    }
    return several(folder, plans)


@case("automatic axes", only=("geometry/grid", "geometry/mesh", "geometry/sampling", "geometry/fit/fitting"))
def automatic_axes(folder: Path) -> Result:
    """A short wide ring, a flat section, a slight bend."""
    grid = {"kind": "tube", "n": 6, "m": 6}
    return several(
        folder, {name: {"mesh": f"{name}.ply", "grid": grid, "skins": []} for name in ("ring", "plate", "slight_bend")}
    )


@case("sizes of meshes", only=("geometry/mesh",))
def sizes(folder: Path) -> Result:
    """Meshes of 1 mm to 7 m."""
    grid = {"kind": "tube", "n": 5, "m": 5}
    return several(folder, {f"{x:g}": {"mesh": f"size_{x:g}.ply", "grid": grid, "skins": []} for x in SIZES})


@case("smallest nets, samples", only=("geometry/fit/auto", "geometry/fit/proof", "geometry/grid"))
def smallest_of_samples(folder: Path) -> Result:
    """Tight, loose and impossible tolerances; a patch between two angles."""
    wrist, edge = str(SAMPLES / "wrist.ply"), str(SAMPLES / "edge.ply")
    grids = {
        "tight": (wrist, {"tolerance": 2e-5}),
        "loose": (wrist, {"tolerance": 1e-3, "measure": "max"}),
        "impossible": ("square.ply", {"tolerance": 1e-8}),
        "steps": (edge, {"tolerance": 2e-4, "measure": "max"}),
        "sector": (wrist, {"tolerance": 5e-5, "from": -1.2, "to": 1.2}),
    }
    return several(
        folder,
        {name: {"mesh": mesh, "grid": {"kind": "auto", **size}, "skins": []} for name, (mesh, size) in grids.items()},
    )


@case("smallest nets, real links", real=True, only=("geometry/fit/auto", "geometry/fit/proof", "geometry/grid"))
def smallest_of_links(folder: Path) -> Result:
    """Four links of robots, two of them whole; on the last one errors decrease slowly with the size of the net."""
    axis = {"point": [-0.0016, -0.0027, -0.1908], "direction": [0.0174, -0.0167, 0.9997]}
    grids = {
        "hrp4c_r_wrist_y_cover_only": {"tolerance": 1e-4, "axis": axis, "margin": 0.007},
        "talos_arm_5_forearm_collision": {"tolerance": 4e-4},
        "g1_left_wrist_roll": {"tolerance": 1e-3, "axis": {"point": [0, 0, 0], "direction": [1, 0, 0]}},
    }
    plans = {
        name: {"mesh": str(SHARED / "meshes" / f"{name}.stl"), "grid": {"kind": "auto", **size}, "skins": []}
        for name, size in grids.items()
    }
    cuts = [{"point": [0, 0, z], "normal": [0, 0, side]} for z, side in ((0.045, 1), (0.165, -1))]
    axis = {"point": [0, 0.006, 0], "direction": [0, 0, 1]}
    plans["talos_arm_5_forearm"] = {
        "mesh": str(SHARED / "meshes" / "talos_arm_5_forearm.stl"),
        "cover": {"cuts": cuts},
        "grid": {"kind": "auto", "tolerance": 2e-4, "axis": axis, "margin": 0.008},
        "skins": [],
    }
    return several(folder, plans)


@case("best nets", only=("geometry/fit/auto", "geometry/grid"))
def best_nets(folder: Path) -> Result:
    """The best ratio of planes to lines for a number of control points."""
    from skin_calib_addon.geometry import fit_to_count, load_mesh

    fits = [fit_to_count(load_mesh(folder / f"{name}.ply"), n) for name, n in (("square", 80), ("slight_bend", 150))]
    errors = [fit.errors.surface_to_mesh for fit in fits]
    return {
        "error mean": np.array([error.mean for error in errors]),
        "error max": np.array([error.max for error in errors]),
        "planes": [fit.surface.control_net.shape[0] for fit in fits],
        "lines": [fit.surface.control_net.shape[1] for fit in fits],
    }


@case("aids of the window", only=("geometry/",))
def window_aids(folder: Path) -> Result:
    """Units, cuts, axes through two points, and the findings on meshes with defects."""
    from skin_calib_addon.geometry import load_mesh
    from skin_calib_addon.geometry.grid.axis import axis_through
    from skin_calib_addon.geometry.grid.cut_planes import cut_normal
    from skin_calib_addon.geometry.mesh.defects import diagnose
    from skin_calib_addon.geometry.mesh.units import likely_unit

    mesh = load_mesh(folder / "slight_bend.ply")
    tilts = np.deg2rad(np.arange(0, 15))
    ends = [(mesh.vertices[0], mesh.vertices[k]) for k in (200, 700, 1500)]
    axes = [axis_through(mesh, np.array(first), np.array(second)) for first, second in ends]
    findings = []
    for name in ("turned", "open", "steep", "dome"):
        found = trimesh.load(folder / f"{name}.ply", process=False)
        diagnosis = diagnose(found.vertices, found.faces)
        findings.append(f"{name}: {diagnosis.flat} {diagnosis.inward} {diagnosis.flipped.sum()} {diagnosis.hole.sum()}")
        findings += [str(finding) for finding in diagnosis.findings()]
    return {
        "units": [likely_unit(side) for side in np.geomspace(1e-3, 1e5, 120)],
        "cuts": np.array([cut_normal(mesh, mesh.vertices[0], np.array((np.sin(t), 0, np.cos(t)))) for t in tilts]),
        "axes": np.array([(*axis.point, *axis.direction) for axis in axes]),
        "findings": findings,
    }


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
    tube_grid = {"kind": "tube", "n": 6, "m": 5}
    big = {"name": "big", "kind": "sheet", "rows": 20, "columns": 40, "pitch": [0.01, 0.01]}
    big |= {"origin": "center", "direction": [0, 1, 0]}
    plans = {
        "unit": {"mesh": "millimetres.ply", "grid": tube_grid, "skins": []},
        "turned": {"mesh": "turned.ply", "grid": tube_grid, "skins": []},
        "margin": {"mesh": "square.ply", "grid": {**tube_grid, "margin": 0.049}, "skins": []},
        "sheet": {"mesh": "square.ply", "grid": tube_grid, "skins": [big]},
    }
    return several(folder, plans)


@case("dome, boards and a sheet", only=("skin",))
def on_a_dome(folder: Path) -> Result:
    """Boards that are too large for the curvature, and a sheet that is strained."""
    grid = {"kind": "patch", "n": 8, "lines": 8, "normal": [0, 0, 1], "margin": 0.004}
    boards = {
        "name": "boards",
        "kind": "hexagons",
        "side": 0.0163,
        "gap": 0.0,
        "cells": [[0, 0], [1, 0], [0, 1], [-1, 1]],
    }
    sheet = {"name": "sheet", "kind": "sheet", "rows": 7, "columns": 9, "pitch": [0.008, 0.008], "trim": True}
    skins = [boards, {**sheet, "origin": "center", "direction": [1, 0, 0]}]
    return calibrated(folder, "on_a_dome", {"mesh": "dome.ply", "grid": grid, "skins": skins})


@case("imported taxels")
def imported(folder: Path) -> Result:
    """A table of taxels on the wrist sample."""
    return calibrated(folder, "table", taxel_plan("taxels.csv"))


@case("taxels in another frame", only=("geometry/registration", "geometry/surface", "skin", "pipeline", "common"))
def in_another_frame(folder: Path) -> Result:
    """A table of taxels in another frame: the error proposes one."""
    return calibrated(folder, "moved", taxel_plan("moved.csv"))


@case("other clouds in another frame", only=("geometry/registration",))
def other_clouds(folder: Path) -> Result:
    """Half of the taxels, and few with noise under a thick cover."""
    return several(folder, {name: taxel_plan(f"{name}.csv") for name, *_ in CLOUDS[1:]})


def taxel_plan(file: str) -> dict[str, Any]:
    """Return the plan of the wrist sample with imported taxels."""
    plan = json.loads((SAMPLES / "wrist.plan.json").read_text()) | {"mesh": str(SAMPLES / "wrist.ply")}
    return plan | {"skins": [{"name": "table", "kind": "imported", "file": file}]}


@case("HRP-4C wrist, cuts", real=True)
def hrp4c_wrist(folder: Path) -> Result:
    """The link of the paper, from the plan of the examples."""
    return calibrated(folder, "hrp4c", ROOT / "examples" / "hrp4c_wrist.plan.json")


@case("TALOS forearm, boards", real=True, only=("skin/boards", "geometry/mesh"))
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
