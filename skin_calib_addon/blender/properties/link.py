# SPDX-License-Identifier: GPL-3.0-or-later
"""The plan as properties of an object, saved in the .blend; each group has one member of the plan file."""

from collections.abc import Callable
from typing import Any

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, PointerProperty, StringProperty

from ...common.errors import InvalidPlan
from ...plan import keys
from ..live import updates
from ..overlay import drawing
from ..scene import skins
from ..scene.fields import read_cells
from . import inspect as inspect_properties
from . import warning
from .millimetres import with_millimetres
from .of_keys import items_of, of_keys
from .options import FILE, FIXED, PLAN, choice, flag, length, many, number, outdate, text, vector, whole


@of_keys(keys.PLANE)
class SKIN_PG_plane(bpy.types.PropertyGroup):
    """A plane in the link frame."""


def _give_handles(family: str) -> Callable[[Any, Any], None]:
    """Return an update that gives the handles to the plane that is selected in a list."""

    def give(group: Any, _context: Any) -> None:
        group.id_data.skin_calib.held = family

    return give


@of_keys(keys.COVER)
class SKIN_PG_cover(bpy.types.PropertyGroup):
    """What of the mesh is covered with skin."""

    cut_index: whole(name="Cut", description="Which cut has the handles", min=0, update=_give_handles("CUT"))


@of_keys(*keys.GRIDS.values())
class SKIN_PG_grid(bpy.types.PropertyGroup):
    """Where the planes are."""

    kind: EnumProperty(
        name="Kind", description="How planes and lines are given", items=items_of(keys.GRID_KINDS), **PLAN
    )
    region: EnumProperty(
        name="Region", description="What the automatic grid covers", items=items_of(keys.GRID_REGIONS), **PLAN
    )
    u_index: whole(name="U-Plane", description="Which u-plane is selected", min=0, update=_give_handles("U"))
    v_index: whole(name="V-Plane", description="Which v-plane is selected", min=0, update=_give_handles("V"))


def _check_cells(skin: Any, context: Any) -> None:
    outdate(skin, context)
    try:
        skin.cells_wrong = not read_cells(skin.cells)
    except InvalidPlan:
        skin.cells_wrong = True


def _turn(skin: Any) -> float:
    frame = drawing.frame_of(skin)
    return skins.row_angle(skin, frame) if frame else 0.0


def _set_turn(skin: Any, angle: float) -> None:
    frame = drawing.frame_of(skin)
    if frame:
        skins.turn_rows(skin, frame, angle)


@of_keys(keys.LANDMARK)
class SKIN_PG_landmark(bpy.types.PropertyGroup):
    """A cell that is pinned to a point."""


@of_keys(keys.ZONE)
class SKIN_PG_zone(bpy.types.PropertyGroup):
    """A disc that boards must not cover."""


@of_keys(keys.SINGLE_TAXEL)
class SKIN_PG_single_taxel(bpy.types.PropertyGroup):
    """A taxel that differs from the others of its skin."""


@of_keys(*keys.SKINS_OF.values())
class SKIN_PG_skin(bpy.types.PropertyGroup):
    """A sheet of taxels, hexagonal boards, or taxels of a file."""

    kind: EnumProperty(name="Kind", description="What the skin is made of", items=items_of(keys.SKIN_KINDS), **PLAN)
    zone_group: StringProperty(
        name="Vertex Group",
        description="Boards stay off the faces of this vertex group, as it is at each fit. A plan file has excluded "
        "zones over these faces",
        **PLAN,
    )
    turn: FloatProperty(
        name="Direction",
        description="Angle from the lines of the surface, in v, to the row of the origin, counter-clockwise seen from "
        "outside. The plan keeps the direction as a vector",
        subtype="ANGLE",
        precision=3,
        step=100,
        get=_turn,
        set=_set_turn,
        **FIXED,
    )
    opened: flag(name="Open", description="Show what this skin has, in a list of several")
    cells: text(
        name="Cells",
        description="The boards as q,r with spaces between: 0,0 is the root, q counts along its row, r along the "
        "direction 60 degrees to its left",
        update=_check_cells,
    )
    cells_wrong: flag(description="The list of cells is empty or cannot be read", default=True)


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
    cells: number(name="Cells", description="Area of the cells of all skins, in square metres")
    seen: number(name="Visible Area", description="Area of the link that can be seen from outside, in square metres")
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
    urdf: StringProperty(name="URDF", description="The robot of this link", **FILE)
    zone_of: text(name="Zone Of", description="The link that has no skin inside this empty; empty: it is no zone")
    zones_shown: flag(description="Whether the scene has the zones of the robot of this link")
    imported_box: vector(
        name="Imported Box",
        description="Least and largest coordinates of the mesh in the link frame when it was imported, in metres; "
        "zeros: the object was not imported",
        size=6,
    )
    proposed: whole(name="Proposed Taxels", description="Taxels of the proposal in these properties; 0: none is there")
    proposed_area: text(
        name="Proposed Area", description="Area of the cells of the proposal, and of what is free, in words"
    )
    refusal: text(name="Refusal", description="Why the last import, proposal or fit was refused; empty: it was not")
    diagnosis: PointerProperty(
        type=warning.SKIN_PG_diagnosis, name="Diagnosis", description="The result of the last check of the mesh"
    )
    cover: PointerProperty(type=SKIN_PG_cover, name="Cover", description="What of the mesh is covered with skin")
    grid: PointerProperty(type=SKIN_PG_grid, name="Grid", description="Where planes and lines are")
    skins: many(type=SKIN_PG_skin, name="Skins", description="Sheets and boards on the link")
    skin_index: whole(name="Skin", description="Which of many skins is shown", min=0)
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
