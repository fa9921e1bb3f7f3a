# SPDX-License-Identifier: GPL-3.0-or-later
"""Hexagonal boards chosen by hand."""

import bpy
import numpy as np

from ..skin_calib_addon.blender.overlay import drawing
from ..skin_calib_addon.blender.scene import skins
from ..skin_calib_addon.blender.scene.fields import written_cells
from ..skin_calib_addon.blender.scene.units import metres_per_unit, vector
from ..skin_calib_addon.common.errors import SkinCalibError
from ..skin_calib_addon.skin.boards.board_taxels import board_at
from .base import Followed, OnSkin, Operator
from .picking import POINT, Picking


class SKIN_OT_boards_paint(Followed, Picking, OnSkin, Operator):
    """Click on a board to remove it, or next to the boards to add one; the skin follows each click"""

    bl_label = "Paint Boards"

    point: bpy.props.FloatVectorProperty(name="Point", description="A point of the board, in the link frame", **POINT)

    prompts = ("Click on a board to remove it, next to the boards to add one    Ctrl-Z: undo    Esc, Return: end",)
    repeats = True

    def check(self, context):
        if self.at_mouse:  # a tool has no skin before the click
            kinds = [skin.kind for skin in context.object.skin_calib.skins]
            self.skin = kinds.index("hexagons") if "hexagons" in kinds else 0
        self.boards(context)
        super().check(context)

    def nearest(self, context):
        """Return the skin of the last fit whose board is the nearest to the point; the present one without boards."""
        point = np.array(vector(self.point, metres_per_unit(context.scene)))
        distances = {
            i: np.linalg.norm(patch.taxels.positions_link - point, axis=1).min()
            for i, patch in enumerate(drawing.patches_of(context.object))
            if patch.kind == "hexagons"
        }
        return min(distances, key=distances.get, default=self.skin)

    def boards(self, context):
        """Return the skin and its boards of the last fit."""
        plan = context.object.skin_calib
        skin, patches = skins.of_kind(plan, self.skin, "hexagons", "boards"), drawing.patches_of(context.object)
        if not patches or patches[self.skin].kind != "hexagons":
            raise SkinCalibError("Fit the link first, to see its boards.")
        return skin, patches[self.skin].taxels

    def edit(self, context, plan):
        if self.at_mouse:
            self.skin = self.nearest(context)
        skin, taxels = self.boards(context)
        metre = metres_per_unit(context.scene)
        boards = skins.read_skin(skin, metre)
        cell, is_there = board_at(taxels, boards.lattice, vector(self.point, metre))
        cells = list(boards.choice) if skin.choice == "listed" else [tuple(c) for c in taxels.index.tolist()]
        others = [other for other in cells if other[:2] != cell]
        if not others:
            raise SkinCalibError("This is the last board. Remove the skin instead.")
        if len(others) < len(cells) and not is_there:
            raise SkinCalibError(
                "Another board, shifted from its place in the lattice, has the coordinates of this place."
            )
        skins.list_boards(skin, taxels, metre)
        skin.cells = written_cells(others if is_there else [*cells, cell])
