"""Recordings of many robots on several processes: a worker that is killed loses nothing."""

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
