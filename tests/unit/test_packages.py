"""What strangers install: names, types and licences of the wheel, contents and bytes of the zips for Blender."""

import importlib.util
import re
import shutil
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest

import skin_calib_addon

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
        ours = "skin_calib_addon/messages/skin_calib_msgs"
        assert {f"{ours}/package.xml", f"{ours}/CMakeLists.txt", f"{ours}/msg/SkinFrame.msg"} <= {*names}
        assert "skin_calib_addon/messages/ros_template/package.xml.in" in names
        assert not [n for n in names if "blender" in n or n.startswith(("operators", "panels", "tests"))]
        assert not [n for n in names if n.endswith(".py") and b"GPL" in wheel.read(n)]


@pytest.fixture(scope="module")
def builder():
    """The script that makes the zips."""
    spec = importlib.util.spec_from_file_location("make_extension", ROOT / "scripts" / "make_extension.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_each_platform_has_its_wheels(builder):
    """SciPy and libigl for two Pythons, four packages for all; no wheel of the manifest is of no platform."""
    manifest = tomllib.loads((ROOT / "blender_manifest.toml").read_text())
    assert sorted(manifest["platforms"]) == sorted(builder.PIP_PLATFORMS)
    used = set()
    for platform in manifest["platforms"]:
        wheels = builder.wheels_for(platform)
        used |= {*wheels}
        names = sorted(wheel.split("-")[0] for wheel in wheels)
        assert names == ["libigl"] * 2 + ["pycollada", "python_dateutil"] + ["scipy"] * 2 + ["threadpoolctl", "trimesh"]
    assert used == {Path(wheel).name for wheel in manifest["wheels"]}


def test_zip_does_not_depend_on_the_times_and_the_order_of_its_files(builder, tmp_path):
    """Two builds of the same files are equal."""
    for k, names in enumerate((("a.py", "b.whl"), ("b.whl", "a.py"))):
        with zipfile.ZipFile(tmp_path / f"{k}.zip", "w") as archive:
            for name in names:
                archive.writestr(zipfile.ZipInfo(name, (2020 + k, 1, 1, 0, 0, 0)), name * 99)
        builder.rewrite_with_fixed_times(tmp_path / f"{k}.zip")
    assert (tmp_path / "0.zip").read_bytes() == (tmp_path / "1.zip").read_bytes()
    with zipfile.ZipFile(tmp_path / "0.zip") as archive:
        assert archive.namelist() == ["a.py", "b.whl"] and archive.read("a.py") == b"a.py" * 99


def test_bill_of_materials_names_each_wheel_with_its_licence(builder, tmp_path, monkeypatch):
    """Name, version, hash and licence, from the metadata of the wheel; texts of licences are copied."""
    wheel = "thing-1.2-py3-none-any.whl"
    (tmp_path / "wheels").mkdir()
    with zipfile.ZipFile(tmp_path / "wheels" / wheel, "w") as archive:
        archive.writestr("thing-1.2.dist-info/METADATA", "Name: thing\nLicense-Expression: MIT\n")
        archive.writestr("thing-1.2.dist-info/licenses/LICENSE", "text")
        archive.writestr("thing/data/LICENSE", "of another")
    monkeypatch.setattr(builder, "ROOT", tmp_path)
    builder.copy_licences(tmp_path / "wheels" / wheel, tmp_path / "out")
    assert [p.read_text() for p in (tmp_path / "out" / "thing").iterdir()] == ["text"]
    ours, other = builder.bill_of([wheel], "0.1.0")["packages"]
    assert ours["name"] == "skin-calib" and (other["name"], other["versionInfo"]) == ("thing", "1.2")
    assert other["licenseComments"] == "MIT" and len(other["checksums"][0]["checksumValue"]) == 64


def test_version_is_the_same_everywhere():
    """Package, extension, citation and changelog."""
    manifest, citation, changes = (
        (ROOT / n).read_text("utf-8") for n in ("blender_manifest.toml", "CITATION.cff", "CHANGELOG.md")
    )
    named = [re.search(r'^version = "(.+)"$', manifest, re.M)[1], re.search(r"^version: (.+)$", citation, re.M)[1]]
    named += re.findall(r"^## (.+)$", changes, re.M)[:1]
    assert named == 3 * [skin_calib_addon.__version__]
