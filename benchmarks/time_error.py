"""Time against error: ours, the paper's method and every peer on every link, at several sizes; and who is ahead."""

import sys
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import methods
import numpy as np
import peers
from links import Link, all_links
from measure import Deviation, Judge, Surface, timed

SIZES = ((5, 5), (5, 10), (10, 5), (10, 10), (20, 30))  # u-planes, full v-planes
PEER_SIZES = SIZES[1], SIZES[3], SIZES[4]
NLLS_SIZE = (10, 10)
SMOOTH_TOLERANCES = (0.5, 0.1, 0.02)  # [mm], on shapes that somebody wrote down
REAL_TOLERANCES = (0.5, 0.2, 0.1)  # [mm], on robots: what is finer is finer than their facets and takes long to find
TOO_LONG = 1000.0  # [ms] after which no tighter tolerance is tried
LEVEL = 0.02  # share of a mean by which the places where it is measured alter it: what is nearer is level
# Sensors 2023, 23, 4569, Table 2: mean and largest distance [mm], time [ms] on the authors' laptop.
TABLE_2 = {(5, 5): (0.987, 3.820, 344), (5, 10): (0.824, 3.856, 414), (10, 5): (1.006, 3.820, 598)}
TABLE_2 |= {(10, 10): (0.854, 3.856, 766)}
PAPERS_LINK = "HRP-4C wrist"
OURS = "ours"
BEST_NET = "ours, best net"
OURS_AT_A_SIZE = ("ours, same planes", OURS, BEST_NET)


@dataclass(frozen=True)
class Row:
    """One method on one link at one size; distances [mm]."""

    link: str
    method: str
    variant: str
    n: int
    m: float
    control_points: int
    mean: float
    max: float
    truth_mean: float
    truth_max: float
    milliseconds: float
    note: str

    @property
    def failed(self) -> bool:
        """Whether there is no surface to speak of."""
        return not np.isfinite(self.mean)


@dataclass(frozen=True)
class Method:
    """What is run and timed: a fit, and how its result is read as a surface."""

    name: str
    fit: Callable
    surface: Callable[..., Surface]
    variant: str = ""


def measure(repeats: int) -> Iterator[Row]:
    """All rows."""
    present = peers.installed()
    for link in all_links():
        print(f"{link.name}: {len(link.mesh.faces)} faces", file=sys.stderr)
        judge = Judge(link)
        for n, m in SIZES:
            for method in methods_at(link, n, m):
                yield run(judge, method, n, m, repeats)
            if (n, m) in PEER_SIZES:
                task = peers.Task(link, link.fan, n, link.lines(m))
                for name, peer in present.items():
                    for variant, prepare in peer.tasks(task):
                        yield run_peer(judge, name, variant, prepare, n, m, repeats)
        yield from auto_rows(judge, repeats)


def auto_rows(judge: Judge, repeats: int) -> Iterator[Row]:
    """What ``auto`` answers to tighter and tighter tolerances, until one is out of reach or takes too long."""
    for tolerance in REAL_TOLERANCES if judge.link.real else SMOOTH_TOLERANCES:
        fit = lambda t=tolerance: methods.auto(judge.link, t)  # noqa: E731
        row = run(judge, Method("ours, auto", fit, methods.surface_of_ours, f"{tolerance} mm"), 0, 0, repeats)
        yield row
        if row.failed or row.milliseconds > TOO_LONG:
            break


def methods_at(link: Link, n: int, m: int) -> Iterator[Method]:
    """Ours and the paper's method at one size."""
    lines = link.lines(m)
    for name, spacing in (("ours, same planes", "uniform"), (OURS, "auto")):
        yield Method(name, lambda s=spacing: methods.ours(link, n, lines, s), methods.surface_of_ours)
    if (n, m) in PEER_SIZES:
        yield Method(BEST_NET, lambda: methods.ours_best(link, n * lines), methods.surface_of_ours)
    readings = [("good parameters", "linear", "good"), ("uniform parameters", "linear", "uniform")]
    if (n, m) == NLLS_SIZE:
        readings.append(("NLLS", "nlls", "good"))
    for name, solver, parameters in readings:
        fit = lambda s=solver, p=parameters: methods.paper(link, link.fan, n, lines, s, p)  # noqa: E731
        yield Method(f"paper, {name}", fit, methods.surface_of_paper)


