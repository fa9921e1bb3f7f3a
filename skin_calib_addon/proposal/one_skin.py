"""One skin at the place that an author names, on a surface that carries this place."""

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import islice
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..calibration.model import TaxelArray
from ..common.arrays import Array, BoolArray, IntArray, cross, pairs_of, tangential
from ..common.errors import InvalidPlan, SkinCalibError, counted, millimetres
from ..geometry.components import components
from ..geometry.grid.axis import Axis
from ..geometry.grid.grids import Grid, Size, Tube
from ..geometry.mesh.cover import CoverSpec, seen_faces
from ..geometry.mesh.distance import closest
from ..geometry.mesh.triangle_mesh import TriangleMesh
from ..geometry.mesh.visibility import visibility
from ..geometry.surface.bspline import BSplineSurface
from ..geometry.surface.footpoints import footpoints
from ..pipeline import Calibrated, calibrate
from ..pipeline.place_skins import place_skin, sheet_on
from ..plan.plan import PROPOSAL_MESH, SURFACE, Plan, Surface
from ..plan.skins import BoardSkin, SheetSkin
from ..skin.boards.ground import MAX_DISTANCE
from ..skin.lattice import CORNERS, SheetLattice
from ..skin.sheet.constraints import row_axis
from ..skin.sheet.geodesic import trace, unroll
from ..skin.sheet.landmarks import MAX_POINT_DISTANCE, Landmark, located
from ..skin.sheet.wrap import on_surface
from .boards import usable, with_cells
from .candidates import DECIMALS, own_axes
from .link_points import LinkPoints
from .surfaces import Proposed, even_parameters, fitted
from .trial import region_size

# [m] cubes of which one site of a surface is tried. Larger: faster, the place that is found is farther.
SITE_CUBE = 5e-3
# [rad] step of the directions that are tried. Larger: faster, fewer places are found.
TURN = np.deg2rad(22.5)
TURNS = 4  # of these steps, to either side. Larger: also directions opposite to that of the author
# [1] sheets that are traced together. Larger: more work after the first one that fits.
TRACED = 2000
# [1] exact placements that are tried. Larger: slower where hardly anything fits.
MAX_TRIES = 30
# [rad] of a cell to the mesh below it, up to which it is on the cover; above 15 degrees the fit warns. Larger: sheets
# over edges of the mesh fit.
MAX_OBLIQUE = np.deg2rad(30.0)
# [1] ratio of the sizes of sheets, and of the numbers of boards, that are tried if none fits on the link.
SMALLER = 0.8
AT_DECIMALS = 4  # of the point [m] that is named. Larger: longer commands
NO_CELLS = np.zeros((0, 4, 3))


class Spot(NamedTuple):
    """A place on the outside of a link, for the middle of a skin."""

    point: tuple[float, float, float]  # [m]
    direction: tuple[float, float, float]  # along the rows
    normal: Array  # (3,) unit, outward
    distance: float  # of the point from the one that the author gave [m]


@dataclass(frozen=True, eq=False)
class Carrier:
    """A surface, and where on it the centre of a cell can be."""

    proposed: Proposed
    u: Array  # (k,) parameters of sites
    v: Array  # (l,)
    good: BoolArray  # (k, l) sites inside the boundary, near the mesh and along it

    @classmethod
    def of(cls, proposed: Proposed) -> "Carrier":
        """Return the sites of a surface."""
        fit, surface = proposed.fit, proposed.fit.error_field.surface
        u, v = even_parameters(fit, surface)
        uv = pairs_of(u, v)
        good = fit.is_trusted(uv)
        distance, face, _ = closest(fit.given_mesh, surface.points(uv[good]))
        upright = np.abs((fit.given_mesh.face_normals[face] * surface.normals(uv[good])).sum(axis=1))
        good[good] = (distance <= MAX_DISTANCE) & (upright > np.cos(MAX_OBLIQUE))
        return cls(proposed, u, v, good.reshape(len(u), len(v)))

    @property
    def surface(self) -> BSplineSurface:
        """Return the surface that skins are on."""
        return self.proposed.fit.error_field.surface

    def carries(self, uv: Array) -> BoolArray:
        """Return whether the sites nearest to parameters (n, 2), continuous over a seam, are good."""
        shape = np.array(self.good.shape)
        i, j = (self.surface.wrap(uv) * shape).astype(int).clip(0, shape - 1).T
        return on_surface(self.surface, uv) & self.good[i, j]


