"""Generated parts of a document: sentences of page one, a table of a run, the claims of the paper.

`front of RUN` (the answer of README), `table NAME of RUN; COLUMN, ...; METHOD, ...` (all where none is named;
of table `overview`, METHODs of several runs), `claims primary of RUN, ...`, `claims exploratory of RUN, ...`,
`counts of RUN, ...`, `runs of RUN, ...`; RUN is a folder of reports/published, and the first run that has
both methods of a claim judges it. `attributes of MODULE.CLASS`, `docstring of MODULE` (its table),
`recipes of NAME, ...`, `sources of the library` and the parts that `code_parts.PARTS` names come from the
code, `evaluations of published runs` from the run.json of each run; `attributes` and `options of
benchmarks.run` take names after a semicolon, whose rows alone are shown, in that order.

Parts of a document that are generated: between two comments, the first of which says from what.

<!-- generated: table overview of quick; method, relative_excess -->
...
<!-- end of generated -->
"""

from __future__ import annotations

import csv
import math
import re
from collections import Counter
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from io import StringIO
from itertools import chain
from pathlib import Path

from benchmarks.results.run_folder import RunFolder
from reports.blocks.sentences import ALIKE, GAP, SWING, secondary_motion
from reports.run.finished_run import Run
from reports.statistics.effects import RATIO
from reports.statistics.means_and_spreads import mean_of
from reports.statistics.outcomes import PUBLISHED, read_published
from reports.statistics.paper_claims import BEFORE, EXPLORATORY, PRIMARY, Claim, Judged, in_words, judged
from reports.statistics.pareto import NETWORK, compared_scenes, fastest, points_of, run_time, truncated
from reports.statistics.relative_excess import excess_of, with_relative_excess
from reports.statistics.verdicts import compare_methods, measure_of
from reports.tables import TABLES
from reports.tables.page_one_table import overview
from reports.tables.pivots import metric_tables
from reports.tables.table import DASH, Table, number
from reports.text.code_parts import PARTS, attribute_rows, chosen_rows, docstring_rows, recipe_rows
from reports.text.run_page import origins
from reports.text.text_table import markdown_table, remarks_on, text_rows
from snug.motion.library import clip_rows, source_rows

HEAD = ["Claim", "Tested", "Effect", "Interval", "p", "Verdict", "Run"]
NOT_MEASURED = "not measured"
TIMES = ("s", "ms")  # units


@dataclass(frozen=True)
class JudgedClaims:
    """Claims as several runs judge them.

    Attributes:
        verdicts: claim -> name of the first run that has both of its methods, and the claim as it came out.
        labels: method -> its name for people.
        metrics: metric -> its title, with its unit.
    """

    verdicts: Mapping[Claim, tuple[str, Judged]]
    labels: Mapping[str, str]
    metrics: Mapping[str, str]


def judge_in_first(runs: Sequence[tuple[str, Run]], timed: Collection[str]) -> JudgedClaims:
    """Judge each claim by the first of these (name, run) that has both of its methods.

    timed: names of the runs that judge claims on times. A run that shared its machine with other work judges
        none: its methods may have had different shares of the processors.
    """
    verdicts: dict[Claim, tuple[str, Judged]] = {}
    labels: dict[str, str] = {}
    metrics = {BEFORE.name: BEFORE.heading}
    for name, run in runs:
        for line in judged(run):
            if name in timed or line.compared.metric.unit not in TIMES:
                verdicts.setdefault(line.claim, (name, line))
        labels = {method: run.label(method) for method in run.methods} | labels
        metrics |= {metric.name: metric.heading for metric in run.metrics.values()}
    return JudgedClaims(verdicts, labels, metrics)


def claim_rows(claims: JudgedClaims, *, primary: bool) -> list[list[str]]:
    """Return a heading and a row of each claim, judged or not: of the primary family, or exploratory."""
    return [HEAD, *(_row(claim, claims) for claim in (PRIMARY if primary else EXPLORATORY))]


def claim_counts(claims: JudgedClaims) -> str:
    """Return how many tests of claims came out how, those of the primary ones first."""
    lines = []
    for name, family in (("primary", PRIMARY), ("exploratory", EXPLORATORY)):
        counts = Counter(claims.verdicts[claim][1].verdict for claim in family if claim in claims.verdicts)
        absent = len(family) - counts.total()
        texts = [
            in_words(counts),
            f"{absent} {'is' if absent == 1 else 'are'} {NOT_MEASURED}" if absent else "",
        ]
        lines.append(f"Tests of {name} claims: {', '.join(filter(None, texts))}.")
    return "\n".join(lines)


