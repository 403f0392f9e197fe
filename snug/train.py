"""The command `python -m snug.train`."""

from __future__ import annotations

import argparse
import hashlib
import os
import signal
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from reference_sim.command.command_line import command
from snug.garments.options import demand_garment_file, is_garment_file, make_garment_file
from snug.motion.options import parse_motion_options
from snug.recipes.named import RECIPE_OF_KIND, find_recipe
from snug.training.options import check, parse

if TYPE_CHECKING:
    from snug.body.parametric_body import Body
    from snug.garments.garment import Garment
    from snug.garments.templates import GarmentTemplate
    from snug.networks.dressed_body import DressedBody
    from snug.networks.trained_model import TrainedModel
    from snug.recipes.recipe import Recipe
    from snug.training.process_group import Group
    from snug.training.simulated_data import DataSet


@command("snug.train", goes_on="--resume goes on from there")
def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; returns its exit status."""
    options = parse(arguments)
    import torch

    from snug.body.smpl_files import read_body
    from snug.garments.templates import TSHIRT, find_template
    from snug.training.device import find_device
    from snug.training.process_group import join_group, leave_group
    from snug.training.run import Interrupted
    from snug.training.simulated_data import DataSet

    check(options)
    if not any(map(is_garment_file, options.garment)):
        demand_garment_file(options)
    templates = [
        _of_file(word, options) if is_garment_file(word) else find_template(word)
        for word in dict.fromkeys(options.garment or [TSHIRT])
    ]
    outs = _outs(Path(options.out), templates)
    device = find_device(options.device)
    torch.set_num_threads(options.threads)
    data = DataSet.read(options.dataset) if options.dataset else None
    motions, held_out = _motions(options, data)
    stop = _StopRequest()
    group, device = join_group(device)
    if options.motions and group.writes:
        for motion in [*motions, *held_out]:
            print(f"motion {motion.name}: {motion.source}", file=sys.stderr)
    try:
        body = read_body(options.body)
        outs[0].parent.mkdir(parents=True, exist_ok=True)
        for template, out in zip(templates, outs):
            garment = (body, template)
            _train_one(options, garment, data, motions, held_out, out, str(device), group, stop)
    except Interrupted as interrupted:
        if group.writes:
            print(f"snug.train: {interrupted}; go on with --resume", file=sys.stderr)
        return 130
    finally:
        leave_group()
    return 0


def _of_file(path: str, options: argparse.Namespace) -> GarmentTemplate:
    """A garment that is read instead of tailored, whatever number of vertices is asked for."""
    from snug.garments.reading import read_garment
    from snug.garments.templates import GarmentTemplate

    file = make_garment_file(path, options)

    def tailor(body: Body, *, vertices: int) -> Garment:
        return read_garment(file, body)

    return GarmentTemplate(file.name, f"garment of {path}", tailor)


def _outs(out: Path, templates: Sequence[Any]) -> list[Path]:
    """The file of each garment. What cannot be written is refused now rather than after the training."""
    outs = [out]
    if len(templates) > 1:
        outs = [out.with_name(f"{out.stem}-{template.name}{out.suffix}") for template in templates]
    if twice := next((path for path in outs if outs.count(path) > 1), None):
        raise ValueError(f"--garment: two of them would be {twice}: rename a file")
    for path in outs:
        there = next(folder for folder in path.absolute().parents if folder.exists())
        if path.is_dir():
            raise ValueError(f"--out {path}: is a folder; name a file")
        if not there.is_dir() or not os.access(there, os.W_OK | os.X_OK):
            raise ValueError(f"--out {path}: {there} cannot be written to; name another folder")
    return outs


def _motions(options: argparse.Namespace, data: DataSet | None) -> tuple[list[Any], list[Any]]:
    """Motions to train on and to validate with. Raises ValueError for a name that is not there."""
    from snug.motion.files import load_motions
    from snug.motion.library import TRAIN, VALIDATION, make_motion

    reading = parse_motion_options(options)
    motions = data.motions() if data else [make_motion(name) for name in TRAIN]
    if options.motions:
        motions = load_motions(options.motions, options=reading)
    names = [motion.name for motion in motions]
    others = [name for name in VALIDATION if name not in names]  # of the library: they never train
    for word, known in (("hold_out", names), ("validation", [*names, *others])):
        for name in getattr(options, word):
            if name not in known:
                raise ValueError(
                    f"--{word.replace('_', '-')} {name}: no such motion among {', '.join(known)}"
                )
    left_out = {*options.hold_out, *options.validation}
    training = [motion for motion in motions if motion.name not in left_out]
    validating = [motion for motion in motions if motion.name in options.validation]
    validating += [make_motion(name) for name in others if name in options.validation]
    return training, validating


class _StopRequest:
    """True once the process was asked to end; a second request ends it at once."""

    def __init__(self) -> None:
        self.asked = False
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._ask)

    def _ask(self, number: int, frame: Any) -> None:
        self.asked = True
        signal.signal(number, signal.SIG_DFL)

    def __call__(self) -> bool:
        return self.asked


def _train_one(
    options: argparse.Namespace,
    garment: tuple[Any, Any],
    data: DataSet | None,
    motions: list[Any],
    held_out: list[Any],
    out: Path,
    device: str,
    group: Group,
    stop: Callable[[], bool],
) -> None:
    from snug.networks.dressed_body import DressedBody
    from snug.networks.trained_model import find_kind
    from snug.training.run import Saving
    from snug.training.simulated_data import settings_of
    from snug.training.tensorboard_log import TensorBoardLog
    from snug.training.train import train
    from snug.training.validation import Validation

    saving = Saving(
        path=out.with_name(f"{out.stem}.checkpoint.safetensors"), steps=options.checkpoint_steps,
        minutes=options.checkpoint_minutes, resume=options.resume,
    )  # fmt: skip
    say = print if group.writes else lambda *_: None
    if saving.path.is_file() and not options.resume:
        say(f"note: {saving.path} of a stopped run will be replaced; --resume would go on with it")
    body, template = garment
    dressed = DressedBody(body, template.tailor(body, vertices=options.vertices))
    if data:
        data.check(settings_of(body, dressed.garment))
    trajectories = data.targets() if data and not find_kind(options.model).physics else None
    learned_from = _digest(dressed, motions, held_out, trajectories or {})
    if options.resume and out.is_file() and not saving.path.is_file():
        _check_ended(out, options, dressed.vertices, learned_from)
        say(f"{out}: is there, and no checkpoint beside it; nothing to resume")
        return
    if out.is_file():
        say(f"note: {out} will be replaced when this training has ended")
    frames = sum(motion.frames for motion in motions)
    say(f"{template.description}: {dressed.vertices} vertices, {len(motions)} motions, {frames} frames, "
        f"recipe {_recipe(options).name}")  # fmt: skip
    validation = None
    if held_out:
        validation = Validation(
            motions=held_out, every=options.validate_every, patience=options.patience,
            trajectories=trajectories,
        )  # fmt: skip
    curves = None
    if options.tensorboard and group.writes:
        curves = TensorBoardLog(Path(options.tensorboard) / out.stem)
    try:
        model = train(
            options.model, dressed, motions, steps=options.steps, seed=options.seed,
            recipe=_recipe(options), trajectories=trajectories, log=curves.write if curves else None,
            device=device, saving=saving, validation=validation, group=group, stop=stop,
        )  # fmt: skip
    finally:
        if curves:
            curves.close()
    if group.writes:
        model.summary["learned_from"] = learned_from
        _tell(model)
        print(model.save(out))
        saving.done()


def _recipe(options: argparse.Namespace) -> Recipe:
    """The one named, or the model's own."""
    return find_recipe(options.recipe) if options.recipe else RECIPE_OF_KIND[options.model]


