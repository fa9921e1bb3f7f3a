"""Reproducibility: how far a surface and its centre move if the mesh is moved, reordered, subdivided or shaken.

    python benchmarks/reproducible.py [--links TEXT] [--changes NAME ...] [--size N LINES] [--seeds N]

Each real link is fitted with the default grid of its kind, before and after each change. The motion of the mesh is
undone. The table has the largest distance of points and the largest angle of normals at equal parameters, the movement
of the centre, and the part of it along the surface. The rest is the distance between the two surfaces. The other
columns name the decision that moved: axis, angle zero, span, planes, lines. "refused" marks fits that are errors.
"""

import argparse
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from links import SHARED
from scipy.spatial.transform import Rotation

from skin_calib_addon.common.errors import PoorFit, SkinCalibError
from skin_calib_addon.geometry import AcrossGrid, CoverSpec, TubeGrid, cut_cover, load_mesh, weld
from skin_calib_addon.geometry.fit.fitting import check_fit, fit_lines
from skin_calib_addon.geometry.mesh.triangle_mesh import METRES_PER_UNIT
from skin_calib_addon.geometry.surface.centre import surface_centre

# Links that are a face, with its outward normal; all others are tubes.
FACES = {
    "g1_left_ankle_roll_foot": (0.0, 0.0, -1.0),
    "hrp4c_r_ankle_r_foot": (0.0, 0.0, -1.0),
    "icub27_l_foot_sole": (0.0, 0.0, -1.0),
    "g1_left_palm_force_sensor": (0.0, 0.0, 1.0),
}
SIZE = 10, 20  # planes and lines of a tube; across a face, as many lines as planes
SITES = np.linspace(0, 1, 61)  # of the comparison, in both directions
NOISE = 1e-9  # [m]
COPLANAR = 5e-11  # [1] one minus the cosine between the normals of faces in one plane: 1e-5 rad


@dataclass(frozen=True)
class Motion:
    """A rotation and a shift of a mesh [m]."""

    rotation: np.ndarray
    shift: np.ndarray

    def points(self, points):
        """Return the moved points."""
        return points @ self.rotation.T + self.shift

    def undone(self, points):
        """Return the points before the motion."""
        return (points - self.shift) @ self.rotation


@dataclass(frozen=True)
class Row:
    """One link after one change."""

    link: str
    change: str
    points: float  # largest distance at equal parameters [mm]
    normals: float  # largest angle there [degrees]
    centre: float  # [mm]
    along: float  # the part of it along the surface [mm]
    axis: float  # [degrees]
    line: float  # largest distance of the two axes within the span [mm]
    zero: float  # angle zero [degrees]
    span: float  # first and last plane [mm]
    planes: float  # [mm]
    lines: float  # [degrees] or [mm]
    note: str = ""


STILL = Motion(np.eye(3), np.zeros(3))


def rotated(vertices, faces, rng):
    """Rotate about a random axis."""
    return vertices, faces, Motion(Rotation.random(rng=rng).as_matrix(), np.zeros(3))


def shifted(vertices, faces, rng):
    """Translate by up to a metre."""
    return vertices, faces, Motion(np.eye(3), rng.uniform(-1, 1, 3))


def shuffled(vertices, faces, rng):
    """Change the order of faces, and the first corner of each."""
    turn = (rng.integers(0, 3, len(faces))[:, None] + np.arange(3)) % 3
    return vertices, np.take_along_axis(faces, turn, axis=1)[rng.permutation(len(faces))], STILL


def reordered(vertices, faces, rng):
    """Change the order of vertices."""
    order = rng.permutation(len(vertices))
    return vertices[order], np.argsort(order)[faces], STILL


def subdivided(vertices, faces, rng):
    """Divide every face into four."""
    corners = vertices[faces]
    middles = (corners + np.roll(corners, -1, axis=1)) / 2
    a, b, c, ab, bc, ca = *corners.transpose(1, 0, 2), *middles.transpose(1, 0, 2)
    parts = np.concatenate([np.stack(part, axis=1) for part in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))])
    return parts.reshape(-1, 3), np.arange(3 * len(parts)).reshape(-1, 3), STILL


def partly_subdivided(vertices, faces, rng):
    """Divide a random half of the faces into three about their centroids."""
    chosen = rng.random(len(faces)) < 0.5
    middle = vertices[faces[chosen]].mean(axis=1)
    new = len(vertices) + np.arange(len(middle))
    a, b, c = faces[chosen].T
    parts = [np.column_stack(part) for part in ((a, b, new), (b, c, new), (c, a, new))]
    return np.concatenate((vertices, middle)), np.concatenate((faces[~chosen], *parts)), STILL


