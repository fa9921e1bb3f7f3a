"""One adapter per peer: other libraries' spline surfaces through the same samples of a mesh.

Every peer gets the samples of our sampler; its time is that of sampling and of its own fit. Each peer gets what is best
for it: periodic bases where it has them, else a repetition of the first column at the end. Where the best choice
depends on the link (chord lengths or even steps as parameters, more samples per span), every variant is measured. A
peer is a function that prepares, which is not timed, and returns the fit, which is timed. Repeated columns and padding
do not count as control points.
"""

import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache, partial
from importlib.util import find_spec
from time import perf_counter

import numpy as np
from links import Array, Fan, Link
from measure import Surface, tensor
from samples import Samples, take
from scipy.interpolate import LSQBivariateSpline, RectBivariateSpline, SmoothBivariateSpline

DEGREE = 3
PAD = 6  # columns repeated on either side of a polar map, for splines without a period
LONGEST_SEARCH = 0.5  # [s] for preparations, which are not timed
TOLERANCES = (0.5, 0.2, 0.1, 0.05)  # [mm] of OpenCASCADE, until it takes too many control points

Fit = Callable[[], Surface]


@dataclass(frozen=True)
class Task:
    """The task of a peer: a net of ``n`` by ``lines`` control points over a region of a link."""

    link: Link
    fan: Fan
    n: int
    lines: int
    per_span: int = 3  # samples, in both directions

    @property
    def rows(self) -> int:
        """Return the number of rows of samples, ``per_span`` for each span."""
        return self.per_span * (self.n - DEGREE) + 1 if self.n > DEGREE + 1 else 2 * self.n

    @property
    def columns(self) -> int:
        """Return the number of columns of samples, ``per_span`` for each span."""
        return self.per_span * self.lines if self.fan.closed else self.per_span * (self.lines - DEGREE) + 1

    def samples(self) -> Samples:
        """Return samples of the mesh for a least-squares fit."""
        return take(self.link, self.fan, self.rows, self.columns)

    def samples_per_control_point(self) -> Samples:
        """Return as many samples as control points, for an interpolation."""
        return take(self.link, self.fan, self.n, self.lines)


def closing(points: Array, closed: bool) -> Array:
    """Append the first column to points of a closed link, for peers without periodic splines."""
    return np.concatenate((points, points[:, :1]), axis=1) if closed else points


def geomdl_approximate(task: Task, centripetal: bool = False) -> Fit:
    """Fit with NURBS-Python's least squares (The NURBS Book, A9.7), in pure Python."""
    from geomdl import fitting

    def fit():
        points = closing(task.samples().points, task.fan.closed)
        rows, columns, _ = points.shape
        surface = fitting.approximate_surface(
            points.reshape(-1, 3).tolist(),
            rows,
            columns,
            DEGREE,
            DEGREE,
            ctrlpts_size_u=task.n,
            ctrlpts_size_v=task.lines + task.fan.closed,
            centripetal=centripetal,
        )
        net = np.array(surface.ctrlpts).reshape(task.n, -1, 3)
        knots = np.array(surface.knotvector_u), np.array(surface.knotvector_v)
        return Surface(tensor(net, *knots, (DEGREE, DEGREE), 1e-3), task.n * task.lines)

    return fit


def occ_approximate(task: Task) -> Fit:
    """Fit with OpenCASCADE's approximation within a tolerance; it selects the number of control points.

    Transposed points, cubic splines and no period of its own give the fewest failures. Of the tolerances that need no
    more control points than the task allows, the smallest is timed; if there is none, the largest.
    """

    from OCP.Approx import Approx_ParametrizationType as Kind
    from OCP.GeomAbs import GeomAbs_Shape
    from OCP.GeomAPI import GeomAPI_PointsToBSplineSurface

    def once(tolerance: float) -> Surface:
        points = closing(task.samples().points, task.fan.closed).swapaxes(0, 1)
        maker = GeomAPI_PointsToBSplineSurface()
        maker.Init(occ_points(points), Kind.Approx_ChordLength, 3, 3, GeomAbs_Shape.GeomAbs_C2, tolerance)
        return occ_surface(maker, task.fan.closed, f"tolerance {tolerance} mm")

    best, began = TOLERANCES[0], perf_counter()
    for tolerance in TOLERANCES:
        if perf_counter() - began > LONGEST_SEARCH or once(tolerance).control_points > task.n * task.lines:
            break
        best = tolerance
    return partial(once, best)


