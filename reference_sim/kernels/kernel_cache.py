"""`njit` whose compiled kernels on disk are never stale, and compiled kernels as arguments of others.

numba keeps on disk what it compiled, and compiles a kernel anew when the kernel's own file has changed.
It does not see changes in other files: of kernels that are called, or of imported constants.
So each module's kernels are kept in a folder whose name holds a digest of the file and of both.

The folders lie in `__pycache__` beside the module, else in the user's cache folder, or in NUMBA_CACHE_DIR.
"""

from __future__ import annotations

import contextlib
import gc
import hashlib
import os
import platform
import tempfile
import warnings
from collections.abc import Callable
from functools import cache, partial
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

import numba
import numpy as np
from filelock import FileLock
from numba import typeof
from numba.core.caching import InTreeCacheLocator
from numba.core.codegen import get_host_cpu_features
from numba.core.dispatcher import Dispatcher
from numba.core.extending import _Intrinsic
from numba.core.registry import cpu_target
from numba.extending import overload
from numba.misc.appdirs import AppDirs

CONSTANTS = (bool, int, float, complex, str, tuple, np.generic)
FLAGS = (set, frozenset)  # of fastmath
# These let LLVM take the processor's estimates of 1/x and 1/sqrt(x), whose digits are its maker's.
ESTIMATING = {"fast", "arcp", "afn"}

_config: Any = numba.config
if _config.DISABLE_JIT:  # in other processes that this one starts too
    warnings.warn("NUMBA_DISABLE_JIT is not heeded: kernels run compiled alone", stacklevel=2)
    _config.DISABLE_JIT = 0
    os.environ["NUMBA_DISABLE_JIT"] = "0"
if platform.machine() in ("x86_64", "AMD64") and _config.CPU_FEATURES is None:
    # LLVM sums up in vectors of one width, so that a simulation is the same on each of these processors.
    features = f"{get_host_cpu_features()},+prefer-256-bit"
    _config.CPU_FEATURES = os.environ["NUMBA_CPU_FEATURES"] = features
# Here, and not at the first kernel of each process that is forked.
cpu_target.typing_context.refresh()
cpu_target.target_context.refresh()
_digests: dict[str, str] = {}  # of modules that hold kernels, by name
_folders: dict[str, Path | None] = {}


def njit(**options: Any) -> Callable[[Any], Any]:
    """Return the decorator `numba.njit(**options)`, where cache=True means a cache that sees other files too.

    What a kernel takes from another file is to be imported above the first kernel of its own file. Where
    no folder can be written, every process compiles for itself.

    Raises:
        ValueError: fastmath of other digits on another processor.
    """
    fastmath = options.get("fastmath") or set()
    if fastmath is True or not ESTIMATING.isdisjoint(fastmath):
        raise ValueError(f"njit(fastmath={fastmath}): leave out {', '.join(sorted(ESTIMATING))}")

    def decorate(function: Any) -> Any:
        module = function.__module__
        if module not in _digests:
            _digests[module] = _digest(function)
            _folders[module] = _folder(function, _digests[module])
        folder = _folders[module] if options.get("cache") else None
        # While it decorates: kernels of other packages keep their own.
        locators = _config.CACHE_LOCATOR_CLASSES
        _config.CACHE_LOCATOR_CLASSES = f"{__name__}.{KernelLocator.__name__}"
        try:
            # C calls no kernel: the wrapper for it is a seventh of the time to compile.
            forced = {"cache": folder is not None, "no_cfunc_wrapper": True}
            kernel = numba.njit(**options | forced)(function)
        finally:
            _config.CACHE_LOCATOR_CLASSES = locators
        if folder:
            _guard(kernel, folder / f"{function.__qualname__}.lock")
        return kernel

    return decorate


class KernelLocator(InTreeCacheLocator):
    """Answer to numba where the compiled kernels of a function lie and whether they are still good."""

    def __init__(self, function: Any, file: str) -> None:
        super().__init__(function, file)
        self._module = function.__module__

    def get_cache_path(self) -> str:
        """Return the folder of the compiled kernels."""
        return str(_folders[self._module])

    def get_source_stamp(self) -> str:
        """Return the digest by which numba knows that the source is the same."""
        return _digests[self._module]


