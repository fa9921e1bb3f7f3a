r"""Where the next touch says most about the position of a skin.

The displacement of a taxel at the flat position :math:`\mathbf{a}` by the motion :math:`\theta` of the skin is
:math:`J \theta`, :math:`J = (I \;\; \mathbf{a}^\perp)`. A touch of this taxel with the standard deviation
:math:`\sigma` changes the covariance :math:`C` of the motion to

.. math::

    C' = C - C J^T (J C J^T + \sigma^2 I)^{-1} J C

The next touch is that of the taxel, not touched yet, with which the largest standard error of all taxels is smallest.
"""

from typing import NamedTuple

import numpy as np

from ..common.arrays import Array
from .flat import flat_places
from .placement import Placement
from .registration import CENTROID_NOISES, USUAL_SHIFT, USUAL_TURN, moves_of

# [1] directions in which the outermost taxels are those with the largest standard errors. More: more exact.
DIRECTIONS = 32
# [fraction of the cell size] Standard deviation of a touch along an axis: of one cell, and of a centroid. Larger: the
# next touches are nearer to the middle.
CELL_NOISE, CENTROID_NOISE = 12**-0.5, CENTROID_NOISES[3]


class NextTouch(NamedTuple):
    """The taxel to touch next, and what it changes."""

    row: int  # of the taxel in the patch
    before: float  # largest standard error of a taxel, in its least certain direction [m]
    after: float  # the same with this touch [m]


def next_touch(placement: Placement) -> NextTouch | None:
    """Return the next touch of a patch; None for imported taxels, and if the touches do not fit the planned order."""
    patch = placement.patch
    if patch.kind == "imported" or placement.posterior is not None and not placement.is_explained:
        return None
    moves = moves_of(flat_places(patch, patch.taxels.index))
    angles = np.linspace(0, 2 * np.pi, DIRECTIONS, endpoint=False)
    outer = moves[np.unique((moves[:, ::-1, 2] * (1, -1) @ (np.cos(angles), np.sin(angles))).argmax(axis=0))]
    variance = float(patch.taxels.areas.mean()) * (CENTROID_NOISE if placement.evidence.axes.any() else CELL_NOISE) ** 2
    covariance = _covariance(placement, moves, variance)
    free = np.setdiff1d(np.arange(len(moves)), placement.rows)
    rows = free if len(free) else np.arange(len(moves))
    errors = [_largest(_with_touch(covariance, moves[row], variance), outer) for row in rows]
    best = int(np.argmin(errors))
    return NextTouch(int(rows[best]), _largest(covariance, outer), errors[best])


def _covariance(placement: Placement, moves: Array, variance: float) -> Array:
    """Return the covariance of the motion; with too few touches for a motion, that of a glued skin with these."""
    if placement.posterior is not None:
        return placement.posterior.covariance
    turning = np.append(-moves[:, :, 2].mean(axis=0), 1.0)  # about the middle of the skin
    covariance = np.diag((USUAL_SHIFT**2, USUAL_SHIFT**2, 0.0)) + USUAL_TURN**2 * np.outer(turning, turning)
    for row in placement.rows:
        covariance = _with_touch(covariance, moves[row], variance)
    return covariance


def _with_touch(covariance: Array, move: Array, variance: float) -> Array:
    """Return the covariance after a touch of a taxel whose displacement is ``move`` (2, 3)."""
    known = move @ covariance
    return np.asarray(covariance - known.T @ np.linalg.solve(known @ move.T + variance * np.eye(2), known))


def _largest(covariance: Array, moves: Array) -> float:
    """Return the largest standard error of displacements, in any direction [m]."""
    return float(np.sqrt(np.linalg.eigvalsh(moves @ covariance @ moves.transpose(0, 2, 1))[:, -1].max()))
