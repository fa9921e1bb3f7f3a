"""Import of links from meshes and robots, in metres; their unit; defects of their mesh."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from skin_calib_addon.geometry.mesh.defects import diagnose
from skin_calib_addon.geometry.mesh.triangle_mesh import load_mesh, read_mesh
from skin_calib_addon.robot.link_mesh import load_link
from skin_calib_addon.robot.urdf import read_robot
from tests.blender.conftest import INNER, TUBE, written
from tests.blender.test_link_frame import frame_for
from tests.blender.test_refusals import scene_state
from tests.blender.test_registration import draw
from tests.real.test_real_links import MESHES
from tests.shapes import box, together, with_hole
from tests.unit.robot.test_robot_mesh import shape


@pytest.fixture
def shown(bpy, tmp_path):
    """Return a function that imports a mesh as a link and returns its object."""

    def show(mesh, name="arm"):
        bpy.ops.skin_calib.import_mesh(filepath=str(written(mesh, tmp_path / f"{name}.ply")))
        bpy.context.view_layer.update()
        return bpy.context.object

    return show


@pytest.mark.parametrize(
    "kind, unit, scale, metre",
    [("stl", "auto", 1, 1.0), ("ply", "auto", 1000, 1.0), ("off", "mm", 1000, 0.01), ("STL", "auto", 1000, 0.01)],
)
def test_mesh_becomes_a_link_in_metres(bpy, addon, tmp_path, kind, unit, scale, metre):
    """The numbers of the file stay and the object is scaled, in any scene; the link has the name of the file."""
    bpy.context.scene.unit_settings.scale_length = metre
    path = written(TUBE, tmp_path / f"l_forearm.{kind}", scale)
    assert bpy.ops.skin_calib.import_mesh(filepath=str(path), unit=unit) == {"FINISHED"}
    link = bpy.context.object
    bpy.context.view_layer.update()
    assert (link.name, link.skin_calib.link, link.skin_calib.mesh_file) == ("l_forearm", "l_forearm", path.name)
    assert_allclose(link.scale, [1 / scale / metre] * 3, rtol=1e-6)
    assert_allclose([v.co[:] for v in link.data.vertices], read_mesh(path).vertices, rtol=1e-6, atol=1e-7 * scale)
    assert_allclose(addon.link_meshes.read_mesh(link, bpy.context).vertices, TUBE.vertices, atol=1e-8)
    assert [o.name for o in bpy.context.selected_objects] == ["l_forearm"]


def test_unreadable_mesh_is_refused(bpy, addon, tmp_path):
    """A missing file, an invalid mesh and an unknown format give one line each, and no object."""
    (tmp_path / "text.stl").write_text("no mesh")
    (tmp_path / "link.fbx").write_text("<COLLADA/>")
    (tmp_path / "link.glb").write_text("<COLLADA/>")
    (tmp_path / "link.dae").write_text("<COLLADA/>")
    before = scene_state(bpy, addon)
    for name, words in (
        ("none.ply", "no mesh file"),
        ("text.stl", "text.stl"),
        ("link.fbx", "link.fbx has an unknown format"),
        ("link.glb", "link.glb is not a valid GLB file: it does not have the header of glTF"),
        ("link.dae", "link.dae is not a valid DAE file"),
    ):
        with pytest.raises(RuntimeError, match=f"Error: .*{words}"):
            bpy.ops.skin_calib.import_mesh(filepath=str(tmp_path / name))
    assert scene_state(bpy, addon) == before


@pytest.mark.parametrize("use", ["visual", "collision"])
@pytest.mark.parametrize("metre", [1.0, 0.001])
def test_link_of_a_robot_lies_in_its_frame(bpy, addon, urdf, use, metre):
    """The mesh of the fit is that of the URDF, to single precision; the object is not moved."""
    bpy.context.scene.unit_settings.scale_length = metre
    assert bpy.ops.skin_calib.import_urdf(filepath=str(urdf), link="upper", mesh=use) == {"FINISHED"}
    link = bpy.context.object
    bpy.context.view_layer.update()
    expected = load_link(urdf, read_robot(urdf), "upper", use)
    mesh = addon.link_meshes.read_mesh(link, bpy.context)
    assert_allclose(np.sort(mesh.vertices, axis=0), np.sort(expected.vertices, axis=0), atol=2e-8)
    assert_allclose(mesh.face_areas.sum(), expected.face_areas.sum(), rtol=1e-5)
    assert link.skin_calib.link == "upper" and tuple(link.location) == (0, 0, 0)
    assert link.skin_calib.mesh_file == ("tube.STL" if use == "collision" else "bot.urdf")


def test_link_without_a_name_is_asked_for(bpy, addon, urdf):
    """Without a window the names are listed; a single link needs none; wrong names are refused."""
    before = scene_state(bpy, addon)
    with pytest.raises(RuntimeError, match='Error: bot.urdf has several links with a mesh. Name one of "'):
        bpy.ops.skin_calib.import_urdf(filepath=str(urdf))
    with pytest.raises(RuntimeError, match='Error: bot.urdf has no link "uper"; did you mean "upper"?'):
        bpy.ops.skin_calib.import_urdf(filepath=str(urdf), link="uper")
    with pytest.raises(RuntimeError, match="Error: bot.urdf has no visual mesh for elbow"):
        bpy.ops.skin_calib.import_urdf(filepath=str(urdf), link="elbow")
    assert scene_state(bpy, addon) == before
    urdf.write_text(f'<robot name="b"><link name="a">{shape("../meshes/box.obj", "collision")}</link></robot>')
    assert bpy.ops.skin_calib.import_urdf(filepath=str(urdf)) == {"FINISHED"}
    assert bpy.context.object.name == "a"
    urdf.write_text('<robot name="b"><link name="a"/></robot>')
    with pytest.raises(RuntimeError, match="Error: No link of bot.urdf has a mesh"):
        bpy.ops.skin_calib.import_urdf(filepath=str(urdf))


def test_wrong_unit_is_noticed_and_scaled_in_one_step(bpy, addon, shown):
    """The panel reports a length of 79 m; one click scales the object, one undo restores it."""
    link = shown(TUBE)
    assert not any("long" in line for line in draw(bpy, "link"))
    link.scale = (1000, 1000, 1000)
    frame_for(bpy, link)
    assert {"This mesh is 80 m long:", "what is its unit?", "Scale to Unit"} <= set(draw(bpy, "link"))
    bpy.ops.ed.undo_push(message="start")
    data = [v.co[:] for v in link.data.vertices]
    assert bpy.ops.skin_calib.scale_to_unit("EXEC_DEFAULT", True, unit="mm") == {"FINISHED"}
    link = bpy.data.objects["arm"]
    assert_allclose(link.scale, (1, 1, 1), rtol=1e-6)
    assert [v.co[:] for v in link.data.vertices] == data and link.skin_calib.result.outdated
    assert not any("long" in line for line in draw(bpy, "link"))
    bpy.ops.ed.undo()
    assert bpy.data.objects["arm"].scale[0] == 1000


def said(link):
    """Return the findings of the last check, and whether each is a warning."""
    return {finding.message: finding.severity == "warning" for finding in link.skin_calib.diagnosis.findings}


def test_check_finds_what_is_there_and_offers_the_outer_shell(bpy, shown):
    """An inner part and a hole are counted, stored, and shown with advice."""
    link = shown(together(with_hole(TUBE, (0.04, 0.01, 0.06), 0.012), INNER))
    assert draw(bpy, "mesh") == ["Check Mesh"]
    assert bpy.ops.skin_calib.diagnose() == {"FINISHED"}
    assert said(link)["2 connected parts, 1 of them mostly within the convex hull of others"] is False
    assert [matters for what, matters in said(link).items() if what.startswith("3 holes, ")] == [True]
    panel = draw(bpy, "mesh")
    assert {"shell: outer", "shell: seen", "shell: all", "Select Holes and Bad Edges"} <= set(panel)
    assert "The mesh has changed: check again" not in panel


def move_vertex(bpy, link):
    link.data.vertices[3].co.x += 0.001
    link.data.update()


def modify(bpy, link):
    link.modifiers.new("finer", "SUBSURF")


@pytest.mark.parametrize("change", [move_vertex, modify], ids=lambda f: f.__name__)
def test_changed_mesh_outdates_the_check(bpy, addon, shown, monkeypatch, change, state_of):
    """The check is unverified at once, and still after the comparison; a new check is of the new mesh."""
    monkeypatch.setattr(addon.diagnoses, "CHECK_DELAY", 0)
    link = shown(TUBE)
    bpy.ops.skin_calib.diagnose()
    bpy.context.view_layer.update()
    addon.diagnoses.verify()
    assert not state_of(bpy.context.object).is_unverified
    change(bpy, link)
    bpy.context.view_layer.update()
    for _ in range(2):
        assert "The mesh has changed: check again" in draw(bpy, "mesh")
        addon.diagnoses.verify()
    bpy.ops.skin_calib.diagnose()
    assert "The mesh has changed: check again" not in draw(bpy, "mesh")


def test_undo_and_reload_compare_the_check_with_the_mesh(bpy, addon, shown, monkeypatch, tmp_path, state_of):
    """A check that undo restores with another mesh is unverified; a saved file restores the check."""
    monkeypatch.setattr(addon.diagnoses, "CHECK_DELAY", 0)
    shown(TUBE)
    bpy.ops.ed.undo_push(message="start")
    bpy.ops.skin_calib.diagnose("EXEC_DEFAULT", True)
    bpy.context.object.scale = (1.1, 1.1, 1.1)
    bpy.ops.ed.undo_push(message="scaled")
    bpy.ops.ed.undo()
    addon.diagnoses.verify()
    assert bpy.context.object.skin_calib.diagnosis.key and not state_of(bpy.context.object).is_unverified
    bpy.ops.ed.redo()
    addon.diagnoses.verify()
    assert state_of(bpy.context.object).is_unverified
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "arm.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "arm.blend"))
    addon.diagnoses.verify()
    assert state_of(bpy.context.object).is_unverified and len(said(bpy.context.object)) == 4


def selected(link):
    """Return the ends of the selected edges, in Object Mode."""
    return {tuple(sorted(e.vertices)) for e in link.data.edges if e.select}


@pytest.mark.parametrize("from_mode", ["OBJECT", "EDIT"])
def test_show_selects_rims_in_edit_mode(bpy, shown, from_mode):
    """It selects the edges of visible holes and no others, at any pose of the object, in one undo step."""
    link = shown(together(TUBE, INNER))
    link.scale, link.location = (-1, 1, 1.5), (0.1, 0, 0)
    bpy.ops.object.mode_set(mode=from_mode)
    bpy.ops.ed.undo_push(message="start")
    assert bpy.ops.skin_calib.show_defects("EXEC_DEFAULT", True) == {"FINISHED"}
    link = bpy.context.object
    assert link.mode == "EDIT"
    bpy.ops.object.mode_set(mode="OBJECT")
    z = {v.index: v.co.z for v in link.data.vertices}
    ends = {e for e in selected(link)}
    assert len(ends) == 48 and {round(z[v], 6) for pair in ends for v in pair} == {0.02, 0.1}


def test_edges_that_modifiers_make_are_not_selected(bpy, shown):
    """The operator reports that there is nothing to select, and the mode stays."""
    link = shown(TUBE)
    link.modifiers.new("finer", "SUBSURF")
    assert bpy.ops.skin_calib.show_defects() == {"CANCELLED"} and link.mode == "OBJECT"


def foreseen(bpy):
    """Return whether Check Mesh expects a fit, and what it says about it."""
    assert bpy.ops.skin_calib.diagnose() == {"FINISHED"}
    found = [f for f in bpy.context.object.skin_calib.diagnosis.findings if f.code == "fit" or f.severity == "error"]
    assert len(found) == 1
    return found[0].severity != "error", found[0].message


def fitted(bpy):
    """Return whether Fit succeeds, and the reason otherwise."""
    try:
        return bpy.ops.skin_calib.fit() == {"FINISHED"}, ""
    except RuntimeError as error:
        return False, str(error)


def test_open_several_and_folded_sections_are_errors(bpy, shown):
    """A half pipe is open, boxes apart have no common axis: each refused, each with its reason; a tube is fitted."""
    shown(TUBE, "tube")
    assert foreseen(bpy)[0] and fitted(bpy)[0]
    shown(box((0, 0, 0), (0.1, 0.1, 0.001)), "plate")
    assert foreseen(bpy)[0] == fitted(bpy)[0]
    shown(together(box((0, 0, 0), (0.02, 0.02, 0.1)), box((0.1, 0, 0), (0.12, 0.02, 0.1))), "apart")
    assert foreseen(bpy)[0] == fitted(bpy)[0]


def test_changed_settings_outdate_the_check(bpy, shown):
    """After a change of the plan the panel asks for another check; that check is of the new settings."""
    shown(TUBE, "tube")
    assert foreseen(bpy)[0] and not bpy.context.object.skin_calib.diagnosis.outdated
    bpy.context.object.skin_calib.grid.auto_margin = False
    bpy.context.object.skin_calib.grid.margin = 0.05
    assert bpy.context.object.skin_calib.diagnosis.outdated
    assert "The plan has changed: check again" in draw(bpy, "mesh")
    expected, message = foreseen(bpy)
    assert not expected and "margin of 50 mm" in message


@pytest.mark.nightly
@pytest.mark.skipif(not MESHES, reason="no real links here: ../shared/data/meshes has no STL file")
@pytest.mark.parametrize("path", MESHES, ids=lambda path: path.stem)
def test_real_link_is_imported_unchanged(bpy, addon, path):
    """It has its own unit and all bits, without a warning; the check agrees with that outside of Blender.

    One finding more is that of the trial fit: a note of its error, or the reason of its refusal.
    """
    bpy.ops.skin_calib.import_mesh(filepath=str(path))
    link, mesh = bpy.context.object, load_mesh(path)
    bpy.context.view_layer.update()
    assert addon.link_meshes.read_mesh(link, bpy.context).sha256 == mesh.sha256
    assert not any("long" in line for line in draw(bpy, "link"))
    bpy.ops.skin_calib.diagnose()
    found = {(f.message, f.severity) for f in link.skin_calib.diagnosis.findings}
    plain = {(w.message, w.severity) for w in diagnose(mesh.vertices, mesh.faces).findings()}
    (message, severity), *others = found - plain
    assert plain < found and not others
    assert severity == "error" or message.startswith("These settings fit")
