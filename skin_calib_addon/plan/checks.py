"""What the members of a plan must be together, where each of them is right alone."""

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np

from ..calibration.parts import sound_items
from ..common.arrays import MIN_DIRECTION_LENGTH, is_covariance
from ..common.errors import InvalidPlan, SkinCalibError, listed
from ..common.findings import Finding, child, did_you_mean, error
from ..geometry.grid.grids import Across, Grid, PlanesGrid
from ..skin.boards.layout import Cell
from ..skin.imported import not_a_rotation
from .plan import Plan
from .skins import BoardSkin, ImportedSkin, SheetSkin, Skin, first_channels


def check_together(plan: Plan) -> None:
    """Refuse a plan whose members contradict each other."""
    if plan.mesh.suffix.lower() == ".urdf" and plan.unit != "m":
        raise InvalidPlan('The mesh is a URDF, which is in metres. Set "unit" to "m".')
    names = [surface.name for surface in plan.surfaces]
    for surface in plan.surfaces:
        if names.count(surface.name) > 1:
            raise InvalidPlan(f"Two surfaces have the name {surface.name!r}. Rename one.")
        with naming_surface(plan, surface.name):
            for i, cut in enumerate(surface.cover.cuts):
                check_direction(cut.normal, f"The normal of cut {i} is zero. Give the direction of the side to keep.")
            check_grid(surface.grid)
    for skin in plan.skins:
        if plan.surface_of(skin) not in names:
            near = did_you_mean(plan.surface_of(skin), names) or f". It has {listed(names)}."
            raise InvalidPlan(
                f"Skin {skin.name!r} is on surface {skin.surface!r}, which the plan does not have{near}", skin=skin.name
            )
    check_skins(plan.skins)


@contextmanager
def naming_surface(plan: Plan, name: str) -> Iterator[None]:
    """Add the name of a surface to the errors about it, if the plan has several."""
    try:
        yield
    except SkinCalibError as error:
        if len(plan.surfaces) > 1:
            error.args = (f"Surface {name!r}: {error}",)
            error.numbers["surface"] = name
        raise


@contextmanager
def about_skin(name: str) -> Iterator[None]:
    """Keep the name of a skin with the errors about it."""
    try:
        yield
    except SkinCalibError as error:
        error.numbers["skin"] = name
        raise


@contextmanager
def naming_skin(plan: Plan, skin: Skin) -> Iterator[None]:
    """Add the name of a skin to the errors about it, and that of its surface if the plan has several."""
    try:
        yield
    except SkinCalibError as error:
        words, surface = f"Skin {skin.name!r}", plan.surface_of(skin)
        error.numbers["skin"] = skin.name
        if len(plan.surfaces) > 1:
            words += f" on surface {surface!r}"
            error.numbers["surface"] = surface
        elif repr(skin.name) in str(error):
            raise
        error.args = (f"{words}: {error}",)
        raise


def check_grid(grid: Grid | PlanesGrid) -> None:
    """Refuse a grid with a direction of no length."""
    if isinstance(grid, PlanesGrid):
        for family, planes in (("u", grid.u), ("v", grid.v)):
            for i, normal in enumerate(planes.directions):
                check_direction(normal, f"The normal of {family}-plane {i} is zero. Give its direction.")
        return
    if grid.region.axis is not None:
        message = "The direction of the axis is zero. Give the direction along the link."
        check_direction(grid.region.axis.direction, message)
    if isinstance(grid.region, Across):
        check_direction(grid.region.normal, "The outward normal of the grid is zero. Give the side that is covered.")


def check_skins(skins: tuple[Skin, ...]) -> None:
    """Refuse skins with the same name or channel, and skins that contradict themselves."""
    for i, skin in enumerate(skins):
        with about_skin(skin.name):
            if skin.name in {other.name for other in skins[:i]}:
                raise InvalidPlan(f"Two skins have the name {skin.name!r}. Rename one.")
            check_alone(skin)
    first_channels(skins, [skin.count for skin in skins])


