"""A key that is added to the table is in Blender, too: its property, its row, and both directions of its value."""

from dataclasses import replace
from importlib import import_module
from types import SimpleNamespace

import pytest

from tests.blender.test_registration import Layout


@pytest.fixture
def added(extension, bpy):
    """The record of a sheet with a new key, as the running extension has it, and a registered group for it."""
    key, keys = (import_module(f"{extension}.skin_calib_addon.plan.{name}") for name in ("key", "keys"))
    of_keys = import_module(f"{extension}.skin_calib_addon.blender.properties.of_keys")
    thickness = key.Key(
        "thickness",
        keys.length(minimum=0, maximum=0.1),
        "Thickness of the sheet.",
        default=0.001,
        otherwise="one millimetre",
        label="Thickness",
        switch=key.Switch("auto_thickness", "Standard Thickness"),
    )
    record = replace(keys.SHEET, make=lambda **values: SimpleNamespace(**values), keys=(*keys.SHEET.keys, thickness))
    annotations = of_keys.properties_of(record.keys)
    group = type("SKIN_PG_with_thickness", (bpy.types.PropertyGroup,), {"__annotations__": annotations})
    bpy.utils.register_class(group)
    bpy.types.Object.with_thickness = bpy.props.PointerProperty(type=group)
    yield record
    del bpy.types.Object.with_thickness
    bpy.utils.unregister_class(group)


@pytest.fixture
def fields(extension):
    """The module of the running extension."""
    return import_module(f"{extension}.skin_calib_addon.blender.scene.fields")


@pytest.mark.slow
def test_added_key_has_a_property(added, link):
    """With label, tooltip, limit and unit, and the switch for its default."""
    properties = link.with_thickness.bl_rna.properties
    value, switch = properties["thickness"], properties["auto_thickness"]
    assert (value.name, value.description) == ("Thickness", "Thickness of the sheet")
    assert (value.unit, value.hard_min, round(value.default, 9)) == ("LENGTH", 0, 0.001)
    assert (switch.name, switch.description, switch.default) == ("Standard Thickness", "One millimetre", True)


def test_added_key_is_read_and_written(added, link, fields):
    """In metres, whatever the unit of the scene; the switch stands for the default."""
    group = link.with_thickness
    assert fields.read(added, group, 0.001).thickness == 0.001
    group.auto_thickness, group.thickness = False, 2.5
    read = fields.read(added, group, 0.001)
    assert read.thickness == 0.0025 and read.lattice.rows == 6
    read.thickness = 0.003
    fields.write(added, read, group, 0.001)
    assert (group.thickness, group.auto_thickness) == (3.0, False)
    read.thickness = 0.001
    fields.write(added, read, group, 0.001)
    assert group.auto_thickness


def test_value_beyond_its_limits_is_refused_in_words_of_the_window(added, link, fields, extension):
    """Where it is, by labels; what is wrong, in units for people."""
    errors = import_module(f"{extension}.skin_calib_addon.common.errors")
    link.with_thickness.auto_thickness, link.with_thickness.thickness = False, 5
    with pytest.raises(errors.InvalidPlan, match=r"^Skin 'band', Thickness: must be at most 100 mm, not 5000 mm\.$"):
        fields.read(added, link.with_thickness, 1.0, ("Skin 'band'",))


def test_added_key_has_a_row(added, bpy, link, extension):
    """The last one of the sheet; the switch hides the value."""
    rows = import_module(f"{extension}.panels.rows")

    def shown():
        layout = Layout(bpy, [])
        by_hand = "name", "surface", "landmarks", "taxels", "touches"
        rows.draw_keys(layout, link.with_thickness, [k for k in added.keys if k.name not in by_hand])
        return layout.shown

    assert shown()[-2:] == ["first_channel", "auto_thickness"]
    link.with_thickness.auto_thickness = False
    assert shown()[-2:] == ["auto_thickness", "thickness"]
    assert shown()[:2] == ["rows", "columns"]
