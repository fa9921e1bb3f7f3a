"""Where boards and the border of their region meet, or may come to: what bounds how the boards can move."""

import numpy as np

from ...common.arrays import Array, unit
from .region import Region, along_edges

Contacts = tuple[Array, Array, Array]  # points, normals, gaps


def contacts(region: Region, centres: Array, corners: Array, within: float, step: float) -> Contacts:
    """Where boards and the border of their region are, or come after a step, close to each other.

    A corner of a board meets an edge of the region, or a side of a board meets a reflex point of the region.

    Returns
    -------
    points : array, shape (k, 2)
        Where they touch, or would [m].
    normals : array, shape (k, 2)
        Unit, where the board goes to get away.
    gaps : array, shape (k,)
        How far they are apart, at most ``within``; negative where they cross [m].
    """
    at_edges = _corner_contacts(region, centres, corners, within, step)
    at_points = _point_contacts(region.points[region.is_reflex], centres, corners, within)
    points, normals, gaps = (np.concatenate(both) for both in zip(at_edges, at_points))
    return points, normals, gaps


def _corner_contacts(region: Region, centres: Array, corners: Array, within: float, step: float) -> Contacts:
    """Contacts of the corners of boards with the edges of a region; boards lie on the side of their centres."""
    board, edge = np.nonzero(region.distances(centres) <= np.linalg.norm(corners[0]) + within)
    edges, outline = region.edges[edge], centres[board, None] + corners
    along = unit(edges[:, 1] - edges[:, 0])
    inward: Array = np.where(along_edges(centres[board], edges)[2] < 0, -1.0, 1.0)[:, None]
    apart, fraction, height = along_edges(outline, edges[:, None])
    # Past a reflex end the line of an edge bounds nothing. Past a convex one it does, but further off may be anything.
    margin = np.where(region.is_reflex[region.ends[edge]], 0.0, step)
    length = np.linalg.norm(edges[:, 1] - edges[:, 0], axis=1)[:, None]
    is_bound = (fraction * length >= -margin[:, :1]) & ((fraction - 1) * length <= margin[:, 1:])
    pair, corner = np.nonzero(is_bound & (apart <= within))
    normals = inward * np.column_stack((-along[:, 1], along[:, 0]))
    depths = inward * height
    return outline[pair, corner], normals[pair], depths[pair, corner]


def _point_contacts(points: Array, centres: Array, corners: Array, within: float) -> Contacts:
    """Contacts of points (p, 2) with the sides of boards: with their lines from inside, with their ends from beyond."""
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
