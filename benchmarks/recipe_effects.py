"""python -m benchmarks.recipe_effects: what each deviation of the default recipe from the paper's text does.

The default recipe is trained with one deviation undone at a time, the paper's with one added at a time, each
for the same wall time, one after another in one process. All are judged by roll-outs on training motions that
were held out; the test motions are never looked at. Writes results.csv and run.json, of which
`python -m reports.build` makes the table.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from pathlib import Path
from typing import TYPE_CHECKING

from snug.recipe import DEFAULT, PAPER, Recipe

from .results import Row, RunFolder, with_provenance

if TYPE_CHECKING:
    from snug.dresser import DressedBody
    from snug.trained_model import TrainedModel

    from .presets import Preset
    from .wardrobe import Wardrobe

HELD_OUT = ("brisk_walk", "torso_twist", "lunge")  # of the training motions
TRIAL_STEPS, TRIAL_PART = 30, 10  # steps of the trial that tells how many fit into the time, and of a log row
SUITE = "recipes"


@dataclass(frozen=True)
class Deviation:
    """One choice in which the default recipe is not the paper's text: its name and its options."""

    name: str
    options: tuple[str, ...]

    def taken_from(self, other: Recipe, recipe: Recipe, name: str) -> Recipe:
        """`recipe` with these options as `other` has them."""
        return replace(recipe, name=name, **{option: getattr(other, option) for option in self.options})


DEVIATIONS = (
    Deviation("zero last layer", ("zero_last_layer",)),
    Deviation("small output", ("output_scale",)),
    Deviation("six numbers a joint", ("pose_input",)),
    Deviation("velocity in root axes", ("velocity_frame",)),
    Deviation("smoothed weights", ("smoothing",)),
    Deviation("higher rate, by a cosine", ("learning_rate", "schedule")),
    Deviation("remembered states, less noise", ("remembered", "h0_sigma")),
    Deviation("overlapping windows", ("window_stride",)),
    Deviation("even epochs", ("even",)),
    Deviation("mean body alone", ("shape_range",)),
    Deviation("contact of the simulator", ("contact_samples", "contact_stiffness", "contact_margin")),
    Deviation("mixed motions", ("mixed",)),
    Deviation("guard against spikes", ("spike",)),
)


def variants() -> tuple[Recipe, ...]:
    """All recipes of the table, in its order; their names say what they are."""
    undone = [d.taken_from(PAPER, DEFAULT, f"default without {d.name}") for d in DEVIATIONS]
    added = [d.taken_from(DEFAULT, PAPER, f"paper with {d.name}") for d in DEVIATIONS]
    return (DEFAULT, *undone, PAPER, *added)


def parse(words: Sequence[str] | None = None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.recipe_effects",
        description="Train the recipes between the paper's text and the default for equal times.",
        epilog=f"{len(variants())} recipes are trained with each seed; held out are {', '.join(HELD_OUT)}.",
    )
    add = parser.add_argument
    add("--seconds", type=float, default=60.0, help="of training, each (default: %(default)s)")
    add("--seeds", default="0", metavar="N,...", help="(default: %(default)s)")
    add("--vertices", type=int, default=1000, help="of the T-shirt (default: %(default)s)")
    add("--recipes", default="*", metavar="PATTERN", help="only recipes of such names")
    add("--list", action="store_true", help="list the recipes; train nothing")
    add("-o", "--out", default="reports/runs/recipe_effects", help="folder to write (default: %(default)s)")
    return parser.parse_args(words)


def main(words: Sequence[str] | None = None) -> int:
    """Run the command; returns its exit status."""
    options = parse(words)
    chosen = [recipe for recipe in variants() if fnmatchcase(recipe.name, options.recipes)]
    if options.list:
        print("\n".join(recipe.name for recipe in chosen))
        return 0
    try:
        seeds = [int(word) for word in options.seeds.split(",")]
        if not chosen or options.seconds <= 0 or min(seeds) < 0:
            raise ValueError(
                "--recipes names none, --seconds is not above 0, or a seed is below 0; see --help"
            )
        return _run(options, chosen, seeds)
    except ValueError as error:
        print(f"recipe_effects: {error}", file=sys.stderr)
        return 2


