# SPDX-License-Identifier: GPL-3.0-or-later
"""Inspect the fitted skin of the active link: taxels, comparisons with files and touches, recordings, pictures."""

from pathlib import Path

import bpy
import numpy as np
from bpy_extras.io_utils import ExportHelper

from ..skin_calib_addon.blender.inspection import comparing, replay, taxel_mesh, taxels
from ..skin_calib_addon.blender.overlay import picture
from ..skin_calib_addon.blender.properties.inspect import HEAT_MAPS
from ..skin_calib_addon.blender.scene.points_on_link import ray_under
from ..skin_calib_addon.common.errors import OutputError
from .base import Edit, Operator, no_fit, no_link
from .files import LooksAtFile
from .picking import Picking


class PicksTaxel(Picking):
    """Asks for clicks on taxels, until Esc or Return."""

    what = "A taxel"
    repeats = True

    def under_mouse(self, context, event):
        ray = ray_under(context, event.mouse_x, event.mouse_y)
        return taxels.taxel_on_ray(context.object, context, *ray) if ray else None

    def take(self, points):
        (self.taxel,) = points


class SKIN_OT_taxel(PicksTaxel, Operator):
    """Click on taxels to read their values; Esc or Return ends"""

    bl_label = "Read Taxels"
    blocked_by = (no_link, no_fit)

    taxel: bpy.props.StringProperty(name="Taxel", description="Id or channel of the taxel")

    prompts = ("Click on taxels to read them    Esc, Return: end",)

    def check(self, context):
        """Allow clicks on the taxels of a hidden link."""

    def act(self, context):
        self.taxel = taxels.read_taxel(context.object, self.taxel, context.scene)


class SKIN_OT_taxel_mesh(Operator):
    """Make an object with a face for each taxel, with attributes, and nodes and a material that show one of them"""

    bl_label = "Taxels as Mesh"
    blocked_by = (no_link, no_fit)

    heat: bpy.props.EnumProperty(
        name="Colours",
        description="What the colours show; the modifier can show any other attribute by its name",
        items=[item for item in HEAT_MAPS if item[0] in taxel_mesh.OF_HEAT],
        options={"SKIP_SAVE"},
    )

    def act(self, context):
        heat = context.object.skin_calib.inspect.heat
        if heat in taxel_mesh.OF_HEAT and not self.properties.is_property_set("heat"):
            self.heat = heat
        made = taxel_mesh.add_taxel_mesh(context.object, context, self.heat)
        names = ", ".join(a.name for a in made.data.attributes if a.domain == "FACE" and not a.is_internal)
        self.report({"INFO"}, f"{made.name}: {len(made.data.polygons)} faces with {names}")


class SKIN_OT_compare(LooksAtFile, Operator):
    """Compare the taxels of the active link with those of a calibration or of another program's file"""

    bl_label = "Compare with File"

    filter_glob: bpy.props.StringProperty(default=";".join(f"*{e}" for e in comparing.ENDINGS), options={"HIDDEN"})

    def look(self, context, path):
        found = comparing.compare_with(context.object, path)
        return f"{len(found.ours)} taxels paired, {1e3 * found.distances.mean():.4f} mm apart on average"


def no_comparison(context):
    """Return that the link has no comparison."""
    return "" if context.object.skin_calib.inspect.comparison.file else "Compare with a file first"


class SKIN_OT_compare_end(Operator):
    """Remove the comparison"""

    bl_label = "End Comparison"
    blocked_by = (no_link, no_comparison)

    def act(self, context):
        context.object.skin_calib.inspect.property_unset("comparison")


class SKIN_OT_replay_open(LooksAtFile, Operator):
    """Show a recording over the skin of the active link: a table, NPZ or MCAP file of times and readings"""

    bl_label = "Open Recording"

    filter_glob: bpy.props.StringProperty(default="*.csv;*.npz;*.mcap", options={"HIDDEN"})

    def look(self, context, path):
        shown = replay.open_recording(context.object, path)
        taxel_mesh.follow_timeline(context.scene)
        taxel_mesh.show_forces(context.object)
        return f"{len(shown)} frames, {shown.duration:.2f} s, at most {shown.strongest:.2f} N on a taxel"


