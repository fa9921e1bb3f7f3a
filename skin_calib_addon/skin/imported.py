"""Taxels that stand in a file already: their place on the fitted surface, their frames, cells and neighbours."""

import json
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from ..calibration.exchange.taxel_set import TaxelSet
from ..calibration.model import TaxelArray
from ..common.arrays import Array, BoolArray, IntArray, unit
from ..common.errors import InvalidPlan
from ..common.findings import Finding, error, warning
from ..common.surface_errors import DistanceStatistics
from ..geometry.mesh.triangle_mesh import TriangleMesh
from ..geometry.registration import ON_MESH_DISTANCE, RigidFit, find_frame
from ..geometry.surface.bspline import BSplineSurface
from ..geometry.surface.distance import MeshDistance, footpoints
from .sheet.taxels import fan_areas

# A rotation that an author gives may be off by the rounding of this many decimals.
ROTATION_TOLERANCE = 1e-3
# A taxel further from the surface than this is none of its skin [m].
MAX_SURFACE_DISTANCE = 0.01
# A footpoint at an open edge from which the taxel does not stand upright by more than this is not its own [m].
LATERAL_TOLERANCE = 1e-6
# Corners of an outline, and how far they may lie from the taxel, in pitches: as those of a square do.
OUTLINE_SIDES, MAX_CELL_RADIUS = 16, 0.5**0.5
MAX_MEAN_NEIGHBOURS = 200  # taxels about each on the mean; more share one place
# Taxels nearer than this share of the pitch have one place; cells that touch within this share of it are ties.
SAME_POINT_TOLERANCE, GABRIEL_TOLERANCE = 1e-3, 0.01
# A tangent of the file within about a degree of the normal tells nothing.
MIN_TANGENT_SINE = 0.02
POSITION_DECIMALS = 6  # decimals of a place [m]
MAX_THIRD_TAXELS = 12  # taxels about the middle of two that may lie between them
MAX_TAXELS_NAMED = 5

Frame = tuple[ArrayLike, ArrayLike]  # a rotation and a translation [m] into the link frame


@dataclass(frozen=True)
class Distances:
    """How far taxels are from the surface, and from the mesh where there is one [m]."""

    surface: DistanceStatistics
    mesh: DistanceStatistics | None


@dataclass(frozen=True, eq=False)
class ImportedTaxels:
    """Taxels of a file on the fitted surface, and what a person should know about them."""

    taxels: TaxelArray
    pitch: float  # median distance from a taxel to the nearest other [m]
    before: Distances  # of the places in the file
    after: Distances  # of their footpoints on the surface
    fit: RigidFit | None  # the search for a better frame; None without a mesh
    findings: tuple[Finding, ...]  # those of the file, then those of the place; an error if the frame is wrong


