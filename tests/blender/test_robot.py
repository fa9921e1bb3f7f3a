"""A whole robot in the window: import, list, proposals, fits and export of all links."""

import json

import numpy as np
import pytest
import trimesh
from numpy.testing import assert_allclose

from skin_calib_addon import cli
from skin_calib_addon.robot.kinematics import link_poses
from skin_calib_addon.robot.link_mesh import load_urdf_mesh
from skin_calib_addon.robot.urdf import read_robot
from tests.blender.conftest import ROOT, modules, robot_text, written
from tests.blender.test_link_frame import codes, without_warnings
from tests.blender.test_refusals import scene_state
from tests.blender.test_registration import draw
from tests.shapes import box, subdivided, welded
from tests.unit.robot.test_robot_mesh import shape

ROBOTS = ROOT.parent / "shared" / "data" / "robots"


@pytest.fixture
def robot(bpy, urdf):
    """Import this robot, and return its file."""
    assert bpy.ops.skin_calib.import_robot(filepath=str(urdf)) == {"FINISHED"}
    return urdf


@pytest.mark.parametrize("metre", [1.0, 0.001])
def test_links_lie_in_their_frames_in_the_zero_pose(bpy, addon, urdf, metre):
    """Each link has the geometry that the command line reads, to the bit, and the pose of forward kinematics."""
    bpy.context.scene.unit_settings.scale_length = metre
    bpy.ops.skin_calib.import_robot(filepath=str(urdf))
    links = {o.skin_calib.link: o for o in bpy.data.objects if o.type == "MESH"}
    assert [*links] == ["hand", "lower", "upper"]
    poses = link_poses(read_robot(urdf))
    for name, link in links.items():
        assert addon.link_meshes.read_mesh(link, bpy.context).sha256 == load_urdf_mesh(urdf, name).sha256
        pose = np.array(addon.link_meshes.link_frame(link))
        pose[:3, 3] *= metre
        assert_allclose(pose, poses[name], atol=1e-6)
        assert_allclose(np.array(link.parent.matrix_world)[:3, :3], poses[name][:3, :3], atol=1e-6)
        assert link.skin_calib.mesh_file == "bot.urdf" and link.name == name
    assert links["lower"].parent.parent.name == "elbow_frame"
    assert {o.name for o in bpy.data.collections["bot"].objects} == {
        *("upper", "lower", "hand"),
        *(f"{name}_frame" for name in poses),
    }
    assert bpy.context.object.name == "upper" and [o.name for o in bpy.context.selected_objects] == ["upper"]


def test_broken_link_is_listed_with_its_reason(bpy, urdf, capfd):
    """The others are imported; the list has the broken link, too, and the panel the reason of the selected one."""
    bpy.ops.skin_calib.import_robot(filepath=str(urdf))
    frame = bpy.data.objects["finger_frame"]
    reason = "the mesh file package://bot/meshes/none.stl of bot.urdf was not found"
    assert reason in frame.skin_calib.refusal and bpy.data.objects.get("finger") is None
    assert f"Warning: finger: {reason}" in capfd.readouterr().out
    bpy.context.scene.skin_calib.row = bpy.context.scene.objects.find("finger_frame")
    assert bpy.context.object == frame
    assert f"finger: refused. {reason}" in " ".join(draw(bpy, "robot"))


def test_import_of_a_robot_is_one_step_of_undo(bpy, urdf):
    """Undo removes objects, frames and the collection; redo brings them back."""
    bpy.ops.ed.undo_push(message="start")
    assert bpy.ops.skin_calib.import_robot("EXEC_DEFAULT", True, filepath=str(urdf)) == {"FINISHED"}
    assert len(bpy.data.objects) == 8
    bpy.ops.ed.undo()
    assert not bpy.data.objects and not bpy.data.collections
    bpy.ops.ed.redo()
    assert len(bpy.data.objects) == 8 and bpy.data.objects["upper"].skin_calib.urdf


