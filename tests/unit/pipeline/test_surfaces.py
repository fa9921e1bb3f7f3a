"""Plans with several surfaces on one link."""

import json

import numpy as np
import pytest

from skin_calib_addon.calibration.file import from_document, load_calibration, to_document
from skin_calib_addon.cli import main
from skin_calib_addon.common.errors import InvalidPlan, SkinCalibError
from skin_calib_addon.geometry.mesh.triangle_mesh import TriangleMesh, save_mesh
from skin_calib_addon.pipeline import calibrate
from skin_calib_addon.pipeline.touch_distance import check_touches
from skin_calib_addon.plan import check_plan_wholly, load_plan, plan_document, plan_from, save_plan
from skin_calib_addon.runtime import load
from skin_calib_addon.validation.touches import Touches
from tests.shapes import cylinder

RADIUS = 0.05
AXIS = {"point": [0, 0, 0], "direction": [0, 0, 1]}
SECTOR = {"kind": "patch", "n": 6, "lines": 10, "axis": AXIS, "margin": 0.002}
FRONT = {"name": "front", "grid": SECTOR | {"from": -1.2, "to": 1.2}}
BACK = {"name": "back", "grid": SECTOR | {"from": 2.0, "to": 4.3}, "degree": [3, 4]}
SHEET = {"kind": "sheet", "rows": 3, "columns": 5, "pitch": [0.01, 0.01], "origin": "center", "direction": [0, 1, 0]}
CHEST = SHEET | {"name": "chest"}
SPINE = SHEET | {"name": "spine", "surface": "back"}
PLAN = {"format": "skin-plan", "version": 2, "link": "torso", "mesh": "torso.ply", "unit": "m"}
TWO = PLAN | {"surfaces": [FRONT, BACK], "skins": [CHEST, SPINE]}
MESH, FITS = cylinder(RADIUS, 0.2, 96, 30), {}


def made(document):
    """Return the result of a plan on the tube; equal surfaces are fitted once."""
    plan = plan_from(document)
    result = calibrate(plan, MESH, known={s.name: FITS[s] for s in plan.surfaces if s in FITS})
    FITS.update(zip(plan.surfaces, result.fits.values()))
    return result


def test_each_skin_is_on_its_surface():
    """Two surfaces give the taxels of two plans with one surface each; channels run on."""
    both = made(TWO).calibration
    assert [s.name for s in both.surfaces] == ["front", "back"] and both.surfaces[1].degree == (3, 4)
    assert [p.surface for p in both.patches] == ["front", "back"]
    assert np.concatenate([p.taxels.channels for p in both.patches]).tolist() == list(range(30))
    for surface, skin, patch in zip((FRONT, BACK), (CHEST, SPINE), both.patches):
        one = {key: value for key, value in (PLAN | surface).items() if key != "name"} | {"version": 1}
        alone = {key: value for key, value in skin.items() if key != "surface"}
        (expected,) = made(one | {"skins": [alone]}).calibration.patches
        assert (patch.taxels.positions_link == expected.taxels.positions_link).all()
        assert (patch.taxels.sigma == expected.taxels.sigma).all()
    assert (both.patches[0].taxels.normals_link[:, 0] > 0.5).all()
    assert (both.patches[1].taxels.normals_link[:, 0] < -0.5).all()


def test_mean_and_worst_fit_are_those_of_the_least_exact_surface():
    """A coarse back, in any order of the surfaces: window and commands state its mean as that of the link."""
    coarse = BACK | {"grid": BACK["grid"] | {"n": 4, "lines": 5}}
    for surfaces in ([FRONT, coarse], [coarse, FRONT]):
        result = made(PLAN | {"surfaces": surfaces, "skins": []})
        front, back = (result.fits[name].errors.surface_to_mesh for name in ("front", "back"))
        assert result.mean == back.mean > 1.5 * front.mean
        assert result.worst_fit is result.fits["back"]


