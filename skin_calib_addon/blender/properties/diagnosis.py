# SPDX-License-Identifier: GPL-3.0-or-later
"""What was found on the mesh of a link, as properties."""

import bpy
from bpy.props import BoolProperty, CollectionProperty, IntProperty, StringProperty

from .options import FIXED


class SKIN_PG_remark(bpy.types.PropertyGroup):
    """One line about a mesh."""

    what: StringProperty(name="What", description="What was found, broken into lines", **FIXED)
    matters: BoolProperty(name="Matters", description="The fit suffers from it", **FIXED)
    advice: StringProperty(name="Advice", description="What to do about it, broken into lines", **FIXED)


class SKIN_PG_diagnosis(bpy.types.PropertyGroup):
    """What the last check of the mesh found."""

    key: StringProperty(description="Which mesh was looked at; empty before the first check", **FIXED)
    remarks: CollectionProperty(type=SKIN_PG_remark, name="Remarks", description="What was found, by line", **FIXED)
    inner: IntProperty(name="Inner Parts", description="Connected parts that lie inside others", **FIXED)
    edges: IntProperty(
        name="Edges", description="Edges of holes, and edges with more than two faces, that can be shown", **FIXED
    )


CLASSES = (SKIN_PG_remark, SKIN_PG_diagnosis)
