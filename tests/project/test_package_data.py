"""A wheel has every data file of the packages, and the licences."""

from __future__ import annotations

import tomllib
from fnmatch import fnmatchcase
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
LAYERS = ("reference_sim", "snug", "benchmarks", "reports")
SOURCE = (".py", ".pyi", ".pyc", ".nbi", ".nbc")
SETTINGS = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))


def data_files() -> list[Path]:
    """Return the files of the packages that are no source, as paths below the root."""
    files = [path for layer in LAYERS for path in (ROOT / layer).rglob("*") if path.is_file()]
    data = [
        path
        for path in files
        if path.suffix not in SOURCE and not {"__pycache__", "published"} & {*path.parts}
    ]
    return [path.relative_to(ROOT) for path in data]


def is_named(path: Path, patterns: dict[str, list[str]]) -> bool:
    """Return whether a pattern of a package above a file has it."""
    return any(
        fnmatchcase(path.relative_to(above).as_posix(), pattern)
        for above in path.parents
        for pattern in patterns.get(".".join(above.parts), ())
    )


def test_every_data_file_is_named_among_the_data_of_its_package():
    patterns = SETTINGS["tool"]["setuptools"]["package-data"]
    files = data_files()
    assert any(path.suffix == ".safetensors" for path in files) and len(files) > 8
    assert [path.as_posix() for path in files if not is_named(path, patterns)] == []


def test_the_licences_are_there():
    named = SETTINGS["project"]["license-files"]
    notices = [path.relative_to(ROOT).as_posix() for path in ROOT.rglob("snug/**/NOTICE.md")]
    assert {"LICENSE", *notices} == set(named) and all((ROOT / name).is_file() for name in named)
