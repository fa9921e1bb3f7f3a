"""Taxels of a placed sheet: positions, normals, frames, corners, areas and neighbours."""

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from itertools import compress

import numpy as np

from ...calibration.model import TaxelArray, fan_areas
from ...common.arrays import Array, BoolArray, cross, tangential, unit
from ..lattice import CENTRE, CORNERS, EDGES, ROUNDING, Offsets, SheetLattice
from ..neighbours import neighbours
from .between import between, spline_matrix
from .strain import cell_strain, strain_of
from .wrap import WrappedSheet, on_surface

# Halvings of a line from a corner to a point on the surface, until the edge is known. More: more exact, slower.
EDGE_HALVINGS = 20

Covers = Callable[[Array], BoolArray]


def sheet_taxels(sheet: WrappedSheet, name: str, first_channel: int = 0, covers: Covers | None = None) -> TaxelArray:
    r"""Return the taxels at the cell centres of a placed sheet.

    The area of a cell follows from the strains along the row and across the rows and from the shear angle:

    .. math:: A = p_r p_c (1 + \varepsilon_u) (1 + \varepsilon_v) \cos\gamma \quad [m^2]

    with the pitches p [m]. A cell ends where the surface ends: its outline and its area are those of the rest.

    Parameters
    ----------
    sheet : WrappedSheet
        The placed sheet.
    name : str
        Name of the patch; ids read ``name.row.column``.
    first_channel : int
        Channel of cell (0, 0); the others follow row by row. Cells outside the surface keep their channel.
    covers : function, optional
        Return which parameters (k, 2) in [0, 1] a cell can cover. Default: all.

    Returns
    -------
    TaxelArray
        In the link frame; ``quality`` has the strain and the size [m] of each cell, and the overhang [m] if there is
        one: the length by which a corner protruded.
    """
    surface, lattice, inside = sheet.surface, sheet.lattice, sheet.inside
    flat = sheet.uv.reshape(-1, 2)
    nodes, outward = surface.points(flat), surface.normals(flat)
    nodes = (nodes + sheet.offset * outward).reshape(*lattice.node_shape, 3)

    def at_cells(values: Array, offsets: Offsets) -> Array:
        return lattice.at_cells(values, lattice.counter_clockwise(offsets))[inside]

    positions, uv = at_cells(nodes, CENTRE)[:, 0], at_cells(sheet.uv, CENTRE)[:, 0]
    normals = at_cells(outward.reshape(nodes.shape), CENTRE)[:, 0]
    edges = at_cells(nodes, EDGES)
    corners, strain = at_cells(nodes, CORNERS), cell_strain(sheet)[inside]
    taxels = _taxels(sheet, name, first_channel, uv, positions, normals, edges[:, 0] - edges[:, 2], corners, strain)
    taxels = replace(taxels, neighbours=neighbours(taxels.ids, positions, normals, corners))
    return without_overhang(sheet, taxels, covers)


def without_overhang(sheet: WrappedSheet, taxels: TaxelArray, covers: Covers | None) -> TaxelArray:
    """Return taxels whose outlines and areas end at the edge of what their cells can cover, with their overhangs.

    The edge is straight between the points where it crosses the sides of a cell; areas are exact then. A corner beyond
    it moves inwards, until the outline has this area.
    """
    lattice = sheet.lattice

    def is_covered(uv: Array) -> BoolArray:
        covered = on_surface(sheet.layer, uv)
        if covers is not None:
            covered[covered] = covers(sheet.surface.wrap(uv[covered]))
        return covered

    lost = np.zeros(lattice.node_shape, bool)
    lost[::2, ::2] = ~is_covered(sheet.uv[::2, ::2])
    offsets = lattice.counter_clockwise(CORNERS)
    # A cell with its centre over a hole has another warning.
    beyond = (lattice.at_cells(lost, offsets)[sheet.inside] > 0) & is_covered(taxels.uv)[:, None]
    cell, corner = np.nonzero(beyond)
    if not len(cell):
        return taxels
    outline = lattice.at_cells(sheet.uv, offsets)[sheet.inside][cell]
    centre = lattice.at_cells(sheet.uv, CENTRE)[sheet.inside][cell, 0]
    row, lost_corners = np.arange(len(cell)), beyond[cell]
    lengths, ends = [], []
    for step in (-1, 1, 0):  # towards the corner before, the one after, and the centre
        adjacent = (corner + step) % outline.shape[1]
        start, outer = (centre if step == 0 else outline[row, adjacent]), outline[row, corner]
        low, high = np.zeros((len(cell), 1)), np.ones((len(cell), 1))
        for _ in range(EDGE_HALVINGS):
            middle = (low + high) / 2
            covered = is_covered(start + middle * (outer - start))[:, None]
            low, high = np.where(covered, middle, low), np.where(covered, high, middle)
        places = np.concatenate((start + low * (outer - start), outer))
        edge, tip = np.split(sheet.surface.points(places) + sheet.offset * sheet.surface.normals(places), 2)
        is_known = np.ones(len(cell), bool) if step == 0 else ~lost_corners[row, adjacent]
        ends.append((edge, is_known))
        lengths.append(np.where(is_known, np.linalg.norm(tip - edge, axis=1), np.inf))
    (before, has_before), (after, has_after), (inner, _) = ends
    here = np.where(has_after[:, None], after, inner)
    first, last = np.where(has_before[:, None], before, here), np.where(has_after[:, None], after, before)
    last[~has_before & ~has_after] = inner[~has_before & ~has_after]
    # The rest of a cell has two corners instead of each one beyond the edge; outlines keep their number of corners.
    rest, target = np.repeat(taxels.corners_link, 2, axis=1), taxels.corners_link.copy()
    rest[cell, 2 * corner], rest[cell, 2 * corner + 1], target[cell, corner] = first, last, (first + last) / 2
    whole, left, least = (fan_areas(taxels.positions_link, k) for k in (taxels.corners_link, rest, target))
    part = np.clip((whole - left) / np.maximum(whole - least, ROUNDING * whole), 0, 1)[:, None, None]
    corners, overhang = taxels.corners_link + part * (target - taxels.corners_link), np.zeros(len(taxels.ids))
    np.maximum.at(overhang, cell, np.min(lengths, axis=0))
    quality = taxels.quality | {"overhang": overhang}
    return replace(taxels, corners_link=corners, areas=taxels.areas * left / whole, quality=quality)


