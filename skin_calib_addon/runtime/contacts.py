"""Contacts: connected active taxels, and what presses on them."""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ..common.arrays import Array, IntArray
from .footprint import Footprint
from .geometry import SkinGeometry

# Normals whose mean is this short have no direction in common.
CANCELLED = 1e-9


class Message(NamedTuple):
    """A contact as the paper sends it, weighted rightly: where in the patch's rows and columns, and how strong."""

    patch: int
    row: float  # cell (k, l) has its centre at (k, l)
    column: float
    force: float  # [N], the sum over the taxels


@dataclass(frozen=True, eq=False)
class Contact:
    """Active taxels that touch each other, and what presses on them; link frame and SI units."""

    number: int  # stays with the contact from cycle to cycle
    taxels: IntArray  # rows in the skin's arrays, ascending
    forces: Array  # (a,) on each of the taxels [N]
    sums: Array  # (11,) of :attr:`.SkinGeometry.sums` over the taxels, weighted by the forces
    skin: SkinGeometry

    @property
    def force(self) -> float:
        """Sum over the taxels [N]."""
        return float(self.sums[0])

    @property
    def wrench(self) -> Array:
        """(6,) force and moment about the link's origin that the contact applies to the robot [N, N m]."""
        return self.sums[5:]

    @property
    def normal(self) -> Array:
        """(3,) force-weighted mean of the outward normals, unit; zero where they cancel, as round a limb."""
        return self._place[1]

    @property
    def position(self) -> Array:
        """(3,) force-weighted mean of the taxels, raised onto the surface [m].

        The mean of points on a bent surface lies below it. Were the taxels on a sphere or across a cylinder, of
        whatever size, the surface would be (w.s - m.c) / (1 + |m|) above the mean c along the mean normal m, with the
        heights s of the tangent planes and the weights w: exactly, and to second order on any surface.
        """
        return self._place[0]

    @cached_property
    def _place(self) -> tuple[Array, Array]:
        force, px, py, pz, height, fx, fy, fz, *_ = self.sums.tolist()
        cx, cy, cz = px / force, py / force, pz / force
        mx, my, mz = -fx / force, -fy / force, -fz / force
        together = math.sqrt(mx * mx + my * my + mz * mz)  # 1 where all taxels look one way
        if together < CANCELLED:
            return np.array((cx, cy, cz)), np.zeros(3)
        below = (height / force - (mx * cx + my * cy + mz * cz)) / (1 + together) / together
        return (
            np.array((cx + below * mx, cy + below * my, cz + below * mz)),
            np.array((mx / together, my / together, mz / together)),
        )

    @cached_property
    def area(self) -> float:
        """Of the taxels [m^2]."""
        return float(self.skin.areas[self.taxels].sum())

    @cached_property
    def peak_pressure(self) -> float:
        """The largest force of a taxel over its area [Pa]."""
        return float((self.forces / self.skin.areas[self.taxels]).max())

    @property
    def ids(self) -> tuple[str, ...]:
        """Of the taxels."""
        return tuple(self.skin.ids[i] for i in self.taxels.tolist())

    @property
    def cells(self) -> dict[int, tuple[tuple[int, int], tuple[int, int]]]:
        """Bounding cells: for each patch touched, its first and last row, and first and last column.

        Where a contact lies over the seam of a closed sheet its first row or column is the higher one.
        """
        bounds = {}
        for patch in np.unique(self.skin.patch[self.taxels]).tolist():
            index = self.skin.index[self.taxels[self.skin.patch[self.taxels] == patch]]
            period = self.skin.periods[patch]
            first, last = zip(*(_span(index[:, k], period[k]) for k in range(2)))
            bounds[patch] = ((first[0], last[0]), (first[1], last[1]))
        return bounds

    @property
    def messages(self) -> tuple[Message, ...]:
        """The paper's message (its equations 1 and 2, corrected), one for each patch the contact lies on."""
        messages = []
        for patch, ((first_row, _), (first_column, _)) in self.cells.items():
            mine = self.skin.patch[self.taxels] == patch
            f, index = self.forces[mine], self.skin.index[self.taxels[mine]].astype(float)
            for k, (first, period) in enumerate(zip((first_row, first_column), self.skin.periods[patch])):
                if period:
                    index[:, k] = first + (index[:, k] - first) % period
            row, column = f @ index / f.sum()
            row, column = (x % period if period else x for x, period in zip((row, column), self.skin.periods[patch]))
            messages.append(Message(patch, float(row), float(column), float(f.sum())))
        return tuple(messages)


def _span(index: IntArray, period: int) -> tuple[int, int]:
    """First and last of some rows or columns; of a closed sheet those at the ends of the shortest way round."""
    have = np.unique(index)
    if not period or len(have) == 1:
        return int(have[0]), int(have[-1])
    gaps = np.diff(have, append=have[0] + period)
    widest = int(gaps.argmax())
    return int(have[(widest + 1) % len(have)]), int(have[widest])


def contacts_of(footprint: Footprint, forces: Array, numbers: list[int]) -> tuple[tuple[Contact, ...], Array]:
    """The contacts of a frame, those with the lowest taxel first, and the wrench (6,) of all of them.

    Parameters
    ----------
    footprint : Footprint
    forces : array, shape (n,)
        On every taxel of the skin [N], positive on the active ones.
    numbers : list of int
        The identity of each contact.
    """
    rows, starts = footprint.ordered
    if len(rows) == 0:
        return (), np.zeros(6)
    skin, f = footprint.skin, forces.take(rows)
    sums = np.add.reduceat(f * skin.sums.take(rows, axis=1), starts, axis=1)
    bounds = [*starts.tolist(), len(rows)]
    contacts = (
        Contact(number, rows[i:j], f[i:j], total, skin)
        for number, i, j, total in zip(numbers, bounds, bounds[1:], sums.T)
    )
    return tuple(contacts), sums[5:].sum(axis=1)
