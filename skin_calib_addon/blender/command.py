# SPDX-License-Identifier: GPL-3.0-or-later
"""``blender [-b] [scene.blend] --command skin_calib ...``: the command line inside Blender."""

from collections.abc import Sequence
from typing import Any

import bpy

from .. import cli
from ..geometry.mesh.triangle_mesh import TriangleMesh
from ..plan import Plan
from .scene.link_meshes import read_mesh
from .scene.link_objects import links
from .scene.plans import plan_to_write

_commands: list[Any] = []


def scene_plans() -> list[tuple[Plan, TriangleMesh]]:
    """Return plan and mesh of every link in the open scene; of a robot, only of the links that have a skin."""
    context = bpy.context
    found = [link for link in links(context) if link.skin_calib.skins or not link.skin_calib.urdf]
    return [(plan_to_write(link, context.scene), read_mesh(link, context)) for link in found]


def main(argv: Sequence[str]) -> int:
    """Run one command; ``fit`` without a plan file fits the links of the open scene."""
    return cli.main(argv, scene_plans)


def register() -> None:
    """Add the command. The ``bpy`` module has no command line and ignores this."""
    _commands.append(bpy.utils.register_cli_command("skin_calib", main))


def unregister() -> None:
    """Remove the command."""
    while _commands:
        bpy.utils.unregister_cli_command(_commands.pop())
