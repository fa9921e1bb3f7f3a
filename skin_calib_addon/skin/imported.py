"""Taxels of a file on the fitted surface: footpoints, frames, cells and neighbours."""

import json
import re
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from ..calibration.exchange.taxel_set import SAME_POSITION, TaxelSet
from ..calibration.model import MIN_TAXEL_DISTANCE, TaxelArray, fan_areas
from ..common.arrays import Array, BoolArray, IntArray, tangential, unit
from ..common.errors import InvalidPlan, listed
from ..common.findings import Finding, error, show, warning
from ..common.surface_errors import DistanceStatistics
from ..geometry.mesh.distance import closest
from ..geometry.mesh.triangle_mesh import TriangleMesh
from ..geometry.registration import MAX_SKIN_THICKNESS, ON_MESH_DISTANCE, RigidFit, find_frame
from ..geometry.surface.bspline import BSplineSurface
from ..geometry.surface.footpoints import footpoints
from .board_planes import board_planes
from .neighbours import mutual
from .sheet.constraints import MIN_DIRECTION_SINE

# Smallest cosine of the angle between a board of a file and the surface that it belongs to. Larger: more boards have
# the normals of the surface.
MIN_COVERED_COSINE = 0.5
# Largest deviation of a given matrix from a rotation; covers four decimals. Larger: accepts less exact matrices.
ROTATION_MATRIX_TOLERANCE = 1e-3
# Sides of the outline of a cell. Larger: rounder cells, larger files.
OUTLINE_SIDES = 16
# Derived: largest radius of a cell in pitches, that of the corners of a square.
MAX_CELL_RADIUS = 0.5**0.5
# Limit of the mean number of taxels near each taxel; protects the memory. More of them are at the same position.
MAX_MEAN_NEIGHBOURS = 200
# Taxels in one place on the surface are an error if they are farther apart than this in the file, in pitches. Larger:
# finds fewer pairs.
APART_PITCHES = 0.5
# Relative difference of two distances between taxels up to which they are equal. Larger: fewer neighbours, and close
# taxels do not bound their cells.
DISTANCE_ROUNDING = 0.01

Frame = tuple[ArrayLike, ArrayLike]  # a rotation and a translation [m] into the link frame


@dataclass(frozen=True)
class Distances:
    """Distances of taxels from the surface, and from the mesh if there is one [m]."""

    surface: DistanceStatistics
    mesh: DistanceStatistics | None


@dataclass(frozen=True, eq=False)
class ImportedTaxels:
    """Taxels of a file on the fitted surface, and the findings about them."""

    taxels: TaxelArray
    pitch: float  # median distance from a taxel to the nearest other one [m]
    before: Distances  # of the positions in the file
    after: Distances  # of their footpoints on the surface
    fit: RigidFit | None  # the search for a better frame; None without a mesh
    findings: tuple[Finding, ...]  # of the file, then of the positions; an error if the frame is wrong
    link: str | None  # that the file names; None if it names none, or if a frame is given

    def on(self, link: str) -> "ImportedTaxels":
        """Return these taxels on a link of a robot, with a warning if the file names another one."""
        if self.link is None or _words(self.link) <= _words(link) or _words(link) <= _words(self.link):
            return self
        message = f"names the link {show(self.link)}, but the plan is of the link {show(link)}; check the file"
        return replace(self, findings=(warning("other-link", "the file", message, self.link), *self.findings))


def _words(link: str) -> set[str]:
    """Return the words in the name of a link or of its frame: ``left_foot_link`` has those of ``l_foot``."""
    words = re.findall(r"[a-z]+|[0-9]+", re.sub(r"(?<=[a-z])(?=[A-Z])", "_", link).lower())
    return {{"left": "l", "right": "r"}.get(word, word) for word in words} - {"link", "frame", "skin", "dh"}


