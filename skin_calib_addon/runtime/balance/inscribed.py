"""Simple shapes round a convex polygon, and within it: what a planner with few half-planes can use.

Each takes a polygon with an area and gives a polygon; of less, a segment, a point or nothing, it gives None. Of equal
ones the first counts, so that the answer does not hang on the last bit. Shapes within are within to the bit.
"""

import numpy as np

from ...common.arrays import Array
from .polygon import Polygon

TIE = 1e-12  # areas that differ by a smaller share are equal
GAP = 1e-11  # by how much of itself the largest box may miss the best there is
DIRECTIONS = 128  # in which the largest parallelogram is looked for, beside those of the edges
PEAKS = 8  # so many directions that are better than their neighbours are looked at closely, the best ones
NUDGE = 1e-13  # of the distance of its sides, by how much the largest parallelogram may be smaller than it might
GOLDEN = (5**0.5 - 1) / 2


def smallest_rectangle(polygon: Polygon) -> Polygon | None:
    """The rectangle of least area that holds a polygon; one of its sides holds an edge (Freeman & Shapira, 1975)."""
    if polygon.kind != "area":
        return None
    size, corners = _scaled(polygon)
    along = _directions(corners)
    across = _left(along)
    low_along, high_along = _extents(corners, along)
    low, high = _extents(corners, across)
    k = _first(-(high_along - low_along) * (high - low))
    u, v = along[k], across[k]
    box = [(low_along[k], low[k]), (high_along[k], low[k]), (high_along[k], high[k]), (low_along[k], high[k])]
    return Polygon(polygon.corners[0] + size * np.array([s * u + t * v for s, t in box]))


def smallest_parallelogram(polygon: Polygon) -> Polygon | None:
    """The parallelogram of least area that holds a polygon; each pair of its sides holds an edge.

    While a strip turns about the two corners that hold it, the area is monotonous (Schwarz et al., 1995).
    """
    if polygon.kind != "area":
        return None
    size, corners = _scaled(polygon)
    along = _directions(corners)
    across = _left(along)
    low, high = _extents(corners, across)
    sine = along[:, None, 0] * along[None, :, 1] - along[:, None, 1] * along[None, :, 0]
    with np.errstate(divide="ignore"):
        areas = (high - low)[:, None] * (high - low) / np.abs(sine)
    k, l = divmod(_first(-areas.ravel()), len(corners))
    pair, sides = across[[k, l]], [(low[k], low[l]), (high[k], low[l]), (high[k], high[l]), (low[k], high[l])]
    box = [np.linalg.solve(pair, side) for side in sides]
    return Polygon(polygon.corners[0] + size * np.array(box if sine[k, l] > 0 else box[::-1]))


def largest_triangle(polygon: Polygon) -> Polygon | None:
    """The largest triangle within a polygon, of all triangles of its corners.

    The linear algorithm of the textbooks is wrong (Keikha et al., arXiv 1705.11035).
    """
    if polygon.kind != "area":
        return None
    _, corners = _scaled(polygon)
    x, y = corners.T
    dx, dy = x[None, :] - x[:, None], y[None, :] - y[:, None]
    twice = dx[:, :, None] * dy[:, None, :] - dy[:, :, None] * dx[:, None, :]  # of corners i, j, k
    chosen = np.unravel_index(_first(twice.ravel()), twice.shape)
    return Polygon(polygon.corners[np.sort(chosen)])


def largest_box(polygon: Polygon) -> Polygon | None:
    """The largest rectangle within a polygon whose sides go along x and y, to 1e-11 of its area.

    The logarithm of the area is concave in the four sides, and the polygon's half-planes bound them: Newton steps
    follow the path of logarithmic barriers (Boyd & Vandenberghe, Convex Optimization, 11.3).
    """
    if polygon.kind != "area":
        return None
    low, high = polygon.corners.min(axis=0), polygon.corners.max(axis=0)
    stretched = Polygon((polygon.corners - low) / (high - low))
    normals, offsets = stretched.half_planes
    rows = np.hstack((np.minimum(normals, 0), np.maximum(normals, 0)))  # at the corner that is furthest out
    centre = np.array(stretched.centroid)
    depth = (offsets - normals @ centre).min() / 4
    sides = np.concatenate((centre - depth, centre + depth))
    if (sides[2:] <= sides[:2]).any() or (rows @ sides >= offsets).any():  # thinner than rounding
        return _within(polygon, np.repeat(low + (high - low) * centre[None], 4, axis=0))
    weight = 1.0
    while weight > GAP / len(rows):
        weight /= 20
        sides = _centred(sides, rows, offsets, weight)
    for k in (0, 2, 1, 3):  # as far as the others let it go
        binds = rows[:, k] != 0
        room = (offsets - rows @ sides)[binds] / rows[binds, k]
        sides[k] += room.max() if k < 2 else room.min()
    x, y, u, v = sides
    return _within(polygon, low + (high - low) * np.array([(x, y), (u, y), (u, v), (x, v)]))


