"""Inner parts of a mesh, which its cover leaves out, that stick out of the surface nevertheless."""

from collections.abc import Callable, Iterator

import numpy as np

from ...common.arrays import Array, BoolArray, distinct, norms
from ...common.warnings import Place, Warning, point_of
from ..mesh.distance import dots
from ..mesh.face_points import points_at, points_by_area
from ..mesh.shells import shells
from ..mesh.triangle_mesh import TriangleMesh
from ..surface.bspline import BSplineSurface
from ..surface.footpoints import near_footpoints
from .error_report import MESH_POINTS

# [cosine] between the normal of the surface and the direction to a point above which the point is over the surface, not
# next to its edge. Larger: less counts.
OVER_COSINE = 0.9


def inner_part_warnings(
    inner: TriangleMesh, surface: BSplineSurface, is_trusted: Callable[[Array], BoolArray], limit: float
) -> Iterator[Warning]:
    """Yield a warning if inner parts are more than ``limit`` [m] over a surface where it follows the mesh."""

    def heights(points: Array) -> Array:
        uv, _, normals = near_footpoints(surface, points)
        offsets = points - surface.points(uv)
        along = dots(offsets, normals)
        over = (along > limit) & (along > OVER_COSINE * norms(offsets))
        over[over] = is_trusted(uv[over])
        return np.where(over, along, 0.0)

    used, part = distinct(inner.faces), shells(inner)
    height = np.zeros(len(inner.vertices))
    height[used] = heights(inner.vertices[used])
    of_over = np.unique(part[(height[inner.faces] > 0).any(axis=1)])
    if not len(of_over):
        return
    top, count = int(height.argmax()), len(of_over)
    parts = TriangleMesh(inner.vertices, inner.faces[np.isin(part, of_over)])
    points = points_at(parts, *points_by_area(parts, MESH_POINTS))
    area = (heights(points) > 0).mean() * parts.face_areas.sum()
    place, what = Place(point_of(inner.vertices[top])), "1 inner part" if count == 1 else f"{count} inner parts"
    yield Warning(
        "inner-part",
        "warning",
        f"The cover leaves out {what} of the mesh, but {area * 1e4:.2g} cm^2 of {'it' if count == 1 else 'them'} "
        f"can be met from outside: up to {height[top] * 1e3:.1f} mm over the surface, {place.words}.",
        place,
        float(height[top]),
        "Keep what is seen instead of the outer shells, or keep the skin away from there.",
    )
