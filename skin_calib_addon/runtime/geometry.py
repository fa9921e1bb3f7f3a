"""What is the same in every cycle: the taxels of a link, laid out for sums over the active ones."""

from typing import TYPE_CHECKING, Any

import numpy as np

from ..common.arrays import Array, BoolArray, IntArray
from .balance.hull import HullTable
from .balance.polygon import convex_hull
from .plane import DOWNWARD, Plane

if TYPE_CHECKING:
    from ..calibration.model import LinkCalibration

# A component of the wrench that presses can make only this small, beside the largest of its kind, is not observed.
OBSERVED = 5e-3


class SkinGeometry:
    """Taxels of all patches of one link; row i of every array is the same taxel. Link frame and SI units.

    Attributes
    ----------
    ids : tuple of str
    channels, patch : array, shape (n,)
        Place in a reading; number of the patch.
    index : array, shape (n, 2)
        Row and column in the patch; ``periods`` has, for each patch, after how many these begin again, or 0.
    positions, normals : array, shape (n, 3)
        [m]; unit, out of the robot.
    corners : array, shape (n, k, 3)
        Of the cells [m].
    areas : array, shape (n,)
        [m^2]
    pairs : array, shape (e, 2)
        Rows of neighbours; ``beside`` (k, n) has them as a table, see :func:`beside_of`.
    wrenches : array, shape (n, 6)
        Wrench about the link's origin of 1 N on each taxel [N, N m].
    sums : array, shape (11, n)
        What contacts sum, weighted by forces: 1, position, height of the tangent plane over the origin, wrench.
    """

    def __init__(self, calibration: "LinkCalibration"):
        taxels = [patch.taxels for patch in calibration.patches]
        self.ids: tuple[str, ...] = sum((t.ids for t in taxels), ())
        self.channels = np.concatenate([np.empty(0, np.int64), *(t.channels for t in taxels)])
        self.positions = np.concatenate([np.empty((0, 3)), *(t.positions_link for t in taxels)])
        self.normals = np.concatenate([np.empty((0, 3)), *(t.normals_link for t in taxels)])
        self.areas = np.concatenate([np.empty(0), *(t.areas for t in taxels)])
        self.corners = _padded([t.corners_link for t in taxels])
        self.patch = np.repeat(np.arange(len(taxels)), [len(t.ids) for t in taxels])
        self.index = np.concatenate([np.empty((0, 2), np.int64), *(t.index for t in taxels)])
        row = {name: i for i, name in enumerate(self.ids)}
        beside = sum((t.neighbours for t in taxels), ())
        pairs = {(i, row[other]) for i, others in enumerate(beside) for other in others if i < row[other]}
        self.pairs = np.array(sorted(pairs), np.int64).reshape(-1, 2)
        self.beside = beside_of(self.pairs, len(self.ids))
        self.periods = [self._period(k) for k in range(len(taxels))]
        pushes = -self.normals
        self.wrenches = np.hstack((pushes, np.cross(self.positions, pushes)))
        heights = (self.normals * self.positions).sum(axis=1, keepdims=True)
        ones = np.ones((len(self.ids), 1))
        self.sums = np.hstack((ones, self.positions, heights, self.wrenches)).T.copy()
        self.place = np.full(len(self.ids) + 1, -1)  # for :func:`.components.components`

    def _period(self, patch: int) -> tuple[int, int]:
        """Rows and columns after which a patch closes on itself, 0 where it does not: its ends are neighbours."""
        ours = self.pairs[(self.patch[self.pairs] == patch).all(axis=1)]
        step = np.abs(np.diff(self.index[ours], axis=1)[:, 0]).max(axis=0, initial=0)
        rows, columns = (int(s) + 1 if s > 1 else 0 for s in step)
        return rows, columns


def _padded(groups: list[Array]) -> Array:
    """Corners (n, k, 3) of all cells, the last corner repeated where a cell has fewer than the others."""
    most = max((g.shape[1] for g in groups), default=1)
    filled = [np.concatenate((g, np.repeat(g[:, -1:], most - g.shape[1], axis=1)), axis=1) for g in groups]
    return np.concatenate([np.empty((0, most, 3)), *filled])


def beside_of(pairs: IntArray, n: int) -> IntArray:
    """Neighbours of each of n taxels as columns (k, n), from pairs (e, 2); n stands for no neighbour."""
    ends = np.concatenate((pairs, pairs[:, ::-1]))
    ends = ends[np.argsort(ends[:, 0], kind="stable")]
    counts = np.bincount(ends[:, 0], minlength=n)
    table = np.full((int(counts.max(initial=0)), n), n)
    table[np.arange(len(ends)) - np.repeat(np.cumsum(counts) - counts, counts), ends[:, 0]] = ends[:, 1]
    return table


