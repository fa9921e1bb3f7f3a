"""In which order the channels of a skin are wired, judged by its touches.

Electronics count in another order than the plan, or wires are exchanged. Each order is a hypothesis with its own
registration: the probability of all touches, integrated over the motions of the skin. Orders that agree on all touched
taxels are one.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations, product

import numpy as np

from ..calibration.model import Patch
from ..common.arrays import Array, BoolArray, IntArray
from .flat import flat_places, seen_from
from .registration import CHANCES, MAX_SHIFT, USUAL_SHIFT, Evidence, log_mean, posterior

# [1] Logarithm of the odds from which on an order is certain. Larger: more orders are called ambiguous.
MIN_ODDS = 3.0
# [1] Logarithm of the odds of the planned order and any other before any touch, and of those of any exchange of two
# rows, columns or boards. Larger: more touches for another order.
PLANNED_ODDS, EXCHANGED_ODDS = 4.0, 7.0
# [1] Logarithm of the largest odds of two orders that differ in one touch: it can be one that was recorded elsewhere.
# Larger: odds of orders with few touches are too large.
ODDS_OF_ONE = 5.0
# [1] Touches that judge an order. Larger: more time.
MAX_JUDGED = 200
# [1] Orders that are registered exactly, after a coarse comparison of all. Larger: more time, safer.
FINALISTS = 8
# [m, rad] Steps of the shift and the rotation in the coarse comparison. Larger: less time, may miss the best order.
COARSE_SHIFT, COARSE_TURN = 5e-3, np.deg2rad(4.0)
# [1] Boards of a skin up to which every exchange of two is an order. Larger: more time.
MAX_EXCHANGED = 24
FAR = 1.0  # [m] offset of a touch that cannot be of a taxel. Larger: no effect.


@dataclass(frozen=True, eq=False)
class Order:
    """One order of the channels: the taxels (m,) that felt the touches instead of the planned ones, -1 for none."""

    words: str  # empty as planned
    rows: IntArray
    prior_odds: float = PLANNED_ODDS  # logarithm of the odds of the planned order before any touch
    motion: str = ""  # of a skin with the planned order that touches cannot distinguish from it


@dataclass(frozen=True, eq=False)
class Wiring:
    """The most probable order of the channels."""

    order: Order
    odds: float  # logarithm of the odds of this order and the next one
    rivals: tuple[Order, ...]  # with odds below `MIN_ODDS`, the most probable one first
    explained: float  # fraction of the touches that the order explains

    @property
    def candidates(self) -> list[str]:
        """Orders that fit, the most probable one first, and a motion of the skin that touches cannot distinguish."""
        words = [order.words or "the planned order" for order in (self.order, *self.rivals)]
        return words + ([self.order.motion] if self.order.motion else [])

    @property
    def is_certain(self) -> bool:
        """Whether no other order, and no motion of a skin with the planned order, explains the touches as well."""
        return not self.rivals and not self.order.motion


def judge(patch: Patch, rows: IntArray, points: Array, directions: Array, planned: Array, noise: Array) -> Wiring:
    """Compare all orders of the channels of a patch by touches (m, 3) that the taxels ``rows`` (m,) felt.

    ``noise`` (m,) is the known error of the points, per axis [m].
    """
    some = np.unique(np.linspace(0, len(rows) - 1, min(len(rows), MAX_JUDGED)).astype(int))
    rows, points, directions, noise = rows[some], points[some], directions[some], noise[some]
    found = _distinct(patch, rows)
    if not len(rows):  # all lines of action are along the skin
        return Wiring(found[0], np.inf, (), 0.0)
    prior = np.array([-order.prior_odds for order in found])
    seen = _Seen.of(patch, points, directions, noise)
    scores = prior + seen.coarse(np.array([order.rows for order in found]), planned)
    finalists = {0, *np.argsort(-scores)[:FINALISTS].tolist()}
    exact = {k: seen.judged(found[k].rows, planned) for k in finalists}
    first, *others = sorted(exact, key=lambda k: prior[k] + exact[k][0], reverse=True)
    order, (evidence, explained) = found[first], exact[first]
    least, rivals = np.inf, []
    for k in others:
        other, (its_evidence, its_explained) = found[k], exact[k]
        odds = float(prior[first] + evidence - prior[k] - its_evidence)
        # touches at the border of two columns fit both orders of these; an exchange has to explain what is unexplained
        if odds < MIN_ODDS and (other.prior_odds != EXCHANGED_ODDS or (its_explained & ~explained).any()):
            rivals.append(other)
        deciding = (order.rows != other.rows) & (explained | its_explained)
        least = min(least, odds, ODDS_OF_ONE if deciding.sum() < 2 else np.inf)
    return Wiring(order, least, tuple(rivals), float(explained.mean()))


@dataclass(frozen=True, eq=False)
class _Seen:
    """All touches as seen from all taxels of a patch."""

    patch: Patch
    offsets: Array  # (m, n, 2) [m]
    is_near: BoolArray  # (m, n) whether height and incidence are plausible
    sides: Array  # (m, n) 1 for a line from inside to outside, -1, 0 for a point
    noise: Array  # (m,) known error of the points [m]

    @classmethod
    def of(cls, patch: Patch, points: Array, directions: Array, noise: Array) -> "_Seen":
        taxels = patch.taxels
        everywhere = np.broadcast_to(np.arange(len(taxels.ids)), (len(points), len(taxels.ids)))
        offsets, known = seen_from(patch, everywhere, points[:, None], directions[:, None])
        heights = offsets[..., 2]
        with_height = ~np.isnan(heights[:, 0])
        usual = 0.0
        if with_height.any():
            nearest = (np.linalg.norm(offsets[with_height], axis=2)).argmin(axis=1)
            usual = float(np.median(heights[with_height, nearest]))
        is_near = known & ~(np.abs(heights - usual) > max(patch.pitch))
        sides = np.sign(directions @ taxels.normals_link.T)
        return cls(patch, offsets[..., :2], is_near, sides, noise)

    def chosen(self, rows: IntArray) -> tuple[Array, BoolArray]:
        """Return the offsets (..., m, 2) from some taxels (..., m), and which touches can be of them."""
        touch = np.arange(rows.shape[-1])
        side = self.sides[touch, rows]
        same = side * np.sign(side.sum(axis=-1, keepdims=True)) >= 0
        return self.offsets[touch, rows], self.is_near[touch, rows] & same & (rows >= 0)

    def coarse(self, orders: IntArray, planned: Array) -> Array:
        """Return an estimate of the logarithm of the evidence of orders (h, m), with discs instead of cells."""
        patch, size = self.patch, float(np.sqrt(self.patch.taxels.areas.mean() / np.pi))
        shifts, turns = np.arange(-MAX_SHIFT, MAX_SHIFT * 1.01, COARSE_SHIFT), COARSE_TURN * np.arange(-2, 3)
        flat = flat_places(patch, patch.taxels.index)
        offsets, fits = self.chosen(orders)
        arms = flat[orders] - flat[orders[0]].mean(axis=0)
        motions = np.array(list(product(shifts, shifts, turns)))
        if patch.kind == "imported":
            motions, arms = np.zeros((1, 3)), np.zeros_like(arms)
        out = np.zeros((len(motions), len(orders)))
        count = len(patch.taxels.ids)
        for k, (x, y, turn) in enumerate(motions):
            away = np.hypot(offsets[..., 0] - x + turn * arms[..., 1], offsets[..., 1] - y - turn * arms[..., 0])
            ratio = count / (1 + np.exp(np.minimum(1.7 * (away - size) / (COARSE_SHIFT / 2), 50.0)))
            out[k] = np.log(CHANCES[1] + (1 - CHANCES[1]) * np.where(fits, ratio, 0.0)).sum(axis=1)
        out -= 1.5 * np.log1p(((motions[:, :2] - planned[:2]) ** 2).sum(axis=1) / USUAL_SHIFT**2)[:, None]
        return log_mean(out)

    def judged(self, rows: IntArray, planned: Array) -> tuple[float, BoolArray]:
        """Return the logarithm of the evidence of an order, and which touches (m,) it explains."""
        offsets, fits = self.chosen(rows)
        offsets = np.where(fits[:, None], offsets, FAR)
        evidence = Evidence.of_cells(self.patch, rows, offsets, planned, np.ones(len(rows)), self.noise)
        if self.patch.kind == "imported":
            still = np.zeros((1, 3))
            likelihood = evidence.log_likelihood(still, evidence.probable(still[0], 0.0), 0.0)
            return float(likelihood[0]), evidence.explained(None) > 0.5
        found = posterior(evidence)
        return found.log_evidence, evidence.explained(found) > 0.5


def _distinct(patch: Patch, rows: IntArray) -> list[Order]:
    """Return the orders that differ on the touched taxels, the planned one first."""
    found: dict[bytes, Order] = {}
    for order in orders(patch, rows):
        found.setdefault(order.rows.tobytes(), order)
    return list(found.values())


def orders(patch: Patch, rows: IntArray) -> Iterator[Order]:
    """Yield the planned order, then others for touches that the taxels ``rows`` (m,) felt, the most common first."""
    yield Order("", rows.astype(np.int64), 0.0)
    yield from _shifted(patch, rows)
    height, width = patch.shape
    if patch.kind == "sheet" and len(patch.taxels.ids) == height * width:
        yield from _of_sheet(patch, rows)
    elif patch.kind == "hexagons":
        yield from _of_boards(patch, rows)


def _shifted(patch: Patch, rows: IntArray) -> Iterator[Order]:
    """Yield orders whose channels are off by a number."""
    taxels = patch.taxels
    row_of = {channel: row for row, channel in enumerate(taxels.channels.tolist())}
    first, last = int(taxels.channels.min()), int(taxels.channels.max())
    channels = (taxels.channels[rows] - first).tolist()
    width = patch.shape[1]
    steps = [(-1, "off by one, as if counted from 1"), (1, "off by one, each too low")]
    if patch.kind == "sheet":
        steps += [(-width, "off by one row, each too high"), (width, "off by one row, each too low")]
    for by, words in steps:
        others = [first + (channel + by) % (last - first + 1) for channel in channels]  # the last one follows the first
        yield Order(words, np.array([row_of.get(other, -1) for other in others], np.int64))


def _of_sheet(patch: Patch, rows: IntArray) -> Iterator[Order]:
    """Yield orders of the rows and columns of a sheet."""
    (height, width), taxels = patch.shape, patch.taxels
    row_at = np.empty((height, width), np.int64)
    row_at[tuple(taxels.index.T)] = np.arange(len(taxels.ids))
    i, j = taxels.index[rows].T
    number = i * width + j
    for by_columns, turns, flip_rows, flip_columns in product((False, True), repeat=4):
        a, b = (number % height, number // height) if by_columns else (i, j)
        if turns:
            a, b = (np.where(b % 2, height - 1 - a, a), b) if by_columns else (a, np.where(a % 2, width - 1 - b, b))
        other = row_at[height - 1 - a if flip_rows else a, width - 1 - b if flip_columns else b]
        flips = [name for name, is_so in (("rows", flip_rows), ("columns", flip_columns)) if is_so]
        parts = ["column by column"] * by_columns
        parts += [f"every second {'column' if by_columns else 'row'} backwards"] * turns
        parts += [f"{' and '.join(flips)} counted from the other end"] if flips else []
        if parts:
            yield Order(", ".join(parts), other)
    closes = _closes(patch, row_at)
    for by in sorted(range(1 - width, width), key=abs):
        if by and 2 * abs(by) <= width:
            side = "low" if by > 0 else "high"
            words = f"columns off by {'one' if abs(by) == 1 else abs(by)}, each too {side}"
            words = "halves of the rows swapped" if 2 * abs(by) == width else words
            distance = f"a skin that is {abs(by) * patch.pitch[1] * 1e3:.0f} mm further round the limb" * closes
            yield Order(words, row_at[i, (j + by) % width], motion=distance)
    if height % 2 == 0:
        yield Order("halves of the columns swapped", row_at[(i + height // 2) % height, j])
    for k, size, name in ((0, height, "rows"), (1, width, "columns")):
        for one, other in combinations(range(size), 2):
            at = [i, j]
            at[k] = np.where(at[k] == one, other, np.where(at[k] == other, one, at[k]))
            yield Order(f"{name} {one} and {other} exchanged", row_at[at[0], at[1]], EXCHANGED_ODDS)


def _closes(patch: Patch, row_at: IntArray) -> bool:
    """Return whether the first and the last column of a sheet are next to each other."""
    positions = patch.taxels.positions_link
    gaps = np.linalg.norm(positions[row_at[:, 0]] - positions[row_at[:, -1]], axis=1)
    return bool(np.median(gaps) < 2 * patch.pitch[1])


def _of_boards(patch: Patch, rows: IntArray) -> Iterator[Order]:
    """Yield orders of boards: the chain from its other end, turned about a board, and two boards exchanged."""
    taxels = patch.taxels
    count = len(taxels.ids)
    by_channel = np.argsort(taxels.channels)
    place = np.empty(count, np.int64)
    place[by_channel] = np.arange(count)
    yield Order("boards counted from the other end", by_channel[count - 1 - place[rows]])
    row_of = {cell: row for row, cell in enumerate(map(tuple, taxels.index.tolist()))}
    for pivot in dict.fromkeys([(0, 0), tuple(np.rint(taxels.index.mean(axis=0)).astype(int).tolist())]):
        cells = taxels.index[rows] - pivot
        for turn in range(1, 6):
            cells = np.column_stack((-cells[:, 1], cells.sum(axis=1)))
            other = [row_of.get(cell, -1) for cell in map(tuple, (cells + pivot).tolist())]
            yield Order(f"boards turned by {60 * turn} degrees about board {pivot}", np.array(other, np.int64))
    if count <= MAX_EXCHANGED:
        for a, b in combinations(range(count), 2):
            swapped = np.where(rows == a, b, np.where(rows == b, a, rows))
            yield Order(f"{taxels.ids[a]} and {taxels.ids[b]} exchanged", swapped, EXCHANGED_ODDS)
