"""The points at which distances are measured, and the statistics of distances."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from skin_calib_addon.common.surface_errors import DistanceStatistics
from skin_calib_addon.geometry.mesh.visibility import sample_faces
from skin_calib_addon.geometry.surface.distance import surface_samples
from tests.oracles import nearest_on_triangle
from tests.shapes import box, plane_surface


def test_samples_stand_for_all_of_the_area():
    """The weights of a surface's samples add up to its area, those of a mesh's points to that of each face."""
    uv, weights = surface_samples(plane_surface())
    assert_allclose(weights.sum(), 0.1 * 0.08, rtol=1e-12)
    assert ((uv > 0) & (uv < 1)).all()
    mesh = box((0, 0, 0), (0.1, 0.05, 0.001))
    points, face, parts = sample_faces(mesh, 0.02 * mesh.size)
    assert (np.bincount(face) == parts**2).all()
    for p, f in zip(points[::7], face[::7]):
        assert np.linalg.norm(nearest_on_triangle(p, mesh.triangles[f]) - p) < 1e-15


def test_split_faces_leave_no_large_gap():
    """No point of a long face is further from a sample than a fiftieth of the mesh."""
    mesh = box((0, 0, 0), (0.2, 0.01, 0.01))
    points, _, _ = sample_faces(mesh, 0.02 * mesh.size)
    rng = np.random.default_rng(4)
    spots = np.einsum("fsk,fkc->fsc", rng.dirichlet(np.ones(3), (12, 40)), mesh.triangles).reshape(-1, 3)
    assert np.linalg.norm(spots[:, None] - points, axis=2).min(axis=1).max() < 0.02 * mesh.size


@given(values=st.lists(st.tuples(st.floats(0, 1), st.floats(1e-3, 1)), min_size=1, max_size=9))
def test_statistics_are_weighted(values):
    """Mean and root mean square by area, the maximum whatever its area."""
    d, w = np.array(values).T
    found = DistanceStatistics.of(d, w)
    assert_allclose(found.mean, sum(a * b for a, b in values) / sum(w), rtol=1e-12, atol=1e-300)
    assert_allclose(found.rms, np.sqrt(sum(a * a * b for a, b in values) / sum(w)), rtol=1e-12, atol=1e-150)
    assert found.max == max(d)
