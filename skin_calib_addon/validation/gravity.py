r"""Orientation of taxels with an accelerometer, from gravity in several postures of the link.

At rest an accelerometer measures the specific force, which is opposite to gravity, in its own axes. In posture j

.. math::

    \mathbf{a}_j = \mathbf{o} - S R^T \mathbf{g}_j

with the offset :math:`\mathbf{o}` of the sensor, the scales :math:`S` of its axes, and their rotation :math:`R` to the
link frame. Relative to the means over all postures there is no offset. For given scales :math:`R` is the solution of
Wahba's problem (Kabsch, 1976), and scales and rotation follow by turns.
"""

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..calibration.measurements import TaxelColumn
from ..calibration.model import LinkCalibration
from ..common.arrays import Array, unit
from ..common.errors import CalibrationFormatError
from ..common.findings import show
from ..common.tables import TableError, find_column, naming_file, number_in, read_named_rows
from ..common.text import read_text
from ..common.warnings import Place, Warning
from .touches import of_taxels, with_unit

ACCELERATION, DIRECTION = ("ax", "ay", "az"), ("gx", "gy", "gz")
GRAVITY = 9.80665  # [m/s^2]
MIN_POSTURES = 4  # of a taxel: three leave the offset open. Larger: refuses short tables.
# [1] Smallest of the three spreads of the directions of gravity, relative to its size. Smaller: accepts postures that
# turn about one axis, which leave a rotation open.
MIN_SPREAD = 0.1
# [1] Ratio of measured and true changes of gravity that a sensor can have. Wider: accepts wrong units.
MAX_SCALE_ERROR = 0.15
# Postures from which on the scales of the axes are unknowns: fewer hardly determine them. Larger: errors of the scales
# turn boards.
MIN_SCALE_POSTURES = 7
SCALE_STEPS = 30  # of scales and rotation by turns. Larger: no effect.
# [1] Residual relative to gravity from which on the link was not at rest. Larger: fewer refusals.
MAX_RESIDUAL = 0.2
# [1] Largest distance of the directions of gravity in successive rows of one posture, which count once: .5 degrees.
# Larger: joins postures; smaller: noise of the joints makes several of one, with standard errors that are too small.
SAME_GRAVITY = 0.01
# [rad], [standard errors] of a rotation that is named. Larger: fewer warnings.
MIN_ROTATION, MIN_SIGNIFICANCE = np.deg2rad(1.0), 4.0


@dataclass(frozen=True, eq=False)
class Orientation:
    """Rotation of a taxel from its place in the calibration, as its accelerometer measures it."""

    taxel: str
    postures: int
    is_reversed: bool  # whether the normal points inward; then the angles are those after a half turn about the tangent
    turn: float  # about the normal, counter-clockwise seen from outside [rad]
    tilt: Array  # (2,) of the normal, about the tangent and about the direction across [rad]
    errors: Array  # (3,) standard errors about tangent, across and normal [rad]
    offset: Array  # (3,) of the accelerometer [m/s^2]
    residual: float  # rms, per axis [m/s^2]

    @property
    def is_rotated(self) -> bool:
        """Whether the rotation is significant."""
        rotation = np.append(self.tilt, self.turn)
        significant = np.abs(rotation) > MIN_SIGNIFICANCE * self.errors
        return self.is_reversed or bool((significant & (np.abs(rotation) > MIN_ROTATION)).any())

    def summary(self) -> str:
        """Return a line about it."""
        x, y, z = np.rad2deg(np.append(self.tilt, self.turn)) + 0.0
        side = "upside down, " if self.is_reversed else ""
        return (
            f"{self.taxel:16} {side}turned {z:+.1f} degrees about the normal, "
            f"normal off by ({x:+.1f}, {y:+.1f}) degrees, "
            f"+- {np.rad2deg(self.errors.max()):.1f}; {self.postures} postures"
        )


