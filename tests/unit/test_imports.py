"""Who may import whom: the architecture, read from the source."""

import ast
import os
import re
import subprocess
import sys
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
OURS = "skin_calib_addon"
BLENDER = {"bpy", "bpy_extras", "bmesh", "gpu", "gpu_extras", "mathutils", "blf"}

# What each package may import besides itself and ``common``. Runtime code needs NumPy alone.
FILE = ("calibration",)
CORE = ("geometry", "calibration", "skin")
MAY_IMPORT = {
    "": (),
    "common": (),
    "geometry": (),
    "calibration": (),
    "skin": ("geometry", *(f"calibration.{m}" for m in ("model", "exchange.taxel_set"))),
    "runtime": FILE,
    "validation": FILE,
    "plan": CORE,
    "robot": (*CORE, "plan"),
    "pipeline": (*CORE, "", "validation", "plan", "robot"),
    "proposal": (*CORE, "plan", "robot", "pipeline"),
    "inspection": (*CORE, "runtime"),
    "pictures": (*CORE, "validation", "runtime", "plan", "pipeline"),
    "commands": (*CORE, "validation", "runtime", "plan", "pipeline", "robot", "proposal", "inspection", "pictures"),
    "cli": ("", "commands"),
    "__main__": ("cli",),
    "blender": (
        *(*CORE, "validation", "runtime", "plan", "pipeline", "robot", "proposal", "inspection", "pictures", "cli"),
    ),
}
# Inside these packages a subpackage imports itself and what stands before it.
ORDER = {
    "geometry": ("mesh", "surface", "sampling", "grid", "fit"),
    "skin": ("sheet", "boards"),
    "blender": ("scene", "overlay", "inspection", "live", "handles", "properties"),
}
LIBRARIES = {
    "geometry": {"numpy", "scipy", "trimesh", "igl", "collada", "threadpoolctl"},
    "skin": {"numpy", "scipy"},
    "pipeline": {"numpy", "scipy", "trimesh"},
    "robot": {"numpy", "mujoco"},
    "proposal": {"numpy", "scipy"},
    "inspection": {"numpy", "scipy"},
    "pictures": {"numpy", "matplotlib"},
    "blender": {"numpy", *BLENDER},
}  # the others need NumPy alone

# The package of control: of ours it imports the runtime's names in ``__all__``, and the modules of this page.
CONTROL = "control/skin_control"
PAGE_OF_MODULES = Path("docs/reference/python/runtime_modules.md")
# Its experiments also calibrate their robots, and write models of them.
FOR_EXPERIMENTS = {f"{OURS}.{m}" for m in ("calibration", "calibration.exchange.mjcf", "pipeline", "plan", "cli")}


@dataclass(frozen=True)
class Import:
    """One imported module as it stands in a file."""

    path: str  # of the file, from the root
    line: int
    name: str  # absolute; our own from ``skin_calib_addon`` on
    relative: bool

    def __str__(self):
        return f"{self.path}:{self.line} imports {self.name}"


def sources(root):
    """Every Python file of the extension, from the root."""
    yield from (p for p in (root / "__init__.py",) if p.exists())
    for folder in (OURS, "operators", "panels"):
        yield from sorted((root / folder).rglob("*.py"))


@cache
def nodes_of(text):
    """All nodes of a source; several rules ask for them."""
    return list(ast.walk(ast.parse(text)))


def imports(root, path):
    """All imports of a file, also those inside functions and under ``TYPE_CHECKING``."""
    shown = path.relative_to(root)
    package = shown.with_suffix("").parts[:-1]
    for node in nodes_of(path.read_text("utf-8")):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield Import(shown.as_posix(), node.lineno, alias.name, False)
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else ()
            module = (*base, *(node.module or "").split(".")) if node.module else base
            for alias in node.names:
                here = root.joinpath(*module, alias.name)
                is_module = node.level and (here.is_dir() or here.with_suffix(".py").is_file())
                yield Import(
                    shown.as_posix(),
                    node.lineno,
                    ".".join((*module, alias.name) if is_module else module),
                    node.level > 0,
                )


