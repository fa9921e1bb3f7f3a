"""Whole robots: what ``fit --propose`` covers, how long it takes, and how well each taxel lies.

    python benchmarks/robots.py [--skin hexagons:8mm] [--jobs 2] [--keep FOLDER] [--made] [--stages] [--write]
        [--urdf FILE]

For each robot of the data folder, or each ``--urdf``, it prints one column of a table: links, surfaces, fractions of
the areas, boards, seconds, and over all taxels the largest distance and angles to the mesh, hidden taxels and
overlapping boards. Then it loads the robot in the runtime and updates it, and, with MuJoCo, presses 200 taxels. With
``--made`` it judges what ``--keep`` has of an earlier run. With ``--stages`` it proposes and fits once more in one
process and prints the CPU seconds of each stage. With ``--write`` the table and a picture of each robot go into the
documentation; those of ``--urdf`` are a line each.
"""

import argparse
import contextlib
import os
import re
import subprocess
import sys
import tempfile
import threading
from collections import Counter
from pathlib import Path
from time import perf_counter, process_time

import numpy as np
import trimesh
from scipy.spatial import cKDTree

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "benchmarks")]

from pages import MARKS, left_out_area, write_table  # noqa: E402

from skin_calib_addon.calibration.file import load_calibration  # noqa: E402
from skin_calib_addon.geometry.mesh.distance import closest, closest_on_triangles  # noqa: E402
from skin_calib_addon.geometry.mesh.triangle_mesh import TriangleMesh, stacked  # noqa: E402
from skin_calib_addon.geometry.mesh.visibility import are_seen, visibility  # noqa: E402
from skin_calib_addon.pictures.robot import draw_robot  # noqa: E402
from skin_calib_addon.pipeline import calibrate  # noqa: E402
from skin_calib_addon.plan import load_plan, named_from, save_plan  # noqa: E402
from skin_calib_addon.proposal.link_points import LinkPoints  # noqa: E402
from skin_calib_addon.proposal.links import Task, propose_task  # noqa: E402
from skin_calib_addon.proposal.skins import parse_skin  # noqa: E402
from skin_calib_addon.robot.keep_out import KeepOut  # noqa: E402
from skin_calib_addon.robot.kinematics import link_poses  # noqa: E402
from skin_calib_addon.robot.link_mesh import links_with_mesh, load_urdf_meshes  # noqa: E402
from skin_calib_addon.robot.mirrored import PARTNER_DISTANCE, find_twins, symmetry  # noqa: E402
from skin_calib_addon.robot.urdf import read_robot  # noqa: E402

PAGE = ROOT / "docs" / "explanation" / "robots.md"
OTHER_MARKS = "<!-- begin of other robots -->\n", "<!-- end of other robots -->\n"
DATA = ROOT.parent / "shared" / "data" / "robots"
ROBOTS = {
    "G1": DATA / "g1_description" / "g1_29dof_rev_1_0.urdf",
    "JVRC-1": DATA / "jvrc_description" / "urdf" / "jvrc1.urdf",
    "FR3": DATA / "franka_description" / "robots" / "fr3" / "fr3.urdf",
    "T1": DATA / "t1_description" / "T1_serial.urdf",
}
DRAWN = "G1", "JVRC-1"  # in the documentation
FINE = 5e-3  # [m] longest side of faces in the picture
LIFT = 1e-3  # [m] above the surface, from where a taxel looks outward
PARTNERS = 1e-3  # [m] distance of a taxel from the mirror image of another one up to which they belong together
TOUCHING = 2e-5  # [m] depth of an overlap that does not count
STEEP = 15.0  # [degrees] that a normal may be off
RINGS = (0.4, 0.7, 0.95)  # [1] of the radius of a cell, at which the mesh below it is examined
PRESSES = 200
CYCLES = 200
SAMPLE_PERIOD = 0.2  # [s] between two measurements of the memory
CONTROLLER = """
import re, sys; sys.path.insert(0, {0!r})
import numpy as np
from time import process_time
from skin_calib_addon.runtime import Body
start = process_time()
body = Body.load({1!r})
loaded = process_time() - start
poses, rng, times = dict.fromkeys(body.skins, np.eye(4)), np.random.default_rng(0), []
for cycle in range({2}):
    readings = {{link: rng.random(skin.reading_length) for link, skin in body.skins.items()}}
    start = process_time()
    assert body.update(readings, 0.01 * cycle, poses).wrench is not None
    times.append(process_time() - start)
memory = int(re.search(r"VmHWM:\\s*(\\d+)", open("/proc/self/status").read())[1]) / 1024
print(f"{{loaded:.2f}} {{memory:.0f}} {{1e3 * np.median(times):.2f}}")
"""


