"""What the outcome of a task depends on beside its inputs: source, packages and data files that it can reach.

All three are found from the syntax tree of the modules that a task names, imports inside functions included,
so that a change in one method leaves the results of the others as they are. Comments, formatting and
docstrings do not count.

Of a user's file that declares methods, scenes or metrics, the modules of its own
package and those beside it count by their source too. What other distributions install counts by its version.
"""

from __future__ import annotations

import ast
import dataclasses
import importlib.util
import sys
from collections.abc import Iterable, Iterator
from contextlib import suppress
from functools import cache
from importlib import metadata
from pathlib import Path

from benchmarks.fingerprint.digest import digest, digest_of_file
from benchmarks.registry import DeclarationError

ENCODING = "utf-8-sig"  # Python imports a file that begins with a byte-order mark
ROOT = Path(__file__).resolve().parents[2]
LAYERS = ("reference_sim", "snug", "benchmarks")
NO_DATA = (".py", ".pyi", ".pyc", ".md", ".nbi", ".nbc")  # source, prose, compiled kernels


def software(*modules: str) -> dict[str, str]:
    """Return name -> digest or version of the source, packages and data files of these modules."""
    code = code_of(*modules)
    packages = {f"package {name}": version for name, version in packages_of(code).items()}
    return code | packages | data_of(code)


def code_of(*modules: str) -> dict[str, str]:
    """File -> digest of its code, of these modules and all of ours that they import, directly or not."""
    found: set[str] = set()
    for module in modules:
        found |= _closure(find_module(module))
    return {path: _source(path).digest for path in sorted(found)}


def find_module(module: str) -> str:
    """The file of a module, ours or a user's, which may be named by its path. Raises DeclarationError."""
    return module if module.endswith(".py") else _file_of(module) or _elsewhere(module)


def packages_of(code: Iterable[str]) -> dict[str, str]:
    """Package -> installed version, of all that these files import, or "absent"."""
    names = set().union(*(_source(path).packages for path in code))
    return {name: _version(name) for name in sorted(names)}


def data_of(code: Iterable[str]) -> dict[str, str]:
    """File -> digest, of what comes with the packages of ours that these files belong to and is no source."""
    packages = {path.split("/")[0] for path in code} & set(LAYERS)
    return {name: file for package in sorted(packages) for name, file in _data_files(package).items()}


@cache
def _data_files(package: str) -> dict[str, str]:
    found = sorted(path for path in (ROOT / package).rglob("*") if path.is_file())
    kept = (path for path in found if path.suffix not in NO_DATA and not _hidden(path))
    return {path.relative_to(ROOT).as_posix(): digest_of_file(path) for path in kept}


def _hidden(path: Path) -> bool:
    return any(part.startswith((".", "__")) for part in path.relative_to(ROOT).parts)


@cache
def _distributions() -> dict[str, list[str]]:
    return dict(metadata.packages_distributions())


@cache
def _version(package: str) -> str:
    """Of the distributions that an import of this name loads."""
    names = sorted(set(_distributions().get(package, ())))
    return ", ".join(f"{name} {metadata.version(name)}" for name in names) or "absent"


def _elsewhere(module: str) -> str:
    """The file of a module that is not ours: a method or a scene of a user. Raises DeclarationError."""
    found = None
    with suppress(ModuleNotFoundError):  # of its package
        found = importlib.util.find_spec(module)
    if found is None or found.origin is None:
        raise DeclarationError(f"no module {module}: see the entry that names it")
    return found.origin


@cache
def _closure(root: str) -> frozenset[str]:
    seen: set[str] = set()
    todo = [root]
    while todo:
        path = todo.pop()
        if path not in seen:
            seen.add(path)
            todo += _source(path).files
    return frozenset(seen)


@dataclasses.dataclass(frozen=True)
class _Source:
    digest: str
    files: tuple[str, ...]  # of ours that it imports
    packages: frozenset[str]  # of others


@cache
def _source(path: str) -> _Source:
    try:
        tree = ast.parse((ROOT / path).read_text(encoding=ENCODING))
    except SyntaxError as error:
        raise DeclarationError(f"{path}: line {error.lineno}: {error.msg}") from None
    except (OSError, UnicodeDecodeError) as error:
        raise DeclarationError(f"{path}: cannot be read: {error}") from None
    top, package = place_of(path)
    imports = [pair for node in _running(tree) for pair in _imported(node, package)]
    roots = {base.split(".")[0] for base, _ in imports}
    tops = {root: _top_of(root, top, package) for root in roots}
    found = tuple(dict.fromkeys(
        file
        for base, name in imports
        if (where := tops[base.split(".")[0]]) is not None
        for file in _files_behind(base, name, path, where)
    ))  # fmt: skip
    for node in ast.walk(tree):
        body = getattr(node, "body", None)
        if isinstance(body, list) and body and _is_text(body[0]):
            body[0].value.value = ""  # a docstring
    others = frozenset(roots - set(LAYERS) - sys.stdlib_module_names)
    return _Source(digest(ast.dump(tree).encode()), found, others)


