# SPDX-License-Identifier: GPL-3.0-or-later
"""Files that the author chooses in the file browser."""

from pathlib import Path

import bpy
from bpy_extras.io_utils import ImportHelper

from ..skin_calib_addon.blender.live.background import Work
from ..skin_calib_addon.common.errors import SkinCalibError
from .base import KeepsLink, Operator, no_fit, no_link
from .working import MAX_BLOCKING_TIME, Waiting

_reading: list[tuple] = []  # what SKIN_OT_import_wait waits for: name of the file, work, and what uses its result


class FromFile(ImportHelper):
    """Asks for a file to read; its path may be relative to the .blend."""

    filepath: bpy.props.StringProperty(
        name="File Path",
        description="The file to read",
        subtype="FILE_PATH",
        options={"HIDDEN", "SKIP_PRESET", "PATH_SUPPORTS_BLEND_RELATIVE"},
    )


class Import(FromFile):
    """Reads a file and adds what it has to the scene, or refuses and leaves the scene as it was.

    A large file that was chosen by hand is read in a thread; :class:`SKIN_OT_import_wait` then adds it.
    """

    by_hand = False  # whether it was chosen in the window

    def reader(self, path):
        """Return a function that reads the file without Blender; None if another operator continues."""
        raise NotImplementedError

    @staticmethod
    def use(operator, context, *result):
        """Add the result of the reader to the scene, and report it with an operator."""
        raise NotImplementedError

    def invoke(self, context, event):
        self.by_hand = True
        if self.properties.is_property_set("filepath"):  # of a file that was dropped into the view
            return self.execute(context)
        return super().invoke(context, event)

    def act(self, context):
        path = Path(bpy.path.abspath(self.filepath))
        read = self.reader(path)
        if read is None:
            return {"CANCELLED"}  # the scene is unchanged
        work = Work(lambda begin: read())
        if work.is_done(MAX_BLOCKING_TIME if self.by_hand else None):
            self.use(self, context, *work.result())
            return {"FINISHED"}
        _reading[:] = [(path.name, work, type(self).use)]
        bpy.ops.skin_calib.import_wait("INVOKE_DEFAULT")
        return {"CANCELLED"}


class SKIN_OT_import_wait(Waiting, Operator):
    """Wait for the file that is read, and add what it has to the scene"""

    bl_label = "Import"
    bl_options = {"UNDO", "INTERNAL"}

    doing = "Reading"

    def invoke(self, context, event):
        self.subject, self.work, self.use = _reading.pop()
        return self.wait(context)

    def take(self, context):
        try:
            self.use(self, context, *self.work.result())
        except SkinCalibError as error:
            return self.refuse(error)
        return {"FINISHED"}


class LooksAtFile(KeepsLink, FromFile):
    """Compares the fit of the active link with a file; ``look`` returns the result in one line."""

    blocked_by = (no_link, no_fit)

    def act(self, context):
        self.report({"INFO"}, self.look(context, bpy.path.abspath(self.filepath)))
