"""The runtime, compared with contact forces of an independent simulator; the data can be missing."""

import json
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from skin_calib_addon.calibration import Response, ResponseTable
from skin_calib_addon.runtime import Skin, convex_hull
from skin_calib_addon.validation import Touches, placements
from tests.samples import plane, small_calibration
from tests.soles import cell_patch

TRUTH = (Path(__file__).parents[2] / ".." / "shared" / "data" / "truth").resolve()
pytestmark = pytest.mark.skipif(not TRUTH.is_dir(), reason=f"no simulated truth here: {TRUTH} is missing")


@cache
def recorded(name):
    """Return the arrays of a recording."""
    with np.load(TRUTH / f"{name}.npz") as file:
        return dict(file)


def layout(name):
    """Return positions, normals and corners of a layout, as stored."""
    taxels = json.loads((TRUTH / f"layout_{name}.json").read_text())["taxels"]
    return (np.array([t[key] for t in taxels]) for key in ("position", "normal", "corners"))


def sole(response, **options):
    """Return the simulated sole; the normals of its layout point into the robot."""
    positions, normals, corners = layout("left_sole")
    patch = cell_patch(positions, -normals, corners[:, ::-1], radius=0.0285)
    return Skin(
        small_calibration(link="left_sole", patches=(patch,), surfaces=(plane(),), response=response), **options
    )


def frames(name, skin, readings):
    """Return the frame of each reading of a recording, with long gaps between them."""
    return [skin.update(reading, 1000.0 * k) for k, reading in enumerate(recorded(name)[readings])]


def sole_12_bit(name):
    """Return a sole with 800 N at 12 bits and 2 LSB of noise; the thesis switches at 1.5 N."""
    return sole(Response((0.0, float(recorded(name)["lsb12"]))), switch_on=1.5, switch_off=1.0)


@pytest.mark.parametrize("name", ["foot_flat", "foot_beam12"])
def test_cop_of_12_bit_readings(name):
    """The mean error is less than 1.5 mm; 95 of 100 errors are less than 3.1 mm."""
    off = [f.cop - t for f, t in zip(frames(name, sole_12_bit(name), "raw_u12"), recorded(name)["cop_sole"])]
    off = np.linalg.norm(off, axis=1)
    assert off.mean() < 1.5e-3 and np.percentile(off, 95) < 3.1e-3


def test_cop_at_full_contact_is_corrected_for_the_cells():
    """On exact forces CoP, ZMP and wrench are off by 0.01 mm, 1/30 of forces at the centres of the cells."""
    data, skin = recorded("foot_flat"), sole(Response((0.0, 1.0)), switch_on=1e-3, switch_off=5e-4)
    full = (data["taxel_fn"] > 1e-3).all(axis=1)
    assert full.sum() >= 50
    whole = [skin.update(f, 1000.0 * k) for k, f in enumerate(data["taxel_fn"][full])]
    true = data["cop_sole"][full]
    lumped = data["taxel_fn"][full] @ skin.positions[:, :2] / data["taxel_fn"][full].sum(axis=1)[:, None]
    lumped = np.linalg.norm(lumped - true, axis=1)
    wrenches = np.array([f.wrench for f in whole])
    for found in ([f.cop for f in whole], [f.zmp for f in whole], wrenches[:, [4, 3]] * (-1, 1) / wrenches[:, 2:3]):
        corrected = np.linalg.norm(found - true, axis=1)
        assert corrected.mean() < 0.02e-3 and corrected.mean() < lumped.mean() / 20


@pytest.mark.parametrize("name", ["foot_flat", "foot_beam12"])
def test_true_contact_lies_between_the_polygons(name):
    """The guaranteed polygon is in the true region in every frame; the outer one contains every true CoP."""
    data, areas = recorded(name), 0
    for k, frame in enumerate(frames(name, sole_12_bit(name), "raw_u12")):
        true = convex_hull(data["true_hull"][slice(*data["true_hull_off"][k : k + 2])])
        guaranteed = frame.polygon.guaranteed
        areas += guaranteed.kind == "area"
        assert all(true.margin(corner) > -1e-9 for corner in guaranteed.corners)
        assert frame.polygon.outer.contains(data["cop_sole"][k])
    assert areas > 0.9 * len(data["t"])


@pytest.mark.slow
@pytest.mark.parametrize(("name", "limit", "in_cell"), [("foot_flat", 1.4e-3, 0.5e-3), ("foot_beam12", 1.1e-3, 0.5e-3)])
def test_default_skin_after_a_second_of_rest(name, limit, in_cell):
    """Without thresholds: polygons hold as they state, and the CoP is as near as noise and cells allow."""
    data, rng = recorded(name), np.random.default_rng(0)
    count, errors = float(data["lsb12"]), []
    for option in (False, True):
        skin, off = sole(Response((0.0, count)), in_cell=option), []
        skin.tare(np.clip(np.rint(2 * rng.normal(size=(250, 42))), 0, 4095).astype(np.uint16))
        assert np.median(skin.noise.detection_limits) < 6.1 * count * np.sqrt(4 + 1 / 12)
        filled, holds = 0, 0
        for k, frame in enumerate(frames(name, skin, "raw_u12")):
            true = convex_hull(data["true_hull"][slice(*data["true_hull_off"][k : k + 2])])
            assert all(true.margin(corner) > -1e-9 for corner in frame.polygon.guaranteed.corners)
            filled += frame.polygon.guaranteed.kind == "area"
            heavy = skin.ground.corners[data["taxel_fn"][k] > skin.noise.detection_limits].reshape(-1, 2)
            holds += all(frame.polygon.outer.margin(corner) > -1e-9 for corner in heavy)
            off.append(np.linalg.norm(frame.cop - data["cop_sole"][k]))
        assert filled > 0.92 * len(off) and holds >= len(off) - 1
        errors.append(np.mean(off))
    assert errors[0] < limit and errors[1] < in_cell


