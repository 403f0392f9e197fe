"""Entry: a folder with entry.toml and roll-outs, or a program that makes them; what is wrong with it."""

from __future__ import annotations

import json
import math
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import Any

from benchmarks.external.roll_out_files import (
    PLACE,
    FileConventions,
    RollOutFileError,
    RollOutOption,
    first_not_finite,
    read_roll_out,
)
from benchmarks.methods.outside.stored_roll_out import Stored
from benchmarks.plan.make_plan import make_plan
from benchmarks.plan.plan import Plan
from benchmarks.plan.study import read_study
from benchmarks.presets import find_preset
from benchmarks.provenance import digest_of_file
from benchmarks.results.protocol import NUMBER
from benchmarks.results.row import ResultsError
from benchmarks.results.run_folder import RunFolder
from snug.motion.library import TEST

PRESET = find_preset("quick")
SCENES = tuple(f"tshirt/{motion}" for motion in TEST[: PRESET.test_motions])  # of a full entry
MEASURED_BESIDE = ("simulation", "skinning")  # of which relative excess is made
METADATA = "entry.toml"
KINDS = {str: "a text that is not empty", float: "a number above 0", tuple: "a list that is not empty"}


class EntryError(ValueError):
    """A folder that is no entry; the message names file and remedy."""


@dataclass(frozen=True, kw_only=True)
class Metadata:
    """Fields of entry.toml; those with a default may be left out.

    Attributes:
        title: name for people.
        authors, description: who, and what in one sentence.
        url: of code or report, or where in this repository.
        training_data: what the method has learned from; "none".
        hardware: of the declared time.
        protocol: number of the protocol that the roll-outs were made by.
        milliseconds: a frame, as the authors declare them.
        seeds: of the trainings; one where roll-outs are files.
        roll_outs: path of the files below the folder, with {scene}.
        program: a Python file that declares one method, instead of files (docs/extend.md).
        scenes: those that the entry covers; all by default.
    """

    title: str
    authors: str
    description: str
    url: str
    training_data: str
    hardware: str
    protocol: str
    milliseconds: float
    seeds: tuple[int, ...]
    roll_outs: str = ""
    program: str = ""
    scenes: tuple[str, ...] = ()


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
    def full(self) -> bool:
        """True where it covers all scenes."""
        return set(self.scenes) == set(SCENES)

    @property
    def scores(self) -> RunFolder:
        """Folder of the scores: results.csv and run.json, as of a run."""
        return RunFolder(self.path / "scores")

    def digests(self) -> dict[str, str]:
        """Return file -> digest of all that is scored: roll-outs, or the program and what lies beside it."""
        scores = self.scores
        written = {self.path / METADATA, scores.rows_path, scores.config_path, scores.page_path}
        return {
            path.relative_to(self.path).as_posix(): digest_of_file(path)
            for path in sorted(self.path.rglob("*"))
            if path.is_file() and path not in written and "__pycache__" not in path.parts
        }

    def plan(self, folder: Path) -> Plan:
        """Return the plan that scores the entry: beside the simulation and skinning, without a clock.

        Raises:
            ValueError: one line for what cannot be met.
        """
        metadata = self.metadata
        option = RollOutOption(
            self.name, str(self.path / metadata.roll_outs), FileConventions(), metadata.milliseconds
        )
        programs = (str(self.path / metadata.program),) if metadata.program else ()
        study = replace(
            read_study("full"),
            scenes=self.scenes,
            methods=(*MEASURED_BESIDE, *programs),
            seeds=metadata.seeds if metadata.program else (0,),
            rollouts={} if metadata.program else {option.name: option},
            sizes=PRESET,
        )
        plan = make_plan(study, folder=folder)
        cells = []
        for cell in plan.cells:
            mine = cell.method not in MEASURED_BESIDE
            if mine and cell.method != self.name:
                raise EntryError(
                    f"{self.path / metadata.program}: declares method '{cell.method}': one of the folder's "
                    f"name, '{self.name}', is expected"
                )
            declared = metadata.milliseconds if mine else None
            cells.append(replace(cell, entry=replace(cell.entry, timed=False, declared_ms=declared)))
        return replace(plan, cells=tuple(cells))


