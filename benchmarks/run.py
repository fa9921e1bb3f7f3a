"""Time and error of the fit beside the paper's method, in one run: a table, a CSV file and the README's chart.

    python benchmarks/run.py [--repeats N]

"ours, same planes" fits the same mesh along the very planes of the paper's method; "ours" lets the planes go where they
lower the error most, with as many of them; "ours, auto" finds the smallest net for a tolerance, proof included. All
surfaces are measured by the same exact distances. Times are the median of N runs from mesh to surface, without reading
files. Links under ``../shared/data`` are added where that folder is.
"""

import argparse
import csv
import importlib.util
import sys
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from time import perf_counter

import numpy as np

ROOT = Path(__file__).resolve().parent.parent
SHARED = ROOT.parent / "shared" / "data"
sys.path[:0] = [str(ROOT / "benchmarks"), str(ROOT / "sample_scenes")]

import paper_method  # noqa: E402
import shapes as samples  # noqa: E402

from skin_calib_addon.geometry import (  # noqa: E402
    Axis,
    BSplineSurface,
    TriangleMesh,
    TubeGrid,
    fit_surface,
    fit_to_tolerance,
    load_mesh,
    weld,
)
from skin_calib_addon.geometry.axis import frame_of  # noqa: E402
from skin_calib_addon.geometry.bspline import clamped_knots  # noqa: E402
from skin_calib_addon.geometry.distance import MeshDistance, surface_samples  # noqa: E402

SIZES = ((5, 5), (5, 10), (10, 5), (10, 10), (20, 30))
TOLERANCES = {"bundled wrist": (0.1, 0.02), "wrist sample": (0.5, 0.1, 0.02), "HRP-4C wrist": (0.5, 0.2, 0.1)}  # [mm]
# Sensors 2023, 23, 4569, Table 2: mean and largest distance [mm], time [ms] on the authors' laptop.
TABLE_2 = {(5, 5): (0.987, 3.820, 344), (5, 10): (0.824, 3.856, 414), (10, 5): (1.006, 3.820, 598)}
TABLE_2 |= {(10, 10): (0.854, 3.856, 766)}


@dataclass(frozen=True)
class Link:
    """A tube-like mesh, and the axis and margin that both methods are given."""

    name: str
    mesh: TriangleMesh
    axis: Axis
    margin: float


@dataclass(frozen=True)
class Row:
    """One method on one link with one grid; distances from surface to mesh [mm]."""

    link: str
    method: str
    n: int
    m: float
    mean: float
    max: float
    milliseconds: float


def links():
    """The bundled wrist, and where the data is there, the wrist sample of the targets and the paper's own link."""
    mesh = samples.wrist()
    z = Axis((0.0015, 0.0005, 0.0), (0.0, 0.0, 1.0))
    yield Link("bundled wrist", weld(mesh.vertices, mesh.faces), z, 0.002)
    if not SHARED.is_dir():
        print(f"no {SHARED.name} folder beside the project: the real links are left out", file=sys.stderr)
        return
    shape = load_module(SHARED / "shapes.py").wrist()
    axis = Axis((0.0032, 0.0008, 0.0), (0.0, 0.0, 1.0))
    yield Link("wrist sample", weld(shape["mesh"].vertices / 1e3, shape["mesh"].faces), axis, 0.002)
    axis = Axis((-0.0016, -0.0027, -0.1908), (0.0174, -0.0167, 0.9997))
    cover = load_mesh(SHARED / "meshes" / "hrp4c_r_wrist_y_cover_only.stl")
    yield Link("HRP-4C wrist", cover, axis, 0.007)


