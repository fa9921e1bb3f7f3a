"""What a skin learned at rest is a file: another start gives the same frames; a wrong file changes nothing."""

import json

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from skin_calib_addon.calibration import Response, save_calibration
from skin_calib_addon.common.encoding import checksum
from skin_calib_addon.common.errors import CalibrationFormatError, OutputError
from skin_calib_addon.runtime import Skin, load
from skin_calib_addon.runtime.noise import Noise
from skin_calib_addon.runtime.noise_file import INFINITE, schema
from tests.samples import plane, small_calibration
from tests.soles import sole_patch

N = 42
RNG = np.random.default_rng(0)
REST = np.clip(np.rint(RNG.normal(1, 2, (250, N))), 0, 4095)


def calibration(newtons=0.2):
    """Return the calibration of a sole that counts."""
    return small_calibration(patches=(sole_patch(),), surfaces=(plane(),), response=Response((0.0, newtons)))


@pytest.fixture
def stored(tmp_path):
    """Return the files of a calibration and of its noise; a taxel is dead, another one never clipped."""
    rows = REST.copy()
    rows[:, 3] = np.nan
    rows[:, 7] = RNG.normal(30, 2, 250)
    skin = Skin(calibration())
    skin.tare(rows, accept=True)
    save_calibration(calibration(), tmp_path / "sole.calibration.json")
    skin.save_noise(tmp_path / "sole.noise.json")
    return skin, tmp_path / "sole.calibration.json", tmp_path / "sole.noise.json"


def test_loaded_noise_gives_the_same_frames(stored):
    """Every number of the noise is the same to the bit, and so are frames with light and clear loads."""
    skin, file, noise = stored
    other = load(file, noise=noise)
    for name in Noise.__dataclass_fields__:
        assert_array_equal(getattr(other.noise, name), getattr(skin.noise, name))
    for k, load_on in enumerate((0.0, 0.3, 4.0, 40.0)):
        reading = REST[k] + load_on * (np.arange(N) > 20)
        frames = [s.update(reading, 0.004 * k) for s in (skin, other)]
        assert frames[0].flags == frames[1].flags and frames[0].touched == frames[1].touched
        for name in ("forces", "active", "wrench", "wrench_sigma"):
            assert_array_equal(*(getattr(frame, name) for frame in frames))


def test_noise_after_a_short_tare_is_stored_with_its_baseline(stored):
    """Ten frames move the baseline of the noise; the file has it."""
    skin, file, noise = stored
    skin.tare(REST[:10] + 5, accept=True)
    skin.save_noise(noise)
    reading = REST[11] + 5
    assert_array_equal(load(file, noise=noise).forces(reading), skin.forces(reading))


def test_baseline_without_noise_is_stored(tmp_path):
    """A skin without a tare has none, and one with few frames has its baseline; for both the noise is unknown."""
    for rows, force in ((None, 4.0), (np.full((5, N), 3.0), 3.4)):
        skin = Skin(calibration())
        if rows is not None:
            skin.tare(rows, accept=True)
        skin.save_noise(tmp_path / "few.noise.json")
        other = Skin(calibration())
        other.load_noise(tmp_path / "few.noise.json")
        assert other.noise is None and other.forces(np.full(N, 20.0)) == pytest.approx(force)
        assert "noise_unknown" in other.update(np.full(N, 3.0), 0.0).flags


def test_schema_has_the_fields_of_the_noise():
    """A new field of the noise needs a version of the file; null stands for numbers that are not finite."""
    members = schema()["$defs"]["noise"]["properties"]
    assert list(members) == list(Noise.__dataclass_fields__)
    assert {name for name in members if "limit" in members[name]["$ref"]} == set(INFINITE)


WRONG = {
    "not JSON": (lambda d: None, "syntax"),
    "changed": (lambda d: d["noise"]["sigma"].__setitem__(0, 9.0), "checksum"),
    "short": (lambda d: d["noise"]["mean"].pop(), "length"),
    "no sigma": (lambda d: d["noise"]["sigma"].__setitem__(5, 0.0), "range"),
    "null": (lambda d: d["noise"]["mean"].__setitem__(0, None), "type"),
    "unknown": (lambda d: d.__setitem__("baselines", []), "unknown"),
    "version": (lambda d: d.__setitem__("version", 2), "value"),
}


@pytest.mark.parametrize("name", WRONG)
def test_damaged_files_are_refused(stored, name):
    """The error names the file, the skin keeps what it knew."""
    skin, _, path = stored
    change, code = WRONG[name]
    document = json.loads(path.read_text())
    change(document)
    if code not in ("checksum", "syntax"):
        document["checksum"] = checksum(document)
    path.write_text(json.dumps(document)[: None if code != "syntax" else 100])
    before = skin.noise
    with pytest.raises(CalibrationFormatError, match=path.name) as caught:
        skin.load_noise(path)
    assert code in {finding.code for finding in caught.value.findings} and skin.noise is before


def test_noise_of_another_calibration_is_refused(stored):
    """One number of the response is enough: thresholds in newtons would be wrong."""
    *_, noise = stored
    with pytest.raises(CalibrationFormatError, match="is of another calibration; tare again"):
        Skin(calibration(0.21)).load_noise(noise)


def test_folder_that_does_not_exist_is_an_error(stored, tmp_path):
    """The file is written in one step, or not."""
    with pytest.raises(OutputError):
        stored[0].save_noise(tmp_path / "no" / "sole.noise.json")
