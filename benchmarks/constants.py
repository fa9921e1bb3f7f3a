"""Vary every numeric constant of the package by 0.5 and 2, and print what changes in a fixed set of cases.

    python benchmarks/constants.py [--only geometry] [--full] [--list] [--tests] [--old FOLDER]

A constant is a name in capitals that a module of ``skin_calib_addon`` (without ``blender``) sets to a number or to a
tuple of numbers. One whose comment has "Derived:", "Format:" or "Contract:" is not varied: its value follows from
others, from a file format, or from a documented promise.

For each other constant a new process loads the package with the value multiplied, in every module that uses it, and
runs the cases of ``constant_cases*.py``, the fastest first. A case that executes no line with the constant is left out:
its result cannot change. After an effect of 10 % or 0.1 mm the other cases are run with ``--full`` only.

The table is sorted by effect. "inert": the lines run, and no result changes by more than rounding. "not run": no case
executes a line with the constant. Time counts as a change from a factor of 1.5 on, and only for constants with no other
effect. A limit is inert where no case comes near it: see what it protects before you delete it.

With ``--tests`` the unit tests of the module are run instead of the cases, with each constant multiplied. The table
has for each constant whether a test fails, with the second factor where none does with the first. These are the tests
``test_*MODULE*.py`` in the folder that mirrors that of the module, all of this folder if there is none, and the
``test_limits.py`` of this folder and of those above. Tests marked as slow are left out.

Results are kept in ``out/constants.json`` as they arrive, so that a run which was interrupted continues. They are
discarded when a file of the package or of the cases has changed.
"""

import argparse
import ast
import hashlib
import importlib.machinery
import importlib.util
import json
import multiprocessing
import os
import re
import resource
import sys
from collections import defaultdict
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from time import process_time

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[variable] = "1"  # the same rounding in each run, and one core per process

import constant_cases  # noqa: E402
import constant_cases_files  # noqa: E402, F401  adds its cases, as the next ones
import constant_cases_proposal  # noqa: E402, F401
import constant_cases_runtime  # noqa: E402, F401
import numpy as np  # noqa: E402
import scipy.spatial  # noqa: E402, F401  loaded once here, for every process, as the next two
import scipy.stats  # noqa: E402, F401
import trimesh  # noqa: E402, F401

ROOT = Path(__file__).resolve().parent.parent
PACKAGE = ROOT / "skin_calib_addon"
RESULTS = ROOT / "out" / "constants.json"
FACTORS = (0.5, 2.0)
NOT_VARIED = re.compile(r"\b(derived|format|contract):", re.IGNORECASE)
CAPITALS = re.compile(r"_?[A-Z][A-Z0-9_]*")
CONVERSIONS = {"deg2rad", "radians", "cos", "sin", "float"}
TEST_TIME_LIMIT = 240.0  # [s] for the tests of one variation
TIME_LIMIT = 240.0  # [s] for each case of one variation; a process that takes longer is ended
ROUNDING = 1e-9  # change of a position [m], or relative change of another result, up to which it counts as none
MOST_NAMED = 3  # changes that the table names of one case
SLOWER = 1.5  # factor of the time that counts as a change,
DECISIVE = 0.1  # relative change, or change of a position [mm], after which other cases are run with --full only
NOTICED = 0.3  # [s] if the difference is larger than this too


@dataclass(frozen=True)
class Constant:
    """A numeric constant of a module."""

    file: str  # relative to the package
    name: str
    line: int
    value: str  # as the source has it
    comment: str

    @property
    def key(self) -> str:
        """Name of this constant in the results."""
        return f"{self.file}:{self.name}"

    @property
    def varied(self) -> bool:
        """Whether its comment leaves its value open."""
        return not NOT_VARIED.search(self.comment)


def assignments(tree: ast.Module) -> Iterator[tuple[str, ast.expr]]:
    """Yield names in capitals at module level with their values; ``A, B = 1, 2`` gives two."""
    for statement in tree.body:
        if isinstance(statement, ast.Assign):
            targets, value = statement.targets, statement.value
        elif isinstance(statement, ast.AnnAssign) and statement.value is not None:
            targets, value = [statement.target], statement.value
        else:
            continue
        for target in targets:
            if isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple):
                pairs = list(zip(target.elts, value.elts))
            else:
                pairs = [(target, value)]
            for name, number in pairs:
                if isinstance(name, ast.Name) and CAPITALS.fullmatch(name.id):
                    yield name.id, number


