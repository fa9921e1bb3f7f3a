"""The axis of a tube-like mesh: found from its sections, and the range of complete sections along it."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, lru_cache

import numpy as np
from scipy.spatial import ConvexHull

from ...common.arrays import Array, BoolArray, ComplexArray, IntArray, unit
from ...common.errors import EmptySection, InvalidPlan, millimetres
from ...common.warnings import Place, Warning, point_of
from ..mesh.outliers import stray_part
from ..mesh.triangle_mesh import TriangleMesh
from ..sampling.frames import TubeFrame, frame_of, link_direction, link_side
from ..sampling.planes import Planes
from ..sampling.rays import TURN, RayCaster
from ..sampling.sections import Sections, cut_sections

# [1] ratio of thickness to width below which a mesh with two sides is a thin sheet. Larger: flat tubes are refused.
SHEET_THICKNESS_RATIO = 0.15
# [fraction of the area] on each side above which a mesh has two sides. Larger: fewer sheets are found.
SHEET_SIDE_FRACTION = 0.25
# [1] iterations for an axis or a curve from centres of sections, and for a maximum of the profile. Each changes the
# result by a fraction of the one before. Larger: no visible effect.
SECTION_ITERATIONS = 8
# [1] sections of the middle half of a tube whose circles give its axis. Larger: less influence of one section, more
# time. They are at the heights of a Gauss quadrature, which rarely coincide with the edge of a step.
AXIS_SECTIONS = 9
# [1] relative difference of lengths, 10 um on 100 mm, up to which both ends of a tube are equally thick, both ends of a
# face equally wide, and a section is round, so that the link frame decides. It is more than the rounding of a mesh
# file, and far less than ``ROUND_PROFILE``. Larger: the link frame decides for more axes.
EQUAL_SHAPE = 1e-4
# [1] sections over the whole length that give angle zero. Larger: less influence of one section, more time.
ZERO_SECTIONS = 12
ZERO_HARMONICS = 5  # [1] of the profile that gives angle zero. Larger: more influence of corners
# [1] height of the profile below which a section is round: 0.1 % of the radius. Larger: the link frame decides for more
# tubes.
ROUND_PROFILE = 1e-3
# [1] difference of two maxima of the profile below which they are equal. Larger: the link frame decides for more tubes.
EQUAL_MAXIMA = 1e-5
# [1] difference of two maxima, or of the ends of a tube, below which a small change of the mesh can exchange them: 0.1
# mm on 100 mm. One vertex of 528 that the fit leaves out makes 2e-4. Larger: more notes.
NEARLY_EQUAL = 1e-3
# [rad] difference of two angles below which they are equal. Larger: the link frame decides for more tubes.
EQUAL_ANGLES = 1e-3
# [1] ratio of the second moments below which a face is nearly square: sides that differ by 22 %. Larger: the rectangle
# around more faces gives their direction.
SQUARE_MOMENT = 0.2
# [1] ratio of areas from which on the smallest rectangle around a nearly square face gives its direction. Larger: fewer
# faces; smaller: the corners of round ones decide. It is exceeded 0.6 degrees from the sides of a square.
RECTANGLE_RATIO = 1.02
# [fraction of the mesh size] distance below which planes are equal. Larger: more planes are refused.
SAME_PLANE_FRACTION = 1e-6
TRIAL_STATIONS = 192  # [1] tried for complete sections. Larger: narrower openings are seen, more time
# [1] halvings of a step that find the end of the complete sections, to 1/512 of it. Larger: more accurate, more time.
END_HALVINGS = 9
# [fraction of the mesh size] least distance of the two sections; nearer ones give no direction. Larger: more are
# refused.
MIN_SECTION_DISTANCE = 0.02
# [m] length of the complete sections below which a tube is refused, because no cell of a skin fits there. Larger: more
# short rings are refused.
MIN_TUBE_LENGTH = 3e-3
FULL_TURN_ANGLES = np.arange(90) * TURN / 90  # [rad] of the rays that find complete sections


@dataclass(frozen=True)
class Axis:
    """A line along the link, in the link frame: ``point`` [m] and ``direction`` (any length)."""

    point: tuple[float, float, float]
    direction: tuple[float, float, float]

    def __post_init__(self):
        object.__setattr__(self, "point", tuple(self.point))  # hashable
        object.__setattr__(self, "direction", tuple(self.direction))


@lru_cache(maxsize=4)  # repeated fits, as in the window, keep the axis of their mesh
def tube_frame(mesh: TriangleMesh, axis: Axis | None) -> TubeFrame:
    """Return the frame of a tube: about the given axis, or about the axis of the mesh.

    The shape defines angle zero (see ``zero_direction``), so that the lines move together with the mesh.
    """
    frame = find_axis(mesh) if axis is None else frame_of(np.asarray(axis.point), np.asarray(axis.direction))
    return frame_of(frame.point, frame.e3, zero_direction(mesh, frame))


def zero_direction(mesh: TriangleMesh, frame: TubeFrame) -> Array:
    r"""Return the direction of angle zero: the side to which the sections extend farthest.

    The profile is a smooth measure of how far the sections extend at the angle :math:`\theta`:

    .. math::

        f(\theta) = \operatorname{Re} \sum_{k=1}^{5} c_k\, e^{-i k \theta}, \qquad
        c_k = \frac{\int (z / r)^k\, \mathrm{d}\ell\, \mathrm{d}s}{\int \mathrm{d}\ell\, \mathrm{d}s}, \qquad
        r^2 = \frac{\int |z|^2\, \mathrm{d}\ell\, \mathrm{d}s}{\int \mathrm{d}\ell\, \mathrm{d}s}

    The integrals go along the sections (:math:`\ell`) and over their stations (:math:`s`) [m], and :math:`z = x + i y`
    is the position across the axis [m]. Angle zero is at the maximum of the profile.

    - Of equal maxima, the one counts after which the next maximum follows soonest; a mirrored pair then has a first.
    - Of equal maxima at equal distances, the one next to ``link_direction`` counts: such a tube has a symmetry.
    - A round tube has no maximum. ``link_direction`` then is angle zero. Between the two, both have an influence.
    """
    angles, heights, link = profile_maxima(mesh, frame)
    angle = first_in_turn(angles[heights > heights.max() - EQUAL_MAXIMA], link)
    return np.cos(angle) * frame.e1 + np.sin(angle) * frame.e2


def profile_maxima(mesh: TriangleMesh, frame: TubeFrame) -> tuple[Array, Array, float]:
    """Return angles (k,) [rad] and heights (k,) of the maxima of the profile, and the angle of ``link_direction``."""
    c = profile_harmonics(mesh, frame)
    k = np.arange(1, len(c) + 1)
    x, y = frame.across(link_direction(frame.e3))
    c[0] += EQUAL_SHAPE * link_influence(float(np.abs(c).sum())) * (x + 1j * y)
    step = TURN / (16 * len(c))
    angles = step * np.arange(16 * len(c))
    profile = (c * np.exp(-1j * k * angles[:, None])).real.sum(axis=1)
    angles = angles[(profile >= np.roll(profile, 1)) & (profile > np.roll(profile, -1))]
    for _ in range(SECTION_ITERATIONS):
        waves = c * np.exp(-1j * k * angles[:, None])
        slope, bend = (k * waves).imag.sum(axis=1), (k**2 * waves).real.sum(axis=1)
        angles = angles + np.clip(slope / np.maximum(bend, 1e-300), -step, step)
    heights = (c * np.exp(-1j * k * angles[:, None])).real.sum(axis=1)
    return np.asarray(angles % TURN), heights, float(np.arctan2(y, x))


@lru_cache(maxsize=4)  # as tube_frame
def symmetry_notes(mesh: TriangleMesh, axis: Axis | None) -> tuple[Warning, ...]:
    """Return a note about each choice between nearly equal sides of a tube, which another mesh can turn round."""
    frame, found = tube_frame(mesh, axis), []
    angles, heights, _ = profile_maxima(mesh, frame)
    less = heights.max() - heights
    near = np.flatnonzero((less > EQUAL_MAXIMA) & (less < NEARLY_EQUAL))
    if len(near):
        sides = f"extend at 0 and {np.rad2deg(angles[near[0]]):.0f} degrees about the axis"
        found.append((sides, float(less[near[0]]), 'angle zero, for sectors and the origin "center"'))
    taper = axis_with_taper(mesh)[1] if axis is None else 0.0
    if EQUAL_SHAPE < taper < NEARLY_EQUAL:
        found.append(("extend at both ends", taper, "the sense of the axis, and so the order of rows and columns"))
    return tuple(
        Warning(
            "nearly-symmetric",
            "note",
            f"The sections {sides} equally far, within {NEARLY_EQUAL:.1%}. The rest decides {what}: on another mesh of "
            "this link it can be the opposite.",
            value=value,
            advice="Compare the sides after each change of the mesh.",
        )
        for sides, value, what in found
    )


def profile_harmonics(mesh: TriangleMesh, frame: TubeFrame) -> ComplexArray:
    """Return the harmonics of the profile about an axis, as in ``zero_direction``; inner parts have no influence."""
    stations, weights = gauss_stations(*frame.extent(mesh.vertices), ZERO_SECTIONS)
    sections = cut_sections(mesh, frame.planes(stations))
    ends = frame.across(sections.ends - frame.point)
    outer = RayCaster(sections.plane, ends, sections.planes, centres=np.zeros((sections.planes, 2))).segment
    if len(outer) == 0:  # a flat mesh across the axis
        return np.zeros(ZERO_HARMONICS, complex)
    points, lengths = segment_points(ends[outer], 3)  # exact for the fifth power
    z, lengths = points[..., 0] + 1j * points[..., 1], lengths * weights[sections.plane[outer], None]
    radius = np.sqrt((lengths * np.abs(z) ** 2).sum() / lengths.sum())
    powers = (z / radius)[..., None] ** np.arange(1, ZERO_HARMONICS + 1)
    return (lengths[..., None] * powers).sum(axis=(0, 1)) / lengths.sum()


def first_in_turn(angles: Array, link: float) -> float:
    """Return the angle with the nearest next one; of equal ones, that nearest to the link's direction."""
    angles = np.sort(angles)
    gaps = (np.roll(angles, -1) - angles) % TURN
    first = np.arange(len(angles))
    for i in range(len(angles)):
        following = gaps[(first + i) % len(angles)]
        first = first[following < following.min() + EQUAL_ANGLES]
    distances = np.abs((angles[first] - link + TURN / 2) % TURN - TURN / 2)
    return float(angles[first[np.argmax(distances < distances.min() + EQUAL_ANGLES)]])


