"""Boards selected by clicks: a click on a board removes it, a click next to the boards adds one."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from tests.blender.conftest import BOARDS, PLAN, ROOT


@pytest.fixture
def boards(bpy, plan_file):
    """Return a fitted link that is filled with boards."""
    bpy.ops.skin_calib.import_plan(filepath=str(plan_file(skins=[BOARDS])))
    bpy.ops.skin_calib.fit()
    return bpy.context.object


def taxels(addon, link):
    """Return the drawn taxels of the last fit."""
    return addon.drawing.patches_of(link)[0].taxels


@pytest.fixture
def sole(bpy):
    """Return the sample sole, filled with boards."""
    bpy.ops.skin_calib.import_plan(filepath=str(ROOT / "sample_scenes" / "sole.plan.json"))
    bpy.ops.skin_calib.skin_remove(index=0)
    bpy.ops.skin_calib.skin_add(kind="hexagons")
    bpy.ops.skin_calib.fit()
    return bpy.context.object


def test_click_removes_a_board_and_the_others_stay(bpy, addon, sole):
    """The lattice is fixed at its current position; a second click restores the board."""
    boards, before = sole, taxels(addon, sole)
    i = len(before.ids) // 2
    bpy.ops.skin_calib.boards_paint(skin=0, point=before.positions_link[i])
    skin = boards.skin_calib.skins[0]
    assert skin.choice == "listed" and not skin.centred and not skin.auto_direction
    bpy.ops.skin_calib.fit()
    after = taxels(addon, boards)
    rest = np.delete(np.arange(len(before.ids)), i)
    assert after.index.tolist() == before.index[rest].tolist()
    assert_allclose(after.positions_link, before.positions_link[rest], atol=1e-4)
    bpy.ops.skin_calib.boards_paint(skin=0, point=before.positions_link[i])
    bpy.ops.skin_calib.fit()
    assert sorted(taxels(addon, boards).ids) == sorted(before.ids)


def test_click_next_to_the_boards_adds_one(bpy, addon, boards):
    """The new board is a cell of the lattice in the plane of the nearest board; one undo step removes it."""
    before = taxels(addon, boards)
    i = int(np.argmin(before.index[:, 0]))
    for row in range(len(before.ids)):
        if row != i:
            bpy.ops.skin_calib.boards_paint(skin=0, point=before.positions_link[row])
    bpy.ops.skin_calib.fit()
    (alone,) = taxels(addon, boards).index.tolist()
    assert alone == before.index[i].tolist()
    with pytest.raises(RuntimeError, match="This is the last board"):
        bpy.ops.skin_calib.boards_paint(skin=0, point=before.positions_link[i])
    bpy.ops.ed.undo_push(message="one board")
    adjacent = before.positions_link[i] + 0.02 * before.tangents_link[i]
    assert bpy.ops.skin_calib.boards_paint("EXEC_DEFAULT", True, skin=0, point=adjacent) == {"FINISHED"}
    assert bpy.context.object.skin_calib.skins[0].cells.split() == [f"{q},{alone[1]}" for q in (alone[0], alone[0] + 1)]
    bpy.ops.ed.undo()
    assert len(bpy.context.object.skin_calib.skins[0].cells.split()) == 1


def test_tool_works_on_the_skin_under_the_mouse(bpy, addon, plan_file):
    """Of two skins with boards, a click on a board of the second one removes that board."""
    two = {"cells": [[0, 0], [1, 0]], "origin": [-0.0365, 0.01, 0.06], "direction": [0, 0, 1]}
    side = BOARDS | two | {"name": "second"}
    first = side | {"name": "first", "origin": [0.04, 0.01, 0.06]}
    sheet = PLAN["skins"][0]
    bpy.ops.skin_calib.import_plan(filepath=str(plan_file(skins=[sheet, first, side])))
    bpy.ops.skin_calib.fit()
    link = bpy.context.object
    for patch in addon.drawing.patches_of(link)[:0:-1]:
        bpy.ops.skin_calib.boards_paint(at_mouse=True, point=patch.taxels.positions_link[1])
    cells = {skin.name: skin.cells for skin in link.skin_calib.skins if skin.kind == "hexagons"}
    assert cells == {"first": "0,0", "second": "0,0"}


def test_click_on_a_board_shifted_from_its_place_removes_it(bpy, addon, plan_file):
    """The other one shifted from its place keeps its numbers; a place whose coordinates are in use gets no board."""
    shifted = [[0, 0], [1, 0, 0.0, 0.004, 0.1], [0, -1, 0.0, -0.03, 0.0]]
    boards = {"name": "boards", "kind": "hexagons", "side": 0.006, "cells": shifted}
    place = {"origin": [-0.0365, 0.01, 0.06], "direction": [0, 0, 1]}
    bpy.ops.skin_calib.import_plan(filepath=str(plan_file("shifted", skins=[boards | place])))
    bpy.ops.skin_calib.fit()
    skin = bpy.context.object.skin_calib.skins[0]
    found = taxels(addon, bpy.context.object)
    root = found.positions_link[0]
    across = np.cross(found.normals_link[0], found.tangents_link[0])
    below = -0.0104 * (0.5 * found.tangents_link[0] + np.sqrt(0.75) * across)
    with pytest.raises(RuntimeError, match="has the coordinates of this place"):
        bpy.ops.skin_calib.boards_paint(skin=0, point=root + below)
    bpy.ops.skin_calib.boards_paint(skin=0, point=found.positions_link[1])
    assert skin.cells == "0,0 0,-1,0.000000,-0.030000,0.000000"
