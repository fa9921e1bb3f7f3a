"""Planes one by one: they give the lines of the grid they came from, and the row of them can be changed."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from skin_calib_addon.common.arrays import unit
from skin_calib_addon.common.errors import EmptySection, InvalidPlan
from skin_calib_addon.geometry import AcrossGrid, CoverSpec, Cut, Planes, PlanesGrid, SectorGrid, TubeGrid, cut_cover
from skin_calib_addon.geometry.grid.axis import axis_through
from skin_calib_addon.geometry.grid.plane_editing import between, mirrored, planes_of, spread, through
from tests.shapes import Z_AXIS, Motion, cone, cylinder, sheet, u_planes, v_planes, wrist

seeds = st.integers(0, 2**32 - 1)


def lines_as_set(lines):
    """Where each line of each u-plane goes, sorted, so that two orders of the same lines are equal."""
    at = lines.directions.reshape(-1, 3)
    foot = lines.origins.reshape(-1, 3)
    foot = foot - (foot * at).sum(axis=1)[:, None] * at
    rows = np.round(np.hstack((at, foot * 100)), 6) + 0.0
    return rows[np.lexsort(rows.T)]


TUBE = TubeGrid(6, 12, Z_AXIS, 0.004, "uniform")
HALF = cut_cover(cylinder(), CoverSpec(cuts=(Cut((0.0, 0.0, 0.0), (1.0, 0.0, 0.0)),)))
SECTOR = SectorGrid(5, 7, -1.0, 1.2, Z_AXIS, 0.004, "uniform")
ACROSS = AcrossGrid(5, 6, (0.0, 0.0, 1.0), margin=0.005, spacing="uniform")


@pytest.mark.parametrize("grid, mesh", [(TUBE, wrist()), (SECTOR, HALF), (ACROSS, sheet(lambda x, y: 0 * x))])
def test_planes_give_the_lines_of_their_grid(grid, mesh):
    """Even grids are planes already, and an author's grid of these planes has the same lines."""
    lines = grid.line_grid(mesh)
    by_hand = PlanesGrid(*planes_of(lines), lines.closed).line_grid(mesh)
    assert_allclose(lines_as_set(by_hand), lines_as_set(lines), atol=1e-5)


def test_uneven_lines_become_even_ones_about_the_same_axis():
    """U-planes stay where they are; half as many full planes go through the axis at even angles."""
    lines = TubeGrid(6, 12).line_grid(wrist())
    u, v = planes_of(lines)
    assert_allclose(u.points, lines.planes_u.points)
    assert len(v) == 6
    turn = np.arccos(np.abs((v.normals[1:] * v.normals[:-1]).sum(axis=1)))
    assert_allclose(turn, np.pi / 6)
    centres = lines.origins.mean(axis=1)
    assert np.abs(((centres[:, None] - v.points) * v.normals).sum(axis=2)).max() < 1e-9


@pytest.mark.parametrize("side, index", [(0.01, 0), (0.025, 1), (0.055, 2), (0.08, 3)])
@pytest.mark.parametrize("order", [1, -1])
def test_plane_through_a_point_is_between_its_neighbours(side, index, order):
    """It contains the point, belongs between the planes on both of its sides, and turns from one to the other."""
    planes = u_planes([0.02, 0.04, 0.06][::order], [0.0, 0.2, 0.0])
    at, point, normal = through(planes, np.array((0.03, 0.01, side)), False)
    assert at == (index if order == 1 else 3 - index)
    assert abs((point - (0.03, 0.01, side)) @ normal) < 1e-12 and abs(np.linalg.norm(normal) - 1) < 1e-12
    if index in (0, 3):
        assert_allclose(normal, (0, 0, 1), atol=1e-12)
    else:
        assert 0 < np.arctan2(normal[0], normal[2]) < 0.2


