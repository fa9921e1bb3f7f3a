"""Move a lattice of boards in a region until they have the most room: a sequence of linear programmes."""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import linprog

from ...common.arrays import Array
from ..lattice import HexLattice
from .board_contacts import contacts
from .region import Region

MAX_MOVES = 12
# What may bound the room after a move is no further off than this many steps: both sides of a gap go less than 2.5.
HORIZON_STEPS = 5
# By this share of a step the room after a move may differ from what its linear programme says: boards turn on circles.
LINEARIZATION_TOLERANCE = 0.05
# Lengths below this are nothing to a board that settles [m].
MOVE_TOLERANCE = 1e-11
# A price above this says that a row bounds the room.
MIN_MULTIPLIER = 1e-6
# Slopes that differ by less than this are the same.
PARALLEL_TOLERANCE = 1e-6


@dataclass(frozen=True, eq=False)
class Pose:
    """How a lattice lies in the plane: the centre of cell (0, 0) [m], and the angle of its rows to x [rad]."""

    offset: Array  # (2,)
    angle: float

    def turn(self, vectors: Array) -> Array:
        """Vectors (..., 2) of the lattice, turned with it."""
        c, s = np.cos(self.angle), np.sin(self.angle)
        return vectors @ np.array(((c, s), (-s, c)))

    def to_plane(self, points: Array) -> Array:
        """Points (..., 2) of the lattice, where they lie in the plane [m]."""
        return self.offset + self.turn(points)


@dataclass(frozen=True, eq=False)
class PoseRefinement:
    """Boards in a region that look for room."""

    region: Region
    lattice: HexLattice
    step: float  # the longest move along x, along y, and of the region's furthest point in a turn [m]
    is_free: tuple[bool, bool, bool]  # along x, along y, to turn

    def clearances(self, pose: Pose, centres: Array) -> Array:
        """Room of boards with ``centres`` (n, 2) on the lattice, shape (n,) [m]."""
        return self.region.clearances(pose.to_plane(centres), pose.turn(self.lattice.corners))

    def refine(
        self, pose: Pose, centres: Array, count: int, floor: float = -np.inf, balance: bool = False
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
        clearances, step = self.clearances(pose, centres), self.step
        clearance = np.partition(clearances, -count)[-count]
        centres = centres[clearances >= clearance - 2 * HORIZON_STEPS * step]
        clearances = clearances[clearances >= clearance - 2 * HORIZON_STEPS * step]
        for _ in range(MAX_MOVES):
            chosen = np.argsort(-clearances, kind="stable")[:count]
            bound = chosen[clearances[chosen] <= clearance + HORIZON_STEPS * step]
            moved, length, gain = self.best_move(pose, centres[bound], clearance, step, balance)
            if (
                length < (1 - LINEARIZATION_TOLERANCE) * step
                and clearance + gain < floor - LINEARIZATION_TOLERANCE * step
            ):
                break
            if (length if balance else gain) < MOVE_TOLERANCE:
                break
            new_clearances = self.clearances(moved, centres)
            new_clearance = np.partition(new_clearances, -count)[-count]
            if new_clearance > clearance - (LINEARIZATION_TOLERANCE * step if balance else 0):
                pose, clearances, clearance = moved, new_clearances, new_clearance
                step = min(step, 2 * length)  # a short move has been told to a share of the step only
            else:
                step /= 4
        return pose, float(clearance)

    def best_move(
        self, pose: Pose, centres: Array, clearance: float, step: float, balance: bool
    ) -> tuple[Pose, float, float]:
        """The move within a step that gives these boards the most room, if outlines moved straight on.

        Returns
        -------
        pose : Pose
        way, gain : float
            How far this leads, and by how much the least room grows [m].
        """
        within = max(clearance, 0) + HORIZON_STEPS * step
        points, normals, gaps = contacts(
            self.region, pose.to_plane(centres), pose.turn(self.lattice.corners), within, step
        )
        x, y = (points - pose.offset).T
        radius = self.region.radius_about(pose.offset)
        slopes = np.column_stack((normals, (normals[:, 1] * x - normals[:, 0] * y) / radius))
        length, gain = _largest_gap_move(slopes, (gaps - clearance) / step, self.is_free, balance)
        moved = Pose(pose.offset + step * length[:2], float(pose.angle + step * length[2] / radius))
        return moved, step * np.abs(length).max(), step * gain


def _largest_gap_move(slopes: Array, gaps: Array, is_free: tuple[bool, ...], balance: bool) -> tuple[Array, float]:
    """The ``way`` within [-1, 1] that makes the least of ``gaps + slopes @ way`` the largest, and that least gap.

    With ``even``, the gaps that this leaves no play keep their sizes, then the least of the others is made the largest,
    and so on.
    """
    is_fixed, sizes, length = np.zeros(len(gaps), bool), np.zeros(len(gaps)), np.zeros(3)
    bounds = [(-free, free) for free in map(int, is_free)] + [(None, HORIZON_STEPS)]
    while not is_fixed.all():
        table: Array = np.column_stack((-slopes, (~is_fixed).astype(float)))
        found = linprog(np.array((0, 0, 0, -1.0)), A_ub=table, b_ub=gaps - sizes, bounds=bounds, method="highs-ds")
        if found.status != 0 or found.x is None:  # rounding has closed what was held: the last round is good enough
            break
        length = found.x[:3]
        tight = ~is_fixed & (found.ineqlin.marginals < -MIN_MULTIPLIER)
        if not balance or not tight.any():
            break
        # Where gaps bound each other nothing moves along their slopes; those with slopes in the same span stay as well.
        span = slopes[is_fixed | tight]
        is_fixed = (
            np.linalg.norm(slopes - slopes @ np.linalg.pinv(span, rcond=PARALLEL_TOLERANCE) @ span, axis=1)
            < PARALLEL_TOLERANCE
        )
        sizes = np.where(is_fixed, gaps + slopes @ length, 0.0)
    return length, float((gaps + slopes @ length).min(initial=HORIZON_STEPS))
