# SPDX-License-Identifier: GPL-3.0-or-later
"""The plan as properties of an object, saved in the .blend. Each group mirrors one member of the plan file."""

import bpy
from bpy.props import (
    BoolProperty,
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    FloatVectorProperty,
    IntProperty,
    IntVectorProperty,
    PointerProperty,
    StringProperty,
)

from . import live, skin_properties
from .options import FIXED, LENGTH, PLACE, PLAN, WAY


class SKIN_PG_plane(bpy.types.PropertyGroup):
    """A plane in the link frame."""

    point: FloatVectorProperty(name="Point", description="A point of the plane, in the link frame", **PLACE)
    normal: FloatVectorProperty(
        name="Normal", description="Across the plane; a cut keeps the side it points to", default=(0, 0, 1), **WAY
    )


class SKIN_PG_number(bpy.types.PropertyGroup):
    """One coefficient."""

    value: FloatProperty(name="Value", description="A coefficient of the response", **PLAN)


class SKIN_PG_cover(bpy.types.PropertyGroup):
    """What of the mesh is covered with skin."""

    shell: EnumProperty(
        name="Shell",
        description="Which connected parts of the mesh belong to the cover",
        items=[("outer", "Outer", "Drop the parts that lie inside of larger ones"), ("all", "All", "Keep all parts")],
        **PLAN,
    )
    cuts: CollectionProperty(
        type=SKIN_PG_plane, name="Cuts", description="Planes that keep the side of their normal", **FIXED
    )


class SKIN_PG_grid(bpy.types.PropertyGroup):
    """Where the planes are."""

    kind: EnumProperty(
        name="Kind",
        description="How the planes lie",
        items=[
            ("tube", "Tube", "Planes across an axis and half-planes all round it"),
            ("auto", "Auto", "The smallest grid that keeps within a tolerance"),
            ("sector", "Sector", "A tube that goes only part of the way round"),
            ("across", "Across", "Two families of parallel planes across a sole or a palm"),
            ("planes", "Planes", "Planes one by one"),
        ],
        **PLAN,
    )
    region: EnumProperty(
        name="Region",
        description="Where the automatic grid lies",
        items=[
            ("tube", "Tube", "All round the axis"),
            ("sector", "Sector", "Part of the way round"),
            ("across", "Across", "Over a sole or a palm"),
        ],
        **PLAN,
    )
    n: IntProperty(name="U-Planes", description="Planes across the axis", default=10, min=1, max=1000, **PLAN)
    lines: IntProperty(
        name="V-Lines",
        description="Half-planes about the axis, two for each full plane; on a sole, planes along it",
        default=20,
        min=1,
        max=2000,
        **PLAN,
    )
    spacing: EnumProperty(
        name="Spacing",
        description="Where the planes and lines go",
        items=[
            ("auto", "Auto", "Planes and lines where they lower the error most"),
            ("uniform", "Uniform", "At equal heights and angles"),
            ("arc", "Arc", "Lines at equal lengths round the link, planes at equal heights"),
            ("curvature", "Curvature", "Lines closer where the link bends, planes at equal heights"),
        ],
        **PLAN,
    )
    tolerance: FloatProperty(
        name="Tolerance",
        description="Largest distance from surface to mesh that the smallest grid may have",
        subtype="DISTANCE",
        unit="LENGTH",
        default=2e-5,
        min=0,
        precision=6,
        **PLAN,
    )
    measure: EnumProperty(
        name="Measure",
        description="Which distance keeps within the tolerance",
        items=[("mean", "Mean", "The mean distance"), ("max", "Max", "The largest distance")],
        **PLAN,
    )
    auto_axis: BoolProperty(
        name="Automatic Axis", description="Find the axis from the sections of the mesh", default=True, **PLAN
    )
    point: FloatVectorProperty(name="Axis Point", description="A point of the axis, in the link frame", **PLACE)
    direction: FloatVectorProperty(
        name="Axis Direction", description="Where the link runs to", default=(0, 0, 1), **WAY
    )
    auto_margin: BoolProperty(name="Automatic Margin", description="Use all complete sections", default=True, **PLAN)
    margin: FloatProperty(
        name="Margin",
        description="Length left free at both ends",
        subtype="DISTANCE",
        unit="LENGTH",
        default=0.002,
        min=0,
        precision=5,
        **PLAN,
    )
    start: FloatProperty(name="From", description="First angle", subtype="ANGLE", default=-1.5, **PLAN)
    stop: FloatProperty(name="To", description="Last angle", subtype="ANGLE", default=1.5, **PLAN)
    normal: FloatVectorProperty(
        name="Outward", description="Where the face looks to, out of the robot", default=(0, 0, -1), **WAY
    )
    u: CollectionProperty(type=SKIN_PG_plane, name="U-Planes", description="Planes across the link", **FIXED)
    v: CollectionProperty(type=SKIN_PG_plane, name="V-Planes", description="Planes along the link", **FIXED)
    closed: BoolProperty(name="Closed", description="The v-planes go all the way round", default=True, **PLAN)