def load_module(path):
    """A Python file as a module, whatever it is called: ours and theirs are both ``shapes``."""
    spec = importlib.util.spec_from_file_location("target_shapes", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def timed(function, repeats):
    """Result of a function and the median of its times [ms]; the first run, which fills caches, is not counted."""
    result, times = function(), []
    for _ in range(repeats):
        start = perf_counter()
        result = function()
        times.append(perf_counter() - start)
    return result, 1e3 * median(times)


def ours(link, n, m, spacing):
    """Our surface along n planes and 2 m lines."""
    return fit_surface(link.mesh, TubeGrid(n, 2 * m, link.axis, link.margin, spacing)).surface


def auto(link, tolerance):
    """Our smallest fit with a mean error within a tolerance [mm]."""
    return fit_to_tolerance(link.mesh, tolerance / 1e3, axis=link.axis, margin=link.margin)


def paper(link, n, m, solver):
    """The paper's surface along the same planes, as one of ours so that it is measured alike."""
    frame = frame_of(np.array(link.axis.point), np.array(link.axis.direction))
    height = frame.stations(link.mesh.vertices)
    stations = np.linspace(height.min() + link.margin, height.max() - link.margin, n)
    u_planes = np.stack((frame.planes(stations).points, frame.planes(stations).normals), axis=1)
    outward = frame.rays(np.arange(2 * m) * np.pi / m)
    v_planes = np.stack(np.broadcast_arrays(frame.point, frame.e3, outward), axis=1)
    return paper_method.fit(link.mesh.vertices, link.mesh.faces, u_planes, v_planes, solver=solver)


def as_surface(fit):
    """A geomdl surface of cubic clamped uniform knots as one of ours."""
    n, m, _ = fit.control_net.shape
    return BSplineSurface(fit.control_net, clamped_knots(n, 3), clamped_knots(m, 3), (3, 3))


def errors(distance, surface):
    """Area-weighted mean and maximum of the distance from surface to mesh [mm]."""
    uv, weights = surface_samples(surface)
    d = distance(surface.points(uv))[0] * 1e3
    return float(weights @ d / weights.sum()), float(d.max())


def measure(repeats):
    """All rows."""
    for link in links():
        distance = MeshDistance(link.mesh)
        for n, m in SIZES:
            for method, spacing in (("ours, same planes", "uniform"), ("ours", "auto")):
                surface, time = timed(lambda n=n, m=m, s=spacing: ours(link, n, m, s), repeats)  # noqa: B023
                yield Row(link.name, method, n, m, *errors(distance, surface), time)
            fit, time = timed(lambda n=n, m=m: paper(link, n, m, "linear"), repeats)  # noqa: B023
            yield Row(link.name, "paper, linear", n, m, *errors(distance, as_surface(fit)), time)
            if (n, m) == (10, 10):
                fit, time = timed(lambda n=n, m=m: paper(link, n, m, "nlls"), max(1, repeats // 4))  # noqa: B023
                yield Row(link.name, "paper, NLLS", n, m, *errors(distance, as_surface(fit)), time)
        for tolerance in TOLERANCES[link.name]:
            fit, time = timed(lambda t=tolerance: auto(link, t), max(1, repeats // 3))  # noqa: B023
            n, lines = fit.lines.origins.shape[:2]
            yield Row(link.name, f"ours, auto {tolerance} mm", n, lines / 2, *errors(distance, fit.surface), time)


def table(rows):
    """Markdown: each row beside ours on the same link and grid, and the paper's own figures."""
    text = ["| link | n x m | method | mean [mm] | max [mm] | time [ms] | mean / first | time / first |"]
    text.append("|---|---|---|---|---|---|---|---|")
    best = {(r.link, r.n, r.m): r for r in rows if r.method == "ours, same planes"}
    for r in rows:
        own = best.get((r.link, r.n, r.m))
        ratios = "– | –"
        if own and "auto" not in r.method:
            ratios = f"{r.mean / own.mean:.2f} | {r.milliseconds / own.milliseconds:.1f}"
        figures = f"{r.mean:.4f} | {r.max:.3f} | {r.milliseconds:.1f}"
        text.append(f"| {r.link} | {r.n} x {r.m:g} | {r.method} | {figures} | {ratios} |")
        if r.link == "HRP-4C wrist" and r.method == "paper, linear" and (r.n, r.m) in TABLE_2:
            mean, largest, time = TABLE_2[r.n, r.m]
            text.append(f"| {r.link} | {r.n} x {r.m} | paper, its Table 2 | {mean} | {largest} | {time} | – | – |")
    return "\n".join(text)


def draw(rows, path):
    """Time against error, a panel per link."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    names = list(dict.fromkeys(r.link for r in rows))
    figure = Figure(figsize=(4.6 * len(names), 4.2), dpi=110)
    FigureCanvasAgg(figure)
    styles = {
        "ours, same planes": ("o", "#7fb2e5"),
        "ours": ("o", "#1f4e99"),
        "ours, auto": ("*", "#2ca02c"),
        "paper, linear": ("s", "#d62728"),
        "paper, NLLS": ("^", "#ff7f0e"),
    }
    for axis, name in zip(np.atleast_1d(figure.subplots(1, len(names))), names):
        for method, (marker, colour) in styles.items():
            chosen = [r for r in rows if r.link == name and (r.method == method or r.method.startswith(f"{method} "))]
            axis.plot(
                [r.milliseconds for r in chosen],
                [r.mean for r in chosen],
                marker,
                color=colour,
                label=method,
                markersize=7,
            )
            for r in chosen:
                axis.annotate(
                    f"{r.n}x{r.m:g}", (r.milliseconds, r.mean), (4, 4), textcoords="offset points", fontsize=7
                )
        axis.set(xscale="log", yscale="log", xlabel="time [ms]", ylabel="mean distance to the mesh [mm]", title=name)
        axis.grid(True, which="both", alpha=0.25)
        axis.legend(fontsize=8)
    figure.tight_layout()
    figure.savefig(path, metadata={"Software": None})


def main():
    """Measure, print, write."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeats", type=int, default=9)
    rows = list(measure(parser.parse_args().repeats))
    print(table(rows))
    out = ROOT / "out"
    out.mkdir(exist_ok=True)
    with open(out / "benchmark.csv", "w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(Row.__dataclass_fields__)
        writer.writerows([getattr(r, f) for f in Row.__dataclass_fields__] for r in rows)
    draw(rows, ROOT / "docs" / "benchmark.png")


if __name__ == "__main__":
    main()
