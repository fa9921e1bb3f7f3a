"""A recording over the skin: forces, contacts, CoP and polygons follow the frame; a timer plays it."""

from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from tests.blender.conftest import ROOT, modules
from tests.blender.test_inspect import by_name


@pytest.fixture
def ours(extension, bpy):
    """Return modules of the running extension."""
    return modules(extension, "overlay.drawing", "inspection.replay", "scene.results", "registration")


@pytest.fixture
def record(tmp_path):
    """Return a function that writes a recording of six taxels: a press of at least 1 N moves from one to the next."""

    def write(frames=6, channels=6, step=0.1):
        rows = [[k * step, *((k + 1.0) * (c == k % channels) for c in range(channels))] for k in range(frames)]
        path = tmp_path / "press.csv"
        head = ",".join(["time", *(f"c{c}" for c in range(channels))])
        path.write_text("\n".join([head, *(",".join(map(str, row)) for row in rows)]) + "\n")
        return str(path)

    return write


@pytest.fixture
def shown(bpy, link, record):
    """Return a fitted link with a recording."""
    bpy.ops.skin_calib.fit()
    bpy.ops.skin_calib.replay_open(filepath=record())
    return bpy.context.object


def drawn(ours, link):
    """Return the drawn layers of a link by name."""
    return by_name(ours.drawing.shown_layers(link))


