"""Markers in MCAP files: independent readers get the scenes, in the form that Foxglove and RViz draw."""

import io
import json
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from skin_calib_addon.calibration import Response
from skin_calib_addon.messages import decode
from skin_calib_addon.messages.definitions import PRIMITIVES, fields_of
from skin_calib_addon.messages.markers import LINE_STRIP, SCENE_PERIOD, SPHERE_LIST, TRIANGLE_LIST, McapView
from skin_calib_addon.messages.mcap_file import topic_of
from skin_calib_addon.messages.scene import SceneMaker
from skin_calib_addon.runtime import Skin
from tests.samples import plane, small_calibration
from tests.soles import sole_patch

pytest.importorskip("mcap", reason="mcap is not installed: pip install 'skin-calib[live]'")
LAYOUT = Path(__file__).resolve().parents[3] / "examples" / "foxglove_layout.json"
PERIOD = 0.01


@pytest.fixture(scope="module")
def written():
    """Return calibration, skin, frames of two presses that come and go, once without a reading, and their file."""
    fields = {"patches": (sole_patch(),), "surfaces": (plane(),), "response": Response((0.0, 1.0))}
    calibration = small_calibration(link="left sole", **fields)
    skin, rows = Skin(calibration, switch_on=0.5), np.zeros((40, 42))
    rows[8:30, 5:15] = np.linspace(1, 9, 22)[:, None]
    rows[12:26, 38:41] = 3.0
    rows[20, 30] = np.nan
    frames = [skin.update(row, 1.7e9 + PERIOD * k) for k, row in enumerate(rows)]
    stream = io.BytesIO()
    with McapView(stream, calibration, skin, frames) as file:
        for cycle, (row, frame) in enumerate(zip(rows, frames)):
            file.add({"force": row}, frame, cycle)
    return calibration, skin, frames, stream.getvalue()


def scenes_in(data):
    """Return the cells, and the markers of each scene by its time [s], as mcap-ros2-support reads them."""
    reader = pytest.importorskip("mcap_ros2.reader", reason="mcap-ros2-support is not installed")
    cells, scenes = [], {}
    for message in reader.read_ros2_messages(io.BytesIO(data), topics=[topic_of("left sole", "cells")]):
        cells += message.ros_msg.markers
    for message in reader.read_ros2_messages(io.BytesIO(data), topics=[topic_of("left sole", "scene")]):
        stamp = message.ros_msg.markers[0].header.stamp
        scenes[stamp.sec + stamp.nanosec / 1e9] = message.ros_msg.markers
    return cells, scenes


def points_of(marker):
    """Return the points (n, 3)."""
    return np.array([(point.x, point.y, point.z) for point in marker.points]).reshape(-1, 3)


def test_scenes_are_those_of_the_frames(written):
    """Every fourth frame at 100 Hz: triangles and colours, contacts, lines; what is not there is no marker."""
    calibration, skin, frames, data = written
    maker = SceneMaker(calibration, skin, tuple(frames))
    (cells,), scenes = scenes_in(data)
    assert_array_equal(points_of(cells), maker.cells.reshape(-1, 3))
    chosen = frames[:: round(SCENE_PERIOD / PERIOD)]
    assert_allclose(list(scenes), [frame.time for frame in chosen], atol=1e-6)
    for frame, markers in zip(chosen, scenes.values()):
        expected, found = maker.scene(frame), {}
        for marker in markers[1:]:
            found.setdefault(marker.ns, []).append(marker)
        if len(expected.triangles):
            (touched,) = found.pop("touched")
            assert_array_equal(points_of(touched), expected.triangles.reshape(-1, 3))
            colours = [(c.r, c.g, c.b) for c in touched.colors]
            assert_allclose(colours, np.repeat(expected.colours, 3, axis=0), rtol=1e-6)
        arrows = [points_of(marker) for marker in found.pop("contacts", [])]
        assert_array_equal(np.reshape(arrows, (-1, 2, 3)), np.stack((expected.tails, expected.heads), axis=1))
        if len(expected.cop):
            assert_array_equal(points_of(*found.pop("cop")), expected.cop)
        for name, line in expected.polygons.items():
            if len(line):
                assert_array_equal(points_of(*found.pop(name)), line)
        assert not found
    assert {len(markers) for markers in scenes.values()} > {1}  # scenes without and with contact


def test_markers_are_in_the_form_that_viewers_accept(written):
    """Each scene deletes the one before; lists are complete, sizes positive, poses unit, names unique."""
    _, _, _, data = written
    cells, scenes = scenes_in(data)
    for first, *markers in [[None, *cells], *scenes.values()]:
        assert first is None or first.action == 3
        assert len({(marker.ns, marker.id) for marker in markers}) == len(markers)
        for marker in markers:
            assert (marker.action, marker.header.frame_id, marker.pose.orientation.w) == (0, "left sole", 1.0)
            assert marker.color.a == 1.0 and marker.scale.x > 0 and marker.scale.y > 0 and len(marker.points) > 0
            assert len(marker.colors) in (0, len(marker.points)) and all(c.a == 1.0 for c in marker.colors)
            counts = {TRIANGLE_LIST: len(marker.points) % 3 == 0, LINE_STRIP: len(marker.points) > 1, SPHERE_LIST: True}
            assert counts.get(marker.type, len(marker.points) == 2)


def test_our_own_reader_gets_the_markers(written):
    """Arrays of single floats, too."""
    from mcap.reader import make_reader

    topic = topic_of("left sole", "scene")
    messages = [m.data for _, _, m in make_reader(io.BytesIO(written[3])).iter_messages([topic])]
    touched = decode("visualization_msgs/MarkerArray", messages[4])["markers"][1]
    assert touched["ns"] == "touched" and touched["colors"].dtype == np.float32
    assert touched["colors"].shape == (len(touched["points"]), 4)


def test_saved_layout_names_topics_and_fields_of_the_file():
    """Every panel is in the layout; a path of another field would show nothing."""
    layout = json.loads(LAYOUT.read_text("utf-8"))
    panels = layout["configById"]
    found, left = set(), [layout["layout"]]
    while left:
        part = left.pop()
        if isinstance(part, str):
            found.add(part)
        else:
            left += [part["first"], part["second"]]
    assert found == set(panels)
    prefix = topic_of("sample_wrist", "")
    assert set(panels["3D!skin"]["topics"]) == {f"{prefix}cells", f"{prefix}scene"}
    assert {f"{prefix}{name}" for name in ("cells", "scene", "frame")} <= {prefix + name for name in McapView.topics}
    paths = [path["value"] for panel in panels.values() for path in panel.get("paths", ())]
    for path in [*paths, panels["RawMessages!flags"]["topicPath"]]:
        topic, *names = path.replace("[:]", "").split(".")
        kind = {f"{prefix}frame": "skin_calib_msgs/SkinFrame"}[topic]
        for name in names:
            assert kind not in PRIMITIVES
            (kind,) = [field.kind for field in fields_of(kind) if field.name == name]
