# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators: each reads the scene, calls one function, writes the scene, and reports."""

import bpy

from . import axis, boards, cut, exchange, files, fit, imported, inspect, link, lists, place, planes, touches

MODULES = (files, link, cut, fit, lists, imported, place, boards, axis, planes, inspect, touches, exchange)
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
