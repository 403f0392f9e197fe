"""python -m reports.check RUN: what a reader of the run's numbers would miss, before they are published."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import pandas as pd

from benchmarks.results.run_folder import RunFolder
from reference_sim.command.command_line import Parser, command
from reports.run.read import read_run
from reports.run.rows import Run
from reports.statistics.pareto import REPEATS, TIME

SHOWN = 4  # names in a line
CELL = ["suite", "scene", "method", "seed"]
EXAMPLES = """examples:
  python -m reports.check reports/runs/NAME

Each line is one finding:
  files     not as the run or the report wrote them; tables that are not what results.csv gives
  unit      none, or not one for all rows of a metric, or not the declared one
  seeds     of a trained method, that others have and it has not
  hardware  a row that does not say where and with what it was measured; times of several machines
  spread    one seed; run times taken once; scenes in which nothing says how sure the reference is
  skips     a row that did not end well and gives no reason; a method without any row where others have one
  numbers   of report.html or report.pdf that are in no CSV of the run
The page is read cell by cell. Numbers of the PDF are looked for among all CSV files, by three digits and
more: a weak test, for of random ones from .01 to 100 nine in ten are there in a run of four suites. It takes
pip install pypdfium2.
exit status: 0 nothing found; 1 something; 2 the folder is no run."""


def findings(folder: RunFolder, run: Run) -> Iterator[tuple[str, str]]:
    """(topic, finding) of everything that can be checked."""
    from reports.check_numbers import numbers_of_pages, tables_as_made

    for topic, check in (("unit", units), ("seeds", seeds), ("hardware", hardware), ("spread", spread),
                         ("skips", skips)):  # fmt: skip
        yield from ((topic, said) for said in check(run))
    if run.changed:
        yield "files", f"not as the run wrote them: {_names(run.changed)}"
    yield from (("files", said) for said in tables_as_made(folder, run))
    yield from (("numbers", said) for said in numbers_of_pages(folder))


def units(run: Run) -> Iterator[str]:
    """Of metrics; a case has the unit of its own row."""
    declared = run.config.get("metrics") or {}
    rows = run.frame
    if len(none := rows[rows["unit"] == ""]):
        yield f"{len(none)} rows have none: {_names(none['metric'])}"
    rows = rows[(rows["case"] == "") & rows["usable"] & (rows["unit"] != "")]
    for metric, own in rows.groupby("metric", sort=False)["unit"]:
        found = sorted(set(own))
        said = (declared.get(metric) or {}).get("unit")
        if len(found) > 1 or (said and found != [said]):
            yield f"{metric} has {' and '.join(found)}" + (f", declared is {said}" if said else "")


def seeds(run: Run) -> Iterator[str]:
    """Those that a trained method lacks of all that the run has."""
    rows = run.frame[run.frame["seeded"] & (run.frame["status"] != "skipped")]
    asked = {int(seed) for seed in rows["seed"]}
    for (scene, method), own in rows.groupby(["scene", "method"], sort=False)["seed"]:
        if lacking := sorted(asked - {int(seed) for seed in own}):
            yield f"{method} in {scene} has none of seed {_names(map(str, lacking))}"


def hardware(run: Run) -> Iterator[str]:
    """Where each row was measured, and whether times are of one machine."""
    for column in ("preset", "commit", "hardware", "dtype"):
        if len(none := run.frame[run.frame[column] == ""]):
            yield f"{len(none)} rows have no {column}: {_names(none['scene'])}"
    if len(none := run.frame[run.frame["threads"] < 1]):
        yield f"{len(none)} rows have no number of threads: {_names(none['scene'])}"
    times = run.frame[run.frame["unit"].isin(("s", "ms")) & run.frame["value"].notna()]
    machines = set(times["hardware"]) - {""}
    if len(machines) > 1:
        yield f"times are of several machines: {_names(sorted(machines))}"


def spread(run: Run) -> Iterator[str]:
    """What nobody repeated, so that no reader can tell a difference from chance."""
    cells = run.suite("garments", "speed")
    cells = cells[(cells["case"] == "") & cells["usable"]]
    trained = cells[cells["seeded"]]
    single = trained.groupby("method", sort=False)["seed"].nunique()
    if len(single := single[single < 2]):
        yield f"one seed of {_names(single.index)}: run with --seeds 0,1,2"
    timed = cells[(cells["suite"] == "speed") & (cells["metric"] == TIME) & (cells["reason"] == "")]
    repeated = pd.MultiIndex.from_frame(cells[cells["metric"] == REPEATS][CELL])
    once = timed[~pd.MultiIndex.from_frame(timed[CELL]).isin(repeated)]
    if len(once):
        places = (once["method"] + " in " + once["scene"]).tolist()
        yield f"{len(once)} of {len(timed)} run times of suite speed were taken once: {_names(places)}"
    reference = cells[cells["method"] == run.reference].groupby("scene", sort=False)["uncertainty"].count()
    if len(unsure := reference[reference == 0]):
        yield f"nothing says how sure the reference is in {_names(unsure.index)}: it ran there alone"


def skips(run: Run) -> Iterator[str]:
    """Rows without a reason; methods without a row in scenes of a suite in which the reference ran."""
    bad = run.frame[(run.frame["status"] != "ok") & (run.frame["reason"] == "")]
    for (scene, method, status), _ in bad.groupby(["scene", "method", "status"], sort=False):
        yield f"{method} in {scene}: {status}, without a reason"
    for suite in ("garments", "speed"):
        rows = run.suite(suite)
        rows = rows[rows["case"] == ""]
        methods = list(dict.fromkeys(rows["method"]))
        for scene, own in rows.groupby("scene", sort=False)["method"]:
            if run.reference in set(own) and (lacking := [m for m in methods if m not in set(own)]):
                yield f"no row says why {scene} lacks {_names(lacking)}"


def _names(names: Iterable[str]) -> str:
    """The first few, without repeats, and how many more."""
    found = list(dict.fromkeys(names))
    more = f" and {len(found) - SHOWN} more" if len(found) > SHOWN else ""
    return ", ".join(found[:SHOWN]) + more


@command("reports.check")
def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; returns its exit status."""
    parser = Parser(
        prog="python -m reports.check",
        description="What a reader of a run's numbers would miss: units, seeds, hardware, spreads, reasons.",
        epilog=EXAMPLES,
    )
    parser.add_argument("run_dir", metavar="RUN", help="folder of a run")
    options = parser.parse_args(arguments)
    folder = RunFolder(options.run_dir)
    found = list(findings(folder, read_run(folder)))
    for topic, said in found:
        print(f"{topic:10}{said}")
    print(f"{folder.path}: {len(found)} findings" if found else f"{folder.path}: nothing found")
    return 1 if found else 0


if __name__ == "__main__":
    raise SystemExit(main())
