"""Taxels of all patches of a link in common arrays; search by name, by ray, and by common sides."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree

from ..calibration.model import MAX_CHANNEL, Patch, neighbour_rows
from ..common.arrays import Array, IntArray, cross
from ..common.errors import UnknownTaxel
from ..common.findings import did_you_mean
from ..geometry.sampling.rays import HIT_TOLERANCE
from ..skin.neighbours import angles, largest_of

# Largest distance between the middles of two sides that are one side, as a fraction of the shorter one. Larger: bridges
# wider gaps.
SHARED_SIDE_TOLERANCE = 0.3


@dataclass(frozen=True, eq=False)
class AllTaxels:
    """Taxels of all patches, in the link frame and SI units; row i of every field is the same taxel."""

    ids: tuple[str, ...]
    channels: IntArray  # (n,)
    index: IntArray  # (n, 2) row and column, or the axial coordinates of a board
    positions: Array  # (n, 3) [m]
    normals: Array  # (n, 3) unit, out of the robot
    corners: Array  # (n, k, 3), the last one repeated where a cell has fewer than others [m]
    areas: Array  # (n,) [m^2]
    neighbours: tuple[tuple[str, ...], ...]
    strain: Array  # (n, 3) along the row, across the rows, shear [rad]; NaN where a patch has none
    sigma: (
        Array  # (n, 3) standard uncertainty: along the surface [m], along the normal [m], of the normal [rad], or NaN
    )

    @classmethod
    def of(cls, patches: Sequence[Patch]) -> "AllTaxels":
        """Return the taxels of some patches, one patch after another."""
        taxels = [patch.taxels for patch in patches]
        most = max((t.corners_link.shape[1] for t in taxels), default=3)

        def joined(name: str, *shape: int) -> Array:
            return np.concatenate([np.empty((0, *shape)), *(getattr(t, name) for t in taxels)])

        def quality(name: str, *shape: int) -> Array:
            parts = (t.quality.get(name, np.full((len(t.ids), *shape), np.nan)) for t in taxels)
            return np.concatenate([np.empty((0, *shape)), *parts])

        missing = (((0, 0), (0, most - t.corners_link.shape[1]), (0, 0)) for t in taxels)
        padded = (np.pad(t.corners_link, width, mode="edge") for t, width in zip(taxels, missing))
        return cls(
            ids=sum((t.ids for t in taxels), ()),
            channels=joined("channels").astype(np.int64),
            index=joined("index", 2).astype(np.int64),
            positions=joined("positions_link", 3),
            normals=joined("normals_link", 3),
            corners=np.concatenate([np.empty((0, most, 3)), *padded]),
            areas=joined("areas"),
            neighbours=sum((t.neighbours for t in taxels), ()),
            strain=quality("strain", 3),
            sigma=np.concatenate([np.empty((0, 3)), *(t.known_sigma for t in taxels)]),
        )

    @cached_property
    def rows(self) -> dict[str, int]:
        """Row of each id."""
        return {name: row for row, name in enumerate(self.ids)}

    @cached_property
    def tilt(self) -> Array:
        """Largest angle to a neighbour, shape (n,) [rad], for all kinds of skins; NaN without a neighbour."""
        pairs = neighbour_rows(self.ids, self.neighbours)
        return largest_of(angles(self.normals, pairs), pairs, len(self.ids))

    @property
    def stretch(self) -> Array:
        """Strain along or across the rows, the one with the larger magnitude, with sign, shape (n,); NaN if unknown."""
        along, across = self.strain[:, 0], self.strain[:, 1]
        return np.where(np.abs(along) >= np.abs(across), along, across)

    def row_of(self, word: str) -> int:
        """Return the row of a taxel, by its id or its channel."""
        word = word.strip()
        if word in self.rows:
            return self.rows[word]
        is_channel = word.isascii() and word.isdigit() and len(word) <= len(str(MAX_CHANNEL))
        here = np.flatnonzero(self.channels == int(word if is_channel else -1))
        if len(here):
            return int(here[0])
        if not len(self.ids):
            raise UnknownTaxel("this link has no taxel; add a skin and fit")
        channels = f"channels go from {self.channels.min()} to {self.channels.max()}"
        raise UnknownTaxel(f"no taxel {word!r} here; {channels}, ids from {self.ids[0]}{did_you_mean(word, self.ids)}")

    def under(self, start: Array, direction: Array, farthest: float = np.inf) -> int | None:
        """Return the row of the taxel whose cell a ray hits first from outside; None without a hit."""
        a = self.positions[:, None]
        u, v = self.corners - a, np.roll(self.corners, -1, axis=1) - a
        p = cross(np.broadcast_to(direction, v.shape), v)
        volume = (u * p).sum(axis=2)
        facing = volume > 0  # corners are counter-clockwise seen from outside
        scale = np.where(facing, volume, 1.0)
        t = np.broadcast_to(start - a, u.shape)
        q = cross(t, u)
        b, c, far = (t * p).sum(axis=2) / scale, (q @ direction) / scale, (v * q).sum(axis=2) / scale
        met = (
            facing
            & (b >= -HIT_TOLERANCE)
            & (c >= -HIT_TOLERANCE)
            & (b + c <= 1 + HIT_TOLERANCE)
            & (far >= 0)
            & (far <= farthest)
        )
        if not met.any():
            return None
        return int(np.unravel_index(np.where(met, far, np.inf).argmin(), met.shape)[0])

    @cached_property
    def adjacent(self) -> IntArray:
        """Taxel on the other side of each side of each cell, shape (n, k); -1 without one."""
        n, k = self.corners.shape[:2]
        ends = np.roll(self.corners, -1, axis=1)
        middle, length = ((self.corners + ends) / 2).reshape(-1, 3), np.linalg.norm(ends - self.corners, axis=2).ravel()
        sides = np.flatnonzero(length > 0)  # the repeated corners have none
        found = np.full(n * k, -1)
        if len(sides) < 2:
            return found.reshape(n, k)
        distances, nearest = map(np.asarray, cKDTree(middle[sides]).query(middle[sides], k=2))
        itself = nearest[:, 0] == np.arange(len(sides))
        other, distances = (
            np.where(itself, nearest[:, 1], nearest[:, 0]),
            np.where(itself, distances[:, 1], distances[:, 0]),
        )
        is_shared = distances < SHARED_SIDE_TOLERANCE * np.minimum(length[sides], length[sides[other]])
        is_shared &= sides // k != sides[other] // k
        found[sides[is_shared]] = sides[other[is_shared]] // k
        return found.reshape(n, k)

    def outline(self, rows: IntArray) -> Array:
        """Return the sides of some cells that are not common to two of them, shape (s, 2, 3) [m]."""
        chosen = np.zeros(len(self.ids) + 1, bool)  # -1 is the last
        chosen[rows] = True
        ends = np.stack((self.corners[rows], np.roll(self.corners[rows], -1, axis=1)), axis=2)
        open_ = ~chosen[self.adjacent[rows]] & (ends[:, :, 0] != ends[:, :, 1]).any(axis=2)
        return ends[open_]

    @property
    def width(self) -> float:
        """Side of a square with the median area of the cells [m]; 0 without cells."""
        return float(np.sqrt(np.median(self.areas))) if len(self.areas) else 0.0