class SKIN_PG_result(bpy.types.PropertyGroup):
    """What the last fit gave."""

    key: StringProperty(description="What was fitted; empty before the first fit", **FIXED)
    outdated: BoolProperty(
        name="Outdated", description="The plan was changed after the fit", update=live.changed, **FIXED
    )
    mean: FloatProperty(name="Mean", description="Mean distance from surface to mesh", **LENGTH)
    max: FloatProperty(name="Max", description="Largest distance from surface to mesh", **LENGTH)
    hausdorff: FloatProperty(name="Hausdorff", description="Largest distance, both ways", **LENGTH)
    control_points: IntProperty(name="Control Points", description="Control points of the surface", **FIXED)
    taxels: IntProperty(name="Taxels", description="Taxels of all skins", **FIXED)
    doubts: StringProperty(
        name="Doubts", description="What to look at, an empty line after each, broken into lines", **FIXED
    )
    seconds: FloatProperty(name="Time", description="How long the fit took", unit="TIME_ABSOLUTE", precision=3, **FIXED)


class SKIN_PG_link(bpy.types.PropertyGroup):
    """The plan of one link; an object without a link name is no link."""

    link: StringProperty(name="Link", description="Name of the robot link, as in its URDF", **PLAN)
    mesh_file: StringProperty(name="Mesh File", description="Name under which plans refer to this mesh", **PLAN)
    cover: PointerProperty(type=SKIN_PG_cover, name="Cover", description="What of the mesh is covered with skin")
    grid: PointerProperty(type=SKIN_PG_grid, name="Grid", description="Where the planes are")
    degree: IntVectorProperty(
        name="Degree", description="Of the surface along u and v", size=2, default=(3, 3), min=2, max=5, **PLAN
    )
    chords: BoolProperty(
        name="Facets are Chords",
        description="Vertices lie on the true surface and facets inside of it: bulge over them",
        **PLAN,
    )
    skins: CollectionProperty(
        type=skin_properties.SKIN_PG_skin, name="Skins", description="Sheets and boards on the link", **FIXED
    )
    response: CollectionProperty(
        type=SKIN_PG_number,
        name="Response",
        description="Polynomial from intensity to newtons, lowest power first",
        **FIXED,
    )
    extra: StringProperty(
        name="Extra",
        description="Members of the plan that begin with x_, and a response that is more than a polynomial, as JSON",
        **FIXED,
    )
    result: PointerProperty(type=SKIN_PG_result, name="Result", description="What the last fit gave")
    live: BoolProperty(
        name="Live", description="Let surface and skin follow while the plan changes", update=live.switched, **FIXED
    )
    show_overlay: BoolProperty(name="Overlay", description="Draw the fitted skin of this link", default=True, **FIXED)
    layers: EnumProperty(
        name="Layers",
        description="What of the fitted skin is drawn",
        items=[
            ("ERROR", "Error", "The surface, from violet where it lies on the mesh to yellow where it is furthest off"),
            ("SURFACE", "Surface", "Curves of the surface"),
            ("CELLS", "Cells", "Outlines of the taxels"),
            ("NORMALS", "Normals", "Which way the taxels look"),
        ],
        default={"SURFACE", "CELLS", "NORMALS"},
        options={"ENUM_FLAG"},
    )


CLASSES = (
    SKIN_PG_plane,
    SKIN_PG_number,
    SKIN_PG_cover,
    SKIN_PG_grid,
    *skin_properties.CLASSES,
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
    """Take the plans away; what is saved in files stays there."""
    del bpy.types.Object.skin_calib
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
