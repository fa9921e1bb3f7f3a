"""Run tasks in worker processes; a crashed worker loses only its own task.

Each worker is a new Python process that receives tasks through a pipe, on every operating system. A fork would copy
locks of threads that do not exist in the child. A process that `multiprocessing` spawns would run the script of the
caller again.
"""

import os
import pickle
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import suppress
from queue import SimpleQueue
from typing import Any

# Workers have the import path of the parent.
PROGRAM = f"import sys; sys.path[:] = sys.argv[1:]; from {__name__} import serve; serve()"
END_TIMEOUT = 5.0  # [s] until a worker is killed. Larger: an interrupted program ends later.


class ProcessDied(Exception):
    """A process ended before it finished its task; the message states how."""


def run_tasks(
    work: Callable[[Any], Any], tasks: Iterable[Any], count: int, lost: Callable[[Any, ProcessDied], Any]
) -> Iterator[Any]:
    """Yield the result of each task as soon as it is finished."""
    workers = [_Worker(work) for _ in range(count)]
    idle: SimpleQueue[_Worker] = SimpleQueue()

    def assign(task: Any) -> Any:
        worker = idle.get()
        try:
            return worker.do(task)
        except ProcessDied as problem:
            return lost(task, problem)
        finally:
            idle.put(worker)

    pool = ThreadPoolExecutor(count)
    try:
        for worker in workers:
            worker.begin()
            idle.put(worker)
        for future in as_completed([pool.submit(assign, task) for task in tasks]):
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
    """A process for tasks, one after another; it starts again with the next task after a crash."""

    def __init__(self, work: Callable[[Any], Any]) -> None:
        self._work = work
        self._process: subprocess.Popen[bytes] | None = None
        self._ended = False

    def begin(self) -> subprocess.Popen[bytes]:
        """Start the process, which imports what the work needs."""
        process = self._process = _begin()
        assert process.stdin
        with suppress(OSError):  # it crashed: its first task reports it
            pickle.dump(self._work, process.stdin)
            process.stdin.flush()
        return process

    def do(self, task: Any) -> Any:
        """Return the result of a task; raise ProcessDied if the process crashed."""
        process = self._process or self.begin()
        if self._ended:  # ask_to_end was called during the start
            process.kill()
        assert process.stdin and process.stdout
        try:
            pickle.dump(task, process.stdin)
            process.stdin.flush()
            return pickle.load(process.stdout)
        except (OSError, EOFError, pickle.UnpicklingError):
            self._process = None
            _close(process)
            raise ProcessDied(_how(process.wait())) from None

    def ask_to_end(self) -> None:
        """Terminate the process without waiting for its task."""
        self._ended, process = True, self._process
        if process:
            process.terminate()

    def end(self, deadline: float) -> None:
        """Wait until the process has ended, and kill it after the deadline."""
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
    if sys.platform == "win32":  # only the parent receives Ctrl+C
        return subprocess.Popen(command, stdin=pipe, stdout=pipe, creationflags=subprocess.CREATE_NEW_PROCESS_GROUP)
    return subprocess.Popen(command, stdin=pipe, stdout=pipe, process_group=0)


def _close(process: subprocess.Popen[bytes]) -> None:
    for pipe in (process.stdin, process.stdout):
        with suppress(OSError):  # data that it did not read
            if pipe:
                pipe.close()


def _how(code: int) -> str:
    """Describe how a process ended, from its exit code."""
    if code >= 0:
        return f"its process exited with code {code}"
    name = signal.Signals(-code).name if -code in set(signal.Signals) else f"signal {-code}"
    if name == "SIGKILL":
        return "its process was killed, most likely because of insufficient memory"
    return f"its process was ended by the signal {name}"


def serve() -> None:
    """Read the work from stdin, and then tasks until it is closed; the output of libraries goes to stderr."""
    signal.signal(signal.SIGTERM, lambda *_: sys.exit())  # temporary files are removed
    tasks, results = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    try:
        work = pickle.load(tasks)
        while True:
            pickle.dump(work(pickle.load(tasks)), results)
            results.flush()
    except (EOFError, BrokenPipeError):  # the parent has ended
        os._exit(0)  # flushing the broken pipe would print an error
