"""Frame of all commands: progress, and one line and an exit status for whatever they meet."""

from __future__ import annotations

import argparse
import functools
import os
import sys
from collections.abc import Callable
from itertools import chain
from pathlib import Path
from typing import Any, NoReturn, ParamSpec

from reference_sim.files.atomic_files import disk_full, is_writable

BAD_INPUT, DISK_FULL, INTERRUPTED = 2, 1, 130  # exit status
Given = ParamSpec("Given")


class WrongWord(ValueError):
    """Argument that the command does not take."""


class Parser(argparse.ArgumentParser):
    """Argument parser that answers a wrong word with one line and leaves examples as they are."""

    def __init__(self, **options: Any) -> None:
        plain = argparse.RawDescriptionHelpFormatter
        super().__init__(formatter_class=plain, allow_abbrev=False, **options)

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Parse as the base class does.

        Raises WrongWord also for an empty value, as "$UNSET" leaves one, and for names that are no text.
        """
        arguments = sys.argv[1:] if args is None else args
        for word in (*arguments, os.getcwd()):
            if word.encode(errors="replace").decode() != word:
                self.error(f"{word!a} is no text: rename this file or folder")
        for option, word in zip(["", *arguments], arguments):
            if not word.strip(", ") or (word.startswith("--") and word.endswith("=")):
                self.error(f"{option} '{word}' names nothing: give a value, or leave it out")
        return super().parse_known_args(args, namespace)

    def error(self, message: str) -> NoReturn:
        """Raise WrongWord."""
        raise WrongWord(f"{message}; see --help")


def command(
    program: str, *, goes_on: str = "", bad_input: tuple[type[Exception], ...] = (ValueError,)
) -> Callable[[Callable[Given, int]], Callable[Given, int]]:
    """Make main() of `python -m program` return an exit status, whatever input it meets.

    Args:
        program: name that the line on standard error begins with.
        goes_on: how work that was stopped is taken up again; without it nothing is left of such work.
        bad_input: exceptions whose message says where the input is wrong; OSError does so besides. Others
            are faults of the program, and raised.
    """
    refused: tuple[type[Exception], ...] = (*bad_input, WrongWord, OSError)

    def with_status(main: Callable[Given, int]) -> Callable[Given, int]:
        @functools.wraps(main)
        def run(*arguments: Given.args, **named: Given.kwargs) -> int:
            try:
                return main(*arguments, **named)
            except refused as error:
                full = disk_full(error)
                problem, status = full or str(error), DISK_FULL if full else BAD_INPUT
                remedy = goes_on if full else ""
            except KeyboardInterrupt:
                problem, status, remedy = "interrupted", INTERRUPTED, goes_on or "nothing was written"
            line = "; ".join(filter(None, (problem, remedy)))
            print(f"{program}: {' '.join(line.split())}", file=sys.stderr)
            return status

        return run

    return with_status


SECONDS_OF_A_LOG = 30.0  # between two lines; a terminal has ten a second


def progress_bar(*args: Any, **options: Any) -> Any:
    """Return a bar of tqdm with these arguments, on stderr; a file gets a line every half minute."""
    from tqdm import tqdm

    seconds = 0.1 if sys.stderr.isatty() else SECONDS_OF_A_LOG
    return tqdm(*args, mininterval=seconds, maxinterval=max(10.0, seconds), **options)


def must_compile() -> bool:
    """Return whether no kernel lies compiled on disk."""
    files = (folder.rglob("reference_sim.*-*/*.nbi") for folder in _kernel_folders())
    return not any(chain.from_iterable(files))


def announce_compilation() -> None:
    """Say on stderr that kernels will be compiled, where none is yet, and where they will lie."""
    if not must_compile():
        return
    folders = _kernel_folders()
    writable = [folder for folder in folders if is_writable(folder)]
    message = "first use: kernels are compiled, about half a minute of each core, once"
    if not writable:
        message = (
            "kernels are compiled in about half a minute, in each process anew, for nothing can be kept in "
            f"{' or '.join(map(str, folders))}: set NUMBA_CACHE_DIR to a folder that can be written"
        )
    elif writable[0] != folders[0]:
        message += f", and kept in {writable[0]}: {folders[0]} is read-only"
    print(message, file=sys.stderr)


def _kernel_folders() -> list[Path]:
    """Return the places of reference_sim.kernels.kernel_cache, which is not imported: it loads numba."""
    if folder := os.environ.get("NUMBA_CACHE_DIR"):
        return [Path(folder)]
    cache = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return [Path(__file__).parent, Path(cache, "numba")]
