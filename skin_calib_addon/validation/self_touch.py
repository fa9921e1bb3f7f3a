r"""What touches of a robot on its own skins show: errors of the joints, the tips and the skins in one least squares.

A touch states that two points are at one place: the point :math:`\mathbf{f}` of the skin that felt it, and the point
:math:`\mathbf{b}` of what touched, a tip or another skin. In the frame of the skin the residual is

.. math::

    \mathbf{r} = E \left( T_{\text{felt}}^{-1}(\mathbf{q} + \delta)\, T_{\text{body}}(\mathbf{q} + \delta)\, \mathbf{b}
    - \mathbf{f} \right)

with the offsets :math:`\delta` of the joints, and the rows of :math:`E` along the skin, across, and outward. The
residuals have Student's distribution, so that a wrong touch counts little. Its tails are estimated, and its scales: one
for touches that one taxel felt, one for centroids, one for heights. The unknowns have normal distributions, whose
scales are estimated from all unknowns of one kind, starting from those of `PRIORS`. The result is the most probable
one, with the covariance of its neighbourhood.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import lgamma
from typing import Any, NamedTuple, TypeVar

import numpy as np

from ..calibration.model import Patch
from ..common.arrays import Array, BoolArray, IntArray, unit
from ..common.errors import CalibrationFormatError, listed
from ..common.findings import did_you_mean
from ..common.warnings import Warning
from ..robot.kinematics import carried, rotation_about
from ..robot.urdf import Robot
from .flat import flat_places
from .placement import MAX_UNEXPLAINED, OUTLIER_CELLS, felt_by_several
from .registration import USUAL_SHIFT, USUAL_TURN
from .self_touch_session import Felt, Session, Tip

# [rad, m, 1] Usual errors before any touch. Larger: what touches determine weakly has larger errors.
PRIORS = {
    "joint": float(np.deg2rad(0.7)),
    "slide": 1e-3,  # of a prismatic joint
    "tip": 5e-3,
    "shift": USUAL_SHIFT,
    "turn": USUAL_TURN,
    "height": 1.5e-3,  # of the point that touches above the taxels
    "position": 1e-2,  # of imported taxels
    "rotation": USUAL_TURN,  # likewise
    "spot": 0.3,  # motion of the contact, relative to that of the centroid
}
USUAL_SPOT = 0.8  # [1] of the unknown "spot"; `registration.SPOTS` has its range
# [m, fraction of the cell size, m] Usual errors of the point of touch, of a centroid, of a height. Larger: no effect
# with many touches.
POINT_NOISE, CENTROID_NOISE, HEIGHT_NOISE = 8e-4, 0.1, 1e-3
SIDE = 0.62  # Derived: side of a hexagon, relative to the square root of its area.
# [1] Number of unknowns, and of residuals, that the usual ones count for. Larger: adapts less to the touches.
PRIOR_WEIGHT, NOISE_WEIGHT = 3.0, 4.0
FREEDOMS = (10.0, 20.0, 50.0)  # [1] of Student's distribution; the most probable one. Smaller: outliers count less.
MAX_STEPS = 100  # Larger: slow convergence takes longer before it ends.
STEP_TOLERANCE = 1e-3  # [standard deviations] of the last step. Larger: less exact.
# [1] Part of the variance of an unknown that a combination causes, from which on the combination names it.
MIN_PART = 0.4
# [1] Part of a combination that the touches have to determine. Larger: names more combinations.
MIN_LEARNT = 0.5
ANGULAR = ("joint", "turn", "rotation")  # unknowns in radians
NUISANCE = ("height", "spot")  # unknowns of which no warning is given alone
ROWS = ("along the rows", "across the rows")
Key = TypeVar("Key")


class Unknown(NamedTuple):
    """One number that the touches determine."""

    kind: str  # one of PRIORS
    owner: str | int  # joint, tip, or position of a patch in the session
    axis: int = 0


@dataclass(frozen=True, eq=False)
class _Side:
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
        self.felt = _side(session, dict(enumerate(session.felt)))
        self.skins = _side(session, {k: b for k, b in enumerate(session.bodies) if isinstance(b, Felt)})
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
                message = f"{where}the table has no column of {listed(missing)}, which move {body} relative to {felt}"
                known = did_you_mean(missing[0].lower(), self.session.unused)
                raise CalibrationFormatError(f"{message}{known}. Add the angles.")

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

    def points(self, side: _Side, values: Array) -> tuple[Array, Array]:
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


@dataclass(frozen=True, eq=False)
class SelfTouch:
    """Errors of joints, tips and skins that touches of a robot on itself show."""

    model: Model
    values: Array  # (p,) of the unknowns [rad, m]
    covariance: Array  # (p, p)
    priors: Array  # (p,) standard deviations without the touches
    scales: Array  # (3,) of the residuals, relative to the usual ones: one taxel, centroid, height
    residuals: Array  # (n, 3) along the skin and outward [m]

    @property
    def errors(self) -> Array:
        """Standard errors of the unknowns, shape (p,)."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def learnt(self) -> Array:
        """Part of each unknown that the touches determine, shape (p,): 1 - variance / variance without touches."""
        return np.clip(1 - np.diag(self.covariance) / self.priors**2, 0.0, 1.0)

    def owner(self, unknown: Unknown) -> str:
        """Return whose number an unknown is: joint, tip or skin."""
        if unknown.kind in ("joint", "slide", "spot"):
            return str(unknown.owner) or "contacts"
        if unknown.kind == "tip":
            return f"tip {unknown.owner}"
        link, patch = self.model.session.patches[int(unknown.owner)]
        return f"{link}/{patch.name}"

    def name(self, unknown: Unknown) -> str:
        """Return an unknown in words."""
        words = {
            "tip": "the {axis} of ",
            "shift": "the shift {row} of ",
            "position": "the shift in {axis} of ",
            "turn": "the rotation of ",
            "rotation": "the rotation about {axis} of ",
            "height": "the height over ",
            "spot": "the size of the ",
        }
        part = words.get(unknown.kind, "").format(axis="xyz"[unknown.axis], row=ROWS[unknown.axis % 2])
        return part + self.owner(unknown)

    def amount(self, k: int, value: float) -> str:
        """Return a value of an unknown with its unit."""
        kind = self.model.unknowns[k].kind
        size, unit = (np.rad2deg(value), " degrees") if kind in ANGULAR else (value * 1e3, " mm")
        return f"{value:.2f}" if kind == "spot" else f"{size:+.2f}{unit}"

    def summary(self) -> Iterator[tuple[str, str]]:
        """Yield joints, tips and skins, with their errors, standard errors, and the part that the touches determine."""
        parts: dict[str, list[str]] = {}
        for k, unknown in enumerate(self.model.unknowns):
            if unknown.kind != "spot":
                error = self.amount(k, self.errors[k]).lstrip("+")
                what = self.name(unknown).removesuffix(self.owner(unknown)).removeprefix("the ")
                what = what.removesuffix(" of ").removesuffix(" over ")
                text = f"{what} {self.amount(k, self.values[k])} +- {error} ({100 * self.learnt[k]:.0f} %)".lstrip()
                parts.setdefault(self.owner(unknown), []).append(text)
        yield from ((name, ", ".join(found)) for name, found in parts.items())
        along = np.sqrt((self.residuals[~self.unexplained, :2] ** 2).mean()) * 1e3
        upright = np.sqrt((self.residuals[~self.unexplained, 2] ** 2).mean()) * 1e3
        yield "residuals", f"rms {along:.2f} mm per axis along the skin, {upright:.2f} mm outward"

    def offsets(self) -> dict[str, Any]:
        """Return the errors of joints and tips as JSON values: true position = position of the session + offset."""
        joints, tips = dict[str, Any](), dict[str, Any]()
        for k, unknown in enumerate(self.model.unknowns):
            numbers = {
                "offset": float(self.values[k]),
                "sigma": float(self.errors[k]),
                "learnt": round(float(self.learnt[k]), 3),
            }
            if unknown.kind in ("joint", "slide"):
                joints[str(unknown.owner)] = {**numbers, "unit": "rad" if unknown.kind == "joint" else "m"}
            elif unknown.kind == "tip":
                tips.setdefault(str(unknown.owner), {})["xyz"[unknown.axis]] = {**numbers, "unit": "m"}
        return {"format": "skin-joint-offsets", "version": 1, "joints": joints, "tips": tips}

    def distances(self, session: Session) -> Array:
        """Return how far the two points of each touch of a session are from each other, shape (n,) [m]."""
        other = Model(self.model.robot, session, self.model.unknowns)
        return np.linalg.norm(other.linearized(self.values)[0], axis=1)

    def of_patch(self, k: int) -> dict[Unknown, int]:
        """Return the unknowns of a skin that move it, with their positions; empty if its link was not touched."""
        moving = ("shift", "turn", "position", "rotation")
        return {u: j for j, u in enumerate(self.model.unknowns) if u.owner == k and u.kind in moving}

    def rotation(self, k: int) -> Array:
        """Return the rotation vector of a skin (3,) [rad]: of an imported one in its link, else about the normal."""
        turns = [self.values[j] for u, j in self.of_patch(k).items() if u.kind in ("turn", "rotation")]
        return np.array(turns) if len(turns) == 3 else np.array((0.0, 0.0, *turns))

    def covariance_of(self, k: int) -> Array:
        """Return the covariance (3, 3) of the shift and the rotation of a skin, or (6, 6) of an imported one."""
        columns = list(self.of_patch(k).values())
        return self.covariance[np.ix_(columns, columns)]

    def displacements(self, k: int) -> tuple[Array, Array]:
        """Return the displacements (n, 3) [m] of the taxels of a skin, and their covariances (n, 3, 3) [m^2]."""
        patch, columns = self.model.session.patches[k][1], list(self.of_patch(k).values())
        rows = [Felt(k, (row,), (1.0,)) for row in range(len(patch.taxels.ids))]
        side, values = _side(self.model.session, dict(enumerate(rows))), np.zeros(len(self.values))
        values[columns] = self.values[columns]
        points, slopes = self.model.points(side, values)
        slopes = slopes[:, :, columns]
        return points - patch.taxels.positions_link, slopes @ self.covariance_of(k) @ np.swapaxes(slopes, 1, 2)

    @cached_property
    def unexplained(self) -> BoolArray:
        """Touches (n,) that are far from where they were felt."""
        patches = self.model.session.patches
        far = OUTLIER_CELLS * np.array([max(patches[k][1].pitch) for k in self.model.felt.patches])
        return np.asarray(np.linalg.norm(self.residuals, axis=1) > np.maximum(far, 3 * HEIGHT_NOISE))

    @cached_property
    def combinations(self) -> tuple[dict[int, float], ...]:
        """Combinations of unknowns that the touches do not determine: values that leave the touches as they are.

        They are the singular vectors of the derivatives in units of the priors whose singular values are below 1, and
        sums of them with as few unknowns as possible.
        """
        scaled = self.covariance / np.outer(self.priors, self.priors)
        variances, vectors = np.linalg.eigh(scaled)
        space = vectors[:, variances > 1 - MIN_LEARNT]
        found = []
        while space.shape[1]:
            sizes = np.linalg.norm(space, axis=1)
            first = int(sizes.argmax())
            direction = space @ space[first] / sizes[first]
            variance = float(direction @ scaled @ direction)
            named = np.flatnonzero(direction**2 * variance > MIN_PART * np.diag(scaled))
            found.append({int(k): float(direction[k] * self.priors[k]) for k in named})
            left = space - np.outer(direction, direction @ space)
            space = np.linalg.svd(left, full_matrices=False)[0][:, : space.shape[1] - 1]
        return tuple(found)

    def warnings(self) -> Iterator[Warning]:
        """Yield warnings: touches elsewhere, and combinations of unknowns that the touches do not determine."""
        lines = [f"line {line}" for line in self.model.session.lines[self.unexplained].tolist()]
        if lines:
            message = (
                f"{len(lines)} of {len(self.residuals)} touches are far from where they were felt: {listed(lines)}."
            )
            advice = "Check the channels of their taxels, and the angles."
            yield Warning("self-touch-outliers", "warning", message, value=float(len(lines)), advice=advice)
        for found in self.combinations:
            if all(self.model.unknowns[k].kind in NUISANCE for k in found):
                continue
            parts = [(self.name(self.model.unknowns[k]), self.amount(k, value)) for k, value in found.items()]
            advice = "Touch in other postures."
            message = f"The touches hardly determine {parts[0][0]}."
            if len(parts) > 1:
                names = " and ".join(name for name, _ in parts)
                together = " and ".join(f"{name} by {amount}" for name, amount in parts)
                message = f"The touches hardly separate {names}: {together} together change nothing."
            yield Warning("not-separated", "note", message, advice=advice)

    @property
    def is_explained(self) -> bool:
        """Whether the unknowns explain most touches, so that they say something."""
        return bool(self.unexplained.sum() <= MAX_UNEXPLAINED * len(self.unexplained))


