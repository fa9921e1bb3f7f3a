"""Replace files atomically: a reader sees the old bytes or the new ones, also after a crash. Write whole folders."""

import hashlib
import json
import os
import re
import secrets
import shutil
import stat
import time
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

from .errors import OutputError
from .file_hash import file_hash

# [s] age from which a temporary file belongs to a program that was killed. Larger: remains stay longer; smaller: slow
# disks lose files.
MAX_AGE = 60.0
TEMPORARY = re.compile(r"\.skin-[0-9a-f]{16}\.tmp")  # names of temporary files and folders
LIST = "skin-calib.json"  # Format: file with the hashes of all other files of a folder that is written as a whole


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


def write_folder_safely(folder: Path, files: Mapping[str, bytes]) -> None:
    """Write a folder with files, by their paths, as a whole; replace one that an earlier call wrote."""
    _check_replaceable(folder)
    target = Path(os.path.realpath(folder))
    hashes = {path: hashlib.sha256(data).hexdigest() for path, data in files.items()}
    new, old = (target.with_name(f".skin-{secrets.token_hex(8)}.tmp") for _ in range(2))
    try:
        _remove_remains(target.parent)
        try:
            for path, data in {**files, LIST: (json.dumps(hashes, indent=2) + "\n").encode()}.items():
                (new / path).parent.mkdir(parents=True, exist_ok=True)
                _write_new(new / path, data, None)
            with suppress(FileNotFoundError):
                os.rename(target, old)
            os.rename(new, target)
        except BaseException:
            if old.exists() and not target.exists():
                os.rename(old, target)
            raise
        finally:
            for remains in (new, old):
                shutil.rmtree(remains, ignore_errors=True)
        _sync_folder(target.parent)
    except (OSError, ValueError) as problem:
        reason = getattr(problem, "strerror", None) or problem
        raise OutputError(f"cannot write '{folder}': {reason}. Choose another folder, or free disk space.") from problem


def _check_replaceable(folder: Path) -> None:
    """Refuse a folder with anything else than what :func:`write_folder_safely` wrote to it."""
    if not os.path.lexists(folder):
        return
    if not os.path.isdir(folder):
        raise OutputError(f"{folder} exists, and is not a folder. Choose another name.")
    found = [p.relative_to(folder).as_posix() for p in sorted(folder.rglob("*")) if p.is_symlink() or not p.is_dir()]
    try:
        hashes = json.loads((folder / LIST).read_bytes())
        problems = [
            f"{p} is not of this export, or was edited" for p in found if p != LIST and _differs(p, hashes, folder)
        ]
    except (OSError, ValueError, AttributeError, RecursionError):
        problems = ["it is not of an earlier export"] if found else []
    if problems:
        raise OutputError(f"{folder} would be replaced, but {problems[0]}. Choose another folder, or remove this one.")


def _differs(path: str, hashes: Mapping[str, str], folder: Path) -> bool:
    return hashes.get(path) is None or hashes[path] != file_hash(folder / path)


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
    """Remove the temporary files and folders of programs that were killed while they wrote."""
    with suppress(OSError):
        for path in folder.glob(".skin-*.tmp"):
            with suppress(OSError):
                if TEMPORARY.fullmatch(path.name) and time.time() - path.stat().st_mtime > MAX_AGE:
                    shutil.rmtree(path) if path.is_dir() else path.unlink()


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
