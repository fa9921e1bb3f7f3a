"""Decide which taxels are touched: surely, possibly, and in the estimate between; by the noise, or by thresholds.

:meth:`.Skin.update` has one reading (n,), :meth:`.Skin.batch` many (T, n). Both call the same functions, which take
arrays (..., n). First comes the evidence of a reading alone, then the state of the taxels before it.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ..common.arrays import Array, BoolArray, IntArray, lock, some
from .noise import Noise


class Evidence(NamedTuple):
    """What readings show by themselves. Thresholds give the first two only: then the active taxels are in the sums."""

    on: BoolArray  # (..., n) whether a taxel becomes active
    stays: BoolArray  # (..., n) whether an active taxel stays active; a taxel without a force keeps its state
    sure: BoolArray | None = None  # (..., n) whether it is surely touched
    lasting: BoolArray | None = None  # (..., n) whether it is surely touched if so in three new frames
    possible: BoolArray | None = None  # (..., n) whether it is possibly touched; every taxel without a force is
    weights: Array | None = None  # (..., n) of its force in the sums
    pushes: Array | None = None  # (..., n) its part of the sums [N]; of free taxels zero on average
    has_load: BoolArray | None = None  # (...) whether something is touched, or the sum of all taxels is a load
    excess: Array | None = None  # (...) sum of all taxels above that at rest [N]


@dataclass(frozen=True, eq=False)
class Touched:
    """What is touched in one frame. ``stands`` is None if sums of the noise are not known: then a load decides."""

    active: BoolArray  # (n,) whether a taxel is in a contact
    sure: BoolArray | None  # (n,) whether it is surely touched; None: nothing is sure
    possible: BoolArray  # (n,) whether it is possibly touched
    weights: Array  # (n,) of its force in the sums
    pushes: Array  # (n,) its part of the sums [N]; of free taxels zero on average
    stands: bool | None
    common: float = 0.0  # deviation of all taxels that may be a drift [standard deviations]
    excess: float = 0.0  # sum of all taxels above that at rest [N]

    def __post_init__(self) -> None:
        lock(self.active, self.sure, self.possible, self.weights, self.pushes)

    def without(self, stuck: BoolArray) -> "Touched":
        """Return the sets if the readings of some taxels (n,) prove nothing: with a load, they are possibly touched."""
        if self.stands is False or self.sure is None:
            return self
        return replace(self, sure=self.sure & ~stuck, possible=self.possible | stuck)


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


def by_thresholds(forces: Array, known: BoolArray, switch_on: float, switch_off: float) -> Evidence:
    """Return the evidence of forces (..., n) [N], 0 where they are not known: a load decides."""
    on, stays = forces >= switch_on, forces >= switch_off
    if np.count_nonzero(known) < known.size:
        stays |= ~known
    return Evidence(on, stays)


def by_noise(noise: Noise, neighbours: IntArray, signed: Array, forces: Array, known: BoolArray) -> Evidence:
    """Return the evidence of signed readings (..., n), with their forces [N], against the noise at rest."""
    is_complete = np.count_nonzero(known) == known.size
    if not is_complete:
        signed = np.where(known, signed, noise.free)  # as without contact, for the sums
    above = signed > (noise.levels if signed.ndim == 1 else noise.levels[:, None])
    above[:4] &= forces > 0
    sure, pair, release, lasting, possible = above
    on = _with_pairs(sure, pair, neighbours)
    excess = noise.excess(signed)
    has_load = on.any(axis=-1) | (excess > noise.load_level)
    if not some(has_load):
        nothing, zeros = np.zeros(signed.shape, bool), np.zeros(signed.shape)
        return Evidence(
            nothing, nothing if is_complete else ~known, nothing, lasting, nothing, zeros, zeros, has_load, excess
        )
    weights, pushes = noise.pushes(signed, forces, excess)
    is_free = ~has_load
    if some(is_free):
        for values in (sure, release, possible, weights, pushes):
            values[is_free] = 0
    if not is_complete:
        release |= ~known
        possible |= ~known
        pushes[~known] = 0.0
    return Evidence(on, release, sure, lasting, possible, weights, pushes, has_load, excess)


def over_drift(evidence: Evidence, noise: Noise, signed: Array, common: float) -> tuple[BoolArray, BoolArray]:
    """Return ``sure`` and ``lasting`` (n,) of signed readings (n,), less a ``common`` deviation of all taxels."""
    sure, lasting = evidence.sure, evidence.lasting
    assert sure is not None and lasting is not None
    if common == 0:
        return sure, lasting
    lower = signed - common * noise.sigma
    return sure & (lower > noise.sure), lasting & (lower > noise.lasting)


def _with_pairs(sure: BoolArray, pair: BoolArray, neighbours: IntArray) -> BoolArray:
    """Return the taxels (..., n) that are sure, and those above the level of pairs that have a neighbour above it."""
    unsure = (pair > sure).nonzero()
    *frames, taxels = unsure
    if not len(taxels):
        return sure
    padded = np.zeros((*pair.shape[:-1], pair.shape[-1] + 1), bool)  # the last one stands for no neighbour
    padded[..., :-1] = pair
    on = sure.copy()
    on[unsure] = np.logical_or.reduce(padded[(*frames, neighbours.take(taxels, axis=1))], axis=0)
    return on


def switched(on: BoolArray, stays: BoolArray, before: BoolArray) -> BoolArray:
    """Return which taxels (..., n) are active after a frame."""
    return on | (before & stays)


def states(on: BoolArray, stays: BoolArray, before: BoolArray) -> BoolArray:
    """Return which taxels (T, n) are active after each of many frames in a row.

    Two frames switch as one does that has ``switched(on, stays, on of the first)`` and ``stays & stays of the first``.
    Each round joins twice as many.
    """
    on, stays = on.copy(), stays.copy()
    on[0] = switched(on[0], stays[0], before)
    step = 1
    while step < len(on):
        on[step:] = switched(on[step:], stays[step:], on[:-step])
        stays[step:] &= stays[:-step]
        step *= 2
    return on


def touched_by_load(active: BoolArray, forces: Array, known: BoolArray | None, is_sure: bool) -> Touched:
    """Return what is touched in one frame with forces (n,) [N], by thresholds.

    ``known`` is None if all forces are known; ``is_sure`` is whether a force above the threshold is surely a contact.
    """
    possible = active if known is None or not np.count_nonzero(active) else active | ~known
    weights = active.astype(float)
    return Touched(active, active if is_sure else None, possible, weights, weights * forces, None)


def touched_by_noise(
    evidence: Evidence, active: BoolArray, sure: BoolArray, lasts: BoolArray, common: float
) -> Touched:
    """Return what is touched in one frame; ``lasts`` (n,) has the taxels above ``lasting`` in three frames."""
    _, _, _, _, possible, weights, pushes, has_load, excess = evidence
    assert possible is not None and weights is not None and pushes is not None and excess is not None
    if not has_load:
        return Touched(active, active, active, weights, pushes, False, excess=float(excess))  # no taxel is active
    return Touched(active, sure, possible | lasts | active, weights, pushes, True, common)
