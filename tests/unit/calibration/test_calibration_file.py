"""Calibration files: they are read back without loss, and a failure keeps the old file."""

import dataclasses
import errno
import json
import os
import re
import signal
import stat
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from skin_calib_addon.calibration import (
    MeshSource,
    Registration,
    Touched,
    check_calibration,
    encode,
    from_document,
    load_calibration,
    save_calibration,
    to_document,
    validate,
)
from skin_calib_addon.common import atomic_file, strict_json
from skin_calib_addon.common.atomic_file import write_bytes_safely
from skin_calib_addon.common.encoding import checksum
from skin_calib_addon.common.errors import CalibrationFormatError, OutputError
from skin_calib_addon.common.mesh_uncertainty import MeshUncertainty
from skin_calib_addon.common.warnings import Place, Warning
from tests.samples import boards, sheet, small_calibration

ROOT = Path(__file__).parents[3]
STEPS = ("open", "fsync", "chmod", "replace")


def test_document_keeps_its_order_and_names():
    """Other programs depend on the names of the members, in this order."""
    document = to_document(small_calibration())
    assert list(document) == [
        *("format", "version", "generator", "units", "link", "mesh", "surfaces", "patches", "response"),
        *("warnings", "x_note", "checksum"),
    ]
    assert list(document["surfaces"][1]) == [
        *("name", "degree", "knots", "control_net", "closed", "errors", "trusted", "x_material"),
    ]
    assert list(document["patches"][1]) == ["name", "kind", "surface", "shape", "pitch", "taxels", "x_ports"]
    assert list(document["patches"][1]["taxels"]) == [
        *("id", "channel", "index", "uv", "position", "normal", "tangent", "corners", "area", "neighbours"),
        *("gap", "tilt"),
    ]
    assert list(document["patches"][0]["taxels"])[-1] == "strain"


UNCERTAIN = np.array([[1e-3, 2e-4, 0.02], [np.nan] * 3, [0.0, 0.0, 0.0]] * 2)
WARNINGS = (
    Warning(
        "off-mesh", "warning", "It is 6.2 mm off.", Place((0.0, 0.0, 0.0), "u-plane 3"), np.float64(6.2e-3), "Cut."
    ),
    Warning("strain", "warning", "Two cells are strained.", Place(skin="sheet", taxels=("s0.1", "s0.0")), 2),
    Warning("parts", "note", "Infinitely many.", value=np.inf),
)


COVARIANCE = ((1e-6, 0.0, 0.0), (0.0, 1e-6, 1e-7), (0.0, 1e-7, 1e-4))


def test_warnings_sigma_and_registration_are_read_back(tmp_path):
    """A row of NaN is null in the file. A value that is not finite is null; integers become floats."""
    patch = sheet(2, 3, 0.01)
    patch = dataclasses.replace(
        patch,
        taxels=dataclasses.replace(patch.taxels, sigma=UNCERTAIN),
        registration=Registration(1e-3, 0.0175, (0.035, 0.0, 0.005)),
        touches=Touched("2026-11-29", "", 9, 1, (1e-3, 0.0), 0.0, COVARIANCE, (0.035, 0.0, 0.005), 2e-3, angle=0.1),
    )
    save_calibration(small_calibration(patches=(patch, boards(6)), warnings=WARNINGS), tmp_path / "c.json")
    document = json.loads((tmp_path / "c.json").read_bytes())
    assert document["patches"][0]["taxels"]["sigma"] == [[1e-3, 2e-4, 0.02], None, [0.0, 0.0, 0.0]] * 2
    assert document["patches"][0]["registration"] == {
        "origin": 1e-3,
        "direction": 0.0175,
        "anchor": [0.035, 0.0, 0.005],
    }
    assert document["patches"][0]["touches"] == {
        "date": "2026-11-29",
        "used": 9,
        "left_out": 1,
        "shift": [1e-3, 0.0],
        "turn": 0.0,
        "covariance": [list(row) for row in COVARIANCE],
        "anchor": [0.035, 0.0, 0.005],
        "along": 2e-3,
        "angle": 0.1,
    }
    assert "sigma" not in document["patches"][1]["taxels"] and "registration" not in document["patches"][1]
    assert document["warnings"][0]["where"] == {"point": [0.0, 0.0, 0.0], "names": "u-plane 3"}
    read = load_calibration(tmp_path / "c.json")
    np.testing.assert_array_equal(read.patches[0].taxels.sigma, UNCERTAIN)
    assert read.patches[0].touches == patch.touches and read.patches[1].touches is None
    assert read.patches[0].registration == patch.registration and read.patches[1].registration is None
    assert read.patches[1].taxels.sigma.shape == (0, 3)
    assert read.warnings == (*WARNINGS[:2], dataclasses.replace(WARNINGS[2], value=None))
    save_calibration(read, tmp_path / "again.json")
    assert (tmp_path / "again.json").read_bytes() == (tmp_path / "c.json").read_bytes()


