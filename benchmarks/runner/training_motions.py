"""Training motions, simulated in one garment and written as one file for snug.train."""

from __future__ import annotations

import argparse
import shutil
from dataclasses import replace
from pathlib import Path

from benchmarks.plan.options import study_of
from benchmarks.plan.plan import Network, make_plan
from benchmarks.plan.study import StudyError
from benchmarks.results.run_folder import RunFolder
from benchmarks.runner.cache import Cache
from benchmarks.runner.execute_plan import held
from benchmarks.runner.executor import Executor
from benchmarks.runner.loop import Runner
from benchmarks.runner.schedule import Schedule
from reference_sim.trajectory import Trajectory
from snug.training.simulated_data import write_data_set

# The network that learns from the training motions alone, simulated to convergence.
LEARNER = "supervised-vertices"


def write_training_motions(garment: str, options: argparse.Namespace, out: Path) -> list[str]:
    """Simulate what folder `out`.parts lacks, write the file, remove the folder; return motions.

    Raises StudyError where a simulation failed, or did not reach its last frame.
    """
    study = study_of(options, "full:garments")
    study = replace(study, scenes=(f"{garment}/*",), methods=(LEARNER,))
    run = RunFolder(out.with_name(f"{out.name}.parts"))
    # A plan wants a new folder that can be made; nothing is written there.
    plan = make_plan(study, folder=run.path / "new")
    assets = plan.open_assets()
    schedule, network = Schedule(plan), Network(LEARNER, 0, garment)
    with held(run.path):
        run.remove_parts()
        runner = Runner(schedule.ground_truth(network), Cache(run, retry=True))
        runner.run(Executor(run, assets, plan.workers))
        files: dict[str, str] = {}
        for task in runner.tasks:
            outcome = runner.outcomes[task.id]
            if outcome.failed or not outcome.result["whole"]:
                reason = outcome.reason or outcome.result.get("reason", "")
                raise StudyError(f"training motion {task.label}: {outcome.status}: {reason}")
            files[outcome.result["motion"]] = outcome.files[0]
        simulations = (
            (assets.motions[name], Trajectory.load(run.path / file).positions)
            for name, file in files.items()
        )
        write_data_set(out, assets.body, assets.garments[garment], simulations)
        shutil.rmtree(run.path)
    return list(files)
