"""What a fit makes of the deviation of a part from its mesh."""

from dataclasses import replace

import numpy as np

from ...common.mesh_uncertainty import MeshUncertainty
from .error_field import ErrorField, slopes_of
from .surface_fit import SurfaceFit

# [1] correlation length over the longer mean span from which on a surface follows the deviation of a mesh: it smooths
# less than 5 %. Larger: more time.
FOLLOWED_SPANS = 1.0
# [1] waves of a random deviation. More: variances are more exact, now within about 4 %; more time.
WAVES = 128
# [1] range of the ratio of the mean square of residuals to that of noise as stated: medians within it are those of a
# scan; above it, residuals around a site are not only noise. Wider: more meshes are scans.
NOISE_RATIOS = 0.5, 2.0


def with_mesh_uncertainty(fit: SurfaceFit, mesh: MeshUncertainty) -> ErrorField:
    r"""Return the error field of a fit, with the deviation of the part from its mesh.

    The mesh of a CAD program does not contain the deviation: its variance adds. A scan contains it as noise, and the
    surface averages what is shorter than its spans. With the operator :math:`A` of the least squares and the covariance
    :math:`K` of the deviation, the residuals :math:`R` of a scan have the variances :math:`K_R`, and the surface

    .. math::

        \sigma^2 = \operatorname{diag} (A K A^T) + \left( 1 - \frac{2 K_R}{R^2} \right)_+ \sigma_0^2 , \qquad
        K_R = \operatorname{diag} \left( (I - A) K (I - A)^T \right) \quad [\text{m}^2]

    The factor of two allows for the scatter of :math:`R^2`. A mesh is a scan if the median of :math:`R^2` is half of
    that of :math:`K_R` to twice as much. Both diagonals are means over plane waves, whose wave vectors have the
    variance :math:`2 / L^2` per axis.
    """
    field, basis = fit.error_field, fit.basis
    added = replace(field, height=field.height + mesh.variance, slopes=field.slopes + mesh.slope)
    sites, spans = np.array(fit.residuals.shape), np.array(basis.spans_by_axis)
    longest = float((field.spacing.mean(axis=(0, 1)) * sites / spans).max())
    if mesh.correlation_length >= FOLLOWED_SPANS * longest or mesh.standard_deviation == 0:
        return added
    directions = np.linalg.qr(np.random.default_rng(0).normal(size=(WAVES, 3)))[0]  # with equal variances
    phases = fit.points @ (np.sqrt(2 * WAVES) / mesh.correlation_length * directions.T)
    followed, left = np.zeros((3, *sites)), np.zeros(tuple(sites))
    for waves in (np.cos(phases), np.sin(phases)):
        for wave in np.moveaxis(waves, 2, 0):
            moved = basis.N @ basis.solve(wave, np.zeros_like(fit.offsets), fit.stiffness) @ basis.B.T
            followed += np.square([moved, *slopes_of(moved, field.spacing, basis.is_closed)])
            left += (wave - moved) ** 2
    followed, left = mesh.variance * followed / WAVES, mesh.variance * left / WAVES
    least, most = NOISE_RATIOS
    if not least < np.nanmedian(field.rest) / np.nanmedian(left) < most:
        return added
    known = np.clip(1 - most * left / np.maximum(field.rest, np.finfo(float).tiny), 0, 1)
    height, by_u, by_v = followed
    slopes = known[..., None] * field.slopes + np.stack((by_u, by_v), axis=2)
    return replace(field, height=known * field.height + height, slopes=slopes, mesh=None)  # its vertices are noisy