@pytest.mark.parametrize(
    ("sigma", "message"),
    [
        (np.zeros((5, 3)), r"has shape \(5, 3\), expected \(6, 3\) or \(0, 3\)"),
        (np.zeros(6), "has shape"),
        (-UNCERTAIN, "negative or not finite"),
        (np.where(np.arange(3) == 1, np.nan, np.ones((6, 3))), "negative or not finite"),
        (np.full((6, 3), np.inf), "negative or not finite"),
    ],
)
def test_sigma_of_a_wrong_form_is_refused(sigma, message):
    """Each row has three numbers of at least 0, or is unknown as a whole."""
    with pytest.raises(ValueError, match=message):
        dataclasses.replace(sheet(2, 3, 0.01).taxels, sigma=sigma)


def test_calibration_with_an_error_among_its_warnings_is_not_written(tmp_path):
    """An error makes the result unusable."""
    wrong = Warning("folded", "error", "The surface folds over itself at (0.0, 0.0, 80.0) mm.", advice="Move planes.")
    with pytest.raises(CalibrationFormatError, match="/warnings/0 reports: The surface folds .* Move planes."):
        save_calibration(small_calibration(warnings=(wrong,)), tmp_path / "c.json")
    assert not (tmp_path / "c.json").exists()


def test_file_is_json_with_a_taxel_per_line(tmp_path):
    """Any JSON reader reads the same document, and a changed taxel changes one line per column."""
    path = tmp_path / "c.json"
    save_calibration(small_calibration(), path)
    data = path.read_bytes()
    assert json.loads(data) == to_document(small_calibration())
    assert data.endswith(b"}\n") and b"\r" not in data
    patch = sheet(2, 3, 0.01)
    moved = patch.taxels.positions_link + np.array([[0, 0, 1e-6 * (row == 4)] for row in range(6)])
    taxels = dataclasses.replace(patch.taxels, positions_link=moved)
    changed = encode(to_document(small_calibration(patches=(dataclasses.replace(patch, taxels=taxels), boards(6)))))
    lines = [(a, b) for a, b in zip(data.splitlines(), changed.splitlines(), strict=True) if a != b]
    assert len(lines) == 2 and b"checksum" in lines[1][0]


def test_integers_and_floats_are_normalized():
    """1 instead of 1.0, and 1.0 instead of 1, give the same calibration and the same bytes."""
    document = to_document(small_calibration())
    foreign = json.loads(encode(document))
    foreign["patches"][0]["taxels"]["channel"][2] = 2.0
    foreign["patches"][0]["shape"][0] = 2.0
    foreign["mesh"]["faces"] = 1996.0
    foreign["patches"][0]["taxels"]["normal"][0] = [1, 0, 0]
    foreign["surfaces"][0]["degree"][0] = 2.0
    foreign["surfaces"][0]["errors"]["hausdorff"] = 1
    document["surfaces"][0]["errors"]["hausdorff"] = 1.0
    document["checksum"] = checksum(document)
    ours, theirs = from_document(document), from_document(foreign)
    assert encode(to_document(theirs)) == encode(document)
    assert repr(theirs.mesh) == repr(ours.mesh) and repr(theirs.surfaces[0].errors) == repr(ours.surfaces[0].errors)
    assert repr(theirs.patches[0].shape) == repr(ours.patches[0].shape)


def test_numpy_numbers_are_written(tmp_path):
    """NumPy scalars are written as numbers."""
    mesh = MeshSource("a.stl", "0" * 64, np.int64(5), np.int32(6), MeshUncertainty(1e-4, 0.03))
    save_calibration(small_calibration(mesh=mesh), tmp_path / "c.json")
    assert load_calibration(tmp_path / "c.json").mesh == MeshSource(
        "a.stl", "0" * 64, 5, 6, MeshUncertainty(1e-4, 0.03)
    )


