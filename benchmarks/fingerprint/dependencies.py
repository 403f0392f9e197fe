"""Dependencies that make a stored result stale, beside its inputs: folders of source and data, and packages.

A task names the folders and files that its outcome depends on (benchmarks.runner.task_inputs); each counts as
a whole, and no import is followed. Of Python the statements count, not comments, formatting and docstrings. A
user's file counts with the modules that lie beside it. Packages that it imports count by their version.
"""

from __future__ import annotations

import ast
import importlib.util
import os
import sys
from contextlib import suppress
from functools import cache
from importlib import metadata
from pathlib import Path

from benchmarks.declarations import DeclarationError
from benchmarks.fingerprint.digest import digest, digest_of_file

ENCODING = "utf-8-sig"  # Python imports a file that begins with a byte-order mark
ROOT = Path(__file__).resolve().parents[2]
LAYERS = ("reference_sim", "snug", "benchmarks")
# Prose, compiled kernels; and trained networks: a task that reads one names its digest.
NO_PART = (".pyc", ".md", ".nbi", ".nbc", ".safetensors")
# Commands and pictures decide no result.
NO_RESULT = (
    "reference_sim/command_line.py", "reference_sim/simulate.py", "reference_sim/simulate_command.py",
    "snug/check.py", "snug/garments/picture.py", "snug/train.py", "snug/training/command",
)  # fmt: skip
DOCUMENTED = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)


def software(*places: str) -> dict[str, str]:
    """Return place -> digest of its files, and package -> version or "absent" of all that they import.

    Args:
        *places: folders and files of the project, as `snug/body`, and absolute paths of users' files. A place
            within another one is no part of its own.

    Raises:
        DeclarationError: a place that is not there, or a file that cannot be read.

    >>> sorted(software("benchmarks/declarations.py", "benchmarks/fingerprint"))
    ['benchmarks/declarations.py', 'benchmarks/fingerprint']
    """
    outermost = sorted(p for p in set(places) if not any(p.startswith(f"{other}/") for other in places))
    contents = {place: _content(place) for place in outermost}
    packages = sorted(set().union(*(names for _, names in contents.values())))
    digests = {place: content for place, (content, _) in contents.items()}
    return digests | {f"package {name}": _version(name) for name in packages}


def find_module(module: str) -> str:
    """Return the file of a module, relative to the project where it is ours. Raises DeclarationError.

    >>> find_module("benchmarks.scene")
    'benchmarks/scene.py'
    """
    if module.endswith(".py"):
        return module
    stem = module.replace(".", "/")
    if path := next((p for p in (f"{stem}.py", f"{stem}/__init__.py") if (ROOT / p).is_file()), None):
        return path
    spec = None
    with suppress(ModuleNotFoundError):  # of its package
        spec = importlib.util.find_spec(module)
    if spec is None or spec.origin is None:
        raise DeclarationError(f"no module {module}: see the entry that names it")
    return spec.origin


def imported_beside(home: str) -> dict[str, Path]:
    """Return name -> file of the modules and packages beside a user's file that it or one of them imports."""
    top = _top_of(Path(home))
    names = set().union(*(_read(path)[1] for path in _neighbours(Path(home))))
    files = {name: (top / f"{name}.py", top / name / "__init__.py") for name in sorted(names)}
    return {name: path for name, paths in files.items() for path in paths if path.is_file()}


@cache
def _content(place: str) -> tuple[str, frozenset[str]]:
    """Return the digest of the files of a place, and the packages that they import."""
    if Path(place).is_absolute():
        top, paths = _top_of(Path(place)), _neighbours(Path(place))
        ours = {*LAYERS, *imported_beside(place)}
    else:
        top, paths, ours = ROOT, _files_of(place), set(LAYERS)
    if not paths:
        raise DeclarationError(f"{place}: no such folder or file, see benchmarks.runner.task_inputs")
    read = {path.relative_to(top).as_posix(): _read(path) for path in paths}
    packages = frozenset().union(*(names for _, names in read.values()))
    return digest({name: content for name, (content, _) in read.items()}), packages - ours


def _files_of(place: str) -> list[Path]:
    """Return the files of the project at a place that count, in order."""
    path = ROOT / place
    files = [path] if path.is_file() else sorted(p for p in path.rglob("*") if p.is_file())
    names = [(file, file.relative_to(ROOT)) for file in files if file.suffix not in NO_PART]
    hidden = [any(part.startswith((".", "__pycache__")) for part in name.parts) for _, name in names]
    others = [name.as_posix().startswith(NO_RESULT) for _, name in names]
    return [file for (file, _), *left_out in zip(names, hidden, others) if not any(left_out)]


def _neighbours(home: Path) -> list[Path]:
    """Return the modules beside a user's file or its package, and those of folders of modules there.

    Of an installed package they are its own: what is installed beside it counts by its version.
    """
    top = _top_of(home)
    package = home.relative_to(top).parts[0]
    found = []
    for folder, folders, names in os.walk(top / package if package in _distributions() else top):
        modules = sorted(name for name in names if name.endswith(".py"))
        folders[:] = sorted(name for name in folders if name.isidentifier()) if modules else []
        found += [Path(folder, name) for name in modules]
    return found


def _top_of(home: Path) -> Path:
    """Return the folder that a file is imported from: above the packages that it lies in."""
    top = home.parent
    while (top / "__init__.py").is_file():
        top = top.parent
    return top


@cache
def _read(path: Path) -> tuple[str, frozenset[str]]:
    """Return the digest of what counts of a file, and the top-level modules that it imports."""
    try:
        if path.suffix not in (".py", ".pyi"):
            return digest_of_file(path), frozenset()
        tree = ast.parse(path.read_text(encoding=ENCODING))
    except OSError as error:
        raise DeclarationError(f"{path}: cannot be read: {error}") from None
    except (SyntaxError, ValueError):  # beside a user's file, and not imported by it: that was loaded
        return digest_of_file(path), frozenset()
    names: set[str] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            names.add(node.module.split(".")[0])
        elif isinstance(node, DOCUMENTED) and ast.get_docstring(node, clean=False) is not None:
            node.body[0].value.value = ""  # type: ignore[attr-defined]
    return digest(ast.dump(tree).encode()), frozenset(names - sys.stdlib_module_names)


@cache
def _distributions() -> dict[str, list[str]]:
    return dict(metadata.packages_distributions())


@cache
def _version(package: str) -> str:
    """Return names and versions of the distributions that an import of this name loads."""
    names = sorted(set(_distributions().get(package, ())))
    return ", ".join(f"{name} {metadata.version(name)}" for name in names) or "absent"
