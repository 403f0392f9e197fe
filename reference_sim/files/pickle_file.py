"""Arrays of a pickle that anyone may have written: a dict of arrays, as SMPL's models are distributed.

A pickle is a program: it names functions and calls them. Here a name can only stand for a class of the table
`ALLOWED`, and these make arrays of plain numbers and text, dicts, or nothing. Files of Python 2 and 3, of old
and new NumPy and SciPy are read. chumpy's arrays are taken as the array that they hold, compressed
sparse columns as a dense array.
"""

from __future__ import annotations

import io
import pickle
import pickletools
import re
from collections.abc import Callable, Collection
from pathlib import Path
from typing import Any

import numpy as np

from reference_sim.files.array_file import LIMIT, refusal

MAX_OPERATIONS = 1_000_000  # of a pickle: an array takes some 30 of them, whatever its size
MAX_TUPLES = 20_000  # the hash of a deeper nest of tuples would overflow the stack
PLAIN_VALUES = (np.ndarray, int, float, list, tuple)
PLAIN_TYPE = r"[<>|=]?(b1|[iu][1248]|f[248]|[SU][1-9]\d{0,5})"


def read_pickled_arrays(path: str | Path, names: Collection[str]) -> dict[str, np.ndarray]:
    """Read the arrays, numbers and lists of a pickled dict by name, without running anything that it names.

    Args:
        path: the file. Text of Python 2 in it is taken as latin-1.
        names: entries to return, as far as they are in it.

    Raises:
        ArrayFileError: no such file, no pickle of a dict, larger than 1 GiB, or more in it than plain values.
    """
    path = Path(path)
    try:
        if path.stat().st_size > LIMIT:
            raise ValueError(f"larger than {LIMIT >> 20} MiB")
        content = path.read_bytes()
        _check_operations(content)
        held = _Unpickler(io.BytesIO(content), encoding="latin1").load()
        if type(held) is not dict:
            raise ValueError("holds no dict of arrays")
        plain = {name: held[name] for name in names if isinstance(held.get(name), PLAIN_VALUES)}
        if not plain:
            raise ValueError(f"none of its entries is known ({', '.join(map(str, list(held)[:12]))})")
        return {name: np.asarray(value) for name, value in plain.items()}
    # A broken pickle can fail in nearly every way, and none of them is this program's own.
    except Exception as error:
        raise refusal(path, "", error) from None


def _check_operations(content: bytes) -> None:
    """Refuse a pickle that makes the unpickler allocate more than the file holds, or compute without end.

    The readers of pickletools return what is there, and fail where a declared size is larger.
    """
    stream, count, tuples = io.BytesIO(content), 0, 0
    while (code := stream.read(1)) != b".":
        operation = pickletools.code2op.get(code.decode("latin-1"))  # type: ignore[attr-defined]
        if operation is None:
            raise ValueError("cut off, or no pickle")
        value: Any = 0
        if operation.name == "STRING":
            stream.readline()  # the reader of pickletools takes ASCII alone
        elif operation.arg is not None:
            value = operation.arg.reader(stream)
        count += 1
        tuples += operation.name.startswith(("TUPLE", "FROZENSET"))
        if count > MAX_OPERATIONS or tuples > MAX_TUPLES:
            raise ValueError("holds too many single values")
        if operation.name.endswith("PUT") and int(value) > count:
            raise ValueError(f"names entry {value} of a memo of {count}")


class _Unpickler(pickle.Unpickler):
    def find_class(self, module: str, name: str) -> type:
        if (module, name) not in ALLOWED:
            raise ValueError(f"needs {module}.{name}, which is no plain value; write arrays by numpy.savez")
        return ALLOWED[module, name]


class _Inert:
    """Name whose value nobody reads: a set, or a type that another entry of the table is called with.

    Every class of the table has a __setstate__, so that the unpickler sets attributes in no other way, of an
    object or of the class itself.
    """

    def __init__(self, *arguments: Any) -> None:
        pass

    def __setstate__(self, state: Any) -> None:
        pass


class _Type(_Inert):
    """numpy.dtype: a kind with a size; its state tells the byte order."""

    def __init__(self, kind: str, *arguments: Any) -> None:
        if not re.fullmatch(PLAIN_TYPE, kind):
            raise ValueError(f"has an array of type {kind[:20]}, which is no plain number or text")
        self.numpy = np.dtype(kind)

    def __setstate__(self, state: Any) -> None:
        _, order, *fields = state[:5]
        if any(field is not None for field in fields):
            raise ValueError("has an array of several fields")
        self.numpy = self.numpy.newbyteorder(order)