def test_checksum_ignores_layout():
    """White space and the order of members do not change the checksum; a digit does."""
    document = to_document(small_calibration())
    shuffled = dict(reversed(document.items()))
    assert checksum(shuffled) == document["checksum"]
    assert validate(json.loads(json.dumps(shuffled, indent=4))) == ()
    document["link"] = "Forearm"
    assert [finding.code for finding in validate(document)] == ["checksum"]


def test_save_rejects_invalid_calibrations(tmp_path):
    """A calibration with an error is not written, and the old file stays."""
    path = tmp_path / "c.json"
    path.write_bytes(b"old")
    twice = small_calibration(patches=(sheet(2, 3, 0.01), boards(first_channel=5)))
    with pytest.raises(CalibrationFormatError, match=r"'forearm' has one error: /patches/1/taxels/channel/0 repeats 5"):
        save_calibration(twice, path)
    assert path.read_bytes() == b"old" and os.listdir(tmp_path) == ["c.json"]


def test_save_refuses_nan_with_its_place(tmp_path):
    """A NaN in a quality column is named by its pointer."""
    patch = sheet(2, 3, 0.01)
    taxels = dataclasses.replace(patch.taxels, quality={"gap": np.array([0, 0, np.nan, 0, 0, 0])})
    with pytest.raises(CalibrationFormatError, match="/patches/0/taxels/gap/2 must be a finite number, not nan"):
        save_calibration(small_calibration(patches=(dataclasses.replace(patch, taxels=taxels),)), tmp_path / "c.json")
    assert os.listdir(tmp_path) == []


@pytest.mark.parametrize("junk", [{1, 2}, float("nan"), object(), "\ud800"])
def test_save_refuses_free_members_that_are_not_json(junk, tmp_path):
    """Values that JSON cannot represent are an error of one line, also in free members."""
    with pytest.raises(CalibrationFormatError, match="^the calibration of 'forearm' cannot be written as JSON"):
        save_calibration(small_calibration(extra={"x_junk": junk}), tmp_path / "c.json")


def test_save_refuses_free_members_without_their_prefix(tmp_path):
    """A free member cannot replace a standard member."""
    with pytest.raises(CalibrationFormatError, match="must begin with 'x_', not be 'link'"):
        save_calibration(small_calibration(extra={"link": "thigh"}), tmp_path / "c.json")


def test_load_names_count_and_first_finding(tmp_path):
    """The message is one line; the exception has all findings."""
    document = to_document(small_calibration())
    document["link"] = 3
    document["mesh"]["fases"] = document["mesh"].pop("faces")
    path = tmp_path / "c.json"
    path.write_bytes(json.dumps(document).encode())
    with pytest.raises(CalibrationFormatError) as caught:
        load_calibration(path)
    assert str(caught.value) == f"'{path}' has 4 errors; the first error: /link must be a string, not 3 [type]"
    assert [f.pointer for f in caught.value.findings] == ["/link", "/mesh", "/mesh/fases", "/checksum"]
    assert caught.value.findings == check_calibration(path)


def test_load_rejects_paths_that_are_not_files(tmp_path):
    """A missing file, a folder, a pipe, an invalid path: one line each, and no blocking."""
    os.mkfifo(tmp_path / "pipe")
    for name, reason in (
        ("missing.json", "No such file"),
        ("missing/c.json", "No such file"),
        (".", "it is a folder. Name a file"),
        ("pipe", "not a regular file"),
        ("a\0b", "null"),
    ):
        with pytest.raises(CalibrationFormatError, match=reason) as caught:
            load_calibration(tmp_path / name)
        assert "\n" not in str(caught.value)


@pytest.mark.skipif(not os.path.exists("/proc/self/status"), reason="needs a file without size")
def test_file_that_grows_is_not_read_beyond_the_limit(monkeypatch):
    """A file that grows while it is read must not fill the memory."""
    monkeypatch.setattr(strict_json, "MAX_JSON_BYTES", 10)
    assert len(strict_json.read("/proc/self/status")) == 11
    with pytest.raises(CalibrationFormatError, match="has 11 bytes; the limit is 10"):
        load_calibration("/proc/self/status")


