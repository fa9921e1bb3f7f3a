"""The extension can be removed without a trace, and each of its parts has a description."""

import importlib
from types import MethodType

import pytest

from tests.blender.conftest import modules


def traces(bpy):
    """Return everything of the extension that is registered in Blender."""
    return {
        "classes": sorted(name for name in dir(bpy.types) if name.startswith("SKIN_")),
        "operators": sorted(dir(bpy.ops.skin_calib)),
        "properties": [p.identifier for p in bpy.types.Object.bl_rna.properties if "skin" in p.identifier],
        "menus": [
            function.__name__
            for menu in (bpy.types.TOPBAR_MT_file_import, bpy.types.TOPBAR_MT_file_export)
            for function in menu._dyn_ui_initialize()
            if "skin_calib" in function.__module__
        ],
        "handlers": [
            function
            for name in dir(bpy.app.handlers)
            if isinstance(getattr(bpy.app.handlers, name), list)
            for function in getattr(bpy.app.handlers, name)
            if "skin_calib" in getattr(function, "__module__", "")
        ],
    }


def test_extension_leaves_nothing_behind(bpy, addon, extension):
    """It is disabled, enabled and disabled: nothing, all, and nothing is registered."""
    import addon_utils

    enabled = traces(bpy)
    assert len(enabled["operators"]) > 60
    assert enabled["properties"] == ["skin_calib"] and enabled["menus"] == ["draw_import", "draw_export"]
    for _ in range(2):
        addon_utils.disable(extension)
        assert not any(traces(bpy).values())
        assert not addon.drawing._handles and not addon.command._commands
        assert not addon.drawing.layers_for.cache_info().currsize
        assert not addon.results._results
        addon_utils.enable(extension)
        assert traces(bpy) == enabled


def test_operator_has_tooltip_and_undo(bpy):
    """Each operator has a description of one line; each one that changes the scene can be undone."""
    for name in dir(bpy.ops.skin_calib):
        operator = getattr(bpy.ops.skin_calib, name)
        description = operator.get_rna_type().description
        assert len(description) > 15 and "\n" not in description, name
        assert operator.get_rna_type().name != name
        undo = "UNDO" in getattr(bpy.types, f"SKIN_CALIB_OT_{name}").bl_options
        assert undo == (
            name
            not in ("export_calibration", "export_taxels", "replay_play", "preset_save", "save_picture", "zones_save")
        ), name


def properties(group, path=""):
    """Yield every property of a group and of its groups, with its path."""
    for item in group.properties:
        if item.identifier not in ("rna_type", "name") or path.endswith("skins."):
            yield path + item.identifier, item
        if item.type in ("POINTER", "COLLECTION") and item.identifier != "rna_type":
            yield from properties(item.fixed_type, f"{path}{item.identifier}.")


def test_property_has_tooltip_and_no_animation(bpy):
    """Each property of a plan has a description, and none can be animated."""
    found = dict(properties(bpy.types.Object.bl_rna.properties["skin_calib"].fixed_type))
    assert {
        "link",
        "cover.cuts.normal",
        "grid.tolerance",
        "skins.name",
        "skins.landmarks.cell",
        "result.mean",
    } < found.keys()
    assert [path for path, item in found.items() if len(item.description) < 6] == []
    assert [item.name for item in found.values() if len(item.name) > MAX_LABEL] == []
    assert [path for path, item in found.items() if item.is_animatable and item.type != "POINTER"] == []


MAX_LABEL = 20  # characters that a narrow sidebar shows


class Layout:
    """A substitute for a panel's layout: it accepts the same calls, and records what is shown."""

    def __init__(self, bpy, shown, is_open=True, called=None):
        self.bpy, self.shown, self.is_open = bpy, shown, is_open
        self.called = [] if called is None else called  # operators

    def _part(self, **_):
        return Layout(self.bpy, self.shown, self.is_open, self.called)

    box = row = column = grid_flow = _part

    def panel_prop(self, data, name):
        """Return the header, which shows nothing here, and the body, which is open."""
        assert name in data.bl_rna.properties, f"{data} has no {name}"
        return Layout(self.bpy, []), self if self.is_open else None

    def label(self, text, icon="NONE"):
        self.check_icon(icon)
        self.shown.append(text)

    def prop(self, data, name, index=0, **_):
        """Record the property, once for all its components; lengths are shown in millimetres."""
        assert name in data.bl_rna.properties, f"{data} has no {name}"
        assert getattr(data.bl_rna.properties[name], "unit", "") not in ("LENGTH", "AREA"), f"{name} is not in mm"
        if index == 0:
            self.shown.append(name.removesuffix("_mm"))

    def prop_search(self, data, name, owner, names, **_):
        assert names in owner.bl_rna.properties, f"{owner} has no {names}"
        self.prop(data, name)

    def prop_enum(self, data, name, value, **_):
        assert value in data.bl_rna.properties[name].enum_items, f"{name} of {data} is never {value}"
        self.shown.append(f"{name}: {value}")

    def template_list(self, kind, _id, data, listed, active, index, **_):
        assert hasattr(self.bpy.types, kind)
        self.prop(data, listed)
        self.prop(active, index)

    def separator(self, **_):
        pass

    def path_menu(self, folders, operator, **_):
        self.operator(operator)

    def menu(self, name, icon="NONE", **_):
        self.check_icon(icon)
        Drawn(getattr(self.bpy.types, name), self).draw(self.bpy.context)

    def operator_menu_enum(self, name, value, icon="NONE", **_):
        self.check_icon(icon)
        assert value in getattr(self.bpy.ops.skin_calib, name.split(".")[1]).get_rna_type().properties
        self.operator(name)

    def check_icon(self, icon):
        known = self.bpy.types.UILayout.bl_rna.functions["label"].parameters["icon"].enum_items
        assert icon in known, f"Blender has no icon {icon}"

    def operator(self, name, icon="NONE", **_):
        self.check_icon(icon)
        self.called.append(name)
        module, name = name.split(".")
        self.shown.append(getattr(getattr(self.bpy.ops, module), name).get_rna_type().name)
        return self


