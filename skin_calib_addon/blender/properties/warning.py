# SPDX-License-Identifier: GPL-3.0-or-later
"""Warnings as properties; the members are those of `common.warnings.Warning`."""

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, FloatVectorProperty, StringProperty

from .options import FIXED


class SKIN_PG_warning(bpy.types.PropertyGroup):
    """One thing to look at."""

    code: StringProperty(name="Code", description="Stable name of the kind of warning", **FIXED)
    severity: EnumProperty(
        name="Severity",
        description="How much it matters",
        items=[
            ("note", "Note", "Information"),
            ("warning", "Warning", "Look at it before you trust the result"),
            ("error", "Error", "The result cannot be used"),
        ],
        **FIXED,
    )
    message: StringProperty(name="Message", description="What is wrong, and where", **FIXED)
    advice: StringProperty(name="Advice", description="What to do", **FIXED)
    value: FloatProperty(name="Value", description="The figure of the message, in SI units", **FIXED)
    has_point: BoolProperty(name="Has Point", description="Whether the place is known as a point", **FIXED)
    point: FloatVectorProperty(name="Point", description="Place in the link frame [m]", **FIXED)
    names: StringProperty(name="Names", description="Planes or rows near the place", **FIXED)
    skin: StringProperty(name="Skin", description="Name of the skin", **FIXED)
    surface: StringProperty(name="Surface", description="Name of the surface, of several", **FIXED)


CLASSES = (SKIN_PG_warning,)
