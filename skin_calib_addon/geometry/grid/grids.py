"""The grid of the author: a region of the mesh, the number of planes and lines, and their spacing."""

from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np

from ...common.arrays import Array, BoolArray, IntArray, unit
from ...common.errors import InvalidPlan
from ...common.warnings import Place, Warning, point_of
from ..mesh.outliers import stray_part
from ..mesh.triangle_mesh import TriangleMesh
from ..sampling.frames import TubeFrame, frame_of
from ..sampling.lines import LineGrid
from ..sampling.planes import Planes
from ..sampling.rays import TURN
from .axis import (
    FULL_TURN_ANGLES,
    SAME_PLANE_FRACTION,
    TRIAL_STATIONS,
    Axis,
    find_axis,
    long_direction,
    open_at,
    stations_between,
    symmetry_notes,
    tube_frame,
)
from .curved_axis import CurvedAxis, curved_axis_span, find_curved_axis
from .parametrizations import (
    FaceParametrization,
    Parametrization,
    ParametrizedLines,
    TubeParametrization,
    bounded,
    region_centre,
)
from .spacing import MAX_MOVES, spaced_lines

Vector = tuple[float, float, float]

# [rad] least angle between a u-plane and a v-plane; below, their intersection line is ill-defined. Larger: more planes
# are refused.
MIN_PLANE_ANGLE = np.deg2rad(3.0)
# [degrees] angle between a u-plane and a v-plane below which there is a warning. Larger: more warnings.
WARN_PLANE_ANGLE = 10.0
# [fraction of the coordinates] distance of v-planes from a common point below which they all contain it. Larger: lines
# that are only nearly concurrent start at one point.
CONCURRENCE_TOLERANCE = 1e-9
# [1] length of the mean unit direction below which lines start at an axis (0.95: they span 60 degrees or more). Larger:
# more open grids start at an axis.
MIN_MEAN_DIRECTION = 0.95
# [cosine] between the normal of a mesh face and that of an across grid above which the face belongs to the grid. 60
# degrees is a usual chamfer, so the limit is 61. Larger: the grid ends farther from the rim.
MIN_FACING_COSINE = np.cos(np.deg2rad(61.0))
# [cosine] between the mean normal of the faces and the lines below which the side is ambiguous. Larger: more meshes are
# refused.
MIN_SIDE_COSINE = 0.1
# [fraction of the length of the mesh along the axis] length of a surface with an automatic margin below which there is
# a warning. Larger: more warnings.
MIN_COVERED_LENGTH = 0.85


@dataclass(frozen=True)
class Region:
    """The part of the mesh that a grid covers."""

    axis: Axis | None = None  # None: found from the mesh
    margin: float | None = None  # [m] left free at the ends; None: derived from the mesh
    # Corners of closed loops on the mesh [m], inside which surface and skins stay. They replace the margin.
    boundary: tuple[tuple[Vector, ...], ...] = ()

    def parametrization(self, mesh: TriangleMesh) -> Parametrization:
        """Return the parametrization of this region of ``mesh``."""
        raise NotImplementedError

    def moved(self, before: Parametrization, mesh: TriangleMesh) -> Parametrization:
        """Return the parametrization on a mesh that differs little from an earlier one, about the same axis.

        With a boundary it is the earlier one: a boundary does not depend on the mesh.
        """
        return before if self.boundary else self._about_axis_of(before, mesh)

    def _about_axis_of(self, before: Parametrization, mesh: TriangleMesh) -> Parametrization:
        """Return the parametrization of this region, without a boundary, about the axis of another one."""
        raise NotImplementedError


