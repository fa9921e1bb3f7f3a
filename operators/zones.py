# SPDX-License-Identifier: GPL-3.0-or-later
"""Faces without skin: those that are selected in Edit Mode, or those of the active vertex group."""

from dataclasses import replace

import bpy
import numpy as np

from ..skin_calib_addon.blender.overlay import drawing
from ..skin_calib_addon.blender.scene import link_meshes, skins
from ..skin_calib_addon.blender.scene.skins import entry
from ..skin_calib_addon.blender.scene.units import metres_per_unit
from ..skin_calib_addon.common.errors import InvalidMesh, SkinCalibError, counted
from ..skin_calib_addon.skin.single_taxels import short_id
from ..skin_calib_addon.skin.zones import discs_over, taxels_over
from .lists import OnSkin
from .on_link import Edit

MIN_WEIGHT = 0.5  # [1] of each vertex of a face that belongs to the group. Larger: fewer faces


class SKIN_OT_zones_from_faces(OnSkin, Edit, bpy.types.Operator):
    bl_idname = "skin_calib.zones_from_faces"
    bl_label = "Exclude Faces"
    bl_description = (
        "Keep the skin away from the faces selected in Edit Mode, or from those of the active vertex group. Boards get "
        "excluded zones; taxels of a sheet or of a file are disabled"
    )

    radius: bpy.props.FloatProperty(
        name="Largest Radius [mm]",
        description="Of one zone of boards. Larger: fewer zones, which protrude more over the faces",
        default=10.0,
        min=1.0,
        max=1000.0,
    )

    def edit(self, context, plan):
        link, skin = context.object, entry(plan.skins, self.skin, "skin")
        if link.mode == "EDIT":
            link.update_from_editmode()
        chosen = selected(link) if link.mode == "EDIT" else grouped(link)
        triangles = triangles_of(link, context, chosen)
        if skin.kind != "hexagons":
            self.disable(link, skin, triangles)
            return
        metre = metres_per_unit(context.scene)
        discs = discs_over(triangles, self.radius * 1e-3)
        for point, radius in discs:
            zone = skin.excluded.add()
            zone.point, zone.radius = point / metre, radius / metre
        self.report({"INFO"}, f"{skin.name}: {counted(len(discs), 'zone')} for {counted(int(chosen.sum()), 'face')}")

    def disable(self, link, skin, triangles):
        """Disable the taxels of the last fit whose cells are over faces."""
        patches = drawing.patches_of(link)
        if len(patches) != len(link.skin_calib.skins):
            raise SkinCalibError("Fit the link first, to see its taxels.")
        patch = patches[self.skin]
        over = np.flatnonzero(taxels_over(triangles, patch.taxels))
        for i in over:
            skins.single_taxel(skin, short_id(patch, patch.taxels.ids[i])).enabled = False
        self.report({"INFO"}, f"{skin.name}: {counted(len(over), 'taxel')} disabled")


def selected(link):
    """Return which faces are selected, shape (f,); an error if none is."""
    chosen = np.zeros(len(link.data.polygons), bool)
    link.data.polygons.foreach_get("select", chosen)
    if not chosen.any():
        raise InvalidMesh(f"No face of {link.name} is selected. Select the faces without skin.")
    return chosen


def grouped(link):
    """Return which faces have all vertices in the active vertex group, shape (f,); an error if none has."""
    group = link.vertex_groups.active
    if group is None:
        raise InvalidMesh(f"{link.name} has no vertex group. Select faces in Edit Mode, or add a vertex group.")
    inside = np.zeros(len(link.data.vertices), bool)
    for vertex in link.data.vertices:
        inside[vertex.index] = any(g.group == group.index and g.weight >= MIN_WEIGHT for g in vertex.groups)
    chosen = np.array([inside[list(face.vertices)].all() for face in link.data.polygons], bool)
    if not chosen.any():
        raise InvalidMesh(f"The vertex group {group.name} of {link.name} has no complete face. Add vertices to it.")
    return chosen


def triangles_of(link, context, chosen):
    """Return the triangles of some faces of the mesh without modifiers, shape (t, 3, 3) [m], link frame."""
    data = link.data
    data.calc_loop_triangles()
    corners, owners = np.empty(3 * len(data.loop_triangles), np.int32), np.empty(len(data.loop_triangles), np.int32)
    data.loop_triangles.foreach_get("vertices", corners)
    data.loop_triangles.foreach_get("polygon_index", owners)
    vertices = np.empty(3 * len(data.vertices), np.float32)
    data.vertices.foreach_get("co", vertices)
    placed = replace(link_meshes.read_facets(link, context), vertices=vertices.reshape(-1, 3))
    return placed.triangles()[0][corners.reshape(-1, 3)[chosen[owners]]]


CLASSES = (SKIN_OT_zones_from_faces,)
