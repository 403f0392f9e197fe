"""Methods, scenes, metrics and known answers that a user's file declares.

A file is named by its path, which means all that it declares. Entries carry the file that they come from, so
that every process can load it.
"""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

from benchmarks.declarations import DeclarationError, by_name, demand_that_it_is, load, raised_at
from benchmarks.method import MethodEntry
from benchmarks.methods.declared_networks import TRAININGS
from benchmarks.plan.study import Part, Study
from benchmarks.provenance import digest, find_module, imported_beside
from benchmarks.scene import Scene
from benchmarks.training import Training
from benchmarks.validation.case import Case, cases_of

NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_+./@:-]*")


@dataclass(frozen=True)
class Kind:
    """A kind of declaration: the word of the command line, the tuple, and the function that stands beside."""

    word: str
    tuple_name: str
    function: str

    @property
    def entry(self) -> type:
        """The class of the entries."""
        if self.word == "metrics":  # loads numpy: only for whoever has one
            from benchmarks.metric import Metric

            return Metric
        return MethodEntry if self.word == "methods" else Scene


METHODS = Kind("methods", "METHODS", "make")
SCENES = Kind("scenes", "SCENES", "build")
METRICS = Kind("metrics", "METRICS", "measure")
KINDS = (METHODS, SCENES, METRICS)
CASES = Kind("cases", "", "")  # declared by @known_answer, which stands on the function


def resolve(kind: Kind, names_and_paths: Sequence[str]) -> tuple[list[str], list[Any]]:
    """Return the names that an option means, and the entries that files among them declare.

    Args:
        kind: what is declared.
        names_and_paths: names, and paths that end with ".py"; a path stands for the names that its file
            declares.

    Raises:
        DeclarationError: a file that cannot be read, or declares none.
    """
    names: list[str] = []
    entries: dict[str, list[Any]] = {}
    for word in names_and_paths:
        if not word.endswith(".py"):
            names.append(word)
            continue
        file = file_of(word)
        entries[file] = entries_of(kind, file)
        names += [entry.name for entry in entries[file]]
    return names, [entry for some in entries.values() for entry in some]


class Users(NamedTuple):
    """A study with the names that its files declare in their places, and what they declare."""

    study: Study
    scenes: list[Scene]
    methods: list[MethodEntry]
    cases: list[Case]


def declarations_of(study: Study) -> Users:
    """Read the files that a study names; a known answer belongs to the part that names its file.

    Raises:
        DeclarationError: a file that cannot be read, or declares none.
    """
    entries: dict[Kind, dict[tuple[str, str], Any]] = {SCENES: {}, METHODS: {}, CASES: {}}

    def named(of: Study | Part, suite: str = "") -> Any:
        changes: dict[str, Any] = {}
        for kind, found in entries.items():
            for field in (kind.word, f"optional_{kind.word}"):
                if any(word.endswith(".py") for word in getattr(of, field, ())):
                    names, declared = resolve(kind, getattr(of, field))
                    changes[field] = tuple(names)
                    if kind is CASES:
                        declared = [dataclasses.replace(case, suite=suite) for case in declared]
                    found |= {(getattr(e, "declared_in", suite), e.name): e for e in declared}
        return dataclasses.replace(of, **changes)

    parts = {name: named(part, name) for name, part in study.parts.items()}
    study = dataclasses.replace(named(study), parts=parts)
    scenes, methods, cases = (list(of_kind.values()) for of_kind in entries.values())
    check_networks(methods)
    return Users(study, scenes, methods, cases)


def check_networks(entries: Sequence[MethodEntry]) -> None:
    """Raise DeclarationError where two trainings have one name: one network would be the other's."""
    trainings: dict[str, Training | None] = {**TRAININGS, "untrained": None}
    for entry in entries:
        if entry.trained is None:
            continue
        what = f"{entry.declared_in}: method '{entry.name}'"
        if entry.training is None and entry.trained not in trainings:
            raise DeclarationError(
                f"{what}: no training is called '{entry.trained}': say training=Training(...)"
            )
        if entry.training and trainings.setdefault(entry.trained, entry.training) != entry.training:
            raise DeclarationError(
                f"{what}: another training is called '{entry.trained}': give trained=another"
            )


