# SPDX-License-Identifier: GPL-3.0-or-later
"""Warnings, and the result of the check of a mesh, as properties."""

import bpy

from .options import choice, flag, many, number, text, vector, whole


class SKIN_PG_warning(bpy.types.PropertyGroup):
    """One thing to look at; the members are those of `common.warnings.Warning`."""

    code: text(name="Code", description="Stable name of the kind of warning")
    severity: choice(
        name="Severity",
        description="How much it matters",
        items=[
            ("note", "Note", "Information"),
            ("warning", "Warning", "Look at it before you trust the result"),
            ("error", "Error", "The result cannot be used"),
        ],
    )
    message: text(name="Message", description="What is wrong, and where")
    advice: text(name="Advice", description="What to do")
    value: number(name="Value", description="The figure of the message, in SI units")
    has_point: flag(name="Has Point", description="Whether the place is known as a point")
    point: vector(name="Point", description="Place in the link frame [m]")
    names: text(name="Names", description="Planes or rows near the place")
    skin: text(name="Skin", description="Name of the skin")
    surface: text(name="Surface", description="Name of the surface, of several")


class SKIN_PG_diagnosis(bpy.types.PropertyGroup):
    """The result of the last check of the mesh."""

    key: text(description="Key of the mesh that was checked; empty before the first check")
    outdated: flag(name="Outdated", description="The plan was changed after the check")
    findings: many(type=SKIN_PG_warning, name="Findings", description="What the check of the mesh found")
    inner: whole(name="Inner Parts", description="Connected parts that are mostly within the convex hull of others")
    edges: whole(name="Edges", description="Edges of holes, and edges with more than two faces")