@pytest.mark.slow
def test_command_line_and_runtime_know_all_surfaces(tmp_path, capsys):
    """Fit, check, show, report and picture name both surfaces; the runtime loads the file."""
    save_mesh(MESH, tmp_path / "torso.ply")
    plan, out = tmp_path / "torso.plan.json", tmp_path / "torso.json"
    save_plan(plan_from(TWO), plan)
    report, picture = tmp_path / "report.json", tmp_path / "torso.png"
    assert main(["check", str(plan)]) == 0
    assert main(["fit", str(plan), "-o", str(out), "--report", str(report), "--picture", str(picture)]) == 0
    assert main(["check", str(out)]) == main(["show", str(out)]) == 0
    shown = capsys.readouterr().out
    assert "on surface       front, cover" in shown and "surface   back: 6 x 10 control points, degree (3, 4)" in shown
    assert [s["name"] for s in json.loads(report.read_text())["surfaces"]] == ["front", "back"]
    assert len(load(out).channels) == 30 and picture.stat().st_size > 10_000
    assert len(load_calibration(out).surfaces) == 2


def test_warnings_and_errors_name_their_surface():
    """A surface that cannot be fitted, and one with a warning, are named; with one surface nothing changes."""
    narrow = BACK | {"grid": BACK["grid"] | {"margin": 0.2}}
    with pytest.raises(SkinCalibError, match="Surface 'back': "):
        made(TWO | {"surfaces": [FRONT, narrow]})
    coarse = {"name": "back", "grid": SECTOR | {"n": 4, "lines": 4, "from": 0.8, "to": 5.5}, "max_deviation": 0.003}
    found = made(TWO | {"surfaces": [FRONT, coarse], "skins": []}).calibration.warnings
    assert found and all(warning.message.startswith("Surface 'back': ") for warning in found)
    assert {warning.where.surface for warning in found} == {"back"}
    assert not made(PLAN | {"surfaces": [coarse], "skins": []}).calibration.warnings[0].message.startswith("Surface")


def test_error_of_a_placement_names_skin_and_surface():
    """The surface only where there are several; a message that has the name of the skin gets it once."""
    far = {"origin": [-0.2, 0, 0.1]}
    with pytest.raises(
        SkinCalibError, match=r"^Skin 'spine' on surface 'back': The origin, .* from the surface"
    ) as found:
        made(TWO | {"skins": [CHEST, SPINE | far]})
    assert found.value.numbers["skin"] == "spine" and found.value.numbers["surface"] == "back"
    alone = PLAN | {"surfaces": [FRONT], "skins": [CHEST | {"origin": [0.2, 0, 0.1]}]}
    with pytest.raises(SkinCalibError, match="^Skin 'chest': The origin"):
        made(alone)
    beyond = CHEST | {"origin": [RADIUS, 0, 0.5], "trim": True, "rows": 1, "columns": 1}
    with pytest.raises(SkinCalibError) as found:
        made(alone | {"skins": [beyond]})
    assert str(found.value).count("'chest'") == 1


def test_what_is_wrong_with_the_mesh_is_one_warning_that_names_all_surfaces():
    """A vertex that stands off gives one warning, not one for each surface."""
    vertices = MESH.vertices.copy()
    vertices[np.linalg.norm(vertices - (RADIUS, 0, 0.1), axis=1).argmin()] *= (1.1, 1.1, 1)
    found = calibrate(plan_from(TWO), TriangleMesh(vertices, MESH.faces)).calibration.warnings
    (warning,) = (w for w in found if w.code == "outlier-vertices")
    assert warning.message.startswith("Surfaces 'front', 'back': One vertex of the mesh stands off")


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"surfaces": [FRONT, FRONT]}, "Two surfaces have the name 'front'"),
        ({"skins": [SPINE | {"surface": "bakc"}]}, "'spine' is on surface 'bakc', which the plan does not have.*back"),
        ({"surfaces": [FRONT | {"grid": FRONT["grid"] | {"axis": {**AXIS, "direction": [0, 0, 0]}}}, BACK]},
         "Surface 'front': The direction of the axis is zero"),
    ],
)  # fmt: skip
def test_contradictions_are_refused(changes, message):
    """Names of surfaces are unique, and skins name one that exists."""
    with pytest.raises(InvalidPlan, match=message):
        plan_from(TWO | changes)
    (finding,) = check_plan_wholly(TWO | changes)
    assert finding.severity == "error"


