"""Choice of the roll-outs that go into the page, and their order, where not all of them fit."""

from __future__ import annotations

from collections.abc import Iterator

from benchmarks.results.run_folder import RunFolder
from reports.run.finished_run import Run, shown_seeds

BUDGET = 25_000_000  # bytes of the whole page
FIRST = ("reference", "bound", "baseline", "network", "external")  # roles of the methods of page one
RULE = (
    "clips of garments first, then whole motions, then scenes without a body; in each of these the "
    "simulation, baselines, networks and the user's own before all others; the first seed of each method"
)


def groups(folder: RunFolder, run: Run) -> Iterator[tuple[str, dict[str, int]]]:
    """Yield scene and method -> seed of all roll-outs on disk, the most wanted first.

    Those of a scene come in one or two groups.
    """
    cells = run.cells()
    seeds = shown_seeds(cells)
    traits = cells.drop_duplicates("scene").set_index("scene")[["garment", "part"]]
    kinds: list[list[str]] = [[], [], []]
    for scene, garment, part in traits.itertuples():
        kinds[0 if part == "clip" else 1 if garment else 2].append(str(scene))
    for scenes in kinds:
        for leading in (True, False):
            for scene in scenes:
                methods = run.ordered(seeds[scene].index)
                methods = [m for m in methods if (run.methods[m].role in FIRST) is leading]
                chosen = {m: int(seeds[scene, m]) for m in methods}
                stored = {m: s for m, s in chosen.items() if folder.trajectory_path(scene, m, s).is_file()}
                if stored:
                    yield scene, stored
