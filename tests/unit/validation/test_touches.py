"""Touches at known positions: reading, comparison with the taxels, and the motion of the skin."""

import dataclasses

import numpy as np
import pytest
from numpy.testing import assert_allclose

from skin_calib_addon.common.errors import CalibrationFormatError
from skin_calib_addon.validation import Touches, placements, read_touches, summarize
from skin_calib_addon.validation.flat import flat_places
from skin_calib_addon.validation.wiring import orders
from tests.samples import RADIUS, boards, seven_boards, sheet, small_calibration

ROWS, COLUMNS, PITCH = 6, 12, 0.01
SHEET = sheet(ROWS, COLUMNS, PITCH)
CALIBRATION = small_calibration(patches=(SHEET,))
MIDDLE = flat_places(SHEET, SHEET.taxels.index).mean(axis=0)[None]


def on_sheet(along, across, height=0.0):
    """Points above the flat `SHEET`: its rows run around the cylinder, and the next row is to their left."""
    angle = along / RADIUS
    out = np.stack((np.cos(angle), np.sin(angle), 0 * angle), axis=1)
    return (RADIUS + height) * out + np.array((0, 0, 1.0)) * (across + PITCH / 2)[:, None]


def touched(calibration, rows, points, directions=None, patch=0):
    """Return touches of some taxels of a patch."""
    ids = calibration.patches[patch].taxels.ids
    directions = np.zeros((len(rows), 3)) if directions is None else directions
    return Touches(tuple(ids[row] for row in rows), np.arange(len(rows)) + 2, points, directions)


def points_after_motion(rows, shift, turn, spread, seed=0, height=0.0):
    """Points that cells of `SHEET` would feel after a motion of the sheet, with random offsets in the cells."""
    flat, rng = flat_places(SHEET, SHEET.taxels.index[rows]), np.random.default_rng(seed)
    middle = flat.mean(axis=0)
    flat = flat + rng.uniform(-0.5, 0.5, flat.shape) * spread
    c, s = np.cos(turn), np.sin(turn)
    along, across = ((flat - middle) @ np.array(((c, s), (-s, c))) + middle + shift).T
    return on_sheet(along, across, height)


def test_motion_of_a_sheet_is_found():
    """Touches anywhere in their cells give shift and rotation; the height of the probe is separate."""
    rows = np.tile(np.arange(ROWS * COLUMNS), 5)
    points = points_after_motion(rows, (0.0012, -0.0008), 0.01, PITCH, height=5e-4)
    (found,) = placements(CALIBRATION, touched(CALIBRATION, rows, points))
    motion = found.motion
    (shift,) = motion.at(MIDDLE)
    assert_allclose(shift, (0.0012, -0.0008), rtol=0, atol=3e-4)
    assert_allclose(motion.turn, 0.01, rtol=0, atol=3 * motion.turn_error)
    assert_allclose(found.heights, 5e-4, rtol=0, atol=6e-4)  # the tangent plane differs from the cylinder
    assert motion.is_certain and list(found.warnings()) == []


def loads_at(flat):
    """Return the readings (m, n) of presses at flat positions of `SHEET` with a pad of one cell."""
    away = np.abs(flat[:, None] - flat_places(SHEET, SHEET.taxels.index)) / PITCH
    return np.maximum(1 - away, 0).prod(axis=2)


def felt_by_several(loads, points):
    """Return touches with readings."""
    ids = SHEET.taxels.ids
    names = tuple(ids[k] for k in loads.argmax(axis=1))
    return Touches(names, np.arange(len(loads)), points, 0 * points, felt=ids, readings=loads)


