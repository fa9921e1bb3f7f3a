"""Standard uncertainty of taxels on a fitted surface: along it, along the normal, and of the normal itself."""

from dataclasses import dataclass

import numpy as np

from ..calibration.model import Registration, TaxelArray
from ..common.arrays import Array, cross, unit
from ..geometry.fit.chords import in_basis
from ..geometry.fit.error_field import ErrorField
from ..geometry.surface.bspline import MIN_LENGTH, BSplineSurface

# [m] standard uncertainty, per axis along the surface, of the point where an author mounts a skin by hand. Larger: all
# positions and normals are less certain. Contract: the documented default of a plan.
ORIGIN_UNCERTAINTY = 1e-3
# [rad] standard uncertainty of the direction in which an author mounts a skin by hand. Larger: taxels far from the
# anchor are less certain. Contract: the documented default of a plan.
DIRECTION_UNCERTAINTY = float(np.deg2rad(1.0))
# [m] least uncertainty of an origin that an author or touches can state. Smaller: covariances become singular by
# rounding. Contract: a limit of plan files.
MIN_ORIGIN_UNCERTAINTY = 1e-6
# [m] largest uncertainty of an origin that can be stated. Larger: origins that nothing determines are accepted.
# Contract: a limit of plan files.
MAX_ORIGIN_UNCERTAINTY = 0.1
# [rad] largest uncertainty of a direction that can be stated. Larger: directions that nothing determines are accepted.
# Contract: a limit of plan files.
MAX_DIRECTION_UNCERTAINTY = 1.0
# [m] standard uncertainty of a cell of a sheet that touches registered, per axis along the surface: the sheet was glued
# with strains and folds that no motion of the whole removes, of 0.1 to 0.5 mm. Larger: touches say less of their cells.
NOT_RIGID = 2e-4
# [1] strain above which the position of a cell is unknown, because the sheet wrinkles or lifts there. Larger: more
# taxels have an uncertainty.
MAX_KNOWN_STRAIN = 0.1


@dataclass(frozen=True, eq=False)
class TaxelUncertainty:
    """Covariances of the errors of taxels, with the axes along the row and across it."""

    along: Array  # (n, 2, 2) of the position along the surface [m^2]
    normal: Array  # (n,) variance of the height of the true surface over the taxel [m^2]
    angle: Array  # (n, 2, 2) of the direction of the normal [rad^2]

    @property
    def sigma(self) -> Array:
        r"""Return the standard uncertainties as a calibration has them, shape (n, 3).

        Along the surface it is the root mean square over the two axes. For the normal it is that of the worst
        direction, the largest eigenvalue:

        .. math::

            \left( \sqrt{\tfrac{1}{2} \operatorname{tr} C},\ \sigma_n,\ \sqrt{\lambda_{\max}(A)} \right) \quad
            [\text{m}, \text{m}, \text{rad}]
        """
        # Rounding leaves variances of nearly exact fits below zero.
        along = np.sqrt(np.maximum(np.trace(self.along, axis1=1, axis2=2) / 2, 0))
        angle = np.full(len(along), np.nan)
        known = np.isfinite(self.angle).all(axis=(1, 2))
        angle[known] = np.sqrt(np.maximum(np.linalg.eigvalsh(self.angle[known])[:, -1], 0))
        # Slopes between near sites have no limit; angles have.
        return np.column_stack((along, np.sqrt(np.maximum(self.normal, 0)), np.minimum(angle, np.pi)))


def moved_within(arms: Array, covariance: Array, curvature: float = 0.0) -> Array:
    r"""Return the covariance of positions in a skin that may be moved and rotated along the surface.

    A shift :math:`\mathbf{s}` of the anchor and a rotation :math:`\theta` about it have the ``covariance``
    :math:`\Sigma`, shape (3, 3) [m, m, rad]. They displace the flat position :math:`(x, y)` at the distance :math:`r`.
    On a flat surface the displacement is :math:`\mathbf{s} + \theta\, (-y, x)`. On a surface with the Gaussian
    curvature :math:`K`, paths from the anchor converge (:math:`K > 0`) or diverge. The displacement across the path is
    a Jacobi field (do Carmo, 1992, chapter 5): a shift is multiplied by :math:`c = \cos \sqrt{K} r`, and a rotation by
    :math:`s = \sin(\sqrt{K} r) / (\sqrt{K} r)`. With :math:`\mathbf{t} = (-y, x)` the covariance is

    .. math::

        C = J\, \Sigma\, J^T , \qquad
        J = \begin{pmatrix} I + \frac{c - 1}{r^2}\, \mathbf{t} \mathbf{t}^T & s\, \mathbf{t} \end{pmatrix}
        \quad [\text{m}^2]
    """
    squares = np.maximum((arms**2).sum(axis=1), MIN_LENGTH**2)
    angles = np.sqrt(curvature * squares.astype(complex))  # imaginary where paths diverge
    shifted, rotated = np.cos(angles).real, np.sinc(angles / np.pi).real
    across = np.stack((-arms[:, 1], arms[:, 0]), axis=1)
    turned = ((shifted - 1) / squares)[:, None, None] * across[:, :, None] * across[:, None, :]
    moves = np.concatenate((np.eye(2) + turned, (rotated[:, None] * across)[..., None]), axis=2)
    return np.asarray(moves @ covariance @ moves.transpose(0, 2, 1))


