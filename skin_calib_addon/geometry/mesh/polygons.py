"""Divide the polygons of mesh files into triangles."""

from typing import Any

import numpy as np

from ...common.arrays import Array, IntArray, cross, norms, unit
from ...common.errors import InvalidMesh

# [1] of the squared extent of a polygon that triangles of a fan may overlap, and that has no area. Larger: triangles
# overlap where a polygon is slightly concave. Smaller: rounding of straight or equal sides makes polygons concave.
MAX_OVERLAP = 1e-6
MAX_CORNERS = 2000  # of a polygon. Larger: malicious concave ones take minutes


def check_indices(corners: IntArray, vertices: int) -> None:
    """Refuse corners of faces that are no vertices."""
    wrong = corners[(corners < 0) | (corners >= vertices)]
    if len(wrong):
        raise InvalidMesh(f"A face refers to vertex {wrong[0]}, but the mesh has {vertices} vertices. Export it again.")


def triangulated(vertices: Array, corners: Any, counts: Any) -> IntArray:
    """Return the triangles (f, 3) of polygons, given by their corners one after another, and how many each has.

    Polygons become fans of their first corner, as in other programs. Where triangles of a fan would overlap, because
    the polygon is concave, ears are cut off. Polygons of less than three corners have no area.
    """
    corners, counts = np.asarray(corners, np.int64), np.asarray(counts, np.int64)
    if counts.max(initial=0) > MAX_CORNERS:
        raise ValueError(f"it has a polygon of {counts.max()} corners; export triangles")
    check_indices(corners, len(vertices))
    fans = np.maximum(counts - 2, 0)
    first = np.repeat(np.cumsum(counts) - counts, fans)
    second = first + 1 + np.arange(fans.sum()) - np.repeat(np.cumsum(fans) - fans, fans)
    triangles = corners[np.column_stack((first, second, second + 1))]
    if counts.max(initial=0) <= 3:
        return triangles
    polygon = np.repeat(np.arange(len(counts)), fans)
    with np.errstate(invalid="ignore", over="ignore"):  # vertices that are not finite are refused later
        a, b, c = vertices[triangles.T]
        areas = cross(b - a, c - a)
        total = np.column_stack([np.bincount(polygon, column, len(counts)) for column in areas.T])
        extent = np.zeros(len(counts))
        np.maximum.at(extent, polygon, norms(c - a))
        overlaps = (areas * unit(total)[polygon]).sum(axis=1) < -MAX_OVERLAP * extent[polygon] ** 2
    concave = np.unique(polygon[overlaps])
    ends = np.cumsum(counts)
    for i in concave.tolist():
        own = corners[ends[i] - counts[i] : ends[i]]
        triangles[polygon == i] = own[_ears(vertices[own], total[i], MAX_OVERLAP * extent[i] ** 2)]
    return triangles


def _ears(points: Array, normal: Array, least: float) -> list[tuple[int, int, int]]:
    """Return the triangles of a polygon (k, 3) with this normal: corners that contain no other one are cut off.

    Triangles with twice an area of ``least`` [m^2] or less have none.
    """
    x, y = np.delete(points, np.abs(normal).argmax(), axis=1).T
    z = x + 1j * y
    if _turn(z[0], z[1:-1], z[2:]).sum() < 0:
        z = z.conjugate()
    ring, ears = list(range(len(z))), []
    while ring:
        triples = [(ring[at - 2], ring[at - 1], ring[at]) for at in range(len(ring))]
        ear = next((triple for triple in triples if _is_ear(z, triple, ring, least)), None)
        if ear is None:  # what is left has no area
            ear = min(triples, key=lambda triple: abs(_turn(*z[list(triple)])))
            if abs(_turn(*z[list(ear)])) > least:
                raise ValueError(f"it has a polygon of {len(z)} corners that crosses itself; export triangles")
        ears.append(ear)
        ring = [corner for corner in ring if corner != ear[1]] if len(ring) > 3 else []
    return ears


def _is_ear(z: Any, triple: tuple[int, int, int], ring: list[int], least: float) -> bool:
    """Return whether the triangle of a corner and its neighbours is convex and contains no other corner."""
    a, b, c = z[list(triple)]
    if _turn(a, b, c) <= least:
        return False
    others = z[ring]
    others = others[(others != a) & (others != b) & (others != c)]  # bridges to holes have their corners twice
    sides = np.minimum(np.minimum(_turn(a, b, others), _turn(b, c, others)), _turn(c, a, others))
    return not (sides >= -least).any()


def _turn(a: Any, b: Any, c: Any) -> Any:
    """Return twice the signed areas of triangles in the complex plane."""
    return ((b - a).conjugate() * (c - a)).imag
