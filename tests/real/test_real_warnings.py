"""Real robot links whose surfaces fold: an error with its place, for planes as for a tolerance."""

import json
from pathlib import Path

import pytest

from skin_calib_addon.cli import main

DATA = (Path(__file__).parents[2] / ".." / "shared" / "data" / "robots" / "g1_description" / "meshes").resolve()

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not DATA.is_dir(), reason=f"no real links here: {DATA}"),
]


@pytest.mark.parametrize(
    "grid", [{"kind": "tube", "n": 20, "lines": 40}, {"kind": "auto", "tolerance": 0.001}], ids=["tube", "auto"]
)
def test_folded_surface_of_a_hip_is_refused(tmp_path, capsys, grid):
    """Its section changes abruptly: exit code 1, one line that says where, and no calibration."""
    plan = {"format": "skin-plan", "version": 1, "link": "left_hip_pitch_link", "unit": "m", "skins": []}
    plan |= {"mesh": str(DATA / "left_hip_pitch_link.STL"), "grid": grid}
    (tmp_path / "hip.plan.json").write_text(json.dumps(plan))
    assert main(["fit", str(tmp_path / "hip.plan.json"), "-o", str(tmp_path / "hip.json")]) == 1
    text = capsys.readouterr().err
    assert "The surface folds over itself at (" in text and ") mm, near u-plane" in text and text.count("\n") == 1
    assert not (tmp_path / "hip.json").exists()
