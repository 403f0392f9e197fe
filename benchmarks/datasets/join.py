"""Joining data sets that several machines have built."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from pathlib import Path

from benchmarks.merge import MergeError, check_entries, copied
from benchmarks.results.run_folder import RunFolder
from benchmarks.runner.cache import read_entry
from benchmarks.tasks.sequence import SimulateSequence
from snug.training.simulated_data import MISSING, DataSet, SimulatedSequence


def merge(paths: Sequence[Path], out: Path) -> DataSet:
    """Their sequences in a new folder. Raises ValueError, one line, where cloth, code or bytes differ."""
    sets = [DataSet.read(path) for path in paths]
    for other in sets[1:]:
        other.check(sets[0].settings)
    check_entries([RunFolder(found.folder) for found in sets])
    taken: dict[str, tuple[SimulatedSequence, Path]] = {}
    for found in sets:
        for line in found.sequences:
            there, where = taken.get(line.name, (SimulatedSequence(line.name), found.folder))
            if there.status == MISSING:
                taken[line.name] = line, found.folder
            elif line.status != MISSING and line.digests != there.digests:
                raise MergeError(f"sequence {line.name}: other bytes in {found.folder} than in {where}")
    commands = dict.fromkeys(command for found in sets for command in found.commands)
    lines = tuple(line for line, _ in taken.values())
    from reference_sim.files.atomic_files import new_folder

    with new_folder(out) as part:
        for line, source in taken.values():
            for name, digest in line.digests.items():
                if not copied(name, digest, source, part):
                    raise MergeError(f"{source / name}: is gone; make it again there")
        _copy_entries({line.name: source for line, source in taken.values()}, part)
        DataSet(part, sets[0].settings, lines, tuple(commands)).write()
    return DataSet.read(out)


def _copy_entries(taken: dict[str, Path], part: Path) -> None:
    """What came of each sequence, from the folder that it is taken from: building goes on with it."""
    titles = {f"{SimulateSequence.kind} {name}": source for name, source in taken.items()}
    for source in dict.fromkeys(taken.values()):
        cache = RunFolder(source).cache
        for path in cache.rglob("*.json"):
            entry = read_entry(path)
            if entry and titles.get(entry["task"]) == source:
                target = RunFolder(part).cache / path.relative_to(cache)
                target.parent.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(path, target)