class Drawn:
    """A substitute for a panel or a menu, which only Blender can create."""

    def __init__(self, panel, layout):
        self.panel, self.layout, self.path_menu = panel, layout, layout.path_menu

    def __getattr__(self, name):
        found = getattr(self.panel, name)
        return MethodType(found, self) if callable(found) else found


def draw(bpy, name, is_open=True):
    """Return what a panel shows, with its steps open or closed; None if it is not shown."""
    layout = Layout(bpy, [], is_open)
    work = bpy.types.SKIN_PT_work
    step = next((step for step in (work.robot, *work.steps) if step.name == name), None)
    if step:
        step.draw(layout, bpy.context.object.skin_calib)
        return layout.shown
    panel = getattr(bpy.types, f"SKIN_PT_{name}")
    if hasattr(panel, "poll") and not panel.poll(bpy.context):
        return None
    Drawn(panel, layout).draw(bpy.context)
    return layout.shown


@pytest.mark.parametrize("kind", ["tube", "auto", "sector", "across", "planes"])
def test_panel_shows_existing_properties(bpy, link, kind):
    """Every button and field of a panel exists, for any plan."""
    plan = link.skin_calib
    plan.grid.kind, plan.grid.auto_axis, plan.grid.auto_margin = kind, False, False
    plan.skins[0].centred = False
    bpy.ops.skin_calib.cut_add()
    if kind == "planes":
        for family in "uv":
            bpy.ops.skin_calib.plane_add(family=family)
    panels = [name.removeprefix("SKIN_PT_") for name in dir(bpy.types) if name.startswith("SKIN_PT_")]
    steps = [step.name for step in (bpy.types.SKIN_PT_work.robot, *bpy.types.SKIN_PT_work.steps)]
    shown = {name: draw(bpy, name) for name in (*panels, *steps)}
    assert shown["skin"][:5] == ["name", "Save Skin as Preset", "Remove Skin", "kind", "rows"]
    assert (shown["grid"].count("normal") == 2) == (kind == "planes")
    assert ("tolerance" in shown["grid"]) == (kind == "auto")
    assert shown["fit"] == ["Press Fit above"] and shown["status"] == [
        "Not fitted: press Propose or Fit",
        "Propose",
        "Fit",
        "live",
    ]
    assert "Fit the link to see its skin" in shown["inspect"]


def test_panel_lists_landmarks_and_zones(bpy, link):
    """Each has its fields and buttons; landmarks hide the origin that they replace."""
    bpy.ops.skin_calib.skin_add(kind="hexagons")
    link.skin_calib.skins[0].opened = True
    bpy.ops.skin_calib.landmark_add(skin=0)
    bpy.ops.skin_calib.zone_add(skin=1)
    shown = draw(bpy, "skin")
    assert shown.count("centred") == 1 and "Landmarks replace the origin" in shown
    heads = [["Landmark 0", "Place on Link", "Place at 3D Cursor", "Remove Landmark", "cell", "point"]]
    heads += [["Excluded Zone 0", "Place on Link", "Place at 3D Cursor", "Remove Excluded Zone", "point", "radius"]]
    for head in heads:
        start = shown.index(head[0])
        assert shown[start : start + len(head)] == head


def test_panel_shows_the_selected_one_of_many_skins(bpy, link):
    """Up to three have a box each; of more, the list selects one, so that Export stays near."""
    for count in (2, 3, 4):
        bpy.ops.skin_calib.skin_add(kind="hexagons")
        assert draw(bpy, "skin").count("Remove Skin") == (count if count <= 3 else 1)
    assert link.skin_calib.skin_index == 3
    link.skin_calib.skin_index, link.skin_calib.skins[0].opened = 0, True
    assert "rows" in draw(bpy, "skin")  # the sheet
    for _ in range(4):
        assert draw(bpy, "skin").count("Remove Skin") > 0
        bpy.ops.skin_calib.skin_remove(index=0)


def test_panel_shows_warnings_line_by_line(bpy, link):
    """Message and advice are in lines that the sidebar can show."""
    result = link.skin_calib.result
    result.key, warning = "key", result.warnings.add()
    warning.severity, warning.message = "warning", "The surface is 7.1 mm off the mesh at the first plane."
    warning.advice = "Move it."
    expected = ["The surface is 7.1 mm off the mesh", "at the first plane.", "Move it."]
    assert draw(bpy, "status")[-3:] == expected


def test_missing_package_is_named_with_what_to_do_in_blender(bpy, extension, monkeypatch):
    """Of a package of ours; anything else that is missing is a defect, whose message stays."""
    package = importlib.import_module(extension)
    registration = modules(extension, "registration").registration

    def fail(name):
        raise ModuleNotFoundError(f"No module named {name!r}", name=name)

    for name, words in (("scipy", "needs scipy: install the zip .* Install from Disk"), ("scipi", "No module named")):
        monkeypatch.setattr(registration, "register", lambda _package, name=name: fail(name))
        with pytest.raises(ModuleNotFoundError, match=words):
            package.register()