def test_standard_errors_cover_the_errors():
    """In 80 sets of 20 presses that several taxels feel, two of them elsewhere, with 0.5 mm of noise."""
    scores, certain = [], 0
    for seed in range(80):
        rng = np.random.default_rng(1000 + seed)
        flat = PITCH * rng.uniform(0, 1, (20, 2)) * (COLUMNS - 1, ROWS - 1)
        recorded = flat + rng.normal(0, 5e-4, flat.shape)
        recorded[:2] = PITCH * rng.uniform(0, 1, (2, 2)) * (COLUMNS - 1, ROWS - 1)
        (found,) = placements(CALIBRATION, felt_by_several(loads_at(flat), on_sheet(*recorded.T)))
        motion = found.motion
        scores.append((*(motion.shift / motion.shift_error), motion.turn / motion.turn_error))
        certain += motion.is_certain
    scores = np.abs(scores)
    assert (scores < 1).mean() == pytest.approx(0.68, abs=0.06)
    assert (scores < 2).mean() == pytest.approx(0.95, abs=0.03)
    assert certain <= 3  # one in a hundred exceeds it


def test_a_raster_in_step_with_the_cells_moves_nothing():
    """All touches are 3 and -4 mm from the centres of their cells, and felt by the right taxels."""
    rows = np.random.default_rng(0).permutation(ROWS * COLUMNS)[:40]
    flat = flat_places(SHEET, SHEET.taxels.index[rows]) + (0.003, -0.004)
    (found,) = placements(CALIBRATION, touched(CALIBRATION, rows, on_sheet(*flat.T)))
    motion = found.motion
    assert not motion.is_certain and (motion.shift_error > 1.5e-3).all()
    assert (np.abs(motion.shift) < 2 * motion.shift_error).all()
    (warning,) = found.warnings()
    assert warning.code == "raster-touches"
    assert warning.message.startswith("The touches of sheet are on a raster of 10.0 mm, at few positions")


@pytest.mark.parametrize("pitches", [1.0, 1.37, 2.0])
def test_a_raster_of_any_spacing_is_named(pitches):
    """In 20 touches with noise of the probe; random touches of the same number are none."""
    rng, step = np.random.default_rng(0), pitches * PITCH
    flat = flat_places(SHEET, SHEET.taxels.index)
    low, high = flat.min(axis=0) - PITCH / 2, flat.max(axis=0) + PITCH / 2
    grid = np.stack(np.meshgrid(*(np.arange(a + 0.2 * step, b, step) for a, b in zip(low, high))), axis=-1).reshape(
        -1, 2
    )
    places = rng.permutation(grid)[:20]
    for points, spacing in (
        (places + rng.normal(0, 5e-4, places.shape), step),
        (rng.uniform(low, high, (20, 2)), None),
    ):
        rows = np.linalg.norm(flat[:, None] - points, axis=2).argmin(axis=0)
        (found,) = placements(CALIBRATION, touched(CALIBRATION, rows, on_sheet(*points.T)))
        assert found.raster == (spacing and pytest.approx(spacing, rel=0.04))


def test_standard_errors_of_a_raster_cover_every_phase():
    """40 touches at the same position in their cells, anywhere there, with 0.5 mm of noise."""
    scores = []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        rows = rng.permutation(ROWS * COLUMNS)[:40]
        flat = flat_places(SHEET, SHEET.taxels.index[rows]) + PITCH * rng.uniform(-0.5, 0.5, 2)
        (found,) = placements(
            CALIBRATION, touched(CALIBRATION, rows, on_sheet(*(flat + rng.normal(0, 5e-4, (40, 2))).T))
        )
        scores += (np.abs(found.motion.shift) / found.motion.shift_error).tolist()
    assert np.less(scores, 2).mean() > 0.95


def test_corners_may_go_round_a_cell_in_either_direction():
    """Files of other programs have both."""
    rows = np.random.default_rng(0).integers(0, ROWS * COLUMNS, 40)
    touches = touched(CALIBRATION, rows, points_after_motion(rows, (0.002, 0.001), 0.0, PITCH))
    taxels = dataclasses.replace(SHEET.taxels, corners_link=SHEET.taxels.corners_link[:, ::-1])
    other = small_calibration(patches=(dataclasses.replace(SHEET, taxels=taxels),))
    (one,), (same,) = placements(CALIBRATION, touches), placements(other, touches)
    assert_allclose(same.motion.shift, one.motion.shift, rtol=0, atol=1e-9)


