"""The flat region of the boards: its border, and the depth of points in it."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree

from ...common.arrays import Array, BoolArray, pairs_of, unit
from ..lattice import ROUNDING
from .flat_map import FlatMap
from .ground import Ground

# [1] Nodes of the grid that finds the border, per pitch. More: finds smaller holes, slower (half: 52 instead
# of 55 boards on four links of the G1; double: 55, 1.6 times the time).
BORDER_NODES_PER_PITCH = 6
# [1] Most of these nodes along each parameter. More: finds smaller holes below small boards, slower.
MAX_BORDER_NODES = 250
# [1] Exactness of the border, in sides. Larger: it moves in steps with the mesh, so that noise of a nanometre changes
# which boards fit (0.001: in 3 of 30 cases on the iCub thigh); smaller: slower.
BORDER_EXACTNESS = 1e-5
# [1] Samples of each piece of the border. Fewer: depths next to corners are less exact (by 0.3 instead of 0.04 mm
# with half); more: slower.
BORDER_SAMPLES = 8
# [1] Nearest samples of the border that are compared. More: more exact next to corners (0.12 mm with half), slower.
NEAR_SAMPLES = 4


@dataclass(frozen=True, eq=False)
class Region:
    """The part of the plane where the ground carries boards."""

    nodes: Array  # (k, 2) flat positions of the nodes [m]
    covers: BoolArray  # (k,) which of them may be below a board
    carries: BoolArray  # (k,) which of them may be the centre of a board; around a tube once
    spacing: float  # of the nodes [m]
    pieces: Array  # (s, 2, 2) ends of the pieces of the border [m]
    inward: Array  # (s, 2) their unit normals into the region

    @cached_property
    def _node_tree(self) -> cKDTree:
        return cKDTree(self.nodes)

    @cached_property
    def _border(self) -> cKDTree:
        fraction = (np.arange(BORDER_SAMPLES) + 0.5)[:, None] / BORDER_SAMPLES
        start, stop = self.pieces[:, :1], self.pieces[:, 1:]
        return cKDTree((start + fraction * (stop - start)).reshape(-1, 2))

    def may_be_centres(self, points: Array, more_than_once: bool = False) -> BoolArray:
        """Return whether boards may be centred at flat points, by the nearest node."""
        distance, node = self._node_tree.query(points)
        return (self.covers if more_than_once else self.carries)[node] & (distance <= 2 * self.spacing)

    def depths(self, points: Array) -> Array:
        """Return the distances of flat points (k, 2) from the border, negative outside, shape (k,) [m]."""
        if not len(self.pieces):
            return np.full(len(points), -np.inf)
        sample = self._border.query(points, k=np.arange(1, NEAR_SAMPLES + 1))[1]
        piece = np.minimum(sample // BORDER_SAMPLES, len(self.pieces) - 1)
        start, along = self.pieces[piece, 0], self.pieces[piece, 1] - self.pieces[piece, 0]
        arms = points[:, None] - start
        fraction = np.clip((arms * along).sum(axis=2) / (along**2).sum(axis=2), 0, 1)
        distance = np.linalg.norm(arms - fraction[..., None] * along, axis=2)
        height = (arms * self.inward[piece]).sum(axis=2)
        # At a corner both pieces are equally near. The one that is seen less obliquely gives the side.
        nearest = distance <= distance.min(axis=1, keepdims=True) + ROUNDING * self.spacing
        chosen = np.where(nearest, np.abs(height), -1.0).argmax(axis=1)[:, None]
        sign = np.where(np.take_along_axis(height, chosen, axis=1) < 0, -1.0, 1.0)
        return (sign * np.take_along_axis(distance, chosen, axis=1))[:, 0]


def region_of(to_flat: FlatMap, ground: Ground, pitch: float) -> Region:
    """Find the region of a map in which the ground carries boards."""
    lines = [_even_line(to_flat, axis, pitch / BORDER_NODES_PER_PITCH) for axis in (0, 1)]
    uv, shape = pairs_of(*lines), (len(lines[0]), len(lines[1]))
    nodes = to_flat(uv)
    rows = nodes.reshape(*shape, 2)
    spacing = max(float(np.linalg.norm(np.diff(rows, axis=k), axis=2).mean()) for k in (0, 1))
    covers = ground.covers(uv)
    carries = covers.copy()
    if not covers.all():  # a board has this distance from the border
        carries[covers] = cKDTree(nodes[~covers]).query(nodes[covers])[0] > np.sqrt(0.75) * ground.side - spacing
    carries[carries] = ground.carries(uv[carries])
    if carries.any():  # the border of other parts only takes time
        covers &= cKDTree(nodes[carries]).query(nodes)[0] < ground.side + 2 * spacing
    if to_flat.surface.closed[1]:
        carries &= np.abs(uv[:, 1] - to_flat.start[1]) <= 0.5
    return Region(nodes, covers, carries, spacing, *_border(to_flat, ground, uv, covers.reshape(shape), spacing))


def _even_line(to_flat: FlatMap, axis: int, spacing: float) -> Array:
    """Return parameters along one axis of the map, ends included, with even steps in the middle of the map."""
    low, high = to_flat.domain[:, axis].tolist()
    fine = np.linspace(low, high, MAX_BORDER_NODES + 1)
    uv = np.tile(to_flat.domain.mean(axis=0), (len(fine), 1))
    uv[:, axis] = fine
    lengths = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(to_flat(uv), axis=0), axis=1)))
    # A whole number of steps is not where the rounding changes.
    count = int(np.clip(lengths[-1] / spacing + 0.6, 8, MAX_BORDER_NODES)) + 1
    return np.interp(np.linspace(0, lengths[-1], count), lengths, fine)


def _border(to_flat: FlatMap, ground: Ground, uv: Array, covers: BoolArray, spacing: float) -> tuple[Array, Array]:
    """Return the pieces of the border of the covered nodes, shape (s, 2, 2) [m], and their inward normals (s, 2).

    Between two nodes the step is halved until the border is known to ``BORDER_EXACTNESS`` sides.
    """
    number = np.arange(covers.size).reshape(covers.shape)
    covered, nodes = covers.ravel(), to_flat(uv)
    inner, outer, tables, total = [], [], [], 0
    for a, b in ((number[:-1], number[1:]), (number[:, :-1], number[:, 1:])):
        crosses = covered[a] != covered[b]
        table = np.full(a.shape, -1)  # number of the crossing between each node and the next
        table[crosses] = total + np.arange(np.count_nonzero(crosses))
        tables.append(table)
        total += int(np.count_nonzero(crosses))
        inner.append(np.where(covered[a], a, b)[crosses])
        outer.append(np.where(covered[a], b, a)[crosses])
    inside, outside = np.concatenate(inner), np.concatenate(outer)
    inwards, inside, outside = nodes[inside] - nodes[outside], uv[inside], uv[outside]
    for _ in range(int(np.log2(spacing / (BORDER_EXACTNESS * ground.side))) if total else 0):
        middle = (inside + outside) / 2
        free = ground.covers(middle)[:, None]
        inside, outside = np.where(free, middle, inside), np.where(free, outside, middle)
    crossings = to_flat(inside)
    # Marching squares: the two or four crossings of each cell of the grid.
    along_u, along_v = tables
    of_cell = np.stack((along_v[:-1], along_u[:, 1:], along_v[1:], along_u[:, :-1]), axis=-1).reshape(-1, 4)
    of_cell = -np.sort(-of_cell, axis=1)
    ends = np.concatenate((of_cell[of_cell[:, 1] >= 0, :2], of_cell[of_cell[:, 3] >= 0, 2:]))
    pieces, towards = [crossings[ends]], [inwards[ends[:, 0]]]
    lines = [(number[0], number[1], along_v[0]), (number[-1], number[-2], along_v[-1])]
    if not to_flat.surface.closed[1]:
        lines += [(number[:, 0], number[:, 1], along_u[:, 0]), (number[:, -1], number[:, -2], along_u[:, -1])]
    for line, next_line, crossing in lines:  # the ends of the surface
        a, b = line[:-1], line[1:]
        used = covered[a] | covered[b]
        at = np.append(crossings, np.zeros((1, 2)), axis=0)[crossing]
        both = [np.where(covered[k][:, None], nodes[k], at) for k in (a, b)]
        pieces.append(np.stack(both, axis=1)[used])
        towards.append((nodes[next_line[:-1]] - nodes[a])[used])
    found, inwards = np.concatenate(pieces), np.concatenate(towards)
    along = found[:, 1] - found[:, 0]
    has_length = np.linalg.norm(along, axis=1) > ROUNDING * np.linalg.norm(inwards, axis=1)
    along, inwards = unit(along[has_length]), inwards[has_length]
    across = np.column_stack((-along[:, 1], along[:, 0]))
    return found[has_length], across * np.where((across * inwards).sum(axis=1) < 0, -1.0, 1.0)[:, None]
