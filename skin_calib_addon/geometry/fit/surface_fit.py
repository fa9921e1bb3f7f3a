"""The constrained fit: every control point moves on its line P_u ∩ P_v until the surface lies on the mesh."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...common.arrays import Array, BoolArray, IntArray
from ...common.errors import EmptySection, PoorFit, millimetres
from ...common.surface_errors import DistanceStatistics, SurfaceErrors
from ...common.warnings import Warning
from ..grid.grids import Grid, PlanesGrid
from ..mesh.triangle_mesh import TriangleMesh
from ..sampling.basis import SITES_PER_SPAN, TensorBasis
from ..sampling.lines import LineGrid
from ..sampling.planes import Planes
from ..sampling.samples import RaySamples, SampleRows
from ..surface.bspline import BSplineSurface, greville
from ..surface.distance import (
    SAMPLES_PER_SPAN,
    MeshDistance,
    closest_on_triangles,
    footpoints,
    is_sampled,
    surface_errors,
    surface_samples,
)
from .chords import chord_gaps
from .diagnosis import condition, dropped_loops, fit_warnings, maximum_deviation
from .smoothing import best_stiffness, looks_noisy, sites_for_noise

MAX_FIT_ITERATIONS = 10
# The pass that moves no control point by more than this share of the mesh's size is the last: the next moves a tenth.
FIT_TOLERANCE = 3e-4
# Passes end where the misfit has grown by this factor over the least: the section is no fan about its centre.
DIVERGENCE_RATIO = 1.2
# Passes end, too, where one moves as far as the one before the last: rays go to and fro over a step.
OSCILLATION_RATIO = 0.97
CHORD_ITERATIONS = 3
CHORD_SITES_PER_SPAN = 6  # per span: how far facets are off their chords changes within each
STIFF_ITERATIONS = 2
# With more samples missing than this, the surface would be made up rather than fitted.
MAX_MISSING_FRACTION = 0.5
# A surface whose area element falls below this share of its mean is folded, or closes to a point.
FOLDED_AREA = 1e-3
# A surface that stays further off than this share of the mesh's size is no fit.
MAX_DEVIATION_FRACTION = 0.05
AREA_SITES_PER_CONTROL_POINT = 5  # places per control point, in each direction, at which the area element is looked at


@dataclass(frozen=True, eq=False)
class SurfaceFit:
    """A surface fitted to a mesh, and how well it lies there."""

    mesh: TriangleMesh
    lines: LineGrid
    basis: TensorBasis
    offsets: Array  # (n, m) of the control points along their lines [m]
    surface: BSplineSurface
    samples: RaySamples
    iterations: int
    converged: bool  # whether the passes came to rest
    noise: float  # standard deviation of the scan about the surface where that was smoothed [m]; else 0

    @property
    def residuals(self) -> Array:
        """Distances from surface to mesh along the sample rays, shape (k, l) [m]; NaN where the mesh has nothing."""
        return self.samples.residuals

    @property
    def points(self) -> Array:
        """Where the sample rays met the mesh, shape (k, l, 3) [m]."""
        return self.samples.points

    @cached_property
    def errors(self) -> SurfaceErrors:
        """Distances between mesh and surface, both ways [m]."""
        return surface_errors(self.mesh, self.surface, ~np.isnan(self.residuals))

    @property
    def missing(self) -> float:
        """Share of the sample rays that meet no mesh: holes that the surface spans."""
        return float(np.isnan(self.residuals).mean())

    @cached_property
    def worst(self) -> tuple[Array, Array, float]:
        """Where the surface is furthest from the mesh: parameters (2,), point (3,) [m], distance [m]."""
        uv, _ = surface_samples(self.surface)
        uv = uv[is_sampled(self.surface, uv, ~np.isnan(self.residuals))]
        points = self.surface.points(uv)
        distance = MeshDistance(self.mesh)(points)[0]
        i = int(np.argmax(distance))
        return uv[i], points[i], float(distance[i])

    @cached_property
    def smallest_area(self) -> float:
        """Least ``|r_u x r_v|`` over its mean, on a dense grid: near zero where the surface closes to a point.

        Negative where ``r_u x r_v`` turns against the rays: the surface has folded over.
        """
        k, l = (AREA_SITES_PER_CONTROL_POINT * size for size in self.offsets.shape)
        v = np.arange(l) / l if self.lines.closed else np.linspace(0, 1, l)
        uv = np.column_stack((np.repeat(np.linspace(0, 1, k), l), np.tile(v, k)))
        r = self.surface.derivatives(uv)
        normals = np.cross(r[1, 0], r[0, 1])
        s = self.surface
        outward = BSplineSurface(self.basis.close(self.lines.directions), s.knots_u, s.knots_v, s.degree, s.closed)
        areas = np.linalg.norm(normals, axis=1)
        return float((areas * np.sign((normals * outward.points(uv)).sum(axis=1))).min() / areas.mean())

    def distances(self, per_span: int) -> DistanceStatistics:
        """Distance from surface to mesh at other sites than the fit's, by rays: to the planes of the facets they meet.

        A tenth of the cost of ``errors``, and as good where the surface is near the mesh and no edge is between.

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
        """Rays through the surface at other even sites than those of the fit, and where they meet the mesh.

        Parameters
        ----------
        per_span : int
            Sites in each span, in each direction; more where there are few spans.

        Returns
        -------
        arms : array, shape (k, l, 3)
            From the origins of the rays to the surface [m].
        samples : RaySamples
        """
        return self._cast(TensorBasis.of(self.lines, *self.surface.degree, per_span))

    def bounds(self) -> tuple[Array, Array, Array]:
        """What the distances from surface to mesh in ``errors`` do not exceed: those to the facets that rays meet.

        In a fraction of the time.

        Returns
        -------
        points : array, shape (k, 3)
            Of the surface, where ``errors`` looks and no hole is [m].
        bounds : array, shape (k,)
            [m]; infinite where the ray met nothing.
        areas : array, shape (k,)
            That each stands for [m^2].
        """
        uv, areas = surface_samples(self.surface)
        arms, samples = self._cast(TensorBasis.of(self.lines, *self.surface.degree, SAMPLES_PER_SPAN, between=True))
        trusted = np.flatnonzero(self.is_trusted(uv))
        points = (samples.origins + arms).reshape(-1, 3)[trusted]
        foot = closest_on_triangles(points, self.mesh.triangles[samples.faces.ravel()[trusted]])
        bounds = np.linalg.norm(foot - points, axis=1)
        bounds[np.isnan(samples.residuals.ravel()[trusted])] = np.inf
        return points, bounds, areas[trusted]

    def _cast(self, basis: TensorBasis) -> tuple[Array, RaySamples]:
        arms = basis.blend(self.offsets[..., None] * self.lines.directions)
        return arms, SampleRows.of(self.mesh, self.lines, basis).cast(arms)

    def is_trusted(self, uv: Array) -> BoolArray:
        """Whether the mesh was met all around each of some parameters (m, 2); elsewhere the surface spans a hole."""
        return is_sampled(self.surface, np.asarray(uv, float).reshape(-1, 2), ~np.isnan(self.residuals))

    @cached_property
    def condition(self) -> float:
        """Condition number of the least squares."""
        return condition(self.basis)

    @cached_property
    def dropped_loops(self) -> IntArray:
        """How many curves of the section through each row of samples the surface does not follow, shape (k,)."""
        return dropped_loops(SampleRows.of(self.mesh, self.lines, self.basis), self.samples)

    @cached_property
    def warnings(self) -> tuple[Warning, ...]:
        """What an author should look at before trusting this surface."""
        parts = self.lines, self.basis, self.samples
        return tuple(fit_warnings(self.mesh, *parts, self.smallest_area, self.converged))

    def is_within(self, tolerance: float) -> bool:
        """Whether surface and mesh keep within ``tolerance`` [m] of each other everywhere, with no hole and no fold."""
        return self.missing == 0 and self.smallest_area > FOLDED_AREA and self.errors.hausdorff <= tolerance

    def leave_one_out(self) -> Array:
        """Error that each inner u-plane would find if the surface had been fitted without it, shape (n - 2,) [m].

        The mean distance from the section of the plane that was left out to the surface of the others: it shows where
        the planes are too far apart, which the error of the fit itself cannot show. Empty where there are just as many
        planes as the degree needs.
        """
        inner = range(1, len(self.lines.planes_u) - 1 if len(self.lines.planes_u) > self.surface.degree[0] + 1 else 1)
        return np.array([self._without(i) for i in inner])

    def _without(self, i: int) -> float:
        kept = np.delete(np.arange(len(self.lines.planes_u)), i)
        planes = Planes(self.lines.planes_u.points[kept], self.lines.planes_u.normals[kept])
        names, closed = self.lines.v_names, self.lines.closed
        lines = LineGrid(planes, self.lines.origins[kept], self.lines.directions[kept], closed, names)
        surface = fit_lines(self.mesh, lines, self.surface.degree).surface
        at = greville(self.surface.knots_u, self.surface.degree[0])[i]  # where the plane lies, near enough
        row = int(np.rint(at * (len(self.residuals) - 1)))
        points = self.points[row][~np.isnan(self.residuals[row])]
        return float(footpoints(surface, points)[1].mean())


