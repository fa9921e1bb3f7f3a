"""Who may import whom: the architecture, read from the source."""

import ast
import os
import re
import subprocess
import sys
from functools import cache
from pathlib import Path
from typing import NamedTuple

import pytest

ROOT = Path(__file__).parents[2]
OURS = "skin_calib_addon"
BLENDER = {"bpy", "bpy_extras", "bmesh", "gpu", "gpu_extras", "mathutils", "blf", "bl_operators"}

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
    "messages": ("", *FILE, "runtime"),
    "validation": (*FILE, *(f"robot.{m}" for m in ("urdf", "kinematics"))),
    "plan": CORE,
    "robot": (*CORE, "plan"),
    "pipeline": (*CORE, "", "validation", "plan", "robot"),
    "proposal": (*CORE, "plan", "robot", "pipeline"),
    "inspection": (*CORE, "validation", "runtime", "messages"),
    "live": (*FILE, "runtime", "messages", "inspection.recording"),
    "pictures": (*CORE, "validation", "runtime", "plan", "pipeline", "proposal"),
    "commands": (
        *CORE,
        "validation",
        "runtime",
        "messages",
        "plan",
        "pipeline",
        "robot",
        "proposal",
        "inspection",
        "live",
        "pictures",
    ),
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
    "validation": {"numpy", "scipy"},
    "robot": {"numpy", "mujoco"},
    "proposal": {"numpy", "scipy"},
    "inspection": {"numpy", "scipy"},
    "messages": {"numpy", "mcap", "rerun"},
    "live": {"numpy", "cyclonedds", "serial"},
    "pictures": {"numpy", "matplotlib"},
    "blender": {"numpy", *BLENDER},
}  # the others need NumPy alone

# The package of control: of ours it imports the runtime's names in ``__all__``, and the modules of this page.
PAGE_OF_MODULES = Path("docs/reference/python/runtime_modules.md")
# Its experiments also calibrate their robots, and write models of them.
FOR_EXPERIMENTS = {f"{OURS}.{m}" for m in ("calibration", "calibration.exchange.mjcf", "pipeline", "plan", "cli")}


class Import(NamedTuple):
    """One imported module as it stands in a file."""

    place: str  # file:line, from the root
    name: str  # absolute; our own from ``skin_calib_addon`` on
    member: str  # what is imported from it, if anything
    is_relative: bool

    def __str__(self):
        return f"{self.place} imports {self.member or self.name}"


def sources(root):
    """Every Python file of the extension, from the root, with its path as the rules name it."""
    paths = [
        root / "__init__.py",
        *(p for f in (OURS, "operators", "panels") for p in sorted((root / f).rglob("*.py"))),
    ]
    return [(path, path.relative_to(root).as_posix()) for path in paths if path.exists()]


@cache
def tree_of(text):
    """The syntax tree of a source; several rules ask for it."""
    return list(ast.walk(ast.parse(text)))


@cache
def imports(root, path):
    """All imports of a file, also those inside functions and under ``TYPE_CHECKING``."""
    return tuple(found_imports(root, path))


