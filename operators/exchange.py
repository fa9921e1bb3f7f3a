# SPDX-License-Identifier: GPL-3.0-or-later
"""Plans and calibrations, read from files and written to them."""

from contextlib import suppress
from dataclasses import replace
from itertools import count
from pathlib import Path

import bpy
from bpy_extras.io_utils import ExportHelper

from ..skin_calib_addon.blender.scene import link_meshes, link_objects, plans, results, robots, showing, skins
from ..skin_calib_addon.blender.scene.units import metres_per_unit
from ..skin_calib_addon.calibration.exchange import FORMATS, WRITABLE
from ..skin_calib_addon.calibration.file import save_calibration
from ..skin_calib_addon.common.atomic_file import check_writable, is_same_file, write_bytes_safely
from ..skin_calib_addon.common.errors import OutputError, SkinCalibError, counted
from ..skin_calib_addon.geometry.mesh.triangle_mesh import (
    METRES_PER_UNIT,
    TriangleMesh,
    check_size,
    read_mesh,
    save_mesh,
)
from ..skin_calib_addon.pipeline.sources import taxel_files
from ..skin_calib_addon.plan import load_plan, named_from, save_plan
from ..skin_calib_addon.robot.link_mesh import is_urdf, load_plan_mesh
from ..skin_calib_addon.robot.urdf import read_robot
from .base import KeepsLink, Operator, busy, no_link
from .files import Import


def add_plan(operator, context, plan, mesh):
    """Add a plan and its mesh as the active object."""
    link = link_objects.add_link(context, mesh, plan.unit, plan.link)
    plans.write_plan(link, context.scene, plan)
    hidden = showing.present(context, [link, link.parent])
    if hidden:
        operator.report({"INFO"}, hidden)
    if not plans.is_kept(plan, plans.read_plan(link, context.scene)):
        operator.report({"WARNING"}, "Numbers of the plan with more than seven digits were rounded")


class SKIN_OT_import_plan(Import, Operator):
    """Open a skin plan: its mesh becomes an object that has the plan"""

    bl_label = "Import Skin Plan"

    filename_ext = ".json"
    filter_glob: bpy.props.StringProperty(default="*.json", options={"HIDDEN"})

    use = staticmethod(add_plan)

    def reader(self, path):
        plan = load_plan(path)
        plans.check_numbers(plan, metres_per_unit(bpy.context.scene))

        def read():
            if is_urdf(plan.mesh):
                return plan, load_plan_mesh(plan)
            mesh = read_mesh(plan.mesh)
            in_metres = TriangleMesh(mesh.vertices * METRES_PER_UNIT[plan.unit], mesh.faces)
            check_size(in_metres, plan.unit, plan.mesh.name)
            return plan, mesh

        return read


class Export(KeepsLink, ExportHelper):
    """Writes a file about the active link; the browser proposes the name of the link, in the last folder."""

    blocked_by = (no_link, busy)
    filename_ext = ".json"
    filter_glob: bpy.props.StringProperty(default="*.json", options={"HIDDEN"})

    def invoke(self, context, event):
        name = bpy.path.clean_name(context.object.skin_calib.link) + self.ending
        self.filepath = str(Path(self.filepath or bpy.data.filepath or Path.home() / name).with_name(name))
        return super().invoke(context, event)

    def act(self, context):
        path = Path(bpy.path.abspath(self.filepath))
        check_kept(context.object, context.scene, path)
        warnings = self.write(context, path)
        self.report({"INFO"}, f"Wrote {path}")
        for warning in warnings:  # last, because the window shows what was reported last
            self.report({"WARNING"}, warning)


def check_kept(link, scene, path):
    """Raise OutputError if a file to write would replace a mesh, a robot with meshes, or a source of a link."""
    urdf, mesh = robots.urdf_of(link), path.parent / link.skin_calib.mesh_file
    files = (mesh, *taxel_files(plans.read_plan(link, scene)), *([urdf] if urdf else []))
    if path.is_file() and (_is_source(path) or any(is_same_file(path, file) for file in files)):
        raise OutputError(f"{path} is a mesh, a robot, or a file of this link. Choose another name.")


def _is_source(path):
    """Return whether a plan can have a file as its mesh: taxels that were exported as URDF have no meshes."""
    with suppress(SkinCalibError):
        return len(read_mesh(path).faces) > 0
    with suppress(SkinCalibError):
        return any(read_robot(path).links.values())
    return False


def fit_to_write(context):
    """Fit the active link as it is now, and return its calibration and what is to be reported about it."""
    link = context.object
    plan, mesh = plans.plan_to_write(link, context.scene), link_meshes.read_mesh(link, context)
    was_current = results.is_current(link)
    results.verify(link, context.scene, mesh.sha256)
    _, result = results.fit(plan, mesh)
    calibration, warnings, is_current = result.calibration_of(plan), [], results.is_current(link)
    if found := calibration.warnings:  # a pop-up with all of them in full covers the window
        listed = "The tab Skin lists them." if is_current else "Press Fit: the tab Skin then lists them."
        warnings.append(f"{counted(len(found), 'warning')} of the fit. {listed}")
    if was_current and not is_current:
        warnings.append("The link or a taxel file has changed since the fit. This file is up to date; fit again.")
    if not any(patch.taxels.ids for patch in calibration.patches):
        warnings.append("The file has no taxels. Add a skin to the link, then export again.")
    others = link_objects.namesakes(link, context.scene)
    if others:
        warnings.append(f"{others[0]} has the link name of {link.name}, too. Rename one of them.")
    return calibration, warnings


