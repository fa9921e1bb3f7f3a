"""Refine the poses of the skins of a plan with measured touches."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from ..calibration.model import LinkCalibration, Patch, Registration, Touched
from ..common.arrays import Array
from ..common.errors import InvalidPlan, listed
from ..common.warnings import point_of
from ..geometry.blas_threads import one_blas_thread
from ..plan import Plan
from ..plan.skins import BoardSkin, ImportedSkin, Registered, SheetSkin, Skin, spot_of
from ..skin.sheet.landmarks import Landmark
from ..skin.uncertainty import MIN_ORIGIN_UNCERTAINTY
from ..validation.directions import directions_of
from ..validation.flat import flat_places, link_point
from ..validation.placement import MAX_UNEXPLAINED, MIN_TOUCHES, Placement, placements
from ..validation.registration import Motion, rigid_motion
from ..validation.touches import Touches
from .calibrate import OUTDATED_PROPOSAL, Calibrated, warnings_of
from .place_skins import PlacedSkin, place_all
from .taxel_sigma import registration_of, with_sigma
from .touch_distance import check_touches

MAX_REFINE_STEPS = 8  # Larger: a refinement that converges slowly takes longer before it fails.
REFINE_TOLERANCE = 1e-5  # Largest motion of a cell in the last step [m]. Larger: fewer steps, less precise.


@dataclass(frozen=True, eq=False)
class Refined:
    """A plan whose skins are at the positions of the touches."""

    plan: Plan
    calibration: LinkCalibration  # with the refined skins
    placements: list[Placement]  # deviations of the touches from the refined skins


@one_blas_thread()
def refine(plan: Plan, result: Calibrated, touches: Touches) -> Refined:
    """Move each touched skin along the surface until the touches agree with it.

    The touches give a rigid motion of the developed skin. Each step changes origin and direction of the skin, or its
    landmarks, until its cells have moved by this motion as seen from the touches. Boards keep their cells. A skin
    without a significant motion stays.
    """
    check_touches(result.calibration, touches)
    placed, skins, first = result.placed, plan.skins, placements(result.calibration, touches)
    for placement in first:
        _check_order(placement)
    of_touches = {placement.patch.name: _motion(placement) for placement in first}
    found, left = first, {name: motion for name, motion in of_touches.items() if motion.is_certain}
    back = {name: -motion.about_origin for name, motion in left.items()}  # to the plan
    of_the_plan = tuple(warning for warning in result.warnings if warning == OUTDATED_PROPOSAL)
    for _ in range(MAX_REFINE_STEPS):
        skins = tuple(
            moved(skin, done.patch, left[skin.name]) if skin.name in left else skin for skin, done in zip(skins, placed)
        )
        if left:
            placed = place_all(replace(plan, skins=skins), result.fits)
            warnings = (*of_the_plan, *warnings_of(result.fits, placed))
            result = replace(result, calibration=replace(result.calibration, warnings=warnings))
            found = placements(_calibration(result, placed), touches, back)
        pairs = [(a, b) for a, b in zip(first, found) if a.patch.name in left]
        left = {a.patch.name: _remaining(a, b, of_touches[a.patch.name]) for a, b in pairs}
        largest = {a.patch.name: float(np.linalg.norm(left[a.patch.name].at(a.flat), axis=1).max()) for a, _ in pairs}
        if all(length < REFINE_TOLERANCE for length in largest.values()):
            plan, result = replace(plan, skins=skins), replace(result, calibration=_calibration(result, placed))
            return _with_registration(plan, result, placed, found, of_touches, touches)
    worst = max(largest, key=lambda name: largest[name])
    raise InvalidPlan(
        f"the refinement of skin {worst!r} did not converge in {MAX_REFINE_STEPS} steps: "
        f"the last step was {largest[worst] * 1e3:.2f} mm. Check the touches."
    )


def _remaining(before: Placement, after: Placement, motion: Motion) -> Motion:
    """Return the motion that is left, as the offsets of the touches show it."""
    both = np.isin(before.lines, after.lines) & ~before.unexplained
    wanted = before.offsets[both, :2] - motion.at(before.flat[both])
    now = after.offsets[np.isin(after.lines, before.lines[both]), :2]
    vector = rigid_motion(before.flat[both], now - wanted)
    return replace(motion, middle=np.zeros(2), shift=vector[:2], turn=float(vector[2]))


def _calibration(result: Calibrated, placed: Sequence[PlacedSkin]) -> LinkCalibration:
    """Return the calibration with these skins."""
    return replace(result.calibration, patches=tuple(done.patch for done in placed))


def _check_order(placement: Placement) -> None:
    """Check that the planned order of the channels explains the touches of a skin."""
    name, wiring, count = placement.patch.name, placement.wiring, len(placement.rows)
    if count < MIN_TOUCHES:
        return
    unexplained = max(int(placement.unexplained.sum()), round((1 - wiring.explained) * count))
    if unexplained > MAX_UNEXPLAINED * count and not (wiring.order.words and wiring.explained > 1 - MAX_UNEXPLAINED):
        raise InvalidPlan(
            f"{unexplained} of {count} touches of skin {name!r} fit neither its taxels nor another known order of its "
            "channels. Check the channels and the frame of the touches."
        )
    if wiring.is_certain and wiring.order.words:
        raise InvalidPlan(
            f"the touches of skin {name!r} fit another order of its channels: {wiring.order.words}. "
            "Correct the channels first."
        )
    if not wiring.is_certain:
        raise InvalidPlan(
            f"the touches of skin {name!r} fit several orders of its channels: {listed(wiring.candidates)}. "
            "Touch both ends of its rows and columns."
        )


def _with_registration(
    plan: Plan,
    result: Calibrated,
    placed: Sequence[PlacedSkin],
    found: list[Placement],
    motions: Mapping[str, Motion],
    touches: Touches,
) -> Refined:
    """State the registration in the plan, and in the calibration with the uncertainties of the taxels that follow."""
    skins, patches = [], []
    placement_of, angles = {placement.patch.name: placement for placement in found}, _angles(result, placed, touches)
    for skin, done in zip(plan.skins, placed):
        patch = done.patch
        if skin.name in motions:
            assert not isinstance(skin, ImportedSkin)  # which has no motion
            usual = registration_of(replace(skin, touches=None), patch, done.sheet)
            touched = _touched(placement_of[skin.name], motions[skin.name], usual, touches.sha256, angles)
            skin = replace(skin, touches=Registered(touched, spot_of(skin)))
            patch = with_sigma(patch, skin, result.fits[patch.surface], done.sheet, plan.mesh_uncertainty)
        skins.append(skin)
        patches.append(patch)
    return Refined(replace(plan, skins=tuple(skins)), replace(result.calibration, patches=tuple(patches)), found)


def _touched(
    placement: Placement, motion: Motion, usual: Registration, session: str, angles: Mapping[int, float]
) -> Touched:
    """Return how a skin was registered; ``angles`` [rad] of the forces by their lines.

    A skin without a significant motion stays. A rotation that the touches do not determine is as uncertain as usual.
    """
    made = motion if motion.is_certain else motion.left_out
    covariance = made.covariance + MIN_ORIGIN_UNCERTAINTY**2 * np.diag((1.0, 1.0, 0.0))
    if not np.isfinite(motion.turn_error):
        covariance[2] = covariance[:, 2] = 0.0
        covariance[2, 2] = usual.direction**2
    used = ~placement.unexplained
    heights = placement.offsets[used, 2]
    along, normal, angle = map(
        rms,
        (
            placement.distances[used],
            heights[~np.isnan(heights)],
            [angles[k] for k in placement.lines[used].tolist() if k in angles],
        ),
    )
    return Touched(
        date=today(),
        session=session,
        used=int(used.sum()),
        left_out=int((~used).sum()) + len(placement.grazing),
        shift=(float(made.shift[0]), float(made.shift[1])),
        turn=float(made.turn),
        covariance=triples(covariance),
        anchor=point_of(link_point(placement.patch, motion.middle)),
        along=along or 0.0,
        normal=normal,
        angle=angle,
    )


def today() -> str:
    """Return the date of a registration."""
    return datetime.now(UTC).date().isoformat()


def triples(rows: Array) -> tuple[tuple[float, float, float], ...]:
    """Return the rows (n, 3) of a matrix."""
    return tuple(map(point_of, rows))


def rms(values: Array | list[float]) -> float | None:
    """Return the root mean square; None of nothing."""
    return float(np.sqrt(np.mean(np.square(values)))) if len(values) else None


def _angles(result: Calibrated, placed: Sequence[PlacedSkin], touches: Touches) -> dict[int, float]:
    """Return the angles of the forces to the normals by the lines of their touches [rad]."""
    directions, _ = directions_of(_calibration(result, placed), touches)
    return {} if directions is None else dict(zip(directions.lines.tolist(), directions.angles.tolist()))


def _motion(placement: Placement) -> Motion:
    if placement.motion is not None:
        return placement.motion
    name, count = placement.patch.name, len(placement.rows)
    if placement.patch.kind == "imported":
        raise InvalidPlan(f"skin {name!r} is imported: touches cannot move it. Change its file or its frame.")
    raise InvalidPlan(f"skin {name!r} has {count} touches, which are too few for its pose. Measure more touches.")


def moved(skin: Skin, patch: Patch, motion: Motion) -> Skin:
    """Return a skin that is moved along the surface; boards are listed, so that they stay the same."""
    assert not isinstance(skin, ImportedSkin)  # which has no motion
    if isinstance(skin, SheetSkin) and skin.landmarks:
        marks = tuple(
            Landmark(mark.cell, point_of(np.array(mark.point) + _step(patch, mark.cell, motion)))
            for mark in skin.landmarks
        )
        return replace(skin, landmarks=marks, direction=_turned(skin.direction, patch, marks[0].cell, motion))
    origin, direction = _root(skin, patch, motion)
    if isinstance(skin, SheetSkin):
        return replace(skin, origin=origin, direction=direction)
    listed = skin.choice
    if isinstance(listed, str):
        listed = tuple((q, r) for q, r in patch.taxels.index.tolist())
    return replace(skin, choice=listed, origin=origin, direction=direction)


def _root(skin: SheetSkin | BoardSkin, patch: Patch, motion: Motion) -> tuple[Any, Any]:
    """Return origin and direction of a moved skin; a centred skin uses those of its placement."""
    taxels, root = patch.taxels, (0, 0)
    row = _row_near(patch, root)
    origin, direction = taxels.positions_link[row], taxels.tangents_link[row]
    if skin.origin is not None:
        origin, direction = np.array(skin.origin), np.array(skin.direction or direction)
    elif tuple(taxels.index[row]) != root:
        raise InvalidPlan(f"skin {skin.name!r} is centred and has no cell (0, 0). Give it an origin first.")
    return point_of(origin + _step(patch, root, motion)), _turned(direction, patch, root, motion)


def _row_near(patch: Patch, cell: tuple[int, int]) -> int:
    """Return the row of the taxel of a cell, or of the nearest one if the cell was left out."""
    positions, cells = flat_places(patch, patch.taxels.index), np.array([cell])
    return int(np.linalg.norm(positions - flat_places(patch, cells), axis=1).argmin())


def _step(patch: Patch, cell: tuple[int, int], motion: Motion) -> Array:
    """Return the motion of a cell in the link frame (3,) [m]."""
    step: Array = motion.at(flat_places(patch, np.array([cell])))[0] @ patch.taxels.axes_link[_row_near(patch, cell)]
    return step


def _turned(direction: Any, patch: Patch, cell: tuple[int, int], motion: Motion) -> Any:
    """Return a direction at a cell, rotated about the normal."""
    normal = patch.taxels.normals_link[_row_near(patch, cell)]
    return point_of(Rotation.from_rotvec(motion.turn * normal).apply(np.array(direction)))
