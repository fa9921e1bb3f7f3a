"""Work in processes of their own: one that dies spoils what it was at, and nothing else.

Each is a new Python that gets its work by a pipe, the same on every system. A fork would copy the locks of threads that
do not go on in it; what `multiprocessing` spawns runs the script of whoever called us once more.
"""

import os
import pickle
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import suppress
from queue import SimpleQueue
from typing import Any

# Modules are looked for where the program that asks looks for them.
PROGRAM = f"import sys; sys.path[:] = sys.argv[1:]; from {__name__} import serve; serve()"
END_TIMEOUT = 5.0  # [s] for the end of a process that was asked to end; what computes hears it late


class ProcessDied(Exception):
    """A process ended before its work was done; the message says how."""


def run_tasks(
    work: Callable[[Any], Any], tasks: Sequence[Any], count: int, lost: Callable[[Any, ProcessDied], Any]
) -> Iterator[Any]:
    """What comes of each task, as soon as it is known.

    Parameters
    ----------
    work : function of a module
        Gives what comes of a task. Tasks and results go through pipes (pickle).
    tasks : sequence
    count : int
        Processes at a time. All have ended when the iteration ends, or is left.
    lost : function
        Gives what comes of a task whose process died.
    """
    workers = [_Worker() for _ in range(min(count, len(tasks)))]
    idle: SimpleQueue[_Worker] = SimpleQueue()

    def hand_over(task: Any) -> Any:
        worker = idle.get()
        try:
            return worker.do(work, task)
        except ProcessDied as problem:
            return lost(task, problem)
        finally:
            idle.put(worker)

    for worker in workers:
        idle.put(worker)
    pool = ThreadPoolExecutor(len(workers))
    try:
        for future in as_completed([pool.submit(hand_over, task) for task in tasks]):
            yield future.result()
    finally:
        pool.shutdown(wait=False, cancel_futures=True)
        for worker in workers:
            worker.ask_to_end()
        deadline = time.monotonic() + END_TIMEOUT
        for worker in workers:
            worker.end(deadline)
        pool.shutdown()


class _Worker:
    """A process that does one task after the other; begun when there is one, and anew where it died."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None
        self._ended = False

    def do(self, work: Callable[[Any], Any], task: Any) -> Any:
        """The result of a task; ProcessDied if there is none."""
        process = self._process = self._process or _begin()
        if self._ended:  # while it began
            process.kill()
        assert process.stdin and process.stdout
        try:
            pickle.dump((work, task), process.stdin)
            process.stdin.flush()
            return pickle.load(process.stdout)
        except (OSError, EOFError, pickle.UnpicklingError):
            self._process = None
            _close(process)
            raise ProcessDied(_how(process.wait())) from None

    def ask_to_end(self) -> None:
        """Without waiting for the task that it is at."""
        self._ended, process = True, self._process
        if process:
            process.terminate()

    def end(self, deadline: float) -> None:
        """Wait until it has ended, and end it by force after the deadline."""
        process = self._process
        if process:
            try:
                process.wait(max(deadline - time.monotonic(), 0))
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
            _close(process)


def _begin() -> subprocess.Popen[bytes]:
    command, pipe = [sys.executable, "-c", PROGRAM, *sys.path], subprocess.PIPE
    if sys.platform == "win32":  # Ctrl+C is for the one that waits
        return subprocess.Popen(command, stdin=pipe, stdout=pipe, creationflags=subprocess.CREATE_NEW_PROCESS_GROUP)
    return subprocess.Popen(command, stdin=pipe, stdout=pipe, process_group=0)


def _close(process: subprocess.Popen[bytes]) -> None:
    for pipe in (process.stdin, process.stdout):
        with suppress(OSError):  # what it did not take
            if pipe:
                pipe.close()


def _how(code: int) -> str:
    """How a process ended, by its exit code."""
    if code >= 0:
        return f"its process ended by itself with code {code}"
    name = signal.Signals(-code).name if -code in set(signal.Signals) else f"signal {-code}"
    if name == "SIGKILL":
        return "its process was ended from outside, most likely for want of memory"
    return f"its process was ended by {name}"


def serve() -> None:
    """Do tasks from stdin until there is none; what a library prints goes to stderr."""
    signal.signal(signal.SIGTERM, lambda *_: sys.exit())  # so that what is being written is cleared away
    tasks, results = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    try:
        while True:
            work, task = pickle.load(tasks)
            pickle.dump(work(task), results)
            results.flush()
    except (EOFError, BrokenPipeError):  # whoever asked is gone
        os._exit(0)  # what is left in the pipe would complain