def gauss_stations(first: float, last: float, count: int) -> tuple[Array, Array]:
    """Return the stations of a Gauss quadrature between two stations [m], and their weights [m]."""
    nodes, weights = gauss_rule(count)
    half = (last - first) / 2
    return first + half * (1 + nodes), half * weights


@cache
def gauss_rule(count: int) -> tuple[Array, Array]:
    """Return the nodes of a Gauss quadrature from -1 to 1, and their weights."""
    return np.polynomial.legendre.leggauss(count)


def segment_points(ends: Array, count: int) -> tuple[Array, Array]:
    """Return points on segments that integrate polynomials exactly, so that divided segments give the same integral."""
    fractions, weights = gauss_stations(0.0, 1.0, count)
    steps = ends[:, 1] - ends[:, 0]
    return ends[:, :1] + fractions[:, None] * steps[:, None], np.linalg.norm(steps, axis=1)[:, None] * weights


def find_axis(mesh: TriangleMesh) -> TubeFrame:
    """Return the line that fits the centres of a tube's sections best, towards its thinner end.

    The first direction is the one with the least squared projections of the face normals. The line then fits the
    centres of circles fitted to the sections of the middle half. (The paper joins the centroids of two sections.) If
    both ends are equally thick, the axis runs to the side of the link frame that ``link_side`` prefers.
    """
    return axis_with_taper(mesh)[0]


