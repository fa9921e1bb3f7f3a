"""The axis of a tube-like mesh: found from its sections, and the range of complete sections along it."""

from dataclasses import dataclass

import numpy as np

from ...common.arrays import Array, BoolArray, along, unit
from ...common.errors import EmptySection, InvalidPlan, millimetres
from ..mesh.triangle_mesh import TriangleMesh
from ..sampling.frames import TubeFrame, frame_of
from ..sampling.planes import Planes
from ..sampling.rays import TURN, RayCaster
from ..sampling.sections import Sections, cut_sections

# [1] ratio of thickness to width below which a mesh with two sides is a thin sheet. Larger: flat tubes are refused.
SHEET_THICKNESS_RATIO = 0.15
# [fraction of the area] on each side above which a mesh has two sides. Larger: fewer sheets are found.
SHEET_SIDE_FRACTION = 0.25
# [1] iterations for an axis from the centres of two sections. Each changes the axis by a fraction of the one before.
# Larger: no visible effect.
AXIS_ITERATIONS = 8
# [fraction of the mesh size] least distance of the two sections; nearer ones give no direction. Larger: more are
# refused.
MIN_SECTION_DISTANCE = 0.02


@dataclass(frozen=True)
class Axis:
    """A line along the link, in the link frame: ``point`` [m] and ``direction`` (any length)."""

    point: tuple[float, float, float]
    direction: tuple[float, float, float]


def tube_frame(mesh: TriangleMesh, axis: Axis | None) -> TubeFrame:
    """Return the frame of a tube: about the given axis, or about the axis of the mesh.

    Angle zero is the direction of the vertex with the largest distance from the axis. The link's x axis does not define
    it, so that the lines move together with the mesh.

    Parameters
    ----------
    mesh : TriangleMesh
        The tube.
    axis : Axis or None
        None: found from the mesh.

    Returns
    -------
    TubeFrame
    """
    frame = find_axis(mesh) if axis is None else frame_of(np.asarray(axis.point), np.asarray(axis.direction))
    arms = mesh.vertices - frame.point
    furthest = arms[np.argmax(np.einsum("vc,vc->v", arms, arms) - along(arms, frame.e3) ** 2)]
    return frame_of(frame.point, frame.e3, furthest)


