"""Coarse meshes for previews: few faces about the same surface."""

import numpy as np

from skin_calib_addon.geometry.mesh.clustering import COARSE_FACES, coarse_cover, coarse_mesh
from skin_calib_addon.geometry.mesh.cover import CoverSpec, Cut, cut_cover
from skin_calib_addon.geometry.mesh.distance import closest
from tests.shapes import box, cylinder, same_mesh, together

FINE = cylinder(around=240, along=120)


def test_small_mesh_stays_as_it_is():
    """There is nothing to gain."""
    mesh = cylinder()
    assert len(mesh.faces) <= COARSE_FACES
    assert coarse_mesh(mesh) is mesh


def test_coarse_mesh_is_near_the_surface_and_keeps_its_rims():
    """Fewer faces, within the height of a facet of a cell, and of the same length to rounding."""
    coarse = coarse_mesh(FINE)
    assert COARSE_FACES / 4 < len(coarse.faces) < 1.5 * COARSE_FACES
    assert closest(FINE, coarse.vertices)[0].max() < 2e-4
    assert coarse.face_areas.sum() > 0.99 * FINE.face_areas.sum()
    for which in (np.min, np.max):
        assert abs(which(coarse.vertices[:, 2]) - which(FINE.vertices[:, 2])) < 1e-6


def test_both_sides_of_a_thin_wall_stay_apart():
    """The normals differ, though both sides are in one cell: the mean would be in the middle of the wall."""
    inside = cylinder(radius=0.0345, around=240, along=120)
    wall = together(FINE, type(inside)(inside.vertices, inside.faces[:, ::-1]))
    radius = np.linalg.norm(coarse_mesh(wall).vertices[:, :2], axis=1)
    between = (radius > 0.03465) & (radius < np.linalg.norm(FINE.vertices[0, :2]) - 1.5e-4)
    assert not between.any()


def test_coarse_cover_has_the_cuts_exactly_and_no_inner_parts():
    """Parts that are inside before the cuts are left out, and the rim is in the plane of the cut."""
    mesh = together(FINE, box((-0.01, -0.01, 0.03), (0.01, 0.01, 0.07)))
    spec = CoverSpec("outer", (Cut((0.0, 0.0, 0.052), (0.0, 0.0, -1.0)),))
    cover = coarse_cover(mesh, spec)
    assert cover.vertices[:, 2].max() == 0.052
    assert same_mesh(cover, coarse_cover(FINE, spec))
    exact = cut_cover(mesh, spec)
    assert abs(cover.face_areas.sum() / exact.face_areas.sum() - 1) < 0.01