def test_plan_with_one_surface_stays_of_version_1(tmp_path):
    """Older programs read it; another name, or two surfaces, need version 2. All read back to themselves."""
    one = {key: value for key, value in (PLAN | FRONT).items() if key != "name"} | {"version": 1, "skins": [CHEST]}
    named = PLAN | {"surfaces": [FRONT], "skins": [CHEST]}
    for document, version in ((one, 1), (named, 2), (TWO, 2)):
        plan = plan_from(document)
        written = plan_document(plan)
        assert written["version"] == version and plan_document(plan_from(written)) == written
        save_plan(plan, tmp_path / "p.json")
        assert plan_document(load_plan(tmp_path / "p.json"))["skins"] == written["skins"]
    with pytest.raises(ValueError, match="too many values"):
        plan_from(TWO).surface  # noqa: B018


def disc(count):
    """A boundary of 30 mm around the middle of the front, with so many corners."""
    turn = np.linspace(0, 2 * np.pi, count, endpoint=False)
    arc, height = 0.03 * np.cos(turn), 0.1 + 0.03 * np.sin(turn)
    return np.column_stack((RADIUS * np.cos(arc / RADIUS), RADIUS * np.sin(arc / RADIUS), height)).tolist()


def test_boundary_is_kept_and_holds_for_skins():
    """Plan and file have its numbers; a sheet that leaves it is warned of as over a hole."""
    loop = disc(24)
    front = FRONT | {"grid": {k: v for k, v in FRONT["grid"].items() if k != "margin"} | {"boundary": [loop]}}
    document = TWO | {"surfaces": [front, BACK]}
    plan = plan_from(document)
    assert plan_document(plan)["surfaces"][0]["grid"]["boundary"] == [loop]
    inside = made(document).calibration
    # The loop is 60 mm high; the grid goes 0.1 % beyond it on both sides.
    assert inside.warnings == () and np.ptp(inside.surfaces[0].control_net[..., 2]) == pytest.approx(0.06012, abs=1e-9)
    wide = CHEST | {"rows": 5, "columns": 6}  # its corner cells are 32 mm from the centre
    warning, rim = made(document | {"skins": [wide]}).calibration.warnings
    assert rim.code == "overhang" and not set(rim.where.taxels) & set(warning.where.taxels)
    assert warning.code == "over-hole" and sorted(warning.where.taxels) == [
        f"chest.{r}.{c}" for r in (0, 4) for c in (0, 5)
    ]


@pytest.mark.slow
def trusted(model, uv):
    """Return what a reader of the file alone says of parameters (m, 2), as the page of the format describes it."""
    inside, sites = np.zeros(len(uv), bool), np.array([list(row) for row in model.trusted.sites])
    for loop in model.trusted.boundary:
        for (u1, v1), (u2, v2) in zip(loop, np.roll(loop, -1, axis=0)):
            a, b = ((v - uv[:, 1] + 0.5) % 1 - 0.5 if model.closed[1] else v - uv[:, 1] for v in (v1, v2))
            crosses = ((a <= 0) != (b <= 0)) & (np.abs(b - a) < 0.5 if model.closed[1] else True)
            inside ^= crosses & (u1 - (u2 - u1) * a / np.where(b == a, 1, b - a) > uv[:, 0])
    (k, l), ends = sites.shape, (np.floor, np.ceil)
    row, column = uv[:, 0] * (k - 1), uv[:, 1] * (l if model.closed[1] else l - 1)
    around = np.array([sites[f(row).astype(int), g(column).astype(int) % l] for f in ends for g in ends])
    return inside & (around == "1").any(axis=0) & (around != "0").all(axis=0)


