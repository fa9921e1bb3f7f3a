"""The documentation names every code, class of error, command and label that the package has."""

import ast
import contextlib
import os
import re
import runpy
import shlex
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from subprocess import PIPE

import numpy as np
import pytest

from skin_calib_addon import cli
from skin_calib_addon.common import errors
from tests.live.running import free_domain

ROOT = Path(__file__).resolve().parents[2]
DOCS, PACKAGE = ROOT / "docs", ROOT / "skin_calib_addon"
TROUBLES = DOCS / "troubleshooting.md"
PAGES = [ROOT / "README.md", *sorted(DOCS.rglob("*.md"))]
LIVE = DOCS / "how-to" / "ros2.md"  # a command of it ends by a signal
WITH_COMMANDS = [page for page in PAGES[1:] if page != LIVE and "```sh\nskin-calib" in page.read_text("utf-8")]
# Codes that are put together from parts.
PATTERNS = {
    "duplicate-{name}": {"duplicate-channel", "duplicate-label"},
    "not-unit-{name}s": {"not-unit-normals", "not-unit-tangents"},
    "{code}-{name}s": {"placeholder-normals", "placeholder-tangents", "missing-normals", "missing-tangents"},
}

PARTS = {"placeholder"}  # what stands in a pattern only


def code_positions(trees: list[ast.Module]) -> dict[str, int]:
    """Position of the argument ``code`` in calls of functions and classes that have one."""
    positions = {}
    for tree in trees:
        for node in ast.walk(tree):
            if isinstance(node, ast.ClassDef):
                fields = [
                    f.target.id for f in node.body if isinstance(f, ast.AnnAssign) and isinstance(f.target, ast.Name)
                ]
                makers = [f for f in node.body if isinstance(f, ast.FunctionDef) and f.name == "__init__"]
                names = [a.arg for a in makers[0].args.args[1:]] if makers else fields
            elif isinstance(node, ast.FunctionDef):
                names = [a.arg for a in node.args.args]
            else:
                continue
            if "code" in names:
                positions[node.name] = names.index("code")
    return positions


def codes_in(tree: ast.Module, positions: dict[str, int]) -> Iterator[str]:
    """Codes of warnings and findings in a module, as literals or as patterns."""
    constants = {
        t.id: n.value for n in tree.body if isinstance(n, ast.Assign) for t in n.targets if isinstance(t, ast.Name)
    }
    for node in ast.walk(tree):
        if isinstance(node, ast.Call):
            name = node.func.id if isinstance(node.func, ast.Name) else getattr(node.func, "attr", "")
            arguments = node.args[positions[name] :][:1] if name in positions else []
            arguments += [k.value for k in node.keywords if k.arg == "code"]
            for argument in arguments:
                if isinstance(argument, ast.Constant):
                    yield argument.value
                elif isinstance(argument, ast.JoinedStr):
                    yield ast.unparse(argument)[2:-1]
        elif isinstance(node, ast.For) and isinstance(node.target, ast.Tuple):
            names = [t.id for t in node.target.elts if isinstance(t, ast.Name)]
            rows = constants.get(node.iter.id) if isinstance(node.iter, ast.Name) else node.iter
            if "code" in names and isinstance(rows, ast.Tuple):
                yield from (row.elts[names.index("code")].value for row in rows.elts)


def all_codes() -> set[str]:
    """Every code that the package can report."""
    trees = [ast.parse(path.read_text("utf-8")) for path in PACKAGE.rglob("*.py")]
    positions = code_positions(trees)
    found = {code for tree in trees for code in codes_in(tree, positions)} - PARTS
    return {one for code in found for one in PATTERNS.get(code, {code})}


