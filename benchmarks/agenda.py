"""The pieces of work that a plan asks for, each known by its inputs and code before anything is run.

Ground truth, networks, cells, repeats and metrics hang on one another by their keys: what is stale makes
stale what was made from it. Loads nothing heavy: a dry run asks the same questions as a run.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from functools import cached_property
from typing import Any

from snug.recipe import DEFAULT, TRAININGS

from . import provenance
from .fingerprint import code_of, data_files, digest, preset_values
from .methods import find_method
from .plan import Cell, Network, Plan, network_of, runs
from .records import Records, Work
from .results import CLIP
from .scene import Scene
from .scenes import dressed_scene

REFERENCE = "simulation"


class Agenda:
    """Works of a plan by kind; equal questions get equal answers.

    lost: names of training motions' simulations that have failed. Who learns without them is another.
    """

    def __init__(self, plan: Plan) -> None:
        self.plan = plan
        self.lost: frozenset[str] = frozenset()

    def remember_lost(self, records: Records) -> None:
        """Those whose records say that they have failed."""
        learned = [(motion, g) for g in self.plan.simulated for motion in self.plan.train_of(g)]
        works = [self.data(motion, garment) for motion, garment in learned]
        self.lost |= {work.name for work in works if records.find(work).state == "failed"}

    @cached_property
    def machine(self) -> dict[str, Any]:
        """Where and with what: times of another machine or library are not reused."""
        facts = provenance.hardware(self.plan.device)
        names = ("processor", "cores", "python", "device", "accelerator")
        return {name: facts[name] for name in names if name in facts} | provenance.versions()

    def start(self, scene: Scene) -> Work:
        """The garment settled in the first pose of a dressed scene, and the posed body."""
        return self._on_body("start", scene)

    def data(self, motion: str, garment: str) -> Work:
        """The simulation of a training motion."""
        return self._on_body("data", dressed_scene(motion, garment))

    def network(self, network: Network) -> Work:
        """A trained network."""
        kind, plan = network.name, self.plan
        training, motions = TRAININGS.get(kind), plan.train_of(network.garment)
        code = code_of("benchmarks.training", "benchmarks.wardrobe")
        inputs = self.inputs(code) | {
            "kind": [kind, training.kind if training else kind],
            "seed": network.seed,
            "garment": network.garment,
            "steps": plan.preset.steps_of(kind),
            "recipe": dataclasses.asdict(training.recipe if training else DEFAULT),
            "motions": {name: self.motion(name) for name in motions},
        }
        if training and training.simulated:
            data = [self.data(name, network.garment) for name in motions]
            inputs["targets"] = [work.key for work in data]
            if lost := sorted(work.name for work in data if work.name in self.lost):
                inputs["without"] = lost
        return Work("network", f"{flat(network.garment)}/{kind}-seed{network.seed}", inputs, code)

    def cell(self, cell: Cell) -> Work:
        """The trajectory of a method in a scene, timed once."""
        entry = find_method(cell.method)
        code = code_of("benchmarks.cell", cell.scene.module, entry.module)
        inputs = self._scene(cell.scene, code) | {"method": declared(entry)}
        if entry.seeded:
            inputs["seed"] = cell.seed
        if entry.package:
            inputs["package"] = provenance.package_version(entry.package)
        if entry.needs_body:
            inputs["recipe"] = dataclasses.asdict(DEFAULT)
        if cell.scene.dressed:
            inputs["start"] = self.start(cell.scene).key
        if network := network_of(cell):
            inputs["network"] = self.network(network).key
        return Work("cell", name_of(cell), inputs, code)

    def repeat(self, cell: Cell, number: int) -> Work:
        """The same once more, for its time alone."""
        first = self.cell(cell)
        return Work("repeat", f"{name_of(cell)}-{number}", {"cell": first.key}, first.code)

    def metrics(self, cell: Cell) -> Work:
        """What is measured of a cell's trajectory, beside those of the reference."""
        code = code_of("benchmarks.evaluate", cell.scene.module)
        near = [c for c in self.plan.cells if c.scene == cell.scene and c.method.startswith(REFERENCE)]
        inputs = {
            "cell": self.cell(cell).key,
            "references": [self.cell(other).key for other in near if runs(other)],
            "suites": sorted(cell.suites),
            "samples": self.plan.preset.gap_samples,
        }
        if cell.scene.dressed:
            inputs["recipe"] = dataclasses.asdict(DEFAULT)  # of the skinning that gaps are a share of
        return Work("metrics", name_of(cell), inputs, code)

    def _on_body(self, kind: str, scene: Scene) -> Work:
        code = code_of("benchmarks.ground_truth", scene.module)
        return Work(kind, flat(scene.name), self._scene(scene, code), code)

    def _scene(self, scene: Scene, code: Mapping[str, str]) -> dict[str, Any]:
        inputs = self.inputs(code) | {"scene": declared(scene)}
        if scene.dressed:
            inputs["motion"] = self.motion(scene.name.split("/", 1)[1])
        return inputs

    def inputs(self, code: Mapping[str, str]) -> dict[str, Any]:
        """What code depends on besides itself: sizes that it reads, machine, packages, files it may read."""
        inputs: dict[str, Any] = {"preset": preset_values(self.plan.preset, code), "machine": self.machine}
        if any(path.startswith("snug/") for path in code):
            inputs["files"] = data_files()
            if self.plan.body:
                inputs["body"] = self.plan.body.digest
        return inputs

    def motion(self, name: str) -> str:
        """Of a file its content; an embedded one, or part of one, is made by code, looked at by itself."""
        whole = name.partition(CLIP)[0]
        return f"{name} {digest(self.plan.files[whole])}" if whole in self.plan.files else name


def name_of(cell: Cell) -> str:
    """The name of a cell's records: <scene>/<method>, and the seed where it is not 0."""
    return f"{flat(cell.scene.name)}/{cell.method}" + (f"-seed{cell.seed}" if cell.seed else "")


def flat(scene: str) -> str:
    """The name of a scene as part of a path."""
    return scene.replace("/", "-")


def declared(entry: Any) -> dict[str, Any]:
    """What a scene or a method declares, but for the words about it."""
    fields = {field.name: getattr(entry, field.name) for field in dataclasses.fields(entry)}
    fields.pop("description")
    return {name: dict(value) if isinstance(value, Mapping) else value for name, value in fields.items()}
