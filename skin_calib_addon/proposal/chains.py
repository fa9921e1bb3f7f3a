"""Boards that are connected by their ports: a chain has one cable to the robot."""

from collections.abc import Sequence

import numpy as np
from scipy.sparse.csgraph import minimum_spanning_tree
from scipy.spatial.distance import cdist

from ..calibration.model import TaxelArray
from ..common.arrays import Array, BoolArray, IntArray
from ..geometry.components import components

MIN_CHAIN = 3  # boards of a chain, unless the author states another number. Larger: fewer cables, less skin


def chains_of(taxels: TaxelArray, kept: BoolArray) -> IntArray:
    """Return the number of the chain of each kept board, shape (kept,); the largest is 0."""
    rows = np.flatnonzero(kept).tolist()
    place = {taxels.ids[row]: k for k, row in enumerate(rows)}
    ends = [
        (place[taxels.ids[row]], place[b]) for row in rows for b in taxels.ports[row] if b is not None and b in place
    ]
    pairs = np.array(ends, np.int64).reshape(-1, 2)
    chain = components(len(rows), pairs[:, 0], pairs[:, 1])
    sizes = np.bincount(chain, minlength=1)
    return np.argsort(np.argsort(-sizes, kind="stable"), kind="stable")[chain]


def without_short_chains(taxels: Sequence[TaxelArray], kept: Sequence[BoolArray], least: int) -> list[BoolArray]:
    """Return which boards of a link remain, for each skin: those of long chains, or all if no chain is long."""
    long = []
    for own, some in zip(taxels, kept):
        chain = chains_of(own, some)
        mask = some.copy()
        mask[some] = np.bincount(chain, minlength=1)[chain] >= least
        long.append(mask)
    return long if any(mask.any() for mask in long) else list(kept)


def cable_length(chains: Sequence[Array]) -> float:
    """Return the length of straight cables that connect chains of boards at positions (k, 3) [m]: the shortest tree."""
    if len(chains) < 2:
        return 0.0
    gaps = np.array([[cdist(a, b).min() if i < j else 0.0 for j, b in enumerate(chains)] for i, a in enumerate(chains)])
    return float(minimum_spanning_tree(gaps).sum())
