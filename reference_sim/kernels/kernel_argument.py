"""Compiled kernels as arguments of other compiled kernels.

A solver that serves any term gets the term's kernel when it runs. `kernel_argument` hands one over so that it
is compiled in, as if it had been called by its name; the caller is compiled anew for each set of kernels.
The argument is an array whose one field is named after the kernel and the digest of its source (see
kernel_cache). So numba's type of it names the kernel, what numba keeps on disk is found again by another
process and is never stale, and a call costs no more than that of any other array.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, partial
from importlib import import_module
from typing import Any

import numpy as np
from numba import typeof
from numba.core.dispatcher import Dispatcher
from numba.extending import overload

from reference_sim.kernels.kernel_cache import njit, source_digest


@cache  # numba knows the dtype of a record again by its identity
def kernel_argument(kernel: Dispatcher) -> np.ndarray:
    """Return what stands for a kernel of `kernel_cache.njit` among the arguments of another one."""
    function = kernel.py_func
    name = f"{function.__module__}:{function.__qualname__}@{source_digest(function)}"
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
def _overloaded_call_from(first, terms, out, arguments):
    # A slice of the tuple of terms would count the references to all of its arrays at every call.
    at, after = first.literal_value, first.literal_value + 1
    if at == len(terms):
        return lambda first, terms, out, arguments: None
    kernel = _load(terms[at][0])

    def implementation(first, terms, out, arguments):
        out[at] = kernel(terms[at][1], *arguments)
        _call_from(after, terms, out, arguments)

    return implementation


def with_types_resolved(kernel: Dispatcher, *arguments: object) -> Callable[[], object]:
    """Return a call of a compiled kernel with these arguments that looks up no types.

    For kernels among the arguments numba does so in Python at every call, which takes longer than a sweep
    over a small mesh.
    """
    return partial(kernel.compile(tuple(map(typeof, arguments))), *arguments)
