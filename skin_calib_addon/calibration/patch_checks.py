"""Check the taxels of one patch.

The arguments of a check are the patch and its members that `needs` names.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np

from ..common.arrays import Array, is_covariance
from ..common.findings import Finding, error, show, warning
from .model import MIN_TAXEL_DISTANCE, fan_areas, neighbour_rows
from .parts import Part, needs
from .surface_checks import MAX_LINK_DISTANCE

# Rounding of unit vectors and of right angles in single precision, which reading removes. Larger: wrong vectors pass.
SINGLE_ROUNDING = 1e-6
# Relative difference between the area of a cell and the area of its outline, by the kind of the patch. The cells of a
# sheet bend with the surface; at a sharp edge their outlines are up to 8 % smaller. Others are flat. Larger: wrong
# areas pass.
AREA_TOLERANCES = {"sheet": 0.1, "hexagons": 0.02, "imported": 0.02}
# Direction along which taxels are sorted to find near ones; oblique, because taxels are often on planes and lines.
SORTING_DIRECTION = np.array((0.36, 0.48, 0.8))
# Doubled area of the triangle of a side and a corner, relative to the square of the size of the cell, up to which the
# corner is on the side. Larger: narrow crossings pass.
CROSSING_TOLERANCE = 1e-9
# Cosine of the angle between the direction to the next taxel and the direction that the tangent gives for it, below
# which the tangent is wrong; a mirrored board has -0.5. Larger: bent cells have findings.
MIN_LATTICE_COSINE = -0.25
# Ratio of these areas from which the unit is wrong; square centimetres give 10 000. Larger: wrong units pass.
AREA_UNIT_RATIO = 100.0
MAX_LENGTH = 1.0  # [m] of a pitch or an uncertainty. Larger: one in millimetres is accepted.
# Smallest and largest distances of neighbours, and of corners from the centre (0.7 for squares, 0.6 for hexagons), in
# pitches. A wider range: wrong units pass.
DISTANCE_IN_PITCHES = (0.1, 10.0)
MAX_ANGLE = np.pi  # [rad] between two directions


def _columns_are_parallel(patch: Part) -> Iterator[Finding]:
    """Check that all columns have as many rows as the ids (or as the first column, if the ids are invalid)."""
    names = sorted(patch.columns, key=lambda name: name != "id")
    for name in names[1:]:
        rows, wanted = len(patch.members[name]), len(patch.members[names[0]])
        if rows != wanted:
            yield error(
                "length", patch.at(name), f"contains {rows} taxels, but '{names[0]}' has {wanted}", patch.members[name]
            )


@needs("corners")
def _corners_are_rectangular(patch: Part, corners: list[Any]) -> Iterator[Finding]:
    for row, polygon in enumerate(corners):
        if len(polygon) != len(corners[0]):
            message = f"has {len(polygon)} corners, but the first cell has {len(corners[0])}"
            yield error("length", patch.at("corners", row), message, polygon)


def _vectors_are_unit(patch: Part) -> Iterator[Finding]:
    for name in ("normal", "tangent"):
        vectors = patch.members.get(name, np.zeros((0, 3)))
        length = np.linalg.norm(vectors, axis=1)
        for row in np.flatnonzero(~(np.abs(length - 1) <= SINGLE_ROUNDING)):
            message = f"has length {length[row]:.12g}; it must be a unit vector"
            yield error("not-unit", patch.at(name, row), message, vectors[row].tolist())


@needs("normal", "tangent")
def _tangents_are_perpendicular(patch: Part, normal: Array, tangent: Array) -> Iterator[Finding]:
    cosine = (normal * tangent).sum(1) / (np.linalg.norm(normal, axis=1) * np.linalg.norm(tangent, axis=1))
    for row in np.flatnonzero(np.abs(cosine) > SINGLE_ROUNDING):  # a zero vector is reported as not unit
        message = f"is not perpendicular to the normal (cosine {cosine[row]:.3g})"
        yield error("not-square", patch.at("tangent", row), message, tangent[row].tolist())


@needs("normal", "corners")
def _normals_are_outward(patch: Part, normal: Array, corners: Array) -> Iterator[Finding]:
    """Check that the corners are counter-clockwise about the normal, which points outwards."""
    for row in np.flatnonzero((_fan(corners).sum(1) * normal).sum(1) < 0):
        message = "points inwards according to the order of its corners; reverse the normal, or the corners"
        yield error("flipped-normal", patch.at("normal", row), message, normal[row].tolist())


@needs("normal", "corners")
def _outlines_do_not_cross(patch: Part, normal: Array, corners: Array) -> Iterator[Finding]:
    """Check that no two sides of a cell cross, as in a bow-tie."""
    seen = _seen_along(normal, corners)
    allowed = CROSSING_TOLERANCE * np.ptp(seen, axis=1).max(axis=1) ** 2
    following, count = np.roll(seen, -1, axis=1), seen.shape[1]
    crossing = np.zeros(len(seen), bool)
    for i in range(count - 2):
        a, b = seen[:, i, None], following[:, i, None]
        others = slice(i + 2, count - (i == 0))  # without the adjacent sides
        c, d = seen[:, others], following[:, others]
        limit = allowed[:, None]
        sides = [_turn(a, b, c), _turn(a, b, d), _turn(c, d, a), _turn(c, d, b)]
        left, right = [s > limit for s in sides], [s < -limit for s in sides]
        apart = [left[k] & right[k + 1] | right[k] & left[k + 1] for k in (0, 2)]
        crossing |= (apart[0] & apart[1]).any(axis=1)
    for row in np.flatnonzero(crossing):
        message = "cross each other: two sides of the outline intersect; order the corners counter-clockwise"
        yield error("crossing-outline", patch.at("corners", row), message, corners[row].tolist())


@needs("kind", "position", "area", "corners")
def _areas_fit_corners(patch: Part, kind: str, position: Array, area: Array, corners: Array) -> Iterator[Finding]:
    """Compare each area with that of the triangles of position and sides, which follow a cell that bends."""
    spanned = fan_areas(position, corners)
    ratio = float(np.min(area / np.where(spanned > 0, spanned, np.inf)))
    if ratio > AREA_UNIT_RATIO:
        message = (
            f"is at least {ratio:.4g} times the area of the corners for every taxel; areas are in m^2, corners in m"
        )
        yield error("units", patch.at("area"), message)
        return
    for row in np.flatnonzero(~(np.abs(area - spanned) <= AREA_TOLERANCES[kind] * spanned)):
        message = f"is {area[row]:.4g} m^2, but the area of the corners is {spanned[row]:.4g} m^2"
        yield warning("area", patch.at("area", row), message, float(area[row]))


@needs("kind", "index", "id", "neighbours", "position", "normal", "tangent")
def _tangents_follow_the_lattice(
    patch: Part,
    kind: str,
    index: list[list[int]],
    ids: list[str],
    neighbours: list[Any],
    position: Array,
    normal: Array,
    tangent: Array,
) -> Iterator[Finding]:
    """Check that tangent and normal are neither reversed nor mirrored: they give the directions to adjacent taxels.

    With the normal n and the tangent t, the next taxel of the row is along t. The next row of a sheet is along n x t,
    or against it in all taxels of a left-handed sheet. A board (q, r) is along q t + r (t + sqrt(3) n x t) / 2.
    """
    if kind == "imported":
        return
    pairs = neighbour_rows(ids, neighbours)
    index_array = np.array(index, int)
    step = index_array[pairs[:, 1]] - index_array[pairs[:, 0]]
    if kind == "sheet":
        is_next = np.abs(step).sum(axis=1) == 1
    else:
        is_next = (np.abs(step).max(axis=1) == 1) & (step[:, 0] != step[:, 1])
    (a, b), step = pairs[is_next].T, step[is_next]
    arm = position[b] - position[a]
    ahead, aside = (arm * tangent[a]).sum(axis=1), (arm * np.cross(normal[a], tangent[a])).sum(axis=1)
    if kind == "sheet":
        across = step[:, 0] * aside
        hand = -1.0 if (across < 0).sum() > (across > 0).sum() else 1.0
        wanted = np.column_stack((step[:, 1], hand * step[:, 0]))
    else:
        wanted = np.column_stack((step[:, 0] + step[:, 1] / 2, np.sqrt(0.75) * step[:, 1]))
    wrong = ahead * wanted[:, 0] + aside * wanted[:, 1] < MIN_LATTICE_COSINE * np.linalg.norm(arm, axis=1)
    _, first_pairs = np.unique(a[wrong], return_index=True)
    for pair in np.flatnonzero(wrong)[first_pairs]:
        taxel, other = a[pair], ids[b[pair]]
        message = (
            f"contradicts the index: with the normal it gives another direction to {show(other)}; the frame is mirrored"
        )
        yield warning("mirrored-tangent", patch.at("tangent", taxel), message, tangent[taxel].tolist())


@needs("ports", "neighbours")
def _ports_are_neighbours(patch: Part, ports: list[Any], neighbours: list[Any]) -> Iterator[Finding]:
    for row, (sides, near) in enumerate(zip(ports, neighbours)):
        for side, other in enumerate(sides):
            if other is not None and other not in near:
                message = f"is {show(other)}, which is not a neighbour of the taxel"
                yield error("unknown-neighbour", patch.at("ports", row, side), message, other)


@needs("position")
def _positions_are_in_metres(patch: Part, position: Array) -> Iterator[Finding]:
    distance = np.linalg.norm(position, axis=1)
    row = int(np.argmax(distance))
    if distance[row] > MAX_LINK_DISTANCE:
        message = f"is {distance[row]:.6g} m from the link frame; divide lengths by 1000 if they are in millimetres"
        yield error("units", patch.at("position", row), message, position[row].tolist())


@needs("pitch")
def _pitch_is_in_metres(patch: Part, pitch: Array) -> Iterator[Finding]:
    if pitch.max() > MAX_LENGTH:
        message = f"is {pitch.max():.6g} m; divide lengths by 1000 if they are in millimetres"
        yield error("units", patch.at("pitch"), message, pitch.tolist())


@needs("pitch", "position", "corners")
def _corners_fit_pitch(patch: Part, pitch: Array, position: Array, corners: Array) -> Iterator[Finding]:
    distance = float(np.median(np.linalg.norm(corners - position[:, None], axis=2)))
    low, high = DISTANCE_IN_PITCHES
    if not low * pitch.min() <= distance <= high * pitch.max():
        message = f"are {distance:.4g} m from their taxels, but the pitch is {pitch.max():.4g} m; their units differ"
        yield error("units", patch.at("corners"), message)


@needs("id", "neighbours", "position", "pitch")
def _neighbours_fit_pitch(
    patch: Part, ids: list[str], neighbours: list[Any], position: Array, pitch: Array
) -> Iterator[Finding]:
    """Check that the distance of neighbours is about a pitch; neighbours in other patches are ignored."""
    a, b = neighbour_rows(ids, neighbours).T
    if not len(a):
        return
    distance = float(np.median(np.linalg.norm(position[a] - position[b], axis=1)))
    low, high = DISTANCE_IN_PITCHES
    if not low * pitch.min() <= distance <= high * pitch.max():
        message = (
            f"are {distance:.4g} m from their neighbours, but the pitch is {pitch.max():.4g} m; their units differ"
        )
        yield error("units", patch.at("position"), message)


@needs("sigma")
def _sigma_is_in_si_units(patch: Part, sigma: list[list[float] | None]) -> Iterator[Finding]:
    known = [row for row, values in enumerate(sigma) if values is not None]
    values = np.array([sigma[row] for row in known], float).reshape(-1, 3)
    for row, column in np.argwhere(values > (MAX_LENGTH, MAX_LENGTH, MAX_ANGLE)):
        stated, pointer = float(values[row, column]), patch.at("sigma", known[row], int(column))
        if column == 2:
            yield error("units", pointer, f"is {stated:.6g} rad; an angle is at most {MAX_ANGLE:.4f} rad", stated)
        else:
            message = f"is {stated:.6g} m; divide lengths by 1000 if they are in millimetres"
            yield error("units", pointer, message, stated)


@needs("registration")
def _registration_is_in_si_units(patch: Part, registration: dict[str, Any]) -> Iterator[Finding]:
    limits = (("origin", MAX_LENGTH, "m"), ("direction", MAX_ANGLE, "rad"))
    for name, limit, unit in limits:
        if registration[name] > limit:
            message = f"is {registration[name]:.6g} {unit}; it must be at most {limit:.4g} {unit}"
            yield error("units", patch.at("registration", name), message, registration[name])
    distance = float(np.linalg.norm(np.array(registration["anchor"], float)))
    if distance > MAX_LINK_DISTANCE:
        message = f"is {distance:.6g} m from the link frame; divide lengths by 1000 if they are in millimetres"
        yield error("units", patch.at("registration", "anchor"), message, registration["anchor"])


@needs("touches")
def _touches_have_a_covariance(patch: Part, touches: dict[str, Any]) -> Iterator[Finding]:
    covariance = touches["covariance"]
    if not is_covariance(np.array(covariance, float)):
        message = "is no covariance: it is not symmetric, or a direction has a negative variance"
        yield error("covariance", patch.at("touches", "covariance"), message, covariance)


def taxels_are_apart(patches: list[Part]) -> Iterator[Finding]:
    """Check that no two taxels of a link are in one place. Those that look away from each other are on a thin wall."""
    valid = [patch for patch in patches if patch.members.keys() >= {"position", "normal", "pitch", "id"}]
    if not valid:
        return
    where = [(patch, row) for patch in valid for row in range(len(patch.members["position"]))]
    position, normal = (np.concatenate([patch.members[name] for patch in valid]) for name in ("position", "normal"))
    pitch = np.repeat([patch.members["pitch"].min() for patch in valid], [len(p.members["position"]) for p in valid])
    along = position @ SORTING_DIRECTION
    order = np.argsort(along, kind="stable")
    along, largest = along[order], MIN_TAXEL_DISTANCE * float(pitch.max())
    for ahead in range(1, len(order)):
        near = np.flatnonzero(along[ahead:] - along[:-ahead] < largest)
        if not len(near):
            return
        a, b = order[near], order[near + ahead]
        distance = np.linalg.norm(position[a] - position[b], axis=1)
        on_one_side = (normal[a] * normal[b]).sum(axis=1) >= 0
        for pair in np.flatnonzero(on_one_side & (distance < MIN_TAXEL_DISTANCE * np.minimum(pitch[a], pitch[b]))):
            (first_patch, first_row), (patch, row) = (where[i] for i in sorted((a[pair], b[pair])))
            other = first_patch.members["id"][first_row]
            message = f"is {distance[pair] * 1e3:.3g} mm from taxel {show(other)}: two taxels are in one place"
            yield warning(
                "duplicate-position", patch.at("position", row), message, patch.members["position"][row].tolist()
            )


def _seen_along(normal: Array, corners: Array) -> Array:
    """Return the corners (n, k, 2) in the plane perpendicular to each normal, counter-clockwise seen from outside."""
    least = np.eye(3)[np.abs(normal).argmin(axis=1)]
    right = np.cross(least, normal)
    up = np.cross(normal, right)
    return np.stack([(corners * axis[:, None]).sum(axis=2) for axis in (right, up)], axis=2)


def _turn(a: Array, b: Array, c: Array) -> Array:
    """Return the doubled signed area of triangles of plane points (..., 2), positive if counter-clockwise."""
    ab, ac = b - a, c - a
    return ab[..., 0] * ac[..., 1] - ab[..., 1] * ac[..., 0]


def _fan(corners: Array) -> Array:
    """Return area vectors [m^2] of the triangles of centroid and side, for each cell, shape (n, k, 3)."""
    spokes = corners - corners.mean(axis=1, keepdims=True)
    return np.cross(spokes, np.roll(spokes, -1, axis=1)) / 2


SHAPE_CHECKS = (_columns_are_parallel, _corners_are_rectangular)
CHECKS = (
    _ports_are_neighbours,
    _vectors_are_unit,
    _tangents_are_perpendicular,
    _tangents_follow_the_lattice,
    _normals_are_outward,
    _outlines_do_not_cross,
    _areas_fit_corners,
    _positions_are_in_metres,
    _pitch_is_in_metres,
    _corners_fit_pitch,
    _neighbours_fit_pitch,
    _sigma_is_in_si_units,
    _registration_is_in_si_units,
    _touches_have_a_covariance,
)
