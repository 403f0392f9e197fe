"""python -m benchmarks.publish: run published studies at one commit; keep what is shown."""

from __future__ import annotations

import gzip
import shlex
import shutil
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from benchmarks.plan.plan import make_plan
from benchmarks.plan.study import Show, Study, StudyError, option, read_study, study_names
from benchmarks.provenance import commit, digest_of_file
from benchmarks.results.row import USABLE, ResultsError
from benchmarks.results.run_folder import RunFolder, flat, model_path
from benchmarks.runner.execute_plan import describe, is_accepted
from benchmarks.timing import one_thread
from reference_sim.command_line import Parser, command
from reference_sim.files.atomic_files import new_folder
from snug.motion.library import TEST

PROGRAM = "benchmarks.publish"
WORK = Path("reports/runs/published")
TARGET = Path("reports/published")
REFERENCES = "references"  # in place of a study
KEPT = ("run.json", "report.pdf")
PACKED = ("results.csv", "frame_energies.csv")  # kept as .csv.gz, which pandas reads as they are
EXAMPLES = """examples:
  python -m benchmarks.publish shapes        one of them
  python -m benchmarks.publish               all of them
  python -m benchmarks.publish references    what benchmarks.score takes in place of a simulation

A study that is published by the present code is left: in several sittings the same command does one after
  another, each to be committed as it comes. Each run goes on where it was stopped, in a folder of its own
  below --out: what is not timed may be run there before, by benchmarks.run with more workers.
  When it has ended well, its rows, tables, PDF, pictures and films that the documents show replace those in
  reports/published. Times want a machine with nothing beside.
Then: python -m reports.docs writes the tables of README and docs from them.
exit status: 0 all are published; 1 a run failed and is left as it was; 2 the request cannot be met: one line
  says why."""


