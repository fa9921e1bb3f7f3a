"""Newton's equations of a lattice of nodes, each of which meets only those beside it."""

import numpy as np
from scipy.linalg import LinAlgError, solveh_banded

from ..arrays import Array, IntArray

# Weight of the sheet's direction beside the strains: it must hold, and the equations must stay solvable.
FIRM = 100.0


class LatticeEquations:
    """Newton's equations of a lattice: a banded matrix, for only nodes beside each other meet.

    Nodes are counted along the shorter side, which keeps the band narrow.
    """

    def __init__(self, shape: tuple[int, int], pairs: IntArray, pin: int):
        a, b = shape
        count = np.arange(a * b).reshape(b, a).T if a <= b else np.arange(a * b).reshape(a, b)
        self.place, self.pin = count.ravel(), pin
        unknowns = (2 * self.place[pairs][:, :, None] + np.arange(2)).reshape(-1, 4)
        row, column = np.repeat(unknowns, 4, axis=1), np.tile(unknowns, (1, 4))
        self.lower = row >= column
        self.unknowns, self.size = unknowns, 2 * a * b
        self.width = int((row - column).max()) + 1
        self.entry = ((row - column) * self.size + column)[self.lower]

    def newton_step(
        self,
        slopes: Array,
        sideways: Array,
        stretch: Array | None,
        strain: Array,
        turn_slopes: Array,
        heading: float,
    ) -> Array | None:
        """Step of the parameters of all nodes, shape (nodes, 2); None if the matrix is not positive definite.

        Parameters
        ----------
        slopes, sideways : array, shape (e, 2, 2)
            How the strain of each edge, and its turn, change with the parameters of its two ends.
        stretch : array, shape (e,), or None
            Stiffness against turning; None leaves it out (Gauss-Newton).
        strain : array, shape (e,)
        turn_slopes : array, shape (2, 2)
            How the heading changes with the parameters of the nodes before and after the pinned one.
        heading : float
        """
        along, turn = slopes.reshape(-1, 4), sideways.reshape(-1, 4)
        blocks = along[:, :, None] * along[:, None]
        if stretch is not None:
            blocks += stretch[:, None, None] * turn[:, :, None] * turn[:, None]
        band: Array = np.zeros(self.width * self.size)
        band += np.bincount(self.entry, blocks.reshape(-1, 16)[self.lower], band.size)
        band = band.reshape(self.width, self.size)
        right = np.zeros((self.size, 2))
        right[:, 0] = -np.bincount(self.unknowns.ravel(), (along * strain[:, None]).ravel(), self.size)
        # The heading ties two nodes that the band does not reach: its equation comes in as a rank-one change
        # (Sherman and Morrison, 1950), and a little of it stays in the band, so that no turn is free there.
        turning = (2 * self.place[[self.pin - 1, self.pin + 1], None] + np.arange(2)).ravel()
        right[turning, 1] = turn_slopes.ravel()
        right[turning, 0] -= turn_slopes.ravel() * heading
        band[0, turning] += (turn_slopes.ravel() / FIRM) ** 2
        self._hold_pinned(band, right)
        try:
            steps = solveh_banded(band, right, overwrite_ab=True, lower=True, check_finite=False)
        except LinAlgError:
            return None
        plain, tie = steps.T
        slope = right[:, 1]
        step = plain - tie * (slope @ plain) / (1 + slope @ tie)
        return step.reshape(-1, 2)[self.place] if np.isfinite(step).all() else None

    def _hold_pinned(self, band: Array, right: Array) -> None:
        """Replace the equations of the pinned node by "no step"."""
        for i in (2 * self.place[self.pin], 2 * self.place[self.pin] + 1):
            band[:, i] = 0.0
            reach = np.arange(1, min(self.width, i + 1))
            band[reach, i - reach] = 0.0
            band[0, i], right[i] = 1.0, 0.0
