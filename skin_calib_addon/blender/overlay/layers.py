# SPDX-License-Identifier: GPL-3.0-or-later
"""What is drawn of a fitted link, as arrays prepared once for each result."""

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...calibration.model import Patch
from ...geometry.sampling.planes import Planes, perpendicular
from ...geometry.sampling.sections import cut_sections
from ...inspection.all_taxels import AllTaxels
from ...inspection.comparison import Comparison
from ...runtime import Frame
from ...validation import Placement
from .scales import Legend, most_of

CURVE_POINTS = 96
# Normals are drawn as long as this share of a cell is wide, and not shorter than this share of the surface's size.
LONG, SHORTEST = 0.6, 0.01
# Filled cells are lifted by this share of their width: flat as they are, they would sink into a bent surface.
LIFT = 0.03
# Lines of control points that leave a plane by more than this share of the mesh's size have no section.
FLAT = 1e-4
WHITE, PINK = (1.0, 1.0, 1.0, 1.0), (1.0, 0.2, 0.8, 1.0)
# Of contacts by their number, and of supporting polygons.
INKS = ((1.0, 0.3, 0.2, 1.0), (0.2, 0.8, 1.0, 1.0), (1.0, 0.8, 0.1, 1.0), (0.9, 0.4, 1.0, 1.0), (0.4, 1.0, 0.4, 1.0))
POLYGONS = {"outer": (0.7, 0.75, 0.8, 1.0), "nominal": (0.15, 0.45, 1.0, 1.0), "guaranteed": (0.15, 0.8, 0.3, 1.0)}


@dataclass(eq=False)
class Layer:
    """Segments, or triangles with a colour at each corner, in the link frame; the batch is made in the first draw call.

    What no menu names is drawn as long as it is handed over.
    """

    what: str
    points: np.ndarray  # (2 k, 3) ends of segments, or (c, 3) corners, float32 [m]
    colours: np.ndarray | None = None  # (c, 4) float32 of triangles
    indices: np.ndarray | None = None  # (t, 3) int32 of triangles; without them each three corners are one
    ways: np.ndarray | None = None  # (2 k, 3) float32: what is added to the points for each metre of ``length``
    length: float = 0.0  # of normals, if the author wants no other [m]
    colour: tuple[float, float, float, float] | None = None  # of lines that no menu names
    width: float = 1.5  # of these lines [pixels]
    on_top: bool = False  # whether nothing hides it
    legend: Legend | None = None
    batch: Any = None
    drawn_length: float = 0.0  # with which the batch was made


@dataclass(eq=False)
class Labels(Layer):
    """Names of the taxels, to be written at their places, the points (n, 3)."""

    normals: np.ndarray | None = None  # (n, 3) float32
    ids: tuple[str, ...] = ()
    channels: tuple[str, ...] = ()
    order: np.ndarray | None = None  # (n,) rows, those first that stay when not all have room


class Layers:
    """Layers by name; each is made when it is first shown, and then kept."""

    def __init__(self, patches: Sequence[Patch], taxels: AllTaxels, makers: dict[str, Callable[[], Layer]]):
        self.patches, self.taxels = patches, taxels
        self._makers, self._made = makers, dict[str, Layer]()

    def shown(self, names: Collection[str]) -> Iterator[Layer]:
        """Those that are asked for, in the order in which they lie over each other."""
        for name in self._makers:
            if name in names:
                if name not in self._made:
                    self._made[name] = self._makers[name]()
                yield self._made[name]

    def __iter__(self) -> Iterator[Layer]:
        return self.shown(self._makers)


def layers_of(result: Any) -> Layers:
    """Everything that can be drawn of a result, or of what has a ``fit`` and a ``calibration`` with patches."""
    fit, taxels = result.fit, AllTaxels.of(result.calibration.patches)
    return Layers(
        result.calibration.patches,
        taxels,
        {
            "ERROR": lambda: _error(fit),
            "STRAIN": lambda: _strain(taxels),
            "TILT": lambda: _tilt(taxels),
            "SECTIONS": lambda: Layer("SECTIONS", _single(cut_sections(fit.mesh, fit.lines.planes_u).ends)),
            "LINES": lambda: Layer("LINES", _single(line_sections(fit))),
            "NET": lambda: Layer("NET", np.concatenate(_crossing(fit.surface.control_net))),
            "SURFACE": lambda: _surface_lines(fit),
            "CELLS": lambda: Layer("CELLS", _segments(_closed(taxels.corners))),
            "NORMALS": lambda: _normals(fit, taxels),
            "LABELS": lambda: labels_of(taxels),
        },
    )


