"""Touches at known positions: reading, comparison with the taxels, and the motion of the skin."""

import dataclasses

import numpy as np
import pytest
from numpy.testing import assert_allclose

from skin_calib_addon.common.errors import CalibrationFormatError
from skin_calib_addon.validation import Touches, placements, read_touches, summarize
from skin_calib_addon.validation.placement import flat_places
from tests.samples import RADIUS, boards, seven_boards, sheet, small_calibration

ROWS, COLUMNS, PITCH = 6, 12, 0.01
SHEET = sheet(ROWS, COLUMNS, PITCH)
CALIBRATION = small_calibration(patches=(SHEET,))


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
    """Exact touches give shift and rotation; the height of the probe is separate."""
    rows = np.arange(ROWS * COLUMNS)
    (found,) = placements(
        CALIBRATION, touched(CALIBRATION, rows, points_after_motion(rows, (0.0012, -0.0008), 0.01, 0.0, height=5e-4))
    )
    motion = found.motion
    assert_allclose(motion.shift, (0.0012, -0.0008), rtol=0, atol=3e-5)  # the tangent plane differs from the cylinder
    assert_allclose(motion.turn, 0.01, rtol=0, atol=2e-4)
    assert_allclose(found.heights, 5e-4, rtol=0, atol=1e-4)
    assert motion.is_certain and list(found.warnings()) == []
    assert found.residuals.max() < 5e-5 < 9e-4 < found.distances.min()


@pytest.mark.parametrize(("count", "wrong"), [(10, 0), (40, 2)])
def test_standard_errors_cover_the_errors(count, wrong):
    """In 200 random sets 68 +- 5 % of the errors are within one standard error and 95 +- 3 % within two.

    Touches are anywhere in their cells; ``wrong`` of them have another channel.
    """
    ratios, certain = [], 0
    for seed in range(200):
        rng = np.random.default_rng(1000 + seed)
        rows = rng.integers(0, ROWS * COLUMNS, count)
        points = points_after_motion(rows, 0.0, 0.0, PITCH, seed)
        rows[:wrong] = rng.integers(0, ROWS * COLUMNS, wrong)
        (found,) = placements(CALIBRATION, touched(CALIBRATION, rows, points))
        motion = found.motion
        ratios.append((*(motion.shift / motion.shift_error), motion.turn / motion.turn_error))
        certain += motion.is_certain
        assert_allclose(found.expected_rms, PITCH / np.sqrt(6), rtol=1e-12)
    ratios = np.abs(ratios)
    assert (ratios < 1).mean() == pytest.approx(0.68, abs=0.05)
    assert (ratios < 2).mean() == pytest.approx(0.95, abs=0.03)
    assert certain < 0.2 * 200  # each of three has one in twenty


def test_left_handed_sheet_has_the_same_sign_of_rotation():
    """The rotation keeps its sign if the next row is to the right of a row."""
    mirrored = dataclasses.replace(
        SHEET, taxels=dataclasses.replace(SHEET.taxels, index=SHEET.taxels.index * (-1, 1) + (ROWS - 1, 0))
    )
    rows = np.arange(ROWS * COLUMNS)
    calibration = small_calibration(patches=(mirrored,))
    (found,) = placements(calibration, touched(calibration, rows, points_after_motion(rows, 0.0, 0.02, 0.0)))
    assert_allclose(found.motion.turn, 0.02, rtol=0, atol=5e-4)


def test_motion_of_boards_is_found_on_their_lattice():
    """Hexagons have their own flat positions."""
    patch = seven_boards()
    calibration = small_calibration(patches=(patch,))
    arm = patch.taxels.positions_link - patch.taxels.positions_link[0]
    points = (
        patch.taxels.positions_link + (0.002, 0.001, 0) + 0.05 * np.stack((-arm[:, 1], arm[:, 0], 0 * arm[:, 0]), 1)
    )
    (found,) = placements(calibration, touched(calibration, np.arange(7), points))
    assert_allclose((*found.motion.shift, found.motion.turn), (0.002, 0.001, 0.05), rtol=0, atol=1e-12)


