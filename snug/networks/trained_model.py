"""A network with everything needed to use it again: its recipe, its inputs, its training history, one
file.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn

from snug.networks.motion_perceptron import MotionPerceptron
from snug.networks.pbns import PoseSpaceDeformation
from snug.networks.regressor import Regressor, parameter_megabytes
from snug.networks.santesteban2019 import FitAndWrinkles
from snug.networks.tailornet import BandTargets, FrequencyMixture
from snug.networks.tensor_file import TensorFileError, read_tensors, write_tensors
from snug.recipes.recipe import Recipe
from snug.training.vertex_targets import VertexTargets

FORMAT = "snug-model-8"
_TYPES: dict[str, Any] = {
    "kind": str, "recipe": dict, "inputs": int, "vertices": int, "pins": list, "seed": int, "steps": int,
    "seconds": int | float, "setup_seconds": int | float, "history": list, "summary": dict,
}  # fmt: skip
KEPT = ("seed", "steps", "seconds", "setup_seconds", "history", "summary")  # in the file as in the model


@dataclass(frozen=True)
class Kind:
    """A sort of model: its network, the inputs it reads, whether it sees sequences, and what teaches it.

    targets: what simulated vertices become for it; None where the energies teach it. past: whether inertia is
    that of a simulation's previous frames, see snug.training.simulated_past. closed_form: whether it trains faster by
    snug.kernels.gru.
    """

    network: type[nn.Module]
    features: str
    sequences: bool
    targets: type[VertexTargets] | None = None
    past: bool = False
    closed_form: bool = False

    @property
    def physics(self) -> bool:
        return self.targets is None

    @property
    def unit(self) -> str:
        """Of its loss: a frame's energy, or how far vertices are from the simulated ones."""
        return self.targets.unit if self.targets else "J"


KINDS = {
    "snug": Kind(Regressor, "motion", sequences=True, closed_form=True),
    "dynamic": Kind(MotionPerceptron, "history", sequences=False, past=True, closed_form=True),
    "supervised": Kind(Regressor, "motion", sequences=True, targets=VertexTargets, closed_form=True),
    "pbns": Kind(PoseSpaceDeformation, "pose", sequences=False),
    "santesteban2019": Kind(
        FitAndWrinkles, "pose_shape", sequences=True, targets=VertexTargets, closed_form=True
    ),
    "tailornet": Kind(FrequencyMixture, "pose_shape", sequences=False, targets=BandTargets),
}


class ModelFileError(TensorFileError):
    """A file that is no model of this project; the message names the file and what is wrong."""


