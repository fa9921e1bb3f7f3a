"""Comparison of two sets of taxels: pairs, distances, angles, and notes on a wrong frame."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from skin_calib_addon.calibration.exchange import TaxelSet, write_taxel_set
from skin_calib_addon.calibration.file import save_calibration
from skin_calib_addon.common.errors import CalibrationFormatError
from skin_calib_addon.common.warnings import Warning
from skin_calib_addon.inspection.all_taxels import AllTaxels
from skin_calib_addon.inspection.comparison import compare, read_others
from skin_calib_addon.pipeline import calibrate
from skin_calib_addon.plan import load_plan
from tests.samples import small_calibration


@pytest.fixture(scope="module")
def wrist():
    """Return the calibrated sample wrist."""
    return calibrate(load_plan(Path(__file__).parents[3] / "sample_scenes" / "wrist.plan.json"))


@pytest.fixture(scope="module")
def taxels(wrist):
    """Return its taxels."""
    return AllTaxels.of(wrist.calibration.patches)


@pytest.fixture
def same(taxels):
    """Return a set with the same taxels and ids."""
    return TaxelSet(taxels.positions, taxels.normals, taxels.ids, taxels.channels, None)


def test_same_taxels_have_no_distance(taxels, same, wrist):
    """Taxels in any order are paired by id, without a note."""
    order = np.random.default_rng(0).permutation(len(taxels.ids))
    mixed = TaxelSet(same.positions[order], same.normals[order], tuple(same.labels[i] for i in order), order, None)
    found = compare(taxels, mixed, wrist.cover)
    assert found.by == "id" and found.notes == ()
    assert (found.ours == order).all()
    assert not found.distances.any() and found.angles.max() < 1e-12


def test_each_pair_has_its_distance_and_angle(taxels, same, wrist):
    """Distances and angles are the known ones; the largest is named."""
    turn = Rotation.from_rotvec([0, 0, 0.02])
    shift = np.zeros((120, 3))
    shift[:, 2], shift[7, 2] = 1e-4, 4e-4
    found = compare(
        taxels, replace(same, positions=same.positions + shift, normals=same.normals @ turn.as_matrix().T), wrist.cover
    )
    assert_allclose(found.distances, shift[:, 2], rtol=1e-9)
    assert_allclose(found.ends[:, 1] - found.ends[:, 0], shift, atol=1e-12)
    lean = np.linalg.norm(taxels.normals[:, :2], axis=1)
    assert_allclose(found.angles, 2 * np.arcsin(lean * np.sin(0.01)), rtol=1e-9)
    assert found.worst == taxels.ids[7] and found.notes == ()


def test_taxels_without_a_partner_are_noted(taxels, same, wrist):
    """Both sets are checked."""
    labels = ("other", *same.labels[1:])
    notes = compare(taxels, replace(same, labels=labels), wrist.cover).notes
    assert notes == (
        "1 taxel of the link without a partner in the file: wrist.0.0",
        "1 taxel of the file without a partner on the link: other",
    )


def test_unknown_names_are_paired_by_position(taxels, same, wrist):
    """Each taxel is paired with the nearest of ours; repeated partners are counted."""
    labels = ("wrist.5.5", *(f"t{k}" for k in range(119)))  # one known id is not enough
    rng = np.random.default_rng(1)
    near = same.positions + rng.uniform(-1, 1, (120, 3)) * 1e-3
    near[5] = near[6]
    found = compare(taxels, replace(same, positions=near, labels=labels, normals=None), wrist.cover)
    gaps = np.linalg.norm(near[:, None] - taxels.positions, axis=2)
    assert found.by == "nearest" and (found.ours == gaps.argmin(axis=1)).all() and found.angles is None
    assert_allclose(found.distances, gaps.min(axis=1))
    assert found.notes == (
        "1 taxel of the link without a partner in the file: wrist.0.5",
        "1 of the file have the same nearest taxel of the link as another one",
    )


def test_wrong_frame_is_noted_with_the_motion(taxels, same, wrist):
    """The motion follows from the pairs by id, or from the mesh by position; scattered taxels have no motion."""
    turn, shift = Rotation.from_rotvec([0, 0.5, 0]), np.array((0.1, 0, 0.02))
    moved = same.moved(turn.as_matrix(), shift)
    notes = compare(taxels, moved, wrist.cover).notes
    assert len(notes) == 1 and notes[0].startswith("Another frame? a turn by 28.6° and a shift by (")
    back = (turn.inv().apply(-shift) * 1e3).round(1)
    assert f"({back[0]:.1f}, {back[1] + 0.0:.1f}, {back[2]:.1f}) mm" in notes[0]
    named = compare(taxels, replace(same, frame="forearm"), wrist.cover, "wrist").notes
    assert named == ("The file is in the frame forearm",)
    scattered = same.positions + np.random.default_rng(2).normal(0, 2e-3, (120, 3))
    assert compare(taxels, replace(same, positions=scattered), wrist.cover).notes == ()
    labels = tuple(f"t{k}" for k in range(30))
    renamed = TaxelSet(moved.positions[::4], moved.normals[::4], labels, np.arange(30), None)
    assert compare(taxels, renamed, wrist.cover).notes[0].startswith("Another frame: it is ")


def test_inward_normals_are_counted(taxels, same, wrist):
    """The normals of the file are reversed."""
    normals = np.where(np.arange(120)[:, None] < 30, -same.normals, same.normals)
    found = compare(taxels, replace(same, normals=normals), wrist.cover)
    assert found.notes == ("30 normals of the file point in the opposite direction",)
    assert_allclose(found.angles[:30], np.pi)


def test_calibrations_and_files_of_others_are_read(taxels, same, wrist, tmp_path):
    """The content decides; an empty or invalid file is refused."""
    save_calibration(wrist.calibration, tmp_path / "wrist.json")
    (tmp_path / "wrist.csv").write_bytes(write_taxel_set(same))
    for name in ("wrist.json", "wrist.csv"):
        read = read_others(tmp_path / name)
        assert read.labels == taxels.ids
        assert_allclose(read.positions, taxels.positions, atol=1e-9)
        assert compare(taxels, read, wrist.cover).distances.max() < 1e-9
    warned = replace(wrist.calibration, warnings=(Warning("strain", "warning", "A cell is strained.", advice="Move."),))
    save_calibration(warned, tmp_path / "warned.json")
    notes = compare(taxels, read_others(tmp_path / "warned.json"), wrist.cover).notes
    assert notes == ("warning: the document reports: A cell is strained. Move. [strain]",)
    save_calibration(small_calibration(patches=()), tmp_path / "bare.json")
    with pytest.raises(CalibrationFormatError, match="without taxels"):
        read_others(tmp_path / "bare.json")
    with pytest.raises(CalibrationFormatError):
        read_others(tmp_path / "none.txt")
