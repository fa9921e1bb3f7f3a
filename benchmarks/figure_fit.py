"""The figures of time against error: four panels for the README, all panels for the documentation."""

from dataclasses import replace

from figure_style import OURS_COLOUR, PAPER_COLOUR, STYLES, curve, describe, figure_of, labels, legend
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from measure import Row
from methods import AUTO, BEST_NET, LETTER, PLACED, SAME, STRENGTHENED
from time_error import README_LINKS, best_variants

JOINED = ((5, 5), (5, 10), (10, 10), (20, 30))  # sizes along a method's line; 10 x 5 is a point next to it
LABELLED = ((5, 5), (10, 10), (20, 30))
HIGHEST = 10.0  # times the largest error of ours and the paper's method: points above this are not drawn
FRONT = {"color": "black", "linewidth": 1.2, "linestyle": (0, (4, 2))}


def draw_readme(rows: list[Row]) -> Figure:
    """Draw the four links of the README, with one marker per library; a link that was not measured is left out."""
    names = [name for name in README_LINKS if any(r.link == name for r in rows)]
    for name in README_LINKS:
        if name not in names:
            print(f"{name} was not measured: its panel is left out")
    best = [replace(r, method=library(r.method)) for r in best_variants(rows).values()]
    return draw(best, names or sorted({r.link for r in rows}), 2, 3.7)


def library(method: str) -> str:
    """Return the library of a peer, or the method itself."""
    return next((name for name in ("OpenCASCADE", "SciPy") if method.startswith(name)), method)


def draw_all_links(rows: list[Row]) -> Figure:
    """Draw every link, with the best variant of each method."""
    return draw(list(best_variants(rows).values()), list(dict.fromkeys(r.link for r in rows)), 3, 2.9)


def draw(rows: list[Row], names: list[str], columns: int, height: float) -> Figure:
    """Draw a panel per link: how long a fit takes, and its mean distance to the mesh."""
    title = "Mean distance to the mesh against time of a fit: lower left is better"
    figure, panels = figure_of(len(names), min(columns, len(names)), title, height)
    used: set[str] = set()
    texts = []
    for panel, name in zip(panels, names):
        found = [r for r in rows if r.link == name and not r.failed]
        used |= draw_panel(panel, found)
        describe(panel, name, "time of a fit, warm [ms]", "mean distance [mm]")
        texts.append(texts_of(found, every=columns == 2))
    legend(figure, used, 4, (Line2D([], [], label="Pareto front", **FRONT),))
    figure.draw_without_rendering()  # the panels get their final sizes
    for panel, chosen in zip(panels, texts):
        labels(panel, chosen)
    return figure


def draw_panel(panel: Axes, found: list[Row]) -> set[str]:
    """Draw all methods on one link and return their names."""
    own = [r.mean for r in found if r.method.startswith(("ours", "paper"))]
    highest = HIGHEST * max(own)
    shown = [r for r in found if r.mean <= highest]
    for method in STYLES:
        chosen = [r for r in shown if r.method == method]
        line = [r for r in chosen if (r.n, r.m) in JOINED or method == AUTO]
        for part in (line, [r for r in chosen if r not in line]):
            curve(panel, method, [r.milliseconds for r in part], [r.mean for r in part])
    times, errors = staircase(pareto(shown))
    panel.set(xscale="log", yscale="log")
    panel.margins(0.08)
    limits = panel.get_xlim(), panel.get_ylim()
    panel.plot([*times, limits[0][1]], [*errors, errors[-1]], zorder=3.5, **FRONT)
    panel.plot([times[0], times[0]], [limits[1][1], errors[0]], zorder=3.5, **FRONT)
    panel.set(xlim=limits[0], ylim=limits[1])
    return {r.method for r in shown}


def pareto(rows: list[Row]) -> list[Row]:
    """Return the rows that no other row beats in time and error, from the fastest on."""
    front: list[Row] = []
    for r in sorted(rows, key=lambda r: (r.milliseconds, r.mean)):
        if not front or r.mean < front[-1].mean:
            front.append(r)
    return front


def staircase(front: list[Row]) -> tuple[list[float], list[float]]:
    """Return the corners of the line below which no method is."""
    times, errors = [front[0].milliseconds], [front[0].mean]
    for r in front[1:]:
        times += [r.milliseconds, r.milliseconds]
        errors += [errors[-1], r.mean]
    return times, errors


def texts_of(found: list[Row], every: bool) -> list[tuple[str, float, float, str]]:
    """Return the labels of a panel, the most important first: tolerances, sizes of ours and of the paper's method."""
    colours = {AUTO: STYLES[AUTO][1], PLACED: OURS_COLOUR}
    if every:
        colours |= {LETTER: PAPER_COLOUR, SAME: "#3f78d0", STRENGTHENED: PAPER_COLOUR, BEST_NET: STYLES[BEST_NET][1]}
    return [
        (r.variant if method == AUTO else f"{r.n}×{r.m:g}", r.milliseconds, r.mean, colour)
        for method, colour in colours.items()
        for r in found
        if r.method == method and (method == AUTO or (r.n, r.m) in LABELLED)
    ]
