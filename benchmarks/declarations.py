"""Visible tuples of scenes, methods and metrics: names stand once, modules load when needed."""

from __future__ import annotations

import importlib
import importlib.util
import inspect
import re
import sys
import traceback
from collections.abc import Callable, Iterable
from pathlib import Path
from types import ModuleType
from typing import Any, Protocol, TypeVar


class Named(Protocol):
    """An entry with a name."""

    @property
    def name(self) -> str:
        """Unique among its kind."""


Entry = TypeVar("Entry", bound=Named)
_ATTRIBUTE = re.compile(r"^ {4}(\w+(?:, \w+)*): ((?:.|\n {5,})*)", re.M)


class DeclarationError(ValueError):
    """A declaration that cannot be meant; the message names it and what to do."""


def attributes_of(kind: type) -> dict[str, str]:
    """Return attribute -> text, as the docstring of a class describes them; nothing where it does not.

    >>> attributes_of(DeclarationError)
    {}
    """
    _, _, section = (inspect.getdoc(kind) or "").partition("Attributes:\n")
    entries = _ATTRIBUTE.findall(re.split(r"\n\n\S", section)[0])
    return {names: " ".join(content.split()).rstrip(".") for names, content in entries}


def by_name(kind: str, entries: Iterable[Entry]) -> dict[str, Entry]:
    """Return name -> entry, in their order. Raises DeclarationError where two have one name."""
    index: dict[str, Entry] = {}
    for entry in entries:
        if entry.name in index:
            homes = [getattr(e, "declared_in", None) for e in (index[entry.name], entry)]
            names = " and by ".join(home or "the project itself" for home in homes)
            by = "" if None in homes else f", by {names}"
            raise DeclarationError(f"{kind} '{entry.name}' is declared twice{by}: rename one")
        index[entry.name] = entry
    return index


def load(module: str) -> ModuleType:
    """Import the module of that dotted name, or of that file: an absolute path that ends with ".py".

    A file is imported by its stem, its folder last of those from which modules are imported. Raises
    DeclarationError where its stem means another module, and whatever its import raises.
    """
    if not module.endswith(".py"):
        return importlib.import_module(module)
    path = Path(module)
    if str(path.parent) not in sys.path:
        sys.path.append(str(path.parent))
    importlib.invalidate_caches()  # it may have been written a moment ago
    demand_import(path.stem, path)
    return importlib.import_module(path.stem)


def load_function(place: str, usual: str) -> Callable[..., Any]:
    """Return the function that "module:function" names; without a colon the one called `usual`."""
    module, _, name = (place, "", "") if place.endswith(".py") else place.partition(":")
    return getattr(load(module), name or usual)


def raised_at(error: BaseException, home: str) -> str:
    """Return file and line where an error was raised in or below the folder of a user's file; else empty."""
    if isinstance(error, SyntaxError) and error.filename:
        return f"{error.filename}: line {error.lineno}"
    lines = traceback.extract_tb(error.__traceback__)
    frames = [frame for frame in lines if Path(frame.filename).is_relative_to(Path(home).parent)]
    return f"{frames[-1].filename}: line {frames[-1].lineno}" if frames else ""


def demand_import(name: str, path: Path) -> None:
    """Raise DeclarationError unless the module of that name is imported from that file."""
    spec = importlib.util.find_spec(name) if name.replace(".", "_").isidentifier() else None
    if not (spec and spec.origin and Path(spec.origin).is_file() and path.samefile(spec.origin)):
        otherwise = (
            f"Python knows {name} as {spec.origin or 'another'}" if spec else "no module has such a name"
        )
        raise DeclarationError(f"{path}: {otherwise}: give the file another name")
