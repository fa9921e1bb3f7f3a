"""What the author must look at: how a sheet is stretched, and how it closes round the link."""

from dataclasses import dataclass

import numpy as np

from ...common.arrays import Array, cross, unit
from ...geometry.surface.bspline import BSplineSurface
from .relax import pair_lengths
from .wrap import WrappedSheet

# Share of a turn from which on a sheet goes round the link.
MIN_TURN = 0.5


def cell_strain(sheet: WrappedSheet) -> Array:
    """Strain of each cell along its row, across the rows, and in shear [rad], shape (cells, 3)."""
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
    """How a sheet that goes round the link meets its own beginning."""

    of: str  # what goes round: "rows" or "columns"
    gaps: Array  # (k,) of each: what is missing between its end and its beginning; negative where they overlap [m]
    steps: Array  # (k,) by how much the beginning lies aside of the end, towards the next one [m]


def closure(sheet: WrappedSheet) -> Closure | None:
    """How a sheet closes; None where it does not go round, or less than half.

    Measured along the middle of each row, or column, from its last side to where its first side comes round again.
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
    """Gap and step where the beginning of a line of nodes (k, 2) comes round again."""
    again = line[0] + turn
    r = layer.derivatives(np.concatenate((line, again[None])))
    points, normals = r[0, 0], unit(cross(r[1, 0], r[0, 1]))
    segments = pair_lengths(points, normals, np.column_stack((np.arange(len(line) - 1), np.arange(1, len(line)))))[0]
    travelled = np.append(0.0, np.cumsum(segments))
    # The node next to where it comes round, and the way from there.
    lengths = np.linalg.norm(r[(1, 0), (0, 1), -1], axis=1)
    nearest = int(np.argmin(np.linalg.norm((line - again) * lengths, axis=1)))
    adjacent = nearest + (1 if nearest == 0 else -1)
    up = normals[nearest]
    ahead = (points[nearest] - points[adjacent]) * (1 if adjacent < nearest else -1)
    ahead, rest = (unit(arm - (arm @ up) * up) for arm in (ahead, points[-1] - points[nearest]))
    if rest.any():
        rest = rest * pair_lengths(points, normals, np.array([[nearest, len(line)]]))[0][0]
    return float(travelled[nearest] + rest @ ahead - travelled[-1]), float(rest @ cross(up, ahead))
