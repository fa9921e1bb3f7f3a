"""Contacts keep their number from cycle to cycle."""

import numpy as np

from ..common.arrays import IntArray
from .footprint import Footprint

NONE = -1


class Identities:
    """Numbers of the contacts of the last frame; a contact inherits where it overlaps, or borders, what was there."""

    def __init__(self, n: int):
        self._owner = np.full(n + 1, NONE)  # of each taxel, which contact of the last frame it was part of
        self._last: Footprint | None = None
        self._numbers: list[int] = []
        self._next = 1

    def follow(self, footprint: Footprint) -> list[int]:
        """Numbers of a frame's contacts, which is then the last frame.

        The contact that shares most taxels with one of the last frame inherits its number, the longer living one where
        several are equal; what shares none with any looks at the neighbours of its taxels, for a contact moves by less
        than a cell in a cycle; the others get numbers never used before.
        """
        if footprint is self._last:
            return self._numbers
        rows, groups = footprint.rows, footprint.groups
        numbers: list[int | None] = [None] * len(footprint.ordered[1])
        self._inherit(numbers, self._owner.take(rows), groups)
        if None in numbers and self._numbers:
            for owners in self._owner.take(footprint.skin.beside.take(rows, axis=1)):
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
        """Nothing was there in the last frame; numbers are still never used twice."""
        if self._last is not None:
            self._owner[self._last.rows] = NONE
        self._last, self._numbers = None, []

    def _inherit(self, numbers: list[int | None], owners: IntArray, groups: IntArray) -> None:
        """Give groups without a number that of a contact of the last frame that ``owners`` share most with them."""
        count = len(numbers)
        shared = np.bincount((owners - NONE) * count + groups)[count:]  # the first are those of no contact
        pairs = [(-int(shared[k]), self._numbers[k // count], k % count) for k in shared.nonzero()[0].tolist()]
        for _, number, group in sorted(pairs):
            if numbers[group] is None and number not in numbers:
                numbers[group] = number