def read_orientations(path: str | os.PathLike[str], calibration: LinkCalibration) -> tuple[Orientation, ...]:
    """Read what accelerometers measure at rest, and return the orientation of each taxel that has one.

    The table has a row for each posture and taxel: ``taxel`` or ``channel``; ``ax``, ``ay``, ``az`` along the tangent,
    across it and along the normal of the taxel [m/s^2]; ``gx``, ``gy``, ``gz``, the direction of gravity in the
    frame of the link, of any length. The header can name ``[g]`` as the unit of the acceleration.
    """
    of: dict[str, list[tuple[int, list[float]]]] = {}
    with naming_file(path):
        table = read_named_rows(read_text(path))
        line, header = next(table, (1, [""]))
        names, scales = zip(*(with_unit(name, line, k + 1) for k, name in enumerate(header)))
        columns = [find_column(list(names), name, line) for name in (*ACCELERATION, *DIRECTION)]
        owner = TaxelColumn.of(list(names), line, calibration)
        for line, row in table:
            numbers = [number_in(row, k, line) * scales[k] for k in columns]
            of.setdefault(owner.taxel(row, line), []).append((line, numbers))
    if not of:
        raise CalibrationFormatError(f"'{path}' has no row below its header")
    axes, normals = (of_taxels(calibration, of, name) for name in ("axes_link", "normals_link"))
    frames = np.concatenate((axes, normals[:, None]), axis=1).swapaxes(1, 2)  # as columns
    with naming_file(path):
        fits = [_fit(name, frame, rows) for (name, rows), frame in zip(of.items(), frames)]
    noise = np.sqrt(sum(f.squares for f in fits) / sum(f.degrees for f in fits))
    return tuple(
        Orientation(
            name,
            fit.postures,
            *_angles(fit.rotation),
            np.sqrt(np.diag(np.linalg.inv(fit.geometry))) * noise,
            fit.offset,
            float(np.sqrt(fit.squares / (3 * fit.postures))),
        )
        for name, fit in zip(of, fits)
    )


def rotated(found: Sequence[Orientation]) -> Iterator[Warning]:
    """Yield a warning about the taxels that have another orientation than the calibration states."""
    wrong = [one for one in found if one.is_rotated]
    if wrong:
        worst = max(wrong, key=lambda one: float(np.hypot(one.turn, np.linalg.norm(one.tilt))))
        message = f"{len(wrong)} of {len(found)} taxels have another orientation; the farthest: {worst.summary()}."
        advice = "Check the sides of the boards, the order of the channels, and the axes of the accelerometers."
        where = Place(taxels=tuple(one.taxel for one in wrong))
        yield Warning("wrong-orientation", "warning", message, where, float(len(wrong)), advice)


def _angles(rotation: Array) -> tuple[bool, float, Array]:
    """Return whether a rotation reverses the normal, its turn about the normal, and its tilt (2,) [rad]."""
    is_reversed = bool(rotation[2, 2] < 0)
    if is_reversed:  # after a half turn about the tangent
        rotation = rotation * (1.0, -1.0, -1.0)
    turn = np.arctan2(rotation[1, 0] - rotation[0, 1], rotation[0, 0] + rotation[1, 1])
    across = np.array((-rotation[1, 2], rotation[0, 2]))
    sine = float(np.linalg.norm(across))
    return is_reversed, float(turn), across * (np.arctan2(sine, rotation[2, 2]) / sine if sine > 0 else 1.0)


def _postures(rows: Array) -> Array:
    """Return the means of successive rows (m, 6) with nearly the same direction of gravity."""
    directions = unit(rows[:, 3:])
    starts = [0]
    for k in range(1, len(rows)):
        if np.linalg.norm(directions[k] - directions[starts[-1]]) > SAME_GRAVITY:
            starts.append(k)
    rows = np.hstack((rows[:, :3], directions))
    return np.array([part.mean(axis=0) for part in np.split(rows, starts[1:])])


