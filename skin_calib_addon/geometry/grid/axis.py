"""The axis of a tube-like mesh: found from its sections, and how far complete sections reach along it."""

from dataclasses import dataclass

import numpy as np

from ...common.arrays import Array, BoolArray, along, unit
from ...common.errors import EmptySection, InvalidPlan, millimetres
from ..mesh.triangle_mesh import TriangleMesh
from ..sampling.frames import TubeFrame, frame_of
from ..sampling.planes import Planes
from ..sampling.rays import TURN, RayCaster
from ..sampling.sections import Sections, cut_sections

# What is thinner than this share of its width, with as much of its area on each side, has two sides and is no tube.
SHEET_THICKNESS_RATIO, SHEET_SIDE_FRACTION = 0.15, 0.25
# Sections across an axis that joins their own centres: each round turns it by a fraction of the one before.
AXIS_ITERATIONS = 8
# Sections nearer to each other than this share of the mesh's size tell no direction.
MIN_SECTION_DISTANCE = 0.02


@dataclass(frozen=True)
class Axis:
    """A line along the link, in the link frame: ``point`` [m] and ``direction`` (any length)."""

    point: tuple[float, float, float]
    direction: tuple[float, float, float]


def tube_frame(mesh: TriangleMesh, axis: Axis | None) -> TubeFrame:
    """Frame of a tube: the author's axis or the one found; angle zero points at the vertex furthest from it.

    The vertex, not the link's x axis, sets the angles, so that a mesh that is moved takes its lines with it.
    """
    frame = find_axis(mesh) if axis is None else frame_of(np.asarray(axis.point), np.asarray(axis.direction))
    arms = mesh.vertices - frame.point
    furthest = arms[np.argmax(np.einsum("vc,vc->v", arms, arms) - along(arms, frame.e3) ** 2)]
    return frame_of(frame.point, frame.e3, furthest)


def find_axis(mesh: TriangleMesh) -> TubeFrame:
    """The line that best joins the centres of a tube's sections, running towards its thinner end.

    A first direction is the one that the faces' normals avoid; the centres of circles fitted to the sections of the
    middle half then give the line (the paper joins the centroids of two sections).

    Raises
    ------
    EmptySection
        If the mesh is no tube: sections across its axis are empty.
    InvalidPlan
        If the mesh is a thin sheet, whose side only the author can choose.
    """
    normals, areas = mesh.face_normals, mesh.face_areas
    spread = np.einsum("f,fi,fj->ij", areas, normals, normals)
    axes = np.linalg.eigh(spread)[1]
    thickness, width = np.sort(np.ptp(mesh.vertices @ axes, axis=0))[:2]
    facing = normals @ axes[:, 2]
    if (
        thickness < SHEET_THICKNESS_RATIO * width
        and min(areas[facing > 0].sum(), areas[facing < 0].sum()) > SHEET_SIDE_FRACTION * areas.sum()
    ):
        x, y, z = np.round(axes[:, 2], 2) + 0.0
        raise InvalidPlan(
            f"the mesh is a thin sheet, {thickness * 1e3:.1f} mm thick and {width * 1e3:.1f} mm wide, with two sides: "
            f'say which one carries the skin by a patch with "normal" ({x:g}, {y:g}, {z:g}), or its opposite'
        )
    direction = axes[:, 0]
    point = (areas[:, None] * mesh.triangles.mean(axis=1)).sum(axis=0) / areas.sum()
    for _ in range(3):
        frame = frame_of(point, direction)
        height = frame.stations(mesh.vertices)
        low, high = height.min(), height.max()
        planes = frame.planes(np.linspace(low + 0.25 * (high - low), high - 0.25 * (high - low), 9))
        centres, radii = section_circles(cut_sections(mesh, planes), frame)
        if len(centres) < 2:
            raise EmptySection("no axis found: sections across the mesh are empty; give the axis in the plan")
        point = centres.mean(axis=0)
        direction = np.linalg.svd(centres - point)[2][0]
        taper = (radii - radii.mean()) @ ((centres - point) @ direction)
        if taper > 0:
            direction = -direction
    return frame_of(point, direction)


def axis_through(mesh: TriangleMesh, first: Array, second: Array) -> Axis:
    """The line that joins the centres of the sections across it through two points of the mesh, as in the paper.

    Parameters
    ----------
    first, second : array, shape (3,)
        On the mesh [m]; the axis runs from the first section to the second.

    Raises
    ------
    EmptySection
        If a section has no centre.
    InvalidPlan
        If the sections lie on each other.
    """
    points = np.array((first, second), float)
    direction = find_axis(mesh).e3
    direction = direction * np.sign((points[1] - points[0]) @ direction)
    for _ in range(AXIS_ITERATIONS):
        if (points[1] - points[0]) @ direction < MIN_SECTION_DISTANCE * mesh.size:
            raise InvalidPlan("the two sections lie on each other; choose points that are further apart along the link")
        frame = frame_of(points[0], direction)
        centres, _ = section_circles(cut_sections(mesh, Planes(points, np.tile(direction, (2, 1)))), frame)
        if len(centres) < 2:
            raise EmptySection("a section has no centre; choose another point of the link")
        direction = unit(centres[1] - centres[0])
    return Axis(tuple(centres[0].tolist()), tuple(direction.tolist()))


