# SPDX-License-Identifier: GPL-3.0-or-later
"""Zones of a robot without skin, as empties below the frames of links: to see, to move and to scale.

The file of the robot is what proposals respect. An import shows its zones, and Save Zones writes those of the scene.
"""

from collections.abc import Iterable, Mapping

import bpy
import numpy as np
from mathutils import Matrix, Vector

from ...common.arrays import Array
from ...common.errors import InvalidPlan
from ...robot.zones import LinkZone
from .units import metres_per_unit

SHAPES = {"sphere": "SPHERE", "box": "CUBE", "half-space": "SINGLE_ARROW"}  # how an empty is drawn
ARROW_LENGTH = 0.05  # [m] of a half-space, as it is drawn. Larger: it is easier to see
DECIMALS = 6  # of numbers [m]: Blender's are not more exact. Larger: zones differ from those that were read
# [1] difference of the scales of a sphere, or of an axis from one of the link. Larger: other zones than those in sight.
TOLERANCE = 1e-3


def show_zones(scene: bpy.types.Scene, urdf: str, frames: Mapping[str, bpy.types.Object], zones: Iterable[LinkZone]):
    """Add an empty for each zone of a robot; ``urdf`` is as the links have it."""
    metre = metres_per_unit(scene)
    for zone in zones:
        thing, numbers = bpy.data.objects.new(zone.name, None), {k: np.array(v) for k, v in zone.numbers.items()}
        thing.skin_calib.zone_of, thing.skin_calib.urdf = zone.link, urdf
        thing.empty_display_type, thing.empty_display_size = SHAPES[zone.kind], 1.0
        if zone.kind == "sphere":
            thing.location, thing.scale = numbers["center"] / metre, [numbers["radius"] / metre] * 3
        elif zone.kind == "box":
            low, high = numbers["low"] / metre, numbers["high"] / metre
            thing.location, thing.scale = (low + high) / 2, (high - low) / 2
        else:
            thing.empty_display_size = ARROW_LENGTH / metre
            turn = Vector(numbers["normal"]).to_track_quat("Z", "Y").to_matrix().to_4x4()
            thing.matrix_basis = Matrix.Translation(numbers["point"] / metre) @ turn
        thing.show_in_front, thing.parent = True, frames[zone.link]
        frames[zone.link].users_collection[0].objects.link(thing)


def read_zones(scene: bpy.types.Scene, urdf: str) -> tuple[LinkZone, ...]:
    """Return the zones of a robot in a scene; raise InvalidPlan for an empty that is none of their kinds."""
    things = (o for o in scene.objects if o.skin_calib.zone_of and o.skin_calib.urdf == urdf)
    return tuple(_zone(thing, metres_per_unit(scene)) for thing in sorted(things, key=lambda thing: thing.name))


def _zone(thing: bpy.types.Object, metre: float) -> LinkZone:
    kind = next((kind for kind, shape in SHAPES.items() if shape == thing.empty_display_type), "")
    if not kind or thing.parent is None:
        raise InvalidPlan(
            f"The zone {thing.name} is no sphere, cube or single arrow below the frame of {thing.skin_calib.zone_of}. "
            "Remove it, and press Keep Free again."
        )
    location, rotation, scale = (thing.matrix_parent_inverse @ thing.matrix_basis).decompose()
    turn, point = np.array(rotation.to_matrix()), np.array(location) * metre
    sizes = np.abs(np.array(scale)) * thing.empty_display_size * metre
    if kind == "sphere":
        if np.ptp(sizes) > TOLERANCE * sizes.max():
            raise InvalidPlan(f"The scales of the zone {thing.name} differ: it is no sphere. Make them equal.")
        numbers = {"center": _rounded(point), "radius": round(float(sizes.mean()), DECIMALS)}
    elif kind == "box":
        if np.abs(np.abs(turn) - np.rint(np.abs(turn))).max() > TOLERANCE:
            raise InvalidPlan(f"The zone {thing.name} is rotated against its link. Clear its rotation with Alt R.")
        half = np.rint(np.abs(turn)) @ sizes
        numbers = {"low": _rounded(point - half), "high": _rounded(point + half)}
    else:
        numbers = {"point": _rounded(point), "normal": _rounded(turn[:, 2])}
    return LinkZone(thing.skin_calib.zone_of, thing.name, kind, numbers)


def _rounded(vector: Array) -> list[float]:
    rounded: list[float] = (np.round(np.asarray(vector, float), DECIMALS) + 0.0).tolist()  # of single precision
    return rounded


def are_same(zones: Iterable[LinkZone], others: Iterable[LinkZone]) -> bool:
    """Return whether zones are those of a file, as exactly as Blender keeps numbers; names may differ."""
    one, other = (
        sorted(map(_place, some), key=lambda place: (*place[:2], np.round(place[2], 4).tolist()))
        for some in (zones, others)
    )
    return len(one) == len(other) and all(
        a[:2] == b[:2] and np.allclose(a[2], b[2], rtol=1e-5, atol=10 ** (1 - DECIMALS)) for a, b in zip(one, other)
    )


def _place(zone: LinkZone) -> tuple[str, str, list[float]]:
    """Return link, kind and numbers of a zone; a normal has the length one."""
    numbers = dict(zone.numbers)
    if zone.kind == "half-space":
        numbers["normal"] = np.array(numbers["normal"]) / np.linalg.norm(numbers["normal"])
    return zone.link, zone.kind, np.concatenate([np.ravel(numbers[name]) for name in sorted(numbers)]).tolist()


def zone_around(thing: bpy.types.Object, link: str, to_frame: Matrix, metre: float) -> LinkZone:
    """Return the zone of a link that is the box around an object, in the frame of the link."""
    corners = np.array([to_frame @ thing.matrix_world @ Vector(corner) for corner in thing.bound_box]) * metre
    low, high = corners.min(axis=0), corners.max(axis=0)
    high = np.maximum(high, low + 10 ** (1 - DECIMALS))  # also around a flat object
    return LinkZone(link, f"{thing.name}_zone", "box", {"low": _rounded(low), "high": _rounded(high)})
