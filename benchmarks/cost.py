"""Cost: time against the faces of the mesh and against control points, with counts that no machine changes."""

import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import methods
import numpy as np
import peers
from links import Link, bundled_wrist, has_shapes
from measure import timed
from stability import PLANES, wrist_link
from trimesh.remesh import subdivide

from skin_calib_addon.geometry import SurfaceFit, weld

FACES = (1e3, 3e3, 1e4, 3e4, 1e5, 3e5, 1e6)
NETS = ((10, 20), (14, 28), (20, 40), (28, 56), (40, 80))  # planes, lines
LINES = 20
TOO_LONG = 10e3  # [ms] after which a series ends
COMPARED = ("splipy", "geomdl")


@dataclass(frozen=True)
class Row:
    """One fit: its time, and the counts of ours."""

    series: str  # "faces" or "control points"
    method: str
    faces: int
    control_points: int  # the unknowns of ours: one offset each
    milliseconds: float
    cut: int | None  # pairs of a face and a row of samples that crosses it
    samples: int | None
    passes: int | None


def measure(repeats: int) -> Iterator[Row]:
    """Yield all rows."""
    yield from series("faces", ((link, PLANES, LINES) for link in refined_wrists()), repeats)
    wrist = wrist_of(1e4) if has_shapes() else bundled_wrist()
    yield from series("control points", ((wrist, n, lines) for n, lines in NETS), repeats)


def refined_wrists() -> Iterator[Link]:
    """Yield the wrist sample with more and more faces; where it is absent, subdivisions of the bundled one."""
    if has_shapes():
        yield from map(wrist_of, FACES)
        return
    link = bundled_wrist()
    while len(link.mesh.faces) <= FACES[-1]:
        yield link
        link = replace(link, mesh=weld(*subdivide(link.mesh.vertices, link.mesh.faces)))


def wrist_of(faces: float) -> Link:
    """Return the wrist sample with a number of faces."""
    around = round(float(np.sqrt(faces / (2 * 0.52))))
    return wrist_link(nt=around, nz=round(0.52 * around) + 1)


def series(name: str, cases: Iterator[tuple[Link, int, int]], repeats: int) -> Iterator[Row]:
    """Yield every method on every case, until it takes too long."""
    present, tired = peers.installed(), set()
    for link, n, lines in cases:
        count = len(link.mesh.faces)
        print(f"{name}: {count} faces, {n} x {lines}", file=sys.stderr)
        for method, fit in fits(link, n, lines, present):
            if method in tired:
                continue
            made, milliseconds = timed(fit, repeats)
            if milliseconds > TOO_LONG:
                tired.add(method)
            counts = (None, None, None)
            if isinstance(made, SurfaceFit):
                counts = faces_cut(made), made.residuals.size, made.iterations
            yield Row(name, method, count, n * lines, milliseconds, *counts)


def fits(link: Link, n: int, lines: int, present: dict) -> Iterator[tuple[str, Callable]]:
    """Yield the fits to time on one case."""
    yield methods.PLACED, lambda: methods.ours(link, n, lines)
    yield methods.SAME, lambda: methods.ours(link, n, lines, "uniform")
    yield methods.LETTER, lambda: methods.letter(link, link.fan, n, lines)
    yield methods.STRENGTHENED, lambda: methods.strengthened(link, link.fan, n, lines)
    for name in COMPARED:
        if name in present:
            _, words, per_span = next(present[name].tasks(n * lines))
            yield name, present[name].prepare(peers.Task(link, link.fan, n, lines), words, per_span)


def faces_cut(fit: SurfaceFit) -> int:
    """Return the number of pairs of a face and a row of samples that crosses it."""
    axis = fit.lines.planes_u.normals[0]
    rows = np.sort(np.nanmean(fit.points @ axis, axis=1))
    height = np.sort((fit.mesh.vertices @ axis)[fit.mesh.faces], axis=1)
    return int((np.searchsorted(rows, height[:, 2]) - np.searchsorted(rows, height[:, 0])).sum())


def table(rows: list[Row]) -> str:
    """Return times side by side, and the counts of ours, as Markdown."""
    names = list(dict.fromkeys(r.method for r in rows))
    heads = "faces cut | samples | iterations | unknowns"
    text = [f"| faces | control points | {' | '.join(f'{name} [ms]' for name in names)} | {heads} |"]
    text.append("|" + "---|" * (len(names) + 6))
    cases: dict[tuple, dict[str, Row]] = {}
    for r in rows:
        cases.setdefault((r.series, r.faces, r.control_points), {})[r.method] = r
    for (_, faces, unknowns), found in cases.items():
        times = [f"{found[name].milliseconds:.1f}" if name in found else "–" for name in names]
        own = found[methods.PLACED]
        counts = f"{own.cut} | {own.samples} | {own.passes} | {unknowns}"
        text.append(f"| {faces} | {unknowns} | {' | '.join(times)} | {counts} |")
    return "\n".join(text)