def _run(options: argparse.Namespace, chosen: Sequence[Recipe], seeds: Sequence[int]) -> int:
    import torch

    from snug.motion import TRAIN

    from . import provenance
    from .presets import find_preset
    from .wardrobe import embedded_motions, open_wardrobe

    torch.set_num_threads(1)
    preset = replace(find_preset("quick"), garment_vertices=options.vertices)
    wardrobe = open_wardrobe(preset, embedded_motions(TRAIN))
    learned = [name for name in TRAIN if name not in HELD_OUT]
    folder = RunFolder(options.out)
    facts = provenance.hardware("cpu")
    folder.write_config({
        "command": "python -m benchmarks.recipe_effects", "seconds": options.seconds, "seeds": list(seeds),
        "preset": "quick", "commit": provenance.commit(), "hardware": facts,
        "versions": provenance.versions(),
        "motions": {"train": learned, "held_out": list(HELD_OUT)},
    })  # fmt: skip
    line = provenance.hardware_line(facts)
    judge = Judge(wardrobe, preset)
    rows: list[Row] = []
    for recipe in chosen:
        for seed in seeds:
            found = list(_rows(recipe, seed, options.seconds, wardrobe, learned, judge))
            rows += with_provenance(found, preset="quick", commit=provenance.commit(), hardware=line)
            folder.write_rows(rows)
            print(_said(recipe.name, seed, found), flush=True)
    print(Path(options.out).resolve())
    return int(any(not row.passed for row in rows))


def _rows(
    recipe: Recipe, seed: int, seconds: float, wardrobe: Wardrobe, learned: Sequence[str], judge: Judge
) -> Iterator[Row]:
    """Train for about that time, roll out, measure. A training that fails is a row with its reason."""
    from snug.dresser import DressedBody
    from snug.train import train

    dressed = DressedBody(wardrobe.body, wardrobe.garment)
    motions = wardrobe.named(learned)

    def trained(steps: int) -> TrainedModel:
        return train(
            "snug", dressed, motions, steps=steps, seed=seed, recipe=recipe, progress=False, every=TRIAL_PART
        )

    def row(scene: str, metric: str, unit: str, value: float) -> Row:
        return Row(SUITE, scene, recipe.name, seed, metric, unit, value, dtype="float32")

    try:
        model = trained(steps_within(seconds, trained))
        for scene, metric, unit, value in judge(model, dressed):
            yield row(scene, metric, unit, value)
        for metric, unit, value in (
            ("train/loss", "J", model.history[-1]["loss"]),
            ("train/steps", "1", float(model.steps)),
            ("cost/train", "s", model.seconds),
        ):
            yield row("training", metric, unit, value)
    except ValueError as error:
        reason = " ".join(f"{type(error).__name__}: {error}".split())
        yield Row(SUITE, "training", recipe.name, seed, "train/loss", "J", None, "diverged", reason)


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


def _said(name: str, seed: int, rows: Sequence[Row]) -> str:
    """One line of the progress: means over the held-out motions."""
    if any(row.value is None for row in rows):
        return f"{name:<40} seed {seed}  {rows[-1].status}: {rows[-1].reason}"
    numbers: dict[str, list[float]] = {}
    for row in rows:
        numbers.setdefault(row.metric, []).append(row.value or 0.0)
    means = {metric: sum(values) / len(values) for metric, values in numbers.items()}
    shown = ("energy/total", "energy/strain", "penetration/vertices", "train/steps")
    return f"{name:<40} seed {seed}  " + "  ".join(f"{metric} {means[metric]:.4g}" for metric in shown)


if __name__ == "__main__":
    sys.exit(main())