@lru_cache(maxsize=4)  # repeated fits, as in the window, keep the axis of their mesh
def axis_with_taper(mesh: TriangleMesh) -> tuple[TubeFrame, float]:
    """Return the axis of ``find_axis``, and the change of the radius along it that gives its sense; refuse sheets."""
    normals, areas = mesh.face_normals, mesh.face_areas
    spread = np.einsum("f,fi,fj->ij", areas, normals, normals)
    axes = np.linalg.eigh(spread)[1]
    thickness, width = np.sort(np.ptp(mesh.vertices @ axes, axis=0))[:2]
    facing = normals @ axes[:, 2]
    is_thin = thickness < SHEET_THICKNESS_RATIO * width
    if is_thin and min(areas[facing > 0].sum(), areas[facing < 0].sum()) > SHEET_SIDE_FRACTION * areas.sum():
        normal = np.round(axes[:, 2], 2) + 0.0
        x, y, z = normal
        middle = mesh.triangles.mean(axis=1)[facing > 0]
        nearest = np.linalg.norm(middle - middle.mean(axis=0), axis=1).argmin()
        raise InvalidPlan(
            f"The mesh is a thin sheet, {thickness * 1e3:.1f} mm thick and {width * 1e3:.1f} mm wide, with two sides. "
            "Choose the side with the skin: a grid across a face with the outward normal "
            f"({x:g}, {y:g}, {z:g}), or its opposite.",
            place=Place(point_of(middle[nearest]), normal=point_of(normal)),
        )
    direction = axes[:, 0]
    point = (areas[:, None] * mesh.triangles.mean(axis=1)).sum(axis=0) / areas.sum()
    for _ in range(3):
        frame = frame_of(point, direction)
        low, high = frame.extent(mesh.vertices)
        inset = (high - low) / 4
        stations, weights = gauss_stations(low + inset, high - inset, AXIS_SECTIONS)
        centres, radii, planes = section_circles(cut_sections(mesh, frame.planes(stations)), frame)
        if len(centres) < 2 and is_thin:
            raise InvalidPlan(
                f"The mesh is a thin sheet, {thickness * 1e3:.1f} mm thick and {width * 1e3:.1f} mm wide, without an "
                "axis. If a cut removes the rest of the link, reverse its normal or move its plane. For skin on the "
                "sheet, choose a grid across a face."
            )
        if len(centres) < 2:
            cause = stray_part(mesh) or " Give the axis in the plan."
            raise EmptySection(f"No axis was found: sections across the mesh are empty.{cause}")
        weights = weights[planes] / weights[planes].sum()
        point = weights @ centres
        direction = np.linalg.svd(np.sqrt(weights)[:, None] * (centres - point))[2][0]
        along_axis = (centres - point) @ direction
        taper = weights @ (radii * along_axis) / (weights @ along_axis**2)
        towards_thin = -np.sign(taper) if abs(taper) > EQUAL_SHAPE else link_side(direction)
        direction = towards_thin * direction
    return frame_of(point, direction), float(abs(taper))


