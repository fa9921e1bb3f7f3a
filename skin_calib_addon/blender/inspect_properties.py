# SPDX-License-Identifier: GPL-3.0-or-later
"""How the fitted skin is looked at, as properties: nothing of it belongs to the plan."""

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty

from .options import FIXED, LENGTH


class SKIN_PG_inspect(bpy.types.PropertyGroup):
    """How the fitted skin of a link is looked at."""

    heat: EnumProperty(
        name="Heat Map",
        description="What colours stand for",
        items=[
            ("NONE", "None", "No colours"),
            ("ERROR", "Error", "How far the mesh is from the surface, along the rays of the fit"),
            ("STRAIN", "Strain", "The larger one of the strains of a cell along and across its row"),
            ("TILT", "Tilt", "The largest angle between a taxel and a neighbour"),
        ],
        **FIXED,
    )
    labels: EnumProperty(
        name="Labels",
        description="What is written at the taxels that face the viewer, as far as there is room",
        items=[
            ("NONE", "None", "Nothing"),
            ("ID", "Ids", "Ids of the taxels"),
            ("CHANNEL", "Channels", "Where the taxels stand in a reading"),
        ],
        **FIXED,
    )
    auto_length: BoolProperty(
        name="Automatic Normals",
        description="Draw normals in proportion to the cells and to the link",
        default=True,
        **FIXED,
    )
    length: FloatProperty(name="Normals", description="How long normals are drawn", default=0.006, min=0, **LENGTH)
    text_size: IntProperty(
        name="Text Size", description="Size of the labels, in points", default=11, min=6, max=60, **FIXED
    )
    line_width: FloatProperty(
        name="Line Width", description="Width of all lines, as a factor", default=1.0, min=0.25, max=10, **FIXED
    )

    def tokens(self):
        """Names of what is drawn besides, as it was when this was set."""
        return ()


CLASSES = (SKIN_PG_inspect,)
