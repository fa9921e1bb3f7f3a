"""Make the sample scenes: a mesh, a plan, and, where Blender's module is there, a .blend that is ready to fit.

python sample_scenes/make_samples.py
"""

import json
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent), str(HERE.parent / "examples")]

import shapes  # noqa: E402

Z_AXIS = {"point": [0.0, 0.0, 0.0], "direction": [0.0, 0.0, 1.0]}
# Intensity of the sheet's 8-bit electronics to newtons.
RESPONSE = {"kind": "polynomial", "coefficients": [0.0, 0.02, 0.00005]}


def sheet(name, rows, columns, direction, origin="center", pitch=0.01):
    """A sheet of square cells."""
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
        "skins": [sheet("wrist", 6, 22, [0.0, 1.0, 0.0])],
        "response": RESPONSE,
    },
    "sole": {
        "grid": {"kind": "patch", "n": 14, "lines": 10, "normal": [0.0, 0.0, -1.0], "margin": 0.003},
        "skins": [sheet("sole", 8, 20, [1.0, 0.0, 0.0])],
    },
    "edge": {
        "grid": {"kind": "tube", "n": 6, "lines": 96, "axis": Z_AXIS, "margin": 0.002},
        "skins": [sheet("edge", 8, 16, [0.0, 1.0, 0.0])],
    },
}


def write_plan(name):
    """Mesh and plan of one sample."""
    mesh = getattr(shapes, name)()
    mesh.export(HERE / f"{name}.ply", vertex_normal=False)
    head = {"format": "skin-plan", "version": 1, "link": f"sample_{name}", "mesh": f"{name}.ply", "unit": "m"}
    text = json.dumps(head | {"cover": {"shell": "outer", "cuts": []}} | PLANS[name], indent=2)
    (HERE / f"{name}.plan.json").write_text(text + "\n")


def write_scene(name):
    """The plan as a scene, with the link selected and in view."""
    import bpy

    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.skin_calib.import_plan(filepath=str(HERE / f"{name}.plan.json"))
    bpy.context.scene.unit_settings.length_unit = "MILLIMETERS"
    for screen in bpy.data.screens:
        for area in screen.areas:
            if area.type == "VIEW_3D":
                view = area.spaces.active
                view.clip_start, view.show_region_ui = 0.001, True
                view.region_3d.view_location, view.region_3d.view_distance = bpy.context.object.location, 0.4
    bpy.ops.wm.save_as_mainfile(filepath=str(HERE / f"{name}.blend"), compress=True)


def main():
    """Write all samples."""
    for name in PLANS:
        write_plan(name)
    try:
        import bpy  # noqa: F401
    except ImportError:
        print("no bpy module here: meshes and plans are written, the .blend files are left as they were")
        return
    from batch_fit import enable_from_checkout

    enable_from_checkout()
    for name in PLANS:
        write_scene(name)


if __name__ == "__main__":
    main()
