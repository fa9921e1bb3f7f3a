"""The centre of a surface: it depends on the shape only."""

from functools import lru_cache

import numpy as np

from ...common.arrays import Array
from .bspline import BSplineSurface
from .footpoints import footpoints

# [1] chords that measure a coordinate line on each side of a point. Larger: more accurate lengths, more time.
CHORDS_PER_SIDE = 64
# [1] Newton iterations to half of the length, in each direction. Larger: no visible effect, more time.
CENTRE_ITERATIONS = 3


@lru_cache(maxsize=8)
def surface_centre(surface: BSplineSurface) -> tuple[float, float]:
    """Return the parameters of the centre: the point nearest to the middle of the region of the mesh.

    The mesh defines this point, so the centre does not depend on the planes and lines of the surface. A surface along
    planes of the author has no region. Its centre is at half of the length of its coordinate lines, from v = 0 on where
    it is closed.
    """
    if surface.centre is not None:
        uv = footpoints(surface, surface.centre[None])[0]
    else:
        uv = np.full((1, 2), 0.5)
        for _ in range(CENTRE_ITERATIONS):
            for axis in (1, 0):
                fraction, slope = length_fractions(surface, uv, axis)
                uv[:, axis] += (0.5 - fraction) / slope
    u, v = surface.wrap(uv)[0].tolist()
    return u, v


def length_fractions(surface: BSplineSurface, uv: Array, axis: int) -> tuple[Array, Array]:
    r"""Return the fraction of the length of its coordinate line that is before each point, and its derivative.

    .. math::

        f(x) = \frac{\ell(0, x)}{\ell(0, 1)}, \qquad
        f'(x) = \frac{\lVert \partial \mathbf{S} / \partial x \rVert}{\ell(0, 1)}

    Here :math:`\ell` [m] is the length of a coordinate line, measured with chords.
    """
    parts = CHORDS_PER_SIDE
    x, part = uv[:, axis, None], np.linspace(0, 1, parts + 1)
    lines = np.repeat(uv[:, None], 2 * parts + 1, axis=1)
    lines[..., axis] = np.concatenate((x * part, x + (1 - x) * part[1:]), axis=1)
    r = surface.derivatives(lines.reshape(-1, 2))
    points, slopes = (d.reshape(*lines.shape[:2], 3) for d in (r[0, 0], r[0, 1] if axis else r[1, 0]))
    chords = np.linalg.norm(np.diff(points, axis=1), axis=2)
    before, after = (
        chords[:, :parts].sum(axis=1) * np.sign(x[:, 0]),
        chords[:, parts:].sum(axis=1) * np.sign(1 - x[:, 0]),
    )
    return before / (before + after), np.linalg.norm(slopes[:, parts], axis=1) / (before + after)