def test_write_replaces_whole_file_and_keeps_mode(tmp_path):
    """The file has the new content and the old permissions; no other file is left."""
    path = tmp_path / "c.json"
    path.write_bytes(b"a longer old content")
    path.chmod(0o640)
    write_bytes_safely(path, b"new")
    assert path.read_bytes() == b"new" and stat.S_IMODE(path.stat().st_mode) == 0o640
    assert os.listdir(tmp_path) == ["c.json"]


def test_write_gives_new_files_the_usual_mode(tmp_path):
    """A new file has the default permissions of the user."""
    (tmp_path / "usual").touch()
    write_bytes_safely(tmp_path / "c.json", b"new")
    assert (tmp_path / "c.json").stat().st_mode == (tmp_path / "usual").stat().st_mode


def test_remains_of_killed_programs_are_removed(tmp_path):
    """Only those that nobody can be writing any more, and no file of the user."""
    old, young = tmp_path / ".skin-0123456789abcdef.tmp", tmp_path / ".skin-fedcba9876543210.tmp"
    foreign = tmp_path / ".skin-my-notes.tmp"
    for path in (old, young, foreign):
        path.write_bytes(b"half")
    for path in (old, foreign):
        os.utime(path, (0, time.time() - 120))
    write_bytes_safely(tmp_path / "c.json", b"new")
    assert not old.exists() and young.exists() and foreign.exists()


def test_write_follows_symbolic_links(tmp_path):
    """The target is replaced in its folder; the link stays. The target may be new."""
    (tmp_path / "store").mkdir()
    target, link = tmp_path / "store" / "c.json", tmp_path / "link.json"
    link.symlink_to(target)
    for content in (b"first", b"second"):
        write_bytes_safely(link, content)
        assert link.is_symlink() and target.read_bytes() == content
    assert sorted(os.listdir(tmp_path)) == ["link.json", "store"] and os.listdir(tmp_path / "store") == ["c.json"]


def test_write_names_missing_folder(tmp_path):
    """The message names the folder, which is not created."""
    with pytest.raises(OutputError, match=f"the folder '{tmp_path}/nowhere' does not exist. Create it first"):
        write_bytes_safely(tmp_path / "nowhere" / "c.json", b"")
    assert os.listdir(tmp_path) == []


def test_write_keeps_files_that_are_not_regular(tmp_path):
    """A pipe or a folder is not replaced; the same rule protects devices."""
    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path, tmp_path / "pipe"):
        with pytest.raises(OutputError, match="it is (not a regular file|a folder)\\. Name a file"):
            write_bytes_safely(path, b"")
    assert stat.S_ISFIFO((tmp_path / "pipe").stat().st_mode)


def test_write_respects_protection(tmp_path, monkeypatch):
    """A file or folder without write permission stays unchanged."""
    path = tmp_path / "c.json"
    path.write_bytes(b"old")
    monkeypatch.setattr(os, "access", lambda *_: False)  # root may write anything
    with pytest.raises(OutputError, match="write-protected"):
        write_bytes_safely(path, b"new")
    assert path.read_bytes() == b"old"


@pytest.mark.parametrize("step", STEPS)
@pytest.mark.parametrize("code", [errno.ENOSPC, errno.EIO, errno.EACCES])
def test_write_failing_leaves_old_file(step, code, tmp_path, monkeypatch):
    """A full or broken disk, or a missing permission, at any step: only the complete old file is left."""
    path = tmp_path / "c.json"
    path.write_bytes(b"old")

    def fail(*_, **__):
        raise OSError(code, os.strerror(code))

    monkeypatch.setattr(atomic_file if step == "open" else os, step, fail, raising=step != "open")
    with pytest.raises(OutputError, match=os.strerror(code)):
        write_bytes_safely(path, b"new")
    monkeypatch.undo()
    assert path.read_bytes() == b"old" and os.listdir(tmp_path) == ["c.json"]


