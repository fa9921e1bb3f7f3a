"""Quality of a placed sheet: its strain, and the gaps where it closes around the link."""

from dataclasses import dataclass

import numpy as np

from ...common.arrays import Array, cross, unit
from ...geometry.surface.bspline import BSplineSurface
from .relax import pair_lengths
from .wrap import WrappedSheet

# Smallest part of a full turn that a sheet covers if it closes around the link. Larger: no gaps for shorter sheets.
MIN_TURN = 0.5


def cell_strain(sheet: WrappedSheet) -> Array:
    r"""Return the strain of each cell along its row, across the rows, and in shear [rad], shape (cells, 3).

    With the length a along the row, b across it, and the diagonals d on the surface, and the pitches p [m]:

    .. math::
        \varepsilon_u = a / p_u - 1, \quad \varepsilon_v = b / p_v - 1, \quad
        \gamma = \arcsin\frac{d_1^2 - d_2^2}{4\,a\,b}

    """
    lattice = sheet.lattice
    r = sheet.layer.derivatives(sheet.uv.reshape(-1, 2))
    normals = unit(cross(r[1, 0], r[0, 1]))
    points, (_, b) = r[0, 0], lattice.node_shape
    i, j = (2 * lattice.index + 1).T
    centre = i * b + j

    def length(*offsets: int) -> Array:
        arms = [pair_lengths(points, normals, np.column_stack((centre, centre + o)))[0] for o in offsets]
        return np.sum(arms, axis=0)

    along, across = length(-1, 1), length(-b, b)
    rising, falling = length(-b - 1, b + 1), length(-b + 1, b - 1)
    shear = np.arcsin(np.clip((rising**2 - falling**2) / (4 * along * across), -1, 1))
    return np.column_stack((along / lattice.pitch[1] - 1, across / lattice.pitch[0] - 1, shear))


@dataclass(frozen=True, eq=False)
class Closure:
    """Gaps of a sheet that closes around the link."""

    of: str  # "rows" or "columns": which of them close around the link
    gaps: Array  # (k,) distance along each from its end to its beginning; negative where they overlap [m]
    steps: Array  # (k,) offset of the beginning from the end, towards the next row or column [m]


def closure(sheet: WrappedSheet) -> Closure | None:
    """Return the gaps of a sheet around the link; None if it covers less than half of a turn.

    A gap is measured along the middle line of a row (or column), from its last side to its first side one turn later.
    """
    for axis, of in ((1, "rows"), (0, "columns")):
        lines = sheet.uv[1::2] if axis else sheet.uv[:, 1::2].transpose(1, 0, 2)
        turns = lines[:, -1, 1] - lines[:, 0, 1]
        if sheet.layer.closed[1] and np.abs(turns).mean() >= MIN_TURN:
            turn = np.array((0.0, np.copysign(1.0, turns.mean())))
            found = np.array([_meeting(sheet.layer, line, turn) for line in lines])
            hand = np.sign(sheet.lattice.step[0]) * (1 if axis else -1)
            return Closure(of, found[:, 0], hand * found[:, 1])
    return None


def _meeting(layer: BSplineSurface, line: Array, turn: Array) -> tuple[float, float]:
    """Return gap and step at the position where a line of nodes (k, 2) begins again after a turn."""
    again = line[0] + turn
    r = layer.derivatives(np.concatenate((line, again[None])))
    points, normals = r[0, 0], unit(cross(r[1, 0], r[0, 1]))
    segments = pair_lengths(points, normals, np.column_stack((np.arange(len(line) - 1), np.arange(1, len(line)))))[0]
    travelled = np.append(0.0, np.cumsum(segments))
    # The node nearest to the second beginning, and the vector from there.
    lengths = np.linalg.norm(r[(1, 0), (0, 1), -1], axis=1)
    nearest = int(np.argmin(np.linalg.norm((line - again) * lengths, axis=1)))
    adjacent = nearest + (1 if nearest == 0 else -1)
    up = normals[nearest]
    ahead = (points[nearest] - points[adjacent]) * (1 if adjacent < nearest else -1)
    ahead, rest = (unit(arm - (arm @ up) * up) for arm in (ahead, points[-1] - points[nearest]))
    if rest.any():
        rest = rest * pair_lengths(points, normals, np.array([[nearest, len(line)]]))[0][0]
    return float(travelled[nearest] + rest @ ahead - travelled[-1]), float(rest @ cross(up, ahead))
