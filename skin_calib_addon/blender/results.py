# SPDX-License-Identifier: GPL-3.0-or-later
"""The last fits of this Blender, by the number that their objects keep; undo brings back number and result alike."""

from ..pipeline import Calibrated

KEPT = 16
_results: dict[int, Calibrated] = {}
_last = 0


def keep(result: Calibrated) -> int:
    """Remember a result; its number is never used again while Blender runs."""
    global _last
    _last += 1
    _results[_last] = result
    while len(_results) > KEPT:
        del _results[min(_results)]
    return _last


def find(number: int) -> Calibrated | None:
    """The result of this number, if it is still kept."""
    return _results.get(number)


def clear() -> None:
    """Forget all results, as when another file is opened."""
    _results.clear()
