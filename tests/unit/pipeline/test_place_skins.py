"""Placement of the skins of a plan on the surface of a link."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from skin_calib_addon.calibration.file import load_calibration, save_calibration
from skin_calib_addon.common.errors import InvalidPlan, OutsideSurface
from skin_calib_addon.geometry import AcrossGrid, CoverSpec, TubeGrid
from skin_calib_addon.inspection.all_taxels import AllTaxels
from skin_calib_addon.pipeline import calibrate
from skin_calib_addon.pipeline.place_skins import Draft, place_all
from skin_calib_addon.pipeline.report import report_document, summary
from skin_calib_addon.plan import Plan, plan_from
from skin_calib_addon.plan.document import skins_from
from skin_calib_addon.plan.plan import Surface
from skin_calib_addon.runtime import load
from skin_calib_addon.skin.warnings import normal_warnings
from tests.shapes import Z_AXIS, cylinder, with_hole
from tests.shapes import sheet as flat_sheet

RADIUS = 0.05
SHEET = {
    "name": "band",
    "kind": "sheet",
    "rows": 3,
    "columns": 33,
    "pitch": [0.01, 0.01],
    "origin": [RADIUS, 0, 0.03],
    "direction": [0, 1, 0],
    "overlap": True,  # 33 columns are 16 mm longer than the circumference
}
BOARDS = {"name": "boards", "kind": "hexagons", "side": 0.01, "gap": 0.0, "cells": "all", "origin": [RADIUS, 0, 0.15]}


MESH, FITS = cylinder(RADIUS, 0.2, 96, 30), {}


def made(skins, tmp_path):
    """What a plan with these skins gives on a tube of 50 mm, 200 mm long, which is fitted once."""
    surface = Surface(CoverSpec(), TubeGrid(6, 24, Z_AXIS, 1e-3))
    result = calibrate(Plan("tube", tmp_path / "tube.stl", "m", (surface,), skins_from(skins)), MESH, known=FITS)
    FITS.update(result.fits)
    return result


def test_every_kind_is_placed_saved_and_used(tmp_path):
    """A sheet, boards above it, and imported taxels: one calibration, which the runtime loads and uses."""
    (tmp_path / "t.csv").write_text("x,y,z\n-0.0505,0,0.02\n-0.05,0.0065,0.02\n-0.05,0,0.0265\n")
    result = made(
        [SHEET, BOARDS | {"offset": 0.001}, {"name": "few", "kind": "imported", "file": str(tmp_path / "t.csv")}],
        tmp_path,
    )
    path = tmp_path / "tube.json"
    save_calibration(result.calibration, path)
    sheet, boards, few = load_calibration(path).patches
    assert (sheet.kind, boards.kind, few.kind) == ("sheet", "hexagons", "imported")
    assert sheet.shape == (3, 33) and sheet.taxels.index.max(axis=0).tolist() == [2, 32]
    extent = np.ptp(boards.taxels.index, axis=0) + 1
    assert boards.shape == tuple(extent) and extent[0] != extent[1]
    assert boards.offset == 0.001 and boards.taxels.ports == result.calibration.patches[1].taxels.ports
    channels = np.concatenate([p.taxels.channels for p in (sheet, boards, few)])
    assert channels.tolist() == list(range(len(channels)))
    assert_allclose(few.taxels.quality["gap"], (0.0005, 0.0004, 0), rtol=0, atol=1e-4)
    skin = load(path)
    readings = np.zeros(skin.reading_length)
    row = 99 + 3
    readings[skin.channels[[row, *[skin.ids.index(i) for i in boards.taxels.neighbours[3]]]]] = 2.0
    (contact,) = skin.update(readings, 0.0).contacts
    assert len(contact.ids) == 1 + len(boards.taxels.neighbours[3])
    assert_allclose(contact.force, 2.0 * len(contact.ids))
    report = report_document(result)
    assert [p["kind"] for p in report["patches"]] == ["sheet", "hexagons", "imported"]
    assert report["patches"][0]["closure"]["of"] == "rows" and report["patches"][1]["tilts"]
    assert "rows close with gaps of" in summary(result, path)
    assert report["patches"][2]["distances"]["before"]["surface"]["mean"] > 0


def test_adjacent_sheets_are_joined(tmp_path):
    """A second sheet continues the first: taxels on both sides of the border are neighbours."""
    above = SHEET | {"name": "above", "origin": [RADIUS, 0, 0.06]}
    patches = made([SHEET, above], tmp_path).calibration.patches
    below = dict(zip(patches[0].taxels.ids, patches[0].taxels.neighbours))
    above = dict(zip(patches[1].taxels.ids, patches[1].taxels.neighbours))
    for column in range(33):
        assert f"above.0.{column}" in below[f"band.2.{column}"] and f"band.2.{column}" in above[f"above.0.{column}"]
    assert not any(other.startswith("above") for k in range(33) for other in below[f"band.1.{k}"])


def test_warnings_report_skins_that_do_not_fit(tmp_path):
    """Rows too long for the tube, and boards too large for its curvature."""
    long = SHEET | {"columns": 36}
    result = made([long, BOARDS | {"side": 0.025, "origin": [RADIUS, 0, 0.12]}], tmp_path)
    warnings, row = result.warnings, result.placed[0].closure.gaps.argmin()
    (overlap,) = (w for w in warnings if w.code == "overlap")
    assert "band overlaps itself by up to 45." in overlap.message
    assert f"(row {row})" in overlap.message and overlap.where.names == f"row {row}"
    assert overlap.where.skin == "band" and 0.045 < overlap.value < 0.046
    assert np.hypot(*overlap.where.point[:2]) == pytest.approx(RADIUS, abs=1e-4)
    (gap,) = (w for w in warnings if w.code == "board-gap")
    assert "boards of boards have a corner more than 3 mm off the surface" in gap.message
    assert gap.where.skin == "boards" and gap.where.taxels[0] in gap.message and gap.value > 3e-3
    assert gap.value == np.abs(result.calibration.patches[1].taxels.quality["gap"]).max()
    assert made([SHEET | {"columns": 31}], tmp_path).warnings == ()
    with pytest.raises(InvalidPlan, match=r"skin 'band' overlaps itself by up to 15.* Use 2 fewer columns"):
        made([SHEET | {"overlap": False}], tmp_path)


def test_overlapping_channels_are_an_error(tmp_path):
    """The number of channels of boards is known after the placement."""
    with pytest.raises(
        InvalidPlan, match=r"Skins 'boards' and 'band' both have channel \d+\. Change the first channel"
    ):
        made([BOARDS | {"first_channel": 0}, SHEET | {"first_channel": 20}], tmp_path)


def test_normals_that_are_oblique_to_the_faces_below_are_named(tmp_path):
    """A ridge of 40 degrees on the mesh, which the surface does not follow; inverted faces change nothing."""
    tube = cylinder(RADIUS, 0.2, 96, 60)
    x, y, z = tube.vertices.T
    out = 1 + np.clip(np.deg2rad(40) * (0.008 - np.abs(z - 0.05)), 0, None) * (np.abs(np.arctan2(y, x)) < 0.5) / RADIUS
    ridge = replace(tube, vertices=np.column_stack((out * x, out * y, z)))
    surface = Surface(CoverSpec(), TubeGrid(4, 12, Z_AXIS, 1e-3))
    sheet = SHEET | {"rows": 6, "columns": 5, "pitch": [0.006, 0.006]}
    plan = Plan("tube", tmp_path / "tube.stl", "m", (surface,), skins_from([sheet]))
    patch = calibrate(plan, tube).calibration.patches[0]
    assert not list(normal_warnings(patch, tube))
    for mesh in (ridge, replace(ridge, faces=ridge.faces[:, ::-1])):
        (found,) = normal_warnings(patch, mesh)
        height = patch.taxels.positions_link[[patch.taxels.ids.index(name) for name in found.where.taxels], 2]
        assert found.code == "oblique" and found.where.skin == "band" and len(height) >= 5
        assert (np.abs(height - 0.05) < 0.011).all() and np.deg2rad(15) < found.value < np.deg2rad(60)
        assert f"{len(height)} of 30 normals of band are more than 15 degrees" in found.message
    (found,) = (w for w in calibrate(plan, ridge).warnings if w.code == "oblique")
    assert found.where.taxels


def test_cells_are_compared_with_the_mesh_as_it_is_given(tmp_path):
    """The fit leaves a high vertex out; a trimmed sheet has no cell there, and a warning names those of another one."""
    plate = flat_sheet(lambda x, y: 0 * x)
    highest = int(np.linalg.norm(plate.vertices - plate.vertices.mean(axis=0), axis=1).argmin())
    vertices = plate.vertices.copy()
    vertices[highest, 2] += 0.004
    grid = {"kind": "patch", "n": 6, "lines": 6, "normal": [0, 0, 1], "margin": 0.002}
    lattice = {"kind": "sheet", "rows": 9, "columns": 11, "pitch": [0.004, 0.004], "direction": [1, 0, 0]}
    skins = [lattice | {"name": name, "origin": "center", "trim": name == "trimmed"} for name in ("trimmed", "whole")]
    document = {"format": "skin-plan", "version": 1, "link": "plate", "mesh": "plate.ply", "unit": "m"}
    result = calibrate(plan_from(document | {"grid": grid, "skins": skins}), replace(plate, vertices=vertices))
    trimmed, whole = result.calibration.patches
    near = np.linalg.norm(whole.taxels.positions_link - plate.vertices[highest], axis=1) < 2e-3
    assert near.any() and len(whole.taxels.ids) == 99
    left_out = {name.partition(".")[2] for name in whole.taxels.ids} - {n.partition(".")[2] for n in trimmed.taxels.ids}
    named = {name for w in result.warnings if w.code == "oblique" for name in w.where.taxels}
    for name in np.array(whole.taxels.ids)[near]:
        assert name.partition(".")[2] in left_out
    assert 0 < len(left_out) < 16 and {name.partition(".")[0] for name in named} >= {"whole"}


def test_tilts_of_boards_are_to_their_neighbours_of_all_skins(tmp_path):
    """The file, the heat map and the neighbours agree: with a sheet next to the boards, and a disabled board."""
    sheet = SHEET | {"columns": 4, "origin": [RADIUS, 0, 0.1], "overlap": False}
    angle = 0.55
    origin = [RADIUS * np.cos(angle), RADIUS * np.sin(angle), 0.1]
    row = {"cells": [[0, 0], [1, 0], [2, 0]], "origin": origin, "direction": [-np.sin(angle), np.cos(angle), 0]}
    boards = BOARDS | row
    alone = made([boards], tmp_path).calibration.patches[0].taxels
    for off in ([], [{"taxel": "2.0", "enabled": False}]):
        patches = made([sheet, boards | {"taxels": off}], tmp_path).calibration.patches
        normals = dict(zip(*(sum((list(getattr(p.taxels, k)) for p in patches), []) for k in ("ids", "normals_link"))))
        taxels = patches[1].taxels
        assert any(other.startswith("band") for other in taxels.neighbours[0])
        largest = [
            max(2 * np.arcsin(np.linalg.norm(normals[id] - normals[other]) / 2) for other in others)
            for id, others in zip(taxels.ids, taxels.neighbours)
        ]
        assert_allclose(taxels.quality["tilt"], largest, rtol=1e-12)
        assert_allclose(AllTaxels.of(patches).tilt[-len(largest) :], largest, rtol=1e-12)
    assert largest[0] > alone.quality["tilt"][0]


def test_draft_is_along_the_facets_where_it_may_be(tmp_path):
    """On a tube of 24 sides, which are up to 0.43 mm inside of the circle through its vertices."""
    sheet = SHEET | {"columns": 20}
    plan = Plan(
        "tube", tmp_path / "tube.stl", "m", (Surface(CoverSpec(), TubeGrid(6, 24, Z_AXIS)),), skins_from([sheet])
    )
    fits = calibrate(plan, cylinder(RADIUS, 0.2, 24, 30)).fits
    ((name, fit),) = fits.items()
    above = {}
    for on_facets in (False, True):
        anew = replace(fit)  # computes its parts again
        (placed,) = place_all(plan, {name: anew}, Draft({}, False, False, on_facets))
        above[on_facets] = np.hypot(*placed.patch.taxels.positions_link.T[:2]) - RADIUS
        assert ("error_field" in vars(anew)) == (not on_facets)
    assert np.abs(above[False]).max() < 3e-5 and -4.3e-4 < above[True].mean() < -1.5e-4


def test_cells_over_a_hole_are_a_warning_and_can_be_an_error(tmp_path):
    """Corners over a hole of a plate count as those beyond its rim; without an overhang there is no warning."""
    plate = with_hole(flat_sheet(lambda x, y: 0 * x, cells=(50, 40)), (0.05, 0.04, 0), 0.013)
    surface = Surface(CoverSpec(), AcrossGrid(20, 20, (0, 0, 1), (1, 0, 0)))
    skin = {"name": "s", "kind": "sheet", "rows": 2, "columns": 2, "pitch": [0.01, 0.01], "direction": [1, 0, 0]}

    def placed(document):
        plan = Plan("plate", tmp_path / "plate.stl", "m", (surface,), skins_from([document]))
        return calibrate(plan, plate)

    clear = placed(skin | {"origin": [0.01, 0.01, 0]})
    assert "overhang" not in clear.calibration.patches[0].taxels.quality
    over = placed(skin | {"origin": [0.024, 0.035, 0]})
    (found,) = (w for w in over.warnings if w.code == "overhang")
    assert "cells of s protrude over an edge, a hole or the boundary by more than 1 mm" in found.message
    taxels = over.calibration.patches[0].taxels
    assert found.where.taxels[0] in found.message and found.value == taxels.quality["overhang"].max() > 1e-3
    assert ((taxels.areas < 0.99e-4) == (taxels.quality["overhang"] > 0)).all()
    with pytest.raises(OutsideSurface, match=r"of 2 cells of skin 's' over .* by more than 2 mm, .* maximum overhang"):
        placed(skin | {"origin": [0.024, 0.035, 0], "max_overhang": 0.002})
    assert placed(skin | {"origin": [0.01, 0.01, 0], "max_overhang": 0}).taxels == 4
    board = {"kind": "hexagons", "side": 0.006, "cells": [[0, 0]], "origin": [0.034, 0.04, 0], "max_overhang": 0.001}
    with pytest.raises(OutsideSurface, match=r"Overhang of 1 board of skin 's' over .* use fewer boards there"):
        placed({"name": "s"} | board)