def test_calibration_says_where_surfaces_follow_the_mesh():
    """A disc and a sliver that no ray meets, and a ring around the tube with a hole."""
    hole = np.linalg.norm(MESH.triangles.mean(axis=1) - (0, RADIUS, 0.1), axis=1) < 0.012
    mesh, turn = TriangleMesh(MESH.vertices, MESH.faces[~hole]), np.linspace(0, 2 * np.pi, 24, endpoint=False)
    ring = [[[RADIUS * np.cos(a), RADIUS * np.sin(a), z + 0.01 * np.sin(2 * a)] for a in turn] for z in (0.06, 0.14)]
    sliver = [
        [RADIUS * np.cos(a), RADIUS * np.sin(a), z] for z, a in ((0.14, 0), (0.1403, 0), (0.1403, 0.2), (0.14, 0.2))
    ]
    grids = (
        SECTOR | {"boundary": [disc(24), sliver], "from": -1.2, "to": 1.2},
        SECTOR | {"kind": "tube", "boundary": ring},
    )
    surfaces = [
        {"name": name, "grid": {k: v for k, v in grid.items() if k != "margin"}} for name, grid in zip("ab", grids)
    ]
    result = calibrate(plan_from(PLAN | {"surfaces": surfaces, "skins": []}), mesh)
    one, other = from_document(to_document(result.calibration)).surfaces
    for model, has_hole in ((one, False), (other, True)):
        uv = np.random.default_rng(1).random((4000, 2))
        found, expected = trusted(model, uv), result.fits[model.name].is_trusted(uv)
        assert ("0" in "".join(model.trusted.sites)) == has_hole
        assert 500 < found.sum() < 3500 and (found != expected).mean() < 0.004
    middle = np.mean(one.trusted.boundary[1], axis=0)[None]
    assert result.fits["a"].is_measured(middle).all() and not trusted(one, middle).any()


def test_boards_stay_inside_the_boundary():
    """All corners are inside a disc of 30 mm, but for what a board may protrude; without boundary they are not."""
    loop = disc(48)
    whole = SECTOR | {"from": -1.2, "to": 1.2}
    boards = {"name": "boards", "kind": "hexagons", "side": 0.006, "gap": 0.0}
    farthest = []
    for grid in (whole, whole | {"boundary": [loop]}):
        document = PLAN | {"surfaces": [{"name": "front", "grid": grid}], "skins": [boards]}
        (patch,) = made(document).calibration.patches
        corners = patch.taxels.corners_link.reshape(-1, 3)
        arcs = RADIUS * np.arctan2(corners[:, 1], corners[:, 0])
        farthest.append(np.hypot(arcs, corners[:, 2] - 0.1).max())
        assert len(patch.taxels.ids) >= 15
    assert farthest[0] > 0.05 and farthest[1] < 0.03 + 0.06 * 0.006


@pytest.mark.parametrize(("shift", "code"), [(0.0, []), (0.004, ["skins-overlap"])])
def test_skins_that_overlap_are_warned_of(shift, code):
    """Two sheets side by side on one surface; moved by 4 mm, their cells overlap by 4 mm; in layers they may."""
    heights = 0.06, 0.09 - shift
    sheets = [CHEST | {"name": f"s{k}", "origin": [RADIUS, -0.02, z]} for k, z in enumerate(heights)]
    plan = PLAN | {"surfaces": [FRONT], "skins": sheets}
    warnings = made(plan).calibration.warnings
    assert [w.code for w in warnings] == code
    if code:
        assert warnings[0].value == pytest.approx(shift, abs=2e-4) and len(warnings[0].where.taxels) == 10
        layered = plan | {"skins": [sheets[0], sheets[1] | {"offset": 0.002}]}
        assert made(layered).calibration.warnings == ()


def test_touches_find_the_surface_of_their_skin():
    """A touch 1 mm off the back is compared with the back, not with the front."""
    calibration = made(TWO).calibration
    taxels = calibration.patches[1].taxels
    points = taxels.positions_link[:3] + 0.001 * taxels.normals_link[:3]
    lines, no_direction = np.arange(3), np.zeros((3, 3))
    check_touches(calibration, Touches(taxels.ids[:3], lines, points, no_direction))
    with pytest.raises(SkinCalibError):
        check_touches(calibration, Touches(taxels.ids[:3], lines, points * (-1, 1, 1), no_direction))