def test_readings_of_several_taxels_give_more_than_the_strongest():
    """With them the same presses have standard errors of less than half."""
    rng = np.random.default_rng(2)
    flat = PITCH * rng.uniform(0, 1, (40, 2)) * (COLUMNS - 1, ROWS - 1)
    points, loads = on_sheet(*(flat + (0.001, -0.0005)).T), loads_at(flat)
    (exact,) = placements(CALIBRATION, felt_by_several(loads, points))
    (coarse,) = placements(CALIBRATION, touched(CALIBRATION, loads.argmax(axis=1), points))
    assert (exact.motion.shift_error < coarse.motion.shift_error / 2).all()
    assert_allclose(exact.motion.at(MIDDLE)[0], (0.001, -0.0005), rtol=0, atol=2e-4)


def test_touches_in_two_cells_do_not_determine_the_rotation():
    """The rotation is left out, and its standard error is infinite."""
    rows = np.array([0, 1] * 6)
    points = points_after_motion(rows, 0.0, 0.0, PITCH)
    (found,) = placements(CALIBRATION, touched(CALIBRATION, rows, points))
    assert found.motion.turn == 0 and found.motion.turn_error == np.inf
    assert np.isfinite(found.motion.shift_error).all() and not found.motion.is_certain
    assert_allclose(found.motion.sigma_at(found.motion.middle[None])[0], found.motion.shift_error)  # not NaN


def test_left_handed_sheet_has_the_same_sign_of_rotation():
    """The rotation keeps its sign if the next row is to the right of a row."""
    mirrored = dataclasses.replace(
        SHEET, taxels=dataclasses.replace(SHEET.taxels, index=SHEET.taxels.index * (-1, 1) + (ROWS - 1, 0))
    )
    rows = np.tile(np.arange(ROWS * COLUMNS), 5)
    calibration = small_calibration(patches=(mirrored,))
    (found,) = placements(calibration, touched(calibration, rows, points_after_motion(rows, 0.0, 0.03, PITCH)))
    assert_allclose(found.motion.turn, 0.03, rtol=0, atol=0.006)


def test_motion_of_boards_is_found_on_their_lattice():
    """Hexagons have their own flat positions and sides."""
    patch = seven_boards()
    calibration = small_calibration(patches=(patch,))
    rng = np.random.default_rng(0)
    rows = rng.integers(0, 7, 300)
    arm = rng.uniform(-0.0115, 0.0115, (300, 2))  # inside every hexagon
    places = patch.taxels.positions_link[rows] - patch.taxels.positions_link[0] + np.column_stack((arm, 0 * rows))
    points = places + patch.taxels.positions_link[0] + (0.002, 0.001, 0)
    points += 0.05 * np.stack((-places[:, 1], places[:, 0], 0 * rows), axis=1)
    (found,) = placements(calibration, touched(calibration, rows, points))
    assert_allclose(found.motion.at(np.zeros((1, 2)))[0], (0.002, 0.001), rtol=0, atol=1e-3)
    assert_allclose(found.motion.turn, 0.05, rtol=0, atol=3 * found.motion.turn_error)
    assert found.motion.turn_error < 0.03 and found.wiring.order.words == ""


def wrenches_at(points, forces):
    """Return a table of wrenches about the origin."""
    table = [("channel", "fx", "fy", "fz", "tx", "ty", "tz")]
    return table, [(*force, *np.cross(point, force)) for force, point in zip(forces, points)]


