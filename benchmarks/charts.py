"""The charts: time against error, stability, cost, placement, the runtime's cycle."""

from pathlib import Path

import cost
import cycle
import numpy as np
import placement
import stability
import time_error
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

PEER_WIDTH = 0.8
# Marker, colour, line width. Ours is blue and thick, the paper red, peers grey and brown.
STYLES = {
    "ours": ("o", "#1552c0", 3.0),
    "ours, same planes": ("o", "#8fb8f0", 1.8),
    "ours, best net": ("o", "#20b2aa", 2.4),
    "ours, auto": ("*", "#1a9a3a", 0.0),
    "paper, good parameters": ("s", "#d62728", 1.8),
    "paper, uniform parameters": ("X", "#f2a0a0", 1.4),
    "paper, NLLS": ("^", "#8b0000", 0.0),
    "geomdl": ("v", "#6b4a2b", PEER_WIDTH),
    "OpenCASCADE approximate": ("D", "#b5834a", PEER_WIDTH),
    "OpenCASCADE interpolate": ("d", "#d8b88f", PEER_WIDTH),
    "splipy": ("P", "#202020", PEER_WIDTH),
    "splinepy": ("<", "#94704d", PEER_WIDTH),
    "SciPy Rect, interpolating": (">", "#b0b0b0", PEER_WIDTH),
    "SciPy Rect, smoothing": ("h", "#606060", PEER_WIDTH),
    "SciPy LSQ": ("p", "#8a8a8a", PEER_WIDTH),
    "SciPy Smooth": ("8", "#c4c4c4", PEER_WIDTH),
}
JOINED = ((5, 5), (5, 10), (10, 10), (20, 30))  # sizes along a method's line; 10 x 5 lies beside it
LABELLED = ((5, 5), (10, 10), (20, 30))
WORST = 10.0  # [mm] what is worse is drawn there: it is no surface of the link


def draw_all(measured: dict[str, list], folder: Path) -> None:
    """A picture for each of the benchmarks that ran."""
    for name, (file, draw) in {
        "time_error": ("benchmark.png", draw_time_error),
        "stability": ("stability.png", draw_stability),
        "cost": ("cost.png", draw_cost),
        "placement": ("placement.png", draw_placement),
        "cycle": ("cycle.png", draw_cycle),
    }.items():
        if measured.get(name):
            draw(measured[name]).savefig(folder / file, metadata={"Software": None})


def draw_time_error(rows: list[time_error.Row]) -> Figure:
    """A panel per link: how long a fit takes, and how far its surface is from the mesh."""
    names = list(dict.fromkeys(r.link for r in rows))
    figure, panels = paper_of(
        len(names), 4, "Mean distance to the mesh against time: lower left is better (u-planes × full v-planes)"
    )
    best, used = time_error.best_variants(rows).values(), set()
    for panel, name in zip(panels, names):
        for method in STYLES:
            found = [r for r in best if r.link == name and r.method == method and not r.failed]
            if not found:
                continue
            used.add(method)
            sizes = {(r.n, r.m): r for r in found}
            line = found if method == "ours, auto" else [sizes[size] for size in JOINED if size in sizes]
            for part in (line, [r for r in found if r not in line]):
                curve(panel, method, [r.milliseconds for r in part], [min(r.mean, WORST) for r in part])
            for r in found if method == "ours" else ():
                if (r.n, r.m) in LABELLED:
                    label(panel, f"{r.n}×{r.m:g}", r.milliseconds, min(r.mean, WORST))
        panel.set(xscale="log", yscale="log", title=name)
        panel.set_xlabel("time of one fit [ms]")
        panel.set_ylabel("mean distance [mm]")
    legend(figure, used)
    return figure


