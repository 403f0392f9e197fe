"""Origin of a number: content, code, packages and machine that it was computed with.

A task names the folders and files that its outcome depends on (benchmarks.runner.schedule); each counts as
a whole, and no import is followed. A user's file counts with the modules that lie beside it.
"""

from __future__ import annotations

import ast
import dataclasses
import gzip
import hashlib
import importlib.util
import json
import os
import platform
import subprocess
import zlib
from contextlib import suppress
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Any

from benchmarks.declarations import DeclarationError

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = (  # those that compute, or read what is computed with
    "numpy", "scipy", "numba", "llvmlite", "torch", "h5py", "scikit-fem", "libigl", "pymetis",
    "ipctk", "pyvista", "pyacvd", "pandas", "safetensors",
)  # fmt: skip


# What numbers are computed by; networks, references and study.toml name themselves in run.json.
CODE = ("reference_sim", "snug", "benchmarks", "studies/*.py", ":!studies/*/test_*.py",
        ":!benchmarks/studies", ":!benchmarks/reference_data", ":!*.safetensors", ":!*.md")  # fmt: skip


@cache  # the first call is nearest to the code that was loaded
def commit() -> str:
    """Return the last commit that changed CODE, "+changes" if files differ; else the version.

    So all runs between two changes of the code name one commit, whatever is committed besides.
    """

    def git(*options: str) -> str:
        # No lock on the index: one would stay where the disk is full.
        command = ["git", "--no-optional-locks", "-C", str(ROOT), *options, "--", *CODE]
        return subprocess.run(command, capture_output=True, text=True, timeout=20, check=True).stdout

    # No git here: the installed version is what is known.
    with suppress(OSError, subprocess.SubprocessError):
        if (ROOT / ".git").exists():
            changes = git("status", "--porcelain", "--untracked-files=normal")
            return git("log", "-1", "--format=%h", "--abbrev=10").strip() + "+changes" * bool(changes)
    return f"version {package_version('neural-garment-benchmark')}"


def package_version(name: str) -> str:
    """Return the installed version of a distribution, read without importing it, or "absent"."""
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return "absent"


def processor_name() -> str:
    """Return the processor's name, family, model and stepping, or else the architecture.

    Clouds sell several generations under one name; they differ in run times and last bits.
    """
    facts: dict[str, str] = {}
    with suppress(OSError):  # not Linux
        first = Path("/proc/cpuinfo").read_text(encoding="utf-8").partition("\n\n")[0]
        lines = (line.partition(":") for line in first.splitlines())
        facts = {name.strip(): " ".join(value.split()) for name, _, value in lines}
    name = facts.get("model name") or platform.processor() or platform.machine()
    keys = [key for key in ("cpu family", "model", "stepping") if key in facts]
    details = [f"{key.split()[-1]} {facts[key]}" for key in keys]
    return f"{name} ({', '.join(details)})" if details else name


