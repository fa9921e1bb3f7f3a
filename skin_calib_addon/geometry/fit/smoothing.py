"""The stiffness of a surface over a noisy scan, which predicts samples best that the fit did not use."""

import numpy as np

from ...common.arrays import Array
from ..mesh.corners import facet_corners
from ..mesh.triangle_mesh import TriangleMesh
from ..sampling.basis import TensorBasis
from ..sampling.samples import RaySamples

# [fraction of the mesh size] root mean square of the residuals below which they are facets of a good model. Larger:
# fewer scans are smoothed.
MIN_NOISE_FRACTION = 3e-4
# [1] least number of mesh vertices per control point for smoothing. With fewer, the facets are the shape. Larger: fewer
# scans are smoothed.
MIN_VERTICES_PER_CONTROL_POINT = 3
# [1] range of the median to the root mean square of the residuals that looks like a normal distribution, for which it
# is 0.67. Edges, steps and openings give a smaller ratio, chords a larger one. Wider: more meshes are smoothed.
MEDIAN_RATIO_RANGE = 0.55, 0.75
# [1] largest correlation of adjacent residuals. The errors of a scan are independent; the residuals of a coarse net are
# correlated. Larger: more meshes are smoothed.
MAX_CORRELATION = 0.4
# [1] ratio of the scores of cross-validation with and without stiffness above which the surface is not smoothed.
# Larger: more meshes are smoothed.
MAX_SCORE_RATIO = 0.98
# [1] most sample sites per span and direction over a scan. Larger: more noise is averaged, more time.
MAX_SITES_PER_SPAN = 9
STIFFNESSES = np.logspace(-5, 4, 37)  # [1] candidates, relative to the weight of the samples


def looks_noisy(mesh: TriangleMesh, samples: RaySamples, gaps: Array | float, unknowns: int) -> bool:
    """Return whether the residuals of the least squares look like the noise of a scan that is denser than the net."""
    residuals = samples.residuals + gaps
    size = np.abs(residuals[~np.isnan(residuals)])
    rms = np.sqrt((size**2).mean())
    if (
        rms <= MIN_NOISE_FRACTION * mesh.size
        or not MEDIAN_RATIO_RANGE[0] < np.median(size) / rms < MEDIAN_RATIO_RANGE[1]
    ):
        return False
    neighbors = residuals[1:] * residuals[:-1], residuals[:, 1:] * residuals[:, :-1]
    if min(np.nansum(x) / max((~np.isnan(x)).sum(), 1) for x in neighbors) > MAX_CORRELATION * rms**2:
        return False
    return hit_vertices(mesh, samples) >= MIN_VERTICES_PER_CONTROL_POINT * unknowns


def sites_for_noise(mesh: TriangleMesh, basis: TensorBasis, samples: RaySamples) -> int:
    """Return the sites per span and direction that give about as many samples as the mesh has vertices.

    Fewer sites leave vertices out of the mean that removes the noise.
    """
    spans = basis.spans * (~np.isnan(samples.residuals)).mean()  # without holes
    return min(int(np.ceil(np.sqrt(hit_vertices(mesh, samples) / spans))), MAX_SITES_PER_SPAN)


def hit_vertices(mesh: TriangleMesh, samples: RaySamples) -> int:
    """Return the number of corners of the facets that rays hit.

    Other vertices, such as those of a subdivision, are between corners and have no noise of their own.
    """
    return int(facet_corners(mesh, samples.faces[~np.isnan(samples.residuals)]).sum())


def best_stiffness(
    mesh: TriangleMesh, basis: TensorBasis, samples: RaySamples, gaps: Array | float, offsets: Array
) -> tuple[float, float]:
    r"""Return the stiffness with the least generalized cross-validation (Craven and Wahba, 1979), for a noisy scan.

    .. math::

        \mathrm{GCV}(\lambda) = \frac{\lVert E_\lambda \rVert^2}{(1 - \operatorname{tr} A_\lambda / n)^2}
        \quad [\text{m}^2]

    Here :math:`E_\lambda` are the residuals, :math:`A_\lambda` maps the samples to the fit, and :math:`n` is the number
    of independent samples. Samples on the same facet have the noise of the same corners. The mean of the facets over
    many vertices has the variance of half as many independent samples, so :math:`n` is at most half of the number of
    vertices.
    """
    known = ~np.isnan(samples.residuals)
    square = float(((samples.residuals + gaps)[known] ** 2).sum())
    independent = min(int(known.sum()), hit_vertices(mesh, samples) / 2)
    amplitude, bend = basis.modes(offsets)
    damping = 1 / (1 + STIFFNESSES[:, None, None] * bend)  # of each mode, for each stiffness
    squares = square + (amplitude**2 * (1 - damping) ** 2).sum(axis=(1, 2))
    free = 1 - np.append(offsets.size, damping.sum(axis=(1, 2))) / independent
    scores = np.append(square, squares) / free**2
    best = int(np.argmin(scores))
    if scores[best] > MAX_SCORE_RATIO * scores[0]:
        return 0.0, 0.0
    return float(STIFFNESSES[best - 1]), float(np.sqrt(scores[best] * free[best] / known.sum()))
