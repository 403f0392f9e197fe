"""python -m benchmarks.merge: runs of several machines in one folder, for one report.

Everything but times is compared first, and refused by name where it differs: what the runs were asked for,
the inputs and the code of every task, and each number that two of them have. Times are those of one machine,
the first named that measured any; what others measured is told and not put beside them.
"""

from __future__ import annotations

import shlex
import shutil
import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from benchmarks.fingerprint.digest import digest_of_file
from benchmarks.results import frame_energies
from benchmarks.results.json_file import ResultsError
from benchmarks.results.row import BEFORE_FRAMES, Row
from benchmarks.results.run_folder import RunFolder
from benchmarks.runner.cache import read_entry
from reference_sim.command.command_line import Parser, command

PROGRAM = "benchmarks.merge"
EXAMPLES = """examples:
  python -m benchmarks.merge runs/first runs/second -o runs/both
  python -m reports.build runs/both                                   tables, figures and the report

Runs of one preset and of the same code: say, some seeds on each machine, or some methods. Times (and peak
memory) are kept of the first machine named that measured them; another machine's are told in the reason of a
skipped row. Runs go on in their own folders, not in the merged one.
exit status: 0 written; 2 the runs differ in what has to be the same, or a file is damaged: one line says
  which, and nothing is written."""
MACHINE = "machine"  # the input of a task that says where it ran
SAME = ("format", "preset", "preset_values", "split", "body", "garment")  # entries of run.json
STRICT = ("motions", "motion_sources", "garments", "metrics", "methods", "scenes", "cases")  # where shared
JOINED = (*STRICT, "tasks", "outdated")  # which hold times and remarks
# Columns that other cells of the run decide.
OF_ONE_RUN = ("uncertainty", "moved", "reason", "commit", "hardware")


class MergeError(ValueError):
    """Folders that do not belong together; the message names what differs, and where."""


@command(PROGRAM)
def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; returns its exit status."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    parser = Parser(prog=f"python -m {PROGRAM}", description="Join runs into one folder.", epilog=EXAMPLES)
    parser.add_argument("runs", metavar="RUN", nargs="+", help="folders of benchmarks.run, two or more")
    parser.add_argument("-o", "--out", metavar="DIR", required=True, help="a new folder")
    options = parser.parse_args(words)
    rows = merge(
        [Path(run) for run in options.runs], Path(options.out),
        command=shlex.join(["python", "-m", PROGRAM, *words]),
    )  # fmt: skip
    timed = of_machines(RunFolder(Path(options.out)).read_config())
    left_out = [row for row in rows if row.status == "skipped" and row.metric in timed]
    if left_out:
        print(
            f"{len(left_out)} times of other machines stand in the reasons of skipped rows", file=sys.stderr
        )
    print(f"{len(rows)} rows in {options.out}; python -m reports.build {shlex.quote(options.out)}")
    return 0


@dataclass(frozen=True)
class _Run:
    """A run to merge. Raises ResultsError for a folder that is none."""

    folder: RunFolder

    @cached_property
    def config(self) -> dict[str, Any]:
        return self.folder.read_config()

    @cached_property
    def rows(self) -> list[Row]:
        return self.folder.read_rows()


def merge(paths: Sequence[Path], out: Path, *, command: str = "") -> list[Row]:
    """Join them; gives the rows written. Raises ValueError (MergeError, ResultsError), one line."""
    if len({path.resolve() for path in paths}) < max(2, len(paths)):
        raise MergeError("name two or more different folders")
    runs = [_Run(RunFolder(path)) for path in paths]
    for run in runs:
        if changed := run.folder.changed(run.config):
            raise MergeError(f"{run.folder.path / changed[0]}: is not as the run wrote it; run it again")
        if "merged" in run.config:
            raise MergeError(f"{run.folder.path}: is merged already; name the runs that it came of")
    config = _joined(runs, command)
    check_entries([run.folder for run in runs])
    rows = joined_rows({str(run.folder.path): run.rows for run in runs}, of_machines(config))
    from reference_sim.files.atomic_files import new_folder

    with new_folder(out) as part:
        folder, digests = RunFolder(part), dict[str, str]()
        frames = folder.frame_energies_path
        for run in runs:
            for name, digest in run.config.get("digests", {}).items():
                if name not in digests and name not in (p.name for p in (folder.rows_path, frames)):
                    digests |= copied(name, digest, run.folder.path, part)
        folder.write_rows(rows)
        frame_energies.join([run.folder.frame_energies_path for run in runs], frames)
        digests |= {path.name: digest_of_file(path) for path in (folder.rows_path, frames) if path.is_file()}
        folder.write_config(config | {"digests": digests})
    return rows


def _joined(runs: Sequence[_Run], command: str) -> dict[str, Any]:
    """run.json of the merged folder. Raises MergeError for entries that have to be equal and are not."""
    first = runs[0]
    for run, name in ((run, name) for run in runs[1:] for name in SAME):
        if run.config.get(name) != first.config.get(name):
            told = (f"{r.folder.path} ({str(r.config.get(name))[:60]})" for r in (run, first))
            raise MergeError(f"another {name.replace('_', ' ')} in {' than in '.join(told)}")
    joined: dict[str, Any] = {}
    for name in JOINED:
        joined[name] = {}
        for run in runs:
            where = f"{name.replace('_', ' ')} of {run.folder.path}"
            _join(joined[name], run.config.get(name) or {}, where, strict=name in STRICT)
    looks = [look for run in runs for look in run.config.get("test_looks") or ()]
    kept = ("command", "commit", "started", "finished", "hardware", "versions", "seeds", "stages")
    own = {name: value for name, value in first.config.items() if name not in ("started", "cells", "stages")}
    return own | joined | {
        "command": command,
        "suites": _each(run.config.get("suites") or () for run in runs),
        "seeds": sorted(_each(run.config.get("seeds") or () for run in runs)),
        "finished": max(str(run.config.get("finished") or "") for run in runs),
        "earlier": [],
        "test_looks": [look for k, look in enumerate(looks) if look not in looks[:k]],
        "merged": [{name: run.config.get(name) for name in kept} for run in runs],
    }  # fmt: skip


