"""The commands of ``make control``: each of them starts, prints its table and draws."""

import importlib
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
FOLDER, MAKEFILE = ROOT / "control" / "examples", (ROOT / "Makefile").read_text("utf-8")
COMMANDS = re.search("^CONTROL = (.*)$", MAKEFILE, re.MULTILINE)[1].split()
SHORT = dict.fromkeys(("landing", "faults", "g1_landing"), ("--steps", "1")) | {"beam": ("--steps", "2")}


def test_make_control_runs_each_script_that_reports():
    reporting = {path.stem for path in FOLDER.glob("*.py") if "report(given," in path.read_text("utf-8")}
    assert set(COMMANDS) == reporting and len(COMMANDS) == len(reporting)


@pytest.mark.slow
@pytest.mark.parametrize("name", COMMANDS)
def test_command_prints_its_table_and_draws(name, tmp_path, monkeypatch, capsys):
    """The first case of each class is run; its result stands for the others."""
    module = importlib.import_module(name)
    if name.startswith("g1") and not importlib.import_module("g1").URDF.exists():
        pytest.skip("no real robot here")

    def first_of_each(work, cases, given):
        results = {}
        for case in (case for some in cases.values() for case in some):
            if type(case) not in results:
                results[type(case)] = work(case)
        return {kind: [results[type(case)] for case in some] for kind, some in cases.items()}

    monkeypatch.setattr(module, "run_all", first_of_each)
    has_animation = "has_animation=False" not in (FOLDER / f"{name}.py").read_text("utf-8")
    words = ["--seeds", "1", "--jobs", "1", "--out", str(tmp_path), *SHORT.get(name, ())]
    monkeypatch.setattr("sys.argv", [f"{name}.py", *words, *["--no-animation"] * has_animation])
    module.main()
    table = capsys.readouterr().out.partition("(1 seeds)")[2]
    assert table.count("\n|") > 2
    assert not has_animation or (tmp_path / f"{name}.png").stat().st_size > 10_000
