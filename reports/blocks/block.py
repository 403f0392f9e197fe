"""Kinds of report blocks, and the report that they are filled from."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from reports.blocks.printed_tables import unchanged
from reports.figures.figure import Figure, Picture
from reports.run.finished_run import Run
from reports.tables.table import Table

ROWS = 12  # of a printed table; the CSV has all


@dataclass(frozen=True)
class Report:
    """Material of a report: the run, its tables and its pictures, both by name."""

    run: Run
    tables: Mapping[str, Table]
    pictures: Mapping[str, Sequence[Picture]]

    @property
    def subtitle(self) -> str:
        """Preset, commit or version, and day of the run."""
        config = self.run.config
        parts = [f"preset {config['preset']}"] if config.get("preset") else []
        if made_by := str(config.get("commit") or ""):  # an installed package knows its version alone
            parts += [made_by if made_by.startswith("version ") else f"commit {made_by}"]
        parts += [str(config["started"])[:10]] if config.get("started") else []
        return " · ".join(parts)


@dataclass(frozen=True)
class Heading:
    """A heading; it stands only where a block below it has content."""

    title: str


@dataclass(frozen=True)
class SentenceBlock:
    """Sentences, each with the topic it begins with; small: in small print."""

    make: Callable[[Run], list[tuple[str, str]]]
    small: bool = False


@dataclass(frozen=True)
class TableBlock:
    """A table; printed: gives the part of it that the PDF prints, at most so many lines."""

    name: str
    most: int = ROWS
    printed: Callable[[Run, Table], Table] = unchanged


Block = Heading | SentenceBlock | Figure | TableBlock