def imported_taxels(
    taxel_set: TaxelSet,
    surface: BSplineSurface,
    name: str,
    mesh: TriangleMesh | None = None,
    *,
    frame: Frame | None = None,
    snap: bool = False,
    tangent: Literal["u", "v"] = "u",
    farthest: float = MAX_SURFACE_DISTANCE,
    pitch: float | None = None,
) -> ImportedTaxels:
    """Give each taxel of a file its footpoint on a surface, and from there its outward normal and its frame.

    Positions stay as they are, and ``quality["gap"]`` tells how far outside of the surface: skin has a thickness.
    Normals of the file are compared, never used.

    Parameters
    ----------
    taxel_set : TaxelSet
    surface : BSplineSurface
    name : str
        Name of the patch; ids read ``name.label``.
    mesh : TriangleMesh, optional
        To measure distances to, and to find the frame that the taxels are in.
    frame : (rotation, translation), optional
        From the set's frame into the link's, as `placed` takes it; by default the set is in the link frame.
    snap : bool
        Whether to move every taxel to its footpoint; its gap still tells from how far.
    tangent : "u" or "v"
        Along which parameter of the surface tangents run, where the file has none.
    farthest : float
        Taxels further from the surface are named [m].
    pitch : float, optional
        Distance between neighbours, which bounds the cells [m]; by default the median of the set.

    Raises
    ------
    InvalidPlan
        If the taxels all lie in one place, and no pitch is given, or so close together that cells mean nothing; or if
        the rotation is none.
    """
    taxel_set = taxel_set if frame is None else placed(taxel_set, *frame)
    ids = tuple(f"{name}.{label}" for label in taxel_set.labels)
    given = taxel_set.positions
    uv, distance = footpoints(surface, given)
    feet, normals = surface.points(uv), surface.normals(uv)
    gap = ((given - feet) * normals).sum(axis=1)
    positions = feet if snap else given
    tangents = _tangents(taxel_set, surface, uv, normals, tangent)
    pitch = median_pitch(positions, name) if pitch is None else pitch
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
        neighbours=_symmetric(ids, adjacent),
        quality={"gap": gap},
    )
    exact = None if mesh is None else MeshDistance(mesh)
    fit = None if mesh is None else find_frame(mesh, given)
    at_edge = ((uv <= 0) | (uv >= 1)).any(axis=1)
    lateral = np.linalg.norm(given - feet - gap[:, None] * normals, axis=1)
    found = (
        *_frame_findings(name, fit, frame),
        *_named("far", ids, distance > farthest, f"further than {farthest * 1e3:g} mm from the surface"),
        *_named("beyond-edge", ids, at_edge & (lateral > LATERAL_TOLERANCE), "beyond an open edge of the surface"),
        *_flipped(name, taxel_set, normals),
    )
    before = _distances(distance, given, exact)
    return ImportedTaxels(taxels, pitch, before, _distances(0 * gap, feet, exact), fit, (*taxel_set.findings, *found))


def placed(taxel_set: TaxelSet, rotation: ArrayLike, translation: ArrayLike) -> TaxelSet:
    """A set moved into the link frame by ``rotation @ p + translation`` [m], the rotation rounded as authors write it.

    Raises
    ------
    InvalidPlan
        If the matrix is no rotation: it scales, shears or mirrors.
    """
    return taxel_set.moved(_proper(rotation), np.asarray(translation, float))


def _proper(rotation: ArrayLike) -> Array:
    matrix = np.asarray(rotation, float)
    u, _, v = np.linalg.svd(matrix)
    if np.linalg.det(matrix) < 0 or np.abs(u @ v - matrix).max() > ROTATION_TOLERANCE:
        raise InvalidPlan(f'"rotation" {np.round(matrix, 4).tolist()} is no rotation; rows must be unit, right-handed')
    return u @ v


def frame_on(taxel_set: TaxelSet, mesh: TriangleMesh, name: str, frame: Frame | None = None) -> Frame:
    """The frame in which a set lies on a mesh, where one place alone fits.

    Parameters
    ----------
    taxel_set, mesh : TaxelSet, TriangleMesh
    name : str
        Of the taxels, for messages.
    frame : (rotation, translation), optional
        From the set's frame into the link's, as far as it is known.

    Raises
    ------
    InvalidPlan
        If the set lies right already, in several places or in none; or if the rotation given is none.
    """
    given = taxel_set if frame is None else placed(taxel_set, *frame)
    fit = find_frame(mesh, given.positions)
    if fit.verdict == "moved":
        return _after(fit, frame)
    messages = [finding.message for finding in _frame_findings(name, fit, frame)]
    raise InvalidPlan(f"{name} {messages[0] if messages else 'lies on the mesh as it is; its frame needs no change'}")


def _after(fit: RigidFit, frame: Frame | None) -> tuple[Array, Array]:
    """A motion that follows the one into a frame."""
    if frame is None:
        return fit.rotation, fit.translation
    rotation, translation = frame
    return fit.rotation @ _proper(rotation), fit(np.asarray(translation, float))


def median_pitch(positions: Array, name: str) -> float:
    """Median distance from a taxel to the nearest one in another place [m].

    Raises
    ------
    InvalidPlan
        If all lie in one place.
    """
    points = positions[np.unique(np.round(positions, POSITION_DECIMALS), axis=0, return_index=True)[1]]
    if len(points) < 2:
        raise InvalidPlan(f"the taxels of {name} lie in one place, so that their cells have no size; give a pitch")
    return float(np.median(np.asarray(cKDTree(points).query(points, k=2)[0])[:, 1]))


