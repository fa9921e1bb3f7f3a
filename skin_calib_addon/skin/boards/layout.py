"""Choice of the boards on a surface: as many as fit, all that fit at a given position, or a list of the author."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from ...common.arrays import Array, BoolArray, IntArray, tangential
from ...common.errors import InvalidPlan, OutsideSurface, millimetres
from ...common.warnings import Place, point_of
from ...geometry.fit.surface_fit import SurfaceFit
from ...geometry.surface.bspline import BSplineSurface
from ..lattice import HexLattice
from ..sheet.offset import offset_surface
from ..sheet.wrap import on_surface, root_of
from .flat_map import FlatMap, flat_map, lengths_of, steps_along
from .front import grown
from .ground import MAX_ANGLE, MAX_DISTANCE, MAX_GAP, Ground, Zone
from .overlap import TOUCH, largest_apart
from .region import region_of
from .search import MAX_PITCH_CHANGE, Poses, Search, axes_at
from .wrapped_boards import WrappedBoards

Cell = tuple[int, int] | tuple[int, int, float, float, float]  # q, r; and how far a board is shifted [m, m, rad]
Choice = Literal["fill", "all"] | Sequence[Cell]
# [1] Distance of the nodes of the flat map, in pitches. Larger: less exact, faster.
MAP_SPACING = 0.5
# [1] Length by which the map of a tube continues over its cut, in pitches: a board and its corners.
OVER_CUT = 2.2
# [1] Samples of each side of a board that are compared with the mesh in the end. More: smaller protrusions, slower.
OUTLINE_SAMPLES = 8
# [1] Protrusion of a corner of the border into a board, in sides, that is not an overhang. Larger: boards protrude.
MAX_PROTRUSION = 0.06
# [1] Most cells in the circle around a surface; more of them mean wrong units. Larger: more time and memory.
MAX_CELLS = 50_000
# [1] Layouts of lists that are kept: those of a link, one for each surface, are needed for its proposal, and again for
# its calibration. Larger: more memory, also in the window, where each change of a surface adds one.
LAYOUTS = 16
# [1] Boards of a lattice that fit but would overlap others, of all that fit, from which on all boards grow on from one,
# too. Larger: slower; smaller: fewer boards on surfaces like spheres.
MAX_LOST = 0.1
# [1] Nearest cells of which a board that grew on gets the first free coordinates. Derived: none are closer together.
NEAR_CELLS = 200
DECIMALS = 6  # of how far a board is shifted from its place [m], [rad]. Larger: longer plans
# [m] Distance below which a board is at its place in the lattice: origins in plans are rounded. Larger: small overlaps.
SAME_PLACE = 2e-6
# [1] Most rounds of moves. More: fewer boards are left out, slower.
MOVES = 30


def lay_boards(
    surface: BSplineSurface,
    lattice: HexLattice,
    choice: Choice,
    origin: ArrayLike | None,
    direction: ArrayLike | None,
    *,
    offset: float = 0.0,
    fit: SurfaceFit | None = None,
    excluded: Sequence[Zone] = (),
) -> tuple[WrappedBoards, Array]:
    """Choose boards and place them on a surface.

    The lattice keeps its pitch along the surface, as far as a flat map can. Rows close around a tube. Boards that
    overlap in space move apart by up to 6 % of the pitch. After that, as many boards as possible without an overlap
    remain.

    Parameters
    ----------
    surface : BSplineSurface
        The surface, in the link frame.
    lattice : HexLattice
        The flat lattice.
    choice : "fill", "all" or sequence of (q, r)
        "fill" chooses offset and rotation of the lattice for the largest number of boards. "all" puts the root at the
        origin and its row along the direction, and takes all boards that fit. Both take boards whose corners need a
        warning (`GAP_LIMIT`) only if there are no others. A sequence gives axial coordinates.
    origin : array, shape (3,), or None
        Position of the root cell (0, 0), or near it for "fill" [m]. None takes the middle of the surface.
    direction : array, shape (3,), or None
        Direction of the row at the root, or nearly so for "fill". None takes the direction of v.
    offset : float
        Height of the middle planes of the boards above the surface [m]. The boards have twice this thickness.
    fit : SurfaceFit, optional
        Fit of the surface: boards stay where its mesh has faces.
    excluded : sequence of Zone
        Zones without boards.

    Returns
    -------
    boards : WrappedBoards
        The placed boards.
    overhang : array, shape (n,)
        Protrusion of each board over an edge of the surface or the mesh, or into an excluded zone [m]. It is zero for
        "fill" and "all".

    Raises
    ------
    InvalidPlan
        If no board fits, or boards of the given sequence overlap.
    OutsideSurface
        If a board of the given sequence is outside the surface.
    """
    start, along = (None if k is None else tuple(np.asarray(k, float).tolist()) for k in (origin, direction))
    # The search takes longer than its layout, and is not repeated.
    layout_of = Layout.of if isinstance(choice, str) and choice == "fill" else kept_layout
    layout = layout_of(surface, lattice, start, along, offset, fit, tuple(excluded))
    if isinstance(choice, str):
        if choice == "fill":
            pose, boards = layout.most_boards([*layout.search.best(), *layout.given()])
        else:
            pose, boards = layout.at_start
        boards = boards[layout.outline_is_covered(boards)]
        if not len(boards.cells):
            raise layout.refusal
        near = boards.are_near()
        boards = boards[near] if near.any() else boards
        if choice == "fill":
            boards = _rooted(boards, layout.to_flat)
        return boards, np.zeros(len(boards.cells))
    return layout.listed(*cells_of(choice), *layout.at_start)


@dataclass(frozen=True, eq=False)
class Layout:
    """A lattice on a surface, before its pose is known."""

    surface: BSplineSurface
    offset: float  # [m]
    lattice: HexLattice
    to_flat: FlatMap
    ground: Ground
    search: Search

    @classmethod
    def of(
        cls,
        surface: BSplineSurface,
        lattice: HexLattice,
        origin: ArrayLike | None,
        direction: ArrayLike | None,
        offset: float,
        fit: SurfaceFit | None,
        excluded: Sequence[Zone],
    ) -> "Layout":
        """Develop the surface and find the region of the boards; parameters as for :func:`lay_boards`."""
        layer, start, pitch = offset_surface(surface, offset), root_of(surface, origin), lattice.pitch
        length, breadth = lengths_of(layer)
        if np.pi / 4 * (length**2 + breadth**2) > MAX_CELLS * lattice.row_step * pitch:
            raise InvalidPlan(
                f"the surface, {length:.2f} x {breadth:.2f} m, extends too far for boards with a pitch of "
                f"{pitch * 1e3:g} mm. Use larger boards, or check the unit of the mesh."
            )
        to_flat = flat_map(layer, start, direction, fit, MAP_SPACING * pitch, OVER_CUT * pitch)
        ground = Ground(surface, fit, tuple(excluded), lattice.side)
        period = None
        if surface.closed[1]:
            low, high = to_flat(start + [(0.0, -0.5), (0.0, 0.5)])
            period = high - low
        search = Search(region_of(to_flat, ground, pitch), lattice, period, abs(offset))
        layout = cls(surface, offset, lattice, to_flat, ground, search)
        return replace(layout, search=replace(search, stretch=layout._stretch_for_overlaps()))

    def _stretch_for_overlaps(self) -> float:
        """Return the stretch of the lattice after which a twentieth of the pairs of neighbours may still overlap."""
        boards = self._on_map(Poses.at(0.0, 1.0))
        pairs, depths, _ = boards.overlaps()
        q, r = (boards.cells[pairs[:, 1]] - boards.cells[pairs[:, 0]]).T
        are_neighbours = np.max(np.abs((q, r, q + r)), axis=0) == 1  # not those on both sides of a cut
        depths = np.sort(depths[are_neighbours & (depths <= MAX_PITCH_CHANGE * self.lattice.pitch)])[::-1]
        few = 3 * len(boards.cells) // 20  # of three pairs per board
        return 1 + float(depths[few]) / self.lattice.pitch if len(depths) > few else 1.0

    def given(self) -> list[Poses]:
        """Return the poses with the root at the start and its row along x: not stretched, and closed around a tube."""
        stretches = [self.search.stretch]
        angles, closing = self.search.closed_rows()
        if self.search.period is not None:
            gaps = np.abs(np.sin(angles)) * np.linalg.norm(self.search.period)
            stretches += closing[gaps <= MAX_PITCH_CHANGE * self.lattice.pitch].tolist()
        return [Poses.at(0.0, stretch) for stretch in stretches]

    @cached_property
    def at_start(self) -> tuple[Poses, WrappedBoards]:
        """Return the given pose with the most boards, as :meth:`most_boards` counts, and the boards."""
        return self.most_boards(self.given())

    def most_boards(self, poses: Iterable[Poses]) -> tuple[Poses, WrappedBoards]:
        """Return the first pose with the most boards that need no warning, of these with the most, and the boards."""
        found = [(pose, self.complete(pose)) for pose in poses]
        return max(found, key=lambda pair: (int(pair[1].are_near().sum()), len(pair[1].cells)))

    def placed(self, pose: Poses, cells: IntArray, places: Array | None = None) -> tuple[WrappedBoards, Array]:
        """Return boards at a pose, and the distances of their flat positions from the map (n,) [m].

        Places (n, 3) have the shifts of boards from their cells, along the rows and across [m], and turns [rad]; NaN of
        boards that are not shifted.
        """
        places = np.full((len(cells), 3), np.nan) if places is None else places
        shifted, places = ~np.isnan(places[:, 0]), np.nan_to_num(places)
        angle = float(pose.angles[0])
        uv, missed = self.to_flat.inverse(self.search.centres(pose, cells)[0] + places[:, :2] @ axes_at(angle))
        tangents = tangential(self.to_flat.directions(uv, angle + places[:, 2]), self.surface.normals(uv))
        return WrappedBoards(self.surface, self.offset, self.lattice, cells, uv, tangents, shifted), missed

    def complete(self, pose: Poses) -> WrappedBoards:
        """Return all boards that fit at a pose, without overlaps, by r, then q."""
        boards = self._on_map(pose)
        boards = boards[self.fits(boards)]
        pairs, depths, _ = boards.overlaps()
        boards = boards[largest_apart(len(boards.cells), pairs[depths > MAX_PITCH_CHANGE * self.lattice.pitch])]
        moved = self._moved_apart(boards)
        still = (moved.uv == boards.uv).all(axis=1)
        still[~still] = self.fits(moved[~still])
        boards = moved[still]
        boards = boards[largest_apart(len(boards.cells), boards.overlaps()[0])]
        return boards[np.lexsort(boards.cells.T)]

    def _on_map(self, pose: Poses) -> WrappedBoards:
        """Return the boards at a pose with their centres on the map, around a tube once and a pitch beyond."""
        near = self.search.region.may_be_centres(self.search.centres(pose, self.search.cells)[0], more_than_once=True)
        boards, missed = self.placed(pose, self.search.cells[near])
        return boards[(missed <= TOUCH * self.lattice.side) & self._around_once(boards.uv)]

    def _around_once(self, uv: Array) -> BoolArray:
        """Return which parameters (n, 2) are between the cuts of a tube, or at most a pitch beyond."""
        if not self.surface.closed[1]:
            return np.ones(len(uv), bool)
        over = self.lattice.pitch / lengths_of(self.surface)[1]
        return np.abs(uv[:, 1] - self.to_flat.start[1]) <= 0.5 + over

    def fits(self, boards: WrappedBoards) -> BoolArray:
        """Return which boards are on the ground completely."""
        chosen = np.flatnonzero(self._around_once(boards.uv))
        for least, what in ((self.search.apothem, self._depths), (0.0, self.clearances)):
            chosen = chosen[what(boards[chosen]) >= least - TOUCH * self.lattice.side]
        chosen = chosen[self.ground.carries(boards.uv[chosen])]
        normals, corners = boards.normals[chosen], boards[chosen].corners()
        over = self.ground.is_over_mesh(corners.reshape(-1, 3), np.repeat(normals, corners.shape[1], axis=0))
        fits = np.zeros(len(boards.cells), bool)
        fits[chosen[over.reshape(len(chosen), corners.shape[1]).all(axis=1)]] = True
        return fits

    def outline_is_covered(self, boards: WrappedBoards) -> BoolArray:
        """Return which boards do not protrude at a corner of the border, which is only known between two nodes."""
        corners = self.lattice.corners
        parts = np.arange(OUTLINE_SAMPLES)[:, None, None] / OUTLINE_SAMPLES
        outline = (corners + parts * (np.roll(corners, -1, axis=0) - corners)).reshape(-1, 2)
        points = self.to_flat(boards.uv)[:, None] + (1 - MAX_PROTRUSION) * outline @ axes_at(self._angles(boards))
        uv, _ = self.to_flat.inverse(points.reshape(-1, 2))
        return self.ground.covers(uv).reshape(points.shape[:2]).all(axis=1)

    def clearances(self, boards: WrappedBoards) -> Array:
        """Return the clearances of boards from the border of the region, negative over it, shape (n,) [m]."""
        return self.search.clearances(self.to_flat(boards.uv), self._angles(boards))

    def _depths(self, boards: WrappedBoards) -> Array:
        return self.search.region.depths(self.to_flat(boards.uv))

    def _angles(self, boards: WrappedBoards) -> Array:
        return self.to_flat.angles(boards.uv, boards.tangents)

    def _moved_apart(self, boards: WrappedBoards) -> WrappedBoards:
        """Return boards moved along the surface until none overlap, or as far as they may move."""
        uv, limit = boards.uv.copy(), MAX_PITCH_CHANGE * self.lattice.pitch
        starts = self.surface.points(uv)
        for _ in range(MOVES):
            moved = replace(boards, uv=uv)
            pairs, depths, axes = moved.overlaps()
            if not len(pairs):
                break
            arms = np.zeros((len(uv), 3))
            for column, sign in ((0, -0.5), (1, 0.5)):
                np.add.at(arms, pairs[:, column], sign * (depths + TOUCH * self.lattice.side)[:, None] * axes)
            uv = uv + steps_along(self.surface, uv, arms)
            away = np.linalg.norm(self.surface.points(uv) - starts, axis=1)
            back = np.where(away > limit, limit / np.maximum(away, limit), 1.0)[:, None]
            uv = boards.uv + back * (uv - boards.uv)
        return replace(boards, uv=uv, tangents=tangential(boards.tangents, self.surface.normals(uv)))

    @property
    def refusal(self) -> InvalidPlan:
        """Return the error that no board fits."""
        (width, height), side = self.search.size * 1e3, self.lattice.side * 1e3
        return InvalidPlan(
            f"no board with sides of {side:g} mm fits completely in the region, which is {width:.1f} x {height:.1f} mm "
            f"over all, with its centre within {MAX_DISTANCE * 1e3:g} mm and {np.rad2deg(MAX_ANGLE):.0f} degrees of "
            f"the mesh, and its corners within {MAX_GAP * side:g} mm; extend the surface, use smaller boards, or "
            "reduce excluded zones"
        )

    def densest(self) -> WrappedBoards:
        """Return as many boards as fit: those of a lattice, and those that grow on from them. Its root is one of them.

        Where many boards of a lattice would overlap, because the surface is not like a plane, all grow on from one.
        Raise InvalidPlan if no board fits.
        """
        pose, boards = self.most_boards([*self.search.some(), *self.given()])
        boards = boards[self.outline_is_covered(boards)]
        if not len(boards.cells):
            raise self.refusal
        starts = [boards]
        if len(boards.cells) < (1 - MAX_LOST) * np.count_nonzero(self.fits(self._on_map(pose))):
            starts.append(boards[_root_row(boards, self.to_flat)])
        found = []
        for start in starts:
            more = grown(start, self.fits)
            more = more[~more.shifted | self.outline_is_covered(more)]
            found.append(more[more.are_near()] if more.are_near().any() else more)
        return _rooted(self._addressed(max(found, key=lambda boards: len(boards.cells)), pose), self.to_flat)

    def _addressed(self, boards: WrappedBoards, pose: Poses) -> WrappedBoards:
        """Return boards of which the shifted ones have the coordinates of the nearest cells without a board."""
        cells, free = boards.cells.copy(), self.search.cells
        taken = {tuple(cell) for cell in cells[~boards.shifted].tolist()}
        centres = cKDTree(self.search.centres(pose, free)[0])
        for row in np.flatnonzero(boards.shifted):
            near = centres.query(self.to_flat(boards.uv[[row]])[0], min(NEAR_CELLS, len(free)))[1]
            cells[row] = next(cell for cell in free[near].tolist() if tuple(cell) not in taken)
            taken.add(tuple(cells[row].tolist()))
        return replace(boards, cells=cells)

    def listing(self, boards: WrappedBoards) -> tuple[Cell, ...]:
        """Return boards as a list that places them again from the start of this layout."""
        pose, complete = self.at_start
        uv = boards.uv.copy()
        uv[:, 1] += np.where(self.surface.closed[1], np.rint(self.to_flat.start[1] - uv[:, 1]), 0.0)
        known, _ = self._of_list(boards.cells, np.full((len(uv), 3), np.nan), pose, complete)
        steps = self.to_flat(uv) - self.search.centres(pose, boards.cells)[0]
        turns = self.to_flat.angles(uv, boards.tangents) - pose.angles[0]
        turns = (turns + np.pi) % (2 * np.pi) - np.pi
        places = np.column_stack((steps @ axes_at(pose.angles[0]).T, turns)).round(DECIMALS)
        away = np.linalg.norm(boards.points - known.points, axis=1)
        turned = np.linalg.norm(boards.tangents - known.tangents, axis=1) * self.lattice.side
        is_same = away + turned <= SAME_PLACE
        return tuple(
            (q, r) if same else (q, r, *place)
            for (q, r), same, place in zip(boards.cells.tolist(), is_same.tolist(), places.tolist())
        )

    def _of_list(
        self, cells: IntArray, places: Array, pose: Poses, complete: WrappedBoards
    ) -> tuple[WrappedBoards, Array]:
        """Return the boards of a list, and how far they are off the map (n,) [m]; those that all moved are moved."""
        boards, missed = self.placed(pose, cells, places)
        known = {tuple(cell): i for i, cell in enumerate(complete.cells.tolist())}
        uv, tangents = boards.uv.copy(), boards.tangents.copy()
        for row, cell in enumerate(map(tuple, cells.tolist())):
            if cell in known and not boards.shifted[row]:
                uv[row], tangents[row] = complete.uv[known[cell]], complete.tangents[known[cell]]
        return replace(boards, uv=uv, tangents=tangents), missed

    def listed(
        self, cells: IntArray, places: Array, pose: Poses, complete: WrappedBoards
    ) -> tuple[WrappedBoards, Array]:
        """Return the boards of an author, and their overhangs [m]."""
        boards, missed = self._of_list(cells, places, pose, complete)
        outside = np.flatnonzero(~on_surface(self.surface, boards.uv) | (missed > TOUCH * self.lattice.side))
        if len(outside):
            first = outside[0]
            axis = int(np.argmax(np.where(self.surface.closed, 0.0, np.abs(boards.uv[first] - 0.5))))
            raise OutsideSurface(
                f"board {cells[first].tolist()} lies {missed[first] * 1e3:.1f} mm beyond the edge "
                f"{'uv'[axis]} = {np.rint(boards.uv[first, axis]):g} of the surface, the first of {len(outside)}; "
                "leave it out, or move the origin",
                cell=cells[first].tolist(),
                distance=float(missed[first]),
                place=Place(point_of(boards.points[first])),
            )
        pairs, depths, _ = boards.overlaps()
        if len(pairs) and depths.max() <= MAX_PITCH_CHANGE * self.lattice.pitch:
            boards = self._moved_apart(boards)
            pairs, depths, _ = boards.overlaps()
        if len(pairs):
            i, j = pairs[depths.argmax()]
            place = boards.points[i]
            raise InvalidPlan(
                f"boards {cells[i].tolist()} and {cells[j].tolist()} overlap by {depths.max() * 1e3:.2f} mm at "
                f"{millimetres(place)}, the worst of {len(pairs)} pairs; leave one of the two out, or move the origin",
                place=Place(point_of(place)),
            )
        overhangs = -self.clearances(boards)
        overhangs[overhangs <= TOUCH * self.lattice.side] = 0.0
        over = np.flatnonzero(overhangs)
        overhangs[over[self._is_on_ground(boards[over])]] = 0.0
        return boards, overhangs

    def _is_on_ground(self, boards: WrappedBoards) -> BoolArray:
        """Return which boards have their outline over the ground in space: where a map folds, its border is wrong."""
        corners = boards.corners()
        parts = np.arange(OUTLINE_SAMPLES)[:, None, None, None] / OUTLINE_SAMPLES
        outline = corners + parts * (np.roll(corners, -1, axis=1) - corners)
        normals = np.broadcast_to(boards.normals[:, None], outline.shape)
        covered = self.ground.covers_at(outline.reshape(-1, 3), normals.reshape(-1, 3))
        found: BoolArray = covered.reshape(outline.shape[:3]).all(axis=(0, 2))
        return found


def cells_of(choice: Sequence[Cell]) -> tuple[IntArray, Array]:
    """Return axial coordinates (n, 2) of a list of boards, and how far each is shifted (n, 3) [m, m, rad], or NaN."""
    rows = [(*cell, np.nan, np.nan, np.nan)[:5] for cell in choice]
    cells, places = np.array([row[:2] for row in rows], np.int64), np.array([row[2:] for row in rows], float)
    return cells.reshape(-1, 2), places.reshape(-1, 3)


@lru_cache(maxsize=LAYOUTS)
def kept_layout(*of: Any) -> Layout:
    """Return the layout of :meth:`Layout.of`; the last ones are kept, because lists of boards follow each other."""
    return Layout.of(*of)


def forget_layouts() -> None:
    """Free the layouts that are kept, with their surfaces and meshes."""
    kept_layout.cache_clear()


def _root_row(boards: WrappedBoards, to_flat: FlatMap) -> slice:
    """Return the row of the board in its place that is nearest to the flat origin."""
    distances = np.where(boards.shifted, np.inf, np.linalg.norm(to_flat(boards.uv), axis=1))
    row = int(np.flatnonzero(distances <= distances.min() + TOUCH * boards.lattice.side)[0])
    return slice(row, row + 1)


def _rooted(boards: WrappedBoards, to_flat: FlatMap) -> WrappedBoards:
    """Return the same boards; the root is the one nearest to the flat origin."""
    return replace(boards, cells=boards.cells - boards.cells[_root_row(boards, to_flat)])