def imported_taxels(
    taxel_set: TaxelSet,
    surface: BSplineSurface,
    name: str,
    mesh: TriangleMesh | None = None,
    *,
    frame: Frame | None = None,
    snap: bool = False,
) -> ImportedTaxels:
    """Return the taxels of a file with footpoints, outward normals and frames of a surface.

    Positions do not change. ``quality["gap"]`` is the height of each taxel above the surface [m], as a skin has a
    thickness. Taxels of a rigid board have the normal of its plane, see :func:`.board_planes.board_planes`; the surface
    gives its sign. Other taxels have the normal of the surface. Normals of the file are compared, but not used.
    """
    taxel_set = taxel_set if frame is None else placed(taxel_set, *frame)  # which has no name of a link any more
    ids = tuple(f"{name}.{label}" for label in taxel_set.labels)
    given = taxel_set.positions
    uv, distance = footpoints(surface, given)
    feet, upright = surface.points(uv), surface.normals(uv)
    gap = ((given - feet) * upright).sum(axis=1)
    normals = upright if snap else board_normals(taxel_set, upright)
    positions = feet if snap else given
    tangents = _tangents(taxel_set, surface, uv, normals)
    pitch = median_pitch(positions, name)
    pairs = near_pairs(positions, normals, 2 * MAX_CELL_RADIUS * pitch, name)
    corners = outlines(positions, normals, tangents, pairs, MAX_CELL_RADIUS * pitch)
    adjacent = gabriel(positions, normals, pairs) if taxel_set.neighbours is None else _at_ports(taxel_set)
    taxels = TaxelArray(
        ids=ids,
        channels=taxel_set.channels,
        index=np.column_stack((np.arange(len(ids)), np.zeros(len(ids), np.int64))),
        uv=uv,
        positions_link=positions,
        normals_link=normals,
        tangents_link=tangents,
        corners_link=corners,
        areas=fan_areas(positions, corners),
        neighbours=mutual(ids, adjacent),
        quality={"gap": gap},
    )
    fit = None if mesh is None else find_frame(mesh, given)
    at_edge = ((uv <= 0) | (uv >= 1)).any(axis=1)
    lateral = np.linalg.norm(given - feet - gap[:, None] * upright, axis=1)
    found = (
        *_frame_findings(name, fit, frame),
        *_named(
            "far", ids, distance > MAX_SKIN_THICKNESS, f"farther than {MAX_SKIN_THICKNESS * 1e3:g} mm from the surface"
        ),
        *_named("beyond-edge", ids, at_edge & (lateral > SAME_POSITION), "beyond an open edge of the surface"),
        *_flipped(name, taxel_set, normals),
        *_merged(ids, given, positions, pitch),
    )
    before = _distances(distance, given, mesh)
    return ImportedTaxels(
        taxels, pitch, before, _distances(0 * gap, feet, mesh), fit, (*taxel_set.findings, *found), taxel_set.frame
    )


def board_normals(taxel_set: TaxelSet, upright: Array) -> Array:
    """Return the normals of the boards of a set, and of the surface for taxels without a board, shape (n, 3)."""
    board, planes = board_planes(taxel_set.positions, taxel_set.boards)
    normals = upright.copy()
    for number in np.unique(board[board >= 0]):
        members = np.flatnonzero(board == number)
        plane = planes[members[0]]
        cosine = float((upright[members] @ plane).mean())
        if abs(cosine) > MIN_COVERED_COSINE:
            normals[members] = np.copysign(1.0, cosine) * plane
    return normals


def placed(taxel_set: TaxelSet, rotation: ArrayLike, translation: ArrayLike) -> TaxelSet:
    """Return a set in the link frame: ``rotation @ p + translation``."""
    return taxel_set.moved(_proper(rotation), np.asarray(translation, float))


def _proper(rotation: ArrayLike) -> Array:
    matrix = np.asarray(rotation, float)
    if problem := not_a_rotation(matrix):
        raise InvalidPlan(f"the matrix {np.round(matrix, 4).tolist()} is not a rotation: it {problem}")
    u, _, v = np.linalg.svd(matrix)
    return u @ v


def not_a_rotation(matrix: Array) -> str:
    """Return what a matrix (3, 3) does that a rotation does not, as the end of a sentence; empty for a rotation."""
    u, stretch, v = np.linalg.svd(matrix)
    if np.linalg.det(matrix) < 0:
        return "mirrors. Reverse one of its axes"
    if np.abs(u @ v - matrix).max() <= ROTATION_MATRIX_TOLERANCE:
        return ""
    if np.ptp(stretch) <= ROTATION_MATRIX_TOLERANCE * stretch[0]:
        return f"scales by {stretch.mean():.6g}. Give rows of length one"
    return f"stretches directions by {stretch[2]:.4g} to {stretch[0]:.4g}. Give orthogonal rows of length one"


def frame_on(taxel_set: TaxelSet, mesh: TriangleMesh, name: str, frame: Frame | None = None) -> Frame:
    """Return the frame in which a set lies on a mesh, if there is exactly one."""
    given = taxel_set if frame is None else placed(taxel_set, *frame)
    fit = find_frame(mesh, given.positions)
    if fit.verdict == "moved":
        return _after(fit, frame)
    messages = [finding.message for finding in _frame_findings(name, fit, frame)]
    raise InvalidPlan(f"{name} {messages[0] if messages else 'is on the mesh already; its frame needs no change'}")


