"""Simulate measurements of the sample sheet with 8-bit electronics, and write them next to this program.

    python examples/make_recording.py CALIBRATION

``wrist_recording.csv`` is a finger that slides over the sheet. Its pressure is that of Hertz on a disc of 9 mm radius,
with 1 to 6 N. Each row has the time and one intensity for each channel. The last four columns are the true position and
force. ``wrist_rest.csv`` has the intensities of one second without contact, ``wrist_measurements.csv`` those of known
forces on any taxel, and ``wrist_taxels.txt`` the taxels as the iCub writes them.
"""

import csv
import sys
from pathlib import Path

import numpy as np

from skin_calib_addon.calibration import load_calibration

HERE = Path(__file__).resolve().parent
FRAMES = 60  # rows of the recording
REST_FRAMES = 100  # in one second
RADIUS = 0.009  # of the contact [m]
NOISE = 0.6  # standard deviation [intensity]


def press(positions, point, force):
    """Return the force on each taxel of a press of ``force`` newtons at ``point``, with an elliptic pressure."""
    distance = np.linalg.norm(positions - point, axis=1) / RADIUS
    pressure = np.sqrt(np.maximum(1 - distance**2, 0))
    return force * pressure / pressure.sum()


def intensity(forces, response):
    """Return the intensities whose response is ``forces``, rounded to 8 bits."""
    table = np.arange(0, 255.001, 0.01)
    exact = np.interp(forces, response.newtons(table), table)
    noise = np.random.default_rng(7).normal(0, NOISE, exact.shape)
    return np.clip(np.rint(exact + noise), 0, 255).astype(np.uint8)


def write(name, header, rows):
    """Write a table."""
    with open(HERE / name, "w", newline="") as file:
        csv.writer(file).writerows([header, *rows])


def main(calibration_file):
    """Write the files."""
    calibration = load_calibration(calibration_file)
    taxels = calibration.patches[0].taxels
    rows, columns = calibration.patches[0].shape
    positions = taxels.positions_link.reshape(rows, columns, 3)
    progress = np.linspace(0, 1, FRAMES)
    along = 2 + progress * (columns - 5)  # from one side of the sheet to the other, rising over its rows
    across = 1 + progress * (rows - 3)
    k, j = across.astype(int), along.astype(int)
    a, b = (across - k)[:, None], (along - j)[:, None]
    points = (1 - a) * ((1 - b) * positions[k, j] + b * positions[k, j + 1])
    points += a * ((1 - b) * positions[k + 1, j] + b * positions[k + 1, j + 1])
    forces = 3.5 - 2.5 * np.cos(2 * np.pi * progress)
    loads = np.array([press(taxels.positions_link, p, f) for p, f in zip(points, forces)])
    raw = intensity(loads, calibration.response)
    times = [f"{i / 100:.2f}" for i in range(REST_FRAMES)]
    header = ["time", *(f"channel_{c}" for c in taxels.channels)]
    truth = [[f"{x:.6f}" for x in point] + [f"{force:.4f}"] for point, force in zip(points, forces)]
    rows = ([time, *row, *true] for time, row, true in zip(times, raw, truth))
    write("wrist_recording.csv", [*header, "true_x", "true_y", "true_z", "true_force"], rows)
    rest = intensity(np.zeros((REST_FRAMES, len(taxels.ids))), calibration.response)
    write("wrist_rest.csv", header, ([time, *row] for time, row in zip(times, rest)))
    known = np.concatenate((np.linspace(0, 8, 40), np.linspace(8, 0, 40)))
    read = intensity(known, calibration.response)
    write("wrist_measurements.csv", ["reading", "force"], ([r, f"{f:.3f}"] for r, f in zip(read, known)))
    lines = (np.concatenate(pair) for pair in zip(taxels.positions_link, taxels.normals_link))
    text = "\n".join(" ".join(f"{x:.6f}" for x in line) for line in lines)
    (HERE / "wrist_taxels.txt").write_text(f"name sample_wrist\n[calibration]\n{text}\n")


if __name__ == "__main__":
    main(*sys.argv[1:])
