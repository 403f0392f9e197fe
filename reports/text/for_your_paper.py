"""A table for a paper, as CSV and as LaTeX: what reviewers of learned garments ask for.

Means as on page one, but over scenes in which a method has all of its seeds: over independent sources of
motion, of a source over its segments, and seeds; of times over scenes with timed solvers.
"""

from __future__ import annotations

import math
import re
from dataclasses import replace

import pandas as pd

from benchmarks.metric import Metric
from benchmarks.results.protocol import LEAST_MOTIONS
from benchmarks.results.run_folder import RunFolder
from reference_sim.files.atomic_files import replacing
from reports.finished_run import Run
from reports.statistics.effects import RANGE, Effect
from reports.statistics.means_and_spreads import pair, recording_of
from reports.statistics.pareto import run_time, select_timed
from reports.statistics.relative_excess import TOTAL, add_excess, excess_of, own_excess_of
from reports.statistics.verdicts import effect_of
from reports.tables.table import DASH, METHOD, REMARKS, Cells, Column, Table, column_texts, metric_column

NAME = "for_your_paper"
METRICS = (
    "penetration/surface", "intersections/triangles", "intersections/contours", "deformation/edges",
    "deformation/areas", "distance/rms", "dynamics/common_correlation",
)  # fmt: skip
CITATION = "Neural garments versus a reference solver: a physics-validation benchmark"


def write_paper_table(folder: RunFolder, run: Run) -> Table:
    """Write for_your_paper.csv, in each row what it marks and the caption, and .tex; return the table."""
    table = paper_table(run)
    rows = tuple((*row, _name_lacking(table, row) or None, table.caption) for row in table.rows)
    further = (Column(name, name, text=True) for name in ("lacking", "caption"))
    columns = (*table.columns, *further)
    replace(table, columns=columns, rows=rows).drop_empty().write_csv(folder.path)
    with replacing(folder.path / f"{NAME}.tex") as temporary:
        temporary.write_text(latex_table(run, table), encoding="utf-8", newline="\n")
    return table


def _name_lacking(table: Table, row: Cells) -> str:
    """Return the columns in which a row's mean is over fewer scenes or seeds than it should be."""
    cells = zip(table.columns, row)
    return ", ".join(c.name for c, cell in cells if isinstance(cell, Effect) and not cell.complete)


def paper_table(run: Run) -> Table:
    """Return the methods on the first garment, or in all scenes, with columns that the run has."""
    rows = run.select_garment(run.first_garment)
    rows = run.cells() if rows.empty else rows
    omissions = {"", *run.find_ablations(rows), *run.twins, *run.with_role("reference-variant")}
    rows = rows[~rows["method"].isin(omissions)]
    usable, excesses = rows[rows["usable"]], add_excess(run, rows)
    timed, _ = select_timed(run, rows)
    queries = [(name, rows) for name in METRICS] + [(run_time(timed), timed)]
    sources = [(run.metrics[n], part) for n, part in queries if n in set(part[part["usable"]]["metric"])]
    lines: list[Cells] = []
    for method in run.order(usable["method"]):
        of_method = usable[(usable["method"] == method) & usable["metric"].isin((TOTAL, *METRICS))]
        common = excess_of(run, excesses, method) if method != run.reference else None
        effects = [own_excess_of(run, rows, method), common.effect if common else None]
        effects += [_mean(part, method, metric) for metric, part in sources]
        counts = of_method["scene"].map(recording_of).nunique(), of_method["seed"].nunique()
        lines.append((method, *counts, *(effect and _cell(effect) for effect in effects)))
    columns = [
        METHOD, Column("sources", "Sources"), Column("seeds", "Seeds"),
        Column("own_excess", "Own excess", "%"), Column("relative_excess", "Relative excess", "%"),
        *(metric_column(metric) for metric, _ in sources),
    ]  # fmt: skip
    cells = [cell for line in lines for cell in line if isinstance(cell, Effect)]
    has_intervals = any(cell.interval for cell in cells)
    remark = "" if all(cell.complete for cell in cells) else REMARKS["*"]
    caption = (
        f"{run.first_garment or 'All scenes'}: means over independent sources of motion and over seeds, of "
        f"excess geometric{'; below: 95 % intervals, of times the range' if has_intervals else ''}. "
        "Excess: energy above a reference solver's as a share of skinning's, in each method's own energies "
        "and in common ones. "
        f"Protocol {run.protocol or 'own'}; cite: {CITATION}, at {run.config.get('commit') or 'no commit'}. "
        f"{remark}"
    ).rstrip()
    rounded = tuple(replace(column, digits=2) for column in columns)
    return Table(NAME, rounded, tuple(lines), caption).drop_empty()


