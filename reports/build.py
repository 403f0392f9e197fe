"""python -m reports.build RUN_DIR: the tables, figures and PDF of a finished run.

Reads run.json, results.csv, frame_energies.csv, trajectories and histories of trainings in RUN_DIR, and
nothing else; writes tables/*.csv, figures/*.svg and *.png, report.html and report.pdf there. Run twice, it
writes the same bytes twice.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from benchmarks.results.json_file import ResultsError
from benchmarks.results.run_folder import RunFolder
from reference_sim.command.command_line import Parser, command
from reference_sim.files.atomic_files import replacing
from reports.run.read import read_run, read_trajectory

if TYPE_CHECKING:
    from reports.figures.plotting import Picture
    from reports.figures.training import History
    from reports.run.rows import Run

TEMPLATE = Path(__file__).parent / "report.typ"
# Names of what draw() makes.
FIGURES = (
    "against_shape.*", "against_vertices.*", "break_even.*", "convergence.*", "dots.*", "equal_data.*",
    "energy_series_*", "error_against_time*", "failures.*", "frames_*", "held_out.*", "hem_*", "histograms.*",
    "known_answers.*", "lead.*", "map_*", "stability_maps.*", "strip_*", "training_*", "training.*",
)  # fmt: skip


def build_report(run_dir: str | Path) -> tuple[Path, list[str]]:
    """Make everything; returns the path of the PDF and what could not be read, one sentence each.

    Raises ResultsError when run.json or results.csv is absent, broken or of an earlier version, before
    anything is written.
    """
    folder = RunFolder(run_dir)
    run = read_run(folder)
    from reports.document.document import document
    from reports.figures.training import curves_table, read_histories, trainings
    from reports.page.write import write_page
    from reports.tables.dictionary import dictionary
    from reports.tables.latex import write_latex
    from reports.tables.tables import make_tables

    problems: list[str] = []
    histories = read_histories(folder, run, problems)
    tables = make_tables(run) | {made.name: made for made in trainings(run, histories)}
    # Of other suites, asked for in this folder before. What --axes drew stays.
    made = [path for kind in ("*.csv", "*.tex") for path in folder.tables.glob(kind)]
    for old in [*made, *(p for kind in FIGURES for p in folder.figures.glob(kind))]:
        old.unlink()
    for table in (*tables.values(), dictionary(run)):
        table.write_csv(folder.tables)
    write_latex(run, tables, folder.tables)
    for table in curves_table(histories):
        table.write_csv(folder.tables)
    pictures = draw(folder, run, histories, problems)
    write_page(folder, run, tables, problems, lambda path: read_trajectory(folder, path, problems))
    problems = list(dict.fromkeys(problems))  # the page reads again what was drawn
    typeset(folder, document(run, tables, pictures, problems))
    return folder.report_path, problems


def draw(folder: RunFolder, run: Run, histories: Sequence[History], problems: list[str]) -> list[Picture]:
    """Every figure that the run holds something for."""
    from reports.figures import figures
    from reports.figures.break_even import break_even
    from reports.figures.convergence import convergence_curve
    from reports.figures.equal_data import error_against_frames, held_out_curves
    from reports.figures.shapes import against_shape
    from reports.figures.stability import stability_maps
    from reports.figures.training import training_curves
    from reports.figures.work_precision import error_against_time
    from reports.pictures.chosen_roll_outs import draw_roll_outs

    pictures = draw_roll_outs(folder, run, lambda path: read_trajectory(folder, path, problems))
    for make in (
        error_against_time, break_even, figures.dots, figures.against_vertices, against_shape,
        figures.known_answers, stability_maps, error_against_frames,
    ):  # fmt: skip
        pictures += make(folder.figures, run)
    for trained in (held_out_curves, training_curves):
        pictures += trained(folder.figures, run, histories)
    return pictures + convergence_curve(folder, problems)


def draw_axes(folder: RunFolder, x: str, y: str, scenes: str | None) -> Picture:
    """Any metric against any other, into figures/. Raises ResultsError for a name that no row has."""
    run = read_run(folder)
    asked = scenes.split(",") if scenes else []
    for what, names in (("metric", (x, y)), ("scene", asked)):
        for name in names:
            if name not in set(run.frame[what]):
                raise ResultsError(f"{folder.rows_path}: no row has the {what} '{name}'")
    from reports.figures.work_precision import metric_against_metric

    asked = asked or most_shared(run, x, y)
    picture = metric_against_metric(folder.figures, run, x, y, asked)
    if picture is None:
        where = ", ".join(asked) or "every scene"
        raise ResultsError(f"{folder.rows_path}: fewer than two methods have both {x} and {y} on {where}")
    return picture


def most_shared(run: Run, x: str, y: str) -> list[str]:
    """The scenes in which most methods have both metrics, the same methods in each."""
    from reports.run.rows import SUITES

    rows = run.cells(*SUITES)
    rows = rows[rows["usable"] & rows["metric"].isin((x, y))]
    count = rows.groupby(["scene", "method"])["metric"].nunique()
    both = count[count == len({x, y})].reset_index().groupby("scene")["method"].agg(frozenset)
    most: frozenset[str] = max(both, key=len, default=frozenset())
    return sorted(str(scene) for scene, methods in both.items() if methods == most)


def typeset(folder: RunFolder, content: dict[str, Any]) -> None:
    """report.pdf from the template, with fonts of the typesetter alone and the run's own date."""
    import typst

    from reports.figures.plotting import printable
    from reports.run.configuration import moment

    config = folder.read_config()
    finished = moment(config.get("finished")) or moment(config.get("started"))
    compiler = typst.Compiler(
        TEMPLATE.read_bytes(),
        root=str(folder.path),
        ignore_system_fonts=True,
        sys_inputs={"content": printable(json.dumps(content, ensure_ascii=False, allow_nan=False))},
    )
    with replacing(folder.report_path) as temporary:
        stamp = int(finished.timestamp()) if finished else 0
        compiler.compile(output=str(temporary), format="pdf", timestamp=stamp)


@command("reports.build", goes_on="the same command begins again", bad_input=(ResultsError,))
def main(arguments: Sequence[str] | None = None) -> int:
    """Exit status: 0 made; 1 made, but some file of the run could not be read; 2 no run folder."""
    parser = Parser(
        prog="python -m reports.build",
        description="Make tables/*.csv, figures/*, report.html and report.pdf of a finished run.",
        epilog="Exit status: 0 when all is made, 1 when some file of the run could not be read (the report "
        "names it), 2 when RUN_DIR is no run folder.",
    )
    parser.add_argument("run_dir", metavar="RUN_DIR", help="folder with run.json and results.csv")
    parser.add_argument(
        "--axes",
        nargs=2,
        metavar=("X", "Y"),
        help="draw only metric Y against metric X (names as in results.csv, say cost/whole gap/energy), "
        "means over --scenes, into figures/",
    )
    parser.add_argument(
        "--scenes",
        metavar="NAME,...",
        help="of --axes (default: those in which most methods have both)",
    )
    options = parser.parse_args(arguments)
    if options.axes:
        x, y = options.axes
        picture = draw_axes(RunFolder(options.run_dir), x, y, options.scenes)
        print(picture.caption, picture.path, sep="\n")
        return 0
    path, problems = build_report(options.run_dir)
    for problem in problems:
        print(f"reports.build: left out: {problem}", file=sys.stderr)
    print(path)
    return 1 if problems else 0


if __name__ == "__main__":
    raise SystemExit(main())
