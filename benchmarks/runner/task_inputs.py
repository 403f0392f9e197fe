"""Inputs and modules of each task: where one of them changes, its stored result is stale."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping
from functools import cached_property
from pathlib import Path
from pkgutil import iter_modules
from typing import TYPE_CHECKING, Any

from benchmarks import provenance
from benchmarks.fingerprint.digest import digest, digest_of_file
from benchmarks.method import MethodEntry
from benchmarks.plan.plan import Plan
from benchmarks.scene import Scene
from snug.recipes.recipe import TERMS

if TYPE_CHECKING:
    from benchmarks.validation.case import Case

ASSETS = "benchmarks.assets.assets"


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

    def of_scene(self, scene: Scene, *modules: str) -> dict[str, Any]:
        """Return inputs and modules of a task that builds the scene; its metrics are no part of them."""
        declaration = declared(scene) | {"timed": scene.timed, "dynamic": scene.dynamic}
        del declaration["metrics"], declaration["counterpart"]
        inputs = self.machine() | {"scene": declaration}
        modules = (*modules, *modules_behind(scene))
        if not scene.dressed:
            return {"inputs": inputs, "modules": modules}
        inputs |= self.of_body(scene.garment) | {"motion": self.motion(scene.motion)}
        if scene.motion not in self.plan.motions.train:  # those have a length of their own
            inputs["frames"] = self.preset.frames
        if scene.part == "clip":
            inputs["clip_frames"] = self.preset.clip_frames
        return {"inputs": inputs, "modules": (*modules, ASSETS)}

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
        """Return inputs and modules of a task that builds the scene, with those of the method."""
        return {
            "inputs": of_scene["inputs"] | {"method": declared(entry)},
            "modules": (*of_scene["modules"], *modules_behind(entry)),
        }


def declared(entry: MethodEntry | Scene | Case) -> dict[str, Any]:
    """Return what a scene, a method or a case declares, without descriptions; of files their content."""
    fields = {field.name: getattr(entry, field.name) for field in dataclasses.fields(entry)}
    kept = {name: value for name, value in fields.items() if name not in ("description", "label")}
    values = {name: dict(value) if isinstance(value, Mapping) else value for name, value in kept.items()}
    if isinstance(entry, MethodEntry | Scene):
        values["files"] = {path: digest_of_file(Path(path)) for path in values["files"]}
    return values


def modules_behind(entry: MethodEntry | Scene) -> tuple[str, ...]:
    """Return the module of a scene or a method, and the file that declares it where that is a user's."""
    return tuple(dict.fromkeys(filter(None, (entry.module, entry.declared_in))))


def modules_of(terms: Iterable[str]) -> tuple[str, ...]:
    """Modules of energies that a recipe names beside the usual ones: they are found by name, not imported."""
    if set(terms) <= set(TERMS):
        return ()
    from reference_sim import energies

    return tuple(f"{energies.__name__}.{module.name}" for module in iter_modules(energies.__path__))
