# SPDX-License-Identifier: GPL-3.0-or-later
"""Handles in the 3D view for hand-placed planes: each plane can be moved, and the selected one can be tilted.

Handles look up their plane in each call: after an undo, a stored reference would point to other memory.
"""

from functools import partial
from typing import Any

import bpy
from mathutils import Matrix, Quaternion, Vector

from ...common.colours import SKY, VERMILLION
from ..live.sketch import COLOURS, FAMILIES
from ..scene.link_meshes import link_frame
from ..scene.link_objects import why_not
from ..scene.units import metres_per_unit
from ..session import session

DIAL_COLOURS = (VERMILLION[:3], SKY[:3])


def listed(plan: Any, family: str) -> Any:
    """Return the list of planes of a family."""
    if family == "CUT":
        return plan.cover.cuts
    return getattr(plan.grid, family.lower()) if plan.grid.kind == "planes" else ()


def chosen(plan: Any) -> tuple[str, int]:
    """Return the plane that has the handles for tilting."""
    owner, name = (plan.cover, "cut_index") if plan.held == "CUT" else (plan.grid, f"{plan.held.lower()}_index")
    return plan.held, getattr(owner, name)


def choose(plan: Any, family: str, index: int) -> None:
    """Give the handles for tilting to a plane."""
    if chosen(plan) == (family, index):
        return
    if family == "CUT":
        plan.cover.cut_index = index
    else:
        setattr(plan.grid, f"{family.lower()}_index", index)