def part_of(path):
    """The part of the package that a file belongs to, as it is named in the tables above."""
    inner = Path(path).relative_to(OURS).with_suffix("")
    return "" if inner.as_posix() == "__init__" else inner.parts[0]


def is_ours(name):
    """Whether a module belongs to the extension."""
    return name.split(".")[0] in (OURS, "operators", "panels")


def may_import(path, name):
    """Whether a file of the pure package may import one of our modules."""
    part = part_of(path)
    allowed = (*MAY_IMPORT[part], *((part, "common") if part else ()))
    inner = name.removeprefix(OURS).removeprefix(".")
    return any(inner == a or (a and inner.startswith(a + ".")) for a in allowed)


def subpackage_of(name):
    """Package and subpackage of a module, each None where it has none."""
    parts = name.removeprefix(f"{OURS}.").split(".")
    rooms = ORDER.get(parts[0], ())
    return parts[0], rooms.index(parts[1]) if len(parts) > 1 and parts[1] in rooms else None


def blender_offenders(root):
    """Blender's modules outside of the places that talk to Blender."""
    for path in sources(root):
        shown = path.relative_to(root).as_posix()
        if not shown.startswith((f"{OURS}/blender/", "operators/", "panels/")):
            yield from (str(i) for i in imports(root, path) if i.name.split(".")[0] in BLENDER)


def absolute_offenders(root):
    """Absolute imports of our own code: Blender loads us under another name."""
    for path in sources(root):
        yield from (str(i) for i in imports(root, path) if is_ours(i.name) and not i.relative)


def layer_offenders(root):
    """Imports against the layers."""
    for path in sources(root):
        shown = path.relative_to(root).as_posix()
        for i in imports(root, path):
            top = i.name.split(".")[0]
            if shown.startswith(f"{OURS}/"):
                allowed = top == OURS and may_import(shown, i.name)
            else:  # operators and panels import themselves, and all of the package
                allowed = top in (OURS, shown.split("/")[0])
            if is_ours(i.name) and not allowed:
                yield str(i)


def order_offenders(root):
    """Imports of a later subpackage of the same package, or of its loose modules by an earlier subpackage's."""
    for path in sources(root):
        here = (
            subpackage_of(".".join(path.relative_to(root / OURS).with_suffix("").parts)) if OURS in path.parts else None
        )
        if here is None or here[1] is None:
            continue
        for i in imports(root, path):
            package, subpackage = subpackage_of(i.name)
            if is_ours(i.name) and package == here[0] and subpackage is not None and subpackage > here[1]:
                yield str(i)


def circles(root):
    """Modules that import each other in a circle, also inside functions; each circle as its modules, sorted."""
    graph = {}
    for path in sources(root):
        name = ".".join(path.relative_to(root).with_suffix("").parts).removesuffix(".__init__")
        graph[name] = {i.name for i in imports(root, path) if is_ours(i.name) and i.relative} - {name}

    def found(start):
        seen, todo = set(), list(graph.get(start, ()))
        while todo:
            name = todo.pop()
            if name not in seen:
                seen.add(name)
                todo += graph.get(name, ())
        return seen

    return sorted(name for name in graph if name in found(name))


def library_offenders(root):
    """Libraries that a part does without."""
    for path in sources(root):
        shown = path.relative_to(root).as_posix()
        if not shown.startswith(f"{OURS}/"):
            continue
        allowed = LIBRARIES.get(part_of(shown), {"numpy"})
        for i in imports(root, path):
            library = i.name.split(".")[0]
            if not is_ours(i.name) and library not in sys.stdlib_module_names and library not in allowed:
                yield str(i)


