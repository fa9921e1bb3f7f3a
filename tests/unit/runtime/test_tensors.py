"""The function for other array libraries gives the results of ``batch``: in NumPy, and in a strict array API."""

import importlib

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from skin_calib_addon.runtime.tensors import constants, evaluate
from tests.unit.runtime.test_batch import limb, readings_for, two_feet, with_noise

SKINS = {"thresholds": two_feet, "in cell": lambda: two_feet(in_cell=True), "noise": with_noise, "limb": limb}
EXACT = ("known", "active", "contact_counts", "stands")


def namespace(name):
    """Return a namespace, or skip."""
    return np if name == "numpy" else pytest.importorskip(name, reason=f"{name} is not installed")


@pytest.mark.parametrize("library", ["numpy", "array_api_strict", "array_api_compat.torch", "jax.numpy"])
@pytest.mark.parametrize("name", SKINS)
@pytest.mark.parametrize("masked", [0, 3])
def test_results_are_those_of_a_batch(library, name, masked):
    """Sets and counts are the same, sums to 1e-12; rows with a lost taxel have no wrench."""
    xp = namespace(library)
    if library.startswith("jax"):
        importlib.import_module("jax").config.update("jax_enable_x64", True)
    skin = SKINS[name]()
    skin.mask(skin.ids[5 : 5 + masked])
    readings = readings_for(skin)
    readings[::3] = np.nan_to_num(np.where(np.abs(readings[::3]) > 1e5, 0, readings[::3]))
    batch = skin.batch(readings)
    with np.errstate(all="ignore"):
        found = evaluate(xp, {k: xp.asarray(v.copy()) for k, v in constants(skin).items()}, xp.asarray(readings))
    found = {k: np.asarray(v) for k, v in found.items()}
    whole = (batch.known == batch.known.any(axis=0)).all(axis=1)
    assert 90 < whole.sum() < len(whole) and np.isnan(found["wrench"][~whole]).all()
    for key in EXACT:
        assert_array_equal(found[key][whole], getattr(batch, key)[whole])
    for key in ("forces", "wrench", "load", "cop", "zmp"):
        assert_allclose(found[key][whole], getattr(batch, key)[whole], rtol=1e-11, atol=1e-11)
    assert found["stands"].any() or name == "limb"


def test_more_rounds_join_longer_contacts():
    """A contact in the form of a U has two local maxima of the row numbers until they hear of each other."""
    skin = two_feet()
    readings = np.zeros((1, skin.reading_length))
    readings[0, skin.channels[[0, 1, 2, 3, 4, 5, 10, 11, 15]]] = 100.0
    c = constants(skin)
    counts = [int(evaluate(np, c, readings, rounds)["contact_counts"][0]) for rounds in (0, 1, 2, 32)]
    assert counts[0] == 9 and counts[1] > 1 and counts[-1] == skin.batch(readings).contact_counts[0] == 1
