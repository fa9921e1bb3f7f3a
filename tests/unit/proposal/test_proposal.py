"""Proposed plans: what is covered, where skin may be, and that the plans can be carried out."""

import json
import re
import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
import trimesh

from skin_calib_addon.calibration.file import load_calibration
from skin_calib_addon.cli import main
from skin_calib_addon.common.errors import InvalidPlan, PoorFit
from skin_calib_addon.geometry import CoverSpec, load_mesh
from skin_calib_addon.geometry.grid.grids import Across
from skin_calib_addon.geometry.mesh.cover import seen_faces
from skin_calib_addon.geometry.mesh.distance import closest
from skin_calib_addon.geometry.mesh.triangle_mesh import TriangleMesh, save_mesh, weld
from skin_calib_addon.geometry.surface.footpoints import footpoints
from skin_calib_addon.pipeline import calibrate
from skin_calib_addon.plan import load_plan, plan_document, plan_from
from skin_calib_addon.plan.plan import Surface
from skin_calib_addon.proposal.candidates import candidates, cuts_in_front, flat_faces
from skin_calib_addon.proposal.link_points import LinkPoints
from skin_calib_addon.proposal.loops import chains, loops_around, simplified
from skin_calib_addon.proposal.proposal import propose_link
from skin_calib_addon.proposal.skins import form_of, parse_skin
from skin_calib_addon.proposal.surfaces import MIN_AREA, Tried, best_of, fitted, propose_surfaces
from skin_calib_addon.proposal.trial import Start
from skin_calib_addon.robot.keep_out import KeepOut
from skin_calib_addon.robot.urdf import Joint, Robot
from tests.examples import slow
from tests.shapes import box, cylinder, hinged_planes, sheet, subdivided, together, welded

RADIUS, LENGTH = 0.025, 0.06


@pytest.fixture(autouse=True)
def few_directions(monkeypatch):
    """Eight directions of faces are enough for bodies of six sides, and take a third of the time."""
    monkeypatch.setattr("skin_calib_addon.proposal.candidates.FACES", 8)


def block():
    """A box of 75 x 60 x 45 mm with faces of a few millimetres."""
    mesh = box((0, 0, 0), (0.075, 0.06, 0.045))
    return welded(subdivided(subdivided(mesh)))


def test_area_is_that_which_skins_cover():
    """Skins are on the surface through the corners of a tube with twelve sides, 1.5 mm above the middle of each."""
    mesh = cylinder(length=0.05, around=12)
    on = LinkPoints.of(mesh)
    found = propose_surfaces(mesh, on)
    covered = np.any([surface.covered for surface in found], axis=0)
    points = on.points[covered][::9]
    near = np.min([footpoints(surface.fit.error_field.surface, points)[1] for surface in found], axis=0)
    assert near.max() < 1.05e-3
    assert on.areas[covered].sum() < 0.75 * on.areas[on.covered].sum()


@pytest.fixture(scope="module")
def tube():
    """A tube with closed ends."""
    return subdivided(welded(trimesh.creation.cylinder(RADIUS, LENGTH, sections=48)))


def proposed(mesh, tmp_path, skin="hexagons:8mm"):
    """The proposal for a mesh in a file."""
    save_mesh(mesh, tmp_path / "link.ply")
    return propose_link("link", mesh, tmp_path / "link.ply", "m", parse_skin(skin))


def test_all_sides_of_a_box_are_covered():
    """Six flat faces: six surfaces, each of one face, which cover nearly all of it."""
    mesh = block()
    on = LinkPoints.of(mesh)
    assert on.areas.sum() == pytest.approx(2 * (0.075 * 0.06 + 0.075 * 0.045 + 0.06 * 0.045), rel=1e-6)
    found = propose_surfaces(mesh, on)
    assert len(found) == 6
    assert on.areas[on.covered].sum() > 0.75 * on.areas.sum()
    assert sum(p.area for p in found) == pytest.approx(on.areas[on.covered].sum(), rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("skin", "words"),
    [
        ("hexagons:0.1mm", "Use larger boards, or check the unit of the mesh."),
        ("hexagons:200mm", "use smaller boards"),
        ("sheet:2x2x200mm", "The surface is smaller than a cell."),
    ],
)
def test_link_without_skin_states_why_none_fits_on_the_largest_surface(tmp_path, skin, words):
    """Cells can be too small, too."""
    wanted = replace(parse_skin(skin), is_wanted=True)
    found = propose_link("link", box((0, 0, 0), (0.06, 0.05, 0.04)), tmp_path / "link.ply", "m", wanted)
    assert found.plan is None and found.reasons[-1].startswith("No skin fits on ")
    assert " of up to 30 cm^2. The largest: " in found.reasons[-1] and words in found.reasons[-1]


