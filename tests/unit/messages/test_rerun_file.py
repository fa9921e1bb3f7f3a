"""Files for the viewer of Rerun: its own programs accept them, and it draws what is expected."""

import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from scripts import view_picture
from skin_calib_addon.calibration import load_calibration, save_calibration
from skin_calib_addon.cli import main
from skin_calib_addon.messages.rerun_file import RerunView
from skin_calib_addon.runtime import Skin
from tests.samples import small_calibration

DOCS = Path(__file__).resolve().parents[3] / "docs"
WHY = "rerun-sdk is not installed: pip install 'skin-calib[view]'"
# Colours of the parts of the picture: red, green, blue.
PARTS = {
    "mesh": (177, 177, 180),
    "cells": (128, 135, 147),
    "pressed": (187, 30, 30),
    "pressed most": (110, 0, 32),
    "little pressed": (212, 157, 64),
    "nominal": (20, 80, 191),
    "guaranteed": (26, 153, 58),
    "arrow": (70, 200, 235),
}


def rerun(*words):
    """Call the program of Rerun; return what it prints."""
    program = Path(sys.executable).with_name("rerun")
    done = subprocess.run([program, *map(str, words)], capture_output=True, text=True, check=True, timeout=120)
    return done.stdout + done.stderr


@pytest.fixture
def recorded(tmp_path):
    """Write a calibration and a recording of 20 frames, the last ten with a press; return both paths."""
    calibration, recording = tmp_path / "c.json", tmp_path / "r.npz"
    save_calibration(small_calibration(), calibration)
    rows = np.zeros((20, 8))
    rows[10:, 5] = 100.0
    np.savez(recording, time=1.7e9 + 0.01 * np.arange(20), readings=rows)
    return str(calibration), str(recording)


def test_two_recordings_of_a_skin_stay_apart():
    """The viewer merges recordings with the same id: it would show both as one."""
    pytest.importorskip("rerun", reason=WHY)
    calibration = small_calibration()
    views = [RerunView(calibration, Skin(calibration)) for _ in range(2)]
    assert len({view.recording.get_recording_id() for view in views}) == 2


@pytest.mark.slow
def test_rerun_accepts_the_file(recorded, tmp_path, capsys):
    """Each entity has a row for each frame; what does not change is there once."""
    pytest.importorskip("rerun", reason=WHY)
    out = tmp_path / "o.rrd"
    assert main(["replay", *recorded, "--on", "1", "--to", "rerun", "-o", str(out)]) == 0
    assert "warning: the view is without the mesh of the link: forearm.stl is not found" in capsys.readouterr().err
    assert "1 file verified" in rerun("rrd", "verify", out)
    rows = dict.fromkeys(("/link/touched", "/link/contacts", "/link/cop", "/force"), 0)
    for count, entity in re.findall(r"with (\d+) rows.* - (/[\w/]+) - data", rerun("rrd", "print", out)):
        if entity in rows:
            rows[entity] += int(count)
    assert rows == {"/link/touched": 20, "/link/contacts": 20, "/link/cop": 20, "/force": 21}  # 1: how it is drawn


def test_force_that_is_not_known_is_a_gap(recorded, tmp_path):
    """A lost reading in a press: 0 N would be a press that ended."""
    pytest.importorskip("rerun", reason=WHY)
    stored = dict(np.load(recorded[1]))
    stored["readings"][15] = np.nan
    np.savez(recorded[1], **stored)
    out = tmp_path / "o.rrd"
    assert main(["replay", *recorded, "--on", "1", "--to", "rerun", "-o", str(out)]) == 0
    forces = re.findall(r"\[(\d+\.\d|NaN)\]", rerun("rrd", "print", "-vvv", "--entity", "/force", out))
    assert forces == 10 * ["0.0"] + 5 * ["15.0"] + ["NaN"] + 4 * ["15.0"]


def test_calls_that_cannot_work_write_nothing(recorded, tmp_path, monkeypatch, capsys):
    """Without -o, and without the package."""
    with pytest.raises(SystemExit) as caught:
        main(["replay", *recorded, "--to", "rerun"])
    assert caught.value.code == 2 and "--to rerun needs -o OUT" in capsys.readouterr().err
    monkeypatch.setitem(sys.modules, "rerun", None)
    assert main(["replay", *recorded, "--to", "rerun", "-o", str(tmp_path / "o.rrd")]) == 1
    message = "a view of Rerun needs rerun-sdk, which is not installed here: pip install 'skin-calib[view]'"
    assert message in capsys.readouterr().err and not (tmp_path / "o.rrd").exists()


def test_mesh_is_that_of_the_calibration(tmp_path):
    """Found in its unit, next to the calibration; one that has changed is not drawn, and named."""
    from skin_calib_addon.pipeline.sources import matching_mesh

    mesh = Path(view_picture.ROOT / "sample_scenes" / "sole.ply").read_bytes()
    (tmp_path / "sole.ply").write_bytes(mesh)
    plan = view_picture.ROOT / "sample_scenes" / "sole.plan.json"
    (tmp_path / "sole.plan.json").write_bytes(plan.read_bytes())
    assert main(["fit", str(tmp_path / "sole.plan.json"), "-o", str(tmp_path / "c.json")]) == 0
    source = load_calibration(tmp_path / "c.json").mesh
    found = matching_mesh(tmp_path / "sole.ply", source.sha256)
    assert found.sha256 == source.sha256 and 0.2 < np.ptp(found.vertices[:, 0]) < 0.3
    assert matching_mesh(tmp_path / "sole.ply", source.sha256[::-1]) is None


def parts_of(picture):
    """Return fraction [1] of the picture and position [1] of each part, above the plot."""
    pixels = np.asarray(picture.convert("RGB").resize((500, 375)), float)[40:260]
    known = np.array([*PARTS.values(), (255, 255, 255), (0, 0, 0)], float)
    nearest = ((pixels[:, :, None] - known) ** 2).sum(axis=3).argmin(axis=2)
    found = {}
    for k, name in enumerate(PARTS):
        rows, columns = np.nonzero(nearest == k)
        if len(rows):
            found[name] = (len(rows) / nearest.size, columns.mean() / 500, rows.mean() / 375)
    return found


def has_vulkan():
    """Return whether a Vulkan driver is installed, which the viewer needs without a window."""
    return any(Path(folder, "vulkan", "icd.d").is_dir() for folder in ("/usr/share", "/etc"))


def different(found, expected):
    """Return what is missing, or has another size or another position than expected."""
    return {
        name: (found.get(name), part)
        for name, part in expected.items()
        if name not in found
        or found[name][0] != pytest.approx(part[0], rel=0.25)
        or found[name][1:] != pytest.approx(part[1:], abs=0.02)
    }


@pytest.mark.slow
@pytest.mark.skipif(not has_vulkan(), reason="no Vulkan driver: apt install mesa-vulkan-drivers")
def test_viewer_draws_the_picture_of_the_documentation(tmp_path):
    """Without a window: mesh, cells, colours of the forces, polygons and the arrow have their sizes and positions."""
    pytest.importorskip("rerun", reason=WHY)
    expected = parts_of(Image.open(DOCS / "view.png"))
    view_picture.main(tmp_path)
    for _ in range(5):  # on a busy machine the viewer takes the picture before it has read the whole file
        found = parts_of(Image.open(tmp_path / "view.png"))
        if not (wrong := different(found, expected)):
            break
        view_picture.picture(tmp_path / "sole.rrd", tmp_path / "view.png")
    assert not wrong
    assert os.path.getsize(tmp_path / "sole.rrd") > 1e5
