"""The command line: exit codes, files, and one line for each error."""

import json
import os
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from skin_calib_addon.calibration import Response, ResponseTable, load_calibration, save_calibration, to_document
from skin_calib_addon.cli import main
from skin_calib_addon.common.warnings import Warning
from skin_calib_addon.geometry.mesh.triangle_mesh import TriangleMesh, save_mesh
from skin_calib_addon.pictures import calibration as calibration_picture
from skin_calib_addon.plan import load_plan
from skin_calib_addon.robot.link_mesh import load_plan_mesh
from tests.examples import slow
from tests.samples import cylinder as surface_tube
from tests.samples import plane, small_calibration
from tests.shapes import RADIUS, cylinder

ROOT = Path(__file__).parents[3]
ENVIRONMENT = os.environ | {"OPENBLAS_NUM_THREADS": "1", "PYTHONPATH": str(ROOT)}
AXIS = {"point": [0, 0, 0], "direction": [0, 0, 1]}
TUBE = {"kind": "tube", "n": 6, "lines": 12, "axis": AXIS, "margin": 0.003, "spacing": "uniform"}
SHEET = {"kind": "sheet", "rows": 2, "columns": 4, "pitch": [0.01, 0.01], "origin": "center", "direction": [0, 1, 0]}
PLAN = {
    "format": "skin-plan",
    "version": 1,
    "link": "tube",
    "mesh": "tube.ply",
    "unit": "m",
    "grid": TUBE,
    "skins": [SHEET | {"name": "tube"}],
}


def planes(stations):
    """A grid of planes across z."""
    u = [{"point": [0, 0, z], "normal": [0, 0, 1]} for z in stations]
    angles = np.arange(5) * np.pi / 5
    v = [{"point": [0, 0, 0], "normal": [float(np.cos(a)), float(np.sin(a)), 0]} for a in angles]
    return {"kind": "planes", "u": u, "v": v, "closed": True}


@pytest.fixture(scope="session")
def fitted_once(tmp_path_factory):
    """Such a folder, fitted into itself."""
    folder = tmp_path_factory.mktemp("tube")
    save_mesh(cylinder(around=24, along=8), folder / "tube.ply")
    assert main(["fit", str(write_plan(folder)), "-o", str(folder)]) == 0
    return folder


@pytest.fixture
def fitted(fitted_once, tmp_path, capsys):
    """A copy of it: its record is relative, so that it is up to date."""
    capsys.readouterr()
    return Path(shutil.copytree(fitted_once, tmp_path, dirs_exist_ok=True))


def write_plan(folder, name="tube", **changes):
    """Write a plan file, and return its path."""
    path = folder / f"{name}.plan.json"
    path.write_text(json.dumps(PLAN | changes))
    return path


def run(*words):
    """Run a command in a new process, and return code, output and errors."""
    done = subprocess.run(
        [sys.executable, "-m", "skin_calib_addon", *map(str, words)], capture_output=True, text=True, env=ENVIRONMENT
    )
    return done.returncode, done.stdout, done.stderr


def assert_refused(capsys, code, message, *words):
    """Check exit code, one line on stderr with the message, and empty stdout."""
    assert main([str(word) for word in words]) == code
    out, err = capsys.readouterr()
    assert out == "" and err.startswith("skin-calib: ") and err.endswith("\n") and err.count("\n") == 1
    assert message in err


def test_fit_writes_a_calibration(folder, capsys):
    """Code 0, nothing on stderr, ten lines on stdout, and a valid file."""
    out = folder / "out.json"
    assert main(["fit", str(folder / "tube.plan.json"), "-o", str(out)]) == 0
    text, err = capsys.readouterr()
    assert err == "" and len(text.splitlines()) == 11 and "uncertainty 1" in text
    assert text.splitlines()[0] == "link             tube" and text.splitlines()[-1] == f"calibration      {out}"
    calibration = load_calibration(out)
    assert calibration.link == "tube" and len(calibration.patches[0].taxels.ids) == 8
    assert not list(folder.glob(".*"))  # no temporary file stays


