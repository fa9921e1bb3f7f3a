"""Geodesics on a surface: the straight lines of a sheet that bends and does not stretch."""

import numpy as np

from ..arrays import Array, unit
from ..geometry.bspline import BSplineSurface
from ..geometry.distance import footpoints

# Parts into which a step along a geodesic is divided until its speed keeps within this of one.
PARTS, UNIT_SPEED = (1, 4, 16), 0.03


def trace_both(
    surface: BSplineSurface, uv: Array, tangents: Array, step: float, before: int, count: int
) -> tuple[Array, Array]:
    """Geodesics through each ``uv``, with ``before`` of their ``count`` points on the side it comes from.

    Returns
    -------
    path : array, shape (count, k, 2)
    tangents : array, shape (count, k, 3)
        Unit, in the direction of growing index.
    """
    k = len(uv)
    reach = max(before, count - 1 - before)
    path, heading = trace(surface, np.concatenate((uv, uv)), np.concatenate((tangents, -tangents)), step, reach)
    back, forth = slice(before, 0, -1), slice(0, count - before)
    return (
        np.concatenate((path[back, k:], path[forth, :k])),
        np.concatenate((-heading[back, k:], heading[forth, :k])),
    )


def trace(surface: BSplineSurface, uv: Array, tangents: Array, step: float, count: int) -> tuple[Array, Array]:
    """Follow geodesics: ``count`` steps of ``step`` metres from each ``uv`` along its unit tangent.

    Returns
    -------
    path : array, shape (count + 1, k, 2)
    tangents : array, shape (count + 1, k, 3)
        Unit.
    """
    path, headings = [uv], [tangents]
    for _ in range(count):
        uv, tangents = _advance(surface, uv, tangents, step)
        path.append(uv)
        headings.append(tangents)
    return np.stack(path), np.stack(headings)


def _advance(surface: BSplineSurface, uv: Array, tangents: Array, step: float) -> tuple[Array, Array]:
    """One step along geodesics (Runge-Kutta 4), in more parts where the surface bends sharply.

    A geodesic keeps its unit speed: where the speed has changed, the step was too long for the bend. What no number of
    parts brings over a bend goes on straight and comes down on the nearest point of the surface.
    """
    r = surface.derivatives(uv)
    start = np.stack((uv, in_basis(r[1, 0], r[0, 1], tangents)), axis=1)
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        for parts in PARTS:
            state, h = start, step / parts
            for _ in range(parts):
                k1 = _geodesic_slope(surface, state)
                k2 = _geodesic_slope(surface, state + h / 2 * k1)
                k3 = _geodesic_slope(surface, state + h / 2 * k2)
                k4 = _geodesic_slope(surface, state + h * k3)
                state = state + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
            r = surface.derivatives(state[:, 0])
            velocity = r[1, 0] * state[:, 1, :1] + r[0, 1] * state[:, 1, 1:]
            kept = np.abs(np.linalg.norm(velocity, axis=1) - 1) < UNIT_SPEED
            if kept.all():
                return state[:, 0], unit(velocity)
        new_uv, new_tangents = state[:, 0], unit(velocity)
    lost = ~kept
    straight = surface.points(uv[lost]) + step * tangents[lost]
    new_uv[lost] = footpoints(surface, straight)[0]
    normals = surface.normals(new_uv[lost])
    new_tangents[lost] = unit(tangents[lost] - (tangents[lost] * normals).sum(axis=1, keepdims=True) * normals)
    # Footpoints lie in [0, 1]; paths go on over a seam.
    turns = np.rint(uv[lost] - new_uv[lost])
    new_uv[lost] += np.where(surface.closed, turns, 0.0)
    return new_uv, new_tangents


def _geodesic_slope(surface: BSplineSurface, state: Array) -> Array:
    """Rate of parameters and of their speed on a geodesic: its acceleration has no part in the surface."""
    r = surface.derivatives(state[:, 0], order=2)
    du, dv = state[:, 1, :1], state[:, 1, 1:]
    bend = r[2, 0] * du**2 + 2 * r[1, 1] * du * dv + r[0, 2] * dv**2
    return np.stack((state[:, 1], -in_basis(r[1, 0], r[0, 1], bend)), axis=1)


def in_basis(a: Array, b: Array, vectors: Array) -> Array:
    """Components of the tangential part of vectors in the basis (a, b), shape (k, 2)."""
    aa, ab, bb = (a * a).sum(1), (a * b).sum(1), (b * b).sum(1)
    va, vb = (vectors * a).sum(1), (vectors * b).sum(1)
    return np.column_stack((bb * va - ab * vb, aa * vb - ab * va)) / (aa * bb - ab * ab)[:, None]
