"""The style of all figures: size, letters, markers and colours, the legend, labels that do not overlap."""

import numpy as np
from matplotlib import patheffects
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import NullFormatter
from matplotlib.transforms import Bbox
from methods import AUTO, BEST_NET, LETTER, PLACED, SAME, STRENGTHENED, STRENGTHENED_NLLS, is_peer

# A figure is 1000 px wide where documents show it, and has twice as many. A letter of 8 points has 11 px there.
WIDTH, DPI = 10.0, 200  # [inch], [px / inch]
LETTERS, TITLES = 8.5, 10.0  # [points]
OURS_COLOUR, PAPER_COLOUR = "#1552c0", "#b01020"
# Marker, colour, line width. Ours is blue and green, the paper's method red, peers grey and brown.
STYLES = {
    PLACED: ("o", OURS_COLOUR, 1.8),
    SAME: ("s", "#6fa3ee", 1.8),
    BEST_NET: ("D", "#10a0a0", 1.8),
    AUTO: ("*", "#1a8a3a", 0.0),
    STRENGTHENED: ("^", PAPER_COLOUR, 1.8),
    LETTER: ("v", "#ee7f7f", 1.8),
    STRENGTHENED_NLLS: ("<", "#600010", 0.0),
    "splipy": ("P", "#303030", 0.8),
    "geomdl": ("X", "#8a5a2b", 0.8),
    "splinepy": ("d", "#b58a5a", 0.8),
    "OpenCASCADE approximate": ("p", "#c9a050", 0.8),
    "OpenCASCADE interpolate": ("h", "#d8c08f", 0.8),
    "SciPy Rect, interpolating": (">", "#a8a8a8", 0.8),
    "SciPy Rect, smoothing": ("8", "#606060", 0.8),
    "SciPy LSQ": ("H", "#888888", 0.8),
    "SciPy Smooth": ("P", "#b8b8b8", 0.8),
    "OpenCASCADE": ("p", "#c9a050", 0.0),
    "SciPy": ("8", "#808080", 0.0),
}
OFFSETS = ((5, 4), (5, -10), (-5, 4), (-5, -10), (0, 8), (0, -13), (9, -3), (-9, -3))  # of a label, tried in this order


def figure_of(count: int, columns: int, title: str, height: float = 3.4) -> tuple[Figure, list[Axes]]:
    """Return a figure with some panels of a height [inch], a grid in each."""
    rows = -(-count // columns)
    figure = Figure(figsize=(WIDTH, height * rows + 1.2), dpi=DPI, layout="constrained", facecolor="white")
    FigureCanvasAgg(figure)
    figure.suptitle(title, fontsize=TITLES + 1)
    panels = list(np.atleast_1d(figure.subplots(rows, columns)).ravel())
    for panel in panels[count:]:
        panel.set_axis_off()
    for panel in panels[:count]:
        panel.grid(True, which="major", color="#e4e4e4")
        panel.set_axisbelow(True)
        panel.spines[["top", "right"]].set_visible(False)
        panel.tick_params(labelsize=LETTERS)
    return figure, panels[:count]


def describe(panel: Axes, title: str, x: str, y: str) -> None:
    """Set the title and the labels of the axes; powers of ten are written as decimal numbers."""
    for axis in (panel.xaxis, panel.yaxis):
        if axis.get_scale() == "log":
            axis.set_major_formatter(lambda value, _: f"{value:g}")
            axis.set_minor_formatter(NullFormatter())
    panel.set_title(title, fontsize=TITLES)
    panel.set_xlabel(x, fontsize=LETTERS)
    panel.set_ylabel(y, fontsize=LETTERS)


def curve(panel: Axes, method: str, x, y) -> None:
    """Draw one method's points, with a line through them."""
    marker, colour, width = STYLES[method]
    peer = is_peer(method)
    if width:
        panel.plot(x, y, "-", color=colour, linewidth=width, alpha=0.35 if peer else 0.8, zorder=2 if peer else 4)
    style = marker_style(method)
    panel.plot(x, y, linestyle="none", zorder=3 if peer else 5, **style)


def marker_style(method: str) -> dict:
    """Return what ``plot`` takes to draw the marker of a method."""
    marker, colour, _ = STYLES[method]
    size = 11 if marker == "*" else 5.5 if is_peer(method) else 6.5
    return {"marker": marker, "color": colour, "markersize": size, "markeredgecolor": "white", "markeredgewidth": 0.5}


def legend(figure: Figure, used: set[str], ncols: int = 4, more: tuple[Line2D, ...] = ()) -> None:
    """Draw one legend for the whole figure, below it."""
    handles = [
        Line2D([], [], linewidth=STYLES[m][2], linestyle="-" if STYLES[m][2] else "none", label=m, **marker_style(m))
        for m in STYLES
        if m in used
    ]
    figure.legend(handles=[*handles, *more], loc="outside lower center", ncols=ncols, frameon=False, fontsize=LETTERS)


def labels(panel: Axes, texts: list[tuple[str, float, float, str]]) -> None:
    """Write a text in a colour next to each point; omit it where it would cover a point or an earlier text.

    Call this when the limits and the size of the panel are final.
    """
    figure = panel.figure
    renderer = figure.canvas.get_renderer()
    inside = panel.get_window_extent(renderer)
    half = 2.5 * DPI / 72  # of a marker [px]
    points = panel.transData.transform([(x, y) for _, x, y, _ in texts]) if texts else np.zeros((0, 2))
    taken = [Bbox.from_extents(x - half, y - half, x + half, y + half) for x, y in points]
    for text, x, y, colour in texts:
        for dx, dy in OFFSETS:
            note = panel.annotate(
                text,
                (x, y),
                (dx, dy),
                textcoords="offset points",
                ha="left" if dx > 0 else "right" if dx < 0 else "center",
                fontsize=LETTERS - 0.5,
                color=colour,
                zorder=6,
                path_effects=[patheffects.withStroke(linewidth=2.0, foreground="white")],
            )
            box = note.get_window_extent(renderer)
            if (
                not any(box.overlaps(other) for other in taken)
                and inside.contains(box.x0, box.y0)
                and box.x1 < inside.x1
            ):
                taken.append(box)
                break
            note.remove()
