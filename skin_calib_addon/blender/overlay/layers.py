# SPDX-License-Identifier: GPL-3.0-or-later
"""Prepare what is drawn of a fitted link: arrays that are computed once for each result."""

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...calibration.model import Patch
from ...common.arrays import ranges
from ...common.colours import GREEN, PINK, SKY, VERMILLION, VIOLET, WHITE, YELLOW
from ...geometry.sampling.planes import Planes, perpendicular
from ...geometry.sampling.sections import cut_sections
from ...geometry.surface.bspline import BSplineSurface
from ...geometry.surface.distance import dense_lines
from ...inspection.all_taxels import AllTaxels
from ...inspection.comparison import Comparison
from ...runtime import Frame
from ...validation import Placement, next_touch
from ...validation.flat import flat_places, normals_at
from ...validation.registration import moves_of
from .scales import Legend, largest_size

# Segments of each curve of the drawn surface. Larger: smoother and slower.
CURVE_POINTS = 96
# Length of a drawn normal relative to the width of a cell, and its minimum relative to the size of the surface.
NORMAL_LENGTH = 0.6
MIN_NORMAL_LENGTH = 0.01
BISECTIONS = 10  # of a segment at the boundary. Larger: it ends nearer to the boundary, and slower
# Height of cells over the surface, relative to their width. Smaller: facets that are outside of the surface hide parts
# of their outlines where the view is oblique.
CELL_LIFT = 0.03
# Distance of a line of control points from its plane, relative to the size of the mesh, above which it has no section.
# Larger: sections of curved lines, which are not planes, are drawn.
MAX_PLANE_DEVIATION = 1e-4
# Length of the mark of the maximum deviation, relative to the size of the mesh. Larger: a larger mark.
MARK_SIZE = 0.08
# [rad] End of the scale of tilts. Larger: cells at an edge, up to 90 degrees, leave one colour to the others.
MAX_TILT = np.deg2rad(45.0)
CONTACT_COLOURS = (VERMILLION, SKY, YELLOW, VIOLET, GREEN)  # by their number, which is written next to them
# Colour and width [pixels] of supporting polygons, and whether they are dashed.
POLYGONS = {"outer": (WHITE, 1.5, True), "nominal": (SKY, 2.5, True), "guaranteed": (GREEN, 4.0, False)}
TOUCHES = {False: (SKY, "touch"), True: (VERMILLION, "touch far from its taxel")}  # the latter are dashed
ARROW_LENGTH, ARROW_HEAD = 1.2, 0.25  # relative to the pitch, and to the arrow. Larger: arrows hide more.
ELLIPSE_POINTS = 49  # of an ellipse. More: smoother
DASH = 0.25  # length of a dash relative to the width of a cell. Larger: short lines have one dash only


@dataclass(eq=False)
class Layer:
    """Lines, or triangles with a colour at each corner, in the link frame.

    The first draw call makes the batch. A layer that no menu controls is always drawn.
    """

    what: str
    points: np.ndarray  # (2 k, 3) ends of segments, or (c, 3) corners, float32 [m]
    colours: np.ndarray | None = None  # (c, 4) float32 of triangles
    indices: np.ndarray | None = None  # (t, 3) int32 of triangles; without them, each three corners are a triangle
    directions: np.ndarray | None = None  # (2 k, 3) float32: added to the points, times ``length``
    length: float = 0.0  # of normals by default [m]
    colour: tuple[float, float, float, float] | None = None  # of lines that no menu controls
    width: float = 1.5  # of these lines [pixels]
    dash: float = 0.0  # length of the dashes of these lines [m]; 0: they are solid
    words: str = ""  # meaning of these lines
    on_top: bool = False  # drawn over everything
    legend: Legend | None = None
    batch: Any = None
    drawn_length: float = 0.0  # length in the batch