def pressed(ours, link):
    """Return which cells do not have the colour of zero force."""
    layer = drawn(ours, link)["FORCE"]
    colours = layer.colours[:: len(layer.colours) // 6]
    return np.flatnonzero((np.abs(colours - layer.legend.colours(np.zeros(1))) > 0.01).any(axis=1)).tolist()


def test_cells_show_the_forces_of_the_frame(bpy, ours, shown):
    """The complete recording has one scale; the contact has an outline."""
    record = shown.skin_calib.inspect.replay
    assert shown.skin_calib.inspect.heat == "FORCE" and pressed(ours, shown) == [0]
    record.frame = 3
    layers = drawn(ours, shown)
    assert pressed(ours, shown) == [3] and layers["FORCE"].legend.maximum == 6.0
    taxels = ours.results.find(shown.skin_calib.result.key).calibration.patches[0].taxels
    assert_allclose(layers["CONTACTS"].points[::2], taxels.corners_link[3], atol=1e-7)
    assert_allclose(layers["COP"].points[4], taxels.positions_link[3], atol=1e-6)
    contacts, columns, flags = ours.replay.messages[record.token]
    assert contacts == "0.300 s: 1 contact, 4.00 N" and flags == "Flags: noise_unknown"
    assert columns == "Columns: c0 to c5 are channels 0 to 5"
    record.frame = 999
    assert record.frame == 5 and record.progress == 100
    record.progress = 41
    assert record.frame == 2 and record.progress == 40


def test_flat_skin_shows_cop_and_polygons(bpy, ours, record, tmp_path):
    """They are in the plane of the skin; with another heat map nothing of the recording is drawn."""
    bpy.ops.wm.open_mainfile(filepath=str(ROOT / "sample_scenes" / "sole.blend"))
    bpy.ops.skin_calib.fit()
    link = bpy.context.object
    path = tmp_path / "stand.csv"
    row = ",".join(["0.0", *("3.0" if c % 20 in (3, 15) else "0" for c in range(160))])
    path.write_text(",".join(["time", *(f"c{c}" for c in range(160))]) + "\n" + row + "\n")
    bpy.ops.skin_calib.replay_open(filepath=str(path))
    layers = list(ours.drawing.shown_layers(link))
    polygons = [a for a in layers if a.what == "POLYGONS"]
    taxels = ours.results.find(link.skin_calib.result.key).calibration.patches[0].taxels
    loaded = taxels.positions_link[np.isin(np.arange(160) % 20, (3, 15))]
    assert len(polygons) == 3
    low, high = polygons[1].points.min(axis=0), polygons[1].points.max(axis=0)
    assert_allclose((low[:2], high[:2]), (loaded[:, :2].min(axis=0), loaded[:, :2].max(axis=0)), atol=1e-4)
    cop = next(a for a in layers if a.what == "COP" and a.on_top).points
    assert_allclose(cop[:2].mean(axis=0)[:2], loaded[:, :2].mean(axis=0), atol=1e-3)
    assert "2 contacts, 48.00 N" in ours.replay.messages[link.skin_calib.inspect.replay.token][0]
    link.skin_calib.inspect.heat = "TILT"
    assert not {"POLYGONS", "COP", "CONTACTS", "FORCE"} & set(drawn(ours, link))


@pytest.fixture
def clock(ours, monkeypatch):
    """Return a clock that the test sets."""
    now = SimpleNamespace(seconds=100.0)
    monkeypatch.setattr(ours.replay, "perf_counter", lambda: now.seconds)
    return now


def test_timer_plays_at_the_given_speed(bpy, ours, shown, clock):
    """Playback starts at the displayed frame, and continues after a change of speed or frame."""
    record = shown.skin_calib.inspect.replay
    assert bpy.ops.skin_calib.replay_play() == {"FINISHED"} and bpy.app.timers.is_registered(ours.replay.tick)
    clock.seconds += 0.25
    assert ours.replay.tick() is not None and record.frame == 2
    record.speed = 0.5
    clock.seconds += 0.25
    ours.replay.tick()
    assert record.frame == 3
    record.frame = 1
    clock.seconds += 0.21
    ours.replay.tick()
    assert record.frame == 2 and ours.replay.is_playing(shown)
    bpy.ops.skin_calib.replay_play()
    clock.seconds += 1
    assert ours.replay.tick() is None and record.frame == 2


def test_end_is_the_end_unless_it_loops(bpy, ours, shown, clock):
    """With looping it continues from the start; after the end, playback starts again."""
    record = shown.skin_calib.inspect.replay
    bpy.ops.skin_calib.replay_play()
    clock.seconds += 0.75
    ours.replay.tick()
    assert record.frame == 1
    record.loop = False
    clock.seconds += 9
    assert ours.replay.tick() is None and record.frame == 5
    bpy.ops.skin_calib.replay_play()
    assert record.frame == 0 and ours.replay.is_playing(shown)


def test_playing_ends_with_what_it_plays_on(bpy, ours, shown, clock, record):
    """Undo, another fit, removal and another file end it; another name does not."""
    bpy.ops.skin_calib.replay_play()
    bpy.ops.ed.undo_push(message="a step")
    shown.skin_calib.inspect.replay.frame = 4
    bpy.ops.ed.undo_push(message="another")
    bpy.ops.ed.undo()
    link = bpy.context.object
    assert not ours.replay.is_playing(link) and ours.replay.tick() is None
    assert pressed(ours, link) == [link.skin_calib.inspect.replay.frame]
    endings = (
        lambda: (setattr(link.skin_calib.grid, "n", 6), bpy.ops.skin_calib.fit()),
        lambda: bpy.data.objects.remove(link),
    )
    for end in endings:
        bpy.ops.skin_calib.replay_open(filepath=record())
        bpy.ops.skin_calib.replay_play()
        link.name += "2"
        assert ours.replay.tick() is not None
        end()
        assert ours.replay.tick() is None
    bpy.ops.wm.read_homefile(use_empty=True)
    assert not ours.replay._replays and not ours.replay.messages


def test_recording_of_another_fit_is_not_drawn(bpy, ours, shown):
    """Its channels can differ; the panel says to open it again."""
    shown.skin_calib.grid.n += 1
    bpy.ops.skin_calib.fit()
    assert ours.replay.find(shown) is None and "FORCE" not in drawn(ours, shown)
    assert not bpy.ops.skin_calib.replay_play.poll()


def test_close_and_undo(bpy, ours, shown):
    """A closed recording is not drawn; undo restores it."""
    bpy.ops.ed.undo_push(message="before")
    bpy.ops.skin_calib.replay_close("EXEC_DEFAULT", True)
    link = bpy.context.object
    assert link.skin_calib.inspect.heat == "NONE" and not link.skin_calib.inspect.replay.file
    assert not bpy.ops.skin_calib.replay_play.poll() and not bpy.ops.skin_calib.replay_close.poll()
    bpy.ops.ed.undo()
    link = bpy.context.object
    assert pressed(ours, link) == [0] and link.skin_calib.inspect.replay.file