@pytest.mark.parametrize("degrees", [10.0, 50.0, 80.0, 130.0, 170.0, 190.0, 300.0])
def test_full_plane_through_a_point_contains_the_axis(degrees):
    """Among three full planes 60 degrees apart, the new one has the angle of the point and the order of angles."""
    turn = np.deg2rad(degrees)
    planes = v_planes(3)
    place = np.array((0.03 * np.cos(turn), 0.03 * np.sin(turn), 0.02))
    index, point, normal = through(planes, place, True)
    assert abs((place - point) @ normal) < 1e-12 and abs(normal[2]) < 1e-12
    assert np.abs(point[:2]).max() < 1e-12
    assert index == int(degrees % 180 // 60) + 1


def test_plane_next_to_a_single_one_is_parallel():
    """On either side."""
    planes = u_planes([0.04], [0.2])
    for side, index in ((0.03, 0), (0.05, 1)):
        at, point, normal = through(planes, np.array((0.0, 0.0, side)), True)
        assert at == index and abs((point - (0, 0, side)) @ normal) < 1e-12
        assert_allclose(normal, planes.normals[0])


def test_new_plane_is_midway_to_the_next_or_as_far_beyond_the_last():
    """Point and normal."""
    planes = u_planes([0.02, 0.04, 0.06], [0.0, 0.2, 0.0])
    point, normal = between(planes, 0)
    assert_allclose(point, (0, 0, 0.03))
    assert_allclose(normal, (np.sin(0.1), 0, np.cos(0.1)))
    assert_allclose(between(planes, 2)[0], (0, 0, 0.07))
    assert_allclose(between(u_planes([0.02]), 0), ((0, 0, 0.02), (0, 0, 1)))
    flipped = Planes(planes.points, planes.normals * [[1], [-1], [1]])
    assert_allclose(between(flipped, 0)[1], normal)


def test_planes_are_spaced_evenly():
    """From the first to the last; of one or two nothing changes."""
    planes = spread(u_planes([0.02, 0.03, 0.08], [0.0, 0.5, 0.2]), around=False)
    assert_allclose(planes.points[:, 2], (0.02, 0.05, 0.08))
    assert_allclose(np.arctan2(planes.normals[:, 0], planes.normals[:, 2]), (0, 0.1, 0.2))
    pair = u_planes([0.02, 0.08], [0.1, 0.2])
    assert_allclose(spread(pair, around=False).normals, pair.normals)
    assert len(spread(u_planes([0.02]), around=False)) == 1


def test_spread_takes_the_sides_of_normals_from_their_neighbours():
    """Three planes that fan out by less than 90 degrees each; it does not matter which side a normal points to."""
    points, normals = (
        0.01 * np.arange(3)[:, None] * (0, 0, 1.0),
        unit(np.array(((1, 0, 0.0), (0.69, -0.73, 0), (0.63, -0.78, 0)))),
    )
    even = spread(Planes(points, normals), around=False)
    assert_allclose(even.normals[[0, 2]], normals[[0, 2]], atol=1e-12)
    assert_allclose(spread(Planes(points, normals * [[1], [-1], [1]]), around=False).normals, even.normals)


@given(seeds, st.integers(2, 9))
def test_full_planes_are_spaced_evenly_about_their_common_line(seed, count):
    """From the first one on, in the sense in which the second follows it, wherever the line is."""
    rng, motion = np.random.default_rng(seed), Motion(seed)
    angles = np.r_[0.0, np.sort(rng.uniform(0.1, 1.4, count - 1))] * rng.choice((-1, 1))
    normals = np.column_stack((np.cos(angles), np.sin(angles), 0 * angles))
    points = rng.normal(size=(count, 3))
    points -= (points * normals).sum(axis=1)[:, None] * normals
    even = spread(Planes(motion.points(points), motion.directions(normals)), around=True)
    step = np.sign(angles[1]) * np.pi / count * np.arange(count)
    expected = motion.directions(np.column_stack((np.cos(step), np.sin(step), 0 * step)))
    assert_allclose(even.normals, expected, atol=1e-9)
    on_line = motion.points(np.array((0, 0, points[:, 2].mean())))
    assert_allclose(even.points, np.tile(on_line, (count, 1)), atol=1e-9)


def test_parallel_planes_have_no_line_to_stand_around():
    """The message asks the author to rotate one."""
    with pytest.raises(InvalidPlan, match="Rotate one of them first"):
        spread(u_planes([0.02, 0.04]), around=True)
    with pytest.raises(InvalidPlan, match="Rotate one of them first"):
        spread(v_planes(1), around=True)


def test_mirror_images_go_behind_the_middle_plane():
    """In reverse order, with mirrored tilt, in place of what was there; the normals go on in the same sense."""
    planes = mirrored(u_planes([0.02, 0.03, 0.05, 0.09], [0.3, 0.1, 0.0, 0.0]), 2)
    assert_allclose(planes.points[:, 2], (0.02, 0.03, 0.05, 0.07, 0.08), atol=1e-12)
    assert_allclose(np.arctan2(planes.normals[:, 0], planes.normals[:, 2]), (0.3, 0.1, 0, -0.1, -0.3), atol=1e-12)
    with pytest.raises(InvalidPlan, match="There is no plane before"):
        mirrored(planes, 0)


@pytest.mark.parametrize("seed", range(4))
def test_axis_joins_the_centres_of_two_sections(seed):
    """Of a cylinder and a cone it is the axis itself, in the direction of the picks, wherever the link lies."""
    for mesh in (cylinder(), cone()):
        motion = Motion(seed)
        low, high = (mesh.vertices[np.argmin(np.abs(mesh.vertices[:, 2] - z))] for z in (0.03, 0.07))
        moved = motion.mesh(mesh)
        for first, second, sign in ((low, high, 1), (high, low, -1)):
            axis = axis_through(moved, *motion.points(np.array((first, second))))
            # A section of 96 facets is up to 19 um off its circle, which is seen over 40 mm.
            assert_allclose(axis.direction, sign * motion.directions(np.array((0, 0, 1.0))), atol=1e-4)
            foot = motion.points(np.array((0, 0, first[2])))
            assert np.linalg.norm(np.cross(axis.point - foot, axis.direction)) < 1e-5
            assert abs((axis.point - foot) @ axis.direction) < 1e-5  # the first section's centre, not the second's


def test_sections_without_an_axis_are_refused():
    """On each other, or off the mesh."""
    mesh = cylinder()
    with pytest.raises(InvalidPlan, match="further apart"):
        axis_through(mesh, mesh.vertices[0], mesh.vertices[0])
    with pytest.raises(EmptySection, match="Choose another point"):
        axis_through(mesh, (0, 0, 0.05), (0, 0, 0.5))