def test_wrench_is_that_of_the_simulator():
    """The three observed components are right for exact forces; the other three are reported as not observed."""
    data, skin = recorded("foot_flat"), sole(Response((0.0, 1.0)), switch_on=1e-6, switch_off=1e-6)
    assert skin.observable.tolist() == [False, False, True, True, True, False]
    wrench = np.array([skin.update(f, 1000.0 * k).wrench for k, f in enumerate(data["taxel_fn"])])
    assert_allclose(wrench[:, 2], data["wrench_sole"][:, 2], rtol=1e-6, atol=1e-4)
    lever = np.abs(wrench - data["wrench_sole"])[:, 3:5] / wrench[:, 2:3]
    assert lever.max() < 3.7e-3  # forces lumped in the cells' centres: less than a seventh of a cell
    assert (wrench[:, [0, 1, 5]] == 0).all() and np.abs(data["wrench_sole"][:, :2]).max() > 50


def forearm_patch():
    """Return the sheet of the forearm, 6 rows of 22 cells."""
    index = np.column_stack(np.divmod(np.arange(132), 22))
    return cell_patch(*layout("forearm"), name="arm", radius=0.0115, index=index)


def test_contacts_on_a_forearm():
    """The mean position errors are below 3.3, 2.7, 1.5, 0.8 and 1.4 mm for contacts of 1 to 12 mm radius."""
    data, intensity = recorded("forearm_single"), np.arange(256.0)
    patch = forearm_patch()
    response = ResponseTable(tuple(intensity), tuple(20 * (1 - np.cbrt(1 - intensity / 255))))
    skin = Skin(small_calibration(patches=(patch,), surfaces=(plane(),), response=response))
    noise = np.random.default_rng(0).normal(0, 2, (200, 132))
    skin.tare(np.clip(np.rint(data["cell_offset"] + noise), 0, 255).astype(np.uint8))
    off = []
    for k, reading in enumerate(data["raw_u8"]):
        contacts = skin.update(reading, 1000.0 * k).contacts
        if not contacts:  # no taxel carries much more than the noise
            assert (data["cell_force"][k] < 1.05 * skin.noise.detection_limits).all()
            off.append(np.nan)
            continue
        strongest = max(contacts, key=lambda c: c.force)
        off.append(np.linalg.norm(strongest.position - data["point"][k]))
    assert np.isnan(off).sum() <= 3
    for radius, limit in zip((1, 2.5, 5, 8, 12), (3.3, 2.7, 1.5, 0.8, 1.4)):
        ours = np.isclose(data["radius"], radius / 1e3)
        assert ours.sum() == 120 and np.nanmean(np.array(off)[ours]) < limit / 1e3


def test_touches_on_a_forearm_find_the_placement_of_its_sheet():
    """The 240 smallest contacts, named by their strongest cells, give no shift; a shift of 3 mm is found to 0.5 mm.

    The strongest cell of a simulated contact contains its position, so that there is no other error.
    """
    data = recorded("forearm_single")
    patch, (positions, normals, _) = forearm_patch(), layout("forearm")
    along = np.roll(positions.reshape(6, 22, 3), -1, axis=1).reshape(-1, 3) - positions
    along[21::22] = along[20::22]
    along -= (along * normals).sum(axis=1)[:, None] * normals
    tangents = along / np.linalg.norm(along, axis=1)[:, None]
    patch = replace(patch, kind="sheet", shape=(6, 22), taxels=replace(patch.taxels, tangents_link=tangents))
    small = data["radius"] < 3e-3
    rows = data["cell_force"][small].argmax(axis=1)
    touches = Touches(
        tuple(patch.taxels.ids[r] for r in rows), np.arange(240), data["point"][small], np.zeros((240, 3))
    )
    (found,) = placements(small_calibration(patches=(patch,), surfaces=(plane(),)), touches)
    assert len(found.outliers) == 0 and np.sqrt(np.mean(found.distances**2)) < 1.05 * found.expected_rms
    flat = found.flat.mean(axis=0)[None]
    assert np.linalg.norm(found.motion.at(flat)) < 0.5e-3 and abs(found.motion.turn) < np.deg2rad(0.5)
    up = 0.003 * np.array((0, 0, 1.0))
    taxels = patch.taxels
    taxels = replace(taxels, positions_link=positions + up, corners_link=taxels.corners_link + up)
    moved = replace(patch, taxels=taxels)
    (off,) = placements(small_calibration(patches=(moved,), surfaces=(plane(),)), touches)
    across = np.cross(normals, tangents)[:, 2].mean()
    (shift,) = off.motion.at(flat) - found.motion.at(flat)
    assert_allclose(shift, (0, -0.003 * across), rtol=0, atol=0.3e-3)
    assert off.motion.is_certain
