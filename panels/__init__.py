# SPDX-License-Identifier: GPL-3.0-or-later
"""The sidebar tab Skin, from top to bottom like the job: they lay out stored values and compute nothing."""

import bpy

from . import skin

CLASSES = skin.CLASSES


def register():
    """Add the panels."""
    for cls in CLASSES:
        bpy.utils.register_class(cls)


def unregister():
    """Take them away."""
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
