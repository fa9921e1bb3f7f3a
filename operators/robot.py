# SPDX-License-Identifier: GPL-3.0-or-later
"""A whole robot: import its links, propose plans for them, fit them, and export all."""

from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import bpy

from ..skin_calib_addon.blender.live import updates
from ..skin_calib_addon.blender.scene import link_objects, plans, results, robots, showing, skins
from ..skin_calib_addon.blender.scene.preferences import chosen_skin
from ..skin_calib_addon.blender.scene.units import metres_per_unit
from ..skin_calib_addon.blender.scene.warnings import refusal_of
from ..skin_calib_addon.blender.session import session
from ..skin_calib_addon.common.atomic_file import make_folder
from ..skin_calib_addon.common.errors import InvalidMesh, InvalidPlan, OutputError, SkinCalibError, counted, listed
from ..skin_calib_addon.common.findings import printable
from ..skin_calib_addon.pipeline.robot_folder import save_link, save_robot
from ..skin_calib_addon.proposal.links import Task, numbered, plan_path, propose_task, robot_of
from ..skin_calib_addon.proposal.moved_plan import moved_plan
from ..skin_calib_addon.robot.kinematics import link_poses
from ..skin_calib_addon.robot.link_mesh import axis_warning, load_urdf_meshes
from ..skin_calib_addon.robot.urdf import read_robot
from ..skin_calib_addon.robot.zones import load_zones
from .base import Operator, busy, no_link
from .exchange import write_plan
from .files import Import
from .fit import fit_of, store_fit
from .working import Working


def add_robot(operator, context, path, robot, poses, meshes, problems, zones):
    """Add all links, show them, and report those whose meshes cannot be read."""
    links = robots.add_robot(context, path, robot, poses, meshes, problems, zones)
    hidden = showing.present(context, [*links, *(link.parent for link in links)])
    size = f"{robot.name or path.stem}: {counted(len(links), 'link')} with a mesh"
    operator.report({"INFO"}, f"{size}. {hidden}" if hidden else size)
    for link, problem in problems.items():
        operator.report({"WARNING"}, f"{printable(link)}: {problem}")
    if warning := axis_warning(path, robot, meshes):
        operator.report({"WARNING"}, warning)


class SKIN_OT_import_robot(Import, Operator):
    """Open all links of a robot, each below an empty that is its frame, in the zero pose"""

    bl_label = "Import Robot"

    filter_glob: bpy.props.StringProperty(default="*.urdf;*.xml", options={"HIDDEN"})

    use = staticmethod(add_robot)

    def reader(self, path):
        def read():
            robot = read_robot(path)
            poses = link_poses(robot)
            meshes, problems = load_urdf_meshes(path, robot)
            if not meshes:
                why = "; ".join(f"{link}: {problem}" for link, problem in problems.items())
                raise InvalidMesh(why or f"No link of {path.name} has a mesh. Boxes and cylinders cannot carry skin.")
            return path, robot, poses, meshes, problems, load_zones(path)

        return read


def no_links(context):
    """Return why the scene has no links."""
    return "" if link_objects.links(context) else "Import a robot, or a link, first"


def propose_and_fit(task, channel, mesh, begin):
    """Return the outcome of a proposal, its plan from a channel on, and the fit of the plan, or why it is refused."""
    plan, fit = None, None

    def use(proposal):
        nonlocal plan, fit
        if proposal.plan is None:
            return
        plan = replace(numbered(proposal.plan, channel), mesh=mesh)
        try:
            fit = results.fit(plan, task.mesh, begin, proposal.fits)
        except SkinCalibError as refused:
            fit = refused

    return propose_task(task, begin, use), plan, fit


def readable_plan(link, scene):
    """Return the plan of a link, without its name; None if it is invalid."""
    with suppress(SkinCalibError):
        return replace(plans.read_plan(link, scene), link="")
    return None