def corrugated(wavelength):
    """A plate of 160 x 80 mm; half of it is a wave of 6 mm, the other half is flat."""
    wave = lambda x, y: np.where(x > 0.08, 0.5 * wavelength * np.sin(2 * np.pi * (x - 0.08) / wavelength), 0)  # noqa: E731
    return sheet(wave, (0.16, 0.08), (160, 20))


@pytest.mark.slow
def test_plan_states_the_largest_piece_without_skin(tmp_path, capsys):
    """On waves no surface is near the mesh; on the rims of a box no large board fits. Small pieces are not stated."""
    words = "The largest piece of the free area without skin has "
    waves = proposed(corrugated(0.006), tmp_path)
    area, x, y, why = re.fullmatch(
        rf"{words}(\d+) cm\^2, about \(([\d.]+), ([\d.]+), [-\d.]+\) mm: (.*)", waves.bare
    ).groups()
    assert waves.bare in waves.reasons and waves.plan.extra["x_proposal"] == list(waves.reasons)
    assert 100 < int(area) < 2.2 * 64 and abs(float(x) - 120) < 10 and abs(float(y) - 40) < 10
    assert why == "no surface of at least 5 cm^2 was found there within 1 mm and 15 degrees of the mesh."
    rims = proposed(welded(subdivided(subdivided(box((0, 0, 0), (0.2, 0.2, 0.02))))), tmp_path, "hexagons:30mm")
    assert len(rims.plan.surfaces) == 2 and rims.bare.startswith(words)
    assert "mm: no skin fits on the surface there: no board with sides of 30 mm fits" in rims.bare
    assert main(["propose", str(tmp_path / "link.ply"), "-o", str(tmp_path), "--skin", "hexagons:30mm"]) == 0
    assert f"\nlink  {rims.bare}\n" in capsys.readouterr().out
    assert not proposed(block(), tmp_path).bare


