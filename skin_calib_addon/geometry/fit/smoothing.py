"""How stiff a surface should be over a noisy scan: as stiff as makes it tell best what it was not fitted to."""

import numpy as np

from ...common.arrays import Array
from ..mesh.triangle_mesh import TriangleMesh
from ..sampling.basis import TensorBasis
from ..sampling.samples import RaySamples

# Residuals below this share of the mesh's size are facets of a good model: nothing is gained over them.
MIN_NOISE_FRACTION = 3e-4
# A mesh with fewer vertices than this for each control point has none to spare: its facets are the shape.
MIN_VERTICES_PER_CONTROL_POINT = 3
# Half of the samples of a normal error lie within 0.67 of its standard deviation; where edges, steps or openings make
# the residuals, a few large ones rule and most are far smaller, and over facets that are chords most are alike.
MEDIAN_RATIO_RANGE = 0.55, 0.75
# The errors of a scan are each vertex's own; what a coarse net leaves of a shape goes along from sample to sample.
MAX_CORRELATION = 0.4
# Stiffness must lower the expected error of prediction by this factor, or least squares stay as they are.
MAX_SCORE_RATIO = 0.98
MAX_SITES_PER_SPAN = 9  # per span
STIFFNESSES = np.logspace(-5, 4, 37)


def looks_noisy(mesh: TriangleMesh, samples: RaySamples, gaps: Array | float, unknowns: int) -> bool:
    """Whether what least squares leave looks like the error of a scan that is denser than the net.

    Parameters
    ----------
    gaps : array, shape (k, l), or 0
        How far out of the mesh the surface is to lie at each site [m].
    unknowns : int
        Control points.
    """
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
    """Sites per span, in each direction, that make about as many samples as the mesh has vertices there.

    Fewer leave vertices out of the mean that takes the noise away.
    """
    spans = basis.spans * (~np.isnan(samples.residuals)).mean()  # where there is mesh
    return min(int(np.ceil(np.sqrt(hit_vertices(mesh, samples) / spans))), MAX_SITES_PER_SPAN)


def hit_vertices(mesh: TriangleMesh, samples: RaySamples) -> int:
    """How many vertices the faces have that rays met."""
    hit = np.zeros(len(mesh.vertices), bool)
    hit[mesh.faces[samples.faces[~np.isnan(samples.residuals)]]] = True
    return int(hit.sum())


def best_stiffness(
    mesh: TriangleMesh, basis: TensorBasis, samples: RaySamples, gaps: Array | float, offsets: Array
) -> tuple[float, float]:
    """Stiffness of the net with the least generalised cross-validation (Craven and Wahba, 1979), for a noisy scan.

    Samples that share facets share the noise of their corners. The mean of the facets over many vertices scatters as
    that of half as many independent samples of the facets would, so no more than those count.

    Parameters
    ----------
    samples : RaySamples
        Of the least squares without stiffness.
    gaps : array, shape (k, l), or 0
        How far out of the mesh the surface is to lie at each site [m].
    offsets : array, shape (n, m)
        Of the control points along their lines [m].

    Returns
    -------
    stiffness : float
        For ``TensorBasis.solve``; 0 where stiffness promises nothing.
    noise : float
        Standard deviation of the mesh about the surface that it leaves [m]; 0 with it.
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
