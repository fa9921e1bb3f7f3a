"""Outlines of a mesh: heights along rays across a region, and the point of the mesh at its middle."""

from functools import lru_cache

import numpy as np

from ...common.arrays import Array
from ..mesh.triangle_mesh import TriangleMesh
from .misfits import filled
from .parametrizations import Parametrization, heights

OUTLINE_RAYS = 720  # [1] rays of an outline. Larger: finer features are seen, more time


def outline_positions(parametrization: Parametrization) -> Array:
    """Return the even t of the rays of an outline; the ray at ``OUTLINE_RAYS // 2`` is at the middle of the region."""
    t = np.linspace(*parametrization.breadth, OUTLINE_RAYS + 1)
    return t[:-1] if parametrization.closed else t


def outline_centre(parametrization: Parametrization, s: float, outline: Array) -> Array:
    """Return the point of an outline halfway across the region; of a full turn, opposite to angle zero."""
    middle = OUTLINE_RAYS // 2
    origins, directions = parametrization.rays(np.array([s]), outline_positions(parametrization)[[middle]])
    return np.asarray(origins[0, 0] + outline[middle] * directions[0, 0])


@lru_cache(maxsize=4)  # repeated fits, as in the window, keep the centre of their mesh
def region_centre(mesh: TriangleMesh, parametrization: Parametrization) -> Array | None:
    """Return the point of a mesh at the middle of a region, shape (3,) [m]; None if the section there is empty.

    Over a hole it is between the rims, at an interpolated height.
    """
    s, t = np.array([sum(parametrization.span) / 2]), outline_positions(parametrization)
    outline = np.full((1, len(t)), np.nan)
    middle = slice(OUTLINE_RAYS // 2, OUTLINE_RAYS // 2 + 1)
    outline[:, middle] = heights(mesh, parametrization, s, t[middle])
    if np.isnan(outline).all():
        outline = heights(mesh, parametrization, s, t)
        if np.isnan(outline).all():
            return None
    return outline_centre(parametrization, s[0], filled(outline, parametrization.closed)[0])
