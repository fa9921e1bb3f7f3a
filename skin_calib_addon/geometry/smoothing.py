"""How stiff a surface should be over a noisy scan: as stiff as makes it tell best what it was not fitted to."""

import numpy as np

from ..arrays import Array, IntArray
from .basis import TensorBasis
from .mesh import TriangleMesh

# Residuals below this share of the mesh's size are facets of a good model: nothing is gained over them.
FINEST = 3e-4
# A mesh with fewer vertices than this for each control point has none to spare: its facets are the shape.
FEWEST_VERTICES = 3
# Half of the samples of a normal error lie within 0.67 of its standard deviation; where edges, steps or openings make
# the residuals, a few large ones rule and most are far smaller, and over facets that are chords most are alike.
NORMAL = 0.55, 0.75
# Stiffness must lower the expected error of prediction by this factor, or least squares stay as they are.
GAIN = 0.98
STIFFNESSES = np.logspace(-5, 4, 37)


def best_stiffness(
    mesh: TriangleMesh, basis: TensorBasis, residuals: Array, offsets: Array, faces: IntArray
) -> tuple[float, float]:
    """Stiffness of the net with the least generalised cross-validation (Craven and Wahba, 1979).

    Samples that share facets share the noise of their corners. The mean of the facets over many vertices scatters as
    that of half as many independent samples of the facets would, so no more than those count.

    Parameters
    ----------
    residuals : array, shape (k, l)
        Of the least squares without stiffness [m]; NaN where a ray met nothing.
    offsets : array, shape (n, m)
        Of the control points along their lines [m].
    faces : array of int, shape (k, l)
        That were met.

    Returns
    -------
    stiffness : float
        For ``TensorBasis.solve``; 0 where stiffness promises nothing.
    noise : float
        Standard deviation of the mesh about the surface that it leaves [m]; 0 with it.
    """
    known = ~np.isnan(residuals)
    square = float((residuals[known] ** 2).sum())
    rms = np.sqrt(square / known.sum())
    if rms <= FINEST * mesh.size or not NORMAL[0] < np.median(np.abs(residuals[known])) / rms < NORMAL[1]:
        return 0.0, 0.0
    vertices = len(np.unique(mesh.faces[np.unique(faces[known])]))
    if vertices < FEWEST_VERTICES * offsets.size:
        return 0.0, 0.0
    independent = min(int(known.sum()), vertices / 2)
    amplitude, bend = basis.modes(offsets)
    damping = 1 / (1 + STIFFNESSES[:, None, None] * bend)  # of each mode, for each stiffness
    squares = square + (amplitude**2 * (1 - damping) ** 2).sum(axis=(1, 2))
    free = 1 - np.append(offsets.size, damping.sum(axis=(1, 2))) / independent
    scores = np.append(square, squares) / free**2
    best = int(np.argmin(scores))
    if scores[best] > GAIN * scores[0]:
        return 0.0, 0.0
    return float(STIFFNESSES[best - 1]), float(np.sqrt(scores[best] * free[best] / known.sum()))
