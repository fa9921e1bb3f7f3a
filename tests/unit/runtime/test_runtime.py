"""From readings to contacts, as a controller calls it in each cycle."""

import dataclasses
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from skin_calib_addon.calibration import Patch, Response, save_calibration
from skin_calib_addon.common.errors import CalibrationFormatError, InvalidReading
from skin_calib_addon.common.warnings import Place, Warning
from skin_calib_addon.runtime import Skin, load
from skin_calib_addon.runtime.components import components
from skin_calib_addon.runtime.geometry import neighbour_table
from skin_calib_addon.skin import SheetLattice, sheet_taxels, wrap_sheet
from tests.oracles import components as flood_fill
from tests.samples import boards, cylinder, small_calibration
from tests.shapes import cone_surface

ROWS, COLUMNS = 4, 22
RADIUS = COLUMNS * 0.01 / (2 * np.pi)
ROUND = sheet_taxels(
    wrap_sheet(cone_surface(RADIUS, RADIUS), SheetLattice(ROWS, COLUMNS, (0.01, 0.01)), None, (0, 1, 0)), "round"
)


def skin_of(*patches, newtons=(0.0, 1.0), **switches):
    """Return a skin of these patches with a polynomial response in newtons; a force above 0.2 N is a contact."""
    switches = {"switch_on": 0.2, "switch_off": 0.1} | switches
    return Skin(small_calibration(patches=patches, surfaces=(cylinder(),), response=Response(newtons)), **switches)


def closed_skin(**options):
    """Return a sheet that closes around a cylinder."""
    return skin_of(Patch("round", "sheet", "tube", (ROWS, COLUMNS), (0.01, 0.01), ROUND), **options)


def pressed(cells, force=1.0, length=ROWS * COLUMNS):
    """Return a reading in which some cells of the closed sheet are pressed."""
    reading = np.zeros(length)
    for i, j in cells:
        reading[i * COLUMNS + j] = force
    return reading


readings = st.lists(st.one_of(st.just(0.0), st.floats(0, 50)), min_size=8, max_size=8)
small = small_calibration(response=Response((0.0, 1.0)))  # 6 cells of a sheet, 2 boards


def test_nothing_pressed_is_no_contact():
    """A foot in the air gives no contacts, a zero wrench, no flag and no error."""
    frame = closed_skin().update(np.zeros(88), 1.5)
    assert frame.contacts == () and (frame.wrench == 0).all() and frame.flags == frozenset() and frame.time == 1.5
    assert (frame.forces == 0).all()


def test_contacts_are_connected_over_the_seam():
    """The last and the first cell of a row that closes around the link are neighbours: one contact, not two."""
    seam = closed_skin().update(pressed([(2, 0), (2, COLUMNS - 1)]), 0.0)
    assert [set(c.ids) for c in seam.contacts] == [{"round.2.0", f"round.2.{COLUMNS - 1}"}]
    apart = closed_skin().update(pressed([(2, 0), (2, COLUMNS - 2)]), 0.0)
    assert len(apart.contacts) == 2
    ring = closed_skin().update(pressed([(0, j) for j in range(COLUMNS)]), 0.0)
    assert len(ring.contacts) == 1 and np.linalg.norm(ring.wrench) < 1e-4  # 22 N cancel as far as the cells are even


@given(active=st.lists(st.booleans(), min_size=1, max_size=40), seed=st.integers(0, 2**32 - 1), density=st.floats(0, 3))
def test_components_are_those_of_a_flood_fill(active, seed, density):
    """For random graphs every active taxel is in one group, and rows are in ascending order."""
    n, rng = len(active), np.random.default_rng(seed)
    pairs = np.sort(rng.integers(0, n, (int(density * n), 2)), axis=1)
    neighbours = [{*pairs[pairs[:, 0] == i, 1].tolist(), *pairs[pairs[:, 1] == i, 0].tolist()} for i in range(n)]
    rows, scratch = np.flatnonzero(active), np.full(n + 1, -1)
    groups = components(rows, neighbour_table(np.unique(pairs[pairs[:, 0] < pairs[:, 1]], axis=0), n), scratch)
    found = [frozenset(rows[groups == k].tolist()) for k in range(groups.max(initial=-1) + 1)]
    assert set(found) == flood_fill(active, neighbours) and len(found) == len(set(found))
    assert [min(group) for group in found] == sorted(min(group) for group in found)
    assert (scratch == -1).all()


def test_components_of_a_long_chain_are_one():
    """A thousand taxels in a row, in random order, are one component."""
    order = np.random.default_rng(0).permutation(1000)
    pairs = np.sort(np.column_stack((order[:-1], order[1:])), axis=1)
    assert not components(np.arange(1000), neighbour_table(pairs, 1000), np.full(1001, -1)).any()


