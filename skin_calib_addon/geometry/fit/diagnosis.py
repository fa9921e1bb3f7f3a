"""Warnings about a fit: what may be wrong, and where."""

from collections.abc import Iterator

import numpy as np

from ...common.arrays import IntArray
from ...common.warnings import Place, Warning, point_of
from ..mesh.closest import MeshDistance
from ..mesh.triangle_mesh import TriangleMesh
from ..sampling.basis import TensorBasis
from ..sampling.curves import curves
from ..sampling.lines import LineGrid
from ..sampling.samples import RaySamples, SampleRows

# [1] smallest area element to the mean area element below which a surface nearly folds, or closes to a point. Larger:
# more warnings.
NEARLY_FOLDED_AREA = 0.02
# [fraction of the mesh size] distance of a sample from the surface above which there is a step, an opening or a part
# that the grid cannot follow. Larger: fewer warnings.
OFF_MESH_FRACTION = 0.02
# [1] condition number of the least squares above which planes are nearly redundant. Larger: fewer warnings.
MAX_CONDITION = 1e4


def condition(basis: TensorBasis) -> float:
    """Return the condition number of the least squares: the product of the condition numbers of its factors."""
    return float(np.linalg.cond(basis.N) * np.linalg.cond(basis.B))


def dropped_loops(rows: SampleRows, samples: RaySamples) -> IntArray:
    """Return the number of curves in each row's section that the surface does not follow, such as inner walls.

    Parameters
    ----------
    rows : SampleRows
        The sections.
    samples : RaySamples
        The hits of the rays on them.

    Returns
    -------
    array of int, shape (k,)
    """
    sections, faces = rows.sections, len(rows.mesh.faces)
    ends = rows.flat_ends()
    hit = np.zeros((sections.planes, faces), bool)
    np.put_along_axis(hit, samples.faces, ~np.isnan(samples.residuals), axis=1)
    bounds = np.searchsorted(sections.plane, np.arange(sections.planes + 1))
    dropped = np.zeros(sections.planes, np.int64)
    for i, (first, last) in enumerate(zip(bounds, bounds[1:])):
        if last > first:
            curve = curves(ends[first:last])
            dropped[i] = len(np.unique(curve)) - len(np.unique(curve[hit[i, sections.face[first:last]]]))
    return dropped


def nearest_names(lines: LineGrid, basis: TensorBasis, site: tuple[int, int]) -> str:
    """Return the names of the u-plane and the v-line with the largest weight at a sample site.

    Parameters
    ----------
    lines : LineGrid
        The lines of the control points.
    basis : TensorBasis
        The basis at the sample sites.
    site : (int, int)
        Row and column of the sample site.

    Returns
    -------
    str
    """
    i, j = int(np.argmax(basis.N[site[0]])), int(np.argmax(basis.M[site[1]]))
    return f"u-plane {i} and {lines.v_names[j]}"


def maximum_deviation(
    mesh: TriangleMesh, lines: LineGrid, basis: TensorBasis, samples: RaySamples
) -> tuple[float, Place]:
    """Return the largest distance of a sample site's surface point from the mesh [m], and its place.

    The distance is measured to the plane of the facet that the ray hit. Where that is far, it is measured to the
    nearest facet, because a ray that just misses a rim hits a part behind it.

    Parameters
    ----------
    mesh : TriangleMesh
        The mesh.
    lines : LineGrid
        The lines of the control points.
    basis : TensorBasis
        The basis at the sample sites.
    samples : RaySamples
        Of the last iteration.

    Returns
    -------
    distance : float
        [m]
    place : Place
        Point, u-plane and v-line.
    """
    slope = np.abs((samples.rays * mesh.face_normals[samples.faces]).sum(axis=2))
    distance = np.abs(np.nan_to_num(samples.residuals)) * slope
    far = distance > OFF_MESH_FRACTION * mesh.size
    if far.any():
        distance[far] = np.minimum(distance[far], MeshDistance(mesh)((samples.origins + samples.arms)[far])[0])
    site = np.unravel_index(np.argmax(distance), distance.shape)
    at = int(site[0]), int(site[1])
    return float(distance[at]), Place(point_of(samples.points[at]), nearest_names(lines, basis, at))


def fit_warnings(
    mesh: TriangleMesh, lines: LineGrid, basis: TensorBasis, samples: RaySamples, smallest_area: float, converged: bool
) -> Iterator[Warning]:
    """Yield the warnings that an author should check before trusting a fit.

    Parameters
    ----------
    mesh : TriangleMesh
        The mesh, [m] in the link frame.
    lines : LineGrid
        The lines of the control points.
    basis : TensorBasis
        The basis at the sample sites.
    samples : RaySamples
        Of the last iteration.
    smallest_area : float
        Smallest area element of the surface, seen along the rays, divided by its mean.
    converged : bool
        Whether the iterations converged.
    """
    yield from lines.warnings
    missed = np.isnan(samples.residuals)
    if missed.any():
        around = missed.mean(axis=1)[:, None] + missed.mean(axis=0)
        site = np.unravel_index(np.argmax(np.where(missed, around, -1.0)), missed.shape)
        at = int(site[0]), int(site[1])
        place = Place(point_of(samples.origins[at] + samples.arms[at]), nearest_names(lines, basis, at))
        yield Warning(
            "missing-samples",
            "warning",
            f"{missed.mean():.1%} of the sample rays do not hit the mesh, most of them {place.words}. "
            "The surface there is extrapolated.",
            place,
            float(missed.mean()),
            "Close the hole, or keep the skin away from it.",
        )
    distance, place = maximum_deviation(mesh, lines, basis, samples)
    if distance > OFF_MESH_FRACTION * mesh.size:
        yield Warning(
            "off-mesh",
            "warning",
            f"The surface is {distance * 1e3:.1f} mm off the mesh {place.words}.",
            place,
            distance,
            "Cut away what protrudes there, move the planes away from it, or use more planes.",
        )
    if smallest_area <= 0:
        yield Warning(
            "folded",
            "warning",
            "The surface folds over itself because planes cross each other inside the mesh.",
            value=smallest_area,
            advice="Move or rotate the planes apart.",
        )
    elif smallest_area < NEARLY_FOLDED_AREA:
        yield Warning(
            "nearly-folded",
            "warning",
            "The surface nearly folds or closes to a point: "
            f"its smallest area element is {smallest_area:.1%} of the mean.",
            value=smallest_area,
            advice="Move planes apart, or increase the margin.",
        )
    if not converged:
        yield Warning(
            "not-converged",
            "warning",
            "The iterations of the fit did not converge, because the section is not star-shaped about its axis.",
            advice="Move the axis, or cut.",
        )
    if (number := condition(basis)) > MAX_CONDITION:
        yield Warning(
            "ill-conditioned",
            "warning",
            f"The condition number of the least squares is {number:.0f}.",
            value=number,
            advice="Lower the degree, or remove a plane.",
        )
