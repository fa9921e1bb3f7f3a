"""The scripts in control/examples/ as modules, one test file for each of them."""

import sys
from pathlib import Path

import numpy as np
import pytest

# The scripts import each other by their names; a helper of the tests is in this folder.
sys.path[:0] = [str(Path(__file__).parents[2] / "examples"), str(Path(__file__).parent)]


@pytest.fixture
def frames(monkeypatch):
    """Reads an animation: (k, height, width, 3); of each cycle that is filmed there is a frame."""
    import arm
    import experiment
    import mujoco
    import planar_arm
    from biped import PERIOD
    from PIL import Image

    try:
        mujoco.Renderer(mujoco.MjModel.from_xml_string("<mujoco/>"), 8, 8).close()
    except Exception as error:  # of any library for OpenGL
        pytest.skip(f"no pictures can be rendered here: {error}")
    for module in (experiment, arm, planar_arm):
        monkeypatch.setattr(module, "FRAME_TIME", PERIOD)

    def read(path):
        with Image.open(path) as film:
            return np.stack([np.asarray(film.convert("RGB"), int) for k in range(film.n_frames) if not film.seek(k)])

    return read


@pytest.fixture
def g1_feet(tmp_path_factory):
    """The folder with the skins proposed for the feet of the G1, made once for all tests."""
    from g1 import URDF, propose

    if not URDF.exists():
        pytest.skip(f"no real robot here: {URDF} is missing")
    folder = tmp_path_factory.getbasetemp() / "g1_feet"
    propose(URDF, folder)
    return folder
