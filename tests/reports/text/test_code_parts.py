"""Tables of documents that come from the code: each row has the text that stands there."""

from __future__ import annotations

from dataclasses import fields

import pytest

from benchmarks.external.roll_out_files import KEYS
from benchmarks.method import MethodEntry
from benchmarks.results.row import COLUMNS
from benchmarks.scene import BuiltScene
from reports.text.code_parts import attribute_rows, docstring_rows
from snug.body.smpl_files import SYNONYMS
from snug.motion.files import ARRAY_NAMES


@pytest.mark.parametrize(
    ("path", "names"),
    [
        ("benchmarks.results.row.Row", COLUMNS),
        ("benchmarks.method.MethodEntry", [field.name for field in fields(MethodEntry)]),
        ("benchmarks.scene.BuiltScene", [field.name for field in fields(BuiltScene)]),
    ],
)
def test_the_table_of_a_class_has_each_of_its_fields_once(path, names):
    listed = [name.strip("`") for cell, _ in attribute_rows(path)[1:] for name in cell.split(", ")]
    assert sorted(listed) == sorted(names)
    assert all(text and not text.endswith(".") for _, text in attribute_rows(path))


@pytest.mark.parametrize(
    ("module", "names"),
    [
        ("snug.body.smpl_files", [name for names in SYNONYMS.values() for name in names]),
        ("snug.motion.files", ARRAY_NAMES),
        ("benchmarks.external.roll_out_files", KEYS),
    ],
)
def test_tables_of_files_have_every_array_that_is_read(module, names):
    table = " ".join(cell for row in docstring_rows(module) for cell in row)
    assert not [name for name in names if f"`{name}`" not in table]
