"""MCAP files: independent readers get every frame, and replaying them gives the frames of the original recording."""

import io
import json
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from skin_calib_addon.calibration import Modality, Response, ResponseTable, load_calibration, save_calibration
from skin_calib_addon.cli import main
from skin_calib_addon.messages import decode, encode, frame_message, reading_message, schema_text
from skin_calib_addon.messages.mcap_file import McapSkin, topic_of
from skin_calib_addon.runtime import load
from tests.samples import plane, small_calibration
from tests.soles import sole_patch
from tests.unit.messages.test_messages import assert_same

mcap = pytest.importorskip("mcap", reason="mcap is not installed: pip install 'skin-calib[live]'")
N = 42
NEAR = Modality("proximity", "m", ResponseTable((0.0, 4000.0), (0.2, 0.0)))
REST = ["--tare", "50", "--accept"]


@pytest.fixture(scope="module")
def calibration(tmp_path_factory):
    """Write the calibration of a sole with proximity; return its path."""
    path = tmp_path_factory.mktemp("mcap") / "sole.calibration.json"
    fields = {"link": "left-sole", "patches": (sole_patch(),), "surfaces": (plane(),), "modalities": (NEAR,)}
    save_calibration(small_calibration(**fields, response=Response((0.0, 0.2), (0.0, 4095.0))), path)
    return path


