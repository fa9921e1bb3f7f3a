"""Sections: every plane, every face, one at a time against all at once."""

from unittest import mock

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from skin_calib_addon.geometry.mesh.triangle_mesh import weld
from skin_calib_addon.geometry.sampling import samples as samples_module
from skin_calib_addon.geometry.sampling import sections as sections_module
from skin_calib_addon.geometry.sampling.planes import Planes, perpendicular
from skin_calib_addon.geometry.sampling.samples import framed_sections, known_sections
from skin_calib_addon.geometry.sampling.sections import cut_sections
from tests.oracles import cut_triangle, rim_in_plane
from tests.shapes import LENGTH, Motion, box, cylinder, wrist

seeds = st.integers(0, 2**32 - 1)
UP = (0.0, 0.0, 1.0)


def level(heights, normal=UP):
    """Parallel planes."""
    points = np.outer(heights, normal)
    return Planes(points, np.tile(normal, (len(points), 1)))


def tilted_too(planes):
    """The same planes and one more of another direction, so that no short cut for parallel ones applies."""
    return Planes(np.vstack((planes.points, (0, 0, 0.04))), np.vstack((planes.normals, (0.6, 0.0, 0.8))))


@st.composite
def grainy_meshes(draw):
    """Random triangles on a coarse grid of coordinates, so that vertices often have equal heights."""
    count = draw(st.integers(3, 12))
    vertices = draw(st.lists(st.tuples(*3 * [st.integers(0, 4)]), min_size=count, max_size=count, unique=True))
    corners = st.permutations(range(count)).map(lambda order: order[:3])
    return weld(np.array(vertices) / 4, draw(st.lists(corners, min_size=1, max_size=20)))


def assert_is_the_oracle(sections, mesh, planes):
    """The same pairs of plane and face, each once, and the same two ends."""
    found = dict(zip(zip(sections.plane.tolist(), sections.face.tolist()), sections.ends))
    assert len(found) == len(sections.plane)
    for i, (point, normal) in enumerate(zip(planes.points, planes.normals)):
        for j, corners in enumerate(mesh.triangles):
            expected, got = cut_triangle(corners, point, normal), found.pop((i, j), None)
            expected = rim_in_plane(mesh, j, point, normal) if expected is None else expected
            assert (expected is None) == (got is None)
            if expected is not None:
                off = min(np.abs(got - expected).max(), np.abs(got - expected[::-1]).max())
                assert off < 1e-12
    assert not found


@given(mesh=grainy_meshes(), heights=st.lists(st.integers(-1, 9), min_size=1, max_size=5))
def test_sections_are_those_of_one_face_at_a_time(mesh, heights):
    """Parallel planes in any order, doubled or missing the mesh, mostly through vertices: both paths, every end."""
    planes = level(np.array(heights) / 8)
    assert_is_the_oracle(cut_sections(mesh, planes), mesh, planes)
    assert_is_the_oracle(cut_sections(mesh, tilted_too(planes)), mesh, tilted_too(planes))


@given(mesh=grainy_meshes(), seed=seeds)
def test_tilted_sections_are_those_of_one_face_at_a_time(mesh, seed):
    """Planes of random directions."""
    rng = np.random.default_rng(seed)
    planes = Planes(rng.uniform(0, 1, (4, 3)), rng.normal(size=(4, 3)))
    assert_is_the_oracle(cut_sections(mesh, planes), mesh, planes)


@given(seed=seeds)
def test_sections_of_a_closed_mesh_are_closed_to_the_bit(seed):
    """Every end of a segment is the start of exactly one other: the two faces at an edge agree in each bit."""
    motion = Motion(seed)
    mesh = motion.mesh(box((0, 0, 0), (0.1, 0.07, 0.05)))
    rng = np.random.default_rng(seed)
    normals = rng.normal(size=(3, 3))
    planes = Planes(motion.points((0.05, 0.035, 0.025)) + rng.uniform(-0.01, 0.01, (3, 3)), normals)
    for cut in (planes, Planes(planes.points, np.tile(normals[0], (3, 1)))):
        sections = cut_sections(mesh, cut)
        for i in range(3):
            starts, stops = (sorted(map(bytes, sections.ends[sections.plane == i, k])) for k in (0, 1))
            assert len(starts) >= 3
            assert starts == stops