def is_numeric(node: ast.expr) -> bool:
    """Return whether an expression is a number, a tuple of numbers, or converts a number, as ``deg2rad(40.0)``."""
    if isinstance(node, ast.Constant):
        return isinstance(node.value, (int, float)) and not isinstance(node.value, bool)
    if isinstance(node, ast.UnaryOp):
        return is_numeric(node.operand)
    if isinstance(node, ast.BinOp):
        return is_numeric(node.left) and is_numeric(node.right)
    if isinstance(node, (ast.Tuple, ast.List)):
        return bool(node.elts) and all(is_numeric(element) for element in node.elts)
    if isinstance(node, ast.Call):
        name = getattr(node.func, "attr", getattr(node.func, "id", ""))
        return name in CONVERSIONS and bool(node.args) and all(is_numeric(argument) for argument in node.args)
    return False


def find_constants(package: Path) -> list[Constant]:
    """Return the numeric constants of a package, without those of its folder ``blender``."""
    found = []
    for file in sorted(package.rglob("*.py")):
        relative = file.relative_to(package).as_posix()
        if relative.startswith("blender/"):
            continue
        source = file.read_text()
        lines = source.splitlines()
        for name, value in assignments(ast.parse(source)):
            if is_numeric(value):
                comment = comment_of(lines, value.lineno - 1, value.end_lineno - 1)
                found.append(Constant(relative, name, value.lineno, ast.unparse(value), comment))
    return found


def comment_of(lines: list[str], first: int, last: int) -> str:
    """Return the comment behind a constant, or the comment lines above it."""
    _, mark, behind = lines[last].partition("#")
    if mark:
        return behind.strip()
    above: list[str] = []
    while first > 0 and lines[first - 1].startswith("#"):
        first -= 1
        above.insert(0, lines[first].lstrip("# "))
    return " ".join(above)


def summary(package: Path) -> str:
    """Return the counts of a package: constants, constants per 1000 lines, names with several values."""
    constants = find_constants(package)
    lines = sum(len(file.read_text().splitlines()) for file in package.rglob("*.py"))
    values = defaultdict(set)
    for constant in constants:
        values[constant.name].add(constant.value)
    several = sorted(name for name, different in values.items() if len(different) > 1)
    return (
        f"{len(constants)} numeric constants in {lines} lines: {1000 * len(constants) / lines:.1f} per 1000 lines; "
        f"{len(several)} names with different values in different files: {', '.join(several)}"
    )


# Loading the package with one constant multiplied


def multiplied(value, factor: float):
    """Multiply a number, or the numbers of a tuple; whole numbers stay whole and do not become zero."""
    if isinstance(value, (tuple, list)):
        return type(value)(multiplied(element, factor) for element in value)
    if isinstance(value, (int, np.integer)):
        return max(1, int(value * factor)) if value > 0 else int(value * factor)
    return value * factor


class Multiply(ast.NodeTransformer):
    """Rewrites the assignment of one constant so that its value is multiplied."""

    def __init__(self, name: str, factor: float):
        self.name, self.factor = name, factor

    def visit_Module(self, node: ast.Module) -> ast.Module:
        for statement in node.body:
            if isinstance(statement, (ast.Assign, ast.AnnAssign)) and statement.value is not None:
                for target in statement.targets if isinstance(statement, ast.Assign) else [statement.target]:
                    if isinstance(target, ast.Name) and target.id == self.name:
                        statement.value = self.call(statement.value)
                    elif isinstance(target, ast.Tuple) and isinstance(statement.value, ast.Tuple):
                        for i, element in enumerate(target.elts):
                            if isinstance(element, ast.Name) and element.id == self.name:
                                statement.value.elts[i] = self.call(statement.value.elts[i])
        return ast.fix_missing_locations(node)

    def call(self, value: ast.expr) -> ast.expr:
        """Return ``__import__("constants").multiplied(value, factor)``."""
        template = ast.parse(f"__import__('constants').multiplied(0, {self.factor})", mode="eval").body
        template.args[0] = value
        return template


