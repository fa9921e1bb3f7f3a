"""What limits the error of a fit, for the message that a tolerance cannot be met."""

import numpy as np
from scipy.spatial import ConvexHull

from ...common.arrays import BoolArray
from ...common.errors import SkinCalibError
from ..grid.axis import Axis
from ..grid.grids import Region, Tube, TubeGrid
from ..mesh.triangle_mesh import TriangleMesh
from ..surface.distance import surface_samples
from .chords import facet_sagittas
from .diagnosis import FOLDED_AREA, maximum_deviation, nearest_names
from .fitting import fit_lines
from .surface_fit import SurfaceFit
from .undercut import undercuts

# [1] ratio of a distance to the sagitta of its facet up to which the facet explains it: a surface through the middle of
# the chords is up to one sagitta off, near a corner up to two. Larger: facets are named more often.
MAX_FACET_RATIO = 2.0
# [fraction of the area of the convex hull] that a surface along another axis covers. Larger: fewer axes are named.
MIN_HULL_FRACTION = 0.5
AXIS_NET = 10, 15  # [1] planes and lines along other axes. Larger: more axes are named, more time


def better_axis(fit: SurfaceFit, region: Region, measure: str, error: float) -> tuple[str, str] | None:
    """Return that another axis is better than the one that was found, if a small net along it proves this.

    The other axes are the principal axes of the mesh and of its normals. A surface along one of them is better if it
    covers most of the mesh, does not fold, and is nearer to the mesh.
    """
    if not isinstance(region, Tube) or region.axis is not None:
        return None
    least_area = MIN_HULL_FRACTION * ConvexHull(fit.mesh.vertices).area
    best: tuple[str, str] | None = None
    for axis in principal_axes(fit.mesh):
        try:
            lines = TubeGrid(*AXIS_NET, axis, region.margin).line_grid(fit.mesh, fit.surface.degree)
            other = fit_lines(fit.mesh, lines, fit.surface.degree)
        except SkinCalibError:
            continue
        least = getattr(other.to_mesh, measure)
        if least < error and other.smallest_area >= FOLDED_AREA and area(other) > least_area:
            error = least
            point, direction = (
                ", ".join(f"{x:g}" for x in values) for values in (np.multiply(axis.point, 1e3) + 0.0, axis.direction)
            )
            best = (
                "because the axis that was found is wrong",
                f"give the axis: through ({point}) mm along ({direction}), a net of {AXIS_NET[0]} x {AXIS_NET[1]} is "
                f"within about {least * 1e3:.2g} mm",
            )
    return best


def principal_axes(mesh: TriangleMesh) -> list[Axis]:
    """Return lines through the centroid of a mesh along the principal axes of its surface and of its normals.

    They are rounded to 0.1 mm and three digits, because a message has them.
    """
    areas, centres = mesh.face_areas, mesh.triangles.mean(axis=1)
    centroid = areas @ centres / areas.sum()
    directions = [
        np.linalg.eigh(np.einsum("f,fi,fj->ij", areas, x, x))[1].T for x in (centres - centroid, mesh.face_normals)
    ]
    point = tuple((np.round(centroid, 4) + 0.0).tolist())
    return [Axis(point, tuple((np.round(d, 3) + 0.0).tolist())) for d in np.concatenate(directions)]


def area(fit: SurfaceFit) -> float:
    """Return the area of a surface [m^2]."""
    return float(surface_samples(fit.surface)[1].sum())


def limit_of(fit: SurfaceFit, error: float, measure: str = "mean") -> tuple[str, str]:
    """Return why a surface is not nearer to the mesh, and what to do.

    Each sample site has one cause. For the mean, the one with the largest sum of distances counts; for the largest
    distance, that of its site.
    """
    lines, basis, samples = fit.lines, fit.basis, fit.samples
    slope = np.abs((samples.rays * fit.mesh.face_normals[samples.faces]).sum(axis=2))
    distance = np.abs(np.nan_to_num(samples.residuals)) * slope
    folds = undercuts(fit.mesh, lines, basis, samples, fit.surface)
    is_undercut, is_part = np.zeros((2, len(distance), 1), bool)
    is_undercut[[row for row, (depth, _) in folds.items() if depth > error]] = True
    is_part[samples.parts] = True
    is_facet = distance <= MAX_FACET_RATIO * facet_sagittas(fit.mesh)[samples.faces]
    causes = {
        "facets": is_facet,
        "undercut": ~is_facet & is_undercut,
        "parts": ~is_facet & ~is_undercut & is_part,
        "steps": ~is_facet & ~is_undercut & ~is_part,
    }

    def size(sites: BoolArray) -> float:
        found = np.where(sites, distance, 0.0)
        return float(found.sum() if measure == "mean" else found.max())

    cause = max(causes, key=lambda cause: size(causes[cause]))
    if cause == "facets":
        return "because the mesh is faceted", "refine the mesh"
    if cause == "undercut":
        _, place = max(folds.values(), key=lambda found: found[0])
        return (
            f"because the section folds back behind itself {place.words}",
            "cut the undercut away, or move the axis so that each ray meets the section once",
        )
    if cause == "parts":
        row = int(np.argmax(np.where(causes["parts"], distance, 0.0).sum(axis=1)))
        name = nearest_names(lines, basis, (row, 0)).split(" and ")[0]
        return (
            f"because the outside of the sections consists of several parts, as near {name}",
            "cut away the parts without skin",
        )
    _, place = maximum_deviation(fit.mesh, lines, basis, samples, error)
    return f"because the mesh has steps or edges, the largest {place.words}", "cut them away"
