"""Check Mesh foresees the fit: a tick where the fit succeeds at these settings, an error where it is refused."""

import pytest

from sample_scenes.shapes import tube_mesh
from tests.blender.conftest import oval
from tests.blender.test_link import shown, weld  # noqa: F401 (a fixture)
from tests.blender.test_registration import draw
from tests.real.test_real_links import DATA
from tests.shapes import box, together

LINKS = (
    *("hrp4c_r_wrist_y", "hrp4c_r_elbow_p", "icub27_l_forearm", "icub27_l_upper_leg"),
    *("icub27_l_foot_sole", "g1_left_wrist_roll", "g1_left_ankle_roll_foot", "hrp4c_r_ankle_r_foot"),
)
KINDS = ("tube", pytest.param("sector", marks=pytest.mark.slow))


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


@pytest.mark.slow
@pytest.mark.skipif(not DATA.is_dir(), reason="the meshes of real links are not in ../shared/data")
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", LINKS)
def test_tick_on_a_real_link_means_that_the_fit_succeeds(bpy, name, kind):
    """Of eight links, with the default grid and with sectors: the check and the fit agree, in the reason, too."""
    bpy.ops.skin_calib.import_mesh(filepath=str(DATA / f"{name}.stl"))
    bpy.context.view_layer.update()
    bpy.context.object.skin_calib.grid.kind = kind
    expected, message = foreseen(bpy)
    succeeds, reason = fitted(bpy)
    assert expected == succeeds and (succeeds or message.split("\n")[0][:40] in reason), (message, reason)
    if succeeds:
        assert_foreseen_warnings(bpy, message)


def assert_foreseen_warnings(bpy, message):
    """The line of the check counts the warnings of the fit and has the first one; without warnings it has the tick."""
    link = bpy.context.object.skin_calib
    (line,) = (finding for finding in link.diagnosis.findings if finding.code == "fit")
    warnings = [warning for warning in link.result.warnings if warning.severity != "note"]
    assert line.severity == (warnings[0].severity if warnings else "note")
    assert (f", {len(warnings)} warning" in message) == bool(warnings)
    assert not warnings or (warnings[0].message in message and line.advice == warnings[0].advice)


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
