"""Fit the links of a scene without a window.

    blender -b scene.blend --python batch_fit.py -- -o OUT [--picture PNG] [--report JSON]
    python batch_fit.py scene.blend -- -o OUT            (with the bpy module)

What follows ``--`` are the words of ``skin-calib fit``; a scene without links, bad data and a bad call end with the
same codes as there: 1 the data is wrong, 2 the call is wrong.
"""

import atexit
import importlib.util
import sys
from pathlib import Path

import bpy

COMMAND = "skin_calib_addon.blender.command"


def enable_from_checkout():
    """Register the extension that this file lies in, where Blender has not enabled it itself; its command module."""
    if not hasattr(bpy.types.Object, "skin_calib"):
        root = Path(__file__).resolve().parent.parent
        spec = importlib.util.spec_from_file_location(
            "skin_calib", root / "__init__.py", submodule_search_locations=[str(root)]
        )
        extension = importlib.util.module_from_spec(spec)
        sys.modules["skin_calib"] = extension
        spec.loader.exec_module(extension)
        extension.register()
        atexit.register(extension.unregister)  # Blender does so for what it has enabled; without it 4.5 ends badly
    return next(module for name, module in sys.modules.items() if name.endswith(COMMAND))


def main():
    """Open the scene if one is named, and fit its links."""
    split = sys.argv.index("--") if "--" in sys.argv else len(sys.argv)
    command = enable_from_checkout()
    scenes = [word for word in sys.argv[1:split] if word.endswith(".blend")]
    if scenes and not bpy.data.filepath:
        bpy.ops.wm.open_mainfile(filepath=scenes[0])
    return command.main(["fit", *sys.argv[split + 1 :]])


if __name__ == "__main__":
    sys.exit(main())