def find_axis(mesh: TriangleMesh) -> TubeFrame:
    """Return the line that fits the centres of a tube's sections best, towards its thinner end.

    The first direction is the one with the least squared projections of the face normals. The line then fits the
    centres of circles fitted to the sections of the middle half. (The paper joins the centroids of two sections.)

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
            f"The mesh is a thin sheet, {thickness * 1e3:.1f} mm thick and {width * 1e3:.1f} mm wide, with two sides. "
            "Choose the side with the skin: a grid across a face with the outward normal "
            f"({x:g}, {y:g}, {z:g}), or its opposite."
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
            raise EmptySection("No axis was found: sections across the mesh are empty. Give the axis in the plan.")
        point = centres.mean(axis=0)
        direction = np.linalg.svd(centres - point)[2][0]
        taper = (radii - radii.mean()) @ ((centres - point) @ direction)
        if taper > 0:
            direction = -direction
    return frame_of(point, direction)


def axis_through(mesh: TriangleMesh, first: Array, second: Array) -> Axis:
    """Return the line through the centres of the two sections across it at two points of the mesh, as in the paper.

    Parameters
    ----------
    mesh : TriangleMesh
        The tube.
    first, second : array, shape (3,)
        Points on the mesh [m]; the axis runs from the first section to the second.

    Returns
    -------
    Axis
        In the link frame.

    Raises
    ------
    EmptySection
        If a section has no centre.
    InvalidPlan
        If the two sections are too close to each other.
    """
    points = np.array((first, second), float)
    direction = find_axis(mesh).e3
    direction = direction * np.sign((points[1] - points[0]) @ direction)
    for _ in range(AXIS_ITERATIONS):
        if (points[1] - points[0]) @ direction < MIN_SECTION_DISTANCE * mesh.size:
            raise InvalidPlan(
                "The two sections are too close to each other. Choose points that are further apart along the link."
            )
        frame = frame_of(points[0], direction)
        centres, _ = section_circles(cut_sections(mesh, Planes(points, np.tile(direction, (2, 1)))), frame)
        if len(centres) < 2:
            raise EmptySection("A section has no centre. Choose another point of the link.")
        direction = unit(centres[1] - centres[0])
    return Axis(tuple(centres[0].tolist()), tuple(direction.tolist()))


def section_circles(sections: Sections, frame: TubeFrame) -> tuple[Array, Array]:
    r"""Fit a circle to each section that is not empty, weighted by length (Kasa, 1976).

    .. math::

        \min_{x, y, c} \sum_i w_i \left( 2 x\, x_i + 2 y\, y_i + c - x_i^2 - y_i^2 \right)^2, \qquad
        r = \sqrt{c + x^2 + y^2}

    with the centres :math:`(x_i, y_i)` [m] and the lengths :math:`w_i` [m] of the segments.

    Parameters
    ----------
    sections : Sections
        Across the axis of the frame.
    frame : TubeFrame
        The frame.

    Returns
    -------
    centres : array, shape (k, 3)
        [m]
    radii : array, shape (k,)
        [m]
    """
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
    """Return the first and the last station of a tube's planes [m].

    Parameters
    ----------
    mesh : TriangleMesh
        The tube.
    frame : TubeFrame
        Its frame.
    margin : float or None
        Length left free at both ends [m]; None takes the longest run of sections that every ray at ``angles`` hits.
    angles : array, shape (l,)
        [rad]

    Returns
    -------
    first, last : float
        [m]

    Raises
    ------
    InvalidPlan
        If the margins leave nothing between them.
    EmptySection
        If no section is complete, or the complete sections have no length.
    """
    height = frame.stations(mesh.vertices)
    low, high = float(height.min()), float(height.max())
    if margin is not None:
        if low + margin >= high - margin:
            raise InvalidPlan(
                f"A margin of {margin * 1e3:g} mm at both ends leaves nothing of the {(high - low) * 1e3:.1f} mm "
                "along the axis. Reduce it.",
                margin=margin,
            )
        return low + margin, high - margin
    stations = low + (high - low) * (np.arange(192) + 0.5) / 192
    hit = rays_hit(cut_sections(mesh, frame.planes(stations)), frame, angles)
    first, last = longest_run(hit.all(axis=1))
    if first == last:
        raise EmptySection(
            f"No section across the axis is closed. {_opening(hit, stations, angles, frame)} Close it, "
            "use a grid over a sector or a face, or give the axis."
        )
    if last - first < 2:
        raise EmptySection(
            f"The closed part of the tube is shorter than {(high - low) * 1e3 / 96:.1f} mm. "
            f"{_opening(hit, stations, angles, frame)} Close it, use a grid over a sector or a face, or give the axis."
        )
    return float(stations[first]), float(stations[last - 1])


def longest_run(chosen: BoolArray) -> tuple[int, int]:
    """Return the first index of the longest run of chosen elements, and the index after its last; both 0 for none."""
    edges = np.flatnonzero(np.diff(np.r_[0, chosen, 0])).reshape(-1, 2)
    if len(edges) == 0:
        return 0, 0
    first, last = edges[np.argmax(np.diff(edges, axis=1))]
    return int(first), int(last)


def _opening(hit: BoolArray, stations: Array, angles: Array, frame: TubeFrame) -> str:
    """Return a text with the position of the gap in the open section that is most nearly closed."""
    i = int(np.argmax(np.where(hit.all(axis=1), -1, hit.sum(axis=1))))
    j = int(np.argmin(hit.sum(axis=0) + len(hit) * hit[i]))
    place = millimetres(frame.point + stations[i] * frame.e3)
    return f"The section with the smallest gap, through {place}, is open at {np.rad2deg(angles[j]) % 360:.0f} degrees."


def rays_hit(sections: Sections, frame: TubeFrame, angles: Array) -> BoolArray:
    """Return which rays at ``angles`` from the axis hit each section.

    Parameters
    ----------
    sections : Sections
        Across the axis of the frame.
    frame : TubeFrame
        The frame.
    angles : array, shape (l,)
        [rad]

    Returns
    -------
    array of bool, shape (sections.planes, l)
    """
    shape = (sections.planes, len(angles))
    directions = np.broadcast_to(np.column_stack((np.cos(angles), np.sin(angles))), (*shape, 2))
    centres = np.zeros((sections.planes, 2))
    caster = RayCaster(sections.plane, frame.across(sections.ends - frame.point), sections.planes, centres=centres)
    return ~np.isnan(caster.cast(np.zeros((*shape, 2)), directions)[0])


FULL_TURN_ANGLES = np.arange(90) * TURN / 90  # [rad]