def _join(there: dict[str, Any], other: Mapping[str, Any], where: str, *, strict: bool) -> None:
    """Add what is not there yet, inside of dictionaries too."""
    for name, value in other.items():
        if isinstance(value, dict) and isinstance(there.get(name), dict):
            _join(there[name], value, f"{name} among {where}", strict=strict)
        elif strict and there.get(name, value) != value:
            raise MergeError(f"another {name} among {where} than in the runs before it")
        else:
            there.setdefault(name, _copy(value))


def _copy(value: Any) -> Any:
    return {name: _copy(inner) for name, inner in value.items()} if isinstance(value, dict) else value


def _each(lists: Iterable[Iterable[Any]]) -> list[Any]:
    return list(dict.fromkeys(value for values in lists for value in values))


def check_entries(folders: Iterable[RunFolder]) -> None:
    """Raises MergeError where two tasks came of other code or other packages, or one task of other inputs.

    On which machine a task ran is no such input.
    """
    seen: dict[Any, tuple[str, Path]] = {}
    for folder in folders:
        paths = sorted(folder.cache.rglob("*.json"))
        if not paths:
            raise MergeError(f"{folder.path}: has no cache/, which says what its results came of")
        for path in paths:
            entry = read_entry(path)
            if entry is None:
                raise MergeError(f"{path}: damaged, or of an earlier version; run it again with --fresh")
            for name, value in entry["parts"].items():
                own = name in entry["inputs"]
                key = (path.relative_to(folder.cache), name) if own else name
                before, where = seen.setdefault(key, (value, folder.path))
                if before != value and name != MACHINE:
                    told = f"{entry['task']}: another {name} in {folder.path} than in {where}"
                    raise MergeError(f"{told}: run both by the same code; --fresh forgets what is older")


def of_machines(config: Mapping[str, Any]) -> frozenset[str]:
    """The metrics of a run that are numbers of the machine, as every time."""
    return frozenset(name for name, said in config["metrics"].items() if said.get("of") == "machine")


def joined_rows(runs: Mapping[str, Sequence[Row]], timed: frozenset[str]) -> list[Row]:
    """Each row once; of metrics `timed` those of one machine. Raises MergeError for numbers that differ.

    runs: folder -> its rows, in the order in which machines are preferred.
    """
    kept: dict[tuple[Any, ...], tuple[Row, str]] = {}
    machine: dict[str, str] = {}
    for where, rows in runs.items():
        for row in rows:
            key = (row.suite, row.scene, row.method, row.seed, row.metric)
            there = kept.get(key)
            if there:
                _compare(there, (row, where), of_a_machine=row.metric in timed)
            kind = row.metric if row.metric in BEFORE_FRAMES else ""
            measured = row.metric in timed and row.value is not None
            if measured and machine.setdefault(kind, row.hardware) != row.hardware:
                row = _told(row, machine[kind])
            if there is None or _known(row) > _known(there[0]):
                kept[key] = (row, where)
    return [row for row, _ in kept.values()]


def _known(row: Row) -> tuple[bool, bool]:
    """More of a row that says more."""
    return row.status != "skipped", row.uncertainty is not None


def _told(row: Row, hardware: str) -> Row:
    """A time of another machine: a reason instead of a number."""
    reason = f"{row.value:.4g} {row.unit} on {row.hardware}; other times are of {hardware}"
    return replace(row, value=None, uncertainty=None, moved=(), status="skipped", reason=reason)


def _compare(one: tuple[Row, str], other: tuple[Row, str], *, of_a_machine: bool) -> None:
    """Raises MergeError for other numbers in one cell; of times, where it ended well on one machine alone."""
    if "skipped" in (one[0].status, other[0].status):
        return
    names = [field.name for field in fields(Row) if field.name not in OF_ONE_RUN]
    for column in ("status", *(() if of_a_machine else names)):
        if (a := getattr(one[0], column)) != (b := getattr(other[0], column)):
            row = one[0]
            cell = f"{row.scene} x {row.method} seed {row.seed} / {row.metric}"
            raise MergeError(f"{cell}: {column} {a} in {one[1]}, {b} in {other[1]}")


def copied(name: str, digest: str, source: Path, target: Path) -> dict[str, str]:
    """Copy a file of a folder into another; its name and digest, none where it is not there.

    Raises ResultsError for one that is not as it was written, or lies elsewhere.
    """
    if Path(name).is_absolute() or ".." in Path(name).parts:
        raise ResultsError(f"{source}: its run.json names {name}, which lies outside of the folder")
    if not (source / name).is_file():
        return {}
    path = target / name
    path.parent.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(source / name, path)
    if digest_of_file(path) != digest:
        raise ResultsError(f"{source / name}: is damaged; make it again there")
    return {name: digest}


if __name__ == "__main__":
    sys.exit(main())
