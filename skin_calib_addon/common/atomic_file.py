"""Write a file whole or not at all: whoever looks sees the old bytes or the new ones, after a kill too."""

import os
import secrets
import stat
from contextlib import suppress
from pathlib import Path

from .errors import OutputError


def write_bytes_safely(path: str | os.PathLike[str], data: bytes) -> None:
    """Replace a file's content in one step; a symbolic link is followed, the file's mode is kept.

    Parameters
    ----------
    path : path
        File to write; its folder must exist.
    data : bytes
        The whole new content.

    Raises
    ------
    OutputError
        If it cannot be written. The old file is then whole and no temporary file is left.
    """
    try:
        target = Path(os.path.realpath(path))
        mode = _mode(target)
        temporary = target.with_name(f".skin-{secrets.token_hex(8)}.tmp")  # same folder: a rename stays atomic
        try:
            _write_new(temporary, data, mode)
            os.replace(temporary, target)
        except BaseException:
            with suppress(OSError):
                os.unlink(temporary)
            raise
        _sync_folder(target.parent)
    except FileNotFoundError as problem:
        raise OutputError(f"cannot write '{path}': no folder '{target.parent}'; make it first") from problem
    except (OSError, ValueError) as problem:  # ValueError: a NUL in the path
        reason = getattr(problem, "strerror", None) or problem
        raise OutputError(f"cannot write '{path}': {reason}; choose another place, or make room there") from problem


def _mode(target: Path) -> int | None:
    """Permissions to keep; None for a file that is new."""
    try:
        mode = os.stat(target).st_mode
    except FileNotFoundError:
        return None
    if not stat.S_ISREG(mode):  # replacing /dev/null or a pipe would destroy it
        what = "a folder" if stat.S_ISDIR(mode) else "not a regular file"
        raise OutputError(f"cannot write '{target}': it is {what}; name a file")
    if not os.access(target, os.W_OK):  # a rename would get past the protection of the file
        raise OutputError(f"cannot write '{target}': it is write-protected; choose another name or change its mode")
    return stat.S_IMODE(mode)


def _write_new(path: Path, data: bytes, mode: int | None) -> None:
    with open(path, "xb") as file:
        file.write(data)
        file.flush()
        if mode is not None:
            os.chmod(path, mode)
        os.fsync(file.fileno())


def _sync_folder(folder: Path) -> None:
    """Make the rename last through a power cut; the file is in place by now, so failing here is no failure."""
    if os.name == "nt":  # Windows opens no folders
        return
    with suppress(OSError):
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)
