"""The tasks that a plan asks for, in the order in which they are done: what others need comes first.

Loads nothing heavy: a dry run asks for the same tasks as a run.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from itertools import groupby
from typing import Any

from benchmarks.cell import Cell, flat
from benchmarks.fingerprint.dependencies import find_module
from benchmarks.fingerprint.digest import digest
from benchmarks.method import MethodEntry
from benchmarks.methods import find_method
from benchmarks.methods.catalogue.trainings import TRAININGS
from benchmarks.metric import COMPARED_WITH
from benchmarks.metrics import MODULE_OF, names_of
from benchmarks.performance.microbenchmark import Microbenchmark, Settings
from benchmarks.plan.plan import Network, Plan, network_of, runs
from benchmarks.runner.cache import dependencies
from benchmarks.runner.task_inputs import ASSETS, TaskInputs, declared, modules_behind, modules_of
from benchmarks.scene import Scene
from benchmarks.scenes import find_scene, of_garment
from benchmarks.tasks.case import RunCase
from benchmarks.tasks.cell_task import BatchCell, RepeatCell, RunCell, RunUntimedCell
from benchmarks.tasks.ground_truth import SettleStart, SimulateClips, SimulateMotion, SimulateQuasiStatic
from benchmarks.tasks.metric_task import MeasureCell
from benchmarks.tasks.microbenchmark import RunMicrobenchmark
from benchmarks.tasks.task import Task
from benchmarks.tasks.training import LONGEST, TrainNetwork
from benchmarks.training import Simulated

AT_ONCE = 8  # cells of one scene whose processes wait for their repeats: each holds some hundred megabytes
TASKS = "benchmarks.tasks"


def tasks_of(plan: Plan) -> list[Task]:
    """Every task of the plan. Raises DeclarationError where an entry names a module that is not there."""
    tasks = list(Schedule(plan).tasks())
    for module in {module for task in tasks for module in task.modules}:
        find_module(module)
    return tasks


class Schedule:
    """Makes the tasks of one plan."""

    def __init__(self, plan: Plan) -> None:
        self.plan, self.preset, self.inputs = plan, plan.preset, TaskInputs(plan)

    def tasks(self) -> Iterator[Task]:
        plan = self.plan
        settled = {scene.name: scene for scene in plan.scenes if scene.simulated}
        others = (self._settled_in(scene) for scene in settled.values() if scene.start_of)
        yield from map(self.start, ({scene.name: scene for scene in others} | settled).values())
        learned = (task for network in plan.networks for task in self.ground_truth(network))
        yield from {task.id: task for task in learned}.values()
        yield from map(self.network, plan.networks)
        for _, cells in groupby(plan.cells, key=lambda cell: cell.scene):
            own = [cell for cell in cells if cell.timed]
            for first in range(0, len(own), AT_ONCE):
                yield from self.cells(own[first : first + AT_ONCE])
        yield from (self.cell(cell) for cell in plan.cells if not cell.timed)
        yield from (self.quasi_static(s) for s in plan.scenes if s.dynamic and self._has_reference(s))
        yield from (self.metrics(cell) for cell in plan.cells if runs(cell))
        yield from map(self.case, plan.cases)
        yield from map(self.microbenchmark, plan.microbenchmarks)

    # --- ground truth and training -------------------------------------------------------------------------

    def start(self, scene: Scene) -> SettleStart:
        needs = (self.start(self._settled_in(scene)).id,) if scene.start_of else ()
        return SettleStart(
            name=flat(scene.name), label=scene.name, scene=scene, units=self.preset.settle_frames,
            needs=needs, **self.inputs.of_scene(scene, f"{TASKS}.ground_truth"),
        )  # fmt: skip

    def ground_truth(self, network: Network) -> list[SimulateMotion | SimulateClips]:
        """What is simulated for a network to learn from."""
        said = network.training.simulated if network.training else None
        if said is None:
            return []
        entry, garment = find_method(said.method), network.garment
        motions, held_out = self._learned(network)
        given = [self.data(motion, garment, entry) for motion in (*motions, *held_out)]
        return [*given, *(self.clips(garment, said, motions, part) for part in range(said.mixed))]

    def data(self, motion: str, garment: str, entry: MethodEntry) -> SimulateMotion:
        scene = of_garment(garment, self.plan.motions.worn).scene(motion).at(self.preset)
        return SimulateMotion(
            name=f"{flat(scene.name)}/{flat(entry.name)}", label=_beside(scene.name, entry), scene=scene,
            entry=entry, units=self.preset.settle_frames + self._frames(motion),
            **self.inputs.simulated_by(entry, self.inputs.of_scene(scene, f"{TASKS}.ground_truth")),
        )  # fmt: skip

    def clips(self, garment: str, said: Simulated, motions: tuple[str, ...], part: int) -> SimulateClips:
        sort, entry = "swinging" if said.swinging else "mixed", find_method(said.method)
        clips = f"{garment}/{sort}-{len(motions)}"
        scene = of_garment(garment, self.plan.motions.worn).scene(motions[0]).at(self.preset)
        of_scene = self.inputs.simulated_by(entry, self.inputs.of_scene(scene, f"{TASKS}.ground_truth"))
        mixed_of = {name: self.inputs.motion(name) for name in motions}
        inputs = of_scene["inputs"] | {"part": part, "swinging": said.swinging, "motions": mixed_of}
        return SimulateClips(
            name=f"{flat(clips)}/{flat(entry.name)}-{part}",
            label=_beside(f"{garment}, {sort} clips of {len(motions)} motions, part {part}", entry),
            scene=scene, entry=entry, motions=motions, clips=clips, part=part, swinging=said.swinging,
            units=sum(map(self._frames, motions)),
            **of_scene | {"inputs": inputs},
        )  # fmt: skip

    def _frames(self, motion: str) -> int:
        """Of the motion, as far as progress goes: those of the library have some hundred."""
        files = self.plan.inputs.motions
        return min(self.preset.frames, files[motion].frames if motion in files else 100)

    def network(self, network: Network) -> TrainNetwork:
        chosen, (motions, held_out) = network.training, self._learned(network)
        kind, steps_of = (chosen.kind, chosen.steps_of) if chosen else (network.name, "")
        steps = self.preset.steps_of(steps_of or network.name, kind)
        steps *= LONGEST if chosen and chosen.converged else 1
        inputs = self.inputs.machine(self.plan.device) | self.inputs.of_body(network.garment) | {
            "training": [network.name, chosen],
            "seed": network.seed,
            "steps": steps,
            "motions": {name: self.inputs.motion(name) for name in motions},
            "held out": {name: self.inputs.motion(name) for name in held_out},
        }  # fmt: skip
        truth = self.ground_truth(network)
        simulated = {task.scene.motion: task.id for task in truth if isinstance(task, SimulateMotion)}
        clips = tuple(task.id for task in truth if isinstance(task, SimulateClips))
        further = modules_of(chosen.recipe.terms) if chosen else ()
        further = (*further, network.declared_in) if network.declared_in else further
        return _keyed(TrainNetwork(
            name=f"{network.garment}/{network.name}-seed{network.seed}", label=network.label,
            inputs=inputs, modules=(f"{TASKS}.training", ASSETS, *further),
            reads=(*simulated.values(), *clips), units=max(steps, 1), training=network.name, chosen=chosen,
            home=network.declared_in, seed=network.seed, garment=network.garment, steps=steps,
            motions=motions, held_out=held_out, simulated=simulated, clips=clips, device=self.plan.device,
        ))  # fmt: skip

    # --- cells ---------------------------------------------------------------------------------------------

    def cells(self, cells: list[Cell]) -> Iterator[Task]:
        """Runs, then repeats in rounds, the order of the methods turned on from round to round.

        So a machine that grows slower does not favour whoever came first.
        """
        for cell in cells:
            yield self.cell(cell)
            if cell.entry.batched and runs(cell):
                yield self._after(BatchCell, cell, cell.name)
        repeated = [cell for cell in cells if "speed" in cell.suites and runs(cell)]
        for number in range(1, self.preset.repeats):
            turn = number * len(repeated) // self.preset.repeats
            for cell in (*repeated[turn:], *repeated[:turn]):
                yield self._after(
                    RepeatCell, cell, f"{cell.name}-{number}", longest=self.preset.repeat_seconds
                )

    def cell(self, cell: Cell) -> RunCell:
        of_scene = self.inputs.of_scene(cell.scene, f"{TASKS}.cell_task", *modules_behind(cell.entry))
        inputs = of_scene["inputs"] | {"method": declared(cell.entry)}
        if cell.timed:
            inputs["least"] = self._least(cell)
        if cell.entry.seeded:
            inputs["seed"] = cell.seed
        needs = (self.start(cell.scene).id,) if cell.scene.simulated else ()
        if network := network_of(cell):
            needs = (*needs, self.network(network).id)
        kind, process = (RunCell, cell.name) if cell.timed else (RunUntimedCell, "")
        return kind(
            name=cell.name, label=cell.label, cell=cell, needs=needs, process=process,
            batch="" if process else cell.scene.name, deadline=self.preset.cell_seconds,
            least=self._least(cell),
            **of_scene | {"inputs": inputs},
        )  # fmt: skip

    def _after(self, kind: Any, cell: Cell, name: str, **fields: Any) -> Task:
        first = self.cell(cell)
        return kind(
            name=name, label=cell.label, cell=cell, inputs={"least": first.least},
            modules=(f"{TASKS}.cell_task",), needs=(first.id,),
            process=first.process, deadline=first.deadline, least=first.least, **fields,
        )  # fmt: skip

    def _least(self, cell: Cell) -> float:
        """[s] that each of its repeats has to measure, so that it is enough together."""
        return self.preset.least_seconds / (self.preset.repeats if "speed" in cell.suites else 1)

    # --- what is measured ----------------------------------------------------------------------------------

    def quasi_static(self, scene: Scene) -> SimulateQuasiStatic:
        return SimulateQuasiStatic(
            name=flat(scene.name), label=scene.name, scene=scene, units=self._frames(scene.motion),
            needs=(self.start(scene).id,), **self.inputs.of_scene(scene, f"{TASKS}.ground_truth"),
        )  # fmt: skip

    def metrics(self, cell: Cell) -> MeasureCell:
        scene, plan = cell.scene, self.plan
        cells = tuple(other for other in plan.cells if other.scene == scene and runs(other))
        compared = (other for other in cells if other.entry.role in COMPARED_WITH)
        reads = tuple(("cell", other.name) for other in compared if other != cell)
        if scene.simulated:
            reads = (*reads, self.start(scene).id)  # the scene is built from it
        quasi_static, counterpart = None, None
        if scene.dynamic:
            quasi_static = self.quasi_static(scene).id
            reads = (*reads, quasi_static)
        if scene.counterpart:
            same = (c for c in plan.cells if (c.scene.name, c.method, c.seed) ==
                    (scene.counterpart, cell.method, cell.seed))  # fmt: skip
            if (counterpart := next(same, None)) is not None:
                reads = (*reads, ("cell", counterpart.name))
        names = names_of(scene.metrics)
        modules = [MODULE_OF[name] for name in names] + list(plan.metrics)
        of_scene = self.inputs.of_scene(scene, f"{TASKS}.metric_task", *modules)
        inputs = {
            "suites": sorted(cell.suites),
            "samples": self.preset.gap_samples,
            "method": [
                cell.entry.role,
                cell.entry.reporting.family,
                cell.entry.reporting.level,
                cell.entry.conserving,
                cell.entry.static_known,
            ],
            "metrics": scene.metrics,
        }
        training = None
        if (network := network_of(cell)) and "training_distance" in names:
            training = self.network(network)
            inputs |= {name: training.inputs[name] for name in ("training", "seed", "motions")}
        return MeasureCell(
            name=cell.name, label=cell.label, cell=cell, cells=cells,
            gap_samples=self.preset.gap_samples, quasi_static=quasi_static,
            counterpart=counterpart, training=training, outside=plan.metrics,
            needs=(("cell", cell.name),), reads=reads, batch=scene.name,
            **of_scene | {"inputs": of_scene["inputs"] | inputs},
        )  # fmt: skip

    def case(self, case: Any) -> RunCase:
        return RunCase(
            name=case.name, label=case.name, case=case, deadline=case.seconds,
            inputs=self.inputs.machine() | {"declared": declared(case)},
            modules=(case.module, "benchmarks.validation.case", f"{TASKS}.case"),
        )  # fmt: skip

    def microbenchmark(self, benchmark: Microbenchmark) -> RunMicrobenchmark:
        name, method = flat(benchmark.label.replace(" ", "-")), benchmark.method
        chosen = TRAININGS.get(method)
        inputs: dict[str, Any] = {"declared": declared(benchmark), "training": chosen}
        settings = Settings(method=method, repeats=benchmark.repeats, chosen=chosen)
        if benchmark.trains:
            steps = self.preset.steps_of(method, method)
            settings = dataclasses.replace(settings, device=self.plan.device, steps=steps)
            inputs["steps"] = steps
        return _keyed(RunMicrobenchmark(
            name=name, label=benchmark.label, inputs=self.inputs.machine(settings.device) | inputs,
            modules=(benchmark.module, "benchmarks.performance.microbenchmark", f"{TASKS}.microbenchmark"),
            benchmark=benchmark, entry=find_method(method), settings=settings, process=name,
        ))  # fmt: skip

    # --- what of the plan is asked for several times -----------------------------------------------------

    def _learned(self, network: Network) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """The motions that a network trains on, and those that stop its training."""
        motions, training = self.plan.motions.train_of(network.garment), network.training
        count = training.held_out if training and training.held_out < len(motions) else 0
        last = len(motions) - count
        return motions[:last], motions[last:] if training and training.converged else ()

    def _settled_in(self, scene: Scene) -> Scene:
        planned = next((s for s in self.plan.scenes if s.name == scene.start_of), None)
        return planned or find_scene(scene.start_of, self.plan.motions.first_garment).at(self.preset)

    def _has_reference(self, scene: Scene) -> bool:
        of_scene = (cell for cell in self.plan.cells if cell.scene == scene)
        return any(cell.entry.role == "reference" and runs(cell) for cell in of_scene)


def _beside(what: str, entry: MethodEntry) -> str:
    """A label: the reference goes without saying."""
    return what if entry.role == "reference" else f"{what} by {entry.name}"


def _keyed(task: Any) -> Any:
    """The task with a key of all that it depends on: what was interrupted goes on where that is the same."""
    key = digest(dependencies(task))
    if isinstance(task, RunMicrobenchmark):
        return dataclasses.replace(task, settings=dataclasses.replace(task.settings, key=key))
    return dataclasses.replace(task, key=key)
