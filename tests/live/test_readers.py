"""Independent readers of DDS get every frame equal to what the runtime computes, to the last digit."""

import json
import signal

import pytest

from skin_calib_addon.live import dds
from tests.live.programs import INSTALL, INSTALL_FAST, build, missing
from tests.live.running import REST, Process, Run, expected, free_domain, packets, rows, same, sole

pytest.importorskip("cyclonedds", reason="cyclonedds is not installed: pip install 'skin-calib[live]'")
CYCLONE, FAST = missing("cyclone"), missing("fast")
COUNT = 250
PERIOD = 0.004  # [s] of the readings


@pytest.fixture(scope="module")
def domain():
    """Keep a DDS domain for these tests."""
    with free_domain() as number:
        yield number


@pytest.fixture(scope="module")
def calibration(tmp_path_factory):
    return sole(tmp_path_factory.mktemp("live"))


@pytest.fixture(scope="module")
def cyclone(tmp_path_factory):
    """Return the reader in C."""
    if CYCLONE:
        pytest.skip(f"{CYCLONE} are not installed: {INSTALL}")
    return build("cyclone", tmp_path_factory.mktemp("cyclone"))


class Reader(Process):
    """An independent reader."""

    def __init__(self, folder, name, program, domain, *words):
        super().__init__(folder, name, program, domain, "left_sole", *words, CYCLONEDDS_URI=dds.LOOPBACK)
        self.wait_for(lambda self: "ready" in self.out)

    def messages(self, kind):
        """Return what it has printed so far."""
        lines = self.out.splitlines(keepends=True)
        found = [json.loads(line, parse_int=float) for line in lines if line.endswith("\n")]  # of minus zero, too
        return [one for one in found if one["message"] == kind]


def wait_for_match(reader):
    """Wait until a reader knows the writer."""
    reader.wait_for(lambda reader: reader.messages("matched"))


def readings_of(table):
    """Return cycle, time and row of the packets of a table."""
    return [(k, 1e3 + 4e-3 * k, row) for k, row in enumerate(table)]


def test_cyclone_in_c_gets_layout_and_every_frame(calibration, cyclone, domain, tmp_path):
    """Debian's Cyclone DDS with types from the IDL of rosidl, by the names that ROS 2 has on the wire."""
    table = rows(COUNT)
    with Reader(tmp_path, "reader", cyclone, domain, "full") as reader, Run(
        tmp_path, calibration, "--output", "dds", ROS_DOMAIN_ID=domain
    ) as run:  # fmt: skip
        wait_for_match(reader)
        run.send(packets(table), PERIOD)
        reader.wait_for(lambda reader: len(reader.messages("SkinFrame")) == COUNT - REST)
        assert run.stop() == 0 and "this computer only" in run.err
        layout, frames = expected(calibration, readings_of(table))
        (printed,) = reader.messages("TaxelLayout")
        assert same(layout, printed)
        for frame, printed in zip(frames, reader.messages("SkinFrame"), strict=True):
            assert same(frame, printed), (frame, printed)
    assert frames[-1]["contacts"] and frames[-1]["flags"] == [] and frames[-1]["trusted"]


@pytest.mark.slow
@pytest.mark.skipif(bool(FAST), reason=f"{FAST} are not installed: {INSTALL_FAST}")
def test_fast_dds_gets_every_frame(calibration, domain, tmp_path):
    """Debian's Fast DDS with types of its own generator, over the loopback device."""
    table = rows(COUNT)
    with Reader(tmp_path, "reader", build("fast", tmp_path), domain) as reader, Run(
        tmp_path, calibration, "--output", "dds", ROS_DOMAIN_ID=domain
    ) as run:  # fmt: skip
        wait_for_match(reader)
        run.send(packets(table), PERIOD)
        reader.wait_for(lambda reader: len(reader.messages("SkinFrame")) == COUNT - REST)
        assert run.stop() == 0
        _, frames = expected(calibration, readings_of(table))
        for frame, printed in zip(frames, reader.messages("SkinFrame"), strict=True):
            assert same(frame, printed), (frame, printed)


def test_slow_killed_and_restarted_readers_lose_frames_and_disturb_nobody(calibration, cyclone, domain, tmp_path):
    """A slow reader with a short history, a killed one, a later one: their frames are right, cycles show the gaps."""
    table = rows(500)
    with (
        Reader(tmp_path, "slow", cyclone, domain, "full", 20, 10) as slow,
        Reader(tmp_path, "killed", cyclone, domain, "full") as killed,
        Run(tmp_path, calibration, "--output", "dds", ROS_DOMAIN_ID=domain) as run,
    ):
        wait_for_match(slow), wait_for_match(killed)
        data = packets(table)
        run.send(data[:200], PERIOD)
        killed.wait_for(lambda reader: reader.messages("SkinFrame"))
        killed.stop(signal.SIGKILL)
        run.send(data[200:250], PERIOD)
        with Reader(tmp_path, "late", cyclone, domain, "full") as late:
            late.wait_for(lambda reader: reader.messages("TaxelLayout") and reader.messages("matched"))
            run.send(data[250:], PERIOD)
            late.wait_for(lambda reader: reader.messages("SkinFrame")[-1:] and at_end(reader))
            slow.wait_for(at_end)
            assert run.stop() == 0
            _, frames = expected(calibration, readings_of(table))
            by_cycle = {frame["cycle"]: frame for frame in frames}
            for reader in (slow, killed, late):
                found = reader.messages("SkinFrame")
                cycles = [one["cycle"] for one in found]
                assert cycles == sorted(set(cycles)) and all(same(by_cycle[one["cycle"]], one) for one in found)
            assert len(slow.messages("SkinFrame")) < 450 == len(frames)
            assert late.messages("SkinFrame")[0]["cycle"] >= 250
    assert run.out == "450 frames of 500 readings; no fault counted\n"


def at_end(reader):
    """Return whether a reader has the last frame."""
    return any(one["cycle"] == 499 for one in reader.messages("SkinFrame"))
