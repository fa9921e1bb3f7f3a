"""The meshes of the benchmarks: shapes with a known surface and real links, each with its axis and its margin.

All except the bundled wrist are in ``../shared/data`` next to the project, and are left out where that is absent.
"""

import importlib.util
import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from skin_calib_addon.geometry import (
    Axis,
    CoverSpec,
    Cut,
    SectorGrid,
    TriangleMesh,
    TubeGrid,
    cut_cover,
    load_mesh,
    weld,
)

Array = NDArray[np.float64]

ROOT = Path(__file__).resolve().parent.parent
SHARED = ROOT.parent / "shared" / "data"
Z = (0.0, 0.0, 1.0)
BUNDLED, PAPERS_LINK = "bundled wrist", "HRP-4C wrist"
HALF_TUBE = float(np.deg2rad(95.0))  # the mesh extends to 100 degrees on either side; a ray at its edge may miss it


@dataclass(frozen=True, eq=False)
class Link:
    """A mesh, and the axis, margin and sector that every method is given."""

    name: str
    mesh: TriangleMesh
    axis: Axis
    margin: float | None  # [m]; None: as far as sections are complete
    sector: tuple[float, float] | None = None  # [rad] where the link is open
    truth: Callable | None = None  # distances of points (k, 3) [m] to the true surface, shape (k,) [m]
    real: bool = False  # a link of a robot, not a shape from formulas

    @property
    def closed(self) -> bool:
        """Return whether the lines go all around."""
        return self.sector is None

    def lines(self, m: int) -> int:
        """Return the number of lines of ``m`` full planes through the axis; half of it for an open link."""
        return 2 * m if self.closed else m

    def grid(self, n: int, lines: int, spacing: str = "auto"):
        """Return our grid of ``n`` planes and ``lines`` lines."""
        if self.sector is None:
            return TubeGrid(n, lines, self.axis, self.margin, spacing)
        return SectorGrid(n, lines, *self.sector, self.axis, self.margin, spacing)

    @cached_property
    def fan(self) -> "Fan":
        """Return the region of our even planes, for the peers."""
        placed = self.grid(4, 4, "uniform").line_grid(self.mesh)
        points, axis = placed.planes_u.points, placed.planes_u.normals[0]
        e1 = placed.directions[0, 0]
        turn = 2 * np.pi if self.sector is None else self.sector[1] - self.sector[0]
        return Fan(points[0], points[-1], axis, e1, np.cross(e1, axis), turn, self.closed)


@dataclass(frozen=True, eq=False)
class Fan:
    """A tube's region as parameters: ``s`` in [0, 1] along the axis, ``t`` in [0, turn] around it, clockwise."""

    first: Array  # (3,) [m] on the axis, as is last
    last: Array
    e3: Array  # unit, along the axis; e1 and e2 are across it
    e1: Array  # where t is 0
    e2: Array  # where t is a quarter of a turn
    turn: float  # [rad]
    closed: bool
    tilt: float = 0.0  # [rad] between the first plane and the last; they turn about e1

    def tilts(self, s):
        """Return the tilt of the planes at ``s`` [rad]."""
        return self.tilt * (np.asarray(s, float) - 0.5)

    def origins(self, s):
        """Return points of the axis, shape (len(s), 3) [m]."""
        return self.first + np.asarray(s, float)[:, None] * (self.last - self.first)

    def normals(self, s):
        """Return the normals of the planes at ``s``, shape (len(s), 3)."""
        tilts = self.tilts(s)[:, None]
        return np.cos(tilts) * self.e3 + np.sin(tilts) * self.e2

    def directions(self, s, t):
        """Return unit vectors away from the axis in planes ``s`` and half-planes ``t``, shape (len(s), len(t), 3)."""
        outward = np.cos(t)[:, None] * self.e1 + np.sin(t)[:, None] * self.e2
        if self.tilt == 0:
            return np.broadcast_to(outward, (len(s), *outward.shape))
        rise = -np.tan(self.tilts(s))[:, None] * np.sin(t)  # along the axis, to stay in the tilted plane
        arms = outward + rise[..., None] * self.e3
        return arms / np.linalg.norm(arms, axis=2, keepdims=True)

    def points(self, s, t, radii):
        """Return points at distances ``radii`` (len(s), len(t)) from the axis, in their planes [m]."""
        return self.origins(s)[:, None] + radii[..., None] * self.directions(s, t)


def has_shapes() -> bool:
    """Return whether the shapes with a known surface and the real links are present."""
    return SHARED.is_dir()


def present_links() -> list[str]:
    """Return the names of the links whose data is present; print a message where it is not."""
    if not has_shapes():
        print(f"{SHARED} is missing: shapes with a known surface and real links are left out", file=sys.stderr)
        return [BUNDLED]
    return list(LINKS)


def link_of(name: str) -> Link:
    """Load one link."""
    return LINKS[name]()


