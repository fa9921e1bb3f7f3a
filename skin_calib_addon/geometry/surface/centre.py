"""The centre of a surface: it depends on the shape only, and not on the parametrization."""

from functools import lru_cache

import numpy as np

from ...common.arrays import Array
from .bspline import BSplineSurface
from .distance import sample_lines

# [1] chords that measure a coordinate line on each side of a point. Larger: more accurate lengths, more time.
CHORDS_PER_SIDE = 64
# [1] Newton iterations to half of the length, in each direction. Larger: no visible effect, more time.
CENTRE_ITERATIONS = 3
# [1] points in each span, per direction, from which the search for the middle starts. Larger: safer start, more time.
STARTS_PER_SPAN = 3
MAX_RAY_ITERATIONS = 16  # [1] most Newton iterations for the intersection of the middle ray with the surface
# [1] step of the parameters below which these iterations have converged. Larger: a less accurate centre.
RAY_TOLERANCE = 1e-10


@lru_cache(maxsize=8)
def surface_centre(surface: BSplineSurface) -> tuple[float, float]:
    """Return the parameters of the centre: where the middle ray of the region meets the surface.

    The region of the mesh defines this ray, so the centre does not depend on the planes and lines of the surface. A
    surface along planes of the author has no middle ray. Its centre is at half of the length of its coordinate lines,
    from v = 0 on where it is closed.
    """
    if surface.middle is not None:
        uv = ray_parameters(surface, *surface.middle)
    else:
        uv = np.full((1, 2), 0.5)
        for _ in range(CENTRE_ITERATIONS):
            for axis in (1, 0):
                fraction, slope = length_fractions(surface, uv, axis, CHORDS_PER_SIDE)
                uv[:, axis] += (0.5 - fraction) / slope
    u, v = surface.wrap(uv)[0].tolist()
    return u, v


def ray_parameters(surface: BSplineSurface, origin: Array, ray: Array) -> Array:
    """Return the parameters where a ray meets a surface, or where the surface is nearest to it, shape (1, 2).

    Parameters
    ----------
    surface : BSplineSurface
        The surface, [m] in the link frame.
    origin : array, shape (3,)
        [m]
    ray : array, shape (3,)
        Unit direction.
    """
    u, v = sample_lines(surface, STARTS_PER_SPAN)
    points = surface.grid_points(u, v) - origin
    depth = points @ ray
    distance = np.where(depth > 0, np.linalg.norm(points - depth[..., None] * ray, axis=2), np.inf)
    i, j = np.unravel_index(np.argmin(distance), distance.shape)
    uv = np.array([[u[i], v[j]]])
    for _ in range(MAX_RAY_ITERATIONS):
        r = surface.derivatives(uv)[:, :, 0]
        gap, along, across = (vector - (vector @ ray) * ray for vector in (r[0, 0] - origin, r[1, 0], r[0, 1]))
        step = np.linalg.lstsq(np.column_stack((along, across)), gap, rcond=None)[0]
        after = uv - step
        after = np.where(surface.closed, after, np.clip(after, 0, 1))
        if np.abs(after - uv).max() < RAY_TOLERANCE:
            break
        uv = after
    return uv


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
