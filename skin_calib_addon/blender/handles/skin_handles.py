# SPDX-License-Identifier: GPL-3.0-or-later
"""Handles in the 3D view for skins: origins, landmarks and excluded zones move over the link, directions turn."""

import math
from typing import Any

import bpy
from mathutils import Matrix, Vector
from mathutils.geometry import intersect_line_plane

from ...common.colours import SKY, VERMILLION, YELLOW
from ..overlay import drawing
from ..scene.link_meshes import link_frame
from ..scene.points_on_link import point_and_normal_under, ray_under
from ..scene.skins import fix_pose, point_of, put_point, root_row
from ..scene.units import metres_per_unit
from .plane_handles import basis_at, end_drag, is_shown, undo_drags

COLOURS = {
    "origin": YELLOW[:3],
    "direction": YELLOW[:3],
    "landmark": SKY[:3],
    "zone": VERMILLION[:3],
}
# Sizes of the handles, in units of the handle size of Blender's preferences. Larger: larger handles.
ARROW = Matrix.Translation((0, 0, 0.2)) @ Matrix.Scale(0.8, 4)  # the arrow starts above the box
BOX = Matrix.Scale(0.08, 4)
# A box on an edge is a landmark, two crossed boxes are a zone.
EDGE = BOX @ Matrix.Rotation(math.pi / 4, 4, (1, 1, 0))
BOXES = {"origin": (BOX,), "landmark": (EDGE,), "zone": (BOX, EDGE)}

Target = tuple[str, int, int]  # kind, index of the skin, index of its landmark or zone


class SKIN_GT_spot(bpy.types.Gizmo):
    """A box or an arrow that follows the mouse over the link."""

    bl_idname = "SKIN_GT_spot"

    __slots__ = ("before", "has_moved", "normal", "target")

    def setup(self) -> None:
        self.target = None

    def aim(self, target: Target) -> None:
        """Set what the handle moves."""
        self.target = target
        self.color = (1.0, 1.0, 1.0) if self.is_highlight else COLOURS[target[0]]
        self.alpha = 0.9

    def draw(self, context):
        self.draw_select(context, -1)

    def draw_select(self, _context, select_id):
        if self.target[0] == "direction":
            self.draw_preset_arrow(self.matrix_world @ ARROW, select_id=select_id)
        else:
            for box in BOXES[self.target[0]]:
                self.draw_preset_box(self.matrix_world @ box, select_id=select_id)

    def invoke(self, context, _event):
        plan, (what, skin, index) = context.object.skin_calib, self.target
        self.before, self.normal, self.has_moved = state(plan, skin, what, index), None, False
        return {"RUNNING_MODAL"}

    def begin(self, context):
        """Fix the current position of a skin that was placed automatically, so that the drag starts there."""
        plan, (what, skin, _) = context.object.skin_calib, self.target
        patches = drawing.patches_of(context.object)
        if what in ("origin", "direction") and patches:
            fix_pose(plan.skins[skin], patches[skin].taxels, metres_per_unit(context.scene))
            self.normal = Vector(patches[skin].taxels.normals_link[root_row(patches[skin].taxels)])

    def modal(self, context, event, _tweak):
        if event.type != "MOUSEMOVE":
            return {"RUNNING_MODAL"}
        if not self.has_moved:  # a click without motion changes nothing
            self.has_moved = True
            self.begin(context)
        plan, (what, skin, index) = context.object.skin_calib, self.target
        if what == "direction":
            direction = direction_under(context, event.mouse_x, event.mouse_y, self.matrix_basis)
            if direction is not None:
                plan.skins[skin].direction, plan.skins[skin].auto_direction = direction, False
            return {"RUNNING_MODAL"}
        met = point_and_normal_under(context, event.mouse_x, event.mouse_y)
        if met is not None:
            point, normal = met
            put_point(plan, what, skin, index, point)
            if what == "origin" and self.normal is not None:  # the rows keep their direction on the curved link
                turn = self.normal.rotation_difference(normal)
                plan.skins[skin].direction = turn @ Vector(plan.skins[skin].direction)
                self.normal = normal
        return {"RUNNING_MODAL"}

    def exit(self, context, cancel):
        _, skin, _ = self.target
        if cancel:
            for group, name, value in self.before:
                setattr(group, name, value)
        else:
            end_drag(self)


