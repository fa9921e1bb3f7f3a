"""Contacts of boards with the border of their region: the bounds of their movement."""

import numpy as np

from ...common.arrays import Array, unit
from .region import Region, along_edges

Contacts = tuple[Array, Array, Array]  # points, normals, gaps


def contacts(region: Region, centres: Array, corners: Array, within: float, step: float) -> Contacts:
    """Return the contacts of boards with the border of a region: where they touch, or may touch after a step.

    A corner of a board touches an edge of the region, or a side of a board touches a reflex point of the region.

    Parameters
    ----------
    region : Region
        The flat region.
    centres : array, shape (n, 2)
        Centres of the boards [m].
    corners : array, shape (6, 2)
        Corners relative to the centre [m].
    within : float
        Largest gap of a contact [m].
    step : float
        Length of a step [m].

    Returns
    -------
    points : array, shape (k, 2)
        Positions of the contacts [m].
    normals : array, shape (k, 2)
        Unit directions in which the board moves away.
    gaps : array, shape (k,)
        Distances of board and border, at most ``within``; negative where they overlap [m].
    """
    at_edges = _corner_contacts(region, centres, corners, within, step)
    at_points = _point_contacts(region.points[region.is_reflex], centres, corners, within)
    points, normals, gaps = (np.concatenate(both) for both in zip(at_edges, at_points))
    return points, normals, gaps


def _corner_contacts(region: Region, centres: Array, corners: Array, within: float, step: float) -> Contacts:
    """Return contacts of corners of boards with edges of a region; a board is on the side of its centre."""
    board, edge = np.nonzero(region.distances(centres) <= np.linalg.norm(corners[0]) + within)
    edges, outline = region.edges[edge], centres[board, None] + corners
    along = unit(edges[:, 1] - edges[:, 0])
    inward: Array = np.where(along_edges(centres[board], edges)[2] < 0, -1.0, 1.0)[:, None]
    apart, fraction, height = along_edges(outline, edges[:, None])
    # Beyond a reflex end the line of an edge is no bound. Beyond a convex end it is one, up to the length of a step.
    margin = np.where(region.is_reflex[region.ends[edge]], 0.0, step)
    length = np.linalg.norm(edges[:, 1] - edges[:, 0], axis=1)[:, None]
    is_bound = (fraction * length >= -margin[:, :1]) & ((fraction - 1) * length <= margin[:, 1:])
    pair, corner = np.nonzero(is_bound & (apart <= within))
    normals = inward * np.column_stack((-along[:, 1], along[:, 0]))
    depths = inward * height
    return outline[pair, corner], normals[pair], depths[pair, corner]


def _point_contacts(points: Array, centres: Array, corners: Array, within: float) -> Contacts:
    """Return contacts of points (p, 2) with the sides of boards: their lines inside, their ends outside."""
    side = np.linalg.norm(corners[0])
    arms = points - centres[:, None]
    board, point = np.nonzero(np.linalg.norm(arms, axis=2) <= side + within)
    arms = arms[board, point]
    outward = unit(corners + np.roll(corners, -1, axis=0))
    outward = outward[(arms @ outward.T).argmax(axis=1)]
    along = np.column_stack((-outward[:, 1], outward[:, 0]))
    out, aside = (arms * outward).sum(axis=1) - np.sqrt(0.75) * side, (arms * along).sum(axis=1)
    margin = (aside - np.clip(aside, -side / 2, side / 2)) * (out > 0)
    away = out[:, None] * outward + margin[:, None] * along
    gaps = np.where(margin == 0, out, np.linalg.norm(away, axis=1))
    normals = -np.where((margin == 0)[:, None], outward, unit(away))
    is_near = gaps <= within
    return points[point[is_near]], normals[is_near], gaps[is_near]