def fit_surface(
    mesh: TriangleMesh, grid: Grid | PlanesGrid | LineGrid, degree: int | tuple[int, int] = 3, chords: bool = False
) -> SurfaceFit:
    """Fit a B-spline surface whose control points lie on the lines of a plane grid (paper, Algorithm 1).

    With the lines and the sample sites fixed, the offsets along the lines are a linear least-squares problem that
    splits into one small factor per direction. Each pass casts the samples anew from the axis through the surface's
    own points, so that the residuals measure distance and not a slip along the surface.

    Parameters
    ----------
    mesh : TriangleMesh
        The cover, [m] in the link frame.
    grid : Grid or PlanesGrid, or LineGrid for lines that are placed already
    degree : int or pair of int
        2 to 5, along u and v.
    chords : bool
        Whether the mesh's vertices lie on the true surface and its facets are chords of it, as those of a model that
        was tessellated are: the surface then bulges over the facets as far as its own curvature says.

    Raises
    ------
    UnderdeterminedFit
        If there are too few planes for the degree.
    EmptySection
        If a plane misses the mesh, or half of the samples find none.
    PoorFit
        If the surface stays far off the mesh somewhere; names the planes and the place.
    """
    degrees = (degree, degree) if isinstance(degree, int) else degree
    lines = grid if isinstance(grid, LineGrid) else grid.line_grid(mesh, degrees)
    fit = fit_lines(mesh, lines, degrees, chords)
    check_fit(fit)
    return fit


