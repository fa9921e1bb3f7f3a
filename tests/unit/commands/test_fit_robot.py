"""Complete robots: many plans in one call, no repeated fits, and independent links."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from skin_calib_addon.calibration import load_calibration, save_calibration
from skin_calib_addon.calibration.response import Response
from skin_calib_addon.cli import main
from skin_calib_addon.commands import fit_jobs
from skin_calib_addon.geometry.mesh.triangle_mesh import load_mesh, save_mesh, weld
from skin_calib_addon.pipeline import robot_folder, sources
from tests.examples import slow
from tests.shapes import LENGTH, RADIUS, cylinder
from tests.unit.commands.test_cli import TUBE, write_plan

ROOT = Path(__file__).parents[3]
NAMES = ("arm", "leg", "toe")
TAXELS = "label,x,y,z\na,0.035,0,0.04\nb,0.035,0,0.06\n"


def write_robot(folder):
    """Write three plans and their meshes, and make an empty folder for calibrations."""
    (folder / "plans").mkdir()
    (folder / "out").mkdir()
    for number, name in enumerate(NAMES):
        save_mesh(cylinder(around=24, along=8 + number), folder / "plans" / f"{name}.ply")
        write_plan(folder / "plans", name, link=name, mesh=f"{name}.ply")
    return folder


@pytest.fixture
def robot(tmp_path):
    """A folder with three plans and their meshes, and an empty one for calibrations."""
    return write_robot(tmp_path)


@pytest.fixture(scope="module")
def fitted_once(tmp_path_factory):
    """The same after a fit with reports."""
    folder = write_robot(tmp_path_factory.mktemp("fitted"))
    assert fit(folder, "--report", folder / "out") == 0
    return folder


@pytest.fixture
def fitted(fitted_once, tmp_path, capsys):
    """A copy of it; records are relative, so that it is up to date."""
    capsys.readouterr()
    return Path(shutil.copytree(fitted_once, tmp_path, dirs_exist_ok=True))


def fit(robot, *words, plans="plans"):
    return main([*map(str, ("fit", robot / plans, "-o", robot / "out", *words))])


def states(capsys):
    """Return the state of each link in the table."""
    rows = capsys.readouterr().out.splitlines()[:-1]
    return {row.split()[0]: row.split("  ")[1].strip() for row in rows}


def noted(robot):
    """Return the links with a record of their sources."""
    return {path.name.removesuffix(".sources.json") for path in (robot / "out").glob("*.sources.json")}


def written(robot):
    """Return all calibrations with their inode, which changes if a file is written again."""
    return {name: os.stat(robot / "out" / f"{name}.calibration.json").st_ino for name in NAMES}


@pytest.mark.parametrize("jobs", ["1", slow("2")])
def test_folder_of_plans_is_fitted(robot, capsys, jobs):
    """One call gives the same calibrations as single calls, and a table with a line for each link and one for all."""
    assert fit(robot, "--jobs", jobs) == 0
    out, err = capsys.readouterr()
    assert err == "" and [line.split()[0] for line in out.splitlines()] == [*NAMES, "3"]
    assert out.splitlines()[0].startswith("arm  fitted           8 taxels, mean error 0.")
    assert out.splitlines()[-1] == "3 links: 3 fitted"
    assert main(["fit", str(robot / "plans" / "leg.plan.json"), "-o", str(robot / "leg.json")]) == 0
    assert (robot / "out" / "leg.calibration.json").read_bytes() == (robot / "leg.json").read_bytes()


def test_up_to_date_calibrations_are_not_fitted_again(fitted, capsys):
    """No file is written again, under any path of the folder; warnings and numbers are repeated."""
    mesh = load_mesh(fitted / "plans" / "toe.ply")
    away = np.linalg.norm(mesh.triangles.mean(axis=1) - (RADIUS, 0, LENGTH / 2), axis=1)
    save_mesh(weld(mesh.vertices, mesh.faces[away > 0.012]), fitted / "plans" / "toe.ply")  # a hole
    fit(fitted)
    first, before = capsys.readouterr(), written(fitted)
    assert first.err.count("toe: warning: ") == first.err.count("\n") > 0
    os.rename(fitted, fitted.with_name("elsewhere"))
    moved = fitted.with_name("elsewhere")
    assert fit(moved) == 0
    second = capsys.readouterr()
    assert written(moved) == before and second.err == first.err
    assert second.out.splitlines()[-1] == "3 links: 3 up to date"
    assert second.out.splitlines()[:-1] == first.out.replace("fitted    ", "up to date").splitlines()[:-1]


def change_plan(robot, monkeypatch):
    write_plan(robot / "plans", "leg", link="leg", mesh="leg.ply", grid=TUBE | {"n": 7})


def change_mesh(robot, monkeypatch):
    save_mesh(cylinder(around=24, along=12), robot / "plans" / "leg.ply")


def break_calibration(robot, monkeypatch):
    path = robot / "out" / "leg.calibration.json"
    path.write_bytes(path.read_bytes()[:-100])


def remove_report(robot, monkeypatch):
    (robot / "out" / "leg.report.json").unlink()


@pytest.mark.parametrize(
    "change", [change_plan, change_mesh, break_calibration, remove_report], ids=lambda f: f.__name__
)
def test_what_changed_is_fitted_again(fitted, capsys, monkeypatch, change):
    """Only the link whose plan, mesh or files changed; after that, all links are up to date."""
    before = written(fitted)
    change(fitted, monkeypatch)
    capsys.readouterr()
    assert fit(fitted, "--report", fitted / "out") == 0
    assert states(capsys) == {"arm": "up to date", "leg": "fitted", "toe": "up to date"}
    after = written(fitted)
    assert (after["arm"], after["toe"]) == (before["arm"], before["toe"]) and after["leg"] != before["leg"]
    fit(fitted, "--report", fitted / "out")
    assert set(states(capsys).values()) == {"up to date"}


@pytest.mark.slow
def test_another_program_fits_everything_again(fitted, capsys, monkeypatch):
    """Another version of the program or of a library gives other numbers; ``--again`` always fits again."""
    monkeypatch.setattr(sources, "program", lambda: "skin-calib 9")
    capsys.readouterr()
    fit(fitted)
    assert set(states(capsys).values()) == {"fitted"}
    fit(fitted)
    assert set(states(capsys).values()) == {"up to date"}
    fit(fitted, "--again")
    assert set(states(capsys).values()) == {"fitted"}


@pytest.mark.slow
def test_taxel_file_of_a_plan_counts(robot, capsys):
    """A taxel file is a source of the calibration, like the mesh."""
    (robot / "plans" / "taxels.csv").write_text(TAXELS)
    skins = [{"name": "a", "kind": "imported", "file": "taxels.csv"}]
    write_plan(robot / "plans", "leg", link="leg", mesh="leg.ply", skins=skins)
    assert fit(robot) == 0
    (robot / "plans" / "taxels.csv").write_text(TAXELS.replace("0.06", "0.05"))
    capsys.readouterr()
    fit(robot)
    assert states(capsys) == {"arm": "up to date", "leg": "fitted", "toe": "up to date"}


def test_picture_of_an_older_fit_is_replaced(fitted, capsys, monkeypatch):
    """A picture of an older fit does not count as up to date."""
    monkeypatch.setattr(fit_jobs, "_draw", lambda _, path: path.write_bytes(b"new"))
    (fitted / "out" / "leg.png").write_bytes(b"old")
    words = ("--picture", fitted / "out")
    assert fit(fitted, *words, plans="plans/leg.plan.json") == 0
    assert (fitted / "out" / "leg.png").read_bytes() == b"new" and "calibration      " in capsys.readouterr().out
    fit(fitted, *words, plans="plans/leg.plan.json")
    assert capsys.readouterr().out == f"{fitted / 'out' / 'leg.calibration.json'}: up to date\n"


def test_calibration_that_was_changed_is_kept(fitted, capsys):
    """The same call keeps fitted responses; a changed plan replaces them, with a warning."""
    path = fitted / "out" / "leg.calibration.json"
    calibration = load_calibration(path)
    object.__setattr__(calibration, "response", Response((0.0, 3.0)))
    save_calibration(calibration, path)
    kept = path.read_bytes()
    capsys.readouterr()
    assert fit(fitted) == 0
    out, err = capsys.readouterr()
    assert path.read_bytes() == kept and "leg  kept " in out and "changed after its fit; --again" in out and err == ""
    change_plan(fitted, None)
    assert fit(fitted) == 0
    assert (
        "leg: warning: The calibration was changed after its last fit, and this fit replaces those changes."
        in capsys.readouterr().err
    )
    assert path.read_bytes() != kept


def test_check_trusts_the_record_of_unchanged_bytes_only(fitted, capsys, monkeypatch):
    """A calibration that was changed after its fit is compared with the geometry of the mesh."""
    path = fitted / "out" / "leg.calibration.json"
    with monkeypatch.context() as patch:
        patch.setattr(sources, "read_mesh", lambda path: [][1])  # not needed
        assert main(["check", str(path)]) == 0
    assert "leg.ply is unchanged" in capsys.readouterr().out
    calibration = load_calibration(path)
    save_calibration(replace(calibration, mesh=replace(calibration.mesh, sha256="0" * 64)), path)
    assert main(["check", str(path)]) == 0
    assert "/mesh/sha256 differs from that of" in capsys.readouterr().out


@pytest.mark.parametrize("jobs", ["1", slow("2")])
def test_bad_link_does_not_stop_the_others(fitted, capsys, jobs):
    """The summary states which link failed and why, and that an older calibration exists."""
    write_plan(fitted / "plans", "arm", link="arm", mesh="none.ply")
    (fitted / "plans" / "bad.plan.json").write_text("{")
    capsys.readouterr()
    assert fit(fitted, "--jobs", jobs) == 1
    out, err = capsys.readouterr()
    rows = out.splitlines()
    assert rows[0].startswith("arm  failed      There is no mesh file at ") and rows[0].endswith(
        "is from an earlier fit"
    )
    assert rows[1].startswith("bad  failed      bad.plan.json is not a valid plan: ") and "earlier" not in rows[1]
    assert rows[-1] == "4 links: 2 up to date, 2 failed"
    assert sorted(line.split()[1] for line in err.splitlines()) == ["arm:", "bad:"]


def only_leg(what):
    """`calibrate`, but for one link."""
    calibrate = fit_jobs.calibrate
    return lambda plan, mesh: what() if plan.link == "leg" else calibrate(plan, mesh)


def test_unexpected_error_does_not_stop_the_others(fitted, capsys, monkeypatch):
    """It is reported with its traceback; a single plan raises it."""
    change_plan(fitted, None)
    monkeypatch.setattr(fit_jobs, "calibrate", only_leg(lambda: [][1]))
    assert fit(fitted) == 1
    out, err = capsys.readouterr()
    words = "leg  failed      unexpected error in the program, please report it: IndexError"
    assert words in out and "Traceback" in err and out.splitlines()[-1] == "3 links: 2 up to date, 1 failed"
    with pytest.raises(IndexError):
        fit(fitted, plans="plans/leg.plan.json")


def test_insufficient_memory_stops_one_link(fitted, capsys, monkeypatch):
    """It is not reported as an unexpected error; a single plan gives one line, too."""
    change_plan(fitted, None)
    monkeypatch.setattr(fit_jobs, "calibrate", only_leg(lambda: np.empty(2**50)))
    assert fit(fitted) == 1
    out, err = capsys.readouterr()
    assert "leg  failed      There is not enough memory. Reduce --jobs" in out and err.count("\n") == 1
    assert out.splitlines()[-1] == "3 links: 2 up to date, 1 failed"
    assert fit(fitted, plans="plans/leg.plan.json") == 1
    assert capsys.readouterr().err.startswith("skin-calib: There is not enough memory. ")


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="Windows has no signals")
def test_interrupted_call_leaves_whole_files(robot, capsys):
    """Ctrl+C during fits: finished calibrations stay, no other file is left, and the next call continues."""
    small = (robot / "plans" / "toe.ply").read_bytes()
    save_mesh(cylinder(around=600, along=1200), robot / "plans" / "toe.ply")  # takes seconds
    command = [sys.executable, "-m", "skin_calib_addon", "fit", robot / "plans", "-o", robot / "out", "--jobs", "2"]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    interruptible = partial(signal.signal, signal.SIGINT, signal.SIG_DFL)  # background processes ignore it
    with subprocess.Popen(command, cwd=ROOT, process_group=0, preexec_fn=interruptible, **pipes) as process:
        while process.poll() is None and not {"arm", "leg"} <= noted(robot):
            time.sleep(0.01)
        os.killpg(process.pid, signal.SIGINT)  # as a terminal does
        out, err = process.communicate()
    assert (process.returncode, out) == (130, "")
    # A process writes the record of its link just before it reports the link.
    line = "skin-calib: interrupted after {} of 3 links. The same call continues from here.\n"
    assert err in [line.format(done) for done in range(3)]
    assert sorted(os.listdir(robot / "out")) == [
        f"{n}.{w}.json" for n in ("arm", "leg") for w in ("calibration", "sources")
    ]
    (robot / "plans" / "toe.ply").write_bytes(small)
    assert fit(robot) == 0
    assert states(capsys) == {"arm": "up to date", "leg": "up to date", "toe": "fitted"}


def test_interrupted_call_goes_on(fitted, capsys, monkeypatch):
    """Ctrl+C gives one line and its own exit code; the same call fits the missing links."""

    def interrupt():
        raise KeyboardInterrupt

    change_plan(fitted, None)
    with monkeypatch.context() as patch:
        patch.setattr(fit_jobs, "calibrate", only_leg(interrupt))
        assert fit(fitted) == 130
    words = "skin-calib: interrupted after 1 of 3 links. The same call continues from here.\n"
    assert capsys.readouterr() == ("", words)
    assert fit(fitted) == 0
    assert states(capsys) == {"arm": "up to date", "leg": "fitted", "toe": "up to date"}


def test_progress_is_for_a_terminal(fitted, capsys, monkeypatch):
    """The bar is erased before other output and at the end."""
    monkeypatch.setattr("sys.stderr.isatty", lambda: True, raising=False)
    write_plan(fitted / "plans", "leg", link="leg", mesh="none.ply")
    fit(fitted)
    shown = capsys.readouterr().err.split("\r\x1b[K")
    assert [part.split()[1].rstrip(",") for part in shown if part.startswith("[")] == ["0/3", "1/3", "2/3", "3/3"]
    assert shown[1] == f"[{'.' * 30}] 0/3" and shown[-2] == f"[{'#' * 30}] 3/3" and shown[-1] == ""
    assert shown[4].startswith("skin-calib: leg: There is no mesh file") and shown[4].endswith("\n")


def test_invalid_sources_are_an_error_of_their_link(fitted, capsys):
    """Its sources are unknown: one line states what to do. Other links are fitted."""
    (fitted / "out" / "leg.sources.json").write_text('{"format": "skin-sources", "version": 3}')
    assert fit(fitted) == 1
    out, err = capsys.readouterr()
    assert 'leg.sources.json has error: the document lacks the member "program"' in err and "Delete this file" in err
    assert out.splitlines()[-1] == "3 links: 2 up to date, 1 failed"
    assert fit(fitted, "--again", plans="plans/leg.plan.json") == 0


def link(name, *meshes, origin=""):
    shapes = (f'<visual>{origin}<geometry><mesh filename="{m}"/></geometry></visual>' for m in meshes)
    return f'<link name="{name}">{"".join(shapes)}</link>'


def write_urdf(robot, *links):
    path = robot / "plans" / "robot.urdf"
    path.write_text(f'<robot name="r">{"".join(links)}</robot>')
    return path


def test_urdf_selects_the_plans_in_its_folder(fitted, capsys):
    """No warning if robot and plans agree; links without skin need no plan, and a plan named twice counts once."""
    urdf = write_urdf(fitted, *(link(name, f"package://r/meshes/{name}.ply") for name in NAMES), link("head"))
    assert main([*map(str, ("fit", urdf, fitted / "plans" / "arm.plan.json", "-o", fitted / "out"))]) == 0
    out, err = capsys.readouterr()
    assert err == "" and out.splitlines()[-1] == "3 links: 3 up to date"


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
def test_difference_of_urdf_and_plan_is_a_warning(fitted, capsys, case):
    """The link is fitted; the next call repeats the warning."""
    element, words = CONTRADICTIONS[case]
    (fitted / "out" / "leg.sources.json").unlink()
    write_urdf(fitted, link("arm"), element, link("toe", "toe.ply", "toe_collision.stl"))
    for _ in range(2):
        assert fit(fitted, plans="plans/robot.urdf") == 0
        err = capsys.readouterr().err
        assert err.count("\n") == 1 and f"leg: warning: robot.urdf {words}" in err


def test_plan_for_a_link_that_the_robot_lacks_fails(fitted, capsys):
    """Also with plans in another folder; the message suggests the most similar name."""
    urdf = write_urdf(fitted, link("arms"), link("leg"), link("toe")).rename(fitted / "robot.urdf")
    assert main(["fit", str(urdf), str(fitted / "plans"), "-o", str(fitted / "out")]) == 1
    out, err = capsys.readouterr()
    assert 'robot.urdf has no link "arm", which is the link of the plan; did you mean "arms"?' in err
    assert out.splitlines()[-1] == "3 links: 2 up to date, 1 failed"


BAD_CALLS = {
    "folder without plans": (("out",), 1, "no *.plan.json in "),
    "urdf without plans": (("alone.urdf",), 1, "no *.plan.json in the folder of "),
    "two robots": (("alone.urdf", "plans/robot.urdf"), 2, "are two robots. Fit one at a time"),
    "no urdf": (("alone.urdf", "plans"), 1, "has error: line 1 starts "),
    "no links": (("plans/robot.urdf",), 1, "has no link. Check that it is the correct file"),
    "no such folder": (("none",), 1, "cannot read "),
}


@pytest.mark.parametrize("case", BAD_CALLS)
def test_invalid_call_is_one_line(robot, capsys, case):
    """The error occurs before any fit."""
    (robot / "alone.urdf").write_text("<model/>")
    write_urdf(robot)
    names, code, words = BAD_CALLS[case]
    assert main([*map(str, ("fit", *(robot / name for name in names), "-o", robot / "out"))]) == code
    out, err = capsys.readouterr()
    assert out == "" and err.count("\n") == 1 and words in err
    assert os.listdir(robot / "out") == []


def test_mesh_is_known_whatever_its_file(robot):
    """Another format, order or unit is the same geometry."""
    mesh = load_mesh(robot / "plans" / "arm.ply")
    rows = [f"v {x!r} {y!r} {z!r}" for x, y, z in mesh.vertices.tolist()]
    rows += [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in mesh.faces[::-1].tolist()]
    (robot / "arm.obj").write_text("\n".join(rows))
    assert sources.is_same_mesh(robot / "arm.obj", mesh.sha256)
    assert not sources.is_same_mesh(robot / "plans" / "leg.ply", mesh.sha256)
    # numbers in millimetres are multiplied, as for a plan with the unit mm, so that the last bits agree
    rows = [f"v {' '.join(repr(1e3 * x) for x in row)}" for row in mesh.vertices.tolist()] + rows[len(mesh.vertices) :]
    (robot / "mm.obj").write_text("\n".join(rows))
    assert sources.is_same_mesh(robot / "mm.obj", load_mesh(robot / "mm.obj", "mm").sha256)


def test_sources_are_readable_json(fitted):
    """With relative paths, so that folders can be moved together."""
    note = json.loads((fitted / "out" / "arm.sources.json").read_text())
    assert (note["plan"], note["mesh"]) == ("../plans/arm.plan.json", "../plans/arm.ply")
    assert list(note["inputs"]) == [note["plan"], note["mesh"]] and list(note["outputs"])[0] == "arm.calibration.json"


def join_records(robot, version):
    """Replace the records by the one of all calibrations that earlier versions wrote."""
    members = {}
    for path in sorted((robot / "out").glob("*.sources.json")):
        member = json.loads(path.read_text())
        del member["format"], member["version"]
        if version == 1:
            del member["warnings"]
            member["doubts"] = ["it deviates from the mesh"]
        members[path.name.replace(".sources.", ".calibration.")] = member
        path.unlink()
    document = {"format": "skin-sources", "version": version, "calibrations": members}
    (robot / "out" / "sources.json").write_text(json.dumps(document))


@pytest.mark.parametrize("version", [1, 2])
def test_sources_of_a_folder_are_understood(fitted, capsys, version):
    """Earlier versions wrote one file for all calibrations; what is fitted again has its own record from then on."""
    join_records(fitted, version)
    capsys.readouterr()
    assert fit(fitted) == 0
    out, err = capsys.readouterr()
    assert out.splitlines()[-1] == "3 links: 3 up to date"
    warnings = [f"skin-calib: {n}: warning: it deviates from the mesh [earlier-fit]" for n in NAMES]
    assert err.splitlines() == (warnings if version == 1 else [])
    change_plan(fitted, None)
    for leg in ("fitted", "up to date"):
        assert fit(fitted) == 0
        assert states(capsys) == {"arm": "up to date", "leg": leg, "toe": "up to date"}
    assert noted(fitted) == {"leg"}


@pytest.mark.slow
def test_processes_fit_one_folder_at_the_same_time(robot, capsys):
    """As make or a scheduler start them: each plan in a process of its own. No record and no link is lost."""
    command = [sys.executable, "-m", "skin_calib_addon", "fit", "-o", str(robot / "out")]
    begun = [subprocess.Popen([*command, robot / "plans" / f"{n}.plan.json"], cwd=ROOT) for n in NAMES]
    assert [process.wait() for process in begun] == [0, 0, 0]
    links = json.loads((robot / "out" / "robot.json").read_text())["links"]
    assert [link["link"] for link in links] == [*NAMES] and noted(robot) == {*NAMES}
    capsys.readouterr()
    assert fit(robot) == 0
    assert set(states(capsys).values()) == {"up to date"}


def test_robot_lists_what_another_process_writes_meanwhile(fitted, monkeypatch):
    """A process that has read the folder, and writes robot.json later than another one, loses no link of that one."""
    (fitted / "out" / "leg.calibration.json").rename(fitted / "leg.json")
    write, calls = robot_folder.save_robot_set, []

    def write_late(robot_set, folder):
        if not calls:  # the other process finishes between reading and writing
            (fitted / "leg.json").rename(fitted / "out" / "leg.calibration.json")
        calls.append([link.link for link in robot_set.links])
        write(robot_set, folder)

    monkeypatch.setattr(robot_folder, "save_robot_set", write_late)
    assert robot_folder.save_robot(fitted / "out", None, None) == ""
    assert calls == [["arm", "toe"], [*NAMES]]


def test_invalid_paths_in_sources_are_harmless(fitted, capsys):
    """Any path: an endless device, or an invalid name."""
    notes = fitted / "out" / "arm.sources.json"
    note = json.loads(notes.read_text())
    for path in ("/dev/zero", "a\0b", "x" * 5000):
        note["inputs"], note["outputs"] = {path: "0" * 64}, {path: "0" * 64}
        for note["mesh"] in (path, "none.ply"):
            notes.write_text(json.dumps(note))
            capsys.readouterr()
            assert main(["check", str(fitted / "out" / "arm.calibration.json")]) == 0
            assert "mesh arm.ply not found" in capsys.readouterr().out
    assert fit(fitted) == 0
    assert states(capsys) == {"arm": "fitted", "leg": "up to date", "toe": "up to date"}
