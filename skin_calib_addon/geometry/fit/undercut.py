r"""Undercuts: parts of a section that no surface with lines from one axis can follow.

The control points of a section row are at increasing angles about the axis. With B-spline basis functions, two of them
:math:`i < j` have :math:`N_i N_j' - N_i' N_j \ge 0`, so that the angle of the surface never decreases along the row. A
section that folds back behind itself, as seen from the axis, therefore stays off the surface with any number of lines.
"""

from collections.abc import Iterator

import numpy as np

from ...common.warnings import Place, Warning, point_of
from ..mesh.triangle_mesh import TriangleMesh
from ..sampling.basis import TensorBasis
from ..sampling.lines import LineGrid
from ..sampling.samples import RaySamples, SampleRows
from ..surface.bspline import BSplineSurface
from ..surface.footpoints import footpoints
from .diagnosis import nearest_names
from .error_report import MIN_COVER_COSINE

# [m] distance of an undercut from the surface above which there is a warning. Larger: fewer warnings.
UNDERCUT_DISTANCE = 2e-4


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
    l = samples.residuals.shape[1]
    for i in np.flatnonzero(samples.folds):
        axes, origin = rows.axes[i if len(rows.axes) > 1 else 0], rows.planes.points[i]
        segments = rows.caster.folded_segments(int(i)) @ axes
        middles, sides = origin + segments.mean(axis=1), segments[:, 1] - segments[:, 0]
        uv, distances = footpoints(surface, middles)
        along = surface.derivatives(uv)[0, 1]
        lengths = np.linalg.norm(along, axis=1) * np.linalg.norm(sides, axis=1)
        distances[np.abs((along * sides).sum(axis=1)) <= MIN_COVER_COSINE * lengths] = 0.0  # a wall, as at a rim
        if not lines.closed:
            distances[(uv[:, 1] == 0) | (uv[:, 1] == 1)] = 0.0
        if lines.region is not None:
            distances[~lines.region(middles)] = 0.0
        if distances.any():
            farthest = int(distances.argmax())
            column = round(float(uv[farthest, 1]) * (l if lines.closed else l - 1)) % l
            names = nearest_names(lines, basis, (int(i), column))
            found[int(i)] = float(distances[farthest]), Place(point_of(middles[farthest]), names)
    return found
