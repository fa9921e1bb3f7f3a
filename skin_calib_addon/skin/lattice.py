"""Flat lattices: positions of the cells of a skin before its placement on a surface."""

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from ..common.arrays import Array, IntArray
from ..common.errors import InvalidPlan

# Relative difference of two lengths (cells, pitches, steps), and of slopes and multipliers of a linear program, up to
# which they are equal. Larger: cells that are really apart count as touching.
ROUNDING = 1e-6

Hand = Literal["right", "left"]
Offsets = tuple[tuple[int, int], ...]


@dataclass(frozen=True)
class SheetLattice:
    """A sheet of ``rows`` x ``columns`` rectangular cells.

    A row runs along x. The next row lies in the direction of y, or of -y for a left-handed sheet. Nodes have half of
    the pitch: each cell has a node at its centre, its corners and the middles of its edges. Node (2 i + 1, 2 j + 1) is
    the centre of cell (i, j).
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
    def node_lines(self) -> tuple[tuple[int, ...], tuple[int, ...]]:
        """Positions of the rows and of the columns of nodes, in node distances."""
        a, b = self.node_shape
        return tuple(range(a)), tuple(range(b))

    @property
    def step(self) -> tuple[float, float]:
        """Node distance along y (across the rows; negative for a left hand) and along x [m]."""
        return (self.pitch[0] if self.hand == "right" else -self.pitch[0]) / 2, self.pitch[1] / 2

    @cached_property
    def index(self) -> IntArray:
        """Row and column of each cell, shape (rows * columns, 2), row by row."""
        return np.stack(np.divmod(np.arange(self.rows * self.columns), self.columns), axis=1)

    def counter_clockwise(self, offsets: Offsets) -> Offsets:
        """Return the offsets in counter-clockwise order on the surface; the first offset stays the first.

        The given offsets must be counter-clockwise for a right-handed sheet.
        """
        return offsets if self.hand == "right" else (offsets[0], *offsets[:0:-1])

    def at_cells(self, nodes: Array, offsets: Offsets) -> Array:
        """Return the node values at given positions of each cell.

        Parameters
        ----------
        nodes : array, shape (a, b, ...)
            Values at the nodes; (a, b) is ``node_shape``.
        offsets : tuple of (row, column)
            Positions relative to the centre of a cell, in half pitches.

        Returns
        -------
        array, shape (cells, offsets, ...)
        """
        i, j = (2 * self.index + 1).T
        return np.stack([nodes[i + a, j + b] for a, b in offsets], axis=1)


CENTRE = ((0, 0),)  # Format: offset in half pitches
# Format: offsets in half pitches. Counter-clockwise, seen from outside, for a right-handed sheet: x runs along the row,
# z points out of the robot.
CORNERS = ((-1, -1), (-1, 1), (1, 1), (1, -1))
EDGES = ((0, 1), (1, 0), (0, -1), (-1, 0))  # Format: offsets of the middles of the sides, as of the corners


# [m] Hexagonal boards of the TUM skin: length of their sides, and the gap that gives their pitch of 27.75 mm. Contract:
# the documented default of the plan.
SIDE = 0.0163
GAP = 0.02775 - float(np.sqrt(3)) * SIDE


@dataclass(frozen=True)
class HexLattice:
    """Regular hexagons with sides of length ``side`` and a ``gap`` between facing sides; rows run along x.

    A cell has axial coordinates (q, r). One step in q goes along x, one step in r goes 60 degrees from x. Boards that
    are trimmed at their sides are closer together than their outlines. Then the gap is negative. Without a stated gap
    boards touch; those with the side of TUM are trimmed as there.
    """

    side: float  # [m]
    gap: float | None = None  # [m]

    def __post_init__(self):
        if self.side <= 0 or self.pitch <= 0:
            raise InvalidPlan(
                f"hexagons with sides of {self.side * 1e3:g} mm and gaps of {self.spacing * 1e3:g} mm have no area or "
                "no pitch. Increase the side or the gap"
            )

    @property
    def spacing(self) -> float:
        """The gap, stated or not [m]."""
        usual = GAP if self.side == SIDE else 0.0
        return usual if self.gap is None else self.gap

    @property
    def pitch(self) -> float:
        """Distance between the centres of neighbours [m]."""
        return float(np.sqrt(3)) * self.side + self.spacing

    @property
    def row_step(self) -> float:
        """Distance between rows [m]."""
        return float(np.sqrt(0.75)) * self.pitch

    @property
    def area(self) -> float:
        """Area of one cell [m^2]."""
        return float(np.sqrt(6.75)) * self.side**2

    def centres(self, cells: IntArray) -> Array:
        """Return the flat centres, shape (n, 2) [m], of cells with axial coordinates of shape (n, 2)."""
        q, r = np.asarray(cells).reshape(-1, 2).T
        return np.column_stack((self.pitch * (q + r / 2), self.row_step * r))

    def linked(self, cells: IntArray) -> IntArray:
        """Return the rows (k, 2) of the cells (n, 2) that are neighbours in the lattice, each pair once."""
        number = {cell: i for i, cell in enumerate(map(tuple, cells.tolist()))}
        pairs = [(i, number.get((q + a, r + b), -1)) for (q, r), i in number.items() for a, b in PORTS[:3]]
        return np.array([pair for pair in pairs if pair[1] >= 0], np.int64).reshape(-1, 2)

    def cell_at(self, point: Array) -> tuple[int, int]:
        """Return the axial coordinates of the cell whose centre is nearest to a flat point (2,) [m]."""
        r = point[1] / self.row_step
        q = point[0] / self.pitch - r / 2
        near = np.floor((q, r)).astype(int) + [(0, 0), (1, 0), (0, 1), (1, 1)]
        nearest = near[np.argmin(((self.centres(near) - point) ** 2).sum(axis=1))]
        return int(nearest[0]), int(nearest[1])

    @property
    def corners(self) -> Array:
        """Corners of a cell relative to its centre, counter-clockwise from 30 degrees below x, shape (6, 2) [m]."""
        angles = np.deg2rad(60 * np.arange(6) - 30)
        return self.side * np.column_stack((np.cos(angles), np.sin(angles)))


# Format: axial step to the cell beyond side k of a hexagon. Side k is between the corners k and k + 1.
PORTS = ((1, 0), (0, 1), (-1, 1), (-1, 0), (0, -1), (1, -1))