@dataclass(frozen=True, eq=False)
class LinkSurfaces:
    """A link, and the surfaces that a proposal has for it."""

    link: str
    file: Path
    unit: str
    mesh: TriangleMesh
    on: LinkPoints
    found: tuple[Proposed, ...]
    axes: tuple[tuple[Axis, str], ...]  # of its joints
    sentence: str  # about its areas

    @cached_property
    def tubes(self) -> tuple[Proposed, ...]:
        """Return a tube without boundary about each axis that has one: coarse facets divide the surfaces of others."""
        seen, tubes = seen_faces(self.mesh), []
        for axis, words in (*self.axes, *own_axes(self.on)):
            region = Tube(axis)
            with suppress(SkinCalibError):
                size = Size(*region_size(region.parametrization(seen), self.on))
                surface = Surface(CoverSpec("seen"), Grid(region, size, "uniform"))
                tubes.append(fitted(seen, self.on, surface, f"tube about {words}, all of it"))
        return tuple(filter(None, tubes))

    @cached_property
    def carriers(self) -> tuple[Carrier, ...]:
        """Return where on the surfaces cells can be."""
        return tuple(map(Carrier.of, (*self.found, *self.tubes)))

    def spot(self, point: Array, direction: Array) -> Spot:
        """Return the place on the outside of the link nearest to a point (3,) [m]."""
        outside = seen_faces(self.mesh)
        (distance,), (face,), (foot,) = closest(outside, point[None])
        if distance > self.mesh.size:
            low, high = millimetres(self.mesh.vertices.min(axis=0)), millimetres(self.mesh.vertices.max(axis=0))
            raise InvalidPlan(
                f"The point {millimetres(point)} is farther from the link than the link is long. The link extends "
                f"from {low} to {high}. Give a point on the link, and check its unit."
            )
        (x, y, z), (a, b, c) = np.round(foot, DECIMALS).tolist(), np.round(direction, DECIMALS).tolist()
        normal = outside.face_normals[face] * visibility(outside).sides[face]
        return Spot((x, y, z), (a, b, c), normal, float(distance))


@dataclass(frozen=True, eq=False)
class Placement:
    """A skin at a place: its plan and calibration, or why it does not fit."""

    spot: Spot
    proposed: Proposed | None  # the surface; None if there is none
    skin: SheetSkin | BoardSkin
    problem: str = ""  # empty if it fits
    on: Array = field(default_factory=lambda: NO_CELLS)  # (k, c, 3) corners of the cells that fit [m]
    off: Array = field(default_factory=lambda: NO_CELLS)  # (l, c, 3) of those that do not
    plan: Plan | None = None
    result: Calibrated | None = None


def place_at(link: LinkSurfaces, template: SheetSkin | BoardSkin, count: int | None, spot: Spot) -> Placement:
    """Place a skin on a surface that carries a place; ``count`` of boards is None for all that fit.

    The surfaces of the proposal come first, the nearest before the others.
    """
    nowhere = (
        "No surface within 1 mm and 15 degrees of the mesh was found there: an edge, a step or a hole is near, or "
        "another link covers it."
    )
    tried = [Placement(spot, None, template, nowhere)]
    for proposed in _surfaces_at(link, spot):
        tried.append(_place_on(link, proposed, template, count, spot))
        if not tried[-1].problem:
            return tried[-1]
    return max(tried, key=lambda one: (len(one.on), one.proposed is not None))


def _surfaces_at(link: LinkSurfaces, spot: Spot) -> Iterator[Proposed]:
    """Yield the surfaces that carry a place on its side of the link."""
    for surfaces in (lambda: link.found, lambda: link.tubes):
        near = []
        for k, proposed in enumerate(surfaces()):
            surface = proposed.fit.error_field.surface
            uv, (distance,) = footpoints(surface, np.array([spot.point]))
            if distance <= MAX_POINT_DISTANCE and surface.normals(uv)[0] @ spot.normal > 0:
                near.append((float(distance), k, proposed))
        yield from (proposed for _, _, proposed in sorted(near, key=lambda one: one[:2]))


def _place_on(
    link: LinkSurfaces, proposed: Proposed, template: SheetSkin | BoardSkin, count: int | None, spot: Spot
) -> Placement:
    """Place a skin on a surface, with the calculation of ``fit``."""
    skin = replace(template, name=f"{link.link}_1", surface=None)
    try:
        if isinstance(skin, SheetSkin):
            placement = _sheet_on(proposed, skin, spot)
        else:
            placement = _boards_on(link, proposed, skin, count, spot)
        if placement.problem:
            return placement
        surface = replace(proposed.surface, name=SURFACE)
        reasons = [link.sentence, f"The surface at {millimetres(spot.point)}: {proposed.reason}."]
        extra = {"x_proposal": reasons, PROPOSAL_MESH: link.mesh.sha256}
        plan = Plan(link.link, link.file, link.unit, (surface,), (placement.skin,), extra=extra)
        result = calibrate(plan, link.mesh, known={SURFACE: proposed.fit})
    except SkinCalibError as problem:
        return Placement(spot, proposed, skin, str(problem))
    return replace(placement, plan=plan, result=result)


