"""python -m benchmarks.recipe_effects: what each deviation of the default recipe from the paper's text does.

The default recipe is trained with one deviation undone at a time, the paper's with one added at a time, all
with steps for the same wall time (making ready comes on top), some side by side. They are judged by roll-outs
on training motions that were held out; the test motions are never looked at. Writes results.csv and run.json,
of which `python -m reports.build` makes the table.
"""

from __future__ import annotations

import argparse
import dataclasses
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from pathlib import Path
from typing import TYPE_CHECKING, Any

from snug.recipe import DEFAULT, PAPER, Recipe

from . import provenance, workers
from .fingerprint import code_of, data_files, preset_values
from .judged import kept_rows
from .lock import held
from .recipe_trials import HELD_OUT, learned, tried
from .records import Records, Work
from .results import ResultsError, Row, RunFolder, with_provenance

if TYPE_CHECKING:
    from .presets import Preset

COMMAND = "python -m benchmarks.recipe_effects"
EXAMPLES = """examples:
  python -m benchmarks.recipe_effects                                    each for a minute
  python -m benchmarks.recipe_effects --seeds 0,1 --seconds 120
  python -m benchmarks.recipe_effects --recipes 'default*' -o reports/runs/effects

The same command again in the same folder does what is missing there, after an interrupt or a kill."""


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
    Deviation("weight decay", ("weight_decay",)),
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
        epilog=f"{len(variants())} recipes are trained with each seed. Held out: {', '.join(HELD_OUT)}."
        f"\n\n{EXAMPLES}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add = parser.add_argument
    add("--seconds", type=float, default=60.0, help="of training, each (default: %(default)s)")
    add("--seeds", default="0", metavar="N,...", help="(default: %(default)s)")
    add("--vertices", type=int, default=1000, help="of the T-shirt (default: %(default)s)")
    add("--recipes", default="*", metavar="PATTERN", help="only recipes of such names")
    add("--list", action="store_true", help="list the recipes; train nothing")
    add("--workers", type=int, metavar="N",
        help="trainings side by side (default 2, or the cores there are)")  # fmt: skip
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
        if options.workers is None:
            options.workers = workers.worker_count()
        if not chosen or options.seconds <= 0 or min(seeds) < 0 or options.workers < 1:
            raise ValueError(
                "--recipes names none, --seconds or --workers is not above 0, or a seed is below 0"
            )
        with held(Path(options.out)):
            return _run(options, [(recipe, seed) for recipe in chosen for seed in seeds])
    except (ValueError, OSError) as error:
        print(f"recipe_effects: {error}", file=sys.stderr)
        return 2


def _run(options: argparse.Namespace, asked: Sequence[tuple[Recipe, int]]) -> int:
    from snug.motion_library import TRAIN

    from .presets import find_preset
    from .wardrobe import embedded_motions, open_wardrobe

    preset = find_preset("quick")
    if options.vertices != preset.garment_vertices:
        name = f"quick, {options.vertices} vertices"
        preset = replace(preset, name=name, garment_vertices=options.vertices)
    folder, facts, commit = _folder(options.out), provenance.hardware("cpu"), provenance.commit()
    versions, hardware = provenance.versions(), provenance.hardware_line(facts)
    folder.write_config({
        "command": COMMAND, "seconds": options.seconds,
        "recipes": options.recipes, "vertices": options.vertices,
        "seeds": sorted({seed for _, seed in asked}), "workers": options.workers,
        "preset": preset.name, "commit": commit, "hardware": facts, "versions": versions,
        "motions": {"train": learned(TRAIN), "held_out": list(HELD_OUT)},
    })  # fmt: skip
    records, machine = Records(folder, commit=commit), {"versions": versions, "hardware": hardware}
    works = [_work(recipe, seed, options, preset, machine) for recipe, seed in asked]
    jobs = [
        workers.Job(work.name, tried, (preset, recipe, seed, options.seconds), 1, work, records)
        for work, (recipe, seed) in zip(works, asked)
        if records.find(work).wanted
    ]
    rows: list[Row] = []
    try:
        wardrobe = open_wardrobe(preset, embedded_motions(TRAIN))
        ended = workers.run_jobs(jobs, wardrobe, title="recipes", unit="training", workers=options.workers)
    finally:  # an interrupt leaves the rows of all that had ended
        for found in (records.find(work) for work in works):
            if found.state == "finished":
                rows += with_provenance(kept_rows(found), preset=preset.name, hardware=hardware)
        folder.write_rows(rows)
    failures = [result for result in ended if isinstance(result, workers.Failure)]
    for failure in failures:
        print(f"recipe_effects: {failure.label}: {failure.reason}", file=sys.stderr)
    for name, seed in dict.fromkeys((row.method, row.seed) for row in rows):
        print(_said(name, seed, [row for row in rows if (row.method, row.seed) == (name, seed)]))
    print(folder.path.resolve())
    return int(bool(failures) or any(not row.passed for row in rows))


def _folder(out: str) -> RunFolder:
    """Raises ValueError for a folder with the results of something else."""
    folder = RunFolder(out)
    try:
        other = folder.config_path.is_file() and folder.read_config().get("command") != COMMAND
    except ResultsError as error:
        raise ValueError(f"--out {error}; name another folder, or put that file right") from None
    if other:
        raise ValueError(f"--out {out}: holds the results of another command; name another folder")
    return folder


def _work(
    recipe: Recipe, seed: int, options: argparse.Namespace, preset: Preset, machine: dict[str, Any]
) -> Work:
    """A training and its judgement. Those beside it share the memory, so how many there are counts."""
    inputs = {name: getattr(options, name) for name in ("seconds", "vertices", "workers")}
    inputs |= {"recipe": dataclasses.asdict(recipe), "seed": seed, **machine}
    code = code_of("benchmarks.recipe_trials", "benchmarks.scenes.dressed_body")  # the scene by its name
    inputs |= {"preset": preset_values(preset, code), "files": data_files()}
    return Work("recipe", f"{recipe.name}, seed {seed}", inputs, code)


def _said(name: str, seed: int, rows: Sequence[Row]) -> str:
    """One line of the summary: means over the held-out motions."""
    if bad := next((row for row in rows if row.value is None), None):
        return f"{name:<40} seed {seed}  {bad.status}: {bad.reason}"
    numbers: dict[str, list[float]] = {}
    for row in rows:
        numbers.setdefault(row.metric, []).append(row.value or 0.0)
    means = {metric: sum(values) / len(values) for metric, values in numbers.items()}
    shown = ("energy/total", "energy/strain", "penetration/vertices", "train/steps")
    return f"{name:<40} seed {seed}  " + "  ".join(f"{metric} {means[metric]:.4g}" for metric in shown)


if __name__ == "__main__":
    sys.exit(main())
