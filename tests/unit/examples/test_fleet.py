"""Recordings of many robots on several processes: a worker that is killed loses nothing."""

import importlib.util
import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from skin_calib_addon.calibration import save_calibration
from skin_calib_addon.runtime import load
from tests.samples import small_calibration

pytest.importorskip("distributed", reason="the package distributed is not installed")
parquet = pytest.importorskip("pyarrow.parquet", reason="the package pyarrow is not installed")
psutil = pytest.importorskip("psutil")
FLEET = Path(__file__).parents[3] / "examples" / "fleet.py"
ROWS = 5000


@pytest.fixture
def folder(tmp_path):
    """A calibration and six recordings; one is Parquet, one is not readable."""
    import pyarrow

    save_calibration(small_calibration(), tmp_path / "c.json")
    (tmp_path / "in").mkdir()
    for k in range(6):
        table = recording(k)
        np.savetxt(tmp_path / "in" / f"r{k}.csv", np.column_stack(list(table.values())), "%.6g", ",",
                   header=",".join(table), comments="")  # fmt: skip
    parquet.write_table(pyarrow.table(recording(6)), tmp_path / "in" / "r6.parquet")
    (tmp_path / "in" / "bad.csv").write_text("x\n1\n")
    return tmp_path


def recording(seed):
    """Times and readings of eight channels."""
    readings = np.random.default_rng(seed).integers(0, 60, (ROWS, 8)) * (np.arange(ROWS) % 50 > 25)[:, None]
    return {"time": np.arange(ROWS) / 500} | {f"channel_{k}": column for k, column in enumerate(readings.T)}


def started(folder):
    words = [sys.executable, str(FLEET), str(folder / "c.json"), str(folder / "in"), "-o", str(folder / "out")]
    return subprocess.Popen(words, stdout=subprocess.PIPE, text=True)


@pytest.mark.slow
def test_a_killed_worker_loses_nothing(folder):
    """The results are those of one process; a second call computes nothing."""
    process = started(folder)
    first = process.stdout.readline()
    workers = [
        child
        for child in psutil.Process(process.pid).children(recursive=True)
        if any("spawn_main" in word for word in child.cmdline())
    ]
    os.kill(workers[-1].pid, signal.SIGKILL)
    out = first + process.stdout.read()
    assert process.wait(120) == 1 and "\nerror: " in out
    assert "7 computed, 0 up to date, 1 failed" in out
    skin = load(folder / "c.json")
    for k in range(7):
        name = f"r{k}.csv" if k < 6 else "r6.parquet"
        table, expected = parquet.read_table(folder / "out" / f"{name}.parquet"), recording(k)
        found = skin.batch(np.column_stack(list(expected.values())[1:]), expected["time"])
        np.testing.assert_allclose(table["time"], expected["time"], rtol=0, atol=1e-9)
        np.testing.assert_array_equal(table["contacts"], found.contact_counts)
        np.testing.assert_array_equal(np.stack([table[n] for n in ("fx", "fy", "fz")]), found.wrench[:, :3].T)
    again = started(folder)
    assert "0 computed, 7 up to date, 1 failed" in again.communicate(timeout=120)[0]


def written_parquet(path, change):
    import pyarrow

    parquet.write_table(pyarrow.table({name: column[:50] for name, column in recording(6).items()} | change), path)


@pytest.fixture
def fleet():
    """The example as a module."""
    spec = importlib.util.spec_from_file_location("fleet", FLEET)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize(
    ("change", "what"),
    [
        ({"time": np.arange(50).astype("datetime64[ms]")}, "error: the column time of 'r.parquet' is timestamp[ms]"),
        ({"time": 4_000_000 * np.arange(50)}, "warning: readings are 4e+06 s apart (median): time must be in seconds"),
        ({"time": np.arange(50.0)[::-1]}, "warning: the time does not increase in 49 rows"),
        ({"channel_2": np.append(np.zeros(49), np.nan)}, "warning: taxels have no valid force in 1 rows"),
        ({"channel_9": np.zeros(50)}, "warning: 1 columns are not of this skin; the first is channel_9"),
    ],
)
def test_what_is_special_about_a_recording_is_named(fleet, tmp_path, change, what):
    """Times in another unit are refused; missing readings are in the results."""
    save_calibration(small_calibration(), tmp_path / "c.json")
    written_parquet(tmp_path / "r.parquet", change)
    out = tmp_path / "out.parquet"
    count, notes = fleet.computed(tmp_path / "r.parquet", out, tmp_path / "c.json", None)
    assert any(note.startswith(what) for note in notes) and out.exists() == (count == 50)
    if "channel_2" in change:
        assert parquet.read_table(out)["unknown_taxels"].to_pylist() == [0] * 49 + [1]


def test_results_of_a_changed_recording_are_computed_again(fleet, tmp_path):
    """So are damaged ones; a recording without a reading has none."""
    calibration, source, out = (tmp_path / name for name in ("c.json", "r.csv", "out.parquet"))
    save_calibration(small_calibration(), calibration)

    def is_done(rows):
        np.savetxt(source, np.column_stack(list(recording(1).values()))[:rows], "%.6g", ",",
                   header=",".join(recording(1)), comments="")  # fmt: skip
        return fleet.is_done(source, out, calibration, None)

    assert not is_done(40) and fleet.computed(source, out, calibration, None)[0] == 40
    assert fleet.is_done(source, out, calibration, None) and not is_done(41)
    out.write_bytes(b"PAR1")
    assert not fleet.is_done(source, out, calibration, None)
    out.unlink()
    assert not fleet.is_done(source.with_name("deleted.csv"), out, calibration, None)
    assert not is_done(0) and fleet.computed(source, out, calibration, None)[0] == 0 and not out.exists()


def test_wrong_folders_are_refused(fleet, tmp_path, monkeypatch, capsys):
    """Before anything is computed."""
    save_calibration(small_calibration(), tmp_path / "c.json")
    (tmp_path / "in").mkdir()
    for words, what in [(("none", "-o", "out"), "not a folder"), (("in", "-o", "out"), "has no file")]:
        monkeypatch.chdir(tmp_path)
        monkeypatch.setattr(sys, "argv", ["fleet.py", "c.json", *words])
        with pytest.raises(SystemExit):
            fleet.main()
        assert what in capsys.readouterr().err and not (tmp_path / "out").exists()
    written_parquet(tmp_path / "in" / "r.parquet", {})
    monkeypatch.setattr(sys, "argv", ["fleet.py", "c.json", "in", "-o", "in"])
    with pytest.raises(SystemExit):
        fleet.main()
    assert "would be in the folder of the recordings" in capsys.readouterr().err