def _row(claim: Claim, claims: JudgedClaims) -> list[str]:
    lower, higher = (claims.labels.get(method, method) for method in (claim.lower, claim.higher))
    relation = f"{lower} {claim.relation} {higher}"
    if claim not in claims.verdicts:
        heading = claims.metrics.get(claim.metric, claim.metric)
        return [claim.says, f"{heading}: {relation}", DASH, DASH, DASH, NOT_MEASURED, DASH]
    name, line = claims.verdicts[claim]
    far = line.compared.effect
    effect, interval = DASH, DASH
    if far is not None:
        effect = ("×" if far.scale == RATIO else "") + number(far.shown)
        interval = " to ".join(number(end) for end in far.interval or ()) or DASH
    p = DASH if line.p is None else number(line.p, 2)
    tested = f"{measure_of(line.compared).heading}: {relation}"
    return [claim.says, tested, effect, interval, p, line.verdict + line.remark, name]


def front_sentences(run: Run) -> str:
    """Return the verdict on SNUG and two bullets, as Markdown.

    Args:
        run: has SNUG, PBNS and the supervised network in whole motions, and SNUG beside solvers in clips.

    Raises:
        ValueError: a number of these is missing.
    """
    worn, cells = run.garment_rows, run.cells("speed", "garments")
    rows = with_relative_excess(run, worn)
    snug, pbns, supervised = (excess_of(run, rows, name) for name in (NETWORK, "pbns", "supervised"))
    swing, alike = (mean_of(worn, NETWORK, name) for name in (SWING, ALIKE))
    scenes = next(iter(compared_scenes(run, cells).values()), [])
    timed = cells[cells["scene"].isin(scenes)]
    points = points_of(run, cells, scenes, GAP)
    network = next((point for point in points if point.method == NETWORK), None)
    solver = fastest(truncated(run, points), network.error) if network else None
    faster = compare_methods(run, timed, run.metrics[run_time(timed)], run.reference, NETWORK).effect
    if not (snug and pbns and supervised and swing and alike and network and solver and faster):
        raise ValueError("the run lacks SNUG, PBNS, the supervised network, or their times beside solvers")
    worst, most = snug.worst
    least = min(faster.interval or (faster.shown,))
    power = 10 ** math.floor(math.log10(least))
    times = power * math.floor(least / power)  # one digit: the simulation's time is uncertain by half
    return "\n".join([
        f"**In a typical unseen motion SNUG removes {number(100.0 - snug.typical, 2)} % of the energy that "
        f"skinning has in excess of a converged simulation ({number(100.0 - snug.pooled, 2)} % pooled over "
        f"all motions), more than {times} times faster than that simulation; its garments have "
        f"{secondary_motion(swing.value)} secondary motion.**",
        "",
        f"- Good at: energy for its time. PBNS leaves {number(pbns.typical, 2)} % of that excess, the "
        f"supervised network {number(supervised.typical, 2)} %; solvers as accurate take at least "
        f"{number(solver.time / network.time, 1)} times as long.",
        f"- Bad at: dynamics and unfamiliar motion. Its hem moves {number(100.0 * swing.value, 1)} % as far "
        f"as the simulation's (correlation {number(alike.value, 2)}); the worst motion, "
        f"{worst.partition('/')[2]}, keeps {number(most, 2)} %.",
    ])  # fmt: skip


FORMS = (
    "front of RUN; table NAME of RUN; COLUMN, ...; METHOD, ...; claims primary of RUN, ...; claims "
    "exploratory of RUN, ...; counts of RUN, ...; runs of RUN, ...; attributes of MODULE.CLASS; NAME, ...; "
    "docstring of MODULE; recipes of NAME, ...; sources of the library; evaluations of published runs; "
    f"{'; '.join(PARTS)}"
)

LIBRARY_FILES = {"library_clips.csv": clip_rows}  # in docs/
TIMED = ("quick",)  # runs with nothing beside them, which judge claims on times
ORIGIN = ("Run", "Day", "Commit", "Processor")  # heads


def published_part(request: str) -> str:
    """Return the Markdown of a generated part. Raises ValueError for words of no known form."""
    what, _, source = request.partition(" of ")
    runs, *lists = source.split(";")
    wanted, methods = (
        [word.strip() for word in text.split(",") if word.strip()] for text in (*lists, "", "")[:2]
    )
    folders = [PUBLISHED / name.strip() for name in runs.split(",")]
    kind, _, name = what.partition(" ")
    if (part := request.partition(";")[0]) in PARTS:
        return markdown_table(chosen_rows(PARTS[part](), wanted))
    if kind == "docstring":
        return markdown_table(docstring_rows(source))
    if kind == "recipes":
        return markdown_table(recipe_rows(source))
    if kind == "attributes":
        return markdown_table(chosen_rows(attribute_rows(runs), wanted))
    if request == "sources of the library":
        return markdown_table(list(source_rows()))
    if request == "evaluations of published runs":
        return markdown_table(evaluation_rows(PUBLISHED))
    if kind == "front":
        return front_sentences(read_published(folders[0]))
    if what == "table overview" and methods:
        return _overview(folders, wanted, methods)
    if kind == "table":
        table = _of_methods(_table(folders[0], name), methods)
        rows = text_rows(read_published(folders[0]), table, wanted)
        return f"{markdown_table(rows)}\n\n{' '.join(filter(None, [table.caption, remarks_on(rows)]))}"
    if kind == "claims":
        return markdown_table(claim_rows(_claims(*folders), primary=name == "primary"))
    if kind == "counts":
        return claim_counts(_claims(*folders))
    if kind == "runs":
        parts = [(folder, part) for folder in folders for part in origins(RunFolder(folder).read_config())]
        lines = dict.fromkeys((folder.name, *part[:3]) for folder, part in parts)
        return markdown_table([ORIGIN, *lines])
    raise ValueError(f"no part is generated from '{request}'; known: {FORMS}")