def eager_offenders(root):
    """Imports of the root ``__init__`` and of the package's while they are loaded: plain Python must pass by."""
    for path in (root / "__init__.py", root / OURS / "__init__.py"):
        tree = ast.parse(path.read_text("utf-8"))
        for node in tree.body:
            if isinstance(node, (ast.Import, ast.ImportFrom)):
                yield f"{path.relative_to(root)}:{node.lineno}"


def control_offenders(root):
    """Imports of control that are not public, and libraries that its package does without."""
    page, runtime = root / PAGE_OF_MODULES, root / OURS / "runtime" / "__init__.py"
    public = (
        re.findall(rf"^::: ({OURS}\.runtime\.\w+)$", page.read_text("utf-8"), re.MULTILINE) if page.exists() else []
    )
    public += [f"{OURS}.runtime.{n.value}" for n in nodes_of(runtime.read_text("utf-8")) if isinstance(n, ast.Constant)]
    for path in sorted([*(root / CONTROL).rglob("*.py"), *(root / "control" / "examples").rglob("*.py")]):
        is_package = path.is_relative_to(root / CONTROL)
        for node in nodes_of(path.read_text("utf-8")):
            if isinstance(node, ast.Import):
                found = [(alias.name, alias.name) for alias in node.names]
            elif isinstance(node, ast.ImportFrom) and not node.level:
                found = [(node.module, f"{node.module}.{alias.name}") for alias in node.names]
            else:
                continue
            for module, name in found:
                top = module.split(".")[0]
                if top == OURS:
                    allowed = module in public or name in public or not is_package and module in FOR_EXPERIMENTS
                else:
                    allowed = not is_package or top == "numpy" or top in sys.stdlib_module_names
                if not allowed:
                    yield f"{path.relative_to(root).as_posix()}:{node.lineno} imports {name}"


RULES = [
    blender_offenders,
    absolute_offenders,
    layer_offenders,
    order_offenders,
    circles,
    library_offenders,
    eager_offenders,
    control_offenders,
]


@pytest.mark.parametrize("rule", RULES)
def test_imports_keep_the_layers(rule):
    """No file imports what it must not; the offenders are listed as file:line."""
    assert list(rule(ROOT)) == []


def test_sources_are_all_there():
    """The rules above read every file of the extension, and know where each belongs."""
    shown = {p.relative_to(ROOT).as_posix() for p in sources(ROOT)}
    assert {
        "__init__.py",
        "operators/__init__.py",
        f"{OURS}/runtime/skin.py",
        f"{OURS}/blender/scene/plans.py",
    } <= shown
    parts = {part_of(s) for s in shown if s.startswith(OURS)}
    assert parts == {*MAY_IMPORT}


OFFENCES = [
    ("geometry/fit/auto.py", "import bpy", {blender_offenders, library_offenders}),
    ("geometry/fit/auto.py", "from skin_calib_addon.common.arrays import unit", {absolute_offenders}),
    ("geometry/fit/auto.py", "import skin_calib_addon.skin", {absolute_offenders, layer_offenders}),
    ("skin/sheet/wrap.py", "from ...calibration.validate import validate", {layer_offenders}),
    ("runtime/skin.py", "from ..skin.lattice import CENTRE", {layer_offenders}),
    ("runtime/skin.py", "def f():\n    import scipy", {library_offenders}),
    ("plan/plan.py", "from .. import cli", {layer_offenders}),
    ("blender/scene/plans.py", "from ....operators import fit", {layer_offenders}),
    ("skin/sheet/wrap.py", "from ...calibration.model import TaxelArray\nfrom ...geometry import mesh", set()),
    ("geometry/mesh/cover.py", "from ..sampling.rays import TURN", {order_offenders}),
    ("../__init__.py", "import bpy", {blender_offenders, eager_offenders}),
    ("../__init__.py", "def register():\n    from .skin_calib_addon.blender import registration", set()),
    ("../operators/fit.py", "from ..panels import skin", {layer_offenders}),
    ("../panels/skin.py", "from skin_calib_addon.plan import Plan", {absolute_offenders}),
    ("../control/skin_control/cone.py", "from skin_calib_addon.runtime.wrench import about\nimport numpy", set()),
    ("../control/skin_control/cone.py", "from skin_calib_addon.runtime import plane", {control_offenders}),
    ("../control/skin_control/cone.py", "def f():\n    import scipy", {control_offenders}),
    ("../control/examples/biped.py", "import mujoco\nfrom skin_calib_addon.pipeline import calibrate", set()),
]


