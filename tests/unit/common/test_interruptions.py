"""Interruptions are not lost, whatever a library catches."""

import signal
import threading

import numpy as np
import pytest
import trimesh

from skin_calib_addon.common.interruptions import handled
from skin_calib_addon.geometry.mesh.triangle_mesh import read_mesh
from tests.shapes import box

BOTH = pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])


@pytest.fixture(autouse=True)
def _both_raise():
    with handled(signal.default_int_handler, signal.SIGINT, signal.SIGTERM):  # background processes ignore SIGINT
        yield


@BOTH
@pytest.mark.parametrize("suffix", ["ply", "stl"])
def test_a_read_is_interrupted(tmp_path, monkeypatch, number, suffix):
    """Wherever it is: no reader catches it and goes on with a part of the mesh."""
    path, original, calls, sent_at = tmp_path / f"box.{suffix}", np.frombuffer, 0, -1

    def frombuffer(*args, **more):
        nonlocal calls
        calls += 1
        if calls == sent_at:
            signal.raise_signal(number)
        return original(*args, **more)

    mesh = box((0, 0, 0), (0.1, 0.1, 0.1))
    trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).export(path)
    monkeypatch.setattr(np, "frombuffer", frombuffer)
    read_mesh(path)
    assert calls > 0
    for k in range(1, calls + 1):
        calls, sent_at = 0, k
        with pytest.raises(KeyboardInterrupt):
            read_mesh(path)


def test_other_threads_cannot_set_handlers():
    """They do their work without."""
    done = []

    def work():
        with handled(signal.default_int_handler, signal.SIGINT):
            done.append(True)

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert done == [True]