def file_of(word: str) -> str:
    """Return the absolute path of a file that is there. Raises DeclarationError."""
    path = Path(word)
    if not path.is_file():
        raise DeclarationError(f"{word}: no such file")
    return str(path.resolve())


def entries_of(kind: Kind, home: str) -> list[Any]:
    """Return what a file declares of that kind. Raises DeclarationError."""
    module = import_file(home)
    if kind is CASES:
        if not (cases := cases_of(module.__name__)):
            raise DeclarationError(f"{home}: declares no known answer, a function with @known_answer")
        return [dataclasses.replace(case, module=home) for case in cases]
    declared = getattr(module, kind.tuple_name, None)
    if not isinstance(declared, tuple | list) or not all(isinstance(entry, kind.entry) for entry in declared):
        raise DeclarationError(f"{home}: declares no {kind.tuple_name}, a tuple of {kind.entry.__name__}")
    if not declared:
        raise DeclarationError(f"{home}: {kind.tuple_name} is empty")
    by_name(kind.word[:-1], declared)
    return [_placed(kind, entry, module, home) for entry in declared]


def _placed(kind: Kind, entry: Any, module: ModuleType, home: str) -> Any:
    """Return the entry with the file that declares it, and all paths made absolute."""
    what = f"{home}: {kind.word[:-1]} '{entry.name}'"
    if kind is METRICS:
        _demand(callable(getattr(module, kind.function, None)), f"{home}: has no function {kind.function}")
        return dataclasses.replace(entry, declared_in=home)
    if not NAME.fullmatch(entry.name):
        raise DeclarationError(f"{what}: use letters, digits and _ + - . / @ : in its name")
    folder = Path(find_module(home)).parent
    for field in ("files", "sizes", "metrics"):
        names = getattr(entry, field, None) or ()
        listed = isinstance(names, tuple | list) and all(isinstance(name, str) for name in names)
        _demand(listed, f"{what}: {field}={names!r}: give a tuple of strings")
    if measured := set(getattr(entry, "metrics", None) or ()):
        from benchmarks.metrics import MEASUREMENTS  # loads numpy

        known = [measurements.name for measurements in MEASUREMENTS]
        wrong = f"{what}: metrics={entry.metrics!r}: choose from {', '.join(known)}"
        _demand(measured <= {*known}, wrong)
    try:
        digest(dict(entry.options))
    except (TypeError, ValueError) as error:
        raise DeclarationError(
            f"{what}: options: {error}: give numbers, strings, and lists of them"
        ) from None
    files = tuple(str((folder / name).resolve()) for name in entry.files)
    for file in files:
        _demand(Path(file).is_file(), f"{what}: {file}: no such file")
    source = entry.module or home
    if source.endswith(".py"):
        source = str((folder / source).resolve())
    try:
        find_module(source)
    except DeclarationError as error:
        raise DeclarationError(f"{what}: {error}") from None
    if source == home:
        _demand(callable(getattr(module, kind.function, None)), f"{home}: has no function {kind.function}")
    return dataclasses.replace(entry, module=source, declared_in=home, files=files)


def _demand(fine: bool, otherwise: str) -> None:
    if not fine:
        raise DeclarationError(otherwise)


def import_file(home: str) -> ModuleType:
    """Load the module of a file. Raises DeclarationError, with the line of the file at fault."""
    try:
        module = load(home)
    except DeclarationError:
        raise
    except BaseException as error:  # whatever a user's file raises, also what usually ends a program
        what = error.msg if isinstance(error, SyntaxError) else f"{type(error).__name__}: {error}"
        where = raised_at(error, home) or home
        raise DeclarationError(f"{where}: {' '.join(what.split())}") from None
    for name, path in imported_beside(home).items():  # two folders may have a utils.py each
        demand_that_it_is(name, path)
    return module
