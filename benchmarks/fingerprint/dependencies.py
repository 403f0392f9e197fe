"""Dependencies that make a stored result stale, beside its inputs: source, packages and data files.

All three follow from the syntax trees of the modules that a task names, imports inside functions included, so
that a change in one method leaves the results of the others as they are. Comments, formatting and docstrings
do not count. Of a user's file that declares methods, scenes or metrics, the modules of its own package and
those beside it count by their source too; other distributions count by their version.

No library's import graph is exact enough. `from reference_sim.energies import StretchStVK` names a package
that loads its modules on first use: grimp sees an edge to its `__init__` alone, so a change of the energy
would go unnoticed. modulefinder takes `if TYPE_CHECKING: from snug...` for an import, so that every solver
would depend on every network. grimp reads no file outside of a package, as a user's method may be.
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

from benchmarks.declarations import DeclarationError
from benchmarks.fingerprint.digest import digest, digest_of_file

ENCODING = "utf-8-sig"  # Python imports a file that begins with a byte-order mark
ROOT = Path(__file__).resolve().parents[2]
LAYERS = ("reference_sim", "snug", "benchmarks")
# Source, prose, compiled kernels; and trained networks: a task that reads one names its digest.
NO_DATA = (".py", ".pyi", ".pyc", ".md", ".nbi", ".nbc", ".safetensors")
BLOCKS = ("body", "handlers", "cases", "orelse", "finalbody")  # of statements within a statement
DOCUMENTED = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)


def software(*modules: str) -> dict[str, str]:
    """Return name -> digest or version of the source, packages and data files of these modules."""
    code = code_of(*modules)
    packages = {f"package {name}": version for name, version in packages_of(code).items()}
    return code | packages | data_of(code)


def code_of(*modules: str) -> dict[str, str]:
    """Return file -> digest of its code, of these modules and all of ours that they import, directly or not.

    >>> "benchmarks/declarations.py" in code_of("benchmarks.fingerprint.dependencies")
    True
    """
    paths = set().union(*(_closure(find_module(module)) for module in modules))
    return {path: _source(path).digest for path in sorted(paths)}


def find_module(module: str) -> str:
    """Return the file of a module, also of one named by its path. Raises DeclarationError."""
    if module.endswith(".py"):
        return module
    if path := _file_of(module):
        return path
    spec = None
    with suppress(ModuleNotFoundError):  # of its package
        spec = importlib.util.find_spec(module)
    if spec is None or spec.origin is None:
        raise DeclarationError(f"no module {module}: see the entry that names it")
    return spec.origin


def packages_of(code: Iterable[str]) -> dict[str, str]:
    """Return package -> installed version, or "absent", of all that these files import."""
    names = set().union(*(_source(path).packages for path in code))
    return {name: _version(name) for name in sorted(names)}


def data_of(code: Iterable[str]) -> dict[str, str]:
    """Return file -> digest, of the data files in those packages of ours that these files belong to."""
    packages = {path.split("/")[0] for path in code} & set(LAYERS)
    return {name: file for package in sorted(packages) for name, file in _data_files(package).items()}


@cache
def place_of(path: str) -> tuple[str, list[str]]:
    """Return the folder that a file is imported from, "" for the project's, and its package below it."""
    if not Path(path).is_absolute():
        return "", path.split("/")[:-1]
    top = Path(path).parent
    while (top / "__init__.py").is_file():
        top = top.parent
    return f"{top.as_posix()}/", list(Path(path).parent.relative_to(top).parts)


# --- packages and data -------------------------------------------------------------------------------------


@cache
def _data_files(package: str) -> dict[str, str]:
    paths = sorted(path for path in (ROOT / package).rglob("*") if path.is_file())
    names = {path: path.relative_to(ROOT) for path in paths if path.suffix not in NO_DATA}
    visible = {path: n for path, n in names.items() if not any(p.startswith((".", "__")) for p in n.parts)}
    return {name.as_posix(): digest_of_file(path) for path, name in visible.items()}


@cache
def _distributions() -> dict[str, list[str]]:
    return dict(metadata.packages_distributions())


@cache
def _version(package: str) -> str:
    """Return names and versions of the distributions that an import of this name loads."""
    names = sorted(set(_distributions().get(package, ())))
    return ", ".join(f"{name} {metadata.version(name)}" for name in names) or "absent"


# --- source ------------------------------------------------------------------------------------------------


@dataclasses.dataclass(frozen=True)
class _Source:
    digest: str
    files: tuple[str, ...]  # of ours that it imports
    packages: frozenset[str]  # of others


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


@cache
def _source(path: str) -> _Source:
    """Return what counts of a file, whose syntax tree is read for it."""
    tree = _parse(path)
    top, package = place_of(path)
    imports = [pair for node in _statements(tree, running=True) for pair in _imported(node, package)]
    roots = {base.split(".")[0] for base, _ in imports}
    tops = {root: _top_of(root, top, package) for root in roots}
    files = dict.fromkeys(
        file
        for base, name in imports
        if (where := tops[base.split(".")[0]]) is not None
        for file in (*_files_behind(base, name, path, where), *_packages_above(base, where))
    )
    for node in (tree, *_statements(tree)):
        if isinstance(node, DOCUMENTED) and ast.get_docstring(node, clean=False) is not None:
            docstring = node.body[0]
            assert isinstance(docstring, ast.Expr) and isinstance(docstring.value, ast.Constant)
            docstring.value.value = ""
    others = frozenset(roots - set(LAYERS) - sys.stdlib_module_names)
    return _Source(digest(ast.dump(tree).encode()), tuple(files), others)


