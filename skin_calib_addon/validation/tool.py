"""The poses of a tool that touches a link, by motion capture, and where its mesh touches that of the link."""

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ..common.arrays import Array, BoolArray, IntArray, freeze
from ..common.errors import listed
from ..common.findings import show
from ..common.tables import TableError
from ..common.warnings import Warning

# Contract: names of the columns.
OF_TOOL, OF_LINK = (
    tuple(f"{of}_{name}" for name in ("x", "y", "z", "qx", "qy", "qz", "qw")) for of in ("tool", "link")
)
MESH_UNITS = ("m", "cm", "mm", "in")  # Contract: that the comment can name
# [1] of the length of a quaternion from 1: they are written with a few digits. Larger: takes other numbers for one.
MAX_QUATERNION_ERROR = 0.02
# [m] depth of a tool in the mesh of the link from which on a warning is given: layers are softer, but thin. Larger:
# fewer warnings.
MAX_DEPTH = 3e-3
# [m] spread (rms) of the nearest points of a tool from which on a warning is given. Larger: fewer warnings.
MAX_SPREAD = 1.5e-3
MIN_NOISE_ROWS = 5  # [1] more than presses, for their noise. Smaller: the noise is less exact.


@dataclass(frozen=True, eq=False)
class Noise:
    """Scatter of poses around the mean of their press, standard deviation per axis; motion of the tool counts."""

    position: float  # [m]
    rotation: float  # [rad]

    def at(self, levers: Array | float) -> Array:
        """Return the uncertainty per axis across levers [m] at their ends [m]."""
        return np.asarray(np.hypot(self.position, self.rotation * levers))


@dataclass(frozen=True, eq=False)
class ToolRows:
    """Poses of a tool in the rows of a table; quaternions are x, y, z, w."""

    file: Path  # of its mesh
    unit: str
    positions: Array  # (n, 3) of its origin in the frame of the link [m]
    quaternions: Array  # (n, 4) from its frame to that of the link
    measured: Array  # (n, 7) as in the file
    of_link: Array | None  # (n, 7) likewise; None: the others are in the frame of the link

    @classmethod
    def read(
        cls, text: str, header: int, folder: Path, lines: IntArray, tool: Array | None, link: Array | None
    ) -> "ToolRows":
        """Return the poses in a table; a comment has its mesh, relative to the folder."""
        assert tool is not None
        file, unit = _mesh_in(text, header)
        for name, poses in (("tool", tool), ("link", link)):
            if poses is not None:
                lengths = np.linalg.norm(poses[:, 3:], axis=1)
                for k in np.flatnonzero(~(np.abs(lengths - 1) <= MAX_QUATERNION_ERROR))[:1]:
                    message = f"the quaternion of the {name} has the length {lengths[k]:.3g} instead of 1"
                    raise TableError(int(lines[k]), f"{message}. Check its columns {name}_qx to {name}_qw")
                poses[:, 3:] /= lengths[:, None]
        return cls(folder / file, unit, *relative(tool, link), tool, link)

    def of_presses(self, lines: IntArray, groups: Sequence[IntArray]) -> "ToolPoses":
        """Return the medians of presses, whose rows are in groups."""
        tool, link = (None if p is None else _noise(p, groups) for p in (self.measured, self.of_link))
        medians = [_middle(self.positions[rows], self.quaternions[rows], np.median) for rows in groups]
        positions, quaternions = (np.array(part) for part in zip(*medians))
        first = np.array([rows[0] for rows in groups])
        measured = self.measured[first], None if self.of_link is None else self.of_link[first]
        rows = np.array([len(rows) for rows in groups])
        return ToolPoses(self.file, self.unit, lines, rows, positions, matrices(quaternions), tool, link, *measured)


