# SPDX-License-Identifier: GPL-3.0-or-later
"""The plan as properties of an object, saved in the .blend; each group has one member of the plan file."""

import bpy
from bpy.props import (
    BoolProperty,
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    IntProperty,
    PointerProperty,
    StringProperty,
)

from ...plan import keys
from ..live import updates
from . import diagnosis as link_properties
from . import grid as grid_properties
from . import inspect as inspect_properties
from . import skin as skin_properties
from . import warning
from .of_keys import of_keys
from .options import FIXED, LENGTH, PLAN


class SKIN_PG_number(bpy.types.PropertyGroup):
    """One coefficient."""

    value: FloatProperty(name="Value", description="A coefficient of the response", **PLAN)


class SKIN_PG_result(bpy.types.PropertyGroup):
    """The result of the last fit."""

    key: StringProperty(description="Key of the plan and mesh that were fitted; empty before the first fit", **FIXED)
    outdated: BoolProperty(
        name="Outdated", description="The plan was changed after the fit", update=updates.changed, **FIXED
    )
    mean: FloatProperty(name="Mean", description="Mean distance from surface to mesh", **LENGTH)
    max: FloatProperty(name="Max", description="Largest distance from surface to mesh", **LENGTH)
    hausdorff: FloatProperty(name="Hausdorff", description="Largest distance, in both directions", **LENGTH)
    control_points: IntProperty(name="Control Points", description="Control points of the surface", **FIXED)
    taxels: IntProperty(name="Taxels", description="Taxels of all skins", **FIXED)
    warnings: CollectionProperty(
        type=warning.SKIN_PG_warning, name="Warnings", description="Warnings of the last fit", **FIXED
    )
    seconds: FloatProperty(name="Time", description="Duration of the fit", unit="TIME_ABSOLUTE", precision=3, **FIXED)


@of_keys(keys.PLAN)
class SKIN_PG_link(bpy.types.PropertyGroup):
    """The plan of one link; an object without a link name is not a link."""

    mesh_file: StringProperty(name="Mesh File", description="Name of the mesh file in exported plans", **PLAN)
    diagnosis: PointerProperty(
        type=link_properties.SKIN_PG_diagnosis, name="Diagnosis", description="The result of the last check of the mesh"
    )
    cover: PointerProperty(
        type=grid_properties.SKIN_PG_cover, name="Cover", description="What of the mesh is covered with skin"
    )
    grid: PointerProperty(type=grid_properties.SKIN_PG_grid, name="Grid", description="Where planes and lines are")
    skins: CollectionProperty(
        type=skin_properties.SKIN_PG_skin, name="Skins", description="Sheets and boards on the link", **FIXED
    )
    response: CollectionProperty(
        type=SKIN_PG_number,
        name="Response",
        description="Polynomial from readings to newtons, lowest power first",
        **FIXED,
    )
    extra: StringProperty(
        name="Extra",
        description="Members of the plan that begin with x_, modalities, and a response that is no polynomial, as JSON",
        **FIXED,
    )
    result: PointerProperty(type=SKIN_PG_result, name="Result", description="The result of the last fit")
    held: EnumProperty(
        name="Handles",
        description="Which planes have handles; they tilt the selected one",
        items=[("CUT", "Cuts", "A cut"), ("U", "U-Planes", "A u-plane"), ("V", "V-Planes", "A v-plane")],
        **FIXED,
    )
    live: BoolProperty(
        name="Live", description="Fit surface and skin while the plan changes", update=updates.switched, **FIXED
    )
    show_overlay: BoolProperty(name="Overlay", description="Draw the fitted skin of this link", default=True, **FIXED)
    layers: EnumProperty(
        name="Layers",
        description="Parts of the fitted skin that are drawn",
        items=[
            ("PLANES", "Planes", "Planes placed by hand, and the parts that cuts remove", 128),
            ("PLACES", "Places", "Handles of origins, directions, landmarks and excluded zones", 256),
            ("SECTIONS", "Sections", "Where the u-planes cut the cover", 16),
            ("LINES", "V-Lines", "Where the planes of the v-lines cut the cover", 32),
            ("NET", "Net", "Control points of the surface, joined to a net", 64),
            ("SURFACE", "Surface", "Curves of the surface", 2),
            ("CELLS", "Cells", "Outlines of the taxels", 4),
            ("NORMALS", "Normals", "Outward normals of the taxels", 8),
        ],
        default={"PLANES", "PLACES", "SURFACE", "CELLS", "NORMALS"},
        options={"ENUM_FLAG"},
    )
    inspect: PointerProperty(
        type=inspect_properties.SKIN_PG_inspect, name="Inspect", description="How the fitted skin is inspected"
    )


CLASSES = (
    *warning.CLASSES,
    *link_properties.CLASSES,
    *grid_properties.CLASSES,
    *skin_properties.CLASSES,
    *inspect_properties.CLASSES,
    SKIN_PG_number,
    SKIN_PG_result,
    SKIN_PG_link,
)


def register():
    """Give every object a plan."""
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    bpy.types.Object.skin_calib = PointerProperty(
        type=SKIN_PG_link, name="Skin", description="Plan and result of a robot link"
    )


def unregister():
    """Remove the plans from objects; files keep them."""
    del bpy.types.Object.skin_calib
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