def _error(fit: Any) -> Layer:
    """The surface, coloured by how far the mesh is from it along the rays of the fit."""
    off = np.abs(fit.residuals)
    if fit.lines.closed:
        off = np.hstack((off, off[:, :1]))
    note = "grey: no mesh there" if np.isnan(off).any() else ""
    legend = Legend("Error along the rays", "LENGTH", most_of(off), note=note)
    grid = fit.surface.grid_points(np.linspace(0, 1, off.shape[0]), np.linspace(0, 1, off.shape[1]))
    corners = np.arange(off.size, dtype=np.int32).reshape(off.shape)
    a, b, c, d = corners[:-1, :-1], corners[1:, :-1], corners[1:, 1:], corners[:-1, 1:]
    triangles = np.stack((a, b, c, a, c, d), axis=2).reshape(-1, 3)
    return Layer("ERROR", _single(grid), legend.colours(off).reshape(-1, 4), triangles, legend=legend)


def _strain(taxels: AllTaxels) -> Layer:
    values = taxels.stretch
    note = "grey: boards do not stretch" if np.isnan(values).any() else ""
    return heat_layer("STRAIN", taxels, values, Legend("Strain", "SHARE", most_of(values), True, note))


def _tilt(taxels: AllTaxels) -> Layer:
    note = "grey: no neighbour" if np.isnan(taxels.tilt).any() else ""
    return heat_layer(
        "TILT", taxels, taxels.tilt, Legend("Tilt to a neighbour", "ANGLE", most_of(taxels.tilt), False, note)
    )


def heat_layer(what: str, taxels: AllTaxels, values: np.ndarray, legend: Legend) -> Layer:
    """The cells, filled with the colours of values (n,)."""
    points, triangles = fans(taxels)
    return Layer(what, points, heat_colours(taxels, values, legend), triangles, legend=legend)


def fans(taxels: AllTaxels) -> tuple[np.ndarray, np.ndarray]:
    """Corners of the cells, each after the place of its taxel, and triangles between them: cells may be bent."""
    n, k = taxels.corners.shape[:2]
    points = np.concatenate((taxels.positions[:, None], taxels.corners), axis=1)
    points = points + LIFT * taxels.width * taxels.normals[:, None]
    side = np.arange(k)
    fan = np.column_stack((np.zeros(k, int), 1 + side, 1 + (side + 1) % k))
    triangles = (np.arange(n)[:, None, None] * (k + 1) + fan).reshape(-1, 3)
    return _single(points), np.ascontiguousarray(triangles, np.int32)


def heat_colours(taxels: AllTaxels, values: np.ndarray, legend: Legend) -> np.ndarray:
    """Colours for the points of :func:`fans`."""
    return np.repeat(legend.colours(values), taxels.corners.shape[1] + 1, axis=0)


def line_sections(fit: Any) -> np.ndarray:
    """Where the planes of the v-lines cut the cover, shape (s, 2, 3) [m]; of half-planes only their side."""
    origins, directions = fit.lines.origins, fit.lines.directions
    fans_out = bool((origins == origins[:, :1]).all())
    found = [np.empty((0, 2, 3))]
    for start, ways in zip(origins.transpose(1, 0, 2), directions.transpose(1, 0, 2)):
        spread = np.concatenate((start - start[0], start + fit.mesh.size * ways - start[0]))
        normal = np.linalg.svd(spread, full_matrices=False)[2][2]
        if np.abs(spread @ normal).max() > FLAT * fit.mesh.size:
            continue
        ends = cut_sections(fit.mesh, Planes(start[:1], normal[None])).ends
        if fans_out:
            middle = ends.mean(axis=1)
            nearest = np.abs((middle[:, None] - start) @ fit.lines.planes_u.normals.mean(axis=0)).argmin(axis=1)
            ends = ends[((middle - start[nearest]) * ways[nearest]).sum(axis=1) > 0]
        found.append(ends)
    return np.concatenate(found)


def _surface_lines(fit: Any) -> Layer:
    """Curves of constant u and v."""
    fine = np.linspace(0, 1, CURVE_POINTS + 1)
    n, m = fit.lines.origins.shape[:2]
    around = fit.surface.grid_points(np.linspace(0, 1, n), fine)
    along = fit.surface.grid_points(fine, np.linspace(0, 1, m + 1)).transpose(1, 0, 2)
    return Layer("SURFACE", np.concatenate((_segments(around), _segments(along))))


def _normals(fit: Any, taxels: AllTaxels) -> Layer:
    size = float(np.linalg.norm(np.ptp(fit.surface.control_net.reshape(-1, 3), axis=0)))
    length = max(LONG * taxels.width, SHORTEST * size)
    ways = np.stack((np.zeros_like(taxels.normals), taxels.normals), axis=1)
    return Layer("NORMALS", _single(np.repeat(taxels.positions, 2, axis=0)), ways=_single(ways), length=length)


