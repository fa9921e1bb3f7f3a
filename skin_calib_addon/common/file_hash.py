"""Hashes of files, to find changed ones."""

import hashlib
import os
from pathlib import Path


def file_hash(path: Path) -> str | None:
    """Return the hash of a file; None if it is not a readable regular file, because a pipe may never end."""
    if not os.path.isfile(path):
        return None
    try:
        with open(path, "rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError:
        return None
