"""``propose``: a plan for each link of a robot, or for one mesh."""

import argparse
import itertools
import os
from collections.abc import Iterator, Sequence
from dataclasses import replace
from fnmatch import fnmatchcase
from pathlib import Path

from ..common.atomic_file import make_folder
from ..common.errors import InvalidMesh, InvalidPlan, OutputError, SkinCalibError, UnknownLink, counted, listed
from ..common.findings import did_you_mean, show
from ..geometry.mesh.triangle_mesh import METRES_PER_UNIT
from ..plan import load_plan, named_from, save_plan
from ..plan.skins import following_channel
from ..proposal.links import (
    Fitted,
    Outcome,
    Task,
    areas,
    groups,
    is_current,
    numbered,
    plan_path,
    plan_warnings,
    propose_group,
    propose_task,
    robot_of,
)
from ..proposal.proposal import Proposal
from ..proposal.skins import DEFAULT_SKIN, FORMS, SkinChoice, parse_skin
from ..robot.from_mjcf import as_urdf
from ..robot.link_mesh import axis_warning, is_urdf, links_with_mesh, links_without_files
from ..robot.urdf import read_robot
from ..robot.zones import load_zones
from .common import DONE, WRONG_DATA, complain, count, named_path, say
from .progress import Progress
from .worker_processes import run_tasks

NO_MESH = "it has no visual mesh. Shapes for collisions, boxes, cylinders, spheres and capsules carry no skin."


def add(parser: argparse.ArgumentParser) -> None:
    """Define the command."""
    parser.description = (
        "A plan has the surfaces that cover what can be seen from outside and what no other link covers, "
        "and skins on them. Each plan states the reasons for its choices, under x_proposal."
    )
    parser.add_argument("file", type=named_path, metavar="FILE", help="robot (URDF or MJCF), or a mesh")
    parser.add_argument("-o", "--output", required=True, type=named_path, metavar="FOLDER", help="folder for the plans")
    parser.add_argument("--again", action="store_true", help="replace plans whose robot, mesh or skin has changed")
    add_options(parser)


def add_options(parser: argparse.ArgumentParser) -> None:
    """Define the options that ``fit --propose`` has, too."""
    parser.add_argument(
        "--skin",
        type=_skin,
        metavar="SKIN",
        help=f"skin of all links. {FORMS} Default: {DEFAULT_SKIN}",
    )
    parser.add_argument(
        "--only",
        action="append",
        metavar="LINK",
        help="only links with this name, or of this pattern such as left_*; can be repeated",
    )
    parser.add_argument(
        "--except",
        action="append",
        dest="left_out",
        metavar="LINK",
        help="no links with this name, or of this pattern; can be repeated",
    )
    parser.add_argument("--unit", choices=tuple(METRES_PER_UNIT), help="unit of the numbers of a mesh (default: m)")
    parser.add_argument("--jobs", type=count, default=1, metavar="N", help="number of parallel processes (default: 1)")


def _skin(text: str) -> SkinChoice:
    """Parse the option --skin."""
    try:
        return parse_skin(text)
    except SkinCalibError as problem:
        if os.path.isfile(text):  # its content is wrong, not the call
            raise
        raise argparse.ArgumentTypeError(str(problem).rstrip(".")) from problem


def run(options: argparse.Namespace) -> int:
    """Write the plans, and print a line for each link."""
    return propose(options, options.output, options.again)[1]


def propose(
    options: argparse.Namespace, folder: Path, again: bool, fit: bool = False
) -> tuple[dict[Path, Fitted | None], int]:
    """Write a plan for each link that can carry skin, and print a line for each link."""
    choice = replace(options.skin or parse_skin(DEFAULT_SKIN), is_wanted=bool(options.only))
    if os.path.lexists(folder) and not os.path.isdir(folder):
        raise OutputError(f"{folder} is not a folder. Choose another name.")
    given, options.file = options.file, as_urdf(options.file, folder)
    if options.file != given:
        say(f"{given.name} is read as {options.file}")
    links = _links(options)
    fit = fit and len(links) > 1  # the summary of a single fit needs more than its calibration
    tasks = [Task(options.file, options.unit or "m", link, choice, fit=fit) for link in links]
    _warn_first(options.file, links)
    make_folder(folder)
    paths = {task.link: plan_path(folder, task.link) for task in tasks}
    there = [task for task in tasks if os.path.lexists(paths[task.link])]
    kept = {task.link for task in there if not again or is_current(paths[task.link], task)}
    done: dict[str, Outcome] = {}
    try:
        for finished in _outcomes([task for task in tasks if task.link not in kept], options.jobs):
            done[finished.task.link] = _written(finished, folder)
    finally:  # also after Ctrl+C: the next call continues
        found = [p for task in tasks if task.link in done and (p := done[task.link].proposal)]
        former, ends, firsts = _save(found, folder)
    plans: dict[Path, Fitted | None] = {}
    lines: list[tuple[str, str]] = []
    for link in links:
        path = plan_path(folder, link)
        outcome = done.get(link)
        if outcome is None:
            plans[path], words = None, _kept(path, ends[path], again)
        else:
            if outcome.proposal and outcome.proposal.plan:
                plans[path] = outcome.fitted
            words = _proposed(outcome, former.get(link, []), firsts.get(link, 0))
        lines += [(link, line) for line in words]
    lines += [(link, f"no plan: {NO_MESH}") for link in _links_with_other_shapes(options)]
    width = max(len(link) for link, _ in lines)
    total = f"{counted(len(tasks), 'link')}, {counted(len(plans), 'plan')}{_areas(found, bool(kept))}"
    say("\n".join((*(f"{link:{width}}  {words}" for link, words in lines), total)))
    failed = any(finished.proposal is None for finished in done.values())
    return plans, WRONG_DATA if failed else DONE