@dataclass(frozen=True)
class Tube(Region):
    """A full turn about an axis: u-planes are perpendicular to it, lines start at it (paper eq. 10 and 11).

    Without a margin it covers the longest run of complete sections.
    """

    def parametrization(self, mesh: TriangleMesh) -> TubeParametrization:
        """Return stations and angles on ``mesh``."""
        frame = tube_frame(mesh, self.axis)
        if self.boundary:
            return bounded(TubeParametrization(frame, (0.0, 0.0)), self.boundary)
        curved_axis = find_curved_axis(mesh, frame) if self.axis is None else None
        return self._about_axis_of(TubeParametrization(curved_axis or frame, (0.0, 0.0)), mesh)

    def _about_axis_of(self, before: Parametrization, mesh: TriangleMesh) -> TubeParametrization:
        assert isinstance(before, TubeParametrization)
        if isinstance(before.frame, CurvedAxis):
            return replace(before, span=curved_axis_span(mesh, before.frame, self.margin))
        return replace(before, span=stations_between(mesh, before.frame, self.margin, FULL_TURN_ANGLES))


@dataclass(frozen=True)
class Sector(Region):
    """The part of a tube between two half-planes that start from the axis."""

    # [rad] about the axis, from the side of the link's x axis (of its y axis where the tube runs along x)
    start: float = field(kw_only=True)
    stop: float = field(kw_only=True)  # [rad], larger than start

    def parametrization(self, mesh: TriangleMesh) -> TubeParametrization:
        """Return stations and angles on ``mesh``."""
        if not 0 < self.stop - self.start < TURN:
            raise InvalidPlan(
                f"The sector from {self.start:g} to {self.stop:g} rad must span more than 0 and less than 2 pi."
            )
        frame = sector_frame(find_axis(mesh) if self.axis is None else self.axis)
        whole = TubeParametrization(frame, (0.0, 0.0), (self.start, self.stop))
        return bounded(whole, self.boundary) if self.boundary else self._about_axis_of(whole, mesh)

    def _about_axis_of(self, before: Parametrization, mesh: TriangleMesh) -> TubeParametrization:
        assert isinstance(before, TubeParametrization) and isinstance(before.frame, TubeFrame)
        angles = np.linspace(self.start, self.stop, 90)
        return replace(before, span=stations_between(mesh, before.frame, self.margin, angles))


def sector_frame(axis: Axis | TubeFrame) -> TubeFrame:
    """Return the frame about an axis in which the angles of sectors are, from the side of the link's x or y axis."""
    point, direction = (axis.point, axis.e3) if isinstance(axis, TubeFrame) else (axis.point, axis.direction)
    e3, (x_axis, y_axis) = unit(direction), np.eye(3)[:2]
    return frame_of(np.asarray(point, float), e3, y_axis if abs(e3 @ x_axis) > 0.9 else x_axis)