def check_alone(skin: Skin) -> None:
    """Refuse a skin that contradicts itself."""
    name = skin.name
    if isinstance(skin, SheetSkin | BoardSkin) and skin.direction is not None:
        check_direction(skin.direction, f"The direction of skin {name!r} is zero. Give the direction of its rows.")
    if isinstance(skin, SheetSkin):
        check_landmarks(skin)
    if isinstance(skin, BoardSkin) and isinstance(skin.choice, tuple):
        check_boards(name, skin.choice)
    check_single_taxels(skin)
    if skin.touches is not None and not is_covariance(np.array(skin.touches.touched.covariance)):
        raise InvalidPlan(
            f"The touches of skin {name!r} have no valid covariance. Remove them, and touch the skin again."
        )


def check_boards(name: str, boards: Sequence[Cell]) -> None:
    """Refuse a list that has a board twice, or numbers that say nothing."""
    if len({board[:2] for board in boards}) < len(boards):
        raise InvalidPlan(f"Skin {name!r} lists a cell twice. List each board once.")
    for board in boards:
        if len(board) not in (2, 5):
            raise InvalidPlan(
                f"Skin {name!r} has a board of {len(board)} numbers, {list(board)}. Give q and r, or q, r, x, y, turn."
            )


def check_single_taxels(skin: Skin) -> None:
    """Refuse single taxels that are named twice, that the skin does not have, or that another fit would number anew."""
    names = [single.taxel for single in skin.taxels]
    twice = [name for name, k in Counter(names).items() if k > 1]
    if twice:
        raise InvalidPlan(f"Skin {skin.name!r} has the single taxel {twice[0]!r} twice. Remove one.")
    if not names or isinstance(skin, ImportedSkin):  # the file has the ids of imported taxels
        return
    known = dict.fromkeys(f"{i}.{j}" for i, j in _cells(skin))
    for name in names:
        if name not in known:
            near = did_you_mean(name, known) or "."
            raise InvalidPlan(
                f"Skin {skin.name!r} has no taxel {name!r}{near} Ids are row.column, or q.r of a board. Remove it from "
                "the single taxels."
            )


def _cells(skin: SheetSkin | BoardSkin) -> Iterable[tuple[int, int]]:
    """Return the cells that a skin has wherever it is; an error about boards that are not listed."""
    if isinstance(skin, SheetSkin):
        return map(tuple, skin.lattice.index.tolist())
    if isinstance(skin.choice, str):
        raise InvalidPlan(
            f"Skin {skin.name!r} has single taxels, but boards that are not listed have other numbers on another "
            "surface. List its boards one by one."
        )
    return ((q, r) for q, r, *_ in skin.choice)


def check_landmarks(skin: SheetSkin) -> None:
    """Refuse landmarks of cells that the sheet does not have."""
    rows, columns = skin.lattice.rows, skin.lattice.columns
    for landmark in skin.landmarks:
        if landmark.cell[0] >= rows or landmark.cell[1] >= columns:
            raise InvalidPlan(
                f"Skin {skin.name!r} has a landmark at cell {list(landmark.cell)}, but the sheet has {rows} "
                f"x {columns} cells, counted from 0."
            )


def frames_are_rotations(document: Any, findings: Iterable[Finding]) -> Iterator[Finding]:
    """Yield an error for each frame of imported taxels that mirrors, scales or shears."""
    for pointer, skin in sound_items(document, "skins", findings):
        if "frame" in skin:
            rotation = skin["frame"]["rotation"]
            if problem := not_a_rotation(np.array(rotation, float)):
                message = f"is not a rotation: it {problem}"
                yield error("rotation", child(pointer, "frame", "rotation"), message, rotation)


def check_direction(vector: Any, message: str) -> None:
    """Refuse a direction of no length with a message."""
    if np.linalg.norm(vector) < MIN_DIRECTION_LENGTH:
        raise InvalidPlan(message)
