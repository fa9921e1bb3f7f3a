"""Make the picture of the view in the documentation, without a window: a step on the sole of the samples.

    python scripts/view_picture.py [FOLDER]

It needs ``pip install 'skin-calib[view]'`` and a Vulkan driver, such as Mesa's for a processor (``apt install
mesa-vulkan-drivers``). FOLDER gets the files of the steps, and the picture in its full size. Look at the picture: on a
busy machine the viewer takes it before it has read the whole file.
"""

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from PIL import Image

from skin_calib_addon.calibration import load_calibration
from skin_calib_addon.cli import main as skin_calib

ROOT = Path(__file__).resolve().parents[1]
FRAMES, PERIOD, NOISE = 100, 0.01, 0.02  # of a step; time between two [s]; standard deviation [N]
LOAD, RADIUS = 120.0, 0.04  # of the foot [N], of the pressed part [m]
WINDOW, WIDTH, COLOURS = "1000x750", 1000, 256  # of the viewer, of the picture [pixel]


def record(calibration: Path, rest: Path, step: Path) -> None:
    """Write readings at rest, and those of a step from the middle of the foot to its toes [N]."""
    (patch,) = load_calibration(calibration).patches
    at, rng = patch.taxels.positions_link, np.random.default_rng(0)
    rows = rng.normal(0, NOISE, (2 * FRAMES, len(at)))
    for k in range(FRAMES):
        part = k / FRAMES
        middle = np.array([-0.01 + 0.09 * part, 0.008 * np.sin(6 * part)])
        pressure = np.maximum(1 - np.sum(((at[:, :2] - middle) / (RADIUS, 0.7 * RADIUS)) ** 2, axis=1), 0)
        rows[FRAMES + k] += LOAD * np.cos(np.pi / 2 * part) * pressure / pressure.sum()
    for path, part in ((rest, rows[:FRAMES]), (step, rows[FRAMES:])):
        np.savez(path, time=PERIOD * np.arange(FRAMES), readings=part)


def picture(file: Path, out: Path) -> None:
    """Let the viewer of Rerun draw the first frame of a file."""
    program = Path(sys.executable).with_name("rerun")
    words = [program, file, "--headless", "--window-size", WINDOW, "--screenshot-to", out]
    quiet = os.environ | {
        "RUST_LOG": "error",
        "HOME": str(out.parent),
    }  # no messages in the picture, no user's settings
    subprocess.run(list(map(str, words)), env=quiet, check=True, timeout=300)


def main(folder: Path) -> Path:
    """Write the picture into a folder, and return its path."""
    calibration, noise, rest, step, view, out = (
        folder / name
        for name in ("sole.calibration.json", "sole.noise.json", "rest.npz", "step.npz", "sole.rrd", "view.png")
    )
    for name in ("sole.plan.json", "sole.ply"):
        shutil.copy(ROOT / "sample_scenes" / name, folder)
    assert skin_calib(["fit", str(folder / "sole.plan.json"), "-o", str(calibration)]) == 0
    record(calibration, rest, step)
    assert skin_calib(["tare", str(calibration), str(rest), "-o", str(noise)]) == 0
    words = [str(calibration), str(step), "--noise", str(noise), "--to", "rerun", "-o", str(view)]
    assert skin_calib(["replay", *words]) == 0
    picture(view, out)
    return out


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as temporary:
        made = Image.open(main(Path(sys.argv[1] if sys.argv[1:] else temporary))).convert("RGB")
        small = made.resize((WIDTH, round(made.height * WIDTH / made.width)), Image.Resampling.LANCZOS)
        small.quantize(COLOURS, Image.Quantize.MAXCOVERAGE, kmeans=4).save(ROOT / "docs" / "view.png", optimize=True)