@dataclass(frozen=True)
class Across(Region):
    """A face such as a sole or a palm: two families of parallel planes; control points move along ``normal``.

    The u-planes are perpendicular to the direction of the axis, whose point has no effect. Without an axis they are
    perpendicular to the longer side of the face (see ``axis.long_direction``). Without a margin, 1 % of that side is
    left free at all four sides.
    """

    normal: Vector = field(kw_only=True)  # outward, any length

    def __post_init__(self):
        object.__setattr__(self, "normal", tuple(self.normal))  # hashable

    def parametrization(self, mesh: TriangleMesh) -> FaceParametrization:
        """Return lengths over the faces of ``mesh`` whose normals point along ``normal``."""
        up = unit(self.normal)
        faces = mesh.faces[mesh.face_normals @ up > MIN_FACING_COSINE]
        if len(faces) == 0:
            raise InvalidPlan(f"No mesh face has the outward normal {list(self.normal)}. Reverse or change it.")
        seen = mesh.vertices[np.unique(faces)]
        along = self._along(mesh.vertices[faces], up)
        side = np.cross(up, along)  # along x side = up: r_u x r_v points outward
        x, y = seen @ along, seen @ side
        margin = 0.01 * max(np.ptp(x), np.ptp(y)) if self.margin is None else self.margin
        if min(np.ptp(x), np.ptp(y)) - 2 * margin < SAME_PLANE_FRACTION * mesh.size:
            raise InvalidPlan(f"Margin {margin * 1e3:g} mm leaves nothing of the face. Make it smaller.")
        below = ((mesh.vertices @ up).min() - 0.1 * mesh.size) * up  # rays start inside and go outward
        span, breadth = ((float(c.min() + margin), float(c.max() - margin)) for c in (x, y))
        return bounded(FaceParametrization(below, along, side, up, span, breadth), self.boundary)

    def _about_axis_of(self, before: Parametrization, mesh: TriangleMesh) -> FaceParametrization:
        assert isinstance(before, FaceParametrization)
        return replace(self, axis=axis_along(point_of(before.along))).parametrization(mesh)

    def _along(self, triangles: Array, up: Array) -> Array:
        """Return the unit direction in the face, whose triangles are given, that the u-planes are perpendicular to."""
        if self.axis is not None:
            direction = np.asarray(self.axis.direction, float)
            direction = direction - (direction @ up) * up
            if np.linalg.norm(direction) < np.sin(MIN_PLANE_ANGLE) * np.linalg.norm(self.axis.direction):
                raise InvalidPlan(
                    f"The axis {list(self.axis.direction)} is parallel to the outward normal. Choose one in the face."
                )
            return unit(direction)
        return long_direction(triangles, up)


@dataclass(frozen=True)
class Size:
    """A fixed number of planes and lines."""

    n: int  # u-planes
    lines: int  # lines of control points in each u-plane


@dataclass(frozen=True)
class Tolerance:
    """The fewest planes and lines with a distance from surface to mesh within a tolerance."""

    tolerance: float  # [m]
    measure: str = "mean"  # or "max"


@dataclass(frozen=True)
class Grid:
    """A region, its number of planes and lines, and their spacing."""

    region: Region
    size: Size | Tolerance
    # Of planes and lines; "uniform", "arc" and "curvature" space the lines, with u-planes at equal steps.
    spacing: str = "auto"

    def line_grid(self, mesh: TriangleMesh, degree: tuple[int, int] = (3, 3), draft: bool = False) -> ParametrizedLines:
        """Return the lines of the control points on ``mesh`` for a surface of this degree.

        Parameters
        ----------
        mesh : TriangleMesh
            The mesh, [m] in the link frame.
        degree : (int, int)
            Of the surface along u and v.
        draft : bool
            Whether "auto" places planes and lines fast and not exactly, for a preview.

        Returns
        -------
        ParametrizedLines

        Raises
        ------
        InvalidPlan
            If the grid has a tolerance instead of numbers of planes and lines, or its region is not on the mesh.
        """
        if isinstance(self.size, Tolerance):
            raise InvalidPlan("This grid has a tolerance instead of numbers of planes and lines. Use fit_grid.")
        size = self.size.n, self.size.lines
        parametrization = _parametrization(self.region, mesh)
        lines = spaced_lines(mesh, parametrization, size, degree, self.spacing, 0 if draft else MAX_MOVES)
        return replace(lines, warnings=region_warnings(self.region, parametrization, mesh))

    def moved_lines(self, lines: ParametrizedLines, mesh: TriangleMesh) -> ParametrizedLines:
        """Return lines at the same places on a mesh that differs little from an earlier one, for a preview.

        Neither the axis nor the places with the least error are sought again. At a cut that moves, both hardly change.

        Parameters
        ----------
        lines : ParametrizedLines
            Of this grid, on the earlier mesh.
        mesh : TriangleMesh
            The mesh, [m] in the link frame.

        Raises
        ------
        InvalidPlan, EmptySection
            If the region is not on the mesh.
        """
        parametrization = self.region.moved(lines.parametrization, mesh)
        return lines.moved_to(parametrization, region_centre(mesh, parametrization))