def main() -> None:
    """Propose and fit all links of each robot, and print the figures."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--skin", default="hexagons:8mm")
    parser.add_argument("--jobs", default="2")
    parser.add_argument("--keep", type=Path, help="folder for plans and calibrations; default: a temporary one")
    parser.add_argument("--made", action="store_true", help="judge what --keep has")
    parser.add_argument("--stages", action="store_true", help="seconds of each stage in one process")
    parser.add_argument("--robot", choices=ROBOTS, action="append")
    parser.add_argument("--urdf", type=Path, action="append", help="other robots")
    parser.add_argument("--write", action="store_true", help="table and pictures into the documentation")
    options = parser.parse_args()
    robots = {name: ROBOTS[name] for name in options.robot or ROBOTS}
    if options.urdf:
        robots = {path.stem: path for path in options.urdf}
    columns = {}
    for name, urdf in robots.items():
        if not urdf.exists():
            print(f"{name}: {urdf} is not there; skipped")
            continue
        with tempfile.TemporaryDirectory() as temporary:
            folder = options.keep / name if options.keep else Path(temporary)
            folder.mkdir(parents=True, exist_ok=True)
            columns[name] = column(urdf, folder, options)
            if options.write and name in DRAWN:
                draw(urdf, folder, PAGE.parents[1] / f"robot_{name.lower().replace('-', '')}.png")
    if not columns:
        return
    table = table_of(columns, options.skin)
    print(table, end="")
    if options.write:
        text, marks = (short_table_of(columns), OTHER_MARKS) if options.urdf else (table, MARKS)
        write_table(PAGE, text, marks)


def column(urdf, folder, options):
    """Return the rows of one robot."""
    log, per_stage = folder / "said.txt", folder / "stages.txt"
    if not options.made:
        log.write_text(made(urdf, folder, options.skin, options.jobs), encoding="utf-8")
    if options.stages:
        per_stage.write_text(stages(urdf, options.skin), encoding="utf-8")
    rows = of_proposal(urdf, folder, log.read_text(encoding="utf-8"))
    if per_stage.exists():
        rows["CPU seconds by stage, one process"] = per_stage.read_text(encoding="utf-8")
    return {**rows, **of_pairs(urdf, folder), **of_taxels(urdf, folder), **of_runtime(folder), **of_presses(folder)}


def table_of(columns, skin):
    """Return the rows of all robots as a table of Markdown."""
    rows = list(dict.fromkeys(row for column in columns.values() for row in column))
    lines = [f"| {skin} | {' | '.join(columns)} |", f"|---{'|---' * len(columns)}|"]
    lines += [f"| {row} | {' | '.join(column.get(row, '') for column in columns.values())} |" for row in rows]
    return "\n".join(lines) + "\n"


def short_table_of(columns):
    """Return the main figures of each robot as a line of a table of Markdown."""
    parts = {  # what begins a row, and what is kept of its value and name
        "links with a mesh, with a plan": ("links, with a mesh", r"\d+, (\d+, \d+) .*"),
        "surfaces, boards": ("surfaces, boards", r"(\d+, \d+) .*"),
        "cells of the free area": ("cells cover", r"(\d+ %) of the free.*"),
        "area of the cells": ("area of the cells", r"(\d+ cm²) .*"),
        "largest distance": ("largest distance", r"(.* mm) .*"),
        "largest angle": ("largest angle", r"(.* degrees) \(.*"),
        "hidden, inward, overlaps": ("hidden taxels", r"(\d+, \d+, \d+) .*"),
        "CPU seconds": ("CPU seconds", r"fit --propose ([\d.]+),.*"),
        "presses": ("of .* random taxels", r"(\d+ of \d+) .*"),
    }
    lines = [f"| robot | {' | '.join(parts)} |", f"|---{'|---' * len(parts)}|"]
    for name, column in columns.items():
        found = []
        for row, pattern in parts.values():
            texts = [f"{value} {key}" for key, value in column.items() if re.match(row, key)]
            found.append(re.sub(pattern, r"\1", texts[0]) if texts else "")
        lines.append(f"| {name} | {' | '.join(found)} |")
    return "\n".join(lines) + "\n"


def made(urdf, folder, skin, jobs):
    """Propose and fit all links of a robot, in two commands and in one.

    Return what the program printed, and seconds, memory and warnings as lines.
    """
    said, complained, lines = "", "", []
    other = tempfile.TemporaryDirectory()
    options = ["--skin", skin, "--again", "--jobs", jobs]
    calls = {
        "fit --propose": ["fit", str(urdf), "--propose", "-o", other.name, *options],
        "propose": ["propose", str(urdf), "-o", str(folder), *options],
        "fit": ["fit", str(folder), str(urdf), "-o", str(folder), "--again", "--jobs", jobs],
        "export": ["export", str(folder), "--to", "mjcf", "-o", str(folder / "robot.xml")],
    }
    for name, call in calls.items():
        start, before = perf_counter(), os.times()
        command = [sys.executable, "-m", "skin_calib_addon", *call]
        process = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        with peak_memory(process.pid) as peak:
            outputs = process.communicate()
        cpu = sum(os.times()[:4]) - sum(before[:4])  # with that of its processes
        took = f"{name} took {perf_counter() - start:.1f} s with {jobs} processes, {cpu:.1f} s of CPU"
        lines.append(f"{took}, {peak[0]:.0f} MB")
        if name != "fit --propose":  # the two commands print the same, and more
            said += outputs[0]
        complained += outputs[1]
    calibrations = sorted(Path(other.name).glob("*.calibration.json"))
    differ = [path.name for path in calibrations if path.read_bytes() != (folder / path.name).read_bytes()]
    lines.append(f"calibrations that differ from those of fit --propose: {', '.join(differ) or 'none'}")
    other.cleanup()
    failed = [line for line in complained.splitlines() if "warning: " not in line]
    return "\n".join((said, *lines, *failed))


@contextlib.contextmanager
def peak_memory(process):
    """Yield a list that has, after the context, the largest memory of a process and its descendants [MB].

    It is the proportional set size: a page of several processes counts once.
    """
    found, done = [0.0], threading.Event()

    def size(number):
        children = [
            child for path in Path(f"/proc/{number}/task").glob("*/children") for child in path.read_text().split()
        ]
        own = int(re.search(r"^Pss: +(\d+)", Path(f"/proc/{number}/smaps_rollup").read_text(), re.M)[1])
        return own / 1024 + sum(map(size, children))

    def sample():
        while not done.wait(SAMPLE_PERIOD):
            with contextlib.suppress(OSError, TypeError):  # one of them has ended
                found[0] = max(found[0], size(process))

    thread = threading.Thread(target=sample)
    thread.start()
    try:
        yield found
    finally:
        done.set()
        thread.join()


def of_proposal(urdf, folder, said):
    """Return the rows that the program itself states."""
    per_link = re.findall(
        r"^(\S+) +(\d+) surfaces?, (\d+) taxels? .*, cells cover (\d+) of (\d+) cm\^2 free \(\d+%\), (\d+) cm\^2",
        said,
        re.M,
    )
    refused = re.findall(r"^(\S+) +no plan: (.*)$", said, re.M)
    surfaces, taxels = (sum(int(row[k]) for row in per_link) for k in (1, 2))
    robot = read_robot(urdf)
    # Without areas and names of links.
    reasons = Counter(re.sub(r"^\d+ cm\^2 are", "Less are", r.partition(" Others cover")[0]) for _, r in refused)
    seconds = re.findall(r"^(.+) took ([\d.]+) s with (\d+) processes, ([\d.]+) s of CPU, (\d+) MB", said, re.M)
    left_out = sum(left_out_area(path.read_text()) for path in folder.glob("*.plan.json"))
    total = re.findall(r"cover (\d+) cm\^2, (\d+)% of the free area and (\d+)% of the area that can", said)[-1]
    chains = re.findall(r"in (\d+) chains? \((\d+) of one, [^;]*; ([\d.]+) m of cable between them\), cells", said)
    worst = sorted(per_link, key=lambda row: int(row[3]) - int(row[4]))[:3]
    return {
        "links, with a mesh, with a plan": f"{len(robot.links)}, {len(links_with_mesh(robot))}, {len(per_link)}",
        "links without a plan": "; ".join(f"{n}: {reason}" for reason, n in reasons.items()) or "none",
        "links that failed": "; ".join(re.findall(r"^(\S+) +failed", said, re.M)) or "none",
        "surfaces, boards": f"{surfaces}, {taxels}",
        "chains, of one board, cables between chains": "{}, {}, {} m".format(*chains[-1]) if chains else "none",
        "cells cover": f"{total[1]} % of the free, {total[2]} % of the visible area",
        "area of surfaces that were left out, because no skin fits": f"{left_out} cm²",
        "most free area without a cell": "; ".join(
            f"{row[0]} {int(row[4]) - int(row[3])} of {row[4]} cm²" for row in worst
        ),
        f"seconds ({seconds[0][2]} processes)": ", ".join(f"{name} {s}" for name, s, *_ in seconds),
        "CPU seconds": ", ".join(f"{name} {s}" for name, _, _, s, _ in seconds),
        "peak memory of all processes [MB]": ", ".join(f"{name} {s}" for name, *_, s in seconds),
        "calibrations of the two commands that differ from those of one": re.findall(
            r"^calibrations that differ.*: (.*)$", said, re.M
        )[0],
    }


def with_fixed(robot, meshes, link):
    """Return the mesh of a link together with those of the links that only fixed joints connect with it."""
    group, poses = [link], link_poses(robot)
    for current in group:  # grows
        for joint in robot.joints.values():
            pair = (joint.parent, joint.child)
            if joint.type == "fixed" and current in pair:
                group += [other for other in pair if other not in group]
    parts = []
    for other in filter(meshes.get, group):
        pose = np.linalg.inv(poses[link]) @ poses[other]
        parts.append((meshes[other].vertices @ pose[:3, :3].T + pose[:3, 3], meshes[other].faces))
    return TriangleMesh(*stacked(parts))


def of_taxels(urdf, folder):
    """Return the rows about all taxels, each compared with the visible faces of its link; fixed links hide, too."""
    robot = read_robot(urdf)
    meshes, worst = load_urdf_meshes(urdf, robot)[0], {}  # by row: (value, link)
    counts, codes, area = Counter(), Counter(), 0.0
    for path in sorted(folder.glob("*.calibration.json")):
        calibration = load_calibration(path)
        mesh = meshes[calibration.link]
        taxels = [patch.taxels for patch in calibration.patches]
        positions, normals = (
            np.concatenate([getattr(t, k) for t in taxels]) for k in ("positions_link", "normals_link")
        )
        warned = {taxel for warning in calibration.warnings for taxel in warning.where.taxels}
        silent = np.array([taxel not in warned for t in taxels for taxel in t.ids])
        seen = visibility(mesh).seen
        cover = TriangleMesh(mesh.vertices, mesh.faces[seen])
        outward = cover.face_normals * visibility(mesh).sides[seen][:, None]
        distance = closest(cover, positions)[0]
        centre = nearest_angles(cover, outward, positions, normals, distance)
        mean = angles_below(cover, outward, [cell for t in taxels for cell in t.corners_link], positions, normals)
        for name, values in (("distance", 1e3 * distance), ("centre", centre), ("mean", mean)):
            value = float(values[silent | (name == "distance")].max(initial=0))
            worst[name] = max(worst.get(name, (0.0, "")), (value, calibration.link))
        counts["steep"] += int((mean[silent] > STEEP).sum())
        around = with_fixed(robot, meshes, calibration.link)
        counts["hidden"] += int((~are_seen(around, positions + LIFT * normals, normals)).sum())
        counts["inward"] += int((centre > 90).sum())
        counts["overlaps"] += overlaps(calibration)
        counts["taxels"] += len(positions)
        area += float(sum(t.areas.sum() for t in taxels))
        codes.update(warning.code for warning in calibration.warnings)

    def of(name, unit):
        return f"{worst[name][0]:.2f} {unit} ({worst[name][1]})"

    return {
        "area of the cells": f"{1e4 * area:.0f} cm²",
        "largest distance of a taxel from the mesh": of("distance", "mm"),
        "largest angle of a normal to the face at the taxel": of("centre", "degrees"),
        "the same, to the mean normal of the faces under the cell": of("mean", "degrees"),
        f"taxels with a mean angle above {STEEP:.0f} degrees, without a warning": str(counts["steep"]),
        "hidden taxels, normals inward, overlapping pairs": ", ".join(
            str(counts[name]) for name in ("hidden", "inward", "overlaps")
        ),
        "warnings": ", ".join(f"{n} {code}" for code, n in codes.most_common()) or "none",
    }


def of_pairs(urdf, folder):
    """Return the rows about links at mirrored positions: whether they are recognized, and have mirrored layouts."""
    robot = read_robot(urdf)
    meshes = load_urdf_meshes(urdf, robot)[0]
    poses = link_poses(robot)
    places = np.array([poses[link][:3, 3] for link in meshes])
    reflection = symmetry(places)
    images = places @ reflection[:3, :3].T + reflection[:3, 3]
    gaps = np.linalg.norm(images[:, None] - places, axis=2)
    off_plane = np.diag(gaps) > PARTNER_DISTANCE
    earlier = np.tril(gaps < PARTNER_DISTANCE, -1).any(axis=1)
    twins = {link: twin for link, twin in find_twins(robot, meshes).items() if twin.is_mirrored}
    taxels = {}
    for path in sorted(folder.glob("*.calibration.json")):
        calibration = load_calibration(path)
        taxels[calibration.link] = np.concatenate([p.taxels.positions_link for p in calibration.patches])
    pairs = [
        (taxels[twin.link], taxels[link], twin) for link, twin in twins.items() if {link, twin.link} <= taxels.keys()
    ]
    complete, all_distances = 0, [np.zeros(0)]
    for former, here, twin in pairs:
        image = former @ twin.transform[:3, :3].T + twin.transform[:3, 3]
        distances = np.concatenate((cKDTree(here).query(image)[0], cKDTree(image).query(here)[0]))
        complete += bool((distances < PARTNERS).all())
        all_distances.append(distances)
    distances = np.concatenate(all_distances)
    found = 1e3 * distances[distances < PARTNERS]
    median = f"{np.median(found):.3f} mm, " if len(found) else ""
    return {
        "pairs of links at mirrored positions, recognized as mirror images, with plans": (
            f"{(off_plane & earlier).sum()}, {len(twins)}, {len(pairs)}"
        ),
        "of these layouts: complete mirror images, taxels with a mirrored one, median and largest distance": (
            f"{complete}, {len(found)} of {len(distances)}, {median}{found.max(initial=0):.3f} mm"
        ),
    }


def of_runtime(folder):
    """Return the rows about a controller that has all skins, in a process of its own."""
    run = [sys.executable, "-c", CONTROLLER.format(str(ROOT), str(folder), CYCLES)]
    load, memory, cycle = subprocess.run(run, check=True, capture_output=True, text=True).stdout.split()
    return {
        "the runtime loads it [s, MB of the process]": f"{load}, {memory}",
        "one update with all taxels pressed [ms]": cycle,
    }


def of_presses(folder):
    """Return the row about presses in MuJoCo."""
    try:
        from presses import measure
    except ImportError:
        return {}
    found = measure(folder, PRESSES)
    return {
        f"of {found.count} random taxels pressed in MuJoCo, felt by this one alone": str(found.alone),
        "the same at random points of cells, felt by it and none but neighbours": str(found.at_random),
    }


def stages(urdf, skin):
    """Return the CPU seconds of each stage of all links, in one process."""
    seconds: Counter[str] = Counter()
    at = ["", 0.0]

    def begin(stage):
        now = process_time()
        if at[0]:
            seconds[at[0]] += now - at[1]
        at[:] = [stage and stage.split()[0], now]

    with tempfile.TemporaryDirectory() as temporary:
        for link in links_with_mesh(read_robot(urdf)):
            proposal = propose_task(Task(urdf, "m", link, parse_skin(skin)), begin).proposal
            begin("")
            if proposal and proposal.plan:
                path = Path(temporary) / "a.plan.json"
                save_plan(named_from(proposal.plan, path.parent), path)
                for stage, took in calibrate(load_plan(path)).seconds.items():
                    seconds[f"fit: {stage}"] += took
    return ", ".join(f"{stage} {took:.1f}" for stage, took in seconds.most_common())


def draw(urdf, folder, path):
    """Draw a robot in its zero pose: cells, free area without skin, and what is not free."""
    robot = read_robot(urdf)
    meshes = load_urdf_meshes(urdf, robot)[0]
    keep_out, fine, kept_out = KeepOut(robot, meshes), {}, {}
    for link, mesh in meshes.items():
        on = LinkPoints.of(mesh)
        blocked = keep_out(link, on.points, on.normals)
        vertices, faces, of = trimesh.remesh.subdivide_to_size(
            mesh.vertices, mesh.faces, FINE, max_iter=20, return_index=True
        )
        fine[link] = TriangleMesh(vertices, faces)
        outward = mesh.face_normals[of] * visibility(mesh).sides[of][:, None]
        kept_out[link] = ~on.are_near(~blocked, fine[link].triangles.mean(axis=1), outward)
    calibrations = {c.link: c for c in map(load_calibration, sorted(folder.glob("*.calibration.json")))}
    title = f"{robot.name}: skin on {len(calibrations)} of {len(robot.links)} links"
    draw_robot(fine, link_poses(robot), calibrations, title, path, kept_out)


def nearest_angles(mesh, outward, positions, normals, distance):
    """Return the smallest angle of each normal to the faces that are about as near as the nearest [degrees].

    A taxel above an edge has several nearest faces.
    """
    centres = mesh.triangles.mean(axis=1)
    radius = float(mesh.longest_sides.max())
    tree, angles = cKDTree(centres), np.zeros(len(positions))
    for k, (point, normal) in enumerate(zip(positions, normals)):
        near = np.array(tree.query_ball_point(point, radius + distance[k] + 1e-4))
        foot = closest_on_triangles(np.repeat(point[None], len(near), axis=0), mesh.triangles[near])
        close = near[np.linalg.norm(foot - point, axis=1) <= distance[k] + 1e-5]
        angles[k] = degrees((outward[close] @ normal).max())
    return angles


def angles_below(mesh, outward, cells, positions, normals):
    """Return the angle of each normal to the mean normal of the mesh below its cell [degrees].

    The mesh is examined at the points nearest to the centre and to rings of 12 points of the cell.
    """
    points, owners = [], []
    for k, (cell, centre) in enumerate(zip(cells, positions)):
        around = (cell + np.roll(cell, -1, axis=0)) / 2
        ring = np.concatenate((cell, around)) - centre
        points.append(np.concatenate((centre[None], *(centre + part * ring for part in RINGS))))
        owners.append(np.full(len(points[-1]), k))
    owner = np.concatenate(owners)
    below = outward[closest(mesh, np.concatenate(points))[1]]
    sums = np.stack([np.bincount(owner, below[:, k]) for k in range(3)], axis=1)
    return degrees((sums * normals).sum(axis=1) / np.linalg.norm(sums, axis=1))


def degrees(cosines):
    """Return the angles of cosines [degrees]."""
    return np.rad2deg(np.arccos(np.clip(cosines, -1, 1)))


def overlaps(calibration) -> int:
    """Return how many pairs of hexagons of all patches of a link overlap: their shadows in a common plane."""
    boards = [p for p in calibration.patches if p.kind == "hexagons"]
    if not boards:
        return 0
    corners = np.concatenate([p.taxels.corners_link for p in boards])
    centres = corners.mean(axis=1)
    normals = np.concatenate([p.taxels.normals_link for p in boards])
    radius = float(np.linalg.norm(corners - centres[:, None], axis=2).max())
    count = 0
    for a, b in cKDTree(centres).query_pairs(2 * radius):
        up = normals[a] + normals[b]
        if np.linalg.norm(up) < 0.5:
            continue
        up /= np.linalg.norm(up)
        side = np.cross(up, centres[b] - centres[a])
        frame = np.stack((np.cross(side, up), side)) / np.linalg.norm(side)
        flat = [(c - centres[a]) @ frame.T for c in (corners[a], corners[b])]
        height = abs((centres[b] - centres[a]) @ up)
        count += height < radius and depth(*flat) > TOUCHING
    return count


def depth(a, b) -> float:
    """Return how far two convex polygons overlap, by separating axes; negative if they are apart [m]."""
    least = np.inf
    for polygon in (a, b):
        sides = np.roll(polygon, -1, axis=0) - polygon
        for nx, ny in np.stack((sides[:, 1], -sides[:, 0]), axis=1) / np.linalg.norm(sides, axis=1)[:, None]:
            pa, pb = a @ (nx, ny), b @ (nx, ny)
            least = min(least, pa.max() - pb.min(), pb.max() - pa.min())
    return float(least)


if __name__ == "__main__":
    main()
