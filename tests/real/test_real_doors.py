"""Published taxel files: import on the command line, and export to other programs."""

import io
import json
from contextlib import redirect_stderr

import numpy as np
import pytest
from numpy.testing import assert_allclose

from skin_calib_addon.calibration import load_calibration
from skin_calib_addon.calibration.exchange import READABLE, read_taxels
from skin_calib_addon.calibration.exchange.link_taxels import taxels_of
from skin_calib_addon.cli import main
from tests.real.test_real_skin import MESHES, TAXELS

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not TAXELS.is_dir(), reason=f"no real taxels here: {TAXELS} is missing"),
]

ARM = TAXELS / "raw" / "icub_right_arm_wrong_frame.txt"


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    """Return the file of an arm in a wrong frame, imported with the suggested frame, and the error."""
    folder = tmp_path_factory.mktemp("arm")
    skin = {"name": "none", "kind": "imported", "file": "none"}
    plan = {"format": "skin-plan", "version": 1, "link": "r_upper_arm", "unit": "m", "skins": [skin]}
    plan |= {"mesh": str(MESHES / "icub27_r_upper_arm.stl"), "grid": {"kind": "auto", "tolerance": 5e-4}}
    (folder / "arm.plan.json").write_text(json.dumps(plan))
    out, refusal = folder / "arm.json", io.StringIO()
    words = ["import", str(ARM), "--plan", str(folder / "arm.plan.json"), "--name", "arm", "-o", str(out)]
    with redirect_stderr(refusal):
        assert main(words) == 1
    assert not out.exists()
    text = refusal.getvalue()
    proposal, _ = json.JSONDecoder().raw_decode(text[text.index('{"rotation"') :])
    assert main([*words, "--frame", json.dumps(proposal)]) == 0
    return out, text


def test_arm_in_a_wrong_frame_is_placed_by_the_suggested_frame(arm):
    """The error suggests a frame; with it the taxels are on the link, and the calibration is valid."""
    out, refusal = arm
    assert "is 31.6 mm off the mesh on average, and 0.4 mm in another frame" in refusal
    assert main(["check", str(out)]) == 0
    (patch,) = load_calibration(out).patches
    assert len(patch.taxels.ids) == 350 and np.median(np.abs(patch.taxels.quality["gap"])) < 1e-3
    assert sum(not row for row in patch.taxels.neighbours) < 10


@pytest.mark.parametrize("name", READABLE)
def test_real_taxels_are_exported_and_read_back(arm, tmp_path, name):
    """In all readable formats: equal positions and normals, and channels if the format has them."""
    taxels = taxels_of(load_calibration(arm[0]))
    assert main(["export", str(arm[0]), "--to", name, "-o", str(tmp_path / "there")]) == 0
    assert main(["import", str(tmp_path / "there"), "-o", str(tmp_path / "back.csv")]) == 0
    back = read_taxels(tmp_path / "back.csv")
    assert_allclose(back.positions, taxels.positions, rtol=0, atol=1e-12)
    assert_allclose(back.normals, taxels.normals, rtol=0, atol=1e-12)
    if name not in ("tum", "urdf"):
        assert (back.channels == taxels.channels).all()


def test_mujoco_measures_every_taxel_of_a_real_skin(arm, tmp_path):
    """A sphere on each of 350 taxels: its touch sensor reacts, and its depth is the largest."""
    mujoco = pytest.importorskip("mujoco", reason="MuJoCo is not installed")
    from tests.unit.calibration.exchange.test_export_mujoco import DEPTH, press, with_body

    taxels = taxels_of(load_calibration(arm[0]))
    assert main(["export", str(arm[0]), "--to", "mjcf", "-o", str(tmp_path / "arm.xml")]) == 0
    model, data = with_body(mujoco.MjSpec.from_file(str(tmp_path / "arm.xml")))
    for i, name in enumerate(taxels.ids):
        press(model, data, taxels.positions[i], taxels.normals[i])
        assert data.sensor(name).data[0] > 0
        depth = data.sensor("arm").data.reshape(3, -1)[0]
        assert depth.argmax() == i and 0.8 * DEPTH < depth[i] <= 1.001 * DEPTH
