"""python -m reports.docs: make the generated parts of README and docs anew."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

from reference_sim.command_line import Parser, command
from reference_sim.files.atomic_files import replacing

ROOT = Path(__file__).resolve().parents[1]


def documents(root: Path = ROOT) -> Iterator[tuple[Path, str, str]]:
    """Yield (path, text, text with its generated parts made anew) of README, docs/ and the page of entries.

    Raises:
        ValueError: for a part of no known form or without an end; names the document.
    """
    from reports.entries import ENTRIES, PAGE, page_of
    from reports.statistics.outcomes import DEFAULT, PUBLISHED, read_published
    from reports.text.published_parts import fill, published_part  # loads pandas

    for path in sorted([root / "README.md", *(root / "docs").rglob("*.md")]):
        text = path.read_text(encoding="utf-8")
        try:
            yield path, text, fill(text, published_part)
        except (ValueError, LookupError, ImportError) as error:
            raise ValueError(f"{path}: {error}") from None
    if (entries := root / ENTRIES).is_dir():
        path = entries / PAGE
        page = page_of(entries, DEFAULT, read_published(PUBLISHED / DEFAULT))
        yield path, path.read_text(encoding="utf-8") if path.is_file() else "", page


@command("reports.docs", goes_on="the same command begins again")
def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; return its exit status."""
    parser = Parser(
        prog="python -m reports.docs",
        description="Make the parts of README.md and docs/ behind '<!-- generated: ... -->' from the runs in "
        "reports/published and from the code, and the page of entries.",
        epilog="Exit status: 0 when all is up to date or written, 1 when --check finds a part that is not, 2 "
        "for a part or a run that cannot be read.",
    )
    parser.add_argument("--check", action="store_true", help="write nothing; name documents out of date")
    options = parser.parse_args(arguments)
    stale = [(path, content) for path, text, content in documents() if content != text]
    for path, content in stale:
        if options.check:
            print(
                f"{path}: not what the published runs give; run python -m reports.docs", file=sys.stderr
            )
        else:
            with replacing(path) as temporary:
                temporary.write_text(content, encoding="utf-8", newline="\n")
            print(path)
    return 1 if stale and options.check else 0


if __name__ == "__main__":
    raise SystemExit(main())
