"""One run at a time in a folder: two would write over each other's files."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path


class HeldError(ValueError):
    """The folder is another run's at this moment, or cannot be one; the message names it."""


@contextmanager
def held(folder: Path) -> Iterator[None]:
    """Hold a folder, made where it is not there. Raises HeldError where another run, or a file, has it.

    A folder made here that stayed empty, because the request was refused, is removed.
    The lock lies on the folder itself and leaves no file. The system releases it with the process, however
    that ended. Where the system or its file system has no such locks nothing is held, and that is said.
    """
    made = not folder.exists()
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except (FileExistsError, NotADirectoryError):
        raise HeldError(f"--out {folder}: there is a file in the way; name another folder") from None
    except OSError as error:
        raise HeldError(f"--out {folder}: cannot be made ({error.strerror}); name another folder") from None
    with ExitStack() as closing:
        try:
            import fcntl

            hold = os.open(folder, os.O_RDONLY)
            closing.callback(os.close, hold)
            fcntl.flock(hold, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise HeldError(
                f"--out {folder}: another run is going on there; wait for its end or name another folder"
            ) from None
        except (ImportError, OSError):
            print(f"{folder}: cannot be locked here; let no other run use it", file=sys.stderr)
        try:
            yield
        finally:
            if made:
                with suppress(OSError):  # not empty
                    folder.rmdir()
