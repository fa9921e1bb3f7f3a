# SPDX-License-Identifier: GPL-3.0-or-later
"""Warnings, and the result of the check of a mesh, as properties."""

import bpy
from bpy.props import (
    BoolProperty,
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    FloatVectorProperty,
    IntProperty,
    StringProperty,
)

from .options import FIXED


class SKIN_PG_warning(bpy.types.PropertyGroup):
    """One thing to look at; the members are those of `common.warnings.Warning`."""

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


class SKIN_PG_diagnosis(bpy.types.PropertyGroup):
    """The result of the last check of the mesh."""

    key: StringProperty(description="Key of the mesh that was checked; empty before the first check", **FIXED)
    outdated: BoolProperty(name="Outdated", description="The plan was changed after the check", **FIXED)
    findings: CollectionProperty(
        type=SKIN_PG_warning, name="Findings", description="What the check of the mesh found", **FIXED
    )
    inner: IntProperty(
        name="Inner Parts", description="Connected parts that are mostly within the convex hull of others", **FIXED
    )
    edges: IntProperty(name="Edges", description="Edges of holes, and edges with more than two faces", **FIXED)


CLASSES = (SKIN_PG_warning, SKIN_PG_diagnosis)
