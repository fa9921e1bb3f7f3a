"""Use a calibration in a controller: readings in; contacts, wrench, CoP and supporting polygon out.

    python examples/controller.py CALIBRATION RECORDING.csv

It needs only NumPy and ``skin_calib_addon.runtime``.
"""

import csv
import sys
from collections import Counter

import numpy as np

from skin_calib_addon.runtime import load


def main(calibration_file, recording_file):
    """Print every tenth frame: contacts, and for a sole its CoP."""
    skin = load(calibration_file)
    with open(recording_file, newline="") as file:
        recorded = list(csv.DictReader(file))
    untrusted = Counter()
    for k, row in enumerate(recorded):
        readings = np.array([int(row[f"channel_{c}"]) for c in range(skin.reading_length)], np.uint8)
        frame = skin.update(readings, float(row["time"]))
        untrusted.update(frame.trusted.why)
        if k % 10:
            continue
        print(f"{frame.time:.2f} s", {True: "touched", False: "free", None: "nothing known"}[frame.touched])
        for c in frame.contacts:
            position = " ".join(f"{x * 1e3:7.2f}" for x in c.position)
            normal = " ".join(f"{x:6.3f}" for x in c.normal)
            print(f"  contact {c.number}: {c.force:5.2f} N at {position} mm, normal {normal}, {len(c.taxels)} taxels")
        if frame.cop is not None and frame.trusted.point:
            print(f"  CoP {frame.cop * 1e3} mm, {frame.polygon.guaranteed.margin(frame.cop) * 1e3:.1f} mm inside")
    for flag, count in untrusted.items():
        print(f"not trusted, {flag}: {count} of {len(recorded)} frames")


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(*sys.argv[1:])
