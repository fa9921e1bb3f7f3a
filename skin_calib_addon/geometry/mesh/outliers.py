"""Outliers of a mesh: single vertices that stand off from a smooth surface around them, and parts far from the rest."""

from functools import lru_cache

import numpy as np

from ...common.arrays import Array, BoolArray, IntArray, cross, unit
from ...common.errors import counted, millimetres
from ...common.warnings import Place, Warning, point_of
from .triangle_mesh import TriangleMesh, at_rims

# [m] least height of an outlier over its neighbours. Larger: small outliers remain, which move the surface by a
# fraction of their height.
MIN_OUTLIER_HEIGHT = 1.5e-3
# [1] least ratio of the height of an outlier to that of its neighbours without it. Larger: fewer outliers are found,
# above all next to edges. At 4, decimated links of robots have vertices that are taken for outliers.
MIN_HEIGHT_RATIO = 10.0
# [cosine] least one between the plane of the neighbours and the faces around an outlier that is moved to their mean.
# Smaller: more vertices next to edges are outliers.
MIN_RING_COSINE = 0.9
# [1] least ratio of the height of an outlier to its distance along the plane from the mean of its neighbours. Larger:
# fewer outliers are found among triangles of different sizes.
MIN_STEEPNESS = 2.0
# [1] most rounds; each removes the highest outlier of each group. Larger: larger groups of outliers are found.
MAX_ROUNDS = 6
# [fraction of the faces] of all stray parts together. Larger: parts of the link are called stray.
MAX_STRAY_FRACTION = 0.01
# [fraction of the size of the rest] least distance of a stray part from the box around the rest. Larger: fewer are
# named.
MIN_STRAY_DISTANCE = 0.1


def stray_part(mesh: TriangleMesh) -> str:
    """Return a sentence about the part that is farthest from the rest of the mesh, with a space before it, or nothing.

    Such a part, as a facet that was left over, changes the ends of the link, and thereby its sections and axis.
    """
    counts = np.bincount(mesh.pieces)
    loose = (counts < MAX_STRAY_FRACTION * counts.sum())[mesh.pieces]
    if not 0 < loose.sum() < MAX_STRAY_FRACTION * len(loose):  # of a link of many small parts, none is stray
        return ""
    middles, rest = mesh.triangles.mean(axis=1), mesh.triangles[~loose].reshape(-1, 3)
    low, high = rest.min(axis=0), rest.max(axis=0)
    beyond = np.linalg.norm(np.maximum(np.maximum(low - middles, middles - high), 0), axis=1) * loose
    face = int(beyond.argmax())
    if beyond[face] < MIN_STRAY_DISTANCE * np.linalg.norm(high - low):
        return ""
    part = counted(int(counts[mesh.pieces[face]]), "face")
    return (
        f" A loose part of {part} at {millimetres(middles[face])} is {beyond[face] * 1e3:.1f} mm away from the rest of "
        "the mesh: delete it if it is left over."
    )


@lru_cache(maxsize=4)
def without_outliers(mesh: TriangleMesh) -> tuple[TriangleMesh, tuple[Warning, ...]]:
    """Return a mesh whose outliers are moved to the mean of their neighbours, and a warning if there are any."""
    vertices, heights = flattened(mesh)
    found = np.flatnonzero(heights)
    if len(found) == 0:
        return mesh, ()
    highest = int(np.abs(heights).argmax())
    place = Place(point=point_of(mesh.vertices[highest]))
    one = len(found) == 1
    text = "One vertex of the mesh stands" if one else f"{len(found)} vertices of the mesh stand"
    height = float(np.abs(heights[highest]))
    message = (
        f"{text} off from the surface around by up to {height * 1e3:.1f} mm, {place.words}. "
        f"The fit leaves {'it' if one else 'them'} out."
    )
    advice = "Look at the mesh there, and delete or move what is wrong."
    return TriangleMesh(vertices, mesh.faces), (Warning("outlier-vertices", "warning", message, place, height, advice),)


