"""Make the two covered links of the biped, sole and forearm, and the plans of their skins.

    python control/examples/shapes.py

Meshes and plans are in ``control/examples/robot/``. The origin of the sole is the ankle, that of the forearm the elbow.
"""

import json
from pathlib import Path

import numpy as np
import trimesh

HERE = Path(__file__).resolve().parent / "robot"
# Of the sole [m]: half length and half width, radius of its outline's corners, radius of its lower edge, height and
# position of its centre relative to the ankle.
HALF_SIZE = np.array((0.1, 0.05))
CORNER, EDGE = 0.006, 0.003
ANKLE_HEIGHT, FORWARD = 0.07, 0.02
PITCH = 0.01  # of the taxels [m]
SOLE_CELLS = (9, 19)  # rows and columns
ELBOW_RADIUS, WRIST_RADIUS, FOREARM_LENGTH = 0.042, 0.030, 0.22  # [m]
FOREARM_CELLS = (16, 18)  # rows along, columns around
RANGE = 0.1  # of the proximity sensors [m]
RANGE_COUNTS = 4000.0  # reading of a proximity sensor at contact [count]
FULL_SCALE, COUNTS = 120.0, 4095  # force of a cell at the highest count [N], highest count of 12 bits

PROXIMITY = {
    "name": "proximity",
    "unit": "m",
    "response": {"kind": "table", "readings": [0.0, RANGE_COUNTS], "forces": [RANGE, 0.0]},
}


def sole() -> trimesh.Trimesh:
    """Return the underside of the foot: flat, with rounded corners, and an edge that bends up."""
    around, rings, arc = 160, 16, 8
    angle = (np.arange(around) + 0.5) * 2 * np.pi / around
    # The outline is a rounded rectangle: a rectangle of the corners' centres and a circle around each.
    inner = HALF_SIZE - CORNER
    outward = np.column_stack((np.cos(angle), np.sin(angle)))
    centres = inner * np.clip(outward * 1.8, -1, 1)
    flat = [(centres + (CORNER - EDGE) * outward) * part for part in np.linspace(0, 1, rings)[1:]]
    bends = np.linspace(0, np.pi / 2, arc)[1:]
    rim = [centres + (CORNER - EDGE + EDGE * np.sin(bend)) * outward for bend in bends]
    heights = [0.0] * len(flat) + [EDGE * (1 - np.cos(bend)) for bend in bends]
    vertices = [np.array([[0.0, 0.0, 0.0]])]
    vertices += [np.column_stack((ring, np.full(around, up))) for ring, up in zip((*flat, *rim), heights)]
    k = np.arange(around)
    after = (k + 1) % around
    faces = [np.column_stack((np.zeros(around, int), 1 + after, 1 + k))]
    for ring in range(len(heights) - 1):
        p, q = 1 + ring * around + k, 1 + ring * around + after
        faces += [np.column_stack((p, q, q + around)), np.column_stack((p, q + around, p + around))]
    points = np.concatenate(vertices) + (FORWARD, 0.0, -ANKLE_HEIGHT)
    return trimesh.Trimesh(points, np.concatenate(faces), process=False)


def forearm() -> trimesh.Trimesh:
    """Return a tapered tube along -z, from the elbow to the wrist."""
    around, along = 72, 34
    angle, part = np.meshgrid(np.arange(around) * 2 * np.pi / around, np.linspace(0, 1, along))
    radius = ELBOW_RADIUS + (WRIST_RADIUS - ELBOW_RADIUS) * part
    points = np.stack((radius * np.cos(angle), radius * np.sin(angle), -0.02 - FOREARM_LENGTH * part), axis=-1)
    a, b = np.meshgrid(np.arange(along - 1), np.arange(around), indexing="ij")
    p, q = (a * around + b).ravel(), (a * around + (b + 1) % around).ravel()
    faces = np.concatenate((np.column_stack((p, q + around, q)), np.column_stack((p, p + around, q + around))))
    return trimesh.Trimesh(points.reshape(-1, 3), faces, process=False)


def proximity(rows: int, columns: int, name: str) -> dict:
    """Return the sensors of distance: one for nine taxels, as on skins that have one per board."""
    middles = [f"{name}.{row}.{column}" for row in range(1, rows, 3) for column in range(1, columns, 3)]
    return PROXIMITY | {"channels": {id: channel for channel, id in enumerate(middles)}}


def plans() -> dict[str, dict]:
    """Return the plan of each covered link."""
    response = {"kind": "polynomial", "coefficients": [0.0, FULL_SCALE / COUNTS]}
    face = {"kind": "patch", "n": 10, "lines": 8, "normal": [0.0, 0.0, -1.0], "margin": 0.003}
    tube = {
        "kind": "tube",
        "n": 8,
        "lines": 12,
        "axis": {"point": [0.0, 0.0, 0.0], "direction": [0.0, 0.0, -1.0]},
        "margin": 0.004,
    }
    sheets = {
        "sole": (face, SOLE_CELLS, [1.0, 0.0, 0.0]),
        "forearm": (tube, FOREARM_CELLS, [0.0, 1.0, 0.0]),
    }
    return {
        name: {
            "format": "skin-plan",
            "version": 1,
            "link": name,
            "mesh": f"{name}.ply",
            "unit": "m",
            "cover": {"shell": "outer", "cuts": []},
            "grid": grid,
            "skins": [
                {
                    "name": name,
                    "kind": "sheet",
                    "rows": rows,
                    "columns": columns,
                    "pitch": [PITCH, PITCH],
                    "origin": "center",
                    "direction": direction,
                }
            ],
            "response": response,
            "modalities": [proximity(rows, columns, name)],
        }
        for name, (grid, (rows, columns), direction) in sheets.items()
    }


def main() -> None:
    """Write meshes and plans."""
    HERE.mkdir(exist_ok=True)
    for name, plan in plans().items():
        {"sole": sole, "forearm": forearm}[name]().export(HERE / f"{name}.ply", vertex_normal=False)
        (HERE / f"{name}.plan.json").write_text(json.dumps(plan, indent=2) + "\n", "utf-8")


if __name__ == "__main__":
    main()