@given(k=st.integers(1, 4), nudge=st.sampled_from((0.0, 1e-17, 1e-12, -1e-12)))
def test_section_through_vertices_is_closed(k, nudge):
    """A plane exactly through a ring of vertices, or next to it, gives one closed turn about the axis."""
    mesh = cylinder(around=16, along=6)
    height = np.unique(mesh.vertices[:, 2])[k] + nudge
    ends = cut_sections(mesh, level([height])).ends
    assert sorted(map(bytes, ends[:, 0])) == sorted(map(bytes, ends[:, 1]))
    angle = np.arctan2(ends[..., 1], ends[..., 0])
    turn = (np.diff(angle, axis=1)[:, 0] + np.pi) % (2 * np.pi) - np.pi
    assert_allclose(abs(turn.sum()), 2 * np.pi, rtol=1e-12)
    assert (turn * np.sign(turn.sum()) > -1e-12).all()


def test_planes_through_top_and_bottom_meet_all_sides():
    """A vertex on the plane counts as below it, and a rim of the mesh in the plane is a section."""
    block = box((0, 0, 0), (1, 1, 1))
    sections = cut_sections(block, level([0.0, 1.0]))
    assert np.bincount(sections.plane, minlength=2).tolist() == [8, 4]
    assert (sections.ends[..., 2] == sections.plane[:, None]).all()
    lengths = np.linalg.norm(sections.ends[:, 1] - sections.ends[:, 0], axis=1)
    assert_allclose(np.bincount(sections.plane, lengths), 4.0, rtol=1e-15)  # each side once


def test_ridge_in_the_plane_is_one_curve():
    """Two faces below their common edge give it once; a face above the edge leaves the cut of that face."""
    vertices, faces = ((0, 0, 1), (1, 0, 1), (0, 1, 0), (0, -1, 0), (0, 0, 2)), ((0, 1, 2), (1, 0, 3), (0, 1, 4))
    roof, wall = weld(vertices, faces[:2]), weld(vertices, faces)
    for planes in (level([1.0, 1.0]), tilted_too(level([1.0, 1.0]))):
        for mesh in (roof, wall):
            sections = cut_sections(mesh, planes)
            assert np.bincount(sections.plane)[:2].tolist() == [1, 1]
            assert (np.sort(sections.ends[0], axis=0) == ((0, 0, 1), (1, 0, 1))).all()


@given(seed=seeds)
def test_rim_and_cuts_next_to_it_are_one_closed_curve(seed):
    """A tube whose upper rim is partly in the plane and partly above it: ends are equal to the bit."""
    rng = np.random.default_rng(seed)
    tube = cylinder(around=16, along=6)
    top = tube.vertices[:, 2] == LENGTH
    raised = tube.vertices + np.outer(top * rng.integers(0, 2, len(top)), (0, 0, rng.uniform(1e-4, 1e-2)))
    motion = Motion(seed)
    mesh = motion.mesh(weld(raised, tube.faces))
    planes = Planes(motion.points((0, 0, LENGTH))[None], motion.directions(UP)[None])
    for cut in (planes, tilted_too(planes)):
        sections = cut_sections(mesh, cut)
        ends = sections.ends[sections.plane == 0]
        long = (ends[:, 0] != ends[:, 1]).any(axis=1)
        starts, stops = (sorted(map(bytes, ends[long, k])) for k in (0, 1))
        assert len(starts) >= 16 and starts == stops


@pytest.mark.parametrize("planes", [level([0.02, 0.05]), tilted_too(level([0.02, 0.05]))])
def test_segments_have_the_face_normal_on_their_right(planes):
    """Seen with the plane's normal towards the eye, a walk along a segment has the outside of the face on its right."""
    for mesh in (cylinder(), box((-0.03, -0.03, 0), (0.03, 0.03, 0.1))):
        sections = cut_sections(mesh, planes)
        along = sections.ends[:, 1] - sections.ends[:, 0]
        right = np.cross(along, planes.normals[sections.plane])
        long = np.linalg.norm(along, axis=1) > 1e-6
        assert ((right * mesh.face_normals[sections.face]).sum(axis=1)[long] > 0).all()