def draw_stability(rows: list[stability.Row]) -> Figure:
    """A panel per condition; crosses at the top are failures."""
    found = [p for p in stability.PANELS if any(r.panel == p.name for r in rows)]
    figure, panels = paper_of(len(found), 3, "Mean distance to the truth as conditions get worse: a cross is a failure")
    used = set()
    for panel, condition in zip(panels, found):
        for k, method in enumerate(STYLES):
            chosen = [r for r in rows if r.panel == condition.name and r.method == method]
            if not chosen:
                continue
            used.add(method)
            places = [condition.values.index(r.value) for r in chosen]
            curve(panel, method, places, [np.nan if r.failure else r.mean for r in chosen])
            failed = [i + 0.05 * (k - 4) for i, r in zip(places, chosen) if r.failure]
            top = np.full(len(failed), stability.LIMIT * 1.6)
            panel.plot(failed, top, "x", color=STYLES[method][1], markersize=8, markeredgewidth=2.2)
        panel.set(yscale="log", title=condition.name, xlabel=f"{condition.name} [{condition.unit}]")
        panel.set_xticks(range(len(condition.values)), [f"{v:g}" for v in condition.values])
        panel.set_ylabel("mean distance to the truth [mm]")
        panel.set_ylim(top=stability.LIMIT * 2.2)
        panel.axhline(stability.LIMIT, color="#bbbbbb", linestyle=":", linewidth=1)
    legend(figure, used, ncols=3)
    return figure


def draw_cost(rows: list[cost.Row]) -> Figure:
    """Time against faces and against control points, and below them what ours did."""
    figure, panels = paper_of(4, 2, "What a fit costs")
    used = set()
    for panel, series in zip(panels[:2], ("faces", "control points")):
        for method in STYLES:
            chosen = [r for r in rows if r.series == series and r.method == method]
            if chosen:
                used.add(method)
                curve(panel, method, [along(r) for r in chosen], [r.milliseconds for r in chosen])
        panel.set(xscale="log", yscale="log", title=f"time against {series}", xlabel=series)
        panel.set_ylabel("time of one fit [ms]")
        mark_nets(panel, rows, series)
    for panel, series in zip(panels[2:], ("faces", "control points")):
        chosen = [r for r in rows if r.series == series and r.method == "ours"]
        x = [along(r) for r in chosen]
        for field, text, style in (("cut", "pairs of face and sample row cut", "o-"), ("samples", "samples", "s--")):
            panel.plot(x, [getattr(r, field) for r in chosen], style, color="#1552c0", label=text)
        panel.plot(x, [r.control_points for r in chosen], "^:", color="#1552c0", label="unknowns")
        panel.plot(x, [r.passes for r in chosen], "d-.", color="#1552c0", label="passes")
        panel.set(xscale="log", yscale="log", title=f"counts of ours against {series}", xlabel=series, ylabel="count")
        panel.legend(fontsize=8, frameon=False, loc="center left", bbox_to_anchor=(0.02, 0.3))
        mark_nets(panel, rows, series)
    legend(figure, used)
    return figure


def mark_nets(panel: Axes, rows: list[cost.Row], series: str) -> None:
    """Ticks at the nets themselves: there are too few for decades."""
    if series == "control points":
        places = sorted({r.control_points for r in rows if r.series == series})
        panel.set_xticks(places, [str(p) for p in places])
        panel.minorticks_off()


def along(row: cost.Row) -> int:
    """Where a row lies on the x axis of its series."""
    return row.faces if row.series == "faces" else row.control_points


def curve(panel: Axes, method: str, x, y) -> None:
    """One method's points, joined."""
    marker, colour, width = STYLES[method]
    ours, peer = method.startswith("ours"), width == PEER_WIDTH
    if width:
        panel.plot(x, y, "-", color=colour, linewidth=width, alpha=0.4 if peer else 1.0, zorder=4 if ours else 2)
    size = 13 if marker == "*" else 7 if ours else 6
    panel.plot(
        x,
        y,
        marker,
        color=colour,
        markersize=size,
        zorder=5 if ours else 3,
        markeredgecolor=colour if peer else "white",
    )


def label(panel: Axes, text: str, x: float, y: float) -> None:
    """A few letters beside a point."""
    panel.annotate(text, (x, y), (5, 5), textcoords="offset points", fontsize=7, color="#1552c0", zorder=6)


