# SPDX-License-Identifier: GPL-3.0-or-later
"""Computations beside Blender's main thread, so that the window stays alive: arrays in, arrays out, nothing of bpy."""

from collections.abc import Callable
from threading import Thread
from typing import Any


class Stopped(Exception):
    """Nobody waits for the result any more."""


class Work:
    """One computation in a thread of its own.

    Parameters
    ----------
    task : function
        What is computed; it gets a function to call with the name of each stage that begins, which ends it there
        once it has been stopped.
    """

    def __init__(self, task: Callable[[Callable[[str], None]], Any]):
        self.stage = ""
        self._is_stopped = False
        self._result: Any = None
        self._error: Exception | None = None
        self._thread = Thread(target=self._run, args=(task,), daemon=True)
        self._thread.start()

    def _run(self, task: Callable[[Callable[[str], None]], Any]) -> None:
        try:
            self._result = task(self._begin)
        except Exception as error:  # it is raised where the result is asked for
            self._error = error

    def _begin(self, stage: str) -> None:
        if self._is_stopped:
            raise Stopped
        self.stage = stage

    def stop(self) -> None:
        """End it where its next stage would begin."""
        self._is_stopped = True

    def is_done(self, wait: float = 0.0) -> bool:
        """Whether it has ended, after at most ``wait`` seconds."""
        self._thread.join(wait)
        return not self._thread.is_alive()

    def result(self) -> Any:
        """What was computed, once it is done.

        Raises
        ------
        Exception
            What ended the computation: a SkinCalibError where the plan or the mesh is wrong.
        """
        if self._error is not None:
            raise self._error
        return self._result