@given(reading=readings)
def test_wrench_is_the_sum_over_the_taxels(reading):
    """The frame has the sum of force and moment about the origin of the link; so have its contacts together."""
    skin = Skin(small)
    frame = skin.update(reading, 0.0)
    expected = np.zeros(6)
    for p, n, channel in zip(skin.positions, skin.normals, skin.channels):
        if reading[channel] >= skin.switch_on:
            push = -reading[channel] * n
            expected += np.concatenate((push, np.cross(p, push)))
    assert_allclose(frame.wrench, expected, rtol=1e-12, atol=1e-12)
    assert_allclose(sum((c.wrench for c in frame.contacts), np.zeros(6)), frame.wrench, rtol=1e-12, atol=1e-12)
    rows = [i for c in frame.contacts for i in c.taxels.tolist()]
    assert sorted(rows) == [i for i, c in enumerate(skin.channels) if reading[c] >= skin.switch_on]


@given(reading=readings)
def test_contact_is_the_sum_of_its_taxels(reading):
    """Force, area, peak pressure and unit normal are right.

    The position is over the weighted mean, along the normal.
    """
    skin = Skin(small)
    for contact in skin.update(reading, 0.0).contacts:
        pressed = np.array([reading[c] for c in skin.channels[contact.taxels]])
        assert (contact.forces == pressed).all()
        assert_allclose(contact.force, pressed.sum(), rtol=1e-12)
        assert_allclose(contact.area, skin.areas[contact.taxels].sum(), rtol=1e-12)
        assert_allclose(contact.peak_pressure, (pressed / skin.areas[contact.taxels]).max(), rtol=1e-12)
        assert_allclose(np.linalg.norm(contact.normal), 1, rtol=1e-12)
        mean = np.average(skin.positions[contact.taxels], axis=0, weights=pressed)
        assert_allclose(np.cross(contact.position - mean, contact.normal), 0, atol=1e-15)
        assert (contact.position - mean) @ contact.normal >= -1e-15


@given(weights=st.lists(st.floats(0.5, 20), min_size=5, max_size=5), first=st.integers(0, COLUMNS - 1))
def test_contact_on_a_round_link_lies_on_its_surface(weights, first):
    """The mean of five of 22 taxels is 0.9 mm below the surface; the position of the contact is on it."""
    reading = pressed([])
    reading[[COLUMNS + (first + k) % COLUMNS for k in range(5)]] = weights
    (contact,) = closed_skin().update(reading, 0.0).contacts
    ring = np.hypot(*ROUND.positions_link[:, :2].T)
    assert_allclose(np.hypot(*contact.position[:2]), ring.mean(), atol=1e-5)


def test_contact_all_round_a_link_has_no_normal():
    """If the normals cancel, the normal is zero and the position is the mean of the taxels."""
    skin = skin_of(boards(), newtons=(0.0, 1.0))
    taxels = dataclasses.replace(boards().taxels, normals_link=np.array([[0, 0, 1.0], [0, 0, -1.0]]))
    skin = skin_of(dataclasses.replace(boards(), taxels=taxels))
    (contact,) = skin.update([2.0, 2.0], 0.0).contacts
    assert (contact.normal == 0).all()
    assert_allclose(contact.position, skin.positions.mean(axis=0))


def test_contact_has_its_cells_and_the_message_of_the_paper():
    """The cells are rows and columns, over the seam too; the message has their mean, weighted by force."""
    (contact,) = closed_skin().update(pressed([(1, 4), (1, 5), (2, 5)], 2.0), 0.0).contacts
    assert contact.cells == {0: ((1, 2), (4, 5))}
    (message,) = contact.messages
    assert message.patch == 0 and message.force == 6.0
    assert_allclose((message.row, message.column), (4 / 3, 14 / 3))
    reading = pressed([(0, COLUMNS - 1)], 3.0) + pressed([(0, 0)], 1.0)
    (contact,) = closed_skin().update(reading, 0.0).contacts
    assert contact.cells == {0: ((0, 0), (COLUMNS - 1, 0))}
    assert_allclose(contact.messages[0].column, COLUMNS - 0.75)
    (contact,) = closed_skin().update(reading + pressed([(0, 1)], 3.0), 0.0).contacts
    assert contact.cells == {0: ((0, 0), (COLUMNS - 1, 1))}
    reading = pressed([(0, COLUMNS - 1)]) + pressed([(0, 0)]) + pressed([(0, 1)], 6.0)
    (contact,) = closed_skin().update(reading, 0.0).contacts
    assert_allclose(contact.messages[0].column, 5 / 8)  # beyond the seam columns start again at 0


def test_peak_pressure_is_that_of_one_cell():
    """The largest pressure may be on a small cell with less force than a large one."""
    patch = boards()
    taxels = dataclasses.replace(patch.taxels, areas=np.array([1e-4, 1e-3]))
    (contact,) = skin_of(dataclasses.replace(patch, taxels=taxels)).update([2.0, 5.0], 0.0).contacts
    assert_allclose((contact.peak_pressure, contact.area, contact.force), (2e4, 1.1e-3, 7.0), rtol=1e-12)