def _warn_first(file: Path, links: Sequence[str]) -> None:
    """Complain, before anything is computed, of what makes the result useless; wrong zones are an error."""
    load_zones(file)
    robot = read_robot(file) if is_urdf(file) else None
    if warning := axis_warning(file, robot, links):
        complain(f"warning: {warning}")
    lost = [] if robot is None else links_without_files(robot, file)
    if lost:
        complain(
            f"warning: {counted(len(lost), 'link')} of {file.name} {'has' if len(lost) == 1 else 'have'} mesh files "
            f"that were not found: {listed(lost)}. Such a link gets no plan, and covers no other."
        )


def _written(outcome: Outcome, folder: Path) -> Outcome:
    """Write the plan of a link that is finished, without its channels; one that no plan may have has failed."""
    if outcome.proposal and outcome.proposal.plan:
        try:
            save_plan(named_from(outcome.proposal.plan, folder), plan_path(folder, outcome.task.link))
        except InvalidPlan as problem:
            return Outcome(outcome.task, None, str(problem))
    return outcome


def _kept(path: Path, end: int | None, again: bool) -> list[str]:
    """Return the lines about a plan that exists, and the channel after its own; None if it is not known."""
    why = "what it was made from has not changed" if again else "its plan exists; --again replaces it if it is outdated"
    words = "" if end is not None else ". Its channels are not known before the fit"
    warnings = [f"warning: {reason}" for reason in plan_warnings(path)]
    return [f"kept: {why}{words}", *warnings]


def _proposed(outcome: Outcome, former: Sequence[str], first: int) -> list[str]:
    """Return the lines about the proposal for a link, and the new names of its earlier files; complain of a failure."""
    proposal = outcome.proposal
    if proposal is None:
        complain(f"{outcome.task.link}: {outcome.problem}")
        return ["failed"]
    if proposal.plan is None:
        words = f" Its earlier files have other names now: {', '.join(former)}." if former else ""
        return [f"no plan: {proposal.reasons[-1]}{words}"]
    bare = [proposal.bare] if proposal.bare else []
    return [_numbers(proposal, first), *bare, *(f"warning: {words}" for words in proposal.warnings)]


def _areas(proposals: Sequence[Proposal], has_kept: bool) -> str:
    """Return what the cells of proposals cover together, for the last line; empty if no area is free."""
    seen, free, cells = (sum(getattr(p, name) for p in proposals) for name in ("seen", "free", "cells"))
    if not free:
        return ""
    chains, singles, cables, taxels, channels = (
        sum(getattr(p, name) for p in proposals) for name in ("chains", "singles", "cables", "taxels", "channels")
    )
    longest = max(p.longest for p in proposals)
    return (
        f"; {'without those kept, ' if has_kept else ''}{counted(taxels, 'taxel')} on {counted(channels, 'channel')}"
        f"{_chains(chains, singles, longest, cables)}, cells cover {cells * 1e4:.0f} cm^2, "
        f"{cells / free:.0%} of the free area and {cells / seen:.0%} of the area that can be seen"
    )


def _set_aside(plan: Path) -> list[str]:
    """Rename the plan of a link, and the calibration next to it, so that they are not of the robot; return their names.

    They are not removed: a person may have edited the plan, or measured the response of the calibration.
    """
    names = []
    for path in (plan, plan.with_name(f"{plan.name.removesuffix('.plan.json')}.calibration.json")):
        if os.path.lexists(path):
            others = (path.with_name(f"{path.name}.old{k or ''}") for k in itertools.count())
            other = next(other for other in others if not os.path.lexists(other))
            os.rename(path, other)
            names.append(other.name)
    return names