@dataclass(frozen=True, eq=False)
class ToolPoses:
    """Poses of a tool at touches, in the frame of the link; row i of every array is the same touch."""

    file: Path  # of its mesh
    unit: str
    lines: IntArray  # (n,)
    rows: IntArray  # (n,) number of those whose median each pose is
    positions: Array  # (n, 3) of its origin [m]
    rotations: Array  # (n, 3, 3) from its frame
    noise: Noise | None  # None: too few rows
    noise_of_link: Noise | None
    measured: Array  # (n, 7) as in the file, of the first row
    of_link: Array | None  # (n, 7) likewise

    def alternatives(self) -> Iterator[tuple[str, "ToolPoses"]]:
        """Yield what the columns could have instead of what their names say, and the poses then."""
        both = self.measured, self.of_link
        w_first = [None if p is None else np.hstack((p[:, :3], np.roll(p[:, 3:], -1, axis=1))) for p in both]
        inverse = [None if p is None else p * (1, 1, 1, -1, -1, -1, 1) for p in both]
        yield "quaternions with w first", self._with(*w_first)
        yield "inverse quaternions", self._with(*inverse)
        if self.of_link is not None:
            yield "poses of the tool in the frame of the link", self._with(self.measured, None)
        for factor, words in ((1e3, "larger"), (1e-3, "smaller")):
            scaled = [None if p is None else p * np.array((factor,) * 3 + (1,) * 4) for p in both]
            yield f"positions in a unit that is 1000 times {words}", self._with(*scaled)

    def _with(self, tool: Array | None, link: Array | None) -> "ToolPoses":
        assert tool is not None
        positions, quaternions = relative(tool, link)
        return replace(self, positions=positions, rotations=matrices(quaternions))


@dataclass(frozen=True, eq=False)
class ToolContacts:
    """Where the mesh of a tool touches that of a link, in its frame; row i of every array is the same touch."""

    poses: ToolPoses
    points: Array  # (n, 3) of the tool, that are nearest to the link or deepest in it [m]
    distances: Array  # (n,) of these from the link; negative inside [m]
    spreads: Array  # (n,) root mean square distance of equally near points from their mean [m]
    at_rim: BoolArray  # (n,) whether the mesh of the link ends there
    intersecting: IntArray  # (k,) touches whose meshes intersect
    centroids: Array  # (k, 3) of the part of the tool's surface that is inside the link [m]
    centroid_distances: Array  # (k,) of these from the link [m]
    is_closed: bool  # the mesh of the tool

    def __post_init__(self):
        n, k = len(self.points), len(self.intersecting)
        freeze(self, points=(n, 3), distances=(n,), spreads=(n,), centroids=(k, 3), centroid_distances=(k,))

    def summary(self) -> Iterator[tuple[str, str]]:
        """Yield a table of both points of touch, and the uncertainty by the noise of the poses."""
        yield "tool", f"{'point of touch':28}{'touches':>8}{'distance: mean, deviation':>28}{'from the first, rms':>22}"
        yield "", _row("nearest approach", self.distances, "")
        apart = np.linalg.norm(self.centroids - self.points[self.intersecting], axis=1)
        rms = f"{1e3 * np.sqrt(np.mean(apart**2)):.2f} mm" if len(apart) else ""
        yield "", _row("centroid of the intersection", self.centroid_distances, rms)
        for name, noise, levers in self._poses():
            lever = float(np.sqrt((levers**2).mean()))
            if noise is not None:
                yield (
                    f"pose of the {name}",
                    f"scatter {np.rad2deg(noise.rotation):.2f} degrees x lever {lever * 1e3:.0f} mm = "
                    f"{noise.rotation * lever * 1e3:.2f} mm, {noise.position * 1e3:.2f} mm of the position: "
                    f"{noise.at(lever) * 1e3:.2f} mm per axis",
                )
            else:
                yield f"pose of the {name}", f"lever {lever * 1e3:.0f} mm; too few rows of each press for their scatter"

    def _poses(self) -> Iterator[tuple[str, Noise | None, Array]]:
        """Yield tool and link, as far as their poses were measured, with their scatter and the levers (n,) [m]."""
        yield "tool", self.poses.noise, np.linalg.norm(self.points - self.poses.positions, axis=1)
        if self.poses.of_link is not None:
            yield "link", self.poses.noise_of_link, np.linalg.norm(self.points, axis=1)

    @property
    def sigma(self) -> Array:
        """Standard errors (n,) of the points, per axis, by the scatter of the poses as far as it is known [m]."""
        variance = sum((n.at(levers) ** 2 for _, n, levers in self._poses() if n), np.zeros(len(self.points)))
        return np.sqrt(variance * np.minimum(1.0, np.pi / 2 / self.poses.rows))  # of medians

    def warnings(self) -> Iterator[Warning]:
        """Yield warnings: deep touches, wide ones, those at the rim of a hole, and a tool with holes."""
        deep, wide = self.distances < -MAX_DEPTH, self.spreads > MAX_SPREAD
        if deep.any():
            message = f"The tool is more than {MAX_DEPTH * 1e3:g} mm inside the link: {self._lines(deep)}."
            advice = "Check the poses, the meshes and the unit of the tool."
            yield Warning("tool-depth", "warning", message, value=float(-self.distances.min()), advice=advice)
        if wide.any():
            spread = f"up to {self.spreads.max() * 1e3:.1f} mm (rms) from their mean"
            message = f"Points of the tool that are equally near to the link are {spread}: {self._lines(wide)}."
            advice = "Press with a round tip."
            yield Warning("wide-contact", "warning", message, value=float(self.spreads.max()), advice=advice)
        if self.at_rim.any():
            message = (
                f"The tool is at a hole of the mesh of the link, which has no inside there: {self._lines(self.at_rim)}."
            )
            advice = "Touch other positions, or close the mesh."
            yield Warning("tool-at-hole", "warning", message, value=float(self.at_rim.sum()), advice=advice)
        if not self.is_closed:
            message = f"The mesh of the tool, {self.poses.file.name}, has holes: what is missing cannot touch."
            yield Warning("tool-open", "warning", message, advice="Close the mesh where the tool touches.")

    def _lines(self, chosen: BoolArray) -> str:
        return listed([f"line {line}" for line in self.poses.lines[chosen].tolist()])