def state(plan: Any, skin: int, what: str, index: int) -> list[tuple[Any, str, Any]]:
    """Return what a drag can change: each group of properties, the name of the property, and its value."""
    owner, name = point_of(plan, "origin" if what == "direction" else what, skin, index)
    names = (
        (name,)
        if what not in ("origin", "direction")
        else ("origin", "centred", "direction", "auto_direction", "choice")
    )
    found = []
    for changed in names:
        value = getattr(owner, changed)
        found.append((owner, changed, value.copy() if isinstance(value, Vector) else value))
    return found


def direction_under(context: bpy.types.Context, x: int, y: int, basis: Matrix) -> Vector | None:
    """Return the unit vector from the foot of an arrow to the mouse, in its plane and in the link frame."""
    ray = ray_under(context, x, y)
    if ray is None:
        return None
    foot, normal = basis.translation, basis.to_3x3().col[0]
    met = intersect_line_plane(ray[0], ray[0] + ray[1], foot, normal)
    if met is None or (met - foot).length == 0:
        return None
    return (link_frame(context.object).inverted().to_3x3() @ (met - foot)).normalized()


class SKIN_GGT_skins(bpy.types.GizmoGroup):
    """Moves and turns skins, their landmarks and excluded zones."""

    bl_idname = "SKIN_GGT_skins"
    bl_label = "Skin Places"
    bl_space_type = "VIEW_3D"
    bl_region_type = "WINDOW"
    bl_options = {"3D", "PERSISTENT", "SHOW_MODAL_ALL"}

    @classmethod
    def poll(cls, context):
        return is_shown(context, "PLACES") and len(context.object.skin_calib.skins) > 0

    def setup(self, context):
        self.spots = []
        self.refresh(context)

    def refresh(self, context):
        """Make as many handles as there are targets."""
        targets = targets_of(context.object.skin_calib)
        while len(self.spots) < len(targets):
            spot = self.gizmos.new(SKIN_GT_spot.bl_idname)
            undo_drags(spot)
            self.spots.append(spot)

    def draw_prepare(self, context):
        targets = targets_of(context.object.skin_calib)
        for k, spot in enumerate(self.spots):
            basis = basis_of(context, targets[k]) if k < len(targets) else None
            spot.hide = basis is None
            if basis is not None:
                spot.aim(targets[k])
                spot.matrix_basis = basis


def targets_of(plan: Any) -> list[Target]:
    """Return everything of the skins of a plan that can be moved."""
    found: list[Target] = []
    for k, skin in enumerate(plan.skins):
        if skin.kind == "imported":
            continue
        if skin.kind == "hexagons" or not skin.landmarks:
            found.append(("origin", k, 0))
        found.append(("direction", k, 0))
        if skin.kind == "sheet":
            found += [("landmark", k, i) for i in range(len(skin.landmarks))]
        else:
            found += [("zone", k, i) for i in range(len(skin.excluded))]
    return found


def basis_of(context: bpy.types.Context, target: Target) -> Matrix | None:
    """Return the transform of a handle in the world; None before the first placement of the skin, if it is needed.

    The z axis of an arrow is its direction, its x axis is the normal of the link.
    """
    what, skin, index = target
    if what in ("landmark", "zone") or what == "origin" and not context.object.skin_calib.skins[skin].centred:
        owner, name = point_of(context.object.skin_calib, what, skin, index)
        return basis_at(context, Vector(getattr(owner, name)), Vector((0, 0, 1)))
    patches = drawing.patches_of(context.object)
    if not patches:
        return None
    taxels = patches[skin].taxels
    i, metre = root_row(taxels), metres_per_unit(context.scene)
    normal, tangent = Vector(taxels.normals_link[i]), Vector(taxels.tangents_link[i])
    turn = Matrix((normal, tangent.cross(normal), tangent)).transposed()
    return link_frame(context.object) @ Matrix.Translation(Vector(taxels.positions_link[i]) / metre) @ turn.to_4x4()
