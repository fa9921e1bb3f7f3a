"""A real Blender: its window driven by mouse and keys, and its command line, with separate preferences."""

import importlib.util
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from tests.blender.test_extension_zip import PLATFORMS

pytestmark = pytest.mark.window

ROOT = Path(__file__).resolve().parents[2]
TOOLS = ROOT.parent / "shared" / "blender"
SAMPLES = ROOT / "sample_scenes"
DATA = ROOT.parent / "shared" / "data"
REAL = {
    "limb": DATA / "meshes" / "hrp4c_r_wrist_y.stl",
    "sole": DATA / "robots" / "g1_description" / "meshes" / "left_ankle_roll_link.STL",
    "robot": DATA / "robots" / "g1_description" / "g1_29dof_rev_1_0.urdf",
}


@pytest.fixture(scope="session")
def blender():
    """Return the command that runs Blender with a window; skip with a reason if it is missing."""
    if not (TOOLS / "gui-blender").exists():
        pytest.skip("the Blender with a window is missing: ../shared/blender")
    done = subprocess.run([TOOLS / "gui-blender", "--version"], cwd=ROOT, capture_output=True, text=True)
    if done.returncode:
        pytest.skip(f"the Blender with a window does not start: {' '.join(done.stderr.split())}")
    return TOOLS / "gui-blender"


@pytest.fixture(scope="session")
def archive(blender, tmp_path_factory):
    """Return the zip for this Blender, whose Python has its own SciPy and trimesh."""
    if importlib.util.find_spec("bpy") is None:
        pytest.skip("no module bpy here, whose builder makes the zip; pip install '.[blender]' brings it")
    words = [sys.executable, "scripts/make_extension.py", "--platform", PLATFORMS["linux"], "--without-wheels"]
    made = subprocess.run(words, cwd=ROOT, check=True, capture_output=True, text=True)
    return Path(shutil.copy(ROOT / made.stdout.splitlines()[-1], tmp_path_factory.mktemp("archive")))


def drive(archive, out, size, driver, *arguments, blend=None, timeout=900, folder=None):
    """Run a driver in the window, with the extension in ``archive`` if there is one.

    Its screenshots go to ``out``, and it sees the files of ``folder``.
    """
    words = ["--size", size, "--out", out, "--timeout", timeout]
    words += [] if archive is None else ["--install", archive]
    words += [] if blend is None else ["--blend", blend]
    command = [TOOLS / "drive-gui", *words, Path(__file__).with_name(driver), *arguments]
    environment = os.environ if folder is None else os.environ | {"GUI_BLENDER_BIND": str(folder)}
    done = subprocess.run(
        [*map(str, command)], cwd=ROOT, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )
    assert done.returncode == 0, f"{done.stdout}\nscreenshots are in {out}"


# Size of the pictures that are compared [pixel]. Larger: a changed label fails the test.
COARSE_SIZE = (70, 87)
# Mean difference of two pictures, and difference of at most 4 % of their pixels [levels of 255].
MAX_MEAN_DIFFERENCE = 5.0
MAX_DIFFERENCE = 40.0
DRIVERS = [
    ("drive_fit.py", "wrist", "1200x1300"),
    ("drive_live.py", "wrist", "1200x1300"),
    ("drive_link.py", "wrist", "1200x1300"),
    ("drive_cut.py", "wrist", "1200x1300"),
    ("drive_planes.py", "wrist", "1200x1300"),
    ("drive_skin.py", "wrist", "1200x1300"),
    ("drive_paint.py", "sole", "1300x1500"),
    ("drive_inspect.py", "wrist", "1200x1300"),
    ("drive_touches.py", "wrist", "1200x1300"),
    ("drive_taxels.py", "wrist", "1200x1300"),
    ("drive_imported.py", "wrist", "1200x1300"),
    ("drive_waits.py", "wrist", "1200x1300"),
    ("drive_film.py", "wrist", "800x900"),
    ("drive_widths.py", "wrist", "1200x1300"),
    ("drive_import.py", "", "1600x900"),  # Blender's start
    ("drive_frame.py", "", "1000x1150"),
]


@pytest.mark.parametrize(
    "driver, sample, size",
    [pytest.param(*row, marks=() if row[0] == "drive_fit.py" else pytest.mark.nightly) for row in DRIVERS],
)
def test_window(archive, driver, sample, size, tmp_path):
    """Every step of the driver has its effect in the window."""
    drive(archive, tmp_path, size, driver, blend=SAMPLES / f"{sample}.blend" if sample else None)


