# SPDX-License-Identifier: GPL-3.0-or-later
"""The skins of a plan: from properties in scene units to frozen skins in metres, and back."""

import json
from dataclasses import replace
from functools import lru_cache
from itertools import chain, count
from pathlib import Path
from typing import Any

import numpy as np

from ...calibration.model import TaxelArray
from ...common.arrays import Array, unit
from ...common.errors import SkinCalibError
from ...geometry.surface.bspline import BSplineSurface
from ...pipeline.sources import relative_path
from ...plan.checks import about_skin
from ...plan.document import skin_kind
from ...plan.keys import SKIN_KINDS, SKINS_OF
from ...plan.skins import BoardSkin, ImportedSkin, SheetSkin, Skin
from ...skin.sheet.constraints import row_axis
from ...skin.sheet.wrap import root_of
from . import fields
from .face_groups import zones_of
from .units import in_units, vector


def read_skin(group: Any, metre: float) -> Skin:
    """Return the frozen skin in a group of properties, with the zones of its vertex group as it is now."""
    with about_skin(group.name):
        skin: Skin = fields.read(SKINS_OF[group.kind], group, metre, (f"Skin {group.name!r}",))
        if isinstance(skin, BoardSkin) and group.zone_group:
            return replace(skin, excluded=(*skin.excluded, *zones_of(group.id_data, group.zone_group)))
    is_pinned = isinstance(skin, SheetSkin) and skin.landmarks
    return replace(skin, origin=None) if is_pinned else skin


def write_skin(skin: Skin, group: Any, metre: float) -> None:
    """Set a new group of properties from a frozen skin."""
    _write_first(group, metre)
    group.kind = skin_kind(skin)
    fields.write(SKINS_OF[group.kind], skin, group, metre)


def _write_first(group: Any, metre: float) -> None:
    """Set the lengths of all kinds, for the author may change the kind."""
    for record in SKINS_OF.values():
        fields.write_first(record, group, metre)


def add_skin(skins: Any, kind: str, metre: float, name: str = "skin") -> Any:
    """Return a new skin at the end of a collection, with the usual sizes and a name of its own."""
    names = {skin.name for skin in skins}
    skin = skins.add()
    skin.name = next(n for n in chain([name], (f"{name}_{k}" for k in count(2))) if n not in names)
    skin.kind, skin.auto_channel, skin.opened = kind, True, True
    _write_first(skin, metre)
    return skin


def give_size(group: Any, boards: BoardSkin, metre: float) -> None:
    """Set lattice and height of a group of boards to those of others."""
    skin = read_skin(group, metre)
    assert isinstance(skin, BoardSkin)
    write_skin(replace(skin, lattice=boards.lattice, offset=boards.offset), group, metre)


def turn_along_lines(skin: Any, surface: BSplineSurface) -> None:
    """Set the direction of a new skin to that of the lines of a surface in its middle, to the side of the usual one.

    The usual direction can be perpendicular to the surface there.
    """
    along = unit(surface.derivatives(root_of(surface, None)[None])[0, 1, 0])
    skin.direction = np.round(-along if along @ np.array(skin.direction) < 0 else along, 3)


@lru_cache(maxsize=16)  # panels ask for it in each redraw
def _frame_at(surface: BSplineSurface, origin: tuple[float, ...] | None) -> tuple[Array, Array]:
    """Return unit tangents at the point nearest to an origin: along the lines, and to their left seen from outside."""
    uv = root_of(surface, origin)
    along = row_axis(surface, uv, surface.derivatives(uv[None])[0, 1, 0])
    return along, np.cross(surface.normals(uv[None])[0], along)


def frame_of(skin: Any, surface: BSplineSurface, metre: float) -> tuple[Array, Array] | None:
    """Return these tangents at the origin of a skin; None if it is away from the surface."""
    origin = None if skin.centred else tuple(vector(skin.origin, metre))
    if skin.kind == "sheet" and skin.landmarks:
        origin = tuple(vector(skin.landmarks[0].point, metre))
    try:
        return _frame_at(surface, origin)
    except SkinCalibError:
        return None


def row_angle(skin: Any, frame: tuple[Array, Array]) -> float:
    """Return the angle from the lines of a surface to the rows of a skin, counter-clockwise seen from outside [rad]."""
    along, left = (np.array(skin.direction) @ tangent for tangent in frame)
    return float(np.arctan2(left, along))


def turn_rows(skin: Any, frame: tuple[Array, Array], angle: float) -> None:
    """Set the direction of a skin by this angle [rad]."""
    along, left = frame
    skin.direction = np.round(np.cos(angle) * along + np.sin(angle) * left, 6)
    skin.auto_direction = False