def fit_self_touch(robot: Robot, session: Session) -> SelfTouch:
    """Return the errors of joints, tips and skins that explain the touches of a session."""
    model = Model(robot, session)
    kinds = np.array([unknown.kind for unknown in model.unknowns])
    usual = np.array([PRIORS[kind] for kind in kinds])
    priors, values = usual.copy(), np.zeros(len(kinds))
    residuals, slopes = model.linearized(values)
    scales = np.maximum(1.0, _by_class(np.abs(residuals) / model.sigmas, model.classes, np.median))
    for _ in range(MAX_STEPS):
        sigmas = model.sigmas * scales[model.classes]
        distances = ((residuals / sigmas) ** 2).sum(axis=1)
        freedom = max(FREEDOMS, key=lambda freedom: _log_student(distances, freedom))
        weights = (freedom + 3) / (freedom + distances)
        factors = np.sqrt(weights)[:, None] / sigmas
        A = (slopes * factors[..., None]).reshape(-1, len(values))
        z = (residuals * factors).ravel()
        precision = A.T @ A + np.diag(priors**-2)
        step = -np.linalg.solve(precision, A.T @ z + values / priors**2)
        # the expected curvature of Student's distribution is below that of the weighted squares
        covariance = np.linalg.inv((freedom + 3) / (freedom + 5) * A.T @ A + np.diag(priors**-2))
        values = values + step
        residuals, slopes = model.linearized(values)
        free = 1 - np.einsum("ip,pq,iq->i", A, covariance, A).reshape(residuals.shape)
        before = scales
        squares = weights[:, None] * (residuals / model.sigmas) ** 2
        total = [_by_class(part, model.classes, np.sum) for part in (squares, np.maximum(free, 0.0))]
        scales = np.sqrt((total[0] + NOISE_WEIGHT) / (total[1] + NOISE_WEIGHT))
        second = values**2 + np.diag(covariance)
        for kind in set(kinds.tolist()):
            of = kinds == kind
            count = PRIOR_WEIGHT * usual[of][0] ** 2
            priors[of] = np.sqrt((second[of].sum() + count) / (of.sum() + PRIOR_WEIGHT))
        is_done = (np.abs(step) / np.sqrt(np.diag(covariance))).max() < STEP_TOLERANCE
        if is_done and np.abs(scales / before - 1).max() < STEP_TOLERANCE:
            break
    return SelfTouch(model, values, covariance, priors, scales, residuals)


