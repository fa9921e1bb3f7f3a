# SPDX-License-Identifier: GPL-3.0-or-later
"""The axis of the grid; planes one by one: from a grid to a list of planes, and operations on that list."""

import bpy
import numpy as np

from ..skin_calib_addon.blender.scene import link_meshes, plane_lists, plans, points_on_link
from ..skin_calib_addon.blender.scene.skins import entry
from ..skin_calib_addon.blender.scene.units import in_units, metres_per_unit, vector
from ..skin_calib_addon.common.errors import SkinCalibError
from ..skin_calib_addon.geometry import PlanesGrid, cut_cover
from ..skin_calib_addon.geometry.fit.auto import grid_lines
from ..skin_calib_addon.geometry.grid.axis import axis_through
from ..skin_calib_addon.geometry.grid.plane_editing import between, mirrored, planes_of, spread, through
from .base import INDEX, Edit, Operator, no_link, no_mesh
from .picking import POINT, Picking

FAMILIES = [("u", "U-Planes", "Planes across the link"), ("v", "V-Planes", "Planes along the link")]
FAMILY = {"name": "Planes", "description": "Which planes", "options": {"HIDDEN"}}


def place_by_hand(context):
    """Replace the grid of the active link by its planes one by one; those that are by hand already stay."""
    link = context.object
    read = plans.shown_surface(link, context.scene)
    if isinstance(read.grid, PlanesGrid):
        return
    cover = cut_cover(link_meshes.read_mesh(link, context), read.cover)
    if read.grid.region.boundary:
        raise SkinCalibError("Planes placed by hand cannot have a boundary. Remove the boundary first.")
    lines = grid_lines(cover, read.grid, read.degree, read.max_deviation)
    grid = PlanesGrid(*planes_of(lines), lines.closed)
    grid.line_grid(cover)  # refuses what a fit would refuse, and the old grid stays
    plans.write_grid(link.skin_calib.grid, grid, metres_per_unit(context.scene))
    link.skin_calib.held = "U"


def has_planes(context):
    """Return that the planes are placed by hand already."""
    return "The planes are placed by hand already" if context.object.skin_calib.grid.kind == "planes" else ""


def no_planes(context):
    """Return that the planes are not placed by hand."""
    return "" if has_planes(context) else "Place the planes by hand first"


class SKIN_OT_planes_place(Edit, Operator):
    """Replace the grid by its planes one by one, to move, tilt, add and remove them by hand"""

    bl_label = "Place by Hand"
    blocked_by = (no_link, has_planes)

    def edit(self, context, plan):
        place_by_hand(context)


class SKIN_OT_boundary_remove(Edit, Operator):
    """Remove the boundary of the grid, so that the surface covers the whole region"""

    bl_label = "Remove Boundary"

    def edit(self, context, plan):
        plan.grid.boundary = ""


class OnPlanes(Edit):
    """Works on the u-planes or the v-planes."""

    blocked_by = (no_mesh, no_planes)
    family: bpy.props.EnumProperty(items=FAMILIES, **FAMILY)

    def edit(self, context, plan):
        planes = plane_lists.read_planes(plan.grid, self.family, context.scene)
        if planes is None:
            raise SkinCalibError(f"There are no {self.family}-planes yet. Add one.")
        plane_lists.write_planes(plan.grid, self.family, self.changed(planes, plan.grid), context.scene)


class SKIN_OT_plane_add(OnPlanes, Operator):
    """Add a plane midway between the selected one and the next, or beyond the last; the first at the 3D cursor"""

    bl_label = "Add Plane"

    def edit(self, context, plan):
        grid = plan.grid
        listed, index = getattr(grid, self.family), getattr(grid, f"{self.family}_index")
        planes = plane_lists.read_planes(grid, self.family, context.scene)
        item = listed.add()
        if planes is None:
            item.point = points_on_link.cursor_on(context.object, context.scene)
            item.normal = (0, 0, 1) if self.family == "u" else (1, 0, 0)
            return
        index = min(index, len(planes) - 1)
        plane_lists.set_plane(item, *between(planes, index), context.scene)
        listed.move(len(listed) - 1, index + 1)
        setattr(grid, f"{self.family}_index", index + 1)


