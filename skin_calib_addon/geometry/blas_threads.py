"""Linear algebra on one thread: results do not depend on the number of processors, and small products are fast."""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from threading import Lock
from typing import Any

_lock = Lock()
_calls = 0  # that need one thread now
_limit: Any = None  # knows the former numbers of threads; None without threadpoolctl


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Limit BLAS and LAPACK of NumPy and SciPy to one thread; also usable as a decorator.

    A threaded product sums in another order than one thread does: without a limit, the command line and Blender write
    files that differ in the last digits. Starting threads also takes longer than most products of a fit. The former
    numbers return when the last of several simultaneous calls ends.

    Without the package ``threadpoolctl`` nothing is limited. The Python of a Linux distribution may lack it.
    """
    global _calls, _limit
    with _lock:
        _calls += 1
        if _calls == 1:
            _limit = _limited()
    try:
        yield
    finally:
        with _lock:
            _calls -= 1
            if _calls == 0 and _limit is not None:
                _restore(_limit)


def _limited() -> Any:
    """Limit the libraries of NumPy and SciPy."""
    libraries = _libraries()
    return None if libraries is None else libraries.limit(limits=1, user_api="blas")


@cache  # to find them takes 3 ms, a tenth of a preview
def _libraries() -> Any:
    """Find the libraries that NumPy and SciPy have loaded."""
    try:
        from threadpoolctl import ThreadpoolController
    except ImportError:
        return None
    import scipy.linalg  # noqa: F401

    return ThreadpoolController()


def _restore(limit: Any) -> None:
    """Restore the numbers of threads, also if another thread has limited them."""
    from threadpoolctl import OpenBLASController

    # Since version 3.8 it ignores all threads but one, until this call.
    release = getattr(OpenBLASController, "clear_controlling_thread", lambda force: None)
    release(force=True)
    limit.restore_original_limits()
    release(force=True)
