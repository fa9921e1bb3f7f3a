# SPDX-License-Identifier: GPL-3.0-or-later
"""What the window knows beyond the properties of objects, one :class:`LinkState` per link. No other module keeps any.

A link is known by the ``session_uid`` of its object: undo, redo and another name do not change it. A copy has another
one, and so has each object of a file that is opened.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from time import perf_counter
from typing import Any

import bpy
from bpy.app.handlers import persistent

from .live.background import Work
from .live.preview import PreviewReport, StepCache
from .live.sketch import Sketch
from .overlay.layers import Layers
from .scene.facets import Facets

SCENE_REPLACED = ("undo_post", "redo_post", "load_post")  # events after which all objects can be different
Input = tuple[str, Facets | None]  # plan as text, and mesh of a link; or why one of them cannot be read, and None


@dataclass
class Playing:
    """Start of the playback in the recording, its time, and the displayed frame."""

    seconds: float
    clock: float
    frame: int


@dataclass(eq=False)
class LinkState:
    """What the window knows of one link; undo and redo keep what :meth:`restarted` has."""

    # Requested update
    changed_at: float | None = None  # time of the last change without a new fit [s]
    is_previewed: bool = False  # whether the preview shows the last change
    is_touched: bool = False  # whether mesh or position may have changed
    is_accompanied: bool = False  # whether an operator lets Live follow although it is off
    is_followed_once: bool = False  # whether it still does until the next result
    # Fit and preview
    facets: Facets | None = None  # of the last fit or preview
    groups: Any = None  # zones of the vertex groups of that time
    steps: StepCache = field(default_factory=StepCache)  # of the last preview
    report: PreviewReport | None = None  # of the preview, or why there is none
    layers: Layers | None = None  # of the preview, drawn in place of the result
    sketch: Sketch | None = None  # of hand-placed planes
    # Check of the mesh
    is_unverified: bool = False  # whether the mesh may differ from the diagnosed one
    touched_at: float | None = None  # time of the last change of a mesh that is to be compared [s]
    hashing: Work | None = None  # hash of the mesh that is compared now
    compared: Facets | None = None  # of the last comparison: only other ones need another hash

    playing: Playing | None = None  # a recording
    # Last refusal, and what was refused
    refused: tuple[Input, PreviewReport] | None = None
    accompanied_plans: set[str] = field(default_factory=set)  # undo and redo bring these back
    in_vain: set[Any] = field(default_factory=set)  # changes that a warning advises, which were tried and do not help

    def change(self) -> None:
        """Note a change of plan or mesh: fit and preview are out of date."""
        self.changed_at, self.is_previewed = perf_counter(), False

    def forget_change(self) -> None:
        """Request no update any more."""
        self.changed_at, self.is_previewed = None, False

    def forget(self) -> None:
        """Remove request and preview; the sketch of the planes stays."""
        self.forget_change()
        self.report = self.layers = None

    def refuse(self, given: Input, report: PreviewReport) -> None:
        """Show why a plan cannot be computed. The reason stays while plan and mesh are the same."""
        self.forget_change()
        self.report, self.refused, self.is_followed_once = report, (given, report), False

    @property
    def is_refused(self) -> bool:
        """Return whether the plan cannot be computed."""
        return self.report is not None and self.report.refusal is not None

    def restarted(self) -> "LinkState":
        """Return the state after undo or redo: what is drawn and awaited was of another plan."""
        return LinkState(
            is_accompanied=self.is_accompanied,
            compared=self.compared,
            refused=self.refused,
            accompanied_plans=self.accompanied_plans,
            in_vain=self.in_vain,
        )


@dataclass(eq=False)
class Job:
    """A running computation of Live for a link."""

    uid: int
    work: Work
    use: Any  # called with the object and the result
    is_final: bool


@dataclass
class Busy:
    """What an operator works on while the window waits for it."""

    uid: int | None  # of a link; None: a file
    name: str
    progress: str = ""


class Session:
    """The states of all links, and what runs for one of them."""

    def __init__(self) -> None:
        self.states: dict[int, LinkState] = {}  # by `session_uid`
        self.metres: dict[int, float] = {}  # length of a unit of each scene at its last update [m], by `session_uid`
        self.job: Job | None = None
        self.last_final: Work | None = None  # of a complete fit, which can still run after it was stopped
        self.busy: Busy | None = None

    def of(self, link: Any) -> LinkState:
        """Return the state of a link."""
        return self.of_uid(link.session_uid)

    def of_uid(self, uid: int) -> LinkState:
        """Return the state of the link whose object has this `session_uid`."""
        return self.states.setdefault(uid, LinkState())

    def links(self) -> Iterator[tuple[bpy.types.Object, LinkState]]:
        """Yield the objects that have a state; of one that was removed, only what undo can bring back is kept."""
        objects = {thing.session_uid: thing for thing in bpy.data.objects}
        for uid, state in list(self.states.items()):
            if uid in objects:
                yield objects[uid], state
            else:
                self.states[uid] = replace(state.restarted(), compared=None)

    def progress_of(self, link: Any) -> str | None:
        """Return what an operator does with a link now; None without one."""
        return self.busy.progress if self.busy is not None and self.busy.uid == link.session_uid else None

    def stop_job(self) -> None:
        """Stop the computation of Live, and ignore its result."""
        if self.job is not None:
            self.job.work.stop()
            self.job = None

    def stop_fit(self, uid: int | None) -> None:
        """Stop the complete fit of a link, if it runs."""
        if self.job is not None and self.job.is_final and self.job.uid == uid:
            self.stop_job()

    def restart(self) -> None:
        """Forget what was drawn and awaited before undo or redo."""
        self.stop_job()
        self.states = {uid: state.restarted() for uid, state in self.states.items()}
        self.metres.clear()

    def clear(self) -> None:
        """Forget all links: another file is open."""
        self.stop_job()
        self.states.clear()
        self.metres.clear()
        self.busy = None


session = Session()


@persistent
def _undone(*_: Any) -> None:
    session.restart()


@persistent
def _opened(*_: Any) -> None:
    session.clear()


HANDLERS = {"undo_post": _undone, "redo_post": _undone, "load_post": _opened}


def unregister() -> None:
    """Forget all links."""
    session.clear()


def wake(timer: Callable[[], float | None], seconds: float = 0.0) -> None:
    """Call a timer after a delay, if it does not wait already; it returns the seconds to its next call, None to end."""
    if not bpy.app.timers.is_registered(timer):
        bpy.app.timers.register(timer, first_interval=seconds)
