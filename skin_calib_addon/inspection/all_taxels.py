"""The taxels of all patches of a link side by side, to be looked at: found by name, by a ray, by their sides."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree

from ..calibration.model import Patch
from ..common.arrays import Array, IntArray, cross
from ..common.errors import UnknownTaxel
from ..common.findings import did_you_mean

# Middles of two sides nearer than this share of the shorter side are one side.
SHARED_SIDE_TOLERANCE = 0.3
# A ray slips through between two triangles no wider apart than this share of them, which is rounding.
BARYCENTRIC_ROUNDING = 1e-9
MAX_CHANNEL_DIGITS = 12  # digits of a channel


@dataclass(frozen=True, eq=False)
class AllTaxels:
    """Taxels of all patches; row i of every field is the same taxel. Link frame and SI units."""

    ids: tuple[str, ...]
    channels: IntArray  # (n,)
    index: IntArray  # (n, 2) row and column, or the axial coordinates of a board
    positions: Array  # (n, 3) [m]
    normals: Array  # (n, 3) unit, out of the robot
    corners: Array  # (n, k, 3), the last one repeated where a cell has fewer than others [m]
    areas: Array  # (n,) [m^2]
    neighbours: tuple[tuple[str, ...], ...]
    strain: Array  # (n, 3) along the row, across the rows, shear [rad]; NaN where a patch has none
    stored_tilt: Array  # (n,) as the patch knows it [rad]; NaN where it does not

    @classmethod
    def of(cls, patches: Sequence[Patch]) -> "AllTaxels":
        """Those of some patches, one after another."""
        taxels = [patch.taxels for patch in patches]
        most = max((t.corners_link.shape[1] for t in taxels), default=3)

        def joined(name: str, *shape: int) -> Array:
            return np.concatenate([np.empty((0, *shape)), *(getattr(t, name) for t in taxels)])

        def quality(name: str, *shape: int) -> Array:
            parts = (t.quality.get(name, np.full((len(t.ids), *shape), np.nan)) for t in taxels)
            return np.concatenate([np.empty((0, *shape)), *parts])

        padded = (np.pad(t.corners_link, _missing(t.corners_link, most), mode="edge") for t in taxels)
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
            stored_tilt=quality("tilt"),
        )

    @cached_property
    def rows(self) -> dict[str, int]:
        """The row of each id."""
        return {name: row for row, name in enumerate(self.ids)}

    @cached_property
    def tilt(self) -> Array:
        """Largest angle to a neighbour (n,) [rad], whatever the skin is made of; NaN where there is none."""
        ends = [(row, self.rows[other]) for row, others in enumerate(self.neighbours) for other in others]
        a, b = np.array(ends, np.int64).reshape(-1, 2).T
        # Half the angle from half the difference: exact where the normals are nearly the same.
        gap = np.linalg.norm(self.normals[a] - self.normals[b], axis=1)
        angle = 2 * np.arcsin(np.clip(gap / 2, 0, 1))
        found = np.full(len(self.ids), -1.0)
        np.maximum.at(found, a, angle)
        return np.where(np.isnan(self.stored_tilt), np.where(found < 0, np.nan, found), self.stored_tilt)

    @property
    def stretch(self) -> Array:
        """The larger one of the strains along and across the rows (n,), with its sign; NaN where there is none."""
        along, across = self.strain[:, 0], self.strain[:, 1]
        return np.where(np.abs(along) >= np.abs(across), along, across)

    def row_of(self, word: str) -> int:
        """The row of a taxel that is named by its id, or by its channel.

        Raises
        ------
        UnknownTaxel
            If there is none; says what there is.
        """
        word = word.strip()
        if word in self.rows:
            return self.rows[word]
        is_channel = word.isascii() and word.isdigit() and len(word) < MAX_CHANNEL_DIGITS
        here = np.flatnonzero(self.channels == int(word if is_channel else -1))
        if len(here):
            return int(here[0])
        if not len(self.ids):
            raise UnknownTaxel("this link has no taxel; add a skin and fit")
        channels = f"channels go from {self.channels.min()} to {self.channels.max()}"
        raise UnknownTaxel(f"no taxel {word!r} here; {channels}, ids from {self.ids[0]}{did_you_mean(word, self.ids)}")

    def under(self, start: Array, direction: Array, farthest: float = np.inf) -> int | None:
        """The taxel whose cell a ray meets first from outside, None where it meets none.

        Parameters
        ----------
        start, way : array, shape (3,)
            Of the ray [m].
        farthest : float
            Where the ray ends, in lengths of ``way``.
        """
        a = self.positions[:, None]
        u, v = self.corners - a, np.roll(self.corners, -1, axis=1) - a
        p = cross(np.broadcast_to(direction, v.shape), v)
        volume = (u * p).sum(axis=2)
        facing = volume > 0  # corners turn counter-clockwise as seen from outside
        scale = np.where(facing, volume, 1.0)
        t = np.broadcast_to(start - a, u.shape)
        q = cross(t, u)
        b, c, far = (t * p).sum(axis=2) / scale, (q @ direction) / scale, (v * q).sum(axis=2) / scale
        met = (
            facing
            & (b >= -BARYCENTRIC_ROUNDING)
            & (c >= -BARYCENTRIC_ROUNDING)
            & (b + c <= 1 + BARYCENTRIC_ROUNDING)
            & (far >= 0)
            & (far <= farthest)
        )
        if not met.any():
            return None
        return int(np.unravel_index(np.where(met, far, np.inf).argmin(), met.shape)[0])

    @cached_property
    def adjacent(self) -> IntArray:
        """The taxel on the other side of each side of each cell (n, k); -1 where there is none."""
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
        """Sides (s, 2, 3) of some cells that none of the others lies beside [m]."""
        chosen = np.zeros(len(self.ids) + 1, bool)  # -1 is the last
        chosen[rows] = True
        ends = np.stack((self.corners[rows], np.roll(self.corners[rows], -1, axis=1)), axis=2)
        open_ = ~chosen[self.adjacent[rows]] & (ends[:, :, 0] != ends[:, :, 1]).any(axis=2)
        return ends[open_]

    @property
    def width(self) -> float:
        """Side of a square of the middle area of a cell [m]; 0 where there is no cell."""
        return float(np.sqrt(np.median(self.areas))) if len(self.areas) else 0.0


def _missing(corners: Array, most: int) -> tuple[tuple[int, int], ...]:
    return (0, 0), (0, most - corners.shape[1]), (0, 0)