def usual_curvature(surface: BSplineSurface, uv: Array) -> float:
    r"""Return the median of the Gaussian curvature of a surface at some parameters, where a few are on edges or bumps.

    With the fundamental forms :math:`\mathrm{I}` and :math:`\mathrm{II}`:

    .. math::

        K = \frac{\det \mathrm{II}}{\det \mathrm{I}} \quad [1 / \text{m}^2]
    """
    r = surface.derivatives(uv, order=2)
    across = cross(r[1, 0], r[0, 1])
    square = np.maximum((across**2).sum(axis=1), MIN_LENGTH**4)
    L, M, N = ((bend * across).sum(axis=1) for bend in (r[2, 0], r[1, 1], r[0, 2]))
    return float(np.median((L * N - M**2) / square**2))


def moved_rigidly(taxels: TaxelArray, registration: Registration) -> tuple[Array, Array, float]:
    r"""Return the variances of taxels whose frame may be moved and rotated in all directions.

    With the arm :math:`\mathbf{a}` from the anchor:

    .. math::

        C = \sigma_o^2 I + \sigma_d^2 \left( \lVert \mathbf{a} \rVert^2 I - \mathbf{a} \mathbf{a}^T \right)
        \quad [\text{m}^2]
    """
    arms = taxels.positions_link - registration.anchor
    covariance = (registration.origin**2 + registration.direction**2 * (arms**2).sum(axis=1))[:, None, None] * np.eye(3)
    covariance -= registration.direction**2 * arms[:, :, None] * arms[:, None, :]
    axes = taxels.axes_link
    along = axes @ covariance @ axes.transpose(0, 2, 1)
    normals = taxels.normals_link
    height = np.einsum("ni,nij,nj->n", normals, covariance, normals)
    return along, height, registration.direction**2


def taxel_uncertainty(
    taxels: TaxelArray, field: ErrorField, along: Array, height: Array | None = None, tilt: float = 0.0
) -> TaxelUncertainty:
    r"""Return the uncertainty of taxels on a surface.

    A displacement along the surface turns the normal. Four points around each taxel, at the displacements
    :math:`\pm\sqrt{2}\,\mathbf{c}_i` with the columns of :math:`C = \sum_i \mathbf{c}_i \mathbf{c}_i^T`, give the
    covariance of the normal (unscented transform, Julier and Uhlmann, 1997). It needs no second derivatives, and it
    sees a fillet next to the taxel:

    .. math::

        A = \frac{1}{4} \sum_{i, \pm}
        \bigl( \mathbf{n}(\pm\sqrt{2}\,\mathbf{c}_i) - \mathbf{n} \bigr)
        \bigl( \mathbf{n}(\pm\sqrt{2}\,\mathbf{c}_i) - \mathbf{n} \bigr)^T + T

    :math:`T` is the covariance of the slope of the fit.
    """
    surface, uv, axes = field.surface, taxels.uv, taxels.axes_link
    r = surface.derivatives(uv)
    by_u, by_v = r[1, 0], r[0, 1]
    here = unit(cross(by_u, by_v))
    of_fit, slopes = field.at(uv)
    angle = np.broadcast_to(tilt * np.eye(2), along.shape).copy()
    for slope, by in zip(slopes.T, (by_u, by_v)):
        turn = np.einsum("nij,nj->ni", axes, unit(by))
        angle += slope[:, None, None] * turn[:, :, None] * turn[:, None, :]
    variances, directions = np.linalg.eigh(along)
    columns = (np.sqrt(2 * np.maximum(variances, 0))[:, None] * directions).transpose(2, 0, 1)
    for step in (*columns, *-columns):
        there = uv + np.column_stack(in_basis(by_u, by_v, np.einsum("ni,nij->nj", step, axes)))
        turn = np.einsum("nij,nj->ni", axes, surface.normals(there) - here)
        angle += turn[:, :, None] * turn[:, None, :] / 4
    return TaxelUncertainty(along, of_fit if height is None else height, angle)