def paper_of(count: int, columns: int, title: str) -> tuple[Figure, list[Axes]]:
    """A figure with so many panels."""
    rows = -(-count // columns)
    figure = Figure(figsize=(4.3 * columns, 3.4 * rows + 1.3), dpi=100, layout="constrained")
    FigureCanvasAgg(figure)
    figure.suptitle(title, fontsize=14)
    panels = list(np.atleast_1d(figure.subplots(rows, columns)).ravel())
    for panel in panels[count:]:
        panel.set_axis_off()
    for panel in panels[:count]:
        panel.grid(True, which="major", alpha=0.3)
        panel.spines[["top", "right"]].set_visible(False)
    return figure, panels[:count]


def legend(figure: Figure, used: set[str], ncols: int = 5) -> None:
    """One legend for the whole figure, below it."""
    handles = []
    for method in (m for m in STYLES if m in used):
        marker, colour, width = STYLES[method]
        line = "-" if width else "none"
        handles.append(
            Line2D([], [], marker=marker, color=colour, linewidth=width, linestyle=line, markersize=8, label=method)
        )
    figure.legend(handles=handles, loc="outside lower center", ncols=ncols, frameon=False, fontsize=10)


def draw_placement(rows: list[placement.Row]) -> Figure:
    """A bar per surface and method: how far the cells of a sheet are from where it lies."""
    figure = Figure(figsize=(11, 4), dpi=110, facecolor="white", layout="constrained")
    FigureCanvasAgg(figure)
    axis = figure.add_subplot()
    surfaces, methods = (list(dict.fromkeys(getattr(r, k) for r in rows)) for k in ("surface", "method"))
    colours = dict(zip(methods, ("#1552c0", "#e09030", "#d62728")))
    for k, method in enumerate(methods):
        found = [r for r in rows if r.method == method]
        places = np.arange(len(found)) + 0.27 * (k - 1)
        axis.bar(places, [r.mean for r in found], 0.25, color=colours[method], label=method)
        for x, r in zip(places, found):
            axis.plot([x, x], [r.mean, r.max], color="#303030", linewidth=1)
            axis.annotate(f"{r.milliseconds:.0f} ms" if r.milliseconds >= 1 else "< 1 ms", (x, r.max), (0, 2),
                          textcoords="offset points", ha="center", fontsize=7)  # fmt: skip
    axis.set_yscale("log")
    axis.set_ylim(bottom=2e-5)
    axis.set_xticks(range(len(surfaces)), [s.replace(", ", ",\n") for s in surfaces], fontsize=8)
    axis.set_ylabel("off the exact place [mm]: mean, and largest")
    axis.set_title("Where 6 x 22 cells of 10 mm lie, against exact unrolling (the wrist: a lattice four times as fine)")
    axis.legend(fontsize=8, loc="upper left", bbox_to_anchor=(0.0, 0.98))
    axis.grid(axis="y", alpha=0.3)
    return figure


def draw_cycle(rows: list[cycle.Row]) -> Figure:
    """A bar per scene and method: how long a cycle takes, the median, with a line up to the 99th percentile."""
    figure = Figure(figsize=(11, 4.4), dpi=110, facecolor="white", layout="constrained")
    FigureCanvasAgg(figure)
    axis = figure.add_subplot()
    scenes, methods = (list(dict.fromkeys(getattr(r, k) for r in rows)) for k in ("scene", "method"))
    for k, (method, colour) in enumerate(zip(methods, ("#1552c0", "#d62728", "#808080"))):
        found = [r for r in rows if r.method == method]
        places = np.array([scenes.index(r.scene) for r in found]) + 0.27 * (k - 1)
        axis.bar(places, [r.median for r in found], 0.25, color=colour, label=method)
        for x, r in zip(places, found):
            axis.plot([x, x], [r.median, r.p99], color="#303030", linewidth=1)
            axis.annotate(f"{r.median:.0f}", (x, r.median), (0, 2), textcoords="offset points", ha="center", fontsize=7)
    axis.axhline(1000, color="#303030", linewidth=0.8, linestyle=":")
    axis.annotate("1 kHz", (-0.5, 1000), (2, 2), textcoords="offset points", fontsize=8)
    axis.set_yscale("log")
    axis.set_xticks(range(len(scenes)), [s.replace(", ", ",\n") for s in scenes], fontsize=7.5)
    axis.set_ylabel("a cycle [us]: median, and 99th percentile")
    axis.set_title("From raw readings to contacts, wrench, CoP, ZMP and three supporting polygons")
    axis.legend(fontsize=8, loc="upper left", ncols=3)
    axis.grid(axis="y", alpha=0.3)
    return figure