def library_file(name: str) -> str:
    """Return the text of a CSV file of LIBRARY_FILES."""
    text = StringIO()
    rows = ([cell.strip("`") for cell in row] for row in LIBRARY_FILES[name]())
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue()


def evaluation_rows(published: Path) -> list[tuple[str, ...]]:
    """Return a heading and rows of the runs in a folder: how often each evaluated test motions.

    Runs of one protocol and split with the same number of test-set evaluations share a row.
    """
    runs: dict[tuple[str, str, str], list[str]] = {}
    for path in sorted(published.glob("*/run.json")):
        config = RunFolder(path.parent).read_config()
        group = config["protocol"]["number"], str(config["split"]), str(len(config["test_looks"]))
        runs.setdefault(group, []).append(f"`{path.parent.name}`")
    lines = [(*group, ", ".join(runs[group])) for group in sorted(runs)]
    return [("Protocol", "Split", "Test-set evaluations", "Runs"), *lines]


def _overview(folders: Sequence[Path], wanted: Sequence[str], methods: Sequence[str]) -> str:
    """Return the table of page one with these methods, each from the first run that has it."""
    tables: list[list[list[str]]] = []
    places: dict[str, list[str]] = {}
    for run in map(read_published, folders):
        own = [name for name in methods if name in run.methods and name not in places]
        rows = text_rows(run, overview(run, own)[0], wanted)
        tables.append(rows)
        places |= dict(zip(run.ordered(own), rows[1:]))
    if absent := [name for name in methods if name not in places]:
        raise ValueError(f"no run of {', '.join(folder.name for folder in folders)} has {absent[0]}")
    if any(rows[0] != tables[0][0] for rows in tables):
        raise ValueError(f"runs {', '.join(folder.name for folder in folders)} have other columns")
    return markdown_table([tables[0][0], *(places[name] for name in methods)])


@cache
def _claims(*folders: Path) -> JudgedClaims:
    return judge_in_first([(folder.name, read_published(folder)) for folder in folders], TIMED)


def _of_methods(table: Table, methods: Sequence[str]) -> Table:
    """Return the table with the rows of these methods alone, of all where none is named.

    Raises:
        ValueError: for a method that the table has not.
    """
    place = next((place for place, column in enumerate(table.columns) if column.method), 0)
    known = {str(row[place]) for row in table.rows}
    if absent := [name for name in methods if name not in known]:
        raise ValueError(f"table {table.name} has no row of {absent[0]}; it has {', '.join(sorted(known))}")
    return replace(table, rows=tuple(row for row in table.rows if not methods or row[place] in methods))


@cache
def _table(folder: Path, name: str) -> Table:
    """Return a table of a run, having made no more tables than it takes to meet it."""
    run = read_published(folder)
    # Metrics declare many; most others have the name of the function that makes them.
    makers = sorted(TABLES, key=lambda make: getattr(make, "__name__", "") != name)
    of_others = chain.from_iterable(make(run) for make in makers)
    names = []
    for table in chain(metric_tables(run, name.removesuffix("_by_scene")), of_others):
        if table.name == name:
            return table
        names.append(table.name)
    raise ValueError(f"run {folder.name} has no table {name}; it has {', '.join(names)}")


BEGIN, END = "<!-- generated: {} -->", "<!-- end of generated -->"
_PART = re.compile(rf"({BEGIN.format('(.+?)')}\n)(.*?)({END})", re.S)


def fill(document: str, generate: Callable[[str], str]) -> str:
    r"""Return the document with each generated part made anew by `generate` from what its comment says.

    Raises:
        ValueError: for a part without an end.

    >>> text = "A\n<!-- generated: sum -->\n3\n<!-- end of generated -->\nB"
    >>> fill(text, lambda words: "4").splitlines()[2]
    '4'
    """
    if document.count("<!-- generated: ") != document.count(END):
        raise ValueError(f"each '<!-- generated: ... -->' needs an '{END}' below it")
    return _PART.sub(lambda part: f"{part[1]}{generate(part[2]).strip()}\n{part[4]}", document)
