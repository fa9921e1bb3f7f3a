"""``skin-calib run`` as a process: each frame is what the runtime computes, faults are counted, the end is clean."""

import os
import signal
import sys
import tty

import numpy as np
import pytest

from skin_calib_addon.messages import decode, encode
from skin_calib_addon.messages.mcap_file import RecordedReadings
from tests.live.running import REST, WAIT, N, Process, Receiver, Run, expected, free_port, packets, rows, send, sole

mcap_ros2 = pytest.importorskip("mcap_ros2.reader", reason="mcap-ros2-support is not installed")


@pytest.fixture(scope="module")
def calibration(tmp_path_factory):
    return sole(tmp_path_factory.mktemp("live"))


def frames_in(path):
    """Return the bytes of the frames in an MCAP file."""
    from mcap.reader import make_reader

    with open(path, "rb") as stream:
        return [m.data for _, c, m in make_reader(stream).iter_messages() if c.topic == "/skin/left_sole/frame"]


def readings_of(table, cycles, first=0):
    """Return cycle, time and row of packets that arrive."""
    return [(first + k, 1e3 + 4e-3 * k, table[k]) for k in cycles]


@pytest.mark.parametrize("how", [signal.SIGTERM, signal.SIGINT])
def test_frames_over_udp_and_in_a_file_are_those_of_the_runtime(calibration, tmp_path, how):
    """To the last bit; Ctrl+C and SIGTERM complete the file, with exit code 0, also two at once."""
    table = rows(200)
    with Receiver() as receiver, Run(
        tmp_path, calibration, "--output", f"udp:{receiver.port}", "--output", "mcap:out.mcap"
    ) as run:  # fmt: skip
        run.send(packets(table))
        datagrams = receiver.get(200 - REST)
        run.process.send_signal(signal.SIGTERM if how == signal.SIGINT else signal.SIGINT)
        assert run.stop(how) == 0
    _, frames = expected(calibration, readings_of(table, range(200)))
    assert datagrams == frames_in(tmp_path / "out.mcap") == [encode("SkinFrame", f) for f in frames]
    stored = RecordedReadings(tmp_path / "out.mcap", "left-sole", 2**20)
    assert not stored.is_cut and np.array_equal(stored.readings, table[REST:])
    assert run.out == "150 frames of 200 readings; no fault counted\n"
    assert "127.0.0.1" in run.err and "rest: 50 frames" in run.err


def test_faults_of_the_line_are_counted_and_give_no_wrong_frame(calibration, tmp_path):
    """1 % lost, truncated, repeated, changed packets and garbage; then the sender starts again with cycle 0."""
    rng, table = np.random.default_rng(5), rows(1000)
    data, sent, arrives = packets(table), [], []
    for k, one in enumerate(data):
        fault = rng.random() if k > REST else 1.0
        if fault < 0.01:
            continue
        if fault < 0.02:
            sent.append(one[: int(rng.integers(30, len(one)))])
            continue
        if fault < 0.03:
            changed = bytearray(one)
            changed[int(rng.integers(28, len(one)))] ^= 4
            sent.append(bytes(changed))
            continue
        if fault < 0.04:
            sent.append(rng.bytes(100))
        sent += [one] * (2 if fault > 0.99 and k > REST else 1)
        arrives.append(k)
    again = rows(30)
    sent += packets(again, session=1, start=500_000_000)
    readings = readings_of(table, arrives)
    readings += [(arrives[-1] + 1 + k, 500 + 4e-3 * k, row) for k, row in enumerate(again)]
    losses = [cycle - k for k, (cycle, _, _) in enumerate(readings)]
    with Receiver() as receiver, Run(tmp_path, calibration, "--output", f"udp:{receiver.port}") as run:
        run.send(sent, 1e-4)
        datagrams = receiver.get(len(readings) - REST)
        assert run.stop() == 0
    _, frames = expected(calibration, readings, losses)
    assert datagrams == [encode("SkinFrame", f) for f in frames]
    old = sum(a == b for a, b in zip(sent, sent[1:]))
    assert losses[-1] > 20 and old > 5
    assert f"{len(readings)} readings; lost {losses[-1]}, old {old}, damaged " in run.out
    assert ", skipped " in run.out and ", restarts 1; flags: dropped " in run.out and ", time_back 1\n" in run.out


