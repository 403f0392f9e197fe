"""Commands: a wrong word, bad input, a full disk or an interrupt is one line and an exit status."""

from __future__ import annotations

import argparse
import functools
import sys
from collections.abc import Callable
from typing import Any, NoReturn, ParamSpec

BAD_INPUT, NO_ROOM, INTERRUPTED = 2, 1, 130  # exit status
Given = ParamSpec("Given")


class WrongWord(ValueError):
    """An argument that the command does not take."""


class Parser(argparse.ArgumentParser):
    """One line for a wrong word in place of the whole usage; examples stay as they are written."""

    def __init__(self, **options: Any) -> None:
        plain = argparse.RawDescriptionHelpFormatter
        super().__init__(formatter_class=plain, allow_abbrev=False, **options)

    def error(self, message: str) -> NoReturn:
        raise WrongWord(f"{message}; see --help")


def command(
    program: str, *, goes_on: str = "", bad_input: tuple[type[Exception], ...] = (ValueError,)
) -> Callable[[Callable[Given, int]], Callable[Given, int]]:
    """main() of `python -m program`, which then gives an exit status whatever input it has met.

    goes_on: how work that was stopped is taken up again; without it nothing is left of such work. bad_input:
    what says of input, in its message, where it is wrong; OSError does so besides. Others are faults of the
    program, and raised.
    """

    refused: tuple[type[Exception], ...] = (*bad_input, WrongWord, OSError)

    def with_status(main: Callable[Given, int]) -> Callable[Given, int]:
        @functools.wraps(main)
        def run(*arguments: Given.args, **named: Given.kwargs) -> int:
            try:
                return main(*arguments, **named)
            except refused as error:
                from reference_sim.files.atomic_files import disk_full  # not loaded for --help

                full = disk_full(error)
                said, status = full or str(error), NO_ROOM if full else BAD_INPUT
                left = goes_on if full else ""
            except KeyboardInterrupt:
                said, status, left = "interrupted", INTERRUPTED, goes_on or "nothing was written"
            print(f"{program}: {' '.join('; '.join(filter(None, (said, left))).split())}", file=sys.stderr)
            return status

        return run

    return with_status