def _save(
    proposals: Sequence[Proposal], folder: Path
) -> tuple[dict[str, list[str]], dict[Path, int | None], dict[str, int]]:
    """Write the plans of proposals; those of links that have none now are set aside.

    Channels follow each other, after those of all plans that stay. Return the new names of the files of each link that
    were set aside, the channel after each plan that stays, None if it is not known, and the first one of each link.
    """
    former = {p.link: _set_aside(plan_path(folder, p.link)) for p in proposals if p.plan is None}
    written = {plan_path(folder, p.link) for p in proposals}
    ends = {path: _channel_after(path) for path in sorted(folder.glob("*.plan.json")) if path not in written}
    channel, firsts = max(filter(None, ends.values()), default=0), dict[str, int]()
    for proposal in proposals:
        if proposal.plan:
            save_plan(named_from(numbered(proposal.plan, channel), folder), plan_path(folder, proposal.link))
            firsts[proposal.link] = channel
            channel += proposal.channels
    return former, ends, firsts


def _channel_after(path: Path) -> int | None:
    """Return the channel after those of a plan that stays; None if it is not known."""
    try:
        return following_channel(load_plan(path).skins)
    except SkinCalibError:
        return None  # ``fit`` says what is wrong with the plan


def _chains(chains: int, singles: int, longest: int, cables: float) -> str:
    """Return the chains of boards in words; empty without boards."""
    if not chains:
        return ""
    sizes = f"{singles} of one, the longest of {counted(longest, 'board')}"
    return f" in {counted(chains, 'chain')} ({sizes}; {cables:.1f} m of cable between them)"


def _numbers(proposal: Proposal, first: int) -> str:
    assert proposal.plan is not None
    return (
        f"{counted(len(proposal.plan.surfaces), 'surface')}, {counted(proposal.taxels, 'taxel')} on channels "
        f"{first} to {first + proposal.channels - 1}"
        f"{_chains(proposal.chains, proposal.singles, proposal.longest, proposal.cables)}, cells cover "
        f"{proposal.cells * 1e4:.0f} of {proposal.free * 1e4:.0f} cm^2 free ({proposal.cells / proposal.free:.0%}), "
        f"{proposal.seen * 1e4:.0f} cm^2 seen"
    )


def _links(options: argparse.Namespace) -> list[str]:
    """Return the links to propose plans for."""
    if os.path.isdir(options.file):
        raise InvalidMesh(f"'{options.file}' is a folder. Name a URDF or a mesh.")
    if not is_urdf(options.file):
        return [options.file.stem]
    robot = read_robot(options.file)
    links = links_with_mesh(robot)
    if not links:
        raise InvalidMesh(
            f"{robot.file} has no link with a visual mesh. Shapes for collisions, boxes and cylinders carry no skin."
        )
    for pattern in (*(options.only or ()), *(options.left_out or ())):
        if not any(_is_named(link, pattern) for link in robot.links):
            near = did_you_mean(pattern, robot.links)
            raise UnknownLink(f"{robot.file} has no link {show(pattern)}{near}")
    links = [link for link in links if _is_wanted(link, options)]
    if not links:
        raise InvalidMesh(f"{robot.file} has no link with a visual mesh that is left. Change --only and --except.")
    return links


def _links_with_other_shapes(options: argparse.Namespace) -> list[str]:
    """Return the links that have shapes, but no visual mesh, and that the options do not leave out."""
    if not is_urdf(options.file):
        return []
    robot = read_robot(options.file)
    links = [link for link in robot.links if robot.links[link] or link in robot.shapes]
    return [link for link in links if link not in links_with_mesh(robot) and _is_wanted(link, options)]


def _is_wanted(link: str, options: argparse.Namespace) -> bool:
    """Return whether ``--only`` and ``--except`` do not leave out a link."""
    chosen = not options.only or any(_is_named(link, pattern) for pattern in options.only)
    return chosen and not any(_is_named(link, pattern) for pattern in options.left_out or ())


def _is_named(link: str, pattern: str) -> bool:
    """Return whether a link has this name, or one of this pattern; names can have the characters of patterns."""
    return link == pattern or fnmatchcase(link, pattern)


def _outcomes(tasks: Sequence[Task], processes: int) -> Iterator[Outcome]:
    sizes = areas(tasks)
    progress = Progress(max(len(tasks), 1), sum(sizes))
    size = dict(zip((task.link for task in tasks), sizes))
    if processes == 1 or len(tasks) <= 1:
        results: Iterator[list[Outcome]] = ([propose_task(task)] for task in tasks)
    else:
        results = run_tasks(propose_group, _grouped(tasks), min(processes, len(tasks)), _lost)
    for outcomes in results:
        for outcome in outcomes:
            progress.step(size[outcome.task.link])
            progress.show()
            yield outcome
    progress.clear()


def _grouped(tasks: Sequence[Task]) -> Iterator[list[Task]]:
    """Yield groups of tasks, which are found when the first one is needed: the processes start in the meantime."""
    found = groups(tasks)
    robot_of.cache_clear()  # each process reads the robot again
    yield from found


def _lost(tasks: Sequence[Task], problem: Exception) -> list[Outcome]:
    return [Outcome(task, None, str(problem)) for task in tasks]
