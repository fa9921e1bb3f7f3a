"""Pattern of a sheet on paper, 1:1: what a workshop cuts, prints, or compares with the link."""

import io
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ..calibration.model import LinkCalibration, Patch, SurfaceModel
from ..common.arrays import Array, BoolArray, norms, tangential
from ..common.errors import SkinCalibError
from ..geometry.surface.distance import is_sampled
from ..pipeline.calibrate import surface_of
from ..skin.sheet.geodesic import trace
from ..skin.sheet.offset import offset_surface
from .calibration import blank

ENDINGS = (".svg", ".pdf")
MARGIN = 20.0  # [mm] around the sheet, in which the edge of the cover is drawn. Larger: more of it, less exact
GRID_STEP = 1.5  # [mm] of the points between which edges are searched. Larger: faster, finer details are lost
HALVINGS = 10  # of a step of the grid at an edge. More: more exact, slower
GEODESIC_STEPS = 4  # from the nearest taxel to a point. More: more exact, slower
FOOTER, HEADER, MIN_WIDTH = 52.0, 22.0, 150.0  # [mm] of the texts below and above the sheet, and of their lines
A4, PAGE_MARGIN, OVERLAP = (210.0, 297.0), 8.0, 10.0  # Format: [mm] of a page, its empty edge, two adjacent pages
POINTS = 72 / 25.4  # of a font or line, in a mm
TEXT_WIDTH = 0.62  # of a character, as a fraction of its height