@pytest.mark.parametrize(
    "text, words",
    [
        ("no robot", "bot.urdf"),
        ('<robot name="b"><link name="a"/><link name="a"/></robot>', 'repeats the link "a"'),
        ('<robot name="b"><link name="a"/></robot>', "No link of bot.urdf has a mesh"),
        (f'<robot name="b"><link name="a">{shape("none.stl")}</link></robot>', "a: the mesh file none.stl"),
        (f'<robot name="b"><link name="a">{shape("../meshes/box.obj")}</link><link name="b"/></robot>', "2 links that"),
    ],
)
def test_bad_robot_changes_nothing(bpy, addon, urdf, text, words):
    """It is refused with one line."""
    urdf.write_text(text)
    before = scene_state(bpy, addon)
    with pytest.raises(RuntimeError, match=f"Error: .*{words}"):
        bpy.ops.skin_calib.import_robot(filepath=str(urdf))
    assert scene_state(bpy, addon) == before and not bpy.data.collections


def test_moved_link_keeps_its_calibration(bpy, addon, robot, fit_scene):
    """Poses of the object and of each frame above are those of the robot: mesh and bytes stay, the drawing follows.

    An object that is away from its frame has a warning.
    """
    link = bpy.data.objects["lower"]
    bpy.ops.object.select_all(action="DESELECT")
    bpy.context.view_layer.objects.active = link
    bpy.ops.skin_calib.skin_add(kind="sheet")
    skin = link.skin_calib.skins[0]
    skin.rows, skin.columns, skin.direction = 2, 3, (0, 1, 0)
    assert bpy.ops.skin_calib.fit() == {"FINISHED"}
    before, mesh = fit_scene(), addon.link_meshes.read_mesh(link, bpy.context).sha256
    moved = [link, link.parent, bpy.data.objects["elbow_frame"], bpy.data.objects["upper_frame"]]
    for k, thing in enumerate(moved):
        thing.location, thing.rotation_euler = (0.1 * k, -0.3, 0.02 + k), (1, -2 + k, 0.5)
    bpy.context.view_layer.update()
    assert addon.link_meshes.read_mesh(link, bpy.context).sha256 == mesh
    assert without_warnings(fit_scene()) == without_warnings(before) and codes(before) == []
    assert not link.skin_calib.result.outdated
    assert_allclose(addon.link_meshes.link_frame(link), link.matrix_world, atol=1e-6)
    link.parent = None
    bpy.context.view_layer.update()
    assert addon.link_meshes.read_mesh(link, bpy.context).sha256 == mesh
    assert_allclose(addon.link_meshes.link_frame(link), link.matrix_world, atol=1e-6)


def test_selected_row_is_the_active_link(bpy, robot):
    """The list and the active object agree in both directions."""
    scene = bpy.context.scene
    for name in ("hand", "upper"):
        scene.skin_calib.row = scene.objects.find(name)
        assert bpy.context.object.name == name and [o.name for o in bpy.context.selected_objects] == [name]
    bpy.context.view_layer.objects.active = bpy.data.objects["lower"]
    assert scene.skin_calib.row == scene.objects.find("lower")


