"""python -m benchmarks.submit: check an entry of another author, and score it from its vertices.

An entry is a folder of the method's name: entry.toml, and roll-outs or a program that makes them. Its
scores are rows of a run without clock and machine; they lie in `scores` with digests of what was scored.
"""

from __future__ import annotations

import math
import os
import tempfile
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.external.roll_out_files import PLACE, RollOutOption, read_roll_out
from benchmarks.plan.plan import Plan, make_plan
from benchmarks.plan.study import StudyError, read_fields, read_study
from benchmarks.presets import find_preset
from benchmarks.provenance import digest, digest_of_file
from benchmarks.results.protocol import DIGEST, NUMBER
from benchmarks.results.row import USABLE
from benchmarks.results.run_folder import RunFolder, flat
from benchmarks.score import MEASURED_BESIDE
from benchmarks.timing import one_thread
from reference_sim.command_line import Parser, command
from reference_sim.files.array_file import read_arrays
from reference_sim.given_files import demand_file
from snug.motion.library import TEST

if TYPE_CHECKING:
    from benchmarks.metric import Floats, Positions

PROGRAM = "benchmarks.submit"
PRESET = find_preset("quick")
SCENES = tuple(f"tshirt/{motion}" for motion in TEST[: PRESET.test_motions])  # of a full entry
METADATA = "entry.toml"
DECLARED = "cost/frame"  # the one cost that an entry has: as its authors say
KEPT = ("preset", "commit", "metrics", "methods", "scenes", "cases")  # of run.json
PICTURE = "picture.png"
SAMPLED, VERTICES = "sampled.npz", 20  # so many vertices of each roll-out: by them copies are found
COPIED, SAME = 0.9, 1e-4  # of a copy: share of frames, and their rms distance [m]
EXAMPLES = """examples:
  python -m benchmarks.export tshirt/dance_turn -o dance     a scene, to be dressed elsewhere
  python -m benchmarks.submit check submissions/mine         seconds: metadata, files, protocol
  python -m benchmarks.submit score submissions/mine         a minute: writes submissions/mine/scores
  python -m reports.docs                                     writes the page of all entries

DIR has entry.toml and one roll-out for each scene, or a program (docs/entries.md). Both check and score load
  the program, and score runs it: read the program of somebody else first.
exit status: 0 fine; 2 a fault of DIR: one line."""


@dataclass(frozen=True, kw_only=True)
class Metadata:
    """Fields of entry.toml; those with a default may be left out."""

    title: str
    authors: str
    description: str  # one sentence
    url: str  # of code or report, or where in this repository
    training_data: str  # what the method learned from; "none"
    hardware: str  # of the declared time
    protocol: str  # number of the one that the roll-outs were made by
    milliseconds: float  # a frame, as the authors declare them
    seeds: tuple[int, ...]  # of the trainings; one where roll-outs are files
    roll_outs: str = ""  # path of the files below the folder, with {scene}
    program: str = ""  # a Python file that declares one method, instead of files
    scenes: tuple[str, ...] = ()  # all by default

    def __post_init__(self) -> None:
        """Raise ValueError for the first field that cannot be meant."""
        source = "roll_outs" if self.roll_outs else "program"
        path = Path(getattr(self, source))
        demands = (
            ("protocol", self.protocol == NUMBER,
                f"this is protocol {NUMBER}: make the roll-outs again with its scenes, and say '{NUMBER}'"),
            ("milliseconds", 0.0 < self.milliseconds < math.inf, "give a number above 0"),
            ("roll_outs", bool(self.roll_outs) != bool(self.program),
                "give either roll_outs = 'roll-outs/{scene}.npz' or program = 'method.py'"),
            (source, not path.is_absolute() and ".." not in path.parts,
                "lies outside of the entry's folder: put it there"),
            ("seeds", not self.roll_outs or len(self.seeds) == 1, "give one where roll-outs are files"),
            ("scenes", set(self.scenes) <= set(SCENES), f"choose from {', '.join(SCENES)}"),
            *((name, len(set(values)) == len(values), "give each once")
                for name, values in (("scenes", self.scenes), ("seeds", self.seeds))),
        )  # fmt: skip
        for name, fine, otherwise in demands:
            if not fine:
                raise ValueError(f"{name}: {getattr(self, name)!r}: {otherwise}")