def _parse(path: str) -> ast.Module:
    try:
        return ast.parse((ROOT / path).read_text(encoding=ENCODING))
    except SyntaxError as error:
        raise DeclarationError(f"{path}: line {error.lineno}: {error.msg}") from None
    except (OSError, UnicodeDecodeError) as error:
        raise DeclarationError(f"{path}: cannot be read: {error}") from None


def _statements(node: ast.AST, *, running: bool = False) -> Iterator[ast.AST]:
    """Yield all statements below a node, in order; running: but for those for the type checker alone."""
    for block in BLOCKS:
        if running and block == "body" and _for_type_checker(node):
            continue
        for child in getattr(node, block, ()):
            yield child
            yield from _statements(child, running=running)


def _for_type_checker(node: ast.AST) -> bool:
    """Return whether the body of a node is never run: that of `if TYPE_CHECKING:`."""
    return isinstance(node, ast.If) and ast.unparse(node.test) in ("TYPE_CHECKING", "typing.TYPE_CHECKING")


def _imported(node: ast.AST, package: list[str]) -> list[tuple[str, str]]:
    """Return (module, name in it or empty) of everything that an import statement in that package names."""
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
        target: ast.expr | None = statement.target if isinstance(statement, ast.AnnAssign) else None
        target = statement.targets[0] if isinstance(statement, ast.Assign) else target
        if isinstance(target, ast.Name) and target.id == "kernels":
            values = (part.value for part in ast.walk(statement) if isinstance(part, ast.Constant))
            yield from (value.partition(":") for value in values if isinstance(value, str) and ":" in value)


def _top_of(root: str, top: str, package: list[str]) -> str | None:
    """Return the folder of a top-level module whose source counts; None where it does not."""
    if root in LAYERS:
        return ""
    installed = root in sys.stdlib_module_names or root in _distributions()
    return top if top and (root in package[:1] or not installed) else None


def _packages_above(base: str, top: str) -> Iterator[str]:
    """Yield the `__init__.py` of a user's packages that a module below the folder `top` is imported through.

    Those of the project have names and imports on first use alone.
    """
    parts = base.split(".") if top else []
    for depth in range(1, len(parts)):
        if path := _file_of(".".join(parts[:depth]), top):
            yield path


def _files_behind(base: str, name: str, importer: str, top: str) -> Iterator[str]:
    """Yield the files below the folder `top` that `from base import name` needs.

    A package that has the name neither as a module nor in its own text loads it on first use. Then the module
    counts that its stub names, else that of its modules which defines the name, else all of them. Of a
    package that loads names on first use and is imported as a whole, all modules count.
    """
    path, inner = _file_of(base, top), _file_of(f"{base}.{name}", top) if name else None
    if path is None or not name or not path.endswith("/__init__.py"):
        yield from _whole(inner or path)
    elif name in _exported(path):
        yield path
        yield from _files_behind(_exported(path)[name], name, importer, top)
    elif inner and (path == importer or name not in _names(path).bound):
        yield from _whole(inner)
    else:
        yield path
        if name not in _names(path).bound:
            modules = _modules_of(path)
            yield from [module for module in modules if name in _names(module).defined] or modules


def _whole(path: str | None) -> list[str]:
    """Return the file, and all modules of a package that loads names on first use."""
    if path is None:
        return []
    lazy = path.endswith("/__init__.py") and "__getattr__" in _names(path).defined
    return [path, *(_modules_of(path) if lazy else ())]


def _modules_of(package: str) -> list[str]:
    """Return the modules in the folder of a package's `__init__.py`, and in those below it."""
    folder = (ROOT / package).parent
    files = sorted(p for p in folder.rglob("*.py") if p.name != "__init__.py")
    return [f"{package.rpartition('/')[0]}/{file.relative_to(folder).as_posix()}" for file in files]


@cache
def _exported(path: str) -> dict[str, str]:
    """Return name -> module of what the stub beside a package's `__init__.py` exports lazily."""
    if not (ROOT / path).with_suffix(".pyi").is_file():
        return {}
    package, nodes = place_of(path)[1], _parse(f"{path}i").body
    return {name: module for node in nodes for module, name in _imported(node, package)}


@dataclasses.dataclass(frozen=True)
class _Names:
    """Names that the text of a file defines at its top level, and those that it binds, imports included."""

    defined: frozenset[str]
    bound: frozenset[str]


@cache
def _names(path: str) -> _Names:
    defined, imported = set[str](), set[str]()
    todo: list[ast.stmt] = list(_parse(path).body)
    for node in todo:
        if isinstance(node, ast.If | ast.Try):
            if not _for_type_checker(node):
                todo += node.body
        elif isinstance(node, ast.FunctionDef | ast.ClassDef):
            defined.add(node.name)
        elif isinstance(node, ast.Assign | ast.AnnAssign):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            parts = (part for target in targets for part in ast.walk(target))
            defined |= {part.id for part in parts if isinstance(part, ast.Name)}
        elif isinstance(node, ast.ImportFrom | ast.Import):
            imported |= {alias.asname or alias.name.split(".")[0] for alias in node.names}
    return _Names(frozenset(defined), frozenset(defined | imported))


@cache
def _file_of(module: str, top: str = "") -> str | None:
    stem = top + module.replace(".", "/")
    return next((p for p in (f"{stem}.py", f"{stem}/__init__.py") if (ROOT / p).is_file()), None)
