"""Arrays from .npy and .npz files that anyone may have written: nothing is unpickled, size has a limit."""

from __future__ import annotations

import warnings
import zipfile
from collections.abc import Collection
from pathlib import Path
from typing import IO

import numpy as np

LIMIT = 1 << 30  # [bytes] of all arrays that are read of a file together, unpacked
PLAIN_KINDS = "biufcSU"  # kinds of types: truths, numbers, text
MOST_PACKED = 1032  # bytes that deflate packs into one, at most


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


def array_names(path: str | Path) -> list[str]:
    """Return the names of the arrays of an .npz file.

    Raises:
        ArrayFileError: no archive.
    """
    path = Path(path)
    try:
        with path.open("rb") as stream, zipfile.ZipFile(stream) as archive:
            return [name.removesuffix(".npy") for name in archive.namelist() if name.endswith(".npy")]
    except Exception as error:
        raise refusal(path, "", error) from None


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
