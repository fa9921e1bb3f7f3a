"""Touches in the scene: compared with the last fit, drawn, and used to move the skins."""

import hashlib

import numpy as np
import pytest
from numpy.testing import assert_allclose

from skin_calib_addon.validation.flat import normals_at
from tests.blender.conftest import BAND, modules
from tests.blender.test_registration import draw


@pytest.fixture
def ours(extension):
    """Return modules of the running extension."""
    return modules(extension, "overlay.drawing", "scene.plans", "scene.results")


@pytest.fixture
def table(bpy, ours, plan_file, tmp_path):
    """Return a table of touches of a sheet that is 2 mm further along its rows, in a scene of millimetres."""
    bpy.context.scene.unit_settings.scale_length = 0.001
    bpy.ops.skin_calib.import_plan(filepath=str(plan_file("band", skins=[BAND])))
    bpy.ops.skin_calib.fit()
    taxels = taxels_of(bpy, ours)
    even = np.linspace(-0.45, 0.45, 7) * 0.01
    inside = np.stack(np.meshgrid(even, even), axis=-1).reshape(-1, 2)
    points = taxels.positions_link + 0.002 * taxels.tangents_link + np.tensordot(inside, axes_of(taxels), (1, 1))
    rows = [f"{name},{x},{y},{z}" for part in points.tolist() for name, (x, y, z) in zip(taxels.ids, part)]
    path = tmp_path / "touches.csv"
    path.write_text("\n".join(["taxel,x,y,z", *rows]) + "\n")
    return path


def axes_of(taxels):
    """Return the unit vectors along the rows and across them, shape (n, 2, 3)."""
    return np.stack((taxels.tangents_link, np.cross(taxels.normals_link, taxels.tangents_link)), axis=1)


def taxels_of(bpy, ours):
    """Return the taxels of the last fit."""
    return ours.results.find(bpy.context.object.skin_calib.result.key).calibration.patches[0].taxels


def shown(bpy, ours):
    """Return the drawn layers of touches."""
    return [layer for layer in ours.drawing.shown_layers(bpy.context.object) if layer.what == "TOUCHED"]


def test_touches_are_reported_drawn_and_removed(bpy, ours, table):
    """The panel has text, the view has lines; Ctrl-Z and the button remove both."""
    bpy.ops.ed.undo_push(message="start")
    assert bpy.ops.skin_calib.touches("EXEC_DEFAULT", True, filepath=str(table)) == {"FINISHED"}
    found = bpy.context.object.skin_calib.inspect.touches
    assert (
        found.remarks.splitlines()[0].startswith("294 touches, distance along the skin: mean 4.")
        and len(found.warnings) == 0
    )
    assert "Shifted 1.94 +- 0.18 mm" in found.remarks  # the touches are in tangent planes, the shift is along the skin
    (lines,) = shown(bpy, ours)
    lengths = np.linalg.norm(lines.points[1::2] - lines.points[::2], axis=1)
    assert len(lengths) == 294 and 0.0078 < lengths.max() < 0.0082
    bpy.ops.ed.undo()
    assert not bpy.context.object.skin_calib.inspect.touches.file and shown(bpy, ours) == []
    bpy.ops.skin_calib.touches(filepath=str(table))
    assert bpy.ops.skin_calib.touches_end.poll()
    bpy.ops.skin_calib.touches_end()
    assert not bpy.ops.skin_calib.touches_end.poll()
    assert not bpy.context.object.skin_calib.inspect.touches.file and shown(bpy, ours) == []


def test_skins_move_to_where_they_were_touched(bpy, ours, table):
    """This is one undo step; after a new fit there is no shift."""
    before = taxels_of(bpy, ours).positions_link
    bpy.ops.skin_calib.touches(filepath=str(table))
    bpy.ops.ed.undo_push(message="start")
    plan = ours.plans.read_plan(bpy.context.object, bpy.context.scene)
    bpy.ops.skin_calib.touches_move("EXEC_DEFAULT", True)
    settings = bpy.context.object.skin_calib
    assert settings.result.outdated and not settings.skins[0].centred
    stated = ours.plans.read_plan(bpy.context.object, bpy.context.scene).skins[0].touches.touched
    assert 0 < stated.shift_error < 2e-4 and 0 < stated.turn_error < 0.02
    assert stated.session == hashlib.sha256(table.read_bytes()).hexdigest() and stated.used == 294
    assert f"Registered {stated.date} by 294 touches" in " ".join(draw(bpy, "skin"))
    with pytest.raises(RuntimeError, match="Fit the link again first"):
        bpy.ops.skin_calib.touches_move()
    bpy.ops.skin_calib.fit()
    patch = ours.results.find(settings.result.key).calibration.patches[0]
    assert patch.touches == stated and patch.registration.anchor == stated.anchor
    assert not [warning for warning in settings.result.warnings if warning.code == "placed-anew"]
    after = taxels_of(bpy, ours).positions_link
    assert_allclose(np.linalg.norm(after - before, axis=1), 0.002, rtol=0, atol=3e-4)
    bpy.ops.skin_calib.touches(filepath=str(table))
    text = bpy.context.object.skin_calib.inspect.touches.remarks
    assert "not significant" in text, text
    bpy.ops.ed.undo()
    assert ours.plans.read_plan(bpy.context.object, bpy.context.scene) == plan


