r"""Residuals of touches of a robot on its own skins, and their derivatives with what the touches determine.

A touch states that two points are at one place: the point :math:`\mathbf{f}` of the skin that felt it, and the point
:math:`\mathbf{b}` of what touched, a tip or another skin. In the frame of the skin the residual is

.. math::

    \mathbf{r} = E \left( T_{\text{felt}}^{-1}(\mathbf{q} + \delta)\, T_{\text{body}}(\mathbf{q} + \delta)\, \mathbf{b}
    - \mathbf{f} \right)

with the offsets :math:`\delta` of the joints, and the rows of :math:`E` along the skin, across, and outward.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, TypeVar

import numpy as np

from ..calibration.model import Patch
from ..common.arrays import Array, BoolArray, IntArray, unit
from ..common.errors import CalibrationFormatError, listed
from ..common.findings import did_you_mean
from ..robot.kinematics import carried, rotation_about
from ..robot.urdf import Robot
from .flat import flat_places
from .placement import felt_by_several
from .self_touch_session import Felt, Session, Tip

USUAL_SPOT = 0.8  # [1] of the unknown "spot"; `registration.SPOTS` has its range
# [m, fraction of the cell size, m] Usual errors of the point of touch, of a centroid, of a height. Larger: no effect
# with many touches.
POINT_NOISE, CENTROID_NOISE, HEIGHT_NOISE = 8e-4, 0.1, 1e-3
SIDE = 0.62  # Derived: side of a hexagon, relative to the square root of its area.
Key = TypeVar("Key")


class Unknown(NamedTuple):
    """One number that the touches determine."""

    kind: str  # one of `self_touch.PRIORS`
    owner: str | int  # joint, tip, or position of a patch in the session
    axis: int = 0


@dataclass(frozen=True, eq=False)
class Side:
    """Points of skins that felt touches; row i of every array is the same touch."""

    touches: IntArray  # (m,) in the session
    patches: IntArray  # (m,)
    points: Array  # (m, 3) in the frame of the link [m]
    spreads: Array  # (m, 3) by which the point moves with the unknown "spot" [m]
    arms: Array  # (m, 2) of the point from the middle of the flat skin, along and across the rows [m]
    axes: Array  # (m, 3, 3) along the row, across it, outward
    frames: Array  # (m, 3, 3) the same, turned so that the first one is the best known
    sigmas: Array  # (m, 2) usual errors along the first two [m]
    classes: IntArray  # (m, 2) 0: one taxel, 1: centroid


class Model:
    """Residuals of touches, and their derivatives with the unknowns."""

    def __init__(self, robot: Robot, session: Session, unknowns: Sequence[Unknown] | None = None):
        self.robot, self.session, n = robot, session, len(session.lines)
        self.felt = points_of(session, dict(enumerate(session.felt)))
        self.skins = points_of(session, {k: b for k, b in enumerate(session.bodies) if isinstance(b, Felt)})
        self.tips = _rows_of([body if isinstance(body, Tip) else None for body in session.bodies])
        links = [link for link, _ in session.patches]
        self.links = [
            [links[felt.patch] for felt in session.felt],
            [links[body.patch] if isinstance(body, Felt) else body.link for body in session.bodies],
        ]
        self._rows = [_rows_of(names) for names in self.links]
        self._check()
        self.unknowns = tuple(self._unknowns() if unknowns is None else unknowns)
        self.column = {unknown: k for k, unknown in enumerate(self.unknowns)}
        self.sigmas = np.column_stack((self.felt.sigmas, np.full(n, HEIGHT_NOISE)))
        self.classes = np.column_stack((self.felt.classes, np.full(n, 2)))
        at = self.skins.touches
        self.sigmas[at, :2] = np.hypot(self.sigmas[at, :2], self.skins.sigmas)  # the normals are opposite
        self.classes[at, :2] = np.minimum(self.classes[at, :2], self.skins.classes)

    def _check(self) -> None:
        """Check that each touch is between two links that move relative to each other, with known joints."""
        for k, (felt, body) in enumerate(zip(*self.links)):
            where = f"Line {self.session.lines[k]}: "
            moving = self.moving(felt, body)
            if not moving:
                message = f"{where}no joint moves {body}, which touched, relative to {felt}, which felt it."
                raise CalibrationFormatError(f"{message} Name the tip and the taxel of the touch.")
            if missing := [name for name in moving if name not in self.session.positions]:
                message = f"{where}the table has no column of {listed(missing)}, between {felt} and {body}"
                known = did_you_mean(missing[0].lower(), self.session.unused) or "."
                raise CalibrationFormatError(f"{message}{known} Add the angles.")

    def moving(self, felt: str, body: str) -> list[str]:
        """Return the joints that move one link relative to another."""
        if (felt, body) not in self._cache:
            a, b = (carried(self.robot, link, {})[1] for link in (felt, body))
            both = {name: (a.get(name, np.zeros((1, 6))), b.get(name, np.zeros((1, 6)))) for name in (a | b)}
            self._cache[felt, body] = [name for name, (x, y) in both.items() if not np.array_equal(x, y)]
        return self._cache[felt, body]

    @cached_property
    def _cache(self) -> dict[tuple[str, str], list[str]]:
        return {}

    def of_skin(self, k: int) -> BoolArray:
        """Return which touches (n,) a skin felt."""
        found = self.felt.patches == k
        found[self.skins.touches[self.skins.patches == k]] = True
        return found

    def _unknowns(self) -> Iterator[Unknown]:
        """Yield the unknowns: offsets of joints, tips, and of all skins of the touched links."""
        for name in dict.fromkeys(name for pair in zip(*self.links) for name in self.moving(*pair)):
            yield Unknown("slide" if self.robot.joints[name].type == "prismatic" else "joint", name)
        yield from (Unknown("tip", tip.name, axis) for tip in self.tips for axis in range(3))
        sides = (*self.felt.patches.tolist(), *self.skins.patches.tolist())
        touched = {self.session.patches[k][0] for k in sides}
        for k, (link, patch) in enumerate(self.session.patches):
            if link in touched:
                is_free = patch.kind == "imported"
                yield from (Unknown("position" if is_free else "shift", k, axis) for axis in range(3 if is_free else 2))
                yield from (Unknown("rotation", k, axis) for axis in range(3)) if is_free else (Unknown("turn", k),)
                yield Unknown("height", k)
        if self.felt.spreads.any() or self.skins.spreads.any():
            yield Unknown("spot", "")

    def linearized(self, values: Array, positions: Mapping[str, Array] | None = None) -> tuple[Array, Array]:
        """Return the residuals (n, 3) [m] for values of the unknowns (p,), and their derivatives (n, 3, p).

        Without positions (n,) of the joints, they are those of the session.
        """
        positions = positions or self.session.positions
        n, column = len(self.session.lines), self.column
        felt, along_felt = self.points(self.felt, values)
        body, along_body = np.empty((n, 3)), np.zeros((n, 3, len(values)))
        at = self.skins.touches
        body[at], along_body[at] = self.points(self.skins, values)
        for tip, mine in self.tips.items():
            columns = [column.get(Unknown("tip", tip.name, axis), -1) for axis in range(3)]
            body[mine] = tip.position
            if min(columns) >= 0:
                body[mine] += values[columns]
                along_body[mine[:, None], np.arange(3), columns] = 1.0
        poses, twists = zip(*(self._carried(rows, values, positions) for rows in self._rows))
        (turn_f, at_f), (turn_b, at_b) = ((pose[:, :3, :3], pose[:, :3, 3]) for pose in poses)
        point = np.einsum("nij,nj->ni", turn_b, body) + at_b
        to_axes = self.felt.frames @ np.swapaxes(turn_f, 1, 2)
        residual = np.einsum("nij,nj->ni", to_axes, point - at_f) - np.einsum("nij,nj->ni", self.felt.frames, felt)
        moving = twists[1] - twists[0]  # (n, p, 6)
        motion = np.cross(moving[..., :3], point[:, None]) + moving[..., 3:]
        slopes = to_axes @ (np.swapaxes(motion, 1, 2) + turn_b @ along_body) - self.felt.frames @ along_felt
        return residual, slopes

    def _carried(self, rows: dict[str, IntArray], values: Array, positions: Mapping[str, Array]) -> tuple[Array, Array]:
        """Return the poses (n, 4, 4) of the link of each touch, and the twists (n, p, 6) by the offsets of joints."""
        n = len(self.session.lines)
        poses, twists = np.empty((n, 4, 4)), np.zeros((n, len(values), 6))
        offsets = {u.owner: k for k, u in enumerate(self.unknowns) if u.kind in ("joint", "slide")}
        positions = {name: at + (values[offsets[name]] if name in offsets else 0.0) for name, at in positions.items()}
        for link, mine in rows.items():
            poses[mine], found = carried(self.robot, link, {name: at[mine] for name, at in positions.items()})
            for name, twist in found.items():
                if name in offsets:
                    twists[mine, offsets[name]] = twist
        return poses, twists

    def points(self, side: Side, values: Array) -> tuple[Array, Array]:
        """Return the points (m, 3) of skins in the frames of their links [m], and their derivatives (m, 3, p)."""
        slopes = np.zeros((len(side.touches), 3, len(values)))
        points, normals = side.points + USUAL_SPOT * side.spreads, side.axes[:, 2]
        spot = self.column.get(Unknown("spot", ""))
        if spot is not None:
            points = points + values[spot] * side.spreads
            slopes[:, :, spot] = side.spreads
        for k in np.unique(side.patches).tolist():
            mine = np.flatnonzero(side.patches == k)
            unknowns = [
                (u, j) for u, j in self.column.items() if u.owner == k and u.kind not in ("tip", "joint", "slide")
            ]
            rotation = [values[j] for u, j in unknowns if u.kind == "rotation"]
            if rotation:
                middle = self.session.patches[k][1].taxels.positions_link.mean(axis=0)
                vector = np.array(rotation)
                turn = rotation_about(unit(vector), np.linalg.norm(vector))
                arms = (points[mine] - middle) @ turn.T
                points[mine] = middle + arms
                slopes[mine] = turn @ slopes[mine]
            for (kind, _, axis), j in unknowns:
                if kind == "rotation":
                    slopes[mine, :, j] = np.cross(np.eye(3)[axis], arms)
                    continue
                if kind == "position":
                    direction = np.tile(np.eye(3)[axis], (len(mine), 1))
                elif kind == "shift":
                    direction = side.axes[mine, axis]
                elif kind == "turn":
                    x, y = side.arms[mine].T
                    direction = x[:, None] * side.axes[mine, 1] - y[:, None] * side.axes[mine, 0]
                else:
                    direction = normals[mine]
                points[mine] += values[j] * direction
                slopes[mine, :, j] = direction
        return points, slopes


def _rows_of(items: Sequence[Key | None]) -> dict[Key, IntArray]:
    """Return where each item is."""
    return {
        key: np.array([k for k, other in enumerate(items) if other == key])
        for key in dict.fromkeys(items)
        if key is not None
    }


def points_of(session: Session, touched: dict[int, Felt]) -> Side:
    """Return the points of skins that felt touches, by their numbers."""
    n = len(touched)
    points, spreads, arms, axes = np.empty((n, 3)), np.empty((n, 3)), np.empty((n, 2)), np.empty((n, 3, 3))
    frames, sigmas, classes = np.empty((n, 3, 3)), np.empty((n, 2)), np.zeros((n, 2), np.int64)
    for k, felt in enumerate(touched.values()):
        patch = session.patches[felt.patch][1]
        taxels, readings = patch.taxels, np.zeros((1, len(patch.taxels.ids)))
        readings[0, list(felt.rows)] = felt.readings
        row = _strongest(patch, felt)
        several = readings if len(felt.rows) > 1 else readings[:, :0]
        known, centroid, border = (part[0] for part in felt_by_several(patch, np.array([row]), several))
        size, flat = float(np.sqrt(taxels.areas[row])), flat_places(patch, taxels.index)
        axes[k] = np.vstack((taxels.axes_link[row], taxels.normals_link[row]))
        offset, spread = (known.T @ known @ vector for vector in (border, centroid - border))
        points[k] = taxels.positions_link[row] + offset @ axes[k, :2]
        spreads[k] = spread @ axes[k, :2]
        arms[k] = flat[row] + offset - flat.mean(axis=0)
        count = int(known.any(axis=1).sum())
        best = known[known.any(axis=1)][0] if count else np.array((1.0, 0.0))
        frames[k] = np.vstack((best @ axes[k, :2], np.array((-best[1], best[0])) @ axes[k, :2], axes[k, 2]))
        classes[k, :count] = 1
        is_edge = patch.kind == "hexagons" and count == 1  # between two boards: along their common side
        spans = np.where(classes[k] == 1, CENTROID_NOISE, (SIDE if is_edge else 1.0) / np.sqrt(12)) * size
        sigmas[k] = np.hypot(spans, POINT_NOISE)
    patches = np.array([felt.patch for felt in touched.values()], np.int64)
    return Side(np.array([*touched], np.int64), patches, points, spreads, arms, axes, frames, sigmas, classes)


def _strongest(patch: Patch, felt: Felt) -> int:
    """Return the taxel with the largest reading; of several, the one nearest to their mean."""
    rows, readings = np.array(felt.rows), np.array(felt.readings)
    rows = rows[readings == readings.max()]
    positions = patch.taxels.positions_link[rows]
    return int(rows[((positions - positions.mean(axis=0)) ** 2).sum(axis=1).argmin()])