@cache
def place_of(path: str) -> tuple[str, list[str]]:
    """The folder from which a file is imported, "" for that of the project; its package below that folder."""
    if not Path(path).is_absolute():
        return "", path.split("/")[:-1]
    top = Path(path).parent
    while (top / "__init__.py").is_file():
        top = top.parent
    return f"{top.as_posix()}/", list(Path(path).parent.relative_to(top).parts)


def _top_of(root: str, top: str, package: list[str]) -> str | None:
    """The folder in which the files of a top-level module lie whose source counts; None: it does not."""
    if root in LAYERS:
        return ""
    installed = root in sys.stdlib_module_names or root in _distributions()
    return top if top and (root in package[:1] or not installed) else None


def _is_text(node: ast.AST) -> bool:
    constant = node.value if isinstance(node, ast.Expr) else None
    return isinstance(constant, ast.Constant) and isinstance(constant.value, str)


def _imported(node: ast.AST, package: list[str]) -> list[tuple[str, str]]:
    """(module, name in it or empty) of everything that an import statement in that package names."""
    if isinstance(node, ast.Import):
        return [(alias.name, "") for alias in node.names]
    if isinstance(node, ast.ClassDef):
        return [(module, name) for module, _, name in _kernels_of(node)]
    if not isinstance(node, ast.ImportFrom):
        return []
    above = package[: len(package) - node.level + 1] if node.level else []
    base = ".".join([*above, *(node.module or "").split(".")]).strip(".")
    return [(base, alias.name) for alias in node.names]


def _kernels_of(node: ast.ClassDef) -> Iterator[tuple[str, str, str]]:
    """Yield (module, ":", function) of the kernels that an energy declares: solvers import them by name."""
    for statement in node.body:
        target = statement.target if isinstance(statement, ast.AnnAssign) else None
        target = statement.targets[0] if isinstance(statement, ast.Assign) else target
        if isinstance(target, ast.Name) and target.id == "kernels":
            values = (part.value for part in ast.walk(statement) if isinstance(part, ast.Constant))
            yield from (value.partition(":") for value in values if isinstance(value, str) and ":" in value)


def _running(node: ast.AST) -> Iterator[ast.AST]:
    """All nodes but those for the type checker alone."""
    for child in ast.iter_child_nodes(node):
        if not (isinstance(child, ast.If) and "TYPE_CHECKING" in ast.unparse(child.test)):
            yield child
            yield from _running(child)


def _files_behind(base: str, name: str, importer: str, top: str) -> Iterator[str]:
    """The files below the folder `top` that `from base import name` needs.

    A package that has the name neither as a module nor in its own text gives it when it is first used. Then
    the module counts that its stub names, else that of its modules which defines the name, else all of them.
    """
    path, inner = _file_of(base, top), _file_of(f"{base}.{name}", top) if name else None
    package = path is not None and path.endswith("/__init__.py") and bool(name)
    if path is None or not package:
        yield from filter(None, [inner or path])
        return
    if name in _exported(path):
        yield path
        yield from _files_behind(_exported(path)[name], name, importer, top)
        return
    if inner and (path == importer or name not in _bound(path)):
        yield inner
        return
    yield path
    if name not in _bound(path):
        folder = (ROOT / path).parent
        files = sorted(p for p in folder.rglob("*.py") if p.name != "__init__.py")
        modules = [f"{path.rpartition('/')[0]}/{file.relative_to(folder).as_posix()}" for file in files]
        yield from [module for module in modules if name in _defined(module)] or modules


@cache
def _exported(path: str) -> dict[str, str]:
    """Return name -> module of what the stub beside a package's `__init__.py` exports lazily."""
    stub = (ROOT / path).with_suffix(".pyi")
    if not stub.is_file():
        return {}
    package = place_of(path)[1]
    nodes = ast.parse(stub.read_text(encoding=ENCODING)).body
    return {name: module for node in nodes for module, name in _imported(node, package)}


@cache
def _bound(path: str) -> frozenset[str]:
    """Names that the text of a file binds at its top level, by an import or by itself."""
    imports = (node for node in _top_level(path) if isinstance(node, ast.ImportFrom | ast.Import))
    names = (alias.asname or alias.name.split(".")[0] for node in imports for alias in node.names)
    return _defined(path) | frozenset(names)


@cache
def _defined(path: str) -> frozenset[str]:
    """Names that the text of a file defines at its top level."""
    names: set[str] = set()
    for node in _top_level(path):
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            names.add(node.name)
        elif isinstance(node, ast.Assign | ast.AnnAssign):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            parts = (part for target in targets for part in ast.walk(target))
            names |= {part.id for part in parts if isinstance(part, ast.Name)}
    return frozenset(names)


def _top_level(path: str) -> Iterator[ast.stmt]:
    for node in ast.parse((ROOT / path).read_text(encoding=ENCODING)).body:
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test):
            continue
        yield node
        if isinstance(node, ast.If | ast.Try):
            yield from node.body


@cache
def _file_of(module: str, top: str = "") -> str | None:
    stem = top + module.replace(".", "/")
    return next((p for p in (f"{stem}.py", f"{stem}/__init__.py") if (ROOT / p).is_file()), None)