class Propose(Working):
    """Proposes surfaces and skins, as ``skin-calib propose`` does, stores them as the plan of the link, and fits it."""

    doing, did = "Proposing a plan", "Proposed plans for"
    is_wanted = True  # whether links of any size get skin

    def chosen(self, context):
        self.choice = replace(chosen_skin(context.scene), is_wanted=self.is_wanted)
        robot_of.cache_clear()  # its files can have changed
        links = self.links(context)
        of_robots = {link.skin_calib.urdf: link for link in links}.values()
        if any(robots.unsaved_zones(link, context.scene) is not None for link in of_robots):
            raise InvalidPlan("The zones of the scene are not those of the file of the robot. Press Save Zones first.")
        return links

    def links(self, context):
        """Return the links that get a plan."""
        return [context.object]

    def task(self, context, link):
        facets, settings = updates.facets_of(link), link.skin_calib
        file = robots.urdf_of(link) or Path(f"{link.name}.ply")  # read only if it is a robot
        task = Task(file, "m", settings.link, self.choice, facets.mesh())
        mesh, channel = Path(settings.mesh_file or f"{link.name}.ply"), robots.next_channel(link, context.scene)
        self.facets, self.replaced = facets, readable_plan(link, context.scene)
        return lambda begin: propose_and_fit(task, channel, mesh, begin)

    def store(self, context, link, result):
        outcome, given, fit = result
        proposal, settings = outcome.proposal, link.skin_calib
        if proposal is None:
            raise SkinCalibError(outcome.problem)
        if proposal.plan is None:
            raise InvalidPlan(proposal.reasons[-1])
        if readable_plan(link, context.scene) != self.replaced:
            self.report({"WARNING"}, f"{link.name}: the plan was changed during the proposal, which replaces it")
        plan = numbered(given, robots.next_channel(link, context.scene))  # others can have got skins in the meantime
        plan = replace(plan, link=settings.link)  # it can have got another name
        plans.check_numbers(plan, metres_per_unit(context.scene))
        plans.write_plan(link, context.scene, plan)
        for words in proposal.warnings:
            self.report({"WARNING"}, f"{link.name}: {words}")
        settings.proposed = proposal.taxels
        settings.proposed_area = f"{proposal.cells * 1e4:.0f} of {proposal.free * 1e4:.0f} cm^2"
        settings.result.key = ""  # a fit of an earlier plan is not drawn
        session.of(link).forget()
        if isinstance(fit, SkinCalibError):
            updates.refuse(link, refusal_of(fit))
            self.report({"WARNING"}, f"{link.name}: the fit of the proposal is refused. {skins.in_window(fit)}")
        else:
            store_fit(context, link, (given, self.facets), fit)

    def keep_reason(self, link, error):
        link.skin_calib.refusal = str(error)


class SKIN_OT_propose(Propose, Operator):
    """Propose surfaces and skins for the active link, and fit them; they replace its plan. Esc stops a long search"""

    bl_label = "Propose"
    blocked_by = (no_link, busy)


def no_plan_of_robot(context):
    """Return why the active link has no plan that another link of its robot can get."""
    settings = context.object.skin_calib
    if not settings.urdf:
        return "Import a robot first: this link is alone"
    return "" if settings.skins else "Add a skin, or propose one, first"


class SKIN_OT_copy_to_mirror(Working, Operator):
    """Copy the plan of the active link to the link that is its mirror image, and fit it; it replaces the plan there"""

    bl_label = "Copy to Mirror Link"
    blocked_by = (no_link, no_plan_of_robot, busy)

    doing = "Copying the plan"

    def chosen(self, context):
        self.source = context.object.session_uid
        robot_of.cache_clear()  # its files can have changed
        return super().chosen(context)

    def task(self, context, link):
        if link.session_uid != self.source:
            self.given, fit = fit_of(context, link)
            return fit
        plan, urdf = plans.read_plan(link, context.scene), robots.urdf_of(link)

        def copy(begin):
            begin("mirror image")
            return moved_plan(plan, *robot_of(urdf).mirror_of(plan.link))

        return copy

    def store(self, context, link, result):
        if link.session_uid != self.source:
            store_fit(context, link, self.given, result)
            self.report({"INFO"}, f"{link.name} has the copy: {counted(link.skin_calib.result.taxels, 'taxel')}")
            return
        same = (other for other in robots.links(context) if other.skin_calib.urdf == link.skin_calib.urdf)
        target = next((other for other in same if other.skin_calib.link == result.link), None)
        if target is None:
            raise InvalidPlan(f"{result.link}, the mirror image of {link.name}, is not in the scene. Import the robot.")
        plan = numbered(own_skins(result, link.skin_calib.link), robots.next_channel(target, context.scene))
        plan = replace(plan, mesh=Path(target.skin_calib.mesh_file), extra={})
        plans.check_numbers(plan, metres_per_unit(context.scene))
        plans.write_plan(target, context.scene, plan)
        settings = target.skin_calib
        settings.proposed, settings.proposed_area, settings.refusal, settings.result.key = 0, "", "", ""
        session.of(target).forget()
        self.left.append((target.name, target.session_uid))  # its fit is next
        self.total += 1

    def keep_reason(self, link, error):
        if link.session_uid != self.source:
            updates.refuse(link, refusal_of(error))


