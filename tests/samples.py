"""Small calibrations for tests, built from formulas: a sheet on a cylinder, boards on a plane."""

import numpy as np

from skin_calib_addon.calibration import LinkCalibration, MeshSource, Patch, Response, SurfaceModel, TaxelArray, Trusted
from skin_calib_addon.common.surface_errors import DistanceStatistics, SurfaceErrors

RADIUS, BOARD_PITCH = 0.035, 0.02775  # [m]
ERRORS = SurfaceErrors(DistanceStatistics(1e-5, 2e-5, 1e-4), DistanceStatistics(1.5e-5, 2.5e-5, 1.1e-4), 1.1e-4)


def small_calibration(rows=2, columns=3, pitch=0.01, **changes):
    """Return a sheet of ``rows`` x ``columns`` on a forearm, and two hexagonal boards on a plane."""
    fields = {
        "link": "forearm",
        "mesh": MeshSource("forearm.stl", "0" * 64, 1000, 1996),
        "surfaces": (cylinder(), plane()),
        "patches": (sheet(rows, columns, pitch), boards(first_channel=rows * columns)),
        "response": Response((0.0, 0.25, -0.001)),
        "generator": "tests",
        "extra": {"x_note": {"author": "前腕", "numbers": [1, 2.5, None, True]}},
    }
    return LinkCalibration(**{**fields, **changes})


def cylinder():
    """Return a tube along z from 0 to 0.2 m, closed in v, with a radius of about `RADIUS`."""
    angle = 2 * np.pi * np.arange(8 + 3) / 8
    angle[8:] = angle[:3]  # the first three again, exactly
    ring = np.stack([RADIUS * np.cos(angle), RADIUS * np.sin(angle), 0 * angle], axis=1)
    net = ring + np.array([0, 0, 0.1])[None] * np.arange(3)[:, None, None]
    knots_v = np.arange(-3, 8 + 4) / 8
    return SurfaceModel("tube", (2, 3), np.array([0, 0, 0, 1, 1, 1.0]), knots_v, net, (False, True), ERRORS)


def plane():
    """Return the square from (0, 0, -0.1) to (0.1, 0.1, -0.1) m, with an upward normal, a boundary and a hole."""
    net = 0.1 * np.array([[[0, 0, -1], [0, 1, -1]], [[1, 0, -1], [1, 1, -1]]])
    knots = np.array([0, 0, 1, 1.0])
    loop = np.array(((0.0, 0.0), (1.0, 0.0), (1.0, 0.8), (0.0, 1.0)))
    trusted = Trusted((loop,), ("111", "10-"))
    return SurfaceModel("plane", (1, 1), knots, knots, net, (False, False), ERRORS, {"x_material": "PLA"}, trusted)


def sheet(rows, columns, pitch):
    """Return square cells on the cylinder, with rows along its circumference."""
    row, column = (a.ravel() for a in np.indices((rows, columns)))
    angle = column * pitch / RADIUS
    normals = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    tangents = np.stack([-np.sin(angle), np.cos(angle), 0 * angle], axis=1)
    positions = RADIUS * normals + np.array([0, 0, 1.0]) * ((row + 0.5) * pitch)[:, None]
    across = np.cross(normals, tangents)
    signs = ((-1, -1), (1, -1), (1, 1), (-1, 1))
    corners = np.stack([positions + pitch / 2 * (i * tangents + j * across) for i, j in signs], axis=1)
    name = {(r, c): f"s{r}.{c}" for r, c in zip(row.tolist(), column.tolist())}
    near = [[(r - 1, c), (r + 1, c), (r, c - 1), (r, c + 1)] for r, c in name]
    n = rows * columns
    taxels = TaxelArray(
        ids=tuple(name.values()),
        channels=np.arange(n),
        index=np.stack([row, column], axis=1),
        uv=np.stack([positions[:, 2] / 0.2, angle / (2 * np.pi)], axis=1),
        positions_link=positions,
        normals_link=normals,
        tangents_link=tangents,
        corners_link=corners,
        areas=np.full(n, pitch**2),
        neighbours=tuple(tuple(name[place] for place in places if place in name) for places in near),
        quality={"strain": np.linspace(-0.01, 0.01, 3 * n).reshape(n, 3)},
    )
    return Patch("sheet", "sheet", "tube", (rows, columns), (pitch, pitch), taxels)


def boards(first_channel=0):
    """Return two adjacent hexagonal boards on the plane."""
    fields = {
        "ids": ("h0", "h1"),
        "index": np.array([[0, 0], [1, -1]]),
        "neighbours": (("h1",), ("h0",)),
        "quality": {"gap": np.array([0.0, 1e-4]), "tilt": np.array([0.0, 0.02])},
    }
    ports = {"x_ports": [[1, 0, 0, 0], [0, 0, 1, 0]]}
    positions = np.array([[0.03, 0.05, -0.1], [0.03 + BOARD_PITCH, 0.05, -0.1]])
    taxels = hexagons(positions, first_channel, **fields)
    return Patch("boards", "hexagons", "plane", (1, 2), (BOARD_PITCH, BOARD_PITCH), taxels, ports)


def seven_boards(first_channel=0):
    """Return a hexagonal board and its six neighbours on the plane, with ports."""
    # the centre, then the sides, starting at the tangent
    cells = [(0, 0), (1, 0), (0, 1), (-1, 1), (-1, 0), (0, -1), (1, -1)]
    positions = np.array(
        [[0.05 + BOARD_PITCH * (q + r / 2), 0.05 + BOARD_PITCH * r * 0.75**0.5, -0.1] for q, r in cells]
    )
    ids = {cell: f"b{cell[0]}.{cell[1]}" for cell in cells}
    ports = tuple(tuple(ids.get((q + a, r + b)) for a, b in cells[1:]) for q, r in cells)
    fields = {
        "ids": tuple(ids.values()),
        "index": np.array(cells),
        "neighbours": tuple(tuple(other for other in row if other) for row in ports),
        "ports": ports,
    }
    taxels = hexagons(positions, first_channel, **fields)
    return Patch("flower", "hexagons", "plane", (3, 3), (BOARD_PITCH, BOARD_PITCH), taxels)


def hexagons(positions, first_channel, **fields):
    """Return the taxels of boards on the plane."""
    side, count = 0.0163, len(positions)
    angle = np.deg2rad(30 + 60 * np.arange(6))
    ring = side * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    return TaxelArray(
        channels=first_channel + np.arange(count),
        uv=positions[:, :2] / 0.1,
        positions_link=positions,
        normals_link=np.array([[0, 0, 1.0]] * count),
        tangents_link=np.array([[1.0, 0, 0]] * count),
        corners_link=positions[:, None] + ring,
        areas=np.full(count, 1.5 * np.sqrt(3) * side**2),
        **fields,
    )