@command(PROGRAM, goes_on="the same command goes on from there")
def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; return its exit status.

    Says first what is published of this code, and how long each other study may take.
    """
    one_thread()
    parser = Parser(
        prog=f"python -m {PROGRAM}",
        description="Run published studies again, at the commit that is checked out.",
        epilog=EXAMPLES,
    )
    add = parser.add_argument
    add("studies", nargs="*", metavar="STUDY", help="names of studies (default: all that have [show])")
    add("-o", "--out", metavar="DIR", default=WORK, type=Path, help=f"where runs lie (default {WORK})")
    options = parser.parse_args(arguments)
    studies = [name for name in study_names() if read_study(name).show]
    head = commit()
    failed = 0
    if head.endswith("+changes"):
        raise StudyError(f"{head}: commit the changes first, so that a commit says what was run")
    if options.studies == [REFERENCES]:
        from benchmarks.references import VERTICES, write_garment
        from snug import Body, find_template  # loads libraries of meshes

        write_garment(find_template("tshirt").tailor(Body.load(), vertices=VERTICES))
        for motion in TEST:
            print(make_reference(f"tshirt/{motion}", options.out / REFERENCES), flush=True)
        return 0
    names = options.studies or studies
    if unshown := [name for name in names if not read_study(name).show]:
        raise StudyError(f"study {unshown[0]}: has no [show]: the studies {', '.join(studies)} do")
    plans = {name: make_plan(with_seeds(name), folder=options.out / Path(name).stem) for name in names}
    unpublished = [n for n in names if not is_published(TARGET / Path(n).stem, plans[n].study, head)]
    for name in names:
        state = describe(plans[name]).rpartition("\n")[2] if name in unpublished else "is published"
        print(f"{name}: {state}", file=sys.stderr, flush=True)
    for name in unpublished:  # where one is not published, the next is done all the same
        try:
            publish(name, options.out, TARGET, head)
        except ValueError as error:  # of the run's command, of files of results
            print(f"{PROGRAM}: {name}: {error}; not published", file=sys.stderr)
            failed = 1
    return failed


def make_reference(name: str, out: Path) -> Path:
    """Make the file of benchmarks.references of a scene; return its path.

    A scene without one that fits is simulated; else its numbers alone are made anew.
    """
    from benchmarks import references
    from benchmarks.evaluate import assets_of, evaluate  # loads the simulator
    from reference_sim import Trajectory

    study = replace(read_study("full:garments"), scenes=(name,), methods=references.METHODS)
    plan = make_plan(study, folder=out / flat(name))
    run, scene = RunFolder(plan.folder), plan.scenes[0]
    built = scene.build(assets_of(plan))
    reference = references.find_reference(scene, plan, built)
    if isinstance(reference, str):
        evaluate(plan, {})
        simulation = Trajectory.load(run.trajectory_path(name, references.METHODS[0]))
        assert built.dressed is not None
        hem = Trajectory.load(run.quasi_static_path(name)).positions[:, built.dressed.garment.hem]
        row = next(row for row in run.read_rows() if row.method == references.METHODS[0])
        step = references.STEP  # as it is read
        positions, hem = (step * (x / step).round() for x in (simulation.positions, hem))
        reference = references.Reference(positions, hem, row.status, row.reason)
    log = evaluate(plan, {name: replace(reference, metrics={})})
    metrics: dict[str, dict[str, float]] = {method: {} for method in references.METHODS}
    for row in log.rows:
        if row.value is not None:
            metrics[row.method][row.metric] = row.value
    networks = {name: digest_of_file(references.find_in_package(name)) for name in references.TRAINED}
    reference = replace(reference, metrics=metrics, origin=log.origin, networks=networks)
    return references.write_reference(scene, plan, reference, built)


def with_seeds(name: str) -> Study:
    """Return a study with the seeds published of it."""
    show = read_study(name).show
    return read_study(name, [option("seeds", [*show.seeds])] if show and show.seeds else [])


def is_published(target: Path, study: Study, head: str) -> bool:
    """Return whether a folder has a study as it is, computed by commit `head`."""
    if not (target / "run.json").is_file():
        return False
    config = RunFolder(target).read_config()
    return config.get("commit") == head and config.get("study") == study.written


def publish(name: str, out: Path, into: Path, head: str) -> None:
    """Run a study, by name or path, below `out`, or go on; keep what is published below `into`.

    Raises ResultsError where the run failed, has rows of another commit, or lacks a picture.
    """
    show, source = read_study(name).show, out / Path(name).stem
    assert show is not None
    seeds = ["--seeds", ",".join(map(str, show.seeds))] if show.seeds else []
    # Again what has failed, as a task that lacked memory once.
    _call("benchmarks.run", name, *seeds, "--retry", "-o", str(source))
    if not all_usable(RunFolder(source)):
        raise ResultsError(f"{source}: has failed")
    if others := sorted({row.commit for row in RunFolder(source).read_rows()} - {head, ""}):
        fault = f"{source}: rows of commit {', '.join(others)}"
        raise ResultsError(f"{fault}; remove the folder, or check that commit out")
    for film, options in show.films.items():
        path = source / "figures" / film
        path.unlink(missing_ok=True)
        _call("reports.film", str(source), *shlex.split(options), "-o", str(path))
    keep(source, into / source.name, show)
    print(f"{name}: published in {into / source.name}", flush=True)


def _call(*command: str) -> None:
    print(shlex.join(command), file=sys.stderr, flush=True)
    subprocess.run([sys.executable, "-m", *command], check=False)


def all_usable(folder: RunFolder) -> bool:
    """Return whether a run has ended and all its numbers count, also of stalled simulations.

    `benchmarks.run` ends with status 1 where a simulation stalled. Extreme cases may end as they do.
    """
    if not folder.rows_path.is_file():
        return False
    config = folder.read_config()
    failed = ("failed" in facts for kind in config.get("tasks", {}).values() for facts in kind.values())
    counted = (is_accepted(row) or row.status in USABLE for row in folder.read_rows())
    return bool(config.get("finished")) and all(counted) and not any(failed)


def keep(source: Path, target: Path, show: Show) -> None:
    """Replace the folder `target` by what is published of the run in `source`.

    Raises ResultsError where a picture, film or network of `show` is not there.
    """
    networks = [model_path(RunFolder(source).models, name, seed=0) for name in show.networks]
    files = [source / name for name in KEPT] + [source / "figures" / name for name in show.files]
    tables = [path for path in (source / "tables").glob("*.csv") if not path.match("*_by_scene.csv")]
    packed = [path for name in PACKED if (path := source / name).exists() or name == PACKED[0]]
    if missing_files := [path for path in (*files, *packed, *networks) if not path.exists()]:
        raise ResultsError(f"{missing_files[0]}: not there, and the study publishes it")
    draft = target.with_name(f"{target.name}.new")
    shutil.rmtree(draft, ignore_errors=True)
    with new_folder(draft) as part:
        for path in files:
            shutil.copy(path, part)
        for path in packed:  # of one time, so that equal files have equal copies
            (part / f"{path.name}.gz").write_bytes(gzip.compress(path.read_bytes(), mtime=0))
        (part / "tables").mkdir()
        for path in tables:
            shutil.copy(path, part / "tables")
        for path in networks:
            save_half(path, part / path.relative_to(source))
    shutil.rmtree(target, ignore_errors=True)
    draft.rename(target)


def save_half(model: Path, copy: Path) -> None:
    """Write a copy of a network with weights and input statistics in half precision."""
    from snug.networks.trained_model import TrainedModel

    rounded = TrainedModel.load(model)
    rounded.network.half()
    rounded.save(copy)


if __name__ == "__main__":
    sys.exit(main())
