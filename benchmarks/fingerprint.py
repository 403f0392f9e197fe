"""What a piece of work depends on: its inputs, and the source of the modules that it uses.

The modules are found from the syntax tree, imports inside functions included, so that a change in one method
leaves the results of the others as they are. Comments, formatting and docstrings do not count.
"""

from __future__ import annotations

import ast
import dataclasses
import hashlib
import importlib.util
import json
from collections.abc import Iterable, Iterator
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

from .presets import Preset

ROOT = Path(__file__).resolve().parent.parent
LAYERS = ("reference_sim", "snug", "benchmarks")
DATA_FILES = "snug/data/*.npz"  # what the modules of snug read
# Lists of names and sizes, what they name is an input by itself; and the words of result files.
LISTS = (
    "benchmarks/__init__.py", "benchmarks/methods/__init__.py", "benchmarks/methods/solvers.py",
    "benchmarks/methods/learned.py", "benchmarks/scenes/__init__.py",
    "benchmarks/suites/__init__.py", "benchmarks/suites/extreme_cases.py", "benchmarks/presets.py",
    "benchmarks/plan.py", "benchmarks/results.py", "snug/recipe.py",
)  # fmt: skip


def digest(value: Any) -> str:
    """16 hexadecimal digits of a value: JSON, bytes, dataclasses, or anything with a plain repr inside."""
    if not isinstance(value, bytes):
        value = json.dumps(value, sort_keys=True, default=_plain).encode()
    return hashlib.sha256(value).hexdigest()[:16]


def _plain(value: Any) -> Any:
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {f.name: getattr(value, f.name) for f in dataclasses.fields(value)}
    if hasattr(value, "tobytes"):  # an array
        return [str(value.dtype), list(value.shape), digest(value.tobytes())]
    if isinstance(value, set | frozenset):
        return sorted(value)
    if hasattr(value, "items"):
        return dict(value)
    raise TypeError(f"cannot tell apart by content: {type(value).__name__}")


def digest_of_file(path: Path) -> str:
    """16 hexadecimal digits of a file's bytes."""
    return digest(path.read_bytes())


def code_of(*modules: str) -> dict[str, str]:
    """File -> digest of its code, of these modules and all of ours that they import, directly or not."""
    found: set[str] = set()
    for module in modules:
        path = _file_of(module) or _elsewhere(module)
        found |= _closure(path)
    return {path: _source(path)[0] for path in sorted(found)}


@cache
def data_files() -> dict[str, str]:
    """File -> digest, of what comes with the package and code may read."""
    found = sorted(ROOT.glob(DATA_FILES))
    return {path.relative_to(ROOT).as_posix(): digest_of_file(path) for path in found}


def preset_values(preset: Preset, code: Iterable[str]) -> dict[str, Any]:
    """The values of the preset that those files read, as attributes of what is called or declared a preset.

    A file that hands the preset on unread reads none: what it is handed to is among the files itself.
    """
    names = set().union(*(_source(path)[2] for path in code))
    return {f.name: getattr(preset, f.name) for f in dataclasses.fields(preset) if f.name in names}


def _elsewhere(module: str) -> str:
    """The file of a module that is not ours: a method or a scene of a user. Raises ValueError."""
    found = None
    with suppress(ModuleNotFoundError):  # of its package
        found = importlib.util.find_spec(module)
    if found is None or found.origin is None:
        raise ValueError(f"no module {module}")
    return found.origin


def _closure(root: str) -> set[str]:
    seen: set[str] = set()
    todo = [root]
    while todo:
        path = todo.pop()
        if path not in seen and path not in LISTS:
            seen.add(path)
            todo += _source(path)[1]
    return seen


@cache
def _source(path: str) -> tuple[str, tuple[str, ...], frozenset[str]]:
    """Digest of the code, files imported, and names of preset values read."""
    tree = ast.parse((ROOT / path).read_text(encoding="utf-8"))
    imported = tuple(dict.fromkeys(_imports(tree, path)))
    read = frozenset(_read_of_preset(tree))
    for node in ast.walk(tree):
        body = getattr(node, "body", None)
        if isinstance(body, list) and body and _is_text(body[0]):
            body[0].value.value = ""  # a docstring
    return digest(ast.dump(tree).encode()), imported, read


def _is_text(node: ast.AST) -> bool:
    constant = node.value if isinstance(node, ast.Expr) else None
    return isinstance(constant, ast.Constant) and isinstance(constant.value, str)


def _imports(tree: ast.AST, path: str) -> Iterator[str]:
    package = path.split("/")[:-1]
    for node in _running(tree):
        if isinstance(node, ast.Import):
            names = [(alias.name, "") for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            above = package[: len(package) - node.level + 1] if node.level else []
            base = ".".join([*above, *(node.module or "").split(".")]).strip(".")
            names = [(base, alias.name) for alias in node.names]
        else:
            continue
        for base, name in names:
            if base.split(".")[0] in LAYERS:
                yield from _files_behind(base, name)


def _running(node: ast.AST) -> Iterator[ast.AST]:
    """All nodes but those for the type checker alone."""
    for child in ast.iter_child_nodes(node):
        if not (isinstance(child, ast.If) and "TYPE_CHECKING" in ast.unparse(child.test)):
            yield child
            yield from _running(child)


def _files_behind(base: str, name: str) -> Iterator[str]:
    """The files that `from base import name` needs: a module, or the package that has the name."""
    path = _file_of(base)
    package = path is not None and path.endswith("/__init__.py")
    own, homes = _names_of(path) if package and path else (frozenset(), {})
    inner = _file_of(f"{base}.{name}") if name and name not in own else None
    if inner is not None:
        yield inner
    elif path is not None:
        yield path
        if name in homes:
            yield f"{path.removesuffix('__init__.py')}{homes[name]}.py"


@cache
def _names_of(path: str) -> tuple[frozenset[str], dict[str, str]]:
    """Names that a package imports itself, and name -> module of those it imports when first used."""
    body = ast.parse((ROOT / path).read_text(encoding="utf-8")).body
    own = {alias.name for node in body if isinstance(node, ast.ImportFrom) for alias in node.names}
    for node in body:
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "MODULE_OF":
            return frozenset(own), ast.literal_eval(node.value)
    return frozenset(own), {}


@cache
def _file_of(module: str) -> str | None:
    stem = module.replace(".", "/")
    return next((p for p in (f"{stem}.py", f"{stem}/__init__.py") if (ROOT / p).is_file()), None)


def _read_of_preset(tree: ast.AST) -> Iterator[str]:
    """Attributes read of anything called preset, or declared to be one."""
    called = {"preset"}
    for node in ast.walk(tree):
        if isinstance(node, ast.arg) and node.annotation and "Preset" in ast.unparse(node.annotation):
            called.add(node.arg)
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute):
            owner = node.value
            name = owner.attr if isinstance(owner, ast.Attribute) else getattr(owner, "id", "")
            if name in called:
                yield node.attr