def test_fit_copies_the_data_of_the_plan(folder):
    """The calibration has response, free members, degree, names, channels and origin of the plan, and the mesh."""
    response = {"kind": "polynomial", "coefficients": [0.0, 0.5, 0.25]}
    skins = [SHEET | {"name": "a", "first_channel": 7}, SHEET | {"name": "b", "origin": [RADIUS, 0, 0.03]}]
    plan = write_plan(folder, response=response, x_note={"by": "us"}, degree=[4, 3], skins=skins)
    assert main(["fit", str(plan), "-o", str(folder / "out.json")]) == 0
    calibration = load_calibration(folder / "out.json")
    assert calibration.response.coefficients == (0.0, 0.5, 0.25) and calibration.extra == {"x_note": {"by": "us"}}
    assert calibration.surfaces[0].degree == (4, 3) and calibration.surfaces[0].closed == (False, True)
    assert [(p.name, p.taxels.channels.tolist()) for p in calibration.patches] == [
        ("a", list(range(7, 15))),
        ("b", list(range(15, 23))),
    ]
    assert np.linalg.norm(calibration.patches[1].taxels.positions_link[0] - (RADIUS, 0, 0.03)) < 5e-4
    mesh = cylinder(around=24, along=8)
    assert (calibration.mesh.file, calibration.mesh.sha256) == ("tube.ply", mesh.sha256)
    assert (calibration.mesh.vertices, calibration.mesh.faces) == (len(mesh.vertices), len(mesh.faces))


def test_fit_writes_report_and_picture(folder, capsys, monkeypatch):
    """Both are written if requested; the summary has the same numbers, in millimetres."""
    monkeypatch.setattr(calibration_picture, "QUAD_COUNTS", (6, 12))
    words = ("--picture", folder / "p.png", "--report", folder / "r.json")
    assert main([*map(str, ("fit", folder / "tube.plan.json", "-o", folder / "out.json", *words))]) == 0
    assert (folder / "p.png").read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
    report = json.loads((folder / "r.json").read_text())
    errors = load_calibration(folder / "out.json").surfaces[0].errors
    assert report["errors"]["hausdorff"] == errors.hausdorff
    assert report["errors"]["surface_to_mesh"]["mean"] == errors.surface_to_mesh.mean
    assert (report["link"], report["control_points"], report["taxels"], report["missing"]) == ("tube", 72, 8, 0.0)
    assert set(report["seconds"]) == {"load", "cut", "fit", "wrap", "errors"}
    out = capsys.readouterr().out
    assert f"Hausdorff        {errors.hausdorff * 1e3:.4f} mm" in out
    assert " mm (parallel faces at any distance)\n" in out[out.index("mesh to surface  mean ") :]
    there = errors.surface_to_mesh
    assert f"mean {there.mean * 1e3:.4f}, rms {there.rms * 1e3:.4f}, max {there.max * 1e3:.4f} mm" in out


@pytest.mark.parametrize("jobs", ["1", slow("2")])
def test_fit_takes_many_plans_into_a_folder(folder, jobs, capsys):
    """Files have the names of the plans; an invalid plan affects only its own file, and the exit code."""
    (folder / "out").mkdir()
    names = ("a", "b", "c")
    paths = [write_plan(folder, name, **({"mesh": "none.ply"} if name == "b" else {})) for name in names]
    words = ["fit", *map(str, paths), "-o", str(folder / "out"), "--report", str(folder / "out"), "--jobs", jobs]
    assert main(words) == 1
    out, err = capsys.readouterr()
    assert sorted(p.name for p in (folder / "out").iterdir()) == [
        *("a.calibration.json", "a.report.json", "a.sources.json"),
        *("c.calibration.json", "c.report.json", "c.sources.json"),
    ]
    assert (folder / "out" / "a.calibration.json").read_bytes() == (folder / "out" / "c.calibration.json").read_bytes()
    assert (
        err.count("\n") == 1
        and err.startswith("skin-calib: b: There is no mesh file at ")
        and len(out.splitlines()) == 4
    )


BAD_PLANS = {  # of each stage one
    "metres as millimetres": ({"unit": "mm"}, 'Set "unit" to that of its numbers: "m" (122.1 mm)'),
    "plane misses": (
        {"grid": planes([0.01, 0.03, 0.05, 0.07, 0.3])},
        "u-plane 4, through (0.0, 0.0, 300.0) mm, does not intersect",
    ),
    "unknown key": ({"grip": 1}, '/grip is not a known member; did you mean "grid"?'),
    "cell off": ({"skins": [SHEET | {"name": "a", "rows": 30}]}, "cell (0, 0) lies"),
    "mesh is none": ({"mesh": "bad.stl"}, "bad.stl"),
    "mesh name of two lines": ({"mesh": "a\nb.ply"}, "no mesh file at"),
    "mesh name too long": ({"mesh": "a" * 5000 + ".ply"}, "no mesh file at"),
}


