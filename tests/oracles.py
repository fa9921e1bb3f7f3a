"""Slow, obvious versions of fast functions of the package: one function, one face, one point at a time."""

from fractions import Fraction
from functools import cache
from math import isqrt

import numpy as np


def basis_function(i, degree, knots, u):
    """Return the Cox-de Boor recursion (The NURBS Book, eq. 2.5) with 0/0 = 0; the last span includes its right end."""
    knots = [float(knot) for knot in knots]
    last = max(j for j in range(len(knots) - 1) if knots[j] < knots[j + 1])
    span = last if u == knots[last + 1] else next(j for j in range(last + 1) if knots[j] <= u < knots[j + 1])

    @cache
    def value(j, p):
        if p == 0:
            return 1.0 if j == span else 0.0
        result = 0.0
        if knots[j + p] > knots[j]:
            result += (u - knots[j]) / (knots[j + p] - knots[j]) * value(j, p - 1)
        if knots[j + p + 1] > knots[j + 1]:
            result += (knots[j + p + 1] - u) / (knots[j + p + 1] - knots[j + 1]) * value(j + 1, p - 1)
        return result

    return value(i, degree)


def basis_matrix(parameters, knots, degree):
    """Return every basis function at every parameter, one after the other."""
    count = len(knots) - degree - 1
    return np.array([[basis_function(i, degree, knots, u) for i in range(count)] for u in parameters])


def surface_point(surface, u, v):
    """Return the double sum of the definition, for parameters in [0, 1]."""
    point = np.zeros(3)
    for i, row in enumerate(surface.control_net):
        for j, control_point in enumerate(row):
            weight = basis_function(i, surface.degree[0], surface.knots_u, u)
            point += weight * basis_function(j, surface.degree[1], surface.knots_v, v) * control_point
    return point


def cut_triangle(corners, point, normal):
    """Return the ends of the segment in which a plane cuts one triangle, in any order; None without a cut.

    A corner on the plane counts as below it.
    """
    heights = [(corner - point) @ normal for corner in corners]
    ends = []
    for a, b in ((0, 1), (1, 2), (2, 0)):
        if (heights[a] > 0) != (heights[b] > 0):
            ends.append(corners[a] + heights[a] / (heights[a] - heights[b]) * (corners[b] - corners[a]))
    return np.array(ends) if ends else None


def rim_in_plane(mesh, face, point, normal):
    """Return the ends of a face's edge in a plane where the mesh ends at the plane; None without one.

    The face is below the plane, no face at this edge is above it, and no other face below it is listed before.
    """
    corners = mesh.faces[face].tolist()
    height = (mesh.vertices - point) @ normal
    edge = [v for v in corners if height[v] == 0]
    if len(edge) != 2 or min(height[corners]) == 0:
        return None
    for other, others in enumerate(mesh.faces.tolist()):
        tips = [height[v] for v in others if v not in edge]
        if len(tips) == 1 and (tips[0] > 0 or (tips[0] < 0 and other < face)):
            return None
    return mesh.vertices[edge]


def cast_on_segments(origin, direction, segments):
    """Return the distance along one ray in the plane to the furthest segment that it hits; NaN for a miss."""
    furthest = np.nan
    for start, stop in segments:
        system = np.column_stack((direction, start - stop))
        if np.linalg.det(system) == 0:
            continue
        distance, fraction = np.linalg.solve(system, start - origin)
        if distance > 0 and -1e-9 <= fraction <= 1 + 1e-9 and not distance <= furthest:
            furthest = distance
    return furthest


def cast_on_mesh(origin, direction, triangles):
    """Return the distance along one ray in space to the furthest triangle that it hits; NaN for a miss."""
    furthest = np.nan
    for a, b, c in triangles:
        system = np.column_stack((-direction, b - a, c - a))
        if abs(np.linalg.det(system)) < 1e-300:
            continue
        distance, s, t = np.linalg.solve(system, origin - a)
        if distance > 0 and min(s, t, 1 - s - t) >= -1e-9 and not distance <= furthest:
            furthest = distance
    return furthest


