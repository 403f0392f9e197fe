"""Read a pickle that holds plain values only: containers, numbers, strings, arrays, sparse matrices.

A pickle is a program: it names functions and calls them. Here a name can only stand for a class of the table
`ALLOWED` at the end of this module. Such a stand-in keeps what it is called with; nothing is converted before
the whole file has been read. Files of Python 2 and 3 and of old and new NumPy and SciPy are read.
chumpy's arrays (official SMPL files) are taken as the array that they hold.
"""

from __future__ import annotations

import io
import math
import pickle
import pickletools
import re
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

MAX_BYTES = 2**30  # of a file
MAX_OPERATIONS = 1_000_000  # of a pickle: an array takes some 30 of them, whatever its size
MAX_TUPLES = 20_000  # the hash of a deeper nest of tuples would overflow the stack
REMEDY = "write plain arrays, as numpy.savez does"

Plain = Callable[[Any], Any]  # a value as unpickled -> the plain value that it stands for
Convert = Callable[[tuple[Any, ...], Any, Plain], Any]  # arguments and state of a name -> its plain value


class PlainPickleError(ValueError):
    """A pickle that cannot be read as plain values; the message names the file and the remedy."""


def read_plain_pickle(path: str | Path) -> Any:
    """Read a pickle of plain values without running anything that it names.

    Returns:
        dict, list, tuple, set, numbers, str, bytes, None, numpy arrays or scipy.sparse matrices. Arrays have
        plain dtypes (bool, integers, floats, strings), may be of either byte order and cannot be written to.
        Text of Python 2 is taken as latin-1.

    Raises:
        PlainPickleError: file, problem, remedy.
    """
    path = Path(path)
    if not path.is_file():
        raise PlainPickleError(f"{path}: no such file")
    if path.stat().st_size > MAX_BYTES:
        raise PlainPickleError(f"{path}: larger than {MAX_BYTES >> 20} MiB; {REMEDY}, in parts")
    try:
        content = path.read_bytes()
        _check_operations(content)
        return _to_plain(_Unpickler(io.BytesIO(content), encoding="latin1").load(), {})
    # A broken pickle can fail in nearly every way, and none of them is this program's own.
    except Exception as error:
        why = " ".join(str(error).split())[:200] or type(error).__name__
        raise PlainPickleError(
            f"{path}: cannot be read as a pickle of plain arrays ({why}); {REMEDY}"
        ) from None


def _check_operations(content: bytes) -> None:
    """Refuse a pickle that makes the unpickler allocate more than the file holds, or compute without end.

    The readers of pickletools return what is there, and fail where a declared size is larger.
    """
    stream, count, tuples = io.BytesIO(content), 0, 0
    while (code := stream.read(1)) != b".":
        operation = pickletools.code2op.get(code.decode("latin-1"))  # type: ignore[attr-defined]
        if operation is None:
            raise ValueError("it is cut off or is no pickle")
        value: Any = None
        if operation.name == "STRING":
            stream.readline()  # the reader of pickletools takes ASCII alone
        elif operation.arg is not None:
            value = operation.arg.reader(stream)
        count += 1
        tuples += operation.name.startswith(("TUPLE", "FROZENSET"))
        if count > MAX_OPERATIONS or tuples > MAX_TUPLES:
            raise ValueError("it holds too many single values")
        if operation.name.endswith("PUT") and int(value) > count:
            raise ValueError(f"it names entry {value} of a memo of {count}")
        if operation.name in ("INT", "LONG", "LONG1", "LONG4") and not -(2**63) <= value < 2**64:
            raise ValueError("an integer has more than 64 bits")


class _Unpickler(pickle.Unpickler):
    def find_class(self, module: str, name: str) -> type:
        stand_in = ALLOWED.get((module, name)) if isinstance(module, str) and isinstance(name, str) else None
        if stand_in is None:
            raise ValueError(f"it needs {module}.{name}, which is no plain value")
        return stand_in


