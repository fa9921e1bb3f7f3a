"""Settings of all tests: no clock decides, and arithmetic that goes wrong is an error, not a warning."""

import os
import sys
from pathlib import Path

import pytest
from hypothesis import settings

from tests.examples import FULL

os.environ.setdefault("MUJOCO_GL", "egl")  # as biped.py does, before any test imports mujoco: without a display

settings.register_profile("quick", deadline=None, max_examples=8, derandomize=True)
settings.register_profile("full", deadline=None, max_examples=FULL, derandomize=True)
settings.register_profile("explore", deadline=None, max_examples=1000)
settings.load_profile("quick")


def pytest_configure(config):
    """A user would see such a warning on stderr, where one line is promised."""
    config.addinivalue_line("filterwarnings", "error::RuntimeWarning")


@pytest.fixture(scope="module")
def benchmarks():
    """The scripts of the folder of this name can be imported."""
    folder = str(Path(__file__).parents[1] / "benchmarks")
    sys.path.insert(0, folder)
    yield
    sys.path.remove(folder)
