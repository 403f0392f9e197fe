"""Read a pickle that holds plain values only: containers, numbers, strings, arrays, sparse matrices.

A pickle is a program: it names functions and calls them. Here a name can only stand for a class of this
module, by an allow-list, so nothing outside of this module is ever called. Files of Python 2 and 3 and of old
and new NumPy and SciPy are read. chumpy's arrays (official SMPL files) are taken as the array that they hold.
"""

from __future__ import annotations

import io
import math
import pickle
import pickletools
import re
from pathlib import Path
from typing import Any

import numpy as np

MAX_BYTES = 2**30  # of a file
MAX_OPERATIONS = 1_000_000  # of a pickle: an array takes some 30 of them, whatever its size
MAX_TUPLES = 20_000  # the hash of a deeper nest of tuples would overflow the stack
REMEDY = "write plain arrays, as numpy.savez does"


class PlainPickleError(ValueError):
    """A pickle that cannot be read as plain values; the message names the file and the remedy."""


def read_plain_pickle(path: str | Path) -> Any:
    """What a pickle holds: dict, list, tuple, set, numbers, str, bytes, None, numpy arrays, scipy.sparse.

    Arrays have plain dtypes (bool, integers, floats, strings), may be of either byte order and cannot be
    written to. Text of Python 2 is taken as latin-1. Raises PlainPickleError: file, what, remedy.
    """
    path = Path(path)
    if not path.is_file():
        raise PlainPickleError(f"{path}: no such file")
    if path.stat().st_size > MAX_BYTES:
        raise PlainPickleError(f"{path}: larger than {MAX_BYTES >> 20} MiB; {REMEDY}, in parts")
    try:
        content = path.read_bytes()
        _check_operations(content)
        return _plain(_Unpickler(io.BytesIO(content), encoding="latin1").load(), {})
    # A broken pickle can fail in nearly every way, and none of them is this program's own.
    except Exception as error:
        why = " ".join(str(error).split())[:200] or type(error).__name__
        raise PlainPickleError(
            f"{path}: cannot be read as a pickle of plain arrays ({why}); {REMEDY}"
        ) from None


def _check_operations(content: bytes) -> None:
    """Refuse what would make the unpickler allocate more than the file holds, or compute without end.

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
    def find_class(self, module: str, name: str) -> Any:
        found = _ALLOWED.get((module, name)) if isinstance(module, str) and isinstance(name, str) else None
        if found is None:
            raise ValueError(f"it needs {module}.{name}, which is no plain value")
        return found


class _Part:
    """What a name stands for. Every one has a __setstate__, so that a state is never set in another way."""

    __slots__ = ("state",)
    state: Any

    def __new__(cls, *values: Any) -> Any:
        raise ValueError(f"it calls {cls.__name__.strip('_')}")

    def __setstate__(self, state: Any) -> None:
        raise ValueError("it sets the state of what has none")

    def plain(self) -> Any:
        raise ValueError(f"it holds {type(self).__name__.strip('_')} as a value")


class _Name(_Part):
    """A type that is named, and neither called nor made: numpy.ndarray, object, the list of a defaultdict."""

    __slots__ = ()


class _Dict(_Part):
    """An OrderedDict or a defaultdict: its entries come afterwards."""

    __slots__ = ()

    def __new__(cls, *values: Any) -> Any:
        return dict(*values) if values and isinstance(values[0], list) else {}


class _Set(_Part):
    __slots__ = ()

    def __new__(cls, values: Any = ()) -> Any:
        return set(values)


class _Encoded(_Part):
    """_codecs.encode, or bytes where there are none: how protocols before 3 write bytes."""

    __slots__ = ()

    def __new__(cls, text: Any = "", encoding: Any = "latin1") -> Any:
        if not isinstance(text, str) or encoding != "latin1":
            raise ValueError("it encodes bytes in an unknown way")
        return text.encode("latin-1")


class _DType(_Part):
    """numpy.dtype: a kind with a size; its state tells the byte order."""

    __slots__ = ()

    def __new__(cls, kind: Any, *flags: Any) -> Any:
        if not isinstance(kind, str) or not re.fullmatch(
            r"[<>|=]?(b1|[iu][1248]|f[248]|[SU][1-9]\d{0,5})", kind
        ):
            raise ValueError(f"arrays of dtype {str(kind)[:20]} are not plain numbers or strings")
        made = object.__new__(cls)
        made.state = np.dtype(kind)
        return made

    def __setstate__(self, state: Any) -> None:
        order, subarray, names, fields = state[1:5]
        if order not in ("<", ">", "|", "=") or any(x is not None for x in (subarray, names, fields)):
            raise ValueError("a dtype has fields")
        self.state = self.state if order == "|" else self.state.newbyteorder(order)


class _Array(_Part):
    """numpy's _reconstruct: an empty array whose state follows."""

    __slots__ = ()

    def __new__(cls, kind: Any, shape: Any, code: Any) -> Any:
        if kind is not _Name or shape != (0,):
            raise ValueError("it builds an array in an unknown way")
        made = object.__new__(cls)
        made.state = None
        return made

    def __setstate__(self, state: Any) -> None:
        shape, dtype, fortran, raw = state[-4:]  # a version before them is not always there
        self.state = _array(raw, dtype, shape, "F" if fortran else "C")

    def plain(self) -> np.ndarray:
        if self.state is None:
            raise ValueError("an array has no content")
        return self.state


