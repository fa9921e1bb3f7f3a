"""Proposals for the eight real links of docs/how-to/links.md; the tests run where the data is."""

import pytest

from skin_calib_addon.geometry import load_mesh
from skin_calib_addon.pipeline import calibrate

pytestmark = pytest.mark.nightly


@pytest.fixture(scope="module")
def proposals(benchmarks):
    """The benchmark as a module."""
    return pytest.importorskip("proposals")


def test_proposal_is_within_half_a_millimetre_or_states_a_reason(proposals):
    """On each link every surface has a mean deviation of at most 0.5 mm, and the area without skin has a reason."""
    files = {name: proposals.MESHES / f"{stem}.stl" for name, stem in proposals.LINKS.items()}
    if missing := [file.name for file in files.values() if not file.exists()]:
        pytest.skip(f"these meshes are not on this machine: {', '.join(missing)}")
    choice = proposals.parse_skin(proposals.DEFAULT_SKIN)
    for name, file in files.items():
        found = proposals.proposed(file, choice)
        if found.plan is None:
            assert len(found.reasons[-1]) > 20, name
            continue
        fits = calibrate(found.plan, load_mesh(file, "m")).fits
        means = {surface: fit.errors.surface_to_mesh.mean for surface, fit in fits.items()}
        assert max(means.values()) <= 0.5e-3, (name, means)
        assert found.seen >= found.free >= found.covered > 0, name
        assert "can be seen from outside" in found.reasons[0] and "cm^2 of the free area" in found.reasons[-1], name
