# SPDX-License-Identifier: GPL-3.0-or-later
"""Replay a recording over the skin: forces on the cells, contacts, CoP and polygons, frame by frame or in motion.

The properties of an object contain the recording and the displayed frame. During playback a timer changes the frame,
and no property: for each property change Blender would evaluate the mesh of the link again. Playback ends with undo,
another file, another fit, or the removal of the object.
"""

from itertools import count
from time import perf_counter
from typing import Any

import bpy
import numpy as np
from bpy.app.handlers import persistent

from ...common.arrays import Array
from ...common.errors import counted
from ...inspection.replaying import Replay
from ...runtime import Frame
from ..overlay import drawing
from ..overlay.layers import Layer, heat_layer, replay_lines
from ..overlay.scales import Legend
from ..session import Playing, session, wake
from .taxels import result_of

# Stored recordings. Larger: more memory; smaller: undo does not show older ones again.
MAX_RECORDINGS = 4
TIMER_INTERVAL = 1 / 60  # [s] between two calls of the timer. Larger: playback is less smooth


messages: dict[str, tuple[str, ...]] = {}  # lines of the panel for the displayed frame, by token
_replays: dict[str, Replay] = {}  # by token
_count = count()


def find(link: bpy.types.Object) -> Replay | None:
    """Return the recording of an object, if it is still stored and belongs to the last fit."""
    record = link.skin_calib.inspect.replay
    return _replays.get(record.token) if record.key == link.skin_calib.result.key else None


def open_recording(link: bpy.types.Object, path: str) -> Replay:
    """Show the first frame of a recording over the last result of a link."""
    settings, key = link.skin_calib.inspect, link.skin_calib.result.key
    replay = Replay.read(result_of(link).calibration, path)
    stop(link)
    token = f"replay {next(_count)} of {key}"
    _replays[token] = replay
    while len(_replays) > MAX_RECORDINGS:
        _forget(next(iter(_replays)))
    record = settings.replay
    record.file, record.key, record.token, record.chosen, settings.heat = path, key, token, 0, "FORCE"
    show(link)
    return replay


def close(link: bpy.types.Object) -> None:
    """Remove the recording from the view."""
    settings = link.skin_calib.inspect
    stop(link)
    settings.property_unset("replay")
    if settings.heat == "FORCE":
        settings.heat = "NONE"


def show(link: bpy.types.Object) -> None:
    """Prepare the layers and messages of the displayed frame of an object."""
    replay, record = find(link), link.skin_calib.inspect.replay
    if replay is None:
        return
    frame = replay.frame(frame_of(record))
    drawing.cache(record.token, (_forces(replay, frame), *replay_lines(replay.taxels, frame)))
    messages[record.token] = tuple(_message_lines(replay, frame))
    drawing.redraw()


def known_forces(frame: Frame) -> Array:
    """Return the force on each taxel in a frame, shape (n,) [N]; NaN if it is unknown."""
    return np.where(frame.known, frame.forces, np.nan)


def _forces(replay: Replay, frame: Any) -> Layer:
    note = "" if frame.known.all() else "dark grey: no reading"
    legend = Legend("Force", "FORCE", replay.strongest, note=note)
    return heat_layer("FORCE", replay.taxels, known_forces(frame), legend)


def _message_lines(replay: Replay, frame: Any) -> Any:
    """Yield the lines of the panel."""
    contacts = counted(len(frame.contacts), "contact")
    yield f"{frame.time:.3f} s: {contacts}, {sum(c.force for c in frame.contacts):.2f} N"
    if frame.cop is not None:
        x, y = 1e3 * frame.cop
        yield f"CoP {x:.1f}, {y:.1f} mm on the ground"
    yield f"Columns: {replay.columns}"
    yield from (f"The recording: {note}" for note in replay.notes)
    if frame.problem:
        yield frame.problem
    if frame.flags:
        yield "Flags: " + ", ".join(sorted(frame.flags))


def frame_of(record: Any) -> int:
    """Return the displayed frame."""
    playing = session.of(record.id_data).playing
    return playing.frame if playing else record.chosen


def choose(record: Any, frame: int) -> None:
    """Show another frame; playback continues from there."""
    link = record.id_data
    replay = find(link)
    record.chosen = frame if replay is None else min(frame, len(replay) - 1)
    if is_playing(link):
        _begin(link, record.chosen)
    show(link)


def paced(record: Any, _context: Any) -> None:
    """Continue playback at another speed."""
    if is_playing(record.id_data):
        _begin(record.id_data, frame_of(record))


def is_playing(link: bpy.types.Object) -> bool:
    """Return whether the recording of an object is playing."""
    return session.of(link).playing is not None


def play(link: bpy.types.Object) -> None:
    """Play the recording of an object from the displayed frame; from the start if that is the last one."""
    replay, frame = find(link), frame_of(link.skin_calib.inspect.replay)
    if replay is None:
        return
    _begin(link, 0 if frame == len(replay) - 1 else frame)
    show(link)
    wake(tick)


def _begin(link: bpy.types.Object, frame: int) -> None:
    replay = find(link)
    if replay is not None:
        session.of(link).playing = Playing(float(replay.seconds[frame]), perf_counter(), frame)


def stop(link: bpy.types.Object) -> None:
    """Stop playback at the displayed frame."""
    state = session.of(link)
    if state.playing:
        link.skin_calib.inspect.replay.chosen, state.playing = state.playing.frame, None


def tick() -> float | None:
    """Show the next frames; return the seconds to the next call, None if nothing is playing."""
    for link, state in session.links():
        playing, replay = state.playing, find(link)
        if playing is None:
            continue
        if replay is None:
            state.playing = None
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
    if any(state.playing for state in session.states.values()):
        return TIMER_INTERVAL
    drawing.redraw()  # for the button
    return None


def _forget(token: str) -> None:
    _replays.pop(token, None)
    messages.pop(token, None)


@persistent
def _undone(*_: Any) -> None:
    """Draw the restored frame after undo or redo, which stop playback."""
    for link in bpy.data.objects:
        if link.skin_calib.inspect.replay.token:
            show(link)


@persistent
def _opened(*_: Any) -> None:
    """Remove all recordings after another file was opened."""
    _replays.clear()
    messages.clear()


HANDLERS = {"undo_post": _undone, "redo_post": _undone, "load_post": _opened}
TIMERS = (tick,)


def unregister() -> None:
    """Remove all recordings."""
    _opened()
