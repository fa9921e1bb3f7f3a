"""Slow obvious versions of what the package does fast: one function, one face, one point at a time."""

from functools import cache

import numpy as np


def basis_function(i, degree, knots, u):
    """Cox-de Boor recursion (The NURBS Book, eq. 2.5) with 0/0 = 0; the last span holds its right end too."""
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
    """Every basis function at every parameter, one after the other."""
    count = len(knots) - degree - 1
    return np.array([[basis_function(i, degree, knots, u) for i in range(count)] for u in parameters])


def surface_point(surface, u, v):
    """The double sum of the definition, for parameters within [0, 1]."""
    point = np.zeros(3)
    for i, row in enumerate(surface.control_net):
        for j, control_point in enumerate(row):
            weight = basis_function(i, surface.degree[0], surface.knots_u, u)
            point += weight * basis_function(j, surface.degree[1], surface.knots_v, v) * control_point
    return point


def cut_triangle(corners, point, normal):
    """Ends of the segment in which a plane cuts one triangle, in no order; None where it does not.

    A corner on the plane counts as below it.
    """
    heights = [(corner - point) @ normal for corner in corners]
    ends = []
    for a, b in ((0, 1), (1, 2), (2, 0)):
        if (heights[a] > 0) != (heights[b] > 0):
            ends.append(corners[a] + heights[a] / (heights[a] - heights[b]) * (corners[b] - corners[a]))
    return np.array(ends) if ends else None


def cast_on_segments(origin, direction, segments):
    """Distance along one ray in the plane to the furthest of the segments that it meets; NaN for a miss."""
    furthest = np.nan
    for start, stop in segments:
        system = np.column_stack((direction, start - stop))
        if np.linalg.det(system) == 0:
            continue
        distance, share = np.linalg.solve(system, start - origin)
        if distance > 0 and -1e-9 <= share <= 1 + 1e-9 and not distance <= furthest:
            furthest = distance
    return furthest


def cast_on_mesh(origin, direction, triangles):
    """Distance along one ray in space to the furthest of the triangles that it meets; NaN for a miss."""
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
    """Nearest point of a segment, which may be no longer than a point."""
    along = stop - start
    share = (point - start) @ along / (along @ along) if along.any() else 0.0
    return start + min(max(share, 0.0), 1.0) * along


def nearest_on_triangle(point, corners):
    """Nearest point of one triangle: the foot on its plane if that lies inside, else the best of its three sides."""
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
    """Distance from one point to the nearest of all triangles."""
    return min(np.linalg.norm(nearest_on_triangle(point, corners) - point) for corners in triangles)


def components(active, neighbours):
    """Groups of active taxels that hang together, by flood fill; ``neighbours[i]`` are the rows beside row i."""
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
    """Offsets by which the control points of a finished fit should still move along their lines, shape (n, m).

    Dense least squares: every sample ray is cast on every triangle, and every control point has its own column. Beside
    them the root mean square of the residuals before and after that step [m].
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
            share = np.zeros((n, m))
            for j, line in enumerate(place):
                share[:, line] += N[k] * M[l, j]
            origin = np.tensordot(share, lines.origins, 2)
            arm = surface_point(surface, u[k], v[l]) - origin
            ray = arm / np.linalg.norm(arm)
            rows.append((share * (lines.directions @ ray)).ravel())
            targets.append(cast_on_mesh(origin, ray, fit.mesh.triangles) - np.linalg.norm(arm))
    rows, targets = np.array(rows), np.array(targets)
    step = np.linalg.lstsq(rows, targets, rcond=None)[0]
    return step.reshape(n, m), np.sqrt(np.mean(targets**2)), np.sqrt(np.mean((targets - rows @ step) ** 2))


def _line_of(surface, lines, column):
    """Which line the control points of a column of the net lie on."""
    gap = surface.control_net[:, column, None] - lines.origins
    off = np.linalg.norm(gap - (gap * lines.directions).sum(axis=2, keepdims=True) * lines.directions, axis=2)
    side = (gap * lines.directions).sum(axis=2) < 0  # half-planes go one way only
    return int((off + side * np.linalg.norm(gap, axis=2)).max(axis=0).argmin())
