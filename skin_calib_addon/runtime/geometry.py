"""Prepare what is the same in every cycle: arrays of the taxels of a link, for sums over the active ones."""

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ..common.arrays import Array, BoolArray, IntArray, lock, locked
from .hull import HullTable
from .plane import MIN_DOWNWARD, Plane
from .polygon import EMPTY_POLYGON, PolygonTable, convex_hull

if TYPE_CHECKING:
    from ..calibration.model import LinkCalibration, Patch

# Fraction of the largest force (or moment) component from which on a component of the wrench counts as observed.
# Larger: a slightly curved sole counts as flat; smaller: noise of the normals counts as an observed component.
MIN_OBSERVED_FRACTION = 5e-3
# Condition number of the second moments of the taxel positions from which on they count as one row. Larger: a CoP on
# a very narrow skin is corrected across it too.
MAX_MOMENT_CONDITION = 1e6
# Ratio of the smaller to the larger spread of the neighbours of a taxel below which they are in one row, squared.
# Smaller: a pressure gradient across a nearly straight row is estimated too.
MIN_CELL_SPREAD = 1e-3
# [Pa] Largest plausible mean pressure on all cells of a patch, if its calibration states no load. A person stands with
# 30 kPa. Larger: readings in another unit are found under larger loads; smaller: impacts are flagged.
USUAL_MAX_PRESSURE = 2e5
# [N] Load that is plausible on a patch of any size: a strong pinch on a finger. As above.
MIN_MAX_LOAD = 100.0


class SkinGeometry:
    """Taxels of all patches of one link; row i of every array is the same taxel. Link frame and SI units.

    Attributes
    ----------
    positions, normals : array, shape (n, 3)
        Of the taxels [m]; unit, out of the robot.
    areas : array, shape (n,)
        Of the cells [m^2].
    corners : array, shape (n, k, 3)
        Of the cells [m]; a cell with fewer corners repeats its last one.
    wrenches : array, shape (n, 6)
        Of a force of 1 N against the normal of each taxel, about the origin of the link [N, N m].
    """

    def __init__(self, calibration: "LinkCalibration"):
        taxels = [patch.taxels for patch in calibration.patches]
        self.ids: tuple[str, ...] = sum((t.ids for t in taxels), ())
        self.channels = np.concatenate([np.empty(0, np.int64), *(t.channels for t in taxels)])
        self.positions = np.concatenate([np.empty((0, 3)), *(t.positions_link for t in taxels)])
        self.normals = np.concatenate([np.empty((0, 3)), *(t.normals_link for t in taxels)])
        self.areas = np.concatenate([np.empty(0), *(t.areas for t in taxels)])
        self.corners = _padded([t.corners_link for t in taxels])
        self.max_load = sum(_max_load(patch) for patch in calibration.patches)  # largest plausible one [N]
        self.patch = np.repeat(np.arange(len(taxels)), [len(t.ids) for t in taxels])
        self.index = np.concatenate([np.empty((0, 2), np.int64), *(t.index for t in taxels)])
        row = {name: i for i, name in enumerate(self.ids)}
        neighbours = sum((t.neighbours for t in taxels), ())
        pairs = {(i, row[other]) for i, others in enumerate(neighbours) for other in others if i < row[other]}
        self.pairs = np.array(sorted(pairs), np.int64).reshape(-1, 2)
        self.neighbours = neighbour_table(self.pairs, len(self.ids))
        self.neighbour_counts = np.maximum((self.neighbours < len(self.ids)).sum(axis=0), 1)
        self.periods = [self._period(k) for k in range(len(taxels))]
        pushes = -self.normals
        self.wrenches = np.hstack((pushes, np.cross(self.positions, pushes)))
        heights = (self.normals * self.positions).sum(axis=1, keepdims=True)
        ones = np.ones((len(self.ids), 1))
        self.terms = np.hstack((ones, self.positions, heights, self.wrenches)).T.copy()
        self.mean_wrench = self.wrenches.mean(axis=0) if len(self.ids) else np.zeros(6)  # of 1 N on all taxels
        lock(*vars(self).values())
        self.scratch = np.full(len(self.ids) + 1, -1)

    def mean_around(self, values: Array, rows: IntArray) -> Array:
        """Return the mean (k,) of the values of the neighbours of some taxels; 0 without neighbours.

        Parameters
        ----------
        values : array, shape (n,)
            One for each taxel.
        rows : array of int, shape (k,)
            Of the taxels.
        """
        padded = np.zeros(len(values) + 1)
        padded[:-1] = values
        return np.add.reduce(padded[self.neighbours.take(rows, axis=1)], axis=0) / self.neighbour_counts.take(rows)

    def filled(self, values: Array, known: BoolArray) -> Array:
        """Return values (n,) where those that are not known are the mean of their neighbours, from the border inwards.

        Those that no neighbour leads to have the mean of all known ones.

        Parameters
        ----------
        values : array, shape (n,)
            One for each taxel.
        known : array of bool, shape (n,)
            Whether it is known.
        """
        values, has = np.append(np.where(known, values, 0.0), 0.0), np.append(known, False)
        values[:-1][~known] = values.sum() / max(int(np.count_nonzero(known)), 1)
        missing = (~known).nonzero()[0]
        while len(missing):
            around = self.neighbours.take(missing, axis=1)
            counts = has[around].sum(axis=0)
            found = missing[counts > 0]
            if not len(found):
                break
            sums = np.where(has[around], values[around], 0.0).sum(axis=0)
            values[found], has[found] = sums[counts > 0] / counts[counts > 0], True
            missing = missing[counts == 0]
        return values[:-1]

    def _period(self, patch: int) -> tuple[int, int]:
        """Return the rows and columns after which a patch closes on itself; 0 if its ends are not neighbours."""
        in_patch = self.pairs[(self.patch[self.pairs] == patch).all(axis=1)]
        step = np.abs(np.diff(self.index[in_patch], axis=1)[:, 0]).max(axis=0, initial=0)
        rows, columns = (int(s) + 1 if s > 1 else 0 for s in step)
        return rows, columns


