"""How a study would spread over many workers: the runner's schedule simulated with the seconds of a run.

The longest tasks go first, and one runner hands out every task, takes every result back and writes it. Timed
cells run alone on one machine. What a task needs is not known here: so a stage ends before the next begins,
where the runner fills the wait with whatever is ready. Networks between machines, disks that are shared and
workers that die are left out.
"""

from __future__ import annotations

import csv
import heapq
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from benchmarks.results.run_folder import ResultsError, RunFolder, replacing
from benchmarks.runner.cache import read_entry
from reference_sim.command.command_line import Parser, command

if TYPE_CHECKING:
    import numpy as np

WORKERS = (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000, 10_000)
MEGABYTE = 1e6
EXAMPLES = """examples:
  python -m benchmarks.scaling reports/runs/quick --copies 100
  python -m benchmarks.scaling reports/runs/quick --copies 1000 --kinds data -o data.csv    ground truth alone
"""


@dataclass(frozen=True)
class Measured:
    """What one task took and left. timed: it ran alone. megabytes: of its files."""

    stage: str
    seconds: float
    megabytes: float
    timed: bool


@dataclass(frozen=True)
class Costs:
    """start: from the beginning of a worker to its first task [s]; handling: of the runner for one task, to
    hand it out and to take it back [s]; bandwidth: at which it takes, checks and writes files [MB/s].
    """

    start: float
    handling: float
    bandwidth: float

    def taking(self, task: Measured) -> float:
        """[s] for which the runner is busy with a result."""
        return self.handling / 2 + task.megabytes / self.bandwidth


@dataclass(frozen=True)
class Outlook:
    """One number of workers. efficiency: work over workers times the wall time; held_by: what costs most of
    the rest.
    """

    workers: int
    seconds: float
    efficiency: float
    held_by: str


def measured(folder: RunFolder, kinds: Sequence[str] = ()) -> list[Measured]:
    """The finished tasks of a run, all or those of these kinds. Raises ResultsError where there are none."""
    there = sorted(path.name for path in folder.cache.iterdir()) if folder.cache.is_dir() else []
    if unknown := sorted(set(kinds) - set(there)):
        raise ResultsError(f"no task of kind '{unknown[0]}' in {folder.path}: use {', '.join(there)}")
    found = []
    for kind in kinds or there:
        for path in sorted((folder.cache / kind).rglob("*.json")):
            entry = read_entry(path)
            if entry and not entry["outcome"]["failed"]:
                files = (folder.path / name for name in entry["files"])
                size = sum(file.stat().st_size for file in files if file.is_file()) / MEGABYTE
                seconds = float(entry["outcome"]["seconds"])
                found.append(Measured(entry["stage"], seconds, size, entry["alone"]))
    if not found:
        raise ResultsError(
            f"{folder.cache}: holds no finished task of this version; name the folder of a run or data set"
        )
    return found


def study(tasks: Sequence[Measured], copies: int, random: np.random.Generator) -> list[Measured]:
    """The tasks of the run, or as many as several copies have, each drawn from those of its stage."""
    if copies == 1:
        return list(tasks)
    stages: dict[tuple[str, bool], list[Measured]] = {}
    for task in tasks:
        stages.setdefault((task.stage, task.timed), []).append(task)
    return [
        own[number]
        for own in stages.values()
        for number in random.integers(len(own), size=copies * len(own)).tolist()
    ]


def outlook(tasks: Sequence[Measured], workers: int, costs: Costs) -> Outlook:
    """What that many workers, each of one core, make of the tasks."""
    alone = sum(task.seconds for task in tasks if task.timed)
    stages: dict[str, list[Measured]] = {}
    for task in tasks:
        if not task.timed:
            stages.setdefault(task.stage, []).append(task)
    wall = alone + sum(
        stage_seconds(own, workers, costs, start=costs.start if number == 0 else 0.0)
        for number, own in enumerate(stages.values())
    )
    work = sum(task.seconds for task in tasks)
    shared = [task for own in stages.values() for task in own]
    lost = {
        "timed cells, alone on one machine": alone * (1 - 1 / workers),
        "the runner, which takes every result": sum(map(costs.taking, shared)),
        "the longest task of each stage": sum(max(task.seconds for task in own) for own in stages.values()),
        "the start of workers": costs.start if stages else 0.0,
    }
    return Outlook(workers, wall, work / (workers * wall), max(lost, key=lost.__getitem__))


