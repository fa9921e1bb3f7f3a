"""Signed distances, and how near the mesh of a tool comes to that of a link."""

import numpy as np
import pytest
import trimesh
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from skin_calib_addon.geometry.mesh.approach import SignedDistance, Tool
from skin_calib_addon.geometry.mesh.triangle_mesh import TriangleMesh

RADIUS, TIP = 0.05, 0.005  # [m] of the link, a sphere, and of the tip of a tool


def of(mesh):
    """Return the mesh of the project."""
    return TriangleMesh(np.array(mesh.vertices), np.array(mesh.faces))


SPHERE = of(trimesh.creation.icosphere(5, RADIUS))
BALL = of(trimesh.creation.icosphere(3, TIP))


@pytest.mark.parametrize("angle", [0.0, 0.9])
def test_sign_is_exact_next_to_faces_edges_and_corners(angle):
    """A box, and the same with a corner cut off to 20 degrees; all points whose sign the planes of its faces state."""
    sides = np.array((0.02, 0.03, 0.04))
    mesh = trimesh.creation.box(2 * sides)
    planes = np.vstack((np.eye(3), -np.eye(3)))
    limits = np.tile(sides, 2)
    if angle:
        normal = np.array((np.cos(angle), np.sin(angle), 0.1)) / np.linalg.norm((1.0, 0.1))
        planes, limits = np.vstack((planes, normal)), np.append(limits, 0.015)
        mesh = trimesh.convex.convex_hull(mesh.slice_plane(0.015 * normal, -normal))
    points = np.random.default_rng(0).uniform(-0.06, 0.06, (4000, 3))
    signed, at_rim = SignedDistance(of(mesh))(points)
    heights = (points @ planes.T - limits).max(axis=1)
    assert ((signed > 0) == (heights > 0)).all() and not at_rim.any()
    assert_allclose(signed[heights < 0], heights[heights < 0], atol=1e-12)


def test_next_to_a_rim_there_is_no_inside():
    """Behind the plane of an open half sphere, but beyond its rim, a point is outside, and said to be at the rim."""
    half = SPHERE.triangles.mean(axis=1)[:, 2] > 0
    signed, at_rim = SignedDistance(TriangleMesh(SPHERE.vertices, SPHERE.faces[half]))(
        np.array(((0, 0, 0.04), (0.03, 0, -0.08), (0.07, 0, 0.02)))
    )
    assert at_rim.tolist() == [False, True, False]
    assert signed[0] < 0 < signed[1] and signed[2] > 0


@pytest.mark.parametrize("depth", [-0.8e-3, -1e-5, 2e-4, 1.5e-3])
def test_depth_and_point_of_a_round_tip(depth):
    """At any side of the link; the centroid exists if the tip is inside, and is near."""
    link, tool, rng = SignedDistance(SPHERE), Tool(BALL), np.random.default_rng(0)
    for _ in range(5):
        normal = rng.normal(size=3)
        normal /= np.linalg.norm(normal)
        turn = Rotation.random(random_state=rng).as_matrix()
        found = tool.approach(link, turn, (RADIUS + TIP - depth) * normal)
        assert found.distance == pytest.approx(-depth, abs=1e-4)  # by the facets
        assert_allclose(found.point, (RADIUS - depth) * normal, atol=4e-4)
        assert (found.centroid is not None) == (found.distance < 0) and not found.is_at_rim
        if found.centroid is not None:
            assert np.linalg.norm(found.centroid - found.point) < 1e-3
            assert np.linalg.norm(found.centroid) < RADIUS


def test_flat_tool_touches_between_its_corners():
    """A box of twelve triangles on the sphere: the point is below its middle, where it has no vertex."""
    box = of(trimesh.creation.box((0.04, 0.03, 0.02)))
    found = Tool(box).approach(SignedDistance(SPHERE), np.eye(3), np.array((0.004, -0.003, RADIUS + 0.01 - 5e-4)))
    assert found.distance == pytest.approx(-5e-4, abs=2e-5)
    assert_allclose(found.point, (0, 0, RADIUS - 5e-4), atol=2e-4)


def test_sharp_tip_touches_at_its_end():
    """A cone on a plate: nothing else is as near."""
    cone = of(trimesh.creation.cone(0.002, 0.02, sections=12).apply_transform(np.diag((1, -1, -1, 1.0))))
    plate = SignedDistance(of(trimesh.creation.box((0.1, 0.1, 0.01))))
    found = Tool(cone).approach(plate, np.eye(3), np.array((0.01, 0.02, 0.005 + 0.02 + 3e-4)))
    assert found.distance == pytest.approx(3e-4, abs=1e-9)
    assert_allclose(found.point, (0.01, 0.02, 0.0053), atol=5e-5)


def test_nearest_points_far_from_each_other_are_spread():
    """Two tips at the same distance: their mean is between them, which the spread states."""
    tips = [trimesh.creation.icosphere(2, TIP).apply_translation((x, 0, 0)) for x in (-0.01, 0.01)]
    plate = of(trimesh.creation.box((0.1, 0.1, 0.01)))
    found = Tool(of(trimesh.util.concatenate(tips))).approach(
        SignedDistance(plate), np.eye(3), np.array((0, 0, 0.005 + TIP))
    )
    assert found.spread == pytest.approx(0.01, rel=0.02) and abs(found.distance) < 1e-9
