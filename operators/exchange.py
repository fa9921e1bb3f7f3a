# SPDX-License-Identifier: GPL-3.0-or-later
"""Plans and calibrations, in from files and out to them."""

from pathlib import Path

import bpy
from bpy_extras.io_utils import ExportHelper, ImportHelper

from ..skin_calib_addon.blender import results, scene
from ..skin_calib_addon.calibration.file import save_calibration
from ..skin_calib_addon.errors import InvalidMesh, SkinCalibError
from ..skin_calib_addon.geometry.mesh import load_mesh, read_mesh, save_mesh
from ..skin_calib_addon.plan import load_plan, plan_document, plan_from, save_plan
from .fit import has_link


class SKIN_OT_import_plan(bpy.types.Operator, ImportHelper):
    """Open a skin plan: its mesh becomes an object that carries the plan"""

    bl_idname = "skin_calib.import_plan"
    bl_label = "Import Skin Plan"
    bl_options = {"REGISTER", "UNDO"}

    filename_ext = ".json"
    filter_glob: bpy.props.StringProperty(default="*.json", options={"HIDDEN"})

    def execute(self, context):
        try:
            plan = load_plan(self.filepath)
            load_mesh(plan.mesh, plan.unit)  # refuses a wrong unit
            mesh = read_mesh(plan.mesh)
        except SkinCalibError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        link = scene.add_link(context, mesh, plan.unit, plan.link)
        scene.write_plan(link, context.scene, plan_document(plan))
        for other in context.selected_objects:
            other.select_set(False)
        link.select_set(True)
        context.view_layer.objects.active = link
        return {"FINISHED"}


class SKIN_OT_export_plan(bpy.types.Operator, ExportHelper):
    """Write the plan of the active link, and its mesh beside it if the file there is another one"""

    bl_idname = "skin_calib.export_plan"
    bl_label = "Export Skin Plan"
    bl_options = {"REGISTER", "UNDO"}

    filename_ext = ".json"
    filter_glob: bpy.props.StringProperty(default="*.json", options={"HIDDEN"})

    @classmethod
    def poll(cls, context):
        return has_link(context) and bool(context.object.skin_calib.link)

    def execute(self, context):
        try:
            link = scene.active_link(context)
            mesh = scene.read_mesh(link, context)
            document = scene.plan_document(link, context.scene)
            target = Path(self.filepath).parent / document["mesh"]
            if not self._holds(target, mesh):
                target = target.with_suffix(".ply")
                document["mesh"] = target.name
                save_mesh(mesh, target)
            save_plan(plan_from(document), self.filepath)
        except SkinCalibError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        link.skin_calib.mesh_file = target.name
        self.report({"INFO"}, f"Wrote {self.filepath}")
        return {"FINISHED"}

    @staticmethod
    def _holds(path, mesh):
        try:
            return load_mesh(path, "m").sha256 == mesh.sha256
        except InvalidMesh:
            return False


class SKIN_OT_export_calibration(bpy.types.Operator, ExportHelper):
    """Write the calibration of the active link"""

    bl_idname = "skin_calib.export_calibration"
    bl_label = "Export Skin Calibration"
    bl_options = {"REGISTER"}

    filename_ext = ".json"
    filter_glob: bpy.props.StringProperty(default="*.json", options={"HIDDEN"})

    @classmethod
    def poll(cls, context):
        if not has_link(context) or results.find(context.object.skin_calib.result.number) is None:
            cls.poll_message_set("Fit the link first")
            return False
        return True

    def execute(self, context):
        try:
            link = scene.active_link(context)
            result = results.find(link.skin_calib.result.number)
            save_calibration(result.calibration, self.filepath)
        except SkinCalibError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        self.report({"INFO"}, f"Wrote {self.filepath}")
        return {"FINISHED"}


def draw_import(menu, _context):
    """Entry in File > Import."""
    menu.layout.operator(SKIN_OT_import_plan.bl_idname, text="Skin Plan (.json)")


def draw_export(menu, _context):
    """Entries in File > Export."""
    menu.layout.operator(SKIN_OT_export_plan.bl_idname, text="Skin Plan (.json)")
    menu.layout.operator(SKIN_OT_export_calibration.bl_idname, text="Skin Calibration (.json)")


CLASSES = (SKIN_OT_import_plan, SKIN_OT_export_plan, SKIN_OT_export_calibration)
