"""Time against error: ours, the paper's method and every peer on every link, at several sizes.

``verdict.py`` compares the rows: which peers are ahead of which mode of ours, and which no mode of ours dominates.
"""

import sys
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial

import methods
import numpy as np
import peers
from cold import cold_milliseconds
from links import PAPERS_LINK, Link, link_of, present_links
from measure import Deviation, Judge, Row, Surface, timed
from verdict import verdict

SIZES = ((5, 5), (5, 10), (10, 5), (10, 10), (20, 30))  # u-planes, full v-planes
PEER_SIZES = SIZES[0], SIZES[1], SIZES[3], SIZES[4]
NLLS_SIZE = (10, 10)
SMOOTH_TOLERANCES = (0.5, 0.1, 0.02)  # [mm], on shapes from formulas
REAL_TOLERANCES = (0.5, 0.2, 0.1)  # [mm], on robots: less than that is below the size of their facets
TOO_LONG = 1000.0  # [ms] after which no tighter tolerance is tried
# The links of the README's figure: the paper's, a wrist with a known surface, sharp edges, and an ugly one.
README_LINKS = (PAPERS_LINK, "wrist sample", "rounded square", "iCub thigh")
QUICK_SIZES = (SIZES[0], SIZES[3])
# Sensors 2023, 23, 4569, Table 2: mean and largest distance [mm], time [ms] on the authors' laptop.
TABLE_2 = {(5, 5): (0.987, 3.820, 344), (5, 10): (0.824, 3.856, 414), (10, 5): (1.006, 3.820, 598)}
TABLE_2 |= {(10, 10): (0.854, 3.856, 766)}


@dataclass(frozen=True)
class Method:
    """A fit that is timed, and the function that reads its result as a surface."""

    name: str
    prepare: Callable[[Link], Callable]  # off the clock; picklable, for processes of their own
    surface: Callable[..., Surface]
    variant: str = ""


def measure(repeats: int, quick: bool = False) -> Iterator[Row]:
    """Yield all rows; ``quick``: those of the README's links at two sizes."""
    chosen = [name for name in present_links() if name in README_LINKS or not quick]
    for name in chosen:
        judge = Judge(link_of(name))
        print(f"{name}: {len(judge.link.mesh.faces)} faces", file=sys.stderr)
        for n, m in QUICK_SIZES if quick else SIZES:
            for method in (*methods_at(judge.link, n, m), *peers_at(judge.link, n, m)):
                yield run(judge, method, n, m, repeats)
        yield from auto_rows(judge, repeats)


def auto_rows(judge: Judge, repeats: int) -> Iterator[Row]:
    """Yield the smallest nets for tighter and tighter tolerances, until one fails or takes too long."""
    for tolerance in REAL_TOLERANCES if judge.link.real else SMOOTH_TOLERANCES:
        prepare = partial(prepared, fit=methods.auto, tolerance=tolerance)
        row = run(judge, Method(methods.AUTO, prepare, methods.surface_of_ours, f"{tolerance} mm"), 0, 0, repeats)
        yield row
        if row.failed or row.milliseconds > TOO_LONG:
            break


def methods_at(link: Link, n: int, m: int) -> Iterator[Method]:
    """Yield ours and both readings of the paper's method at one size."""
    lines = link.lines(m)
    for name, spacing in ((methods.SAME, "uniform"), (methods.PLACED, "auto")):
        prepare = partial(prepared, fit=methods.ours, n=n, lines=lines, spacing=spacing)
        yield Method(name, prepare, methods.surface_of_ours)
    if (n, m) in PEER_SIZES:
        prepare = partial(prepared, fit=methods.ours_best, control_points=n * lines)
        yield Method(methods.BEST_NET, prepare, methods.surface_of_ours)
    for parameters in ("Greville", "uniform"):
        prepare = partial(of_paper, fit=methods.letter, n=n, lines=lines, parameters=parameters.lower())
        yield Method(methods.LETTER, prepare, methods.surface_of_paper, f"{parameters} parameters")
    for name, solver in ((methods.STRENGTHENED, "linear"), (methods.STRENGTHENED_NLLS, "nlls")):
        if solver == "linear" or (n, m) == NLLS_SIZE:
            prepare = partial(of_paper, fit=methods.strengthened, n=n, lines=lines, solver=solver)
            yield Method(name, prepare, methods.surface_of_paper)


def peers_at(link: Link, n: int, m: int) -> Iterator[Method]:
    """Yield every variant of every peer at one size."""
    if (n, m) not in PEER_SIZES:
        return
    for name, peer in peers.installed().items():
        for variant, words, per_span in peer.tasks(n * link.lines(m)):
            prepare = partial(of_peer, name=name, words=words, n=n, m=m, per_span=per_span)
            yield Method(name, prepare, surface_itself, variant)


def prepared(link: Link, fit: Callable, **words) -> Callable:
    """Return one of our fits, ready to call."""
    return partial(fit, link, **words)


def of_paper(link: Link, fit: Callable, **words) -> Callable:
    """Return a fit of the paper's method along our even planes, ready to call."""
    return partial(fit, link, link.fan, **words)


