"""The figures of the documentation: time against error, stability, cost, placement, the runtime's cycle."""

from pathlib import Path

import cost
import cycle
import figure_fit
import numpy as np
import placement
import stability
from figure_style import DPI, LETTERS, OURS_COLOUR, STYLES, curve, describe, figure_of, legend
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from methods import PLACED

BAR_COLOURS = (OURS_COLOUR, "#e09030", "#b01020")


def draw_all(measured: dict[str, list], folder: Path) -> None:
    """Write the figures of the benchmarks that ran."""
    for name, file, draw in (
        ("time_error", "benchmark.png", figure_fit.draw_readme),
        ("time_error", "benchmark_all.png", figure_fit.draw_all_links),
        ("stability", "stability.png", draw_stability),
        ("cost", "cost.png", draw_cost),
        ("placement", "placement.png", draw_placement),
        ("cycle", "cycle.png", draw_cycle),
    ):
        if measured.get(name):
            draw(measured[name]).savefig(folder / file, dpi=DPI, metadata={"Software": None})


def draw_stability(rows: list[stability.Row]) -> Figure:
    """Draw a panel per condition; a cross at the top is a failure."""
    found = [p for p in stability.PANELS if any(r.panel == p.name for r in rows)]
    title = "Mean distance to the true surface under difficult conditions (a cross at the top: the fit failed)"
    figure, panels = figure_of(len(found), 2, title, 2.8)
    used = set()
    for panel, condition in zip(panels, found):
        for k, method in enumerate(m for m in STYLES if any(r.method == m for r in rows)):
            chosen = [r for r in rows if r.panel == condition.name and r.method == method]
            if not chosen:
                continue
            used.add(method)
            at = [condition.values.index(r.value) for r in chosen]
            curve(panel, method, at, [np.nan if r.failure else r.mean for r in chosen])
            failed = [i + 0.08 * (k - 2.5) for i, r in zip(at, chosen) if r.failure]
            top = np.full(len(failed), stability.LIMIT * 1.6)
            panel.plot(failed, top, "x", color=STYLES[method][1], markersize=7, markeredgewidth=2.0)
        panel.set_yscale("log")
        panel.set_xticks(range(len(condition.values)), [f"{v:g}" for v in condition.values])
        describe(panel, condition.name, f"{condition.name} [{condition.unit}]", "mean distance [mm]")
        panel.set_ylim(top=stability.LIMIT * 2.2)
        panel.axhline(stability.LIMIT, color="#bbbbbb", linestyle=":", linewidth=1)
    legend(figure, used)
    return figure


def draw_cost(rows: list[cost.Row]) -> Figure:
    """Draw the time against faces and control points, and below it the counts of ours."""
    figure, panels = figure_of(4, 2, "Time and counts of a fit against faces and control points", 3.0)
    used = set()
    for panel, series in zip(panels[:2], ("faces", "control points")):
        for method in STYLES:
            chosen = [r for r in rows if r.series == series and r.method == method]
            if chosen:
                used.add(method)
                curve(panel, method, [count_of(r) for r in chosen], [r.milliseconds for r in chosen])
        panel.set(xscale="log", yscale="log")
        describe(panel, f"time against {series}", series, "time of a fit, warm [ms]")
        mark_nets(panel, rows, series)
    for panel, series in zip(panels[2:], ("faces", "control points")):
        chosen = [r for r in rows if r.series == series and r.method == PLACED]
        x = [count_of(r) for r in chosen]
        for field, text, style in (
            ("cut", "pairs of a face and a row of samples", "o-"),
            ("samples", "samples", "s--"),
            ("control_points", "unknowns", "^:"),
            ("passes", "iterations", "d-."),
        ):
            panel.plot(x, [getattr(r, field) for r in chosen], style, color=OURS_COLOUR, label=text)
        panel.set(xscale="log", yscale="log")
        describe(panel, f"counts of “{PLACED}” against {series}", series, "count")
        panel.legend(fontsize=LETTERS, frameon=False, loc="center left", bbox_to_anchor=(0.02, 0.3))
        mark_nets(panel, rows, series)
    legend(figure, used)
    return figure