def outlines(positions: Array, normals: Array, tangents: Array, pairs: IntArray, max_radius: float) -> Array:
    """What is nearer to a taxel than to any other in its tangent plane, as far as ``max_radius`` [m].

    Parameters
    ----------
    pairs : array of int, shape (m, 2)
        Taxels that may bound each other.

    Returns
    -------
    array, shape (n, SIDES, 3)
        Corners from the tangent on, counter-clockwise seen from outside [m].
    """
    angles = 2 * np.pi * np.arange(OUTLINE_SIDES) / OUTLINE_SIDES
    rays = np.column_stack((np.cos(angles), np.sin(angles)))
    across = np.cross(normals, tangents)
    a, b = np.concatenate((pairs, pairs[:, ::-1])).T
    gap = positions[b] - positions[a]
    flat = np.column_stack(((gap * tangents[a]).sum(axis=1), (gap * across[a]).sum(axis=1)))
    length = np.linalg.norm(gap, axis=1)  # not that of its shadow: a neighbour round a bend is as far as it is
    # One in the same place, or straight above, bounds nothing.
    apart = np.linalg.norm(flat, axis=1) > np.maximum(SAME_POINT_TOLERANCE * max_radius, SAME_POINT_TOLERANCE * length)
    a, flat, length = a[apart], unit(flat[apart]), length[apart]
    cosine = flat @ rays.T
    bound = np.where(cosine > 0, length[:, None] / 2 / np.where(cosine > 0, cosine, 1.0), np.inf)
    radius = np.full((len(positions), OUTLINE_SIDES), max_radius)
    np.minimum.at(radius, a, bound)
    arms = rays[:, :1] * tangents[:, None] + rays[:, 1:] * across[:, None]
    return positions[:, None] + radius[..., None] * arms


def gabriel(positions: Array, normals: Array, pairs: IntArray) -> IntArray:
    """The pairs of taxels whose cells touch half-way: no third one lies in the ball between them (Gabriel, 1969).

    Of four in a square, those across a corner are none: the others lie on the ball.
    """
    a, b = pairs.T
    middle, radius = (positions[a] + positions[b]) / 2, np.linalg.norm(positions[a] - positions[b], axis=1) / 2
    count = min(len(positions), MAX_THIRD_TAXELS)
    distances, third = cKDTree(positions).query(middle, k=np.arange(1, count + 1))
    facing = (normals[third] * (normals[a] + normals[b])[:, None]).sum(axis=2) > 0
    ends = np.minimum(*(np.linalg.norm(positions[third] - positions[end][:, None], axis=2) for end in (a, b)))
    between = (
        facing
        & (ends > SAME_POINT_TOLERANCE * radius[:, None])
        & (distances < (1 + GABRIEL_TOLERANCE) * radius[:, None])
    )
    return pairs[~between.any(axis=1)]


def near_pairs(positions: Array, normals: Array, far: float, name: str) -> IntArray:
    """Pairs of taxels at most ``far`` apart [m] that do not face apart, as on two sides of something thin."""
    tree = cKDTree(positions)
    if tree.count_neighbors(tree, far) > MAX_MEAN_NEIGHBOURS * len(positions):
        raise InvalidPlan(
            f"the taxels of {name} lie too close together for a pitch of {far / 2 / MAX_CELL_RADIUS * 1e3:.3g} mm"
        )
    pairs = tree.query_pairs(far, output_type="ndarray").astype(np.int64)
    return pairs[(normals[pairs[:, 0]] * normals[pairs[:, 1]]).sum(axis=1) > 0]


def _at_ports(taxel_set: TaxelSet) -> IntArray:
    """The pairs of neighbours that a file names."""
    row_of = {label: row for row, label in enumerate(taxel_set.labels)}
    named = enumerate(taxel_set.neighbours or ())
    pairs = [(row, row_of[label]) for row, labels in named for label in labels if row_of.get(label, row) != row]
    return np.array(pairs, np.int64).reshape(-1, 2)


