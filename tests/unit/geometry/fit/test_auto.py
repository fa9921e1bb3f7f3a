"""The smallest grid that meets a tolerance."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from skin_calib_addon.common.errors import InvalidPlan, UnreachableTolerance
from skin_calib_addon.geometry import Axis, TubeGrid, fit_surface, fit_to_count, fit_to_tolerance, weld
from skin_calib_addon.geometry.fit.auto import net_size
from skin_calib_addon.geometry.fit.fitting import fit_lines
from tests import shapes
from tests.examples import slow

Z = Axis((0.0015, 0.0005, 0.0), (0.0, 0.0, 1.0))
MARGIN = 0.002


@pytest.fixture
def wrist():
    return shapes.wrist()


def test_largest_error_keeps_within_the_tolerance(wrist):
    """What was asked of the largest distance holds, where it is not asked of the mean."""
    fit = fit_to_tolerance(wrist, 2e-4, "max", axis=Z, margin=MARGIN)
    assert fit.errors.surface_to_mesh.max <= 2e-4


def test_smaller_tolerance_takes_more_control_points(wrist):
    """The net grows as the tolerance shrinks, which is met; a tolerance of metres takes the smallest net."""
    tolerances = 1.0, 3e-4, 1e-4, 2e-5
    fits = [fit_to_tolerance(wrist, tolerance, axis=Z, margin=MARGIN) for tolerance in tolerances]
    assert all(fit.errors.surface_to_mesh.mean <= tolerance for fit, tolerance in zip(fits, tolerances))
    sizes = [net_size(fit) for fit in fits]
    assert sizes[0] == 16 and (np.diff(sizes) > 0).all()


def test_tolerance_below_the_facets_is_refused(wrist, monkeypatch):
    """No smooth surface fits facets exactly: the message states the achievable error, the same for all tolerances.

    A moderate net refutes the tolerance, and the largest net is not fitted.
    """
    sizes = []

    def counted(mesh, lines, degree):
        sizes.append(lines.origins.shape[0] * lines.origins.shape[1])
        return fit_lines(mesh, lines, degree)

    monkeypatch.setattr("skin_calib_addon.geometry.fit.auto.fit_lines", counted)
    with pytest.raises(
        UnreachableTolerance, match="The best achievable error is about .* because the mesh is faceted"
    ) as caught:
        fit_to_tolerance(wrist, 1e-7, axis=Z, margin=MARGIN)
    assert len(sizes) <= 3 and max(sizes) < 3000
    achievable = caught.value.numbers["achievable"]
    best = fit_surface(wrist, TubeGrid(20, 60, Z, MARGIN)).errors.surface_to_mesh.mean
    assert_allclose(achievable, best, rtol=0.5)
    assert achievable > 1e-7 and f"{achievable * 1e3:g} mm" in str(caught.value)
    assert fit_to_tolerance(wrist, achievable, axis=Z, margin=MARGIN).errors.surface_to_mesh.mean <= achievable
    with pytest.raises(UnreachableTolerance) as smaller:
        fit_to_tolerance(wrist, 2e-8, axis=Z, margin=MARGIN)
    assert smaller.value.numbers["achievable"] == achievable
    assert np.linalg.norm(wrist.vertices - caught.value.numbers["place"].point, axis=1).min() < 0.005


@pytest.mark.parametrize(
    "region", [slow((Z, MARGIN)), slow((Z, MARGIN, (-1.0, 1.5))), (Z, MARGIN, None, (1.0, 0.0, 0.0))]
)
@pytest.mark.parametrize("fit, size", [(fit_to_tolerance, (5e-4, "max", 3)), (fit_to_count, (60, 3))])
def test_region_by_position_is_the_region_by_name(wrist, fit, size, region):
    """Every argument has a position, in the order of ``AutoGrid``: calls without names give the same surface."""
    names = dict(zip(("axis", "margin", "sector", "normal"), region))
    assert_array_equal(fit(wrist, *size, *region).surface.control_net, fit(wrist, *size, **names).surface.control_net)


@pytest.mark.parametrize("tolerance, measure", [(0.0, "mean"), (-1.0, "mean"), (np.nan, "mean"), (1e-4, "median")])
def test_nonsense_is_refused(wrist, tolerance, measure):
    """A tolerance is a positive length, of the mean or the largest distance."""
    with pytest.raises(InvalidPlan, match="The tolerance must be positive and the measure"):
        fit_to_tolerance(wrist, tolerance, measure, axis=Z, margin=MARGIN)


def test_hole_does_not_count_against_a_tolerance(wrist):
    """What spans it is left out, as it is of the report: hardly more control points than without it."""
    centre = wrist.vertices[np.argmax(wrist.vertices @ (1.0, 1.0, 0.0) - 10 * np.abs(wrist.vertices[:, 2] - 0.05))]
    near = np.linalg.norm(wrist.triangles.mean(axis=1) - centre, axis=1) < 0.012
    fits = [
        fit_to_tolerance(mesh, 3e-5, axis=Z, margin=MARGIN)
        for mesh in (wrist, weld(wrist.vertices, wrist.faces[~near]))
    ]
    assert fits[1].missing > 0.01 and fits[1].errors.surface_to_mesh.mean <= 3e-5
    assert net_size(fits[1]) < 1.5 * net_size(fits[0])
