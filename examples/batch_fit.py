"""Fit the links of a scene without a window.

    blender -b scene.blend --python batch_fit.py -- -o OUT [--picture PNG] [--report JSON]
    python batch_fit.py scene.blend -- -o OUT            (with the bpy module)

The words after ``--`` are those of ``skin-calib fit``. The exit codes are the same too: 1 for wrong data, for example a
scene without links, and 2 for a wrong call.
"""

import atexit
import importlib.util
import sys
from pathlib import Path

import bpy

COMMAND = "skin_calib_addon.blender.command"


def enable_from_checkout():
    """Register the extension of this checkout if Blender has not enabled it; return its command module."""
    if not hasattr(bpy.types.Object, "skin_calib"):
        root = Path(__file__).resolve().parent.parent
        spec = importlib.util.spec_from_file_location(
            "skin_calib", root / "__init__.py", submodule_search_locations=[str(root)]
        )
        extension = importlib.util.module_from_spec(spec)
        sys.modules["skin_calib"] = extension
        spec.loader.exec_module(extension)
        extension.register()
        atexit.register(
            extension.unregister
        )  # Blender does this for enabled extensions; without it Blender 4.5 crashes at exit
    return next(module for name, module in sys.modules.items() if name.endswith(COMMAND))


def main():
    """Open the scene if one is given, and fit its links."""
    split = sys.argv.index("--") if "--" in sys.argv else len(sys.argv)
    command = enable_from_checkout()
    scenes = [word for word in sys.argv[1:split] if word.endswith(".blend")]
    if scenes and not bpy.data.filepath:
        bpy.ops.wm.open_mainfile(filepath=scenes[0])
    return command.main(["fit", *sys.argv[split + 1 :]])


if __name__ == "__main__":
    sys.exit(main())
