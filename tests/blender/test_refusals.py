"""Impossible operations are refused with the reason, and do not change scene and files."""

import math
import re

import pytest

from tests.blender.conftest import PLAN
from tests.examples import slow


def scene_state(bpy, addon):
    """Return everything that a refused operator could change."""
    return [(o.name, values(o.skin_calib), tuple(o.location)) for o in bpy.data.objects], [
        m.name for m in bpy.data.meshes
    ]


def values(group):
    """Return all properties of a group and of its groups."""
    return {
        item.identifier: values(value)
        if item.type == "POINTER"
        else [values(entry) for entry in value]
        if item.type == "COLLECTION"
        else [*value]
        if getattr(item, "is_array", False)
        else value
        for item in group.bl_rna.properties
        if item.identifier != "rna_type"
        for value in [getattr(group, item.identifier)]
    }


def folder_state(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()}


def change(link, what):
    """Set properties of a plan by their paths, or call a function."""
    if callable(what):
        what(link)
        return
    for path, value in what.items():
        group, _, name = path.rpartition(".")
        setattr(link.skin_calib.path_resolve(group) if group else link.skin_calib, name, value)


BOARDS, FILE = {"skins[0].kind": "hexagons"}, {"skins[0].kind": "imported"}
BAD_LINKS = {
    "no faces": (lambda link: link.data.clear_geometry(), "arm: The mesh has no faces"),
    "not finite": (lambda link: setattr(link.data.vertices[3].co, "x", math.nan), "arm: Vertex 3 of the mesh is not"),
    "millimetres": (lambda link: setattr(link, "scale", (1000,) * 3), "arm is .* m across in this scene; set the"),
    "few planes": ({"grid.n": 3}, "Degree 3 needs at least 4 u-planes, but the grid has 3"),
    "margin": ({"grid.margin": 0.05}, "A margin of 50 mm at both ends leaves nothing of the .* mm along the axis"),
    "far cut": (lambda link: setattr(link.skin_calib.cover.cuts.add(), "point", (0, 0, 3)), "Cut 0 removes the whole"),
    "no planes": ({"grid.kind": "planes"}, "arm: U-Planes: must not be empty"),
    "sector": (
        {"grid.kind": "sector", "grid.start": 1, "grid.stop": 0.5},
        "The sector from 1 to 0.5 rad must",
    ),
    "tolerance": ({"grid.kind": "auto", "grid.tolerance": 0}, "arm: Tolerance: must be more than 0 mm, not 0 mm"),
    "name": ({"link": "a\nb"}, "arm: Link: must have at least one character, and no control characters"),
    "overlap": (
        {"skins[0].columns": 26},
        "skin 'band' overlaps itself by up to .* a smaller pitch, or allow the overlap",
    ),
    "channel": (
        {"skins[0].auto_channel": False, "skins[0].first_channel": 2**31 - 1},
        "Skin 'band' would end on channel 2147483652",
    ),
    "landmark": (
        lambda link: setattr(link.skin_calib.skins[0].landmarks.add(), "cell", (2, 0)),
        r"Skin 'band' has a landmark at cell \[2, 0\], but the sheet has 2 x 3 cells",
    ),
    "cells": (
        BOARDS | {"skins[0].choice": "listed", "skins[0].cells": "0,0 1;0"},
        "Skin 'band', Cells: '1;0' is not a cell; write q,r",
    ),
    "direction": (
        BOARDS | {"skins[0].auto_direction": False, "skins[0].direction": (0, 0, 0)},
        "The direction of skin 'band' is zero",
    ),
    "no file": (FILE, "Skin 'band', File: is empty; choose the file that has the taxels"),
    "lost file": (FILE | {"skins[0].file": "/lost.csv"}, "/lost.csv"),
    "rotation": (
        FILE | {"skins[0].file": "/lost.csv", "skins[0].framed": True, "skins[0].rotation": (math.nan,) * 9},
        "arm: Skin 'band', Rotation: must be a finite number",
    ),
}


# Keys, pointers and patterns of plan files, which the window does not have.
OF_FILES = re.compile(
    r"""/(grid|skins|cover|degree)\b|"(n|m|lines|from|to|normal|axis|origin|direction|frame|rotation)"|"""
    r'''"(first_channel|overlap)"|lengths are in metres|\^\["'''
)


