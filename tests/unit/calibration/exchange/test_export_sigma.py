"""Formats that can hold it keep the uncertainty of taxels; others and calibrations without it are as before."""

import csv
import io
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from skin_calib_addon.calibration.exchange.npz import write_npz
from skin_calib_addon.calibration.exchange.pcd import read_pcd, write_pcd
from skin_calib_addon.calibration.exchange.ply import read_ply, write_ply
from skin_calib_addon.calibration.exchange.table import read_table, write_table
from tests.samples import boards, sheet, small_calibration

NAMES = ["sigma_along", "sigma_normal", "sigma_angle"]


def with_sigma():
    """Return six taxels with uncertainties, the fourth unknown, and two boards that state none."""
    patch = sheet(2, 3, 0.01)
    sigma = np.arange(1.0, 19.0).reshape(6, 3) * 1e-4
    sigma[3] = np.nan
    patch = replace(patch, taxels=replace(patch.taxels, sigma=sigma))
    return small_calibration(patches=(patch, boards(first_channel=6))), np.concatenate((sigma, np.full((2, 3), np.nan)))


def numbers(words):
    """Return numbers; empty cells are NaN."""
    return [float(word or "nan") for word in words]


def test_tables_have_columns_of_the_uncertainty():
    """Unknown cells are empty; the file is read back."""
    calibration, sigma = with_sigma()
    data = write_table(calibration).decode()
    rows = list(csv.DictReader(io.StringIO(data)))
    assert_allclose([numbers(row[name] for name in NAMES) for row in rows], sigma, rtol=0)
    assert len(read_table(data).positions) == 8 and not read_table(data).findings


@pytest.mark.parametrize(("write", "read", "end"), [(write_ply, read_ply, "end_header"), (write_pcd, read_pcd, "DATA")])
def test_point_clouds_have_columns_of_the_uncertainty(write, read, end):
    """The last three columns of each point."""
    calibration, sigma = with_sigma()
    data = write(calibration)
    assert all(name in data.decode() for name in NAMES)
    lines = data.decode().splitlines()
    first = next(i for i, line in enumerate(lines) if line.startswith(end)) + 1
    assert_allclose([numbers(line.split()[-3:]) for line in lines[first:]], sigma, rtol=0)
    assert len(read(data).positions) == 8 and not read(data).findings


def test_poses_have_the_uncertainty():
    """As one more array, with NaN where it is unknown."""
    calibration, sigma = with_sigma()
    with np.load(io.BytesIO(write_npz(calibration))) as file:
        assert file.files == ["poses", "taxel2pixel", "channel", "id", "sigma"]
        assert_allclose(file["sigma"], sigma, rtol=0)


@pytest.mark.parametrize("write", [write_table, write_ply, write_pcd, write_npz])
def test_files_without_uncertainty_have_no_columns_for_it(write):
    """A calibration that states none."""
    assert b"sigma" not in write(small_calibration())
