"""Methods, scenes, metrics and known answers that a user's file declares.

A file is named by its path, which means all that it declares. Entries carry it for other processes.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

from benchmarks.declarations import DeclarationError, by_name, demand_import, load, raised_at
from benchmarks.method import MethodEntry
from benchmarks.methods.declared_networks import TRAININGS
from benchmarks.metric import Metric
from benchmarks.metrics import MEASUREMENTS
from benchmarks.plan.study import Part, Study
from benchmarks.provenance import digest, find_imports, find_module
from benchmarks.results.run_folder import NOT_TAKEN
from benchmarks.scene import Scene
from benchmarks.validation.case import Case, cases_of

NAME = re.compile(NOT_TAKEN + r"[A-Za-z0-9_][A-Za-z0-9_+./@:-]{0,149}")  # it names files


class Kind(NamedTuple):
    """A kind of declaration: field of a study, tuple, entries, function that stands beside."""

    word: str
    tuple_name: str
    entry: type
    function: str = ""


METHODS = Kind("methods", "METHODS", MethodEntry, "make")
SCENES = Kind("scenes", "SCENES", Scene, "build")
METRICS = Kind("metrics", "METRICS", Metric, "measure")
KINDS = (METHODS, SCENES, METRICS)
CASES = Kind("cases", "", Case)  # declared by @known_answer, which stands on the function
OF_FIELD = {"scenes": SCENES, "optional_scenes": SCENES, "methods": METHODS, "cases": CASES}


def resolve(kind: Kind, names_and_paths: Sequence[str]) -> tuple[tuple[str, ...], list[Any]]:
    """Return names, and entries of files (*.py) among them, whose names take their places.

    Raises:
        DeclarationError: a file that cannot be read, or declares none.
    """
    files = {w: entries_of(kind, file_of(w)) for w in names_and_paths if w.endswith(".py")}
    names = [[e.name for e in files[w]] if w in files else [w] for w in names_and_paths]
    return tuple(name for group in names for name in group), [e for file in files.values() for e in file]


def declarations_of(study: Study) -> tuple[Study, list[Scene], list[MethodEntry], list[Case]]:
    """Read the files of a study; a known answer belongs to the part that names its file.

    Returns:
        The study with names in place of files, and the scenes, methods and known answers of these.

    Raises:
        DeclarationError: a file that cannot be read, or declares none.
    """
    declared: dict[Kind, list[Any]] = {SCENES: [], METHODS: [], CASES: []}

    def collect(part: Study | Part, suite: str = "") -> Any:
        changes: dict[str, Any] = {}
        for field, kind in ((field, kind) for field, kind in OF_FIELD.items() if hasattr(part, field)):
            changes[field], entries = resolve(kind, getattr(part, field))
            entries = [replace(case, suite=suite) for case in entries] if kind is CASES else entries
            declared[kind] += [entry for entry in entries if entry not in declared[kind]]
        return replace(part, **changes)

    parts = {name: collect(part, name) for name, part in study.parts.items()}
    study = replace(collect(study), parts=parts)
    check_networks(declared[METHODS])
    return study, declared[SCENES], declared[METHODS], declared[CASES]


def check_networks(entries: Sequence[MethodEntry]) -> None:
    """Raise DeclarationError where two trainings have one name."""
    trainings = dict(TRAININGS)
    for entry in (entry for entry in entries if entry.trained is not None):
        place, name = f"{entry.declared_in}: method '{entry.name}'", str(entry.trained)
        exists = entry.training or name in trainings
        _demand(exists, f"{place}: no training is called '{name}': say training=Training(...)")
        same = not entry.training or trainings.setdefault(name, entry.training) == entry.training
        _demand(same, f"{place}: another training is called '{name}': give trained=another")


def file_of(word: str) -> str:
    """Return the absolute path of a file that is there. Raises DeclarationError."""
    _demand(Path(word).is_file(), f"{word}: no such file")
    return str(Path(word).resolve())


def entries_of(kind: Kind, home: str) -> list[Any]:
    """Return what a file declares of that kind. Raises DeclarationError."""
    module = import_file(home)
    if kind is CASES:
        cases = cases_of(module.__name__)
        _demand(cases, f"{home}: declares no known answer, a function with @known_answer")
        return [replace(case, module=home) for case in cases]
    items: Any = getattr(module, kind.tuple_name, None)
    is_tuple = items and isinstance(items, tuple | list)
    if not (is_tuple and all(isinstance(entry, kind.entry) for entry in items)):
        raise DeclarationError(f"{home}: declares no {kind.tuple_name}, a tuple of {kind.entry.__name__}")
    by_name(kind.word[:-1], items)
    if kind is METRICS:
        entries = [replace(entry, declared_in=home) for entry in items]
    else:
        entries = [_complete(kind, entry, home) for entry in items]
    needs = home in {getattr(entry, "module", home) for entry in entries}
    _demand(not needs or hasattr(module, kind.function), f"{home}: has no function {kind.function}")
    return entries


def _complete(kind: Kind, entry: Any, home: str) -> Any:
    """Return the entry with the file that declares it, and all paths made absolute."""
    place, folder = f"{home}: {kind.word[:-1]} '{entry.name}'", Path(find_module(home)).parent
    _demand(NAME.fullmatch(entry.name),
            f"{place}: name it by at most 150 letters, digits and _ + - . / @ :, not 'body'")  # fmt: skip
    for field in ("files", "sizes", "metrics"):
        names = getattr(entry, field, None)
        _demand(not isinstance(names, str), f"{place}: {field}={names!r}: give a tuple of strings")
    measured = getattr(entry, "metrics", None) or ()
    choices = [m.name for m in MEASUREMENTS]
    _demand({*measured} <= {*choices}, f"{place}: metrics={measured!r}: choose from {', '.join(choices)}")
    files = tuple(map(file_of, (str(folder / name) for name in entry.files)))
    source = entry.module or home
    source = str((folder / source).resolve()) if source.endswith(".py") else source
    try:
        digest(dict(entry.options))
        find_module(source)
    except (TypeError, ValueError) as error:
        raise DeclarationError(f"{place}: {error}") from None
    return replace(entry, module=source, declared_in=home, files=files)


def _demand(fine: object, otherwise: str) -> None:
    if not fine:
        raise DeclarationError(otherwise)


def import_file(home: str) -> ModuleType:
    """Load the module of a file. Raises DeclarationError, with the line at fault."""
    try:
        module = load(home)
    except (DeclarationError, KeyboardInterrupt):
        raise
    except BaseException as error:  # whatever a user's file raises, also SystemExit
        fault = error.msg if isinstance(error, SyntaxError) else f"{type(error).__name__}: {error}"
        place = raised_at(error, home) or home
        raise DeclarationError(f"{place}: {' '.join(fault.split())}") from None
    for name, path in find_imports(home).items():  # two folders may have a utils.py each
        demand_import(name, path)
    return module
