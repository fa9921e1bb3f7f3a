"""Whole robots: many plans in one call, what is up to date left alone, and no link that stops another."""

import json
import os
import signal
import subprocess
import sys
import time
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from skin_calib_addon.calibration import load_calibration, save_calibration
from skin_calib_addon.calibration.response import Response
from skin_calib_addon.cli import main
from skin_calib_addon.commands import fit_jobs
from skin_calib_addon.geometry.mesh.triangle_mesh import load_mesh, save_mesh, weld
from skin_calib_addon.pipeline import sources
from tests.examples import slow
from tests.shapes import LENGTH, RADIUS, cylinder
from tests.unit.commands.test_cli import TUBE, write_plan

ROOT = Path(__file__).parents[3]
NAMES = ("arm", "leg", "toe")
TAXELS = "label,x,y,z\na,0.035,0,0.04\nb,0.035,0,0.06\n"


@pytest.fixture
def robot(tmp_path):
    """A folder with three plans and their meshes, and an empty one for calibrations."""
    (tmp_path / "plans").mkdir()
    (tmp_path / "out").mkdir()
    for number, name in enumerate(NAMES):
        save_mesh(cylinder(around=24, along=8 + number), tmp_path / "plans" / f"{name}.ply")
        write_plan(tmp_path / "plans", name, link=name, mesh=f"{name}.ply")
    return tmp_path


def fit(robot, *words, plans="plans"):
    return main([*map(str, ("fit", robot / plans, "-o", robot / "out", *words))])


def states(capsys):
    """What the table says became of each link."""
    rows = capsys.readouterr().out.splitlines()[:-1]
    return {row.split()[0]: row.split("  ")[1].strip() for row in rows}


def noted(robot):
    """The links that are noted to be fitted."""
    path = robot / "out" / "sources.json"
    names = json.loads(path.read_text())["calibrations"] if path.exists() else ()
    return {name.removesuffix(".calibration.json") for name in names}


def written(robot):
    """Every calibration; the number of a file is another one after it was written again."""
    return {name: os.stat(robot / "out" / f"{name}.calibration.json").st_ino for name in NAMES}


@pytest.mark.parametrize("jobs", ["1", slow("2")])
def test_folder_of_plans_is_fitted(robot, capsys, jobs):
    """One call gives each plan the calibration that it has alone, and a table with a line for each and one for all."""
    assert fit(robot, "--jobs", jobs) == 0
    out, err = capsys.readouterr()
    assert err == "" and [line.split()[0] for line in out.splitlines()] == [*NAMES, "3"]
    assert out.splitlines()[0].startswith("arm  fitted           8 taxels, mean error 0.")
    assert out.splitlines()[-1] == "3 links: 3 fitted"
    for name in NAMES:
        alone = robot / f"{name}.json"
        assert main(["fit", str(robot / "plans" / f"{name}.plan.json"), "-o", str(alone)]) == 0
        assert (robot / "out" / f"{name}.calibration.json").read_bytes() == alone.read_bytes()


def test_what_is_up_to_date_is_left(robot, capsys):
    """Nothing is written a second time, whatever the folder is called; warnings and numbers are told again."""
    mesh = load_mesh(robot / "plans" / "toe.ply")
    away = np.linalg.norm(mesh.triangles.mean(axis=1) - (RADIUS, 0, LENGTH / 2), axis=1)
    save_mesh(weld(mesh.vertices, mesh.faces[away > 0.012]), robot / "plans" / "toe.ply")  # a hole
    fit(robot)
    first, before = capsys.readouterr(), written(robot)
    assert first.err.count("toe: warning: ") == first.err.count("\n") > 0
    os.rename(robot, robot.with_name("elsewhere"))
    moved = robot.with_name("elsewhere")
    assert fit(moved, "--jobs", "2") == 0
    second = capsys.readouterr()
    assert written(moved) == before and second.err == first.err
    assert second.out.splitlines()[-1] == "3 links: 3 up to date"
    assert second.out.replace("up to date", "fitted    ").splitlines()[:-1] == first.out.splitlines()[:-1]


def change_plan(robot, monkeypatch):
    write_plan(robot / "plans", "leg", link="leg", mesh="leg.ply", grid=TUBE | {"n": 7})


def change_mesh(robot, monkeypatch):
    save_mesh(cylinder(around=24, along=12), robot / "plans" / "leg.ply")


def remove_calibration(robot, monkeypatch):
    (robot / "out" / "leg.calibration.json").unlink()