def test_readings_of_the_wrong_length_are_published_as_unknown(calibration, tmp_path):
    """A sender with too few channels: frames without values, which state why."""
    table = rows(60)
    with Receiver() as receiver, Run(tmp_path, calibration, "--output", f"udp:{receiver.port}") as run:
        run.send(packets(table) + packets(table[:1, : N - 1], first=60, start=1_000_240_000))
        last = decode("SkinFrame", receiver.get(11)[-1])
        assert run.stop() == 0
    assert not last["trusted"] and np.isnan(last["wrench"]).all() and "42" in last["problem"], last["problem"]


def test_serial_line_gives_the_same_frames(calibration, tmp_path):
    """A pseudo terminal, with a truncated packet and garbage between; a pulled cable is named."""
    pytest.importorskip("serial", reason="pyserial is not installed")
    table, (ours, theirs) = rows(120), os.openpty()
    tty.setraw(theirs)
    data = packets(table, bits=12)
    with Receiver() as receiver, Process(
        tmp_path, "run", sys.executable, "-m", "skin_calib_addon", "run", calibration, "--input",
        f"serial:{os.ttyname(theirs)}:3000000", "--output", f"udp:{receiver.port}", "--tare", REST, "--accept",
    ) as run:  # fmt: skip
        run.wait_for(lambda run: "priority" in run.err)
        for one in [*data[:80], data[80][:50], b"noise", *data[81:]]:
            os.write(ours, one)
        datagrams = receiver.get(119 - REST)
        os.close(theirs), os.close(ours)  # the cable is pulled out
        assert run.process.wait(WAIT) == 1
    _, frames = expected(calibration, readings_of(table, [k for k in range(120) if k != 80]))
    assert datagrams == [encode("SkinFrame", f) for f in frames]
    assert "3000000 baud: " in (last := run.err.splitlines()[-1]) and last.endswith("Check the cable, and start again")


LIMITED = ["sh", "-c", 'ulimit -f 200 && exec "$@"', "sh"]  # the size of a file stands for a full disk


def test_full_disk_ends_with_one_line(calibration, tmp_path):
    """A file that exists is not replaced, either."""
    port = free_port()
    command = [sys.executable, "-m", "skin_calib_addon", "run", calibration, "--input", f"udp:{port}", "--output"]
    with Process(tmp_path, "run", *LIMITED, *command, "mcap:out.mcap") as run:
        run.wait_for(lambda run: "priority" in run.err)
        send(port, packets(np.random.default_rng(1).integers(0, 4096, (1500, N)).astype(np.uint16)), 2e-4)
        assert run.process.wait(WAIT) == 2
    assert run.err.splitlines()[-1].startswith("skin-calib: cannot write 'out.mcap': File too large.")
    with Process(tmp_path, "again", *command, "mcap:out.mcap") as again:
        assert again.process.wait(WAIT) == 2
    assert again.err.count("\n") == 1 and "cannot write 'out.mcap': File exists" in again.err


def test_full_disk_does_not_end_the_other_outputs(calibration, tmp_path):
    """A recording must not take the skin from the controller. It is named, and the exit code states it."""
    port, count = free_port(), 1500
    command = [sys.executable, "-m", "skin_calib_addon", "run", calibration, "--input", f"udp:{port}"]
    with Receiver() as receiver:
        outputs = ["--output", "mcap:out.mcap", "--output", f"udp:{receiver.port}"]
        with Process(tmp_path, "run", *LIMITED, *command, *outputs) as run:
            run.wait_for(lambda run: "priority" in run.err)
            send(port, packets(np.random.default_rng(1).integers(0, 4096, (count, N)).astype(np.uint16)), 1e-3)
            assert decode("SkinFrame", receiver.get(count)[-1])["cycle"] == count - 1
            assert run.stop() == 2
    assert "cannot write 'out.mcap': File too large. " in run.err and "The other outputs go on" in run.err
    assert "out.mcap ended" in run.out and run.err.splitlines()[-1].startswith("skin-calib: cannot write 'out.mcap'")
