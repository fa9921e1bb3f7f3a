# SPDX-License-Identifier: GPL-3.0-or-later
"""Links from mesh files and robots; their unit; defects of their mesh."""

import bpy
import numpy as np

from ..skin_calib_addon.blender.live import diagnoses
from ..skin_calib_addon.blender.scene import link_meshes, link_objects, showing
from ..skin_calib_addon.common.errors import UnknownLink, counted
from ..skin_calib_addon.common.findings import show
from ..skin_calib_addon.geometry.mesh.defects import edges_at
from ..skin_calib_addon.geometry.mesh.triangle_mesh import METRES_PER_UNIT, read_mesh
from ..skin_calib_addon.geometry.mesh.units import UNIT_NAMES, is_plausible, likely_unit
from ..skin_calib_addon.robot.link_mesh import USES, axis_warning, load_link, meshes_of
from ..skin_calib_addon.robot.urdf import read_robot
from .base import Operator, busy, no_mesh, not_editable
from .files import Import
from .working import Working

_choices: list[tuple[str, str, str]] = []  # items of the search in the open URDF; Blender does not keep their texts


def add_link(operator, context, mesh, unit, name, file, warning=""):
    """Add a link as the active object; report the warning, and its size, as a warning where links do not have it."""
    link = link_objects.add_link(context, mesh, unit, name)
    link.skin_calib.link, link.skin_calib.mesh_file = name, file
    hidden = showing.present(context, [link, link.parent])
    side = float(np.ptp(mesh.vertices, axis=0).max()) * METRES_PER_UNIT[unit]
    wrong = not is_plausible(side)
    size = f"{name}: {counted(len(mesh.faces), 'face')} in {UNIT_NAMES[unit]}, {side * 1e3:.4g} mm long"
    ending = ". Check the unit" if wrong else f". {hidden}" if hidden else ""
    operator.report({"WARNING"} if wrong else {"INFO"}, size + ending)
    if warning:
        operator.report({"WARNING"}, warning)


class ImportLink(Import):
    """Adds the mesh that was read as a link; ``reader`` returns the arguments of ``add_link``."""

    use = staticmethod(add_link)


class SKIN_OT_import_mesh(ImportLink, Operator):
    """Open the mesh of a robot link: it becomes a link with the name of the file"""

    bl_label = "Import Link Mesh"

    filter_glob: bpy.props.StringProperty(default="*.stl;*.ply;*.obj;*.off;*.dae;*.glb", options={"HIDDEN"})
    unit: bpy.props.EnumProperty(
        name="Unit",
        description="Unit of the numbers in the file",
        items=[
            ("auto", "Automatic", "Metres or millimetres: the unit in which the mesh has the size of a robot link"),
            *((unit, name.capitalize(), f"The file has {name}") for unit, name in UNIT_NAMES.items()),
        ],
    )

    def reader(self, path):
        chosen = self.unit

        def read():
            mesh = read_mesh(path)
            unit = likely_unit(float(np.ptp(mesh.vertices, axis=0).max())) if chosen == "auto" else chosen
            return mesh, unit, path.stem, path.name, axis_warning(path)

        return read


class FromRobot(ImportLink):
    """Adds a link of a URDF, with all its meshes as one, in metres in the link frame."""

    def reader_of(self, path, robot, link, use):
        """Return the function that reads a link."""
        files = meshes_of(robot, link, use)
        alone = len(files) == 1 and not files[0].moved
        file = files[0].file if alone else path.name if use == "visual" else ""
        warning = axis_warning(path, robot, [link], use)
        return lambda: (load_link(path, robot, link, use), "m", link, file, warning)


class SKIN_OT_import_urdf(FromRobot, Operator):
    """Open a link of a robot, with its meshes in the link frame as in the URDF"""

    bl_label = "Import Link of a Robot"

    filter_glob: bpy.props.StringProperty(default="*.urdf;*.xml", options={"HIDDEN"})
    link: bpy.props.StringProperty(name="Link", description="Name of the link; empty: choose it from a list")
    mesh: bpy.props.EnumProperty(
        name="Mesh",
        description="Which meshes of the link",
        items=[
            ("visual", "Visual", "The meshes for display"),
            ("collision", "Collision", "The meshes for collisions, often coarser"),
        ],
    )

    def reader(self, path):
        robot = read_robot(path)
        if self.link:
            return self.reader_of(path, robot, self.link, self.mesh)
        choices = [
            (name, use) for name, meshes in robot.links.items() for use in USES if any(m.use == use for m in meshes)
        ]
        if len(choices) == 1:
            return self.reader_of(path, robot, *choices[0])
        if not choices:
            raise UnknownLink(f"No link of {path.name} has a mesh. Boxes and cylinders cannot carry skin.")
        if not self.by_hand:
            names = ", ".join(dict.fromkeys(show(name) for name, _ in choices))
            raise UnknownLink(f"{path.name} has several links with a mesh. Name one of {names}.")
        _choices[:] = [(f"{use} {name}", f"{name}: {use}", f"The {use} mesh of {name}") for name, use in choices]
        bpy.ops.skin_calib.choose_link("INVOKE_DEFAULT", filepath=self.filepath)
        return None