@dataclass(frozen=True)
class Entry:
    """Folder of an entry, named as its method, and what its metadata says."""

    path: Path
    metadata: Metadata

    @property
    def name(self) -> str:
        """Name of the folder, and of the method in rows."""
        return self.path.resolve().name

    @property
    def scenes(self) -> tuple[str, ...]:
        """Scenes that the entry covers."""
        return self.metadata.scenes or SCENES

    @property
    def scores(self) -> RunFolder:
        """Folder of the scores: results.csv and run.json, as of a run."""
        return RunFolder(self.path / "scores")

    def digests(self) -> dict[str, str]:
        """Return file -> digest of all that is scored and of the scores, but for run.json."""
        return {
            path.relative_to(self.path).as_posix(): digest_of_file(path)
            for path in sorted(self.path.rglob("*"))
            if path.is_file() and path != self.scores.config_path and "__pycache__" not in path.parts
        }

    def plan(self, folder: Path) -> Plan:
        """Return the plan that scores the entry beside simulation and skinning, untimed."""
        metadata = self.metadata
        option = RollOutOption(self.name, str(self.path / metadata.roll_outs), ms=metadata.milliseconds)
        programs = (str(self.path / metadata.program),) if metadata.program else ()
        study = replace(
            read_study("full"),
            scenes=self.scenes,
            methods=(*MEASURED_BESIDE, *programs),
            seeds=metadata.seeds,
            rollouts={} if programs else {option.name: option},
            sizes=PRESET,
        )
        plan, cells = make_plan(study, folder=folder), []
        for cell in plan.cells:
            mine = cell.method not in MEASURED_BESIDE
            if mine and cell.method != self.name:
                raise StudyError(
                    f"{self.path / metadata.program}: declares method '{cell.method}': one of the folder's "
                    f"name, '{self.name}', is expected"
                )
            declared = metadata.milliseconds if mine else None
            cells.append(replace(cell, entry=replace(cell.entry, declared_ms=declared)))
        return replace(plan, cells=tuple(cells))


