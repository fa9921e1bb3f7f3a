"""The result of a fit: a surface with its errors, and what an author should check."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree

from ...common.arrays import Array, BoolArray, IntArray, cross, norms, pairs_of
from ...common.errors import EmptySection
from ...common.surface_errors import DistanceStatistics, SurfaceErrors
from ...common.warnings import Warning
from ..mesh.distance import closest
from ..mesh.triangle_mesh import TriangleMesh
from ..sampling.basis import TensorBasis
from ..sampling.lines import LineGrid
from ..sampling.samples import RaySamples, SampleRows
from ..surface.bspline import BSplineSurface
from ..surface.distance import is_sampled, surface_samples
from .diagnosis import DeviationLimits, DroppedCurves, dropped_curve_warnings, fit_warnings
from .error_field import ErrorField, error_field
from .error_report import (
    MIN_COVER_COSINE,
    IsCover,
    VertexFeet,
    mean_to_mesh,
    mesh_to_surface,
    surface_to_mesh,
    winding,
)
from .inner_parts import inner_part_warnings
from .undercut import undercut_warnings

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
    inner: TriangleMesh | None = None  # the parts that the cover leaves out as inner ones; None: none, or not known

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
        to_mesh = self.to_mesh
        mesh, is_cover = self._mesh_inside
        known, side = ~np.isnan(self.residuals), winding(self.mesh, self.samples)
        to_surface = mesh_to_surface(mesh, self.surface, known, side, self._feet, is_cover)
        return SurfaceErrors(to_surface, to_mesh, max(to_surface.max, to_mesh.max))

    @cached_property
    def _step(self) -> float:
        """Return the usual distance of adjacent hits, along the direction in which it is longer [m]; 0 without any."""
        steps = [np.linalg.norm(np.diff(self.points, axis=axis), axis=2) for axis in (0, 1)]
        return max(float(np.median(known)) if (known := a[~np.isnan(a)]).size else 0.0 for a in steps)

    @cached_property
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
    def _to_mesh(self) -> tuple[DistanceStatistics, Array]:
        """Return the distances from surface to mesh, and the parameters (2,) of the largest."""
        return surface_to_mesh(self.mesh, self.surface, self.is_measured, self._feet)

    @cached_property
    def _feet(self) -> VertexFeet:
        return VertexFeet.of(self._mesh_inside[0], self.surface)

    @property
    def to_mesh(self) -> DistanceStatistics:
        """Return the distances from surface to mesh, a part of ``errors`` [m]."""
        return self._to_mesh[0]

    @cached_property
    def mean_to_mesh(self) -> float:
        """Return the mean distance from surface to mesh [m], in half the time of ``to_mesh``."""
        return mean_to_mesh(self.mesh, self.surface, self.is_measured)

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
        statistics, at = self._to_mesh
        return at, self.surface.points(at[None])[0], statistics.max

    @cached_property
    def deviations(self) -> Array:
        """Return the distance from surface to mesh of each of ``surface_samples``, (k,) [m]; NaN where not measured."""
        uv = surface_samples(self.surface)[0]
        measured = self.is_measured(uv)
        found = np.full(len(uv), np.nan)
        found[measured] = closest(self.mesh, self.surface.points(uv[measured]))[0]
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
        u, s = np.linspace(0, 1, k), self.surface
        outward = BSplineSurface(self.basis.close(self.lines.directions), s.knots_u, s.knots_v, s.degree, s.closed)
        normals, uv = cross(*s.grid_tangents(u, v)), pairs_of(u, v)
        areas = norms(normals).ravel()
        signed = areas * np.sign((normals * outward.grid_points(u, v)).sum(axis=2)).ravel()
        if self.lines.region is not None:
            signed[~self.lines.region(s.points(uv))] = np.inf
        least = int(signed.argmin())
        return float(signed[least] / areas.mean()), uv[least]

    def is_trusted(self, uv: Array) -> BoolArray:
        """Return whether the mesh was hit all around parameters (m, 2), inside the boundary of the region.

        Elsewhere the surface spans a hole.
        """
        return self._are_inside(uv, ~np.isnan(self.residuals), self.samples.outside)

    def is_measured(self, uv: Array) -> BoolArray:
        """Return at which parameters (m, 2) errors count, shape (m,): inside the boundary, but not over holes."""
        return self._are_inside(uv, ~self.samples.holes)

    def _are_inside(self, uv: Array, known: BoolArray, outside: BoolArray | None = None) -> BoolArray:
        """Return whether parameters (m, 2) are among known sites (k, l), as for ``is_sampled``, inside the boundary."""
        uv = np.asarray(uv, float).reshape(-1, 2)
        inside = is_sampled(self.surface, uv, known, outside)
        if self.lines.region is not None:
            inside[inside] = self.lines.region(self.surface.points(uv[inside]))
        return inside

    @cached_property
    def condition(self) -> float:
        """Return the condition number of the least squares: the product of the condition numbers of its factors."""
        return float(np.linalg.cond(self.basis.N) * np.linalg.cond(self.basis.B))

    @property
    def dropped_loops(self) -> IntArray:
        """Return the number of curves in the section of each row that the surface does not follow, shape (k,)."""
        return self._dropped_curves.counts

    @cached_property
    def _dropped_curves(self) -> DroppedCurves:
        return DroppedCurves.of(SampleRows.of(self.mesh, self.lines, self.basis), self.samples)

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
            found += dropped_curve_warnings(self.lines.u_names, self.basis, self._dropped_curves)
            found += undercut_warnings(self.mesh, *parts, self.surface)
        if self.inner is not None:
            found += inner_part_warnings(self.inner, self.surface, self.is_trusted, self.limits.warned)
        if self.refused_chords:
            found.append(Warning("chords-refused", "warning", CHORDS_REFUSED, advice="Remove the option chords."))
        return tuple(found)


def surface_at(lines: LineGrid, basis: TensorBasis, offsets: Array) -> BSplineSurface:
    """Return the surface whose control points have these offsets along their lines."""
    net = basis.close(lines.origins + offsets[..., None] * lines.directions)
    degree = (basis.degree_u, basis.degree_v)
    return BSplineSurface(net, basis.u.knots, basis.v.knots, degree, (False, lines.closed), lines.centre)
