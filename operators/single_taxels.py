# SPDX-License-Identifier: GPL-3.0-or-later
"""Single taxels of the active link: disable them, and change their channels."""

import bpy

from ..skin_calib_addon.blender.overlay import drawing
from ..skin_calib_addon.blender.scene import skins
from ..skin_calib_addon.blender.scene.skins import entry
from ..skin_calib_addon.blender.scene.units import metres_per_unit
from ..skin_calib_addon.calibration.model import MAX_CHANNEL
from ..skin_calib_addon.common.errors import SkinCalibError
from ..skin_calib_addon.skin.single_taxels import short_id
from .base import Followed, OnSkin, Operator, no_fit, no_link
from .inspect import PicksTaxel
from .lists import RemoveEntry

TAXEL = {"name": "Taxel", "options": {"SKIP_SAVE"}}


class OneTaxel(Followed):
    """Changes what the plan has about single taxels."""

    blocked_by = (no_link, no_fit)

    def single(self, context, plan, taxel):
        """Return what the plan has about a taxel of the last result; boards are listed first."""
        drawn = drawing.layers_now(context.object)
        if drawn is None or not drawing.patches_of(context.object):
            raise SkinCalibError("Fit the link first, to see its taxels.")
        for skin, patch, disabled in zip(plan.skins, drawn.patches, drawn.disabled_patches):
            if taxel in patch.taxels.ids or disabled and taxel in disabled.taxels.ids:
                if skin.kind == "hexagons":
                    skins.list_boards(skin, patch.taxels, metres_per_unit(context.scene))
                return skins.single_taxel(skin, short_id(patch, taxel))
        raise SkinCalibError(f"The link has no taxel {taxel}. Fit it again, or choose another one.")


class SKIN_OT_taxel_toggle(OneTaxel, PicksTaxel, Operator):
    """Click on a taxel to disable it, on a disabled one to enable it; the skin follows each click"""

    bl_label = "Disable Taxels"

    taxel: bpy.props.StringProperty(description="Id of the taxel", **TAXEL)

    prompts = ("Click on a taxel to disable or enable it    Ctrl-Z: undo    Esc, Return: end",)

    def invoke(self, context, event):
        if self.taxel:
            return self.execute(context)
        return super().invoke(context, event)

    def edit(self, context, plan):
        single = self.single(context, plan, self.taxel)
        single.enabled = not single.enabled
        skins.drop_usual(plan)


class SKIN_OT_taxel_channel(OneTaxel, Operator):
    """Give the taxel that is shown another channel"""

    bl_label = "Set Channel"

    taxel: bpy.props.StringProperty(description="Id of the taxel", **TAXEL)
    channel: bpy.props.IntProperty(
        name="Channel",
        description="Position of the taxel in a reading",
        min=0,
        max=MAX_CHANNEL,
        options={"SKIP_SAVE"},
    )
    swap: bpy.props.BoolProperty(
        name="Swap",
        description="Give the taxel that has this channel the former one, as where two wires are swapped",
        options={"SKIP_SAVE"},
    )

    def invoke(self, context, _event):
        self.taxel = self.taxel or context.object.skin_calib.inspect.taxel.id
        if not self.taxel:
            self.report({"ERROR"}, "Read a taxel first, or select one by its id.")
            return {"CANCELLED"}
        channels = channels_of(context.object)
        if not self.properties.is_property_set("channel"):
            self.channel = channels.get(self.taxel, 0)
        return context.window_manager.invoke_props_dialog(self, title=f"Channel of {self.taxel}")

    def draw(self, _context):
        self.layout.activate_init = True  # the number can be typed without a click
        self.layout.prop(self, "channel")
        self.layout.prop(self, "swap")

    def edit(self, context, plan):
        channels = channels_of(context.object)
        others = [id for id, channel in channels.items() if channel == self.channel and id != self.taxel]
        if others and not self.swap:
            raise SkinCalibError(
                f"Channel {self.channel} belongs to {others[0]}. Choose another channel, or tick Swap."
            )
        if others and self.taxel not in channels:
            raise SkinCalibError(f"{self.taxel} is disabled and has no channel to swap. Choose another channel.")
        single = self.single(context, plan, self.taxel)
        single.auto_channel, single.channel = False, self.channel
        for other in others:
            swapped = self.single(context, plan, other)
            swapped.auto_channel, swapped.channel = False, channels[self.taxel]


def channels_of(link):
    """Return the channels of the enabled taxels by their ids, as the plan has them now."""
    found = {}
    for skin, patch in zip(link.skin_calib.skins, drawing.patches_of(link)):
        own = {single.taxel: single for single in skin.taxels}
        for id, channel in zip(patch.taxels.ids, patch.taxels.channels.tolist()):
            single = own.get(short_id(patch, id))
            if single is None or single.enabled:
                found[id] = channel if single is None or single.auto_channel else single.channel
    return found


class SKIN_OT_single_taxel_remove(OnSkin, RemoveEntry, Operator):
    """Remove this entry: the taxel is enabled, with its usual channel"""

    bl_label = "Remove Single Taxel"
    what = "single taxel"

    def entries(self, plan):
        return entry(plan.skins, self.skin, "skin").taxels