class _Fit(NamedTuple):
    rotation: Array  # (3, 3) from the axes of the sensor to those of the calibration
    offset: Array  # (3,) [m/s^2]
    geometry: Array  # (3, 3) inverse covariance of the rotation, for accelerations with the noise 1 m/s^2
    squares: float  # of the residuals [m^2/s^4]
    postures: int
    degrees: int  # of freedom of the residuals


def _fit(taxel: str, axes: Array, rows: list[tuple[int, list[float]]]) -> _Fit:
    """Return the rotation of a taxel with ``axes`` (3, 3) in the link frame."""
    first, numbers = rows[0][0], np.array([row for _, row in rows])
    size = np.linalg.norm(numbers[:, 3:], axis=1)
    if not size.all():
        raise TableError(rows[int(np.argmin(size))][0], "the direction of gravity is zero")
    numbers = _postures(numbers)
    size = np.linalg.norm(numbers[:, 3:], axis=1)
    measured, up = numbers[:, :3], -GRAVITY * numbers[:, 3:] / size[:, None] @ axes
    a, b = measured - measured.mean(axis=0), up - up.mean(axis=0)
    count = len(numbers)
    if count < MIN_POSTURES or np.linalg.svd(b, compute_uv=False)[2] < MIN_SPREAD * GRAVITY * np.sqrt(count):
        message = f"the {count} postures of the taxel {show(taxel)} leave its orientation open"
        raise TableError(first, f"{message}. Turn the link so that gravity points to all sides")
    rotation, size, is_mirrored = _wahba(a, b)
    _check_scale(size / float((b**2).sum()), taxel, first)
    squares = float(((a - b @ rotation) ** 2).sum())
    if squares > 3 * count * (MAX_RESIDUAL * GRAVITY) ** 2:
        message = f"the accelerations of the taxel {show(taxel)} do not fit gravity"
        reason = "the link moved"
        if is_mirrored:
            reason = "one or all axes have the opposite sign; at rest accelerations point up, and gravity points down"
        raise TableError(first, f"{message}: {reason}")
    scales, geometry, degrees = np.ones(3), np.eye(3) * (b**2).sum() - b.T @ b, 3 * count - 6
    if count >= MIN_SCALE_POSTURES:
        for _ in range(SCALE_STEPS):
            along = b @ rotation
            scales = (a * along).sum(axis=0) / (along**2).sum(axis=0)
            rotation, _, _ = _wahba(a / scales, b)
        _check_scale(scales[np.abs(scales - 1).argmax()], taxel, first)
        along = b @ rotation
        turning = (np.cross(np.eye(3), b[:, None]) @ rotation).transpose(0, 2, 1).reshape(-1, 3)
        scaling = (along[:, :, None] * np.eye(3)).reshape(-1, 3)
        both = scaling.T @ turning
        geometry, degrees = geometry - both.T @ np.linalg.solve(scaling.T @ scaling, both), degrees - 3
        squares = float(((a - scales * along) ** 2).sum())
    offset = measured.mean(axis=0) - scales * (up.mean(axis=0) @ rotation)
    return _Fit(rotation, offset, geometry, squares, count, degrees)


def _wahba(a: Array, b: Array) -> tuple[Array, float, bool]:
    """Return the rotation with ``a ~ b @ rotation``, the size of the product, and whether a reflection fits better."""
    left, values, right = np.linalg.svd(b.T @ a)
    is_mirrored = bool(np.linalg.det(left @ right) < 0)
    rotation = left @ np.diag((1.0, 1.0, -1.0 if is_mirrored else 1.0)) @ right
    return rotation, float(values.sum()), is_mirrored


def _check_scale(scale: float, taxel: str, line: int) -> None:
    """Check that accelerations change as gravity does."""
    if abs(scale - 1) > MAX_SCALE_ERROR:
        message = f"the accelerations of the taxel {show(taxel)} change by {scale:.3g} of what gravity does"
        raise TableError(line, f"{message}. Name their unit, [m/s^2] or [g], and keep the link at rest")
