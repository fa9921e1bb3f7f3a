"""Boards that are placed on a surface."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ...common.arrays import Array, BoolArray, IntArray, cross
from ...geometry.surface.bspline import BSplineSurface
from ...geometry.surface.footpoints import footpoints
from ..lattice import HexLattice
from .ground import GAP_LIMIT, MAX_GAP
from .overlap import overlapping


@dataclass(frozen=True, eq=False)
class WrappedBoards:
    """Boards placed on a surface; row i of every array is the board of ``cells[i]``."""

    surface: BSplineSurface
    offset: float  # height of the boards' middle planes above the surface [m]
    lattice: HexLattice
    cells: IntArray  # (n, 2) axial coordinates
    uv: Array  # (n, 2) parameters of the centres, continuous over a seam
    tangents: Array  # (n, 3) unit, along the rows of the lattice
    shifted: BoolArray  # (n,) which boards are shifted from their places in the lattice

    def __getitem__(self, which: BoolArray | IntArray | slice) -> "WrappedBoards":
        own = {name: getattr(self, name)[which] for name in ("cells", "uv", "tangents", "shifted")}
        return replace(self, **own)

    def joined(self, others: "WrappedBoards") -> "WrappedBoards":
        """Return these boards and others on the same surface."""
        both = [(getattr(self, name), getattr(others, name)) for name in ("cells", "uv", "tangents", "shifted")]
        cells, uv, tangents, shifted = map(np.concatenate, both)
        return replace(self, cells=cells, uv=uv, tangents=tangents, shifted=shifted)

    @cached_property
    def points(self) -> Array:
        """The points of the surface below the boards, shape (n, 3) [m]."""
        return self.surface.points(self.uv)

    @cached_property
    def normals(self) -> Array:
        """The unit normals of the boards, shape (n, 3)."""
        return self.surface.normals(self.uv)

    @property
    def positions(self) -> Array:
        """Return the middles of the boards, shape (n, 3) [m]."""
        return self.points + self.offset * self.normals

    @property
    def axes(self) -> Array:
        """Return the x and y axes (rows) of the boards, shape (n, 2, 3)."""
        return np.stack((self.tangents, cross(self.normals, self.tangents)), axis=1)

    def overlaps(self) -> tuple[IntArray, Array, Array]:
        """Return the pairs of boards that overlap (k, 2), how deep (k,) [m], and the axes between them (k, 3)."""
        return overlapping(self.positions, self.normals, self.tangents, self.lattice, abs(self.offset))

    def corners(self) -> Array:
        """Return the corners of the boards in the tangent planes at their centres, shape (n, 6, 3) [m]."""
        placed: Array = self.points[:, None] + self.lattice.corners @ self.axes
        return placed

    def gaps(self) -> Array:
        """Return the signed height of the worst corner of each board above the surface, shape (n,) [m]."""
        corners = self.corners().reshape(-1, 3)
        foot, _ = footpoints(self.surface, corners)
        heights = ((corners - self.surface.points(foot)) * self.surface.normals(foot)).sum(axis=1)
        heights = heights.reshape(-1, len(self.lattice.corners))
        worst: Array = heights[np.arange(len(heights)), np.abs(heights).argmax(axis=1)]
        return worst

    def are_near(self) -> BoolArray:
        """Return which boards need no warning because of their corners, shape (n,).

        The corners of small boards that fit are nearer to the mesh than the limit; their heights are not computed.
        """
        if MAX_GAP * self.lattice.side <= GAP_LIMIT:
            return np.ones(len(self.cells), bool)
        near: BoolArray = np.abs(self.gaps()) <= GAP_LIMIT
        return near
