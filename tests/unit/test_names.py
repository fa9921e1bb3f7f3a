"""``import skin_calib`` gives the modules of ``skin_calib_addon``; the wheel has what its licence covers, no more."""

import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

PARTS = {"pyproject.toml", "README.md", "LICENSES", "skin_calib", "skin_calib_addon", "operators", "panels", "tests"}
ROOT = Path(__file__).resolve().parents[2]
SAME = """
import skin_calib, skin_calib.runtime.noise, skin_calib.calibration as calibration, skin_calib_addon
from skin_calib.runtime import Skin, load
from skin_calib_addon.runtime import Skin as same
from skin_calib_addon.runtime import noise
assert Skin is same and skin_calib.runtime.noise is noise and noise.__spec__.name == "skin_calib_addon.runtime.noise"
assert calibration is skin_calib_addon.calibration and skin_calib.__version__ == skin_calib_addon.__version__
try:
    import skin_calib.nothing
except ModuleNotFoundError as error:
    assert error.name == "skin_calib_addon.nothing"
"""


def test_both_names_are_one_package():
    """In a process of its own, without warnings, in which nothing is imported yet."""
    done = subprocess.run([sys.executable, "-W", "error", "-c", SAME], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


@pytest.mark.slow
def test_wheel_has_one_licence_and_types(tmp_path):
    """No file of the Blender part, which is under the GPL; types and schemas are there."""
    copied = tmp_path / "source"  # the build writes into its folder
    shutil.copytree(
        ROOT, copied, ignore=lambda folder, names: {n for n in names if Path(folder) == ROOT and n not in PARTS}
    )
    words = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "-w", tmp_path, copied]
    subprocess.run(words, check=True, capture_output=True)
    with zipfile.ZipFile(next(tmp_path.glob("*.whl"))) as wheel:
        names = wheel.namelist()
        assert {"skin_calib/__init__.py", "skin_calib/py.typed", "skin_calib_addon/py.typed"} <= {*names}
        assert "skin_calib_addon/runtime/noise_schema.json" in names
        assert not [n for n in names if "blender" in n or n.startswith(("operators", "panels", "tests"))]
        assert not [n for n in names if n.endswith(".py") and b"GPL" in wheel.read(n)]