def labels_of(taxels: AllTaxels) -> Labels:
    """Ids and channels of the taxels; every second, fourth, ... row and column stays longest."""
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
    """The outlines of a taxel and of its neighbours, and the taxel's normal."""
    corners = _closed(taxels.corners)
    beside = [taxels.rows[name] for name in taxels.neighbours[row] if name in taxels.rows]
    tip = taxels.positions[row] + 1.5 * taxels.width * taxels.normals[row]
    stick = np.stack((taxels.positions[row], tip))
    return (
        Layer("MARKED", _segments(corners[beside]), colour=(1.0, 0.75, 0.1, 1.0), width=3.0),
        Layer("MARKED", _segments(corners[row : row + 1]), colour=(0.1, 1.0, 1.0, 1.0), width=4.5),
        Layer("MARKED", _single(stick), colour=(0.1, 1.0, 1.0, 1.0), width=3.0),
    )


def comparison_of(taxels: AllTaxels, found: Comparison) -> tuple[Layer, ...]:
    """Lines from each taxel to its own in the file, and the outline of the one that is furthest off."""
    worst = taxels.rows[found.worst]
    return (
        Layer("COMPARED", _single(found.ends), colour=(1.0, 0.25, 0.9, 1.0), width=3.0),
        Layer(
            "COMPARED", _segments(_closed(taxels.corners[worst : worst + 1])), colour=(1.0, 0.25, 0.9, 1.0), width=3.0
        ),
    )


def touches_of(found: Sequence[Placement]) -> tuple[Layer, ...]:
    """Lines from the taxels to where they were touched; those that are far from their taxels stand out."""
    colours = {False: (0.2, 0.9, 1.0, 1.0), True: (1.0, 0.2, 0.2, 1.0)}
    layers = []
    for placement in found:
        ends = np.stack((placement.patch.taxels.positions_link[placement.rows], placement.places), axis=1)
        astray = np.isin(np.arange(len(ends)), placement.outliers)
        for is_astray, colour in colours.items():
            if (astray == is_astray).any():
                layers.append(Layer("TOUCHED", _single(ends[astray == is_astray]), colour=colour, width=3.0))
    return tuple(layers)


def replay_lines(taxels: AllTaxels, frame: Frame) -> tuple[Layer, ...]:
    """What a frame of a recording feels: contacts each in its colour, where they press, CoP and supporting polygons."""
    layers = [
        Layer("CONTACTS", _single(taxels.outline(c.taxels)), colour=INKS[c.number % len(INKS)], width=3.5)
        for c in frame.contacts
    ]
    places = [_cross(c.position, c.normal, taxels.width) for c in frame.contacts if c.normal.any()]
    if places:
        layers.append(Layer("COP", _single(np.concatenate(places)), colour=WHITE, width=2.5))
    ground = frame.ground
    if ground is not None:
        for name, colour in POLYGONS.items():
            loop = ground.plane.spatial(getattr(frame.polygon, name).corners)
            ends = np.stack((loop, np.roll(loop, -1, axis=0)), axis=1)
            layers.append(Layer("POLYGONS", _single(ends), colour=colour, width=2.5, on_top=True))
        if frame.cop is not None:
            mark = _cross(ground.plane.spatial(frame.cop), -ground.plane.axes[2], taxels.width)
            layers.append(Layer("COP", _single(mark), colour=PINK, width=4.0, on_top=True))
    return tuple(layers)


def _cross(place: np.ndarray, normal: np.ndarray, size: float) -> np.ndarray:
    """Segments (3, 2, 3): a cross at a place, and a stick from there along the normal."""
    a = perpendicular(normal)
    b = np.cross(normal, a)
    half = size / 3
    return np.stack(
        ((place - half * a, place + half * a), (place - half * b, place + half * b), (place, place + size * normal))
    )


def _closed(corners: np.ndarray) -> np.ndarray:
    return np.concatenate((corners, corners[:, :1]), axis=1)


def _crossing(grid: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Segments along both directions of a lattice of points (n, m, 3)."""
    return _segments(grid), _segments(grid.transpose(1, 0, 2))


def _segments(polylines: np.ndarray) -> np.ndarray:
    """Ends of the segments of polylines (k, p, 3), shape (2 k (p - 1), 3), in the order in which the GPU reads them."""
    return _single(np.stack((polylines[:, :-1], polylines[:, 1:]), axis=2))


def _single(points: np.ndarray) -> np.ndarray:
    """Points (..., 3) as the GPU takes them."""
    return np.ascontiguousarray(points.reshape(-1, 3), np.float32)