def _max_load(patch: "Patch") -> float:
    """Return the largest plausible load on a patch [N]."""
    usual = max(USUAL_MAX_PRESSURE * float(patch.taxels.areas.sum()), MIN_MAX_LOAD)
    return usual if patch.max_load is None else patch.max_load


def _padded(groups: list[Array]) -> Array:
    """Return the corners (n, k, 3) of all cells; a cell with fewer corners repeats its last one."""
    most = max((g.shape[1] for g in groups), default=1)
    filled = [np.concatenate((g, np.repeat(g[:, -1:], most - g.shape[1], axis=1)), axis=1) for g in groups]
    return np.concatenate([np.empty((0, most, 3)), *filled])


def neighbour_table(pairs: IntArray, n: int) -> IntArray:
    """Return the neighbours of each taxel as a table (k, n) of rows, of pairs (e, 2); ``n`` stands for none."""
    ends = np.concatenate((pairs, pairs[:, ::-1]))
    ends = ends[np.argsort(ends[:, 0], kind="stable")]
    counts = np.bincount(ends[:, 0], minlength=n)
    table = np.full((int(counts.max(initial=0)), n), n)
    table[np.arange(len(ends)) - np.repeat(np.cumsum(counts) - counts, counts), ends[:, 0]] = ends[:, 1]
    return table


def observable(wrenches: Array) -> BoolArray:
    """Return which components (6,) of the wrench the taxels observe; the others are always zero.

    Taxels measure the normal force only. A flat sole therefore observes 3 of the 6 components: not the lateral forces,
    and not the moment about its normal (thesis eq. 4.23 claims all 6).
    """
    size = np.abs(wrenches).max(axis=0, initial=0.0)
    force, moment = size[:3].max(), size[3:].max()
    return size > MIN_OBSERVED_FRACTION * np.repeat((force, moment), 3)


def wrench_rank(wrenches: Array) -> int:
    """Return the number of independent wrenches of the taxels: 3 for a flat sole, 4 for a cylinder, 6 at most.

    Moments are divided by the longest lever arm, so that the result does not depend on the unit of length.
    """
    arm = np.abs(wrenches[:, 3:]).max(initial=0.0) or 1.0
    strengths = np.linalg.svd(wrenches / np.repeat((1.0, arm), 3), compute_uv=False)
    return int((strengths > MIN_OBSERVED_FRACTION * strengths.max(initial=0.0)).sum())


