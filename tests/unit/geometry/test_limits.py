"""Limits of meshes and axes: an input just within passes, one just beyond does not."""

import numpy as np
import pytest

from skin_calib_addon.common.errors import InvalidMesh, InvalidPlan
from skin_calib_addon.geometry.grid.axis import axis_through
from skin_calib_addon.geometry.mesh.triangle_mesh import TriangleMesh, check_size
from skin_calib_addon.geometry.mesh.units import likely_mistake
from tests import shapes


def scaled(size):
    """A cylinder whose bounding box has this diagonal [m]."""
    mesh = shapes.cylinder()
    return TriangleMesh(mesh.vertices * size / mesh.size, mesh.faces)


@pytest.mark.parametrize("size", [2.1e-3, 4.9])
def test_links_have_2_mm_to_5_m(size):
    """Within a factor of 1.1 the size is a link; beyond it the message names it."""
    check_size(scaled(size), "m", "a.stl")
    with pytest.raises(InvalidMesh, match=r"a\.stl has a diameter of"):
        check_size(scaled(size * (1.1 if size > 1 else 1 / 1.1)), "m", "a.stl")


def test_links_in_a_plausible_unit_have_a_longest_side_of_5_mm_to_3_m():
    """A side beyond these limits has another unit."""
    assert likely_mistake(5.1e-3) is None and likely_mistake(2.9) is None
    assert likely_mistake(4.9e-3) == ("", 1.0) and likely_mistake(2.9e-3) == ("m", 1e3)
    assert likely_mistake(3.1) == ("cm", 1e-2)


def test_sections_of_an_axis_are_2_percent_of_the_mesh_apart():
    """Two points nearer to each other along the link give no direction."""
    mesh = shapes.cylinder()
    middle, apart = mesh.vertices.mean(axis=0), np.array((0, 0, 0.02 * mesh.size))
    axis_through(mesh, middle, middle + 1.1 * apart)
    with pytest.raises(InvalidPlan, match="too close to each other"):
        axis_through(mesh, middle, middle + 0.9 * apart)