def write_plan(context, link, path):
    """Write the plan of a link, and return it. If no file has its mesh, the mesh is written next to the plan."""
    check_writable(path)  # before the mesh is written
    mesh = link_meshes.read_mesh(link, context)
    plan = plans.plan_to_write(link, context.scene)
    urdf = robots.urdf_of(link)
    files = [path.parent / plan.mesh, *([urdf] if urdf else [])]
    target = next((file for file in files if _has_mesh(file, plan, mesh)), None)
    if target is None:
        target = _free(path, plan, mesh)
        save_mesh(mesh, target)
    plan = replace(plan, mesh=target)
    save_plan(replace(named_from(plan, path.parent), skins=skins.seen_from(path.parent, plan.skins)), path)
    if link.skin_calib.mesh_file != target.name:
        link.skin_calib.mesh_file = target.name
    return plan


def _free(path, plan, mesh):
    """Return a path for the mesh next to the plan where it overwrites no other mesh."""
    stem = path.name.removesuffix(".json").removesuffix(".plan")
    names = (f"{stem}.ply" if k == 1 else f"{stem}_{k}.ply" for k in count(1))
    paths = (path.with_name(name) for name in names)
    return next(path for path in paths if not path.exists() or _has_mesh(path, plan, mesh))


def _has_mesh(path, plan, mesh):
    try:
        return load_plan_mesh(replace(plan, mesh=path)).sha256 == mesh.sha256
    except SkinCalibError:
        return False


class SKIN_OT_export_plan(Export, Operator):
    """Write the plan of the active link, and its mesh next to it unless the file there is the same"""

    bl_label = "Export Skin Plan"
    blocked_by = (no_link,)

    ending = ".plan.json"

    def write(self, context, path):
        return list(map(str, write_plan(context, context.object, path).warnings))


class SKIN_OT_export_calibration(Export, Operator):
    """Write the calibration of the active link, from its current plan and mesh"""

    bl_label = "Export Skin Calibration"
    bl_options = {"REGISTER"}

    ending = ".calibration.json"

    def write(self, context, path):
        calibration, warnings = fit_to_write(context)
        save_calibration(calibration, path)
        return warnings


class SKIN_OT_export_taxels(Export, Operator):
    """Write the taxels of the active link for another program, from its current plan and mesh"""

    bl_label = "Export Taxels"
    bl_options = {"REGISTER"}

    filter_glob: bpy.props.StringProperty(
        default=";".join(f"*{ending}" for ending in sorted({f.ending for f in FORMATS.values()})), options={"HIDDEN"}
    )
    format: bpy.props.EnumProperty(
        name="Format",
        description="Program that reads the file",
        items=[(name, name, FORMATS[name].what) for name in WRITABLE],
        default="csv",
    )

    @property
    def filename_ext(self):
        """Return the suffix of the format, which the file browser applies."""
        return FORMATS[self.format].ending

    @property
    def ending(self):
        """Return the end of the proposed name; the mesh can have the name of the link with the same suffix."""
        return f"_taxels{self.filename_ext}"

    def check(self, context):
        """Replace the suffix of another format by that of the selected one."""
        path = Path(self.filepath)
        if path.suffix in {f.ending for f in FORMATS.values()} - {self.filename_ext}:
            self.filepath = str(path.with_suffix(self.filename_ext))
            return True
        return super().check(context)

    def write(self, context, path):
        calibration, warnings = fit_to_write(context)
        write_bytes_safely(path, FORMATS[self.format].write(calibration))
        return warnings


def register():
    """Add the entries in File > Import and Export."""
    bpy.types.TOPBAR_MT_file_import.append(draw_import)
    bpy.types.TOPBAR_MT_file_export.append(draw_export)


def unregister():
    """Remove them."""
    bpy.types.TOPBAR_MT_file_export.remove(draw_export)
    bpy.types.TOPBAR_MT_file_import.remove(draw_import)


def draw_import(menu, _context):
    """Add the entries in File > Import."""
    menu.layout.operator(SKIN_OT_import_plan.bl_idname, text="Skin Plan (.json)")
    menu.layout.operator("skin_calib.import_mesh", text="Skin Link Mesh (.stl, .ply, .obj)")
    menu.layout.operator("skin_calib.import_urdf", text="Skin Link of a Robot (.urdf)")
    menu.layout.operator("skin_calib.import_robot", text="Robot (.urdf)")


def draw_export(menu, _context):
    """Add the entries in File > Export."""
    menu.layout.operator(SKIN_OT_export_plan.bl_idname, text="Skin Plan (.json)")
    menu.layout.operator(SKIN_OT_export_calibration.bl_idname, text="Skin Calibration (.json)")
    menu.layout.operator(SKIN_OT_export_taxels.bl_idname, text="Skin Taxels (MuJoCo, URDF, iCub, ...)")
    menu.layout.operator("skin_calib.export_robot", text="Skins of a Robot (folder)")


SAMPLES = Path(__file__).resolve().parent.parent / "sample_scenes"


class SKIN_OT_open_sample(Operator):
    """Add a link with a plan that comes with the extension"""

    bl_label = "Open Sample"

    name: bpy.props.EnumProperty(
        name="Sample",
        description="Which link",
        items=[
            ("wrist", "Wrist", "A limb with a sheet around it"),
            ("sole", "Sole", "A foot with a sheet below its sole"),
            ("edge", "Edge", "A limb with an edge, and a sheet over it"),
        ],
    )

    def act(self, context):
        return bpy.ops.skin_calib.import_plan(filepath=str(SAMPLES / f"{self.name}.plan.json"))
