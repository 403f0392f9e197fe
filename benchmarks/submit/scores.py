"""Scores of an entry: rows of a run without clock and machine, compared with those that were recorded."""

from __future__ import annotations

import dataclasses
import math
import shutil
import tempfile
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

from benchmarks.metrics import find_metric
from benchmarks.provenance import digest_of_file, processor_name
from benchmarks.results.protocol import DIGEST, NUMBER
from benchmarks.results.row import USABLE, Row
from benchmarks.results.run_folder import RunFolder
from benchmarks.run import carry_out
from benchmarks.submit.entry import Entry, EntryError

SAME = 1e-6  # relative difference of two scores that are one
SAME_ELSEWHERE = 1e-3  # on another processor: a program's energies, where float32 rounds, and what is beside
SCORED_ON = "scored_on"  # entry of run.json: the processor
ABSOLUTE = 1e-9  # in the unit of a score, where it is nearly 0
DECLARED = "cost/frame"  # the one cost that an entry has: as its authors say
KEPT = ("preset", "metrics", "methods", "scenes", "cases")  # of run.json


def scored(entry: Entry, *, page: bool = False) -> tuple[list[Row], dict[str, Any]]:
    """Score an entry from its vertices, by an ordinary run in a folder that is gone afterwards.

    Args:
        entry: without a fault.
        page: whether the run's page is kept beside the scores.

    Returns:
        Its rows and those of simulation and skinning, and what run.json says of them.

    Raises:
        EntryError: the run could not be carried out, or a roll-out did not come to its last frame: the mean
            over the other scenes would be of easier ones.
    """
    with tempfile.TemporaryDirectory(prefix="scores-") as folder:
        plan = entry.plan(Path(folder) / "run")
        if carry_out(plan, program="benchmarks.submit", report=page) not in (0, 1):
            raise EntryError(f"{entry.path}: was not scored: a line above says why")
        run = RunFolder(plan.folder)
        rows, config = run.read_rows(), run.read_config()
        if page and run.page_path.is_file():
            entry.scores.path.mkdir(exist_ok=True)
            shutil.copyfile(run.page_path, entry.scores.page_path)
    kept = [_bare(row) for row in rows if _is_score(row, entry.name)]
    mine = [row for row in kept if row.method == entry.name]
    for scene in entry.scenes:
        if not any(row.scene == scene and row.value is not None for row in mine):
            why = next((row.reason for row in rows if (row.scene, row.method) == (scene, entry.name)), "")
            raise EntryError(f"{entry.path}: no number in {scene}: {why or 'it did not run'}")
    for row in mine:
        if row.status not in USABLE:
            raise EntryError(f"{entry.path}: {row.scene}, seed {row.seed}: {row.status}: {row.reason}")
    return kept, {name: config.get(name) for name in KEPT}


def _is_score(row: Row, name: str) -> bool:
    of_answer = row.value is None or find_metric(row.metric).of == "answer"
    return of_answer or (row.metric == DECLARED and row.method == name)


def _bare(row: Row) -> Row:
    """Return the row without what the machine that scored it adds."""
    return dataclasses.replace(row, commit="", hardware="")


def scored_elsewhere(entry: Entry) -> bool:
    """Return whether the recorded scores are of another kind of processor."""
    return entry.scores.read_config().get(SCORED_ON) != processor_name()


def tolerance_of(entry: Entry, *, elsewhere: bool) -> Callable[[Row], float]:
    """Return the tolerances of `differences` for an entry; elsewhere: see scored_elsewhere.

    On another kind of processor the simulation parts from the recorded one, and with it all that hangs on it.
    Compared are then the energies of the entry, and the total energies of simulation and skinning, which give
    its relative excess.
    """

    def tolerance(row: Row) -> float:
        if not elsewhere:
            return SAME
        if row.method == entry.name and row.metric.startswith("energy/"):
            return SAME_ELSEWHERE if entry.metadata.program else SAME
        return SAME_ELSEWHERE if row.metric == "energy/total" else math.inf

    return tolerance


def differences(
    recorded: Sequence[Row], now: Sequence[Row], tolerance: Callable[[Row], float] = lambda row: SAME
) -> Iterator[str]:
    """Yield a line for each score that is not the recorded one.

    Args:
        recorded: rows of the scores.
        now: rows of another scoring.
        tolerance: row -> relative difference up to which two values are one; inf: any two values are.

    >>> row = Row("garments", "tshirt/kick", "mine", 0, "energy/strain", "J", value=0.5)
    >>> list(differences([row], [dataclasses.replace(row, value=0.6)]))
    ['mine in tshirt/kick, energy/strain: 0.6, recorded is 0.5']
    """
    before, after = ({_key(row): row for row in rows} for rows in (recorded, now))
    for key in dict.fromkeys((*before, *after)):
        one, other = before.get(key), after.get(key)
        named = one or other
        assert named is not None
        if one is None or other is None or not _same(one, other, tolerance(named)):
            values = [("none" if row is None else _shown(row)) for row in (other, one)]
            yield f"{named.method} in {named.scene}, {named.metric}: {values[0]}, recorded is {values[1]}"


def _key(row: Row) -> tuple[object, ...]:
    return row.suite, row.scene, row.method, row.seed, row.metric


def _same(one: Row, other: Row, tolerance: float) -> bool:
    if (one.status, one.unit, one.protocol) != (other.status, other.unit, other.protocol):
        return False
    if one.value is None or other.value is None:
        return one.value == other.value
    return tolerance == math.inf or math.isclose(one.value, other.value, rel_tol=tolerance, abs_tol=ABSOLUTE)


def _shown(row: Row) -> str:
    return row.status if row.value is None else f"{row.value:.9g}"


def write(entry: Entry, rows: Sequence[Row], config: dict[str, Any]) -> None:
    """Write the scores and the digests of what was scored: the same bytes for the same entry."""
    folder = entry.scores
    folder.path.mkdir(exist_ok=True)
    folder.write_rows(rows)
    metadata = dataclasses.asdict(entry.metadata)
    folder.write_config({
        "protocol": {"number": NUMBER, "digest": DIGEST}, SCORED_ON: processor_name(), **config,
        "metadata": metadata,
        "entry": entry.digests(), "digests": {folder.rows_path.name: digest_of_file(folder.rows_path)},
    })  # fmt: skip
