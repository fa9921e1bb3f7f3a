"""``run`` in this process: a recording is played, decoders of users, what is refused before anything is written."""

import gc
import os
import socket
import struct
import sys
import threading
import time
from contextlib import suppress
from dataclasses import replace

import numpy as np
import pytest

from skin_calib_addon.calibration import Modality, ResponseTable, load_calibration, save_calibration
from skin_calib_addon.cli import main
from skin_calib_addon.common.errors import CalibrationFormatError, OutputError, SkinCalibError
from skin_calib_addon.live.inputs import FileInput
from skin_calib_addon.live.loop import Status
from skin_calib_addon.live.outputs import UdpOutput
from skin_calib_addon.runtime import Skin, load
from tests.live.running import REST, ROOT, WAIT, N, free_port, rows, sole
from tests.samples import sheet, small_calibration

pytest.importorskip("mcap", reason="mcap is not installed: pip install 'skin-calib[live]'")
PAUSE = 1e5  # [s] in a recording; it is not played


@pytest.fixture(scope="module")
def calibration(tmp_path_factory):
    return sole(tmp_path_factory.mktemp("run"))


@pytest.fixture(scope="module")
def recording(calibration):
    """Write a recording with a gap, as an MCAP file; return its path."""
    npz, out = calibration.with_name("r.npz"), calibration.with_name("r.mcap")
    stamps = 0.002 * np.arange(150)
    stamps[100:] += PAUSE
    np.savez(npz, time=stamps, readings=rows(150))
    assert main(["replay", str(calibration), str(npz), "--to", "mcap", "-o", str(out)]) == 0
    return out


def contents(path):
    """Return topic and bytes of each message of a file, topic by topic, without those for a view."""
    from mcap.reader import make_reader

    with open(path, "rb") as stream:
        found = [(c.topic, m.data) for s, c, m in make_reader(stream).iter_messages() if "skin_calib_msgs" in s.name]
    return sorted(found, key=lambda one: ("layout", "reading", "frame").index(one[0].rpartition("/")[2]))


def test_played_recording_gives_the_frames_of_replay(calibration, recording, tmp_path, capsys):
    """Layout, readings and frames in the order of the file, to the bit; the priority is that of before."""
    noise = tmp_path / "noise.json"
    rest = calibration.with_name("r.npz")
    assert main(["tare", str(calibration), str(rest), "--rest", "0.1", "--accept", "-o", str(noise)]) == 0
    again, out = tmp_path / "again.mcap", tmp_path / "out.mcap"
    words = [str(calibration), str(recording), "--noise", str(noise), "--to", "mcap", "-o", str(again)]
    assert main(["replay", *words]) == 0
    capsys.readouterr()
    words = [str(calibration), "--input", f"mcap:{recording}", "--output", f"mcap:{out}", "--noise", str(noise)]
    before = os.sched_getscheduler(0), gc.get_freeze_count()
    assert main(["run", *words]) == 0
    assert (os.sched_getscheduler(0), gc.get_freeze_count()) == before
    printed = capsys.readouterr()
    assert printed.out.startswith("150 frames of 150 readings; no fault counted; flags: ")
    assert printed.out.endswith("time_jump 1\n")
    assert str(recording) in printed.err and "priority" in printed.err
    assert contents(out) == contents(again)


def test_layout_follows_noise_that_is_learned(calibration, recording, tmp_path):
    """Without noise and tare the skin learns from the first quiet frames: a second layout has its thresholds."""
    out = tmp_path / "out.mcap"
    assert main(["run", str(calibration), "--input", f"mcap:{recording}", "--output", f"mcap:{out}"]) == 0
    topics = [topic.rpartition("/")[2] for topic, _ in contents(out)]
    skin, count = load(calibration), 1
    before = skin.noise
    for k, row in enumerate(rows(150)):
        skin.update(row, 0.002 * k + PAUSE * (k >= 100))
        count += skin.noise is not before and k > 0
        before = skin.noise
    assert topics.count("layout") == count and topics[0] == "layout"


def test_rest_that_is_pressed_is_refused(calibration, tmp_path, capsys):
    """By the words of the options; without a frame there is no file, and the same command can start again."""
    npz, out = tmp_path / "pressed.npz", tmp_path / "out.mcap"
    np.savez(npz, time=0.001 * np.arange(60), readings=rows(60) + np.uint16(100))
    words = ["run", str(calibration), "--input", f"mcap:{npz}", "--output", f"mcap:{out}", "--tare"]
    assert main([*words, "50"]) == 1
    assert "are refused" in (err := capsys.readouterr().err) and "add --accept" in err
    assert not out.exists()
    assert main([*words, "61", "--accept"]) == 1
    assert "the input ended after 60 of the 61 readings at rest. Use fewer" in capsys.readouterr().err