def no_recording(context):
    """Return that the link shows no recording."""
    return "" if context.object.skin_calib.inspect.replay.file else "Open a recording first"


class SKIN_OT_replay_close(Operator):
    """Remove this recording"""

    bl_label = "Close Recording"
    blocked_by = (no_link, no_recording)

    def act(self, context):
        replay.close(context.object)
        taxel_mesh.follow_timeline(context.scene)


def old_recording(context):
    """Return that the recording does not belong to the last fit, or is not stored any more."""
    return "" if replay.find(context.object) else "Open the recording again: the fit or the file has changed"


class SKIN_OT_replay_play(Operator):
    """Play the recording over the skin, or pause it"""

    bl_label = "Play"
    bl_options = {"REGISTER"}
    blocked_by = (no_link, no_recording, old_recording)

    def act(self, context):
        if replay.is_playing(context.object):
            replay.stop(context.object)
        else:
            replay.play(context.object)


class SKIN_OT_touches(LooksAtFile, Operator):
    """Compare the taxels of the active link with a table of touches: the strongest taxel, and the probe position"""

    bl_label = "Compare with Touches"

    filter_glob: bpy.props.StringProperty(default="*.csv;*.mcap", options={"HIDDEN"})

    def look(self, context, path):
        found = comparing.compare_touches(context.object, context, path)
        return f"{sum(len(placement.rows) for placement in found)} touches compared"


def no_touches(context):
    """Return that the link has no touches, and what to do."""
    return "" if context.object.skin_calib.inspect.touches.file else "Compare with touches first"


def is_changed(context):
    """Return that the link has changed since its fit."""
    return "Fit the link again first" if context.object.skin_calib.result.outdated else ""


class SKIN_OT_touches_move(Edit, Operator):
    """Move the skins of the active link to fit the touches: origins and directions, or landmarks"""

    bl_label = "Move Skins There"
    blocked_by = (no_link, no_fit, no_touches, is_changed)

    def edit(self, context, plan):
        comparing.move_to_touches(context.object, context)


class SKIN_OT_touches_end(Operator):
    """Remove these touches"""

    bl_label = "Forget Touches"
    blocked_by = (no_link, no_touches)

    def act(self, context):
        context.object.skin_calib.inspect.property_unset("touches")


def no_view(context):
    """Return that there is no 3D view whose picture could be saved."""
    is_view = context.space_data is not None and context.space_data.type == "VIEW_3D" and not bpy.app.background
    return "" if is_view else "Use it in a 3D view"


class SKIN_OT_save_picture(ExportHelper, Operator):
    """Save this view with the drawn skin and a legend of all colours and lines, for a paper or a report"""

    bl_label = "Save Picture"
    bl_options = {"REGISTER"}
    blocked_by = (no_view,)

    filename_ext = ".png"
    filter_glob: bpy.props.StringProperty(default="*.png", options={"HIDDEN"})
    width: bpy.props.IntProperty(
        name="Width",
        description="Width of the picture in pixels; lines and texts grow with it",
        default=2000,
        min=200,
        max=picture.MAX_WIDTH,
        subtype="PIXEL",
    )
    transparent: bpy.props.BoolProperty(name="Transparent", description="Leave the background out")

    def act(self, context):
        path = Path(bpy.path.abspath(self.filepath))
        region = next(part for part in context.area.regions if part.type == "WINDOW")
        pixels = picture.picture_of(context, region, self.width, self.transparent)
        height, width, _ = pixels.shape
        image = bpy.data.images.new(path.name, width, height, alpha=True)
        try:
            image.pixels.foreach_set((pixels / np.float32(255)).ravel())
            image.filepath_raw, image.file_format = str(path), "PNG"
            image.save()
        except RuntimeError as error:
            raise OutputError(f"{path} cannot be written: {error}. Choose another folder.") from error
        finally:
            bpy.data.images.remove(image)
        self.report({"INFO"}, f"Saved {path}, {width} x {height} pixels")
