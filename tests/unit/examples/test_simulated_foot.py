"""A short run of the example with a foot in a simulator; it needs the package ``mujoco``."""

import importlib.util
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow
pytest.importorskip("mujoco", reason="the package mujoco is not installed")

EXAMPLE = Path(__file__).parents[3] / "examples" / "simulated_foot.py"


@pytest.fixture(scope="module")
def simulated():
    """Return twelve frames on every ground, for both skins."""
    specification = importlib.util.spec_from_file_location("simulated_foot", EXAMPLE)
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return module.runs(12)


@pytest.mark.nightly
def test_foot_of_our_own_skin_agrees_with_the_simulator(simulated):
    """Loads agree to 3 %, CoPs to a tenth of a cell on plain ground; every guaranteed polygon is in the true region."""
    for run in simulated:
        inside, areas = run.guaranteed
        assert inside == areas and run.outer_contains_cop == len(run.frames) == 12
        assert run.load_errors.mean() < 0.03
        cell = 0.01 if run.skin == "sheet 10 mm" else 0.028
        assert run.cop_errors.mean() < (0.25 if run.ground == "pebbles" else 0.1) * cell
    assert sum(run.guaranteed[1] for run in simulated) >= 20


@pytest.mark.nightly
def test_truth_of_the_simulator_is_complete(simulated):
    """The contacts carry the weight of the foot and the load, and lateral forces, which taxels do not measure."""
    for run in simulated:
        for frame, truth in zip(run.frames, run.truths):
            assert 200 < truth.wrench[2] < 650
            assert abs(truth.cells.sum() / truth.wrench[2] - 1) < 0.05  # an edge may pull a pad back
            assert len(truth.points) >= 3 and frame.cop is not None
    assert max(abs(t.wrench[0]) for run in simulated for t in run.truths) > 15