def test_missing_modality_is_named_once(calibration, tmp_path, capsys):
    """A calibration with proximity, readings of force alone."""
    npz, path = tmp_path / "r.npz", tmp_path / "near.calibration.json"
    near = Modality("proximity", "m", ResponseTable((0.0, 4000.0), (0.2, 0.0)))
    save_calibration(replace(load_calibration(calibration), modalities=(near,)), path)
    np.savez(npz, time=0.001 * np.arange(60), readings=rows(60))
    assert main(["run", str(path), "--input", f"mcap:{npz}", "--output", f"udp:{free_port()}"]) == 0
    assert capsys.readouterr().err.count("warning: the readings have no proximity, which the calibration has\n") == 1


def test_more_numbers_than_the_skin_needs_are_named(calibration, tmp_path, capsys):
    """Once by run, which has no names of channels, and by replay of what it has recorded."""
    npz, out = tmp_path / "r.npz", tmp_path / "out.mcap"
    np.savez(npz, time=0.001 * np.arange(60), readings=np.column_stack((np.arange(60, dtype=np.uint16), rows(60))))
    assert main(["run", str(calibration), "--input", f"mcap:{npz}", "--output", f"mcap:{out}"]) == 0
    assert capsys.readouterr().err.count("warning: the readings have 43 numbers, the skin needs 42. Check") == 1
    assert main(["replay", str(calibration), str(out)]) == 0
    assert "warning: the recording has more numbers than the skin needs" in capsys.readouterr().err


def test_skin_without_taxels_is_refused(tmp_path, capsys):
    """Its frames would say that nothing touches."""
    path = tmp_path / "none.calibration.json"
    save_calibration(small_calibration(patches=(), surfaces=()), path)
    assert main(["run", str(path), "--input", f"udp:{free_port()}", "--output", f"udp:{free_port()}"]) == 1
    assert "has no taxels. Add a skin" in capsys.readouterr().err


def test_messages_that_nobody_reads_do_not_end_it(calibration, recording, tmp_path, monkeypatch):
    """The other end of stderr is closed, as after "2>&1 | head": a skin of a robot must not stop for it."""
    out, (reader, writer) = tmp_path / "out.mcap", os.pipe()
    os.close(reader)
    with suppress(BrokenPipeError), open(writer, "w", 1) as closed:
        monkeypatch.setattr(sys, "stderr", closed)
        main(["run", str(calibration), "--input", f"mcap:{recording}", "--output", f"mcap:{out}"])
    assert len([topic for topic, _ in contents(out) if topic.endswith("frame")]) == 150


def test_terminal_that_takes_no_more_does_not_stop_it(calibration, recording, tmp_path, monkeypatch):
    """A pipe that is full, and nobody reads: as a terminal after Ctrl+S, or over a network that fails."""
    out, (reader, writer) = tmp_path / "out.mcap", os.pipe()
    os.set_blocking(writer, False)
    with suppress(BlockingIOError):
        while True:
            os.write(writer, bytes(4096))
    os.set_blocking(writer, True)
    end = threading.Timer(WAIT, os.close, [reader])  # otherwise a failure would wait forever
    end.start()
    with open(writer, "w", 1) as full:
        monkeypatch.setattr(sys, "stderr", full)
        assert main(["run", str(calibration), "--input", f"mcap:{recording}", "--output", f"mcap:{out}"]) == 0
        assert end.is_alive() and len([topic for topic, _ in contents(out) if topic.endswith("frame")]) == 150
        end.cancel()
        os.close(reader)


def test_times_of_arrival_replace_those_of_the_sender(calibration, recording, tmp_path):
    """The frames are of now."""
    from skin_calib_addon.messages import decode

    out, before = tmp_path / "out.mcap", time.time()
    words = ["--input", f"mcap:{recording}", "--output", f"mcap:{out}", "--arrival-time"]
    assert main(["run", str(calibration), *words]) == 0
    stamps = [decode("SkinFrame", d)["header"]["stamp"] for topic, d in contents(out) if topic.endswith("frame")]
    assert all(before - 1 <= s["sec"] <= time.time() for s in stamps) and len(stamps) == 150


