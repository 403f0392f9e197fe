"""Tensors with a JSON header in one safetensors file, written whole or not at all."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from reference_sim.files.atomic_files import replacing

if TYPE_CHECKING:  # a header is read without torch
    from torch import Tensor

HEADER = "snug"  # name of our entry in the file's header
DIGEST = "digest"  # entry of the header: of everything else in the file


class TensorFileError(ValueError):
    """A file that cannot be read as one of ours; the message names it and what is wrong."""


def write_tensors(path: Path, tensors: Mapping[str, Tensor], header: Mapping[str, Any]) -> Path:
    """Write the file beside its place and move it there; return its path.

    A reader, or a kill at any moment, finds a whole file.
    """
    plain = {name: tensor.detach().cpu().contiguous() for name, tensor in tensors.items()}
    with replacing(path) as unfinished:
        # By Python: what the library raises on a full disk does not say that it was that.
        unfinished.write_bytes(_pack(plain, {**header, DIGEST: _digest(plain, header)}))
    return path


def read_tensors(path: Path) -> tuple[dict[str, Tensor], dict[str, Any]]:
    """Read tensors and header. Raises TensorFileError for a missing, broken, changed or foreign file."""
    tensors, text = _read(path)
    header = _parse(path, text)
    if header.pop(DIGEST, None) != _digest(tensors, header):
        raise TensorFileError(f"{path}: is not as it was written: copy it again, or train again")
    return tensors, header


def read_header(path: Path) -> dict[str, Any]:
    """Read the header alone, without torch and unchecked against its digest. Raises TensorFileError."""
    return _parse(path, _read(path, tensors=False)[1])


def _read(path: Path, *, tensors: bool = True) -> tuple[dict[str, Tensor], str | None]:
    from safetensors import SafetensorError, safe_open

    if not path.is_file():
        raise TensorFileError(f"{path}: no such model file")
    try:
        with safe_open(path, framework="pt" if tensors else "numpy") as stored:
            text = (stored.metadata() or {}).get(HEADER)
            names = stored.keys() if tensors else ()
            return {name: stored.get_tensor(name) for name in names}, text
    except (SafetensorError, OSError, ValueError, RuntimeError, AttributeError, TypeError) as error:
        raise TensorFileError(f"{path}: not a safetensors file ({error})") from error


def _parse(path: Path, text: str | None) -> dict[str, Any]:
    if text is None:
        raise TensorFileError(f"{path}: no model of this project (its header has no '{HEADER}' entry)")
    try:
        return dict(json.loads(text))
    except (ValueError, TypeError, RecursionError) as error:
        raise TensorFileError(f"{path}: broken header ({error})") from error


def select_tensors(tensors: Mapping[str, Tensor], name: str) -> dict[str, Tensor]:
    """Return the tensors called `name.*`, by the rest of their names."""
    return {key.removeprefix(f"{name}."): t for key, t in tensors.items() if key.startswith(f"{name}.")}


def _pack(tensors: dict[str, Tensor], header: Mapping[str, Any]) -> bytes:
    from safetensors.torch import save

    return save(tensors, {HEADER: json.dumps(header)})


def _digest(tensors: dict[str, Tensor], header: Mapping[str, Any]) -> str:
    return hashlib.sha256(_pack(tensors, header)).hexdigest()
