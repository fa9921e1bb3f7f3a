# SPDX-License-Identifier: GPL-3.0-or-later
"""The result of the check of the mesh of a link, as properties."""

import bpy
from bpy.props import BoolProperty, CollectionProperty, IntProperty, StringProperty

from .options import FIXED
from .warning import SKIN_PG_warning


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


CLASSES = (SKIN_PG_diagnosis,)
