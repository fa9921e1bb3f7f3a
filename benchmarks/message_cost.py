"""Cost of messages and MCAP files: CPU time and bytes of a frame with 1260 taxels, by part.

python benchmarks/message_cost.py
"""

import tempfile
import time
from pathlib import Path

import numpy as np

from skin_calib_addon.calibration import Response
from skin_calib_addon.messages import encode, frame_message, reading_message
from skin_calib_addon.messages.mcap_file import McapSkin, RecordedReadings
from skin_calib_addon.runtime import Skin
from tests.samples import sheet, small_calibration

ROWS, COLUMNS = 30, 42
FRAMES, REST = 2000, 100
NOISE = 1.0  # [counts] standard deviation


def readings() -> np.ndarray:
    """Return counts (t, n): noise about a rest of 30, and a press of 69 taxels that moves."""
    rng, (row, column) = np.random.default_rng(0), np.indices((ROWS, COLUMNS))
    counts = rng.normal(30, NOISE, (FRAMES, ROWS * COLUMNS))
    for k in range(REST, FRAMES):
        distance = np.hypot(row - 15, column - 10 - 0.01 * k).ravel()
        counts[k] += np.maximum(500 - 100 * distance, 0)
    return np.rint(np.maximum(counts, 0)).astype(np.uint16)


def cost(function, *arguments) -> float:
    """Return the CPU time of a call for each frame [us]."""
    start = time.process_time()
    function(*arguments)
    return (time.process_time() - start) / FRAMES * 1e6


def main() -> None:
    """Print the table."""
    calibration = small_calibration(
        patches=(sheet(ROWS, COLUMNS, 0.004),), response=Response((0.0, 0.01), (0.0, 4095.0))
    )
    skin, rows = Skin(calibration), readings()
    skin.tare(rows[:REST], accept=True)
    frames = []
    table = [("runtime: update", cost(lambda: frames.extend(skin.update(row, 1e-3 * k) for k, row in enumerate(rows))))]
    of_frames = [frame_message(skin.link, frame, k, 0, skin.checksum) for k, frame in enumerate(frames)]  # computes all
    fill = cost(lambda: [frame_message(skin.link, frame, k, 0, skin.checksum) for k, frame in enumerate(frames)])
    table += [
        ("SkinFrame: fill", fill),
        ("SkinFrame: bytes", cost(lambda: [encode("SkinFrame", m) for m in of_frames])),
    ]
    of_rows = [reading_message(skin.link, row, 1e-3 * k, k) for k, row in enumerate(rows)]
    table.append(("SkinReading: bytes", cost(lambda: [encode("SkinReading", m) for m in of_rows])))
    sizes, path = {}, Path(tempfile.mkdtemp()) / "r.mcap"
    for name, given in (("frames", [{}] * FRAMES), ("frames and readings", [{"force": row} for row in rows])):
        with open(path, "wb") as stream, McapSkin(stream, calibration, skin, 0.0) as file:
            pass
        start = path.stat().st_size  # calibration and layout
        with open(path, "wb") as stream, McapSkin(stream, calibration, skin, 0.0) as file:
            both = cost(lambda file=file, given=given: [file.add(*x, k) for k, x in enumerate(zip(given, frames))])
        table.append((f"MCAP: {name}, all of it", both))
        sizes[name] = (path.stat().st_size - start) / FRAMES
    table.append(("MCAP: read readings", cost(lambda: RecordedReadings(path, skin.link, 2**26))))
    print(f"calibration and layout in the file: {start / 1e6:.2f} MB, once")
    for name, microseconds in table:
        print(f"{name:44} {microseconds:6.0f} us")
    for name, size in sizes.items():
        print(f"{f'MCAP: {name}':44} {size:6.0f} bytes")


if __name__ == "__main__":
    main()