@pytest.mark.parametrize("case", BAD_LINKS)
def test_bad_link_is_refused_by_button_and_command(bpy, addon, link, tmp_path, capsys, case):
    """They give the same message, in words of the window, and change nothing."""
    what, message = BAD_LINKS[case]
    out = tmp_path / "out.json"
    out.write_bytes(b"as it was")
    change(link, what)
    bpy.context.view_layer.update()
    link.skin_calib.result.outdated = True  # as the timer finds, or the refusal
    scene, files = scene_state(bpy, addon), folder_state(tmp_path)
    with pytest.raises(RuntimeError, match=f"Error: .*{message}") as caught:
        bpy.ops.skin_calib.fit()
    assert not OF_FILES.search(str(caught.value))
    assert addon.command.main(["fit", "-o", str(out)]) == 1
    assert len(capsys.readouterr().err.splitlines()) == 1
    assert str(scene_state(bpy, addon)) == str(scene) and folder_state(tmp_path) == files


BAD_PLANS = {
    "misspelt": ({"gird": PLAN["grid"]}, "arm.plan.json is not a valid plan: .*/gird"),
    "wrong unit": (
        {"unit": "mm"},
        'arm.stl has a diameter of .* m when read in "mm". Set "unit" to that of its numbers: "m"',
    ),
    "no mesh": ({"mesh": "leg.stl"}, "no mesh file at .*leg.stl"),
    "huge response": ({"response": {"kind": "polynomial", "coefficients": [1e300]}}, "The plan has the number 1e.300"),
}


@pytest.mark.parametrize("case", BAD_PLANS)
def test_bad_plan_is_refused(bpy, addon, plan_file, tmp_path, case):
    """A plan that cannot be read, or does not fit its mesh, is not opened."""
    changes, message = BAD_PLANS[case]
    path = plan_file(**changes)
    scene, files = scene_state(bpy, addon), folder_state(tmp_path)
    with pytest.raises(RuntimeError, match=f"Error: .*{message}"):
        bpy.ops.skin_calib.import_plan(filepath=str(path))
    assert scene_state(bpy, addon) == scene and folder_state(tmp_path) == files


@pytest.mark.parametrize("operator", ["export_plan", "export_calibration", slow("export_taxels")])
def test_path_that_cannot_be_written_is_refused(bpy, addon, link, tmp_path, operator):
    """A missing folder, a folder instead of a file, and an empty path change neither scene nor files."""
    (tmp_path / "folder").mkdir()
    link.location.x = 0.01  # no file has this mesh: the plan needs a new one
    scene, files = scene_state(bpy, addon), folder_state(tmp_path)
    for path in (tmp_path / "missing" / "out.json", tmp_path / "folder"):
        with pytest.raises(RuntimeError, match="Error: cannot write "):
            getattr(bpy.ops.skin_calib, operator)(filepath=str(path))
    assert scene_state(bpy, addon) == scene and folder_state(tmp_path) == files


def test_robot_is_not_exported_to_an_empty_path(bpy, link, tmp_path, monkeypatch):
    """It is the working directory of Blender."""
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    bpy.ops.skin_calib.fit()
    with pytest.raises(RuntimeError, match="Error: Choose a folder"):
        bpy.ops.skin_calib.export_robot(directory="")
    assert not list((tmp_path / "here").iterdir())


def bare_object(bpy, kind="MESH"):
    data = bpy.data.meshes.new("bare") if kind == "MESH" else None
    bare = bpy.data.objects.new("bare", data)
    bpy.context.scene.collection.objects.link(bare)
    bpy.context.view_layer.objects.active = bare
    return bare


