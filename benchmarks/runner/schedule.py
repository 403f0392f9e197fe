"""Which tasks a plan asks for, and in which order: what others need comes first.

Loads nothing heavy: a dry run makes the same tasks as a run.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from itertools import groupby
from typing import TYPE_CHECKING, Any

from benchmarks.fingerprint.dependencies import find_module
from benchmarks.fingerprint.digest import digest
from benchmarks.method import MethodEntry
from benchmarks.methods.catalogue.all_methods import find_method
from benchmarks.metric import COMPARED_WITH
from benchmarks.metrics import names_of
from benchmarks.plan.plan import Cell, Network, Plan, flat, network_of, runs
from benchmarks.runner import task_inputs
from benchmarks.runner.cache import dependencies
from benchmarks.runner.task_inputs import TaskInputs, code_behind, declared, users_code
from benchmarks.scene import Scene
from benchmarks.scenes import find_scene, of_garment
from benchmarks.tasks.case import RunCase
from benchmarks.tasks.cell_task import BatchCell, RepeatCell, RunCell, RunUntimedCell
from benchmarks.tasks.ground_truth import SettleStart, SimulateClips, SimulateMotion, SimulateQuasiStatic
from benchmarks.tasks.metric_task import MeasureCell
from benchmarks.tasks.pretrained_network import TakeNetwork, take_network, without_machine
from benchmarks.tasks.task import Task
from benchmarks.tasks.training import LONGEST, TrainNetwork
from benchmarks.training import Simulated
from snug.motion.recorded.table import CLIPS

if TYPE_CHECKING:
    from benchmarks.validation.case import Case

AT_ONCE = 8  # cells of one scene whose processes wait for their repeats: each holds some hundred megabytes
TASKS = "benchmarks/tasks"


def tasks_of(plan: Plan) -> list[Task]:
    """Return every task of the plan. Raises DeclarationError where an entry names a missing module."""
    return list(Schedule(plan).tasks())


class Schedule:
    """The tasks of one plan, each made once."""

    def __init__(self, plan: Plan) -> None:
        self.plan, self.preset, self.inputs = plan, plan.preset, TaskInputs(plan)
        self._networks: dict[Network, TrainNetwork] = {}

    def tasks(self) -> Iterator[Task]:
        """Yield the tasks in the order in which they are done."""
        plan = self.plan
        simulated = {scene.name: scene for scene in plan.scenes if scene.simulated}
        others = (self._settled_in(scene) for scene in simulated.values() if scene.start_of)
        yield from map(self.start, ({scene.name: scene for scene in others} | simulated).values())
        networks = [self.obtained(network) for network in plan.networks]
        trained = (n for n, task in zip(plan.networks, networks) if isinstance(task, TrainNetwork))
        taught = (task for network in trained for task in self.ground_truth(network))
        yield from {task.id: task for task in taught}.values()
        yield from networks
        for _, cells in groupby(plan.cells, key=lambda cell: cell.scene):
            timed = [cell for cell in cells if cell.timed]
            for first in range(0, len(timed), AT_ONCE):
                yield from self.cells(timed[first : first + AT_ONCE])
        yield from (self.cell(cell) for cell in plan.cells if not cell.timed)
        yield from (self.quasi_static(s) for s in plan.scenes if s.dynamic and self._has_reference(s))
        yield from (self.metrics(cell) for cell in plan.cells if runs(cell))
        yield from map(self.case, plan.cases)

    # --- ground truth and training -------------------------------------------------------------------------

    def start(self, scene: Scene) -> SettleStart:
        """Return the task that settles the garment of a scene."""
        needs = (SettleStart.id_of(self._settled_in(scene)),) if scene.start_of else ()
        return SettleStart(
            name=flat(scene.name), label=scene.name, scene=scene, units=self.preset.settle_frames,
            needs=needs, **self.inputs.of_scene(scene, f"{TASKS}/ground_truth.py"),
        )  # fmt: skip

    def ground_truth(self, network: Network) -> list[SimulateMotion | SimulateClips]:
        """Return the simulations that a network learns from."""
        simulated = network.training.simulated if network.training else None
        if simulated is None:
            return []
        entry, garment = find_method(simulated.method), network.garment
        motions, held_out = self._learned(network)
        given = [self.data(motion, garment, entry) for motion in (*motions, *held_out)]
        clips = (self.clips(garment, simulated, motions, part) for part in range(simulated.mixed))
        return [*given, *clips]

    def data(self, motion: str, garment: str, entry: MethodEntry) -> SimulateMotion:
        """Return the task that simulates a training motion."""
        scene = of_garment(garment, self.plan.motions.worn).scene(motion).at(self.preset)
        return SimulateMotion(
            name=f"{flat(scene.name)}/{flat(entry.name)}", label=_label(scene.name, entry), scene=scene,
            entry=entry, units=self.preset.settle_frames + self._frames(motion),
            **self.inputs.simulated_by(entry, self.inputs.of_scene(scene, f"{TASKS}/ground_truth.py")),
        )  # fmt: skip

    def clips(self, garment: str, simulated: Simulated, motions: tuple[str, ...], part: int) -> SimulateClips:
        """Return the task that simulates one part of the augmented clips of these motions."""
        sort, entry = "swinging" if simulated.swinging else "mixed", find_method(simulated.method)
        clips = f"{garment}/{sort}-{len(motions)}"
        scene = of_garment(garment, self.plan.motions.worn).scene(motions[0]).at(self.preset)
        of_scene = self.inputs.simulated_by(entry, self.inputs.of_scene(scene, f"{TASKS}/ground_truth.py"))
        mixed_of = {name: self.inputs.motion(name) for name in motions}
        inputs = of_scene["inputs"] | {"part": part, "swinging": simulated.swinging, "motions": mixed_of}
        return SimulateClips(
            name=f"{flat(clips)}/{flat(entry.name)}-{part}",
            label=_label(f"{garment}, {sort} clips of {len(motions)} motions, part {part}", entry),
            scene=scene, entry=entry, motions=motions, clips=clips, part=part, swinging=simulated.swinging,
            units=sum(map(self._frames, motions)),
            **of_scene | {"inputs": inputs, "code": (*of_scene["code"], *task_inputs.CLIPS)},
        )  # fmt: skip

    def obtained(self, network: Network) -> TrainNetwork | TakeNetwork:
        """Return the task that trains a network, or takes it from a file where the plan wants no trainings.

        A network of a user's file is trained all the same, unless its file is there.
        """
        task = self.network(network)
        if self.plan.trained is None or task.chosen is None:
            return task
        taken = take_network(task, self.plan.trained)
        return task if network.users_training and taken.source is None else taken

    def network(self, network: Network) -> TrainNetwork:
        """Return the task that trains a network."""
        if network not in self._networks:
            self._networks[network] = self._network(network)
        return self._networks[network]

    def _network(self, network: Network) -> TrainNetwork:
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
        task = TrainNetwork(
            name=network.task_id[1], label=network.label,
            inputs=inputs, code=(*task_inputs.TRAINING, *users_code(network.declared_in)),
            reads=(*simulated.values(), *clips), units=max(steps, 1), training=network.name, chosen=chosen,
            home=network.declared_in, seed=network.seed, garment=network.garment, steps=steps,
            motions=motions, held_out=held_out, simulated=simulated, clips=clips, device=self.plan.device,
        )  # fmt: skip
        parts = dependencies(task)
        if truth:
            parts["simulations"] = digest([[t.title, without_machine(dependencies(t))] for t in truth])
        return dataclasses.replace(task, parts=parts)

    # --- cells ---------------------------------------------------------------------------------------------

    def cells(self, cells: list[Cell]) -> Iterator[Task]:
        """Yield the runs, then repeats in rounds, the order of the methods rotated from round to round.

        So a machine that grows slower does not favour whoever came first.
        """
        for cell in cells:
            yield self.cell(cell)
            if cell.entry.batched and runs(cell):
                yield self._same_process(BatchCell, cell, cell.batch_id[1])
        repeated = [cell for cell in cells if "speed" in cell.suites and runs(cell)]
        for number in range(1, self.preset.repeats):
            turn = number * len(repeated) // self.preset.repeats
            for cell in (*repeated[turn:], *repeated[:turn]):
                yield self._same_process(
                    RepeatCell, cell, cell.repeat_id(number)[1], longest=self.preset.repeat_seconds
                )

    def cell(self, cell: Cell) -> RunCell:
        """Return the task that runs a cell."""
        of_scene = self.inputs.of_scene(cell.scene, *code_behind(cell.entry))
        inputs = of_scene["inputs"] | {"method": declared(cell.entry)}
        if cell.timed:
            inputs["least"] = self._least(cell)
        if cell.entry.seeded:
            inputs["seed"] = cell.seed
        needs = (SettleStart.id_of(cell.scene),) if cell.scene.simulated else ()
        if network := network_of(cell):
            needs = (*needs, network.task_id)
        kind, process = (RunCell, cell.name) if cell.timed else (RunUntimedCell, "")
        return kind(
            name=cell.name, label=cell.label, cell=cell, needs=needs, process=process,
            batch="" if process else cell.scene.name, deadline=self.preset.cell_seconds,
            least=self._least(cell),
            **of_scene | {"inputs": inputs},
        )  # fmt: skip

    def _same_process(
        self, kind: type[BatchCell] | type[RepeatCell], cell: Cell, name: str, **fields: Any
    ) -> Task:
        """Return a task that follows a timed cell in its process."""
        least = self._least(cell)
        return kind(
            name=name, label=cell.label, cell=cell, inputs={"least": least},
            code=task_inputs.RUNS, needs=(cell.task_id,),
            process=cell.name, deadline=self.preset.cell_seconds, least=least, **fields,
        )  # fmt: skip

    def _least(self, cell: Cell) -> float:
        """Return the seconds that each of its repeats has to measure, so that it is enough together."""
        return self.preset.least_seconds / (self.preset.repeats if "speed" in cell.suites else 1)

    # --- measurements --------------------------------------------------------------------------------------

    def quasi_static(self, scene: Scene) -> SimulateQuasiStatic:
        """Return the task that simulates each frame of a scene held still."""
        return SimulateQuasiStatic(
            name=flat(scene.name), label=scene.name, scene=scene, units=self._frames(scene.motion),
            needs=(SettleStart.id_of(scene),), **self.inputs.of_scene(scene, f"{TASKS}/ground_truth.py"),
        )  # fmt: skip

    def metrics(self, cell: Cell) -> MeasureCell:
        """Return the task that measures a cell, beside those that it is compared with."""
        scene, plan, entry = cell.scene, self.plan, cell.entry
        cells = tuple(other for other in plan.cells if other.scene == scene and runs(other))
        compared = (other for other in cells if other.entry.role in COMPARED_WITH)
        reads = tuple(other.task_id for other in compared if other != cell)
        if scene.simulated:
            reads = (*reads, SettleStart.id_of(scene))  # the scene is built from it
        quasi_static, counterpart = None, None
        if scene.dynamic:
            quasi_static = SimulateQuasiStatic.id_of(scene)
            reads = (*reads, quasi_static)
        if scene.counterpart:
            wanted = (scene.counterpart, cell.method, cell.seed)
            same = (c for c in plan.cells if (c.scene.name, c.method, c.seed) == wanted)
            if (counterpart := next(same, None)) is not None:
                reads = (*reads, counterpart.task_id)
        names = names_of(scene.metrics)
        of_scene = self.inputs.of_scene(
            scene, f"{TASKS}/metric_task.py", *task_inputs.METRICS, *users_code(*plan.metrics)
        )
        inputs = {
            "suites": sorted(cell.suites),
            "samples": self.preset.gap_samples,
            "method": [
                entry.role,
                entry.reporting.family,
                entry.reporting.level,
                entry.conserving,
                entry.static_known,
                entry.other_mesh,
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
            needs=(cell.task_id,), reads=reads, batch=scene.name,
            units=self._frames(scene.motion) * MeasureCell.shares(len(cells) if cells[:1] == (cell,) else 0),
            **of_scene | {"inputs": of_scene["inputs"] | inputs},
        )  # fmt: skip

    def case(self, case: Case) -> RunCase:
        """Return the task of a known answer or a stress test."""
        return RunCase(
            name=case.name, label=case.name, case=case, deadline=case.seconds, process=case.process,
            inputs=self.inputs.machine() | {"declared": declared(case)},
            code=(find_module(case.module), *task_inputs.CASES),
        )  # fmt: skip

    # --- facts of the plan ---------------------------------------------------------------------------------

    def _frames(self, motion: str) -> int:
        """Return the frames of a motion, as far as progress goes: those made by code have some hundred."""
        files, train = self.plan.inputs.motions, self.plan.motions.train
        frames = files[motion].frames if motion in files else CLIPS[motion].frames if motion in CLIPS else 100
        return min(self.preset.train_frames if motion in train else self.preset.frames, frames)

    def _learned(self, network: Network) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Return the motions that a network trains on, and those that stop its training."""
        motions, training = self.plan.motions.train, network.training
        count = training.held_out if training and training.held_out < len(motions) else 0
        last = len(motions) - count
        return motions[:last], motions[last:] if training and training.converged else ()

    def _settled_in(self, scene: Scene) -> Scene:
        """Return the scene whose settled garment another one starts from."""
        planned = next((s for s in self.plan.scenes if s.name == scene.start_of), None)
        return planned or find_scene(scene.start_of, self.plan.motions.first_garment).at(self.preset)

    def _has_reference(self, scene: Scene) -> bool:
        """Return whether the plan simulates a scene by the reference solver."""
        of_scene = (cell for cell in self.plan.cells if cell.scene == scene)
        return any(cell.entry.role == "reference" and runs(cell) for cell in of_scene)


def _label(what: str, entry: MethodEntry) -> str:
    """Return a label that names the method unless it is the reference."""
    return what if entry.role == "reference" else f"{what} by {entry.name}"