@pytest.mark.slow
def test_every_code_has_a_cause_and_a_remedy():
    """A row of a table in the troubleshooting page begins with each code, and its other cells are not empty."""
    rows = re.findall(r"^\| `([^`]+)` \|(.+)\|(.+)\|$", TROUBLES.read_text("utf-8"), re.MULTILINE)
    codes = all_codes()
    assert len(codes) > 60, "the search for codes in the package finds too few"
    assert codes ^ {code for code, *_ in rows if code.islower()} == set()
    assert [row for row in rows if not all(cell.strip() for cell in row)] == []


def test_every_class_of_error_is_explained():
    """The table of errors has each class that a user can meet."""
    classes = {n for n, c in vars(errors).items() if isinstance(c, type) and issubclass(c, errors.SkinCalibError)}
    rows = set(re.findall(r"^\| `(\w+)` \|", TROUBLES.read_text("utf-8"), re.MULTILINE))
    assert classes - {"SkinCalibError"} - rows == set()


def shell_lines() -> list[str]:
    """Lines of the shell examples that call skin-calib."""
    blocks = [block for page in PAGES for block in re.findall(r"```sh\n(.*?)```", page.read_text("utf-8"), re.DOTALL)]
    return sorted({line for block in blocks for line in block.splitlines() if line.startswith("skin-calib ")})


@pytest.mark.parametrize("line", shell_lines())
def test_command_in_the_documentation_is_valid(line):
    """The parser accepts it."""
    words = shlex.split(line, comments=True)
    assert cli.build_parser().parse_args(words[1:]).run


def test_touches_of_the_how_to_are_those_of_their_example():
    """The script writes what is committed; another fit moves it by a hundredth of a millimetre."""
    example = runpy.run_path(str(ROOT / "examples" / "make_touches.py"))
    real = example["real_taxels"]()
    for name, head, texts, rounding in (("table", 1, 1, 1.1e-5), ("session", 2, 2, 1.1e-3)):
        path = example["TABLE" if name == "table" else "SESSION"]
        first, second = (
            [line.split(",", texts) for line in t.splitlines()] for t in (example[name](real), path.read_text())
        )
        assert first[:head] == second[:head] and [r[:-1] for r in first] == [r[:-1] for r in second]
        numbers = (np.loadtxt([row[-1] for row in lines[head:]], delimiter=",") for lines in (first, second))
        np.testing.assert_allclose(*numbers, atol=rounding)


def run_page(page: Path, capsys) -> int:
    """Run the commands and the complete Python of a page; each text block after them is a part of what was printed."""
    printed, shown = "", 0
    for kind, block in re.findall(r"```(sh|python|text)\n(.*?)```", page.read_text("utf-8"), re.DOTALL):
        if kind == "text" and printed:
            shown += 1
            assert block in printed
        elif kind == "python" and "import" in block and page.parent.name == "tutorial":
            exec(block, {})
        elif kind == "sh":
            for program, *arguments in (shlex.split(line, comments=True) for line in block.splitlines()):
                if program == "mkdir":
                    Path(*arguments).mkdir()
                elif program == "skin-calib":
                    assert cli.main(arguments) == 0, arguments
                elif program == "python" and arguments[0].startswith("examples/"):
                    with pytest.MonkeyPatch.context() as patch:
                        patch.setattr("sys.argv", arguments)
                        runpy.run_path(arguments[0], run_name="__main__")
        printed += capsys.readouterr().out
    return shown


@pytest.fixture(scope="module")
def after_readme(tmp_path_factory) -> Path:
    """Return a fresh folder with the samples of the repository, in which the commands of the README ran."""
    folder = tmp_path_factory.mktemp("docs")
    for name in ("sample_scenes", "examples"):
        shutil.copytree(ROOT / name, folder / name)
    with pytest.MonkeyPatch.context() as patch, contextlib.chdir(folder):
        patch.setattr("sys.argv", ["skin-calib"])
        for line in re.findall(r"^skin-calib .*$", (ROOT / "README.md").read_text("utf-8"), re.MULTILINE):
            assert cli.main(shlex.split(line, comments=True)[1:]) == 0, line
    return folder


