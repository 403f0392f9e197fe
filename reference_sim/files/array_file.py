"""Arrays from .npy and .npz files that anyone may have written.

What a file declares, the size of a member and the shape of an array, is compared with the bytes that are
there, and with a limit, before anything of that size is allocated. Nothing is unpickled.
"""

from __future__ import annotations

import io
import math
import warnings
import zipfile
from collections.abc import Collection
from pathlib import Path
from typing import IO

import numpy as np

LIMIT = 1 << 30  # [bytes] of all arrays that are read of a file together, unpacked
PLAIN_KINDS = "biufcSU"  # kinds of types: truths, numbers, text
# Deflate packs at most so many bytes into one; plus the shortest block.
MOST_PACKED, SHORTEST_DEFLATE = 1032, 64
READ_SIZE = 1 << 20


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
            length = path.stat().st_size
            return _array(stream, length, length)
    except Exception as error:
        raise _refusal(path, "", error) from None


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
            for info in archive.infolist():
                name = info.filename.removesuffix(".npy")
                if names is not None and name not in names:
                    continue
                if name in members:
                    raise ValueError("is there twice")
                members.add(name)
                if name == info.filename:  # no array, though numpy calls it by the name of one
                    continue
                _check_member(info)
                with archive.open(info) as member:
                    arrays[name] = _array(member, info.file_size, limit)
                limit -= arrays[name].nbytes
        return arrays
    except Exception as error:
        raise _refusal(path, name, error) from None


def write_array(path: str | Path, array: np.ndarray) -> None:
    """Write an .npy file.

    Raises:
        OSError: with its errno, which numpy.save hides where the disk is full.

    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_array(f"{folder}/x.npy", np.zeros(2))
    """
    array = np.ascontiguousarray(array)
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
        raise _refusal(path, "", error) from None


def _check_member(info: zipfile.ZipInfo) -> None:
    if info.flag_bits & 1:
        raise ValueError("is encrypted")
    if info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        raise ValueError(f"is packed by method {info.compress_type}, only 0 and 8 (deflate) are read")
    if info.file_size > MOST_PACKED * info.compress_size + SHORTEST_DEFLATE:
        raise ValueError(f"declares {info.file_size} bytes packed into {info.compress_size}")


def _array(stream: IO[bytes], length: int, limit: int) -> np.ndarray:
    """Read the array of a stream of `length` bytes; raise whatever its bytes make numpy or zipfile raise."""
    version = np.lib.format.read_magic(stream)
    readers = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}
    if version not in readers:
        raise ValueError(f"is of version {version} of the format, only 1.0 and 2.0 are read")
    # Of a damaged length of the header no more is read than numpy believes.
    head = io.BytesIO(stream.read(min(length, 1 << 14)))
    with warnings.catch_warnings():  # of headers that Python 2 wrote, and of odd bytes in them
        warnings.simplefilter("ignore")
        shape, by_columns, dtype = readers[version](head)
    if dtype.kind not in PLAIN_KINDS or dtype.subdtype is not None or dtype.itemsize == 0:
        raise ValueError(f"has type {dtype}, only plain numbers and text are read")
    count = math.prod(shape)
    size = count * dtype.itemsize
    if min(shape, default=0) < 0 or size > limit:
        raise ValueError(
            f"declares shape {_short(shape)} of {dtype}, and {limit / 1e6:.0f} MB are read at most"
        )
    stored = length - np.lib.format.MAGIC_LEN - head.tell()
    if size != stored:
        raise ValueError(f"declares shape {_short(shape)} of {dtype}, {size} bytes, and has {stored}")
    data = bytearray(size)
    view, done = memoryview(data), 0
    while block := head.read(READ_SIZE) or stream.read(READ_SIZE):
        view[done : done + len(block)] = block  # one that is too long is a ValueError
        done += len(block)
    if done != size:
        raise ValueError(f"ends after {done} of {size} bytes")
    flat = np.frombuffer(data, dtype, count) if size else np.empty(count, dtype)
    return flat.reshape(shape[::-1]).T if by_columns else flat.reshape(shape)


def _short(shape: tuple[int, ...]) -> str:
    text = " x ".join(f"{n:.3g}" if n > 1e9 else str(n) for n in shape[:8])
    return text + (" x ..." if len(shape) > 8 else "")


def _refusal(path: Path, name: str, error: Exception) -> ArrayFileError:
    if isinstance(error, FileNotFoundError):
        return ArrayFileError(f"{path}: no such file")
    reason = " ".join(str(error).split())[:200] or type(error).__name__
    return ArrayFileError(f"{path}: {f'array {name!r}: ' if name else ''}{reason}")