class MultiplyingLoader(importlib.machinery.SourceFileLoader):
    """Loads one module from rewritten source."""

    def __init__(self, name: str, path: str, constant: str, factor: float):
        super().__init__(name, path)
        self.multiply = Multiply(constant, factor)

    def get_code(self, fullname: str):
        tree = ast.parse(Path(self.path).read_bytes())
        return compile(self.multiply.visit(tree), self.path, "exec")


class MultiplyingFinder:
    """Finds the module of one constant before the usual finders do."""

    def __init__(self, constant: Constant, factor: float):
        self.module = "skin_calib_addon." + constant.file.removesuffix(".py").removesuffix("/__init__").replace(
            "/", "."
        )
        self.arguments = str(PACKAGE / constant.file), constant.name, factor

    def find_spec(self, name, path=None, target=None):
        """Return the rewritten module, or None for every other one."""
        if name != self.module:
            return None
        loader = MultiplyingLoader(name, *self.arguments)
        return importlib.util.spec_from_file_location(name, self.arguments[0], loader=loader)


# One process per variation


def run_cases(connection, folder: str, names: list[str], constant: Constant | None, factor: float) -> None:
    """Run cases in this process and send (case, result, seconds) for each."""
    silence()
    if constant is not None:
        sys.meta_path.insert(0, MultiplyingFinder(constant, factor))
    try:
        constant_cases.load_package()
    except Exception as error:
        connection.send((names[0], {"failure": type(error).__name__}, 0.0))
        return
    for name in names:
        start = process_time()
        try:
            result = constant_cases.CASES[name](Path(folder))
        except (Exception, SystemExit) as error:  # whatever it is, it is the effect of the constant
            result = {"failure": type(error).__name__}
        connection.send((name, result, process_time() - start))
    connection.close()


def in_new_process(
    target, *arguments, enough: Callable[[str, dict], bool] | None = None, limit: float = TIME_LIMIT
) -> tuple[dict, dict]:
    """Return results and seconds by case, up to the first that is ``enough``, or that does not end within the limit."""
    context = multiprocessing.get_context("fork")
    receiver, sender = context.Pipe(duplex=False)
    process = context.Process(target=target, args=(sender, *arguments))
    process.start()
    sender.close()
    results, seconds = {}, {}
    try:
        while receiver.poll(limit):
            name, results[name], seconds[name] = receiver.recv()
            if enough is not None and enough(name, results[name]):
                break
    except EOFError:
        pass
    process.kill()
    process.join()
    return results, seconds


