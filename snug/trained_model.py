"""A network with everything needed to use it again: its recipe, its inputs, its training history, one
file.
"""

from __future__ import annotations

import json
import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import torch
from torch import nn

from snug.baselines.pbns import PoseSpaceDeformation
from snug.baselines.santesteban2019 import FitAndWrinkles
from snug.baselines.supervised import VertexTargets
from snug.baselines.tailornet import BandTargets, FrequencyMixture
from snug.recipe import Recipe, RecipeError
from snug.regressor import Regressor, parameter_megabytes

FORMAT = "snug-model-1"


@dataclass(frozen=True)
class Kind:
    """A sort of model: its network, the inputs it reads, whether it sees sequences, and what teaches it.

    targets: what simulated vertices become for it; None where the energies teach it.
    """

    network: type[nn.Module]
    features: str
    sequences: bool
    targets: type[VertexTargets] | None = None

    @property
    def physics(self) -> bool:
        return self.targets is None


KINDS = {
    "snug": Kind(Regressor, "motion", sequences=True),
    "supervised": Kind(Regressor, "motion", sequences=True, targets=VertexTargets),
    "pbns": Kind(PoseSpaceDeformation, "pose", sequences=False),
    "santesteban2019": Kind(FitAndWrinkles, "pose_shape", sequences=True, targets=VertexTargets),
    "tailornet": Kind(FrequencyMixture, "pose_shape", sequences=False, targets=BandTargets),
}


class ModelFileError(ValueError):
    """A file that is no model of this project; the message names the file and what is wrong."""


@dataclass
class TrainedModel:
    """A network and how it came to be.

    history: one dict for every few steps: step, seconds, loss and each energy [J per frame].
    summary: steps, windows above the spike limit and updates left out, with the windows' names.
    seconds: wall time of training, contact search included.
    """

    kind: str
    network: Any
    recipe: Recipe
    seed: int = 0
    steps: int = 0
    seconds: float = 0.0
    history: list[dict[str, float]] = field(default_factory=list)
    summary: dict[str, Any] = field(default_factory=dict)

    @property
    def megabytes(self) -> float:
        """Memory of the network at run time [MB]."""
        return parameter_megabytes(self.network)

    @property
    def vertices(self) -> int:
        return int(self.network.vertices)

    def save(self, path: str | Path) -> Path:
        """Write weights and metadata to one safetensors file, whole or not at all."""
        from safetensors.torch import save

        path = Path(path)
        metadata = {
            "format": FORMAT,
            "kind": self.kind,
            "recipe": self.recipe.as_dict(),
            "inputs": int(self.network.input_mean.shape[0]),
            "vertices": self.vertices,
            "seed": self.seed,
            "steps": self.steps,
            "seconds": self.seconds,
            "history": self.history,
            "summary": self.summary,
        }
        path.parent.mkdir(parents=True, exist_ok=True)
        unfinished = path.with_name(f".{path.name}.{os.getpid()}.part")
        try:
            tensors = {name: tensor.contiguous() for name, tensor in self.network.state_dict().items()}
            unfinished.write_bytes(save(tensors, metadata={"snug": json.dumps(metadata)}))
            os.replace(unfinished, path)
        finally:
            unfinished.unlink(missing_ok=True)
        return path

    @classmethod
    def load(cls, path: str | Path) -> TrainedModel:
        """Read a model. Raises ModelFileError for a missing, broken or foreign file."""
        from safetensors import SafetensorError, safe_open

        path = Path(path)
        if not path.is_file():
            raise ModelFileError(f"{path}: no such model file")
        try:
            with safe_open(path, framework="pt") as stored:
                header = (stored.metadata() or {}).get("snug")
                tensors = {name: stored.get_tensor(name) for name in stored.keys()}  # noqa: SIM118
        except (SafetensorError, OSError) as error:
            raise ModelFileError(f"{path}: not a safetensors file ({error})") from error
        if header is None:
            raise ModelFileError(f"{path}: no model of this project (its header has no 'snug' entry)")
        try:
            data = json.loads(header)
            if data["format"] != FORMAT:
                raise ModelFileError(f"{path}: format {data['format']!r}, this version reads {FORMAT!r}")
            recipe = Recipe.from_dict(data["recipe"])
            network = make_network(data["kind"], data["inputs"], data["vertices"], recipe, seed=data["seed"])
            network.load_state_dict(tensors)
            rest = {name: data[name] for name in ("seed", "steps", "seconds", "history", "summary")}
        except (KeyError, RecipeError, RuntimeError, json.JSONDecodeError) as error:
            raise ModelFileError(f"{path}: broken model file ({error})") from error
        return cls(data["kind"], network.eval(), recipe, **rest)


def find_kind(name: str) -> Kind:
    """Raises ValueError naming the known kinds."""
    if name not in KINDS:
        raise ValueError(f"unknown model {name!r}: use one of {', '.join(KINDS)}")
    return KINDS[name]


def make_network(kind: str, inputs: int, vertices: int, recipe: Recipe, *, seed: int) -> Any:
    """A network at its start. The same seed gives the same weights, whatever was drawn before."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        return find_kind(kind).network(
            inputs, vertices, output_scale=recipe.output_scale, zero_last_layer=recipe.zero_last_layer
        )
