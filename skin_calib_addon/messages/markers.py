"""Markers that Foxglove and RViz draw (``visualization_msgs/MarkerArray``), in MCAP files next to the frames."""

from collections.abc import Mapping, Sequence
from functools import partial
from typing import IO, Any

import numpy as np

from ..calibration.model import LinkCalibration
from ..common.arrays import Array
from ..runtime import Frame, Skin
from .cdr import encode
from .content import Message, header
from .mcap_file import TOPICS, TRANSIENT_LOCAL, VOLATILE, McapSkin
from .scene import CELL_COLOUR, CONTACT_COLOUR, COP_COLOUR, POLYGON_COLOURS, SceneMaker

ARROW, LINE_STRIP, SPHERE_LIST, TRIANGLE_LIST, ADD, DELETE_ALL = 0, 4, 7, 11, 0, 3  # Contract: of visualization_msgs
WIDTH_FRACTION = 0.008  # [1] of lines, relative to the size of the skin
# [s] between the scenes of a file. Larger: smaller files, jerky motion. A frame of 1260 taxels has 2 kB, a scene of 20
# touched ones 8 kB.
SCENE_PERIOD = 0.04
PLAIN: Message = {
    "id": 0,
    "action": ADD,
    "pose": np.array((0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)),
    "lifetime": {"sec": 0, "nanosec": 0},
    "frame_locked": True,
    "colors": np.empty((0, 4)),
    "texture_resource": "",
    "texture": {"header": header("", 0.0), "format": "", "data": ()},
    "uv_coordinates": np.empty((0, 2)),
    "text": "",
    "mesh_resource": "",
    "mesh_file": {"filename": "", "data": ()},
    "mesh_use_embedded_materials": False,
}  # what most markers have in common


class McapView(McapSkin):
    """Writes the skin of a link with markers: all cells once, and what :mod:`.scene` shows."""

    topics = TOPICS | {
        "cells": ("visualization_msgs/MarkerArray", 1, TRANSIENT_LOCAL),
        "scene": ("visualization_msgs/MarkerArray", 10, VOLATILE),
    }

    def __init__(self, stream: IO[bytes], calibration: LinkCalibration, skin: Skin, frames: Sequence[Frame]):
        """Write the cells. The frames are those that follow; their largest force is the darkest colour."""
        super().__init__(stream, calibration, skin, frames[0].time)
        self._maker, self._next = SceneMaker(calibration, skin, tuple(frames)), -np.inf
        cells = cells_message(self._maker, skin.link, frames[0].time)
        self.write("cells", encode(self.topics["cells"][0], cells), frames[0].time, 0)

    def add(self, readings: Mapping[str, Array], frame: Frame, cycle: int, lost: int = 0) -> None:
        """Write a frame, and its scene if the last one is old enough, or later."""
        super().add(readings, frame, cycle, lost)
        if self._next - SCENE_PERIOD < frame.time < self._next:
            return
        self._next, marker = frame.time + SCENE_PERIOD, partial(_marker, header(self._link, frame.time))
        scene, width = self._maker.scene(frame), WIDTH_FRACTION * self._maker.size
        markers = [marker("", ARROW, (), COP_COLOUR, 1.0, action=DELETE_ALL)]
        colours = np.repeat(np.column_stack((scene.colours, np.ones(len(scene.colours)))), 3, axis=0)
        markers.append(marker("touched", TRIANGLE_LIST, scene.triangles, CELL_COLOUR, 1.0, colors=colours))
        for number, ends in enumerate(np.stack((scene.tails, scene.heads), axis=1)):
            markers.append(marker("contacts", ARROW, ends, CONTACT_COLOUR, width, id=number))
        for name, line in scene.polygons.items():
            markers.append(marker(name, LINE_STRIP, line, POLYGON_COLOURS[name], width))
        markers.append(marker("cop", SPHERE_LIST, scene.cop, COP_COLOUR, 4 * width))
        message = {"markers": [m for m in markers if len(m["points"]) or m["action"]]}
        self.write("scene", encode(self.topics["scene"][0], message), frame.time, cycle)


def cells_message(maker: SceneMaker, link: str, time: float = 0.0) -> Message:
    """Return the ``MarkerArray`` of all cells of a skin; at the time 0, viewers use the newest pose of the link."""
    return {"markers": [_marker(header(link, time), "cells", TRIANGLE_LIST, maker.cells, CELL_COLOUR, 1.0)]}


def _marker(head: Message, ns: str, kind: int, points: Any, colour: Any, size: float, **others: Any) -> Message:
    """Return a marker with points (n, 3) [m]; ``size`` is the width of lines, or the diameter of spheres [m]."""
    scale = np.array((size, 2 * size, 0.0)) if kind == ARROW else np.full(3, size)  # of an arrow: shaft, head
    shape = {"type": kind, "points": np.reshape(points, (-1, 3)), "color": (*colour, 1.0), "scale": scale}
    return PLAIN | {"header": head, "ns": ns} | shape | others
