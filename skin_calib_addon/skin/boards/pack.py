"""Move a lattice of boards in a region until they have the most room: a sequence of linear programmes."""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import linprog

from ...common.arrays import Array
from ..lattice import HexLattice
from .board_contacts import contacts
from .region import Region

MOST_MOVES = 12
# What may bound the room after a move is no further off than this many steps: both sides of a gap go less than 2.5.
HORIZON = 5
# By this share of a step the room after a move may differ from what its linear programme says: boards turn on circles.
BEND = 0.05
# Lengths below this are nothing to a board that settles [m].
SETTLED = 1e-11
# A price above this says that a row bounds the room.
PRICE = 1e-6
# Slopes that differ by less than this are the same.
PARALLEL = 1e-6


@dataclass(frozen=True, eq=False)
class Pose:
    """How a lattice lies in the plane: the centre of cell (0, 0) [m], and the angle of its rows to x [rad]."""

    offset: Array  # (2,)
    angle: float

    def turn(self, vectors: Array) -> Array:
        """Vectors (..., 2) of the lattice, turned with it."""
        c, s = np.cos(self.angle), np.sin(self.angle)
        return vectors @ np.array(((c, s), (-s, c)))

    def place(self, points: Array) -> Array:
        """Points (..., 2) of the lattice, where they lie in the plane [m]."""
        return self.offset + self.turn(points)


@dataclass(frozen=True, eq=False)
class Settling:
    """Boards in a region that look for room."""

    region: Region
    lattice: HexLattice
    step: float  # the longest move along x, along y, and of the region's furthest point in a turn [m]
    is_free: tuple[bool, bool, bool]  # along x, along y, to turn

    def rooms(self, pose: Pose, centres: Array) -> Array:
        """Room of boards with ``centres`` (n, 2) on the lattice, shape (n,) [m]."""
        return self.region.rooms(pose.place(centres), pose.turn(self.lattice.corners))

    def settle(
        self, pose: Pose, centres: Array, count: int, floor: float = -np.inf, even: bool = False
    ) -> tuple[Pose, float]:
        """Turn and shift the lattice until the ``count`` roomiest boards have as much room as they find near here.

        Parameters
        ----------
        centres : array, shape (n, 2)
            The boards to choose from, on the lattice [m].
        floor : float
            Where they cannot get that much room [m], they are left early.
        even : bool
            Once the least room is the largest, let the boards that can still move share what room they have.

        Returns
        -------
        pose : Pose
        room : float
            The least room of the boards there [m].
        """
        rooms, step = self.rooms(pose, centres), self.step
        room = np.partition(rooms, -count)[-count]
        centres = centres[rooms >= room - 2 * HORIZON * step]
        rooms = rooms[rooms >= room - 2 * HORIZON * step]
        for _ in range(MOST_MOVES):
            chosen = np.argsort(-rooms, kind="stable")[:count]
            bound = chosen[rooms[chosen] <= room + HORIZON * step]
            moved, way, gain = self.move(pose, centres[bound], room, step, even)
            if way < (1 - BEND) * step and room + gain < floor - BEND * step:
                break
            if (way if even else gain) < SETTLED:
                break
            new = self.rooms(moved, centres)
            reached = np.partition(new, -count)[-count]
            if reached > room - (BEND * step if even else 0):
                pose, rooms, room = moved, new, reached
                step = min(step, 2 * way)  # a short move has been told to a share of the step only
            else:
                step /= 4
        return pose, float(room)

    def move(self, pose: Pose, centres: Array, room: float, step: float, even: bool) -> tuple[Pose, float, float]:
        """The move within a step that gives these boards the most room, if outlines moved straight on.

        Returns
        -------
        pose : Pose
        way, gain : float
            How far this leads, and by how much the least room grows [m].
        """
        within = max(room, 0) + HORIZON * step
        points, normals, gaps = contacts(
            self.region, pose.place(centres), pose.turn(self.lattice.corners), within, step
        )
        x, y = (points - pose.offset).T
        reach = self.region.reach(pose.offset)
        slopes = np.column_stack((normals, (normals[:, 1] * x - normals[:, 0] * y) / reach))
        way, gain = widest(slopes, (gaps - room) / step, self.is_free, even)
        moved = Pose(pose.offset + step * way[:2], float(pose.angle + step * way[2] / reach))
        return moved, step * np.abs(way).max(), step * gain


def widest(slopes: Array, gaps: Array, is_free: tuple[bool, ...], even: bool) -> tuple[Array, float]:
    """The ``way`` within [-1, 1] that makes the least of ``gaps + slopes @ way`` the largest, and that least gap.

    With ``even``, the gaps that this leaves no play keep their sizes, then the least of the others is made the largest,
    and so on.
    """
    held, sizes, way = np.zeros(len(gaps), bool), np.zeros(len(gaps)), np.zeros(3)
    bounds = [(-free, free) for free in map(int, is_free)] + [(None, HORIZON)]
    while not held.all():
        table: Array = np.column_stack((-slopes, (~held).astype(float)))
        found = linprog(np.array((0, 0, 0, -1.0)), A_ub=table, b_ub=gaps - sizes, bounds=bounds, method="highs-ds")
        if found.status != 0 or found.x is None:  # rounding has closed what was held: the last round is good enough
            break
        way = found.x[:3]
        tight = ~held & (found.ineqlin.marginals < -PRICE)
        if not even or not tight.any():
            break
        # Where gaps bound each other nothing moves along their slopes; those with slopes in the same span stay as well.
        span = slopes[held | tight]
        held = np.linalg.norm(slopes - slopes @ np.linalg.pinv(span, rcond=PARALLEL) @ span, axis=1) < PARALLEL
        sizes = np.where(held, gaps + slopes @ way, 0.0)
    return way, float((gaps + slopes @ way).min(initial=HORIZON))