def silence() -> None:
    """Discard what this process prints."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    os.dup2(nowhere, 2)


def executed_lines(connection, folder: str, names: list[str]) -> None:
    """Run one case and send the lines of the package that it executes, as (file, line)."""
    silence()
    lines: set[tuple[str, int]] = set()
    monitoring, tool, prefix = sys.monitoring, 4, f"{PACKAGE}{os.sep}"

    def line_started(code, line):
        if code.co_name != "<module>" and code.co_filename.startswith(prefix):
            lines.add((code.co_filename[len(prefix) :], line))
        return monitoring.DISABLE  # once per line is enough

    monitoring.use_tool_id(tool, "constants")
    monitoring.register_callback(tool, monitoring.events.LINE, line_started)
    monitoring.set_events(tool, monitoring.events.LINE)
    for name in names:
        constant_cases.CASES[name](Path(folder))
        connection.send((name, lines, 0.0))
    connection.close()


def prepare(connection, folder: str) -> None:
    """Write the input files of the cases with the package as it is."""
    constant_cases.prepare(Path(folder))
    connection.send(("inputs", {}, 0.0))
    connection.close()


def run_tests(connection, constant: Constant | None, factor: float, tests: list[str]) -> None:
    """Run unit tests in this process and send whether one failed, or that there are none."""
    import pytest

    silence()
    if constant is not None:
        sys.meta_path.insert(0, MultiplyingFinder(constant, factor))
    os.chdir(ROOT)
    code = pytest.main(["-x", "-q", "-p", "no:xdist", "-m", "not slow and not window", *tests])
    words = {pytest.ExitCode.OK: "passes", pytest.ExitCode.NO_TESTS_COLLECTED: "no test"}
    connection.send(("tests", words.get(code, "fails"), 0.0))
    connection.close()


def tests_of(constant: Constant) -> list[str]:
    """Return the files with the unit tests of the module of a constant, or their folder."""
    module = Path(constant.file)
    folder = ROOT / "tests" / "unit" / module.parent
    while not folder.is_dir():
        folder = folder.parent
    own = list(folder.glob(f"test_*{module.stem}*.py")) or [folder]
    limits = [path for f in (folder, *folder.parents) if (path := f / "test_limits.py").exists()]
    return sorted({*map(str, own), *map(str, limits)})


def print_tests(constants: list[Constant]) -> None:
    """Print for each constant whether the tests of its module fail with it multiplied."""
    free = []
    print("| constant | value | times 0.5, then times 2 |\n|---|---|---|")
    for constant in constants:
        found: list[str] = []
        for factor in FACTORS:
            if found != ["fails"]:
                results, _ = in_new_process(run_tests, constant, factor, tests_of(constant), limit=TEST_TIME_LIMIT)
                found.append(results.get("tests", "does not end"))
        if found[-1] != "fails":
            free.append(constant.key)
        print(f"| `{constant.key}` | {constant.value} | {', '.join(found)} |", flush=True)
    print(f"\n{len(free)} of {len(constants)} without a test that fails: {', '.join(free)}")


# Which cases execute a line with a constant


def uses(constants: list[Constant]) -> dict[str, set[tuple[str, int]] | None]:
    """Return for each constant the lines that use it, in all modules; None where a module uses it as it is loaded.

    Another module uses it under its own name, after an import, or as an attribute; any attribute of this name counts.
    """
    by_name = defaultdict(list)
    for constant in constants:
        by_name[constant.name].append(constant)
    found: dict[str, set[tuple[str, int]] | None] = {constant.key: set() for constant in constants}
    for file in sorted(PACKAGE.rglob("*.py")):
        relative = file.relative_to(PACKAGE).as_posix()
        tree = ast.parse(file.read_text())
        imported = {
            (alias.asname or alias.name): (alias.name, node.module or "")
            for node in ast.walk(tree)
            if isinstance(node, ast.ImportFrom)
            for alias in node.names
        }
        for node, where in with_lines(tree, None):
            if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load):
                name, module = imported.get(node.id, (node.id, None))
                owners = [c for c in by_name.get(name, ()) if belongs(c, relative, module)]
            elif isinstance(node, ast.Attribute):
                owners = by_name.get(node.attr, [])
            else:
                continue
            for owner in owners:
                lines = found[owner.key]
                if where is None:
                    found[owner.key] = None
                elif lines is not None:
                    lines |= {(relative, line) for line in where or [node.lineno]}
    return found


def belongs(constant: Constant, file: str, module: str | None) -> bool:
    """Return whether a name in a file means this constant: its own, or imported from a module of that name."""
    if module is None:
        return constant.file == file
    stem = module.rpartition(".")[2]
    return constant.file.endswith(f"{stem}.py") or constant.file.endswith(f"{stem}/__init__.py")


def with_lines(node: ast.AST, where: list[int] | None) -> Iterator[tuple[ast.AST, list[int] | None]]:
    """Yield every node with the lines that execute only where it has an effect.

    These are all lines of a function for a default of its arguments; an empty list, which stands for the node's own
    line, within a function; None for what runs as the module is loaded.
    """
    for child in ast.iter_child_nodes(node):
        inside = where
        if isinstance(node, (ast.FunctionDef, ast.Lambda)):
            body = node.body if isinstance(node.body, list) else [node.body]
            if child in body:
                inside = []
            elif child is node.args and where is None:
                inside = [n.lineno for part in body for n in ast.walk(part) if hasattr(n, "lineno")]
        yield child, inside
        yield from with_lines(child, inside)


# What changes


def changes(before: dict, after: dict) -> tuple[float, list[str]]:
    """Compare two results of one case: the size of the largest change, and the largest changes in words."""
    if "failure" in after and after != before:
        return 100.0, [f"fails: {after['failure']}"]
    found = []
    for quantity in sorted(before.keys() | after.keys()):
        amount, text = change(quantity, before.get(quantity), after.get(quantity))
        if amount > 0:
            found.append((amount, f"{quantity} {text}"))
    found.sort(key=lambda item: -item[0])
    return found[0][0] if found else 0.0, [text for _, text in found[:MOST_NAMED]]


def change(quantity: str, before, after) -> tuple[float, str]:
    """Compare one quantity: the size of the change, zero for rounding, and the change in words."""
    if before is None or after is None:
        return 10.0, "missing" if after is None else "new"
    if isinstance(before, (str, list)):
        return (0.0, "") if before == after else (0.5, "differ")
    if isinstance(before, int):
        return abs(after - before) / max(abs(before), 1), f"{before} -> {after}"
    if before.shape != after.shape:
        return 1.0, f"of {len(before)} -> {len(after)}"
    known = np.isfinite(before)
    if (known != np.isfinite(after)).any():
        return 1.0, "known for other rows"
    if not known.any():
        return 0.0, ""
    difference = float(np.abs(after[known] - before[known]).max())
    if "[mm]" in quantity:  # in millimetres
        return (difference, f"by {difference:.2g} mm") if difference > 1e3 * ROUNDING else (0.0, "")
    relative = difference / max(float(np.abs(before[known]).max()), 1e-9)
    if relative <= ROUNDING:
        return 0.0, ""
    if before.size == 1:
        return relative, f"{float(before.flat[0]):.4g} -> {float(after.flat[0]):.4g}"
    return relative, f"by {relative:.2g} of the largest"


@dataclass(frozen=True)
class Effect:
    """What one constant does, in both directions."""

    constant: Constant
    size: float
    words: tuple[str, str]  # for the factors

    @property
    def sort_key(self) -> tuple:
        """Largest effect first."""
        return -self.size, self.constant.key


def judge(constant: Constant, kept: dict) -> Effect:
    """Put together the effects of both factors."""
    sizes, words = [], []
    for factor in FACTORS:
        entry = kept.get(f"{constant.key}*{factor}")
        sizes.append(entry["size"] if entry else 0.0)
        words.append(entry["words"] if entry else "not run")
    return Effect(constant, max(sizes), (words[0], words[1]))


def vary(
    constant: Constant, factor: float, folder: Path, baseline: dict, times: dict, names: list[str], decisive: float
) -> dict:
    """Run the cases with the constant multiplied, the fastest first, and return what changes most.

    After an effect of the decisive size the other cases are not run.
    """
    names = sorted(names, key=lambda name: times[name])
    results, seconds = in_new_process(
        run_cases, str(folder), names, constant, factor, enough=lambda n, r: changes(baseline[n], r)[0] >= decisive
    )
    size, found = 0.0, {}
    for name in names:
        if name not in results and size >= decisive:
            break
        amount, words = (100.0, ["does not end"]) if name not in results else changes(baseline[name], results[name])
        if amount > 0:
            size = max(size, amount)
            found[name] = amount, words
        if name not in results:
            break
    if found:
        worst = sorted(found, key=lambda name: -found[name][0])
        others = f" (and {len(worst) - 1} more)" if len(worst) > 1 else ""
        return {"size": size, "words": f"{worst[0]}: {'; '.join(found[worst[0]][1])}{others}"}
    before, after = sum(times[name] for name in names), sum(seconds.values())
    if not 1 / SLOWER < after / max(before, 1e-9) < SLOWER and abs(after - before) > NOTICED:
        return {"size": ROUNDING, "words": f"time {before:.2f} -> {after:.2f} s"}
    return {"size": 0.0, "words": "inert"}


def digest() -> str:
    """Fingerprint of the package and the cases."""
    sha = hashlib.sha256()
    for file in (*sorted(PACKAGE.rglob("*.py")), *sorted((ROOT / "benchmarks").glob("constant*.py"))):
        if "blender" not in file.relative_to(ROOT).parts:
            sha.update(file.read_bytes())
    return sha.hexdigest()


def load_results() -> dict:
    """Return the results of an interrupted run of the same sources, or none."""
    try:
        kept = json.loads(RESULTS.read_text())
    except (OSError, ValueError):
        kept = {}
    return kept if kept.get("digest") == digest() else {"digest": digest()}


def printed(effects: list[Effect]) -> str:
    """Return the table, largest effect first."""
    lines = ["| constant | value | times 0.5 | times 2 | comment |", "|---|---|---|---|---|"]
    for effect in sorted(effects, key=lambda e: e.sort_key):
        constant = effect.constant
        row = (f"`{constant.key}`", constant.value, *effect.words, constant.comment or "-")
        lines.append("| " + " | ".join(cell.replace("|", "/") for cell in row) + " |")
    return "\n".join(lines)


def main() -> None:
    """Count, vary, print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "--only", action="append", metavar="PATH", help="as 'geometry', 'skin/boards', 'geometry/mesh/visibility.py'"
    )
    parser.add_argument("--list", action="store_true", help="print the counts and the constants, vary nothing")
    parser.add_argument(
        "--old", type=Path, metavar="FOLDER", help="print the counts of another copy of the package too"
    )
    parser.add_argument("--full", action="store_true", help="run all cases after a decisive effect, too")
    parser.add_argument("--tests", action="store_true", help="run unit tests instead of the cases")
    parser.add_argument("--timings", action="store_true", help="print the time of each case, vary nothing")
    options = parser.parse_args()
    for package in filter(None, (options.old, PACKAGE)):
        print(f"{package.name}: {summary(package)}\n")
    every = find_constants(PACKAGE)
    beginnings = tuple(f"{path}{mark}" for path in options.only or () for mark in "/:")
    chosen = [c for c in every if not options.only or c.key.startswith(beginnings)]
    if options.list:
        print("\n".join(f"{'varied' if c.varied else 'fixed':7} {c.key} = {c.value}  # {c.comment}" for c in chosen))
        return

    if options.tests:
        print_tests([c for c in chosen if c.varied])
        return

    folder = ROOT / "out" / "constants"
    folder.mkdir(parents=True, exist_ok=True)
    prepared, _ = in_new_process(prepare, str(folder))
    if not prepared:
        sys.exit("the inputs of the cases could not be made: run benchmarks/constant_cases.py to see why")
    names = [
        name
        for name in constant_cases.CASES
        if constant_cases.is_present(name) and any(constant_cases.is_meant_for(name, c.file) for c in chosen)
    ]
    baseline, times = in_new_process(run_cases, str(folder), names, None, 1.0)
    again, _ = in_new_process(run_cases, str(folder), names, None, 1.0)
    for name in names:
        if changes(baseline[name], again[name])[0] > 0:
            print(f"left out, as two equal runs differ: {name}")
            names = [other for other in names if other != name]
    if options.timings:
        for name in names:
            print(f"{times[name]:6.2f} s  {name}{'  FAILS' if 'failure' in baseline[name] else ''}")
        print(f"{sum(times.values()):6.2f} s  in all")
        return
    lines = {name: in_new_process(executed_lines, str(folder), [name])[0].get(name, set()) for name in names}

    kept, used = load_results(), uses(every)
    decisive = np.inf if options.full else DECISIVE
    for constant in chosen:
        if not constant.varied:
            continue
        where = used[constant.key]
        concerned = [
            name
            for name in names
            if constant_cases.is_meant_for(name, constant.file) and (where is None or lines[name] & where)
        ]
        for factor in FACTORS:
            key = f"{constant.key}*{factor}"
            if concerned and key not in kept:
                kept[key] = vary(constant, factor, folder, baseline, times, concerned, decisive)
                RESULTS.write_text(json.dumps(kept, indent=1))
                print(f"{key}: {kept[key]['words']}", file=sys.stderr, flush=True)
    effects = [judge(constant, kept) for constant in chosen if constant.varied]
    print(printed(effects))
    inert = [e.constant.key for e in effects if e.words == ("inert", "inert")]
    never = [e.constant.key for e in effects if e.words == ("not run", "not run")]
    cpu = resource.getrusage(resource.RUSAGE_CHILDREN)
    print(f"\n{(cpu.ru_utime + cpu.ru_stime) / 60:.1f} minutes of CPU time in this run.")
    print(f"{len(effects)} varied, {len(chosen) - len(effects)} derived, of a format or a contract.")
    print(f"{len(inert)} inert: {', '.join(inert)}\n{len(never)} not run by any case: {', '.join(never)}")


if __name__ == "__main__":
    main()
