"""Uncertainties of placed skins: registration by kind of skin, rows where nothing can be stated, the file."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from skin_calib_addon.calibration.exchange.table import write_table
from skin_calib_addon.calibration.file import from_document, load_calibration, save_calibration, to_document
from skin_calib_addon.calibration.model import Patch
from skin_calib_addon.common.errors import InvalidPlan
from skin_calib_addon.common.mesh_uncertainty import MeshUncertainty
from skin_calib_addon.geometry import CoverSpec, TubeGrid, fit_surface
from skin_calib_addon.pipeline import calibrate, taxel_sigma
from skin_calib_addon.pipeline.taxel_sigma import draft_sigma, unknown_sigma, with_sigma
from skin_calib_addon.plan import Plan
from skin_calib_addon.plan.document import skins_from
from skin_calib_addon.plan.plan import Surface
from skin_calib_addon.plan.skins import ImportedSkin
from skin_calib_addon.skin.imported import imported_taxels
from skin_calib_addon.skin.single_taxels import chosen_taxels
from skin_calib_addon.skin.uncertainty import taxel_uncertainty
from tests.examples import slow
from tests.shapes import LENGTH, RADIUS, Z_AXIS, cylinder, with_hole
from tests.unit.skin.test_board_planes import boards_around
from tests.unit.skin.test_imported import taxel_set

SHEET = {
    "name": "sheet",
    "kind": "sheet",
    "rows": 4,
    "columns": 6,
    "pitch": [0.008, 0.008],
    "origin": [RADIUS, 0, 0.03],
    "direction": [0, 1, 0],
}


MESH, FITS = cylinder(), {}
EXACT = MeshUncertainty(0.0)


def made(skin, tmp_path, mesh=MESH, part=EXACT):
    """What a plan with one skin gives on a tube of 35 mm, which is fitted once."""
    grid = TubeGrid(6, 16, Z_AXIS, 1e-3, "uniform")
    plan = Plan("tube", tmp_path / "tube.stl", "m", (Surface(CoverSpec(), grid),), skins_from([skin]))
    plan = replace(plan, mesh_uncertainty=part)
    result = calibrate(plan, mesh, known=FITS if mesh is MESH else None)
    FITS.update(result.fits if mesh is MESH else {})
    return result


def test_registration_is_that_of_the_skin(tmp_path):
    """An origin is the anchor; a centred sheet has its middle; two landmarks give the direction."""
    patch = made(SHEET, tmp_path).calibration.patches[0]
    assert_allclose(patch.registration.anchor, (RADIUS, 0, 0.03), atol=2e-6)
    assert (patch.registration.origin, patch.registration.direction) == (1e-3, np.deg2rad(1.0))
    along = patch.taxels.sigma[:, 0]
    assert along.argmin() == 0 and abs(along[0] - 1e-3) < 1e-6 and along.argmax() == len(along) - 1
    centred = made(SHEET | {"origin": "center"}, tmp_path).calibration.patches[0]
    assert_allclose(centred.registration.anchor[2], LENGTH / 2, atol=2e-3)
    assert centred.taxels.sigma[:, 0].max() < along.max()
    marks = [{"cell": [0, 0], "point": [RADIUS, 0, 0.03]}, {"cell": [3, 0], "point": [RADIUS, 0, 0.054]}]
    bare = {key: value for key, value in SHEET.items() if key not in ("origin", "direction")}
    marked = made(bare | {"landmarks": marks, "direction": [0, 1, 0]}, tmp_path).calibration.patches[0]
    assert_allclose(marked.registration.anchor, (RADIUS, 0, 0.03), atol=2e-6)
    assert_allclose(marked.registration.direction, np.sqrt(2) * 1e-3 / 0.024, rtol=1e-9)


def test_largest_load_of_the_plan_is_that_of_the_patch(tmp_path):
    """The file keeps it for the runtime; without the key it has none."""
    for key, stated in (({"max_load": 250.0}, 250.0), ({}, None)):
        result = made(SHEET | key, tmp_path).calibration
        assert from_document(to_document(result)).patches[0].max_load == stated


STATED = {"origin": 3e-4, "direction": 0.005}


@pytest.mark.parametrize("kind", ["sheet", slow("hexagons"), "imported"])
def test_registration_of_the_plan_is_that_of_the_patch(kind, tmp_path):
    """Sigma at the anchor is its origin; away from it the direction adds; an anchor elsewhere moves the minimum."""
    skin = SHEET | {"registration": STATED}
    if kind == "hexagons":
        cells = [[0, 0], [1, 0], [0, 1], [2, 0]]
        skin = {"name": "b", "kind": kind, "side": 0.006, "gap": 0.0, "cells": cells, "origin": SHEET["origin"]}
        skin |= {"direction": [0, 1, 0], "registration": STATED}
    if kind == "imported":
        (tmp_path / "c.csv").write_bytes(write_table(made(SHEET, tmp_path).calibration))
        skin = {"name": "i", "kind": kind, "file": str(tmp_path / "c.csv"), "registration": STATED}
    patch = made(skin, tmp_path).calibration.patches[0]
    assert (patch.registration.origin, patch.registration.direction) == (3e-4, 0.005)
    arms = patch.taxels.positions_link - patch.registration.anchor
    squares = (arms**2).sum(axis=1)
    if kind == "imported":  # it turns about all axes
        squares += (arms * patch.taxels.normals_link).sum(axis=1) ** 2
    near, far, along = squares.argmin(), squares.argmax(), patch.taxels.sigma[:, 0]
    assert abs(along[near] - 3e-4) < 2.5e-5
    assert_allclose(along[far], np.sqrt(9e-8 + 0.005**2 * squares[far] / 2), rtol=0.02)
    last = tuple(patch.taxels.positions_link[-1].tolist())
    moved = made(skin | {"registration": STATED | {"anchor": last}}, tmp_path).calibration.patches[0]
    assert moved.registration.anchor == last
    assert moved.taxels.sigma[:, 0].argmin() == len(moved.taxels.ids) - 1


@pytest.mark.parametrize(("anchor", "distance"), [([0.135, 0, 0.03], 100.0), ([35, 0, 30], 1e3)])
def test_anchor_away_from_the_skin_is_an_error(anchor, distance, tmp_path):
    """The message has the distance; a point in millimetres is far away."""
    with pytest.raises(InvalidPlan, match="anchor of the registration of skin 'sheet'.* mm from the skin") as found:
        made(SHEET | {"registration": STATED | {"anchor": anchor}}, tmp_path)
    assert found.value.numbers["distance"] * 1e3 > 0.9 * distance
    assert found.value.numbers["place"].point == tuple(anchor)


def test_taxels_of_imported_boards_turn_with_the_frame_only():
    """A board keeps its plane where the surface under it bends; a taxel with the normal of the surface does not."""
    positions, _, board = boards_around(RADIUS)
    fit = fit_surface(cylinder(), TubeGrid(6, 16, Z_AXIS, 1e-3, "uniform"))
    skin = ImportedSkin("i", Path("i.csv"))
    bent, height = {}, {}
    for snap in (False, True):
        taxels = imported_taxels(taxel_set(positions, boards=board), fit.error_field.surface, "i", snap=snap).taxels
        patch = Patch("i", "imported", "tube", (1, len(taxels.ids)), (0.0065, 0.0065), taxels)
        _, height[snap], bent[snap] = with_sigma(patch, replace(skin, snap=snap), fit, None, EXACT).taxels.sigma.T
    assert_allclose(bent[False], np.deg2rad(1.0), rtol=1e-9)
    assert (bent[True] > np.hypot(np.deg2rad(1.0), 0.9e-3 / RADIUS)).all()
    # The frame of the file moves its taxels along the normal, too; those that snap are as near as the surface.
    assert (height[False] > 0.99e-3).all()
    assert_allclose(height[True] ** 2, fit.error_field.at(taxels.uv)[0], rtol=1e-9)


@pytest.mark.parametrize("kind", ["sheet", "imported", "snapped"])
def test_deviation_of_the_part_adds_in_all_components(kind, tmp_path):
    """Squares of sigma grow by s^2 along and normal, and of the angle by 2 s^2 / L^2 or more; the file states both."""
    skin, part = SHEET, MeshUncertainty(3e-4, 0.04)
    if kind != "sheet":
        (tmp_path / "c.csv").write_bytes(write_table(made(SHEET, tmp_path).calibration))
        skin = {"name": "i", "kind": "imported", "file": str(tmp_path / "c.csv"), "snap": kind == "snapped"}
    exact, deviating = (made(skin, tmp_path, part=of).calibration for of in (EXACT, part))
    assert deviating.mesh.uncertainty == part
    before, after = (each.patches[0].taxels.sigma ** 2 for each in (exact, deviating))
    assert_allclose((after - before)[:, :2], part.variance, rtol=1e-3)
    assert (after[:, 2] > before[:, 2] + 0.99 * part.slope).all()
    assert (after[:, 2] < before[:, 2] + part.slope + 1.1 * part.variance / RADIUS**2).all()  # moved along, it turns


def test_nothing_is_stated_over_a_hole_or_for_a_strained_cell(tmp_path):
    """The rows are null in the file, and a warning names the taxels."""
    result = made(SHEET, tmp_path, with_hole(cylinder(), (RADIUS, 0.01, 0.04), 0.006))
    patch = result.calibration.patches[0]
    unknown = np.isnan(patch.taxels.sigma).all(axis=1)
    over = next(w for w in result.warnings if w.code == "over-hole")
    assert 0 < unknown.sum() < len(unknown)
    assert {patch.taxels.ids[i] for i in np.flatnonzero(unknown)} == set(over.where.taxels)
    save_calibration(result.calibration, tmp_path / "c.json")
    read = load_calibration(tmp_path / "c.json").patches[0]
    assert_allclose(read.taxels.sigma, patch.taxels.sigma, rtol=0)
    assert read.registration == patch.registration
    whole = made(SHEET, tmp_path)
    placed = whole.placed[0]
    assert np.isfinite(placed.patch.taxels.sigma).all() and not list(unknown_sigma(placed.patch, whole.fit))
    strain = placed.patch.taxels.quality["strain"].copy()
    strain[5, 1] = -0.12
    quality = placed.patch.taxels.quality | {"strain": strain}
    strained = replace(placed.patch, taxels=replace(placed.patch.taxels, quality=quality))
    skin = skins_from([SHEET])[0]
    stated = with_sigma(strained, skin, whole.fit, placed.sheet, EXACT)
    assert np.flatnonzero(np.isnan(stated.taxels.sigma).any(axis=1)).tolist() == [5]
    (warning,) = unknown_sigma(stated, whole.fit)
    assert warning.code == "no-uncertainty" and warning.where.taxels == (stated.taxels.ids[5],)
    assert "strained by more than 10%" in warning.message
    sigma = placed.patch.taxels.sigma.copy()
    sigma[7] = np.nan
    (warning,) = unknown_sigma(replace(placed.patch, taxels=replace(placed.patch.taxels, sigma=sigma)), whole.fit)
    assert "cannot be computed there" in warning.message and warning.where.taxels == (stated.taxels.ids[7],)


@pytest.mark.parametrize("trim", [False, True])
def test_draft_of_many_taxels_has_the_uncertainty_of_near_ones(trim, tmp_path, monkeypatch):
    """It computes a part of the rows; along the surface, all are within a tenth of the exact uncertainty."""
    sheet = SHEET | {"rows": 30, "columns": 40, "pitch": [0.002, 0.002], "trim": trim}
    sheet["origin"] = [RADIUS, 0, LENGTH - 0.04 if trim else 0.02]
    result = made(sheet, tmp_path)
    exact, placed = result.calibration.patches[0], result.placed[0]
    rows, skin = [], skins_from([sheet])[0]
    monkeypatch.setattr(
        taxel_sigma, "taxel_uncertainty", lambda *a, real=taxel_uncertainty: rows.append(len(a[0].ids)) or real(*a)
    )
    bare = replace(exact, taxels=replace(exact.taxels, sigma=np.empty((0, 3))), registration=None)
    draft = draft_sigma(bare, skin, result.fit, placed.sheet, EXACT)
    assert trim == (len(exact.taxels.ids) < 1200) and 0 < rows[0] <= 1.2 * taxel_sigma.MAX_DRAFT_TAXELS
    assert draft.registration == exact.registration
    assert_allclose(draft.taxels.sigma[:, 0], exact.taxels.sigma[:, 0], rtol=0.1)
    few = replace(bare, taxels=chosen_taxels(bare.taxels, bare.taxels.index[:, 0] < 4))
    assert_allclose(
        draft_sigma(few, skin, result.fit, placed.sheet, EXACT).taxels.sigma,
        with_sigma(few, skin, result.fit, placed.sheet, EXACT).taxels.sigma,
    )