def _to_plain(value: Any, done: dict[int, Any]) -> Any:
    """Return the value with every stand-in in it converted; `done`: values converted before, by their id."""
    if isinstance(value, type):
        raise ValueError("it holds a type as a value")
    if not isinstance(value, _StandIn | dict | list | tuple | set | frozenset) or id(value) in done:
        return done.get(id(value), value)
    if isinstance(value, _StandIn):
        plain = value.convert(value.arguments, value.state, lambda part: _to_plain(part, done))
    elif isinstance(value, dict):
        plain = {_to_plain(key, done): _to_plain(entry, done) for key, entry in value.items()}
    else:
        plain = type(value)(_to_plain(entry, done) for entry in value)
    done[id(value)] = plain
    return plain


class _StandIn:
    """A class or function that a pickle may name: keeps arguments and state, and runs nothing.

    convert(arguments, state, plain) returns its plain value afterwards, or raises; plain: `_to_plain`.
    """

    __slots__ = ("arguments", "state")
    arguments: tuple[Any, ...]
    state: Any
    convert: Convert

    def __new__(cls, *arguments: Any) -> Any:
        stand_in = object.__new__(cls)
        stand_in.arguments, stand_in.state = arguments, None
        return stand_in

    # Every stand-in has one, so that the unpickler never sets attributes in another way.
    def __setstate__(self, state: Any) -> None:
        self.state = state


class _Dict(_StandIn):
    """An OrderedDict or a defaultdict, whose entries come afterwards."""

    def __new__(cls, *arguments: Any) -> Any:
        return dict(*arguments) if arguments and isinstance(arguments[0], list) else {}


class _Reconstructor(_StandIn):
    """copyreg's _reconstructor: how protocols 0 and 1 make an object, whose state follows at once."""

    def __new__(cls, kind: Any, base: Any, state: Any) -> Any:
        if not (isinstance(kind, type) and issubclass(kind, _StandIn)) or state is not None:
            raise ValueError("it builds an object in an unknown way")
        return kind()


def _refuse(arguments: tuple[Any, ...], state: Any, plain: Plain) -> Any:
    raise ValueError("it holds an object of a type that is only named")


def _encoded_text(arguments: tuple[Any, ...], state: Any, plain: Plain) -> bytes:
    """Convert _codecs.encode, or bytes without arguments: how protocols before 3 write bytes."""
    text, encoding = arguments or ("", "latin1")
    if encoding != "latin1":
        raise ValueError("it encodes bytes in an unknown way")
    return text.encode("latin-1")


def _dtype(arguments: tuple[Any, ...], state: Any, plain: Plain) -> np.dtype:
    """Convert numpy.dtype: a kind with a size; its state tells the byte order."""
    kind = arguments[0]
    if not isinstance(kind, str) or not re.fullmatch(r"[<>|=]?(b1|[iu][1248]|f[248]|[SU][1-9]\d{0,5})", kind):
        raise ValueError(f"arrays of dtype {str(kind)[:20]} are not plain numbers or strings")
    order: Any
    order, *fields = state[1:5] if state else ("|",)
    if order not in ("<", ">", "|", "=") or any(field is not None for field in fields):
        raise ValueError("a dtype has fields")
    return np.dtype(kind) if order == "|" else np.dtype(kind).newbyteorder(order)


def _array(arguments: tuple[Any, ...], state: Any, plain: Plain) -> np.ndarray:
    """Convert numpy's _reconstruct: an empty array; its state follows, sometimes after a version."""
    shape, dtype, fortran, content = plain(state)[-4:]
    return _array_of(content, dtype, shape, "F" if fortran else "C")


def _array_from_buffer(arguments: tuple[Any, ...], state: Any, plain: Plain) -> np.ndarray:
    """Convert numpy's _frombuffer: an array of protocol 5."""
    content, dtype, shape, order, *axes = map(plain, arguments)
    array = _array_of(content, dtype, shape, "F" if order == "F" else "C")
    return array.transpose(axes[0]) if order == "K" and axes and axes[0] is not None else array


