"""Check the taxels of one patch.

The arguments of a check are the patch and its members that `needs` names.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np

from ..common.arrays import Array
from ..common.findings import Finding, error, show, warning
from .parts import Part, needs
from .surface_checks import MAX_DISTANCE

# Error of the length of a normal or tangent, and cosine between them. Larger: less precise vectors pass.
UNIT_TOLERANCE = 1e-9
# Relative difference between the area of a cell and the area of its corner polygon, which is smaller on curved
# surfaces. Larger: wrong areas pass.
AREA_TOLERANCE = 0.2
# Ratio of these areas from which the unit is wrong; square centimetres give 10 000. Larger: wrong units pass.
AREA_UNIT_RATIO = 100.0
MAX_PITCH = 1.0  # [m]. Larger: a pitch in millimetres is accepted.
# Smallest and largest distances of neighbours, and of corners from the centre (0.7 for squares, 0.6 for hexagons), in
# pitches. A wider range: wrong units pass.
DISTANCE_IN_PITCHES = (0.1, 10.0)
MAX_SIGMA = 1.0  # [m]. Larger: an uncertainty in millimetres is accepted.
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


@needs("normal")
def _normals_are_unit(patch: Part, normal: Array) -> Iterator[Finding]:
    yield from _not_unit(patch, "normal", normal)


@needs("tangent")
def _tangents_are_unit(patch: Part, tangent: Array) -> Iterator[Finding]:
    yield from _not_unit(patch, "tangent", tangent)


def _not_unit(patch: Part, name: str, vectors: Array) -> Iterator[Finding]:
    length = np.linalg.norm(vectors, axis=1)
    for row in np.flatnonzero(~(np.abs(length - 1) <= UNIT_TOLERANCE)):
        message = f"has length {length[row]:.12g}; it must be a unit vector"
        yield error("not-unit", patch.at(name, row), message, vectors[row].tolist())


@needs("normal", "tangent")
def _tangents_are_perpendicular(patch: Part, normal: Array, tangent: Array) -> Iterator[Finding]:
    cosine = (normal * tangent).sum(1) / (np.linalg.norm(normal, axis=1) * np.linalg.norm(tangent, axis=1))
    for row in np.flatnonzero(np.abs(cosine) > UNIT_TOLERANCE):  # a zero vector is reported as not unit
        message = f"is not perpendicular to the normal (cosine {cosine[row]:.3g})"
        yield error("not-square", patch.at("tangent", row), message, tangent[row].tolist())


@needs("normal", "corners")
def _normals_are_outward(patch: Part, normal: Array, corners: Array) -> Iterator[Finding]:
    """Check that the corners are counter-clockwise about the normal, which points outwards."""
    for row in np.flatnonzero((_fan(corners).sum(1) * normal).sum(1) < 0):
        message = "points inwards according to the order of its corners; reverse the normal, or the corners"
        yield error("flipped-normal", patch.at("normal", row), message, normal[row].tolist())


@needs("area", "corners")
def _areas_fit_corners(patch: Part, area: Array, corners: Array) -> Iterator[Finding]:
    spanned = np.linalg.norm(_fan(corners), axis=2).sum(1)
    ratio = float(np.min(area / np.where(spanned > 0, spanned, np.inf)))
    if ratio > AREA_UNIT_RATIO:
        message = (
            f"is at least {ratio:.4g} times the area of the corners for every taxel; areas are in m^2, corners in m"
        )
        yield error("units", patch.at("area"), message)
        return
    for row in np.flatnonzero(~(np.abs(area - spanned) <= AREA_TOLERANCE * spanned)):
        message = f"is {area[row]:.4g} m^2, but the area of the corners is {spanned[row]:.4g} m^2"
        yield warning("area", patch.at("area", row), message, float(area[row]))


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
    if distance[row] > MAX_DISTANCE:
        message = f"is {distance[row]:.6g} m from the link frame; divide lengths by 1000 if they are in millimetres"
        yield error("units", patch.at("position", row), message, position[row].tolist())


@needs("pitch")
def _pitch_is_in_metres(patch: Part, pitch: Array) -> Iterator[Finding]:
    if pitch.max() > MAX_PITCH:
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
    row = {taxel: i for i, taxel in enumerate(ids)}
    pairs = [(i, row[other]) for i, near in enumerate(neighbours) for other in near if other in row]
    if not pairs:
        return
    a, b = np.array(pairs).T
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
    for row, column in np.argwhere(values > (MAX_SIGMA, MAX_SIGMA, MAX_ANGLE)):
        stated, pointer = float(values[row, column]), patch.at("sigma", known[row], int(column))
        if column == 2:
            yield error("units", pointer, f"is {stated:.6g} rad; an angle is at most {MAX_ANGLE:.4f} rad", stated)
        else:
            message = f"is {stated:.6g} m; divide lengths by 1000 if they are in millimetres"
            yield error("units", pointer, message, stated)


@needs("registration")
def _registration_is_in_si_units(patch: Part, registration: dict[str, Any]) -> Iterator[Finding]:
    limits = (("origin", MAX_SIGMA, "m"), ("direction", MAX_ANGLE, "rad"))
    for name, limit, unit in limits:
        if registration[name] > limit:
            message = f"is {registration[name]:.6g} {unit}; it must be at most {limit:.4g} {unit}"
            yield error("units", patch.at("registration", name), message, registration[name])
    distance = float(np.linalg.norm(np.array(registration["anchor"], float)))
    if distance > MAX_DISTANCE:
        message = f"is {distance:.6g} m from the link frame; divide lengths by 1000 if they are in millimetres"
        yield error("units", patch.at("registration", "anchor"), message, registration["anchor"])


def _fan(corners: Array) -> Array:
    """Return area vectors [m^2] of the triangles of centroid and side, for each cell, shape (n, k, 3)."""
    spokes = corners - corners.mean(axis=1, keepdims=True)
    return np.cross(spokes, np.roll(spokes, -1, axis=1)) / 2


SHAPE_CHECKS = (_columns_are_parallel, _corners_are_rectangular)
CHECKS = (
    _ports_are_neighbours,
    _normals_are_unit,
    _tangents_are_unit,
    _tangents_are_perpendicular,
    _normals_are_outward,
    _areas_fit_corners,
    _positions_are_in_metres,
    _pitch_is_in_metres,
    _corners_fit_pitch,
    _neighbours_fit_pitch,
    _sigma_is_in_si_units,
    _registration_is_in_si_units,
)