def usable_cores() -> int:
    """Return the number of processor cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@cache
def hardware(device: str = "cpu") -> dict[str, Any]:
    """Return processor, cores, memory [GB], system and, for cuda, the accelerator's name."""
    facts: dict[str, Any] = {
        "processor": processor_name(),
        "cores": usable_cores(),
        "system": f"{platform.system()} {platform.release()}",
        "python": platform.python_version(),
        "device": device,
        "memory_gb": round(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") / 1e9, 1),
    }
    if device == "cuda":
        import torch

        facts["accelerator"] = torch.cuda.get_device_name()
    return facts


def hardware_line(facts: dict[str, Any]) -> str:
    """Return one short line for the hardware column of a row."""
    parts = (facts.get("accelerator"), f"{facts['processor']} ({facts['cores']} cores)")
    return ", ".join(part for part in parts if part)


@cache
def versions() -> dict[str, str]:
    """Return the installed version of each package that computes."""
    return {name: package_version(name) for name in PACKAGES}


def digest(value: Any) -> str:
    """Return 16 hexadecimal digits of a value: JSON, bytes, arrays, sets, dataclasses.

    >>> digest({"b": 1, "a": [2]}) == digest({"a": [2], "b": 1})
    True
    """
    if not isinstance(value, bytes):
        value = json.dumps(value, sort_keys=True, default=_plain).encode()
    return hashlib.sha256(value).hexdigest()[:16]


def _plain(value: Any) -> Any:
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        values = {f: getattr(value, f.name) for f in dataclasses.fields(value)}
        # An option added later changes no digest where it is not used.
        return {f.name: v for f, v in values.items() if not (f.metadata.get("added") and v == f.default)}
    if hasattr(value, "tobytes"):  # an array
        return [str(value.dtype), list(value.shape), digest(value.tobytes())]
    if isinstance(value, set | frozenset):
        return sorted(value)
    if hasattr(value, "items"):
        return dict(value)
    raise TypeError(f"cannot tell apart by content: {type(value).__name__}")


def digest_of_file(path: Path) -> str:
    """Return 16 hexadecimal digits of a file's bytes, of a whole .gz of what it holds. Raises OSError."""
    damaged = suppress(EOFError, zlib.error, gzip.BadGzipFile)
    with damaged, gzip.open(path) if path.suffix == ".gz" else path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()[:16]
    return digest(path.read_bytes())


# Prose, compiled kernels, trained networks: a task that reads one names its digest.
NO_PART = (".pyc", ".md", ".nbi", ".nbc", ".safetensors")


def software(*places: str) -> dict[str, str]:
    """Return place -> digest of its files, and package -> version or "absent".

    Args:
        *places: folders and files of the project, as `snug/body`, and absolute paths of users' files. One
            within another is no part of its own. With a user's file all that is installed counts.

    Raises:
        DeclarationError: a place that is not there, or a file that cannot be read.

    >>> list(software("benchmarks/declarations.py"))[:2]
    ['benchmarks/declarations.py', 'package numpy']
    """
    outer = sorted(p for p in set(places) if not any(p.startswith(f"{other}/") for other in places))
    parts = {place: _content(place) for place in outer}
    parts |= {f"package {name}": version for name, version in versions().items()}
    return parts | ({"installed packages": _digest_packages()} if any(map(os.path.isabs, outer)) else {})


def find_module(module: str) -> str:
    """Return the file of a module, or of "module:function"; relative to the project where it is ours.

    Raises DeclarationError where it is missing.

    >>> find_module("benchmarks.scene")
    'benchmarks/scene.py'
    """
    if module.endswith(".py"):
        return module
    module = module.partition(":")[0]
    stem = module.replace(".", "/")
    if path := next((p for p in (f"{stem}.py", f"{stem}/__init__.py") if (ROOT / p).is_file()), None):
        return path
    spec = None
    with suppress(ModuleNotFoundError):  # of its package
        spec = importlib.util.find_spec(module)
    if spec is None or spec.origin is None:
        raise DeclarationError(f"no module {module}: see the entry that names it")
    return spec.origin


def find_imports(home: str) -> dict[str, Path]:
    """Return name -> file of modules beside a user's file that it or they import."""
    top, names = _top_of(Path(home)), set[str]()
    for path in _neighbours(Path(home)):
        with suppress(SyntaxError, ValueError):  # it is not imported: what is was loaded
            for node in ast.walk(ast.parse(path.read_bytes())):
                if isinstance(node, ast.Import):
                    names |= {alias.name.split(".")[0] for alias in node.names}
                elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
                    names.add(node.module.split(".")[0])
    files = {name: (top / f"{name}.py", top / name / "__init__.py") for name in sorted(names)}
    return {name: path for name, paths in files.items() for path in paths if path.is_file()}


@cache
def _content(place: str) -> str:
    """Return the digest of a place, a folder of the project or a user's file."""
    if Path(place).is_absolute():
        top, paths = _top_of(Path(place)), _neighbours(Path(place))
    else:
        top, paths = ROOT, files_of(place)
    if not paths:
        raise DeclarationError(f"{place}: no such folder or file, see benchmarks.runner.schedule")
    try:
        return digest({path.relative_to(top).as_posix(): digest_of_file(path) for path in paths})
    except OSError as error:
        raise DeclarationError(f"{place}: cannot be read: {error}") from None


def files_of(place: str) -> list[Path]:
    """Return the files of the project at a place that count, in order."""
    path = ROOT / place

    def counts(file: Path) -> bool:
        hidden = any(part.startswith((".", "__pycache__")) for part in file.relative_to(ROOT).parts)
        return file.suffix not in NO_PART and not hidden

    files = [path] if path.is_file() else sorted(p for p in path.rglob("*") if p.is_file())
    return list(filter(counts, files))


def _neighbours(home: Path) -> list[Path]:
    """Return the modules beside a user's file or its package, and in folders there.

    Of an installed package they are its own: what is installed beside it counts by its version.
    """
    top = _top_of(home)
    installed = top.name in ("site-packages", "dist-packages")
    paths = []
    for folder, folders, names in os.walk(top / home.relative_to(top).parts[0] if installed else top):
        modules = sorted(name for name in names if name.endswith(".py"))
        folders[:] = sorted(name for name in folders if name.isidentifier()) if modules else []
        paths += [Path(folder, name) for name in modules]
    return paths


def _top_of(home: Path) -> Path:
    """Return the folder that a file is imported from: above the packages that it lies in."""
    top = home.parent
    while (top / "__init__.py").is_file():
        top = top.parent
    return top


@cache
def _digest_packages() -> str:
    return digest(sorted(f"{package.name} {package.version}" for package in metadata.distributions()))
