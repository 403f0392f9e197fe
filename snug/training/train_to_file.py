"""Training of one garment's network from the command line: its notes, its checkpoint, its model file."""

from __future__ import annotations

import argparse
import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from reference_sim.files.atomic_files import demand_writable_folder
from snug.body.parametric_body import Body
from snug.file_options import demand_garment_file, is_garment_file, make_garment_file, parse_motion_options
from snug.garments.garment import Garment
from snug.garments.templates import TSHIRT, find_template
from snug.motion.files import load_motions
from snug.motion.library import CONTROL, DYNAMIC_VALIDATION, TRAIN, VALIDATION, make_motion
from snug.motion.motion import Motion
from snug.named_recipes import RECIPE_OF_KIND, find_recipe
from snug.networks.dressed_body import DressedBody
from snug.networks.trained_model import TrainedModel
from snug.recipe import Recipe
from snug.training.checkpoint import Checkpoint
from snug.training.kinds import find_kind
from snug.training.process_group import Group
from snug.training.simulated_data import DataSet, settings_of
from snug.training.train_network import train_network
from snug.training.validation import Validation
from snug.training.vertex_targets import StoredVertices


@dataclass(frozen=True)
class ChosenGarment:
    """A garment that a network is trained for.

    Attributes:
        name: of the template or file.
        description: in words.
        make: function of (body, vertices=...) that returns it; one that is read has the vertices of its file.
    """

    name: str
    description: str
    make: Callable[..., Garment]


def choose_garments(options: argparse.Namespace) -> list[ChosenGarment]:
    """Return the garments to train for, each once; the T-shirt if none is named. Raises ValueError."""
    if not any(map(is_garment_file, options.garment)):
        demand_garment_file(options)
    return [
        _garment_of_file(word, options) if is_garment_file(word) else _tailored_garment(word)
        for word in dict.fromkeys(options.garment or [TSHIRT])
    ]


def _tailored_garment(name: str) -> ChosenGarment:
    template = find_template(name)
    return ChosenGarment(template.name, template.description, template.tailor)


def _garment_of_file(path: str, options: argparse.Namespace) -> ChosenGarment:
    from snug.garments.reading import read_garment  # a tailored garment needs no reader of meshes

    file = make_garment_file(path, options)

    def read(body: Body, *, vertices: int) -> Garment:
        return read_garment(file, body)

    return ChosenGarment(file.name, f"garment of {path}", read)


def output_files(out: Path, garments: Sequence[ChosenGarment]) -> list[Path]:
    """Return the model file of each garment.

    Raises ValueError for one that cannot be written: now rather than after the training.
    """
    files = [out]
    if len(garments) > 1:
        files = [out.with_name(f"{out.stem}-{garment.name}{out.suffix}") for garment in garments]
    if duplicate := next((path for path in files if files.count(path) > 1), None):
        raise ValueError(f"--garment: two of them would be {duplicate}: rename a file")
    for path in files:
        if path.is_dir():
            raise ValueError(f"--out {path}: is a folder; name a file")
        try:
            demand_writable_folder(path.parent)
        except ValueError as error:
            raise ValueError(f"--out {path}: {error}") from None
    return files


def choose_motions(options: argparse.Namespace, data: DataSet | None) -> tuple[list[Motion], list[Motion]]:
    """Return the motions to train on and those to validate with. Raises ValueError for an unknown name."""
    reading = parse_motion_options(options)
    motions = data.motions if data else [make_motion(name) for name in TRAIN]
    if options.motions:
        motions = load_motions(options.motions, options=reading)
    names = [motion.name for motion in motions]
    others = [
        name for name in (*VALIDATION, *DYNAMIC_VALIDATION, *CONTROL) if name not in names
    ]  # of the library: they never train
    for option, known in (("hold_out", names), ("validation", [*names, *others])):
        for name in getattr(options, option):
            if name not in known:
                raise ValueError(
                    f"--{option.replace('_', '-')} {name}: no such motion among {', '.join(known)}"
                )
    left_out = {*options.hold_out, *options.validation}
    training = [motion for motion in motions if motion.name not in left_out]
    validating = [motion for motion in motions if motion.name in options.validation]
    validating += [make_motion(name) for name in others if name in options.validation]
    return training, validating


