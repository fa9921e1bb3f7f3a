"""Nets: the nodes of a flat lattice, and which of them hold their distance when it is laid on a surface."""

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from scipy.sparse import csr_array

from ...common.arrays import Array, IntArray
from ..lattice import PORTS, HexLattice


@dataclass(frozen=True, eq=False)
class Net:
    """Flat nodes and the pairs of them that hold their distance."""

    flat: Array  # (n, 2) places from the pinned node [m]
    pairs: IntArray  # (e, 2)
    load_fractions: Array  # (n,) of the forces that hold it, one in all
    straight: bool = False  # whether distances are measured through space (boards) or along the surface (a sheet)

    @cached_property
    def pair_vectors(self) -> Array:
        """From one node of each pair to the other, shape (e, 2) [m]."""
        return self.flat[self.pairs[:, 1]] - self.flat[self.pairs[:, 0]]

    @cached_property
    def lengths(self) -> Array:
        """Distances that the pairs hold, shape (e,) [m]."""
        return np.linalg.norm(self.pair_vectors, axis=1)

    @cached_property
    def incident_vectors(self) -> tuple[csr_array, csr_array]:
        """The x and the y of the arms, each at the two nodes that it joins, shapes (n, e) [m]."""
        order = self.pairs.ravel(), np.repeat(np.arange(len(self.pairs)), 2)
        size = len(self.flat), len(self.pairs)
        x, y = (csr_array((np.repeat(part, 2), order), size) for part in self.pair_vectors.T)
        return x, y

    @property
    def pitch(self) -> float:
        """The least of these distances [m]."""
        return float(self.lengths.min())

    @cached_property
    def pin(self) -> int:
        """The node at the origin."""
        return int(np.argmin((self.flat**2).sum(axis=1)))

    @cached_property
    def adjacent_to_pin(self) -> IntArray:
        """Nodes that hold their distance from the pinned one."""
        there = self.pairs[(self.pairs == self.pin).any(axis=1)]
        return there[there != self.pin]

    @cached_property
    def order(self) -> IntArray:
        """Order in which pairs have their nodes close to each other: along the shorter side first, shape (n,)."""
        orders = [np.lexsort(keys) for keys in (self.flat.T, self.flat.T[::-1])]
        positions = [np.argsort(order) for order in orders]
        return min(positions, key=lambda order: np.abs(np.diff(order[self.pairs], axis=1)).max())


@lru_cache(maxsize=32)
def grid_net(shape: tuple[int, int], step: tuple[float, float], pinned: tuple[int, int]) -> Net:
    """A grid whose nodes hold their distance along rows, across rows and over both diagonals.

    Parameters
    ----------
    shape, step : pair
        Number of nodes across the rows and along them, and the steps between them [m]; where the first step is
        negative, the next row lies on the other side.
    pinned : pair of int
        Row and column of the pinned node.
    """
    a, b = shape
    i, j = (k.ravel() for k in np.indices(shape))
    node = np.arange(a * b).reshape(shape)
    families = (
        (node[:, :-1], node[:, 1:]),
        (node[:-1], node[1:]),
        (node[:-1, :-1], node[1:, 1:]),
        (node[:-1, 1:], node[1:, :-1]),
    )
    pairs = np.concatenate([np.column_stack((start.ravel(), stop.ravel())) for start, stop in families])
    load_fractions = np.outer(_trapezoid(a), _trapezoid(b)).ravel()
    return Net(
        np.column_stack(((j - pinned[1]) * step[1], (i - pinned[0]) * step[0])),
        pairs,
        load_fractions / load_fractions.sum(),
    )


def _trapezoid(n: int) -> Array:
    weights = np.ones(n)
    if n > 1:
        weights[[0, -1]] = 0.5
    return weights


def board_net(lattice: HexLattice, cells: IntArray) -> Net:
    """Centres of boards, whose distance from the next ones is kept through space; the first is pinned.

    Parameters
    ----------
    cells : array of int, shape (n, 2)
        Axial coordinates.
    """
    number = {cell: i for i, cell in enumerate(map(tuple, cells.tolist()))}
    pairs = [
        (i, number[q + a, r + b]) for (q, r), i in number.items() for a, b in PORTS[:3] if (q + a, r + b) in number
    ]
    linked = np.array(pairs, np.int64).reshape(-1, 2)
    # The first is held by itself and those beside it: what hangs on one pair alone bears no force across it.
    bearing = np.isin(np.arange(len(cells)), np.append(linked[(linked == 0).any(axis=1)], 0))
    return Net(lattice.centres(cells - cells[0]), linked, bearing / bearing.sum(), straight=True)
