"""Folds of a placed sheet: cells that are turned over, and cells that are in one place."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from ...common.arrays import Array, BoolArray, IntArray, cross
from ...common.errors import InvalidPlan, millimetres
from ...common.warnings import Place, point_of
from ...geometry.surface.bspline import BSplineSurface
from ..lattice import CENTRE, CORNERS, SheetLattice

# Distance of two nodes on the flat sheet up to which their cells are adjacent, in half pitches. Derived: the width of a
# cell.
ADJACENT_NODES = 2.0


def turned_over(layer: BSplineSurface, lattice: SheetLattice, uv: Array) -> BoolArray:
    r"""Return which cells have a half that is turned over, shape (cells,).

    The diagonal of a cell divides it into two triangles. Each must have the orientation of the flat sheet: in the
    parameters of the surface, for all four quarters of the cell, and in space, about the outward normal n at the centre
    of the cell.

    .. math::
        \sigma \det(a, b) > 0 \quad \text{in } (u, v), \qquad \sigma \, (A \times B) \cdot n > 0 \quad [m^2]

    with the sides a, b of a triangle in the parameters, its sides A, B in space, and the sign of the flat triangle.
    """
    wrong = turned_meshes(lattice, uv)
    cells = (wrong[::2, ::2] | wrong[1::2, ::2] | wrong[::2, 1::2] | wrong[1::2, 1::2]).ravel()
    r = layer.derivatives(uv.reshape(-1, 2))
    points, normals = (part.reshape(*lattice.node_shape, 3) for part in (r[0, 0], cross(r[1, 0], r[0, 1])))
    corners = lattice.at_cells(points, lattice.counter_clockwise(CORNERS))
    up = lattice.at_cells(normals, CENTRE)[:, 0]
    for k in range(4):
        first, second = corners[:, (k + 1) % 4] - corners[:, k], corners[:, (k + 2) % 4] - corners[:, k]
        cells |= (cross(first, second) * up).sum(axis=1) <= 0
    return cells


def turned_meshes(lattice: SheetLattice, uv: Array) -> BoolArray:
    """Return which quadrangles (a - 1, b - 1) of nodes have a half that is turned over in the parameters."""
    hand = np.sign(lattice.step[0])
    along, across = np.diff(uv, axis=1), np.diff(uv, axis=0)
    a, b = len(across), along.shape[1]
    # Both triangles of both diagonals: the sides that meet at each of the four corners.
    pairs = [(along[i : i + a], across[:, j : j + b]) for i in (0, 1) for j in (0, 1)]
    wrong: BoolArray = np.logical_or.reduce([hand * _determinant(*sides) <= 0 for sides in pairs])
    return wrong


def _determinant(a: Array, b: Array) -> Array:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


@dataclass(frozen=True, eq=False)
class Meetings:
    """Nodes of a sheet that are within another part of the same sheet; row i of every array is the same meeting.

    Positions are rows and columns of the grid of nodes: in half pitches from the corner of the sheet.
    """

    node: Array  # (k, 2) position of the node
    other: Array  # (k, 2) position of the point of the other part at the same parameters
    turns: IntArray  # (k,) turns around the link from the node to the other part


def meetings(sheet_uv: Array, layer: BSplineSurface, inside: BoolArray, turns: Sequence[int]) -> Meetings:
    """Find the nodes of a sheet that are within another part of it."""
    a, b, _ = sheet_uv.shape
    quarter = np.repeat(np.repeat(inside, 2, axis=0), 2, axis=1)
    i, j = np.nonzero(quarter)
    is_node = np.zeros((a, b), bool)
    for di, dj in ((0, 0), (0, 1), (1, 0), (1, 1)):
        is_node[i + di, j + dj] = True
    nodes = np.argwhere(is_node)
    r = layer.derivatives(sheet_uv[is_node])
    scale = np.sqrt([(r[1, 0] ** 2).sum(axis=1).mean(), (r[0, 1] ** 2).sum(axis=1).mean()])  # [m] per parameter
    points = sheet_uv * scale
    start, row, column = points[i, j], points[i + 1, j], points[i, j + 1]
    far = points[i + 1, j + 1]
    middle = (start + row + column + far) / 4
    radius = max(float(np.linalg.norm(corner - middle, axis=1).max()) for corner in (start, row, column, far))
    tree = cKDTree(middle)
    found = []
    for turn in turns:
        at = points[is_node] + (0.0, turn * scale[1])
        pairs = tree.sparse_distance_matrix(cKDTree(at), radius, output_type="coo_matrix")
        q, n = pairs.row, pairs.col
        position = np.column_stack((i[q], j[q])).astype(float)
        # Two triangles per quarter: at its first corner, and at the opposite one.
        for corner, sides, sign in ((start, (row, column), 1.0), (far, (column, row), -1.0)):
            first, second, arm = sides[0][q] - corner[q], sides[1][q] - corner[q], at[n] - corner[q]
            area = _determinant(first, second)
            area = np.where(area == 0, np.inf, area)
            s, t = _determinant(arm, second) / area, _determinant(first, arm) / area
            place = position + (0.0 if sign > 0 else 1.0) + sign * np.column_stack((s, t))
            apart = np.abs(place - nodes[n]).max(axis=1) > ADJACENT_NODES
            hit = (s >= 0) & (t >= 0) & (s + t <= 1) & (apart | (turn != 0))
            found.append((nodes[n[hit]].astype(float), place[hit], np.full(np.count_nonzero(hit), turn)))
    return Meetings(*(np.concatenate(parts) for parts in zip(*found)))


def check_folds(layer: BSplineSurface, lattice: SheetLattice, uv: Array, inside: BoolArray) -> None:
    """Check that no cell of a sheet is turned over, and that no two of its cells are in one place."""
    which = np.flatnonzero(turned_over(layer, lattice, uv) & inside)
    if len(which):
        row, column = lattice.index[which[0]].tolist()
        place = layer.points(uv[2 * row + 1, 2 * column + 1][None])[0]
        raise InvalidPlan(
            f"cell ({row}, {column}) at {millimetres(place)} is turned over, the first of {len(which)}: the sheet "
            "folds there. Move the sheet, rotate its direction, or fit a smoother surface",
            row=row,
            column=column,
            count=len(which),
            place=Place(point_of(place)),
        )
    found = meetings(uv, layer, inside.reshape(lattice.rows, lattice.columns), (0,))
    if len(found.node):
        last = (lattice.rows - 1, lattice.columns - 1)
        both = np.column_stack([np.minimum(part // 2, last) for part in (found.node, found.other)]).astype(np.int64)
        k = int(np.lexsort(both.T[::-1])[0])
        cell, other = tuple(both[k, :2].tolist()), tuple(both[k, 2:].tolist())
        place = layer.points(uv[tuple(found.node[k].astype(int))][None])[0]
        raise InvalidPlan(
            f"cells {cell} and {other} are both at {millimetres(place)}: the sheet overlaps itself there. Move the "
            "sheet, rotate its direction, or use fewer cells",
            row=cell[0],
            column=cell[1],
            place=Place(point_of(place)),
        )
