"""Propose the plan of one link."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import islice
from pathlib import Path

import numpy as np

from ..calibration.exchange.xml_text import rotations
from ..calibration.model import TaxelArray
from ..common.arrays import Array, BoolArray
from ..common.errors import SkinCalibError, counted, millimetres
from ..geometry.fit.surface_fit import SurfaceFit
from ..geometry.grid.axis import Axis
from ..geometry.mesh.cover import cut_cover, seen_faces
from ..geometry.mesh.triangle_mesh import TriangleMesh
from ..pipeline.place_skins import place_skin
from ..plan.plan import Plan
from ..plan.skins import BoardSkin, SheetSkin
from ..robot.keep_out import KeepOut
from ..robot.mirrored import Twin
from ..robot.urdf import Robot
from ..robot.zones import load_zones
from .boards import boards_of_list, usable, with_cells
from .candidates import axis_of
from .chains import cable_length, chains_of, without_short_chains
from .link_points import LinkPoints
from .moved_plan import moved_plan
from .one_skin import LinkSurfaces
from .skins import SkinChoice, apart, skin_on, without_cells
from .surfaces import Proposed, fitted, least_area, propose_surfaces

# [fraction] of the boards of a mirrored link, on each surface, and of its free area and cells, that a link must have to
# get its layout. Larger: more left and right links have layouts of their own.
MIN_TWIN_FRACTION = 0.9
MIN_BARE_AREA = 30e-4  # [m^2] of a piece of the free area without skin that is named. Larger: fewer are
MAX_COVERERS = 3  # other links that are named. Larger: longer sentences


@dataclass(frozen=True, eq=False)
class Proposal:
    """The plan of a link with its reasons, or why it has none."""

    link: str
    plan: Plan | None
    reasons: tuple[str, ...]  # one for each choice, or the refusal
    seen: float = 0.0  # area that can be seen from outside [m^2]
    free: float = 0.0  # of it, area that is open, and that no other link covers [m^2]
    cells: float = 0.0  # area of the cells of the skins on it [m^2]
    taxels: int = 0
    chains: int = 0  # of boards that their ports connect
    singles: int = 0  # of them, of one board
    longest: int = 0  # boards of the longest chain
    cables: float = 0.0  # straight, between the chains [m]
    fits: Mapping[str, SurfaceFit] = field(default_factory=dict, repr=False)  # of its surfaces, by their names
    warnings: tuple[str, ...] = ()  # what can be wrong with it; also among the reasons of the plan
    bare: str = ""  # the largest piece of the free area without skin, if it is large: place and reason; also a reason
    mirror: "Proposal | str" = field(default="", repr=False)  # of its mirror image, or why that has another layout

    @property
    def channels(self) -> int:
        """Return the number of channels; a trimmed sheet has channels without taxels."""
        return 0 if self.plan is None else sum(skin.count or 0 for skin in self.plan.skins)

    def without_fits(self) -> "Proposal":
        """Return the proposal without what is large."""
        mirror = self.mirror if isinstance(self.mirror, str) else replace(self.mirror, fits={})
        return replace(self, fits={}, mirror=mirror)

    def with_warnings(self, warnings: tuple[str, ...]) -> "Proposal":
        """Return the proposal with warnings, which its plan states first; one without a plan as it is."""
        return replace(self.with_reasons(warnings), warnings=warnings) if self.plan else self

    def with_reasons(self, reasons: tuple[str, ...]) -> "Proposal":
        """Return the proposal with more reasons, which its plan states first; one without a plan as it is."""
        if self.plan is None or not reasons:
            return self
        reasons = (*reasons, *self.reasons)
        return replace(self, plan=replace(self.plan, extra={"x_proposal": list(reasons)}), reasons=reasons)


def propose_link(
    link: str,
    mesh: TriangleMesh,
    file: Path,
    unit: str,
    choice: SkinChoice,
    axes: tuple[tuple[Axis, str], ...] = (),
    keep_out: KeepOut | None = None,
    begin: Callable[[str], None] = lambda stage: None,
    mirror: tuple[str, Twin] | None = None,
) -> Proposal:
    """Propose surfaces and skins for one link, and the same layout for its mirror image, if it has one.

    Both keep only what fits on both, as long as that is nearly all.
    """
    target = _Target.of(link, mesh, file, unit, keep_out, begin)
    if target.free <= choice.least_area:
        words = (
            f"{target.free * 1e4:.0f} cm^2 are free, and {choice.text} needs {choice.least_area * 1e4:.0f}: no skin."
        )
        return Proposal(link, None, (target.sentence, words + target.why_covered), target.on.seen, target.free)
    found = propose_surfaces(seen_faces(mesh), target.on, axes, begin, choice.cell)
    proposal = target.proposal(
        found, lambda proposed: skin_on(choice, proposed.fit, proposed.surface.name), choice, begin
    )
    if proposal.plan is None or keep_out is None or mirror is None:
        return proposal
    other, twin = mirror
    there = propose_twin(proposal, twin, other, keep_out.meshes[other], file, choice, keep_out, begin)
    if isinstance(there, str):
        return replace(proposal, mirror=there)
    words = f"{other} has the mirrored layout."
    if lost := proposal.taxels - there.taxels:
        proposal = target.reduced(found, proposal, there, twin.inverse(link), choice, begin)
        words = f"{words[:-1]}, for which {counted(lost, 'taxel')} {'is' if lost == 1 else 'are'} left out here."
    return replace(proposal.with_reasons((words,)), mirror=there)


def link_surfaces(
    link: str,
    mesh: TriangleMesh,
    file: Path,
    unit: str,
    axes: tuple[tuple[Axis, str], ...] = (),
    keep_out: KeepOut | None = None,
) -> LinkSurfaces:
    """Return the surfaces of a link, of any area, without skins."""
    target = _Target.of(link, mesh, file, unit, keep_out, lambda stage: None)
    found = propose_surfaces(seen_faces(mesh), target.on, axes)
    return LinkSurfaces(link, file, unit, mesh, target.on, found, axes, target.sentence + target.why_covered)


def propose_twin(
    former: Proposal,
    twin: Twin,
    link: str,
    mesh: TriangleMesh,
    file: Path,
    choice: SkinChoice,
    keep_out: KeepOut,
    begin: Callable[[str], None] = lambda stage: None,
) -> Proposal | str:
    """Return the proposal of a link for its mirror image, or for an equal link; or why it does not fit there.

    The surfaces are fitted to the mesh of the twin. Boards that do not fit there, or that other links cover, are left
    out.
    """
    target = _Target.of(link, mesh, file, "m", keep_out, begin)
    if abs(target.free - former.free) > (1 - MIN_TWIN_FRACTION) * former.free:
        return f"{target.free * 1e4:.0f} instead of {former.free * 1e4:.0f} cm^2 are free"
    assert former.plan is not None
    moved, how = moved_plan(former.plan, link, twin), f"as on {former.link}"
    skins = {skin.surface: skin for skin in moved.skins}

    off = 0  # boards that do not fit on the surface and the mesh

    def skin_of(proposed: Proposed) -> tuple[SheetSkin | BoardSkin, TaxelArray]:
        nonlocal off
        skin = skins[proposed.surface.name]
        if isinstance(skin, BoardSkin):
            off += len(skin.choice)
            boards, taxels = boards_of_list(skin, proposed.fit)
            off -= len(boards.choice)
            return boards, taxels
        assert isinstance(skin, SheetSkin)
        return skin, place_skin(skin, proposed.fit, 0).patch.taxels

    try:
        tried = (fitted(cut_cover(mesh, surface.cover), target.on, surface, how) for surface in moved.surfaces)
        found = tuple(filter(None, tried))
        begin("skins")
        proposal = target.proposal(found, skin_of, choice, begin)
    except SkinCalibError as problem:
        return f"a surface does not fit: {problem}".rstrip(".")
    if proposal.plan is None or proposal.cells < MIN_TWIN_FRACTION * former.cells:
        return f"only {proposal.taxels} of {counted(former.taxels, 'taxel')} fit"
    words = f"The link is {twin.words} {former.link}, and has its layout"
    if lost := former.taxels - proposal.taxels:
        others = f"; hidden, covered, or left in a short chain: {lost - off}" if lost > off else ""
        words += f", without {counted(lost, 'taxel')} of it. Over an edge or off the mesh here: {off}{others}"
    return proposal.with_reasons((f"{words}.",))


@dataclass(frozen=True, eq=False)
class _Target:
    """A link that gets a proposal."""

    link: str
    mesh: TriangleMesh
    file: Path
    unit: str
    on: LinkPoints
    by_coverer: Mapping[str, float]  # area [m^2] that each other link covers, by its name, the largest first

    @classmethod
    def of(
        cls,
        link: str,
        mesh: TriangleMesh,
        file: Path,
        unit: str,
        keep_out: KeepOut | None,
        begin: Callable[[str], None],
    ) -> "_Target":
        """Find what of a link can be seen, and what of that is free."""
        begin("outside")
        on = LinkPoints.of(mesh)
        coverers = np.full(len(on.points), "", object)
        if keep_out is not None:
            begin("other links")
            coverers = keep_out.coverers(link, on.points, on.normals)
        for zone in load_zones(file, link):
            coverers[zone.contains(on.points)] = f"the zone {zone.name}"
        by_coverer = {name: float(on.areas[coverers == name].sum()) for name in {*coverers} - {""}}
        on = replace(on, free=coverers == "")
        return cls(link, mesh, file, unit, on, dict(sorted(by_coverer.items(), key=lambda item: (-item[1], item[0]))))

    @property
    def free(self) -> float:
        """Return the area of it that is open, and that no other link covers [m^2]."""
        return float(self.on.areas[self.on.free].sum())

    @property
    def sentence(self) -> str:
        """Return both areas in words."""
        seen, free = self.on.seen * 1e4, self.free * 1e4
        return f"{seen:.0f} cm^2 can be seen from outside, {free:.0f} cm^2 of them are open and free of other links."

    @property
    def why_covered(self) -> str:
        """Return what covers most of the link, as a sentence after others; empty if more of it is free than covered."""
        if sum(self.by_coverer.values()) <= self.free:
            return ""
        most = (f"{name} {area * 1e4:.0f} cm^2" for name, area in islice(self.by_coverer.items(), MAX_COVERERS))
        return f" Others cover it somewhere in the ranges of the joints: {', '.join(most)}."

    def proposal(
        self,
        found: Sequence[Proposed],
        skin_of: Callable[[Proposed], tuple[SheetSkin | BoardSkin, TaxelArray]],
        choice: SkinChoice,
        begin: Callable[[str], None],
    ) -> Proposal:
        """Return the proposal with skins on surfaces, without boards that conflict."""
        placed, reasons = [], [self.sentence + self.why_covered]
        problems: dict[str, str] = {}  # by the names of the surfaces
        for k, proposed in enumerate(found, 1):
            begin(f"skin {k} of {len(found)}")
            try:
                placed.append((proposed, *skin_of(proposed)))
            except SkinCalibError as problem:
                problems[proposed.surface.name] = str(problem)
                reasons.append(_left_out(proposed, str(problem)))
        surfaces, skins, taxels, cells, covered = [], [], 0, 0.0, np.zeros(len(self.on.points), bool)
        fits: dict[str, SurfaceFit] = {}
        chains: list[Array] = []
        for proposed, skin, kept, own in _without_conflicts(self.mesh, self.on, placed, choice.chain):
            if not kept.any():
                problems[proposed.surface.name] = "its cells are hidden, over those of others, or in short chains"
                reasons.append(_left_out(proposed, problems[proposed.surface.name]))
                continue
            surfaces.append(proposed.surface)
            fits[proposed.surface.name] = proposed.fit
            skins.append(replace(skin, name=f"{self.link}_{len(surfaces)}"))  # ids are unique on the robot
            taxels += int(kept.sum())
            cells += float(own.areas[kept].sum())
            if isinstance(skin, BoardSkin):
                number = chains_of(own, kept)
                chains += [own.positions_link[kept][number == k] for k in range(number.max() + 1)]
            covered |= proposed.covered
            reasons.append(
                f"{proposed.surface.name}: {proposed.reason}, adds {proposed.area * 1e4:.0f} cm^2; "
                f"{counted(int(kept.sum()), 'taxel')} of {choice.text}."
            )
        if not surfaces:
            least = least_area(choice.cell) * 1e4
            words = f"No surface of at least {least:.2g} cm^2 is within 1 mm and 15 degrees of the mesh: no skin."
            if found:
                largest = max(found, key=lambda proposed: proposed.area)
                where = f"{counted(len(found), 'surface')} of up to {largest.area * 1e4:.0f} cm^2"
                words = f"No skin fits on {where}. The largest: {problems[largest.surface.name]}"
            return Proposal(self.link, None, (*reasons, words), self.on.seen, self.free)
        if bare := self._bare(covered, found, problems, least_area(choice.cell)):
            reasons.append(bare)
        singles, cables = sum(len(chain) == 1 for chain in chains), cable_length(chains)
        if chains:
            cable = f"about {cables * 1e2:.0f} cm of straight cable between them"
            reasons.append(f"{counted(len(chains), 'chain')} of boards, {singles} of one board: {cable}.")
        reasons.append(f"Cells cover {cells * 1e4:.0f} cm^2 of the free area, {cells / self.free:.0%} of it.")
        plan = Plan(self.link, self.file, self.unit, tuple(surfaces), tuple(skins), extra={"x_proposal": reasons})
        return Proposal(
            self.link,
            plan,
            tuple(reasons),
            self.on.seen,
            self.free,
            cells,
            taxels,
            chains=len(chains),
            singles=singles,
            longest=max(map(len, chains), default=0),
            cables=cables,
            fits=fits,
            bare=bare,
        )

    def reduced(
        self,
        found: Sequence[Proposed],
        proposal: Proposal,
        there: Proposal,
        back: Twin,
        choice: SkinChoice,
        begin: Callable[[str], None],
    ) -> Proposal:
        """Return the proposal with those boards and cells that it has on a twin, too; ``back`` leads from there."""
        assert proposal.plan is not None and there.plan is not None
        kept = {skin.surface: skin for skin in moved_plan(there.plan, self.link, back).skins}
        skins = {skin.surface: skin for skin in proposal.plan.skins}

        def skin_of(proposed: Proposed) -> tuple[SheetSkin | BoardSkin, TaxelArray]:
            skin, some = skins[proposed.surface.name], kept[proposed.surface.name]
            if isinstance(skin, BoardSkin) and isinstance(some, BoardSkin):
                skin = replace(skin, choice=some.choice)
            else:
                assert isinstance(skin, SheetSkin)
                skin = replace(skin, taxels=some.taxels)
            return skin, place_skin(skin, proposed.fit, 0).patch.taxels

        on_both = [proposed for proposed in found if proposed.surface.name in kept]
        return self.proposal(on_both, skin_of, replace(choice, chain=1), begin)

    def _bare(self, covered: BoolArray, found: Sequence[Proposed], problems: Mapping[str, str], least: float) -> str:
        """Return where the largest piece of the free area without skin is, and why; empty if it is small."""
        piece = self.on.largest_bare_piece(covered)
        points, areas = self.on.points[piece], self.on.areas[piece]
        if areas.sum() < MIN_BARE_AREA:
            return ""
        middle = points[np.linalg.norm(points - areas @ points / areas.sum(), axis=1).argmin()]
        why = f"no surface of at least {least * 1e4:.2g} cm^2 was found there within 1 mm and 15 degrees of the mesh"
        on_surface = {p.surface.name: p.covered[piece] for p in found if p.surface.name in problems}
        if areas[np.any([*on_surface.values(), np.zeros(len(piece), bool)], axis=0)].sum() > 0.5 * areas.sum():
            largest = max(on_surface, key=lambda name: float(areas[on_surface[name]].sum()))
            why = f"no skin fits on the surface there: {problems[largest]}"
        words = f"The largest piece of the free area without skin has {areas.sum() * 1e4:.0f} cm^2"
        return f"{words}, about {millimetres(middle)}: {why.rstrip('.')}."


def _left_out(proposed: Proposed, why: str) -> str:
    return f"{proposed.reason}: {proposed.area * 1e4:.0f} cm^2, left out: {why}"


def _without_conflicts(
    mesh: TriangleMesh,
    on: LinkPoints,
    placed: Sequence[tuple[Proposed, SheetSkin | BoardSkin, TaxelArray]],
    chain: int = 1,
) -> Iterator[tuple[Proposed, SheetSkin | BoardSkin, BoolArray, TaxelArray]]:
    """Yield the surfaces with their skins, without cells that conflict, which taxels remain, and all taxels.

    Boards in chains shorter than ``chain`` are left out, unless the link has no longer one.
    """
    boards = [(skin, taxels) for _, skin, taxels in placed if isinstance(skin, BoardSkin)]
    skins, taxels_of = [skin for skin, _ in boards], [taxels for _, taxels in boards]
    some = usable(mesh, on, skins, taxels_of) if boards else []
    of_boards = iter(without_short_chains(taxels_of, some, chain))
    sheets = [(skin, taxels) for _, skin, taxels in placed if isinstance(skin, SheetSkin)]
    of_sheets = iter(apart(mesh, on, sheets) if sheets else ())
    for proposed, skin, taxels in placed:
        if isinstance(skin, BoardSkin):
            kept = next(of_boards)
            skin = with_cells(skin, taxels, kept)
        else:
            kept = next(of_sheets)
            skin = without_cells(skin, taxels, kept)
        yield proposed, skin, kept, taxels


def joint_axes(robot: Robot, link: str) -> Iterator[tuple[Axis, str]]:
    """Yield the axes of the joints at a link, in its frame, and what they are called."""
    for joint in robot.joints.values():
        if link not in (joint.parent, joint.child) or joint.type == "fixed":
            continue
        point, direction = np.zeros(3), np.array(joint.axis)
        if joint.parent == link:
            point, direction = np.array(joint.position), rotations(np.array([joint.angles]))[0] @ direction
        yield axis_of(point, direction), f"the axis of {joint.name}"