def _after(fit: RigidFit, frame: Frame | None) -> tuple[Array, Array]:
    """Return the transform into a frame, followed by a fitted motion."""
    if frame is None:
        return fit.rotation, fit.translation
    rotation, translation = frame
    return fit.rotation @ _proper(rotation), fit(np.asarray(translation, float))


def median_pitch(positions: Array, name: str) -> float:
    """Return the median distance from a taxel to the nearest one at another position [m]."""
    points = positions[np.unique(np.round(positions / SAME_POSITION), axis=0, return_index=True)[1]]
    if len(points) < 2:
        raise InvalidPlan(
            f"the taxels of {name} have one position, so that their cells have no size. Import at least two"
        )
    return float(np.median(np.asarray(cKDTree(points).query(points, k=2)[0])[:, 1]))


def outlines(positions: Array, normals: Array, tangents: Array, pairs: IntArray, max_radius: float) -> Array:
    """Return the cells, corners (n, s, 3) [m]: the points nearer to a taxel than to any other, in its tangent plane."""
    angles = 2 * np.pi * np.arange(OUTLINE_SIDES) / OUTLINE_SIDES
    rays = np.column_stack((np.cos(angles), np.sin(angles)))
    across = np.cross(normals, tangents)
    a, b = np.concatenate((pairs, pairs[:, ::-1])).T
    gap = positions[b] - positions[a]
    flat = np.column_stack(((gap * tangents[a]).sum(axis=1), (gap * across[a]).sum(axis=1)))
    length = np.linalg.norm(gap, axis=1)  # in space, not in the tangent plane: exact around a bend
    # A taxel at the same position, or straight above, is no bound.
    apart = np.linalg.norm(flat, axis=1) > DISTANCE_ROUNDING * np.maximum(max_radius, length)
    a, flat, length = a[apart], unit(flat[apart]), length[apart]
    cosine = flat @ rays.T
    bound = np.where(cosine > 0, length[:, None] / 2 / np.where(cosine > 0, cosine, 1.0), np.inf)
    radius = np.full((len(positions), OUTLINE_SIDES), max_radius)
    np.minimum.at(radius, a, bound)
    arms = rays[:, :1] * tangents[:, None] + rays[:, 1:] * across[:, None]
    return positions[:, None] + radius[..., None] * arms


def gabriel(positions: Array, normals: Array, pairs: IntArray) -> IntArray:
    """Return the pairs of taxels whose cells touch: no third one is in the ball between them (Gabriel, 1969).

    The diagonals of a square are not pairs, as the other two corners are on the ball.
    """
    a, b = pairs.T
    middle, radius = (positions[a] + positions[b]) / 2, np.linalg.norm(positions[a] - positions[b], axis=1) / 2
    inside = cKDTree(positions).query_ball_point(middle, (1 + DISTANCE_ROUNDING) * radius)
    pair = np.repeat(np.arange(len(pairs)), [len(row) for row in inside])
    third = np.array([k for row in inside for k in row], np.int64)
    facing = (normals[third] * (normals[a] + normals[b])[pair]).sum(axis=1) > 0
    ends = np.minimum(*(np.linalg.norm(positions[third] - positions[end[pair]], axis=1) for end in (a, b)))
    return np.delete(pairs, pair[facing & (ends > DISTANCE_ROUNDING * radius[pair])], axis=0)


def near_pairs(positions: Array, normals: Array, far: float, name: str) -> IntArray:
    """Return the pairs (m, 2) of near taxels with an angle below 90 degrees between their normals."""
    tree = cKDTree(positions)
    if tree.count_neighbors(tree, far) > MAX_MEAN_NEIGHBOURS * len(positions):
        raise InvalidPlan(
            f"the taxels of {name} are too close together for a pitch of {far / 2 / MAX_CELL_RADIUS * 1e3:.3g} mm. "
            "Remove those at the same position"
        )
    pairs = tree.query_pairs(far, output_type="ndarray").astype(np.int64)
    return pairs[(normals[pairs[:, 0]] * normals[pairs[:, 1]]).sum(axis=1) > 0]


def _at_ports(taxel_set: TaxelSet) -> IntArray:
    """Return the pairs of neighbours that a file states."""
    row_of = {label: row for row, label in enumerate(taxel_set.labels)}
    named = enumerate(taxel_set.neighbours or ())
    pairs = [(row, row_of[label]) for row, labels in named for label in labels if row_of.get(label, row) != row]
    return np.array(pairs, np.int64).reshape(-1, 2)