def seen_from(folder: Path, skins: tuple[Skin, ...]) -> tuple[Skin, ...]:
    """Return skins whose files have paths from a folder."""
    return tuple(
        replace(skin, file=Path(relative_path(folder, skin.file))) if isinstance(skin, ImportedSkin) else skin
        for skin in skins
    )


def move_skin(skin: Any, moved: SheetSkin | BoardSkin, metre: float) -> None:
    """Set the pose of a skin and nothing else: origin and direction, or landmarks; its touches; and its boards."""
    for item, mark in zip(skin.landmarks, getattr(moved, "landmarks", ())):
        item.point = in_units(mark.point, metre)
    if moved.origin is not None:
        skin.origin, skin.centred = in_units(moved.origin, metre), False
    if moved.direction is not None:
        skin.direction, skin.auto_direction = moved.direction, False
    fields.write_key(SKINS_OF[skin_kind(moved)].key("touches"), skin, moved.touches, metre)
    if isinstance(moved, BoardSkin) and not isinstance(moved.choice, str):
        skin.choice, skin.cells = "listed", fields.written_cells(moved.choice)


def point_of(plan: Any, what: str, skin: int, index: int) -> tuple[Any, str]:
    """Return the group of properties that has an origin, a landmark or a zone, and the name of its point there."""
    if what == "landmark":
        return entry(of_kind(plan, skin, "sheet", "landmarks").landmarks, index, "landmark"), "point"
    if what == "zone":
        return entry(of_kind(plan, skin, "hexagons", "excluded zones").excluded, index, "excluded zone"), "point"
    owner = entry(plan.skins, skin, "skin")
    if owner.kind == "imported":
        raise SkinCalibError(f"Skin {owner.name!r} has no origin, its file has the positions. Give it a frame.")
    return owner, "origin"


def put_point(plan: Any, what: str, skin: int, index: int, point: Any) -> None:
    """Set an origin, a landmark or a zone to a point."""
    owner, name = point_of(plan, what, skin, index)
    setattr(owner, name, point)
    if what == "origin":
        owner.centred = False


def in_window(error: SkinCalibError) -> str:
    """Return the message of an error in words of the window.

    A button there finds the frame that a plan file needs, and lengths are in millimetres.
    """
    finding = error.numbers.get("finding")
    proposal = json.dumps(finding.value) if finding else ""
    words = str(error).replace(f'give it "frame": {proposal}', "press Find Frame")
    return words.replace("in metres in the link frame", "in the link frame")


def fix_pose(skin: Any, taxels: TaxelArray, metre: float) -> None:
    """Give a skin the origin and direction that it has now; boards that fill become all that fit from there."""
    i = root_row(taxels)
    is_free = skin.kind == "hexagons" and skin.choice == "fill"
    if is_free or skin.centred and not skin.landmarks:
        skin.origin, skin.centred = in_units(taxels.positions_link[i], metre), False
    skin.direction, skin.auto_direction = taxels.tangents_link[i], False
    if is_free:
        skin.choice = "all"


def list_boards(skin: Any, taxels: TaxelArray, metre: float) -> None:
    """Give boards that fill a surface the pose and the cells that they have now; listed boards stay."""
    if skin.choice != "listed":
        fix_pose(skin, taxels, metre)
        skin.choice, skin.cells = "listed", fields.written_cells(taxels.index.tolist())


def single_taxel(skin: Any, name: str) -> Any:
    """Return what a skin has about one of its taxels; a new entry if it has none."""
    found = next((single for single in skin.taxels if single.taxel == name), None)
    if found is None:
        found = skin.taxels.add()
        found.taxel = name
    return found


def drop_usual(plan: Any) -> None:
    """Remove the single taxels of a plan that do not differ from the others."""
    for skin in plan.skins:
        for k in reversed(range(len(skin.taxels))):
            if skin.taxels[k].enabled and skin.taxels[k].auto_channel:
                skin.taxels.remove(k)


def root_row(taxels: TaxelArray) -> int:
    """Return the row of the cell at the origin, or of the nearest cell where that one was left out."""
    return int(np.argmin(np.abs(taxels.index).sum(axis=1)))


def of_kind(plan: Any, index: int, kind: str, what: str) -> Any:
    """Return a skin of a plan, which must be of the kind that has such things."""
    skin = entry(plan.skins, index, "skin")
    if skin.kind != kind:
        label = next(choice.label for choice in SKIN_KINDS if choice.value == kind)
        raise SkinCalibError(
            f"Skin {skin.name!r} has no {what}, which belong to Kind: {label}. Choose such a skin, or add one."
        )
    return skin


def entry(entries: Any, index: int, what: str) -> Any:
    """Return one entry of a list of the plan."""
    if not 0 <= index < len(entries):
        raise SkinCalibError(f"There is no {what} {index}; there are {len(entries)}, counted from 0.")
    return entries[index]
