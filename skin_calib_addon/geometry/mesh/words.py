"""Read the words of mesh files that are text."""

from collections.abc import Iterator, Sequence

import numpy as np

from ...common.arrays import Array
from ...common.findings import show

BYTE_ORDER_MARK = b"\xef\xbb\xbf"  # Format: some programs begin text in UTF-8 with it


def words_of_lines(content: bytes) -> Iterator[tuple[int, list[bytes]]]:
    """Yield the number and words of each line that has some, without comments; a backslash continues a line."""
    words: list[bytes] = []
    for number, line in enumerate(content.removeprefix(BYTE_ORDER_MARK).splitlines(), 1):
        words += line.partition(b"#")[0].split()
        if words and words[-1].endswith(b"\\"):
            words[-1:] = words[-1][:-1].split()
        elif words:
            yield number, words
            words = []
    if words:
        yield number, words


def numbers(words: Sequence[bytes]) -> Array:
    """Return the numbers that words represent, shape (n,)."""
    try:
        return np.array(words, float)
    except ValueError:
        wrong = next(word for word in words if not _is_number(word))
        raise ValueError(f"it has {shown(wrong)} instead of a number") from None


def shown(text: bytes) -> str:
    """Return a part of a file for a message."""
    return show(text.decode(errors="replace"))


def _is_number(word: bytes) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True