def occ_interpolate(task: Task, periodic: bool) -> Fit:
    """Fit with OpenCASCADE's interpolation; it gets fewer points, as its end conditions add control points."""
    from OCP.GeomAPI import GeomAPI_PointsToBSplineSurface

    periodic = periodic and task.fan.closed
    spare = 3 if periodic else 2

    def fit():
        points = take(task.link, task.fan, task.n - 2, task.lines - (spare if task.fan.closed else 2)).points
        points = points if periodic else closing(points, task.fan.closed)
        maker = GeomAPI_PointsToBSplineSurface()
        maker.Interpolate(occ_points(points.swapaxes(0, 1)), periodic)
        return occ_surface(maker, task.fan.closed)

    return fit


def occ_points(points: Array):
    """Convert points to OpenCASCADE's array."""
    from OCP.collections import Array2_gp_Pnt
    from OCP.gp import gp_Pnt

    rows, columns, _ = points.shape
    table = Array2_gp_Pnt(1, rows, 1, columns)
    for i, row in enumerate(points.tolist(), 1):
        for j, point in enumerate(row, 1):
            table.SetValue(i, j, gp_Pnt(*point))
    return table


def occ_surface(maker, closed: bool, note: str = "") -> Surface:
    """Return OpenCASCADE's surface of transposed points with u along the link again."""
    if not maker.IsDone():
        raise ValueError("OpenCASCADE returned no surface")
    made = maker.Surface()
    if made.IsUPeriodic():
        made.SetUNotPeriodic()
    around, along = made.NbUPoles(), made.NbVPoles()
    poles = ((made.Pole(i, j) for i in range(1, around + 1)) for j in range(1, along + 1))
    net = np.array([[(p.X(), p.Y(), p.Z()) for p in row] for row in poles])
    knots = (
        np.repeat([knot(i) for i in range(1, count + 1)], [multiplicity(i) for i in range(1, count + 1)])
        for knot, multiplicity, count in (
            (made.VKnot, made.VMultiplicity, made.NbVKnots()),
            (made.UKnot, made.UMultiplicity, made.NbUKnots()),
        )
    )
    points = tensor(net, *knots, (made.VDegree(), made.UDegree()), 1e-3)
    return Surface(points, along * (around - closed), note)


def splipy_least_squares(task: Task, chords: bool = False) -> Fit:
    """Fit with splipy's least squares in a basis that is periodic around the link."""
    import splipy
    import splipy.surface_factory

    closed, n, lines = task.fan.closed, task.n, task.lines

    def fit():
        points = task.samples().points
        u, v = chord_parameters(points, closed) if chords else even_parameters(points, closed)
        clamped = np.concatenate((np.zeros(DEGREE), np.linspace(0, 1, n - DEGREE + 1), np.ones(DEGREE)))
        if closed:
            around = splipy.BSplineBasis(DEGREE + 1, np.arange(-DEGREE, lines + DEGREE + 1) / lines, DEGREE - 1)
        else:
            knots = np.concatenate((np.zeros(DEGREE), np.linspace(0, 1, lines - DEGREE + 1), np.ones(DEGREE)))
            around = splipy.BSplineBasis(DEGREE + 1, knots)
        surface = splipy.surface_factory.least_square_fit(
            points, [splipy.BSplineBasis(DEGREE + 1, clamped), around], [u, v]
        )
        return Surface(lambda u, v: 1e-3 * surface(u, v % 1.0 if closed else v), n * lines)

    return fit


def even_parameters(points: Array, closed: bool) -> tuple[Array, Array]:
    """Return parameters at even steps."""
    rows, columns, _ = points.shape
    return np.linspace(0, 1, rows), np.linspace(0, 1, columns, endpoint=not closed)