@pytest.mark.parametrize("case", BAD_PLANS)
def test_bad_plan_is_refused(folder, capsys, case):
    """Each error of a plan: code 1, one line with error and location, no file."""
    changes, message = BAD_PLANS[case]
    (folder / "bad.stl").write_bytes(b"\x00\x01garbage")
    plan, before = write_plan(folder, **changes), sorted(folder.iterdir())
    words = ("--picture", folder / "p.png", "--report", folder / "r.json")
    assert_refused(capsys, 1, message, "fit", plan, "-o", folder / "out.json", *words)
    assert sorted(folder.iterdir()) == before


@pytest.mark.slow
def test_fit_in_a_new_process_makes_the_same_bytes_and_refuses_in_one_line(folder):
    """A new process would show warnings of NumPy."""
    plan, outs = folder / "tube.plan.json", [folder / f"{k}.json" for k in range(3)]
    for out in outs[:2]:
        assert main(["fit", str(plan), "-o", str(out)]) == 0
    code, _, err = run("fit", plan, "-o", outs[2])
    assert (code, err) == (0, "")
    assert outs[0].read_bytes() == outs[1].read_bytes() == outs[2].read_bytes()
    changes, message = BAD_PLANS["plane misses"]
    code, out, err = run("fit", write_plan(folder, **changes), "-o", folder / "none.json")
    assert code == 1 and out == "" and err.count("\n") == 1 and message in err and not (folder / "none.json").exists()


@pytest.mark.parametrize(
    ("option", "target"),
    [("-o", "none/x.png"), ("--report", "none/x.png"), ("-o", "x" * 5000 + ".png")],
)
def test_missing_folder_is_reported_before_the_fit(folder, capsys, option, target):
    """Code 2 for each file; an invalid name is one line, too."""
    words = {"-o": folder / "out.json", option: folder / target}
    missing = f"the folder {folder / 'none'} for x.png does not exist. Create it first."
    message = missing if target == "none/x.png" else "cannot write"
    assert_refused(capsys, 2, message, "fit", folder / "tube.plan.json", *(w for pair in words.items() for w in pair))
    assert not (folder / "none").exists()


@pytest.mark.parametrize("option", ["-o", "--picture"])
def test_many_plans_need_a_folder(folder, capsys, option):
    """One file cannot take two calibrations, pictures or reports."""
    (folder / "out").mkdir()
    words = {"-o": folder / "out", option: folder / "one.file"}
    plans = write_plan(folder, "a"), write_plan(folder, "b")
    message = f"{folder / 'one.file'} is not a folder; 2 links need one"
    assert_refused(capsys, 2, message, "fit", *plans, *(w for pair in words.items() for w in pair))
    assert not list((folder / "out").iterdir()) and not (folder / "one.file").exists()


def test_one_plan_of_a_folder_gets_a_folder(folder):
    """A folder as input is a set of links, also if there is one; so is a name that ends with a slash."""
    plan = write_plan(folder)
    assert main(["fit", str(folder), "-o", str(folder / "out"), "--report", str(folder / "reports")]) == 0
    names = {"robot.json", "tube.sources.json", "tube.calibration.json"}
    assert {path.name for path in (folder / "out").iterdir()} == names
    assert [path.name for path in (folder / "reports").iterdir()] == ["tube.report.json"]
    assert main(["fit", str(plan), "-o", f"{folder / 'again'}/"]) == 0
    assert (folder / "again/tube.calibration.json").is_file()


def test_propose_reads_centimetres(tmp_path):
    """The plan keeps the unit of the mesh; its mesh has the size of the tube in metres."""
    tube = cylinder(around=24, along=8)
    save_mesh(TriangleMesh(tube.vertices * 100, tube.faces), tmp_path / "tube.ply")
    words = ["--unit", "cm", "--skin", "sheet:2x3x10mm", "-o", str(tmp_path)]
    assert main(["propose", str(tmp_path / "tube.ply"), *words]) == 0
    plan = load_plan(tmp_path / "tube.plan.json")
    assert plan.unit == "cm" and load_plan_mesh(plan).size == pytest.approx(tube.size)


@pytest.mark.parametrize("option", ["--only", "--except", "--skin", "--unit"])
def test_options_of_proposals_need_propose(folder, capsys, option):
    """A link that the call leaves out would be fitted."""
    value = {"--skin": "hexagons:8mm", "--unit": "mm"}.get(option, "tube")
    with pytest.raises(SystemExit) as stop:
        main(["fit", str(write_plan(folder)), "-o", str(folder / "out.json"), option, value])
    assert stop.value.code == 2 and f"{option} needs --propose" in capsys.readouterr().err
    assert not (folder / "out.json").exists()


