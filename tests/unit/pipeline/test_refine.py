"""``skin-calib touches``: skins move to the touches; invalid calls and tables write no file."""

import hashlib
import json
from dataclasses import replace
from pathlib import Path
from shutil import copy

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from skin_calib_addon.calibration.file import from_document, save_calibration, to_document
from skin_calib_addon.calibration.model import Registration, Touched
from skin_calib_addon.cli import main
from skin_calib_addon.common.errors import InvalidPlan
from skin_calib_addon.common.mesh_uncertainty import MESH_DEVIATION
from skin_calib_addon.geometry import CoverSpec, TubeGrid
from skin_calib_addon.geometry.mesh.triangle_mesh import save_mesh
from skin_calib_addon.pipeline import calibrate
from skin_calib_addon.pipeline.calibrate import OUTDATED_PROPOSAL
from skin_calib_addon.pipeline.place_skins import place_all
from skin_calib_addon.pipeline.refine import refine
from skin_calib_addon.plan import Plan, load_plan, save_plan
from skin_calib_addon.plan.document import skins_from, write_skin
from skin_calib_addon.plan.plan import Surface
from skin_calib_addon.plan.skins import Registered, placed_anew, spot_of
from skin_calib_addon.skin.uncertainty import NOT_RIGID, ORIGIN_UNCERTAINTY
from skin_calib_addon.validation import Touches, placements
from tests.examples import slow
from tests.shapes import Z_AXIS, cone
from tests.unit.pictures.test_picture import read_png

ROOT = Path(__file__).parents[3]
SHEET = {"name": "band", "kind": "sheet", "rows": 4, "columns": 12, "pitch": [0.01, 0.01], "direction": [0, 1, 0]}
BOARDS = {"name": "boards", "kind": "hexagons", "side": 0.01, "gap": 0.0, "direction": [0, 1, 0]}
PLACED, HIGH = {"origin": [0.0405, 0, 0.03]}, {"origin": [0.0345, 0, 0.07]}
CENTRED = SHEET | {"origin": "center"}
MARKS = [{"cell": [1, 2], "point": [0.0375, 0, 0.05]}, {"cell": [1, 8], "point": [0.0, 0.0375, 0.05]}]


@pytest.fixture(scope="module")
def fitted(tmp_path_factory):
    """Return a plan on a cone without skins, and its calibration."""
    path = tmp_path_factory.mktemp("cone") / "cone.ply"
    save_mesh(cone(), path)
    plan = Plan("cone", path, "m", (Surface(CoverSpec(), TubeGrid(8, 24, Z_AXIS, 2e-3)),), ())
    return plan, calibrate(plan)


def with_skin(fitted, skin):
    """Return the plan with one skin, and its calibration."""
    plan, result = fitted
    plan = replace(plan, skins=skins_from([skin]))
    placed = place_all(plan, result.fits)
    calibration = replace(result.calibration, patches=tuple(done.patch for done in placed))
    return plan, replace(result, calibration=calibration, placed=placed)


def moved_away(plan, result):
    """Return the taxels of the only skin, moved by a few millimetres and one degree from the plan."""
    skin, taxels = plan.skins[0], result.placed[0].patch.taxels
    row = int(np.abs(taxels.index).sum(axis=1).argmin())
    normal, tangent = taxels.normals_link[row], taxels.tangents_link[row]
    turn = Rotation.from_rotvec(0.02 * normal)
    shift = 0.002 * tangent + 0.0015 * np.cross(normal, tangent)
    if getattr(skin, "landmarks", ()):
        marks = tuple(replace(m, point=tuple(np.array(m.point) + (0.0, 0.0, 0.002))) for m in skin.landmarks)
        skin = replace(skin, landmarks=marks)
    else:
        position, direction = (
            (taxels.positions_link[row], tangent) if skin.origin is None else (skin.origin, skin.direction)
        )
        skin = replace(skin, origin=tuple(position + shift), direction=tuple(turn.apply(np.array(direction))))
    if skin.name == "boards":
        skin = replace(skin, choice=tuple(map(tuple, taxels.index.tolist())))
    return place_all(replace(plan, skins=(skin,)), result.fits)[0].patch.taxels


