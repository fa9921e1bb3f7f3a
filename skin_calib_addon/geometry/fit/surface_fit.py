"""The constrained fit: each control point moves on its line P_u ∩ P_v until the surface fits the mesh."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from ...common.arrays import Array, BoolArray, IntArray, pairs_of
from ...common.errors import EmptySection, PoorFit, millimetres
from ...common.surface_errors import DistanceStatistics, SurfaceErrors
from ...common.warnings import Place, Warning, point_of
from ..grid.grids import Grid, PlanesGrid
from ..mesh.closest import closest_on_triangles
from ..mesh.outliers import without_outliers
from ..mesh.triangle_mesh import TriangleMesh
from ..sampling.basis import SITES_PER_SPAN, TensorBasis
from ..sampling.lines import LineGrid
from ..sampling.planes import Planes
from ..sampling.samples import RaySamples, SampleRows
from ..surface.bspline import BSplineSurface, greville
from ..surface.distance import SAMPLES_PER_SPAN, is_sampled, surface_samples
from ..surface.footpoints import footpoints
from .chords import lift_to_corners
from .diagnosis import (
    MAX_DEVIATION,
    DeviationLimits,
    condition,
    dropped_curve_warnings,
    dropped_curves,
    fit_warnings,
    maximum_deviation,
    off,
)
from .error_field import ErrorField, error_field
from .error_report import MIN_COVER_COSINE, IsCover, NearMesh, mesh_to_surface, surface_to_mesh, winding
from .smoothing import MAX_SCORE_RATIO, best_stiffness, looks_noisy, sites_for_noise
from .undercut import undercut_warnings

# [1] most iterations of a fit. Larger: slowly converging fits get closer to the mesh, more time.
MAX_FIT_ITERATIONS = 10
# [fraction of the mesh size] movement of the control points below which the fit has converged; the next iteration would
# move them about a tenth as far. Larger: fewer iterations, less accurate surfaces.
FIT_TOLERANCE = 3e-4
# [1] ratio of the residuals to their least value above which the iterations diverge, because the section is not
# star-shaped about its centre. Larger: later stop.
DIVERGENCE_RATIO = 1.2
# [1] ratio of a movement to the movement two iterations before above which the iterations oscillate, because rays
# alternate over a step. Larger: later stop.
OSCILLATION_RATIO = 0.97
# [1] iterations after which a ray inside a boundary gets no hit any more where it had none. Larger: more iterations in
# which single rays alternate at the rim; smaller: the surface may not yet be where they hit.
FREE_ITERATIONS = 4
# [1] sample sites per span and direction of a preview. Larger: the preview is nearer to the exact fit, more time.
DRAFT_SITES_PER_SPAN = 2
# [1] sample sites per span and direction if facets are chords and fewer than the usual sites, because the distance
# varies within each facet. Larger: more accurate, more time.
CHORD_SITES_PER_SPAN = 6
# [1] most movements from facets to the surface through their corners. Larger: no visible effect, more time.
CHORD_PASSES = 3
# [m] square of such a movement over the mesh size, by which footpoints move. Below, no further movement follows.
# Larger: less accurate surfaces over coarse meshes.
CHORD_TOLERANCE = 1e-7
# [1] iterations of the least squares with stiffness. Larger: no visible effect, more time.
STIFF_ITERATIONS = 2
# [fraction of the samples] that may be missing; above, most of the surface would be extrapolated. Larger: fits over
# larger holes are allowed.
MAX_MISSING_FRACTION = 0.5
# [1] smallest area element to the mean area element below which a surface is folded, or closes to a point.
MIN_AREA_RATIO = 1e-3
# [1] points per control point and direction at which the area element is evaluated. Larger: smaller folds are found.
AREA_SITES_PER_CONTROL_POINT = 5

CHORDS_REFUSED = (
    "The vertices of the mesh are not on a smooth surface: a surface through them follows the facets no better. "
    "The facets were used as they are."
)


@dataclass(frozen=True, eq=False)
class SurfaceFit:
    """A surface fitted to a mesh, with its residuals and errors."""

    mesh: TriangleMesh
    lines: LineGrid
    basis: TensorBasis
    offsets: Array  # (n, m) of the control points along their lines [m]
    surface: BSplineSurface
    samples: RaySamples
    iterations: int
    movement: Array | None  # (k, l) of the surface at the sites in the last iteration [m]; None: it converged
    noise: float  # standard deviation of the scan about a smoothed surface [m]; 0 without smoothing
    limits: DeviationLimits = DeviationLimits()  # of its distance from the mesh
    stiffness: float = 0.0  # of the smoothed surface, see ``TensorBasis.solve``; 0 without smoothing
    outliers: tuple[
        Warning, ...
    ] = ()  # about vertices that were moved onto the plane of their neighbours before the fit
    with_outliers: TriangleMesh | None = None  # the mesh as it was given; None if no vertex was moved
    refused_chords: bool = False  # whether facets that should be chords were used as they are

    @property
    def converged(self) -> bool:
        """Return whether the control points stopped moving."""
        return self.movement is None

    @property
    def given_mesh(self) -> TriangleMesh:
        """Return the mesh with its outliers: they may be noise, or real parts over which no skin can be."""
        return self.mesh if self.with_outliers is None else self.with_outliers

    @property
    def residuals(self) -> Array:
        """Return the distances from surface to mesh along the sample rays, shape (k, l) [m]; NaN without a hit."""
        return self.samples.residuals

    @property
    def points(self) -> Array:
        """Return the points where the sample rays hit the mesh, shape (k, l, 3) [m]."""
        return self.samples.points

    @cached_property
    def errors(self) -> SurfaceErrors:
        """Return the distances between mesh and surface, in both directions [m]."""
        to_mesh, _ = self._to_mesh
        mesh, is_cover = self._mesh_inside
        known, side = ~np.isnan(self.residuals), winding(self.mesh, self.samples)
        to_surface = mesh_to_surface(mesh, self.surface, known, side, is_cover)
        return SurfaceErrors(to_surface, to_mesh, max(to_surface.max, to_mesh.max))

    @cached_property
    def _step(self) -> float:
        """Return the usual distance of adjacent hits, along the direction in which it is longer [m]; 0 without any."""
        steps = [np.linalg.norm(np.diff(self.points, axis=axis), axis=2) for axis in (0, 1)]
        return max(float(np.median(known)) if (known := a[~np.isnan(a)]).size else 0.0 for a in steps)

    @property
    def _mesh_inside(self) -> tuple[TriangleMesh, IsCover | None]:
        """Return the faces of the mesh inside the boundary, and which points of them are on the cover.

        The faces are those that rays hit, and those between them: with the centre inside, near a hit, and facing the
        same side as the face that was hit. Points are on the cover inside the boundary, near a hit. A hit that is
        farther from the surface than hits are from each other does not count: at a rim, rays hit what is below.
        """
        region = self.lines.region
        if region is None:
            return self.mesh, None
        step = self._step
        hit = np.abs(np.nan_to_num(self.residuals, nan=np.inf)) <= step
        if not hit.any():
            return self.mesh, None
        faces, hits = self.samples.faces[hit], cKDTree(self.points[hit])
        centres, normals = self.mesh.triangles.mean(axis=1), self.mesh.face_normals
        distance, nearest = map(np.asarray, hits.query(centres))
        between = region(centres) & (distance <= step + self.mesh.longest_sides / 2)
        between &= (normals * normals[faces[nearest]]).sum(axis=1) > MIN_COVER_COSINE
        between[faces] = True

        def is_cover(points: Array) -> BoolArray:
            on_cover = np.isfinite(hits.query(points, distance_upper_bound=step)[0])
            near = np.flatnonzero(on_cover)
            on_cover[near] = region(points[near])
            return on_cover

        return TriangleMesh(self.mesh.vertices, self.mesh.faces[between]), is_cover

    @cached_property
    def _to_mesh(self) -> tuple[DistanceStatistics, int]:
        """Return the distances from surface to mesh, and which of the points of ``bounds`` is furthest away."""
        points, bounds, areas = self.bounds()
        if len(points) == 0:
            raise EmptySection(
                "No sample ray hit the mesh next to another one, so the error is unknown. Move the planes."
            )
        return surface_to_mesh(self.mesh, points, bounds, areas, self.samples.faces)

    @cached_property
    def error_field(self) -> ErrorField:
        """Return the surface without the known error under the facets, and the variance of the error that remains."""
        parts, state = (self.basis, self.offsets, self.samples), (self.converged, self.noise, self.stiffness)
        return error_field(self.mesh, *parts, lambda offsets: surface_at(self.lines, self.basis, offsets), *state)

    @property
    def missing(self) -> float:
        """Return the fraction of the sample rays without a hit: holes that the surface spans."""
        return self.samples.missing

    @cached_property
    def worst(self) -> tuple[Array, Array, float]:
        """Return the position of the maximum deviation from the mesh: parameters (2,), point (3,) [m], distance [m]."""
        statistics, index = self._to_mesh
        uv = surface_samples(self.surface)[0]
        at = uv[self.is_measured(uv)][index]
        return at, self.surface.points(at[None])[0], statistics.max

    @cached_property
    def deviations(self) -> Array:
        """Return the distance from surface to mesh of each of ``surface_samples``, (k,) [m]; NaN where not measured.

        Their maximum is that of ``errors``, which computes fewer of them.
        """
        measured = self.is_measured(surface_samples(self.surface)[0])
        points, bounds, _ = self.bounds()
        found = np.full(len(measured), np.nan)
        found[measured] = np.minimum(bounds, NearMesh(self.mesh, self.samples.faces)(points, bounds))
        return found

    @cached_property
    def smallest_area(self) -> float:
        """Return the least ``|r_u x r_v|`` over its mean, on a dense grid.

        It is near zero where the surface closes to a point. It is negative where ``r_u x r_v`` is opposite to the rays:
        the surface is folded.
        """
        return self._smallest_area[0]

    @cached_property
    def _smallest_area(self) -> tuple[float, Array]:
        """Return ``smallest_area``, and its parameters (2,)."""
        k, l = (AREA_SITES_PER_CONTROL_POINT * size for size in self.offsets.shape)
        v = np.arange(l) / l if self.lines.closed else np.linspace(0, 1, l)
        uv = pairs_of(np.linspace(0, 1, k), v)
        r = self.surface.derivatives(uv)
        normals = np.cross(r[1, 0], r[0, 1])
        s = self.surface
        outward = BSplineSurface(self.basis.close(self.lines.directions), s.knots_u, s.knots_v, s.degree, s.closed)
        areas = np.linalg.norm(normals, axis=1)
        signed = areas * np.sign((normals * outward.points(uv)).sum(axis=1))
        if self.lines.region is not None:
            signed[~self.lines.region(s.points(uv))] = np.inf
        least = int(signed.argmin())
        return float(signed[least] / areas.mean()), uv[least]

    def distances(self, per_span: int) -> DistanceStatistics:
        r"""Return the distances from surface to mesh at other sites than those of the fit.

        A ray with the residual :math:`e`, the direction :math:`\mathbf{r}` and a facet with the normal
        :math:`\mathbf{n}` has the distance :math:`|e\, (\mathbf{r} \cdot \mathbf{n})|` to the plane of the facet [m].
        This takes a tenth of the time of ``errors``. It is as accurate where the surface is near the mesh and no edge
        is in between.

        Parameters
        ----------
        per_span : int
            Sites in each span, in each direction; more where there are few spans.

        Returns
        -------
        DistanceStatistics
            Weighted by the area of each site [m].
        """
        arms, samples = self.resampled(per_span)
        points = samples.origins + arms
        step = np.roll(points, -1, axis=1) - np.roll(points, 1, axis=1)
        if not self.lines.closed:
            step[:, [0, -1]] = points[:, [1, -1]] - points[:, [0, -2]]  # half a cell at the edges
        areas = np.linalg.norm(np.cross(step, np.gradient(points, axis=0)), axis=2)
        areas[[0, -1]] /= 2
        slope = np.abs((samples.rays * self.mesh.face_normals[samples.faces]).sum(axis=2))
        known = ~np.isnan(samples.residuals)
        return DistanceStatistics.of(np.abs(samples.residuals * slope)[known], areas[known])

    def resampled(self, per_span: int) -> tuple[Array, RaySamples]:
        """Return rays through the surface at other even sites than those of the fit, and their hits on the mesh.

        Parameters
        ----------
        per_span : int
            Sites in each span, in each direction; more where there are few spans.

        Returns
        -------
        arms : array, shape (k, l, 3)
            From the origins of the rays to the surface [m].
        samples : RaySamples
            The hits.
        """
        return self._cast(TensorBasis.of(self.lines, *self.surface.degree, per_span))

    def bounds(self) -> tuple[Array, Array, Array]:
        """Return upper bounds of the distances to the mesh in ``errors``: the distances to facets that rays hit.

        This takes a fraction of the time.

        Returns
        -------
        points : array, shape (k, 3)
            Points of the surface that ``errors`` uses, where it is measured [m].
        bounds : array, shape (k,)
            [m]; infinite where the ray hit nothing.
        areas : array, shape (k,)
            Area of each point [m^2].
        """
        uv, areas = surface_samples(self.surface)
        arms, samples = self._cast(TensorBasis.of(self.lines, *self.surface.degree, SAMPLES_PER_SPAN, between=True))
        measured = np.flatnonzero(self.is_measured(uv))
        points = (samples.origins + arms).reshape(-1, 3)[measured]
        foot = closest_on_triangles(points, self.mesh.triangles[samples.faces.ravel()[measured]])
        bounds = np.linalg.norm(foot - points, axis=1)
        bounds[np.isnan(samples.residuals.ravel()[measured])] = np.inf
        return points, bounds, areas[measured]

    def _cast(self, basis: TensorBasis) -> tuple[Array, RaySamples]:
        arms = basis.blend(self.offsets[..., None] * self.lines.directions)
        return arms, SampleRows.of(self.mesh, self.lines, basis).cast(arms)

    def is_trusted(self, uv: Array) -> BoolArray:
        """Return whether the mesh was hit all around parameters (m, 2), inside the boundary of the region.

        Elsewhere the surface spans a hole.
        """
        uv, known, outside = np.asarray(uv, float).reshape(-1, 2), ~np.isnan(self.residuals), self.samples.outside
        if outside is None or self.lines.region is None:
            return is_sampled(self.surface, uv, known)
        is_inside = self.lines.region(self.surface.points(uv))
        return is_inside & is_sampled(self.surface, uv, known, outside)

    def is_measured(self, uv: Array) -> BoolArray:
        """Return at which parameters (m, 2) errors count, shape (m,): where the surface is trusted, near a hit.

        At a boundary some of the sites around are outside, and a hit can be farther away than hits are from each other:
        in a tip of the boundary, and at its ends, where sites are sparse. There the surface is extrapolated.
        """
        counts = self.is_trusted(uv)
        if self.samples.outside is not None:
            chosen = np.flatnonzero(counts)
            points, hits = self.surface.points(uv[chosen]), cKDTree(self.points[~np.isnan(self.residuals)])
            counts[chosen] = np.isfinite(hits.query(points, distance_upper_bound=np.sqrt(2) * self._step)[0])
        return counts

    @cached_property
    def condition(self) -> float:
        """Return the condition number of the least squares."""
        return condition(self.basis)

    @property
    def dropped_loops(self) -> IntArray:
        """Return the number of curves in the section of each row that the surface does not follow, shape (k,)."""
        return self._dropped_curves[0]

    @cached_property
    def _dropped_curves(self) -> tuple[IntArray, Array, Array]:
        return dropped_curves(SampleRows.of(self.mesh, self.lines, self.basis), self.samples)

    @cached_property
    def warnings(self) -> tuple[Warning, ...]:
        """Return what an author should check before trusting this surface."""
        parts = self.lines, self.basis, self.samples
        try:
            worst = self.worst
        except EmptySection:
            worst = None
        about = fit_warnings(self.mesh, *parts, *self._smallest_area, self.movement, self.limits, worst)
        found = [*self.outliers, *about]
        if self.lines.region is None:  # with a boundary, what is next to or below the surface is left out on purpose
            found += dropped_curve_warnings(self.lines, self.basis, self._dropped_curves)
            found += undercut_warnings(self.mesh, *parts, self.surface)
        if self.refused_chords:
            found.append(Warning("chords-refused", "warning", CHORDS_REFUSED, advice="Remove the option chords."))
        return tuple(found)

    def is_within(self, tolerance: float) -> bool:
        """Return whether surface and mesh are within ``tolerance`` [m] of each other, without holes and folds."""
        return self.missing == 0 and self.smallest_area > MIN_AREA_RATIO and self.errors.hausdorff <= tolerance

    def leave_one_out(self) -> Array:
        """Return the error at each inner u-plane of a surface fitted without it, shape (n - 2,) [m].

        It is the mean distance from the section of the omitted plane to the surface of the others. It shows where the
        planes are too far apart, which the error of the fit itself cannot show. It is empty if the degree needs all
        planes.
        """
        inner = range(1, len(self.lines.planes_u) - 1 if len(self.lines.planes_u) > self.surface.degree[0] + 1 else 1)
        return np.array([self._without(i) for i in inner])

    def _without(self, i: int) -> float:
        kept = np.delete(np.arange(len(self.lines.planes_u)), i)
        planes = Planes(self.lines.planes_u.points[kept], self.lines.planes_u.normals[kept])
        names, closed = self.lines.v_names, self.lines.closed
        lines = LineGrid(planes, self.lines.origins[kept], self.lines.directions[kept], closed, names)
        surface = fit_lines(self.mesh, lines, self.surface.degree).surface
        at = greville(self.surface.knots_u, self.surface.degree[0])[i]  # an approximate parameter of the plane
        row = int(np.rint(at * (len(self.residuals) - 1)))
        points = self.points[row][~np.isnan(self.residuals[row])]
        return float(footpoints(surface, points)[1].mean())


def fit_surface(
    mesh: TriangleMesh,
    grid: Grid | PlanesGrid | LineGrid,
    degree: int | tuple[int, int] = 3,
    chords: bool = False,
    max_deviation: float = MAX_DEVIATION,
    draft: bool = False,
) -> SurfaceFit:
    r"""Fit a B-spline surface whose control points are on the lines of a plane grid (paper, Algorithm 1).

    The control point :math:`\mathbf{p}_{ij}` is at the offset :math:`x_{ij}` [m] on its line:

    .. math::

        \mathbf{p}_{ij} = \mathbf{o}_{ij} + x_{ij}\, \mathbf{d}_{ij}, \qquad
        \min_{X} \sum_{k,l} e_{kl}(X)^2

    The residuals :math:`e_{kl}` [m] are distances along rays from the surface to the mesh (see ``RaySamples``). For
    fixed rays this is a linear least-squares problem with one small factor per direction (see ``TensorBasis.solve``).
    Each iteration casts the rays again through the points of the moved surface. The residuals therefore measure
    distances, and not displacements along the surface.

    Single vertices that stand off from a smooth surface are left out, with the warning ``outlier-vertices``.

    Parameters
    ----------
    mesh : TriangleMesh
        The cover, [m] in the link frame.
    grid : Grid or PlanesGrid, or LineGrid
        The grid, or lines that are placed already.
    degree : int or pair of int
        2 to 5, along u and v.
    chords : bool
        Whether the vertices are on the true surface and the facets are chords of it, as in a tessellated model. The
        surface is then outside the facets, at a distance that follows from its own curvature.
    max_deviation : float
        Distance of the surface from the mesh above which the fit is refused [m]. From a fifth of it on, ``warnings``
        has the largest distance.
    draft : bool
        Whether the fit is only a preview: it has fewer sample sites, and "auto" places planes and lines faster.

    Returns
    -------
    SurfaceFit
        The surface with its residuals and errors.

    Raises
    ------
    UnderdeterminedFit
        If there are too few planes for the degree.
    EmptySection
        If a plane misses the mesh, or half of the samples have no hit.
    PoorFit
        If the surface is far from the mesh somewhere; it names the planes and the point.
    """
    degrees = (degree, degree) if isinstance(degree, int) else degree
    given, (mesh, outliers) = mesh, without_outliers(mesh)
    lines = grid if isinstance(grid, LineGrid) else grid.line_grid(mesh, degrees, draft)
    fit = fit_lines(mesh, lines, degrees, chords, draft)
    fit = replace(fit, limits=DeviationLimits.of(max_deviation), **left_out(given, outliers))
    check_fit(fit)
    return fit


def left_out(given: TriangleMesh, outliers: tuple[Warning, ...]) -> dict[str, Any]:
    """Return the members of a fit about outliers.

    Parameters
    ----------
    given : TriangleMesh
        The mesh with its outliers.
    outliers : tuple of Warning
        About them; empty without any.
    """
    return {"outliers": outliers, "with_outliers": given if outliers else None}


def check_fit(fit: SurfaceFit) -> None:
    """Check that a surface is near the mesh everywhere.

    Raises
    ------
    PoorFit
        If it is not; the message names the planes and the point.
    """
    limit = fit.limits.refused
    distance, place = maximum_deviation(fit.mesh, fit.lines, fit.basis, fit.samples, limit)
    if distance > limit:
        raise PoorFit(
            f"The surface is {off(distance, limit)} the mesh {place.words}. Cut away what protrudes there, move the "
            "planes away from it, use more planes, or fit only a sector or one side of the link.",
            distance=distance,
            code="off-mesh",
            place=place,
        )


def fit_lines(
    mesh: TriangleMesh,
    lines: LineGrid,
    degree: tuple[int, int],
    chords: bool = False,
    draft: bool = False,
) -> SurfaceFit:
    """Fit a surface as ``fit_surface`` does, along given lines, without the check of its distance from the mesh.

    Parameters
    ----------
    mesh : TriangleMesh
        The cover, [m] in the link frame.
    lines : LineGrid
        The lines of the control points.
    degree : (int, int)
        Of the surface along u and v.
    chords : bool
        As for ``fit_surface``.
    draft : bool
        As for ``fit_surface``.

    Returns
    -------
    SurfaceFit
        The surface with its residuals and errors.
    """
    basis = TensorBasis.of(lines, *degree, DRAFT_SITES_PER_SPAN if draft else SITES_PER_SPAN)
    if chords and len(mesh.faces) < len(basis.N) * len(basis.M):
        basis = TensorBasis.of(lines, *degree, CHORD_SITES_PER_SPAN)
    rows = SampleRows.of(mesh, lines, basis, again=draft)
    offsets = np.full(lines.origins.shape[:2], 0.5 * mesh.size)
    samples = rows.cast(basis.blend(offsets[..., None] * lines.directions))
    check_coverage(lines, basis, samples)
    offsets, samples, iterations, movement = iterate(lines, basis, rows, offsets, samples)
    if movement is None and looks_noisy(mesh, samples, 0.0, offsets.size):
        finer = TensorBasis.of(lines, *degree, sites_for_noise(mesh, basis, samples))
        if len(finer.N) * len(finer.M) > samples.residuals.size:
            basis = finer
            rows = SampleRows.of(mesh, lines, basis)
            samples = rows.cast(basis.blend(offsets[..., None] * lines.directions))
            offsets, samples, more, movement = iterate(lines, basis, rows, offsets, samples)
            iterations += more
    gaps = np.zeros(samples.residuals.shape)  # intended distance of the surface outside the facets
    refused_chords = False
    if chords:
        moved, moved_samples = offsets, samples
        for _ in range(CHORD_PASSES):
            before = moved
            moved, lift = lift_to_corners(mesh, lines, basis, moved, moved_samples)
            moved_samples = rows.cast(basis.blend(moved[..., None] * lines.directions))
            if np.abs(moved - before).max() ** 2 < CHORD_TOLERANCE * mesh.size:
                break
        ratio = rms_residual(moved_samples.residuals + lift) / rms_residual(samples.residuals)
        refused_chords = ratio >= 1.0 or (  # true corners make the residuals smaller, noise does so by chance
            ratio >= MAX_SCORE_RATIO and looks_noisy(mesh, samples, 0.0, offsets.size)
        )
        if not refused_chords:
            offsets, samples, gaps = moved, moved_samples, lift
    stiffness = noise = 0.0
    if looks_noisy(mesh, samples, gaps, offsets.size):
        stiffness, noise = best_stiffness(mesh, basis, samples, gaps, offsets)
    for _ in range(STIFF_ITERATIONS if stiffness else 0):
        offsets = offsets + basis.solve(samples.residuals + gaps, offsets, stiffness)
        samples = rows.cast(basis.blend(offsets[..., None] * lines.directions))
        iterations += 1
    check_coverage(lines, basis, samples)  # the rays moved with the surface
    surface = surface_at(lines, basis, offsets)
    found = SurfaceFit(mesh, lines, basis, offsets, surface, samples, iterations, movement, noise)
    return replace(found, stiffness=stiffness, refused_chords=refused_chords)


def iterate(
    lines: LineGrid,
    basis: TensorBasis,
    rows: SampleRows,
    offsets: Array,
    samples: RaySamples,
    gaps: Array | float = 0.0,
) -> tuple[Array, RaySamples, int, Array | None]:
    r"""Repeat solving and casting until no control point moves, the residuals grow, or the movement oscillates.

    Inside a boundary, single rays may alternate at its rim while the rest still converges: there, neither of the two
    ends the iterations. After ``FREE_ITERATIONS`` a ray that had no hit gets none any more.

    .. math::

        X \leftarrow X + \arg\min_{\delta X} \lVert N\, \delta X\, B^{T} - (E(X) + G) \rVert^2

    Parameters
    ----------
    lines : LineGrid
        The lines of the control points.
    basis : TensorBasis
        The basis matrices :math:`N` and :math:`B` at the sample sites.
    rows : SampleRows
        The sections on which rays are cast.
    offsets : array, shape (n, m)
        Offsets :math:`X` of the control points along their lines [m], to start from.
    samples : RaySamples
        Hits of the rays through the surface with these offsets; they have the residuals :math:`E`.
    gaps : array, shape (k, l), or 0
        Intended distance :math:`G` of the surface outside the mesh at each site [m].

    Returns
    -------
    offsets : array, shape (n, m)
        Of the iteration with the least residuals [m].
    samples : RaySamples
        Of the same iteration.
    iterations : int
        Number of iterations.
    movement : array, shape (k, l), or None
        Of the surface where rays hit, in the last iteration [m]; None if no control point moved.
    """
    best, least = (offsets, samples), rms_residual(samples.residuals + gaps)
    moves: list[float] = []
    bounded = samples.outside is not None
    for iterations in range(1, MAX_FIT_ITERATIONS + 1):  # noqa: B007
        step = basis.solve(samples.residuals + gaps, offsets)
        offsets = offsets + step
        before, samples = samples, rows.cast(basis.blend(offsets[..., None] * lines.directions))
        if bounded and iterations > FREE_ITERATIONS:
            samples = samples.without_new(before)
        misfit = rms_residual(samples.residuals + gaps)
        if misfit > DIVERGENCE_RATIO * least and not bounded:
            break
        if misfit < least:
            best, least = (offsets, samples), misfit
        # Inside a boundary, control points without samples move on.
        moved = movement_of(lines, basis, step, samples) if bounded else np.abs(step)
        moves.append(float(moved.max()))
        if moves[-1] < FIT_TOLERANCE * rows.mesh.size:
            return *best, iterations, None
        if iterations > 2 and moves[-1] > OSCILLATION_RATIO * moves[-3] and not bounded:
            break
    return *best, iterations, movement_of(lines, basis, step, samples)


def movement_of(lines: LineGrid, basis: TensorBasis, step: Array, samples: RaySamples) -> Array:
    """Return how far a step of the offsets (n, m) [m] moves the surface where rays hit, shape (k, l) [m]; 0 elsewhere.

    Parameters
    ----------
    lines : LineGrid
        The lines of the control points.
    basis : TensorBasis
        The basis at the sample sites.
    step : array, shape (n, m)
        Of the control points along their lines [m].
    samples : RaySamples
        Hits of the rays.
    """
    movement = np.linalg.norm(basis.blend(step[..., None] * lines.directions), axis=2)
    return np.where(np.isnan(samples.residuals), 0.0, movement)


def rms_residual(residuals: Array) -> float:
    """Return the root mean square of the residuals that are not NaN [m]."""
    return float(np.sqrt(np.nanmean(residuals**2)))


def surface_at(lines: LineGrid, basis: TensorBasis, offsets: Array) -> BSplineSurface:
    """Return the surface whose control points have these offsets along their lines.

    Parameters
    ----------
    lines : LineGrid
        The lines of the control points.
    basis : TensorBasis
        Gives knots and degrees.
    offsets : array, shape (n, m)
        [m]

    Returns
    -------
    BSplineSurface
    """
    net = basis.close(lines.origins + offsets[..., None] * lines.directions)
    degree = (basis.degree_u, basis.degree_v)
    return BSplineSurface(net, basis.u.knots, basis.v.knots, degree, (False, lines.closed), lines.centre)


def check_coverage(lines: LineGrid, basis: TensorBasis, samples: RaySamples) -> None:
    """Check that each plane and line is near samples that hit the mesh, or that are outside the boundary.

    Parameters
    ----------
    lines : LineGrid
        The lines of the control points.
    basis : TensorBasis
        The basis at the sample sites.
    samples : RaySamples
        Hits of the rays.

    Raises
    ------
    EmptySection
        If no ray near a u-plane or v-line hits the mesh, or too many rays have no hit.
    """
    missed = samples.missed
    if samples.outside is not None and np.isnan(samples.residuals).all():
        raise EmptySection("No sample ray hits the mesh inside the boundary. Move the boundary to the mesh.")
    for what, weights, empty in (("u", basis.N, missed.all(axis=1)), ("v", basis.M, missed.all(axis=0))):
        nearest = weights.argmax(axis=0)  # the site with the largest weight of each plane
        lost = np.flatnonzero(empty[nearest])
        if len(lost):
            i = int(
                lost[np.argmax(weights[nearest[lost], lost])]
            )  # its own row is missing, not only a row between planes
            name, place = (
                (f"u-plane {i}", lines.origins[i, 0]) if what == "u" else (lines.v_names[i], lines.origins[0, i])
            )
            raise EmptySection(
                f"{name}, through {millimetres(place)}, does not intersect the mesh. Move it, or increase the margin.",
                plane=i,
                place=Place(point_of(place), name),
            )
    if samples.missing > MAX_MISSING_FRACTION:
        raise EmptySection(
            f"{samples.missing:.0%} of the sample rays do not hit the mesh. "
            "Move the axis or the planes, or use a grid over a sector or a face.",
            missing=samples.missing,
        )
