# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators: each reads the scene, calls one function, writes the scene, and reports."""

import bpy

from . import (
    advice,
    axis,
    boards,
    cut,
    drop,
    exchange,
    files,
    fit,
    imported,
    inspect,
    link,
    lists,
    place,
    planes,
    presets,
    robot,
    samples,
    single_taxels,
    surfaces,
    touches,
    zones,
)

MODULES = (
    files,
    link,
    robot,
    cut,
    fit,
    advice,
    lists,
    imported,
    place,
    boards,
    axis,
    planes,
    surfaces,
    inspect,
    single_taxels,
    touches,
    exchange,
    drop,
    samples,
    presets,
    zones,
)
CLASSES = tuple(cls for module in MODULES for cls in module.CLASSES)


def register():
    """Add the operators and the entries in File > Import and Export."""
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    bpy.types.TOPBAR_MT_file_import.append(exchange.draw_import)
    bpy.types.TOPBAR_MT_file_export.append(exchange.draw_export)


def unregister():
    """Remove them."""
    bpy.types.TOPBAR_MT_file_export.remove(exchange.draw_export)
    bpy.types.TOPBAR_MT_file_import.remove(exchange.draw_import)
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