def test_write_survives_folder_that_cannot_be_synced(tmp_path, monkeypatch):
    """The file is complete at that time; some file systems cannot sync folders."""
    real = os.fsync

    def fail(handle):
        if stat.S_ISDIR(os.fstat(handle).st_mode):
            raise OSError(errno.EINVAL, "no folders here")
        real(handle)

    monkeypatch.setattr(os, "fsync", fail)
    write_bytes_safely(tmp_path / "c.json", b"new")
    assert (tmp_path / "c.json").read_bytes() == b"new"


def run_write(tmp_path, preparation):
    """Write 'new' over 'old' in a new process, after a line of code."""
    path = tmp_path / "c.json"
    path.write_bytes(b"old")
    code = (
        "import os, resource, signal, sys\n"
        "from skin_calib_addon.common import atomic_file\n"
        f"{preparation}\n"
        "try:\n    atomic_file.write_bytes_safely(sys.argv[1], b'new' * 100_000)\n"
        "except atomic_file.OutputError as error:\n    sys.exit(str(error))\n"
    )
    return subprocess.run([sys.executable, "-c", code, path], cwd=ROOT, capture_output=True, text=True, check=False)


@pytest.mark.parametrize("step", STEPS)
@pytest.mark.parametrize("after", [False, True])
def test_write_killed_leaves_a_whole_file(step, after, tmp_path):
    """After a kill at any step, the file is the complete old one or, after the last step, the complete new one."""
    place = "atomic_file" if step == "open" else "os"
    run = run_write(
        tmp_path,
        f"real = getattr({place}, '{step}', open)\n"
        "def deadly(*given):\n"
        f"    {'real(*given)' if after else 'pass'}\n"
        "    os.kill(os.getpid(), signal.SIGKILL)\n"
        f"{place}.{step} = deadly",
    )
    assert run.returncode == -signal.SIGKILL
    whole = b"new" * 100_000 if step == "replace" and after else b"old"
    assert (tmp_path / "c.json").read_bytes() == whole


def test_write_to_full_disk_leaves_old_file(tmp_path):
    """A disk that is full in the middle of a write: one line; only the complete old file is left."""
    run = run_write(
        tmp_path,
        "resource.setrlimit(resource.RLIMIT_FSIZE, (150_000, 150_000))\nsignal.signal(signal.SIGXFSZ, signal.SIG_IGN)",
    )
    assert run.returncode == 1 and run.stderr.startswith("cannot write") and run.stderr.count("\n") == 1
    assert (tmp_path / "c.json").read_bytes() == b"old" and os.listdir(tmp_path) == ["c.json"]


def test_frames_in_single_precision_are_read_as_unit_frames(tmp_path):
    """Other programs write vectors with seven digits; those of our own files stay as they are, to the bit."""
    calibration, path = small_calibration(), tmp_path / "c.json"
    document = to_document(calibration)
    for patch in document["patches"]:
        for name in ("normal", "tangent"):
            patch["taxels"][name] = np.float32(np.array(patch["taxels"][name]) * (1 + 1e-7)).astype(float).tolist()
    document["checksum"] = checksum({k: v for k, v in document.items() if k != "checksum"})
    path.write_text(json.dumps(document))
    read = load_calibration(path)
    save_calibration(calibration, path)
    same = load_calibration(path)
    for patch, exact, own in zip(read.patches, calibration.patches, same.patches):
        normals, tangents = patch.taxels.normals_link, patch.taxels.tangents_link
        np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1, rtol=0, atol=1e-9)
        np.testing.assert_allclose(np.linalg.norm(tangents, axis=1), 1, rtol=0, atol=1e-9)
        np.testing.assert_allclose((normals * tangents).sum(axis=1), 0, rtol=0, atol=1e-9)
        np.testing.assert_allclose(normals, exact.taxels.normals_link, rtol=0, atol=3e-7)
        np.testing.assert_array_equal(own.taxels.normals_link, exact.taxels.normals_link)
        np.testing.assert_array_equal(own.taxels.tangents_link, exact.taxels.tangents_link)


def test_documentation_has_a_true_checksum():
    """Its example for programs in other languages."""
    page = (Path(__file__).parents[3] / "docs" / "reference" / "calibration.md").read_text("utf-8")
    example = json.loads(re.search(r"For\n\n```json\n(.+)\n```", page)[1])
    assert f"`{checksum(example)}`" in page
    assert f"`{json.dumps(example, sort_keys=True, separators=(',', ':'), ensure_ascii=False)}`" in page
