"""python -m reports.build RUN_DIR: the tables, figures and PDF of a finished run.

Reads run.json, results.csv, trajectories and training histories in RUN_DIR, and nothing else; writes
tables/*.csv, figures/*.svg and *.png, and report.pdf there. Run twice, it writes the same bytes twice.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from benchmarks.results import ResultsError, Row, RunFolder, replacing

if TYPE_CHECKING:
    from reports.canvas import Picture
    from reports.render import Dressed

TEMPLATE = Path(__file__).parent / "report.typ"


def build_report(run_dir: str | Path, *, opengl: bool = True) -> tuple[Path, list[str]]:
    """Make everything; returns the path of the PDF and what could not be read, one sentence each.

    Raises ResultsError when run.json or results.csv is absent or broken, before anything is written.
    """
    run = RunFolder(run_dir)
    if not run.path.is_dir():
        raise ResultsError(f"{run.path}: no such folder")
    config, rows = run.read_config(), run.read_rows()
    if not rows:
        raise ResultsError(f"{run.rows_path}: holds no rows; nothing to report")
    from reports.document import document
    from reports.tables import make_tables

    tables = make_tables(rows)
    for old in run.tables.glob("*.csv"):  # of other suites, asked for in this folder before
        old.unlink()
    for table in tables.values():
        table.write_csv(run.tables)
    problems: list[str] = []
    pictures = draw(run, rows, problems, opengl=opengl)
    typeset(run, document(config, rows, tables, pictures, problems), config)
    return run.report_path, problems


def draw(run: RunFolder, rows: Sequence[Row], problems: list[str], *, opengl: bool) -> list[Picture]:
    """Every figure that the run holds something for."""
    from reports import (
        break_even,
        figures,
        hem,
        profile,
        render,
        stability,
        throughput,
        training,
        work_precision,
    )

    dressed = dressed_trajectories(run, rows, problems)
    pictures = render.side_by_side(run.figures, dressed, opengl=opengl)
    series = [figures.energy_series(run.figures, kept.scene, kept.series) for kept in dressed]
    series += [hem.hem_curves(run.figures, kept.scene, kept.series, kept.body) for kept in dressed]
    pictures += [picture for picture in series if picture is not None]
    pictures += work_precision.error_against_time(run.figures, rows)
    pictures += profile.performance_profile(run.figures, rows)
    pictures += break_even.break_even(run.figures, rows)
    pictures += throughput.throughput_bars(run.figures, rows)
    pictures += training.training_curves(run.figures, run.models, problems)
    pictures += figures.validation_dots(run.figures, rows)
    pictures += stability.stability_maps(run.figures, rows)
    pictures += figures.extremes_outcomes(run.figures, rows)
    return pictures


def draw_axes(run: RunFolder, x: str, y: str, scenes: str | None) -> Path:
    """Any metric against any other, into figures/. Raises ResultsError for a name that no row has."""
    rows = run.read_rows()
    for what, name, known in (
        *(("metric", metric, {row.metric for row in rows}) for metric in (x, y)),
        *(("scene", scene, {row.scene for row in rows}) for scene in (scenes.split(",") if scenes else ())),
    ):
        if name not in known:
            raise ResultsError(f"{run.rows_path}: no row has the {what} '{name}'")
    from reports.work_precision import metric_against_metric

    asked = scenes.split(",") if scenes else most_shared(rows, x, y)
    picture = metric_against_metric(run.figures, rows, x, y, asked)
    if picture is None:
        where = ", ".join(asked) or "every scene"
        raise ResultsError(f"{run.rows_path}: fewer than two methods have both {x} and {y} on {where}")
    return picture.path


def most_shared(rows: Sequence[Row], x: str, y: str) -> list[str]:
    """The scenes in which most methods have both metrics, the same methods in each."""
    having: dict[str, dict[str, set[str]]] = {x: {}, y: {}}
    for row in rows:
        if row.metric in having and row.value is not None:
            having[row.metric].setdefault(row.scene, set()).add(row.method)
    both = {scene: methods & having[y].get(scene, set()) for scene, methods in having[x].items()}
    most = max(both.values(), key=len, default=set())
    return sorted(scene for scene, methods in both.items() if methods and methods == most)


def dressed_trajectories(run: RunFolder, rows: Sequence[Row], problems: list[str]) -> list[Dressed]:
    """The trajectories on disk of each dressed scene, and its body; a broken file becomes a problem."""
    from reports.render import Dressed
    from reports.summary import Measurements, suite_rows, worn_scenes
    from reports.vtkhdf import MeshFileError, MeshSeries, read_series

    def opened(path: Path) -> MeshSeries | None:
        try:
            return read_series(path) if path.is_file() else None
        except MeshFileError as error:
            problems.append(str(error).replace(f"{run.path}/", ""))
            return None

    measured = Measurements(suite_rows(rows, "garments"))
    found = []
    for scene in worn_scenes(measured):
        seeds = {row.method: row.seed for row in reversed(rows) if row.scene == scene}
        series = {m: opened(run.trajectory_path(scene, m, seeds[m])) for m in measured.methods if m in seeds}
        kept = {method: mesh for method, mesh in series.items() if mesh is not None}
        if kept:
            found.append(Dressed(scene, kept, opened(run.trajectory_path(scene, "body"))))
    return found


def typeset(run: RunFolder, content: dict[str, Any], config: dict[str, Any]) -> None:
    """report.pdf from the template, with fonts of the typesetter alone and the run's own date."""
    import typst

    from reports.configuration import moment

    finished = moment(config.get("finished")) or moment(config.get("started"))
    compiler = typst.Compiler(
        TEMPLATE.read_bytes(),
        root=str(run.path),
        ignore_system_fonts=True,
        sys_inputs={"content": json.dumps(content, ensure_ascii=False, allow_nan=False)},
    )
    with replacing(run.report_path) as temporary:
        stamp = int(finished.timestamp()) if finished else 0
        compiler.compile(output=str(temporary), format="pdf", timestamp=stamp)


def main(arguments: Sequence[str] | None = None) -> int:
    """Exit status: 0 made; 1 made, but some file of the run could not be read; 2 no run folder."""
    parser = argparse.ArgumentParser(
        prog="python -m reports.build",
        description="Make tables/*.csv, figures/* and report.pdf of a finished run from its result files.",
        epilog="Exit status: 0 when all is made, 1 when some file of the run could not be read (the report "
        "names it), 2 when RUN_DIR is no run folder.",
    )
    parser.add_argument("run_dir", metavar="RUN_DIR", help="folder with run.json and results.csv")
    parser.add_argument("--no-opengl", action="store_true", help="draw the frames without OpenGL")
    parser.add_argument(
        "--axes",
        nargs=2,
        metavar=("X", "Y"),
        help="draw only metric Y against metric X (names as in results.csv, say cost/frame gap/relative), "
        "means over --scenes, into figures/",
    )
    parser.add_argument(
        "--scenes",
        metavar="NAME,...",
        help="of --axes, of suites garments and speed (default: those in which most methods have both)",
    )
    options = parser.parse_args(arguments)
    try:
        if options.axes:
            x, y = options.axes
            print(draw_axes(RunFolder(options.run_dir), x, y, options.scenes))
            return 0
        path, problems = build_report(options.run_dir, opengl=not options.no_opengl)
    except ResultsError as error:
        print(f"reports.build: {error}", file=sys.stderr)
        return 2
    for problem in problems:
        print(f"reports.build: left out: {problem}", file=sys.stderr)
    print(path)
    return 1 if problems else 0


if __name__ == "__main__":
    raise SystemExit(main())