@pytest.mark.parametrize(
    "call",
    ["fit {} -o {empty}", "fit {empty} -o out.json", "propose {} -o {empty}", "show {empty}", "export {} -o {empty}"],
)
def test_empty_name_is_no_folder(folder, capsys, monkeypatch, call):
    """A variable that is not set would make the current folder input or output."""
    plan = write_plan(folder)
    monkeypatch.chdir(folder)
    before = sorted(folder.iterdir())
    with pytest.raises(SystemExit) as stop:
        main([{"{}": str(plan), "{empty}": ""}.get(word, word) for word in call.split()])
    assert stop.value.code == 2 and "the name is empty" in capsys.readouterr().err
    assert sorted(folder.iterdir()) == before


def test_file_is_no_folder(folder, capsys):
    """A name with a slash at the end replaces no file, and is no name of a file where a command writes one."""
    plan, file = write_plan(folder), folder / "file"
    file.write_text("old")
    for call in ((plan, "-o", f"{file}/"), (folder, "-o", file)):
        assert_refused(capsys, 2, f"{file} is not a folder; this call needs one", "fit", *call)
    assert file.read_text() == "old"
    with pytest.raises(SystemExit) as stop:
        main(["touches", str(plan), "t.csv", "--refine", "-o", f"{folder}/new/"])
    assert stop.value.code == 2 and "ends with a slash, which means a folder. Name a file" in capsys.readouterr().err


def test_plans_of_one_name_are_refused(folder, capsys):
    """Both would write the same file."""
    (folder / "out").mkdir()
    (folder / "other").mkdir()
    plans = write_plan(folder, "a"), write_plan(folder / "other", "a")
    assert_refused(capsys, 2, "Two plans have the name 'a'. Rename one of them.", "fit", *plans, "-o", folder / "out")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ((), "the following arguments are required: COMMAND"),
        (("fat",), "invalid choice: 'fat'"),
        (("fit", "-o", "x"), "the following arguments are required: PLAN"),
        (("fit", "p.json"), "the following arguments are required: -o/--output"),
        (("fit", "p.json", "-o", "x", "--jobs", "0"), "'0' is not an integer of at least 1"),
        (("fit", "p.json", "-o", "x", "--job\ns", "0"), "unrecognized arguments: --job s"),
        (("check",), "the following arguments are required: FILE"),
    ],
)
def test_wrong_call_is_one_line(capsys, words, message):
    """Code 2, what is wrong, and where the help is."""
    assert_wrong_call(capsys, words, message)


def assert_wrong_call(capsys, words, message):
    with pytest.raises(SystemExit) as caught:
        main(list(words))
    out, err = capsys.readouterr()
    assert caught.value.code == 2 and out == "" and err.count("\n") == 1 and message in err and "--help" in err


def test_check_accepts_valid_files(fitted, capsys):
    """A plan and the calibration made from it: code 0, no findings."""
    notes = f"; 8 taxels on tube; mesh {fitted / 'tube.ply'} is unchanged"
    for path, more in ((fitted / "tube.plan.json", ""), (fitted / "tube.calibration.json", notes)):
        assert main(["check", str(path)]) == 0
        assert capsys.readouterr() == (f"{path}: 0 errors, 0 warnings{more}\n", "")


def test_check_names_every_finding_with_its_pointer(folder, capsys):
    """One line for each finding, then their number; code 1."""
    plan = write_plan(folder, grid=TUBE | {"n": 0}, unit="inch")
    assert main(["check", str(plan)]) == 1
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[1] for line in lines[:-1]] == ["/unit", "/grid/n"] and lines[
        -1
    ] == f"{plan}: 2 errors, 0 warnings"


def test_check_gives_findings_as_data(fitted, folder, capsys):
    """The same as in words, also of a file that cannot be read; the exit code says whether one is an error."""
    plan = write_plan(folder, "wrong", unit="ft")
    words = ["check", str(fitted / "tube.calibration.json"), str(plan), str(folder / "lost.json")]
    assert main(words) == main([*words, "--json"]) == 1
    text = capsys.readouterr().out
    valid, wrong, lost = json.loads(text[text.index("[\n") :])
    assert valid["findings"] == [] and "taxels on" in valid["notes"][0]
    assert [(f["code"], f["severity"], f["pointer"]) for f in wrong["findings"]] == [("value", "error", "/unit")]
    assert lost["findings"][0]["code"] == "unreadable" and lost["file"].endswith("lost.json")


