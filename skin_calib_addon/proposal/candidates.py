"""Regions that may carry skin: full turns about axes, and faces in all directions."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from ..common.arrays import Array, unit
from ..geometry.grid.axis import Axis
from ..geometry.grid.grids import Across, Region, Tube
from ..geometry.mesh.visibility import view_frames
from .link_points import LinkPoints

# [cosine] between a normal and the rays of a region above which the region can cover a point.
MIN_RAY_COSINE = 0.5
# [1] directions of faces, of those with the most area around them. Larger: more surfaces are tried, more
# time (half: 921, double: 950 instead of 943 cm^2 on four links of the G1, the latter in 1.6 times the time).
FACES = 24
# [cosine] between a direction and the normals of the area around it. Larger: directions of smaller faces come
# first (12 degrees: 946, 50 degrees: 938 instead of 943 cm^2 on four links of the G1).
NEAR_COSINE = np.cos(np.deg2rad(25.0))
# [cosine] between two directions of faces above which only the first is tried. Larger: more are tried that are
# nearly the same, more time (4 degrees: no effect on four links of the G1; 16 degrees: one surface less).
SAME_COSINE = np.cos(np.deg2rad(8.0))
# [1] decimals of points [m] and directions. Larger: Blender has another plan. Format: what single precision keeps.
DECIMALS = 6


@dataclass(frozen=True)
class Candidate:
    """A region, and what it is called in reasons."""

    region: Region
    words: str

    def rays(self, points: Array) -> Array:
        """Return the directions of the rays through points (k, 3), shape (k, 3)."""
        region = self.region
        if isinstance(region, Across):
            return np.broadcast_to(unit(region.normal), points.shape)
        assert region.axis is not None
        direction, arms = unit(region.axis.direction), points - region.axis.point
        return unit(arms - (arms @ direction)[:, None] * direction)

    def bound(self, on: LinkPoints) -> float:
        """Return an upper bound of the area that it adds [m^2]."""
        faces_rays = (on.normals * self.rays(on.points)).sum(axis=1) > MIN_RAY_COSINE
        return float(on.areas[on.wanted & faces_rays].sum())


def candidates(on: LinkPoints, axes: Iterable[tuple[Axis, str]]) -> Iterator[Candidate]:
    """Yield the regions that are tried on a link.

    Parameters
    ----------
    on : LinkPoints
        The link.
    axes : iterable of (Axis, str)
        Axes of its joints, and what they are called.
    """
    for axis, words in (*axes, *own_axes(on)):
        yield Candidate(Tube(axis), f"tube about {words}")
    for k, normal in enumerate(face_directions(on)):
        yield Candidate(Across(normal=tuple(np.round(normal, DECIMALS).tolist())), f"face {k}")


def own_axes(on: LinkPoints) -> Iterator[tuple[Axis, str]]:
    """Yield the axes that follow from the shape: principal axes, and the direction that normals avoid."""
    weights = on.areas * on.free
    middle = weights @ on.points / weights.sum()
    arms = (on.points - middle) * np.sqrt(weights)[:, None]
    for k, direction in enumerate(np.linalg.eigh(arms.T @ arms)[1].T[::-1]):
        yield axis_between(on, direction), f"principal axis {k + 1}"
    normals = on.normals * np.sqrt(weights)[:, None]
    yield axis_between(on, np.linalg.eigh(normals.T @ normals)[1][:, 0]), "the direction that its normals avoid"


def axis_between(on: LinkPoints, direction: Array) -> Axis:
    """Return the axis of a direction that the normals of free points meet most nearly.

    Parameters
    ----------
    on : LinkPoints
        The link.
    direction : array, shape (3,)
        Unit vector.
    """
    towards = on.normals @ direction
    across = unit(on.normals - towards[:, None] * direction)
    weights = on.areas * on.free * np.maximum(1 - towards**2, np.finfo(float).eps)
    middle = weights @ on.points / weights.sum()
    # The point p with the least sum of squared distances from the lines: sum w (I - n n^T - d d^T) (x - p) = 0.
    projections = np.eye(3) - across[:, :, None] * across[:, None] - np.multiply.outer(direction, direction)
    matrix = np.einsum("k,kij->ij", weights, projections) / weights.sum()
    right = np.einsum("k,kij,kj->i", weights, projections, on.points - middle) / weights.sum()
    point = middle + np.linalg.lstsq(matrix, right, rcond=1e-3)[0]
    return axis_of(point, direction)


def axis_of(point: Array, direction: Array) -> Axis:
    """Return an axis through a point (3,) [m] along a direction (3,), rounded as Blender keeps it."""
    (x, y, z), (a, b, c) = np.round(point, DECIMALS).tolist(), np.round(direction, DECIMALS).tolist()
    return Axis((x, y, z), (a, b, c))


def face_directions(on: LinkPoints) -> Array:
    """Return the directions that most of the free area faces, shape (k, 3)."""
    half = view_frames()[:, 2]
    directions = np.concatenate((half, -half))
    free = on.free
    weights = (on.normals[free] @ directions.T > NEAR_COSINE).T @ on.areas[free]
    chosen: list[Array] = []
    for k in np.argsort(-weights, kind="stable"):
        near = on.normals[free] @ directions[k] > NEAR_COSINE
        direction = unit(on.areas[free][near] @ on.normals[free][near])
        if weights[k] and all(direction @ other < SAME_COSINE for other in chosen):
            chosen.append(direction)
        if len(chosen) == FACES:
            break
    return np.array(chosen).reshape(-1, 3)
