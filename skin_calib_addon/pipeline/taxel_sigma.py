"""The uncertainty of the taxels of a plan's skins, and the registration that it assumes."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from ..calibration.model import Patch, Registration, Touched
from ..common.arrays import Array, BoolArray
from ..common.errors import InvalidPlan, counted, listed, millimetres
from ..common.mesh_uncertainty import MeshUncertainty
from ..common.warnings import Place, Warning, point_of
from ..geometry.fit.mesh_uncertainty import with_mesh_uncertainty
from ..geometry.fit.surface_fit import SurfaceFit
from ..plan.skins import ImportedSkin, Mounting, SheetSkin, Skin, placed_anew
from ..skin.sheet.landmarks import MAX_POINT_DISTANCE
from ..skin.sheet.wrap import WrappedSheet
from ..skin.single_taxels import chosen_taxels
from ..skin.uncertainty import (
    DIRECTION_UNCERTAINTY,
    MAX_KNOWN_STRAIN,
    NOT_RIGID,
    ORIGIN_UNCERTAINTY,
    moved_rigidly,
    moved_within,
    taxel_uncertainty,
    usual_curvature,
)
from ..skin.warnings import cells_warning
from ..validation.flat import flat_places, flat_point, link_point

# [1] difference to the normal of the surface from which on a board of the file gives the normal. Larger: boards that
# are nearly parallel to the surface count as a part of it, with larger uncertainties.
SAME_NORMAL = 1e-9

# [1] taxels of a skin up to which a preview computes the uncertainty of each. Larger: more time.
MAX_DRAFT_TAXELS = 600


def with_sigma(
    patch: Patch,
    skin: Skin,
    fit: SurfaceFit,
    sheet: WrappedSheet | None,
    mesh: MeshUncertainty,
    may_fold: bool = True,
) -> Patch:
    """Return a patch with the standard uncertainty of each taxel, and the registration that it assumes."""
    registration = registration_of(skin, patch, sheet)
    touched = touched_of(skin)
    taxels, field = patch.taxels, with_mesh_uncertainty(fit, mesh)
    of_part = mesh.variance * np.eye(2)  # along the surface
    if isinstance(skin, ImportedSkin):  # it keeps the positions of a file
        along, height, tilt = moved_rigidly(taxels, registration)
        of_file = None if skin.snap else height + mesh.variance
        uncertainty = taxel_uncertainty(taxels, field, along + of_part, of_file, tilt)
        upright = field.surface.normals(taxels.uv)
        of_boards = np.abs(taxels.normals_link - upright).max(axis=1) > SAME_NORMAL  # they turn with the frame only
        uncertainty.angle[of_boards] = (tilt + mesh.slope) * np.eye(2)
    else:
        arms = flat_places(patch, taxels.index) - flat_point(patch, np.array(registration.anchor))
        covariance = registration.covariance if touched is None else np.array(touched.covariance)
        along = moved_within(arms, covariance, usual_curvature(field.surface, taxels.uv)) + of_part
        if touched is not None and isinstance(skin, SheetSkin):
            along += NOT_RIGID**2 * np.eye(2)
        uncertainty = taxel_uncertainty(taxels, field, along)
    sigma = uncertainty.sigma
    sigma[~fit.is_trusted(taxels.uv)] = np.nan  # over a hole, which has its own warning
    for _, unknown in _unknown(patch, fit, may_fold):
        sigma[unknown] = np.nan
    sigma[~np.isfinite(sigma).all(axis=1)] = np.nan
    return replace(patch, taxels=replace(taxels, sigma=sigma), registration=registration, touches=touched)


def draft_sigma(patch: Patch, skin: Skin, fit: SurfaceFit, sheet: WrappedSheet | None, mesh: MeshUncertainty) -> Patch:
    """Return the same for a preview: of many taxels, each has the uncertainty of the nearest one of a part of them."""
    taxels = patch.taxels
    stride = int(np.ceil(np.sqrt(len(taxels.ids) / MAX_DRAFT_TAXELS)))
    some = (taxels.index % stride == stride // 2).all(axis=1)
    if stride == 1 or not some.any():
        return with_sigma(patch, skin, fit, sheet, mesh, may_fold=False)
    part = chosen_taxels(taxels, some)
    found = with_sigma(replace(patch, taxels=part), skin, fit, sheet, mesh, may_fold=False)
    nearest = cKDTree(part.index).query(taxels.index)[1]
    sigma = found.taxels.known_sigma[nearest]
    return replace(found, taxels=replace(taxels, sigma=sigma))


def registration_of(skin: Skin, patch: Patch, sheet: WrappedSheet | None) -> Registration:
    """Return how exactly a skin is mounted: by its touches, as the plan says, or as a skin of its kind usually is."""
    stated = skin.registration or Mounting(direction=_usual_direction(skin))
    if touched := touched_of(skin):
        stated = Mounting(touched.shift_error, touched.turn_error, touched.anchor)
    if stated.anchor is None:
        return Registration(stated.origin, stated.direction, point_of(anchor_of(skin, patch, sheet)))
    arms = np.array(stated.anchor) - patch.taxels.positions_link
    nearest = int((arms**2).sum(axis=1).argmin())
    height = abs(float(arms[nearest] @ patch.taxels.normals_link[nearest]))
    if height > MAX_POINT_DISTANCE:
        raise InvalidPlan(
            f"The anchor of the registration of skin {skin.name!r}, {millimetres(stated.anchor)}, is "
            f"{height * 1e3:.1f} mm from the skin. Choose a point of the skin, in metres in the link frame.",
            distance=height,
            place=Place(stated.anchor, skin=skin.name),
        )
    return Registration(stated.origin, stated.direction, stated.anchor)


def touched_of(skin: Skin) -> Touched | None:
    """Return how touches registered a skin; None if they did not, or if it was placed anew."""
    return None if skin.touches is None or placed_anew(skin) else skin.touches.touched


def placed_anew_warning(skin: Skin) -> Iterator[Warning]:
    """Yield a warning if a skin is no longer where touches registered it."""
    if skin.touches is not None and (changed := placed_anew(skin)):
        yield Warning(
            "placed-anew",
            "warning",
            f"Skin {skin.name} was placed anew after touches registered it on {skin.touches.touched.date}: it has "
            f"another {listed(changed)}. Its uncertainty is that of a skin without touches.",
            Place(skin=skin.name),
            advice="Touch it again, or put it back.",
        )


def _usual_direction(skin: Skin) -> float:
    """Return the uncertainty of the direction of a skin [rad]; with two landmarks it follows from their distance."""
    if not isinstance(skin, SheetSkin) or len(skin.landmarks) < 2:
        return DIRECTION_UNCERTAINTY
    ends = np.array([mark.point for mark in skin.landmarks])  # each has the uncertainty of the origin
    return ORIGIN_UNCERTAINTY * np.sqrt(2) / float(np.linalg.norm(ends - ends[0], axis=1).max())


def anchor_of(skin: Skin, patch: Patch, sheet: WrappedSheet | None) -> Array:
    """Return the point of a skin that the plan places, shape (3,) [m]; arguments as in `registration_of`."""
    if isinstance(skin, ImportedSkin):
        middle: Array = patch.taxels.positions_link.mean(axis=0)
        return middle
    if sheet is None or not isinstance(skin, SheetSkin):
        return link_point(patch, np.zeros(2))  # the root of the boards
    rows, columns = patch.shape
    cell = np.array((0.0, 0.0) if skin.origin is not None else ((rows - 1) / 2, (columns - 1) / 2))
    if skin.landmarks:
        cell = np.array(skin.landmarks[0].cell, float)
    node = sheet.uv[tuple(np.rint(2 * cell + 1).astype(int))][None]
    anchor: Array = (sheet.surface.points(node) + sheet.offset * sheet.surface.normals(node))[0]
    return anchor


def _unknown(patch: Patch, fit: SurfaceFit, may_fold: bool = True) -> Iterator[tuple[str, BoolArray]]:
    """Yield the reasons for which taxels have no uncertainty, and the rows of these taxels."""
    taxels = patch.taxels
    if may_fold:
        yield "the surface is folded", np.full(len(taxels.ids), fit.smallest_area <= 0)
    if "strain" in taxels.quality:
        strain = np.abs(taxels.quality["strain"][:, :2]).max(axis=1)
        yield f"they are strained by more than {MAX_KNOWN_STRAIN:.0%}", strain > MAX_KNOWN_STRAIN


def unknown_sigma(patch: Patch, fit: SurfaceFit) -> Iterator[Warning]:
    """Yield a warning for each reason for which taxels have no uncertainty, except holes."""
    reasons = list(_unknown(patch, fit))
    stated = np.isfinite(patch.taxels.known_sigma).all(axis=1)
    others = np.any([stated, ~fit.is_trusted(patch.taxels.uv), *(unknown for _, unknown in reasons)], axis=0)
    for reason, unknown in (*reasons, ("it cannot be computed there", ~others)):
        rows = np.flatnonzero(unknown)
        if len(rows):
            which = f"{counted(len(rows), 'taxel')} of {patch.name}"
            names = listed([patch.taxels.ids[i] for i in rows])
            message = f"The uncertainty of {which} is unknown, because {reason}: {names}."
            advice = "Move the skin, or mend the surface there."
            yield cells_warning("no-uncertainty", patch, rows, message, float(len(rows)), advice)
