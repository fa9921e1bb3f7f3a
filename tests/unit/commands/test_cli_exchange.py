"""``export`` and ``import`` on the command line: files, output and exit codes."""

import json
import shutil

import numpy as np
import pytest
from numpy.testing import assert_allclose

from skin_calib_addon.calibration import load_calibration, save_calibration
from skin_calib_addon.calibration.exchange import FORMATS, READABLE, WRITABLE, read_taxels
from skin_calib_addon.cli import main
from skin_calib_addon.common.warnings import Warning
from skin_calib_addon.geometry.mesh.triangle_mesh import save_mesh
from tests.exchange_samples import csv_text, matrix, robot_text
from tests.samples import boards, seven_boards, sheet, small_calibration
from tests.shapes import LENGTH, RADIUS, cylinder
from tests.unit.commands.test_cli import assert_refused, assert_wrong_call, write_plan

FLAT = small_calibration(patches=(seven_boards(), boards(7)))


BROKEN = '{"rotation": [[1, 0, 0], [0, 1, 0], [0, 0, NaN]], "translation": [1, 2, 3]}'


def framed(translation):
    """Return a frame as JSON text."""
    return f'{{"rotation": [[1, 0, 0], [0, 1, 0], [0, 0, 1]], "translation": {translation}}}'


@pytest.fixture
def flat(tmp_path):
    """A calibration file of two flat patches."""
    save_calibration(FLAT, tmp_path / "flat.json")
    return tmp_path / "flat.json"


def on_tube(count=40):
    """Return taxels 0.5 mm above the tube of the plan, and their outward directions."""
    angle, height = 2.4 * np.arange(count), np.linspace(0.02, LENGTH - 0.02, count)
    outward = np.column_stack((np.cos(angle), np.sin(angle), 0 * angle))
    return (RADIUS + 5e-4) * outward + np.column_stack((0 * height, 0 * height, height)), outward


@pytest.mark.parametrize("name", WRITABLE)
def test_export_writes_a_file_of_the_format(flat, tmp_path, capsys, name):
    """Code 0, the bytes, one line that states the form of the ids, empty stderr and no other file."""
    out = tmp_path / "out"
    assert main(["export", str(flat), "--to", name, "-o", str(out)]) == 0
    assert out.read_bytes() == FORMATS[name].write(FLAT)
    text, err = capsys.readouterr()
    assert err == "" and text.count("\n") == 1 and FORMATS[name].labels in text and "9 taxels in 2 patches" in text
    assert {p.name for p in tmp_path.iterdir()} == {"flat.json", "out"}


def test_export_prints_the_worst_warning_of_the_fit(tmp_path, capsys):
    """The formats of other programs have no warnings; notes are not repeated."""
    kinds = (("a", "note"), ("flat", "warning"), ("undercut", "warning"))
    note, *others = (Warning(code, severity, f"About {code}.") for code, severity in kinds)
    line = "skin-calib: warning: forearm: the calibration states 2 warnings, the worst: About undercut. [undercut]\n"
    for warnings, expected in (((note, *others), line), ((note,), "")):
        save_calibration(small_calibration(patches=(boards(),), warnings=warnings), tmp_path / "c.json")
        assert main(["export", str(tmp_path / "c.json"), "--to", "csv", "-o", str(tmp_path / "out.csv")]) == 0
        assert capsys.readouterr().err == expected


def test_export_takes_patches_by_name(flat, tmp_path, capsys):
    """One or several; the error for an unknown one lists the existing ones."""
    out = tmp_path / "out.csv"
    assert main(["export", str(flat), "--to", "csv", "-o", str(out), "--patch", "boards"]) == 0
    assert read_taxels(out).labels == ("h0", "h1")
    words = ["export", str(flat), "--to", "csv", "-o", str(out), "--patch"]
    assert main([*words, "boards", "--patch", "flower"]) == 0
    assert len(read_taxels(out).labels) == 9
    capsys.readouterr()
    assert_refused(capsys, 1, 'the calibration has no patch "bord"; it has "flower", "boards"', *words, "bord")