def read_entry(path: Path) -> tuple[Entry | None, list[str]]:
    """Read the metadata of an entry.

    Returns:
        The entry, None where a field is not what it should be, and a line for each such field.

    Raises:
        EntryError: no such folder or file, or no TOML.
    """
    file = path / METADATA
    try:
        table = tomllib.loads(file.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise EntryError(f"{file}: no such file: an entry is a folder with {METADATA}, see --help") from None
    except (OSError, ValueError) as error:
        raise EntryError(f"{file}: not readable as TOML ({' '.join(str(error).split())})") from None
    faults = [f"{file}: {fault}" for fault in _faults_of_fields(table)]
    if faults:
        return None, faults
    listed: dict[str, Any] = {
        name: tuple(value) if isinstance(value, list) else value for name, value in table.items()
    }
    return Entry(path, Metadata(**listed)), []


def _faults_of_fields(table: Mapping[str, Any]) -> Iterator[str]:
    known = {field.name: field for field in fields(Metadata)}
    for name in table.keys() - known.keys():
        yield f"unknown field '{name}': choose from {', '.join(known)}"
    optional = ("roll_outs", "program", "scenes")
    for name in known:
        if name not in table:
            if name not in optional:
                yield f"field '{name}' is absent: give it, see docs/entries.md"
            continue
        value = table[name]
        kind = {"milliseconds": float, "seeds": tuple, "scenes": tuple}.get(name, str)
        fits = {
            str: isinstance(value, str) and bool(value.strip()),
            float: type(value) in (int, float) and math.isfinite(value) and value > 0,
            tuple: isinstance(value, list) and bool(value),
        }[kind]
        if not fits:
            yield f"{name} = {value!r}: give {KINDS[kind]}"
    yield from _faults_of_values(table)


def _faults_of_values(table: Mapping[str, Any]) -> Iterator[str]:
    protocol, roll_outs, program = (table.get(name) for name in ("protocol", "roll_outs", "program"))
    if isinstance(protocol, str) and protocol != NUMBER:
        yield (
            f"protocol = '{protocol}': this is protocol {NUMBER}: make the roll-outs again with its scenes, "
            f"and say '{NUMBER}'"
        )
    if bool(roll_outs) == bool(program):
        yield "give either roll_outs = 'roll-outs/{scene}.npz' or program = 'method.py'"
    if isinstance(roll_outs, str) and roll_outs and PLACE not in roll_outs:
        yield f"roll_outs = '{roll_outs}': has no {PLACE}: name one file for each scene"
    for name, given in (("roll_outs", roll_outs), ("program", program)):
        if isinstance(given, str) and (Path(given).is_absolute() or ".." in Path(given).parts):
            yield f"{name} = '{given}': lies outside of the entry's folder: put it there"
    seeds, scenes = table.get("seeds"), table.get("scenes")
    if isinstance(seeds, list) and not all(type(seed) is int and seed >= 0 for seed in seeds):
        yield f"seeds = {seeds}: give whole numbers, 0 or more"
    elif isinstance(seeds, list) and roll_outs and len(seeds) > 1:
        yield f"seeds = {seeds}: files are roll-outs of one seed: give one; another seed is another entry"
    for scene in scenes if isinstance(scenes, list) else ():
        if scene not in SCENES:
            yield f"scenes has '{scene}': choose from {', '.join(SCENES)}"


def faults_of(path: Path, folder: Path, *, scores: bool = True) -> tuple[Entry | None, list[str]]:
    """Return the entry, None where its metadata is wrong, and a line for each fault; nothing is simulated.

    Args:
        path: of the entry.
        folder: that a run would take; it need not exist.
        scores: whether the entry is compared with what was scored.

    Raises:
        EntryError: the folder is no entry.
    """
    entry, faults = read_entry(path)
    if entry is None:
        return None, faults
    if entry.metadata.program:
        faults = list(_faults_of_program(entry, folder))
    else:
        faults = list(_faults_of_files(entry, folder))
    return entry, [*faults, *(faults_of_scores(entry) if scores else ())]


def _faults_of_program(entry: Entry, folder: Path) -> Iterator[str]:
    try:
        entry.plan(folder)
    except ValueError as error:
        yield " ".join(str(error).split())


def _faults_of_files(entry: Entry, folder: Path) -> Iterator[str]:
    """Yield what is wrong with each file; those that can be read are compared with their scenes."""
    readable = []
    for scene in entry.scenes:
        path = entry.path / RollOutOption("x", entry.metadata.roll_outs, FileConventions()).path_for(scene)
        if not path.exists():
            yield f"{path}: no such file: add it, or leave out {scene} of scenes"
            continue
        try:
            positions = read_roll_out(path).positions
        except RollOutFileError as error:
            yield str(error)
            continue
        readable.append((scene, path))
        if place := first_not_finite(positions):
            frame, vertex = place
            yield f"{path}: vertex {vertex} of frame {frame} is not finite: a roll-out is whole"
    if not readable:
        return
    covered = Entry(entry.path, replace(entry.metadata, scenes=tuple(scene for scene, _ in readable)))
    try:
        plan = covered.plan(folder)
    except ValueError as error:
        yield " ".join(str(error).split())
        return
    assets = plan.open_assets() if plan.garments else None
    scenes = {scene.name: scene for scene in plan.scenes}
    for name, path in readable:
        try:
            Stored(str(path), FileConventions()).prepare(scenes[name].build(assets))
        except RollOutFileError as error:
            yield str(error)


def faults_of_scores(entry: Entry) -> Iterator[str]:
    """Yield what differs from what was scored; nothing without scores."""
    if not entry.scores.config_path.is_file():
        return
    try:
        config = entry.scores.read_config()
    except ResultsError as error:
        yield str(error)
        return
    if (number := (config.get("protocol") or {}).get("number")) != NUMBER:
        yield f"{entry.scores.path}: scores of protocol {number}, this is {NUMBER}: score with --replace"
    changed = list(entry.scores.changed(config))
    for name in changed:
        yield f"{entry.scores.path / name}: is not as it was written: score with --replace"
    try:
        scored = {row.method for row in entry.scores.read_rows()}
    except ResultsError as error:
        yield f"{error}: score with --replace"
    else:
        if not changed and entry.name not in scored:
            remedy = "give the folder its old name, or score with --replace"
            yield f"{entry.scores.path}: no scores of '{entry.name}': {remedy}"
    metadata, before = json.loads(json.dumps(asdict(entry.metadata))), config.get("metadata") or {}
    for name in metadata:
        if metadata[name] != before.get(name):
            yield f"{entry.path / METADATA}: {name} is not what was scored: score with --replace"
    then, now = config.get("entry") or {}, entry.digests()
    for name in sorted(then.keys() | now.keys()):
        if then.get(name) != now.get(name):
            what = "is not the file that was scored" if name in then else "was not there when it was scored"
            if name not in now:
                what = "was scored and is gone"
            yield f"{entry.path / name}: {what}: put it right, or score with --replace"