def noisy(vertices, faces, rng):
    """Move every vertex by some nanometres."""
    return vertices + rng.normal(0, NOISE, vertices.shape), faces, STILL


def flipped(vertices, faces, rng):
    """Take the other diagonal of pairs of faces in one plane, wherever the pair is convex."""
    mesh = weld(vertices, faces)
    vertices, faces, normals = mesh.vertices, mesh.faces.copy(), mesh.face_normals
    free = np.ones(len(faces), bool)
    pairs = np.column_stack(mesh.adjacency)
    flat = (normals[pairs[:, 0]] * normals[pairs[:, 1]]).sum(axis=1) > 1 - COPLANAR
    for f, g in rng.permutation(pairs[flat]):
        a, b = (v for v in faces[f] if v in faces[g]), [v for v in faces[g] if v not in faces[f]]
        shared = list(a)
        if not (free[f] and free[g]) or len(shared) != 2 or len(b) != 1:
            continue
        i = next(k for k in range(3) if faces[f][k] not in shared)
        tip, first, second, other = faces[f][i], faces[f][(i + 1) % 3], faces[f][(i + 2) % 3], b[0]
        new = np.array(((tip, first, other), (tip, other, second)))
        corners = vertices[new]
        areas = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) @ normals[f]
        if (areas > 0).all():
            faces[[f, g]], free[[f, g]] = new, False
    return vertices, faces, STILL


def single_precision(vertices, faces, rng):
    """Rotate about a random axis, and write the coordinates in single precision, as STL files have them."""
    motion = Motion(Rotation.random(rng=rng).as_matrix(), np.zeros(3))
    stored = motion.points(vertices).astype(np.float32).astype(float)
    return motion.undone(stored), faces, motion


def in_millimetres(vertices, faces, rng):
    """Write the coordinates in millimetres and single precision, and read them in this unit."""
    return (1e3 * vertices).astype(np.float32) * METRES_PER_UNIT["mm"], faces, STILL


def separate(vertices, faces, rng):
    """Give every face vertices of its own, in a random order."""
    order = rng.permutation(len(faces))
    return vertices[faces[order]].reshape(-1, 3), np.arange(3 * len(faces)).reshape(-1, 3), STILL


def other_net(vertices, faces, rng):
    """Change nothing: the net has twice as many planes and lines, and only the centre is compared."""
    return vertices, faces, STILL


CHANGES = {
    "rotated": rotated,
    "shifted": shifted,
    "faces": shuffled,
    "vertices": reordered,
    "subdivided": subdivided,
    "partly subdivided": partly_subdivided,
    "noise": noisy,
    "flipped": flipped,
    "single precision": single_precision,
    "millimetres": in_millimetres,
    "separate": separate,
    "other net": other_net,
}


@dataclass(frozen=True)
class Fitted:
    """A surface on a mesh, or why there is none."""

    fit: object = None
    parametrization: object = None
    error: str = ""
    refused: bool = False


def fitted(vertices, faces, motion, name, size) -> Fitted:
    """Fit a moved mesh with the default grid of its kind."""
    try:
        cover = cut_cover(weld(motion.points(vertices), faces), CoverSpec())
        face = FACES.get(name)
        grid = TubeGrid(*size) if face is None else AcrossGrid(size[0], size[0], tuple(motion.rotation @ face))
        lines = grid.line_grid(cover)
        fit = fit_lines(cover, lines, (3, 3))
        return Fitted(fit, grid.region.parametrization(cover), refused=is_refused(fit))
    except SkinCalibError as error:
        return Fitted(error=str(error))


def is_refused(fit) -> bool:
    """Return whether a calibration with this fit ends with an error."""
    try:
        check_fit(fit)
    except PoorFit:
        return True
    return any(warning.severity == "error" for warning in fit.warnings)


