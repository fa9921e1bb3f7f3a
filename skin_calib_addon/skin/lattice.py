"""Flat lattices: where the cells of a skin lie before it is wrapped on a surface."""

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from ..common.arrays import Array, IntArray
from ..common.errors import InvalidPlan

# Relative differences of lengths below this are rounding: of a cell, a pitch or a step.
ROUNDING = 1e-6

Hand = Literal["right", "left"]
Offsets = tuple[tuple[int, int], ...]


@dataclass(frozen=True)
class SheetLattice:
    """``rows`` x ``columns`` rectangular cells; a row runs along x, and the next row lies in the direction of y.

    Of a left-handed sheet the next row lies on the other side: against y. Its nodes stand at half the pitch, so that
    every cell has one at its centre, its corners and its edges: node (2 i + 1, 2 j + 1) is the centre of cell (i, j).
    """

    rows: int
    columns: int
    pitch: tuple[float, float]  # [m] from one row to the next, and from one column to the next
    hand: Hand = "right"

    def __post_init__(self):
        if self.rows < 1 or self.columns < 1 or min(self.pitch) <= 0:
            raise InvalidPlan(
                f"a sheet of {self.rows} x {self.columns} cells with pitch {list(self.pitch)} has no area; use "
                "positive numbers"
            )

    @property
    def node_shape(self) -> tuple[int, int]:
        """Number of nodes across the rows and along them."""
        return 2 * self.rows + 1, 2 * self.columns + 1

    @property
    def step(self) -> tuple[float, float]:
        """Along y and x from one node to the next, across the rows and along them [m]."""
        return (self.pitch[0] if self.hand == "right" else -self.pitch[0]) / 2, self.pitch[1] / 2

    @cached_property
    def index(self) -> IntArray:
        """Row and column of each cell, shape (rows * columns, 2), row by row."""
        return np.stack(np.divmod(np.arange(self.rows * self.columns), self.columns), axis=1)

    def counter_clockwise(self, offsets: Offsets) -> Offsets:
        """Offsets that run counter-clockwise for a right-handed sheet, so that they do; the first stays the first."""
        return offsets if self.hand == "right" else (offsets[0], *offsets[:0:-1])

    def at_cells(self, nodes: Array, offsets: Offsets) -> Array:
        """Node values at half-pitch ``offsets`` (row, column) from the centres, shape (cells, offsets, ...)."""
        i, j = (2 * self.index + 1).T
        return np.stack([nodes[i + a, j + b] for a, b in offsets], axis=1)


CENTRE = ((0, 0),)
# Counter-clockwise seen from outside where the next row lies along y: x along the row, z out of the robot.
CORNERS = ((-1, -1), (-1, 1), (1, 1), (1, -1))
EDGES = ((0, 1), (1, 0), (0, -1), (-1, 0))


@dataclass(frozen=True)
class HexLattice:
    """Regular hexagons of ``side``, with a ``gap`` between the sides that face each other; rows run along x.

    A cell has axial coordinates (q, r): one step in q leads along x, one in r to 60 degrees from it. Boards that are
    trimmed at their sides stand closer than their outlines: then the gap is negative.
    """

    side: float  # [m]
    gap: float  # [m]

    def __post_init__(self):
        if self.side <= 0 or self.pitch <= 0:
            raise InvalidPlan(
                f"hexagons with sides of {self.side * 1e3:g} mm and gaps of {self.gap * 1e3:g} mm have no room; "
                "lengths are in metres"
            )

    @property
    def pitch(self) -> float:
        """Distance between the centres of neighbours [m]."""
        return float(np.sqrt(3)) * self.side + self.gap

    @property
    def row_step(self) -> float:
        """Distance between rows [m]."""
        return float(np.sqrt(0.75)) * self.pitch

    @property
    def area(self) -> float:
        """Of one cell [m^2]."""
        return float(np.sqrt(6.75)) * self.side**2

    def centres(self, cells: IntArray) -> Array:
        """Flat centres of cells with axial coordinates of shape (n, 2); shape (n, 2) [m]."""
        q, r = np.asarray(cells).reshape(-1, 2).T
        return np.column_stack((self.pitch * (q + r / 2), self.row_step * r))

    def cell_at(self, point: Array) -> tuple[int, int]:
        """Axial coordinates of the cell that a flat place (2,) [m] is nearest to."""
        r = point[1] / self.row_step
        q = point[0] / self.pitch - r / 2
        near = np.floor((q, r)).astype(int) + [(0, 0), (1, 0), (0, 1), (1, 1)]
        nearest = near[np.argmin(((self.centres(near) - point) ** 2).sum(axis=1))]
        return int(nearest[0]), int(nearest[1])

    @property
    def corners(self) -> Array:
        """Corners of a cell about its centre, counter-clockwise from 30 degrees below x, shape (6, 2) [m]."""
        angles = np.deg2rad(60 * np.arange(6) - 30)
        return self.side * np.column_stack((np.cos(angles), np.sin(angles)))


# Side k of a hexagon lies between its corners k and k + 1; beyond it stands the cell this far away.
PORTS = ((1, 0), (0, 1), (-1, 1), (-1, 0), (0, -1), (1, -1))
