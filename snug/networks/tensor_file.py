"""Tensors with a JSON header in one safetensors file, written whole or not at all."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from torch import Tensor

from reference_sim.files.atomic_files import replacing

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
        unfinished.write_bytes(_packed(plain, {**header, DIGEST: _digest(plain, header)}))
    return path


def read_tensors(path: Path) -> tuple[dict[str, Tensor], dict[str, Any]]:
    """Read tensors and header. Raises TensorFileError for a missing, broken, changed or foreign file."""
    from safetensors import SafetensorError, safe_open

    if not path.is_file():
        raise TensorFileError(f"{path}: no such model file")
    try:
        with safe_open(path, framework="pt") as stored:
            text = (stored.metadata() or {}).get(HEADER)
            tensors = {name: stored.get_tensor(name) for name in stored.keys()}  # noqa: SIM118
    except (SafetensorError, OSError, ValueError, RuntimeError, AttributeError, TypeError) as error:
        raise TensorFileError(f"{path}: not a safetensors file ({error})") from error
    if text is None:
        raise TensorFileError(f"{path}: no model of this project (its header has no '{HEADER}' entry)")
    try:
        header = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise TensorFileError(f"{path}: broken header ({error})") from error
    if not isinstance(header, dict):
        raise TensorFileError(f"{path}: broken header (no JSON object)")
    if header.pop(DIGEST, None) != _digest(tensors, header):
        raise TensorFileError(f"{path}: is not as it was written: copy it again, or train again")
    return tensors, header


def select_tensors(tensors: Mapping[str, Tensor], name: str) -> dict[str, Tensor]:
    """Return the tensors called `name.*`, by the rest of their names."""
    return {key.removeprefix(f"{name}."): t for key, t in tensors.items() if key.startswith(f"{name}.")}


def _packed(tensors: dict[str, Tensor], header: Mapping[str, Any]) -> bytes:
    from safetensors.torch import save

    return save(tensors, {HEADER: json.dumps(header)})


def _digest(tensors: dict[str, Tensor], header: Mapping[str, Any]) -> str:
    return hashlib.sha256(_packed(tensors, header)).hexdigest()