def check_fit(fit: SurfaceFit) -> None:
    """Refuse a surface that stays far off the mesh.

    Raises
    ------
    PoorFit
        Names the planes and the place.
    """
    distance, place = maximum_deviation(fit.mesh, fit.lines, fit.basis, fit.samples)
    if distance > MAX_DEVIATION_FRACTION * fit.mesh.size:
        raise PoorFit(
            f"The surface is {distance * 1e3:.1f} mm off the mesh {place.words}. Cut away what protrudes there, move "
            "the planes away from it, use more planes, or fit only a sector or one side of the link.",
            distance=distance,
            place=place,
        )


def fit_lines(mesh: TriangleMesh, lines: LineGrid, degree: tuple[int, int], chords: bool = False) -> SurfaceFit:
    """``fit_surface`` along lines that are placed, however far off the surface stays."""
    basis = TensorBasis.of(lines, *degree, CHORD_SITES_PER_SPAN if chords else SITES_PER_SPAN)
    rows = SampleRows.of(mesh, lines, basis)
    offsets = np.full(lines.origins.shape[:2], 0.5 * mesh.size)
    samples = rows.cast(basis.blend(offsets[..., None] * lines.directions))
    check_coverage(lines, basis, samples.residuals)
    offsets, samples, iterations, converged = iterate(lines, basis, rows, offsets, samples)
    if converged and looks_noisy(mesh, samples, 0.0, offsets.size):
        finer = TensorBasis.of(lines, *degree, sites_for_noise(mesh, basis, samples))
        if len(finer.N) * len(finer.M) > samples.residuals.size:
            basis = finer
            rows = SampleRows.of(mesh, lines, basis)
            samples = rows.cast(basis.blend(offsets[..., None] * lines.directions))
            offsets, samples, more, converged = iterate(lines, basis, rows, offsets, samples)
            iterations += more
    gaps = np.zeros(samples.residuals.shape)  # how far out of the facets the surface is to lie
    for _ in range(CHORD_ITERATIONS if chords else 0):
        lift = chord_gaps(mesh, surface_at(lines, basis, offsets), samples)
        lifted, lifted_samples, more, converged = iterate(lines, basis, rows, offsets, samples, lift)
        iterations += more
        if rms_residual(lifted_samples.residuals + lift) > rms_residual(samples.residuals + gaps):
            break  # a smooth surface through the corners would fit better than one through the facets, not worse
        offsets, samples, gaps = lifted, lifted_samples, lift
    stiffness = noise = 0.0
    if looks_noisy(mesh, samples, gaps, offsets.size):
        stiffness, noise = best_stiffness(mesh, basis, samples, gaps, offsets)
    for _ in range(STIFF_ITERATIONS if stiffness else 0):
        offsets = offsets + basis.solve(samples.residuals + gaps, offsets, stiffness)
        samples = rows.cast(basis.blend(offsets[..., None] * lines.directions))
        iterations += 1
    check_coverage(lines, basis, samples.residuals)  # the rays have moved with the surface
    surface = surface_at(lines, basis, offsets)
    return SurfaceFit(mesh, lines, basis, offsets, surface, samples, iterations, converged, noise)


