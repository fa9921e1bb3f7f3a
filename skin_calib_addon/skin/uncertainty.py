"""Standard uncertainty of taxels on a fitted surface: along it, along the normal, and of the normal itself."""

from dataclasses import dataclass

import numpy as np

from ..calibration.model import Registration, TaxelArray
from ..common.arrays import Array, cross, unit
from ..geometry.fit.chords import in_basis
from ..geometry.fit.error_field import ErrorField

# [m] standard uncertainty, per axis along the surface, of the point where an author mounts a skin by hand. Larger: all
# positions and normals are less certain.
ORIGIN_UNCERTAINTY = 1e-3
# [rad] standard uncertainty of the direction in which an author mounts a skin by hand. Larger: taxels far from the
# anchor are less certain.
DIRECTION_UNCERTAINTY = float(np.deg2rad(1.0))
# [m], [rad] limits of the uncertainties that an author or touches can state. A smaller minimum: covariances become
# singular by rounding. A larger maximum: directions that nothing determines are accepted.
MIN_ORIGIN_UNCERTAINTY, MAX_ORIGIN_UNCERTAINTY, MAX_DIRECTION_UNCERTAINTY = 1e-6, 0.1, 1.0
# [1] displacement of a cell per strain and per distance from the anchor: a sheet that must strain moves as a whole when
# it is mounted slightly elsewhere. Larger: strained sheets are less certain.
STRAIN_DISPLACEMENT = 0.15
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
        along = np.sqrt(np.trace(self.along, axis1=1, axis2=2) / 2)
        angle = np.full(len(along), np.nan)
        known = np.isfinite(self.angle).all(axis=(1, 2))
        angle[known] = np.sqrt(np.maximum(np.linalg.eigvalsh(self.angle[known])[:, -1], 0))
        return np.column_stack((along, np.sqrt(self.normal), angle))


def moved_within(arms: Array, registration: Registration, strain: Array | float = 0.0) -> Array:
    r"""Return the covariance of positions in a skin that may be moved and rotated along the surface.

    A shift :math:`\mathbf{s}` of the anchor and a rotation :math:`\theta` about it displace the flat position
    :math:`(x, y)` by :math:`\mathbf{s} + \theta\, (-y, x)`. With their standard uncertainties :math:`\sigma_o` and
    :math:`\sigma_d`, the covariance is

    .. math::

        C = \begin{pmatrix} \sigma_o^2 + \sigma_d^2 y^2 & -\sigma_d^2 x y \\
        -\sigma_d^2 x y & \sigma_o^2 + \sigma_d^2 x^2 \end{pmatrix}
        + (0.15\, \varepsilon)^2 (x^2 + y^2)\, I \quad [\text{m}^2]

    Parameters
    ----------
    arms : array, shape (n, 2)
        Flat positions relative to the anchor, along the rows and across [m].
    registration : Registration
        Standard uncertainties of the anchor and of the direction.
    strain : array, shape (n,), or float
        Largest strain :math:`\varepsilon` of each cell.

    Returns
    -------
    array, shape (n, 2, 2)
        [m^2]
    """
    turned = np.stack((-arms[:, 1], arms[:, 0]), axis=1)
    isotropic = registration.origin**2 + (STRAIN_DISPLACEMENT * strain) ** 2 * (arms**2).sum(axis=1)
    rotation = registration.direction**2 * turned[:, :, None] * turned[:, None, :]
    return isotropic[:, None, None] * np.eye(2) + rotation


def moved_rigidly(taxels: TaxelArray, registration: Registration) -> tuple[Array, Array, float]:
    r"""Return the variances of taxels whose frame may be moved and rotated in all directions.

    With the arm :math:`\mathbf{a}` from the anchor:

    .. math::

        C = \sigma_o^2 I + \sigma_d^2 \left( \lVert \mathbf{a} \rVert^2 I - \mathbf{a} \mathbf{a}^T \right)
        \quad [\text{m}^2]

    Parameters
    ----------
    taxels : TaxelArray
        The taxels.
    registration : Registration
        Standard uncertainties of the anchor and of the direction, per axis.

    Returns
    -------
    along : array, shape (n, 2, 2)
        Covariance along the row and across it [m^2].
    height : array, shape (n,)
        Variance along the normal [m^2].
    tilt : float
        Variance of the direction of the normal, per axis [rad^2].
    """
    arms = taxels.positions_link - registration.anchor
    covariance = (registration.origin**2 + registration.direction**2 * (arms**2).sum(axis=1))[:, None, None] * np.eye(3)
    covariance -= registration.direction**2 * arms[:, :, None] * arms[:, None, :]
    turned = _axes(taxels) @ covariance
    along = turned @ _axes(taxels).transpose(0, 2, 1)
    normals = taxels.normals_link
    height = np.einsum("ni,nij,nj->n", normals, covariance, normals)
    return along, height, registration.direction**2


def _axes(taxels: TaxelArray) -> Array:
    """Return the unit vectors along the row and across it, shape (n, 2, 3)."""
    return np.stack((taxels.tangents_link, cross(taxels.normals_link, taxels.tangents_link)), axis=1)


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

    Parameters
    ----------
    taxels : TaxelArray
        Taxels on the surface of ``field``.
    field : ErrorField
        Of the fit.
    along : array, shape (n, 2, 2)
        Covariance of the positions along the rows and across, see `moved_within` and `moved_rigidly` [m^2].
    height : array, shape (n,), optional
        Variance of the height of taxels that are not on the surface [m^2]. By default that of the fit.
    tilt : float
        Further variance of the normal, per axis [rad^2].

    Returns
    -------
    TaxelUncertainty
    """
    surface, uv, axes = field.surface, taxels.uv, _axes(taxels)
    r = surface.derivatives(uv)
    by_u, by_v = r[1, 0], r[0, 1]
    here = unit(cross(by_u, by_v))
    of_fit, slopes = field.at(uv)
    angle = np.broadcast_to(tilt * np.eye(2), along.shape).copy()
    for slope, by in zip(slopes.T, (by_u, by_v)):
        turn = np.einsum("nij,nj->ni", axes, unit(by))
        angle += slope[:, None, None] * turn[:, :, None] * turn[:, None, :]
    columns = np.sqrt(2) * np.linalg.cholesky(along).transpose(2, 0, 1)
    for step in (*columns, *-columns):
        there = uv + np.column_stack(in_basis(by_u, by_v, np.einsum("ni,nij->nj", step, axes)))
        turn = np.einsum("nij,nj->ni", axes, surface.normals(there) - here)
        angle += turn[:, :, None] * turn[:, None, :] / 4
    return TaxelUncertainty(along, of_fit if height is None else height, angle)
