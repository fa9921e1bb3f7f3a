"""Calculations take one thread of BLAS, and leave the numbers of the process as they were."""

import os
import subprocess
import sys
from pathlib import Path
from threading import Event, Thread

import pytest
from threadpoolctl import ThreadpoolController, threadpool_limits

from skin_calib_addon.geometry.blas_threads import one_blas_thread
from skin_calib_addon.pipeline import calibrate
from skin_calib_addon.plan.file import load_plan

ROOT = Path(__file__).resolve().parents[3]
FIT = """
import sys
from skin_calib_addon.calibration.file import save_calibration
from skin_calib_addon.pipeline import calibrate
from skin_calib_addon.plan.file import load_plan

save_calibration(calibrate(load_plan(sys.argv[1])).calibration, sys.argv[2])
"""


def threads():
    """The number of threads of each BLAS library of this process."""
    return [library["num_threads"] for library in ThreadpoolController().select(user_api="blas").info()]


@pytest.fixture
def two_threads():
    """BLAS has two threads, on every machine."""
    with threadpool_limits(2, user_api="blas"):
        if not threads() or max(threads()) < 2:
            pytest.skip("BLAS has no threads here that can be limited")
        yield


def test_calibration_takes_one_thread_and_restores_their_number(two_threads):
    """In each stage one; afterwards two, as before."""
    before, seen = threads(), []
    calibrate(load_plan(ROOT / "sample_scenes" / "wrist.plan.json"), begin=lambda stage: seen.append(set(threads())))
    assert seen and all(numbers == {1} for numbers in seen)
    assert threads() == before


def test_calls_that_overlap_restore_the_number_at_the_last_end(two_threads):
    """The first of two calls ends while the second goes on with one thread."""
    before, started, end = threads(), Event(), Event()

    @one_blas_thread()
    def second():
        started.set()
        end.wait()

    thread = Thread(target=second)
    with one_blas_thread():
        thread.start()
        started.wait()
    assert set(threads()) == {1}
    end.set()
    thread.join()
    assert threads() == before


def test_error_restores_the_number(two_threads):
    """Also where a calculation fails."""
    before = threads()
    with pytest.raises(ZeroDivisionError), one_blas_thread():
        raise ZeroDivisionError
    assert threads() == before


@pytest.mark.slow
def test_bytes_do_not_depend_on_the_number_of_threads(tmp_path):
    """One and four threads: the same calibration of the wrist."""
    for count in ("1", "4"):
        command = [sys.executable, "-c", FIT, ROOT / "sample_scenes" / "wrist.plan.json", tmp_path / count]
        subprocess.run(command, cwd=ROOT, env=os.environ | {"OPENBLAS_NUM_THREADS": count}, check=True)
    assert (tmp_path / "1").read_bytes() == (tmp_path / "4").read_bytes()