def test_failed_export_leaves_the_old_file(tmp_path, capsys):
    """A curved patch as a planar surface, an invalid or missing calibration: code 1, one line, unchanged file."""
    save_calibration(small_calibration(patches=(sheet(2, 6, 0.01),)), tmp_path / "bent.json")
    (tmp_path / "broken.json").write_text("{}")
    out = tmp_path / "out"
    out.write_text("old")
    for name, message in (("bent", "is not flat"), ("broken", "broken.json' has"), ("none", "No such file")):
        assert_refused(capsys, 1, message, "export", tmp_path / f"{name}.json", "--to", "rsdf", "-o", out)
    assert out.read_text() == "old" and len(list(tmp_path.iterdir())) == 3


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("import", "a.txt", "-o", "x", "--name", "a"), "--name needs --plan"),
        (("import", "a.txt", "-o", "x.json"), "specify its --plan, or a table OUT.csv"),
        (("import", "a.txt", "-o", "x", "--frame", '{"rotation": 1}'), 'must be {"rotation":'),
        (("import", "a.txt", "-o", "x", "--frame", BROKEN), 'must be {"rotation":'),
        (("import", "a.txt", "-o", "x", "--frame", framed("[0, 0, 1e300]")), "/translation/2 must be at most"),
    ],
)
def test_wrong_call_is_one_line(capsys, words, message):
    """Code 2, what is wrong, and where the help is."""
    assert_wrong_call(capsys, words, message)


@pytest.mark.parametrize("name", READABLE)
def test_import_writes_a_table(flat, tmp_path, capsys, name):
    """A file of export, with or without the name of the format: the same taxels, and one line of output."""
    main(["export", str(flat), "--to", name, "-o", str(tmp_path / "there")])
    capsys.readouterr()
    for words in ((), ("--from", name)):
        assert main(["import", str(tmp_path / "there"), *words, "-o", str(tmp_path / "back.csv")]) == 0
        out, err = capsys.readouterr()
        assert "table of 9 taxels, channels 0 to 8, frame forearm" in out and out.count("\n") == 1
        assert ("warning" in err) == (name == "icub")  # the row of zeros that its reader needs
        there, back = read_taxels(tmp_path / "there"), read_taxels(tmp_path / "back.csv")
        assert (there.positions == back.positions).all() and there.labels == back.labels


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("hello", "is unknown. Supported"),
        (None, "cannot read"),
    ],
)
def test_bad_file_is_refused(tmp_path, capsys, content, message):
    """Code 1, one line, no file."""
    path, out = tmp_path / "a", tmp_path / "out.csv"
    if content is not None:
        path.write_text(content)
    assert_refused(capsys, 1, message, "import", path, "-o", out)
    assert not out.exists()


def test_import_selects_and_transforms(tmp_path, capsys):
    """Taxels of one link of a robot, transformed to a frame; an invalid rotation is an error."""
    content = robot_text({"skin_0": (0.1, 0.0, 0.0), "tool": (0.0, 0.0, 0.0)})
    (tmp_path / "robot.urdf").write_text(content)
    frame = {"rotation": matrix(90).tolist(), "translation": [0, 0, 0.5]}
    words = ["import", str(tmp_path / "robot.urdf"), "-o", str(tmp_path / "a.csv"), "--only", "skin_*", "--frame"]
    assert main([*words, json.dumps(frame)]) == 0
    taxels = read_taxels(tmp_path / "a.csv")
    assert taxels.labels == ("skin_0",) and taxels.frame is None
    assert_allclose(taxels.positions, [[0, 0.1, 0.5]], rtol=0, atol=1e-12)
    capsys.readouterr()
    assert_refused(capsys, 1, "is not a rotation", *words, json.dumps(frame | {"rotation": [[1, 0, 0]] * 3}))


