"""The scripts in examples/control/ as modules."""

import sys
from pathlib import Path

import pytest

FOLDER = Path(__file__).parents[3] / "examples" / "control"
MODULES = {path.stem for path in FOLDER.glob("*.py")}


@pytest.fixture
def scripts(monkeypatch):
    """The scripts import each other, as they do when Python runs one of them."""
    kept = {name: sys.modules.pop(name) for name in MODULES & sys.modules.keys()}
    monkeypatch.syspath_prepend(str(FOLDER))
    yield
    for name in MODULES & sys.modules.keys():
        del sys.modules[name]
    sys.modules.update(kept)
