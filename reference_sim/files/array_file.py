"""Arrays from files that anyone may have written, and the trial of a file that may crash its reader.

Size has a limit, and nothing that a file names is run. A pickle is a program: it names functions and calls
them. Here a name can only stand for plain values, arrays of numpy and what SMPL's files hold besides: arrays
of chumpy are taken as the array that they hold, compressed sparse columns of scipy as a dense array.

HDF5 and VTK follow what a file says: a tree of links that comes back to itself, or a wrong count, crashes
them or keeps them going for ever. So a file of somebody else is first read where that harms nobody.
"""

from __future__ import annotations

import math
import os
import pickle
import subprocess
import sys
import warnings
import zipfile
from collections.abc import Callable, Collection
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from typing import IO, Any

import numpy as np

LIMIT = 1 << 30  # [bytes] of all arrays that are read of a file together, unpacked
PLAIN_KINDS = "biufcSU"  # kinds of types: truths, numbers, text
MOST_PACKED = 1032  # bytes that deflate packs into one, at most
TRIAL_MEMORY, TRIAL_SECONDS = 2 << 30, 20  # [bytes] and [s] of CPU time, and for each byte of the file
MEMORY_OF_BYTE, SECONDS_OF_BYTE = 20, 2e-7
REFUSED = 3  # exit status of a trial that has said why


class ArrayFileError(ValueError):
    """File that is no .npy or .npz of plain arrays; the message names file and array."""


def read_array(path: str | Path) -> np.ndarray:
    """Read the array of an .npy file, as long as the file.

    Raises:
        ArrayFileError: as `read_arrays`.

    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_array(f"{folder}/x.npy", np.arange(3.0))
    ...     read_array(f"{folder}/x.npy")
    array([0., 1., 2.])
    """
    path = Path(path)
    try:
        with path.open("rb") as stream:
            return _array(stream)
    except Exception as error:
        raise refusal(path, "", error) from None


def read_arrays(
    path: str | Path, names: Collection[str] | None = None, *, limit: int = LIMIT
) -> dict[str, np.ndarray]:
    """Read the arrays of an .npz file by name.

    Args:
        path: the file.
        names: arrays to read, as far as they are in it; others are not touched. Default all.
        limit: [bytes] of all of them together, unpacked.

    Raises:
        ArrayFileError: no such file, no archive, encrypted, packed in an unknown way, damaged, an array that
            is not plain or not as long as it declares, two of one name, more than `limit` bytes together.

    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     np.savez(f"{folder}/x.npz", x=np.arange(3.0), y=np.zeros(2))
    ...     read_arrays(f"{folder}/x.npz", ["x"])
    {'x': array([0., 1., 2.])}
    """
    path, name = Path(path), ""
    arrays: dict[str, np.ndarray] = {}
    members: set[str] = set()
    try:
        with path.open("rb") as stream, zipfile.ZipFile(stream) as archive:
            for member in archive.infolist():
                name = member.filename.removesuffix(".npy")
                if names is not None and name not in names:
                    continue
                if name in members:
                    raise ValueError("is there twice")
                members.add(name)
                if name == member.filename:  # no array, though numpy calls it by the name of one
                    continue
                if member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
                    raise ValueError(f"is packed by method {member.compress_type}, only 0 and 8 are read")
                if member.file_size > limit:  # zipfile unpacks no more than that
                    size, left = member.file_size / 1e6, limit / 1e6
                    raise ValueError(
                        f"has {size:.0f} MB unpacked, too large: {left:.0f} MB more are read at most"
                    )
                limit -= member.file_size
                with archive.open(member) as array:
                    arrays[name] = _array(array)
        return arrays
    except Exception as error:
        raise refusal(path, name, error) from None


def write_array(path: str | Path, array: np.ndarray) -> None:
    """Write an .npy file.

    Raises:
        OSError: with its errno, which numpy.save hides where the disk is full.

    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_array(f"{folder}/x.npy", np.zeros(2))
    """
    array = np.asarray(array, order="C")  # ascontiguousarray would make a number an array of one
    with open(path, "wb") as stream:
        np.lib.format.write_array_header_1_0(stream, np.lib.format.header_data_from_array_1_0(array))
        stream.write(array.reshape(-1).data)


def _array(stream: IO[bytes]) -> np.ndarray:
    """Read the array that a stream holds and nothing else; raise whatever its bytes make numpy raise."""
    with warnings.catch_warnings():  # of headers that Python 2 wrote, and of odd bytes in them
        warnings.simplefilter("ignore")
        try:
            array = np.lib.format.read_array(stream, allow_pickle=False)
        except MemoryError:
            raise ValueError("declares more numbers than fit into memory") from None
    if array.dtype.kind not in PLAIN_KINDS or array.dtype.itemsize == 0:
        raise ValueError(f"has type {array.dtype}, only plain numbers and text are read")
    if stream.read(1):
        raise ValueError(f"is longer than its shape {array.shape} of {array.dtype}")
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