def test_lines_of_action_are_met_on_the_skin(tmp_path):
    """A force-torque sensor gives a line; a line nearly parallel to the skin gives no position, but a warning."""
    rows = np.tile(np.arange(0, ROWS * COLUMNS, 5), 6)
    points = points_after_motion(rows, (0.001, 0.0005), 0.0, 0.8 * PITCH)
    taxels = SHEET.taxels
    forces = -4 * taxels.normals_link[rows] + np.random.default_rng(0).normal(0, 1, (len(rows), 3))
    forces[3] = 4 * taxels.tangents_link[rows[3]]
    header, wrenches = wrenches_at(points, forces)
    found = read(tmp_path, header + [(row, *wrench) for row, wrench in zip(rows, wrenches)])
    assert_allclose(np.linalg.norm(found.directions, axis=1), 1, rtol=1e-12)
    (placement,) = placements(CALIBRATION, found)
    assert len(placement.rows) == len(found.lines) - 1 and placement.grazing.tolist() == [5]
    assert np.isnan(placement.offsets[:, 2]).all() and len(placement.heights) == 0
    assert_allclose(placement.motion.at(MIDDLE)[0], (0.001, 0.0005), rtol=0, atol=7e-4)
    (warning,) = placement.warnings()
    assert warning.code == "grazing-touch"
    assert warning.message == "Touches of sheet with a force nearly parallel to the skin are left out: line 5."


def test_a_wrong_channel_is_named_and_counts_little():
    """Two swapped taxels are named, each with the taxel at its position; the motion changes little."""
    rows = np.arange(ROWS * COLUMNS)
    swapped = rows.copy()
    swapped[[7, 40]] = 40, 7
    points = points_after_motion(rows, (0.001, 0.0), 0.0, PITCH, seed=3)
    (fine,) = placements(CALIBRATION, touched(CALIBRATION, rows, points))
    (found,) = placements(CALIBRATION, touched(CALIBRATION, swapped, points))
    assert found.outliers.tolist() == [7, 40] and fine.outliers.tolist() == []
    (warning,) = found.warnings()
    text = warning.message
    assert warning.code == "wrong-taxel" and warning.where.taxels == ("s3.4", "s0.7")
    assert text.startswith("Some touches of sheet are far from the taxel that felt them: line 9, s3.4, ")
    assert "(s0.7 is there); line 42, s0.7, " in text and "(s3.4 is there)" in text
    assert np.abs(found.motion.at(MIDDLE) - fine.motion.at(MIDDLE)).max() < 2.5e-4


def by_columns(i, j):
    return i * 0 + (j * ROWS + i)


