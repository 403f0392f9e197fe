"""Files and folders that appear whole or not at all, also where the disk is full."""

from __future__ import annotations

import errno
import os
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

NO_ROOM_ERRORS = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Give a temporary name beside `path`: renamed to it when the block ends well, else removed.

    The file that was there before stays until the new one is on the disk. OSError of a full disk names it.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    # A name that nobody can foresee: a link that lay there would be followed.
    temporary = path.with_name(f".{path.stem}.{secrets.token_hex(8)}.part{path.suffix}")
    try:
        yield temporary
        with temporary.open("rb+") as file:
            os.fsync(file.fileno())
        os.replace(temporary, path)
    except OSError as error:
        if error.errno in NO_ROOM_ERRORS:
            error.filename, error.filename2 = str(path), None
        raise
    finally:
        temporary.unlink(missing_ok=True)


def demand_new(folder: Path) -> None:
    """Raise ValueError where something exists that a new folder would replace."""
    if folder.exists() and not (folder.is_dir() and not any(folder.iterdir())):
        raise ValueError(f"{folder}: is there already; name a new folder")


def is_writable(folder: Path) -> bool:
    """Return whether files can be written into a folder, or the folder can be made."""
    place = next(place for place in (folder, *folder.absolute().parents) if place.exists())
    return place.is_dir() and os.access(place, os.W_OK | os.X_OK)


def demand_writable_folder(folder: Path) -> None:
    """Raise ValueError unless `is_writable`."""
    if not is_writable(folder):
        raise ValueError(f"{folder}: cannot be written to; name another folder")


@contextmanager
def new_folder(folder: Path) -> Iterator[Path]:
    """Give a folder to fill: under its name once the block ends well, gone when it does not.

    Raises ValueError where something exists under that name, or no folder can be made.
    """
    demand_new(folder)
    target = folder.resolve()
    part = target.with_name(f".{target.name}.{secrets.token_hex(8)}.part")
    try:
        part.mkdir(parents=True)
    except OSError as error:
        if error.errno in NO_ROOM_ERRORS:
            raise
        raise ValueError(f"{folder}: cannot be made ({error.strerror}); name another folder") from None
    try:
        yield part
        if target.is_dir():  # and empty; not every system replaces it
            target.rmdir()
        part.replace(target)
    finally:
        shutil.rmtree(part, ignore_errors=True)


def disk_full(error: BaseException) -> str:
    """Return one line on the file that found no room and how much there is; "" for any other error."""
    if not isinstance(error, OSError) or error.errno not in NO_ROOM_ERRORS:
        return ""
    path = Path(error.filename or ".").absolute()
    folder = next((parent for parent in path.parents if parent.is_dir()), Path())
    free = shutil.disk_usage(folder).free / 1e6
    name = error.filename or "a file"
    return f"{name}: {error.strerror} ({free:.3g} MB are free there)"
