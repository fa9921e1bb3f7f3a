"""`skin-calib run` at 1 kHz with 1260 taxels of 16 bits: gaps, latency, processor time, by output, priority, load.

    python -m benchmarks.live [--seconds 60] [--output dds mcap udp cpp-dds cpp-udp]

A sender with real-time priority sends a packet each millisecond. Latency is from the time in the packet to that at
which an independent reader has the frame: in C with Cyclone DDS, else a socket that gets the frame before the file. It
leaves out the first second, in which the program is late after the tare. The load is that of more processes that
compute all the time. Pauses are those of a virtual machine: a process with the highest priority on each processor wakes
5 ms late or more. The last column leaves out what was sent during a pause or up to twice its length later. It needs
Linux, root, and what `tests/live/programs.py` names. "cpp-" is `cpp/examples/run.cpp`, built by `make cpp`.
"""

import argparse
import os
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import numpy as np

from skin_calib_addon.calibration import Response, save_calibration
from skin_calib_addon.live import dds
from skin_calib_addon.messages import decode
from skin_calib_addon.messages.content import seconds
from skin_calib_addon.messages.packet import packet
from skin_calib_addon.runtime import load as load_skin
from tests.live.programs import build, missing
from tests.live.running import Process, Receiver, free_domain, free_port
from tests.samples import sheet, small_calibration

ROWS, COLUMNS = 30, 42
REST = 200
PROGRAM = [sys.executable, "-m", "benchmarks.live"]
NORMAL = ["setpriv", "--bounding-set=-sys_nice"]  # without the right to real-time priority
OUTPUTS = ("dds", "mcap", "udp", "cpp-dds", "cpp-udp")
PAUSE = 5_000_000  # [ns] delay from which on the machine has paused; the sender then sends no packets late


def fifo(priority: int) -> None:
    """Give this process a real-time priority."""
    os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))


def quiet() -> np.ndarray:
    """Return readings at rest (t, n): noise about 30 counts."""
    return np.rint(np.random.default_rng(1).normal(30, 1, (REST, ROWS * COLUMNS))).astype(np.uint16)


