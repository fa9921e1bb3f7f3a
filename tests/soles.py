"""Flat soles and other skins for tests of the runtime, computed from formulas."""

import numpy as np

from skin_calib_addon.calibration import Patch, Response, TaxelArray
from skin_calib_addon.runtime import Skin
from tests.samples import plane, small_calibration

SIDE = 0.016308  # of a board [m]


def cell_patch(positions, normals, corners, name="sole", radius=0.03, index=None, first_channel=0):
    """Return a patch of cells whose neighbours are those within ``radius``."""
    n = len(positions)
    ids = tuple(f"{name}.{i}" for i in range(n))
    distances = np.linalg.norm(positions[:, None] - positions[None], axis=2)
    neighbours = tuple(tuple(ids[j] for j in range(n) if i != j and distances[i, j] < radius) for i in range(n))
    tangents = np.cross(normals, np.where(np.abs(normals[:, 1:2]) > 0.9, [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]))
    area = np.linalg.norm(
        np.cross(corners[:, 1:-1] - corners[:, :1], corners[:, 2:] - corners[:, :1]).sum(axis=1), axis=1
    )
    taxels = TaxelArray(
        ids,
        np.arange(first_channel, first_channel + n),
        np.column_stack((np.zeros(n, int), np.arange(n))) if index is None else index,
        np.zeros((n, 2)),
        positions,
        normals,
        tangents / np.linalg.norm(tangents, axis=1)[:, None],
        corners,
        area / 2,
        neighbours,
    )
    return Patch(name, "imported", "plane", (1, n), (0.01, 0.01), taxels)


def sole_patch(rows=(8, 9, 8, 9, 8), side=SIDE, height=0.0, **options):
    """Return hexagons in rows below a foot: x forward, z up into the robot, normals down."""
    wide, tall = np.sqrt(3) * side, 1.5 * side
    centres = [
        ((j - (count - 1) / 2) * wide, (i - (len(rows) - 1) / 2) * tall, height)
        for i, count in enumerate(rows)
        for j in range(count)
    ]
    angle = np.deg2rad(30 - 60 * np.arange(6))  # counter-clockwise seen from below
    ring = side * np.stack((np.cos(angle), np.sin(angle), 0 * angle), axis=1)
    positions = np.array(centres)
    return cell_patch(positions, np.tile((0.0, 0.0, -1.0), (len(centres), 1)), positions[:, None] + ring, **options)


def field_patch(rows, columns):
    """Return a flat sheet of square cells of 10 mm, with their rows and columns."""
    row, column = (a.ravel() for a in np.indices((rows, columns)))
    positions = np.column_stack((column * 0.01, row * 0.01, 0 * row))
    ring = 0.005 * np.array([[-1, -1, 0], [-1, 1, 0], [1, 1, 0], [1, -1, 0.0]])
    down = np.tile((0, 0, -1.0), (len(row), 1))
    index = np.column_stack((row, column))
    return cell_patch(positions, down, positions[:, None] + ring, radius=0.011, index=index)


def skin_of(*patches, newtons=(0.0, 1.0), link="left_sole", **options):
    """Return a skin of these patches; a polynomial maps readings to newtons.

    By default every force above 0.2 N is a contact: the readings of these tests have no noise.
    """
    options = {"switch_on": 0.2, "switch_off": 0.1} | options
    calibration = small_calibration(link=link, patches=patches, surfaces=(plane(),), response=Response(newtons))
    return Skin(calibration, **options)


def counting_sole(response=None, **options):
    """Return a sole at default settings whose readings are counts of 0.2 N."""
    response = response or Response((0.0, 0.2))
    calibration = small_calibration(link="sole", patches=(sole_patch(),), surfaces=(plane(),), response=response)
    return Skin(calibration, **options)
