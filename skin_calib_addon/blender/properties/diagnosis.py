# SPDX-License-Identifier: GPL-3.0-or-later
"""What was found on the mesh of a link, as properties."""

import bpy
from bpy.props import CollectionProperty, IntProperty, StringProperty

from .options import FIXED
from .warning import SKIN_PG_warning


class SKIN_PG_diagnosis(bpy.types.PropertyGroup):
    """What the last check of the mesh found."""

    key: StringProperty(description="Which mesh was looked at; empty before the first check", **FIXED)
    findings: CollectionProperty(
        type=SKIN_PG_warning, name="Findings", description="What the check of the mesh found", **FIXED
    )
    inner: IntProperty(name="Inner Parts", description="Connected parts that lie inside others", **FIXED)
    edges: IntProperty(
        name="Edges", description="Edges of holes, and edges with more than two faces, that can be shown", **FIXED
    )


CLASSES = (SKIN_PG_diagnosis,)
