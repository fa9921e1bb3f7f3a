# SPDX-License-Identifier: GPL-3.0-or-later
"""Zones of a robot that all proposals leave free: add them to the scene, and write those of the scene to their file."""

import os

from ..skin_calib_addon.blender.scene import robots
from ..skin_calib_addon.blender.scene.link_meshes import link_frame
from ..skin_calib_addon.blender.scene.points_on_link import cursor_on
from ..skin_calib_addon.blender.scene.units import metres_per_unit
from ..skin_calib_addon.blender.scene.zones import read_zones, show_zones, zone_around
from ..skin_calib_addon.common.errors import InvalidPlan, counted
from ..skin_calib_addon.robot.zones import LinkZone, load_zones, save_zones, zones_file
from .base import Operator, no_link

RADIUS = 15e-3  # [m] of a zone at the 3D cursor, before the author scales it. Larger: more is free


def no_robot(context):
    """Return why the robot of the active link has no zones in the scene."""
    settings = context.object.skin_calib
    if not settings.urdf:
        return "Import a robot first: this link is alone"
    return "" if settings.zones_shown else "Import the robot again: this scene does not show its zones"


class SKIN_OT_keep_free(Operator):
    """Add a zone that proposals leave free: around each other selected object, or a ball at the 3D cursor"""

    bl_label = "Keep Free"
    blocked_by = (no_link, no_robot)

    def act(self, context):
        link, metre = context.object, metres_per_unit(context.scene)
        name, to_frame = link.skin_calib.link, link_frame(link).inverted()
        others = (o for o in context.selected_objects if o != link and o.type != "EMPTY" and not o.skin_calib.link)
        zones = [zone_around(thing, name, to_frame, metre) for thing in others]
        if not zones:
            center = [x * metre for x in cursor_on(link, context.scene)]
            zones = [LinkZone(name, f"{name}_zone", "sphere", {"center": center, "radius": RADIUS})]
        show_zones(context.scene, link.skin_calib.urdf, {name: link.parent}, zones)
        self.report({"INFO"}, f"{name}: {counted(len(zones), 'zone')} more. Move and scale it, then press Save Zones")


class SKIN_OT_zones_save(Operator):
    """Write the zones of the robot of the active link to their file, which all proposals respect"""

    bl_label = "Save Zones"
    bl_options = {"REGISTER"}
    blocked_by = (no_link, no_robot)

    def act(self, context):
        urdf = robots.urdf_of(context.object)
        zones, file = read_zones(context.scene, context.object.skin_calib.urdf), zones_file(urdf)
        names = {(zone.link, zone.name) for zone in zones}
        removed = [f"{zone.name} of {zone.link}" for zone in load_zones(urdf) if (zone.link, zone.name) not in names]
        if not zones and not os.path.lexists(file):
            raise InvalidPlan("The scene has no zones. Press Keep Free first.")
        save_zones(urdf, zones)
        lost = f". Removed: {', '.join(removed)}" if removed else ""
        self.report({"INFO"}, f"Wrote {counted(len(zones), 'zone')} to {file.name}{lost}")
