"""What may be wrong with a fit, and where: what an author should look at before trusting it."""

import numpy as np

from ...common.arrays import IntArray
from ...common.errors import millimetres
from ..mesh.triangle_mesh import TriangleMesh
from ..sampling.basis import TensorBasis
from ..sampling.curves import curves
from ..sampling.lines import LineGrid
from ..sampling.samples import RaySamples, SampleRows
from ..surface.distance import MeshDistance

# A surface whose area element falls below this share of its mean nearly folds, or closes to a point.
NARROW = 0.02
# A sample further off than this share of the mesh's size is a step, an opening or a part that the grid cannot follow.
FAR = 0.02
# Least squares worse conditioned than this have planes that say nearly the same.
ILL = 1e4


def condition(basis: TensorBasis) -> float:
    """Condition number of the least squares: that of a product of factors is the product of theirs."""
    return float(np.linalg.cond(basis.N) * np.linalg.cond(basis.B))


def dropped_loops(rows: SampleRows, samples: RaySamples) -> IntArray:
    """How many curves of each row's section the surface does not follow, shape (k,): inner walls, bolts, boxes."""
    sections, faces = rows.sections, len(rows.mesh.faces)
    ends = rows.flat_ends()
    met = np.zeros((sections.planes, faces), bool)
    np.put_along_axis(met, samples.faces, ~np.isnan(samples.residuals), axis=1)
    bounds = np.searchsorted(sections.plane, np.arange(sections.planes + 1))
    dropped = np.zeros(sections.planes, np.int64)
    for i, (first, last) in enumerate(zip(bounds, bounds[1:])):
        if last > first:
            curve = curves(ends[first:last])
            dropped[i] = len(np.unique(curve)) - len(np.unique(curve[met[i, sections.face[first:last]]]))
    return dropped


def nearest_names(lines: LineGrid, basis: TensorBasis, site: tuple[int, int]) -> str:
    """The u-plane and the v-line that count most at a sample site, as an author knows them."""
    i, j = int(np.argmax(basis.N[site[0]])), int(np.argmax(basis.M[site[1]]))
    return f"u-plane {i} and {lines.v_names[j]}"


def furthest(mesh: TriangleMesh, lines: LineGrid, basis: TensorBasis, samples: RaySamples) -> tuple[float, str]:
    """Largest distance of a sample site's surface point from the mesh [m], and where it is.

    To the plane of the facet that its ray met; where that is far, to the nearest facet: a ray that just misses a rim
    meets what lies behind it.
    """
    slope = np.abs((samples.rays * mesh.face_normals[samples.faces]).sum(axis=2))
    distance = np.abs(np.nan_to_num(samples.residuals)) * slope
    far = distance > FAR * mesh.size
    if far.any():
        distance[far] = np.minimum(distance[far], MeshDistance(mesh)((samples.origins + samples.arms)[far])[0])
    site = np.unravel_index(np.argmax(distance), distance.shape)
    at = int(site[0]), int(site[1])
    return float(distance[at]), f"at {millimetres(samples.points[at])}, near {nearest_names(lines, basis, at)}"


def doubts(
    mesh: TriangleMesh, lines: LineGrid, basis: TensorBasis, samples: RaySamples, smallest_area: float, settled: bool
) -> tuple[str, ...]:
    """One line for everything that an author should look at: what, where, and what to do.

    Parameters
    ----------
    smallest_area : float
        Least area element of the surface, seen along the rays, over its mean.
    settled : bool
        Whether the passes came to rest.
    """
    found = list(lines.doubts)
    missed = np.isnan(samples.residuals)
    if missed.any():
        around = missed.mean(axis=1)[:, None] + missed.mean(axis=0)
        site = np.unravel_index(np.argmax(np.where(missed, around, -1.0)), missed.shape)
        at = int(site[0]), int(site[1])
        place = millimetres(samples.origins[at] + samples.arms[at])
        found.append(
            f"{missed.mean():.1%} of the sample rays meet no mesh, most about {place}, near "
            f"{nearest_names(lines, basis, at)}: the surface there is a guess; close the hole, or keep the skin off it"
        )
    distance, where = furthest(mesh, lines, basis, samples)
    if distance > FAR * mesh.size:
        found.append(
            f"the surface is {distance * 1e3:.1f} mm off the mesh {where}; cut away what stands out there, move the "
            "planes away from it, or place more of them"
        )
    if smallest_area <= 0:
        found.append("the surface folds over: planes cross each other inside the mesh; move or turn them apart")
    elif smallest_area < NARROW:
        found.append("the surface nearly folds or closes to a point; move planes apart, or widen the margin")
    if not settled:
        found.append("the passes did not come to rest: the section is no fan about its axis; move the axis, or cut")
    if condition(basis) > ILL:
        found.append(
            f"the least squares have the condition {condition(basis):.0f}; lower the degree or take a plane away"
        )
    return tuple(found)