@lru_cache(maxsize=4)  # repeated fits, as in the window, keep the region of their mesh
def _parametrization(region: Region, mesh: TriangleMesh) -> Parametrization:
    return region.parametrization(mesh)


def region_warnings(region: Region, parametrization: Parametrization, mesh: TriangleMesh) -> tuple[Warning, ...]:
    """Return what an author should know about a tube or a sector: its length, and sides that are nearly equal.

    A boundary belongs to the mesh for which it was drawn.
    """
    if region.boundary or not isinstance(region, Tube | Sector):
        return ()
    return (*length_warnings(region, parametrization, mesh), *symmetry_notes(mesh, region.axis))


def length_warnings(region: Region, parametrization: Parametrization, mesh: TriangleMesh) -> tuple[Warning, ...]:
    """Return a warning if the complete sections between the default margins are a short part of the link."""
    if region.margin is not None or region.boundary or not isinstance(parametrization, TubeParametrization):
        return ()
    frame, (first, last) = parametrization.frame, parametrization.span
    if isinstance(frame, CurvedAxis):
        low, high = curved_axis_span(mesh, frame, 0.0)
    else:
        low, high = frame.extent(mesh.vertices)
    covered, length = last - first, high - low
    if covered >= MIN_COVERED_LENGTH * length:
        return ()
    is_first = first - low > high - last
    end, name = (first, "the first u-plane") if is_first else (last, "the last u-plane")
    place = Place(point_of(frame.planes(np.array([end])).points[0]), name)
    beyond = end + (-1 if is_first else 1) * length / TRIAL_STATIONS
    gap = "" if isinstance(frame, CurvedAxis) else open_at(mesh, frame, beyond)
    return (
        Warning(
            "short-surface",
            "warning",
            f"The surface covers {covered * 1e3:.1f} mm of the {length * 1e3:.1f} mm of the mesh along the axis. "
            f"Beyond the end {place.words}, sections are open{gap}.{stray_part(mesh)}",
            place,
            covered / length,
            "Close the hole, cut away the open part, choose another axis, a sector or a face, or give the margin.",
        ),
    )


def TubeGrid(n: int, lines: int, axis: Axis | None = None, margin: float | None = None, spacing: str = "auto") -> Grid:
    """Return a grid over a full turn of a tube; the paper's ``m`` full planes through the axis are ``lines = 2 * m``.

    Parameters
    ----------
    n : int
        Number of u-planes.
    lines : int
        Lines of control points in each u-plane.
    axis : Axis, optional
        Of the tube; by default found from the mesh.
    margin : float, optional
        Left free at the ends [m]; by default derived from the mesh.
    spacing : str
        "auto" places planes and lines where the error is least. "uniform", "arc" and "curvature" space the lines, with
        u-planes at equal steps.

    Returns
    -------
    Grid
    """
    return Grid(Tube(axis, margin), Size(n, lines), spacing)


def SectorGrid(
    n: int,
    lines: int,
    start: float,
    stop: float,
    axis: Axis | None = None,
    margin: float | None = None,
    spacing: str = "auto",
) -> Grid:
    """Return a grid over the sector of a tube between two angles.

    Parameters
    ----------
    n : int
        Number of u-planes.
    lines : int
        Lines of control points in each u-plane.
    start, stop : float
        First and last angle about the axis [rad].
    axis : Axis, optional
        Of the tube; by default found from the mesh.
    margin : float, optional
        Left free at the ends [m]; by default derived from the mesh.
    spacing : str
        "auto" places planes and lines where the error is least. "uniform", "arc" and "curvature" space the lines, with
        u-planes at equal steps.

    Returns
    -------
    Grid
    """
    return Grid(Sector(axis, margin, start=start, stop=stop), Size(n, lines), spacing)


