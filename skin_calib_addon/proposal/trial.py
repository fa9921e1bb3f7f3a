"""Try a region on a link: fit a surface to what is wanted there, and judge each site."""

from dataclasses import dataclass, replace

import numpy as np
from scipy import ndimage

from ..common.arrays import Array, BoolArray, unit
from ..common.errors import SkinCalibError
from ..geometry.grid.grids import Across, Region
from ..geometry.grid.parametrizations import (
    Parametrization,
    TubeParametrization,
    parametrized_lines,
)
from ..geometry.mesh.triangle_mesh import TriangleMesh
from ..geometry.sampling.basis import TensorBasis
from ..geometry.sampling.frames import TubeFrame, frame_of
from ..geometry.sampling.lines import LineGrid
from ..geometry.sampling.samples import RaySamples, SampleRows
from ..skin.boards.ground import MAX_ANGLE, MAX_DISTANCE
from .candidates import MIN_RAY_COSINE
from .link_points import LinkPoints

# [m] of planes and lines. Larger: smoother surfaces that follow less of the link (16 mm: 5551 instead of 5763 cm^2 on
# the G1; 8 mm: as much as 12 mm, in 1.2 times the time).
KNOT_DISTANCE = 0.012
# [m] radius of a disc that the parts of a region must contain everywhere, while regions are compared. Larger: no
# surfaces on narrow parts (half: 6020 instead of 5952 cm^2 on the G1, with less cells: 3779 instead of 3804 cm^2).
OPENING = 0.005
# [1] ratio of the steps from a site to its neighbours above which only the shorter one is on the part that a surface
# covers; next to it the surface may be anywhere. Larger: wrong areas at edges of parts; smaller: areas of uneven sites
# are too small.
MAX_STEP_RATIO = 3.0


@dataclass(frozen=True, eq=False)
class Trial:
    """A surface over a region, and which of its sites cover the link."""

    parametrization: Parametrization
    lines: LineGrid
    offsets: Array  # (n, m) of the control points [m]
    points: Array  # (k, l, 3) of the surface at the sites [m]
    good: BoolArray  # (k, l) sites of the best part
    area: float  # of these sites [m^2]
    steps: Array  # (2,) of the mesh, from row to row and from column to column of the sites [m]


def region_size(parametrization: Parametrization, on: LinkPoints) -> tuple[int, int]:
    """Return the numbers of planes and lines that are ``KNOT_DISTANCE`` apart, over a region."""
    breadth = float(np.ptp(parametrization.breadth))
    if isinstance(parametrization, TubeParametrization):
        assert isinstance(parametrization.frame, TubeFrame)
        across = parametrization.frame.across(on.points - parametrization.frame.point)
        breadth *= float(np.median(np.hypot(*across.T)))
    n = int(np.ceil(float(np.ptp(parametrization.span)) / KNOT_DISTANCE)) + 3
    m = int(np.ceil(breadth / KNOT_DISTANCE))
    return n, max(8, m) if parametrization.closed else m + 3


def whole(region: Region, mesh: TriangleMesh) -> Parametrization:
    """Return the whole of a region on a mesh, without margin."""
    if isinstance(region, Across):
        return replace(region, margin=0.0).parametrization(mesh)
    assert region.axis is not None
    frame = frame_of(np.array(region.axis.point), np.array(region.axis.direction))
    return TubeParametrization(frame, frame.extent(mesh.vertices))


def even_lines(parametrization: Parametrization, n: int, m: int) -> LineGrid:
    """Return ``n`` planes with ``m`` lines at equal steps over a region."""
    first, last = parametrization.breadth
    t = first + (last - first) * np.arange(m) / (m if parametrization.closed else m - 1)
    return parametrized_lines(parametrization, np.linspace(*parametrization.span, n), t)


@dataclass(frozen=True, eq=False)
class Start:
    """The sections of a link over a region, and the first rays; they are the same for all trials."""

    parametrization: Parametrization
    lines: LineGrid
    basis: TensorBasis
    rows: SampleRows
    offsets: Array  # (n, m) [m]
    samples: RaySamples

    @classmethod
    def of(cls, mesh: TriangleMesh, on: LinkPoints, region: Region, is_shared: bool = True) -> "Start | None":
        """Return the start of the trials of a region; None if it is not on the mesh."""
        try:
            parametrization = whole(region, mesh)
            lines = even_lines(parametrization, *region_size(parametrization, on))
            basis = TensorBasis.of(lines, 3, 3)
            rows = SampleRows.of(mesh, lines, basis)
        except SkinCalibError:
            return None
        if not is_shared:
            rows = rows.on_cut_faces()
        offsets = np.full(lines.origins.shape[:2], 0.5 * mesh.size)
        samples = rows.cast(basis.blend(offsets[..., None] * lines.directions))
        return cls(parametrization, lines, basis, rows, offsets, samples)

    def trial(self, on: LinkPoints) -> Trial | None:
        """Fit a surface to the wanted points of a link; None if it covers nothing.

        Each fit leaves out the samples that are far from the surface before, so that steps do not pull it, and those
        where it is not along the mesh, so that rounded edges do not bend it.
        """
        basis, samples, closed = self.basis, self.samples, self.parametrization.closed
        faces = self.rows.mesh.face_normals[samples.faces]
        slopes = np.abs((samples.rays * faces).sum(axis=2))
        wanted = is_wanted(on, samples, faces) & (slopes > MIN_RAY_COSINE)
        wanted = opened(wanted, samples.points, closed)
        if not wanted.any():
            return None
        offsets = self.offsets + basis.solve(np.where(wanted, samples.residuals, np.nan), self.offsets)
        for limit in (2 * MAX_DISTANCE, MAX_DISTANCE):
            arms = basis.blend(offsets[..., None] * self.lines.directions)
            samples = self.rows.cast(arms)
            used = wanted & (np.abs(samples.residuals * slopes) < limit)
            vectors = area_vectors(samples.origins + arms, closed)
            used &= are_along(vectors, self.rows.mesh.face_normals[samples.faces])
            if not used.any():
                return None
            offsets = offsets + basis.solve(np.where(used, samples.residuals, np.nan), offsets)
        return judged(self.rows, on, self.parametrization, self.lines, offsets, basis)


