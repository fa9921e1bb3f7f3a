"""Give contacts numbers that stay the same from cycle to cycle."""

import numpy as np

from ..common.arrays import IntArray
from .footprint import Footprint

# Marks a taxel that was in no contact. Derived: -1, one less than the first index of a contact.
NO_CONTACT = -1


class Identities:
    """Keep the numbers of the contacts of the last frame. A contact that overlaps or borders one takes its number."""

    def __init__(self, n: int):
        self._owner = np.full(n + 1, NO_CONTACT)  # index of the last frame's contact that each taxel was part of
        self._last: Footprint | None = None
        self._numbers: list[int] = []
        self._next = 1

    def follow(self, footprint: Footprint) -> list[int]:
        """Return the numbers of the contacts of a frame, and keep the frame as the last one.

        A number goes to the contact that has the most taxels in common with its contact of the last frame. Of equal
        candidates the lowest number wins. A contact without common taxels is compared by the neighbours of its taxels,
        because a contact moves by less than a cell in a cycle. All others get new numbers.
        """
        if footprint is self._last:
            return self._numbers
        rows, groups = footprint.rows, footprint.groups
        numbers: list[int | None] = [None] * (len(footprint.ordered[1]) - 1)
        self._inherit(numbers, self._owner.take(rows), groups)
        if None in numbers and self._numbers:
            for owners in self._owner.take(footprint.skin.neighbours.take(rows, axis=1)):
                self._inherit(numbers, owners, groups)
        final = []
        for number in numbers:
            final.append(self._next if number is None else number)
            self._next += number is None
        self.forget()
        self._owner[rows] = groups
        self._last, self._numbers = footprint, final
        return final

    def forget(self) -> None:
        """Forget the contacts of the last frame. Their numbers are never used again."""
        if self._last is not None:
            self._owner[self._last.rows] = NO_CONTACT
        self._last, self._numbers = None, []

    def _inherit(self, numbers: list[int | None], owners: IntArray, groups: IntArray) -> None:
        """Give each group (a,) without a number that of the last contact with the most ``owners`` (a,) in it."""
        count = len(numbers)
        overlaps = np.bincount((owners - NO_CONTACT) * count + groups)[count:]  # without those of no contact
        pairs = [(-int(overlaps[k]), self._numbers[k // count], k % count) for k in overlaps.nonzero()[0].tolist()]
        for _, number, group in sorted(pairs):
            if numbers[group] is None and number not in numbers:
                numbers[group] = number
