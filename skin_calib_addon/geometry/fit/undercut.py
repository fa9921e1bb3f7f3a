r"""Undercuts: parts of a section that no surface with lines from one axis can follow.

The control points of a section row are at increasing angles about the axis. With B-spline basis functions, two of them
:math:`i < j` have :math:`N_i N_j' - N_i' N_j \ge 0`, so that the angle of the surface never decreases along the row. A
section that folds back behind itself, as seen from the axis, therefore stays off the surface with any number of lines.
"""

from collections.abc import Iterator
from functools import partial

import numpy as np
from scipy.spatial import cKDTree

from ...common.arrays import Array, IntArray
from ...common.warnings import Place, Warning, point_of
from ..mesh.triangle_mesh import TriangleMesh
from ..sampling.basis import TensorBasis
from ..sampling.lines import LineGrid
from ..sampling.samples import RaySamples, SampleRows, across
from ..surface.bspline import BSplineSurface
from ..surface.footpoints import footpoints
from .diagnosis import nearest_names
from .error_report import MIN_COVER_COSINE, largest_of

# [m] distance of an undercut from the surface above which there is a warning. Larger: fewer warnings.
UNDERCUT_DISTANCE = 2e-4
# [1] points of a row of the surface per sample site. Larger: sharper bounds of the distances, more time for the curve.
POINTS_PER_SITE = 8


def undercut_warnings(
    mesh: TriangleMesh, lines: LineGrid, basis: TensorBasis, samples: RaySamples, surface: BSplineSurface
) -> Iterator[Warning]:
    """Yield a warning where a section folds back behind itself, and the surface is far from this part."""
    found = undercuts(mesh, lines, basis, samples, surface)
    distance, place = max(found.values(), key=lambda found: found[0], default=(0.0, Place()))
    if distance > UNDERCUT_DISTANCE:
        yield Warning(
            "undercut",
            "warning",
            f"The section folds back behind itself {place.words}. "
            "Parallel lines, or lines from one axis, cannot follow it. "
            f"The folded part is {distance * 1e3:.2f} mm from the surface.",
            place,
            distance,
            "Move the axis so that each ray from it meets the section once, place the planes across the undercut, or "
            "cut it away. More lines do not help.",
        )


def undercuts(
    mesh: TriangleMesh, lines: LineGrid, basis: TensorBasis, samples: RaySamples, surface: BSplineSurface
) -> dict[int, tuple[float, Place]]:
    """Return the largest distance of a folded part from the surface, for the rows whose section folds back."""
    found: dict[int, tuple[float, Place]] = {}
    if not samples.folds.any():
        return found
    rows = SampleRows.of(mesh, lines, basis)
    k, l = samples.residuals.shape
    count = POINTS_PER_SITE * l
    v = np.arange(count) / count if lines.closed else np.linspace(0, 1, count)
    for i in np.flatnonzero(samples.folds):
        axes, origin = rows.axes[i if len(rows.axes) > 1 else 0], rows.planes.points[i]
        points = surface.grid_points(np.array([i / (k - 1)]), v)[0] - origin
        segments = rows.caster.folded_segments(int(i))
        if len(segments) == 0:
            continue
        section, curve = segments.mean(axis=1), across(points[None], axes[None])[0]
        bounds, nearest = distances_to_curve(section, curve, lines.closed)
        along = (np.roll(curve, -1, axis=0) - np.roll(curve, 1, axis=0))[nearest]
        sides = segments[:, 1] - segments[:, 0]
        lengths = np.linalg.norm(along, axis=1) * np.linalg.norm(sides, axis=1)
        bounds[np.abs((along * sides).sum(axis=1)) <= MIN_COVER_COSINE * lengths] = 0.0  # a wall, as at a rim
        in_link = origin + section @ axes
        if lines.region is not None:
            bounds[~lines.region(in_link)] = 0.0
        folded = np.flatnonzero(bounds)
        if len(folded) == 0:
            continue
        # Another row of the surface can be nearer than the curve in the plane of the section.
        distance, worst = largest_of(bounds[folded], partial(_distances, surface, in_link[folded]))
        column = int(v[nearest[folded[worst]]] * (l if lines.closed else l - 1) + 0.5) % l
        names = nearest_names(lines, basis, (int(i), column))
        found[int(i)] = distance, Place(point_of(in_link[folded[worst]]), names)
    return found


def _distances(surface: BSplineSurface, points: Array, chosen: IntArray) -> Array:
    """Return the distances (i,) of some of the points (k, 3) from the surface [m]."""
    return footpoints(surface, points[chosen])[1]


def distances_to_curve(points: Array, curve: Array, closed: bool) -> tuple[Array, IntArray]:
    """Return the distances of points to a chain of segments, and the nearest corner of each."""
    nearest = np.asarray(cKDTree(curve).query(points)[1])
    distance = np.full(len(points), np.inf)
    for step in (-1, 0):
        start, stop = curve[(nearest + step) % len(curve)], curve[(nearest + step + 1) % len(curve)]
        side = stop - start
        part = ((points - start) * side).sum(axis=1) / np.maximum((side**2).sum(axis=1), 1e-300)
        foot = start + np.clip(part, 0, 1)[:, None] * side
        distance = np.minimum(distance, np.linalg.norm(points - foot, axis=1))
    if not closed:
        distance[(nearest == 0) | (nearest == len(curve) - 1)] = 0.0
    return distance, nearest