@pytest.mark.parametrize(
    "skin",
    [
        slow(CENTRED, id="centred"),
        slow(SHEET | PLACED, id="placed"),
        pytest.param(SHEET | HIGH | {"hand": "left", "offset": 0.002}, id="left"),
        pytest.param(SHEET | {"landmarks": MARKS}, id="landmarks"),
        slow(BOARDS | {"cells": "fill"}, id="fill"),
        pytest.param(BOARDS | {"cells": [[0, 0], [1, 0], [0, 1], [2, 0], [1, 1]], **PLACED}, id="listed"),
        slow(BOARDS | {"cells": [[1, 0], [0, 1], [2, 0], [1, 1]], **PLACED}, id="rootless"),
    ],
)
def test_skin_moves_to_its_touches(fitted, skin):
    """Touches anywhere in the cells: the error is below 0.4 mm, and the motion that is left is zero."""
    plan, result = with_skin(fitted, skin)
    true = moved_away(plan, result)
    refined = refine(plan, result, random_touches(true, 400, np.random.default_rng(0)))
    found = refined.calibration.patches[0].taxels
    before = result.placed[0].patch.taxels
    assert np.linalg.norm(before.positions_link - true.positions_link, axis=1).mean() > 1e-3
    assert np.linalg.norm(found.positions_link - true.positions_link, axis=1).max() < 4e-4
    motion = refined.placements[0].motion
    assert (np.abs(motion.shift) < 0.5 * motion.shift_error).all()
    again = place_all(refined.plan, result.fits)[0].patch.taxels
    assert_allclose(again.positions_link, found.positions_link, rtol=0, atol=1e-15)


def test_skins_without_touches_stay(fitted):
    """Exactly; and skins that cannot be refined give an error with the reason."""
    plan, result = with_skin(fitted, SHEET | PLACED)
    second = skins_from([BOARDS | {"cells": [[0, 0], [1, 0]], "origin": [-0.0375, 0, 0.05], "first_channel": 48}])
    plan = replace(plan, skins=plan.skins + second)
    placed = place_all(plan, result.fits)
    calibration = replace(result.calibration, patches=tuple(done.patch for done in placed))
    result = replace(result, placed=placed, calibration=calibration)
    taxels = placed[0].patch.taxels
    refined = refine(plan, result, random_touches(moved_away(plan, result), 100, np.random.default_rng(0)))
    assert refined.plan.skins[1] == second[0] and refined.plan.skins[0] != plan.skins[0]
    assert refined.calibration.patches[1].registration == placed[1].patch.registration
    few = Touches(taxels.ids[:2], np.arange(2), taxels.positions_link[:2], np.zeros((2, 3)))
    with pytest.raises(InvalidPlan, match="skin 'band' has 2 touches, which are too few"):
        refine(plan, result, few)
    trimmed = with_skin(fitted, CENTRED | {"rows": 14, "trim": True})
    part = trimmed[1].placed[0].patch.taxels
    assert (part.index.sum(axis=1) > 0).all()
    moved = shifted(part, 0.003)
    with pytest.raises(InvalidPlan, match="'band' is centred and has no cell \\(0, 0\\). Give it an origin"):
        refine(*trimmed, random_touches(moved, 100, np.random.default_rng(0)))


def test_touches_that_fit_another_order_or_none_move_nothing(fitted):
    """Each refusal states the orders, or how many touches are unexplained."""
    plan, result = with_skin(fitted, SHEET | PLACED)
    rng = np.random.default_rng(0)
    touches = random_touches(result.placed[0].patch.taxels, 48, rng)
    ids = np.array(result.placed[0].patch.taxels.ids)
    rows = np.array([int(np.flatnonzero(ids == name)[0]) for name in touches.taxels])
    wrong = {
        "fit another order of its channels: rows and columns counted from the other end": 47 - rows,
        "fit neither its taxels nor another known order": rng.permutation(48)[rows],
        "of 48 touches of skin 'band' fit neither": np.where(np.arange(48) < 20, rng.integers(0, 48, 48), rows),
    }
    for message, felt in wrong.items():
        with pytest.raises(InvalidPlan, match=message):
            refine(plan, result, replace(touches, taxels=tuple(ids[felt].tolist())))
    inner = result.placed[0].patch.taxels.index[rows][:, 1] < 9  # touches that do not show the ends of the rows
    some = Touches(
        tuple(ids[rows[inner] + 1].tolist()), np.arange(inner.sum()), touches.points[inner], touches.directions[inner]
    )
    with pytest.raises(InvalidPlan, match="fit several orders of its channels: "):
        refine(plan, result, some)


def test_a_skin_without_a_significant_motion_stays(fitted):
    """Its covariance has what the touches leave possible: a raster in step with the cells leaves millimetres."""
    plan, result = with_skin(fitted, SHEET | PLACED)
    taxels = result.placed[0].patch.taxels
    points = taxels.positions_link + 0.003 * taxels.tangents_link
    refined = refine(plan, result, Touches(taxels.ids, np.arange(48), points, np.zeros((48, 3))))
    (skin,) = refined.plan.skins
    assert replace(skin, touches=None) == plan.skins[0]
    assert 2e-3 < skin.touches.touched.shift_error < 6e-3 and skin.touches.touched.shift == (0.0, 0.0)


