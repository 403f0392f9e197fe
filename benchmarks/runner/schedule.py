"""Which tasks a plan asks for, and in which order: what others need comes first.

Loads nothing heavy: a dry run makes the same tasks as a run.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any

from benchmarks import provenance
from benchmarks.method import MethodEntry, Simulated
from benchmarks.methods import find_method
from benchmarks.methods.own_energies import find_own_reference
from benchmarks.metric import COMPARED_WITH
from benchmarks.plan.cell import Cell, TaskId, id_of
from benchmarks.plan.plan import Network, Plan, network_of, runs
from benchmarks.presets import find_preset
from benchmarks.provenance import digest, digest_of_file, find_module, software
from benchmarks.results.run_folder import RunFolder, flat
from benchmarks.runner.cells import files_of, repeat_cell, run_case, run_cell, time_batch
from benchmarks.runner.ground_truth import (
    clips_of,
    files_of_start,
    settle_start,
    simulate_clips,
    simulate_motion,
    simulate_quasi_static,
)
from benchmarks.runner.measurements import measure_cell
from benchmarks.runner.networks import NetworkTraining, find_pretrained, take, train
from benchmarks.runner.task import Outcome, Task
from benchmarks.scene import Scene
from benchmarks.scenes import find_garment, find_scene
from snug.trained import FOLDER

if TYPE_CHECKING:
    from benchmarks.validation.case import Case

# Code whose changes make an outcome stale; of a run also its method's and scene's: code_behind.
RUNNING = (
    "reference_sim", "snug", "benchmarks/assets.py", "benchmarks/scene.py", "benchmarks/scenes",
    "benchmarks/meshes.py", "benchmarks/external", "benchmarks/method.py",
    "benchmarks/methods/simulation.py", "benchmarks/methods/sweeps.py", "benchmarks/timing.py",
    "benchmarks/runner/isolated_process.py", "benchmarks/runner/cells.py",
    "benchmarks/runner/ground_truth.py", "benchmarks/runner/networks.py",
)  # fmt: skip
MEASURING = (
    *RUNNING, "benchmarks/metrics", "benchmarks/metric.py", "benchmarks/results",
    "benchmarks/runner/measurements.py", "benchmarks/methods/declared_networks.py",
    "benchmarks/methods/own_energies.py", "benchmarks/methods/reference_variants.py",
)  # fmt: skip
CASES = (*MEASURING, "benchmarks/validation")
USERS_OWN = (*MEASURING, "benchmarks/methods")  # what a user's file may import


def read_entry(entry: MethodEntry | Scene | Case) -> dict[str, Any]:
    """Return what an entry declares, without descriptions; of files their content."""
    values = {name: value for name, value in vars(entry).items() if name not in ("description", "label")}
    if isinstance(entry, MethodEntry | Scene):
        values["files"] = {path: digest_of_file(Path(path)) for path in values["files"]}
    return values


def code_behind(entry: MethodEntry | Scene) -> tuple[str, ...]:
    """Return the file of a scene's or method's module, and what files of a user depend on.

    Raises DeclarationError where its module is missing.
    """
    file = find_module(entry.module)
    return users_code(file, entry.declared_in) or (file,)


def users_code(*homes: str) -> tuple[str, ...]:
    """Return those that are files of users, by absolute paths, and what of ours they may import."""
    files = tuple(home for home in homes if Path(home).is_absolute())
    return (*files, *USERS_OWN) if files else ()


TRAINED = "training"  # the stage of networks that no file has
# cells of a scene whose processes wait for repeats: each holds 100 MB
AT_ONCE = 8
# Cells of one scene that a process measures, beside those compared with.
TOGETHER = 12


def tasks_of(plan: Plan) -> list[Task]:
    """Return every task of the plan. Raises DeclarationError for a missing module.

    Tasks are expected to take as long as their garments are large.
    """
    scale = plan.study.sizes.garment_vertices / 1000
    return [replace(task, work=scale * task.work) for task in Schedule(plan).tasks()]


class Schedule:
    """The tasks of one plan."""

    def __init__(self, plan: Plan) -> None:
        self.plan, self.preset = plan, plan.study.sizes
        self.folder = RunFolder(plan.folder)

    def tasks(self) -> Iterator[Task]:
        """Yield the tasks in the order in which they are done."""
        plan = self.plan
        simulated = {scene.name: scene for scene in plan.scenes if scene.simulated}
        others = (self._find_start(scene) for scene in simulated.values() if scene.start_of)
        yield from map(self.start, ({scene.name: scene for scene in others} | simulated).values())
        networks = {network: self.network(network) for network in plan.networks}
        trained = (network for network, task in networks.items() if task.stage == TRAINED)
        taught = (task for network in trained for task in self.ground_truth(network))
        yield from {task.id: task for task in taught}.values()
        yield from networks.values()
        for _, cells in groupby(plan.cells, key=lambda cell: cell.scene):
            timed = [cell for cell in cells if cell.timed]
            for first in range(0, len(timed), AT_ONCE):
                yield from self.cells(timed[first : first + AT_ONCE])
        yield from (self.cell(cell) for cell in plan.cells if not cell.timed)
        solved = {cell.scene.name for cell in plan.cells if cell.entry.role == "reference" and runs(cell)}
        yield from (self.quasi_static(s) for s in plan.scenes if s.dynamic and s.name in solved)
        yield from (self.metrics(cell) for cell in plan.cells if runs(cell))
        yield from map(self.case, plan.cases)

    def start(self, scene: Scene) -> Task:
        """Return the task that settles the garment of a scene."""
        return Task(
            kind="start", name=flat(scene.name), label=scene.name, stage="ground truth", silent=True,
            run=partial(settle_start, scene), files=files_of_start(scene, self.folder),
            needs=(id_of("start", self._find_start(scene)),) if scene.start_of else (),
            **self._list_scene(scene),
        )  # fmt: skip

    def ground_truth(self, network: Network) -> list[Task]:
        """Return the simulations that a network learns from: of motions, then of clips."""
        simulated = network.training.at(self.preset).simulated
        if simulated is None:
            return []
        entry, garment = find_method(simulated.method), network.garment
        motions = self.plan.motions.train
        tasks = [self.data(motion, garment, entry) for motion in motions]
        clips = (self.clips(garment, simulated, motions, part) for part in range(simulated.mixed))
        return [*tasks, *clips]

    def data(self, motion: str, garment: str, entry: MethodEntry) -> Task:
        """Return the task that simulates a training motion."""
        scene = find_garment(garment, self.plan.motions.garments).scene(motion).at(self.preset)
        return Task(
            kind="data", name=f"{flat(scene.name)}/{flat(entry.name)}", label=_label(scene.name, entry),
            stage="ground truth", silent=True, run=partial(simulate_motion, scene, entry),
            **self._list_scene(scene, *code_behind(entry), method=read_entry(entry)),
        )  # fmt: skip

    def clips(self, garment: str, simulated: Simulated, motions: tuple[str, ...], part: int) -> Task:
        """Return the task that simulates a part of the augmented clips of motions."""
        entry, turns = find_method(simulated.clips_by or simulated.method), simulated.turns
        clips = clips_of(garment, motions, turns)
        scene = find_garment(garment, self.plan.motions.garments).scene(motions[0]).at(self.preset)
        mixed_of = {name: self._motion(name) for name in motions}
        return Task(
            kind="clips", name=f"{flat(clips)}/{flat(entry.name)}-{part}",
            label=_label(f"{garment}, mixed clips of {len(motions)} motions, part {part}", entry),
            stage="ground truth", silent=True,
            run=partial(simulate_clips, scene, entry, motions, part, turns),
            **self._list_scene(
                scene, *code_behind(entry), method=read_entry(entry), part=part, turns=turns, motions=mixed_of
            ),
        )  # fmt: skip

    def network(self, network: Network) -> Task:
        """Return the task that trains a network, or takes it where the plan wants no trainings.

        A network of a user's file is trained all the same, unless its file is there.
        """
        job, folder = self.training(network), self.plan.study.trained
        folder = FOLDER if job.training.packaged else folder
        fields: dict[str, Any] = {
            "kind": "network", "name": network.task_id[1], "label": network.label, "silent": True,
            "files": job.files(self.folder),
        }  # fmt: skip
        if folder is not None:
            source, refusal = find_pretrained(job, folder)
            if source or not network.users_training:
                return Task(
                    stage="pretrained networks", run=partial(take, job, source or Path()), skip=refusal,
                    inputs={"file": digest_of_file(source) if source else ""},
                    code=RUNNING, **fields,
                )  # fmt: skip
        return Task(
            stage=TRAINED, run=partial(train, job), reads=job.reads, work=job.work,
            inputs=job.inputs, code=(*RUNNING, *users_code(network.declared_in)), **fields,
        )  # fmt: skip

    def training(self, network: Network) -> NetworkTraining:
        """Return how a network is trained."""
        motions, chosen = self.plan.motions.train, network.training.at(self.preset)
        steps = self.preset.steps.get(network.name, self.preset.steps.get(chosen.kind, 0))
        inputs = self._machine(self.plan.study.device) | self._list_body(network.garment)
        if chosen.packaged:  # of the package's training clips, which are whole
            inputs["assets"]["train_frames"] = find_preset("quick").train_frames
        else:
            inputs |= {
                "training": [network.name, chosen], "seed": network.seed, "steps": steps,
                "motions": {name: self._motion(name) for name in motions},
            }  # fmt: skip
        digests = {name: digest(value) for name, value in inputs.items()}
        return NetworkTraining(
            network=network, training=chosen, steps=steps, motions=motions, device=self.plan.study.device,
            reads=tuple(task.id for task in self.ground_truth(network)), inputs=digests,
            key=digest(digests | software(*RUNNING, *users_code(network.declared_in))),
        )  # fmt: skip

    def cells(self, cells: list[Cell]) -> Iterator[Task]:
        """Yield the runs, then repeats in rounds, methods rotated from round to round.

        So a machine that grows slower does not favour whoever came first.
        """
        for cell in cells:
            yield self.cell(cell)
            if cell.entry.batched and runs(cell):
                yield self._make_timed(cell, cell.id("batch"), time_batch)
        repeated = [cell for cell in cells if "speed" in cell.suites and runs(cell)]
        longest = self.preset.repeat_seconds
        for number in range(1, self.preset.repeats):
            turn = number * len(repeated) // self.preset.repeats
            for cell in (*repeated[turn:], *repeated[:turn]):
                inputs = {"least": self._min_time(cell), "longest": longest}
                run = partial(repeat_cell, longest)
                yield self._make_timed(cell, cell.id("repeat", number), run, inputs=inputs)

    def cell(self, cell: Cell) -> Task:
        """Return the task that runs a cell: alone where it is timed."""
        entry = cell.entry
        inputs: dict[str, Any] = {"method": read_entry(entry)}
        if cell.timed:
            inputs["least"] = self._min_time(cell)
        if entry.seeded:
            inputs["seed"] = cell.seed
        needs = (id_of("start", cell.scene),) if cell.scene.simulated else ()
        if network := network_of(cell):
            needs = (*needs, network.task_id)
        fields: dict[str, Any] = {
            "skip": entry.skip(cell.scene) or "", "files": files_of(cell, self.folder), "needs": needs,
            **self._list_scene(cell.scene, *code_behind(entry), **inputs),
        }  # fmt: skip
        if cell.timed:
            return self._make_timed(cell, cell.id(), run_cell, **fields)
        return Task(
            kind="cell", name=cell.name, label=cell.label, stage="untimed methods",
            run=partial(run_cell, cell, self._min_time(cell)), batch=cell.scene.name,
            deadline=self.preset.cell_seconds, **fields,
        )  # fmt: skip

    def _make_timed(self, cell: Cell, id: TaskId, run: Callable[..., Outcome], **fields: Any) -> Task:
        """Return the run of a timed cell, or a task that follows it in its process."""
        min_time = self._min_time(cell)
        usual = {"inputs": {"least": min_time}, "code": RUNNING, "needs": (cell.id(),)}
        fields = usual | fields
        return Task(
            kind=id[0], name=id[1], label=cell.label, stage="timed methods", run=partial(run, cell, min_time),
            process=cell.name, motion=cell.scene.motion if cell.scene.dressed else "",
            deadline=self.preset.cell_seconds, **fields,
        )  # fmt: skip

    def _min_time(self, cell: Cell) -> float:
        """Return the seconds that each of its repeats has to measure."""
        return self.preset.least_seconds / (self.preset.repeats if "speed" in cell.suites else 1)

    def quasi_static(self, scene: Scene) -> Task:
        """Return the task that simulates each frame of a scene held still."""
        return Task(
            kind="quasi-static", name=flat(scene.name), label=scene.name,
            stage="quasi-static solutions", silent=True, run=partial(simulate_quasi_static, scene),
            needs=(id_of("start", scene),), **self._list_scene(scene),
        )  # fmt: skip

    def metrics(self, cell: Cell) -> Task:
        """Return the task that measures a cell, beside those that it is compared with."""
        scene, plan, entry = cell.scene, self.plan, cell.entry
        cells = tuple(other for other in plan.cells if other.scene == scene and runs(other))
        reference = find_own_reference(entry)  # ends at the minimum of the network's energies
        minima = (reference.name,) if reference else ()
        reads = tuple(
            other.id()
            for other in cells
            if other != cell and (other.entry.role in COMPARED_WITH or other.method in minima)
        )
        if scene.simulated:
            reads = (*reads, id_of("start", scene))  # the scene is built from it
        if scene.dynamic:
            reads = (*reads, id_of("quasi-static", scene))
        key = (scene.counterpart, cell.method, cell.seed)
        reads += tuple(c.id() for c in plan.cells if (c.scene.name, c.method, c.seed) == key)
        method = [entry.role, entry.family, entry.level, entry.static_known, entry.other_mesh]
        run = partial(measure_cell, cell, cells, self.preset.gap_samples, plan.metrics)
        part = cells.index(cell) % math.ceil(len(cells) / TOGETHER)
        return Task(
            kind="metrics", name=cell.name, label=cell.label, stage="metrics",
            run=run, needs=(cell.id(),), reads=reads, batch=f"{scene.name} {part}",
            files=(self.folder.relative(self.folder.curves_path(*cell.key)),),
            **self._list_scene(
                scene, *MEASURING, *users_code(*plan.metrics), suites=sorted(cell.suites),
                samples=self.preset.gap_samples, method=method, metrics=scene.metrics,
            ),
        )  # fmt: skip

    def case(self, case: Case) -> Task:
        """Return the task of a known answer or a stress test."""
        return Task(
            kind="case", name=case.name, label=case.name, stage="known answers", run=partial(run_case, case),
            warm_up=case.warm_up, deadline=case.seconds, process=case.process,
            inputs=self._machine() | {"declared": read_entry(case)},
            code=(find_module(case.module), *CASES),
        )  # fmt: skip

    def _machine(self, device: str = "cpu") -> dict[str, Any]:
        """Return the machine: times of another are not reused. device: of a training."""
        facts = provenance.hardware(device)
        names = ("processor", "python", "accelerator")  # one thread works, however many cores there are
        return {"machine": {name: facts.get(name) for name in names} | {"device": device, "threads": 1}}

    def _list_scene(self, scene: Scene, *code: str, **inputs: Any) -> dict[str, Any]:
        """Return inputs and code of a task that builds the scene, with these; not its metrics."""
        declaration = read_entry(scene) | {"timed": scene.timed, "dynamic": scene.dynamic}
        del declaration["metrics"], declaration["counterpart"]
        inputs |= self._machine() | {"scene": declaration}
        if scene.dressed:
            inputs |= self._list_body(scene.garment) | {"motion": self._motion(scene.motion)}
            if scene.motion not in self.plan.motions.train:  # those have a length of their own
                inputs["frames"] = self.preset.frames
        if scene.part == "clip":
            inputs["clip_frames"] = self.preset.clip_frames
        return {"inputs": inputs, "code": (*code, *RUNNING, *code_behind(scene))}

    def _list_body(self, garment: str) -> dict[str, Any]:
        """Return the inputs that the assets are made from."""
        names = ("garment_vertices", "train_frames")
        sizes = {name: getattr(self.preset, name) for name in names} | {"garment": garment}
        inputs: dict[str, Any] = {"assets": sizes}
        if user_body := self.plan.inputs.body:
            inputs["body"] = user_body.digest
        if (user_garment := self.plan.inputs.garment) and garment == user_garment.name:
            inputs["own garment"] = user_garment.digest
        return inputs

    def _motion(self, name: str) -> str:
        """Return a motion's name, with its digest where it is of a file.

        The code that makes an embedded one counts by itself.
        """
        files = self.plan.inputs.motions
        return f"{name} {digest(files[name])}" if name in files else name

    def _find_start(self, scene: Scene) -> Scene:
        """Return the scene whose settled garment another one starts from."""
        planned = next((s for s in self.plan.scenes if s.name == scene.start_of), None)
        garment = self.plan.motions.garments[0].garment
        return planned or find_scene(scene.start_of, garment).at(self.preset)


def _label(text: str, entry: MethodEntry) -> str:
    """Return a label that names the method unless it is the reference."""
    return text if entry.role == "reference" else f"{text} by {entry.name}"