class SKIN_OT_plane_remove(OnPlanes, Operator):
    """Remove this plane from the list of the active link"""

    bl_label = "Remove Plane"

    index: bpy.props.IntProperty(name="Index", description="Which plane, from 0", **INDEX)

    def edit(self, context, plan):
        entry(getattr(plan.grid, self.family), self.index, f"{self.family}-plane")
        remove(plan, self.family, self.index)


def remove(plan, family, index):
    """Remove a plane from its list; the next one gets the handles."""
    listed = getattr(plan.grid, family)
    listed.remove(index)
    setattr(plan.grid, f"{family}_index", max(0, min(index, len(listed) - 1)))


class AtPoint(Picking, Edit):
    """Changes the planes at a point of the link; a grid becomes planes placed by hand first."""

    blocked_by = (no_link,)

    point: bpy.props.FloatVectorProperty(name="Point", description="Where it is, in the link frame", **POINT)

    def edit(self, context, plan):
        if plan.grid.kind != "planes":
            place_by_hand(context)
        self.change(context, plan, np.array(vector(self.point, metres_per_unit(context.scene))))


class SKIN_OT_plane_place(AtPoint, Operator):
    """Click on the link to add a plane there, between those on both sides; a grid is placed by hand first"""

    bl_label = "Add Plane on Link"

    prompts = ("Click on the link to add a plane there    Esc: no plane",)
    family: bpy.props.EnumProperty(items=FAMILIES, **FAMILY)

    def change(self, context, plan, point):
        planes = plane_lists.read_planes(plan.grid, self.family, context.scene)
        if planes is None:
            raise SkinCalibError(f"There are no {self.family}-planes yet. Add one with Add Plane.")
        index, *plane = through(planes, point, self.family == "v" and plan.grid.closed)
        listed = getattr(plan.grid, self.family)
        plane_lists.set_plane(listed.add(), *plane, context.scene)
        listed.move(len(listed) - 1, index)
        setattr(plan.grid, f"{self.family}_index", index)
        plan.held = self.family.upper()


class SKIN_OT_plane_take(AtPoint, Operator):
    """Click on the link to remove the plane that is nearest there; a grid is placed by hand first"""

    bl_label = "Remove Plane on Link"

    prompts = ("Click on the link to remove the nearest plane    Esc: no change",)

    def change(self, context, plan, point):
        found = []
        for family in ("u", "v"):
            planes = plane_lists.read_planes(plan.grid, family, context.scene)
            if planes is not None:
                distances = np.abs(((point - planes.points) * planes.normals).sum(axis=1))
                found.append((distances.min(), family, int(distances.argmin())))
        if not found:
            raise SkinCalibError("There are no planes to remove.")
        _, family, index = min(found)
        remove(plan, family, index)


class SKIN_OT_planes_spread(OnPlanes, Operator):
    """Space the planes evenly from the first to the last; v-planes of a closed grid, all round their axis"""

    bl_label = "Space Evenly"

    def changed(self, planes, grid):
        return spread(planes, self.family == "v" and grid.closed)


class SKIN_OT_planes_mirror(OnPlanes, Operator):
    """Replace the planes after the selected one by mirror images of those before it"""

    bl_label = "Mirror"

    def changed(self, planes, grid):
        return mirrored(planes, min(getattr(grid, f"{self.family}_index"), len(planes) - 1))


class SKIN_OT_axis_from_sections(Picking, Edit, Operator):
    """Click on the link twice: the axis joins the centres of the two sections there, towards the second"""

    bl_label = "Axis from Two Sections"
    blocked_by = (no_link,)

    first: bpy.props.FloatVectorProperty(name="First", description="A point of the first section", **POINT)
    second: bpy.props.FloatVectorProperty(name="Second", description="A point of the second section", **POINT)

    def edit(self, context, plan):
        link, metre = context.object, metres_per_unit(context.scene)
        cover = cut_cover(link_meshes.read_mesh(link, context), plans.shown_surface(link, context.scene).cover)
        axis = axis_through(cover, vector(self.first, metre), vector(self.second, metre))
        plan.grid.auto_axis = False
        plan.grid.point, plan.grid.direction = in_units(axis.point, metre), axis.direction

    prompts = tuple(f"Click on the {which} section of the link    Esc: keep the axis" for which in ("first", "second"))

    def take(self, points):
        self.first, self.second = points
