"""Generated parts of a document: tables of published runs, claims of the paper, texts of the code.

Between two comments, the first of which says from what:

<!-- generated: table overview of quick; method, relative_excess -->
...
<!-- end of generated -->

RUN is a folder of reports/published:

front of RUN                                 the answer of README
table NAME of RUN; COLUMN, ...; METHOD, ...  all where none is named
claims primary of RUN, ...                   or exploratory: by the first run that has both methods,
                                             which the verdict names unless it is the first of these
runs of RUN, ...                             day, commit, evaluations of test motions
times of RUN, ...; METHOD, ...               as published, and by the first run that has the method

From the code come `docstring of MODULE` (its table) and the parts that `PARTS` names.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache
from importlib import import_module
from pathlib import Path

from benchmarks.metrics import list_metrics
from benchmarks.presets import PRESETS
from benchmarks.results.run_folder import RunFolder
from reports.finished_run import Run
from reports.sentences import ALIKE, verdict
from reports.statistics.effects import RATIO
from reports.statistics.means_and_spreads import mean_of
from reports.statistics.outcomes import PUBLISHED, read_published
from reports.statistics.paper_claims import EXPLORATORY, PRIMARY, UNSEEN, Claim, Judged, judge_claims
from reports.statistics.pareto import NETWORK, WHOLE, select_timed
from reports.statistics.relative_excess import add_excess, excess_of
from reports.statistics.verdicts import measure_of
from reports.tables import make_tables
from reports.tables.page_one import overview
from reports.tables.table import DASH, Table, number
from reports.text.published_times import time_rows
from reports.text.text_table import markdown_table, remarks_on, text_rows

TIMED = ("quick", "other_networks")  # judge claims on times: nothing ran beside them
TIMES = ("s", "ms")  # units
FAMILIES = {"primary": PRIMARY, "exploratory": EXPLORATORY}
SOLVER = "fast-lbfgs-10"  # stopped early, on the front page
SWING = "dynamics/amplitude"
Rows = Sequence[Sequence[str]]


def published_part(request: str) -> str:
    """Return the Markdown of a generated part.

    Raises:
        ValueError: words of no known form, or nothing behind 'of'.
        KeyError: a name that is not there.
        ImportError: a module that is not there.
    """
    subject, _, source = request.partition(" of ")
    names, *lists = source.split(";")
    columns, methods = (_split(text) for text in (*lists, "", "")[:2])
    folders = [PUBLISHED / name for name in _split(names)]
    kind, _, name = subject.partition(" ")
    if (part := request.partition(";")[0]) in PARTS:
        return markdown_table(choose_rows(PARTS[part](), columns))
    if subject == "table overview" and methods:
        return markdown_table(_overview(folders, columns, methods))
    forms: dict[str, Callable[[], str | Rows]] = {
        "docstring": lambda: docstring_rows(source),
        "front": lambda: front_sentences(read_published(folders[0])),
        "table": lambda: _table(folders[0], name, columns, methods),
        "claims": lambda: claim_rows(name, folders),
        "runs": lambda: run_rows(folders),
        "times": lambda: time_rows([(read_published(f), _look_up(f, "cost")) for f in folders], columns),
    }
    if kind not in forms:
        raise ValueError(f"no part is generated from '{request}'; known: {', '.join((*forms, *PARTS))}")
    if not folders:
        raise ValueError(f"'{request}' names nothing behind 'of'")
    content = forms[kind]()
    return content if isinstance(content, str) else markdown_table(content)


def _split(text: str) -> list[str]:
    return [word.strip() for word in text.split(",") if word.strip()]


@cache
def _judge_runs(*folders: Path) -> tuple[dict[Claim, tuple[str, Judged]], dict[str, str]]:
    """Return claim -> first run that has both of its methods and its judgement; labels of methods."""
    verdicts: dict[Claim, tuple[str, Judged]] = {}
    labels: dict[str, str] = {}
    for folder in folders:
        run = read_published(folder)
        for line in judge_claims(run):
            if folder.name in TIMED or line.compared.metric.unit not in TIMES:
                verdicts.setdefault(line.claim, (folder.name, line))
        labels = {method: run.label(method) for method in run.methods} | labels
    return verdicts, labels


def claim_rows(family: str, folders: Sequence[Path]) -> Rows:
    """Return a heading and a row of each test of a family that these runs judge; each claim once."""
    verdicts, labels = _judge_runs(*folders)
    with_p = family == "primary"
    rows = [["Claim", "Tested", "Effect", "Interval", *["p"] * with_p, "Verdict"]]
    before = ""
    for claim in (c for c in FAMILIES[family] if c in verdicts):
        relation = f"{labels[claim.lower]} {claim.relation} {labels[claim.higher]}"
        says, before = "" if claim.says == before else claim.says, claim.says
        name, line = verdicts[claim]
        effect = line.compared.effect
        size, interval = DASH, DASH
        if effect is not None:
            size = ("×" if effect.scale == RATIO else "") + number(effect.shown)
            interval = " to ".join(number(end) for end in effect.interval or ()) or DASH
        p = [number(line.p, 2)] * with_p
        tested = f"{measure_of(line.compared.metric).heading}: {relation}"
        source = "" if name == folders[0].name else f" (`{name}`)"
        rows.append([says, tested, size, interval, *p, line.verdict + line.remark + source])
    return rows


def front_sentences(run: Run) -> str:
    """Return the verdict on SNUG and two bullets, as Markdown.

    Args:
        run: has SNUG, PBNS, Supervised and SOLVER in whole motions.

    Raises:
        KeyError: the method or claim of which a number is missing.
    """
    frame = run.garment_rows
    rows, (timed, _) = add_excess(run, frame), select_timed(run, frame)
    names = (NETWORK, "supervised", "pbns", SOLVER)
    excesses = {name: excess for name in names if (excess := excess_of(run, rows, name))}
    p_values = {line.claim.says: line.p for line in judge_claims(run) if line.p is not None}
    likeness, swing, times = (
        {name: mean.value for name in names if (mean := mean_of(part, name, metric))}
        for part, metric in ((frame, ALIKE), (frame, SWING), (timed, WHOLE))
    )
    supervised, pbns, stopped = (f"{number(excesses[name].typical, 2)} %" for name in names[1:])
    interval = " to ".join(number(end, 2) for end in excesses[SOLVER].effect.interval or ())
    scene, peak = excesses[NETWORK].worst
    lines = (
        f"**{verdict(run, rows)}**\n",
        f"- Good at: low energy in little time. Supervised has {supervised} "
        f"(paired p {number(p_values[UNSEEN], 2)}, Holm-corrected), PBNS {pbns}; "
        f"{run.label(SOLVER)}, has {stopped} ({interval or DASH}) and takes "
        f"{number(times[SOLVER] / times[NETWORK], 1)} times as long as SNUG.",
        "- Bad at: dynamics and unfamiliar motion. Its hem's correlation with the simulation's "
        f"is {number(likeness[NETWORK], 2)} (Supervised {number(likeness['supervised'], 2)}), "
        f"its amplitude {number(100.0 * swing[NETWORK], 1)} % of the simulation's; "
        f"worst energy excess: {number(peak, 2)} %, in {scene.partition('/')[2]}.",
    )
    return "\n".join(lines)


def run_rows(folders: Sequence[Path]) -> Rows:
    """Return a heading and a row of each run: day, commit, how often it evaluated test motions."""
    configs = {folder.name: RunFolder(folder).read_config() for folder in folders}
    rows = [
        (name, config["finished"][:10], config["commit"], str(len(config["test_looks"])))
        for name, config in configs.items()
    ]
    return [("Run", "Day", "Commit", "Test-set evaluations"), *rows]


def _overview(folders: Sequence[Path], columns: Sequence[str], methods: Sequence[str]) -> Rows:
    """Return the table of page one with these methods, each from the first run that has it.

    A star stands behind the methods of other runs than the first.
    """
    heads: list[str] = []
    rows: dict[str, list[str]] = {}
    for run in map(read_published, folders):
        additions = [name for name in methods if name in run.methods and name not in rows]
        head, *lines = text_rows(run, overview(run, additions)[0], columns)
        if heads and head != heads:
            raise ValueError(
                f"page one has the columns {', '.join(head)} in one of {', '.join(map(str, folders))}"
            )
        heads = head
        star = "*" * bool(rows)
        rows |= {
            method: [f"{line[0]}{star}", *line[1:]] for method, line in zip(run.order(additions), lines)
        }
    return [heads, *(rows[name] for name in methods)]


def _table(folder: Path, name: str, columns: Sequence[str], methods: Sequence[str]) -> str:
    """Return a table of a run: these columns and methods, all where none is named; what its marks mean."""
    run, table = read_published(folder), _look_up(folder, name)
    place = next((k for k, column in enumerate(table.columns) if column.method), 0)
    lines = [row for row in table.rows if not methods or row[place] in methods]
    if rest := set(methods) - {str(row[place]) for row in lines}:
        raise KeyError(f"{name} of {folder.name}: {', '.join(sorted(rest))}")
    rows = text_rows(run, replace(table, rows=tuple(lines)), columns)
    return f"{markdown_table(rows)}\n\n{remarks_on(rows)}".strip()


@cache
def _tables(folder: Path) -> dict[str, Table]:
    return make_tables(read_published(folder))


def _look_up(folder: Path, name: str) -> Table:
    if name not in _tables(folder):
        raise KeyError(f"table {name} of {folder.name}")
    return _tables(folder)[name]


def choose_rows(rows: Rows, names: Sequence[str]) -> Rows:
    """Return the heading and the rows whose first cells have these names, in their order; all without names.

    >>> choose_rows([("Field", "Content"), ("`dt`", "[s]"), ("`frames`", "number")], ["frames"])
    [('Field', 'Content'), ('`frames`', 'number')]
    """
    row_of_name = {name: row for row in rows[1:] for name in re.findall(r"[\w/-]+", row[0])}
    return [rows[0], *(row_of_name[name] for name in names)] if names else rows


def docstring_rows(module: str) -> Rows:
    """Return the rows of the table in the docstring of a module.

    >>> docstring_rows("snug.body.smpl_files")[2]
    ('faces, closed and wound outwards', '`f`, `faces`', '(F, 3)')
    """
    text = import_module(module).__doc__ or ""
    lines = [line.strip("|") for line in text.splitlines() if line.startswith("|")]
    rows: Rows = [tuple(cell.strip() for cell in line.split("|")) for line in lines]
    return [rows[0], *rows[2:]]


def metric_rows() -> Rows:
    """Return a heading and a row of each declared metric: name, unit, definition."""
    rows = ((f"`{metric.name}`", metric.unit, metric.definition) for metric in list_metrics().values())
    return [("Metric", "Unit", "Definition"), *rows]


def size_rows() -> Rows:
    """Return a heading and a row of each set of sizes, with the steps of SNUG's training."""
    heads = ("Sizes", "Vertices", "Test motions", "Frames of each", "Steps of SNUG")
    rows = []
    for preset in PRESETS:
        motions = "all" if preset.test_motions is None else str(preset.test_motions)
        frames = "all" if preset.frames >= 10_000 else f"at most {preset.frames}"
        sizes = (str(preset.garment_vertices), motions, frames, f"{preset.steps['snug']:,}")
        rows.append((f"`{preset.name}`", *sizes))
    return [heads, *rows]


PARTS = {"metrics of benchmarks": metric_rows, "sizes": size_rows}


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