@pytest.mark.parametrize(
    "operator", ["fit", "skin_add", "cut_add", "place", "export_plan", "export_calibration", "export_taxels"]
)
def test_button_without_a_link_says_why(bpy, operator):
    """For no active object, an empty, and a mesh without a name, the message states what to do."""
    press = getattr(bpy.ops.skin_calib, operator)
    with pytest.raises(RuntimeError, match="Select the mesh object of a link"):
        press()
    bare_object(bpy, "EMPTY")
    with pytest.raises(RuntimeError, match="Select the mesh object of a link"):
        press()
    bare_object(bpy)
    if operator in ("skin_add", "cut_add"):
        assert press() == {"FINISHED"}
    elif operator == "place":
        with pytest.raises(RuntimeError, match="There is no skin 0; there are 0"):
            press()
    else:
        with pytest.raises(RuntimeError, match="Give the object a link name first"):
            press()


POINTS = {"point": (0.01, 0.02, 0.03)}
NOT_THERE = {
    "cut_remove": {"index": 0},
    "skin_remove": {"index": 2},
    "landmark_add": {"skin": 2},
    "landmark_remove": {"skin": 0, "index": 1},
    "zone_add": {"skin": 2},
    "zone_remove": {"skin": 1, "index": 1},
    "place": POINTS | {"skin": 2},
    "frame_find": {"skin": 2},
    "place_at_cursor": {"skin": 1, "what": "zone", "index": 1},
}


OTHER_KIND = {
    "landmark_add": {"skin": 1},
    "landmark_remove": {"skin": 1},
    "zone_add": {"skin": 0},
    "zone_remove": {"skin": 0},
    "place": POINTS | {"skin": 1, "what": "landmark"},
    "place_at_cursor": {"skin": 0, "what": "zone"},
    "frame_find": {"skin": 0},
}


@pytest.mark.parametrize(
    ("calls", "message"),
    [
        (NOT_THERE, r"Error: There is no .+ \d; there are \d, counted from 0"),
        (OTHER_KIND, r"Error: Skin '(band|skin)' has no .+, which belong to Kind: .+\. Choose such a skin"),
    ],
    ids=["not there", "other kind"],
)
def test_entry_that_a_skin_does_not_have_is_refused(bpy, addon, link, calls, message):
    """The message has the index and the length of the list; boards have no landmarks, sheets have no zones."""
    bpy.ops.skin_calib.skin_add(kind="hexagons")
    bpy.ops.skin_calib.landmark_add(skin=0)
    bpy.ops.skin_calib.zone_add(skin=1)
    before = scene_state(bpy, addon)
    for operator, words in calls.items():
        with pytest.raises(RuntimeError, match=message):
            getattr(bpy.ops.skin_calib, operator)(**words)
        assert scene_state(bpy, addon) == before


def test_linked_library_is_fitted_from_outside_and_not_edited(bpy, addon, link, fit_scene, tmp_path):
    """The command fits an object of another file; the buttons state where to edit it."""
    own = fit_scene()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "library.blend"))
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    with bpy.data.libraries.load(str(tmp_path / "library.blend"), link=True) as (_, wanted):
        wanted.objects = ["arm"]
    bpy.context.scene.collection.objects.link(wanted.objects[0])
    bpy.context.view_layer.objects.active = wanted.objects[0]
    assert fit_scene() == own
    for press in (bpy.ops.skin_calib.fit, bpy.ops.skin_calib.skin_add, bpy.ops.skin_calib.export_plan):
        with pytest.raises(RuntimeError, match="belongs to another file; open that file, or make the object local"):
            press()
    wanted.objects[0].make_local()
    assert bpy.ops.skin_calib.fit() == {"FINISHED"}


def test_import_from_edit_mode_leaves_it(bpy, plan_file, link):
    """The new link is active in object mode; the edited mesh is complete."""
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.skin_calib.import_plan(filepath=str(plan_file("leg")))
    assert bpy.context.object.name == "leg" and bpy.context.mode == "OBJECT"
    assert [o.name for o in bpy.context.selected_objects] == ["leg"]


def test_landmark_far_from_the_mesh_is_named_in_words_of_the_window(bpy, link):
    """The message said "The origin", which landmarks replace, and "in metres" next to fields in millimetres."""
    bpy.ops.skin_calib.landmark_add(skin=0)  # at the 3D cursor, in the middle of the link
    with pytest.raises(RuntimeError, match=r"Landmark 0, \(0.0, 0.0, 0.0\) mm, is .* covers, in the link frame"):
        bpy.ops.skin_calib.fit()