class GroundGeometry:
    """The taxels that can stand on the ground, in the coordinates of the ground.

    Attributes
    ----------
    plane : Plane
        The ground, in the frame of the link.
    can_stand : array of bool, shape (n,)
        Whether a taxel looks down.
    centres : array, shape (n, 2)
        Of the cells [m].
    middle : array, shape (2,)
        Mean of the centres of the taxels that can stand [m].
    corners : array, shape (n, k, 2)
        Of the cells [m].
    """

    def __init__(self, skin: SkinGeometry, plane: Plane):
        self.plane = plane
        downward = -(skin.normals @ plane.axes[2])  # the fraction of a force that lifts the robot
        self.can_stand = downward >= MIN_DOWNWARD
        self.standing_count = int(self.can_stand.sum())
        self._cannot_stand = ~self.can_stand
        self.centres = plane.flat(skin.positions)
        self.middle = self.centres[self.can_stand].mean(axis=0) if self.standing_count else np.zeros(2)
        self.corners = plane.flat(skin.corners)
        lift = np.where(self.can_stand, downward, 0.0)[:, None]
        pushes, arms = -skin.normals @ plane.axes.T, (skin.positions - plane.origin) @ plane.axes.T
        moments = np.cross(arms, pushes)
        self.terms = np.hstack((lift, lift * self.centres, pushes[:, 2:], moments[:, :2]))
        of_centres = HullTable(self.centres)
        self.centre_hull, self.sure_hull = PolygonTable(of_centres), PolygonTable(of_centres)
        self.corner_hull = PolygonTable(HullTable(self.corners))
        offsets = (self.corners - self.centres[:, None])[self.can_stand].reshape(-1, 2)
        self.cell = convex_hull(offsets).corners
        self.last_eroded = EMPTY_POLYGON, EMPTY_POLYGON
        standing = self.can_stand
        self.full_contact_correction = _full_contact_correction(
            self.centres[standing], self.corners[standing], skin.areas[standing]
        )
        shift = np.zeros((len(standing), 2))
        if self.full_contact_correction is not None:
            centre, correction = self.full_contact_correction
            shift[standing] = (self.centres[standing] - centre) @ (correction - np.eye(2)).T
        self.plain = Terms(self.terms, skin.terms)
        self.full_contact = self._moved(skin, pushes, lift, shift)
        seconds = _second_moments(self.corners - self.centres[:, None])
        shift = _arms_in_cells(self.centres, seconds, skin.areas, skin.neighbours, standing)
        self.in_cell = self._moved(skin, pushes, lift, shift)
        self.gradient = (self.in_cell.ground[:, 1:3] - self.terms[:, 1:3]).T.copy()
        lock(*vars(self).values(), *(self.full_contact_correction or ()))

    def is_full(self, active: BoolArray) -> BoolArray:
        """Return whether all taxels that can stand on the ground are active (...), of active ones (..., n)."""
        if not self.standing_count:
            return np.zeros(active.shape[:-1], bool)
        full: BoolArray = (active | self._cannot_stand).all(axis=-1)
        return full

    def _moved(self, skin: SkinGeometry, pushes: Array, lift: Array, shift: Array) -> "Terms":
        """Return the terms if each force acts away from the centre of its cell, by a shift (n, 2) [m]."""
        moments = np.cross(np.column_stack((shift, np.zeros(len(shift)))), pushes)
        ground, link = self.terms.copy(), skin.terms.copy()
        ground[:, 1:3] += lift * shift
        ground[:, 4:6] += moments[:, :2]
        link[8:] += (moments @ self.plane.axes).T
        return Terms(ground, link, True)


@dataclass(frozen=True, eq=False)
class Terms:
    """What sums over the taxels weigh with the forces. Other orders of the numbers make products of matrices fast."""

    ground: Array  # (n, 6), as :attr:`.GroundGeometry.terms`; zeros without a ground
    link: Array  # (11, n), as :attr:`.SkinGeometry.terms`
    has_moments: bool = False  # whether they have the moments within the cells

    def __post_init__(self) -> None:
        lock(self.ground, self.link)

    @cached_property
    def sums(self) -> Array:
        """The terms (12, n) of the wrench about the origin of the link, and those of the ground."""
        return locked(np.vstack((self.link[5:], self.ground.T)))

    @cached_property
    def rows(self) -> Array:
        """Link terms (n, 11) of each taxel."""
        return locked(self.link.T.copy())

    @cached_property
    def products(self) -> Array:
        """Products (10, n) of the ground terms of each taxel, see :func:`products_of`."""
        return locked(products_of(self.ground.T))