def test_sections_of_nothing_are_empty():
    """Planes that all miss the mesh give no segments, and are still counted."""
    for planes in (level([-1.0, 2.0]), tilted_too(level([-1.0, 2.0]))):
        sections = cut_sections(box((0, 0, 1), (0.1, 0.1, 1.1)), planes)
        assert sections.ends.shape == (0, 2, 3) and sections.planes == len(planes)


def test_planes_are_parallel_only_to_the_bit():
    """Normals are scaled to one; families are parallel if all are the same."""
    planes = Planes(np.zeros((2, 3)), np.array(((0, 0, 2.0), (0, 0, 5.0))))
    assert planes.are_parallel() and (planes.normals == UP).all() and len(planes) == 2
    assert not Planes(np.zeros((2, 3)), np.array(((0, 0, 1.0), (0, 1e-9, 1.0)))).are_parallel()


@given(seed=seeds)
def test_planes_made_of_planes_are_the_same(seed):
    """Scaling normals to one a second time changes no bit, so that a plan file repeats a scene exactly."""
    rng = np.random.default_rng(seed)
    planes = Planes(rng.normal(size=(20, 3)), rng.normal(size=(20, 3)))
    assert (Planes(planes.points, planes.normals).normals == planes.normals).all()


@given(mesh=grainy_meshes(), seed=seeds)
def test_faces_near_the_planes_give_the_same_sections(mesh, seed):
    """Parallel planes and single ones to the bit, tilted ones but for rounding, through vertices and next to them."""
    rng = np.random.default_rng(seed)
    normal = perpendicular(rng.normal(size=3)) if seed % 2 else np.array(UP)
    points = rng.choice(mesh.vertices, 5) + rng.choice((0.0, 5e-8, -5e-8, 0.01), (5, 1)) * normal
    even = np.tile(normal, (5, 1))
    for normals in (even, even + 0.1 * rng.normal(size=(5, 3)), even + rng.normal(size=(5, 3))):
        for planes in (Planes(points, normals), Planes(points[:1], normals[:1])):
            expected = cut_sections(mesh, planes)
            with mock.patch.object(sections_module, "MIN_SORTED_FACES", 0):
                for _ in range(2):  # faces are sorted at the second use
                    found = cut_sections(mesh, planes)
                    assert (cut_sections(mesh, planes).ends == expected.ends).all()
            assert (found.plane == expected.plane).all() and (found.face == expected.face).all()
            assert_allclose(found.ends, expected.ends, atol=0 if planes.are_parallel() else 1e-12)


def test_known_sections_are_those_of_all_planes():
    """After a plane moves, only it is cut again; the result is that of all planes."""
    mesh, axes = wrist(), np.array((((1.0, 0, 0), (0, 1.0, 0)),))
    cut = []
    with mock.patch.object(samples_module, "cut_sections", lambda *a: cut.append(len(a[1])) or cut_sections(*a)):
        for heights in ((0.02, 0.05, 0.08), (0.02, 0.06, 0.08), (0.06, 0.05)):
            planes = level(heights)
            found, ends = known_sections(mesh, planes, axes)
            expected, expected_ends = framed_sections(mesh, planes, axes)
            assert (found.plane == expected.plane).all() and (found.face == expected.face).all()
            assert (found.ends == expected.ends).all() and (ends == expected_ends).all()
    assert cut == [3, 3, 1, 3, 2]
    planes = level((0.02, 0.05))
    turned = Planes(planes.points, planes.normals + ((0, 0, 0), (0.1, 0, 0)))
    frames = np.repeat(axes, 2, axis=0)
    for family, of in ((planes, axes), (turned, frames)):  # the same plane has coordinates of another kind
        found, expected = (cut(mesh, family, of) for cut in (known_sections, framed_sections))
        assert (found[0].ends == expected[0].ends).all() and (found[1] == expected[1]).all()