def chord_parameters(points: Array, closed: bool) -> tuple[Array, Array]:
    """Return parameters by chord length, the mean of all rows and columns (The NURBS Book, A9.3)."""
    along = np.linalg.norm(np.diff(points, axis=0), axis=2).cumsum(axis=0)
    around = np.linalg.norm(np.diff(closing(points, closed), axis=1), axis=2).cumsum(axis=1)
    u, v = (along / along[-1]).mean(axis=1), (around / around[:, -1:]).mean(axis=0)
    v = np.append(0.0, v)
    return np.append(0.0, u), v[:-1] if closed else v


def splinepy_fit(task: Task, centripetal: bool = False) -> Fit:
    """Fit with splinepy's least squares."""
    from splinepy.helpme import fit as maker

    def fit():
        points = closing(task.samples().points, task.fan.closed)
        rows, columns, _ = points.shape
        spline, _ = maker.surface(
            points.swapaxes(0, 1).reshape(-1, 3),  # the first direction runs fastest
            size=[rows, columns],
            degrees=[DEGREE, DEGREE],
            n_control_points=[task.n, task.lines + task.fan.closed],
            centripetal=centripetal,
        )
        net = np.array(spline.control_points).reshape(-1, task.n, 3).swapaxes(0, 1)
        knots = (np.array(k) for k in spline.knot_vectors)
        return Surface(tensor(net, *knots, (DEGREE, DEGREE), 1e-3), task.n * task.lines)

    return fit


@dataclass(frozen=True, eq=False)
class PolarMap:
    """Samples as radii [mm] over the station on the axis and the angle, with some columns repeated on both sides."""

    fan: Fan
    s: Array
    t: Array
    radii: Array

    @classmethod
    def of(cls, samples: Samples) -> "PolarMap":
        """Convert samples; repeat columns where the link is closed."""
        t, radii = samples.t, 1e3 * samples.radii
        if samples.fan.closed:
            turn = samples.fan.turn
            t = np.concatenate((t[-PAD:] - turn, t, t[:PAD] + turn))
            radii = np.concatenate((radii[:, -PAD:], radii, radii[:, :PAD]), axis=1)
        return cls(samples.fan, samples.s, t, radii)

    def scattered(self) -> tuple[Array, Array, Array]:
        """Return stations, angles and radii as three flat arrays."""
        return np.repeat(self.s, len(self.t)), np.tile(self.t, len(self.s)), self.radii.ravel()

    def surface(self, spline, note: str = "") -> Surface:
        """Convert a spline of the radius to a surface; coefficients of the repeated columns do not count."""
        fan = self.fan
        knots_s, knots_t = spline.get_knots()
        if fan.closed:
            around = np.count_nonzero((knots_t > 1e-9) & (knots_t < fan.turn + 1e-9))
        else:
            around = len(knots_t) - DEGREE - 1

        def points(u: Array, v: Array) -> Array:
            return fan.points(u, v * fan.turn, 1e-3 * spline(u, v * fan.turn))

        return Surface(points, (len(knots_s) - DEGREE - 1) * around, note)


def rect_interpolating(task: Task) -> Fit:
    """Fit with SciPy's bivariate spline through as many samples as control points."""

    def fit():
        polar = PolarMap.of(task.samples_per_control_point())
        return polar.surface(RectBivariateSpline(polar.s, polar.t, polar.radii))

    return fit


def smoothed_grid(polar: PolarMap, s: float) -> Surface:
    """Return SciPy's smoothing spline on a grid."""
    return polar.surface(RectBivariateSpline(polar.s, polar.t, polar.radii, s=s), f"s = {s:.3g} mm²")


def smoothed_scatter(polar: PolarMap, s: float) -> Surface:
    """Return SciPy's smoothing spline of scattered points."""
    return polar.surface(SmoothBivariateSpline(*polar.scattered(), s=s), f"s = {s:.3g} mm²")


def rect_smoothing(task: Task) -> Fit:
    """Fit with SciPy's smoothing spline on a grid, with the smoothing that gives no more coefficients than ours."""
    s = smoothing_for(task, smoothed_grid)
    return lambda: smoothed_grid(PolarMap.of(task.samples()), s)


