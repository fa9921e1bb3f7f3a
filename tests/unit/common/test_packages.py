"""Advice about a package that is missing: in Blender there is no pip command, but a zip with the packages."""

import sys
import tomllib
from pathlib import Path
from types import ModuleType

import pytest

from skin_calib_addon.common.packages import IN_ZIP, how_to_install

ROOT = Path(__file__).parents[3]


@pytest.mark.parametrize("module", IN_ZIP)
def test_advice_fits_the_place(monkeypatch, module):
    """Each package is in the zip files and in the extra."""
    monkeypatch.setitem(sys.modules, "bpy", ModuleType("bpy"))
    inside = how_to_install(module)
    assert "Get Extensions > Install from Disk" in inside and "pip" not in inside and sys.executable in inside
    monkeypatch.delitem(sys.modules, "bpy")
    assert how_to_install(module) == "pip install 'skin-calib[author]'"
    wheels = tomllib.loads((ROOT / "blender_manifest.toml").read_text())["wheels"]
    assert sum(f"/{IN_ZIP[module]}-" in wheel for wheel in wheels)
    extra = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]["author"]
    assert any(name.startswith(IN_ZIP[module]) for name in extra)
