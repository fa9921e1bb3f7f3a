"""What the pages of the Python API print is documented completely: parameters, returned values."""

import ast
from pathlib import Path

ROOT = Path(__file__).parents[2]


def printed(package):
    """Names in ``__all__`` of a package or its public definitions, with the file that defines each: (path, node)."""
    path = (ROOT / "control" if package.startswith("skin_control") else ROOT).joinpath(*package.split("."))
    module = path / "__init__.py" if path.is_dir() else path.with_suffix(".py")
    tree = ast.parse(module.read_text("utf-8"))
    for node in tree.body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef) and not node.name.startswith("_"):
            yield module, node
        if path.is_dir() and isinstance(node, ast.ImportFrom) and node.level == 1:
            names = {alias.name for alias in node.names}
            source = path.joinpath(*(node.module or "").split(".")).with_suffix(".py")
            if source.exists():
                found = ast.parse(source.read_text("utf-8")).body
                yield from ((source, n) for n in found if getattr(n, "name", None) in names)


def functions(path, node):
    """Public functions of a printed definition: itself, or the methods of a class."""
    if isinstance(node, ast.FunctionDef):
        yield path, node
    elif isinstance(node, ast.ClassDef):
        for child in node.body:
            if isinstance(child, ast.FunctionDef) and not child.name.startswith("_"):
                yield path, child


def lacks(node):
    """Sections that the docstring of a function lacks."""
    text = ast.get_docstring(node) or ""
    if not text:
        return ["docstring"]
    a = node.args
    names = [x.arg for x in (*a.posonlyargs, *a.args, *a.kwonlyargs, a.vararg, a.kwarg) if x]
    if len(set(names) - {"self", "cls"}) < 2:  # one line says it all
        return []
    has_result = not (isinstance(node.returns, ast.Constant) and node.returns.value is None)
    says_result = "return" in text.split("\n\n")[0].lower() or any(f"{w}\n---" in text for w in ("Returns", "Yields"))
    return ["Parameters"] * ("Parameters\n---" not in text) + ["Returns"] * (has_result and not says_result)


def test_printed_functions_are_documented():
    """Functions with two or more arguments have a section for these, and one for a result that no sentence states."""
    pages = [*(ROOT / "docs" / "reference" / "python").glob("*.md"), ROOT / "docs" / "control" / "python.md"]
    packages = [line.split()[1] for page in pages for line in page.read_text("utf-8").splitlines() if ":::" in line]
    found = [f for package in packages for name in printed(package) for f in functions(*name)]
    missing = [f"{path.relative_to(ROOT)}:{f.lineno} {f.name}: {', '.join(lacks(f))}" for path, f in found if lacks(f)]
    assert len(found) > 100 and not missing, "\n".join(missing)


def test_missing_section_is_found():
    """Missing sections are named; a function of one argument needs none."""
    source = "def f(a, b):\n    'x'\ndef g(a):\n    'x'\ndef h(a, b) -> None:\n    'x'\ndef k(a):\n    0"
    assert [lacks(n) for n in ast.parse(source).body] == [["Parameters", "Returns"], [], ["Parameters"], ["docstring"]]
