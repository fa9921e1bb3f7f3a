"""Make the covered link of the planar arm: a tube along x, and the plan of its skin.

python control/examples/planar_skin.py
"""

import json

import numpy as np
import trimesh
from shapes import COUNTS, HERE, RANGE_COUNTS

LINK_LENGTH, RADIUS = 0.25, 0.045  # [m]
ENDS = (0.02, 0.23)  # of the tube [m]
CELLS = (8, 10)  # rows along, columns around
RANGE = 0.12  # of the proximity sensors [m]
FULL_SCALE = 100.0  # force of a cell at the highest count [N]
PLAN = HERE / "planar_link.plan.json"


def tube() -> trimesh.Trimesh:
    """Return the link's surface; its origin is the joint."""
    around, along = 72, 30
    angle, x = np.meshgrid(np.arange(around) * 2 * np.pi / around, np.linspace(*ENDS, along))
    points = np.stack((x, RADIUS * np.cos(angle), RADIUS * np.sin(angle)), axis=-1)
    a, b = np.meshgrid(np.arange(along - 1), np.arange(around), indexing="ij")
    p, q = (a * around + b).ravel(), (a * around + (b + 1) % around).ravel()
    faces = np.concatenate((np.column_stack((p, q, q + around)), np.column_stack((p, q + around, p + around))))
    mesh = trimesh.Trimesh(points.reshape(-1, 3), faces, process=False)
    if (mesh.face_normals * (mesh.triangles_center * (0, 1, 1))).sum(axis=1).mean() < 0:
        mesh.invert()
    return mesh


def plan() -> dict:
    """Return the plan."""
    rows, columns = CELLS
    near = {"kind": "table", "readings": [0.0, RANGE_COUNTS], "forces": [RANGE, 0.0]}
    return {
        "format": "skin-plan",
        "version": 1,
        "link": "planar_link",
        "mesh": "planar_link.ply",
        "unit": "m",
        "cover": {"shell": "outer", "cuts": []},
        "grid": {
            "kind": "tube",
            "n": 8,
            "lines": 12,
            "axis": {"point": [0.0, 0.0, 0.0], "direction": [1.0, 0.0, 0.0]},
            "margin": 0.004,
        },
        "skins": [
            {
                "name": "skin",
                "kind": "sheet",
                "rows": rows,
                "columns": columns,
                "pitch": [0.024, 2 * np.pi * RADIUS / columns],
                "origin": "center",
                "direction": [0.0, 0.0, 1.0],
            }
        ],
        "response": {"kind": "polynomial", "coefficients": [0.0, FULL_SCALE / COUNTS]},
        "modalities": [{"name": "proximity", "unit": "m", "response": near}],
    }


def main() -> None:
    """Write mesh and plan."""
    HERE.mkdir(exist_ok=True)
    tube().export(HERE / "planar_link.ply", vertex_normal=False)
    PLAN.write_text(json.dumps(plan(), indent=2) + "\n", "utf-8")


if __name__ == "__main__":
    main()