def send(port: int, count: int) -> None:
    """Send packets at 1 kHz: readings at rest, then a press that moves."""
    rng, (row, column) = np.random.default_rng(0), np.indices((ROWS, COLUMNS))
    table = rng.normal(30, 1, (500, ROWS * COLUMNS))
    for k in range(500):
        table[k] += np.maximum(500 - 100 * np.hypot(row - 15, column - 5 - k / 17).ravel(), 0)
    pressed = np.rint(table).astype(np.uint16)
    at_rest, out = quiet(), socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    period, start = 10**6, time.monotonic_ns()
    for k in range(count):
        time.sleep(max(start + k * period - time.monotonic_ns(), 0) / 1e9)
        if (late := time.monotonic_ns() - start - k * period) > PAUSE:
            start += late
        values = at_rest[k] if k < REST else pressed[k % 500]
        out.sendto(packet(values, k, time.time_ns() // 1000), ("127.0.0.1", port))


def watch(processor: int) -> None:
    """Print start and length of each pause of a processor [ns]."""
    os.sched_setaffinity(0, {processor})
    while True:
        before = time.time_ns()
        time.sleep(1e-3)
        if (late := time.time_ns() - before - 10**6) > PAUSE:
            print(before, late, flush=True)


def processor_time(pid: int) -> float:
    """Return the processor time of a process so far [s]."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return sum(map(int, fields[11:13])) / os.sysconf("SC_CLK_TCK")


@contextmanager
def load(count: int) -> Iterator[None]:
    """Keep processors busy."""
    busy = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(count)]
    try:
        yield
    finally:
        for one in busy:
            one.kill()
            one.wait()


def received(receiver: Receiver, sender: subprocess.Popen) -> Iterator[tuple[int, int, int]]:
    """Yield cycle, time in the packet and latency [ns] of each frame until no more come."""
    receiver.socket.settimeout(2)
    stamped = []
    while True:
        try:
            stamped.append((receiver.socket.recv(65536), time.time_ns()))
        except TimeoutError:
            if sender.poll() is not None:
                break
    for data, now in stamped:
        frame = decode("SkinFrame", data)
        sent = round(seconds(frame["header"]["stamp"]) * 1e6) * 1000  # packets have microseconds
        yield frame["cycle"], sent, now - sent


def measure(folder: Path, calibration: Path, reader: Path, output: str, is_real_time: bool, frames: int) -> str:
    """Return a row of the table."""
    port, receiver, (is_cpp, output) = free_port(), Receiver(), (output.startswith("cpp-"), output.removeprefix("cpp-"))
    outputs = {"dds": ["dds"], "mcap": [f"mcap:{folder / str(time.time_ns())}.mcap"]}.get(output, [])
    outputs += [] if output == "dds" else [f"udp:{receiver.port}"]
    command = [sys.executable, "-m", "skin_calib_addon", "run", calibration, "--input", f"udp:{port}"]
    command += ["--tare", REST, "--accept", *(word for one in outputs for word in ("--output", one))]
    if is_cpp:
        skin = load_skin(calibration)
        skin.tare(quiet(), accept=True)
        skin.save_noise(folder / "noise.json")
        command = [
            Path("build/cpp/run").resolve(),
            calibration,
            folder / "noise.json",
            port,
            receiver.port if output == "udp" else output,
        ]
    with ExitStack() as stack:
        domain = stack.enter_context(free_domain())
        reading = [reader, domain, "forearm", "short"]
        watchers = [Process(folder, f"watch{k}", *PROGRAM, "--watch", k) for k in os.sched_getaffinity(0)]
        listener = Process(
            folder, "reader", *(["chrt", "-f", 60] * is_real_time), *reading, CYCLONEDDS_URI=dds.LOOPBACK
        )
        run = Process(folder, "run", *([] if is_real_time else NORMAL), *command, ROS_DOMAIN_ID=domain)
        for process in (*watchers, listener, run):
            stack.enter_context(process)
        run.wait_for(lambda run: "priority" in run.err)
        assert ("real-time" in run.err) == is_real_time, run.err
        if output == "dds":
            listener.wait_for(lambda listener: "matched" in listener.out)
        before = processor_time(run.process.pid)
        sender = subprocess.Popen([*PROGRAM, "--send", str(port), str(REST + frames)])
        if output != "dds":
            fifo(60) if is_real_time else None
            found = list(received(receiver, sender))
            os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
        sender.wait()
        time.sleep(1)
        used = (processor_time(run.process.pid) - before) / frames * 1e6
        assert run.stop() == 0
        if output == "dds":
            found = [tuple(map(int, line.split())) for line in listener.out.splitlines() if line[:1].isdigit()]
        faults = run.out.replace("\n", ", ") if is_cpp else run.out.partition("; ")[2].strip()
    cycles, sent, late = np.array(found).T
    assert (np.diff(cycles) > 0).all()
    pauses = [tuple(map(int, line.split())) for one in watchers for line in one.out.splitlines()]
    is_measured = is_calm = cycles >= REST + 1000
    for start, length in pauses:
        is_calm = is_calm & ((sent < start - 10**7) | (sent > start + 3 * length))
    p50, p99, most = np.percentile(late[is_measured], (50, 99, 100)) / 1e3
    calm = np.percentile(late[is_calm], 99) / 1e3
    gaps = frames - np.count_nonzero(cycles >= REST)
    return f"{gaps:6d} {p50:8.0f} {p99:8.0f} {most:9.0f} {used:7.0f} {len(pauses):7d} {calm:9.0f}   {faults}"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=int, default=60)
    parser.add_argument("--output", nargs="+", choices=OUTPUTS, default=["dds", "mcap", "udp"])
    parser.add_argument("--load", type=int, nargs="+", default=[0, 2], help="processes that compute all the time")
    parser.add_argument("--send", type=int, nargs=2, metavar=("PORT", "COUNT"), help=argparse.SUPPRESS)
    parser.add_argument("--watch", type=int, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.watch is not None:
        fifo(95)
        watch(given.watch)
    if given.send:
        fifo(80)
        send(*given.send)
        return
    if missing("cyclone"):
        raise SystemExit(f"{missing('cyclone')} are not installed")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        calibration = folder / "c.json"
        save_calibration(
            small_calibration(patches=(sheet(ROWS, COLUMNS, 0.004),), response=Response((0.0, 0.01), (0.0, 4095.0))),
            calibration,
        )
        reader = build("cyclone", folder)
        print(f"{given.seconds} s; other processes of this machine: load {os.getloadavg()[0]:.1f}")
        print("output  priority  load   gaps   p50 us   p99 us    max us  CPU us  pauses  p99 calm")
        for busy in given.load:
            for output in given.output:
                for is_real_time in (True, False):
                    with load(busy):
                        row = measure(folder, calibration, reader, output, is_real_time, 1000 * given.seconds)
                    name = "real-time" if is_real_time else "normal"
                    print(f"{output:7} {name:9} {busy:4d} {row}", flush=True)


if __name__ == "__main__":
    main()