def _sheet_on(proposed: Proposed, skin: SheetSkin, spot: Spot) -> Placement:
    """Place a sheet with its middle cell at a place; all cells must be on the cover."""
    middle = Landmark((skin.lattice.rows // 2, skin.lattice.columns // 2), spot.point)
    skin = replace(skin, landmarks=(middle,), direction=spot.direction, trim=True)
    surface, problem = proposed.fit.error_field.surface, ""
    try:
        sheet = sheet_on(skin, proposed.fit, surface, max_angle=MAX_OBLIQUE)
        uv, inside = sheet.uv, sheet.inside
    except SkinCalibError as error:
        uv, problem = _unrolled(surface, skin, middle), str(error)
        inside = Carrier.of(proposed).carries(uv[1::2, 1::2].reshape(-1, 2))
    if not inside.all():
        row, column = skin.lattice.index[~inside][0].tolist()
        problem = (
            f"{int((~inside).sum())} of its {len(inside)} cells would be off the surface, the first ({row}, {column}): "
            "the link has an edge, a step, a hole or its end there."
        )
    points = surface.points(uv.reshape(-1, 2)).reshape(*uv.shape[:2], 3)
    corners = skin.lattice.at_cells(points, CORNERS)
    return Placement(spot, proposed, replace(skin, trim=False), problem, corners[inside], corners[~inside])


def _unrolled(surface: BSplineSurface, skin: SheetSkin, middle: Landmark) -> Array:
    """Return parameters of the nodes of a sheet along geodesics, (a, b, 2), for one that cannot be placed."""
    lattice = skin.lattice
    y, x = (step * (np.arange(n) - 2 * at - 1) for step, n, at in zip(lattice.step, lattice.node_shape, middle.cell))
    flat = np.stack(np.meshgrid(x, y), axis=-1)
    start = located(surface, np.array([middle.point]), ["The point"])[0]
    along = row_axis(surface, start, skin.direction)
    return unroll(surface, flat.reshape(-1, 2), start, along, min(lattice.pitch) / 2).reshape(flat.shape)


def _boards_on(link: LinkSurfaces, proposed: Proposed, skin: BoardSkin, count: int | None, spot: Spot) -> Placement:
    """Place boards around one at a place: ``count`` of them, joined and nearest to it, or all that fit."""
    skin = replace(skin, choice="all", origin=spot.point, direction=spot.direction)
    taxels = place_skin(skin, proposed.fit, 0).patch.taxels
    (kept,) = usable(link.mesh, link.on, [skin], [taxels])
    root = np.flatnonzero((taxels.index == 0).all(axis=1) & kept)
    if not len(root):
        return Placement(spot, proposed, skin, "The board at this place does not fit.")
    problem = ""
    if count is not None:
        rows = _joined(skin, taxels, kept, int(root[0]))[:count]
        kept = np.isin(np.arange(len(kept)), rows)
        if len(rows) < count:
            problem = f"Only {counted(len(rows), 'board')} of {count} fit around this place."
    return Placement(spot, proposed, with_cells(skin, taxels, kept), problem, taxels.corners_link[kept])


def _joined(skin: BoardSkin, taxels: TaxelArray, kept: BoolArray, root: int) -> IntArray:
    """Return the rows of the boards that are joined with the root through kept ones, the nearest first."""
    pairs = skin.lattice.linked(taxels.index)
    part = components(len(kept), *pairs[kept[pairs].all(axis=1)].T)
    rows = np.flatnonzero(part == part[root])
    distances = np.linalg.norm(skin.lattice.centres(taxels.index[rows]), axis=1)
    return rows[np.argsort(distances.round(DECIMALS), kind="stable")]


def nearest_place(
    link: LinkSurfaces, template: SheetSkin | BoardSkin, count: int | None, spot: Spot
) -> Placement | None:
    """Return the placement that fits with the least movement of its cells from a place; None if none is found.

    The place itself is tried first, then other points of the surfaces, and for sheets other directions. The numbers are
    rounded before.
    """
    here = place_at(link, template, count, link.spot(np.round(spot.point, AT_DECIMALS), np.array(spot.direction)))
    if not here.problem:
        return here
    for proposed, point, direction in islice(_places(link, template, spot), MAX_TRIES):
        near = link.spot(np.round(point, AT_DECIMALS), np.round(direction, AT_DECIMALS - 1))
        if not _place_on(link, proposed, template, count, near).problem:
            # The author repeats the command with this place, where another surface can be nearer.
            found = place_at(link, template, count, near)
            if not found.problem:
                return found
    return None


def _places(link: LinkSurfaces, template: SheetSkin | BoardSkin, spot: Spot) -> Iterator[tuple[Proposed, Array, Array]]:
    """Yield surfaces, points (3,) [m] and directions (3,) where a skin can fit, those with the least movement first."""
    radius, area, turns = 0.0, 0.0, np.zeros(1)
    if isinstance(template, SheetSkin):
        size = np.array((template.lattice.rows, template.lattice.columns)) * template.lattice.pitch
        radius, area = float(np.linalg.norm(size)) / 2, float(size.prod())
        turns = TURN * np.arange(-TURNS, TURNS + 1)
    starts: list[tuple[IntArray, Array, Array, Array]] = []
    for k, carrier in enumerate(link.carriers):
        uv = pairs_of(carrier.u, carrier.v)[carrier.good.ravel()]
        if SMALLER * area > link.on.areas[carrier.proposed.covered].sum():
            continue
        points = carrier.surface.points(uv)
        kept = np.unique((points / SITE_CUBE).round(), axis=0, return_index=True)[1]
        uv, points = uv[kept], points[kept]
        moves = np.linalg.norm(points - spot.point, axis=1)[:, None] + radius * np.abs(turns)
        site, turn = map(np.ravel, np.indices(moves.shape))
        starts.append((np.full(moves.size, k), uv[site], turns[turn], moves.ravel()))
    if not starts:
        return
    carriers, uvs, angles, move = (np.concatenate(part) for part in zip(*starts))
    order = np.argsort(move, kind="stable")
    for first in range(0, len(order), TRACED):
        rows = order[first : first + TRACED]
        good, points, directions = np.zeros(len(rows), bool), np.zeros((len(rows), 3)), np.zeros((len(rows), 3))
        for k in np.unique(carriers[rows]):
            own, carrier = carriers[rows] == k, link.carriers[k]
            uv, angle = uvs[rows[own]], angles[rows[own], None]
            points[own], normals = carrier.surface.points(uv), carrier.surface.normals(uv)
            along = tangential(np.broadcast_to(spot.direction, normals.shape), normals)
            heading = np.cos(angle) * along + np.sin(angle) * cross(normals, along)
            good[own] = along.any(axis=1)  # elsewhere the direction is perpendicular to the surface
            if isinstance(template, SheetSkin):
                good[own] &= _carried(carrier, uv, heading, template.lattice)
            directions[own] = np.where(angle == 0, spot.direction, heading)
        for row in np.flatnonzero(good):
            yield link.carriers[carriers[rows[row]]].proposed, points[row], directions[row]


def _carried(carrier: Carrier, uv: Array, along: Array, lattice: SheetLattice) -> BoolArray:
    """Return for which places (k, 2) of a middle cell a surface carries all cells, from geodesics, shape (k,).

    The row through the middle cell is a geodesic along a direction (k, 3); the columns leave it at right angles. What
    has left the surface is not traced any more.
    """
    carried = np.ones(len(uv), bool)

    def follow(
        start: IntArray, uv: Array, heading: Array, step: float, count: int
    ) -> Iterator[tuple[IntArray, Array, Array]]:
        for _ in range(count):
            kept = carried[start]
            start, uv, heading = start[kept], uv[kept], heading[kept]
            if not len(start):
                return
            path, headings = trace(carrier.surface, uv, heading, step, 1)
            uv, heading = path[1], headings[1]
            carried[start[~carrier.carries(uv)]] = False
            yield start, uv, heading

    row, column = lattice.rows // 2, lattice.columns // 2
    first, cells = np.arange(len(uv)), [(np.arange(len(uv)), uv, along)]
    for sign, count in ((1, lattice.columns - 1 - column), (-1, column)):
        cells += [(s, end, sign * h) for s, end, h in follow(first, uv, sign * along, lattice.pitch[1], count)]
    start, uv, along = (np.concatenate(part) for part in zip(*cells))
    across = np.sign(lattice.step[0]) * cross(carrier.surface.normals(uv), along)
    for sign, count in ((1, lattice.rows - 1 - row), (-1, row)):
        for _ in follow(start, uv, sign * across, lattice.pitch[0], count):
            pass
    return carried


def smaller(template: SheetSkin | BoardSkin, count: int | None) -> Iterator[tuple[SheetSkin | BoardSkin, int | None]]:
    """Yield a sheet and smaller and smaller ones, or a number of boards and fewer and fewer."""
    yield template, count
    while isinstance(template, SheetSkin) and template.lattice.rows * template.lattice.columns > 1:
        rows, columns = (max(1, int(SMALLER * n)) for n in (template.lattice.rows, template.lattice.columns))
        template = replace(template, lattice=replace(template.lattice, rows=rows, columns=columns))
        yield template, None
    while isinstance(template, BoardSkin) and count is not None and count > 1:
        count = int(SMALLER * count)
        yield template, count