def test_import_on_a_plan_is_a_calibration(folder, capsys):
    """The file is the only skin of the link: outward normals, neighbours, name of the file or of --name."""
    positions, outward = on_tube()
    (folder / "cuff.csv").write_text(csv_text(positions, normals=-outward))
    words = ["import", str(folder / "cuff.csv"), "--plan", str(folder / "tube.plan.json"), "-o", str(folder / "c.json")]
    assert main(words) == 0
    out, err = capsys.readouterr()
    assert out.splitlines()[-1] == f"calibration      {folder / 'c.json'}"
    assert "warning: cuff: " in err and "40 of 40 normals that point inwards" in err
    (patch,) = load_calibration(folder / "c.json").patches
    assert (patch.name, patch.kind) == ("cuff", "imported") and (patch.taxels.positions_link == positions).all()
    assert ((patch.taxels.normals_link * outward).sum(axis=1) > 0.99).all() and any(patch.taxels.neighbours)
    assert main([*words, "--name", "band", "--only", "1*"]) == 0
    (patch,) = load_calibration(folder / "c.json").patches
    assert patch.name == "band" and patch.taxels.ids[:3] == ("band.1", "band.10", "band.11")


@pytest.mark.slow
def test_wrong_frame_is_an_error_whose_suggestion_works(folder, capsys):
    """The skin has a unique pose on the link: the frame in the message is accepted unchanged."""
    positions, _ = on_tube(60)
    positions = positions[positions[:, 0] > -0.01]
    turned = positions @ matrix(30, "x").T + (0.2, 0.1, 0.0)
    (folder / "cuff.csv").write_text(csv_text(turned))
    words = ["import", str(folder / "cuff.csv"), "--plan", str(folder / "tube.plan.json"), "-o", str(folder / "c.json")]
    assert_refused(capsys, 1, "off the mesh on average", *words)
    assert not (folder / "c.json").exists()
    main(words)
    message = capsys.readouterr().err
    start = message.index('{"rotation"')
    proposal, _ = json.JSONDecoder().raw_decode(message[start:])
    assert main([*words, "--frame", json.dumps(proposal)]) == 0
    (patch,) = load_calibration(folder / "c.json").patches
    off = np.hypot(*patch.taxels.positions_link[:, :2].T) - RADIUS
    assert np.abs(off).max() < 2e-3


def test_import_on_a_plan_is_refused_in_a_line(folder, capsys):
    """An invalid plan, and an invalid name of a patch."""
    (folder / "cuff.csv").write_text(csv_text(on_tube()[0]))
    words = ["import", folder / "cuff.csv", "-o", folder / "c.json", "--plan"]
    assert_refused(capsys, 1, "is not a valid plan", *words, write_plan(folder, "bad", unit="inch"))
    assert_refused(capsys, 1, "cannot be a skin of", *words, folder / "tube.plan.json", "--name", "a\nb")
    assert not (folder / "c.json").exists()


REPLACING = {  # call that would replace one of its other files, exit code, name of the file
    "export by a link": ("export f.json --to csv -o link.csv", 2, "f.json"),
    "import on a plan": ("import t.csv --plan tube.plan.json -o tube.plan.json", 2, "tube.plan.json"),
    "fit over the mesh": ("fit tube.plan.json -o tube.ply", 2, "tube.ply"),
    "fit twice": ("fit tube.plan.json -o new --report new", 2, "new"),
    "show": ("show f.json --picture f.json", 2, "f.json"),
    "response": ("response f.json m.csv -o m.csv", 2, "m.csv"),
    "replay twice": ("replay f.json r.csv -o new --picture new", 2, "new"),
}


NAMED = {  # call that would replace a file that its calibration, plan or robot names, and this document
    "export over a mesh elsewhere": ("export c.json --to ply -o sub/copy.ply", "c.json"),
    "export over a source": ("export robot/tube.calibration.json --to csv -o t.csv", "robot/tube.calibration.json"),
    "export of a robot": ("export robot --to mjcf -o tube.plan.json", "robot"),
    "touches over taxels": ("touches tube.plan.json touches.csv --refine -o t.csv", "tube.plan.json"),
    "import over taxels": ("import m.csv --plan tube.plan.json -o t.csv", "tube.plan.json"),
}


