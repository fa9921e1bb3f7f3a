"""Compute the results of many readings at once: of a log, or of the environments of a simulator."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from ..common.arrays import Array, BoolArray, IntArray
from .clock import JUMP_TIME, Clock
from .components import component_counts
from .frame import cop_of, is_standing, zmp_of
from .geometry import SkinGeometry
from .lost import lost_forces
from .modalities import ModalityValues
from .touched import Evidence, states

if TYPE_CHECKING:
    from .readings import Readings

# Numbers of the readings that are processed together: 128 kilobytes. Larger: more memory, and more cache misses;
# smaller: more calls of NumPy for each row.
BLOCK_NUMBERS = 2**14


@dataclass(frozen=True, eq=False)
class Batch:
    """Results of many readings; row t of every array is reading t.

    They are those of :class:`.Frame`. A row is unknown if no taxel of it has a valid force. Its wrench is unknown, too,
    if those without one may carry much of it, see :attr:`.Frame.problem`.
    """

    forces: Array  # (T, n) on each taxel [N]; 0 if it is unknown
    known: BoolArray  # (T, n) whether the taxel has a valid force
    active: BoolArray  # (T, n) whether the taxel is part of a contact
    contact_counts: IntArray  # (T,) number of contacts; -1 if the row is unknown
    wrench: Array  # (T, 6) of all contacts about the origin of the link [N, N m]; NaN if it is unknown
    load: Array  # (T,) vertical force of the ground [N], 0 without a ground; NaN if the wrench is unknown
    stands: BoolArray  # (T,) whether the link stands on its ground
    cop: Array  # (T, 2) in the coordinates of the ground [m]; NaN if the link does not stand
    zmp: Array  # (T, 2) in the coordinates of the ground [m]; NaN if the link does not stand
    modalities: Mapping[str, ModalityValues] = field(default_factory=dict)  # those that were passed, with arrays (T, n)


def batch_of(
    rows: Array,
    times: Array | None,
    readings: "Readings",
    skin: SkinGeometry,
    evidence_of: Callable[[Array | None, Array, BoolArray], Evidence],
    sums_of: Callable[[Array, BoolArray], Array],
) -> Batch:
    """Return the results of readings (T, n) of the taxels.

    ``evidence_of`` is called with signed readings, forces [N] and which of them are known, ``sums_of`` with the parts
    of the sums [N] and the active taxels, all (T, n).
    """
    count, n = rows.shape
    is_log = times is not None and readings.noise is not None
    if times is not None and is_log:
        valid = np.isfinite(readings.valid(rows))
        rows = readings.followed(rows, times, valid, _fresh(times, valid.any(axis=1)))

    def corrected(block: slice) -> Array:
        found = rows[block].astype(float)
        return found if is_log else readings.corrected(found)

    forces, known, active = np.zeros((count, n)), np.zeros((count, n), bool), np.zeros((count, n), bool)
    for block in _blocks(count, n):
        forces[block], known[block] = readings.forces(corrected(block))
    valid = known.any(axis=1) | (n == 0)
    fresh = None if times is None else _fresh(times, valid)
    before, sums, stands = np.zeros(n, bool), np.empty((count, 12)), np.zeros(count, bool)
    parts = None if known.all() else np.empty((count, n))  # of the sums
    for block in _blocks(count, n):
        evidence = evidence_of(readings.signed(corrected(block)), forces[block], known[block])
        state = evidence.on
        if fresh is not None:
            evidence.stays[fresh[block]] = False
            state = states(state, evidence.stays, before)
            before = state[-1]
        active[block] = state & known[block]
        pushes = active[block] * forces[block] if evidence.pushes is None else evidence.pushes
        if parts is not None:
            parts[block] = pushes
        sums[block] = sums_of(pushes, active[block])
        stands[block] = valid[block] & is_standing(sums[block, 6], evidence.has_load)
    if parts is not None:
        is_lost = _are_lost(parts, known, valid, fresh, skin, readings.live)
        sums[is_lost], stands[is_lost] = np.nan, False
    counts = np.where(valid, component_counts(active, skin.neighbours), -1)
    wrench, load = (np.where(valid[:, None], sums, np.nan)[:, columns] for columns in (slice(6), 6))
    cop = cop_of(np.where(stands[:, None], sums, np.nan))
    zmp = zmp_of(np.where(stands[:, None] & (sums[:, 9:10] > 0), sums, np.nan))
    return Batch(forces, known, active, counts, wrench, load, stands, cop, zmp)


def _are_lost(
    pushes: Array, known: BoolArray, valid: BoolArray, fresh: BoolArray | None, skin: SkinGeometry, live: BoolArray
) -> BoolArray:
    """Return in which rows (T,) the taxels without a valid force may carry too much, see :mod:`.lost`."""
    row = np.arange(len(pushes))
    start = row if fresh is None else np.maximum.accumulate(np.where(fresh, row, 0))  # no row before it counts
    latest = np.maximum.accumulate(np.where(known, row[:, None], -1), axis=0)  # in which each taxel was known
    is_lost = np.zeros(len(pushes), bool)
    for k in (valid & ~known.all(axis=1)).nonzero()[0]:
        last = np.where(latest[k] >= start[k], np.take_along_axis(pushes, latest[k][None], axis=0)[0], np.nan)
        is_lost[k] = lost_forces(skin, pushes[k], known[k], live, last)[1] is not None
    return is_lost


def _blocks(count: int, n: int) -> Iterator[slice]:
    """Return slices that divide the rows into blocks."""
    step = max(BLOCK_NUMBERS // max(n, 1), 1)
    return (slice(start, start + step) for start in range(0, count, step))


def _fresh(times: Array, valid: BoolArray) -> BoolArray:
    """Return for which valid rows (T,) the valid one before says nothing, because time went back or jumped."""
    fresh = np.zeros(len(times), bool)
    gaps = np.concatenate((np.diff(times), np.diff(times[valid])))
    if ((gaps >= 0) & (gaps <= JUMP_TIME)).all():
        return fresh
    clock = Clock()
    for k, time in enumerate(times.tolist()):
        fresh[k] = valid[k] and not clock.has_past(time)
        clock.accept(time, bool(valid[k]))
    return fresh
