"""Find the surfaces that cover most of a link."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from ..common.arrays import Array, BoolArray, pairs_of, unit
from ..common.errors import SkinCalibError
from ..common.warnings import point_of
from ..geometry.fit.auto import fit_grid
from ..geometry.fit.surface_fit import SurfaceFit
from ..geometry.grid.axis import Axis
from ..geometry.grid.grids import Across, Grid, Region, Sector, Size, axis_along, sector_frame
from ..geometry.grid.parametrizations import FaceParametrization
from ..geometry.mesh.triangle_mesh import TriangleMesh
from ..geometry.sampling.basis import SITES_PER_SPAN, TensorBasis
from ..geometry.sampling.rays import TURN
from ..geometry.sampling.samples import SampleRows
from ..geometry.surface.bspline import BSplineSurface
from ..pipeline.calibrate import refuse_errors
from ..plan.plan import Surface
from ..skin.boards.ground import MAX_ANGLE, MAX_DISTANCE
from .candidates import DECIMALS, Candidate, candidates, flat_faces, round_ends
from .link_points import POINT_DISTANCE, LinkPoints
from .loops import Loops, loops_around
from .trial import Start, Trial, judged, region_size

# [m^2] that a surface adds. Larger: fewer surfaces, less is covered, less time (4 cm^2: 5958 cm^2 with 101 surfaces,
# 7 cm^2: 5858 with 85, instead of 5952 with 100 on the G1, before ``BOUNDARY_OPENING``).
MIN_AREA = 5e-4
# [boards] that a link must have space for, and a surface for small boards. Larger: more fingers stay without skin.
MIN_CELLS = 6
# [m^2] free area of a link up to which its round ends, such as fingertips, have surfaces of their own: a tube cannot
# cover them. Larger: more links, with more and smaller surfaces.
MAX_FINGER_AREA = 100e-4
# [m^2] of a flat face, such as a sole, that has a surface of its own. Larger: tubes take strips of more of them.
MIN_FLAT_AREA = 50e-4
# [fraction] of the free area of a link that each surface after the first adds. Larger: fewer surfaces on large links,
# above 0.25 m^2. Without it the torso of a Baxter, 1.2 m^2, has more than 120 of them.
MIN_FRACTION = 2e-3
# [m] distance of the sites that give the boundary. Larger: less exact boundaries (double: 47 instead of 55 boards on
# four links of the G1; half: 53, 1.4 times the time).
FINE_STEP = 2e-3
# [m] radius of a disc that the part inside a boundary contains everywhere. Larger: narrow parts next to wide ones have
# no surface (double: 5952 instead of 6053 cm^2 on the G1, and 12586 instead of 13002 cm^2 on the JVRC-1).
BOUNDARY_OPENING = 2.5e-3
# [m] distance of the boundary from the edges of these sites. Larger: fewer corners, less exact boundaries (double: 3703
# instead of 3765 cm^2 of cells on the G1).
LOOP_TOLERANCE = 1e-3
# [rad] beyond the boundary. Larger: the surface is held less at the boundary (double: 50 instead of 55 boards on four
# links of the G1).
SECTOR_MARGIN = np.deg2rad(3.0)
# [fraction] of the area inside the boundary that the fitted surface must cover. Larger: fewer surfaces.
MIN_KEPT_FRACTION = 0.75


@dataclass(frozen=True, eq=False)
class Proposed:
    """A surface for a plan, its fit, and why it was chosen."""

    surface: Surface
    fit: SurfaceFit
    area: float  # that skins on it cover, and those on no surface before it [m^2]
    covered: BoolArray  # (k,) free points of the link that skins on it cover
    reason: str


def propose_surfaces(
    seen: TriangleMesh,
    on: LinkPoints,
    axes: Iterable[tuple[Axis, str]] = (),
    begin: Callable[[str], None] = lambda stage: None,
    cell: float = MIN_AREA,
) -> tuple[Proposed, ...]:
    """Return surfaces that cover most of what is free on a link; ``on.covered`` has what they cover.

    ``cell`` is the area of a cell of the skin [m^2].
    """
    if not on.wanted.any():
        return ()
    least = least_area(cell)
    found = on_faces(seen, on, flat_faces(on, MIN_FLAT_AREA), MIN_FLAT_AREA, begin)
    if on.areas[on.wanted].sum() <= MAX_FINGER_AREA:
        found += on_faces(seen, on, round_ends(on), least, begin, len(found))
    pool = [Tried(c, c.bound(on)) for c in candidates(on, axes, least)] if on.wanted.any() else []
    more = max(least, MIN_FRACTION * float(on.areas[on.wanted].sum()))
    while True:  # each surface adds an area
        begin(stage(on, len(found) + 1))
        best = best_of(pool, seen, on, more if found else least)
        if best is None:
            return tuple(found)
        candidate, trial = best
        proposed = boundary_of(candidate.mesh(seen), on, candidate, trial, len(found) + 1, least)
        if proposed is None:
            pool = [tried for tried in pool if tried.candidate is not candidate]
        else:
            found.append(proposed)


def stage(on: LinkPoints, number: int) -> str:
    """Return what is computed now: a surface, and how much the surfaces before it cover."""
    part = on.areas[on.covered].sum() / on.areas[on.free].sum()
    return f"surface {number}" + (f", {part:.0%} of the free area are covered" if part else "")


def least_area(cell: float) -> float:
    """Return the area that a surface must add for cells of an area [m^2]."""
    return min(MIN_AREA, MIN_CELLS * cell)


def on_faces(
    seen: TriangleMesh,
    on: LinkPoints,
    faces: Iterable[tuple[Candidate, BoolArray]],
    least: float,
    begin: Callable[[str], None],
    number: int = 0,
) -> list[Proposed]:
    """Return surfaces on faces that are known, before tubes take strips of them."""
    found: list[Proposed] = []
    for candidate, points in faces:
        begin(stage(on, number + len(found) + 1))
        with on.only(points):
            best = best_of([Tried(candidate, candidate.bound(on))], seen, on, least)
            proposed = boundary_of(seen, on, *best, number + len(found) + 1, least) if best else None
        if proposed is not None:
            found.append(proposed)
    return found


@dataclass(eq=False)
class Tried:
    """A candidate, and what is known of it."""

    candidate: Candidate
    bound: float  # of the area that it adds [m^2]; decreases
    has_start: bool = False
    start: Start | None = None


def best_of(pool: list[Tried], seen: TriangleMesh, on: LinkPoints, least: float) -> tuple[Candidate, Trial] | None:
    """Return the candidate that adds the most area, more than the least one [m^2], and its trial; None without one.

    What a candidate added before bounds what it adds now, so that most are not tried again. The bounds of the pool are
    updated.
    """
    best: tuple[Candidate, Trial] | None = None
    never = least  # a candidate that adds no more is not tried again
    for tried in sorted(pool, key=lambda tried: -tried.bound):
        if tried.bound <= least:
            break
        if not tried.has_start:
            mesh = tried.candidate.mesh(seen)
            tried.start, tried.has_start = Start.of(mesh, on, tried.candidate.region, mesh is seen), True
        trial = tried.start.trial(on) if tried.start else None
        tried.bound = trial.area if trial else 0.0
        if tried.bound <= never:
            tried.start = None
        if trial and trial.area > least:
            best, least = (tried.candidate, trial), trial.area
    return best


def boundary_of(
    cover: TriangleMesh, on: LinkPoints, candidate: Candidate, trial: Trial, number: int, least: float
) -> Proposed | None:
    """Return a surface with the boundary of a trial, fitted as a plan has it; None if it covers too little."""
    per_span = SITES_PER_SPAN * int(np.ceil(trial.steps.max() / FINE_STEP))
    basis = TensorBasis.of(trial.lines, 3, 3, per_span)
    rows = SampleRows.of(cover, trial.lines, basis)
    fine = judged(rows, on, trial.parametrization, trial.lines, trial.offsets, basis, BOUNDARY_OPENING)
    if fine is None or fine.area < least:
        return None
    loops = loops_around(fine.good, fine.points, trial.parametrization.closed, LOOP_TOLERANCE)
    region = bounded_region(candidate.region, fine, loops)
    try:
        size = Size(*region_size(region.parametrization(cover), on))
        surface = Surface(candidate.cover, Grid(region, size, "uniform"), name=f"surface_{number}")
        return fitted(cover, on, surface, candidate.words, MIN_KEPT_FRACTION * fine.area)
    except SkinCalibError:
        return None


def fitted(cover: TriangleMesh, on: LinkPoints, surface: Surface, reason: str, least: float = 0.0) -> Proposed | None:
    """Return a surface of a plan with its fit; None if it covers too little."""
    fit = fit_grid(cover, surface.grid, surface.degree, surface.chords, surface.max_deviation)
    along_facets = covered_points(fit, fit.surface, on)
    if on.areas[along_facets & ~on.covered].sum() < least:
        return None
    refuse_errors(fit.warnings)
    # Skins are on the surface through the corners, which is farther from large facets.
    covered = covered_points(fit, fit.error_field.surface, on)
    area = float(on.areas[covered & ~on.covered].sum())
    on.cover(along_facets)
    return Proposed(surface, fit, area, covered, reason)


def bounded_region(region: Region, trial: Trial, loops: Loops) -> Region:
    """Return the part of a region inside loops; of a full turn only the sector that they need."""
    if isinstance(region, Across):
        assert isinstance(trial.parametrization, FaceParametrization)
        # Rows along a rounded direction, so that small differences of the mesh do not turn them.
        along = point_of(np.round(trial.parametrization.along, DECIMALS))
        return replace(region, axis=axis_along(along), boundary=loops)
    assert region.axis is not None
    frame = sector_frame(region.axis)
    x, y = frame.across(trial.points[trial.good] - frame.point).T
    angles = np.sort(np.arctan2(y, x))
    gaps = np.diff(angles, append=angles[0] + TURN)
    widest = int(gaps.argmax())
    if gaps[widest] <= 2 * SECTOR_MARGIN:
        return replace(region, boundary=loops)
    first = float(angles[(widest + 1) % len(angles)])
    turn, free = TURN - float(gaps[widest]), SECTOR_MARGIN
    return Sector(
        region.axis, None, loops, start=round(first - free, DECIMALS), stop=round(first + turn + free, DECIMALS)
    )


def covered_points(fit: SurfaceFit, surface: BSplineSurface, on: LinkPoints) -> BoolArray:
    """Return which free points a surface of a fit covers, shape (k,): near it, along it, and inside its boundary."""
    u, v = even_parameters(fit, surface)
    points = surface.grid_points(u, v).reshape(-1, 3)
    normals = unit(np.cross(*surface.grid_tangents(u, v))).reshape(-1, 3)
    trusted = fit.is_trusted(pairs_of(u, v))
    covered = np.zeros(len(on.points), bool)
    if trusted.any():
        points, normals = points[trusted], normals[trusted]
        limit = np.hypot(POINT_DISTANCE, MAX_DISTANCE)  # the points are at most POINT_DISTANCE apart
        distance, nearest = map(np.asarray, cKDTree(points).query(on.points, distance_upper_bound=limit))
        near = np.flatnonzero(on.free & np.isfinite(distance))
        if fit.lines.region is not None:
            near = near[fit.lines.region(on.points[near])]
        normal = normals[nearest[near]]
        height = ((on.points[near] - points[nearest[near]]) * normal).sum(axis=1)
        upright = (on.normals[near] * normal).sum(axis=1) > np.cos(MAX_ANGLE)
        covered[near[upright & (np.abs(height) < MAX_DISTANCE)]] = True
    return covered


def even_parameters(fit: SurfaceFit, surface: BSplineSurface) -> tuple[Array, Array]:
    """Return parameters u (k,), v (l,) of points at most ``POINT_DISTANCE`` apart where the fit is trusted."""
    u, v = (np.linspace(0, 1, SITES_PER_SPAN * n) for n in fit.offsets.shape)
    trusted = fit.is_trusted(pairs_of(u, v)).reshape(len(u), len(v))
    points = np.where(trusted[..., None], surface.grid_points(u, v), np.nan)
    steps = (np.linalg.norm(np.diff(points, axis=axis), axis=2) for axis in (0, 1))
    longest = (float(np.nanmax(a, initial=POINT_DISTANCE)) for a in steps)
    parts = [max(1, int(np.ceil(length / POINT_DISTANCE))) for length in longest]
    fine = [(np.arange(n * (len(a) - 1)) + 0.5) / (n * (len(a) - 1)) for a, n in zip((u, v), parts)]
    return fine[0], fine[1]
