"""Show the progress of many jobs in the last line of a terminal."""

import sys
from time import perf_counter

BAR_WIDTH = 30  # characters. Larger: finer steps.


class Progress:
    """A progress bar on stderr, if that is a terminal, with the time that is left.

    ``work`` is what all jobs take together, in any unit; without it, each of them takes the same time.
    """

    def __init__(self, total: int, work: float = 0.0):
        self.total, self.done = total, 0
        self.work, self.worked, self.start = work or total, 0.0, perf_counter()
        self.visible = total > 1 and sys.stderr.isatty()
        self.show()

    def step(self, work: float = 1.0) -> None:
        """Count one more finished job, and what it took of the work."""
        self.done, self.worked = self.done + 1, self.worked + work

    def show(self) -> None:
        """Draw the bar."""
        full = BAR_WIDTH * self.done // self.total
        left = (perf_counter() - self.start) * max(self.work - self.worked, 0) / self.worked if self.worked else 0.0
        words = f", about {left:.0f} s left" if self.worked and self.done < self.total else ""
        self._write(f"[{'#' * full}{'.' * (BAR_WIDTH - full)}] {self.done}/{self.total}{words}")

    def clear(self) -> None:
        """Erase the bar, before other output."""
        self._write("")

    def _write(self, text: str) -> None:
        if self.visible:
            sys.stderr.write(f"\r\x1b[K{text}")
            sys.stderr.flush()