def _symmetric(ids: tuple[str, ...], pairs: IntArray) -> tuple[tuple[str, ...], ...]:
    """Ids of the neighbours of each taxel; who has one is one."""
    adjacent: list[set[int]] = [set() for _ in ids]
    for a, b in pairs.tolist():
        adjacent[a].add(b)
        adjacent[b].add(a)
    return tuple(tuple(ids[j] for j in sorted(row)) for row in adjacent)


def _tangents(taxel_set: TaxelSet, surface: BSplineSurface, uv: Array, normals: Array, along: str) -> Array:
    """Unit tangents at a right angle to the normals: the file's where it has some, else along the surface."""
    r = surface.derivatives(uv)
    wanted = r[1, 0] if along == "u" else r[0, 1]
    if taxel_set.tangents is not None:
        upright = np.linalg.norm(np.cross(taxel_set.tangents, normals), axis=1) < MIN_TANGENT_SINE
        wanted = np.where(upright[:, None], wanted, taxel_set.tangents)
    wanted = unit(wanted)
    return unit(wanted - (wanted * normals).sum(axis=1, keepdims=True) * normals)


def _distances(distance: Array, points: Array, exact: MeshDistance | None) -> Distances:
    ones = np.ones(len(points))
    to_mesh = None if exact is None else DistanceStatistics.of(exact(points)[0], ones)
    return Distances(DistanceStatistics.of(distance, ones), to_mesh)


def _named(code: str, ids: tuple[str, ...], chosen: BoolArray, where: str) -> Iterator[Finding]:
    """One warning that names the first of the chosen taxels; its value names all."""
    names = [ids[i] for i in np.flatnonzero(chosen)]
    if names:
        shown = ", ".join(names[:MAX_TAXELS_NAMED]) + (", ..." if len(names) > MAX_TAXELS_NAMED else "")
        lie = "taxel lies" if len(names) == 1 else "taxels lie"
        yield warning(code, names[0], f"is where {len(names)} {lie} {where}: {shown}", names)


def _flipped(name: str, taxel_set: TaxelSet, normals: Array) -> Iterator[Finding]:
    if taxel_set.normals is None:
        return
    count = int(np.count_nonzero((taxel_set.normals * normals).sum(axis=1) < 0))
    if count:
        message = f"has {count} of {len(normals)} normals that point inwards in the file; outward ones are used"
        yield warning("flipped-normals", name, message, count)


def _frame_findings(name: str, fit: RigidFit | None, given: Frame | None) -> Iterator[Finding]:
    """Whether the taxels are in the link frame, and what would bring them there in place of the frame given."""
    if fit is None or fit.before.mean <= ON_MESH_DISTANCE:
        return
    off, left = f"{fit.before.mean * 1e3:.1f} mm", f"{fit.after.mean * 1e3:.1f} mm"
    rotation, translation = (np.round(part, 9).tolist() for part in _after(fit, given))
    frame = {"rotation": rotation, "translation": translation}
    if fit.verdict == "moved":
        message = f"lies {off} off the mesh on the mean, and {left} in another frame, which may slide by "
        message += f'{fit.slack * 1e3:.0f} mm; if that is right, give it "frame": {json.dumps(frame)}'
        yield error("wrong-frame", name, message, frame)
    elif fit.verdict == "ambiguous":
        message = f"lies {off} off the mesh on the mean; it would lie on it in several places, so give its frame, as "
        message += f"in {json.dumps(frame)} ({left})"
        yield error("wrong-frame", name, message, frame)
    elif fit.verdict == "lost":
        message = (
            f"lies {off} off the mesh on the mean, and no motion brings it nearer than {left}; check link and unit"
        )
        yield (error if fit.before.mean > MAX_SURFACE_DISTANCE else warning)("off-mesh", name, message, fit.before.mean)
    else:
        message = f"lies {off} off the mesh on the mean, and no motion brings it much nearer: is the skin so thick?"
        yield warning("off-mesh", name, message, fit.before.mean)
