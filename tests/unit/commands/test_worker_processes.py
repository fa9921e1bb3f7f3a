"""Worker processes: results, crashes, and termination."""

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from skin_calib_addon.commands import worker_processes
from skin_calib_addon.commands.worker_processes import run_tasks
from tests.examples import slow
from tests.unit.commands.worker_tasks import DEATHS, deaf_and_slow, group, work, write

ROOT = Path(__file__).parents[3]


def lost(task, problem):
    return task, str(problem)


def is_there(pid):
    """Return whether a process still exists."""
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


def test_tasks_run_in_the_requested_number_of_processes():
    """At most two processes, none of them this one, run six tasks and end."""
    done = dict(run_tasks(work, range(6), 2, lost))
    assert set(done) == set(range(6))
    assert len(set(done.values())) <= 2 and os.getpid() not in done.values()
    assert not any(map(is_there, done.values()))


@pytest.mark.skipif(os.name == "nt", reason="Windows has no signals")
@pytest.mark.parametrize("count", [slow(1), 2])
def test_crashed_process_loses_only_its_own_task(count):
    """Other processes or a new one run the other tasks; the cause of the crash is reported."""
    done = dict(run_tasks(work, [0, "killed", 1, "crashed", "left", 2], count, lost))
    assert set(done) == {0, 1, 2, *DEATHS} and all(isinstance(done[k], int) for k in (0, 1, 2))
    assert all(words in done[death] for death, (words, _) in DEATHS.items())


@pytest.mark.skipif(os.name == "nt", reason="Windows has no signals")
@pytest.mark.parametrize("function", [work, deaf_and_slow])
def test_processes_end_with_the_iteration(monkeypatch, function):
    """Closing the iteration ends running tasks at once, even in a process that ignores SIGTERM."""
    monkeypatch.setattr(worker_processes, "END_TIMEOUT", 0.5)
    begun = []
    begin = worker_processes._begin
    monkeypatch.setattr(worker_processes, "_begin", lambda: begun.append(begin()) or begun[-1])
    found = run_tasks(function, ["", "slow", "slow", "slow"], 2, lost)
    next(found)
    found.close()
    assert len(begun) == 2 and all(process.returncode is not None for process in begun)


@pytest.mark.skipif(os.name == "nt", reason="Windows has no groups of this kind")
def test_terminal_interrupts_only_the_one_that_waits():
    """Ctrl+C is sent to a process group; each worker has its own group."""
    assert os.getpgrp() not in set(run_tasks(group, [1, 2], 2, lost))


@pytest.mark.skipif(os.name == "nt", reason="Windows has no signals")
def test_terminated_process_removes_its_temporary_file(tmp_path, monkeypatch):
    """No incomplete file stays under any name."""
    monkeypatch.setattr(worker_processes, "END_TIMEOUT", 60.0)  # a busy machine takes seconds
    found = run_tasks(write, ["", tmp_path / "whole"], 2, lost)
    next(found)
    while not os.listdir(tmp_path):
        time.sleep(0.01)
    found.close()
    assert os.listdir(tmp_path) == []


def test_calling_script_is_not_run_again(tmp_path):
    """A script needs no main guard; workers find the same modules as the script."""
    (tmp_path / "its_module.py").write_text("def double(x):\n    return 2 * x\n")
    script = tmp_path / "script.py"
    script.write_text(
        "import its_module\n"
        "from skin_calib_addon.commands.worker_processes import run_tasks\n"
        "print('run', sorted(run_tasks(its_module.double, [1, 2, 3], 2, print)))\n"
    )
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    done = subprocess.run([sys.executable, script], env=environment, capture_output=True, text=True, cwd="/")
    assert (done.stdout, done.stderr, done.returncode) == ("run [2, 4, 6]\n", "", 0)
