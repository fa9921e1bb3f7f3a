r"""The motion of a skin that its touches show, with its covariance.

A touch says in which cell its position is, and nothing more where one taxel felt it. Where several did, their
force-weighted centroid is near the position. The probability of what a touch reports, for a motion :math:`\theta` of
the skin and a fraction :math:`\epsilon` of touches that report anything, relative to that of a report by chance:

.. math::

    \frac{p_i(\theta)}{p_0} = \epsilon + (1 - \epsilon) \begin{cases}
    n\, \Phi(d_i(\theta) / \sigma_e) & \text{one cell of } n \\
    A\, N(\mathbf{r}_i(\theta); \sigma_c^2 I) & \text{a centroid, on a skin of the area } A \end{cases}

with the depth :math:`d` of the position inside the cell and its distance :math:`\mathbf{r}` from the centroid. The
product with the distribution of glued skins is integrated on a grid. A standard error is the standard deviation of the
result. Positions on a raster that keeps in step with the cells leave every motion within a cell possible, and the
standard error states this. That of a least-squares fit does not.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from typing import NamedTuple

import numpy as np

from ..calibration.model import Patch
from ..common.arrays import Array, IntArray
from .flat import flat_places

# [m, rad] Usual displacement and rotation of a glued skin: half of their scales. Larger: a displacement of a cell is a
# lesser reason to assume another order of the channels, and touches on a raster have larger standard errors.
USUAL_SHIFT, USUAL_TURN = 4e-3, np.deg2rad(3.0)
# [m, rad] Limits of a motion from the usual one. Larger: finds skins that are mounted elsewhere, with coarser steps.
MAX_SHIFT, MAX_TURN = 25e-3, np.deg2rad(20.0)
# [m] Errors of the position of the probe. More: noise that differs from all of them has better standard errors.
EDGE_NOISES = (4e-4, 1.2e-3)
# [fraction of the cell size] Distances of a centroid from the position, per axis. More: better standard errors.
CENTROID_NOISES = (0.03, 0.05, 0.08, 0.13, 0.2, 0.35)
# [1] A small spot loads two cells only if it is near their border, where the centroid moves faster than the position.
# The ratios of both; 1 for large spots. More: more exact.
SPOTS = (0.25, 0.4, 0.6, 0.8, 1.0)
# [1] Logarithm of the odds from which on a noise is left out. Larger: more time, no effect.
MAX_LOG_ODDS = 5.0
# [1] Cosine of the angle between a known axis and the normal of a side from which on the side is left out. Larger:
# counts the error of the probe twice.
MAX_SIDE_COSINE = 0.7
# [fraction of the cell size] Touches whose positions in their cells are nearer are alike. Larger: random touches are
# alike. Smaller: the noise of the probe hides a raster.
PHASE_RADIUS = 0.15
# [fraction of the cell size] Standard error of a shift up to which it can explain touches. Larger: a shift that nothing
# determines explains touches of wrong channels.
MAX_UNCERTAIN = 0.15
FADE = 0.7  # [1] of the blur from grid to grid. Larger: more grids. Smaller: may miss the best motion.
# [1] Fractions of the touches that report anything. More: better standard errors with many wrong channels.
CHANCES = (0.03, 0.1, 0.3)
LOGISTIC_SCALE = 1.702  # [1] a logistic function of 1.702 x differs from the normal distribution of x by at most 0.01
GRID_POINTS = 11  # per parameter. Larger: more exact, more time.
HALF_WIDTH = 3.5  # of the grid in standard deviations. Larger: covers rarer motions, coarser.
MAX_ROUNDS = 30  # of grids. Larger: no effect after convergence.
ROUND_TOLERANCE = 0.02  # [1] relative change of the standard deviations in the last round. Larger: less exact.
# [1] squared Mahalanobis distance of a significant motion: one in a hundred skins that did not move exceeds it
# (chi-squared, three parameters). Larger: fewer significant motions.
MIN_SQUARED_DISTANCE = 11.34


@dataclass(frozen=True, eq=False)
class Motion:
    """Translation of a skin on its surface, and rotation about the point where their errors are independent."""

    middle: Array  # (2,) this point, along and across the rows of the flat skin [m]
    shift: Array  # (2,) along and across the rows [m]
    turn: float  # counter-clockwise seen from outside [rad]; zero if the touches are too near to each other
    covariance: Array  # (3, 3) of shift and rotation [m, m, rad]; that of an unknown rotation is infinite

    @property
    def shift_error(self) -> Array:
        """Standard errors of the shift, shape (2,) [m]."""
        return np.sqrt(np.diag(self.covariance)[:2])

    @property
    def turn_error(self) -> float:
        """Standard error of the rotation [rad]; infinite if the touches do not determine it."""
        return float(np.sqrt(self.covariance[2, 2]))

    @property
    def is_certain(self) -> bool:
        """Whether the motion is significant."""
        k = 3 if np.isfinite(self.turn_error) else 2
        moved = np.append(self.shift, self.turn)[:k]
        return bool(moved @ np.linalg.solve(self.covariance[:k, :k], moved) > MIN_SQUARED_DISTANCE)

    @property
    def left_out(self) -> "Motion":
        """No motion, with the standard errors of a skin that stays although it may have moved like this."""
        moved = np.append(self.shift, self.turn)
        return replace(self, shift=np.zeros(2), turn=0.0, covariance=self.covariance + np.outer(moved, moved))

    @property
    def about_origin(self) -> Array:
        """The motion about the origin of the flat skin: along, across [m], rotation [rad]."""
        return np.asarray(_moving(-self.middle) @ np.append(self.shift, self.turn))

    def at(self, flat: Array) -> Array:
        """Return the displacement of flat positions (k, 2) along and across the rows, shape (k, 2) [m]."""
        return self.shift + self.turn * _across(flat - self.middle)

    def sigma_at(self, flat: Array) -> Array:
        """Return the standard errors of these displacements, shape (k, 2) [m]."""
        arms = _across(flat - self.middle)
        turned = np.multiply(arms, self.turn_error, out=np.zeros(arms.shape), where=arms != 0)  # it can be infinite
        out: Array = np.sqrt(self.shift_error**2 + turned**2)
        return out


class Noise(NamedTuple):
    """How touches deviate from an ideal report; one of many guesses that the touches weight."""

    edge: float  # of the position of the probe [m]
    spread: float  # of a centroid along an axis [fraction of the cell size]
    spot: float  # distance of the position from the border of the cells, relative to that of the centroid [1]
    chance: float  # fraction of the touches that report anything [1]


NOISES = tuple(map(Noise._make, product(EDGE_NOISES, CENTROID_NOISES, SPOTS, CHANCES)))


@dataclass(frozen=True, eq=False)
class Evidence:
    """What touches report of a skin; row i of every array is the same touch."""

    offsets: Array  # (m, 2) from the felt taxel to the position of the touch [m]
    arms: Array  # (m, 2) flat position of this taxel [m]
    corners: Array  # (m, k, 2) of its cell, in either direction, relative to it [m]
    axes: Array  # (m, 2, 2) unit vectors along which several taxels felt it; zero for the others
    centroids: Array  # (m, 2) of the force, relative to the taxel [m]
    borders: Array  # (m, 2) middle of the border between the cells that felt it, relative to the taxel [m]
    cells: int  # of the skin
    cell_size: float  # of one [m]
    planned: Array  # (3,) motion that returns the skin to where it was planned to be
    weights: Array  # (m,) how much new each touch says [1]
    noise: Array  # (m,) least error of the position, per axis [m]

    @classmethod
    def of_cells(
        cls, patch: Patch, rows: IntArray, offsets: Array, planned: Array, weights: Array, noise: Array
    ) -> "Evidence":
        """Return what touches report that one taxel each felt."""
        taxels, none = patch.taxels, np.zeros((len(rows), 2))
        size, arms = float(np.sqrt(taxels.areas.mean())), flat_places(patch, taxels.index[rows])
        corners, axes = taxels.flat_corners[rows], np.zeros((len(rows), 2, 2))
        return cls(offsets, arms, corners, axes, none, none, len(taxels.ids), size, planned, weights, noise)

    @cached_property
    def _halfplanes(self) -> tuple[Array, Array]:
        """Slopes (3, m k) and constants (m, k) of the depth inside each side of a cell, linear in the motion."""
        sides = np.roll(self.corners, -1, axis=1) - self.corners
        lengths = np.linalg.norm(sides, axis=2)
        is_side = lengths > 1e-9  # a corner can be listed twice
        hand = np.sign((self.corners[..., 0] * sides[..., 1] - self.corners[..., 1] * sides[..., 0]).sum(axis=1))
        inward = np.stack((-sides[..., 1], sides[..., 0]), axis=2) * hand[:, None, None]
        inward /= np.where(is_side, lengths, 1.0)[..., None]
        constant = ((self.offsets[:, None] - self.corners) * inward).sum(axis=2)
        turning = (inward * _across(self.arms)[:, None]).sum(axis=2)
        slopes = -np.concatenate((inward, turning[..., None]), axis=2)
        # along a known axis the centroid says more, and it has the same error of the probe
        is_side &= (np.abs(np.einsum("msc,mkc->msk", inward, self.axes)) < MAX_SIDE_COSINE).all(axis=2)
        return slopes.reshape(-1, 3).T, np.where(is_side, constant, np.inf)

    def depths(self, motions: Array) -> Array:
        """Return how deep in its cell each touch is after motions (g, 3), shape (g, m) [m]; negative outside."""
        slopes, constant = self._halfplanes
        return np.asarray(((motions @ slopes).reshape(len(motions), *constant.shape) + constant).min(axis=2))

    def misses(self, motions: Array, spot: float) -> Array:
        """Return the squared distance of each touch from its centroid along the known axes, shape (g, m) [m^2]."""
        estimates = self.borders + spot * (self.centroids - self.borders)
        constant = np.einsum("mkc,mc->mk", self.axes, self.offsets - estimates)
        turning = np.einsum("mkc,mc->mk", self.axes, _across(self.arms))
        slopes = -np.concatenate((self.axes, turning[..., None]), axis=2)
        return np.asarray(
            (((motions @ slopes.reshape(-1, 3).T).reshape(-1, *constant.shape) + constant) ** 2).sum(axis=2)
        )

    def ratios(self, motions: Array, noises: Sequence[Noise], blur: float = 0.0) -> Iterator[Array]:
        """Yield for each noise how much more probable each report is than by chance, shape (g, m).

        ``blur`` [m] adds to every noise.
        """
        depths, known, inside = self.depths(motions), self.axes.any(axis=2).sum(axis=1), {}
        for edge in {noise.edge for noise in noises}:
            slopes = -LOGISTIC_SCALE / np.hypot(np.maximum(edge, self.noise), blur)
            inside[edge] = self.cells / (1 + np.exp(np.minimum(slopes * depths, 50.0)))
        misses = {spot: self.misses(motions, spot) for spot in {noise.spot for noise in noises}} if known.any() else {}
        near = {}
        for noise in noises:
            if misses and (noise.spread, noise.spot) not in near:
                variance = np.maximum(noise.spread * self.cell_size, self.noise) ** 2 + blur**2
                height = (self.cell_size**2 / (2 * np.pi * variance)) ** (known / 2)
                near[noise.spread, noise.spot] = height * np.exp(-misses[noise.spot] / (2 * variance))
            found = inside[noise.edge]
            yield noise.chance + (1 - noise.chance) * (found * near[noise.spread, noise.spot] if misses else found)

    def probable(self, motion: Array, blur: float) -> list[Noise]:
        """Return the noises that are probable for a motion (3,)."""
        noises = NOISES if self.axes.any() else [n for n in NOISES if n[1:3] == (CENTROID_NOISES[0], SPOTS[0])]
        scores = np.array([float(np.log(ratio[0]) @ self.weights) for ratio in self.ratios(motion[None], noises, blur)])
        return [noises[k] for k in np.flatnonzero(scores > scores.max() - MAX_LOG_ODDS)]

    def explained(self, found: "Posterior | None") -> Array:
        """Return the probability (m,) that each report is not by chance; without a posterior the skin did not move."""
        motion, blur = np.zeros(3), 0.0
        if found is not None:
            motion = found.mean
            error = float(motion_of(found, self.arms.mean(axis=0)).shift_error.max())
            blur = min(error, MAX_UNCERTAIN * self.cell_size)
        noise = max(self.probable(motion, blur), key=lambda noise: noise.edge)._replace(chance=0.0)
        (ratio,) = self.ratios(motion[None], [noise], blur)
        return np.asarray((1 - CHANCES[1]) * ratio[0] / (CHANCES[1] + (1 - CHANCES[1]) * ratio[0]))

    def log_likelihood(self, motions: Array, noises: Sequence[Noise], blur: float) -> Array:
        """Return the logarithm of the probability of all reports relative to chance, shape (g,)."""
        parts = np.array([np.log(ratio) @ self.weights for ratio in self.ratios(motions, noises, blur)])
        return log_mean(parts) + np.log(len(noises))  # the others have no probability

    def log_prior(self, motions: Array) -> Array:
        """Return the logarithm of the probability density of motions of glued skins (g, 3)."""
        away = motions - self.planned
        squares = (away[:, :2] ** 2).sum(axis=1) / USUAL_SHIFT**2
        shift = -1.5 * np.log1p(squares) - np.log(2 * np.pi * USUAL_SHIFT**2)
        turn = -np.log1p((away[:, 2] / USUAL_TURN) ** 2) - np.log(np.pi * USUAL_TURN)
        return np.asarray(shift + turn)


def novelty(offsets: Array, cell_size: float) -> Array:
    """Return how much new each touch says, shape (m,): less where many are at the same position in their cells.

    It is the number of random touches near each other, divided by that of the touches near this one.
    """
    near = PHASE_RADIUS * cell_size
    counts = np.array([(((offsets - at) ** 2).sum(axis=1) <= near**2).sum() for at in offsets])
    usual = 1 + (len(counts) - 1) * np.pi * PHASE_RADIUS**2
    return np.minimum(1.0, usual / counts)


def moves_of(arms: Array) -> Array:
    """Return the displacements (n, 2, 3) of flat positions (n, 2) by each part of a motion about the origin."""
    return np.concatenate((np.broadcast_to(np.eye(2), (len(arms), 2, 2)), _across(arms)[..., None]), axis=2)


def rigid_motion(arms: Array, offsets: Array) -> Array:
    """Return the motion (3,) about the origin, or (3, k), that fits offsets (m, 2) or (m, 2, k) of points best."""
    design = moves_of(arms).reshape(-1, 3)
    return np.asarray(np.linalg.lstsq(design, offsets.reshape(len(design), *offsets.shape[2:]), rcond=1e-9)[0])


@dataclass(frozen=True, eq=False)
class Posterior:
    """Mean and covariance of the motion, about the origin of the flat skin, and the logarithm of the evidence."""

    mean: Array  # (3,) shift and rotation [m, m, rad]
    covariance: Array  # (3, 3)
    log_evidence: float


def posterior(evidence: Evidence) -> Posterior:
    """Integrate over all motions on grids that become finer round the probable ones."""
    lattice = np.stack(np.meshgrid(*[np.linspace(-1, 1, GRID_POINTS)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    middle = evidence.arms.mean(axis=0)
    local = replace(evidence, arms=evidence.arms - middle, planned=_moving(middle) @ evidence.planned)
    mean, axes = local.planned, np.diag((MAX_SHIFT, MAX_SHIFT, MAX_TURN))
    arm = np.append(1.0, np.sqrt((local.arms**2).sum(axis=1).mean()))
    width, is_last = np.inf, False
    for k in range(MAX_ROUNDS):
        motions = mean + lattice @ axes.T
        step = axes * 2 / (GRID_POINTS - 1)
        # half a step of the grid, per axis of the position
        blur = (
            0.0
            if is_last
            else 0.5 * FADE**k * float(np.sqrt(((step[:2] ** 2).sum() + (step[2] ** 2).sum() * arm[1] ** 2) / 2))
        )
        noises = local.probable(mean, blur)
        density = local.log_likelihood(motions, noises, blur) + local.log_prior(motions)
        weights = np.exp(density - density.max())
        log_evidence = float(density.max() + np.log(weights.sum() * abs(np.linalg.det(step))))
        weights /= weights.sum()
        mean = weights @ motions
        covariance = (weights[:, None] * (motions - mean)).T @ (motions - mean) + step @ step.T / 12
        before, width = width, float(np.linalg.det(covariance)) ** (1 / 6)
        axes = HALF_WIDTH * np.linalg.cholesky(covariance)
        if is_last:
            break
        is_last = abs(before / width - 1) < ROUND_TOLERANCE or k == MAX_ROUNDS - 2
    covariance = covariance - step @ step.T / 12
    back = _moving(-middle)
    return Posterior(back @ mean, back @ covariance @ back.T, log_evidence)


def motion_of(found: Posterior, touched: Array) -> Motion:
    """Return the motion about the point where the errors of shift and rotation are independent.

    A rotation that is hardly better known than that of any glued skin is left out, and the motion is that of the mean
    position of the touches ``touched`` (2,) [m].
    """
    if found.covariance[2, 2] > USUAL_TURN**2:
        to = _moving(touched)
        mean, covariance = to @ found.mean, to @ found.covariance @ to.T
        covariance[2], covariance[:, 2] = 0.0, 0.0
        covariance[2, 2] = np.inf
        return Motion(touched, mean[:2], 0.0, covariance)
    xt, yt = found.covariance[:2, 2] / found.covariance[2, 2]
    middle = np.array((-yt, xt))
    to = _moving(middle)
    mean = to @ found.mean
    return Motion(middle, mean[:2], float(mean[2]), to @ found.covariance @ to.T)


def _moving(middle: Array) -> Array:
    """Return the matrix (3, 3) that turns motions about the origin into those about ``middle`` (2,) [m]."""
    out = np.eye(3)
    out[:2, 2] = _across(middle[None])[0]
    return out


def _across(arms: Array) -> Array:
    """Return arms (k, 2) rotated by a quarter turn: the displacement of their ends by a small rotation."""
    return np.stack((-arms[:, 1], arms[:, 0]), axis=1)


def log_mean(values: Array) -> Array:
    """Return the logarithm of the mean of the exponentials of the first axis."""
    top = values.max(axis=0)
    return np.asarray(top + np.log(np.exp(values - top).mean(axis=0)))