@dataclass(eq=False)
class Labels(Layer):
    """Ids and channels of the taxels, at the positions ``points`` (n, 3)."""

    normals: np.ndarray | None = None  # (n, 3) float32
    ids: tuple[str, ...] = ()
    channels: tuple[str, ...] = ()
    order: np.ndarray | None = None  # (n,) rows, those with the highest priority first


class Layers:
    """Layers by name; each is computed when it is first shown, and then kept."""

    def __init__(self, placed: Sequence[Any], taxels: AllTaxels, makers: dict[str, Callable[[], Layer]]):
        self.patches, self.taxels = tuple(done.patch for done in placed), taxels
        self.disabled_patches: tuple[Patch | None, ...] = tuple(done.disabled for done in placed)
        self.surfaces: dict[str, BSplineSurface] = {}  # by their names
        self._makers, self._made = makers, dict[str, Layer]()

    @property
    def with_disabled(self) -> AllTaxels:
        """Return all taxels, the disabled ones last."""
        disabled = [patch for patch in self.disabled_patches if patch is not None]
        return AllTaxels.of((*self.patches, *disabled)) if disabled else self.taxels

    def shown(self, names: Collection[str]) -> Iterator[Layer]:
        """Yield the layers with these names, from the lowest to the highest."""
        for name in self._makers:
            if name in names:
                if name not in self._made:
                    self._made[name] = self._makers[name]()
                yield self._made[name]

    def __iter__(self) -> Iterator[Layer]:
        return self.shown(self._makers)


def layers_of(result: Any, is_preview: bool = False) -> Layers:
    """Return all layers of a result."""
    fits, taxels = tuple(result.fits.values()), AllTaxels.of([done.patch for done in result.placed])
    disabled = AllTaxels.of([done.disabled for done in result.placed if done.disabled is not None])
    layers = Layers(
        result.placed,
        taxels,
        {
            "ERROR": lambda: _error(fits, is_preview),
            "STRAIN": lambda: _strain(taxels),
            "TILT": lambda: _tilt(taxels),
            "UNCERTAINTY": lambda: _uncertainty(taxels),
            "SECTIONS": lambda: Layer("SECTIONS", _single(_each(fits, _sections))),
            "LINES": lambda: Layer("LINES", _single(_each(fits, line_sections))),
            "NET": lambda: Layer("NET", _each(fits, _net)),
            "SURFACE": lambda: Layer("SURFACE", _each(fits, _surface_lines)),
            "CELLS": lambda: Layer("CELLS", _segments(_closed(raised_corners(taxels).astype(np.float32)))),
            **(
                {
                    "DISABLED": lambda: Layer(
                        "DISABLED", crossed_out(disabled), colour=VERMILLION, width=3.0, words="disabled"
                    )
                }
                if disabled.ids
                else {}
            ),
            "NORMALS": lambda: _normals(fits, taxels),
            "LABELS": lambda: labels_of(taxels),
        },
    )
    layers.surfaces = {name: fit.surface for name, fit in result.fits.items()}
    return layers


def _each(fits: Sequence[Any], lines: Callable[[Any], np.ndarray]) -> np.ndarray:
    """Return the lines of all surfaces."""
    return np.concatenate([lines(fit) for fit in fits])


def _sections(fit: Any) -> np.ndarray:
    """Return the sections of the u-planes and the cover."""
    return inside(fit, cut_sections(fit.mesh, fit.lines.planes_u).ends)


def inside(fit: Any, ends: np.ndarray) -> np.ndarray:
    """Return the parts of segments inside the boundary of the region; without a boundary, all."""
    region = fit.lines.region
    if region is None or not len(ends):
        return ends
    lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    count = np.ceil(lengths * CURVE_POINTS / fit.mesh.size).astype(int).clip(1)
    part = ranges(0, count) / np.repeat(count, count)
    start, step = np.repeat(ends[:, 0], count, axis=0), np.repeat((ends[:, 1] - ends[:, 0]), count, axis=0)
    pieces = np.stack((start + part[:, None] * step, start + (part + np.repeat(1 / count, count))[:, None] * step), 1)
    is_in = region(pieces)
    kept, is_in = pieces[is_in.any(axis=1)], is_in[is_in.any(axis=1)]
    rows, outer = np.nonzero(~is_in)
    near, far = kept[rows, 1 - outer], kept[rows, outer]
    for _ in range(BISECTIONS):
        middle = (near + far) / 2
        is_near = region(middle)[:, None]
        near, far = np.where(is_near, middle, near), np.where(is_near, far, middle)
    kept[rows, outer] = near
    return kept