class _FromBuffer(_Part):
    """numpy's _frombuffer: an array of protocol 5."""

    __slots__ = ()

    def __new__(cls, raw: Any, dtype: Any, shape: Any, order: Any, axes: Any = None) -> Any:
        if order == "K" and axes is not None:
            return _array(raw, dtype, shape, "C").transpose(axes)
        return _array(raw, dtype, shape, "F" if order == "F" else "C")


class _Scalar(_Part):
    """numpy's scalar: a Python number or string."""

    __slots__ = ()

    def __new__(cls, dtype: Any, raw: Any) -> Any:
        return _array(raw, dtype, (), "C").item()


def _array(raw: Any, dtype: Any, shape: Any, order: Any) -> np.ndarray:
    """The array of those bytes, which must be as many as dtype and shape need. Raises ValueError."""
    content = raw.encode("latin-1") if isinstance(raw, str) else raw  # str: written by Python 2
    if not isinstance(content, bytes | bytearray) or not isinstance(dtype, _DType):
        raise ValueError("an array has no plain content")
    if not isinstance(shape, tuple) or not all(type(n) is int and n >= 0 for n in shape):
        raise ValueError("an array has no plain shape")
    if len(content) != math.prod(shape) * dtype.state.itemsize:
        raise ValueError(f"an array of shape {shape} and {dtype.state} has {len(content)} bytes")
    return np.ndarray(shape, dtype.state, buffer=bytes(content), order=order)


class _Object(_Part):
    """An object that is made empty and then given its attributes as a dict."""

    __slots__ = ()

    def __new__(cls, *values: Any) -> Any:
        made = object.__new__(cls)
        made.state = {}
        return made

    def __setstate__(self, state: Any) -> None:
        if not isinstance(state, dict):
            raise ValueError("the attributes of an object are no dict")
        self.state = state


class _Chumpy(_Object):
    """chumpy's array of plain numbers; every other class of chumpy is computed from some, and refused."""

    __slots__ = ()

    def plain(self) -> np.ndarray:
        return np.asarray(_plain(self.state["x"], {}))


class _Compressed(_Object):
    """scipy's csc and csr matrices; the two differ in who is compressed, and in the name."""

    __slots__ = ()
    format = "csc_matrix"

    def plain(self) -> Any:
        import scipy.sparse

        parts = tuple(_numbers(self.state[key]) for key in ("data", "indices", "indptr"))
        matrix = getattr(scipy.sparse, self.format)(parts, shape=_sparse_shape(self.state))
        matrix.check_format(full_check=True)
        return matrix


