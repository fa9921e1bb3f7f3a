"""Simulate a finger that slides over the sample sheet, and write the readings of its 8-bit electronics.

    python examples/make_recording.py CALIBRATION RECORDING.csv

The pressure of the finger is that of Hertz on a disc of 9 mm radius, with 1 to 6 N. Each row of the recording has the
time and one intensity for each channel. The last four columns are the true position and force.
"""

import csv
import sys

import numpy as np

from skin_calib_addon.calibration import load_calibration

FRAMES = 60  # rows of the recording
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


def main(calibration_file, recording_file):
    """Write the recording."""
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
    with open(recording_file, "w", newline="") as file:
        writer = csv.writer(file)
        channels = (f"channel_{c}" for c in taxels.channels)
        writer.writerow(["time", *channels, "true_x", "true_y", "true_z", "true_force"])
        for i in range(FRAMES):
            writer.writerow([f"{i / 100:.2f}", *raw[i], *(f"{x:.6f}" for x in points[i]), f"{forces[i]:.4f}"])


if __name__ == "__main__":
    main(*sys.argv[1:])
