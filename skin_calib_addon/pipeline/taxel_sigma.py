"""The uncertainty of the taxels of a plan's skins, and the registration that it assumes."""

from collections.abc import Iterator
from dataclasses import replace
from functools import singledispatch

import numpy as np

from ..calibration.model import Patch, Registration
from ..common.arrays import Array, BoolArray
from ..common.warnings import Place, Warning, point_of
from ..geometry.fit.surface_fit import SurfaceFit
from ..plan.skins import BoardSkin, ImportedSkin, SheetSkin, Skin
from ..skin.sheet.wrap import WrappedSheet
from ..skin.uncertainty import (
    DIRECTION_UNCERTAINTY,
    MAX_KNOWN_STRAIN,
    ORIGIN_UNCERTAINTY,
    moved_rigidly,
    moved_within,
    taxel_uncertainty,
)
from ..validation.placement import flat_places


def with_sigma(patch: Patch, skin: Skin, fit: SurfaceFit, sheet: WrappedSheet | None) -> Patch:
    """Return a patch with the standard uncertainty of each taxel, and the registration that it assumes.

    Parameters
    ----------
    patch : Patch
        The placed skin.
    skin : Skin
        The skin of the plan.
    fit : SurfaceFit
        The surface.
    sheet : WrappedSheet or None
        The placement of a sheet.

    Returns
    -------
    Patch
    """
    registration, arms = registration_of(skin, patch, sheet)
    taxels, field = patch.taxels, fit.error_field
    if arms is None:
        along, height, tilt = moved_rigidly(taxels, registration)
        snapped = isinstance(skin, ImportedSkin) and skin.snap
        uncertainty = taxel_uncertainty(taxels, field, along, None if snapped else height, tilt)
    else:
        strain = np.abs(taxels.quality["strain"][:, :2]).max(axis=1) if "strain" in taxels.quality else 0.0
        uncertainty = taxel_uncertainty(taxels, field, moved_within(arms, registration, strain))
    sigma = uncertainty.sigma
    sigma[~fit.is_trusted(taxels.uv)] = np.nan  # over a hole, which has its own warning
    for _, unknown in _unknown(patch, fit):
        sigma[unknown] = np.nan
    sigma[~np.isfinite(sigma).all(axis=1)] = np.nan
    return replace(patch, taxels=replace(taxels, sigma=sigma), registration=registration)


@singledispatch
def registration_of(skin: Skin, patch: Patch, sheet: WrappedSheet | None) -> tuple[Registration, Array | None]:
    """Return how exactly a skin is mounted, and the flat positions of its taxels relative to the anchor.

    Parameters
    ----------
    skin : Skin
        The skin of the plan.
    patch : Patch
        Its placement.
    sheet : WrappedSheet or None
        The placement of a sheet.

    Returns
    -------
    registration : Registration
    arms : array, shape (n, 2), or None
        Along the rows and across [m]; None for taxels that keep their positions of a file.
    """
    raise TypeError(f"the registration of a {type(skin).__name__} is unknown")


@registration_of.register
def _(skin: SheetSkin, patch: Patch, sheet: WrappedSheet | None) -> tuple[Registration, Array | None]:
    assert sheet is not None
    rows, columns = patch.shape
    direction = DIRECTION_UNCERTAINTY
    cell = np.array((0.0, 0.0) if skin.origin is not None else ((rows - 1) / 2, (columns - 1) / 2))
    if skin.landmarks:
        cell = np.array(skin.landmarks[0].cell, float)
    if len(skin.landmarks) > 1:  # each point has the uncertainty of the origin; both ends turn the skin
        ends = np.array([mark.point for mark in skin.landmarks])
        direction = ORIGIN_UNCERTAINTY * np.sqrt(2) / float(np.linalg.norm(ends - ends[0], axis=1).max())
    node = sheet.uv[tuple(np.rint(2 * cell + 1).astype(int))][None]
    anchor = sheet.surface.points(node) + sheet.offset * sheet.surface.normals(node)
    arms = flat_places(patch, patch.taxels.index) - flat_places(patch, cell[None])
    return Registration(ORIGIN_UNCERTAINTY, direction, point_of(anchor[0])), arms


@registration_of.register
def _(skin: BoardSkin, patch: Patch, sheet: WrappedSheet | None) -> tuple[Registration, Array | None]:
    taxels = patch.taxels
    arms = flat_places(patch, taxels.index)  # the root is at zero
    i = int(np.argmin((arms**2).sum(axis=1)))  # the root itself may have been left out
    tangent, normal = taxels.tangents_link[i], taxels.normals_link[i]
    anchor = taxels.positions_link[i] - arms[i, 0] * tangent - arms[i, 1] * np.cross(normal, tangent)
    return Registration(ORIGIN_UNCERTAINTY, DIRECTION_UNCERTAINTY, point_of(anchor)), arms


@registration_of.register
def _(skin: ImportedSkin, patch: Patch, sheet: WrappedSheet | None) -> tuple[Registration, Array | None]:
    anchor = patch.taxels.positions_link.mean(axis=0)
    return Registration(ORIGIN_UNCERTAINTY, DIRECTION_UNCERTAINTY, point_of(anchor)), None


def _unknown(patch: Patch, fit: SurfaceFit) -> Iterator[tuple[str, BoolArray]]:
    """Yield the reasons for which taxels have no uncertainty, and the rows of these taxels."""
    taxels = patch.taxels
    yield "the surface is folded", np.full(len(taxels.ids), fit.smallest_area <= 0)
    if "strain" in taxels.quality:
        strain = np.abs(taxels.quality["strain"][:, :2]).max(axis=1)
        yield f"they are strained by more than {MAX_KNOWN_STRAIN:.0%}", strain > MAX_KNOWN_STRAIN


def unknown_sigma(patch: Patch, fit: SurfaceFit) -> Iterator[Warning]:
    """Yield a warning for each reason for which taxels have no uncertainty, except holes.

    Parameters
    ----------
    patch : Patch
        The placed skin.
    fit : SurfaceFit
        The surface.
    """
    for reason, unknown in _unknown(patch, fit):
        rows = np.flatnonzero(unknown)
        if len(rows):
            taxels = tuple(patch.taxels.ids[i] for i in rows)
            yield Warning(
                "no-uncertainty",
                "warning",
                f"The uncertainty of {len(rows)} taxels of {patch.name} is unknown, because {reason}: "
                f"{', '.join(taxels[:5])}{', ...' if len(rows) > 5 else ''}.",
                Place(point_of(patch.taxels.positions_link[rows[0]]), skin=patch.name, taxels=taxels),
                float(len(rows)),
                "Move the skin, or mend the surface there.",
            )
