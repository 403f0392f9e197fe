"""python -m reports.check RUN: gaps in a run's numbers, to be found before they are published."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import pandas as pd

from benchmarks.results.run_folder import RunFolder
from reference_sim.command_line import Parser, command
from reports.run.finished_run import Run
from reports.run.reading import read_run
from reports.statistics.pareto import REPEATS, TIME
from reports.tables import make_tables
from reports.tables.dictionary import dictionary

SHOWN = 4  # names in a line
CELL = ["suite", "scene", "method", "seed"]
EXAMPLES = """examples:
  python -m reports.check reports/runs/NAME

Each line is one finding:
  files     not as the run or the report wrote them; tables that are not what results.csv gives; no report
  unit      none, or not one for all rows of a metric, or not the declared one
  seeds     of a trained method, that others have and it has not
  hardware  a row that does not say where and with what it was measured; times of several machines
  spread    one seed; run times taken once; scenes in which nothing says how sure the reference is
  skips     a row that did not end well and gives no reason; a method without any row where others have one
exit status: 0 nothing found; 1 something; 2 the folder is no run."""


def findings(folder: RunFolder, run: Run) -> Iterator[tuple[str, str]]:
    """Yield (topic, finding) of everything that can be checked."""
    for topic, check in CHECKS.items():
        yield from ((topic, finding) for finding in check(run))
    yield from (("files", finding) for finding in files(folder, run))


def units(run: Run) -> Iterator[str]:
    """Find metrics without one unit; a case has the unit of its own row."""
    declared = run.config.get("metrics") or {}
    rows = run.frame
    if len(none := rows[rows["unit"] == ""]):
        yield f"{len(none)} rows have none: {_names(none['metric'])}"
    rows = rows[(rows["case"] == "") & rows["usable"] & (rows["unit"] != "")]
    for metric, of_metric in rows.groupby("metric", sort=False)["unit"]:
        units_here = sorted(set(of_metric))
        unit = (declared.get(metric) or {}).get("unit")
        if len(units_here) > 1 or (unit and units_here != [unit]):
            yield f"{metric} has {' and '.join(units_here)}" + (f", declared is {unit}" if unit else "")


def seeds(run: Run) -> Iterator[str]:
    """Find seeds that a trained method lacks of all that the run has."""
    rows = run.frame[run.frame["seeded"] & (run.frame["status"] != "skipped")]
    asked = {int(seed) for seed in rows["seed"]}
    for (scene, method), present in rows.groupby(["scene", "method"], sort=False)["seed"]:
        if missing := sorted(asked - {int(seed) for seed in present}):
            yield f"{method} in {scene} has none of seed {_names(map(str, missing))}"


def hardware(run: Run) -> Iterator[str]:
    """Find rows that do not say where they were measured, and times of several machines."""
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
    """Find numbers that nobody repeated, so that a difference cannot be told from chance."""
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
        places = [f"{method} in {scene}" for method, scene in zip(once["method"], once["scene"])]
        yield f"{len(once)} of {len(timed)} run times of suite speed were taken once: {_names(places)}"
    reference = cells[cells["method"] == run.reference].groupby("scene", sort=False)["uncertainty"].count()
    if len(unsure := reference[reference == 0]):
        yield f"nothing says how sure the reference is in {_names(unsure.index)}: it ran there alone"


def skips(run: Run) -> Iterator[str]:
    """Find rows without a reason, and methods without a row in scenes of a suite with the reference."""
    bad = run.frame[(run.frame["status"] != "ok") & (run.frame["reason"] == "")]
    for (scene, method, status), _ in bad.groupby(["scene", "method", "status"], sort=False):
        yield f"{method} in {scene}: {status}, without a reason"
    for suite in ("garments", "speed"):
        rows = run.suite(suite)
        rows = rows[rows["case"] == ""]
        methods = list(dict.fromkeys(rows["method"]))
        for scene, present in rows.groupby("scene", sort=False)["method"]:
            missing = [m for m in methods if m not in set(present)]
            if run.reference in set(present) and missing:
                yield f"no row says why {scene} lacks {_names(missing)}"


def files(folder: RunFolder, run: Run) -> Iterator[str]:
    """Find files that are not as they were written, tables that differ from results.csv, a missing report."""
    if run.changed:
        yield f"not as the run wrote them: {_names(run.changed)}"
    again = f"run python -m reports.build {folder.path}"
    with tempfile.TemporaryDirectory() as temporary:
        for table in (*make_tables(run).values(), dictionary(run)):
            made, path = table.write_csv(Path(temporary)), folder.tables / f"{table.name}.csv"
            if not path.is_file():
                yield f"tables/{path.name} is absent: {again}"
            elif path.read_bytes() != made.read_bytes():
                yield f"tables/{path.name} is not what results.csv gives: {again}"
    for path in (folder.page_path, folder.report_path):
        if not path.is_file():
            yield f"{path.name} is absent: {again}"


CHECKS = {"unit": units, "seeds": seeds, "hardware": hardware, "spread": spread, "skips": skips}


def _names(names: Iterable[str]) -> str:
    """Return the first few names, without repeats, and how many more there are."""
    every = list(dict.fromkeys(names))
    more = f" and {len(every) - SHOWN} more" if len(every) > SHOWN else ""
    return ", ".join(every[:SHOWN]) + more


@command("reports.check")
def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; return its exit status."""
    parser = Parser(
        prog="python -m reports.check",
        description="Find gaps in a run's numbers: units, seeds, hardware, spreads, reasons, files.",
        epilog=EXAMPLES,
    )
    parser.add_argument("run_dir", metavar="RUN", help="folder of a run")
    options = parser.parse_args(arguments)
    folder = RunFolder(options.run_dir)
    every = list(findings(folder, read_run(folder)))
    for topic, finding in every:
        print(f"{topic:10}{finding}")
    print(f"{folder.path}: {len(every)} findings" if every else f"{folder.path}: nothing found")
    return 1 if every else 0


if __name__ == "__main__":
    raise SystemExit(main())
