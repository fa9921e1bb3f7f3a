# SPDX-License-Identifier: GPL-3.0-or-later
"""The sidebar tab Skin, from top to bottom like the job: they lay out stored values and compute nothing."""

import bpy

from . import cut, export, fit, grid, inspect, link, skin

CLASSES = tuple(cls for module in (link, cut, grid, fit, skin, inspect, export) for cls in module.CLASSES)


def register():
    """Add the panels."""
    for cls in CLASSES:
        bpy.utils.register_class(cls)


def unregister():
    """Take them away."""
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
