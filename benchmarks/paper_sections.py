"""The parts that both readings of the paper's method use: planes, sections, curves, the surface.

The method is that of Sensors 2023, 23, 4569: section 3.4 (Algorithm 1, eqs 3 and 4) and section 4.1 (eqs 10 and 11), on
the tools that it names: trimesh cuts the mesh, NURBS-Python (geomdl) stores the curves and the surface, SciPy solves
for offsets along the lines P_u ∩ P_v. The two readings are ``paper_letter.py``, which does what the text says, and
``paper_strengthened.py``, the best that we found within the method. None of these files imports our package, so that
the comparison does not depend on what is compared. Lengths are in metres.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter

import numpy as np
import trimesh
from geomdl import BSpline, construct, helpers, knotvector
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import ConvexHull

Array = NDArray[np.float64]

SAMPLES_PER_LINE = 5  # samples of the section from one line to the next; four times as many change the mean by < 1 %
MILLIMETRE = 1e-3  # the unit of the nonlinear solve: SciPy's default tolerances suit numbers near one


@dataclass(frozen=True, eq=False)
class PaperFit:
    """The surface of the paper's method, and the time of its fit."""

    surface: BSpline.Surface  # geomdl; clamped uniform knots, no weights; u along the axis, v around it
    control_net: Array  # (n, M + 1, 3), [m]; the last column repeats the first: the clamped seam
    seconds: float  # wall time of the fit, from arrays to surface


@dataclass(frozen=True, eq=False)
class Section:
    """One section curve in coordinates of its plane, with the lines' common origin at zero."""

    origin: Array  # (3,), [m], where the axis crosses the plane
    axes: Array  # (2, 3), unit, the plane's coordinate axes
    directions: Array  # (M + 1, 2), unit, of the lines L_j; the last repeats the first, as it does below
    crossings: Array  # (M + 1, 2), [m], the intersection points Q_j
    samples: Array  # (SAMPLES_PER_LINE * M + 1, 2), [m], equally spaced on the curve from line to line


# From a section, the knots and the degree to the control points of its curve, shape (M + 1, 2), [m].
CurveFit = Callable[[Section, list[float], int], Array]


def planes(
    vertices: ArrayLike, n: int, m: int, axis_point: ArrayLike, axis_direction: ArrayLike, margin: float
) -> tuple[Array, Array]:
    """Place the paper's two sets of planes about an axis given by hand (eqs 10 and 11).

    Parameters
    ----------
    vertices : array, shape (k, 3)
        Vertices of the mesh, [m]; their convex hull gives the axis its length d_L.
    n, m : int
        Number of u planes, across the axis; number of full v planes, through it.
    axis_point, axis_direction : array, shape (3,)
        A point of the axis L, [m], and its direction, of any length.
    margin : float
        The paper's d_offset, [m], left free at both ends so that every section is complete.

    Returns
    -------
    array, shape (n, 2, 3)
        u planes: a point, and the unit normal, along the axis.
    array, shape (2 m, 3, 3)
        v half-planes, counter-clockwise about the axis: a point of their edge (the axis), its unit direction,
        and the unit direction away from it.

    Raises
    ------
    ValueError
        If the axis misses the mesh, or the margins leave nothing of it.
    """
    point, axis = np.asarray(axis_point, float), np.asarray(axis_direction, float)
    axis = axis / np.linalg.norm(axis)
    start, end = axis_in_hull(np.asarray(vertices, float), point, axis)
    if end - start <= 2 * margin:
        raise ValueError(f"two margins of {margin:.4g} m do not fit in the {end - start:.4g} m of the axis in the mesh")
    # Eq. 10 taken literally, d = (d_L - 2 d_offset) / n, has n + 1 ends of steps for n planes and leaves a strip at
    # one end out of the surface. We read it with n - 1: the first and the last plane stand at the margins.
    stations = np.linspace(start + margin, end - margin, n)
    u_planes = np.stack([point + stations[:, None] * axis, np.broadcast_to(axis, (n, 3))], axis=1)
    angles = np.arange(2 * m) * np.pi / m  # eq. 11; a full plane through the axis is two half-planes, pi apart
    e1, e2 = plane_axes(axis)
    outward = np.cos(angles)[:, None] * e1 + np.sin(angles)[:, None] * e2
    return u_planes, np.stack(np.broadcast_arrays(point, axis, outward), axis=1)


def fit_tube(
    vertices: ArrayLike,
    faces: ArrayLike,
    u_planes: ArrayLike,
    v_half_planes: ArrayLike,
    degree: int,
    fit_curve: CurveFit,
) -> PaperFit:
    """Construct the B-spline surface of a closed tube from a mesh and a grid of planes (Algorithm 1).

    Parameters
    ----------
    vertices, faces : array, shapes (k, 3) and (f, 3)
        The mesh, [m], with shared vertices merged.
    u_planes, v_half_planes : array, shapes (n, 2, 3) and (M, 3, 3)
        As from :func:`planes`; the u planes need not be parallel.
    degree : int
        Of the curves and of the surface, in both directions.
    fit_curve : function
        The reading of eq. 4.

    Returns
    -------
    PaperFit
        Control point (i, j) lies on the line u_planes[i] ∩ v_half_planes[j]; every curve starts and ends on Q_0.
        The smoothing factor of section 4.1 is omitted: eqs 3 and 4 do not contain it.

    Raises
    ------
    ValueError
        If a plane has no closed section, or a line does not cross it in the order of the half-planes.
    """
    half_planes = np.asarray(v_half_planes, float)
    began = perf_counter()
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    knots = knotvector.generate(degree, len(half_planes) + 1)
    curves = []
    for point, normal in np.asarray(u_planes, float):
        section = cut(mesh, point, normal, half_planes)
        control_points = section.origin + fit_curve(section, knots, degree) @ section.axes
        curve = BSpline.Curve()
        curve.degree, curve.ctrlpts, curve.knotvector = degree, control_points.tolist(), knots
        curves.append(curve)
    # The surface takes the curves' control points as its net, as in the paper: in u it smooths, it does not fit.
    surface = construct.construct_surface("u", *curves, degree=degree)  # makes clamped uniform knots of its own
    net = np.array(surface.ctrlpts).reshape(len(curves), -1, 3)
    return PaperFit(surface, net, perf_counter() - began)


