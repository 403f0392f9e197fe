"""Arrays from files that anyone may have written; nothing that such a file names is run.

A pickle is a program: it names functions and calls them. Here a name can only stand for plain values,
arrays of numpy and what SMPL's files hold besides: arrays of chumpy are taken as the array that they
hold, compressed sparse columns of scipy as a dense array.
"""

from __future__ import annotations

import pickle
from collections.abc import Collection
from pathlib import Path
from pickletools import genops
from typing import Any

import numpy as np

from reference_sim.given_files import demand_file

PLAIN_KINDS = "biufcSU"  # kinds of types: truths, numbers, text


class ArrayFileError(ValueError):
    """File that holds no plain arrays; the message names file and array."""


def read_arrays(path: str | Path, names: Collection[str] | None = None) -> dict[str, np.ndarray]:
    """Read those of the named arrays that an .npz file holds, by default all; others are not touched.

    Raises ArrayFileError: no such file, no archive, damaged, or an array that is not plain.
    """
    path, name = Path(path), ""
    arrays = {}
    try:
        with demand_file(path).open("rb") as stream, np.lib.npyio.NpzFile(stream) as archive:
            for name in archive.files:
                if names is None or name in names:
                    arrays[name] = _plain(archive[name])
        return arrays
    except Exception as error:
        raise refusal(path, name, error) from None


def write_array(path: str | Path, array: np.ndarray) -> None:
    """Write an .npy file. Raises OSError with the errno that numpy.save hides where the disk is full."""
    array = np.asarray(array, order="C")  # ascontiguousarray would make a number an array of one
    with open(path, "wb") as stream:
        np.lib.format.write_array_header_1_0(stream, np.lib.format.header_data_from_array_1_0(array))
        stream.write(array.reshape(-1).data)


def _plain(array: Any) -> np.ndarray:
    """Return an array of plain numbers or text; raise ValueError for any other, as of bytes."""
    kind = getattr(array, "dtype", np.dtype(object))
    if kind.kind not in PLAIN_KINDS:
        raise ValueError(f"has type {kind}, only plain numbers and text are read")
    return array


def refusal(path: Path, name: str, error: Exception) -> ArrayFileError:
    """Return the one line that says why a file, or its array `name`, cannot be read."""
    if isinstance(error, FileNotFoundError):
        return ArrayFileError(f"{path}: no such file")
    reason = " ".join(str(error).split())[:200] or type(error).__name__
    return ArrayFileError(f"{path}: {f'array {name!r}: ' if name else ''}{reason}")


# What a pickle may name: of Python 2 and 3, of old and new NumPy, by module.
PLAIN = {
    "builtins": {"object", "set", "list", "dict", "int", "float", "bytes"},
    "copyreg": {"_reconstructor"},
    "_codecs": {"encode"},
    "collections": {"OrderedDict", "defaultdict"},
    "numpy": {"ndarray", "dtype"},
    "numpy._core.multiarray": {"_reconstruct", "scalar"},
    "numpy._core.numeric": {"_frombuffer"},
}
MOVED = {"__builtin__": "builtins", "copy_reg": "copyreg"}


class _Stand:
    """Stand for an object of chumpy or scipy: its attributes, and nothing of its class."""

    state: dict[str, Any]

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.state = state

    def array(self) -> np.ndarray:
        """Return the array of a chumpy object, or that of compressed sparse columns."""
        state = self.state
        if "x" in state:
            return np.asarray(state["x"])
        rows, columns = state["_shape" if "_shape" in state else "shape"]
        dense = np.zeros((rows, columns), order="F")
        at = state["indices"], np.repeat(np.arange(columns), np.diff(state["indptr"]))
        np.add.at(dense, at, state["data"])
        return dense


# Arrays of joblib follow the names of their wrappers as raw bytes, between the pickle's own.
JOBLIB = b"joblib.numpy_pickle"
COMPRESSED = (b"x\x01", b"x\x5e", b"x\x9c", b"x\xda", b"\x1f\x8b", b"BZh", b"\xfd7zXZ", b"\x04\x22M\x18")
STANDS = ("chumpy.ch.Ch", "csc_matrix", "csc_array")


class _Unpickler(pickle.Unpickler):
    def find_class(self, module: str, name: str) -> Any:
        """Return what a name stands for. Raises ValueError for any other."""
        module = MOVED.get(module, module).replace("numpy.core", "numpy._core")
        if name in PLAIN.get(module, ()):
            return super().find_class(module, name)
        if (name if module.startswith("scipy.sparse.") else f"{module}.{name}") in STANDS:
            return _Stand
        raise ValueError(f"names {module}.{name}, which is no plain value; write arrays by numpy.savez")


def read_pickled_arrays(path: str | Path, names: Collection[str]) -> dict[str, np.ndarray]:
    """Read those of the named arrays, numbers and lists that a pickled dict holds; nothing in it is run.

    Raises ArrayFileError: no such file, no pickle of a dict, or more in it than plain values.
    """
    path, name = Path(path), ""
    arrays = {}
    try:
        with demand_file(path).open("rb") as stream:
            if (start := stream.read(1 << 16)).startswith(COMPRESSED) or JOBLIB in start:
                fault = "was written by joblib" if JOBLIB in start else "is compressed"
                raise ValueError(f"{fault}: load it by joblib.load and write its arrays by numpy.savez")
            stream.seek(0)
            # The unpickler makes a table as long as the largest place that an object is put in.
            size = path.stat().st_size
            if any((at or 0) > size for op, at, _ in genops(stream) if op.name.endswith("PUT")):
                raise ValueError("puts an object in a place beyond its end")
            stream.seek(0)
            data = _Unpickler(stream, encoding="latin1").load()  # of text of Python 2
        if type(data) is not dict:
            raise ValueError("holds no dict of arrays")
        for name in names:
            value = data.get(name)
            if type(value) is _Stand:
                value = value.array()
            if isinstance(value, np.ndarray | np.generic | int | float | list | tuple):
                arrays[name] = _plain(np.asarray(value))
        name = ""
        if not arrays:
            raise ValueError(f"none of its entries is known ({', '.join(map(str, list(data)[:12]))})")
        return arrays
    # A broken pickle can fail in nearly every way, and none of them is this program's own.
    except Exception as error:
        raise refusal(path, name, error) from None