def _row(name: str, distances: Array, rest: str) -> str:
    mm = distances * 1e3
    words = f"{mm.mean():.2f}, {mm.std():.2f} mm" if len(mm) else ""
    return f"{name:28}{len(mm):8}{words:>28}{rest:>22}".rstrip()


def _mesh_in(text: str, header: int) -> tuple[str, str]:
    """Return file and unit of the mesh that a comment names."""
    found = [
        (number, match[1])
        for number, line in enumerate(text.split("\n"), 1)
        if (match := re.fullmatch(r"#\s*tool\s*:\s*(.*?)\s*", line))
    ]
    example = 'Add a comment "# tool: tool.stl mm"'
    if len(found) != 1:
        problem = "names no mesh of the tool" if not found else "names several meshes of tools"
        raise TableError(header if not found else found[1][0], f"the file {problem}. {example}, with file and unit")
    file, _, unit = found[0][1].rpartition(" ")
    if unit not in MESH_UNITS or not file.strip():
        problem = f"the comment ends in {show(unit)} instead of a unit: {', '.join(MESH_UNITS)}"
        raise TableError(found[0][0], f"{problem}. {example}")
    return file.strip(), unit


def relative(tool: Array, link: Array | None) -> tuple[Array, Array]:
    """Return positions (n, 3) and quaternions (n, 4) of a tool in the frame of a link, from poses (n, 7)."""
    if link is None:
        return tool[:, :3], tool[:, 3:]
    to_link = link[:, 3:] * (-1, -1, -1, 1)
    positions = np.einsum("nij,nj->ni", matrices(to_link), tool[:, :3] - link[:, :3])
    return positions, product(to_link, tool[:, 3:])


def matrices(quaternions: Array) -> Array:
    """Return the rotations (n, 3, 3) of unit quaternions x, y, z, w."""
    crossed = np.cross(np.eye(3), quaternions[:, None, :3])  # (n, 3, 3): times a vector, the cross product with it
    rotation: Array = np.eye(3) + 2 * (quaternions[:, 3, None, None] * crossed + crossed @ crossed)
    return rotation


def product(a: Array, b: Array) -> Array:
    """Return the products (n, 4) of quaternions x, y, z, w."""
    (va, wa), (vb, wb) = ((q[:, :3], q[:, 3:]) for q in (a, b))
    return np.hstack((wa * vb + wb * va + np.cross(va, vb), wa * wb - (va * vb).sum(axis=1, keepdims=True)))


def _middle(positions: Array, quaternions: Array, of: Callable[..., Array]) -> tuple[Array, Array]:
    """Return the mean or median of poses."""
    signs = np.where(quaternions @ quaternions[0] < 0, -1.0, 1.0)
    middle = of(quaternions * signs[:, None], axis=0)
    return of(positions, axis=0), middle / np.linalg.norm(middle)


def _noise(poses: Array, groups: Sequence[IntArray]) -> Noise | None:
    """Return the scatter of poses (n, 7) in presses."""
    count = sum(len(rows) - 1 for rows in groups)
    if count < MIN_NOISE_ROWS:
        return None
    squares = np.zeros(2)
    for rows in groups:
        position, quaternion = _middle(poses[rows, :3], poses[rows, 3:], np.mean)
        turns = product(poses[rows, 3:], np.tile(quaternion * (-1, -1, -1, 1), (len(rows), 1)))
        sines = np.linalg.norm(turns[:, :3], axis=1)
        angles = 2 * np.arctan2(sines, np.abs(turns[:, 3]))
        squares += ((poses[rows, :3] - position) ** 2).sum(), (angles**2).sum()
    return Noise(*np.sqrt(squares / (3 * count)).tolist())
