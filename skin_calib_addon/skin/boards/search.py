"""The search for the poses of a lattice with the most boards in a flat region."""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ...common.arrays import Array, IntArray, pairs_of, unit
from ..lattice import HexLattice
from .overlap import TOUCH
from .region import Region

# [1] Steps of the first shifts, and of the raster of depths, per pitch. More: misses fewer poses, slower.
STEPS_PER_PITCH = 12
# [1] Steps of the first rotations, of the farthest board, per pitch. More: misses fewer poses, slower.
TURNS_PER_PITCH = 12
# [1] Groups of rotations of which the best pose is wanted. More: more boards, slower (3 with a beam of 16: 4 % fewer on
# real links in half the time).
GROUPS = 12
# [1] The same where boards grow on, which makes up for it. Larger: slower.
FEW_TURNS, FEW_GROUPS = 6, 3
# [1] Poses of a group that are refined together. More: misses fewer poses, slower.
BEAM = 8
# [1] Largest change of the pitch: around a tube, so that the rows close, and of a board that would overlap another.
# Larger: more boards, wider gaps between them.
MAX_PITCH_CHANGE = 0.06
# [1] Positions of discs on the line from the centre of a board to its corner, as fractions. With a disc about the
# centre they nearly fill the board. More: fewer overlooked corners of a border, slower.
DISC_POSITIONS = (1.0, 0.5, 0.75)
# [boards] Preference of small rotations and shifts among poses with as many boards and as much clearance. Larger: less
# clearance; smaller: rounding decides.
PREFERENCE = 0.05
# Derived: rotation about a cell that maps the lattice onto itself [rad].
LATTICE_PERIOD = np.pi / 3


@dataclass(frozen=True, eq=False)
class Poses:
    """Poses of a lattice in the plane: it is rotated, stretched (on a tube only around it), and shifted."""

    angles: Array  # (k,) [rad]
    stretches: Array  # (k,) [1]
    offsets: Array  # (k, 2) positions of cell (0, 0) [m]

    def __getitem__(self, which: Any) -> "Poses":
        return Poses(self.angles[which], self.stretches[which], self.offsets[which])

    @classmethod
    def at(cls, angle: float, stretch: float, offsets: ArrayLike = ((0.0, 0.0),)) -> "Poses":
        """Return poses of one angle and stretch."""
        offsets = np.asarray(offsets, float)
        return cls(np.full(len(offsets), angle), np.full(len(offsets), stretch), offsets)

    @classmethod
    def joined(cls, parts: list["Poses"]) -> "Poses":
        """Return several poses as one."""
        return cls(*(np.concatenate([getattr(p, k) for p in parts]) for k in ("angles", "stretches", "offsets")))


def axes_at(angles: ArrayLike) -> Array:
    """Return the x and y axes (rows) at angles of any shape [rad], shape (..., 2, 2)."""
    c, s = np.cos(angles), np.sin(angles)
    return np.stack((np.stack((c, s), axis=-1), np.stack((-s, c), axis=-1)), axis=-2)


def in_period(angles: Array) -> Array:
    """Return angles within half a period of the lattice about zero [rad]."""
    return (angles + LATTICE_PERIOD / 2) % LATTICE_PERIOD - LATTICE_PERIOD / 2


