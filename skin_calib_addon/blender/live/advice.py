# SPDX-License-Identifier: GPL-3.0-or-later
"""What the window offers for each warning: the operator that does what its advice says, in one table."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from math import ceil
from typing import Any

import bpy

from ...common.warnings import Warning
from ...plan.document import grid_kind
from ..scene.plans import other_surface, shown_index, surface_names
from ..scene.warnings import read_warning
from ..session import session
from . import updates

Properties = dict[str, Any] | None  # of an operator; None: it does not apply
# Plan or key of the fit that has the warning, code and place of the warning, and change.
Trial = tuple[str, str, tuple[float, ...] | None, str]
REFUSAL = -1  # index of the refusal of the last fit, among the warnings of the result


@dataclass(frozen=True)
class Action:
    """An operator that does what a warning advises."""

    operator: str
    text: str
    properties: Callable[[Warning, "Subject", float], Properties]  # of warning, subject, metre
    change: str = ""  # of `pipeline.remedies`, which is tried first; empty: it helps always


@dataclass(frozen=True)
class Subject:
    """The surface of a warning, whether the panels show it or not, and the skins of the link."""

    kind: str  # of the grid
    region: str  # of a grid by tolerance
    shell: str
    skins: Any
    is_alone: bool  # whether it is the only surface
    is_proposed: bool  # whether the plan of the link is a proposal

    @classmethod
    def of(cls, warning: Warning, plan: Any) -> "Subject":
        """Return the surface that a warning names, or the one that the panels show."""
        index, common = hidden_surface(warning, plan), (plan.skins, len(surface_names(plan)) == 1, bool(plan.proposed))
        if index is None:
            return cls(plan.grid.kind, plan.grid.region, plan.cover.shell, *common)
        surface = other_surface(plan, index)
        return cls(*grid_kind(surface.grid), surface.cover.shell, *common)


def hidden_surface(warning: Warning, plan: Any) -> int | None:
    """Return the index of the surface that a warning names; None if the panels show it, or it names none."""
    names = surface_names(plan)
    index = names.index(warning.where.surface) if warning.where.surface in names else None
    return None if index == shown_index(plan) else index


def _setting(path: str, value: Any) -> dict[str, Any]:
    """Return what sets a property of the plan to a value."""
    return {"data_path": f"object.skin_calib.{path}", "value": value}


def _cut(warning: Warning, _on: Subject, metre: float) -> Properties:
    """Return the point of a cut at the place of a warning."""
    return {"point": [x / metre for x in warning.where.point]} if warning.where.point else None


def _sector(_warning: Warning, on: Subject, _metre: float) -> Properties:
    """Return what makes the grid of a tube that of a sector."""
    name = "region" if on.kind == "auto" else "kind"
    return _setting(f"grid.{name}", "sector") if getattr(on, name) == "tube" else None


def _seen(_warning: Warning, on: Subject, _metre: float) -> Properties:
    """Return what keeps only faces that are seen from outside."""
    return None if on.shell == "seen" else _setting("cover.shell", "seen")


def _outer(_warning: Warning, on: Subject, _metre: float) -> Properties:
    """Return what keeps only the outer shell."""
    return _setting("cover.shell", "outer") if on.shell == "all" else None


def _tolerance(warning: Warning, on: Subject, metre: float) -> Properties:
    """Return what sets the tolerance to the best achievable error."""
    return _setting("grid.tolerance", warning.value / metre) if warning.value and on.kind == "auto" else None


def _margin(_warning: Warning, on: Subject, _metre: float) -> Properties:
    """Return that a tube, sector or face has a margin and an axis."""
    return None if on.kind == "planes" else {}


def _skin_of(warning: Warning, on: Subject, kind: str) -> tuple[int, Any] | None:
    """Return the index of the skin of a warning, and the skin; None without one of this kind."""
    found = ((i, skin) for i, skin in enumerate(on.skins) if skin.name == warning.where.skin)
    return next((pair for pair in found if pair[1].kind == kind), None)


def _fewer(warning: Warning, on: Subject, metre: float) -> Properties:
    """Return what removes the columns, or rows, that overlap."""
    found = _skin_of(warning, on, "sheet")
    if found is None or not warning.value:
        return None
    i, skin = found
    name, pitch = ("columns", skin.pitch[1]) if warning.where.names.startswith("row") else ("rows", skin.pitch[0])
    count = getattr(skin, name) - ceil(warning.value / (pitch * metre))
    return _setting(f"skins[{i}].{name}", count) if count >= 1 else None


def _trim(warning: Warning, on: Subject, _metre: float) -> Properties:
    """Return what leaves out the cells of a sheet that are off the surface."""
    found = _skin_of(warning, on, "sheet")
    return _setting(f"skins[{found[0]}].trim", True) if found and not found[1].trim else None


def _paint(warning: Warning, on: Subject, _metre: float) -> Properties:
    """Return the boards to be painted."""
    found = _skin_of(warning, on, "hexagons")
    return {"skin": found[0]} if found else None


def _across(warning: Warning, _on: Subject, _metre: float) -> Properties:
    """Return the outward normal of the face that a refusal proposes."""
    return {"normal": warning.where.normal} if warning.where.normal else None


def _propose(warning: Warning, on: Subject, _metre: float) -> Properties:
    """Return that a refused link gets a proposal, if it has none."""
    return {} if warning.severity == "error" and on.is_alone and not on.is_proposed else None


CUT = Action("skin_calib.cut_add", "Cut Here", _cut, "cut")
SECTOR = Action("wm.context_set_enum", "Use a Sector", _sector, "sector")
MARGIN = Action("skin_calib.margin_widen", "Widen the Margin", _margin, "margin")
SEEN = Action("wm.context_set_enum", "Keep What Is Seen", _seen, "seen")
PROPOSE = Action("skin_calib.propose", "Propose", _propose)
AXIS = Action("skin_calib.axis_from_sections", "Pick the Axis", _margin)
HOLES = Action("skin_calib.show_defects", "Select Holes", lambda *_: {})
TRIM = Action("wm.context_set_boolean", "Trim the Sheet", _trim)
PAINT = Action("skin_calib.boards_paint", "Paint Boards", _paint)
ACROSS = Action("skin_calib.grid_across", "Use Across", _across)

# By the code of a warning, or the class of an error: the actions, of which the first that applies is offered.
# Others have none: only the author can decide, or nothing is to be done. docs/troubleshooting.md explains the codes.
ACTIONS: dict[str, tuple[Action, ...]] = {
    "outdated-proposal": (Action("skin_calib.propose", "Propose Again", lambda *_: {}),),
    "off-mesh": (CUT, SEEN, SECTOR, PROPOSE),
    "folded": (SECTOR, CUT, PROPOSE),
    "nearly-folded": (MARGIN, CUT, SECTOR),
    "missing-samples": (HOLES,),
    "outside-outline": (MARGIN,),
    "dropped-curves": (SEEN,),
    "not-converged": (AXIS,),
    "undercut": (CUT, SECTOR),
    "inner-part": (SEEN,),
    "chords-refused": (Action("wm.context_set_boolean", "Follow the Facets", lambda *_: _setting("chords", False)),),
    "overlap": (Action("wm.context_set_int", "Fewer Cells", _fewer),),
    "over-hole": (TRIM,),
    "board-gap": (PAINT,),
    "board-overhang": (PAINT,),
    "EmptySection": (SECTOR, MARGIN, PROPOSE),
    "OutsideSurface": (TRIM,),
    "UnreachableTolerance": (Action("wm.context_set_float", "Allow This Error", _tolerance),),
    "InvalidPlan": (ACROSS,),  # of a thin sheet; otherwise the message names the field that is wrong
    "parts": (Action("wm.context_set_enum", "Keep Outer Shell", _outer),),
    "holes": (HOLES,),
    "branching-edges": (Action("skin_calib.show_defects", "Select Edges", lambda *_: {}),),
}


def offered(warning: Warning, plan: Any, metre: float) -> Iterator[tuple[Action, dict[str, Any]]]:
    """Yield the actions that apply to a warning now, each with the properties of its operator.

    A plan without skins has nothing that a proposal would discard: it is offered first.
    """
    if warning.where.surface not in ("", *surface_names(plan)):
        return  # renamed or removed after the fit
    on = Subject.of(warning, plan)
    actions = ACTIONS.get(warning.code, ())
    for action in actions if len(on.skins) else sorted(actions, key=lambda action: action is not PROPOSE):
        properties = action.properties(warning, on, metre)
        if properties is not None and _trial(plan.id_data, warning, action) not in session.of(plan.id_data).in_vain:
            yield action, properties


def is_of_the_fit(warning: Warning) -> bool:
    """Return whether a refusal is one of the surface, which other planes or cuts can mend."""
    return PROPOSE in ACTIONS.get(warning.code, ()) or warning.code in ("UnderdeterminedFit", "UnreachableTolerance")


def give_up(link: bpy.types.Object, warning: Warning, action: Action) -> None:
    """Do not offer an action for a warning any more: it was tried, and does not help."""
    session.of(link).in_vain.add(_trial(link, warning, action))


def _trial(link: bpy.types.Object, warning: Warning, action: Action) -> Trial:
    return updates.of_warnings(link), warning.code, warning.where.point, action.change


def shown_warnings(link: bpy.types.Object) -> list[Warning]:
    """Return what the state of a link shows: the refusal of its last fit, or the warnings of its result."""
    report = session.of(link).report
    if report and report.refusal:
        return [report.refusal]
    return [read_warning(record) for record in link.skin_calib.result.warnings]


def mark_of(warning: Warning) -> str:
    """Return the name under which the mark of a warning is cached, and kept by a link that shows it."""
    return f"place {warning.where.point}"


def warning_at(link: bpy.types.Object, index: int) -> Warning | None:
    """Return the refusal of a link's last fit, or a warning of its result."""
    if index == REFUSAL:
        report = session.of(link).report
        return report.refusal if report else None
    records = link.skin_calib.result.warnings
    return read_warning(records[index]) if index < len(records) else None
