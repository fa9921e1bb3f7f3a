# SPDX-License-Identifier: GPL-3.0-or-later
"""What of the mesh is covered and where the planes are, as properties."""

import bpy
from bpy.props import (
    BoolProperty,
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    FloatVectorProperty,
    IntProperty,
)

from .options import FIXED, PLACE, PLAN, WAY


class SKIN_PG_plane(bpy.types.PropertyGroup):
    """A plane in the link frame."""

    point: FloatVectorProperty(name="Point", description="A point of the plane, in the link frame", **PLACE)
    normal: FloatVectorProperty(
        name="Normal", description="Across the plane; a cut keeps the side it points to", default=(0, 0, 1), **WAY
    )


def _hold(family):
    """An update that gives the handles to the plane that has been chosen in a list."""

    def hold(group, _context):
        group.id_data.skin_calib.held = family

    return hold


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
    cut_index: IntProperty(name="Cut", description="Which cut has the handles", min=0, update=_hold("CUT"), **FIXED)


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
    u_index: IntProperty(name="U-Plane", description="Which u-plane is chosen", min=0, update=_hold("U"), **FIXED)
    v_index: IntProperty(name="V-Plane", description="Which v-plane is chosen", min=0, update=_hold("V"), **FIXED)
    closed: BoolProperty(name="Closed", description="The v-planes go all the way round", default=True, **PLAN)


CLASSES = (SKIN_PG_plane, SKIN_PG_cover, SKIN_PG_grid)
