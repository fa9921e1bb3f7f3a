"""Move the skins of a plan to where touches say that they lie."""

from dataclasses import dataclass, replace
from functools import singledispatch
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from ..calibration.model import LinkCalibration, Patch
from ..common.arrays import Array
from ..common.errors import InvalidPlan
from ..plan import Plan
from ..plan.skins import BoardSkin, SheetSkin, Skin
from ..skin.sheet.landmarks import Landmark
from ..validation.placement import Motion, Placement, flat_places, other_order, placements
from ..validation.touches import Touches
from .calibrate import Calibrated
from .place_skins import place_all

MAX_REFINE_STEPS = 8
REFINE_TOLERANCE = 1e-5  # a slide that moves no cell by more is the last [m]


@dataclass(frozen=True, eq=False)
class Refined:
    """A plan whose skins lie where touches say."""

    plan: Plan
    calibration: LinkCalibration  # with the skins placed so
    placements: list[Placement]  # how far the touches are off there


def refine(plan: Plan, result: Calibrated, touches: Touches) -> Refined:
    """Slide each skin that was touched on its surface until the touches ask for no more.

    Origin and direction of a skin move, or its landmarks; boards that chose their own places keep them.

    Parameters
    ----------
    plan : Plan
    result : Calibrated
        What came of the plan.
    touches : Touches

    Raises
    ------
    InvalidPlan
        If a skin was touched too few times, or by channels in another order, is imported, is centred without
        its first cell, or comes to no rest.
    OutsideSurface
        If a skin would lie off the surface.
    """
    placed, found = result.placed, placements(result.calibration, touches)
    for placement in found:
        order = other_order(placement)
        if order:
            raise InvalidPlan(f"the touches of skin {placement.patch.name!r} fit {order}; put the channels right first")
    skins = plan.skins
    for _ in range(MAX_REFINE_STEPS):
        motions = {placement.patch.name: _motion(placement) for placement in found}
        skins = tuple(
            moved(skin, done.patch, motions[skin.name]) if skin.name in motions else skin
            for skin, done in zip(skins, placed)
        )
        placed = place_all(skins, result.fit)
        calibration = replace(result.calibration, patches=tuple(done.patch for done in placed))
        found = placements(calibration, touches)
        if all(_largest(placement) < REFINE_TOLERANCE for placement in found):
            return Refined(replace(plan, skins=skins), calibration, found)
    worst = max(found, key=_largest)
    raise InvalidPlan(
        f"the refinement of skin {worst.patch.name!r} did not converge in {MAX_REFINE_STEPS} steps: "
        f"the last step was {_largest(worst) * 1e3:.2f} mm. Check the touches."
    )


def _motion(placement: Placement) -> Motion:
    if placement.motion is not None:
        return placement.motion
    name, count = placement.patch.name, len(placement.rows)
    if placement.patch.kind == "imported":
        raise InvalidPlan(
            f"skin {name!r} lies where its file says; touches do not move it: change the file, or its frame"
        )
    raise InvalidPlan(f"skin {name!r} was touched {count} times, which is too few to say how it lies")


def _largest(placement: Placement) -> float:
    """By how much a touched cell would still move [m]."""
    return float(np.linalg.norm(_motion(placement).at(placement.flat), axis=1).max())


@singledispatch
def moved(skin: Skin, patch: Patch, motion: Motion) -> Any:
    """A skin that lies as a patch does, slid by a motion."""
    raise TypeError(f"no way to move a {type(skin).__name__}")


@moved.register
def _(skin: SheetSkin, patch: Patch, motion: Motion) -> SheetSkin:
    if not skin.landmarks:
        origin, direction = _root(skin, patch, motion)
        return replace(skin, origin=origin, direction=direction)
    marks = tuple(
        Landmark(mark.cell, _triple(np.array(mark.point) + _step(patch, mark.cell, motion))) for mark in skin.landmarks
    )
    return replace(skin, landmarks=marks, direction=_turned(skin.direction, patch, marks[0].cell, motion))


@moved.register
def _(skin: BoardSkin, patch: Patch, motion: Motion) -> BoardSkin:
    cells = tuple((q, r) for q, r in patch.taxels.index.tolist())
    origin, direction = _root(skin, patch, motion)
    return replace(skin, choice=cells, origin=origin, direction=direction)


def _root(skin: SheetSkin | BoardSkin, patch: Patch, motion: Motion) -> tuple[Any, Any]:
    """Origin and direction of a slid skin; of one that was centred those that it has there."""
    taxels, root = patch.taxels, (0, 0)
    row = _row_near(patch, root)
    place, direction = taxels.positions_link[row], taxels.tangents_link[row]
    if skin.origin is not None:
        place, direction = np.array(skin.origin), np.array(skin.direction or direction)
    elif tuple(taxels.index[row]) != root:
        raise InvalidPlan(f"skin {skin.name!r} has no cell (0, 0) to be held by where it lies; give it an origin first")
    return _triple(place + _step(patch, root, motion)), _turned(direction, patch, root, motion)


def _row_near(patch: Patch, cell: tuple[int, int]) -> int:
    """Of the taxel of a cell, or of the nearest one where that was left out."""
    places, cells = flat_places(patch, patch.taxels.index), np.array([cell])
    return int(np.linalg.norm(places - flat_places(patch, cells), axis=1).argmin())


def _step(patch: Patch, cell: tuple[int, int], motion: Motion) -> Array:
    """By how much a cell moves, in the link frame (3,) [m]."""
    along, across = motion.at(flat_places(patch, np.array([cell])))[0]
    row = _row_near(patch, cell)
    normal, tangent = patch.taxels.normals_link[row], patch.taxels.tangents_link[row]
    return along * tangent + across * np.cross(normal, tangent)


def _turned(direction: Any, patch: Patch, cell: tuple[int, int], motion: Motion) -> Any:
    """A direction at a cell, turned."""
    normal = patch.taxels.normals_link[_row_near(patch, cell)]
    return _triple(Rotation.from_rotvec(motion.turn * normal).apply(np.array(direction)))


def _triple(vector: Array) -> tuple[float, float, float]:
    x, y, z = vector.tolist()
    return x, y, z