def _guard(kernel: Any, lock: Path) -> None:
    """Let other processes wait while this one compiles the kernel."""
    compile_kernel = kernel.compile

    def compile_alone(signature: Any) -> Any:
        if signature in kernel.overloads:  # as in each step of a sweep: nothing is left to compile
            return compile_kernel(signature)
        collects = gc.isenabled()
        gc.disable()  # circular garbage: to look for it takes a sixth of the time
        try:
            with FileLock(lock):  # a new one each time: a fork would keep it
                return compile_kernel(signature)
        finally:
            if collects:
                gc.enable()

    kernel.compile = compile_alone


def _digest(function: Any) -> str:
    """Return the digest of the file of a module's first kernel, with kernels and constants imported above."""
    digest = hashlib.blake2b(Path(function.__code__.co_filename).read_bytes(), digest_size=8)
    for name, value in function.__globals__.items():
        if isinstance(value, Dispatcher):
            digest.update(_digests.get(value.py_func.__module__, "").encode())
        elif isinstance(value, _Intrinsic):
            digest.update(Path(value._defn.__code__.co_filename).read_bytes())
        elif isinstance(value, ModuleType):
            digest.update(_digests.get(value.__name__, "").encode())
        elif isinstance(value, CONSTANTS) and not name.startswith("__"):
            digest.update(f"{name}={value!r};".encode())
        elif isinstance(value, FLAGS):
            digest.update(f"{name}={sorted(map(repr, value))};".encode())
    return digest.hexdigest()


def _folder(function: Any, digest: str) -> Path | None:
    """Return the writable folder for a module's kernels of this digest; None if there can be none."""
    pycache = Path(function.__code__.co_filename).parent / "__pycache__"
    root, home = _config.CACHE_DIR, AppDirs(appname="numba", appauthor=False).user_cache_dir
    for base in [root] if root else [pycache, home]:
        folder = Path(base, f"{function.__module__}-{digest}")
        with contextlib.suppress(OSError):
            folder.mkdir(parents=True, exist_ok=True)
            tempfile.TemporaryFile(dir=folder).close()  # numba asks for a folder that can be written
            return folder
    return None


# A solver that serves any term gets the term's kernel when it runs. `kernel_argument` hands one over as
# an array whose one field is named after the kernel and the digest of its source. So numba's type of it
# names the kernel, which is compiled in, and found on disk again by another process.
@cache  # numba knows the dtype of a record again by its identity
def kernel_argument(kernel: Dispatcher) -> np.ndarray:
    """Return what stands for a kernel of `kernel_cache.njit` among the arguments of another one."""
    function = kernel.py_func
    name = f"{function.__module__}:{function.__qualname__}@{_digests[function.__module__]}"
    return np.zeros(1, np.dtype([(name, np.int8)]))


def _load(kind: Any) -> Dispatcher:
    """Import the kernel that numba's type of an argument names."""
    (name,) = kind.dtype.fields
    module, _, function = name.partition("@")[0].partition(":")
    return getattr(import_module(module), function)


@njit(cache=True)
def call_each(terms, out, *arguments):
    """Set out[k] to kernel(data, *arguments) of the k-th of terms ((kernel_argument, data), ...)."""
    _call_from(0, terms, out, arguments)


def _call_from(first, terms, out, arguments):
    """Stand for the overload below."""
    raise NotImplementedError


@overload(_call_from, prefer_literal=True)
def _overload_call(first, terms, out, arguments):
    # A slice of the tuple of terms would count the references to all of its arrays at every call.
    at, after = first.literal_value, first.literal_value + 1
    if at == len(terms):
        return lambda first, terms, out, arguments: None
    kernel = _load(terms[at][0])

    def implementation(first, terms, out, arguments):
        out[at] = kernel(terms[at][1], *arguments)
        _call_from(after, terms, out, arguments)

    return implementation


def resolve_types(kernel: Dispatcher, *arguments: object) -> Callable[[], object]:
    """Return a call of a compiled kernel with these arguments that looks up no types.

    For kernels among the arguments numba does so in Python at every call, which takes longer than a sweep
    over a small mesh.
    """
    return partial(kernel.compile(tuple(map(typeof, arguments))), *arguments)
