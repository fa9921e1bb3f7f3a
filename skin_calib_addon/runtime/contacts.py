"""Compute the contacts: connected active taxels with their force, position and wrench."""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ..common.arrays import Array, IntArray, locked
from .footprint import Footprint
from .geometry import SkinGeometry, Terms

# Length of a mean normal [1] below which the normals cancel and the contact has no normal. Derived: from rounding.
MIN_MEAN_NORMAL = 1e-9


class Message(NamedTuple):
    """The message of the paper (eq. 1 and 2), weighted by force: position in rows and columns of a patch, and force."""

    patch: int
    row: float  # cell (k, l) has its centre at (k, l)
    column: float
    force: float  # [N], sum over the taxels


@dataclass(frozen=True, eq=False)
class Contact:
    """Connected active taxels and the force on them; link frame and SI units."""

    number: int  # stays with the contact from cycle to cycle
    taxels: IntArray  # rows in the skin's arrays, ascending
    forces: Array  # (a,) on each of the taxels [N]
    sums: Array  # (11,) sums of :attr:`.SkinGeometry.terms` over the taxels, weighted by the forces
    skin: SkinGeometry

    @property
    def force(self) -> float:
        """Sum over the taxels [N]."""
        return float(self.sums[0])

    @property
    def wrench(self) -> Array:
        """Wrench (6,) of the contact on the robot, about the origin of the link [N, N m]."""
        return self.sums[5:]

    @property
    def normal(self) -> Array:
        """Force-weighted mean (3,) of the outward normals, unit length; zero if the normals cancel."""
        return self._position_and_normal[1]

    @property
    def position(self) -> Array:
        r"""Force-weighted mean (3,) of the taxel positions, raised to the surface [m] (paper eq. 1, corrected).

        The mean :math:`\mathbf{c}` of points on a curved surface is below the surface. With the force-weighted means
        :math:`\mathbf{m}` of the normals and :math:`s` of the heights :math:`\mathbf{n}_i \cdot \mathbf{p}_i` of the
        tangent planes, the position is

        .. math::
            \mathbf{p} = \mathbf{c} + \frac{s - \mathbf{m} \cdot \mathbf{c}}{1 + \lVert \mathbf{m} \rVert}\;
            \frac{\mathbf{m}}{\lVert \mathbf{m} \rVert} .

        This is exact on spheres and across cylinders, and correct to second order on every surface.
        """
        return self._position_and_normal[0]

    @cached_property
    def _position_and_normal(self) -> tuple[Array, Array]:
        force, px, py, pz, height, fx, fy, fz, *_ = self.sums.tolist()
        cx, cy, cz = px / force, py / force, pz / force
        mx, my, mz = -fx / force, -fy / force, -fz / force
        length = math.sqrt(mx * mx + my * my + mz * mz)  # 1 if all normals are parallel
        if length < MIN_MEAN_NORMAL:
            return locked(np.array((cx, cy, cz))), locked(np.zeros(3))
        rise = (height / force - (mx * cx + my * cy + mz * cz)) / (1 + length) / length
        return (
            locked(np.array((cx + rise * mx, cy + rise * my, cz + rise * mz))),
            locked(np.array((mx / length, my / length, mz / length))),
        )

    @cached_property
    def area(self) -> float:
        """Area of the cells [m^2]."""
        return float(self.skin.areas[self.taxels].sum())

    @cached_property
    def peak_pressure(self) -> float:
        """Largest ratio of the force of a taxel to its area [Pa]."""
        return float((self.forces / self.skin.areas[self.taxels]).max())

    @property
    def ids(self) -> tuple[str, ...]:
        """Ids of the taxels."""
        return tuple(self.skin.ids[i] for i in self.taxels.tolist())

    @property
    def cells(self) -> dict[int, tuple[tuple[int, int], tuple[int, int]]]:
        """Bounding cells: (first row, last row) and (first column, last column) for each patch in contact.

        If a contact extends over the seam of a closed sheet, its first row or column is the higher number.
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
        r"""Messages of the paper (eq. 1 and 2, corrected), one for each patch in contact.

        Row and column are weighted by the forces :math:`f_i`, not divided by the number of cells. The third number is
        the force, not the sum of the readings:

        .. math::
            (k, l) = \frac{\sum f_i \, (k_i, l_i)}{\sum f_i} , \qquad F = \sum f_i .
        """
        messages = []
        for patch, ((first_row, _), (first_column, _)) in self.cells.items():
            in_patch = self.skin.patch[self.taxels] == patch
            f, index = self.forces[in_patch], self.skin.index[self.taxels[in_patch]].astype(float)
            for k, (first, period) in enumerate(zip((first_row, first_column), self.skin.periods[patch])):
                if period:
                    index[:, k] = first + (index[:, k] - first) % period
            row, column = f @ index / f.sum()
            row, column = (x % period if period else x for x, period in zip((row, column), self.skin.periods[patch]))
            messages.append(Message(patch, float(row), float(column), float(f.sum())))
        return tuple(messages)


def _span(index: IntArray, period: int) -> tuple[int, int]:
    """Return the first and last of some rows or columns; in a closed sheet, of the shortest arc that contains them."""
    present = np.unique(index)
    if not period or len(present) == 1:
        return int(present[0]), int(present[-1])
    gaps = np.diff(present, append=present[0] + period)
    widest = int(gaps.argmax())
    return int(present[(widest + 1) % len(present)]), int(present[widest])


def contacts_of(footprint: Footprint, forces: Array, numbers: list[int], terms: Terms) -> tuple[Contact, ...]:
    """Return the contacts of a frame with forces (n,) [N], in the order of their first taxels."""
    if not numbers:
        return ()
    rows, bounds = footprint.ordered
    skin, f, weights = footprint.skin, locked(forces[rows]), terms.rows[rows]
    return tuple(
        Contact(number, rows[i:j], f[i:j], locked(f[i:j].dot(weights[i:j])), skin)
        for number, i, j in zip(numbers, bounds, bounds[1:])
    )
