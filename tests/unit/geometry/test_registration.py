"""Clouds registered to meshes: correct ones stay, wrong ones are found, ambiguous ones are reported as such."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from skin_calib_addon.geometry import registration
from skin_calib_addon.geometry.mesh.distance import closest
from skin_calib_addon.geometry.mesh.face_points import sample_faces
from skin_calib_addon.geometry.registration import (
    ON_MESH_DISTANCE,
    find_frame,
    fit_nearby,
    verdict_of,
)
from tests.examples import slow
from tests.shapes import Motion, box, cylinder, quads, sheet, together, wrist


def on_wrist(seed=0, count=150):
    """Points on the faces of the wrist sample."""
    points = sample_faces(wrist(), 0.02 * wrist().size)[0]
    return points[np.random.default_rng(seed).choice(len(points), count, replace=False)]


def assert_consistent(fit, mesh, points):
    """A proper rotation, and distances that are those of the points before and after the motion."""
    assert_allclose(fit.rotation @ fit.rotation.T, np.eye(3), rtol=0, atol=1e-12)
    assert_allclose(np.linalg.det(fit.rotation), 1, rtol=1e-12)
    moved = points @ fit.rotation.T + fit.translation
    assert_allclose(fit(points), moved, rtol=0, atol=1e-12)
    for there, stated in ((points, fit.before), (moved, fit.after)):
        distance = closest(mesh, there)[0]
        assert_allclose((stated.mean, stated.max), (distance.mean(), distance.max()), rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("seed", [0, slow(1), slow(2)])
def test_cloud_in_another_frame_is_brought_back(seed):
    """Rotated and moved by a metre: the inverse motion is found to a micrometre, and no other pose fits."""
    points, motion = on_wrist(), Motion(seed)
    fit = find_frame(wrist(), motion.points(points))
    assert fit.verdict == "moved"
    assert np.linalg.norm(fit(motion.points(points)) - points, axis=1).max() < 1e-6
    assert fit.after.mean < 1e-6 < 1e-3 < fit.rival
    assert_consistent(fit, wrist(), motion.points(points))


@pytest.mark.nightly
@pytest.mark.parametrize("seed", [0, slow(1), slow(2)])
def test_inner_parts_do_not_catch_a_piece(seed):
    """A small piece of the shell of a link, with boxes between the centre of the link and the piece."""
    low, high = wrist().vertices.min(axis=0), wrist().vertices.max(axis=0)
    places = np.array([(1, 1, 1), (-1, 1, 0), (0, -1, 1), (1, 0, -1), (0, 0, 0)])
    middles = (low + high) / 2 + 0.2 * places * (high - low)
    link = together(wrist(), *(box(m - 0.07 * (high - low), m + 0.07 * (high - low)) for m in middles))
    points = on_wrist(seed, 3000)
    points = points[np.linalg.norm(points - points[0], axis=1) < 0.25 * wrist().size][:120]
    motion = Motion(seed)
    fit = find_frame(link, motion.points(points))
    assert np.linalg.norm(fit(motion.points(points)) - points, axis=1).max() < 1e-5


@pytest.mark.parametrize("height", [0.0, 0.8, -0.8])
def test_cloud_near_the_mesh_stays(height):
    """On it, above it or below it by less than `ON_MESH_DISTANCE`: the verdict is right, without a motion."""
    points = on_wrist()
    _, face, _ = closest(wrist(), points)
    fit = find_frame(wrist(), points + height * ON_MESH_DISTANCE * wrist().face_normals[face])
    assert fit.verdict == "right" and fit.before == fit.after
    assert_allclose(fit.before.mean, abs(height) * ON_MESH_DISTANCE, rtol=0.05, atol=1e-9)
    assert (fit.rotation == np.eye(3)).all() and not fit.translation.any()


@pytest.mark.parametrize(
    "mm, verdict",
    [
        ((50, 0.3, 1.5, 1), "moved"),  # a skin of an iCub on its own part: 0.03 to 0.46 mm, others 1.6 mm or more
        ((50, 0.3, 0.50, 1), "ambiguous"),  # a rival is half as far again, and up to 0.1 mm in 200 mm
        ((50, 0.3, 0.60, 1), "moved"),
        ((50, 0.0, 0.09, 1), "ambiguous"),
        ((50, 0.0, 0.12, 1), "moved"),
        ((50, 0.3, 1.5, 18), "moved"),  # it can slide by a tenth of its size
        ((50, 0.3, 1.5, 22), "ambiguous"),
        ((50, 0.9, 9, 1), "moved"),
        ((50, 1.1, 9, 1), "lost"),
        ((9, 4.0, 9, 1), "lost"),
        ((9, 5.0, 9, 1), "right"),  # no motion halves the distance of a skin of 10 mm or less
        ((11, 6.0, 9, 1), "lost"),
        ((1.6, 0.7, 9, 1), "moved"),
        ((1.6, 0.9, 9, 1), "right"),
    ],
)
def test_verdict_follows_from_distances(mm, verdict):
    """Before and after the motion, in the best different pose, and how far a cloud of 200 mm can slide."""
    assert verdict_of(*(1e-3 * length for length in mm), 0.2) == verdict


def test_slack_of_exact_points_is_that_of_their_rounding():
    """An ellipse with half axes that differ by 4 %: a rotation by an angle t moves a point by 0.04 t sin(2a) outward.

    The normals of the cone are inclined by atan(1/2). Points on the mesh count as 0.05 % of their size off it.
    """
    z, angle = np.meshgrid(np.linspace(-0.02, 0.02, 30), np.linspace(2 * np.pi, 0, 360, endpoint=False), indexing="ij")
    radius = 0.05 * (1 - 0.2 * z / 0.02)  # so steep that it does not slide along the axis
    side = np.stack((1.02 * radius * np.cos(angle), 0.98 * radius * np.sin(angle), z), axis=-1)
    mesh = quads(side, closed=(False, True))
    points = mesh.triangles.mean(axis=1)[::7]
    size = 2 * np.linalg.norm(points - points.mean(axis=0), axis=1).max()
    assert_allclose(find_frame(mesh, points).slack, 5e-4 * size / (0.04 / 2**0.5 * 0.8**0.5), rtol=0.02)


@pytest.mark.parametrize(
    "mesh",
    [
        slow(cylinder(), id="cylinder"),
        pytest.param(box((0, 0, 0), (0.1, 0.05, 0.02)), id="box"),
        slow(sheet(lambda x, y: 0 * x), id="plane"),
    ],
)
def test_symmetric_links_are_ambiguous(mesh):
    """A rotation about the axis, half a turn, a translation in the plane: the verdict is ambiguous."""
    points = sample_faces(mesh, 0.02 * mesh.size)[0]
    points = Motion(5).points(points[:: max(1, len(points) // 120)])
    fit = find_frame(mesh, points)
    assert fit.verdict == "ambiguous"
    assert fit.after.mean < 1e-4 and fit.rival < 1e-3
    assert_consistent(fit, mesh, points)


def test_nearest_of_the_other_poses_decides(monkeypatch):
    """A cube and poses that its symmetry gives, after one that is far off: the frame is ambiguous."""
    mesh, motion = box((-0.05, -0.05, -0.05), (0.05, 0.05, 0.05)), Motion(4)
    points = sample_faces(mesh, 0.02)[0]
    given = motion.points(points)
    back, centre = motion.rotation.T, points.mean(axis=0)
    quarter = Rotation.from_rotvec((0, 0, np.pi / 2)).as_matrix()
    oblique = Rotation.from_rotvec((0.3, 0.2, 0.5)).as_matrix()
    others = [registration.Pose(turn @ back, centre) for turn in (oblique, quarter)]
    for poses, verdict in ((others, "ambiguous"), (others[::-1], "ambiguous"), (others[:1], "moved")):
        monkeypatch.setattr(registration, "_search", lambda *_, poses=poses: (registration.Pose(back, centre), poses))
        fit = find_frame(mesh, given)
        assert fit.verdict == verdict
        assert (fit.rival < 1e-9) == (verdict == "ambiguous")


@pytest.mark.parametrize("count", [1, 2, 3])
def test_few_points_are_ambiguous(count):
    """Three points fit any mesh."""
    assert find_frame(wrist(), on_wrist(count=count) + 0.3).verdict == "ambiguous"


@pytest.mark.nightly
@pytest.mark.parametrize("size", [0.04, slow(0.1)])
def test_noise_is_refused(size):
    """Random points in a box fit no mesh; the reported distances of the best pose are large and correct."""
    points = np.random.default_rng(1).uniform(-size / 2, size / 2, (150, 3)) + 0.2
    fit = find_frame(wrist(), points)
    assert fit.verdict == "lost" and fit.after.mean > 0.01 * size
    assert_consistent(fit, wrist(), points)


@pytest.mark.slow
def test_slack_is_the_distance_that_a_cloud_can_slide():
    """Not at all on a box; without limit about and along a cylinder; further for larger distances."""
    block = box((0, 0, 0), (0.1, 0.05, 0.02))
    points = sample_faces(block, 0.02 * block.size)[0]
    assert find_frame(block, points).slack < 1e-3
    tube = cylinder()
    assert_allclose(find_frame(tube, tube.vertices).slack, 2 * np.hypot(0.05, 0.035), rtol=1e-3)
    noise = np.random.default_rng(3).normal(size=points.shape)
    slacks = [find_frame(block, points + sigma * noise).slack for sigma in (2e-4, 4e-4)]
    assert_allclose(slacks[1] / slacks[0], 2, rtol=0.1)


def at_heights(seed=0, thickness=0.002, noise=1e-4, count=200):
    """Points above a part of the wrist, as taxels of a skin with a thickness are."""
    points, face, _ = sample_faces(wrist(), 0.02 * wrist().size)
    rng = np.random.default_rng(seed)
    chosen = rng.choice(len(points), count, replace=False)
    height = thickness + noise * rng.normal(size=count)
    return points[chosen] + height[:, None] * wrist().face_normals[face[chosen]]


def moved_by(points, degrees, shift, seed):
    """Points rotated about their centre, and moved, in random directions."""
    rng = np.random.default_rng(seed)
    axis, aim = rng.normal(size=(2, 3))
    turn = Rotation.from_rotvec(np.deg2rad(degrees) * axis / np.linalg.norm(axis)).as_matrix()
    centre = points.mean(axis=0)
    return (points - centre) @ turn.T + centre + shift * aim / np.linalg.norm(aim)


@pytest.mark.parametrize("seed", [0, slow(1), slow(2), slow(3)])
@pytest.mark.parametrize("thickness", [0.0, 0.002])
def test_nearby_motion_shows_a_slightly_wrong_frame(seed, thickness):
    """Three degrees and 4 mm pass the mean distance of 3 mm. The best small motion has a clearly smaller residual."""
    points = at_heights(seed, thickness)
    wrong = moved_by(points, 3, 0.004, seed)
    found = fit_nearby(wrist(), wrong)
    assert found.is_better and found.after < 2.5e-4 < 5e-4 < found.before
    back = wrong @ found.rotation.T + found.translation
    assert np.linalg.norm(back - points, axis=1).mean() < 0.5 * np.linalg.norm(wrong - points, axis=1).mean()
    assert_allclose(np.linalg.det(found.rotation), 1, rtol=1e-12)
    fit = find_frame(wrist(), wrong)
    assert fit.verdict != "right" or fit.nearby.is_better


@pytest.mark.parametrize("thickness", [0.0, 0.002, 0.007])
def test_nearby_motion_leaves_a_true_frame(thickness):
    """The height of a skin is no wrong frame, however thick it is; the residual is its noise."""
    found = fit_nearby(wrist(), at_heights(1, thickness))
    assert not found.is_better
    assert found.after <= found.before < 4e-4


def test_nearby_motion_does_not_slide_along_a_cylinder():
    """The link does not fix the taxels along its axis: true taxels stay, and a sideways shift is undone."""
    points = sample_faces(cylinder(), 0.02 * cylinder().size)[0]
    points = points[np.abs(points[:, 2] - 0.05) < 0.03][::7] * (1.02, 1.02, 1)
    assert not fit_nearby(cylinder(), points).is_better
    found = fit_nearby(cylinder(), points + (0.003, 0, 0.002))
    assert found.is_better
    assert_allclose(found.translation[:2], (-0.003, 0), rtol=0, atol=3e-4)
    assert abs(found.translation[2]) < 5e-4
