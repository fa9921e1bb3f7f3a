"""The centre of a surface: it depends on the shape only, and not on the parametrization."""

from functools import lru_cache

import numpy as np

from ...common.arrays import Array, unit
from .bspline import BSplineSurface

# [1] chords that measure a coordinate line on each side of a point. Larger: more accurate lengths, more time.
CHORDS_PER_SIDE = 64
# [1] Newton iterations to half of the length, in each direction. Larger: no visible effect, more time.
CENTRE_ITERATIONS = 3
# [1] most Newton iterations for the intersection of the seam's ray with the surface.
MAX_SEAM_ITERATIONS = 8
# [1] step of the parameters below which these iterations have converged. Larger: a less accurate seam.
SEAM_TOLERANCE = 1e-9


@lru_cache(maxsize=8)
def surface_centre(surface: BSplineSurface) -> tuple[float, float]:
    """Return the parameters of the point at half of the length of its two coordinate lines.

    A closed line starts at the seam, which is at angle zero: the side of the mesh vertex with the largest distance from
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
    r"""Return the fraction of the length of its coordinate line that is before each point, and its derivative.

    .. math::

        f(x) = \frac{\ell(x_0, x)}{\ell(x_0, x_0 + 1)}, \qquad
        f'(x) = \frac{\lVert \partial \mathbf{S} / \partial x \rVert}{\ell(x_0, x_0 + 1)}

    Here :math:`\ell` [m] is the length of a coordinate line, measured with chords.

    Parameters
    ----------
    surface : BSplineSurface
        The surface, [m] in the link frame.
    uv : array, shape (k, 2)
        Parameters.
    axis : int
        Direction of the lines: 0 for u, 1 for v.
    parts : int
        Number of chords on each side of the point.
    start : float
        Parameter :math:`x_0` where the lines start; they end at ``start + 1``.

    Returns
    -------
    fractions : array, shape (k,)
        From 0 to 1; outside of this range beyond the ends.
    slope : array, shape (k,)
        Derivatives of the fractions by the parameter.
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
    """Return the parameters where the ray of the seam intersects a surface, shape (2,); v = 0 without a seam."""
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