def axis_through(mesh: TriangleMesh, first: Array, second: Array) -> Axis:
    """Return the line through the centres of the two sections across it at two points of the mesh, as in the paper."""
    points = np.array((first, second), float)
    direction = find_axis(mesh).e3
    direction = direction * np.sign((points[1] - points[0]) @ direction)
    for _ in range(SECTION_ITERATIONS):
        if (points[1] - points[0]) @ direction < MIN_SECTION_DISTANCE * mesh.size:
            raise InvalidPlan(
                "The two sections are too close to each other. Choose points that are further apart along the link."
            )
        frame = frame_of(points[0], direction)
        centres, *_ = section_circles(cut_sections(mesh, Planes(points, np.tile(direction, (2, 1)))), frame)
        if len(centres) < 2:
            raise EmptySection("A section has no centre. Choose another point of the link.")
        direction = unit(centres[1] - centres[0])
    return Axis(tuple(centres[0].tolist()), tuple(direction.tolist()))


def section_circles(sections: Sections, frame: TubeFrame) -> tuple[Array, Array, IntArray]:
    r"""Fit a circle to each section that is not on a line, weighted by length (Kasa, 1976).

    .. math::

        \min_{x, y, c} \int \left( 2 x\, \xi + 2 y\, \eta + c - \xi^2 - \eta^2 \right)^2 \mathrm{d}\ell, \qquad
        r = \sqrt{c + x^2 + y^2}

    The integral goes over the length of the section, whose points are :math:`(\xi, \eta)` [m].
    """
    centres, radii, planes = [], [], []
    for i in range(sections.planes):
        points, lengths = segment_points(sections.ends[sections.plane == i], 2)
        weight = np.sqrt(lengths).reshape(-1, 1)
        xy = frame.across(points - frame.point).reshape(-1, 2)
        system = weight * np.column_stack((2 * xy, np.ones(len(xy))))
        found, _, rank, _ = np.linalg.lstsq(system, (weight * (xy**2).sum(axis=1, keepdims=True))[:, 0], rcond=None)
        if rank < 3:
            continue
        x, y, rest = found
        centres.append(frame.point + x * frame.e1 + y * frame.e2 + frame.stations(points).mean() * frame.e3)
        radii.append(np.sqrt(max(rest + x * x + y * y, 0.0)))
        planes.append(i)
    return np.array(centres).reshape(-1, 3), np.array(radii), np.array(planes, np.int64)


