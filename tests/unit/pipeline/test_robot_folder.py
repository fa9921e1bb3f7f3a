"""Fits as tasks of executors that we did not write."""

import shutil
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import get_context
from pathlib import Path

import pytest

from skin_calib_addon.calibration import load_calibration
from skin_calib_addon.calibration.robot_set import load_robot_set
from skin_calib_addon.pipeline import fit_link
from skin_calib_addon.pipeline.robot_folder import save_robot

SAMPLES = Path(__file__).parents[3] / "sample_scenes"


@contextmanager
def of_dask():
    distributed = pytest.importorskip("distributed", reason="the package distributed is not installed")
    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster,
        distributed.Client(cluster) as client,
    ):
        yield client.get_executor()


@pytest.mark.slow
@pytest.mark.parametrize("pool", [lambda: ProcessPoolExecutor(2, get_context("spawn")), of_dask], ids=["own", "dask"])
def test_fits_run_in_any_executor(tmp_path, pool):
    """Calibrations, their sources, and robot.json are those of this process."""
    for name in ("wrist.ply", "edge.ply"):
        shutil.copy(SAMPLES / name, tmp_path)
    plans = sorted(shutil.copy(SAMPLES / f"{name}.plan.json", tmp_path) for name in ("wrist", "edge"))
    with pool() as executor:
        made = list(executor.map(fit_link, plans))
    assert save_robot(tmp_path, None, None) == ""
    assert [link.calibration for link in load_robot_set(tmp_path).links] == [Path(name).name for name in made]
    before = [load_calibration(name).patches[0].taxels.positions_link for name in made]
    after = [load_calibration(fit_link(plan)).patches[0].taxels.positions_link for plan in plans]
    assert all((a == b).all() for a, b in zip(before, after))