def break_calibration(robot, monkeypatch):
    path = robot / "out" / "leg.calibration.json"
    path.write_bytes(path.read_bytes()[:-100])


def remove_report(robot, monkeypatch):
    (robot / "out" / "leg.report.json").unlink()


@pytest.mark.parametrize(
    "change", [change_plan, change_mesh, remove_calibration, break_calibration, remove_report], ids=lambda f: f.__name__
)
def test_what_changed_is_fitted_again(robot, capsys, monkeypatch, change):
    """Of three links the one whose plan, mesh or files are others; the call after that finds all up to date."""
    fit(robot, "--report", robot / "out")
    before = written(robot)
    change(robot, monkeypatch)
    capsys.readouterr()
    assert fit(robot, "--report", robot / "out") == 0
    assert states(capsys) == {"arm": "up to date", "leg": "fitted", "toe": "up to date"}
    after = written(robot)
    assert (after["arm"], after["toe"]) == (before["arm"], before["toe"]) and after["leg"] != before["leg"]
    fit(robot, "--report", robot / "out")
    assert set(states(capsys).values()) == {"up to date"}


def test_another_program_fits_everything_again(robot, capsys, monkeypatch):
    """Another release of ours, or of a library, gives other numbers; ``--again`` asks for it without a reason."""
    fit(robot)
    monkeypatch.setattr(sources, "PROGRAM", "skin-calib 9")
    capsys.readouterr()
    fit(robot)
    assert set(states(capsys).values()) == {"fitted"}
    fit(robot)
    assert set(states(capsys).values()) == {"up to date"}
    fit(robot, "--again")
    assert set(states(capsys).values()) == {"fitted"}


def test_taxel_file_of_a_plan_counts(robot, capsys):
    """A file of taxels is what a calibration was made from, like the mesh."""
    (robot / "plans" / "taxels.csv").write_text(TAXELS)
    skins = [{"name": "a", "kind": "imported", "file": "taxels.csv"}]
    write_plan(robot / "plans", "leg", link="leg", mesh="leg.ply", skins=skins)
    assert fit(robot) == 0
    (robot / "plans" / "taxels.csv").write_text(TAXELS.replace("0.06", "0.05"))
    capsys.readouterr()
    fit(robot)
    assert states(capsys) == {"arm": "up to date", "leg": "fitted", "toe": "up to date"}


def test_picture_that_nobody_drew_is_drawn(robot, capsys):
    """A picture that an older fit left does not pass for one of this fit."""
    (robot / "out" / "leg.png").write_bytes(b"old")
    fit(robot)
    capsys.readouterr()
    assert (
        main(["fit", str(robot / "plans/leg.plan.json"), "-o", str(robot / "out"), "--picture", str(robot / "out")])
        == 0
    )
    assert (robot / "out" / "leg.png").read_bytes()[:4] == b"\x89PNG"
    assert "calibration      " in capsys.readouterr().out
    main(["fit", str(robot / "plans/leg.plan.json"), "-o", str(robot / "out"), "--picture", str(robot / "out")])
    assert capsys.readouterr().out == f"{robot / 'out' / 'leg.calibration.json'}: up to date\n"


def test_calibration_that_was_changed_is_kept(robot, capsys):
    """Responses that were measured are not undone by the same call; a new plan does, and says so."""
    fit(robot)
    path = robot / "out" / "leg.calibration.json"
    calibration = load_calibration(path)
    object.__setattr__(calibration, "response", Response((0.0, 3.0)))
    save_calibration(calibration, path)
    kept = path.read_bytes()
    capsys.readouterr()
    assert fit(robot) == 0
    out, err = capsys.readouterr()
    assert path.read_bytes() == kept and "leg  kept " in out and "changed after its fit; --again" in out and err == ""
    change_plan(robot, None)
    assert fit(robot) == 0
    assert (
        "leg: warning: The calibration was changed after its last fit, and this fit replaces those changes."
        in capsys.readouterr().err
    )
    assert path.read_bytes() != kept


@pytest.mark.parametrize("jobs", ["1", "2"])
def test_bad_link_does_not_stop_the_others(robot, capsys, jobs):
    """The summary says which failed and why, and that an older calibration is still there."""
    fit(robot)
    write_plan(robot / "plans", "arm", link="arm", mesh="none.ply")
    (robot / "plans" / "bad.plan.json").write_text("{")
    capsys.readouterr()
    assert fit(robot, "--jobs", jobs) == 1
    out, err = capsys.readouterr()
    rows = out.splitlines()
    assert rows[0].startswith("arm  failed      There is no mesh file at ") and rows[0].endswith("is of an earlier fit")
    assert rows[1].startswith("bad  failed      bad.plan.json is not a valid plan: ") and "earlier" not in rows[1]
    assert rows[-1] == "4 links: 2 up to date, 2 failed"
    assert sorted(line.split()[1] for line in err.splitlines()) == ["arm:", "bad:"]


