"""Time of a preview in Blender during a change: read, cut, fit, place, and prepare the drawing.

    python benchmarks/live.py

Needs the module bpy. Times [ms] go from the change to the arrays that are drawn, on the sample wrist (10 200 faces, 120
taxels): median and minimum of several, without the redraw of the window.
"""

import importlib
import os
import statistics
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
REPEATS = 25


def main():
    """Enable the extension, open the sample, change it."""
    folder = Path(tempfile.mkdtemp())
    os.environ["BLENDER_USER_RESOURCES"] = str(folder / "resources")
    import bpy

    addon_utils = importlib.import_module("addon_utils")
    (folder / "skin_calib").symlink_to(ROOT)
    repository = bpy.context.preferences.extensions.repos.new(name="b", module="b", custom_directory=str(folder))
    name = f"bl_ext.{repository.module}.skin_calib"
    assert addon_utils.enable(name, default_set=True)
    live = importlib.import_module(f"{name}.skin_calib_addon.blender.live.updates")
    bpy.ops.wm.open_mainfile(filepath=str(ROOT / "sample_scenes" / "wrist.blend"))
    link = bpy.context.object
    plan = link.skin_calib
    bpy.ops.skin_calib.fit()
    plan.live, live.FIT_DELAY = True, 1e9
    print(f"Blender {bpy.app.version_string}, previews in ms: median, best")
    for what, change in CHANGES.items():
        if what.startswith("hand"):
            bpy.ops.skin_calib.planes_place() if plan.grid.kind != "planes" else None
        seconds = []
        for k in range(REPEATS):
            change(plan, k)
            while live.tick() == live.POLL_INTERVAL:
                pass
            seconds.append(live.reports[link.name].seconds * 1e3)
        print(f"{what:32} {statistics.median(seconds[3:]):6.1f} {min(seconds[3:]):6.1f}", flush=True)
    addon_utils.disable(name, default_set=True)


def rows(plan, k):
    """Change the size of the sheet."""
    plan.skins[0].rows = 5 + k % 2


def direction(plan, k):
    """Turn the sheet."""
    plan.skins[0].direction = (0.002 * k, 1, 0)


def number(plan, k):
    """Change the number of planes, with automatic spacing."""
    plan.grid.n = 9 + k % 3


def even(plan, k):
    """Change the number of planes, with uniform spacing."""
    plan.grid.spacing = "uniform"
    plan.grid.n = 9 + k % 3


def hand(plan, k):
    """Move a plane by half a millimetre."""
    plan.grid.u[4].point[2] += 0.0005 * (1 if k % 2 else -1)


def tilt(plan, k):
    """Tilt a plane."""
    plan.grid.u[4].normal = (0.01 * (k % 4), 0, 1)


CHANGES = {
    "rows of the sheet": rows,
    "direction of the sheet": direction,
    "u-planes, spacing auto": number,
    "u-planes, spacing uniform": even,
    "hand-placed plane moved": hand,
    "hand-placed plane tilted": tilt,
}

if __name__ == "__main__":
    sys.exit(main())
