"""Candidate poses of a lattice: clearances of its boards at many offsets and angles, finer near the best ones."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from ...common.arrays import Array, IntArray
from ..lattice import PORTS, HexLattice
from .pose_refinement import Pose
from .region import Region

# Step between candidates, between starts, and of a move that balances the clearances, in pitches. Smaller: slower,
# finds no more boards. Larger: misses poses.
STEP_IN_PITCHES = 0.1
# Limit of the evaluations (offsets x angles x cells). In very large regions it increases the step. Larger: more memory,
# four bytes each.
MAX_EVALUATIONS = 5e7
# Derived: largest distance from any pose to the nearest candidate, in steps: 0.58 for the shift, 0.5 for the rotation.
SLACK_STEPS = 1.1
# Number of the best poses that are refined with half of the step. Larger: misses fewer maxima, slower.
MAX_CANDIDATES = 300
# Number of halvings of the step. Larger: more exact starts, slower.
HALVINGS = 2
# Number of starts for the refinement. Larger: misses fewer maxima, slower.
MAX_STARTS = 20
# Parts of a step to which positions are rounded. Larger: more exact, more memory.
GRID_PARTS = 4
# Derived: rounding errors of centre, shift and corner together, in parts of a step.
ROUNDING_PARTS = 1.5
# Positions of discs on the line from the centre of a board to its corner, as fractions. With a disc about the centre
# they nearly fill the board.
DISC_POSITIONS = (1.0, 0.5, 0.75)
# Derived: rotation about a cell that maps the lattice onto itself [rad].
LATTICE_PERIOD = np.pi / 3


@dataclass(frozen=True, eq=False)
class CandidatePoses:
    """Poses of a lattice at steps of angle and offset, and the clearances of its boards there."""

    lattice: HexLattice
    depths: "Depths"
    middle: Array  # (2,) centre of rotation of the lattice [m]
    radius: float  # distance from there to the farthest point of the region [m]
    step: float  # [m]
    angles: Array  # (a,) [rad]
    shifts: Array  # (s, 2) from the middle, on the lattice [m]
    clearances: NDArray[np.float32]  # (a, s, n) largest first [m]; -inf below minus the slack

    @property
    def count(self) -> int:
        """Largest number of boards that fit at one of the poses, apart from rounding."""
        return int(np.count_nonzero(self.clearances >= 0, axis=-1).max())

    @property
    def slack(self) -> float:
        """Largest excess of the clearance near a start over that at the start [m]."""
        return _slack(self.step / 2**HALVINGS, self.step)

    def starts(self, count: int) -> Iterator[tuple[Pose, float]]:
        """Yield poses with large clearance for ``count`` boards, and the approximate smallest clearance [m]."""
        angles, shifts, clearance = self.finest(count)
        for _ in range(MAX_STARTS):
            if not len(clearance):
                return
            turned = Pose(self.middle, float(angles[0]))
            yield Pose(turned.to_plane(shifts[0]), turned.angle), float(clearance[0])
            distances = np.column_stack((shifts - shifts[0], self.radius * (angles - angles[0])))
            is_apart = np.abs(distances).max(axis=1) > self.step
            angles, shifts, clearance = angles[is_apart], shifts[is_apart], clearance[is_apart]

    def finest(self, count: int) -> tuple[Array, Array, Array]:
        """Return angles (k,), shifts (k, 2), clearances (k,) of the best poses for ``count`` boards."""
        if count > self.clearances.shape[-1]:
            return np.empty(0), np.empty((0, 2)), np.empty(0)
        clearance, step = np.asarray(self.clearances[..., count - 1], float).ravel(), self.step
        best = _best(clearance, _slack(step, step))
        turn, shift = np.divmod(best, len(self.shifts))
        angles, shifts = self.angles[turn], self.shifts[shift]
        for _ in range(HALVINGS):
            step /= 2
            angles, shifts = self.halved(angles, shifts, step)
            slack = _slack(step, self.step)
            clearance = self.clearance(angles, shifts, count, slack)
            best = _best(clearance, slack)
            angles, shifts = angles[best], shifts[best]
        return angles, shifts, clearance[best]

    def halved(self, angles: Array, shifts: Array, step: float) -> tuple[Array, Array]:
        """Return the poses half a step to both sides of the given ones, in all free directions.

        Parameters
        ----------
        angles : array, shape (k,)
            Angles [rad].
        shifts : array, shape (k, 2)
            Shifts on the lattice [m].
        step : float
            The halved step [m].

        Returns
        -------
        angles, shifts : array
            The new poses.
        """
        free = np.array((len(self.shifts) > 1, len(self.shifts) > 1, len(self.angles) > 1))
        signs = np.unique((np.indices((2, 2, 2)).reshape(3, -1).T - 0.5) * free, axis=0)
        along_rows = signs[:, :2] @ axes(self.lattice) / self.lattice.pitch
        turned = angles[:, None] + step / self.radius * signs[:, 2]
        return turned.ravel(), (shifts[:, None] + step * along_rows).reshape(-1, 2)

    def clearance(self, angles: Array, shifts: Array, count: int, slack: float) -> Array:
        """Return the smallest clearance of the best ``count`` boards at poses, shape (k,) [m]; -inf for misfits.

        Parameters
        ----------
        angles : array, shape (k,)
            Angles [rad].
        shifts : array, shape (k, 2)
            Shifts on the lattice [m].
        count : int
            Number of boards.
        slack : float
            A clearance below minus the slack is a misfit [m].
        """
        centres = self.lattice.centres(cells_within(self.lattice, self.radius))
        clearance = np.full(len(angles), -np.inf)
        for angle in np.unique(angles):
            here = np.flatnonzero(angles == angle)
            clearances = _board_clearances(
                self.depths, self.lattice, Pose(self.middle, float(angle)), shifts[here], centres, slack
            )
            if clearances.shape[1] >= count:
                clearance[here] = np.partition(clearances, -count, axis=1)[:, -count]
        return clearance


def candidate_poses(region: Region, lattice: HexLattice, offset: Array | None, angle: float | None) -> CandidatePoses:
    """Evaluate poses of a lattice in a region, in steps that suit its size.

    Parameters
    ----------
    region : Region
        The flat region.
    lattice : HexLattice
        Lattice of the boards.
    offset : array, shape (2,), or None
        Fixed position of cell (0, 0) [m]; None leaves it free.
    angle : float or None
        Fixed angle of the rows [rad]; None leaves it free.

    Returns
    -------
    CandidatePoses
    """
    middle = region.box.mean(axis=0) if offset is None else offset
    radius = region.radius_about(middle)
    step = _suitable_step(region, lattice, radius, offset is None, angle is None)
    turns = int(np.ceil(LATTICE_PERIOD * radius / step))
    angles = LATTICE_PERIOD * np.arange(turns) / turns if angle is None else np.array((angle,))
    shifts = _lattice_shifts(lattice, int(np.ceil(lattice.pitch / step)) if offset is None else 1)
    centres = lattice.centres(cells_within(lattice, radius))
    margin = lattice.side + 2 * np.linalg.norm(shifts, axis=1).max() + 2 * step
    depths = _depth_grid(region, float(margin), step)
    slack = _slack(step, step)
    found = [_board_clearances(depths, lattice, Pose(middle, float(a)), shifts, centres, slack) for a in angles]
    clearances = np.full((len(angles), len(shifts), max(1, *(r.shape[1] for r in found))), -np.inf, np.float32)
    for table, part in zip(clearances, found):
        table[:, : part.shape[1]] = part
    clearances.sort(axis=2)
    return CandidatePoses(lattice, depths, middle, radius, step, angles, shifts, clearances[..., ::-1])


def _suitable_step(region: Region, lattice: HexLattice, radius: float, shifts: bool, turns: bool) -> float:
    """Return the step [m] for the limit of evaluations, where the lattice can shift and rotate."""
    cell = np.sqrt(0.75) * lattice.pitch**2
    boards = np.prod(np.ptp(region.box, axis=0)) / cell
    work = boards * (cell if shifts else 1.0) * (LATTICE_PERIOD * radius if turns else 1.0)
    step = (work / MAX_EVALUATIONS) ** (1 / (2 * shifts + turns))
    return float(max(step, STEP_IN_PITCHES * lattice.pitch))


def _slack(step: float, first: float) -> float:
    """Return the clearance that boards may lack at a candidate less than a step away from a valid pose [m]."""
    return SLACK_STEPS * step + ROUNDING_PARTS * first / GRID_PARTS


def axes(lattice: HexLattice) -> Array:
    """Return the vectors from a cell to the next in q and in r, shape (2, 2) [m]."""
    return lattice.centres(np.eye(2, dtype=np.int64))


def _lattice_shifts(lattice: HexLattice, parts: int) -> Array:
    """Return all different shifts by ``parts`` of the pitch, each as short as possible, shape (parts**2, 2) [m]."""
    fraction = np.stack(np.meshgrid(np.arange(parts), np.arange(parts)), axis=-1).reshape(-1, 1, 2) / parts
    same = (fraction - np.rint(fraction) + np.array(((0, 0), *PORTS))) @ axes(lattice)
    return same[np.arange(len(same)), np.linalg.norm(same, axis=2).argmin(axis=1)]


def cells_within(lattice: HexLattice, radius: float) -> IntArray:
    """Return the cells, shape (n, 2), with centres within a radius of the centre of (0, 0), by r, then q.

    Parameters
    ----------
    lattice : HexLattice
        Lattice of the boards.
    radius : float
        Radius [m].
    """
    most = int(radius / (np.sqrt(0.75) * lattice.pitch)) + 1
    r, q = (a.ravel() - most for a in np.indices((2 * most + 1, 2 * most + 1)))
    cells = np.column_stack((q, r))
    return cells[np.linalg.norm(lattice.centres(cells), axis=1) <= radius]


def _best(clearance: Array, slack: float) -> IntArray:
    """Return the rows of the poses with the largest clearance, best first, without those below minus the slack."""
    rows = np.flatnonzero(clearance >= -slack)
    return rows[np.argsort(-clearance[rows], kind="stable")[:MAX_CANDIDATES]]


@dataclass(frozen=True, eq=False)
class Depths:
    """Depths of the nodes of a grid inside a region, row after row along x; negative outside."""

    values: NDArray[np.float32]  # (rows * columns,) [m]
    columns: int
    low: Array  # (2,) position of the first node [m]
    spacing: float  # [m]

    @property
    def size(self) -> Array:
        """Vector from the first to the last node, shape (2,) [m]."""
        return self.spacing * (np.array((self.columns, len(self.values) // self.columns)) - 1)

    def index(self, vectors: Array) -> IntArray:
        """Return rounded differences of node numbers for ``vectors`` (..., 2); from ``low`` they are numbers."""
        nodes = np.rint(vectors / self.spacing).astype(np.int64)
        return nodes[..., 1] * self.columns + nodes[..., 0]


def _depth_grid(region: Region, margin: float, step: float) -> Depths:
    """Return depths up to ``margin`` around a region: exact at every step, interpolated between."""
    low = region.box[0] - margin
    columns, rows = (np.ceil((region.box[1] + margin - low) / step) + 1).astype(int)
    nodes = low + step * np.stack(np.meshgrid(np.arange(columns), np.arange(rows)), axis=-1).reshape(-1, 2)
    distances = cKDTree(_border_points(region, step / 2)).query(nodes)[0]
    depths = np.where(region.contains(nodes), distances, -distances).astype(np.float32).reshape(rows, columns)
    depths = _finer(_finer(depths).T).T
    return Depths(depths.ravel(), depths.shape[1], low, step / GRID_PARTS)


def _border_points(region: Region, step: float) -> Array:
    """Return points on the border of a region with distances of at most a step, shape (n, 2) [m]."""
    start, along = region.edges[:, 0], region.edges[:, 1] - region.edges[:, 0]
    counts = np.ceil(np.linalg.norm(along, axis=1) / step).astype(int)
    edge = np.repeat(np.arange(len(along)), counts)
    fraction = (np.arange(len(edge)) - np.repeat(np.cumsum(counts) - counts, counts) + 0.5) / counts[edge]
    return np.concatenate((region.points, start[edge] + fraction[:, None] * along[edge]))


def _finer(rows: NDArray[np.float32]) -> NDArray[np.float32]:
    """Interpolate rows: ``GRID_PARTS`` parts per step."""
    between = [rows[:-1] + np.float32(i / GRID_PARTS) * (rows[1:] - rows[:-1]) for i in range(GRID_PARTS)]
    return np.concatenate((np.stack(between, axis=1).reshape(-1, rows.shape[1]), rows[-1:]))


def _board_clearances(
    depths: Depths, lattice: HexLattice, pose: Pose, shifts: Array, centres: Array, slack: float
) -> NDArray[np.float32]:
    """Return clearances of the boards with ``centres`` (n, 2) at all ``shifts`` (s, 2), shape (s, m) [m].

    Only the m boards that may fit remain; -inf is a clearance below minus the slack. Discs that touch the sides of a
    board from inside stand for it. Its clearance is the smallest of theirs.
    """
    corners, apothem = pose.turn(lattice.corners), np.sqrt(0.75) * lattice.side
    points = pose.to_plane(centres) - depths.low
    points = points[((points >= 0) & (points <= depths.size)).all(axis=1)]
    far = np.linalg.norm(shifts, axis=1).max()
    points = points[depths.values[depths.index(points)] >= apothem - slack - far]
    nodes = (depths.index(pose.turn(shifts))[:, None] + depths.index(points)).ravel()
    clearances, left = depths.values[nodes] - np.float32(apothem), np.arange(len(nodes))
    for fraction in DISC_POSITIONS:
        may_fit = clearances >= -slack
        left, nodes, clearances = left[may_fit], nodes[may_fit], clearances[may_fit]
        for offset in depths.index(fraction * corners):
            np.minimum(clearances, depths.values[nodes + offset] - np.float32((1 - fraction) * apothem), out=clearances)
    table = np.full(len(shifts) * len(points), -np.inf, np.float32)
    table[left] = np.where(clearances >= -slack, clearances, -np.inf)
    return table.reshape(len(shifts), len(points))
