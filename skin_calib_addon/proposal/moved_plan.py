"""The plan of a link for another one that is its mirror image, or equal to it."""

from dataclasses import replace

import numpy as np

from ..common.arrays import Array
from ..common.errors import InvalidPlan
from ..common.warnings import point_of
from ..geometry.grid.axis import Axis
from ..geometry.grid.grids import Across, PlanesGrid, Region, Sector, Tube, Vector, sector_frame
from ..geometry.mesh.cover import Cut
from ..plan.document import without_axis_point
from ..plan.plan import Plan, Surface
from ..plan.skins import ImportedSkin, SheetSkin, Skin
from ..robot.mirrored import Twin
from ..skin.boards.layout import Cell
from .candidates import DECIMALS


def moved_plan(plan: Plan, link: str, twin: Twin) -> Plan:
    """Return the plan of a link, moved or reflected to its twin: surfaces, boundaries and skins with all cells.

    Raise InvalidPlan where it has planes placed by hand, a sector about an axis that is not known, or taxels of a file.
    """
    surfaces = tuple(_moved_surface(surface, twin) for surface in plan.surfaces)
    return replace(plan, link=link, surfaces=surfaces, skins=tuple(_moved_skin(skin, twin) for skin in plan.skins))


def _moved_surface(surface: Surface, twin: Twin) -> Surface:
    if isinstance(surface.grid, PlanesGrid):
        raise InvalidPlan(f"{surface.name} has planes placed by hand, which have no copy. Choose another kind of grid.")
    if isinstance(surface.grid.region, Sector) and surface.grid.region.axis is None:
        raise InvalidPlan(f"{surface.name} is a sector about an automatic axis, which has no copy. State its axis.")
    grid = replace(surface.grid, region=moved_region(surface.grid.region, twin))
    cuts = tuple(Cut(_point(cut.point, twin), _direction(cut.normal, twin)) for cut in surface.cover.cuts)
    return replace(surface, cover=replace(surface.cover, cuts=cuts), grid=without_axis_point(grid))


def moved_region(region: Region, twin: Twin) -> Region:
    """Return a region on the twin of its link."""
    axis = None
    if region.axis is not None:
        axis = Axis(_point(region.axis.point, twin), _direction(region.axis.direction, twin))
    loops = tuple(tuple(_point(corner, twin) for corner in loop) for loop in region.boundary)
    if isinstance(region, Across):
        return replace(region, axis=axis, boundary=loops, normal=_direction(region.normal, twin))
    if isinstance(region, Sector):
        assert region.axis is not None and axis is not None
        # Angles are counter-clockwise: of a mirror image, the last ray becomes the first one.
        first = region.stop if twin.is_mirrored else region.start
        ray = sector_frame(region.axis).rays(np.array([first]))[0]
        x, y = sector_frame(axis).across(twin.transform[:3, :3] @ ray)
        start = round(float(np.arctan2(y, x)), DECIMALS)
        stop = round(start + region.stop - region.start, DECIMALS)
        return replace(region, axis=axis, boundary=loops, start=start, stop=stop)
    assert isinstance(region, Tube)
    return replace(region, axis=axis, boundary=loops)


def _moved_skin(skin: Skin, twin: Twin) -> Skin:
    if isinstance(skin, ImportedSkin):
        raise InvalidPlan(f"{skin.name} has the taxels of a file, which have no copy. Remove it, or copy by hand.")
    if skin.registration is not None and skin.registration.anchor is not None:
        skin = replace(skin, registration=skin.registration._replace(anchor=_point(skin.registration.anchor, twin)))
    skin = replace(skin, touches=None)  # nobody touched the copy
    origin = None if skin.origin is None else _point(skin.origin, twin)
    if isinstance(skin, SheetSkin):
        hand = skin.lattice.hand
        if twin.is_mirrored:
            hand = "left" if hand == "right" else "right"
        marks = tuple(replace(mark, point=_point(mark.point, twin)) for mark in skin.landmarks)
        lattice, direction = replace(skin.lattice, hand=hand), _direction(skin.direction, twin)
        return replace(skin, origin=origin, direction=direction, lattice=lattice, landmarks=marks)
    along = None if skin.direction is None else _direction(skin.direction, twin)
    choice, taxels = skin.choice, skin.taxels
    if twin.is_mirrored:
        # The lattice, reflected about its row. Along the lines of the surface, the row has the other direction.
        sign = 1 if skin.direction else -1
        choice = choice if isinstance(choice, str) else tuple(_reflected(cell, sign) for cell in choice)
        cells = (map(int, single.taxel.split(".")) for single in taxels)
        names = (f"{sign * (q + r)}.{-sign * r}" for q, r in cells)
        taxels = tuple(single._replace(taxel=name) for single, name in zip(taxels, names))
    excluded = tuple(replace(zone, point=_point(zone.point, twin)) for zone in skin.excluded)
    return replace(skin, origin=origin, direction=along, choice=choice, taxels=taxels, excluded=excluded)


def _reflected(cell: Cell, sign: int) -> Cell:
    """Return a board of a list, reflected about the row of the root; the sign is minus one for the other direction."""
    q, r, *shifted = cell
    if not shifted:
        return sign * (q + r), -sign * r
    x, y, turn = shifted
    return sign * (q + r), -sign * r, sign * x, -sign * y, -turn


def _point(point: Vector, twin: Twin) -> Vector:
    return _rounded(twin.transform[:3, :3] @ point + twin.transform[:3, 3])


def _direction(direction: Vector, twin: Twin) -> Vector:
    return _rounded(twin.transform[:3, :3] @ direction)


def _rounded(vector: Array) -> Vector:
    return point_of(np.round(vector, DECIMALS) + 0.0)