def test_saved_robot_is_the_same_after_opening(bpy, addon, robot, tmp_path):
    """Meshes, frames and the file of the robot, which is kept relative to the scene."""
    before = {o.name: addon.link_meshes.read_mesh(o, bpy.context).sha256 for o in bpy.data.objects if o.type == "MESH"}
    bpy.context.preferences.filepaths.use_relative_paths = True
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "scene.blend"))
    links = [o for o in bpy.data.objects if o.type == "MESH"]
    assert {o.name: addon.link_meshes.read_mesh(o, bpy.context).sha256 for o in links} == before
    assert all(addon.robots.urdf_of(link).samefile(robot) for link in links)


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    """A robot whose proposals are quick: a tube, a block on it that covers one end, and a link too small for skin."""
    folder = tmp_path_factory.mktemp("arm")
    written(subdivided(welded(trimesh.creation.cylinder(0.03, 0.12, sections=48))), folder / "tube.ply")
    written(box((-0.04, -0.04, 0), (0.04, 0.04, 0.06)), folder / "block.stl")
    written(box((-0.01, -0.01, 0), (0.01, 0.01, 0.01)), folder / "knob.stl")
    files = {"fore arm": "tube.ply", "block": "block.stl", "knob": "knob.stl"}
    joints = ("fore arm", "block", "0 0 0.07", "0 0 0"), ("block", "knob", "0 0 0.2", "0 0 0")
    (folder / "arm.urdf").write_text(robot_text({name: shape(file) for name, file in files.items()}, joints))
    return folder / "arm.urdf"


SKIN = "hexagons:8mm"


@pytest.fixture(scope="module")
def by_command(arm, tmp_path_factory):
    """The folder that the command line makes of this robot."""
    folder = tmp_path_factory.mktemp("command") / "robot"
    assert cli.main(["fit", "--propose", str(arm), "-o", str(folder), "--skin", SKIN]) == 0
    return folder


def files_of(folder):
    """Return the bytes of all files, without the name of the folder of the robot, which differs."""
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir())}


@pytest.mark.slow
def test_proposals_fits_and_export_have_the_bytes_of_the_command_line(bpy, arm, by_command, capfd):
    """Plans, calibrations, sources and robot.json are the same files; states and reasons follow."""
    bpy.ops.skin_calib.import_robot(filepath=str(arm))
    bpy.context.scene.skin_calib.skin = SKIN
    assert bpy.ops.skin_calib.propose_all() == {"FINISHED"}
    tube, block, knob = (bpy.data.objects[name].skin_calib for name in ("fore arm", "block", "knob"))
    assert tube.proposed and block.skins[0].first_channel == tube.proposed and not knob.skins
    assert knob.refusal.startswith("No surface of at least 5 cm^2 is within 1 mm and 15 degrees of the mesh")
    assert "Info: Proposed plans for 2 links; refused: 1" in capfd.readouterr().out
    assert bpy.ops.skin_calib.fit_all() == {"FINISHED"}
    assert "Info: All links with a plan are fitted" in capfd.readouterr().out
    assert tube.result.taxels == tube.proposed and not tube.result.outdated
    folder = by_command.with_name("window")
    assert bpy.ops.skin_calib.export_robot(directory=str(folder)) == {"FINISHED"}
    assert files_of(folder) == files_of(by_command)
    assert {"robot.json", "block.sources.json", "block.plan.json", "block.calibration.json"} <= files_of(folder).keys()
    assert cli.main(["fit", str(folder), "-o", str(folder)]) == 0
    assert "2 up to date" in capfd.readouterr().out


@pytest.mark.slow
def test_proposal_of_a_single_mesh_has_the_plan_of_the_command_line(bpy, document, tmp_path):
    """A mesh in millimetres: same surfaces, skins and reasons; undo and redo are one step; a second one replaces it."""
    written(subdivided(welded(trimesh.creation.cylinder(0.03, 0.12, sections=48))), tmp_path / "tube.stl", 1000)
    words = ["--unit", "mm", "--skin", "sheet:4x6x8mm"]
    assert cli.main(["propose", str(tmp_path / "tube.stl"), "-o", str(tmp_path), *words]) == 0
    expected = json.loads((tmp_path / "tube.plan.json").read_text())
    bpy.ops.skin_calib.import_mesh(filepath=str(tmp_path / "tube.stl"), unit="mm")
    bpy.context.scene.skin_calib.skin = words[-1]
    bpy.ops.ed.undo_push(message="start")
    assert bpy.ops.skin_calib.propose("EXEC_DEFAULT", True) == {"FINISHED"}
    shown = document(bpy.context.object)
    assert shown | {"unit": "mm"} == expected and shown["skins"]
    bpy.ops.ed.undo()
    assert not bpy.context.object.skin_calib.skins and not bpy.context.object.skin_calib.proposed
    bpy.ops.ed.redo()
    assert document(bpy.context.object) == shown
    words = " ".join(draw(bpy, "reasons"))
    assert all(" ".join(reason.split()) in words for reason in expected["x_proposal"])
    bpy.ops.skin_calib.propose()
    assert document(bpy.context.object) == shown


