"""Fill a flat region with as many rigid boards as fit: where their lattice lies best."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from ...common.arrays import Array, IntArray, freeze
from ...common.errors import InvalidPlan
from ..lattice import HexLattice
from .candidate_poses import LATTICE_PERIOD, CandidatePoses, axes, candidate_poses, cells_within
from .pose_refinement import Pose, PoseRefinement
from .region import Region

# Room below zero at which two outlines still touch and do not cross [m]: a nanometre is far less than boards are cut
# to, and far more than rounding makes of boards that fill a region to its edges.
TOUCH_TOLERANCE = 1e-9
# The longest move while boards settle, in steps of the survey, and in pitches while they share their play, which is
# less than a pitch or one more would fit.
MAX_MOVE_STEPS, MAX_PLAY_MOVE = 0.5, 1 / 8
# Rooms [m] and turns [rad] that differ by less are the same to an author.
EQUAL_TOLERANCE = 1e-6
# Cells in a circle over the region, beyond which its lengths are hardly metres, and a search would take minutes.
MAX_CELLS = 5000


@dataclass(frozen=True, eq=False)
class LatticePlacement:
    """A lattice in the plane of a region, and those of its cells that lie wholly inside."""

    lattice: HexLattice
    offset: Array  # (2,) centre of cell (0, 0) [m]
    angle: float  # from x to the rows [rad]
    cells: IntArray  # (n, 2) axial, by r, then q

    def __post_init__(self):
        freeze(self, offset=(2,), cells=(None, 2))

    @property
    def centres(self) -> Array:
        """Centres of the boards, shape (n, 2) [m]."""
        return Pose(self.offset, self.angle).to_plane(self.lattice.centres(self.cells))

    @property
    def corners(self) -> Array:
        """Corners of the boards, counter-clockwise, shape (n, 6, 2) [m]."""
        return self.centres[:, None] + Pose(self.offset, self.angle).turn(self.lattice.corners)


def fill(
    region: Region, lattice: HexLattice, offset: ArrayLike | None = None, angle: float | None = None
) -> LatticePlacement:
    """Place the most boards of a lattice that lie wholly inside a region; they may touch its border.

    Of placements with as many boards, the one where the tightest board has the most room is taken, then the one with
    the least turn, then the least offset. Boards that can still move lie in the middle of their play.

    Parameters
    ----------
    region : Region
    lattice : HexLattice
    offset : array, shape (2,), or None
        Where the centre of cell (0, 0) is to lie [m]. None leaves it free; then cell (0, 0) is the board nearest to the
        centroid of the region.
    angle : float or None
        The angle from x to the rows [rad]. None leaves it free; it is then within 30 degrees of zero.

    Raises
    ------
    InvalidPlan
        If no board fits, the region is too large for the boards, or a number is not finite.
    """
    given = np.append(np.zeros(2) if offset is None else offset, angle or 0.0).astype(float)
    if given.shape != (3,) or not np.isfinite(given).all():
        raise InvalidPlan(f"no lattice has offset {offset!r} and angle {angle}; give x and y [m], and radians")
    pose = Pose(given[:2], float(given[2]))
    _check_size(region, lattice, region.box.mean(axis=0) if offset is None else pose.offset)
    if offset is None or angle is None:
        pose = Search.of(region, lattice, None if offset is None else pose.offset, angle).best()
    cells = _cells_inside(region, lattice, pose)
    if not len(cells):
        raise _nothing_fits(region, lattice)
    if offset is None:
        distances = np.linalg.norm(pose.to_plane(lattice.centres(cells)) - region.centroid, axis=1)
        root = cells[(distances < distances.min() + EQUAL_TOLERANCE).argmax()]  # the first of those that are as near
        pose, cells = Pose(pose.to_plane(lattice.centres(root[None]))[0], pose.angle), cells - root
    return LatticePlacement(lattice, pose.offset, pose.angle, cells)


def _check_size(region: Region, lattice: HexLattice, middle: Array) -> None:
    """Raise InvalidPlan if the region and the boards cannot both be in metres, or the offset lies far off."""
    radius = region.radius_about(middle)
    if np.pi * radius**2 > MAX_CELLS * abs(np.linalg.det(axes(lattice))):
        raise InvalidPlan(
            f"the region reaches {radius:.3g} m from the middle of the lattice, too far for boards with a pitch of "
            f"{lattice.pitch * 1e3:g} mm; give the region in metres, and an offset in it"
        )


def _nothing_fits(region: Region, lattice: HexLattice) -> InvalidPlan:
    """The error for a region without a board."""
    width, height = np.ptp(region.box, axis=0) * 1e3
    return InvalidPlan(
        f"no board with sides of {lattice.side * 1e3:g} mm lies wholly in the region, which is {width:.1f} x "
        f"{height:.1f} mm over all; widen it, take smaller boards, or leave offset and angle free"
    )


def _cells_inside(region: Region, lattice: HexLattice, pose: Pose) -> IntArray:
    """Axial coordinates of the boards that lie wholly inside, by r, then q, shape (n, 2)."""
    middle, apothem = region.box.mean(axis=0), np.sqrt(0.75) * lattice.side
    root = np.rint(np.linalg.solve(pose.turn(axes(lattice)).T, middle - pose.offset)).astype(np.int64)
    cells = root + cells_within(lattice, region.radius_about(middle) + lattice.pitch)
    centres = pose.to_plane(lattice.centres(cells))
    low, high = region.box + (apothem - TOUCH_TOLERANCE) * np.array(((1,), (-1,)))
    may_fit = ((centres >= low) & (centres <= high)).all(axis=1)
    return cells[may_fit][region.clearances(centres[may_fit], pose.turn(lattice.corners)) >= -TOUCH_TOLERANCE]


@dataclass(frozen=True, eq=False)
class Search:
    """From the best poses of a survey on, for the one in which most boards fit."""

    candidates: CandidatePoses
    refinement: PoseRefinement
    centres: Array  # (n, 2) of the boards to choose from, on the lattice [m]

    @classmethod
    def of(cls, region: Region, lattice: HexLattice, offset: Array | None, angle: float | None) -> "Search":
        """A search that keeps what is given: an offset (2,) [m], an angle [rad]."""
        candidates = candidate_poses(region, lattice, offset, angle)
        is_free = (offset is None, offset is None, angle is None)
        refinement = PoseRefinement(region, lattice, MAX_MOVE_STEPS * candidates.step, is_free)
        return cls(candidates, refinement, lattice.centres(cells_within(lattice, candidates.radius)))

    def best(self) -> Pose:
        """The pose in which most boards fit, and have the most room.

        Raises
        ------
        InvalidPlan
            If not one fits.
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
        play_refinement = replace(self.refinement, step=MAX_PLAY_MOVE * self.refinement.lattice.pitch)
        centred, clearance = play_refinement.refine(pose, self.centres, count, balance=True)
        return centred if clearance > max(largest - EQUAL_TOLERANCE, -TOUCH_TOLERANCE) else pose

    def fits(self, count: int) -> bool:
        """Whether so many boards fit."""
        return any(True for _ in self.refined_poses(count))

    def refined_poses(self, count: int) -> Iterator[tuple[Pose, float]]:
        """Poses in which so many boards fit, and the room of the tightest [m]: as much as in those before, or more."""
        floor = -TOUCH_TOLERANCE
        for start, clearance in self.candidates.starts(count):
            if clearance < floor - self.candidates.slack:
                return
            pose, clearance = self.refinement.refine(start, self.centres, count, floor)
            if clearance >= max(-TOUCH_TOLERANCE, floor - EQUAL_TOLERANCE):
                floor = max(floor, clearance)
                yield _with_least_rotation(pose) if self.refinement.is_free[2] else pose, clearance


def _with_least_rotation(pose: Pose) -> Pose:
    """The same lattice, turned by as little as can be: more than -30 degrees, and not more than 30."""
    return Pose(
        pose.offset, float(pose.angle - LATTICE_PERIOD * np.ceil(pose.angle / LATTICE_PERIOD - 0.5 - EQUAL_TOLERANCE))
    )


def _preference(pose: Pose) -> tuple[float, ...]:
    """What decides between poses that are as good as each other."""
    return tuple(np.round((abs(pose.angle), *pose.offset), 6).tolist())
