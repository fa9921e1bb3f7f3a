"""Calibrations whose skins are where touches of a robot on itself show them."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from ..calibration.model import LinkCalibration, Patch, Registration, Touched
from ..common.arrays import Array, tangential
from ..common.warnings import point_of
from ..geometry.blas_threads import one_blas_thread
from ..geometry.surface.footpoints import footpoints
from ..skin.uncertainty import MAX_DIRECTION_UNCERTAINTY, MIN_ORIGIN_UNCERTAINTY
from ..validation.flat import flat_places, link_point
from ..validation.planning import moves_of
from ..validation.self_touch import SelfTouch
from .calibrate import surface_of
from .refine import rms, today, triples


@one_blas_thread()
def moved_skins(found: SelfTouch, calibrations: Mapping[str, LinkCalibration]) -> dict[str, LinkCalibration]:
    """Return the calibrations of the touched links, with their skins moved, and the uncertainties from the touches."""
    patches: dict[str, list[Patch]] = {}
    for k, (link, _) in enumerate(found.model.session.patches):
        if found.of_patch(k):
            patches.setdefault(link, []).append(_moved(found, k, calibrations[link]))
    return {link: replace(calibrations[link], patches=tuple(now)) for link, now in patches.items()}


def _moved(found: SelfTouch, k: int, calibration: LinkCalibration) -> Patch:
    """Return a patch that is moved as a rigid body if it is imported, and along its surface otherwise."""
    patch = found.model.session.patches[k][1]
    taxels, (steps, covariances) = patch.taxels, found.displacements(k)
    uv, points = taxels.uv, taxels.positions_link + steps
    surface = next((surface_of(model) for model in calibration.surfaces if model.name == patch.surface), None)
    vector = found.rotation(k)
    if patch.kind == "imported" or surface is None:
        turns = np.tile(Rotation.from_rotvec(vector).as_matrix(), (len(points), 1, 1))
    else:
        feet, _ = footpoints(surface, taxels.positions_link)
        before = surface.normals(feet)
        side = np.sign((before * taxels.normals_link).sum(axis=1))[:, None]  # a file may have a surface inside out
        before = side * before
        heights = ((taxels.positions_link - surface.points(feet)) * before).sum(axis=1)
        uv, _ = footpoints(surface, points)
        now = side * surface.normals(uv)
        points = surface.points(uv) + heights[:, None] * now
        turns = (Rotation.from_rotvec(vector[2] * now) * _between(before, now)).as_matrix()
    normals, tangents = (np.einsum("nij,nj->ni", turns, v) for v in (taxels.normals_link, taxels.tangents_link))
    arms = taxels.corners_link - taxels.positions_link[:, None]
    moved = replace(
        taxels,
        uv=uv,
        positions_link=points,
        normals_link=normals,
        tangents_link=tangential(tangents, normals),
        corners_link=points[:, None] + arms @ np.swapaxes(turns, 1, 2),
        sigma=_sigma(patch, covariances),
    )
    return _with_registration(replace(patch, taxels=moved), found, k)


def _sigma(patch: Patch, covariances: Array) -> Array:
    """Return the uncertainties of taxels with those of the touches (n, 3, 3) instead of those of the registration.

    Those of earlier touches stay, too: the largest error of the registration that states them is not that of a taxel.
    """
    taxels, old = patch.taxels, patch.registration
    if not len(taxels.sigma):
        return taxels.sigma
    sigma = taxels.sigma.copy()
    before = np.zeros(len(sigma))
    if old is not None and patch.touches is None:
        squares = ((taxels.positions_link - old.anchor) ** 2).sum(axis=1)
        before = old.origin**2 + old.direction**2 * squares / 2
    along = np.einsum("nkc,ncd,nkd->n", taxels.axes_link, covariances, taxels.axes_link) / 2
    sigma[:, 0] = np.sqrt(np.maximum(sigma[:, 0] ** 2 - before, 0.0) + along)
    upright = np.einsum("nc,ncd,nd->n", taxels.normals_link, covariances, taxels.normals_link)
    sigma[:, 1] = np.hypot(sigma[:, 1], np.sqrt(np.maximum(upright, 0.0)))
    return sigma


def _with_registration(patch: Patch, found: SelfTouch, k: int) -> Patch:
    """Return a patch that states how exactly the touches placed it."""
    covariance = found.covariance_of(k)
    if patch.kind == "imported":
        anchor = patch.taxels.positions_link.mean(axis=0)
        origin, direction = (np.sqrt(np.linalg.eigvalsh(covariance[a, a])[-1]) for a in (slice(3), slice(3, 6)))
    else:  # about the taxel next to the middle of the touches: the point of independent errors may be off the skin
        flat = flat_places(patch, patch.taxels.index)
        arms, sides = flat - flat.mean(axis=0), (found.model.felt, found.model.skins)
        touched = np.concatenate([side.arms[side.patches == k] for side in sides])
        row = int(((arms - (touched.mean(axis=0) if len(touched) else 0.0)) ** 2).sum(axis=1).argmin())
        anchor, move = patch.taxels.positions_link[row], moves_of(arms[row : row + 1])[0]
        parts = move @ covariance @ move.T, covariance[2:, 2:]
        origin, direction = (np.sqrt(np.linalg.eigvalsh(part)[-1]) for part in parts)
        patch = replace(patch, touches=_touched(found, k, patch) or patch.touches)
    limits = max(float(origin), MIN_ORIGIN_UNCERTAINTY), min(float(direction), MAX_DIRECTION_UNCERTAINTY)
    return replace(patch, registration=Registration(*limits, point_of(anchor)))


def _touched(found: SelfTouch, k: int, patch: Patch) -> Touched | None:
    """Return how a sheet or boards were registered, about their middle; None without touches."""
    mine, is_used = found.model.of_skin(k), ~found.unexplained
    if not mine.any():
        return None
    covariance = found.covariance_of(k) + MIN_ORIGIN_UNCERTAINTY**2 * np.diag((1.0, 1.0, 0.0))
    x, y, turn = (float(found.values[j]) for j in found.of_patch(k).values())
    residuals = found.residuals[mine & is_used]
    return Touched(
        date=today(),
        session=found.model.session.sha256,
        used=len(residuals),
        left_out=int((mine & ~is_used).sum()),
        shift=(x, y),
        turn=turn,
        covariance=triples(covariance),
        anchor=point_of(link_point(patch, flat_places(patch, patch.taxels.index).mean(axis=0))),
        along=rms(np.linalg.norm(residuals[:, :2], axis=1)) or 0.0,
        normal=rms(residuals[:, 2]),
    )


def _between(before: Array, after: Array) -> Rotation:
    """Return the least rotations that turn unit vectors (n, 3) into others."""
    axes = np.cross(before, after)
    sines = np.linalg.norm(axes, axis=1)
    angles = np.arctan2(sines, (before * after).sum(axis=1))
    return Rotation.from_rotvec(axes * (angles / np.maximum(sines, 1e-12))[:, None])
