"""Limits of fits and of their errors: a case just within is treated as one, a case just beyond as the other.

The numbers are written out, so that a limit does not change unnoticed.
"""

from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest

from skin_calib_addon.geometry import TubeGrid, fit_surface, weld
from skin_calib_addon.geometry.fit import auto
from skin_calib_addon.geometry.fit.auto import Search
from skin_calib_addon.geometry.fit.chords import facet_sagittas
from skin_calib_addon.geometry.fit.error_field import facet_gaps
from skin_calib_addon.geometry.fit.error_report import statistics_of, winding
from skin_calib_addon.geometry.fit.fitting import iterate
from skin_calib_addon.geometry.fit.limits import limit_of
from skin_calib_addon.geometry.fit.surface_fit import SurfaceFit
from skin_calib_addon.geometry.sampling.samples import SampleRows
from tests.shapes import Z_AXIS, cylinder


@cache
def tube():
    """A fit to a cylinder."""
    return fit_surface(cylinder(around=96), TubeGrid(6, 24, Z_AXIS, 0.002))


@pytest.mark.parametrize("ratio, cause", [(1.8, "faceted"), (2.2, "steps")])
def test_facets_explain_a_distance_of_two_sagittas(ratio, cause):
    """Each site is off by this multiple of the sagitta of its facet."""
    fit = tube()
    slope = np.abs((fit.samples.rays * fit.mesh.face_normals[fit.samples.faces]).sum(axis=2))
    residuals = ratio * facet_sagittas(fit.mesh)[fit.samples.faces] / slope
    off = replace(fit, samples=replace(fit.samples, residuals=residuals))
    assert cause in limit_of(off, 1e-9)[0]


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


@pytest.mark.parametrize("flipped, expected", [(20, 1), (30, 0), (70, 0), (80, -1)])
def test_winding_counts_if_three_quarters_of_the_hits_agree(flipped, expected):
    """Of a hundred rays, some hit faces with the other winding."""
    normals = np.where(np.arange(100) < flipped, -1.0, 1.0)[:, None] * (0, 0, 1.0)
    samples = SimpleNamespace(
        residuals=np.zeros((1, 100)), rays=np.tile((0, 0, 1.0), (1, 100, 1)), faces=np.arange(100)[None]
    )
    assert winding(SimpleNamespace(face_normals=normals), samples) == expected


@pytest.mark.parametrize("cosine, is_used", [(0.18, False), (0.22, True)])
def test_planes_of_facets_are_used_up_to_a_cosine_of_a_fifth(cosine, is_used):
    """One ray along x hits the plane of a facet at 2 m; before, it hits the section at 1 m."""
    normal = np.array((cosine, (1 - cosine**2) ** 0.5, 0))
    rows = SimpleNamespace(
        mesh=SimpleNamespace(face_normals=normal[None]),
        sections=SimpleNamespace(face=np.array([0]), ends=np.array([[(2.0, 0, 0)]])),
        origins=np.zeros((1, 1, 3)),
    )
    distance = SampleRows._onto_facets(rows, np.ones((1, 1)), np.zeros((1, 1), int), np.array([[(1.0, 0, 0)]]))
    assert distance[0, 0] == pytest.approx(2.0 if is_used else 1.0)


@pytest.mark.parametrize("ratio, iterations", [(0.9, 10), (1.0, 3)])
def test_iterations_end_if_a_movement_is_as_large_as_two_before(ratio, iterations):
    """Each movement has this ratio to the one two iterations before; the residuals stay the same."""
    steps = iter([1e-3 * ratio ** (k / 2) for k in range(20)])
    samples = SimpleNamespace(residuals=np.ones((1, 1)), outside=None)
    basis = SimpleNamespace(
        solve=lambda residuals, start: np.full((1, 1), next(steps)), blend=lambda x: x, is_closed=(False, False)
    )
    rows = SimpleNamespace(cast=lambda arms: samples, mesh=SimpleNamespace(size=0.1))
    lines = SimpleNamespace(directions=np.eye(3)[:1, None])
    *_, done, movement = iterate(lines, basis, rows, np.zeros((1, 1)), samples)
    assert done == iterations and movement == pytest.approx(1e-3 * ratio ** ((iterations - 1) / 2))


def gap_with_curvature(ratio):
    """Gap of a facet of a strip of eight edges; next to the facet, the strip bends by a ratio more than over it."""
    bend = np.deg2rad(1.0)
    angles = -np.cumsum([0.0] + 3 * [(2 * ratio - 1) * bend] + 2 * [bend] + 3 * [(2 * ratio - 1) * bend])
    angles -= angles[4]
    edges = 5e-3 * np.column_stack((np.cos(angles), 0 * angles, np.sin(angles)))
    profile = np.vstack((np.zeros(3), np.cumsum(edges, axis=0)))
    rows, count = 9, len(profile)
    points = (profile + 5e-3 * np.arange(rows)[:, None, None] * (0, 1, 0)).reshape(-1, 3)
    a = (count * np.arange(rows - 1)[:, None] + np.arange(count - 1)).ravel()
    below, above = (a, a + 1, a + count + 1), (a, a + count + 1, a + count)
    mesh = weld(points, np.concatenate([np.column_stack(corners) for corners in (below, above)]))
    middles = mesh.vertices[mesh.faces].mean(axis=1)
    flat = np.flatnonzero(np.abs(mesh.face_normals[:, 2]) > 1 - 1e-9)
    facet = flat[[np.abs(middles[flat, 1] - 0.02).argmin()]]
    return float(facet_gaps(mesh, facet, middles[facet])[0])


@pytest.mark.parametrize(("ratio", "fraction"), [(1.9, 1.0), (3.0, 0.5), (4.1, 0.0)])
def test_facet_between_bends_of_two_to_four_times_its_curvature_has_a_part_of_its_gap(ratio, fraction):
    """Up to twice its curvature it has the whole gap, and from four times on none."""
    assert gap_with_curvature(ratio) == pytest.approx(fraction * gap_with_curvature(1.0), rel=0.01, abs=1e-12)
