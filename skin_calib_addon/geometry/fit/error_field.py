"""The error of a fitted surface, from the mesh alone: a known part under the facets, and the variance of the rest."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.ndimage import map_coordinates, uniform_filter1d
from scipy.sparse import csr_array

from ...common.arrays import Array, BoolArray, IntArray, cross, unit
from ..mesh.corners import undivided
from ..mesh.defects import coherent
from ..mesh.distance import closest
from ..mesh.triangle_mesh import TriangleMesh, at_rims
from ..sampling.basis import TensorBasis
from ..sampling.samples import MIN_FACET_COSINE, RaySamples
from ..surface.bspline import MIN_LENGTH, BSplineSurface
from .chords import MAX_CHORD_ANGLE, barycentric, in_basis, sharp_vertices, site_tangents
from .smoothing import looks_noisy

# [rad] angle between the normals of a face and of its corner above which the face is next to an edge that is meant to
# be sharp, and has no gap. It is half of the angle between two faces, because the normal of a corner is between theirs.
# Larger: more facets have a gap.
MAX_CORNER_ANGLE = MAX_CHORD_ANGLE / 2
# [1] fraction of this angle up to which a facet has its whole gap. Smaller: fewer facets have their whole gap; 1: a gap
# begins suddenly.
WHOLE_GAP_FRACTION = 0.75
# [rad] these angles between which a gap that is left out is less and less uncertain: from there on the edge is meant to
# be sharp. Larger: taxels on prisms are less certain.
UNCERTAIN_ANGLES = MAX_CORNER_ANGLE, 2 * MAX_CORNER_ANGLE
# [1] largest ratio of the curvature along an edge to that at its flatter end. Larger: gaps on flat parts next to
# fillets; 2: gaps are too small where the curvature changes.
MAX_END_RATIO = 4.0
# [1] ratio of the curvature next to a facet to that over it, up to which the facet has its whole gap, and from which it
# has none: a flat side between two fillets has bends at both ends. Larger: flat sides bulge; smaller: gaps are too
# small where the curvature changes.
NEXT_RATIOS = 2.0, 4.0
# [1] least fraction of the samples that remains when the unknowns of a fit are subtracted. Larger: smaller
# uncertainties of fits with hardly more samples than unknowns.
MIN_FREEDOM = 0.1
# [1] largest ratio of a distance to the mesh to the standard deviation from the sites around it. Larger: errors between
# sites are stated too small.
MAX_ERROR_RATIO = 2.0


NEXT, PREVIOUS = [1, 2, 0], [2, 0, 1]  # Format: corners of a face, by corner


def vertex_normals(vertices: Array, faces: IntArray) -> Array:
    r"""Return the unit normals of vertices, shape (v, 3); they are exact on a sphere (Max, 1999).

    With the edges :math:`\mathbf{a}` and :math:`\mathbf{b}` of each face at the vertex:

    .. math::

        \mathbf{n} \sim \sum_{\text{faces}}
        \frac{\mathbf{a} \times \mathbf{b}}{\lVert \mathbf{a} \rVert^2 \lVert \mathbf{b} \rVert^2}
    """
    corners = vertices[faces]
    edges = corners[:, NEXT] - corners
    squares = np.maximum(np.einsum("fkc,fkc->fk", edges, edges), MIN_LENGTH**2)
    weights, areas = 1 / (squares * squares[:, PREVIOUS]), cross(edges[:, 0], edges[:, 1])
    at = faces.ravel()
    sums = [np.bincount(at, (weights * areas[:, c, None]).ravel(), len(vertices)) for c in range(3)]
    return unit(np.stack(sums, axis=1))


def facet_gaps(mesh: TriangleMesh, faces: IntArray, points: Array) -> tuple[Array, Array]:
    r"""Return the height of the smooth surface through the vertices over points of the facets, and its uncertainty [m].

    The curvature along an edge follows from the normals of its ends and of the face. A point with the barycentric
    coordinates :math:`b` has the gap

    .. math::

        g = \frac{1}{2} \sum_{i < j} b_i b_j\, s_{ij}, \qquad s_{ij} = s_i + s_j, \qquad
        s_i = (\mathbf{n} - \mathbf{n}_i) \cdot (\mathbf{p}_j - \mathbf{p}_i), \quad
        s_j = (\mathbf{n}_j - \mathbf{n}) \cdot (\mathbf{p}_j - \mathbf{p}_i) \quad [\text{m}]

    On a surface of second order both halves are equal. Where one half is much smaller, or of the other sign, as on a
    flat part next to a fillet, :math:`|s_{ij}|` is at most four times the smaller half, or zero. A flat side between
    two fillets bends at both ends, but the surface bends much more next to it; its halves are zero, too. A corner at an
    open rim has no reliable normal; the other end of its edges counts for both. A facet with a corner on an edge that
    is meant to be sharp has no gap.

    The uncertainty :math:`d` has the same form, with three parts of :math:`s_{ij}`: the difference of both halves, the
    bend that is left out because an edge can be sharp or a coarse curve, and, for the terms of higher order, the bend
    times a quarter of the square of the angle :math:`\alpha` between facet and corner:

    .. math::

        d_{ij} = |s_i - s_j| + |s_{ij} - s_{ij}'| + \tfrac{1}{4} \alpha^2\, |s_{ij}|
    """
    bends_at = _vertex_bends(mesh)
    face, which = np.unique(bends_at.parent[faces], return_inverse=True)
    corners = bends_at.faces[face]
    a, b, c = np.moveaxis(mesh.vertices[corners], 1, 0)
    facet = unit(cross(b - a, c - a))
    normals, rim = bends_at.normals, bends_at.rim[corners]
    edges = mesh.vertices[corners[:, NEXT]] - mesh.vertices[corners]
    turned = normals[corners] - facet[:, None]  # from the face to each corner
    start, end = -np.einsum("fkc,fkc->fk", turned, edges), np.einsum("fkc,fkc->fk", turned[:, NEXT], edges)
    smooth = _continues(mesh.vertices, bends_at, corners, turned)
    start, end = start * smooth, end * smooth[:, NEXT]
    start, end = np.where(rim & ~rim[:, NEXT], end, start), np.where(rim[:, NEXT] & ~rim, start, end)
    least = np.minimum(np.abs(start), np.abs(end))
    most, at_end = MAX_END_RATIO * least, (MAX_END_RATIO - 1) * least
    whole = np.where(start * end > 0, np.clip(start + end, -most, most), 0.0)
    angles = 2 * np.arcsin(np.minimum(np.sqrt(np.einsum("fkc,fkc->fk", turned, turned).max(axis=1)) / 2, 1))
    bends = whole * np.clip((1 - angles / MAX_CORNER_ANGLE) / (1 - WHOLE_GAP_FRACTION), 0, 1)[:, None]
    bends[bends_at.sharp[corners].any(axis=1)] = 0.0
    low, high = UNCERTAIN_ANGLES
    unsure = np.abs(whole - bends) * np.clip((high - angles) / (high - low), 0, 1)[:, None]
    unsure += np.abs(np.clip(start, -at_end, at_end) - np.clip(end, -at_end, at_end))
    unsure += np.abs(bends) * angles[:, None] ** 2 / 4
    weights = barycentric(mesh.vertices[corners][which], points)
    gaps, of_gaps = (np.einsum("nk,nk,nk->n", weights, weights[:, NEXT], s[which]) / 2 for s in (bends, unsure))
    return gaps, of_gaps


@dataclass(frozen=True, eq=False)
class _VertexBends:
    """The bends of an undivided mesh at its vertices, and along its edges; each edge is in both of its faces."""

    faces: IntArray  # (g, 3) without the vertices inside divided facets
    parent: IntArray  # (f,) the face of ``faces`` that contains each face of the mesh
    normals: Array  # (v, 3) unit
    sharp: BoolArray  # (v,) whether an edge at the vertex is meant to be sharp
    rim: BoolArray  # (v,) whether the faces around the vertex leave a side open
    bends: Array  # (e, 3) difference of the normals at the ends of each edge [1]
    arms: Array  # (e, 3) the edges [m]
    squares: Array  # (e,) of their lengths [m^2]
    steepest: Array  # (v,) largest bend per length of the edges of each vertex [1/m]
    starts: IntArray  # (v + 1,) where the edges of each vertex start in ``edges``
    edges: IntArray  # (2 e,)


@lru_cache(maxsize=4)  # repeated fits, as in the window, keep the bends of their mesh
def _vertex_bends(mesh: TriangleMesh) -> _VertexBends:
    vertices, count = mesh.vertices, len(mesh.vertices)
    sharp, rim = sharp_vertices(mesh), at_rims(mesh.faces, count)
    faces, parent = undivided(mesh, sharp | rim)
    normals = vertex_normals(vertices, faces)
    first, last = faces.ravel(), faces[:, NEXT].ravel()
    arms, bends = vertices[last] - vertices[first], normals[last] - normals[first]
    squares = np.maximum(np.einsum("ec,ec->e", arms, arms), MIN_LENGTH**2)
    steepest, steepness = np.zeros(count), np.sqrt(np.einsum("ec,ec->e", bends, bends) / squares)
    for end in (first, last):
        np.maximum.at(steepest, end, steepness)
    size = 2 * len(arms)
    by_vertex = csr_array((np.ones(size, bool), (np.concatenate((first, last)), np.arange(size))), (count, size))
    starts, edges = by_vertex.indptr.astype(np.int64), by_vertex.indices.astype(np.int64) % len(arms)
    return _VertexBends(faces, parent, normals, sharp, rim, bends, arms, squares, steepest, starts, edges)


def _continues(vertices: Array, at_vertices: _VertexBends, corners: IntArray, turned: Array) -> Array:
    r"""Return how well the curvature over each facet continues at each of its corners, shape (f, 3): 0 to 1.

    From the normal of the facet to that of a corner the surface turns by the vector :math:`\mathbf{t}`, over half of
    the extent :math:`w` of the facet along it. Along the edges :math:`\mathbf{e}` of the corner, the normals turn by
    :math:`\delta \mathbf{n}`. The two curvatures are

    .. math::

        \kappa = \frac{2\, \lVert \mathbf{t} \rVert}{w}, \qquad
        \kappa' = \max_{\mathbf{e}} \frac{|(\delta \mathbf{n} \cdot \hat{\mathbf{t}})
        (\mathbf{e} \cdot \hat{\mathbf{t}})|}{\lVert \mathbf{e} \rVert^2} \quad [1 / \text{m}]
    """
    low, high = NEXT_RATIOS
    ahead, points = unit(turned), vertices[corners]
    extents = (np.abs(np.einsum("fkc,fkc->fk", points[:, to] - points, ahead)) for to in (NEXT, PREVIOUS))
    over = 2 * np.einsum("fkc,fkc->fk", turned, ahead) / np.maximum(np.maximum(*extents), MIN_LENGTH)
    continues = np.ones(corners.shape)
    # The steepest bend is in any direction; where it is small, directions need not be compared.
    face, corner = np.nonzero(at_vertices.steepest[corners] > low * over)
    if len(face) == 0:
        return continues
    at, toward = corners[face, corner], ahead[face, corner]
    begin, count = at_vertices.starts[at], np.diff(at_vertices.starts)[at]
    starts = np.cumsum(count) - count
    edge = at_vertices.edges[np.arange(count.sum()) + np.repeat(begin - starts, count)]
    toward = np.repeat(toward, count, axis=0)
    bends, arms = (np.einsum("pc,pc->p", part[edge], toward) for part in (at_vertices.bends, at_vertices.arms))
    curvatures = np.abs(bends * arms) / at_vertices.squares[edge]
    ratios = np.maximum.reduceat(curvatures, starts) / np.maximum(over[face, corner], MIN_LENGTH)
    continues[face, corner] = np.clip((high - ratios) / (high - low), 0, 1)
    return continues


def gaps_below(surface: BSplineSurface, uv: Array, triangles: Array, points: Array) -> Array:
    r"""Return the gaps of facets from the curvature of a surface near them.

    Over a noisy scan the surface is smoother than the normals of the vertices. With the second fundamental form
    :math:`\mathrm{II}` of the surface:

    .. math::

        g = -\frac{1}{2} \sum_{i < j} b_i b_j\, \mathrm{II}(\mathbf{p}_j - \mathbf{p}_i) \quad [\text{m}]
    """
    r = surface.derivatives(uv, order=2)
    by_u, by_v = r[1, 0], r[0, 1]
    normals = unit(cross(by_u, by_v))
    L, M, N = ((bend * normals).sum(axis=1) for bend in (r[2, 0], r[1, 1], r[0, 2]))
    b, gaps = barycentric(triangles, points), np.zeros(len(points))
    for i, j in ((0, 1), (1, 2), (2, 0)):
        x, y = in_basis(by_u, by_v, triangles[:, j] - triangles[:, i])
        gaps -= b[:, i] * b[:, j] * (L * x * x + 2 * M * x * y + N * y * y) / 2
    return gaps


@dataclass(frozen=True, eq=False)
class ErrorField:
    """The error of a fitted surface: a surface without its known part, and the variance of what remains."""

    surface: BSplineSurface  # with the parameters of the fit, through the vertices instead of along the facets
    height: Array  # (k, l) variance of the height of the true surface over this one, at each sample site [m^2]
    slopes: Array  # (k, l, 2) variance of the slope of this height along u and along v [1]
    rest: Array  # (k, l) mean square of the residuals that the net cannot follow [m^2]
    spacing: Array  # (k, l, 2) distance of adjacent sites along u and along v [m]
    mesh: TriangleMesh | None  # with normals to one side; None: its vertices are noisy

    def at(self, uv: Array) -> tuple[Array, Array]:
        """Return the variances of the height (m,) [m^2] and of its slopes (m, 2) [1] at parameters (m, 2).

        A distance to the mesh, without its gap, of more than two standard deviations replaces them: sites can miss
        errors on small fillets and near poles.
        """
        k, l = self.height.shape
        closed = self.surface.closed[1]
        u, v = np.clip(self.surface.wrap(uv), 0, 1).T
        site = np.stack((u * (k - 1), v * (l if closed else l - 1)))
        fields = np.concatenate((self.height[..., None], self.slopes), axis=2)
        if closed:
            fields = np.concatenate((fields, fields[:, :1]), axis=1)
        values = np.stack([map_coordinates(fields[..., c], site, order=1, mode="nearest") for c in range(3)], axis=1)
        height, slopes = values[:, 0], values[:, 1:]
        if self.mesh is not None:
            points = self.surface.points(uv)
            _, faces, nearest = closest(self.mesh, points)
            above = np.einsum("mc,mc->m", points - nearest, self.mesh.face_normals[faces])
            square = (above - facet_gaps(self.mesh, faces, nearest)[0]) ** 2
            height = np.where(square > MAX_ERROR_RATIO**2 * height, square, height)
        return height, slopes


def error_field(
    mesh: TriangleMesh,
    basis: TensorBasis,
    offsets: Array,
    samples: RaySamples,
    surface_of: Callable[[Array], BSplineSurface],
    converged: bool,
    noise: float,
    stiffness: float,
) -> ErrorField:
    r"""Estimate the error of a fit from its residuals and the shape of the facets.

    A residual is a distance to a facet, which is a chord. The distance to the true surface along the ray adds the gap
    :math:`g` of the facet. The least squares divide this error :math:`e + g` into a part that the net can follow, which
    the returned surface removes, and a rest, which the net cannot follow. The mean square of the rest over one span on
    either side is the variance, with its differences for the slope. The uncertainty of the gaps adds likewise.

    Over a noisy scan the rest is the noise, which the surface averages. Each sample is a mean of the vertices of its
    face, with the weights :math:`b`. A vertex has the sum :math:`w` of its weights in all samples. With the noise
    :math:`\sigma_s` of the samples and the diagonal of the matrix :math:`A` that maps samples to the surface (Wahba,
    1983), the variance of the height is

    .. math::

        \sigma^2_{kl} = A_{kl}\, \frac{\sigma_s^2}{\overline{\sum b^2}}\, \frac{\sum w^2}{\sum w} \quad [\text{m}^2]
    """
    known = ~np.isnan(samples.residuals)
    slope = np.einsum("klc,klc->kl", samples.rays, mesh.face_normals[samples.faces])
    if len(np.unique(np.sign(slope[known]))) > 1:  # normals of vertices need faces that are wound alike
        mesh = coherent(mesh)
        slope = np.einsum("klc,klc->kl", samples.rays, mesh.face_normals[samples.faces])
    cosine = np.maximum(np.abs(slope), MIN_FACET_COSINE)
    faces, points = samples.faces[known], samples.points[known]

    def rest_of(errors: Array) -> tuple[Array, Array]:
        step = basis.solve(errors, np.zeros_like(offsets))
        return step, errors - basis.N @ step @ basis.B.T

    def along_rays(gaps: Array, cosine: Array) -> Array:
        field = np.full(known.shape, np.nan)
        field[known] = gaps / cosine[known]
        return field

    gaps, unsure = facet_gaps(mesh, faces, points)
    step, error = rest_of((samples.residuals if converged else 0) + along_rays(gaps * np.sign(slope[known]), cosine))
    if not converged:  # a fit that oscillates stays as it is
        error = error + samples.residuals
    unknowns, tangents = offsets.size, site_tangents(samples.origins + samples.arms, basis.is_closed)
    spacing = np.linalg.norm(tangents, axis=3)
    if noise > 0 or looks_noisy(mesh, samples, 0.0, unknowns):
        _, plain = rest_of(samples.residuals)
        if np.nansum(plain**2) <= np.nansum(error**2):  # gaps do not explain the residuals: they are noise
            uv = np.argwhere(known) / (len(known) - 1, known.shape[1] - (not basis.is_closed))
            triangles = mesh.triangles[faces]
            normals = unit(cross(tangents[..., 0, :], tangents[..., 1, :]))  # those of the facets are noisy
            cosine = np.maximum(np.abs(np.einsum("klc,klc->kl", samples.rays, normals)), MIN_FACET_COSINE)
            below = along_rays(gaps_below(surface_of(offsets), uv, triangles, points), cosine)
            # as stiff as the fit: sites beat with the facets in both, and the beats have to cancel
            step = basis.solve(below, np.zeros_like(offsets), stiffness)
            weights = barycentric(triangles, points)
            of_vertices = np.bincount(mesh.faces[faces].ravel(), weights.ravel())
            repeats = (of_vertices**2).sum() / of_vertices.sum() / (weights**2).sum(axis=1).mean()
            if noise == 0:
                noise = float(np.sqrt(np.nanmean(plain**2) / max(1 - unknowns * repeats / known.sum(), MIN_FREEDOM)))
            height, *slopes = (noise**2 * repeats * part for part in basis.leverages(stiffness))
            if stiffness:  # what a second smoothing of the residuals would add is an estimate of the bias (Tukey, 1977)
                more = basis.solve(samples.residuals, np.zeros_like(offsets), stiffness)
                height = height + _local_mean((basis.N @ more @ basis.B.T) ** 2, basis)
            steepness, left = np.stack(slopes, axis=2) / spacing**2, _local_mean((plain * cosine) ** 2, basis)
            return ErrorField(surface_of(offsets + step), height * cosine**2, steepness, left, spacing, None)
    heights, of_gaps = error * cosine, along_rays(unsure, np.ones_like(cosine))
    followed = of_gaps - rest_of(of_gaps)[1]  # the slopes of a smooth surface do not jump between facets
    left, of_gaps = (
        np.stack([_local_mean(part**2, basis) for part in (rise, *slopes_of(smooth, spacing, basis.is_closed))])
        for rise, smooth in ((heights, heights), (of_gaps, followed))
    )
    height, by_u, by_v = left + of_gaps
    return ErrorField(surface_of(offsets + step), height, np.stack((by_u, by_v), axis=2), left[0], spacing, mesh)


def slopes_of(heights: Array, spacing: Array, closed: bool) -> tuple[Array, Array]:
    """Return the slopes of heights (k, l) at sites along u and along v."""
    along_u, along_v = (_differences(heights, axis, closed) / spacing[..., axis] for axis in (0, 1))
    return along_u, along_v


def _differences(values: Array, axis: int, closed: bool) -> Array:
    """Return the differences to the next values along an axis; the last one of an open axis is repeated."""
    steps = np.roll(values, -1, axis) - values
    if axis == 0:
        steps[-1] = steps[-2]
    elif not closed:
        steps[:, -1] = steps[:, -2]
    return steps


def _local_mean(values: Array, basis: TensorBasis) -> Array:
    """Return the mean of the values that are not NaN, over the sites of one span on either side, shape (k, l)."""
    weight, total = (~np.isnan(values)).astype(float), np.nan_to_num(values)
    for axis, (count, closed) in enumerate(zip(basis.spans_by_axis, (False, basis.is_closed))):
        sites = values.shape[axis]
        width = min(2 * (sites // count) + 1, sites)
        total, weight = (
            uniform_filter1d(part, width, axis=axis, mode="wrap" if closed else "nearest") for part in (total, weight)
        )
    return np.where(weight > 0, total / np.where(weight > 0, weight, 1.0), np.nan)