@pytest.fixture
def meanwhile(extension, monkeypatch):
    """Return a function that has something done while the first computation of an operator runs."""

    def do(act):
        work = modules(extension, "live.background").background.Work
        left, is_done = [act], work.is_done

        def after(self, wait=0.0):
            if left:
                left.pop()()
            return is_done(self, wait)

        monkeypatch.setattr(work, "is_done", after)

    return do


def test_work_follows_renamed_links_and_names_removed_ones(bpy, plan_file, meanwhile, capfd):
    """The link that is worked on, and those that wait, also if another object gets the name."""
    for name in ("a", "b", "c"):
        bpy.ops.skin_calib.import_plan(filepath=str(plan_file(name)))
    a, b, c = (bpy.data.objects[name] for name in ("a", "b", "c"))

    def swap():
        a.name, b.name = "x", "a"
        bpy.data.objects.remove(c)

    meanwhile(swap)
    assert bpy.ops.skin_calib.fit_all() == {"FINISHED"}
    assert (a.name, b.name) == ("x", "a") and a.skin_calib.result.key and b.skin_calib.result.key
    out = capfd.readouterr().out
    assert "Warning: c was removed in the meantime" in out and "Fitted 2 links; refused: 1" in out


@pytest.mark.slow
def test_propose_all_keeps_skins_that_are_added_while_it_works(bpy, plan_file, meanwhile, capfd):
    """The link that is worked on, and one that waits, can get a skin."""
    for name in ("a", "b"):
        bpy.ops.skin_calib.import_plan(filepath=str(plan_file(name, skins=[])))
    links = bpy.data.objects["a"], bpy.data.objects["b"]
    bpy.context.scene.skin_calib.skin = SKIN

    def add():
        for link in links:
            link.skin_calib.skins.add().name = "mine"

    meanwhile(add)
    assert bpy.ops.skin_calib.propose_all() == {"FINISHED"}
    assert [[skin.name for skin in link.skin_calib.skins] for link in links] == [["mine"], ["mine"]]
    out = capfd.readouterr().out
    for name in "ab":
        assert f"Warning: {name}: It has got a skin in the meantime, and keeps its plan." in out
    assert "Proposed plans for 0 links; refused: 2" in out


def test_skin_is_a_menu_with_sizes(bpy, extension, link):
    """It shows and changes the text that scripts and earlier scenes have; undo and the preferences, too."""
    scene = bpy.context.scene.skin_calib
    shown = ["skin_kind", "Hexagons: 8 mm"]
    assert scene.skin_kind == "usual" and draw(bpy, "link")[2:4] == shown
    for kind, text, fields in (
        ("hexagons", "hexagons:8mm", ["skin_length"]),
        ("sheet", "sheet:6x22x10mm", ["skin_rows", "skin_columns", "skin_length"]),
        ("file", "//skin.json", ["skin_file"]),
    ):
        scene.skin_kind = kind
        assert scene.skin == text and draw(bpy, "link")[2 : 3 + len(fields)] == ["skin_kind", *fields]
    for text, kind in (("hexagons", "hexagons"), ("hexagons:8 mm", "file"), ("sheet:2mm", "file"), ("", "usual")):
        scene.skin = text  # of an earlier scene; what is no size stays as it is, and is refused
        assert scene.skin_kind == kind and scene.skin == text
    scene.skin_kind = "sheet"
    scene.skin_rows, scene.skin_columns, scene.skin_length_mm = 4, 8, 16.3
    assert scene.skin == "sheet:4x8x16.3mm" and (scene.skin_rows, scene.skin_columns) == (4, 8)
    bpy.ops.ed.undo_push(message="before")
    scene.skin_kind = "hexagons"
    bpy.ops.ed.undo_push(message="kind")
    bpy.ops.ed.undo()
    assert bpy.context.scene.skin_calib.skin == "sheet:4x8x16.3mm"
    preferences = bpy.context.preferences.addons[extension].preferences
    preferences.skin_length_mm = 16.3
    assert preferences.skin == "hexagons:16.3mm" and preferences.skin_kind == "hexagons"
    bpy.context.scene.skin_calib.skin_kind = "usual"
    assert draw(bpy, "link")[2:4] == ["skin_kind", "Hexagons: 16.3 mm"]
    preferences.property_unset("skin")


