"""Decide which taxels are touched: surely, possibly, and in the estimate between; by the noise, or by thresholds."""

from dataclasses import dataclass

import numpy as np

from ..common.arrays import Array, BoolArray, IntArray, lock
from .noise import Noise


@dataclass(frozen=True, eq=False)
class Touched:
    """What is touched in one frame. ``stands`` is None if sums of the noise are not known: then a load decides."""

    active: BoolArray  # (n,) whether a taxel is in a contact
    sure: BoolArray | None  # (n,) whether it is surely touched; None: nothing is sure
    possible: BoolArray  # (n,) whether it is possibly touched
    weights: Array  # (n,) of its force in the sums
    pushes: Array  # (n,) its part of the sums [N]; of free taxels zero on average
    stands: bool | None

    def __post_init__(self) -> None:
        lock(self.active, self.sure, self.possible, self.weights, self.pushes)


class Streak:
    """Remember which taxels exceeded a level in the last three new frames."""

    def __init__(self, n: int):
        self._above = [np.zeros(n, bool)] * 3

    def add(self, above: BoolArray, is_new: bool) -> BoolArray:
        """Return which taxels (n,) exceed the level in three new frames in a row, with this one."""
        if is_new:
            self._above = [above, *self._above[:2]]
        first, second, third = self._above
        return first & second & third


def by_thresholds(
    forces: Array, known: BoolArray, is_complete: bool, before: BoolArray, on: float, off: float, is_sure: bool
) -> tuple[Touched, BoolArray]:
    """Return what is touched by two thresholds, and the state of the next frame."""
    state = (forces >= on) | (before & (forces >= off))
    if is_complete:
        active = possible = state
    else:
        active = state & known
        state = np.where(known, active, before)
        possible = active | ~known if np.count_nonzero(active) else active
    weights = active.astype(float)
    return Touched(active, active if is_sure else None, possible, weights, weights * forces, None), state


def by_noise(
    noise: Noise,
    signed: Array,
    forces: Array,
    known: BoolArray,
    is_complete: bool,
    before: BoolArray,
    neighbours: IntArray,
    streak: Streak,
    is_new: bool,
) -> tuple[Touched, BoolArray]:
    """Return what is touched according to the noise at rest, and the state of the next frame."""
    if not is_complete:
        signed = np.where(known, signed, noise.free)  # as without contact, for the sums
    above = signed > noise.levels
    above[:4] &= forces > 0
    if not is_complete:
        above[4] |= ~known
    sure, pair, release, lasting, possible = above
    lasts = streak.add(lasting, is_new)
    rows = (pair > sure).nonzero()[0]
    if len(rows):
        padded = np.zeros(len(pair) + 1, bool)
        padded[:-1] = pair
        rows = rows[np.logical_or.reduce(padded[neighbours.take(rows, axis=1)], axis=0)]
    excess = noise.excess(signed)
    if excess <= noise.load_level and not len(rows) and not np.count_nonzero(sure):
        nothing = np.zeros(len(known), bool)
        state = nothing if is_complete else before & ~known
        zeros = nothing.astype(float)
        return Touched(nothing, nothing, nothing, zeros, zeros, False), state
    state = active = sure | (before & release)
    active[rows] = True
    if not is_complete:
        active = active & known
        state = np.where(known, active, before)
    weights, pushes = noise.pushes(signed, forces, excess)
    if not is_complete:
        pushes[~known] = 0.0
    return Touched(active, sure | lasts, possible | lasts | active, weights, pushes, True), state


def has_neighbour(which: BoolArray, neighbours: IntArray) -> BoolArray:
    """Return whether a neighbour of each taxel is one of some, in many frames, (T, n)."""
    columns = np.zeros((which.shape[1] + 1, len(which)), bool)  # whole rows of memory for each taxel
    columns[:-1] = which.T
    found = np.zeros((which.shape[1], len(which)), bool)
    for row in neighbours:
        found |= columns[row]
    return found.T