def only_leg(what):
    """`calibrate`, but for one link."""
    calibrate = fit_jobs.calibrate
    return lambda plan, mesh: what() if plan.link == "leg" else calibrate(plan, mesh)


def test_mistake_of_the_program_does_not_stop_the_others(robot, capsys, monkeypatch):
    """It is told with its traceback; of one plan alone it shows as it is."""
    monkeypatch.setattr(fit_jobs, "calibrate", only_leg(lambda: [][1]))
    assert fit(robot) == 1
    out, err = capsys.readouterr()
    assert "leg  failed      a mistake in the program, please report it: IndexError" in out and "Traceback" in err
    assert out.splitlines()[-1] == "3 links: 2 fitted, 1 failed"
    with pytest.raises(IndexError):
        fit(robot, plans="plans/leg.plan.json")


def test_want_of_memory_is_told_and_stops_one_link(robot, capsys, monkeypatch):
    """Not as a mistake of the program; of one plan alone it is one line too."""
    monkeypatch.setattr(fit_jobs, "calibrate", only_leg(lambda: np.empty(2**50)))
    assert fit(robot) == 1
    out, err = capsys.readouterr()
    assert "leg  failed      there is not enough memory for it; use fewer --jobs" in out and err.count("\n") == 1
    assert out.splitlines()[-1] == "3 links: 2 fitted, 1 failed"
    assert fit(robot, plans="plans/leg.plan.json") == 1
    assert capsys.readouterr().err.startswith("skin-calib: there is not enough memory for this; ")


@pytest.mark.slow
def test_process_that_dies_does_not_stop_the_others(robot, capsys, monkeypatch):
    """The system may end one that takes too much memory; its link is told, and the same call goes on from there."""

    class Popen(subprocess.Popen):
        begun = 0

        def __init__(self, *words, **more):
            super().__init__(*words, **more)
            Popen.begun += 1
            if Popen.begun == 2:
                self.kill()

    with monkeypatch.context() as patch:
        patch.setattr(subprocess, "Popen", Popen)
        assert fit(robot, "--jobs", "2") == 1
    out = capsys.readouterr().out
    assert out.count("failed      its process was ended from outside") == 1
    assert out.splitlines()[-1] == "3 links: 2 fitted, 1 failed"
    assert fit(robot, "--jobs", "2") == 0
    assert capsys.readouterr().out.splitlines()[-1] == "3 links: 1 fitted, 2 up to date"


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="Windows has no signals")
def test_interrupted_call_leaves_whole_files(robot, capsys):
    """Ctrl+C while processes are busy: what was fitted is kept, nothing else is left, and the same call goes on."""
    small = (robot / "plans" / "toe.ply").read_bytes()
    save_mesh(cylinder(around=600, along=1200), robot / "plans" / "toe.ply")  # takes seconds
    command = [sys.executable, "-m", "skin_calib_addon", "fit", robot / "plans", "-o", robot / "out", "--jobs", "2"]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    heard = partial(signal.signal, signal.SIGINT, signal.SIG_DFL)  # in tests that run in the background it is ignored
    with subprocess.Popen(command, cwd=ROOT, process_group=0, preexec_fn=heard, **pipes) as process:
        while process.poll() is None and not {"arm", "leg"} <= noted(robot):
            time.sleep(0.01)
        os.killpg(process.pid, signal.SIGINT)  # as a terminal does
        out, err = process.communicate()
    assert (process.returncode, out) == (130, "")
    assert err == "skin-calib: interrupted after 2 of 3 links; the same call goes on from here\n"
    assert sorted(os.listdir(robot / "out")) == ["arm.calibration.json", "leg.calibration.json", "sources.json"]
    (robot / "plans" / "toe.ply").write_bytes(small)
    assert fit(robot) == 0
    assert states(capsys) == {"arm": "up to date", "leg": "up to date", "toe": "fitted"}


