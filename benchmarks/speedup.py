"""python -m benchmarks.speedup: how much faster this code is than an earlier commit, in one table.

Each row is one measurement of `benchmarks.run`, made by the code of then in a checkout of its own and by the
code here, in turn on one machine: its time before and after, their ratio, and what the time bought.
"""

from __future__ import annotations

import argparse
import csv
import os
import statistics
import subprocess
import sys
import tarfile
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from benchmarks.plan.plan import PlanError
from benchmarks.results.run_folder import ResultsError, RunFolder, replacing
from benchmarks.timing import THREADS
from reference_sim.command.command_line import Parser, command

PROGRAM = "benchmarks.speedup"
ROOT = Path(__file__).resolve().parent.parent
EXAMPLES = """examples:
  python -m benchmarks.speedup 937ace5                     every row, about an hour
  python -m benchmarks.speedup 937ace5 --rows solver --turns 3
  python -m benchmarks.speedup 937ace5 --rows inference,training -o speedup.csv

Nothing else should be at work on the machine.
exit status: 0 measured; 1 a run failed, the others are in the table; 2 no such commit or row: one line says
  which."""


@dataclass(frozen=True)
class Measurement:
    """One row of the table, or one for each scene.

    group: what --rows names. arguments: of benchmarks.run; {methods} are those of either code. before, after:
    the methods compared; others: what the code of then, and that of now, run besides. time: the metric that
    is divided; bought: what must not grow with it.
    """

    group: str
    title: str
    arguments: tuple[str, ...]
    before: str
    after: str
    time: str
    bought: str
    others: tuple[tuple[str, ...], tuple[str, ...]] = ((), ())

    def words(self, side: int) -> tuple[str, ...]:
        """Arguments of the run of then (0) or now (1): the same for all rows that one run serves."""
        methods = ",".join(sorted({(self.before, self.after)[side], *self.others[side]}))
        return tuple(word.format(methods=methods) for word in self.arguments)


CLIPS = (
    "tshirt/sudden_stop@clip", "tshirt/spin_jump@clip", "tshirt/turning_stop@clip", "tshirt/kick@clip",
    "skirt/turning_stop@clip", "tunic/turning_stop@clip",
)  # fmt: skip
_GAP = {"time": "cost/frame", "bought": "gap/energy"}


def _on_clips(
    group: str, clips: Sequence[str], before: str, afters: Sequence[str], beside: tuple[str, ...]
) -> list[Measurement]:
    """One run of each code serves all rows."""
    arguments = ("--suite", "speed", "--scenes", ",".join(clips), "--methods", "{methods}")
    return [
        Measurement(
            group, f"{before}, now {after}", arguments, before, after, **_GAP,
            others=(beside, (*beside, *afters)),
        )
        for after in afters
    ]  # fmt: skip


def _performance(group: str, case: str, method: str, time: str, bought: str) -> Measurement:
    arguments = ("--suite", "performance", "--scenes", case, "--methods", "{methods}")
    return Measurement(group, case, arguments, method, method, f"performance/{time}", f"performance/{bought}")


MEASUREMENTS = (
    *_on_clips("solver", CLIPS, "lbfgs-10", ("lbfgs-10", "fast-lbfgs-10"), ("simulation", "skinning")),
    *_on_clips(
        "hybrid",
        CLIPS[:3],
        "snug+lbfgs-2",
        ("snug+fast-lbfgs-1", "snug+fast-lbfgs-2", "snug+fast-lbfgs-4"),
        ("simulation", "skinning", "snug"),
    ),
    *(
        _performance("inference", f"inference/{n}", "snug", "inference", "inference_p95")
        for n in (1000, 4400)
    ),
    *(
        _performance("reference", case, "simulation", "frame", "converged_frames")
        for case in ("garment/walk-1000", "garment/run-1000", "garment/walk-4400", "sheet/64x64")
    ),
    *(
        _performance("training", f"training_step/{n}", "snug", "training_step", "training_step_least")
        for n in (1000, 4400)
    ),
    *(
        _performance("size", f"scaling/{n}x{n}", "simulation", "iteration", "process_memory")
        for n in (64, 128, 256)
    ),
)


@dataclass(frozen=True)
class Line:
    """One line of the table: times and what they bought, of one scene."""

    row: str
    scene: str
    before: float
    after: float
    ratio: float
    bought_before: float
    bought_after: float
    unit: str


class SpeedupError(ValueError):
    """A commit that is not there, or a run that failed; one line says which."""


def check_out(commit: str, folder: Path) -> Path:
    """The tree of a commit in that folder. Raises SpeedupError."""
    archive = folder / "before.tar"
    with archive.open("wb") as stream:
        made = subprocess.run(["git", "archive", commit], cwd=ROOT, stdout=stream, stderr=subprocess.PIPE)
    if made.returncode:
        raise SpeedupError(f"{commit}: no such commit here: {made.stderr.decode().strip()}")
    tree = folder / "before"
    with tarfile.open(archive) as tar:
        tar.extractall(tree, filter="data")
    return tree


