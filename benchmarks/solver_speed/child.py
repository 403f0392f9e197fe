"""What runs in the process of one case."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from multiprocessing.connection import Connection

from ..cell import peak_memory

Row = tuple[str, object, str]  # metric, value, unit


def report(part: str, case: str, repeats: int, sender: Connection) -> None:
    """Measure one case of a part and send its rows, with the peak memory of this process."""
    measure: Callable[[str, int], list[Row]] = importlib.import_module(f".{part}", __package__).measure
    try:
        rows = measure(case, repeats)
    except Exception as error:
        rows = [("failed", " ".join(f"{type(error).__name__}: {error}".split()), "")]
    sender.send([*rows, ("peak memory of the process", peak_memory(), "MB")])
