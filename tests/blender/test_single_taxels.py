"""Single taxels in Blender: disabled by clicks, with channels of their own, the same bytes with every interface."""

import json

import pytest

from tests.blender.conftest import BAND, BOARDS, LISTED
from tests.blender.test_live import rest


def patch_of(addon, link, skin=0):
    """Return the drawn patch of a skin."""
    return addon.drawing.patches_of(link)[skin]


@pytest.fixture
def fitted(bpy, link):
    """Return the link with a sheet, fitted."""
    bpy.ops.skin_calib.fit()
    return link


def test_disabled_taxel_is_left_out_and_drawn(bpy, addon, fitted):
    """The others keep ids and channels; the same call enables it again, and then nothing is left in the plan."""
    before = patch_of(addon, fitted).taxels
    chosen = before.ids[4]
    assert bpy.ops.skin_calib.taxel_toggle(taxel=chosen) == {"FINISHED"}
    (single,) = fitted.skin_calib.skins[0].taxels
    assert not single.enabled and single.auto_channel and f"arm.{single.taxel}" != chosen == f"band.{single.taxel}"
    bpy.ops.skin_calib.fit()
    after = patch_of(addon, fitted).taxels
    assert after.ids == before.ids[:4] + before.ids[5:]
    assert after.channels.tolist() == [k for k in before.channels.tolist() if k != before.channels[4]]
    drawn = {layer.what: layer for layer in addon.drawing.shown_layers(fitted)}
    assert len(drawn["DISABLED"].points) == 2 * (4 + 4)
    assert addon.drawing.layers_now(fitted).with_disabled.ids == (*after.ids, chosen)
    assert bpy.ops.skin_calib.taxel_toggle(taxel=chosen) == {"FINISHED"}
    assert not fitted.skin_calib.skins[0].taxels
    bpy.ops.skin_calib.fit()
    assert patch_of(addon, fitted).taxels.ids == before.ids


def test_taxel_that_is_read_follows_the_next_fit(bpy, addon, fitted):
    """Also a disabled one can be read, by its id; its channel belongs to no other."""
    inspect = fitted.skin_calib.inspect
    inspect.taxel.wanted = "band.0.1"
    assert not inspect.taxel.disabled and inspect.taxel.channel == 1
    bpy.ops.skin_calib.taxel_toggle(taxel="band.0.1")
    bpy.ops.skin_calib.fit()
    assert inspect.taxel.disabled and inspect.taxel.key == fitted.skin_calib.result.key
    bpy.ops.skin_calib.taxel_toggle(taxel="band.0.1")
    bpy.ops.skin_calib.taxel_channel(taxel="band.0.1", channel=700)
    bpy.ops.skin_calib.fit()
    assert not inspect.taxel.disabled and inspect.taxel.channel == 700
    inspect.taxel.wanted = "700"
    assert inspect.taxel.id == "band.0.1" and not inspect.taxel.problem


def test_channel_in_use_is_refused_or_swapped(bpy, addon, fitted):
    """The message names the taxel that has it; a swap changes both; a disabled taxel's channel is free."""
    with pytest.raises(RuntimeError, match=r"Channel 3 belongs to band\.1\.0\. Choose another channel, or tick Swap"):
        bpy.ops.skin_calib.taxel_channel(taxel="band.0.1", channel=3)
    assert not fitted.skin_calib.skins[0].taxels
    bpy.ops.skin_calib.taxel_channel(taxel="band.0.1", channel=3, swap=True)
    bpy.ops.skin_calib.fit()
    taxels = patch_of(addon, fitted).taxels
    assert taxels.channels[[taxels.ids.index(f"band.{k}") for k in ("0.1", "1.0")]].tolist() == [3, 1]
    bpy.ops.skin_calib.taxel_toggle(taxel="band.0.2")
    bpy.ops.skin_calib.taxel_channel(taxel="band.0.0", channel=2)  # before another fit
    with pytest.raises(RuntimeError, match=r"Channel 2 belongs to band\.0\.0"):
        bpy.ops.skin_calib.taxel_channel(taxel="band.0.1", channel=2)
    with pytest.raises(RuntimeError, match="has no taxel band.9.9"):
        bpy.ops.skin_calib.taxel_toggle(taxel="band.9.9")
    bpy.ops.skin_calib.fit()
    bpy.ops.skin_calib.single_taxel_remove(skin=0, index=0)
    with pytest.raises(RuntimeError, match=r"Taxels band\.0\.1 and band\.1\.0 both have channel 1"):
        bpy.ops.skin_calib.fit()


def test_boards_are_listed_before_one_is_disabled(bpy, addon, plan_file):
    """Another fit would number boards anew that fill the surface, and disable another one."""
    bpy.ops.skin_calib.import_plan(filepath=str(plan_file(skins=[BOARDS])))
    bpy.ops.skin_calib.fit()
    link = bpy.context.object
    before = patch_of(addon, link).taxels
    bpy.ops.skin_calib.taxel_toggle(taxel=before.ids[0])
    assert link.skin_calib.skins[0].choice == "listed"
    bpy.ops.skin_calib.fit()
    assert patch_of(addon, link).taxels.ids == before.ids[1:]
    link.skin_calib.skins[0].choice = "fill"
    with pytest.raises(RuntimeError, match="List its boards one by one"):
        bpy.ops.skin_calib.fit()


def test_same_bytes_with_every_interface(bpy, addon, plan_file, fit_plainly, tmp_path):
    """A plan with single taxels is imported, exported and fitted like its file."""
    single = {"taxels": [{"taxel": "0.2", "enabled": False}, {"taxel": "1.0", "channel": 90}]}
    source = plan_file(skins=[BAND | single, BOARDS | LISTED | {"taxels": [{"taxel": "1.0", "enabled": False}]}])
    out, again = tmp_path / "out.json", tmp_path / "again.plan.json"
    bpy.ops.skin_calib.import_plan(filepath=str(source))
    assert bpy.ops.skin_calib.export_calibration(filepath=str(out)) == {"FINISHED"}
    assert out.read_bytes() == fit_plainly(source)
    assert bpy.ops.skin_calib.export_plan(filepath=str(again)) == {"FINISHED"}
    written = [skin["taxels"] for skin in json.loads(again.read_text())["skins"]]
    assert written == [single["taxels"], [{"taxel": "1.0", "enabled": False}]]
    made = json.loads(out.read_text())["patches"]
    assert "band.0.2" not in made[0]["taxels"]["id"] and made[0]["taxels"]["channel"].count(90) == 1
    assert made[1]["taxels"]["id"] == ["boards.0.0", "boards.0.-1"]


def test_redo_of_a_change_is_followed_by_its_fit(bpy, updates, link, monkeypatch):
    """Undo and redo restore the plan of a disabled taxel, and the result follows although Live is off."""
    bpy.ops.skin_calib.fit()
    bpy.ops.ed.undo_push(message="before")
    bpy.ops.skin_calib.taxel_toggle("EXEC_DEFAULT", True, taxel="band.0.1")
    rest(updates, monkeypatch)
    disabled = bpy.context.object.skin_calib.result.key
    bpy.ops.ed.undo()
    rest(updates, monkeypatch)
    assert not bpy.context.object.skin_calib.result.outdated
    bpy.ops.ed.redo()
    rest(updates, monkeypatch)
    result = bpy.context.object.skin_calib.result
    assert not result.outdated and result.key == disabled
    bpy.context.object.skin_calib.grid.n += 1
    rest(updates, monkeypatch)
    assert bpy.context.object.skin_calib.result.outdated, "other changes wait for the button"
