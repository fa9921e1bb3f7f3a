"""The constrained fit: each control point moves on its line P_u ∩ P_v until the surface fits the mesh."""

from dataclasses import replace
from typing import Any

import numpy as np

from ...common.arrays import Array
from ...common.errors import EmptySection, PoorFit, millimetres
from ...common.warnings import Place, Warning, point_of
from ..grid.grids import Grid, PlanesGrid
from ..mesh.defects import coherent
from ..mesh.outliers import stray_part, without_outliers
from ..mesh.triangle_mesh import TriangleMesh
from ..sampling.basis import SITES_PER_SPAN, TensorBasis
from ..sampling.lines import LineGrid
from ..sampling.planes import Planes
from ..sampling.samples import RaySamples, SampleRows
from ..surface.bspline import greville
from ..surface.footpoints import footpoints
from .chords import lift_to_corners
from .diagnosis import MAX_DEVIATION, DeviationLimits, maximum_deviation, off
from .smoothing import MAX_SCORE_RATIO, best_stiffness, looks_noisy, sites_for_noise
from .surface_fit import SurfaceFit, surface_at

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
# [1] u-planes on either side of an omitted one, of which the surface without it is made. The effect of a plane is ten
# thousand times smaller that far away. Larger: no visible effect, more time.
NEAR_PLANES = 10
# The advice where no ray hits a mesh with flipped faces.
FLIPPED_ADVICE = (
    "Some faces have a flipped normal, so that the grid does not see them. Recalculate the normals outside."
)
# [fraction of the samples] that may be missing; above, most of the surface would be extrapolated. Larger: fits over
# larger holes are allowed.
MAX_MISSING_FRACTION = 0.5


def fit_surface(
    mesh: TriangleMesh,
    grid: Grid | PlanesGrid | LineGrid,
    degree: int | tuple[int, int] = 3,
    chords: bool = False,
    max_deviation: float = MAX_DEVIATION,
    draft: bool = False,
    start: Array | None = None,
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
    start : array, shape (n, m), optional
        Offsets of control points on similar lines [m], from which the iterations start. By default they are all equal.

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
    fit = fit_lines(mesh, lines, degrees, chords, draft, start)
    fit = replace(fit, limits=DeviationLimits.of(max_deviation), **left_out(given, outliers))
    check_fit(fit)
    return fit


def left_out(given: TriangleMesh, outliers: tuple[Warning, ...]) -> dict[str, Any]:
    """Return the members of a fit about outliers."""
    return {"outliers": outliers, "with_outliers": given if outliers else None}


def check_fit(fit: SurfaceFit) -> None:
    """Check that a surface is near the mesh everywhere."""
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
    start: Array | None = None,
) -> SurfaceFit:
    """Fit a surface as ``fit_surface`` does, along given lines, without the check of its distance from the mesh."""
    basis = TensorBasis.of(lines, *degree, DRAFT_SITES_PER_SPAN if draft else SITES_PER_SPAN)
    if chords and len(mesh.faces) < len(basis.N) * len(basis.M):
        basis = TensorBasis.of(lines, *degree, CHORD_SITES_PER_SPAN)
    rows = SampleRows.of(mesh, lines, basis, again=draft)
    offsets = np.full(lines.origins.shape[:2], 0.5 * mesh.size) if start is None else start
    samples = rows.cast(basis.blend(offsets[..., None] * lines.directions))
    check_coverage(mesh, lines, basis, samples)
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
    check_coverage(mesh, lines, basis, samples)  # the rays moved with the surface
    surface = surface_at(lines, basis, offsets)
    found = SurfaceFit(mesh, lines, basis, offsets, surface, samples, iterations, movement, noise)
    return replace(found, stiffness=stiffness, refused_chords=refused_chords)


