"""Lengths are shown and entered in millimetres, whatever the units of the scene."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from tests.blender.test_registration import draw, properties

SCENES = [("METRIC", 1.0), ("METRIC", 0.001), ("METRIC", 0.01), ("IMPERIAL", 1.0), ("NONE", 1.0)]


@pytest.mark.parametrize("system, metre", SCENES)
def test_lengths_are_in_millimetres_in_every_scene(bpy, plan_file, document, system, metre):
    """What is shown is the plan's length; what is entered is the plan's length, digit by digit."""
    bpy.context.scene.unit_settings.system, bpy.context.scene.unit_settings.scale_length = system, metre
    bpy.ops.skin_calib.import_plan(filepath=str(plan_file()))
    link = bpy.context.object
    skin = link.skin_calib.skins[0]
    assert_allclose(skin.pitch_mm, (8.5, 10.0), rtol=1e-7)
    skin.pitch_mm[1] = 12.345
    skin.centred, skin.offset_mm, skin.origin_mm = False, 0.75, (1.25, -20.5, 33.3)
    link.skin_calib.grid.auto_margin, link.skin_calib.grid.margin_mm = False, 7.1
    written = document(link)
    assert written["skins"][0]["pitch"] == [0.0085, 0.012345]
    assert written["skins"][0]["offset"] == 0.00075 and written["skins"][0]["origin"] == [0.00125, -0.0205, 0.0333]
    assert written["grid"]["margin"] == 0.0071
    assert link.skin_calib.result.outdated
    assert bpy.context.scene.unit_settings.system == system  # the settings of the user stay


def test_components_that_were_not_entered_keep_all_their_digits(bpy, link):
    """An edit of one coordinate leaves the others as they were, to the bit."""
    skin, rng = link.skin_calib.skins[0], np.random.default_rng(0)
    for _ in range(200):
        skin.origin = before = tuple(np.float32(rng.uniform(-0.3, 0.3, 3)))
        shown = list(skin.origin_mm)
        shown[1] = 5.0
        skin.origin_mm = shown
        assert (skin.origin[0], skin.origin[2]) == (before[0], before[2])
        assert skin.origin[1] == np.float32(0.005)


def test_every_length_has_millimetres(bpy, link):
    """No panel shows a length in the unit of the scene; the substitute of the layout checks each row."""
    group = bpy.types.Object.bl_rna.properties["skin_calib"].fixed_type
    found = dict(properties(group))
    lengths = [path for path, item in found.items() if getattr(item, "unit", "") == "LENGTH"]
    assert {"skins.pitch", "cover.cuts.point", "grid.u.point", "result.mean", "inspect.taxel.position"} < set(lengths)
    assert [path for path in lengths if found.get(f"{path}_mm") is None] == []
    assert {found[f"{path}_mm"].unit for path in lengths} == {"CAMERA"}
    assert bpy.ops.skin_calib.fit() == {"FINISHED"}
    assert_allclose(link.skin_calib.result.mean_mm, 1e3 * link.skin_calib.result.mean, rtol=1e-6)
    bpy.ops.skin_calib.taxel(taxel="0")
    assert {"mean", "max", "hausdorff"} < set(draw(bpy, "fit"))
    taxel = link.skin_calib.inspect.taxel
    assert_allclose(taxel.position_mm, 1e3 * np.array(taxel.position), rtol=1e-6)
    area = next(text for text in draw(bpy, "inspect_taxel") if text.startswith("Area"))
    assert area.endswith(" mm²") and 70 < float(area.split()[1]) < 95
