"""Compiled kernels as arguments of other compiled kernels.

A solver that serves any term gets the term's kernel when it runs. `KernelArgument` hands one over so that it
is compiled in, as if it had been called by its name; the caller is compiled anew for each set of kernels. The
type of the argument holds the kernel's name and the digest of its source (see kernel_cache), so that what
numba keeps on disk is found again by another process and is never stale.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

from numba.core import types
from numba.core.dispatcher import Dispatcher
from numba.extending import NativeValue, models, overload, register_model, typeof_impl, unbox

from reference_sim.kernels.kernel_cache import njit, source_digest


class KernelArgument:
    """A kernel compiled by `kernel_cache.njit`, to be passed to another one."""

    def __init__(self, kernel: Dispatcher) -> None:
        function = kernel.py_func
        self.numba_type = KernelType(
            f"{function.__module__}:{function.__qualname__}", source_digest(function)
        )


class KernelType(types.Opaque):
    """numba's type of a KernelArgument: another one for each kernel and each state of its source."""

    def __init__(self, kernel: str, digest: str) -> None:
        self.kernel = kernel
        super().__init__(f"Kernel({kernel}@{digest})")

    def load(self) -> Dispatcher:
        """Import the kernel."""
        module, _, name = self.kernel.partition(":")
        return getattr(import_module(module), name)


register_model(KernelType)(models.OpaqueModel)


@typeof_impl.register(KernelArgument)
def _type_of(argument: KernelArgument, _: Any) -> KernelType:
    return argument.numba_type


@unbox(KernelType)
def _unboxed(kind: KernelType, _: Any, c: Any) -> NativeValue:
    return NativeValue(c.context.get_dummy_value())


@njit(cache=True)
def call_each(terms, out, *arguments):
    """out[k] becomes kernel(data, *arguments) of the k-th of terms ((kernel, data), ...)."""
    _call_from(terms, out, 0, arguments)


def _call_from(terms, out, k, arguments):
    """Stand for the overload below."""
    raise NotImplementedError


@overload(_call_from)
def _overloaded_call_from(terms, out, k, arguments):
    if len(terms) == 0:
        return lambda terms, out, k, arguments: None
    kernel = terms[0][0].load()

    def implementation(terms, out, k, arguments):
        out[k] = kernel(terms[0][1], *arguments)
        _call_from(terms[1:], out, k + 1, arguments)

    return implementation
