"""Place the skins of a plan on the fitted surface."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property, singledispatch

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from ..calibration.exchange import read_taxels
from ..calibration.model import Patch, TaxelArray
from ..common.arrays import unit
from ..common.errors import InvalidPlan, OutsideSurface
from ..common.warnings import Place, Warning
from ..geometry.fit.surface_fit import SurfaceFit
from ..geometry.mesh.distance import closest
from ..geometry.surface.bspline import BSplineSurface
from ..plan import Plan
from ..plan.checks import naming_skin
from ..plan.plan import SURFACE
from ..plan.skins import BoardSkin, ImportedSkin, SheetSkin, Skin, first_channels
from ..skin.boards.board_taxels import board_taxels, with_tilts
from ..skin.boards.ground import MAX_ANGLE, MAX_DISTANCE
from ..skin.boards.layout import lay_boards
from ..skin.imported import ImportedTaxels, imported_taxels
from ..skin.neighbours import neighbours, with_neighbours_across
from ..skin.sheet.closure import Closure, closure
from ..skin.sheet.taxels import preview_taxels, sheet_taxels
from ..skin.sheet.wrap import WrappedSheet, wrap_sheet
from ..skin.single_taxels import with_single_taxels
from ..skin.warnings import check_overhang, check_overlap, placement_warnings
from .taxel_sigma import draft_sigma, placed_anew_warning, with_sigma


@dataclass(frozen=True, eq=False)
class PlacedSkin:
    """A patch on the surface, and data about its placement."""

    patch: Patch
    sheet: WrappedSheet | None = None
    imported: ImportedTaxels | None = None
    disabled: Patch | None = None  # its taxels that the patch does not have
    of_plan: tuple[Warning, ...] = ()  # about what the plan says of the skin

    @cached_property
    def closure(self) -> Closure | None:
        """Return the gaps of a sheet that encloses the link; None for other skins."""
        return None if self.sheet is None else closure(self.sheet)

    @property
    def warnings(self) -> tuple[Warning, ...]:
        """Return the warnings about the placement."""
        name, findings = self.patch.name, () if self.imported is None else self.imported.findings
        of_file = (
            Warning(f.code, f.severity, f"{name}: {f.sentence}", Place(names=f.pointer, skin=name)) for f in findings
        )
        return (*self.of_plan, *placement_warnings(self.patch, self.closure), *of_file)


@dataclass(frozen=True, eq=False)
class Draft:
    """What a placement that is only a preview needs.

    Sheets are placed as `wrap_sheet` describes it, and may overlap themselves. The final placement judges them.
    """

    near: Mapping[str, PlacedSkin]  # placements by the names of skins, on a similar surface, from which sheets start
    neighbours: bool  # whether the neighbours of the taxels are needed
    sigma: bool  # whether the uncertainty of the taxels is needed
    on_facets: bool  # whether sheets lie along the facets, and not on the smooth surface through the vertices


def place_all(plan: Plan, fits: Mapping[str, SurfaceFit], draft: Draft | None = None) -> tuple[PlacedSkin, ...]:
    """Place the skins of a link one after another, join adjacent sheets, and state the uncertainty of their taxels.

    The skins are on the surface through the vertices, see `SurfaceFit.error_field`, and not along the facets.
    """
    skins = plan.skins
    placed: list[PlacedSkin] = []
    counts: list[int | None] = []
    for k, skin in enumerate(skins):
        first = first_channels(skins[: k + 1], [*counts, None])[k]
        assert first is not None  # the counts of all previous skins are known
        name = plan.surface_of(skin)
        with naming_skin(plan, skin):
            done = place_skin(skin, fits[name], first) if draft is None else draft_skin(skin, fits[name], first, draft)
        imported = done.imported and done.imported.on(plan.link)
        patch = replace(done.patch, surface=name, max_load=skin.max_load)
        placed.append(replace(done, patch=patch, imported=imported, of_plan=tuple(placed_anew_warning(skin))))
        counts.append(skin.count or int(done.patch.taxels.channels.max()) + 1 - first)
    first_channels(skins, counts)
    patches = tuple(done.patch for done in placed)
    if draft is None or draft.neighbours:
        patches = with_neighbours_across(patches)
    if draft is None or draft.sigma:
        patches = tuple(
            (with_sigma if draft is None else draft_sigma)(
                patch, skin, fits[patch.surface], done.sheet, plan.mesh_uncertainty
            )
            for done, patch, skin in zip(placed, patches, skins)
        )
    enabled, disabled = with_single_taxels(patches, [skin.taxels for skin in skins])
    enabled = with_tilts(enabled)  # their neighbours are final now
    return tuple(replace(done, patch=on, disabled=off) for done, on, off in zip(placed, enabled, disabled))


def draft_skin(skin: Skin, fit: SurfaceFit, first_channel: int, draft: Draft) -> PlacedSkin:
    """Place a skin for a preview; arguments as for `place_skin` and `place_all`."""
    if not isinstance(skin, SheetSkin):
        return place_skin(skin, fit, first_channel)
    near = draft.near.get(skin.name)
    surface = fit.surface if draft.on_facets else fit.error_field.surface
    sheet = sheet_on(skin, fit, surface, near.sheet if near else None, preview=True)
    taxels = preview_taxels(sheet, skin.name, first_channel, fit.is_trusted)
    if draft.neighbours:
        found = neighbours(taxels.ids, taxels.positions_link, taxels.normals_link, taxels.corners_link)
        taxels = replace(taxels, neighbours=found)
    return PlacedSkin(sheet_patch(skin, taxels), sheet)


@singledispatch
def place_skin(skin: Skin, fit: SurfaceFit, first_channel: int) -> PlacedSkin:
    """Place one skin on the surface of a fit."""
    raise TypeError(f"cannot place a {type(skin).__name__}")


def sheet_on(
    skin: SheetSkin,
    fit: SurfaceFit,
    surface: BSplineSurface,
    near: WrappedSheet | None = None,
    preview: bool = False,
    max_angle: float = MAX_ANGLE,
) -> WrappedSheet:
    """Return the sheet of a skin on a surface of a fit; arguments as for `wrap_sheet` and `on_cover`."""
    sheet = wrap_sheet(
        surface,
        skin.lattice,
        skin.origin,
        skin.direction,
        offset=skin.offset,
        landmarks=skin.landmarks,
        trim=skin.trim,
        near=near,
        preview=preview,
    )
    return on_cover(sheet, skin, fit, max_angle) if skin.trim else sheet


def sheet_patch(skin: SheetSkin, taxels: TaxelArray) -> Patch:
    """Return the patch of a placed sheet with these taxels."""
    shape = skin.lattice.rows, skin.lattice.columns
    return Patch(skin.name, "sheet", SURFACE, shape, skin.lattice.pitch, taxels, offset=skin.offset)


@place_skin.register
def _(skin: SheetSkin, fit: SurfaceFit, first_channel: int) -> PlacedSkin:
    sheet = sheet_on(skin, fit, fit.error_field.surface)
    placed = PlacedSkin(sheet_patch(skin, sheet_taxels(sheet, skin.name, first_channel, fit.is_trusted)), sheet)
    check_overhang(placed.patch, skin.max_overhang)
    if not skin.overlap:
        check_overlap(placed.patch, placed.closure)
    return placed


def on_cover(sheet: WrappedSheet, skin: SheetSkin, fit: SurfaceFit, max_angle: float) -> WrappedSheet:
    """Return a sheet without the cells that the cover does not carry.

    They are over a hole, outside the boundary of the grid, off the mesh, or inclined by more than ``max_angle`` [rad]
    to the mean normal of the faces below their centre, corners and edges.
    """
    shape, flat = sheet.uv.shape[:2], sheet.uv.reshape(-1, 2)
    distance, face, _ = closest(fit.given_mesh, sheet.surface.points(flat))
    normals = sheet.surface.normals(flat)
    below = fit.given_mesh.face_normals[face]
    below = (below * np.sign((below * normals).sum(axis=1, keepdims=True))).reshape(*shape, 3)
    mean = unit(sliding_window_view(below, (3, 3, 1))[::2, ::2].sum(axis=(3, 4, 5)))
    centre = normals.reshape(*shape, 3)[1::2, 1::2]
    is_parallel = (mean * centre).sum(axis=2).ravel() > np.cos(max_angle)
    is_near = distance.reshape(shape)[1::2, 1::2].ravel() <= MAX_DISTANCE
    on_mesh = fit.is_trusted(sheet.surface.wrap(sheet.uv[1::2, 1::2].reshape(-1, 2)))
    inside = sheet.inside & on_mesh & is_near & is_parallel
    if not inside.any():
        raise OutsideSurface(f"No cell of skin {skin.name!r} lies on the cover. Move it, or choose another surface.")
    return replace(sheet, inside=inside)


@place_skin.register
def _(skin: BoardSkin, fit: SurfaceFit, first_channel: int) -> PlacedSkin:
    boards, overhang = lay_boards(
        fit.error_field.surface,
        skin.lattice,
        skin.choice,
        skin.origin,
        skin.direction,
        offset=skin.offset,
        fit=fit,
        excluded=skin.excluded,
    )
    taxels, pitch = board_taxels(boards, skin.name, first_channel, overhang), skin.lattice.pitch
    columns, rows = (int(k) + 1 for k in np.ptp(boards.cells, axis=0))
    patch = Patch(skin.name, "hexagons", SURFACE, (columns, rows), (pitch, pitch), taxels, offset=skin.offset)
    check_overhang(patch, skin.max_overhang)
    return PlacedSkin(patch)


@place_skin.register
def _(skin: ImportedSkin, fit: SurfaceFit, first_channel: int) -> PlacedSkin:
    taxel_set = read_taxels(skin.file, skin.format, skin.only)
    found = imported_taxels(
        taxel_set, fit.error_field.surface, skin.name, fit.given_mesh, frame=skin.frame, snap=skin.snap
    )
    wrong = next((finding for finding in found.findings if finding.severity == "error"), None)
    if wrong is not None:
        raise InvalidPlan(f"skin {skin.name!r}, {skin.file.name}: {wrong.message}", finding=wrong)
    taxels = replace(found.taxels, channels=found.taxels.channels + first_channel)
    shape = (len(taxels.ids), 1)
    return PlacedSkin(Patch(skin.name, "imported", SURFACE, shape, (found.pitch, found.pitch), taxels), imported=found)
