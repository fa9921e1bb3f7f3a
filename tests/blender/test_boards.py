"""Boards chosen by hand: what is clicked on goes, what is clicked beside the boards comes."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from tests.blender.conftest import BOARDS, ROOT


@pytest.fixture
def boards(bpy, plan_file):
    """A fitted link that is full of boards."""
    bpy.ops.skin_calib.import_plan(filepath=str(plan_file(skins=[BOARDS])))
    bpy.ops.skin_calib.fit()
    return bpy.context.object


def taxels(addon, link):
    """The boards as they are drawn, which the last fit laid."""
    return addon.overlay.patches_of(link)[0].taxels


@pytest.fixture
def sole(bpy):
    """The sample sole, full of boards."""
    bpy.ops.skin_calib.import_plan(filepath=str(ROOT / "sample_scenes" / "sole.plan.json"))
    bpy.ops.skin_calib.skin_remove(index=0)
    bpy.ops.skin_calib.skin_add(kind="hexagons")
    bpy.ops.skin_calib.fit()
    return bpy.context.object


def test_board_that_is_clicked_on_goes_and_the_others_stay_where_they_are(bpy, addon, sole):
    """The lattice is held where the fill has put it; a second click brings the board back."""
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


def test_click_beside_the_boards_puts_one_in(bpy, addon, boards):
    """The cell of the lattice that goes on over the nearest board's plane; undo takes it out in one step."""
    before = taxels(addon, boards)
    i = int(np.argmin(before.index[:, 0]))
    for row in range(len(before.ids)):
        if row != i:
            bpy.ops.skin_calib.boards_paint(skin=0, point=before.positions_link[row])
    bpy.ops.skin_calib.fit()
    (alone,) = taxels(addon, boards).index.tolist()
    assert alone == before.index[i].tolist()
    with pytest.raises(RuntimeError, match="this is the last board"):
        bpy.ops.skin_calib.boards_paint(skin=0, point=before.positions_link[i])
    bpy.ops.ed.undo_push(message="one board")
    beside = before.positions_link[i] + 0.02 * before.tangents_link[i]
    assert bpy.ops.skin_calib.boards_paint("EXEC_DEFAULT", True, skin=0, point=beside) == {"FINISHED"}
    assert bpy.context.object.skin_calib.skins[0].cells.split() == [f"{q},{alone[1]}" for q in (alone[0], alone[0] + 1)]
    bpy.ops.ed.undo()
    assert len(bpy.context.object.skin_calib.skins[0].cells.split()) == 1


def test_what_cannot_be_painted_is_refused(bpy, boards, link):
    """Sheets have no boards; before a fit there are none to see."""
    with pytest.raises(RuntimeError, match="has no boards, which belong to Kind: Hexagons"):
        bpy.ops.skin_calib.boards_paint(skin=0, point=(0, 0, 0))
    link.skin_calib.skins[0].kind = "hexagons"
    with pytest.raises(RuntimeError, match="fit the link first"):
        bpy.ops.skin_calib.boards_paint(skin=0, point=(0, 0, 0))