def observable(wrenches: Array) -> BoolArray:
    """Which components of the wrench (6,) bool the taxels can feel at all; the others read 0 whatever happens.

    A flat sole feels 3 of the 6 (thesis 4.23 claims all): forces along it and the moment about its normal are not
    measured, for taxels feel what presses, not what shears.
    """
    size = np.abs(wrenches).max(axis=0, initial=0.0)
    force, moment = size[:3].max(), size[3:].max()
    return size > OBSERVED * np.repeat((force, moment), 3)


def wrench_rank(wrenches: Array) -> int:
    """How many independent wrenches presses can make: 3 for a flat sole, 4 for a cylinder, 6 at most.

    Moments are divided by the longest lever arm, so that the answer does not depend on the unit of length.
    """
    arm = np.abs(wrenches[:, 3:]).max(initial=0.0) or 1.0
    strengths = np.linalg.svd(wrenches / np.repeat((1.0, arm), 3), compute_uv=False)
    return int((strengths > OBSERVED * strengths.max(initial=0.0)).sum())


class GroundGeometry:
    """The taxels that can stand on the ground, in the ground's own coordinates.

    Attributes
    ----------
    plane : Plane
        In the link frame.
    under : array of bool, shape (n,)
        Which taxels look down enough to stand; ``standing`` is how many.
    centres, corners : array, shape (n, 2) and (n, k, 2)
        Of all cells [m]; ``centre_hull`` and ``corner_hull`` give hulls of some of them.
    cell : array, shape (j, 2)
        One outline about the centre that holds every cell that can stand [m].
    sums : array, shape (n, 6)
        To be weighted by forces: lift, lift x, lift y of the taxels that can stand; f_z, tau_x, tau_y of all.
    stretch : tuple or None
        What corrects a CoP at full contact, see :func:`_in_cell`.
    """

    def __init__(self, skin: SkinGeometry, plane: Plane):
        self.plane = plane
        looks_down = -(skin.normals @ plane.axes[2])  # the part of a press that lifts the robot
        self.under = looks_down >= DOWNWARD
        self.standing = int(self.under.sum())
        self.centres = plane.flat(skin.positions)
        self.corners = plane.flat(skin.corners)
        lift = np.where(self.under, looks_down, 0.0)[:, None]
        pushes, arms = -skin.normals @ plane.axes.T, (skin.positions - plane.origin) @ plane.axes.T
        moments = np.cross(arms, pushes)
        self.sums = np.hstack((lift, lift * self.centres, pushes[:, 2:], moments[:, :2]))
        self.centre_hull, self.corner_hull = HullTable(self.centres), HullTable(self.corners)
        offsets = (self.corners - self.centres[:, None])[self.under].reshape(-1, 2)
        self.cell = convex_hull(offsets).corners
        self.supporting: tuple[Any, Any] = None, None  # for :attr:`.Footprint.polygon`: the last hulls and polygons
        self.stretch = _in_cell(self.centres[self.under], self.corners[self.under], skin.areas[self.under])


def _in_cell(centres: Array, corners: Array, areas: Array) -> tuple[Array, Array] | None:
    """The centre c of the skin (2,) and the matrix (2, 2) that corrects a CoP p at full contact to c + M (p - c).

    A taxel's force is taken to act at its centre, which puts the CoP too near the middle: under a pressure that
    changes linearly the moments within the cells are missing. M = 1 + R S^-1 with the mean second moments R of a cell
    about its centre and S of the centres about theirs (1.012 and 1.047 on the sole of 42 hexagons).
    """
    if len(centres) < 3:
        return None
    middle = areas @ centres / areas.sum()
    off = centres - middle
    spread = (areas[:, None] * off).T @ off / areas.sum()
    if np.linalg.cond(spread) > 1e6:  # one row of taxels
        return None
    a = corners - centres[:, None]
    b = np.roll(a, -1, axis=1)
    twice = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    outer = (a[..., :, None] * a[..., None, :] + b[..., :, None] * b[..., None, :]) * 2
    outer += a[..., :, None] * b[..., None, :] + b[..., :, None] * a[..., None, :]
    inside = (twice[..., None, None] * outer).sum(axis=(0, 1)) / (12 * twice.sum())
    return middle, np.eye(2) + inside @ np.linalg.inv(spread)
