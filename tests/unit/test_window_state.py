"""Modules of the window keep no state of links: it would outlive undo, another name and another file."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
MUTABLE = (ast.List, ast.Dict, ast.Set, ast.ListComp, ast.DictComp, ast.SetComp)
MADE = {"list", "dict", "set", "defaultdict", "deque", "OrderedDict"}
# What modules keep nevertheless, and why it can show no link what belongs to another one.
ALLOWED = {
    "blender/registration.py: _modules": "of the extension",
    "blender/command.py: _commands": "of the extension",
    "blender/overlay/drawing.py: _handles": "of the extension",
    "blender/overlay/drawing.py: _cached": "by a token that undo restores on the link",
    "blender/inspection/replay.py: messages": "by a token that undo restores on the link",
    "blender/inspection/replay.py: _replays": "by a token that undo restores on the link",
    "blender/scene/results.py: _results": "by a hash of plan and mesh",
    "blender/scene/results.py: _seen": "by a hash of the mesh",
    "operators/link.py: _choices": "of the search that is open",
    "operators/files.py: _reading": "of the file that is read",
}


def kept(name, text):
    """Yield what a module keeps and can change: its containers, and what its functions assign."""
    for node in ast.parse(text).body:
        targets = node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", None)]
        value = getattr(node, "value", None)
        made = isinstance(value, ast.Call) and getattr(value.func, "id", "") in MADE
        for target in targets:
            if isinstance(target, ast.Name) and target.id.islower() and (isinstance(value, MUTABLE) or made):
                yield f"{name}: {target.id}"
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Global):
            yield from (f"{name}: {variable}" for variable in node.names)


def test_modules_of_the_window_keep_no_state_of_links():
    """Only what is listed above; a new entry needs a reason."""
    folders = (ROOT / "skin_calib_addon" / "blender", ROOT / "operators", ROOT / "panels")
    files = [(path.relative_to(folder.parent).as_posix(), path) for folder in folders for path in folder.rglob("*.py")]
    assert sorted(found for name, path in files for found in kept(name, path.read_text("utf-8"))) == sorted(ALLOWED)


@pytest.mark.parametrize("text", ["seen: dict[str, int] = {}", "seen = set()", "def f():\n    global seen"])
def test_state_is_found(text):
    """Containers and assigned variables are, constants are not."""
    assert list(kept("a.py", f"{text}\nNAMES = {{}}\nfound = tuple()")) == ["a.py: seen"]
