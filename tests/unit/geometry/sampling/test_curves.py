"""The curves of a section: chains, the outer one, folds followed in order."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from sample_scenes.shapes import tube_mesh
from skin_calib_addon.geometry import Axis, TubeGrid, fit_surface
from skin_calib_addon.geometry.mesh.distance import closest
from skin_calib_addon.geometry.sampling.curves import curves, short_runs
from skin_calib_addon.geometry.sampling.rays import RayCaster
from tests.examples import slow
from tests.shapes import TURN, Z_AXIS, box, cylinder, keep, together, welded

CENTRE = np.zeros((1, 2))


def ring(radius, corners=24, centre=(0.0, 0.0)):
    """Segments of a regular polygon."""
    angle = TURN * np.arange(corners) / corners
    points = radius * np.column_stack((np.cos(angle), np.sin(angle))) + centre
    return np.stack((points, np.roll(points, -1, axis=0)), axis=1)


def fan(count):
    """Even rays that pass no corner of a ring."""
    angle = TURN * (np.arange(count) + 0.37) / count
    return np.column_stack((np.cos(angle), np.sin(angle)))[None]


def cast(segments, rays=90):
    """Distances of an even fan from the origin."""
    directions = fan(rays)
    return RayCaster(np.zeros(len(segments), int), segments, 1, centres=CENTRE).cast(0 * directions, directions)


def fold(amount, corners=600):
    """A closed curve about the origin whose angle runs back three times where ``amount`` is above one."""
    t = TURN * np.arange(corners) / corners
    angle, radius = t + amount / 3 * np.sin(3 * t), 1 + 0.1 * np.cos(3 * t + 1.2)
    points = radius[:, None] * np.column_stack((np.cos(angle), np.sin(angle)))
    return np.stack((points, np.roll(points, -1, axis=0)), axis=1)


@pytest.mark.parametrize("seed", range(5))
def test_curves_are_chains_of_shared_ends(seed):
    """By brute force, of segments between random nodes in several rows: the smallest number of a connected segment."""
    rng = np.random.default_rng(seed)
    nodes = rng.integers(-2, 3, (40, 2)).astype(float)
    ends, row = nodes[rng.integers(0, len(nodes), (60, 2))], np.sort(rng.integers(0, 4, 60))
    touches = (ends[:, None, :, None] == ends[None, :, None]).all(axis=4).any(axis=(2, 3)) & (row[:, None] == row)
    number = np.arange(len(ends))
    for _ in number:
        number = np.where(touches, number, len(ends)).min(axis=1)
    found = curves(ends, row)
    assert np.array_equal(found[:, None] == found, number[:, None] == number)


def test_bolt_on_the_outside_is_dropped():
    """A small closed curve beyond the outer one is no part of it; the tube is met under it."""
    outer = ring(1.0, 200)
    with_bolt, hit = cast(np.concatenate((ring(0.05, centre=(1.2, 0.0)), outer, ring(0.4))))
    alone, _ = cast(outer)
    assert_allclose(with_bolt, alone, rtol=1e-12)
    assert (hit >= 24).all() and (hit < 224).all()  # segments keep the numbers that the caller gave them


def test_parts_that_make_the_outside_together_all_count():
    """A closed tube inside, and around it four loose shells: the shells are outside, and between them the tube."""
    shells = ring(2.0, 40)[np.arange(40) % 10 < 8]
    distance, _ = cast(np.concatenate((ring(1.0), shells)))
    assert ((distance > 1.9) == (distance > 1.5)).all() and 0.7 < (distance > 1.9).mean() < 0.9


def test_fold_is_followed_in_order():
    """The distance has no jump where the curve folds back; the outermost crossing would jump there."""
    segments = fold(1.2)
    distance, _ = cast(segments, 1440)
    order = RayCaster(np.zeros(len(segments), int), segments, 1)  # rays of no order: the outermost crossing
    directions = fan(1440)
    outermost, _ = order.cast(0 * directions, directions)
    assert np.abs(np.diff(distance[0])).max() < 0.5 * np.abs(np.diff(outermost[0])).max()
    folded = np.abs(distance - outermost)[0] > 1e-9
    assert 0.01 < folded.mean() < 0.1 and (distance <= outermost + 1e-12).all()


@pytest.mark.parametrize(("corners", "rays"), [(600, 4000), slow(3000, 20000)])
def test_fold_keeps_the_area(corners, rays):
    """Area by angle of the distances followed in order is the area of the folded curve."""
    segments = fold(1.2, corners)
    distance, _ = cast(segments, rays)
    a, b = segments[:, 0], segments[:, 1]
    area = 0.5 * (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum()
    outermost = RayCaster(np.zeros(len(segments), int), segments, 1).cast(0 * fan(rays), fan(rays))[0]
    # Out and back and out again is linear in the distances; the area, in squares, keeps up to the fold's own depth.
    assert abs(0.5 * TURN * (distance**2).mean() - area) < 0.2 * abs(0.5 * TURN * (outermost**2).mean() - area)


@pytest.mark.parametrize(
    ("chosen", "most", "expected"),
    [([1, 0, 0, 1, 1, 0], 2, [0, 3, 4]), ([1, 0, 0, 1, 1, 1], 3, []), ([0, 1, 1, 1, 0], 2, []), ([1, 1], 9, [])],
)
def test_narrow_runs(chosen, most, expected):
    """Runs go on from the last to the first."""
    assert sorted(short_runs(np.array(chosen, bool), most)) == expected


def test_folded_tube_is_fitted_between_its_branches():
    """A tube with an overhang all along, 24 lines: half the error of the outermost crossings, which was .36 mm."""

    def point(angle, height):
        phi, radius = angle + 0.4 * np.sin(3 * angle), 0.035 + 0.004 * np.cos(3 * angle + 1.2)
        return np.column_stack((radius * np.cos(phi), radius * np.sin(phi), 0.1 * height))

    fit = fit_surface(welded(tube_mesh(point, 240, 40)), TubeGrid(6, 24, Z_AXIS, 0.002))
    assert fit.errors.surface_to_mesh.mean < 0.21e-3
    assert fit.missing == 0


def test_boxes_that_touch_the_cover_do_not_pull_it():
    """Boxes through the wall at the ends of an open tube, as servo boxes stand in a forearm: the tube is fitted."""
    tube = keep(cylinder(), lambda c: (c[:, 2] > 0.004) | (c[:, 0] < 0.02))  # a jagged end
    boxes = together(box((-0.02, -0.01, 0.02), (0.02, 0.01, 0.05)), box((0.03, -0.004, 0.05), (0.04, 0.004, 0.06)))
    axis = Axis((0.001, 0.0, 0.0), (0.0, 0.0, 1.0))
    fit = fit_surface(together(tube, boxes), TubeGrid(6, 16, axis, 0.01))
    points = fit.surface.points(np.random.default_rng(0).uniform(0, 1, (500, 2)))
    assert fit.missing == 0
    assert closest(tube, points)[0].max() < 0.02e-3