def test_skin_that_moves_or_is_forgotten_is_no_longer_registered(bpy, ours, table):
    """After a move the fit warns; without the registration nothing is left of it."""
    bpy.ops.skin_calib.touches(filepath=str(table))
    bpy.ops.skin_calib.touches_move()
    skin = bpy.context.object.skin_calib.skins[0]
    skin.origin[2] += 0.1  # millimetres
    bpy.ops.skin_calib.fit()
    result = bpy.context.object.skin_calib.result
    assert "placed-anew" in [warning.code for warning in result.warnings]
    assert ours.results.find(result.key).calibration.patches[0].touches is None
    bpy.ops.skin_calib.registration_remove(skin=0)
    assert ours.plans.read_plan(bpy.context.object, bpy.context.scene).skins[0].touches is None
    assert "Registered" not in " ".join(draw(bpy, "skin"))


def test_presses_have_arrows_ellipses_and_a_list(bpy, ours, table, tmp_path):
    """Forces push along the normals; the list begins with the largest distance; a row marks its touch; undo ends it."""
    taxels = taxels_of(bpy, ours)
    rng = np.random.default_rng(0)
    rows = rng.integers(0, len(taxels.ids), 30)
    inside = rng.uniform(-0.5, 0.5, (30, 2)) * 0.01
    points = taxels.positions_link[rows] + np.einsum("mk,mkc->mc", inside, axes_of(taxels)[rows])
    wrenches = np.hstack((-8 * taxels.normals_link[rows], np.cross(points, -8 * taxels.normals_link[rows])))
    lines = [
        ",".join((taxels.ids[row], *map(str, w), str(k))) for k, (row, w) in enumerate(zip(rows, wrenches.tolist()))
    ]
    path = tmp_path / "wrenches.csv"
    path.write_text("\n".join(["taxel,fx,fy,fz,tx,ty,tz,press", *lines]) + "\n")
    bpy.ops.skin_calib.touches(filepath=str(path))
    layers = {layer.what: layer.points for layer in ours.drawing.shown_layers(bpy.context.object)}
    force, normal = (layers[name][:60].reshape(30, 2, 3) for name in ("FORCES", "TOUCHED_NORMALS"))
    at_taxels, at_touches = force[:, 0] - force[:, 1], normal[:, 1] - normal[:, 0]
    assert_allclose(at_taxels, 1.2 * 0.0085 * taxels.normals_link[rows], atol=1e-5)
    (patch,) = ours.results.find(bpy.context.object.skin_calib.result.key).calibration.patches
    assert_allclose(at_touches, 1.2 * 0.0085 * normals_at(patch, normal[:, 0]), atol=1e-5)
    assert 0.001 < np.abs(at_touches - at_taxels).max() < 0.005  # 5 mm from the taxel the skin is curved
    assert_allclose(force[:, 1], points, atol=6e-4)  # the skin is below the tangent plane: 5 mm squared / 2 / 22 mm
    assert len(layers["ELLIPSES"]) == 5 * 48 * 2 and len(layers["NEXT"]) == 8
    found = bpy.context.object.skin_calib.inspect.touches
    distances = [float(touch.words.split()[0]) for touch in found.places]
    assert len(distances) == 30 and distances == sorted(distances, reverse=True) and "PLACE" not in layers
    found.chosen = 3
    marks = [layer.points for layer in ours.drawing.shown_layers(bpy.context.object) if layer.what == "PLACE"]
    assert_allclose(marks[0].mean(axis=0), found.places[3].point, atol=1e-6)
    assert_allclose(bpy.context.scene.cursor.location, 1e3 * np.array(found.places[3].point), atol=1e-3)
    bpy.ops.skin_calib.touches_end()
    assert not {layer.what for layer in ours.drawing.shown_layers(bpy.context.object)} & {"PLACE", "FORCES", "NEXT"}


def test_what_cannot_be_compared_or_moved_says_why(bpy, table, tmp_path):
    """The last comparison and the plan do not change."""
    with pytest.raises(RuntimeError, match="Compare with touches first"):
        bpy.ops.skin_calib.touches_move()
    bpy.ops.skin_calib.touches(filepath=str(table))
    wrong = tmp_path / "wrong.csv"
    wrong.write_text("taxel,x,y,z\nnone,0,0,0\n")
    with pytest.raises(RuntimeError, match="line 2, column 1: the calibration has no taxel"):
        bpy.ops.skin_calib.touches(filepath=str(wrong))
    found = bpy.context.object.skin_calib.inspect.touches
    assert found.file == str(table)
    table.write_text("\n".join(table.read_text().splitlines()[:3]) + "\n")
    with pytest.raises(RuntimeError, match="has 2 touches, which are too few"):
        bpy.ops.skin_calib.touches_move()
    assert bpy.context.object.skin_calib.skins[0].centred and not bpy.context.object.skin_calib.result.outdated