def _centred(sides: Array, rows: Array, offsets: Array, weight: float) -> Array:
    """Four sides that are the best of a box when nearness to each half-plane costs its weighted logarithm."""

    def cost(at):
        slack, (w, h) = offsets - rows @ at, at[2:] - at[:2]
        if not min(slack.min(), w, h) > 0:
            return np.inf
        return -np.log(w) - np.log(h) - weight * np.log(slack).sum()

    now, root = cost(sides), np.sqrt(weight)
    for _ in range(50):
        slack, (w, h) = offsets - rows @ sides, sides[2:] - sides[:2]
        # Newton's step as least squares, whose condition is the root of that of the second derivatives.
        bends = np.vstack(((1 / w, 0, -1 / w, 0), (0, 1 / h, 0, -1 / h), root * rows / slack[:, None]))
        pulls = np.concatenate(((1.0, 1.0), np.full(len(rows), root)))
        step = np.linalg.lstsq(bends, -pulls, rcond=None)[0]
        gain = -pulls @ (bends @ step)
        if not gain > 1e-14:
            break
        length = 1.0
        while not (then := cost(sides + length * step)) <= now - 0.1 * length * gain:
            length /= 2
            if length < 1e-9:  # rounding is all that is left
                return sides
        sides, now = sides + length * step, then
    return sides


def largest_parallelogram(polygon: Polygon) -> Polygon | None:
    """The largest parallelogram within a polygon.

    For one direction of its sides the best is exact (:func:`_best_along`). Directions are tried all round, of the
    polygon made as round as its moments can, with those of its edges; between the neighbours of each one that is
    better than they are, the best is found by golden section.
    """
    if polygon.kind != "area":
        return None
    corners, back = _rounded(polygon)
    edges = np.roll(corners, -1, axis=0) - corners
    angles = np.concatenate((np.arange(DIRECTIONS) * np.pi / DIRECTIONS, np.arctan2(edges[:, 1], edges[:, 0]) % np.pi))
    angles = np.unique(angles)
    areas = _best_along(corners, angles)[0]
    peaks = np.flatnonzero((areas >= np.roll(areas, 1)) & (areas >= np.roll(areas, -1)))
    peaks = peaks[np.argsort(-areas[peaks], kind="stable")[:PEAKS]]
    before, behind = angles[peaks - 1], angles[(peaks + 1) % len(angles)]
    low, high = before - np.pi * (before > angles[peaks]), behind + np.pi * (behind < angles[peaks])
    tried = np.concatenate((angles, _golden(corners, low, high)))
    areas = np.concatenate((areas, _best_along(corners, tried[len(angles) :])[0]))
    k = _first(areas)
    _, length, first, last = (part[0] for part in _best_along(corners, tried[k : k + 1]))
    u = np.array((np.cos(tried[k]), np.sin(tried[k])))
    v = _left(u)
    nudge = NUDGE * (last - first)  # an edge along the sides is a chord whose ends rounding tells apart
    chords = [(_chord(corners @ u, corners @ v, offset), offset) for offset in (first + nudge, last - nudge)]
    length = min(length, *(stop - start for (start, stop), _ in chords))
    ends = []
    for (start, stop), offset in chords:
        middle = (start + stop) / 2
        ends.append([(middle + sign * length / 2) * u + offset * v for sign in (-1, 1)])
    (a, b), (d, c) = ends
    return _within(polygon, polygon.corners[0] + np.array((a, b, c, d)) @ back)


def _best_along(corners: Array, angles: Array) -> tuple[Array, Array, Array, Array]:
    """The largest parallelograms with sides along directions: areas, lengths of these sides and both their offsets.

    Two chords of one length that are furthest apart: the length of a chord is concave in its offset, so the distance
    that chords of a length or longer leave between them is concave and piecewise linear in that length.
    """
    u = np.stack((np.cos(angles), np.sin(angles)), axis=1)
    along, across = u @ corners.T, _left(u) @ corners.T  # (n, h)
    order = np.argsort(across, axis=1, kind="stable")
    offsets = np.take_along_axis(across, order, axis=1)
    lengths = _chords(along, across, offsets)
    levels = np.sort(lengths, axis=1)
    first, last = _apart(offsets, lengths, levels)
    room = last - first
    # Within a level and the next the room is linear: area is a parabola.
    drop, rise = room[:, :-1] - room[:, 1:], np.diff(levels, axis=1)
    share = np.divide(
        room[:, :-1] * rise - levels[:, :-1] * drop, 2 * drop * rise, out=np.zeros_like(rise), where=drop * rise > 0
    )
    share = np.clip(share, 0, 1)
    lengths = np.hstack((levels[:, :-1] + share * rise, levels[:, -1:]))
    rooms = np.hstack((room[:, :-1] - share * drop, room[:, -1:]))
    k = (lengths * rooms).argmax(axis=1)
    rows, share = np.arange(len(angles)), np.hstack((share, np.zeros((len(angles), 1))))
    t, l = share[rows, k], np.minimum(k + 1, levels.shape[1] - 1)
    first = first[rows, k] + t * (first[rows, l] - first[rows, k])
    last = last[rows, k] + t * (last[rows, l] - last[rows, k])
    return (lengths * rooms)[rows, k], lengths[rows, k], first, last


