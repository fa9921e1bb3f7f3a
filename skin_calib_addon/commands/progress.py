"""Show the progress of many jobs in the last line of a terminal."""

import sys

BAR_WIDTH = 30  # characters. Larger: finer steps.


class Progress:
    """A progress bar on stderr, if that is a terminal."""

    def __init__(self, total: int):
        self.total, self.done = total, 0
        self.visible = total > 1 and sys.stderr.isatty()
        self.show()

    def step(self) -> None:
        """Count one more finished job."""
        self.done += 1

    def show(self) -> None:
        """Draw the bar."""
        full = BAR_WIDTH * self.done // self.total
        self._write(f"[{'#' * full}{'.' * (BAR_WIDTH - full)}] {self.done}/{self.total}")

    def clear(self) -> None:
        """Erase the bar, before other output."""
        self._write("")

    def _write(self, text: str) -> None:
        if self.visible:
            sys.stderr.write(f"\r\x1b[K{text}")
            sys.stderr.flush()