@pytest.mark.parametrize(
    ("words", "what"),
    [
        (["--input", "udp:0", "--output", "dds"], "'udp:0' does not end with a port, 1 to 65535"),
        (["--input", "tcp:5", "--output", "dds"], "'tcp:5' is not udp:PORT, serial:DEVICE or mcap:FILE"),
        (["--input", "udp:5005", "--output", "mcap"], "'mcap' is not dds, mcap:FILE or udp:HOST:PORT"),
        (["--input", "udp:5005", "--output", "dds", "--tare", "5", "--noise", "n"], "give one of them"),
        (["--input", "udp:5005", "--output", "mcap:none/x.mcap"], "Create it first"),
        (["--input", "serial:tty:0", "--output", "dds"], "'serial:tty:0' does not end with a baud rate"),
        (["--input", "serial:tty:2147483648", "--output", "dds"], "does not end with a baud rate"),
        (["--input", "mcap:a", "--output", "dds", "--decoder", "d.py"], "--decoder is for packets of udp and serial"),
        (["--input", "udp:5005", "--output", "dds", "--output", "dds"], "one of them is given twice"),
        (["--input", "udp:5005", "--output", "udp:127.0.0.1:5005"], "one of them is given twice"),
    ],
)
def test_wrong_calls_are_refused(calibration, capsys, words, what):
    """With exit code 2, and one line."""
    try:
        code = main(["run", str(calibration), *words])
    except SystemExit as end:
        code = end.code
    err = capsys.readouterr().err
    assert code == 2 and what in err and err.count("\n") == 1


@pytest.mark.parametrize(("package", "words"), [("cyclonedds", ["udp:{}", "dds"]), ("serial", ["serial:tty", "udp:9"])])
def test_missing_packages_are_named(calibration, capsys, monkeypatch, package, words):
    """One line states how to install them; nothing imports them otherwise."""
    monkeypatch.setitem(sys.modules, package, None)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    source, target = (word.format(port) for word in words)
    assert main(["run", str(calibration), "--input", source, "--output", target]) == 1
    err = capsys.readouterr().err
    assert "pip install 'skin-calib[live]'" in err and err.count("\n") == 1


@pytest.mark.parametrize(
    "variable", [{"ROS_DOMAIN_ID": "seven"}, {"ROS_DOMAIN_ID": "233"}, {"CYCLONEDDS_URI": "<wrong"}]
)
def test_wrong_settings_of_dds_are_named(calibration, capfd, monkeypatch, variable):
    """The variable of the environment is in the message."""
    pytest.importorskip("cyclonedds", reason="cyclonedds is not installed: pip install 'skin-calib[live]'")
    ((name, value),) = variable.items()
    monkeypatch.setenv(name, value)
    assert main(["run", str(calibration), "--input", f"udp:{free_port()}", "--output", "dds"]) == 1
    (line,) = [one for one in capfd.readouterr().err.splitlines() if one.startswith("skin-calib")]
    assert name in line