@pytest.mark.parametrize("command", ["check", "show"])
def test_missing_or_broken_file_is_one_line(folder, capsys, command):
    """A missing path and an empty folder: code 1."""
    (folder / "empty").mkdir()
    assert_refused(capsys, 1, "No such file", command, folder / "none.json")
    assert_refused(capsys, 1, "it is a folder", command, folder / "empty")


def test_show_refuses_a_plan(fitted, capsys):
    """The error names the format of the file and what to do; the same for a calibration as a plan."""
    plan, made, notes = (fitted / f"tube.{kind}.json" for kind in ("plan", "calibration", "sources"))
    assert_refused(capsys, 1, f"'{plan}' has one error: /format must be", "show", plan)
    assert_refused(capsys, 1, "the file is a plan. Fit it, and use the resulting calibration.", "show", plan)
    assert_refused(capsys, 1, "the file is a calibration. Use the plan", "fit", made, "-o", fitted / "c.json")
    assert_refused(capsys, 1, "the file is the record of the sources of a calibration", "show", notes)


def test_missing_package_of_authors_is_one_line(fitted):
    """A controller has NumPy only: it can check its calibration, and other commands state what to install."""
    code = "import sys; sys.modules['scipy'] = None; from skin_calib_addon.cli import main; sys.exit(main())"

    def without_scipy(*words):
        done = subprocess.run([sys.executable, "-c", code, *words], capture_output=True, text=True, cwd=ROOT)
        return done.returncode, done.stdout, done.stderr

    assert without_scipy("check", fitted / "tube.calibration.json")[::2] == (0, "")
    words = "skin-calib: this needs scipy, which is not installed here: pip install 'skin-calib[author]'\n"
    assert without_scipy("fit", fitted / "tube.plan.json", "-o", fitted) == (1, "", words)


@pytest.mark.parametrize("module, kind, package", [("collada", "dae", "pycollada"), ("igl", "ply", "libigl")])
def test_missing_package_of_a_mesh_is_one_line(folder, capsys, monkeypatch, module, kind, package):
    """The readers of single formats, and distances, import their packages late."""
    if kind != "ply":
        pytest.importorskip("trimesh").creation.box().export(folder / f"tube.{kind}")
    monkeypatch.setitem(sys.modules, module, None)
    monkeypatch.delitem(sys.modules, "bpy", raising=False)
    plan = write_plan(folder, mesh=f"tube.{kind}")
    assert main(["fit", str(plan), "-o", str(folder / "out.json")]) == 1
    out, err = capsys.readouterr()
    assert out == "" and err.count("\n") == 1 and err.startswith("skin-calib: ") and "No module" not in err
    assert package in err and "pip install" in err


def test_show_prints_all_data_of_a_calibration(tmp_path, capsys):
    """Response, closed directions, errors in both directions, cells, position, largest value of each quality."""
    path = tmp_path / "c.json"
    own = (ResponseTable((0.0, 250.0), (16.0, 0.0)), Response((0.0, 1.0)))
    save_calibration(small_calibration(responses=own, generator="a\x1b[31m"), path)
    assert main(["show", str(path)]) == 0
    out, err = capsys.readouterr()
    assert err == "" and out.splitlines() == [
        "link      forearm",
        "mesh      forearm.stl: 1000 vertices, 1996 faces",
        "by        a\\x1b[31m",
        "response  0.25 I - 0.001 I^2 N for a reading I; 2 more for single taxels",
        "surface   tube: 3 x 8 control points, degree (2, 3), closed in v",
        "          surface to mesh: mean 0.0150, rms 0.0250, max 0.1100 mm",
        "          mesh to surface: mean 0.0100, rms 0.0200, max 0.1000 mm (parallel faces at any distance)",
        "surface   plane: 2 x 2 control points, degree (1, 1)",
        "          surface to mesh: mean 0.0150, rms 0.0250, max 0.1100 mm",
        "          mesh to surface: mean 0.0100, rms 0.0200, max 0.1000 mm (parallel faces at any distance)",
        "patch     sheet: sheet of 2 x 3, 6 taxels, channels 0 to 5",
        "          on tube; pitch 10.00 x 10.00 mm; areas 100.00 to 100.00 mm^2",
        "          from (26.7, -5.0, 0.0) mm to (35.0, 23.1, 20.0) mm",
        "          largest strain along: -1 %, at s0.0",
        "          largest strain across: 0.8824 %, at s1.2",
        "          largest shear: 0.573 degrees, at s1.2",
        "patch     boards: hexagons of 1 x 2, 2 taxels, channels 6 to 7",
        "          on plane; pitch 27.75 x 27.75 mm; areas 690.28 to 690.28 mm^2",
        "          from (15.9, 33.7, -100.0) mm to (71.9, 66.3, -100.0) mm",
        "          largest gap: 0.1 mm, at h1",
        "          largest tilt: 1.146 degrees, at h1",
    ]
    response = ResponseTable((0.0, 250.0), (16.0, 0.0))
    save_calibration(small_calibration(response=response), path)
    main(["show", str(path)])
    assert "response  table of 2 rows, readings 0 to 250, 0 to 16 N\n" in capsys.readouterr().out


