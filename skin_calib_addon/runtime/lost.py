"""Bound the force on taxels without a valid reading: what they carried last, and what their neighbours carry."""

import numpy as np

from ..common.arrays import Array, BoolArray
from .geometry import SkinGeometry

# [1] Force that taxels without a reading may carry, relative to that of the others, above which sums say nothing.
# Larger: wrench and CoP with large deviations; smaller: fewer frames have them.
MAX_LOST_FRACTION = 0.5


class Lost:
    """Remember the last force of each taxel; ``nan`` where it has had none since the skin forgot its past."""

    def __init__(self, skin: SkinGeometry):
        self._skin = skin
        self.forget()

    def forget(self) -> None:
        """Forget all forces."""
        self._last = np.full(len(self._skin.ids), np.nan)

    def accept(self, pushes: Array, known: BoolArray | None) -> None:
        """Store the parts of the sums (n,) [N] of the taxels that are known (n,); None: all."""
        self._last = pushes if known is None else np.where(known, pushes, self._last)

    def of(self, pushes: Array, known: BoolArray, live: BoolArray) -> tuple[Array, str | None]:
        """Return the bounds and the problem of a frame, see :func:`lost_forces`."""
        return lost_forces(self._skin, pushes, known, live, self._last)


def lost_forces(
    skin: SkinGeometry, pushes: Array, known: BoolArray, live: BoolArray, last: Array
) -> tuple[Array, str | None]:
    """Return what each taxel without a valid reading may carry (n,) [N], and why the sums say nothing, or None.

    ``pushes`` (n,) [N] are parts of the sums, 0 where they are not known; ``known`` (n,) have a valid force. Taxels
    that are ``live`` (n,), neither masked nor dead, count with what they carried ``last`` (n,) [N], NaN if unknown.
    """
    missing = ~known & live
    bounds = np.where(known, 0.0, np.maximum(skin.filled(pushes, known), np.where(missing, np.nan_to_num(last), 0.0)))
    lost, rest = float(bounds.sum()), max(float(pushes.sum()), 0.0)
    if lost > MAX_LOST_FRACTION * rest:
        count = np.count_nonzero(bounds)
        return bounds, f"{count} taxels without a valid reading may carry {lost:.2g} N, all others carry {rest:.2g} N"
    unseen = missing & np.isnan(last)
    if rest == 0 and unseen.any():
        name = skin.ids[int(unseen.argmax())]
        what = f"{np.count_nonzero(unseen)} taxels have had no valid reading yet, the first is {name}"
        return bounds, f"{what}; mask those that are defective"
    return bounds, None
