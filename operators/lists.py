# SPDX-License-Identifier: GPL-3.0-or-later
"""Add, remove and move entries of the plan of the active link: skins, landmarks, excluded zones."""

import bpy

from ..skin_calib_addon.blender.scene import points_on_link, skins
from ..skin_calib_addon.blender.scene.fields import write_first
from ..skin_calib_addon.blender.scene.preferences import chosen_boards
from ..skin_calib_addon.blender.scene.results import find
from ..skin_calib_addon.blender.scene.skins import entry, of_kind
from ..skin_calib_addon.blender.scene.units import metres_per_unit
from ..skin_calib_addon.plan.keys import ZONE
from .base import INDEX, Edit, OnSkin, Operator
from .picking import POINT, AtCursor, Picking


class RemoveEntry(Edit):
    """Removes one entry of a list of the plan."""

    index: bpy.props.IntProperty(name="Index", description="Which entry, from 0", **INDEX)

    what = ""  # an entry in words

    def entries(self, plan):
        """Return the list."""
        raise NotImplementedError

    def edit(self, context, plan):
        entries = self.entries(plan)
        entry(entries, self.index, self.what)
        entries.remove(self.index)


class SKIN_OT_skin_add(Edit, Operator):
    """Add a skin to the active link: a sheet of taxels, or hexagonal boards like those of Propose"""

    bl_label = "Add Skin"

    kind: bpy.props.EnumProperty(
        name="Kind",
        description="What the skin is made of",
        items=[
            ("sheet", "Sheet", "Add a flexible sheet of taxels to the active link"),
            ("hexagons", "Hexagons", "Add rigid hexagonal boards to the active link, of the size of the Proposed Skin"),
        ],
    )

    @classmethod
    def description(cls, _context, properties):
        return properties.bl_rna.properties["kind"].enum_items[properties.kind].description

    def edit(self, context, plan):
        boards = chosen_boards(context.scene) if self.kind == "hexagons" else None
        metre, result = metres_per_unit(context.scene), find(plan.result.key)
        skin = skins.add_skin(plan.skins, self.kind, metre)
        plan.skin_index = len(plan.skins) - 1
        if boards:
            skins.give_size(skin, boards, metre)
        if result is not None:
            skins.turn_along_lines(skin, next(iter(result.fits.values())).surface)  # a new skin is on the first one


class SKIN_OT_skin_remove(RemoveEntry, Operator):
    """Remove this skin from the active link"""

    bl_label = "Remove Skin"
    what = "skin"

    def entries(self, plan):
        return plan.skins


class SKIN_OT_landmark_add(AtCursor, OnSkin, Edit, Operator):
    """Pin a cell of this sheet to the 3D cursor; the first landmark replaces the origin"""

    bl_label = "Add Landmark"

    def edit(self, context, plan):
        skin = of_kind(plan, self.skin, "sheet", "landmarks")
        skin.landmarks.add().point = self.start(context)


class SKIN_OT_landmark_remove(OnSkin, RemoveEntry, Operator):
    """Remove this landmark; without landmarks the sheet has its origin again"""

    bl_label = "Remove Landmark"
    what = "landmark"

    def entries(self, plan):
        return of_kind(plan, self.skin, "sheet", "landmarks").landmarks


class SKIN_OT_zone_add(AtCursor, OnSkin, Edit, Operator):
    """Keep boards away from the 3D cursor"""

    bl_label = "Add Excluded Zone"

    def edit(self, context, plan):
        zone = of_kind(plan, self.skin, "hexagons", "excluded zones").excluded.add()
        zone.point = self.start(context)
        write_first(ZONE, zone, metres_per_unit(context.scene))


class SKIN_OT_zone_remove(OnSkin, RemoveEntry, Operator):
    """Remove this zone, so that boards may cover it again"""

    bl_label = "Remove Excluded Zone"
    what = "excluded zone"

    def entries(self, plan):
        return of_kind(plan, self.skin, "hexagons", "excluded zones").excluded


class SKIN_OT_registration_remove(OnSkin, Edit, Operator):
    """Forget how touches registered this skin, which has the usual uncertainty again; it stays where it is"""

    bl_label = "Forget Registration"

    def edit(self, context, plan):
        entry(plan.skins, self.skin, "skin").touches = ""


class Place(OnSkin, Edit):
    """Sets the origin of a skin, or the point of one of its landmarks or zones."""

    what: bpy.props.EnumProperty(
        name="What",
        description="Which point of the skin",
        items=[
            ("origin", "Origin", "Where the centre of cell (0, 0) lies"),
            ("landmark", "Landmark", "Where a cell is pinned"),
            ("zone", "Excluded Zone", "Centre of a zone that boards must not cover"),
        ],
        options={"HIDDEN"},
    )
    index: bpy.props.IntProperty(name="Index", description="Which landmark or zone, from 0", **INDEX)

    def put(self, plan, point):
        """Set the point, in the link frame in scene units."""
        skins.put_point(plan, self.what, self.skin, self.index, point)


class SKIN_OT_place_at_cursor(Place, Operator):
    """Move this point to the 3D cursor"""

    bl_label = "Place at 3D Cursor"

    def edit(self, context, plan):
        self.put(plan, points_on_link.cursor_on(context.object, context.scene))


class SKIN_OT_place(Picking, Place, Operator):
    """Click on the link to move this point there; Esc leaves it where it is"""

    bl_label = "Place on Link"

    point: bpy.props.FloatVectorProperty(name="Point", description="Where the point lies, in the link frame", **POINT)

    def edit(self, context, plan):
        self.put(plan, self.point)

    prompts = ("Click on the link to move the point there    Esc: leave it",)

    def check(self, context):
        super().check(context)
        skins.point_of(context.object.skin_calib, self.what, self.skin, self.index)
