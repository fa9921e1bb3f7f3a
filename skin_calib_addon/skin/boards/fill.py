"""Placement of the largest number of rigid boards in a flat region."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from ...common.arrays import Array, IntArray, freeze
from ...common.errors import InvalidPlan
from ..lattice import HexLattice
from .candidate_poses import LATTICE_PERIOD, STEP_IN_PITCHES, CandidatePoses, axes, candidate_poses, cells_within
from .pose_refinement import TOUCH_TOLERANCE, Pose, PoseRefinement
from .region import Region

# Limit of a move during the refinement, in steps of the candidate poses. Larger: may leave the local maximum.
MAX_MOVE_STEPS = 0.5
# Clearances and distances [m] and rotations [rad] that differ by less are equal for an author. Larger: other choices
# among nearly equal poses.
EQUAL_TOLERANCE = 1e-6
# Limit of the cells of the lattice over the region. More of them mean wrong units; the search would take minutes.
MAX_CELLS = 5000


@dataclass(frozen=True, eq=False)
class LatticePlacement:
    """A lattice in the plane of a region, and its cells that are completely inside."""

    lattice: HexLattice
    offset: Array  # (2,) position of the centre of cell (0, 0) [m]
    angle: float  # from x to the rows [rad]
    cells: IntArray  # (n, 2) axial, by r, then q

    def __post_init__(self):
        freeze(self, offset=(2,), cells=(None, 2))

    @property
    def centres(self) -> Array:
        """Centres of the boards in the plane, shape (n, 2) [m]."""
        return Pose(self.offset, self.angle).to_plane(self.lattice.centres(self.cells))

    @property
    def corners(self) -> Array:
        """Corners of the boards in the plane, counter-clockwise, shape (n, 6, 2) [m]."""
        return self.centres[:, None] + Pose(self.offset, self.angle).turn(self.lattice.corners)


def fill(
    region: Region, lattice: HexLattice, offset: ArrayLike | None = None, angle: float | None = None
) -> LatticePlacement:
    """Place the largest number of boards of a lattice completely inside a region; they may touch its border.

    Among placements with equal numbers of boards, the one with the largest of the smallest clearances is taken. Then
    the smallest rotation and the smallest offset decide. Boards that can still move are in the middle of their play.

    Parameters
    ----------
    region : Region
        The flat region.
    lattice : HexLattice
        Lattice of the boards.
    offset : array, shape (2,), or None
        Position of the centre of cell (0, 0) [m]. None leaves it free. Then cell (0, 0) is the board nearest to the
        centroid of the region.
    angle : float or None
        Angle from x to the rows [rad]. None leaves it free. Then it is within 30 degrees of zero.

    Returns
    -------
    LatticePlacement

    Raises
    ------
    InvalidPlan
        If no board fits, the region is too large for the boards, or a number is not finite.
    """
    given = np.append(np.zeros(2) if offset is None else offset, angle or 0.0).astype(float)
    if given.shape != (3,) or not np.isfinite(given).all():
        raise InvalidPlan(f"invalid offset {offset!r} or angle {angle} of a lattice; give x and y [m], and radians")
    pose = Pose(given[:2], float(given[2]))
    _check_size(region, lattice, region.box.mean(axis=0) if offset is None else pose.offset)
    if offset is None or angle is None:
        pose = Search.of(region, lattice, None if offset is None else pose.offset, angle).best()
    cells = _cells_inside(region, lattice, pose)
    if not len(cells):
        raise _nothing_fits(region, lattice)
    if offset is None:
        distances = np.linalg.norm(pose.to_plane(lattice.centres(cells)) - region.centroid, axis=1)
        root = cells[(distances < distances.min() + EQUAL_TOLERANCE).argmax()]  # the first of the nearest ones
        pose, cells = Pose(pose.to_plane(lattice.centres(root[None]))[0], pose.angle), cells - root
    return LatticePlacement(lattice, pose.offset, pose.angle, cells)


def _check_size(region: Region, lattice: HexLattice, middle: Array) -> None:
    """Raise InvalidPlan if the units of region and boards do not match, or the offset is far outside."""
    radius = region.radius_about(middle)
    if np.pi * radius**2 > MAX_CELLS * abs(np.linalg.det(axes(lattice))):
        raise InvalidPlan(
            f"the region extends {radius:.3g} m from the middle of the lattice, too far for boards with a pitch of "
            f"{lattice.pitch * 1e3:g} mm; give the region in metres, and an offset in it"
        )


def _nothing_fits(region: Region, lattice: HexLattice) -> InvalidPlan:
    """Return the error for a region in which no board fits."""
    width, height = np.ptp(region.box, axis=0) * 1e3
    return InvalidPlan(
        f"no board with sides of {lattice.side * 1e3:g} mm fits completely in the region, which is {width:.1f} x "
        f"{height:.1f} mm over all; extend it, use smaller boards, or leave offset and angle free"
    )


def _cells_inside(region: Region, lattice: HexLattice, pose: Pose) -> IntArray:
    """Return the axial coordinates of the boards that are completely inside, by r, then q, shape (n, 2)."""
    middle, apothem = region.box.mean(axis=0), np.sqrt(0.75) * lattice.side
    root = np.rint(np.linalg.solve(pose.turn(axes(lattice)).T, middle - pose.offset)).astype(np.int64)
    cells = root + cells_within(lattice, region.radius_about(middle) + lattice.pitch)
    centres = pose.to_plane(lattice.centres(cells))
    low, high = region.box + (apothem - TOUCH_TOLERANCE) * np.array(((1,), (-1,)))
    may_fit = ((centres >= low) & (centres <= high)).all(axis=1)
    return cells[may_fit][region.clearances(centres[may_fit], pose.turn(lattice.corners)) >= -TOUCH_TOLERANCE]


@dataclass(frozen=True, eq=False)
class Search:
    """Search for the pose with the largest number of boards, from candidate poses."""

    candidates: CandidatePoses
    refinement: PoseRefinement
    centres: Array  # (n, 2) centres of the boards to choose from, on the lattice [m]

    @classmethod
    def of(cls, region: Region, lattice: HexLattice, offset: Array | None, angle: float | None) -> "Search":
        """Prepare a search.

        Parameters
        ----------
        region : Region
            The flat region.
        lattice : HexLattice
            Lattice of the boards.
        offset : array, shape (2,), or None
            Fixed position of cell (0, 0) [m].
        angle : float or None
            Fixed angle of the rows [rad].
        """
        candidates = candidate_poses(region, lattice, offset, angle)
        is_free = (offset is None, offset is None, angle is None)
        refinement = PoseRefinement(region, lattice, MAX_MOVE_STEPS * candidates.step, is_free)
        return cls(candidates, refinement, lattice.centres(cells_within(lattice, candidates.radius)))

    def best(self) -> Pose:
        """Return the pose with the largest number of boards and the largest clearance.

        Raises
        ------
        InvalidPlan
            If no board fits.
        """
        count = max(self.candidates.count, 1)
        while count and not self.fits(count):
            count -= 1
        if not count:
            raise _nothing_fits(self.refinement.region, self.refinement.lattice)
        while self.fits(count + 1):
            count += 1
        found = list(self.refined_poses(count))
        largest = max(clearance for _, clearance in found)
        pose = min((pose for pose, clearance in found if clearance > largest - EQUAL_TOLERANCE), key=_preference)
        play_refinement = replace(self.refinement, step=STEP_IN_PITCHES * self.refinement.lattice.pitch)
        centred, clearance = play_refinement.refine(pose, self.centres, count, balance=True)
        return centred if clearance > max(largest - EQUAL_TOLERANCE, -TOUCH_TOLERANCE) else pose

    def fits(self, count: int) -> bool:
        """Return whether this number of boards fits."""
        return any(True for _ in self.refined_poses(count))

    def refined_poses(self, count: int) -> Iterator[tuple[Pose, float]]:
        """Yield poses for this number of boards with their smallest clearance [m]; it does not decrease."""
        floor = -TOUCH_TOLERANCE
        for start, clearance in self.candidates.starts(count):
            if clearance < floor - self.candidates.slack:
                return
            pose, clearance = self.refinement.refine(start, self.centres, count, floor)
            if clearance >= max(-TOUCH_TOLERANCE, floor - EQUAL_TOLERANCE):
                floor = max(floor, clearance)
                yield _with_least_rotation(pose) if self.refinement.is_free[2] else pose, clearance


def _with_least_rotation(pose: Pose) -> Pose:
    """Return the same lattice with an equivalent angle above -30 and up to 30 degrees."""
    return Pose(
        pose.offset, float(pose.angle - LATTICE_PERIOD * np.ceil(pose.angle / LATTICE_PERIOD - 0.5 - EQUAL_TOLERANCE))
    )


def _preference(pose: Pose) -> tuple[float, ...]:
    """Return the sort key of equally good poses: rotation, then offset."""
    return tuple(np.round((abs(pose.angle), *pose.offset), 6).tolist())
