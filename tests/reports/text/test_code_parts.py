"""Tables of documents that come from the code: each row has the text that stands there."""

from __future__ import annotations

from argparse import ArgumentParser
from dataclasses import fields

import pytest

from benchmarks.external.roll_out_files import KEYS
from benchmarks.method import MethodEntry
from benchmarks.presets import PRESETS
from benchmarks.results.row import COLUMNS
from benchmarks.scene import BuiltScene
from reports.text.code_parts import PARTS, attribute_rows, docstring_rows, option_rows, recipe_rows
from snug.body.smpl_files import SYNONYMS
from snug.motion.files import ARRAY_NAMES
from snug.named_recipes import PAPER
from snug.recipe import DEFAULT


def test_every_option_of_a_command_but_help_has_a_row_with_its_default():
    parser = ArgumentParser()
    parser.add_argument(
        "--frames", type=int, default=7, metavar="N", help="of <motion> (default %(default)s)"
    )
    parser.add_argument("RUN", help="no option")
    assert option_rows(parser)[1:] == [("`--frames N`", r"of \<motion> (default 7)")]


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


def test_sizes_studies_and_options_have_a_row_each():
    assert [row[0] for row in PARTS["sizes"]()[1:]] == [f"`{preset.name}`" for preset in PRESETS]
    assert dict((row[0], row[1:]) for row in PARTS["sizes"]())["`quick`"][:3] == (
        "1000",
        "8",
        "at most 150",
    )
    assert ("`handles`", "garments") in [(row[0], row[2]) for row in PARTS["studies"]()]
    assert "`--trained [DIR]`" in dict(PARTS["options of benchmarks.run"]())
    assert all(len(set(map(len, part()))) == 1 for part in PARTS.values())


def test_recipes_are_compared_in_the_options_that_differ():
    rows = {row[0].strip("`"): row[1:3] for row in recipe_rows("default, paper")[1:]}
    same = {
        field.name for field in fields(DEFAULT) if getattr(DEFAULT, field.name) == getattr(PAPER, field.name)
    }
    assert rows.keys() == {field.name for field in fields(DEFAULT)} - same - {"name"}
    assert rows["contact_margin"] == ("None", "0.002") and rows["schedule"] == ("cosine", "epochs")
    meanings = {row[0].strip("`"): row[3] for row in recipe_rows("default, paper")[1:]}
    assert meanings["remembered"].endswith("instead of to zero")  # the first of two sentences


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
