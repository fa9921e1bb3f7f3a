"""Newton's equations of a net: a banded matrix, for only nodes beside each other meet, and the ties that hold it."""

from functools import lru_cache

import numpy as np
from scipy.linalg import LinAlgError, solve, solveh_banded

from ...common.arrays import Array
from .net import Net

# Share of the mean stiffness that nodes have against any move: what hangs on one pair alone is free to swing about it.
STABILIZING_FRACTION = 1e-9


class NetEquations:
    """Newton's equations of a net that ties hold in place."""

    def __init__(self, net: Net):
        self.order, self.size = net.order, 2 * len(net.flat)
        unknowns = (2 * net.order[net.pairs][:, :, None] + np.arange(2)).reshape(-1, 4)
        row, column = np.repeat(unknowns, 4, axis=1), np.tile(unknowns, (1, 4))
        self.lower = row >= column
        self.unknowns = unknowns
        self.width = int((row - column).max(initial=0)) + 1
        self.entry = ((row - column) * self.size + column)[self.lower]
        # Two nodes held by springs, which are taken back below, keep the matrix from being singular: a sheet on a
        # cylinder slides and turns at no cost.
        far = int(np.argmax((net.flat**2).sum(axis=1)))
        self.fixed = (2 * net.order[[net.pin, far], None] + np.arange(2)).ravel()[: 2 if far == net.pin else 4]

    def step(
        self,
        strain_slopes: Array,
        turn_slopes: Array,
        turn_stiffness: Array | None,
        strain: Array,
        jacobian: Array,
        violation: Array,
        loads: Array,
    ) -> Array | None:
        """Step of the parameters of all nodes, shape (n, 2); None if the matrix is not positive definite.

        Parameters
        ----------
        along, sideways : array, shape (e, 2, 2)
            How the strain of each pair, and its turn, change with the parameters of its two nodes.
        stretch : array, shape (e,), or None
            Stiffness against turning; None leaves it out (Gauss-Newton).
        strain : array, shape (e,)
        rows : array, shape (k, n, 2)
            How each tie changes with the parameters.
        off : array, shape (k,)
            By how much each tie is not kept.
        loads : array, shape (k, n, 2)
            The forces that may keep the ties, as they act on the parameters.
        """
        strain_slopes, turns = strain_slopes.reshape(-1, 4), turn_slopes.reshape(-1, 4)
        blocks = strain_slopes[:, :, None] * strain_slopes[:, None]
        if turn_stiffness is not None:
            blocks += turn_stiffness[:, None, None] * turns[:, :, None] * turns[:, None]
        band: Array = np.zeros(self.width * self.size)
        band += np.bincount(self.entry, blocks.reshape(-1, 16)[self.lower], band.size)
        band = band.reshape(self.width, self.size)
        spring = float(band[0].mean())
        band[0, self.fixed] += spring
        band[0] += STABILIZING_FRACTION * spring

        k = len(violation)
        right = np.zeros((self.size, 1 + k + len(self.fixed)))
        right[:, 0] = -np.bincount(self.unknowns.ravel(), (strain_slopes * strain[:, None]).ravel(), self.size)
        right[:, 1 : 1 + k] = self._in_order(loads).T
        right[self.fixed, 1 + k + np.arange(len(self.fixed))] = spring
        try:
            answers = solveh_banded(band, right, overwrite_ab=True, lower=True, check_finite=False)
            # The step is answers @ (1, forces, steps of the held nodes); it keeps the ties, and is what it says.
            violations = np.concatenate((self._in_order(jacobian) @ answers, answers[self.fixed]))
            violations[k:, 1 + k :] -= np.eye(len(self.fixed))
            violations[:k, 0] += violation
            largest = np.abs(violations[:, 1:]).max(axis=0)  # a force that meets little stiffness moves much
            multipliers = solve(violations[:, 1:] / largest, -violations[:, 0], check_finite=False) / largest
        except (LinAlgError, ValueError):
            return None
        step = answers[:, 0] + answers[:, 1:] @ multipliers
        return step.reshape(-1, 2)[self.order] if np.isfinite(step).all() else None

    def _in_order(self, values: Array) -> Array:
        """Values of nodes as values of unknowns, shape (k, 2 n)."""
        ordered = np.empty_like(values)
        ordered[:, self.order] = values
        return ordered.reshape(len(values), -1)


@lru_cache(maxsize=8)
def equations_of(net: Net) -> NetEquations:
    """The equations of a net, made once while it is dragged about."""
    return NetEquations(net)