def test_warning_about_the_plan_stays(fitted):
    """Touches do not show whether the mesh has changed since the proposal."""
    plan, result = with_skin(fitted, SHEET | PLACED)
    result = replace(result, calibration=replace(result.calibration, warnings=(OUTDATED_PROPOSAL,)))
    taxels = result.placed[0].patch.taxels
    touches = Touches(taxels.ids, np.arange(48), taxels.positions_link, np.zeros((48, 3)))
    assert OUTDATED_PROPOSAL in refine(plan, result, touches).calibration.warnings


def random_touches(true, count, rng):
    """Return touches anywhere in random cells."""
    rows, side = rng.integers(0, len(true.ids), count), rng.integers(0, true.corners_link.shape[1], count)
    corners = np.stack([true.corners_link[rows, side - k] for k in range(2)], axis=1) - true.positions_link[rows, None]
    weights = np.sqrt(rng.uniform(0, 1, (count, 1))) * np.column_stack((u := rng.uniform(0, 1, count), 1 - u))
    points = true.positions_link[rows] + np.einsum("nk,nkc->nc", weights, corners)
    return Touches(tuple(true.ids[i] for i in rows), np.arange(count), points, np.zeros((count, 3)))


def shifted(taxels, distance):
    """Return taxels further along their rows."""
    step = distance * taxels.tangents_link
    return replace(
        taxels, positions_link=taxels.positions_link + step, corners_link=taxels.corners_link + step[:, None]
    )


def axes_of(taxels):
    """Return the unit vectors along the row and across it, shape (n, 2, 3)."""
    return np.stack((taxels.tangents_link, np.cross(taxels.normals_link, taxels.tangents_link)), axis=1)


def test_refined_plan_states_how_touches_registered_it(fitted):
    """The file reads it back; sigma has the covariance and the part that is not rigid; a new calibration, too."""
    plan, result = with_skin(fitted, SHEET | PLACED)
    touches = random_touches(moved_away(plan, result), 400, np.random.default_rng(4))
    refined = refine(plan, result, touches)
    stated, patch = refined.plan.skins[0].touches.touched, refined.calibration.patches[0]
    assert skins_from([write_skin(refined.plan.skins[0])]) == refined.plan.skins
    assert patch.touches == stated and refined.plan.skins[0].registration is None
    assert patch.registration == Registration(stated.shift_error, stated.turn_error, stated.anchor)
    assert from_document(to_document(refined.calibration)).patches[0].touches == stated
    placement = refined.placements[0]
    assert_allclose(np.array(stated.covariance), placement.motion.covariance, rtol=0.1, atol=1e-9)
    before = placements(result.calibration, touches)[0].motion
    assert_allclose((*stated.shift, stated.turn), (*before.shift, before.turn), atol=1e-12)
    assert (stated.used, stated.left_out) == (400 - placement.unexplained.sum(), placement.unexplained.sum())
    assert stated.along == pytest.approx(placement.expected_rms, rel=0.1)
    assert 0 < stated.normal < 3e-4 and stated.angle is None and stated.session == ""
    least = np.sqrt(NOT_RIGID**2 + MESH_DEVIATION**2)
    assert least < patch.taxels.sigma[:, 0].min() and patch.taxels.sigma[:, 0].max() < least + 3e-4
    again = place_all(refined.plan, result.fits)[0]
    assert_allclose(again.patch.taxels.sigma, patch.taxels.sigma, rtol=1e-6)
    assert again.patch.touches == stated and again.warnings == result.placed[0].warnings


