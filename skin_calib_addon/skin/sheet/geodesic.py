"""Geodesics on a surface: the straight lines of a sheet that bends and does not stretch."""

import numpy as np

from ...common.arrays import Array, BoolArray, cross, tangential, unit
from ...geometry.surface.bspline import BSplineSurface
from ...geometry.surface.footpoints import footpoints
from ..lattice import ROUNDING
from .between import interpolation

# Numbers of substeps of one step, tried in this order.
SUBSTEPS = (1, 2, 4, 16)
# Largest deviation of the speed from one that a step may leave. Larger: faster, and less exact.
SPEED_TOLERANCE = 0.03
# Largest rotation of the normal in one substep [rad]. Larger: a step may jump over a sharp edge.
MAX_SUBSTEP_TURN = 0.6


def unroll(surface: BSplineSurface, flat: Array, uv: Array, along: Array, step: float) -> Array:
    """Place flat points (n, 2) [m] along geodesics: parameters (n, 2), continuous over a seam.

    One geodesic starts at ``uv`` along the x axis. Others leave it at right angles. On a developable surface the result
    is isometric. On other surfaces it is a first guess.
    """
    (left, below), (right, above) = (
        np.maximum(np.ceil(extent / step - ROUNDING), 1).astype(int) for extent in (-flat.min(axis=0), flat.max(axis=0))
    )
    row, tangents = _trace_both(surface, uv[None], along[None], step, left, left + right + 1)
    row, tangents = row[:, 0], tangents[:, 0]
    across = cross(surface.normals(row), tangents)
    grid = _trace_both(surface, row, across, step, below, below + above + 1)[0]
    y, x = step * np.arange(-below, above + 1), step * np.arange(-left, right + 1)
    across_rows = np.tensordot(interpolation(y, flat[:, 1]), grid, axes=1)  # (points, columns, 2)
    return np.einsum("pj,pjk->pk", interpolation(x, flat[:, 0]), across_rows)


def _trace_both(
    surface: BSplineSurface, uv: Array, tangents: Array, step: float, before: int, count: int
) -> tuple[Array, Array]:
    """Trace geodesics through each ``uv`` in both directions, with ``before`` of their ``count`` points before it."""
    k = len(uv)
    extent = max(before, count - 1 - before)
    path, heading = trace(surface, np.concatenate((uv, uv)), np.concatenate((tangents, -tangents)), step, extent)
    back, forth = slice(before, 0, -1), slice(0, count - before)
    return (
        np.concatenate((path[back, k:], path[forth, :k])),
        np.concatenate((-heading[back, k:], heading[forth, :k])),
    )


def trace(surface: BSplineSurface, uv: Array, tangents: Array, step: Array | float, count: int) -> tuple[Array, Array]:
    """Trace geodesics from k starts: parameters (count + 1, k, 2), continuous over a seam, and unit tangents."""
    path, headings = [uv], [tangents]
    steps = np.broadcast_to(step, (len(uv), 1))
    r = surface.derivatives(uv, order=2)
    state = np.stack((uv, _in_basis(r[1, 0], r[0, 1], tangents)), axis=1)
    for _ in range(count):
        state, r, tangents = _advance(surface, state, r, steps)
        path.append(state[:, 0])
        headings.append(tangents)
    return np.stack(path), np.stack(headings)


def _advance(surface: BSplineSurface, start: Array, r: Array, step: Array) -> tuple[Array, Array, Array]:
    """Advance one step along geodesics (Runge-Kutta 4), with substeps where the curvature is high.

    A geodesic has unit speed. A change of the speed shows that the step is too long. If the largest number of substeps
    is not enough, the step goes straight ahead and ends at the footpoint on the surface.
    """
    first, up = r, unit(cross(r[1, 0], r[0, 1]))
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        for parts in SUBSTEPS:
            state, r, h = start, first, step[:, None] / parts
            for _ in range(parts):
                k1 = _rate(r, state)
                k2 = _rate_at(surface, state + h / 2 * k1)
                k3 = _rate_at(surface, state + h / 2 * k2)
                k4 = _rate_at(surface, state + h * k3)
                state = state + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
                r = surface.derivatives(state[:, 0], order=2)
            velocity = r[1, 0] * state[:, 1, :1] + r[0, 1] * state[:, 1, 1:]
            speed = np.sqrt((velocity**2).sum(axis=1, keepdims=True))
            turned = np.arccos(np.clip((unit(cross(r[1, 0], r[0, 1])) * up).sum(axis=1), -1, 1))
            accurate = (np.abs(speed[:, 0] - 1) < SPEED_TOLERANCE) & (turned < MAX_SUBSTEP_TURN * parts)
            if accurate.all():
                state[:, 1] /= speed
                return state, r, velocity / speed
        tangents = unit(velocity)  # arbitrary where the integration failed
    return _step_straight(surface, start, first, step, state, tangents, ~accurate)


def _step_straight(
    surface: BSplineSurface, start: Array, first: Array, step: Array, state: Array, tangents: Array, lost: BoolArray
) -> tuple[Array, Array, Array]:
    """Return the end of a step; the ``lost`` ones go straight ahead, to the footpoint."""
    uv = start[lost, 0]
    ahead = first[1, 0, lost] * start[lost, 1, :1] + first[0, 1, lost] * start[lost, 1, 1:]
    found = footpoints(surface, first[0, 0, lost] + step[lost] * ahead)[0]
    # Footpoints are in [0, 1]; paths are continuous over a seam.
    state[lost, 0] = found + np.where(surface.closed, np.rint(uv - found), 0.0)
    r = surface.derivatives(state[:, 0], order=2)
    normals = unit(cross(r[1, 0, lost], r[0, 1, lost]))
    tangents[lost] = tangential(ahead, normals)
    state[:, 1] = _in_basis(r[1, 0], r[0, 1], tangents)
    return state, r, tangents


def _rate_at(surface: BSplineSurface, state: Array) -> Array:
    return _rate(surface.derivatives(state[:, 0], order=2), state)


def _rate(r: Array, state: Array) -> Array:
    r"""Return the rates of the parameters and of their rates on a geodesic.

    The acceleration of a geodesic has no tangential part:

    .. math::
        S_u \ddot u + S_v \ddot v = -(S_{uu} \dot u^2 + 2 S_{uv} \dot u \dot v + S_{vv} \dot v^2)_{tangential}
    """
    du, dv = state[:, 1, :1], state[:, 1, 1:]
    bend = r[2, 0] * du**2 + 2 * r[1, 1] * du * dv + r[0, 2] * dv**2
    slope = np.empty_like(state)
    slope[:, 0] = state[:, 1]
    slope[:, 1] = -_in_basis(r[1, 0], r[0, 1], bend)
    return slope


def _in_basis(a: Array, b: Array, vectors: Array) -> Array:
    """Return the components of the tangential part of vectors in the basis (a, b), shape (k, 2)."""
    basis = np.empty((len(a), 3, 3))
    basis[:, 0], basis[:, 1], basis[:, 2] = a, b, vectors
    gram = np.matmul(basis[:, :2], basis.transpose(0, 2, 1))
    aa, ab, va, bb, vb = gram[:, 0, 0], gram[:, 0, 1], gram[:, 0, 2], gram[:, 1, 1], gram[:, 1, 2]
    parts = np.empty((len(a), 2))
    parts[:, 0], parts[:, 1] = bb * va - ab * vb, aa * vb - ab * va
    parts /= (aa * bb - ab * ab)[:, None]
    return parts
