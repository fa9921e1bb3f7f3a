"""Compare the loop of `cpp/examples/run.cpp` with that in Python: the same packets must give the same frames.

    python -m cpp.tests.run [--program build/cpp/run]

Sets, numbers, flags and forces are equal to the bit, sums to 1e-12 of the sum of the forces, polygons to a nanometre.
Over DDS, an independent reader must get the same frames to the last digit, and the layout of Python.
"""

import argparse
import json
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from skin_calib_addon.calibration import load_calibration
from skin_calib_addon.live.dds import LOOPBACK
from skin_calib_addon.messages import decode, frame_message, layout_message
from skin_calib_addon.messages.content import seconds
from skin_calib_addon.messages.packet import Decoder, packet
from skin_calib_addon.runtime import load
from tests.live.programs import build, missing
from tests.live.running import N, Process, Receiver, flat, free_domain, free_port, packets, rows, same, send, sole

COUNT = 1000
CLOSE = 1e-12  # [1] difference of sums, relative to what they add
LENGTH = 1e-8  # [m] difference of corners of polygons
WORDS = ("problem", "reason")  # sentences of the languages differ; only whether there is one is compared


def compare(name: str, python: Any, cpp: Any, scale: float) -> None:
    """Raise ValueError if two values of a message differ."""
    if isinstance(python, dict):
        limit = LENGTH if name in ("outer", "nominal", "guaranteed") else scale
        for key in python:
            compare(key, python[key], cpp[key], limit)
        return
    if isinstance(python, (list, tuple)) and python and isinstance(python[0], dict):
        if len(python) != len(cpp):
            raise ValueError(f"{name}: {len(python)} and {len(cpp)}")
        for a, b in zip(python, cpp):
            compare(name, a, b, scale)
        return
    if name in WORDS:
        is_same = bool(python) == bool(cpp)
    elif isinstance(python, (str, bool, int, np.bool_)) or name in ("taxels", "forces", "flags", "ids"):
        is_same = np.array_equal(np.asarray(python), np.asarray(cpp), equal_nan=name == "forces")
    else:
        a, b = np.ravel(python).astype(float), np.ravel(cpp).astype(float)
        is_same = a.shape == b.shape and np.allclose(a, b, rtol=CLOSE, atol=scale, equal_nan=True)
    if not is_same:
        raise ValueError(f"{name}: {python} and {cpp}")


def faulty(rng: np.random.Generator, table: np.ndarray) -> list[bytes]:
    """Return packets of 8, 12 and 16 bits with each fault, and of a sender that restarts twice."""
    sent = []
    for k, one in enumerate(packets(table[:700], bits=12) + packets(table[700:], session=1, start=5 * 10**9)):
        fault = rng.random()
        if fault < 0.02:
            continue
        changed = bytearray(one)
        if fault < 0.04:
            changed[int(rng.integers(len(changed)))] ^= 16
        elif fault < 0.06:
            del changed[int(rng.integers(1, len(changed))) :]
        sent += [bytes(changed)] * (2 if fault > 0.98 else 1)
        if fault > 0.97 and k > 3:
            sent += [rng.bytes(50), sent[-4]]
    again = packets(np.minimum(table[:200], 255), session=1, start=9 * 10**9, bits=8)  # with the same session
    return sent + again


def over_dds(folder: Path, command: list[Any], port: int, sent: list[bytes], count: int) -> list[dict[str, Any]]:
    """Return layout and frames as the reader in C prints them."""
    with free_domain() as domain:
        of_dds = {"CYCLONEDDS_URI": LOOPBACK, "ROS_DOMAIN_ID": domain}
        program = build("cyclone", folder)

        def started(name: str) -> Process:
            return Process(folder, name, program, domain, "left_sole", "full", **of_dds)

        with started("reader") as reader, Process(folder, "dds", *command, "dds", **of_dds) as run:
            reader.wait_for(lambda reader: "matched" in reader.out)
            send(port, sent, 4e-3)
            reader.wait_for(lambda reader: reader.out.count('"SkinFrame"') == count)
            with started("late") as late:  # the layout is latched
                late.wait_for(lambda late: "TaxelLayout" in late.out)
            assert run.stop() == 0 and "unsent 0\n" in run.out, run.out
            found = [json.loads(line, parse_int=float) for line in reader.out.splitlines()]
    return [one for one in found if one["message"] in ("TaxelLayout", "SkinFrame")]


def main() -> None:
    """Send packets, and compare."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--program", type=Path, default=Path("build/cpp/run"))
    program = parser.parse_args().program.resolve()
    with tempfile.TemporaryDirectory() as name, Receiver() as receiver:
        folder, port = Path(name), free_port()
        calibration, noise = sole(folder), folder / "noise.json"
        skin, table = load(calibration), rows(COUNT)
        skin.tare(table[:50], accept=True)
        skin.save_noise(noise)
        skin, sent, decoder = load(calibration, noise=noise), faulty(np.random.default_rng(1), table), Decoder()
        expected = []
        for one in sent:
            for r in decoder.feed(one, True):
                expected.append(
                    frame_message(skin.link, skin.update(r.values, r.time), r.cycle, decoder.lost, skin.checksum)
                )
        command = [program, calibration, noise, port]
        with Process(folder, "run", *command, receiver.port) as run:
            run.wait_for(lambda run: "priority" in run.err)
            send(port, [packet(table[0], 0, 2**63), *sent], 1e-4)  # no message can have this time
            frames = [decode("SkinFrame", data) for data in receiver.get(len(expected))]
            assert run.stop() == 0
        for k, (python, cpp) in enumerate(zip(expected, frames, strict=True)):
            try:
                scale = CLOSE * max(np.nansum(python["forces"]), 1.0)
                compare("frame", python, cpp, scale)
            except ValueError as problem:
                raise SystemExit(f"frame {k} of {len(frames)} differs: {problem}") from problem
        counts = dict(line.split() for line in run.out.splitlines())
        for name in ("received", "lost", "old", "restarts"):
            assert int(counts[name]) == getattr(decoder, name), (name, counts, vars(decoder))
        assert (
            counts["unsent"] == "0" and decoder.restarts == 2 and int(counts["damaged"]) > 10 < int(counts["skipped"])
        )
        print(f"{len(frames)} frames of {len(sent)} packets of {N} channels are equal; counted: {counts}")
        if missing("cyclone"):
            print(f"not compared over DDS: {missing('cyclone')} are not installed")
            return
        layout, *printed = over_dds(folder, command, port, sent, len(frames))
        skin = load(calibration, noise=noise)
        expected_layout = layout_message(load_calibration(calibration), skin, seconds(frames[0]["header"]["stamp"]))
        compare("layout", flat(expected_layout), flat(layout), 0.0)
        assert all(same(*pair) for pair in zip(frames, printed, strict=True))
        print("layout and frames over DDS are equal, too")


if __name__ == "__main__":
    main()