def compared(name, change, before: Fitted, after: Fitted, motion) -> Row:
    """Return how far a change moved the surface."""
    nothing = Row(name, change, *[float("nan")] * 10)
    if before.error or after.error:
        note = before.error[:60] if before.error and after.error else f"ONLY ONE: {before.error or after.error}"[:80]
        return replace(nothing, note=note)
    uv = np.stack(np.meshgrid(SITES, SITES, indexing="ij"), axis=-1).reshape(-1, 2)
    one, two = before.fit.surface, after.fit.surface
    off = np.linalg.norm(motion.undone(two.points(uv)) - one.points(uv), axis=1)
    cosines = ((two.normals(uv) @ motion.rotation) * one.normals(uv)).sum(axis=1)
    centres = [s.points(np.array(surface_centre(s))[None])[0] for s in (one, two)]
    moved = motion.undone(centres[1]) - centres[0]
    normal = one.normals(np.array(surface_centre(one))[None])[0]
    row = replace(
        nothing,
        points=1e3 * float(off.max()),
        normals=float(np.rad2deg(np.arccos(np.clip(cosines.min(), -1, 1)))),
        centre=1e3 * float(np.linalg.norm(moved)),
        along=1e3 * float(np.linalg.norm(moved - (moved @ normal) * normal)),
        note=("", "REFUSED ONCE", "refused")[before.refused + after.refused],
    )
    if change == "other net":
        return replace(row, points=float("nan"), normals=float("nan"))
    a, b = before.parametrization, after.parametrization
    notes = [row.note] if row.note else []
    if before.fit.iterations != after.fit.iterations:
        notes.append(f"iterations {before.fit.iterations}, {after.fit.iterations}")
    if before.fit.basis.N.shape != after.fit.basis.N.shape:
        notes.append("sites")
    if (before.fit.noise > 0) != (after.fit.noise > 0):
        notes.append("smoothed once")
    if getattr(a, "bends", False) != getattr(b, "bends", False):
        return replace(row, note="CURVED ONCE")
    s, t = (f.fit.lines.planes_u for f in (before, after))
    heights = [((p.points - p.points[0]) * p.normals[0]).sum(axis=1) for p in (s, t)]
    one, two = before.fit.lines, after.fit.lines
    directions = two.directions @ motion.rotation
    normals = t.normals @ motion.rotation
    lines = np.rad2deg(np.arccos(np.clip((directions * one.directions).sum(axis=2), -1, 1))).max()
    return replace(
        row,
        axis=float(np.rad2deg(np.linalg.norm(np.cross(normals, s.normals), axis=1).max())),
        line=1e3 * float(np.linalg.norm(motion.undone(t.points) - s.points, axis=1).max()),
        zero=float(zero_angle(a, b, motion)),
        span=1e3 * float(np.abs(np.subtract(a.span, b.span)).max()),
        planes=1e3 * float(np.abs(heights[0] - heights[1]).max()),
        lines=float(lines),
        note=", ".join(notes + (["curved"] if a.bends else [])),
    )


def zero_angle(a, b, motion) -> float:
    """Return the angle between the directions of angle zero [degrees]."""
    rays = [p.rays(np.array([sum(p.span) / 2]), np.zeros(1))[1][0, 0] for p in (a, b)]
    if not a.closed:
        rays = [a.along, b.along]
    return np.rad2deg(np.linalg.norm(np.cross(motion.rotation.T @ rays[1], rays[0])))


def measure(links="", changes=tuple(CHANGES), size=SIZE, seeds=1) -> Iterator[Row]:
    """Yield a row for each link and change."""
    for path in sorted((SHARED / "meshes").glob(f"*{links}*.stl")):
        mesh = load_mesh(path)
        before = fitted(mesh.vertices, mesh.faces, STILL, path.stem, size)
        for change in changes:
            rows = []
            for seed in range(seeds):
                vertices, faces, motion = CHANGES[change](mesh.vertices, mesh.faces, np.random.default_rng(seed))
                net = (2 * size[0], 2 * size[1]) if change == "other net" else size
                after = fitted(vertices, faces, motion, path.stem, net)
                rows.append(compared(path.stem, change, before, after, motion))
            yield max(rows, key=lambda row: (row.note.isupper(), np.nan_to_num(row.points, nan=-1.0)))


COLUMNS = {
    "points": "mm",
    "normals": "deg",
    "centre": "mm",
    "along": "mm",
    "axis": "deg",
    "line": "mm",
    "zero": "deg",
    "span": "mm",
    "planes": "mm",
    "lines": "deg",
}
HEADER = (
    f"{'link':34} {'change':18}"
    + "".join(f"{name:>10}" for name in COLUMNS)
    + f"  note\n{'':53}"
    + "".join(f"{unit:>10}" for unit in COLUMNS.values())
)


def text(r: Row) -> str:
    """Return a row as columns of text."""
    return f"{r.link:34} {r.change:18}" + "".join(f"{getattr(r, name):10.5f}" for name in COLUMNS) + f"  {r.note}"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--links", default="")
    parser.add_argument("--changes", nargs="+", choices=CHANGES, default=list(CHANGES))
    parser.add_argument("--size", nargs=2, type=int, default=SIZE)
    parser.add_argument("--seeds", type=int, default=1)
    arguments = parser.parse_args()
    print(HEADER)
    for row in measure(arguments.links, arguments.changes, tuple(arguments.size), arguments.seeds):
        print(text(row), flush=True)


if __name__ == "__main__":
    main()