def products_of(ground: Array) -> Array:
    """Return products (10, ...) of ground terms (6, ...): lift, f_z with themselves, their moments, and with those."""
    lift, lift_x, lift_y, fz, tx, ty = ground
    first, second = (lift, lift_x, lift_y, lift_x, lift_y), (lift, lift_x, lift_y, lift, lift)
    return np.stack((*np.multiply(first, second), *np.multiply((fz, tx, ty, tx, ty), (fz, tx, ty, fz, fz))))


def _full_contact_correction(centres: Array, corners: Array, areas: Array) -> tuple[Array, Array] | None:
    r"""Return the centre of the skin (2,) and the matrix (2, 2) that correct a CoP at full contact.

    The CoP assumes that each force acts at the centre of its cell. Under a linear pressure the moments within the
    cells are missing, and the CoP is too near the centre of the skin :math:`\mathbf{c}_0`. The correction is

    .. math::
        \mathbf{p} \leftarrow \mathbf{c}_0 + \left( \mathbf{1} + R\,S^{-1} \right) (\mathbf{p} - \mathbf{c}_0)

    with the mean second moment :math:`R` of a cell about its centre and :math:`S` of the centres about
    :math:`\mathbf{c}_0` [m^2], weighted by area. On the sole with 42 hexagons the matrix is diag(1.012, 1.047).
    None if the taxels are in one row.
    """
    if len(centres) < 3:
        return None
    middle = areas @ centres / areas.sum()
    arms = centres - middle
    spread = (areas[:, None] * arms).T @ arms / areas.sum()
    if np.linalg.cond(spread) > MAX_MOMENT_CONDITION:
        return None
    inside = np.average(_second_moments(corners - centres[:, None]), axis=0, weights=areas)
    return middle, np.eye(2) + inside @ np.linalg.inv(spread)


def _second_moments(corners: Array) -> Array:
    """Return the second moments (n, 2, 2) of cells about their centres, per area [m^2]."""
    a = corners
    b = np.roll(a, -1, axis=1)
    twice = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    outer = (a[..., :, None] * a[..., None, :] + b[..., :, None] * b[..., None, :]) * 2
    outer += a[..., :, None] * b[..., None, :] + b[..., :, None] * a[..., None, :]
    area = twice.sum(axis=1)[:, None, None]
    return (twice[..., None, None] * outer).sum(axis=1) / np.where(area == 0, np.inf, 12 * area)


def _arms_in_cells(centres: Array, seconds: Array, areas: Array, neighbours: IntArray, standing: BoolArray) -> Array:
    r"""Return by how much (n, 2) the force of each taxel acts away from its centre, for a pressure that varies [m].

    The pressure of cell i has the gradient :math:`\mathbf{g}_i`, the least-squares fit to the differences from its
    neighbours. Its moment about the centre is missing in a sum of forces at the centres:

    .. math::
        \sum_i A_i R_i \mathbf{g}_i = \sum_j f_j \mathbf{k}_j , \qquad
        \mathbf{g}_i = M_i^{-1} \sum_j \mathbf{d}_{ij} (p_j - p_i) , \quad
        M_i = \sum_j \mathbf{d}_{ij} \mathbf{d}_{ij}^T ,

    with the area :math:`A_i`, the second moments :math:`R_i` per area, :math:`\mathbf{d}_{ij}` from centre i to
    centre j, and :math:`p_j = f_j / A_j`. The sum is linear in the forces, so that each taxel has a fixed shift
    :math:`\mathbf{k}_j`. It is zero except near the border of the skin.
    """
    n = len(centres)
    shift = np.zeros((n + 1, 2))
    valid = np.append(standing, False)[neighbours] & standing  # (k, n)
    apart = np.where(valid[..., None], np.append(centres, [[0.0, 0.0]], axis=0)[neighbours] - centres, 0.0)
    normal = np.einsum("kni,knj->nij", apart, apart)
    gains = np.einsum("n,nij,njl,knl->kni", areas, seconds, np.linalg.pinv(normal, MIN_CELL_SPREAD), apart)
    per_area = 1 / np.append(areas, 1.0)
    np.add.at(shift, neighbours, gains * per_area[neighbours][..., None])
    return shift[:n] - gains.sum(axis=0) * per_area[:n, None]
