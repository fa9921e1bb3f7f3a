# SPDX-License-Identifier: GPL-3.0-or-later
"""Run computations in a thread, so that the window does not freeze: arrays in, arrays out, without bpy."""

from collections.abc import Callable
from threading import Thread
from typing import Any

from ...geometry.blas_threads import one_blas_thread


class Stopped(Exception):
    """The result of the computation is not needed any more."""


class Work:
    """One computation in its own thread."""

    def __init__(self, task: Callable[[Callable[[str], None]], Any]):
        self.stage = ""
        self._is_stopped = False
        self._result: Any = None
        self._error: Exception | None = None
        self._thread = Thread(target=self._run, args=(task,), daemon=True)
        self._thread.start()

    def _run(self, task: Callable[[Callable[[str], None]], Any]) -> None:
        try:
            with one_blas_thread():
                self._result = task(self._begin)
        except Exception as error:  # result() raises it
            self._error = error

    def _begin(self, stage: str) -> None:
        if self._is_stopped:
            raise Stopped
        self.stage = stage

    def stop(self) -> None:
        """Stop the computation when its next stage starts."""
        self._is_stopped = True

    def is_done(self, wait: float | None = 0.0) -> bool:
        """Return whether the computation has ended, after at most ``wait`` seconds; None waits for the end."""
        self._thread.join(wait)
        return not self._thread.is_alive()

    def result(self) -> Any:
        """Return the result, once the computation is done."""
        if self._error is not None:
            raise self._error
        return self._result