def test_pieces_of_a_fine_mesh_take_little_memory():
    """Many points of small faces are in one place: all pairs of them took more memory than there is."""
    rng, count = np.random.default_rng(0), 4000
    points = np.concatenate((0.004 * rng.random((count, 3)), 0.1 + 0.004 * rng.random((count // 2, 3)))) * (1, 1, 0)
    normals, free, none = (
        np.tile((0, 0, 1.0), (len(points), 1)),
        np.ones(len(points), bool),
        np.zeros(len(points), bool),
    )
    on = LinkPoints(points, normals, np.ones(len(points)), 1.0, free, none, none, points)
    tracemalloc.start()
    piece = on.largest_bare_piece(none)
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert piece.tolist() == list(range(count)) and most < 10e6


def test_a_tube_is_one_surface_and_its_ends(tube):
    """The wall all round, and the two flat ends."""
    on = LinkPoints.of(tube)
    found = propose_surfaces(tube, on)
    assert on.areas[on.covered].sum() > 0.85 * on.areas.sum()
    assert found[0].reason.startswith("tube") and found[0].area > 0.9 * 2 * np.pi * RADIUS * LENGTH


def test_small_parts_of_large_links_stay_without_a_surface(monkeypatch):
    """The largest faces of a box are 21 % of its area each, the smallest 13 %; the first surface may be smaller."""
    for part, count in ((0.19, 2), (0.5, 1)):
        monkeypatch.setattr("skin_calib_addon.proposal.surfaces.MIN_FRACTION", part)
        mesh = block()
        found = propose_surfaces(mesh, LinkPoints.of(mesh))
        assert [round(p.area / 0.0045, 1) for p in found] == [1.0] * count


def bar(profile):
    """An open bar along x with a profile (n, 2), counter-clockwise."""
    n = len(profile)
    ends = [np.column_stack((np.full(n, x), profile)) for x in (0, 0.15)]
    i, j = np.arange(n), np.roll(np.arange(n), -1)
    quads = np.concatenate((np.column_stack((i, j, j + n)), np.column_stack((i, j + n, i + n))))
    return weld(np.concatenate(ends), quads[:, ::-1])


ARC = np.column_stack([k(np.linspace(0, np.pi, 33)) for k in (np.cos, np.sin)])


def test_a_flat_side_has_a_surface_of_its_own():
    """Of a bar with a D as its profile: a tube about it, which covers more, takes no strip of the flat side."""
    mesh = bar(0.045 * ARC)
    on = LinkPoints.of(mesh)
    first, *others = propose_surfaces(mesh, on)
    flat = on.normals[:, 2] < -0.999
    assert first.reason == "flat face" and others
    assert on.areas[first.covered].sum() > 0.85 * on.areas[flat].sum() and flat[first.covered].all()


def test_flat_sides_that_continue_in_a_bend_are_not_cut_out():
    """Of a bar with two flat sides and round edges, which one tube covers."""
    on = LinkPoints.of(bar(np.concatenate((0.03 * ARC + (0, 0.03), -0.03 * ARC - (0, 0.03)))))
    assert on.areas[np.abs(on.normals[:, 1]) > 0.999].sum() > 2 * 80e-4
    assert not list(flat_faces(on, 50e-4))


@pytest.mark.parametrize("turn", [0, 40])
def test_a_flat_plate_is_covered(turn):
    """No normal is across the direction that normals avoid: also where rounding leaves nothing of them."""
    corners = np.array([(0, 0, 0), (0.08, 0, 0), (0.08, 0.07, 0), (0, 0.07, 0)], float)
    angle = np.deg2rad(turn)
    frame = np.array([(1, 0, 0), (0, np.cos(angle), -np.sin(angle)), (0, np.sin(angle), np.cos(angle))])
    mesh = TriangleMesh(corners @ frame.T, np.array([(0, 1, 2), (0, 2, 3)]))
    on = LinkPoints.of(mesh)
    assert [p.reason for p in propose_surfaces(mesh, on)] == ["flat face"]
    assert on.areas[on.covered].sum() > 0.75 * on.areas.sum()


@pytest.mark.slow
def test_faces_that_look_at_another_part_of_their_link_are_covered(tmp_path):
    """The inner sides of two plates 60 mm apart: rays from outside hit the other plate. The file of the plan fits."""
    plates = [box((-0.06, -0.04, z), (0.06, 0.04, z + 0.004)) for z in (0.0, 0.064)]
    mesh = welded(together(*map(subdivided, plates)))
    on = LinkPoints.of(mesh)
    propose_surfaces(mesh, on)
    for height, side in ((0.004, 1), (0.064, -1)):
        inner = (np.abs(on.points[:, 2] - height) < 1e-6) & (side * on.normals[:, 2] > 0.9)
        assert on.areas[inner].sum() == pytest.approx(0.12 * 0.08, rel=1e-6)
        assert on.areas[inner & on.covered].sum() > 0.75 * 0.12 * 0.08
    plan = proposed(mesh, tmp_path).plan
    (tmp_path / "link.plan.json").write_text(json.dumps(plan_document(plan)))
    taxels = [p.taxels for p in calibrate(load_plan(tmp_path / "link.plan.json")).calibration.patches]
    heights = np.concatenate([t.positions_link[t.normals_link[:, 2] > 0.9, 2] for t in taxels])
    assert (np.abs(heights - 0.004) < 1e-6).sum() > 20 and (np.abs(heights - 0.068) < 1e-6).sum() > 20


def test_trials_keep_of_a_cut_mesh_only_the_faces_that_they_need():
    """With a million faces, each cut mesh took 140 MB. The trials are the same; those that add nothing keep none."""
    plates = [box((-0.06, -0.04, z), (0.06, 0.04, z + 0.004)) for z in (0.0, 0.064)]
    mesh = welded(together(*map(subdivided, map(subdivided, plates))))
    on = LinkPoints.of(mesh)
    pool = [Tried(c, c.bound(on)) for c in candidates(on, (), MIN_AREA)]
    seen = seen_faces(mesh)
    best_of(pool, seen, on, MIN_AREA)
    behind = [tried for tried in pool if tried.start and tried.candidate.cuts]
    assert behind
    for tried in behind:
        rows, cut = tried.start.rows, tried.candidate.mesh(seen)
        assert len(rows.mesh.faces) == len(np.unique(rows.sections.face)) < len(cut.faces)
        found, whole = tried.start.trial(on), Start.of(cut, on, tried.candidate.region).trial(on)
        assert np.array_equal(found.offsets, whole.offsets) and np.array_equal(found.good, whole.good)
        assert found.area == whole.area == tried.bound
    on.cover(on.free)
    assert best_of(pool, seen, on, MIN_AREA) is None and not any(tried.start for tried in pool)


def test_what_is_in_front_is_cut_away_where_most_area_is_behind():
    """Three plates: the cuts are in both gaps, and none where the gap is 5 mm, in which no skin is wanted."""
    plates = [box((0, 0, z), (0.05, 0.04, z + 0.002)) for z in (0.0, 0.03, 0.06, 0.067)]
    on = LinkPoints.of(welded(together(*map(subdivided, plates))))
    heights = sorted(cut.point[2] for cut in cuts_in_front(on, np.array((0.0, 0.0, 1.0)), 7e-4))
    assert heights == pytest.approx([0.016, 0.046], abs=1e-3)


def test_what_is_not_free_stays_uncovered(tube):
    """A band of the tube is taken by another link: no taxel is there."""
    on = LinkPoints.of(tube)
    taken = np.abs(on.points[:, 2]) < 0.012
    on.free[taken] = False
    for proposed in propose_surfaces(tube, on):
        uv = np.random.default_rng(0).random((4000, 2))
        inside = proposed.fit.surface.points(uv[proposed.fit.is_trusted(uv)])
        if proposed.reason.startswith("tube"):
            assert (np.abs(inside[:, 2]) > 0.012 - 0.004).all()
    assert not on.covered[taken].any()


@pytest.mark.parametrize("skin", [pytest.param("hexagons:8mm", marks=pytest.mark.slow), "sheet:4x10x10mm"])
def test_proposal_is_a_plan_that_can_be_carried_out(tube, tmp_path, skin):
    """It reads back to itself; the calibration has its taxels, all within 1 mm and 15 degrees of the mesh."""
    proposal = proposed(tube, tmp_path, skin)
    plan = proposal.plan
    assert plan_document(plan_from(plan_document(plan))) == plan_document(plan)
    result = calibrate(plan, tube)
    assert sum(len(p.taxels.ids) for p in result.calibration.patches) == proposal.taxels > 30
    areas = sum(p.taxels.areas.sum() for p in result.calibration.patches)
    assert proposal.cells == pytest.approx(areas, rel=1e-6)
    assert len(plan.extra["x_proposal"]) == 2 + 3 + (proposal.chains > 0)  # a tube and its ends
    covered = f"Cells cover {areas * 1e4:.0f} cm^2 of the free area, {areas / proposal.free:.0%} of it."
    assert plan.extra["x_proposal"][-1] == covered
    for patch in result.calibration.patches:
        distance, face, _ = closest(tube, patch.taxels.positions_link)
        assert distance.max() < 1.1e-3
        cosine = (tube.face_normals[face] * patch.taxels.normals_link).sum(axis=1)
        assert cosine.min() > np.cos(np.deg2rad(18))
    assert not [w for w in result.calibration.warnings if w.severity == "error"]


def test_faces_back_to_back_count_once(tmp_path):
    """They had twice the area, and no board was parallel to the normal of the second one: a third of them."""
    mesh = welded(subdivided(subdivided(box((0, 0, 0), (0.06, 0.05, 0.008)))))
    doubled = np.concatenate((mesh.faces, mesh.faces[::3, ::-1]))
    plain, found = (proposed(weld(mesh.vertices, faces), tmp_path) for faces in (mesh.faces, doubled))
    assert (found.seen, found.free, found.cells) == pytest.approx((plain.seen, plain.free, plain.cells))
    assert plain.cells > 0.5 * plain.free


def test_points_next_to_a_surface_are_taken():
    """Those within 3 mm of a covered point and on its side, by brute force; without a covered point none is."""
    rng = np.random.default_rng(0)
    points, up = rng.random((500, 3)) * 0.03, rng.choice((-1.0, 1.0), 500)
    on = LinkPoints(points, np.outer(up, (0, 0, 1)), points[:, 0], 1.0, *np.zeros((3, 500), bool), points)
    on.cover(np.zeros(500, bool))
    assert not on.taken.any()
    chosen = np.arange(500) < 30
    on.cover(chosen)
    gaps = np.where(np.equal.outer(up, up[chosen]), np.linalg.norm(points[:, None] - points[chosen], axis=2), 1.0)
    near = gaps.min(axis=1) < 3e-3
    assert np.array_equal(on.taken, near) and np.array_equal(on.covered, chosen) and 30 < near.sum() < 400


def test_both_sides_of_a_thin_plate_are_covered():
    """Skin on one side takes nothing of the other, 1 mm behind it."""
    mesh = box((0, 0, 0), (0.1, 0.08, 0.001))
    for _ in range(4):
        mesh = subdivided(mesh)
    mesh = welded(mesh)
    on = LinkPoints.of(mesh)
    found = propose_surfaces(mesh, on)
    assert [round(p.area / (0.1 * 0.08), 2) for p in found] == [1.0, 1.0]


def test_hollows_are_not_in_the_open():
    """The floor of a pot 60 mm deep and 36 mm wide can be seen, but is not in the open; the outside is."""
    pot = trimesh.creation.annulus(0.018, 0.02, 0.06, sections=64)
    pot.apply_translation((0, 0, 0.03))
    pot = subdivided(welded(trimesh.util.concatenate(pot, trimesh.creation.cylinder(0.02, 0.001, sections=64))))
    on = LinkPoints.of(pot)
    outside = 2 * np.pi * 0.02 * 0.06 + np.pi * 0.02**2
    assert on.seen > outside + np.pi * 0.018**2 + 2 * np.pi * 0.018 * 0.02
    radius = np.hypot(*on.points.T[:2])
    assert not ((radius < 0.017) & (on.normals[:, 2] > 0.9)).any()
    assert on.areas[radius > 0.0195].sum() == pytest.approx(2 * np.pi * 0.02 * 0.061, rel=0.05)


def test_folded_surface_is_not_proposed():
    """Planes that cross inside the tube: the same refusal as that of the fit."""
    surface = Surface(CoverSpec("seen"), hinged_planes(-0.02, np.deg2rad(np.linspace(-40, 40, 8))), name="surface_1")
    with pytest.raises(PoorFit, match="folds over itself"):
        fitted(cylinder(), LinkPoints.of(cylinder()), surface, "planes")


def test_link_without_free_area_gets_a_reason(tmp_path):
    """A small link: no plan, and a sentence; the least area is that of six boards, or none for links that are named."""
    ball = welded(trimesh.creation.icosphere(3, 0.008))
    proposal = proposed(ball, tmp_path)
    assert proposal.plan is None and proposal.reasons[-1] == "8 cm^2 are free, and hexagons:8mm needs 10: no skin."
    wanted = replace(parse_skin("hexagons:8mm"), is_wanted=True)
    assert "needs" not in propose_link("link", ball, tmp_path / "link.ply", "m", wanted).reasons[-1]
    assert parse_skin("sheet:4x5x10mm").least_area == pytest.approx(20e-4)


@pytest.mark.parametrize("length, is_named", [(0.1, True), (0.075, True), slow(0.03, False)])
def test_links_that_cover_most_of_a_link_are_named(length, is_named, tmp_path):
    """A plate of 100 x 50 x 8 mm between two that cover a part of both its faces, 5 mm away; its edges have 24 cm^2."""
    plate, other = box((0, 0, 0), (0.1, 0.05, 0.008)), box((0, 0, 0), (length, 0.05, 0.008))
    heights = {"below": -0.013, "above": 0.013}
    joints = {name: Joint(name, "fixed", "plate", name, (0, 0, height)) for name, height in heights.items()}
    body = Robot("robot.urdf", dict.fromkeys(("plate", *heights), ()), "robot", joints)
    keep_out = KeepOut(body, dict.fromkeys(heights, other) | {"plate": plate})
    found = propose_link("plate", plate, tmp_path / "robot.urdf", "m", parse_skin("hexagons:8mm"), keep_out=keep_out)
    assert (found.plan is None) == (length == 0.1)
    before, words, areas = found.reasons[0].partition(" Others cover it somewhere in the ranges of the joints: ")
    assert bool(words) == is_named and before.endswith("other links.")
    if is_named:
        first, second = re.fullmatch(r"above (\d+) cm\^2, below (\d+) cm\^2\.", areas).groups()
        assert first == second and 0 <= int(first) - 500 * length < 4


@pytest.mark.parametrize(
    "text",
    [
        *("hexagon", "hexagons:8", "hexagons:0mm", "hexagons:5000mm", "missing.json"),
        *("sheet:6x22", "sheet:0x5x10mm", "sheet:5x5x0.001mm", "sheet:99999999x9x10mm"),
    ],
)
def test_unknown_skins_are_refused(text):
    """With the forms that are known; what a plan may not have would be refused by the fit only."""
    with pytest.raises(Exception, match="hexagons:16.3mm|missing.json"):
        parse_skin(text)
    with pytest.raises(SystemExit, match="2"):
        main(["propose", "robot.urdf", "-o", "plans", "--skin", text])


def test_gap_and_thickness_of_a_skin():
    """Taxels are in the middle of the thickness; the text reads back to itself."""
    boards = parse_skin("hexagons:8mm,gap=0.5mm,thickness=3mm").template
    assert (boards.lattice.side, boards.lattice.gap, boards.offset) == (0.008, 0.0005, 0.0015)
    assert parse_skin("sheet:4x5x10mm,thickness=2mm").template.offset == 0.001
    assert parse_skin("hexagons:8mm").template.lattice.gap == 0.0
    for text in ("hexagons:8mm,gap=0.5mm,thickness=3mm", "hexagons:8mm,gap=-1mm", "sheet:4x5x10mm,thickness=2mm"):
        assert form_of(text).text == text
    assert (parse_skin("hexagons:8mm,chain=5").chain, parse_skin("hexagons:8mm").chain) == (5, 3)
    assert form_of("hexagons:8mm,gap=1mm,chain=1").text == "hexagons:8mm,gap=1mm,chain=1"
    for text in (
        "sheet:4x5x10mm,gap=1mm",
        "sheet:4x5x10mm,chain=2",
        "hexagons:8mm,thickness=3mm,gap=1mm",
        "hexagons:8mm,",
    ):
        with pytest.raises(InvalidPlan, match="is not a skin"):
            parse_skin(text)


def test_skin_of_a_file(tmp_path, capsys):
    """A skin as in a plan."""
    path = tmp_path / "skin.json"
    path.write_text(json.dumps({"kind": "hexagons", "side": 0.01, "gap": 0.001, "offset": 0.002}))
    template = parse_skin(str(path)).template
    assert (template.lattice.side, template.lattice.gap, template.offset) == (0.01, 0.001, 0.002)
    path.write_text(json.dumps({"kind": "sheet", "rows": 2, "columns": 3, "pitch": [1e-6, 0.01]}))
    with pytest.raises(InvalidPlan, match="skin.json is not a skin as in a plan: /pitch/0 must be at least 1e-05"):
        parse_skin(str(path))
    path.write_text(json.dumps({"kind": "hexagons", "size": 0.01}))
    with pytest.raises(InvalidPlan, match="size"):
        parse_skin(str(path))
    path.write_text(json.dumps({"kind": "imported"}))
    assert main(["propose", "robot.urdf", "-o", "plans", "--skin", str(path)]) == 1
    assert "no sheet or hexagons" in capsys.readouterr().err


def test_loops_enclose_exactly_the_sites():
    """Random masks with holes, against another library; round a tube there is no edge at the seam."""
    shapely = pytest.importorskip("shapely")
    rng = np.random.default_rng(3)
    for _ in range(20):
        mask = rng.random((9, 11)) > 0.4
        shape = shapely.Polygon()
        for chain in chains(mask, False):
            shape = shape.symmetric_difference(shapely.Polygon(chain).buffer(0))
        assert shape.area == mask.sum()
    ring = np.zeros((6, 8), bool)
    ring[2:4] = True
    assert sorted(len(chain) for chain in chains(ring, True)) == [8, 8]


def test_corners_on_a_line_are_left_out():
    """A square of many points has four corners; a loop of an empty mask has none."""
    corners = np.array(((0, 0, 0), (0.1, 0, 0), (0.1, 0.1, 0), (0, 0.1, 0)))
    sides = [a + (b - a) * np.linspace(0, 1, 51)[:-1, None] for a, b in zip(corners, np.roll(corners, -1, axis=0))]
    assert len(simplified(np.concatenate(sides), 1e-3)) == 4
    assert loops_around(np.zeros((3, 3), bool), np.zeros((3, 3, 3)), False, 1e-3) == ()


@pytest.mark.parametrize(("height", "count"), [(6, 1), (9, 100)])
def test_loops_are_those_that_a_plan_can_have(height, count):
    """150 vents of 9 mm in a plate: what is smaller than a cell is left out, and what is more than a plan can have."""
    mask = np.ones((150, 200), bool)
    for i, j in np.ndindex(10, 15):
        mask[2 + 14 * i : 2 + 14 * i + height, 2 + 13 * j : 11 + 13 * j] = False
    points = 1e-3 * np.stack(np.meshgrid(np.arange(150), np.arange(200), [0], indexing="ij"), axis=-1)[:, :, 0]
    loops = loops_around(mask, points, False, 1e-3)
    assert len(loops) == count and max(np.ptp(loop, axis=0).max() for loop in loops) > 0.19  # with the outer one


URDF = """<robot name="arm">
  <link name="upper"><visual><geometry><mesh filename="upper.ply"/></geometry></visual></link>
  <link name="lower"><visual><geometry><mesh filename="upper.ply"/></geometry></visual></link>
  <link name="lost"><visual><geometry><mesh filename="lost.ply"/></geometry></visual></link>
  <link name="tool"/>
  <joint name="elbow" type="revolute"><parent link="upper"/><child link="lower"/><origin xyz="0 0 0.064"/>
    <axis xyz="0 1 0"/><limit lower="-0.1" upper="0.1" effort="1" velocity="1"/></joint>
  <joint name="end" type="fixed"><parent link="lower"/><child link="tool"/></joint>
  <joint name="other" type="fixed"><parent link="lower"/><child link="lost"/></joint>
</robot>"""


def test_totals_are_of_the_plans_that_are_made(tmp_path, capsys):
    """A plan that exists is counted, and its area is not known; names may have the characters of patterns."""
    save_mesh(box((0, 0, 0), (0.05, 0.04, 0.004)), tmp_path / "upper.ply")
    urdf, plans = tmp_path / "arm.urdf", tmp_path / "plans"
    urdf.write_text(URDF.replace('"upper"', '"b[1]*x"'))
    words = ["propose", str(urdf), "-o", str(plans), "--except", "lost", "--skin", "sheet:2x3x8mm"]
    assert main([*words, "--only", "b[1]*x"]) == 0
    out = capsys.readouterr().out
    cells, free, part = map(int, re.search(r"cells cover (\d+) of (\d+) cm\^2 free \((\d+)%\)", out).groups())
    assert 0 < cells < free and part == pytest.approx(100 * cells / free, abs=3)  # areas are rounded
    assert f"1 link, 1 plan; 12 taxels on 12 channels, cells cover {cells} cm^2, {part}% of the free area and" in out
    assert main(words) == 0
    assert "2 links, 2 plans; without those kept, 12 taxels on 12 channels, cells cover" in capsys.readouterr().out


@pytest.mark.slow
def test_robot_is_proposed_and_fitted_by_two_commands(tube, tmp_path, capsys):
    """Plans with channels that follow each other; a missing mesh fails alone; existing plans stay."""
    save_mesh(tube, tmp_path / "upper.ply")
    urdf, plans, out = tmp_path / "arm.urdf", tmp_path / "plans", tmp_path / "robot"
    urdf.write_text(URDF)
    assert main(["propose", str(urdf), "-o", str(plans)]) == 1
    said = capsys.readouterr()
    assert "lost: " in said.err and "lost   failed" in said.out and "3 links, 2 plans" in said.out
    upper, lower = (load_plan(plans / f"{name}.plan.json") for name in ("upper", "lower"))
    assert upper.skins[0].first_channel == 0 and lower.skins[0].first_channel > 10
    assert upper.mesh.resolve() == urdf.resolve()
    out.mkdir()
    assert main(["fit", str(plans), "-o", str(out)]) == 0
    files = [load_calibration(out / f"{name}.calibration.json") for name in ("upper", "lower")]
    channels = [patch.taxels.channels for file in files for patch in file.patches]
    assert np.array_equal(np.sort(np.concatenate(channels)), np.arange(sum(map(len, channels))))
    assert all(
        p.taxels.positions_link[:, 2].max() < LENGTH / 2 - 0.001 for p in files[0].patches
    )  # the lower link is 4 mm above its end
    before = (plans / "upper.plan.json").read_bytes()
    assert main(["propose", str(urdf), "-o", str(plans), "--only", "upper", "--skin", "hexagons:8mm"]) == 0
    assert (plans / "upper.plan.json").read_bytes() == before and "kept" in capsys.readouterr().out


@pytest.mark.parametrize("call", [["propose"], ["fit", "--propose"]], ids=["propose", "fit"])
def test_robot_without_any_mesh_states_why(tmp_path, capsys, call):
    """One line for each link, and no plan: formats that are unknown, and files that are missing."""
    urdf = tmp_path / "arm.urdf"
    urdf.write_text(URDF.replace("upper.ply", "upper.fbx"))
    (tmp_path / "upper.fbx").write_bytes(b"Kaydara")
    assert main([call[0], str(urdf), *call[1:], "-o", str(tmp_path / "out")]) == 1
    said = capsys.readouterr()
    assert said.err.count("upper.fbx has an unknown format. Use one of stl, ply, obj, off, dae, glb.") == 2
    assert "lost: the mesh file lost.ply of arm.urdf was not found" in said.err and "unexpected" not in said.err
    assert "3 links, 0 plans" in said.out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--only", "uper"], "has no link .*upper"),
        (["--except", "*"], "no link with a visual mesh that is left"),
    ],
)
def test_wrong_calls_are_refused(tmp_path, capsys, arguments, message):
    """In one line, before any file is written."""
    (tmp_path / "arm.urdf").write_text(URDF)
    assert main(["propose", str(tmp_path / "arm.urdf"), "-o", str(tmp_path / "plans"), *arguments]) != 0
    error = capsys.readouterr().err
    assert len(error.splitlines()) == 1 and re.search(message, error)
    assert not (tmp_path / "plans").exists()


def test_blender_keeps_the_directions_of_a_proposal(tube):
    """Axes and normals on a tilted tube survive single precision, as Blender has it; other numbers are rounded, too."""
    turned = trimesh.Trimesh(tube.vertices, tube.faces, process=False)
    turned.apply_transform(trimesh.transformations.rotation_matrix(0.7, (1, 2, 3), (0.1, 0.2, 0)))
    numbers = []
    for candidate in candidates(LinkPoints.of(welded(turned)), (), 0.0):
        region = candidate.region
        numbers += region.normal if isinstance(region, Across) else (*region.axis.point, *region.axis.direction)
    assert len(numbers) > 20 and all(float(str(np.float32(x))) == x for x in numbers)


@pytest.mark.slow
def test_stated_area_is_that_of_cells(tmp_path):
    """Boards of 20 mm fit on the two largest faces of a box only, one on each."""
    proposal = proposed(welded(subdivided(box((0, 0, 0), (0.06, 0.05, 0.03)))), tmp_path, "hexagons:20mm")
    assert len(proposal.plan.surfaces) == 2 and "left out" in " ".join(proposal.reasons)
    assert (proposal.chains, proposal.singles) == (2, 2) and proposal.cables == pytest.approx(0.03, abs=0.002)
    assert proposal.cells == pytest.approx(2 * 1.5 * 3**0.5 * 0.02**2, rel=1e-6)
    assert f"cover {proposal.cells * 1e4:.0f} cm^2" in proposal.reasons[-1]


def test_finger_has_small_boards_around_it_and_on_its_tip(tmp_path):
    """Its surfaces are smaller than those of other links, because the boards are. Large boards do not fit."""
    capsule = trimesh.creation.capsule(height=0.04, radius=0.01, count=(48, 48)).subdivide_to_size(0.004)
    above = capsule.vertices[capsule.faces].mean(axis=1)[:, 2] > 0
    save_mesh(weld(capsule.vertices, capsule.faces[above]), tmp_path / "finger.ply")
    mesh = load_mesh(tmp_path / "finger.ply")
    small, large = (
        propose_link("finger", mesh, tmp_path / "finger.ply", "m", replace(parse_skin(skin), is_wanted=True))
        for skin in ("hexagons:3mm", "hexagons:8mm")
    )
    patches = calibrate(small.plan, mesh, known=small.fits).calibration.patches
    points = np.concatenate([patch.taxels.positions_link for patch in patches]) - (0, 0, 0.02)
    slopes = np.rad2deg(np.arctan2(np.hypot(*points.T[:2]), points[:, 2]))
    assert np.count_nonzero(slopes < 45) >= 3 and np.count_nonzero(slopes > 90) > 20
    assert large.plan is None and "No skin fits on" in large.reasons[-1]
