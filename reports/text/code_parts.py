"""Tables of a document whose texts the code has: options, attributes, recipes, sizes, studies."""

from __future__ import annotations

import re
from argparse import SUPPRESS, ArgumentParser
from collections.abc import Sequence
from importlib import import_module

from benchmarks.declarations import attributes_of
from benchmarks.metrics import declared
from benchmarks.plan.options import make_parser
from benchmarks.plan.study import PACKAGED, read_study
from benchmarks.presets import PRESETS
from snug.motion.library import source_rows
from snug.named_recipes import RECIPES

Rows = list[tuple[str, ...]]
ALL = 10_000  # frames or more: whole motions


def option_rows(parser: ArgumentParser) -> Rows:
    """Return a heading and a row of each option of a command, with the text of its --help.

    >>> parser = ArgumentParser()
    >>> _ = parser.add_argument("--seed", metavar="N", default=0, help="of training (default %(default)s)")
    >>> option_rows(parser)[1]
    ('`--seed N`', 'of training (default 0)')
    """
    texts = parser._get_formatter()
    shown = [action for action in parser._actions if action.option_strings and action.help != SUPPRESS]
    rows = [
        (f"`{texts._format_action_invocation(action)}`", texts._expand_help(action).replace("<", "\\<"))
        for action in shown
    ]
    return [("Option", "Meaning"), *(row for row in rows if "--help" not in row[0])]


def chosen_rows(rows: Rows, names: Sequence[str]) -> Rows:
    """Return the heading and the rows whose first cells have these names, in their order; all without names.

    >>> chosen_rows([("Field", "Content"), ("`dt`", "[s]"), ("`frames`", "number")], ["frames"])
    [('Field', 'Content'), ('`frames`', 'number')]
    """
    row_of_name = {name: row for row in rows[1:] for name in re.findall(r"[\w-]+", row[0])}
    return [rows[0], *(row_of_name[name] for name in names)] if names else rows


def attribute_rows(path: str) -> Rows:
    """Return a heading and a row of each attribute that the docstring of a class describes.

    Args:
        path: module and class, as "reference_sim.material.Material".

    >>> attribute_rows("benchmarks.method.Reporting")[2]
    ('`level`', 'place on that curve, as a number of iterations or a tolerance')
    """
    module, _, name = path.rpartition(".")
    entries = attributes_of(getattr(import_module(module), name))
    rows = [(f"`{names.replace(', ', '`, `')}`", content) for names, content in entries.items()]
    return [("Field", "Content"), *rows]


def docstring_rows(module: str) -> Rows:
    """Return the rows of the table in the docstring of a module.

    >>> docstring_rows("snug.body.smpl_files")[2]
    ('faces, closed and wound outwards', '`f`, `faces`', '(F, 3)')
    """
    text = import_module(module).__doc__ or ""
    lines = [line.strip("|") for line in text.splitlines() if line.startswith("|")]
    rows: Rows = [tuple(cell.strip() for cell in line.split("|")) for line in lines]
    return [rows[0], *rows[2:]]


def recipe_rows(names: str) -> Rows:
    """Return a heading and a row of each option in which recipes differ: values, first sentence on it.

    Args:
        names: of the recipes, as "default, paper".

    >>> recipe_rows("default, paper")[4][:3]
    ('`zero_last_layer`', 'True', 'False')
    """
    chosen = names.split(", ")
    rows: Rows = []
    for option, meaning in attribute_rows("snug.recipe.Recipe")[2:]:
        values = [getattr(RECIPES[name], option.strip("`")) for name in chosen]
        if len(set(values)) > 1:
            texts = (f"{value:g}" if isinstance(value, float) else str(value) for value in values)
            rows.append((option, *texts, meaning.partition(". ")[0]))
    return [("Option", *(f"Recipe `{name}`" for name in chosen), "Meaning"), *rows]


def metric_rows() -> Rows:
    """Return a heading and a row of each declared metric: name, unit, definition."""
    rows = ((f"`{metric.name}`", metric.unit, metric.definition) for metric in declared().values())
    return [("Metric", "Unit", "Definition"), *rows]


def size_rows() -> Rows:
    """Return a heading and a row of each set of sizes, with the steps of SNUG's training."""
    heads = ("Sizes", "Vertices", "Test motions", "Frames of each", "Steps of SNUG", "Description")
    rows = []
    for preset in PRESETS:
        motions = "all" if preset.test_motions is None else str(preset.test_motions)
        frames = "all" if preset.frames >= ALL else f"at most {preset.frames}"
        sizes = (str(preset.garment_vertices), motions, frames, f"{preset.steps['snug']:,}")
        rows.append((f"`{preset.name}`", *sizes, preset.description))
    return [heads, *rows]


def study_rows() -> Rows:
    """Return a heading and a row of each study of the package: its question and parts."""
    studies = {path.stem: read_study(path.stem) for path in sorted(PACKAGED.glob("*.toml"))}
    rows = [(f"`{name}`", study.question, ", ".join(study.parts)) for name, study in studies.items()]
    return [("Study", "Question", "Parts"), *rows]


def part_rows() -> Rows:
    """Return a heading and a row of each part of the studies that are no published run."""
    parts = read_study("full").parts
    return [("Part", "Question"), *((f"`{name}`", part.question) for name, part in parts.items())]


PARTS = {
    "metrics": metric_rows,
    "sizes": size_rows,
    "studies": study_rows,
    "parts": part_rows,
    "options of benchmarks.run": lambda: option_rows(make_parser()),
    "sources of the library": lambda: list(source_rows()),
}
