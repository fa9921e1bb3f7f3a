"""Install a zip file, fit a scene and report the libraries; run with only Blender's module and NumPy.

python -S install_and_fit.py EXTENSION.zip SCENE.blend OUT.json REPORT.json
"""

import importlib
import importlib.util
import json
import sys
from pathlib import Path

import bpy


def main(archive, scene, out, report):
    """Install the extension, fit the scene, export the result, and report the libraries."""
    before = {name: importlib.util.find_spec(name) is not None for name in ("scipy", "trimesh", "skin_calib_addon")}
    bpy.ops.extensions.package_install_files(filepath=archive, repo="user_default", enable_on_install=True)
    bpy.ops.wm.open_mainfile(filepath=scene)
    bpy.ops.skin_calib.fit()
    bpy.ops.skin_calib.export_calibration(filepath=out)
    # The fit of a plain mesh needs no trimesh and no collada.
    libraries = ("numpy", "scipy", "igl", "trimesh", "collada")
    places = {name: str(Path(importlib.import_module(name).__file__).parent) for name in libraries}
    ours = [name for name in sys.modules if name.endswith("skin_calib_addon.pipeline")]
    version = sys.modules["scipy"].__version__
    Path(report).write_text(json.dumps({"before": before, "places": places, "ours": ours, "version": version}))


if __name__ == "__main__":
    main(*sys.argv[1:])