def run(judge: Judge, method: Method, n: int, m: float, repeats: int) -> Row:
    """Time and measure one method; what fails is a row that says why."""
    try:
        fit, milliseconds = timed(method.fit, repeats)
        surface = method.surface(fit)
        if not n:  # auto: the size is its answer
            n, lines = fit.lines.origins.shape[:2]
            m = lines / judge.link.lines(1)
        return row_of(judge, method.name, method.variant, n, m, surface, milliseconds)
    except Exception as error:  # whatever a library raises is its result here
        return failure(judge, method.name, method.variant, n, m, error)


def run_peer(judge: Judge, name: str, variant: str, prepare: Callable, n: int, m: int, repeats: int) -> Row:
    """Time and measure one peer."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # FITPACK's own; the errors show what they warn of
            surface, milliseconds = timed(prepare(), repeats)
            return row_of(judge, name, variant, n, m, surface, milliseconds)
    except Exception as error:
        return failure(judge, name, variant, n, m, error)


def row_of(judge: Judge, method: str, variant: str, n: int, m: float, surface: Surface, milliseconds: float) -> Row:
    """Measured; ValueError if it is no surface."""
    d: Deviation = judge(surface)
    figures = d.mean, d.max, d.truth_mean, d.truth_max
    return Row(judge.link.name, method, variant, n, m, surface.control_points, *figures, milliseconds, surface.note)


def failure(judge: Judge, method: str, variant: str, n: int, m: float, error: Exception) -> Row:
    """A row without figures."""
    text = f"{type(error).__name__}: {error}".replace("\n", " ").strip()
    return Row(judge.link.name, method, variant, n, m, 0, *[np.nan] * 5, text)


def is_peer(row: Row) -> bool:
    """Whether a row is neither ours nor the paper's."""
    return not row.method.startswith((OURS, "paper"))


def ahead(rows: list[Row]) -> list[tuple[Row, Row, str]]:
    """Peers that are faster and more accurate than the most accurate of ours, with no more control points.

    Each with our row, and what its mean is nearer to: the mesh, the truth or both. Where ours refuses, every peer that
    gives a surface is ahead.
    """
    found = []
    own = most_accurate_of_ours(rows)
    for r in filter(is_peer, rows):
        mine = own[r.link, r.n, r.m]
        if r.failed:
            continue
        if mine.failed:
            found.append((r, mine, "mesh"))
        elif r.milliseconds < mine.milliseconds and r.control_points <= mine.control_points:
            means = {"mesh": (r.mean, mine.mean), "truth": (r.truth_mean, mine.truth_mean)}
            nearer = [what for what, (theirs, ours) in means.items() if theirs < ours]
            if nearer:
                found.append((r, mine, " and ".join(nearer)))
    return found


def most_accurate_of_ours(rows: list[Row]) -> dict[tuple, Row]:
    """Of every link and size our surface nearest to the mesh, along even planes, placed ones, or in the best net."""
    best: dict[tuple, Row] = {}
    for r in rows:
        key = r.link, r.n, r.m
        if r.method in OURS_AT_A_SIZE and (key not in best or best[key].failed or r.mean < best[key].mean):
            best[key] = r
    return best


def best_variants(rows: list[Row]) -> dict[tuple, Row]:
    """Of every link, method and size the variant with the least error; every answer of ``auto``."""
    best: dict[tuple, Row] = {}
    for r in rows:
        key = r.link, r.method, r.n, r.m, r.variant if r.method == "ours, auto" else ""
        if key not in best or r.mean < best[key].mean or best[key].failed:
            best[key] = r
    return best


def table(rows: list[Row]) -> str:
    """Markdown: everybody side by side, the paper's own figures, what ``auto`` found, and who is ahead."""
    best = best_variants(rows)
    parts = side_by_side(best), papers_table(best), auto_table(rows), verdict(rows)
    return "\n\n".join(part for part in parts if part)