def flattened(mesh: TriangleMesh) -> tuple[Array, Array]:
    r"""Return the vertices with all outliers at the mean of their neighbours, and the heights that they had.

    The neighbours of a vertex :math:`\mathbf{p}` have the mean :math:`\mathbf{c}`, and the faces around it have the sum
    :math:`\mathbf{a}` of their vector areas, which does not depend on :math:`\mathbf{p}`. Its height is

    .. math::

        h = \frac{\mathbf{a}}{|\mathbf{a}|} \cdot (\mathbf{p} - \mathbf{c}) \quad [\text{m}]

    A vertex is an outlier if all its neighbours but one have a much smaller height as soon as it is at their mean.
    Next to an edge, at least two neighbours are as high. Vertices at open rims are not tested.
    """
    faces, moved, total = mesh.faces, mesh.vertices, np.zeros(len(mesh.vertices))
    near = np.arange(len(faces))
    for _ in range(MAX_ROUNDS):
        heights, normals, means = _heights(moved, faces[near])
        high = np.abs(heights)
        aside = np.linalg.norm(moved - means - heights[:, None] * normals, axis=1)
        tall = high > np.maximum(MIN_OUTLIER_HEIGHT, MIN_STEEPNESS * aside)
        if not tall.any():
            break
        near = near[_spread(tall, faces[near], 3)[faces[near]].any(axis=1)]
        candidates = tall & (high >= _largest_around(high, faces[near])[0])
        tried = np.where(candidates[:, None], means, moved)
        after = np.abs(_heights(tried, faces[near])[0])
        found = candidates & (high > MIN_HEIGHT_RATIO * _largest_around(after, faces[near])[1])
        found &= _least_cosine(tried, normals, faces[near]) > MIN_RING_COSINE
        if not found.any():
            break
        moved = np.where(found[:, None], tried, moved)
        total += np.where(found, heights, 0.0)
    return moved, total


def _heights(vertices: Array, faces: IntArray) -> tuple[Array, Array, Array]:
    """Return the height of each vertex over its neighbours (v,) [m], 0 at rims, and normals and means of these."""
    count = len(vertices)
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    areas, total = cross(b - a, c - a), a + b + c
    area, mean, degree = np.zeros((count, 3)), np.zeros((count, 3)), np.zeros(count)
    for i, corner in enumerate((a, b, c)):
        at = faces[:, i]
        degree += np.bincount(at, minlength=count)
        for axis in range(3):
            area[:, axis] += np.bincount(at, areas[:, axis], count)
            mean[:, axis] += np.bincount(at, total[:, axis] - corner[:, axis], count)
    normals = unit(area)
    mean /= np.maximum(2 * degree, 1)[:, None]
    heights = np.einsum("vc,vc->v", normals, vertices - mean)
    return np.where(~at_rims(faces, count) & (degree > 0), heights, 0.0), normals, mean


def _least_cosine(vertices: Array, normals: Array, faces: IntArray) -> Array:
    """Return the least cosine between the normal of each vertex (v, 3) and its faces, shape (v,)."""
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    of_faces = unit(cross(b - a, c - a))
    least = np.ones(len(vertices))
    for at in faces.T:
        np.minimum.at(least, at, np.einsum("fc,fc->f", of_faces, normals[at]))
    return least


def _largest_around(values: Array, faces: IntArray) -> tuple[Array, Array]:
    """Return the largest and the second largest value among the neighbours of each vertex, shape (v,) each."""
    half = np.concatenate([faces[:, [i, j]] for i in range(3) for j in (i - 1, i - 2)])
    largest, second = np.zeros((2, len(values)))
    owner = np.full(len(values), -1)
    np.maximum.at(largest, half[:, 0], values[half[:, 1]])
    is_largest = values[half[:, 1]] == largest[half[:, 0]]
    owner[half[is_largest, 0]] = half[is_largest, 1]
    others = half[half[:, 1] != owner[half[:, 0]]]
    np.maximum.at(second, others[:, 0], values[others[:, 1]])
    return largest, second


def _spread(marked: BoolArray, faces: IntArray, rings: int) -> BoolArray:
    """Return the marked vertices and those within a number of edges from them."""
    for _ in range(rings):
        marked = marked.copy()
        marked[faces[marked[faces].any(axis=1)]] = True
    return marked
