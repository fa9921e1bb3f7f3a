"""Forces on touch sensors in MuJoCo Warp and in MuJoCo: presses on a whole robot, a plate on the sole of the samples.

    python benchmarks/warp_forces.py FOLDER [--presses 60] [--seeds 4]

FOLDER has the calibrations and ``robot.json``. Many spheres press on taxels at once, each time on others. It needs
``pip install 'skin-calib[simulators]'``. Warp compiles its kernels first, which takes a minute.
"""

import argparse
import contextlib
import io
import sys
import tempfile
from pathlib import Path

import mujoco
import mujoco_warp
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from skin_calib_addon.cli import main as skin_calib  # noqa: E402
from tests.unit.calibration.exchange.test_export_mujoco import sole  # noqa: E402
from tests.unit.calibration.exchange.test_simulators import forces, plate_on, press_apart, with_fingers  # noqa: E402

PLATE_ROWS = range(0, 160, 26)  # taxels below the plate
TOLERANCES = (0.0, None)  # of the solver of Warp; None: its own, 1e-6


def show(what, data, expected, found):
    """Print a row of the table."""
    difference = np.abs(found - expected).max()
    print(f"{what:40} {data.ncon:4} contacts, up to {expected.max():.3f} N, largest difference {difference:.1e} N")


def main(folder, presses, seeds):
    """Print all rows."""
    with tempfile.TemporaryDirectory() as temporary:
        path = Path(temporary) / "robot.xml"
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
            skin_calib(["export", str(folder), "--to", "mjcf", "-o", str(path)])
        model, data = with_fingers(mujoco.MjSpec.from_file(str(path)), presses)
    for seed in range(seeds):
        mujoco.mj_resetData(model, data)
        press_apart(model, data, presses, seed)
        show(f"robot, {presses} spheres, seed {seed}", data, *forces(mujoco_warp, model, data, None))
    for tolerance in TOLERANCES:
        for row, (model, data) in zip(PLATE_ROWS, plate_on(sole(), PLATE_ROWS)):
            what = "its own tolerance" if tolerance is None else f"tolerance {tolerance:g}"
            show(f"plate on taxel {row}, {what}", data, *forces(mujoco_warp, model, data, tolerance))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--presses", type=int, default=60)
    parser.add_argument("--seeds", type=int, default=4)
    given = parser.parse_args()
    main(given.folder, given.presses, given.seeds)