@pytest.mark.parametrize("dtype", ["u1", "i1", "u2", "i4", "u8", "f2", "f4", "f8"])
def test_readings_of_any_type_do_not_overflow(dtype):
    """Maximum values of each type give the same newtons as the same numbers in double precision."""
    skin = closed_skin(newtons=(0.5, 0.002, 1e-7))
    top = min(60000, np.finfo(dtype).max if dtype[0] == "f" else np.iinfo(dtype).max)
    reading = np.full(88, top, dtype)
    top = float(reading[0])
    expected = 0.5 + 0.002 * top + 1e-7 * top * top
    assert_allclose(skin.forces(reading), expected, rtol=1e-12)
    assert_allclose(skin.update(reading, 0).contacts[0].force, 88 * expected, rtol=1e-12)


def test_forces_follow_the_response_and_never_pull():
    """The force is the polynomial of the reading; a negative force becomes zero."""
    skin = skin_of(boards(), newtons=(-1.0, 0.5, 0.1))
    assert skin.forces([0.0, 4.0]).tolist() == [0.0, pytest.approx(-1 + 2 + 1.6)]


def test_channels_are_positions_in_the_reading():
    """Channels can be in any order, with gaps, and the reading can be longer."""
    patch = boards()
    taxels = dataclasses.replace(patch.taxels, channels=np.array([9, 2]))
    skin = skin_of(dataclasses.replace(patch, taxels=taxels))
    reading = np.zeros(20)
    reading[9], reading[2] = 3.0, 5.0
    assert skin.reading_length == 10 and skin.forces(reading).tolist() == [3.0, 5.0]


@pytest.mark.parametrize(
    ("reading", "message"),
    [
        (np.zeros(87), "the reading has 87 channels, the skin of forearm needs 88"),
        (np.zeros((1, 88)), r"a reading must be one row of real numbers; this one is float64 of shape \(1, 88\)"),
        (np.zeros(88, complex), "a reading must be one row of real numbers; this one is complex128"),
        (["a"] * 88, "a reading must be one row of real numbers"),
        (None, "a reading must be one row of real numbers"),
        ([[1, 2], [3]], "a reading must be one row of real numbers; this one has rows of different lengths"),
    ],
)
def test_wrong_reading_is_flagged_and_changes_nothing(reading, message):
    """``update`` raises no error: its frame states the problem and knows nothing. ``forces`` raises an error."""
    skin = closed_skin()
    skin.update(pressed([(0, 0)], 1.0), 0)
    frame = skin.update(reading, 0.1)
    assert re.match(message, frame.problem) and frame.flags == {"wrong_length" if "87" in message else "wrong_type"}
    assert frame.touched is None and frame.contacts == () and np.isnan(frame.wrench).all()
    assert frame.cop is None and frame.reason == frame.problem and frame.polygon.outer.kind == "empty"
    with pytest.raises(InvalidReading, match=message):
        skin.forces(reading)
    assert len(skin.update(pressed([(0, 0)], 0.15), 0.2).contacts) == 1


def test_wrong_time_is_refused_and_changes_nothing():
    """A time that is not a number raises an error, and the state of the skin does not change."""
    skin = closed_skin()
    skin.update(pressed([(0, 0)], 1.0), 0)
    with pytest.raises(ValueError, match="could not convert"):
        skin.update(np.zeros(88), "now")
    assert len(skin.update(pressed([(0, 0)], 0.15), 0.2).contacts) == 1


@pytest.mark.parametrize(("on", "off"), [(0.1, 0.2), (0.1, 0.0), (0.1, -1.0), (np.nan, 0.1), (0.1, np.nan)])
def test_invalid_switches_are_refused(on, off):
    """The lower force must be positive, because a contact needs a force, and at most equal to the upper one."""
    with pytest.raises(ValueError, match="switch_off .* must be positive and at most switch_on"):
        closed_skin(switch_on=on, switch_off=off)


def test_skin_has_the_warnings_of_its_calibration(tmp_path):
    """With code, severity, message, position, value and advice; none of a file of version 1."""
    place = Place((0.0, 0.01, 0.08), "u-plane 3", "sheet", ("s0.0",))
    warnings = (
        Warning("off-mesh", "warning", "The surface is 6.2 mm off.", place, 6.2e-3, "Move the planes."),
        Warning("dropped-curves", "warning", "Sections have up to 2 curves more."),
    )
    calibration = dataclasses.replace(small, warnings=warnings)
    save_calibration(calibration, tmp_path / "c.json")
    assert load(tmp_path / "c.json").warnings == Skin(calibration).warnings == warnings
    assert Skin(small).warnings == ()
    assert load(Path(__file__).parents[2] / "golden" / "versions" / "1.calibration.json").warnings == ()


def test_load_reads_what_was_saved(tmp_path):
    """The skin of a file equals that of its calibration; an invalid file raises an error with all findings."""
    path = tmp_path / "c.json"
    save_calibration(small, path)
    skin, direct = load(path, switch_on=0.5), Skin(small)
    assert skin.ids == direct.ids and skin.switch_on == 0.5 and skin.link == "forearm"
    for name in ("channels", "positions", "normals", "areas", "pairs"):
        assert (getattr(skin, name) == getattr(direct, name)).all()
    path.write_text("{}")
    with pytest.raises(CalibrationFormatError) as caught:
        load(path)
    assert caught.value.findings