def nearest_on_segment(point, start, stop):
    """Return the nearest point of a segment, whose length may be zero."""
    along = stop - start
    fraction = (point - start) @ along / (along @ along) if along.any() else 0.0
    return start + min(max(fraction, 0.0), 1.0) * along


def nearest_on_triangle(point, corners):
    """Return the nearest point of one triangle: the projection if it is inside, else the best of its three sides."""
    a, b, c = corners
    feet = [nearest_on_segment(point, *side) for side in ((a, b), (b, c), (c, a))]
    normal = np.cross(b - a, c - a)
    if normal @ normal > 0:
        foot = point - (point - a) @ normal / (normal @ normal) * normal
        turns = [np.cross(stop - start, foot - start) @ normal for start, stop in ((a, b), (b, c), (c, a))]
        if min(turns) >= 0:
            feet.append(foot)
    return min(feet, key=lambda foot: np.linalg.norm(foot - point))


def distance_to_mesh(point, triangles):
    """Return the distance from one point to the nearest of all triangles."""
    return min(np.linalg.norm(nearest_on_triangle(point, corners) - point) for corners in triangles)


def components(active, neighbours):
    """Return the connected groups of active taxels, by flood fill; ``neighbours[i]`` are the rows adjacent to row i."""
    groups, waiting = set(), {i for i, is_active in enumerate(active) if is_active}
    while waiting:
        group, edge = set(), {min(waiting)}
        while edge:
            group |= edge
            edge = {j for i in edge for j in neighbours[i] if active[j]} - group
        waiting -= group
        groups.add(frozenset(group))
    return groups


def best_step(fit):
    """Return the movements of the control points of a fit that reduce its residuals further, shape (n, m).

    Dense least squares: every sample ray is cast on every triangle, and every control point has its own column. Also
    returned: the root mean square of the residuals before and after that step [m].
    """
    surface, lines = fit.surface, fit.lines
    sites, sides = fit.residuals.shape
    u, v = np.arange(sites) / (sites - 1), np.arange(sides) / (sides if lines.closed else sides - 1)
    N, M = basis_matrix(u, surface.knots_u, surface.degree[0]), basis_matrix(v, surface.knots_v, surface.degree[1])
    n, m = lines.origins.shape[:2]
    place = [_line_of(surface, lines, j) for j in range(surface.control_net.shape[1])]
    rows, targets = [], []
    for k in range(sites):
        for l in range(sides):
            fraction = np.zeros((n, m))
            for j, line in enumerate(place):
                fraction[:, line] += N[k] * M[l, j]
            origin = np.tensordot(fraction, lines.origins, 2)
            arm = surface_point(surface, u[k], v[l]) - origin
            ray = arm / np.linalg.norm(arm)
            rows.append((fraction * (lines.directions @ ray)).ravel())
            targets.append(cast_on_mesh(origin, ray, fit.mesh.triangles) - np.linalg.norm(arm))
    rows, targets = np.array(rows), np.array(targets)
    step = np.linalg.lstsq(rows, targets, rcond=None)[0]
    return step.reshape(n, m), np.sqrt(np.mean(targets**2)), np.sqrt(np.mean((targets - rows @ step) ** 2))


def _line_of(surface, lines, column):
    """Return the line of each column of the net."""
    gap = surface.control_net[:, column, None] - lines.origins
    off = np.linalg.norm(gap - (gap * lines.directions).sum(axis=2, keepdims=True) * lines.directions, axis=2)
    side = (gap * lines.directions).sum(axis=2) < 0  # half-planes have one direction only
    return int((off + side * np.linalg.norm(gap, axis=2)).max(axis=0).argmin())


def is_inside(point, loops):
    """Return whether a ray from the point along x crosses the loops 1, 3, 5 ... times, one edge after the other."""
    crossings = 0
    for loop in loops:
        for (ax, ay), (bx, by) in zip(loop, np.roll(loop, -1, axis=0)):
            if (ay > point[1]) != (by > point[1]):
                crossings += point[0] < ax + (point[1] - ay) / (by - ay) * (bx - ax)
    return crossings % 2 == 1