def test_interrupted_call_goes_on(robot, capsys, monkeypatch):
    """Ctrl+C is one line and a code of its own; the same call again fits what is missing."""

    def interrupt():
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(fit_jobs, "calibrate", only_leg(interrupt))
        assert fit(robot) == 130
    assert capsys.readouterr() == ("", "skin-calib: interrupted after 1 of 3 links; the same call goes on from here\n")
    assert fit(robot) == 0
    assert states(capsys) == {"arm": "up to date", "leg": "fitted", "toe": "fitted"}


def test_progress_is_for_a_terminal(robot, capsys, monkeypatch):
    """A bar that is wiped before a line and at the end."""
    monkeypatch.setattr("sys.stderr.isatty", lambda: True, raising=False)
    write_plan(robot / "plans", "leg", link="leg", mesh="none.ply")
    fit(robot)
    shown = capsys.readouterr().err.split("\r\x1b[K")
    assert [part.split()[-1] for part in shown if part.startswith("[")] == ["0/3", "1/3", "2/3", "3/3"]
    assert shown[1] == f"[{'.' * 30}] 0/3" and shown[-2] == f"[{'#' * 30}] 3/3" and shown[-1] == ""
    assert shown[4].startswith("skin-calib: leg: There is no mesh file") and shown[4].endswith("\n")


def test_damaged_notes_are_refused(robot, capsys):
    """What the calibrations were made from cannot be told: one line says what to do."""
    (robot / "out" / "sources.json").write_text('{"format": "skin-sources", "version": 1}')
    assert fit(robot) == 1
    err = capsys.readouterr().err
    assert 'sources.json has error: the document lacks the member "calibrations"' in err and "delete it" in err
    assert os.listdir(robot / "out") == ["sources.json"]


def link(name, *meshes, origin=""):
    shapes = (f'<visual>{origin}<geometry><mesh filename="{m}"/></geometry></visual>' for m in meshes)
    return f'<link name="{name}">{"".join(shapes)}</link>'


def write_urdf(robot, *links):
    path = robot / "plans" / "robot.urdf"
    path.write_text(f'<robot name="r">{"".join(links)}</robot>')
    return path


def test_urdf_stands_for_the_plans_beside_it(robot, capsys):
    """Where robot and plans agree nothing is said; links without skin need no plan."""
    write_urdf(robot, *(link(name, f"package://r/meshes/{name}.ply") for name in NAMES), link("head"))
    assert fit(robot, plans="plans/robot.urdf") == 0
    out, err = capsys.readouterr()
    assert err == "" and out.splitlines()[-1] == "3 links: 3 fitted"


MOVED = '<origin xyz="0 0 0.1" rpy="0 0 0"/>'
CONTRADICTIONS = {
    "mesh": (
        link("leg", "shin.dae", "shin.stl"),
        "gives leg the mesh shin.dae, shin.stl, but the plan has leg.ply. Check",
    ),
    "origin": (link("leg", "leg.dae", origin=MOVED), "gives leg.ply an origin of its own in leg. A plan needs"),
    "scale": (
        link("leg", 'leg.ply" scale="0.001 0.001 0.001'),
        'scales leg.ply by 0.001 0.001 0.001, but the plan has "u',
    ),
}


@pytest.mark.parametrize("case", CONTRADICTIONS)
def test_urdf_and_plan_that_disagree_are_told(robot, capsys, case):
    """The link is fitted, with a warning, in the next call too."""
    element, words = CONTRADICTIONS[case]
    write_urdf(robot, link("arm"), element, link("toe", "toe.ply", "toe_collision.stl"))
    for _ in range(2):
        assert fit(robot, plans="plans/robot.urdf") == 0
        err = capsys.readouterr().err
        assert err.count("\n") == 1 and f"leg: warning: robot.urdf {words}" in err


def test_plan_for_a_link_that_the_robot_lacks_fails(robot, capsys):
    """Also where the plans lie elsewhere than the URDF; the nearest name is proposed."""
    urdf = write_urdf(robot, link("arms"), link("leg"), link("toe")).rename(robot / "robot.urdf")
    assert main(["fit", str(urdf), str(robot / "plans"), "-o", str(robot / "out")]) == 1
    out, err = capsys.readouterr()
    assert 'robot.urdf has no link "arm", which the plan is for; did you mean "arms"?' in err
    assert out.splitlines()[-1] == "3 links: 2 fitted, 1 failed"


