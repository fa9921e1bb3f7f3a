# SPDX-License-Identifier: GPL-3.0-or-later
"""The panels of the sidebar tab Skin, in the order of the work; they draw stored values and compute nothing."""

import bpy

from . import cut, export, fit, grid, inspect, link, skin

CLASSES = tuple(cls for module in (link, cut, grid, fit, skin, inspect, export) for cls in module.CLASSES)


def register():
    """Add the panels."""
    for cls in CLASSES:
        bpy.utils.register_class(cls)


def unregister():
    """Remove them."""
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