def test_refused_proposals_and_exports_state_the_reason(bpy, extension, robot, tmp_path):
    """An unknown skin, a link without skin, nothing to fit, and an export before the fit."""
    scene, link = bpy.context.scene, bpy.context.object
    with pytest.raises(RuntimeError, match="Error: No link has a skin. Use Propose All"):
        bpy.ops.skin_calib.fit_all()
    with pytest.raises(RuntimeError, match="Error: No link is fitted. Press Propose All and Fit All first"):
        bpy.ops.skin_calib.export_robot(directory=str(tmp_path / "out"))
    preferences = bpy.context.preferences.addons[extension].preferences
    preferences.skin = "felt"  # that of the scene has priority
    with pytest.raises(RuntimeError, match="Error: 'felt' is not a skin. Choose kind"):
        bpy.ops.skin_calib.propose()
    preferences.property_unset("skin")
    scene.skin_calib.skin = "leather"
    for name in ("propose", "propose_all"):
        with pytest.raises(RuntimeError, match="Error: 'leather' is not a skin. Choose kind"):
            getattr(bpy.ops.skin_calib, name)()
    assert not link.skin_calib.refusal
    link.skin_calib.skins.add().kind = "sheet"
    with pytest.raises(RuntimeError, match="Error: upper: not fitted since the last change. Press Fit All first"):
        bpy.ops.skin_calib.export_robot(directory=str(tmp_path / "out"))
    assert not (tmp_path / "out").exists()
    link.skin_calib.grid.n = 2
    with pytest.raises(RuntimeError, match="Error: Degree 3 needs at least 4 u-planes"):
        bpy.ops.skin_calib.fit_all()
    assert "upper: refused" in draw(bpy, "robot")
    assert " ".join(draw(bpy, "work")).count("Degree 3 needs at least 4 u-planes") == 1  # in the state above


@pytest.mark.parametrize(
    "file, link",
    [("g1_description/g1_29dof_rev_1_0.urdf", "head_link"), ("jvrc_description/urdf/jvrc1.urdf", "NECK_P_S")],
)
@pytest.mark.nightly
def test_proposal_of_a_real_link_has_the_plan_of_the_command_line(bpy, tmp_path, file, link):
    """The exported plan has the bytes of ``skin-calib propose``; the fit has those of ``skin-calib fit``."""
    path = ROBOTS / file
    if not path.exists():
        pytest.skip(f"{path.name} is not on this machine")
    command, window = tmp_path / "command", tmp_path / "window"
    words = ["--only", link, "--skin", SKIN]
    assert cli.main(["fit", "--propose", str(path), "-o", str(command), *words]) == 0
    bpy.ops.skin_calib.import_robot(filepath=str(path))
    bpy.context.scene.skin_calib.skin = SKIN
    bpy.context.view_layer.objects.active = bpy.data.objects[link]
    assert bpy.ops.skin_calib.propose() == {"FINISHED"}
    assert bpy.ops.skin_calib.export_robot(directory=str(window)) == {"FINISHED"}
    assert files_of(window) == files_of(command) and len(files_of(window)) == 4


