"""Public functions with several arguments document them."""

import ast
from pathlib import Path

ROOT = Path(__file__).parents[2]
PACKAGES = ("skin_calib_addon",)
DOCUMENTED = 0.95  # fraction of the public functions with two or more arguments that have a section "Parameters"


def public_functions(path):
    """Public functions and methods of a file that take two or more arguments, and their docstrings."""

    def walk(node, is_public):
        for child in ast.iter_child_nodes(node):
            if isinstance(child, ast.ClassDef):
                yield from walk(child, is_public and not child.name.startswith("_"))
            elif isinstance(child, ast.FunctionDef) and is_public and not child.name.startswith("_"):
                a = child.args
                names = [x.arg for x in (*a.posonlyargs, *a.args, *a.kwonlyargs, a.vararg, a.kwarg) if x]
                if len([name for name in names if name not in ("self", "cls")]) >= 2:
                    yield child.name, child.lineno, ast.get_docstring(child) or ""

    yield from walk(ast.parse(path.read_text("utf-8")), True)


def test_public_functions_document_their_parameters():
    """With shapes, units and frames; ruff checks that each argument is there (D417)."""
    total, missing = 0, []
    for path in sorted(p for package in PACKAGES for p in (ROOT / package).rglob("*.py")):
        for name, line, docstring in public_functions(path):
            total += 1
            if "Parameters\n---" not in docstring:
                missing.append(f"{path.relative_to(ROOT)}:{line} {name}")
    assert total > 300 and len(missing) <= (1 - DOCUMENTED) * total, "\n".join(missing)


def test_missing_section_is_found(tmp_path):
    """Private functions and those with one argument do not count, methods do."""
    path = tmp_path / "a.py"
    path.write_text(
        "def f(a, b): 'x'\ndef _g(a, b): 0\ndef h(a): 0\n"
        "class A:\n    def m(self, a, *, b): 'y'\n    def n(self, a): 0\nclass _B:\n    def m(self, a, b): 0\n"
    )
    assert [(name, text) for name, _, text in public_functions(path)] == [("f", "x"), ("m", "y")]