def _taxels(
    sheet: WrappedSheet,
    name: str,
    first_channel: int,
    uv: Array,
    positions: Array,
    normals: Array,
    along: Array,
    corners: Array,
    strain: Array,
) -> TaxelArray:
    """Return the taxels of the cells inside the surface, without neighbours; the rows of arrays are these cells."""
    lattice, inside = sheet.lattice, sheet.inside
    ids = tuple(compress(_all_ids(name, lattice), inside.tolist()))
    return TaxelArray(
        ids=ids,
        channels=first_channel + np.flatnonzero(inside),
        index=lattice.index[inside],
        uv=sheet.surface.wrap(uv),
        positions_link=positions,
        normals_link=normals,
        tangents_link=tangential(along, normals),
        corners_link=corners,
        areas=np.prod(lattice.pitch) * (1 + strain[:, 0]) * (1 + strain[:, 1]) * np.cos(strain[:, 2]),
        neighbours=((),) * len(ids),
        quality={"strain": strain, "size": (1 + strain[:, :2]) * lattice.pitch[::-1]},
    )


@lru_cache(maxsize=8)  # a preview of many cells needs them at each change
def _all_ids(name: str, lattice: SheetLattice) -> tuple[str, ...]:
    return tuple(f"{name}.{i}.{j}" for i, j in lattice.index.tolist())


def preview_taxels(sheet: WrappedSheet, name: str, first_channel: int = 0, covers: Covers | None = None) -> TaxelArray:
    """Return the taxels of a sheet from the centres and the corners of its cells only: fast, for a preview.

    Between the placed nodes, positions and normals are those of splines. Strains follow from the derivatives of these
    positions at the centre of each cell. The taxels have no neighbours.
    """
    lattice, inside = sheet.lattice, sheet.inside
    uv = sheet.uv[np.ix_(*(np.array(kept, int) for kept in sheet.lines))]
    r = sheet.surface.derivatives(uv.reshape(-1, 2))
    outward = unit(cross(r[1, 0], r[0, 1]))
    nodes = (r[0, 0] + sheet.offset * outward).reshape(*uv.shape[:2], 3)
    at_corners, at_centres = (
        [spline_matrix(kept, every[k::2]) for kept, every in zip(sheet.lines, lattice.node_lines)] for k in (0, 1)
    )
    slopes = [spline_matrix(kept, every[1::2], 1) for kept, every in zip(sheet.lines, lattice.node_lines)]
    grid = between(nodes, *at_corners)
    parts = between(np.concatenate((nodes, outward.reshape(nodes.shape)), axis=2), *at_centres).reshape(-1, 6)[inside]
    positions, normals = parts[:, :3], unit(parts[:, 3:])
    along = between(nodes, at_centres[0], slopes[1]).reshape(-1, 3)[inside]  # to the next node of the row [m]
    across = between(nodes, slopes[0], at_centres[1]).reshape(-1, 3)[inside]
    a, b, c = (np.einsum("nk,nk->n", one, two) for one, two in ((along, along), (across, across), (along, across)))
    strain = strain_of(lattice, *(2 * np.sqrt(square) for square in (a, b, a + b + 2 * c, a + b - 2 * c)))
    corner = dict(zip(CORNERS, (grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1])))
    corners = np.stack([corner[k].reshape(-1, 3) for k in lattice.counter_clockwise(CORNERS)], axis=1)[inside]
    uv = sheet.uv[1::2, 1::2].reshape(-1, 2)[inside]
    taxels = _taxels(sheet, name, first_channel, uv, positions, normals, along, corners, strain)
    return without_overhang(sheet, taxels, covers)
