"""How far many jobs are, in the last line of a terminal."""

import sys

BAR_WIDTH = 30


class Progress:
    """A bar on stderr where that is a terminal; nothing elsewhere."""

    def __init__(self, total: int):
        self.total, self.done = total, 0
        self.visible = total > 1 and sys.stderr.isatty()
        self.show()

    def step(self) -> None:
        """One more is done."""
        self.done += 1

    def show(self) -> None:
        full = BAR_WIDTH * self.done // self.total
        self._write(f"[{'#' * full}{'.' * (BAR_WIDTH - full)}] {self.done}/{self.total}")

    def clear(self) -> None:
        """Before anything else is written."""
        self._write("")

    def _write(self, text: str) -> None:
        if self.visible:
            sys.stderr.write(f"\r\x1b[K{text}")
            sys.stderr.flush()