def _chords(along: Array, across: Array, offsets: Array) -> Array:
    """Lengths of the chords of polygons (n, h) at offsets (n, m)."""
    start, stop = across[:, None, :], np.roll(across, -1, axis=1)[:, None, :]
    a, b = along[:, None, :], np.roll(along, -1, axis=1)[:, None, :]
    at = offsets[:, :, None]
    run = np.broadcast_to(stop - start, (*offsets.shape, across.shape[1]))
    share = np.divide(at - start, run, out=np.zeros(run.shape), where=run != 0)
    place = a + share * (b - a)
    meets = (share >= 0) & (share <= 1) & ((run != 0) | (at == start))
    return np.where(meets, place, -np.inf).max(axis=2) - np.where(meets, place, np.inf).min(axis=2)


def _chord(along: Array, across: Array, offset: float) -> tuple[float, float]:
    """Both ends of the chord of one polygon (h,) at an offset."""
    after, then = np.roll(across, -1), np.roll(along, -1)
    run = after - across
    share = np.divide(offset - across, run, out=np.zeros_like(run), where=run != 0)
    place = along + np.clip(share, 0, 1) * (then - along)
    meets = (np.minimum(across, after) <= offset) & (offset <= np.maximum(across, after))
    return place[meets].min(), place[meets].max()


def _apart(offsets: Array, lengths: Array, levels: Array) -> tuple[Array, Array]:
    """First and last offsets (n, m) at which chords, given at sorted offsets (n, h), are as long as levels (n, m)."""
    run, rise = np.diff(offsets, axis=1)[:, None, :], np.diff(lengths, axis=1)[:, None, :]
    over = levels[:, :, None] - lengths[:, None, :-1]
    place = offsets[:, None, :-1] + np.divide(over * run, rise, out=np.zeros_like(over), where=rise != 0)
    first = np.where(rise > 0, place, -np.inf).max(axis=2, initial=-np.inf)
    last = np.where(rise < 0, place, np.inf).min(axis=2, initial=np.inf)
    low, high = offsets[:, :1], offsets[:, -1:]
    return np.clip(first, low, high), np.clip(last, low, high)


def _golden(corners: Array, low: Array, high: Array) -> Array:
    """Angles within intervals, at which parallelograms are largest."""
    left, right = high - GOLDEN * (high - low), low + GOLDEN * (high - low)
    at_left, at_right = (_best_along(corners, angles)[0] for angles in (left, right))
    for _ in range(40):
        is_left = at_left > at_right
        low, high = np.where(is_left, low, left), np.where(is_left, right, high)
        new = np.where(is_left, high - GOLDEN * (high - low), low + GOLDEN * (high - low))
        at_new = _best_along(corners, new)[0]
        left, right = np.where(is_left, new, right), np.where(is_left, left, new)
        at_left, at_right = np.where(is_left, at_new, at_right), np.where(is_left, at_left, at_new)
    return np.where(at_left > at_right, left, right)


def _scaled(polygon: Polygon) -> tuple[float, Array]:
    """The size of a polygon, and its corners from the first one in that size."""
    corners = polygon.corners - polygon.corners[0]
    size = float(np.abs(corners).max())
    return size, corners / size


def _rounded(polygon: Polygon) -> tuple[Array, Array]:
    """Corners (h, 2) mapped so that they spread alike in all directions, and the matrix (2, 2) that maps them back."""
    size, corners = _scaled(polygon)
    spread = corners - corners.mean(axis=0)
    _, widths, axes = np.linalg.svd(spread, full_matrices=False)
    if np.linalg.det(axes) < 0:
        axes[1] = -axes[1]
    back = widths[:, None] * axes * size
    return corners @ axes.T / widths, back


def _directions(corners: Array) -> Array:
    """Unit vectors (h, 2) along the edges."""
    edges = np.roll(corners, -1, axis=0) - corners
    return edges / np.hypot(*edges.T)[:, None]


def _left(vectors: Array) -> Array:
    """Vectors (..., 2) turned left by a quarter."""
    return np.stack((-vectors[..., 1], vectors[..., 0]), axis=-1)


def _extents(corners: Array, directions: Array) -> tuple[Array, Array]:
    """Lowest and highest place of the corners along each direction (n, 2)."""
    places = directions @ corners.T
    return places.min(axis=1), places.max(axis=1)


def _first(values: Array) -> int:
    """The first of the highest values."""
    best = values.max()
    return int((values >= best - TIE * abs(best)).argmax())


def _within(polygon: Polygon, corners: Array) -> Polygon:
    """A shape drawn towards its middle by as little as keeps rounding from leaving a corner outside.

    In a polygon so thin that floats hold no shape within, four times one of its corners.
    """
    middle, shrink = corners.mean(axis=0), 2.0**-52
    drawn = corners
    while not all(polygon.contains(corner) for corner in drawn):
        if shrink > 1:
            return Polygon(np.repeat(polygon.corners[:1], len(corners), axis=0))
        drawn = middle + (1 - shrink) * (corners - middle)
        shrink *= 2
    return Polygon(drawn)