class _RowCompressed(_Compressed):
    __slots__ = ()
    format = "csr_matrix"


class _Coordinates(_Object):
    """scipy's coo matrix."""

    __slots__ = ()

    def plain(self) -> Any:
        import scipy.sparse

        row, column = self.state.get("coords") or (self.state["row"], self.state["col"])
        where = (_numbers(row), _numbers(column))
        return scipy.sparse.coo_matrix((_numbers(self.state["data"]), where), shape=_sparse_shape(self.state))


def _numbers(value: Any) -> np.ndarray:
    """An array of a sparse matrix, in the machine's byte order and its own to write."""
    array = np.asarray(_plain(value, {}))
    if array.ndim != 1 or array.dtype.kind not in "biuf":
        raise ValueError("a sparse matrix is not made of lists of numbers")
    return array.astype(array.dtype.newbyteorder("="))


def _sparse_shape(state: dict[str, Any]) -> tuple[int, int]:
    rows, columns = (int(_plain(n, {})) for n in state["_shape" if "_shape" in state else "shape"])
    return rows, columns


class _Reconstructor(_Part):
    """copyreg's _reconstructor: how protocols 0 and 1 make an object."""

    __slots__ = ()

    def __new__(cls, kind: Any, base: Any, state: Any) -> Any:
        if (
            not (isinstance(kind, type) and issubclass(kind, _Object))
            or base is not _Name
            or state is not None
        ):
            raise ValueError("it builds an object in an unknown way")
        return kind()


def _plain(value: Any, done: dict[int, Any]) -> Any:
    """The value with each part in it replaced by what it stands for; `done`: values met before, by id."""
    if isinstance(value, _Part):
        made = done[id(value)] if id(value) in done else value.plain()
    elif isinstance(value, type):
        raise ValueError("it holds a type as a value")
    elif not isinstance(value, dict | list | tuple | set | frozenset) or id(value) in done:
        return done.get(id(value), value)
    elif isinstance(value, dict):
        made = {_plain(key, done): _plain(entry, done) for key, entry in value.items()}
    else:
        made = type(value)(_plain(entry, done) for entry in value)
    done[id(value)] = made
    return made


def _names(modules: str, names: str, part: type[_Part]) -> dict[tuple[str, str], type[_Part]]:
    return {(module, name): part for module in modules.split() for name in names.split()}


# Modules of Python 2 and 3, of old and new NumPy and SciPy.
_ALLOWED = {
    **_names("numpy", "ndarray", _Name),
    **_names("numpy", "dtype", _DType),
    **_names("numpy.core.multiarray numpy._core.multiarray", "_reconstruct", _Array),
    **_names("numpy.core.multiarray numpy._core.multiarray", "scalar", _Scalar),
    **_names("numpy.core.numeric numpy._core.numeric", "_frombuffer", _FromBuffer),
    **_names("scipy.sparse.csc scipy.sparse._csc", "csc_matrix csc_array", _Compressed),
    **_names("scipy.sparse.csr scipy.sparse._csr", "csr_matrix csr_array", _RowCompressed),
    **_names("scipy.sparse.coo scipy.sparse._coo", "coo_matrix coo_array", _Coordinates),
    **_names("chumpy.ch", "Ch", _Chumpy),
    **_names("copy_reg copyreg", "_reconstructor", _Reconstructor),
    **_names("_codecs", "encode", _Encoded),
    **_names("__builtin__", "bytes", _Encoded),
    **_names("__builtin__ builtins", "set", _Set),
    **_names("__builtin__ builtins", "object list dict int float", _Name),
    **_names("collections", "OrderedDict defaultdict", _Dict),
}
