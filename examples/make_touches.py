"""Simulate touches of the sample sheet as a probe measures them, and draw the picture of ``skin-calib touches``.

    python examples/make_touches.py

Cell (0, 0) of the real sheet is 3 mm along its row and 2 mm across from its planned position, and the sheet is rotated
there by 1.7 degrees. Each touch is at a random point of the cell of its taxel, with the tip of the probe 0.7 mm above
it. The wires of two taxels are swapped. ``examples/wrist_touches.csv`` and ``docs/touches.png`` are the results, and
``examples/wrist_session.csv``: presses with a finger on the same sheet, measured by a force-torque sensor.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from skin_calib_addon.calibration.model import TaxelArray
from skin_calib_addon.cli import main as skin_calib
from skin_calib_addon.common.arrays import Array
from skin_calib_addon.pipeline import calibrate
from skin_calib_addon.pipeline.place_skins import place_all
from skin_calib_addon.plan import load_plan

ROOT = Path(__file__).resolve().parent.parent
PLAN = ROOT / "sample_scenes" / "wrist.plan.json"
TABLE, SESSION = (ROOT / "examples" / f"wrist_{name}.csv" for name in ("touches", "session"))
SHIFT = (0.003, 0.002)  # of cell (0, 0), along and across its row [m]
ROTATION = 0.03  # of the sheet about the normal there [rad]
TOUCHES = 80
TIP_HEIGHT = 0.0007  # of the probe over the surface [m]
SWAPPED = (7, 30)  # touches whose taxels are swapped
PITCH = 0.01  # of the cells [m]
PRESSES, RATE = 20, 25  # of the session [1, Hz]
ENDS = ((0, 0), (5, 19), (0, 19), (5, 0), (2, 0), (3, 19))  # cells at the ends of the rows and columns
LEAN = 0.12  # of the finger, per axis [rad]
TARE = np.array((0.8, -0.3, 1.9, 0.02, -0.05, 0.01))  # offset of the sensor [N, N m]
SENSOR_NOISE = np.array((0.05, 0.05, 0.05, 0.002, 0.002, 0.002))  # [N, N m]


def main() -> None:
    """Write the touches, and compare them with the plan."""
    real = real_taxels()
    TABLE.write_text(table(real))
    SESSION.write_text(session(real))
    skin_calib(["touches", str(PLAN), str(TABLE), "--picture", str(ROOT / "docs" / "touches.png")])


def real_taxels() -> TaxelArray:
    """Return the taxels of the sheet at its real position."""
    plan = load_plan(PLAN)
    result = calibrate(plan)
    (skin,), taxels = plan.skins, result.calibration.patches[0].taxels
    normal, tangent = taxels.normals_link[0], taxels.tangents_link[0]
    origin = taxels.positions_link[0] + SHIFT[0] * tangent + SHIFT[1] * np.cross(normal, tangent)
    direction = Rotation.from_rotvec(ROTATION * normal).apply(np.array(tangent))
    moved = replace(skin, origin=tuple(origin), direction=tuple(direction))
    (placed,) = place_all(replace(plan, skins=(moved,)), result.fits)
    return placed.patch.taxels


def touched(real: TaxelArray, rows: Array, along: Array, across: Array) -> Array:
    """Return points in cells, at distances (m, 1) from their middles along the rows and across."""
    normals, tangents = real.normals_link[rows], real.tangents_link[rows]
    return real.positions_link[rows] + along * tangents + across * np.cross(normals, tangents)


def table(real: TaxelArray) -> str:
    """Return touches of a probe, each at a random point of the cell of its taxel."""
    rng = np.random.default_rng(0)
    rows = rng.integers(0, len(real.ids), TOUCHES)
    points = touched(real, rows, *(rng.uniform(-0.5, 0.5, (2, TOUCHES, 1)) * PITCH))
    points += TIP_HEIGHT * real.normals_link[rows]
    names = [real.ids[row] for row in rows]
    a, b = SWAPPED
    names[a], names[b] = names[b], names[a]
    lines = [f"{name},{x:.5f},{y:.5f},{z:.5f}" for name, (x, y, z) in zip(names, points.tolist())]
    return "\n".join(["taxel,x,y,z", *lines]) + "\n"


def session(real: TaxelArray) -> str:
    """Return a recording of presses with a finger, first at the ends of the sheet: time, strongest channel, wrench."""
    rng = np.random.default_rng(1)
    cells = [*ENDS, *map(tuple, real.index[rng.permutation(len(real.ids))[: PRESSES - len(ENDS)]].tolist())]
    row_of = {cell: row for row, cell in enumerate(map(tuple, real.index.tolist()))}
    rows = np.array([row_of[cell] for cell in cells])
    points = touched(real, rows, *(rng.uniform(-0.5, 0.5, (2, PRESSES, 1)) * PITCH))
    forces = -real.normals_link[rows] + rng.normal(0, LEAN, (PRESSES, 3))
    forces *= rng.uniform(6, 10, (PRESSES, 1)) / np.linalg.norm(forces, axis=1)[:, None]
    wrenches = np.hstack((forces, np.cross(points, forces)))
    ramp, pause = np.linspace(0, 1, RATE // 5), np.zeros(RATE // 2)
    press = np.concatenate((ramp, np.ones(3 * RATE // 5), ramp[::-1], pause))
    size = np.concatenate((np.zeros(RATE + RATE // 5), np.tile(press, PRESSES)))
    which = np.concatenate((np.zeros(RATE + RATE // 5, int), np.repeat(np.arange(PRESSES), len(press))))
    felt = size[:, None] * wrenches[which] + TARE + rng.normal(0, SENSOR_NOISE, (len(size), 6))
    channels = np.where(size > 0, real.channels[rows][which], 0)
    lines = [
        f"{k / RATE:.2f},{channel}," + ",".join(f"{number:.{3 if c < 3 else 4}f}" for c, number in enumerate(wrench))
        for k, (channel, wrench) in enumerate(zip(channels.tolist(), felt.tolist()))
    ]
    return (
        "\n".join(["# link: sample_wrist", "time [s],channel,fx [N],fy [N],fz [N],tx [N m],ty [N m],tz [N m]", *lines])
        + "\n"
    )


if __name__ == "__main__":
    main()
