"""Gaps of rounding between adjacent faces are closed; those between parts, and the mesh otherwise, stay."""

import numpy as np
import pytest

from skin_calib_addon.geometry.mesh.defects import diagnose
from skin_calib_addon.geometry.mesh.triangle_mesh import joined, read_mesh, save_mesh, weld, without_gaps
from tests.shapes import box, cylinder, same_mesh, shuffled

TUBE = cylinder(around=24, along=8)


def torn(mesh, gap, seed=0):
    """Return a mesh whose faces have corners of their own, each moved by up to ``gap`` [m]."""
    corners = mesh.triangles.reshape(-1, 3)
    moved = corners + np.random.default_rng(seed).uniform(-gap, gap, corners.shape) / np.sqrt(3)
    return weld(moved, np.arange(len(corners)).reshape(-1, 3))


@pytest.mark.parametrize("gap", [1e-12, 1e-7])
def test_faces_with_corners_of_their_own_are_connected(tmp_path, gap):
    """With all faces, whatever the order of the file; the open ends of the tube stay open."""
    mesh = torn(TUBE, gap)
    assert len(mesh.vertices) == 3 * len(mesh.faces)
    save_mesh(mesh, tmp_path / "tube.ply")
    closed = read_mesh(tmp_path / "tube.ply")
    assert (len(closed.vertices), len(closed.faces)) == (len(TUBE.vertices), len(TUBE.faces))
    np.testing.assert_allclose(
        closed.vertices[closed.faces].mean(axis=1).mean(axis=0), TUBE.triangles.mean(axis=(0, 1)), atol=gap
    )
    assert same_mesh(without_gaps(weld(*shuffled(mesh, 1))), closed) and without_gaps(closed) is closed
    found = diagnose(mesh.vertices, mesh.faces)
    assert found.parts == 1 and len(found.holes()) == len(diagnose(TUBE.vertices, TUBE.faces).holes())


def test_gaps_between_parts_stay():
    """Two half tubes, and two boxes, 0.1 mm apart; and gaps that are wider than rounding."""
    low, high = TUBE.vertices[:, 2].min(), TUBE.vertices[:, 2].max()
    other = weld(TUBE.vertices + (0, 0, high - low + 1e-4), TUBE.faces)
    boxes = [box((0, 0, z), (0.1, 0.05, z + 0.05)) for z in (0, 0.0501)]
    for mesh in (joined((TUBE, other)), joined(boxes), torn(TUBE, 1e-4)):
        assert without_gaps(mesh) is mesh


def test_closed_parts_that_touch_stay():
    """Their vertices nearly coincide, but have no edge with one face."""
    mesh = joined([box((0, 0, z), (0.1, 0.05, z + 0.05)) for z in (0, 0.05 + 1e-8)])
    assert without_gaps(mesh) is mesh


def test_small_faces_and_third_sides_stay():
    """A face smaller than the gap, and a third sheet at the edge of two, are not merged into others."""
    points = np.array([(0, 0, 0), (0.1, 0, 0), (0, 0.1, 0), (0.1, -0.1, 0), (0, 0, 0.1)])
    speck = points[2] + np.array([(0, 0, 0), (1e-8, 0, 0), (0, 1e-8, 0)])
    third = np.array([points[0], points[1], points[4]]) + 1e-8
    mesh = weld(np.concatenate((points, speck, third)), [(0, 1, 2), (1, 0, 3), (5, 6, 7), (8, 9, 10)])
    assert same_mesh(without_gaps(mesh), mesh)


def test_one_far_vertex_does_not_widen_the_gap():
    """A stray facet 1 km away: parts 0.1 mm apart stay."""
    low, high = TUBE.vertices[:, 2].min(), TUBE.vertices[:, 2].max()
    other = weld(TUBE.vertices + (0, 0, high - low + 1e-4), TUBE.faces)
    stray = weld([(1000, 0, 0), (1000.001, 0, 0), (1000, 0.001, 0)], [(0, 1, 2)])
    mesh = joined((TUBE, other, stray))
    assert same_mesh(without_gaps(mesh), mesh)
