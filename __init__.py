# SPDX-License-Identifier: GPL-3.0-or-later
"""Skin Calib for Blender; Blender's parts are imported while it registers, so that plain Python may pass by."""


def register():
    """Add the Skin tab, its operators and its command to Blender."""
    from .skin_calib_addon.blender import registration

    registration.register(__package__)


def unregister():
    """Take everything away again."""
    from .skin_calib_addon.blender import registration

    registration.unregister()