class SKIN_GGT_planes(bpy.types.GizmoGroup):
    """Moves and tilts hand-placed planes."""

    bl_idname = "SKIN_GGT_planes"
    bl_label = "Skin Planes"
    bl_space_type = "VIEW_3D"
    bl_region_type = "WINDOW"
    bl_options = {"3D", "PERSISTENT", "SHOW_MODAL_ALL"}

    @classmethod
    def poll(cls, context):
        return is_shown(context, "PLANES") and any(listed(context.object.skin_calib, family) for family in FAMILIES)

    def setup(self, context):
        self.arrows, self.dragged, self.start = [], None, None
        self.dials = [self.add("GIZMO_GT_dial_3d", partial(self.tilt, k), DIAL_COLOURS[k]) for k in range(2)]
        self.refresh(context)

    def add(self, kind, change, colour):
        """Add a handle that measures how far it has been moved or turned since the start of the drag."""
        handle = self.gizmos.new(kind)
        handle.target_set_handler("offset", get=lambda: self.moved(handle), set=lambda value: change(handle, value))
        handle.color, handle.color_highlight = colour, (1.0, 1.0, 1.0)
        handle.alpha, handle.alpha_highlight = 0.8, 1.0
        undo_drags(handle)
        return handle

    def refresh(self, context):
        """Make as many arrows as there are planes."""
        count = sum(len(listed(context.object.skin_calib, family)) for family in FAMILIES)
        while len(self.arrows) < count:
            index = len(self.arrows)
            self.arrows.append(self.add("GIZMO_GT_arrow_3d", partial(self.move, index), (1, 1, 1)))

    def draw_prepare(self, context):
        if self.dragged is not None and not self.dragged.is_modal:
            self.end_drag()
        plan, names = context.object.skin_calib, self.names(context.object.skin_calib)
        for k, arrow in enumerate(self.arrows):
            arrow.hide = k >= len(names)
            if not arrow.hide and arrow is not self.dragged:
                self.draw_arrow(context, arrow, plan, *names[k])
        held = chosen(plan)
        for k, dial in enumerate(self.dials):
            dial.hide = held not in names
            if not dial.hide and dial is not self.dragged:
                plane = listed(plan, held[0])[held[1]]
                dial.matrix_basis = basis_at(context, Vector(plane.point), self.tilt_axes(plan, plane)[k])

    def names(self, plan):
        """Return family and index of each plane, in the order of the arrows."""
        return [(family, i) for family in FAMILIES for i in range(len(listed(plan, family)))]

    def draw_arrow(self, context, arrow, plan, family, i):
        """Place an arrow at the border of the plane's section; it is a box if the plane is not selected."""
        plane, metre = listed(plan, family)[i], metres_per_unit(context.scene)
        sketch = session.of(context.object).sketch
        arm = sketch.arms.get((family, i), (0, 0, 0)) if sketch else (0, 0, 0)
        is_wrong = sketch is not None and (family, i) in sketch.wrong
        is_chosen = chosen(plan) == (family, i)
        arrow.draw_style = "NORMAL" if is_chosen else "BOX"
        arrow.length = 0.8 if is_chosen else 0.0
        arrow.color = (VERMILLION if is_wrong else COLOURS[family])[:3]
        arrow.matrix_basis = basis_at(context, Vector(plane.point) + Vector(arm) / metre, Vector(plane.normal))

    def tilt_axes(self, plan, plane):
        """Return two axes in a plane about which it can be turned; the first axis of a v-plane is along the link."""
        normal = Vector(plane.normal).normalized()
        along = sum((Vector(u.normal) for u in plan.grid.u), Vector()) if plan.held == "V" else Vector()
        along -= along.dot(normal) * normal
        if along.length < 1e-6:
            along = normal.orthogonal()
        along.normalize()
        return along, normal.cross(along)

    def plane_of(self, plan, index):
        """Return the plane that an arrow moves, and select it."""
        family, i = self.names(plan)[index]
        choose(plan, family, i)
        return listed(plan, family)[i]

    def begin_drag(self, handle, plane, axis):
        """Store the start of a drag."""
        if self.dragged is not handle:
            self.dragged = handle
            self.start = Vector(plane.point), Vector(plane.normal), axis
            self.value = 0.0

    def moved(self, handle):
        """Return how far a handle has been dragged."""
        return self.value if self.dragged is handle else 0.0

    def move(self, index, handle, value):
        """Move a plane along its normal."""
        plane = self.plane_of(bpy.context.object.skin_calib, index)
        self.begin_drag(handle, plane, None)
        point, normal, _ = self.start
        self.value = value
        plane.point = point + value * normal.normalized()

    def tilt(self, k, handle, value):
        """Turn the selected plane about an axis through its point."""
        plan = bpy.context.object.skin_calib
        family, i = chosen(plan)
        plane = listed(plan, family)[i]
        if self.dragged is not handle:
            self.begin_drag(handle, plane, self.tilt_axes(plan, plane)[k])
        _, normal, axis = self.start
        self.value = value
        plane.normal = Quaternion(axis, value) @ normal

    def end_drag(self):
        """End a drag. Before Blender 5.2 a drag is not an undo step by itself."""
        end_drag(self.dragged)
        self.dragged = None


def is_shown(context: bpy.types.Context, layer: str) -> bool:
    """Return whether a layer of the link's overlay is drawn in this view, so that its handles are needed."""
    space = context.space_data
    if why_not(context.object) or not space.overlay.show_overlays or not context.object.visible_get(viewport=space):
        return False
    plan = context.object.skin_calib
    return plan.show_overlay and layer in plan.layers


def undo_drags(handle: bpy.types.Gizmo) -> None:
    """Draw a handle while it is dragged, and make each drag an undo step."""
    handle.use_draw_modal = True
    if hasattr(handle, "use_undo"):
        handle.use_undo = True


def end_drag(handle: bpy.types.Gizmo) -> None:
    """End a drag. Before Blender 5.2 a drag is not an undo step by itself."""
    if not hasattr(handle, "use_undo"):
        bpy.app.timers.register(push_undo)


def push_undo() -> None:
    """Make an undo step of the change of a handle."""
    bpy.ops.ed.undo_push(message="Move Handle")


def basis_at(context: bpy.types.Context, point: Vector, direction: Vector) -> Matrix:
    """Return the transform in the world of a handle at a point, with its z axis along a direction."""
    return (
        link_frame(context.object) @ Matrix.Translation(point) @ direction.to_track_quat("Z", "Y").to_matrix().to_4x4()
    )