BAD_CALLS = {
    "folder without plans": (("out",), 1, "no *.plan.json in "),
    "urdf without plans": (("alone.urdf",), 1, "no *.plan.json beside "),
    "two robots": (("alone.urdf", "plans/robot.urdf"), 2, "are two robots; fit one at a time"),
    "no urdf": (("alone.urdf", "plans"), 1, "has error: line 1 opens "),
    "no links": (("plans/robot.urdf",), 1, "has no link; check that it is the right file"),
    "no such folder": (("none",), 1, "cannot read "),
}


@pytest.mark.parametrize("case", BAD_CALLS)
def test_call_without_sense_is_one_line(robot, capsys, case):
    """Said before anything is fitted."""
    (robot / "alone.urdf").write_text("<model/>")
    write_urdf(robot)
    names, code, words = BAD_CALLS[case]
    assert main([*map(str, ("fit", *(robot / name for name in names), "-o", robot / "out"))]) == code
    out, err = capsys.readouterr()
    assert out == "" and err.count("\n") == 1 and words in err
    assert os.listdir(robot / "out") == []


def test_plan_named_twice_is_fitted_once(robot, capsys):
    """By itself and by its folder."""
    assert main([*map(str, ("fit", robot / "plans" / "arm.plan.json", robot / "plans", "-o", robot / "out"))]) == 0
    assert capsys.readouterr().out.splitlines()[-1] == "3 links: 3 fitted"


def test_mesh_is_known_whatever_its_file(robot):
    """Another format, order or unit is the same geometry."""
    mesh = load_mesh(robot / "plans" / "arm.ply")
    rows = [f"v {x!r} {y!r} {z!r}" for x, y, z in mesh.vertices.tolist()]
    rows += [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in mesh.faces[::-1].tolist()]
    (robot / "arm.obj").write_text("\n".join(rows))
    assert sources.is_same_mesh(robot / "arm.obj", mesh.sha256)
    assert not sources.is_same_mesh(robot / "plans" / "leg.ply", mesh.sha256)
    # the last bit of a number in millimetres is that of the product, as where the plan says millimetres
    rows = [f"v {' '.join(repr(1e3 * x) for x in row)}" for row in mesh.vertices.tolist()] + rows[len(mesh.vertices) :]
    (robot / "mm.obj").write_text("\n".join(rows))
    assert sources.is_same_mesh(robot / "mm.obj", load_mesh(robot / "mm.obj", "mm").sha256)


def test_notes_are_json_for_people(robot):
    """Relative paths, so that folders may move together."""
    fit(robot)
    document = json.loads((robot / "out" / "sources.json").read_text())
    assert list(document["calibrations"]) == [f"{name}.calibration.json" for name in NAMES]
    note = document["calibrations"]["arm.calibration.json"]
    assert (note["plan"], note["mesh"]) == ("../plans/arm.plan.json", "../plans/arm.ply")
    assert list(note["inputs"]) == [note["plan"], note["mesh"]] and list(note["outputs"]) == ["arm.calibration.json"]


def test_notes_of_the_first_version_keep_their_warnings(robot, capsys):
    """There they were plain strings; they are repeated where a calibration is up to date."""
    fit(robot)
    notes = robot / "out" / "sources.json"
    document = json.loads(notes.read_text()) | {"version": 1}
    for member in document["calibrations"].values():
        del member["warnings"]
        member["doubts"] = ["it stands off the mesh"]
    notes.write_text(json.dumps(document))
    capsys.readouterr()
    assert fit(robot) == 0
    out, err = capsys.readouterr()
    assert out.splitlines()[-1] == "3 links: 3 up to date"
    assert err.splitlines() == [f"skin-calib: {n}: warning: it stands off the mesh [earlier-fit]" for n in NAMES]


def test_notes_that_lead_nowhere_do_no_harm(robot, capsys):
    """Whatever paths stand in them: a device that never ends, names that no system takes."""
    fit(robot)
    notes = robot / "out" / "sources.json"
    document = json.loads(notes.read_text())
    for path in ("/dev/zero", "a\0b", "x" * 5000, "..", ""):
        note = document["calibrations"]["arm.calibration.json"]
        note["inputs"], note["outputs"] = {path: "0" * 64}, {path: "0" * 64}
        for note["mesh"] in (path, "none.ply"):
            notes.write_text(json.dumps(document))
            capsys.readouterr()
            assert main(["check", str(robot / "out" / "arm.calibration.json")]) == 0
            assert "mesh arm.ply not found" in capsys.readouterr().out
        assert fit(robot) == 0
        assert states(capsys) == {"arm": "fitted", "leg": "up to date", "toe": "up to date"}
