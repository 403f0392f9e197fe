"""A wheel has every data file of the packages, and the licences."""

from __future__ import annotations

import tomllib
from fnmatch import fnmatchcase

from tests.project.test_layers import LAYERS, ROOT

SOURCE = (".py", ".pyi", ".pyc", ".nbi", ".nbc")
SETTINGS = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))


def test_every_data_file_is_named_among_the_data_of_its_package():
    patterns = SETTINGS["tool"]["setuptools"]["package-data"]
    files = [path for layer in LAYERS for path in (ROOT / layer).rglob("*") if path.is_file()]
    left_out = {"__pycache__", "published", "runs"}
    inside = [path.relative_to(ROOT) for path in files if not left_out & {*path.parts}]
    data = [path for path in inside if path.suffix not in SOURCE]
    unnamed = [
        path.as_posix()
        for path in data
        if not any(
            fnmatchcase(path.relative_to(above).as_posix(), pattern)
            for above in path.parents
            for pattern in patterns.get(".".join(above.parts), ())
        )
    ]
    assert any(path.suffix == ".safetensors" for path in data) and len(data) > 8 and unnamed == []


def test_the_licences_are_there():
    named = SETTINGS["project"]["license-files"]
    notices = [path.relative_to(ROOT).as_posix() for path in (ROOT / "snug").rglob("NOTICE.md")]
    assert {"LICENSE", *notices} == set(named) and all((ROOT / name).is_file() for name in named)
