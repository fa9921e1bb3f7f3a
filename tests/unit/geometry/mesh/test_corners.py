"""Corners of a mesh: the vertices that a subdivision cannot add."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from skin_calib_addon.geometry import weld
from skin_calib_addon.geometry.mesh.corners import are_corners, facet_corners, undivided
from skin_calib_addon.geometry.mesh.triangle_mesh import TriangleMesh
from tests.shapes import Motion, box, cylinder, subdivided


def corners(mesh):
    """Return the coordinates of all corners."""
    return mesh.vertices[are_corners(mesh, np.ones(len(mesh.vertices), bool))]


@pytest.mark.parametrize("rounds", [0, 1, 3])
def test_box_has_eight_corners(rounds):
    """However often its faces are divided, and in any position, also in single precision."""
    whole = mesh = box((0, 0, 0), (0.1, 0.2, 0.3))
    for _ in range(rounds):
        mesh = subdivided(mesh)
    assert len(mesh.faces) == 12 * 4**rounds
    assert_array_equal(corners(mesh), whole.vertices)
    moved = Motion(5, 1.0).mesh(mesh)
    assert len(corners(weld(moved.vertices.astype(np.float32), moved.faces))) == 8


def test_every_vertex_of_a_scan_is_a_corner():
    """Noise of 30 um on a cylinder, whose own vertices are on straight lines; a subdivision adds no corner."""
    assert len(corners(cylinder())) == 0
    rng = np.random.default_rng(0)
    scan = weld(cylinder().vertices + rng.normal(0, 3e-5, cylinder().vertices.shape), cylinder().faces)
    assert len(corners(scan)) > 0.97 * len(scan.vertices)
    assert len(corners(subdivided(scan))) == len(corners(scan))


@pytest.mark.parametrize("rounds", [0, 2])
def test_facets_of_faces_have_their_corners(rounds):
    """One small face of a box stands for its side, and has the four corners of that side; so do two of one side."""
    mesh = box((0, 0, 0), (1, 1, 1))
    for _ in range(rounds):
        mesh = subdivided(mesh)
    right = np.flatnonzero(mesh.face_normals[:, 0] > 0.5)
    for faces in (right[:1], right[-2:]):
        found = facet_corners(mesh, faces)
        assert found.sum() == 4 and (mesh.vertices[found, 0] == 1).all()


def test_undivided_faces_are_whole_facets():
    """Sixteen faces for each of a box are two again; each face is in its parent, and no area is lost."""
    whole = box((0, 0, 0), (0.06, 0.05, 0.04))
    mesh = subdivided(subdivided(whole))
    faces, parent = undivided(mesh, np.zeros(len(mesh.vertices), bool))
    again = TriangleMesh(mesh.vertices, faces)
    assert len(faces) == len(whole.faces) == 12
    assert_allclose(np.bincount(parent, mesh.face_areas), again.face_areas)
    assert_allclose(again.face_normals[parent], mesh.face_normals, atol=1e-12)
    kept, parent = undivided(mesh, np.ones(len(mesh.vertices), bool))
    assert len(kept) == len(mesh.faces)


def test_undivided_keeps_the_rings_of_a_tube():
    """The vertices on the straight sides of a tube have the normals of the true surface."""
    tube = cylinder(0.03, 0.1)
    faces, parent = undivided(tube, np.zeros(len(tube.vertices), bool))
    assert_array_equal(faces[parent], tube.faces)
