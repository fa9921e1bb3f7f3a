"""The middle of a surface: where its shape has it, however its parameters run."""

from functools import lru_cache

import numpy as np

from ...common.arrays import Array, unit
from .bspline import BSplineSurface

CHORDS_PER_SIDE = 64  # of a coordinate line on either side of a place when its length is measured
CENTRE_ITERATIONS = 3  # Newton steps to half of a length, in each direction
MAX_SEAM_ITERATIONS = 8  # Newton steps to where a ray meets a surface
SEAM_TOLERANCE = 1e-9  # step of the parameters that is none


@lru_cache(maxsize=8)
def surface_centre(surface: BSplineSurface) -> tuple[float, float]:
    """Parameters half way along a surface, and half way across it or round it: half of the lengths of its lines.

    Round it, the way begins at its seam, the side of angle zero: where the vertex of the mesh is that is furthest from
    the axis.
    """
    start = seam_of(surface)
    uv = np.where(surface.closed, start + 0.5, 0.5)[None]
    for _ in range(CENTRE_ITERATIONS):
        for axis in (1, 0):
            fraction, slope = length_fractions(
                surface, uv, axis, CHORDS_PER_SIDE, start[axis] if surface.closed[axis] else 0.0
            )
            uv[:, axis] += (0.5 - fraction) / slope
    u, v = surface.wrap(uv)[0].tolist()
    return u, v


def length_fractions(
    surface: BSplineSurface, uv: Array, axis: int, parts: int, start: float = 0.0
) -> tuple[Array, Array]:
    """How much of the length of its coordinate line along ``axis`` lies before each point, and how that grows.

    Parameters
    ----------
    uv : array, shape (k, 2)
    parts : int
        Into which the line is divided on either side of the point, to measure chords.
    start : float
        Where the lines begin; they end at one more.

    Returns
    -------
    shares : array, shape (k,)
        0 to 1; outside of that beyond the ends.
    growth : array, shape (k,)
        To the parameter.
    """
    x, part = uv[:, axis, None] - start, np.linspace(0, 1, parts + 1)
    lines = np.repeat(uv[:, None], 2 * parts + 1, axis=1)
    lines[..., axis] = start + np.concatenate((x * part, x + (1 - x) * part[1:]), axis=1)
    r = surface.derivatives(lines.reshape(-1, 2))
    points, slopes = (d.reshape(*lines.shape[:2], 3) for d in (r[0, 0], r[0, 1] if axis else r[1, 0]))
    chords = np.linalg.norm(np.diff(points, axis=1), axis=2)
    before, after = (
        chords[:, :parts].sum(axis=1) * np.sign(x[:, 0]),
        chords[:, parts:].sum(axis=1) * np.sign(1 - x[:, 0]),
    )
    return before / (before + after), np.linalg.norm(slopes[:, parts], axis=1) / (before + after)


def seam_of(surface: BSplineSurface) -> Array:
    """Parameters of the place where the ray of its seam meets a surface, shape (2,); v = 0 where it has none."""
    start = np.array((0.5, 0.0))
    if surface.seam is None:
        return start
    point, ray = surface.seam
    around = np.column_stack(
        (np.full(2 * CHORDS_PER_SIDE, 0.5), np.arange(2 * CHORDS_PER_SIDE) / (2 * CHORDS_PER_SIDE))
    )
    uv = around[np.argmax((unit(surface.points(around) - point) * ray).sum(axis=1))]
    for _ in range(MAX_SEAM_ITERATIONS):
        r = surface.derivatives(uv[None])[:, :, 0]
        gap, along, across = (vector - (vector @ ray) * ray for vector in (r[0, 0] - point, r[1, 0], r[0, 1]))
        step = np.linalg.lstsq(np.column_stack((along, across)), gap, rcond=None)[0]
        uv = uv - step
        if np.abs(step).max() < SEAM_TOLERANCE:
            break
    return uv
