"""Run ``skin-calib run`` as a process of its own, with a free port and domain, and what it should publish."""

import json
import os
import signal
import socket
import subprocess
import sys
import time
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np

from skin_calib_addon.calibration import Response, load_calibration, save_calibration
from skin_calib_addon.messages import frame_message, layout_message
from skin_calib_addon.messages.packet import packet
from skin_calib_addon.runtime import load
from tests.samples import plane, small_calibration
from tests.soles import sole_patch

N, REST = 42, 50
ROOT = Path(__file__).parents[2]
LOCKS = 6000  # port of the first lock of a DDS domain
WAIT = 60  # [s] for what must happen; a failure takes so long


def sole(folder):
    """Write the calibration of a sole; return its path."""
    path = folder / "sole.calibration.json"
    fields = {"link": "left-sole", "patches": (sole_patch(),), "surfaces": (plane(),)}
    save_calibration(small_calibration(**fields, response=Response((0.0, 0.2), (0.0, 4095.0))), path)
    return path


def rows(count):
    """Return counts (count, N): noise, and after the rest a contact that moves."""
    rng = np.random.default_rng(2)
    table = np.rint(np.maximum(rng.normal(20, 2, (count, N)), 0)).astype(np.uint16)
    for k in range(REST, count):
        table[k, (k // 8) % 30 : (k // 8) % 30 + 9] += 200
    return table


def packets(table, session=0, first=0, start=1_000_000_000, bits=16):
    """Return the packets of rows, 4 ms apart."""
    return [packet(row, first + k, start + 4000 * k, bits, session) for k, row in enumerate(table)]


def expected(path, readings, lost=None):
    """Return the layout and the frames of readings (cycle, time, row) that arrive; those of the rest come first."""
    skin = load(path)
    skin.tare([row for _, _, row in readings[:REST]], accept=True)
    layout = layout_message(load_calibration(path), skin, readings[REST][1])
    counts = lost or [c - readings[0][0] - k for k, (c, _, _) in enumerate(readings)]
    return layout, [
        frame_message(skin.link, skin.update(row, at), cycle, missing, skin.checksum)
        for (cycle, at, row), missing in zip(readings[REST:], counts[REST:])
    ]


def flat(message):
    """Return a message as the readers print it: without nested stamps, arrays as lists, numbers as floats."""
    if isinstance(message, dict):
        out = {}
        for name, value in message.items():
            if name == "header":
                out |= flat({**value["stamp"], "frame_id": value["frame_id"]})
            elif name not in ("message", "is"):  # marks of the readers
                out[name] = flat(value)
        return out
    if isinstance(message, np.ndarray):
        message = message.ravel().tolist()
    if isinstance(message, (list, tuple)):
        return [flat(x) for x in message]
    is_number = isinstance(message, (int, float)) and not isinstance(message, (bool, np.bool_))
    return float(message) if is_number else message


def same(expected, printed):
    """Return whether a message equals a printed one, to the last digit; NaN equals NaN."""
    return json.dumps(flat(expected), sort_keys=True) == json.dumps(flat(printed), sort_keys=True)


def free_port():
    """Return a UDP port that nobody uses."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


@contextmanager
def free_domain():
    """Yield a DDS domain that no other test uses now."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as lock:
        for number in range(1, 100):  # ports of higher domains are those of other programs
            with suppress(OSError):
                lock.bind(("127.0.0.1", LOCKS + number))
                break
        yield str(number)


class Process:
    """A program whose output goes to files."""

    def __init__(self, folder, name, *words, **environment):
        self.files = [folder / f"{name}.{kind}" for kind in ("out", "err")]
        with open(self.files[0], "wb") as out, open(self.files[1], "wb") as err:
            variables = os.environ | environment | {"PYTHONPATH": str(ROOT), "OPENBLAS_NUM_THREADS": "1"}
            self.process = subprocess.Popen(list(map(str, words)), stdout=out, stderr=err, cwd=folder, env=variables)

    @property
    def out(self):
        """What it has printed."""
        return self.files[0].read_text()

    @property
    def err(self):
        """Its messages."""
        return self.files[1].read_text()

    def wait_for(self, condition):
        """Wait until something holds of this process."""
        end = time.monotonic() + WAIT
        while not condition(self):
            assert self.process.poll() is None, f"ended with {self.process.returncode}: {self.out} {self.err}"
            assert time.monotonic() < end, f"not in {WAIT} s: {self.out[-2000:]} {self.err[-2000:]}"
            time.sleep(0.01)

    def stop(self, how=signal.SIGTERM):
        """Send a signal; return the exit code."""
        self.process.send_signal(how)
        return self.process.wait(WAIT)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait()


def send(port, data, period=0.0):
    """Send datagrams, a period apart [s]."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        for one in data:
            sender.sendto(one, ("127.0.0.1", port))
            time.sleep(period)


class Run(Process):
    """``skin-calib run`` with UDP packets."""

    def __init__(self, folder, calibration, *words, **environment):
        self.port = free_port()
        command = [sys.executable, "-m", "skin_calib_addon", "run", calibration, "--input", f"udp:{self.port}"]
        super().__init__(folder, "run", *command, "--tare", REST, "--accept", *words, **environment)
        self.wait_for(lambda self: "priority" in self.err)

    def send(self, data, period=0.0):
        """Send datagrams, a period apart [s]."""
        send(self.port, data, period)


class Receiver:
    """A socket for frames over UDP."""

    def __init__(self):
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 2**22)
        self.socket.bind(("127.0.0.1", 0))
        self.socket.settimeout(WAIT)
        self.port = self.socket.getsockname()[1]

    def get(self, count):
        """Return the next datagrams."""
        return [self.socket.recv(65536) for _ in range(count)]

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.socket.close()
