r"""Directions of measured forces: angles to the normals, signs, and an offset of the force sensor.

A press without friction is along the normal. What forces have in common along the tangent planes is an offset of the
sensor, a rotation of its frame, or presses that lean.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from ..calibration.model import LinkCalibration
from ..common.arrays import Array, BoolArray, IntArray, tangential, usual_size
from ..common.errors import listed
from ..common.warnings import Warning
from .flat import along_skin
from .touches import Touches, lines_of_action

# Touches with a force from which on directions are judged. Larger: less is said about few touches.
MIN_FORCES = 8
# [1] Fraction of the forces within 45 degrees of the normal, from which on an offset is estimated. Larger: none is for
# skins with wrong channels.
MIN_NEAR_NORMAL = 0.7
# [standard errors] of an offset or of a mean angle that is named: one of its components. With few touches standard
# errors are uncertain: for m touches the limit is (1 + FEW / m) times as large. Larger: fewer false alarms.
MIN_SIGNIFICANCE, FEW = 3.9, 8
# [fraction of the median force] of an offset from which on a warning is given: it moves lines of action by this part of
# their lever. Larger: fewer warnings. Smaller offsets are removed, too.
MIN_OFFSET = 0.01
# [rad] Mean angle to the normal from which on a warning is given. Larger: fewer warnings.
MIN_LEAN = np.deg2rad(8.0)
# [N] Usual offset of a force sensor. Larger: no effect but on offsets along the normal of a flat skin.
USUAL_OFFSET = 10.0
# [m] Lever of a moment that says something of the force along it. Larger: fewer moments count.
MIN_LEVER = 5e-3
# [1] Residual of the moments relative to that of the tangents below which they say something new. Larger: the noise of
# the sensor counts twice.
MAX_MOMENT_RATIO = 0.3
# [1] Standard errors of offsets from moments are too small by at most this factor, as moments depend on the forces.
# Larger: fewer false alarms.
MOMENT_CAUTION = 1.4
# [1] Length of the mean normal from which on all normals are alike: an offset and presses that lean are then the same.
# Larger: removes forces of presses that lean.
MAX_ALIKE = 0.95
ROBUST_SCALE = 2.0  # Distance with weight one half, in standard deviations. Larger: outliers have more influence.
REWEIGHTING_STEPS = 20  # Larger: more exact.


@dataclass(frozen=True, eq=False)
class Directions:
    """Forces of touches; row i of every array is the same touch."""

    lines: IntArray  # (m,) lines of the file
    forces: Array  # (m,) [N]
    tilts: Array  # (m, 2) of the press from the normal, along the row and across it [rad]
    is_pull: BoolArray  # (m,) whether the force points out of the skin
    noise: float | None  # of a force, per axis [N]; None: not known
    offset: Array  # (3,) common part of the forces, link frame [N]; zero if it is not significant
    offset_covariance: Array  # (3, 3) [N^2]
    is_of_sensor: bool  # whether the lines of action are those without the offset

    @property
    def angles(self) -> Array:
        """Angles between forces and normals, shape (m,) [rad]."""
        return np.arctan(np.linalg.norm(np.tan(self.tilts), axis=1))

    @property
    def mean_tilt(self) -> Array:
        """Mean tilt along the rows and across [rad]."""
        return np.asarray(np.median(self.tilts, axis=0))

    @property
    def tilt_error(self) -> Array:
        """Standard errors of the mean tilt [rad]; that of a median of normal values."""
        return np.sqrt(np.pi / 2 / len(self.tilts)) * usual_size(self.tilts - self.mean_tilt)

    @property
    def resolution(self) -> float | None:
        """Smallest angle that the noise of the sensor allows to see in one touch [rad]."""
        return None if self.noise is None else float(np.arctan(self.noise / np.median(self.forces)))

    def summary(self) -> str:
        """Return a line about the angles."""
        angle, lean, error = np.rad2deg(self.angles.mean()), np.rad2deg(self.mean_tilt), np.rad2deg(self.tilt_error)
        known = (
            "" if self.resolution is None else f"; the noise of the force is {np.rad2deg(self.resolution):.1f} degrees"
        )
        (x, y), (dx, dy) = np.round(lean, 1) + 0.0, error
        return (
            f"force {np.median(self.forces):.1f} N, angle to the normal: mean {angle:.1f}, along the rows {x:.1f} +- "
            f"{dx:.1f}, across {y:.1f} +- {dy:.1f} degrees{known}"
        )

    def warnings(self, in_order: bool = True) -> Iterator[Warning]:
        """Yield warnings for the author: signs, and, if the channels are in order, offset of the sensor and lean.

        In another order the normals are those of other taxels. Forces with the opposite sign can seem to be one.
        """
        if self.is_pull.all():
            message = "All forces point out of the skin, as those of pulls, or as those on the probe."
            advice = "Give the forces on the skin."
            yield Warning("force-sign", "note", message, value=float(len(self.forces)), advice=advice)
        if not in_order:
            return
        if np.linalg.norm(self.offset) > MIN_OFFSET * np.median(self.forces):
            x, y, z = np.round(self.offset, 2) + 0.0
            errors = np.sqrt(np.diag(self.offset_covariance))
            message = f"The forces have a common part of ({x:.2f}, {y:.2f}, {z:.2f}) N +- {errors.max():.2f} N. "
            message += (
                "The lines of action are computed without it."
                if self.is_of_sensor
                else "It stays in the lines of action: the moments agree with it, or all normals are alike."
            )
            advice = "Tare the sensor, or press along the normals."
            yield Warning("force-offset", "warning", message, value=float(np.linalg.norm(self.offset)), advice=advice)
        lean = float(np.linalg.norm(self.mean_tilt))
        if lean > MIN_LEAN and (np.abs(self.mean_tilt) > MIN_SIGNIFICANCE * self.tilt_error).any():
            along, across = np.rad2deg(self.mean_tilt)
            message = f"The forces lean by {along:.0f} degrees along the rows and {across:.0f} degrees across."
            advice = "Press along the normals, or correct the rotation of the sensor's frame."
            yield Warning("oblique-touches", "warning", message, value=lean, advice=advice)
        few = np.flatnonzero(self.is_pull if self.is_pull.mean() <= 0.5 else ~self.is_pull)
        if len(few):
            which = listed([f"line {line}" for line in self.lines[few].tolist()])
            message = f"{len(few)} of {len(self.forces)} forces have the opposite sign: {which}."
            advice = "Press only, or correct their signs."
            yield Warning("force-sign", "warning", message, value=float(len(few)), advice=advice)


def directions_of(calibration: LinkCalibration, touches: Touches) -> tuple[Directions | None, Touches]:
    """Return what the forces of touches say, and the touches without the offset of the sensor.

    It is None if there are too few forces.
    """
    if len(touches.wrenches) < MIN_FORCES:
        return None, touches
    axes, normals = _frames(calibration, touches, False)
    offset, covariance, is_of_sensor = _offset(axes, normals, touches.wrenches)
    if not is_of_sensor:  # the skin may have moved
        axes, normals = _frames(calibration, touches, True)
        if offset.any():
            offset, covariance, is_of_sensor = _offset(axes, normals, touches.wrenches)
    if is_of_sensor:
        wrenches = touches.wrenches - np.append(offset, np.zeros(3))
        is_line = touches.directions.any(axis=1)[:, None]
        points, along = lines_of_action(wrenches)
        touches = replace(
            touches,
            wrenches=wrenches,
            points=np.where(is_line, points, touches.points),
            directions=np.where(is_line, along, 0.0),
        )
        axes, normals = _frames(calibration, touches, True)
    forces = touches.wrenches[:, :3]
    outward = (forces * normals).sum(axis=1)
    strong = np.linalg.norm(forces, axis=1)
    across = np.einsum("mkc,mc->mk", axes, forces)
    tilts = np.arctan2(-across * np.where(outward < 0, -1, 1)[:, None], np.abs(outward)[:, None])
    found = Directions(touches.lines, strong, tilts, outward > 0, touches.force_noise, offset, covariance, is_of_sensor)
    return found, touches


def _frames(calibration: LinkCalibration, touches: Touches, is_there: bool) -> tuple[Array, Array]:
    """Return axes (m, 2, 3) and normals (m, 3) of the taxels that felt the touches, or ``is_there`` at the touches.

    Those at the touches do not depend on a motion of a curved skin, but on an offset of the force sensor.
    """
    axes, normals = np.zeros((len(touches.taxels), 2, 3)), np.zeros((len(touches.taxels), 3))
    for patch in calibration.patches:
        row_of = {name: row for row, name in enumerate(patch.taxels.ids)}
        mine = np.array([k for k, name in enumerate(touches.taxels) if name in row_of], np.int64)
        rows = np.array([row_of[touches.taxels[k]] for k in mine], np.int64)
        axes[mine], normals[mine] = patch.taxels.axes_link[rows], patch.taxels.normals_link[rows]
        if is_there:
            found = along_skin(patch, rows, touches.points[mine], touches.directions[mine])
            normals[mine[found.known]] = found.normals[found.known]
            axes[mine, 0] = tangential(axes[mine, 0], normals[mine])
            axes[mine, 1] = np.cross(normals[mine], axes[mine, 0])
    return axes, normals


def _offset(axes: Array, normals: Array, wrenches: Array) -> tuple[Array, Array, bool]:
    r"""Return the common part of forces, its covariance, and whether it is an offset of the sensor alone.

    Along the tangents a force :math:`\mathbf{f}` has nothing but the offset :math:`\mathbf{b}`. The moment
    :math:`\boldsymbol{\tau}` is perpendicular to the force of the contact. If it is so before the offset is
    removed, the offset is not one of the sensor:

    .. math::

        \mathbf{t}_k \cdot (\mathbf{f} - \mathbf{b}) = 0, \qquad
        \boldsymbol{\tau} \cdot (\mathbf{f} - \mathbf{b}) = 0
    """
    forces, moments, count = wrenches[:, :3], wrenches[:, 3:], len(wrenches)
    is_near = np.abs((forces * normals).sum(axis=1)) > np.sqrt(0.5) * np.linalg.norm(forces, axis=1)
    if is_near.mean() < MIN_NEAR_NORMAL:
        return np.zeros(3), np.zeros((3, 3)), False
    found, covariance, spread = _robust(axes.reshape(-1, 3), (axes @ forces[..., None]).ravel())
    length = np.linalg.norm(moments, axis=1)
    levers = length > MIN_LEVER * np.linalg.norm(forces, axis=1)
    is_named = _is_significant(found, covariance, count)
    if levers.sum() >= MIN_FORCES:
        along = moments[levers] / length[levers, None]
        other, other_covariance, other_spread = _robust(along, (along * forces[levers]).sum(axis=1))
        other_covariance *= MOMENT_CAUTION**2
        if other_spread < MAX_MOMENT_RATIO * spread:
            is_of_sensor = _is_significant(other, other_covariance, int(levers.sum()))
            apart = found - other
            misfit = apart @ np.linalg.solve(covariance + other_covariance, apart)
            if is_named and not is_of_sensor and other @ np.linalg.solve(other_covariance, other) < misfit:
                return found, covariance, False
            is_named |= is_of_sensor
            precision = np.linalg.inv(covariance) + np.linalg.inv(other_covariance)
            mean = np.linalg.solve(covariance, found) + np.linalg.solve(other_covariance, other)
            covariance = np.linalg.inv(precision)
            found = covariance @ mean
            return (found, covariance, True) if is_named else (np.zeros(3), covariance, False)
    varies = np.linalg.norm(np.cross(axes[:, 0], axes[:, 1]).mean(axis=0)) < MAX_ALIKE
    return (found if is_named else np.zeros(3)), covariance, bool(is_named and varies)


def _is_significant(offset: Array, covariance: Array, count: int) -> bool:
    limit = MIN_SIGNIFICANCE * (1 + FEW / count)
    return bool((np.abs(offset) > limit * np.sqrt(np.diag(covariance))).any())


def _robust(rows: Array, values: Array) -> tuple[Array, Array, float]:
    r"""Solve ``rows (r, 3) @ x = values`` robustly; return x, its covariance, and the spread of the residuals.

    Iteratively reweighted least squares with Cauchy's weights. With the residuals :math:`r`, their scale :math:`s` and
    :math:`w = 1 / (1 + r^2 / s^2)`, the covariance of this M-estimate is (Huber, 1981, eq. 7.6.6)

    .. math::

        C = K^2\, \frac{\sum w^2 r^2 / (n - k)}{\bar{d}^2}\, (A^T A)^{-1}, \qquad
        K = 1 + \frac{k}{n} \frac{\mathrm{var}(d)}{\bar{d}^2}, \qquad d = w^2 (1 - r^2 / s^2)
    """
    prior = np.eye(3) / USUAL_OFFSET**2
    found = np.zeros(3)
    tiny = 1e-9 * max(float(np.abs(values).max(initial=0.0)), 1e-9)
    for _ in range(REWEIGHTING_STEPS):
        residuals = values - rows @ found
        spread = max(float(usual_size(residuals)), tiny)
        scale = ROBUST_SCALE * spread
        weights = 1 / (1 + (residuals / scale) ** 2)
        normal = (weights[:, None] * rows).T @ rows / spread**2 + prior
        found = np.linalg.solve(normal, rows.T @ (weights * values) / spread**2)
    residuals = values - rows @ found
    weights = 1 / (1 + (residuals / scale) ** 2)
    slopes = weights**2 * (1 - (residuals / scale) ** 2)
    slope = max(float(slopes.mean()), 1e-3)
    few = 1 + 3 / len(values) * float(slopes.var()) / slope**2
    variance = few**2 * float((weights**2 * residuals**2).sum()) / max(len(values) - 3, 1) / slope**2
    covariance = np.linalg.inv(rows.T @ rows / max(variance, tiny**2) + prior)
    return found, covariance, spread