def bundled_wrist() -> Link:
    """Return the sample that every user has."""
    mesh = load_module(ROOT / "sample_scenes" / "shapes.py").wrist()
    return Link(BUNDLED, weld(mesh.vertices, mesh.faces), Axis((0.0015, 0.0005, 0.0), Z), 0.002)


def hrp4c_wrist() -> Link:
    """Return the link of the paper."""
    axis = Axis((-0.0016, -0.0027, -0.1908), (0.0174, -0.0167, 0.9997))
    return Link(PAPERS_LINK, cover("hrp4c_r_wrist_y_cover_only"), axis, 0.007, real=True)


def talos_forearm(name: str, file: str, whole: bool = False) -> Link:
    """Return a forearm of TALOS between two cuts, or as a whole with its end caps."""
    cuts = () if whole else (Cut((0.0, 0.0, 0.045), Z), Cut((0.0, 0.0, 0.165), (0.0, 0.0, -1.0)))
    return Link(name, cover(file, *cuts), Axis((0.0, 0.006, 0.0), Z), None if whole else 0.008, real=True)


def jvrc_forearm(name: str, margin: float | None) -> Link:
    """Return the forearm of JVRC-1: 240 faces."""
    axis = Axis((-0.0178, 0.0, -0.1043), (0.0411, 0.0022, -0.9992))
    return Link(name, cover("jvrc1_r_elbow_p"), axis, margin, real=True)


def g1_wrist() -> Link:
    """Return a wrist of G1 without its flange."""
    cut = Cut((0.016, 0.0, 0.0), (-1.0, 0.0, 0.0))
    return Link("G1 wrist", cover("g1_left_wrist_roll", cut), Axis((0.0, 0.0, 0.0), (1.0, 0.0, 0.0)), 0.001, real=True)


def icub_thigh(name: str, whole: bool = False) -> Link:
    """Return the thigh of iCub above the knee, or as a whole with the knee."""
    point, along = np.array((0.0105, 0.0025, -0.0542)), np.array((0.1222, 0.0308, -0.992))
    cuts = Cut(tuple(point - 0.083 * along), tuple(along)), Cut(tuple(point - 0.017 * along), tuple(-along))
    mesh = cover("icub27_l_upper_leg", *(() if whole else cuts))
    return Link(name, mesh, Axis(tuple(point), tuple(along)), None if whole else 0.003, real=True)


def cover(name: str, *cuts: Cut) -> TriangleMesh:
    """Return the outer shell of a real link."""
    return cut_cover(load_mesh(SHARED / "meshes" / f"{name}.stl"), CoverSpec(cuts=cuts))


def shape_link(name: str, shape: dict, axis: Axis, sector: tuple[float, float] | None = None) -> Link:
    """Return a link from a shape in millimetres."""
    mesh = weld(shape["mesh"].vertices / 1e3, shape["mesh"].faces)
    closest = shape["truth"].closest
    return Link(name, mesh, axis, 0.002, sector, lambda points: np.abs(closest(points * 1e3)[0]) / 1e3)


def shape(name: str, axis: Axis, sector: tuple[float, float] | None = None) -> Link:
    """Return one of the shapes with a known surface: "rounded square" is ``rounded_square`` there."""
    function = name.removesuffix(" sample").replace(" ", "_")
    return shape_link(name, getattr(target_shapes(), function)(), axis, sector)


def target_shapes():
    """Return the module of the shapes with a known surface."""
    return load_module(SHARED / "shapes.py")


def load_module(path: Path):
    """Load a Python file as a module under its own name: two files are called ``shapes``."""
    spec = importlib.util.spec_from_file_location(f"{path.parent.name}_shapes", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


MIDDLE = Axis((0.0, 0.0, 0.0), Z)
LINKS: dict[str, Callable[[], Link]] = {
    BUNDLED: bundled_wrist,
    "cylinder": lambda: shape("cylinder", MIDDLE),
    "wrist sample": lambda: shape("wrist sample", MIDDLE),
    "rounded square": lambda: shape("rounded square", MIDDLE),
    "half tube": lambda: shape("half tube", MIDDLE, (-HALF_TUBE, HALF_TUBE)),
    "cone": lambda: shape("cone", MIDDLE),
    PAPERS_LINK: hrp4c_wrist,
    "TALOS forearm": lambda: talos_forearm("TALOS forearm", "talos_arm_5_forearm"),
    "TALOS forearm, twin": lambda: talos_forearm("TALOS forearm, twin", "talos_arm_5_forearm_collision"),
    "JVRC-1 forearm": lambda: jvrc_forearm("JVRC-1 forearm", 0.012),
    "G1 wrist": g1_wrist,
    "iCub thigh": lambda: icub_thigh("iCub thigh"),
    # As far as sections are complete, the default of a plan: end caps and knee included.
    "TALOS twin, whole": lambda: talos_forearm("TALOS twin, whole", "talos_arm_5_forearm_collision", whole=True),
    "JVRC-1 forearm, whole": lambda: jvrc_forearm("JVRC-1 forearm, whole", None),
    "iCub thigh, whole": lambda: icub_thigh("iCub thigh, whole", whole=True),
}