def side_by_side(best: dict[tuple, Row]) -> str:
    """Mean distance to the mesh [mm] and time [ms] of everybody, a line for every link and size."""
    names = list(dict.fromkeys(r.method for r in best.values() if r.method != "ours, auto"))
    text = [f"| mean [mm], time [ms] | n x m | {' | '.join(names)} |", "|" + "---|" * (len(names) + 2)]
    for link in dict.fromkeys(r.link for r in best.values()):
        for n, m in SIZES:
            found = [best.get((link, name, n, m, "")) for name in names]
            cells = ["" if r is None else "failed" if r.failed else figures(r) for r in found]
            text.append(f"| {link} | {n} x {m} | {' | '.join(cells)} |")
    return "\n".join(text)


def figures(row: Row) -> str:
    """Mean and time, and the number of control points where it is not the one asked for."""
    return f"{row.mean:.4f}, {row.milliseconds:.1f}" + (f" ({row.control_points} points)" if "tol" in row.note else "")


def papers_table(best: dict[tuple, Row]) -> str:
    """Ours and the paper's method beside the figures that the paper gives for its link; nothing without the link."""
    if not any(link == PAPERS_LINK for link, *_ in best):
        return ""
    text = [f"| {PAPERS_LINK} | method | mean [mm] | max [mm] | time [ms] | mean / first | time / first |"]
    text.append("|---|---|---|---|---|---|---|")
    for n, m in SIZES:
        names = ("ours, same planes", OURS, "paper, good parameters", "paper, uniform parameters", "paper, NLLS")
        found = [best[PAPERS_LINK, name, n, m, ""] for name in names if (PAPERS_LINK, name, n, m, "") in best]
        for r in found:
            ratios = f"{r.mean / found[0].mean:.2f} | {r.milliseconds / found[0].milliseconds:.1f}"
            text.append(f"| {n} x {m} | {r.method} | {r.mean:.4f} | {r.max:.3f} | {r.milliseconds:.1f} | {ratios} |")
        if found and (n, m) in TABLE_2:
            mean, largest, time = TABLE_2[n, m]
            text.append(f"| {n} x {m} | paper, its Table 2 | {mean} | {largest} | {time} | – | – |")
    return "\n".join(text)


def auto_table(rows: list[Row]) -> str:
    """The nets that ``auto`` found."""
    text = ["| link | tolerance | n x m | control points | mean [mm] | time [ms] |", "|---|---|---|---|---|---|"]
    for r in rows:
        if r.method == "ours, auto":
            answer = f"{r.n} x {r.m:g} | {r.control_points} | {r.mean:.4f} | {r.milliseconds:.1f}"
            text.append(f"| {r.link} | {r.variant} | {f'{r.note} | | |' if r.failed else answer} |")
    return "\n".join(text)


def verdict(rows: list[Row]) -> str:
    """Markdown: every link and size, and the peers ahead of ours."""
    text = ["| link | n x m | ours, mean [mm], time [ms] | ahead of it: variant, mean [mm], time [ms], nearer to |"]
    text.append("|---|---|---|---|")
    found, cells = ahead(rows), {}
    for r, _, what in found:
        best = cells.setdefault((r.link, r.n, r.m), {})
        if r.method not in best or r.mean * r.milliseconds < best[r.method][0].mean * best[r.method][0].milliseconds:
            best[r.method] = r, what
    for mine in most_accurate_of_ours(rows).values():
        if (mine.n, mine.m) not in PEER_SIZES:
            continue
        best = cells.get((mine.link, mine.n, mine.m), {})
        them = [f"{r.method} ({r.variant}) {r.mean:.4f}, {r.milliseconds:.1f}, {what}" for r, what in best.values()]
        own = mine.note if mine.failed else f"{mine.method} {mine.mean:.4f}, {mine.milliseconds:.1f}"
        text.append(f"| {mine.link} | {mine.n} x {mine.m} | {own} | {'; '.join(them) or 'none'} |")
    sizes = sum(r.method == OURS and (r.n, r.m) in PEER_SIZES for r in rows)
    on_mesh = [(r, mine) for r, mine, what in found if "mesh" in what]
    clear = [(r, mine) for r, mine in on_mesh if mine.failed or r.mean < (1 - LEVEL) * mine.mean]
    places, clear_places = ({(r.link, r.n, r.m) for r, _ in pairs} for pairs in (on_mesh, clear))
    text.append(
        f"\nA peer is ahead of ours, measured against the mesh, at {len(places)} of {sizes} links and sizes; at "
        f"{len(clear_places)} by more than the {LEVEL:.0%} to which a mean is known."
    )
    return "\n".join(text)
