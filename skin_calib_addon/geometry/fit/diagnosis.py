"""Warnings about a fit: what may be wrong, and where."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from ...common.arrays import Array, IntArray
from ...common.warnings import Place, Warning, point_of
from ..mesh.distance import closest
from ..mesh.triangle_mesh import TriangleMesh
from ..sampling.basis import TensorBasis
from ..sampling.curves import curves
from ..sampling.lines import LineGrid
from ..sampling.samples import RaySamples, SampleRows, flat_ends

# [1] smallest area element to the mean area element below which a surface nearly folds, or closes to a point. Larger:
# more warnings.
NEARLY_FOLDED_AREA = 0.02
# [1] the same ratio below which a surface is folded. Between both it may close to a point. Nearer to 0: rounding at
# the point counts as a fold.
FOLDED_AREA = -1e-3
# [m] distance of the surface from the mesh above which a fit is refused, unless the plan states another. Of 38 surfaces
# of real links that do not fold, the 37 that follow the mesh but for a step are up to 9.0 mm off, a wrong one 13.2 mm.
# Larger: wrong surfaces are allowed.
MAX_DEVIATION = 0.01
# [1] ratio of the distance above which there is a warning to this distance. 20 of these surfaces are up to 2.0 mm off:
# those of links without steps. Larger: fewer warnings.
WARNED_RATIO = 0.2
# [1] ratio of that distance to a tolerance of the mean distance. Good surfaces with 10 x 20 lines are 3 to 9 times the
# mean distance off. Larger: fewer warnings.
MEAN_TOLERANCE_RATIO = 10.0


@dataclass(frozen=True)
class DeviationLimits:
    """Distances of a surface from its mesh [m]: above the first there is a warning, above the second it is refused.

    Both are lengths that a skin tolerates, on links of any size.
    """

    warned: float = WARNED_RATIO * MAX_DEVIATION
    refused: float = MAX_DEVIATION

    @classmethod
    def of(cls, max_deviation: float, tolerance: float | None = None, measure: str = "max") -> "DeviationLimits":
        """Return the limits of a plan."""
        warned = WARNED_RATIO * max_deviation
        if tolerance is not None:
            warned = tolerance if measure == "max" else max(tolerance, min(MEAN_TOLERANCE_RATIO * tolerance, warned))
        return cls(warned, max(max_deviation, warned))


@dataclass(frozen=True, eq=False)
class DroppedCurves:
    """The curves in the sections of the rows that the surface does not follow, such as inner walls."""

    counts: IntArray  # (k,) of each row
    row: int  # of the longest
    length: float  # [m] of the longest; 0 without any
    point: Array  # (3,) on the longest [m]

    @classmethod
    def of(cls, rows: SampleRows, samples: RaySamples) -> "DroppedCurves":
        """Find them.

        A curve that no ray hits and that is shorter than the distance between two rays, as at the rim of a hole, is
        between them; it is not counted.
        """
        sections, faces = rows.sections, len(rows.mesh.faces)
        row, ends = sections.plane, flat_ends(sections, rows.planes, rows.axes)
        _, first, curve = np.unique(curves(ends, row), return_index=True, return_inverse=True)
        met = np.arange(sections.planes)[:, None] * faces + samples.faces
        hit = np.isin(row * faces + sections.face, met[~np.isnan(samples.residuals)])
        steps = np.median(np.linalg.norm(np.diff(samples.origins + samples.arms, axis=1), axis=2), axis=1)
        lengths = np.bincount(curve, np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1))
        lengths[(np.bincount(curve, hit) > 0) | (lengths < steps[row[first]])] = 0.0
        counts = np.bincount(row[first[lengths > 0]], minlength=sections.planes)
        at = first[lengths.argmax()]
        axes = rows.axes[row[at] if len(rows.axes) > 1 else 0]
        return cls(counts, int(row[at]), float(lengths.max()), rows.planes.points[row[at]] + ends[at, 0] @ axes)


def dropped_curve_warnings(u_names: tuple[str, ...], basis: TensorBasis, dropped: DroppedCurves) -> Iterator[Warning]:
    """Yield a warning if sections have curves that the surface does not follow."""
    if not dropped.length:
        return
    place = Place(point_of(dropped.point), u_names[int(np.argmax(basis.N[dropped.row]))])
    most = int(dropped.counts.max())
    yield Warning(
        "dropped-curves",
        "warning",
        f"Sections have up to {most} {'curve' if most == 1 else 'curves'} that the surface does not follow, such as "
        f"inner walls or bolts. The longest, {dropped.length * 1e3:.1f} mm long, is {place.words}.",
        place,
        dropped.length,
        "None needed if no skin covers them. Otherwise cut away what hides them, or move the axis.",
    )


def nearest_names(lines: LineGrid, basis: TensorBasis, site: tuple[int, int]) -> str:
    """Return the names of the u-plane and the v-line with the largest weight at a sample site."""
    i, j = int(np.argmax(basis.N[site[0]])), int(np.argmax(basis.M[site[1]]))
    return f"{lines.u_names[i]} and {lines.v_names[j]}"


def nearest_site(samples: RaySamples, uv: Array, closed: bool) -> tuple[int, int]:
    """Return row and column of the sample site nearest to parameters."""
    k, l = samples.residuals.shape
    return round(float(uv[0]) * (k - 1)), round(float(uv[1]) * l) % l if closed else round(float(uv[1]) * (l - 1))


def _percent(fraction: float) -> str:
    """Return a fraction above zero in percent; never "0.0%"."""
    return f"{fraction:.1%}" if fraction >= 1e-3 else "Less than 0.1%"


def off(distance: float, limit: float) -> str:
    """Return a distance [m] as "2.13 mm (limit 2 mm) off", with as many digits as show that it is above the limit."""
    digits = next((d for d in range(1, 6) if float(f"{distance * 1e3:.{d}f}") > limit * 1e3), 6)
    return f"{distance * 1e3:.{digits}f} mm (limit {limit * 1e3:.6g} mm) off"


def maximum_deviation(
    mesh: TriangleMesh, lines: LineGrid, basis: TensorBasis, samples: RaySamples, far_distance: float
) -> tuple[float, Place]:
    """Return the largest distance of a sample site's surface point from the mesh [m], and its place.

    The distance is measured to the plane of the facet that the ray hit. Above ``far_distance`` it is measured to the
    nearest facet, because a ray that just misses a rim hits a part behind it.
    """
    slope = np.abs((samples.rays * mesh.face_normals[samples.faces]).sum(axis=2))
    distance = np.abs(np.nan_to_num(samples.residuals)) * slope
    far = distance > far_distance
    if far.any():
        distance[far] = np.minimum(distance[far], closest(mesh, (samples.origins + samples.arms)[far])[0])
    at = largest_at(distance)
    return float(distance[at]), Place(point_of(samples.points[at]), nearest_names(lines, basis, at))


def largest_at(values: Array) -> tuple[int, int]:
    """Return the site of the largest of some values (k, l)."""
    i, j = np.unravel_index(np.argmax(values), values.shape)
    return int(i), int(j)


def missed_warnings(lines: LineGrid, basis: TensorBasis, samples: RaySamples) -> Iterator[Warning]:
    """Yield warnings where sample rays miss the mesh: in holes, and outside of its outline.

    Single rays pass small holes; next to hits the surface is no extrapolation.
    """
    past = samples.outside_outline(lines.closed)
    in_holes = samples.holes & ~past
    wide = in_holes & ~ndimage.binary_dilation(~np.isnan(samples.residuals))
    what = "mesh" if samples.outside is None else "cover inside the boundary"
    total = samples.missed.size if samples.outside is None else int((~samples.outside).sum())
    for missed, shown, code, rest, advice in (
        (in_holes, wide, "missing-samples", f"do not hit the {what}", "Close the hole, or keep the skin away from it."),
        (
            past,
            past,
            "outside-outline",
            "pass outside of the outline of the mesh",
            "Move the planes, or keep the skin away.",
        ),
    ):
        if shown.any():
            around = missed.mean(axis=1)[:, None] + missed.mean(axis=0)
            at = largest_at(np.where(shown, around, -1.0))
            place = Place(point_of(samples.origins[at] + samples.arms[at]), nearest_names(lines, basis, at))
            fraction = float(missed.sum() / total)
            message = f"{_percent(fraction)} of the sample rays {rest}, most of them {place.words}. "
            yield Warning(code, "warning", f"{message}The surface there is extrapolated.", place, fraction, advice)


def fit_warnings(
    mesh: TriangleMesh,
    lines: LineGrid,
    basis: TensorBasis,
    samples: RaySamples,
    smallest_area: float,
    smallest_at: Array,
    movement: Array | None,
    limits: DeviationLimits,
    worst: tuple[Array, Array, float] | None,
) -> Iterator[Warning]:
    """Yield the warnings that an author should check before trusting a fit."""
    yield from lines.warnings
    yield from missed_warnings(lines, basis, samples)
    if worst is None:
        distance, place = maximum_deviation(mesh, lines, basis, samples, limits.warned)
    else:
        uv, point, distance = worst
        place = Place(point_of(point), nearest_names(lines, basis, nearest_site(samples, uv, lines.closed)))
    if distance > limits.warned:
        yield Warning(
            "off-mesh",
            "warning",
            f"The surface is {off(distance, limits.warned)} the mesh {place.words}.",
            place,
            distance,
            "Cut away what protrudes there, move the planes away from it, or use more planes.",
        )
    if smallest_area < NEARLY_FOLDED_AREA:
        at = nearest_site(samples, smallest_at, lines.closed)
        place = Place(point_of(samples.origins[at] + samples.arms[at]), nearest_names(lines, basis, at))
        if smallest_area < FOLDED_AREA:
            yield Warning(
                "folded",
                "error",
                f"The surface folds over itself {place.words}, because planes cross each other inside the mesh, or the "
                "section changes abruptly from one plane to the next.",
                place,
                smallest_area,
                "Move or rotate the planes apart, cut away the step, or fit only a sector or one side of the link.",
            )
        else:
            yield Warning(
                "nearly-folded",
                "warning",
                f"The surface nearly folds or closes to a point {place.words}: "
                f"its smallest area element is {smallest_area:.1%} of the mean.",
                place,
                smallest_area,
                "Move planes apart, or increase the margin.",
            )
    if movement is not None:
        at = largest_at(movement)
        place = Place(point_of(samples.origins[at] + samples.arms[at]), nearest_names(lines, basis, at))
        moved = float(movement[at])
        yield Warning(
            "not-converged",
            "warning",
            f"The iterations of the fit did not converge: in the last one the surface moved by {moved * 1e3:.1f} mm "
            f"{place.words}. Rays alternate over a step of the mesh there, or the section is not star-shaped.",
            place,
            moved,
            "Keep the skin away from it, move the axis, or cut.",
        )