def _scalar(arguments: tuple[Any, ...], state: Any, plain: Plain) -> Any:
    """Convert numpy's scalar: a Python number or string."""
    dtype, content = map(plain, arguments)
    return _array_of(content, dtype, (), "C").item()


def _array_of(content: Any, dtype: Any, shape: Any, order: Any) -> np.ndarray:
    """Return the array of these bytes. Raises ValueError unless they are as many as dtype and shape need."""
    content = content.encode("latin-1") if isinstance(content, str) else content  # str: of Python 2
    if not isinstance(content, bytes | bytearray) or not isinstance(dtype, np.dtype):
        raise ValueError("an array has no plain content")
    if not isinstance(shape, tuple) or not all(type(n) is int and n >= 0 for n in shape):
        raise ValueError("an array has no plain shape")
    if len(content) != math.prod(shape) * dtype.itemsize:
        raise ValueError(f"an array of shape {shape} and {dtype} has {len(content)} bytes")
    return np.ndarray(shape, dtype, buffer=bytes(content), order=order)


def _sparse(kind: str, arguments: tuple[Any, ...], state: Any, plain: Plain) -> Any:
    """Convert scipy's csc, csr and coo matrices."""
    import scipy.sparse  # few pickles hold one

    state = plain(state)
    shape = tuple(map(int, state["_shape" if "_shape" in state else "shape"]))
    data = _numbers(state["data"])
    if kind == "coo_matrix":
        row, column = state.get("coords") or (state["row"], state["col"])
        return scipy.sparse.coo_matrix((data, (_numbers(row), _numbers(column))), shape=shape)
    parts = data, _numbers(state["indices"]), _numbers(state["indptr"])
    matrix = getattr(scipy.sparse, kind)(parts, shape=shape)
    matrix.check_format(full_check=True)
    return matrix


def _numbers(value: Any) -> np.ndarray:
    """Return an array of a sparse matrix in the machine's byte order, writeable."""
    array = np.asarray(value)
    if array.ndim != 1 or array.dtype.kind not in "biuf":
        raise ValueError("a sparse matrix is not made of lists of numbers")
    return array.astype(array.dtype.newbyteorder("="))


def _names(modules: str, names: str, rule: type[_StandIn] | Convert) -> dict[tuple[str, str], type]:
    """Return one stand-in for these names of these modules; rule: the class, or how it is converted."""
    if not isinstance(rule, type):
        rule = type("StandIn", (_StandIn,), {"__slots__": (), "convert": staticmethod(rule)})
    return {(module, name): rule for module in modules.split() for name in names.split()}


# Modules of Python 2 and 3, of old and new NumPy and SciPy.
ALLOWED = {
    **_names("numpy", "ndarray", _refuse),
    **_names("numpy", "dtype", _dtype),
    **_names("numpy.core.multiarray numpy._core.multiarray", "_reconstruct", _array),
    **_names("numpy.core.multiarray numpy._core.multiarray", "scalar", _scalar),
    **_names("numpy.core.numeric numpy._core.numeric", "_frombuffer", _array_from_buffer),
    **_names("scipy.sparse.csc scipy.sparse._csc", "csc_matrix csc_array", partial(_sparse, "csc_matrix")),
    **_names("scipy.sparse.csr scipy.sparse._csr", "csr_matrix csr_array", partial(_sparse, "csr_matrix")),
    **_names("scipy.sparse.coo scipy.sparse._coo", "coo_matrix coo_array", partial(_sparse, "coo_matrix")),
    # Every other class of chumpy is computed from some, and refused.
    **_names("chumpy.ch", "Ch", lambda arguments, state, plain: np.asarray(plain(state)["x"])),
    **_names("copy_reg copyreg", "_reconstructor", _Reconstructor),
    **_names("_codecs", "encode", _encoded_text),
    **_names("__builtin__", "bytes", _encoded_text),
    **_names("__builtin__ builtins", "set", lambda arguments, state, plain: set(*map(plain, arguments))),
    **_names("__builtin__ builtins", "object list dict int float", _refuse),
    **_names("collections", "OrderedDict defaultdict", _Dict),
}
