"""Work in processes of their own: what comes of it, and what is left when one dies or nobody waits any more."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from skin_calib_addon.commands import worker_processes
from skin_calib_addon.commands.worker_processes import run_tasks
from skin_calib_addon.common.atomic_file import write_bytes_safely

ROOT = Path(__file__).parents[3]
DEATHS = {
    "killed": ("ended from outside, most likely for want of memory", lambda: os.kill(os.getpid(), signal.SIGKILL)),
    "crashed": ("ended by SIGSEGV", lambda: os.kill(os.getpid(), signal.SIGSEGV)),
    "left": ("ended by itself with code 3", lambda: os._exit(3)),
}


def work(task):
    """What a process does: die, or tell who it is; with words on stdout, where the results go."""
    print("a library has something to say")
    if task in DEATHS:
        DEATHS[task][1]()
    if task == "slow":
        time.sleep(600)
    if task == "deaf":
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
    return task, os.getpid()


def lost(task, problem):
    return task, str(problem)


def deaf_and_slow(task):
    return work("deaf"), work(task)


def write(path):
    """As on a disk that takes its time."""
    if path:
        os.fsync = lambda handle: time.sleep(600)
        write_bytes_safely(path, b"half a file")


def group(task):
    return os.getpgrp()


def is_there(pid):
    """Whether a process of ours is still there."""
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


def test_every_task_is_done_in_a_process_that_others_do_not_share():
    """As many as are asked for, none of them this one; one that is free takes the next."""
    done = dict(run_tasks(work, range(6), 2, lost))
    assert set(done) == set(range(6))
    assert len(set(done.values())) <= 2 and os.getpid() not in done.values()
    assert not any(map(is_there, done.values()))


@pytest.mark.skipif(os.name == "nt", reason="Windows has no signals")
@pytest.mark.parametrize("death", DEATHS)
@pytest.mark.parametrize("count", [1, 3])
def test_process_that_dies_spoils_its_own_task(death, count):
    """The others are done, by those that are left or by a new one; how it died is told."""
    done = dict(run_tasks(work, [0, death, 1, death, 2], count, lost))
    assert set(done) == {0, 1, 2, death}
    assert DEATHS[death][0] in done[death] and all(isinstance(done[k], int) for k in (0, 1, 2))


@pytest.mark.skipif(os.name == "nt", reason="Windows has no signals")
@pytest.mark.parametrize("function", [work, deaf_and_slow])
def test_processes_end_with_the_iteration(monkeypatch, function):
    """Whoever leaves it does not wait for what is being done, not even by a process that hears nothing."""
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
    """Ctrl+C is sent to a whole group; the others are in groups of their own."""
    assert os.getpgrp() not in set(run_tasks(group, [1, 2], 2, lost))


@pytest.mark.skipif(os.name == "nt", reason="Windows has no signals")
def test_process_that_is_ended_clears_away_what_it_was_writing(tmp_path):
    """No half file stays, under whatever name."""
    found = run_tasks(write, ["", tmp_path / "whole"], 2, lost)
    next(found)
    while not os.listdir(tmp_path):
        time.sleep(0.01)
    found.close()
    assert os.listdir(tmp_path) == []


def test_script_that_asks_is_not_run_again(tmp_path):
    """Nor need it guard its lines; modules are found where it finds them."""
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
