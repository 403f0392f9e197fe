"""python -m benchmarks.export: a scene as plain files, to be simulated elsewhere and scored here."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from benchmarks.methods import find_method
from benchmarks.plan.options import add_options, study_of
from benchmarks.plan.plan import make_plan
from benchmarks.plan.study import StudyError
from benchmarks.timing import one_thread
from reference_sim.command_line import Parser, command
from reference_sim.files.atomic_files import demand_new

PROGRAM = "benchmarks.export"
EXAMPLES = """examples:
  python -m benchmarks.export tshirt/kick -o kick
  python -m benchmarks.export hanging_sheet --set sizes=smoke -o sheet --reference
  python -m benchmarks.export tshirt/kick --for hood -o kick     and kick/hood, with the commands to run there
  python -m benchmarks.export tshirt/01_01 --motions clips/ --test-motions 01_01 --body mine.npz -o out
  python -m benchmarks.export tshirt/training-motions -o motions.h5    training motions, simulated, in a file
  python -m benchmarks.score mine.npz --scene tshirt/kick        what came of it, judged
  python -m reports.film RUN --scene tshirt/kick --methods snug -o kick.pc2    another command: a roll-out

A file of training motions is what snug.train --dataset learns from; the run that simulates them is kept in
  FILE.parts until the file is there, and the same command goes on with it.
The folder's README.txt says what each file holds: units, axes, order of vertices.
exit status: 0 written; 2 the scene is not known or cannot be made, or the folder is not empty: one line says
  why and nothing is written; 130 interrupted."""


@command(PROGRAM, goes_on="the same command goes on")
def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; return its exit status."""
    one_thread()
    parser = Parser(
        prog=f"python -m {PROGRAM}",
        description="Write a scene as plain files: rest mesh, weights, material, motion, posed body, start.",
        epilog=EXAMPLES,
    )
    add = parser.add_argument
    add("scene", metavar="SCENE", help="as in benchmarks.run --list, or GARMENT/training-motions")
    add("-o", "--out", required=True, metavar="DIR",
        help="a new or empty folder; of training motions a file")  # fmt: skip
    add("--reference", action="store_true", help="simulate the scene, and write the trajectory too")
    add("--for", dest="reader", choices=("hood", "contourcraft", "ncs"), default="",
        help="write what the public code of that method reads, too")  # fmt: skip
    add_options(parser)
    options = parser.parse_args(arguments)
    folder = Path(options.out)
    garment, _, motion = options.scene.rpartition("/")
    if motion == "training-motions":
        from benchmarks.runner.training_motions import write_training_motions

        if folder.is_dir():
            raise StudyError(f"{folder}: is a folder; name a file, as motions.h5")
        if options.reference or options.reader:
            raise StudyError("--reference and --for are of a scene: leave them out for training motions")
        motions = write_training_motions(garment, options, folder)
        print(f"{len(motions)} training motions of {garment} in {folder}")
        return 0
    demand_new(folder)
    study = replace(study_of(options), scenes=(options.scene,), methods=("simulation",))
    plan = make_plan(study, folder=folder)
    if len(plan.scenes) != 1:
        raise StudyError(f"{options.scene}: name one scene; see python -m benchmarks.run --list")
    try:
        scene = plan.scenes[0].build(plan.open_assets() if plan.garments else None)
        from benchmarks.external.scene_files import write_scene  # loads the simulator

        simulation = find_method("simulation").make(models=folder, seed=0) if options.reference else None
        write_scene(
            folder, plan.scenes[0], scene, preset=plan.study.sizes.name, simulation=simulation,
            reader=options.reader,
        )  # fmt: skip
    except RuntimeError as error:  # a simulation that did not stay finite
        raise StudyError(str(error)) from error
    print(f"{scene.name}: {scene.frames} frames of {scene.cloth.vertex_count} vertices in {folder}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
