"""The calibrations of the sample scenes, number by number.

After a change that is meant to move them: ``python -m tests.golden.test_samples`` writes them again; look at how far
they moved before they are committed.
"""

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from skin_calib_addon.pipeline import calibrate
from skin_calib_addon.plan import load_plan

HERE = Path(__file__).parent
SCENES = HERE.parents[1] / "sample_scenes"
SAMPLES = ("wrist", "sole", "edge")
# Numerical libraries differ in the last bits because of the order of summation. A fit with condition number 10 and a
# relaxation that ends within 1e-4 of a cell increase that to less than this.
LENGTH_TOLERANCE = 1e-9  # [m]
# Normals and strains are differences of lengths, divided by the size of a cell or a span of the surface.
RATIO_TOLERANCE = 1e-6


@cache
def calibrated(name):
    """Return the result of a sample."""
    return calibrate(load_plan(SCENES / f"{name}.plan.json"))


def numbers(name):
    """Return all numbers of the calibration of a sample, as arrays by name."""
    calibration = calibrated(name).calibration
    (surface,), (patch,) = calibration.surfaces, calibration.patches
    taxels, errors = patch.taxels, surface.errors
    row = {id_: i for i, id_ in enumerate(taxels.ids)}
    neighbours = [(i, row[other]) for i, others in enumerate(taxels.neighbours) for other in others]
    return {
        "control_net": surface.control_net,
        "knots_u": surface.knots_u,
        "knots_v": surface.knots_v,
        "errors": np.array(
            [[e.mean, e.rms, e.max] for e in (errors.mesh_to_surface, errors.surface_to_mesh)]
            + [[errors.hausdorff] * 3]
        ),
        "positions": taxels.positions_link,
        "corners": taxels.corners_link,
        "areas": taxels.areas,
        "uv": taxels.uv,
        "normals": taxels.normals_link,
        "tangents": taxels.tangents_link,
        "strain": taxels.quality["strain"],
        "channels": taxels.channels,
        "index": taxels.index,
        "neighbours": np.array(neighbours, np.int64),
        "mesh": np.frombuffer(bytes.fromhex(calibration.mesh.sha256), np.uint8),
    }


def tolerance(name, values):
    """Return the tolerance of numbers."""
    if values.dtype.kind in "iu" or name.startswith("knots"):
        return 0.0
    if name == "areas":
        return LENGTH_TOLERANCE * 0.01  # a length times the width of a cell
    return LENGTH_TOLERANCE if name in ("control_net", "positions", "corners", "errors") else RATIO_TOLERANCE


@pytest.mark.parametrize("name", SAMPLES)
def test_sample_calibration_is_as_it_was(name):
    """Complete arrays equal the committed ones: surface, errors, taxels, frames, strain, neighbours, mesh hash."""
    found = numbers(name)
    with np.load(HERE / f"{name}.npz") as golden:
        assert set(golden.files) == set(found)
        for key, values in found.items():
            assert values.shape == golden[key].shape and values.dtype.kind == golden[key].dtype.kind
            assert_allclose(values, golden[key], rtol=0, atol=tolerance(key, values), err_msg=key)


@pytest.mark.parametrize("name", SAMPLES)
def test_sample_calibration_is_good(name):
    """The quality of the numbers, so that new golden files cannot be worse."""
    result = calibrated(name)
    worst = {"wrist": 1.3e-5, "sole": 5e-5, "edge": 1e-4}[name]
    assert result.fit.errors.surface_to_mesh.mean < worst
    assert result.fit.missing < (0.1 if name == "sole" else 1e-9)  # its outline is rounded, but the grid is not
    assert name == "sole" or not result.warnings
    taxels = result.calibration.patches[0].taxels
    assert np.abs(taxels.quality["strain"]).max() < 0.05
    towards = {"sole": np.tile((0, 0, -1.0), (len(taxels.ids), 1))}.get(name, taxels.positions_link * (1, 1, 0))
    assert ((taxels.normals_link * towards).sum(axis=1) > 0).all()


if __name__ == "__main__":
    for sample in SAMPLES:
        np.savez_compressed(HERE / f"{sample}.npz", **numbers(sample))
