"""A first look at where boards fit: the rooms of all boards at many offsets and angles of their lattice."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from ..arrays import Array, IntArray
from .lattice import PORTS, HexLattice
from .region import Region
from .settle import Pose

# Boards looked at in a survey, about: offsets x angles x cells. It keeps the time the same for every region.
BUDGET = 5e6
# A step is between these shares of the pitch: a shorter one finds nothing new, a longer one overlooks too much.
SHORTEST, LONGEST = 1 / 40, 1 / 6
# From a pose to the nearest one of a survey, rounding included, no board's room changes by more than this many steps.
SLACK = 1.5
# Places are rounded to a step over this.
PARTS = 4
# So many of the best poses are looked at in halves of a step, so many times over.
KEPT, HALVINGS = 300, 2
# For each number of boards so many starts are tried, more than so many of the last steps from each other.
STARTS, APART = 30, 2
# Turned by this about the centre of a cell, a lattice lies on itself.
SIXTH = np.pi / 3
# Of the way from a board's centre to its corners: where its discs have their centres, apart from the first.
SHARES = (1.0, 0.5, 0.75)


@dataclass(frozen=True, eq=False)
class Survey:
    """Poses of a lattice at steps of angle and offset, and the rooms of the boards there."""

    lattice: HexLattice
    depths: "Depths"
    middle: Array  # (2,) about which the lattice is turned [m]
    reach: float  # from there to the furthest point of the region [m]
    step: float  # [m]
    angles: Array  # (a,) [rad]
    shifts: Array  # (s, 2) from the middle, on the lattice [m]
    rooms: NDArray[np.float32]  # (a, s, n) largest first [m]; -inf for what lacks more than the slack

    @property
    def count(self) -> int:
        """The most boards that fit at one of the poses, but for rounding."""
        return int(np.count_nonzero(self.rooms >= 0, axis=-1).max())

    def starts(self, count: int) -> Iterator[tuple[Pose, float, float]]:
        """Poses where so many boards have the most room, that room, and how much more they may find nearby [m]."""
        if count > self.rooms.shape[-1]:
            return
        room = self.rooms[..., count - 1]
        a, s = np.unravel_index(best_of(room.ravel(), SLACK * self.step), room.shape)
        angles, shifts, step = self.angles[a], self.shifts[s], self.step
        for _ in range(HALVINGS):
            step /= 2
            angles, shifts = self.halved(angles, shifts, step)
            room = self.room(angles, shifts, count, SLACK * step)
            best = best_of(room, SLACK * step)
            angles, shifts, room = angles[best], shifts[best], room[best]
        for _ in range(STARTS):
            if not len(angles):
                return
            turned = Pose(self.middle, float(angles[0]))
            yield Pose(turned.place(shifts[0]), turned.angle), float(room[0]), SLACK * step
            way = np.column_stack((shifts - shifts[0], (angles - angles[0]) * self.reach))
            far = np.abs(way).max(axis=1) > APART * step
            angles, shifts, room = angles[far], shifts[far], room[far]

    def halved(self, angles: Array, shifts: Array, step: float) -> tuple[Array, Array]:
        """The poses in the middle of the halves of all steps around the given ones."""
        free = np.array((len(self.shifts) > 1, len(self.shifts) > 1, len(self.angles) > 1))
        signs = np.unique((np.indices((2, 2, 2)).reshape(3, -1).T - 0.5) * free, axis=0)
        basis = self.lattice.centres(np.eye(2, dtype=np.int64)) / self.lattice.pitch
        moved = shifts[:, None] + step * signs[:, :2] @ basis
        turned = angles[:, None] + step / self.reach * signs[:, 2]
        return turned.ravel(), moved.reshape(-1, 2)

    def room(self, angles: Array, shifts: Array, count: int, slack: float) -> Array:
        """Room of the tightest of so many boards at each of the poses (k,), (k, 2), shape (k,) [m]."""
        centres = self.lattice.centres(cells_within(self.lattice, self.reach))
        room = np.full(len(angles), -np.inf)
        for angle in np.unique(angles):
            at = np.flatnonzero(angles == angle)
            pose = Pose(self.middle, float(angle))
            found = board_rooms(self.depths, self.lattice, pose, shifts[at], centres, slack)
            if found.shape[1] >= count:
                room[at] = np.partition(found, -count, axis=1)[:, -count]
        return room


def best_of(room: Array, slack: float) -> IntArray:
    """Rows of the poses (k,) with the most room, best first; none that lacks more than the slack."""
    rows = np.flatnonzero(room >= -slack)
    return rows[np.argsort(-room[rows], kind="stable")[:KEPT]]


def survey(region: Region, lattice: HexLattice, offset: Array | None, angle: float | None) -> Survey:
    """Look at a region in steps that suit it. A given offset (2,) [m] or angle [rad] is kept."""
    middle = region.box.mean(axis=0) if offset is None else offset
    reach = region.reach(middle)
    step = suitable_step(region, lattice, reach, offset is None, angle is None)
    turns = int(np.ceil(SIXTH * reach / step))
    angles = SIXTH * np.arange(turns) / turns if angle is None else np.array((angle,))
    shifts = lattice_shifts(lattice, int(np.ceil(lattice.pitch / step)) if offset is None else 1)
    centres = lattice.centres(cells_within(lattice, reach))
    margin = lattice.side + 2 * np.linalg.norm(shifts, axis=1).max() + 2 * step
    depths = depth_grid(region, margin, step)
    found = [board_rooms(depths, lattice, Pose(middle, float(a)), shifts, centres, SLACK * step) for a in angles]
    rooms = np.full((len(angles), len(shifts), max(1, *(r.shape[1] for r in found))), -np.inf, np.float32)
    for table, part in zip(rooms, found):
        table[:, : part.shape[1]] = part
    rooms.sort(axis=2)
    return Survey(lattice, depths, middle, reach, step, angles, shifts, rooms[..., ::-1])


def suitable_step(region: Region, lattice: HexLattice, reach: float, shifts: bool, turns: bool) -> float:
    """The step [m] that spends the budget, as far as it does not get too short or too long."""
    cell = np.sqrt(0.75) * lattice.pitch**2
    work = np.prod(np.ptp(region.box, axis=0)) / cell * (cell if shifts else 1) * (SIXTH * reach if turns else 1)
    step = (work / BUDGET) ** (1 / (2 * shifts + turns))
    return float(np.clip(step, SHORTEST * lattice.pitch, LONGEST * lattice.pitch))


def lattice_shifts(lattice: HexLattice, parts: int) -> Array:
    """All ways to shift a lattice by whole ``parts`` of its steps, each the shortest of its kind, (parts**2, 2) [m]."""
    share = np.arange(parts) / parts - (parts // 2) / parts
    axial = np.stack(np.meshgrid(share, share, indexing="ij"), axis=-1).reshape(-1, 1, 2)
    same = (axial + np.array(((0, 0), *PORTS))) @ lattice.centres(np.eye(2, dtype=np.int64))
    return same[np.arange(len(same)), np.linalg.norm(same, axis=2).argmin(axis=1)]


def cells_within(lattice: HexLattice, radius: float) -> IntArray:
    """Axial coordinates of the cells whose centres are not further than this from the centre of (0, 0), (n, 2)."""
    most = int(radius / (np.sqrt(0.75) * lattice.pitch)) + 1
    r, q = (a.ravel() for a in np.indices((2 * most + 1, 2 * most + 1)) - most)
    cells = np.column_stack((q, r))
    return cells[np.linalg.norm(lattice.centres(cells), axis=1) <= radius]


@dataclass(frozen=True, eq=False)
class Depths:
    """How far inside a region the nodes of a grid lie, row after row along x; negative outside."""

    values: NDArray[np.float32]  # (rows * columns,) [m]
    columns: int
    low: Array  # (2,) place of the first [m]
    spacing: float  # [m]

    @property
    def size(self) -> Array:
        """From the first to the last node (2,) [m]."""
        return self.spacing * (np.array((self.columns, len(self.values) // self.columns)) - 1)

    def index(self, vectors: Array) -> IntArray:
        """How many nodes it is along vectors (..., 2), rounded; from ``low`` this is the row of ``values``."""
        column, row = np.moveaxis(np.rint(vectors / self.spacing).astype(np.int64), -1, 0)
        return row * self.columns + column


def depth_grid(region: Region, margin: float, step: float) -> Depths:
    """Depths around a region as far as ``margin`` outside, found at each step and interpolated between."""
    low = region.box[0] - margin
    columns, rows = (np.ceil((region.box[1] + margin - low) / step) + 1).astype(int)
    nodes = low + step * np.stack(np.meshgrid(np.arange(columns), np.arange(rows)), axis=-1).reshape(-1, 2)
    away = cKDTree(border_points(region, step / 2)).query(nodes)[0]
    depths = np.where(region.contains(nodes), away, -away).astype(np.float32).reshape(rows, columns)
    for _ in range(2):
        depths = finer(depths).T
    return Depths(depths.ravel(), depths.shape[1], low, step / PARTS)


def border_points(region: Region, step: float) -> Array:
    """Points on the border of a region, no further from each other than a step, (n, 2)."""
    start, along = region.edges[:, 0], region.edges[:, 1] - region.edges[:, 0]
    counts = np.ceil(np.linalg.norm(along, axis=1) / step).astype(int)
    edge = np.repeat(np.arange(len(along)), counts)
    share = (np.arange(len(edge)) - np.repeat(np.cumsum(counts) - counts, counts) + 0.5) / counts[edge]
    return np.concatenate((region.points, start[edge] + share[:, None] * along[edge]))


def finer(rows: NDArray[np.float32]) -> NDArray[np.float32]:
    """Rows with as many between them as parts of a step ask for."""
    between = [rows[:-1] + np.float32(i / PARTS) * (rows[1:] - rows[:-1]) for i in range(PARTS)]
    return np.concatenate((np.stack(between, axis=1).reshape(-1, rows.shape[1]), rows[-1:]))


def board_rooms(depths: Depths, lattice: HexLattice, pose: Pose, shifts: Array, centres: Array, slack: float) -> Array:
    """Rooms of the boards with ``centres`` (n, 2) under all ``shifts`` (s, 2), shape (s, m), for the m that may fit.

    A board is taken for discs, each as large as it has room for: about its centre, on the way to its corners, and a
    point at these. It has as much room as the least of them; -inf stands for less than minus the slack.
    """
    far = np.linalg.norm(shifts, axis=1).max()
    corners, apothem = pose.turn(lattice.corners), np.sqrt(0.75) * lattice.side
    places = pose.place(centres) - depths.low
    places = places[((places >= 0) & (places <= depths.size)).all(axis=1)]
    places = places[depths.values[depths.index(places)] >= apothem - slack - far]
    nodes = (depths.index(pose.turn(shifts))[:, None] + depths.index(places)).ravel()
    rooms = depths.values[nodes] - np.float32(apothem)
    left = np.arange(len(nodes))
    for share in SHARES:
        steps, radius = depths.index(share * corners), np.float32((1 - share) * apothem)
        keep = rooms >= -slack
        left, nodes, rooms = left[keep], nodes[keep], rooms[keep]
        for step in steps:
            np.minimum(rooms, depths.values[nodes + step] - radius, out=rooms)
    table = np.full(len(shifts) * len(places), -np.inf, np.float32)
    table[left] = np.where(rooms >= -slack, rooms, -np.inf)
    return table.reshape(len(shifts), -1)