def test_lines_of_action_are_met_in_the_tangent_plane(tmp_path):
    """A force-torque sensor gives a line; a line nearly parallel to the skin gives no position, but a warning."""
    rows = np.arange(0, ROWS * COLUMNS, 5)
    points = points_after_motion(rows, (0.001, 0.0005), 0.0, 0.0)
    taxels = SHEET.taxels
    forces = -4 * taxels.normals_link[rows] + 1.5 * taxels.tangents_link[rows]
    forces[3] = 4 * taxels.tangents_link[rows[3]]
    table = [("channel", "fx", "fy", "fz", "tx", "ty", "tz")]
    table += [(row, *force, *np.cross(point, force)) for row, force, point in zip(rows, forces, points)]
    found = read(tmp_path, table)
    assert_allclose(np.linalg.norm(found.directions, axis=1), 1, rtol=1e-12)
    (placement,) = placements(CALIBRATION, found)
    assert len(placement.rows) == len(rows) - 1 and placement.grazing.tolist() == [5]
    assert np.isnan(placement.offsets[:, 2]).all() and len(placement.heights) == 0
    assert_allclose(placement.motion.shift, (0.001, 0.0005), rtol=0, atol=3e-5)
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
    assert np.abs(found.motion.shift - fine.motion.shift).max() < 2.5e-4


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
        (lambda i, j: i * COLUMNS + (j + 1) % COLUMNS, "columns off by one"),
        (lambda i, j: i * COLUMNS + (j + COLUMNS // 2) % COLUMNS, "halves of the rows swapped"),
    ],
)
def test_another_order_of_the_channels_is_named(number, words):
    """The most common mistake: the electronics count in another order than the plan. The sheet may be moved, too."""
    i, j = SHEET.taxels.index.T
    cells = np.random.default_rng(1).integers(0, len(i), 40)
    for shift, turn in (((0.0, 0.0), 0.0), ((0.006, 0.004), 0.04)):
        points = points_after_motion(cells, shift, turn, PITCH)
        (found,) = placements(CALIBRATION, touched(CALIBRATION, number(i[cells], j[cells]), points))
        (warning,) = found.warnings()
        assert warning.code == "channel-order"
        assert warning.message == f"The touches of sheet fit another order of its channels: {words}."
        assert not any("shifted" in line for line in summarize(found))


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
    points = points_after_motion(rows, (0.003, 0.0), 0.0, 0.3 * PITCH)
    directions = -SHEET.taxels.normals_link[rows] if kind == "wrenches" else None
    (found,) = placements(CALIBRATION, touched(CALIBRATION, rows + by, points, directions))
    if abs(by) == 1:
        assert found.other_order == (words, True)
    else:  # a displacement of a row explains all touches as well
        assert found.other_order == (words, False)
        (warning,) = found.warnings()
        assert warning.message == f"The displacement of sheet may be another order of its channels: {words}."


def test_order_of_wrenches_depends_on_the_side_that_they_push():
    """The line of a press goes through both sides of the link."""
    i, j = SHEET.taxels.index.T
    rows = np.arange(ROWS * COLUMNS)
    points = points_after_motion(rows, 0.0, 0.0, 0.0)
    wrong = i * COLUMNS + COLUMNS - 1 - j
    (found,) = placements(CALIBRATION, touched(CALIBRATION, wrong, points, -SHEET.taxels.normals_link))
    assert found.other_order == ("columns counted from the other end", True)


@pytest.mark.parametrize("wrong", [1, 20])
def test_wrong_wires_are_no_other_order(wrong):
    """One wrong wire, and channels at random, fit no order: nothing is stated about it."""
    for seed in range(20):
        rng = np.random.default_rng(seed)
        rows = rng.integers(0, ROWS * COLUMNS, 20)
        points = points_after_motion(rows, (0.002, 0.001), 0.02, PITCH, seed)
        rows[:wrong] = rng.integers(0, ROWS * COLUMNS, wrong)
        (found,) = placements(CALIBRATION, touched(CALIBRATION, rows, points))
        assert found.other_order == ("", False)


def test_few_touches_give_no_motion():
    """Three touches are too few; many in one cell give no rotation; imported taxels have no flat shape."""
    (few,) = placements(
        CALIBRATION, touched(CALIBRATION, [0, 5, 9], points_after_motion(np.array([0, 5, 9]), 0.0, 0.0, 0.0))
    )
    assert few.motion is None and (few.residuals == few.distances).all()
    rows = np.full(6, 14)
    (one,) = placements(CALIBRATION, touched(CALIBRATION, rows, points_after_motion(rows, 0.0, 0.0, PITCH)))
    assert one.motion.turn == 0 and one.motion.turn_error == np.inf
    imported = small_calibration(patches=(dataclasses.replace(SHEET, kind="imported"),))
    rows = np.arange(20)
    (found,) = placements(imported, touched(imported, rows, points_after_motion(rows, 0.0, 0.0, PITCH)))
    assert found.motion is None


def test_touches_of_another_frame_are_a_warning():
    """Touches centimetres below the skin, and only lines parallel to the skin, give warnings and no motion."""
    rows = np.arange(20)
    (found,) = placements(
        CALIBRATION, touched(CALIBRATION, rows, points_after_motion(rows, 0.0, 0.0, 0.0, height=-0.012))
    )
    (warning,) = found.warnings()
    assert warning.message == "The touches of sheet are 12.0 mm below its taxels." and warning.code == "touch-height"
    along = SHEET.taxels.tangents_link[rows]
    (none,) = placements(CALIBRATION, touched(CALIBRATION, rows, points_after_motion(rows, 0.0, 0.0, 0.0), along))
    assert len(none.rows) == len(none.outliers) == 0 and none.motion is None
    (warning,) = none.warnings()
    assert warning.code == "grazing-touch" and warning.value == 20
    assert warning.message.endswith("are left out: line 2; line 3; line 4; line 5; line 6; and 15 more.")


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
        ([("taxel", "x", "y", "z"), ("s1.2", 0, 31.5, 0)], "divide millimetres by 1000"),
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