@pytest.mark.parametrize(
    "skin",
    [SHEET | PLACED, BOARDS | {"cells": [[0, 0], [1, 0], [0, 1], [2, 0], [1, 1]], **PLACED}],
    ids=["sheet", "boards"],
)
def test_skin_that_is_placed_anew_is_no_longer_registered(fitted, skin, tmp_path, capsys):
    """Its uncertainty is the usual one, with a warning in calibration and plan; rounding in the window is no motion."""
    plan, result = with_skin(fitted, skin)
    touches = random_touches(moved_away(plan, result), 100, np.random.default_rng(4))
    refined = refine(plan, result, touches).plan
    (skin,) = refined.skins
    others = {"position": {"origin": (0.0405, 0.0, 0.031)}, "direction": {"direction": (0.0, 1.0, 0.1)}}
    others["cells"] = (
        {"choice": skin.choice[:-1]} if skin.name == "boards" else {"lattice": replace(skin.lattice, columns=11)}
    )
    for what, changed in others.items():
        moved_plan = replace(refined, skins=(replace(skin, **changed),))
        (placed,) = place_all(moved_plan, result.fits)
        (warning,) = (w for w in placed.warnings if w.code == "placed-anew")
        assert f"it has another {what}. Its" in warning.message and placed.patch.touches is None
        assert placed.patch.registration.origin == ORIGIN_UNCERTAINTY and placed.patch.taxels.sigma.min() > 0
    assert placed_anew(replace(skin, surface="surface")) == ["surface"]
    rounded = replace(
        skin,
        origin=tuple(np.float32(skin.origin).astype(float).tolist()),
        direction=tuple((3 * np.float32(skin.direction)).astype(float).tolist()),
    )
    assert placed_anew(skin) == placed_anew(rounded) == []
    copy(plan.mesh, tmp_path)
    save_plan(replace(moved_plan, mesh=Path(plan.mesh.name)), tmp_path / "moved.plan.json")
    assert main(["check", str(tmp_path / "moved.plan.json")]) == 0
    assert "/skins/0/touches" in (said := capsys.readouterr().out) and "placed anew" in said


def test_landmarks_that_move_place_a_skin_anew(fitted):
    """Or another number of them."""
    plan, _ = with_skin(fitted, SHEET | {"landmarks": MARKS})
    (skin,) = plan.skins
    touched = Touched(
        "2026-11-29", "", 9, 0, (0.0, 0.0), 0.0, ((1e-6, 0, 0), (0, 1e-6, 0), (0, 0, 1e-4)), (0, 0, 0), 1e-3
    )
    skin = replace(skin, touches=Registered(touched, spot_of(skin)))
    moved = replace(skin.landmarks[1], point=(0.0, 0.0375, 0.051))
    assert placed_anew(skin) == []
    assert placed_anew(replace(skin, landmarks=(skin.landmarks[0], moved))) == ["position"]
    assert placed_anew(replace(skin, landmarks=skin.landmarks[:1])) == ["position", "cells"]


def test_touches_of_one_cell_leave_the_rotation_as_it_was_stated(fitted):
    """They say that the position is in this cell. What was stated stays for a skin that is placed anew."""
    skin = SHEET | PLACED | {"registration": {"origin": 5e-4, "direction": 0.03}}
    plan, result = with_skin(fitted, skin)
    taxels = result.placed[0].patch.taxels
    touches = Touches(taxels.ids[:1] * 4, np.arange(4), taxels.positions_link[[0] * 4], np.zeros((4, 3)))
    refined = refine(plan, result, touches)
    stated = refined.plan.skins[0].touches.touched
    assert 1e-3 < stated.shift_error < 4e-3 and stated.turn_error == 0.03
    assert refined.plan.skins[0].registration == plan.skins[0].registration
    assert_allclose(stated.anchor, taxels.positions_link[0], atol=1e-9)
    assert np.isfinite(refined.calibration.patches[0].taxels.sigma).all()


@pytest.mark.slow
@pytest.mark.parametrize("skin", [SHEET | PLACED, SHEET | {"landmarks": MARKS}], ids=["placed", "landmarks"])
def test_sigma_covers_the_errors_of_refined_skins(fitted, skin):
    """68 % or more of the components are within one sigma, 95 % within two, over 60 sets of 24 touches."""
    plan, result = with_skin(fitted, skin)
    true, rng = moved_away(plan, result), np.random.default_rng(0)
    row = {name: i for i, name in enumerate(true.ids)}
    ratios = []
    for _ in range(60):
        found = refine(plan, result, random_touches(true, 24, rng)).calibration.patches[0].taxels
        rows = [row[name] for name in found.ids]
        errors = np.einsum("nij,nj->ni", axes_of(true)[rows], found.positions_link - true.positions_link[rows])
        ratios.append(np.abs(errors) / found.sigma[:, :1])
    assert 0.62 < np.mean(np.less(ratios, 1)) < 0.92 and np.mean(np.less(ratios, 2)) > 0.92


def test_refinement_that_does_not_converge_is_an_error(fitted, monkeypatch):
    """With a limit of one step, which leaves more than the tolerance."""
    plan, result = with_skin(fitted, SHEET | PLACED)
    measured = random_touches(moved_away(plan, result), 100, np.random.default_rng(0))
    monkeypatch.setattr("skin_calib_addon.pipeline.refine.MAX_REFINE_STEPS", 1)
    with pytest.raises(InvalidPlan, match="refinement of skin 'band' did not converge in 1 steps: the last step was"):
        refine(plan, result, measured)


