"""The distance between a surface and facets that are chords of it."""

import numpy as np

from ...common.arrays import Array, IntArray, cross, pairs_of, unit
from ..mesh.triangle_mesh import TriangleMesh
from ..sampling.samples import RaySamples
from ..surface.bspline import BSplineSurface

# [rad] angle between adjacent facets above which their edge is meant to be sharp, so that no smooth surface covers
# it. The facets of a 12-gon have 30 degrees. Larger: coarser models are smoothed, and edges are rounded.
MAX_CHORD_ANGLE = np.deg2rad(40.0)


def chord_gaps(mesh: TriangleMesh, surface: BSplineSurface, samples: RaySamples) -> Array:
    r"""Return the distance along each ray from the facet that it hit out to the surface through the facet's corners.

    If the corners of a facet have the heights :math:`h_i` over a surface, a surface through the corners is further out
    by

    .. math::

        g = \sum_i b_i h_i \quad [\text{m}]

    over the point with the barycentric coordinates :math:`b_i`.

    Parameters
    ----------
    mesh : TriangleMesh
        The mesh with the facets.
    surface : BSplineSurface
        The fitted surface.
    samples : RaySamples
        The hits of the rays through the surface.

    Returns
    -------
    array, shape (k, l)
        [m]; 0 where the ray hit nothing. The angles between the faces of the mesh limit it, because the gaps of a bad
        fit have no meaning.
    """
    k, l = samples.residuals.shape
    v = np.arange(l) / l if surface.closed[1] else np.linspace(0, 1, l)
    uv = pairs_of(np.linspace(0, 1, k), v)
    hit = np.flatnonzero(~np.isnan(samples.residuals))
    uv, face, residuals = uv[hit], samples.faces.ravel()[hit], samples.residuals.ravel()[hit]
    points, rays = (x.reshape(-1, 3)[hit] for x in (samples.points, samples.rays))
    corners, first, corner = np.unique(mesh.faces[face], return_index=True, return_inverse=True)
    heights, normals = heights_over(surface, mesh.vertices[corners], uv[first // 3])
    corner = corner.reshape(-1, 3)
    r = surface.derivatives(uv)
    normal = unit(np.cross(r[1, 0], r[0, 1]))
    slopes = (normals[corner] * normal[:, None]).sum(axis=2)
    weights = barycentric(mesh.triangles[face], points)
    gaps_to_surface = (weights * heights[corner] * slopes).sum(axis=1) / (rays * normal).sum(axis=1)
    limits = largest_sagittas(mesh)[face]
    lift = np.clip(gaps_to_surface - residuals, -limits, limits)
    gaps = np.zeros(k * l)
    gaps[hit] = np.where(np.isfinite(lift), lift, 0.0)
    return gaps.reshape(k, l)


def heights_over(surface: BSplineSurface, points: Array, uv: Array) -> tuple[Array, Array]:
    r"""Return the heights of points over a surface, and the normals of the surface below them.

    One Newton step finds the parameters. The curvature corrects the rest: over a displacement in the tangent plane, the
    surface rises by

    .. math::

        \frac{\mathrm{II}}{1 + \sqrt{1 - \mathrm{III}}} \quad [\text{m}]

    with its second and third fundamental forms. This is exact on spheres and cylinders.

    Parameters
    ----------
    surface : BSplineSurface
        The surface.
    points : array, shape (k, 3)
        [m]
    uv : array, shape (k, 2)
        Parameters near the footpoints.

    Returns
    -------
    heights : array, shape (k,)
        [m]
    normals : array, shape (k, 3)
        Unit vectors.
    """
    r = surface.derivatives(uv)
    uv = uv + np.column_stack(in_basis(r[1, 0], r[0, 1], points - r[0, 0]))
    for axis in (0, 1):
        if not surface.closed[axis]:
            uv[:, axis] = np.clip(uv[:, axis], 0, 1)
    r = surface.derivatives(uv, order=2)
    a, b, displacements = r[1, 0], r[0, 1], points - r[0, 0]
    normals = unit(np.cross(a, b))
    x, y = in_basis(a, b, displacements)
    L, M, N = ((bend * normals).sum(axis=1) for bend in (r[2, 0], r[1, 1], r[0, 2]))
    # The rotation of the normal along the displacement, as its products with a and b.
    turn_a, turn_b = L * x + M * y, M * x + N * y
    second = turn_a * x + turn_b * y
    third = (np.stack(solve_metric(a, b, turn_a, turn_b)) * (turn_a, turn_b)).sum(axis=0)
    rise = second / (1 + np.sqrt(np.maximum(1 - third, 0)))
    return (displacements * normals).sum(axis=1) - rise, normals


def in_basis(a: Array, b: Array, displacements: Array) -> tuple[Array, Array]:
    """Return the components of displacements along two tangents.

    Parameters
    ----------
    a, b : array, shape (k, 3)
        Tangents.
    displacements : array, shape (k, 3)
        [m]

    Returns
    -------
    along_a, along_b : array, shape (k,)
        Components.
    """
    return solve_metric(a, b, (displacements * a).sum(axis=1), (displacements * b).sum(axis=1))


def solve_metric(a: Array, b: Array, by_a: Array, by_b: Array) -> tuple[Array, Array]:
    """Return the components along two tangents of vectors with given scalar products.

    Parameters
    ----------
    a, b : array, shape (k, 3)
        Tangents.
    by_a, by_b : array, shape (k,)
        Scalar products of the vectors with the tangents.

    Returns
    -------
    along_a, along_b : array, shape (k,)
        Components.
    """
    aa, ab, bb = ((x * y).sum(axis=1) for x, y in ((a, a), (a, b), (b, b)))
    area = aa * bb - ab**2
    return (bb * by_a - ab * by_b) / area, (aa * by_b - ab * by_a) / area


def barycentric(triangles: Array, points: Array) -> Array:
    """Return the barycentric coordinates of points in the planes of triangles.

    Parameters
    ----------
    triangles : array, shape (k, 3, 3)
        Corners [m].
    points : array, shape (k, 3)
        [m]

    Returns
    -------
    array, shape (k, 3)
        Rows sum to one.
    """
    a, b, c = triangles[:, 0], triangles[:, 1], triangles[:, 2]
    normal = cross(b - a, c - a)
    square = np.maximum(np.einsum("kc,kc->k", normal, normal), 1e-300)
    pairs = (b, c), (c, a), (a, b)
    coordinates = [np.einsum("kc,kc->k", cross(q - p, points - p), normal) / square for p, q in pairs]
    return np.column_stack(coordinates)


def largest_sagittas(mesh: TriangleMesh) -> Array:
    r"""Return the largest distance of a smooth surface through its corners from each face, shape (f,) [m].

    An arc over a chord of length :math:`h` whose neighbors rotate by :math:`\theta` has the sagitta

    .. math::

        s = \frac{h\, \theta}{8}

    A face has three chords, and its centre has twice this distance. The distance is zero next to a sharp edge.
    """
    first, second, turn = edge_turns(mesh)
    steepest = np.zeros(len(mesh.faces))
    np.maximum.at(steepest, first, turn)
    np.maximum.at(steepest, second, turn)
    corners = mesh.triangles
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    return np.where(steepest < MAX_CHORD_ANGLE, longest * steepest / 4, 0.0)


def facet_sagittas(mesh: TriangleMesh) -> Array:
    r"""Return the distance of a smooth surface from each face, shape (f,) [m].

    The normal turns by :math:`\theta` over an edge of length :math:`l`. Across it, a face of area :math:`A` is
    :math:`2 A / l` wide, and its sagitta is

    .. math::

        s = \frac{2 A}{l}\, \frac{\theta}{4}

    The largest of the three edges counts. A sharp edge has none.
    """
    first, second, turn = edge_turns(mesh)
    common = (mesh.faces[first][:, :, None] == mesh.faces[second][:, None, :]).any(axis=2)
    apart = np.argmin(common, axis=1)  # the corner of the first face that is not on the common edge
    ends = [mesh.vertices[mesh.faces[first, (apart + i) % 3]] for i in (1, 2)]
    length = np.linalg.norm(ends[1] - ends[0], axis=1)
    turn = np.where(turn < MAX_CHORD_ANGLE, turn, 0.0)
    sagittas = np.zeros(len(mesh.faces))
    for side in (first, second):
        np.maximum.at(sagittas, side, mesh.face_areas[side] / np.maximum(length, np.finfo(float).tiny) * turn / 2)
    return sagittas


def edge_turns(mesh: TriangleMesh) -> tuple[IntArray, IntArray, Array]:
    """Return the two faces at each inner edge, shapes (e,), and the angle between their normals, shape (e,) [rad]."""
    first, second = mesh.adjacency
    cosine = (mesh.face_normals[first] * mesh.face_normals[second]).sum(axis=1)
    return first, second, np.arccos(np.clip(cosine, -1, 1))
