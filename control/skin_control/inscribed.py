"""Compute simple shapes around and in a convex polygon, for planners that can use only a few half-planes.

Each function takes a polygon with an area and returns a polygon. For a segment, a point or an empty polygon it returns
None. Of equal shapes the first one counts, so that the result does not depend on the last bit. Shapes in a polygon are
inside without rounding.
"""

import numpy as np

from skin_calib_addon.runtime import Polygon

from .checks import Array

# Relative difference of two areas up to which they are equal.
# Larger: a shape that is not the best can win; smaller: the last bit decides.
EQUAL_AREA_TOLERANCE = 1e-12
# Relative error of the area of the largest box. Larger: less accurate; smaller: more iterations.
RELATIVE_GAP = 1e-11
# Distance by which the sides of the largest parallelogram move inward, relative to their distance. Larger: a smaller
# parallelogram; smaller: rounding can put a chord outside.
OFFSET_MARGIN = 1e-13
GOLDEN_RATIO = (5**0.5 - 1) / 2  # Derived: mathematical constant


def smallest_rectangle(polygon: Polygon) -> Polygon | None:
    """Return the rectangle of the smallest area around a polygon; a side contains an edge (Freeman & Shapira, 1975)."""
    if polygon.kind != "area":
        return None
    size, corners = _scaled(polygon)
    along = _directions(corners)
    across = _left(along)
    low_along, high_along = _extents(corners, along)
    low, high = _extents(corners, across)
    k = _first_maximum(-(high_along - low_along) * (high - low))
    u, v = along[k], across[k]
    box = [(low_along[k], low[k]), (high_along[k], low[k]), (high_along[k], high[k]), (low_along[k], high[k])]
    return Polygon(polygon.corners[0] + size * np.array([s * u + t * v for s, t in box]))