def measured(tree: Path, words: Sequence[str], folder: Path) -> RunFolder:
    """A run of the code in that tree. Raises SpeedupError."""
    environment = os.environ | dict.fromkeys(THREADS, "1") | {"PYTHONPATH": str(tree)}
    command = [sys.executable, "-m", "benchmarks.run", *words, "--fresh", "-o", str(folder)]
    made = subprocess.run(command, cwd=tree, env=environment, capture_output=True, text=True)
    if made.returncode not in (0, 1) or not (folder / "results.csv").is_file():
        last = (made.stderr.strip() or made.stdout.strip()).splitlines()[-1:]
        raise SpeedupError(f"{' '.join(command[2:])}: exit status {made.returncode}: {' '.join(last)}")
    return RunFolder(folder)


def _values(run: RunFolder, method: str, metric: str) -> dict[str, float]:
    """By scene."""
    rows = (row for row in run.read_rows() if row.metric == metric and row.method == method)
    return {row.scene: row.value for row in rows if row.value is not None}


def compared(
    what: Measurement,
    before: Path,
    folder: Path,
    turns: int,
    runs: dict[tuple[int, int, tuple[str, ...]], RunFolder],
) -> list[Line]:
    """Both codes in turn; medians over the turns. runs: those made so far. Raises SpeedupError."""
    found: list[list[dict[str, float]]] = [[], [], [], []]
    for turn in range(turns):
        for side, (tree, method) in enumerate(((before, what.before), (ROOT, what.after))):
            words = what.words(side)
            if (turn, side, words) not in runs:
                runs[turn, side, words] = measured(tree, words, folder / str(len(runs)))
            run = runs[turn, side, words]
            for place, metric in enumerate((what.time, what.bought)):
                found[2 * place + side].append(_values(run, method, metric))
    scenes = [scene for scene in found[0][0] if all(scene in values for side in found for values in side)]
    lines = []
    for scene in scenes:
        b, a, bb, ba = (statistics.median(values[scene] for values in side) for side in found)
        lines.append(Line(what.title, scene, b, a, a / b, bb, ba, what.bought))
    return lines


def make_parser() -> argparse.ArgumentParser:
    """The options of the command."""
    parser = Parser(
        prog=f"python -m {PROGRAM}",
        description="Measure an earlier commit and this code in turn: times, ratios, and what they bought.",
        epilog=EXAMPLES,
    )
    groups = sorted({what.group for what in MEASUREMENTS})
    parser.add_argument("commit", help="to compare with")
    parser.add_argument("--rows", metavar="NAME,...", default=",".join(groups), help="default: %(default)s")
    parser.add_argument("--turns", type=int, default=1, help="of both; medians are given (default 1)")
    parser.add_argument("-o", "--out", metavar="FILE", help="write the table there as CSV")
    return parser


@command(PROGRAM)
def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; returns its exit status."""
    known = {what.group for what in MEASUREMENTS}
    options = make_parser().parse_args(arguments)
    wanted = options.rows.split(",")
    if unknown := set(wanted) - known:
        raise PlanError(f"--rows {min(unknown)}: choose from {', '.join(sorted(known))}")
    lines: list[Line] = []
    runs: dict[tuple[int, int, tuple[str, ...]], RunFolder] = {}
    failed = False
    with tempfile.TemporaryDirectory() as name:
        before = check_out(options.commit, Path(name))
        for what in MEASUREMENTS:
            if what.group not in wanted:
                continue
            print(f"{what.title}: measuring", file=sys.stderr, flush=True)
            try:
                lines += compared(what, before, Path(name), max(options.turns, 1), runs)
            except (SpeedupError, ResultsError) as error:  # the others are measured all the same
                print(f"{PROGRAM}: {error}", file=sys.stderr)
                failed = True
            if options.out:
                _write(Path(options.out), lines)
    _show(lines)
    return 1 if failed else 0


def _write(path: Path, lines: Sequence[Line]) -> None:
    """What is measured so far, whole or not at all: an hour's work is not lost with its end."""
    with replacing(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.DictWriter(stream, list(Line.__dataclass_fields__), lineterminator="\n")
        writer.writeheader()
        writer.writerows(vars(line) for line in lines)


def _show(lines: Sequence[Line]) -> None:
    print("| what | scene | before | after | ratio | bought before | after | |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- |")
    for line in lines:
        numbers = (line.before, line.after, line.ratio, line.bought_before, line.bought_after)
        print(f"| {line.row} | {line.scene} | {' | '.join(f'{x:.3g}' for x in numbers)} | {line.unit} |")


if __name__ == "__main__":
    sys.exit(main())