def points_on(loop, count):
    """Return a number of points on each edge of a loop, including its corners."""
    fraction = np.arange(count)[:, None] / count
    return np.concatenate([a + fraction * (b - a) for a, b in zip(loop, np.roll(loop, -1, axis=0))])


def boards_inside(centres, corners, edges):
    """Return which hexagons with ``corners`` about ``centres`` are inside: the centre is, and no edge enters one."""
    x, y = centres.T
    inside = np.zeros(len(centres), bool)
    for (ax, ay), (bx, by) in edges:
        if ay != by:
            inside ^= ((ay > y) != (by > y)) & (x < ax + (y - ay) / (by - ay) * (bx - ax))
    rows = np.flatnonzero(inside)
    middles = (corners + np.roll(corners, -1, axis=0))[:3] / 2
    apothem = np.linalg.norm(middles[0])
    normals = middles / apothem
    heights = normals @ centres[rows].T
    for a, b in edges:
        first, last = 0.0, 1.0
        for normal, height in zip(normals, heights):  # the part of the edge between two sides that face each other
            start, run = a @ normal - height, (b - a) @ normal
            half = (apothem - 1e-9) / max(abs(run), 1e-15)
            middle = -start / (run if abs(run) > 1e-15 else 1e-15)
            first, last = np.maximum(first, middle - half), np.minimum(last, middle + half)
        is_clear = first >= last
        rows, heights = rows[is_clear], heights[:, is_clear]
    fits = np.zeros(len(centres), bool)
    fits[rows] = True
    return fits