def smallest_parallelogram(polygon: Polygon) -> Polygon | None:
    """Return the parallelogram of the smallest area around a polygon; each pair of sides contains an edge.

    While a strip rotates about the two corners that it touches, the area is monotonic (Schwarz et al., 1995).
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
    k, l = divmod(_first_maximum(-areas.ravel()), len(corners))
    pair, sides = across[[k, l]], [(low[k], low[l]), (high[k], low[l]), (high[k], high[l]), (low[k], high[l])]
    box = [np.linalg.solve(pair, side) for side in sides]
    return Polygon(polygon.corners[0] + size * np.array(box if sine[k, l] > 0 else box[::-1]))


def largest_triangle(polygon: Polygon) -> Polygon | None:
    """Return the largest triangle in a polygon: the best of all triangles of its corners.

    The linear-time algorithm of textbooks is wrong (Keikha et al., arXiv 1705.11035).
    """
    if polygon.kind != "area":
        return None
    _, corners = _scaled(polygon)
    x, y = corners.T
    dx, dy = x[None, :] - x[:, None], y[None, :] - y[:, None]
    twice = dx[:, :, None] * dy[:, None, :] - dy[:, :, None] * dx[:, None, :]  # of corners i, j, k
    chosen = np.unravel_index(_first_maximum(twice.ravel()), twice.shape)
    return Polygon(polygon.corners[np.sort(chosen)])


def largest_box(polygon: Polygon) -> Polygon | None:
    r"""Return the largest rectangle in a polygon with sides along x and y; relative error of its area 1e-11.

    With the sides x, y, u, v, the half-planes :math:`\mathbf{a}_k \cdot \mathbf{p} \le b_k` and the outermost corner
    :math:`\mathbf{p}_k` of the rectangle in each direction, the problem is convex:

    .. math::
        \max\; \log(u - x) + \log(v - y) \quad \text{subject to} \quad \mathbf{a}_k \cdot \mathbf{p}_k \le b_k .

    Newton steps follow the path of logarithmic barriers (Boyd & Vandenberghe, Convex Optimization, 11.3).
    """
    if polygon.kind != "area":
        return None
    low, high = polygon.corners.min(axis=0), polygon.corners.max(axis=0)
    stretched = Polygon((polygon.corners - low) / (high - low))
    normals, offsets = stretched.half_planes
    rows = np.hstack((np.minimum(normals, 0), np.maximum(normals, 0)))  # at the outermost corner
    centre = np.array(stretched.centroid)
    depth = (offsets - normals @ centre).min() / 4
    sides = np.concatenate((centre - depth, centre + depth))
    if (sides[2:] <= sides[:2]).any() or (rows @ sides >= offsets).any():  # the polygon is thinner than rounding errors
        return _within(polygon, np.repeat(low + (high - low) * centre[None], 4, axis=0))
    weight = 1.0
    while weight > RELATIVE_GAP / len(rows):
        weight /= 20
        sides = _centred(sides, rows, offsets, weight)
    for k in (0, 2, 1, 3):  # move each side outward until it meets a half-plane
        binds = rows[:, k] != 0
        distance = (offsets - rows @ sides)[binds] / rows[binds, k]
        sides[k] += distance.max() if k < 2 else distance.min()
    x, y, u, v = sides
    return _within(polygon, low + (high - low) * np.array([(x, y), (u, y), (u, v), (x, v)]))


def _centred(sides: Array, rows: Array, offsets: Array, weight: float) -> Array:
    """Return the four sides of the best box for one weight of the logarithmic barriers."""

    def cost(at):
        slack, (w, h) = offsets - rows @ at, at[2:] - at[:2]
        if not min(slack.min(), w, h) > 0:
            return np.inf
        return -np.log(w) - np.log(h) - weight * np.log(slack).sum()

    now, root = cost(sides), np.sqrt(weight)
    for _ in range(50):
        slack, (w, h) = offsets - rows @ sides, sides[2:] - sides[:2]
        # Newton step as a least-squares problem: its condition number is the square root of that of the Hessian.
        jacobian = np.vstack(((1 / w, 0, -1 / w, 0), (0, 1 / h, 0, -1 / h), root * rows / slack[:, None]))
        residuals = np.concatenate(((1.0, 1.0), np.full(len(rows), root)))
        step = np.linalg.lstsq(jacobian, -residuals, rcond=None)[0]
        gain = -residuals @ (jacobian @ step)
        if not gain > 1e-14:
            break
        length = 1.0
        while not (then := cost(sides + length * step)) <= now - 0.1 * length * gain:
            length /= 2
            if length < 1e-9:  # only rounding errors are left
                return sides
        sides, now = sides + length * step, then
    return sides


def largest_parallelogram(polygon: Polygon) -> Polygon | None:
    """Return the largest parallelogram in a polygon.

    For one direction of the sides the best one is exact (:func:`_best_along`). The search compares the directions of
    the edges, after a linear map that makes the second moments of the polygon equal, and the best direction between
    each two of them by a golden-section search. In 5000 random polygons no dense search found a larger one.
    """
    if polygon.kind != "area":
        return None
    corners, back = _rounded(polygon)
    edges = np.roll(corners, -1, axis=0) - corners
    angles = np.unique(np.arctan2(edges[:, 1], edges[:, 0]) % np.pi)
    tried = np.concatenate((angles, _golden(corners, angles, np.append(angles[1:], angles[0] + np.pi))))
    areas = _best_along(corners, tried)[0]
    k = _first_maximum(areas)
    _, length, first, last = (part[0] for part in _best_along(corners, tried[k : k + 1]))
    u = np.array((np.cos(tried[k]), np.sin(tried[k])))
    v = _left(u)
    margin = OFFSET_MARGIN * (last - first)  # at an edge parallel to the sides, rounding changes the chord
    chords = [(_chord(corners @ u, corners @ v, offset), offset) for offset in (first + margin, last - margin)]
    length = min(length, *(stop - start for (start, stop), _ in chords))
    ends = []
    for (start, stop), offset in chords:
        middle = (start + stop) / 2
        ends.append([(middle + sign * length / 2) * u + offset * v for sign in (-1, 1)])
    (a, b), (d, c) = ends
    return _within(polygon, polygon.corners[0] + np.array((a, b, c, d)) @ back)


def _best_along(corners: Array, angles: Array) -> tuple[Array, Array, Array, Array]:
    """Return the largest parallelograms with sides along directions: areas, lengths of these sides, both offsets.

    Each consists of two chords of equal length with the largest distance. The length of a chord is concave in its
    offset. The largest distance of chords of at least a length is therefore concave and piecewise linear in the length.
    """
    u = np.stack((np.cos(angles), np.sin(angles)), axis=1)
    along, across = u @ corners.T, _left(u) @ corners.T  # (n, h)
    order = np.argsort(across, axis=1, kind="stable")
    offsets = np.take_along_axis(across, order, axis=1)
    lengths = _chords(along, across, offsets)
    levels = np.sort(lengths, axis=1)
    first, last = _outermost_offsets(offsets, lengths, levels)
    distance = last - first
    # Between two levels the distance is linear, and the area is a parabola.
    drop, rise = distance[:, :-1] - distance[:, 1:], np.diff(levels, axis=1)
    fraction = np.divide(
        distance[:, :-1] * rise - levels[:, :-1] * drop, 2 * drop * rise, out=np.zeros_like(rise), where=drop * rise > 0
    )
    fraction = np.clip(fraction, 0, 1)
    lengths = np.hstack((levels[:, :-1] + fraction * rise, levels[:, -1:]))
    distances = np.hstack((distance[:, :-1] - fraction * drop, distance[:, -1:]))
    k = (lengths * distances).argmax(axis=1)
    rows, fraction = np.arange(len(angles)), np.hstack((fraction, np.zeros((len(angles), 1))))
    t, l = fraction[rows, k], np.minimum(k + 1, levels.shape[1] - 1)
    first = first[rows, k] + t * (first[rows, l] - first[rows, k])
    last = last[rows, k] + t * (last[rows, l] - last[rows, k])
    return (lengths * distances)[rows, k], lengths[rows, k], first, last


def _chords(along: Array, across: Array, offsets: Array) -> Array:
    """Return the lengths of the chords of polygons (n, h) at offsets (n, m)."""
    start, stop = across[:, None, :], np.roll(across, -1, axis=1)[:, None, :]
    a, b = along[:, None, :], np.roll(along, -1, axis=1)[:, None, :]
    at = offsets[:, :, None]
    run = np.broadcast_to(stop - start, (*offsets.shape, across.shape[1]))
    fraction = np.divide(at - start, run, out=np.zeros(run.shape), where=run != 0)
    position = a + fraction * (b - a)
    meets = (fraction >= 0) & (fraction <= 1) & ((run != 0) | (at == start))
    return np.where(meets, position, -np.inf).max(axis=2) - np.where(meets, position, np.inf).min(axis=2)


def _chord(along: Array, across: Array, offset: float) -> tuple[float, float]:
    """Return both ends of the chord of one polygon (h,) at an offset."""
    after, then = np.roll(across, -1), np.roll(along, -1)
    run = after - across
    fraction = np.divide(offset - across, run, out=np.zeros_like(run), where=run != 0)
    position = along + np.clip(fraction, 0, 1) * (then - along)
    meets = (np.minimum(across, after) <= offset) & (offset <= np.maximum(across, after))
    return position[meets].min(), position[meets].max()


def _outermost_offsets(offsets: Array, lengths: Array, levels: Array) -> tuple[Array, Array]:
    """Return the first and last offsets (n, m) at which chords, given at sorted offsets (n, h), have lengths (n, m)."""
    run, rise = np.diff(offsets, axis=1)[:, None, :], np.diff(lengths, axis=1)[:, None, :]
    over = levels[:, :, None] - lengths[:, None, :-1]
    position = offsets[:, None, :-1] + np.divide(over * run, rise, out=np.zeros_like(over), where=rise != 0)
    first = np.where(rise > 0, position, -np.inf).max(axis=2, initial=-np.inf)
    last = np.where(rise < 0, position, np.inf).min(axis=2, initial=np.inf)
    low, high = offsets[:, :1], offsets[:, -1:]
    return np.clip(first, low, high), np.clip(last, low, high)


def _golden(corners: Array, low: Array, high: Array) -> Array:
    """Return the angles in intervals at which the parallelograms are largest."""
    left, right = high - GOLDEN_RATIO * (high - low), low + GOLDEN_RATIO * (high - low)
    at_left, at_right = (_best_along(corners, angles)[0] for angles in (left, right))
    for _ in range(40):
        is_left = at_left > at_right
        low, high = np.where(is_left, low, left), np.where(is_left, right, high)
        new = np.where(is_left, high - GOLDEN_RATIO * (high - low), low + GOLDEN_RATIO * (high - low))
        at_new = _best_along(corners, new)[0]
        left, right = np.where(is_left, new, right), np.where(is_left, left, new)
        at_left, at_right = np.where(is_left, at_new, at_right), np.where(is_left, at_left, at_new)
    return np.where(at_left > at_right, left, right)


def _scaled(polygon: Polygon) -> tuple[float, Array]:
    """Return the size of a polygon, and its corners relative to the first one, divided by the size."""
    corners = polygon.corners - polygon.corners[0]
    size = float(np.abs(corners).max())
    return size, corners / size


def _rounded(polygon: Polygon) -> tuple[Array, Array]:
    """Return the corners (h, 2) mapped to equal second moments, and the matrix (2, 2) of the inverse map."""
    size, corners = _scaled(polygon)
    spread = corners - corners.mean(axis=0)
    _, widths, axes = np.linalg.svd(spread, full_matrices=False)
    if np.linalg.det(axes) < 0:
        axes[1] = -axes[1]
    back = widths[:, None] * axes * size
    return corners @ axes.T / widths, back


def _directions(corners: Array) -> Array:
    """Return unit vectors (h, 2) along the edges."""
    edges = np.roll(corners, -1, axis=0) - corners
    return edges / np.hypot(*edges.T)[:, None]


def _left(vectors: Array) -> Array:
    """Return vectors (..., 2) rotated by 90 degrees counter-clockwise."""
    return np.stack((-vectors[..., 1], vectors[..., 0]), axis=-1)


def _extents(corners: Array, directions: Array) -> tuple[Array, Array]:
    """Return the minimum and maximum coordinate of the corners along each direction (n, 2)."""
    coordinates = directions @ corners.T
    return coordinates.min(axis=1), coordinates.max(axis=1)


def _first_maximum(values: Array) -> int:
    """Return the index of the first value that equals the maximum."""
    best = values.max()
    return int((values >= best - EQUAL_AREA_TOLERANCE * abs(best)).argmax())


def _within(polygon: Polygon, corners: Array) -> Polygon:
    """Return a shape, scaled about its centre by the largest factor with which all corners are inside.

    If the polygon is too thin for any shape in double precision, the result repeats one corner of the polygon.
    """
    middle, shrink = corners.mean(axis=0), 2.0**-52
    scaled = corners
    while not all(polygon.contains(corner) for corner in scaled):
        if shrink > 1:
            return Polygon(np.repeat(polygon.corners[:1], len(corners), axis=0))
        scaled = middle + (1 - shrink) * (corners - middle)
        shrink *= 2
    return Polygon(scaled)
