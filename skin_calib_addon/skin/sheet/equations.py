"""Newton's equations of a net with constraints: a banded matrix, as only adjacent nodes interact."""

from functools import lru_cache

import numpy as np
from scipy.linalg import LinAlgError, solve, solveh_banded

from ...common.arrays import Array
from .net import Net

# Stiffness of every node, as a fraction of the mean stiffness. A node with a single pair could otherwise rotate freely.
# Larger: more stable, and slower convergence.
STABILIZING_FRACTION = 1e-9


class NetEquations:
    r"""Newton's equations of a net with constraints.

    The unknowns are the steps dx of the parameters (u, v) of all nodes, and one multiplier per constraint:

    .. math::
        H\,dx = -J^T e + Q^T \lambda, \qquad C\,dx = -c

    - e are the strains of the pairs, with the Jacobian J;
    - H = J^T J + T is the stiffness; T is the part from the rotation of the pairs (zero for Gauss-Newton);
    - c are the violations of the constraints, with the Jacobian C;
    - Q are the distributed forces that keep the constraints.

    H is banded and can be singular: a sheet slides on a cylinder without strain. Springs at two nodes make it regular.
    The Schur complement removes the springs again.
    """

    def __init__(self, net: Net):
        self.order, self.size = net.order, 2 * len(net.flat)
        unknowns = (2 * net.order[net.pairs][:, :, None] + np.arange(2)).reshape(-1, 4)
        row, column = np.repeat(unknowns, 4, axis=1), np.tile(unknowns, (1, 4))
        self.lower = row >= column
        self.unknowns = unknowns
        self.width = int((row - column).max()) + 1
        self.entry = ((row - column) * self.size + column)[self.lower]
        # Springs at two nodes: the pinned one and the farthest one. They prevent sliding and rotation.
        far = int(np.argmax((net.flat**2).sum(axis=1)))
        self.fixed = (2 * net.order[[net.pin, far], None] + np.arange(2)).ravel()

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
        """Return the step of the parameters of all nodes, shape (n, 2); None if H is not positive definite."""
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
            # The step is answers @ (1, multipliers, steps of the spring nodes). The constraints must be kept, and the
            # steps of the spring nodes must agree with the step itself.
            violations = np.concatenate((self._in_order(jacobian) @ answers, answers[self.fixed]))
            violations[k:, 1 + k :] -= np.eye(len(self.fixed))
            violations[:k, 0] += violation
            largest = np.abs(violations[:, 1:]).max(axis=0)  # scaling: displacements differ by orders
            multipliers = solve(violations[:, 1:] / largest, -violations[:, 0], check_finite=False) / largest
        except (LinAlgError, ValueError):
            return None
        step = answers[:, 0] + answers[:, 1:] @ multipliers
        return step.reshape(-1, 2)[self.order] if np.isfinite(step).all() else None

    def _in_order(self, values: Array) -> Array:
        """Return values of nodes in the order of the unknowns, shape (k, 2 n)."""
        ordered = np.empty_like(values)
        ordered[:, self.order] = values
        return ordered.reshape(len(values), -1)


@lru_cache(maxsize=8)
def equations_of(net: Net) -> NetEquations:
    """Return the equations of a net; they are cached for repeated solutions with one net."""
    return NetEquations(net)
