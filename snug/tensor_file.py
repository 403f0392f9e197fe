"""Tensors with a JSON header in one safetensors file, written whole or not at all."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from torch import Tensor

from reference_sim.whole_file import replacing

HEADER = "snug"  # name of our entry in the file's header


class TensorFileError(ValueError):
    """A file that cannot be read as one of ours; the message names it and what is wrong."""


def write_tensors(path: Path, tensors: Mapping[str, Tensor], header: Mapping[str, Any]) -> Path:
    """Write beside the place and move there: a reader, or a kill at any moment, finds a whole file."""
    from safetensors.torch import save

    plain = {name: tensor.detach().cpu().contiguous() for name, tensor in tensors.items()}
    with replacing(path) as unfinished:
        # By Python: what the library raises on a full disk does not say that it was that.
        unfinished.write_bytes(save(plain, {HEADER: json.dumps(header)}))
    return path


def read_tensors(path: Path) -> tuple[dict[str, Tensor], dict[str, Any]]:
    """Tensors and header. Raises TensorFileError for a missing, broken or foreign file."""
    from safetensors import SafetensorError, safe_open

    if not path.is_file():
        raise TensorFileError(f"{path}: no such model file")
    try:
        with safe_open(path, framework="pt") as stored:
            header = (stored.metadata() or {}).get(HEADER)
            tensors = {name: stored.get_tensor(name) for name in stored.keys()}  # noqa: SIM118
    except (SafetensorError, OSError) as error:
        raise TensorFileError(f"{path}: not a safetensors file ({error})") from error
    if header is None:
        raise TensorFileError(f"{path}: no model of this project (its header has no '{HEADER}' entry)")
    try:
        return tensors, json.loads(header)
    except json.JSONDecodeError as error:
        raise TensorFileError(f"{path}: broken header ({error})") from error
