"""Nets: the nodes of a flat sheet, and the pairs of nodes that keep their distance on a surface."""

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from scipy.sparse import csr_array

from ...common.arrays import Array, IntArray

Lines = tuple[float, ...]  # positions of the rows or columns of nodes, in steps, in increasing order
GridLines = tuple[Lines, Lines]  # of the rows and of the columns


@dataclass(frozen=True, eq=False)
class Net:
    """Flat nodes and the pairs of them that keep their distance."""

    flat: Array  # (n, 2) positions relative to the pinned node [m]
    pairs: IntArray  # (e, 2)
    load_fractions: Array  # (n,) fraction of the constraint forces on each node; the sum is one
    meshes: IntArray  # (m, 4) nodes at the corners of each mesh
    stiffness: csr_array  # (e, m) stiffness of each pair because of each mesh; a square of mean area has 1/2 or 1

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
    def on_row_of_pin(self) -> IntArray:
        """Nodes of the row of the pinned one that are paired with it."""
        there = self.pairs[(self.pairs == self.pin).any(axis=1)]
        adjacent = there[there != self.pin]
        return adjacent[self.flat[adjacent, 1] == self.flat[self.pin, 1]]

    @cached_property
    def order(self) -> IntArray:
        """Order of the nodes that gives a small bandwidth: along the shorter side first, shape (n,)."""
        orders = [np.lexsort(keys) for keys in (self.flat.T, self.flat.T[::-1])]
        positions = [np.argsort(order) for order in orders]
        return min(positions, key=lambda order: np.abs(np.diff(order[self.pairs], axis=1)).max())


@lru_cache(maxsize=32)
def grid_net(lines: GridLines, step: tuple[float, float], pinned: tuple[float, float]) -> Net:
    r"""Return a rectangular grid; nodes keep their distances along rows, across rows and along both diagonals.

    The grid is an isotropic sheet with Poisson's ratio 1/3, whatever its lines are. A mesh with the area A [m^2] and
    the cosine c and the sine s of its diagonal has the energy

    .. math::
        A \left(k_r \varepsilon_r^2 + k_c \varepsilon_c^2 + k_d (\varepsilon_1^2 + \varepsilon_2^2)\right), \quad
        k_d = \frac{1}{4 c^2 s^2}, \quad k_r = \frac32 - 2 k_d c^4, \quad k_c = \frac32 - 2 k_d s^4

    with the strains along the row, across it and along both diagonals. No stiffness is negative, so that meshes longer
    than :math:`\sqrt 3` times their width have too little stiffness in shear.
    """
    rows, columns = (np.array(positions, float) for positions in lines)
    shape = len(rows), len(columns)
    y, x = (k.ravel() for k in np.meshgrid(rows, columns, indexing="ij"))
    node = np.arange(len(x)).reshape(shape)
    a, b, c, d = (part.ravel() for part in (node[:-1, :-1], node[:-1, 1:], node[1:, :-1], node[1:, 1:]))
    families = (node[:, :-1], node[:, 1:]), (node[:-1], node[1:]), (a, d), (c, b)
    pairs = np.concatenate([np.column_stack((start.ravel(), stop.ravel())) for start, stop in families])
    width, height = (
        k.ravel() for k in np.meshgrid(*(np.diff(k) * abs(d) for k, d in zip((columns, rows), step[::-1])))
    )
    cos2 = width**2 / (width**2 + height**2)
    area = width * height / (width * height).mean()
    diagonal = np.minimum(1 / (4 * cos2 * (1 - cos2)), 0.75 / np.maximum(cos2, 1 - cos2) ** 2)
    row, column = (np.maximum(1.5 - 2 * diagonal * part**2, 0) for part in (cos2, 1 - cos2))
    mesh = np.arange(len(a))
    along = mesh.reshape(shape[0] - 1, shape[1] - 1)
    first = np.cumsum([0, node[:, 1:].size, node[1:].size, len(a)])
    under = np.arange(first[1]).reshape(shape[0], -1), first[1] + np.arange(node[1:].size).reshape(-1, shape[1])
    pair = (under[0][:-1], under[0][1:], under[1][:, :-1], under[1][:, 1:], first[2] + along, first[3] + along)
    parts = np.concatenate((row / 2, row / 2, column / 2, column / 2, diagonal, diagonal)) * np.tile(area, 6)
    entries = np.concatenate([k.ravel() for k in pair]), np.tile(mesh, 6)
    load_fractions = np.outer(_widths(rows), _widths(columns)).ravel()
    return Net(
        np.column_stack(((x - pinned[1]) * step[1], (y - pinned[0]) * step[0])),
        pairs,
        load_fractions / load_fractions.sum(),
        np.column_stack((a, b, c, d)),
        csr_array((parts, entries), (len(pairs), len(mesh))),
    )


def _widths(positions: Array) -> Array:
    """Return half of the distance from the position before to the one after each; an end has one neighbour."""
    halves: Array = np.diff(positions) / 2
    return np.append(halves, 0.0) + np.append(0.0, halves)