def is_wanted(on: LinkPoints, samples: RaySamples, faces: Array) -> BoolArray:
    """Return which rays leave the link where skin is wanted, shape (k, l)."""
    hit = ~np.isnan(samples.residuals)
    wanted = np.zeros(hit.shape, bool)
    if hit.any():
        normals = faces[hit] * np.sign((samples.rays * faces).sum(axis=2))[hit][:, None]
        wanted[hit] = on.are_near(on.wanted, samples.points[hit], normals)
    return wanted


def judged(
    rows: SampleRows,
    on: LinkPoints,
    parametrization: Parametrization,
    lines: LineGrid,
    offsets: Array,
    basis: TensorBasis,
    opening: float = OPENING,
) -> Trial | None:
    """Return the largest part of a surface that covers what is wanted; None if there is none."""
    arms = basis.blend(offsets[..., None] * lines.directions)
    samples = rows.cast(arms)
    faces = rows.mesh.face_normals[samples.faces]
    points = samples.origins + arms
    vectors = area_vectors(points, parametrization.closed)
    areas = np.linalg.norm(vectors, axis=2)
    areas[[0, -1]] /= 2  # sites at the edges stand for half a cell
    if not parametrization.closed:
        areas[:, [0, -1]] /= 2
    good = is_wanted(on, samples, faces)
    good &= np.abs(samples.residuals * (samples.rays * faces).sum(axis=2)) < MAX_DISTANCE
    good &= are_along(vectors, faces)
    part = largest_part(opened(good, samples.points, parametrization.closed, opening), areas, parametrization.closed)
    if part is None:
        return None
    steps = site_steps(samples.points)
    return Trial(parametrization, lines, offsets, points, part, float(areas[part].sum()), steps)


def opened(mask: BoolArray, points: Array, closed: bool, radius: float = OPENING) -> BoolArray:
    """Return a mask of sites without its narrow parts (morphological opening with a disc)."""
    steps = np.clip(site_steps(points), radius / max(mask.shape), None)
    a, b = (radius / steps).astype(int)
    y, x = np.mgrid[-a : a + 1, -b : b + 1]
    disc = (y * steps[0]) ** 2 + (x * steps[1]) ** 2 <= radius**2
    extra = 2 * b if closed else 0
    wide = np.pad(mask, ((0, 0), (extra, extra)), mode="wrap")
    result: BoolArray = ndimage.binary_opening(wide, disc)[:, extra : extra + mask.shape[1]]
    return result


def area_vectors(points: Array, closed: bool) -> Array:
    """Return normals (k, l, 3) of a surface at the sites, as long as the area [m^2] that each site stands for."""
    return np.cross(steps_on(points, 0), steps_on(points, 1, closed))


def are_along(vectors: Array, faces: Array) -> BoolArray:
    """Return at which sites a surface is within ``MAX_ANGLE`` of the faces, shape (k, l)."""
    along: BoolArray = np.abs((unit(vectors) * faces).sum(axis=2)) > np.cos(MAX_ANGLE)
    return along


def steps_on(points: Array, axis: int, closed: bool = False) -> Array:
    """Return the mean of the steps from the site before and to the next one, shape (k, l, 3) [m].

    If one of them is more than ``MAX_STEP_RATIO`` times as long, its other end is not on the same part of the mesh: the
    shorter one counts alone.
    """
    steps = np.diff(points, axis=axis)
    first, last = (np.take(steps, [k], axis=axis) for k in (0, -1))
    if closed:
        first = last = np.take(points, [0], axis=axis) - np.take(points, [-1], axis=axis)
    both = np.stack((np.concatenate((first, steps), axis=axis), np.concatenate((steps, last), axis=axis)))
    lengths = np.linalg.norm(both, axis=3)
    alone = lengths > MAX_STEP_RATIO * lengths[::-1]
    return np.where(alone[0, ..., None], both[1], np.where(alone[1, ..., None], both[0], both.mean(axis=0)))


def site_steps(points: Array) -> Array:
    """Return the usual distances of points (k, l, 3) from row to row and from column to column, shape (2,) [m].

    Points that are NaN do not count; without two adjacent ones the distance is zero.
    """
    lengths = [np.linalg.norm(np.diff(points, axis=axis), axis=2) for axis in (0, 1)]
    return np.array([np.median(known) if (known := a[~np.isnan(a)]).size else 0.0 for a in lengths])


def largest_part(mask: BoolArray, areas: Array, closed: bool) -> BoolArray | None:
    """Return the connected part of a mask with the largest area; None if the mask is empty."""
    label, count = ndimage.label(mask)
    if count == 0:
        return None
    for first, last in zip(label[:, 0], label[:, -1]) if closed else ():
        if first and last and first != last:
            label[label == last] = first
    sums = np.bincount(label.ravel(), areas.ravel())
    sums[0] = 0.0
    return np.asarray(label == sums.argmax())