@pytest.mark.nightly
def test_window_of_a_robot(archive, tmp_path):
    """All links of the Unitree G1 are imported and listed; one is proposed and fitted; Esc stops the others."""
    urdf = REAL["robot"]
    if not urdf.exists():
        pytest.skip(f"{urdf.name} is not on this machine")
    scene = SAMPLES / "wrist.blend"
    drive(archive, tmp_path, "1600x900", "drive_robot.py", urdf, blend=scene, timeout=1800, folder=urdf.parent)


@pytest.mark.nightly
@pytest.mark.parametrize("part", REAL)
def test_tutorial_of_real_links(archive, part, tmp_path):
    """Every step of docs/tutorial/real_links.md has the effect that the page states."""
    path = REAL[part]
    if not path.exists():
        pytest.skip(f"{path.name} is not on this machine")
    drive(archive, tmp_path, "1000x1150", "drive_real_links.py", part, path, timeout=1800, folder=path.parent)


def test_first_steps_look_as_in_the_manual(archive, tmp_path):
    """From the zip to an exported calibration; each picture is close to that of docs/tutorial/blender.md."""
    image = pytest.importorskip(
        "PIL.Image", reason="Pillow, which compares pictures, is not installed; '.[picture]' installs it"
    )
    drive(None, tmp_path, "1000x1150", "drive_steps.py", archive, folder=archive.parent)
    pictures = sorted((ROOT / "docs" / "steps").glob("*.png"))
    assert len(pictures) == 6
    for path in pictures:
        kept, shot = image.open(path).convert("RGB"), image.open(tmp_path / path.name).convert("RGB")
        coarse = [np.asarray(one.resize(COARSE_SIZE), float) for one in (kept, shot)]
        off = np.abs(coarse[0] - coarse[1]).max(axis=2)
        assert off.mean() < MAX_MEAN_DIFFERENCE and (off > MAX_DIFFERENCE).mean() < 0.04, (
            f"{path.name}: {off.mean():.1f} levels off"
        )


@pytest.fixture(scope="module")
def installed(blender, archive):
    """Return a function that runs this Blender with the extension."""
    folder = archive.parent
    environment = {**os.environ, "BLENDER_USER_RESOURCES": str(folder / "resources")}
    environment["GUI_BLENDER_BIND"] = str(folder)

    def run(*words):
        command = [*map(str, (blender, *words))]
        return subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True)

    done = run("--command", "extension", "install-file", "--repo", "user_default", "--enable", archive)
    assert done.returncode == 0, done.stdout + done.stderr
    return run


def test_command_line_of_blender_fits_the_scene(installed, tmp_path):
    """``--command skin_calib`` and a batch script give the same file, with the numbers of plain Python."""
    command, batch, plain = (tmp_path / f"{door}.json" for door in ("command", "batch", "plain"))
    scene = SAMPLES / "wrist.blend"
    for done in (
        installed("--background", scene, "--command", "skin_calib", "fit", "-o", command),
        installed("--background", scene, "--python", ROOT / "examples" / "batch_fit.py", "--", "-o", batch),
    ):
        assert done.returncode == 0, done.stdout + done.stderr
        assert "surface to mesh  mean" in done.stdout
    assert command.read_bytes() == batch.read_bytes()
    words = ["-m", "skin_calib_addon", "fit", str(SAMPLES / "wrist.plan.json"), "-o", str(plain)]
    subprocess.run([sys.executable, *words], cwd=ROOT, check=True, capture_output=True)
    ours, theirs = (json.loads(path.read_text())["patches"][0]["taxels"] for path in (command, plain))
    assert ours["id"] == theirs["id"]
    for name in ("position", "normal", "corners"):
        assert_allclose(ours[name], theirs[name], atol=1e-9)  # another NumPy and SciPy round otherwise


def test_command_line_of_blender_ends_with_the_codes(installed, tmp_path):
    """As without Blender, the code is 1 for wrong data and 2 for a wrong call, with one line that states why."""
    out = tmp_path / "out.json"
    done = installed("--background", "--factory-startup", "--command", "skin_calib", "fit", "-o", out)
    assert done.returncode != 0  # factory settings have no extension
    empty = installed("--background", "--command", "skin_calib", "fit", "-o", out)
    assert empty.returncode == 1 and "skin-calib: The scene has no link to fit" in empty.stderr
    no_output = installed("--background", SAMPLES / "wrist.blend", "--command", "skin_calib", "fit")
    assert no_output.returncode == 2 and "-o/--output" in no_output.stderr
    batch = ROOT / "examples" / "batch_fit.py"
    no_output = installed("--background", SAMPLES / "wrist.blend", "--python", batch, "--", "--report", out)
    assert no_output.returncode == 2 and "-o/--output" in no_output.stderr
    assert not out.exists()