def _tangents(taxel_set: TaxelSet, surface: BSplineSurface, uv: Array, normals: Array) -> Array:
    """Return unit tangents perpendicular to the normals: those of the file, or else along u."""
    wanted = surface.derivatives(uv)[1, 0]
    if taxel_set.tangents is not None:
        upright = np.linalg.norm(np.cross(taxel_set.tangents, normals), axis=1) < MIN_DIRECTION_SINE
        wanted = np.where(upright[:, None], wanted, taxel_set.tangents)
    return tangential(unit(wanted), normals)


def _distances(distance: Array, points: Array, mesh: TriangleMesh | None) -> Distances:
    ones = np.ones(len(points))
    to_mesh = None if mesh is None else DistanceStatistics.of(closest(mesh, points)[0], ones)
    return Distances(DistanceStatistics.of(distance, ones), to_mesh)


def _named(code: str, ids: tuple[str, ...], chosen: BoolArray, where: str) -> Iterator[Finding]:
    """Yield one warning with the first of the chosen taxels; its value names all."""
    names = [ids[i] for i in np.flatnonzero(chosen)]
    if names:
        message = f"is the first of {len(names)} taxels {where}: {listed(names)}"
        if len(names) == 1:
            message = f"is the only taxel {where}"
        yield warning(code, names[0], message, names)


def _flipped(name: str, taxel_set: TaxelSet, normals: Array) -> Iterator[Finding]:
    if taxel_set.normals is None:
        return
    count = int(np.count_nonzero((taxel_set.normals * normals).sum(axis=1) < 0))
    if count:
        message = f"has {count} of {len(normals)} normals that point inwards in the file; outward ones are used"
        yield warning("flipped-normals", name, message, count)


def _merged(ids: tuple[str, ...], given: Array, positions: Array, pitch: float) -> Iterator[Finding]:
    """Yield an error if taxels that are apart in the file are in one place on the surface."""
    pairs = cKDTree(positions).query_pairs(MIN_TAXEL_DISTANCE * pitch, output_type="ndarray")
    apart = np.linalg.norm(given[pairs[:, 0]] - given[pairs[:, 1]], axis=1)
    found = np.flatnonzero(apart > APART_PITCHES * pitch)
    if len(found):
        first = found[np.lexsort(pairs[found].T[::-1])[0]]
        a, b = (ids[i] for i in pairs[first])
        message = (
            f"and {b} are {apart[first] * 1e3:.1f} mm apart in the file and in one place on the surface, the first "
        )
        message += f"of {len(found)} pairs; import them without snap"
        yield error("merged", a, message, len(found))


def _frame_findings(name: str, fit: RigidFit | None, given: Frame | None) -> Iterator[Finding]:
    """Yield a finding if the taxels are not in the link frame, with the frame that fits instead of the given one."""
    if fit is None:
        return
    nearby = fit.nearby
    if nearby is not None and nearby.is_better:
        small = replace(fit, rotation=nearby.rotation, translation=nearby.translation)
        rotation, translation = (np.round(part, 9).tolist() for part in _after(small, given))
        frame = {"rotation": rotation, "translation": translation}
        message = f"fits the mesh better after a motion of {np.rad2deg(nearby.angle):.1f} degrees and "
        message += (
            f"{nearby.shift * 1e3:.1f} mm: the heights above it then deviate by {nearby.after * 1e3:.2f} instead of "
        )
        message += f'{nearby.before * 1e3:.2f} mm (rms). Check its frame, as in "frame": {json.dumps(frame)}'
        yield warning("near-frame", name, message, frame)
    if fit.before.mean <= ON_MESH_DISTANCE:
        return
    off, left = f"{fit.before.mean * 1e3:.1f} mm", f"{fit.after.mean * 1e3:.1f} mm"
    rotation, translation = (np.round(part, 9).tolist() for part in _after(fit, given))
    frame = {"rotation": rotation, "translation": translation}
    if fit.verdict == "moved":
        message = f"is {off} off the mesh on average, and {left} in another frame, which may slide by "
        message += f'{fit.slack * 1e3:.0f} mm; if that is right, give it "frame": {json.dumps(frame)}'
        yield error("wrong-frame", name, message, frame)
    elif fit.verdict == "ambiguous":
        message = f"is {off} off the mesh on average; it fits the mesh in several positions, so give its frame, as "
        message += f"in {json.dumps(frame)} ({left})"
        yield error("wrong-frame", name, message, frame)
    elif fit.verdict == "lost":
        message = f"is {off} off the mesh on average, and no motion brings it nearer than {left}; check link and unit"
        yield (error if fit.before.mean > MAX_SKIN_THICKNESS else warning)("off-mesh", name, message, fit.before.mean)
    else:
        message = f"is {off} off the mesh on average, and no motion brings it much nearer: is the skin so thick?"
        yield warning("off-mesh", name, message, fit.before.mean)