@pytest.mark.slow
@pytest.mark.parametrize("page", WITH_COMMANDS, ids=lambda page: page.stem)
def test_commands_of_the_pages_run(page, after_readme, tmp_path, monkeypatch, capsys):
    """After those of the README, one after the other, in a copy of its folder."""
    if page.stem == "view":
        pytest.importorskip("rerun", reason="rerun-sdk is not installed: pip install 'skin-calib[view]'")
    shutil.copytree(after_readme, tmp_path / "fresh")
    monkeypatch.chdir(tmp_path / "fresh")
    shown = run_page(page, capsys)
    assert page.parent.name != "tutorial" or shown > 1


@pytest.fixture
def domain():
    """Keep a DDS domain for a test."""
    with free_domain() as number:
        yield number


@pytest.mark.slow
def test_commands_of_the_live_page_run(after_readme, domain, tmp_path):
    """Each in a shell, as it stands; ``run`` goes on while the next one does, and ends by Ctrl+C."""
    pytest.importorskip("cyclonedds", reason="cyclonedds is not installed: pip install 'skin-calib[live]'")
    folder, path = tmp_path / "fresh", os.pathsep.join((str(Path(sys.executable).parent), os.environ["PATH"]))
    shutil.copytree(after_readme, folder)
    environment = os.environ | {"PATH": path, "PYTHONPATH": str(ROOT), "ROS_DOMAIN_ID": domain}
    shell = partial(subprocess.Popen, cwd=folder, env=environment, text=True, stdout=PIPE, stderr=PIPE)
    blocks, running = re.findall(r"```sh\n(.*?)```", LIVE.read_text("utf-8"), re.DOTALL), None
    printed = ""
    for block in blocks:
        if "skin-calib run" in block:
            running = shell(shlex.split(block))
            assert "priority" in running.stderr.readline()
            continue
        done = shell(["bash", "-c", block])
        out, err = done.communicate()
        assert done.returncode == 0, err
        printed += out + err
        if running is not None:
            sent = re.fullmatch(r"(\d+) packets sent\n", out).group(1)
            running.send_signal(signal.SIGINT)
            assert running.communicate()[0].startswith(f"{sent} frames of {sent} readings") and running.returncode == 0
            running = None
    assert f"frames           {sent}, " in printed and "warning" not in printed


@pytest.mark.parametrize("page", ["reference/window.md", "tutorial/blender.md", "how-to/planes.md", "how-to/boards.md"])
def test_bold_labels_are_in_the_window(page):
    """Words in bold are labels of buttons, properties or panels."""
    folders = (ROOT / "operators", ROOT / "panels", PACKAGE / "blender", PACKAGE / "plan")
    source = "\n".join(path.read_text("utf-8") for folder in folders for path in folder.rglob("*.py"))
    labels = set(re.findall(r"\*\*([^*]+)\*\*", (DOCS / page).read_text("utf-8")))
    assert len(labels) > 3
    assert {label for label in labels if f'"{label}"' not in source} == set()


@pytest.mark.parametrize("page", ["reference/python/index.md"])
def test_python_examples_run(page, monkeypatch):
    """Each block runs by itself, in the top folder of the repository."""
    monkeypatch.chdir(ROOT)
    blocks = re.findall(r"```python\n(.*?)```", (DOCS / page).read_text("utf-8"), re.DOTALL)
    assert blocks
    for block in blocks:
        exec(block, {})


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_files_of_the_repository_exist(page):
    """Each file that a page names by its path in the repository is there."""
    folders = "benchmarks|control/(?:examples|skin_control)|cpp|examples|sample_scenes|scripts|skin_calib_addon|tests"
    names = re.findall(rf"(?<![\w/.])(?:{folders})/[\w/.-]*\.\w+", page.read_text("utf-8"))
    assert [name for name in names if not (ROOT / name).exists()] == []
