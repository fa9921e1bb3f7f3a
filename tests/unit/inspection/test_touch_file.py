"""Touches from MCAP files: the same as from a table; files that have none are one line."""

import struct

import numpy as np
import pytest
from numpy.testing import assert_allclose

from skin_calib_addon.calibration import save_calibration
from skin_calib_addon.calibration.file import to_document
from skin_calib_addon.cli import main
from skin_calib_addon.common.errors import CalibrationFormatError
from skin_calib_addon.inspection.replaying import Replay
from skin_calib_addon.inspection.touch_file import read_touch_file
from skin_calib_addon.messages import encode, reading_message, schema_text
from tests.samples import sheet, small_calibration

pytest.importorskip("mcap", reason="mcap is not installed: pip install 'skin-calib[live]'")
SHEET = sheet(2, 3, 0.01)
CALIBRATION = small_calibration(patches=(SHEET,))
LINK, START = CALIBRATION.link, 1.7e9
# As in the packages of ROS 2: names of the same package have no prefix.
TEXTS = {
    "WrenchStamped": "# a wrench\nstd_msgs/Header header\nWrench wrench\n",
    "PointStamped": "std_msgs/Header header\nPoint point\n",
}


def no_mesh():
    """Return no mesh: no tool needs one here."""
    raise AssertionError


def stamped(frame, time, numbers):
    """Return a message with a header and doubles as bytes."""
    seconds = int(time)
    data = struct.pack("<iII", seconds, round((time - seconds) * 1e9), len(frame) + 1) + frame.encode() + b"\0"
    data += bytes(-len(data) % 8) + np.array(numbers, "<f8").tobytes()
    return b"\0\1\0\0" + data


def write(path, readings, probes, kind="WrenchStamped", calibration=""):
    """Write readings, pairs of time and row, and what was measured, each with its frame."""
    from mcap.writer import Writer

    with open(path, "wb") as stream:
        writer = Writer(stream)
        writer.start("ros2", "test")
        ours = writer.register_schema("skin_calib_msgs/msg/SkinReading", "ros2msg", schema_text("SkinReading").encode())
        theirs = writer.register_schema(f"geometry_msgs/msg/{kind}", "ros2msg", TEXTS[kind].encode())
        channel, other = (writer.register_channel(f"/{schema}", "cdr", schema) for schema in (ours, theirs))
        for k, (time, row) in enumerate(readings):
            writer.add_message(
                channel, k, encode("SkinReading", reading_message(LINK, row, time, k, calibration=calibration)), k
            )
        for k, (frame, time, numbers) in enumerate(probes):
            writer.add_message(other, k, stamped(frame, time, numbers), k)
        writer.finish()
    return path


def session(count=3, rate=100):
    """Return times, and wrenches and readings of presses at taxels 0, 1, 2, with a second of rest before them."""
    times = START + np.arange(int((1.2 + count) * rate)) / rate
    number = np.floor(times - START - 1.2).astype(int)
    is_on = (number >= 0) & ((times - START - 1.2) % 1 < 0.5)
    force = np.array((0, 0, -5.0))
    wrenches = np.array([np.append(force, np.cross(SHEET.taxels.positions_link[max(k, 0)], force)) for k in number])
    readings = np.where(np.arange(6) == number[:, None], 200, 3)
    return times, wrenches * is_on[:, None], np.where(is_on[:, None], readings, 3)