def AcrossGrid(
    n: int,
    lines: int,
    normal: Vector,
    along: Vector | None = None,
    margin: float | None = None,
    spacing: str = "auto",
) -> Grid:
    """Return a grid across a face.

    Parameters
    ----------
    n : int
        Number of u-planes.
    lines : int
        Lines of control points in each u-plane.
    normal : (float, float, float)
        Outward normal of the face, of any length.
    along : (float, float, float), optional
        The u-planes are perpendicular to it; by default the longer side of the face.
    margin : float, optional
        Left free at the ends [m]; by default derived from the mesh.
    spacing : str
        "auto" places planes and lines where the error is least. "uniform", "arc" and "curvature" space the lines, with
        u-planes at equal steps.

    Returns
    -------
    Grid
    """
    return Grid(Across(axis_along(along), margin, normal=normal), Size(n, lines), spacing)


def AutoGrid(
    tolerance: float,
    measure: str = "mean",
    axis: Axis | None = None,
    margin: float | None = None,
    sector: tuple[float, float] | None = None,
    normal: Vector | None = None,
) -> Grid:
    """Return the smallest grid within a tolerance: over a full turn of a tube, in a sector, or across a face.

    Parameters
    ----------
    tolerance : float
        Largest distance from surface to mesh [m].
    measure : "mean" or "max"
        Which distance the tolerance limits.
    axis : Axis, optional
        Of the tube; by default found from the mesh.
    margin : float, optional
        Left free at the ends [m].
    sector : (float, float), optional
        First and last angle about the axis [rad].
    normal : (float, float, float), optional
        Outward normal of a face.

    Returns
    -------
    Grid
        Over a face where ``normal`` is given, over a sector where ``sector`` is, else all round the tube.
    """
    return Grid(region_of(axis, margin, sector, normal), Tolerance(tolerance, measure))


def region_of(
    axis: Axis | None = None,
    margin: float | None = None,
    sector: tuple[float, float] | None = None,
    normal: Vector | None = None,
) -> Region:
    """Return the region with these members, as of ``AutoGrid``."""
    if normal is not None:
        return Across(axis, margin, normal=normal)
    if sector is not None:
        return Sector(axis, margin, start=sector[0], stop=sector[1])
    return Tube(axis, margin)


def axis_along(direction: Vector | None) -> Axis | None:
    """Return an axis through the origin, for regions where only its direction counts; None for None."""
    return None if direction is None else Axis((0.0, 0.0, 0.0), direction)


