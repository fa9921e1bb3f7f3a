"""The other experiments at 1 kHz."""

import importlib
from pathlib import Path

import pytest


class _Seen(Exception):
    """Ends a walk after its first cycle."""


@pytest.mark.parametrize("name", ["beam", "replanning"])
def test_walk_has_the_period_of_its_case(name):
    from biped import TIME_STEP

    module = importlib.import_module(name)
    first = {"beam": (True, 0.08, 1), "replanning": ("large block", "what is felt, new steps")}[name]

    def look(robot, walker):
        raise _Seen(robot.period, walker.period, robot.data.time)

    with pytest.raises(_Seen) as seen:
        module.run(module.Case(*first, seed=0, period=TIME_STEP), look)
    assert seen.value.args == (TIME_STEP, TIME_STEP, TIME_STEP)


def test_other_experiments_run_with_each_rate_and_all_seeds():
    """All experiments that ran at one rate only have a row; the two rates differ in nothing else."""
    from dataclasses import replace

    from rates import PERIODS
    from rates_others import RUNS, cases_of, of_g1, of_robot

    rows, kinds = of_robot() | of_g1(*map(Path, ("g1.urdf", "feet", "arms"))), set()
    for row in rows.values():
        slow, fast = (cases_of(row, 4, period) for period in PERIODS.values())
        assert [[replace(case, period=PERIODS["1 kHz"]) for case in some] for some in slow] == fast
        assert {len(some) for some in fast} == {4}
        assert {case.period for some in slow for case in some} == {PERIODS["250 Hz"]}
        kinds |= {type(case) for some in fast for case in some}
    assert kinds == set(RUNS)


def test_table_of_the_other_rates_has_the_results_of_each_row(monkeypatch, capsys, tmp_path):
    """With the short runs of the arm; without a G1 there are no rows of it."""
    import rates_others

    arm_rows = {name: row for name, row in rates_others.of_robot().items() if "8 N by" in name}
    monkeypatch.setattr(rates_others, "of_robot", lambda: arm_rows)
    monkeypatch.setattr("rates_others.g1.URDF", tmp_path / "none.urdf")
    monkeypatch.setattr("sys.argv", ["rates_others.py", "--seeds", "1", "--jobs", "1", "--out", str(tmp_path)])
    rates_others.main()
    lines = [line.split("|") for line in capsys.readouterr().out.splitlines() if "8 N by" in line]
    assert len(lines) == 4 and all("mm/s" in line[2] and "mm/s" in line[3] for line in lines)
    assert any(line[2] != line[3] for line in lines)  # the columns are of different runs