def _net(fit: Any) -> np.ndarray:
    """Return the lines between the control points."""
    net = fit.surface.control_net
    return np.concatenate((_segments(net), _segments(net.transpose(1, 0, 2))))


def _error(fits: Sequence[Any], is_preview: bool) -> Layer:
    """Return the surfaces, coloured by the distances from surface to mesh that the errors of the fits state.

    For a preview, the colours are those of the distances at the samples of the fit to the planes of the facets.
    """
    grids = [(_sampled_errors if is_preview else _errors)(fit) for fit in fits]
    errors = np.concatenate([values.ravel() for _, values in grids])
    note = "dark grey: no mesh there" if np.isnan(errors).any() else ""
    legend = Legend("Distance to the mesh", "LENGTH", largest_size(errors), note=note)
    parts = [_coloured(fit, *grid, legend) for fit, grid in zip(fits, grids)]
    points, colours, triangles = zip(*parts)
    starts = np.cumsum([0, *map(len, points)])
    indices = np.concatenate([part + start for part, start in zip(triangles, starts)]).astype(np.int32)
    return Layer("ERROR", np.concatenate(points), np.concatenate(colours), indices, legend=legend)


def _errors(fit: Any) -> tuple[np.ndarray, np.ndarray]:
    """Return a grid of points of a surface (a, b, 3), and their distances to the mesh (a, b) [m]."""
    u, v = dense_lines(fit.surface)
    errors = fit.deviations.reshape(len(u), len(v))
    # Samples are in the middle of their cells: the colour of the outermost ones extends to the edges.
    u, v = np.array((0, *u, 1)), np.array((*v, v[0]) if fit.lines.closed else (0, *v, 1))
    errors = np.concatenate((errors[:1], errors, errors[-1:]))
    before = errors[:, :0] if fit.lines.closed else errors[:, :1]
    errors = np.hstack((before, errors, errors[:, :1] if fit.lines.closed else errors[:, -1:]))
    points = fit.surface.grid_points(u, v)
    # The maximum is between the samples: the point next to it moves there.
    at, peak, distance = fit.worst
    i, j = np.abs(u - at[0]).argmin(), np.abs(v - at[1]).argmin()
    columns = [0, -1] if fit.lines.closed and j in (0, len(v) - 1) else [j]
    points[i, columns], errors[i, columns] = peak, distance
    return points, errors


def _sampled_errors(fit: Any) -> tuple[np.ndarray, np.ndarray]:
    """Return the same at the samples of the fit, where the distances are those to the planes of the facets."""
    samples = fit.samples
    slopes = np.abs(np.einsum("klc,klc->kl", samples.rays, fit.mesh.face_normals[samples.faces]))
    points, errors = samples.origins + samples.arms, np.abs(samples.residuals) * slopes
    if fit.lines.closed:
        points, errors = np.hstack((points, points[:, :1])), np.hstack((errors, errors[:, :1]))
    return points, errors