@dataclass(frozen=True, eq=False)
class PlanesGrid:
    """Planes that the author placed; if ``closed``, each v-plane cuts a section twice and gives two lines."""

    u: Planes
    v: Planes
    closed: bool

    def __eq__(self, other: object) -> bool:
        """Return whether another grid has the same planes, with normals as they were given."""
        if not isinstance(other, PlanesGrid) or self.closed != other.closed:
            return False
        return all(np.array_equal(a, b) for a, b in zip(self._arrays, other._arrays))

    @property
    def _arrays(self) -> tuple[Array, ...]:
        return self.u.points, self.u.directions, self.v.points, self.v.directions

    def line_grid(self, mesh: TriangleMesh, degree: tuple[int, int] = (3, 3), draft: bool = False) -> LineGrid:
        """Return the lines of the control points on ``mesh``; they do not depend on the degree.

        Each line is the intersection of a u-plane and a v-plane, with the direction ``n_u x n_v``.

        Parameters
        ----------
        mesh : TriangleMesh
            The mesh, [m] in the link frame.
        degree : (int, int)
            Without effect.
        draft : bool
            Without effect.

        Returns
        -------
        LineGrid

        Raises
        ------
        InvalidPlan
            If planes are nearly parallel, equal or do not follow each other, or if the side of the faces is ambiguous.
        """
        across = np.cross(self.u.normals[:, None], self.v.normals)
        sine = np.linalg.norm(across, axis=2)
        i, j = np.unravel_index(np.argmin(sine), sine.shape)
        if sine[i, j] < np.sin(MIN_PLANE_ANGLE):
            raise InvalidPlan(
                f"The angle between u-plane {i} and v-plane {j} is only {np.rad2deg(np.arcsin(sine[i, j])):.1f} "
                "degrees. Rotate one of them."
            )
        angle = np.rad2deg(np.arcsin(min(sine[i, j], 1.0)))
        warnings = (_nearly_parallel(int(i), int(j), float(angle)),) if angle < WARN_PLANE_ANGLE else ()
        points = np.array([self._line_points(i) for i in range(len(self.u))])
        order = plane_order(points.mean(axis=1), "u", mesh.size)
        ordered = replace(self, u=self.u.at(order))
        build = ordered._closed_lines if self.closed else ordered._open_lines
        return replace(build(mesh, points[order], unit(across)[order]), warnings=warnings, u_names=named("u", order))

    def _line_points(self, i: int) -> Array:
        """Return the point of each line of u-plane ``i`` nearest to the point with least distances to all v-planes."""
        system = np.vstack((self.u.normals[i] * 1e3, self.v.normals))  # exactly on the u-plane, near the v-planes
        level = np.r_[self.u.points[i] @ self.u.normals[i] * 1e3, (self.v.points * self.v.normals).sum(axis=1)]
        centre = np.linalg.lstsq(system, level, rcond=None)[0]
        if (
            np.abs(((self.v.points - centre) * self.v.normals).sum(axis=1)).max()
            < CONCURRENCE_TOLERANCE * np.abs(self.u.points).max()
        ):
            return np.tile(centre, (len(self.v), 1))  # all lines of this u-plane start from exactly the same point
        points = []
        for point, normal in zip(self.v.points, self.v.normals):
            pair = np.array((self.u.normals[i], normal))
            gap = np.array((self.u.points[i] @ pair[0], point @ normal)) - pair @ centre
            points.append(centre + np.linalg.lstsq(pair, gap, rcond=None)[0])
        return np.array(points)

    def _closed_lines(self, mesh: TriangleMesh, points: Array, across: Array) -> LineGrid:
        if len(self.v) < 2:
            raise InvalidPlan("A closed grid needs at least two v-planes.")
        centres = points.mean(axis=1)  # not the author's points, which may be anywhere in their planes
        along = centres[-1] - centres[0]
        frame = frame_of(centres[0], along if along.any() else self.u.normals[0], across[0, 0])
        points, directions = np.tile(points, (1, 2, 1)), np.concatenate((across, -across), axis=1)
        directions = directions * np.sign((directions * directions[:1]).sum(axis=2, keepdims=True))
        xy = frame.across(directions[0])
        clockwise = -np.arctan2(xy[:, 1], xy[:, 0])  # from the first v-plane, whose own angle is a rounded zero
        order = np.argsort((clockwise + SAME_PLANE_FRACTION) % TURN, kind="stable")
        points, directions, plane = points[:, order], directions[:, order], order % len(self.v)
        ends = points[0] + mesh.size * directions[0]
        same = np.flatnonzero(
            np.linalg.norm(ends - np.roll(ends, -1, axis=0), axis=1) < SAME_PLANE_FRACTION * mesh.size
        )
        if len(same):
            first, second = sorted((plane[same[0]], plane[(same[0] + 1) % len(plane)]))
            raise InvalidPlan(f"v-plane {second} is the same as v-plane {first}. Remove one.")
        return LineGrid(self.u, points, directions, True, tuple(f"v-plane {j}" for j in plane))

    def _open_lines(self, mesh: TriangleMesh, points: Array, across: Array) -> LineGrid:
        starts, directions = self._outward(mesh, points, across)
        order = plane_order((starts + mesh.size * directions).mean(axis=0), "v", mesh.size)
        starts, directions = self._outward(mesh, points[:, order], across[:, order])
        ends, names = starts + mesh.size * directions, named("v", order)
        turn = np.cross(ends[-1, 0] - ends[0, 0], ends[0, -1] - ends[0, 0]) @ directions[0].mean(axis=0)
        if turn < 0:
            starts, directions, names = starts[:, ::-1], directions[:, ::-1], names[::-1]
        return LineGrid(self.u, starts, directions, False, names)

    def _outward(self, mesh: TriangleMesh, points: Array, across: Array) -> tuple[Array, Array]:
        """Return the starts of lines (n, m, 3) [m], behind the mesh, and their directions (n, m, 3) out of it."""
        turned = np.where((across[:, 1:] * across[:, :-1]).sum(axis=2) < 0, -1.0, 1.0)
        directions = across * np.cumprod(np.concatenate((np.ones((len(points), 1)), turned), axis=1), axis=1)[..., None]
        directions = directions * np.sign((directions * directions[:1]).sum(axis=2, keepdims=True))
        middle, mean = mesh.vertices.mean(axis=0), directions.mean(axis=(0, 1))
        if np.linalg.norm(mean) < MIN_MEAN_DIRECTION:  # they start at an axis inside the link
            return points, directions * np.sign((middle - points.mean(axis=(0, 1))) @ mean)
        directions = directions * self._side(mesh, unit(mean))
        return points + (((middle - points) * directions).sum(axis=2) - mesh.size)[..., None] * directions, directions

    @staticmethod
    def _side(mesh: TriangleMesh, mean: Array) -> float:
        """Return 1 where the mean normal of the faces is along the lines, -1 where it is against them."""
        outward = (mesh.face_normals * mesh.face_areas[:, None]).sum(axis=0) / mesh.face_areas.sum()
        side = float(outward @ mean)
        if abs(side) < MIN_SIDE_COSINE:
            raise InvalidPlan("The mesh has faces on both sides of the planes. Cut it so that one side is left.")
        return float(np.sign(side))