def _mean(rows: pd.DataFrame, method: str, metric: Metric) -> Effect | None:
    """Return a mean as its difference from zero, which has an interval; None without one."""
    mean, _ = pair(rows, method, method, metric.name)
    if mean is None:
        return None
    zero = replace(mean, value=0.0, cells=dict.fromkeys(mean.cells, 0.0), seeded=False, pairing_group="")
    low = -math.inf if min(mean.cells.values()) < 0.0 else 0.0
    effect = effect_of(metric, mean, replace(zero, moved={}, uncertainty=None))
    return replace(effect, possible=(low, math.inf))


def _cell(effect: Effect) -> Effect | float:
    """Return the number alone, with its mark if it has one, where its interval says nothing."""
    low, high = effect.interval or (0.0, 0.0)
    enough = effect.covers == RANGE or effect.motions >= LEAST_MOTIONS
    if enough and high - low > 1e-6 * abs(high):
        return effect
    return effect.shown if effect.complete else replace(effect, error=None, limits=None, covers="")


def latex_table(run: Run, table: Table) -> str:
    """Return a table as a float of LaTeX, an interval below its number."""
    columns = [column_texts(run, column, cells) for column, cells in zip(table.columns, zip(*table.rows))]
    heads = [
        _stack(*column.title.replace(", ", " ").split(), f"[{column.unit}]" * bool(column.unit))
        for column in table.columns
    ]
    body = [
        [_stack(cell["text"].removeprefix("+") + "*" * ("*" in cell["mark"]),
            cell["spread"].replace(" to ", DASH)) for cell in line]
        for line in zip(*columns)
    ]  # fmt: skip
    lines = [f"\\raggedright {' & '.join(line)} \\\\[4pt]" for line in (heads, *body)]
    sides = "".join("p{2.7cm}" if column.text else "r" for column in table.columns)
    return "\n".join([
        "% Needs \\usepackage{booktabs}.", "\\begin{table*}", "\\centering\\scriptsize",
        f"\\setlength{{\\tabcolsep}}{{2pt}}\n\\caption{{{latex(table.caption)}}}\\smallskip",
        f"\\begin{{tabular}}{{{sides}}}", "\\toprule", lines[0], "\\midrule", *lines[1:],
        "\\bottomrule", "\\end{tabular}", "\\end{table*}", "",
    ])  # fmt: skip


def _stack(*texts: str) -> str:
    """Return the texts below each other in one cell."""
    lines = r"\\".join(latex(text) for text in texts if text)
    return f"\\shortstack{{{lines}}}" if r"\\" in lines else lines


COMMANDS = {
    "\\": r"\textbackslash{}", "^": r"\textasciicircum{}", "~": r"\textasciitilde{}", "<": "$<$", ">": "$>$",
    "|": "$|$", "−": "$-$", "×": r"$\times$", "∞": r"$\infty$", DASH: "--", "[": "{[}", "]": "{]}",
    **{mark: f"\\{mark}" for mark in "&%$#_{}"},
}  # fmt: skip
RAISED = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")


def latex(text: str) -> str:
    r"""Return the text as LaTeX prints it.

    >>> latex("a_b 5 %"), latex("2.50×10⁻⁷"), latex("cm^3")
    ('a\\_b 5 \\%', '2.50$\\times$10$^{-7}$', 'cm$^{3}$')
    """
    parts = re.split(r"(\^\d+|[⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+)", text)  # every second one is a power
    parts[::2] = ["".join(COMMANDS.get(mark, mark) for mark in part) for part in parts[::2]]
    parts[1::2] = [f"$^{{{part.translate(RAISED).removeprefix('^')}}}$" for part in parts[1::2]]
    return "".join(parts)