def test_warnings_of_a_fit_are_repeated_by_every_command(folder, capsys):
    """The calibration keeps them. `check` and `show` print them with their codes, and `check` counts them."""
    whole = cylinder(around=24, along=8)
    save_mesh(TriangleMesh(whole.vertices, np.delete(whole.faces, slice(100, 120), axis=0)), folder / "tube.ply")
    out = folder / "out.json"
    assert main(["fit", str(folder / "tube.plan.json"), "-o", str(out)]) == 0
    printed = capsys.readouterr().err.splitlines()
    kept = load_calibration(out).warnings
    assert "outside-outline" in {w.code for w in kept}
    assert printed == [f"skin-calib: {w.severity}: {w}" for w in kept]
    assert main(["check", str(out)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[:-1] == [f"warning: /warnings/{i} reports: {w}" for i, w in enumerate(kept)]
    assert f"0 errors, {len(kept)} warnings" in lines[-1]
    assert main(["show", str(out)]) == 0
    assert capsys.readouterr().err.splitlines() == [f"skin-calib: {line}" for line in lines[:-1]]


def test_show_draws_all_surfaces_and_reports_missing_ones(tmp_path, capsys, monkeypatch):
    """All surfaces are drawn; a calibration without surface gives one line."""
    monkeypatch.setattr(calibration_picture, "QUAD_COUNTS", (6, 12))
    pictures = []
    for name, surfaces in (("two", (surface_tube(), plane())), ("one", (surface_tube(),)), ("none", ())):
        save_calibration(small_calibration(surfaces=surfaces, patches=()), tmp_path / f"{name}.json")
        words = ["show", str(tmp_path / f"{name}.json"), "--picture", str(tmp_path / f"{name}.png")]
        assert main(words) == (0 if surfaces else 1)
        pictures += [(tmp_path / f"{name}.png").read_bytes()] if surfaces else []
    assert pictures[0] != pictures[1] and not (tmp_path / "none.png").exists()
    assert capsys.readouterr().err == "skin-calib: the calibration of 'forearm' has no surface to draw; fit its plan\n"


def test_check_reports_a_changed_mesh(folder, capsys):
    """In the folder of the calibration, at the path of the fit, or with --mesh; a changed plan is reported, too."""
    (folder / "out").mkdir()
    plan, out = folder / "tube.plan.json", folder / "out" / "tube.calibration.json"
    main(["fit", str(plan), "-o", str(folder / "out")])
    (folder / "adjacent.json").write_bytes(out.read_bytes())

    def check(path, *words):
        capsys.readouterr()
        assert main([*map(str, ("check", path, *words))]) == 0
        return capsys.readouterr().out

    same = f"0 warnings; 8 taxels on tube; mesh {folder / 'tube.ply'} is unchanged\n"
    assert check(out).endswith(same) and check(folder / "adjacent.json").endswith(same)
    save_mesh(cylinder(around=24, along=9), folder / "tube.ply")
    for path in (out, folder / "adjacent.json"):
        text = check(path)
        assert f"warning: /mesh/sha256 differs from that of {folder / 'tube.ply'}: the mesh has changed" in text
        assert text.endswith("0 errors, 1 warning; 8 taxels on tube; mesh has changed\n")
    write_plan(folder, degree=[3, 4])
    assert "warning: the document was made from ../tube.plan.json, which has changed" in check(out)
    (folder / "tube.ply").write_bytes(b"ply")
    assert "warning: /mesh/sha256 cannot be compared: tube.ply is not a valid PLY file" in check(out)
    (folder / "tube.ply").unlink()
    assert check(out).endswith("mesh tube.ply not found and not compared: specify it with --mesh\n")
    save_mesh(cylinder(around=24, along=8), folder / "kept.ply")
    assert f"mesh {folder / 'kept.ply'} is unchanged" in check(out, "--mesh", folder / "kept.ply")
    assert "warning: /mesh does not exist" in check(plan)
    worn = write_plan(folder, "worn", skins=[{"name": "worn", "kind": "imported", "file": "lost.csv"}])
    assert "warning: /skins/0/file does not exist; paths are relative" in check(worn)
    (folder / "lost.csv").write_text("")
    assert "/skins/0/file" not in check(worn)
    (folder / "out" / "tube.sources.json").write_text("{")
    assert "warning: the document cannot be compared with its sources: the sources of" in check(out)


def test_calibrations_in_a_folder_that_is_a_link_know_their_mesh(folder, capsys):
    """The parent of a symbolic link differs from the parent of its target."""
    (folder / "far" / "away").mkdir(parents=True)
    (folder / "near").symlink_to(folder / "far" / "away")
    assert main(["fit", str(folder / "tube.plan.json"), "-o", str(folder / "near")]) == 0
    for place in (folder / "near", folder / "far" / "away"):
        capsys.readouterr()
        assert main(["check", str(place)]) == 0
        assert "is unchanged" in capsys.readouterr().out
    save_mesh(cylinder(around=24, along=9), folder / "tube.ply")
    assert main(["check", str(folder / "near")]) == 0
    assert "the mesh has changed" in capsys.readouterr().out


def test_check_goes_through_folders(folder, fitted_once, capsys):
    """At least one line for each file, in order; an invalid file does not hide the others."""
    shutil.copy(fitted_once / "tube.calibration.json", folder / "a.calibration.json")
    (folder / "b.calibration.json").write_text("{")
    assert main(["check", str(folder), str(folder / "none.json"), str(folder / "tube.plan.json")]) == 1
    out, err = capsys.readouterr()
    names = [line.split(": ")[0] for line in out.splitlines() if not line.startswith("error: ")]
    expected = ("a.calibration.json", "b.calibration.json", "tube.plan.json", "tube.plan.json")
    assert names == [str(folder / name) for name in expected]
    assert err.count("\n") == 1 and "none.json" in err
    assert_refused(capsys, 2, "--mesh needs exactly one file", "check", folder, "--mesh", folder / "tube.ply")
    assert main(["check", str(folder / "tube.plan.json"), "--mesh", str(folder / "tube.ply")]) == 0
    words = f"warning: --mesh is for a calibration, and {folder / 'tube.plan.json'} is none: {folder / 'tube.ply'} was"
    assert f"{words} not compared\n" in capsys.readouterr().err


def test_check_names_taxels_and_counts(tmp_path, capsys):
    """A finding about a taxel has its id; many findings are counted by code."""
    document = to_document(small_calibration(rows=4, columns=4))
    document["patches"][0]["taxels"]["area"] = [2e-4] * 16
    document["patches"][1]["taxels"]["id"][1] = 5
    document["patches"][1]["taxels"]["gap"][1] = "x"
    (tmp_path / "c.json").write_text(json.dumps(document))
    assert main(["check", str(tmp_path / "c.json")]) == 1
    out = capsys.readouterr().out
    assert (
        "/patches/0/taxels/area/6 is 0.0002 m^2, but the area of the corners is 0.0001 m^2 [area] (taxel s1.2)\n" in out
    )
    assert '/patches/1/taxels/gap/1 must be a finite number, not "x" [type]\n' in out
    assert out.endswith("3 errors, 16 warnings; 16 area, 2 type, 1 checksum\n")
    for ids in (["h0"], 7, None):
        document["patches"][1]["taxels"]["id"] = ids
        (tmp_path / "c.json").write_text(json.dumps(document))
        assert main(["check", str(tmp_path / "c.json")]) == 1
        assert '/patches/1/taxels/gap/1 must be a finite number, not "x" [type]\n' in capsys.readouterr().out


def test_scene_plans_replace_plan_files(fitted, capsys):
    """With an open scene, links are fitted from their meshes, to the same bytes as from files."""
    plan, mesh = load_plan(fitted / "tube.plan.json"), cylinder(around=24, along=8)
    assert main(["fit", "-o", str(fitted / "a.json")], lambda: [(plan, mesh)]) == 0
    assert (fitted / "a.json").read_bytes() == (fitted / "tube.calibration.json").read_bytes()
    assert main(["fit", "-o", str(fitted / "c.json")], lambda: []) == 1
    assert "The scene has no link to fit" in capsys.readouterr().err


def test_warnings_of_a_scene_are_printed_and_kept(fitted, capsys):
    """They are about the object, and no file has them: the calibration and the report repeat them."""
    warning = Warning("moved-object", "warning", "tube is moved.")
    plan, mesh = load_plan(fitted / "tube.plan.json"), cylinder(around=24, along=8)
    out, report = fitted / "a.json", fitted / "report.json"
    scene = [(replace(plan, warnings=(warning,)), mesh)]
    assert main(["fit", "-o", str(out), "--report", str(report)], lambda: scene) == 0
    assert load_calibration(out).warnings[0] == warning
    assert "tube is moved. [moved-object]" in capsys.readouterr().err
    assert json.loads(report.read_text())["warnings"][0]["code"] == "moved-object"


@pytest.mark.parametrize("command", ["fit", "show"])
def test_picture_needs_a_name_of_a_picture(folder, capsys, command):
    """The call is refused before any work."""
    calibration = folder / "c.json"
    if command == "show":
        save_calibration(small_calibration(), calibration)
    words = {"fit": ["fit", folder / "tube.plan.json", "-o", calibration], "show": ["show", calibration]}[command]
    assert_refused(capsys, 2, "a.txt is not a name for a picture", *words, "--picture", folder / "a.txt")
    assert not (folder / "a.txt").exists() and calibration.exists() == (command == "show")


@pytest.mark.skipif(os.name == "nt", reason="Windows has no pipes of this kind")
def test_file_that_cannot_be_written_is_a_wrong_call(folder, capsys):
    """The exit code of fit is that of the other commands."""
    os.mkfifo(folder / "pipe")
    assert main(["fit", str(folder / "tube.plan.json"), "-o", str(folder / "pipe")]) == 2
    assert "it is not a regular file" in capsys.readouterr().err


def test_control_characters_of_a_plan_do_not_get_to_the_terminal(folder, capsys):
    """The name of a mesh could clear the screen or write into the title."""
    plan = write_plan(folder, mesh="a\x1b[2Jb\x07.stl")
    assert main(["fit", str(plan), "-o", str(folder / "c.json")]) == 1
    out, err = capsys.readouterr()
    assert "\x1b" not in out + err and "\x07" not in out + err and r"\x1b[2Jb\x07.stl" in err


@pytest.mark.slow
def test_reader_that_leaves_early_is_no_error(tmp_path):
    """``skin-calib show FILE | head -1`` ends without an error message."""
    path = tmp_path / "c.json"
    save_calibration(small_calibration(), path)
    reader, writer = os.pipe()
    os.close(reader)
    words = [sys.executable, "-m", "skin_calib_addon", "show", path]
    done = subprocess.run(words, cwd=ROOT, env=ENVIRONMENT, stdout=writer, stderr=subprocess.PIPE, text=True)
    os.close(writer)
    assert done.returncode == 0 and done.stderr == ""


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="needs a device that is always full")
def test_output_that_is_full_is_one_line(tmp_path):
    """The output cannot be written: code 2, and no second message at the end of the program."""
    save_calibration(small_calibration(), tmp_path / "c.json")
    words = [sys.executable, "-m", "skin_calib_addon", "check", tmp_path / "c.json"]
    with open("/dev/full", "w") as full:
        done = subprocess.run(words, cwd=ROOT, env=ENVIRONMENT, stdout=full, stderr=subprocess.PIPE, text=True)
    assert done.returncode == 2 and done.stderr.count("\n") == 1
    assert done.stderr.startswith("skin-calib: writing the output failed: ") and "No space left" in done.stderr


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="a shell that closes handles")
@pytest.mark.parametrize(
    "closed",
    [slow(">&-"), slow("2>&-"), "<&- >&- 2>&-"],
)
def test_closed_output_is_not_an_error(folder, closed):
    """As for a service: the program does its work and returns its code."""
    words = f"{sys.executable} -m skin_calib_addon fit a.plan.json b.plan.json -o {folder} --jobs 2"
    write_plan(folder, "a")
    write_plan(folder, "b", mesh="none.ply")
    shell = ["sh", "-c", f"cd {folder}; {words} {closed}"]
    assert subprocess.run(shell, env=ENVIRONMENT, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL).returncode == 1
    assert load_calibration(folder / "a.calibration.json").link == "tube"


def test_terminal_without_the_letters_of_a_name(tmp_path):
    """Characters outside the encoding are escaped, and do not stop the program."""
    save_calibration(replace(small_calibration(), link="Pr\u00fcfling"), tmp_path / "a.json")
    words = [sys.executable, "-m", "skin_calib_addon", "check", tmp_path / "a.json"]
    environment = ENVIRONMENT | {"PYTHONIOENCODING": "ascii"}
    done = subprocess.run(words, cwd=ROOT, env=environment, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "") and "Pr\\xfcfling" in done.stdout