def found_imports(root, path):
    """Find them one by one."""
    shown = path.relative_to(root)
    package = shown.with_suffix("").parts[:-1]
    for node in tree_of(path.read_text("utf-8")):
        if isinstance(node, ast.Import):
            yield from (Import(f"{shown}:{node.lineno}", alias.name, "", False) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else ()
            module = (*base, *(node.module or "").split(".")) if node.module else base
            for alias in node.names:
                here, member = root.joinpath(*module, alias.name), ".".join((*module, alias.name))
                is_module = node.level and (here.is_dir() or here.with_suffix(".py").is_file())
                name = member if is_module else ".".join(module)
                yield Import(f"{shown}:{node.lineno}", name, member, node.level > 0)


def part_of(shown):
    """The part of the package that a file belongs to, as it is named in the tables above."""
    inner = Path(shown).relative_to(OURS).with_suffix("")
    return "" if inner.as_posix() == "__init__" else inner.parts[0]


def is_ours(name):
    """Whether a module belongs to the extension."""
    return name.split(".")[0] in (OURS, "operators", "panels")


def may_import(shown, name):
    """Whether a file may import one of our modules; operators and panels import themselves, and all of the package."""
    if not shown.startswith(f"{OURS}/"):
        return name.split(".")[0] in (OURS, shown.split("/")[0])
    part = part_of(shown)
    allowed = (*MAY_IMPORT[part], *((part, "common") if part else ()))
    inner = name.removeprefix(OURS).removeprefix(".")
    return name.startswith(OURS) and any(inner == a or (a and inner.startswith(a + ".")) for a in allowed)


def subpackage_of(name):
    """Package of a module, and the place of its subpackage in ``ORDER``; -1 without one."""
    package, *inner = name.removeprefix(f"{OURS}.").split(".")
    inside = ORDER.get(package, ())
    return package, inside.index(inner[0]) if inner and inner[0] in inside else -1


def absolute_offenders(root):
    """Absolute imports of our own code: Blender loads us under another name."""
    return [i for path, _ in sources(root) for i in imports(root, path) if is_ours(i.name) and not i.is_relative]


def layer_offenders(root):
    """Imports against the layers, and of a later subpackage of the same package by an earlier one."""
    for path, shown in sources(root):
        package, place = subpackage_of(shown.removesuffix(".py").replace("/", "."))
        for i in imports(root, path):
            if is_ours(i.name):
                other, other_place = subpackage_of(i.name)
                if not may_import(shown, i.name) or (package == other and 0 <= place < other_place):
                    yield i


def circles(root):
    """Modules that import each other in a circle, also inside functions."""
    graph = {}
    for path, shown in sources(root):
        name = shown.removesuffix(".py").replace("/", ".").removesuffix(".__init__")
        graph[name] = {i.name for i in imports(root, path) if is_ours(i.name) and i.is_relative} - {name}
    for start in graph:
        seen, todo = set(), list(graph[start])
        while todo:
            name = todo.pop()
            if name not in seen:
                seen.add(name)
                todo += graph.get(name, ())
        if start in seen:
            yield start


def library_offenders(root):
    """Libraries that a part does without."""
    for path, shown in sources(root):
        is_pure = shown.startswith(f"{OURS}/")
        allowed = LIBRARIES.get(part_of(shown), {"numpy"}) if is_pure else LIBRARIES["blender"]
        for i in imports(root, path):
            library = i.name.split(".")[0]
            if not is_ours(i.name) and library not in sys.stdlib_module_names and library not in allowed:
                yield i


def eager_offenders(root):
    """Imports of the root ``__init__`` and of the package's while they are loaded: plain Python must pass by."""
    for path in (root / "__init__.py", root / OURS / "__init__.py"):
        for node in ast.parse(path.read_text("utf-8")).body:
            if isinstance(node, (ast.Import, ast.ImportFrom)):
                yield f"{path.relative_to(root)}:{node.lineno}"


def control_offenders(root):
    """Imports of control that are not public, and libraries that its package does without."""
    page, runtime = root / PAGE_OF_MODULES, root / OURS / "runtime" / "__init__.py"
    public = (
        re.findall(rf"^::: ({OURS}\.runtime\.\w+)$", page.read_text("utf-8"), re.MULTILINE) if page.exists() else []
    )
    public += [f"{OURS}.runtime.{n.value}" for n in tree_of(runtime.read_text("utf-8")) if isinstance(n, ast.Constant)]
    for folder in ("skin_control", "examples"):
        for path in sorted((root / "control" / folder).rglob("*.py")):
            for i in imports(root, path):
                top, is_package = i.name.split(".")[0], folder == "skin_control"
                if top == OURS:
                    allowed = {i.name, i.member} & {*public} or not is_package and i.name in FOR_EXPERIMENTS
                else:
                    allowed = i.is_relative or not is_package or top == "numpy" or top in sys.stdlib_module_names
                if not allowed:
                    yield i


RULES = [absolute_offenders, layer_offenders, circles, library_offenders, eager_offenders, control_offenders]


@pytest.mark.parametrize("rule", RULES)
def test_imports_keep_the_layers(rule):
    """No file imports what it must not; the offenders are listed as file:line."""
    assert list(map(str, rule(ROOT))) == []


def test_tables_name_every_part():
    """The rules above know where each file of the extension belongs."""
    assert {part_of(shown) for _, shown in sources(ROOT) if shown.startswith(OURS)} == {*MAY_IMPORT}


CONTROL = "../control/skin_control/cone.py"
OFFENCES = [
    ("geometry/fit/auto.py", "import bpy", {library_offenders}),
    ("geometry/fit/auto.py", "from skin_calib_addon.common.arrays import unit", {absolute_offenders}),
    ("skin/sheet/wrap.py", "from ...calibration.validate import validate", {layer_offenders}),
    ("skin/sheet/wrap.py", "from ...calibration.model import TaxelArray\nfrom ...geometry import mesh", set()),
    ("runtime/skin.py", "def f():\n    import scipy", {library_offenders}),
    ("geometry/mesh/cover.py", "from ..sampling.rays import TURN", {layer_offenders}),
    ("../__init__.py", "import bpy", {eager_offenders}),
    ("../__init__.py", "def register():\n    from .skin_calib_addon.blender import registration", set()),
    ("../operators/fit.py", "from ..panels import skin", {layer_offenders}),
    (CONTROL, "from skin_calib_addon.runtime.wrench import about\nimport numpy", set()),
    (CONTROL, "from skin_calib_addon.runtime import plane", {control_offenders}),
    (CONTROL, "def f():\n    import scipy", {control_offenders}),
    ("../control/examples/biped.py", "import mujoco\nfrom skin_calib_addon.pipeline import calibrate", set()),
]


@pytest.mark.parametrize(("path", "code", "broken"), OFFENCES)
def test_each_rule_fires(tmp_path, path, code, broken):
    """An offence in a house of its own is found by the rules that it breaks, at its line, and by no other."""
    places = (path, "../__init__.py", "__init__.py", "../panels/skin.py", "geometry/mesh/defects.py")
    for place in places:
        file = tmp_path / OURS / place
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text("")
    (tmp_path / OURS / "runtime").mkdir(exist_ok=True)
    (tmp_path / OURS / "runtime" / "__init__.py").write_text('__all__ = ["Polygon"]')
    (tmp_path / PAGE_OF_MODULES).parent.mkdir(parents=True)
    (tmp_path / PAGE_OF_MODULES).write_text("::: skin_calib_addon.runtime.wrench\n")
    (tmp_path / OURS / path).write_text(code)
    found = {rule: list(map(str, rule(tmp_path))) for rule in RULES}
    assert {rule for rule, offenders in found.items() if offenders} == broken
    shown = (Path(OURS) / path).as_posix().removeprefix(f"{OURS}/../")
    line = code.count("\n") + 1
    assert all(o.startswith(f"{shown}:{line}") for offenders in found.values() for o in offenders)


def test_a_circle_is_found(tmp_path):
    """Two modules that import each other, one of them inside a function."""
    for name, code in (("a", "from .b import f"), ("b", "def f():\n    from . import a"), ("c", "from . import a")):
        (tmp_path / OURS).mkdir(exist_ok=True)
        (tmp_path / OURS / f"{name}.py").write_text(code)
    assert list(circles(tmp_path)) == [f"{OURS}.a", f"{OURS}.b"]


@pytest.mark.parametrize(
    ("statement", "absent"),
    [
        ("import skin_calib_addon", "numpy scipy trimesh matplotlib bpy"),
        ("from skin_calib_addon.runtime import load; load(PATH)", "scipy trimesh matplotlib bpy"),
        ("from skin_calib_addon.cli import build_parser; build_parser(())", "numpy matplotlib bpy"),
        ("from skin_calib_addon.cli import build_parser; build_parser(['check'])", "scipy trimesh matplotlib bpy"),
        (
            "from skin_calib_addon.cli import build_parser; build_parser(['run'])",
            "scipy trimesh mcap cyclonedds serial",
        ),
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
