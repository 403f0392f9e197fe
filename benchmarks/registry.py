"""What the visible tuples of scenes, methods and metrics have in common: each name stands once."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Protocol, TypeVar


class Named(Protocol):
    """What has a name."""

    @property
    def name(self) -> str:
        """Unique among its kind."""


Entry = TypeVar("Entry", bound=Named)


class DeclarationError(ValueError):
    """A declaration that cannot be meant; the message names it and what to do."""


def by_name(what: str, entries: Iterable[Entry]) -> dict[str, Entry]:
    """Name -> entry, in their order. Raises DeclarationError where two have one name."""
    found: dict[str, Entry] = {}
    for entry in entries:
        if entry.name in found:
            raise DeclarationError(f"{what} '{entry.name}' is declared twice: give each a name of its own")
        found[entry.name] = entry
    return found
