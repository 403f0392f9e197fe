"""Runs of several machines joined into one folder, for one report.

Everything but times is compared first, and refused by name where it differs: the requests, the inputs and
the code of every task, and each number that two runs have. Times are those of one machine, the first named
that measured any; those of others become the reason of a skipped row.
"""

from __future__ import annotations

import shutil
from collections.abc import Iterable, Mapping, Sequence
from copy import deepcopy
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

from benchmarks.fingerprint.digest import digest_of_file
from benchmarks.results import frame_energies
from benchmarks.results.json_file import ResultsError
from benchmarks.results.row import BEFORE_FRAMES, Row
from benchmarks.results.run_config import OF_SCENES
from benchmarks.results.run_folder import RunFolder
from benchmarks.runner.cache import read_entry
from benchmarks.tasks.training import TrainNetwork
from reference_sim.files.atomic_files import new_folder

MACHINE = "machine"  # the input of a task that says where it ran
CASE_TIMES = {"engine/time", "engine/reference_time"}  # cases declare no metric that says so
SAME = ("format", "protocol", "split", *OF_SCENES)  # entries of run.json
STRICT = ("motions", "motion_sources", "garments", "metrics", "methods", "scenes", "cases")  # where shared
JOINED = (*STRICT, "tasks", "outdated")  # which hold times and remarks
# Columns that other cells of the run decide.
OF_ONE_RUN = ("uncertainty", "moved", "reason", "commit", "hardware")


class MergeError(ValueError):
    """Folders that do not belong together; the message names what differs, and where."""


def merge(paths: Sequence[Path], out: Path, *, command: str = "") -> list[Row]:
    """Join the runs in `paths` into the new folder `out`; return the rows written.

    Raises:
        MergeError: where the runs differ in what has to be the same.
        ResultsError: for a folder that is no run, or has a damaged file.
    """
    if len({path.resolve() for path in paths}) < max(2, len(paths)):
        raise MergeError("name two or more different folders")
    folders = [RunFolder(path) for path in paths]
    configs = [_config_of(folder) for folder in folders]
    config = _joined(paths, configs) | {"command": command}
    check_entries(folders)
    rows = joined_rows({str(run.path): run.read_rows() for run in folders}, of_machines(config))
    with new_folder(out) as part:
        target, digests = RunFolder(part), dict[str, str]()
        written = (target.rows_path, target.frame_energies_path)
        for run, of_run in zip(folders, configs):
            for name, digest in of_run.get("digests", {}).items():
                if name not in digests and name not in [path.name for path in written]:
                    digests |= copied(name, digest, run.path, part)
        target.write_rows(rows)
        frame_energies.join([run.frame_energies_path for run in folders], target.frame_energies_path)
        digests |= {path.name: digest_of_file(path) for path in written if path.is_file()}
        target.write_config(config | {"digests": digests})
    return rows


def _config_of(folder: RunFolder) -> dict[str, Any]:
    config = folder.read_config()
    if changed := folder.changed(config):
        raise MergeError(f"{folder.path / changed[0]}: is not as the run wrote it; run it again")
    if "merged" in config:
        raise MergeError(f"{folder.path}: is merged already; name the runs that it came of")
    return config


