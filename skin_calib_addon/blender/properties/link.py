# SPDX-License-Identifier: GPL-3.0-or-later
"""The plan as properties of an object, saved in the .blend; each group has one member of the plan file."""

from typing import Any

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, PointerProperty, StringProperty

from ...plan import keys
from ..live import updates
from . import grid as grid_properties
from . import inspect as inspect_properties
from . import skin as skin_properties
from . import warning
from .millimetres import with_millimetres
from .of_keys import of_keys
from .options import FILE, FIXED, PLAN, choice, flag, length, many, number, text, whole


class SKIN_PG_number(bpy.types.PropertyGroup):
    """One coefficient."""

    value: FloatProperty(name="Value", description="A coefficient of the response", **PLAN)


@with_millimetres
class SKIN_PG_result(bpy.types.PropertyGroup):
    """The result of the last fit."""

    key: text(description="Key of the plan and mesh that were fitted; empty before the first fit")
    outdated: flag(name="Outdated", description="The plan was changed after the fit", update=updates.changed)
    mean: length(
        name="Mean", description="Mean distance from surface to mesh; of several surfaces, that of the least exact one"
    )
    max: length(
        name="Max",
        description="Largest distance from surface to mesh at the points of a grid; between them it can be larger",
    )
    hausdorff: length(
        name="Hausdorff",
        description="Largest distance of these points, and of points of faces of the mesh that are parallel to the "
        "surface, at any distance",
    )
    control_points: whole(name="Control Points", description="Control points of the surface")
    taxels: whole(name="Taxels", description="Taxels of all skins")
    warnings: many(type=warning.SKIN_PG_warning, name="Warnings", description="Warnings of the last fit")
    warning_index: whole(name="Warning", description="Which warning is shown in full; the worst one comes first", min=0)
    seconds: number(name="Time", description="Duration of the fit", unit="TIME_ABSOLUTE", precision=3)


def _open(label: str, default: bool = True) -> Any:
    """Return the property that keeps whether a step is open."""
    return BoolProperty(name=label, description=f"Whether {label} is open", default=default, **FIXED)


class SKIN_PG_steps(bpy.types.PropertyGroup):
    """Which steps of the work are open in the sidebar."""

    link: _open("Link")
    mesh: _open("Mesh")
    warnings: _open("List of Warnings", False)
    reasons: _open("Proposal", False)
    cut: _open("Cut", False)
    grid: _open("Grid")
    fit: _open("Fit", False)
    skin: _open("Skin", False)
    export: _open("Export")
    more_grid: _open("More", False)
    more_skin: _open("More", False)
    closed: flag(name="Closed", description="Whether the first fit has closed the steps before the skin")

    def advance(self) -> None:
        """Close the steps before the skin, and open that one, after the first fit; later the author does."""
        if not self.closed:
            self.closed = self.skin = True
            self.link = self.mesh = self.cut = self.grid = self.fit = False


@of_keys(keys.PLAN, keys.SURFACE)
class SKIN_PG_link(bpy.types.PropertyGroup):
    """The plan of one link; an object without a link name is not a link."""

    mesh_file: text(name="Mesh File", description="Name of the mesh file in exported plans")
    urdf: StringProperty(
        name="URDF",
        description="The robot of this link. With it, the mesh is in the link frame, wherever the object is",
        **FILE,
    )
    proposed: whole(name="Proposed Taxels", description="Taxels of the proposal in these properties; 0: none is there")
    proposed_area: text(
        name="Proposed Area", description="Area of the cells of the proposal, and of what is free, in words"
    )
    refusal: text(name="Refusal", description="Why the last import, proposal or fit was refused; empty: it was not")
    diagnosis: PointerProperty(
        type=warning.SKIN_PG_diagnosis, name="Diagnosis", description="The result of the last check of the mesh"
    )
    cover: PointerProperty(
        type=grid_properties.SKIN_PG_cover, name="Cover", description="What of the mesh is covered with skin"
    )
    grid: PointerProperty(type=grid_properties.SKIN_PG_grid, name="Grid", description="Where planes and lines are")
    skins: many(type=skin_properties.SKIN_PG_skin, name="Skins", description="Sheets and boards on the link")
    response: many(
        type=SKIN_PG_number, name="Response", description="Polynomial from readings to newtons, lowest power first"
    )
    other_surfaces: text(
        name="Other Surfaces",
        description="The surfaces of the plan as JSON, with null for the one that the properties have; empty: only one",
    )
    extra: text(
        name="Extra",
        description="Members of the plan that begin with x_, modalities, and a response that is no polynomial, as JSON",
    )
    steps: PointerProperty(type=SKIN_PG_steps, name="Steps", description="Which steps of the work are open")
    result: PointerProperty(type=SKIN_PG_result, name="Result", description="The result of the last fit")
    held: choice(
        name="Handles",
        description="Which planes have handles; they tilt the selected one",
        items=[("CUT", "Cuts", "A cut"), ("U", "U-Planes", "A u-plane"), ("V", "V-Planes", "A v-plane")],
    )
    live: flag(name="Live", description="Fit surface and skin while the plan changes", update=updates.switched)
    show_overlay: flag(name="Overlay", description="Draw the fitted skin of this link", default=True)
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


def register():
    """Give every object a plan."""
    bpy.types.Object.skin_calib = PointerProperty(
        type=SKIN_PG_link, name="Skin", description="Plan and result of a robot link"
    )


def unregister():
    """Remove the plans from objects; files keep them."""
    del bpy.types.Object.skin_calib