class SKIN_OT_choose_link(FromRobot, Operator):
    """Choose a link of this robot: type a part of its name"""

    bl_label = "Choose Link"
    bl_property = "choice"

    choice: bpy.props.EnumProperty(
        name="Link", description="Link, and which of its meshes", items=lambda _self, _context: _choices
    )

    def invoke(self, context, _event):
        self.by_hand = True
        context.window_manager.invoke_search_popup(self)
        return {"RUNNING_MODAL"}

    def reader(self, path):
        use, _, link = self.choice.partition(" ")
        return self.reader_of(path, read_robot(path), link, use)


class SKIN_OT_scale_to_unit(Operator):
    """Scale the object, not its mesh, because its numbers have another unit than assumed"""

    bl_label = "Scale to Unit"
    blocked_by = (no_mesh,)

    unit: bpy.props.EnumProperty(
        name="Unit",
        description="Unit of the mesh's numbers",
        items=[
            ("mm", "Millimetres", "The numbers are millimetres, not metres: a thousandth of the size"),
            ("cm", "Centimetres", "The numbers are centimetres, not metres: a hundredth of the size"),
            ("in", "Inches", "The numbers are inches, not metres: 0.0254 times the size"),
            ("m", "Metres", "The numbers are metres, not millimetres: a thousand times the size"),
        ],
    )

    def act(self, context):
        link = context.object
        factor = 1 / METRES_PER_UNIT["mm"] if self.unit == "m" else METRES_PER_UNIT[self.unit]
        link.scale = [factor * s for s in link.scale]
        link.skin_calib.result.outdated = True
        context.view_layer.update()
        side = link_objects.longest_side(link, context.scene)
        link.skin_calib.imported_box = [factor * x for x in link.skin_calib.imported_box]
        self.report({"INFO"}, f"{link.name} is now {side * 1e3:.4g} mm long")


class SKIN_OT_diagnose(Working, Operator):
    """Check the mesh, with its modifiers, for what affects the fit, and try the fit at these settings; Esc stops it"""

    bl_label = "Check Mesh"
    blocked_by = (no_mesh, busy)

    doing = "Checking"

    def task(self, context, link):
        examine = diagnoses.examination(link, context)
        attempt = diagnoses.trial(link, context)
        return lambda begin: (examine(begin), attempt(begin))

    def store(self, context, link, result):
        found, foreseen = result
        diagnoses.store(link, found, foreseen)
        findings = diagnoses.not_repeated((*found.findings(), foreseen))
        serious = [finding.message for finding in findings if finding.severity != "note"]
        self.report({"INFO"}, f"{link.name}: {'; '.join(serious) or 'found nothing that affects the fit'}")


class SKIN_OT_show_defects(Operator):
    """Select the edges of holes, and those with more than two faces, in Edit Mode"""

    bl_label = "Select Holes and Bad Edges"
    blocked_by = (no_mesh, not_editable)

    def act(self, context):
        link = context.object
        if link.mode == "EDIT":
            link.update_from_editmode()
        found = diagnoses.examination(link, context)()
        vertices, edges = link_meshes.read_edges(link, context)
        chosen = edges_at(found.mesh.vertices[found.edges()], vertices, edges)
        if not chosen.any():
            made = "modifiers make them" if len(found.edges()) else "the mesh has none"
            self.report({"INFO"}, f"{link.name}: no edge to select; {made}")
            return {"CANCELLED"}
        self.select(context, link.data, edges, chosen)
        self.report({"INFO"}, f"{link.name}: {counted(int(chosen.sum()), 'edge')} selected")
        return {"FINISHED"}

    def select(self, context, data, edges, chosen):
        """Select these edges and nothing else, in Edit Mode."""
        bpy.ops.object.mode_set(mode="OBJECT")
        at_end = np.zeros(len(data.vertices), bool)
        at_end[edges[chosen]] = True
        data.vertices.foreach_set("select", at_end)
        data.edges.foreach_set("select", chosen)
        data.polygons.foreach_set("select", np.zeros(len(data.polygons), bool))
        context.tool_settings.mesh_select_mode = (False, True, False)
        bpy.ops.object.mode_set(mode="EDIT")
