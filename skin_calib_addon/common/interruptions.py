"""Interruptions of a program: Ctrl+C (SIGINT), and SIGTERM, which batch systems and ``timeout`` send."""

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType


@contextmanager
def handled(handler: Callable[[int, FrameType | None], object], *signals: signal.Signals) -> Iterator[None]:
    """Handle signals otherwise during a block.

    Only the main thread can set handlers, and one that Python did not set cannot be restored: other threads and such
    signals are left as they are.
    """
    before = {number: signal.getsignal(number) for number in signals}
    if threading.current_thread() is not threading.main_thread() or None in before.values():
        yield
        return
    for number in signals:
        signal.signal(number, handler)
    try:
        yield
    finally:
        for number, former in before.items():
            signal.signal(number, former)