@pytest.mark.parametrize(
    ("number", "words"),
    [
        (lambda i, j: (ROWS - 1 - i) * COLUMNS + j, "rows counted from the other end"),
        (lambda i, j: i * COLUMNS + COLUMNS - 1 - j, "columns counted from the other end"),
        (lambda i, j: (ROWS - 1 - i) * COLUMNS + COLUMNS - 1 - j, "rows and columns counted from the other end"),
        (by_columns, "column by column"),
        (lambda i, j: by_columns(ROWS - 1 - i, j), "column by column, rows counted from the other end"),
        (lambda i, j: i * COLUMNS + np.where(i % 2, COLUMNS - 1 - j, j), "every second row backwards"),
        (lambda i, j: i * COLUMNS + (j + 1) % COLUMNS, "columns off by one, each too high"),
        (lambda i, j: i * COLUMNS + (j + COLUMNS // 2) % COLUMNS, "halves of the rows swapped"),
    ],
)
def test_another_order_of_the_channels_is_named(number, words):
    """The most common mistake: the electronics count in another order than the plan. The sheet may be moved, too."""
    i, j = SHEET.taxels.index.T
    cells = np.random.default_rng(1).integers(0, len(i), 40)
    for shift, turn in (((0.0, 0.0), 0.0), ((0.004, 0.003), 0.04)):
        points = points_after_motion(cells, shift, turn, PITCH)
        (found,) = placements(CALIBRATION, touched(CALIBRATION, number(i[cells], j[cells]), points))
        warning = next(found.warnings())
        assert warning.code == "channel-order"
        assert (
            warning.message
            == f"The touches of sheet fit another order of its channels: {words} (odds above 1000 to 1)."
        )
        assert not any("shifted" in line for line in summarize(found)) and found.wiring.odds > 5


@pytest.mark.parametrize(
    ("by", "words"),
    [
        (1, "off by one, as if counted from 1"),
        (-1, "off by one, each too low"),
        (COLUMNS, "off by one row, each too high"),
        (-COLUMNS, "off by one row, each too low"),
    ],
)
@pytest.mark.parametrize("kind", ["points", "wrenches"])
def test_shifted_channels_are_no_shifted_skin(by, words, kind):
    """Touches at the ends of the rows are far from their taxels after any displacement, but not in the right order."""
    rows = np.arange(ROWS * COLUMNS)
    rows = rows[(rows + by >= 0) & (rows + by < ROWS * COLUMNS)]
    points = points_after_motion(rows, (0.002, 0.0), 0.0, 0.8 * PITCH)
    directions = -SHEET.taxels.normals_link[rows] if kind == "wrenches" else None
    (found,) = placements(CALIBRATION, touched(CALIBRATION, rows + by, points, directions))
    names = [order.words for order in (found.wiring.order, *found.wiring.rivals)]
    assert words in names
    if abs(by) == 1:
        assert found.wiring.order.words == words and found.wiring.is_certain
    else:  # a displacement of a row explains all touches as well
        assert "" in names and not found.wiring.is_certain
        warning = next(found.warnings())
        assert warning.message.startswith("The touches of sheet fit several orders of its channels: ")


def test_shifted_channels_are_wired_round():
    """On a skin of few taxels this decides between channels and columns that are off by one."""
    found = {order.words: order.rows for order in orders(SHEET, np.array([0, 71]))}
    assert found["off by one, as if counted from 1"].tolist() == [71, 70]
    assert found["off by one, each too low"].tolist() == [1, 0]


def test_one_touch_gives_no_large_odds():
    """It can be one that was recorded elsewhere: whether two columns are exchanged, if only one of them was touched."""
    j = SHEET.taxels.index[:, 1]
    others = np.flatnonzero((j < 2) | (j > 3))
    for extra, limits in ((np.flatnonzero(j == 2)[:1], (3, 5)), (np.flatnonzero(j == 2), (5, np.inf))):
        rows = np.concatenate((others, extra))
        points = points_after_motion(rows, (0.002, 0.0), 0.0, 0.8 * PITCH)
        (found,) = placements(CALIBRATION, touched(CALIBRATION, rows, points))
        assert found.wiring.order.words == "" and found.wiring.is_certain
        assert limits[0] < found.wiring.odds <= limits[1]


def test_order_of_wrenches_depends_on_the_side_that_they_push():
    """The line of a press goes through both sides of the link."""
    i, j = SHEET.taxels.index.T
    rows = np.arange(ROWS * COLUMNS)
    points = points_after_motion(rows, 0.0, 0.0, 0.5 * PITCH)
    wrong = i * COLUMNS + COLUMNS - 1 - j
    (found,) = placements(CALIBRATION, touched(CALIBRATION, wrong, points, -SHEET.taxels.normals_link))
    assert found.wiring.order.words == "columns counted from the other end" and found.wiring.is_certain


def test_columns_of_a_sheet_that_closes_round_a_limb_are_ambiguous():
    """Halves that are swapped, and a skin that is turned by half, are one to the touches."""
    whole = sheet(2, 22, PITCH)
    i, j = whole.taxels.index.T
    (found,) = placements(
        calibration := small_calibration(patches=(whole,)),
        touched(calibration, i * 22 + (j + 11) % 22, whole.taxels.positions_link + 1e-3 * whole.taxels.tangents_link),
    )
    assert found.wiring.order.words == "halves of the rows swapped" and not found.wiring.is_certain
    assert "a skin that is 110 mm further round the limb" in next(found.warnings()).message
    assert found.wiring.candidates[0] == "halves of the rows swapped"


def test_two_boards_in_another_order_are_named():
    """Hexagons have a chain that can be turned or reversed, and boards that can be exchanged."""
    patch = seven_boards()
    calibration = small_calibration(patches=(patch,))
    rows = np.arange(7).repeat(2)
    points = patch.taxels.positions_link[rows] + np.tile(((0.004, 0, 0), (-0.004, 0.003, 0)), (7, 1))
    for wrong, words in (
        (np.array([0, 2, 1, 3, 4, 5, 6]), "b1.0 and b0.1 exchanged"),
        (np.arange(6, -1, -1), "boards counted from the other end"),
        (np.array([0, 6, 1, 2, 3, 4, 5]), "boards turned by 60 degrees about board (0, 0)"),
    ):
        (found,) = placements(calibration, touched(calibration, wrong[rows], points))
        assert found.wiring.order.words == words and found.wiring.is_certain


@pytest.mark.parametrize("wrong", [1, 20])
def test_wrong_wires_are_no_other_order(wrong):
    """One wrong wire, and channels at random, fit no order: nothing is stated about it."""
    for seed in range(10):
        rng = np.random.default_rng(seed)
        rows = rng.integers(0, ROWS * COLUMNS, 20)
        points = points_after_motion(rows, (0.002, 0.001), 0.02, PITCH, seed)
        rows[:wrong] = rng.integers(0, ROWS * COLUMNS, wrong)
        (found,) = placements(CALIBRATION, touched(CALIBRATION, rows, points))
        codes = {warning.code for warning in found.warnings()}
        if wrong == 1:
            assert found.is_explained and "channel-order" not in codes
        else:
            assert not found.is_explained and "unexplained-touches" in codes


def test_displacement_of_imported_taxels_is_in_the_link_frame():
    """They have no rows: 4 mm along x and 3 mm along z are stated, and no displacement is not significant."""
    imported = small_calibration(patches=(dataclasses.replace(SHEET, kind="imported"),))
    rows = np.arange(ROWS * COLUMNS)
    points = points_after_motion(rows, 0.0, 0.0, PITCH)
    for moved, ending in (((0.004, 0, 0.003), "in the link frame"), ((0, 0, 0), ": not significant")):
        (found,) = placements(imported, touched(imported, rows, points + moved))
        (line,) = (line for line in summarize(found) if line.startswith("displaced by ("))
        numbers = [float(x) for x in line[14:].split(")")[0].split(", ")]
        assert_allclose(numbers, np.array(moved) * 1e3, rtol=0, atol=1.5)
        assert line.endswith(ending) and " +- 0." in line


def test_few_touches_give_no_motion():
    """Three touches are too few, and imported taxels have no flat shape."""
    (few,) = placements(
        CALIBRATION, touched(CALIBRATION, [0, 5, 9], points_after_motion(np.array([0, 5, 9]), 0.0, 0.0, 0.0))
    )
    assert few.motion is None and (few.residuals == few.distances).all()
    imported = small_calibration(patches=(dataclasses.replace(SHEET, kind="imported"),))
    rows = np.arange(20)
    (found,) = placements(imported, touched(imported, rows, points_after_motion(rows, 0.0, 0.0, PITCH)))
    assert found.motion is None


def test_touches_of_another_frame_are_a_warning():
    """Touches centimetres below the skin, and only lines parallel to the skin, give warnings and no motion."""
    rows = np.arange(0, ROWS * COLUMNS, 2)
    (found,) = placements(
        CALIBRATION, touched(CALIBRATION, rows, points_after_motion(rows, 0.0, 0.0, 0.8 * PITCH, height=-0.012))
    )
    warning = next(warning for warning in found.warnings() if warning.code == "touch-height")
    assert warning.message == "The touches of sheet are 12.0 mm below its taxels."
    along = SHEET.taxels.tangents_link[rows]
    (none,) = placements(CALIBRATION, touched(CALIBRATION, rows, points_after_motion(rows, 0.0, 0.0, 0.0), along))
    assert len(none.rows) == len(none.outliers) == 0 and none.motion is None
    (warning,) = none.warnings()
    assert warning.code == "grazing-touch" and warning.value == 36
    assert warning.message.endswith("are left out: line 2; line 3; line 4; line 5; line 6; and 31 more.")


def test_touches_belong_to_their_patches():
    """Each patch has its own touches; an untouched patch is left out."""
    calibration = small_calibration(patches=(SHEET, boards(first_channel=ROWS * COLUMNS)))
    points = np.array([[0.03, 0.05, -0.1], [0.03, 0.051, -0.1]])
    (found,) = placements(calibration, touched(calibration, [0, 0], points, patch=1))
    assert found.patch.name == "boards" and found.lines.tolist() == [2, 3]
    assert_allclose(found.offsets, ((0, 0, 0), (0, 0.001, 0)), rtol=0, atol=1e-15)


def read(folder, table, ending="\n"):
    """Write and read a table."""
    path = folder / "t.csv"
    path.write_text(ending.join(",".join(map(str, row)) for row in table) + ending)
    return read_touches(path, CALIBRATION)


def test_tables_are_read_by_their_names(tmp_path):
    """Columns have any order and case, with other columns and comments, by id or channel."""
    found = read(tmp_path, [("# robot 3",), ("note", "Z", "x", "Y", "Taxel"), ("a", 0.3, 0.1, 0.2, "s1.2")])
    assert found.taxels == ("s1.2",) and found.lines.tolist() == [3]
    assert found.points.tolist() == [[0.1, 0.2, 0.3]] and not found.directions.any()
    assert found.unused == ("note",)
    assert read(tmp_path, [("channel", "x", "y", "z"), (14, 0, 0, 0)]).taxels == ("s1.2",)


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ([("id", "x", "y", "z")], 'line 1, column 5: the header names no column "taxel"'),
        (
            [("taxel", "x", "y", "z"), ("s1.22", 0, 0, 0)],
            'line 2, column 1: the calibration has no taxel "s1.22"',
        ),
        ([("channel", "x", "y", "z"), (72, 0, 0, 0)], 'has no channel "72"; its channels are 0 to 71'),
        ([("taxel", "x", "y", "z"), ("s1.2", 0, "nan", 0)], "line 2, column 3: "),
        ([("taxel", "x", "y", "z"), ("s1.2", 0, 31.5, 0)], 'for millimetres name the column "y [mm]"'),
        ([("taxel", "x", "y", "z"), ("s1.2", 0, '"0,1"', 0)], "instead of a number; write decimals with a point"),
        ([("taxel", "s0.0", "x", "y", "z", "s0.0")], 'column 6: the header names the column "s0.0" twice'),
        ([("taxel", "link", "x", "y", "z", "link")], 'column 6: the header names the column "link" twice'),
        ([("# Link: other",), ("taxel", "x", "y", "z")], 'the touches are of the link "other"'),
        (
            [("taxel", "fx", "fy", "fz", "tx", "ty", "tz"), ("s1.2", 0, -8000, 0, 0, 0, 0)],
            "column 3: the force -8000 N is more than 2000 N. Forces are in newtons",
        ),
        ([("taxel", "fx", "fy", "fz", "tx", "ty")], 'the header names no column "tz"'),
        (
            [("taxel", "fx", "fy", "fz", "tx", "ty", "tz"), ("s1.2", 0, 0, 0.01, 0, 0, 0)],
            "column 2: the force of 0.01 N gives no reliable line of action",
        ),
    ],
)
def test_error_of_a_table_is_one_line(tmp_path, table, message):
    with pytest.raises(CalibrationFormatError) as caught:
        read(tmp_path, table)
    assert message in str(caught.value) and "t.csv" in str(caught.value)