def stations_between(mesh: TriangleMesh, frame: TubeFrame, margin: float | None, angles: Array) -> tuple[float, float]:
    """Return the first and the last station of a tube's planes [m]."""
    low, high = frame.extent(mesh.vertices)
    if margin is not None:
        if high - low - 2 * margin < SAME_PLANE_FRACTION * mesh.size:
            raise InvalidPlan(
                f"A margin of {margin * 1e3:g} mm at both ends leaves nothing of the {(high - low) * 1e3:.1f} mm "
                "along the axis. Reduce it.",
                margin=margin,
            )
        return low + margin, high - margin

    def hits(stations: Array) -> BoolArray:
        return rays_hit(cut_sections(mesh, frame.planes(stations)), frame, angles)

    stations = low + (high - low) * (np.arange(TRIAL_STATIONS) + 0.5) / TRIAL_STATIONS
    hit = hits(stations)
    first, last = longest_run(hit.all(axis=1))
    if first == last:
        opening, place = _opening(hit, stations, angles, frame)
        raise EmptySection(
            f"No section across the axis is closed. {opening} Close it, use a grid over a sector or a face, or give "
            f"the axis.{stray_part(mesh)}",
            place=place,
        )
    low, high = run_between(lambda stations: hits(stations).all(axis=1), stations, first, last)
    if high - low < MIN_TUBE_LENGTH:
        opening, place = _opening(hit, stations, angles, frame)
        raise EmptySection(
            f"The closed part of the tube is shorter than {MIN_TUBE_LENGTH * 1e3:g} mm. {opening} Close it, use a grid "
            f"over a sector or a face, or give the axis.{stray_part(mesh)}",
            place=place,
        )
    return low, high


def run_between(
    is_complete: Callable[[Array], BoolArray], stations: Array, first: int, last: int
) -> tuple[float, float]:
    """Return the stations half a step within the exact ends of a run of complete sections [m].

    The trial stations themselves would jump by a step where an end moves past one of them.
    """
    step = stations[1] - stations[0]
    inside, part = stations[[first, last - 1]], np.array((-step, step))
    for _ in range(END_HALVINGS):
        part = part / 2
        inside = np.where(is_complete(inside + part), inside + part, inside)
    low, high = inside + (step / 2, -step / 2)
    return float(low), float(high)


def longest_run(chosen: BoolArray) -> tuple[int, int]:
    """Return the first index of the longest run of chosen elements, and the index after its last; both 0 for none."""
    edges = np.flatnonzero(np.diff(np.r_[0, chosen, 0])).reshape(-1, 2)
    if len(edges) == 0:
        return 0, 0
    first, last = edges[np.argmax(np.diff(edges, axis=1))]
    return int(first), int(last)


def _opening(hit: BoolArray, stations: Array, angles: Array, frame: TubeFrame) -> tuple[str, Place]:
    """Return a text with the position of the gap in the open section that is most nearly closed, and its centre."""
    i = int(np.argmax(np.where(hit.all(axis=1), -1, hit.sum(axis=1))))
    j = int(np.argmin(hit.sum(axis=0) + len(hit) * hit[i]))
    point = frame.point + stations[i] * frame.e3
    angle = f"{np.rad2deg(angles[j]) % 360:.0f} degrees"
    text = f"The section with the smallest gap, through {millimetres(point)}, is open at {angle}."
    return text, Place(point_of(point))


def open_at(mesh: TriangleMesh, frame: TubeFrame, station: float) -> str:
    """Return at which angle the section at a station [m] is open, as " at 34 degrees"; empty if it is complete."""
    hit = rays_hit(cut_sections(mesh, frame.planes(np.array([station]))), frame, FULL_TURN_ANGLES)[0]
    return "" if hit.all() else f" at {np.rad2deg(FULL_TURN_ANGLES[hit.argmin()]):.0f} degrees"


