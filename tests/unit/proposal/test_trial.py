"""Trials of a region: what a surface covers of a link, wherever it is next to that part."""

import numpy as np
import pytest

from skin_calib_addon.geometry.grid.grids import Across
from skin_calib_addon.proposal.link_points import LinkPoints
from skin_calib_addon.proposal.trial import Start, judged, opened, site_steps, steps_on
from tests.shapes import sheet


def test_what_a_surface_does_far_away_does_not_change_its_part():
    """On half of a plate the surface is 300 m away. The area is that of the other half, and steps are those on it."""
    mesh = sheet(lambda x, y: 0 * x, (0.1, 0.07))
    on = LinkPoints.of(mesh)
    start = Start.of(mesh, on, Across(normal=(0.0, 0.0, 1.0)))
    near = start.trial(on)
    offsets = near.offsets.copy()
    offsets[len(offsets) // 2 :] += 300.0
    half = judged(start.rows, on, start.parametrization, start.lines, offsets, start.basis)
    assert near.area == pytest.approx(70e-4, rel=0.01)
    assert half.good.any(axis=1).mean() == pytest.approx(0.4, abs=0.15)
    assert half.area / near.area == pytest.approx(near.good[half.good].sum() / near.good.sum(), rel=0.1)
    assert half.steps == pytest.approx(near.steps, rel=0.01)


@pytest.mark.parametrize("degrees", [45, 60])
@pytest.mark.parametrize("flat", [0.060, 0.063, 0.066])
def test_rounded_edges_do_not_bend_the_surface_next_to_them(flat, degrees):
    """A strip with edges of a radius of 3 mm, and slopes of 6 mm beyond them, is covered up to these."""
    radius, slope, angle = 3e-3, 6e-3, np.deg2rad(degrees)

    def height(x, y):
        beyond, end = np.clip(np.abs(x - flat / 2 - slope) - flat / 2, 0, None), radius * np.sin(angle)
        arc = np.sqrt(radius**2 - np.minimum(beyond, end) ** 2) - radius
        return np.where(beyond < end, arc, radius * (np.cos(angle) - 1) - (beyond - end) * np.tan(angle))

    mesh = sheet(height, (flat + 2 * slope, 0.1), (120, 20))
    on = LinkPoints.of(mesh)
    trial = Start.of(mesh, on, Across(normal=(0.0, 0.0, 1.0))).trial(on)
    is_flat = np.abs(trial.points[..., 0] - flat / 2 - slope) < flat / 2
    assert trial.good[is_flat].mean() > 0.99  # .90 to .99 when samples beyond the edges counted


def test_long_steps_do_not_count():
    """Sites next to one that is far away have the step to their other neighbour; around a tube, too."""
    x = np.array((0.0, 1.0, 3.0, 20.0))
    points = np.stack((x, 0 * x, 0 * x), axis=1)[None]
    assert steps_on(points, 1)[0, :, 0].tolist() == [1, 1.5, 2, 17]
    assert steps_on(points, 1, closed=True)[0, :, 0].tolist() == [1, 1.5, 2, -1.5]
    assert steps_on(points.swapaxes(0, 1), 0)[:, 0, 0].tolist() == [1, 1.5, 2, 17]


def test_places_without_a_hit_have_no_steps():
    """They do not count; without two adjacent hits nothing is known, and nothing is wide enough."""
    points = np.stack(np.meshgrid(1e-3 * np.arange(20), 1e-3 * np.arange(30), [0.0], indexing="ij"), -1)[:, :, 0]
    points[::5] = np.nan
    assert site_steps(points) == pytest.approx((1e-3, 1e-3))
    points[1:] = np.nan
    assert site_steps(points).tolist() == [0, 0]
    assert not opened(np.ones((20, 30), bool), points, False).any()
