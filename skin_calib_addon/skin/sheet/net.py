"""Nets: the nodes of a flat sheet, and the pairs of nodes that keep their distance on a surface."""

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from scipy.sparse import csr_array

from ...common.arrays import Array, IntArray

Lines = tuple[int, ...]  # positions of the rows or columns of nodes, in steps, in increasing order


@dataclass(frozen=True, eq=False)
class Net:
    """Flat nodes and the pairs of them that keep their distance."""

    flat: Array  # (n, 2) positions relative to the pinned node [m]
    pairs: IntArray  # (e, 2)
    load_fractions: Array  # (n,) fraction of the constraint forces on each node; the sum is one

    @cached_property
    def pair_vectors(self) -> Array:
        """Flat vectors from the first node of each pair to the second, shape (e, 2) [m]."""
        return self.flat[self.pairs[:, 1]] - self.flat[self.pairs[:, 0]]

    @cached_property
    def lengths(self) -> Array:
        """Flat distances of the pairs, shape (e,) [m]."""
        return np.linalg.norm(self.pair_vectors, axis=1)

    @cached_property
    def incident_vectors(self) -> tuple[csr_array, csr_array]:
        """Sparse matrices (n, e) of the x and the y of the pair vectors at both of their nodes [m]."""
        order = self.pairs.ravel(), np.repeat(np.arange(len(self.pairs)), 2)
        size = len(self.flat), len(self.pairs)
        x, y = (csr_array((np.repeat(part, 2), order), size) for part in self.pair_vectors.T)
        return x, y

    @property
    def pitch(self) -> float:
        """Smallest distance of a pair [m]."""
        return float(self.lengths.min())

    @cached_property
    def pin(self) -> int:
        """Number of the node at the origin."""
        return int(np.argmin((self.flat**2).sum(axis=1)))

    @cached_property
    def adjacent_to_pin(self) -> IntArray:
        """Nodes that are paired with the pinned one."""
        there = self.pairs[(self.pairs == self.pin).any(axis=1)]
        return there[there != self.pin]

    @cached_property
    def order(self) -> IntArray:
        """Order of the nodes that gives a small bandwidth: along the shorter side first, shape (n,)."""
        orders = [np.lexsort(keys) for keys in (self.flat.T, self.flat.T[::-1])]
        positions = [np.argsort(order) for order in orders]
        return min(positions, key=lambda order: np.abs(np.diff(order[self.pairs], axis=1)).max())


@lru_cache(maxsize=32)
def grid_net(lines: tuple[Lines, Lines], step: tuple[float, float], pinned: tuple[int, int]) -> Net:
    """Return a rectangular grid; nodes keep their distances along rows, across rows and along both diagonals."""
    rows, columns = (np.array(positions) for positions in lines)
    shape = len(rows), len(columns)
    i, j = (k.ravel() for k in np.meshgrid(rows, columns, indexing="ij"))
    node = np.arange(len(i)).reshape(shape)
    families = (
        (node[:, :-1], node[:, 1:]),
        (node[:-1], node[1:]),
        (node[:-1, :-1], node[1:, 1:]),
        (node[:-1, 1:], node[1:, :-1]),
    )
    pairs = np.concatenate([np.column_stack((start.ravel(), stop.ravel())) for start, stop in families])
    load_fractions = np.outer(_widths(rows), _widths(columns)).ravel()
    return Net(
        np.column_stack(((j - pinned[1]) * step[1], (i - pinned[0]) * step[0])),
        pairs,
        load_fractions / load_fractions.sum(),
    )


def _widths(positions: IntArray) -> Array:
    """Return half of the distance from the position before to the one after each; an end has one neighbour."""
    halves: Array = np.diff(positions) / 2
    return np.append(halves, 0.0) + np.append(0.0, halves)