@dataclass(frozen=True, eq=False)
class Search:
    """A lattice and a region. All shifts and steps are relative to the zero of the plane."""

    region: Region
    lattice: HexLattice
    period: Array | None  # (2,) flat vector around a tube [m]; None for an open surface
    half: float = 0.0  # half of the thickness of the boards [m]
    stretch: float = 1.0  # of the lattice, so that few boards overlap where the surface bends

    @property
    def size(self) -> Array:
        """Width and height of the region over all; of a tube its length around, once, and along it, shape (2,) [m]."""
        nodes = self.region.nodes[self.region.covers]
        if not len(nodes):
            return np.zeros(2)
        if self.period is None:
            return np.ptp(nodes, axis=0)
        length = float(np.linalg.norm(self.period))
        x, y = self.period / length
        around, along = np.ptp(nodes @ ((x, -y), (y, x)), axis=0)
        return np.array((min(around, length), along))

    def centres(self, poses: Poses, cells: IntArray) -> Array:
        """Return the centres (k, n, 2) [m] of n cells at k poses."""
        centres = self.lattice.centres(cells) @ axes_at(poses.angles)
        ahead = np.eye(2) if self.period is None else unit(self.period)[None]
        centres = centres + (poses.stretches[:, None, None] - 1) * (centres @ ahead.T @ ahead)
        return centres + poses.offsets[:, None]

    def clearances(self, centres: Array, angles: Array) -> Array:
        """Return the clearances of boards from the border, negative over it, shape (n,) [m]."""
        corners = np.moveaxis(self.lattice.corners @ axes_at(angles), 1, 0)
        fractions = np.repeat((0.0, *DISC_POSITIONS), (1, *len(DISC_POSITIONS) * [len(corners)]))
        arms = fractions[:, None, None] * corners[np.append(0, np.tile(np.arange(len(corners)), len(DISC_POSITIONS)))]
        depths = self.region.depths((centres + arms).reshape(-1, 2)).reshape(len(fractions), -1)
        clear: Array = (depths - (1 - fractions[:, None]) * self.apothem).min(axis=0)
        return clear

    def closed_rows(self) -> tuple[Array, Array]:
        r"""Return the angles [rad] at which rows close around a tube, and the stretches that close them.

        The tube has the radius :math:`R = |T| / 2\pi` with its period T [m]. Boards on its tangent planes, with the
        width w and half of the thickness h [m], touch at the distance :math:`2 R \arctan(w / 2 (R - h))` along the
        surface.
        """
        if self.period is None:
            return np.zeros(0), np.zeros(0)
        length = float(np.linalg.norm(self.period))
        q, r = (k.ravel() for k in np.indices(2 * (int(length / self.lattice.row_step) + 2,)))
        vectors = self.lattice.centres(np.column_stack((q, r))[q > 0])  # a sixth of all
        stretches = length / np.linalg.norm(vectors, axis=1)
        radius, width = length / (2 * np.pi), min(2 * self.apothem, self.lattice.pitch)
        least = 2 * radius / width * np.arctan2(width / 2, max(radius - self.half, 0.0))
        near = (stretches >= least) & (stretches <= 1 + MAX_PITCH_CHANGE)
        angles = np.arctan2(*self.period[::-1]) - np.arctan2(*vectors[near].T[::-1])
        return in_period(angles), stretches[near]

    def best(self) -> list[Poses]:
        """Return the best pose of each group of rotations, and of the best rotations that close around a tube.

        On a doubly curved surface the number of boards in the plane is only an estimate, so that several are needed.
        """
        return self._best_of(TURNS_PER_PITCH, GROUPS)

    def some(self) -> list[Poses]:
        """Return the best poses of few groups, and those with rows along and across the lines of the surface."""
        along = in_period(LATTICE_PERIOD / 2 * np.arange(2.0))[:, None]
        return self._best_of(FEW_TURNS, FEW_GROUPS, along)

    def _best_of(self, turns: int, most: int, along: Iterable[Array] = ()) -> list[Poses]:
        """Return the best poses of groups of rotations, and of arrays of rotations (1,) that are kept [rad]."""
        if not self.region.carries.any():
            return []
        count = int(np.ceil(LATTICE_PERIOD * self._radius / self.lattice.pitch * turns / most))
        turn = LATTICE_PERIOD / (most * count)
        angles = in_period(turn * np.arange(float(most * count))).reshape(most, count)
        free = [self._starts(group, np.full(count, self.stretch), turn) for group in angles]
        kept = [self._starts(angle, np.full(1, self.stretch), 0.0) for angle in along]
        closed = [
            self._starts(angle, stretch, 0.0) for angle, stretch in zip(*(k[:, None] for k in self.closed_rows()))
        ]
        found = []
        for groups, step in ((free, turn), (kept, 0.0), (closed, 0.0)):
            groups.sort(key=lambda group: -group[1][0])
            found += [self._refined(poses, step) for poses, _ in groups[:most]]
        return found

    def _starts(self, angles: Array, stretches: Array, turn: float) -> tuple[Poses, Array]:
        """Return the best of many poses at angles in steps of ``turn`` [rad], and their scores."""
        slack, found = self._slack(self._step, turn), []
        for angle, stretch in zip(angles, stretches):
            poses, scores = self._shifted(float(angle), float(stretch), slack)
            best = np.argsort(-scores, kind="stable")[:BEAM]
            found.append((poses[best], scores[best]))
        poses, scores = Poses.joined([p for p, _ in found]), np.concatenate([s for _, s in found])
        best = np.argsort(-scores, kind="stable")[:BEAM]
        return poses[best], scores[best]

    def _shifted(self, angle: float, stretch: float, slack: float) -> tuple[Poses, Array]:
        """Return poses at all shifts of a lattice, in steps of its own raster, and about their scores.

        The steps of the raster are fractions of those of the lattice. A board at each node is judged once. The nodes
        that are whole cells apart belong to one shift.
        """
        basis = self.centres(Poses.at(angle, stretch), np.eye(2, dtype=int))[0] / STEPS_PER_PITCH
        low, depths, of_centres = self._raster
        to_steps = np.linalg.inv(basis) * self._step
        # Only the box around the nodes that can carry a board, in steps of the lattice.
        carrying = np.nonzero(of_centres > self.apothem - slack)
        ends = (np.array((k.min(initial=n) - 1.0, k.max(initial=0) + 1.0)) for k, n in zip(carrying, depths.shape))
        box = (low + pairs_of(*ends)) @ to_steps
        first = np.floor(box.min(axis=0) / STEPS_PER_PITCH) * STEPS_PER_PITCH
        cells = np.ceil((box.max(axis=0) - first + 1) / STEPS_PER_PITCH).astype(int)
        shape = (int(cells[0]) * STEPS_PER_PITCH, int(cells[1]) * STEPS_PER_PITCH)
        corners = np.rint(self.lattice.corners @ axes_at(angle) / self._step @ to_steps).astype(int)
        wide = int(np.abs(corners).max())
        steps = [k + np.arange(-wide, n + wide, dtype=float) for k, n in zip(first, shape)]
        # Beyond the raster counts as its margin, where no board may be. In place, because the arrays are large.
        x, y = (np.add.outer(steps[0] * a, steps[1] * b) for a, b in (basis / self._step).T)
        for nodes, start, n in zip((x, y), low, depths.shape):
            nodes -= start
            np.clip(np.rint(nodes, out=nodes), 0, n - 1, out=nodes)
        x *= depths.shape[1]
        at = np.add(x, y, out=x).astype(np.intp)
        around = depths.ravel().take(at)
        clear = of_centres.ravel().take(at[wide : wide + shape[0], wide : wide + shape[1]]) - self.apothem
        for i, j in corners + wide:
            np.minimum(clear, around[i : i + shape[0], j : j + shape[1]], out=clear)
        clear = clear.reshape(cells[0], STEPS_PER_PITCH, cells[1], STEPS_PER_PITCH)
        count = np.clip(1 + clear / slack, 0, 1).sum(axis=(0, 2)).ravel()
        tightest = np.where(clear > -slack, clear, np.inf).min(axis=(0, 2)).ravel()
        tightest[np.isinf(tightest)] = 0.0
        parts = pairs_of(*2 * [np.arange(STEPS_PER_PITCH) / STEPS_PER_PITCH])
        poses = Poses.at(angle, stretch, (parts - np.rint(parts)) @ (STEPS_PER_PITCH * basis))
        return poses, self._total(poses, count, tightest)

    def _refined(self, poses: Poses, turn: float) -> Poses:
        """Return the best pose near given ones: half a step to both sides, in all directions, again and again."""
        half, step = (-0.5, 0.5), self._step
        signs = np.array([(x, y, z) for x in half for y in half for z in (half if turn else (0.0,))])
        for _ in range(int(np.log2(step / (TOUCH * self.lattice.side)))):  # until boards touch
            step, turn = step / 2, turn / 2
            x, y, z = np.tile(signs, (len(poses.angles), 1)).T
            near = poses[np.repeat(np.arange(len(poses.angles)), len(signs))]
            offsets = np.einsum("kc,kcd->kd", near.offsets, axes_at(turn * z)) + step * np.column_stack((x, y))
            near = Poses(near.angles + turn * z, near.stretches, offsets)
            poses = self._best(near, self._slack(step, turn))
        return self._best(poses, TOUCH * self.lattice.side)[:1]

    def _best(self, poses: Poses, slack: float) -> Poses:
        """Return the poses with the largest scores."""
        return poses[np.argsort(-self._scores(poses, slack), kind="stable")[:BEAM]]

    def _slack(self, step: float, turn: float) -> float:
        """Return the clearance that boards may lack at the pose nearest to a valid one, in steps [m] and [rad]."""
        return max(step / np.sqrt(3) + turn * self._radius / 2, TOUCH * self.lattice.side)

    def _scores(self, poses: Poses, slack: float) -> Array:
        r"""Return the scores of poses, shape (k,): the boards that fit, and the clearance of the tightest one.

        .. math:: \sum_i \min(\max(1 + c_i / s, 0), 1) + \tfrac12 \min_i c_i / P

        with the clearances c [m] of the cells, the slack s [m] and the pitch P [m].
        """
        first = self._nodes(self.centres(poses, self.cells))
        corners = self.lattice.corners @ axes_at(poses.angles) / self._step
        _, depths, of_centres = self._raster
        pose, cell = np.nonzero(((first >= 0) & (first <= np.array(depths.shape) - 1)).all(axis=2))
        first = first[pose, cell]
        near = of_centres[tuple((first + 0.5).astype(np.intp).T)] >= self.apothem - slack - self._step
        pose, first = pose[near], first[near]
        clear = self._interpolated(first) - self.apothem
        for fraction in DISC_POSITIONS:
            fits = clear > -slack
            pose, first, clear = pose[fits], first[fits], clear[fits]
            for k in range(corners.shape[1]):
                there = self._interpolated(first + fraction * corners[pose, k]) - (1 - fraction) * self.apothem
                np.minimum(clear, there, out=clear)
        pose, clear = pose[clear > -slack], clear[clear > -slack]
        count = np.asarray(np.bincount(pose, np.minimum(1 + clear / slack, 1), len(poses.angles)), float)
        found, start = np.unique(pose, return_index=True)
        tightest = np.zeros(len(count))
        tightest[found] = np.minimum.reduceat(clear, start) if len(start) else 0.0
        return self._total(poses, count, tightest)

    def _total(self, poses: Poses, count: Array, tightest: Array) -> Array:
        """Return the scores (k,) of poses from the boards that fit and the clearance of the tightest one [m]."""
        # Mirror images have different preferences, so that rounding does not decide between them.
        shifts = poses.offsets / self.lattice.pitch
        size = np.abs(poses.angles) + 0.3 * poses.angles + np.linalg.norm(shifts, axis=1) + shifts @ (0.1, 0.07)
        return count + 0.5 * tightest / self.lattice.pitch - PREFERENCE * size

    @property
    def apothem(self) -> float:
        """Distance of the sides of a board from its centre [m]."""
        return float(np.sqrt(0.75)) * self.lattice.side

    @property
    def _step(self) -> float:
        """Distance of the nodes of the raster [m]."""
        return self.lattice.pitch / STEPS_PER_PITCH

    @cached_property
    def _radius(self) -> float:
        """Distance from the zero to the farthest centre of a board, in whole pitches [m]."""
        far = np.linalg.norm(self.region.nodes[self.region.carries], axis=1).max(initial=0.0)
        return max(float(np.ceil(far / self.lattice.pitch)), 1.0) * self.lattice.pitch

    @cached_property
    def cells(self) -> IntArray:
        """Cells that may be in the region at a pose, also beyond the cut of a tube, shape (n, 2), from the root out."""
        radius = self._radius + 3 * self.lattice.pitch
        most = int(radius / self.lattice.row_step) + 1
        r, q = (a.ravel() - most for a in np.indices((2 * most + 1, 2 * most + 1)))
        order = np.lexsort((r, np.abs(r), 2 * q + r, q * q + q * r + r * r))  # mirrored cells follow each other
        cells = np.column_stack((q, r))[order]
        return cells[np.linalg.norm(self.lattice.centres(cells), axis=1) <= radius]

    @cached_property
    def _raster(self) -> tuple[Array, Array, Array]:
        """The first node of the raster, depths at its nodes, and of centres; minus infinity where none may be."""
        home = self.region.nodes[self.region.carries] / self._step
        margin = STEPS_PER_PITCH + 2
        low, high = np.floor(home.min(axis=0)) - margin, np.ceil(home.max(axis=0)) + margin
        nodes = self._step * (low + pairs_of(*(np.arange(n + 1.0) for n in high - low)))
        shape = tuple((high - low + 1).astype(int))
        depths = self.region.depths(nodes).reshape(shape)
        return low, depths, np.where(self.region.may_be_centres(nodes).reshape(shape), depths, -np.inf)

    def _nodes(self, points: Array) -> Array:
        """Return flat points (..., 2) in steps of the raster, from its first node."""
        return points / self._step - self._raster[0]

    def _interpolated(self, nodes: Array) -> Array:
        """Return the depths between the nodes next to fractional ones (k, 2), shape (k,) [m]."""
        depths = self._raster[1]
        i, j = nodes.astype(np.intp).T
        x, y = nodes[:, 0] - i, nodes[:, 1] - j
        at = i * depths.shape[1] + j
        low, high = (
            (1 - y) * depths.ravel().take(at + k, mode="clip") + y * depths.ravel().take(at + k + 1, mode="clip")
            for k in (0, depths.shape[1])
        )
        return (1 - x) * low + x * high
