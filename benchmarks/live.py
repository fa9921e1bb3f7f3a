"""Time of a preview in Blender during a change: read, cut, fit, place, and prepare the drawing.

    python benchmarks/live.py

Needs the module bpy. Times [ms] go from the change to the arrays that are drawn, without the redraw of the window:
median and minimum of several, and the median and maximum CPU time of the process from the change to the end of its
preview. No change repeats an earlier one. The cases are the sample wrist (10 200 triangles, 120 taxels), with a sheet
of 10 000 taxels, and with meshes of 10^5 triangles, and of 122 400 faces of Blender, which are 244 800 triangles.
"""

import importlib
import os
import statistics
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
REPEATS = 12
FIRST = 3  # changes that are not counted: they compute what depends on the mesh only
MANY = 50, 200  # rows and columns of a sheet of 10 000 taxels


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
    print(f"Blender {bpy.app.version_string}, previews in ms: median, best, median and maximum CPU")
    measure(live, link, "wrist", CHANGES | CUT)
    plan.skins[0].rows, plan.skins[0].columns = MANY
    plan.skins[0].pitch = plan.skins[0].pitch[0] * 6 / MANY[0], plan.skins[0].pitch[1] * 20 / MANY[1]
    measure(live, link, "10 000 taxels", CHANGES | CUT)
    plan.skins[0].rows, plan.skins[0].columns, plan.skins[0].pitch = 6, 20, (0.01, 0.01)
    coarse = link.data.copy()
    link.modifiers.new("finer", "SUBSURF").levels = 2
    bpy.ops.object.modifier_apply(modifier="finer")
    fine = f"{len(link.data.polygons):,} faces".replace(",", " ")
    measure(live, link, fine, CHANGES | CUT)
    fine_mesh = link.data.copy()
    decimate = link.modifiers.new("fewer", "DECIMATE")
    decimate.ratio = 1e5 / len(link.data.loop_triangles)
    bpy.ops.object.modifier_apply(modifier="fewer")
    measure(live, link, "10^5 triangles", CHANGES | CUT)
    bpy.ops.skin_calib.planes_place()
    measure(live, link, "10^5 triangles", BY_HAND)
    for case, link.data in ((fine, fine_mesh), ("wrist", coarse)):
        measure(live, link, case, BY_HAND)
    addon_utils.disable(name, default_set=True)


def measure(live, link, case, changes, repeats=REPEATS):
    """Print the times of some changes of a link."""
    for what, change in changes.items():
        link.data.vertices[0].co.z += 1e-7  # what earlier changes computed is of another mesh
        link.skin_calib.inspect.heat = HEAT.get(what, "NONE")
        seconds, cpu = [], []
        for k in range(repeats):
            start = time.process_time()
            change(link.skin_calib, k)
            while live.tick() == live.POLL_INTERVAL:
                pass
            cpu.append((time.process_time() - start) * 1e3)
            report = live.session.of(link).report
            if report.refusal:
                print(f"{case:16} {what:26} refused: {report.refusal.message}")
                break
            seconds.append(report.seconds * 1e3)
        else:
            cpu = cpu[FIRST:]
            times = statistics.median(seconds[FIRST:]), min(seconds), statistics.median(cpu), max(cpu)
            print(f"{case:16} {what:26} " + " ".join(f"{t:6.1f}" for t in times), flush=True)
        link.skin_calib.cover.cuts.clear()


def rows(plan, k):
    """Change the size of the sheet."""
    plan.skins[0].rows = plan.skins[0].rows + (1 if k % 2 else -1)


def direction(plan, k):
    """Turn the sheet."""
    plan.skins[0].direction = (0.002 * k, 1, 0)


def number(plan, k):
    """Change the number of planes, with automatic spacing."""
    plan.grid.spacing = "auto"
    plan.grid.n = 6 + k


def many(plan, k):
    """Change the number of many planes, with automatic spacing."""
    plan.grid.spacing = "auto"
    plan.grid.n = 40 + 5 * k


def even(plan, k):
    """Change the number of planes, with uniform spacing."""
    plan.grid.spacing = "uniform"
    plan.grid.n = 6 + k


def hand(plan, k):
    """Move a plane by a tenth of a millimetre."""
    plan.grid.u[4].point[2] += 0.0001


def cut(plan, k):
    """Move a cut by a tenth of a millimetre."""
    if not plan.cover.cuts:
        item = plan.cover.cuts.add()
        item.point, item.normal = (0.0, 0.0, 0.012), (0.0, 0.0, 1.0)
    plan.cover.cuts[0].point[2] += 0.0001


def tilt(plan, k):
    """Tilt a plane."""
    plan.grid.u[4].normal = (0.005 * k, 0, 1)


CHANGES = {
    "rows of the sheet": rows,
    "direction of the sheet": direction,
    "u-planes, spacing auto": number,
    "40 to 95 u-planes, auto": many,
    "u-planes, spacing uniform": even,
    "the same with the error": even,
    "the same with uncertainty": even,
}
HEAT = {"the same with the error": "ERROR", "the same with uncertainty": "UNCERTAINTY"}
CUT = {"a cut moves": cut}
BY_HAND = {
    "hand-placed plane moved": hand,
    "hand-placed plane tilted": tilt,
}

if __name__ == "__main__":
    sys.exit(main())
