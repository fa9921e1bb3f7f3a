# SPDX-License-Identifier: GPL-3.0-or-later
"""The taxels of a fit as an object of Blender: a face for each, with named attributes, and one of them in colours.

Geometry Nodes, the spreadsheet, materials and renders use the attributes. The force follows the timeline while the link
shows a recording.
"""

from collections.abc import Iterator
from typing import Any

import bpy
import numpy as np
from bpy.app.handlers import persistent
from mathutils import Matrix

from ...common.arrays import Array
from ...geometry.mesh.distance import closest
from ...pipeline import Calibrated
from ..overlay.layers import raised_corners
from ..overlay.scales import largest_size
from ..scene.link_meshes import link_frame
from ..scene.units import metres_per_unit
from . import replay, taxel_nodes
from .replay import known_forces
from .taxels import result_of, taxels_of

OWNER = "skin_calib_link"  # custom property of the object: its link
FIT = "skin_calib_fit"  # custom property of the object: key of the fit that its faces are of
FORCE = "force"
SIZE = 0.94  # of faces relative to their cells. Larger: narrower gaps between them
# Attributes that are heat maps, by the name of these.
OF_HEAT = {"ERROR": "error", "STRAIN": "strain", "TILT": "tilt", "UNCERTAINTY": "sigma", "FORCE": FORCE}


def add_taxel_mesh(link: bpy.types.Object, context: bpy.types.Context, heat: str) -> bpy.types.Object:
    """Return an object with a face for each taxel of the last result, in the colours of a heat map.

    One that the link has gets the new faces, and keeps its materials and modifiers.
    """
    result, taxels = result_of(link), taxels_of(link)
    thing = next(of_link(link), None)
    if thing is None:
        name = f"{link.name}_taxels"
        thing = bpy.data.objects.new(name, bpy.data.meshes.new(name))
        thing[OWNER] = link
        for group in link.users_collection:
            group.objects.link(thing)
    thing[FIT] = link.skin_calib.result.key
    thing.parent, thing.matrix_parent_inverse = link, link.matrix_world.inverted_safe()
    thing.matrix_basis = link_frame(link) @ Matrix.Scale(1 / metres_per_unit(context.scene), 4)
    _write_faces(thing.data, taxels.corners)
    values = {
        "channel": taxels.channels,
        "error": 1e3 * errors_of(result),
        "strain": 1e2 * taxels.stretch,
        "sigma": 1e3 * taxels.sigma[:, 0],
        "tilt": np.rad2deg(taxels.tilt),
        FORCE: np.zeros(len(taxels.ids)),
    }
    for attribute, of_each in values.items():
        kind, number = ("INT", np.int32) if attribute == "channel" else ("FLOAT", np.float32)
        made = thing.data.attributes.new(attribute, kind, "FACE")
        made.data.foreach_set("value", of_each.astype(number))
    thing.data.update()
    follow_timeline(context.scene)
    height = np.linalg.norm(raised_corners(taxels) - taxels.corners, axis=2).max(initial=0.0)
    taxel_nodes.prepare(thing, float(height), SIZE)
    show(thing, OF_HEAT[heat])
    return thing


def show(thing: bpy.types.Object, attribute: str) -> None:
    """Show an attribute of an object with taxels, up to its largest value, or that of the recording."""
    values = np.zeros(len(thing.data.polygons), np.float32)
    thing.data.attributes[attribute].data.foreach_get("value", values)
    recording = replay.find(thing[OWNER]) if attribute == FORCE else None
    largest = (recording.strongest if recording else largest_size(values)) or 1.0
    taxel_nodes.show(thing, attribute, -largest if attribute == OF_HEAT["STRAIN"] else 0.0, largest)


def show_forces(link: bpy.types.Object) -> None:
    """Extend the scale of objects that show forces to those of the recording of their link."""
    for thing in of_link(link):
        if taxel_nodes.shown(thing) == FORCE:
            show(thing, FORCE)


def of_link(link: bpy.types.Object) -> Iterator[bpy.types.Object]:
    """Yield the objects with the taxels of a link."""
    return (thing for thing in bpy.data.objects if thing.type == "MESH" and thing.get(OWNER) == link)


def is_of_another_fit(link: bpy.types.Object) -> bool:
    """Return whether a link has an object with its taxels, which is not of its last fit."""
    thing = next(of_link(link), None)
    return thing is not None and thing.get(FIT) != link.skin_calib.result.key


def errors_of(result: Calibrated) -> Array:
    """Return the distance of the surface from the mesh below each taxel, shape (n,) [m]."""
    parts = [np.empty(0)]
    for patch in result.calibration.patches:
        feet = result.fits[patch.surface].surface.points(patch.taxels.uv)
        parts.append(closest(result.covers[patch.surface], feet)[0])
    return np.concatenate(parts)


def _write_faces(data: bpy.types.Mesh, corners: Array) -> None:
    """Replace a mesh by one face for each taxel, with its corners (n, k, 3) [m]."""
    repeated = (np.diff(corners, axis=1) == 0).all(axis=2)
    counts = corners.shape[1] - repeated.sum(axis=1)
    points = [taxel[:count] for taxel, count in zip(corners, counts)]
    ends = np.cumsum(counts)
    data.clear_geometry()
    data.from_pydata(
        np.concatenate([np.empty((0, 3)), *points]), [], [np.arange(*ab) for ab in zip(ends - counts, ends)]
    )


@persistent
def follow_timeline(scene: bpy.types.Scene, _depsgraph: Any = None) -> None:
    """Show the frame of each recording that belongs to the frame of the scene; 0 N without a recording of the fit."""
    rate = scene.render.fps / scene.render.fps_base
    seconds = (scene.frame_current_final - scene.frame_start) / rate
    for thing in scene.objects:
        link = thing.get(OWNER) if thing.type == "MESH" else None
        if link is None:
            continue
        recording, forces = replay.find(link), np.zeros(len(thing.data.polygons), np.float32)
        if recording is not None:
            at = recording.at(seconds)
            if not replay.is_playing(link):
                replay.choose(link.skin_calib.inspect.replay, at)
            if thing.get(FIT) == link.skin_calib.result.key:
                forces = known_forces(recording.frame(at)).astype(np.float32)
        force = thing.data.attributes.get(FORCE)
        if force is not None and len(force.data) == len(forces):
            before = np.empty_like(forces)
            force.data.foreach_get("value", before)
            if not np.array_equal(before, forces, equal_nan=True):  # an update makes Blender evaluate the object
                force.data.foreach_set("value", forces)
                thing.data.update()


HANDLERS = {"frame_change_pre": follow_timeline}