PLACES = ("geometry/mesh/cover", "geometry/sampling/rays", "geometry/fit/auto", "skin/lattice", "skin/sheet/wrap")
PLACES += ("calibration/model", "plan/plan", "cli", "common/arrays", "runtime/skin", "blender/scene/plans", "__init__")
PLACES += (
    "../__init__",
    "../operators/fit",
    "../panels/skin",
    "../control/skin_control/cone",
    "../control/examples/biped",
)


@pytest.mark.parametrize(("path", "code", "broken"), OFFENCES)
def test_each_rule_fires(tmp_path, path, code, broken):
    """An offence in a house of its own is found by the rules that it breaks, at its line, and by no other."""
    for place in PLACES:
        file = tmp_path / OURS / f"{place}.py"
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text("")
    (tmp_path / OURS / "runtime" / "__init__.py").write_text('__all__ = ["Polygon"]')
    (tmp_path / PAGE_OF_MODULES).parent.mkdir(parents=True)
    (tmp_path / PAGE_OF_MODULES).write_text("::: skin_calib_addon.runtime.wrench\n")
    (tmp_path / OURS / path).write_text(code)
    found = {rule: list(rule(tmp_path)) for rule in RULES}
    assert {rule for rule, offenders in found.items() if offenders} == broken
    shown = (Path(OURS) / path).as_posix().removeprefix(f"{OURS}/../")
    line = code.count("\n") + 1
    assert all(o.startswith(f"{shown}:{line}") for offenders in found.values() for o in offenders)


def test_a_circle_is_found(tmp_path):
    """Two modules that import each other, one of them inside a function."""
    for name, code in (("a", "from .b import f"), ("b", "def f():\n    from . import a"), ("c", "from . import a")):
        (tmp_path / OURS).mkdir(exist_ok=True)
        (tmp_path / OURS / f"{name}.py").write_text(code)
    assert circles(tmp_path) == [f"{OURS}.a", f"{OURS}.b"]


@pytest.mark.parametrize(
    ("statement", "absent"),
    [
        ("import skin_calib_addon", "numpy scipy trimesh matplotlib bpy"),
        ("import skin_calib_addon.runtime", "scipy trimesh matplotlib bpy"),
        ("from skin_calib_addon.runtime import load; load(PATH)", "scipy trimesh matplotlib bpy"),
        ("import skin_calib_addon.calibration", "scipy trimesh matplotlib bpy"),
        ("from skin_calib_addon.cli import build_parser; build_parser(())", "numpy matplotlib bpy"),
        ("from skin_calib_addon.cli import build_parser; build_parser(['check'])", "scipy trimesh matplotlib bpy"),
        ("import skin_calib_addon.commands.fit", "scipy.optimize scipy.interpolate trimesh matplotlib bpy"),
    ],
)
def test_imports_bring_only_what_is_needed(tmp_path, statement, absent):
    """In a fresh process: a controller, and reading a file with it, needs NumPy only; commands start quickly."""
    from skin_calib_addon.calibration import save_calibration
    from tests.samples import small_calibration

    save_calibration(small_calibration(), tmp_path / "c.json")
    code = f"PATH = {str(tmp_path / 'c.json')!r}\n{statement}\n"
    code += f"import sys; print(*(set({absent.split()}) & set(sys.modules)))"
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=environment, cwd=tmp_path)
    assert (done.returncode, done.stdout, done.stderr) == (0, "\n", "")
