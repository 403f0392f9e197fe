"""python -m reports.build RUN_DIR: tables, figures, page and PDF of a finished run.

Reads run.json, results.csv, frame_energies.csv and trajectories in RUN_DIR, and reports/published; writes
tables/*.csv, for_your_paper.csv and .tex, figures/*.svg and *.png, report.html and report.pdf there.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from benchmarks.results.row import ResultsError
from benchmarks.results.run_folder import RunFolder
from reference_sim.command_line import Parser, command

if TYPE_CHECKING:
    from reports.blocks import Report


@dataclass(frozen=True)
class Built:
    """A report that was made.

    Attributes:
        pdf: path of the PDF.
        problems: a sentence for each file that could not be read, times of several machines, edited
            files.
        answer: page one, and how the published run agrees, in few lines; may be empty.
    """

    pdf: Path
    problems: list[str]
    answer: str


def build_report(run_dir: str | Path) -> Built:
    """Make tables, figures, page and PDF of a run.

    Raises:
        ResultsError: as of read_run, before anything is written.

    >>> print(build_report("reports/runs/first").answer)  # doctest: +SKIP
    """
    # Heavy: not needed for --help.
    from reports.blocks import FIGURES, Report
    from reports.compare import compare_published
    from reports.figures.plotting import draw_figures
    from reports.finished_run import read_run
    from reports.pdf import write_pdf
    from reports.tables import make_tables, write_tables
    from reports.text.for_your_paper import write_paper_table
    from reports.text.text_table import answer

    folder = RunFolder(run_dir)
    run = read_run(folder)
    tables = make_tables(run)
    write_tables(folder.tables, tables.values())
    write_paper_table(folder, run)
    with ProcessPoolExecutor(1) as pool:  # the page takes as long as figures and PDF
        page = pool.submit(_write_page, folder, Report(run, tables, {}))
        pdf = write_pdf(folder, Report(run, tables, draw_figures(run, folder.figures, FIGURES)))
        problems = dict.fromkeys([*run.problems, *page.result(), *run.warnings])
    lines = filter(None, (answer(run, tables), compare_published(run)))
    return Built(pdf, list(problems), "\n".join(lines))


def _write_page(folder: RunFolder, report: Report) -> list[str]:
    """Write report.html; return what could not be read."""
    from reports.page.write_page import write_page

    write_page(folder, report)
    return report.run.problems


def build_row(run_dir: str | Path) -> str:
    """Write for_your_paper.csv and .tex alone; return their table as text."""
    from reports.finished_run import read_run  # loads pandas
    from reports.text.for_your_paper import write_paper_table
    from reports.text.text_table import markdown_table, remarks_on, text_rows

    folder = RunFolder(run_dir)
    run = read_run(folder)
    lines = text_rows(run, write_paper_table(folder, run))
    rows = [[text.removeprefix("+") for text in line] for line in lines]
    return "\n".join(filter(None, (markdown_table(rows), remarks_on(rows))))


def save_still(run_dir: str | Path, method: str, path: Path) -> None:
    """Save a picture of the method's garment in a lively frame of the run's first scene."""
    from PIL import Image

    from reports.finished_run import read_run
    from reports.pictures import AZIMUTH, SceneRollOuts, draw_frames

    run = read_run(RunFolder(run_dir))
    first = run.frame[run.frame["method"] == method].iloc[0]
    scene = str(first["scene"])
    cloth = run.roll_outs.cloth(scene, method, int(first["seed"]))
    assert cloth is not None
    group = SceneRollOuts(scene, {method: cloth}, None, {method: run.label(method)})
    (image,) = draw_frames(group, 160, AZIMUTH, [group.lively_frame()[0]])
    Image.fromarray(image).quantize(32).save(path)


@command("reports.build", goes_on="the same command begins again", bad_input=(ResultsError,))
def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; return its exit status."""
    parser = Parser(
        prog="python -m reports.build",
        description="Make tables/*.csv, figures/*, report.html and report.pdf of a finished run.",
        epilog="Exit status: 0 when all is made, 1 when a file could not be read (standard error names "
        "it) or was edited, or times are of several machines, 2 when RUN_DIR is no run folder.",
    )
    parser.add_argument("run_dir", metavar="RUN_DIR", help="folder with run.json and results.csv")
    options = parser.parse_args(arguments)
    built = build_report(options.run_dir)
    for problem in built.problems:
        print(f"reports.build: {problem}", file=sys.stderr)
    if built.answer:
        print(built.answer)
    print(built.pdf)
    return 1 if built.problems else 0


if __name__ == "__main__":
    raise SystemExit(main())
