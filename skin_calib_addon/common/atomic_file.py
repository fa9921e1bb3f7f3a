"""Replace files atomically: a reader sees the old bytes or the new ones, also after a crash."""

import os
import re
import secrets
import stat
import time
from contextlib import suppress
from pathlib import Path

from .errors import OutputError

# [s] age from which a temporary file belongs to a program that was killed. Larger: remains stay longer; smaller: slow
# disks lose files.
MAX_AGE = 60.0
TEMPORARY = re.compile(r"\.skin-[0-9a-f]{16}\.tmp")  # names of temporary files


def write_bytes_safely(path: str | os.PathLike[str], data: bytes) -> None:
    """Replace the content of a file in one step.

    The target of a symbolic link is replaced. The mode of the file is kept.
    """
    try:
        target = Path(os.path.realpath(path))
        mode = _mode(target)
        _remove_remains(target.parent)
        temporary = target.with_name(f".skin-{secrets.token_hex(8)}.tmp")  # same folder: a rename stays atomic
        try:
            _write_new(temporary, data, mode)
            os.replace(temporary, target)
        except BaseException:
            with suppress(OSError):
                os.unlink(temporary)
            raise
        _sync_folder(target.parent)
    except (OSError, ValueError) as problem:  # ValueError: a NUL in the path
        if isinstance(problem, FileNotFoundError) and not os.path.isdir(target.parent):  # /proc exists, and refuses too
            raise OutputError(
                f"cannot write '{path}': the folder '{target.parent}' does not exist. Create it first."
            ) from problem
        reason = getattr(problem, "strerror", None) or problem
        raise OutputError(f"cannot write '{path}': {reason}. Choose another folder, or free disk space.") from problem


def make_folder(folder: Path) -> None:
    """Create a folder, or keep the one that exists; raise OutputError if that is not possible."""
    try:
        folder.mkdir(exist_ok=True)
    except OSError as problem:
        raise OutputError(f"the folder {folder} cannot be created: {problem}. Choose another one.") from problem


def check_writable(path: str | os.PathLike[str]) -> None:
    """Raise OutputError if a file cannot be replaced: a folder, a device, or a file that is write-protected."""
    with suppress(OSError, ValueError):  # writing it states what is wrong
        _mode(Path(os.path.realpath(path)))


def is_same_file(a: Path, b: Path) -> bool:
    """Return whether two paths are the same file, existing or not; False for a folder."""
    if os.path.isdir(a):
        return False
    try:
        return os.path.samefile(a, b)
    except (OSError, ValueError):
        return os.path.realpath(a) == os.path.realpath(b)


def _remove_remains(folder: Path) -> None:
    """Remove the temporary files of programs that were killed while they wrote."""
    with suppress(OSError):
        for path in folder.glob(".skin-*.tmp"):
            with suppress(OSError):
                if TEMPORARY.fullmatch(path.name) and time.time() - path.stat().st_mtime > MAX_AGE:
                    path.unlink()


def _mode(target: Path) -> int | None:
    """Return the permissions to keep; None for a new file."""
    try:
        mode = os.stat(target).st_mode
    except FileNotFoundError:
        return None
    if not stat.S_ISREG(mode):  # replacing /dev/null or a pipe would destroy it
        what = "a folder" if stat.S_ISDIR(mode) else "not a regular file"
        raise OutputError(f"cannot write '{target}': it is {what}. Name a file.")
    if not os.access(target, os.W_OK):  # a rename would bypass the write protection
        raise OutputError(f"cannot write '{target}': it is write-protected. Choose another name, or change its mode.")
    return stat.S_IMODE(mode)


def _write_new(path: Path, data: bytes, mode: int | None) -> None:
    with open(path, "xb") as file:
        file.write(data)
        file.flush()
        if mode is not None:
            os.chmod(path, mode)
        os.fsync(file.fileno())


def _sync_folder(folder: Path) -> None:
    """Make the rename survive a power cut; a failure is ignored because the file is complete."""
    if os.name == "nt":  # Windows cannot open folders
        return
    with suppress(OSError):
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)