def _nearly_parallel(i: int, j: int, angle: float) -> Warning:
    names = f"u-plane {i} and v-plane {j}"
    return Warning(
        "planes-nearly-parallel",
        "warning",
        f"The angle between {names} is only {angle:.1f} degrees. "
        "A small rotation of either plane moves their line far.",
        Place(names=names),
        float(np.deg2rad(angle)),
        "Rotate one of them.",
    )


def plane_order(points: Array, name: str, size: float) -> IntArray:
    """Return the order (k,) in which planes at points (k, 3) [m] follow each other: that of the author if they do."""
    order = np.arange(len(points))
    if _step_back(points).any():
        away = points - points.mean(axis=0)
        along = away @ np.linalg.svd(away)[2][0]
        order = np.argsort(along * (np.sign(along @ (order - order.mean())) or 1.0), kind="stable")
    steps = np.linalg.norm(np.diff(points[order], axis=0), axis=1)
    same, back = np.flatnonzero(steps < SAME_PLANE_FRACTION * size), np.flatnonzero(_step_back(points[order]))
    if len(same) or len(back):
        i = int((*same, *back)[0])
        first, second = (int(k) for k in sorted(order[i : i + 2]))
        relation = "is the same as" if len(same) else "does not lie beyond"
        raise InvalidPlan(
            f"{name}-plane {second} {relation} {name}-plane {first}. {'Remove one.' if len(same) else 'Move one.'}",
            plane=second,
            before=first,
            family=name,
        )
    return order


def _step_back(points: Array) -> BoolArray:
    """Return which steps from point to point (k, 3) go back against the step before, (k - 1,)."""
    steps = np.diff(points, axis=0)
    back: BoolArray = np.append(False, (steps[1:] * steps[:-1]).sum(axis=1) < 0)[: len(steps)]
    return back


def named(family: str, order: IntArray) -> tuple[str, ...]:
    """Return the names of planes in messages, by their places in the lists of the author."""
    return tuple(f"{family}-plane {k}" for k in order)