class _Unread(_Stand):
    """Stand for a sparse matrix in another layout, which no reader here asks for."""


STANDS = {"chumpy.ch.Ch": _Stand, "csc_matrix": _Stand, "csc_array": _Stand}
STANDS |= {f"{layout}_{kind}": _Unread for layout in ("csr", "coo") for kind in ("matrix", "array")}


class _Unpickler(pickle.Unpickler):
    def find_class(self, module: str, name: str) -> Any:
        """Return what a name stands for. Raises ValueError for any other."""
        module = MOVED.get(module, module).replace("numpy.core", "numpy._core")
        if name in PLAIN.get(module, ()):
            return super().find_class(module, name)
        stand = STANDS.get(name if module.startswith("scipy.sparse.") else f"{module}.{name}")
        if stand is None:
            raise ValueError(f"names {module}.{name}, which is no plain value; write arrays by numpy.savez")
        return stand


def read_pickled_arrays(path: str | Path, names: Collection[str]) -> dict[str, np.ndarray]:
    """Read the arrays, numbers and lists of a pickled dict by name, without running anything that it names.

    Args:
        path: the file. Text of Python 2 in it is taken as latin-1.
        names: entries to return, as far as they are in it.

    Raises:
        ArrayFileError: no such file, no pickle of a dict, larger than 1 GiB, or more in it than plain values.
    """
    path, name = Path(path), ""
    arrays = {}
    try:
        if path.stat().st_size > LIMIT:
            raise ValueError(f"larger than {LIMIT >> 20} MiB")
        with path.open("rb") as stream:
            held = _Unpickler(stream, encoding="latin1").load()
        if type(held) is not dict:
            raise ValueError("holds no dict of arrays")
        for name in names:
            value = held.get(name)
            if type(value) is _Stand:
                value = value.array()
            if isinstance(value, np.ndarray | np.generic | int | float | list | tuple):
                arrays[name] = np.asarray(value)
                if arrays[name].dtype.kind not in PLAIN_KINDS:
                    raise ValueError(f"has type {arrays[name].dtype}, only plain numbers and text are read")
        name = ""
        if not arrays:
            raise ValueError(f"none of its entries is known ({', '.join(map(str, list(held)[:12]))})")
        return arrays
    # A broken pickle can fail in nearly every way, and none of them is this program's own.
    except Exception as error:
        raise refusal(path, name, error) from None


def try_out(read: Callable[[Path], object], *paths: Path) -> str:
    """Return why a function cannot read one of the files, in one line; empty where it can read all.

    A process of its own reads them, under a cap of memory and CPU time.

    Args:
        read: a function of a module, which the process imports by its name.
        paths: files that exist.
    """
    size = sum(path.stat().st_size for path in paths)
    memory = TRIAL_MEMORY + MEMORY_OF_BYTE * size
    seconds = math.ceil(TRIAL_SECONDS + SECONDS_OF_BYTE * size)
    caps, names = (str(memory), str(seconds)), (str(path.absolute()) for path in paths)
    # Each thread of a linear algebra library takes addresses for itself: on many cores more than the cap.
    alone = {name: "1" for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")}
    done = subprocess.run(
        [sys.executable, "-c", f"import sys, {__name__} as a; sys.exit(a.try_here(*sys.argv[1:]))",
         read.__module__, read.__name__, *caps, *names],
        env=os.environ | alone, stdin=subprocess.DEVNULL, capture_output=True,
    )  # fmt: skip
    if done.returncode == REFUSED:
        return " ".join(done.stdout.decode(errors="replace").split())[:300]
    if done.returncode == 0:
        return ""
    return f"reading it crashes the reader, or takes more than {memory / 1e9:.0f} GB or {seconds} s"


def try_here(module: str, name: str, memory: str, seconds: str, *paths: str) -> int:
    """Read the files by that function under caps of memory [bytes] and CPU time [s]; return a status."""
    read = getattr(import_module(module), name)
    with suppress(ImportError):  # Windows has no such caps
        import resource

        for what, most in ((resource.RLIMIT_AS, int(memory)), (resource.RLIMIT_CPU, int(seconds))):
            _, hard = resource.getrlimit(what)
            most = most if hard == resource.RLIM_INFINITY else min(most, hard)
            resource.setrlimit(what, (most, hard))
    try:
        for path in paths:
            read(Path(path))
    except Exception as error:  # whatever it is, the file is to blame
        print(error or type(error).__name__)
        return REFUSED
    return 0
