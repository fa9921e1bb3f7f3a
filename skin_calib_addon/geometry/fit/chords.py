"""How far a surface bulges over the facets that are chords of it."""

import numpy as np

from ...common.arrays import Array, unit
from ..mesh.triangle_mesh import TriangleMesh
from ..sampling.samples import RaySamples
from ..surface.bspline import BSplineSurface

# Two facets that meet at more than this were meant to: no smooth surface lies over them. A 12-gon has 30 degrees.
MAX_CHORD_ANGLE = np.deg2rad(40.0)


def chord_gaps(mesh: TriangleMesh, surface: BSplineSurface, samples: RaySamples) -> Array:
    """Distance along each ray from the facet it met out to the surface that its corners lie on.

    Where the corners of a facet stand off the surface by ``h_i``, a surface through them is ``sum(b_i h_i)`` further
    out over the point of barycentric coordinates ``b_i``.

    Returns
    -------
    array, shape (k, l)
        [m]; 0 where the ray met nothing, and nowhere larger than the mesh's own angles between faces allow: a surface
        that fits badly says nothing.
    """
    k, l = samples.residuals.shape
    v = np.arange(l) / l if surface.closed[1] else np.linspace(0, 1, l)
    uv = np.column_stack((np.repeat(np.linspace(0, 1, k), l), np.tile(v, k)))
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
    """Heights of points over a surface, shape (k,) [m], and its normals below them, shape (k, 3).

    What a Newton step leaves of the way to a footpoint, and what lies beyond an open edge, goes by the curvature there:
    over a way in the tangent plane the surface rises by ``II / (1 + sqrt(1 - III))`` for its second and third
    fundamental forms, which is exact on spheres and cylinders.

    Parameters
    ----------
    uv : array, shape (k, 2)
        Near the footpoints.
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
    turn_a, turn_b = (
        L * x + M * y,
        M * x + N * y,
    )  # how far the normal turns along the way, by its products with a and b
    second = turn_a * x + turn_b * y
    third = (np.stack(solve_metric(a, b, turn_a, turn_b)) * (turn_a, turn_b)).sum(axis=0)
    rise = second / (1 + np.sqrt(np.maximum(1 - third, 0)))
    return (displacements * normals).sum(axis=1) - rise, normals


def in_basis(a: Array, b: Array, displacements: Array) -> tuple[Array, Array]:
    """Components of ways (k, 3) along tangents a and b (k, 3), shapes (k,)."""
    return solve_metric(a, b, (displacements * a).sum(axis=1), (displacements * b).sum(axis=1))


def solve_metric(a: Array, b: Array, by_a: Array, by_b: Array) -> tuple[Array, Array]:
    """Components along tangents a and b (k, 3) of what has these products with them, shapes (k,)."""
    aa, ab, bb = ((x * y).sum(axis=1) for x, y in ((a, a), (a, b), (b, b)))
    area = aa * bb - ab**2
    return (bb * by_a - ab * by_b) / area, (aa * by_b - ab * by_a) / area


def barycentric(triangles: Array, points: Array) -> Array:
    """Barycentric coordinates of points in the planes of triangles, shape (k, 3)."""
    a, b, c = triangles[:, 0], triangles[:, 1], triangles[:, 2]
    normal = np.cross(b - a, c - a)
    square = np.maximum((normal**2).sum(axis=1), 1e-300)
    coordinates = [(np.cross(q - p, points - p) * normal).sum(axis=1) / square for p, q in ((b, c), (c, a), (a, b))]
    return np.column_stack(coordinates)


def largest_sagittas(mesh: TriangleMesh) -> Array:
    """How far a smooth surface through its corners can stand off each face, shape (f,) [m].

    An arc over a chord of length h whose neighbours turn by t has a sagitta of h t / 8; a face has three such chords,
    and its middle lies over all of them. Beside an edge that is meant to be sharp it is zero.
    """
    first, second = mesh.adjacency
    cosine = (mesh.face_normals[first] * mesh.face_normals[second]).sum(axis=1)
    turn = np.arccos(np.clip(cosine, -1, 1))
    steepest = np.zeros(len(mesh.faces))
    np.maximum.at(steepest, first, turn)
    np.maximum.at(steepest, second, turn)
    corners = mesh.triangles
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    return np.where(steepest < MAX_CHORD_ANGLE, longest * steepest / 4, 0.0)
