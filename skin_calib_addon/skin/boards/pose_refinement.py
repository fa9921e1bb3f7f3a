"""Refinement of the pose of a lattice in a region: maximum clearance by a sequence of linear programs."""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import linprog

from ...common.arrays import Array
from ..lattice import ROUNDING, HexLattice
from .board_contacts import contacts
from .region import Region

# Limit of the moves of one refinement. Larger: more clearance in difficult regions, slower.
MAX_REFINEMENT_MOVES = 12
# Contacts within this number of steps can bound the clearance after a move: both sides of a gap move by less than 2.5.
# Larger: larger linear programs.
HORIZON_STEPS = 5
# Error of the linear program, as a fraction of a step: rotations move boards on circles. Larger: accepts worse moves.
LINEARIZATION_TOLERANCE = 0.05
# Length [m] that is rounding: outlines that overlap by less still touch, and a smaller movement has no effect. It is
# far below the precision of boards. Larger: accepts boards that overlap the border.
TOUCH_TOLERANCE = 1e-9


@dataclass(frozen=True, eq=False)
class Pose:
    """Pose of a lattice in the plane: position of the centre of cell (0, 0) [m], angle from x to the rows [rad]."""

    offset: Array  # (2,)
    angle: float

    def turn(self, vectors: Array) -> Array:
        """Return vectors (..., 2) of the lattice, rotated into the plane."""
        c, s = np.cos(self.angle), np.sin(self.angle)
        return vectors @ np.array(((c, s), (-s, c)))

    def to_plane(self, points: Array) -> Array:
        """Return points (..., 2) of the lattice in the plane [m]."""
        return self.offset + self.turn(points)


@dataclass(frozen=True, eq=False)
class PoseRefinement:
    """Refinement of the pose of boards in a region."""

    region: Region
    lattice: HexLattice
    step: float  # limit of a move along x, along y, and of the farthest point of the region in a rotation [m]
    is_free: tuple[bool, bool, bool]  # translation along x, along y, rotation

    def clearances(self, pose: Pose, centres: Array) -> Array:
        """Return the clearances of boards, shape (n,) [m].

        Parameters
        ----------
        pose : Pose
            Pose of the lattice.
        centres : array, shape (n, 2)
            Centres of the boards on the lattice [m].
        """
        return self.region.clearances(pose.to_plane(centres), pose.turn(self.lattice.corners))

    def refine(
        self, pose: Pose, centres: Array, count: int, floor: float = -np.inf, balance: bool = False
    ) -> tuple[Pose, float]:
        """Rotate and shift the lattice to a local maximum of the smallest clearance of the best ``count`` boards.

        Parameters
        ----------
        pose : Pose
            Start.
        centres : array, shape (n, 2)
            Centres of the boards to choose from, on the lattice [m].
        count : int
            Number of boards that must fit.
        floor : float
            The refinement stops when no further move can give this clearance [m].
        balance : bool
            After the smallest clearance, maximize those of the boards that can still move.

        Returns
        -------
        pose : Pose
            The refined pose.
        clearance : float
            Smallest clearance of the boards there [m].
        """
        clearances, step = self.clearances(pose, centres), self.step
        clearance = np.partition(clearances, -count)[-count]
        centres = centres[clearances >= clearance - 2 * HORIZON_STEPS * step]
        clearances = clearances[clearances >= clearance - 2 * HORIZON_STEPS * step]
        for _ in range(MAX_REFINEMENT_MOVES):
            chosen = np.argsort(-clearances, kind="stable")[:count]
            bound = chosen[clearances[chosen] <= clearance + HORIZON_STEPS * step]
            moved, length, gain = self.best_move(pose, centres[bound], clearance, step, balance)
            if (
                length < (1 - LINEARIZATION_TOLERANCE) * step
                and clearance + gain < floor - LINEARIZATION_TOLERANCE * step
            ):
                break
            if (length if balance else gain) < TOUCH_TOLERANCE:
                break
            new_clearances = self.clearances(moved, centres)
            new_clearance = np.partition(new_clearances, -count)[-count]
            if new_clearance > clearance - (LINEARIZATION_TOLERANCE * step if balance else 0):
                pose, clearances, clearance = moved, new_clearances, new_clearance
                step = min(step, 2 * length)  # the error of a short move is a fraction of the step
            else:
                step /= 4
        return pose, float(clearance)

    def best_move(
        self, pose: Pose, centres: Array, clearance: float, step: float, balance: bool
    ) -> tuple[Pose, float, float]:
        """Return the move within a step that maximizes the smallest clearance, with linear motion of the outlines.

        Parameters
        ----------
        pose : Pose
            Pose of the lattice.
        centres : array, shape (n, 2)
            Centres of the boards that count, on the lattice [m].
        clearance : float
            Their smallest clearance [m].
        step : float
            Limit of the move [m].
        balance : bool
            As for :meth:`refine`.

        Returns
        -------
        pose : Pose
            The new pose.
        length : float
            Length of the move [m].
        gain : float
            Predicted increase of the smallest clearance [m].
        """
        within = max(clearance, 0) + HORIZON_STEPS * step
        points, normals, gaps = contacts(
            self.region, pose.to_plane(centres), pose.turn(self.lattice.corners), within, step
        )
        x, y = (points - pose.offset).T
        radius = self.region.radius_about(pose.offset)
        slopes = np.column_stack((normals, (normals[:, 1] * x - normals[:, 0] * y) / radius))
        move, gain = _largest_gap_move(slopes, (gaps - clearance) / step, self.is_free, balance)
        moved = Pose(pose.offset + step * move[:2], float(pose.angle + step * move[2] / radius))
        return moved, step * np.abs(move).max(), step * gain


def _largest_gap_move(slopes: Array, gaps: Array, is_free: tuple[bool, ...], balance: bool) -> tuple[Array, float]:
    r"""Return the move that maximizes the smallest gap, and that gap.

    .. math:: \max_{d, t} t \quad \text{subject to} \quad g_i + s_i \cdot d \ge t, \quad |d_j| \le 1

    The gaps g are in steps, and the slopes s are their derivatives. With ``balance``, the gaps that bound t are fixed;
    then the smallest of the others is maximized, and so on.
    """
    is_fixed, sizes, move = np.zeros(len(gaps), bool), np.zeros(len(gaps)), np.zeros(3)
    bounds = [(-free, free) for free in map(int, is_free)] + [(None, HORIZON_STEPS)]
    while not is_fixed.all():
        table: Array = np.column_stack((-slopes, (~is_fixed).astype(float)))
        found = linprog(np.array((0, 0, 0, -1.0)), A_ub=table, b_ub=gaps - sizes, bounds=bounds, method="highs-ds")
        if found.status != 0 or found.x is None:  # rounding has made the fixed gaps infeasible: keep the last move
            break
        move = found.x[:3]
        tight = ~is_fixed & (found.ineqlin.marginals < -ROUNDING)
        if not balance or not tight.any():
            break
        # No move along the slopes of the active gaps is left. Gaps with slopes in their span are fixed, too.
        span = slopes[is_fixed | tight]
        is_fixed = np.linalg.norm(slopes - slopes @ np.linalg.pinv(span, rcond=ROUNDING) @ span, axis=1) < ROUNDING
        sizes = np.where(is_fixed, gaps + slopes @ move, 0.0)
    return move, float((gaps + slopes @ move).min(initial=HORIZON_STEPS))
