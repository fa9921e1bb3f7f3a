# SPDX-License-Identifier: GPL-3.0-or-later
"""Skin Calib for Blender; Blender's parts are imported while it registers, so that plain Python may pass by."""


def register():
    """Add the Skin tab, its operators and its command to Blender."""
    try:
        from .skin_calib_addon.blender import registration

        registration.register(__package__)
    except ModuleNotFoundError as error:
        from .skin_calib_addon.common.packages import IN_ZIP, how_to_install

        if error.name not in IN_ZIP:
            raise
        raise ModuleNotFoundError(f"Skin Calib needs {error.name}: {how_to_install(error.name)}") from None


def unregister():
    """Take everything away again."""
    from .skin_calib_addon.blender import registration

    registration.unregister()