def most_boards(edges, lattice, offsets, angles):
    """Return the most boards inside at any of the offsets (n, 2), given on the lattice, and any of the angles."""
    low, high = (getattr(edges, direction)(axis=(0, 1)) for direction in ("min", "max"))
    limit = np.linalg.norm(high - low) / 2 + np.linalg.norm(offsets, axis=1).max()
    n = int(limit / lattice.pitch) + 2
    cells = lattice.centres(np.array([(q, r) for q in range(-2 * n, 2 * n + 1) for r in range(-n, n + 1)]))
    cells = cells[np.linalg.norm(cells, axis=1) <= limit]
    board = np.sqrt(0.75) * lattice.side - 1e-9
    most = 0
    for angle in angles:
        turn = np.array(((np.cos(angle), np.sin(angle)), (-np.sin(angle), np.cos(angle))))
        centres = ((low + high) / 2 + (offsets @ turn)[:, None] + cells @ turn).reshape(-1, 2)
        near = np.flatnonzero(((centres >= low + board) & (centres <= high - board)).all(axis=1))
        fits = near[boards_inside(centres[near], lattice.corners @ turn, edges)]
        most = max(most, np.bincount(fits // len(cells), minlength=1).max())
    return most


def all_offsets(lattice, step):
    """Return the offsets of a lattice in steps of at most this length, (n, 2)."""
    parts = int(np.ceil(lattice.pitch / step))
    fraction = np.array([(i, j) for i in range(parts) for j in range(parts)]) / parts - 0.5
    return fraction @ lattice.centres(np.eye(2, dtype=int))


def felt(skin, forces, active):
    """What presses on a skin, one taxel after the other: wrench, contacts as sets of rows with force and mean place.

    ``forces`` are those of all taxels [N], ``active`` whether each is part of a contact.
    """
    wrench, near = np.zeros(6), {i: set() for i in range(len(skin.ids))}
    for i, j in skin.pairs.tolist():
        near[i].add(j)
        near[j].add(i)
    for i in range(len(skin.ids)):
        if active[i]:
            push = -forces[i] * skin.normals[i]
            wrench += np.concatenate((push, np.cross(skin.positions[i], push)))
    contacts = {}
    for group in components(active, near):
        force = sum(forces[i] for i in group)
        contacts[group] = force, sum(forces[i] * skin.positions[i] for i in group) / force
    return wrench, contacts


def exact(points):
    """Return points as pairs of fractions, equal to the floats."""
    return [(Fraction(float(x)), Fraction(float(y))) for x, y in points]


def turn(a, b, c):
    """Return twice the area of a triangle of fractions or whole numbers, positive if it is counter-clockwise."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def hull_corners(points):
    """Return the corners of a convex hull, counter-clockwise from the leftmost."""
    places = sorted(set(points))
    if len(places) < 2:
        return places
    after = {}
    for a in places:
        for b in places:
            on_line = (c for c in places if turn(a, b, c) == 0)
            if a != b and all(turn(a, b, c) >= 0 for c in places) and all(is_between(c, a, b) for c in on_line):
                after[a] = b
    corners = [places[0]]
    while after[corners[-1]] != places[0]:
        corners.append(after[corners[-1]])
    return corners


def is_between(c, a, b):
    """Return whether a point of the line through two others is between them, or on one."""
    return min(a, b) <= c <= max(a, b)


def clipped(corners, lines):
    """What lies left of all lines, each a point and a direction, of a convex polygon of fractions; nothing is []."""
    for start, (dx, dy) in lines:
        side = [dx * (y - start[1]) - dy * (x - start[0]) for x, y in corners]
        kept = []
        for i, ((ax, ay), a) in enumerate(zip(corners, side)):
            (bx, by), b = corners[i - 1], side[i - 1]
            if a * b < 0:
                t = a / (a - b)
                kept.append((ax + t * (bx - ax), ay + t * (by - ay)))
            if a >= 0:
                kept.append((ax, ay))
        corners = kept
    return corners


def moved_lines(corners, distances):
    """The edges of a polygon of fractions, each moved to its left by a distance, to 100 bits of its length."""
    lines = []
    for i, (ax, ay) in enumerate(corners):
        bx, by = corners[(i + 1) % len(corners)]
        dx, dy = bx - ax, by - ay
        fraction = distances[i] / fraction_root(dx * dx + dy * dy)
        lines.append(((ax - fraction * dy, ay + fraction * dx), (dx, dy)))
    return lines


def fraction_root(value):
    """Return the square root of a positive fraction, to 100 bits."""
    shift = 200 + value.denominator.bit_length() - value.numerator.bit_length()
    shift += shift % 2
    whole = isqrt(int(value * Fraction(2) ** shift))
    return Fraction(whole) / Fraction(2) ** (shift // 2)


def fraction_area(corners):
    """Return the area of a polygon of fractions, by the shoelace formula."""
    return sum(a[0] * b[1] - a[1] * b[0] for a, b in zip(corners, corners[1:] + corners[:1])) / 2


def fraction_centroid(corners):
    """Centroid of a polygon of fractions, of the triangles that the origin makes with each edge."""
    pairs = list(zip(corners, corners[1:] + corners[:1]))
    crosses = [a[0] * b[1] - a[1] * b[0] for a, b in pairs]
    return tuple(sum(c * (a[k] + b[k]) for c, (a, b) in zip(crosses, pairs)) / sum(crosses) / 3 for k in (0, 1))


def is_in_convex(point, corners):
    """Return whether a point of fractions is in a convex polygon, a segment or a point of them, or on its border."""
    if len(corners) == 1:
        return point == corners[0]
    sides = [turn(a, b, point) for a, b in zip(corners, corners[1:] + corners[:1])]
    return min(sides) >= 0 and (len(corners) > 2 or is_between(point, *corners))


def nearest_in_convex(point, corners):
    """Return the nearest point of a convex polygon of fractions: itself, or the nearest on any edge."""
    if is_in_convex(point, corners):
        return point
    feet = []
    for a, b in zip(corners, corners[1:] + corners[:1]):
        dx, dy = b[0] - a[0], b[1] - a[1]
        t = ((point[0] - a[0]) * dx + (point[1] - a[1]) * dy) / (dx * dx + dy * dy) if a != b else Fraction(0)
        t = min(max(t, Fraction(0)), Fraction(1))
        feet.append((a[0] + t * dx, a[1] + t * dy))
    return min(feet, key=lambda foot: (foot[0] - point[0]) ** 2 + (foot[1] - point[1]) ** 2)


def box_distance(points, low, high):
    """Return the exact distance of points from a solid box, 0 inside."""
    away = np.maximum(np.maximum(np.asarray(low) - points, points - np.asarray(high)), 0)
    return np.linalg.norm(away, axis=-1)
