"""What a controller does with a calibration: readings in, contacts out.

    python examples/controller.py CALIBRATION RECORDING.csv

Needs NumPy and ``skin_calib_addon.runtime`` alone.
"""

import csv
import sys

import numpy as np

from skin_calib_addon.runtime import load


def main(calibration_file, recording_file):
    """Print every tenth frame's contacts."""
    skin = load(calibration_file)
    with open(recording_file, newline="") as file:
        frames = list(csv.DictReader(file))
    print("time [s]   force [N]   position [mm]              normal                  taxels")
    for frame in frames[::10]:
        readings = np.array([int(frame[f"channel_{c}"]) for c in range(skin.reading_length)], np.uint8)
        for contact in skin.update(readings, float(frame["time"])).contacts:
            place = " ".join(f"{x * 1e3:7.2f}" for x in contact.position)
            normal = " ".join(f"{x:6.3f}" for x in contact.normal)
            print(f"{frame['time']:>8} {contact.force:10.2f}   {place}   {normal} {len(contact.taxels):8}")


if __name__ == "__main__":
    main(*sys.argv[1:])
