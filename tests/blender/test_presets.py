"""Skins as presets of Blender: those of the extension, and those that an author saves."""

from pathlib import Path

import pytest

BUNDLED = {
    "AIST_sheet_6_x_22": {"kind": "sheet", "rows": 6, "columns": 22, "pitch": [0.01, 0.01]},
    "TUM_boards": {"kind": "hexagons", "side": 0.0163},
    "Small_boards_8_mm": {"kind": "hexagons", "side": 0.008, "gap": 0.0},
}


def presets(bpy):
    """Return the files of the presets by name, as the menu finds them."""
    folders = bpy.utils.preset_paths("skin_calib")
    return {path.stem: path for folder in folders for path in Path(folder).glob("*.py")}


def test_extension_has_these_presets(bpy, extension):
    """Blender's menu of presets finds them while the extension is enabled."""
    import addon_utils

    assert set(BUNDLED) <= set(presets(bpy))
    addon_utils.disable(extension)
    assert not set(BUNDLED) & set(presets(bpy))
    addon_utils.enable(extension)


@pytest.mark.parametrize("name", BUNDLED)
@pytest.mark.parametrize("metre", [1.0, 0.001])
def test_preset_adds_its_skin(bpy, plan_file, document, name, metre):
    """After those of the plan, in one step of undo, with the same lengths in scenes of any unit."""
    bpy.context.scene.unit_settings.scale_length = metre
    bpy.ops.skin_calib.import_plan(filepath=str(plan_file()))
    bpy.ops.ed.undo_push(message="start")
    assert bpy.ops.skin_calib.preset("EXEC_DEFAULT", True, filepath=str(presets(bpy)[name])) == {"FINISHED"}
    first, added = document(bpy.context.object)["skins"]
    assert first["name"] == "band" and BUNDLED[name].items() <= added.items()
    bpy.ops.ed.undo()
    assert len(bpy.context.object.skin_calib.skins) == 1


@pytest.mark.parametrize("kind", ["sheet", "hexagons"])
def test_own_skin_is_saved_and_added(bpy, link, document, kind):
    """The skin on another link is the same, at its own place; the author's folder has the file."""
    bpy.ops.skin_calib.skin_add(kind=kind)
    skin = link.skin_calib.skins[1]
    skin.name, skin.centred, skin.origin = "mine", False, (0.04, 0.01, 0.06)
    if kind == "sheet":
        skin.rows, skin.columns, skin.pitch_mm, skin.hand, skin.trim = 3, 7, (4.7, 5.3), "left", True
    else:
        skin.side_mm, skin.auto_gap, skin.gap_mm, skin.offset_mm = 12.3, False, 0.45, 1.1
    assert bpy.ops.skin_calib.preset_save(skin=1, name=f"lab {kind}") == {"FINISHED"}
    file = presets(bpy)[f"lab_{kind}"]
    assert bpy.utils.resource_path("USER") in str(file)
    assert bpy.ops.skin_calib.preset(filepath=str(file)) == {"FINISHED"}
    _, saved, added = document(link)["skins"]
    own = {"name", "origin", "direction", "first_channel"}
    assert {k: v for k, v in added.items() if k not in own} == {k: v for k, v in saved.items() if k not in own}
    assert added.get("origin", "center") == "center"
    file.unlink()