@dataclass
class TrainedModel:
    """A network and how it came to be.

    history: one dict for every few steps: step, seconds, loss and each term [unit of the kind, mean over
        frames], and as `seconds/<part>` what the parts of a step took on the mean (snug.training.stopwatch).
    summary: windows above the spike limit, updates left out, returns to good weights, with names.
    seconds: wall time of the steps, contact search included, and of a pretraining before them;
        setup_seconds: of making ready the motions and the first anchors.
    precision: of its matrices in roll-outs, one of snug.networks.one_frame.PRECISIONS; its file does not say it.
    """

    kind: str
    network: Any
    recipe: Recipe
    seed: int = 0
    steps: int = 0
    seconds: float = 0.0
    setup_seconds: float = 0.0
    history: list[dict[str, float]] = field(default_factory=list)
    summary: dict[str, Any] = field(default_factory=dict)
    precision: str = "float32"

    @property
    def megabytes(self) -> float:
        """Memory of the network at run time [MB]."""
        return parameter_megabytes(self.network)

    @property
    def vertices(self) -> int:
        return int(self.network.vertices)

    def rounded(self, precision: str) -> TrainedModel:
        """The same with matrices of that precision: their values are rounded here. Raises ValueError."""
        from snug.networks.one_frame import rounded

        return replace(self, network=rounded(self.network, precision), precision=precision)

    def save(self, path: str | Path) -> Path:
        """Write weights and metadata to one safetensors file, whole or not at all."""
        metadata = {
            "format": FORMAT,
            "kind": self.kind,
            "unit": find_kind(self.kind).unit,
            "recipe": self.recipe.as_dict(),
            "inputs": int(self.network.input_mean.shape[0]),
            "vertices": self.vertices,
            "pins": [int(pin) for pin in self.network.pins],
            "seed": self.seed,
            "steps": self.steps,
            "seconds": self.seconds,
            "setup_seconds": self.setup_seconds,
            "history": self.history,
            "summary": self.summary,
        }
        return write_tensors(Path(path), self.network.state_dict(), metadata)

    @classmethod
    def load(cls, path: str | Path) -> TrainedModel:
        """Read a model. Raises ModelFileError for a missing, broken or foreign file."""
        path = Path(path)
        try:
            tensors, data = read_tensors(path)
        except TensorFileError as error:
            raise ModelFileError(str(error)) from error
        try:
            if data["format"] != FORMAT:
                known = f"this version reads {FORMAT!r}: train again"
                raise ModelFileError(f"{path}: format {str(data['format'])[:40]!r}, {known}")
            _check(tensors, data)
            recipe = Recipe.from_dict(data["recipe"])
            network = make_network(
                data["kind"], data["inputs"], data["vertices"], recipe, seed=data["seed"], pins=data["pins"]
            )
            network.load_state_dict(tensors)
            rest = {name: data[name] for name in KEPT}
        except ModelFileError:
            raise
        except (KeyError, ValueError, RuntimeError, TypeError) as error:
            raise ModelFileError(
                f"{path}: broken model file ({' '.join(str(error).split())[:200]})"
            ) from error
        return cls(data["kind"], network.eval(), recipe, **rest)


def _check(tensors: Mapping[str, Tensor], data: Mapping[str, Any]) -> None:
    """Raises ValueError for entries of wrong types, and for sizes that no tensor in the file has."""
    for name, kind in _TYPES.items():
        if not isinstance(data[name], kind) or isinstance(data[name], bool):
            raise ValueError(f"{name} is {str(data[name])[:40]!r}")
    sizes = {size for tensor in tensors.values() for size in tensor.shape}
    for name, size in (("inputs", data["inputs"]), ("vertices", 3 * data["vertices"])):
        if size <= 0 or size not in sizes:
            raise ValueError(f"no tensor in it has the size of {name}, {data[name]}")
    if not all(type(pin) is int and 0 <= pin < data["vertices"] for pin in data["pins"]):
        raise ValueError(f"pins name no vertices 0..{data['vertices'] - 1}")
    if not 0 <= data["seed"] < 1 << 63:
        raise ValueError(f"seed {data['seed']}")
    for row in data["history"]:
        if not isinstance(row, dict) or not all(isinstance(v, int | float) for v in row.values()):
            raise ValueError("its history is no list of rows of numbers")


def find_kind(name: str) -> Kind:
    """Raises ValueError naming the known kinds."""
    if name not in KINDS:
        raise ValueError(f"unknown model {name!r}: use one of {', '.join(KINDS)}")
    return KINDS[name]


def make_network(
    kind: str, inputs: int, vertices: int, recipe: Recipe, *, seed: int, pins: Iterable[int] = ()
) -> Any:
    """A network at its start. The same seed gives the same weights, whatever was drawn before.

    pins: vertices without offset, which the body carries.
    """
    how = find_kind(kind)
    options: dict[str, Any] = {"output_scale": recipe.output_scale, "zero_last_layer": recipe.zero_last_layer}
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        network: Any = how.network(inputs, vertices, **options)
    network.pins = tuple(pins)
    if network.pins:
        free = torch.ones(vertices, 1)
        free[list(network.pins)] = 0.0

        def hold(_network: Any, _features: Any, output: tuple[Tensor, Any]) -> tuple[Tensor, Any]:
            return output[0] * free.to(output[0].device), output[1]

        network.register_forward_hook(hold)
    return network
