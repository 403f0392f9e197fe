"""Trained models: a network with its recipe, inputs and training history, in one file."""

from __future__ import annotations

import hashlib
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from snug.networks.garment_network import GarmentNetwork, make_network
from snug.networks.tensor_file import TensorFileError, read_tensors, write_tensors
from snug.recipe import Recipe
from snug.trained import list_networks

MODEL_FORMAT = "snug-model-10"
_COPIED = (
    "unit", "seed", "steps", "seconds", "setup_seconds", "history", "summary", "fps", "triangles", "origin",
)  # fmt: skip


@dataclass
class TrainedModel:
    """A network and its training.

    Attributes:
        kind: one of snug.kinds.KINDS.
        network: maps features (N, T, D) to offsets (N, T, V, 3) [m].
        recipe: options of network and training.
        seed: of everything random.
        steps: number of updates.
        seconds: wall time of the steps, contact search included [s].
        setup_seconds: wall time of preprocessing: motions and first contact anchors [s].
        history: one dict for every few steps: step, seconds, loss and each term [mean over frames:
            distances in `unit`, energies in J, before Recipe.physics_weight].
        summary: numbers and names of high windows, of updates left out, of returns to good weights.
        unit: of the loss: joules, or a distance from the simulated vertices.
        fps: frame rate of the training motions [1/s]; 0 where it is not known.
        triangles: digest of the garment's triangles, see digest_triangles; empty where it is not
            known.
        origin: what is known of its training: data, commit, versions, processor, and digests of all that
            it depends on, see benchmarks.runner.networks; empty where nobody noted it.

    Example:
        >>> from snug.recipe import DEFAULT
        >>> model = TrainedModel("pbns", make_network("pbns", 141, 4, DEFAULT, seed=0), DEFAULT)
        >>> import tempfile
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     TrainedModel.load(model.save(f"{folder}/pbns.safetensors")).vertices
        4
    """

    kind: str
    network: GarmentNetwork
    recipe: Recipe
    seed: int = 0
    steps: int = 0
    seconds: float = 0.0
    setup_seconds: float = 0.0
    history: list[dict[str, float]] = field(default_factory=list)
    summary: dict[str, Any] = field(default_factory=dict)
    unit: str = "J"
    fps: float = 0.0
    triangles: str = ""
    origin: dict[str, Any] = field(default_factory=dict)

    @property
    def vertices(self) -> int:
        """Number of vertices of the garment."""
        return int(self.network.vertices)

    def save(self, path: str | Path) -> Path:
        """Write weights and metadata to one safetensors file, whole or not at all; return its path."""
        metadata = {
            "format": MODEL_FORMAT,
            "kind": self.kind,
            "recipe": asdict(self.recipe),
            "inputs": self.network.input_mean.shape[0],
            "vertices": self.vertices,
            "pins": [int(pin) for pin in self.network.pins],
            **{name: getattr(self, name) for name in _COPIED},
        }
        return write_tensors(Path(path), self.network.state_dict(), metadata)

    @classmethod
    def load(cls, path: str | Path) -> TrainedModel:
        """Read a model.

        Args:
            path: of its file, or the name of a network of the package (snug.trained), as `snug-tshirt`.

        Raises:
            TensorFileError: for an unknown name, and a missing, broken or foreign file, or another format.

        >>> TrainedModel.load("tshirt-snug")
        Traceback (most recent call last):
        ...
        snug.networks.tensor_file.TensorFileError: tshirt-snug: neither a model file nor a network of the \
package: pbns-tshirt, ...
        """
        path = _find_file(path)
        tensors, data = read_tensors(path)
        try:
            if data["format"] != MODEL_FORMAT:
                remedy = f"this version reads {MODEL_FORMAT!r}: train again"
                raise TensorFileError(f"{path}: format {str(data['format'])[:40]!r}, {remedy}")
            recipe = Recipe.from_dict(data["recipe"])
            network = make_network(
                data["kind"],
                data["inputs"],
                data["vertices"],
                recipe,
                seed=data["seed"],
                pins=data["pins"],
            )
            if network.state_dict().keys() != tensors.keys():
                raise TensorFileError(
                    f"{path}: not the weights of this version's {data['kind']}: train again"
                )
            network.load_state_dict(tensors)
            copied = {name: data[name] for name in _COPIED}
        except TensorFileError:
            raise
        except (LookupError, ValueError, RuntimeError, TypeError, AttributeError) as error:
            raise TensorFileError(
                f"{path}: broken model file ({' '.join(str(error).split())[:200]})"
            ) from error
        return cls(data["kind"], network.eval(), recipe, **copied)


def digest_triangles(faces: np.ndarray) -> str:
    """Return a digest of triangles (F, 3), which name vertices in their order: a network gives one for each.

    >>> digest_triangles(np.array([[0, 1, 2]])) == digest_triangles(np.array([[1, 0, 2]]))
    False
    """
    return hashlib.sha256(np.ascontiguousarray(faces, dtype="<i8").tobytes()).hexdigest()[:16]


def _find_file(path: str | Path) -> Path:
    """Return the file of a model, by its path or by its name in the package. Raises TensorFileError."""
    networks = list_networks()
    if isinstance(path, str) and path in networks:
        return networks[path]
    if isinstance(path, str) and not Path(path).suffix and not Path(path).exists():
        names = ", ".join(networks)
        raise TensorFileError(f"{path}: neither a model file nor a network of the package: {names}")
    return Path(path)