def iterate(
    lines: LineGrid,
    basis: TensorBasis,
    rows: SampleRows,
    offsets: Array,
    samples: RaySamples,
) -> tuple[Array, RaySamples, int, Array | None]:
    r"""Repeat solving and casting until no control point moves, the residuals grow, or the movement oscillates.

    Inside a boundary, single rays may alternate at its rim while the rest still converges: there, neither of the two
    ends the iterations. After ``FREE_ITERATIONS`` a ray that had no hit gets none any more.

    .. math::

        X \leftarrow X + \arg\min_{\delta X} \lVert N\, \delta X\, B^{T} - E(X) \rVert^2
    """
    best, least = (offsets, samples), rms_residual(samples.residuals)
    moves: list[float] = []
    bounded = samples.outside is not None
    for iterations in range(1, MAX_FIT_ITERATIONS + 1):  # noqa: B007
        step = basis.solve(samples.residuals, offsets)
        offsets = offsets + step
        before, samples = samples, rows.cast(basis.blend(offsets[..., None] * lines.directions))
        if bounded and iterations > FREE_ITERATIONS:
            samples = samples.without_new(before)
        misfit = rms_residual(samples.residuals)
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
    """Return the motion (k, l) [m] of the surface by a step of the offsets (n, m) [m] where rays hit; 0 elsewhere."""
    movement = np.linalg.norm(basis.blend(step[..., None] * lines.directions), axis=2)
    return np.where(np.isnan(samples.residuals), 0.0, movement)


def rms_residual(residuals: Array) -> float:
    """Return the root mean square of the residuals that are not NaN [m]."""
    return float(np.sqrt(np.nanmean(residuals**2)))


def check_coverage(mesh: TriangleMesh, lines: LineGrid, basis: TensorBasis, samples: RaySamples) -> None:
    """Check that each plane and line is near samples that hit the mesh, or that are outside the boundary."""
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
                (lines.u_names[i], lines.origins[i, 0]) if what == "u" else (lines.v_names[i], lines.origins[0, i])
            )
            raise EmptySection(
                f"{name}, through {millimetres(place)}, does not intersect the mesh. "
                + (
                    f"Move it, increase the margin, or choose another axis.{stray_part(mesh)}"
                    if lines.closed or coherent(mesh) is mesh
                    else FLIPPED_ADVICE
                ),
                plane=i,
                place=Place(point_of(place), name),
            )
    if samples.missing > MAX_MISSING_FRACTION:
        raise EmptySection(
            f"{samples.missing:.0%} of the sample rays do not hit the mesh. "
            "Move the axis or the planes, or use a grid over a sector or a face.",
            missing=samples.missing,
        )


def leave_one_out(fit: SurfaceFit) -> Array:
    """Return the error at each inner u-plane of a surface fitted without it, shape (n - 2,) [m].

    It is the mean distance from the section of the omitted plane to the surface of the others. It shows where the
    planes are too far apart, which the error of the fit itself cannot show. It is empty if the degree needs all planes.
    Of many planes, the surface has the ten on either side only, so that the time is proportional to their number.

    Parameters
    ----------
    fit : SurfaceFit
        The fit with all planes.
    """
    lines, degree = fit.lines, fit.surface.degree
    inner = range(1, len(lines.planes_u) - 1 if len(lines.planes_u) > degree[0] + 1 else 1)
    return np.array([_error_without(fit, i) for i in inner])


def _error_without(fit: SurfaceFit, i: int) -> float:
    lines, degree = fit.lines, fit.surface.degree
    near = np.arange(max(i - NEAR_PLANES, 0), min(i + NEAR_PLANES + 1, len(lines.planes_u)))
    kept = near[near != i]
    planes = Planes(lines.planes_u.points[kept], lines.planes_u.normals[kept])
    others = LineGrid(planes, lines.origins[kept], lines.directions[kept], lines.closed, lines.v_names)
    surface = fit_lines(fit.mesh, others, degree).surface
    at = greville(fit.surface.knots_u, degree[0])[i]  # an approximate parameter of the plane
    row = int(np.rint(at * (len(fit.residuals) - 1)))
    points = fit.points[row][~np.isnan(fit.residuals[row])]
    return float(footpoints(surface, points)[1].mean())
