"""How far a surface bulges over the facets that are chords of it."""

import numpy as np

from ..arrays import Array, unit
from .bspline import BSplineSurface
from .mesh import TriangleMesh
from .samples import RaySamples

# Two facets that meet at more than this were meant to: no smooth surface lies over them. A 12-gon has 30 degrees.
SHARPEST_CHORDS = np.deg2rad(40.0)


def chord_gaps(mesh: TriangleMesh, surface: BSplineSurface, samples: RaySamples) -> Array:
    """Distance along each ray from the facet it met out to the surface that its corners lie on.

    For a surface of second fundamental form II, a facet lies ``-1/2 sum(b_i II(d_i, d_i))`` inside of it at a point of
    barycentric coordinates ``b_i``, where ``d_i`` are the ways from there to the corners; exact for quadratic surfaces.

    Returns
    -------
    array, shape (k, l)
        [m]; 0 where the ray met nothing, and nowhere larger than the mesh's own angles between faces allow: the
        curvature of a surface that fits badly says nothing.
    """
    k, l = samples.residuals.shape
    v = np.arange(l) / l if surface.closed[1] else np.linspace(0, 1, l)
    uv = np.column_stack((np.repeat(np.linspace(0, 1, k), l), np.tile(v, k)))
    r = surface.derivatives(uv, order=2)
    a, b = r[1, 0], r[0, 1]
    normals = unit(np.cross(a, b))
    second = [(x * normals).sum(axis=1)[:, None] for x in (r[2, 0], r[1, 1], r[0, 2])]
    faces, points = samples.faces.ravel(), samples.points.reshape(-1, 3)
    corners = mesh.triangles[faces]
    ways = corners - points[:, None]
    # Components of the ways in the tangent plane, in the basis (a, b).
    aa, ab, bb = ((x * y).sum(axis=1)[:, None] for x, y in ((a, a), (a, b), (b, b)))
    wa, wb = np.matmul(ways, a[..., None])[..., 0], np.matmul(ways, b[..., None])[..., 0]
    along_u, along_v = (bb * wa - ab * wb) / (aa * bb - ab**2), (aa * wb - ab * wa) / (aa * bb - ab**2)
    form = second[0] * along_u**2 + 2 * second[1] * along_u * along_v + second[2] * along_v**2
    gaps = -0.5 * (barycentric(corners, points) * form).sum(axis=1)
    gaps /= (samples.rays.reshape(-1, 3) * normals).sum(axis=1)
    most = largest_gaps(mesh)[faces]
    return np.where(np.isfinite(gaps), np.clip(gaps, -most, most), 0.0).reshape(k, l)


def barycentric(triangles: Array, points: Array) -> Array:
    """Barycentric coordinates of points in the planes of triangles, shape (k, 3)."""
    a, b, c = triangles[:, 0], triangles[:, 1], triangles[:, 2]
    normal = np.cross(b - a, c - a)
    square = np.maximum((normal**2).sum(axis=1), 1e-300)
    shares = [(np.cross(q - p, points - p) * normal).sum(axis=1) / square for p, q in ((b, c), (c, a), (a, b))]
    return np.column_stack(shares)


def largest_gaps(mesh: TriangleMesh) -> Array:
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
    return np.where(steepest < SHARPEST_CHORDS, longest * steepest / 4, 0.0)
