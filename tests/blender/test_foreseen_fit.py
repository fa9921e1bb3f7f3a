"""Check Mesh foresees the fit: a tick where the fit succeeds at these settings, an error where it is refused."""

from sample_scenes.shapes import tube_mesh
from tests.blender.conftest import oval
from tests.blender.test_link import shown, weld  # noqa: F401 (a fixture)
from tests.blender.test_registration import draw
from tests.shapes import box, together


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


def test_open_several_and_folded_sections_are_errors(bpy, shown):  # noqa: F811
    """A half pipe is open, boxes apart have no common axis: each refused, each with its reason; a tube is fitted."""
    tube = weld(*(lambda m: (m.vertices, m.faces))(tube_mesh(oval, 24, 9)))
    shown(tube, "tube")
    assert foreseen(bpy)[0] and fitted(bpy)[0]
    shown(box((0, 0, 0), (0.1, 0.1, 0.001)), "plate")
    assert foreseen(bpy)[0] == fitted(bpy)[0]
    shown(together(box((0, 0, 0), (0.02, 0.02, 0.1)), box((0.1, 0, 0), (0.12, 0.02, 0.1))), "apart")
    assert foreseen(bpy)[0] == fitted(bpy)[0]


def test_changed_settings_outdate_the_check(bpy, shown):  # noqa: F811
    """After a change of the plan the panel asks for another check; that check is of the new settings."""
    shown(weld(*(lambda m: (m.vertices, m.faces))(tube_mesh(oval, 24, 9))), "tube")
    assert foreseen(bpy)[0] and not bpy.context.object.skin_calib.diagnosis.outdated
    bpy.context.object.skin_calib.grid.auto_margin = False
    bpy.context.object.skin_calib.grid.margin = 0.05
    assert bpy.context.object.skin_calib.diagnosis.outdated
    assert "The plan has changed: check again" in draw(bpy, "mesh")
    expected, message = foreseen(bpy)
    assert not expected and "margin of 50 mm" in message