@dataclass(frozen=True, eq=False)
class Pattern:
    """A sheet before it is bent, seen from outside of the robot: x [mm] along the rows, from the centre of cell (0, 0).

    The lengths are those of the middle of the skin: the strain of the cells is what paper and link differ by.
    """

    calibration: LinkCalibration
    patch: Patch

    @cached_property
    def centres(self) -> Array:
        """Return the centre of each cell (n, 2) [mm]."""
        taxels, pitch = self.patch.taxels, 1e3 * np.array(self.patch.pitch)
        row, column = taxels.index.T
        steps = np.where((column[:, None] == column) & (row[:, None] - row == -1), 1.0, 0.0)
        arms = taxels.positions_link[None] - taxels.positions_link[:, None]
        towards = (steps * np.einsum("ijc,ic->ij", arms, taxels.axes_link[:, 1])).sum()
        return np.column_stack((column * pitch[1], np.where(towards < 0, -1, 1) * row * pitch[0]))

    @cached_property
    def half(self) -> Array:
        """Return half of the size of a cell along and across the row (2,) [mm]."""
        return 500 * np.array(self.patch.pitch[::-1])

    @cached_property
    def outline(self) -> list[Array]:
        """Return the sides of cells (2, 2) that have no cell beyond them [mm]."""
        present, found = {tuple(np.rint(c / self.half).astype(int)) for c in self.centres}, []
        for centre in self.centres:
            for step in np.array(((1, 0), (0, 1), (-1, 0), (0, -1))):
                if tuple(np.rint(centre / self.half).astype(int) + 2 * step) not in present:
                    side = np.array((-step[1], step[0]))
                    found.append(np.stack((centre + (step + side) * self.half, centre + (step - side) * self.half)))
        return found

    @cached_property
    def bounds(self) -> tuple[Array, Array]:
        """Return the lower and the upper corner of the sheet [mm]."""
        return self.centres.min(axis=0) - self.half, self.centres.max(axis=0) + self.half

    @cached_property
    def surface(self) -> SurfaceModel:
        """Return the surface of the patch."""
        return next(s for s in self.calibration.surfaces if s.name == self.patch.surface)

    @cached_property
    def layer(self) -> Any:
        """Return the surface of the middle of the skin."""
        return offset_surface(surface_of(self.surface), self.patch.offset)

    def on_surface(self, places: Array) -> Array:
        """Return parameters (k, 2) of points of the paper (k, 2) [mm], along geodesics from the nearest taxels."""
        taxels = self.patch.taxels
        near = np.array([norms(place - self.centres).argmin() for place in places], np.int64)
        arms = places - self.centres[near]
        lengths = norms(arms)
        along = np.where(lengths[:, None] > 0, arms, (1.0, 0.0))
        tangents = np.einsum("ks,ksc->kc", along / norms(along)[:, None], taxels.axes_link[near])
        tangents = tangential(tangents, self.layer.normals(taxels.uv[near]))
        step = 1e-3 * lengths[:, None] / GEODESIC_STEPS
        return trace(self.layer, taxels.uv[near], tangents, step, GEODESIC_STEPS)[0][-1]

    def on_paper(self, points: Array, normals: Array) -> tuple[Array, BoolArray]:
        """Return points near the sheet (k, 3) on the paper (k, 2) [mm], and which are in a cell.

        From the nearest taxel: an arc with the length of its chord and the angle between the normals at its ends.
        """
        taxels = self.patch.taxels
        near = np.array([norms(point - taxels.positions_link).argmin() for point in points], np.int64)
        chords = points - taxels.positions_link[near]
        half_angle = np.arccos(np.clip((normals * taxels.normals_link[near]).sum(axis=1), -1, 1)) / 2
        flat = np.einsum("kc,ksc->ks", chords, taxels.axes_link[near])
        lengths = norms(chords) / np.sinc(half_angle / np.pi)
        arms = 1e3 * flat * (lengths / np.maximum(norms(flat), 1e-12))[:, None]
        return self.centres[near] + arms, (np.abs(arms) <= self.half).all(axis=1) & (half_angle < 0.5)

    def is_covered(self, places: Array) -> BoolArray:
        """Return which points of the paper are on the cover: where the surface follows the mesh."""
        uv = self.on_surface(places)
        open_ = ~np.array(self.surface.closed)
        inside = (np.abs(uv[:, open_] - 0.5) <= 0.5).all(axis=1)
        trusted = self.surface.trusted
        if trusted is None:
            return inside
        uv = np.where(open_, np.clip(uv, 0, 1), uv % 1)
        if trusted.boundary:
            inside &= np.logical_xor.reduce([_crossings(loop, uv, self.surface.closed[1]) for loop in trusted.boundary])
        if trusted.sites:
            letters = np.array([list(row) for row in trusted.sites])
            inside &= is_sampled(self.layer, uv, letters == "1", letters == "-")
        return inside

    def is_other_end(self, places: Array) -> BoolArray:
        """Return at which points of the paper the other end of the sheet is on the link, one turn later."""
        uv = self.layer.wrap(self.on_surface(places))
        there, in_cell = self.on_paper(self.layer.points(uv), self.layer.normals(uv))
        return in_cell & (norms(there - places) > 4 * self.half.max())

    def edges(self, holds: Callable[[Array], BoolArray]) -> list[Array]:
        """Return segments (2, 2) of the paper [mm] where a property of points begins or ends."""
        low, high = self.bounds
        x, y = (np.arange(a - MARGIN, b + MARGIN + GRID_STEP, GRID_STEP) for a, b in zip(low, high))
        grid = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1)
        inside = holds(grid.reshape(-1, 2)).reshape(grid.shape[:2])
        crossings: dict[tuple[int, int, int], Array] = {}
        for axis, (a, b) in enumerate(((inside[:-1], inside[1:]), (inside[:, :-1], inside[:, 1:]))):
            at = np.argwhere(a != b)
            if len(at):
                start, end = grid[tuple(at.T)], grid[tuple((at + np.eye(2, dtype=int)[axis]).T)]
                first = inside[tuple(at.T)]
                for _ in range(HALVINGS):
                    middle = (start + end) / 2
                    same = (holds(middle) == first)[:, None]
                    start, end = np.where(same, middle, start), np.where(same, end, middle)
                crossings |= {(axis, i, j): place for (i, j), place in zip(at.tolist(), (start + end) / 2)}
        found = []
        for i, j in np.ndindex(len(x) - 1, len(y) - 1):
            sides = ((0, i, j), (1, i + 1, j), (0, i, j + 1), (1, i, j))
            met = [crossings[side] for side in sides if side in crossings]
            found += [np.stack(met[k : k + 2]) for k in range(0, len(met), 2)]
        return found

    @property
    def landmarks(self) -> Iterator[tuple[str, Array, Array]]:
        """Yield what to find on paper and on the link: its words, place [mm], and point in the link frame [m]."""
        taxels = self.patch.taxels
        corners = [int((self.centres @ np.array(d)).argmax()) for d in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
        for row in dict.fromkeys(corners):
            yield f"centre of {taxels.ids[row]}", self.centres[row], taxels.positions_link[row]
        if self.patch.registration is not None:
            anchor = np.array(self.patch.registration.anchor)
            near = norms(anchor - taxels.positions_link).argmin()
            yield "anchor of the mount", self.on_paper(anchor[None], taxels.normals_link[near][None])[0][0], anchor


def _crossings(loop: Array, uv: Array, closed: bool) -> BoolArray:
    """Return whether a line along u from each parameter crosses a loop an odd number of times."""
    odd = np.zeros(len(uv), bool)
    for (u0, v0), (u1, v1) in zip(loop, np.roll(loop, -1, axis=0)):
        dv, v = v1 - v0, uv[:, 1] - v0
        if closed:
            dv, v = dv - np.rint(dv), v - np.floor(v + 0.5)
        meets = (v < 0) != (v < dv)
        odd ^= meets & (uv[:, 0] < u0 + (u1 - u0) * v / (dv or 1.0))
    return odd


def write_pattern(calibration: LinkCalibration, ending: str) -> bytes:
    """Return the file of a pattern: one SVG, or PDF pages (A4, with marks where they overlap)."""
    sheets = [patch.name for patch in calibration.patches if patch.kind == "sheet" and len(patch.taxels.ids)]
    choose = f"Select them with --patch: {', '.join(sheets)}" if sheets else "This calibration has none."
    for patch in calibration.patches:
        if patch.name not in sheets:
            what = "has no taxels" if patch.kind == "sheet" else f"has the kind {patch.kind}"
            raise SkinCalibError(f"patch '{patch.name}' {what}: a pattern shows sheets. {choose}")
    if not sheets or (ending == ".svg" and len(sheets) > 1):
        raise SkinCalibError(f"an SVG has one sheet, here are {len(sheets)}. Select one with --patch, or write a PDF.")
    blank(1, 1)  # raises before the computation if matplotlib is missing
    from matplotlib import rc_context

    patterns = [Pattern(calibration, patch) for patch in calibration.patches]
    fixed: Any = {"svg.fonttype": "none", "svg.hashsalt": "pattern", "path.simplify": False, "pdf.fonttype": 42}
    with rc_context(fixed):
        return _svg(patterns[0]) if ending == ".svg" else _pdf(patterns)


def _extent(pattern: Pattern) -> tuple[Array, Array]:
    """Return the lower and the upper corner of a drawing with its texts [mm]."""
    low, high = pattern.bounds
    low, high = low - (MARGIN, MARGIN + FOOTER), high + (MARGIN, MARGIN + HEADER)
    return low, np.maximum(high, (low[0] + MIN_WIDTH, high[1]))


def _svg(pattern: Pattern) -> bytes:
    low, high = _extent(pattern)
    figure, data = blank(*(high - low) / 25.4), io.BytesIO()
    _draw(figure.add_axes((0, 0, 1, 1)), pattern, low, high)
    figure.savefig(data, format="svg", metadata={"Date": None, "Creator": None})
    text = data.getvalue().decode()
    for name, size in zip(("width", "height"), high - low):  # programs differ in what a point is
        start = text.index(f'{name}="', text.index("<svg")) + len(name) + 2
        end = text.index('"', start)
        text = f"{text[:start]}{size:.6f}mm{text[end:]}"
    return text.encode()


def _pdf(patterns: list[Pattern]) -> bytes:
    from matplotlib.backends.backend_pdf import PdfPages

    data = io.BytesIO()
    with PdfPages(data, metadata={"CreationDate": None, "Creator": None, "Producer": None}) as pages:
        for pattern in patterns:
            low, high = _extent(pattern)
            page, counts = min((_tiles(high - low, size) for size in (A4, A4[::-1])), key=lambda t: np.prod(t[1]))
            figure = blank(*np.array(page) / 25.4)
            area = np.array(page) - 2 * PAGE_MARGIN
            axes = figure.add_axes((*(PAGE_MARGIN / np.array(page)), *(area / page)))
            _draw(axes, pattern, low, high)
            note = figure.text(0.5, 5 / page[1], "", ha="center", va="center", size=2.6 * POINTS)
            marks: list[Any] = []
            for row, column in np.ndindex(int(counts[1]), int(counts[0])):
                corner = np.array((low[0], high[1] - area[1])) + (column, -row) * (area - OVERLAP)
                axes.set(xlim=(corner[0], corner[0] + area[0]), ylim=(corner[1], corner[1] + area[1]))
                for mark in marks:
                    mark.remove()
                marks = _marks(axes, corner, area, (row, column), counts) if max(counts) > 1 else []
                tile = ""
                if max(counts) > 1:
                    across, down = f"{column + 1} of {counts[0]} across", f"{row + 1} of {counts[1]} down"
                    tile = f", page {across}, {down}; put the marks together"
                note.set_text(f"{pattern.calibration.link}: {pattern.patch.name}{tile}. Print at 100%.")
                pages.savefig(figure)
    return data.getvalue()


def _tiles(size: Array, page: tuple[float, float]) -> tuple[tuple[float, float], Array]:
    """Return a page and the numbers of its columns and rows for a drawing."""
    area = np.array(page) - 2 * PAGE_MARGIN
    return page, np.maximum(np.ceil((size - OVERLAP) / (area - OVERLAP)), 1).astype(int)


def _marks(axes: Any, corner: Array, area: Array, tile: tuple[int, int], counts: Array) -> list[Any]:
    """Draw the middle of the overlap with each adjacent page, with marks at its ends."""
    left, bottom, right, top = *corner, *(corner + area)
    lines: list[Any] = []
    style = {"color": "0.4", "linewidth": 0.5, "linestyle": (0, (6, 3))}
    for shared, x in ((tile[1] > 0, left + OVERLAP / 2), (tile[1] < counts[0] - 1, right - OVERLAP / 2)):
        lines += axes.plot((x, x), (bottom, top), marker="+", **style) if shared else []
    for shared, y in ((tile[0] > 0, top - OVERLAP / 2), (tile[0] < counts[1] - 1, bottom + OVERLAP / 2)):
        lines += axes.plot((left, right), (y, y), marker="+", **style) if shared else []
    return lines


def _draw(axes: Any, pattern: Pattern, low: Array, high: Array) -> None:
    """Draw everything, 1 mm as 1."""
    from matplotlib.collections import LineCollection
    from matplotlib.patches import Polygon

    patch, taxels, half = pattern.patch, pattern.patch.taxels, pattern.half
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    axes.set_axis_off()
    strain = 100 * np.abs(taxels.quality.get("strain", np.zeros((len(taxels.ids), 2)))[:, :2]).max(axis=1)
    largest = max(0.1, float(strain.max()))
    prefix = f"{patch.name}."
    short = [taxel.removeprefix(prefix) for taxel in taxels.ids]
    size = min(2.6, 1.7 * half[0] / (TEXT_WIDTH * max(4, *map(len, short))), 0.36 * half[1])

    def write(x: float, y: float, text: str, mm: float = 3.0, **more: Any) -> None:
        axes.text(x, y, text.replace("$", r"\$"), size=mm * POINTS, clip_on=True, **{"va": "center", **more})

    for taxel, label, channel, centre, value in zip(taxels.ids, short, taxels.channels, pattern.centres, strain):
        corners = centre + half * ((-1, -1), (1, -1), (1, 1), (-1, 1))
        colour = 1 - 0.55 * value / largest * np.array((0.1, 0.5, 1))  # white to orange: darker as the strain grows
        axes.add_patch(Polygon(corners, facecolor=colour, edgecolor="0.45", linewidth=0.4, gid=taxel))
        for height, text in ((0.7, label), (0.28, f"{channel}"), (-0.55, f"{value:.1f}%")):
            write(centre[0], centre[1] + height * half[1], text, size, ha="center")
    axes.plot(*pattern.centres.T, "+", color="0.3", markersize=2, markeredgewidth=0.3)
    axes.add_collection(LineCollection(pattern.outline, colors="black", linewidths=1.1, gid="outline"))
    cover, closing = pattern.edges(pattern.is_covered), []
    if any(pattern.surface.closed):
        closing = pattern.edges(pattern.is_other_end)
    axes.add_collection(LineCollection(cover, colors="#0072b2", linewidths=1.0, gid="cover"))
    axes.add_collection(LineCollection(closing, colors="#d55e00", linewidths=1.4, linestyles=":", gid="closing-line"))
    (x0, y0), (x1, y1) = pattern.bounds
    arrow = {"arrowstyle": "-|>", "linewidth": 1.2, "shrinkA": 0, "shrinkB": 0}
    axes.annotate("", (x0 + 25, y1 + 4), (x0, y1 + 4), arrowprops=arrow)
    write(x0 + 27, y1 + 4, "along the row", 2.8)
    next_row = -1 if pattern.centres[:, 1].min() < 0 else 1
    start = y1 if next_row < 0 else y0
    axes.annotate("", (x0 - 4, start + 15 * next_row), (x0 - 4, start), arrowprops=arrow)
    write(x0 - 8, start + 7.5 * next_row, "next row", 2.8, rotation=90, ha="center")
    left, top = low[0] + 3, high[1]
    cells = f"{len(taxels.ids)} cells of {2 * half[1]:g} x {2 * half[0]:g} mm (across, along the row)"
    write(left, top - 5, f"{pattern.calibration.link}: {patch.name}, {cells}", 3.6, weight="bold")
    write(left, top - 11, f'Seen from outside: this side faces away from the link. Cell: id without "{prefix}",')
    write(left, top - 15.5, f"channel, strain on the link (white 0%, darkest {largest:.1f}%).")
    y = y0 - MARGIN - 4
    axes.plot((left, left + 100), (y, y), color="black", linewidth=1.2, marker="|", markersize=7, gid="bar")
    write(left + 102, y, "100 mm")
    words = ["Black: outline of the sheet."]
    words += ["Blue: edge of the cover of the link."] if cover else [f"The cover has no edge within {MARGIN:g} mm."]
    if any(pattern.surface.closed):
        other_end = "Orange dots: closing line, the other end of the sheet."
        words += [other_end if closing else f"The other end of the sheet is not within {MARGIN:g} mm."]
    write(left, y - 7, " ".join(words), 2.7)
    write(left, y - 12, "Coordinates in the link frame [mm], at the middle of the skin:", 2.7)
    for number, (what, place, point) in enumerate(pattern.landmarks):
        letter = "ABCDE"[number]
        axes.plot(*place, "o", markersize=4, markerfacecolor="none", markeredgecolor="#cc2277", markeredgewidth=0.8)
        write(
            place[0] - 0.75 * half[0], place[1], letter, min(3.0, half[1]), color="#cc2277", weight="bold", ha="center"
        )
        write(
            left,
            y - 17 - 4.5 * number,
            f"{letter}  {what}: " + ", ".join(f"{c:.1f}" for c in np.round(1e3 * point, 1) + 0.0),
            2.7,
        )