@pytest.fixture(scope="module")
def cuff(tmp_path_factory):
    """A folder with a plan of an imported skin, its calibration, and the same in the folder of a robot."""
    folder = tmp_path_factory.mktemp("cuff")
    save_mesh(cylinder(around=24, along=8), folder / "tube.ply")
    plan = write_plan(folder, "tube", skins=[{"name": "cuff", "kind": "imported", "file": "t.csv"}])
    (folder / "t.csv").write_text(csv_text(on_tube()[0]))
    (folder / "sub").mkdir()
    (folder / "robot").mkdir()
    assert main(["fit", str(plan), "-o", str(folder / "robot")]) == 0
    shutil.copy(folder / "robot" / "tube.calibration.json", folder / "c.json")
    shutil.copy(folder / "tube.ply", folder / "sub" / "copy.ply")
    return folder


@pytest.mark.parametrize("case", NAMED)
def test_nothing_replaces_what_the_files_of_the_call_name(cuff, monkeypatch, capsys, case):
    """The mesh of a calibration is lost otherwise: its taxels can have the same name as a point cloud."""
    words, document = NAMED[case]
    monkeypatch.chdir(cuff)
    before = {path: path.read_bytes() for path in cuff.rglob("*") if path.is_file()}
    capsys.readouterr()
    assert_refused(capsys, 2, f" would replace a file that {document} names. Choose another file.", *words.split())
    assert {path: path.read_bytes() for path in cuff.rglob("*") if path.is_file()} == before


def test_plan_in_the_folder_of_a_fit_is_not_replaced(folder, monkeypatch, capsys):
    """A folder as an argument stands for the plans in it."""
    monkeypatch.chdir(folder)
    before = (folder / "tube.plan.json").read_bytes()
    assert_refused(capsys, 2, " would replace tube.plan.json", "fit", ".", "-o", "tube.plan.json")
    assert (folder / "tube.plan.json").read_bytes() == before


def test_results_of_earlier_calls_are_replaced(folder, monkeypatch, capsys):
    """They are no source of the calibration."""
    monkeypatch.chdir(folder)
    assert main(["fit", "tube.plan.json", "-o", "c.json"]) == 0
    for _ in range(2):
        assert main(["export", "c.json", "--to", "ply", "-o", "taxels.ply"]) == 0


@pytest.mark.parametrize("case", REPLACING)
def test_nothing_replaces_what_the_call_needs(folder, monkeypatch, capsys, case):
    """Under any path: a calibration is not lost if its name is given twice."""
    words, code, name = REPLACING[case]
    save_calibration(FLAT, folder / "f.json")
    (folder / "t.csv").write_text(csv_text(on_tube()[0]))
    (folder / "m.csv").write_text("reading,force\n0,0\n1,1\n2,2\n")
    (folder / "r.csv").write_text("time,0,1,2,3,4,5,6,7,8\n0,0,0,0,0,0,0,0,0,0\n")
    (folder / "sub").mkdir()
    (folder / "link.csv").symlink_to("f.json")
    monkeypatch.chdir(folder)
    before = {path: path.read_bytes() for path in folder.iterdir() if path.is_file()}
    assert_refused(capsys, code, f" would replace {name}, which the same call uses", *words.split())
    assert {path: path.read_bytes() for path in folder.iterdir() if path.is_file()} == before


def test_responses_go_into_the_calibration_itself(folder, capsys):
    """This file may be read and written: the old one stays until the new one is complete."""
    save_calibration(FLAT, folder / "f.json")
    (folder / "m.csv").write_text("".join(["reading,force\n", *(f"{k},{2 * k}\n" for k in range(20))]))
    assert main(["response", str(folder / "f.json"), str(folder / "m.csv"), "-o", str(folder / "f.json")]) == 0
    assert_allclose(load_calibration(folder / "f.json").response.newtons([3.0]), [6.0])
