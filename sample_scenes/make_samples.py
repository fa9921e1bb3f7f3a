"""Make the sample scenes: a mesh, a plan, and with Blender's module a .blend file that is ready to fit.

python sample_scenes/make_samples.py
"""

import json
import os
import sys
from math import radians
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent), str(HERE.parent / "examples")]

import shapes  # noqa: E402

Z_AXIS = {"point": [0.0, 0.0, 0.0], "direction": [0.0, 0.0, 1.0]}
# From the intensity of the sheet's 8-bit electronics to newtons.
RESPONSE = {"kind": "polynomial", "coefficients": [0.0, 0.02, 0.00005]}


def sheet(name, rows, columns, direction, origin="center", pitch=0.01):
    """Return the plan of a sheet of square cells."""
    return {
        "name": name,
        "kind": "sheet",
        "rows": rows,
        "columns": columns,
        "pitch": [pitch, pitch],
        "origin": origin,
        "direction": direction,
    }


PLANS = {
    "wrist": {
        "grid": {"kind": "tube", "n": 10, "m": 10, "axis": "auto", "margin": 0.002},
        "skins": [sheet("wrist", 6, 20, [0.0, 1.0, 0.0])],
        "response": RESPONSE,
    },
    "sole": {
        "grid": {"kind": "patch", "n": 14, "lines": 10, "normal": [0.0, 0.0, -1.0], "margin": 0.003},
        "skins": [sheet("sole", 8, 20, [1.0, 0.0, 0.0])],
    },
    "edge": {
        "grid": {"kind": "tube", "n": 6, "lines": 40, "axis": Z_AXIS, "margin": 0.002},
        "skins": [sheet("edge", 8, 10, [0.97, 0.23, 0.0], [0.0078, -0.0332, 0.025])],
    },
}


def write_plan(name):
    """Write mesh and plan of one sample."""
    mesh = getattr(shapes, name)()
    mesh.export(HERE / f"{name}.ply", vertex_normal=False)
    head = {"format": "skin-plan", "version": 1, "link": f"sample_{name}", "mesh": f"{name}.ply", "unit": "m"}
    text = json.dumps(head | {"cover": {"shell": "outer", "cuts": []}} | PLANS[name], indent=2)
    (HERE / f"{name}.plan.json").write_text(text + "\n")


def write_scene(name):
    """Write the plan as a scene in millimetres; the link is selected and fills the view."""
    import bpy
    from mathutils import Euler, Vector

    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.context.preferences.filepaths.save_version = 0  # no backups
    bpy.ops.skin_calib.import_plan(filepath=str(HERE / f"{name}.plan.json"))
    bpy.context.scene.unit_settings.length_unit = "MILLIMETERS"
    corners = [Vector(corner) for corner in bpy.context.object.bound_box]
    turn = Euler((radians(130 if name == "sole" else 65), 0, radians(45)))  # the view of a sole is from below
    for view in (a.spaces.active for s in bpy.data.screens for a in s.areas if a.type == "VIEW_3D"):
        view.clip_start, view.clip_end, view.show_region_ui = 0.001, 10, True
        view.region_3d.view_location = (corners[0] + corners[6]) / 2
        view.region_3d.view_distance = 1.6 * (corners[6] - corners[0]).length
        view.region_3d.view_rotation = turn.to_quaternion()
    # A copy: the current scene of Blender would keep the path of this folder.
    bpy.ops.wm.save_as_mainfile(filepath=str(HERE / f"{name}.blend"), compress=True, copy=True)


def main():
    """Write all samples."""
    for name in PLANS:
        write_plan(name)
    os.environ["HOME"] = "/"  # Blender writes the home folder of the user into a scene
    try:
        import bpy  # noqa: F401
    except ImportError:
        print("The bpy module is not installed. Meshes and plans are written; the .blend files do not change.")
        return
    from batch_fit import enable_from_checkout

    enable_from_checkout()
    for name in PLANS:
        write_scene(name)


if __name__ == "__main__":
    main()
