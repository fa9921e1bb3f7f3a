"""The boards of a proposal: a list of those that fill a surface and are neither hidden nor over other boards."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..calibration.model import TaxelArray
from ..common.arrays import BoolArray
from ..common.errors import InvalidPlan
from ..common.warnings import point_of
from ..geometry.fit.surface_fit import SurfaceFit
from ..geometry.mesh.triangle_mesh import TriangleMesh
from ..geometry.mesh.visibility import are_seen
from ..pipeline.place_skins import place_skin
from ..plan.skins import BoardSkin
from ..skin.boards.ground import GAP_LIMIT, MAX_DISTANCE, Ground
from ..skin.boards.layout import Layout, kept_layout
from ..skin.boards.overlap import largest_apart, overlapping
from .candidates import DECIMALS
from .chains import chains_of
from .link_points import LinkPoints


def boards_on(template: BoardSkin, fit: SurfaceFit) -> tuple[BoardSkin, TaxelArray]:
    """Return the boards that fill a surface, as a list with origin and direction, and their taxels.

    A list takes no search when the plan is carried out, and its number of channels is known.
    """
    surface, more = fit.error_field.surface, (template.offset, fit, tuple(template.excluded))
    boards = Layout.of(surface, template.lattice, None, None, *more).densest()
    (root,) = np.flatnonzero((boards.cells == 0).all(axis=1)).tolist()
    origin = point_of(np.round(surface.points(boards.uv[[root]])[0], DECIMALS))
    direction = point_of(np.round(boards.tangents[root], DECIMALS))
    listing = kept_layout(surface, template.lattice, origin, direction, *more).listing(boards)
    skin = replace(template, choice=listing, origin=origin, direction=direction)
    return skin, place_skin(skin, fit, 0).patch.taxels


def boards_of_list(skin: BoardSkin, fit: SurfaceFit) -> tuple[BoardSkin, TaxelArray]:
    """Return the boards of a list that fit on another surface: inside it, near its mesh, and along it."""
    taxels = place_skin(skin, fit, 0).patch.taxels
    fits = _fit(skin, fit, taxels)
    if fits.all():
        return skin, taxels
    if not fits.any():
        raise InvalidPlan("None of its boards fits.")
    return boards_of_list(with_cells(skin, taxels, fits), fit)  # without some, others can have another place


def _fit(skin: BoardSkin, fit: SurfaceFit, taxels: TaxelArray) -> BoolArray:
    """Return which boards are on a surface and its mesh completely."""
    normals = taxels.normals_link[:, None]
    corners = taxels.corners_link - skin.offset * normals
    ground = Ground(fit.error_field.surface, fit, skin.excluded, skin.lattice.side)
    over = ground.is_over_mesh(corners.reshape(-1, 3), np.broadcast_to(normals, corners.shape).reshape(-1, 3))
    fits: BoolArray = over.reshape(corners.shape[:2]).all(axis=1) & (taxels.quality["overhang"] == 0)
    fits &= np.abs(taxels.quality["gap"]) <= GAP_LIMIT
    return fits & ground.carries(taxels.uv)


def with_cells(skin: BoardSkin, taxels: TaxelArray, kept: BoolArray) -> BoardSkin:
    """Return a skin with a list of boards, chain by chain: so their ids and channels follow each other."""
    listed = () if isinstance(skin.choice, str) else skin.choice
    known = {cell[:2]: cell for cell in listed}
    cells = taxels.index[kept][np.argsort(chains_of(taxels, kept), kind="stable")].tolist()
    return replace(skin, choice=tuple(known.get((q, r), (q, r)) for q, r in cells))


def open_cells(mesh: TriangleMesh, on: LinkPoints, taxels: Sequence[TaxelArray]) -> BoolArray:
    """Return which cells of all skins of a link are seen and free; one may be ``MAX_DISTANCE`` below the mesh."""
    positions, normals = (np.concatenate([getattr(t, n) for t in taxels]) for n in ("positions_link", "normals_link"))
    seen: BoolArray = are_seen(mesh, positions + MAX_DISTANCE * normals, normals)
    return seen & on.free[on.nearest(positions, normals)]


def usable(
    mesh: TriangleMesh, on: LinkPoints, skins: Sequence[BoardSkin], taxels: Sequence[TaxelArray]
) -> list[BoolArray]:
    """Return which boards of a link can be used, for each skin: seen, free, and without overlaps."""
    positions, normals, tangents = (
        np.concatenate([getattr(t, name) for t in taxels])
        for name in ("positions_link", "normals_link", "tangents_link")
    )
    kept = open_cells(mesh, on, taxels)
    rows = np.flatnonzero(kept)
    pairs, _, _ = overlapping(
        positions[rows], normals[rows], tangents[rows], skins[0].lattice, max(abs(skin.offset) for skin in skins)
    )
    kept[rows] = largest_apart(len(rows), pairs)
    return np.split(kept, np.cumsum([len(t.ids) for t in taxels])[:-1])
