"""Make up touches of the sample's sheet as a probe would measure them, and what ``touches`` draws of them.

    python examples/make_touches.py

The sheet lies 3 mm along its rows and 2 mm across them from where the plan has it, turned by 1.7 degrees; each touch is
anywhere in the cell of the taxel that feels it, the probe's tip .7 mm above; the wires of two taxels are changed about.
Leaves ``examples/wrist_touches.csv`` and ``docs/touches.png``.
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
SHIFT, TURN = (0.003, 0.002), 0.03  # of the sheet [m], [rad]
TOUCHES, HEIGHT, SWAPPED = 80, 0.0007, (7, 30)


def main() -> None:
    """Lay the sheet where it really is, touch it, and compare."""
    plan = load_plan(PLAN)
    result = calibrate(plan)
    (skin,), ids = plan.skins, result.calibration.patches[0].taxels.ids
    taxels = result.calibration.patches[0].taxels
    normal, tangent = taxels.normals_link[0], taxels.tangents_link[0]
    origin = taxels.positions_link[0] + SHIFT[0] * tangent + SHIFT[1] * np.cross(normal, tangent)
    direction = Rotation.from_rotvec(TURN * normal).apply(np.array(tangent))
    (placed,) = place_all((replace(skin, origin=tuple(origin), direction=tuple(direction)),), result.fit)
    real, rng = placed.patch.taxels, np.random.default_rng(0)
    rows = rng.integers(0, len(ids), TOUCHES)
    along, across = rng.uniform(-0.5, 0.5, (2, TOUCHES, 1)) * skin.lattice.pitch[0]
    normals, tangents = real.normals_link[rows], real.tangents_link[rows]
    points = real.positions_link[rows] + along * tangents + across * np.cross(normals, tangents) + HEIGHT * normals
    felt = [ids[row] for row in rows]
    a, b = SWAPPED
    felt[a], felt[b] = felt[b], felt[a]
    lines = [f"{name},{x:.5f},{y:.5f},{z:.5f}" for name, (x, y, z) in zip(felt, points.tolist())]
    TABLE.write_text("\n".join(["taxel,x,y,z", *lines]) + "\n")
    skin_calib(["touches", str(PLAN), str(TABLE), "--picture", str(ROOT / "docs" / "touches.png")])


if __name__ == "__main__":
    main()