@pytest.fixture(scope="module")
def recorded(calibration):
    """Write a recording of counts with proximity, and what ``replay`` makes of it; return both paths."""
    rng, time = np.random.default_rng(2), 1.7e9 + 0.004 * np.arange(120)
    rows = np.rint(np.maximum(rng.normal(20, 2, (120, N)), 0)).astype(np.uint16)
    for k in range(60, 120):
        rows[k, (k - 60) // 4 : (k - 60) // 4 + 9] += 200
    time[100:] += 0.01  # some are missing
    time[110] = time[109]
    npz, out = calibration.with_name("r.npz"), calibration.with_name("r.mcap")
    np.savez(npz, time=time, readings=rows, proximity=rng.uniform(0, 4000, (120, N)))
    assert main(["replay", str(calibration), str(npz), *REST, "--to", "mcap", "-o", str(out)]) == 0
    return npz, out


def frames_of(calibration, npz):
    """Return skin and frames of a recording."""
    skin = load(calibration)
    with np.load(npz) as file:
        time, rows, near = file["time"], file["readings"], file["proximity"]
    skin.tare(rows[:50], accept=True)
    return skin, rows, near, [
        skin.update({"force": row, "proximity": other}, t) for t, row, other in zip(time, rows, near)
    ]  # fmt: skip


def test_mcap_ros2_support_reads_every_frame(calibration, recorded):
    """Layout, readings and frames, with times and numbers, to the last digit."""
    reader = pytest.importorskip("mcap_ros2.reader", reason="mcap-ros2-support is not installed")
    skin, rows, near, frames = frames_of(calibration, recorded[0])
    found = {}
    for message in reader.read_ros2_messages(str(recorded[1]), log_time_order=False):
        found.setdefault(message.channel.topic, []).append(message.ros_msg)
    assert set(found) == {f"/skin/left_sole/{name}" for name in ("layout", "reading", "frame", "cells", "scene")}
    assert found["/skin/left_sole/layout"][0].ids == list(skin.ids)
    of_force = [m for m in found["/skin/left_sole/reading"] if m.quantity == "force"]
    of_near = [m for m in found["/skin/left_sole/reading"] if m.quantity == "proximity"]
    for k, frame in enumerate(frames):
        assert_same(frame_message("left-sole", frame, k, 0, skin.checksum), found["/skin/left_sole/frame"][k])
        assert_array_equal(of_force[k].counts, rows[k])
        assert_array_equal(of_near[k].values, near[k])
    assert len(found["/skin/left_sole/frame"]) == len(of_force) == len(of_near) == 120


def test_rosbags_reads_every_frame(calibration, recorded):
    """From the definitions in the file; the quality of service of each topic is complete."""
    highlevel = pytest.importorskip("rosbags.highlevel", reason="rosbags is not installed: pip install rosbags")
    skin, _, _, frames = frames_of(calibration, recorded[0])
    with highlevel.AnyReader([recorded[1]]) as bag:
        qos = {c.topic.rpartition("/")[2]: c.ext.offered_qos_profiles[0] for c in bag.connections}
        assert {name: (q.depth, q.reliability.name, q.durability.name) for name, q in qos.items()} == {
            "layout": (1, "RELIABLE", "TRANSIENT_LOCAL"),
            "reading": (10, "RELIABLE", "VOLATILE"),
            "frame": (10, "RELIABLE", "VOLATILE"),
            "cells": (1, "RELIABLE", "TRANSIENT_LOCAL"),
            "scene": (10, "RELIABLE", "VOLATILE"),
        }
        chosen = [c for c in bag.connections if c.topic.endswith("/frame")]
        found = [bag.deserialize(data, c.msgtype) for c, _, data in bag.messages(chosen)]
    assert len(found) == 120
    by_cycle = {message.cycle: message for message in found}
    for k, frame in enumerate(frames):
        assert_same(frame_message("left-sole", frame, k, 0, skin.checksum), by_cycle[k])


def test_file_has_the_calibration(calibration, recorded, tmp_path):
    """As an attachment that is a calibration file with the checksum of the messages."""
    from mcap.reader import make_reader

    with open(recorded[1], "rb") as stream:
        (attachment,) = make_reader(stream).iter_attachments()
    assert attachment.name == "left-sole.calibration.json" and attachment.media_type == "application/json"
    (tmp_path / "again.json").write_bytes(attachment.data)
    assert attachment.data == calibration.read_bytes()
    assert load(tmp_path / "again.json").checksum == load(calibration).checksum


def test_replay_of_the_file_gives_the_same_frames(calibration, recorded, tmp_path, capsys):
    """Lines, files and noise are the same as those of the original recording, byte by byte."""
    npz, file = map(str, recorded)
    a, b, c = (str(tmp_path / name) for name in ("a.jsonl", "b.jsonl", "c.mcap"))
    assert main(["replay", str(calibration), npz, *REST, "-o", a]) == 0
    said = capsys.readouterr()
    assert main(["replay", str(calibration), file, *REST, "-o", b]) == 0
    again = capsys.readouterr()
    assert Path(a).read_bytes() == Path(b).read_bytes() and said.err == again.err
    assert "columns          messages of the link left-sole; numbers of a message are channels from 0 on" in again.out
    assert (
        "modalities" in json.loads(Path(b).read_text().splitlines()[0])
        and "dropped" in again.err
        and "time_still" in again.err
    )
    assert main(["replay", str(calibration), file, *REST, "--to", "mcap", "-o", c]) == 0
    assert Path(c).read_bytes() == Path(file).read_bytes()
    for readings, noise in ((npz, a), (file, b)):
        assert main(["tare", str(calibration), readings, "--rest", "0.2", "--accept", "-o", noise]) == 0
    assert Path(a).read_bytes() == Path(b).read_bytes()


def write(path, messages, encoding="cdr", text=None):
    """Write messages ``SkinReading`` as another program would."""
    from mcap.writer import Writer

    with open(path, "wb") as stream:
        writer = Writer(stream)
        writer.start("ros2", "test")
        text = schema_text("SkinReading") if text is None else text
        schema = writer.register_schema("skin_calib_msgs/msg/SkinReading", "ros2msg", text.encode())
        channel = writer.register_channel("/a", encoding, schema)
        for k, message in enumerate(messages):
            writer.add_message(channel, k, message if isinstance(message, bytes) else encode("SkinReading", message), k)
        writer.finish()
    return str(path)


def test_lost_readings_and_restarts_are_stated(calibration, tmp_path, capsys):
    """By the cycle numbers; the cycles stay in a file that is written from it. Another calibration is named."""
    cycles = [5, 6, 9, 10, 2, 3, 5]
    row, other = np.zeros(N, np.uint16), "ab" * 32
    file = write(tmp_path / "r.mcap", [reading_message("left-sole", row, k, c, 0, other) for k, c in enumerate(cycles)])
    assert main(["replay", str(calibration), file, "--to", "mcap", "-o", str(tmp_path / "o.mcap")]) == 0
    err = capsys.readouterr().err
    assert "warning: 3 readings missing in the file, by the cycle numbers" in err
    assert "warning: the cycle numbers begin again 1 time: the sender restarted" in err
    assert "warning: recorded with another calibration (abababababab...). Check that" in err
    assert "warning: the recording has no readings of proximity" in err
    assert main(["tare", str(calibration), str(tmp_path / "o.mcap")]) == 0
    err = capsys.readouterr().err
    assert "3 readings missing" in err and "another calibration" not in err


def test_interrupted_file_is_read_up_to_its_end(calibration, recorded, tmp_path, capsys):
    """A recorder that was killed leaves complete records; the cut is stated. Without a reading it is an error."""
    from mcap.writer import Writer

    stream = io.BytesIO()
    writer = Writer(stream, use_chunking=False)
    writer.start("ros2", "test")
    schema = writer.register_schema("skin_calib_msgs/msg/SkinReading", "ros2msg", schema_text("SkinReading").encode())
    channel = writer.register_channel("/a", "cdr", schema)
    ends = []
    for k in range(30):
        writer.add_message(channel, k, encode("SkinReading", reading_message("left-sole", np.zeros(N), k / 100, k)), k)
        ends.append(len(stream.getvalue()))
    path = tmp_path / "cut.mcap"
    path.write_bytes(stream.getvalue()[: ends[20] + 11])
    assert main(["replay", str(calibration), str(path)]) == 0
    said = capsys.readouterr()
    assert "frames           21, 0.200 s" in said.out
    assert "warning: the file ends early, after 21 readings: its recorder was interrupted, or it is damaged" in said.err
    path.write_bytes(recorded[1].read_bytes()[:5000])
    assert main(["replay", str(calibration), str(path)]) == 1
    assert 'cut.mcap\' ends early, before the first reading of "left-sole"' in capsys.readouterr().err


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda p: write(p, []), 'has no readings of "left-sole", and none of another link'),
        (
            lambda p: write(p, [reading_message("hand", np.zeros(3), 0.0, 0)]),
            'has no readings of "left-sole", only of "hand". Record',
        ),
        (lambda p: write(p, [b""], "json"), r'topic "/a": the encodings are "json" and "ros2msg", not cdr and ros2msg'),
        (
            lambda p: write(p, [b""], text="float32[] values\n"),
            "has another definition of skin_calib_msgs",
        ),
        (lambda p: write(p, [b"\0\1\0\0\1\0\0\0"]), "r.mcap': a SkinReading is damaged or truncated"),
        (lambda p: p.write_bytes(b"no file" * 9), "cannot read '.*r.mcap': not a valid MCAP file"),
        (lambda p: p.mkdir(), "it is a folder. Name a file"),
        (lambda p: None, "Check the path"),
    ],
)
def test_files_without_readings_are_refused(change, message, calibration, tmp_path):
    """One line that says what is wrong, and where."""
    from skin_calib_addon.common.errors import CalibrationFormatError
    from skin_calib_addon.inspection.recording import read_recording

    change(tmp_path / "r.mcap")
    with pytest.raises(CalibrationFormatError, match=message):
        read_recording(tmp_path / "r.mcap", load(calibration))