@pytest.fixture
def arms(bpy, tmp_path):
    """Import a robot of two plates that are mirror images, and a nose; return its left and right link."""
    plate = trimesh.creation.box((0.07, 0.05, 0.024)).subdivide().subdivide()
    plate.vertices[:, 0] += 0.1 * plate.vertices[:, 1]
    written(welded(plate), tmp_path / "left.ply")
    plate.apply_transform(np.diag((1.0, -1.0, 1.0, 1.0)))
    written(welded(plate), tmp_path / "right.ply")
    written(box((0, 0, 0), (0.03, 0.02, 0.02)), tmp_path / "nose.ply")
    inner = '<link name="body"/>' + "".join(
        f'<link name="{name}">{shape(f"{name}.ply")}</link><joint name="{name}_joint" type="fixed"><parent '
        f'link="body"/><child link="{name}"/><origin xyz="{x} {y} 0"/></joint>'
        for name, x, y in (("left", 0, 0.3), ("right", 0, -0.3), ("nose", 0.3, 0))
    )
    (tmp_path / "arms.urdf").write_text(f'<robot name="arms">{inner}</robot>')
    assert bpy.ops.skin_calib.import_robot(filepath=str(tmp_path / "arms.urdf")) == {"FINISHED"}
    return bpy.data.objects["left"], bpy.data.objects["right"]


def across(plan):
    """Give a link boards on its upper face, without one in the middle."""
    plan.grid.kind, plan.grid.normal = "across", (0, 0, 1)
    plan.skins[0].choice, plan.skins[0].cells = "listed", "0,0 1,0 0,1 -1,1"


def test_plan_is_copied_to_the_mirror_link(bpy, addon, arms):
    """It is fitted there, after the channels of the other links, as one step of undo."""
    left, right = arms
    bpy.context.view_layer.objects.active = left
    bpy.ops.skin_calib.skin_add(kind="hexagons")
    across(left.skin_calib)
    left.skin_calib.skins[0].name = "left_palm"
    assert bpy.ops.skin_calib.fit() == {"FINISHED"}
    bpy.ops.ed.undo_push(message="start")
    assert bpy.ops.skin_calib.copy_to_mirror("EXEC_DEFAULT", True) == {"FINISHED"}
    plans = [addon.plans.read_plan(link, bpy.context.scene) for link in arms]
    assert plans[1].skins[0].choice == ((0, 0), (-1, 0), (-1, 1), (0, 1)) and plans[1].skins[0].first_channel == 4
    assert plans[1].skins[0].name == "right_palm"
    one, other = (
        addon.results.find(link.skin_calib.result.key).calibration.patches[0].taxels.positions_link for link in arms
    )
    assert_allclose(other, one * (1, -1, 1), atol=2e-6)
    assert not right.skin_calib.result.outdated and bpy.context.object == left
    bpy.ops.ed.undo()
    assert not bpy.data.objects["right"].skin_calib.skins and bpy.data.objects["left"].skin_calib.result.key


def test_plan_that_cannot_be_copied_changes_nothing(bpy, addon, arms):
    """A link without a mirror image, or whose mirror image was removed, keeps its plan, with a reason."""
    for name, words in (("nose", "No link of arms.urdf is the mirror image of nose"), ("left", "right, the mirror")):
        link = bpy.data.objects[name]
        bpy.context.view_layer.objects.active = link
        bpy.ops.skin_calib.skin_add(kind="sheet")
        if name == "left":
            bpy.data.objects.remove(arms[1])
        before = scene_state(bpy, addon)
        with pytest.raises(RuntimeError, match=words):
            bpy.ops.skin_calib.copy_to_mirror()
        assert scene_state(bpy, addon) == before
