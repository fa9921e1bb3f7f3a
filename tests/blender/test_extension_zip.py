"""The built zip file works in a new Blender: SciPy and trimesh come from its own wheels."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from tests.blender.conftest import ROOT

PLATFORMS = {"linux": "linux-x64", "win32": "windows-x64", "darwin": "macos-arm64"}
SOURCES = ("*.py", "*.toml", "*.json", "LICENSE*")


def zip_of_these_sources(platform):
    """The zip in ``dist/``, built again if it is missing or older than a source."""
    name = platform.replace("-", "_")
    newest = max(path.stat().st_mtime for pattern in SOURCES for path in sources(pattern))
    fresh = [path for path in (ROOT / "dist").glob(f"skin_calib-*-{name}.zip") if path.stat().st_mtime > newest]
    if not fresh:
        words = [sys.executable, "scripts/make_extension.py", "--platform", platform]
        done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True)
        assert done.returncode == 0, done.stdout + done.stderr
        fresh = [ROOT / done.stdout.splitlines()[-1]]
    return fresh[0]


def sources(pattern):
    """Return the files that the zip file consists of."""
    yield from ROOT.glob(pattern)
    for folder in ("skin_calib_addon", "operators", "panels", "scripts"):
        yield from (ROOT / folder).rglob(pattern)


@pytest.fixture
def bare_python(extension, tmp_path):
    """Return a function that runs a script with only Blender's module and NumPy on the path."""
    site = tmp_path / "site"
    site.mkdir()
    packages = Path(np.__file__).parent.parent
    for name in ("bpy", "numpy", "numpy.libs"):
        if (packages / name).exists():
            (site / name).symlink_to(packages / name)
    resources = tmp_path / "resources"
    environment = {
        **{name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "BLENDER"))},
        "PYTHONPATH": str(site),
        "BLENDER_USER_RESOURCES": str(resources),
    }

    def run(*words):
        command = [sys.executable, "-S", *map(str, words)]
        done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True)
        assert done.returncode == 0, done.stdout + done.stderr

    return run


@pytest.mark.slow
@pytest.mark.skipif(sys.platform not in PLATFORMS, reason="no zip is built for this platform")
def test_zip_installs_and_fits_in_a_new_blender(bare_python, tmp_path):
    """It is installed, enabled, fitted and exported with its own libraries; the numbers are those of this Python."""
    out, plain = tmp_path / "out.json", tmp_path / "plain.json"
    script = Path(__file__).with_name("install_and_fit.py")
    archive = zip_of_these_sources(PLATFORMS[sys.platform])
    bare_python(script, archive, ROOT / "sample_scenes" / "wrist.blend", out, tmp_path / "report.json")
    report = json.loads((tmp_path / "report.json").read_text())
    assert report["before"] == {"scipy": False, "trimesh": False, "skin_calib_addon": False}
    assert report["ours"] == ["bl_ext.user_default.skin_calib.skin_calib_addon.pipeline"]
    wheels = str(tmp_path / "resources" / "extensions" / ".local")
    assert report["places"]["scipy"].startswith(wheels) and report["places"]["trimesh"].startswith(wheels)
    assert report["places"]["collada"].startswith(wheels)
    assert not report["places"]["numpy"].startswith(wheels)
    assert f"scipy-{report['version']}-" in (ROOT / "blender_manifest.toml").read_text()

    words = ["-m", "skin_calib_addon", "fit", "sample_scenes/wrist.plan.json", "-o", str(plain)]
    subprocess.run([sys.executable, *words], cwd=ROOT, check=True, capture_output=True)
    ours, theirs = (json.loads(path.read_text()) for path in (out, plain))
    for document in (ours, theirs):  # another SciPy may round otherwise
        document["taxels"] = document["patches"][0].pop("taxels")
        assert len(document["taxels"]["id"]) == 120
    for name in ("position", "normal", "corners"):
        assert_allclose(np.array(ours["taxels"][name]), np.array(theirs["taxels"][name]), atol=1e-9)
    assert ours["mesh"] == theirs["mesh"]
