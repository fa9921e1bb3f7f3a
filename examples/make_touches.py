"""Simulate touches of the sample sheet as a probe measures them, and draw the picture of ``skin-calib touches``.

    python examples/make_touches.py

Cell (0, 0) of the real sheet is 3 mm along its row and 2 mm across from its planned position, and the sheet is rotated
there by 1.7 degrees. Each touch is at a random point of the cell of its taxel, with the tip of the probe 0.7 mm above
it. The wires of two taxels are swapped. The results are ``examples/wrist_touches.csv`` and ``docs/touches.png``.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from skin_calib_addon.cli import main as skin_calib
from skin_calib_addon.pipeline import calibrate
from skin_calib_addon.pipeline.place_skins import place_all
from skin_calib_addon.plan import load_plan

ROOT = Path(__file__).resolve().parent.parent
PLAN, TABLE = ROOT / "sample_scenes" / "wrist.plan.json", ROOT / "examples" / "wrist_touches.csv"
SHIFT = (0.003, 0.002)  # of cell (0, 0), along and across its row [m]
ROTATION = 0.03  # of the sheet about the normal there [rad]
TOUCHES = 80
TIP_HEIGHT = 0.0007  # of the probe over the surface [m]
SWAPPED = (7, 30)  # touches whose taxels are swapped


def main() -> None:
    """Write the touches, and compare them with the plan."""
    TABLE.write_text(table())
    skin_calib(["touches", str(PLAN), str(TABLE), "--picture", str(ROOT / "docs" / "touches.png")])


def table() -> str:
    """Place the sheet at its real position, and touch it."""
    plan = load_plan(PLAN)
    result = calibrate(plan)
    (skin,), ids = plan.skins, result.calibration.patches[0].taxels.ids
    taxels = result.calibration.patches[0].taxels
    normal, tangent = taxels.normals_link[0], taxels.tangents_link[0]
    origin = taxels.positions_link[0] + SHIFT[0] * tangent + SHIFT[1] * np.cross(normal, tangent)
    direction = Rotation.from_rotvec(ROTATION * normal).apply(np.array(tangent))
    moved = replace(skin, origin=tuple(origin), direction=tuple(direction))
    (placed,) = place_all(replace(plan, skins=(moved,)), result.fits)
    real, rng = placed.patch.taxels, np.random.default_rng(0)
    rows = rng.integers(0, len(ids), TOUCHES)
    along, across = rng.uniform(-0.5, 0.5, (2, TOUCHES, 1)) * skin.lattice.pitch[0]
    normals, tangents = real.normals_link[rows], real.tangents_link[rows]
    points = real.positions_link[rows] + along * tangents + across * np.cross(normals, tangents) + TIP_HEIGHT * normals
    names = [ids[row] for row in rows]
    a, b = SWAPPED
    names[a], names[b] = names[b], names[a]
    lines = [f"{name},{x:.5f},{y:.5f},{z:.5f}" for name, (x, y, z) in zip(names, points.tolist())]
    return "\n".join(["taxel,x,y,z", *lines]) + "\n"


if __name__ == "__main__":
    main()