@pytest.mark.parametrize("place", range(12))
def test_damaged_file_is_one_error_or_the_same_readings(place, calibration, recorded, tmp_path):
    """Wrong bytes anywhere: never another reading."""
    from skin_calib_addon.common.errors import CalibrationFormatError
    from skin_calib_addon.inspection.recording import read_recording

    skin = load(calibration)
    expected = [row.tolist() for _, row in read_recording(recorded[1], skin).frames]
    data = bytearray(recorded[1].read_bytes())
    at = 8 + place * (len(data) - 8) // 12
    data[at : at + 5] = bytes(255 - byte for byte in data[at : at + 5])
    (tmp_path / "r.mcap").write_bytes(data)
    try:
        found = read_recording(tmp_path / "r.mcap", skin)
        rows = [row.tolist() for _, row in found.frames]
        is_cut = any("ends early" in note for note in found.notes)
        assert rows == (expected[: len(rows)] if is_cut else expected)
    except CalibrationFormatError as error:
        assert "r.mcap" in str(error)


def test_wrong_calls_write_nothing(calibration, recorded, tmp_path, capsys):
    """Without -o, and with a time that messages cannot have."""
    with pytest.raises(SystemExit) as caught:
        main(["replay", str(calibration), str(recorded[0]), "--to", "mcap"])
    assert caught.value.code == 2 and "--to mcap needs -o OUT" in capsys.readouterr().err
    np.savez(tmp_path / "r.npz", time=np.array([0.0, np.nan]), readings=np.zeros((2, N)))
    out = tmp_path / "o.mcap"
    assert main(["replay", str(calibration), str(tmp_path / "r.npz"), "--to", "mcap", "-o", str(out)]) == 1
    assert "a message cannot have the time nan s; give a finite time in seconds" in capsys.readouterr().err
    assert not out.exists()


def test_missing_package_is_named(calibration, recorded, monkeypatch, capsys):
    """The error says how to install it."""
    monkeypatch.setitem(__import__("sys").modules, "mcap", None)
    assert main(["replay", str(calibration), str(recorded[1])]) == 1
    assert "MCAP files need the package mcap, which is not installed here: pip install 'skin-calib[live]'" in (
        capsys.readouterr().err
    )


def test_topics_have_valid_names():
    """Other characters become underscores; no name begins with a digit."""
    assert topic_of("left-sole.1", "frame") == "/skin/left_sole_1/frame"
    assert topic_of("3_link", "frame") == "/skin/_3_link/frame" and topic_of("前", "layout") == "/skin/_/layout"


def test_file_can_be_written_frame_by_frame(calibration):
    """As a process does that runs with a robot; the lost readings are in each message."""
    skin, stream = load(calibration), io.BytesIO()
    with McapSkin(stream, load_calibration(calibration), skin, 0.0) as file:
        for k in range(3):
            file.add({"force": np.zeros(N)}, skin.update(np.zeros(N), k * 1e-3), 2 * k, lost=k)
    from mcap.reader import make_reader

    messages = [
        m.data for _, c, m in make_reader(io.BytesIO(stream.getvalue())).iter_messages([topic_of("left-sole", "frame")])
    ]
    assert [(f["cycle"], f["lost"]) for f in (decode("SkinFrame", data) for data in messages)] == [
        (0, 0),
        (2, 1),
        (4, 2),
    ]
