"""Pictures without OpenGL: a PNG with matplotlib, a clear message without it."""

import builtins
import dataclasses
import os
import subprocess
import sys
from pathlib import Path

import matplotlib.colors
import numpy as np
import pytest
from matplotlib.image import imread

from skin_calib_addon.common.errors import SkinCalibError
from skin_calib_addon.common.warnings import Place, Warning
from skin_calib_addon.pictures import calibration as calibration_picture
from skin_calib_addon.pictures.calibration import NOTE_COLOUR, draw_calibration, look_at
from skin_calib_addon.pipeline import calibrate
from skin_calib_addon.plan import plan_from
from tests.samples import boards, plane, small_calibration
from tests.shapes import cylinder
from tests.unit.commands.test_cli import SHEET

ROOT = Path(__file__).parents[3]
TUBE = {"kind": "tube", "n": 5, "lines": 10, "axis": {"point": [0, 0, 0], "direction": [0, 0, 1]}, "margin": 0.003}
FACE = {"kind": "patch", "n": 5, "lines": 5, "normal": [0, 0, 1]}


@pytest.fixture(autouse=True)
def coarse(monkeypatch):
    """Surfaces of few faces."""
    monkeypatch.setattr(calibration_picture, "QUAD_COUNTS", (10, 20))


def calibrated(mesh, grid, skins=(SHEET | {"name": "s"},)):
    """Return a complete calibration made from a mesh."""
    head = {"format": "skin-plan", "version": 1, "link": "link", "mesh": "m.ply", "unit": "m"}
    return calibrate(plan_from(head | {"grid": grid, "skins": list(skins)}), mesh)


def read_png(path):
    """Return pixels from 0 to 1, shape (height, width, 3)."""
    assert Path(path).read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
    return imread(path)[..., :3]


def drawn(pixels):
    """Return the fraction of the pixels of each panel that are not white."""
    height, width, _ = pixels.shape
    panels = np.split(pixels, width // height, axis=1)
    return [float((panel.min(axis=2) < 0.97).mean()) for panel in panels]


@pytest.mark.slow
def test_picture_of_a_fit_has_three_panels(tmp_path):
    """Cover, error and taxels are side by side, each with a shape and its own colours."""
    result = calibrated(cylinder(around=24, along=8), TUBE)
    draw_calibration(result.calibration, tmp_path / "p.png", result.cover)
    pixels = read_png(tmp_path / "p.png")
    assert pixels.shape == (550, 1650, 3)
    assert min(drawn(pixels)) > 0.15
    colourful = np.ptp(pixels, axis=2) > 0.3
    mesh, error, taxels = (part.mean() for part in np.split(colourful, 3, axis=1))
    assert mesh < 0.01 and error > 0.15 and taxels > 0.005


def test_picture_is_the_same_again(tmp_path):
    """The same calibration gives the same PNG, whatever its name, without date, name of the program and error panel."""
    for name in ("a.png", "b.unknown"):
        draw_calibration(small_calibration(), tmp_path / name)
    assert read_png(tmp_path / "a.png").shape == (550, 550, 3)
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.unknown").read_bytes()
    assert b"matplotlib" not in (tmp_path / "a.png").read_bytes()


@pytest.mark.parametrize(
    "calibration",
    [small_calibration(patches=()), small_calibration(surfaces=(plane(),), patches=(boards(),))],
    ids=["no patches", "boards"],
)
def test_picture_needs_no_sheet(tmp_path, calibration):
    """A surface alone, and rigid boards without strain, can be drawn."""
    draw_calibration(calibration, tmp_path / "p.png")
    assert drawn(read_png(tmp_path / "p.png"))[0] > 0.05


def test_picture_lists_warnings_and_marks_their_places(tmp_path):
    """Below the panels, numbered, in their own colour; the same number is at the place. Twelve at most."""
    calibration = small_calibration()
    place = Place((0.035, 0.0, 0.15))
    text = "The surface is 6.2 mm off the mesh at a place that is described by so many words that the line is wrapped."
    one = Warning("off-mesh", "warning", text, place, 6.2e-3, "Move the planes.")
    draw_calibration(dataclasses.replace(calibration, warnings=(one,)), tmp_path / "one.png")
    draw_calibration(dataclasses.replace(calibration, warnings=(one,) * 13), tmp_path / "many.png")
    draw_calibration(dataclasses.replace(calibration, warnings=(one,) * 14), tmp_path / "more.png")
    single, many, more = (read_png(tmp_path / f"{name}.png") for name in ("one", "many", "more"))
    assert single.shape[1] == 550
    brown = np.abs(single - matplotlib.colors.to_rgb(NOTE_COLOUR)).max(axis=2) < 0.1
    rows, columns = np.nonzero(brown)
    assert (rows > 550).any() and (rows < 500).any() and columns.max() < 540, (
        "text below, a mark above, nothing cut off"
    )
    assert many.shape[0] > single.shape[0] + 200 and more.shape == many.shape


@pytest.mark.slow
def test_picture_needs_no_window_and_no_opengl(tmp_path):
    """A process without a display uses neither pyplot nor OpenGL, and does not change the settings of matplotlib."""
    code = f"""
import sys, matplotlib
from tests.samples import small_calibration
from skin_calib_addon.pictures.calibration import draw_calibration
before = matplotlib.rcParams.copy()
draw_calibration(small_calibration(), {str(tmp_path / "p.png")!r})
found = {{"matplotlib.pyplot", "OpenGL", "bpy", "gpu"}} & set(sys.modules)
assert not found, found
assert dict.__eq__(matplotlib.rcParams, before)
"""
    environment = {k: v for k, v in os.environ.items() if k not in ("DISPLAY", "WAYLAND_DISPLAY")}
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert read_png(tmp_path / "p.png").shape == (550, 550, 3)


def test_missing_matplotlib_is_one_line(tmp_path, monkeypatch):
    """The message says what to install; no file is written."""

    def without(name, *rest, **more):
        if name.startswith("matplotlib"):
            raise ImportError(f"No module named {name!r}")
        return imported(name, *rest, **more)

    imported = builtins.__import__
    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(SkinCalibError, match=r"a picture needs matplotlib, .*: pip install 'skin-calib\[picture\]'"):
        draw_calibration(small_calibration(), tmp_path / "p.png")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("normals", [[(0, 0, 1.0)], [(1.0, 0, 0), (-1.0, 0, 0)], [(0.6, 0, 0.8), (0.8, 0, 0.6)]])
@pytest.mark.parametrize("along", [(0, 1.0, 0), (0, 0, 1.0), (1.0, 0, 0)])
def test_camera_is_a_right_handed_frame(normals, along):
    """It is for a view along the axis, across it, or to both sides."""
    axes = look_at(np.array(normals), np.array(along)).axes
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), rtol=0, atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(axes), 1, rtol=1e-12)
