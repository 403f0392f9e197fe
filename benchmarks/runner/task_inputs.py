"""Inputs and code of each task: where one of them changes, its stored result is stale.

The code is declared, by folders and files that count as a whole: a test compares them with what they import.
Code that no task names plans, carries out, stores or reports.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from benchmarks import provenance
from benchmarks.fingerprint.dependencies import find_module
from benchmarks.fingerprint.digest import digest, digest_of_file
from benchmarks.method import MethodEntry
from benchmarks.plan.plan import Plan
from benchmarks.scene import Scene

if TYPE_CHECKING:
    from benchmarks.validation.case import Case

SIMULATOR = "reference_sim"
DRESSING = ("snug/data", "snug/body", "snug/motion", "snug/garments", "benchmarks/assets")
CLIPS = ("snug/training/augmentation", "snug/recipes")  # that are mixed from motions, to be simulated
NETWORKS = ("snug", "benchmarks/assets")
SCENES = ("benchmarks/scene.py", "benchmarks/scenes", "benchmarks/meshes.py", "benchmarks/fabrics")
RUNS = (
    SIMULATOR, *SCENES, "benchmarks/external", "benchmarks/method.py", "benchmarks/process",
    "benchmarks/tasks/cell_task.py",
)  # fmt: skip
SOLVERS = ("benchmarks/methods/solvers", "benchmarks/engines")
METRICS = ("benchmarks/metrics", "benchmarks/metric.py", "benchmarks/results", "snug")
CASES = ("benchmarks/tasks/case.py", "benchmarks/validation", "benchmarks/assets", *SOLVERS, *METRICS, *RUNS)
TRAINING = ("benchmarks/tasks/training.py", SIMULATOR, *NETWORKS)
USERS_OWN = ("benchmarks/methods", *METRICS, *RUNS)  # what a user's file may import


class TaskInputs:
    """Inputs of the tasks of one plan: by machine, body, garment, motion, scene and method."""

    def __init__(self, plan: Plan) -> None:
        self.plan, self.preset = plan, plan.preset

    def machine(self, device: str = "cpu") -> dict[str, Any]:
        """Return the machine, as times of another are not reused. device: of a training; else cpu."""
        facts = self._hardware if device == self.plan.device else self._hardware | {"accelerator": None}
        names = ("processor", "python", "accelerator")  # one thread works, however many cores there are
        return {"machine": {name: facts.get(name) for name in names} | {"device": device, "threads": 1}}

    @cached_property
    def _hardware(self) -> dict[str, Any]:
        return provenance.hardware(self.plan.device)

    def of_scene(self, scene: Scene, *code: str) -> dict[str, Any]:
        """Return inputs and code of a task that builds the scene; its metrics are no part of them."""
        declaration = declared(scene) | {"timed": scene.timed, "dynamic": scene.dynamic}
        del declaration["metrics"], declaration["counterpart"]
        inputs = self.machine() | {"scene": declaration}
        code = (*code, *RUNS, *code_behind(scene))
        if not scene.dressed:
            return {"inputs": inputs, "code": code}
        inputs |= self.of_body(scene.garment) | {"motion": self.motion(scene.motion)}
        if scene.motion not in self.plan.motions.train:  # those have a length of their own
            inputs["frames"] = self.preset.frames
        if scene.part == "clip":
            inputs["clip_frames"] = self.preset.clip_frames
        return {"inputs": inputs, "code": (*code, *DRESSING)}

    def of_body(self, garment: str) -> dict[str, Any]:
        """Return the inputs that the assets are made from."""
        names = ("garment_vertices", "train_frames")
        sizes = {name: getattr(self.preset, name) for name in names} | {"garment": garment}
        digests: dict[str, str] = {}
        if user_body := self.plan.inputs.body:
            digests["body"] = user_body.digest
        if (user_garment := self.plan.inputs.garment) and garment == user_garment.name:
            digests["own garment"] = user_garment.digest
        return {"assets": sizes} | digests

    def motion(self, name: str) -> str:
        """Return the name of a motion, with the digest of its content where it is of a file.

        The code that makes an embedded one counts by itself.
        """
        files = self.plan.inputs.motions
        return f"{name} {digest(files[name])}" if name in files else name

    def simulated_by(self, entry: MethodEntry, of_scene: dict[str, Any]) -> dict[str, Any]:
        """Return inputs and code of a task that builds the scene, with those of the method."""
        return {
            "inputs": of_scene["inputs"] | {"method": declared(entry)},
            "code": (*of_scene["code"], *code_behind(entry)),
        }


def declared(entry: MethodEntry | Scene | Case) -> dict[str, Any]:
    """Return what a scene, a method or a case declares, without descriptions; of files their content."""
    fields = {field.name: getattr(entry, field.name) for field in dataclasses.fields(entry)}
    kept = {name: value for name, value in fields.items() if name not in ("description", "label")}
    values = {name: dict(value) if isinstance(value, Mapping) else value for name, value in kept.items()}
    if isinstance(entry, MethodEntry | Scene):
        values["files"] = {path: digest_of_file(Path(path)) for path in values["files"]}
    return values


def code_behind(entry: MethodEntry | Scene) -> tuple[str, ...]:
    """Return the code of a scene or a method: the folder of its module, and what files of a user depend on.

    Raises DeclarationError where its module is missing.
    """
    file = find_module(entry.module)
    code = users_code(file, entry.declared_in)
    if not code:
        folder = Path(file).parent
        code = (file if folder.name == "benchmarks" else folder.as_posix(),)
    if isinstance(entry, MethodEntry):
        code = (*code, *SOLVERS, *(NETWORKS if entry.needs_body or entry.trained else ()))
    return code


def users_code(*homes: str) -> tuple[str, ...]:
    """Return those that are files of users, by absolute paths, and what of ours such a file may import."""
    own = tuple(home for home in homes if Path(home).is_absolute())
    return (*own, *USERS_OWN) if own else ()