def on_lines(section: Section, offsets: Array) -> Array:
    """Move the crossings along their lines; Q_0 and Q_M stay, as C(0) = Q_0 and C(1) = Q_M; shape (M + 1, 2), [m]."""
    return section.crossings + np.pad(offsets, 1)[:, None] * section.directions


def axis_in_hull(vertices: Array, point: Array, axis: Array) -> tuple[float, float]:
    """Find where the axis enters and leaves the convex hull, [m] along it from its point."""
    hull = ConvexHull(vertices).equations  # rows a, b: a . x + b <= 0 inside
    slope, height = hull[:, :3] @ axis, hull[:, :3] @ point + hull[:, 3]
    across = np.abs(slope) > 1e-12  # along the other facets the axis stays on one side
    cuts = -height[across] / slope[across]
    start, end = cuts[slope[across] < 0].max(), cuts[slope[across] > 0].min()
    if start >= end or np.any(height[~across] > 0):
        raise ValueError(f"the axis through {point} along {axis} misses the mesh")
    return start, end


def plane_axes(normal: Array) -> Array:
    """Return two unit vectors, shape (2, 3), that make a right-handed frame with a unit normal."""
    e1 = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
    e1 /= np.linalg.norm(e1)
    return np.stack([e1, np.cross(normal, e1)])


def basis(v: Array, knots: list[float], degree: int) -> Array:
    """Evaluate the basis functions with NURBS-Python; shape (len(v), control points), rows sum to one."""
    count, at = len(knots) - degree - 1, v.tolist()
    spans = helpers.find_spans(degree, knots, count, at)
    N = np.zeros((len(v), count))
    for row, span, values in zip(N, spans, helpers.basis_functions(degree, knots, spans, at), strict=True):
        row[span - degree : span + 1] = values
    return N


def cut(mesh: trimesh.Trimesh, point: Array, normal: Array, half_planes: Array) -> Section:
    """Cut the mesh with one u plane, and its section with every v line (Algorithm 1, lines 5 to 13)."""
    edge_point, edge, _ = half_planes[0]
    normal = normal if normal @ edge > 0 else -normal  # so that the lines run counter-clockwise in the plane
    origin = edge_point + edge * (((point - edge_point) @ normal) / (edge @ normal))
    axes = plane_axes(normal)
    path = mesh.section(plane_normal=normal, plane_origin=point)
    if path is None or not any(entity.closed for entity in path.entities):
        raise ValueError(f"the plane at {point} has no closed section; move it away from the end of the mesh")
    loop = outer_loop(path, origin, axes)
    lengths = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(loop, axis=0), axis=1))])
    directions, crossings, stations = [], [], []
    for _, _, outward in half_planes:
        along = axes @ (outward - edge * ((outward @ normal) / (edge @ normal)))  # in both planes, away from the edge
        directions.append(along / np.linalg.norm(along))
        crossing, station = curve_line_intersection(loop, lengths, directions[-1])
        crossings.append(crossing)
        stations.append(station)
    turn = np.append((np.array(stations) - stations[0]) % lengths[-1], lengths[-1])  # arc length from Q_0
    if np.any(np.diff(turn) <= 0):
        raise ValueError(f"the section at {point} does not meet the v lines in their order; it is folded there")
    lines = np.arange(len(turn))
    steps = np.linspace(0, lines[-1], SAMPLES_PER_LINE * lines[-1] + 1)  # 0.5: midway from line 0 to line 1
    at = (stations[0] + np.interp(steps, lines, turn)) % lengths[-1]
    samples = np.column_stack([np.interp(at, lengths, x) for x in loop.T])
    return Section(origin, axes, np.array(directions + directions[:1]), np.array(crossings + crossings[:1]), samples)


def outer_loop(path: trimesh.path.Path3D, origin: Array, axes: Array) -> Array:
    """Project the closed loops to the plane; keep the one of largest area, counter-clockwise; shape (k, 2), [m]."""

    def area(loop: Array) -> float:
        x, y = loop.T
        return 0.5 * np.sum(x[:-1] * y[1:] - x[1:] * y[:-1])

    vertices = (np.asarray(path.vertices) - origin) @ axes.T
    loop = max((vertices[entity.points] for entity in path.entities if entity.closed), key=lambda p: abs(area(p)))
    return loop if area(loop) > 0 else loop[::-1]


def curve_line_intersection(loop: Array, lengths: Array, direction: Array) -> tuple[Array, float]:
    """Cross a closed polyline with the half-line from the origin; the outermost point (2,) and its arc length, [m]."""
    side = direction[0] * loop[:, 1] - direction[1] * loop[:, 0]
    below = side <= 0  # a vertex on the line counts as below: it is met once, not twice or never
    i = np.flatnonzero(below[:-1] != below[1:])
    t = side[i] / (side[i] - side[i + 1])
    hits = loop[i] + t[:, None] * (loop[i + 1] - loop[i])
    distances = hits @ direction
    if not np.any(distances > 0):
        raise ValueError(f"the v line along {direction} does not cross its section; the axis must be inside the mesh")
    k = np.argmax(distances)
    return hits[k], lengths[i[k]] + t[k] * (lengths[i[k] + 1] - lengths[i[k]])