class _Array(np.ndarray):
    """numpy.ndarray: an empty array, which its state fills."""

    def __new__(cls, *arguments: Any) -> _Array:
        return super().__new__(cls, (0,))

    def __setstate__(self, state: Any) -> None:
        *_, shape, kind, fortran, content = state
        self.fill_with(_array(content, kind, shape, "F" if fortran else "C"))

    def fill_with(self, array: np.ndarray) -> None:
        """Become a copy of another array, in its order of storage."""
        state: Any = (1, array.shape, array.dtype, array.flags.fnc, array.tobytes("A"))
        super().__setstate__(state)


class _Chumpy(_Array):
    """Array of chumpy; every other of its classes is computed from some, and refused."""

    def __setstate__(self, state: Any) -> None:
        self.fill_with(np.asarray(state["x"]))


class _Columns(_Array):
    """Compressed sparse columns of scipy, as a dense array."""

    def __setstate__(self, state: Any) -> None:
        rows, columns = state["_shape" if "_shape" in state else "shape"]
        if 8 * rows * columns > LIMIT:
            raise ValueError(f"has a sparse matrix of {rows} x {columns}, too large")
        dense = np.zeros((rows, columns), order="F")
        at = state["indices"], np.repeat(np.arange(columns), np.diff(state["indptr"]))
        np.add.at(dense, at, state["data"])
        self.fill_with(dense)


def _array(content: Any, kind: _Type, shape: tuple[int, ...], order: Any) -> np.ndarray:
    """Return the array of these bytes. Raises ValueError unless they are as many as kind and shape need."""
    if isinstance(content, str):  # of Python 2
        content = content.encode("latin-1")
    if not isinstance(content, bytes | bytearray):
        raise ValueError("has an array of anything but bytes")
    return np.frombuffer(content, kind.numpy).reshape(shape, order=order)


def _from_buffer(content: Any, kind: _Type, shape: Any, order: str, axes: Any = None) -> np.ndarray:
    array = _array(content, kind, shape, "F" if order == "F" else "C")
    return (array if axes is None else array.transpose(axes)).view(_Array)


def _bytes(text: str = "", encoding: str = "latin1") -> bytes:
    if encoding != "latin1":
        raise ValueError("encodes bytes in an unknown way")
    return text.encode("latin-1")


def _object(kind: type, base: Any, state: None) -> Any:
    if kind not in ALLOWED.values() or state is not None:
        raise ValueError("builds an object in an unknown way")
    return kind()


def _call(function: Callable[..., Any]) -> type:
    """Return a class whose instances are the values of a function."""
    return type("_Call", (_Inert,), {"__new__": lambda cls, *arguments: function(*arguments)})


# Modules of Python 2 and 3, of old and new NumPy and SciPy; names in them; what stands for these.
ALLOWED: dict[tuple[str, str], type] = {
    (module, name): kind
    for modules, names, kind in (
        ("numpy", "ndarray", _Array),
        ("numpy", "dtype", _Type),
        ("numpy.core.multiarray numpy._core.multiarray", "_reconstruct", _call(lambda *_: _Array())),
        ("numpy.core.multiarray numpy._core.multiarray", "scalar",
         _call(lambda kind, content: _array(content, kind, (), "C").item())),
        ("numpy.core.numeric numpy._core.numeric", "_frombuffer", _call(_from_buffer)),
        ("scipy.sparse.csc scipy.sparse._csc", "csc_matrix csc_array", _Columns),
        ("scipy.sparse.csr scipy.sparse._csr", "csr_matrix csr_array", _Inert),
        ("scipy.sparse.coo scipy.sparse._coo", "coo_matrix coo_array", _Inert),
        ("chumpy.ch", "Ch", _Chumpy),
        ("copy_reg copyreg", "_reconstructor", _call(_object)),
        ("_codecs", "encode", _call(_bytes)),
        ("__builtin__", "bytes", _call(_bytes)),
        ("collections", "OrderedDict defaultdict",
         _call(lambda *given: dict(*given) if given and isinstance(given[0], list) else {})),
        ("__builtin__ builtins", "object set list dict int float", _Inert),
    )
    for module in modules.split()
    for name in names.split()
}  # fmt: skip
