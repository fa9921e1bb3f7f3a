"""Limits of fits and of their errors: a case just within is treated as one, a case just beyond as the other."""

from types import SimpleNamespace

import numpy as np
import pytest

from skin_calib_addon.geometry.fit import auto
from skin_calib_addon.geometry.fit.auto import Search
from skin_calib_addon.geometry.fit.error_report import statistics_of
from skin_calib_addon.geometry.fit.surface_fit import SurfaceFit


class Predictor:
    """Nets of ten lines, each with the next of some errors."""

    measure = "mean"

    def __init__(self, errors):
        self.errors, self.fitted = errors, 0

    def best(self, count):
        """One size."""
        return count // 10, 10

    def fit(self, size):
        """A fit that stands for its error."""
        self.fitted += 1
        return SurfaceFit(*[None] * 3, SimpleNamespace(size=size[0] * size[1]), *[None] * 5)


@pytest.mark.parametrize("errors, fitted", [((1.0, 0.75, 0.5, 0.3), 4), ((1.0, 0.75, 0.63), 3), ((1.0, 0.85), 2)])
def test_larger_nets_are_fitted_while_they_reduce_the_error_by_a_fifth(errors, fitted, monkeypatch):
    """Of the mean; none of them is within the tolerance."""
    predictor = Predictor(errors)
    monkeypatch.setattr(auto, "error_of", lambda *_: errors[predictor.fitted - 1])
    search = Search(predictor, 1e-9, 0.01)
    search.enlarge()
    assert search.best is None and len(search.nets) == predictor.fitted == fitted


@pytest.mark.parametrize("area, meters, is_usable", [(0.1, 0.01, True), (-0.01, 0.01, False), (0.1, 0.03, False)])
def test_surface_that_folds_or_is_far_somewhere_meets_no_tolerance(area, meters, is_usable, monkeypatch):
    """Its mean is within the tolerance; 20 mm are allowed somewhere."""
    monkeypatch.setattr(auto, "maximum_deviation", lambda *_: (meters, None))
    monkeypatch.setattr(auto, "error_of", lambda *_: 1e-4)
    fit = SurfaceFit(*[None] * 3, SimpleNamespace(size=16), *[None] * 5)
    predictor = SimpleNamespace(measure="mean", fit=lambda size: fit)
    monkeypatch.setattr(SurfaceFit, "smallest_area", area)
    search = Search(predictor, 5e-4, 0.02)
    search.fit((4, 4))
    assert (search.best is not None) == is_usable


def test_fits_that_more_planes_do_not_improve_blame_the_lines():
    """Twice the planes leave the same error: only the factor of the lines stays near one."""
    predictor = SimpleNamespace(parts=lambda size: (size[0] ** -2.0, size[1] ** -2.0), measure="mean")
    search = Search(predictor, 8e-3, 0.01)
    search.tried = {(n, 10): (1e-2, None) for n in (10, 20)}
    along, across = search.factors()
    assert along < 0.5 * across and across == pytest.approx(1, abs=0.2)


def test_stated_half_width_is_that_of_95_percent():
    """Of the means of 2000 random samples, 95 % are within the half width that each states; sizes of cells differ."""
    rng = np.random.default_rng(0)
    weights = rng.uniform(0.5, 1.5, 200)
    found = [statistics_of(rng.exponential(size=200), weights, 9.0) for _ in range(2000)]
    inside = np.mean([abs(each.mean - 1) <= each.uncertainty for each in found])
    assert 0.93 < inside < 0.97
    assert {each.max for each in found} == {9.0}