def _joined(paths: Sequence[Path], configs: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Return run.json of the merged folder. Raises MergeError for entries that should be equal."""
    first, joined = configs[0], {name: dict[str, Any]() for name in JOINED}
    for path, config in zip(paths, configs):
        for name in SAME:
            if config.get(name) != first.get(name):
                values = (
                    f"{path} ({str(config.get(name))[:60]}) than in {paths[0]} ({str(first.get(name))[:60]})"
                )
                raise MergeError(f"another {name.replace('_', ' ')} in {values}")
        for name in JOINED:
            where = f"{name.replace('_', ' ')} of {path}"
            _join(joined[name], config.get(name) or {}, where, strict=name in STRICT)

    def each(name: str) -> list[Any]:
        values = [value for config in configs for value in config.get(name) or ()]
        return [value for k, value in enumerate(values) if value not in values[:k]]

    kept = ("command", "commit", "started", "finished", "hardware", "versions", "seeds", "stages")
    of_first = {name: value for name, value in first.items() if name not in ("started", "cells", "stages")}
    return of_first | joined | {
        "suites": each("suites"),
        "seeds": sorted(each("seeds")),
        "finished": max(str(config.get("finished") or "") for config in configs),
        "earlier": [],
        "test_looks": each("test_looks"),
        "merged": [{name: config.get(name) for name in kept} for config in configs],
    }  # fmt: skip


def _join(joined: dict[str, Any], other: Mapping[str, Any], where: str, *, strict: bool) -> None:
    """Add the entries of `other` that are not in `joined`, inside of dictionaries too."""
    for name, value in other.items():
        if isinstance(value, dict) and isinstance(joined.get(name), dict):
            _join(joined[name], value, f"{name} among {where}", strict=strict)
        elif strict and joined.get(name, value) != value:
            raise MergeError(f"another {name} among {where} than in the runs before it")
        else:
            joined.setdefault(name, deepcopy(value))


def check_entries(folders: Iterable[RunFolder]) -> None:
    """Raise MergeError where two tasks came of other code or packages, or one task of other inputs.

    The machine on which a task ran is no such input, but a network has one set of weights: of one
    seed, processors of two kinds train two networks.
    """
    seen: dict[Any, tuple[str, Path]] = {}
    files: dict[Path, tuple[dict[str, str], Path]] = {}
    for folder in folders:
        paths = sorted(folder.cache.rglob("*.json"))
        if not paths:
            raise MergeError(f"{folder.path}: has no cache/, which says what its results came of")
        for path in paths:
            entry = read_entry(path)
            if entry is None:
                raise MergeError(f"{path}: damaged, or of an earlier version; run it again with --fresh")
            place = path.relative_to(folder.cache)
            if place.parts[0] == TrainNetwork.kind:
                names, where = files.setdefault(place, (entry["files"], folder.path))
                if names != entry["files"] and not _equal_weights(where, folder.path, names):
                    difference = f"{entry['task']}: other weights in {folder.path} than in {where}"
                    raise MergeError(f"{difference}: run one of them with --trained and the other's folder")
            for name, value in entry["parts"].items():
                key = (place, name) if name in entry["inputs"] else name
                before, where = seen.setdefault(key, (value, folder.path))
                if before != value and name != MACHINE:
                    difference = f"{entry['task']}: another {name} in {folder.path} than in {where}"
                    raise MergeError(
                        f"{difference}: run both by the same code; --fresh forgets what is older"
                    )


def _equal_weights(one: Path, other: Path, names: Iterable[str]) -> bool:
    """Return whether the files of these names hold the same weights; their headers have times."""
    import torch

    from snug.networks.tensor_file import read_tensors

    for name in names:
        first, second = (read_tensors(folder / name)[0] for folder in (one, other))
        if first.keys() != second.keys() or not all(torch.equal(first[key], second[key]) for key in first):
            return False
    return True


def of_machines(config: Mapping[str, Any]) -> frozenset[str]:
    """Return the metrics of a run that are numbers of the machine, as every time."""
    declared = {name for name, entry in config["metrics"].items() if entry.get("of") == "machine"}
    return frozenset(declared | CASE_TIMES)


def joined_rows(runs: Mapping[str, Sequence[Row]], timed: frozenset[str]) -> list[Row]:
    """Return each row once; of metrics `timed` those of one machine. Raises MergeError for other numbers.

    runs: folder -> its rows, in the order in which machines are preferred.
    """
    kept: dict[tuple[Any, ...], tuple[Row, str]] = {}
    machine: dict[str, str] = {}
    for where, rows in runs.items():
        for row in rows:
            key = (row.suite, row.scene, row.method, row.seed, row.metric)
            if earlier := kept.get(key):
                _compare(earlier, (row, where), of_a_machine=row.metric in timed)
            kind = row.metric if row.metric in BEFORE_FRAMES else row.suite
            # A time that its author declared is of no machine.
            measured = row.metric in timed and row.value is not None and not row.declared
            if measured and (first := machine.setdefault(kind, row.hardware)) != row.hardware:
                reason = f"{row.value:.4g} {row.unit} on {row.hardware}; other times are of {first}"
                row = replace(row, value=None, uncertainty=None, moved=(), status="skipped", reason=reason)
            if earlier is None or _information(row) > _information(earlier[0]):
                kept[key] = (row, where)
    return [row for row, _ in kept.values()]


def _information(row: Row) -> tuple[bool, bool]:
    """Return a key that is larger of a row that says more."""
    return row.status != "skipped", row.uncertainty is not None


def _compare(one: tuple[Row, str], other: tuple[Row, str], *, of_a_machine: bool) -> None:
    """Raise MergeError for other numbers in one cell; of times, where it ended well on one machine alone."""
    if "skipped" in (one[0].status, other[0].status):
        return
    names = [field.name for field in fields(Row) if field.name not in OF_ONE_RUN]
    for column in ("status", *(() if of_a_machine else names)):
        if (a := getattr(one[0], column)) != (b := getattr(other[0], column)):
            row = one[0]
            cell = f"{row.scene} x {row.method} seed {row.seed} / {row.metric}"
            raise MergeError(f"{cell}: {column} {a} in {one[1]}, {b} in {other[1]}")


def copied(name: str, digest: str, source: Path, target: Path) -> dict[str, str]:
    """Copy a file of a folder into another; return its name and digest, nothing where it is not there.

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
