"""Which roll-outs go into the page, and in which order, where not all of them fit."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from benchmarks.results.run_folder import RunFolder
from reports.run.rows import SUITES, Run, shown_seeds

BUDGET = 25_000_000  # bytes of the whole page
FIRST = ("reference", "bound", "baseline", "network")  # roles of the methods of page one
RULE = (
    "clips of garments first, then whole motions, then scenes without a body; in each of these the "
    "simulation, baselines and networks before all others; the first seed of each method"
)


@dataclass(frozen=True)
class Group:
    """Roll-outs of one scene that are taken one after the other: method -> file."""

    scene: str
    paths: dict[str, Path]


def groups(folder: RunFolder, run: Run) -> Iterator[Group]:
    """All roll-outs on disk, the most wanted first; the methods of a scene come in one or two groups."""
    cells = run.cells(*SUITES)
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
                paths = {m: folder.trajectory_path(scene, m, int(seeds[scene, m])) for m in methods}
                found = {method: path for method, path in paths.items() if path.is_file()}
                if found:
                    yield Group(scene, found)
