"""Outline of the part of a surface that boards may cover, in a flat map: edges of the mesh, holes, a seam."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from ...common.arrays import Array, BoolArray, IntArray, unit
from ...geometry.fit.surface_fit import SurfaceFit
from ...geometry.mesh.triangle_mesh import TriangleMesh
from ...geometry.surface.bspline import BSplineSurface
from ...geometry.surface.footpoints import footpoints

# Step along an outline, as a fraction of the size of the mesh. It is also the largest distance of a face from the end
# of the adjacent ray. Larger: a coarser outline.
OUTLINE_STEP = 0.01
# Smallest cosine of the angle between a face of the mesh, or a board, and the surface that it belongs to. Larger:
# leaves out more oblique faces; more boards of a file have the normals of the surface.
MIN_COVERED_COSINE = 0.5
# Smallest number of rays in each direction that look for faces. Larger: detects smaller holes, slower.
MIN_RAYS = 200
# Points along each side of the border of a surface, and on an excluded circle. Larger: more exact, slower.
BORDER_POINTS = 100
# Nodes whose maps are blended at a point. Larger: a smoother map.
BLENDED_NODES = 4
# Iterations that find the parameters of a flat point with the slope at the nearest node. Larger: more exact, slower.
INVERSE_ITERATIONS = 6


@dataclass(frozen=True)
class Zone:
    """A disc without boards: a screw, a cable outlet."""

    point: tuple[float, float, float]  # its centre, on or near the mesh [m]
    radius: float  # [m]


@dataclass(frozen=True, eq=False)
class FlatMap:
    """A map from points of a surface to the plane, given by the nodes of a net on the surface."""

    surface: BSplineSurface
    flat: Array  # (n, 2) flat positions of the nodes [m]
    uv: Array  # (n, 2) their parameters
    x_axes: Array  # (n, 3) direction of the flat x axis at the nodes, unit

    @cached_property
    def points(self) -> Array:
        """Points of the nodes, shape (n, 3) [m]."""
        return self.surface.points(self.uv)

    @cached_property
    def normals(self) -> Array:
        """Unit normals at the nodes, shape (n, 3)."""
        return self.surface.normals(self.uv)

    @cached_property
    def axes(self) -> Array:
        """Directions of the flat axes at the nodes, shape (n, 2, 3)."""
        return np.stack((self.x_axes, np.cross(self.normals, self.x_axes)), axis=1)

    def __call__(self, points: Array, uv: Array) -> Array:
        r"""Return the flat positions, shape (k, 2) [m], of points on or near the surface.

        The result is exact on a plane. Elsewhere it blends the maps of the nearest nodes. The distance from each node
        is the arc that belongs to the slope s of the chord c:

        .. math:: \ell = c\,(1 + s^2 / 6) \quad [m]

        Parameters
        ----------
        points : array, shape (k, 3)
            Points [m].
        uv : array, shape (k, 2)
            Their parameters.
        """
        count = np.arange(1, min(BLENDED_NODES, len(self.flat)) + 1)
        if any(self.surface.closed):  # neighbours across a seam are far apart in the plane
            near = cKDTree(self.uv * self._lengths).query(uv * self._lengths, k=count)[1]
        else:
            near = cKDTree(self.points).query(points, k=count)[1]
        vector = points[:, None] - self.points[near]
        chord = np.linalg.norm(vector, axis=2)
        slope = np.arcsin(np.clip((unit(vector) * self.normals[near]).sum(axis=2), -1, 1))
        flat_vector = (
            unit(np.einsum("pnc,pnac->pna", vector, self.axes[near])) * (chord * (1 + slope**2 / 6))[..., None]
        )
        weights = 1 / (chord**2 + (1e-9 * chord.max(initial=1e-6)) ** 2)
        weights /= weights.sum(axis=1, keepdims=True)
        return np.einsum("pn,pna->pa", weights, self.flat[near] + flat_vector)

    @cached_property
    def _lengths(self) -> Array:
        """Mean lengths of a unit of each parameter, shape (2,) [m]."""
        r = self.surface.derivatives(self.uv)
        return np.array((np.linalg.norm(r[1, 0], axis=1).mean(), np.linalg.norm(r[0, 1], axis=1).mean()))

    def at(self, flat_points: Array, angle: float) -> tuple[Array, Array]:
        """Return the surface parameters and a tangent at flat positions.

        Parameters
        ----------
        flat_points : array, shape (k, 2)
            Flat positions [m].
        angle : float
            Angle of the tangents to the flat x axis [rad].

        Returns
        -------
        uv : array, shape (k, 2)
            Parameters.
        tangents : array, shape (k, 3)
            Unit tangents.
        """
        node = cKDTree(self.flat).query(flat_points)[1]
        uv = self.uv[node].copy()
        for _ in range(INVERSE_ITERATIONS):
            r = self.surface.derivatives(uv)
            slope = np.einsum("dkc,kac->kad", np.stack((r[1, 0], r[0, 1])), self.axes[node])
            uv += np.linalg.solve(slope, (flat_points - self(r[0, 0], uv))[..., None])[..., 0]
        ahead = np.einsum("a,kac->kc", (np.cos(angle), np.sin(angle)), self.axes[node])
        normals = self.surface.normals(uv)
        return uv, unit(ahead - (ahead * normals).sum(axis=1, keepdims=True) * normals)


@dataclass(frozen=True, eq=False)
class Polyline:
    """Points of an outline, on or near the surface, and their parameters."""

    points: Array  # (k, 3) [m]
    uv: Array  # (k, 2)


def outline(surface: BSplineSurface, fit: SurfaceFit | None, middle: float) -> list[Polyline]:
    """Return polylines around the part of a surface that its mesh covers, by the parity rule.

    The polylines have common ends.

    Parameters
    ----------
    surface : BSplineSurface
        The surface.
    fit : SurfaceFit, or None
        Fit of the surface. None: the complete surface counts.
    middle : float
        Parameter v of the middle; a closed surface is cut open on the opposite side.
    """
    if fit is None:
        return [_border(surface, middle)]
    mesh, step = fit.mesh, OUTLINE_STEP * fit.mesh.size
    edges = _rim(mesh, _outer_faces(surface, fit, step))
    lines = _sampled_edges(surface, mesh, edges, step, middle)
    if not surface.closed[1]:
        return lines
    # The ends of a tube are the ends of the surface. Only a loop completely between them is a hole.
    inside = [
        not ((p.uv[:, 0] <= 0) | (p.uv[:, 0] >= 1)).any() and np.abs(np.diff(p.uv[:, 1])).max() < 0.5 for p in lines
    ]
    links = coo_array((np.ones(len(edges)), edges.T), shape=(len(mesh.vertices), len(mesh.vertices)))
    loop = connected_components(links, directed=False)[1][edges[:, 0]] if len(edges) else np.zeros(0, int)
    open_loops = set(loop[~np.array(inside, bool)].tolist())
    return [_border(surface, middle), *(p for p, k in zip(lines, loop.tolist()) if k not in open_loops)]


def _border(surface: BSplineSurface, middle: float) -> Polyline:
    """Return the border of the parameter domain; a closed surface is cut open."""
    box = np.array(((0.0, 0.0), (0.0, 1.0), (1.0, 1.0), (1.0, 0.0), (0.0, 0.0)))
    if surface.closed[1]:
        box[:, 1] += middle - 0.5
    fraction = np.arange(BORDER_POINTS)[:, None] / BORDER_POINTS
    uv = np.concatenate((*(a + fraction * (b - a) for a, b in zip(box, box[1:])), box[:1]))
    return Polyline(surface.points(uv), uv)


def _outer_faces(surface: BSplineSurface, fit: SurfaceFit, step: float) -> BoolArray:
    """Return which faces the rays of the fit hit and that face outward; also small faces between the rays."""
    mesh, spans = fit.mesh, min(size - degree for size, degree in zip(fit.offsets.shape, surface.degree))
    samples = fit.resampled(-(-MIN_RAYS // spans))[1]
    met = samples.residuals
    is_known = ~np.isnan(met)
    faces = samples.faces[is_known]
    # A face between the rays counts if the ray nearest to its centroid ends at its height.
    small = np.setdiff1d(np.arange(len(mesh.faces)), faces)
    centres = mesh.triangles[small].mean(axis=1)
    uv, _ = footpoints(surface, centres)
    height = ((centres - surface.points(uv)) * surface.normals(uv)).sum(axis=1)
    (k, l), closed = met.shape, surface.closed[1]
    row = np.clip(np.rint(uv[:, 0] * (k - 1)), 0, k - 1).astype(int)
    column = np.rint(uv[:, 1] * (l if closed else l - 1)).astype(int) % l
    at_surface = np.abs(height - met[row, column]) < step
    for axis in (0, 1):
        if not surface.closed[axis]:
            at_surface &= (uv[:, axis] > 0) & (uv[:, axis] < 1)
    sites = np.stack(np.meshgrid(np.linspace(0, 1, k), np.linspace(0, 1, l, endpoint=not closed), indexing="ij"), -1)
    chosen = np.zeros(len(mesh.faces), bool)
    for face, sites_uv in ((faces, sites[is_known]), (small[at_surface], uv[at_surface])):
        chosen[face[(surface.normals(sites_uv) * mesh.face_normals[face]).sum(axis=1) > MIN_COVERED_COSINE]] = True
    return chosen


def _rim(mesh: TriangleMesh, chosen: BoolArray) -> IntArray:
    """Return the edges with an uneven number of chosen faces, shape (e, 2)."""
    faces = mesh.faces[chosen]
    edges = np.sort(np.concatenate((faces[:, :2], faces[:, 1:], faces[:, ::2])), axis=1)
    found, times = np.unique(edges, axis=0, return_counts=True)
    return found[times % 2 == 1]


def _sampled_edges(
    surface: BSplineSurface, mesh: TriangleMesh, edges: IntArray, step: float, middle: float
) -> list[Polyline]:
    """Return samples along edges of a mesh, with their surface parameters."""
    if len(edges) == 0:
        return []
    ends = mesh.vertices[edges]
    parts = np.maximum(np.ceil(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) / step), 1).astype(int)
    points = [a + np.linspace(0, 1, k + 1)[:, None] * (b - a) for (a, b), k in zip(ends, parts)]
    for line, (_, b) in zip(points, ends):
        line[-1] = b  # exactly: common ends are equal
    uv = footpoints(surface, np.concatenate(points))[0]
    if surface.closed[1]:
        uv[:, 1] += np.rint(middle - uv[:, 1])
    return [Polyline(p, q) for p, q in zip(points, np.split(uv, np.cumsum(parts + 1)[:-1]))]


def flat_loops(to_flat: FlatMap, lines: Sequence[Polyline]) -> list[Array]:
    """Return loops in the plane that enclose the map of what the polylines enclose, by the parity rule.

    Each polyline becomes a fan to one point. The common sides of two fans cancel.

    Parameters
    ----------
    to_flat : FlatMap
        The map.
    lines : sequence of Polyline
        Polylines with common ends.

    Returns
    -------
    list of array, shape (k, 2)
        Loops [m].
    """
    both = np.concatenate([np.column_stack((line.points, line.uv)) for line in lines])
    is_known, back = np.unique(both, axis=0, return_inverse=True)
    flat = to_flat(is_known[:, :3], is_known[:, 3:])[back.ravel()]
    return [
        np.concatenate((flat[:1], part)) for part in np.split(flat, np.cumsum([len(line.uv) for line in lines])[:-1])
    ]


def disc(centre: Array, radius: float) -> Array:
    """Return a polygon around a disc.

    Parameters
    ----------
    centre : array, shape (2,)
        Centre [m].
    radius : float
        Radius [m].

    Returns
    -------
    array, shape (BORDER_POINTS, 2)
        Corners [m].
    """
    angles = np.linspace(0, 2 * np.pi, BORDER_POINTS, endpoint=False)
    return centre + radius / np.cos(np.pi / BORDER_POINTS) * np.column_stack((np.cos(angles), np.sin(angles)))