def own_skins(plan, source):
    """Return a plan whose skins have neither channels nor the name of the link from which it was copied."""
    skins = []
    for skin in plan.skins:
        name, taxels = skin.name.replace(source, plan.link), (single._replace(channel=None) for single in skin.taxels)
        skins.append(replace(skin, name=name, first_channel=None, taxels=tuple(taxels)))
    return replace(plan, skins=tuple(skins))


class SKIN_OT_propose_all(Propose, Operator):
    """Propose surfaces and skins for all links that have no plan, and fit them; Esc keeps what is finished"""

    bl_label = "Propose All"
    is_wanted = False
    blocked_by = (no_links, busy)

    def links(self, context):
        links = [link for link in robots.links(context) if not link.skin_calib.skins]
        if not links:
            raise InvalidPlan("All links have a plan. Use Propose to replace that of the active link.")
        return links

    def task(self, context, link):
        check_empty(link)
        return super().task(context, link)

    def store(self, context, link, result):
        check_empty(link)
        super().store(context, link, result)


def check_empty(link):
    """Raise InvalidPlan if a link that had no plan has got one while the proposals were computed."""
    if link.skin_calib.skins:
        raise InvalidPlan("It has got a skin in the meantime, and keeps its plan.")


class SKIN_OT_fit_all(Working, Operator):
    """Fit all links that have a plan and no current fit; Esc keeps what is finished"""

    bl_label = "Fit All"
    blocked_by = (no_links, busy)

    doing, did = "Fitting", "Fitted"

    def chosen(self, context):
        planned = robots.compared_links(context)
        if not planned:
            raise InvalidPlan("No link has a skin. Use Propose All, or add skins to links.")
        links = [link for link in planned if robots.fit_of(link) is None]
        if not links:
            self.report({"INFO"}, "All links with a plan are fitted")
        return links

    def task(self, context, link):
        self.given, task = fit_of(context, link)
        return task

    def store(self, context, link, result):
        store_fit(context, link, self.given, result)

    def keep_reason(self, link, error):
        updates.refuse(link, refusal_of(error))


def links_to_write(context):
    """Return the links with a current fit, and those whose fit is refused, which are all others that have a plan."""
    planned = robots.compared_links(context)
    fitted = [link for link in planned if robots.fit_of(link) is not None]
    refused = [link for link in planned if link not in fitted and session.of(link).is_refused]
    waiting = [link.name for link in planned if link not in fitted and link not in refused]
    if waiting:
        raise OutputError(f"{listed(waiting)}: not fitted since the last change. Press Fit All first.")
    if not fitted:
        raise OutputError("No link is fitted. Press Propose All and Fit All first.")
    for link in fitted:
        if link_objects.namesakes(link, context.scene):
            raise OutputError(f"Two objects have the link name {link.skin_calib.link}. Rename one of them.")
    if len({link.skin_calib.urdf for link in fitted} - {""}) > 1:
        raise OutputError("The scene has links of two robots. Delete one of them.")
    return fitted, refused


def write_folder(context, folder, links):
    """Write plan and calibration of each link, their sources, and robot.json, which has all calibrations of the folder.

    Return the names of the calibrations that were in the folder and are not those of the links.
    """
    make_folder(folder)
    written = set()
    for link in links:
        path = plan_path(folder, link.skin_calib.link)
        written.add(save_link(robots.fit_of(link), write_plan(context, link, path), path))
    urdf = next(filter(None, map(robots.urdf_of, links)), None)
    save_robot(folder, read_robot(urdf) if urdf else None, urdf)
    return [path.name for path in sorted(folder.glob("*.calibration.json")) if path not in written]


class SKIN_OT_export_robot(Operator):
    """Write plans and calibrations of all fitted links to a folder, with robot.json, as the command line does"""

    bl_label = "Export Robot"
    blocked_by = (no_links, busy)

    directory: bpy.props.StringProperty(name="Folder", description="For all files of the robot", subtype="DIR_PATH")
    filter_folder: bpy.props.BoolProperty(default=True, options={"HIDDEN"})

    def invoke(self, context, event):
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def act(self, context):
        if not self.directory:
            raise OutputError("Choose a folder for the files of the robot.")
        folder = Path(bpy.path.abspath(self.directory))
        links, refused = links_to_write(context)
        earlier = write_folder(context, folder, links)
        self.report({"INFO"}, f"Wrote {counted(len(links), 'calibration')} and robot.json to {folder}")
        for link in refused:  # last, because the window shows what was reported last
            self.report({"WARNING"}, f"{link.name} is not written, because its fit is refused. Robot has the reason.")
        for name in earlier:
            stays = f"{name} is from an earlier export, and stays in robot.json"
            self.report({"WARNING"}, f"{stays}. Remove it from the folder, and export again.")