def iterate(
    lines: LineGrid,
    basis: TensorBasis,
    rows: SampleRows,
    offsets: Array,
    samples: RaySamples,
    gaps: Array | float = 0.0,
) -> tuple[Array, RaySamples, int, bool]:
    """Passes of solving and casting until no control point moves, or the residuals grow.

    Parameters
    ----------
    offsets : array, shape (n, m)
        Of the control points along their lines [m], to start from.
    samples : RaySamples
        Where the rays through the surface with these offsets met the mesh.
    gaps : array, shape (k, l), or 0
        How far out of the mesh the surface is to lie at each site [m].

    Returns
    -------
    offsets, samples
        Those of the pass with the least residuals.
    passes : int
    settled : bool
        Whether no control point moved in the last.
    """
    best, least = (offsets, samples), rms_residual(samples.residuals + gaps)
    converged, moves = False, []
    for iterations in range(1, MAX_FIT_ITERATIONS + 1):  # noqa: B007
        step = basis.solve(samples.residuals + gaps, offsets)
        offsets = offsets + step
        samples = rows.cast(basis.blend(offsets[..., None] * lines.directions))
        misfit = rms_residual(samples.residuals + gaps)
        if misfit > DIVERGENCE_RATIO * least:
            break
        if misfit < least:
            best, least = (offsets, samples), misfit
        moves.append(float(np.abs(step).max()))
        converged = moves[-1] < FIT_TOLERANCE * rows.mesh.size
        if converged or (iterations > 2 and moves[-1] > OSCILLATION_RATIO * moves[-3]):
            break
    return *best, iterations, converged


def rms_residual(residuals: Array) -> float:
    """Root mean square of the residuals that are known [m]."""
    return float(np.sqrt(np.nanmean(residuals**2)))


def surface_at(lines: LineGrid, basis: TensorBasis, offsets: Array) -> BSplineSurface:
    """The surface whose control points lie at these offsets along their lines."""
    net = basis.close(lines.origins + offsets[..., None] * lines.directions)
    degree = (basis.degree_u, basis.degree_v)
    return BSplineSurface(net, basis.u.knots, basis.v.knots, degree, (False, lines.closed), lines.seam)


def check_coverage(lines: LineGrid, basis: TensorBasis, residuals: Array) -> None:
    """Refuse planes that miss the mesh.

    Raises
    ------
    EmptySection
        Names a u-plane or v-line near which no ray meets the mesh, or the share of all rays that do not.
    """
    missed = np.isnan(residuals)
    for what, weights, empty in (("u", basis.N, missed.all(axis=1)), ("v", basis.M, missed.all(axis=0))):
        nearest = weights.argmax(axis=0)  # the site at which each plane counts most
        lost = np.flatnonzero(empty[nearest])
        if len(lost):
            i = int(lost[np.argmax(weights[nearest[lost], lost])])  # its own row is lost, not one between it and others
            name, place = (
                (f"u-plane {i}", lines.origins[i, 0]) if what == "u" else (lines.v_names[i], lines.origins[0, i])
            )
            raise EmptySection(
                f"{name}, through {millimetres(place)}, misses the mesh; move it, or widen the margin", plane=i
            )
    if missed.mean() > MAX_MISSING_FRACTION:
        raise EmptySection(
            f"{missed.mean():.0%} of the sample rays meet no mesh; move the axis or the planes, or use a patch grid",
            missing=float(missed.mean()),
        )
