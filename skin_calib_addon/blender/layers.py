# SPDX-License-Identifier: GPL-3.0-or-later
"""What is drawn of a fitted link, as arrays prepared once for each result."""

from dataclasses import dataclass
from typing import Any

import numpy as np

CURVE_POINTS = 96
NORMAL_LENGTH = 0.006  # [m]
# From no distance between surface and mesh to the largest one; grey where rays met no mesh.
SCALE = np.array(((0.27, 0.0, 0.33), (0.23, 0.32, 0.55), (0.13, 0.57, 0.55), (0.37, 0.79, 0.38), (0.99, 0.91, 0.15)))
UNKNOWN = (0.5, 0.5, 0.5)


@dataclass(eq=False)
class Layer:
    """Segments of one colour, or triangles with a colour at each corner; the batch is made in the first draw call."""

    what: str
    points: np.ndarray  # (2 k, 3) or (3 k, 3) float32, in the link frame [m]
    colours: np.ndarray | None = None  # (3 k, 4) float32
    batch: Any = None


def layers_of(result: Any) -> tuple[Layer, ...]:
    """Everything that can be drawn of a result, or of what has a ``fit`` and a ``calibration`` with patches."""
    return (_error(result), _surface_lines(result), *_taxel_lines(result))


def _error(result: Any) -> Layer:
    """The surface, coloured by how far the mesh is from it along the rays of the fit."""
    fit, closed = result.fit, result.fit.lines.closed
    off = np.abs(fit.residuals)
    if closed:
        off = np.hstack((off, off[:, :1]))
    known, most = np.isfinite(off), np.nanmax(off, initial=0.0) or 1.0
    place = np.where(known, off, 0.0) / most * (len(SCALE) - 1)
    colour = np.stack([np.interp(place, np.arange(len(SCALE)), channel) for channel in SCALE.T], axis=2)
    colour = np.dstack((np.where(known[..., None], colour, UNKNOWN), np.ones_like(off)))
    grid = fit.surface.grid_points(np.linspace(0, 1, off.shape[0]), np.linspace(0, 1, off.shape[1]))
    return Layer("ERROR", _triangles(grid), _triangles(colour))


def _triangles(grid: np.ndarray) -> np.ndarray:
    """Corners of two triangles for each cell of a lattice (n, m, c), shape (6 (n - 1) (m - 1), c)."""
    a, b, c, d = grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]
    return np.ascontiguousarray(np.stack((a, b, c, a, c, d), axis=2).reshape(-1, grid.shape[2]), np.float32)


def _segments(polylines: np.ndarray) -> np.ndarray:
    """Ends of the segments of polylines (k, p, 3), shape (2 k (p - 1), 3), in the order in which the GPU reads them."""
    ends = np.stack((polylines[:, :-1], polylines[:, 1:]), axis=2).reshape(-1, 3)
    return np.ascontiguousarray(ends, np.float32)


def _surface_lines(result: Any) -> Layer:
    """Curves of constant u and v."""
    surface = result.fit.surface
    fine = np.linspace(0, 1, CURVE_POINTS + 1)
    n, m = result.fit.lines.origins.shape[:2]
    around = surface.grid_points(np.linspace(0, 1, n), fine)
    along = surface.grid_points(fine, np.linspace(0, 1, m + 1)).transpose(1, 0, 2)
    return Layer("SURFACE", np.concatenate((_segments(around), _segments(along))))


def _taxel_lines(result: Any) -> tuple[Layer, ...]:
    """Outlines of the cells, and their normals."""
    layers = []
    for patch in result.calibration.patches:
        t = patch.taxels
        outline = np.concatenate((t.corners_link, t.corners_link[:, :1]), axis=1)
        sticks = np.stack((t.positions_link, t.positions_link + NORMAL_LENGTH * t.normals_link), axis=1)
        layers.append(Layer("CELLS", _segments(outline)))
        layers.append(Layer("NORMALS", _segments(sticks)))
    return tuple(layers)
