"""Recordings of touches: all rows of a press are one touch; units and links; invalid sessions are one line."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from skin_calib_addon.common.errors import CalibrationFormatError
from skin_calib_addon.validation import read_touches
from tests.samples import sheet, small_calibration

SHEET = sheet(2, 3, 0.01)
CALIBRATION = small_calibration(patches=(SHEET,))
IDS = SHEET.taxels.ids


def read(folder, header, rows, comment=""):
    """Write and read a table."""
    path = folder / "t.csv"
    lines = [comment] * bool(comment) + [",".join(header), *(",".join(map(str, row)) for row in rows)]
    path.write_text("\n".join(lines) + "\n")
    return read_touches(path, CALIBRATION)


def test_rows_with_one_number_are_one_press(tmp_path):
    """Its taxel is the most frequent one, its point the median; rows without a number are between presses."""
    rows = [
        ("s0.0", 0.1, 0, 0, 7),
        ("s0.1", 0.2, 0, 0, 7),
        ("s0.1", 0.9, 0, 0, 7),
        ("s1.1", 5, 5, 5, ""),
        ("s0.2", 1, 2, 3, 3),
    ]
    found = read(tmp_path, ("taxel", "x", "y", "z", "press"), rows)
    assert found.taxels == ("s0.1", "s0.2") and found.lines.tolist() == [2, 6] and found.rows == 5
    assert found.points.tolist() == [[0.2, 0, 0], [1, 2, 3]]


@pytest.mark.parametrize(
    ("numbers", "message"),
    [
        ((0, 1, "", 1, 0), "line 6: press 0 has rows above, before those of other presses. Give each press its own"),
        ((0, 1.5), "line 3: the number of the press is 1.5, which is no integer"),
        ((0, 1e300), "line 3: the number of the press is 1e+300, which is no integer"),
    ],
)
def test_numbers_of_presses_are_checked(tmp_path, numbers, message):
    """Two sessions one after the other would have the medians of two touches."""
    with pytest.raises(CalibrationFormatError, match=message.replace("+", r"\+")):
        read(tmp_path, ("taxel", "x", "y", "z", "press"), [("s0.0", 0, 0, 0, number) for number in numbers])


def test_successive_rows_at_one_place_are_one_press(tmp_path):
    """A noisy row does not end a press; another taxel, and another place in the same cell, do."""
    rng = np.random.default_rng(0)
    places = [("s0.0", 0.0)] * 50 + [("s0.0", 0.004)] * 50 + [("s0.1", 0.004)] * 50
    points = [x + rng.normal(0, 3e-4, 3) for _, x in places]
    points[20] = points[20] + 0.003
    found = read(tmp_path, ("taxel", "x", "y", "z"), [(name, *p) for (name, _), p in zip(places, points)])
    assert found.taxels == ("s0.0", "s0.0", "s0.1") and found.lines.tolist() == [2, 52, 102]
    wrenches = [(name, 0, 0, 5, 0, -5 * x, 0) for name, x in places]
    again = read(tmp_path, ("taxel", "fx", "fy", "fz", "tx", "ty", "tz"), wrenches)
    assert again.taxels == found.taxels and again.lines.tolist() == found.lines.tolist()


def session(count=4, rate=100):
    """Return times, the force factor of each row, and the number of its press: rest, presses of .5 s, pauses."""
    shape = np.concatenate((np.zeros(rate // 2), np.linspace(0, 1, 20), np.ones(rate // 2), np.linspace(1, 0, 20)))
    factor = np.concatenate((np.zeros(rate + 20), np.tile(shape, count), np.zeros(rate // 2)))
    number = np.concatenate((np.full(rate + 20, -1), np.repeat(np.arange(count), len(shape)), np.full(rate // 2, -1)))
    return np.arange(len(factor)) / rate, factor, number


def test_presses_are_found_from_the_force_over_time(tmp_path):
    """The tare removes the offset of the sensor; a touch is the median of the plateau; bumps are no presses."""
    time, factor, number = session()
    rng = np.random.default_rng(0)
    forces = factor[:, None] * (0.0, 0.0, -6.0) + (1.0, -2.0, 3.0) + rng.normal(0, 0.05, (len(time), 3))
    forces[130:134] += 4.0  # 40 ms
    taxels = [IDS[max(k, 0)] for k in number.tolist()]
    rows = [(t, name, *f, 0.01, 0, 0) for t, name, f in zip(time, taxels, forces)]
    found = read(tmp_path, ("time", "taxel", "fx", "fy", "fz", "tx", "ty", "tz"), rows)
    assert found.taxels == IDS[:4] and found.rows == len(time)
    assert_allclose(found.wrenches[:, :3], [(0, 0, -6)] * 4, atol=0.05)
    assert 0.003 < found.force_noise < 0.03


def test_presses_with_short_pauses_are_several(tmp_path):
    """The low pass leaves a dip. Presses without a pause are one, which moves; so is one that slides."""
    shape = np.concatenate((np.linspace(0.1, 1, 8), np.ones(40), np.linspace(1, 0.1, 8)))
    rng, force = np.random.default_rng(0), (0.0, 0.0, -6.0)

    def found(parts, places):
        factor = np.concatenate((np.zeros(120), *parts, np.zeros(50)))
        at = np.concatenate((np.zeros(120), *places, np.zeros(50)))
        forces = factor[:, None] * force + rng.normal(0, 0.02, (len(at), 3))
        rows = [(k / 100, IDS[0], *f, 0, 6 * x * z, 0) for k, (f, x, z) in enumerate(zip(forces, at, factor))]
        return read(tmp_path, ("time", "taxel", "fx", "fy", "fz", "tx", "ty", "tz"), rows)

    count, x = len(shape), np.full(len(shape), 0.01)
    three = found((shape, np.zeros(10), 0.6 * shape, np.zeros(10), shape), (x, np.zeros(10), 2 * x, np.zeros(10), x))
    assert_allclose(three.wrenches[:, 2], (-6, -3.6, -6), atol=0.1)
    assert three.notes == ()
    one = found((shape[:-8], shape[8:]), (x[:-8], 2 * x[8:]))
    assert len(one.taxels) == 1
    assert one.notes[0].startswith("the point of touch moves by up to 10 mm in 1 of 1 presses, the first from line 1")
    slides = found((shape,), (np.linspace(0, 0.02, count),))
    assert slides.notes and found((shape,), (x,)).notes == ()


def test_presses_are_found_from_the_sum_of_the_readings(tmp_path):
    """The rest of each taxel is removed, and the strongest one of a press is its taxel."""
    time, factor, number = session()
    loads = np.eye(6)[np.maximum(number, 0)] * 30 * factor[:, None] + (50, 0, 0, 0, 0, 0)
    rows = [(t, *load, 0.01 * k, 0, 0) for t, load, k in zip(time * 1e3, loads, number)]
    found = read(tmp_path, ("Time (ms)", *IDS, "x", "y", "z"), rows)
    assert found.taxels == IDS[:4] and found.felt == IDS
    assert_allclose(found.readings[:, :4], 30 * np.eye(4), atol=1e-9)
    assert_allclose(found.points[:, 0], 0.01 * np.arange(4), atol=1e-12)


def test_units_and_the_link_are_in_the_header(tmp_path):
    """Units are in brackets, the link in a comment or in a column."""
    header = ("taxel", "x [mm]", "y (cm)", "z", "fx [N]", "fy", "fz", "tx [N mm]", "ty", "tz", "link")
    found = read(tmp_path, header, [("s0.0", 10, 2, 0.03, 1, 2, 3, 40, 5, 6, "forearm")], "# link: forearm")
    assert_allclose(found.points, [(0.01, 0.02, 0.03)]) and not found.directions.any()
    assert_allclose(found.wrenches, [(1, 2, 3, 0.04, 5, 6)])


TIMES = [(0.1 * k, "s0.0", 0, 0, 0) for k in range(20)]
WRENCH = ("fx", "fy", "fz", "tx", "ty", "tz")


@pytest.mark.parametrize(
    ("header", "rows", "comment", "message"),
    [
        (("taxel", "x [inch]", "y", "z"), [], "", 'line 1, column 2: the unit "inch" is not known here; use one of m'),
        (("taxel", "x", "y"), [("s0.0", 0, 0)], "", 'the header names no column "z"'),
        ((*IDS[:4], "x", "y", "z"), [], "", "the header has some taxels of sheet, but not s1.1, s1.2"),
        (("taxel", "x", "y", "z"), [("s0.0", 0, 0, 0)], "# link: thigh", 'line 1: the touches are of the link "thigh"'),
        (("taxel", "x", "y", "z", "link"), [("s0.0", 0, 0, 0, "forearm"), ("s0.0", 0, 0, 0, "thigh")], "",
         'line 3, column 5: the touches are of the link "thigh", the calibration of "forearm"'),
        (("time", "taxel", "x", "y", "z"), [*TIMES, TIMES[3]], "", "line 22, column 1: the time 0.3 s is before 1.9 s"),
        (("time", "taxel", *WRENCH), [(*row[:2], *[1] * 6) for row in TIMES], "", "no press was found"),
        (("time", "taxel", *WRENCH), [(k, "s0.0", *[1] * 6) for k in range(20)], "", "have 1 rows, which are too few"),
        (("taxel", "x", "y", "z", "press"), [("s0.0", 0, 0, 0, "")], "", "no row has a number in the column"),
        (("taxel", "x", "y", "z"), [(IDS[k % 2], 0, 0, 0) for k in range(5001)], "", "has 5001 touches, more"),
    ],
)  # fmt: skip
def test_error_of_a_session_is_one_line(tmp_path, header, rows, comment, message):
    with pytest.raises(CalibrationFormatError) as caught:
        read(tmp_path, header, rows, comment)
    assert message in str(caught.value) and "\n" not in str(caught.value)


def test_a_press_in_half_of_the_first_second_is_refused(tmp_path):
    """The median of that second would be a force of the press, and the presses that differ from it would be touches."""
    ramp = np.linspace(0, 1, 10)
    shape = np.concatenate((ramp, np.ones(50), ramp[::-1], np.zeros(40)))
    factor = np.concatenate((np.zeros(50), *(force * shape for force in (3.0, 4.0, 5.0, 6.0, 3.5))))
    noise = np.random.default_rng(0).normal(0, 0.05, (len(factor), 3))
    rows = [(k / 100, IDS[0], *f, 0.01, 0, 0) for k, f in enumerate(noise - factor[:, None] * (0.0, 0.0, 1.0))]
    with pytest.raises(CalibrationFormatError, match="the skin is pressed in the first second"):
        read(tmp_path, ("time", "taxel", "fx", "fy", "fz", "tx", "ty", "tz"), rows)


def test_a_force_that_never_is_that_of_the_first_second_is_named(tmp_path):
    """Something pressed in all of it: the difference to its force is that of a press without an end."""
    time, factor, number = session()
    header = ("time", "taxel", "fx", "fy", "fz", "tx", "ty", "tz")
    for first, count in ((0.0, 0), (6.0, 1)):
        forces = factor[:, None] * (0.0, 0.0, -6.0) + np.where(time < 1.05, first, 0.0)[:, None] * (1, 0, 0)
        rows = [(t, IDS[max(k, 0)], *f, 0.01, 0, 0) for t, f, k in zip(time, forces, number)]
        notes = read(tmp_path, header, rows).notes
        assert len(notes) == count and all("that of the first 1 s in 0% of the later rows" in note for note in notes)


@pytest.mark.parametrize("force", [30, 100, 300])
@pytest.mark.parametrize("is_numbered", [False, True])
def test_a_press_in_all_of_the_first_second_is_refused(is_numbered, force, tmp_path):
    """Its force does not change, so that it is taken for the rest; then these readings fall, while others rise."""
    time, factor, number = session()
    loads = 50 + np.eye(6)[np.maximum(number, 0)] * 100 * factor[:, None] + 0.0
    loads[:105, 5] += force
    rows = [(t, *load, 0.01 * k, 0, 0, k if k >= 0 else "") for t, load, k in zip(time, loads, number)]
    header = ("time", *IDS, "x", "y", "z", "press")
    if not is_numbered:
        header, rows = header[:-1], [row[:-1] for row in rows]
    with pytest.raises(CalibrationFormatError, match="line 2: .* of the rows .* the skin was pressed at rest. Record"):
        read(tmp_path, header, rows)


def test_lost_readings_do_not_turn_the_sign(tmp_path):
    """A row of zeros is farther from the rest than any press; readings still rise with force."""
    time, factor, number = session()
    loads = 300 + np.eye(6)[np.maximum(number, 0)] * 100 * factor[:, None]
    loads[170] = 0
    rows = [(t, *load, 0.01 * k, 0, 0) for t, load, k in zip(time, loads, number)]
    found = read(tmp_path, ("time", *IDS, "x", "y", "z"), rows)
    assert found.recording.sign == 1 and found.taxels == IDS[:4]
