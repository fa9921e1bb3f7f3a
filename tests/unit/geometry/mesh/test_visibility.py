"""What of a mesh can be seen from outside: exact answers of simple bodies, and rays on real links."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from skin_calib_addon.geometry.mesh.triangle_mesh import TriangleMesh, read_mesh, weld
from skin_calib_addon.geometry.mesh.visibility import (
    MAX_POINTS,
    DepthBuffers,
    are_seen,
    depth_buffers,
    point_distance,
    sample_faces,
    visibility,
)
from tests.oracles import leaves_mesh
from tests.shapes import Motion, box, cylinder, same_mesh, sheet, shuffled, subdivided, together, welded, wrist

DATA = Path(__file__).parents[5] / "shared" / "data"
LINKS = (  # several shells, thin walls, inner boxes, bores; the third one has walls wound inward
    "meshes/hrp4c_r_elbow_p.stl",
    "meshes/icub27_l_upper_leg.stl",
    "meshes/talos_arm_5_forearm.stl",
    "robots/g1_description/meshes/left_hip_pitch_link.STL",
    "robots/g1_description/meshes/left_shoulder_yaw_link.STL",
)


def turned(mesh, chosen):
    """The mesh with some faces wound in reverse."""
    return weld(mesh.vertices, np.where(np.asarray(chosen)[:, None], mesh.faces[:, ::-1], mesh.faces))


def outward(mesh):
    """Normals of the side that is found to be outside."""
    return mesh.face_normals * visibility(mesh).sides[:, None]


def cup(radius, depth, wall):
    """A closed body: a cylinder with a blind hole from above."""
    outer = trimesh.creation.revolve(
        [[0, -wall], [radius + wall, -wall], [radius + wall, depth], [radius, depth], [radius, 0], [0, 0]], sections=64
    )
    return welded(outer)


def test_all_of_a_sphere_is_seen_and_its_outside_found():
    """Also if half of the faces are wound inward."""
    sphere = welded(trimesh.creation.icosphere(4, 0.05))
    mixed = turned(sphere, np.random.default_rng(0).random(len(sphere.faces)) < 0.5)
    for mesh in (sphere, mixed):
        assert visibility(mesh).seen.all()
        assert (np.einsum("fc,fc->f", outward(mesh), mesh.triangles.mean(axis=1)) > 0).all()


def test_all_of_a_torus_is_seen():
    """Also the inner side of its ring, on which half of the space is open."""
    mesh = welded(trimesh.creation.torus(0.06, 0.02, major_sections=96, minor_sections=48))
    assert visibility(mesh).seen.all()
    assert (visibility(mesh).sides == 1).all()


@pytest.mark.slow
@pytest.mark.parametrize("half", [0.15, 0.05, 0.005])
def test_a_box_in_a_box_is_hidden(half):
    """All of the outer one is seen and nothing of the inner one; to the last face, with any winding and size."""
    outer, inner = box((-half,) * 3, (half,) * 3), box((-0.6 * half,) * 3, (0.6 * half,) * 3)
    for change in (lambda m: m, subdivided, lambda m: turned(m, np.ones(len(m.faces)))):
        mesh = change(together(outer, inner))
        is_outer = np.abs(mesh.triangles).max(axis=(1, 2)) > 0.8 * half
        np.testing.assert_array_equal(visibility(mesh).seen, is_outer)
        assert visibility(mesh).fractions[is_outer].min() > 0.97
        assert visibility(mesh).fractions[~is_outer].max() == 0
        centres = mesh.triangles.mean(axis=1)
        assert (np.einsum("fc,fc->f", outward(mesh), centres)[is_outer] > 0).all()


@pytest.mark.parametrize("depth", [0.01, 0.03, 0.06, 0.12])
def test_openness_of_the_bottom_of_a_cup_is_its_view_factor(depth):
    """From the middle of its bottom to its opening: r^2 / (r^2 + h^2)."""
    radius = 0.03
    mesh = cup(radius, depth, 0.005)
    up = depth_buffers(mesh).openness(np.zeros((1, 3)), np.array([[0, 0, 1.0]]))
    assert up[0, 0] == pytest.approx(radius**2 / (radius**2 + depth**2), abs=0.06)
    assert up[1, 0] == 0  # below is the wall


def test_the_bottom_of_a_deep_hole_is_hidden():
    """A bore of 6 mm, 60 mm deep, has a view factor of .0025 at its bottom; the outside is seen."""
    mesh = cup(0.003, 0.06, 0.01)
    radius = np.linalg.norm(mesh.triangles.mean(axis=1)[:, :2], axis=1)
    height, up = mesh.triangles[:, :, 2].mean(axis=1), np.abs(mesh.face_normals[:, 2])
    bottom = (height == 0) & (up > 0.9) & (radius < 0.003)
    assert bottom.any() and not visibility(mesh).seen[bottom].any()
    assert visibility(mesh).seen[(radius > 0.0035)].all()


def test_a_plate_below_a_plate_is_seen_from_its_other_side():
    """Sheets without thickness, 2 mm apart, wound alike: each looks away from the other."""
    low, high = sheet(lambda x, y: 0 * x), sheet(lambda x, y: 0 * x + 0.002)
    mesh = together(low, high)
    is_high = mesh.triangles[:, :, 2].mean(axis=1) > 0.001
    assert visibility(mesh).seen.all()
    np.testing.assert_array_equal(visibility(mesh).sides, np.where(is_high, 1, -1))
    centres = mesh.triangles.mean(axis=1)
    inner = (np.abs(centres[:, :2] - (0.05, 0.04)) < (0.03, 0.02)).all(axis=1)
    away = np.where(is_high, 1, -1)[:, None] * (0, 0, 1.0)
    assert are_seen(mesh, centres[inner], away[inner]).all()
    assert not are_seen(mesh, centres[inner], -away[inner]).any()


@pytest.mark.parametrize("side, open_width, closed_width", [(0.2, 8e-3, 1.3e-3), (0.05, 4.3e-3, 0.72e-3)])
def test_a_floor_is_seen_through_a_slot_of_six_points_and_not_of_one(side, open_width, closed_width):
    """In a box with walls of 0.1 mm; the points are 1.3 mm apart, or 1 % of the size of a small link."""
    half, thin = side / 2, 1e-4
    for width, seen in ((open_width, 1.0), (closed_width, 0.0)):
        low = -4 * width
        link = together(
            box((-half, -half, 0), (-width / 2, half, thin)),
            box((width / 2, -half, 0), (half, half, thin)),
            box((-half, -half, low - thin), (half, half, low)),
            *(box((x - thin, -half, low), (x, half, 0)) for x in (-half, half)),
            *(box((-half, y - thin, low), (half, y, 0)) for y in (-half, half)),
        )
        along = np.linspace(-half / 2, half / 2, 41)
        floor = np.column_stack((0 * along, along, np.full(41, low)))
        assert are_seen(link, floor, np.tile((0, 0, 1.0), (41, 1))).mean() == seen


def test_points_up_to_a_tenth_of_a_millimetre_above_a_face_do_not_hide_it():
    """They are those of the next faces of a concave surface; at 0.15 mm they hide it."""
    x, y = np.meshgrid(np.arange(-0.03, 0.03, 1e-3), np.arange(-0.03, 0.03, 1e-3))
    up = np.array([(0, 0, 1.0)])
    for height, is_open in ((0.7e-4, True), (1.5e-4, False)):
        hiding = np.stack((x, y, 0 * x + height), axis=-1).reshape(-1, 3)
        assert (DepthBuffers.of(hiding, 1e-3).openness(0 * up, up)[0] > 0.5) == is_open


def test_a_floor_below_a_roof_is_seen_up_to_two_and_a_half_heights_from_the_edge():
    """On average over directions of the link; half and twice the least openness give 3.1 and 2 heights."""
    height, step = 0.01, 0.05
    link = together(box((-0.1, -0.1, height), (0, 0.1, height + 1e-3)), box((-0.1, -0.1, -1e-3), (0.05, 0.1, 0)))
    distance = height * np.arange(0.5, 6, step)
    floor = np.column_stack((-distance, 0 * distance, 0 * distance))
    found = []
    for seed in range(12):
        motion = Motion(seed)
        up = np.diff(motion.points(np.array([(0, 0, 0), (0, 0, 1.0)])), axis=0)
        there = are_seen(
            TriangleMesh(motion.points(link.vertices), link.faces), motion.points(floor), up.repeat(len(floor), 0)
        )
        found.append(0.5 + step * there.sum())
    assert 2.2 < np.mean(found) < 2.75


def test_a_single_sheet_keeps_its_winding():
    """Both sides are open, so the winding decides, for all faces alike."""
    dome = sheet(lambda x, y: 0.02 - 2 * ((x - 0.05) ** 2 + (y - 0.04) ** 2))
    for mesh in (dome, turned(dome, np.ones(len(dome.faces)))):
        assert visibility(mesh).seen.all()
        assert (visibility(mesh).sides == 1).all()


def test_points_above_the_mesh_are_seen_and_points_below_it_are_not():
    """1 mm outside and 2 mm inside of a closed cylinder, and far away."""
    mesh = cup(0.03, 0.05, 0.01)
    angle = np.linspace(0, 6, 40)
    normals = np.column_stack((np.cos(angle), np.sin(angle), 0 * angle))
    for radius, seen in ((0.041, True), (0.038, False), (0.035, False), (3.0, True)):
        points = radius * normals + (0, 0, 0.02)
        assert (are_seen(mesh, points, normals) == seen).all()


def test_order_of_faces_and_of_corners_changes_nothing():
    """The same fractions to rounding, and the same sides with regard to the winding."""
    mesh = together(wrist(), box((-0.01, -0.01, 0.03), (0.01, 0.01, 0.07)))
    other = TriangleMesh(*shuffled(mesh, 3))
    assert same_mesh(weld(other.vertices, other.faces), mesh)
    key = [np.lexsort(m.triangles.mean(axis=1).round(9).T) for m in (mesh, other)]
    a, b = (visibility(m).fractions[k] for m, k in zip((mesh, other), key))
    assert np.abs(a - b).mean() < 0.002
    assert (visibility(mesh).seen[key[0]] != visibility(other).seen[key[1]]).mean() < 0.005
    np.testing.assert_array_equal(visibility(mesh).sides[key[0]], visibility(other).sides[key[1]])


def test_points_of_faces_are_dense_and_have_their_area():
    """Each point of a face is near a sample, at tips of slivers, too. Areas are those of the faces."""
    rng = np.random.default_rng(1)
    corners = rng.uniform(-0.02, 0.02, (60, 3, 3))
    corners[:20, 2] = corners[:20, 0] + 0.9 * (corners[:20, 1] - corners[:20, 0]) + rng.normal(0, 1e-4, (20, 3))
    mesh = weld(corners.reshape(-1, 3), np.arange(180).reshape(-1, 3))
    points, face, areas = sample_faces(mesh, 1e-3)
    np.testing.assert_allclose(np.bincount(face, areas), mesh.face_areas, rtol=1e-12)
    for f, triangle in enumerate(mesh.triangles):
        weights = rng.dirichlet((0.4, 0.4, 0.4), 50)
        away = np.linalg.norm((weights @ triangle)[:, None] - points[face == f], axis=2).min(axis=1)
        assert away.max() < 1.5e-3


def test_number_of_points_is_limited():
    """A large mesh of slivers: one point for each face, and at most the limit in addition."""
    long = cylinder(0.2, 2.0, around=2000, along=3)
    distance = point_distance(long)
    assert distance > 2e-3
    assert MAX_POINTS / 4 < len(sample_faces(long, distance)[0]) < MAX_POINTS + len(long.faces)
    assert visibility(cylinder(0.02, 0.03)).seen.all()  # and a small one


def real(name):
    """A real link, without repeated corners."""
    if not (DATA / name).is_file():
        pytest.skip(f"no {name} here")
    return read_mesh(DATA / name)


def sphere_directions(count, seed):
    """Evenly random directions."""
    directions = np.random.default_rng(seed).normal(size=(count, 3))
    return directions / np.linalg.norm(directions, axis=1)[:, None]


@pytest.mark.nightly
@pytest.mark.parametrize("name", LINKS)
def test_visible_area_of_real_links_is_that_of_rays(name):
    """At most 3 % of the area is visible to us but to none of 100 rays, and at most 5 % is open but hidden to us.

    The rays are those of other directions than ours. Openings narrower than a tenth of the half-sphere count as none.
    """
    mesh, rng = real(name), np.random.default_rng(0)
    points, face, areas = sample_faces(mesh, 2e-3)
    chosen = rng.choice(len(points), 300, p=areas / areas.sum())
    face, normals = face[chosen], outward(mesh)[face[chosen]]
    free = leaves_mesh(points[chosen] + 2e-5 * normals, directions := sphere_directions(200, 1), mesh.triangles)
    free &= normals @ directions.T > 0.02
    seen = visibility(mesh).seen[face]
    assert (seen & ~free.any(axis=1)).mean() <= 0.03
    assert (~seen & (free.sum(axis=1) > 10)).mean() <= 0.05
    assert (are_seen(mesh, points[chosen], normals) & ~free.any(axis=1)).mean() <= 0.03


@pytest.mark.nightly
@pytest.mark.parametrize("name", LINKS)
def test_motion_of_a_real_link_changes_little_of_what_is_seen(name):
    """The visible area within 1 %; most faces keep their answer, and nearly all their side.

    Where the inside is open by as much as the limit, directions decide: up to 7 % of the area of one of these links.
    """
    mesh = real(name)
    a, total = visibility(mesh), mesh.face_areas.sum()
    for seed in (0, 1):
        b = visibility(TriangleMesh(Motion(seed).points(mesh.vertices), mesh.faces))
        assert abs(mesh.face_areas @ (a.fractions - b.fractions)) / total < 0.01
        assert (mesh.face_areas @ (a.seen != b.seen)) / total < (0.08 if "talos" in name else 0.025)
        assert (mesh.face_areas @ (a.seen & b.seen & (a.sides != b.sides))) / total < 0.003