@pytest.fixture
def folder(fitted, tmp_path):
    """Return a folder with a plan, its calibration, and touches of the skin 2 mm further along the rows."""
    plan, result = with_skin(fitted, SHEET | PLACED)
    copy(plan.mesh, tmp_path)
    save_plan(replace(plan, mesh=Path("cone.ply"), extra={"x_note": "kept"}), tmp_path / "cone.plan.json")
    save_calibration(result.calibration, tmp_path / "cone.json")
    taxels = result.placed[0].patch.taxels
    touches = random_touches(shifted(taxels, 0.002), 100, np.random.default_rng(0))
    rows = [f"{name},{x},{y},{z}" for name, (x, y, z) in zip(touches.taxels, touches.points.tolist())]
    (tmp_path / "t.csv").write_text("\n".join(["taxel,x,y,z", *rows]) + "\n")
    (tmp_path / "sub").mkdir()
    return tmp_path


def touches(folder, file, *words, table="t.csv"):
    return main([str(w) for w in ("touches", folder / file, folder / table, *words)])


def test_command_compares_and_refines(folder, capsys):
    """A calibration is compared; a plan is refined into another folder."""
    assert touches(folder, "cone.json", "--picture", folder / "t.png") == 0
    out, err = capsys.readouterr()
    assert "touches          100, of 43 taxels" in out and err == ""
    before = out.split("after the refinement")[0]
    assert "band             shifted " in before and "not significant" not in before
    assert (read_png(folder / "t.png").min(axis=2) < 0.9).mean() > 0.03
    moved = folder / "sub" / "moved.plan.json"
    assert touches(folder, "cone.plan.json", "--refine", "-o", moved) == 0
    after = capsys.readouterr().out.split("after the refinement:")[1]
    assert "not significant" in after
    assert load_plan(moved).extra == {"x_note": "kept"} and '"mesh": "../cone.ply"' in moved.read_text()
    session = hashlib.sha256((folder / "t.csv").read_bytes()).hexdigest()
    assert load_plan(moved).skins[0].touches.touched.session == session
    assert main(["fit", str(moved), "-o", str(folder / "moved.json")]) == 0
    assert main(["check", str(moved), str(folder / "moved.json")]) == main(["show", str(folder / "moved.json")]) == 0
    shown = capsys.readouterr().out
    assert f"by 100 touches, 0 left out, session {session[:8]}\n          moved by " in shown
    assert "placed" not in shown and "degrees; touches deviate by " in shown


@pytest.mark.slow
def test_command_prints_the_warnings_of_the_fit_and_of_the_refined_plan(folder, capsys):
    """A second skin over the touched one: the warning comes with the plan, and anew where the refined skin overlaps."""
    plan = json.loads((folder / "cone.plan.json").read_text())
    plan["skins"].append({**plan["skins"][0], "name": "other", "first_channel": 100})
    (folder / "cone.plan.json").write_text(json.dumps(plan))
    assert touches(folder, "cone.plan.json") == 0
    assert capsys.readouterr().err.count("[skins-overlap]") == 1
    assert touches(folder, "cone.plan.json", "--refine", "-o", folder / "moved.plan.json") == 0
    assert capsys.readouterr().err.count("[skins-overlap]") == 2


@pytest.mark.parametrize(
    ("file", "words", "code", "message"),
    [
        ("cone.json", ["--refine", "-o", "out.json"], 1, "--refine needs the plan file"),
        ("cone.plan.json", ["--refine"], 2, "--refine and -o OUT belong together"),
        ("cone.plan.json", ["--refine", "-o", "none/out.json"], 2, "the folder"),
        ("cone.plan.json", ["--refine", "-o", "t.csv"], 2, "t.csv would replace"),
        ("t.csv", [], 1, "t.csv"),
    ],
)
def test_command_refuses_in_one_line(folder, capsys, file, words, code, message):
    """No file is written."""
    words = [str(folder / w) if w.endswith((".json", ".csv")) else w for w in words]
    before = {path: path.read_bytes() for path in folder.iterdir() if path.is_file()}
    try:
        found = touches(folder, file, *words)
    except SystemExit as ended:
        found = ended.code
    out, err = capsys.readouterr()
    assert found == code and out == "" and message in err and err.count("\n") == 1
    assert {path: path.read_bytes() for path in folder.iterdir() if path.is_file()} == before
