"""What must hold for the taxels of one patch."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from ..common.arrays import Array
from ..common.findings import Finding, error, show, warning
from .parts import Part, needs
from .surface_checks import MAX_DISTANCE

UNIT_TOLERANCE = 1e-9  # a normal's length may be off by this, and its cosine with the tangent
AREA_TOLERANCE = 0.2  # a cell bends, so that its corners span less than its area; more than this is a mistake
AREA_UNIT_RATIO = 100.0  # times an area: no cell bends so, square centimetres are 10 000 times
NEIGHBOUR_DISTANCE = (0.1, 10.0)  # distance of neighbours, in pitches
MAX_PITCH = 1.0  # [m]
CORNER_DISTANCE = (0.1, 10.0)  # distance of the corners from the centre, in pitches: 0.7 for squares, 0.6 for hexagons


def columns_are_parallel(patch: Part) -> Iterator[Finding]:
    """As many rows in each column as there are ids, or as in the first column where the ids are unsound."""
    names = sorted(patch.columns, key=lambda name: name != "id")
    for name in names[1:]:
        rows, wanted = len(patch.members[name]), len(patch.members[names[0]])
        if rows != wanted:
            yield error("length", patch.at(name), f"holds {rows} taxels, '{names[0]}' {wanted}", patch.members[name])


@needs("corners")
def corners_are_rectangular(patch: Part, corners: list[Any]) -> Iterator[Finding]:
    for row, polygon in enumerate(corners):
        if len(polygon) != len(corners[0]):
            message = f"has {len(polygon)} corners, the first cell {len(corners[0])}"
            yield error("length", patch.at("corners", row), message, polygon)


@needs("normal")
def normals_are_unit(patch: Part, normal: Array) -> Iterator[Finding]:
    yield from _not_unit(patch, "normal", normal)


@needs("tangent")
def tangents_are_unit(patch: Part, tangent: Array) -> Iterator[Finding]:
    yield from _not_unit(patch, "tangent", tangent)


def _not_unit(patch: Part, name: str, vectors: Array) -> Iterator[Finding]:
    length = np.linalg.norm(vectors, axis=1)
    for row in np.flatnonzero(~(np.abs(length - 1) <= UNIT_TOLERANCE)):
        message = f"has length {length[row]:.12g}; a unit vector is needed"
        yield error("not-unit", patch.at(name, row), message, vectors[row].tolist())


@needs("normal", "tangent")
def tangents_are_perpendicular(patch: Part, normal: Array, tangent: Array) -> Iterator[Finding]:
    cosine = (normal * tangent).sum(1) / (np.linalg.norm(normal, axis=1) * np.linalg.norm(tangent, axis=1))
    for row in np.flatnonzero(np.abs(cosine) > UNIT_TOLERANCE):  # a zero vector is reported as not unit
        message = f"is not at a right angle to the normal (cosine {cosine[row]:.3g})"
        yield error("not-square", patch.at("tangent", row), message, tangent[row].tolist())


@needs("normal", "corners")
def normals_are_outward(patch: Part, normal: Array, corners: Array) -> Iterator[Finding]:
    """The corners run counter-clockwise seen from outside: a normal against them is flipped, or they are."""
    for row in np.flatnonzero((_fan(corners).sum(1) * normal).sum(1) < 0):
        message = "points inwards, as its corners run; flip the normal, or reverse the corners"
        yield error("flipped-normal", patch.at("normal", row), message, normal[row].tolist())


@needs("area", "corners")
def areas_fit_corners(patch: Part, area: Array, corners: Array) -> Iterator[Finding]:
    spanned = np.linalg.norm(_fan(corners), axis=2).sum(1)
    ratio = float(np.min(area / np.where(spanned > 0, spanned, np.inf)))
    if ratio > AREA_UNIT_RATIO:
        message = (
            f"is everywhere {ratio:.4g} times or more what the corners span; it must be in m^2, as corners are in m"
        )
        yield error("units", patch.at("area"), message)
        return
    for row in np.flatnonzero(~(np.abs(area - spanned) <= AREA_TOLERANCE * spanned)):
        message = f"is {area[row]:.4g} m^2, but the corners span {spanned[row]:.4g} m^2"
        yield warning("area", patch.at("area", row), message, float(area[row]))


@needs("ports", "neighbours")
def ports_are_neighbours(patch: Part, ports: list[Any], neighbours: list[Any]) -> Iterator[Finding]:
    for row, (sides, near) in enumerate(zip(ports, neighbours)):
        for side, other in enumerate(sides):
            if other is not None and other not in near:
                message = f"is {show(other)}, which is not among the neighbours of the taxel"
                yield error("unknown-neighbour", patch.at("ports", row, side), message, other)


@needs("position")
def positions_are_in_metres(patch: Part, position: Array) -> Iterator[Finding]:
    distance = np.linalg.norm(position, axis=1)
    row = int(np.argmax(distance))
    if distance[row] > MAX_DISTANCE:
        message = f"is {distance[row]:.6g} m from the link frame; divide lengths by 1000 if these are millimetres"
        yield error("units", patch.at("position", row), message, position[row].tolist())


@needs("pitch")
def pitch_is_in_metres(patch: Part, pitch: Array) -> Iterator[Finding]:
    if pitch.max() > MAX_PITCH:
        message = f"reaches {pitch.max():.6g} m; divide by 1000 if these are millimetres"
        yield error("units", patch.at("pitch"), message, pitch.tolist())


@needs("pitch", "position", "corners")
def corners_fit_pitch(patch: Part, pitch: Array, position: Array, corners: Array) -> Iterator[Finding]:
    distance = float(np.median(np.linalg.norm(corners - position[:, None], axis=2)))
    low, high = CORNER_DISTANCE
    if not low * pitch.min() <= distance <= high * pitch.max():
        message = f"lie {distance:.4g} m from their taxels, the pitch is {pitch.max():.4g} m; one has another unit"
        yield error("units", patch.at("corners"), message)


@needs("id", "neighbours", "position", "pitch")
def neighbours_fit_pitch(
    patch: Part, ids: list[str], neighbours: list[Any], position: Array, pitch: Array
) -> Iterator[Finding]:
    """The cells near a taxel are about a pitch away; those of other patches are left out."""
    row = {taxel: i for i, taxel in enumerate(ids)}
    pairs = [(i, row[other]) for i, near in enumerate(neighbours) for other in near if other in row]
    if not pairs:
        return
    a, b = np.array(pairs).T
    apart = float(np.median(np.linalg.norm(position[a] - position[b], axis=1)))
    low, high = NEIGHBOUR_DISTANCE
    if not low * pitch.min() <= apart <= high * pitch.max():
        message = f"lie {apart:.4g} m from their neighbours, the pitch is {pitch.max():.4g} m; one has another unit"
        yield error("units", patch.at("position"), message)


def _fan(corners: Array) -> Array:
    """Area vectors of the triangles from each cell's centroid to its sides, shape (n, k, 3)."""
    spokes = corners - corners.mean(axis=1, keepdims=True)
    return np.cross(spokes, np.roll(spokes, -1, axis=1)) / 2


SHAPE_CHECKS = (columns_are_parallel, corners_are_rectangular)
CHECKS = (
    ports_are_neighbours,
    normals_are_unit,
    tangents_are_unit,
    tangents_are_perpendicular,
    normals_are_outward,
    areas_fit_corners,
    positions_are_in_metres,
    pitch_is_in_metres,
    corners_fit_pitch,
    neighbours_fit_pitch,
)