def rays_hit(sections: Sections, frame: TubeFrame, angles: Array) -> BoolArray:
    """Return which rays at ``angles`` from the axis hit each section."""
    shape = (sections.planes, len(angles))
    directions = np.broadcast_to(np.column_stack((np.cos(angles), np.sin(angles))), (*shape, 2))
    centres = np.zeros((sections.planes, 2))
    caster = RayCaster(sections.plane, frame.across(sections.ends - frame.point), sections.planes, centres=centres)
    return ~np.isnan(caster.cast(np.zeros((*shape, 2)), directions)[0])


def long_direction(triangles: Array, up: Array) -> Array:
    r"""Return the direction of the longer side of a face, towards its wider end.

    With the position :math:`z = x + i y` in the face, relative to its centroid [m], the direction has the angle

    .. math::

        \alpha = \tfrac{1}{2} \arg \int z^2\, \mathrm{d}A \quad \text{or} \quad \alpha + \pi, \qquad
        \text{with} \quad \int \operatorname{Re}(z\, e^{-i \alpha})^3\, \mathrm{d}A < 0

    A missing corner turns this direction of a nearly square face by up to 45 degrees. Such a face has the direction of
    the smallest rectangle around it, if this is clearly smaller than the rectangle along :math:`\alpha`.

    The link frame decides what the shape does not: the angle of a round face, and the sense of a symmetric one.
    """
    frame = frame_of(np.zeros(3), up, link_direction(up))
    x, y = np.moveaxis(frame.across(triangles), -1, 0)
    z = x + 1j * y
    areas = np.abs(((z[:, 1] - z[:, 0]) * np.conj(z[:, 2] - z[:, 0])).imag) / 2
    areas = areas / areas.sum()
    z = z - areas @ z.mean(axis=1)
    total = z.sum(axis=1)
    second = areas @ ((z**2).sum(axis=1) + total**2) / 12  # exact integrals over the triangles
    square = areas @ ((np.abs(z) ** 2).sum(axis=1) + np.abs(total) ** 2) / 12
    second += square * EQUAL_SHAPE * link_influence(np.abs(second) / square)
    angle = float(np.angle(second) / 2)
    if np.abs(second) < SQUARE_MOMENT * square:
        angle = rectangle_angle(np.column_stack((z.real.ravel(), z.imag.ravel())), angle)
    along = (z * np.exp(-1j * angle)).real
    total = along.sum(axis=1)
    third = areas @ (total**3 + 3 * total * (along**2).sum(axis=1) + 2 * (along**3).sum(axis=1)) / 60
    direction = np.cos(angle) * frame.e1 + np.sin(angle) * frame.e2
    skewed = np.abs(third) > EQUAL_SHAPE * square**1.5
    return direction * (-np.sign(third) if skewed else link_side(direction))


def rectangle_angle(points: Array, angle: float) -> float:
    """Return the angle of the longer side of the smallest rectangle around points, if it is clearly the smallest one.

    One of its sides is along a side of the convex hull (Freeman and Shapira, 1975). Of equal rectangles, and of equal
    sides, the one nearest to the given angle counts, then the one next to angle zero.
    """
    corners = points[ConvexHull(points).vertices]
    x, y = (np.roll(corners, -1, axis=0) - corners).T
    angles = np.append(np.arctan2(y, x), angle)
    angles = np.concatenate((angles, angles + TURN / 4))  # both sides of each rectangle
    lengths = np.ptp(corners @ np.stack((np.cos(angles), np.sin(angles))), axis=0)
    areas = lengths * np.roll(lengths, len(x) + 1)
    if areas[-1] < RECTANGLE_RATIO * areas.min():
        return angle
    long = lengths > (1 - EQUAL_SHAPE) * np.roll(lengths, len(x) + 1)
    angles = angles[long & (areas < (1 + EQUAL_SHAPE) * areas.min())]
    for other in (angle, 0.0):
        distances = np.abs((angles - other + TURN / 4) % (TURN / 2) - TURN / 4)
        angles = angles[distances < distances.min() + EQUAL_ANGLES]
    return float(angles[0])


def link_influence(height: float) -> float:
    """Return the influence of the link frame, from 1 for a round shape to 0 at the height ``ROUND_PROFILE``."""
    return max(0.0, 1 - (height / ROUND_PROFILE) ** 2) ** 2