def _log_student(distances: Array, freedom: float) -> float:
    """Return the log likelihood of squared distances (n,) in Student's distribution of three dimensions."""
    constant = lgamma((freedom + 3) / 2) - lgamma(freedom / 2) - 1.5 * np.log(freedom)
    return float((constant - (freedom + 3) / 2 * np.log1p(distances / freedom)).sum())


def _rows_of(items: Sequence[Key | None]) -> dict[Key, IntArray]:
    """Return where each item is."""
    return {
        key: np.array([k for k, other in enumerate(items) if other == key])
        for key in dict.fromkeys(items)
        if key is not None
    }


def _by_class(values: Array, classes: IntArray, function: Callable[[Array], Any]) -> Array:
    """Return a function of the values of each class, shape (3,); 0 for a class without values."""
    return np.array([float(function(values[classes == k])) if (classes == k).any() else 0.0 for k in range(3)])


def _side(session: Session, touched: dict[int, Felt]) -> _Side:
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
    return _Side(np.array([*touched], np.int64), patches, points, spreads, arms, axes, frames, sigmas, classes)


def _strongest(patch: Patch, felt: Felt) -> int:
    """Return the taxel with the largest reading; of several, the one nearest to their mean."""
    rows, readings = np.array(felt.rows), np.array(felt.readings)
    rows = rows[readings == readings.max()]
    positions = patch.taxels.positions_link[rows]
    return int(rows[((positions - positions.mean(axis=0)) ** 2).sum(axis=1).argmin()])