def test_port_that_is_in_use_is_named(calibration, capsys):
    """And nothing is waited for."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("127.0.0.1", 0))
        port = other.getsockname()[1]
        assert main(["run", str(calibration), "--input", f"udp:{port}", "--output", "udp:9"]) == 1
    assert f"cannot receive at UDP 127.0.0.1:{port}: " in capsys.readouterr().err


def test_messages_that_cannot_be_sent_are_counted(calibration):
    """With the last reason; a skin whose frames do not fit into a datagram is refused at the start."""
    skin = load(calibration)
    output = UdpOutput("127.0.0.1", 0, skin)  # nothing can be sent to port 0
    output.send("frame", b"x", 0.0, 1)
    status = Status(None, [output])
    assert status.faults() == "not sent 1 (Invalid argument)"
    output.close()
    with pytest.raises(OutputError, match="no space for a frame of 3016 taxels. Use another output"):
        UdpOutput("127.0.0.1", 9, Skin(small_calibration(patches=(sheet(58, 52, 0.004),))))


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("x = 1", "KeyError: 'Decoder'"),
        ("import no_such_package", "No module named 'no_such_package'"),
        ("class Decoder:\n    pass", "has no method feed(data, is_datagram). Add it"),
        ("class Decoder:\n    def __init__(self, x): pass", "missing 1 required positional argument"),
    ],
)
def test_wrong_decoder_is_refused(calibration, tmp_path, capsys, text, what):
    """With the name of the file."""
    file = tmp_path / "mine.py"
    file.write_text(text)
    words = ["--input", "udp:9", "--output", "udp:10", "--decoder", str(file)]
    assert main(["run", str(calibration), *words]) == 1
    err = capsys.readouterr().err
    assert what in err and str(file) in err and err.count("\n") == 1


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("1 / 0", "ZeroDivisionError: division by zero"),
        ("sys.exit(3)", "SystemExit: 3"),
        ("pass", "TypeError: 'NoneType' object is not iterable"),
        ("return [3]", "TypeError: 3 is not a Reading"),
        ("return [Reading(0.0, -1, [1.0])]", "ValueError: the cycle -1 is not a number from 0 on"),
        ("return [Reading(float('nan'), 0, [1.0])]", "ValueError: the time nan is not a number of seconds"),
        ("return [Reading(0.0, 0, {'force': ['abc']})]", "TypeError: values are not a list of numbers"),
        ("return [Reading(0.0, 0, [[1.0, 2.0]])]", "TypeError: values are not a list of numbers"),
        ("return [Reading(0.0, 0, {'proximity': [1.0]})]", "ValueError: values have no force"),
    ],
)
def test_decoder_that_fails_is_named(tmp_path, text, what):
    """With the name of its file, and what it returned; it would end in the middle of our own code, or unseen."""
    from skin_calib_addon.commands.run import _decoder

    file = tmp_path / "mine.py"
    head = "import sys\nfrom skin_calib_addon.messages.packet import Reading\n"
    file.write_text(f"{head}class Decoder:\n    def feed(self, data, is_datagram):\n        {text}\n")
    with pytest.raises(CalibrationFormatError) as caught:
        _decoder(file).feed(b"", True)
    assert str(caught.value) == f"the class Decoder of '{file}' failed: {what}. Correct the file"


def decoder_of(name):
    """Return a decoder of the examples, as the command loads it."""
    from skin_calib_addon.commands.run import _decoder

    return _decoder(ROOT / "examples" / f"{name}.py")


def test_decoder_of_lines_counts_damaged_ones():
    """A line that had begun before, lines that are cut or mixed; datagrams have complete lines."""
    table = np.random.default_rng(1).integers(0, 4096, (30, 120))
    lines = [",".join(map(str, (5 * k, k, *row))).encode() + b"\r\n" for k, row in enumerate(table)]
    data = b"".join([lines[0][100:], *lines[1:10], lines[10][:200], *lines[11:20], b"no numbers\n", *lines[20:]])
    decoder = decoder_of("decoder_csv")
    found = [r for at in range(0, len(data), 37) for r in decoder.feed(data[at : at + 37], False)]
    assert [r.cycle for r in found] == [*range(1, 10), *range(12, 30)]
    assert all(r.values.tolist() == table[r.cycle].tolist() and r.time == 0.005 * r.cycle for r in found)
    assert (decoder.damaged, decoder.skipped) == (2, len(lines[0]) - 101)
    decoder = decoder_of("decoder_csv")
    assert len(decoder.feed(lines[0] + lines[1][:90], True)) == 1 and decoder.damaged == 1


def test_decoder_of_robotiq_joins_both_fingers():
    """Frames in pieces, with garbage, a cut frame, and other values; no reading has fingers of different times."""
    rng = np.random.default_rng(2)
    table = rng.integers(0, 2**16, (20, 56))

    def frame(values):
        return bytes((0x9A, 0, 0x58, len(values))) + values

    def taxels(row, finger):
        part = row[28 * finger : 28 * finger + 28]
        return frame(bytes((0x10 | finger << 2,)) + struct.pack(">28H", *part))

    other = frame(bytes((0x20, 1, 2, 0x34)) + bytes(6) + bytes((0x70,)) + bytes(8))
    pieces = [b"\1\2\3"]
    for k, row in enumerate(table):
        pieces += [taxels(row, 0), other, taxels(row, 1) if k != 5 else taxels(row, 1)[:30]]
    decoder, data = decoder_of("decoder_robotiq"), b"".join(pieces)
    found = [r for at in range(0, len(data), 23) for r in decoder.feed(data[at : at + 23], False)]
    kept = [r.values.tolist() for r in found]
    assert decoder.start == bytes((0x9A, 0, 0x58, 1, 1)) and [r.cycle for r in found] == list(range(len(found)))
    assert kept[:5] == table[:5].tolist() and kept[-12:] == table[7:19].tolist()  # the last one may be cut
    assert len(found) == 17 + (table[6].tolist() in kept) and decoder.skipped >= 3 and decoder.damaged >= 1


def test_cycles_of_a_recording_are_kept(calibration, recording):
    """Those of the messages; a table counts from 0 on. It ends with None."""
    source = FileInput(recording, load(calibration))
    found = []
    while (readings := source.read()) is not None:
        found += readings
    assert [r.cycle for r in found] == list(range(150)) and list(found[0].values) == ["force"]
    assert len(found[0].values["force"]) == N and REST < 150
    with pytest.raises(SkinCalibError, match="cannot read"):
        FileInput(recording.with_name("none.mcap"), load(calibration))