@pytest.mark.parametrize("kind", ["WrenchStamped", "PointStamped"])
def test_file_gives_the_touches_of_a_table(kind, tmp_path):
    """Wrenches at other times and rates are interpolated; those of another frame are not of this link."""
    times, wrenches, readings = session()
    stamps = np.arange(times[0] - 0.004, times[-1] + 0.01, 0.004)
    at = np.stack([np.interp(stamps, times, column) for column in wrenches.T], axis=1)
    if kind == "PointStamped":
        at = np.tile(SHEET.taxels.positions_link[4], (len(stamps), 1))
    probes = [(LINK, t, row) for t, row in zip(stamps, at)] + [("hand", stamps[0], at[0] + 1)]
    path = write(tmp_path / "t.mcap", zip(times, readings), probes, kind)
    found = read_touch_file(path, CALIBRATION, no_mesh)
    ids = [f"{SHEET.taxels.ids[k]},{','.join(map(str, row))}" for k, row in enumerate(wrenches[[130, 230, 330]])]
    assert found.taxels == SHEET.taxels.ids[:3] and len(found.sha256) == 64 and found.rows == len(times)
    assert found.felt == SHEET.taxels.ids and found.readings.argmax(axis=1).tolist() == [0, 1, 2]
    if kind == "PointStamped":
        assert_allclose(found.points, np.tile(SHEET.taxels.positions_link[4], (3, 1)), atol=1e-12)
        return
    (tmp_path / "t.csv").write_text("\n".join(["taxel,fx,fy,fz,tx,ty,tz", *ids]) + "\n")
    table = read_touch_file(tmp_path / "t.csv", CALIBRATION, no_mesh)
    assert table.taxels == found.taxels
    assert_allclose(found.wrenches, table.wrenches, atol=1e-9)


def test_readings_in_a_gap_have_no_wrench(tmp_path):
    """A sensor that stops for a press gives the two others."""
    times, wrenches, readings = session()
    probes = [(LINK, t, row) for t, row in zip(times, wrenches) if not 2.1 < t - START < 2.9]
    path = write(tmp_path / "t.mcap", zip(times, readings), probes)
    found = read_touch_file(path, CALIBRATION, no_mesh)
    assert found.taxels == (SHEET.taxels.ids[0], SHEET.taxels.ids[2])
    assert found.notes == (
        f"{len(times) - found.rows} readings of {len(times)} without a wrench within 0.1 s, left out",
    )


def test_the_command_states_what_it_leaves_out(tmp_path, capsys):
    """Readings without a wrench; readings that are missing in the file."""
    times, wrenches, readings = session(count=6)
    probes = [(LINK, t, row) for t, row in zip(times, wrenches) if t - START < 5]
    path = write(tmp_path / "t.mcap", zip(times, readings), probes)
    save_calibration(CALIBRATION, tmp_path / "c.json")
    assert main(["touches", str(tmp_path / "c.json"), str(path)]) == 0
    assert "readings of 720 without a wrench within 0.1 s, left out" in capsys.readouterr().err


def test_recording_of_another_calibration_is_named(tmp_path):
    """Its channels can be in another order; a recording of this calibration, or of none, has no note."""
    times, wrenches, readings = session()
    probes = [(LINK, t, row) for t, row in zip(times, wrenches)]
    for checksum, count in ((to_document(CALIBRATION)["checksum"], 0), ("", 0), ("0123456789abcdef", 1)):
        path = write(tmp_path / "t.mcap", zip(times, readings), probes, calibration=checksum)
        notes = read_touch_file(path, CALIBRATION, no_mesh).notes
        assert Replay.read(CALIBRATION, path).notes == notes
        assert len(notes) == count and all("recorded with another calibration (0123456789ab...)" in n for n in notes)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            lambda t, w, r: (zip(t, r), []),
            'has no geometry_msgs/msg/WrenchStamped or .* in the frame of "forearm". Record',
        ),
        (lambda t, w, r: (zip(t, r), [("ft", t[0], w[0])]), 'in the frame of "forearm", only in that of "ft"'),
        (lambda t, w, r: (zip(t, r[:, :4]), [(LINK, t[0], w[0])]), "has a reading of 4 channels, .* has the channel 5"),
        (lambda t, w, r: (zip(t[::-1], r), [(LINK, t[0], w[0])]), "the time of the readings goes back after 0.000 s"),
        (lambda t, w, r: (zip(t, r), [(LINK, x, w[0]) for x in (9, 8)]), "the time of the wrenches goes back"),
        (lambda t, w, r: (zip(t, r), [(LINK, 9.0, w[0])]), "has no wrench within 0.1 s of a reading. Check the clocks"),
    ],
)
def test_file_without_touches_is_one_line(change, message, tmp_path):
    """With what is missing, and where."""
    path = write(tmp_path / "t.mcap", *change(*session()))
    with pytest.raises(CalibrationFormatError, match=message) as found:
        read_touch_file(path, CALIBRATION, no_mesh)
    assert "\n" not in str(found.value)
