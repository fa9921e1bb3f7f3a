"""Texts of the panels are not cut off in a narrow sidebar."""

import ast

import pytest

from tests.blender.conftest import ROOT

# Words of a text that is drawn in one line, with what it is drawn by; longer ones are broken into lines.
MAX_WORDS = 2


def texts(source):
    """Yield line, method and number of words of each text that a layout draws in one line."""
    for call in ast.walk(ast.parse(source)):
        if isinstance(call, ast.Call) and getattr(call.func, "attr", "") in ("label", "operator"):
            for given in call.keywords:
                if given.arg == "text":
                    yield call.lineno, call.func.attr, len(written(given.value).split())


def written(node):
    """Return the longest text of an expression; a value in it is one word."""
    if isinstance(node, ast.IfExp):
        return max(written(node.body), written(node.orelse), key=len)
    if isinstance(node, ast.JoinedStr):
        return "".join(part.value if isinstance(part, ast.Constant) else "x" for part in node.values)
    return str(node.value) if isinstance(node, ast.Constant) else "x"


@pytest.mark.parametrize("path", sorted((ROOT / "panels").glob("*.py")), ids=lambda path: path.stem)
def test_sentence_is_broken_at_the_width_of_the_sidebar(path):
    """A label or button with more than two words is drawn by ``show_text`` or ``button``."""
    if path.stem == "menus":  # as wide as their texts
        return
    found = [(line, kind) for line, kind, words in texts(path.read_text()) if words > MAX_WORDS]
    assert found == [], f"{path.name}: draw these texts with show_text or button: {found}"


def test_rule_sees_a_sentence():
    """It counts words of texts and of formatted values."""
    source = 'layout.label(text="Fit the link")\nlayout.label(text=f"It {wrong}")\nlayout.operator("a", text="Show")'
    assert [words for *_, words in texts(source)] == [3, 2, 1]
