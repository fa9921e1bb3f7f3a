"""Which peers are ahead of which mode of ours, each mode at its own time and error.

A peer is ahead of a mode of ours on a link at a size if it needs less time and leaves a smaller error, with no more
control points. A peer is dominated if some mode of ours with no more control points needs no more time and leaves no
larger error; the peers that no mode dominates are on the Pareto front of the link.
"""

from measure import Row
from methods import MODES, is_peer

LEVEL = 0.02  # relative change of a mean with the positions where it is measured: a smaller difference is level


def ahead(rows: list[Row]) -> list[tuple[Row, Row, str]]:
    """Return each peer that is ahead of a mode of ours: its row, ours, and whether its error is to mesh or truth.

    Where a mode of ours fails, every peer that gives a surface is ahead of it.
    """
    own = {(r.link, r.n, r.m, r.method): r for r in rows if r.method in MODES}
    found = []
    for r in rows:
        if r.failed or not is_peer(r.method):
            continue
        for mode in MODES:
            mine = own.get((r.link, r.n, r.m, mode))
            if mine is not None and (nearer := is_ahead(r, mine)):
                found.append((r, mine, nearer))
    return found


def is_ahead(r: Row, mine: Row) -> str:
    """Return to what a peer is nearer than ours in less time: "mesh", "truth", both, or nothing."""
    if mine.failed:
        return "mesh"
    if r.milliseconds >= mine.milliseconds or r.control_points > mine.control_points:
        return ""
    means = {"mesh": (r.mean, mine.mean), "truth": (r.truth_mean, mine.truth_mean)}
    return " and ".join(what for what, (theirs, ours) in means.items() if theirs < ours)


def not_dominated(rows: list[Row]) -> list[Row]:
    """Return the peers on the Pareto front of their link: no mode of ours is as fast and as accurate."""
    ours = [r for r in rows if not is_peer(r.method) and r.method.startswith("ours") and not r.failed]
    return [
        r
        for r in rows
        if is_peer(r.method)
        and not r.failed
        and not any(
            mine.link == r.link
            and mine.control_points <= r.control_points
            and mine.milliseconds <= r.milliseconds
            and mine.mean <= r.mean
            for mine in ours
        )
    ]


def verdict(rows: list[Row]) -> str:
    """Return both lists as Markdown, and how often a peer is ahead."""
    pairs = ahead(rows)
    text = [
        "| link | n x m | mode of ours: mean [mm], time [ms] | peers ahead of it: mean [mm], time [ms], nearer to |"
    ]
    text.append("|---|---|---|---|")
    for mine in (r for mode in MODES for r in rows if r.method == mode and has_peers(r, rows)):
        best: dict[str, tuple[Row, str]] = {}
        for r, other, nearer in pairs:
            if other is mine and (r.method not in best or cost(r) < cost(best[r.method][0])):
                best[r.method] = r, nearer
        if best:
            names = "; ".join(f"{named(r)} {result(r)}, {nearer}" for r, nearer in best.values())
            text.append(f"| {mine.link} | {mine.n} x {mine.m:g} | {mine.method}: {result(mine)} | {names} |")
    text.append("")
    for mode in MODES:
        places = {(r.link, r.n, r.m) for r in rows if r.method == mode and has_peers(r, rows)}
        on_mesh = [(r, mine) for r, mine, nearer in pairs if mine.method == mode and "mesh" in nearer]
        clear = [(r, mine) for r, mine in on_mesh if mine.failed or r.mean < (1 - LEVEL) * mine.mean]
        counts = [len({(r.link, r.n, r.m) for r, _ in chosen}) for chosen in (on_mesh, clear)]
        text.append(
            f"- A peer is ahead of **{mode}** at {counts[0]} of {len(places)} links and sizes, measured to the mesh; "
            f"at {counts[1]} by more than the {LEVEL:.0%} up to which means are level."
        )
    text += ["", "| link | n x m | peers that no mode of ours dominates: mean [mm], time [ms], control points |"]
    text.append("|---|---|---|")
    front: dict[tuple, dict[str, Row]] = {}
    for r in not_dominated(rows):
        best_of = front.setdefault((r.link, r.n, r.m), {})
        if r.method not in best_of or cost(r) < cost(best_of[r.method]):
            best_of[r.method] = r
    for (link, n, m), best_of in front.items():
        names = "; ".join(f"{named(r)} {result(r)}, {r.control_points}" for r in best_of.values())
        text.append(f"| {link} | {n} x {m:g} | {names} |")
    if not front:
        text.append("| all | all | none |")
    return "\n".join(text)


def has_peers(mine: Row, rows: list[Row]) -> bool:
    """Return whether peers ran on this link at this size."""
    return any(is_peer(r.method) and (r.link, r.n, r.m) == (mine.link, mine.n, mine.m) for r in rows)


def cost(row: Row) -> float:
    """Return what orders variants of a peer: the product of error and time."""
    return row.mean * row.milliseconds


def named(row: Row) -> str:
    """Return a peer with its variant."""
    return f"{row.method} ({row.variant})"


def result(row: Row) -> str:
    """Return mean and time, or why there is none."""
    return row.note if row.failed else f"{row.mean:.4f}, {row.milliseconds:.1f}"