def smooth_scattered(task: Task) -> Fit:
    """Fit with SciPy's smoothing spline of scattered points, with no more coefficients than ours."""
    near = smoothing_for(task, smoothed_grid)  # a call takes up to half a second: only a few are affordable
    s = smoothing_for(task, smoothed_scatter, near / 5, near * 30, 6)
    return lambda: smoothed_scatter(PolarMap.of(task.samples()), s)


def smoothing_for(
    task: Task, fit: Callable[[PolarMap, float], Surface], low: float = 1e-3, high: float = 1e5, rounds: int = 12
) -> float:
    """Find the smallest smoothing [mm²] with no more control points than the task allows, by bisection."""
    polar = PolarMap.of(task.samples())
    for _ in range(rounds):
        middle = float(np.sqrt(low * high))
        few = fit(polar, middle).control_points <= task.n * task.lines
        low, high = (low, middle) if few else (middle, high)
    return high


def lsq_bivariate(task: Task) -> Fit:
    """Fit with SciPy's least-squares spline of scattered points on even knots."""

    def fit():
        polar = PolarMap.of(task.samples())
        knots_s = np.linspace(0, 1, task.n - DEGREE + 1)[1:-1]
        if task.fan.closed:
            step = task.fan.turn / task.lines
            knots_t = np.arange(np.ceil(polar.t[0] / step), np.floor(polar.t[-1] / step) + 1) * step
            knots_t = knots_t[(knots_t > polar.t[0]) & (knots_t < polar.t[-1])]
        else:
            knots_t = np.linspace(0, task.fan.turn, task.lines - DEGREE + 1)[1:-1]
        return polar.surface(LSQBivariateSpline(*polar.scattered(), knots_s, knots_t))

    return fit


@dataclass(frozen=True)
class Peer:
    """A library's fit and its variants: arguments of the fit, and samples per span."""

    module: str
    fit: Callable[..., Fit]
    variants: tuple[tuple[dict, int], ...] = (({}, 3),)
    most: int = 10**6  # control points; a larger net takes many seconds

    def tasks(self, control_points: int) -> Iterator[tuple[str, dict, int]]:
        """Yield the name, the words and the samples per span of each variant; none where it takes too long."""
        if control_points > self.most:
            return
        for words, per_span in self.variants:
            name = ", ".join([f"{key}: {value}" for key, value in words.items()] + [f"{per_span} per span"])
            yield name, words, per_span

    def prepare(self, task: Task, words: dict, per_span: int) -> Fit:
        """Return the fit of one variant, ready to call."""
        return self.fit(replace(task, per_span=per_span), **words)


PEERS = {
    "geomdl": Peer("geomdl", geomdl_approximate),
    "OpenCASCADE approximate": Peer("OCP", occ_approximate),
    "OpenCASCADE interpolate": Peer("OCP", occ_interpolate, (({"periodic": True}, 1), ({"periodic": False}, 1))),
    "splipy": Peer(
        "splipy", splipy_least_squares, tuple(({"chords": chords}, k) for chords in (False, True) for k in (3, 6))
    ),
    "splinepy": Peer("splinepy", splinepy_fit),
    "SciPy Rect, interpolating": Peer("scipy", rect_interpolating, (({}, 1),)),
    "SciPy Rect, smoothing": Peer("scipy", rect_smoothing, (({}, 3), ({}, 6))),
    "SciPy LSQ": Peer("scipy", lsq_bivariate, (({}, 3), ({}, 6))),
    "SciPy Smooth": Peer("scipy", smooth_scattered, most=400),
}


@cache
def installed() -> dict[str, Peer]:
    """Return the installed peers; print a line for each library that is missing."""
    missing = sorted({peer.module for peer in PEERS.values() if find_spec(peer.module) is None})
    for module in missing:
        print(f"{module} is not installed: its surfaces are omitted", file=sys.stderr)
    return {name: peer for name, peer in PEERS.items() if peer.module not in missing}
