# SPDX-License-Identifier: GPL-3.0-or-later
"""All links of a robot in a scene: their objects, their frames, and their states."""

from collections.abc import Iterable, Mapping
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix

from ...common.arrays import Array
from ...common.errors import SkinCalibError
from ...geometry.mesh.triangle_mesh import TriangleMesh
from ...pipeline import Calibrated
from ...plan.skins import following_channel
from ...robot.urdf import Robot
from ...robot.zones import LinkZone, load_zones
from . import link_meshes, results, showing
from .fields import kept_path
from .link_objects import activate, add_link, new_frame, why_not
from .skins import read_skin
from .units import metres_per_unit
from .zones import are_same, read_zones, show_zones


def add_robot(
    context: bpy.types.Context,
    urdf: Path,
    robot: Robot,
    poses: Mapping[str, Array],
    meshes: Mapping[str, TriangleMesh],
    problems: Mapping[str, str],
    zones: Iterable[LinkZone] = (),
) -> list[bpy.types.Object]:
    """Add a robot: for each link an empty that is its frame, the mesh below it, and its zones without skin.

    Return the links with a mesh.
    """
    group = bpy.data.collections.new(robot.name or urdf.stem)
    context.scene.collection.children.link(group)
    metre, file = metres_per_unit(context.scene), kept_path(str(urdf.absolute()))
    frames = {link: new_frame(link, metre) for link in robot.links}
    links = []
    for link, frame in frames.items():
        group.objects.link(frame)
        parent = robot.parents.get(link)
        pose = poses[link] if parent is None else np.linalg.solve(poses[parent], poses[link])
        frame.parent = frames[parent] if parent is not None else None
        frame.matrix_basis = _in_units(pose, metre)
        if link in problems:
            frame.skin_calib.link, frame.skin_calib.refusal = link, problems[link]
        if link in meshes:
            links.append(add_link(context, meshes[link], "m", link, frame))
            settings = links[-1].skin_calib
            settings.link, settings.mesh_file, settings.urdf, settings.zones_shown = link, urdf.name, file, True
    show_zones(context.scene, file, frames, zones)
    return links


def unsaved_zones(link: bpy.types.Object, scene: bpy.types.Scene) -> tuple[LinkZone, ...] | None:
    """Return the zones of the robot of a link in a scene that shows them, if its file has others; else None."""
    urdf = urdf_of(link)
    if urdf is None or not link.skin_calib.zones_shown:
        return None
    zones = read_zones(scene, link.skin_calib.urdf)
    return None if are_same(zones, load_zones(urdf)) else zones


def _in_units(pose: Array, metre: float) -> Matrix:
    """Return a pose [m] in scene units."""
    matrix = Matrix(pose.tolist())
    matrix.translation /= metre
    return matrix


def is_listed(thing: bpy.types.Object) -> bool:
    """Return whether an object is in the list of links: a link, or the frame of one whose mesh cannot be read."""
    return bool(thing.skin_calib.link) and thing.type in ("MESH", "EMPTY")


def links(context: bpy.types.Context) -> list[bpy.types.Object]:
    """Return the links of the scene that can be edited, in the order of the list."""
    return [thing for thing in context.scene.objects if not why_not(thing)]


def urdf_of(link: bpy.types.Object) -> Path | None:
    """Return the file of the robot of a link; None if it was imported alone."""
    urdf = link.skin_calib.urdf
    return Path(bpy.path.abspath(urdf, library=link.library)) if urdf else None


def compared_links(context: bpy.types.Context) -> list[bpy.types.Object]:
    """Compare plans and meshes of the links that have a skin with those of their fits, and return these links.

    Results of another plan or mesh become outdated. All meshes of links with a current fit are read and hashed.
    """
    planned = [link for link in links(context) if link.skin_calib.skins]
    for link in planned:
        try:
            sha256 = link_meshes.read_facets(link, context).sha256 if results.is_current(link) else ""
        except SkinCalibError:
            sha256 = ""
        results.verify(link, context.scene, sha256)
    return planned


def fit_of(link: bpy.types.Object) -> Calibrated | None:
    """Return the current fit of a link; None if there is none, or if it is outdated."""
    result = link.skin_calib.result
    return None if result.outdated else results.find(result.key)


def next_channel(link: bpy.types.Object, scene: bpy.types.Scene) -> int:
    """Return the first channel after those of the other links of the same robot."""
    ends = [0]
    for other in scene.objects:
        settings = other.skin_calib
        if other == link or settings.urdf != link.skin_calib.urdf or not settings.skins:
            continue
        skins = tuple(read_skin(skin, metres_per_unit(scene)) for skin in settings.skins)
        end = following_channel(skins)
        if end is None:  # boards that fill a surface
            taxels = settings.result.taxels if settings.result.key else settings.proposed
            end = (skins[0].first_channel or 0) + taxels
        ends.append(end)
    return max(ends)


def active_row(scene: bpy.types.Scene) -> int:
    """Return which of the objects of the scene is active; -1 without one."""
    active = bpy.context.view_layer.objects.active
    return scene.objects.find(active.name) if active else -1


def select_row(scene: bpy.types.Scene, index: int) -> None:
    """Make a link active and show it."""
    context = bpy.context
    link = scene.objects[index]
    if link.name not in context.view_layer.objects:
        return
    activate(context, link)
    showing.frame(context)
