"""Fill a flat region with as many rigid boards as fit: where their lattice lies best."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, IntArray, freeze
from ..errors import InvalidPlan
from .lattice import HexLattice
from .region import Region
from .settle import Pose, Settling
from .survey import SIXTH, Survey, cells_within, survey

# Room below zero at which two outlines still touch and do not cross [m]: a nanometre is far less than boards are cut to,
# and far more than rounding makes of boards that fill a region to its edges.
TOUCH = 1e-9
# The longest move while boards settle, in steps of the survey.
MOVE = 1.5
# Rooms [m] and turns [rad] that differ by less are the same to an author.
SAME = 1e-6


@dataclass(frozen=True, eq=False)
class Placement:
    """A lattice in the plane of a region, and those of its cells that lie wholly inside."""

    lattice: HexLattice
    offset: Array  # (2,) centre of cell (0, 0) [m]
    angle: float  # from x to the rows [rad]
    cells: IntArray  # (n, 2) axial, in the order of r, then q

    def __post_init__(self):
        freeze(self, offset=(2,), cells=(None, 2))

    @property
    def centres(self) -> Array:
        """Centres of the boards, shape (n, 2) [m]."""
        return Pose(self.offset, self.angle).place(self.lattice.centres(self.cells))

    @property
    def corners(self) -> Array:
        """Corners of the boards, counter-clockwise, shape (n, 6, 2) [m]."""
        return self.centres[:, None] + Pose(self.offset, self.angle).turn(self.lattice.corners)


def fill(region: Region, lattice: HexLattice, offset: ArrayLike | None = None, angle: float | None = None) -> Placement:
    """Place the most boards of a lattice that lie wholly inside a region; they may touch its border.

    Of placements with as many boards, the one where the tightest board has the most room is taken, then the one with
    the least turn, then the least offset. Where the boards can still move, they lie in the middle of their play.

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
        If no board fits, or the offset or angle is none.
    """
    given = np.append(np.zeros(2) if offset is None else offset, angle or 0.0).astype(float)
    if given.shape != (3,) or not np.isfinite(given).all():
        raise InvalidPlan(f"no lattice has offset {offset} and angle {angle}; give x and y [m], and radians")
    pose: Pose | None = Pose(given[:2], float(given[2]))
    if offset is None or angle is None:
        pose = Search.of(region, lattice, None if offset is None else given[:2], angle).best()
    cells = None if pose is None else cells_inside(region, lattice, pose)
    if pose is None or cells is None or not len(cells):
        width, height = np.ptp(region.box, axis=0) * 1e3
        raise InvalidPlan(
            f"no board with sides of {lattice.side * 1e3:g} mm fits in the region, which is {width:.1f} x {height:.1f} mm "
            "over all; take smaller boards, widen it, or leave offset and angle free"
        )
    if offset is None:
        away = np.linalg.norm(pose.place(lattice.centres(cells)) - region.centroid, axis=1)
        root = cells[(away < away.min() + SAME).argmax()]  # the first of those that are as near
        pose, cells = Pose(pose.place(lattice.centres(root[None]))[0], pose.angle), cells - root
    return Placement(lattice, pose.offset, pose.angle, cells)


def cells_inside(region: Region, lattice: HexLattice, pose: Pose) -> IntArray:
    """Axial coordinates of the boards that lie wholly inside, by r, then q, shape (n, 2)."""
    middle, apothem = region.box.mean(axis=0), np.sqrt(0.75) * lattice.side
    steps = pose.turn(lattice.centres(np.eye(2, dtype=np.int64)))
    root = np.rint(np.linalg.solve(steps.T, middle - pose.offset)).astype(np.int64)
    cells = root + cells_within(lattice, region.reach(middle) + lattice.pitch)
    centres = pose.place(lattice.centres(cells))
    low, high = region.box + np.array(((apothem - TOUCH,), (TOUCH - apothem,)))
    may_fit = ((centres >= low) & (centres <= high)).all(axis=1)
    return cells[may_fit][region.rooms(centres[may_fit], pose.turn(lattice.corners)) >= -TOUCH]


@dataclass(frozen=True, eq=False)
class Search:
    """For the pose in which most boards fit, from the best poses of a survey on."""

    view: Survey
    settling: Settling
    centres: Array  # (n, 2) of the boards to choose from, on the lattice [m]

    @classmethod
    def of(cls, region: Region, lattice: HexLattice, offset: Array | None, angle: float | None) -> "Search":
        """A search that keeps what is given: an offset (2,) [m], an angle [rad]."""
        view = survey(region, lattice, offset, angle)
        is_free = (offset is None, offset is None, angle is None)
        centres = lattice.centres(cells_within(lattice, region.reach(view.middle)))
        return cls(view, Settling(region, lattice, MOVE * view.step, is_free), centres)

    def best(self) -> Pose | None:
        """Where most boards fit, with the most room at the tightest; None where not one fits."""
        count = max(self.view.count, 1)
        while count and not self.fits(count):
            count -= 1
        while count and self.fits(count + 1):
            count += 1
        if not count:
            return None
        found = list(self.placed(count))
        most = max(room for _, room in found)
        pose = min((pose for pose, room in found if room > most - SAME), key=turn_and_offset)
        return self.settling.settle(pose, self.centres, count, even=True)[0]

    def fits(self, count: int) -> bool:
        """Whether so many boards fit anywhere."""
        return any(True for _ in self.placed(count))

    def placed(self, count: int) -> Iterator[tuple[Pose, float]]:
        """Poses where so many boards fit, and the room of the tightest [m]: each as good as those before, or better."""
        floor = -TOUCH
        for start, room, slack in self.view.starts(count):
            if room < floor - slack:
                return
            pose, room = self.settling.settle(start, self.centres, count, floor)
            if room >= max(-TOUCH, floor - SAME):
                floor = max(floor, room)
                yield straight(pose) if self.settling.is_free[2] else pose, room


def straight(pose: Pose) -> Pose:
    """The same lattice, turned by as little as can be: more than -30 degrees, and not more than 30."""
    return Pose(pose.offset, float(pose.angle - SIXTH * np.ceil(pose.angle / SIXTH - 0.5 - SAME)))


def turn_and_offset(pose: Pose) -> tuple[float, ...]:
    """What decides between poses that are as good as each other."""
    return tuple(np.round((abs(pose.angle), *pose.offset), 6).tolist())
