"""Errors in one line."""

from __future__ import annotations


def one_line(error: BaseException) -> str:
    r"""Return class and message of an error in one line.

    >>> one_line(ValueError("too\nlong"))
    'ValueError: too long'
    """
    return " ".join(f"{type(error).__name__}: {error}".split())