def _coloured(
    fit: Any, points: np.ndarray, errors: np.ndarray, legend: Legend
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return points of one surface, their colours by its errors, and triangles between them."""
    corners = np.arange(errors.size, dtype=np.int32).reshape(errors.shape)
    a, b, c, d = corners[:-1, :-1], corners[1:, :-1], corners[1:, 1:], corners[:-1, 1:]
    triangles = np.stack((a, b, c, a, c, d), axis=2).reshape(-1, 3)
    points = points.reshape(-1, 3)
    if fit.lines.region is not None:
        triangles = triangles[fit.lines.region(points)[triangles].any(axis=1)]
    return _single(points), legend.colours(errors).reshape(-1, 4), triangles


def _strain(taxels: AllTaxels) -> Layer:
    values = taxels.stretch
    note = "dark grey: boards do not stretch" if np.isnan(values).any() else ""
    return heat_layer("STRAIN", taxels, values, Legend("Strain", "FRACTION", largest_size(values), True, note))


def _tilt(taxels: AllTaxels) -> Layer:
    note = "dark grey: no neighbour" if np.isnan(taxels.tilt).any() else ""
    largest = largest_size(taxels.tilt)
    legend = Legend("Tilt to a neighbour", "ANGLE", min(largest, MAX_TILT), note=note, exceeded=largest > MAX_TILT)
    return heat_layer("TILT", taxels, taxels.tilt, legend)


def _uncertainty(taxels: AllTaxels) -> Layer:
    along = taxels.sigma[:, 0]
    note = "dark grey: unknown" if np.isnan(along).any() else ""
    legend = Legend("Uncertainty along the surface", "LENGTH", largest_size(along), note=note)
    return heat_layer("UNCERTAINTY", taxels, along, legend)


def heat_layer(what: str, taxels: AllTaxels, values: np.ndarray, legend: Legend) -> Layer:
    """Return the cells, filled with the colours of values."""
    points, triangles = fans(taxels)
    colours = np.repeat(legend.colours(values), taxels.corners.shape[1] + 1, axis=0)
    return Layer(what, points, colours, triangles, legend=legend)


def fans(taxels: AllTaxels) -> tuple[np.ndarray, np.ndarray]:
    """Return the position of each taxel with the corners of its cell, and triangles between them.

    Cells can be curved.
    """
    n, k = taxels.corners.shape[:2]
    middles = taxels.positions + CELL_LIFT * taxels.width * taxels.normals
    points = np.concatenate((middles[:, None], raised_corners(taxels)), axis=1)
    side = np.arange(k)
    fan = np.column_stack((np.zeros(k, int), 1 + side, 1 + (side + 1) % k))
    triangles = (np.arange(n)[:, None, None] * (k + 1) + fan).reshape(-1, 3)
    return _single(points), np.ascontiguousarray(triangles, np.int32)


def raised_corners(taxels: AllTaxels) -> np.ndarray:
    """Return the corners of the cells over the surface, so that it does not hide the straight lines between them.

    On a sphere of radius r the corners of a square of side a are a^2 / 4r below its middle, and the middles of its
    sides half of that below the surface. Cells are raised by the first height, and by ``CELL_LIFT``.
    """
    below = np.einsum("nk,nk->n", taxels.positions - taxels.corners.mean(axis=1), taxels.normals)
    height = CELL_LIFT * taxels.width + np.maximum(below, 0.0)
    return taxels.corners + (height[:, None] * taxels.normals)[:, None]


def line_sections(fit: Any) -> np.ndarray:
    """Return the sections of the planes of the v-lines and the cover inside the boundary, shape (s, 2, 3) [m].

    Half-planes have only the sections of their side.
    """
    origins, directions = fit.lines.origins, fit.lines.directions
    fans_out = bool((origins == origins[:, :1]).all())
    found = [np.empty((0, 2, 3))]
    for start, outward in zip(origins.transpose(1, 0, 2), directions.transpose(1, 0, 2)):
        spread = np.concatenate((start - start[0], start + fit.mesh.size * outward - start[0]))
        normal = np.linalg.svd(spread, full_matrices=False)[2][2]
        if np.abs(spread @ normal).max() > MAX_PLANE_DEVIATION * fit.mesh.size:
            continue
        ends = cut_sections(fit.mesh, Planes(start[:1], normal[None])).ends
        if fans_out:
            middle = ends.mean(axis=1)
            nearest = np.abs((middle[:, None] - start) @ fit.lines.planes_u.normals.mean(axis=0)).argmin(axis=1)
            ends = ends[((middle - start[nearest]) * outward[nearest]).sum(axis=1) > 0]
        found.append(ends)
    return inside(fit, np.concatenate(found))


def _surface_lines(fit: Any) -> np.ndarray:
    """Return curves of constant u and of constant v, inside the boundary."""
    fine = np.linspace(0, 1, CURVE_POINTS + 1)
    n, m = fit.lines.origins.shape[:2]
    around = fit.surface.grid_points(np.linspace(0, 1, n), fine)
    along = fit.surface.grid_points(fine, np.linspace(0, 1, m + 1)).transpose(1, 0, 2)
    segments = np.concatenate((_segments(around), _segments(along)))
    return _single(inside(fit, segments.reshape(-1, 2, 3)))


def _normals(fits: Sequence[Any], taxels: AllTaxels) -> Layer:
    size = max(float(np.linalg.norm(np.ptp(fit.surface.control_net.reshape(-1, 3), axis=0))) for fit in fits)
    length = max(NORMAL_LENGTH * taxels.width, MIN_NORMAL_LENGTH * size)
    directions = np.stack((np.zeros_like(taxels.normals), taxels.normals), axis=1)
    return Layer(
        "NORMALS", _single(np.repeat(taxels.positions, 2, axis=0)), directions=_single(directions), length=length
    )


def labels_of(taxels: AllTaxels) -> Labels:
    """Return labels of the taxels; those in every second, fourth... row and column have the highest priority."""
    index = taxels.index.astype(np.int64)
    rank = np.minimum(*(np.where(k == 0, 16, np.log2(np.maximum(k & -k, 1))) for k in np.abs(index).T))
    return Labels(
        "LABELS",
        _single(taxels.positions),
        normals=_single(taxels.normals),
        ids=taxels.ids,
        channels=tuple(map(str, taxels.channels.tolist())),
        order=np.argsort(-rank, kind="stable"),
    )


def mark_of(taxels: AllTaxels, row: int) -> tuple[Layer, ...]:
    """Return the outlines of a taxel and of its neighbours, and the taxel's normal."""
    corners = _closed(raised_corners(taxels))
    neighbours = [taxels.rows[name] for name in taxels.neighbours[row] if name in taxels.rows]
    tip = taxels.positions[row] + 1.5 * taxels.width * taxels.normals[row]
    stick = np.stack((taxels.positions[row], tip))
    return (
        Layer(
            "MARKED", _segments(corners[neighbours]), colour=YELLOW, width=3.0, words=f"neighbours of {taxels.ids[row]}"
        ),
        Layer("MARKED", _segments(corners[row : row + 1]), colour=PINK, width=4.5, words=taxels.ids[row]),
        Layer("MARKED", _single(stick), colour=PINK, width=3.0),
    )


def crossed_out(taxels: AllTaxels) -> np.ndarray:
    """Return the outlines of cells, and lines from their middles to their corners."""
    corners = raised_corners(taxels)
    arms = np.stack((np.broadcast_to(corners.mean(axis=1, keepdims=True), corners.shape), corners), axis=2)
    return np.concatenate((_segments(_closed(corners)), _single(arms)))


def maximum_of(fit: Any) -> Layer:
    """Return the mark of the maximum deviation of surface from mesh: a cross, and a line along the normal."""
    uv, point, _ = fit.worst
    lines = _cross(point, fit.surface.normals(uv[None])[0], MARK_SIZE * fit.mesh.size)
    return Layer("MAXIMUM", _single(lines), colour=PINK, width=4.0, on_top=True)


def place_of(point: Any, size: float) -> Layer:
    """Return the mark of a warning's place: three lines through the point, over everything."""
    arms = MARK_SIZE * size / 2 * np.eye(3)
    lines = np.asarray(point, float) + np.stack((-arms, arms), axis=1)
    return Layer("PLACE", _single(lines), colour=PINK, width=4.0, on_top=True)


def comparison_of(taxels: AllTaxels, found: Comparison) -> tuple[Layer, ...]:
    """Return lines from each taxel to its own in the file, and the outline of the taxel with the largest distance."""
    farthest = taxels.rows[found.worst]
    return (
        Layer("COMPARED", _single(found.ends), colour=PINK, width=3.0, words="to the taxel of the file"),
        Layer("COMPARED", _segments(_closed(raised_corners(taxels)[farthest : farthest + 1])), colour=PINK, width=3.0),
    )


def touches_of(found: Sequence[Placement]) -> tuple[Layer, ...]:
    """Return lines from the taxels to the points of their touches; those that are far away are dashed."""
    layers = []
    for placement in found:
        ends = np.stack((placement.patch.taxels.positions_link[placement.rows], placement.places), axis=1)
        far = np.isin(np.arange(len(ends)), placement.outliers)
        for is_far, (colour, words) in TOUCHES.items():
            if (far == is_far).any():
                dash = is_far * DASH * min(placement.patch.pitch)
                layers.append(
                    Layer("TOUCHED", _single(ends[far == is_far]), colour=colour, width=3.0, dash=dash, words=words)
                )
        layers += [*_forces_of(placement), *_motion_of(placement)]
    return tuple(layers)


def _forces_of(placement: Placement) -> Iterator[Layer]:
    """Yield arrows of the forces of touches and of the normals there, which begin at the same point if forces push."""
    pushed = placement.directions.any(axis=1)
    if pushed.any():
        forces, places = placement.directions[pushed], placement.places[pushed]
        normals, length = normals_at(placement.patch, places), ARROW_LENGTH * min(placement.patch.pitch)
        into = np.where((forces * normals).sum(axis=1) < 0, -1.0, 1.0)[:, None]
        outer = places + length * into * forces
        ends = np.stack((np.where(into < 0, outer, places), np.where(into < 0, places, outer)), axis=1)
        yield Layer("FORCES", _single(_arrows(ends)), colour=PINK, width=2.0, words="force")
        ends = np.stack((places, places + length * normals), axis=1)
        yield Layer("TOUCHED_NORMALS", _single(_arrows(ends)), colour=GREEN, width=2.0, words="normal")


def _arrows(ends: np.ndarray) -> np.ndarray:
    """Return the segments (3 n, 2, 3) of arrows from the first to the second of their ends (n, 2, 3)."""
    along = ends[:, 1] - ends[:, 0]
    aside = np.array([perpendicular(a) for a in along]) * np.linalg.norm(along, axis=1, keepdims=True)
    sides = [ends[:, 1] - ARROW_HEAD * along + sign * ARROW_HEAD / 2 * aside for sign in (1, -1)]
    return np.concatenate((ends, *(np.stack((ends[:, 1], side), axis=1) for side in sides)))


def _motion_of(placement: Placement) -> Iterator[Layer]:
    """Yield ellipses of two standard errors where touches say that some cells are, and the cell to touch next."""
    patch, found = placement.patch, placement.posterior
    flat, taxels = flat_places(patch, patch.taxels.index), AllTaxels.of([patch])
    if found is not None and placement.is_explained:
        middle = flat.mean(axis=0)
        ends = [(flat @ direction).argmax() for direction in ((1, 1), (1, -1), (-1, 1), (-1, -1))]
        rows = np.unique([*ends, ((flat - middle) ** 2).sum(axis=1).argmin()])
        moves, angles = moves_of(flat[rows]), np.linspace(0, 2 * np.pi, ELLIPSE_POINTS)
        values, axes = np.linalg.eigh(moves @ found.covariance @ moves.transpose(0, 2, 1))
        circle = 2 * np.stack((np.cos(angles), np.sin(angles)))
        offsets = (moves @ found.mean)[..., None] + axes * np.sqrt(np.maximum(values, 0))[:, None] @ circle
        points = np.einsum("nkp,nkc->npc", offsets, patch.taxels.axes_link[rows])
        points += (taxels.positions + CELL_LIFT * taxels.width * taxels.normals)[rows, None]
        yield Layer("ELLIPSES", _segments(points), colour=YELLOW, width=2.5, words="2 standard errors")
    if (following := next_touch(placement)) is not None:
        outline = _closed(raised_corners(taxels)[following.row : following.row + 1])
        yield Layer("NEXT", _segments(outline), colour=VIOLET, width=4.5, words="touch next")


def replay_lines(taxels: AllTaxels, frame: Frame) -> tuple[Layer, ...]:
    """Return the lines of a frame of a recording: contacts with positions, CoP and supporting polygons."""
    layers: list[Layer] = [
        Layer(
            "CONTACTS",
            _single(taxels.outline(c.taxels)),
            colour=CONTACT_COLOURS[c.number % len(CONTACT_COLOURS)],
            width=3.5,
        )
        for c in frame.contacts
    ]
    located = [c for c in frame.contacts if c.normal.any()]
    if located:
        crosses = [_cross(c.position, c.normal, taxels.width) for c in located]
        layers.append(Layer("COP", _single(np.concatenate(crosses)), colour=WHITE, width=2.5, words="contact"))
        numbers = tuple(str(c.number) for c in located)
        tips = np.array([c.position + 1.4 * taxels.width * c.normal for c in located])
        layers.append(
            Labels(
                "NUMBERS",
                _single(tips),
                normals=_single(np.array([c.normal for c in located])),
                ids=numbers,
                channels=numbers,
                order=np.arange(len(located)),
            )
        )
    ground = frame.ground
    if ground is not None:
        for name, (colour, width, is_dashed) in POLYGONS.items():
            loop = ground.plane.spatial(getattr(frame.polygon, name).corners)
            ends, dash = np.stack((loop, np.roll(loop, -1, axis=0)), axis=1), is_dashed * DASH * taxels.width
            style = {"colour": colour, "width": width, "dash": dash, "words": f"{name} polygon", "on_top": True}
            layers.append(Layer("POLYGONS", _single(ends), **style))
        if frame.cop is not None:
            mark = _cross(ground.plane.spatial(frame.cop), -ground.plane.axes[2], taxels.width)
            layers.append(Layer("COP", _single(mark), colour=PINK, width=4.0, words="CoP", on_top=True))
    return tuple(layers)


def dashed(points: np.ndarray, dash: float) -> np.ndarray:
    """Return the ends (2 k, 3) of dashes of about ``dash`` [m] in segments (2 s, 3), which begin and end with one."""
    ends = points.reshape(-1, 2, 3)
    count = (np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) / (2 * dash)).astype(int)
    which, k = np.repeat(np.arange(len(ends)), count + 1), ranges(0, count + 1)
    at = np.stack((2 * k, 2 * k + 1), axis=1) / (2 * count + 1)[which, None]
    return _single(ends[which, :1] + at[..., None] * (ends[which, 1:] - ends[which, :1]))


def _cross(position: np.ndarray, normal: np.ndarray, size: float) -> np.ndarray:
    """Return segments (3, 2, 3): a cross at a point, and a line from there along the normal."""
    a = perpendicular(normal)
    b = np.cross(normal, a)
    half = size / 3
    return np.stack(
        (
            (position - half * a, position + half * a),
            (position - half * b, position + half * b),
            (position, position + size * normal),
        )
    )


def _closed(corners: np.ndarray) -> np.ndarray:
    return np.concatenate((corners, corners[:, :1]), axis=1)


def _segments(polylines: np.ndarray) -> np.ndarray:
    """Return the ends of the segments of polylines (k, p, 3), shape (2 k (p - 1), 3), in the order of the GPU."""
    return _single(np.stack((polylines[:, :-1], polylines[:, 1:]), axis=2))


def _single(points: np.ndarray) -> np.ndarray:
    """Return points (..., 3) in the data type of the GPU."""
    return np.ascontiguousarray(points.reshape(-1, 3), np.float32)
