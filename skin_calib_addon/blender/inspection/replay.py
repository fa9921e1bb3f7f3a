# SPDX-License-Identifier: GPL-3.0-or-later
"""A recorded reading over the skin: forces on the cells, contacts, CoP and polygons; frame by frame, or played.

An object holds which recording it shows and which frame. While it plays a timer moves on another one, which no property
knows: Blender would evaluate the link's mesh anew for each. That ends with undo, another file, another fit, the object.
"""

from dataclasses import dataclass
from itertools import count
from time import perf_counter
from typing import Any

import bpy
import numpy as np
from bpy.app.handlers import persistent

from ...inspection.replaying import Replay
from ..live import events
from ..overlay import overlay
from ..overlay.layers import Layer, heat_layer, replay_lines
from ..overlay.scales import Legend
from .taxels import result_of

KEPT = 4
REST = 1 / 60  # between two calls of the timer [s]


@dataclass
class Playing:
    """Where in the recording it was played from, and when; and the frame that is shown."""

    seconds: float
    clock: float
    frame: int


told: dict[str, tuple[str, ...]] = {}  # what the panel says of the frame that is shown, by token
_replays: dict[str, Replay] = {}  # by token
_playing: dict[str, Playing] = {}  # by the object's name
_count = count()


def find(link: bpy.types.Object) -> Replay | None:
    """The recording that an object shows, if it is still kept and of the last fit."""
    record = link.skin_calib.inspect.replay
    return _replays.get(record.token) if record.key == link.skin_calib.result.key else None


def open_recording(link: bpy.types.Object, path: str) -> Replay:
    """Show the first frame of a recording over the last result of a link.

    Raises
    ------
    SkinCalibError
        If there is no result, or the recording is none of this skin.
    """
    looks, key = link.skin_calib.inspect, link.skin_calib.result.key
    replay = Replay.read(result_of(link).calibration, path)
    stop(link)
    token = f"replay {next(_count)} of {key}"
    _replays[token] = replay
    while len(_replays) > KEPT:
        _forget(next(iter(_replays)))
    record = looks.replay
    record.file, record.key, record.token, record.chosen, looks.heat = path, key, token, 0, "FORCE"
    show(link)
    return replay


def close(link: bpy.types.Object) -> None:
    """Show no recording any more."""
    looks = link.skin_calib.inspect
    stop(link)
    looks.property_unset("replay")
    if looks.heat == "FORCE":
        looks.heat = "NONE"


def show(link: bpy.types.Object) -> None:
    """Prepare what is drawn and said of the frame that an object shows."""
    replay, record = find(link), link.skin_calib.inspect.replay
    if replay is None:
        return
    frame = replay.frame(frame_of(record))
    overlay.keep(record.token, (_forces(replay, frame), *replay_lines(replay.taxels, frame)))
    told[record.token] = tuple(_in_words(replay, frame))
    overlay.redraw()


def _forces(replay: Replay, frame: Any) -> Layer:
    note = "" if frame.known.all() else "grey: no reading"
    legend = Legend("Force", "FORCE", replay.strongest, note=note)
    return heat_layer("FORCE", replay.taxels, np.where(frame.known, frame.forces, np.nan), legend)


def _in_words(replay: Replay, frame: Any) -> Any:
    """Lines for the panel."""
    contacts = f"{len(frame.contacts)} contact" + ("" if len(frame.contacts) == 1 else "s")
    yield f"{frame.time:.3f} s: {contacts}, {sum(c.force for c in frame.contacts):.2f} N"
    if frame.cop is not None:
        x, y = 1e3 * frame.cop
        yield f"CoP {x:.1f}, {y:.1f} mm on the ground"
    if replay.numbers > replay.skin.reading_length:
        yield f"{replay.skin.reading_length} of {replay.numbers} numbers used"
    if frame.problem:
        yield frame.problem
    if frame.flags:
        yield "Doubts: " + ", ".join(sorted(frame.flags))


def frame_of(record: Any) -> int:
    """The frame that is shown."""
    playing = _playing.get(record.id_data.name)
    return playing.frame if playing else record.chosen


def choose(record: Any, frame: int) -> None:
    """Show another frame, the last one at most; what plays goes on from there."""
    link = record.id_data
    replay = find(link)
    record.chosen = frame if replay is None else min(frame, len(replay) - 1)
    if link.name in _playing:
        _begin(link, record.chosen)
    show(link)


def paced(record: Any, _context: Any) -> None:
    """Another speed: go on from here with it."""
    if record.id_data.name in _playing:
        _begin(record.id_data, frame_of(record))


def is_playing(link: bpy.types.Object) -> bool:
    """Whether the recording of an object moves on."""
    return link.name in _playing


def play(link: bpy.types.Object) -> None:
    """Let the recording of an object move on from where it is; from its beginning at its end."""
    replay, frame = find(link), frame_of(link.skin_calib.inspect.replay)
    if replay is None:
        return
    _begin(link, 0 if frame == len(replay) - 1 else frame)
    show(link)
    events.wake(tick)


def _begin(link: bpy.types.Object, frame: int) -> None:
    replay = find(link)
    if replay is not None:
        _playing[link.name] = Playing(float(replay.seconds[frame]), perf_counter(), frame)


def stop(link: bpy.types.Object) -> None:
    """Let the recording of an object stand still at the frame that is shown."""
    playing = _playing.pop(link.name, None)
    if playing:
        link.skin_calib.inspect.replay.chosen = playing.frame


def tick() -> float | None:
    """Move on what plays. The seconds to the next call, none when nothing plays."""
    for name, playing in list(_playing.items()):
        link = bpy.data.objects.get(name)
        replay = find(link) if link else None
        if link is None or replay is None:
            del _playing[name]
            continue
        record = link.skin_calib.inspect.replay
        seconds = playing.seconds + (perf_counter() - playing.clock) * record.speed
        is_over = seconds >= replay.duration and not record.loop
        frame = replay.at(seconds if is_over else seconds % replay.duration)
        if frame != playing.frame:
            playing.frame = frame
            show(link)
        if is_over:
            stop(link)
    if not _playing:
        overlay.redraw()  # the button changes
    return REST if _playing else None


def _forget(token: str) -> None:
    _replays.pop(token, None)
    told.pop(token, None)


@persistent
def _went_back(*_: Any) -> None:
    """After undo or redo nothing plays, and the frame that came back is drawn."""
    _playing.clear()
    for link in bpy.data.objects:
        if link.skin_calib.inspect.replay.token:
            show(link)


@persistent
def _opened(*_: Any) -> None:
    """Another file: its objects have recordings of their own."""
    _playing.clear()
    _replays.clear()
    told.clear()


HANDLERS = {"undo_post": _went_back, "redo_post": _went_back, "load_post": _opened}


def register() -> None:
    """Notice when time goes back."""
    events.listen(HANDLERS)


def unregister() -> None:
    """Play nothing any more."""
    events.ignore(HANDLERS, (tick,))
    _opened()