def of_peer(link: Link, name: str, words: dict, n: int, m: int, per_span: int) -> Callable:
    """Return a peer's fit, ready to call."""
    return peers.PEERS[name].prepare(peers.Task(link, link.fan, n, link.lines(m)), words, per_span)


def surface_itself(surface: Surface) -> Surface:
    """Return the result of a peer, which is a surface."""
    return surface


def run(judge: Judge, method: Method, n: int, m: float, repeats: int) -> Row:
    """Time and measure one method; a failure is a row with the reason."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # FITPACK's own; the errors show what they warn of
            fit, milliseconds = timed(method.prepare(judge.link), repeats)
        surface = method.surface(fit)
        if not n:  # auto: the size is a result
            n, lines = fit.lines.origins.shape[:2]
            m = lines / judge.link.lines(1)
        d: Deviation = judge(surface)
    except Exception as error:  # whatever a library raises is its result here
        text = f"{type(error).__name__}: {error}".replace("\n", " ").strip()
        return Row(judge.link.name, method.name, method.variant, n, m, 0, *[np.nan] * 6, text)
    cold = cold_milliseconds(judge.link.name, method.prepare)
    figures = d.mean, d.max, d.truth_mean, d.truth_max, milliseconds, cold
    return Row(judge.link.name, method.name, method.variant, n, m, surface.control_points, *figures, surface.note)


def best_variants(rows: list[Row]) -> dict[tuple, Row]:
    """Return the variant with the least error by link, method and size; every result of ``auto``."""
    best: dict[tuple, Row] = {}
    for r in rows:
        key = r.link, r.method, r.n, r.m, r.variant if r.method == methods.AUTO else ""
        if key not in best or r.mean < best[key].mean or best[key].failed:
            best[key] = r
    return best


def table(rows: list[Row]) -> str:
    """Return all tables as Markdown."""
    best = best_variants(rows)
    parts = side_by_side(best), papers_table(best), auto_table(rows), verdict(rows)
    return "\n\n".join(part for part in parts if part)


def side_by_side(best: dict[tuple, Row]) -> str:
    """Return mean distance to the mesh, warm and cold time of every method, a line for every link and size."""
    names = list(dict.fromkeys(r.method for r in best.values() if r.method != methods.AUTO))
    text = [f"| mean [mm], time warm / cold [ms] | n x m | {' | '.join(names)} |", "|" + "---|" * (len(names) + 2)]
    for link in dict.fromkeys(r.link for r in best.values()):
        for n, m in SIZES:
            found = [best.get((link, name, n, m, "")) for name in names]
            if any(found):
                cells = ["" if r is None else "failed" if r.failed else figures(r) for r in found]
                text.append(f"| {link} | {n} x {m} | {' | '.join(cells)} |")
    return "\n".join(text)


def figures(row: Row) -> str:
    """Return mean and times, and the number of control points where the method chose it."""
    chosen = f" ({row.control_points} points)" if "tol" in row.note else ""
    return f"{row.mean:.4f}, {row.milliseconds:.1f} / {row.cold_milliseconds:.1f}{chosen}"


def papers_table(best: dict[tuple, Row]) -> str:
    """Return ours and the paper's method next to the paper's own figures for its link; nothing without the link."""
    if not any(link == PAPERS_LINK for link, *_ in best):
        return ""
    head = "method | mean [mm] | max [mm] | warm [ms] | cold [ms] | mean / first | time / first"
    text = [f"| {PAPERS_LINK} | {head} |", "|" + "---|" * 8]
    names = (methods.SAME, methods.PLACED, methods.LETTER, methods.STRENGTHENED, methods.STRENGTHENED_NLLS)
    for n, m in SIZES:
        found = [best[PAPERS_LINK, name, n, m, ""] for name in names if (PAPERS_LINK, name, n, m, "") in best]
        for r in found:
            times = f"{r.milliseconds:.1f} | {r.cold_milliseconds:.1f}"
            ratios = f"{r.mean / found[0].mean:.2f} | {r.milliseconds / found[0].milliseconds:.1f}"
            text.append(f"| {n} x {m} | {r.method} | {r.mean:.4f} | {r.max:.3f} | {times} | {ratios} |")
        if found and (n, m) in TABLE_2:
            mean, largest, time = TABLE_2[n, m]
            text.append(f"| {n} x {m} | paper, its Table 2 | {mean} | {largest} | {time} | – | – | – |")
    return "\n".join(text)


def auto_table(rows: list[Row]) -> str:
    """Return the nets that ``auto`` found."""
    text = ["| link | tolerance | n x m | control points | mean [mm] | warm [ms] | cold [ms] |", "|" + "---|" * 7]
    for r in rows:
        if r.method == methods.AUTO:
            times = f"{r.milliseconds:.1f} | {r.cold_milliseconds:.1f}"
            result = f"{r.n} x {r.m:g} | {r.control_points} | {r.mean:.4f} | {times}"
            text.append(f"| {r.link} | {r.variant} | {f'{r.note} | | | |' if r.failed else result} |")
    return "\n".join(text)