def stage_seconds(tasks: Iterable[Measured], workers: int, costs: Costs, start: float = 0.0) -> float:
    """[s] until the last result of a stage is written; workers begin at `start`."""
    runner = start  # the time until which it is busy
    # A heap: when a task ends, and for how long the runner then has work.
    results: list[tuple[float, float]] = []
    for number, task in enumerate(sorted(tasks, key=lambda task: -task.seconds)):
        if number >= workers:  # who is back first gets the next
            ended, busy = heapq.heappop(results)
            runner = max(runner, ended) + busy
        runner += costs.handling / 2
        heapq.heappush(results, (runner + task.seconds, costs.taking(task)))
    while results:
        ended, busy = heapq.heappop(results)
        runner = max(runner, ended) + busy
    return runner


def table(outlooks: Iterable[Outlook]) -> Iterator[str]:
    yield f"{'workers':>8} {'hours':>10} {'efficiency':>11}  held by"
    for line in outlooks:
        held = line.held_by if line.efficiency < 0.95 else ""
        yield f"{line.workers:8d} {line.seconds / 3600:10.3f} {line.efficiency:11.3f}  {held}"


@command("benchmarks.scaling")
def main(arguments: Sequence[str] | None = None) -> int:
    """Exit status: 0 done; 2 for a folder without finished tasks and options that cannot be met."""
    parser = Parser(
        prog="python -m benchmarks.scaling",
        description="Simulate the runner's schedule on many workers with the task times of a finished run.",
        epilog=EXAMPLES,
    )
    parser.add_argument("run_dir", metavar="RUN", help="folder of a finished run or data set")
    parser.add_argument(
        "--copies", type=int, default=100, help="size of the study, in runs (default 100; 1: this run)"
    )
    parser.add_argument("--kinds", help="of tasks, say data,network (default: all)")
    parser.add_argument("--workers", default=",".join(map(str, WORKERS)), help="numbers of cores")
    parser.add_argument("--start", type=float, default=20.0, help="of a worker [s] (default 20)")
    parser.add_argument("--handling", type=float, default=0.015, help="of a task [s] (default .015)")
    parser.add_argument("--bandwidth", type=float, default=300.0, help="of the runner [MB/s] (default 300)")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("-o", "--out", type=Path, help="write the table as .csv")
    options = parser.parse_args(arguments)
    import numpy as np

    try:
        workers = [int(text) for text in options.workers.split(",")]
    except ValueError:
        raise ValueError(f"--workers {options.workers}: give whole numbers, as 1,10,100") from None
    if min([options.copies, *workers]) < 1 or not 0.0 < options.bandwidth < np.inf:
        raise ValueError("--copies, --workers and --bandwidth have to be positive")
    if not (0.0 <= options.start < np.inf and 0.0 <= options.handling < np.inf):
        raise ValueError("--start and --handling are seconds: give 0 or more")
    tasks = measured(RunFolder(options.run_dir), options.kinds.split(",") if options.kinds else ())
    many = study(tasks, options.copies, np.random.default_rng(options.seed))
    costs = Costs(options.start, options.handling, options.bandwidth)
    found = [outlook(many, count, costs) for count in workers]
    work = sum(task.seconds for task in many) / 3600
    print(f"{len(many):,} tasks, {work:,.1f} core-hours")
    print("\n".join(table(found)))
    if options.out:
        with replacing(options.out) as temporary, temporary.open("w", newline="", encoding="utf-8") as stream:
            writer = csv.writer(stream)
            writer.writerow(("workers", "seconds", "efficiency", "held_by"))
            writer.writerows((f.workers, f.seconds, f.efficiency, f.held_by) for f in found)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