def section_circles(sections: Sections, frame: TubeFrame) -> tuple[Array, Array]:
    """Circle fitted to each section that is not empty (Kasa, 1976, weighted by length): centres (k, 3), radii (k,)."""
    centres, radii = [], []
    for i in range(sections.planes):
        ends = sections.ends[sections.plane == i]
        if len(ends) < 3:
            continue
        weight = np.sqrt(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1))[:, None]
        middle = ends.mean(axis=1)
        xy = frame.across(middle - frame.point)
        system = weight * np.column_stack((2 * xy, np.ones(len(xy))))
        x, y, rest = np.linalg.lstsq(system, (weight * (xy**2).sum(axis=1, keepdims=True))[:, 0], rcond=None)[0]
        station = frame.stations(middle).mean()
        centres.append(frame.point + x * frame.e1 + y * frame.e2 + station * frame.e3)
        radii.append(np.sqrt(max(rest + x * x + y * y, 0.0)))
    return np.array(centres).reshape(-1, 3), np.array(radii)


def stations_between(mesh: TriangleMesh, frame: TubeFrame, margin: float | None, angles: Array) -> tuple[float, float]:
    """First and last station of a tube's planes [m].

    Parameters
    ----------
    margin : float or None
        Length left free at both ends [m]; None takes the longest run of sections that every ray at ``angles`` meets.

    Raises
    ------
    InvalidPlan
        If the margins leave nothing between them.
    EmptySection
        If no section is complete, or those that are have no length.
    """
    height = frame.stations(mesh.vertices)
    low, high = float(height.min()), float(height.max())
    if margin is not None:
        if low + margin >= high - margin:
            raise InvalidPlan(
                f"margin {margin * 1e3:g} mm at both ends leaves nothing of the {(high - low) * 1e3:.1f} mm along the "
                "axis; make it smaller",
                margin=margin,
            )
        return low + margin, high - margin
    stations = low + (high - low) * (np.arange(192) + 0.5) / 192
    hit = rays_hit(cut_sections(mesh, frame.planes(stations)), frame, angles)
    first, last = longest_run(hit.all(axis=1))
    if first == last:
        raise EmptySection(
            f"no section across the axis goes all the way round; {_opening(hit, stations, angles, frame)}; close it, "
            "use a patch grid, or give the axis"
        )
    if last - first < 2:
        raise EmptySection(
            f"sections across the axis go all the way round for less than {(high - low) * 1e3 / 96:.1f} mm of it; "
            f"{_opening(hit, stations, angles, frame)}; close it, use a patch grid, or give the axis"
        )
    return float(stations[first]), float(stations[last - 1])


def longest_run(chosen: BoolArray) -> tuple[int, int]:
    """First index of the longest run of the chosen, and the one behind its last; the same twice where there is none."""
    edges = np.flatnonzero(np.diff(np.r_[0, chosen, 0])).reshape(-1, 2)
    if len(edges) == 0:
        return 0, 0
    first, last = edges[np.argmax(np.diff(edges, axis=1))]
    return int(first), int(last)


def _opening(hit: BoolArray, stations: Array, angles: Array, frame: TubeFrame) -> str:
    """Where the fullest section that is open is so, in words."""
    i = int(np.argmax(np.where(hit.all(axis=1), -1, hit.sum(axis=1))))
    j = int(np.argmin(hit.sum(axis=0) + len(hit) * hit[i]))
    place = millimetres(frame.point + stations[i] * frame.e3)
    return f"the fullest, through {place}, is open at {np.rad2deg(angles[j]) % 360:.0f} degrees"


def rays_hit(sections: Sections, frame: TubeFrame, angles: Array) -> BoolArray:
    """Which rays at ``angles`` from the axis meet the section, shape (sections.planes, len(angles))."""
    shape = (sections.planes, len(angles))
    directions = np.broadcast_to(np.column_stack((np.cos(angles), np.sin(angles))), (*shape, 2))
    centres = np.zeros((sections.planes, 2))
    caster = RayCaster(sections.plane, frame.across(sections.ends - frame.point), sections.planes, centres=centres)
    return ~np.isnan(caster.cast(np.zeros((*shape, 2)), directions)[0])


FULL_TURN_ANGLES = np.arange(90) * TURN / 90