def _digest(
    dressed: DressedBody, motions: Sequence[Any], held_out: Sequence[Any], simulated: Mapping[str, Any]
) -> str:
    """Of body, garment, motions, those that validate included, and simulated vertices."""
    import numpy as np

    from snug.training.simulated_data import settings_of

    taught = sorted((name, simulated[name].content) for name in simulated)
    body, garment = dressed.body, dressed.garment
    found = hashlib.sha256(repr((settings_of(body, garment), taught, garment.authored_weights)).encode())
    for array in (garment.skinning_weights, body.shape_directions, body.joint_directions):
        found.update((np.round(array, 6) + 0.0).tobytes())
    for role, several in (("train", motions), ("validate", held_out)):
        for motion in several:
            found.update(f"{role} {motion.name} {motion.fps}".encode())
            for array in (motion.poses, motion.translations):  # the last bits are of the processor
                found.update((np.round(array, 6) + 0.0).tobytes())
    return found.hexdigest()[:16]


def _check_ended(out: Path, options: argparse.Namespace, vertices: int, learned_from: str) -> None:
    """Raises ValueError where the model there is not what this command trains."""
    from snug.networks.trained_model import TrainedModel

    there, asked = TrainedModel.load(out), _recipe(options)
    if "learned_from" not in there.summary:
        raise ValueError(f"{out}: does not say what it learned from, as models of before; name another --out")
    pairs = {
        "model": (there.kind, options.model),
        "recipe": (there.recipe, asked),
        "seed": (there.seed, options.seed),
        "vertices": (there.vertices, vertices),
        "number of steps": (there.steps, there.steps if options.patience else options.steps),
        "body, garment or motions": (there.summary["learned_from"], learned_from),
    }
    if other := [name for name, (found, mine) in pairs.items() if found != mine]:
        raise ValueError(f"{out}: of another {other[0]}; name another --out, or leave out --resume")


def _tell(model: TrainedModel) -> None:
    from snug.networks.trained_model import find_kind

    unit = find_kind(model.kind).unit
    last = {name: value for name, value in model.history[-1].items() if "/" not in name}
    parts = {name: value for name, value in model.history[-1].items() if "/" in name}
    terms = [f"{name} {value:.4g}" for name, value in last.items() if name not in ("step", "seconds")]
    print(f"last steps, {unit}, mean over frames: " + "  ".join(terms))
    print("ms a step: " + "  ".join(f"{n.removeprefix('seconds/')} {1e3 * s:.1f}" for n, s in parts.items()))
    for window in model.summary["named_windows"][:5]:
        print("step {step}: {window} at {joules} {unit}, {action}".format(**window, unit=unit))
    if found := model.summary.get("validation"):
        best, step = found["best"], found["best_step"]
        print(f"validation {best:.4g} {unit} at step {step}, whose weights are kept")
    print(f"{model.steps} steps in {model.seconds:.0f} s after {model.setup_seconds:.0f} s of preparation, "
          f"{model.megabytes:.1f} MB")  # fmt: skip


if __name__ == "__main__":
    sys.exit(main())
