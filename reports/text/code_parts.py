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
    """Return the heading and the rows that are asked for, in the order of their names.

    Args:
        rows: a heading, then rows whose first cells have the names.
        names: as "--seed" or "dtype"; none for all rows.

    Raises:
        ValueError: a name that no row has.

    >>> chosen_rows([("Field", "Content"), ("`dt`", "[s]"), ("`frames`", "number")], ["frames"])
    [('Field', 'Content'), ('`frames`', 'number')]
    """
    if not names:
        return rows
    row_of_name = {name: row for row in rows[1:] for name in re.findall(r"[\w-]+", row[0])}
    if unknown := [name for name in names if name not in row_of_name]:
        raise ValueError(f"no row has the name '{unknown[0]}'")
    return [rows[0], *(row_of_name[name] for name in names)]


def attribute_rows(path: str) -> Rows:
    """Return a heading and a row of each attribute that the docstring of a class describes.

    Args:
        path: module and class, as "reference_sim.material.Material".

    Raises:
        ValueError: no such class, or one that describes no attributes.

    >>> attribute_rows("benchmarks.method.Reporting")[2]
    ('`level`', 'place on that curve, as a number of iterations or a tolerance')
    """
    module, _, name = path.rpartition(".")
    try:
        entries = attributes_of(getattr(import_module(module), name))
    except (ImportError, AttributeError, ValueError):
        raise ValueError(f"no class '{path}'") from None
    if not entries:
        raise ValueError(f"class '{path}' has no attributes in its docstring")
    rows = [(f"`{names.replace(', ', '`, `')}`", content) for names, content in entries.items()]
    return [("Field", "Content"), *rows]


def docstring_rows(module: str) -> Rows:
    """Return the rows of the table in the docstring of a module.

    Raises:
        ValueError: no such module, or one without a table in its docstring.

    >>> docstring_rows("snug.body.smpl_files")[2]
    ('faces, closed and wound outwards', '`f`, `faces`', '(F, 3), (F, 4)')
    """
    try:
        text = import_module(module).__doc__ or ""
    except ImportError:
        raise ValueError(f"no module '{module}'") from None
    lines = [line.strip("|") for line in text.splitlines() if line.startswith("|")]
    rows: Rows = [tuple(cell.strip() for cell in line.split("|")) for line in lines]
    if not rows:
        raise ValueError(f"module '{module}' has no table in its docstring")
    return [rows[0], *rows[2:]]


def recipe_rows(names: str) -> Rows:
    """Return a heading and a row of each option in which recipes differ: values, first sentence on it.

    Args:
        names: of the recipes, as "default, paper".

    Raises:
        ValueError: no recipe of that name.

    >>> recipe_rows("default, paper")[4][:3]
    ('`zero_last_layer`', 'True', 'False')
    """
    chosen = names.split(", ")
    if unknown := [name for name in chosen if name not in RECIPES]:
        raise ValueError(f"no recipe '{unknown[0]}'; choose from {', '.join(RECIPES)}")
    rows: Rows = []
    for option, meaning in attribute_rows("snug.recipe.Recipe")[2:]:
        values = [getattr(RECIPES[name], option.strip("`")) for name in chosen]
        if len(set(values)) > 1:
            rows.append((option, *(_setting(value) for value in values), meaning.partition(". ")[0]))
    return [("Option", *(f"Recipe `{name}`" for name in chosen), "Meaning"), *rows]


def _setting(value: object) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


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
}