def mark_nets(panel: Axes, rows: list[cost.Row], series: str) -> None:
    """Set a tick at each net: there are too few nets for decades."""
    if series == "control points":
        counts = sorted({r.control_points for r in rows if r.series == series})
        panel.set_xticks(counts, [str(count) for count in counts])
        panel.minorticks_off()


def count_of(row: cost.Row) -> int:
    """Return the faces or the control points of a row, whichever its series varies."""
    return row.faces if row.series == "faces" else row.control_points


def draw_placement(rows: list[placement.Row]) -> Figure:
    """Draw a bar per surface and method: the error of the cells of a sheet."""
    title = "Error of 6 × 22 cells of 10 mm: bars to the mean, lines to the maximum, times above them"
    figure, (panel,) = figure_of(1, 1, title, 3.6)
    surfaces, methods = (list(dict.fromkeys(getattr(r, k) for r in rows)) for k in ("surface", "method"))
    for k, (method, colour) in enumerate(zip(methods, BAR_COLOURS)):
        found = [r for r in rows if r.method == method]
        at = np.arange(len(found)) + 0.27 * (k - 1)
        panel.bar(at, [r.mean for r in found], 0.25, color=colour, label=method)
        for x, r in zip(at, found):
            panel.plot([x, x], [r.mean, r.max], color="#303030", linewidth=1)
            time = f"{r.milliseconds:.0f}" if r.milliseconds >= 1 else "< 1"
            over_bar(panel, f"{time}\nms", x, r.max)
    panel.set_yscale("log")
    panel.set_ylim(bottom=5e-6, top=20 * max(r.max for r in rows))
    describe(panel, "", "", "distance from the exact position [mm]")
    panel.set_xticks(range(len(surfaces)), [s.replace(", ", ",\n") for s in surfaces], fontsize=LETTERS)
    panel.legend(fontsize=LETTERS, loc="upper left", ncols=3, frameon=False)
    return figure


def draw_cycle(rows: list[cycle.Row]) -> Figure:
    """Draw a bar per scene and method: the median time of a cycle, with a line up to the 99th percentile."""
    title = "Time of a cycle, from raw readings to contacts, wrench, CoP, ZMP and three supporting polygons"
    figure, panels = figure_of(2, 2, title, 9.0)
    methods = list(dict.fromkeys(r.method for r in rows))
    names = {"thresholds": "contacts by two thresholds", "noise": "contacts by the learned noise, with deviations"}
    for panel, (mode, name) in zip(panels, names.items()):
        scenes = list(dict.fromkeys(r.scene for r in rows if r.mode == mode))
        for k, (method, colour) in enumerate(zip(methods, (OURS_COLOUR, "#b01020", "#808080"))):
            found = [r for r in rows if r.method == method and r.mode == mode]
            at = np.array([scenes.index(r.scene) for r in found]) + 0.27 * (k - 1)
            panel.barh(at, [r.median for r in found], 0.25, color=colour, label=method)
            for y, r in zip(at, found):
                panel.plot([r.median, r.p99], [y, y], color="#303030", linewidth=1)
                text = f"{r.median:.0f}"
                panel.annotate(text, (r.p99, y), (3, 0), textcoords="offset points", va="center", fontsize=LETTERS - 1)
        panel.axvline(1000, color="#303030", linewidth=0.8, linestyle=":")
        panel.set_xscale("log")
        panel.set_xlim(10, 4 * max(r.p99 for r in rows))
        describe(panel, name, "median and 99th percentile [µs]; dotted: 1 kHz", "")
        panel.set_yticks(range(len(scenes)), scenes, fontsize=LETTERS)
        panel.set_ylim(len(scenes) - 0.4, -0.6)
    labels = panels[0].get_legend_handles_labels()
    figure.legend(*labels, fontsize=LETTERS, loc="outside lower center", ncols=3, frameon=False)
    return figure


def over_bar(panel: Axes, text: str, x: float, y: float) -> None:
    """Write a text above a bar."""
    panel.annotate(text, (x, y), (0, 2), textcoords="offset points", ha="center", fontsize=LETTERS - 0.5)
