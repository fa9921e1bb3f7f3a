"""What touches of a robot on its own skins show: errors of the joints, the tips and the skins in one least squares.

The residuals of :mod:`.self_touch_model` have Student's distribution, so that a wrong touch counts little. Its tails
are estimated, and its scales: one for touches that one taxel felt, one for centroids, one for heights. The unknowns
have normal distributions, whose scales are estimated from all unknowns of one kind, starting from those of `PRIORS`.
The result is the most probable one, with the covariance of its neighbourhood.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from math import lgamma
from typing import Any

import numpy as np

from ..common.arrays import Array, BoolArray, IntArray
from ..common.errors import listed
from ..common.warnings import Warning
from ..robot.urdf import Robot
from .placement import MAX_UNEXPLAINED, OUTLIER_CELLS
from .registration import USUAL_SHIFT, USUAL_TURN
from .self_touch_model import HEIGHT_NOISE, Model, Unknown, points_of
from .self_touch_session import Felt, Session

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
        side, values = points_of(self.model.session, dict(enumerate(rows))), np.zeros(len(self.values))
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


def _by_class(values: Array, classes: IntArray, function: Callable[[Array], Any]) -> Array:
    """Return a function of the values of each class, shape (3,); 0 for a class without values."""
    return np.array([float(function(values[classes == k])) if (classes == k).any() else 0.0 for k in range(3)])