def train_to_file(
    options: argparse.Namespace,
    body: Body,
    garment: ChosenGarment,
    motions: list[Motion],
    held_out: list[Motion],
    data: DataSet | None,
    output: Path,
    *,
    device: str,
    group: Group,
    stop: Callable[[], bool],
) -> None:
    """Train the network of one garment by the checked options of the command, and write it to `output`.

    Args:
        options: of the command line.
        body: wears the garment.
        garment: that it is trained for.
        motions: to train on.
        held_out: to validate with.
        data: simulated motions, or None.
        output: the model file.
        device: `cpu` or `cuda`.
        group: processes that share the training.
        stop: whether the process was asked to end.

    Raises:
        ValueError: for unfit data, or an existing model of another command that was to be resumed.
        Interrupted: when asked to stop.
    """
    say = print if group.writes else lambda *_: None
    recipe = find_recipe(options.recipe) if options.recipe else RECIPE_OF_KIND[options.model]
    checkpoint = Checkpoint(
        path=output.with_name(f"{output.stem}.checkpoint.safetensors"), steps=options.checkpoint_steps,
        minutes=options.checkpoint_minutes, resume=options.resume,
    )  # fmt: skip
    if checkpoint.path.is_file() and not options.resume:
        say(f"note: {checkpoint.path} of a stopped run will be replaced; --resume would go on with it")
    dressed = DressedBody(body, garment.make(body, vertices=options.vertices))
    trajectories = None
    if data is not None:
        data.check(settings_of(body, dressed.garment))
        trajectories = None if find_kind(options.model).physics else data.targets
    learned_from = digest_inputs(dressed, motions, held_out, trajectories or {})
    if options.resume and output.is_file() and not checkpoint.path.is_file():
        _check_finished(output, options, recipe, dressed.vertices, learned_from)
        say(f"{output}: is there, and no checkpoint beside it; nothing to resume")
        return
    if output.is_file():
        say(f"note: {output} will be replaced when this training has ended")
    frames = sum(motion.frames for motion in motions)
    say(f"{garment.description}: {dressed.vertices} vertices, {len(motions)} motions, "
        f"{frames} frames, recipe {recipe.name}")  # fmt: skip
    validation = None
    if held_out:
        validation = Validation(
            motions=held_out, every=options.validate_every, patience=options.patience,
            trajectories=trajectories,
        )  # fmt: skip
    model = train_network(
        options.model, dressed, motions, steps=options.steps, seed=options.seed, recipe=recipe,
        trajectories=trajectories, device=device, checkpoint=checkpoint, validation=validation,
        group=group, stop=stop,
    )  # fmt: skip
    if group.writes:
        model.summary["learned_from"] = learned_from
        print_summary(model)
        print(model.save(output))
        checkpoint.delete()


def _check_finished(
    output: Path, options: argparse.Namespace, recipe: Recipe, vertices: int, learned_from: str
) -> None:
    """Raise ValueError unless the existing model is the one that the command trains."""
    model = TrainedModel.load(output)
    facts = {
        "model": (model.kind, options.model),
        "recipe": (model.recipe, recipe),
        "seed": (model.seed, options.seed),
        "vertices": (model.vertices, vertices),
        "number of steps": (model.steps, model.steps if options.patience else options.steps),
        "body, garment or motions": (model.summary.get("learned_from"), learned_from),
    }
    differing = [name for name, (stored, wanted) in facts.items() if stored != wanted]
    if differing:
        raise ValueError(f"{output}: of another {differing[0]}; name another --out, or leave out --resume")


def digest_inputs(
    dressed: DressedBody,
    motions: list[Motion],
    held_out: list[Motion],
    simulated: Mapping[str, StoredVertices],
) -> str:
    """Return a digest of body, garment, training and validation motions, and simulated vertices."""
    contents = sorted((name, simulated[name].content) for name in simulated)
    body, garment = dressed.body, dressed.garment
    digest = hashlib.sha256(repr((settings_of(body, garment), contents, garment.authored_weights)).encode())
    for array in (garment.skinning_weights, body.shape_directions, body.joint_directions):
        digest.update((np.round(array, 6) + 0.0).tobytes())
    for role, several in (("train", motions), ("validate", held_out)):
        for motion in several:
            digest.update(f"{role} {motion.name} {motion.fps}".encode())
            for array in (motion.poses, motion.translations):  # the last bits are of the processor
                digest.update((np.round(array, 6) + 0.0).tobytes())
    return digest.hexdigest()[:16]


def print_summary(model: TrainedModel) -> None:
    """Print the last losses, the times of a step's parts, and high windows."""
    row, unit = model.history[-1], model.unit
    terms = [f"{name} {value:.4g}" for name, value in row.items()
             if "/" not in name and name not in ("step", "seconds")]  # fmt: skip
    parts = {name: value for name, value in row.items() if "/" in name}
    print(f"last steps, {unit}, mean over frames: " + "  ".join(terms))
    print("ms a step: " + "  ".join(f"{n.removeprefix('seconds/')} {1e3 * s:.1f}" for n, s in parts.items()))
    for window in model.summary["named_windows"][:5]:
        print("step {step}: {window} at {joules} {unit}, {action}".format(**window, unit=unit))
    if validation := model.summary.get("validation"):
        best, step = validation["best"], validation["best_step"]
        print(f"validation {best:.4g} {unit} at step {step}, whose weights are kept")
    print(f"{model.steps} steps in {model.seconds:.0f} s after {model.setup_seconds:.0f} s of preparation, "
          f"{model.megabytes:.1f} MB")  # fmt: skip
