"""The input of the peers: a regular grid of points on the mesh, from our own sampler, the fastest available.

The sampler, ``cast_rays``, is not public.
"""

from dataclasses import dataclass

import numpy as np
from links import Array, Fan, Link

from skin_calib_addon.geometry import Planes
from skin_calib_addon.geometry.sampling.samples import cast_rays

MASK = (160, 720)  # rows and rays of the map of holes


@dataclass(frozen=True, eq=False)
class Samples:
    """Points of a mesh at every pair of ``s`` and ``t``; on a closed link the last ray is one step before the first."""

    fan: Fan
    s: Array  # (k,) in [0, 1]
    t: Array  # (l,) [rad] in [0, turn]
    radii: Array  # (k, l) [m]; holes are bridged along their rows

    @property
    def points(self) -> Array:
        """Return the points, shape (k, l, 3) [mm]: the tolerances of peers suit numbers near one."""
        return 1e3 * self.fan.points(self.s, self.t, self.radii)


def take(link: Link, fan: Fan, rows: int, columns: int) -> Samples:
    """Return samples at even steps."""
    s, t = np.linspace(0, 1, rows), np.linspace(0, fan.turn, columns, endpoint=not fan.closed)
    return Samples(fan, s, t, bridged(cast(link, fan, s, t), t, fan))


def cast(link: Link, fan: Fan, s: Array, t: Array) -> Array:
    """Return the distance of the mesh from the axis, shape (len(s), len(t)) [m]; NaN in holes."""
    origins, directions = fan.origins(s), fan.directions(s, t)
    starts = np.broadcast_to(origins[:, None], directions.shape)
    return cast_rays(link.mesh, Planes(origins, fan.normals(s)), starts, directions)


def bridged(radii: Array, t: Array, fan: Fan) -> Array:
    """Fill holes in radii linearly along their row: peers do not accept holes."""
    for i in np.flatnonzero(np.isnan(radii).any(axis=1)):
        row = radii[i]
        known = ~np.isnan(row)
        if not known.any():
            raise ValueError("a section does not intersect the mesh")
        row[~known] = np.interp(t[~known], t[known], row[known], period=fan.turn if fan.closed else None)
    return radii


def holes(link: Link, fan: Fan) -> Array:
    """Return where rays from the axis do not intersect the mesh, shape ``MASK``."""
    s, t = np.linspace(0, 1, MASK[0]), np.linspace(0, fan.turn, MASK[1], endpoint=not fan.closed)
    return np.isnan(cast(link, fan, s, t))