@command(PROGRAM)
def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; return its exit status."""
    parser = Parser(
        prog=f"python -m {PROGRAM}",
        description="Check and score an entry of the benchmark.",
        epilog=EXAMPLES,
    )
    parser.add_argument("action", choices=("check", "score"), help="check alone, or check and score")
    parser.add_argument("entry", metavar="DIR", help="folder of the entry")
    options = parser.parse_args(arguments)
    one_thread()
    entry = read_entry(Path(options.entry))
    with tempfile.TemporaryDirectory(prefix="entry-") as folder:
        plan = entry.plan(Path(folder) / "run")
        if options.action == "check":
            from benchmarks.runner.execute_plan import check_methods

            check_scores(entry)
            check_methods(plan)
            if path := entry.metadata.roll_outs:
                files = {name: entry.path / path.replace(PLACE, name) for name in map(flat, entry.scenes)}
                samples = {n: sample(read_roll_out(file).positions) for n, file in files.items()}
                find_copies(entry, {f"{n}-seed0": samples[n] for n in samples})
            print(f"{entry.path}: nothing found; {len(entry.scenes)} of {len(SCENES)} scenes")
            return 0
        from benchmarks.evaluate import evaluate  # loads the simulator
        from reports.build import build_row

        count = write_scores(entry, evaluate(plan).folder)
        print(build_row(plan.folder))
    print(f"{entry.path}: {count} rows in {entry.scores.rows_path}")
    return 0


def read_entry(path: Path) -> Entry:
    """Read the metadata of an entry.

    Raises StudyError for a link out of the folder or a wrong field, OSError for a pipe or device.
    """
    for file in path.rglob("*"):
        if not Path(os.path.realpath(file)).is_relative_to(path.resolve()):
            raise StudyError(f"{file}: is a link out of the entry's folder: put the file itself there")
        if not file.is_dir():
            demand_file(file)
    return Entry(path, read_fields(Metadata, path / METADATA))


def check_scores(entry: Entry) -> None:
    """Raise StudyError for scores of files that have changed since."""
    if not entry.scores.config_path.is_file():
        return
    then, now = entry.scores.read_config().get("entry") or {}, entry.digests()
    if changed := sorted(name for name in then.keys() | now.keys() if then.get(name) != now.get(name)):
        names = ", ".join(changed)
        raise StudyError(f"{entry.path}: not as it was scored: {names}: put it right, or score it again")


def write_scores(entry: Entry, run: RunFolder) -> int:
    """Write rows without what the machine adds, and digests of what was scored; return how many.

    The bytes are the same each time, but for commit and date. Raises StudyError for a copy, and where a
    roll-out did not come to its last frame: the mean over the other scenes would be of easier ones.
    """
    from benchmarks.metrics import find_metric
    from reference_sim import Trajectory
    from reports.build import save_still

    rows = [
        replace(row, commit="", hardware="")
        for row in run.read_rows()
        if row.value is None
        or find_metric(row.metric).of == "answer"
        or (row.metric, row.method) == (DECLARED, entry.name)
    ]
    for scene in entry.scenes:
        mine = [row for row in rows if (row.scene, row.method) == (scene, entry.name)]
        bad = next((row for row in mine if row.status not in USABLE), None)
        if bad or not mine:
            reason = f"seed {bad.seed}: {bad.status}: {bad.reason}" if bad else "it did not run"
            raise StudyError(f"{entry.path}: {scene}: {reason}")
    cells = dict.fromkeys((row.scene, row.method, row.seed) for row in rows if row.method == entry.name)
    frames = {
        f"{flat(scene)}-seed{seed}": Trajectory.load(run.trajectory_path(scene, method, seed)).positions
        for scene, method, seed in cells
    }
    samples: dict[str, Any] = {name: sample(positions) for name, positions in frames.items()}
    find_copies(entry, samples)
    config, folder = run.read_config(), entry.scores
    folder.write_rows(rows)
    np.savez(folder.path / SAMPLED, **samples)
    save_still(run.path, entry.name, folder.path / PICTURE)
    folder.write_config({
        "protocol": {"number": NUMBER, "digest": DIGEST}, **{name: config.get(name) for name in KEPT},
        "date": date.today().isoformat(), "metadata": asdict(entry.metadata),
        "roll_outs": {name: digest(positions) for name, positions in frames.items()},
        "entry": entry.digests(),
    })  # fmt: skip
    return len(rows)


def sample(positions: Positions) -> Floats:
    """Return some vertices of each frame about their centre, (T,N) [m]."""
    points = positions[:, :: max(positions.shape[1] // VERTICES, 1)]
    return (points - points.mean(axis=1, keepdims=True)).reshape(len(points), -1).astype(np.float32)


def find_copies(entry: Entry, samples: dict[str, Floats]) -> None:
    """Raise StudyError for a roll-out whose frames another scene, seed, or entry beside it, has.

    So duplicates are found, frames in reverse, and one frame held. samples: name of a roll-out -> (T,N).
    """
    from scipy.spatial.distance import cdist

    others: dict[tuple[str, str], Floats] = {}
    for path in sorted(entry.path.resolve().parent.glob(f"*/scores/{SAMPLED}")):
        author = path.parents[1].name
        others |= {(author, n): x for n, x in read_arrays(path).items() if author != entry.name}
    others |= {(entry.name, name): frames for name, frames in samples.items()}
    for name, frames in samples.items():
        for whose, theirs in others.items():
            theirs = theirs[:1] if whose == (entry.name, name) else theirs
            if theirs.shape[1] != frames.shape[1]:
                continue
            gaps = cdist(frames, theirs) / math.sqrt(frames.shape[1] / 3)
            matches, nearest = gaps.min(axis=1) <= SAME, gaps.argmin(axis=1)
            if matches.mean() >= COPIED:
                order = np.sign(np.diff(nearest[matches]).mean())
                way = {0.0: "one of them held", 1.0: "in order", -1.0: "in reverse"}[float(order)]
                copied = f"its frames are those of {' '.join(whose)}, {way}"
                raise StudyError(f"{entry.path}: {name}: {copied}")


if __name__ == "__main__":
    raise SystemExit(main())
