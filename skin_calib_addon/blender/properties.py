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

FIXED: set[str] = set()  # no property of a plan is animatable


class SKIN_PG_plane(bpy.types.PropertyGroup):
    """A plane in the link frame."""

    point: FloatVectorProperty(name="Point", subtype="TRANSLATION", unit="LENGTH", precision=5, options=FIXED)
    normal: FloatVectorProperty(name="Normal", subtype="XYZ", default=(0, 0, 1), precision=5, options=FIXED)


class SKIN_PG_number(bpy.types.PropertyGroup):
    """One coefficient."""

    value: FloatProperty(name="Value", options=FIXED)


class SKIN_PG_cover(bpy.types.PropertyGroup):
    """What of the mesh is covered with skin."""

    shell: EnumProperty(
        name="Shell",
        description="Which connected parts of the mesh belong to the cover",
        items=[("outer", "Outer", "Drop the parts that lie inside of larger ones"), ("all", "All", "Keep all parts")],
        options=FIXED,
    )
    cuts: CollectionProperty(type=SKIN_PG_plane, name="Cuts", description="Planes that keep the side of their normal")


class SKIN_PG_grid(bpy.types.PropertyGroup):
    """Where the planes are."""

    kind: EnumProperty(
        name="Kind",
        description="How the planes lie",
        items=[
            ("tube", "Tube", "Planes across an axis and half-planes all round it"),
            ("sector", "Sector", "A tube that goes only part of the way round"),
            ("across", "Across", "Two families of parallel planes across a sole or a palm"),
            ("planes", "Planes", "Planes one by one"),
        ],
        options=FIXED,
    )
    n: IntProperty(name="U-Planes", description="Planes across the axis", default=10, min=1, max=1000, options=FIXED)
    lines: IntProperty(
        name="V-Lines",
        description="Half-planes about the axis, two for each full plane; on a sole, planes along it",
        default=20,
        min=1,
        max=2000,
        options=FIXED,
    )
    auto_axis: BoolProperty(
        name="Automatic Axis", description="Find the axis from the sections of the mesh", default=True, options=FIXED
    )
    point: FloatVectorProperty(
        name="Axis Point",
        description="A point of the axis",
        subtype="TRANSLATION",
        unit="LENGTH",
        precision=5,
        options=FIXED,
    )
    direction: FloatVectorProperty(
        name="Axis Direction",
        description="Where the link runs to",
        subtype="XYZ",
        default=(0, 0, 1),
        precision=5,
        options=FIXED,
    )
    auto_margin: BoolProperty(
        name="Automatic Margin", description="Use all complete sections", default=True, options=FIXED
    )
    margin: FloatProperty(
        name="Margin",
        description="Length left free at both ends",
        subtype="DISTANCE",
        unit="LENGTH",
        default=0.002,
        min=0,
        precision=5,
        options=FIXED,
    )
    start: FloatProperty(name="From", description="First angle", subtype="ANGLE", default=-1.5, options=FIXED)
    stop: FloatProperty(name="To", description="Last angle", subtype="ANGLE", default=1.5, options=FIXED)
    normal: FloatVectorProperty(
        name="Outward",
        description="Where the face looks to, out of the robot",
        subtype="XYZ",
        default=(0, 0, -1),
        precision=5,
        options=FIXED,
    )
    u: CollectionProperty(type=SKIN_PG_plane, name="U-Planes")
    v: CollectionProperty(type=SKIN_PG_plane, name="V-Planes")
    closed: BoolProperty(name="Closed", description="The v-planes go all the way round", default=True, options=FIXED)


class SKIN_PG_skin(bpy.types.PropertyGroup):
    """A sheet of taxels."""

    name: StringProperty(name="Name", description="Name of the patch; ids of taxels begin with it", default="skin")
    rows: IntProperty(name="Rows", default=6, min=1, max=1000, options=FIXED)
    columns: IntProperty(name="Columns", default=22, min=1, max=1000, options=FIXED)
    pitch: FloatVectorProperty(
        name="Pitch",
        description="From row to row, and from column to column",
        size=2,
        unit="LENGTH",
        default=(0.01, 0.01),
        min=1e-5,
        precision=5,
        options=FIXED,
    )
    centred: BoolProperty(name="Centred", description="Centre the sheet on the surface", default=True, options=FIXED)
    origin: FloatVectorProperty(
        name="Origin",
        description="Where the centre of cell (0, 0) lies on the link",
        subtype="TRANSLATION",
        unit="LENGTH",
        precision=5,
        options=FIXED,
    )
    direction: FloatVectorProperty(
        name="Direction",
        description="Where the rows run to",
        subtype="XYZ",
        default=(0, 1, 0),
        precision=5,
        options=FIXED,
    )
    first_channel: IntProperty(name="First Channel", description="Channel of cell (0, 0)", min=0, options=FIXED)


class SKIN_PG_result(bpy.types.PropertyGroup):
    """What the last fit gave; number 0 is none."""

    number: IntProperty(options={"HIDDEN"})
    mean: FloatProperty(name="Mean", description="Mean distance from surface to mesh", unit="LENGTH", precision=6)
    max: FloatProperty(name="Max", description="Largest distance from surface to mesh", unit="LENGTH", precision=6)
    hausdorff: FloatProperty(name="Hausdorff", description="Largest distance, both ways", unit="LENGTH", precision=6)
    control_points: IntProperty(name="Control Points")
    taxels: IntProperty(name="Taxels")
    seconds: FloatProperty(name="Time", unit="TIME_ABSOLUTE", precision=3)


class SKIN_PG_link(bpy.types.PropertyGroup):
    """The plan of one link; an object without a link name is no link."""

    link: StringProperty(name="Link", description="Name of the robot link, as in its URDF")
    mesh_file: StringProperty(name="Mesh File", description="Name under which plans refer to this mesh")
    cover: PointerProperty(type=SKIN_PG_cover)
    grid: PointerProperty(type=SKIN_PG_grid)
    degree: IntVectorProperty(
        name="Degree", description="Of the surface along u and v", size=2, default=(3, 3), min=2, max=5, options=FIXED
    )
    skins: CollectionProperty(type=SKIN_PG_skin)
    response: CollectionProperty(type=SKIN_PG_number)
    result: PointerProperty(type=SKIN_PG_result)
    show_overlay: BoolProperty(name="Overlay", description="Draw surface, taxels and normals", default=True)


CLASSES = (
    SKIN_PG_plane,
    SKIN_PG_number,
    SKIN_PG_cover,
    SKIN_PG_grid,
    SKIN_PG_skin,
    SKIN_PG_result,
    SKIN_PG_link,
)


def register():
    """Give every object a plan."""
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    bpy.types.Object.skin_calib = PointerProperty(type=SKIN_PG_link)


def unregister():
    """Take the plans away; what is saved in files stays there."""
    del bpy.types.Object.skin_calib
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
