"""One recipe trained for a given time and judged on motions that it has not met; see benchmarks.workers."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

from snug.recipe import Recipe

from .results import Row, row_to_cells
from .wardrobe import Wardrobe

if TYPE_CHECKING:
    from snug.dressed_body import DressedBody
    from snug.trained_model import TrainedModel

    from .presets import Preset
    from .workers import Tell

HELD_OUT = ("brisk_walk", "torso_twist", "lunge")  # of the training motions
TRIAL_STEPS, TRIAL_PART = 30, 10  # steps of the trial that tells how many fit into the time, and of a log row
SUITE = "recipes"


@dataclass(frozen=True)
class Tried:
    """The rows of one training, as the cells of results.csv. files: it leaves none."""

    rows: tuple[dict[str, str], ...]
    files: tuple[str, ...] = ()


def learned(motions: Iterable[str]) -> list[str]:
    """Those that are trained on."""
    return [name for name in motions if name not in HELD_OUT]


def tried(wardrobe: Wardrobe, tell: Tell, preset: Preset, recipe: Recipe, seed: int, seconds: float) -> Tried:
    """Train for about that time, roll out, measure. A training that diverges is a row with its reason."""
    import torch

    from snug.dressed_body import DressedBody
    from snug.motion_library import TRAIN
    from snug.train import train
    from snug.training_set import TrainingError

    torch.set_num_threads(1)
    dressed = DressedBody(wardrobe.body, wardrobe.garment)
    motions = wardrobe.named(learned(TRAIN))

    def trained(steps: int) -> TrainedModel:
        return train(
            "snug", dressed, motions, steps=steps, seed=seed, recipe=recipe, progress=False, every=TRIAL_PART
        )

    def row(scene: str, metric: str, unit: str, value: float) -> Row:
        if math.isfinite(value):
            return Row(SUITE, scene, recipe.name, seed, metric, unit, value, dtype="float32")
        return Row(SUITE, scene, recipe.name, seed, metric, unit, None, "diverged", "not finite")

    try:
        model = trained(steps_within(seconds, trained))
    except TrainingError as error:
        reason = " ".join(str(error).split())
        rows = [Row(SUITE, "training", recipe.name, seed, "train/loss", "J", None, "diverged", reason)]
    else:
        rows = [row(*found) for found in _judge(wardrobe, preset)(model, dressed)]
        rows.append(row("training", "train/loss", "J", model.history[-1]["loss"]))
        rows.append(row("training", "train/steps", "1", float(model.steps)))
        rows.append(row("training", "cost/train", "s", model.seconds))
        rows.append(row("training", "cost/setup", "s", model.setup_seconds))
    tell(1)
    return Tried(tuple(row_to_cells(row) for row in rows))


def steps_within(seconds: float, trained: Callable[[int], TrainedModel]) -> int:
    """Steps that take about that time, by a short trial; its first part, with all warm-up, does not count."""
    history = trained(TRIAL_STEPS).history
    step = (history[-1]["seconds"] - history[0]["seconds"]) / (history[-1]["step"] - history[0]["step"])
    return max(TRIAL_PART, round(seconds / step))


class Judge:
    """The held-out scenes, built once; called with a model it gives (scene, metric, unit, value)."""

    def __init__(self, wardrobe: Wardrobe, preset: Preset) -> None:
        from .scenes import dressed_scene

        self.scenes = [dressed_scene(name).build(preset, wardrobe) for name in HELD_OUT]

    def __call__(self, model: TrainedModel, dressed: DressedBody) -> Iterator[tuple[str, str, str, float]]:
        from snug.rollout import roll_out

        from .metrics.energy import energy_series, mean_energy
        from .metrics.geometry import penetration

        for scene in self.scenes:
            assert scene.dressed is not None and scene.obstacle is not None
            positions = roll_out(model, dressed, scene.dressed.motion).positions
            for term, series in energy_series(scene, [positions])[0].items():
                yield scene.name, f"energy/{term}", "J", mean_energy(series)
            below = 100.0 * float(penetration([positions], scene.obstacle)[0].share.mean())
            yield scene.name, "penetration/vertices", "%", below


_kept: dict[str, Judge] = {}  # of this worker


def _judge(wardrobe: Wardrobe, preset: Preset) -> Judge:
    """The one of this process: a shirt settles for each scene once."""
    if "judge" not in _kept:
        _kept["judge"] = Judge(wardrobe, preset)
    return _kept["judge"]
