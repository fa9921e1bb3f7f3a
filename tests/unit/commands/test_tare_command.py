"""``tare``: a recording at rest becomes a file for the runtime, and touches show the order of the boards."""

import numpy as np
import pytest

from skin_calib_addon.calibration import Response, save_calibration
from skin_calib_addon.cli import main
from skin_calib_addon.runtime import load
from tests.samples import plane, small_calibration
from tests.soles import sole_patch

N = 42


@pytest.fixture
def sole(tmp_path):
    """Return the path of a calibration, and that of a recording: one second of rest, then three taxels are pressed."""
    response = Response((0.0, 0.2), (0.0, 4095.0))
    calibration = small_calibration(patches=(sole_patch(),), surfaces=(plane(),), response=response)
    save_calibration(calibration, tmp_path / "sole.calibration.json")
    time, counts = 0.004 * np.arange(700), np.zeros((700, N))
    for k, row in enumerate((30, 4, 17)):
        counts[300 + 100 * k : 350 + 100 * k, row] = 75
    counts = np.maximum(np.rint(counts + 2 * np.random.default_rng(1).normal(size=counts.shape)), 0).astype(np.uint16)
    np.savez(tmp_path / "r.npz", time=time, readings=counts)
    return str(tmp_path / "sole.calibration.json"), str(tmp_path / "r.npz")


def test_touches_are_listed_in_their_order(sole, tmp_path, capsys):
    """The noise is that of the first second; ``show``, ``check`` and ``replay`` read it."""
    noise = str(tmp_path / "sole.noise.json")
    assert main(["tare", *sole, "--rest", "1", "-o", noise]) == 0
    out = capsys.readouterr().out
    assert [line.split()[2].rstrip(",") for line in out.splitlines() if line.startswith("touch")] == [
        "sole.30", "sole.4", "sole.17"
    ]  # fmt: skip
    assert "250 frames" in out and "noise hides up to 2.3 N on a taxel" in out
    assert load(sole[0], noise=noise).noise is not None
    assert main(["show", noise]) == 0 and "hides up to 2.3 N on a taxel" in capsys.readouterr().out
    assert main(["check", noise]) == 0
    assert main(["replay", *sole, "--noise", noise]) == 0
    assert "contacts         3, at most 1 at a time, in 150 frames" in capsys.readouterr().out


def test_pressed_skin_is_no_rest(sole, tmp_path, capsys):
    """All frames count as rest by default; no file is written."""
    noise = tmp_path / "sole.noise.json"
    assert main(["tare", *sole, "-o", str(noise)]) == 1
    assert "are not at rest: the force changes by 1" in capsys.readouterr().err and not noise.exists()


def test_offset_has_to_be_accepted(sole, tmp_path, capsys):
    """The call that accepts it says what it accepted."""
    offset = str(tmp_path / "o.npz")
    with np.load(sole[1]) as file:
        np.savez(offset, time=file["time"][:250], readings=file["readings"][:250] + 20)
    assert main(["tare", sole[0], offset]) == 1
    assert "those of 16" in (said := capsys.readouterr().err) and said.rstrip().endswith("add --accept")
    assert main(["tare", sole[0], offset, "--accept"]) == 0
    assert "warning: the readings at rest are accepted, although they are those of 16" in capsys.readouterr().err


def test_later_frames_below_rest_are_named(sole, tmp_path, capsys):
    """Something pressed all the time at rest, and was taken for an offset."""
    pressed = str(tmp_path / "p.npz")
    with np.load(sole[1]) as file:
        readings = file["readings"].astype(int)
        readings[:250, 9] += 75
        np.savez(pressed, time=file["time"], readings=readings)
    assert main(["tare", sole[0], pressed, "--rest", "1", "--accept"]) == 0
    assert "warning: below_rest in 450 of 450 later frames: something may" in capsys.readouterr().err
    assert main(["tare", *sole, "--rest", "1"]) == 0 and "below_rest" not in capsys.readouterr().err


def test_few_frames_teach_no_noise(sole, tmp_path, capsys):
    """The file has the baseline, and the call warns."""
    few = str(tmp_path / "f.npz")
    with np.load(sole[1]) as file:
        np.savez(few, time=file["time"][:10], readings=file["readings"][:10])
    noise = str(tmp_path / "sole.noise.json")
    assert main(["tare", sole[0], few, "-o", noise]) == 0
    assert "say nothing about the noise" in capsys.readouterr().err
    assert main(["show", noise]) == 0 and "noise     not known" in capsys.readouterr().out


def test_row_without_all_channels_is_refused(sole, tmp_path, capsys):
    """A cut row of a table, and a recording whose times are no numbers: one line, no traceback."""
    path = tmp_path / "cut.csv"
    names = ",".join(f"channel_{k}" for k in range(N))
    path.write_text(f"time,{names}\n0{',1' * N}\n0.1{',1' * (N - 5)}\n")
    assert main(["tare", sole[0], str(path)]) == 1
    assert "cut.csv', readings at rest:" in capsys.readouterr().err
    np.savez(tmp_path / "t.npz", time=np.full(30, np.nan), readings=np.zeros((30, N), int))
    assert main(["tare", sole[0], str(tmp_path / "t.npz"), "--rest", "1"]) == 1
    assert capsys.readouterr().err.count("\n") == 1
